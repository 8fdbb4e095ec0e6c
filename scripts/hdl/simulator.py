"""A simulator as a function call: GHDL and cocotb in processes of their own.

A job is written to a folder of its own, a process builds and runs the bench that reads it, and the
answers come back as arrays. What belongs to one core stands in `mpdcc_simulation` and
`mptc_simulation`. The process does not open the job, and so need not know any of it.

The process leads a group, in which GHDL is too, and watches a pipe from its parent: however the
parent ends, the group ends with it. A signal to the parent's own group does not reach the simulator
and need not.
"""

from __future__ import annotations

import concurrent.futures
import json
import os
import pickle
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from scripts.shared import tools
from scripts.shared.tools import ROOT, ToolError

CLOCK_NS = 10  # period of the benches' clock
PARALLEL_ROWS = 2000
"""A trace of more rows than this is worth a second simulator."""
_POLL_S = 0.05
_LOG_LINES = 30
_TOLD = 20  # decisions from one note of progress to the next

IntArray = NDArray[np.int64]
Answer = dict[str, Any]


class SimulationError(ToolError):
    """The simulator failed; the message holds the end of its log."""


class CancelledError(Exception):
    """Stops a simulator from its progress callback."""


@dataclass
class Job:
    """What a simulator has to do; a core's own jobs add what it has to be told."""

    #: Where the job's files are; set by `simulate`.
    folder: Path = field(default_factory=Path, kw_only=True)
    #: File for every signal of the run, in the format FST; none is written if None.
    waves: Path | None = field(default=None, kw_only=True)
    #: Whether the native library of the core decides, in place of GHDL.
    native: bool = field(default=False, kw_only=True)
    #: In place of rows: a closed loop around a core, told what tells how far it is.
    loop: Callable[[Any, Callable[[int], None]], Any] | None = field(default=None, kw_only=True)

    @property
    def progress_path(self) -> Path:
        """File with the number of decisions made so far."""
        return self.folder / "progress"

    @property
    def result_path(self) -> Path:
        """File with the answers."""
        return self.folder / "result.pickle"

    def closed_loop(self, core: Any, progress: Callable[[int], None]) -> Answer:
        """Run `loop`: a bridge of cocotb takes no `functools.partial`."""
        assert self.loop is not None
        return {"run": self.loop(core, progress)}

    def answer(self, result: Answer) -> None:
        """Leave the answers for `simulate`."""
        self.result_path.write_bytes(pickle.dumps(result))

    @property
    def waves_path(self) -> Path | None:
        """File that the simulator writes the signals to."""
        return None if self.waves is None else self.folder / "waves.fst"


@dataclass(frozen=True)
class Bench:
    """What is built and run around a job."""

    units: tuple[str, ...]  #: Entities whose files are compiled, with all they need.
    toplevel: str  #: File of the bench in VHDL, named as its entity.
    module: str  #: Python side of the bench.
    generics: Mapping[str, int | str]  #: Of the bench.
    rtl: str = ""  #: Folder of the design, the project's if empty.


class Progress:
    """Tells the parent process, from within the simulator, how far a job is."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __call__(self, done: int) -> None:
        """Note that so many decisions are made."""
        if done % _TOLD == 0:
            self.path.write_text(str(done), encoding="ascii")


def load(path: Path) -> Any:
    """Read a job or its answers, which this program has written."""
    with path.open("rb") as stream:
        return pickle.load(stream)


def simulate(
    job: Job,
    bench: Bench,
    progress: Callable[[int], None] | None = None,
) -> Answer:
    """Run a job in a process of its own."""
    try:
        tools.simulator()
    except tools.ToolError as error:
        raise SimulationError(str(error)) from None
    with tempfile.TemporaryDirectory(prefix="directmpc-") as name:
        job.folder = Path(name)
        job_path = job.folder / "job.pickle"
        with job_path.open("wb") as stream:
            pickle.dump(job, stream)
        log_path = job.folder / "log"
        told = json.dumps(asdict(bench) | {"waves": str(job.waves_path or "")})
        command = [sys.executable, "-m", "scripts.hdl.simulator", str(job_path), told]
        with log_path.open("wb") as log:
            process = subprocess.Popen(
                command,
                stdout=log,
                stderr=subprocess.STDOUT,
                stdin=subprocess.PIPE,
                start_new_session=True,
                env=os.environ
                | {
                    "PYTHONPATH": os.pathsep.join([str(ROOT / "model"), str(ROOT)]),
                    # a linker that is ended leaves its files there
                    "TMPDIR": name,
                },
            )
            try:
                _wait(process, job, progress)
            finally:
                _end(process)
        if process.returncode != 0 or not job.result_path.exists():
            tail = log_path.read_text(encoding="utf-8", errors="replace").splitlines()
            raise SimulationError("the RTL simulation failed:\n" + "\n".join(tail[-_LOG_LINES:]))
        if job.waves is not None and job.waves_path is not None:
            with tools.replacing(job.waves) as temporary:
                shutil.copyfile(job.waves_path, temporary)
        answer: Answer = load(job.result_path)
        return answer


def _wait(
    process: subprocess.Popen[bytes], job: Job, progress: Callable[[int], None] | None
) -> None:
    """Wait for the simulator and pass on how far it is."""
    while process.poll() is None:
        time.sleep(_POLL_S)
        if progress is not None:
            text = ""
            with suppress(FileNotFoundError):
                text = job.progress_path.read_text(encoding="ascii")
            progress(int(text or 0))


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the whole group of a process, whether it has ended itself or not."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    if process.stdin is not None:
        process.stdin.close()


def _end_with_parent() -> None:
    """Kill this process's group as soon as standard input ends: then nobody waits for it."""

    def watch() -> NoReturn:
        while os.read(0, 1):
            pass
        os.killpg(os.getpgrp(), signal.SIGKILL)
        raise AssertionError("unreachable")

    threading.Thread(target=watch, daemon=True).start()


def _build_and_run(job_path: Path, bench: Bench, waves: str) -> None:
    """Analyse the RTL and run a bench in this process's children; leaves with 1 where it fails."""
    # Needed here alone: who only uses the models needs no simulator packages.
    from scripts.hdl.ghdl import BenchError, BuildError, execute
    from scripts.hdl.sources import RTL

    _end_with_parent()
    # the runner hands this process's search path to the simulator's Python
    sys.path[:0] = [str(ROOT / "model"), str(ROOT)]
    toplevel = Path(bench.toplevel)
    try:
        execute(
            toplevel.stem,
            bench.module,
            job_path.parent,
            units=bench.units,
            files=[toplevel],
            generics=bench.generics,
            environment={"DIRECTMPC_JOB": str(job_path)},
            rtl=Path(bench.rtl) if bench.rtl else RTL,
            timeout=None,
            waves=Path(waves) if waves else None,
        )
    except (BenchError, BuildError, ToolError) as error:
        print(error)
        sys.exit(1)


def in_parallel(
    rows: int,
    run: Callable[[IntArray, Callable[[int], None]], IntArray],
    progress: Callable[[int], None] | None = None,
    processes: int | None = None,
) -> IntArray:
    """Let several simulators share independent rows."""
    count = processes or (2 if rows > PARALLEL_ROWS and (os.cpu_count() or 1) > 1 else 1)
    blocks = np.array_split(np.arange(rows), min(count, rows))
    done = [0] * len(blocks)
    stop = threading.Event()

    def _one(index: int) -> IntArray:
        def _advance(number: int) -> None:
            if stop.is_set():
                raise CancelledError
            done[index] = number

        answer = run(blocks[index], _advance)
        done[index] = len(blocks[index])
        return answer

    with concurrent.futures.ThreadPoolExecutor(len(blocks)) as pool:
        futures = [pool.submit(_one, index) for index in range(len(blocks))]
        try:
            waiting = set(futures)
            while waiting:
                finished, waiting = concurrent.futures.wait(
                    waiting, timeout=0.2, return_when=concurrent.futures.FIRST_EXCEPTION
                )
                for future in finished:
                    future.result()
                if progress is not None:
                    progress(sum(done))
        except BaseException:
            stop.set()
            raise
    return np.concatenate([future.result() for future in futures])


if __name__ == "__main__":
    _told = json.loads(sys.argv[2])
    _waves = _told.pop("waves")
    _build_and_run(Path(sys.argv[1]), Bench(**_told), _waves)
