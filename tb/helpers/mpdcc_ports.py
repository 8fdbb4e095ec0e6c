"""Candidates, results and rows as the flat wrappers of MPDCC's entities take and show them."""

from __future__ import annotations

import random

import numpy as np

from directmpc.mpdcc import formats as f
from directmpc.mpdcc.coefficients import registers
from scripts.hdl import states
from tb.helpers import plain, plain_states
from tb.helpers.scoreboard import signed


def pack_candidate(probe: int, index: int, s: tuple[int, ...], effort: int) -> int:
    """A candidate as the flat bench takes it."""
    return probe | index << 1 | (s[0] | s[1] << 3 | s[2] << 6) << 7 | effort << 16


#: An excess stands in a result with this added.
RANKED = 2 ** (f.TRAJECTORY_WIDTH - 1)


def unpack_result(value: int, ranked: int = RANKED) -> dict[str, int]:
    """A result as the flat bench shows it; `ranked` is what an excess has added."""
    fields = {}
    for name, width in (
        ("feasible", 1), ("saturated", 1), ("index", f.INDEX_WIDTH),
        ("length", f.LENGTH_WIDTH), ("cost", f.RANK_WIDTH),
    ):  # fmt: skip
        fields[name] = value & ((1 << width) - 1)
        value >>= width
    if not fields["feasible"]:
        fields["excess"] = fields.pop("cost") - ranked
    return fields


def example(
    rng: random.Random, generator: np.random.Generator, n: int, variant: str = "paper"
) -> tuple[plain.Node, plain.Limits, tuple[int, ...]]:
    """A node some host and some measurement can make."""
    kind = n % 4
    if kind == 3:
        array = states.any_registers(generator, variant)
        row = states.words(1, generator)[0]
        s_prev = tuple(rng.randrange(8) for _ in range(3))
    else:
        drive = (
            states.shipped(rng.choice(states.SHIPPED))
            if kind == 0
            else states.random_drive(generator)
        )
        if kind != 2:
            drive = drive.with_control(horizon=rng.choice([1, 2, 5, 33, 62, 63]))
        array = registers(drive, variant).array()
        trace = states.near(drive, 1, generator)
        row, s_prev = states.trace_words(trace)[0], tuple(int(p) for p in trace.s_prev[0])
    node, limits = plain_states.plain_node(array, row, variant), plain_states.plain_limits(array)
    if rng.random() < 0.15:
        # an error exactly on its bound, or one beyond
        j = rng.randrange(7)
        node.error[j] = rng.choice([-1, 1]) * (limits.bounds[j] + rng.randrange(2))
    if rng.random() < 0.2:
        high = 2 ** (f.WEIGHT_WIDTH - 1)
        node.weight_start = rng.choice([-high, high - 1, high - 200])
        node.weight_slope = [rng.choice([-1, 1]) * rng.randrange(2**15) for _ in range(3)]
    return node, limits, s_prev


def unpack_row(value: int) -> tuple[int, tuple[int, int]]:
    """Row, (length, excess) of a packed entry."""
    length = value >> 6 & ((1 << f.LENGTH_WIDTH) - 1)
    excess = signed(value >> (6 + f.LENGTH_WIDTH), f.TRAJECTORY_WIDTH)
    return value >> 1 & 31, (length, excess)
