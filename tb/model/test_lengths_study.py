"""The study of predicted lengths: its file, its page, and a point that is run again.

Stimulus: the published file; short loops of both variants; a decision whose length is falsified.
Checks: a point run again makes the file's counts; the page shows the file; the fast variant errs
less often than the paper variant; a wrong length is counted.
Does not prove: that the drive is the paper's, whose parameters are not published.
"""

from __future__ import annotations

import pytest

from scripts.shared import tables
from scripts.studies import bounds, lengths


@pytest.fixture(scope="module")
def stored() -> list[lengths.Row]:
    return lengths.read(lengths.REPORT)


def test_the_file_has_every_point(stored: list[lengths.Row]) -> None:
    points = {(row["controller"], row["bound_pu"]) for row in stored}
    assert points == {(name, bound) for name in lengths.VARIANTS for bound in bounds.BOUNDS}
    assert all(row["searches"] > 0 for row in stored)


def test_the_page_shows_the_file(stored: list[lengths.Row]) -> None:
    page = lengths.PAGE.read_text(encoding="utf-8")
    assert tables.inside(page, lengths.BEGIN, lengths.END).strip() == lengths.table(stored)


def test_a_point_run_again_is_the_files(stored: list[lengths.Row]) -> None:
    found = lengths.point(0.10, "fast", lengths.STARTS, bounds.STEPS)
    wanted = [r for r in stored if (r["bound_pu"], r["controller"]) == (0.10, "fast")]
    # another libm turns roundings, and closed loops part after some steps
    made, stored_share = (lengths.histogram(rows, "fast") for rows in (found, wanted))
    assert made[0] == pytest.approx(stored_share[0], abs=1.0)


def test_the_histogram_is_a_share_of_all_searches(stored: list[lengths.Row]) -> None:
    for name in lengths.VARIANTS:
        assert sum(lengths.histogram(stored, name).values()) == pytest.approx(100.0)
    shares = [lengths.histogram(stored, name)[0] for name in ("paper", "fast")]
    assert shares[0] < shares[1]


def test_a_wrong_length_is_counted() -> None:
    drive, result = bounds.loop(0.10, "fast", "largest", 0, 600)
    before = lengths.errors(drive, result)
    decided = result.decisions
    decided.length[(decided.held == 0) & (decided.deadlock == 0)] += 3
    assert (lengths.errors(drive, result) - before == 3).all()
    assert len(before) > 20
