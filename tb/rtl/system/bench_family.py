"""Cocotb side of ``test_family_system``: closed loops through a whole system."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import cocotb
import numpy as np
from cocotb.triggers import FallingEdge, Timer

from directmpc.host.gate_guard import GateGuard, Inputs
from directmpc.host.goal_holder import GoalHolder
from directmpc.host.registers import values as register_values
from directmpc.mptc import bit_true, closed_loop, cycles, machine, plant
from directmpc.mptc import bit_true_sequences as twin
from directmpc.mptc import speed_observer as speed_twin
from directmpc.mptc import vector_sequencer as sequencer
from directmpc.mptc.drive import DUTY_RULES, MptcDrive
from directmpc.mptc.inverter import STATES
from directmpc.mptc.sequence import TIME_STEPS, VectorSequence, segments
from directmpc.mptc.trace import IntArray
from scripts.generate import register_files
from scripts.hdl.clocks import clocks_of
from scripts.hdl.mptc_job import FAMILY_METHODS
from tb.helpers import mptc_pairs
from tb.helpers import mptc_rows as rows
from tb.helpers.scoreboard import Scoreboard, arguments, bits, number
from tb.rtl.system.bus import Bus

CONTROL = {"enable": 0, "external_trip": 0, "start": 0}
LEAST_DEAD_TIME = 10
#: Clocks from the sequencer's start to its first vector.
PLAYED = clocks_of("vector_sequencer", "latency")
METHODS = ("MPTC", "MPFC", *FAMILY_METHODS)
#: Settings of the guard, clocks; its limits are none here.
SETTINGS = {
    "minimum_on": 14, "minimum_off": 12, "dead_time": 12, "decision_limit": 9_000,
    "watchdog": 9_000, "current_limit": 32_766, "link_high": 65_534, "link_low": 1,
    "speed_limit": 32_766,
}  # fmt: skip


def legs_of(u: int) -> int:
    """Switch states of a vector, bit 2: a."""
    return sum(int(bit) << (2 - leg) for leg, bit in enumerate(STATES[u]))


@dataclass
class Reference:
    """Sequencer, goals and guard of a system, clock by clock; it knows what was decided."""

    rate: int
    settings: dict[str, int]
    now: int = 0
    played: list[tuple[int, IntArray]] = field(default_factory=list)
    guard: GateGuard = field(default_factory=lambda: GateGuard(False, LEAST_DEAD_TIME))
    holder: GoalHolder = field(default_factory=GoalHolder)
    go: bool = False
    #: What the core decided last: sequence, whether it is modulated; None before the first.
    decided: tuple[tuple[int, ...], bool] | None = None
    measured: tuple[int, int, int] = (0, 0, 0)
    started: int | None = None
    early: bool = False
    delayed: bool = False

    def rest(self, clocks: int) -> None:
        """Off and idle."""
        for _ in range(clocks):
            self.guard.clock(Inputs(**self.settings))

    def wanted(self) -> tuple[bool, int]:
        """Whether a sequence plays, and its switch states in this clock."""
        while len(self.played) > 1 and self.played[1][0] <= self.now:
            self.played.pop(0)
        if not self.played or self.played[0][0] > self.now:
            return False, 0
        begin, vectors = self.played[0]
        return True, legs_of(int(vectors[min(self.now - begin, len(vectors) - 1)]))

    def clock(self, start: bool, enabled: int) -> None:
        """One rising edge."""
        if not (enabled and self.guard.live):  # what was decided before a stop is forgotten
            self.played, self.decided, self.holder = [], None, GoalHolder()
        apply = self.go and self.decided is not None
        if apply:
            sequence, segmented = self.decided
            vectors = sequencer.play(sequence, segmented, self.rate, 2**32 // max(self.rate, 1) + 3)
            self.played.append((self.now + PLAYED, vectors))
            if self.started is not None:
                self.early |= sequencer.is_early(self.rate, self.now - self.started)
            self.started = self.now
        playing, wanted = self.wanted()
        waits, goal = self.guard.waits, self.holder.goal
        self.delayed |= self.holder.delayed(playing, wanted, waits)
        is_alpha, is_beta, v_dc = self.measured
        self.guard.clock(
            Inputs(
                enable=enabled, start=int(self.go), measured=int(self.go), is_alpha=is_alpha,
                is_beta=is_beta, v_dc=v_dc, decided=int(self.holder.decided),
                position_a=goal >> 2, position_b=goal >> 1 & 1, position_c=goal & 1,
                **self.settings,
            )
        )  # fmt: skip
        self.holder.clock(apply, playing, wanted, waits)
        self.go = start
        self.now += 1


class Rig:
    """A system with its bus, its plant and what it has to do."""

    def __init__(self, dut, given) -> None:
        self.dut, self.rng = dut, random.Random(given["seed"])
        self.bus, self.board = Bus(dut, "mptc", self.rng), Scoreboard()
        self.inputs = {w.name: w for w in register_files.measurements("mptc")}
        self.sensorless = bool(given["sensorless"])
        self.reference: Reference | None = None
        self.where = ""

    async def begin(self) -> None:
        """Known inputs, a reset, the bus; then every clock is checked."""
        await self.bus.begin(CONTROL | dict.fromkeys(self.inputs, 0))
        cocotb.start_soon(self.watch())

    async def watch(self) -> None:
        """Compare the gates in every clock in which there is a reference."""
        dut = self.dut
        before = 0
        while True:
            await FallingEdge(dut.clk)
            await Timer(4, "ns")  # what is written in this clock has been
            known = self.reference
            if known is None:
                continue
            where = f"{self.where}, clock {known.now}"
            got = number(dut.gates), number(dut.running), number(dut.faults)
            wanted = known.guard.gates, int(known.guard.running), known.guard.fault_bits
            self.board.check("gates", got, wanted, where)
            self.board.cover("moved", int(got[0] != before and got[1]))
            before = got[0]
            known.clock(bool(number(dut.start)), number(dut.i_shell.enabled))

    async def reset(self) -> None:
        """All registers at rest."""
        self.reference = None
        await FallingEdge(self.dut.clk)
        self.dut.rst.value = 1
        for _ in range(3):
            await FallingEdge(self.dut.clk)
        self.dut.rst.value = 0
        await FallingEdge(self.dut.clk)

    async def commit(self) -> None:
        """Let what was written take effect."""
        await self.bus.write("system.command", commit=1)
        while await self.bus.read("system.status", "commit_pending"):
            pass

    async def load(self, words: dict[str, int]) -> None:
        """Write registers by name and let them take effect."""
        for name, value in words.items():
            _, fields = self.bus.registers[name]
            (only,) = fields
            await self.bus.write(name, **{only: value})
        await self.commit()

    def put(self, words: IntArray) -> None:
        """Measurements on the ports."""
        for name, value in zip(self.inputs, words, strict=False):
            form = self.inputs[name]
            getattr(self.dut, name).value = (
                bits(int(value), form.width) if form.signed else int(value)
            )

    async def decide(self, words: IntArray) -> int:
        """Start with these measurements, wait; clocks that it took."""
        dut = self.dut
        await FallingEdge(dut.clk)
        before = self.estimates()
        self.put(words)
        dut.start.value = 1
        if self.reference:
            self.reference.measured = int(words[0]), int(words[1]), int(words[5])
        await FallingEdge(dut.clk)
        dut.start.value = 0
        self.put(np.array([self.rng.getrandbits(14) for _ in words]))
        clocks = 0
        while not number(dut.valid):
            clocks += 1
            assert clocks < 300, "no decision"
            if self.sensorless:
                now, where = self.estimates(), f"{self.where}, not before valid"
                self.board.check("speed port", now[0], before[0], where)
                self.board.check("flux port", now[1:], before[1:], where)
            await FallingEdge(dut.clk)
        return clocks

    def estimates(self) -> list[str]:
        """Bits of speed and flux on the ports."""
        dut = self.dut
        return [str(port.value) for port in (dut.speed, dut.flux_alpha, dut.flux_beta)]


def words_of(drive: MptcDrive, period: int, sensorless: bool, jitter: bool) -> dict[str, int]:
    """Registers of a drive whose control period has so many clocks."""
    built = ("family", "sensorless") if sensorless else ("family",)
    found = register_values(
        drive, clock=period / drive.control.ts, built=built, sensorless=sensorless
    ).words
    chosen = SETTINGS | {"minimum_on": 450} if jitter else SETTINGS
    return found | {f"guard.{n}": value for n, value in (chosen | {"frozen": 0}).items()}


def expected(
    drive: MptcDrive, words: IntArray, applied: IntArray, u: int
) -> tuple[tuple[int, ...], int, int]:
    """Sequence, saturated, clamped of the twin."""
    method = drive.control.method
    register = bit_true.parameters(drive)[0]
    if method in FAMILY_METHODS:
        rule = DUTY_RULES.index(drive.control.duty_rule)
        place = FAMILY_METHODS[method] - 1
        chosen, saturated, clamped = twin.decide_words(register, place, rule, words, applied)
        return tuple(int(v) for v in chosen), int(saturated), int(clamped)
    u, saturated, clamped = bit_true.decide_words(register, words, u)
    return (int(u), int(u), int(u), TIME_STEPS, 0), int(saturated), int(clamped)


async def decision(rig: Rig, wanted: tuple[tuple[int, ...], int, int]) -> None:
    """Compare the decision on ports and in registers."""
    dut, bus, board, where = rig.dut, rig.bus, rig.board, rig.where
    sequence, saturated, clamped = wanted
    got = tuple(number(getattr(dut, name)) for name in ("u_next", "saturated", "clamped"))
    board.check("decision", got, (sequence[0], saturated, clamped), where)
    board.check("switches", number(dut.switches), legs_of(sequence[0]), where)
    await FallingEdge(dut.clk)
    await FallingEdge(dut.clk)
    shown = [await bus.read("result.vectors", name) for name in ("u1", "u2", "u3")]
    shown += [await bus.read("result.times", name) for name in ("t1", "t2")]
    board.check("sequence", tuple(shown), sequence, where)


@dataclass
class Estimator:
    """The twin of the speed observer, and what it gave for this period."""

    coefficient: IntArray
    state: IntArray = field(default_factory=lambda: np.zeros(5, dtype=np.int64))
    flux: tuple[int, int] = (0, 0)
    saturated: int = 0

    def step(self, words: IntArray, applied: IntArray) -> IntArray:
        """Measurements with the estimates in their place; the step is taken."""
        used = words.copy()
        used[2:4] = self.flux
        m = np.array([words[0], words[1], words[5]])
        used[4], *flux, full = speed_twin.step_words(self.coefficient, self.state, m, applied)
        self.flux = int(flux[0]), int(flux[1])
        self.saturated |= int(full)
        return used


async def closed(rig: Rig, method: str, period: int, steps: int, jitter: bool) -> None:
    """A drive in closed loop, its gates let through; what is applied is what the guard is told."""
    rng, bus, board = rig.rng, rig.bus, rig.board
    rule = "mean" if jitter else "best"
    drive = rows.shipped("induction_2kw2").with_control(method=method, duty_rule=rule)
    known = plant.plant_parameters(drive)
    await rig.reset()
    if rig.sensorless:
        board.check("speed port", rig.estimates()[0], f"{0:016b}", "behind a reset")
    words = words_of(drive, period, rig.sensorless, jitter)
    estimator = None
    if rig.sensorless:
        estimator = Estimator(speed_twin.array(speed_twin.coefficients(drive)))
    await rig.load(words)
    settings = {name: words[f"guard.{name}"] for name in SETTINGS}
    reference = Reference(words["parameters.rate"], settings)
    reference.rest(1000)
    for _ in range(600):
        await FallingEdge(rig.dut.clk)
    rig.reference, rig.where = reference, f"{method}, {rule}, {period} clocks"
    rig.dut.enable.value = 1
    await bus.write("system.control", enable=1, own_positions=1, use_observer=int(rig.sensorless))
    rpm, load = rng.choice([(150.0, 0.0), (600.0, 14.0), (1400.0, 3.0), (-900.0, 7.0)])
    scenario = closed_loop.constant(drive, rpm, load, 0.9, steps)
    i, psi, omega = complex(scenario.current), complex(scenario.flux), float(scenario.omega_r)
    _, _, _, *formats = bit_true_formats(drive)
    applied, u = np.array([0, 0, 0, TIME_STEPS, 0]), 0
    for k in range(steps):
        rig.where = f"{method}, {period} clocks, step {k}"
        seen, _ = bit_true.encode_row(
            *formats, i, psi, omega, drive.inverter.vdc, load * rng.choice([1.0, 1.0, -1.0]), 0.9
        )
        used = estimator.step(seen, applied) if estimator else seen
        wanted = expected(drive, used, applied, u)
        begun = reference.now
        if reference.decided is not None:
            board.cover("several", int(wanted[0][3] not in (0, TIME_STEPS)))
        clocks = await rig.decide(seen)
        more = clocks_of("mptc_speed_observer", "speed") if rig.sensorless else 0
        board.check("clocks", clocks, cycles.of(method, rule) + more, rig.where)
        # the sequence decided before is the one that plays now
        reference.decided = wanted[0], method == "SVM"
        await decision(rig, wanted)
        if estimator:
            shown = await bus.read("result.speed", "omega_r")
            board.check("speed", shown, int(used[4]), rig.where)
            wanted_speed, *wanted_flux = (f"{bits(int(used[x]), 16):016b}" for x in (4, 2, 3))
            speed, *port = rig.estimates()
            board.check("speed port", speed, wanted_speed, rig.where)
            shown = [await bus.read("result.stator_flux", axis) for axis in ("alpha", "beta")]
            board.check("flux", shown, [int(v) for v in used[2:4]], rig.where)
            board.check("flux port", port, wanted_flux, rig.where)
        vectors, lengths = np.empty(7, dtype=np.int64), np.empty(7)
        count = segments(
            VectorSequence(*(int(v) for v in applied[:3]), *(applied[3:] / TIME_STEPS)),
            method == "SVM", vectors, lengths,
        )  # fmt: skip
        inside = np.empty(1, dtype=np.complex128), np.empty(1)
        i, psi, omega = plant.step_sequence(
            known, i, psi, omega, vectors[:count], lengths[:count], load, *inside
        )
        assert abs(machine.torque(known, i, psi)) < 200.0
        applied, u = np.array(wanted[0]), wanted[0][0]
        gap = period + (rng.choice([-60, -1, 0, 1, 3, 50]) if jitter else 0)
        while reference.now < begun + gap:
            await FallingEdge(rig.dut.clk)
    for name, value in (("early", reference.early), ("invalid", False),
                        ("delayed", reference.delayed)):  # fmt: skip
        board.check("flag", await bus.read("result.sequencer", name), int(value), name)
        board.cover(name, int(value))
    await bus.write("result.sequencer", early=1, delayed=1)
    board.cover("running", int(reference.guard.running))
    await bus.write("system.control", enable=0, own_positions=1)
    for _ in range(4):
        await FallingEdge(rig.dut.clk)
    if estimator:
        shown = await bus.read("system.flags", "observer_saturated")
        board.check("full", shown, estimator.saturated, rig.where)
    if estimator is None:
        await enabled_again(rig, drive, seen, applied)
    await forgotten(rig, drive, seen)


async def enabled_again(rig: Rig, drive: MptcDrive, seen: IntArray, applied: IntArray) -> None:
    """Behind a stop the gates come on with a decision made since, not with one of before."""
    reference, bus = rig.reference, rig.bus
    assert reference is not None
    for _ in range(1000):
        await FallingEdge(rig.dut.clk)
    await bus.write("system.control", enable=1, own_positions=1)
    for n in range(3):
        rig.where = f"{drive.control.method}, start {n} behind a stop"
        wanted = expected(drive, seen, applied, int(applied[0]))
        await rig.decide(seen)
        reference.decided = wanted[0], drive.control.method == "SVM"
        applied = np.array(wanted[0])
        for _ in range(400):
            await FallingEdge(rig.dut.clk)
        rig.board.check("running again", number(rig.dut.running), int(n > 0), rig.where)
    await bus.write("system.control", enable=0, own_positions=1)
    for _ in range(4):
        await FallingEdge(rig.dut.clk)


def bit_true_formats(drive: MptcDrive) -> tuple:
    """Scales, lows and highs of the measurements, behind three that nobody needs."""
    return None, None, None, *bit_true.parameters(drive)[1:4]


async def forgotten(rig: Rig, drive: MptcDrive, seen: IntArray) -> None:
    """Gates off: the system's own sequence can be forgotten; nothing is applied then."""
    if rig.sensorless:
        return
    nothing = np.zeros(5, dtype=np.int64)
    rig.reference = None
    await rig.bus.write("system.command", reset_observer=1)
    await rig.decide(seen)
    await decision(rig, expected(drive, seen, nothing, 0))


async def given_sequences(rig: Rig, count: int) -> None:
    """The host says what is being applied, with any content; methods change between decisions."""
    rng, bus = rig.rng, rig.bus
    await rig.reset()
    await bus.write("system.control", own_positions=0)
    table = mptc_pairs.together(mptc_pairs.mixed(3, 8), mptc_pairs.near(4, 12))
    wanted = table.expected().tolist()
    for n, k in enumerate(rng.sample(range(len(table)), count)):
        code = int(table.pairs[k])
        register = table.rows.registers[k]
        names = [w.name for w in register_files.parameters("mptc")]
        place = dict(zip(names, register[:-1], strict=False))
        words = {f"parameters.{name}": int(value) for name, value in place.items()}
        words |= {"parameters.method_mpfc": int(register[-1]), "parameters.family_method": code}
        words["parameters.duty_rule"] = int(table.rules[k])
        await rig.load(words)
        applied = table.applied[k]
        u1, u2, u3, t1, t2 = (int(value) for value in applied)
        await bus.write("running.vectors", u1=u1, u2=u2, u3=u3)
        await bus.write("running.times", t1=t1, t2=t2)
        rig.where = f"given {n}, method {code}"
        rig.dut.u.value = int(table.rows.u[k])
        await rig.decide(table.rows.measurements[k])
        row = wanted[k]
        await decision(rig, (tuple(row[5:]), row[2], row[3]))


@cocotb.test()
async def family(dut) -> None:
    """Every method in closed loop, at the full rate and with periods of any length."""
    given = arguments()
    rig = Rig(dut, given)
    await rig.begin()
    steps = given["steps"]
    built = await rig.bus.read("system.capabilities", "family")
    rig.board.check("family", built, 1)
    built = await rig.bus.read("system.capabilities", "sensorless")
    rig.board.check("sensorless", built, int(rig.sensorless))
    for method in given["methods"] or METHODS:
        for period, jitter in given["periods"]:
            await closed(rig, method, period, steps, bool(jitter))
    rig.reference = None
    if given["given"]:
        await given_sequences(rig, given["given"])
    runs = len(given["methods"] or METHODS) * len(given["periods"])
    rig.board.finish(
        {"gates": 300 * runs * steps, "decision": runs * steps, "sequence": runs * steps},
        {"moved": runs, "running": runs},
    )
