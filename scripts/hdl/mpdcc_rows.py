"""Rows for ``mpdcc_core``, what the model answers to them, and the RTL's answers; closed loops."""

from __future__ import annotations

import functools
import pickle
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.api.controllers import RtlController
from directmpc.mpdcc import formats as f
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.bit_true import paper as bit_true
from directmpc.mpdcc.closed_loop import ClosedLoopResult, drive_controller
from directmpc.mpdcc.coefficients import inwards, registers, second_level, weighted_deadlock
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.program import COEFFICIENTS
from directmpc.mpdcc.variants import VARIANTS
from scripts.hdl import converter_package, states
from scripts.hdl import mpdcc_simulation as rtl_simulation
from scripts.hdl.clocks import worst_clocks
from scripts.hdl.ghdl import execute
from scripts.hdl.mpdcc_job import Job
from scripts.hdl.mpdcc_simulation import BENCH, generics
from scripts.hdl.simulator import load
from scripts.hdl.sources import RTL
from scripts.hdl.states import IntArray

#: Rows that take the paper's explorers long, found by a search over states and parameters:
#: measurements, s(k-1), parameters.
SLOW: tuple[tuple[list[int], list[int], list[int]], ...] = (
    (
        [
            -6297, -23343, 1062, -9849, 22209, 1791, 15473, 16767, 35087, -5328, -24435, -15954,
            -6654,
        ],
        [2, 4, 3],
        [
            8388, 7265, -2097, 2097, 466, 403, -141, -122, -4318, 5008, -5128, 4474, -2628, -2276,
            3925, 1962, 15015, 14606, 28647, 1659, 20972, -1197, -1037, 0, 0, 0, 0, 0, 0,
            0, 0, 0, 0, 65535, 65535, 65535, 63, 0, 0, 0, 0, 0, 0, 0,
        ],
    ),
)  # fmt: skip


#: The compiled decision of each variant.
DECIDE = {"paper": bit_true.decide_words, "fast": bit_true_fast.decide_words}


@dataclass(frozen=True)
class Rows:
    """Independent decisions to make."""

    measurements: IntArray  #: (n, 13).
    s_prev: IntArray  #: (n, 3).
    registers: IntArray  #: (n, 44): parameter ports of each row.

    def __len__(self) -> int:
        return len(self.measurements)

    def pick(self, selection: IntArray | slice) -> Rows:
        """Some of the rows."""
        return Rows(self.measurements[selection], self.s_prev[selection], self.registers[selection])

    def model(self, variant: str) -> IntArray:
        """Decisions of a variant's model: s_a, s_b, s_c, held, deadlock, length, saturated."""
        return np.array(
            [
                DECIDE[variant](r, m, s)
                for r, m, s in zip(self.registers, self.measurements, self.s_prev, strict=True)
            ],
            dtype=np.int64,
        )


def join(parts: list[Rows]) -> Rows:
    """Several sets of rows as one."""
    return Rows(
        np.concatenate([p.measurements for p in parts]),
        np.concatenate([p.s_prev for p in parts]),
        np.concatenate([p.registers for p in parts]),
    )


def of_trace(trace, array: IntArray) -> Rows:
    """Rows of a trace under one set of parameters."""
    n = len(trace)
    return Rows(
        states.trace_words(trace),
        np.asarray(trace.s_prev, dtype=np.int64),
        np.repeat(array[None], n, axis=0),
    )


#: Operating points of the recorded traces: speed, generating.
POINTS = ((1.0, False), (-0.7, False), (0.4, True), (-1.0, True))


def recorded_rows(per_point: int, rng: np.random.Generator, variant: str) -> Rows:
    """Rows of closed loops of both drives, most of them searches, deadlocks first."""
    parts = []
    for name in states.SHIPPED:
        drive = states.shipped(name)
        array = registers(drive, variant).array()
        for speed, generating in POINTS:
            rows = of_trace(states.recorded(drive, 1500, speed, generating), array)
            answers = rows.model(variant)
            dead = np.flatnonzero(answers[:, 4] == 1)[: per_point // 4]
            search = np.flatnonzero((answers[:, 3] == 0) & (answers[:, 4] == 0))
            search = rng.permutation(search)[: per_point // 2]
            held = rng.permutation(np.flatnonzero(answers[:, 3] == 1))[: per_point // 4]
            parts.append(rows.pick(np.concatenate([dead, search, held])))
    return join(parts)


def random_rows(n: int, rng: np.random.Generator, variant: str) -> Rows:
    """Disturbed states of random drives, full ranges, saturating inputs, words of any content."""
    parts = []
    for k in range(n):
        kind = k % 5
        if kind == 4:
            parts.append(
                Rows(
                    states.words(1, rng),
                    rng.integers(0, 8, (1, 3)),
                    states.any_registers(rng, variant)[None],
                )
            )
            continue
        drive = states.random_drive(rng)
        array = registers(drive, variant).array()
        trace = (
            states.near(drive, 1, rng, reach=(0.6, 1.1)[kind])
            if kind < 2
            else states.wide(1, rng, beyond=(1.0, 1.4)[kind - 2])
        )
        parts.append(of_trace(trace, array))
    return join(parts)


def saturating_rows(n: int, rng: np.random.Generator, variant: str) -> Rows:
    """Rows whose product of rotor flux and speed is the one that does not fit its word."""
    rows = random_rows(n, rng, variant)
    names = list(f.MEASUREMENTS)
    for name in ("psir_alpha", "psir_beta", "omega_r"):
        rows.measurements[:, names.index(name)] = f.CURRENT.low - 1
    return rows


def whole_horizon_rows(n: int, rng: np.random.Generator, variant: str) -> Rows:
    """Searches whose choice stays inside its bounds for the whole horizon, of one to three steps.

    Recorded and random rows have hardly one: most of their choices violate a bound before step 63.
    """
    parts: list[Rows] = []
    found = 0
    for k in range(10 * n):
        horizon = 1 + k % 3
        drive = states.random_drive(rng).with_control(horizon=horizon)
        rows = of_trace(states.near(drive, 16, rng, reach=1.1), registers(drive, variant).array())
        answers = rows.model(variant)
        searched = (answers[:, 3] == 0) & (answers[:, 4] == 0)
        whole = np.flatnonzero(searched & (answers[:, 5] == horizon))[:2]
        parts.append(rows.pick(whole))
        found += len(whole)
        if found >= n:
            break
    return join(parts).pick(slice(n))


def slow_rows(variant: str) -> Rows:
    """The slowest decisions known.

    The fast explorers' time depends on the number of next positions alone: four in each phase.
    """
    if variant == "paper":
        return Rows(*(np.array(column, dtype=np.int64) for column in zip(*SLOW, strict=True)))
    measurement, s_prev, register = (np.array(column, dtype=np.int64) for column in SLOW[0])
    first = len(COEFFICIENTS)
    alive, dead = register.copy(), register.copy()
    alive[first : first + 3] = f.BOUND_HIGH["fast"]
    dead[first : first + 3] = 0
    return Rows(
        np.repeat(measurement[None], 2, axis=0),
        np.repeat(s_prev[None], 2, axis=0),
        np.array([alive, dead]),
    )


@dataclass(frozen=True)
class Answers:
    """What the RTL said."""

    decisions: IntArray  #: (n, 7): columns as of ``Rows.model``.
    cycles: IntArray  #: (n,).
    bound: int  #: Most clocks a decision may take, as the bench asserts it; of the last row.
    exhausted: IntArray  #: (n,): 1 where the budget ended the search.
    #: (n, 7): decisions that were out with the edge that saw a reset, else -1.
    early: IntArray | None = None


def simulate(
    rows: Rows,
    explorers: int,
    variant: str,
    *,
    throttle: int = 0,
    rtl: Path = RTL,
    bound: int | None = None,
    second: bool | None = None,
    weighted: bool | None = None,
    inward: bool | None = None,
    aborts: IntArray | None = None,
) -> Answers:
    """Decisions of the RTL on independent rows."""
    bound = bound or worst_clocks(explorers, variant)
    second = second_level(rows.registers) if second is None else second
    weighted = weighted_deadlock(rows.registers) if weighted is None else weighted
    inward = inwards(rows.registers) if inward is None else inward
    if rtl == RTL:
        rtl = converter_package.rtl_of(converter_package.converter_of(rows.registers))
    with tempfile.TemporaryDirectory(prefix="directmpc-core-") as name:
        folder = Path(name)
        job = Job(rows.registers, rows.measurements, rows.s_prev, throttle=throttle, folder=folder)
        path = folder / "job.pickle"
        path.write_bytes(pickle.dumps(job))
        module, environment = "scripts.hdl.mpdcc_cosimulation", {"DIRECTMPC_JOB": str(path)}
        if aborts is not None:
            module, lines = "tb.rtl.mpdcc.mpdcc_core.cosimulation_reset", folder / "aborts.npy"
            np.save(lines, aborts)
            environment["DIRECTMPC_ABORTS"] = str(lines)
        execute(
            "mpdcc_core_bench",
            module,
            folder,
            units=["mpdcc_core"],
            files=[BENCH],
            generics={
                **generics(explorers, variant, second, weighted, inward),
                "MOST_CLOCKS": bound,
            },
            environment=environment,
            rtl=rtl,
            timeout=900,
        )
        data = load(job.result_path)
        out = data["decisions"]
        shown = [0, 1, 2, 3, 4, 5, 7]
        early = None if aborts is None else data["early"][:, shown]
        return Answers(out[:, shown], out[:, 6], data["bound"], out[:, 8], early)


def _repeated(
    drive: Drive, variant: str, expected: ClosedLoopResult, core: Any,
    progress: Callable[[int], None],
) -> tuple[ClosedLoopResult, list[int]]:  # fmt: skip
    rtl, begin = RtlController(drive, variant, core), (expected.state[0], expected.positions[0])
    steps, profile = len(expected), expected.profile
    return drive_controller(drive, rtl, profile, steps, progress=progress, begin=begin), rtl.cycles


def in_closed_loop(
    drive: Drive, variant: str, expected: ClosedLoopResult
) -> tuple[ClosedLoopResult, list[int], int]:
    """A model's closed loop once more with two explorers of the RTL deciding; clocks, and bound.

    Every decision and every state has to be the model's.
    """
    job = Job(
        VARIANTS[variant].registers(drive).array(),
        loop=functools.partial(_repeated, drive, variant, expected),
    )
    answer = rtl_simulation.simulate(job, 2, variant)
    found, cycles = answer["run"]
    for name in ("s", "held", "deadlock", "length"):
        wanted = getattr(expected.decisions, name)
        np.testing.assert_array_equal(getattr(found.decisions, name), wanted)
    np.testing.assert_allclose(found.state, expected.state, rtol=0, atol=1e-9)
    return found, cycles, answer["bound"]
