"""From a two-level drive to register values: what a host computes and writes once per drive.

Nothing here depends on the state, the speed or the dc-link voltage; those products are formed in
fabric every step.  With the bases of ``formats`` the prediction reads, for one component
(alpha; beta is the same with the sign of the speed's term turned)::

    w        = current*i + flux*psi                        = i_s - lambda*L_r*psi_s
    dw       = rotor*w + rotor_flux*psi - q*w_beta         = T_s*dw/dt
    dpsi     = drop_current*i + step                       = T_s*(u - R_s*i_s)
    w(k+1)   = w + (1 + rotor/2)*dw + rotor_flux/2*dpsi - q/2*dw_beta         Heun's method
    psi(k+1) = psi + (1 + drop_flux/2)*dpsi + drop/2*dw
    i_s0     = w(k+1) + rotor*w(k+1) + rotor_flux*psi(k+1) - q*w_beta(k+1)    eq. 14
    base     = psi(k+1) + drop*w(k+1) + drop_flux*psi(k+1)                    psi_s(k+2), u = 0

with q = speed*omega_r and step = voltage*v_dc times the unit vector of u
(`voltage_alpha` and `voltage_beta` make twice the steps of u_1's alpha and u_2's beta component:
what a vector takes of them is then 1/2 or 1/4, both of which are words).  Halves and 1 + x/2 of a
negative x are the same bits shifted (the sign turned over), so they are no coefficients of their
own; `rotor` and `drop_flux` are therefore at most -1 LSB.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.mptc import formats as f
from directmpc.mptc.drive import MptcDrive

#: Coefficient ports in port order; all 18 bits signed.
COEFFICIENTS: tuple[str, ...] = (
    "current",
    "flux",
    "rotor",
    "rotor_flux",
    "drop_current",
    "drop",
    "drop_flux",
    "speed",
    "voltage_alpha",
    "voltage_beta",
    "torque",
    "weight",
)


class Words(NamedTuple):
    """Parameters of ``mptc_core`` in compiled code: ``COEFFICIENTS`` in order, then the method."""

    current: int
    flux: int
    rotor: int
    rotor_flux: int
    drop_current: int
    drop: int
    drop_flux: int
    speed: int
    voltage_alpha: int
    voltage_beta: int
    torque: int
    weight: int
    flux_control: int


@njit
def words(register):
    """``Words`` out of ``Registers.array()`` (13,)."""
    return Words(
        register[0], register[1], register[2], register[3], register[4], register[5], register[6],
        register[7], register[8], register[9], register[10], register[11], register[12],
    )  # fmt: skip


_UNIT = 2**f.FRACTION
_FULL = 2.0 ** (f.MEASUREMENT_WIDTH - 1) / (2.0 ** (f.MEASUREMENT_WIDTH - 1) - 1.0)

#: Keys that a coefficient depends on as a power, and which.
_KEYS: dict[str, dict[str, int]] = {
    "rotor": {"control.ts": 1, "machine.rr": 1},
    "rotor_flux": {"control.ts": 1, "machine.rr": 1},
    "drop_current": {
        "control.ts": 1, "machine.rs": 1, "control.current_max": 1,
        "control.psi_max": -1,
    },
    "drop": {"control.ts": 1, "machine.rs": 1},
    "drop_flux": {"control.ts": 1, "machine.rs": 1},
    "speed": {"control.ts": 1, "control.speed_max": 1},
    "voltage_alpha": {"control.ts": 1, "inverter.vdc": 1, "control.psi_max": -1},
    "voltage_beta": {"control.ts": 1, "inverter.vdc": 1, "control.psi_max": -1},
}  # fmt: skip

_UNITS = {
    "ts": "s", "rs": "Ohm", "rr": "Ohm", "current_max": "A", "psi_max": "Wb", "speed_max": "rad/s",
    "vdc": "V", "torque_max": "N*m",
}  # fmt: skip


@dataclass(frozen=True)
class Registers:
    """Run-time parameters of ``mptc_core`` as integers."""

    coefficients: dict[str, int]  # One signed 18-bit value per name of ``COEFFICIENTS``
    flux_control: int  # 1: MPFC
    torque_unit: float  # Base of the torque terms, N*m; for reports only
    rotor_unit: float  # W, base of w, A; for reports only

    def ports(self) -> dict[str, int]:
        """Every parameter port by name, in port order: signed 18-bit words, then `flux_control`."""
        return {
            **{f"c_{name}": self.coefficients[name] for name in COEFFICIENTS},
            "flux_control": self.flux_control,
        }

    def array(self) -> NDArray[np.int64]:
        """``ports`` as an array, for compiled code."""
        return np.array(list(self.ports().values()), dtype=np.int64)


def _weight(drive: MptcDrive, ratio: float) -> int:
    """k_psi's coefficient; ratio is flux base over torque base."""
    value = drive.control.k_psi * ratio / f.MAGNITUDE_GAIN
    value *= 2.0 ** (f.PRODUCT_FRACTION - f.DIFFERENCE_FRACTION - f.WEIGHT_SHIFT)
    if round(value) > f.WORD_HIGH:
        limit = f.WORD_HIGH / value * drive.control.k_psi
        raise ValueError(
            f"control.k_psi: got {drive.control.k_psi:g}; with this drive's full scales it must "
            f"be a number from 0 to {limit:.4g} N*m/Wb"
        )
    return round(value)


def _round_the_pair(rounded: dict[str, int], values: dict[str, float], ratio: float) -> None:
    """Round `rotor` and `rotor_flux` up or down so that the machine without load stays at rest.

    There w is `ratio` times psi_s, and rotor*w + rotor_flux*psi is 0. Rounded each for itself, the
    two can err in the same direction, which an observer of the speed sees as a slip that is not
    there. Beside the ripple of the methods without SVM this is not seen.
    """
    exact = values["rotor"] * _UNIT, values["rotor_flux"] * _UNIT
    tried = [(math.floor(exact[0]) + x, math.floor(exact[1]) + y) for x in (0, 1) for y in (0, 1)]
    rounded["rotor"], rounded["rotor_flux"] = min(
        tried, key=lambda pair: abs((pair[0] - exact[0]) * ratio + pair[1] - exact[1])
    )


def _too_large(drive: MptcDrive, name: str, value: float, by_torque: bool) -> ValueError:
    """What is allowed where a coefficient does not fit its word; by_torque: torque_max makes it."""
    keys = _KEYS.get(name)
    if name == "drop" and by_torque:
        keys = {"control.torque_max": 1, "control.psi_max": -2}
    if keys is None:
        return ValueError(
            "control.psi_max, control.current_max: psi_max/(sigma*L_s) and current_max must not be "
            f"negligible beside each other; the coefficient {name} is {value:.6g} and cannot be "
            "represented"
        )
    room = (f.WORD_HIGH - 1) / _UNIT / abs(value)  # what is allowed stays so when it is printed
    parts = []
    for key, power in keys.items():
        section, word = key.split(".")
        got = getattr(getattr(drive, section), word)
        end = f"{'most' if power > 0 else 'least'} {got * room ** (1.0 / power):.6g}"
        parts.append(f"{key}: got {got:g}; it must be at {end} {_UNITS[word]}")
    return ValueError(f"{', or '.join(parts)}, with this drive's other values")


def registers(drive: MptcDrive) -> Registers:
    """Register values of a drive; ValueError names the key that cannot be represented."""
    m, c = drive.machine, drive.control
    lam = 1.0 / (m.ls * m.lr - m.lm * m.lm)
    current, flux = c.current_max * _FULL, c.psi_max * _FULL
    speed, torque = c.speed_max * _FULL, c.torque_max * _FULL
    per_rotor = 1.5 * m.pole_pairs * flux
    of_torque = torque / per_rotor * _UNIT / (_UNIT - 1)
    smallest = max(current + lam * m.lr * flux, of_torque)
    exact = math.floor(torque / (per_rotor * smallest) * _UNIT)
    if exact < 1:
        raise ValueError(
            f"control.torque_max: got {c.torque_max:g}; with this drive's psi_max and current_max "
            f"it must be at least {per_rotor * smallest / _UNIT:.4g} N*m"
        )
    rotor = torque * _UNIT / (per_rotor * exact)
    decay = c.ts * lam * m.rr * m.ls
    values = {
        "current": current / rotor,
        "flux": -lam * m.lr * flux / rotor,
        "rotor": -decay,
        "rotor_flux": (c.ts * lam * m.rr - decay * lam * m.lr) * flux / rotor,
        "drop_current": -c.ts * m.rs * current / flux,
        "drop": -c.ts * m.rs * rotor / flux,
        "drop_flux": -c.ts * m.rs * lam * m.lr,
        "speed": c.ts * speed,
        "voltage_alpha": 2.0 * c.ts * 2.0 / 3.0 * 2.0 * drive.inverter.vdc / flux,
        "voltage_beta": 2.0 * c.ts / math.sqrt(3.0) * 2.0 * drive.inverter.vdc / flux,
    }
    rounded = {name: round(value * _UNIT) for name, value in values.items()}
    for name, word in rounded.items():
        if abs(word) > f.WORD_HIGH:
            raise _too_large(drive, name, values[name], smallest == of_torque)
    if c.method == "SVM":
        _round_the_pair(rounded, values, (1.0 / m.ls - lam * m.lr) * flux / rotor)
    for name in ("rotor", "drop_flux"):
        rounded[name] = min(rounded[name], -1)
    rounded |= {"torque": exact, "weight": _weight(drive, flux / (per_rotor * rotor))}
    return Registers(
        coefficients={name: rounded[name] for name in COEFFICIENTS},
        flux_control=int(c.method == "MPFC"),
        torque_unit=per_rotor * rotor,
        rotor_unit=rotor,
    )


def cost_unit(drive: MptcDrive) -> float:
    """LSB of a cost of MPTC as it is compared, N m; ValueError as `registers`."""
    shift = f.COST_DROPPED - f.COST_SHIFT - f.TORQUE_FRACTION
    return registers(drive).torque_unit * 2.0**shift
