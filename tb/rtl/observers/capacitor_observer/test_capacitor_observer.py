"""Capacitor filters: the RTL against its twin.

Stimulus: a drive's coefficients and measurements with noise, words and positions of any content,
gains and coefficients that change between steps, positions of this step or of the next, resets;
`start` repeated while busy, any pause between steps; each voltage driven out of its word alone.
Checks: every output bit for bit, valid and busy in every clock; the outputs rest while the inputs
move between two steps; the flag is that of the step.
Timing: valid 11 clocks after start, busy 10.
Faults: signs, shares and places of the charges, wrong states and gains, positions of the wrong
step, each overflow untold, a state that survives a reset.
Does not prove: that the filters are good for a drive (tb/model/test_capacitor_observer.py).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run


def bench(steps: int, rtl: Path = RTL, *, alone: bool = False) -> Outcome:
    return run(
        "capacitor_observer",
        "tb.rtl.observers.capacitor_observer.bench_capacitor_observer",
        units=["capacitor_observer"],
        arguments={"seed": 6, "steps": steps, "alone": alone},
        rtl=rtl,
    )


def test_it_steps_as_its_twin() -> None:
    assert bench(900).checks["voltages"] >= 900


def test_every_overflow_is_told_by_itself() -> None:
    assert bench(0, alone=True).checks["voltages"] >= 24


ENTITY = "capacitor_observer"
TAKE = "not (neutral(1) xor neutral(2))"
FAULTS = {
    "sign": (ENTITY, "inverted <= charging(1);", "inverted <= discharging(1);"),
    "share": (ENTITY, TAKE, "(neutral(1) xor neutral(2))"),
    "half": (ENTITY, "shift_right(both, 1)", "both"),
    "place": (f"{ENTITY}_program", "(4, 4, 3, 0, -1)", "(4, 4, 2, 0, -1)"),
    "early take": (f"{ENTITY}_program", "3, 5, 7, 9, 2, 4, 6, 8", "3, 5, 7, 9, 2, 4, 5, 8"),
    "lane": (ENTITY, '(1 downto 0) := "11"', '(1 downto 0) := "10"'),
    "early gain": (ENTITY, "if (begun = '1') then", "if (begun /= 'X') then"),
    "open filter": (
        ENTITY,
        "filters_n  <= begun and (f_q_midpoint(0) or f_q_midpoint(1) or f_q_midpoint(2));",
        "filters_n  <= begun;",
    ),
    "wrong step": (ENTITY, "positions(2) <= before(2) when delayed = '1' else", "positions(2) <="),
    "rounding": (ENTITY, "half_lsb(SUM, SHIFT)", "half_lsb(SUM, SHIFT - 1)"),
    "wrap": (ENTITY, "following <= clip(value, STATE);", "following <= value(STATE - 1 downto 0);"),
    "survives a reset": (ENTITY, "begun    <= '0';", "null;"),
    "old current": (ENTITY, "previous(1) <= signed(is_beta);", "previous(1) <= signed(is_alpha);"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, *FAULTS[name])
    with pytest.raises(CheckError, match=r"(voltages|saturated): got"):
        bench(180, rtl)


WRITES = "write = '1' and clipped = '1'"
#: Overflows that are not told, or told for longer.
SILENT = {
    "phase a": ("saturated <= clipped;", "saturated <= '0';"),
    "phase b": (WRITES, f"{WRITES} and due(DUE_PHASE_B) = '0'"),
    "phase c": (WRITES, f"{WRITES} and due(DUE_PHASE_C) = '0'"),
    "midpoint": (WRITES, f"{WRITES} and due(DUE_MIDPOINT) = '0'"),
    "kept": ("saturated <= clipped;", "saturated <= saturated or clipped;"),
}


@pytest.mark.parametrize("name", SILENT)
def test_a_fault_is_told(name: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, ENTITY, *SILENT[name])
    with pytest.raises(CheckError, match="saturated"):
        bench(0, rtl, alone=True)
