"""Paper A's linear extrapolation: its correction factor p and its length L, chosen for a drive.

Paper A predicts the stator current L steps on with one Euler step of length L T_s, corrected by
``p (L T_s omega_r)^2 psi_r`` (eq. 14a, A_2), turns the reference with the Euler rotation
A_0 (eq. 14b), and interpolates in between (eq. 20). A second-order expansion of the machine gives
p = X_m/(2D) in the limit of small L; the paper's 0.21096 belongs to a machine it does not state and
matches no realistic leakage this way, so p is fitted here to the drive at hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.machine import InductionMachine, discretise

LENGTHS = (1, 2, 4, 8, 16, 32, 64)
"""Extrapolation lengths looked at: powers of two, so that a division by L is a shift."""

SPEEDS = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Speeds, per unit, over which the prediction error of a length is averaged."""


@dataclass(frozen=True)
class Correction:
    """Fitted correction of the Euler step.

    Attributes
    ----------
    length
        L, steps.
    p
        Correction factor of Paper A, eqs. (4), (9b) and (14).
    rms_error, max_error
        Of the current rows against the exact A_d(L T_s), over the speeds of the fit, per unit of
        current for a state of 1 (both columns: current and flux).
    """

    length: int
    p: float
    rms_error: float
    max_error: float


@dataclass(frozen=True)
class Extrapolation:
    """A length with its correction and the prediction error of both together.

    Attributes
    ----------
    correction
        The fitted correction for this length.
    rms_error, max_error
        Of the predicted current error i* - i over the steps 1 to `span`, per unit.
    """

    correction: Correction
    rms_error: float
    max_error: float


def fit_correction(
    machine: InductionMachine, ts: float, length: int, speeds: Sequence[float]
) -> Correction:
    """Fit p by least squares to the current rows of the exact machine.

    Parameters
    ----------
    machine : InductionMachine
        Machine, per unit.
    ts : float
        Sampling interval, per unit.
    length : int
        L, steps.
    speeds : sequence of float
        Rotor speeds to fit over, per unit; not all zero.

    Returns
    -------
    Correction
        p and what remains.

    Raises
    ------
    ValueError
        If the length is below 1 or all speeds are zero.
    """
    if length < 1 or not any(speeds):
        raise ValueError("a length of at least 1 and a speed other than 0 are needed")
    h = length * ts
    m = machine
    omega = np.asarray(speeds, dtype=np.float64)
    exact = np.array([discretise(m.tau_s, m.tau_r, m.xm, m.xr, m.d, w, h)[:2] for w in omega])
    current = exact[:, 0] - (1 - h / m.tau_s)
    flux = exact[:, 1] - m.xm / m.d * h * (1 / m.tau_r - 1j * omega)
    square = (h * omega) ** 2
    p = float(np.sum(flux.real * square) / np.sum(square**2))
    residual = np.hypot(np.abs(current), np.abs(flux - p * square))
    return Correction(length, p, float(np.sqrt(np.mean(residual**2))), float(np.max(residual)))


def typical_span(drive: Drive) -> int:
    """Steps in which one level of voltage error takes a current to its bound, at most the horizon.

    One level on one phase is a space vector of (2/3) (v_dc/4). Most candidates live about that
    long, so it is there that the prediction has to be right: a length that fits whole trajectories
    through the bounds, several times longer, mistakes the many candidates that end early.

    Parameters
    ----------
    drive : Drive
        Its machine, sampling interval, v_dc, current bound and horizon count.

    Returns
    -------
    int
        Steps, 1 to the horizon.
    """
    m = drive.machine
    slope = m.xr / m.d * drive.ts_pu * drive.inverter.vdc / 6
    return max(1, min(drive.control.horizon, round(drive.control.bound_current / slope)))


def _prediction_errors(
    drive: Drive, length: int, p: float, speeds: Sequence[float], span: int
) -> NDArray[np.float64]:
    """|error| of the linear prediction of i* - i in steady state, shape (speeds, span), per unit.

    The state is that of rated current and flux, the voltage that which would keep the current on
    its reference: every candidate adds to it a response that both predict nearly alike.
    """
    m, h = drive.machine, drive.ts_pu
    rated = abs(m.steady_state(1.0, current=1.0, voltage=1.0).psi_r)
    steps = np.arange(1, span + 1)
    errors = np.empty((len(speeds), span))
    for row, omega_s in enumerate(speeds):
        point = m.steady_state(omega_s, current=1.0, flux=rated)
        w, i, psi, v = point.omega_r, point.i_s, point.psi_r, point.v_s
        hl = length * h
        linear = i * (1 + 1j * omega_s * hl) - (
            (1 - hl / m.tau_s) * i
            + (m.xm / m.d * hl * (1 / m.tau_r - 1j * w) + p * (hl * w) ** 2) * psi
            + m.xr / m.d * hl * v
        )
        for column, step in enumerate(steps):
            a11, a12, _, _, b1, _ = discretise(m.tau_s, m.tau_r, m.xm, m.xr, m.d, w, step * h)
            exact = i * np.exp(1j * omega_s * step * h) - (a11 * i + a12 * psi + b1 * v)
            errors[row, column] = abs(exact - linear * step / length)
    return errors


def compare_lengths(
    drive: Drive, lengths: Sequence[int] = LENGTHS, speeds: Sequence[float] = SPEEDS
) -> list[Extrapolation]:
    """Fit p for each length and state how well the linear prediction then does.

    Parameters
    ----------
    drive : Drive
        Drive whose machine, sampling interval, bounds and horizon count.
    lengths : sequence of int
        Lengths to compare, steps.
    speeds : sequence of float
        Stator frequencies to average over, per unit; not all zero.

    Returns
    -------
    list of Extrapolation
        In the order of `lengths`.

    Raises
    ------
    ValueError
        If a length is below 1 or all speeds are zero.
    """
    span = typical_span(drive)
    result = []
    for length in lengths:
        correction = fit_correction(drive.machine, drive.ts_pu, length, speeds)
        errors = _prediction_errors(drive, length, correction.p, speeds, span)
        result.append(
            Extrapolation(correction, float(np.sqrt(np.mean(errors**2))), float(np.max(errors)))
        )
    return result


def choose_extrapolation(drive: Drive) -> tuple[int, float]:
    """Choose L and p of Paper A's extrapolation for a drive.

    The criterion: the least root-mean-square error of the predicted current error i* - i over the
    steps 1 to `typical_span` and over the speeds `SPEEDS`, at rated current and flux; the shorter
    length on a tie.

    Parameters
    ----------
    drive : Drive
        Its machine, sampling interval, v_dc, current bound and horizon count.

    Returns
    -------
    length : int
        L in steps, a power of two.
    p : float
        The correction fitted for it (Paper A, eqs. 4, 9b and 14).
    """
    best = min(compare_lengths(drive), key=lambda e: (e.rms_error, e.correction.length))
    return best.correction.length, best.correction.p


def format_table(drive: Drive) -> str:
    """Lay out the comparison of all lengths, the chosen one marked, as text.

    Parameters
    ----------
    drive : Drive
        As in `choose_extrapolation`.

    Returns
    -------
    str
        p, its error and the error of the prediction (both per unit) for each of `LENGTHS`.
    """
    m = drive.machine
    chosen, _ = choose_extrapolation(drive)
    lines = [
        f"correction p by least squares over omega_r = {SPEEDS[0]:g} to {SPEEDS[-1]:g} pu; "
        f"X_m/(2D) = {m.xm / (2 * m.d):.4f}",
        f"prediction error of i* - i at rated current and flux over {typical_span(drive)} steps "
        f"(bound {drive.control.bound_current:g} pu)",
        "",
        "      L         p   A_d(L) rms   A_d(L) max   prediction rms   prediction max",
    ]
    for entry in compare_lengths(drive):
        c = entry.correction
        mark = "  <- chosen" if c.length == chosen else ""
        lines.append(
            f"   {c.length:4d}  {c.p:8.5f}   {c.rms_error:10.5f}   {c.max_error:10.5f}"
            f"   {entry.rms_error:14.5f}   {entry.max_error:14.5f}{mark}"
        )
    return "\n".join(lines)
