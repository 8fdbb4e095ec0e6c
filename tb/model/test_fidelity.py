"""How close the bit-true controllers are to the ideal one: limits on a reduced set, and the budget.

Sweep: both shipped drives, three current bounds, speeds of both signs from 0.1 to 1.0; loops closed
by the ideal and by the bit-true controller.
Stimulus: states of closed loops.
Checks: the share of decisions that differ, overall and by point; that the error budget's replica is
the bit-true model with everything on and the ideal controller with everything off; that every
rounding has a switch that acts; pooled differences and their intervals on made-up figures; that the
published figures keep the limits they are published with.
Timing: none.
Does not prove: anything about the RTL; `make fidelity` lets it decide every step it counts.
"""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from directmpc.mpdcc import ideal
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from scripts.shared.tools import ROOT
from scripts.studies.fidelity import budget, decisions, loops, plots, pooling, replica
from scripts.studies.fidelity import study as command
from scripts.studies.fidelity.points import BOUNDS, DRIVES, Point, Row

STEPS = 5_000
SPEEDS = (1.0, -0.775, 0.55, -0.325)


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    """A reduced set of the published points, the fast variant, without the RTL."""
    chosen = [
        Point(drive, bound, speed)
        for n, drive in enumerate(DRIVES)
        for bound in BOUNDS
        for speed in SPEEDS[n::2]
    ]
    return [
        decisions.compare(point, "fast", driver, STEPS, rtl=False)
        for point in chosen
        for driver in decisions.DRIVERS
    ]


def test_decisions_differ_no_more_than_published(rows: list[Row]) -> None:
    figures = decisions.summarise(rows)
    print(figures)
    assert figures["steps"] >= 100_000
    assert 0.0 < figures["decision_mismatch_pct"] <= 0.25
    assert figures["worst_point_pct"] <= 1.0
    assert all(row["saturated"] == 0 for row in rows)
    parts = [figures[f"{name}_pct"] for name in ("near_tie_cost", "near_tie_bound")]
    parts.append(figures["clear_mismatch_pct"])
    assert sum(parts) == pytest.approx(figures["decision_mismatch_pct"], abs=1e-3)


def test_the_paper_variant_is_several_times_further_away() -> None:
    point = Point(DRIVES[0], 0.10, 1.0)
    row = decisions.compare(point, "paper", "ideal", STEPS, rtl=False)
    assert 0.4 < 100 * row["differing"] / row["steps"] < 4.0


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("bound", BOUNDS)
def test_the_replica_is_both_controllers(drive: str, bound: float) -> None:
    point = Point(drive, bound, 0.55)
    seen, model, exact = decisions.loop(point, "fast", "model", 2_000)
    loaded = point.load()
    built = replica.run(replica.replica(loaded), seen)
    np.testing.assert_array_equal(built[:, :3], model.s)
    np.testing.assert_array_equal(built[:, 3], model.held)
    np.testing.assert_array_equal(built[:, 4], model.deadlock)
    np.testing.assert_array_equal(built[:, 5], model.length)
    plain = replica.run(replica.replica(loaded, 0.0, replica.EXACT), seen)
    np.testing.assert_array_equal(plain[:, :3], exact.s)
    np.testing.assert_array_equal(plain[:, 5], exact.length)


@pytest.mark.parametrize("name", replica.GRAINS)
def test_every_rounding_has_a_switch_that_acts(name: str) -> None:
    point = Point(DRIVES[1], 0.10, -0.775)
    seen, _, exact = decisions.loop(point, "fast", "ideal", 1_000)
    coarse = replica.replica(point.load(), {name: 2.0**11}, replica.EXACT)
    changed = replica.run(coarse, seen)
    if name == "cost":  # equal words for equal costs, whatever their spacing
        assert coarse.cost == 2.0**11
        return
    assert np.any(changed[:, :6] != np.column_stack([exact.s, exact.held, exact.deadlock,
                                                     exact.length]))  # fmt: skip


def test_unknown_roundings_are_refused() -> None:
    with pytest.raises(ValueError, match="no such rounding: nothing"):
        replica.replica(Point(DRIVES[0], 0.1, 1.0).load(), {"nothing": 1.0})


def test_every_rounding_has_words() -> None:
    assert set(budget.ROUNDINGS) == set(replica.GRAINS)
    names = [(s.group, s.name) for s in budget.settings()]
    assert len(set(names)) == len(names)


def test_first_exits_of_random_parabolas() -> None:
    found = budget.parabolas()
    assert found["too_long_pct"] <= 0.25
    assert found["too_short_pct"] <= 0.05
    assert found["plain_wrong_pct"] > 2 * found["too_long_pct"]


def test_near_ties_are_told_from_clear_differences() -> None:
    point = Point(DRIVES[0], 0.06, 0.55)
    seen, _, _ = decisions.loop(point, "fast", "ideal", 500)
    parameters = ideal.ideal_parameters(point.load())
    counts = decisions.near_ties(parameters, seen, np.arange(len(seen)))
    assert sum(counts.values()) == len(seen)
    assert counts["tie_cost"] > 0 < counts["clear"]
    # a phase capacitor exactly on its bound is within an LSB of it
    seen.x_inv[0, 1] = 0.25 * seen.vdc[0] + point.load().control.bound_vph
    arguments = (
        parameters, seen.x_m[0], seen.x_inv[0], seen.vdc[0], seen.iref[0], seen.omega_s[0],
        seen.omega_r[0], seen.s_prev[0],
    )  # fmt: skip
    assert decisions.edges(*arguments)[0] < 1e-12


def test_the_model_in_the_loop_is_the_fast_variant() -> None:
    decide, registers = loops.controller(Point(DRIVES[0], 0.1, 1.0), "fast")
    assert decide is bit_true_fast.decide
    assert registers.dtype == np.int64


@pytest.mark.filterwarnings("error")
def test_runs_without_a_search_have_no_mean_length() -> None:
    assert math.isnan(loops.known_mean(np.empty(0, dtype=np.int64)))
    assert loops.known_mean([2.0, math.nan, 5.0]) == 3.5
    row: Row = {
        "drive": "none", "bound_current_pu": 0.1, "omega_s_pu": 0.2, "steps": 4,
        "fsw_hz": [100.0, 110.0], "thd_pct": [5.0, 6.0], "deadlocks_pct": [100.0, 100.0],
        "length": [math.nan, math.nan],
    }  # fmt: skip
    found = loops.table([row | {"controller": "ideal"}, row | {"controller": "fast"}])
    assert math.isnan(found[0]["length"])
    assert math.isnan(found[0]["length_ideal"])
    assert found[0]["deadlocks_pct"] == 100.0


def test_pooled_differences_have_the_interval_they_should() -> None:
    rng = np.random.default_rng(1)
    inside = plainly = 0
    for _ in range(400):
        rows: list[Row] = []
        for speed in (0.5, 1.0):
            for name, mean in (("ideal", 100.0), ("fast", 102.0)):
                drawn = {key: rng.normal(mean, 5.0, 16).tolist() for key in loops.FIGURES}
                rows.append(
                    {
                        "drive": "none", "bound_current_pu": 0.1, "omega_s_pu": speed,
                        "controller": name, "steps": 16, **drawn,
                        "deadlocks_pct": [1.0], "length": [5.0],
                    }
                )  # fmt: skip
        found = pooling.pooled(loops.table(rows), "fast")
        inside += found["fsw_diff_ci_low"] <= 2.0 <= found["fsw_diff_ci_high"]
        plainly += (
            found["fsw_diff_equal_weights_ci_low"] <= 2.0 <= found["fsw_diff_equal_weights_ci_high"]
        )
        assert found["steps_closed_loop"] == 32
    assert 0.90 <= inside / 400 <= 0.99
    assert 0.90 <= plainly / 400 <= 0.98


def test_published_figures_keep_their_limits() -> None:
    document = json.loads((ROOT / "reports" / "fidelity.json").read_text(encoding="utf-8"))
    fast = document["mpdcc"]
    assert fast["steps_rtl"] >= 50_000
    assert fast["decision_mismatch_pct"] <= 0.25
    assert fast["worst_point_pct"] <= 1.0
    assert fast["steps_closed_loop"] >= 2_000_000
    for key, limit in (("fsw", 1.0), ("thd", 0.5)):
        assert fast[f"{key}_diff_ci_low"] <= fast[f"{key}_diff_pct"] <= fast[f"{key}_diff_ci_high"]
        assert max(-fast[f"{key}_diff_ci_low"], fast[f"{key}_diff_ci_high"]) <= limit
    for variant in command.KEYS:
        assert command.figures(variant).items() <= document[command.KEYS[variant]].items()


def test_the_document_shows_the_published_figures() -> None:
    document = json.loads((ROOT / "reports" / "fidelity.json").read_text(encoding="utf-8"))
    text = (ROOT / "docs" / "evidence.md").read_text(encoding="utf-8")
    assert plots.decision_table(document) in text
    assert plots.loop_table(document) in text
