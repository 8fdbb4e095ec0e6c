"""The RTL in closed loop, from measured currents alone: start, load step, reversal, torque step.

Sweep: MPTC and MPFC; the verified machine.
Stimulus: motulator's machine and inverter (a plant that is not ours) at 20 kHz; `mptc_drive`, that
is observer, pre-excitation and core, decides, as its netlist in Verilator, behind a speed PI; a
short loop of `mptc_core` in GHDL with our own plant, the flux given.
Checks: speed, torque, flux and current are where they have to be; every decision, flag and
estimate is the twin's; a netlist that is not the twin's ends the loop.
Timing: 40 and 79 clocks from start to valid; a torque step 0 to 120 % at 150 r/min rises (10 to
90 %) in less than 1 ms.
Does not prove: anything about dead time or measurement noise, which the plant does not have. The
shaft is light (0.002 kg*m^2) to keep the runs short; `make report` runs the heavier one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from directmpc import motulator
from directmpc.mptc import closed_loop
from directmpc.mptc import drive_twin as joined
from directmpc.mptc.closed_loop import RPM
from directmpc.states import MptcState
from scripts.hdl import mptc_drive_loop as rtl_loop
from scripts.hdl.simulator import SimulationError
from scripts.studies import mptc_loop
from tb.helpers import mptc_rows as core

INERTIA = 0.002  # kg*m^2
RATED, PSI, LOAD = 14.0, 0.9, 7.0
LEGS = (1450, 350, 150, 1050)  # periods, see `rtl_loop.tour`


@pytest.mark.parametrize("method", core.METHODS)
def test_start_load_step_and_reversal(method: str) -> None:
    drive = core.shipped("motulator_2kw2").with_control(method=method)
    scenario, words = rtl_loop.tour(drive, PSI, LOAD, INERTIA, LEGS)
    with rtl_loop.controller(drive, words) as rtl:
        found = motulator.simulate(drive, scenario, rtl, inertia=INERTIA)
    rpm = found.trace.omega_r / drive.machine.pole_pairs / RPM
    started, loaded, freed = np.cumsum(LEGS[:3])
    magnetised = int(np.argmax(found.flux > 0.98 * PSI))
    assert 600 < magnetised < 1100
    assert np.abs(rpm[:magnetised]).max() < 30.0, "magnetising makes no torque to speak of"
    assert np.hypot(*found.trace.i_s.T)[: magnetised + 1].max() < 9.8, "8 A and two periods"
    assert abs(rpm[started - 1] - 1500.0) < 60.0
    assert rpm[started:loaded].min() < rpm[started - 1] - 40.0, "the load is felt"
    assert abs(found.torque[loaded - 100 : loaded].mean() - LOAD) < 0.5
    assert rpm[freed] > 1400.0
    assert abs(rpm[-1] + 1500.0) < 60.0
    reversing = slice(freed + 40, freed + 600)
    assert found.torque[reversing].mean() < -0.95 * 1.2 * RATED
    assert found.saturated.sum() == 0
    held = found.flux[magnetised + 20 :]
    assert held.min() > PSI - 0.06
    assert held.max() < PSI + 0.06
    assert np.hypot(*found.trace.i_s.T).max() < 13.0


def test_an_rtl_that_is_not_its_twin_ends_the_loop() -> None:
    drive = core.shipped("motulator_2kw2")
    words = joined.parameters(drive, limit=8.0, flux=PSI)
    weight = words.core.copy()
    with rtl_loop.controller(drive, words._replace(core=weight)) as rtl:
        weight[4] += 4  # the twin's alone, after the RTL was told: another voltage drop
        states = (MptcState(complex(5.0, 0.01 * k), 0j, 100.0, 3.0, PSI) for k in range(2000))
        with pytest.raises(SimulationError, match="mptc_drive"):
            list(map(rtl.decide, states))


@pytest.mark.parametrize("method", core.METHODS)
def test_torque_step_rises_in_less_than_a_millisecond(method: str) -> None:
    drive = core.shipped("motulator_2kw2").with_control(method=method)
    steady = closed_loop.constant(drive, 150.0, 0.0, PSI, 1400)
    # observer and machine begin without flux; a turning machine is magnetised by the core
    begin = 1300
    wanted = np.where(np.arange(1400) < begin, 0.0, 1.2 * RATED)
    scenario = replace(steady, torque_ref=wanted, current=0j, flux=0j)
    with rtl_loop.controller(drive, joined.parameters(drive)) as rtl:
        found = motulator.simulate(drive, scenario, rtl)
    torque = found.torque[begin:]
    rise = [int(np.argmax(torque >= share * 1.2 * RATED)) for share in (0.1, 0.9)]
    assert np.abs(found.torque[begin - 100 : begin]).mean() < 1.5
    assert 0 < rise[0] < rise[1]
    assert (rise[1] - rise[0]) * found.ts < 1e-3


def test_loop_in_ghdl_is_the_twins() -> None:
    drive = core.shipped("motulator_2kw2")
    point = mptc_loop.Point(900.0, 7.0, 0.95)
    found = mptc_loop.simulate(drive, point, 150)
    scenario = closed_loop.constant(drive, 900.0, 0.0, 0.95, 150)
    scenario = replace(scenario, torque_ref=found.trace.torque_ref)
    wanted = closed_loop.simulate(drive, scenario)
    np.testing.assert_array_equal(found.decisions.u, wanted.u)
    np.testing.assert_array_equal(found.trace.i_s, wanted.trace.i_s)
