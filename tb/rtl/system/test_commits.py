"""A commit at every clock of a decision, through the bus: it never touches the one under way.

Sweep: MPDCC (fast, one explorer) and MPTC; the clock at which the host asks for the commit, from 12
before a start, with MPDCC from before all of a copy, to four after the decision's end: every one,
or one in so many.
Stimulus: sets of parameters of any content that differ in up to eight words, and measurements for
which they decide differently; the shadows are written before, the commit is one write. Shadows are
written right behind a commit at rest, too, until they are taken.
Checks: the decision under way is that of the old parameters whenever the commit comes behind its
start, the next one that of the new ones, always; from one clock on it is the old one. A decision
that begins while words are copied is that of the new ones. Behind a commit no write is refused, but
by MPDCC's copy, and none of it takes effect with that commit; none passes in the clock of a
commit's command and in the two after it.
Timing: at rest MPDCC's parameters are prepared for 87 clocks behind a load.
Faults: a commit that does not wait for the decision, parameters that are scaled a clock late,
a decision that does not wait for the copy, writes that do not wait for a commit.
Does not prove: a write of shadows at any clock; test_system does that at random.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run


def bench(controller: str, stride: int, rtl: Path = RTL) -> Outcome:
    return run(
        f"{controller}_system",
        "tb.rtl.system.bench_commits",
        units=[f"{controller}_system"],
        generics={"EXPLORERS": 1} if controller == "mpdcc" else {},
        arguments={"seed": 5, "stride": stride, "controller": controller},
        rtl=rtl,
        timeout=900,
    )


@pytest.mark.parametrize("stride", [1, 11])
@pytest.mark.parametrize("controller", ["mpdcc", "mptc"])
def test_a_commit_waits_for_the_decision(controller: str, stride: int) -> None:
    found = bench(controller, stride)
    assert found.measured["clocks"] >= {"mpdcc": 80, "mptc": 38}[controller]
    assert found.measured["during"] >= found.measured["clocks"] // stride


def test_a_late_scaling_is_seen(tmp_path: Path) -> None:
    rtl = altered(
        tmp_path, "mpdcc_system", "if (taking = '1' or (core", "if (loaded = '1' or (core"
    )
    with pytest.raises(CheckError, match=r"prepared: .* expected"):
        bench("mpdcc", 11, rtl)


def test_a_hasty_commit_is_seen(tmp_path: Path) -> None:
    rtl = altered(
        tmp_path, "commit_control", "waiting and (ending or not (busy or start))", "waiting"
    )
    with pytest.raises(CheckError, match=r"(one set|order|begins old): .* expected"):
        bench("mptc", 3, rtl)


def test_a_write_that_does_not_wait_is_seen(tmp_path: Path) -> None:
    rtl = altered(
        tmp_path, "write_rules", "hold   <= commit or asked(0) or asked(1);", "hold   <= '0';"
    )
    with pytest.raises(CheckError, match=r"(written|behind|held): .* expected"):
        bench("mptc", 11, rtl)


#: What MPDCC does while words are copied: where, and the check that sees it.
COPIED = {
    "a decision begins": (
        "mpdcc_system",
        "and not observer_busy and not load_waits and not stale;",
        "and not observer_busy and not stale;",
        "one set",
    ),
    "a write is taken": (
        "system_shell", "unchanged <= pending or load_waits;", "unchanged <= pending;", "behind"
    ),
    "an end too early": (
        "parameter_memory", "to_std_logic(fetched_at = LAST)", "fetched_at(5)", "prepared"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COPIED)
def test_a_fault_of_the_copy_is_seen(name: str, tmp_path: Path) -> None:
    entity, old, new, check = COPIED[name]
    rtl = altered(tmp_path, entity, old, new)
    with pytest.raises(CheckError, match=rf"{check}: .* expected"):
        bench("mpdcc", 3, rtl)
