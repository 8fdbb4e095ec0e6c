"""PWM of the default converter with the exact plant, from event to event.

The voltage reference is the machine's steady-state voltage at the operating point, without a
current controller. Carriers are synchronous: a whole number of them lies in a fundamental period.
Switching instants are exact. The state is recorded at intervals of the drive file's control period,
as it is in the closed loops of MPDCC.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from directmpc.compiled import njit
from directmpc.distortion import thd
from directmpc.loads.load import CLARKE_INVERSE, FloatArray
from directmpc.mpdcc import metrics
from directmpc.mpdcc.closed_loop import OperatingPoint, constant_profile, initial_conditions
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.plant import STATES, plant_advance, plant_data, plant_step
from directmpc.mpdcc.trace import IntArray
from scripts.studies.pwm_modulator import Modulator, half_period, with_common_mode

IDEAL = 1e9
"""Reactance of a capacitor whose voltage does not move, per unit."""


@dataclass(frozen=True)
class PwmRun:
    """A recorded run."""

    state: FloatArray  #: (n, 8): plant state every control period, see `directmpc.mpdcc.plant`.
    positions: IntArray  #: (m + 1, 3): positions before the first event and after each of them.
    seconds: float  #: Length of the recorded run.
    thd: float  #: Root mean square over the phases of the currents' THD, a ratio.
    fsw: float  #: Switching frequency, mean over 24 logical devices, Hz.
    #: Largest deviation of v_n and of a v_ph from its nominal value, per unit.
    peak_vn: float
    peak_vph: float
    #: Volts that no pair of positions could make: rms over phases and half periods, per unit.
    missed: float


@njit
def _advance(plant, state, applied, omega_r, vdc, clock, until, states):
    """Advance to a time; `clock` holds now, the next sample's time and its number."""
    while True:
        sample = clock[2] < len(states) and clock[1] <= until
        stop = clock[1] if sample else until
        time = stop - clock[0]
        if abs(time - plant.ts) < 1e-9 * plant.ts:
            plant_step(plant, state, applied, omega_r, vdc)
        elif time > 0.0:
            plant_advance(plant, state, applied, omega_r, vdc, time)
        clock[0] = stop
        if not sample:
            return
        states[int(clock[2])] = state
        clock[1] += plant.ts
        clock[2] += 1.0


@njit
def _run(
    plant, modulator, state, applied, omega_s, omega_r, voltage, half, halves, settle, states,
    events,
):  # fmt: skip
    """Run `halves` half periods, of which `settle` are not kept; events kept, and missed volts."""
    vdc = modulator.vdc
    first, second = np.empty(3, np.int64), np.empty(3, np.int64)
    shares, v_abc, currents = np.empty(3), np.empty(3), np.empty(3)
    clock = np.array([0.0, settle * half, 0.0])
    # mean of a rotating voltage over a half period, of its value in the middle
    flat = math.sin(0.5 * omega_s * half) / (0.5 * omega_s * half)
    event, missed = 0, 0.0
    for k in range(halves):
        turned = flat * voltage * cmath.exp(1j * omega_s * (k + 0.5) * half)
        for x in range(3):
            v_abc[x] = (turned * cmath.exp(-2j * math.pi / 3.0 * x)).real
        wanted = with_common_mode(v_abc, vdc)
        # the measured currents, turned on to the middle
        turned = complex(state[0], state[1]) * cmath.exp(0.5j * omega_s * half)
        for x in range(3):
            currents[x] = (turned * cmath.exp(-2j * math.pi / 3.0 * x)).real
        lost = half_period(
            modulator, applied, wanted, state[4:], currents, half, k % 2 == 0, first, second, shares
        )
        if k == settle:
            events[0] = applied
            event = 1
        applied[:] = first
        if k >= settle:
            missed += lost
            events[event] = applied
            event += 1
        for x in np.argsort(shares):
            if shares[x] < 1.0:
                _advance(plant, state, applied, omega_r, vdc, clock, (k + shares[x]) * half, states)
                applied[x] = second[x]
                if k >= settle:
                    events[event] = applied
                    event += 1
        _advance(plant, state, applied, omega_r, vdc, clock, (k + 1) * half, states)
    return event, missed


def simulate(
    drive: Drive, speed: float, pulses: int, periods: int, settle: int, *, ideal: bool, phase: float
) -> PwmRun:
    """Run the modulator at rated current, from the steady state."""
    profile = constant_profile(drive, OperatingPoint(speed), 1, phase)
    state, applied = initial_conditions(profile)
    xdc, xph = (IDEAL, IDEAL) if ideal else (drive.inverter.xdc, drive.inverter.xph)
    vdc = float(drive.inverter.vdc)
    plant = plant_data(drive.machine, xdc, xph, drive.ts_pu)
    start = profile.start
    voltage = start.v_s * profile.iref[0] / start.i_s
    half = math.pi / (speed * pulses)
    kept = 2 * pulses * periods
    states = np.empty((math.floor(kept * half / drive.ts_pu), STATES))
    events = np.empty((4 * kept + 1, 3), np.int64)
    count, missed = _run(
        plant, Modulator(vdc, xdc, xph), state, applied, speed, float(profile.omega_r[0]),
        complex(voltage), half, kept + 2 * pulses * settle, 2 * pulses * settle, states, events,
    )  # fmt: skip
    positions = events[:count].copy()
    seconds = kept * half * drive.control.ts / drive.ts_pu
    distortion = thd(states[:, :2] @ CLARKE_INVERSE.T, speed, drive.ts_pu)
    switching = metrics.switching_frequency(positions, seconds / (count - 1))
    return PwmRun(
        state=states,
        positions=positions,
        seconds=seconds,
        thd=float(np.sqrt(np.mean(distortion**2))),
        fsw=switching.per_device,
        peak_vn=float(np.abs(states[:, 4]).max()),
        peak_vph=float(np.abs(states[:, 5:] - vdc / 4).max()),
        missed=math.sqrt(missed / (3 * kept)),
    )
