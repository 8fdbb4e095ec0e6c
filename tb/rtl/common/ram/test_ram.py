"""Memory with one write and one read port, in VHDL, and what synthesis makes of it.

Sweep: latencies of 0, 1 and 2 clocks, styles, words of 1 to 40 bits, with and without contents.
Stimulus: random writes and reads in every clock, a third of them at the same address; contents
are read before anything is written.
Checks: the word at the output in every clock, against a list in Python; the contents in the
netlist, bit for bit; block RAMs and LUTs that Yosys takes; the attributes; generics that are
refused.
Timing: the latency is what is checked; a write and a read in every clock.
Does not prove: that a vendor's tool heeds the attributes.
"""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from scripts.hdl import conversion
from scripts.hdl.clocks import clocks_of
from scripts.hdl.ghdl import BenchError, BuildError
from scripts.hdl.sources import RTL
from scripts.measure import synth
from tb.helpers.faults import Fault, assert_seen, file_of
from tb.helpers.simulation import Outcome, run

#: Eight words of five bits.
CONTENTS = f"{random.Random(5).getrandbits(40):040b}"
#: Clocks from address to word with the default generics, as the header declares.
LATENCY = clocks_of("ram", "latency")


def bench(
    address: int = 3,
    width: int = 5,
    latency: int = LATENCY,
    style: str = "auto",
    contents: str = "",
    clocks: int = 600,
    rtl: Path = RTL,
) -> Outcome:
    generics = {
        "ADDRESS_WIDTH": address,
        "WIDTH": width,
        "LATENCY": latency,
        "STYLE": style,
    }
    if contents:
        generics["CONTENTS"] = contents
    return run(
        "ram",
        generics=generics,
        arguments={"seed": 100 * width + latency, "clocks": clocks},
        rtl=rtl,
    )


@pytest.mark.parametrize(
    ("address", "width", "latency", "style"),
    [
        (3, 5, 0, "distributed"),
        (1, 1, 0, "auto"),
        (3, 5, 1, "block"),
        (4, 40, 1, "auto"),
        (3, 5, 2, "block"),
        (3, 5, 1, "apart"),
        (3, 5, 2, "apart"),
        (1, 7, 2, "distributed"),
    ],
)
def test_words_come_out_in_time(address: int, width: int, latency: int, style: str) -> None:
    assert bench(address, width, latency, style).checks["words"] >= 500


@pytest.mark.parametrize("latency", [0, 1, 2])
def test_contents_are_there_at_power_up(latency: int) -> None:
    found = bench(latency=latency, contents=CONTENTS)
    assert found.covered["words at power-up"] == 8
    assert found.checks["words"] >= 590


def test_contents_reach_the_netlist() -> None:
    generics = {"ADDRESS_WIDTH": 3, "WIDTH": 5, "CONTENTS": CONTENTS}
    text = conversion.cached("ram", generics).read_text(encoding="utf-8")
    found = re.findall(r"memory\[(\d+)\] = 5'b([01]{5});", text)
    assert {int(place): word for place, word in found} == {
        i: CONTENTS[35 - 5 * i : 40 - 5 * i] for i in range(8)
    }
    assert "memory[read_address]" in text  # no arithmetic on the address


@pytest.mark.parametrize(
    "generics",
    [
        {"STYLE": "ultra"},
        {"STYLE": "block", "LATENCY": 0},
        {"ADDRESS_WIDTH": 3, "WIDTH": 5, "CONTENTS": "10101"},
    ],
)
def test_impossible_generics_are_refused(generics: dict[str, object]) -> None:
    names = {"ADDRESS_WIDTH": "address", "LATENCY": "latency", "STYLE": "style"}
    names |= {"WIDTH": "width", "CONTENTS": "contents"}
    with pytest.raises((BenchError, BuildError), match="ram: "):
        bench(**{names[key]: value for key, value in generics.items()})


@pytest.mark.parametrize("family", ["xc3s", "ecp5"])
@pytest.mark.parametrize("latency", [1, 2])
def test_a_large_memory_is_a_block_ram(family: str, latency: int) -> None:
    generics = {"ADDRESS_WIDTH": 9, "WIDTH": 18, "LATENCY": latency}
    assert synth.measure("ram", generics, family)["bram"] == 1


def test_a_combinational_memory_is_none() -> None:
    generics = {"ADDRESS_WIDTH": 4, "WIDTH": 8, "LATENCY": 0}
    found = synth.measure("ram", generics, "xc3s")
    assert (found["bram"], found["ff"], found["cells"]["RAM16X1D"]) == (0, 0, 8)


def test_the_attributes_stand_on_the_memory() -> None:
    text = file_of("ram").read_text(encoding="utf-8")
    assert dict(re.findall(r"attribute (\w+) of memory\s+: signal is (\w+);", text)) == {
        "ram_style": "XILINX",  # Vivado, XST
        "ramstyle": "QUARTUS",
        "syn_ramstyle": "LATTICE",  # Synplify, LSE
    }


# of a memory that may be read while it is written
READ = """if (read = '1') then
          word <= memory(to_integer(unsigned(read_address)));
        end if;"""


@pytest.mark.parametrize(
    ("old", "new", "latency", "contents"),
    [
        ("if (write = '1')", "if (true)", 1, ""),
        (READ, READ.replace("read = '1'", "true"), 1, ""),
        ("read_word <= word;\n      end if;", "end if;", 2, ""),
        (":= CONTENTS;", ":= not CONTENTS;", 1, CONTENTS),
        ("memory(to_integer(unsigned(write_address)))", "memory(0)", 0, ""),
    ],
)
def test_a_fault_is_seen(tmp_path: Path, old: str, new: str, latency: int, contents: str) -> None:
    assert_seen(
        Fault("ram", old, new, "words"),
        tmp_path,
        lambda rtl: bench(latency=latency, contents=contents, rtl=rtl),
    )
