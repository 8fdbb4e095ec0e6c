"""Sections of reports/metrics.json that closed-loop studies fill.

Stimulus: the files in reports/ and the pages that are checked in.
Checks: each section is what the study's CSV gives; the tables of the pages, which the studies write
by themselves, have the same figures.
Does not prove: that a figure is right; the commands that write the CSV files measure it.
"""

from __future__ import annotations

import json
from typing import Any

import pytest

from scripts.publish import study_figures
from scripts.shared.tools import ROOT
from scripts.studies import bounds, lengths, mptc_robustness, robustness

METRICS: dict[str, Any] = json.loads((ROOT / "reports" / "metrics.json").read_text("utf-8"))
POINTS = ("SE 1.0", "SE 0.6", "SESE 1.0", "SESE 0.6")


def table(page: str, name: str) -> list[list[str]]:
    """Rows of a table between marks, without its head."""
    text = (ROOT / page).read_text(encoding="utf-8")
    inside = text.partition(f"<!-- {name}: begin")[2].partition(f"<!-- {name}: end")[0]
    lines = [line.strip() for line in inside.splitlines() if line.startswith("| ")]
    return [
        [cell.strip() for cell in line[1:-1].split("|")]
        for line in lines[1:]
        if not line.startswith("| ---")
    ]


@pytest.mark.parametrize("name", study_figures.SECTIONS)
def test_a_section_is_what_the_file_gives(name: str) -> None:
    made = study_figures.sections()[name]
    assert METRICS[name] == json.loads(json.dumps(made)), "make report ARGS=--tables"
    assert len(made) > 1


def test_robustness_against_another_machine() -> None:
    found = table("reports/robustness.md", "mismatch")
    assert len(found) == sum(
        how != robustness.KNOWN and plant != "same" for plant, how in robustness.MISMATCHES
    )
    for plant, knows, fsw, thd, dead in found:
        every = [
            by[plant][knows][point]
            for by in METRICS["robustness"]["mismatch"].values()
            for point in POINTS
        ]
        assert len(every) == 8
        for cell, name, form in ((fsw, "fsw_change_pct", "+.0f"), (thd, "thd_change_pct", "+.1f")):
            values = [one[name] for one in every]
            assert cell == f"{min(values):{form}}, {max(values):{form}}"
        assert dead == f"{max(one['deadlocks_per_1000'] for one in every):.0f}"


def _high(one: dict[str, float], form: str) -> str:
    return f"{one['median']:{form}} ({one['p95']:{form}})"


def test_robustness_of_two_level_drives() -> None:
    two_level = METRICS["robustness"]["mptc"]["MPTC"]
    found = table("reports/robustness.md", "two-level")
    assert len(found) == len(mptc_robustness.CASES) - 1
    for case, *cells in found:
        one = two_level[case]
        assert cells == [
            *(_high(one[f"{name}_change_pct"], "+.0f") for name in ("torque_ripple", "thd")),
            _high(one["torque_off_nm"], ".2f"),
        ]


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f}"


def _of_speed(section: dict[str, Any], drive: str, speed: str) -> dict[str, Any]:
    return {float(key): value for key, value in section[drive].items()}[float(speed)]


def test_pwm() -> None:
    section = METRICS["pwm"]
    for name, columns in (
        ("equal", ("pwm_thd_pct", "se_same_thd_pct", "sese_same_thd_pct", "se_studied_thd_pct",
                   "sese_studied_thd_pct", "pwm_ideal_thd_pct")),
        ("ideal", ("pwm_thd_pct", "se_thd_pct", "sese_thd_pct")),
    ):  # fmt: skip
        for drive, speed, fsw, *cells in table("reports/pwm.md", name):
            (one,) = (
                one
                for one in _of_speed(section[name], drive, speed).values()
                if f"{one['fsw_hz']:.0f}" == fsw
            )
            assert cells[-len(columns) :] == [_percent(one[column]) for column in columns]
    for drive, speed, bound, *cells in table("reports/pwm.md", "balance"):
        by = _of_speed(section["balance"], drive, speed)
        one = {float(key): value for key, value in by.items()}[float(bound)]
        assert cells == [
            f"{one[s]['fsw_hz']:.0f} / {one[s]['fsw_still_hz']:.0f} Hz, "
            f"{one[s]['balance_pct']:.0f} % "
            f"(THD {one[s]['thd_pct']:.1f} / {one[s]['thd_still_pct']:.1f} %)"
            for s in ("SE", "SESE")
        ]
    page = (ROOT / "reports" / "pwm.md").read_text(encoding="utf-8")
    said = (f"{one['vn_pu']:.3f} / {one['vph_pu']:.3f} pu" for one in section["excess"].values())
    assert all(one in page for one in said)


def test_bounds_and_lengths() -> None:
    section = METRICS["bounds"]
    found = table("reports/bounds.md", "distortion")
    assert len(found) == len(bounds.BOUNDS)
    for bound, *cells in found:
        key = str(float(bound))
        ideal = section["ideal"][key]
        assert cells == [
            f"{ideal['fsw_hz']:.0f}", f"{ideal['thd_pct']:.2f}",
            *(f"{section[name][key][column]:+.1f}" for name in ("paper", "fast")
              for column in ("fsw_diff_pct", "thd_diff_pct")),
        ]  # fmt: skip
    for name, row in zip(("paper", "fast"), table("reports/bounds.md", "largest")[1:], strict=True):
        one = section["largest"][name]
        assert row[1:] == [
            f"{one['fsw_diff_pct']:.1f}", f"{one['thd_diff_pct']:.1f}",
            f"{one['rtl_differing']} of {one['rtl_rows']} differ",
        ]  # fmt: skip
    for (name, rule), row in zip(
        bounds.SETTINGS, table("reports/bounds.md", "capacitors"), strict=True
    ):
        one = section["capacitors"][name][rule]
        assert row[2].startswith(f"{one['vn_largest_pu']:.3f} of")
        assert row[4].startswith(f"{one['vph_largest_pu']:.3f} of")
        outside = [one[key] for key in ("vn_outside_pct", "vph_outside_pct")]
        assert [row[3], row[5]] == [f"{value:.2f}" for value in outside]
        assert row[6] == f"{one['deadlocks_pct']:.1f}"
    for name, row in zip(lengths.VARIANTS, table("reports/bounds.md", "lengths"), strict=True):
        one = METRICS["lengths"][name]
        assert row[1:] == [
            f"{one['searches']}", f"{one['exact_pct']:.2f}", f"{one['one_step_pct']:.2f}",
            f"{one['more_pct']:.2f}", f"{one['least_steps']:+d} to {one['largest_steps']:+d}",
        ]  # fmt: skip


def _worst(one: dict[str, float]) -> str:
    return ", ".join(f"{one[f'{key}_pu']:.3f}" for key in study_figures.EXCESS) + " pu"


def test_deadlocks() -> None:
    section = METRICS["deadlocks"]
    for name, part in (("low speeds", "low"), ("high speeds", "high")):
        for rule, horizon, *cells in table("docs/settings.md", name):
            one = section[part][rule][horizon]
            assert cells == [
                f"{one['thd_per_bound']:.0f} %/pu", f"{one['fsw_hz']:.0f} Hz",
                f"{one['deadlocks_pct']:.1f} %", _worst(one),
            ]  # fmt: skip
