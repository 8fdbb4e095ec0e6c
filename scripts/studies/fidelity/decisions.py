"""How many decisions differ from the ideal controller's on the same states, verified on the RTL.

The loop is closed once by the ideal controller and once by the bit-true one; at every state of both
loops both decide, and the RTL decides every one of these steps again: its converted netlist in
Verilator, of which a sample runs in GHDL as well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.loads.load import discretise
from directmpc.mpdcc import closed_loop, formats, ideal
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.coefficients import OPTIONS, inwards, second_level, weighted_deadlock
from directmpc.mpdcc.program import COEFFICIENTS
from directmpc.mpdcc.trace import Decisions, MpdccTrace
from directmpc.mpdcc.variants import VARIANTS
from scripts.hdl import conversion as netlist
from scripts.hdl import netlist_check
from scripts.hdl.mpdcc_simulation import simulate_rows
from scripts.shared.cache import kept
from scripts.shared.tools import ToolError
from scripts.studies.fidelity.points import Point, Row, points, stored

IntArray = NDArray[np.int64]

DRIVERS = ("ideal", "model")
STEPS = 10_000  # per point and driver
VERIFIED = 1_000  # of them, the first, are decided by the RTL too
SETTLE = 2_000
SAMPLE = 100  # steps of each point that GHDL decides as well
EXPLORERS = 2

TIE = 1e-3
"""A near tie: the two cheapest candidates differ by at most this share of the least cost."""

LSB = 1.0 / formats.CURRENT.scale
"""A near tie too: an output within one LSB of a current (pu) of its bound where that decides."""

DEADLOCKED = 0.2
"""Points with a larger share of deadlocks are averaged apart."""

FIELDS = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "saturated")
_PARAMETERS = (*(f"c_{name}" for name in COEFFICIENTS), *OPTIONS)


class FidelityError(ToolError):
    """The RTL and its model differ; nothing can be published."""


@njit
def edges(p, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """Distance of the output nearest to its bound at k, and at k + 1 if the position is kept."""
    a11, a12, _, _, b1, _ = discretise(p.load, omega_r, p.ts)
    current = complex(x_m[0], x_m[1])
    i_a, i_b, i_c = ideal.phases(current)
    voltage, r_n, r_a, r_b, r_c = ideal.inputs(
        p, vdc, x_inv[0], x_inv[1], x_inv[2], x_inv[3], i_a, i_b, i_c,
        s_prev[0], s_prev[1], s_prev[2],
    )  # fmt: skip
    following = a11 * current + a12 * complex(x_m[2], x_m[3]) + b1 * voltage
    reference = complex(iref[0], iref[1])
    slopes = (r_n, r_a, r_b, r_c)
    found = np.full(2, np.inf)
    for later in range(2):
        if later:
            error = reference * np.exp(1j * omega_s * p.ts) - following
        else:
            error = reference - current
        phases = ideal.phases(error)
        for x in range(3):
            found[later] = min(found[later], abs(abs(phases[x]) - p.bounds[x]))
        for x in range(4):
            middle = 0.0 if x == 0 else 0.25 * vdc
            value = abs(x_inv[x] - middle + later * slopes[x])
            found[later] = min(found[later], abs(value - p.bounds[3 + x]))
    return found[0], found[1]


def near_ties(reference: ideal.IdealParameters, seen: MpdccTrace, rows: IntArray) -> dict[str, int]:
    """Sort the given rows, all of them different decisions, by how close the decision was."""
    counts = {"tie_cost": 0, "tie_bound": 0, "clear": 0}
    for k in rows:
        arguments = (
            reference, seen.x_m[k], seen.x_inv[k], seen.vdc[k], seen.iref[k], seen.omega_s[k],
            seen.omega_r[k], seen.s_prev[k],
        )  # fmt: skip
        held, deadlock, best, second = ideal.margins(*arguments)
        if not held and second - best <= (LSB if deadlock else TIE * abs(best)):
            counts["tie_cost"] += 1
        elif min(edges(*arguments)) <= LSB:
            counts["tie_bound"] += 1
        else:
            counts["clear"] += 1
    return counts


def netlist_of(
    variant: str, second: bool = False, weighted: bool = False, inward: bool = False
) -> tuple[str, dict[str, int | bool], dict[str, object]]:
    """Entity, generics and options of the compiled netlist; it is compiled if need be."""
    generics: dict[str, int | bool] = {"EXPLORERS": EXPLORERS, "FOLDED": variant == "paper"}
    if second:
        generics["SECOND_LEVEL"] = True
    if weighted:
        generics["WEIGHTED_DEADLOCK"] = True
    if inward:
        generics["INWARDS"] = True
    verilog = netlist.cached("mpdcc_core", generics)
    found = netlist_check.ports_of(verilog, "mpdcc_core")
    ports = netlist_check.Ports(found.inputs, found.outputs, _PARAMETERS)
    netlist_check.build("mpdcc_core", generics, ports, verilog=verilog)
    return "mpdcc_core", generics, {"ports": ports, "verilog": verilog}


def decide_netlist(
    variant: str, measurements: IntArray, s_prev: IntArray, registers: IntArray
) -> IntArray:
    """Decisions of the netlist in Verilator."""
    top, generics, options = netlist_of(
        variant, second_level(registers), weighted_deadlock(registers), inwards(registers)
    )
    n = len(measurements)
    inputs = {
        **{name: measurements[:, i] for i, name in enumerate(formats.MEASUREMENTS)},
        **{f"s_prev_{x}": s_prev[:, i] for i, x in enumerate("abc")},
        **{name: np.full(n, registers[i]) for i, name in enumerate(_PARAMETERS)},
    }
    result = netlist_check.simulate(top, generics, inputs, gap=1, **options)
    return np.column_stack([*(result.outputs[name] for name in FIELDS), result.cycles])


def verify(variant: str, seen: MpdccTrace, model: Decisions, registers: IntArray) -> int:
    """Let the RTL's netlist decide on every row."""
    measurements, clipped = common.encode(seen)
    answered = decide_netlist(variant, measurements, seen.s_prev, registers)
    answered[:, 6] |= clipped
    expected = np.column_stack([model.s, model.held, model.deadlock, model.length, model.saturated])
    wrong = np.flatnonzero(np.any(answered[:, :7] != expected, axis=1))
    if len(wrong):
        raise FidelityError(f"{len(wrong)} of {len(seen)} decisions of the RTL differ ({variant})")
    return len(seen)


def sample_ghdl(drive: str, bound: float, variant: str) -> Row:
    """Let GHDL decide ``SAMPLE`` steps of every point of a drive and bound; kept."""

    def _compute() -> Row:
        chosen = [p for p in points() if (p.drive, p.bound) == (drive, bound)]
        registers = VARIANTS[variant].registers(chosen[0].load()).array()
        measurements, s_prev = [], []
        for point in chosen:
            seen, _, _ = loop(point, variant, "model", 50 * SAMPLE)
            seen = seen.rows(np.linspace(0, len(seen) - 1, SAMPLE).astype(int))
            measurements.append(common.encode(seen)[0])
            s_prev.append(seen.s_prev)
        words, before = np.concatenate(measurements), np.concatenate(s_prev)
        answered = decide_netlist(variant, words, before, registers)
        ghdl = simulate_rows(words, before, registers, EXPLORERS, variant, processes=1)
        if np.any(ghdl[:, [0, 1, 2, 3, 4, 5, 7, 6]] != answered):
            raise FidelityError(f"GHDL and the netlist differ ({variant})")
        return {"variant": variant, "steps": len(words)}

    return kept(stored(f"ghdl-{variant}-{drive}-{bound}", "decisions", rtl=True), _compute)


def loop(
    point: Point, variant: str, driver: str, steps: int, seed: int = 0
) -> tuple[MpdccTrace, Decisions, Decisions]:
    """Close the loop once: what was seen, and what model and ideal controller decided there."""
    drive = point.load()
    chosen = VARIANTS[variant]
    if driver == "ideal":
        decide, parameters = ideal.decide, ideal.ideal_parameters(drive)
    else:
        decide, parameters = chosen.decide, chosen.registers(drive).array()
    run = closed_loop.simulate(
        drive, decide, parameters, OperatingPoint(point.omega_s), steps, settle=SETTLE, seed=seed
    )
    seen = run.trace()
    if driver == "ideal":
        return seen, chosen.run(drive, seen), run.decisions
    return seen, run.decisions, ideal.run(drive, seen)


def _rows(decided: Decisions, rows: IntArray) -> Decisions:
    """Some of the decisions."""
    parts = (decided.s, decided.held, decided.deadlock, decided.length)
    s, held, deadlock, length = (part[rows] for part in parts)
    return Decisions(s, held, deadlock, length, None, decided.saturated[rows])


def compare(point: Point, variant: str, driver: str, steps: int, *, rtl: bool = True) -> Row:
    """Compare the decisions of model, ideal controller and RTL on the states of one loop."""
    drive = point.load()
    seen, model, exact = loop(point, variant, driver, steps, DRIVERS.index(driver))
    verified = 0
    if rtl:
        registers = VARIANTS[variant].registers(drive).array()
        rows = np.arange(min(VERIFIED, len(seen)))
        verified = verify(variant, seen.rows(rows), _rows(model, rows), registers)
    differs = np.any(model.s != exact.s, axis=1)
    searched = (model.held == 0) | (exact.held == 0)
    return point.row() | {
        "variant": variant,
        "driver": driver,
        "steps": len(seen),
        "searches": int(searched.sum()),
        "deadlocks": int(max(model.deadlock.sum(), exact.deadlock.sum())),
        "differing": int(differs.sum()),
        **near_ties(ideal.ideal_parameters(drive), seen, np.flatnonzero(differs)),
        "saturated": int(model.saturated.sum()),
        "steps_rtl": verified,
        "differing_rtl": int(differs[:verified].sum()),
    }


def measure(point: Point, variant: str, driver: str, steps: int = STEPS) -> Row:
    """As `compare`, verified on the RTL and kept."""
    name = f"decisions-{variant}-{driver}-{point.drive}-{point.bound}-{point.omega_s}-{steps}"
    return kept(stored(name, "decisions", rtl=True), lambda: compare(point, variant, driver, steps))


def summarise(rows: list[Row]) -> dict[str, float]:
    """Figures of one variant: averages over the points of both drivers.

    Points where more than ``DEADLOCKED`` of the steps are deadlocks are kept apart.
    """
    usual = [r for r in rows if r["deadlocks"] <= DEADLOCKED * r["steps"]]
    rest = [r for r in rows if r["deadlocks"] > DEADLOCKED * r["steps"]]

    def _share(chosen: list[Row], part: str = "differing", whole: str = "steps") -> float:
        total = sum(r[whole] for r in chosen)
        return round(100 * sum(r[part] for r in chosen) / total, 4) if total else 0.0

    by_point: dict[tuple[str, float, float], list[Row]] = {}
    for r in usual:
        by_point.setdefault((r["drive"], r["bound_current_pu"], r["omega_s_pu"]), []).append(r)
    result: dict[str, float] = {
        "steps": sum(r["steps"] for r in usual),
        "steps_rtl": sum(r["steps_rtl"] for r in usual),
        "decision_mismatch_rtl_pct": _share(usual, "differing_rtl", "steps_rtl"),
        "decision_mismatch_pct": _share(usual),
        "search_mismatch_pct": _share(usual, whole="searches"),
        "worst_point_pct": max(_share(r) for r in by_point.values()),
        "worst_run_pct": max(_share([r]) for r in usual),
        "near_tie_cost_pct": _share(usual, "tie_cost"),
        "near_tie_bound_pct": _share(usual, "tie_bound"),
        "clear_mismatch_pct": _share(usual, "clear"),
        "deadlocked_runs": len(rest),
        "deadlocked_mismatch_pct": _share(rest),
        "all_runs_mismatch_pct": _share(rows),
    }
    for driver in DRIVERS:
        chosen = [r for r in usual if r["driver"] == driver]
        result[f"decision_mismatch_driven_by_{driver}_pct"] = _share(chosen)
    return result
