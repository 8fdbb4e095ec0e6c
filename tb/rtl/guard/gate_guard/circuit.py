"""What the devices of a leg have to block while its gates change.

Switches and diodes are ideal, every device has an output capacitance, and the load is a current
source. Voltages are in units of the dc-link voltage, charge in units of a capacitance times it. The
node voltages follow from the charge, by implicit Euler; a device that conducts is a large
conductance. Many paths, with both signs of the current, are followed at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from directmpc.converter import Converter

#: Gates that are on, and for how long: 1 is a whole dead time.
Step = tuple[frozenset[int], float]
Floats = NDArray[np.float64]

#: Of a device that conducts, against capacitances of about 1.
CONDUCTANCE = 1e5
#: Charge that the load current moves in a dead time: it may be just enough for the swings, or more.
CHARGES = (3.0, 7.0)
#: Parts that a step is computed in.
PARTS = 12


@dataclass(frozen=True)
class Leg:
    """Devices of a leg between its nodes, the load at node O."""

    #: Gate and the nodes that its transistor conducts between; its diode conducts backwards.
    devices: dict[int, tuple[str, str]]
    fixed: dict[str, float]  #: Potentials of the dc link.
    #: Nodes that a charged capacitor ties to another one: the other one, and how much higher.
    tied: dict[str, tuple[str, float]]
    ratings: tuple[float, ...]  #: What each device may block.
    #: Sets of output capacitances, a value for each device.
    capacitances: tuple[tuple[float, ...], ...]


#: Output capacitances: of the devices with the highest rating against the others, of clamping
#: diodes against switches, of the lower switch against the upper one.
SHARES = (0.5, 1.0, 2.0)


def leg_of(converter: Converter) -> Leg:
    """Devices of a converter's leg; a diode is a device whose gate, a negative number, is never on.

    Devices in series, or larger ones, have another capacitance than the rest.
    """
    parts = (*converter.switches, *converter.diodes)
    highest = max(part.rating for part in parts)
    other = [part.rating == highest for part in parts]
    if all(other):
        other = [n >= len(converter.switches) for n in range(len(parts))]
    if not any(other):
        other = [n >= len(parts) // 2 for n in range(len(parts))]
    devices = {n: (s.first, s.second) for n, s in enumerate(converter.switches, start=1)}
    devices |= {-n: (d.second, d.first) for n, d in enumerate(converter.diodes, start=1)}
    tied = {}
    if converter.capacitor_nodes is not None:
        high, low = converter.capacitor_nodes
        tied = {low: (high, -converter.capacitor_share)}
    return Leg(
        devices,
        dict(converter.rails),
        tied,
        tuple(part.rating for part in parts),
        tuple(tuple(share if one else 1.0 for one in other) for share in SHARES),
    )


@dataclass
class Circuit:
    """Legs of one kind, a row each."""

    leg: Leg  #: Devices and nodes.
    charge: Floats  #: That leaves each leg in a dead time; negative: comes into it.
    capacitance: Floats  #: Of each device, a row for each leg.
    volts: Floats = field(init=False)

    def __post_init__(self) -> None:
        leg = self.leg
        ends = {node for pair in leg.devices.values() for node in pair}
        names = sorted(ends - set(leg.fixed) - set(leg.tied))
        self._incidence = np.zeros((len(leg.devices), len(names)))
        self._fixed = np.zeros(len(leg.devices))
        for row, (high, low) in enumerate(leg.devices.values()):
            for node, sign in ((high, 1.0), (low, -1.0)):
                if node in leg.fixed:
                    self._fixed[row] += sign * leg.fixed[node]
                    continue
                name, shift = leg.tied.get(node, (node, 0.0))
                self._incidence[row, names.index(name)] += sign
                self._fixed[row] += sign * shift
        self._pairs = np.einsum("da,db->dab", self._incidence, self._incidence)
        self._load = -1.0 * (np.array(names) == "O")
        self.volts = np.zeros((len(self.charge), len(names)))

    def blocked(self) -> Floats:
        """Voltage of each device."""
        return self.volts @ self._incidence.T + self._fixed

    def advance(self, on: NDArray[np.bool_], dwell: Floats) -> Floats:
        """Follow all legs for a time; highest voltage of any device, by its rating.

        ``on`` has a row for each leg, ``dwell`` a time, in dead times.
        """
        own = np.tensordot(self.capacitance, self._pairs, 1)
        own += 1e-9 * np.eye(self.volts.shape[1])
        given = (self.charge * dwell / PARTS)[:, None] * self._load
        ratings = np.array(self.leg.ratings)
        worst = np.zeros(len(self.charge))
        for _ in range(PARTS):
            start = np.einsum("rab,rb->ra", own, self.volts) + given
            conducts = on | (self.blocked() < 1e-9)
            for _ in range(40):
                large = np.where(conducts, CONDUCTANCE, 0.0)
                matrix = own + np.tensordot(large, self._pairs, 1)
                right = start - (large * self._fixed) @ self._incidence
                self.volts = np.linalg.solve(matrix, right[..., None])[..., 0]
                found = on | (self.blocked() < -1e-12)
                if (found == conducts).all():
                    break
                conducts = found
            worst = np.maximum(worst, (self.blocked() / ratings).max(axis=1))
        return worst


def stress(leg: Leg, paths: Sequence[Sequence[Step]]) -> list[float]:
    """Highest blocking voltage of any device on each path, by its rating.

    A path begins in a pattern of gates that settles first. Every path is followed with both signs
    of the current, each set of capacitances, and more and less charge.
    """
    cases = [
        (sign * charge, capacitances)
        for sign in (1.0, -1.0)
        for charge in CHARGES
        for capacitances in leg.capacitances
    ]
    count = len(cases)
    charge = np.array([case[0] for case in cases] * len(paths))
    circuit = Circuit(leg, charge, np.array([case[1] for case in cases] * len(paths)))
    longest = max(map(len, paths))
    worst = np.zeros(len(charge))
    for n in range(longest):
        on = np.array([[gate in p[min(n, len(p) - 1)][0] for gate in leg.devices] for p in paths])
        dwell = np.array([p[n][1] if n < len(p) else 0.0 for p in paths])
        live = np.repeat(dwell > 0, count)
        part = Circuit(leg, circuit.charge[live], circuit.capacitance[live])
        part.volts = circuit.volts[live]
        if n == 0:
            part.advance(np.repeat(on, count, axis=0)[live], np.full(live.sum(), 4.0))
        found = part.advance(np.repeat(on, count, axis=0)[live], np.repeat(dwell, count)[live])
        circuit.volts[live] = part.volts
        worst[live] = np.maximum(worst[live], found)
    return [float(w) for w in worst.reshape(len(paths), count).max(axis=1)]
