"""Vectors through the converted Verilog of cores, with counters in it.

Rows go through `scripts.hdl.netlist_check`, and decisions are compared with the models', so that
what is counted is what was checked.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from directmpc.mpdcc import formats as f
from directmpc.mpdcc.coefficients import INDEX
from directmpc.mptc import drive_twin
from directmpc.mptc import formats as mptc_formats
from scripts.hdl import conversion, coverage, mpdcc_rows, mptc_drive_loop, netlist_check
from scripts.shared.tools import Generics, ToolError
from scripts.studies.torture import blocks

HOLD = (*(f"c_{name}" if place < 33 else name for name, place in INDEX.items()),)
PAPER: Generics = {"EXPLORERS": 2, "FOLDED": True}

Vectors = Callable[[Path, Path], None]


def _compared(
    top: str,
    chosen: Generics,
    netlist: Path,
    folder: Path,
    inputs: dict[str, np.ndarray],
    expected: dict[str, np.ndarray],
    held: tuple[str, ...],
) -> None:
    """Run rows and compare; what is not as the model says would be no vector."""
    found = netlist_check.ports_of(netlist, top)
    result = netlist_check.check(
        top,
        chosen,
        inputs,
        expected,
        ports=netlist_check.Ports(found.inputs, found.outputs, held),
        verilog=netlist,
        folder=folder,
    )
    if result.mismatches:
        raise ToolError(f"{top}: {result.mismatches[0]}")


def _mpdcc(netlist: Path, folder: Path, rows: mpdcc_rows.Rows) -> None:
    names = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "saturated")
    found = rows.model("paper")
    inputs = {name: rows.measurements[:, i] for i, name in enumerate(f.MEASUREMENTS)}
    inputs |= {f"s_prev_{x}": rows.s_prev[:, i] for i, x in enumerate("abc")}
    inputs |= {name: rows.registers[:, i] for i, name in enumerate(HOLD)}
    expected = {name: found[:, i] for i, name in enumerate(names)}
    _compared("mpdcc_core", PAPER, netlist, folder, inputs, expected, HOLD)


def _paper(netlist: Path, folder: Path) -> None:
    rng = np.random.default_rng(2)
    parts = [
        mpdcc_rows.slow_rows("paper"),
        mpdcc_rows.random_rows(150, rng, "paper"),
        mpdcc_rows.recorded_rows(40, rng, "paper"),
    ]
    _mpdcc(netlist, folder, mpdcc_rows.join(parts))


def _joined_drive(netlist: Path, folder: Path) -> None:
    """`mptc_drive`: words of every kind, in stretches with one method, its twin beside it."""
    rng = np.random.default_rng(3)
    names = [name for name in mptc_formats.MEASUREMENTS if not name.startswith("psis")]
    state, rows, found, measured = drive_twin.initial(), [], [], []
    for number in range(24):
        block = blocks.mptc_block(number, 4, 40)
        flux = rng.uniform(0.01, 0.7) * block.drive.control.psi_max
        limit = rng.uniform(0.2, 0.8) * block.drive.control.current_max
        words = drive_twin.parameters(block.drive, limit=limit, flux=flux)
        words = words._replace(excite=int(rng.random() < 0.7))
        for row in np.delete(block.measurements, [2, 3], axis=1):
            restart = int(rng.random() < 0.05)
            u, saturated, clamped, exciting = drive_twin.step_words(words, state, row)
            found.append((u, saturated, clamped, exciting))
            rows.append(mptc_drive_loop.held_inputs(words) | {"restart": restart})
            measured.append(row)
            if restart:
                state[-1] = 0
    inputs = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    inputs |= {name: np.array(measured)[:, i] for i, name in enumerate(names)}
    told = np.array(found)
    expected = {
        name: told[:, i] for i, name in enumerate(("u_next", "saturated", "clamped", "exciting"))
    }
    held = mptc_drive_loop.ports().hold
    _compared("mptc_drive", mptc_drive_loop.GENERICS, netlist, folder, inputs, expected, held)


#: Name -> entity, generics, what drives it.
RUNS: dict[str, tuple[str, Generics, Vectors]] = {
    "mptc_drive": ("mptc_drive", dict(mptc_drive_loop.GENERICS), _joined_drive),
    "mpdcc_core, paper": ("mpdcc_core", PAPER, _paper),
}


def measure(name: str) -> dict[str, coverage.Seen]:
    """Run the vectors of one netlist.

    Parameters
    ----------
    name : str
        A key of ``RUNS``.

    Returns
    -------
    dict[str, coverage.Seen]
        Entity -> what was seen of it.

    Raises
    ------
    ToolError
        If a tool is missing or fails, or a decision is not the model's.
    """
    top, chosen, vectors = RUNS[name]
    text, modules = coverage.instrument(conversion.cached(top, chosen).read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory(prefix="coverage-") as temporary:
        folder = Path(temporary)
        netlist = folder / "instrumented.v"
        netlist.write_text(text, encoding="utf-8")
        vectors(netlist, folder)
        counts = (folder / coverage.FILE).read_text(encoding="utf-8")
    return coverage.collect(counts, modules)
