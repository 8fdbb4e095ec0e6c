"""Figures of studies and bitstreams as sections of reports/metrics.json, from reports/ alone.

Each section has what the tables of its page state, before it is rounded for them, None where a page
shows a dash. Figures that are a file's rows stand in that file alone.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scripts.hdl import states
from scripts.measure import bitstream
from scripts.shared import rows as stored_rows
from scripts.shared import tables
from scripts.shared.tools import ROOT
from scripts.studies import (
    bounds,
    capacitor_bounds,
    converters,
    deadlocks,
    horizon,
    lengths,
    mptc_robustness,
    noise_decisions,
    pwm,
    random_decisions,
    robustness,
)

REPORTS = ROOT / "reports"
HORIZONS = ("SE", "SESE")
Section = dict[str, Any]


def _rounded(value: Any) -> Any:
    """Enough digits to be rounded as the pages are; None for what is no number."""
    if isinstance(value, Mapping):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, float):
        return float(f"{value:.9g}") if math.isfinite(value) else None
    return value


def put(section: Section, path: Iterable[object], figures: Mapping[str, Any]) -> None:
    """Put figures where a path of keys leads."""
    inner = section
    for key in map(str, path):
        inner = inner.setdefault(key, {})
    inner.update(figures)


def _mean(chosen: Iterable[Mapping[str, Any]], name: str) -> float:
    values = [row[name] for row in chosen if math.isfinite(row[name])]
    return float(np.mean(values)) if values else math.nan


def _change(chosen: Any, base: Any, name: str) -> float:
    """Of a mean, in percent of another."""
    return 100 * (_mean(chosen, name) / _mean(base, name) - 1)


# --- robustness -----------------------------------------------------------------------------------


def label(rule: str, gain: float) -> str:
    """Rule and filters as the tables of the page name them."""
    return f"{rule}, filters 1/{round(1 / gain)}" if gain < 1 else rule


def remedy(noise: float, rule: str, gain: float) -> str:
    """Noise and what is done about it, as a key."""
    return f"noise {noise:g}, {label(rule, gain)}"


def _near(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=1e-4)


def _points() -> Iterable[tuple[str, float]]:
    return itertools.product(HORIZONS, robustness.SPEEDS)


def _compared(chosen: Any, base: Any) -> dict[str, float]:
    return {
        "fsw_change_pct": _change(chosen, base, "fsw_hz"),
        "thd_change_pct": _change(chosen, base, "thd_pct"),
        "deadlocks_per_1000": _mean(chosen, "deadlocks_per_1000"),
    }


def shipped(found: Mapping[robustness.Setting, Any]) -> Section:
    """What noise and remedies change on the shipped drives."""
    section: Section = {}
    places = itertools.product(robustness.DRIVES, robustness.BOUNDS, _points())
    for drive, bound, (kind, speed) in places:
        mine = {
            k: v
            for k, v in found.items()
            if (k.drive, k.bound, k.horizon, k.speed) == (drive, bound, kind, speed) and not k.knows
        }
        by = {
            one: [
                v for k, v in mine.items() if (k.noise, k.rule) == one[:2] and _near(k.gain, one[2])
            ]
            for one in robustness.REMEDIES
        }
        exact = by[robustness.REMEDIES[0]]
        for one in robustness.REMEDIES[1:]:
            path = (drive, bound, remedy(*one), f"{kind} {speed}")
            put(section, path, _compared(by[one], exact))
    return section


def _mismatch(found: Mapping[robustness.Setting, Any]) -> Section:
    section: Section = {}
    for drive, (machine, knows) in itertools.product(robustness.DRIVES, robustness.MISMATCHES):
        if knows == robustness.KNOWN:
            continue
        base = machine if (machine, robustness.KNOWN) in robustness.MISMATCHES else "same"
        for kind, speed in _points():
            chosen, known = (
                [
                    v
                    for k, v in found.items()
                    if (k.drive, k.horizon, k.speed, k.machine, k.knows)
                    == (drive, kind, speed, *wanted)
                ]
                for wanted in ((machine, knows), (base, robustness.KNOWN))
            )
            path = (drive, machine, knows, f"{kind} {speed}")
            put(section, path, _compared(chosen, known) | {"theta": _mean(chosen, "theta")})
    return section


def _spread(values: Sequence[float]) -> dict[str, float]:
    low, middle, high = (float(one) for one in np.percentile(values, (5, 50, 95)))
    return {"median": middle, "p05": low, "p95": high}


def _random_figures(
    chosen: Mapping[str, Mapping[str, float]], base: Mapping[str, Mapping[str, float]]
) -> Section:
    """Figures of random drives, and their changes against other loops of the same drives."""
    figures: Section = {
        f"{figure}_change_pct": _spread(
            [100 * (mine[column] / base[drive][column] - 1) for drive, mine in chosen.items()]
        )
        for figure, column in (("fsw", "fsw_hz"), ("thd", "thd_pct"))
    }
    for figure, column in (
        ("deadlocks_per_1000", "deadlocks_per_1000"),
        ("excess_current_pu", "excess_current"),
        ("voltage_outside_pct", "outside_pct"),
    ):
        figures[figure] = _spread([mine[column] for mine in chosen.values()])
    figures["drives_flagged"] = sum(mine["saturated"] > 0 for mine in chosen.values())
    return figures


def _random(found: Mapping[robustness.Setting, Any]) -> Section:
    by: dict[tuple[str, str], dict[str, Mapping[str, float]]] = {}
    drives = set()
    for k, v in found.items():
        if k.drive.startswith("random"):
            drives.add(k.drive)
            name = k.knows or remedy(k.noise, k.rule, k.gain)
            by.setdefault((k.horizon, name), {})[k.drive] = v
    section: Section = {
        "drives": len(drives), "largest_excess_current_pu": robustness.largest_excess(found),
    }  # fmt: skip
    exact = remedy(*robustness.RANDOM_REMEDIES[0])
    names = [remedy(*one) for one in robustness.RANDOM_REMEDIES]
    for kind, name in itertools.product(HORIZONS, names):
        put(section, (kind, name), _random_figures(by[kind, name], by[kind, exact]))
    for kind, knows in itertools.product(HORIZONS, robustness.RANDOM_KNOWS):
        path = (kind, robustness.DRAWN, knows)
        put(section, path, _random_figures(by[kind, knows], by[kind, robustness.KNOWN]))
    return section


def _mptc(found: Mapping[mptc_robustness.Setting, Any]) -> Section:
    numbers = sorted({setting.number for setting in found})
    section: Section = {"drives": len(numbers)}
    every = itertools.product(mptc_robustness.METHODS, list(mptc_robustness.CASES)[1:])
    for method, case in every:
        pairs = [
            (
                found[mptc_robustness.Setting(n, method, case)],
                found[mptc_robustness.Setting(n, method, "none")],
            )
            for n in numbers
        ]
        figures: Section = {
            f"{figure}_change_pct": _spread(
                [100 * (mine[column] / exact[column] - 1) for mine, exact in pairs]
            )
            for figure, column in (
                ("torque_ripple", "torque_ripple_nm"), ("flux_ripple", "flux_ripple_wb"),
                ("thd", "thd_pct"), ("fsw", "switching_hz"),
            )
        }  # fmt: skip
        off = [abs(mine["torque_mean_nm"] - mine["torque_nm"]) for mine, _ in pairs]
        put(section, (method, case), figures | {"torque_off_nm": _spread(off)})
    return section


def of_robustness(reports: Path = REPORTS) -> Section:
    """Noise and wrong parameters, of MPDCC and MPTC."""
    found = robustness.read(reports / robustness.REPORT.name)
    mptc = mptc_robustness.read(reports / mptc_robustness.REPORT.name)
    return {
        "shipped": shipped(found), "random": _random(found), "mismatch": _mismatch(found),
        "mptc": _mptc(mptc),
        "decisions": noise_decisions.shares(
            noise_decisions.read(reports / noise_decisions.REPORT.name)
        ),
        "random_decisions": random_decisions.counts(
            random_decisions.read(reports / random_decisions.REPORT.name)
        ),
    }  # fmt: skip


# --- PWM ------------------------------------------------------------------------------------------


def of_pwm(reports: Path = REPORTS) -> Section:
    """MPDCC beside pulse-width modulation at equal switching frequency."""
    found = stored_rows.read(reports / pwm.REPORT.name, pwm.Setting, pwm.FIGURES)
    section: Section = {}
    for drive, speed in itertools.product(pwm.DRIVES, pwm.SPEEDS):
        at: dict[str, object] = {"drive": drive, "speed": speed}
        control = states.shipped(drive).control
        usual = {"bound_vn": control.bound_vn, "bound_vph": control.bound_vph}
        for pulses in pwm.COMPARED[speed]:
            chosen = pwm.select(found, scheme="PWM", capacitors="real", value=pulses, **at)
            fsw = _mean(chosen, "fsw_hz")
            neutral, phase = pwm.ripple(found, drive, speed, pulses)
            figures = {
                "fsw_hz": fsw, "vn_pu": neutral, "vph_pu": phase,
                "pwm_thd_pct": _mean(chosen, "thd_pct"),
            }  # fmt: skip
            for name, kind in (
                ("same", {"bound_vn": neutral, "bound_vph": phase}), ("studied", usual),
            ):  # fmt: skip
                for scheme in HORIZONS:
                    points = pwm.curve(
                        found, pwm.BOUNDS, scheme=scheme, capacitors="real", **kind, **at
                    )
                    figures[f"{scheme.lower()}_{name}_thd_pct"] = pwm.thd_at(points, fsw)
            perfect = pwm.curve(found, pwm.PULSES[speed], scheme="PWM", capacitors="ideal", **at)
            figures["pwm_ideal_thd_pct"] = pwm.thd_at(perfect, fsw)
            put(section, ("equal", drive, speed, pulses), figures)
        for pulses in pwm.PULSES[speed][:4]:
            chosen = pwm.select(found, scheme="PWM", capacitors="ideal", value=pulses, **at)
            fsw = _mean(chosen, "fsw_hz")
            figures = {"fsw_hz": fsw, "pwm_thd_pct": _mean(chosen, "thd_pct")}
            for scheme in HORIZONS:
                points = pwm.curve(found, pwm.BOUNDS, scheme=scheme, capacitors="ideal", **at)
                figures[f"{scheme.lower()}_thd_pct"] = pwm.thd_at(points, fsw)
            put(section, ("ideal", drive, speed, pulses), figures)
        for bound, scheme in itertools.product(pwm.BALANCED, HORIZONS):
            real, still = (
                pwm.select(found, scheme=scheme, capacitors=kind, value=bound, **usual, **at)
                for kind in ("real", "ideal")
            )
            figures = {
                "fsw_hz": _mean(real, "fsw_hz"), "fsw_still_hz": _mean(still, "fsw_hz"),
                "balance_pct": -_change(still, real, "fsw_hz"),
                "thd_pct": _mean(real, "thd_pct"), "thd_still_pct": _mean(still, "thd_pct"),
            }  # fmt: skip
            put(section, ("balance", drive, speed, bound, scheme), figures)
    for speed in pwm.SPEEDS:
        runs = [
            (k, v)
            for k, v in found.items()
            if k.speed == speed and k.scheme != "PWM" and k.capacitors == "real"
        ]
        figures = {
            "vn_pu": max(v["peak_vn"] - k.bound_vn for k, v in runs),
            "vph_pu": max(v["peak_vph"] - k.bound_vph for k, v in runs),
        }
        put(section, ("excess", speed), figures)
    return section


# --- bounds and lengths ---------------------------------------------------------------------------


def of_bounds(reports: Path = REPORTS) -> Section:
    """Differences from the ideal controller over the bound of the currents, and capacitors."""
    found = bounds.read(reports / bounds.REPORT.name)

    def _of(controller: str, rule: str) -> list[dict[str, Any]]:
        return [row for row in found if (row["controller"], row["rule"]) == (controller, rule)]

    section: Section = {}
    exact = _of("ideal", "largest")
    for row in exact:
        figures = {"fsw_hz": row["fsw_hz"], "thd_pct": row["thd_pct"]}
        put(section, ("ideal", row["bound_pu"]), figures)
    for name in ("paper", "fast"):
        for row, base in zip(_of(name, "largest"), exact, strict=True):
            figures = {
                "fsw_diff_pct": 100 * (row["fsw_hz"] / base["fsw_hz"] - 1),
                "thd_diff_pct": 100 * (row["thd_pct"] / base["thd_pct"] - 1),
            }
            put(section, (name, row["bound_pu"]), figures)
        largest = {
            key: max(abs(one[key]) for one in section[name].values())
            for key in ("fsw_diff_pct", "thd_diff_pct")
        }
        rtl = {key: sum(int(r[key]) for r in _of(name, "largest"))
               for key in ("rtl_rows", "rtl_differing")}  # fmt: skip
        put(section, ("largest", name), largest | rtl)
    for controller, rule in bounds.SETTINGS:
        own = _of(controller, rule)
        figures = {
            key: max(row[key] for row in own)
            for key in ("vn_largest_pu", "vn_outside_pct", "vph_largest_pu", "vph_outside_pct",
                        "deadlocks_pct")
        }  # fmt: skip
        put(section, ("capacitors", controller, rule), figures)
    return section


def of_lengths(reports: Path = REPORTS) -> Section:
    """Errors of predicted lengths."""
    found = lengths.read(reports / lengths.REPORT.name)
    section: Section = {}
    for name in lengths.VARIANTS:
        shares = lengths.histogram(found, name)
        section[name] = {
            "searches": sum(row["searches"] for row in found if row["controller"] == name),
            "exact_pct": shares.get(0, 0.0),
            "one_step_pct": shares.get(-1, 0.0) + shares.get(1, 0.0),
            "more_pct": sum(share for error, share in shares.items() if abs(error) > 1),
            "least_steps": min(shares),
            "largest_steps": max(shares),
        }
    return section


# --- deadlocks ------------------------------------------------------------------------------------

EXCESS = ("excess_current", "excess_vn", "excess_vph")


def of_deadlocks(reports: Path = REPORTS) -> Section:
    """Rules for deadlocks."""
    found = tables.numbers(tables.read_csv(reports / "deadlocks.csv.gz"), ["case", "horizon"])
    section: Section = {}

    def _worst(chosen: Sequence[Mapping[str, Any]]) -> dict[str, float]:
        return {f"{key}_pu": max(row[key] for row in chosen) for key in EXCESS}

    for name, kind, low in itertools.product(deadlocks.CASES, HORIZONS, (True, False)):
        chosen = [
            row
            for row in found
            if (row["case"], row["horizon"]) == (name, kind)
            and (row["speed"] < deadlocks.LOW) == low
            and row["start"] < deadlocks.FRESH
        ]
        if chosen:
            figures = {
                "thd_per_bound": float(np.mean([row["thd_pct"] / row["bound"] for row in chosen])),
                "fsw_hz": _mean(chosen, "fsw_hz"),
                "deadlocks_pct": _mean(chosen, "deadlock_pct"),
            }
            put(section, ("low" if low else "high", name, kind), figures | _worst(chosen))
    for kind, speed, bound, name in itertools.product(
        HORIZONS, deadlocks.SPEEDS, deadlocks.BOUNDS, deadlocks.BUILT_IN
    ):
        chosen = [
            row
            for row in found
            if (row["case"], row["horizon"], row["speed"], row["bound"])
            == (name, kind, speed, bound)
            and row["start"] >= deadlocks.FRESH
        ]
        figures = {}
        for key, column in (
            ("thd_pct", "thd_pct"), ("fsw_hz", "fsw_hz"), ("deadlocks_pct", "deadlock_pct"),
        ):  # fmt: skip
            mean, half = horizon.interval([row[column] for row in chosen])
            figures |= {key: float(mean), f"{key}_interval": float(half)}
        place = ("points", kind, speed, bound, deadlocks.BUILT_IN[name])
        put(section, place, figures | _worst(chosen))
    return section


# --- bitstreams -----------------------------------------------------------------------------------


#: Key -> resource of the part, as nextpnr names it.
RESOURCES = {"lut": "TRELLIS_COMB", "ff": "TRELLIS_FF", "dsp": "MULT18X18D", "bram": "DP16KD"}


def of_boards(reports: Path = REPORTS) -> Section:
    """Bitstreams of boards."""
    section: Section = {}
    for found in json.loads((reports / "bitstreams.json").read_text(encoding="utf-8")):
        used = {key: found["used"].get(kind, (0, 0))[0] for key, kind in RESOURCES.items()}
        clocks = {key: found[key] for key in ("clock_mhz", "fmax_worst_mhz", "seeds")}
        build = "_".join([found["controller"], *bitstream.options(found)])
        put(section, (found["board"], build), used | clocks)
    return section


def of_capacitor_bounds(reports: Path = REPORTS) -> Section:
    """Switching frequency and excess with other bounds of the capacitors."""
    found = capacitor_bounds.read(reports / capacitor_bounds.REPORT.name)
    section: Section = {}
    for drive, scheme, (neutral, phase), noise, speed in itertools.product(
        robustness.DRIVES, HORIZONS, capacitor_bounds.PAIRS, capacitor_bounds.NOISES,
        capacitor_bounds.SPEEDS,
    ):  # fmt: skip
        at = {
            "drive": drive, "horizon": scheme, "bound_vn": neutral, "bound_vph": phase,
            "noise": noise, "speed": speed,
        }  # fmt: skip
        figures = {
            name: capacitor_bounds.mean(found, name, **at) for name in capacitor_bounds.FIGURES
        }
        put(section, (drive, scheme, f"{neutral:g} / {phase:g}", noise, speed), figures)
    return section


def of_converters(reports: Path = REPORTS) -> Section:
    """The core of each converter."""
    return dict(converters.figures(reports.parent / "docs" / converters.PAGE.name))


SECTIONS: dict[str, Callable[[Path], Section]] = {
    "boards": of_boards,
    "converters": of_converters,
    "robustness": of_robustness,
    "pwm": of_pwm,
    "capacitor_bounds": of_capacitor_bounds,
    "bounds": of_bounds,
    "lengths": of_lengths,
    "deadlocks": of_deadlocks,
}
"""Key of metrics.json -> what makes it."""


def sections(reports: Path = REPORTS) -> Section:
    """All sections, as metrics.json has them."""
    return {name: _rounded(make(reports)) for name, make in SECTIONS.items()}
