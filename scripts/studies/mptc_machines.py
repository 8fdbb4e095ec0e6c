"""Bit-true and ideal decisions on machines of several sizes: random periods of every method."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from directmpc.api.drive_file import load_mptc_drive
from directmpc.mptc import bit_true, bit_true_sequences, ideal, ideal_sequences
from directmpc.mptc.drive import SEQUENCE_METHODS, SINGLE_METHODS, MptcDrive
from directmpc.mptc.inverter import HALF_BRIDGES, UNIT
from directmpc.mptc.plant import steady_state
from directmpc.mptc.sequence import NEIGHBOURS, TIME_STEPS, VectorSequence, mean_voltage, whole
from directmpc.mptc.trace import FloatArray, IntArray, MptcTrace
from scripts.studies.mptc import DRIVES, PERIODS

PAGE = Path(__file__).resolve().parents[2] / "reports" / "mptc.md"
BEGIN = "<!-- machines: begin (written by python -m scripts mptc-machines --page) -->"
END = "<!-- machines: end -->"
#: Of each machine and method, for the page.
PERIOD_COUNT = 4000
FLUX_METHODS = ("MPFC", "MPFC2", "MPFC3", "MPC2", "SVM")
#: Times that differ by more count, in steps of the period.
TIME_LIMIT = 12
#: A lead of ideal's choice is clear from here on: share of torque_max, Wb.
CLEAR_TORQUE, CLEAR_FLUX = 0.0035, 1e-3


def _machine(
    rs: float, rr: float, lm: float, leakage: float, current_max: float, torque_max: float
) -> MptcDrive:
    """A drive at 400 V with two pole pairs; ohm, H, A, N*m."""
    return MptcDrive.model_validate(
        {
            "controller": "mptc",
            "machine": {
                "rs": rs, "rr": rr, "lm": lm, "ls": lm + leakage, "lr": lm + leakage,
                "pole_pairs": 2,
            },
            "inverter": {"topology": HALF_BRIDGES[0], "vdc": 565.0},
            "control": {
                "ts": 100e-6, "k_psi": 2.5 * torque_max, "psi_max": 1.25,
                "current_max": current_max, "torque_max": torque_max, "speed_max": 500.0,
            },
        }
    )  # fmt: skip


def machines() -> dict[str, MptcDrive]:
    """Drives by name."""
    return {
        **{name: load_mptc_drive(DRIVES / f"{name}.toml")
           for name in ("induction_2kw2", "motulator_2kw2")},
        "4 kW": _machine(1.405, 1.395, 0.1722, 0.005839, 60.0, 75.0),
        "75 kW": _machine(0.03552, 0.02092, 0.0151, 0.000335, 800.0, 1400.0),
    }  # fmt: skip


def breakdown(drive: MptcDrive, psi_ref: float) -> float:
    """Largest steady torque at a flux."""
    m = drive.machine
    sigma = 1.0 - m.lm * m.lm / (m.ls * m.lr)
    return 0.75 * m.pole_pairs * (m.lm / m.ls) ** 2 * psi_ref**2 / (sigma * m.lr)


def periods(drive: MptcDrive, seed: int, count: int) -> MptcTrace:
    """Random periods: any flux, load and angle, speeds that the dc link allows, and a ripple."""
    rng = np.random.default_rng(seed)
    c, m = drive.control, drive.machine
    way = 2.0 / 3.0 * drive.inverter.vdc * c.ts
    rows, vectors, times = [], [], []
    for _ in range(count):
        psi = c.psi_max * math.exp(rng.uniform(math.log(0.1), math.log(0.9)))
        most = min(c.torque_max / 2.0, 0.7 * breakdown(drive, psi))
        fastest = min(0.9 * c.speed_max, 0.5 * drive.inverter.vdc / psi)
        torque, omega = rng.uniform(-1.0, 1.0, 2) * (most, fastest)
        current, flux = steady_state(drive, float(omega), float(torque), psi)
        turn = cmath.exp(2j * math.pi * rng.random())
        ripple = way * complex(*rng.normal(0.0, 0.2, 2))
        current, flux = current * turn + ripple / (m.ls - m.lm**2 / m.lr), flux * turn + ripple
        rows.append((current.real, current.imag, flux.real, flux.imag, omega, torque, psi))
        u = int(rng.integers(1, 7))
        other = int(rng.choice([0, *NEIGHBOURS[u]]))
        vectors.append((u, other, other))
        share = int(rng.integers(TIME_STEPS + 1)) / TIME_STEPS
        times.append((share, 1.0 - share))
    table, applied = np.array(rows), np.array(vectors, dtype=np.int64)
    return MptcTrace(
        table[:, 0:2], table[:, 2:4], table[:, 4], table[:, 5], table[:, 6], applied[:, 0],
        applied, np.array(times),
    )  # fmt: skip


class Difference(NamedTuple):
    """Bit-true and ideal decisions of the same periods."""

    count: int  #: Periods.
    vectors: int  #: Those with other voltages.
    #: Those with the same, and times more than `TIME_LIMIT` steps apart; places in the trace.
    times: tuple[int, ...]
    clear: int  #: Those with other voltages where ideal's leads clearly.
    #: Largest lead of ideal's voltages where others are taken; N*m, with flux methods Wb.
    lead: float
    saturated: int  #: Periods with a word that did not hold its value.


def _voltage(vectors: IntArray, times: FloatArray) -> tuple[int, ...]:
    """Vectors that have more than a step of the period, in order; zero is one, neighbours too."""
    made: list[int] = []
    for u, t in zip(vectors % 7, (*times, 1.0 - times.sum()), strict=True):
        if t > 1.0 / TIME_STEPS + 1e-9 and made[-1:] != [int(u)]:
            made.append(int(u))
    return tuple(made)


def _lead(
    drive: MptcDrive, trace: MptcTrace, k: int, made: VectorSequence, wanted: VectorSequence
) -> float:
    """What ideal's choice is cheaper by: N*m, for flux methods Wb."""
    c, vdc = drive.control, drive.inverter.vdc
    references = float(trace.torque_ref[k]), float(trace.psi_ref[k])
    state = complex(*trace.i_s[k]), complex(*trace.psi_s[k]), float(trace.omega_r[k])
    if c.method in SINGLE_METHODS:
        p = ideal.ideal_parameters(drive)
        cost, _ = ideal.costs(p, *state, int(trace.u[k]), vdc, *references)
        return float(cost[made.u1 % 7] - cost[wanted.u1 % 7])
    q = ideal_sequences.sequence_parameters(drive)
    seen = trace.sequences()
    applied = VectorSequence(*(int(u) for u in seen.vectors[k]), *map(float, seen.times[k]))
    o = ideal_sequences.outlook(q, *state, applied, vdc, *references)
    if c.method in FLUX_METHODS:
        away = [
            abs(o.reference - o.base - c.ts * vdc * mean_voltage(s, UNIT)) for s in (made, wanted)
        ]
        return float(away[0] - away[1])
    if c.method == "MPTC1":  # chooses by what a vector does in the whole period
        made, wanted = whole(made.u1), whole(wanted.u1)
    costs = [
        ideal_sequences.pair_cost(q, o, vdc, *references, s.u1, s.u2, s.t1) for s in (made, wanted)
    ]
    return float(costs[0] - costs[1])


def difference(drive: MptcDrive, trace: MptcTrace, seen: MptcTrace | None = None) -> Difference:
    """Compare the bit-true decisions with the ideal ones."""
    seen = seen or trace
    several = drive.control.method in SEQUENCE_METHODS
    if several:
        made, wanted = bit_true_sequences.run(drive, seen), ideal_sequences.run(drive, trace)
    else:
        made, wanted = bit_true.run(drive, seen), ideal.run(drive, trace)
    sequences = []
    for d in (made, wanted):
        vectors = d.vectors if several else np.repeat(d.u[:, None], 3, axis=1)
        times = d.times if several else np.tile((1.0, 0.0), (len(d.u), 1))
        assert vectors is not None
        assert times is not None
        sequences.append((vectors, times))
    (one, t_one), (other, t_other) = sequences
    vectors, leads = 0, [0.0]
    times: list[int] = []
    for k in range(len(trace)):
        if _voltage(one[k], t_one[k]) != _voltage(other[k], t_other[k]):
            vectors += 1
            both = [
                VectorSequence(*(int(u) for u in v[k]), *map(float, t[k])) for v, t in sequences
            ]
            leads.append(_lead(drive, trace, k, *both))
        elif (one[k] == other[k]).all() and (
            np.abs(t_one[k] - t_other[k]).max() * TIME_STEPS > TIME_LIMIT
        ):
            times.append(k)
    flux = drive.control.method in FLUX_METHODS
    limit = CLEAR_FLUX if flux else CLEAR_TORQUE * drive.control.torque_max
    return Difference(
        len(trace), vectors, tuple(times), sum(lead > limit for lead in leads), max(leads),
        int(made.saturated.sum()),
    )  # fmt: skip


def sweep(count: int, methods: Sequence[str] = tuple(PERIODS)) -> dict[tuple[str, str], Difference]:
    """All methods on all machines, each at the control period of Paper B."""
    return {
        (name, method): difference(given, periods(given, 1, count))
        for name, drive in machines().items()
        for method in methods
        for given in [drive.with_control(method=method, ts=PERIODS[method])]
    }


def table(found: dict[tuple[str, str], Difference]) -> str:
    """Shares by method and machine, for reports/mptc.md."""
    names = list(dict.fromkeys(name for name, _ in found))
    lines = ["| vectors / times that differ, % | " + " | ".join(names) + " | all |"]
    lines.append("| --- |" + " ---: |" * (len(names) + 1))
    for method in dict.fromkeys(method for _, method in found):
        every = [found[name, method] for name in names]
        cells = [(d.count, d.vectors, len(d.times)) for d in every]
        cells.append(tuple(sum(column) for column in zip(*cells, strict=True)))
        shown = [f"{100.0 * v / n:.2f} / {100.0 * t / n:.2f}" for n, v, t in cells]
        lines.append(f"| {method} | " + " | ".join(shown) + " |")
    return "\n".join(lines)
