"""The top of the boards in the simulator of the RTL: clock, reset, pins, links and both systems.

Sweep: MPDCC with two explorers and options left out, MPTC; the clock direct, divided by two and
four, and out of a PLL with its monitor.
Stimulus: transactions on SPI with a bit a clock; decisions of which each depends on a word of the
measurements, all words in turn; the permit taken back while gates are on; the switch; a second
oscillator at both limits and beyond them; a lost lock.
Checks: clocks of the reset; what IDENTIFY and the capabilities say; decisions of the model, whole
words; gates in the reply and on the pins; LEDs; pins off without a clock; pins that are held high.
Timing: the switch acts two clocks later; a reset holds for 15 clocks.
Does not prove: the PLL itself, for which a stand-in is here, and frames that are not well formed;
test_board has those in the second simulator.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from scripts.hdl.sources import RTL
from tb.helpers.faults import Fault, assert_seen
from tb.helpers.simulation import Outcome, run

HERE = Path(__file__).parent
MPTC = {"CONTROLLER": 2}
TWO = {"CONTROLLER": 1, "EXPLORERS": 2, "WEIGHTED_DEADLOCK": False, "CAPACITOR_FILTER": False}
PAPER = {"CONTROLLER": 1, "FOLDED": True}


def bench(
    generics: dict[str, object], case: str = "board", *, decisions: int = 0, rtl: Path = RTL
) -> Outcome:
    return run(
        "board_top",
        units=["board_top", *(["board_clock"] if generics.get("PLL") else [])],
        generics=generics,
        arguments={"decisions": decisions, "case": case},
        rtl=rtl,
    )


@pytest.mark.parametrize("drivers", [False, True], ids=["no drivers", "drivers"])
def test_the_two_level_drive_over_the_pins(drivers: bool) -> None:
    found = bench({**MPTC, "DRIVERS": drivers, "SECOND_SUPERVISOR": drivers}, decisions=48)
    assert found.checks["decision"] == 48
    assert found.checks["driver"] == 6


def test_the_five_level_drive_over_the_pins() -> None:
    assert bench(TWO, decisions=39).checks["decision"] == 39


def test_the_papers_explorers_are_told() -> None:
    assert bench(PAPER).checks["built in"] >= 6


@pytest.mark.parametrize("divide", [2, 4])
def test_the_cores_clock_is_divided(divide: int) -> None:
    assert bench({**MPTC, "DIVIDE": divide}, "divided").checks["divided"] == 1


def with_a_clock(folder: Path, rtl: Path = RTL) -> Path:
    """The design with the stand-in for a PLL."""
    copy = folder / "with_a_clock"
    shutil.copytree(rtl, copy)
    shutil.copy(HERE / "board_clock.vhd", copy)
    return copy


def monitored(folder: Path, rtl: Path = RTL) -> Outcome:
    generics = {**MPTC, "PLL": True, "CLOCK_HZ": 5_000_000, "BAUD": 500_000}
    return bench(generics, "monitored", rtl=with_a_clock(folder, rtl))


def test_a_lost_clock_holds_the_reset_and_the_gates(tmp_path: Path) -> None:
    assert monitored(tmp_path).checks["clock"] == 5


SPEED = "omega_r        => measurements(79 downto 64)"
FAULTS = [
    Fault("board_top", "since_start /= 15", "since_start /= 14", "reset:"),
    Fault("board_top", SPEED, SPEED.replace("79 downto 64", "95 downto 80"), "decision:"),
    Fault("board_top", 'x"00" & gates_now', 'x"01" & gates_now', "gates:"),
    Fault("board_top", "not permitted or", "", "faults:"),
    Fault(
        "board_top",
        "held_high     <= (others => '1');",
        "held_high <= (others => rst);",
        "held high:",
    ),
]


@pytest.mark.parametrize(
    "fault", FAULTS, ids=["reset", "measurement", "gates", "permit", "held high"]
)
def test_a_fault_is_seen(fault: Fault, tmp_path: Path) -> None:
    assert_seen(fault, tmp_path, lambda rtl: bench(MPTC, decisions=48, rtl=rtl))


def test_a_wrong_divider_is_seen(tmp_path: Path) -> None:
    fault = Fault("board_top", "half when DIVIDE = 2", "half when DIVIDE = 4", "divided:")
    assert_seen(fault, tmp_path, lambda rtl: bench({**MPTC, "DIVIDE": 4}, "divided", rtl=rtl))


TO_DRIVERS = (
    "\n      )\n      port map (\n        clk             => core_clock,\n"
    "        asynchronous(0) => driver"
)


@pytest.mark.parametrize(
    ("unit", "text", "fault", "drivers"),
    [
        ("board_top", "not (said(0) and said(1))", "not said(0)", True),
        ("board_top", "not (said(0) and said(1))", "not said(1)", True),
        ("board_top", f"STAGES => 2{TO_DRIVERS}", f"STAGES => 3{TO_DRIVERS}", True),
        ("board_top", "driver_fault <= '0';", "driver_fault <= not driver_fault_n;", False),
        ("mptc_system", "=> driver_fault,", "=> '0',", True),
    ],
    ids=["fault alone", "ready alone", "late", "not wired", "not told"],
)  # fmt: skip
def test_a_driver_that_is_not_heard_is_seen(
    unit: str, text: str, fault: str, drivers: bool, tmp_path: Path
) -> None:
    seen = Fault(unit, text, fault, "driver:")
    chosen = {**MPTC, "DRIVERS": drivers}
    assert_seen(seen, tmp_path, lambda rtl: bench(chosen, decisions=48, rtl=rtl))


def test_an_oscillator_that_nobody_watches_is_seen(tmp_path: Path) -> None:
    fault = Fault("board_top", " or not second_clock", "", "second clock:")
    assert_seen(fault, tmp_path, lambda rtl: monitored(tmp_path, rtl))


def test_a_wrong_limit_of_the_clock_is_seen(tmp_path: Path) -> None:
    fault = Fault("board_top", "100_000 + 3", "100_000 + 2", "clock:")
    assert_seen(fault, tmp_path, lambda rtl: monitored(tmp_path, rtl))
