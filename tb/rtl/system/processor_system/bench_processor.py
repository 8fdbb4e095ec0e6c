"""Cocotb side of ``test_processor``: the compiled driver controls a drive through the bus."""

from __future__ import annotations

import random
from pathlib import Path

import cocotb
import numpy as np
from cocotb.task import bridge, resume
from cocotb.triggers import ClockCycles, First, RisingEdge, Timer

from directmpc.api.drive_file import load_drive
from directmpc.host.gate_guard import FAULTS
from directmpc.mpdcc import coefficients
from directmpc.mpdcc import observer as rotor_flux_observer
from directmpc.mpdcc.bit_true import common, fast
from directmpc.mpdcc.closed_loop import OperatingPoint, constant_profile, initial_conditions
from directmpc.mpdcc.plant import Plant
from tb.helpers.scoreboard import Scoreboard, arguments
from tb.rtl.system.bus import OKAY, Bus
from tb.rtl.system.processor_system.driver import OK, TRIPPED, Driver

#: Clocks within which a decision has to interrupt, one explorer.
LONGEST_DECISION = 400
EXTERNAL = 1 << FAULTS.index("external_trip")


RAILS = 0x09_09_09
"""S1 and S4 of the legs."""
CLOCK = 100e6
"""Clock that the driver's times are counted in, Hz, as in test_processor."""


class Rig:
    """The system's bus as the driver sees it, and the model's decision on what it measures."""

    def __init__(self, dut, given) -> None:
        self.dut, self.board = dut, Scoreboard()
        self.bus = Bus(dut, "mpdcc", random.Random(given["seed"]))
        self.driver = Driver(Path(given["library"]), resume(self.write), resume(self.read))
        drive = load_drive(given["drive"])
        self.drive = drive
        self.register = coefficients.registers(drive, "fast").array()
        found, _ = rotor_flux_observer.coefficients(drive)
        self.observer = rotor_flux_observer.array(found)
        self.estimate = np.zeros(rotor_flux_observer.STATE_WORDS, dtype=np.int64)
        self.profile = constant_profile(drive, OperatingPoint(0.3), 400)
        state, _ = initial_conditions(self.profile)
        self.plant = Plant(drive, float(self.profile.omega_r[0]), state=state)
        self.applied = np.zeros(3, dtype=np.int64)  # own positions after a reset
        self.step = 0

    async def write(self, address: int, word: int) -> None:
        """A write of the driver's."""
        if await self.bus.write_word(address, word) != OKAY:
            raise OSError(address)

    async def read(self, address: int) -> int:
        """A read of the driver's."""
        word, response = await self.bus.read_word(address)
        if response != OKAY:
            raise OSError(address)
        return word

    async def call(self, name: str, *given: object) -> int:
        """A function of the driver, while the simulation goes on."""
        return await bridge(getattr(self.driver, name))(*given)

    def measure(self) -> tuple[int, ...]:
        """Set what the driver measures; the model's decision on it."""
        x, k, profile = self.plant.state, self.step, self.profile
        state = self.driver.state
        state.current[:] = x[0:2]
        state.reference[:] = (profile.iref[k].real, profile.iref[k].imag)
        state.v_n, state.v_dc = x[4], profile.vdc[k]
        state.v_ph[:] = x[5:8]
        state.omega_s, state.omega_r = profile.omega_s[k], self.plant.omega_r
        words, _ = common.encode_row(
            x[:4],
            x[4:],
            profile.vdc[k],
            np.array([profile.iref[k].real, profile.iref[k].imag]),
            profile.omega_s[k],
            self.plant.omega_r,
        )
        seen = words[[0, 1, 4, 5, 6, 7, 8, 12]]
        flux = rotor_flux_observer.step_words(self.observer, self.estimate, seen, self.applied)
        words[2:4] = flux[:2]
        return tuple(int(v) for v in fast.decide_words(self.register, words, self.applied))

    async def interrupted(self, longest: int = LONGEST_DECISION) -> None:
        """Wait for the interrupt."""
        if not int(self.dut.interrupt.value):
            late = Timer(10 * longest, "ns")
            first = await First(RisingEdge(self.dut.interrupt), late)
            assert first is not late, f"interrupt: none within {longest} clocks, expected one"

    async def period(self) -> None:
        """One control period; the decision is the model's."""
        wanted, seen = self.measure(), self.driver.decisions.value
        self.board.check("status", await self.call("drive_period"), OK, "drive_period")
        await self.interrupted()
        self.board.check("status", await self.call("drive_interrupt"), OK, "drive_interrupt")
        self.board.check("decisions", self.driver.decisions.value, seen + 1)
        d = self.driver.decision
        got = (d.s_a, d.s_b, d.s_c, d.held, d.deadlock, d.length, d.saturated)
        self.board.check("decision", got, wanted, f"step {self.step}")
        self.board.longest("cycles", d.cycles)
        await ClockCycles(self.dut.clk, 2)
        self.board.check("interrupt", int(self.dut.interrupt.value), 0, "read")
        self.applied = np.array(got[:3], dtype=np.int64)
        self.plant.step(got[:3])
        self.step += 1
        await ClockCycles(self.dut.clk, 200)

    async def stopped(self, when: str) -> None:
        """A stop: S1 and S4 go off at once, all gates within three dead times."""
        await ClockCycles(self.dut.clk, 4)
        self.board.check("gates", int(self.dut.gates.value) & RAILS, 0, when)
        await ClockCycles(self.dut.clk, 3 * round(self.drive.guard.dead_time * CLOCK) + 1)
        self.board.check("gates", int(self.dut.gates.value), 0, f"{when}, at its end")


@cocotb.test
async def loop(dut) -> None:
    """Start, a closed loop, a trip and a new start, permit taken away, the end."""
    given = arguments()
    rig = Rig(dut, given)
    board = rig.board
    await rig.bus.begin({"permit": 1, "external_trip": 0})
    await ClockCycles(dut.clk, 20)
    board.check("status", await rig.call("drive_begin", rig.driver.bus), OK, "drive_begin")
    board.check("gates", int(dut.gates.value), 0, "before a decision")
    for n in range(given["steps"]):
        rig.bus.throttle(0.3 if n % 3 == 2 else 0.0)
        await rig.period()
    rig.bus.throttle(0.0)
    assert int(dut.gates.value) != 0, "gates: got none on, expected some"

    dut.external_trip.value = 1
    await rig.stopped("tripped")
    dut.external_trip.value = 0
    await rig.interrupted(4)
    board.check("status", await rig.call("drive_interrupt"), TRIPPED, "interrupt of a fault")
    board.check("faults", await rig.read(0x1C), EXTERNAL)
    board.check("status", await rig.call("drive_begin", rig.driver.bus), OK, "a new start")
    board.check("interrupt", int(dut.interrupt.value), 0, "cleared")
    rig.estimate[:] = 0  # a load begins the estimate anew
    await rig.period()
    await rig.period()
    assert int(dut.gates.value) != 0, "gates: got none on, expected some"

    dut.permit.value = 0
    await Timer(1, "ns")  # no edge of the clock
    board.check("gates", int(dut.gates.value), 0, "not permitted")
    dut.permit.value = 1
    await ClockCycles(dut.clk, 20)
    board.check("gates", int(dut.gates.value), 0, "permitted again")
    board.check("status", await rig.call("drive_begin", rig.driver.bus), OK, "a new start")
    rig.estimate[:] = 0
    await rig.period()
    await rig.period()
    assert int(dut.gates.value) != 0, "gates: got none on, expected some"
    board.check("status", await rig.call("drive_end"), OK, "drive_end")
    await rig.stopped("the end")
    rig.bus.running = False
    board.finish({"decision": given["steps"] + 4, "gates": 7})
