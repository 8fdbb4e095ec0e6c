"""Short runs of public entities whose waveforms stand on their pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from directmpc.api.drive_file import load_mptc_drive
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.coefficients import registers as mpdcc_registers
from directmpc.mpdcc.formats import MEASUREMENTS as MPDCC_MEASUREMENTS
from directmpc.mptc import bit_true, closed_loop
from directmpc.mptc.coefficients import registers as mptc_registers
from directmpc.mptc.formats import MEASUREMENTS as MPTC_MEASUREMENTS
from directmpc.mptc.vector_sequencer import rate_of
from scripts.hdl import recording, states
from scripts.hdl.clocks import clocks_of
from scripts.publish import waveforms
from scripts.shared.tools import ROOT

Clocks = list[dict[str, int]]


@dataclass(frozen=True)
class Scene:
    """What is recorded and shown.

    Attributes
    ----------
    title
        What happens.
    clocks
        Inputs that change, of each clock.
    shown
        Ports from top to bottom.
    generics
        Those that are not the default.
    """

    title: str
    clocks: Clocks
    shown: tuple[str, ...]
    generics: Mapping[str, int | bool] = field(default_factory=dict)


def _pulse(name: str, inputs: Mapping[str, int], after: int) -> Clocks:
    """A clock with a pulse and inputs, then clocks without."""
    return [{name: 1, **inputs}, {name: 0}, *({} for _ in range(after - 1))]


def _binary_search() -> Scene:
    whole = clocks_of("binary_search", "latency")
    clocks = [{"rst": 1}, {"rst": 0, "upper": 63}]
    clocks += _pulse("start", {"x": 100, "y": 730, "lower": 0}, whole + 1)
    clocks += _pulse("start", {"x": 3, "y": 60000, "upper": 50}, 3)
    clocks += _pulse("start", {"x": 1000, "y": 2000, "upper": 63, "lower": 40}, 5)
    return Scene(
        "binary_search: 7 steps of 100 fit in 730; all 50 fit; fewer than 40 fit",
        clocks,
        ("start", "x", "y", "lower", "upper", "done", "below", "length"),
    )


def _mac_block() -> Scene:
    words = sum((word & 0xFFFF) << 16 * k for k, word in enumerate((3, -5, 7, 100)))
    first = {"enable": 1, "a_inputs": words, "b_inputs": words, "seed": 1000}
    clocks: Clocks = [
        {}, first, {"a_select": 1, "b_select": 2, "accumulate": 1},
        {"a_select": 3, "b_select": 3, "alignment": 1}, {"enable": 0},
        {"enable": 1, "accumulate": 0, "seed": -8, "a_select": 2, "b_select": 0, "alignment": 0},
        {"enable": 0}, {}, {}, {},
    ]  # fmt: skip
    return Scene(
        "mac_block: words 3, -5, 7 and 100 on both operands; two sums",
        clocks,
        ("enable", "a_select", "b_select", "alignment", "accumulate", "seed", "accumulator"),
    )


def _vector_sequencer() -> Scene:
    period = 300
    sequence = {"u1": 1, "u2": 2, "u3": 0, "t1": 1024, "t2": 2048}
    clocks: Clocks = [{"rst": 1, "rate": rate_of(period)}, {"rst": 0}]
    clocks += _pulse("start", {**sequence, "segmented": 0}, period - 1)
    clocks += _pulse("start", {**sequence, "segmented": 1}, period + 8)
    return Scene(
        "vector_sequencer: u1 for 1/4 and u2 for 1/2 of 300 clocks; the same in seven segments",
        clocks,
        ("start", "segmented", "u1", "u2", "u3", "t1", "t2", "playing", "u", "switches", "early"),
    )


def _gate_guard() -> Scene:
    clocks: Clocks = [
        {"rst": 1, "dead_time": 6, "minimum_on": 8, "minimum_off": 8, "decision_limit": 60,
         "watchdog": 400, "current_limit": 20000, "link_high": 50000, "link_low": 10000,
         "v_dc": 30000, "renew": 1},
        {"rst": 0, "renew": 0}, {"enable": 1}, {},
        {"measured": 1}, {"measured": 0}, {}, {}, {}, {},
    ]  # fmt: skip
    clocks += _pulse("start", {}, 4)
    clocks += _pulse("decided", {"position_a": 1, "position_b": 0, "position_c": 0}, 30)
    clocks += _pulse("start", {}, 4)
    clocks += _pulse("decided", {"position_a": 0, "position_b": 0, "position_c": 1}, 30)
    clocks += [{"external_trip": 1}, {"external_trip": 0}, {}, {}, {}, {}]
    return Scene(
        "gate_guard, two-level: gates come on, two legs change with dead time, a trip",
        clocks,
        ("enable", "measured", "start", "decided", "position_a", "position_b", "position_c",
         "external_trip", "gates", "running", "resting", "faults"),
        {"FIVE_LEVEL": False, "LEAST_DEAD_TIME": 6},
    )  # fmt: skip


def _mptc_core() -> Scene:
    drive = load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml")
    run = closed_loop.simulate(drive, closed_loop.constant(drive, 1500.0, 7.0, 0.95, 40))
    words, _ = bit_true.encode(drive, run.trace)
    given = {name: int(word) for name, word in zip(MPTC_MEASUREMENTS, words[-1], strict=True)}
    ports = mptc_registers(drive).ports()
    ports.pop("flux_control")  # chosen with each decision
    wait = clocks_of("mptc_core", "mptc"), clocks_of("mptc_core", "mpfc")
    row = {**given, "u": int(run.trace.u[-1])}
    clocks: Clocks = [{"rst": 1, **ports}, {"rst": 0}]
    clocks += _pulse("start", row, wait[0])
    clocks += _pulse("start", {"method_mpfc": 1}, wait[1] + 3)
    return Scene(
        "mptc_core: the same state decided by MPTC, then by MPFC",
        clocks,
        ("start", "is_alpha", "is_beta", "psis_alpha", "psis_beta", "omega_r", "torque_ref",
         "psi_ref", "u", "method_mpfc", "busy", "valid", "u_next", "switches", "saturated"),
    )  # fmt: skip


def _mpdcc_core() -> Scene:
    drive = states.shipped(states.SHIPPED[0])
    found = mpdcc_registers(drive, "fast")
    trace = states.recorded(drive, 60, 1.0)
    words, positions = states.trace_words(trace), np.asarray(trace.s_prev, dtype=np.int64)
    decided = [
        fast.decide_words(found.array(), m, s) for m, s in zip(words, positions, strict=True)
    ]
    held = next(k for k, answer in enumerate(decided) if answer[3])
    search = next(k for k, answer in enumerate(decided) if not answer[3] and not answer[4])

    def _row(k: int) -> dict[str, int]:
        given = {name: int(w) for name, w in zip(MPDCC_MEASUREMENTS, words[k], strict=True)}
        return given | {f"s_prev_{x}": int(s) for x, s in zip("abc", positions[k], strict=True)}

    clocks: Clocks = [{"rst": 1, **found.ports()}, {"rst": 0}]
    clocks += _pulse("start", _row(held), clocks_of("mpdcc_core", "hold", "fast") + 1)
    clocks += _pulse("start", _row(search), 84)
    return Scene(
        "mpdcc_core with two fast explorers: a position is held, then one is searched for",
        clocks,
        ("start", "is_alpha", "is_beta", "iref_alpha", "iref_beta", "v_n", "s_prev_a", "s_prev_b",
         "s_prev_c", "busy", "valid", "s_a", "s_b", "s_c", "held", "length", "deadlock"),
    )  # fmt: skip


SCENES: dict[str, Callable[[], Scene]] = {
    "binary_search": _binary_search,
    "mac_block": _mac_block,
    "vector_sequencer": _vector_sequencer,
    "gate_guard": _gate_guard,
    "mptc_core": _mptc_core,
    "mpdcc_core": _mpdcc_core,
}
"""Entities with a waveform, and what happens in it."""


def picture(entity: str, comments: Mapping[str, str]) -> str:
    """Record the scene of an entity and draw it.

    Parameters
    ----------
    entity : str
        One of `SCENES`.
    comments : Mapping[str, str]
        Port -> comment beside its declaration.

    Returns
    -------
    str
        SVG.

    Raises
    ------
    ToolError
        If there is no GHDL, or it fails.
    """
    scene = SCENES[entity]()
    found = recording.record(entity, scene.clocks, scene.generics)
    rows = [waveforms.row(name, comments[name], found.bits[name]) for name in scene.shown]
    return waveforms.svg(scene.title, rows, found.values)
