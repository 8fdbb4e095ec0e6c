"""Runs one cocotb module on one VHDL top with GHDL, in this process's children."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from unittest import mock
from xml.etree import ElementTree

from cocotb_tools.runner import get_results, get_runner

from scripts.hdl import machine_code
from scripts.hdl.sources import LIBRARY, RTL, compile_order, rtl_files, scan
from scripts.shared import tools

STANDARD = "--std=08"
#: Library of the wrappers and benches; the design has its own, `sources.LIBRARY`.
BENCHES = "benches"

#: How many times the time limit of a bench it may take on the clock. `scripts.measure.bench_server`
#: raises it: it counts processor time, so that a busy machine makes no bench fail.
patience = 1

_VHDL_FAILURE = re.compile(
    r"\((?:assertion|report) failure\): ?(.*)|error: (bound check failure .*)"
)


class BenchError(AssertionError):
    """The bench did not pass; the message holds the end of its log."""


class CheckError(BenchError):
    """The bench ran to a check that failed: neither a crash nor a bench that took too long.

    Attributes
    ----------
    check : str
        What the check says of itself.
    """

    def __init__(self, check: str, log: str = "") -> None:
        super().__init__(f"{check}\n{log}".strip())
        self.check = check


class BuildError(RuntimeError):
    """The VHDL does not compile, so nothing was checked."""


@contextlib.contextmanager
def chosen_ghdl(folder: Path) -> Iterator[None]:
    """Let cocotb start the GHDL of `tools.simulator` in place of the `ghdl` of the PATH."""
    script = folder / "bin" / "ghdl"
    script.parent.mkdir(parents=True, exist_ok=True)
    script.write_text(f'#!/bin/sh\nexec {shlex.join(tools.simulator())} "$@"\n')
    script.chmod(0o755)
    first = os.pathsep.join([str(script.parent), os.environ.get("PATH", os.defpath)])
    with mock.patch.dict(os.environ, {"PATH": first}):
        yield


def _tail(path: Path, lines: int = 40) -> str:
    if not path.exists():
        return "(no log)"
    return "\n".join(path.read_text(encoding="utf-8", errors="replace").splitlines()[-lines:])


def _failed_check(results_xml: Path, log: Path) -> str | None:
    """Message of the check that ended a bench, None where something else did.

    A check is an assertion of a cocotb test, one of the VHDL with severity failure, or a value that
    leaves the range that the VHDL declares.
    """
    if log.exists():
        found = _VHDL_FAILURE.search(log.read_text(encoding="utf-8", errors="replace"))
        if found is not None:
            return (found[1] or found[2]).strip()
    if not results_xml.exists():
        return None
    failures = ElementTree.parse(results_xml).iter("failure")
    checks = [one.get("message", "") for one in failures if one.get("type") == "AssertionError"]
    return checks[0] if checks else None


def execute(
    top: str,
    module: str,
    folder: Path,
    *,
    units: Sequence[str],
    files: Sequence[Path] = (),
    generics: Mapping[str, object] | None = None,
    environment: Mapping[str, str] | None = None,
    rtl: Path = RTL,
    timeout: int | None = 900,
    waves: Path | None = None,
) -> None:
    """Analyse, elaborate and run; raise where that fails or a cocotb test does."""
    available = rtl_files(rtl)
    sources: list[Path] = []
    for unit in units:
        sources += [path for path in compile_order(unit, available) if path not in sources]
    with chosen_ghdl(folder):
        library = _build(top, folder, sources, files, rtl)
        _test(top, library, module, folder, generics, environment, timeout, waves)


def _build(
    top: str, folder: Path, sources: Sequence[Path], files: Sequence[Path], rtl: Path
) -> str:
    """Analyse the design into its library and the bench's files into theirs.

    Returns the library that holds the top.
    """
    own = any(top.lower() in unit.entities for unit in scan(sources))
    ghdl = tools.simulator()
    library, here = (LIBRARY if own else BENCHES), f"-P{folder}"
    compiles = machine_code.compiles()
    try:
        if compiles:
            machine_code.analyse(folder, sources, rtl, STANDARD)
        else:
            design = [*ghdl, "-a", STANDARD, f"--work={LIBRARY}"]
            tools.run([*design, *map(str, sources)], cwd=folder)
        fast = ["-O0"] if compiles else []
        bench = [STANDARD, *fast, f"--work={library}", here]
        if files:
            tools.run([*ghdl, "-a", *bench, *map(str, files)], cwd=folder)
        tools.run([*ghdl, "-e", *bench, top], cwd=folder)
    except tools.ToolError as error:
        raise BuildError(f"{top} does not compile:\n{error}") from error
    return library


def _test(
    top: str,
    library: str,
    module: str,
    folder: Path,
    generics: Mapping[str, object] | None,
    environment: Mapping[str, str] | None,
    timeout: int | None,
    waves: Path | None,
) -> None:
    """Elaborate and run what `_build` has analysed; the arguments are those of `execute`."""
    test_log = folder / "test.log"
    # cocotb's own variable would have it write another file, in another format
    changes = {"WAVES": "0"}
    if timeout is not None:
        changes["SIM_CMD_PREFIX"] = f"timeout -k 5 {patience * timeout}"
    recorded = [] if waves is None else [f"--fst={waves}"]
    results_xml = folder / "results.xml"
    try:
        with mock.patch.dict(os.environ, changes):
            get_runner("ghdl").test(
                hdl_toplevel=top,
                hdl_toplevel_library=library,
                hdl_toplevel_lang="vhdl",
                test_module=module,
                test_args=[STANDARD, f"-P{folder}"],
                # registers of a datapath hold no value until they are loaded; outputs are compared
                plusargs=["--ieee-asserts=disable", *recorded],
                parameters=dict(generics or {}),
                build_dir=folder,
                test_dir=folder,
                results_xml=str(results_xml),
                extra_env={
                    # else every module imported, numba's too, is parsed and rewritten anew
                    "COCOTB_REWRITE_ASSERTION_FILES": "",
                    "PYTHONHASHSEED": "0",
                    **(environment or {}),
                },
                log_file=test_log,
            )
        executed, failed = get_results(results_xml)
    except (SystemExit, RuntimeError, subprocess.CalledProcessError) as error:
        check = _failed_check(results_xml, test_log)
        if check is not None:
            raise CheckError(check, _tail(test_log)) from error
        raise BenchError(f"{top} {dict(generics or {})}:\n{_tail(test_log)}") from error
    if failed or executed == 0:
        check = _failed_check(results_xml, test_log)
        if check is not None:
            raise CheckError(check, _tail(test_log))
        raise BenchError(f"{failed} of {executed} cocotb tests failed:\n{_tail(test_log)}")
