"""The deadlock study's experiments: by default they decide as the production model does.

Sweep: both shipped drives, SE and SESE, both rules that are built in, speeds 0.2, 0.3 and 1.0,
random drives.
Stimulus: closed loops of the 6 kV drive that run into deadlocks, states near and beyond the bounds.
Checks: every field of every decision against ``bit_true_fast``; the criteria and tie rules against
plain Python on random errors; that weights and ties change decisions at all; that the study fails
where the RTL decides otherwise; that the page's tables are the report's.
Does not prove: anything about the RTL, or that a rule is good.
"""

from __future__ import annotations

import numpy as np
import pytest

from directmpc.mpdcc import closed_loop, inverter
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.trace import MpdccTrace
from scripts.hdl import states
from scripts.shared.tables import MarkerError
from scripts.studies import deadlock_rules
from scripts.studies import deadlocks as deadlock_study
from scripts.studies.deadlock_rules import Rule
from scripts.studies.fidelity import decisions

#: The rule of every value of a drive file's `deadlock_rule`.
BUILT_IN = {rule: deadlock_study.CASES[name].rule for name, rule in deadlock_study.BUILT_IN.items()}


def assert_alike(drive: Drive, trace: MpdccTrace) -> int:
    """Decisions of both for every row of a trace; the number of deadlocks."""
    own = registers(drive, "fast").array()
    given = deadlock_rules.parameters(drive, BUILT_IN[drive.control.deadlock_rule])
    words, _ = common.encode(trace)
    deadlocks = 0
    for row, s_prev in zip(words, trace.s_prev.astype(np.int64), strict=True):
        wanted = bit_true_fast.decide_words(own, row, s_prev)
        found = deadlock_rules.decide_words(given, row, s_prev)
        deadlocks += wanted[4]
        assert tuple(found) == tuple(wanted)
    return deadlocks


@pytest.mark.parametrize("horizon", ["SE", "SESE"])
@pytest.mark.parametrize("speed", [0.2, 0.3, 1.0])
@pytest.mark.parametrize("rule", BUILT_IN)
def test_closed_loops_are_the_production_models(horizon: str, speed: float, rule: str) -> None:
    drive = states.shipped("anpc5l_6kv").with_control(bound_current=0.06, switching_horizon=horizon,
        deadlock_rule=rule,
    )  # fmt: skip
    runs = [
        closed_loop.simulate(drive, decide, values, OperatingPoint(speed), 4400, seed=0)
        for decide, values in (
            (bit_true_fast.decide, registers(drive, "fast").array()),
            (deadlock_rules.decide, deadlock_rules.parameters(drive, BUILT_IN[rule])),
        )
    ]
    wanted, found = runs[0].decisions, runs[1].decisions
    for name in ("s", "held", "deadlock", "length", "saturated"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), name)
    np.testing.assert_array_equal(runs[0].state, runs[1].state)
    if speed < 0.5:
        assert wanted.deadlock.sum() >= 30


@pytest.mark.parametrize("horizon", ["SE", "SESE"])
@pytest.mark.parametrize("rule", BUILT_IN)
def test_random_drives_and_states(horizon: str, rule: str) -> None:
    rng = np.random.default_rng(17)
    deadlocks = 0
    for _ in range(60):
        drive = states.random_drive(rng).with_control(switching_horizon=horizon, deadlock_rule=rule)
        deadlocks += assert_alike(drive, states.near(drive, 8, rng))
        deadlocks += assert_alike(drive, states.wide(8, rng, beyond=1.2))
    assert deadlocks >= 50


def test_criteria_and_ties_mean_what_they_say() -> None:
    rng = np.random.default_rng(5)
    bound = np.array([100, 100, 100, 50, 80, 80, 80])
    keys = np.empty(7, dtype=np.int64)

    def keys_of(rule: Rule, ahead: np.ndarray, effort: int = 0) -> list[int]:
        drive = states.shipped("anpc5l_6kv")
        deadlock_rules.criterion(
            deadlock_rules.parameters(drive, rule)[1], ahead, bound, effort, keys
        )
        return [int(key) for key in keys]

    for _ in range(50):
        ahead = rng.integers(-200, 201, 7)
        factors = np.array([16, 16, 16, 128, 32, 32, 32])
        excess = (np.abs(ahead) - bound) * factors
        weights = (16, 128, 32)
        outside = np.maximum(excess, 0)
        current = max(excess[:3])
        assert keys_of(Rule(weights=weights), ahead) == [max(excess), 0, 0, 0, 0, 0, 0]
        rule = Rule(tie=deadlock_rules.CURRENT, weights=weights)
        assert keys_of(rule, ahead)[:3] == [max(excess), current, 0]
        rule = Rule(tie=deadlock_rules.SORTED, weights=weights)
        assert keys_of(rule, ahead) == sorted(excess, reverse=True)
        rule = Rule(tie=deadlock_rules.EFFORT, weights=weights)
        assert keys_of(rule, ahead, 5)[:2] == [max(excess), 5]
        rule = Rule(tie=deadlock_rules.MAGNITUDES)
        assert keys_of(rule, ahead)[1] == np.abs(ahead).sum()
        rule = Rule(deadlock_rules.BLEND, blend=4, weights=weights)
        assert keys_of(rule, ahead)[0] == 4 * max(excess) + current
        assert keys_of(Rule(deadlock_rules.SUM, weights=weights), ahead)[0] == outside.sum()
        squares = (outside * outside).sum()
        assert keys_of(Rule(deadlock_rules.SQUARES, weights=weights), ahead)[0] == squares


def test_ties_are_counted() -> None:
    rng = np.random.default_rng(8)
    drive = states.shipped("anpc5l_6kv")
    given = deadlock_rules.parameters(drive, Rule())
    bound = common.options(given[0]).bound
    trace = states.near(drive, 200, rng, reach=4.0)
    counts = []
    for row, s_prev in zip(common.encode(trace)[0], trace.s_prev.astype(np.int64), strict=True):
        n = bit_true_fast.node(row, given[0])
        first = bit_true_fast.first_errors(n.error, n.curvature)
        slope = np.empty(7, dtype=np.int64)
        excesses = []
        for s in inverter.candidates(s_prev):
            bit_true_fast.slopes(np.array(s), n.slope, n.forced, n.phase, n.midpoint, slope)
            excesses.append(int((np.abs(first + slope) - bound).max()))
        dead = deadlock_rules.decide_words(given, row, s_prev)[4]
        wanted = excesses.count(min(excesses)) if dead else 0
        assert deadlock_rules.ties(given, row, s_prev) == wanted
        counts.append(wanted)
    assert 0 in counts
    assert max(counts) > 1


def test_every_case_runs_and_most_change_something() -> None:
    drive = states.shipped("anpc5l_6kv")
    setting = deadlock_study.Setting("SE", 0.06, 0.2, 0)
    paths = set()
    for case in deadlock_study.CASES.values():
        _, result = deadlock_study.simulate(drive, case, setting, 1200)
        paths.add(result.positions.tobytes())
    assert len(paths) >= len(deadlock_study.CASES) - 2


def test_the_rtl_verifies_the_table(monkeypatch) -> None:
    # the production model stands in for the netlist; one wrong bit is an error
    wrong = np.zeros(8, dtype=np.int64)

    def decide(variant: str, words: np.ndarray, s_prev: np.ndarray, values: np.ndarray):
        rows = [
            (*bit_true_fast.decide_words(values, row, s.astype(np.int64)), 70)
            for row, s in zip(words, s_prev, strict=True)
        ]
        return np.array(rows) ^ wrong

    monkeypatch.setattr(decisions, "decide_netlist", decide)
    drive = states.shipped("anpc5l_6kv")
    points = [("SE", 0.2, 0.06), ("SESE", 0.3, 0.1)]
    assert deadlock_study.verify(drive, points, 300) == (1200, 70)
    wrong[4] = 1
    with pytest.raises(decisions.FidelityError, match=r"300 of 300 .*horizon='SE'"):
        deadlock_study.verify(drive, points, 300)


def test_starts_needed() -> None:
    # t(0.975, 2) = 4.303: three starts of spread 1 give 2.484
    assert deadlock_study.starts_needed(1.0, 2.49) == 3
    assert deadlock_study.starts_needed(1.0, 2.48) == 4


def test_the_page_shows_the_report() -> None:
    text = deadlock_study.PAGE.read_text(encoding="utf-8")
    report = (deadlock_study.REPORTS / "deadlocks.md").read_text(encoding="utf-8")
    wanted = "python -m scripts deadlocks --page"
    assert deadlock_study.page(text, report) == text, wanted
    # every row of the page that could be one of the report's is in a table that is held
    held = outside = ""
    for part in text.split("<!-- ")[1:]:
        head, _, body = part.partition(" -->")
        if head.endswith("begin (written by python -m scripts deadlocks)"):
            held += body
        else:
            outside += body
    assert held.count("\n| ") == 2 + 2 * 2 * len(deadlock_study.SHOWN)
    assert not any(line.startswith("| ") and " %/pu |" in line for line in outside.split("\n"))


@pytest.mark.parametrize(
    ("was", "now"),
    [
        ("RTL: 192000 decisions", "RTL: 192001 decisions"),
        ("| largest excess | SE | 99 %/pu |", "| largest excess | SE | 98 %/pu |"),
        ("| largest excess | SE | 71 %/pu |", "| largest excess | SE | 72 %/pu |"),
    ],
    ids=list(deadlock_study.SECTIONS),
)
def test_a_figure_that_differs_is_seen(was: str, now: str) -> None:
    text = deadlock_study.PAGE.read_text(encoding="utf-8")
    report = (deadlock_study.REPORTS / "deadlocks.md").read_text(encoding="utf-8")
    assert report.count(was) == 1
    changed = deadlock_study.page(text, report.replace(was, now))
    assert changed != text
    assert deadlock_study.page(changed, report) == text


def test_a_table_that_is_missing_is_seen() -> None:
    text = deadlock_study.PAGE.read_text(encoding="utf-8")
    report = (deadlock_study.REPORTS / "deadlocks.md").read_text(encoding="utf-8")
    with pytest.raises(ValueError, match="'RTL:' stands there 0 times"):
        deadlock_study.page(text, report.replace("RTL:", "There"))
    with pytest.raises(MarkerError, match="low speeds: begin"):
        deadlock_study.page(text.replace("<!-- low speeds: begin", "<!-- low speeds begin"), report)
