"""Observers in one: the RTL against its twins."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.simulation import Outcome, run


def bench(
    steps: int,
    rtl: Path = RTL,
    *,
    pauses: tuple[int, ...] = (0, 0, 1, 5),
    filters: bool = True,
    leakage: bool = True,
    alone: str = "",
) -> Outcome:
    return run(
        "state_observer",
        "tb.rtl.observers.state_observer.bench_state_observer",
        units=["state_observer"],
        generics={"FILTERS": str(filters).lower(), "LEAKAGE": str(leakage).lower()},
        arguments={
            "seed": 4, "steps": steps, "pauses": pauses, "filters": filters, "leakage": leakage,
            "alone": alone,
        },
        rtl=rtl,
    )  # fmt: skip


def test_it_steps_as_its_twins() -> None:
    assert bench(270).checks["estimate"] >= 90
