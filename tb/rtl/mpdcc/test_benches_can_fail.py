"""Seeded faults: every bench has to turn red when the RTL it looks at is wrong.

Sweep: one fault at a time, at least one for each bench, put into a copy of the design.
Stimulus: that of the benches, fewer rounds.
Checks: the bench fails, and passes without a fault; a fault whose text is not found exactly once,
or that does not compile, is an error of this table and not a success.
Does not prove: that no other fault slips through.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from directmpc.mpdcc.variants import VARIANTS
from scripts.hdl import mpdcc_rows as core
from scripts.hdl import states
from scripts.hdl.ghdl import BenchError
from scripts.hdl.sources import RTL
from scripts.shared import tools
from tb.helpers.faults import altered
from tb.rtl.common.delay_line import test_delay_line
from tb.rtl.common.mac_block import test_mac_block
from tb.rtl.mpdcc.binary_search import test_binary_search
from tb.rtl.mpdcc.candidate_enumerator import test_candidate_enumerator
from tb.rtl.mpdcc.capacitor_search import test_capacitor_search
from tb.rtl.mpdcc.common_terms import test_common_terms
from tb.rtl.mpdcc.explorer_fast import test_explorer_fast
from tb.rtl.mpdcc.mpdcc_core import test_core_reset, test_deadlock_rule, test_sese_core
from tb.rtl.mpdcc.mpdcc_explorer import test_mpdcc_explorer
from tb.rtl.mpdcc.mpdcc_scheduler import test_mpdcc_scheduler
from tb.rtl.mpdcc.turn_threshold import test_turn_threshold


def core_bench(variant: str, rtl: Path) -> None:
    """A few decisions of the core."""
    rng = np.random.default_rng(2)
    drive = states.shipped("anpc5l_6kv")
    rows = core.join(
        [
            core.of_trace(states.near(drive, 10, rng), VARIANTS[variant].registers(drive).array()),
            core.random_rows(5, rng, variant),
            core.slow_rows(variant),
        ]
    )
    found = core.simulate(rows, 5, variant, rtl=rtl)
    if not np.array_equal(found.decisions, rows.model(variant)):
        raise BenchError("decisions differ")


def second_level_bench(rtl: Path) -> None:
    """A few searches of the core with a second level."""
    rows = test_sese_core.with_options(test_sese_core.rows_of(5, 12, 1, 0), 1, (0,), 0)
    want, _, nodes = test_sese_core.expected(rows, 4)
    chosen = np.flatnonzero((nodes > 3) & (nodes < 40))[:16]
    found = core.simulate(rows.pick(chosen), 4, "fast", rtl=rtl)
    if len(chosen) < 2 or not np.array_equal(found.decisions, want[chosen, :7]):
        raise BenchError("decisions differ")


def prediction_bench(rtl: Path) -> None:
    """Predictions of k + 1, half of them of states too far out for it."""
    rows = test_sese_core.with_options(core.random_rows(40, np.random.default_rng(31), "fast"),
                                       0, (0,), 1)  # fmt: skip
    found = core.simulate(rows, 2, "fast", rtl=rtl)
    if not np.array_equal(found.decisions, test_sese_core.expected(rows, 2)[0][:, :7]):
        raise BenchError("decisions differ")


def reset_bench(variant: str, explorers: int, rtl: Path, *, two: bool = False) -> None:
    """Resets in the middle of a few decisions."""
    stride = 7 if two or variant == "paper" else 2
    few = test_core_reset.Case(variant, explorers, two, stride, 10, counts=(4, 4, 0))
    test_core_reset.bench(few, rtl)


BENCHES: dict[str, Callable[[Path], object]] = {
    "mac_block": lambda rtl: test_mac_block.bench((18, 16, 9, 9, 3, 43), clocks=300, rtl=rtl),
    "binary_search": lambda rtl: test_binary_search.bench(17, 6, True, searches=400, rtl=rtl),
    "common_terms": lambda rtl: test_common_terms.bench("fast", nodes=120, rtl=rtl),
    "candidate_enumerator": lambda rtl: test_candidate_enumerator.bench(positions=64, rtl=rtl),
    "mpdcc_explorer": lambda rtl: test_mpdcc_explorer.bench("paper", nodes=40, rtl=rtl),
    "mpdcc_scheduler": lambda rtl: test_mpdcc_scheduler.bench(3, "paper", decisions=40, rtl=rtl),
    "mpdcc_core": lambda rtl: core_bench("paper", rtl),
    "turn_threshold": lambda rtl: test_turn_threshold.bench(800, rtl=rtl),
    "capacitor_search": lambda rtl: test_capacitor_search.bench(80, rtl=rtl),
    "explorer_fast": lambda rtl: test_explorer_fast.bench(200, rtl=rtl),
    "scheduler_fast": lambda rtl: test_mpdcc_scheduler.bench(3, "fast", decisions=40, rtl=rtl),
    "core_fast": lambda rtl: core_bench("fast", rtl),
    "second_level": second_level_bench,
    "prediction": prediction_bench,
    "weighted_explorer": lambda rtl: test_explorer_fast.bench(60, rtl=rtl, weighted=True),
    "weighted_core": lambda rtl: test_deadlock_rule.bench(2, 0, (0,), 0, 10, rtl),
    "reset_fast": lambda rtl: reset_bench("fast", 3, rtl),
    "reset_second_level": lambda rtl: reset_bench("fast", 2, rtl, two=True),
    "reset_paper": lambda rtl: reset_bench("paper", 2, rtl),
    "blocks": lambda rtl: test_candidate_enumerator.bench(positions=64, blocks=True, rtl=rtl),
    "delay_line": lambda rtl: test_delay_line.bench(clocks=1000, rtl=rtl),
    "delay_line_netlist": lambda rtl: test_delay_line.netlist_bench(
        clocks=2000, rtl=rtl, check=False
    ),
}


@dataclass(frozen=True)
class Fault:
    """A text of one file and what stands there instead."""

    bench: str
    file: str
    text: str
    fault: str

    def __str__(self) -> str:
        return f"{self.bench}-{self.fault.strip()[:30]}"


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

FAULTS = [
    Fault("mac_block", "mac_block.vhd", "aligned + seed_2;", "aligned;"),
    Fault("mac_block", "mac_block.vhd", "if (enable_2 = '1') then", "if (true) then"),
    Fault("binary_search", "binary_search.vhd", "v.below := '1';", "v.below := '0';"),
    Fault(
        "binary_search",
        "binary_search.vhd",
        "length <= upper when",
        "length <= (others => '1') when",
    ),
    Fault("binary_search", "binary_search.vhd", "r.busy <= STATE_INIT.busy;", "null;"),
    Fault("common_terms", "common_terms.vhd", "- 1) <= '1';", "- 1) <= '0';"),
    Fault("common_terms", "common_terms.vhd", "overflow <= '1';", "overflow <= '0';"),
    Fault(
        "candidate_enumerator",
        "candidate_enumerator.vhd",
        "in LAST_PHASE downto 0",
        "in 0 to LAST_PHASE",
    ),
    Fault(
        "candidate_enumerator", "candidate_enumerator.vhd", "v.candidate.probe  := '0';", "null;"
    ),
    Fault("mpdcc_explorer", "explorer_paper.vhd", " + 2 ** (FORCED_FRACTION - 1)", ""),
    Fault(
        "mpdcc_explorer", "explorer_paper.vhd", "if (excess_5 > 0) then", "if (excess_5 >= 0) then"
    ),
    Fault("mpdcc_explorer", "explorer_paper.vhd", 'front.settle = "11"', 'front.settle = "00"'),
    Fault(
        "mpdcc_scheduler",
        "mpdcc_types.vhd",
        "(not b.feasible & b.rank & b.index & b.saturated)",
        "(not b.feasible & b.rank & a.index & a.saturated)",
    ),
    Fault(
        "mpdcc_scheduler",
        "mpdcc_scheduler.vhd",
        "enumerate_done = '1' and explorer_busy = (explorer_busy'range => '0')",
        "enumerate_done = '1'",
    ),
    Fault("mpdcc_explorer", "explorer_paper.vhd", "effort - 1);", "shift_left(effort, 1));"),
    Fault(
        "mpdcc_core",
        "mpdcc_scheduler.vhd",
        "result.length    := best.length;",
        "result.length    := (others => '0');",
    ),
    Fault("mpdcc_core", "mpdcc_core.vhd", "unsigned(v_ph_b)", "unsigned(v_ph_c)"),
    Fault(
        "mpdcc_core",
        "explorer_paper.vhd",
        "candidate_ready <= not front.busy;",
        "candidate_ready <= '0';",
    ),
    Fault("turn_threshold", "turn_threshold.vhd", "if (curvature >= 0)", "if (curvature > 0)"),
    Fault("turn_threshold", "turn_threshold.vhd", "wide < smallest", "wide > smallest"),
    Fault("capacitor_search", "capacitor_search.vhd", "if (less >= 0)", "if (less > 0)"),
    Fault("capacitor_search", "capacitor_search.vhd", "excess(2) > 0", "excess(2) >= 0"),
    Fault(
        "explorer_fast",
        "explorer_fast.vhd",
        "and not (exceeds and turned and to_std_logic(m > 0))",
        "",
    ),
    Fault("explorer_fast", "explorer_fast.vhd", "largest_5 <= sum;", "largest_5 <= error_4(0);"),
    Fault("explorer_fast", "explorer_fast.vhd", "key_now < key_best", "key_now <= key_best"),
    Fault(
        "explorer_fast",
        "explorer_fast.vhd",
        "excess_7 > 0 or outside(SEARCH + 2) = '1'",
        "excess_7 > 0",
    ),
    Fault(
        "scheduler_fast",
        "node_preparation.vhd",
        "xor falling",
        "or falling",
    ),
    Fault(
        "scheduler_fast",
        "mpdcc_scheduler.vhd",
        "probe_held = '1' and lines_held = '1'",
        "probe_held = '1'",
    ),
    Fault("explorer_fast", "explorer_fast.vhd", "any and settled and last", "any and last"),
    Fault("core_fast", "mpdcc_core.vhd", "unsigned(v_ph_b)", "unsigned(v_ph_c)"),
    Fault(
        "second_level",
        "node_base.vhd",
        "natural_slope(x) + shift_left(",
        "natural_slope(x) + shift_right(",
    ),
    Fault(
        "second_level", "node_queue.vhd", "link(INDEX_WIDTH - 1 downto 0));", "link(6 downto 1));"
    ),
    Fault(
        "second_level", "node_shown.vhd", "ERROR_READ  : natural := 3", "ERROR_READ  : natural := 5"
    ),
    Fault(
        "second_level",
        "leaf_dispatcher.vhd",
        "<= both + transition_weight(from(2), sign(2), c)",
        "<= both",
    ),
    # bits of state that a reset leaves as they are
    Fault("reset_fast", "mpdcc_scheduler.vhd", "r.valid <= STATE_INIT.valid;", "null;  -- valid"),
    Fault(
        "reset_fast",
        "explorer_fast.vhd",
        "valid(1 to STAGE_COUNT) <= (others => '0');",
        "null;  -- pipeline",
    ),
    Fault(
        "reset_second_level",
        "mpdcc_scheduler.vhd",
        "r.pending <= STATE_INIT.pending;",
        "null;  -- pending",
    ),
    Fault(
        "reset_second_level",
        "mpdcc_scheduler.vhd",
        "r.ripe    <= STATE_INIT.ripe;",
        "null;  -- ripe",
    ),
    Fault("reset_paper", "explorer_paper.vhd", "back.count  <= 0;", "null;  -- result"),
    Fault("prediction", "node_base.vhd", "unfit <= found;", "unfit <= '0';"),
    Fault(
        "weighted_explorer",
        "explorer_fast.vhd",
        "shift_left(weighed, DEADLOCK_NEUTRAL_SHIFT)",
        "shift_left(weighed, 2)",
    ),
    Fault(
        "weighted_explorer",
        "explorer_fast.vhd",
        "gated(current_9, limits.deadlock_rule)",
        "current_9",
    ),
    # a place that belongs to the candidate behind, and the bit that a host sets
    Fault(
        "weighted_core",
        "explorer_fast.vhd",
        "best.index     <= unsigned(dead_index);",
        "best.index     <= unsigned(index_dead);",
    ),
    Fault("weighted_core", "mpdcc_core.vhd", "<= deadlock_rule;", "<= '0';"),
    Fault("blocks", "candidate_enumerator.vhd", "return 1;", "return 2;"),
    Fault("delay_line", "delay_line.vhd", "place <= 0;", "place <= place_t'high;"),
    Fault(
        "delay_line", "delay_line.vhd", "ring(place) <= word;", "ring(following(place)) <= word;"
    ),
    Fault("delay_line_netlist", "delay_line.vhd", "place <= 0;", "place <= place_t'high;"),
]
if "GHDL 2.0" in tools.version("ghdl"):
    # right in VHDL, but the order of two places becomes a constant of zeros, see conversion
    FAULTS.append(Fault("delay_line_netlist", "delay_line.vhd", RING, TABLE_OF_PLACES))


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    rtl = altered(tmp_path, Path(fault.file).stem, fault.text, fault.fault)
    with pytest.raises(BenchError):
        BENCHES[fault.bench](rtl)


@pytest.mark.parametrize("bench", BENCHES)
def test_without_a_fault_none_is_seen(bench: str) -> None:
    BENCHES[bench](RTL)


def test_every_bench_has_a_fault() -> None:
    assert {fault.bench for fault in FAULTS} == set(BENCHES)
