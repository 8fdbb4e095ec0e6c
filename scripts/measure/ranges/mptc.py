"""Ranges in the two-level cores: the sums of products of ``mptc_datapath``."""

from __future__ import annotations

from directmpc.mptc import formats as g
from directmpc.mptc import program as programs
from scripts.measure.ranges.intervals import demand

#: Programs of `mptc_core` and `mptc_family_core`, each from the first clock to the last.
PROGRAMS: dict[str, tuple[programs.Step, ...]] = {
    "MPTC": (*programs.COMMON, *programs.MPTC),
    "MPFC": (*programs.COMMON, *programs.MPFC),
    "pairs": (
        *programs.COMMON, *programs.MPTC, *programs.OPENING, *programs.PAIRS,
    ),
    "hexagon": (
        *programs.COMMON, *programs.BEFORE_HEXAGON, *programs.HEXAGON,
    ),
}  # fmt: skip


def sums() -> None:
    """Sums of products of the two-level cores: the accumulators of `mptc_datapath` hold them.

    A sum begins with a word at the place of a product, with half an LSB, with a cost, or with the
    term `level`, which is the demand less the two products of the torque. Words saturate and flag.

    Raises
    ------
    RangeError
        If an accumulator is too narrow.
    """
    product = (1 << (g.WORD_WIDTH - 1)) ** 2
    word = 1 << (g.WORD_WIDTH - 1 + g.FRACTION)
    cost = 1 << (g.COST_WIDTH - 1)
    begins = {"": 0, "none": 0, "half": word >> g.WORD_WIDTH, "cost": cost, "level": 3 * product}
    begins["torque_half"] = 1 << (g.TORQUE_SHIFT - 1)
    for name, steps in PROGRAMS.items():
        for block in range(programs.BLOCKS):
            largest = 0
            for step in sorted((s for s in steps if s.block == block), key=lambda s: s.clock):
                if step.seed:
                    largest = begins.get(step.seed, word)
                largest += product
                what = step.result or f"clock {step.clock}"
                demand(f"{name}: sum of {what}", (-largest, largest), g.ACCUMULATOR_WIDTH)
