"""Rows for ``mptc_family_core``: methods of several vectors beside MPTC and MPFC."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.mptc import bit_true, cycles
from directmpc.mptc import bit_true_sequences as twin
from directmpc.mptc.sequence import TIME_STEPS
from directmpc.mptc.trace import IntArray
from scripts.hdl.mptc_job import FAMILY_METHODS, FIELDS
from scripts.studies import mptc, mptc_machines
from tb.helpers import mptc_rows as core

METHODS = tuple(FAMILY_METHODS)
#: The twin's rule for each value of `duty_rule`.
RULES = (twin.DEADBEAT, twin.MEAN, twin.BEST, twin.BEST)


@dataclass(frozen=True)
class PairRows:
    """Inputs of the core, one row per decision."""

    rows: core.Rows  #: Registers, measurements, u.
    pairs: IntArray  #: (n,): port `family_method`.
    applied: IntArray  #: (n, 5): u1, u2, u3, t1, t2; u for the whole period where `pairs` is 0.
    rules: IntArray  #: (n,): port `duty_rule`, which MPTC1 and MPTC2 read.

    def __len__(self) -> int:
        return len(self.rows)

    def pick(self, some: IntArray | slice) -> PairRows:
        """Some of the rows, in the order asked for."""
        rows = core.Rows(self.rows.registers[some], self.rows.measurements[some], self.rows.u[some])
        return PairRows(rows, self.pairs[some], self.applied[some], self.rules[some])

    def shuffled(self, seed: int) -> PairRows:
        """The same rows in random order."""
        return self.pick(np.random.default_rng(seed).permutation(len(self)))

    def cycles(self) -> IntArray:
        """Clocks that each decision takes."""
        of_pairs = np.array([0, *(cycles.FAMILY[name] for name in METHODS)])[self.pairs]
        with_best = np.array([0, *(cycles.of(name, "best") for name in METHODS)])[self.pairs]
        return np.where(
            self.pairs == 0, self.rows.cycles(), np.where(self.best(), with_best, of_pairs)
        )

    def best(self) -> NDArray[np.bool_]:
        """Whether the duty rule of a row is best."""
        return np.array([RULES[rule] == twin.BEST for rule in self.rules])

    def by_length(self, k: int) -> bool:
        """Whether the rule best takes another decision than deadbeat does."""
        given = self.rows.registers[k], self.pairs[k] - 1
        seen = self.rows.measurements[k], self.applied[k]
        best, deadbeat = (
            twin.decide_words(*given, rule, *seen) for rule in (twin.BEST, twin.DEADBEAT)
        )
        return best[0] != deadbeat[0]

    def expected(self) -> IntArray:
        """Decisions of the twins: in the order of ``FIELDS``, then u1, u2, u3, t1, t2."""
        table = np.zeros((len(self), len(FIELDS) + 5), dtype=np.int64)
        clocks = self.cycles()
        single = self.rows.expected()
        for k, code in enumerate(self.pairs):
            if code == 0:
                u, saturated, clamped = single[k]
                sequence = (u, u, u, TIME_STEPS, 0)
            else:
                sequence, saturated, clamped = twin.decide_words(
                    self.rows.registers[k], code - 1, RULES[self.rules[k]],
                    self.rows.measurements[k], self.applied[k],
                )  # fmt: skip
                u = sequence[0]
            table[k] = (u, clocks[k], saturated, clamped, core.SWITCHES[u], *sequence)
        return table


def any_sequences(rng: np.random.Generator, n: int) -> IntArray:
    """Sequences of any content, times of zero and of the whole period among them; few longer."""
    t1 = np.where(
        rng.random(n) < 0.2, rng.choice([0, TIME_STEPS], n), rng.integers(0, TIME_STEPS + 1, n)
    )
    left = TIME_STEPS - t1
    share = np.where(rng.random(n) < 0.3, rng.choice([0.0, 1.0], n), rng.random(n))
    t2 = (share * left).astype(np.int64)
    most = 2 * TIME_STEPS - 1
    long = rng.random(n) < 0.04
    t1, t2 = (
        np.where(long, rng.choice([t1, np.full(n, most)]), t1),
        np.where(long, rng.choice([left + 1, rng.integers(left + 1, most + 1)]), t2),
    )
    return np.column_stack([rng.integers(0, 8, (n, 3)), t1, t2])


def mixed(seed: int, n: int) -> PairRows:
    """Recorded states, states and registers of any content; all methods in random order."""
    rng = np.random.default_rng(seed)
    rows = core.mixed(seed, n)
    count = len(rows)
    # MPFC's rows keep their method where none of several vectors is chosen
    pairs = rng.integers(0, len(METHODS) + 1, count)
    registers = rows.registers.copy()
    rows = core.Rows(registers, rows.measurements, rows.u)
    applied = any_sequences(rng, count)
    alone = pairs == 0
    applied[alone, :3] = rows.u[alone, None]
    applied[alone, 3], applied[alone, 4] = TIME_STEPS, 0
    return PairRows(rows, pairs, applied, rng.integers(0, len(RULES), count))


def _near(method: str, rng: np.random.Generator) -> tuple[IntArray, IntArray]:
    """Registers and measurements of a state whose references a period can reach, or nearly."""
    ts = float(rng.choice([50e-6, 100e-6]))
    drive = core.shipped("induction_2kw2").with_control(method=method, ts=ts)
    register, _, _, scales, lows, highs = twin.parameters(drive)
    flux = 0.9 * cmath.exp(1j * rng.uniform(0, 2 * math.pi)) * rng.uniform(0.98, 1.02)
    current = flux * complex(4.0, rng.uniform(-6, 6)) + complex(*rng.normal(0, 0.3, 2))
    wanted = 3.0 * (flux.conjugate() * current).imag + rng.normal(0.0, 1.0)
    length = abs(flux) * rng.choice([1.0, rng.uniform(0.98, 1.02)])
    # now and then hardly any voltage: the way to go is very long
    omega = rng.uniform(-330, 330)
    vdc = 540.0 * rng.choice([1.0, 1.0, 1.0, 0.5 ** rng.integers(4, 14)])
    seen, _ = bit_true.encode_row(
        scales, lows, highs, current, flux, omega, float(vdc), wanted, float(length)
    )
    return register, seen


def near(seed: int, n: int) -> PairRows:
    """Periods as in a drive, n of each method of several vectors, in random order."""
    rng = np.random.default_rng(seed)
    codes = rng.permutation(np.repeat(np.arange(1, len(METHODS) + 1), n))
    registers, seen = zip(*(_near(METHODS[code - 1], rng) for code in codes), strict=True)
    applied = any_sequences(rng, len(codes))
    rows = core.Rows(np.array(registers), np.array(seen), applied[:, 0])
    return PairRows(rows, codes, applied, rng.integers(0, len(RULES), len(codes)))


def hardly_any_voltage(seed: int, n: int) -> PairRows:
    """As `near`, with a dc-link voltage of 0, 1 and 2 LSB."""
    rows = near(seed, n)
    voltages = np.random.default_rng(seed).integers(0, 3, len(rows))
    rows.rows.measurements[:, core.V_DC] = voltages
    return rows


def nothing_missing() -> PairRows:
    """SVM where the flux comes to the reference by itself: e is zero in both coordinates."""
    register = [40786, -90278, -1395, -887, -1049, -3371, -2322, 6554, 15099, 13076, 13595, 3225, 0]
    seen = [
        [974, -4775, 18358, -15437, -14002, 32768, -1921, 19246],
        [2823, -3184, 1648, -23847, -14374, 32768, 14198, 19701],
        [1181, -3735, 18001, -15066, -8088, 32768, -475, 19244],
    ]
    applied = np.array([[3, 5, 7, 2826, 1148], [4, 1, 5, 22, 4074], [7, 7, 2, 379, 2386]])
    rows = core.Rows(np.array([register] * 3), np.array(seen), applied[:, 0])
    return PairRows(rows, np.full(3, FAMILY_METHODS["SVM"]), applied, np.array([1, 0, 0]))


def longer_by_an_lsb() -> PairRows:
    """MPFC3 with times of the two vectors whose sum is a period and one LSB of e."""
    register = [40786, -90278, -1396, -887, -1049, -3371, -2322, 6554, 15099, 13076, 13595, 3225, 0]
    seen = [
        [3828, -323, 18597, -15276, -5814, 32768, 4259, 19831],
        [-3459, 2666, -22459, 6959, 13724, 32768, -2564, 19451],
    ]
    applied = np.array([[1, 0, 5, 2947, 141], [5, 7, 6, 2471, 807]])
    rows = core.Rows(np.array([register] * 2), np.array(seen), applied[:, 0])
    return PairRows(rows, np.full(2, FAMILY_METHODS["MPFC3"]), applied, np.zeros(2, dtype=int))


def machines(seed: int, n: int) -> PairRows:
    """Random periods of machines from 2.2 to 75 kW, n of each method of several vectors."""
    rng = np.random.default_rng(seed)
    registers, seen, applied, codes = [], [], [], []
    for number, machine in enumerate(mptc_machines.machines().values()):
        for code, method in enumerate(METHODS, start=1):
            drive = machine.with_control(method=method, ts=mptc.PERIODS[method])
            trace = mptc_machines.periods(drive, seed + 10 * number + code, n)
            registers += [twin.parameters(drive)[0]] * n
            seen.append(bit_true.encode(drive, trace)[0])
            applied.append(twin.applied_words(trace))
            codes += [code] * n
    sequences = np.concatenate(applied)
    rows = core.Rows(np.array(registers), np.concatenate(seen), sequences[:, 0])
    return PairRows(rows, np.array(codes), sequences, rng.integers(0, len(RULES), len(codes)))


def together(*parts: PairRows) -> PairRows:
    """Rows one after the other."""
    return PairRows(
        core.together(*(p.rows for p in parts)),
        np.concatenate([p.pairs for p in parts]),
        np.concatenate([p.applied for p in parts]),
        np.concatenate([p.rules for p in parts]),
    )
