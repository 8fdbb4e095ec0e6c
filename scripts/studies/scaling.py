"""Closed loops per minute on one and two processes, of this machine and of a cluster on it.

``python -m scripts scaling`` runs the same loops of the robustness study four times, compares all
their figures, and writes the table of ``docs/cluster.md``. The cluster is a scheduler and one or
two workers, which the command starts. Compiling is not timed: each worker has run a loop before.
"""

from __future__ import annotations

import contextlib
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from scripts.shared import tables
from scripts.shared.tools import ROOT, ToolError
from scripts.shared.workers import Pool
from scripts.studies import robustness

PAGE = ROOT / "docs" / "cluster.md"
BEGIN = "<!-- scaling: begin (written by python -m scripts scaling) -->"
END = "<!-- scaling: end -->"
LOOPS = 64
STEPS = 3000
WORKERS = (1, 2)
PATIENCE = 60  # seconds for a process of the cluster to start


@contextlib.contextmanager
def _process(folder: Path, name: str, ready: str, *arguments: str) -> Iterator[str]:
    """A process of the cluster; yields what `ready` has matched in its output."""
    log = folder / f"{name}.log"
    paths = f"{ROOT / 'model'}{os.pathsep}{ROOT}"
    with log.open("w", encoding="utf-8") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments], stdout=out, stderr=subprocess.STDOUT,
            cwd=ROOT, env=os.environ | {"PYTHONPATH": paths},
        )  # fmt: skip
        try:
            end = time.monotonic() + PATIENCE
            while not (found := re.search(ready, log.read_text(encoding="utf-8"))):
                if process.poll() is not None or time.monotonic() > end:
                    last = [*log.read_text(encoding="utf-8").splitlines(), "no output"][-1]
                    raise ToolError(
                        f"dask {arguments[0]} does not start ({last}); 'make cluster' installs Dask"
                    )
                time.sleep(0.1)
            yield found[1]
        finally:
            process.terminate()
            process.wait()


@contextlib.contextmanager
def cluster(workers: int) -> Iterator[str]:
    """A scheduler on this machine with workers of one thread each."""
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="directmpc-dask-")))
        address = stack.enter_context(
            _process(
                folder, "scheduler", r"Scheduler at:\s+(tcp://\S+)",
                "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
            )
        )  # fmt: skip
        for n in range(workers):
            stack.enter_context(
                _process(
                    folder, f"worker{n}", r"(Registered to)", "worker", address, "--no-nanny",
                    "--nthreads", "1", "--no-dashboard", "--local-directory", str(folder),
                )
            )  # fmt: skip
        yield address


def measure(loops: int = LOOPS, steps: int = STEPS) -> list[dict[str, Any]]:
    """Run the same loops on every kind and number of workers."""
    chosen = list(robustness.settings(1, loops))[:loops]
    calls = [(setting, steps) for setting in chosen]
    rows, wanted = [], None
    for there in (False, True):
        for count in WORKERS:
            with (
                cluster(count) if there else contextlib.nullcontext() as address,
                Pool(count, address) as pool,
            ):
                # two for each: every worker has compiled when the clock starts
                pool.all("compiling", robustness.loop, [(c[0], 600) for c in calls[: 2 * count]])
                began = time.perf_counter()
                found = pool.all("closed loops", robustness.loop, calls)
                seconds = time.perf_counter() - began
            if wanted is not None and found != wanted:
                raise ToolError("the results of two runs differ; nothing was written")
            wanted = found
            rows.append({"workers": count, "cluster": there, "seconds": seconds})
    return rows


def table(rows: list[dict[str, Any]], loops: int, steps: int, load: float) -> str:
    """Throughput and what a second worker gains, as Markdown."""
    shown = []
    for row in rows:
        alone = next(r for r in rows if r["cluster"] == row["cluster"] and r["workers"] == 1)
        shown.append(
            (
                "Dask" if row["cluster"] else "processes", row["workers"],
                f"{row['seconds']:.1f} s", f"{60 * loops / row['seconds']:.0f}",
                f"{alone['seconds'] / row['seconds']:.2f}",
            )
        )  # fmt: skip
    head = ("workers", "number", "time", "loops per minute", "times as fast as one")
    return (
        f"{loops} loops of {steps:,} steps; {platform.machine()}, {os.cpu_count()} cores, Python "
        f"{platform.python_version()}. Load by other programs when it began: {load:.1f}. "
        "All figures of all loops were the same in the four runs.\n\n"
        + tables.markdown(head, shown)
    )
