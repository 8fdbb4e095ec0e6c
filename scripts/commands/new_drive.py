"""A new drive file with every key, each with meaning, unit, range and default."""

from __future__ import annotations

import argparse
from pathlib import Path

from directmpc.output_files import check_output
from scripts.generate import drive_template
from scripts.shared import tools
from scripts.shared.command import Command, InputError


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "controller", choices=tuple(drive_template.EXAMPLES), help="controller of the drive"
    )
    parser.add_argument("file", type=Path, help="file to write; it may not exist, its folder must")


def _run(given: argparse.Namespace) -> int | None:
    path = given.file
    if path.exists() or path.is_symlink():
        raise InputError(f"{path}: exists and stays as it is; a new name is needed")
    check_output(path)
    tools.write(path, drive_template.template(given.controller))
    print(f"{path}: put in your drive's values; docs/drive-file.md says how to get them")
    return 0


COMMAND = Command("new-drive", __doc__, _arguments, _run, outputs=())
