"""`make check`: cycles, resources and decisions of a core beside a stored baseline.

A baseline is one TOML file: which drive and trace, which core, and what the core does with them. It
has these tables:

* ``inputs``: paths of drive and trace from the baseline's folder, and digests of what they say.
* ``core``: what the replay takes, and the family of the synthesis.
* ``tools``: versions that the resources were measured with.
* ``cycles``, ``decisions``, ``accuracy``, ``resources``: what was measured.
* ``tolerance``: how far a measurement may be from it, to either side; optional, 0 by default.

`measure` runs the trace through RTL, bit-true model and ideal controller and synthesises the core.
`compare` holds the measurement to the baseline and returns one `Case` for each key.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import os
import tempfile
import tomllib
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tomli_w
from pydantic import Field

from directmpc.api.drive_file import load_drive
from directmpc.drive_tables import (
    DriveError,
    Section,
    described,
    integer,
    keys_of,
    number,
    validated,
)  # fmt: skip
from directmpc.kbest.coefficients import only_built
from directmpc.mpdcc.coefficients import inwards, second_level, weighted_deadlock
from directmpc.mpdcc.variants import DEFAULT_VARIANT, VARIANTS, served
from directmpc.mptc.drive import MptcDrive
from scripts.hdl import replay
from scripts.measure import budgets, synth
from scripts.shared import progress, tools
from scripts.shared.command import InputError
from scripts.shared.tools import Generics, ToolError

BASELINES = Path(__file__).with_name("baselines")
"""Folder of the project's own baselines."""

Family = Literal["ecp5", "xc3s", "xc6s", "xc7"]
DEFAULT_FAMILY = "ecp5"

FIGURES = ("lut", "ff", "dsp", "bram")
"""Resources of a baseline; ``dsp`` are multipliers, in every family."""

APPLIED = ("s_a", "s_b", "s_c", "u", "u1", "u2", "u3")
"""Columns of a decision that say what is applied to the inverter."""

FREE_OF_CLOCKS = "cycles"
"""The column that models leave empty."""

_HEAD = """\
# Baseline of `make check`: what a core does with a drive and a trace. docs/check.md explains it.
# `make check ARGS='--baseline THIS FILE --write-baseline'` measures and writes it anew; the table
# [tolerance] stays as it is.
"""


class BaselineError(InputError):
    """A baseline cannot be used; the message names file, key and what is allowed."""


def _path(what: str) -> Any:
    words = f"the path of {what}, seen from this file's folder"
    return Annotated[str, Field(strict=True, min_length=1, description=words)]


_Text = Annotated[str, Field(strict=True, min_length=1, description="a text")]
_Digest = Annotated[
    str, Field(strict=True, pattern="^[0-9a-f]{64}$", description="64 hexadecimal digits, SHA-256")
]
_Count = integer(0, 2**31 - 1)


class Inputs(Section):
    """What the core decides on."""

    drive: _path("a drive file")
    trace: _path("a trace")
    drive_sha256: _Digest
    trace_sha256: _Digest


class Core(Section):
    """Which core decides. The drive file's controller says the rest."""

    explorers: integer(1, 8)
    variant: Literal["fast", "paper"]
    family: Family


class Tools(Section):
    """Versions, as the tools print them."""

    ghdl: _Text
    yosys: _Text


class Cycles(Section):
    """Clocks of the decisions of the trace."""

    worst: _Count
    total: _Count


class Decisions(Section):
    """The decisions of the RTL, as `make replay` writes them."""

    csv: _Text


class Accuracy(Section):
    """Rows that the ideal controller decides otherwise."""

    ideal_rows: _Count


class Resources(Section):
    """What Yosys maps the core to; dsp are multipliers."""

    lut: _Count
    ff: _Count
    dsp: _Count
    bram: _Count


class Tolerance(Section):
    """How far a measurement may be from the baseline, to either side."""

    cycles: integer(0, 10_000) = 0
    ideal_rows: integer(0, 1_000_000) = 0
    lut_percent: number(0.0, 100.0, "percent") = 0.0
    ff_percent: number(0.0, 100.0, "percent") = 0.0


class Baseline(Section):
    """A baseline, as its file holds it."""

    format: integer(1, 1)
    inputs: Inputs
    core: Core
    tools: Tools
    cycles: Cycles
    decisions: Decisions
    accuracy: Accuracy
    resources: Resources
    tolerance: Tolerance = Tolerance()


@dataclass(frozen=True)
class Request:
    """What is to be measured."""

    #: Files.
    drive: Path
    trace: Path
    #: Of `replay.Request`.
    explorers: int = replay.DEFAULT_EXPLORERS
    variant: str = DEFAULT_VARIANT
    family: str = DEFAULT_FAMILY  #: Of the synthesis.


@dataclass(frozen=True)
class Measured:
    """What a core does now."""

    #: Digests of the inputs.
    drive_sha256: str
    trace_sha256: str
    tools: dict[str, str]  #: Versions as of `budgets.versions`.
    #: Decisions files as text.
    rtl: str
    model: str
    ideal: str
    resources: dict[str, int]  #: `FIGURES` of the core.


@dataclass(frozen=True)
class Case:
    """One comparison."""

    key: str  #: What is compared; a key of the baseline with dots.
    #: What was measured, and what the baseline says.
    found: str
    expected: str
    allowed: str = "no difference"  #: How far they may be apart, in words.
    message: str = ""  #: What is wrong, empty if nothing is.

    @property
    def passed(self) -> bool:
        """Whether all is as the baseline says."""
        return not self.message


@dataclass
class Suite:
    """All comparisons with one baseline."""

    file: Path  #: The baseline.
    #: Files that were used.
    drive: Path
    trace: Path
    #: Comparisons, in the order of the file's keys.
    cases: list[Case] = field(default_factory=list)
    #: Versions that measured; empty if measuring failed.
    tools: dict[str, str] = field(default_factory=dict)

    @property
    def failed(self) -> list[Case]:
        """Cases that are not as the baseline says."""
        return [case for case in self.cases if not case.passed]


# --- the file -------------------------------------------------------------------------------------


def own_baselines() -> list[Path]:
    """The project's own baselines."""
    return sorted(BASELINES.glob("*.toml"))


def read(path: Path) -> Baseline:
    """Read and check a baseline."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BaselineError(
            f"{path}: cannot be read ({error.strerror or error}); a baseline is needed, "
            "--write-baseline makes one"
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BaselineError(f"{path}: not a TOML file ({error}); a baseline is TOML") from None
    try:
        baseline = validated(Baseline, data)
    except DriveError as error:
        raise BaselineError(f"{path}: {error}") from None
    head, rows = _table(baseline.decisions.csv)
    if FREE_OF_CLOCKS not in head or not rows or any(len(row) != len(head) for row in rows):
        raise BaselineError(
            f"{path}: decisions.csv: got {described(baseline.decisions.csv)}; it must be a "
            "decisions file as `make replay` writes it: a header with the column cycles, at least "
            "one row, as many fields in each row as the header has"
        )
    return baseline


def render(baseline: Baseline) -> str:
    """The text of a baseline's file."""
    held = {
        name: {key: getattr(table, key) for key in keys_of(type(table))} or table
        for name in keys_of(Baseline)
        for table in (getattr(baseline, name),)
    }
    return f"{_HEAD}\n{tomli_w.dumps(held, multiline_strings=True)}"


# --- measuring ------------------------------------------------------------------------------------


def core_of(request: Request) -> tuple[str, Generics]:
    """Entity and generics that serve a drive."""
    drive = load_drive(request.drive)
    if isinstance(drive, MptcDrive):
        return ("mptc_family_core" if drive.control.sequences else "mptc_core"), {}
    try:
        if hasattr(drive, "search"):
            only_built(drive)
            return "kbest_core", {}
        drive, _ = served(drive, request.variant)
        values = VARIANTS[request.variant].registers(drive).array()
    except ValueError as error:  # names the key, but does not know the file
        raise InputError(f"{request.drive}: {error}") from error
    generics: Generics = {
        "EXPLORERS": request.explorers, "FOLDED": request.variant == "paper",
    }  # fmt: skip
    if second_level(values):
        generics["SECOND_LEVEL"] = True
    if weighted_deadlock(values):
        generics["WEIGHTED_DEADLOCK"] = True
    if inwards(values):
        generics["INWARDS"] = True
    return "mpdcc_core", generics


def shipped_file(drive: Path) -> Path:
    """File of a drive that is given by its name, as `load_drive` finds it."""
    found = tools.ROOT / "drives" / f"{drive.name.removesuffix('.toml')}.toml"
    if drive.name == str(drive) and not drive.exists() and found.is_file():
        return found
    return drive


def digests(request: Request) -> tuple[str, str]:
    """Digests of what the drive file says, comments left out, and of the trace's bytes."""
    drive = tomllib.loads(request.drive.read_text(encoding="utf-8-sig"))
    said = json.dumps(drive, sort_keys=True).encode()
    return hashlib.sha256(said).hexdigest(), hashlib.sha256(request.trace.read_bytes()).hexdigest()


def measure(request: Request) -> Measured:
    """Let RTL, model and ideal controller decide on the trace, and synthesise the core."""
    entity, generics = core_of(request)
    texts = {}
    with tempfile.TemporaryDirectory() as folder:
        # models first: what is wrong with a file is said at once
        for engine in ("model", "ideal", "rtl"):
            out = Path(folder) / f"{engine}.csv"
            asked = replay.Request(
                request.drive, request.trace, out, engine, request.explorers, request.variant
            )
            # the RTL counts its rows itself
            told = nullcontext() if engine == "rtl" else progress.busy(f"{engine} on {asked.trace}")
            with told:
                replay.replay(asked)
            texts[engine] = out.read_text(encoding="utf-8")
    name = tools.configuration_name(entity, generics)
    with progress.busy(f"synthesis of {name} for {request.family}"):
        row = synth.measure(entity, generics, request.family)
    found = dict(zip(FIGURES, (row[f] for f in budgets.figures(request.family)), strict=True))
    drive, trace = digests(request)
    return Measured(drive, trace, budgets.versions(), resources=found, **texts)


# --- comparison -----------------------------------------------------------------------------------

Rows = list[list[str]]


def _table(text: str) -> tuple[list[str], Rows]:
    """Header and rows of a CSV file."""
    rows = list(csv.reader(io.StringIO(text)))
    return (rows[0], rows[1:]) if rows else ([], [])


def _column(head: list[str], rows: Rows, name: str) -> list[str]:
    at = head.index(name)
    return [row[at] for row in rows]


def _clocks(text: str) -> list[int]:
    """Column cycles of a decisions file."""
    return [int(value or 0) for value in _column(*_table(text), FREE_OF_CLOCKS)]


def _differing(a: str, b: str, columns: Sequence[str]) -> list[int]:
    """Rows on which two decisions files of one trace differ in one of the columns."""
    (head_a, rows_a), (head_b, rows_b) = _table(a), _table(b)
    shared = [name for name in columns if name in head_a and name in head_b]
    pairs = [(_column(head_a, rows_a, n), _column(head_b, rows_b, n)) for n in shared]
    return [k for k in range(len(rows_a)) if any(x[k] != y[k] for x, y in pairs)]


def _ideal_rows(measured: Measured) -> int:
    return len(_differing(measured.rtl, measured.ideal, APPLIED))


def _number(key: str, found: int, expected: int, spread: int, unit: str) -> Case:
    """Hold a number to the baseline's, up to a spread to either side."""
    allowed = f"{spread} {unit} more or less" if spread else "no difference"
    message = ""
    if abs(found - expected) > spread:
        message = f"is {found}, the baseline says {expected}; allowed is {allowed}"
    return Case(key, str(found), str(expected), allowed, message)


def _of_rows(
    key: str, found: Sequence[str], expected: Sequence[str], bad: Sequence[int], allowed: str
) -> Case:
    """Hold a column to the baseline's; `bad` are the rows that are too far apart."""
    message = ""
    if bad:
        k = bad[0]
        message = (
            f"{len(bad)} of {len(found)} rows differ; line {k + 2} of the trace is the first: "
            f"{found[k] or 'empty'}, the baseline says {expected[k] or 'empty'}; allowed is "
            f"{allowed}"
        )
    count = f"{len(found)} rows"
    return Case(key, f"{count}, {len(bad)} differ", count, allowed, message)


def _decision_cases(baseline: Baseline, measured: Measured) -> list[Case]:
    """Every column of the decisions, and the clocks of each row."""
    head, rows = _table(measured.rtl)
    held_head, held_rows = _table(baseline.decisions.csv)
    shape, held_shape = f"{len(rows)} rows", f"{len(held_rows)} rows"
    said = [f"{s} of {','.join(h)}" for s, h in ((shape, head), (held_shape, held_head))]
    if (len(rows), head) != (len(held_rows), held_head):
        message = f"the RTL answers {said[0]}; the baseline has {said[1]}"
        return [Case("decisions.csv", *said, message=message)]
    cases = []
    spread = baseline.tolerance.cycles
    for name in head:
        now, then = _column(head, rows, name), _column(held_head, held_rows, name)
        if name == FREE_OF_CLOCKS:
            bad = [
                k for k, (a, b) in enumerate(zip(now, then, strict=True))
                if not b.isdecimal() or abs(int(a) - int(b)) > spread
            ]  # fmt: skip
            allowed = f"{spread} clocks more or less" if spread else "no difference"
        else:
            bad = [k for k, (a, b) in enumerate(zip(now, then, strict=True)) if a != b]
            allowed = "no difference"
        cases.append(_of_rows(f"decisions.csv.{name}", now, then, bad, allowed))
    return cases


def compare(baseline: Baseline, measured: Measured) -> list[Case]:
    """Hold a measurement to a baseline."""
    cases = []
    for name in ("drive", "trace"):
        key = f"{name}_sha256"
        found, expected = getattr(measured, key), getattr(baseline.inputs, key)
        message = ""
        if found != expected:
            message = f"the {name} is another one than the baseline was written with"
        cases.append(Case(f"inputs.{key}", found, expected, message=message))
    clocks, spread = _clocks(measured.rtl), baseline.tolerance
    for key, found in (("worst", max(clocks)), ("total", sum(clocks))):
        allowed = spread.cycles * (1 if key == "worst" else len(clocks))
        expected = getattr(baseline.cycles, key)
        cases.append(_number(f"cycles.{key}", found, expected, allowed, "clocks"))
    cases += _decision_cases(baseline, measured)
    head, rows = _table(measured.model)
    alike = [name for name in head if name != FREE_OF_CLOCKS]
    wrong = _differing(measured.rtl, measured.model, alike)
    message = ""
    if wrong:
        message = (
            f"RTL and bit-true model decide differently on {len(wrong)} of {len(rows)} rows; line "
            f"{wrong[0] + 2} of the trace is the first; allowed is none"
        )
    cases.append(Case("accuracy.model_rows", str(len(wrong)), "0", "none", message))
    cases.append(
        _number(
            "accuracy.ideal_rows", _ideal_rows(measured), baseline.accuracy.ideal_rows,
            spread.ideal_rows, "rows",
        )
    )  # fmt: skip
    held_with = {"ghdl": baseline.tools.ghdl, "yosys": baseline.tools.yosys}
    percent = {"lut": spread.lut_percent, "ff": spread.ff_percent}
    for name in FIGURES:
        expected = getattr(baseline.resources, name)
        allowed = max(
            budgets.allowed(name, expected, held_with, measured.tools),
            math.floor(percent.get(name, 0.0) / 100 * expected),
        )
        case = _number(f"resources.{name}", measured.resources[name], expected, allowed, name)
        cases.append(_with_tools(case, held_with, measured.tools))
    return cases


def _with_tools(case: Case, held_with: dict[str, str], here: dict[str, str]) -> Case:
    """A case that failed says which tools are others."""
    others = [
        f"{name} is '{here[name]}' here, the baseline was measured with '{version}'"
        for name, version in held_with.items()
        if here.get(name) != version
    ]
    if case.passed or not others:
        return case
    return Case(**{**asdict(case), "message": "; ".join([case.message, *others])})


def _request(
    path: Path, baseline: Baseline, drive: Path | None = None, trace: Path | None = None
) -> Request:
    """What a baseline asks for; files of one's own stand in for those it names."""
    core = baseline.core
    return Request(
        drive or _resolved(path, "inputs.drive", baseline.inputs.drive),
        trace or _resolved(path, "inputs.trace", baseline.inputs.trace),
        core.explorers, core.variant, core.family,
    )  # fmt: skip


def _resolved(path: Path, key: str, name: str) -> Path:
    """A file that a baseline names, seen from its folder."""
    found = Path(os.path.relpath(path.parent / name))
    if not found.is_file():
        raise BaselineError(
            f'{path}: {key}: got "{name}", there is no such file; it must be a path seen from '
            f"{path.parent}"
        )
    return found


def run(paths: Sequence[Path], drive: Path | None = None, trace: Path | None = None) -> list[Suite]:
    """Measure what baselines ask for and compare."""
    work = []
    for path in paths:
        baseline = read(path)
        work.append((path, baseline, _request(path, baseline, drive, trace)))
    suites = []
    for path, baseline, request in work:
        suite = Suite(path, request.drive, request.trace)
        try:
            measured = measure(request)
        except ToolError as error:
            suite.cases = [Case("run", "failed", "measured", message=str(error))]
        else:
            suite.cases, suite.tools = compare(baseline, measured), measured.tools
        suites.append(suite)
    return suites


# --- writing --------------------------------------------------------------------------------------


def new_baseline(path: Path, request: Request, tolerance: Tolerance | None = None) -> Baseline:
    """Measure, and make a baseline of it."""
    measured = measure(request)
    clocks = _clocks(measured.rtl)
    folder = path.resolve().parent
    seen = {
        name: Path(os.path.relpath(getattr(request, name).resolve(), folder)).as_posix()
        for name in ("drive", "trace")
    }
    made = Baseline(
        format=1,
        inputs=Inputs(
            **seen, drive_sha256=measured.drive_sha256, trace_sha256=measured.trace_sha256
        ),
        core=Core(explorers=request.explorers, variant=request.variant, family=request.family),
        tools=Tools(**measured.tools),
        cycles=Cycles(worst=max(clocks), total=sum(clocks)),
        decisions=Decisions(csv=measured.rtl),
        accuracy=Accuracy(ideal_rows=_ideal_rows(measured)),
        resources=Resources(**measured.resources),
        tolerance=tolerance or Tolerance(),
    )
    wrong = [case for case in compare(made, measured) if not case.passed]
    if wrong:
        raise ToolError(f"{path}: {wrong[0].key}: {wrong[0].message}; no baseline is made of that")
    return made


def request_of(path: Path) -> tuple[Request, Tolerance]:
    """What a baseline measures, and its tolerances."""
    baseline = read(path)
    return _request(path, baseline), baseline.tolerance


def follow_budgets() -> list[Path]:
    """Put the resources of budgets.toml into the project's own baselines."""
    held, written = budgets.load(), []
    for path in own_baselines():
        baseline = read(path)
        request = _request(path, baseline)
        name = tools.configuration_name(*core_of(request))
        row = held.resources.get(name, {}).get(request.family)
        if row is None:
            continue
        names = budgets.figures(request.family)
        found = Resources(**dict(zip(FIGURES, (row[figure] for figure in names), strict=True)))
        if found != baseline.resources:
            changed = {"resources": found, "tools": Tools(**held.tools)}
            tools.write(path, render(baseline.model_copy(update=changed)))
            written.append(path)
    return written


def junit(suites: Sequence[Suite]) -> str:
    """The comparisons as JUnit XML."""
    counts = [(len(suite.cases), len(suite.failed)) for suite in suites]
    total = {"tests": sum(n for n, _ in counts), "failures": sum(n for _, n in counts)}
    root = ElementTree.Element("testsuites", name="directmpc check", **_texts(total))
    for suite, (count, failed) in zip(suites, counts, strict=True):
        below = ElementTree.SubElement(
            root, "testsuite", name=suite.file.stem,
            **_texts({"tests": count, "failures": failed, "errors": 0, "skipped": 0}),
        )  # fmt: skip
        for case in suite.cases:
            one = ElementTree.SubElement(
                below, "testcase", classname=suite.file.stem, name=case.key
            )
            if not case.passed:
                text = f"{suite.file}: {case.key}: {case.message}"
                ElementTree.SubElement(one, "failure", message=case.message).text = text
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _texts(numbers: dict[str, int]) -> dict[str, str]:
    return {name: str(value) for name, value in numbers.items()}


def document(suites: Sequence[Suite]) -> str:
    """The comparisons as JSON."""
    return (
        json.dumps(
            {
                "passed": not any(suite.failed for suite in suites),
                "baselines": [
                    {
                        "file": str(suite.file),
                        "drive": str(suite.drive),
                        "trace": str(suite.trace),
                        "passed": not suite.failed,
                        "tools": suite.tools,
                        "cases": [{**asdict(case), "passed": case.passed} for case in suite.cases],
                    }
                    for suite in suites
                ],
            },
            indent=1,
        )
        + "\n"
    )
