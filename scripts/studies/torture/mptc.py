"""The decisions of MPTC and MPFC once more: the machine in SI and float64, many states at a time.

Written from docs/specification.md, sections 1.4, 3 and 9.2, in flux linkages instead of current
and flux, without anything of ``directmpc.mptc`` but the widths of its words. Heun's method and the
Euler step behind it give the same in any linear coordinates.

It knows no rounding. So it does not ask whether the bit-true twin takes the same vector, but
whether the vector that it takes costs more than the best one by more than rounding explains. What
words of 17 fractional bits can be off is counted in `allowance`; what saturates is far beyond.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.mptc import formats as f
from directmpc.mptc.drive import MptcDrive

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]

#: Section 3.1: switch states of u_0 to u_7.
SWITCHES = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1], [1, 0, 1], [1, 1, 1]]
)
_TURN = np.exp(2j * np.pi / 3 * np.arange(3))
#: u_j for a dc-link voltage of 1.
VECTORS = 2 / 3 * (SWITCHES * _TURN).sum(axis=1)
VECTORS[[0, 7]] = 0

#: Words that a state at k+2 can be off: products of rounded coefficients, and rounded sums.
WORDS_OFF = 4
#: Least rotor flux, of its base, with which the angle of MPFC's reference is looked at.
LEAST_ROTOR = 1 / 16


def zero_from(u: IntArray) -> IntArray:
    """The number of zero voltage that takes fewer commutations from a vector; 0 of equal ones."""
    ones = SWITCHES[u].sum(axis=1)
    return np.where(3 - ones < ones, 7, 0)


@dataclass(frozen=True)
class Judged:
    """Costs of all vectors for n states."""

    cost: FloatArray  #: (n, 7): g in N m or J in Wb, of zero voltage and u_1 to u_6.
    allowance: FloatArray  #: (n,): what rounding may make of a difference of two costs.
    zero: IntArray  #: (n,): number of zero voltage.
    #: (n,): mPFC: 1 and 0 where the arcsine's argument is beyond -1 ... 1 or is not, -1 where
    #: rounding decides; MPTC: 0.
    clamped: IntArray
    plain: BoolArray  #: (n,): whether the costs can be compared: MPFC needs some rotor flux.

    def excess(self, vector: IntArray) -> FloatArray:
        """What vectors cost beyond the best one, in allowances."""
        own = self.cost[np.arange(len(vector)), vector % 7]
        lead = (own - self.cost.min(axis=1)) / self.allowance
        wrong = (vector % 7 == 0) & (vector != self.zero)
        return np.where(wrong, np.inf, lead)


def judge(drive: MptcDrive, measurements: IntArray, u: IntArray) -> Judged:
    """Cost of every vector by the specification."""
    c, machine = drive.control, drive.machine
    scale = [form.scale for form in f.measurement_formats(drive).values()]
    real = measurements / np.array(scale)
    i_s = real[:, 0] + 1j * real[:, 1]
    psi_s = real[:, 2] + 1j * real[:, 3]
    speed, vdc, torque_ref, psi_ref = real[:, 4:].T
    ts, rs, rr = c.ts, machine.rs, machine.rr
    ls, lr, lm = machine.ls, machine.lr, machine.lm
    lam = 1 / (ls * lr - lm * lm)
    psi_r = (lr * psi_s - i_s / lam) / lm

    def _change(
        s: ComplexArray, r: ComplexArray, voltage: ComplexArray
    ) -> tuple[ComplexArray, ComplexArray]:
        current = lam * (lr * s - lm * r)
        rotor = lam * (ls * r - lm * s)
        return voltage - rs * current, 1j * speed * r - rr * rotor

    voltage = VECTORS[u] * vdc
    ds, dr = _change(psi_s, psi_r, voltage)
    es, er = _change(psi_s + ts * ds, psi_r + ts * dr, voltage)
    psi_s, psi_r = psi_s + ts / 2 * (ds + es), psi_r + ts / 2 * (dr + er)

    ds, dr = _change(psi_s, psi_r, 0 * voltage)
    rotor_2 = psi_r + ts * dr
    stator_2 = (psi_s + ts * ds)[:, None] + ts * VECTORS[:7] * vdc[:, None]
    # bases of section 9.2
    full = 2.0 ** (f.MEASUREMENT_WIDTH - 1) / (2.0 ** (f.MEASUREMENT_WIDTH - 1) - 1)
    flux = c.psi_max * full
    rotor = c.current_max * full + lam * lr * flux
    lsb = 2.0**-f.FRACTION
    least = np.abs(psi_r) * lam * lm / rotor
    if c.method == "MPFC":
        turned = psi_r * np.exp(1j * speed * ts)
        reach = 1.5 * machine.pole_pairs * lam * lm * np.abs(turned) * psi_ref
        with np.errstate(divide="ignore", invalid="ignore"):
            argument = np.where(torque_ref == 0, 0.0, torque_ref / reach)
        angle = np.angle(turned) + np.arcsin(np.clip(argument, -1, 1))
        cost = np.abs((psi_ref * np.exp(1j * angle))[:, None] - stator_2)
        # the square of psi_ref is a word: a reference of a hundredth of the full scale is coarse
        square = (psi_ref / flux) ** 2
        coarse = np.minimum(1, lsb / np.maximum(square, lsb))
        off = 1.5 * machine.pole_pairs * flux * rotor * WORDS_OFF * lsb + reach * coarse
        missing = np.abs(torque_ref) - reach
        clamped = np.select([missing > off, missing < -off], [1, 0], -1)
        # beside the clamp the arcsine makes much of little
        with np.errstate(divide="ignore", invalid="ignore"):
            unsure = np.where(reach > 0, off / reach, np.inf)
            low = np.arcsin(np.clip(argument - unsure, -1, 1))
            high = np.arcsin(np.clip(argument + unsure, -1, 1))
        # the core turns the rotor flux to second order
        turn = coarse + high - low + np.abs(speed * ts) ** 3 / 6
        with np.errstate(divide="ignore"):
            share = np.where(least > 0, 1 / least, np.inf)
        allowance = 2 * (flux * WORDS_OFF * lsb * (1 + share) + psi_ref * turn)
        return Judged(cost, allowance, zero_from(u), clamped, least >= LEAST_ROTOR)
    current_2 = lam * (lr * stator_2 - lm * rotor_2[:, None])
    torque = 1.5 * machine.pole_pairs * (np.conj(stator_2) * current_2).imag
    cost = np.abs(torque_ref[:, None] - torque)
    cost += c.k_psi * np.abs(psi_ref[:, None] - np.abs(stator_2))
    off_torque = 2 * 1.5 * machine.pole_pairs * flux * rotor * WORDS_OFF * lsb
    off_flux = flux * WORDS_OFF * lsb + 1.53e-5 * np.abs(stator_2).max(axis=1)
    allowance = 2 * (off_torque + c.k_psi * off_flux)
    none = np.zeros(len(u), dtype=np.int64)
    return Judged(cost, allowance, zero_from(u), none, np.ones(len(u), dtype=bool))
