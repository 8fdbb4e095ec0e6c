"""``mpdcc_core`` with the package of another converter, against its bit-true model.

Sweep: all converters but the usual one; one and two explorers; SE and SESE with delay
compensation or a budget; both variants.
Stimulus: closed loops of the model around the plant of each converter; every s(k-1) of the NPC.
Checks: all fields of every decision; most clocks of a search of 27 candidates; a slip in the
package is noticed.
Timing: at most 80 clocks for 27 candidates, as many as the usual core has for 64.
Does not prove: systems and boards, which serve the usual converter alone.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from directmpc.mpdcc import tables
from directmpc.mpdcc.drive import Drive
from scripts.hdl import converter_package
from scripts.hdl import mpdcc_rows as core
from scripts.measure import budgets
from scripts.shared.tables import inside
from scripts.studies import converters as study
from scripts.studies.converters import drive_of, rows_of

#: Explorers of the core of each converter.
EXPLORERS = {"npc3l": 1, "ttype3l": 2, "two_level": 2, "fc3l": 1}


def assert_as_its_model(drive: Drive, explorers: int, variant: str = "fast") -> np.ndarray:
    """Compare the decisions of a core; the clocks of those that were no hold."""
    rows = rows_of(drive, variant, 120)
    expected = rows.model(variant)
    found = core.simulate(rows, explorers, variant)
    assert np.array_equal(found.decisions, expected)
    searched = expected[:, 3] == 0
    assert searched.sum() > 40
    assert set(expected[:, :3].ravel().tolist()) == set(range(drive.converter.positions))
    return found.cycles[searched]


@pytest.mark.parametrize("name", EXPLORERS)
def test_the_fast_core_decides_as_its_model(name: str) -> None:
    assert assert_as_its_model(drive_of(name), EXPLORERS[name]).max() <= 80


@pytest.mark.parametrize(
    ("name", "explorers", "variant", "control"),
    [
        ("npc3l", 2, "fast", {"switching_horizon": "SESE", "delay_compensation": True}),
        ("npc3l", 1, "fast", {"switching_horizon": "SESE", "budget": 24}),
        ("npc3l", 2, "paper", {"deadlock_rule": "largest", "outside_rule": "dead"}),
        ("two_level", 4, "fast", {"switching_horizon": "SESE", "budget": 24}),
        ("fc3l", 2, "fast", {"switching_horizon": "SESE", "delay_compensation": True}),
        ("fc3l", 2, "paper", {"deadlock_rule": "largest", "outside_rule": "dead"}),
        ("two_level", 1, "paper", {"deadlock_rule": "largest", "outside_rule": "dead"}),
    ],
)
def test_the_core_decides_as_its_model(
    name: str, explorers: int, variant: str, control: dict[str, object]
) -> None:
    assert_as_its_model(drive_of(name, **control), explorers, variant)


@pytest.mark.parametrize(
    ("name", "text", "slip"),
    [
        (
            "npc3l",
            'CURRENT : positions_mask_t := "0010001',
            'CURRENT : positions_mask_t := "0010000',
        ),
        ("npc3l", "(1, 0, 1, 1),", "(1, 0, 3, 3),"),
        ("npc3l", "NEXT_LAST : next_last_t := (1, 2,", "NEXT_LAST : next_last_t := (1, 1,"),
        (
            "ttype3l",
            'VOLTAGE : positions_mask_t := "0010001',
            'VOLTAGE : positions_mask_t := "0010000',
        ),
        ("fc3l", 'CHARGE : positions_mask_t := "010001', 'CHARGE : positions_mask_t := "010000'),
        ("two_level", "NEXT_LAST : next_last_t := (1, 1,", "NEXT_LAST : next_last_t := (0, 1,"),
        ("anpc5l", 'positions_mask_t := "00000011', 'positions_mask_t := "00000010'),
    ],
    ids=["neutral current", "weight", "last", "neutral voltage", "charge", "last of two", "link"],
)  # fmt: skip
def test_a_slip_in_the_package_is_noticed(name: str, text: str, slip: str, tmp_path: Path) -> None:
    rtl = tmp_path / "rtl"
    shutil.copytree(converter_package.rtl_of(name), rtl)
    package = rtl / converter_package.PACKAGE.relative_to(converter_package.RTL)
    whole = package.read_text(encoding="utf-8")
    assert text in whole
    package.write_text(whole.replace(text, slip), encoding="utf-8")
    rows = rows_of(drive_of(name), "fast", 40)
    found = core.simulate(rows, 2, "fast", rtl=rtl)
    assert not np.array_equal(found.decisions, rows.model("fast"))


def test_rows_of_two_converters_have_no_core() -> None:
    rows = [rows_of(drive_of(name), "fast", 20) for name in ("npc3l", "two_level")]
    with pytest.raises(ValueError, match="the rows are for several converters"):
        core.simulate(core.join(rows), 1, "fast")


def test_the_usual_design_is_the_checked_in_one() -> None:
    assert converter_package.rtl_of(tables.DEFAULT) == converter_package.RTL
    text = converter_package.PACKAGE.read_text(encoding="utf-8")
    assert text == converter_package.text()


def test_three_levels_are_smaller_and_sooner_done() -> None:
    found = study.figures()
    assert list(found) == sorted(tables.NAMES)
    three = found["npc3l"]
    assert three["slices_unpacked"] <= 0.75 * found["anpc5l"]["slices_unpacked"]
    assert three["candidates"] == 27
    assert three["cycles_worst"] <= 80
    assert three["fmax_worst_mhz"] >= 100
    assert all(one["decision_mismatch_pct"] <= 0.25 for one in found.values())
    assert all(three["system"][kind] <= most for kind, most in study.XC6SLX9.items())


@pytest.mark.parametrize("name", ["anpc5l", "npc3l"])
def test_the_page_has_what_a_core_takes(name: str) -> None:
    page = inside(study.PAGE.read_text(encoding="utf-8"), study.BEGIN, study.END)
    (row,) = (row for row in page.splitlines() if row.startswith(f"| `{name}` | "))
    here, held = budgets.versions(), budgets.load().tools
    for figure, found, cell in zip(
        study.COUNTED, study.resources(name), row.split(" | ")[1:], strict=False
    ):
        expected, measured = (int(text.replace(",", "")) for text in (cell, found))
        # slices are counted from LUTs: another GHDL may move both a little
        kind = "lut" if figure == "slices_unpacked" else figure
        assert abs(measured - expected) <= budgets.allowed(kind, expected, held, here), figure
