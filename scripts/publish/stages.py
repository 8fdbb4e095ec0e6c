"""Parts of `make report`: each is measured once, kept under build/report, and published with all.

A stage has a name and a key, which changes with the sources that it depends on, with drive files
and versions of tools (`scripts.shared.cache`). What it made lies in ``build/report/NAME-KEY``. A
report that was stopped goes on behind the stages that are there. A stage that is at work has
``build/report/.NAME-KEY``; studies that go on by themselves find their rows there again.

Commands that write into reports/ and into pages by themselves are run `in_place`: what they wrote
is taken away, and put back is what was there. So nothing is published before all is measured.

reports/stages.json is the record of what is published: for each stage its key, the commit that it
was measured at, its figures, and a digest of each of its files. A stage whose recorded key is that
of the tree is not measured again, on whatever machine: its files are taken from reports/.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scripts.shared import cache, tools
from scripts.shared.tools import BUILD, ROOT

REPORTS = ROOT / "reports"
FOLDER = BUILD / "report"
PAGES = (ROOT / "README.md", ROOT / "docs")
METRICS = "metrics.json"
RECORD = "stages.json"
INNER = "_"
"""Files of a stage whose names begin so are for `make report` alone, and not published."""
_FIGURES, _COMMIT = f"{INNER}figures.json", f"{INNER}commit"


@dataclass(frozen=True)
class Stage:
    """A part of the report."""

    name: str  #: In lower case, with hyphens.
    says: str  #: What is said while it runs.
    modules: tuple[str, ...]  #: That make it; all that they import is part of its key.
    #: Writes its files into a folder, which may hold those of a run that was stopped.
    run: Callable[[Path], None]
    data: tuple[str | Path, ...] = ()  #: Files and words that it depends on, besides the modules.
    #: Brings pages up to date with the files in reports/; None where there is no page.
    publish: Callable[[], None] | None = None

    def key(self) -> str:
        """What the stage's results are kept by."""
        requirements = ROOT / "requirements.txt"
        return cache.key(self.modules, requirements, *self.data)


def _watched(folders: Iterable[Path]) -> dict[Path, bytes]:
    """Files that are published, with their content."""
    found = []
    for path in folders:
        found += [path] if path.is_file() else [p for p in path.glob("*") if p.is_file()]
    return {path: path.read_bytes() for path in found if not path.name.startswith(".")}


def _put_back(before: dict[Path, bytes], folders: Iterable[Path]) -> None:
    """Give files their content again, and remove those that were not there."""
    for path, content in _watched(folders).items():
        if path not in before:
            path.unlink()
        elif content != before[path]:
            with tools.replacing(path) as temporary:
                temporary.write_bytes(before[path])
    for path in before:
        if not path.exists():
            with tools.replacing(path) as temporary:
                temporary.write_bytes(before[path])


@contextmanager
def all_or_nothing(folders: Iterable[Path] = (REPORTS, *PAGES)) -> Iterator[None]:
    """Put published files back where the block fails."""
    folders = tuple(folders)
    before = _watched(folders)
    try:
        yield
    except BaseException:
        _put_back(before, folders)
        raise


def in_place(
    run: Callable[[], object], folders: Iterable[Path] = (REPORTS, *PAGES)
) -> Callable[[Path], None]:
    """A command that writes into reports/ and pages, as the work of a stage."""
    reports, *_ = folders = tuple(folders)

    def _run(work: Path) -> None:
        before = _watched(folders)
        written = {path: path.stat().st_mtime_ns for path in before}
        try:
            run()
            for path, content in _watched([reports]).items():
                if path.name not in (METRICS, RECORD) and (
                    path.stat().st_mtime_ns != written.get(path)
                ):
                    (work / path.name).write_bytes(content)
        finally:
            _put_back(before, folders)

    return _run


def result(
    stage: Stage,
    say: Callable[[str], None],
    folder: Path = FOLDER,
    reports: Path = REPORTS,
    *,
    commit: str | None = None,
) -> Path:
    """Results of a stage; it is run if there are none of its key."""
    name = f"{stage.name}-{stage.key()}"
    done, work = folder / name, folder / f".{name}"
    if done.is_dir() and commit not in (None, _commit_of(done)):
        shutil.rmtree(done)
    if done.is_dir():
        say(f"{stage.says}: known, nothing that it depends on has changed")
        return done
    if _restored(stage, done, reports, commit):
        say(f"{stage.says}: published, nothing that it depends on has changed")
        return done
    say(stage.says)
    work.mkdir(parents=True, exist_ok=True)
    now, dirty = tools.git_state()
    stage.run(work)
    tools.write(work / _COMMIT, now + "-dirty" * dirty)
    work.rename(done)
    for other in folder.glob(f"{stage.name}-*"):  # of older sources
        if other != done and other.is_dir() and len(other.name) == len(name):
            shutil.rmtree(other)
    return done


def recorded(reports: Path = REPORTS) -> dict[str, Any]:
    """What is known of the published stages."""
    path = reports / RECORD
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def record(results: dict[str, Path], reports: Path = REPORTS) -> dict[str, Any]:
    """Write down which results are published, after `copy`."""
    known = recorded(reports)
    for name, done in results.items():
        known[name] = {
            "key": done.name.removeprefix(f"{name}-"),
            "commit": _commit_of(done),
            "files": {path.name: _digest(path) for path in _published(done)},
            "figures": figures(done) if has_figures(done) else None,
        }
    tools.write_json(reports / RECORD, dict(sorted(known.items())))
    return known


def is_current(stage: Stage, reports: Path = REPORTS) -> bool:
    """Whether what is published of a stage is by the sources of the tree."""
    known = recorded(reports).get(stage.name, {})
    return known.get("key") == stage.key() and all(
        (reports / name).exists() and _digest(reports / name) == digest
        for name, digest in known["files"].items()
    )


def _restored(stage: Stage, done: Path, reports: Path, commit: str | None) -> bool:
    """Whether a stage's results could be taken from where they are published."""
    if not is_current(stage, reports):
        return False
    known = recorded(reports)[stage.name]
    if commit not in (None, known["commit"]):
        return False
    work = done.with_name(f".{done.name}.part")
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    for name in known["files"]:
        (work / name).write_bytes((reports / name).read_bytes())
    if known["figures"] is not None:
        tools.write(work / _FIGURES, json.dumps(known["figures"]))
    tools.write(work / _COMMIT, known["commit"])
    work.rename(done)
    return True


def _commit_of(done: Path) -> str:
    return (done / _COMMIT).read_text(encoding="utf-8")


def _digest(path: Path) -> str:
    return tools.digest(path.read_bytes())[:16]


def _published(done: Path) -> list[Path]:
    """Files of a stage that are published."""
    found = (path for path in sorted(done.glob("*")) if path.is_file())
    return [path for path in found if not path.name.startswith((INNER, "."))]


def copy(results: Iterable[Path], reports: Path = REPORTS) -> None:
    """Publish files of stages."""
    for folder in results:
        for path in _published(folder):
            with tools.replacing(reports / path.name) as temporary:
                temporary.write_bytes(path.read_bytes())


def keep_json(run: Callable[[Path], Any]) -> Callable[[Path], None]:
    """Work of a stage that keeps figures beside its files."""

    def _run(work: Path) -> None:
        tools.write(work / _FIGURES, json.dumps(run(work)))

    return _run


def has_figures(done: Path) -> bool:
    """Whether a stage keeps figures."""
    return (done / _FIGURES).exists()


def figures(done: Path) -> Any:
    """Figures of a stage that keeps some."""
    return json.loads((done / _FIGURES).read_text(encoding="utf-8"))
