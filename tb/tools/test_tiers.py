"""The tiers of the tests: how cases are spread, which come first, when no more begin.

Sweep: numbers of cases and of those that are kept, cases by name; rules that match no test or case;
processes; times.
Stimulus: none; the collection of pytest itself.
Checks: the first and the last case are kept, as many as asked for; the error names the pattern;
with little time each process has a case of every test first, and no thorough one after the time.
Timing: none.
Does not prove: that the cases in `make test` are the best ones.
"""

from __future__ import annotations

import fnmatch
import time
import tomllib
from types import SimpleNamespace
from typing import Any

import pytest

from tb import conftest


@pytest.mark.parametrize(
    ("count", "keep"), [(1, 1), (8, 0), (8, 1), (8, 2), (8, 3), (126, 40), (3, 5)]
)
def test_cases_are_spread(count: int, keep: int) -> None:
    kept = conftest.spread(count, keep)
    assert len(kept) == min(count, keep)
    assert kept <= set(range(count))
    assert (0 in kept) == (keep > 0)
    if keep > 1:
        assert count - 1 in kept


class Item:
    """A collected case."""

    config: Any

    def __init__(self, nodeid: str) -> None:
        self.nodeid = nodeid
        self.marks: list[str] = []

    def add_marker(self, name: str) -> None:
        """Note a mark."""
        self.marks.append(name)

    def get_closest_marker(self, name: str) -> bool:
        """Whether it has the mark."""
        return name in self.marks


def collected(*nodes: str, whole: bool = False) -> list[Item]:
    """The cases after the tiers were given out; `whole`: as if every test was asked for."""
    items = [Item(node) for node in nodes]
    paths = ["tb"] if whole else list(nodes)
    config = SimpleNamespace(args=paths, getini=lambda _: ["tb"], getoption=lambda _: None)
    conftest.pytest_collection_modifyitems(config, items)
    return items


def test_of_many_cases_some_are_kept() -> None:
    nodes = [f"tb/proofs/test_x.py::test_a_sum[{k}]" for k in range(4)]
    marks = [item.marks for item in collected(*nodes, "tb/tools/test_tiers.py::test_x")]
    assert marks == [[], ["thorough"], ["thorough"], [], []]


def test_cases_are_kept_by_name() -> None:
    function = "tb/tools/test_budgets.py::test_resources_are_as_budgeted"
    items = collected(f"{function}[gate_guard-ecp5]", f"{function}[gate_guard-xc7]")
    assert [item.marks for item in items] == [[], ["thorough"]]


def test_with_little_time_every_test_has_its_turn_first() -> None:
    items = [Item(name) for name in ("a[0]", "a[1]", "b[0]", "b[1]", "b[2]", "c")]
    for item in items[1:5]:
        item.add_marker("thorough")
    given = [item.nodeid for item in conftest.in_turn(items, 1)]
    assert given == ["a[0]", "b[0]", "c", "a[1]", "b[1]", "b[2]"]
    given = [item.nodeid for item in conftest.in_turn(items, 2)]
    assert given == ["a[0]", "a[1]", "b[0]", "c", "b[1]", "b[2]"]


@pytest.mark.parametrize(
    ("minutes", "marks", "left_out"),
    [
        (1, ["thorough"], True),
        (1, [], False),
        (3, ["thorough"], False),
        (None, ["thorough"], False),
    ],
)
def test_no_thorough_case_begins_after_the_time(
    minutes: float | None, marks: list[str], left_out: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conftest, "BEGAN", time.monotonic() - 120)
    item = Item("a")
    item.marks = marks
    item.config = SimpleNamespace(getoption=lambda _: minutes)
    if left_out:
        with pytest.raises(pytest.skip.Exception, match="time of --minutes is over"):
            conftest.pytest_runtest_setup(item)
    else:
        conftest.pytest_runtest_setup(item)


def test_a_name_of_no_case_is_an_error() -> None:
    with pytest.raises(pytest.UsageError, match=r"tiers\.toml: no test .*\[gate_guard-ecp5\]"):
        collected("tb/tools/test_budgets.py::test_resources_are_as_budgeted[x]", whole=True)


def test_a_rule_for_nothing_is_an_error() -> None:
    with pytest.raises(pytest.UsageError, match=r"tiers\.toml: no test matches .*test_budgets"):
        collected("tb/model/test_x.py::test_a_sum", whole=True)


def test_these_tests_are_in_both_tiers() -> None:
    rules = tomllib.loads(conftest.TIERS.read_text(encoding="utf-8"))["cases"]
    here = "tb/tools/test_tiers.py::test_cases_are_spread"
    assert not any(fnmatch.fnmatchcase(here, rule) for rule in rules)
