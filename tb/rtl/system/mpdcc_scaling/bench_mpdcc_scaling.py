"""Cocotb side of ``test_mpdcc_scaling``."""

from __future__ import annotations

import cocotb
import numpy as np
from cocotb.triggers import FallingEdge

from directmpc.host import registers
from directmpc.mpdcc import leakage
from directmpc.mpdcc.coefficients import CURRENT_SLOPES, INDEX
from scripts.hdl import states
from tb.helpers.scoreboard import arguments, number
from tb.rtl.system.bench_system import System, near

VOLTAGES = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c")
POSITIONS = ("s_prev_a", "s_prev_b", "s_prev_c")
TRIES = 3_000
REST = 420  # clocks in which everything comes to rest
AROUND = range(-3, 4)  # clocks around the one in which a scaling begins


class Estimator:
    """A system with the leakage estimated, and the twin of the estimate."""

    def __init__(self, system: System) -> None:
        self.system = system
        drive = states.shipped("anpc5l_6kv").with_control(leakage_estimate=True)
        found = registers.values(drive).words
        self.words = {n: found[f"parameters.{n}"] for n in system.words} | {"l_mode": 1}
        self.row = np.array([self.words.get(x, self.words.get(f"c_{x}", 0)) for x in INDEX])
        self.c = leakage.array(leakage.coefficients(drive)[0])
        self.state = leakage.first()

    def slopes(self) -> dict[str, int]:
        """Coefficients of the slopes with the theta of now."""
        values = self.row.copy()
        leakage.scaled(int(self.state[0]) >> leakage.GUARD, self.row, values)
        return {f"c_{x}": int(values[INDEX[x]]) for x in CURRENT_SLOPES}

    def decided(self, m: dict[str, int], slopes: dict[str, int]) -> tuple[int, ...]:
        """The model's decision."""
        return self.system.model(self.words | slopes, m)

    def measurements(self) -> dict[str, int]:
        """A drive's, the current anywhere near its bounds, at some speed."""
        rng = self.system.rng
        m = near(self.system, rng) | {"omega_r": 8_000, "omega_s": 8_000}
        m["is_alpha"] += rng.randrange(-3_000, 3_000)
        return m | {"is_beta": rng.randrange(-3_000, 3_000)}

    def step(self, m: dict[str, int]) -> None:
        """The estimate's step behind a decision."""
        names = (*VOLTAGES, "v_dc", "omega_r", "psir_alpha", "psir_beta")
        measured = np.array([m[x] for x in names])
        leakage.step_words(self.c, self.state, measured, np.array([m[x] for x in POSITIONS]), 0)


async def begin(system: System, m: dict[str, int]) -> None:
    """A start."""
    system.put(m)
    system.dut.start.value = 1
    await FallingEdge(system.dut.clk)
    system.dut.start.value = 0
    system.put(system.any_measurements())


async def until_valid(system: System) -> None:
    """The decision."""
    for _ in range(600):
        if number(system.dut.valid):
            return
        await FallingEdge(system.dut.clk)
    raise AssertionError("no decision")


async def clocks_to(system: System, name: str) -> int:
    """Clocks until a signal of the system is up."""
    for n in range(600):
        if number(getattr(system.dut, name)):
            return n
        await FallingEdge(system.dut.clk)
    raise AssertionError(f"{name} stays down")


async def rest(system: System) -> None:
    """Everything at rest, and on a falling edge."""
    for _ in range(REST):
        await FallingEdge(system.dut.clk)


@cocotb.test()
async def scaling(dut) -> None:
    """A commit and a start in the clock in which the slopes are to be scaled."""
    given = arguments()
    system = System(dut, given | {"controller": "mpdcc"})
    await system.begin()
    board, bus = system.board, system.bus
    estimator = Estimator(system)
    await system.settled()
    await system.write_parameters(estimator.words)
    await bus.write("system.command", commit=1)
    await system.settled()
    await bus.write("system.control", own_positions=0)

    async def plain(*, held: bool) -> dict[str, int]:
        """A decision that keeps the positions or not; its measurements."""
        slopes = estimator.slopes()
        for _ in range(TRIES):
            m = estimator.measurements()
            if bool(estimator.decided(m, slopes)[3]) == held:
                break
        await begin(system, m)
        return m

    # from the write of a commit to the clock in which it waits, from a start to a scaling
    await rest(system)
    asked = cocotb.start_soon(bus.write("system.command", commit=1))
    to_wait = await clocks_to(system, "load_at_rest")
    await asked
    await rest(system)
    m = await plain(held=True)
    to_scale = await clocks_to(system, "scale")
    estimator.step(m)
    await rest(system)
    for n in range(given["rounds"]):
        for offset in AROUND:
            before = estimator.slopes()
            m = await plain(held=True)
            estimator.step(m)
            slopes = estimator.slopes()
            for _ in range(TRIES):
                m = estimator.measurements()
                wanted = estimator.decided(m, slopes)
                if wanted != estimator.decided(m, before):
                    break
            else:
                board.cover("alike")
            start = to_scale + offset
            for k in range(start):
                if k == start - to_wait:
                    asked = cocotb.start_soon(bus.write("system.command", commit=1))
                await FallingEdge(dut.clk)
            dut.start.value = 1
            system.put(m)
            together = number(dut.load_at_rest)
            board.cover("together", together)
            board.cover("at once", int(together and number(dut.stale) and not offset))
            await begin(system, m)
            await until_valid(system)
            where = f"round {n}, {offset} clocks from a scaling"
            board.check("scaled", system.decided(), wanted, where)
            estimator.step(m)
            await asked
            await system.settled()
            await rest(system)
            theta = await bus.read("result.leakage", "theta")
            board.check("theta", theta, int(estimator.state[0]) >> leakage.GUARD, where)
            await FallingEdge(dut.clk)
    count = given["rounds"] * len(AROUND)
    assert board.covered["alike"] <= count // 3, "few decisions depend on the scaling"
    board.finish({"scaled": count}, {"together": count // 2, "at once": 1})
