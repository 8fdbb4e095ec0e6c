"""``mptc_drive`` in RTL as a controller: its netlist in Verilator, one period a call.

Every answer is compared with the twin's: vector, flags, estimated flux and clocks.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from directmpc.mptc import bit_true, cycles, observer
from directmpc.mptc import drive_twin as joined
from directmpc.mptc.closed_loop import RPM, Scenario
from directmpc.mptc.coefficients import COEFFICIENTS
from directmpc.mptc.drive import MptcDrive
from directmpc.states import MptcDecision, MptcState
from scripts.hdl import conversion as netlist
from scripts.hdl import netlist_check
from scripts.hdl.simulator import SimulationError

ENTITY = "mptc_drive"
#: Generics of the netlist that is run; both methods are in it.
GENERICS = {"FLUX_CONTROL": True}
#: What has to stand still between decisions.
HELD = ("restart", "limit", "level")
#: Ports of the measurements.
MEASURED = ("is_alpha", "is_beta", "omega_r", "v_dc", "torque_ref", "psi_ref")


def held_inputs(words: joined.Parameters) -> dict[str, int]:
    """Parameter ports of ``mptc_drive``: name -> value."""
    return {
        **{f"c_{n}": int(v) for n, v in zip(COEFFICIENTS, words.core, strict=False)},
        **{f"c_{n}": int(v) for n, v in zip(observer.COEFFICIENTS, words.observer, strict=True)},
        "method_mpfc": int(words.core[-1]),
        "limit": words.limit,
        "level": words.level,
        "excite": words.excite,
        "restart": 0,
    }


def ports() -> netlist_check.Ports:
    """Ports of the netlist, those that stand still marked."""
    found = netlist_check.ports_of(netlist.cached(ENTITY, GENERICS), ENTITY)
    held = tuple(name for name in found.inputs if name.startswith("c_") or name in HELD)
    return netlist_check.Ports(found.inputs, found.outputs, held)


class RtlController:
    """``mptc_drive`` as a controller (`directmpc.Controller`), checked in every period."""

    def __init__(self, drive: MptcDrive, words: joined.Parameters, rtl: Any) -> None:
        self._formats = bit_true.parameters(drive)[1:]
        self._vdc = drive.inverter.vdc
        self._words, self._rtl = words, rtl
        self._twin = joined.initial()
        self._held = held_inputs(words)
        self._clocks = cycles.DRIVE["MPFC" if words.core[-1] else "MPTC"]

    def decide(self, state: MptcState) -> MptcDecision:
        """Run one period of the RTL."""
        seen, clipped = bit_true.encode_row(
            *self._formats, state.current, 0j, state.omega_r, self._vdc, state.torque_ref,
            state.psi_ref,
        )  # fmt: skip
        m = seen[[0, 1, 4, 5, 6, 7]]
        inputs = {name: int(value) for name, value in zip(MEASURED, m, strict=True)}
        out, taken = self._rtl.step(self._held | inputs)
        wanted = joined.step_words(self._words, self._twin, m)
        found = tuple(out[n] for n in ("u_next", "saturated", "clamped", "exciting"))
        flux = (out["psis_alpha"], out["psis_beta"])
        estimate = tuple(int(v) & 0xFFFF for v in self._twin[4:6])
        if (found, flux, taken) != (wanted, estimate, self._clocks):
            raise SimulationError(f"{ENTITY}: {found}, {flux}, {taken} clocks, not {wanted}")
        saturated = bool(out["saturated"] | clipped)
        return MptcDecision(int(out["u_next"]), saturated, bool(out["clamped"]))


@contextmanager
def controller(drive: MptcDrive, words: joined.Parameters) -> Iterator[RtlController]:
    """Yield the RTL, fresh from a reset, as a controller."""
    with netlist_check.simulator(ENTITY, GENERICS, ports=ports()) as rtl:
        yield RtlController(drive, words, rtl)


def tour(
    drive: MptcDrive, psi_ref: float, load: float, inertia: float, legs: tuple[int, int, int, int]
) -> tuple[Scenario, joined.Parameters]:
    """Magnetise, start to 1500 r/min, load step and reversal to -1500 r/min in one scenario."""
    begin, loaded, free = legs[:3]
    n = sum(legs)
    speed = np.full(n, 1500.0 * RPM)
    speed[begin + loaded + free :] *= -1.0
    torque = np.zeros(n)
    torque[begin : begin + loaded] = load
    gain = 200.0 * inertia
    scenario = Scenario(
        np.zeros(n),
        np.full(n, psi_ref),
        torque,
        speed,
        gains=(gain, 20.0 * gain, 16.8),
    )
    return scenario, joined.parameters(drive, limit=8.0, flux=psi_ref)
