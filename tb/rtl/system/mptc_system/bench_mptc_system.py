"""Cocotb side of ``test_mptc_system``."""

from __future__ import annotations

from collections.abc import Callable

import cocotb
import numpy as np
from cocotb.triggers import FallingEdge

from directmpc.host import registers
from directmpc.mptc import observer
from directmpc.mptc.sequence import TIME_STEPS
from tb.helpers import mptc_rows
from tb.helpers.scoreboard import arguments, number
from tb.rtl.system.bench_system import System, widest

DRIVE = "induction_2kw2"
OBSERVED = ("is_alpha", "is_beta", "omega_r", "v_dc")
TRIES = 2_000  # measurements that are tried for a decision that depends on something


class Drive:
    """The two-level drive in a system: its registers, measurements of a loop, the twin."""

    def __init__(self, system: System, sensorless: int) -> None:
        self.system = system
        self.drive = mptc_rows.shipped(DRIVE)
        found = registers.values(self.drive).words
        self.words = {n: found.get(f"parameters.{n}", 0) for n in system.words}
        self.words |= {"sensorless": 0} if sensorless else {}
        self.rows = np.concatenate(
            [mptc_rows.recorded(DRIVE, "MPTC", rpm, load, 200).measurements
             for rpm, load in ((500.0, 6.0), (-1_200.0, -3.0))]
        )  # fmt: skip

    def measurements(self) -> dict[str, int]:
        """Of the loop, with noise."""
        rng = self.system.rng
        row = [int(w) for w in rng.choice(list(self.rows))]
        found = dict(zip(self.system.inputs, row, strict=False))
        for name in ("is_alpha", "is_beta", "psis_alpha", "psis_beta", "omega_r"):
            found[name] = max(-32_768, min(32_767, found[name] + rng.randrange(-900, 900)))
        return found | {"u": rng.randrange(8)}

    def decided(self, m: dict[str, int]) -> tuple[int, ...]:
        """The twin's decision."""
        return self.system.model(self.words, m)

    def telling(self, other: Callable[[dict[str, int]], dict[str, int]]) -> dict[str, int]:
        """Measurements whose decision is another with those that `other` makes of them."""
        for _ in range(TRIES):
            m = self.measurements()
            if self.decided(m) != self.decided(other(m)):
                return m
        raise AssertionError("no decision depends on it")

    async def load(self) -> None:
        """Parameters, in force."""
        names = [n for n in self.words if not self.system.words[n].optional or self.words[n]]
        await self.system.write_parameters({n: self.words[n] for n in names})
        await self.system.bus.write("system.command", commit=1)
        await self.system.settled()


async def reset(system: System) -> None:
    """One clock of it."""
    await FallingEdge(system.dut.clk)
    system.dut.rst.value = 1
    await FallingEdge(system.dut.clk)
    system.dut.rst.value = 0
    for _ in range(4):
        await FallingEdge(system.dut.clk)


async def given_from(system: System, m: dict[str, int]) -> bool:
    """A decision; whether its start gave the guard one."""
    dut = system.dut
    await FallingEdge(dut.clk)
    system.put(m)
    dut.start.value = 1
    given = False
    for n in range(200):
        await FallingEdge(dut.clk)
        dut.start.value = 0
        system.put(system.any_measurements())
        given |= bool(number(dut.apply))
        if number(dut.valid):
            assert n > 10
            await FallingEdge(dut.clk)
            return given
    raise AssertionError("no decision")


async def capabilities(system: System, wanted: dict[str, int]) -> None:
    """Everything that says what is built in."""
    for name in system.bus.registers["system.capabilities"][1]:
        found = await system.bus.read("system.capabilities", name)
        system.board.check(f"capability {name}", found, wanted.pop(name))
    system.board.check("capabilities", wanted, {})


async def resets(system: System, drive: Drive, rounds: int) -> None:
    """Behind a reset a system holds no vector, and none is waiting for its start."""
    board, bus = system.board, system.bus
    for n in range(rounds):
        await drive.load()
        await bus.write("system.control", own_positions=1)
        for _ in range(1 + n % 2):
            m = drive.telling(lambda m: m | {"u": 7})
            await given_from(system, m)
            if system.decided()[0]:
                break
        await reset(system)
        await drive.load()
        await bus.write("system.control", own_positions=1)
        last, waits = 0, False
        for k in range(3):
            # as well with the vector that was decided before the reset
            m = drive.telling(lambda m: m | {"u": 7}) | {"u": last}
            for _ in range(TRIES):
                if k or drive.decided(m | {"u": 0}) != drive.decided(m | {"u": 7}):
                    break
                m = drive.measurements() | {"u": last}
            given = await given_from(system, m)
            wanted = drive.decided(m)
            board.check("given", given, waits, f"round {n}, decision {k} behind the reset")
            board.check("decision", system.decided(), wanted, f"round {n}, decision {k}")
            last, waits = wanted[0], True


async def observed(system: System, drive: Drive, count: int) -> None:
    """Flux of the observer, step by step, as it is shown; each word of it counts."""
    board, bus = system.board, system.bus
    await bus.write("system.command", reset_observer=1)
    await bus.write("system.control", use_observer=1, own_positions=0)
    coefficients = observer.array(observer.coefficients(drive.drive))
    state, flux = np.zeros(4, dtype=np.int64), (0, 0)
    for n in range(count):
        m = drive.measurements()
        used = m | {"psis_alpha": flux[0], "psis_beta": flux[1]}
        wanted = drive.decided({k: int(v) for k, v in used.items()})
        await system.decide(m)
        board.check("observed", system.decided(), wanted, f"decision {n}")
        await FallingEdge(system.dut.clk)
        await FallingEdge(system.dut.clk)
        shown = [await bus.read("result.stator_flux", axis) for axis in ("alpha", "beta")]
        board.check("flux", shown, [int(v) for v in flux], n)
        words = np.array([m[name] for name in OBSERVED])
        flux = tuple(observer.step_words(coefficients, state, words, m["u"])[:2])
    board.check("full", await bus.read("system.flags", "observer_saturated"), 0)


async def while_running(system: System, drive: Drive, count: int) -> None:
    """A reset of the observer forgets nothing of what running gates are at."""
    board, bus, dut = system.board, system.bus, system.dut
    settings = {
        "watchdog": 60_000, "decision_limit": 59_000, "current_limit": 32_000,
        "link_high": 65_000, "link_low": 0, "dead_time": 10, "minimum_on": 1, "minimum_off": 1,
    }  # fmt: skip
    await bus.write("system.control", own_positions=1)
    for name, value in settings.items():
        _, fields = bus.registers[f"guard.{name}"]
        await bus.write(f"guard.{name}", **{next(iter(fields)): value})
    await widest(system)
    await bus.write("system.command", commit=1, reset_observer=1)
    await system.settled()
    dut.enable.value = 1
    await bus.write("system.faults", **dict.fromkeys(bus.registers["system.faults"][1], 1))
    await bus.write("system.control", enable=1, own_positions=1)
    last = 0
    for n in range(count):
        running = n > 2
        if running:
            board.check("running", number(dut.running), 1, f"decision {n}")
            await bus.write("system.command", reset_observer=1)
        for _ in range(TRIES):
            m = drive.measurements() | {"u": last}
            if last in (0, 7) or drive.decided(m) != drive.decided(m | {"u": 0}):
                break
        given = await given_from(system, m)
        board.check("kept", system.decided(), drive.decided(m), f"decision {n}")
        board.check("still given", given, n > 0, f"decision {n}")
        board.cover("vector", int(running and last not in (0, 7)))
        last = system.decided()[0]
        for _ in range(80):
            await FallingEdge(dut.clk)
    await bus.write("system.control", enable=0)


async def of_one_vector(system: System, drive: Drive, count: int) -> None:
    """What is applied is a port's where the method is of one vector, whatever else is written."""
    board, bus, rng = system.board, system.bus, system.rng
    await bus.write("system.control", own_positions=0)
    # nothing stays of a sequence that is too long, which another method was given
    await bus.write("running.times", t1=5_000, t2=0)
    for method in (2, 0):
        await system.write_parameters({"family_method": method})
        await bus.write("system.command", commit=1)
        await system.settled()
        await system.decide(drive.measurements())
    for n in range(count):
        part = rng.randrange(TIME_STEPS + 1)
        await bus.write("running.vectors", **{u: rng.randrange(8) for u in ("u1", "u2", "u3")})
        await bus.write("running.times", t1=part, t2=TIME_STEPS - part)
        m = drive.telling(lambda m: m | {"u": 0})
        await system.decide(m)
        board.check("decision", system.decided(), drive.decided(m), f"decision {n}, u {m['u']}")


async def measured_speed(system: System, drive: Drive, count: int) -> None:
    """The measured speed, where it is not to be estimated."""
    await system.bus.write("system.control", own_positions=0)
    for n in range(count):
        m = drive.telling(lambda m: m | {"omega_r": -m["omega_r"] - 1})
        await system.decide(m)
        system.board.check("speed", system.decided(), drive.decided(m), f"decision {n}")
        for _ in range(80):
            await FallingEdge(system.dut.clk)


@cocotb.test()
async def mptc_system(dut) -> None:
    """What a system of the two-level drive does beside what both have in common."""
    given = arguments()
    family, sensorless = given["FAMILY"], given["SENSORLESS"]
    system = System(dut, given | {"controller": "mptc"})
    await system.begin()
    board, bus = system.board, system.bus
    wanted = dict.fromkeys(bus.registers["system.capabilities"][1], 0)
    wanted |= {"controller": 2, "flux_control": 1, "family": int(family)}
    wanted |= {"sensorless": int(sensorless), "observer": int(sensorless or not family)}
    await capabilities(system, wanted | {"least_dead_time": 10})
    drive = Drive(system, int(sensorless))
    await drive.load()
    if sensorless:
        await measured_speed(system, drive, 12)
        board.finish({"speed": 12, "capabilities": 1})
        return
    await resets(system, drive, 10)
    await drive.load()
    if family:
        await of_one_vector(system, drive, 20)
        await while_running(system, drive, 24)
        board.finish(
            {"given": 30, "decision": 50, "capabilities": 1, "kept": 24, "still given": 24},
            {"vector": 4},
        )
        return
    for flag in ("early", "invalid", "delayed"):
        board.check("sequencer", await bus.read("result.sequencer", flag), 0, flag)
    await observed(system, drive, 24)
    board.finish({"given": 30, "observed": 24, "flux": 24, "sequencer": 3, "capabilities": 1})
