"""The RTL of ``mpdcc_core`` as an engine: GHDL and cocotb behind a function call.

A job is written to a folder of its own, the simulator reads it, and its answers come back as
arrays.  What is simulated is the checked-in VHDL, analysed anew for every job.
"""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from directmpc.drive import Drive
from directmpc.plant import Plant

ROOT = Path(__file__).resolve().parents[2]
BENCH = ROOT / "tb" / "mpdcc"

#: Columns of a decision as the bench returns it.
FIELDS = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "cycles", "saturated")
VARIANTS = ("fast", "paper")
CLOCK_NS = 10  # period of the bench's clock

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]


class SimulationError(RuntimeError):
    """The simulator failed; the message holds the end of its log."""


@dataclass(frozen=True)
class Loop:
    """A plant and what it is asked to do, for a closed loop around the RTL.

    Attributes
    ----------
    drive : Drive
        Plant parameters.
    state : (8,)
        Plant state at the first step, see `plant`.
    s_start : (3,)
        Switch positions before the first step.
    vdc, omega_s, omega_r : (n,)
        dc-link voltage and speeds per step, per unit.
    iref : (n, 2)
        Current reference per step, per unit.
    """

    drive: Drive
    state: FloatArray
    s_start: IntArray
    vdc: FloatArray
    omega_s: FloatArray
    omega_r: FloatArray
    iref: FloatArray

    def plant(self) -> Plant:
        """The plant in its first state."""
        return Plant(self.drive, float(self.omega_r[0]), float(self.vdc[0]), self.state)


@dataclass
class Job:
    """What the simulator has to do; see ``simulate``."""

    registers: IntArray
    measurements: IntArray
    s_prev: IntArray
    throttle: int = 0
    loop: Loop | None = None
    folder: Path = field(default_factory=Path)

    @property
    def steps(self) -> int:
        """Decisions to make."""
        return len(self.loop.omega_s) if self.loop is not None else len(self.measurements)

    @property
    def progress_path(self) -> Path:
        """File with the number of decisions made so far."""
        return self.folder / "progress"

    @property
    def result_path(self) -> Path:
        """File with the answers."""
        return self.folder / "result.npz"


def load_job(path: Path) -> Job:
    """Read a job that this program has written."""
    with path.open("rb") as stream:
        job: Job = pickle.load(stream)
    return job


def _command(job_path: Path, folder: Path, explorers: int, variant: str) -> list[str]:
    """Command line of the process that builds and runs the bench."""
    return [
        sys.executable, "-m", "directmpc.rtl_simulation",
        str(job_path), str(folder), str(explorers), variant,
    ]  # fmt: skip


def _wait(
    process: subprocess.Popen[bytes], job: Job, progress: Callable[[int], None] | None
) -> None:
    """Wait for the simulator and pass on how far it is."""
    while process.poll() is None:
        time.sleep(0.05)
        if progress is not None and job.progress_path.exists():
            text = job.progress_path.read_text(encoding="ascii")
            if text:
                progress(int(text))


def simulate(
    job: Job,
    explorers: int,
    variant: str,
    progress: Callable[[int], None] | None = None,
) -> dict[str, NDArray[np.float64] | IntArray]:
    """Run a job on the RTL.

    Parameters
    ----------
    job : Job
        Rows, or a plant.
    explorers : int
        1 to 8.
    variant : str
        One of ``VARIANTS``.
    progress : callable, optional
        Called now and then with the number of decisions made.

    Returns
    -------
    dict
        ``decisions`` (n, 8) in the order of ``FIELDS``; ``states`` (n + 1, 8) for a closed loop.

    Raises
    ------
    SimulationError
        If the simulator is missing or fails, or stops before the last row.
    """
    if shutil.which(os.environ.get("GHDL", "ghdl")) is None:
        raise SimulationError("ghdl is not installed; 'make setup' installs it")
    with tempfile.TemporaryDirectory(prefix="directmpc-") as name:
        job.folder = Path(name)
        job_path = job.folder / "job.pickle"
        with job_path.open("wb") as stream:
            pickle.dump(job, stream)
        log_path = job.folder / "log"
        with log_path.open("wb") as log:
            process = subprocess.Popen(
                _command(job_path, job.folder, explorers, variant),
                stdout=log,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
            )
            try:
                _wait(process, job, progress)
            finally:
                if process.poll() is None:
                    process.kill()
                    process.wait()
        if process.returncode != 0 or not job.result_path.exists():
            tail = log_path.read_text(encoding="utf-8", errors="replace").splitlines()[-30:]
            raise SimulationError("the RTL simulation failed:\n" + "\n".join(tail))
        with np.load(job.result_path) as data:
            return {key: data[key] for key in data.files}


def build_and_run(job_path: Path, folder: Path, explorers: int, variant: str) -> None:
    """Analyse the RTL and run the bench in this process's children."""
    # Needed here alone: who only uses the models needs no simulator packages.
    from cocotb_tools.runner import get_results, get_runner

    from scripts import budgets
    from scripts.sources import compile_order, rtl_files

    # the runner hands this process's search path to the simulator's Python
    sys.path[:0] = [str(BENCH), str(ROOT / "model"), str(ROOT)]
    runner = get_runner("ghdl")
    runner.build(
        sources=[*compile_order("mpdcc_core", rtl_files()), BENCH / "mpdcc_core_bench.vhd"],
        hdl_toplevel="mpdcc_core_bench",
        build_args=["--std=08"],
        build_dir=folder,
    )
    results = runner.test(
        hdl_toplevel="mpdcc_core_bench",
        test_module="cosimulation",
        test_args=["--std=08"],
        # datapath registers hold no value until they are loaded; what reaches an output is compared
        plusargs=["--ieee-asserts=disable"],
        parameters={
            "EXPLORERS": explorers,
            "FOLDED": str(variant == "paper").lower(),
            "MOST_CLOCKS": budgets.worst(explorers, variant),
        },
        build_dir=folder,
        test_dir=folder,
        results_xml=str(folder / "results.xml"),
        # cocotb would rewrite the assertions of every module it imports, numba and scipy included
        extra_env={"DIRECTMPC_JOB": str(job_path), "COCOTB_REWRITE_ASSERTION_FILES": ""},
    )
    executed, failed = get_results(results)
    if failed or executed == 0:
        sys.exit(1)


if __name__ == "__main__":
    build_and_run(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
