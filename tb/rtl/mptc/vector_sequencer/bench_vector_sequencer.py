"""Cocotb side of ``test_vector_sequencer``: every clock against the twin."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import cocotb
import numpy as np

from directmpc.mptc import formats as f
from directmpc.mptc import vector_sequencer as twin
from directmpc.mptc.inverter import STATES
from directmpc.mptc.vector_sequencer import rate_of
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

LATENCY = clocks_of("vector_sequencer", "latency")
FLAGS = clocks_of("vector_sequencer", "flags")
WHOLE = 2**f.TIME_WIDTH
PORTS = {"u1": 3, "u2": 3, "u3": 3, "t1": 13, "t2": 13, "segmented": 1}


@dataclass
class Wanted:
    """What the outputs have to be in each clock of a stretch that begins with a reset."""

    rate: int
    u: list[int] = field(default_factory=list)
    playing: list[int] = field(default_factory=list)
    early: list[int] = field(default_factory=list)
    invalid: list[int] = field(default_factory=list)
    largest: list[int] = field(default_factory=lambda: [0, 0])
    """Sequences whose first vector has a step less than the period, and segmented ones."""


def any_sequence(rng: random.Random, kind: str) -> tuple[list[int], int]:
    """u1, u2, u3, t1, t2 and whether it is modulated."""
    vectors = [rng.randrange(8) for _ in range(3)]
    first = rng.choice([0, 1, WHOLE, WHOLE - 1, rng.randint(0, WHOLE), rng.randint(0, WHOLE)])
    second = rng.choice([0, WHOLE - first, rng.randint(0, WHOLE - first)])
    if kind == "invalid" and rng.random() < 0.6:
        first, second = rng.randrange(8192), rng.randrange(8192)
    segmented = int(rng.random() < 0.4)
    if segmented and rng.random() < 0.8:  # two neighbours, as the modulation has them
        sector = rng.randrange(6)
        vectors = [1 + sector, 1 + (sector + 1) % 6, 0]
    return [*vectors, first, second], segmented


def any_gap(rng: random.Random, kind: str, period: int) -> int:
    """Clocks from one start to the next."""
    if kind == "exact":
        return period
    return rng.choice([1, 2, 3, rng.randint(4, 40), rng.randint(1, period), period - 1,
                       period, period + 1, period + rng.randint(2, 60)])  # fmt: skip


def planned(
    rng: random.Random, stretch: int, kind: str, starts: int
) -> tuple[Wanted, dict[int, tuple]]:
    """A stretch: what comes out in each clock, and clock -> sequence that is given there."""
    period = rng.choice([257, 300, 512, 777, 1000])
    rate = rng.choice([rate_of(period), rate_of(period), rng.randrange(2**22, 2**24)])
    if kind == "invalid" and rng.random() < 0.2:
        rate = rng.randrange(2)
    if kind == "exact":
        rate = rate_of(period)
    elif stretch % 4 == 1:  # two positions are missing at the end, or one
        position = 2**twin.POSITION_WIDTH - rng.choice([1, 2])
        rate = -(-position * 2 ** (twin.PHASE_WIDTH - twin.POSITION_WIDTH) // period)
    wanted, given, now = Wanted(rate), {}, rng.randint(0, 5)
    wanted.u = [0] * (now + LATENCY)
    wanted.playing = [0] * (now + LATENCY)
    wanted.early, wanted.invalid = [0] * (now + FLAGS), [0] * (now + FLAGS)
    early = 0
    for _ in range(starts):
        sequence, segmented = any_sequence(rng, kind)
        gap = any_gap(rng, kind, period)
        if kind != "exact" and sequence[3] == WHOLE - 1:  # a step is less than a clock: late
            gap += period
            wanted.largest[segmented] += 1
        given[now] = (*sequence, segmented)
        _, _, invalid = twin.plan(sequence, bool(segmented))
        wanted.u += twin.play(sequence, bool(segmented), rate, gap).tolist()
        wanted.playing += [1] * gap
        wanted.early += [early] * gap
        wanted.invalid += [int(invalid)] * gap
        early = int(twin.is_early(rate, gap))
        now += gap
    return wanted, given


@cocotb.test()
async def clocks(dut) -> None:
    """Stretches of periods; what is not sampled is random."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    legs_moved = np.abs(STATES[:, None, :] - STATES[None, :, :]).sum(axis=2)
    for stretch in range(given["stretches"]):
        kind = ("exact", "any", "invalid")[stretch % 3]
        wanted, starts = planned(rng, stretch, kind, 6)
        dut.start.value = 0
        dut.rate.value = wanted.rate
        await clock.reset(1)
        before = 0
        for now in range(len(wanted.early)):
            row = starts.get(now)
            dut.start.value = int(row is not None)
            for place, (name, width) in enumerate(PORTS.items()):
                getattr(dut, name).value = row[place] if row else rng.getrandbits(width)
            await clock.settle()
            where = f"stretch {stretch}, {kind}, clock {now}"
            u = wanted.u[now]
            board.check("vector", number(dut.u), u, where)
            legs = sum(int(bit) << (2 - leg) for leg, bit in enumerate(STATES[u]))
            board.check("switches", number(dut.switches), legs, where)
            board.check("playing", number(dut.playing), wanted.playing[now], where)
            flags = number(dut.early), number(dut.invalid)
            board.check("flags", flags, (wanted.early[now], wanted.invalid[now]), where)
            board.cover("change", int(u != before))
            board.cover("one leg", int(legs_moved[u, before] == 1))
            board.cover("early", wanted.early[now])
            board.cover("not early", wanted.playing[now] and 1 - wanted.early[now])
            board.cover("invalid", wanted.invalid[now])
            before = u
            await clock.edge()
        board.cover("largest", wanted.largest[0])
        board.cover("largest, segmented", wanted.largest[1])
    least = given["stretches"]
    board.finish(
        {"vector": 100 * least, "flags": 100 * least},
        {"change": 3 * least, "one leg": 2 * least, "early": least, "not early": 100 * least,
         "invalid": least // 3, "largest": least // 6, "largest, segmented": least // 12},
    )  # fmt: skip
