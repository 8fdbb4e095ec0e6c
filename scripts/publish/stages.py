"""Parts of `make report`: each is measured once, kept under build/report, and published with all.

A stage has a name and a key, which changes with the sources that it depends on, with drive files
and versions of tools (`scripts.shared.cache`). What it made lies in ``build/report/NAME-KEY``. A
report that was stopped goes on behind the stages that are there. A stage that is at work has
``build/report/.NAME-KEY``; studies that go on by themselves find their rows there again.

Commands that write into reports/ and into pages by themselves are run `in_place`: what they wrote
is taken away, and put back is what was there. So nothing is published before all is measured.
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
INNER = "_"
"""Files of a stage whose names begin so are for `make report` alone, and not published."""


@dataclass(frozen=True)
class Stage:
    """A part of the report.

    Attributes
    ----------
    name
        In lower case, with hyphens.
    says
        What is said while it runs.
    modules
        That make it; all that they import is part of its key.
    run
        Writes its files into a folder, which may hold those of a run that was stopped.
    data
        Files and words that it depends on, besides the modules.
    publish
        Brings pages up to date with the files in reports/; None where there is no page.
    """

    name: str
    says: str
    modules: tuple[str, ...]
    run: Callable[[Path], None]
    data: tuple[str | Path, ...] = ()
    publish: Callable[[], None] | None = None

    def key(self) -> str:
        """What the stage's results are kept by.

        Returns
        -------
        str
            Sixteen hexadecimal digits.

        Raises
        ------
        ToolError
            If there is no module of a name.
        """
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
    """Put published files back where the block fails.

    Parameters
    ----------
    folders : iterable of Path
        Files, and folders whose files are meant.
    """
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
    """A command that writes into reports/ and pages, as the work of a stage.

    Parameters
    ----------
    run : callable
        The command.
    folders : iterable of Path
        What it writes to, the folder of reports first.

    Returns
    -------
    callable
        Runs it, moves what it wrote into reports/ to the folder that it is given, but for
        metrics.json, and puts everything back.
    """
    reports, *_ = folders = tuple(folders)

    def _run(work: Path) -> None:
        before = _watched(folders)
        try:
            run()
            for path, content in _watched([reports]).items():
                if path.name != METRICS and content != before.get(path):
                    (work / path.name).write_bytes(content)
        finally:
            _put_back(before, folders)

    return _run


def result(stage: Stage, say: Callable[[str], None], folder: Path = FOLDER) -> Path:
    """Results of a stage; it is run if there are none of its key.

    Parameters
    ----------
    stage : Stage
        The stage.
    say : callable
        Tells a line.
    folder : Path
        Of all stages.

    Returns
    -------
    Path
        Folder of its files.

    Raises
    ------
    ToolError
        If it cannot be measured.
    """
    name = f"{stage.name}-{stage.key()}"
    done, work = folder / name, folder / f".{name}"
    if done.is_dir():
        say(f"{stage.says}: known, nothing that it depends on has changed")
        return done
    say(stage.says)
    work.mkdir(parents=True, exist_ok=True)
    stage.run(work)
    work.rename(done)
    for other in folder.glob(f"{stage.name}-*"):  # of older sources
        if other != done and other.is_dir() and len(other.name) == len(name):
            shutil.rmtree(other)
    return done


def copy(results: Iterable[Path], reports: Path = REPORTS) -> None:
    """Publish files of stages.

    Parameters
    ----------
    results : iterable of Path
        Their folders.
    reports : Path
        Where to.
    """
    for folder in results:
        for path in sorted(folder.glob("*")):
            if path.is_file() and not path.name.startswith((INNER, ".")):
                with tools.replacing(reports / path.name) as temporary:
                    temporary.write_bytes(path.read_bytes())


def keep_json(run: Callable[[Path], Any]) -> Callable[[Path], None]:
    """Work of a stage that keeps figures beside its files.

    Parameters
    ----------
    run : callable
        Gets the folder, may write files into it, returns what JSON can hold.

    Returns
    -------
    callable
        Writes that into the folder, for `figures`.
    """

    def _run(work: Path) -> None:
        tools.write(work / f"{INNER}figures.json", json.dumps(run(work)))

    return _run


def figures(done: Path) -> Any:
    """Figures of a stage that keeps some.

    Parameters
    ----------
    done : Path
        Folder of its results.

    Returns
    -------
    Any
        As `keep_json` got them.
    """
    return json.loads((done / f"{INNER}figures.json").read_text(encoding="utf-8"))
