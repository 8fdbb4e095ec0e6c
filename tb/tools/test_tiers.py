"""The tiers of the tests: how cases are spread, when sweeps are whole, rules for nothing.

Sweep: numbers of cases and of those that are kept, cases by name; rules that match no test or case.
Stimulus: none; the collection of pytest itself.
Checks: the first and the last case are kept, as many as asked for; the error names the pattern.
Timing: none.
Does not prove: that the cases in `make test` are the best ones.
"""

from __future__ import annotations

import fnmatch
import tomllib
from pathlib import Path
from types import SimpleNamespace

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

    def __init__(self, nodeid: str) -> None:
        self.nodeid = nodeid
        self.marks: list[str] = []

    def add_marker(self, name: str) -> None:
        """Note a mark."""
        self.marks.append(name)


def collected(*nodes: str, whole: bool = False, every: bool = False) -> list[Item]:
    """The cases after the tiers were given out; `whole`: all files, `every`: all cases."""
    items = [Item(node) for node in nodes]
    paths = ["tb"] if whole else list(nodes)
    config = SimpleNamespace(
        args=paths,
        getini=lambda _: ["tb"],
        getoption=lambda _: every,
        hook=SimpleNamespace(pytest_deselected=lambda items: None),
    )
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


def test_a_name_of_no_case_is_an_error() -> None:
    with pytest.raises(pytest.UsageError, match=r"tiers\.toml: no test .*\[gate_guard-ecp5\]"):
        collected("tb/tools/test_budgets.py::test_resources_are_as_budgeted[x]", whole=True)


@pytest.mark.parametrize(("whole", "every", "kept"), [(1, 0, 1), (1, 1, 3), (0, 0, 3)])
def test_a_sweep_is_whole_where_that_is_asked_for(
    whole: int, every: int, kept: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    tiers = tmp_path / "tiers.toml"
    tiers.write_text('[cases]\n"tb/*" = 0\n[sweeps]\n"tb/*" = 1\n')
    monkeypatch.setattr(conftest, "TIERS", tiers)
    nodes = [f"tb/rtl/test_x.py::test_a_fault[{k}]" for k in range(3)]
    items = collected(*nodes, whole=bool(whole), every=bool(every))
    assert [item.marks for item in items] == [["thorough"]] * kept


def test_a_rule_for_nothing_is_an_error() -> None:
    with pytest.raises(pytest.UsageError, match=r"tiers\.toml: no test matches .*test_budgets"):
        collected("tb/model/test_x.py::test_a_sum", whole=True)


def test_these_tests_are_in_all_tiers() -> None:
    tiers = tomllib.loads(conftest.TIERS.read_text(encoding="utf-8"))
    rules = tiers["cases"] | tiers["sweeps"]
    here = "tb/tools/test_tiers.py::test_cases_are_spread"
    assert not any(fnmatch.fnmatchcase(here, rule) for rule in rules)
