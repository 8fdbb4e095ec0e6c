"""FMUs of the shipped drives: the RTL and the exact plant in FMPy, in FMI 2.0 and 3.0.

Sweep: a drive of each controller, both versions, inputs per unit, in SI and in phases.
Stimulus: closed loops of both FMUs; steps of other sizes than the control period; two instances in
turn; states taken back, from bytes too; a reset in the middle of a decision; wrong values.
Checks: FMPy's validation; every decision is the bit-true model's; every edge of every gate is that
of the guard's twin at its clock; plant states are those of the library's plant; memory stands.
Does not prove: that the Verilog is the VHDL (tb/tools/test_netlist.py does).
"""

from __future__ import annotations

import itertools
import math
import os
import random
import resource
import shutil
import subprocess
import time
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from directmpc import (
    Drive,
    ModelController,
    MpdccDecision,
    MpdccState,
    MptcDecision,
    MptcDrive,
    MptcState,
    load_drive,
    simulate,
    straight_line,
)
from directmpc.__main__ import main
from directmpc.api.kinds import kind_of
from directmpc.fmu import variables, write_controller, write_plant
from directmpc.host.measurements import Encoder
from directmpc.host.registers import packed, registers_of, values
from directmpc.mpdcc import closed_loop
from directmpc.mpdcc.plant import Plant
from directmpc.mptc.drive import SEQUENCE_METHODS
from directmpc.mptc.formats import measurement_formats
from directmpc.mptc.plant import advance, plant_parameters
from directmpc.native import Design, library
from scripts.hdl import agreement, native
from scripts.shared.tools import ROOT

MULTILEVEL = ("anpc5l_6kv", "anpc5l_6kv_kbest", "npc3l_3kv3", "ttype3l_grid", "two_level_pmsm")
DRIVES = ("anpc5l_6kv", "induction_2kw2")
EVERY = (*DRIVES, pytest.param("anpc5l_6kv_kbest", marks=pytest.mark.thorough))
VERSIONS = ("2.0", "3.0")
STEPS = 150


class Importer:
    """One instance in FMPy, its variables by name, for either version of FMI."""

    def __init__(self, path: Path, *, early: bool = False, **start: float) -> None:
        self.description = fmpy.read_model_description(str(path))
        self.folder = path.with_suffix(".unzipped")
        if not self.folder.is_dir():
            fmpy.extract(str(path), str(self.folder))
        self.said: list[str] = []
        self.named = {v.name: v for v in self.description.modelVariables}
        self.modern = self.description.fmiVersion.startswith("3")
        kind = fmpy.fmi3.FMU3Slave if self.modern else fmpy.fmi2.FMU2Slave
        self.one: Any = kind(
            guid=self.description.guid, unzipDirectory=str(self.folder), instanceName="one",
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )  # fmt: skip
        if self.modern:
            self.one.instantiate(
                earlyReturnAllowed=early,
                logMessage=lambda *said: self.said.append(said[-1].decode()),
            )
        else:
            self.calls = fmpy.fmi2.fmi2CallbackFunctions()
            self.calls.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(
                lambda *said: self.said.append(said[-1].decode())
            )
            self.one.instantiate(callbacks=self.calls)
        self.time = 0.0
        self.begin(**start)

    def begin(self, **start: float) -> None:
        """Initialise with values that are set before."""
        if not self.modern:
            self.one.setupExperiment(startTime=0.0)
        self.put(**start)
        self.one.enterInitializationMode()
        self.one.exitInitializationMode()
        self.time = 0.0

    def put(self, **given: float) -> None:
        """Set variables; two low lines stand for the dot in a name."""
        for name, value in given.items():
            one = self.named[name.replace("__", ".")]
            cast = float if one.type in ("Real", "Float64") else int
            getattr(self.one, f"set{one.type}")([one.valueReference], [cast(value)])

    def get(self, *names: str) -> list[float]:
        """Values by name."""
        found = []
        for name in names:
            one = self.named[name]
            found += list(getattr(self.one, f"get{one.type}")([one.valueReference]))
        return found

    def outputs(self) -> list[float]:
        """Every output."""
        return self.get(*(n for n, v in self.named.items() if v.causality == "output"))

    def step(self, size: float) -> float:
        """One communication step; the time that it came to."""
        reached = self.one.doStep(self.time, size)
        self.time = reached[3] if self.modern else self.time + size
        return self.time


@pytest.fixture(scope="session")
def fmu(tmp_path_factory) -> Callable[..., Path]:
    """Writes an FMU once: of the controller, or of the plant."""
    folder, made = tmp_path_factory.mktemp("fmu"), {}

    def write(name: str, version: str = "3.0", *, plant: bool = False, **options) -> Path:
        key = (name, version, plant, *options.items())
        if key not in made:
            kind = f"{'plant' if plant else 'controller'}_{len(made)}_{name}.fmu"
            drive = load_drive(name)
            if not plant:
                native.write([variables.system_of(drive)])
            made[key] = (write_plant if plant else write_controller)(
                drive, folder / kind, version=version, windows=False, **options
            )
        return made[key]

    return write


def inputs_of(name: str) -> Iterator[dict[str, float]]:
    """Inputs of a controller that make it decide this and that."""
    drive = load_drive(name)
    for k in range(10**9):
        turn = np.exp(1j * 0.02 * k)
        if hasattr(drive, "converter"):
            yield {
                "is_alpha": 0.9 * turn.real + 0.06 * math.sin(k), "is_beta": 0.9 * turn.imag,
                "psir_alpha": 0.8 * turn.imag, "psir_beta": -0.8 * turn.real, "v_n": 0.02,
                "v_ph_a": 0.5, "v_ph_b": 0.52, "v_ph_c": 0.48, "v_dc": 2.0, "omega_s": 0.9,
                "iref_alpha": 0.9 * turn.real, "iref_beta": 0.9 * turn.imag, "omega_r": 0.88,
            }  # fmt: skip
        else:
            yield {
                "is_alpha": 4 * turn.real, "is_beta": 4 * turn.imag + math.sin(k),
                "psis_alpha": 0.9 * turn.imag, "psis_beta": -0.9 * turn.real, "omega_r": 150.0,
                "v_dc": 540.0, "torque_ref": 5 * math.cos(0.3 * k),
                "psi_ref": 0.9 + 0.08 * math.sin(1.7 * k),
            }  # fmt: skip


#: Keys of a drive that an FMU can take, by the name that `Importer` wants, and other values.
CHANGED: dict[str, dict[str, tuple[str, float]]] = {
    "anpc5l_6kv": {
        "control__bound_current": ("control.bound_current", 0.16),
        "control__bound_vn": ("control.bound_vn", 0.05),
        "control__lambda_n": ("control.lambda_n", 0.2),
        "inverter__xph": ("inverter.xph", 1.1),
    },
    "anpc5l_6kv_kbest": {
        "control__lambda_u": ("control.lambda_u", 0.004),
        "control__bound_vn": ("control.bound_vn", 0.03),
        "inverter__xph": ("inverter.xph", 1.1),
    },
    "induction_2kw2": {
        "control__k_psi": ("control.k_psi", 31.0),
        "machine__rs": ("machine.rs", 5.1),
        "machine__lm": ("machine.lm", 0.214),
    },
}


def period_of(name: str) -> float:
    """Control period, s."""
    return load_drive(name).control.ts


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("plant", [True, False], ids=["plant", "controller"])
def test_it_is_valid_and_complete(fmu, name: str, version: str, plant: bool) -> None:
    path = fmu(name, version, plant=plant)
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
    place = "x86_64-linux" if version == "3.0" else "linux64"
    assert f"binaries/{place}/{path.stem}.so" in names
    icon = "terminalsAndIcons/icon.png" if version == "3.0" else "model.png"
    assert {"documentation/index.html", "documentation/licenses/license.txt", icon} < names
    assert "sources/fmu.cpp" in names
    found = fmpy.read_model_description(str(path))
    assert found.coSimulation.canSerializeFMUstate
    for one in found.modelVariables:
        assert one.description, one.name
        if one.causality == "parameter":
            assert plant or None not in (one.min, one.max), one.name
    settable = {one.name for one in found.modelVariables if one.causality == "parameter"}
    assert plant or settable >= {"guard.dead_time", *(s for s, _ in CHANGED[name].values())}


@pytest.mark.parametrize("version", VERSIONS)
def test_a_loop_of_mptc_is_the_models(fmu, version: str) -> None:
    """Both FMUs around each other; the model decides on what the controller saw."""
    name = "induction_2kw2"
    drive, ts = load_drive(name), period_of(name)
    core = Importer(fmu(name, version))
    plant = Importer(fmu(name, version, plant=True), start__psis_alpha=0.95)
    model, u, seen = ModelController(drive), 0, []
    for k in range(STEPS):
        states = plant.get("is_alpha", "is_beta", "psis_alpha", "psis_beta")
        torque = 6.0 if k > 60 else 2.0
        current, flux = complex(*states[:2]), complex(*states[2:])
        given = dict(zip(("is_alpha", "is_beta", "psis_alpha", "psis_beta"), states, strict=True))
        core.put(**given, omega_r=100.0, torque_ref=torque, psi_ref=0.95, v_dc=540.0)
        core.step(ts)
        wanted = model.decide(MptcState(current, flux, 100.0, torque, 0.95, u))
        found = core.get("u_next", "saturated", "cycles")
        assert found == [wanted.apply, wanted.saturated, 39], k
        plant.put(u=u, omega_r=100.0, v_dc=540.0)
        plant.step(ts)
        u = wanted.apply
        seen.append(u)
    assert len(set(seen)) >= 5
    assert core.get("faults", "running") == [0, True]
    assert abs(plant.get("torque")[0] - 6.0) < 3.0


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", MULTILEVEL)
def test_a_loop_of_many_levels_is_the_models(fmu, name: str, version: str, tmp_path: Path) -> None:
    drive = load_drive(name).with_control(capacitor_filter=0)
    native.write([variables.system_of(drive)])
    path = write_controller(
        drive, tmp_path / "core.fmu", version=version, clock=50e6, windows=False
    )
    ts = drive.control.ts
    core, plant = Importer(path), Importer(fmu(name, version, plant=True))
    flags = [n for n in ("held", "deadlock", "length", "saturated") if n in core.named]
    model, s, omega = ModelController(drive), (0, 0, 0), 0.6
    names = [v for v in plant.named if v.startswith(("is_al", "is_be", "psir", "v_n", "v_ph"))]
    for k in range(STEPS):
        x = dict(zip(names, plant.get(*names), strict=True))
        ref = 0.8 * np.exp(1j * 0.62 * drive.ts_pu * k)
        core.put(**x, v_dc=2.0, omega_s=0.62, omega_r=omega)
        core.put(iref_alpha=ref.real, iref_beta=ref.imag)
        core.step(ts)
        state = MpdccState(
            current=complex(x["is_alpha"], x["is_beta"]),
            flux=complex(x["psir_alpha"], x["psir_beta"]), v_n=x["v_n"],
            v_ph=(x["v_ph_a"], x["v_ph_b"], x["v_ph_c"]), current_ref=complex(ref),
            omega_s=0.62, omega_r=omega, applied=s, vdc=2.0,
        )  # fmt: skip
        wanted = model.decide(state)
        told = [getattr(wanted, flag) for flag in flags]
        assert core.get("s_a", "s_b", "s_c", *flags) == [*wanted.apply, *told], k
        s = wanted.apply
        plant.put(s_a=s[0], s_b=s[1], s_c=s[2], omega_r=omega, v_dc=2.0)
        plant.step(ts)
    assert core.get("faults", "running") == [0, True]


@pytest.mark.parametrize("name", EVERY)
def test_gates_change_at_their_clocks(fmu, name: str) -> None:
    """With early return: every edge of every gate, beside the design that computes every clock."""
    path, drive, ts = fmu(name), load_drive(name), period_of(name)
    core = Importer(path, early=True)
    gates = [n for n in core.named if n.startswith("gate_")]
    words = Encoder(drive)
    slow = loaded(drive, variables.system_of(drive))
    measured = list(kind_of(drive).formats(drive))
    clock, edges, period = 25e6, 0, round(ts * 25e6)
    for _, given in zip(range(40), inputs_of(name), strict=False):
        core.put(**given)
        end = core.time + ts
        found = []
        while core.time < end - 1e-12:
            core.step(end - core.time)
            found.append((round(core.time * clock), core.get(*gates)))
        state = state_of(drive, given)
        for port, word in zip(measured, words.words(state)[0], strict=True):
            slow.put(port, word)
        slow.put("start", 1)
        wanted, before = [], slow.get("gates")
        for k in range(period):
            slow.clocks(1)
            slow.put("start", 0)
            if slow.get("gates") != before or k == period - 1:
                before = slow.get("gates")
                at = round((end - ts) * clock) + k + 1
                wanted.append((at, [bool(before >> b & 1) for b in range(len(gates))]))
        assert found == wanted
        edges += len(found) - 1
    assert edges >= 5


def state_of(drive, given: dict[str, float]) -> MpdccState | MptcState:
    """The state of some inputs."""
    g = given
    current = complex(g["is_alpha"], g["is_beta"])
    if hasattr(drive, "converter"):
        return MpdccState(
            current=current, flux=complex(g["psir_alpha"], g["psir_beta"]), v_n=g["v_n"],
            v_ph=(g["v_ph_a"], g["v_ph_b"], g["v_ph_c"]), omega_s=g["omega_s"],
            current_ref=complex(g["iref_alpha"], g["iref_beta"]), omega_r=g["omega_r"],
            applied=(0, 0, 0), vdc=g["v_dc"],
        )  # fmt: skip
    flux = complex(g["psis_alpha"], g["psis_beta"])
    return MptcState(current, flux, g["omega_r"], g["torque_ref"], g["psi_ref"], 0, g["v_dc"])


def loaded(drive, name: str) -> Design:
    """A system set up as the FMU sets it up, at the clock of its first sample."""
    one, registers = Design(name), registers_of(drive.controller)
    status, fields = registers["system.status"]

    def settle() -> None:
        while one.read(status) >> fields["commit_pending"][0] & 1:
            one.clocks(8)

    settle()
    for register, address, word in values(drive, clock=25e6).writes():
        assert one.write(address, word), register
    settle()
    one.put("enable", 1)
    one.clocks(4096)
    control, fields = registers["system.control"]
    assert one.write(control, packed("system.control", fields, {"enable": 1, "own_positions": 1}))
    one.clocks(4)
    return one


class Loop:
    """A controller FMU in a loop of the library: what it saw, decisions, every edge of a gate."""

    def __init__(self, path: Path, drive: Drive | MptcDrive) -> None:
        self.core, self.drive = Importer(path, early=True), drive
        self.gates = [n for n in self.core.named if n.startswith("gate_")]
        self.model, self.words = ModelController(drive), Encoder(drive)
        self.seen: list[dict[str, int]] = []
        self.edges: list[tuple[int, int]] = []
        self.decided: list[list[float]] = []
        self.shown = SHOWN[drive.controller]

    def decide(self, state: MpdccState | MptcState) -> MpdccDecision | MptcDecision:
        """One period; the decision that acts in the plant."""
        core, end = self.core, round((len(self.seen) + 1) * self.drive.control.ts, 12)
        names = list(kind_of(self.drive).formats(self.drive))
        core.put(**given_of(state, self.drive))
        self.seen.append(dict(zip(names, self.words.words(state)[0], strict=True)))
        while core.time < end - 1e-12:
            core.step(end - core.time)
            word = sum(int(on) << bit for bit, on in enumerate(core.get(*self.gates)))
            if word != (self.edges[-1][1] if self.edges else 0):
                self.edges.append((round(core.time * CLOCK), word))
        self.decided.append(core.get(*self.shown))
        s = self.decided[-1]
        if isinstance(state, MpdccState):
            told = dict(zip(self.shown, map(int, s), strict=True))
            flags = bool(told["held"]), bool(told.get("deadlock")), told.get("length", 0)
            return MpdccDecision(tuple(int(x) for x in s[:3]), *flags)
        known = self.model.decide(state)  # a sequence is on no port
        return known if self.drive.control.sequences else MptcDecision(int(s[0]))


CLOCK = 25e6
SHOWN = {
    "mpdcc": ["s_a", "s_b", "s_c", "held", "deadlock", "length", "saturated", "cycles"],
    "kbest": ["s_a", "s_b", "s_c", "held", "cost", "saturated", "cycles"],
    "mptc": ["u_next", "saturated", "clamped", "cycles", "flux_alpha"],
}


def given_of(state: MpdccState | MptcState, drive: Drive | MptcDrive) -> dict[str, float]:
    """Inputs of an FMU for a state."""
    if isinstance(state, MpdccState):
        vectors = {"is": state.current, "psir": state.flux, "iref": state.current_ref}
        rest = {"v_n": state.v_n, "omega_s": state.omega_s, "omega_r": state.omega_r}
        rest |= {f"v_ph_{x}": v for x, v in zip("abc", state.v_ph, strict=True)}
    else:
        vectors = {"is": state.current, "psis": state.flux}
        rest = {"omega_r": state.omega_r, "torque_ref": state.torque_ref, "psi_ref": state.psi_ref}
    rest["v_dc"] = drive.inverter.vdc if state.vdc is None else state.vdc
    parts = {f"{n}_{x}": getattr(v, y) for n, v in vectors.items() for x, y in PARTS}
    return parts | rest


PARTS = (("alpha", "real"), ("beta", "imag"))


class Inputs:
    """Inputs of a system, clock by clock, as a host on its bus gives them."""

    def __init__(self, name: str) -> None:
        self.one = Design(name)
        self.now = {n: 0 for n, port in self.one.ports.items() if port.is_input}
        self.rows: list[tuple[int, ...]] = []
        self.put(rst=1)
        self.clocks(4)
        self.put(rst=0)

    def put(self, **given: int) -> None:
        """From the next clock on."""
        for name, word in given.items():
            width = self.one.ports[name].width
            self.now[name] = word & (1 << width) - 1
            self.one.put(name, word)

    def clocks(self, count: int) -> None:
        """Let clocks pass."""
        self.rows += [tuple(self.now.values())] * count
        self.one.clocks(count)

    def write(self, address: int, word: int) -> None:
        """Write a register over AXI4-Lite."""
        self.put(s_axil_awaddr=address, s_axil_wdata=word, s_axil_wstrb=15, s_axil_bready=1)
        waiting = {"s_axil_awvalid": "s_axil_awready", "s_axil_wvalid": "s_axil_wready"}
        self.put(**dict.fromkeys(waiting, 1))
        answered = False
        while waiting or not answered:
            self.one.clocks(0)  # inputs settle
            taken = [n for n, ready in waiting.items() if self.one.get(ready)]
            answered = answered or bool(self.one.get("s_axil_bvalid"))
            self.clocks(1)
            for name in taken:
                del waiting[name]
                self.put(**{name: 0})
        self.put(s_axil_bready=0)


LOOPS = [
    *((n, None) for n in ("anpc5l_6kv", "anpc5l_3kv3", "anpc5l_grid", "anpc5l_pmsm", "anpc5l_rl")),
    ("anpc5l_6kv_kbest", None),
    *((n, m) for n in ("induction_2kw2", "motulator_2kw2") for m in ("MPTC", "MPFC", "MPC2")),
    *(("induction_2kw2", m) for m in SEQUENCE_METHODS if m != "MPC2"),
]


@pytest.mark.parametrize(("name", "method"), LOOPS)
def test_a_loop_is_ghdls(name: str, method: str | None, tmp_path: Path) -> None:
    """Every decision and every edge of a gate at its clock, by the VHDL itself in GHDL."""
    drive = load_drive(name) if method is None else load_drive(name).with_control(method=method)
    design = variables.system_of(drive)
    native.write([design])
    path = write_controller(drive, tmp_path / "core.fmu", windows=False)
    loop, steps, period = Loop(path, drive), 40, round(drive.control.ts * CLOCK)
    if hasattr(drive, "converter"):  # gates come on at position 0, from where no phase goes far
        profile = closed_loop.constant_profile(drive, closed_loop.OperatingPoint(1.0), steps)
        closed_loop.drive_controller(drive, loop, profile, steps, checked=False, filtered=False)
    else:
        simulate(drive, loop, steps=steps)
    assert loop.core.get("faults", "running") == [0, True]
    inputs, registers = Inputs(design), registers_of(drive.controller)
    inputs.clocks(300)
    for _, address, word in values(drive, clock=CLOCK, built=variables.built(design)).writes():
        inputs.write(address, word)
    inputs.clocks(300)
    inputs.put(enable=1)
    inputs.clocks(4096)
    address, fields = registers["system.control"]
    inputs.write(address, packed("system.control", fields, {"enable": 1, "own_positions": 1}))
    first = len(inputs.rows)
    for words in loop.seen:
        inputs.put(**words, start=1)
        inputs.clocks(1)
        inputs.put(start=0)
        inputs.clocks(period - 1)
    inputs.clocks(1)  # what a clock shows is known at its end
    top, generics = native.DESIGNS[design]
    columns = dict(zip(inputs.now, zip(*inputs.rows, strict=True), strict=True))
    found = agreement.answers(top, generics, library.verilog_of(design), columns)
    after = {n: column[first:] for n, column in found.items()}
    gates = after["gates"]
    changes = np.flatnonzero(np.diff(gates)) + 1
    assert loop.edges == [(int(k), int(gates[k])) for k in changes]
    assert len(loop.edges) > 12
    scale = {"flux_alpha": measurement_formats(drive)["psis_alpha"].scale} if method else {}
    for k, decided in enumerate(loop.decided, 1):
        for port, value in zip(loop.shown, decided, strict=True):
            word = int(after[port][k * period])
            if port in scale:
                word = (word - (word >> 15 << 16)) / scale[port]
            assert value == word, (k, port)


@pytest.mark.parametrize("name", EVERY)
def test_steps_of_any_size(fmu, name: str) -> None:
    """At the ends of control periods everything is as with steps of one period."""
    path, ts = fmu(name), period_of(name)
    plain, odd = Importer(path), Importer(path)
    rng = random.Random(2)
    for k, given in zip(range(25), inputs_of(name), strict=False):
        for one in (plain, odd):
            one.put(**given)
        plain.step(ts)
        while (left := (k + 1) * ts - odd.time) > 1e-12:
            odd.step(left if rng.random() < 0.2 else left * rng.random() ** 2)
        assert plain.outputs() == odd.outputs()


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", EVERY)
def test_states_are_taken_back(fmu, name: str, version: str) -> None:
    """In the middle of a decision, by the importer's memory and by bytes, and a reset there."""
    path, ts = fmu(name, version), period_of(name)
    one, other = Importer(path), Importer(path)

    def on(instance: Importer, first: int) -> list[list[float]]:
        seen = []
        for k, given in zip(range(12), inputs_of(name), strict=False):
            if k >= first:
                instance.put(**given)
                instance.step((k + 1) * ts - instance.time)
                seen.append(instance.outputs())
        return seen

    given = next(inputs_of(name))
    for instance in (one, other):
        instance.put(**given)
    one.step(0.8e-6)
    assert one.get("busy") == [True]
    state, time = one.one.getFMUState(), one.time
    wanted = on(one, 0)
    one.one.setFMUState(state)
    one.time = time
    assert on(one, 0) == wanted
    kept = one.one.serializeFMUState(state)
    other.one.setFMUState(other.one.deserializeFMUState(kept))
    other.time = time
    assert on(other, 0) == wanted
    one.one.setFMUState(state)
    one.one.reset()
    one.begin(**given)
    assert on(one, 0)[1:] == wanted[1:]


def test_two_instances_share_nothing(fmu) -> None:
    paths = [fmu(name) for name in DRIVES]
    alone = []
    for name, path in zip(DRIVES, paths, strict=True):
        one = Importer(path)
        seen = []
        for _, given in zip(range(15), inputs_of(name), strict=False):
            one.put(**given)
            one.step(period_of(name))
            seen.append(one.outputs())
        alone.append(seen)
    together = [Importer(path) for path in paths for _ in range(2)]
    for k in range(15):
        for place, one in enumerate(together):
            name = DRIVES[place // 2]
            one.put(**next(itertools.islice(inputs_of(name), k, None)))
            one.step(period_of(name))
            assert one.outputs() == alone[place // 2][k]


@pytest.mark.parametrize("name", EVERY)
def test_parameters_make_the_controller_of_such_a_drive(fmu, name: str, tmp_path: Path) -> None:
    """Decisions and gates of one FMU with other parameters are those of the other drive's FMU."""
    tables: dict[str, dict[str, float]] = {}
    for key, value in CHANGED[name].values():
        section, _, word = key.partition(".")
        tables.setdefault(section, {})[word] = value
    drive = load_drive(name).changed(**tables)
    path = write_controller(drive, tmp_path / "other.fmu", windows=False)
    given = {key: value for key, (_, value) in CHANGED[name].items()}
    plain, set_, other = Importer(fmu(name)), Importer(fmu(name), **given), Importer(path)
    differing = 0
    for _, inputs in zip(range(60), inputs_of(name), strict=False):
        for one in (plain, set_, other):
            one.put(**inputs)
            one.step(period_of(name))
        assert set_.outputs() == other.outputs()
        differing += set_.outputs() != plain.outputs()
    assert differing > 2
    set_.one.reset()
    set_.begin()
    fresh = Importer(fmu(name))
    for one in (set_, fresh):
        one.put(**inputs)
        one.step(period_of(name))
    assert set_.outputs() == fresh.outputs()


def test_parameters_that_do_not_fit_together_are_refused(fmu) -> None:
    name = "induction_2kw2"
    one = Importer(fmu(name))
    highest, least = float(one.named["machine.lm"].max), float(one.named["machine.ls"].min)
    one.one.reset()
    for given, said in (
        ({"machine__lm": highest * 1.01}, "machine.lm: got"),
        ({"control__ts": 1e-4}, "control.ts is built in; write the FMU of another drive"),
    ):
        with pytest.raises(Exception, match=r"[Ee]rror"):
            one.put(**given)
        assert said in one.said[-1]
    one.put(machine__lm=highest, machine__ls=least)
    one.one.enterInitializationMode()
    with pytest.raises(Exception, match=r"[Ee]rror"):
        one.one.exitInitializationMode()
    assert "machine.lm = 0.2299, machine.ls = 0.2127" in one.said[-1]
    assert "write the FMU of such a drive" in one.said[-1]


@pytest.mark.parametrize(
    ("drive", "said"),
    [
        (
            load_drive("anpc5l_6kv_kbest").changed(inverter={"topology": "npc3l"}),
            "inverter.topology",
        ),
        (load_drive("anpc5l_6kv_kbest").with_control(beam=16), "control.beam"),
    ],
    ids=["converter", "beam"],
)
def test_a_drive_of_another_kind_is_refused(drive: Any, said: str, tmp_path: Path) -> None:
    """K-best is built with the tables of one converter, and one search."""
    with pytest.raises(ValueError, match=said):
        write_controller(drive, tmp_path / "x.fmu")
    assert not list(tmp_path.iterdir())


def test_a_key_that_is_not_seen_is_no_parameter() -> None:
    """What NumPy or `int` does to a key goes unnoticed, and drops it."""

    def words(v: Any) -> dict[str, Any]:
        return {
            "a": round(v["k"] * 8),
            "b": round(float(np.sqrt(v["n"])) * 100),
            "c": round(v["n"]),
        }

    given, allowed = {"k": 3.0, "n": 5.0}, {"k": (0.0, 20.0), "n": (0.0, 20.0)}
    program, ranges = straight_line.of_keys(given, allowed, words, lambda _: [])
    assert list(ranges) == ["k"]
    assert program.run({"k": 2.06, "n": 5.0}) == {"a": 16.0}
    branch = straight_line.noted(given, lambda v: {"a": v["k"] + 1.0 if v["k"] > 1 else 0.0})
    assert branch.run({"k": 2.0, "n": 5.0}) == {"a": 3.0}
    assert branch.run({"k": 0.5, "n": 5.0}) is None


@pytest.mark.parametrize("version", VERSIONS)
def test_what_is_wrong_is_refused(fmu, version: str) -> None:
    name = "induction_2kw2"
    one = Importer(fmu(name, version))
    for given, said in [
        ({"guard__dead_time": 1.0}, "guard.dead_time"),
        ({"is_alpha": math.nan}, "is_alpha: got nan"),
        ({"u_next": 1}, "u_next cannot be set"),
    ]:
        with pytest.raises(Exception, match=r"[Ee]rror"):
            one.put(**given)
        assert said in one.said[-1]
    with pytest.raises(Exception, match=r"[Ee]rror"):
        one.one.doStep(1.0, 1e-4)
    assert "but the FMU is at 0 s" in one.said[-1]
    one.put(**next(inputs_of(name)))
    one.step(period_of(name))
    assert one.get("cycles") == [39]
    late = Importer(fmu(name, version), guard__current_limit=1.0)
    for _, given in zip(range(3), inputs_of(name), strict=False):
        late.put(**given)
        late.step(period_of(name))
    assert late.get("faults", "running") == [2, False]  # over-current, by the limit that was set
    late.put(enable=0)
    late.step(1e-4)
    late.put(enable=1, is_alpha=0.1, is_beta=0.1)
    late.step(3e-4)
    assert late.get("faults", "running") == [0, True]


def test_inputs_in_si_and_in_phases(fmu) -> None:
    name = "anpc5l_6kv"
    drive, ts = load_drive(name), period_of(name)
    bases = variables._bases(drive)
    plain, other = Importer(fmu(name)), Importer(fmu(name, si=True, phases=True))
    for _, given in zip(range(20), inputs_of(name), strict=False):
        plain.put(**given)
        si = {n: v * bases[n.split("_al")[0].split("_be")[0]][0] for n, v in given.items()}
        alpha, beta = si.pop("is_alpha"), si.pop("is_beta")
        si |= {"is_a": alpha, "is_b": -alpha / 2 + beta * math.sqrt(0.75)}
        other.put(**si, is_c=-si["is_a"] - si["is_b"])
        plain.step(ts)
        other.step(ts)
        assert plain.get("s_a", "s_b", "s_c") == other.get("s_a", "s_b", "s_c")


@pytest.mark.parametrize("name", ["anpc5l_6kv", "npc3l_3kv3"])
def test_a_plant_is_that_of_the_library(fmu, name: str) -> None:
    rng = random.Random(4)
    drive = load_drive(name)
    one, wanted = Importer(fmu(name, plant=True)), Plant(drive, 0.5)
    names = [n for n in one.named if n.startswith(("is_al", "is_be", "psir", "v_n", "v_ph"))]
    for _ in range(50):
        s = tuple(rng.randrange(drive.converter.positions) for _ in "abc")
        omega = rng.uniform(-1, 1)
        wanted.omega_r = omega
        one.put(s_a=s[0], s_b=s[1], s_c=s[2], omega_r=omega, v_dc=drive.inverter.vdc)
        one.step(drive.control.ts)
        np.testing.assert_allclose(one.get(*names), wanted.step(s), rtol=0, atol=1e-12)


def test_a_plant_of_vectors_is_that_of_the_library(fmu) -> None:
    rng = random.Random(4)
    two = load_drive("induction_2kw2")
    one, p = Importer(fmu("induction_2kw2", plant=True)), plant_parameters(two)
    i = psi = 0j
    for _ in range(50):
        u, omega, size = rng.randrange(8), rng.uniform(-300, 300), rng.uniform(1e-6, 1e-3)
        i, psi = advance(p, i, psi, omega, u, size)
        one.put(u=u, omega_r=omega, v_dc=540.0)
        one.step(size)
        found = one.get("is_alpha", "is_beta", "psis_alpha", "psis_beta")
        np.testing.assert_allclose(
            found, [i.real, i.imag, psi.real, psi.imag], rtol=1e-9, atol=1e-9
        )


def used() -> float:
    """MB of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def test_memory_stands(fmu) -> None:
    """Steps and rollbacks take none; an instance has less than 10 MB."""
    name = "induction_2kw2"
    path, ts = fmu(name), period_of(name)
    one = Importer(path)

    def steps() -> None:
        for _ in range(5000):
            one.step(ts)
        for _ in range(500):
            state = one.one.getFMUState()
            one.one.setFMUState(state)
            one.one.freeFMUState(state)

    steps()
    before = used()
    steps()
    assert used() - before < 1.0
    for one_more in DRIVES:
        path, before = fmu(one_more), used()
        many = [Importer(path) for _ in range(5)]
        assert (used() - before) / len(many) < 10.0


def test_a_million_steps_take_no_memory(fmu) -> None:
    name = "induction_2kw2"
    one, ts = Importer(fmu(name)), period_of(name)
    given = list(itertools.islice(inputs_of(name), 1000))
    places = [one.named[n].valueReference for n in given[0]]
    rows = [list(values_.values()) for values_ in given]
    for k in range(1_000_000):
        if k == 10_000:
            before = used()
        one.one.setFloat64(places, rows[k % len(rows)])
        one.one.doStep(k * ts, ts)
    assert used() - before < 1.0
    assert one.get("clocks") == [1_000_000 * round(ts * CLOCK)]


def test_the_command(tmp_path: Path, capsys) -> None:
    out = tmp_path / "drive.fmu"
    assert main(["fmu", "anpc5l_6kv", "--plant", "--no-windows", "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"{out}\n"
    assert validate_fmu(str(out)) == []
    assert main(["fmu", "anpc5l_6kv", "--plant", "--si", "--out", str(out)]) == 2
    assert "--plant has none of them" in capsys.readouterr().err
    assert main(["fmu", "induction_2kw2", "--clock", "33e6", "--out", str(out)]) == 0
    for clock, said in (("30.001e6", "control.ts"), ("1", "clock")):
        assert main(["fmu", "induction_2kw2", "--clock", clock, "--out", str(out)]) == 2
        assert said in capsys.readouterr().err
    assert main(["fmu", "anpc5l_6kv", "--out", str(tmp_path / "drive.zip")]) == 2
    assert "ends with .fmu" in capsys.readouterr().err


def test_the_program_of_the_page(fmu, tmp_path: Path, monkeypatch, capsys) -> None:
    name = "induction_2kw2"
    (tmp_path / "controller.fmu").write_bytes(fmu(name).read_bytes())
    (tmp_path / "plant.fmu").write_bytes(fmu(name, plant=True).read_bytes())
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "fmu.md").read_text(encoding="utf-8")
    first, whole = (part.partition("```")[0] for part in page.split("```python\n")[1:])
    exec(whole, {})
    assert abs(float(capsys.readouterr().out) - 7.0) < 0.5
    (tmp_path / "controller.fmu").write_bytes(fmu("anpc5l_6kv").read_bytes())
    seen: dict[str, Any] = {}
    exec(first, seen)
    assert set(seen["found"]["s_a"]) == set(range(8))
    assert (tmp_path / "picture.png").stat().st_size > 5000


@pytest.mark.parametrize(("name", "least"), [("induction_2kw2", 2000), ("anpc5l_6kv", 1000)])
def test_it_is_fast_enough(fmu, name: str, least: int) -> None:
    """6,000 and 3,000 decisions a second of one core are wanted; a loaded machine has a third."""
    one, ts = Importer(fmu(name)), period_of(name)
    given = list(itertools.islice(inputs_of(name), 400))
    places = [one.named[n].valueReference for n in given[0]]
    began = time.process_time()
    for values_ in given:
        one.one.setFloat64(places, list(values_.values()))
        one.step(ts)
    assert len(given) / (time.process_time() - began) > least


#: Loads the plant of a two-level drive, gives it a vector for 20 steps and prints its current.
WINDOWS = r"""
#include <windows.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
int main(int count, char **a) {
  HMODULE m = LoadLibraryA(a[1]);
  if (!m) return 1;
  void *(*make)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *,
                size_t, void *, void *, void *) =
      (void *)GetProcAddress(m, "fmi3InstantiateCoSimulation");
  int (*begin)(void *, bool, double, double, bool, double) =
      (void *)GetProcAddress(m, "fmi3EnterInitializationMode");
  int (*begun)(void *) = (void *)GetProcAddress(m, "fmi3ExitInitializationMode");
  int (*step)(void *, double, double, bool, bool *, bool *, bool *, double *) =
      (void *)GetProcAddress(m, "fmi3DoStep");
  int (*get)(void *, const uint32_t *, size_t, double *, size_t) =
      (void *)GetProcAddress(m, "fmi3GetFloat64");
  int (*set)(void *, const uint32_t *, size_t, const int32_t *, size_t) =
      (void *)GetProcAddress(m, "fmi3SetInt32");
  void *one = make("one", a[3], a[2], 0, 0, 0, 0, 0, 0, 0, 0, 0);
  uint32_t u = atoi(a[4]), i = atoi(a[5]);
  int32_t vector = 3;
  bool b[3];
  double t, current;
  if (!one || begin(one, 0, 0, 0, 0, 0) || begun(one) || set(one, &u, 1, &vector, 1)) return 2;
  for (int k = 0; k < 20; k++)
    if (step(one, k * 50e-6, 50e-6, 0, b, b + 1, b + 2, &t)) return 3;
  get(one, &i, 1, &current, 1);
  printf("%.12g\n", current);
  return 0;
}
"""


def test_the_binary_for_windows_runs(tmp_path: Path) -> None:
    wine = shutil.which("wine") or shutil.which("wine64")
    if not wine or not library.cross_compiler():
        pytest.skip("there is no MinGW or no Wine")
    path = write_plant(load_drive("induction_2kw2"), tmp_path / "plant.fmu", windows=True)
    one = Importer(path)
    (tmp_path / "load.c").write_text(WINDOWS, encoding="utf-8")
    program = [library.MINGW.replace("g++", "gcc"), "-w", "load.c", "-o", "load.exe"]
    subprocess.run(program, cwd=tmp_path, check=True)
    numbers = [str(one.named[n].valueReference) for n in ("u", "is_alpha")]
    inside = [f"binaries\\x86_64-windows\\{path.stem}.dll", "resources\\"]
    done = subprocess.run(
        [wine, str(tmp_path / "load.exe"), *inside, one.description.guid, *numbers],
        cwd=one.folder, capture_output=True, text=True, check=True, timeout=120,
        env=os.environ | {"WINEDEBUG": "-all", "HOME": str(tmp_path)},
    )  # fmt: skip
    one.put(u=3)
    for _ in range(20):
        one.step(50e-6)
    assert math.isclose(float(done.stdout), one.get("is_alpha")[0], rel_tol=1e-9)


def test_sanitizers_find_nothing(fmu, tmp_path: Path) -> None:
    """Addresses, leaks and undefined behaviour of the RTL's FMU, in all of its C++."""
    one = Importer(fmu("induction_2kw2"))
    folder = Path(one.folder) / "sources"
    files = [str(p.relative_to(folder)) for p in folder.rglob("*.cpp")]
    flags = ["-std=c++17", "-O1", "-w", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    flags += [f"-I{name}" for name in library.FOLDERS]

    def compiled(numbered: tuple[int, str]) -> str:
        out = str(tmp_path / f"{numbered[0]}.o")
        command = [*library.compiler(), *flags, "-c", numbered[1], "-o", out]
        subprocess.run(command, cwd=folder, check=True)
        return out

    with ThreadPoolExecutor(2) as pool:
        here = str(Path(__file__).with_name("fmu_memory.cpp"))
        objects = list(pool.map(compiled, enumerate([*files, here])))
    program = str(tmp_path / "memory")
    subprocess.run(
        [*library.compiler(), *flags[:4], *objects, "-o", program, "-lpthread"], check=True
    )
    resources = str(Path(one.folder) / "resources")
    done = subprocess.run(
        [program, resources, one.description.guid], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "26 refused\n"), done.stderr


def test_a_fault_in_the_verilog_is_seen(fmu, tmp_path: Path, monkeypatch) -> None:
    """A choice that prefers the wrong vector: the loop no longer is the model's."""
    native.write(["mptc_system"])
    text = library.verilog_of("mptc_system").read_text(encoding="utf-8")
    at = text.index("assign u_next =")
    end = text.index(";", at)
    (tmp_path / "mptc_system.v").write_text(f"{text[:end]} ^ 3'b001{text[end:]}", encoding="utf-8")
    monkeypatch.setattr(library, "VERILOG", tmp_path)
    wrong = write_controller(load_drive("induction_2kw2"), tmp_path / "wrong.fmu", windows=False)
    with pytest.raises(AssertionError):
        test_a_loop_of_mptc_is_the_models(
            lambda name, version, plant=False: fmu(name, version, plant=True) if plant else wrong,
            "3.0",
        )
