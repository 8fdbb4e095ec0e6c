"""Figures of merit of a closed-loop run: distortion, switching frequency, bounds, shares."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from directmpc.converter import INADMISSIBLE, Converter
from directmpc.distortion import thd
from directmpc.loads.load import CLARKE_INVERSE, FloatArray
from directmpc.mpdcc import tables
from directmpc.mpdcc.closed_loop import ClosedLoopResult
from directmpc.mpdcc.drive import PerUnitDrive
from directmpc.mpdcc.trace import IntArray


@dataclass(frozen=True)
class SwitchingFrequency:
    """Average switching frequency, from turn-on counts, Hz."""

    per_device: float  # Over the switches of three legs
    per_physical_device: float  # Over their devices, those in series counted each
    # Over the switches of each group that the converter's file has, by its name.
    by_group: dict[str, float]


@dataclass(frozen=True)
class Summary:
    """Figures of merit of one run."""

    thd: FloatArray  # (3,): Total harmonic distortion of each phase current, a ratio (0.05 is 5 %)
    thd_mean: float  # Root mean square of the three
    switching: SwitchingFrequency  # Average switching frequencies, Hz
    # (7,): Largest excess over the bound per output [i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c],
    # per unit; 0 where the bound was never exceeded.
    violations: FloatArray
    held_share: float  # Share of steps in which the positions were held without a search
    deadlock_share: float  # Share of searches that ended in a deadlock; 0 if there was no search


def switching_frequency(
    positions: IntArray, ts: float, leg: Converter | None = None
) -> SwitchingFrequency:
    """Average switching frequency of positions (n + 1, 3), the first before the run; `ts` in s.

    ValueError if there is less than a step or a transition that the leg does not have.
    """
    leg = leg or tables.leg_of(tables.DEFAULT)
    before, after = positions[:-1], positions[1:]
    if not len(after):
        raise ValueError("at least one step is needed")
    steps = leg.turn_ons()[before, after]
    if np.any(steps == INADMISSIBLE):
        step = int(np.argmax(np.any(steps == INADMISSIBLE, axis=1)))
        raise ValueError(f"inadmissible transition {before[step]} to {after[step]} in step {step}")
    time = len(after) * ts
    # switches and turn-ons of each kind: by group, and by devices in series
    kinds = Counter((switch.group, switch.devices) for switch in leg.switches)
    turned = {kind: int(leg.turn_ons(*kind)[before, after].sum()) for kind in kinds}
    groups = Counter(switch.group for switch in leg.switches)
    return SwitchingFrequency(
        per_device=sum(turned.values()) / (leg.logical_devices * time),
        per_physical_device=sum(n * count for (_, n), count in turned.items())
        / (leg.physical_devices * time),
        by_group={
            name: sum(count for kind, count in turned.items() if kind[0] == name)
            / (3 * size * time)
            for name, size in groups.items()
        },
    )


def deviations(result: ClosedLoopResult) -> FloatArray:
    """Distance of outputs from references (n, 7), per unit, not negative (Paper A, eq. 8).

    i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c.
    """
    n = len(result)
    reference = np.column_stack([result.profile.iref.real, result.profile.iref.imag])
    currents = (reference - result.state[:n, :2]) @ CLARKE_INVERSE.T
    neutral = result.state[:n, 4:5]
    capacitors = result.state[:n, 5:] - result.leg.capacitor_share * result.profile.vdc[:, None]
    return np.abs(np.hstack([currents, neutral, capacitors]))


def bound_violations(result: ClosedLoopResult, bounds: FloatArray) -> FloatArray:
    """Largest excess over each bound (7,), per unit; 0 where there is none (Paper A, eq. 8)."""
    return np.maximum(deviations(result).max(axis=0) - bounds, 0.0)


def summarise(drive: PerUnitDrive, result: ClosedLoopResult) -> Summary:
    """Figures of merit of a run at constant omega_s: a ratio, Hz and per unit.

    ValueError if omega_s varies or the run does not cover one fundamental period.
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
        switching=switching_frequency(result.positions, drive.control.ts, drive.converter),
        violations=bound_violations(result, drive.bounds),
        held_share=float(result.decisions.held.mean()),
        deadlock_share=int(result.decisions.deadlock.sum()) / searches if searches else 0.0,
    )
