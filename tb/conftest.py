"""The two tiers of the tests: ``make test`` runs what is not marked `thorough`, see tiers.toml."""

from __future__ import annotations

import fnmatch
import tomllib
from pathlib import Path
from typing import Any

import pytest

TIERS = Path(__file__).with_name("tiers.toml")


def spread(count: int, keep: int) -> set[int]:
    """Numbers of ``keep`` cases out of ``count``, the first and the last among them."""
    if keep >= count:
        return set(range(count))
    if keep == 1:
        return {0}
    return {round(k * (count - 1) / (keep - 1)) for k in range(keep)}


def _function_of(item: pytest.Item) -> str:
    """A test function's name with its file, without the parameters of the case."""
    return item.nodeid.partition("[")[0]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what runs in ``make test-all`` alone."""
    with TIERS.open("rb") as stream:
        tiers: dict[str, list[dict[str, Any]]] = tomllib.load(stream)
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        cases.setdefault(_function_of(item), []).append(item)
    matched: set[str] = set()
    for function, found in cases.items():
        # the first rule that matches is the one that counts
        for kind in ("left_out", "sampled"):
            rules = [r for r in tiers[kind] if fnmatch.fnmatchcase(function, r["tests"])]
            matched |= {rule["tests"] for rule in rules}
            if rules:
                kept = spread(len(found), rules[0]["keep"]) if kind == "sampled" else set()
                for number, item in enumerate(found):
                    if number not in kept:
                        item.add_marker("thorough")
                break
    patterns = {rule["tests"] for rules in tiers.values() for rule in rules}
    if config.args == config.getini("testpaths") and (dead := sorted(patterns - matched)):
        raise pytest.UsageError(f"{TIERS.name}: no test matches {', '.join(dead)}")
