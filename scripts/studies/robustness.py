"""What noise costs, and what helps: closed loops of the bit-true model with sensors that err.

``python -m scripts robustness`` runs both shipped drives and random ones, decides with the fast
variant's bit-true model, and writes ``reports/robustness.csv.gz``, one row per closed loop, and the
tables of ``reports/robustness.md``. A row that the file has already is not run again, so that a
study that was stopped goes on where it was; ``--anew`` begins at the first.

One step of delay is compensated and the deadlock rule is the weighted one in every loop.

The loops with another machine ask what a wrong leakage or capacitance costs, and what of it the
estimate of the leakage takes back. They begin to count ``LEARNING`` after the start.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.drive_tables import DriveError
from directmpc.mpdcc import closed_loop, metrics
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.closed_loop import ClosedLoopResult, OperatingPoint
from directmpc.mpdcc.coefficients import ROOM, registers
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.errors import DriveErrors
from scripts.hdl import states
from scripts.shared import rows as stored_rows
from scripts.shared import tables
from scripts.shared.tools import ROOT

NOISE_CURRENT, NOISE_VOLTAGE = 0.005, 0.0025
"""Rms, per unit, of noise 1."""

DRIVES = ("anpc5l_6kv", "anpc5l_3kv3")
SPEEDS = (1.0, 0.6)
BOUNDS = (0.06, 0.10)
GAIN, LOWER_GAIN = 1 / 16, 1 / 32
"""Of the capacitor filters; the lower one is for noise 2."""

#: Noise, outside rule, gain of the capacitor filters: of the random drives.
RANDOM_REMEDIES = (
    (0.0, "dead", 1.0), (0.0, "inwards", 1.0),
    (1.0, "dead", 1.0), (1.0, "inwards", 1.0), (1.0, "dead", GAIN), (1.0, "inwards", GAIN),
)  # fmt: skip
#: The same of the shipped drives.
REMEDIES = (
    *RANDOM_REMEDIES, (0.0, "inwards", GAIN), (0.0, "inwards", LOWER_GAIN),
    (1.0, "inwards", LOWER_GAIN),
    (2.0, "dead", 1.0), (2.0, "inwards", 1.0), (2.0, "inwards", GAIN), (2.0, "inwards", LOWER_GAIN),
)  # fmt: skip
STARTS, MACHINE_STARTS = 32, 16
"""Starts of a point of the shipped drives, and of one with another machine. The switching frequency
of a start is off its mean by 2 to 7 %; a point's is known within 1 to 2 % (standard error)."""
RANDOM = 200
"""Random drives: without noise and under noise 1, by either rule and with filters."""

STEPS, SETTLE = 3000, 400
LEARNING = 0.15
"""s from the start until the loops with another machine count."""

#: Machine and inverter of the plant: factors on the controller's parameters.
MACHINES: dict[str, dict[str, dict[str, float]]] = {
    "same": {},
    "leakage x 0.8": {"machine": {"xls": 0.8, "xlr": 0.8}},
    "leakage x 1.2": {"machine": {"xls": 1.2, "xlr": 1.2}},
    "capacitances x 0.9": {"inverter": {"xdc": 0.9, "xph": 0.9}},
    "capacitances x 1.1": {"inverter": {"xdc": 1.1, "xph": 1.1}},
    "resistances x 1.5, sensors, dead time": {"machine": {"rs": 1.5, "rr": 1.5}},
    "gain of the currents 1 %": {},
    "dc-link ripple 5 %": {},
}
#: Errors of sensors and switches of a machine besides the noise, as of `DriveErrors`. The ripple is
#: a share of the drive's v_dc.
FLAWS: dict[str, dict[str, Any]] = {
    "resistances x 1.5, sensors, dead time": {
        "bits": 12, "offset_current": 0.005, "offset_voltage": 0.005, "dead_time": 2e-6,
    },
    "gain of the currents 1 %": {"gain_current": 0.01},
    "dc-link ripple 5 %": {"ripple": 0.05},
}  # fmt: skip

KNOWN, GIVEN, THETA, OBSERVER = "known", "not known", "theta", "theta, observer"
"""Whether the controller knows the machine, estimates its leakage, and its rotor flux besides."""

#: Machine and what the controller knows of it, by noise 1 with the rule "inwards" and filters.
MISMATCHES = (
    ("same", KNOWN), ("same", THETA), ("same", OBSERVER),
    *[(f"leakage x {x}", how) for x in (0.8, 1.2) for how in (KNOWN, GIVEN, THETA, OBSERVER)],
    *[(f"capacitances x {x}", how) for x in (0.9, 1.1) for how in (KNOWN, THETA)],
    ("resistances x 1.5, sensors, dead time", OBSERVER),
    *[(f, how) for f in ("gain of the currents 1 %", "dc-link ripple 5 %")
      for how in (THETA, OBSERVER)],
)  # fmt: skip
#: A random drive's machine in the plant: both leakages times a factor within `SPREAD`, drawn by
#: the drive's number.
DRAWN = "leakage x 0.8 to 1.2"
SPREAD = (0.8, 1.2)
#: What the controllers of random drives know of such a machine, by noise 1 with the rule "inwards"
#: and filters.
RANDOM_KNOWS = (KNOWN, GIVEN, THETA, OBSERVER)
REPORT = ROOT / "reports" / "robustness.csv.gz"
PAGE = ROOT / "reports" / "robustness.md"
BEGIN = "<!-- {}: begin (written by python -m scripts robustness) -->"
END = "<!-- {}: end -->"


@dataclass(frozen=True, order=True)
class Setting:
    """One closed loop; `drive` is a shipped one's name or ``random N``.

    `machine` is one of `MACHINES`, or `DRAWN` with a random drive. `knows` is empty where the loop
    counts after `SETTLE` steps, and else what the controller knows of the machine; then it counts
    after `LEARNING`.
    """

    drive: str
    horizon: str
    speed: float
    bound: float
    noise: float
    rule: str
    gain: float
    start: int
    machine: str = "same"
    knows: str = ""


FIGURES = (
    "fsw_hz", "thd_pct", "deadlocks_per_1000", "excess_current", "excess_vn", "excess_vph",
    "outside_pct", "theta", "saturated",
)  # fmt: skip


def settings(starts: int, count: int) -> Iterator[Setting]:
    """All closed loops of the study, in order."""
    for start, name, horizon, speed, bound, remedy in itertools.product(
        range(starts), DRIVES, ("SE", "SESE"), SPEEDS, BOUNDS, REMEDIES
    ):
        yield Setting(name, horizon, speed, bound, *remedy, start)
    for horizon, number, remedy in itertools.product(("SE", "SESE"), range(count), RANDOM_REMEDIES):
        yield Setting(f"random {number}", horizon, SPEEDS[number % 2], 0.10, *remedy, 0)
    for start, name, horizon, speed, mismatch in itertools.product(
        range(min(starts, MACHINE_STARTS)), DRIVES, ("SE", "SESE"), SPEEDS, MISMATCHES
    ):
        yield Setting(name, horizon, speed, 0.10, 1.0, "inwards", GAIN, start, *mismatch)
    for horizon, number, knows in itertools.product(("SE", "SESE"), range(count), RANDOM_KNOWS):
        yield Setting(
            f"random {number}", horizon, SPEEDS[number % 2], 0.10, 1.0, "inwards", GAIN, 0,
            DRAWN, knows,
        )  # fmt: skip


def drive_of(setting: Setting) -> Drive:
    """The drive of a closed loop with its controller settings."""
    kind, _, number = setting.drive.partition(" ")
    base = states.shipped(DRIVES[0] if number else kind)
    if number:
        base = _random(base, np.random.default_rng(int(number)))
    return base.with_control(
        bound_current=setting.bound,
        switching_horizon=setting.horizon,
        outside_rule=setting.rule,
        deadlock_rule="weighted",
        delay_compensation=True,
        capacitor_filter=-round(math.log2(setting.gain)),
    )


def _random(base: Drive, rng: np.random.Generator) -> Drive:
    """A drive like another one."""
    while True:
        tables = {
            "machine": {
                k: getattr(base.machine, k) * rng.uniform(0.5, 1.5)
                for k in ("rs", "rr", "xls", "xlr", "xm")
            },
            "inverter": {
                k: getattr(base.inverter, k) * rng.uniform(0.5, 1.5) for k in ("xdc", "xph")
            },
            "control": {"ts": base.control.ts * rng.uniform(0.5, 1.5)},
        }
        try:
            return base.changed(**tables)
        except DriveError:  # out of a drive file's range: another one
            continue


def factors_of(setting: Setting) -> dict[str, dict[str, float]]:
    """How the plant's machine and inverter differ from the controller's."""
    if setting.machine != DRAWN:
        return MACHINES[setting.machine]
    number = int(setting.drive.partition(" ")[2])
    # another stream than the drive's own
    factor = float(np.random.default_rng([number, 1]).uniform(*SPREAD))
    return {"machine": {"xls": factor, "xlr": factor}}


def simulate(
    setting: Setting, steps: int, drive: Drive | None = None
) -> tuple[Drive, ClosedLoopResult]:
    """Run a closed loop."""
    drive = drive_of(setting) if drive is None else drive
    real = drive.changed(
        **{
            table: {key: getattr(getattr(drive, table), key) * x for key, x in factors.items()}
            for table, factors in factors_of(setting).items()
        }
    )
    if setting.knows == KNOWN:
        drive = real
    flaws = dict(FLAWS.get(setting.machine, {}))
    if "ripple" in flaws:
        flaws["ripple"] *= drive.inverter.vdc
    errors = DriveErrors(
        noise_current=setting.noise * NOISE_CURRENT,
        noise_voltage=setting.noise * NOISE_VOLTAGE,
        seed=1000 + setting.start,
        **flaws,
    )
    estimate = setting.knows in (THETA, OBSERVER)
    result = closed_loop.simulate(
        drive, bit_true_fast.decide,
        registers(drive, "fast", ROOM if estimate else 1.0).array(),
        OperatingPoint(setting.speed), steps,
        settle=round(LEARNING / drive.control.ts) if setting.knows else SETTLE, seed=setting.start,
        plant_drive=real, delay=True, compensate=False, errors=errors,
        flux_observer=setting.knows == OBSERVER, leakage_estimate=estimate,
    )  # fmt: skip
    return drive, result


def loop(setting: Setting, steps: int, drive: Drive | None = None) -> dict[str, Any]:
    """Run a closed loop and count."""
    drive, result = simulate(setting, steps, drive)
    summary = metrics.summarise(drive, result)
    switching = metrics.switching_frequency(result.positions, drive.control.ts)
    excess = metrics.bound_violations(result, drive.bounds)
    voltages = result.state[:-1, 4:].copy()
    voltages[:, 1:] -= result.profile.vdc[:, None] / 4
    outside = np.any(np.abs(voltages) > drive.bounds[3:] + 0.002, axis=1)
    return asdict(setting) | {
        "fsw_hz": switching.per_device,
        "thd_pct": 100 * summary.thd_mean,
        "deadlocks_per_1000": 1000 * float(result.decisions.deadlock.mean()),
        "excess_current": float(excess[:3].max()),
        "excess_vn": float(excess[3]),
        "excess_vph": float(excess[4:].max()),
        "outside_pct": 100 * float(outside.mean()),
        "saturated": int(result.decisions.saturated.sum()),
        "theta": float(result.theta[-1]) if result.theta is not None else 1.0,
    }


def read(path: Path) -> dict[Setting, dict[str, float]]:
    """Rows of a study's file."""
    return stored_rows.read(path, Setting, FIGURES)


def study(
    out: Path,
    jobs: int,
    steps: int,
    starts: int,
    count: int,
    *,
    anew: bool = False,
    scheduler: str | None = None,
) -> dict[Setting, dict[str, float]]:
    """Run what the file does not have yet."""
    return stored_rows.study(
        "closed loops", functools.partial(loop, steps=steps), settings(starts, count), FIGURES,
        out, jobs, anew=anew, scheduler=scheduler,
    )  # fmt: skip


def _mean(rows: Sequence[dict[str, float]], name: str) -> float:
    return float(np.mean([row[name] for row in rows])) if rows else float("nan")


def mismatch_table(rows: dict[Setting, dict[str, float]]) -> str:
    """What another machine changes: least and most over both shipped drives and their points."""
    lines = []
    for machine, knows in MISMATCHES:
        if knows == KNOWN or machine == "same":
            continue
        base = machine if (machine, KNOWN) in MISMATCHES else "same"
        fsw, thd, deadlocks = [], [], []
        for name, horizon, speed in itertools.product(DRIVES, ("SE", "SESE"), SPEEDS):
            chosen, known = (
                [
                    v
                    for k, v in rows.items()
                    if (k.drive, k.horizon, k.speed, k.machine, k.knows)
                    == (name, horizon, speed, *wanted)
                ]
                for wanted in ((machine, knows), (base, KNOWN))
            )
            for found, figure in ((fsw, "fsw_hz"), (thd, "thd_pct")):
                found.append(100 * (_mean(chosen, figure) / _mean(known, figure) - 1))
            deadlocks.append(_mean(chosen, "deadlocks_per_1000"))
        lines.append(
            (
                machine, knows, f"{min(fsw):+.0f}, {max(fsw):+.0f}",
                f"{min(thd):+.1f}, {max(thd):+.1f}", f"{max(deadlocks):.0f}",
            )
        )  # fmt: skip
    head = ("plant", "leakage", "f_sw, %", "THD, %", "deadlocks, at most")
    return tables.markdown(head, lines)


@dataclass(frozen=True)
class Change:
    """What a remedy changes at a point, against exact measurements and the paper's rule."""

    #: Change of the mean switching frequency and its standard error, %.
    fsw: float
    error: float
    thd: float  #: Change of the mean THD, %.
    deadlocks: float  #: Deadlocks per 1,000 steps beyond those of exact measurements.


def changes(
    rows: dict[Setting, dict[str, float]], remedy: tuple[float, str, float]
) -> list[Change]:
    """What a remedy changes at each point of the shipped drives."""
    by_point: dict[tuple[Any, ...], list[dict[str, float]]] = {}
    for k, v in rows.items():
        if not k.knows:
            point = k.drive, k.bound, k.horizon, k.speed, (k.noise, k.rule, k.gain)
            by_point.setdefault(point, []).append(v)
    found = []
    for point in itertools.product(DRIVES, BOUNDS, ("SE", "SESE"), SPEEDS):
        chosen, exact = (
            by_point.get((*point, _rounded_remedy(one)), []) for one in (remedy, REMEDIES[0])
        )
        mean = _mean(exact, "fsw_hz")
        spread = sum(
            float(np.var([row["fsw_hz"] for row in one], ddof=1)) / len(one)
            for one in (chosen, exact)
            if len(one) > 1
        )
        found.append(
            Change(
                100 * (_mean(chosen, "fsw_hz") / mean - 1),
                100 * math.sqrt(spread) / mean,
                100 * (_mean(chosen, "thd_pct") / _mean(exact, "thd_pct") - 1),
                _mean(chosen, "deadlocks_per_1000") - _mean(exact, "deadlocks_per_1000"),
            )
        )
    return found


def gain_table(rows: dict[Setting, dict[str, float]]) -> str:
    """What the gain of the filters is worth by the noise, over all points of the shipped drives."""
    lines = []
    for noise, gain in itertools.product((0.0, 1.0, 2.0), (1.0, GAIN, LOWER_GAIN)):
        found = changes(rows, (noise, "inwards", gain))
        worst = max(found, key=lambda one: one.fsw)
        lines.append(
            (
                f"noise {noise:g}" if noise else "exact", f"{-round(math.log2(gain))}",
                f"{np.mean([one.fsw for one in found]):+.1f}",
                f"{worst.fsw:+.1f} ± {worst.error:.1f}",
                f"{max(one.deadlocks for one in found):+.1f}",
            )
        )  # fmt: skip
    head = (
        "noise", "q", "f_sw, %: mean", "worst point ± standard error", "deadlocks: worst point"
    )  # fmt: skip
    return tables.markdown(head, lines)


def _rounded_remedy(remedy: tuple[float, str, float]) -> tuple[float, str, float]:
    return remedy[0], remedy[1], float(stored_rows.cell(remedy[2]))


def largest_excess(rows: dict[Setting, dict[str, float]]) -> float:
    """Furthest that a phase current of a random drive went beyond its bound."""
    return max(v["excess_current"] for k, v in rows.items() if k.drive.startswith("random"))


def publish(rows: dict[Setting, dict[str, float]], page: Path) -> None:
    """Write the tables into their page."""
    made = {"gain": gain_table, "mismatch": mismatch_table}
    tables.rewrite(
        page, {(BEGIN.format(n), END.format(n)): table(rows) for n, table in made.items()}
    )
