"""Builds gate_guard_checked for Verilator and runs it for as many clocks as asked."""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

from scripts.hdl import conversion as netlist
from scripts.hdl.sources import RTL, compile_order, rtl_files
from scripts.shared import tools

HERE = Path(__file__).resolve().parent
LEAST_DEAD_TIME = 2


class ViolationError(AssertionError):
    """A safety property does not hold; the message names property and clock."""


def verilog(tabled_leg: bool, folder: Path, rtl: Path = RTL) -> Path:
    """Convert guard and properties."""
    files = [*compile_order("gate_guard", rtl_files(rtl)), HERE / "gate_guard_checked.vhd"]
    generics: tools.Generics = {"TABLED_LEG": tabled_leg, "LEAST_DEAD_TIME": LEAST_DEAD_TIME}
    path, _ = netlist.convert(
        "gate_guard_checked", generics, folder / "core.v", files=files, check=False
    )
    return path


def runtime() -> list[Path]:
    """Verilator's runtime as objects, compiled once: it takes longer than the guard."""
    root = Path(tools.run([*tools.tool("verilator"), "--getenv", "VERILATOR_ROOT"]).stdout.strip())
    folder = tools.BUILD / "verilated" / f"runtime-{tools.digest(tools.version('verilator'))[:16]}"
    objects = []
    for name in ("verilated", "verilated_threads"):
        target = folder / f"{name}.o"
        objects.append(target)
        if not target.exists():
            source = root / "include" / f"{name}.cpp"
            with tools.replacing(target) as temporary:
                tools.run([*_compiler(root), "-c", str(source), "-o", str(temporary)])
    return objects


def _compiler(root: Path) -> list[str]:
    include = root / "include"
    chosen = os.environ.get("CXX", "g++").split()
    return [*chosen, "-O1", "-std=c++17", "-pthread", f"-I{include}", f"-I{include / 'vltstd'}"]


def run(tabled_leg: bool, clocks: int, seed: int = 1, rtl: Path = RTL) -> dict[str, int]:
    """Counts of what happened; raises where a property does not hold."""
    with tempfile.TemporaryDirectory(prefix="directmpc-safety-") as name:
        folder = Path(name)
        verilog(tabled_leg, folder, rtl)
        tools.run(
            [
                *tools.tool("verilator"),
                *("--cc", "-O3", "--prefix", "Vcore", "--Mdir", "obj"),
                *("--x-assign", "unique", "--x-initial", "unique", "--no-timing"),
                *("--top-module", "gate_guard_checked", "-Wno-fatal", "-Wno-lint", "-Wno-style"),
                "core.v",
            ],
            cwd=folder,
        )
        root = Path(
            tools.run([*tools.tool("verilator"), "--getenv", "VERILATOR_ROOT"]).stdout.strip()
        )
        sources = [HERE / "safety.cpp", *sorted((folder / "obj").glob("*.cpp")), *runtime()]
        program = folder / "core"
        tools.run(
            [*_compiler(root), f"-I{folder / 'obj'}", *map(str, sources), "-o", str(program)],
            timeout=900,
        )
        command = [str(program), str(clocks), str(seed), str(int(tabled_leg))]
        command += [f"+verilator+seed+{seed}", "+verilator+rand+reset+2"]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=900)
    if done.returncode:
        raise ViolationError(done.stdout + done.stderr)
    return {k: int(v) for k, v in (pair.split("=") for pair in done.stdout.split())}
