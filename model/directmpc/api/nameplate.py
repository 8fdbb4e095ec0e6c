"""An induction machine estimated from its name plate.

The plate has the rated power, voltage, current, power factor and speed; catalogues add the
breakdown torque. The four parameters of the star circuit with equal leakages follow from them by
least squares. That is an estimate: a plate is rounded and within tolerances, the circuit knows
neither saturation nor skin effect, and which part of the losses is copper is assumed.
`Estimate.residuals` shows what the estimated machine makes of the plate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.loads.induction import InductionMachine

COPPER_SHARE = 0.7
"""Assumed share of copper in the losses; iron and friction have the rest."""

#: Bounds of rs, rr, both leakages, and xm, per unit: those of a drive file.
_LOW = np.array([0.001, 0.001, 0.03, 1.0])
_HIGH = np.array([0.2, 0.2, 0.3, 5.0])
_GUESS = np.array([0.03, 0.02, 0.1, 2.0])


@dataclass(frozen=True)
class Nameplate:
    """What a plate says."""

    power: float  # Rated power on the shaft, W
    # voltage, current: Line-to-line voltage and line current, rms, of the connection that is used.
    voltage: float
    current: float
    cos_phi: float  # Power factor
    speed: float  # Rated speed, r/min
    breakdown: float  # Breakdown torque over rated torque
    frequency: float = 50.0  # Hz

    def __post_init__(self) -> None:
        ranges = {
            "power": (10.0, 1e8, "W"), "voltage": (10.0, 2e4, "V"), "current": (0.05, 1e5, "A"),
            "cos_phi": (0.3, 0.99, ""), "speed": (10.0, 1e5, "r/min"), "breakdown": (1.1, 6.0, ""),
            "frequency": (1.0, 1000.0, "Hz"),
        }  # fmt: skip
        for name, (low, high, unit) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(
                    f"{name}: got {value:g}; "
                    f"it must be a number from {low:g} to {high:g} {unit}".rstrip()
                )
        if not 0.0005 <= self.slip <= 0.15:
            raise ValueError(
                f"speed: got {self.speed:g} r/min; that is a slip of {100 * self.slip:.2g} % with "
                f"{self.pole_pairs} pole pairs at {self.frequency:g} Hz; it must be 0.05 to 15 %"
            )
        if not 0.4 <= self.efficiency < 0.995:
            raise ValueError(
                f"power: got {self.power:g} W; with voltage, current and cos_phi that is an "
                f"efficiency of {100 * self.efficiency:.3g} %, it must be from 40 to 99.5 %"
            )

    @property
    def pole_pairs(self) -> int:
        """Pole pairs: as many as the rated speed lets the field be just faster."""
        return max(1, math.floor(60.0 * self.frequency / self.speed))

    @property
    def slip(self) -> float:
        """Rated slip over the frequency."""
        return 1.0 - self.speed * self.pole_pairs / (60.0 * self.frequency)

    @property
    def efficiency(self) -> float:
        """Power on the shaft over electrical power."""
        return self.power / (math.sqrt(3.0) * self.voltage * self.current * self.cos_phi)

    @property
    def torque(self) -> float:
        """Rated torque on the shaft, N*m."""
        return self.power / (2.0 * math.pi * self.speed / 60.0)


@dataclass(frozen=True)
class Estimate:
    """A machine that makes about what a plate says."""

    machine: InductionMachine  # Star circuit, per unit of the plate's voltage and current
    impedance: float  # Base impedance, ohm
    # Name of a value of the plate -> the plate's, the estimated machine's.
    residuals: dict[str, tuple[float, float]]


def _made(machine: InductionMachine, slip: float) -> NDArray[np.float64]:
    """Current, power factor, torque and breakdown ratio at rated voltage, per unit."""
    _, v_s, unit = machine._phasors(1.0, slip)
    current = 1.0 / abs(v_s)
    rated = unit * current**2
    return np.array([current, v_s.real / abs(v_s), rated, machine.breakdown_torque() / rated])


def _machine(logarithms: NDArray[np.float64]) -> InductionMachine:
    """Machine of the logarithms of rs, rr, both leakages and xm."""
    rs, rr, xl, xm = np.clip(np.exp(logarithms), _LOW, _HIGH).tolist()
    return InductionMachine(rs=rs, rr=rr, xls=xl, xlr=xl, xm=xm)


def estimate(plate: Nameplate, copper_share: float = COPPER_SHARE) -> Estimate:
    """Estimate the star circuit of a machine, with equal leakages of stator and rotor.

    `copper_share`: share of the losses that copper has, above 0 and at most 1.
    """
    from scipy.optimize import least_squares  # here: few programs need it

    electrical = plate.cos_phi  # per unit of 3/2 V_B I_B
    lost = electrical * (1.0 - plate.efficiency)
    # iron and friction are no part of the circuit: it makes their power on the shaft
    torque = (electrical - copper_share * lost) / (1.0 - plate.slip)
    wanted = np.array([1.0, plate.cos_phi, torque, plate.breakdown])

    found = least_squares(
        lambda x: _made(_machine(x), plate.slip) / wanted - 1.0,
        np.log(np.clip([*_GUESS[:1], plate.slip, *_GUESS[2:]], 1.001 * _LOW, 0.999 * _HIGH)),
        bounds=(np.log(_LOW), np.log(_HIGH)),
        xtol=1e-12, ftol=1e-12, gtol=1e-12,
    )  # fmt: skip
    machine = _machine(found.x)
    current, turning, rated, breakdown = _made(machine, plate.slip).tolist()
    return Estimate(
        machine=machine,
        impedance=plate.voltage / math.sqrt(3.0) / plate.current,
        residuals={
            "current (A)": (plate.current, current * plate.current),
            "cos phi": (plate.cos_phi, turning),
            "torque (N m)": (plate.torque, plate.torque * rated / torque),
            "breakdown torque over rated": (plate.breakdown, breakdown),
        },
    )
