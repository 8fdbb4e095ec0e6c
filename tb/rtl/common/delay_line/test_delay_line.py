"""Words in, the same words out so many clocks later; in VHDL and as the netlist made from it.

Sweep: every delay from 3 to 17 clocks, words of 1, 11 and 40 bits; once through GHDL, once the
converted Verilog through Verilator, its registers and memories beginning with random contents.
Stimulus: a random word in every clock; resets of one clock and more, close and far apart.
Checks: every word that comes out a full delay after the last reset, in every clock.
Timing: the delay is what is checked; one word a clock.
Does not prove: what comes out sooner after a reset, which is void.
"""

from __future__ import annotations

import random
import tempfile
from pathlib import Path

import pytest

from scripts.hdl import conversion as netlist
from scripts.hdl import netlist_check
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL, compile_order, rtl_files
from scripts.shared import tools
from tb.helpers.faults import Fault, assert_seen, seen
from tb.helpers.simulation import Outcome, run
from tb.rtl.common.delay_line.delays import DELAYS, due, stimulus

WIDTHS = (1, 11, 40)
FLAT = Path(__file__).with_name("delay_line_flat.vhd")
FILES = [FLAT, Path(__file__).with_name("delay_line_pairs.vhd")]


def bench(width: int = 11, clocks: int = 3000, rtl: Path = RTL) -> Outcome:
    """The VHDL in GHDL."""
    return run(
        "delay_line_flat",
        "tb.rtl.common.delay_line.bench_delay_line",
        units=["delay_line"],
        files=[FLAT],
        generics={"WIDTH": width},
        arguments={"seed": width, "clocks": clocks},
        rtl=rtl,
    )


def netlist_bench(
    width: int = 11, clocks: int = 6000, rtl: Path = RTL, *, check: bool = True
) -> dict[int, int]:
    """The netlist in Verilator; words that each delay's line was seen to bring out in time.

    Without `check` the conversion refuses no netlist, so that a wrong one is simulated.
    """
    rng = random.Random(width)
    words, resets = stimulus(rng, clocks, width)
    inputs = {
        "align_0": resets[::2], "align_1": resets[1::2],
        "word_0": words[::2], "word_1": words[1::2],
    }  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="delay-line-") as name:
        verilog, _ = netlist.convert(
            "delay_line_pairs",
            {"WIDTH": width},
            Path(name) / "delay_line_pairs.v",
            files=[*compile_order("delay_line", rtl_files(rtl)), *FILES],
            check=check,
        )
        found = netlist_check.ports_of(verilog, "delay_line_pairs")
        # without gaps a pair follows the other, so that every clock is one of the stimulus
        answers = [
            netlist_check.simulate(
                "delay_line_pairs",
                {"WIDTH": width},
                inputs,
                ports=netlist_check.Ports(found.inputs, found.outputs, tuple(inputs)),
                verilog=verilog,
                seed=seed,
                gap=0,
            )
            for seed in (1, 2, 3)
        ]
    checks = dict.fromkeys(DELAYS, 0)
    for delay in DELAYS:
        wanted = due(words, resets, delay)
        for answer in answers:
            shown = [0] * clocks  # after the edge of each clock; after the last one nobody looks
            for n, (before, after) in enumerate(
                zip(answer.outputs["delayed_0"], answer.outputs["delayed_1"], strict=True)
            ):
                shown[2 * n] = after
                if n:
                    shown[2 * n - 1] = before
            for k in range(clocks - 1):
                if (want := wanted[k]) is None:
                    continue
                got = shown[k] >> (delay - 3) * width & ((1 << width) - 1)
                if got != want:
                    raise CheckError(f"{delay} clocks: {got:#x}, not {want:#x}; clock {k}")
                checks[delay] += 1
    return checks


@pytest.mark.parametrize("width", WIDTHS)
def test_words_come_out_in_time(width: int) -> None:
    found = bench(width)
    assert min(found.checks[f"{clocks} clocks"] for clocks in DELAYS) >= 1000


@pytest.mark.parametrize("width", WIDTHS)
def test_the_netlists_words_come_out_in_time(width: int) -> None:
    assert min(netlist_bench(width).values()) >= 6000


test_a_fault_is_seen = seen(
    "delay_line",
    lambda rtl: bench(clocks=1000, rtl=rtl),
    ("place <= 0;", "place <= place_t'high;", r"\d+ clocks: got"),
    ("ring(place) <= word;", "ring(following(place)) <= word;", r"\d+ clocks: got"),
)


#: The delay line's process, and the same with the order of the places as a constant array.
RING = """  p_ring : process (clk) is
  begin

    if rising_edge(clk) then
      delayed     <= ring(place);
      ring(place) <= word;

      place <= following(place);
"""
TABLE_OF_PLACES = """  p_ring : process (clk) is

    type order_t is array (0 to 15) of natural range 0 to 15;

    function order_of return order_t is

      variable order : order_t := (others => 0);

    begin

      for i in place_t loop
        order(i) := following(i);
      end loop;

      return order;

    end function order_of;

    constant ORDER : order_t := order_of;

  begin

    if rising_edge(clk) then
      delayed     <= ring(place);
      ring(place) <= word;

      place <= ORDER(place);
"""


NETLIST_FAULTS = [
    Fault("delay_line", "place <= 0;", "place <= place_t'high;", r"\d+ clocks: "),
]
if netlist.loses(tools.version("ghdl")):
    # right in VHDL, but the order of two places becomes a constant of zeros, see conversion
    NETLIST_FAULTS.append(Fault("delay_line", RING, TABLE_OF_PLACES, r"\d+ clocks: "))


@pytest.mark.parametrize("fault", NETLIST_FAULTS, ids=str)
def test_a_fault_is_seen_netlist(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, lambda rtl: netlist_bench(clocks=2000, rtl=rtl, check=False))


def test_the_short_benches_see_no_fault_where_none_is() -> None:
    bench(clocks=1000, rtl=RTL)
    netlist_bench(clocks=2000, rtl=RTL, check=False)
