"""Figures of merit of a closed-loop run: distortion, switching frequency, bounds, shares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from directmpc.distortion import thd
from directmpc.loads.load import CLARKE_INVERSE, FloatArray
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.closed_loop import ClosedLoopResult
from directmpc.mpdcc.drive import FiveLevelDrive
from directmpc.mpdcc.trace import IntArray


@dataclass(frozen=True)
class SwitchingFrequency:
    """Average switching frequency, from turn-on counts, Hz.

    Attributes
    ----------
    per_device_24_logical
        Over the 24 logical devices of three legs.
    per_device_36_physical
        Over the 36 physical devices: each of the 12 ANPC devices is two in series.
    per_fc_device, per_anpc_device
        Over the 12 flying-capacitor devices and over the 12 logical ANPC devices.
    """

    per_device_24_logical: float
    per_device_36_physical: float
    per_fc_device: float
    per_anpc_device: float


@dataclass(frozen=True)
class Summary:
    """Figures of merit of one run.

    Attributes
    ----------
    thd : (3,)
        Total harmonic distortion of each phase current, a ratio (0.05 is 5 %).
    thd_mean
        Root mean square of the three.
    switching
        Average switching frequencies, Hz.
    violations : (7,)
        Largest excess over the bound per output [i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c], per
        unit; 0 where the bound was never exceeded.
    held_share
        Share of steps in which the positions were held without a search.
    deadlock_share
        Share of searches that ended in a deadlock; 0 if there was no search.
    """

    thd: FloatArray
    thd_mean: float
    switching: SwitchingFrequency
    violations: FloatArray
    held_share: float
    deadlock_share: float


def switching_frequency(positions: IntArray, ts: float) -> SwitchingFrequency:
    """Average switching frequency of a sequence of positions.

    Parameters
    ----------
    positions : ndarray of int64, shape (n + 1, 3)
        Positions before the first step and during each of n steps, 0..7.
    ts : float
        Sampling interval in seconds.

    Returns
    -------
    SwitchingFrequency
        Hz.

    Raises
    ------
    ValueError
        If the sequence is shorter than one step or holds a transition the graph does not have.
    """
    before, after = positions[:-1], positions[1:]
    if not len(after):
        raise ValueError("at least one step is needed")
    stage, cell = anpc.COMMUTATIONS_ANPC[before, after], anpc.COMMUTATIONS_FC[before, after]
    if np.any(stage == anpc.INADMISSIBLE):
        step = int(np.argmax(np.any(stage == anpc.INADMISSIBLE, axis=1)))
        raise ValueError(f"inadmissible transition {before[step]} to {after[step]} in step {step}")
    time = len(after) * ts
    n_stage, n_cell = int(stage.sum()), int(cell.sum())
    return SwitchingFrequency(
        per_device_24_logical=(n_stage + n_cell) / (anpc.LOGICAL_DEVICES * time),
        per_device_36_physical=(2 * n_stage + n_cell) / (anpc.PHYSICAL_DEVICES * time),
        per_fc_device=n_cell / (12 * time),
        per_anpc_device=n_stage / (12 * time),
    )


def deviations(result: ClosedLoopResult) -> FloatArray:
    """Distance of each output from its reference at each recorded step (Paper A, eq. 8).

    Parameters
    ----------
    result : ClosedLoopResult
        n recorded steps.

    Returns
    -------
    ndarray of float64, shape (n, 7)
        Of i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c, per unit, not negative.
    """
    n = len(result)
    reference = np.column_stack([result.profile.iref.real, result.profile.iref.imag])
    currents = (reference - result.state[:n, :2]) @ CLARKE_INVERSE.T
    neutral = result.state[:n, 4:5]
    capacitors = result.state[:n, 5:] - result.profile.vdc[:, None] / 4
    return np.abs(np.hstack([currents, neutral, capacitors]))


def bound_violations(result: ClosedLoopResult, bounds: FloatArray) -> FloatArray:
    """Largest excess over the bound per output, per unit; 0 where there is none (Paper A, eq. 8).

    Parameters
    ----------
    result : ClosedLoopResult
        n recorded steps.
    bounds : ndarray of float64, shape (7,)
        Half widths of i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c, per unit.

    Returns
    -------
    ndarray of float64, shape (7,)
        In the order of `bounds`, per unit.
    """
    return np.maximum(deviations(result).max(axis=0) - bounds, 0.0)


def summarise(drive: FiveLevelDrive, result: ClosedLoopResult) -> Summary:
    """Collect the figures of merit of a run at constant omega_s.

    Parameters
    ----------
    drive : FiveLevelDrive
        Control period and bounds.
    result : ClosedLoopResult
        n recorded steps at one stator frequency.

    Returns
    -------
    Summary
        Distortion as a ratio, frequencies in Hz, violations per unit.

    Raises
    ------
    ValueError
        If omega_s varies, or the run does not cover one fundamental period.
    """
    omega_s = result.profile.omega_s
    if np.ptp(omega_s) != 0.0:
        raise ValueError("distortion is defined for a constant fundamental frequency only")
    currents = result.state[: len(result), :2] @ CLARKE_INVERSE.T
    distortion = thd(currents, float(omega_s[0]), result.ts)
    searches = len(result) - int(result.decisions.held.sum())
    return Summary(
        thd=distortion,
        thd_mean=float(np.sqrt(np.mean(distortion**2))),
        switching=switching_frequency(result.positions, drive.control.ts),
        violations=bound_violations(result, drive.bounds),
        held_share=float(result.decisions.held.mean()),
        deadlock_share=int(result.decisions.deadlock.sum()) / searches if searches else 0.0,
    )
