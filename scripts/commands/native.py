"""Build the native libraries of the cores: the engine "rtl" of the Python library."""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from directmpc import Drive, MptcDrive, RtlController, simulate
from directmpc.api.drive_file import load_drive
from directmpc.fmu import write_controller
from directmpc.fmu.variables import system_of
from directmpc.native import NativeError, library
from directmpc.states import Decision, State
from scripts.hdl import native
from scripts.shared import progress
from scripts.shared.command import command, option
from scripts.shared.tools import ToolError, version

#: Decisions that a rate is taken over, and the drives.
COUNT = 2000
DRIVES = ("anpc5l_6kv", "induction_2kw2")


def _design(name: str) -> str:
    """A name on the command line; `choices` would refuse that there is none."""
    if name not in native.DESIGNS:
        raise argparse.ArgumentTypeError(f"got {name!r}; it must be of {', '.join(native.DESIGNS)}")
    return name


def _rate(work: Callable[[], object]) -> float:
    """Decisions a second of processor time, in the second run."""
    work()
    began = time.process_time()
    work()
    return COUNT / (time.process_time() - began)


class _Recorder(RtlController):
    """Keeps what it decides on."""

    def __init__(self, drive: Drive | MptcDrive) -> None:
        super().__init__(drive)
        self.states: list[State] = []

    def decide(self, state: Any) -> Decision:
        """Decide as the core does."""
        self.states.append(state)
        return super().decide(state)


def _rates(drive: Drive | MptcDrive) -> list[float]:
    """Decisions a second of `simulate`, of `RtlController.decide`, and of the FMU in FMPy."""
    import fmpy  # of the tests alone

    native.write([f"{drive.controller}_core", system_of(drive)])
    core = _Recorder(drive)
    simulate(drive, core, steps=COUNT)
    states = core.states[:COUNT]
    plain = RtlController(drive)
    with tempfile.TemporaryDirectory(prefix="directmpc-") as folder:
        path = str(write_controller(drive, Path(folder) / "core.fmu", windows=False))
        about = fmpy.read_model_description(path)
        one = fmpy.instantiate_fmu(fmpy.extract(path, folder), about)
        one.enterInitializationMode()
        one.exitInitializationMode()
        number = {v.name: v.valueReference for v in about.modelVariables}
        places, done = [number["is_alpha"], number["is_beta"]], 0

        def steps() -> None:
            nonlocal done
            for state in states:
                one.setFloat64(places, [state.current.real, state.current.imag])
                one.doStep(done * drive.control.ts, drive.control.ts)
                done += 1

        found = [
            _rate(lambda: simulate(drive, "rtl", steps=COUNT)),
            _rate(lambda: [plain.decide(state) for state in states]),
            _rate(steps),
        ]
        one.terminate()
        one.freeInstance()
    return found


@command(failed=1)
@option(
    "designs", nargs="*", type=_design, metavar="DESIGN",
    help=f"{', '.join(native.DESIGNS)}; all without one",
)  # fmt: skip
@option(
    "--rates", action="store_true",
    help="print decisions a second of one core instead, in Python and in FMPy",
)  # fmt: skip
def cli(given: argparse.Namespace) -> int | None:
    try:
        if given.rates:
            tools_ = library.verilator().version, version(library.compiler()[0])
            print(f"Decisions a second of processor time of one core; {', '.join(tools_)}.\n")
            print('| drive | `simulate(drive, "rtl")` | `RtlController.decide` | FMPy, `doStep` |')
            print("| --- | --- | --- | --- |")
            for name in DRIVES:
                rates = _rates(load_drive(name))
                print(f"| {name} | {' | '.join(f'{rate:,.0f}' for rate in rates)} |", flush=True)
            return 0
        for design in given.designs or native.DESIGNS:
            with progress.busy(f"conversion of {design}"):
                native.write([design])
            print(library.build(design))
    except NativeError as error:
        raise ToolError(str(error)) from None
    return 0
