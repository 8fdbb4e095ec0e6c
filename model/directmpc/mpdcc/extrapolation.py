"""Paper A's linear extrapolation: its correction factor p and its length L, chosen for a drive.

Paper A predicts the stator current L steps on with one Euler step of length L T_s, corrected by
``p (L T_s omega_r)^2 psi_r`` (eq. 14a, A_2), turns the reference with the Euler rotation
A_0 (eq. 14b), and interpolates in between (eq. 20). Only the product p L enters the slopes. A
second-order expansion of the machine gives p = X_m/(2D) in the limit of small L, and p is fitted
here to the drive at hand. With L = 1 the paper's 0.21096 matches no realistic leakage. With L = 64
its product is that of p = X_m/(2D) and L near 5: docs/evidence.md. Keys of the drive file set both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from directmpc.loads.load import Load, discretise
from directmpc.mpdcc.drive import Drive

LENGTH_HIGH = 64
"""Longest L. Paper A's L are powers of two, for its division; here L enters a coefficient alone."""

SHOWN = (1, 2, 4, 8, 16, 32, 64)
"""Lengths that the table shows, beside the chosen one."""

SPEEDS = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Speeds, per unit, over which the prediction error of a length is averaged."""

BAND = 1.5
"""Half widths of the bound that a current crosses in `typical_span`; chosen by THD and switching
frequency of closed loops at rated speed: docs/evidence.md."""


@dataclass(frozen=True)
class Correction:
    """Fitted correction of the Euler step."""

    length: int  # L, steps
    p: float  # Correction factor of Paper A, eqs. (4), (9b) and (14)
    # rms_error, max_error: Of the current rows against the exact A_d(L T_s), over the speeds of the
    # fit, per unit of current for a state of 1 (both columns: current and flux).
    rms_error: float
    max_error: float


@dataclass(frozen=True)
class Extrapolation:
    """A length with its correction and the prediction error of both together."""

    correction: Correction  # The fitted correction for this length
    # rms_error, max_error: Of the predicted current error i* - i over the steps 1 to `span`, per
    # unit.
    rms_error: float
    max_error: float


def fit_correction(load: Load, ts: float, length: int, speeds: Sequence[float]) -> Correction:
    """Fit p by least squares to the current rows of the exact load.

    All per unit; `length` is L in steps, at least 1, and a speed is not zero.
    """
    if length < 1 or not any(speeds):
        raise ValueError("a length of at least 1 and a speed other than 0 are needed")
    h = length * ts
    m = load.matrices
    omega = np.asarray(speeds, dtype=np.float64)
    exact = np.array([discretise(m, w, h)[:2] for w in omega])
    current = exact[:, 0] - (1 + h * m.a0[0, 0])
    flux = exact[:, 1] - h * (m.a0[0, 1] + 1j * omega * m.a1[0, 1])
    square = (h * omega) ** 2
    p = float(np.sum(flux.real * square) / np.sum(square**2))
    residual = np.hypot(np.abs(current), np.abs(flux - p * square))
    return Correction(length, p, float(np.sqrt(np.mean(residual**2))), float(np.max(residual)))


def typical_span(drive: Drive) -> int:
    """Steps over which the prediction is to be right, at most the horizon.

    One level of voltage error on one phase is a space vector of (2/3) (v_dc/4). In these steps it
    takes a current through `BAND` half widths of its bound: candidates that are chosen live about
    that long. A shorter span predicts the many candidates that end early better, and more decisions
    are those of the ideal controller, but the loop's THD is too low: docs/evidence.md.
    """
    slope = drive.machine.matrices.b[0] * drive.ts_pu * drive.inverter.vdc / 6
    span = round(BAND * drive.control.bound_current / slope)
    return max(1, min(drive.control.horizon, span))


def compare_lengths(
    drive: Drive, lengths: Sequence[int], speeds: Sequence[float] = SPEEDS
) -> list[Extrapolation]:
    """Fit p for each length and state how well the linear prediction of i* - i then does.

    Lengths in steps, speeds per unit. The state is that of rated current and flux, the voltage that
    which would keep the current on its reference: every candidate adds to it a response that both
    predict nearly alike.
    """
    load, m, h = drive.machine, drive.machine.matrices, drive.ts_pu
    points = [load.steady_state(omega_s) for omega_s in speeds]
    steps = np.arange(1, typical_span(drive) + 1)
    exact = np.empty((len(points), len(steps)), dtype=np.complex128)
    for row, (omega_s, at) in enumerate(zip(speeds, points, strict=True)):
        for column, step in enumerate(steps):
            a11, a12, _, _, b1, _ = discretise(m, at.omega_r, step * h)
            ahead = a11 * at.i_s + a12 * at.psi_r + b1 * at.v_s
            exact[row, column] = at.i_s * np.exp(1j * omega_s * step * h) - ahead
    result = []
    for length in lengths:
        correction = fit_correction(load, h, length, speeds)
        hl = length * h
        line = np.array(
            [
                at.i_s * (1j * omega_s - m.a0[0, 0])
                - (m.a0[0, 1] + 1j * at.omega_r * m.a1[0, 1]) * at.psi_r
                - correction.p * hl * at.omega_r**2 * at.psi_r
                - m.b[0] * at.v_s
                for omega_s, at in zip(speeds, points, strict=True)
            ]
        )
        errors = np.abs(exact - h * line[:, None] * steps)
        result.append(
            Extrapolation(correction, float(np.sqrt(np.mean(errors**2))), float(np.max(errors)))
        )
    return result


def choose_extrapolation(drive: Drive) -> tuple[int, float]:
    """L (steps) and p of Paper A's extrapolation (eqs. 4, 9b and 14): keys, or a choice for "auto".

    The criterion of L: the least root-mean-square error of the predicted current error i* - i over
    the steps 1 to `typical_span` and over the speeds `SPEEDS`, at rated current and flux; the
    shorter length on a tie. p is then the one that fits L.
    """
    length, p = drive.control.extrapolation, drive.control.correction
    if length == "auto":
        # what is best over a span is about as long as it
        lengths = range(1, min(LENGTH_HIGH, 2 * typical_span(drive)) + 1)
        best = min(
            compare_lengths(drive, lengths), key=lambda e: (e.rms_error, e.correction.length)
        )
        length = best.correction.length
    if p == "auto":
        p = fit_correction(drive.machine, drive.ts_pu, length, SPEEDS).p
    return length, p


def format_table(drive: Drive) -> str:
    """Lengths `SHOWN` as text: p, its error and the prediction's, per unit; the choice marked."""
    a1 = drive.machine.matrices.a1
    chosen, p = choose_extrapolation(drive)
    lines = [
        f"correction p by least squares over omega_r = {SPEEDS[0]:g} to {SPEEDS[-1]:g} pu; "
        f"X_m/(2D) = {-(a1 @ a1)[0, 1] / 2:.4f}",
        f"prediction error of i* - i at rated current and flux over {typical_span(drive)} steps "
        f"(bound {drive.control.bound_current:g} pu)",
        "",
        "      L         p   A_d(L) rms   A_d(L) max   prediction rms   prediction max",
    ]
    for entry in compare_lengths(drive, sorted({*SHOWN, chosen})):
        c = entry.correction
        mark = "  <- chosen" if c.length == chosen else ""
        lines.append(
            f"   {c.length:4d}  {c.p:8.5f}   {c.rms_error:10.5f}   {c.max_error:10.5f}"
            f"   {entry.rms_error:14.5f}   {entry.max_error:14.5f}{mark}"
        )
    lines += ["", f"the variant paper takes L = {chosen}, p = {p:.5f}"]
    return "\n".join(lines)
