"""Vector sequencer: the RTL against its twin in every clock, the twin against the loops' segments.

Stimulus: vectors and times of any kind, those of the modulation among them, times of nothing, of
one step, of a step less than the period, of all of it; periods back to back, starts in consecutive
clocks, early, late; rates that do not belong to the period, of 0 too; times that are more than the
period; what is not sampled is random; a reset before each stretch.
Checks: vector, switch states and flags in every clock; times of vectors within a clock of what
was asked; seven segments of which each moves one leg; nothing behind the core's largest duty.
Timing: 5 clocks from start to the first vector, 4 to the flags, always.
Faults: a largest duty with a second vector behind it (a pulse that the guard lengthens), or taken
for the whole in seven segments; a segment, an end and a time at the wrong place, a phase that wraps
or goes on, flags that are missing, a start that is sampled late, what survives a reset.
Does not prove: dead times and least on-times, see test_gate_guard.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mptc import formats as f
from directmpc.mptc import vector_sequencer as twin
from directmpc.mptc.inverter import STATES
from directmpc.mptc.sequence import VectorSequence, segments
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run

ENTITY = "vector_sequencer"


def bench(stretches: int, rtl: Path = RTL, seed: int = 3) -> Outcome:
    return run(ENTITY, arguments={"seed": seed, "stretches": stretches}, rtl=rtl)


@pytest.mark.parametrize("seed", [3, 4])
def test_every_clock_is_the_twins(seed: int) -> None:
    assert bench(24, seed=seed).checks["vector"] > 20_000


@pytest.mark.parametrize("segmented", [False, True])
def test_times_are_those_of_the_loops(segmented: bool) -> None:
    rng = np.random.default_rng(5)
    vectors, lengths = np.zeros(7, dtype=np.int64), np.zeros(7)
    for _ in range(200):
        period = int(rng.integers(257, 20_000))
        first = int(rng.choice([rng.integers(0, 4097), 4095], p=[0.9, 0.1]))
        times = first, int(rng.integers(0, 4097 - first))
        sector = int(rng.integers(0, 6))
        numbers = (1 + sector, 1 + (sector + 1) % 6, 0)
        if not segmented:
            numbers = tuple(int(u) for u in rng.permutation(8)[:3])
        asked = VectorSequence(*numbers, *(t / 4096 for t in times))
        count = segments(asked, segmented, vectors, lengths)
        played = twin.play((*numbers, *times), segmented, twin.rate_of(period), period)
        for u in {int(u) for u in vectors[:count]}:
            share = lengths[:count][vectors[:count] == u].sum()
            parts = int((vectors[:count] == u).sum())
            assert abs(int((played == u).sum()) - share * period) <= parts + 0.5
        order = [int(u) for u, n in zip(vectors[:count], lengths, strict=False) if n * period > 2.0]
        seen = [int(u) for k, u in enumerate(played) if not k or u != played[k - 1]]
        assert all(u in seen for u in order)
        if segmented and min(*times, 4096 - sum(times)) * period > 8 * 4096:
            assert seen == [0, *seen[1:6], 0]
            moved = np.abs(np.diff(STATES[seen], axis=0)).sum(axis=1)
            assert moved.tolist() == [1] * 6


def test_a_period_that_cannot_be_is_refused() -> None:
    for period in (0, 256, 2**18 + 1):
        with pytest.raises(
            ValueError, match=f"period: got {period}; it must be from 257 to 262144"
        ):
            twin.rate_of(period)
    for period in (257, 2**18):
        rate = twin.rate_of(period)
        assert 0 < rate < 2**twin.RATE_WIDTH
        assert not twin.is_early(rate, period)
        assert twin.is_early(rate, period - period // 2**12 - 1)
    # the end of a vector moves by less than half of a position through the rounding of the rate
    for period in range(257, 2**18, 2499):
        error = abs(twin.rate_of(period) * period / 2**twin.PHASE_WIDTH - 1.0)
        assert error * 2**twin.POSITION_WIDTH <= 0.5 * (1 + 1e-9)
    assert f.TIME_WIDTH + 2 == twin.POSITION_WIDTH


FAULTS = {
    "largest duty": ("unsigned(t1) = 2 ** TIME_WIDTH - 1)", "unsigned(t1) = 2 ** TIME_WIDTH)"),
    "largest duty, segmented": ("if (segmented = '0' and unsigned", "if (unsigned"),
    "segment": ('("000", first, second, "111", second', '("000", first, second, "000", second'),
    "odd first": ("elsif (first(0) = '1') then", "elsif (second(0) = '1') then"),
    "odd time": ("      if (u1(0) = '1') then\n", "      if (u2(0) = '1') then\n"),
    "half": ("shift_left(summed.even, 1)", "summed.even"),
    "sum": ("shift_left(value.both, STEP)", "shift_left(value.even, STEP)"),
    "comparison": ("position >= last(i)", "position > last(i)"),
    "wrap": ("      v.phase := (others => '1');\n",
             "      v.phase := grown(PHASE_WIDTH - 1 downto 0);\n"),
    "rest": ("2 ** TIME_WIDTH - asked.both;", "2 ** TIME_WIDTH - asked.even;"),
    "no rest": ("summed.rest    <= (others => '0');", "summed.rest    <= asked.t1;"),
    "early": ("not grown(PHASE_WIDTH) and to_std", "to_std"),
    "late": ("< 2 ** POSITION_WIDTH - 1)", "< 2 ** POSITION_WIDTH - 2)"),
    "invalid": ("asked.both <= 2 ** TIME_WIDTH", "asked.both < 2 ** TIME_WIDTH"),
    "late sample": ("summed         <= asked;", "summed         <= summed;"),
    "survives a reset": ("        r       <= INIT;\n", "        null;\n"),
    "flag after a reset": ("        invalid <= '0';\n", "        null;\n"),
    "switches": ("switches_of_vector(r.u)", "switches_of_vector(next_r.u)"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, ENTITY, *FAULTS[name])
    with pytest.raises(CheckError, match=r"(vector|switches|playing|flags): got|is undefined"):
        bench(12, rtl)
