"""Replay of a recorded trace through the RTL or one of its models.

Rows of a trace of MPDCC or MPTC are independent of one another, so a long trace is split over two
simulators. A controller of K-best goes on with its plan from row to row. Which columns a
trace and its decisions have, and who decides, follows from the drive file's `controller`: one entry
of ``CONTROLLERS`` each.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.api.controllers import RtlController
from directmpc.api.drive_file import load_drive
from directmpc.csv_table import RowError
from directmpc.host.console import progress_bar
from directmpc.kbest import bit_true as kbest_bit_true
from directmpc.kbest import ideal as kbest_ideal
from directmpc.kbest.coefficients import only_built
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc import ideal, trace
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.formats import MEASUREMENTS
from directmpc.mpdcc.trace import Decisions, IntArray, MpdccTrace
from directmpc.mpdcc.variants import DEFAULT_VARIANT, VARIANTS, decisions_of, served
from directmpc.mptc import trace as mptc_trace
from directmpc.mptc.drive import MptcDrive
from directmpc.output_files import check_output
from scripts.hdl import mptc_replay
from scripts.hdl import native as natives
from scripts.hdl.mpdcc_simulation import native_design, simulate_rows
from scripts.shared.command import InputError
from scripts.shared.figures import counted

ENGINES = ("rtl", "ghdl", "model", "ideal")
#: Those that simulate the VHDL.
RTL = ("rtl", "ghdl")
DEFAULT_EXPLORERS = 2


@dataclass(frozen=True)
class Request:
    """What a replay was asked for."""

    #: Files to read.
    drive: Path
    trace: Path
    out: Path  #: File to write the decisions to.
    engine: str  #: One of ``ENGINES``.
    #: Configuration of ``mpdcc_core``; an MPTC drive ignores them.
    explorers: int
    variant: str


def _decide_mpdcc(
    drive: Drive,
    rows: MpdccTrace,
    engine: str,
    explorers: int,
    variant: str,
    progress: Callable[[int], None] | None = None,
) -> Decisions:
    """Decisions of one engine on every row of a trace."""
    if engine == "ideal":
        return ideal.run(drive, rows)
    chosen = VARIANTS[variant]
    # A number near the largest float leaves its range when scaled; it saturates all the same.
    with np.errstate(over="ignore"):
        if engine == "model":
            return chosen.run(drive, rows)
        measurements, clipped = common.encode(rows)
    values = chosen.registers(drive).array()
    design = native_design(explorers, variant, values)
    native = engine == "rtl" and design != "" and natives.prefer(design, len(rows))
    answered = simulate_rows(
        measurements, rows.s_prev, values, explorers, variant, progress, native=native
    )
    return decisions_of(answered, clipped)


def _replay_mpdcc(drive: Drive, request: Request) -> None:
    """Read an MPDCC trace, decide, and write the decisions."""
    drive, note = served(drive, request.variant)
    if note:
        print(f"{request.drive}: {note}", file=sys.stderr)
    rows = trace.read_trace(request.trace, drive)
    with _watched(
        request, f"replay on {counted(request.explorers, 'explorer')}", len(rows)
    ) as progress:
        decisions = _decide_mpdcc(
            drive, rows, request.engine, request.explorers, request.variant, progress
        )
    trace.write_decisions(request.out, decisions)
    _say_saturated(request, decisions.saturated)


def _replay_kbest(drive: KbestDrive, request: Request) -> None:
    """Read a trace of K-best, decide row after row, and write the decisions."""
    engines = {"ideal": kbest_ideal.run, "model": kbest_bit_true.run, "rtl": _kbest_rtl}
    if request.engine not in engines:
        names = ", ".join(f'"{name}"' for name in engines)
        raise InputError(
            f'{request.drive}: ENGINE: got "{request.engine}"; a drive of kbest has {names}'
        )
    _ignored(request, "kbest")
    rows = trace.read_trace(request.trace, drive)
    with _watched(request, "replay of K-best", len(rows)):
        decisions = engines[request.engine](drive, rows)
    trace.write_decisions(request.out, decisions)
    _say_saturated(request, decisions.saturated)


def _kbest_rtl(drive: KbestDrive, rows: MpdccTrace) -> Decisions:
    """Decisions of the native library on every row."""
    only_built(drive)
    natives.write(["kbest_system"])
    design = RtlController(drive).design
    with np.errstate(over="ignore"):
        words, clipped = common.encode(rows)
    ports = (*MEASUREMENTS, "s_prev_a", "s_prev_b", "s_prev_c")
    shown = ("s_a", "s_b", "s_c", "held", "saturated")
    out = np.zeros((len(rows), 7), np.int64)
    cycles = np.zeros(len(rows), np.int64)
    for n, row in enumerate(np.hstack([words, rows.s_prev]).tolist()):
        design.give(dict(zip(ports, row, strict=True)))
        answer, cycles[n] = design.decide()
        out[n, [0, 1, 2, 3, 6]] = [answer[name] for name in shown]
    out[:, 6] |= clipped
    return replace(Decisions.of_words(out), cycles=cycles)


def _ignored(request: Request, controller: str) -> None:
    """Say that settings of `mpdcc_core` were given for another controller."""
    if (request.explorers, request.variant) != (DEFAULT_EXPLORERS, DEFAULT_VARIANT):
        print(
            f"{request.drive}: EXPLORERS and VARIANT mean nothing to a drive of {controller} and "
            "are ignored",
            file=sys.stderr,
        )


def _replay_mptc(drive: MptcDrive, request: Request) -> None:
    """Read an MPTC trace, decide with the drive's method, and write the decisions."""
    rows = mptc_trace.read_trace(request.trace, sequences=drive.control.sequences)
    _ignored(request, "mptc")
    with _watched(request, f"replay on mptc_core, {drive.control.method}", len(rows)) as progress:
        decisions = mptc_replay.decide(drive, rows, request.engine, progress)
    mptc_trace.write_decisions(request.out, decisions)
    _say_saturated(request, decisions.saturated)


def _say_saturated(request: Request, saturated: IntArray) -> None:
    """Say how many rows hold a value that no word holds."""
    if count := int(np.count_nonzero(saturated)):
        print(
            f"{request.trace}: {count} of {len(saturated)} rows saturated: a value is beyond its "
            "full scale, perhaps in another unit",
            file=sys.stderr,
        )


@contextmanager
def _watched(request: Request, text: str, total: int) -> Iterator[Callable[[int], None] | None]:
    """Show how far the RTL is; what is wrong with the drive's values gets its file's name."""
    try:
        if request.engine in RTL:
            with progress_bar(text, total) as progress:
                yield progress
        else:
            yield None
    except RowError as error:
        raise InputError(f"{request.trace}, line {error.row + 2}: {error.reason}") from error
    except ValueError as error:  # names the key, but does not know the file
        raise InputError(f"{request.drive}: {error}") from error


CONTROLLERS: dict[str, Callable[[Any, Request], None]] = {
    "kbest": _replay_kbest,
    "mpdcc": _replay_mpdcc,
    "mptc": _replay_mptc,
}
"""Who replays a trace, by the drive file's key `controller`."""


def replay(request: Request) -> None:
    """Read a trace, let an engine decide on every row, and write the decisions."""
    check_output(request.out, request.drive, request.trace)
    drive = load_drive(request.drive)
    CONTROLLERS[drive.controller](drive, request)
