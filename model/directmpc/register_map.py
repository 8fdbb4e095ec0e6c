"""Addresses and fields of the registers: ``register_map.json``, which ``make generate`` writes."""

from __future__ import annotations

import functools
import json
from importlib import resources


@functools.cache
def _maps() -> dict[str, dict[str, tuple[int, dict[str, tuple[int, int, bool]]]]]:
    text = (resources.files("directmpc") / "register_map.json").read_text(encoding="utf-8")
    return {
        controller: {
            name: (address, {key: tuple(place) for key, place in fields.items()})
            for name, (address, fields) in known.items()
        }
        for controller, known in json.loads(text).items()
        if controller
    }


def registers_of(controller: str) -> dict[str, tuple[int, dict[str, tuple[int, int, bool]]]]:
    """Register map: name -> (byte address, {field: (lowest bit, bits, signed)})."""
    return _maps()[controller]
