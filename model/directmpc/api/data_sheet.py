"""Data sheet of a drive: rated values, time constants, full scales, and what is odd.

A drive file in other units than it should have, in mH for H or in ampere for per unit, is often
within the ranges of its keys. What follows from it then is not: `doubts` names it.
"""

from __future__ import annotations

import math

from directmpc.kbest.drive import KbestDrive
from directmpc.loads.load import Fact
from directmpc.mpdcc.drive import Drive, PerUnitDrive
from directmpc.mpdcc.formats import CURRENT, FLUX, SPEED
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.plant import breakdown_torque, slip

SHARE_OF_FLUX = 0.75
"""Of `psi_max`, for what depends on the flux of a two-level drive; `make run` asks for the same."""

RPM = 2.0 * math.pi / 60.0


def data_sheet(drive: Drive | KbestDrive | MptcDrive) -> list[Fact]:
    """What a data sheet would say of a drive, per unit with the SI value; SI alone for MPTC."""
    return _SHEETS[drive.controller](drive)


def doubts(drive: Drive | KbestDrive | MptcDrive) -> list[str]:
    """What of a drive is outside the usual range, with its probable cause.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        Of any kind.

    Returns
    -------
    list of str
        One sentence each; empty for a usual drive.
    """
    return [
        f"{fact.name}: {fact.value:.4g} {fact.unit}".rstrip()
        + f" is not within the usual {fact.low:.4g} to {fact.high:.4g}; {fact.hint}"
        for fact in data_sheet(drive)
        if not fact.low <= fact.value <= fact.high
    ]


def _per_unit(drive: PerUnitDrive) -> list[Fact]:
    """Facts of a drive per unit: base values, the load's, inverter, control, full scales."""
    base, inverter = drive.base, drive.inverter
    omega = 2.0 * math.pi * base.frequency
    z = base.voltage / base.current
    power = 1.5 * base.voltage * base.current
    #: SI of 1 pu, and its unit.
    units = {
        "voltage": (base.voltage, "V peak"), "current": (base.current, "A peak"),
        "power": (1e-3 * power, "kW"), "torque": (power / omega, "N m per pole pair"),
        "time": (1e3 / omega, "ms"), "reactance": (1e3 * z / omega, "mH"),
        "frequency": (base.frequency, "Hz"), "flux": (base.voltage / omega, "Wb peak"),
    }  # fmt: skip

    def with_si(fact: Fact) -> Fact:
        if fact.quantity not in units:
            return fact
        scale, unit = units[fact.quantity]
        return fact._replace(si=f"{fact.value * scale:.4g} {unit}")

    most = inverter.vdc / math.sqrt(3.0)
    needed = abs(drive.machine.steady_state(1.0).v_s)
    facts = [
        Fact(
            "rated voltage", 1.0, "pu", si=f"{base.voltage * math.sqrt(1.5):.4g} V line-to-line rms"
        ),
        Fact("rated current", 1.0, "pu", si=f"{base.current / math.sqrt(2.0):.4g} A rms"),
        Fact("rated apparent power", 1.0, "pu", si=f"{1e-3 * power:.4g} kVA"),
        Fact("base impedance", 1.0, "pu", si=f"{z:.4g} ohm"),
        *drive.machine.facts(most),
        Fact(
            "largest voltage of the inverter", most, "pu", needed, math.inf,
            f"at rated current and frequency the load needs {needed:.3g} pu: inverter.vdc is too "
            "low, or a value of [machine] or [base] is wrong",
            quantity="voltage",
        ),
        Fact(
            "half of the dc link", inverter.xdc, "pu", si=f"{1e6 * inverter.xdc / omega / z:.4g} uF"
        ),
        Fact("phase capacitor", inverter.xph, "pu", si=f"{1e6 * inverter.xph / omega / z:.4g} uF"),
        Fact("control period", drive.ts_pu, "pu", quantity="time"),
    ]  # fmt: skip
    step = drive.machine.matrices.b[0] * drive.ts_pu * inverter.vdc / 6.0
    facts.append(
        Fact(
            "current step of one level in a control period",
            float(step),
            "pu",
            5e-4,
            0.1,
            "control.ts, base.frequency or a reactance of [machine] may be in another unit",
            quantity="current",
        )
    )
    if (inertia := drive.mechanics.inertia) is not None:
        facts.append(
            Fact(
                "run-up to rated frequency at 1 pu of torque", 2.0 * inertia, "s", 0.02, 60.0,
                "mechanics.inertia is in s: J omega^2 / 2 at rated frequency over rated power",
            )
        )  # fmt: skip
    if (bound := getattr(drive.control, "bound_current", None)) is not None:
        facts.append(Fact("current THD by the bound, about", 0.7 * bound, "", si=""))
    facts += [
        Fact("full scale of currents", CURRENT.high / CURRENT.scale, "pu", quantity="current"),
        Fact("full scale of the flux", FLUX.high / FLUX.scale, "pu", quantity="flux"),
        Fact("full scale of speeds", SPEED.high / SPEED.scale, "pu", quantity="frequency"),
    ]
    return [with_si(fact) for fact in facts]


def _in_si(drive: MptcDrive) -> list[Fact]:
    """Facts of a drive in SI, at the flux that `make run` asks for."""
    m, c = drive.machine, drive.control
    psi, most = SHARE_OF_FLUX * c.psi_max, drive.inverter.vdc / math.sqrt(3.0)
    base = most / psi
    sigma = 1.0 - m.lm * m.lm / (m.ls * m.lr)
    peak = breakdown_torque(drive, psi)
    usual = min(0.5 * c.torque_max, 0.999 * peak)
    inductance = "inductances of [machine] are in H, resistances in ohm"
    runup = []
    if drive.mechanics.inertia is not None:
        time = drive.mechanics.inertia * base / m.pole_pairs / usual
        runup = [
            Fact(
                "run-up to that speed at half of control.torque_max", time, "s", 0.01, 60.0,
                "mechanics.inertia is in kg m^2",
            )
        ]  # fmt: skip
    return [
        Fact("flux that the rest is for", psi, "Wb"),
        Fact("speed that vdc carries at it", base, "rad/s", si=f"{base / (2 * math.pi):.4g} Hz"),
        Fact("the same on the shaft", base / m.pole_pairs / RPM, "r/min"),
        Fact(
            "magnetising current, of control.current_max", psi / m.ls / c.current_max, "",
            0.02, 0.9, f"{inductance}; control.current_max is in A, control.psi_max in Wb",
            si=f"{psi / m.ls:.4g} A",
        ),
        Fact("breakdown torque", peak, "N m"),
        Fact(
            "control.torque_max, of the breakdown torque", c.torque_max / peak, "", 0.02, 1.5,
            f"control.torque_max is in N m, control.psi_max in Wb; {inductance}",
        ),
        Fact(
            "slip at half of control.torque_max, of the speed above",
            slip(drive, usual, psi) / base, "", 0.0005, 0.3, f"machine.rr is in ohm; {inductance}",
        ),
        Fact("stator time constant", sigma * m.ls / m.rs, "s", 3e-4, 1.0, inductance),
        Fact("rotor time constant", m.lr / m.rr, "s", 0.01, 5.0, inductance),
        Fact("leakage factor", sigma, "", 0.005, 0.5, "machine.ls and machine.lr hold lm too"),
        Fact(
            "voltage over machine.rs at control.current_max, of what vdc makes",
            m.rs * c.current_max / most, "", 0.002, 0.6,
            "machine.rs is in ohm, control.current_max in A, inverter.vdc in V",
        ),
        Fact(
            "control.speed_max, of the speed that vdc carries", c.speed_max / base, "", 0.1, 4.0,
            "control.speed_max is in electrical rad/s: r/min times 0.105 times pole pairs",
        ),
        *runup,
        Fact("full scale of the flux", c.psi_max, "Wb"),
        Fact("full scale of the current", c.current_max, "A"),
        Fact("full scale of the torque", c.torque_max, "N m"),
        Fact("full scale of the speed", c.speed_max / m.pole_pairs / RPM, "r/min"),
    ]  # fmt: skip


_SHEETS = {"mpdcc": _per_unit, "kbest": _per_unit, "mptc": _in_si}
"""Facts of a drive, by its controller."""
