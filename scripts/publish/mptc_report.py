"""The two-level part of `make report`: figures, tables and pictures of MPTC and MPFC.

`scripts.publish.report` calls `build` and puts what it returns into ``mptc`` of metrics.json; this
module's own command line regenerates that part alone. The tables in docs/mptc.md and the lines in
docs/figures.md are written from metrics.json, so that what is published is what was measured.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from directmpc import motulator
from directmpc.api.drive_file import load_mptc_drive
from directmpc.host.console import progress_bar
from directmpc.mptc import bit_true, closed_loop, cycles
from directmpc.mptc import drive_twin as joined
from directmpc.mptc.closed_loop import RPM, Run
from directmpc.mptc.coefficients import COEFFICIENTS, registers
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.formats import MEASUREMENTS
from directmpc.mptc.plant import plant_parameters
from directmpc.mptc.trace import IntArray
from scripts.hdl import conversion as netlist
from scripts.hdl import mptc_drive_loop as rtl_loop
from scripts.hdl import mptc_job, netlist_check
from scripts.hdl import mptc_simulation as rtl_simulation
from scripts.hdl.clocks import clocks_of
from scripts.hdl.simulator import in_parallel
from scripts.measure import budgets
from scripts.measure.pnr import PART
from scripts.publish.reporting import ReportError, run_script
from scripts.shared import tables, tools
from scripts.shared.figures import pyplot, save_png
from scripts.shared.tools import ROOT
from scripts.studies import mptc as study

REPORTS = ROOT / "reports"
BUILD = ROOT / "build"
PAGE = ROOT / "docs" / "figures.md"
MANUAL = ROOT / "docs" / "mptc.md"
REPORT = REPORTS / "mptc.md"
#: Tables of the report; the manual has the others.
REPORTED = (
    "origin", "paper", "weights", "distortion", "torque step", "starts", "robustness", "link",
    "tour", "hardware", "agreement",
)  # fmt: skip
DRIVE = ROOT / "drives" / "induction_2kw2.toml"
VERIFIED = ROOT / "drives" / "motulator_2kw2.toml"
COMMAND = "make report"

#: Key in metrics.json, entity, generics; the first is ``mptc`` itself: the enumerator of MPTC.
DESIGNS: tuple[tuple[str, str, tools.Generics], ...] = (
    ("", "mptc_core", {"FLUX_CONTROL": False}),
    ("mpfc", "mptc_core", {}),
    ("observer", "mptc_observer", {}),
    ("speed_observer", "mptc_speed_observer", {}),
    ("sequencer", "vector_sequencer", {}),
    ("preexcitation", "mptc_preexcitation", {}),
    ("drive", "mptc_drive", {}),
    ("family", "mptc_family_core", {}),
)
#: Those that are placed and routed.
PLACED = ("", "mpfc", "observer", "speed_observer", "sequencer", "preexcitation", "family")
CYCLES = {
    "": clocks_of("mptc_core", "mptc"),
    "mpfc": clocks_of("mptc_core", "mpfc"),
    "observer": clocks_of("mptc_observer", "latency"),
    "speed_observer": clocks_of("mptc_speed_observer", "latency"),
    "sequencer": clocks_of("vector_sequencer", "latency"),
    "preexcitation": clocks_of("mptc_preexcitation", "latency"),
    "drive": clocks_of("mptc_drive", "mptc"),
    "family": max(
        clocks_of("mptc_family_core", name.lower() + ending)
        for ending, methods_of in (("", cycles.FAMILY), ("_best", cycles.BEST))
        for name in methods_of
    ),
}
FAMILIES = ("xc3s", "xc6s", "xc7", "ecp5")
SAMPLE = 3000  # rows of each run that go through the netlist in Verilator
SAMPLE_GHDL = 100  # and how many of them through GHDL
TOUR_INERTIA = study.INERTIA
TOUR_LEGS = (6000, 2500, 1500, 9000)  # periods, see `rtl_loop.tour`
TOUR_LOAD = 7.0  # N*m
WORST_LEAD = 0.14  # N*m: no decision may differ from ideal's where the best leads by more
MOST_DIFFERING = 1.0  # %


# --- hardware -------------------------------------------------------------------------------------


def held_resources(figures: dict[str, Any]) -> None:
    """Bring the resources of the two-level entities up to date with the budgets."""
    held = budgets.load().resources
    for key, entity, generics in DESIGNS:
        one = figures[key] if key else figures
        for family, row in held[tools.configuration_name(entity, generics)].items():
            one[family] |= row
            if family == "xc3s":
                area = one[family]
                area["slices_unpacked"], area["slices_packed"] = budgets.slices(row)


def resources(jobs: int) -> dict[str, Any]:
    """Resources of every design."""
    out = BUILD / "synth_report_mptc.json"
    entities = dict.fromkeys(entity for _, entity, _ in DESIGNS)
    run_script("synth", *entities, "--jobs", str(jobs), "--out", str(out))
    document = json.loads(out.read_text(encoding="utf-8"))
    found: dict[str, Any] = {}
    for key, entity, generics in DESIGNS:
        matching = [
            one
            for one in document["configurations"]
            if (one["entity"], one["generics"]) == (entity, generics)
        ]
        if len(matching) != 1:
            raise ReportError(f"{entity} {generics}: not in scripts/measure/configurations.toml")
        figures: dict[str, Any] = {}
        for family, area in matching[0]["families"].items():
            figures[family] = {
                k: v for k, v in area.items() if k not in ("cells", "seconds", "carry_feeds")
            }
        found |= {key: figures} if key else figures
    return _rounded(found)


def clocks() -> dict[str, Any]:
    """Clocks of a decision of every design, of its slowest method where a design is a family."""
    return {
        inner: value
        for key, count in CYCLES.items()
        for inner, value in ({key: {"cycles": count}} if key else {"cycles": count}).items()
    }


# --- the RTL on recorded runs ---------------------------------------------------------------------


def replayed(runs: dict[str, tuple[MptcDrive, Run]]) -> dict[str, Any]:
    """Replay a stretch of every run on ``mptc_core`` and compare with the twin, bit by bit.

    `SAMPLE` rows of each go through the netlist in Verilator, the last `SAMPLE_GHDL` of them
    through the VHDL in GHDL too, which takes a hundred times as long.
    """
    values, measurements, applied, expected, last = [], [], [], [], []
    for drive, run in runs.values():
        # the last rows: the transient of the beginning is over
        rows = run.trace.rows(slice(-SAMPLE, None))
        register = registers(drive).array()
        words, _ = bit_true.encode(drive, rows)
        out = np.empty((len(rows), 3), dtype=np.int64)
        bit_true.run_words(register, words, rows.u, out)
        values.append(np.tile(register, (len(rows), 1)))
        measurements.append(words)
        applied.append(rows.u)
        expected.append(out)
        last.append(np.arange(len(rows)) >= len(rows) - SAMPLE_GHDL)
    every = np.concatenate(values)
    words, u = np.concatenate(measurements), np.concatenate(applied)
    wanted = np.concatenate(expected)
    clocks = np.where(every[:, -1] == 1, cycles.CORE["MPFC"], cycles.CORE["MPTC"])
    generics: tools.Generics = {"FLUX_CONTROL": True}
    found = netlist_check.ports_of(netlist.cached("mptc_core", generics), "mptc_core")
    held = tuple(name for name in found.inputs if name.startswith("c_"))
    inputs = {name: words[:, i].tolist() for i, name in enumerate(MEASUREMENTS)}
    inputs |= {f"c_{name}": every[:, i].tolist() for i, name in enumerate(COEFFICIENTS)}
    checked = netlist_check.check(
        "mptc_core",
        generics,
        inputs | {"u": u.tolist(), "method_mpfc": every[:, -1].tolist()},
        {n: wanted[:, i].tolist() for i, n in enumerate(("u_next", "saturated", "clamped"))},
        clocks.tolist(),
        ports=netlist_check.Ports(found.inputs, found.outputs, held),
        limit=200,
    )
    chosen = np.flatnonzero(np.concatenate(last))

    def _simulate(rows: IntArray, advance: Callable[[int], None]) -> IntArray:
        picked = chosen[rows]
        job = mptc_job.Job(every[picked[0]], words[picked], u[picked], each_registers=every[picked])
        return np.asarray(rtl_simulation.simulate(job, advance)["decisions"], dtype=np.int64)

    with progress_bar("recorded runs in GHDL", len(chosen)) as show:
        answered = in_parallel(len(chosen), _simulate, show)
    told = np.column_stack([wanted[chosen], clocks[chosen]])
    differing = len(checked.mismatches) + int(
        np.any(answered[:, [0, 2, 3, 1]] != told, axis=1).sum()
    )
    if differing:
        raise ReportError(f"{differing} decisions of the RTL differ from the model's")
    return {
        "runs": len(runs),
        "rows": checked.checked,
        "rows_ghdl": len(chosen),
        "differing": differing,
    }


def _toured(method: str) -> tuple[Run, dict[str, Any]]:
    """The joined RTL with motulator: magnetising, start, load step, reversal, one after the other.

    Every decision, flag and flux estimate is compared with the twin's on the way.
    """
    drive = load_mptc_drive(VERIFIED).with_control(method=method)
    scenario, words = rtl_loop.tour(
        drive, study.HIGH_SPEED_FLUX, TOUR_LOAD, TOUR_INERTIA, TOUR_LEGS
    )
    with rtl_loop.controller(drive, words) as rtl:
        run = motulator.simulate(drive, scenario, rtl, inertia=TOUR_INERTIA)
    rpm = run.trace.omega_r / drive.machine.pole_pairs / RPM
    started, loaded, freed = np.cumsum(TOUR_LEGS[:3])
    seen = joined.run_words(words, joined.encode(drive, run.trace))
    estimate = seen[:, 4:6] * drive.control.psi_max / (2**15 - 1)
    error = np.hypot(*(estimate - run.trace.psi_s).T)
    return run, {
        "periods": len(run.u),
        "ms_to_flux": 1e3 * run.ts * int(np.argmax(run.flux > 0.98 * study.HIGH_SPEED_FLUX)),
        "ms_to_1400_rpm": 1e3 * run.ts * int(np.argmax(rpm > 1400.0)),
        "dip_under_load_rpm": 1500.0 - float(rpm[started:loaded].min()),
        "ms_reversal_to_1400_rpm": 1e3 * run.ts * int(np.argmax(rpm[freed:] < -1400.0)),
        "end_rpm": float(rpm[-1]),
        "peak_current_a": float(np.hypot(*run.trace.i_s.T).max()),
        "saturated": int(run.saturated.sum()),
        "estimate_error_wb": float(error.max()),
    }


# --- fidelity -------------------------------------------------------------------------------------


def fidelity(rows: dict[str, dict[str, float]]) -> dict[str, Any]:
    """Figures of metrics.json from `study.fidelity`."""
    found: dict[str, Any] = {}
    for method, prefix in (("MPTC", ""), ("MPFC", "mpfc_")):
        chosen = {k: v for k, v in rows.items() if k.startswith(method)}
        steps = sum(int(v["steps"]) for v in chosen.values())
        differing = sum(v["steps"] * v["mismatch_pct"] for v in chosen.values())
        found |= {
            f"{prefix}points": len(chosen),
            f"{prefix}steps": steps,
            f"{prefix}decision_mismatch_pct": differing / steps,
            f"{prefix}worst_point_mismatch_pct": max(v["mismatch_pct"] for v in chosen.values()),
        }
        unit = "nm" if method == "MPTC" else "wb"
        found[f"{prefix}worst_lead_{unit}"] = max(v["worst_margin"] for v in chosen.values())
    if found["worst_point_mismatch_pct"] > MOST_DIFFERING or found["worst_lead_nm"] > WORST_LEAD:
        raise ReportError(f"fidelity of MPTC is not as promised: {found}")
    return found


# --- pictures -------------------------------------------------------------------------------------


def _axes(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Any, Any]:
    options |= {"layout": "constrained", "squeeze": False}
    return pyplot().subplots(rows, columns, figsize=size, **options)


def _save(figure: Any, path: Path) -> None:
    save_png(figure, path)
    pyplot().close(figure)


_COLOUR = "#1b6ca8"


def _draw_weights(runs: dict[str, Run], path: Path) -> None:
    """Torque, flux and current over 40 ms, a column for each weight (Paper B, Fig. 5)."""
    figure, axes = _axes(3, len(runs), (12.0, 5.4), sharex=True)
    for column, (key, run) in enumerate(runs.items()):
        last = slice(-round(0.04 / run.ts), None)
        t = 1e3 * run.ts * np.arange(round(0.04 / run.ts))
        for row, y in enumerate((run.torque, run.flux, run.trace.i_s[:, 0])):
            axes[row][column].plot(t, y[last], color=_COLOUR, linewidth=0.6)
        title = "MPFC" if key == "MPFC" else f"MPTC, k_psi = {key} N m/Wb"
        axes[0][column].set_title(title, fontsize=8)
        axes[2][column].set_xlabel("time (ms)")
    for row, label in enumerate(("torque (N m)", "stator flux (Wb)", "phase current (A)")):
        axes[row][0].set_ylabel(label)
    figure.suptitle(
        "2.2 kW drive, 20 kHz, 1500 r/min without load, speed PI, bit-true model (Fig. 5)\n"
        "each panel has a scale of its own",
        fontsize=10,
    )
    _save(figure, path)


def _draw_dynamics(steps: dict[str, Run], begins: int, starts: dict[str, Run], path: Path) -> None:
    """Torque steps (Fig. 30) and starts without and with pre-excitation (Fig. 21)."""
    figure, axes = _axes(2, 2, (9.0, 5.0))
    for key, run in steps.items():
        window = slice(begins - 20, begins + 60)
        t = 1e3 * run.ts * np.arange(-20, 60)
        axes[0][0].plot(t, run.torque[window], linewidth=0.9, label=f"{key} r/min")
    axes[0][0].axhline(1.2 * study.RATED_TORQUE, color="0.7", linewidth=0.6, label="reference")
    axes[0][0].set_title("MPTC: torque step 0 to 120 % (Fig. 30)", fontsize=9)
    axes[0][0].set_ylabel("torque (N m)")
    axes[0][0].legend(frameon=False)
    for key, run in starts.items():
        t = 1e3 * run.ts * np.arange(len(run.u))
        label = f"{key} pre-excitation"
        axes[0][1].plot(t, np.hypot(*run.trace.i_s.T), linewidth=0.9, label=label)
        axes[1][0].plot(t, run.trace.omega_r / 2.0 / RPM, linewidth=0.9, label=label)
        axes[1][1].plot(t, run.flux, linewidth=0.9, label=label)
    for axis, what in ((axes[0][1], "current"), (axes[1][0], "speed"), (axes[1][1], "flux")):
        axis.set_title(f"MPFC: {what} of a start from standstill (Fig. 21)", fontsize=9)
    axes[0][1].set_ylabel("current, magnitude (A)")
    axes[0][1].legend(frameon=False)
    axes[1][0].set_ylabel("speed (r/min)")
    axes[1][1].set_ylabel("stator flux (Wb)")
    for ax in axes.ravel():
        ax.set_xlabel("time (ms)")
    figure.suptitle("2.2 kW drive, 20 kHz, bit-true model", fontsize=10)
    _save(figure, path)


def _draw_tour(runs: dict[str, Run], path: Path) -> None:
    """Speed, torque, flux and current of the joined RTL."""
    figure, axes = _axes(4, len(runs), (9.0, 6.5), sharex=True, sharey="row")
    for column, (key, run) in enumerate(runs.items()):
        t = run.ts * np.arange(len(run.u))
        curves = (
            run.trace.omega_r / 2.0 / RPM, run.torque, run.flux, np.hypot(*run.trace.i_s.T),
        )  # fmt: skip
        for row, y in enumerate(curves):
            axes[row][column].plot(t, y, color=_COLOUR, linewidth=0.5)
        axes[0][column].set_title(f"mptc_drive, {key}", fontsize=9)
        axes[3][column].set_xlabel("time (s)")
    labels = ("speed (r/min)", "torque (N m)", "stator flux (Wb)", "current, magnitude (A)")
    for row, label in enumerate(labels):
        axes[row][0].set_ylabel(label)
    figure.suptitle(
        "2.2 kW drive, 20 kHz, RTL simulation, plant by motulator: magnetising, start, load step, "
        "reversal",
        fontsize=10,
    )
    _save(figure, path)


# --- tables ---------------------------------------------------------------------------------------


def _table(rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table; the first row is its head."""
    return tables.markdown(rows[0], rows[1:], "lr")


_DESIGN_NAMES = {
    "": "`mptc_core`, `FLUX_CONTROL => false`: MPTC alone",
    "mpfc": "`mptc_core`: MPTC and MPFC",
    "observer": "`mptc_observer`",
    "preexcitation": "`mptc_preexcitation`",
    "drive": "`mptc_drive`: core, observer and pre-excitation",
    "speed_observer": "`mptc_speed_observer`",
    "sequencer": "`vector_sequencer`",
    "family": "`mptc_family_core`: the methods of two and three vectors too",
}


def _hardware_table(figures: dict[str, Any]) -> str:
    """Resources and clock frequency."""
    rows = [
        ["", "clocks", "LUT", "FF", "mult", "BRAM", "slices unpacked", "(packed)", "ECP5 LUT",
         "ECP5 MHz, worst (median) of seeds"],
    ]  # fmt: skip
    for key, name in _DESIGN_NAMES.items():
        one = figures[key] if key else figures
        area, ecp5 = one["xc3s"], one["ecp5"]
        clock = "not placed by itself"
        if "fmax_worst_mhz" in ecp5:
            clock = (
                f"{ecp5['fmax_worst_mhz']:.1f} ({ecp5['fmax_median_mhz']:.1f}) of {ecp5['seeds']}"
            )
        clocks = str(one["cycles"])
        if key == "mpfc":
            clocks = f"{figures['cycles']}, MPFC {one['cycles']}"
        if key == "family":
            clocks = ", ".join(f"{name} {n}" for name, n in cycles.FAMILY.items())
            clocks += "".join(f"; {name} best {n}" for name, n in cycles.BEST.items())
        if key == "drive":
            clocks = f"{one['cycles']}, MPFC {cycles.DRIVE['MPFC']}"
        rows.append(
            [name, clocks, *(str(area[k]) for k in ("lut", "ff", "mult", "bram")),
             str(area["slices_unpacked"]), str(area["slices_packed"]), str(ecp5["lut"]), clock]
        )  # fmt: skip
    return _table(rows)


def _methods_table(figures: dict[str, Any]) -> str:
    """Every method at low speed."""
    rows = [["150 r/min, no load, 0.986 Wb", "control period, us", "THD of the current, %",
             "vectors that differ from ideal, %", "clocks"]]  # fmt: skip
    for method, ts in study.PERIODS.items():
        one = figures[method.lower()]
        rows.append(
            [method, f"{1e6 * ts:.1f}", f"{one['thd_150_pct']:.2f}",
             f"{one['vectors_mismatch_pct']:.2f}", f"{one.get('cycles', 'not in the RTL')}"]
        )  # fmt: skip
    return _table(rows)


def _methods(drive: MptcDrive) -> dict[str, dict[str, float]]:
    """Figures of every method by its name in metrics.json; clocks where the RTL has it."""
    clocks = cycles.CORE | cycles.FAMILY
    return {
        method.lower(): found | ({"cycles": clocks[method]} if method in clocks else {})
        for method, found in study.methods(drive).items()
    }


def _weights_table(weights: dict[str, dict[str, float]]) -> str:
    keys = list(weights)
    rows = [["1500 r/min, no load, 0.9 Wb", *(k if k == "MPFC" else f"k_psi {k}" for k in keys)]]
    for label, name, scale, digits in (
        ("torque ripple, N m", "torque_ripple_nm", 1.0, 2),
        ("flux ripple, mWb", "flux_ripple_wb", 1e3, 1),
        ("THD of the current, %", "thd_pct", 1.0, 1),
        ("switching frequency, Hz", "switching_hz", 1.0, 0),
        ("vectors that differ from ideal, %", "mismatch_pct", 1.0, 2),
    ):
        rows.append([label, *(f"{scale * weights[k][name]:.{digits}f}" for k in keys)])
    return _table(rows)


def _paper_table(figures: dict[str, Any]) -> str:
    """Ours beside the figures Paper B prints as numbers."""
    paper, low = figures["paper_b"], figures["paper_b"]["low_speed"]
    weights, starts = paper["weights"], paper["starts"]
    steps = paper["torque_step"]
    slow = [steps[k]["rise_longest_ms"] for k in ("0", "150", "500", "900")]
    return _table(
        [
            ["", "here", "Paper B"],
            ["current THD, 150 r/min, no load, k_psi = 100", f"{low['100']['thd_pct']:.2f} %",
             "8.90 % (Fig. 9)"],
            ["the same, MPFC", f"{low['MPFC']['thd_pct']:.2f} %", "lower than MPTC's (Fig. 6)"],
            ["the same, k_psi = 32", f"{low['32']['thd_pct']:.0f} %",
             '"degrades significantly" (Fig. 6)'],
            ["flux ripple at 1500 r/min, k_psi = 14.2, 100, 350",
             ", ".join(f"{1e3 * weights[k]['flux_ripple_wb']:.1f}" for k in ("14.2", "100", "350"))
             + " mWb", "oscillates, good, no better (Fig. 5)"],
            ["torque ripple, the same",
             ", ".join(f"{weights[k]['torque_ripple_nm']:.2f}" for k in ("14.2", "100", "350"))
             + " N m", "small, good, increased (Fig. 5)"],
            ["torque step 0 to 120 %, rise 10 to 90 %, longest of 20, at 0 / 150 / 500 / 900 r/min",
             " / ".join(f"{x:.2f}" for x in slow) + " ms", "< 1 ms, speed not stated (Fig. 30)"],
            ["peak current of a start without / with pre-excitation",
             " / ".join(f"{starts[k]['peak_current_a']:.1f}" for k in ("without", "with")) + " A",
             '"large" / limited (Fig. 21)'],
        ]
    )  # fmt: skip


def _manual_tables(figures: dict[str, Any]) -> dict[str, str]:
    """Every table of docs/mptc.md and reports/mptc.md by its name."""
    paper, tools_ = figures["paper_b"], figures["tools"]
    steps = [["from 0 to 16.8 N m, 0.986 Wb", "0", "150", "500", "900", "1200", "1500 r/min"]]
    for label, name in (
        ("rise 10 to 90 %, mean, ms", "rise_mean_ms"),
        ("rise 10 to 90 %, longest, ms", "rise_longest_ms"),
        ("step to 95 %, longest, ms", "to_95_longest_ms"),
        ("what the voltage allows a modulator, ms", "voltage_bound_ms"),
    ):
        cells = []
        for row in paper["torque_step"].values():
            cells.append(f"{row[name]:.2f}" if name in row else "not reached")
        steps.append([label, *cells])
    robust = [["R_s and R_r of the machine, times the controller's", "1.0", "1.5", "2.0"]]
    for rpm in ("150", "1500"):
        for label, name, scale, digits in (
            ("flux, Wb (asked 0.9)", "flux_mean_wb", 1.0, 3),
            ("torque ripple, N m", "torque_ripple_nm", 1.0, 2),
            ("largest error of the estimate, mWb", "estimate_error_wb", 1e3, 1),
        ):
            cells = [
                f"{scale * paper['robustness'][f'{rpm} r/min, {x}'][name]:.{digits}f}"
                for x in ("1", "1.5", "2")
            ]
            robust.append([f"{rpm} r/min: {label}", *cells])
    starts = [["standstill to 1500 r/min, J = 0.015 kg m^2", "without", "with"]]
    for label, name, digits in (
        ("peak current, A (limit of the pre-excitation: 8)", "peak_current_a", 1),
        ("time to 0.89 Wb, ms", "ms_to_flux", 1),
        ("time to 1400 r/min, ms", "ms_to_1400_rpm", 0),
    ):
        starts.append(
            [label, *(f"{paper['starts'][k][name]:.{digits}f}" for k in ("without", "with"))]
        )
    tour = [["RTL in the loop, motulator's machine, J = 0.015 kg m^2", *figures["tour"]]]
    for label, name, digits in (
        ("periods, all decided as by the model", "periods", 0),
        ("magnetised to 0.88 Wb, ms", "ms_to_flux", 1),
        ("start to 1400 r/min, ms", "ms_to_1400_rpm", 0),
        (f"speed lost under a step of {TOUR_LOAD:g} N m, r/min", "dip_under_load_rpm", 0),
        ("reversal 1500 to -1400 r/min, ms", "ms_reversal_to_1400_rpm", 0),
        ("speed at the end, r/min", "end_rpm", 0),
        ("peak current, A", "peak_current_a", 1),
        ("largest error of the flux estimate, mWb", "estimate_error_wb", 1),
    ):
        scale = 1e3 if name == "estimate_error_wb" else 1.0
        tour.append(
            [label, *(f"{scale * one[name]:.{digits}f}" for one in figures["tour"].values())]
        )
    fit = figures["fidelity"]
    agreement = [
        ["against the ideal controller, 18 operating points", "MPTC", "MPFC"],
        ["decisions", f"{fit['steps']}", f"{fit['mpfc_steps']}"],
        ["that differ, all points", f"{fit['decision_mismatch_pct']:.2f} %",
         f"{fit['mpfc_decision_mismatch_pct']:.2f} %"],
        ["that differ, worst point", f"{fit['worst_point_mismatch_pct']:.2f} %",
         f"{fit['mpfc_worst_point_mismatch_pct']:.2f} %"],
        ["largest lead of ideal's choice among them", f"{fit['worst_lead_nm']:.3f} N m",
         f"{1e3 * fit['mpfc_worst_lead_wb']:.2f} mWb"],
        ["rows of all runs on the RTL; that differ from the model",
         f"{figures['replay']['rows']}, {figures['replay']['differing']}", "(both)"],
    ]  # fmt: skip
    link = [["1500 r/min, 14 N m asked, 540 V", "torque, N m", "flux, Wb", "torque ripple, N m"]]
    for key, row in paper["saturated_link"].items():
        link.append(
            [f"psi_ref {key}", f"{row['torque_mean_nm']:.2f}", f"{row['flux_mean_wb']:.3f}",
             f"{row['torque_ripple_nm']:.2f}"]
        )  # fmt: skip
    distortion = [["150 r/min, no load", "THD, %"]]
    distortion += [[key, f"{value:.2f}"] for key, value in paper["distortion_pct"].items()]
    origin = (
        f"Runs are measured at commit `{figures['commit'][:12]}` by `{COMMAND}`; "
        "[metrics.json](../reports/metrics.json) has the commit of the other parts. Tools: "
        + "; ".join(f"{name} {text}" for name, text in tools_.items())
        + f". xc3s is Yosys' estimate without a mapper; clock frequencies are those of {PART}."
    )
    return {
        "origin": origin,
        "hardware": _hardware_table(figures),
        "methods": _methods_table(figures),
        "agreement": _table(agreement),
        "paper": _paper_table(figures),
        "weights": _weights_table(paper["weights"]),
        "distortion": _table(distortion),
        "torque step": _table(steps),
        "starts": _table(starts),
        "robustness": _table(robust),
        "link": _table(link),
        "tour": _table(tour),
    }


def _page_table(figures: dict[str, Any]) -> str:
    """What docs/figures.md says of the two-level drive."""
    area, clock = figures["xc3s"], figures["ecp5"]["fmax_worst_mhz"]
    both = figures["mpfc"]["xc3s"]
    return _table(
        [
            ["2.2 kW drive, 20 kHz", "MPTC", "with MPFC"],
            ["clock cycles, always", f"{figures['cycles']}", f"{figures['mpfc']['cycles']}"],
            ["ECP5 (-6), worst seed; a decision at that clock",
             f"{clock:.1f} MHz, {figures['cycles'] / clock:.2f} us",
             f"{figures['mpfc']['ecp5']['fmax_worst_mhz']:.1f} MHz, "
             f"{figures['mpfc']['cycles'] / figures['mpfc']['ecp5']['fmax_worst_mhz']:.2f} us"],
            ["Spartan-3 slices, unpacked (estimate); multipliers",
             f"{area['slices_unpacked']}; {area['mult']}",
             f"{both['slices_unpacked']}; {both['mult']}"],
            ["decisions that differ from the ideal controller",
             f"{figures['fidelity']['decision_mismatch_pct']:.2f} % of "
             f"{figures['fidelity']['steps']}",
             f"{figures['fidelity']['mpfc_decision_mismatch_pct']:.2f} % of "
             f"{figures['fidelity']['mpfc_steps']}"],
            ["THD at 150 r/min without load; Paper B: 8.90 %",
             f"{figures['paper_b']['low_speed']['100']['thd_pct']:.2f} %",
             f"{figures['paper_b']['low_speed']['MPFC']['thd_pct']:.2f} %"],
        ]
    )  # fmt: skip


def _markers(name: str) -> tuple[str, str]:
    return f"<!-- {name}: begin (written by make report) -->", f"<!-- {name}: end -->"


def write_texts(
    figures: dict[str, Any], page: Path = PAGE, manual: Path = MANUAL, report: Path = REPORT
) -> None:
    """Rewrite the tables of three pages from metrics.json's ``mptc``."""
    tables.rewrite(page, {_markers("mptc figures"): _page_table(figures)})
    made = _manual_tables(figures)
    for path, reported in ((manual, False), (report, True)):
        tables.rewrite(
            path, {_markers(n): text for n, text in made.items() if (n in REPORTED) == reported}
        )


# --- all of it ------------------------------------------------------------------------------------


def merged(one: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """Both parts of ``mptc`` in metrics.json."""
    found = dict(one)
    for key, value in other.items():
        old = found.get(key)
        both = isinstance(old, dict) and isinstance(value, dict)
        found[key] = merged(old, value) if both else value
    return found


def runs(say: Callable[[str], None], pictures: Path) -> dict[str, Any]:
    """Runs of the figures of Paper B, decisions beside ideal, and replays on the RTL."""
    drive = load_mptc_drive(DRIVE)
    figures: dict[str, Any] = {}
    say("MPTC: runs of Paper B's figures")
    weights, low = study.weight_runs(drive), study.low_speed_runs(drive)
    steps = {
        f"{rpm:g}": study.step_run(drive, rpm, study.RATED_FLUX, 200)
        for rpm in (0.0, 150.0, 500.0, 900.0)
    }
    flux_control = drive.with_control(method="MPFC")
    started = {
        "without": study.start(flux_control, excited=False),
        "with": study.start(flux_control, excited=True),
    }
    figures["paper_b"] = {
        "weights": {key: study.figures(run) for key, run in weights.items()},
        "low_speed": {key: study.figures(run) for key, run in low.items()},
        "distortion_pct": study.distortion(drive),
        "torque_step": study.torque_steps(drive),
        "robustness": study.robustness(drive),
        "starts": study.starts(drive),
        "saturated_link": study.saturated_link(drive),
    }
    say("MPTC: decisions against the ideal controller")
    figures["fidelity"] = fidelity(study.fidelity(drive))

    def _of(key: str) -> MptcDrive:
        return flux_control if key == "MPFC" else drive.with_control(k_psi=float(key))

    recorded = {f"1500 {key}": (_of(key), run) for key, run in weights.items()}
    recorded |= {f"150 {key}": (_of(key), run) for key, run in low.items()}
    recorded |= {f"step {key}": (drive, run) for key, run in steps.items()}
    for rpm in (900.0, -1500.0):
        for key in ("100", "MPFC"):
            loop = closed_loop.constant(
                _of(key), rpm, study.RATED_TORQUE, study.HIGH_SPEED_FLUX, 2 * SAMPLE
            )
            run = closed_loop.simulate(_of(key), loop, plant=plant_parameters(drive))
            recorded[f"{rpm:g} loaded {key}"] = (_of(key), run)
    say("MPTC: these runs on the RTL")
    figures["replay"] = replayed(recorded)
    _draw_weights(weights, pictures / "mptc_weights.png")
    _draw_dynamics(steps, 200, started, pictures / "mptc_dynamics.png")
    return _rounded(figures)


def methods() -> dict[str, Any]:
    """Every method at low speed, on the bit-true model."""
    return _rounded(_methods(load_mptc_drive(DRIVE)))


def tours(pictures: Path) -> dict[str, Any]:
    """The joined RTL in closed loop."""
    toured = {method: _toured(method) for method in ("MPTC", "MPFC")}
    _draw_tour({method: run for method, (run, _) in toured.items()}, pictures / "mptc_tour.png")
    return _rounded({"tour": {method: found for method, (_, found) in toured.items()}})


def _rounded(value: Any) -> Any:
    """Figures with six significant digits: the rest is noise in a file that is compared."""
    if isinstance(value, dict):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, float):
        return float(f"{value:.6g}")
    return value
