"""Channels of the scope: what is drawn, made of the columns of a trace and its decisions.

A table has a column for each measurement, reference and decision, in the units of the drive file,
named as in traces and `SimulationResult.table`. `Signals` says which columns a drive has and turns
them into channels: phase currents beside their bounds, levels, costs. Every channel is known in two
units, SI and per unit; a two-level drive's unit is its full scale.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.api.drive_file import AnyDrive
from directmpc.api.kinds import kind_of
from directmpc.host.gate_guard import FAULTS
from directmpc.mpdcc import ideal
from directmpc.mptc import ideal as mptc_ideal
from directmpc.mptc.inverter import STATES

FloatArray = NDArray[np.float64]
Table = Mapping[str, FloatArray]
PHASES = "abc"

#: What a board says beside the decision.
BOARD = ("cycles", "faults", "gates", "running", "cost")
_STATE = ("is_alpha", "is_beta", "psir_alpha", "psir_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")
FIVE_TRACE = (
    *_STATE, "iref_alpha", "iref_beta", "omega_s", "omega_r", "s_a", "s_b", "s_c", "v_dc",
)  # fmt: skip
FIVE_DECISION = (
    "next_s_a", "next_s_b", "next_s_c", "next_held", "next_deadlock", "next_length",
    "next_saturated", "next_exhausted",
)  # fmt: skip
FIVE_BOUNDS = ("bound_current", "bound_vn", "bound_vph")
TWO_TRACE = (
    "is_alpha", "is_beta", "psis_alpha", "psis_beta", "omega_r", "torque_ref", "psi_ref", "u",
    "v_dc",
)  # fmt: skip
TWO_DECISION = ("next_u", "next_saturated", "next_clamped")


@dataclass(frozen=True)
class Channel:
    """A line of the scope."""

    # key, label: Its name for programs and for people.
    key: str
    label: str
    group: str  # The view that it belongs to
    # SI and per unit: name, and what a value of the channel is multiplied with.
    units: tuple[tuple[str, float], tuple[str, float]] = (("", 1.0), ("", 1.0))
    style: str = "line"  # "line", or "step" for what holds from step to step
    # low, high: Channels that bound it; empty for none.
    low: str = ""
    high: str = ""


class Signals:
    """Channels of a drive."""

    def __init__(self, drive: AnyDrive) -> None:
        self.drive = drive
        self.five = kind_of(drive).per_unit
        decided = (*FIVE_DECISION, *FIVE_BOUNDS) if self.five else TWO_DECISION
        estimates = bool(getattr(drive.control, "leakage_estimate", False))
        decided += ("leakage",) if estimates else ()
        self.columns = (*(FIVE_TRACE if self.five else TWO_TRACE), *decided, *BOARD)
        self.channels = self._five() if self.five else self._two()
        if estimates:
            self.channels.append(Channel("leakage", "leakage, recorded", "leakage", style="step"))
        bounded = hasattr(drive.control, "bound_current")
        self._ideal = ideal.ideal_parameters(drive) if bounded else None

    def described(self) -> list[dict[str, Any]]:
        """The channels for the page."""
        return [asdict(channel) for channel in self.channels]

    def _five(self) -> list[Channel]:
        base = self.drive.base
        current, voltage = (("A", base.current), ("pu", 1.0)), (("V", base.voltage), ("pu", 1.0))
        omega = 2 * math.pi * base.frequency
        # of a machine with one pole pair: the file does not say how many there are
        torque = (("N·m/pole pair", 1.5 * base.voltage * base.current / omega), ("pu", 1.0))
        flux, speed = (
            (("Wb", base.voltage / omega), ("pu", 1.0)),
            (("Hz", base.frequency), ("pu", 1.0)),
        )
        found = []
        bounded = hasattr(self.drive.control, "bound_current")
        for x in PHASES:
            limits = {"low": f"i_{x}_low", "high": f"i_{x}_high"} if bounded else {}
            found.append(Channel(f"i_{x}", f"i_{x}", "currents", current, **limits))
        for x in PHASES if bounded else "":
            found += [
                Channel(f"i_{x}_{end}", f"i_{x} {end}", "currents", current)
                for end in ("low", "high")
            ]
        own = self.drive.converter.capacitor_share > 0.0
        found.append(Channel("v_n", "v_n", "neutral", voltage, low="v_n_low", high="v_n_high"))
        found += [Channel(f"v_n_{e}", f"v_n {e}", "neutral", voltage) for e in ("low", "high")]
        for x in PHASES if own else "":
            found.append(
                Channel(
                    f"v_ph_{x}", f"v_ph_{x}", "capacitors", voltage, "line", "v_ph_low", "v_ph_high"
                )
            )
        if own:
            found += [
                Channel(f"v_ph_{e}", f"v_ph {e}", "capacitors", voltage) for e in ("low", "high")
            ]
        found += [
            Channel("v_dc", "v_dc", "link", voltage),
            Channel("torque", "torque", "torque", torque),
            Channel("flux", "|ψ|", "flux", flux),
            Channel("omega_r", "rotor", "speed", speed),
            Channel("omega_s", "stator", "speed", speed),
        ]
        found += [Channel(f"level_{x}", f"level {x}", "levels", style="step") for x in PHASES]
        found += [Channel(f"s_{x}", f"s_{x}", "positions", style="step") for x in PHASES]
        if bounded:
            found += [
                Channel("cost", "cost J", "costs", style="step"),
                Channel("second", "next best", "costs", style="step"),
            ]
        found.append(Channel("length", "length", "lengths", (("steps", 1), ("steps", 1)), "step"))
        flags = ("held", "deadlock", "saturated", "exhausted")
        found += [Channel(name, name, "flags", style="step") for name in flags]
        return found + self._of_board()

    def _two(self) -> list[Channel]:
        c = self.drive.control
        current = (("A", 1.0), ("of full scale", 1 / c.current_max))
        torque = (("N·m", 1.0), ("of full scale", 1 / c.torque_max))
        flux = (("Wb", 1.0), ("of full scale", 1 / c.psi_max))
        rpm = 30 / math.pi / self.drive.machine.pole_pairs
        speed = (("1/min", rpm), ("of full scale", 1 / c.speed_max))
        volt = (("V", 1.0), ("of nominal", 1 / self.drive.inverter.vdc))
        found = [Channel(f"i_{x}", f"i_{x}", "currents", current) for x in PHASES]
        found += [
            Channel("v_dc", "v_dc", "link", volt),
            Channel("torque", "torque", "torque", torque),
            Channel("torque_ref", "reference", "torque", torque),
            Channel("flux", "|ψ|", "flux", flux),
            Channel("psi_ref", "reference", "flux", flux),
            Channel("omega_r", "rotor", "speed", speed),
            Channel("u", "vector", "positions", style="step"),
        ]
        found += [Channel(f"level_{x}", f"leg {x}", "levels", style="step") for x in PHASES]
        if c.method == "MPTC":
            found.append(Channel("cost", "cost", "costs", torque, "step"))
        found.append(Channel("margin", "margin of the choice", "costs", style="step"))
        found += [Channel(name, name, "flags", style="step") for name in ("saturated", "clamped")]
        return found + self._of_board()

    def _of_board(self) -> list[Channel]:
        return [
            Channel("running", "gates on", "flags", style="step"),
            Channel("cycles", "clocks", "clocks", (("clocks", 1), ("clocks", 1)), "step"),
            Channel("faults", "faults", "faults", style="step"),
        ]

    def values(self, table: Table) -> NDArray[np.float32]:
        """Channels (channels, n) of rows by column, each (n,)."""
        turn = np.exp(-2j * np.pi / 3 * np.arange(3))[:, None]
        current = table["is_alpha"] + 1j * table["is_beta"]
        found = dict(zip((f"i_{x}" for x in PHASES), (current * turn).real, strict=True))
        same = ("omega_r", "running", "cycles", "faults", "v_dc", "leakage")
        found |= {name: table[name] for name in same if name in table}
        found |= (self._of_five if self.five else self._of_two)(table, current, turn)
        if np.isfinite(table["cost"]).any():  # a recorder's
            found["cost"] = table["cost"]
        return np.array([found[c.key] for c in self.channels], np.float32)

    def _of_five(self, t: Table, current: NDArray[Any], turn: NDArray[Any]) -> dict[str, Any]:
        drive = self.drive
        flux = t["psir_alpha"] + 1j * t["psir_beta"]
        wanted = ((t["iref_alpha"] + 1j * t["iref_beta"]) * turn).real
        found = {name: t[name] for name in ("v_n", "omega_s")}
        for n, x in enumerate(PHASES):
            found |= {
                f"i_{x}_low": wanted[n] - t["bound_current"],
                f"i_{x}_high": wanted[n] + t["bound_current"],
                f"v_ph_{x}": t[f"v_ph_{x}"],
                f"s_{x}": t[f"next_s_{x}"],
                f"level_{x}": drive.converter.level[t[f"next_s_{x}"].astype(np.int64)],
            }
        nominal = drive.converter.capacitor_share * t["v_dc"]
        found |= {"v_n_low": -t["bound_vn"], "v_n_high": t["bound_vn"]}
        found |= {"v_ph_low": nominal - t["bound_vph"], "v_ph_high": nominal + t["bound_vph"]}
        found["torque"] = drive.machine.torque(current, flux)
        found["flux"] = np.abs(flux)
        flags = ("held", "deadlock", "saturated", "exhausted", "length")
        found |= {name: t[f"next_{name}"] for name in flags}
        if self._ideal is not None:
            found["cost"], found["second"] = self._costs(t)
        return found

    def _costs(self, t: Table) -> tuple[FloatArray, FloatArray]:
        """Least cost and least cost of another first position, as the ideal controller has them."""
        count = len(t["v_n"])
        best, second = np.empty(count), np.empty(count)
        machine = np.column_stack([t[name] for name in _STATE[:4]])
        inverter = np.column_stack([t[name] for name in _STATE[4:]])
        iref = np.column_stack([t["iref_alpha"], t["iref_beta"]])
        before = np.column_stack([t[f"s_{x}"] for x in PHASES]).astype(np.int64)
        for k in range(count):
            _, deadlock, best[k], second[k] = ideal.margins(
                self._ideal, machine[k], inverter[k], t["v_dc"][k], iref[k], t["omega_s"][k],
                t["omega_r"][k], before[k],
            )  # fmt: skip
            if deadlock:  # an excess, which is no cost
                best[k] = second[k] = math.nan
        best[~np.isfinite(best)] = math.nan
        second[~np.isfinite(second)] = math.nan
        return best, second

    def _of_two(self, t: Table, current: NDArray[Any], _: NDArray[Any]) -> dict[str, Any]:
        flux = t["psis_alpha"] + 1j * t["psis_beta"]
        vector = t["next_u"].astype(np.int64)
        found = {name: t[name] for name in ("torque_ref", "psi_ref")}
        found |= {"u": t["next_u"], "flux": np.abs(flux)}
        found["torque"] = 1.5 * self.drive.machine.pole_pairs * (flux.conj() * current).imag
        found |= dict(zip((f"level_{x}" for x in PHASES), STATES[vector].T, strict=True))
        found |= {name: t[f"next_{name}"] for name in ("saturated", "clamped")}
        margin, least = np.full((2, len(vector)), math.nan)
        if not self.drive.control.sequences:
            parameters = mptc_ideal.ideal_parameters(self.drive)
            for k in range(len(vector)):
                cost, _ = mptc_ideal.costs(
                    parameters, current[k], flux[k], t["omega_r"][k], int(t["u"][k]),
                    t["v_dc"][k], t["torque_ref"][k], t["psi_ref"][k],
                )  # fmt: skip
                cost.sort()
                margin[k], least[k] = cost[1] - cost[0], cost[0]
        found |= {"margin": margin, "cost": least}
        return found


def fault_names(word: int) -> list[str]:
    """Names of the faults of a word of a STEP reply, lowest bit first."""
    return [name for n, name in enumerate(FAULTS) if word >> n & 1]
