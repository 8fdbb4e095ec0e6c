"""Runs chosen tests again and again, each time in a child of one process.

The process has imported what the tests need, so that a run costs no start of Python. It reads one
JSON object a line from stdin: ``tests``, ``limit`` and ``work``, the seconds on the clock and those
of the processor that they may take, and, if wanted, ``one``, the seconds of the processor that a
single test may take, and ``first``, names of tests in the order in which they go before all others.
It answers with one:

* ``end``: "passed", "failed", "uncompiled" where VHDL does not compile, "timeout", or "broken"
  where something failed that is no check, a file that is missing for instance;
* ``test``, ``said``: the test that ended the run, and the first line of what it says;
* ``passed``: how many tests passed before;
* ``seconds``, ``work``: the time on the clock and that of the processor;
* ``each``: processor time of each test that was begun, by its name.

A machine that does much else at the same time stretches the clock, not the work. So benches get
``PATIENCE`` times the time that they give their simulator on the clock.

The process runs in a copy of the project, and leaves files below ``build`` there.

Tests that seed faults themselves are left out: they look for a text of the VHDL. A selection with
``::`` is run whatever its tier is, of others only what `make test` runs.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from scripts.hdl import ghdl, sources
from scripts.hdl.ghdl import BuildError

#: Helpers of tb/helpers/faults.py that change the VHDL.
SEEDING = {"altered", "assert_seen"}
#: Seconds between two looks at the time that a run has taken.
POLL = 0.25
PATIENCE = 30
_OPTIONS = ("-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:unraisableexception")
#: What cocotb imports of pytest while a simulator starts; no bench makes use of it.
_NO_PYTEST = {
    "pytest.py": "class raises:\n    class Exception(Exception):\n        pass\n",
    "_pytest/__init__.py": "",
    "_pytest/assertion.py": "install_importhook = None\n",
    "_pytest/config.py": "Config = None\n",
}


def seeds_faults(function: Any) -> bool:
    """Whether a test changes the VHDL itself."""
    code = getattr(function, "__code__", None)
    return code is not None and bool(SEEDING & set(code.co_names))


def end_of(error: BaseException) -> str:
    """What an error of a test means for the design under test."""
    if isinstance(error, BuildError):
        return "uncompiled"
    if isinstance(error, subprocess.TimeoutExpired):
        return "timeout"
    if isinstance(error, (OSError, MemoryError, ImportError, KeyboardInterrupt, SyntaxError)):
        return "broken"
    return "failed"


class _Watch:
    """Chooses tests and keeps what the first one that fails says."""

    def __init__(self, tests: Sequence[str], first: Sequence[str], pipe: int) -> None:
        self.named = tuple(test for test in tests if "::" in test)
        self.rank = {test: place for place, test in enumerate(first)}
        self.pipe = pipe
        self.answer: dict[str, Any] = {"end": "passed", "test": "", "said": "", "passed": 0}

    def pytest_itemcollected(self, item: Any) -> None:
        """Mark tests that seed faults."""
        item.seeds = seeds_faults(getattr(item, "function", None))

    def chosen(self, item: Any) -> bool:
        """Whether a collected test is run."""
        named = any(item.nodeid.startswith(one) for one in self.named)
        return not item.seeds and (named or item.get_closest_marker("thorough") is None)

    def pytest_collection_finish(self, session: Any) -> None:
        """Leave out what is not chosen, after the tiers were given out; put the rest in order."""
        kept = [item for item in session.items if self.chosen(item)]
        last = len(self.rank)
        session.items[:] = sorted(kept, key=lambda item: self.rank.get(item.nodeid, last))

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Say which test begins."""
        _say(self.pipe, {"begun": nodeid})

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Count what passed."""
        self.answer["passed"] += report.when == "call" and report.passed

    def pytest_exception_interact(self, node: Any, call: Any, report: Any) -> None:
        """Keep the first error."""
        if self.answer["end"] != "passed" or report.outcome != "failed":
            return
        error = call.excinfo.value
        said = (str(error).strip() or type(error).__name__).splitlines()[0]
        self.answer |= {"end": end_of(error), "test": node.nodeid, "said": said[:200]}


def _say(pipe: int, what: dict[str, Any]) -> None:
    """One object in a line."""
    os.write(pipe, (json.dumps(what) + "\n").encode())


def _in_child(asked: Mapping[str, Any], pipe: int) -> None:
    """Run the tests and write the answer; does not return."""
    try:
        os.setsid()
        silent = os.open(os.devnull, os.O_RDWR)
        for number in (0, 1, 2):
            os.dup2(silent, number)
        import pytest

        watch = _Watch(asked["tests"], asked.get("first", ()), pipe)
        code = pytest.main([*_OPTIONS, *asked["tests"]], plugins=[watch])
        answer = watch.answer
        if answer["end"] == "passed" and code != pytest.ExitCode.OK:
            answer |= {"end": "broken", "said": f"pytest ended with {int(code)}"}
        _say(pipe, answer)
    finally:
        os._exit(0)


def _session(leader: int) -> Iterator[Path]:
    """Folders below /proc of the processes of a session."""
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError):
            if os.getsid(int(folder.name)) == leader:
                yield folder


def end_session(leader: int) -> None:
    """Kill every process of a session: a simulator may have a process group of its own."""
    for folder in _session(leader):
        with contextlib.suppress(OSError):
            os.kill(int(folder.name), signal.SIGKILL)


def work_of(leader: int) -> float:
    """Processor time of a session, of processes that have ended too."""
    ticks = 0
    for folder in _session(leader):
        with contextlib.suppress(OSError, ValueError):
            # behind the name, which may have blanks: the four times are fields 14 to 17
            fields = (folder / "stat").read_text(encoding="ascii").rpartition(")")[2].split()
            ticks += sum(int(field) for field in fields[11:15])
    return ticks / os.sysconf("SC_CLK_TCK")


class _Times:
    """Processor time of the tests of a child, and whether the one that runs may go on."""

    def __init__(self, allowed: float) -> None:
        self.allowed = allowed
        self.each: dict[str, float] = {}
        self.running = ""
        self._since = 0.0

    def begin(self, test: str, used: float) -> None:
        """A test begins, when so much was used."""
        self.look(used)
        self.running, self._since = test, used

    def look(self, used: float) -> bool:
        """Note what was used; whether the test that runs may go on."""
        if not self.running:
            return True
        self.each[self.running] = used - self._since
        return self.each[self.running] < self.allowed


def _run(asked: Mapping[str, Any]) -> dict[str, Any]:
    """The answer of a child, or what its silence means."""
    began, used, rest = time.monotonic(), 0.0, b""
    times, answer, may, open_ = _Times(asked.get("one", asked["work"])), None, True, True
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        _in_child(asked, write)
    os.close(write)
    while answer is None and open_ and may:
        ready, _, _ = select.select([read], [], [], POLL)
        used = max(used, work_of(child))
        if ready:
            text = os.read(read, 1 << 16)
            open_ = bool(text)
            *lines, rest = (rest + text).split(b"\n")
            for line in map(json.loads, lines):
                if "begun" in line:
                    times.begin(line["begun"], used)
                else:
                    answer = line
        may = times.look(used) and used < asked["work"]
        may = may and time.monotonic() - began < asked["limit"]
    end_session(child)
    with contextlib.suppress(ProcessLookupError):
        os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    os.close(read)
    if answer is None:
        end = "timeout" if open_ else "broken"
        test = times.running if open_ else ""
        answer = {"end": end, "test": test, "said": "", "passed": 0}
    taken = {"seconds": time.monotonic() - began, "work": used, "each": times.each}
    return answer | taken


def _without_pytest() -> None:
    """Let simulators find next to nothing in place of pytest: it takes half of their start.

    They get this process's search path, which has imported the real one already.
    """
    folder = Path("build", "no_pytest").resolve()
    for name, text in _NO_PYTEST.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="ascii")
    sys.path.insert(0, str(folder))


def serve() -> None:
    """Answer requests until stdin ends."""
    import pytest

    ghdl.patience = PATIENCE
    _without_pytest()
    warmed: set[str] = set()
    silent = os.open(os.devnull, os.O_RDWR)
    answers = os.dup(1)
    # whatever a test module prints while it is imported is no answer
    os.dup2(silent, 1)
    # each child inherits what was found in the sources
    sources.scan(sources.rtl_files())
    for line in sys.stdin:
        asked = json.loads(line)
        if new := [test for test in asked["tests"] if test not in warmed]:
            pytest.main([*_OPTIONS, "--collect-only", *new])
            warmed |= set(new)
        answer = _run(asked)
        os.write(answers, (json.dumps(answer) + "\n").encode())


if __name__ == "__main__":
    serve()
