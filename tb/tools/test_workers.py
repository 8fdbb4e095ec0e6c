"""Workers: processes of this machine, and those of a Dask cluster of a scheduler and two workers.

Stimulus: short closed loops of the robustness study; some calls of fidelity, bounds, horizon,
deadlocks and two-level robustness, and a few mutants; one of the cluster's two worker processes is
killed with SIGKILL while it has calls; wrong addresses; a scheduler without workers.
Checks: results are the same in one process and in the cluster, number by number; every call has one
result, though a worker was killed; what goes wrong is one sentence.
Does not prove: that processors of another kind round alike.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import re
import signal
import subprocess
import sys
import threading
import time
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from scripts.measure import mutation
from scripts.shared import rows, workers
from scripts.shared.tools import ROOT, ToolError
from scripts.studies import bounds, deadlocks, horizon, mptc_robustness, robustness
from scripts.studies.fidelity import loops
from scripts.studies.fidelity.points import points

STEPS, PATIENCE = 1500, 240


class PatientEvent(threading.Event):
    """One that is waited for at least `PATIENCE` seconds."""

    def wait(self, timeout: float | None = None) -> bool:
        """Wait as long as asked, or longer."""
        return super().wait(None if timeout is None else max(timeout, PATIENCE))


@pytest.fixture(autouse=True)
def patient_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Dask wait for its own thread: ten seconds are too few where a machine stands still."""
    if importlib.util.find_spec("distributed"):
        import distributed.utils

        ours = types.SimpleNamespace(**vars(threading) | {"Event": PatientEvent})
        monkeypatch.setattr(distributed.utils, "threading", ours)


def tagged(number: int, seconds: float) -> tuple[int, int]:
    """A slow call, and which process did it."""
    time.sleep(seconds)
    return number, os.getpid()


def _logged(path: Path, pattern: str) -> str:
    """Wait for a line of a log."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if found := re.search(pattern, path.read_text(encoding="utf-8")):
            return found[1]
        time.sleep(0.1)
    raise AssertionError(f"{pattern} is not in {path.read_text(encoding='utf-8')}")


@contextmanager
def started(folder: Path, name: str, *arguments: str) -> Iterator[tuple[subprocess.Popen, Path]]:
    """A process of the cluster, and its log."""
    log = folder / f"{name}.log"
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'model'}{os.pathsep}{ROOT}"}
    with log.open("w", encoding="utf-8") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            stdout=out, stderr=subprocess.STDOUT, cwd=ROOT, env=environment,
        )  # fmt: skip
        try:
            yield process, log
        finally:
            process.kill()
            process.wait()


@contextmanager
def scheduling(folder: Path) -> Iterator[str]:
    """A scheduler without workers; its address."""
    pytest.importorskip(
        "distributed", reason="requirements-cluster.txt is not installed: make cluster"
    )
    arguments = ("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    with started(folder, "scheduler", *arguments) as (_, log):
        yield _logged(log, r"Scheduler at:\s+(tcp://\S+)")


def _worker(folder: Path, name: str, address: str):
    # without a nanny, the process is the one that computes
    return started(
        folder, name, "worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard",
        "--name", name, "--local-directory", str(folder),
    )  # fmt: skip


def test_processes_answer_in_the_order_of_the_calls() -> None:
    with workers.Pool(2) as pool:
        found = pool.all("calls", divmod, [(n, 7) for n in range(50)])
        assert found == [divmod(n, 7) for n in range(50)]
        assert pool.all("nothing", divmod, []) == []
        with pytest.raises(ZeroDivisionError):
            pool.all("calls", divmod, [(1, 1), (1, 0)])


def test_without_dask_one_line_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ToolError, match="'make cluster' installs"):
        workers.Pool(1, "tcp://127.0.0.1:1")


def test_processes_need_no_dask() -> None:
    code = (
        "import sys; from scripts.shared.workers import Pool\n"
        "if __name__ == '__main__':\n"
        "    with Pool(1) as pool: pool.all('x', divmod, [(1, 1)])\n"
        "    assert not {'dask', 'distributed'} & set(sys.modules)"
    )
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'model'}{os.pathsep}{ROOT}"}
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT, env=environment)


def test_the_versions_installed_are_those_of_the_file() -> None:
    pytest.importorskip(
        "distributed", reason="requirements-cluster.txt is not installed: make cluster"
    )
    text = (ROOT / "requirements-cluster.txt").read_text(encoding="utf-8")
    pinned = re.findall(r"(?m)^([\w.-]+)==(\S+)", text)
    assert {"dask", "distributed"} <= {name for name, _ in pinned}
    for name, version in pinned:
        assert importlib.metadata.version(name) == version, name


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x", "tcp://127.0.0.1:none"])
def test_an_address_without_a_scheduler_is_one_line(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip(
        "distributed", reason="requirements-cluster.txt is not installed: make cluster"
    )
    monkeypatch.setattr(workers, "WAIT", 1)
    with pytest.raises(ToolError, match=f"--scheduler {address}: no scheduler answers") as caught:
        workers.Pool(1, address)
    assert "\n" not in str(caught.value)


def test_a_scheduler_without_workers_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "WAIT", 5)
    with scheduling(tmp_path) as address, pytest.raises(ToolError, match="no worker within 5 s"):
        workers.Pool(1, address)


def test_a_worker_with_other_sources_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with scheduling(tmp_path) as address, _worker(tmp_path, "one", address) as (_, log):
        _logged(log, r"(Registered to)")
        with workers.Pool(1, address) as pool:
            assert pool.all("calls", divmod, [(7, 2)]) == [(3, 1)]
            # one that joins later is found by the call
            monkeypatch.setattr(workers, "fingerprint", lambda: "other")
            with pytest.raises(ToolError, match="has other sources or packages"):
                pool.all("calls", divmod, [(7, 2)])
        with pytest.raises(ToolError, match="has other sources or packages"):
            workers.Pool(1, address)


def test_calls_of_a_killed_worker_are_done_by_the_other(tmp_path: Path) -> None:
    with (
        scheduling(tmp_path) as address,
        _worker(tmp_path, "one", address) as (first, log),
        _worker(tmp_path, "two", address) as (second, other),
    ):
        import cloudpickle

        cloudpickle.register_pickle_by_value(sys.modules[__name__])
        _logged(log, r"(Registered to)")
        _logged(other, r"(Registered to)")
        seen: dict[int, int] = {}
        with workers.Pool(1, address) as pool:
            for n, (number, process) in pool.each("calls", tagged, [(k, 0.3) for k in range(20)]):
                assert n == number
                assert n not in seen
                seen[n] = process
                if len(seen) == 6:
                    assert set(seen.values()) == {first.pid, second.pid}
                    first.kill()
        assert sorted(seen) == list(range(20))
        assert set(list(seen.values())[-5:]) == {second.pid}


@pytest.mark.timeout(1200)
def test_a_study_is_the_same_though_a_worker_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = [s for s in robustness.settings(1, 1) if s.horizon == "SE"][:16]
    monkeypatch.setattr(robustness, "settings", lambda *_: iter(chosen))
    alone, there = tmp_path / "alone.csv", tmp_path / "there.csv"
    robustness.study(alone, 1, STEPS, 1, 1)
    assert len(set(alone.read_text(encoding="utf-8").splitlines())) == 17
    with (
        scheduling(tmp_path) as address,
        _worker(tmp_path, "one", address) as (first, log),
        _worker(tmp_path, "two", address) as (_, other),
    ):
        _logged(log, r"(Registered to)")
        _logged(other, r"(Registered to)")
        whole = workers.Pool.each
        left = []

        def _each(pool: workers.Pool, *arguments):
            for count, result in enumerate(whole(pool, *arguments), 1):
                if count == 3:
                    first.kill()
                    left.append(len(chosen) - count)
                yield result

        monkeypatch.setattr(workers.Pool, "each", _each)
        robustness.study(there, 1, STEPS, 1, 1, scheduler=address)
        assert left == [13]
        assert first.wait() == -signal.SIGKILL
    assert there.read_bytes() == alone.read_bytes()


class AskedError(Exception):
    """What a study would have had computed."""

    def __init__(self, function: Callable[..., Any], calls: list[tuple[Any, ...]]) -> None:
        super().__init__()
        self.function, self.calls = function, calls


class Asking(workers.Pool):
    """Says what it is to compute, and computes nothing."""

    def __init__(self, *_: object) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass

    def each(self, what, function, arguments):
        """Tell the test."""
        raise AskedError(function, list(arguments))


def computed(function: Callable[..., Any], arguments: tuple[Any, ...]) -> str:
    """A result as text; of mutants their outcomes, which test kills depends on their times."""
    found = function(*arguments)
    if function is mutation.elsewhere:
        found = [(row["before"], row["after"], row["outcome"]) for row in found["mutants"]]
    return repr(found)


def asked(study: Callable[[], object]) -> list[tuple[Callable[..., Any], tuple[Any, ...]]]:
    """Three calls of a study, from the first to the last."""
    with pytest.raises(AskedError) as found:
        study()
    calls = found.value.calls
    return [(found.value.function, calls[len(calls) * n // 3]) for n in range(3)]


@pytest.mark.thorough
@pytest.mark.timeout(1200)
def test_what_studies_ask_is_the_same_though_a_worker_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (horizon, deadlocks, bounds, rows):
        monkeypatch.setattr(module, "Pool", Asking)
    for name, value in (("STARTS", 1), ("STEPS", STEPS), ("RTL_ROWS", 0)):
        monkeypatch.setattr(bounds, name, value)
    drive = ROOT / "drives" / "anpc5l_6kv.toml"
    # what `fidelity` measures is kept in a file, so the part that computes is asked
    rated = [point for point in points() if point.omega_s == 1.0]
    calls = [(loops._run, (point, "fast", 0, 1, STEPS)) for point in rated[:3]]
    for study in (
        lambda: horizon.study(steps=STEPS, starts=1, out=tmp_path),
        lambda: deadlocks.study(drive, steps=STEPS, starts=1, detailed=0, out=tmp_path),
        lambda: bounds.study(1),
        lambda: mptc_robustness.study(tmp_path / "mptc.csv", 1, 1),
    ):
        calls += asked(study)
    units = mutation.named(["uart_timing", "gate_release"], mutation.listed())
    calls += [(mutation.elsewhere, (unit, 2, {})) for unit in units]

    alone = [computed(*call) for call in calls]
    with (
        scheduling(tmp_path) as address,
        _worker(tmp_path, "one", address) as (first, log),
        _worker(tmp_path, "two", address) as (_, other),
    ):
        import cloudpickle

        cloudpickle.register_pickle_by_value(sys.modules[__name__])
        _logged(log, r"(Registered to)")
        _logged(other, r"(Registered to)")
        there: dict[int, str] = {}
        with workers.Pool(1, address) as pool:
            for n, result in pool.each("calls", computed, calls):
                there[n] = result
                if len(there) == 3:
                    first.kill()
        assert first.wait() == -signal.SIGKILL
    assert [there[n] for n in range(len(calls))] == alone
    assert len(set(alone)) == len(calls) == 17
