"""From a drive to register values: what a host computes and writes once per drive."""

from __future__ import annotations

import argparse
import os
import sys

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc import formats
from directmpc.mpdcc.coefficients import format_csv, format_table, registers
from scripts.shared.command import InputError, command, option


@command()
@option("drive", help="drive file (TOML)")
@option("--csv", action="store_true", help="comma-separated, for a program to read")
@option(
    "--variant", choices=sorted(formats.BOUND_HIGH), default="fast", help="explorers of the core"
)
def cli(given: argparse.Namespace) -> None:
    drive = load_mpdcc_drive(given.drive)
    try:
        values = registers(drive, given.variant)
    except ValueError as error:  # names the key, but does not know the file
        raise InputError(f"{given.drive}: {error}") from error
    try:
        print(format_csv(values) if given.csv else format_table(values), flush=True)
    except BrokenPipeError:  # a reader such as head has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
