"""Blocks of states: what is decided in each, and how often the two writings disagree.

A block has one drive, or parameters of any content, and many states. Its number and the seed make
it, so that any block can be run again by itself. Positions s(k-1) go through all 512, and vectors
through all 8, in every block of that many states.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.api.drive_file import load_mptc_drive
from directmpc.mpdcc import formats as mpdcc_formats
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.coefficients import INDEX
from directmpc.mpdcc.coefficients import registers as mpdcc_registers
from directmpc.mptc import bit_true as mptc_twin
from directmpc.mptc import formats as mptc_formats
from directmpc.mptc.coefficients import registers as mptc_registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.inverter import HALF_BRIDGES
from scripts.hdl import states
from scripts.studies.torture import mpdcc, mptc

IntArray = NDArray[np.int64]

ROWS = 4096
"""States of a block."""

MPDCC_KINDS = (
    "near the references, shipped drive",
    "near the references, random drive",
    "specified ranges, random drive",
    "beyond them, random drive",
    "any words, random drive",
    "words at the rails, random drive",
    "any words, any parameters",
    "words at the rails, any parameters",
)
MPTC_KINDS = (
    "near the references, shipped drive",
    "near the references, random drive",
    "any words, random drive",
    "words at the rails, random drive",
)
RULES = ((0, 0), (1, 0), (0, 1), (1, 1))
"""Deadlock rule and outside rule, as the parameters have them."""

METHODS = ("MPTC", "MPFC")
MPTC_DRIVES = ("induction_2kw2", "motulator_2kw2")

#: Most states that a block's result lists.
LISTED = 5


@dataclass(frozen=True)
class MpdccBlock:
    """States of MPDCC under one set of parameters."""

    kind: str
    register: IntArray
    measurements: IntArray
    s_prev: IntArray


@dataclass(frozen=True)
class MptcBlock:
    """States of a two-level drive."""

    kind: str
    drive: MptcDrive
    measurements: IntArray
    u: IntArray


@dataclass(frozen=True)
class Outcome:
    """What came of a block."""

    kind: str  #: Of its states.
    counts: Counter[str]  #: Of decisions, of those that differ, and of what happened in them.
    worst: float  #: Largest excess of a cost in allowances, MPTC and MPFC; 0 for MPDCC.
    listed: tuple[int, ...]  #: Numbers of states that differ, ``LISTED`` at most.


def _rng(controller: str, seed: int, number: int) -> np.random.Generator:
    return np.random.default_rng([seed, number, len(controller)])


def every(of: int, rows: int, rng: np.random.Generator) -> IntArray:
    """Numbers that go through all there are, in random order."""
    return rng.permutation(np.arange(rows) % of)


def _rails(low: IntArray, high: IntArray, rows: int, rng: np.random.Generator) -> IntArray:
    """Words at an end of their range, or within two of it, or about zero."""
    shape = (rows, len(low))
    inside = rng.integers(0, 3, shape) * (rng.random(shape) < 0.5)
    value = np.where(rng.random(shape) < 0.5, low + inside, high - inside)
    return np.where(rng.random(shape) < 0.2, np.clip(inside - 1, low, high), value)


def mpdcc_block(number: int, seed: int, rows: int = ROWS) -> MpdccBlock:
    """A block of MPDCC."""
    rng = _rng("mpdcc", seed, number)
    which = number % len(MPDCC_KINDS)
    rules = RULES[number // len(MPDCC_KINDS) % len(RULES)]
    form = list(mpdcc_formats.MEASUREMENTS.values())
    if which == 0:
        name = states.SHIPPED[number // len(MPDCC_KINDS) % 2]
        bound = float(rng.choice([0.06, 0.1, 0.16]))
        drive = states.shipped(name).with_control(bound_current=bound)
    else:
        drive = states.random_drive(rng)
    if which >= 6:
        register = states.any_registers(rng, "fast")
    else:
        register = mpdcc_registers(drive, "fast").array()
    register[INDEX["deadlock_rule"]], register[INDEX["outside_inwards"]] = rules
    if which < 2:
        reach = float(rng.choice([0.7, 0.9, 1.15, 2.0]))
        words = states.trace_words(states.near(drive, rows, rng, reach))
    elif which < 4:
        words = states.trace_words(states.wide(rows, rng, 1.0 if which == 2 else 1.4))
    elif which in (4, 6):
        words = states.words(rows, rng)
    else:
        low = np.array([-(2 ** (one.width - 1)) if one.signed else 0 for one in form])
        words = _rails(low, np.array([one.high for one in form]), rows, rng)
    start = every(512, rows, rng)
    s_prev = np.column_stack([start >> 6, start >> 3 & 7, start & 7])
    return MpdccBlock(MPDCC_KINDS[which], register, words.astype(np.int64), s_prev)


def random_mptc(rng: np.random.Generator, method: str) -> MptcDrive:
    """A two-level drive whose full scales suit its machine."""

    def _log(low: float, high: float) -> float:
        """Anything between, even in its logarithm."""
        return float(math.exp(rng.uniform(math.log(low), math.log(high))))

    while True:
        base, vdc = _log(60, 3000), _log(12, 3000)
        ls, sigma, ratio = _log(1e-4, 1), _log(0.02, 0.3), _log(0.7, 1.4)
        lr = ls * ratio**2
        psi = 1.3 * vdc / math.sqrt(3) / base
        current = psi / (sigma * ls) * _log(0.1, 1)
        poles = int(rng.integers(1, 9))
        torque = 1.5 * poles * psi * current * _log(0.1, 0.7)
        keys = {
            "controller": "mptc",
            "machine": {
                "rs": base * ls * _log(0.002, 0.05),
                "rr": base * lr * _log(0.002, 0.05),
                "lm": math.sqrt((1 - sigma) * ls * lr),
                "ls": ls,
                "lr": lr,
                "pole_pairs": poles,
            },
            "inverter": {"topology": HALF_BRIDGES[0], "vdc": vdc},
            "control": {
                "ts": _log(10e-6, 200e-6),
                "k_psi": torque / psi * _log(0.1, 3),
                "psi_max": psi,
                "current_max": current,
                "torque_max": torque,
                "speed_max": base * 1.5,
                "method": method,
            },
        }
        try:
            drive = MptcDrive.model_validate(keys)
            mptc_registers(drive)
        except ValueError:  # beyond a range, or a coefficient that does not fit: another one
            continue
        return drive


def _mptc_words(drive: MptcDrive, rows: int, rng: np.random.Generator) -> IntArray:
    """States about an operating point: flux near its reference, torque near its own."""
    c, m = drive.control, drive.machine
    carried = 0.5 * drive.inverter.vdc / c.speed_max
    size = np.minimum(c.psi_max * rng.uniform(0.5, 0.95, rows), max(carried, 0.3 * c.psi_max))
    psi = size * np.exp(2j * np.pi * rng.random(rows))
    slip = rng.uniform(-0.4, 0.4, rows)
    leak = m.ls * (1 - m.lm**2 / (m.ls * m.lr))
    current = psi * (1 / m.ls + 1j * slip * np.sin(np.arccos(0.5)) * (1 / leak - 1 / m.ls))
    current *= np.minimum(1, c.current_max / np.abs(current))
    torque = 1.5 * m.pole_pairs * (np.conj(psi) * current).imag
    torque += rng.normal(0, 0.02, rows) * c.torque_max
    real = np.column_stack(
        [
            current.real, current.imag, psi.real, psi.imag,
            rng.uniform(-1, 1, rows) * c.speed_max,
            drive.inverter.vdc * rng.uniform(0.7, 1.3, rows),
            torque, size * (1 + rng.normal(0, 0.01, rows)),
        ]
    )  # fmt: skip
    forms = mptc_formats.measurement_formats(drive).values()
    return np.column_stack([one.encode(x)[0] for one, x in zip(forms, real.T, strict=True)])


def mptc_block(number: int, seed: int, rows: int = ROWS) -> MptcBlock:
    """A block of MPTC or MPFC."""
    rng = _rng("mptc", seed, number)
    which = number % len(MPTC_KINDS)
    turn = number // len(MPTC_KINDS)
    method = METHODS[turn % 2]
    if which == 0:
        path = states.DRIVES / f"{MPTC_DRIVES[turn // 2 % 2]}.toml"
        drive = load_mptc_drive(path).with_control(method=method)
    else:
        drive = random_mptc(rng, method)
    if which < 2:
        words = _mptc_words(drive, rows, rng)
    else:
        low = np.array([-(2**15)] * 5 + [0, -(2**15), 0])
        high = np.array([2**15 - 1] * 5 + [2**16 - 1, 2**15 - 1, 2**15 - 1])
        if which == 2:
            words = rng.integers(low, high + 1, (rows, len(low)))
            words >>= rng.integers(0, 8, words.shape)
        else:
            words = _rails(low, high, rows, rng)
    return MptcBlock(MPTC_KINDS[which], drive, words.astype(np.int64), every(8, rows, rng))


MpdccTwin = Callable[[IntArray, IntArray, IntArray], IntArray]
MptcTwin = Callable[[MptcDrive, IntArray, IntArray], IntArray]


def twin_of_mpdcc(register: IntArray, measurements: IntArray, s_prev: IntArray) -> IntArray:
    """Decisions of the bit-true twin, fast variant."""
    out = np.empty((len(measurements), 7), dtype=np.int64)
    fast.run_words(register, measurements, s_prev, out)
    return out


def twin_of_mptc(drive: MptcDrive, measurements: IntArray, u: IntArray) -> IntArray:
    """Decisions of the bit-true twin of MPTC and MPFC."""
    out = np.empty((len(measurements), 3), dtype=np.int64)
    mptc_twin.run_words(mptc_registers(drive).array(), measurements, u, out)
    return out


def run_mpdcc(number: int, seed: int, rows: int = ROWS, twin: MpdccTwin = twin_of_mpdcc) -> Outcome:
    """Decide a block of MPDCC in both ways."""
    block = mpdcc_block(number, seed, rows)
    told = twin(block.register, block.measurements, block.s_prev)
    slow = mpdcc.decide(block.register, block.measurements, block.s_prev)
    differing = np.flatnonzero((told != slow.decision).any(axis=1))
    held, dead, flag = (slow.decision[:, i] == 1 for i in (3, 4, 6))
    searched = ~held & ~dead
    weighted = "weighted" if block.register[INDEX["deadlock_rule"]] else "largest"
    counts: Counter[str] = Counter(
        {
            "decisions": rows,
            "differing": len(differing),
            "hold": int(held.sum()),
            "search": int(searched.sum()),
            "deadlock": int(dead.sum()),
            "saturated": int(flag.sum()),
            "weight clipped": int(slow.cost_clipped.sum()),
            "tie of costs": int((searched & (slow.ties > 1)).sum()),
            f"tie in a deadlock, {weighted}": int((dead & (slow.ties > 1)).sum()),
            "leaves before it turns": int(slow.turned.sum()),
            "starts outside and returns": int(slow.returned.sum()),
        }
    )
    for place, name in enumerate((*mpdcc.VARIABLES, "the horizon")):
        counts[f"ended by {name}"] += int((slow.ended_by == place).sum())
        if place < 7:
            counts[f"deadlock by {name}, {weighted}"] += int((slow.excess_of == place).sum())
    return Outcome(block.kind, counts, 0.0, tuple(differing[:LISTED].tolist()))


def run_mptc(number: int, seed: int, rows: int = ROWS, twin: MptcTwin = twin_of_mptc) -> Outcome:
    """Decide a block of MPTC or MPFC, and judge each decision."""
    block = mptc_block(number, seed, rows)
    told = twin(block.drive, block.measurements, block.u)
    found = mptc.judge(block.drive, block.measurements, block.u)
    vector, saturated, clamped = told.T
    plain = (saturated == 0) & found.plain
    excess = found.excess(vector)
    wrong = plain & (excess > 1)
    wrong |= plain & (found.clamped >= 0) & (clamped != found.clamped)
    numbered = (vector % 7 == 0) & (vector != found.zero)
    wrong |= numbered
    method = block.drive.control.method
    judged = excess[plain & np.isfinite(excess)]
    counts: Counter[str] = Counter(
        {
            "decisions": rows,
            "differing": int(wrong.sum()),
            "saturated": int(saturated.sum()),
            f"judged, {method}": int(plain.sum()),
            f"clamped, {method}": int(clamped.sum()),
            **{f"u_{j}, {method}": int((vector == j).sum()) for j in range(8)},
        }
    )
    worst = float(judged.max()) if len(judged) else 0.0
    return Outcome(block.kind, counts, worst, tuple(np.flatnonzero(wrong)[:LISTED].tolist()))
