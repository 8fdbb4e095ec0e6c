"""docs/paper-b.md: what Paper B states beside what every method does here.

`regenerate` runs `scripts.studies.paper_b`, stores its figures in reports/paper_b.csv.gz, draws,
and writes the tables of the page from the stored figures. Whether a claim of the paper holds is
computed from them too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from directmpc.api.drive_file import load_mptc_drive
from directmpc.host.console import terminable
from directmpc.mptc.closed_loop import RPM, Run
from directmpc.mptc.inverter import STATES
from directmpc.mptc.sequence import WHOLE_FROM
from scripts.shared import progress, tables, tools
from scripts.shared.figures import COLOURS, pyplot, save_png
from scripts.shared.tools import ROOT
from scripts.studies import paper_b as study

REPORTS = ROOT / "reports"
CSV = REPORTS / "paper_b.csv.gz"
PAGE = ROOT / "docs" / "paper-b.md"
REPORT = ROOT / "reports" / "paper_b.md"
#: Tables of the report; the page has the others.
REPORTED = ("bands", "claims", "switching", "parameters", "distortion", "ripple", "transients")
DRIVE = ROOT / "drives" / "induction_2kw2.toml"
COMMAND = "python -m scripts paper-b"

CLOSE = 0.05
"""Two figures that differ by at most this share count as alike."""

STEADY_SPAN = 1.3
"""A switching frequency whose largest value is at most so many times its smallest is steady."""

SLOW_BELOW = 1000.0
"""Below this speed, r/min, the paper calls the torque ripples of MPC2 and FOC similar."""

SINUSOIDAL = 5.0
"""THD of a current, %, that the paper may call sinusoidal."""

FOLLOWS = 0.02
"""An error of the speed below this share of the rated one counts as following."""

SIMILAR = 0.25
"""Two ripples that differ by at most this share count as similar."""

_FIVE = (*COLOURS, "#8a5a9e", "#444444")
#: Of every method where several pictures, or panels of one, show different ones.
_COLOUR_OF = {
    "MPTC": COLOURS[0], "MPTC1": COLOURS[1], "MPTC2": COLOURS[2], "GTV": "#8a5a9e",
    "MPFC2": "#d98212", "MPFC3": "#17a2b8", "MPC2": "#7a4b2a", "FOC": "#444444",
}  # fmt: skip
#: Of five curves: a later curve lets one below it be seen.
_MARKS: tuple[dict[str, Any], ...] = (
    {"marker": "o", "markersize": 3},
    {"marker": "^", "markersize": 4},
    {"marker": "s", "markersize": 7, "markerfacecolor": "none"},
    {"marker": "x", "markersize": 5},
    {"marker": ".", "markersize": 4, "linestyle": "--"},
)


class Figures:
    """Figures of the study, as stored."""

    def __init__(self, rows: Iterable[study.Row | dict[str, str]]) -> None:
        self._values = {
            (r["study"], r["controller"], float(r["rpm"]), r["quantity"]): float(r["value"])
            for r in rows
        }

    def __call__(self, name: str, controller: str, rpm: float, quantity: str) -> float:
        """One figure."""
        return self._values[name, controller, rpm, quantity]

    def unloaded(self, controller: str, quantity: str = "thd_pct") -> float:
        """A figure at 150 r/min without load."""
        return self("no load", controller, study.LOW_SPEED, quantity)

    def over_speed(self, controller: str, quantity: str) -> np.ndarray:
        """A figure at rated load at all speeds."""
        return np.array([self("rated load", controller, rpm, quantity) for rpm in study.SPEEDS])


class Claim(NamedTuple):
    """A statement of the paper, and what is found here."""

    source: str  #: Figure or section.
    text: str  #: The statement.
    found: str  #: Figures here.
    holds: str  #: "yes", "no" or "in part", with the speeds.


def _list(values: Iterable[float], form: str) -> str:
    return ", ".join(format(value, form) for value in values)


def _yes(holds: bool) -> str:
    return "yes" if holds else "no"


def _where(holds: np.ndarray, first: int = 0) -> str:
    """Verdict on a statement about the speeds from number `first` on."""
    if holds.all():
        return "yes"
    if not holds.any():
        return "no"
    speeds = np.array(study.SPEEDS)[first : first + len(holds)]
    fewer = holds if holds.sum() <= len(holds) / 2 else ~holds
    return f"in part: {'not ' * (fewer is not holds)}at {_list(speeds[fewer], 'g')} r/min"


def _span(values: np.ndarray, form: str = ".0f") -> str:
    return f"{values.min():{form}} to {values.max():{form}}"


def _ratio(values: np.ndarray) -> float:
    return float(values.max() / values.min())


def _torque_claims(f: Figures) -> list[Claim]:
    """Claims of sections 4, 5.1 and 5.2."""
    thd = {name: f.over_speed(name, "thd_pct") for name in study.LOADED}
    ripple = {name: f.over_speed(name, "torque_ripple_nm") for name in study.LOADED}
    hertz = {name: f.over_speed(name, "switching_hz") for name in study.LOADED}
    at_rest = [f.unloaded(name) for name in ("MPTC2", "MPTC", "MPTC1")]
    calm = [f.unloaded(name, "torque_ripple_nm") for name in ("MPTC", "MPTC1", "MPTC2")]
    still = [f.unloaded(name, "flux_ripple_mwb") for name in ("MPTC1", "MPTC2")]
    three = ("GTV", "MPTC1", "MPTC")
    stepped, after = (
        f("load step", "GTV", study.FULL_SPEED, quantity)
        for quantity in ("second_active_step_pct", "second_active_pct")
    )
    second = f.over_speed("GTV", "second_active_pct")
    slow, fast = slice(0, 3), slice(6, None)  # of the speeds
    alike = np.abs(thd["GTV"] / thd["MPTC2"] - 1.0) <= CLOSE
    claims = [
        Claim(
            "Fig. 6", "150 r/min, no load: MPFC has the lowest THD, below MPTC with k_psi = 100; "
            "MPTC with k_psi = 32 is much worse",
            f"{_list((f.unloaded(n) for n in ('MPFC', 'MPTC', 'MPTC, k_psi 32')), '.2f')} %",
            _yes(
                f.unloaded("MPFC") < f.unloaded("MPTC")
                and f.unloaded("MPTC, k_psi 32") > 2.0 * f.unloaded("MPTC")
            ),
        ),
        Claim(
            "Fig. 8", "150 r/min: torque ripple of MPTC I and II much lower than MPTC's (no load)",
            f"{_list(calm[1:], '.2f')} against {calm[0]:.2f} N m",
            _yes(max(calm[1:]) < 0.5 * calm[0]),
        ),
        Claim(
            "Fig. 8", "150 r/min: oscillation of the flux and distortion of the current that MPTC "
            "I has are gone in II (no load; less than half)",
            f"flux ripple {still[1]:.1f} against {still[0]:.1f} mWb, THD {at_rest[0]:.2f} against "
            f"{at_rest[2]:.2f} %",
            _yes(still[1] < 0.5 * still[0] and at_rest[0] < 0.5 * at_rest[2]),
        ),
        Claim(
            "Fig. 9", "150 r/min, no load: THD of MPTC II below MPTC's, MPTC I's above it",
            f"{_list(at_rest, '.2f')} %", _yes(at_rest[0] < at_rest[1] < at_rest[2]),
        ),
    ]  # fmt: skip
    for rule, two in (("deadbeat", "MPTC2"), ("mean", "MPTC2, mean")):
        claims += [
            Claim(
                "Fig. 10", "MPTC has the highest torque ripple at all speeds (II with rule "
                f"{rule})",
                f"II {_span(ripple[two], '.2f')}, I {_span(ripple['MPTC1'], '.2f')}, MPTC "
                f"{_span(ripple['MPTC'], '.2f')} N m",
                _where((ripple["MPTC"] > ripple[two]) & (ripple["MPTC"] > ripple["MPTC1"])),
            ),
            Claim(
                "Fig. 10", f"THD of MPTC II (rule {rule}) below MPTC's and I's 'over a wide speed "
                "range, especially at low speed'",
                f"II {_span(thd[two], '.1f')}, I {_span(thd['MPTC1'], '.1f')}, MPTC "
                f"{_span(thd['MPTC'], '.1f')} %",
                _where((thd[two] < thd["MPTC"]) & (thd[two] < thd["MPTC1"])),
            ),
        ]  # fmt: skip
    return [
        *claims,
        Claim(
            "Fig. 11", "GTV: the second vector is not always zero, especially at medium and high "
            "speed", f"second vector active in {_list(second, '.1f')} % of the periods",
            _where(second > 0.0),
        ),
        Claim(
            "Fig. 12", "1500 r/min, load step: GTV's second vector may be active, in the step and "
            "after it", f"in {stepped:.0f} % of the periods of the first 0.1 s, {after:.0f} % at "
            "the end", _yes(min(stepped, after) > 0.0),
        ),
        *(
            Claim(
                "Fig. 13", f"150 r/min: GTV has the least {what} of GTV, MPTC I and MPTC",
                f"{_list(values, form)} {unit}", _yes(values[0] < min(values[1:])),
            )
            for what, quantity, form, unit in (
                ("torque ripple", "torque_ripple_nm", ".2f", "N m"),
                ("flux ripple", "flux_ripple_mwb", ".1f", "mWb"),
                ("THD", "thd_pct", ".2f", "%"),
            )
            for values in [[f("rated load", n, study.LOW_SPEED, quantity) for n in three]]
        ),
        Claim(
            "Fig. 14", "GTV has a lower torque ripple than MPTC at all speeds",
            f"{_span(ripple['GTV'], '.2f')} against {_span(ripple['MPTC'], '.2f')} N m",
            _where(ripple["GTV"] < ripple["MPTC"]),
        ),
        Claim(
            "Fig. 14", "GTV has the lowest torque ripple of MPTC, I and GTV at all speeds",
            f"GTV {_span(ripple['GTV'], '.2f')}, I {_span(ripple['MPTC1'], '.2f')} N m",
            _where((ripple["GTV"] < ripple["MPTC"]) & (ripple["GTV"] < ripple["MPTC1"])),
        ),
        Claim(
            "Fig. 14", "GTV has the lowest THD of the three at all speeds",
            f"GTV {_span(thd['GTV'], '.1f')}, I {_span(thd['MPTC1'], '.1f')}, MPTC "
            f"{_span(thd['MPTC'], '.1f')} %",
            _where((thd["GTV"] < thd["MPTC"]) & (thd["GTV"] < thd["MPTC1"])),
        ),
        Claim(
            "Fig. 14", "MPTC has the highest THD of the three at all speeds", "the same",
            _where((thd["MPTC"] > thd["GTV"]) & (thd["MPTC"] > thd["MPTC1"])),
        ),
        Claim(
            "Fig. 15", "the switching frequency of MPTC varies strongly, GTV's little",
            f"MPTC {_span(hertz['MPTC'])}, GTV {_span(hertz['GTV'])} Hz",
            _yes(_ratio(hertz["MPTC"]) > STEADY_SPAN >= _ratio(hertz["GTV"])),
        ),
        Claim(
            "Fig. 15", f"that of MPTC I is 'relatively constant' (the highest at most "
            f"{STEADY_SPAN:g} times it)", f"{_list(hertz['MPTC1'], '.0f')} Hz",
            _where(hertz["MPTC1"].max() <= STEADY_SPAN * hertz["MPTC1"]),
        ),
        Claim(
            "Fig. 15", "MPTC I: 'but still variable with speed, especially at high speed range' "
            "(from 1050 r/min; highest by lowest larger there than below)",
            f"{_ratio(hertz['MPTC1'][fast]):.2f} against {_ratio(hertz['MPTC1'][:6]):.2f}",
            _yes(_ratio(hertz["MPTC1"][fast]) > _ratio(hertz["MPTC1"][:6]) > 1.0),
        ),
        Claim(
            "Fig. 15", "GTV switches less than MPTC at medium speeds (600 to 900 r/min)",
            f"GTV {_list(hertz['GTV'][3:6], '.0f')}, MPTC {_list(hertz['MPTC'][3:6], '.0f')} Hz",
            _yes(bool((hertz["GTV"] < hertz["MPTC"])[3:6].all())),
        ),
        Claim(
            "Fig. 16", f"GTV and MPTC II alike at low speed (up to 450 r/min; THD within "
            f"{100 * CLOSE:g} %)",
            f"GTV {_list(thd['GTV'][slow], '.2f')}, II {_list(thd['MPTC2'][slow], '.2f')} %",
            _yes(bool(alike[slow].all())),
        ),
        Claim(
            "Fig. 16", "GTV has a lower THD than MPTC II at high speed (from 1050 r/min)",
            f"GTV {_list(thd['GTV'][fast], '.2f')}, II {_list(thd['MPTC2'][fast], '.2f')} %",
            _where((thd["GTV"] < thd["MPTC2"])[fast], 6),
        ),
        Claim(
            "Fig. 16", "GTV has a lower torque ripple than MPTC II there",
            f"GTV {_list(ripple['GTV'][fast], '.2f')}, II "
            f"{_list(ripple['MPTC2'][fast], '.2f')} N m",
            _where((ripple["GTV"] < ripple["MPTC2"])[fast], 6),
        ),
    ]  # fmt: skip


def _rises(f: Figures, name: str) -> list[float]:
    """Longest rise of the torque step at all speeds, ms."""
    return [f("torque step", name, rpm, "rise_longest_ms") for rpm in study.STEP_SPEEDS]


def _flux_claims(f: Figures) -> list[Claim]:
    """Claims of sections 5.3 and 7."""
    claims = []
    for source, name, rpm, what in (
        ("Fig. 18", "load step", study.DISTURBED, "100 % load step"),
        ("Fig. 19", "reversal", 1500.0, "after the reversal"),
        ("Fig. 20", "crawl", study.CRAWL, "15 r/min with rated load"),
    ):
        two, three = (f(name, method, rpm, "torque_ripple_nm") for method in ("MPFC2", "MPFC3"))
        claims.append(
            Claim(source, f"{what}: torque ripple of three vectors lower than of two",
                  f"{three:.2f} against {two:.2f} N m", _yes(three < two))
        )  # fmt: skip
    for source, name, rpm, what in (
        ("Fig. 19", "reversal", 1500.0, "after the reversal"),
        ("Fig. 20", "crawl", study.CRAWL, "15 r/min with rated load"),
    ):
        two, three = (f(name, method, rpm, "flux_ripple_mwb") for method in ("MPFC2", "MPFC3"))
        claims.append(
            Claim(source, f"{what}: flux ripple of three vectors lower than of two",
                  f"{three:.1f} against {two:.1f} mWb", _yes(three < two))
        )  # fmt: skip
    for source, name, rpm, quantity, unit in (
        ("Fig. 18", "load step", study.DISTURBED, "speed_loss_rpm", "r/min lost"),
        ("Fig. 19", "reversal", 1500.0, "to_1400_rpm_ms", "ms to 1400 r/min"),
    ):
        two, three = (f(name, method, rpm, quantity) for method in ("MPFC2", "MPFC3"))
        claims.append(
            Claim(source, "the dynamic response of two and three vectors is alike",
                  f"{two:.0f} and {three:.0f} {unit}", _yes(abs(three / two - 1.0) <= CLOSE))
        )  # fmt: skip
    hertz = {name: f.over_speed(name, "switching_hz") for name in study.LOADED}
    thd = {name: f.over_speed(name, "thd_pct") for name in ("MPTC", "MPC2", "FOC")}
    ripple = {name: f.over_speed(name, "torque_ripple_nm") for name in ("MPTC", "MPC2", "FOC")}
    rises = [_rises(f, name) for name in ("MPTC", "MPC2")]
    calm = [
        [f(name, method, 1500.0, "torque_ripple_nm") for name in ("start", "reversal")]
        for method in study.COMPARED
    ]
    steady = [
        [f(name, method, 1500.0, "flux_ripple_mwb") for name in ("start", "reversal")]
        for method in study.COMPARED
    ]
    slow = np.array(study.SPEEDS) < SLOW_BELOW
    alike = np.abs(ripple["MPC2"] / ripple["FOC"] - 1.0) <= SIMILAR
    return [
        *claims,
        Claim(
            "sec. 5.3", "three vectors 'significantly reduce the average switching frequency' "
            "(against what is not said; here against two)",
            f"{_span(hertz['MPFC3'])} against {_span(hertz['MPFC2'])} Hz",
            _where(hertz["MPFC3"] < hertz["MPFC2"]),
        ),
        Claim(
            "Figs. 28, 29", "after start and reversal MPC2 has a lower torque ripple than FOC",
            f"{_list(calm[0], '.2f')} against {_list(calm[1], '.2f')} N m",
            _yes(all(a < b for a, b in zip(*calm, strict=True))),
        ),
        Claim(
            "Figs. 28, 29", "after start and reversal MPC2 has a lower flux ripple than FOC",
            f"{_list(steady[0], '.1f')} against {_list(steady[1], '.1f')} mWb",
            _yes(all(a < b for a, b in zip(*steady, strict=True))),
        ),
        *(
            Claim(
                "Fig. 30", "torque step 0 to 120 %: FOC takes more than 10 ms (current loop of "
                f"{hertz_of} Hz)",
                f"{_list(_rises(f, name), '.1f')} ms", _yes(min(_rises(f, name)) > 10.0),
            )
            for name, hertz_of in (("FOC", "250"), (study.SLOW_FOC, "25"))
        ),
        Claim(
            "Fig. 30", "torque step 0 to 120 %: MPC2 and MPTC rise in less than 1 ms",
            f"MPC2 {_list(rises[1], '.2f')}, MPTC {_list(rises[0], '.2f')} ms",
            _yes(max(map(max, rises)) < 1.0),
        ),
        Claim(
            "Fig. 31", "MPC2 has a lower THD than MPTC at all speeds",
            f"{_span(thd['MPC2'], '.1f')} against {_span(thd['MPTC'], '.1f')} %",
            _where(thd["MPC2"] < thd["MPTC"]),
        ),
        Claim(
            "Fig. 31", "MPC2 has a lower torque ripple than MPTC at all speeds",
            f"{_span(ripple['MPC2'], '.2f')} against {_span(ripple['MPTC'], '.2f')} N m",
            _where(ripple["MPC2"] < ripple["MPTC"]),
        ),
        Claim(
            "Fig. 31", "MPTC has the highest THD of MPTC, FOC and MPC2 at all speeds",
            f"MPTC {_span(thd['MPTC'], '.1f')}, FOC {_span(thd['FOC'], '.1f')}, MPC2 "
            f"{_span(thd['MPC2'], '.1f')} %",
            _where((thd["MPTC"] > thd["FOC"]) & (thd["MPTC"] > thd["MPC2"])),
        ),
        Claim(
            "Fig. 31", "MPTC has the highest torque ripple of the three at all speeds",
            f"MPTC {_span(ripple['MPTC'], '.2f')}, FOC {_span(ripple['FOC'], '.2f')}, MPC2 "
            f"{_span(ripple['MPC2'], '.2f')} N m",
            _where((ripple["MPTC"] > ripple["FOC"]) & (ripple["MPTC"] > ripple["MPC2"])),
        ),
        Claim(
            "Fig. 31", "MPC2 has a lower THD than FOC at all speeds",
            f"{_list(thd['MPC2'], '.1f')} against {_list(thd['FOC'], '.1f')} %",
            _where(thd["MPC2"] < thd["FOC"]),
        ),
        Claim(
            "Fig. 31", "MPC2 has a lower torque ripple than FOC at high speed (from "
            f"{SLOW_BELOW:g} r/min)",
            f"{_list(ripple['MPC2'][~slow], '.2f')} against {_list(ripple['FOC'][~slow], '.2f')} "
            "N m", _where((ripple["MPC2"] < ripple["FOC"])[~slow], int(slow.sum())),
        ),
        Claim(
            "Fig. 31", f"below {SLOW_BELOW:g} r/min the torque ripples of MPC2 and FOC are similar "
            f"(within {100 * SIMILAR:g} %)",
            f"{_list(ripple['MPC2'][slow], '.2f')} against {_list(ripple['FOC'][slow], '.2f')} "
            "N m", _where(alike[slow]),
        ),
        Claim(
            "Fig. 32", "MPC2 switches slightly less than FOC",
            f"{_list(hertz['MPC2'], '.0f')} against {_span(hertz['FOC'])} Hz",
            _where(hertz["MPC2"] < hertz["FOC"]),
        ),
    ]  # fmt: skip


def _sensorless_claims(f: Figures) -> list[Claim]:
    """Claims of section 6.2: without and with noise of the current."""
    full = study.FULL_SPEED

    def _pair(what: str, rpm: float, quantity: str) -> list[float]:
        return [f(what, name, rpm, quantity) for name in study.SENSORLESS]

    def _without_and_with(holds: list[bool]) -> str:
        return "in part: without noise" if holds == [True, False] else _yes(all(holds))

    claims = []
    for source, what, text in (("Fig. 23", "start", "start"), ("Fig. 24", "reversal", "reversal")):
        torque = _pair(what, full, "torque_mean_nm")
        error = _pair(what, full, "estimate_error_rpm")
        claims += [
            Claim(
                source, f"{text} without a speed sensor: the motor accelerates with 120 % torque "
                f"(mean to 1400 r/min within {100 * CLOSE:g} %)",
                f"{_list(torque, '.1f')} N m of {study.STEP_TORQUE:g}",
                _without_and_with([abs(x / study.STEP_TORQUE - 1.0) <= CLOSE for x in torque]),
            ),
            Claim(
                source, f"{text}: the estimated speed follows well (always within "
                f"{100 * FOLLOWS:g} % of {full:g} r/min)",
                f"{_list(error, '.1f')} r/min; the second with 12 bits and noise",
                _without_and_with([x <= FOLLOWS * full for x in error]),
            ),
        ]  # fmt: skip
    for source, rpm in (("Fig. 25", full), ("Fig. 26", study.CRAWL)):
        error = _pair("rated load", rpm, "estimate_error_rpm")
        distortion = _pair("rated load", rpm, "thd_pct")
        claims += [
            Claim(
                source, f"{rpm:g} r/min: the estimated speed is almost the actual one (always "
                f"within {100 * CLOSE:g} % of it)",
                f"{_list(error, '.2f')} r/min; the second with 12 bits and noise",
                _without_and_with([x <= CLOSE * rpm for x in error]),
            ),
            Claim(
                source, f"{rpm:g} r/min: the current is sinusoidal (THD below {SINUSOIDAL:g} %)",
                f"{_list(distortion, '.2f')} %",
                _without_and_with([x < SINUSOIDAL for x in distortion]),
            ),
        ]  # fmt: skip
    return claims


def claims(f: Figures) -> list[Claim]:
    """Every claim of the paper that the figures decide."""
    return [*_torque_claims(f), *_flux_claims(f), *_sensorless_claims(f)]


def _numbers(f: Figures) -> str:
    """What the paper states as a number, beside ours."""
    rise = [_rises(f, name) for name in ("MPTC", "MPC2", "FOC", study.SLOW_FOC)]
    rules = {
        "MPTC1": ("MPTC1", "MPTC1, mean"),
        "MPTC2": ("MPTC2", "MPTC2, mean", "MPTC2, best"),
    }
    one, two = (" / ".join(f"{f.unloaded(n):.2f}" for n in rules[m]) for m in rules)
    speeds = " / ".join(f"{rpm:g}" for rpm in study.STEP_SPEEDS)
    return tables.markdown(
        ["", "Paper B", "here"],
        [
            ["THD, 150 r/min, no load: MPTC, 20 kHz (Fig. 9)", "8.90 %",
             f"{f.unloaded('MPTC'):.2f} %"],
            ["the same: MPTC I, 20 kHz, rule deadbeat / mean", "11.16 %", f"{one} %"],
            ["the same: MPTC II, 10 kHz, rule deadbeat / mean / best", "3.64 %", f"{two} %"],
            [f"rise of MPTC, torque 0 to 120 %, at {speeds} r/min (Fig. 30)", "< 1 ms",
             " / ".join(f"{x:.2f}" for x in rise[0]) + " ms"],
            ["the same: MPC2, 15 kHz", "< 1 ms", " / ".join(f"{x:.2f}" for x in rise[1]) + " ms"],
            ["the same: FOC, 5 kHz, current loop of 250 Hz", "> 10 ms",
             " / ".join(f"{x:.1f}" for x in rise[2]) + " ms"],
            ["the same: FOC, 5 kHz, current loop of 25 Hz", "> 10 ms",
             " / ".join(f"{x:.1f}" for x in rise[3]) + " ms"],
        ],
        "lr",
    )  # fmt: skip


def _bands(f: Figures) -> str:
    """Distortion by band and by where it is sampled."""
    columns = {
        "to 100 kHz": "thd_pct",
        **{f"to {b / 1e3:g} kHz": f"thd_to_{b / 1e3:g}khz_pct" for b in reversed(study.BANDS)},
        "at control instants": "thd_at_instants_pct",
    }
    return tables.markdown(
        ["THD, %, 150 r/min, no load", *columns, "f_sw, Hz"],
        [
            [name, *(f"{f.unloaded(name, q):.2f}" for q in columns.values()),
             f"{f.unloaded(name, 'switching_hz'):.0f}"]
            for name in study.UNLOADED
        ],
        "lr",
    )  # fmt: skip


def _over_speed(f: Figures, title: str, quantity: str, form: str) -> str:
    return tables.markdown(
        [title, *(f"{rpm:g}" for rpm in study.SPEEDS)],
        [[name, *(format(x, form) for x in f.over_speed(name, quantity))] for name in study.LOADED],
        "lr",
    )


def _transients(f: Figures) -> str:
    """Load step, reversal and low speed."""
    rows = []
    columns = (*study.FLUX_METHODS, "FOC")
    full = study.FLUX_METHODS
    for text, name, rpm, quantity, form, measured in (
        ("load step at 900 r/min: torque ripple, N m", "load step", study.DISTURBED,
         "torque_ripple_nm", ".2f", full),
        ("load step at 900 r/min: flux ripple, mWb", "load step", study.DISTURBED,
         "flux_ripple_mwb", ".1f", full),
        ("load step: largest loss of speed, r/min", "load step", study.DISTURBED,
         "speed_loss_rpm", ".0f", full),
        ("start: to 1400 r/min, ms", "start", 1500.0, "to_1400_rpm_ms", ".0f", study.COMPARED),
        ("start: torque ripple at 1500 r/min, N m", "start", 1500.0, "torque_ripple_nm", ".2f",
         study.COMPARED),
        ("start: flux ripple at 1500 r/min, mWb", "start", 1500.0, "flux_ripple_mwb", ".1f",
         study.COMPARED),
        ("reversal: to 1400 r/min, ms", "reversal", 1500.0, "to_1400_rpm_ms", ".0f", columns),
        ("reversal: torque ripple at 1500 r/min, N m", "reversal", 1500.0, "torque_ripple_nm",
         ".2f", columns),
        ("reversal: flux ripple at 1500 r/min, mWb", "reversal", 1500.0, "flux_ripple_mwb", ".1f",
         columns),
        ("15 r/min, 14 N m: torque ripple, N m", "crawl", study.CRAWL, "torque_ripple_nm", ".2f",
         full[:2]),
        ("15 r/min, 14 N m: flux ripple, mWb", "crawl", study.CRAWL, "flux_ripple_mwb", ".1f",
         full[:2]),
        ("15 r/min, 14 N m: largest error of the speed, r/min", "crawl", study.CRAWL,
         "speed_error_rpm", ".2f", full[:2]),
    ):  # fmt: skip
        cells = [
            format(f(name, method, rpm, quantity), form) if method in measured else "-"
            for method in columns
        ]
        rows.append([text, *cells])
    return tables.markdown(["", *columns], rows, "lr")


def _parameters(f: Figures) -> str:
    """Fig. 1: resistances that are off, with an imposed speed and behind the speed PI."""
    rows = []
    for rpm in study.PARAMETER_SPEEDS:
        for text, quantity, form in (
            ("flux, Wb (asked 0.9)", "flux_mean_wb", ".3f"),
            ("largest error of its estimate, mWb", "estimate_error_mwb", ".0f"),
            ("mean torque, N m", "torque_mean_nm", ".2f"),
            ("torque ripple, N m", "torque_ripple_nm", ".2f"),
            ("THD of the current, %", "thd_pct", ".1f"),
        ):
            cells = []
            for name in (study.IMPOSED, study.BEHIND_PI):
                for factor in study.FACTORS:
                    value = f(name, f"R x {factor:g}", rpm, quantity)
                    shown = format(value, form)
                    cells.append(shown.lstrip("-") if float(shown) == 0.0 else shown)
            rows.append([f"{rpm:g} r/min: {text}", *cells])
    head = [f"{how}, R x {x:g}" for how in ("imposed", "speed PI") for x in study.FACTORS]
    return tables.markdown(["R_s and R_r, times the controller's", *head], rows, "lr")


def texts(f: Figures) -> dict[str, str]:
    """Every table of the page."""
    return {
        "numbers": _numbers(f),
        "bands": _bands(f),
        "claims": tables.markdown(["source", "Paper B", "here", "holds"], claims(f)),
        "distortion": _over_speed(f, "THD, %, at r/min", "thd_pct", ".2f"),
        "ripple": _over_speed(f, "torque ripple, N m, at r/min", "torque_ripple_nm", ".2f"),
        "switching": _over_speed(f, "switching frequency, Hz, at r/min", "switching_hz", ".0f"),
        "transients": _transients(f),
        "parameters": _parameters(f),
    }


def _markers(name: str) -> tuple[str, str]:
    return f"<!-- {name}: begin (written by {COMMAND}) -->", f"<!-- {name}: end -->"


def write_texts(f: Figures, page: Path = PAGE, *, reported: bool = False) -> None:
    """Rewrite the tables of the page, or of the report."""
    tables.rewrite(
        page,
        {_markers(n): text for n, text in texts(f).items() if (n in REPORTED) == reported},
    )


# --- pictures -------------------------------------------------------------------------------------


def _axes(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Any, Any]:
    return pyplot().subplots(
        rows, columns, figsize=size, layout="constrained", squeeze=False, **options
    )


def _save(figure: Any, path: Path) -> None:
    save_png(figure, path)
    pyplot().close(figure)


def _with_rate(name: str) -> str:
    """A controller with its control frequency."""
    return f"{name}, {1e-3 / study.PERIODS[name.partition(',')[0]]:g} kHz"


def _draw_spectra(curves: study.Curves, f: Figures, path: Path) -> None:
    """Fig. 9: spectra of the current without load at low speed."""
    shown = ("MPTC", "MPTC1", "MPTC2")
    figure, axes = _axes(len(shown), 1, (8.0, 5.0), sharex=True, sharey=True)
    for (ax,), name, colour in zip(axes, shown, COLOURS, strict=True):
        frequency, amplitude = curves.spectra[name]
        seen = (frequency >= 2.0) & (frequency <= 6000.0)
        ax.semilogx(frequency[seen], amplitude[seen], color=colour, linewidth=0.5)
        ax.set_title(f"{_with_rate(name)}, THD {f.unloaded(name):.2f} %", fontsize=9)
        ax.set_ylabel("% of fundamental")
    axes[-1][0].set_xlabel("frequency (Hz)")
    figure.suptitle(
        "2.2 kW drive, current of phase a, 150 r/min, no load, 0.986 Wb, bit-true model "
        "(Paper B, Fig. 9)",
        fontsize=10,
    )
    _save(figure, path)


def _draw_bars(f: Figures, path: Path) -> None:
    """Fig. 9: distortion without load at low speed as bars, beside the paper's numbers."""
    paper = {"MPTC": 8.90, "MPTC1": 11.16, "MPTC2": 3.64}
    names = ("MPTC", "MPTC1", "MPTC1, mean", "MPTC2", "MPTC2, mean", "MPTC2, best")
    figure, axes = _axes(1, 1, (8.0, 3.2))
    ax = axes[0][0]
    for place, name in enumerate(names):
        for value, shift, colour in (
            (f.unloaded(name), -0.2, COLOURS[0]),
            (paper[name.partition(",")[0]], 0.2, "0.7"),
        ):
            ax.bar(place + shift, value, width=0.4, color=colour)
            ax.annotate(
                f"{value:.2f}", (place + shift, value), ha="center", va="bottom", fontsize=8
            )
    ax.bar([0], [0.0], color=COLOURS[0], label="here, bit-true model")
    ax.bar([0], [0.0], color="0.7", label="Paper B; it does not name its rule of the duty")
    ax.set_xticks(range(len(names)), names)
    ax.set_ylim(0.0, 13.5)
    ax.set_ylabel("THD of the current (%)")
    ax.legend(frameon=False, fontsize=8)
    figure.suptitle("2.2 kW drive, 150 r/min, no load, 0.986 Wb (Paper B, Fig. 9)", fontsize=10)
    _save(figure, path)


def _draw_speeds(f: Figures, path: Path) -> None:
    """Figs. 10, 14, 15, 16, 31 and 32: figures over speed at rated load."""
    groups = (("MPTC", "MPTC1", "MPTC2", "GTV"), ("MPTC", "MPFC2", "MPFC3", "MPC2", "FOC"))
    figure, axes = _axes(3, 2, (9.0, 7.5), sharex=True, sharey="row")
    for row, (quantity, label) in enumerate(
        (
            ("torque_ripple_nm", "torque ripple (N m)"),
            ("thd_pct", "THD of the current (%)"),
            ("switching_hz", "switching frequency (Hz)"),
        )
    ):
        for column, names in enumerate(groups):
            for name, mark in zip(names, _MARKS, strict=False):
                values = f.over_speed(name, quantity)
                axes[row][column].plot(
                    study.SPEEDS, values, color=_COLOUR_OF[name], linewidth=1.0,
                    label=_with_rate(name), **mark,
                )  # fmt: skip
        axes[row][0].set_ylim(bottom=0.0)  # both columns have the same
        axes[row][0].set_ylabel(label)
    for column, title in enumerate(("Figs. 10, 14, 15, 16", "sec. 5.3, Figs. 31, 32")):
        axes[0][column].set_title(f"Paper B, {title}", fontsize=9)
        axes[1 + column][column].legend(frameon=False, fontsize=8, ncols=1 + column)
        axes[2][column].set_xlabel("speed (r/min)")
    figure.suptitle(
        "2.2 kW drive, 14 N m, 0.9 Wb, speed imposed, bit-true model; FOC in float64", fontsize=10
    )
    _save(figure, path)


def _rpm(run: Run) -> np.ndarray:
    return run.trace.omega_r / 2.0 / RPM


def _draw_dynamics(curves: study.Curves, path: Path) -> None:
    """Figs. 18, 19 and 20: methods I and II alone, as MPC2 would cover what they do."""
    shown = study.FLUX_METHODS[:2]
    _draw_runs(
        (
            (
                "100 % load step at 900 r/min (Fig. 18)",
                "load step",
                {n: curves.disturbed[n] for n in shown},
            ),
            ("reversal, no load (Fig. 19)", "reversal", {n: curves.reversed[n] for n in shown}),
            ("15 r/min, 14 N m (Fig. 20)", "crawl", curves.crawling),
        ),
        curves,
        path,
    )


def _draw_compared(curves: study.Curves, path: Path) -> None:
    """Figs. 28 and 29: start and reversal of MPC2 and FOC."""
    _draw_runs(
        (
            ("start, no load (Fig. 28)", "start", curves.started),
            (
                "reversal, no load (Fig. 29)",
                "reversal",
                {n: curves.reversed[n] for n in study.COMPARED},
            ),
        ),
        curves,
        path,
    )


def _draw_runs(
    columns: Sequence[tuple[str, str, dict[str, Run]]], curves: study.Curves, path: Path
) -> None:
    """Speed, torque, stator flux and current of several runs, a column for each group.

    The flux has a row for each run: the ripples of two runs would cover one another.
    """
    fluxes = max(len(runs) for _, _, runs in columns)
    figure, axes = _axes(3 + fluxes, len(columns), (3.7 * len(columns), 10.0), sharex="col")
    for column, (title, group, runs) in enumerate(columns):
        for place, (name, colour) in enumerate(zip(runs, COLOURS, strict=False)):
            run = runs[name]
            t = run.ts * np.arange(len(run.torque))
            inside = run.sample_time * np.arange(0, len(run.torque_inside), 10)
            axes[0][column].plot(t, _rpm(run), color=colour, linewidth=0.9, label=_with_rate(name))
            for row, values in (
                (1, run.torque_inside),
                (2 + place, curves.flux[group, name]),
                (-1, run.current_inside.real),
            ):
                axes[row][column].plot(inside, values[::10], color=colour, linewidth=0.4)
            axes[2 + place][column].set_title(_with_rate(name), fontsize=8)
            axes[2 + place][column].sharey(axes[2][column])
        axes[0][column].set_title(title, fontsize=9)
        axes[-1][column].set_xlabel("time (s)")
    labels = ("speed (r/min)", "torque (N m)", *("stator flux (Wb)",) * fluxes, "phase a (A)")
    for row, label in enumerate(labels):
        axes[row][0].set_ylabel(label)
    axes[0][0].legend(frameon=False)
    figure.suptitle(
        "2.2 kW drive, bit-true model (FOC: float64), sampled inside the control period",
        fontsize=10,
    )
    _save(figure, path)


def _draw_parameters(curves: study.Curves, f: Figures, path: Path) -> None:
    """Fig. 1: current and flux with resistances that are off, at low and high speed."""
    figure, axes = _axes(2 * len(study.FACTORS), len(study.PARAMETER_SPEEDS), (8.0, 9.5))
    for column, rpm in enumerate(study.PARAMETER_SPEEDS):
        shown = 2.0 / (rpm / 60.0 * 2.0)  # two periods of the current
        for place, (factor, colour) in enumerate(zip(study.FACTORS, COLOURS, strict=True)):
            run = curves.parameters[rpm, factor].run
            steps = round(shown / run.ts)
            t = 1e3 * run.ts * np.arange(steps)
            name = f"R x {factor:g}"
            error = f(study.BEHIND_PI, name, rpm, "estimate_error_mwb")
            current, flux = axes[2 * place][column], axes[2 * place + 1][column]
            current.plot(t, run.trace.i_s[-steps:, 0], color=colour, linewidth=0.7)
            flux.plot(t, run.flux[-steps:], color=colour, linewidth=0.7)
            flux.set_ylim(0.6, 1.0)
            current.set_title(
                f"{rpm:g} r/min, R x {factor:g}: flux estimate off by {error:.0f} mWb",
                fontsize=9,
            )
            if column == 0:
                current.set_ylabel("phase a (A)")
                flux.set_ylabel("flux (Wb)")
        axes[-1][column].set_xlabel("time (ms)")
    figure.suptitle(
        "2.2 kW drive, MPTC on the observer's flux, R_s and R_r off, no load, 0.9 Wb asked,\n"
        "speed PI, bit-true model (Paper B, Fig. 1)",
        fontsize=10,
    )
    _save(figure, path)


def _draw_steady(
    curves: study.Curves, which: str, names: Sequence[str], title: str, path: Path
) -> None:
    """Figs. 8 and 13: torque, flux and current at low speed, a column for each method."""
    figure, axes = _axes(3, len(names), (9.0, 6.0), sharex=True, sharey="row")
    for column, (name, colour) in enumerate(zip(names, COLOURS, strict=True)):
        run = curves.steady[which, name]
        samples = round(0.4 / run.sample_time)
        t = run.sample_time * np.arange(samples)
        for row, values in enumerate(
            (run.torque_inside, curves.flux[which, name], run.current_inside.real)
        ):
            axes[row][column].plot(t, values[-samples:], color=colour, linewidth=0.4)
        axes[0][column].set_title(_with_rate(name), fontsize=9)
        axes[-1][column].set_xlabel("time (s)")
    for row, label in enumerate(("torque (N m)", "stator flux (Wb)", "phase a (A)")):
        axes[row][0].set_ylabel(label)
    figure.suptitle(title, fontsize=10)
    _save(figure, path)


def _shown_vectors(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the first and second vector of each period: both zero vectors are 0, -1: none."""
    vectors, times = run.decided.vectors, run.decided.times
    first, second = (np.where(vectors[:, place] == 7, 0, vectors[:, place]) for place in (0, 1))
    return first, np.where(times[:, 0] < WHOLE_FROM, second, -1)


def _draw_startup(curves: study.Curves, path: Path) -> None:
    """Fig. 11: the vectors that GTV selects in a start."""
    run = curves.two_vectors["start"]
    t = run.ts * np.arange(len(run.torque))
    figure, axes = _axes(3, 1, (8.0, 5.5), sharex=True)
    axes[0][0].plot(t, _rpm(run), color=COLOURS[0], linewidth=1.0)
    axes[0][0].set_ylabel("speed (r/min)")
    for (ax,), values, colour, label in zip(
        axes[1:], _shown_vectors(run), COLOURS[1:], ("first vector", "second vector"), strict=True
    ):
        seen = values >= 0
        ax.plot(t[seen], values[seen], "|", color=colour, markersize=5, markeredgewidth=0.25)
        ax.set_ylabel(label)
        ax.set_yticks(range(7))
        ax.set_ylim(-0.6, 6.6)
    axes[0][0].set_xlim(0.08, 0.35)
    axes[-1][0].set_xlabel("time (s); both zero vectors are 0")
    figure.suptitle(
        "2.2 kW drive, GTV at 10 kHz, start to 1500 r/min without load, 0.9 Wb, bit-true model "
        "(Paper B, Fig. 11)",
        fontsize=10,
    )
    _save(figure, path)


def _draw_load_step(curves: study.Curves, path: Path) -> None:
    """Fig. 12: vectors of GTV and the pulses of a switch, in a load step and after it."""
    run = curves.two_vectors["load step"]
    figure, axes = _axes(4, 2, (9.0, 7.0), sharex="col", sharey="row")
    inside = run.sample_time * np.arange(len(run.torque_inside))
    t = run.ts * np.arange(len(run.torque))
    first, second = _shown_vectors(run)
    applied = run.trace.sequences()
    edges = np.column_stack([t, t + run.ts * applied.times[:, 0]]).ravel()
    legs = STATES[applied.vectors[:, :2], 0].ravel()
    for column, (title, begin) in enumerate((("load step", 0.099), ("steady state", 0.55))):
        end = begin + 0.006
        for values, x, row in ((run.torque_inside, inside, 0),):
            seen = (x >= begin) & (x <= end)
            axes[row][column].plot(1e3 * x[seen], values[seen], color=COLOURS[0], linewidth=0.7)
        for values, row, colour in ((first, 1, COLOURS[1]), (second, 2, COLOURS[2])):
            seen = (t >= begin) & (t <= end) & (values >= 0)
            axes[row][column].plot(1e3 * t[seen], values[seen], ".", color=colour, markersize=4)
            axes[row][column].set_yticks(range(7))
            axes[row][column].set_ylim(-0.6, 6.6)
        seen = (edges >= begin) & (edges <= end)
        axes[3][column].step(
            1e3 * edges[seen], legs[seen], where="post", color="0.3", linewidth=0.7
        )
        axes[3][column].set_ylim(-0.2, 1.2)
        axes[3][column].set_yticks((0, 1))
        axes[0][column].set_title(title, fontsize=9)
        axes[3][column].set_xlabel("time (ms)")
    axes[0][0].axvline(100.0, color="0.7", linewidth=0.6)
    for row, label in enumerate(
        ("torque (N m)", "first vector", "second vector", "upper switch,\nphase a")
    ):
        axes[row][0].set_ylabel(label)
    figure.suptitle(
        "2.2 kW drive, GTV at 10 kHz, 100 % load step at 100 ms, 1500 r/min, 0.9 Wb, bit-true "
        "model (Paper B, Fig. 12)",
        fontsize=10,
    )
    _save(figure, path)


STEP_LABELS = {
    **{name: _with_rate(name) for name in study.STEP_METHODS},
    "FOC": f"{_with_rate('FOC')}, current loop 250 Hz",
    study.SLOW_FOC: f"{_with_rate('FOC')}, current loop 25 Hz",
}
"""Controllers of the torque step as the picture names them."""


def _draw_steps(curves: study.Curves, path: Path) -> None:
    """Fig. 30: the torque step."""
    figure, axes = _axes(1, 2, (9.0, 3.2), sharey=True)
    for ax, until in zip(axes[0], (4.0, 25.0), strict=True):
        for (name, (t, made)), colour in zip(curves.steps.items(), _FIVE, strict=True):
            seen = t <= until
            ax.plot(t[seen], made[seen], color=colour, linewidth=0.9, label=STEP_LABELS[name])
        ax.axhline(study.STEP_TORQUE, color="0.7", linewidth=0.6, label="reference")
        ax.set_xlabel("time from the step of the reference (ms)")
    axes[0][0].set_ylabel("torque (N m)")
    axes[0][1].legend(frameon=False)
    figure.suptitle(
        "2.2 kW drive, torque 0 to 120 % at 150 r/min, 0.986 Wb, bit-true model; FOC in float64 "
        "(Paper B, Fig. 30)",
        fontsize=10,
    )
    _save(figure, path)


# --- all of it ------------------------------------------------------------------------------------


def stored(path: Path = CSV) -> Figures:
    """Figures of the last run of the study."""
    return Figures(tables.read_csv(path))


def regenerate(texts_only: bool = False) -> None:
    """Run the study, store and draw what it finds, and write the page."""
    with terminable():
        if not texts_only:
            drive = load_mptc_drive(DRIVE)
            with progress.counter("Paper B's operating points", study.count()) as advance:
                rows, curves = study.measure(drive, advance)
            found = Figures(rows)
            drawings: dict[str, Callable[[Path], None]] = {
                "spectra": lambda path: _draw_spectra(curves, found, path),
                "dynamics": lambda path: _draw_dynamics(curves, path),
                "compared": lambda path: _draw_compared(curves, path),
                "steps": lambda path: _draw_steps(curves, path),
                "parameters": lambda path: _draw_parameters(curves, found, path),
                "no_load": lambda path: _draw_steady(
                    curves, "no load", study.SHOWN_UNLOADED,
                    "2.2 kW drive, 150 r/min, no load, 0.986 Wb, speed PI, bit-true model "
                    "(Paper B, Fig. 8)", path,
                ),
                "low_speed": lambda path: _draw_steady(
                    curves, "rated load", study.SHOWN_LOADED,
                    "2.2 kW drive, 150 r/min, 14 N m, 0.9 Wb, speed imposed, bit-true model "
                    "(Paper B, Fig. 13)", path,
                ),
                "startup": lambda path: _draw_startup(curves, path),
                "load_step": lambda path: _draw_load_step(curves, path),
            }  # fmt: skip
            for name, draw in drawings.items():
                draw(REPORTS / f"paper_b_{name}.png")
            tools.write(CSV, tables.csv_text(rows))
        found = stored()
        _draw_bars(found, REPORTS / "paper_b_bars.png")
        _draw_speeds(found, REPORTS / "paper_b_speeds.png")
        write_texts(found)
        write_texts(found, REPORT, reported=True)
