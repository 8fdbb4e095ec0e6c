"""The chain of flip-flops that brings bits to a clock.

Sweep: two to eight stages, one bit and several.
Stimulus: random bits, changed before seven clocks of ten.
Checks: every bit comes out STAGES clocks later, in every clock; a single stage is refused; the
attributes that keep synthesis from changing the chain stand on the signal of the chain; Yosys
keeps all flip-flops.
Timing: the latency is what is checked.
Does not prove: anything about metastability, or that a vendor's tool heeds the attributes.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from scripts.hdl.clocks import clocks_of
from scripts.hdl.ghdl import BenchError, BuildError
from scripts.hdl.sources import RTL
from scripts.measure import synth
from tb.helpers.faults import Fault, assert_seen, file_of
from tb.helpers.simulation import Outcome, run

#: Attributes that each tool heeds, and their values.
ATTRIBUTES = {
    "async_reg": '"TRUE"',  # Vivado
    "shreg_extract": '"no"',  # Vivado, XST
    "register_balancing": '"no"',  # XST
    "register_duplication": '"no"',  # XST
    "preserve": "true",  # Quartus
    "syn_preserve": "true",  # Synplify, LSE
    "syn_srlstyle": '"registers"',  # Synplify, LSE
    "syn_replicate": "false",  # Synplify, LSE
}


#: Clocks with the default number of stages, as the header declares.
LATENCY = clocks_of("sync_bits", "latency")


def bench(width: int = 3, stages: int = LATENCY, clocks: int = 500, rtl: Path = RTL) -> Outcome:
    return run(
        "sync_bits",
        generics={"WIDTH": width, "STAGES": stages},
        arguments={"seed": 10 * width + stages, "clocks": clocks},
        rtl=rtl,
    )


@pytest.mark.parametrize(("width", "stages"), [(1, LATENCY), (3, LATENCY), (1, 3), (5, 8)])
def test_bits_come_out_in_time(width: int, stages: int) -> None:
    assert bench(width, stages).checks["bits"] >= 490


def test_one_stage_is_refused() -> None:
    with pytest.raises((BenchError, BuildError)):
        bench(1, 1)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<= stage(STAGES);", "<= stage(STAGES - 1);"),
        ("<= stage(STAGES);", "<= not stage(STAGES);"),
        ("<= asynchronous & stage(1 to STAGES - 1);", "<= (others => asynchronous);"),
        ("<= asynchronous & stage(1 to STAGES - 1);", "<= stage(1) & stage(1 to STAGES - 1);"),
    ],
)
def test_a_fault_is_seen(tmp_path: Path, old: str, new: str) -> None:
    assert_seen(Fault("sync_bits", old, new, "bits"), tmp_path, lambda rtl: bench(rtl=rtl))


def test_the_attributes_stand_on_the_chain() -> None:
    text = file_of("sync_bits").read_text(encoding="utf-8")
    found = dict(re.findall(r"attribute (\w+) of stage\s+: signal is (\S+);", text))
    assert found == ATTRIBUTES
    assert "FORCED IF ASYNCHRONOUS" in text  # Quartus


@pytest.mark.parametrize("family", ["xc3s", "ecp5"])
def test_synthesis_keeps_every_flip_flop(family: str) -> None:
    # GHDL's Verilog has lost the attributes by then
    found = synth.measure("sync_bits", {"WIDTH": 4, "STAGES": 3}, family)
    assert (found["ff"], found["lut"]) == (12, 0)
