"""A bench for the field: states, ideal decisions and what every candidate costs; and a scorer.

A set is a folder with a drive file, a trace, the decisions of the ideal controller on it, and the
cost of every candidate. Whoever has another implementation of one of the controllers decides on the
same states and is scored. Nothing here depends on how decisions are made.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.api.drive_file import load_drive, shipped_drives
from directmpc.api.simulation import simulate
from directmpc.csv_table import Column, floats, integers, read_table, write_table
from directmpc.mpdcc import ideal, trace
from directmpc.mpdcc.drive import PAPERS_RULES, Drive
from directmpc.mptc import ideal as mptc_ideal
from directmpc.mptc import ideal_sequences
from directmpc.mptc import trace as mptc_trace
from directmpc.mptc.drive import MptcDrive
from scripts.hdl import states
from scripts.shared import progress, tables, tools
from scripts.shared.command import InputError

FORMAT = 1
STEPS = 2000
SETTLE = 100
MANIFEST = "manifest.json"
PAGE = tools.ROOT / "reports" / "field_bench.md"
MARKS = ("<!-- figures: begin (written by make field-bench) -->", "<!-- figures: end -->")
FILES = ("drive.toml", "trace.csv", "ideal.csv", "costs.csv")

SAME = 1e-9
"""Relative; costs that differ by less are the same."""


@dataclass(frozen=True)
class Setting:
    """What one set is made of."""

    name: str  #: Of the set and its folder.
    drive: str  #: Shipped drive.
    replaced: tuple[str, str] | None  #: Text of its file, and what stands there instead.
    speed: float  #: As of `simulate`: pu for MPDCC, rad/s for the two-level drive.


FURTHER = ("budget", "capacitor_filter")
"""Keys beside `PAPERS_RULES` that no set has."""

SE, SESE = 'switching_horizon = "SE"', 'switching_horizon = "SESE"'
METHODS = ("MPTC", "MPFC", "MPTC1", "MPTC2", "GTV", "MPFC2", "MPFC3", "MPC2", "SVM")

SETTINGS = (
    Setting("mpdcc-6kv-se-full-speed", "anpc5l_6kv", None, 1.0),
    Setting("mpdcc-6kv-se-low-speed", "anpc5l_6kv", None, 0.6),
    Setting("mpdcc-6kv-sese-full-speed", "anpc5l_6kv", (SE, SESE), 1.0),
    Setting("mpdcc-3kv3-se-full-speed", "anpc5l_3kv3", None, 1.0),
    *(
        Setting(
            f"two-level-{method.lower()}",
            "motulator_2kw2",
            None if method == "MPTC" else ('method = "MPTC"', f'method = "{method}"'),
            188.5,
        )
        for method in METHODS
    ),
)


class BenchError(InputError):
    """A bench or an entry cannot be read; the message names file and what is allowed."""


# --- making it ------------------------------------------------------------------------------------


def _drive_text(setting: Setting) -> str:
    """The drive file of a set: a shipped one with the studies' bounds and the papers' rules."""
    lines = states.studied_text(shipped_drives()[setting.drive]).splitlines(keepends=True)
    text = "".join(line for line in lines if line.split(" ", 1)[0] not in (*PAPERS_RULES, *FURTHER))
    if setting.replaced is not None:
        old, new = setting.replaced
        if text.count(old) != 1:
            raise BenchError(f"{setting.drive}: has '{old}' {text.count(old)} times; once")
        text = text.replace(old, new)
    return text


def _shown(value: float) -> str:
    return "" if np.isinf(value) else repr(float(value))


def _mpdcc_costs(drive: Drive, rows: trace.MpdccTrace) -> Iterable[list[str]]:
    """Candidates of every row, as fields."""
    parameters = ideal.ideal_parameters(drive)
    if drive.control.delay_compensation:
        rows = ideal.one_step_on(parameters, rows)
    for k in range(len(rows)):
        held, positions, lengths, costs = ideal.candidates(
            parameters, rows.x_m[k], rows.x_inv[k], rows.vdc[k], rows.iref[k],
            rows.omega_s[k], rows.omega_r[k], rows.s_prev[k],
        )  # fmt: skip
        for s, length, cost in zip(positions, lengths, costs, strict=True):
            yield [str(k), str(held), *map(str, s), str(length), *(_shown(c) for c in cost)]


def _mptc_costs(drive: MptcDrive, rows: mptc_trace.MptcTrace) -> Iterable[list[str]]:
    """Vectors of every row, as fields."""
    parameters = mptc_ideal.ideal_parameters(drive)
    current, flux = mptc_ideal.as_complex(rows.i_s), mptc_ideal.as_complex(rows.psi_s)
    for k in range(len(rows)):
        costs, _ = mptc_ideal.costs(
            parameters, current[k], flux[k], rows.omega_r[k], rows.u[k], drive.inverter.vdc,
            rows.torque_ref[k], rows.psi_ref[k],
        )  # fmt: skip
        for u in range(8):
            yield [str(k), str(u), repr(float(costs[u % 7]))]


MPDCC_COSTS = ("row", "held", "s_a", "s_b", "s_c", "length", "cost", "cost_two", "excess")
MPTC_COSTS = ("row", "u", "cost")


def _make(setting: Setting, folder: Path, steps: int) -> dict[str, Any]:
    """Write the files of a set, and say what they are."""
    folder.mkdir()
    drive_file, trace_file, ideal_file, costs_file = (folder / name for name in FILES)
    tools.write(drive_file, _drive_text(setting))
    drive = load_drive(drive_file)
    result = simulate(drive, "ideal", steps=steps, settle=SETTLE, speed=setting.speed)
    result.write_trace(trace_file)
    entry: dict[str, Any] = {"rows": steps}
    # what was written counts, with its digits
    if isinstance(drive, Drive):
        rows = trace.read_trace(trace_file, drive)
        trace.write_decisions(ideal_file, ideal.run(drive, rows))
        write_table(costs_file, MPDCC_COSTS, _mpdcc_costs(drive, rows))
        entry |= {"controller": "mpdcc", "method": "SESE" if setting.replaced else "SE"}
    else:
        several = drive.control.sequences
        rows = mptc_trace.read_trace(trace_file, sequences=several)
        run = ideal_sequences.run if several else mptc_ideal.run
        mptc_trace.write_decisions(ideal_file, run(drive, rows))
        if not several:
            write_table(costs_file, MPTC_COSTS, _mptc_costs(drive, rows))
        entry |= {"controller": "mptc", "method": drive.control.method}
    entry["sha256"] = {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.iterdir())
    }
    return entry


def build(out: Path, steps: int = STEPS) -> dict[str, Any]:
    """Make the bench."""
    if steps < 1:
        raise BenchError(f"--steps: got {steps}; it must be at least 1")
    if out.exists() and not (out / MANIFEST).is_file():
        raise BenchError(f"{out}: exists and is no bench of this command; give another folder")
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}.") as name:
        folder = Path(name) / "bench"
        folder.mkdir()
        manifest: dict[str, Any] = {"format": FORMAT, "sets": {}}
        with progress.counter("sets", len(SETTINGS)) as advance:
            for setting in SETTINGS:
                manifest["sets"][setting.name] = _make(setting, folder / setting.name, steps)
                advance()
        tools.write(folder / MANIFEST, json.dumps(manifest, indent=2) + "\n")
        if out.exists():
            shutil.rmtree(out)
        folder.rename(out)
    return manifest


# --- scoring --------------------------------------------------------------------------------------


def read_manifest(bench: Path) -> dict[str, Any]:
    """The manifest of a bench whose files are as they were written."""
    path = bench / MANIFEST
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
        sets, form = dict(manifest["sets"]), manifest["format"]
    except OSError as error:
        raise BenchError(f"{path}: cannot be read ({error.strerror}); make field-bench") from None
    except (ValueError, KeyError, TypeError):
        raise BenchError(f"{path}: is no manifest of a bench; make field-bench") from None
    if form != FORMAT:
        raise BenchError(f"{path}: format is {form}; this scorer knows {FORMAT}")
    for name, entry in sets.items():
        for file, digest in entry["sha256"].items():
            found = bench / name / file
            if not found.is_file():
                raise BenchError(f"{found}: is missing; make field-bench")
            if hashlib.sha256(found.read_bytes()).hexdigest() != digest:
                raise BenchError(f"{found}: is not the file that the manifest names")
    return manifest


def _table(path: Path, whole: Sequence[str], numbers: Sequence[str]) -> dict[str, Any]:
    """Columns of integers, and of numbers that are infinite where their fields are empty."""
    columns = [
        *(Column(name, low=0, high=2**31) for name in whole),
        *(Column(name, may_be_empty=True) for name in numbers),
    ]
    table = read_table(path, columns)
    empty = {name: [field or "inf" for field in table[name]] for name in numbers}
    return {name: integers(table, name) for name in whole} | {
        name: floats(empty, [name])[:, 0] for name in numbers
    }


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else 0.0


def _summary(
    rows: int, unlike: int, ties: int, lost: Sequence[float], more: dict[str, int]
) -> dict[str, Any]:
    return {
        "rows": rows,
        "unlike": unlike,
        "unlike_pct": 100.0 * unlike / rows,
        "ties": ties,
        "lost_mean_pct": 100.0 * _mean(lost),
        "lost_max_pct": 100.0 * max(lost, default=0.0),
        **more,
    }


def _score_mpdcc(folder: Path, path: Path) -> dict[str, Any]:
    """Score decisions of MPDCC."""
    entry, own = trace.read_decisions(path), trace.read_decisions(folder / "ideal.csv")
    _same_rows(path, len(entry), len(own))
    table = _table(folder / "costs.csv", MPDCC_COSTS[:6], MPDCC_COSTS[6:])
    starts = np.searchsorted(table["row"], np.arange(len(own) + 1))
    unlike = ties = 0
    more = dict.fromkeys(("moved", "leaves", "impossible", "length"), 0)
    lost: list[float] = []
    for k in range(len(own)):
        if (entry.s[k] == own.s[k]).all():
            more["length"] += int(not own.held[k] and entry.length[k] != own.length[k])
            continue
        unlike += 1
        part = slice(starts[k], starts[k + 1])
        at = np.flatnonzero(
            (table["s_a"][part] == entry.s[k, 0])
            & (table["s_b"][part] == entry.s[k, 1])
            & (table["s_c"][part] == entry.s[k, 2])
        )
        if not len(at):
            more["impossible"] += 1
        elif own.held[k]:
            more["moved"] += 1
        else:
            columns = [table[name][part] for name in ("cost_two", "cost", "excess")]
            cost = next(column for column in columns if np.isfinite(column).any())
            best, chosen = float(cost.min()), float(cost[at[0]])
            if np.isinf(chosen):
                more["leaves"] += 1
            elif chosen - best <= SAME * abs(best):
                ties += 1
            else:
                lost.append((chosen - best) / abs(best))
    found = _summary(len(own), unlike, ties, lost, more)
    return found | _told(entry.saturated, entry.cycles)


def _score_mptc(folder: Path, path: Path) -> dict[str, Any]:
    """Score decisions of MPTC and MPFC."""
    entry, own = mptc_trace.read_decisions(path), mptc_trace.read_decisions(folder / "ideal.csv")
    _same_rows(path, len(entry), len(own))
    costs = _table(folder / "costs.csv", MPTC_COSTS[:2], MPTC_COSTS[2:])["cost"].reshape(-1, 8)
    unlike = ties = 0
    lost: list[float] = []
    for k in np.flatnonzero(entry.u != own.u):
        unlike += 1
        best, chosen = costs[k, own.u[k]], costs[k, entry.u[k]]
        if chosen - best <= SAME * abs(best):
            ties += 1
        else:
            lost.append(float((chosen - best) / best))
    return _summary(len(own), unlike, ties, lost, {}) | _told(entry.saturated, entry.cycles)


def _score_sequences(folder: Path, path: Path) -> dict[str, Any]:
    """Score decisions of two and three vectors: which, and for how long."""
    entry = mptc_trace.read_decisions(path, sequences=True)
    own = mptc_trace.read_decisions(folder / "ideal.csv", sequences=True)
    _same_rows(path, len(entry), len(own))
    unlike = (entry.vectors != own.vectors).any(axis=1)
    apart = 4096.0 * np.abs(entry.times - own.times).max(axis=1)[~unlike]
    return {
        "rows": len(own),
        "unlike": int(unlike.sum()),
        "unlike_pct": 100.0 * float(unlike.mean()),
        "time_mean_lsb": _mean(apart),
        "time_max_lsb": float(apart.max(initial=0.0)),
    } | _told(entry.saturated, entry.cycles)


def _same_rows(path: Path, rows: int, wanted: int) -> None:
    if rows != wanted:
        raise BenchError(f"{path}: has {rows} rows; the trace of the set has {wanted}")


def _told(saturated: Any, cycles: Any) -> dict[str, Any]:
    """What the entry says of itself."""
    return {
        "saturated": int(saturated.sum()),
        "cycles_worst": None if cycles is None else int(cycles.max()),
    }


def score(bench: Path, name: str, path: Path) -> dict[str, Any]:
    """Score the decisions of an implementation on the states of a set."""
    sets = read_manifest(bench)["sets"]
    if name not in sets:
        raise BenchError(f"{bench}: has no set '{name}'; there are: {', '.join(sets)}")
    entry = sets[name]
    if entry["controller"] == "mpdcc":
        return _score_mpdcc(bench / name, path)
    if "costs.csv" in entry["sha256"]:
        return _score_mptc(bench / name, path)
    return _score_sequences(bench / name, path)


# --- what is shown --------------------------------------------------------------------------------


def shown(found: dict[str, Any]) -> str:
    """A score as text, a line for each figure."""
    return "\n".join(
        f"{key:15} {value:.4g}" if isinstance(value, float) else f"{key:15} {value}"
        for key, value in found.items()
        if value is not None
    )


def page_tables(entries: Sequence[tuple[str, str, dict[str, Any]]]) -> str:
    """The figures of the page."""

    def _row(keys: Sequence[str], found: dict[str, Any]) -> list[str]:
        return [
            f"{found[key]:.3g}" if isinstance(found[key], float) else str(found[key])
            for key in keys
        ]

    costs = ("rows", "unlike", "unlike_pct", "ties", "lost_mean_pct", "lost_max_pct", "saturated")
    times = ("rows", "unlike", "unlike_pct", "time_mean_lsb", "time_max_lsb", "saturated")
    texts = []
    for keys, mark in ((costs, "lost_max_pct"), (times, "time_max_lsb")):
        rows = [[f"`{s}`", who, *_row(keys, found)] for s, who, found in entries if mark in found]
        texts.append(
            tables.markdown(["set", "implementation", *(f"`{key}`" for key in keys)], rows)
        )
    return "\n\n".join(text.rstrip("\n") for text in texts)
