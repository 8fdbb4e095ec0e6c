"""The text of a new drive file: every key, each with its meaning, its range and its default.

Keys, ranges and defaults are read from the tables that check a drive file, so that a template has
every key that a drive file may have. The values are those of a shipped drive, which has the
settings that the studies recommend.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import Any

from directmpc.api.drive_file import DRIVES, load_drive
from directmpc.api.nameplate import COPPER_SHARE, Nameplate, estimate
from directmpc.drive_tables import GuardTable, allowed, keys_of

EXAMPLES = {"mpdcc": "anpc5l_6kv", "kbest": "anpc5l_6kv_kbest", "mptc": "motulator_2kw2"}
"""Drive that ships, by controller: its values stand in the template, with five digits at most."""

RECOMMENDED: dict[str, tuple[str, ...]] = {
    "mpdcc": ("budget", "deadlock_rule", "outside_rule", "capacitor_filter"),
    "kbest": (),
    "mptc": (),
}
"""Keys of `control` that the studies recommend and the shipped drives have, by controller."""

HEADS = {
    "mpdcc": "Drive file of MPDCC: multilevel converter, induction machine, per unit.",
    "kbest": "Drive file of K-best: multilevel converter, induction machine, per unit.",
    "mptc": "Drive file of MPTC and MPFC: two-level inverter, induction machine, SI.",
}

_GUARD_TABLE = (
    "What the devices of the inverter and their drivers need. ASSUMED values: put in yours. They "
    "may be left out of a file that only simulates."
)

_GUARD = {
    "guard.dead_time": "Time from a gate's off to the on of a gate that shorts a source with it.",
    "guard.minimum_on": "Shortest time that a gate is on. A stop alone cuts it short.",
    "guard.minimum_off": "Shortest time that a gate is off.",
    "guard.decision_limit": "Longest time from the start of a step to its decision.",
    "guard.watchdog": "Longest time between two decisions: how long the drive may run on one.",
    "guard.current_limit": "A phase current above it turns the gates off.",
    "guard.link_high": "A dc-link voltage above it turns the gates off.",
    "guard.link_low": "A dc-link voltage below it turns the gates off.",
    "guard.v_ph_high": "A phase capacitor above it turns the gates off. Nominal: a quarter of vdc.",
    "guard.v_ph_low": "A phase capacitor below it turns the gates off: charge them before a start.",
    "guard.v_n_limit": "A neutral point beyond it, either sign, turns the gates off.",
    "guard.speed_limit": "A measured speed beyond it, either sign, turns the gates off.",
    "guard.frozen": "So many measurements with the same currents, with gates on, turn them off. 0: "
    "any number.",
}

_MECHANICS_TABLE = (
    "Shaft, for simulations with a speed controller: docs/outer-loop.md. It may be left out."
)

_PER_UNIT_TABLES = {
    "base": "Base values. Only the frequency has an effect: it sets the unit of time.",
    "machine": "Star circuit, rotor referred to the stator, per unit.",
    "mechanics": _MECHANICS_TABLE,
    "inverter": "Per unit.",
    "guard": _GUARD_TABLE,
    "control": "Bounds are half widths, per unit.",
}

TABLES = {
    "mpdcc": _PER_UNIT_TABLES,
    "kbest": _PER_UNIT_TABLES,
    "mptc": {
        "machine": "T circuit, rotor referred to the stator. ls lr has to be above lm^2.",
        "mechanics": _MECHANICS_TABLE,
        "inverter": "SI.",
        "guard": _GUARD_TABLE,
        "control": "What lies beyond a full scale saturates: choose it above what may occur.",
    },
}
"""What stands under the head of each table."""

_PER_UNIT = _GUARD | {
    "controller": "Which controller.",
    "base.voltage": "Base voltage, peak of a phase: sqrt(2/3) of the rated line-to-line rms.",
    "base.current": "Base current, peak: sqrt(2) of the rated rms.",
    "base.frequency": "Rated frequency.",
    "machine.type": "Kind of load: docs/loads.md has the keys of PMSM, grid and RL.",
    "machine.rs": "Stator resistance, R / Z_base.",
    "machine.rr": "Rotor resistance, R / Z_base.",
    "machine.xls": "Stator leakage reactance, omega_base L / Z_base.",
    "machine.xlr": "Rotor leakage reactance, omega_base L / Z_base.",
    "machine.xm": "Magnetising reactance, omega_base L / Z_base.",
    "mechanics.inertia": "Kinetic energy at rated frequency over rated apparent power; drive and "
    "load.",
    "mechanics.friction": "Torque of the friction at rated frequency, proportional to the speed.",
    "inverter.topology": "A file of converters/: docs/converters.md.",
    "inverter.vdc": "Voltage of the whole dc link, V_dc / V_base.",
    "inverter.xdc": "One half of the dc link, omega_base C Z_base.",
    "inverter.xph": "One phase capacitor, omega_base C Z_base.",
    "control.delay_compensation": "true if a decision takes effect one control period after "
    "its measurement.",
    "control.capacitor_filter": "Filters of the measured capacitor voltages: a measurement "
    "counts 2^-q of itself. 4 where they are noisy, 0 for none: docs/settings.md.",
}

MEANINGS = {
    "mpdcc": _PER_UNIT
    | {
        "control.ts": "Control period.",
        "control.bound_current": "Bound of the phase currents. At rated current the THD is about "
        "0.7 times the bound: 7 % for 0.10.",
        "control.bound_vn": "Bound of the neutral point. A tight bound costs switchings.",
        "control.bound_vph": "Bound of the phase capacitors. A tight bound costs switchings.",
        "control.lambda_n": "Weight of the neutral point at the end of a trajectory, 1/pu^2.",
        "control.horizon": "Longest trajectory that is looked at, control periods.",
        "control.switching_horizon": '"SESE" looks two switchings ahead and switches less often. '
        "It takes longer: docs/settings.md.",
        "control.budget": 'Most candidates of the second level, 0: no limit. Only "SESE" has one. '
        "400 keep one explorer in time at 25 MHz and cost no switchings: docs/settings.md.",
        "control.deadlock_rule": 'What is chosen where nothing stays inside. "weighted" ends most '
        "deadlocks at low speed: docs/settings.md.",
        "control.outside_rule": 'What a variable outside its bound means. "inwards" saves '
        'switchings where measurements are noisy; "dead" where they are exact: '
        "docs/settings.md.",
        "control.leakage_estimate": "true if the leakage is not known well or saturates: an "
        "estimate scales the prediction of the currents: docs/settings.md.",
        "control.extrapolation": "L of the paper variant's straight line, control periods; without "
        "effect on the fast variant: docs/evidence.md.",
        "control.correction": "p of the paper variant's straight line; without effect on the fast "
        "variant: docs/evidence.md.",
    },
    "kbest": _PER_UNIT
    | {
        "control.ts": "Control period.",
        "control.bound_vn": "Bound of the neutral point; soft.",
        "control.bound_vph": "Bound of the phase capacitors; soft.",
        "control.lambda_u": "Cost of a turn-on: less distorts less and switches more.",
        "control.beam": "Plans that live on from stage to stage. 16 distorts less than 8.",
        "control.short_stages": "Stages of one control period at the begin of the horizon.",
        "control.long_stages": "Stages of two control periods behind them; 16 with a beam of 16.",
        "control.soft_margin": "What the cost of an excess begins inside the bounds.",
        "control.weight_vn": "Cost of the square of the neutral point's excess.",
        "control.weight_vph": "Cost of the square of a phase capacitor's excess.",
    },
    "mptc": _GUARD
    | {
        "controller": "Which controller.",
        "machine.rs": "Stator resistance.",
        "machine.rr": "Rotor resistance, referred to the stator.",
        "machine.lm": "Mutual inductance.",
        "machine.ls": "Stator inductance: leakage and mutual.",
        "machine.lr": "Rotor inductance: leakage and mutual.",
        "machine.pole_pairs": "Pole pairs.",
        "mechanics.inertia": "Moment of inertia of drive and load.",
        "mechanics.friction": "Torque of the friction over the mechanical speed.",
        "inverter.topology": "Two-level inverter.",
        "inverter.vdc": "Nominal voltage of the dc link.",
        "control.ts": "Control period.",
        "control.k_psi": "Weight of the flux error against the torque error. 100 serves a machine "
        "of 14 N m and 1 Wb; MPFC needs none: docs/drive-file.md.",
        "control.psi_max": "Full scale of each flux component.",
        "control.current_max": "Full scale of each current component.",
        "control.torque_max": "Full scale of the torque reference.",
        "control.speed_max": "Full scale of the electrical speed.",
        "control.method": "MPTC and MPFC apply one vector a period, the others two or three: "
        "docs/mptc.md.",
        "control.duty_rule": "How MPTC1 and MPTC2 find the duty. The others have none.",
    },
}
"""What each key means, by controller; the test of the template asks for all of them."""

WIDTH = 100


def _number(value: float) -> str:
    """A number as a drive file has it: five digits at most, small times in millionths."""
    if 0.0 < abs(value) < 1e-3:
        return f"{1e6 * value:.5g}e-6"
    text = f"{value:.5g}"
    return text if "." in text or "e" in text else f"{text}.0"


def _value(value: Any) -> str:
    """A value in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    return _number(value) if isinstance(value, float) else str(value)


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="# ", subsequent_indent="# ")


def _key(controller: str, table: type, prefix: str, name: str, value: Any) -> list[str]:
    """Comment and line of a key."""
    dotted = prefix + name
    field = keys_of(table)[name]
    rule = "Required." if field.is_required() else f"Without it: {_value(field.default)}."
    if field.default is None:
        rule = "Required to start the drive."
        if prefix == "mechanics.":
            rule = "Required for a speed controller."
        if name in GuardTable.OPTIONAL:
            rule = "Without it: from control.ts."
    words = allowed(table, name)
    line = f"{name} = {_value(value)}" if value is not None else f"# {name} ="
    return [
        "",
        *_comment(MEANINGS[controller][dotted]),
        *_comment(f"Allowed: {words}. {rule}"),
        line,
    ]


def of_plate(controller: str, plate: Nameplate) -> tuple[Any, list[str]]:
    """The drive of a machine that is estimated from its name plate."""
    found, example = estimate(plate), load_drive(EXAMPLES[controller])
    m, z, omega = found.machine, found.impedance, 2.0 * math.pi * plate.frequency
    voltage, current = plate.voltage * math.sqrt(2.0 / 3.0), plate.current * math.sqrt(2.0)
    henry = z / omega
    if controller == "mptc":
        vdc, flux = _rounded(1.35 * plate.voltage), voltage / omega
        tables: dict[str, dict[str, Any]] = {
            "machine": {
                "rs": m.rs * z, "rr": m.rr * z, "lm": m.xm * henry, "ls": m.xs * henry,
                "lr": m.xr * henry, "pole_pairs": plate.pole_pairs,
            },
            "inverter": {"vdc": vdc},
            "guard": {
                "current_limit": 4.2 * current, "link_high": 1.25 * vdc, "link_low": 0.75 * vdc,
            },
            "control": {
                "psi_max": 1.3 * flux, "current_max": 4.5 * current,
                "torque_max": 2.5 * plate.torque, "speed_max": 1.6 * omega,
                "k_psi": 7.0 * plate.torque / flux,
            },
        }  # fmt: skip
    else:
        tables = {
            "base": {"voltage": voltage, "current": current, "frequency": plate.frequency},
            "machine": {name: getattr(m, name) for name in ("rs", "rr", "xls", "xlr", "xm")},
        }
    rounded = {
        table: {k: _rounded(v) if isinstance(v, float) else v for k, v in keys.items()}
        for table, keys in tables.items()
    }
    shown = ", ".join(
        f"{name} {of_plate:.4g} and {of_machine:.4g}"
        for name, (of_plate, of_machine) in found.residuals.items()
    )
    said = [
        f"ESTIMATE: the machine is estimated from its name plate; {100 * COPPER_SHARE:.0f} % of "
        "the losses are taken for copper's, and both leakages for equal. A measurement is better. "
        "Put in what you know.",
        f"Plate and estimated machine: {shown}.",
    ]
    return example.changed(**rounded), said


def _rounded(value: float) -> float:
    """To four digits."""
    return float(f"{value:.4g}")


def template(controller: str, drive: Any = None, said: Sequence[str] = ()) -> str:
    """The text of a new drive file."""
    if controller not in EXAMPLES:
        raise ValueError(f"controller: got '{controller}'; it must be {' or '.join(EXAMPLES)}")
    model = DRIVES[controller]
    example = load_drive(EXAMPLES[controller]) if drive is None else drive
    lines = _comment(HEADS[controller])
    others = "The other values" if said else "The values"
    lines += [line for text in said for line in _comment(text)]
    lines += _comment(
        f"{others} are those of {EXAMPLES[controller]}.toml, rounded: put in your drive's. "
        "docs/drive-file.md says how to get them."
    )
    if RECOMMENDED[controller]:
        settings = ", ".join(RECOMMENDED[controller])
        lines += _comment(f"What the studies recommend is set: {settings}.")
    tables = {name: getattr(example, name) for name in keys_of(model)}
    for name in (name for name, value in tables.items() if not keys_of(type(value))):
        lines += _key(controller, model, "", name, tables[name])
    for name, table in tables.items():
        if inner := keys_of(type(table)):
            lines += ["", f"[{name}]", *_comment(TABLES[controller][name])]
            for key in inner:
                lines += _key(controller, type(table), f"{name}.", key, getattr(table, key))
    return "\n".join(lines) + "\n"
