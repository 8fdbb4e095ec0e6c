"""Short runs of public entities whose waveforms stand on their pages."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from directmpc.api.drive_file import load_drive, load_mptc_drive
from directmpc.host import registers as host_registers
from directmpc.host.protocol import Frame, Type
from directmpc.mpdcc import capacitor_observer, leakage, observer
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.coefficients import CURRENT_SLOPES, INDEX, ROOM
from directmpc.mpdcc.coefficients import registers as mpdcc_registers
from directmpc.mpdcc.formats import MEASUREMENTS as MPDCC_MEASUREMENTS
from directmpc.mptc import (
    bit_true,
    bit_true_sequences,
    closed_loop,
    drive_twin,
    speed_observer,
)
from directmpc.mptc.coefficients import registers as mptc_registers
from directmpc.mptc.formats import MEASUREMENTS as MPTC_MEASUREMENTS
from directmpc.mptc.vector_sequencer import rate_of
from scripts.generate import register_files
from scripts.hdl import mptc_drive_loop, recording, sources, states
from scripts.hdl.clocks import clocks_of
from scripts.publish import waveforms
from scripts.shared.tools import ROOT
from scripts.studies.sensorless import sensorless_drive

Clocks = list[dict[str, int]]


@dataclass(frozen=True)
class Scene:
    """What is recorded and shown."""

    title: str  #: What happens.
    clocks: Clocks  #: Inputs that change, of each clock.
    shown: tuple[str, ...]  #: Ports from top to bottom.
    #: Those that are not the default.
    generics: Mapping[str, int | bool] = field(default_factory=dict)
    #: Clocks that are shown; what comes before prepares it. All behind `first` where `last` is 0.
    first: int = 0
    last: int = 0
    #: Entity that is run, with the one that is shown inside; empty: that one itself.
    around: str = ""
    #: Labels that lead to the instance inside whose signals are shown.
    within: tuple[str, ...] = ()
    inside: str = ""  #: Entity of that instance, whose file has the signals' comments.


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
         "v_dc": 30000, "v_ph_high": 65534, "v_ph_low": 0, "v_n_limit": 32766, "v_n": 0,
         "v_ph_a": 0, "v_ph_b": 0, "v_ph_c": 0, "omega_r": 0, "speed_limit": 32766,
         "frozen_limit": 0, "renew": 1},
        {"rst": 0, "renew": 0}, {"enable": 1}, {},
        {"measured": 1}, {"measured": 0}, {}, {}, {}, {},
    ]  # fmt: skip
    # the positions come a clock before they are decided
    clocks += [*_pulse("start", {}, 3), {"position_a": 1, "position_b": 0, "position_c": 0}]
    clocks += _pulse("decided", {}, 30)
    clocks += [*_pulse("start", {}, 3), {"position_a": 0, "position_b": 0, "position_c": 1}]
    clocks += _pulse("decided", {}, 30)
    clocks += [{"external_trip": 1}, {"external_trip": 0}, {}, {}, {}, {}]
    return Scene(
        "gate_guard, two-level: gates come on, two legs change with dead time, a trip",
        clocks,
        ("enable", "measured", "start", "decided", "position_a", "position_b", "position_c",
         "external_trip", "gates", "running", "resting", "faults"),
        {"TABLED_LEG": False, "LEAST_DEAD_TIME": 6},
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


def _mpdcc_run(searches: int = 1) -> tuple[Clocks, int]:
    """A held decision and searches of `mpdcc_core` with two explorers, and where these begin."""
    drive = states.shipped(states.SHIPPED[0])
    found = mpdcc_registers(drive, "fast")
    trace = states.recorded(drive, 60, 1.0)
    words, positions = states.trace_words(trace), np.asarray(trace.s_prev, dtype=np.int64)
    decided = [
        fast.decide_words(found.array(), m, s) for m, s in zip(words, positions, strict=True)
    ]
    held = next(k for k, answer in enumerate(decided) if answer[3])
    search = next(k for k, answer in enumerate(decided) if not answer[3] and not answer[4])
    worst = clocks_of("mpdcc_core", "hold", "fast") + 1

    def _row(k: int) -> dict[str, int]:
        given = {name: int(w) for name, w in zip(MPDCC_MEASUREMENTS, words[k], strict=True)}
        return given | {f"s_prev_{x}": int(s) for x, s in zip("abc", positions[k], strict=True)}

    clocks: Clocks = [{"rst": 1, **found.ports()}, {"rst": 0}]
    clocks += _pulse("start", _row(held), worst)
    begins = len(clocks)
    for _ in range(searches):
        clocks += _pulse("start", _row(search), 84)
    return clocks, begins


def _mpdcc_core() -> Scene:
    return Scene(
        "mpdcc_core with two fast explorers: a position is held, then one is searched for",
        _mpdcc_run()[0],
        ("start", "is_alpha", "is_beta", "iref_alpha", "iref_beta", "v_n", "s_prev_a", "s_prev_b",
         "s_prev_c", "busy", "valid", "s_a", "s_b", "s_c", "held", "length", "deadlock"),
    )  # fmt: skip


def _mpdcc_scheduler() -> Scene:
    clocks, begins = _mpdcc_run()
    return Scene(
        "mpdcc_scheduler with two fast explorers, in mpdcc_core: a search; its own signals",
        clocks,
        ("start", "busy", "begins", "probing", "probe", "lines_ready", "enumerate",
         "candidate_valid", "candidate_ready", "enumerated", "result_valid", "result_ready",
         "explorer_busy", "searched", "valid"),
        first=begins, around="mpdcc_core", within=("i_core", "i_scheduler"),
        inside="mpdcc_scheduler",
    )  # fmt: skip


def _mpdcc_explorer() -> Scene:
    clocks, begins = _mpdcc_run()
    return Scene(
        "mpdcc_explorer, the first of two fast ones in mpdcc_core: a probe, then its candidates",
        clocks,
        ("candidate_valid", "candidate_ready", "probe_done", "probe_held", "last", "result_valid",
         "result_ready", "busy"),
        first=begins, around="mpdcc_core",
        within=("i_core", "g_explorers(0)", "i_explorer", "g_fast", "i_explorer"),
        inside="explorer_fast",
    )  # fmt: skip


# --- two-level methods and observers --------------------------------------------------------------


def _mptc_family_core() -> Scene:
    drive = load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml")
    drive = drive.with_control(method="MPTC1")
    run = closed_loop.simulate(drive, closed_loop.constant(drive, 900.0, 7.0, 0.9, 40), inside=True)
    words, _ = bit_true.encode(drive, run.trace)
    given = {name: int(word) for name, word in zip(MPTC_MEASUREMENTS, words[-1], strict=True)}
    applied = bit_true_sequences.applied_words(run.trace)[-1]
    given |= dict(zip(("u1", "u2", "u3", "t1", "t2"), map(int, applied), strict=True))
    ports = mptc_registers(drive).ports()
    ports.pop("flux_control")  # chosen with each decision
    clocks: Clocks = [{"rst": 1, **ports}, {"rst": 0}]
    for number, name in ((1, "mptc1"), (6, "mpc2")):
        row = {**given, "u": given["u1"], "family_method": number}
        clocks += _pulse("start", row, clocks_of("mptc_family_core", name) + 2)
    return Scene(
        "mptc_family_core: the same state decided by MPTC1, then by MPC2",
        clocks,
        ("start", "is_alpha", "psis_alpha", "omega_r", "torque_ref", "psi_ref", "family_method",
         "u1", "u2", "t1", "busy", "valid", "next_u1", "next_u2", "next_u3", "next_t1", "next_t2",
         "saturated"),
    )  # fmt: skip


def _mptc_drive() -> Scene:
    drive = load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml")
    run = closed_loop.simulate(drive, closed_loop.constant(drive, 900.0, 7.0, 0.9, 3))
    words, _ = bit_true.encode(drive, run.trace)
    held = mptc_drive_loop.held_inputs(drive_twin.parameters(drive, limit=8.0, flux=0.9))
    clocks: Clocks = [{"rst": 1, **held}, {"rst": 0}]
    for row in words:
        given = dict(zip(MPTC_MEASUREMENTS, map(int, row), strict=True))
        given = {name: given[name] for name in mptc_drive_loop.MEASURED}
        clocks += _pulse("start", given, clocks_of("mptc_drive", "mptc") + 2)
    return Scene(
        "mptc_drive after a reset: three periods, the flux is built up first",
        clocks,
        ("start", "is_alpha", "is_beta", "omega_r", "torque_ref", "psi_ref", "excite", "busy",
         "valid", "u_next", "switches", "exciting", "psis_alpha", "psis_beta", "saturated"),
    )  # fmt: skip


def _mpdcc_rows(count: int) -> tuple[list[dict[str, int]], list[dict[str, int]]]:
    """Measurements and positions of a loop of the 6 kV drive, row by row."""
    trace = states.recorded(states.shipped(states.SHIPPED[0]), count, 1.0)
    words = states.trace_words(trace)
    measured = [dict(zip(MPDCC_MEASUREMENTS, map(int, row), strict=True)) for row in words]
    return measured, [
        {f"s_{x}": int(s) for x, s in zip("abc", row, strict=True)} for row in trace.s_prev
    ]


def _state_observer() -> Scene:
    drive = states.shipped(states.SHIPPED[0]).with_control(capacitor_filter=4)
    stored = {f"f_{name}": value for name, value in capacitor_observer.coefficients(drive).items()}
    held = {name: stored.pop(name) for name in ("f_q_midpoint", "f_q_phase")}
    stored |= {f"o_{name}": value for name, value in observer.coefficients(drive)[0].items()}
    stored |= {f"l_{name}": word for name, word in leakage.coefficients(drive)[0].items()}
    slopes = mpdcc_registers(drive, "fast", ROOM).array()[[INDEX[name] for name in CURRENT_SLOPES]]
    stored |= {f"c_{name}": int(word) for name, word in zip(CURRENT_SLOPES, slopes, strict=True)}
    held |= {f"with_{part}": 1 for part in ("filters", "flux", "leakage")}
    places = register_files.places("mpdcc")
    clocks: Clocks = [{"rst": 1, **held}, {"rst": 0}]
    clocks += [
        {"c_write": 1, "c_place": places[name], "c_word": word & 0x3FFFF}
        for name, word in stored.items()
    ]
    clocks.append({"c_write": 0})
    names = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c", "v_dc", "omega_r",
             "psir_alpha", "psir_beta")  # fmt: skip
    errors = (0, 300, -300)  # of the measurement of v_n, LSB: the filter lets 1/16 through
    later = clocks_of("state_observer", "filtered") - clocks_of("state_observer", "flux")
    for row, applied, error in zip(*_mpdcc_rows(3), errors, strict=True):
        given = {name: row[name] for name in names} | applied
        given["v_n"] += error
        clocks += _pulse("start", given, clocks_of("state_observer", "leakage") + later + 2)
    clocks += _pulse("start", {"scale": 1}, clocks_of("state_observer", "scaling") + 2)
    return Scene(
        "state_observer after a reset: three steps of the 6 kV drive, then theta into the slopes",
        clocks,
        ("start", "scale", "is_alpha", "is_beta", "v_n", "v_dc", "omega_r", "s_a", "s_b", "s_c",
         "busy", "filters_valid", "used_n", "used_a", "valid", "flux_alpha", "flux_beta",
         "leakage_valid", "theta", "saturated", "clipped"),
    )  # fmt: skip


def _mptc_speed_observer() -> Scene:
    drive = sensorless_drive(load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml"))
    run = closed_loop.simulate(drive, closed_loop.constant(drive, 900.0, 7.0, 0.9, 3), inside=True)
    words, _ = bit_true.encode(drive, run.trace)
    applied = bit_true_sequences.applied_words(run.trace)
    held = {f"c_{name}": value for name, value in speed_observer.coefficients(drive).items()}
    clocks: Clocks = [{"rst": 1, **held}, {"rst": 0}]
    for row, sequence in zip(words, applied, strict=True):
        measured = dict(zip(MPTC_MEASUREMENTS, map(int, row), strict=True))
        given = {name: measured[name] for name in ("is_alpha", "is_beta", "v_dc")}
        given |= dict(zip(("u1", "u2", "u3", "t1", "t2"), map(int, sequence), strict=True))
        clocks += _pulse("start", given, clocks_of("mptc_speed_observer", "latency") + 3)
    return Scene(
        "mptc_speed_observer after a reset: three steps; the speed comes before the flux",
        clocks,
        ("start", "is_alpha", "is_beta", "v_dc", "u1", "u2", "u3", "t1", "t2", "busy",
         "speed_valid", "omega_r", "valid", "psis_alpha", "psis_beta", "saturated"),
    )  # fmt: skip


# --- systems, links and boards --------------------------------------------------------------------

WRITE = 6
"""Clocks that an access of a scene is given on AXI4-Lite; one behind a commit waits three."""


def _write(address: int, word: int) -> Clocks:
    """A register write: address and data are there until both are taken, then a pause."""
    asked = {"s_axil_awvalid": 1, "s_axil_awaddr": address, "s_axil_wvalid": 1,
             "s_axil_wdata": word, "s_axil_wstrb": 15, "s_axil_bready": 1}  # fmt: skip
    return [asked, {"s_axil_awvalid": 0, "s_axil_wvalid": 0}, *({} for _ in range(WRITE - 2))]


_AXI = (
    "s_axil_awvalid", "s_axil_awready", "s_axil_awaddr", "s_axil_wvalid", "s_axil_wready",
    "s_axil_wdata", "s_axil_bvalid",
)  # fmt: skip

GUARDED = {"dead_time": 0.4e-6, "minimum_on": 0.6e-6, "minimum_off": 0.6e-6}
"""Short times, so that a commutation fits into the picture."""


def _loaded(name: str) -> tuple[Clocks, dict[str, Any]]:
    """Reset and every register of a drive file, in force; then the register map of its system."""
    drive = load_drive(ROOT / "drives" / f"{name}.toml")
    if hasattr(drive.control, "bound_vn"):
        drive = drive.with_control(**states.STUDIED)
    found = host_registers.values(drive.changed(guard=GUARDED))
    clocks: Clocks = [{"rst": 1, "enable": 1}, {"rst": 0}, {}, {}]
    # MPDCC copies its parameters behind a reset and behind a commit, then scales some of them
    waits: Clocks = []
    if found.controller == "mpdcc":
        waits = [{}] * (
            clocks_of("parameter_memory", "waits") + clocks_of("state_observer", "scaling") + 4
        )
    clocks += waits
    for _, address, word in found.writes():
        clocks += _write(address, word)
    return clocks + waits, host_registers.registers_of(found.controller)


def _mpdcc_system() -> Scene:
    clocks, known = _loaded("anpc5l_6kv")
    drive = states.shipped(states.SHIPPED[0])
    trace = states.recorded(drive, 60, 1.0)
    words = states.trace_words(trace)
    register = mpdcc_registers(drive, "fast").array()
    before = np.asarray(trace.s_prev, dtype=np.int64)
    answers = [fast.decide_words(register, m, s) for m, s in zip(words, before, strict=True)]
    row = next(k for k, answer in enumerate(answers) if not answer[3] and not answer[4])
    given = dict(zip(MPDCC_MEASUREMENTS, map(int, words[row]), strict=True))
    given |= {f"s_prev_{x}": int(s) for x, s in zip("abc", before[row], strict=True)}
    address, fields = known["system.control"]
    first = len(clocks) - 2
    clocks += _write(address, host_registers.packed("system.control", fields, {"enable": 1}))
    for _ in range(2):
        clocks += _pulse("start", given, 170)
    return Scene(
        "mpdcc_system: control.enable is written, then two decisions on the same measurements",
        clocks,
        (*_AXI, "start", "is_alpha", "iref_alpha", "v_n", "busy", "valid", "s_a", "s_b", "s_c",
         "cycles", "gates", "running", "faults"),
        first=first,
    )  # fmt: skip


def _mptc_system() -> Scene:
    clocks, known = _loaded("induction_2kw2")
    drive = load_mptc_drive(ROOT / "drives" / "induction_2kw2.toml")
    run = closed_loop.simulate(drive, closed_loop.constant(drive, 900.0, 7.0, 0.9, 3))
    words, _ = bit_true.encode(drive, run.trace)
    address, fields = known["system.control"]
    first = len(clocks) - 2
    clocks += _write(address, host_registers.packed("system.control", fields, {"enable": 1}))
    for row, u in zip(words, run.trace.u, strict=True):
        given = dict(zip(MPTC_MEASUREMENTS, map(int, row), strict=True)) | {"u": int(u)}
        clocks += _pulse("start", given, 80)
    return Scene(
        "mptc_system: control.enable is written; decisions act with the start after them",
        clocks,
        (*_AXI, "start", "is_alpha", "psis_alpha", "torque_ref", "u", "busy", "valid", "u_next",
         "switches", "cycles", "gates", "running", "faults"),
        first=first,
    )  # fmt: skip


BIT = 4
"""Clocks of a bit on the scenes' UARTs, the fewest that there can be."""


def _sent(data: bytes) -> Clocks:
    """Bytes on a UART line: start bit, eight bits from the lowest on, stop bit."""
    levels = [bit for byte in data for bit in (0, *(byte >> n & 1 for n in range(8)), 1)]
    return [
        step for level in levels for step in ({"uart_rx": level}, *({} for _ in range(BIT - 1)))
    ]


_FAST_UART = {"CLOCK_HZ": 4_000_000, "BAUD": 1_000_000}


def _host_link() -> Scene:
    address, fields = host_registers.registers_of("mpdcc")["system.control"]
    word = host_registers.packed("system.control", fields, {"enable": 1})
    payload = address.to_bytes(2, "little") + word.to_bytes(4, "little")
    clocks: Clocks = [{"rst": 1, "uart_rx": 1, "spi_cs_n": 1}, {}, {"rst": 0}, {}]
    clocks += _sent(Frame(Type.WRITE, 0x100, payload).wire())
    first = len(clocks) - 12 * BIT
    taken: Clocks = [{"awready": 1, "wready": 1}, *({} for _ in range(30))]
    clocks += [*taken, {"bvalid": 1}, *({} for _ in range(60))]
    return Scene(
        "host_link, UART: end of a frame WRITE, the write on AXI4-Lite, the reply begins",
        clocks,
        ("uart_rx", "awvalid", "awready", "awaddr", "wvalid", "wready", "wdata", "bready",
         "bvalid", "bresp", "uart_tx"),
        _FAST_UART, first,
    )  # fmt: skip


def _board_top() -> Scene:
    clocks: Clocks = [{"uart_rx": 1, "spi_cs_n": 1, "permit": 1}, *({} for _ in range(40))]
    clocks += _sent(Frame(Type.IDENTIFY, 0x100).wire())
    first = len(clocks) - 12 * BIT
    clocks += [{} for _ in range(150)]
    return Scene(
        "board_top, MPTC: end of a frame IDENTIFY, the reply begins",
        clocks,
        ("uart_rx", "uart_tx", "steps_over_spi", "permit", "gates", "leds"),
        {"CONTROLLER": 2, **_FAST_UART, "LEAST_DEAD_TIME": 2000}, first,
    )  # fmt: skip


SCENES: dict[str, Callable[[], Scene]] = {
    "binary_search": _binary_search,
    "mac_block": _mac_block,
    "vector_sequencer": _vector_sequencer,
    "gate_guard": _gate_guard,
    "mptc_core": _mptc_core,
    "mpdcc_core": _mpdcc_core,
    "mpdcc_scheduler": _mpdcc_scheduler,
    "mpdcc_explorer": _mpdcc_explorer,
    "mptc_family_core": _mptc_family_core,
    "mptc_drive": _mptc_drive,
    "state_observer": _state_observer,
    "mptc_speed_observer": _mptc_speed_observer,
    "host_link": _host_link,
    "mpdcc_system": _mpdcc_system,
    "mptc_system": _mptc_system,
    "board_top": _board_top,
}
"""Public entities, and what happens in their waveforms."""


def comments_of(entity: str) -> dict[str, str]:
    """Comments beside the declarations of an entity's file."""
    text = sources.entities()[entity].read_text(encoding="utf-8")
    declared = re.findall(r"^ +(?:signal +)?(\w+) *:[^:=][^;]*?;?[ ]*(?:-- *(.*))?$", text, re.M)
    return {name: comment.strip() for name, comment in declared}


def record(entity: str) -> tuple[Scene, recording.Recorded]:
    """Run the scene of an entity."""
    scene = SCENES[entity]()
    found = recording.record(
        scene.around or entity, scene.clocks, scene.generics, within=scene.within
    )
    return scene, found


def picture(entity: str, comments: Mapping[str, str]) -> str:
    """Record the scene of an entity and draw it."""
    scene, found = record(entity)
    said = comments_of(scene.inside) if scene.inside else comments
    rows = [waveforms.row(name, said[name], found.bits[name]) for name in scene.shown]
    shown = slice(scene.first, scene.last or None)
    return waveforms.svg(
        scene.title, rows, {name: values[shown] for name, values in found.values.items()}
    )
