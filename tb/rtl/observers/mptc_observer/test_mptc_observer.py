"""Steps of the stator-flux observer, one right behind the other.

Stimulus: random measurements; the next `start` in the clock of `valid`; inputs are anything in
every clock but the start's.
Checks: every estimate is the twin's; `valid` and `busy` in every clock.
Timing: a step takes the published clocks; a new one may begin with `valid`.
Does not prove: coefficients of any content; test_mptc_helpers has them, with pauses.
"""

from __future__ import annotations

from pathlib import Path

from scripts.hdl.sources import RTL
from tb.helpers.faults import seen
from tb.helpers.simulation import Outcome, run


def bench(steps: int = 60, rtl: Path = RTL) -> Outcome:
    return run("mptc_observer", arguments={"seed": 3, "steps": steps}, rtl=rtl)


def test_a_step_may_begin_with_the_end_of_the_last() -> None:
    assert bench().checks["estimate"] == 60


PROGRAM = "mptc_observer_program"


test_a_fault_is_seen = seen(
    PROGRAM,
    bench,
    ("LAST_AT : natural := 37", "LAST_AT : natural := 38", r"busy:"),
    ("VALID_AT : natural := 37", "VALID_AT : natural := 36", r"valid:"),
    ("if (active = '0') then", "if (false) then", r"estimate:|saturated", "mptc_observer"),
)
