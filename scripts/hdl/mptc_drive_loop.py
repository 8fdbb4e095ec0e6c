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
from scripts.hdl import conversion as netlist
from scripts.hdl import netlist_check
from scripts.hdl.simulator import SimulationError

ENTITY = "mptc_drive"
#: Generics of the netlist that is run; both methods are in it.
GENERICS = {"FLUX_CONTROL": True}
#: What has to stand still between decisions.
HELD = ("restart", "limit", "level")


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


@contextmanager
def controller(drive: MptcDrive, words: joined.Parameters) -> Iterator[Any]:
    """Yield the RTL, fresh from a reset, as a function with the signature of ``ideal.decide``.

    Parameters
    ----------
    drive : MptcDrive
        Supplies the formats.
    words : joined.Parameters

    Raises
    ------
    SimulationError
        From the function, where the RTL differs from its twin in anything.
    """
    formats = bit_true.parameters(drive)[1:]
    state = joined.initial()
    fixed = held_inputs(words)
    clocks = cycles.DRIVE["MPFC" if words.core[-1] else "MPTC"]
    names = ("is_alpha", "is_beta", "omega_r", "v_dc", "torque_ref", "psi_ref")
    with netlist_check.simulator(ENTITY, GENERICS, ports=ports()) as rtl:

        def decide(_: Any, i: complex, psi: complex, omega_r: float, u: int, *rest: float) -> Any:
            seen, clipped = bit_true.encode_row(*formats, i, 0j, omega_r, *rest)
            m = seen[[0, 1, 4, 5, 6, 7]]
            out, taken = rtl.step(fixed | {n: int(v) for n, v in zip(names, m, strict=True)})
            wanted = joined.step_words(words, state, m)
            found = tuple(out[n] for n in ("u_next", "saturated", "clamped", "exciting"))
            flux = (out["psis_alpha"], out["psis_beta"])
            if (found, flux, taken) != (wanted, tuple(int(v) & 0xFFFF for v in state[4:6]), clocks):
                raise SimulationError(f"{ENTITY}: {found}, {flux}, {taken} clocks, not {wanted}")
            return out["u_next"], out["saturated"] | clipped, out["clamped"]

        yield decide


def tour(
    drive: MptcDrive, psi_ref: float, load: float, inertia: float, legs: tuple[int, int, int, int]
) -> tuple[Scenario, joined.Parameters]:
    """Magnetise and start to 1500 r/min, load step, and reversal to -1500 r/min, in one scenario.

    Parameters
    ----------
    drive : MptcDrive
    psi_ref : float
        Wb.
    load : float
        Of the step, N*m.
    inertia : float
        kg*m^2; the speed PI's proportional gain follows it.
    legs : tuple of int
        Periods: from zero to the load step, under load, without it at 1500 r/min, from the
        reversal on.
    """
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
