"""The shell of both systems: flags, commutations, commits that wait, the time of a decision.

Stimulus: decisions with each combination of flags, cleared at once; commutations of 240 clocks; a
shadow written in any clock of a copy; an enable while the commit of a setting waits for a decision;
limits of a decision above and below its clocks; measurements in registers from before an enable,
not all of them, and starts without any; bits of settings in force turned over; a driver's fault.
Checks: flags tell of a decision and stay cleared; the status tells of a commutation while it lasts;
a shadow is refused until all are copied; no enable with settings that are not in force; the fault
of a late decision, and no other; old measurements turn no gate on, and starts alone keep none on;
an upset and a driver's fault stop the drive, and the status tells whether settings are in force.
Timing: what the registers show is looked at 20 clocks behind a decision.
Does not prove: what test_system has.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run


def bench(controller: str, rtl: Path = RTL) -> Outcome:
    return run(
        f"{controller}_system",
        "tb.rtl.system.system_shell.bench_system_shell",
        units=[f"{controller}_system"],
        generics={"EXPLORERS": 1} if controller == "mpdcc" else {},
        arguments={"seed": 2, "controller": controller},
        rtl=rtl,
    )


def test_flags_and_commutations_are_told() -> None:
    assert bench("mptc").checks["flags"] == 5


def test_commits_wait_and_late_decisions_are_told() -> None:
    found = bench("mpdcc")
    assert found.checks["not in force"] == 8
    assert found.checks["faults"] == 60


FAULTS = {
    "flag": ("mptc", Fault("system_shell", "<= decided and clamped;", "<= clamped;", "cleared:")),
    "status": ("mptc", Fault("system_shell", "<= not is_resting;", "<= '0';", "commutating:")),
    "copy": ("mpdcc", Fault("system_shell", "pending or load_waits;", "pending;", "copied:")),
    "kept alive": (
        "mptc",
        Fault("system_shell", "applied  <= apply and made;", "applied  <= apply;", "missing:"),
    ),
    "measured before": (
        "mpdcc",
        Fault("system_shell", "and fresh;\n  applied", ";\n  applied", "(before|missing):"),
    ),
    "told": ("mptc", Fault("system_shell", "<= begun and live and not fresh;", "<= '0';", "bef")),
    "upset": ("mpdcc", Fault("system_shell", " or bands_in_force /= bands", "", "stopped")),
    "driver": (
        "mpdcc",
        Fault("system_shell", "=> driver_fault,", "=> '0',", "stopped"),
    ),
    "driver of the system": (
        "mpdcc",
        Fault("mpdcc_system", "=> driver_fault,", "=> '0',", "stopped"),
    ),
    "start": (
        "mpdcc",
        Fault("system_shell", "start          => measured,\n      decided",
              "start          => apply,\n      decided", "(faults|missing):"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_seen(name: str, tmp_path: Path) -> None:
    controller, fault = FAULTS[name]
    assert_seen(fault, tmp_path, lambda rtl: bench(controller, rtl))
