"""Vectors through the converted Verilog of the cores and of whole boards, with counters in it.

The cores get rows through `scripts.hdl.netlist_check`, and their decisions are compared with the
models', so that what is counted is what was checked. A board (`board_top`: system, gate guard,
links) gets frames over both of its links (`boards`).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from directmpc.host.safe_torque_off import SafeTorqueOff
from directmpc.mpdcc import formats as f
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.coefficients import BUILT, INDEX
from directmpc.mptc import bit_true_sequences, drive_twin
from directmpc.mptc import coefficients as mptc_coefficients
from directmpc.mptc import formats as mptc_formats
from directmpc.mptc.bit_true_sequences import BEST, DEADBEAT, MEAN
from directmpc.mptc.coefficients import COEFFICIENTS
from directmpc.mptc.sequence import TIME_STEPS
from scripts.hdl import conversion, coverage, mpdcc_rows, mptc_drive_loop, netlist_check
from scripts.hdl.mptc_job import FAMILY_METHODS
from scripts.shared.tools import Generics, ToolError
from scripts.studies.coverage import boards
from scripts.studies.torture import blocks

HOLD = (
    *(f"c_{name}" if place < 33 else name for name, place in INDEX.items() if name not in BUILT),
)
FAST: Generics = {
    "EXPLORERS": 2,
    "FOLDED": False,
    "SECOND_LEVEL": True,
    "WEIGHTED_DEADLOCK": True,
    "INWARDS": True,
}
PAPER: Generics = {"EXPLORERS": 2, "FOLDED": True}

#: A sequence of vectors and their times, as ports name it.
SEQUENCE = ("u1", "u2", "u3", "t1", "t2")

Columns = dict[str, np.ndarray]
Vectors = Callable[[Path, Path], None]


def _compared(
    top: str,
    chosen: Generics,
    netlist: Path,
    folder: Path,
    inputs: Columns,
    expected: Columns,
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


def mpdcc_rows_of(rows: int, seed: int = 1) -> mpdcc_rows.Rows:
    """States of every kind of the torture, each by every rule, some with two switchings."""
    rng = np.random.default_rng(seed)
    parts = []
    for number in range(32):
        block = blocks.mpdcc_block(number, seed, rows)
        register = np.repeat(block.register[None], rows, axis=0)
        parts.append(mpdcc_rows.Rows(block.measurements, block.s_prev, register))
    whole = mpdcc_rows.join(parts)
    two = rng.random(len(whole)) < 0.4
    whole.registers[:, INDEX["two_switchings"]] = two
    limits = rng.choice([0, 27, 60, 150, 600, 4095], len(whole))
    whole.registers[:, INDEX["budget"]] = np.where(two, limits, 0)
    whole.registers[:, INDEX["compensate"]] = rng.random(len(whole)) < 0.3
    return whole.pick(rng.permutation(len(whole)))


def _decided(rows: mpdcc_rows.Rows) -> np.ndarray:
    """Decisions of the fast model with the flag of the budget, (n, 8)."""
    order = np.empty((fast.CANDIDATES, 5), dtype=np.int64)
    return np.array(
        [
            fast.search_words(r, m, s, order)[:8]
            for r, m, s in zip(rows.registers, rows.measurements, rows.s_prev, strict=True)
        ]
    )


def _mpdcc(netlist: Path, folder: Path, chosen: Generics, rows: mpdcc_rows.Rows) -> None:
    names = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "saturated")
    if chosen is FAST:
        found, names = _decided(rows), (*names, "exhausted")
    else:
        found = rows.model("paper")
    inputs = {name: rows.measurements[:, i] for i, name in enumerate(f.MEASUREMENTS)}
    inputs |= {f"s_prev_{x}": rows.s_prev[:, i] for i, x in enumerate("abc")}
    inputs |= {name: rows.registers[:, i] for i, name in enumerate(HOLD)}
    expected = {name: found[:, i] for i, name in enumerate(names)}
    _compared("mpdcc_core", chosen, netlist, folder, inputs, expected, HOLD)


def _fast(netlist: Path, folder: Path) -> None:
    _mpdcc(netlist, folder, FAST, mpdcc_rows_of(40))


def _paper(netlist: Path, folder: Path) -> None:
    rng = np.random.default_rng(2)
    parts = [
        mpdcc_rows.slow_rows("paper"),
        mpdcc_rows.random_rows(150, rng, "paper"),
        mpdcc_rows.recorded_rows(40, rng, "paper"),
    ]
    _mpdcc(netlist, folder, PAPER, mpdcc_rows.join(parts))


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


def family_rows(blocks_of_each: int, rows: int, seed: int) -> tuple[Columns, Columns]:
    """Decisions of every method of `mptc_family_core`, in random order."""
    rng = np.random.default_rng(seed)
    seen, answers = [], []
    for code, method in enumerate(("", *FAMILY_METHODS)):
        for number in range(blocks_of_each):
            block = blocks.mptc_block(number, seed, rows)
            rule = number // 2 % 3
            try:
                drive = block.drive if not code else block.drive.with_control(method=method)
                register = mptc_coefficients.registers(drive).array()
            except ValueError:  # a weight that this method's words do not hold
                continue
            first = np.where(
                rng.random(rows) < 0.4,
                rng.choice([0, 1024, TIME_STEPS], rows),
                rng.integers(0, TIME_STEPS + 1, rows),
            )
            # the whole period, one vector after the first, or any time, too long ones too
            turn, rest = rng.random(rows), TIME_STEPS - first
            second = np.where(turn < 0.3, rest, np.where(turn < 0.5, 0, rng.integers(0, rest + 1)))
            second = np.where(turn > 0.95, TIME_STEPS, second)
            running = np.column_stack([block.u, rng.integers(0, 8, (rows, 2)), first, second])
            if code:
                told = [
                    bit_true_sequences.decide_words(
                        register, code - 1, (DEADBEAT, MEAN, BEST)[rule], m, before
                    )
                    for m, before in zip(block.measurements, running, strict=True)
                ]
                answers.append(np.array([(*chosen, *flags) for chosen, *flags in told]))
            else:
                running[:] = np.column_stack([block.u] * 3 + [np.full(rows, TIME_STEPS), 0 * first])
                told = blocks.twin_of_mptc(drive, block.measurements, block.u)
                one = np.repeat(told[:, :1], 3, axis=1)
                times = np.tile([TIME_STEPS, 0], (rows, 1))
                answers.append(np.column_stack([one, times, told[:, 1:]]))
            chosen = np.tile([code, rule], (rows, 1))
            fixed = np.tile(register, (rows, 1))
            seen.append(np.column_stack([block.measurements, block.u, fixed, chosen, running]))
    names = (
        *mptc_formats.MEASUREMENTS, "u", *(f"c_{name}" for name in COEFFICIENTS), "method_mpfc",
        "family_method", "duty_rule", *SEQUENCE,
    )  # fmt: skip
    order = rng.permutation(sum(map(len, seen)))
    table, answer = np.concatenate(seen)[order], np.concatenate(answers)[order]
    outputs = (*(f"next_{name}" for name in SEQUENCE), "saturated", "clamped")
    return (
        {name: table[:, i] for i, name in enumerate(names)},
        {name: answer[:, i] for i, name in enumerate(outputs)},
    )


def _family(netlist: Path, folder: Path) -> None:
    inputs, expected = family_rows(16, 60, 4)
    held = tuple(f"c_{name}" for name in COEFFICIENTS)
    _compared("mptc_family_core", {}, netlist, folder, inputs, expected, held)


CHANNELS: Generics = {"FILTER": 4, "DISCREPANCY": 9}


def _two_channels(netlist: Path, folder: Path) -> None:
    """`safe_torque_off`: levels of every length, together and alone, in every clock."""
    rng = np.random.default_rng(6)
    reached = SafeTorqueOff(CHANNELS["FILTER"], CHANNELS["DISCREPANCY"])
    levels = [np.repeat(rng.integers(0, 4), rng.integers(1, 20)) for _ in range(1000)]
    inputs = {"channels": np.concatenate([[0] * 4, *levels])}
    inputs["clear"] = rng.random(len(inputs["channels"])) < 0.1
    inputs["rst"] = rng.random(len(inputs["channels"])) < 0.002
    inputs["rst"][:4] = True
    told = []
    for channels, clear, rst in zip(*inputs.values(), strict=True):
        told.append((reached.permit, reached.fault))
        reached.clock((channels & 1, channels >> 1), clear=clear, rst=rst)
    expected = {name: np.array(told)[:, i] for i, name in enumerate(("permit", "fault"))}
    ports = netlist_check.ports_of(netlist, "safe_torque_off", ("clk",))
    result = netlist_check.check(
        "safe_torque_off", CHANNELS, inputs, expected, ports=ports, verilog=netlist, folder=folder
    )
    if result.mismatches:
        raise ToolError(f"safe_torque_off: {result.mismatches[0]}")


#: Name -> entity, generics, what drives it.
RUNS: dict[str, tuple[str, Generics, Vectors]] = {
    "mptc_drive": ("mptc_drive", dict(mptc_drive_loop.GENERICS), _joined_drive),
    "mptc_family_core": ("mptc_family_core", {}, _family),
    "mpdcc_core, paper": ("mpdcc_core", PAPER, _paper),
    "mpdcc_core, fast": ("mpdcc_core", FAST, _fast),
    "safe_torque_off": ("safe_torque_off", CHANNELS, _two_channels),
    "board of MPTC": ("board_top", boards.BOARDS["mptc"], boards.mptc),
    "board of MPDCC": ("board_top", boards.BOARDS["mpdcc"], boards.mpdcc),
}


def measure(name: str) -> dict[str, coverage.Seen]:
    """Run the vectors of one netlist."""
    top, chosen, vectors = RUNS[name]
    converted = conversion.cached(top, chosen)
    text, modules = coverage.instrument(converted.read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory(prefix="coverage-") as temporary:
        folder = Path(temporary)
        netlist = folder / "instrumented.v"
        netlist.write_text(text, encoding="utf-8")
        vectors(netlist, folder)
        counts = (folder / coverage.FILE).read_text(encoding="utf-8")
    return coverage.collect(counts, modules, coverage.constants(converted, top))
