"""`make run`: the RTL, simulated, controls a drive in closed loop; prints and draws the result."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import math
import sys
from pathlib import Path
from typing import Any

from rich.console import Console

from directmpc.api.drive_file import load_drive
from directmpc.host.console import check_output, terminable
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.errors import NO_ERRORS, DriveErrors
from directmpc.mpdcc.trace import write_decisions, write_trace
from directmpc.mpdcc.variants import DEFAULT_VARIANT, VARIANTS
from scripts.hdl.mpdcc_simulation import EXPLORERS
from scripts.hdl.waves import view
from scripts.shared.command import Command, InputError, UsageError
from scripts.shared.tools import BUILD, ROOT, replacing, write
from scripts.studies import rtl_loop

OUTPUTS = {
    "out": "picture",
    "trace": "trace",
    "decisions": "decisions",
    "waves": "signals",
    "view": "their view",
}
"""Arguments that name a file to write, and what it is; `view` follows from `waves`."""


def _errors(text: str) -> DriveErrors:
    """Errors as a user writes them: ``noise_current=0.005,bits=12``."""
    kinds = {field.name: type(field.default) for field in dataclasses.fields(DriveErrors)}
    found: dict[str, Any] = {}  # what each field's type made of its text
    for part in text.split(","):
        name, _, value = part.strip().partition("=")
        if name not in kinds:
            raise argparse.ArgumentTypeError(
                f"got {name!r:.40}; it may hold {', '.join(kinds)}, each with = and a number"
            )
        try:
            found[name] = kinds[name](value)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{name}: got {value!r:.40}; not a number") from None
    try:
        return DriveErrors(**found)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--drive", type=Path, default=ROOT / "drives" / "anpc5l_6kv.toml")
    parser.add_argument("--speed", type=float, default=1.0, help="stator frequency, per unit")
    parser.add_argument("--steps", type=int, help="control steps; two fundamental periods without")
    parser.add_argument("--explorers", type=int, choices=EXPLORERS, default=2, metavar="1..8")
    parser.add_argument("--variant", choices=tuple(VARIANTS), default=DEFAULT_VARIANT)
    parser.add_argument(
        "--errors",
        type=_errors,
        default=NO_ERRORS,
        metavar="NAME=VALUE,...",
        help="errors of sensors and switches, see directmpc.DriveErrors",
    )
    parser.add_argument("--out", type=Path, default=BUILD / "run.png", help="picture")
    parser.add_argument("--trace", type=Path, help="what the RTL saw: a trace for replay (CSV)")
    parser.add_argument("--decisions", type=Path, help="what it decided, as replay writes it (CSV)")
    parser.add_argument(
        "--waves",
        type=Path,
        nargs="?",
        const=BUILD / "run.fst",
        help="every signal (FST), with a view for GTKWave beside it (.gtkw); build/run.fst if no "
        "file is named",
    )


def _outputs(given: argparse.Namespace) -> dict[str, Path]:
    """The files that are asked for, each of which can be written."""
    outputs = {name: path for name in OUTPUTS if (path := getattr(given, name, None)) is not None}
    for name, path in outputs.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        check_output(path, given.drive)
        for other, another in outputs.items():
            if other != name and another.resolve() == path.resolve():
                raise UsageError(f"{path} is asked for twice, as --{name} and as --{other}")
    return outputs


def _run(given: argparse.Namespace) -> int | None:
    if given.steps is not None and given.steps < 1:
        raise UsageError(f"argument --steps: got {given.steps}; at least 1 is needed")
    if not math.isfinite(given.speed) or abs(given.speed) > 2.0:
        raise UsageError(f"argument --speed: got {given.speed:g}; it must be from -2 to 2 pu")
    console = Console(width=None if sys.stdout.isatty() else 110)
    drive = load_drive(given.drive)
    if not isinstance(drive, Drive):
        raise InputError(
            f"{given.drive}: controller: got {drive.controller!r}; this command simulates drives "
            "of mpdcc. For the others: make replay, with a trace; directmpc.simulate closes the "
            "loop with the bit-true model and writes such a trace"
        )
    if given.speed == 0.0:
        raise InputError("--speed: got 0; a stator frequency other than 0 is needed")
    if given.waves is not None:
        given.view = given.waves.with_suffix(".gtkw")
    outputs = _outputs(given)
    with terminable(), contextlib.ExitStack() as files:
        # none of them replaces an older one before all are whole
        new = {name: files.enter_context(replacing(path)) for name, path in outputs.items()}
        try:
            run = rtl_loop.simulate(
                drive, given.speed, given.steps, given.explorers, given.variant, given.errors,
                new.get("waves"),
            )  # fmt: skip
        except ValueError as error:  # names the key, but does not know the file
            raise InputError(f"{given.drive}: {error}") from error
        rtl_loop.draw(run, new["out"])
        if "trace" in new:
            write_trace(new["trace"], run.result.seen)
        if "decisions" in new:
            write_decisions(new["decisions"], run.result.decisions)
        if "view" in new:
            write(new["view"], view(given.waves.name, rtl_loop.signals()))
    base = drive.base
    console.print(
        f"{given.drive.name}: {len(run.result)} steps of {1e6 * drive.control.ts:g} us at "
        f"{given.speed * base.frequency:g} Hz and rated current; RTL simulated in "
        f"{run.seconds:.0f} s"
    )
    console.print(rtl_loop.outcome(run))
    console.print(rtl_loop.latency(run))
    for name, path in outputs.items():
        console.print(f"{OUTPUTS[name]}: {path}", soft_wrap=True)
    if run.differing:
        print(
            f"run: {run.differing} of {len(run.result)} decisions of the RTL differ from its "
            "bit-true model",
            file=sys.stderr,
        )
        return 1
    return 0


COMMAND = Command(
    "run",
    __doc__.splitlines()[0],
    _arguments,
    _run,
    interrupted="nothing was written",
    outputs=tuple(OUTPUTS),
)
