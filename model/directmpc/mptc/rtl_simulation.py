"""The RTL of ``mptc_core`` as an engine: GHDL and cocotb behind a function call.

As `directmpc.rtl_simulation`, for the two-level core: a job is written to a folder of its own, the
simulator reads it, and its answers come back as arrays.
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

from directmpc.mptc.plant import PlantParameters
from directmpc.rtl_simulation import SimulationError
from directmpc.trace import FloatArray, IntArray

ROOT = Path(__file__).resolve().parents[3]
BENCH = ROOT / "tb" / "mptc"

#: Columns of a decision as the bench returns it.
FIELDS = ("u", "cycles", "saturated", "clamped", "switches")
CLOCK_NS = 10  # period of the bench's clock


@dataclass(frozen=True)
class Loop:
    """A plant with a shaft and a speed controller, for a closed loop around the RTL.

    Attributes
    ----------
    plant : PlantParameters
    scales, lows, highs : (8,)
        Formats of the measurements, as ``bit_true.parameters`` returns them.
    vdc : float
        What the controller is told, V.
    torque_ref, psi_ref, load, speed_ref : (n,)
        As in `closed_loop.Scenario`.
    use_speed : bool
        Whether the speed controller is in the loop.
    gains : tuple
        Of the speed controller.
    current, flux : complex
        Plant state at the first step.
    omega_r : float
        Electrical speed at the first step, rad/s.
    """

    plant: PlantParameters
    scales: FloatArray
    lows: FloatArray
    highs: FloatArray
    vdc: float
    torque_ref: FloatArray
    psi_ref: FloatArray
    load: FloatArray
    speed_ref: FloatArray
    use_speed: bool
    gains: tuple[float, float, float]
    current: complex
    flux: complex
    omega_r: float


@dataclass
class Job:
    """What the simulator has to do; see ``simulate``."""

    registers: IntArray
    measurements: IntArray
    u: IntArray
    flux_control: bool = True
    loop: Loop | None = None
    each_registers: IntArray | None = None
    folder: Path = field(default_factory=Path)

    @property
    def steps(self) -> int:
        """Decisions to make."""
        return len(self.loop.torque_ref) if self.loop is not None else len(self.measurements)

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


def simulate(
    job: Job, progress: Callable[[int], None] | None = None, rtl: Path | None = None
) -> dict[str, FloatArray | IntArray]:
    """Run a job on the RTL.

    Parameters
    ----------
    job : Job
        Rows, or a plant.
    progress : callable, optional
        Called now and then with the number of decisions made.
    rtl : Path, optional
        Folder of the design, the project's if not given.

    Returns
    -------
    dict
        ``decisions`` (n, 5) in the order of ``FIELDS``; for a closed loop ``seen`` (n, 8): what
        the controller saw, and ``u`` last, before quantisation.

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
        command = [sys.executable, "-m", "directmpc.mptc.rtl_simulation", str(job_path)]
        with log_path.open("wb") as log:
            process = subprocess.Popen(
                [*command, str(rtl or "")],
                stdout=log,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT / "model"), str(ROOT)])},
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


def build_and_run(job_path: Path, rtl: Path | None) -> None:
    """Analyse the RTL and run the bench in this process's children."""
    # Needed here alone: who only uses the models needs no simulator packages.
    from cocotb_tools.runner import get_results, get_runner

    from scripts.sources import compile_order, rtl_files

    folder = job_path.parent
    job = load_job(job_path)
    # the runner hands this process's search path to the simulator's Python
    sys.path[:0] = [str(BENCH), str(ROOT / "model"), str(ROOT)]
    available = rtl_files(rtl) if rtl is not None else rtl_files()
    runner = get_runner("ghdl")
    runner.build(
        sources=[*compile_order("mptc_core", available), BENCH / "mptc_core_bench.vhd"],
        hdl_toplevel="mptc_core_bench",
        build_args=["--std=08"],
        build_dir=folder,
    )
    results = runner.test(
        hdl_toplevel="mptc_core_bench",
        test_module="mptc_cosimulation",
        test_args=["--std=08"],
        # datapath registers hold no value until they are loaded; what reaches an output is compared
        plusargs=["--ieee-asserts=disable"],
        parameters={"FLUX_CONTROL": str(job.flux_control).lower()},
        build_dir=folder,
        test_dir=folder,
        results_xml=str(folder / "results.xml"),
        extra_env={"DIRECTMPC_JOB": str(job_path)},
    )
    executed, failed = get_results(results)
    if failed or executed == 0:
        sys.exit(1)


if __name__ == "__main__":
    build_and_run(Path(sys.argv[1]), Path(sys.argv[2]) if sys.argv[2] else None)
