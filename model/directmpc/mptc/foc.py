"""Rotor-flux oriented control with space-vector modulation, in float64: the baseline of Paper B.

The controller works in coordinates d, q that turn with the rotor flux psi_r. With the leakage
inductance sigma*L_s = L_s - L_m^2/L_r and R = R_s + R_r*(L_m/L_r)^2 eqs. 1 and 2 read there::

    u = R*i + sigma*L_s*di/dt + j*omega_s*sigma*L_s*i + (L_m/L_r)*(j*omega_r - R_r/L_r)*psi_r

The last two terms are computed and added (decoupling). What is left is a first-order lag, and a PI
for d and q cancels its pole: the current loop has the bandwidth a with the gains ``a*sigma*L_s``
and ``a*R``. A second PI, alike, holds the rotor flux with the current of d; the torque asked for
gives the current of q.

A control period passes until the voltage acts, and half of one until its mean does. So the voltage
is turned on by 1.5 periods of omega_s. It is made by seven segments, as the method SVM makes it.

The rotor flux reference is the one that has the stator flux asked for as soon as the torque asked
for is there. So FOC is compared with the other methods at the same stator flux.

Limits: the current reference has at most the length ``current_max``, d first. A voltage beyond the
inverter's hexagon keeps its angle and is shortened; the integrators see what is left of it.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.ideal import IdealParameters, ideal_parameters
from directmpc.mptc.ideal_sequences import svm
from directmpc.mptc.machine import inverse_determinant
from directmpc.mptc.sequence import mean_voltage, whole
from directmpc.states import MptcDecision, MptcState, VectorSequence

PERIOD = 200e-6  # s, of the control; Paper B samples FOC at 5 kHz

BANDWIDTH_SHARE = 0.05
"""Bandwidth of the current loop in periods' reciprocals: 250 Hz at 5 kHz.

A delay of 1.5 periods then costs 27 of 90 degrees of phase margin.
"""

FLUX_SHARE = 0.02
"""Bandwidth of the flux loop in bandwidths of the current loop."""

_LEAST_FLUX = 0.05  # of the reference: with less rotor flux, currents are found as if it were there
_SAME = 1e-9  # voltages that differ by less than this share of v_dc are alike


@dataclass(frozen=True)
class FocTuning:
    """Bandwidths of the loops.

    Attributes
    ----------
    current : float, optional
        Of the current loop, Hz; `BANDWIDTH_SHARE` by the control period if not given.
    flux : float, optional
        Of the rotor flux loop, Hz; `FLUX_SHARE` of the current loop's if not given.

    Raises
    ------
    ValueError
        If one is not above 0.
    """

    current: float | None = None
    flux: float | None = None

    def __post_init__(self) -> None:
        for name in ("current", "flux"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name}: got {value!r:.40}; a bandwidth above 0 Hz is needed")

    def bandwidths(self, ts: float) -> tuple[float, float]:
        """Bandwidths at a control period.

        Parameters
        ----------
        ts : float
            Control period, s.

        Returns
        -------
        current, flux : float
            rad/s.
        """
        current = BANDWIDTH_SHARE / ts if self.current is None else self.current
        flux = FLUX_SHARE * current if self.flux is None else self.flux
        return 2.0 * math.pi * current, 2.0 * math.pi * flux


class FocParameters(NamedTuple):
    """All that `decide` needs to know, and what it remembers."""

    machine: IdealParameters  # SI
    leakage: float  # sigma*L_s, H
    # kp, ki: Current PI: ohm, ohm/s.
    kp: float
    ki: float
    # kp_flux, ki_flux: Flux PI: A/Wb, A/(Wb*s).
    kp_flux: float
    ki_flux: float
    current_max: float  # Longest current reference, A
    # (2,): Integrals of the current PI (V, in d and q) and of the flux PI (A). `decide` changes
    # them.
    memory: np.ndarray


def parameters(drive: MptcDrive, tuning: FocTuning | None = None) -> FocParameters:
    """Gains for a drive (SI), and empty integrators; ValueError if its method is not SVM."""
    m, c = drive.machine, drive.control
    if c.method != "SVM":
        raise ValueError(
            f'control.method: got "{c.method}"; field-oriented control modulates, it needs "SVM"'
        )
    current, flux = (tuning or FocTuning()).bandwidths(c.ts)
    leakage = m.ls - m.lm * m.lm / m.lr
    return FocParameters(
        machine=ideal_parameters(drive),
        leakage=leakage,
        kp=current * leakage,
        ki=current * (m.rs + m.rr * (m.lm / m.lr) ** 2),
        kp_flux=flux * m.lr / (m.rr * m.lm),
        ki_flux=flux / m.lm,
        current_max=c.current_max,
        memory=np.zeros(2, dtype=np.complex128),
    )


@njit
def rotor_flux_reference(p, torque_ref, psi_ref):
    """Rotor flux (Wb) at which a torque takes a stator flux in steady state (Paper B, eqs. 1 to 3).

    With i_d = psi_r/L_m and i_q from the torque, |psi_s|^2 = (L_s/L_m*psi_r)^2 + (sigma*L_s*i_q)^2;
    the larger of its two roots. Also whether no flux makes this torque: then it is that of the
    largest torque.
    """
    m = p.machine
    a = (m.ls / m.lm) ** 2
    c = (p.leakage * torque_ref * m.lr / (1.5 * m.pole_pairs * m.lm)) ** 2
    square = psi_ref * psi_ref
    rest = square * square - 4.0 * a * c
    return math.sqrt((square + math.sqrt(max(rest, 0.0))) / (2.0 * a)), rest < 0.0


@njit
def decide(p, i, psi, omega_r, applied, vdc, torque_ref, psi_ref):
    """One control period, SI, in seven segments; the integrators in `p.memory` go on by it.

    `saturated`: the voltage is beyond the hexagon. `clamped`: a current reference is limited, or no
    rotor flux makes the torque.
    """
    m, memory = p.machine, p.memory
    rotor = m.lr / m.lm * psi - i / (inverse_determinant(m) * m.lm)
    length = abs(rotor)
    turn = rotor / length if length > 1e-12 else 1.0 + 0j
    held = max(length, _LEAST_FLUX * psi_ref)  # what currents are found with
    wanted, clamped = rotor_flux_reference(p, torque_ref, psi_ref)

    missing = wanted - length
    free = wanted / m.lm + p.kp_flux * missing + memory[1].real
    along = min(max(free, -p.current_max), p.current_max)
    if along == free:
        memory[1] += p.ki_flux * m.ts * missing
    most = math.sqrt(p.current_max**2 - along * along)
    asked = torque_ref * m.lr / (1.5 * m.pole_pairs * m.lm * held) if held > 0.0 else 0.0
    across = min(max(asked, -most), most)
    clamped = clamped or along != free or across != asked

    current = i * turn.conjugate()
    slip = m.rr * m.lm / m.lr * current.imag / held if held > 0.0 else 0.0
    omega_s = omega_r + slip
    error = complex(along, across) - current
    voltage = (
        p.kp * error
        + memory[0]
        + 1j * omega_s * p.leakage * current
        + m.lm / m.lr * complex(-m.rr / m.lr, omega_r) * length
    )
    turn *= cmath.exp(1.5j * omega_s * m.ts)
    sequence = svm(p, 1.5 * voltage * turn / vdc)
    made = mean_voltage(sequence, m.unit) * vdc * turn.conjugate()
    memory[0] += p.ki * m.ts * (error + (made - voltage) / p.kp)
    return sequence, int(abs(made - voltage) > _SAME * vdc), int(clamped)


class FocController:
    """Field-oriented control as a controller for `simulate`; it remembers its integrators.

    Parameters
    ----------
    drive : MptcDrive
        Machine, control period and largest current; its method is SVM.
    tuning : FocTuning, optional
        Bandwidths; those of the control period if not given.

    Attributes
    ----------
    parameters : FocParameters
        Gains and integrators.

    Raises
    ------
    ValueError
        If the drive's method is not SVM.
    """

    def __init__(self, drive: MptcDrive, tuning: FocTuning | None = None) -> None:
        self.drive = drive
        self.parameters = parameters(drive, tuning)

    def reset(self) -> None:
        """Empty the integrators, as at the start."""
        self.parameters.memory[:] = 0.0

    def decide(self, state: MptcState) -> MptcDecision:
        """Decide on one period.

        Parameters
        ----------
        state : MptcState
            SI.

        Returns
        -------
        MptcDecision
            A sequence of SVM. `saturated`: the voltage is beyond the hexagon. `clamped`: a current
            reference is limited, or no rotor flux makes the torque.
        """
        sequence, saturated, clamped = decide(
            self.parameters, state.current, state.flux, state.omega_r, whole(0),
            self.drive.inverter.vdc, state.torque_ref, state.psi_ref,
        )  # fmt: skip
        return MptcDecision(VectorSequence(*sequence), bool(saturated), bool(clamped))
