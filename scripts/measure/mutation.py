"""How many small changes of the VHDL the tests notice: `make mutate`.

`tb/mutation.toml` lists the units of the design: entities and packages. For each of them mutants of
its file are drawn (`scripts.hdl.mutants`), and each is run against the unit's own benches, then, if
these notice nothing, against what stands above it. What comes of a mutant:

* **killed**: a check failed;
* **timeout**: a bench did not end, which counts as killed;
* **uncompiled**: it is no VHDL, or does not fit what uses it, and does not count;
* **equivalent**: it is proven to do the same in every clock, and does not count;
* **survived**: no check failed.

The benches run in a copy of the project, so that nothing of the project changes. Results are kept
in a packed JSON file for each unit, written after every mutant. A run that was stopped goes on
there. A change of the unit's VHDL makes its results void, and no other's; a change of benches those
that depend on them. The test that killed a mutant once is asked first when it is run again.
"""

from __future__ import annotations

import concurrent.futures
import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

from directmpc.mpdcc.tables import DEFAULT
from scripts.hdl import converter_package, equivalence, ghdl, sources
from scripts.hdl.mutants import Mutant, code, mutants, shuffled
from scripts.shared import progress, tables, tools
from scripts.shared.tools import ROOT, Generics, ToolError
from scripts.shared.workers import Pool

LIST = ROOT / "tb" / "mutation.toml"
ARGUED = ROOT / "tb" / "mutation_equivalent.toml"
RESULTS = ROOT / "reports" / "mutation"
PAGE = ROOT / "reports" / "mutation.md"
METRICS = ROOT / "reports" / "metrics.json"
MARKS = ("<!-- mutation: begin -->", "<!-- mutation: end -->")
SAMPLE = 50
SEED = 1
#: A bench may take this many times the processor time as without a change, and the seconds besides.
PATIENCE, GRACE = 6, 5
#: Longest time on the clock a bench is waited for.
LONGEST = 4 * 3600
#: Part of its time that a test is supposed to take until it kills.
EARLY = 0.25
_KEYS = ("tests", "above", "top", "configurations", "converters")
#: What the copy of the project is without.
_ELSEWHERE = (".git", ".venv", "build", "__pycache__", ".*_cache", "site")


class MutationError(ToolError):
    """The list cannot be used, or benches fail without a change."""


@dataclass(frozen=True)
class Unit:
    """One unit of the design."""

    name: str  #: Entity or package.
    file: Path  #: Its VHDL, below the project's root.
    tests: tuple[str, ...]  #: Its own benches, as pytest selects them.
    above: tuple[str, ...]  #: Benches and proofs of what stands above it.
    top: str  #: Entity whose netlists are compared; empty for none.
    configurations: tuple[Generics, ...]  #: Generics with which they are.
    #: Benches and proofs with the packages of another converter, ``{}`` for its name.
    converters: tuple[str, ...] = ()
    converter: str = DEFAULT  #: Whose packages the design has.

    @property
    def rtl(self) -> Path:
        """The design, below the project's root."""
        return converter_package.rtl_of(self.converter).relative_to(ROOT)


# --- the list -------------------------------------------------------------------------------------


def _units_of(rtl: Path) -> dict[str, tuple[Path, bool]]:
    """File of each unit that is not generated, and whether it is an entity."""
    found = {}
    for one in sources.scan(sources.rtl_files(rtl)):
        if "generated" not in one.path.parts:
            for name in one.primaries:
                found[name] = (one.path, name in one.entities)
    return found


def _folder_of(name: str, root: Path) -> str | None:
    """Folder of the tests that are named like a unit."""
    found = [path for path in sorted((root / "tb" / "rtl").glob(f"*/{name}")) if path.is_dir()]
    return str(found[0].relative_to(root)) if found else None


def _texts(where: str, key: str, given: Any) -> tuple[str, ...]:
    if not isinstance(given, list) or not all(isinstance(one, str) for one in given):
        raise MutationError(f"{where}.{key}: a list of texts is needed")
    return tuple(given)


def listed(path: Path = LIST, root: Path = ROOT) -> list[Unit]:
    """The units that are looked at."""
    try:
        given = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise MutationError(f"{path.name}: {error}") from None
    known = _units_of(root / "rtl")
    found = []
    for name, table in given.items():
        where = f"{path.name}: {name}"
        if name not in known:
            raise MutationError(f"{where}: no unit of the design, or one that is generated")
        for key in table:
            if key not in _KEYS:
                raise MutationError(f"{where}: unknown key '{key}'; there are: {', '.join(_KEYS)}")
        file, entity = known[name]
        own = _folder_of(name, root)
        tests = _texts(where, "tests", table.get("tests", [own] if own else []))
        above = _texts(where, "above", table.get("above", []))
        if not tests:
            raise MutationError(f"{where}: there is no folder of tests of that name; name 'tests'")
        for test in (*tests, *above, *table.get("converters", ())):
            if not (root / test.partition("::")[0]).exists():
                raise MutationError(f"{where}: there is no test '{test}'")
        found.append(
            Unit(
                name,
                file.relative_to(root),
                tests,
                above,
                table.get("top", name if entity else ""),
                tuple(table.get("configurations", [{}])),
                _texts(where, "converters", table.get("converters", [])),
            )
        )
    return found


def unlisted(units: Iterable[Unit], root: Path = ROOT) -> list[str]:
    """Units of the design that a list has not."""
    return sorted(set(_units_of(root / "rtl")) - {unit.name for unit in units})


def named(names: Iterable[str], units: Sequence[Unit]) -> list[Unit]:
    """Some units of the list."""
    wanted = set(names)
    known = [unit.name for unit in units]
    if unknown := wanted - set(known):
        raise MutationError(
            f"'{min(unknown)}' is not in {LIST.name}; there are: {', '.join(sorted(known))}"
        )
    return [unit for unit in units if not wanted or unit.name in wanted]


def of_converter(name: str, units: Iterable[Unit]) -> list[Unit]:
    """The units that have benches for any converter, with the packages of one."""
    found = []
    for unit in units:
        if unit.converters:
            tests = tuple(test.format(name) for test in unit.converters)
            one = replace(unit, converter=name, tests=tests, above=())
            found.append(replace(one, file=one.rtl / unit.file.relative_to("rtl")))
    return found


@dataclass(frozen=True)
class Argument:
    """Why a mutant that survives does the same."""

    unit: str  #: Entity or package.
    name: tuple[str, str, int]  #: The mutant's, as of `Mutant`.
    why: str  #: One or two sentences.


def arguments(path: Path = ARGUED) -> list[Argument]:
    """Mutants that are argued to do the same."""
    try:
        given = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise MutationError(f"{path.name}: {error}") from None
    found = []
    for unit, entries in given.items():
        for entry in entries:
            where = f"{path.name}: {unit}"
            if more := {"why", "mutants"} ^ set(entry):
                raise MutationError(f"{where}: 'why' and 'mutants' are needed, not '{min(more)}'")
            for mutant in entry["mutants"]:
                kinds = [type(part) for part in mutant] if isinstance(mutant, list) else []
                if kinds not in ([str, str], [str, str, int]):
                    raise MutationError(f"{where}: {mutant} is no line before and after, and place")
                before, after, place = (*mutant, 1)[:3]
                found.append(Argument(unit, (before, after, place), entry["why"]))
    return found


def arguments_of(unit: Unit) -> list[Argument]:
    """Those of a unit; they are about the checked-in design."""
    usual = unit.converter == DEFAULT
    return [one for one in arguments() if usual and one.unit == unit.name]


# --- what is kept ---------------------------------------------------------------------------------


def _parts(test: str, root: Path) -> dict[str, list[Path]]:
    """Each file of tests that a selection of pytest takes, with all that it may read of its folder.

    That is the file itself, and those of its folder that are no tests.
    """
    place = root / test.partition("::")[0]
    folder = place.parent if place.is_file() else place
    files = sorted(path for path in folder.iterdir() if path.is_file())
    shared = [path for path in files if not path.match("test_*.py")]
    tests = [place] if place.is_file() else [path for path in files if path not in shared]
    return {path.relative_to(root).as_posix(): [*shared, path] for path in tests}


def keys_of(unit: Unit, root: Path = ROOT) -> dict[str, str]:
    """Sixteen digits for each thing that results depend on; comments of the VHDL do not count."""
    source = code((root / unit.file).read_text(encoding="utf-8"))
    found = {
        unit.file.as_posix(): tools.digest(source, str(SEED)),
        "tests": tools.digest(*unit.tests, "above", *unit.above),
    }
    for test in (*unit.tests, *unit.above):
        for name, files in _parts(test, root).items():
            parts: list[str | bytes] = []
            for path in files:
                parts += [path.name, path.read_bytes()]
            found[name] = tools.digest(*parts)
    if unit.configurations != ({},):
        generics = [repr(sorted(each.items())) for each in unit.configurations]
        found["configurations"] = tools.digest(*generics)
    return {name: digits[:16] for name, digits in found.items()}


def valid(unit: Unit, found: Mapping[str, Any], keys: Mapping[str, str]) -> list[dict[str, Any]]:
    """Results that still hold.

    What was killed holds as long as the VHDL and the file of the test that killed it are the same,
    with what is no test beside it; what is equivalent, as long as the VHDL and the configurations
    are; what survived, as long as the VHDL and all tests are.
    """
    before = found.get("keys", {})

    def _tests(of: Mapping[str, str]) -> dict[str, str]:
        return {name: digits for name, digits in of.items() if name != "configurations"}

    def _same(*names: str) -> bool:
        return all(name in keys and before.get(name) == keys[name] for name in names)

    def _files(test: str) -> list[str]:
        # where no test is known, the selection is named, which may be a folder
        place = test.partition("::")[0]
        return [name for name in keys if name.startswith(f"{place}/")] or [place]

    def _holds(row: Mapping[str, Any]) -> bool:
        if row["outcome"] == "survived":
            # of more configurations no more is equivalent
            return _tests(before) == _tests(keys)
        needed = [unit.file.as_posix()]
        if row["outcome"] in ("killed", "timeout"):
            needed += _files(row.get("by", ""))
        elif row["outcome"] == "equivalent" and "configurations" in {*before, *keys}:
            needed.append("configurations")
        return _same(*needed)

    return [row for row in found.get("mutants", []) if _holds(row)]


def kept(unit: str, folder: Path = RESULTS) -> dict[str, Any]:
    """Results of a unit."""
    path = folder / f"{unit}.json.gz"
    if not path.exists():
        return {}
    try:
        return json.loads(tools.read(path))
    except (OSError, EOFError, zlib.error, json.JSONDecodeError) as error:
        raise MutationError(f"{path.name}: {error}; remove it to begin anew") from None


def _written(
    unit: Unit,
    keys: Mapping[str, str],
    rows: Iterable[Mapping[str, Any]],
    folder: Path,
    *,
    whole: bool,
) -> None:
    """Write the results of a unit; `whole` where none is left to run."""
    ordered = sorted(rows, key=lambda row: (row["line"], row["before"], row["after"], row["place"]))
    known = {"unit": unit.name, "file": unit.file.as_posix(), "keys": keys, "whole": whole}
    tools.write_json(folder / f"{unit.name}.json.gz", known | {"mutants": ordered})


def _store(unit: Unit, found: Mapping[str, Any], folder: Path) -> None:
    """Write results as `kept` has them."""
    _written(unit, found["keys"], found["mutants"], folder, whole=found["whole"])


# --- benches --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Unchanged:
    """What benches take where nothing is changed."""

    #: Processor time that all of them, and a single test, may take with a change.
    work: float
    one: float
    each: Mapping[str, float]  #: Processor time of each test without.


class Workshop:
    """A copy of the project with a process that runs tests in it.

    Attributes
    ----------
    root : Path
        The copy.
    unchanged : dict[tuple[str, ...], Unchanged]
        What tests have taken without a change: it is the same for every unit below them.
    """

    def __init__(self, folder: Path, root: Path = ROOT) -> None:
        self.root = folder / "project"
        self.unchanged: dict[tuple[str, ...], Unchanged] = {}
        self._scratch = folder / "scratch"
        self._scratch.mkdir()
        ignore = shutil.ignore_patterns(*_ELSEWHERE)
        shutil.copytree(root, self.root, symlinks=True, ignore=ignore)
        if (root / ".venv").exists():
            # a test that calls make is not to install anything
            (self.root / ".venv").symlink_to((root / ".venv").resolve())
        path = os.pathsep.join([str(self.root / "model"), str(self.root)])
        # the copy keeps compiled Python, wherever it may not lie: each bench starts Python anew
        kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "scripts.measure.bench_server"],
            cwd=self.root,
            env=kept | {"PYTHONPATH": path, "TMPDIR": str(self._scratch)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            # an interruption is for the one who started it, who then closes its input
            start_new_session=True,
        )

    def run(
        self,
        tests: Sequence[str],
        limit: float = LONGEST,
        work: float = LONGEST,
        one: float = LONGEST,
        first: Sequence[str] = (),
    ) -> dict[str, Any]:
        """Run tests of the copy."""
        stdin: IO[str] = self._process.stdin
        stdout: IO[str] = self._process.stdout
        try:
            asked = {
                "tests": list(tests),
                "limit": limit,
                "work": work,
                "one": one,
                "first": list(first),
            }
            stdin.write(json.dumps(asked) + "\n")
            stdin.flush()
            line = stdout.readline()
        except BrokenPipeError:
            line = ""
        for left in self._scratch.iterdir():
            shutil.rmtree(left, ignore_errors=True)
        if not line:
            raise MutationError("the process that runs the tests has ended")
        return json.loads(line)

    def close(self) -> None:
        """End the process, and what it has begun."""
        self._process.terminate()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()


@contextmanager
def workshop(root: Path = ROOT) -> Iterator[Workshop]:
    """A workshop that goes with the block."""
    with tempfile.TemporaryDirectory(prefix="directmpc-mutants-") as name:
        made = Workshop(Path(name), root)
        try:
            yield made
        finally:
            made.close()


class _Compiler:
    """Analyses versions of one file behind all that it needs."""

    def __init__(self, file: Path, unit: str, rtl: Path, folder: Path) -> None:
        self._options = [ghdl.STANDARD, f"--work={sources.LIBRARY}", f"--workdir={folder}"]
        self._file = file
        needed = sources.compile_order(unit, sources.rtl_files(rtl))
        for path in needed[: needed.index(file)]:
            self._analyse(path)

    def _analyse(self, path: Path) -> None:
        tools.run([*tools.tool("ghdl"), "-a", *self._options, str(path)])

    def compiles(self) -> bool:
        """Whether the file, as it is now, does."""
        try:
            self._analyse(self._file)
        except ToolError:
            return False
        return True


# --- judging --------------------------------------------------------------------------------------


class _Judge:
    """Decides what becomes of the mutants of one unit.

    `known` has earlier results, void or not: the tests that killed most for their time go first.
    """

    def __init__(
        self, unit: Unit, place: Workshop, folder: Path, known: Iterable[Mapping[str, Any]] = ()
    ) -> None:
        self.unit, self.place, self.folder = unit, place, folder
        self.file = place.root / unit.file
        self.source = self.file.read_text(encoding="utf-8")
        self.killer = {_name(row): row["by"] for row in known if row.get("by")}
        self.kills = Counter(self.killer.values())
        self.spent: dict[str, float] = {}  # seconds of the processor, by test
        (folder / "library").mkdir()
        rtl = place.root / unit.rtl
        self.compiler = _Compiler(self.file, unit.name, rtl, folder / "library")
        self.gold = folder / "gold"
        shutil.copytree(rtl, self.gold)

    def _begin(self, tests: tuple[str, ...]) -> Unchanged:
        """What tests take that have passed without a change."""
        if tests not in self.place.unchanged:
            tools.write(self.file, self.source)
            found = self.place.run(tests)
            if found["end"] != "passed" or not found["passed"]:
                said = found["said"] or f"{found['passed']} tests passed"
                raise MutationError(
                    f"{self.unit.name}: its benches do not pass without a change: "
                    f"{found['test'] or ' '.join(tests)}: {found['end']}, {said}"
                )
            each = found["each"]
            # what tests share is made by the first of them, whichever that is
            longest = max(each.values(), default=found["work"])
            self.place.unchanged[tests] = Unchanged(
                GRACE + PATIENCE * found["work"], GRACE + PATIENCE * longest, each
            )
        return self.place.unchanged[tests]

    def _order(self, mutant: Mutant, each: Mapping[str, float]) -> list[str]:
        """All tests; first the one that killed it once, then those that kill in the least time.

        That is the time that a test has spent over its kills. One kill that ended it early is
        supposed of each, and known kills where their time is not known: so each is tried, until it
        fails too often.
        """

        def _per_kill(test: str) -> float:
            early, kills = EARLY * each[test], self.kills[test]
            return (early + self.spent.get(test, kills * early)) / (kills + 1)

        found = sorted(each, key=_per_kill)
        last = self.killer.get(mutant.name)
        return sorted(found, key=lambda test: test != last)

    def judge(self, mutant: Mutant) -> tuple[str, str] | None:
        """Outcome by the unit's own benches, and the test that failed; None if all pass."""
        with self._changed(mutant) as changed:
            if not self.compiler.compiles():
                return "uncompiled", ""
            return self._run(self.unit.tests, mutant, changed)

    def judge_on(self, mutant: Mutant, *, argued: bool) -> tuple[str, str]:
        """Outcome of a mutant that its own benches do not notice.

        Of one that is argued to do the same Yosys is not asked: it has been slow to find nothing.
        """
        with self._changed(mutant) as changed:
            left = list(self.unit.configurations)
            if not argued:
                # the quick question comes before the benches of what stands above
                left = self._unlike(left, equivalence.REGISTERS)
            if not left:
                return "equivalent", ""
            if self.unit.above and (found := self._run(self.unit.above, mutant, changed)):
                return found
            if not argued and not self._unlike(left, equivalence.OUTPUTS):
                return "equivalent", ""
            return "survived", ""

    @contextmanager
    def _changed(self, mutant: Mutant) -> Iterator[str]:
        """The file is the mutant's within the block."""
        changed = mutant.applied(self.source)
        tools.write(self.file, changed)
        try:
            yield changed
        finally:
            tools.write(self.file, self.source)

    def _run(self, tests: tuple[str, ...], mutant: Mutant, changed: str) -> tuple[str, str] | None:
        """Outcome by some tests, None if all pass."""
        normal = self._begin(tests)
        tools.write(self.file, changed)
        found = self.place.run(
            tests, work=normal.work, one=normal.one, first=self._order(mutant, normal.each)
        )
        end, by = found["end"], found["test"] or tests[0]
        for test, seconds in found["each"].items():
            before = EARLY * normal.each.get(test, 0.0) * self.kills[test]
            self.spent[test] = self.spent.get(test, before) + seconds
        if end == "broken":
            raise MutationError(f"{by}: {found['said']}")
        if end == "passed":
            return None
        if end != "uncompiled":
            self.kills[by] += 1
        return ("killed" if end == "failed" else end), by

    def _unlike(self, among: Sequence[Generics], question: str) -> list[Generics]:
        """Configurations in which a question does not show the changed unit to be the same."""
        if not self.unit.top:
            return list(among)
        designs = [
            sources.compile_order(self.unit.top, sources.rtl_files(rtl))
            for rtl in (self.gold, self.place.root / self.unit.rtl)
        ]

        def _same(generics: Generics) -> bool:
            with tempfile.TemporaryDirectory(dir=self.folder) as name:
                try:
                    return equivalence.equal(
                        self.unit.top, generics, *designs, Path(name), [question]
                    )
                except ToolError:  # it has no netlist of its own
                    return False

        return [generics for generics in among if not _same(generics)]


def _row(mutant: Mutant, outcome: str, by: str) -> dict[str, Any]:
    row = {
        "line": mutant.line,
        "kind": mutant.kind,
        "before": mutant.before,
        "after": mutant.after,
        "place": mutant.place,
        "outcome": outcome,
    }
    return row | ({"by": by} if by else {})


def _name(row: Mapping[str, Any]) -> tuple[str, str, int]:
    return row["before"], row["after"], row["place"]


def mutate(
    unit: Unit,
    place: Workshop,
    sample: int = SAMPLE,
    results: Path = RESULTS,
    root: Path = ROOT,
    advance: Callable[[], None] = lambda: None,
    stopped: Callable[[], bool] = lambda: False,
    *,
    anew: bool = False,
) -> dict[str, Any]:
    """Run the mutants of a unit that have no result yet."""
    if not (root / unit.rtl).exists():
        shutil.copytree(ROOT / unit.rtl, root / unit.rtl)
    source = (root / unit.file).read_text(encoding="utf-8")
    keys = keys_of(unit, root)
    before = kept(unit.name, results)
    rows = {} if anew else {_name(row): row for row in valid(unit, before, keys)}
    everything = mutants(source)
    by_name = {one.name: one for one in everything}
    # comments do not count for the key, but they move lines
    rows = {n: row | {"line": by_name[n].line} for n, row in rows.items() if n in by_name}
    argued = {one.name for one in arguments_of(unit)}
    counted, left, whole = 0, sample, True
    open_: list[Mutant] = []
    with tempfile.TemporaryDirectory(prefix="directmpc-mutant-") as name:
        judge: _Judge | None = None

        def _note(one: Mutant, found: tuple[str, str]) -> None:
            rows[one.name] = _row(one, *found)
            _written(unit, keys, rows.values(), results, whole=False)

        for one in shuffled(everything, SEED):
            if counted >= sample:
                break
            if stopped():
                whole = False
                break
            if one.name not in rows:
                judge = judge or _Judge(unit, place, Path(name), before.get("mutants", ()))
                if found := judge.judge(one):
                    _note(one, found)
                else:
                    open_.append(one)
            if one.name not in rows:
                counted += 1
            elif rows[one.name]["outcome"] != "uncompiled":
                counted += 1
                left -= 1
                advance()
        # what takes longest comes last
        for one in open_:
            if judge is None or stopped():
                whole = False
                break
            found = judge.judge_on(one, argued=one.name in argued)
            # then it does not count, and the next run has one more
            whole = whole and found[0] != "uncompiled"
            _note(one, found)
            left -= 1
            advance()
    for _ in range(left):
        advance()
    _written(unit, keys, rows.values(), results, whole=whole)
    return kept(unit.name, results)


def elsewhere(unit: Unit, sample: int, before: Mapping[str, Any]) -> dict[str, Any]:
    """Run the mutants of a unit that have no result yet, in a worker that sees no other's files."""
    with tempfile.TemporaryDirectory(prefix="directmpc-results-") as name, workshop() as place:
        if before:
            _store(unit, before, Path(name))
        return mutate(unit, place, sample, Path(name), place.root)


def mutate_all(
    units: Sequence[Unit],
    sample: int = SAMPLE,
    jobs: int = 1,
    results: Path = RESULTS,
    *,
    anew: bool = False,
    scheduler: str | None = None,
) -> None:
    """Run the mutants of several units, some units at a time."""
    if scheduler is not None:
        calls = [(unit, sample, {} if anew else kept(unit.name, results)) for unit in units]
        with Pool(jobs, scheduler) as pool:
            for n, found in pool.each("units", elsewhere, calls):
                _store(units[n], found, results)
        return
    waiting: queue.SimpleQueue[Unit] = queue.SimpleQueue()
    for unit in units:
        waiting.put(unit)
    stopped: list[bool] = []

    def _work(advance: Callable[[], None]) -> None:
        with workshop() as place:
            while not stopped:
                try:
                    unit = waiting.get_nowait()
                except queue.Empty:
                    return
                # of the copy, whatever has become of the project since
                mutate(
                    unit,
                    place,
                    sample,
                    results,
                    place.root,
                    advance,
                    lambda: bool(stopped),
                    anew=anew,
                )

    with (
        progress.counter("mutants", sample * len(units)) as advance,
        concurrent.futures.ThreadPoolExecutor(jobs) as pool,
    ):
        running = [pool.submit(_work, advance) for _ in range(min(jobs, len(units)))]
        try:
            for future in concurrent.futures.as_completed(running):
                future.result()
        finally:
            stopped.append(True)


# --- what is shown --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Score:
    """What came of the mutants of a unit."""

    unit: str  #: Its name.
    #: How many by outcome; "argued" are those that survived and are argued to do the same.
    outcomes: Mapping[str, int]
    #: Their rows.
    survivors: tuple[Mapping[str, Any], ...]
    argued: tuple[Mapping[str, Any], ...]

    @property
    def mutants(self) -> int:
        """Mutants that compile."""
        return sum(count for name, count in self.outcomes.items() if name != "uncompiled")

    @property
    def killed(self) -> int:
        """Mutants that a check or a time-out has found."""
        return self.outcomes.get("killed", 0) + self.outcomes.get("timeout", 0)

    @property
    def equivalent(self) -> int:
        """Mutants that do the same, proven or argued."""
        return self.outcomes.get("equivalent", 0) + len(self.argued)


def score(unit: str, found: Mapping[str, Any], argued: Sequence[Argument]) -> Score:
    """Count the results of a unit."""
    names = {one.name for one in argued if one.unit == unit}
    survived = [row for row in found["mutants"] if row["outcome"] == "survived"]
    counts = Counter(row["outcome"] for row in found["mutants"])
    counts["survived"] = sum(_name(row) not in names for row in survived)
    counts["argued"] = len(survived) - counts["survived"]
    return Score(
        unit,
        dict(counts),
        tuple(row for row in survived if _name(row) not in names),
        tuple(row for row in survived if _name(row) in names),
    )


def share(killed: int, counted: int) -> str:
    """A score in percent."""
    return f"{100 * killed // counted} %" if counted else "-"


def _figures(one: Score) -> list[int]:
    outcomes = one.outcomes
    return [
        one.mutants,
        one.killed,
        outcomes.get("timeout", 0),
        outcomes.get("equivalent", 0),
        len(one.argued),
        len(one.survivors),
    ]


def _cell(text: str) -> str:
    """A piece of VHDL for a table; long ones are cut."""
    short = text if len(text) <= 90 else f"{text[:87]}..."
    return f"`{short}`" if text else "nothing"


def markdown(
    units: Sequence[Unit],
    results: Mapping[str, Mapping[str, Any]],
    argued: Sequence[Argument],
) -> str:
    """The tables of the page."""
    found = scores(
        {unit.name: results[unit.name] for unit in units if unit.name in results}, argued
    )
    rows: list[Sequence[object]] = []
    total = [0] * 6
    for unit in units:
        label = f"`{unit.name}`"
        if unit.name not in found:
            rows.append((label, "not run", *[""] * 6))
            continue
        one = found[unit.name]
        figures = _figures(one)
        total = [a + b for a, b in zip(total, figures, strict=True)]
        if not results[unit.name].get("whole"):
            label += ", so far"
        rows.append((label, *figures, share(one.killed, one.mutants - one.equivalent)))
    whole = share(total[1], total[0] - total[3] - total[4])
    rows.append((f"all {len(found)} that were run", *total, whole))
    head = (
        "unit", "mutants", "killed", "of these by time-out", "equivalent, proven",
        "equivalent, argued", "survived", "score",
    )  # fmt: skip
    lines = [tables.markdown(head, rows, "lr"), "", "### Survivors", ""]
    files = {unit.name: unit.file.name for unit in units}
    left = [
        (f"`{files[name]}:{row['line']}`", _cell(row["before"]), _cell(row["after"]))
        for name, one in found.items()
        for row in one.survivors
    ]
    lines.append(tables.markdown(("place", "line", "becomes"), left, "l") if left else "None.")
    whys = {(one.unit, one.name): one.why for one in argued}
    same = [
        (
            f"`{files[name]}:{row['line']}`",
            _cell(row["before"]),
            _cell(row["after"]),
            whys[name, _name(row)],
        )
        for name, one in found.items()
        for row in one.argued
    ]
    head = ("place", "line", "becomes", "why nothing changes")
    lines += ["", "### Argued to do the same", ""]
    lines.append(tables.markdown(head, same, "l") if same else "None.")
    return "\n".join(lines)


def outdated(units: Sequence[Unit], results: Path = RESULTS, root: Path = ROOT) -> list[str]:
    """Units whose VHDL or benches have changed since they were run."""
    return [
        unit.name
        for unit in units
        if (found := kept(unit.name, results))
        and len(valid(unit, found, keys_of(unit, root))) < len(found["mutants"])
    ]


def stored(units: Sequence[Unit], results: Path = RESULTS) -> dict[str, dict[str, Any]]:
    """Results of all units that have some."""
    return {unit.name: data for unit in units if (data := kept(unit.name, results))}


def scores(
    results: Mapping[str, Mapping[str, Any]], argued: Sequence[Argument]
) -> dict[str, Score]:
    """Scores of units that were run."""
    return {name: score(name, found, argued) for name, found in results.items()}


def figures(found: Mapping[str, Score]) -> dict[str, dict[str, float]]:
    """What metrics.json says of the scores."""
    told: dict[str, dict[str, float]] = {}
    for name, one in found.items():
        told[name] = {"mutants": one.mutants, "equivalent": one.equivalent}
        if counted := one.mutants - one.equivalent:
            told[name]["killed_pct"] = round(100 * one.killed / counted, 1)
    return told


def badge(found: Mapping[str, Score], units: int) -> str:
    """A picture for the first page of the project."""
    counted = sum(one.mutants - one.equivalent for one in found.values())
    killed = share(sum(one.killed for one in found.values()), counted)
    left, right = "mutation score", f"{killed}, {len(found)} of {units} units"
    # the letters take what they need: about 6.4 units each
    first, second = (round(6.4 * len(text)) + 12 for text in (left, right))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{first + second}" height="20" role="img" '
        f'aria-label="{left}: {right}">\n'
        f'<rect width="{first}" height="20" fill="#444"/>\n'
        f'<rect x="{first}" width="{second}" height="20" fill="#0b6e4f"/>\n'
        '<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11" '
        'text-anchor="middle">\n'
        f'<text x="{first / 2}" y="14">{left}</text>\n'
        f'<text x="{first + second / 2}" y="14">{right}</text>\n'
        "</g>\n</svg>\n"
    )


def publish(page: Path = PAGE, results: Path = RESULTS, metrics: Path = METRICS) -> None:
    """Write the tables into their page, the badge beside it and the figures into metrics.json."""
    units = listed()
    found, argued = stored(units, results), arguments()
    told = scores(found, argued)
    tables.rewrite(page, {MARKS: markdown(units, found, argued)})
    tools.write(page.with_suffix(".svg"), badge(told, len(units)))
    known = json.loads(metrics.read_text(encoding="utf-8")) if metrics.exists() else {}
    tools.write_json(metrics, known | {"mutation": figures(told)})
