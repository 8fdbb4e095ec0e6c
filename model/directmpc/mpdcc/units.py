"""Values of a drive file with a unit, such as "57.61 mohm", made per unit by the file's base."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import Any

from directmpc.drive_tables import described, refused

_PREFIXES = {"": 1.0, "M": 1e6, "k": 1e3, "m": 1e-3, "u": 1e-6}

_KEYS = {
    "V": "voltage vdc link_high link_low v_ph_high v_ph_low v_n_limit bound_vn bound_vph",
    "A": "current current_limit bound_current",
    "ohm": "rs rr r xls xlr xm xd xq x",
    "H": "xls xlr xm xd xq x",
    "F": "xdc xph",
    "Wb": "psi_m",
    "Hz": "frequency speed_limit",
    "s": "ts dead_time minimum_on minimum_off decision_limit watchdog",
}
"""Units, and the keys that take them."""


class Written(float):
    """A value per unit that stands in the file with its unit: what a message has to show."""

    text: str


_VALUE = re.compile(rf"([-+]?[\d.]+(?:e[-+]?\d+)?) *([Mkmu]?)({'|'.join(_KEYS)})")


def _converted(table: str, key: str, value: Any, one: Mapping[str, float]) -> Any:
    """A value in the units `one`, or as it is where it has none, or its key takes none."""
    units = [unit for unit, keys in _KEYS.items() if key in keys.split()]
    if not units or not isinstance(value, str):
        return value
    found = _VALUE.fullmatch(value.strip())
    try:
        if found and found[3] in units:
            made = Written(float(found[1]) * _PREFIXES[found[2]] / one[found[3]])
            made.text = value
            return made
    except ValueError:  # 1.2.3
        pass
    raise refused(
        f"{table}.{key}",
        f"got {described(value)}; it must be a number, or a text of a number and its unit: "
        f"{' or '.join(units)}, with M, k, m or u before it",
    )


def _of_base(base: Mapping[str, Any]) -> dict[str, float]:
    """What 1 pu is, in each unit; empty where the base is no base."""
    values = [base.get(name) for name in ("voltage", "current", "frequency")]
    if not all(isinstance(one, int | float) and one > 0.0 for one in values):
        return {}
    voltage, current, frequency = values
    z, omega = voltage / current, 2.0 * math.pi * frequency
    return {
        "V": voltage, "A": current, "ohm": z, "H": z / omega, "F": 1.0 / (omega * z),
        "Wb": voltage / omega, "Hz": frequency, "s": 1.0,
    }  # fmt: skip


def _text(value: float, unit: str, rounding: str) -> str:
    """A value as a file may have it, in four digits."""
    power = math.floor(math.log10(value) / 3.0) if value > 0.0 else 0
    prefix = {factor: name for name, factor in _PREFIXES.items()}.get(10.0 ** (3 * power), "")
    digits = Context(4, rounding).create_decimal_from_float(value / _PREFIXES[prefix])
    return f'"{digits.normalize():f} {prefix}{unit}"'


def ranges(tables: Mapping[str, Any], table: str, key: str, low: float, high: float) -> str:
    """The range of a key per unit as texts with a unit; empty where it takes none."""
    base = tables.get("base")
    one = _of_base(base) if isinstance(base, Mapping) and table != "base" else {}
    units = [unit for unit, keys in _KEYS.items() if key in keys.split() and unit != "s"]
    return "".join(
        f", or from {_text(low * one[unit], unit, ROUND_CEILING)} to "
        f"{_text(high * one[unit], unit, ROUND_FLOOR)}"
        for unit in units
        if one
    )


def per_unit(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of a drive file with units in V, A, Hz and s turned per unit; copied.

    Where the base is no base, the other tables stay as they were.
    """
    found = dict(tables)
    if isinstance(found.get("base"), Mapping):
        plain = dict.fromkeys(_KEYS, 1.0)
        found["base"] = {k: _converted("base", k, v, plain) for k, v in found["base"].items()}
        one = _of_base(found["base"])
        for name, table in found.items():
            if one and name != "base" and isinstance(table, Mapping):
                found[name] = {k: _converted(name, k, v, one) for k, v in table.items()}
    return found
