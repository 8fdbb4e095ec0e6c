"""A new drive file with every key, each with meaning, unit, range and default."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from directmpc.api.nameplate import Nameplate
from directmpc.output_files import check_output
from scripts.generate import drive_template
from scripts.shared import tools
from scripts.shared.command import InputError, UsageError, command, option


def _plate(text: str) -> Nameplate:
    """A plate as a user writes it: ``power=4,voltage=400,current=8.2,...``."""
    names = [field.name for field in dataclasses.fields(Nameplate)]
    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = (piece.strip() for piece in part.partition("="))
        if name not in names:
            raise ValueError(f"got {name!r:.40}; it may hold {', '.join(names)}, each = a number")
        if name in found:
            raise ValueError(f"{name}: given twice; one value is needed")
        try:
            found[name] = float(value)
        except ValueError:
            raise ValueError(f"{name}: got {value!r:.40}; it must be a number") from None
    if missing := [name for name in names if name not in found and name != "frequency"]:
        raise ValueError(f"{missing[0]}: missing; a plate needs {', '.join(names[:-1])}")
    return Nameplate(**found | {"power": 1e3 * found["power"]})


@command(outputs=())
@option("controller", choices=tuple(drive_template.EXAMPLES), help="controller of the drive")
@option("file", type=Path, help="file to write; it may not exist, its folder must")
@option(
    "--nameplate",
    metavar="NAME=VALUE,...",
    help="estimate an induction machine from its name plate: power (kW), voltage (V, line to "
    "line), current (A), cos_phi, speed (r/min), breakdown (breakdown torque over rated), and "
    "frequency (Hz; 50 without); voltage and current of the connection in use, star or delta",
)
def cli(given: argparse.Namespace) -> int | None:
    path = given.file
    if path.exists() or path.is_symlink():
        raise InputError(f"{path}: exists and stays as it is; a new name is needed")
    check_output(path)
    drive, said = None, list[str]()
    if given.nameplate is not None:
        try:
            drive, said = drive_template.of_plate(given.controller, _plate(given.nameplate))
        except ValueError as error:
            raise UsageError(f"argument --nameplate: {error}") from None
    tools.write(path, drive_template.template(given.controller, drive, said))
    for text in said:
        print(text)
    print(f"{path}: put in your drive's values; docs/drive-file.md says how to get them")
    return 0
