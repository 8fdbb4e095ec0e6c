"""`make run`: the RTL or its model controls a drive in closed loop; prints and draws the result."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import math
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from directmpc.api.controllers import ENGINES
from directmpc.api.data_sheet import doubts
from directmpc.api.drive_file import load_drive
from directmpc.api.dynamics import SCENARIOS, scenario
from directmpc.api.kinds import kind_of
from directmpc.api.result import SimulationResult
from directmpc.api.simulation import (
    LEAST_FACTOR,
    MOST_FACTOR,
    check_speed,
    factors_of,
    simulate,
)
from directmpc.drive_tables import allowed
from directmpc.host.console import terminable
from directmpc.kbest import bit_true as kbest_bit_true
from directmpc.kbest.coefficients import only_built
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.errors import DriveErrors
from directmpc.mpdcc.trace import write_decisions, write_trace
from directmpc.mpdcc.variants import DEFAULT_VARIANT, VARIANTS, count_differences, served
from directmpc.mptc import trace as mptc_trace
from directmpc.mptc.closed_loop import RPM
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.errors import MptcErrors, check_errors
from directmpc.output_files import check_output
from scripts.hdl import native as natives
from scripts.hdl.mpdcc_simulation import EXPLORERS
from scripts.hdl.waves import view
from scripts.shared.command import InputError, UsageError, command, option
from scripts.shared.figures import pyplot, save_png
from scripts.shared.tools import BUILD, ROOT, replacing, write
from scripts.studies import mptc_loop, rtl_loop

OUTPUTS = {
    "out": "picture",
    "trace": "trace",
    "decisions": "decisions",
    "waves": "signals",
    "view": "their view",
}
"""Arguments that name a file to write, and what it is; `view` follows from `waves`."""

OF_MPDCC = {
    "kbest": ("explorers", "variant", "waves"),
    "mptc": ("explorers", "variant", "flux_observer"),
}
"""Arguments that drives of other controllers have no use for."""

SCENARIO_ONLY = ("engine", "inertia")
NO_SCENARIO = ("steps", "explorers", "waves")
"""Arguments that a run with a speed controller alone has, and those that it has no use for."""

Outputs = dict[str, Path]


def _pairs(option: str, text: str, names: Iterable[str], what: str) -> dict[str, str]:
    """Values as a user writes them, by name: ``rs=1.5,leakage=0.8``."""
    known, found = tuple(names), dict[str, str]()
    for part in text.split(","):
        name, _, value = (piece.strip() for piece in part.partition("="))
        if name not in known:
            raise UsageError(
                f"argument --{option}: got {name!r:.40}; it may hold {', '.join(known)}, each with "
                f"= and {what}"
            )
        if name in found:
            raise UsageError(f"argument --{option}: {name}: given twice; one value is needed")
        found[name] = value
    return found


def _errors(text: str | None, kind: type[Any]) -> Any:
    """Errors of `kind` as a user writes them: ``noise_current=0.005,bits=12``."""
    types = {field.name: type(field.default) for field in dataclasses.fields(kind)}
    found: dict[str, int | float] = {}
    pairs = {} if text is None else _pairs("errors", text, types, "a number")
    for name, value in pairs.items():
        try:
            found[name] = types[name](value)
        except ValueError:
            needed = "an integer" if types[name] is int else "a number"
            raise UsageError(
                f"argument --errors: {name}: got {value!r:.40}; it must be {needed}"
            ) from None
    try:
        return kind(**found)
    except ValueError as error:
        raise UsageError(f"argument --errors: {error}") from None


def _factors(text: str | None, names: Iterable[str]) -> dict[str, float] | None:
    """Factors of the plant as a user writes them: ``rs=1.5,leakage=0.8``."""
    if text is None:
        return None
    allowed = f"from {LEAST_FACTOR:g} to {MOST_FACTOR:g}"
    found: dict[str, float] = {}
    for name, value in _pairs("plant", text, names, f"a factor {allowed}").items():
        try:
            factor = float(value)
        except ValueError:
            raise UsageError(
                f"argument --plant: {name}: got {value!r:.40}; it must be a number {allowed}"
            ) from None
        if not LEAST_FACTOR <= factor <= MOST_FACTOR:
            raise UsageError(
                f"argument --plant: {name}: got {value}; it must be a number {allowed}"
            )
        found[name] = factor
    return found


def _outputs(given: argparse.Namespace) -> dict[str, Path]:
    """The files that are asked for, each of which can be written."""
    outputs = {name: path for name in OUTPUTS if (path := getattr(given, name, None)) is not None}
    for name, path in outputs.items():
        check_output(path, given.drive)
        for other, another in outputs.items():
            if other != name and another.resolve() == path.resolve():
                raise UsageError(f"{path} is asked for twice, as --{name} and as --{other}")
    return outputs


class _Result(NamedTuple):
    """What a run leaves to be told: lines and tables, decisions, how many are not the model's."""

    report: tuple[str | Table, ...]
    steps: int
    differing: int


def _mpdcc(given: argparse.Namespace, drive: Drive, new: Outputs) -> _Result:
    """Run a drive with a multilevel converter and write its files."""
    variant = given.variant or DEFAULT_VARIANT
    drive, note = served(drive, variant)
    run = rtl_loop.simulate(
        drive, given.speed, given.steps, given.explorers or 2, variant,
        given.errors, new.get("waves"), given.plant, bool(given.flux_observer),
    )  # fmt: skip
    rtl_loop.draw(run, new["out"])
    if "trace" in new:
        write_trace(new["trace"], run.result.seen)
    if "decisions" in new:
        write_decisions(new["decisions"], run.result.decisions)
    if "view" in new:
        write(new["view"], view(given.waves.name, rtl_loop.signals()))
    said = (
        f"{given.drive.name}: {len(run.result)} steps of {1e6 * drive.control.ts:g} us at "
        f"{given.speed * drive.base.frequency:g} Hz and rated current; RTL simulated in "
        f"{run.seconds:.0f} s"
    )
    noted = (f"{given.drive.name}: {note}",) if note else ()
    report = (*noted, said, rtl_loop.outcome(run), rtl_loop.latency(run))
    return _Result(report, len(run.result), run.differing)


def _mptc(given: argparse.Namespace, drive: MptcDrive, new: Outputs) -> _Result:
    """Run a two-level drive and write its files."""
    point = mptc_loop.Point.of(drive, given.speed)
    run = mptc_loop.simulate(drive, point, given.steps, new.get("waves"), given.errors, given.plant)
    mptc_loop.draw(run, given.drive.name, new["out"])
    if "trace" in new:
        mptc_trace.write_trace(new["trace"], run.trace)
    if "decisions" in new:
        mptc_trace.write_decisions(new["decisions"], run.decisions)
    if "view" in new:
        write(new["view"], view(given.waves.name, mptc_loop.signals(drive)))
    said = (
        f"{given.drive.name}: {len(run)} periods of {1e6 * drive.control.ts:g} us, "
        f"{point.rpm:g} r/min, {drive.control.method}; {run.controller}, {run.seconds:.0f} s"
    )
    return _Result((said, mptc_loop.outcome(run)), len(run), run.differing)


def _kbest(given: argparse.Namespace, drive: KbestDrive, new: Outputs) -> _Result:
    """Run a drive of K-best on the native library of its system and write its files."""
    only_built(drive)
    natives.write(["kbest_system"])
    period = 2 * math.pi / abs(given.speed * drive.ts_pu)
    steps = given.steps or math.ceil(rtl_loop.PERIODS * period)
    began = time.perf_counter()
    result = simulate(
        drive, "rtl", steps=steps, speed=given.speed, settle=0, errors=given.errors,
        plant_factors=given.plant, flux_observer=bool(given.flux_observer),
    )  # fmt: skip
    seconds = time.perf_counter() - began
    differing = count_differences(result.decisions, kbest_bit_true.run(drive, result.trace))
    pyplot()
    save_png(result.plot(), new["out"], true_colour=True)
    if "trace" in new:
        result.write_trace(new["trace"])
    if "decisions" in new:
        write_decisions(new["decisions"], result.decisions)
    said = (
        f"{given.drive.name}: {steps} steps of {1e6 * drive.control.ts:g} us at "
        f"{given.speed * drive.base.frequency:g} Hz and rated current; RTL simulated in "
        f"{seconds:.0f} s"
    )
    table = Table(show_header=False)
    table.add_row("decisions", f"{steps} checked against the bit-true model, {differing} differ")
    if steps >= period:
        table.add_row("current THD", f"{100 * result.thd():.2f} %")
    often = f"{result.switching_frequency:.0f} Hz, mean of all switches"
    table.add_row("switching frequency", often)
    table.add_row("clocks of a decision", f"{result.decisions.cycles.max()} at most")
    return _Result((said, table), steps, differing)


_RUN = {"mpdcc": _mpdcc, "kbest": _kbest, "mptc": _mptc}
"""Who runs a drive without a scenario, by its controller."""


def _turning(given: argparse.Namespace, drive: Any, new: Outputs) -> _Result:
    """Run a scenario with a speed controller and write its files."""
    kind = kind_of(drive)
    if given.speed is not None and not kind.per_unit:
        given.speed *= RPM * drive.machine.pole_pairs
    asked = scenario(drive, given.scenario, given.speed, given.inertia)
    extra = {"flux_observer": True} if given.flux_observer else {}
    result = simulate(
        drive, given.engine or "model", variant=given.variant or DEFAULT_VARIANT,
        errors=given.errors, plant_factors=given.plant, **asked, **extra,
    )  # fmt: skip
    pyplot()
    figure = result.plot()
    figure.suptitle(f"{given.drive.name}, {given.scenario}: {figure.get_suptitle()}")
    save_png(figure, new["out"], true_colour=True)
    if "trace" in new:
        result.write_trace(new["trace"])
    if "decisions" in new:
        kind.write_decisions(new["decisions"], result.decisions)
    said = (
        f"{given.drive.name}: {given.scenario}, {len(result)} control periods of "
        f"{1e6 * drive.control.ts:g} us, inertia {asked['inertia']:g} "
        + ("s" if kind.per_unit else "kg m^2")
    )
    return _Result((said, _moved(result)), len(result), 0)


def _moved(result: SimulationResult) -> Table:
    """What a drive with a speed controller did."""
    assert result.speed_ref is not None
    assert result.load is not None
    table = Table(title="Scenario", show_header=False)
    table.add_column("", style="bold")
    table.add_column("")
    speed, torque, current, flux = kind_of(result.drive).look(result.drive).units
    last, omega, time = result.speed_ref[-1], result.omega_r, result.time
    outside = np.flatnonzero(np.abs(omega - last) > 0.02 * abs(last))
    if len(outside) == len(omega) or (len(outside) and outside[-1] == len(omega) - 1):
        reached = "not reached to 2 %"
    else:
        reached = f"within 2 % from {time[outside[-1] + 1] if len(outside) else 0.0:.3f} s on"
    table.add_row("speed reference", f"{last:.4g} {speed}, {reached}")
    table.add_row("speed", f"from {omega.min():.4g} to {omega.max():.4g} {speed}")
    table.add_row("torque", f"from {result.torque.min():.4g} to {result.torque.max():.4g} {torque}")
    table.add_row("largest current", f"{np.abs(result.current).max():.4g} {current} peak")
    table.add_row("largest flux", f"{np.abs(result.flux).max():.4g} {flux}")
    table.add_row(
        "switching frequency", f"{result.switching_frequency:.0f} Hz, mean of all switches"
    )
    saturated = int(np.sum(result.decisions.saturated))
    table.add_row("saturated decisions", f"{saturated} of {len(result)}")
    return table


def _check_scenario(given: argparse.Namespace, drive: Any) -> None:
    """Refuse what a run with a speed controller cannot have, or what it alone can."""
    for name in SCENARIO_ONLY if given.scenario is None else NO_SCENARIO:
        if getattr(given, name) is not None:
            other = "needs a --scenario" if given.scenario is None else "is not for a --scenario"
            raise UsageError(f"argument --{name}: {other}")
    if given.scenario is None:
        return
    if "torque" not in getattr(drive.machine, "quantities", ("torque",)):
        raise UsageError(f"argument --scenario: {given.drive} has no machine that turns")
    words = allowed(type(drive.mechanics), "inertia")
    if given.inertia is None and drive.mechanics.inertia is None:
        raise InputError(
            f"{given.drive}: mechanics.inertia: missing; it must be {words}, or given as --inertia"
        )
    if given.inertia is not None:
        try:
            drive.changed(mechanics={"inertia": given.inertia})
        except ValueError as error:
            raise UsageError(f"argument --inertia: {error}") from None


def _check_mpdcc(given: argparse.Namespace, drive: Drive) -> None:
    """Refuse what an MPDCC run cannot have; without a speed it is 1 pu."""
    if given.speed is None and given.scenario is None:
        given.speed = 1.0
    try:
        check_speed(drive, given.speed)
    except ValueError as error:
        if given.speed == 0.0:
            raise InputError(f"--{error}") from error
        raise UsageError(f"argument --{error}") from error
    if given.flux_observer and not drive.machine.has_flux_observer:
        raise UsageError(
            f"argument --flux-observer: the load of {given.drive} is of the type "
            f'"{drive.machine.type}", which the observer does not serve'
        )
    given.errors = _errors(given.errors, DriveErrors)
    given.plant = _factors(given.plant, factors_of(drive))


def _check_other(given: argparse.Namespace, drive: Any) -> None:
    """Refuse what runs of MPDCC alone have."""
    for name in OF_MPDCC.get(drive.controller, ()):
        if getattr(given, name) is not None:
            option = name.replace("_", "-")
            raise UsageError(
                f"argument --{option}: it is for MPDCC; {given.drive} is for {drive.controller}"
            )


def _check_mptc(given: argparse.Namespace, drive: MptcDrive) -> None:
    """Refuse what a two-level run cannot have."""
    try:
        mptc_loop.Point.of(drive, given.speed)
    except ValueError as error:
        raise UsageError(f"argument --speed: {error}") from error
    given.errors = _errors(given.errors, MptcErrors)
    try:
        check_errors(given.errors, drive)
    except ValueError as error:
        raise UsageError(f"argument --errors: {error}") from error
    given.plant = _factors(given.plant, factors_of(drive))


@command(
    interrupted="nothing was written",
    outputs=tuple(OUTPUTS),
    formats={"out": ".png", "waves": ".fst"},
)
@option(
    "--drive", type=Path, default=ROOT / "drives" / "anpc5l_6kv.toml",
    help="drive file, or the name of a shipped one",
)  # fmt: skip
@option(
    "--speed", type=float,
    help="stator frequency, per unit, 1 without; MPTC: mechanical speed, r/min",
)  # fmt: skip
@option(
    "--steps", type=int,
    help="control steps; two fundamental periods without, MPTC: at most "
    f"{mptc_loop.MOST_STEPS}",
)  # fmt: skip
@option("--explorers", type=int, choices=EXPLORERS, metavar="1..8", help="MPDCC; 2 without")
@option("--variant", choices=tuple(VARIANTS), help=f"MPDCC; {DEFAULT_VARIANT} without")
@option(
    "--errors",
    metavar="NAME=VALUE,...",
    help="errors of sensors and switches: directmpc.DriveErrors, MPTC: directmpc.MptcErrors",
)
@option(
    "--plant",
    metavar="NAME=FACTOR,...",
    help="factors on the machine and the capacitors of the plant, which the controller does "
    f"not know, each from {LEAST_FACTOR:g} to {MOST_FACTOR:g}: rs, rr, leakage, xm, xdc, xph; "
    "PMSM: rs, leakage, xdc, xph; grid and RL: r, x, xdc, xph; MPTC: rs, rr, leakage, lm",
)
@option(
    "--flux-observer",
    action="store_true",
    default=None,
    help="MPDCC, K-best: the controller sees the rotor flux of the observer's bit-true model, not "
    "the plant's",
)
@option(
    "--scenario", choices=SCENARIOS,
    help="speed controller and moving rotor: --speed is the rotor's then",
)  # fmt: skip
@option(
    "--engine", choices=ENGINES,
    help="what decides in a scenario: the core's bit-true model without, rtl is its VHDL",
)  # fmt: skip
@option(
    "--inertia", type=float,
    help="of a scenario, in s, MPTC: kg m^2; mechanics.inertia of the drive file without",
)  # fmt: skip
@option("--out", type=Path, default=BUILD / "run.png", help="picture")
@option("--trace", type=Path, help="what was measured: a trace for replay (CSV)")
@option("--decisions", type=Path, help="what it decided, as replay writes it (CSV)")
@option(
    "--waves",
    type=Path,
    nargs="?",
    const=BUILD / "run.fst",
    help="every signal (FST), with a view for GTKWave beside it (.gtkw); build/run.fst if no "
    "file is named",
)
def cli(given: argparse.Namespace) -> int | None:
    if given.steps is not None and given.steps < 1:
        raise UsageError(f"argument --steps: got {given.steps}; at least 1 is needed")
    console = Console(width=None if sys.stdout.isatty() else 110)
    drive: Any = load_drive(given.drive)
    _check_scenario(given, drive)
    _check_other(given, drive)
    if drive.controller == "mptc":
        _check_mptc(given, drive)
    else:
        _check_mpdcc(given, drive)
    for doubt in doubts(drive):
        print(f"run: warning: {given.drive}: {doubt}", file=sys.stderr)
    if given.waves is not None:
        given.view = given.waves.with_suffix(".gtkw")
    outputs = _outputs(given)
    with terminable(), contextlib.ExitStack() as files:
        # none of them replaces an older one before all are whole
        new = {name: files.enter_context(replacing(path)) for name, path in outputs.items()}
        try:
            if given.scenario is not None:
                done = _turning(given, drive, new)
            else:
                done = _RUN[drive.controller](given, drive, new)
        except ValueError as error:  # names the key, but does not know the file
            raise InputError(f"{given.drive}: {error}") from error
    for part in done.report:
        console.print(part)
    for name, path in outputs.items():
        console.print(f"{OUTPUTS[name]}: {path}", soft_wrap=True)
    if done.differing:
        print(
            f"run: {done.differing} of {done.steps} decisions of the RTL differ from its "
            "bit-true model",
            file=sys.stderr,
        )
        return 1
    return 0
