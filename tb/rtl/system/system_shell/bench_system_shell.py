"""Cocotb side of ``test_system_shell``."""

from __future__ import annotations

import cocotb
import numpy as np
from cocotb.triggers import FallingEdge

from directmpc.host import registers
from scripts.hdl import states
from tb.helpers import mptc_rows
from tb.helpers.scoreboard import arguments, number
from tb.rtl.system.bench_system import System, near, widest
from tb.rtl.system.bus import OKAY, SLVERR

SETTINGS = {
    "watchdog": 60_000, "decision_limit": 59_000, "current_limit": 32_766, "link_high": 65_534,
    "link_low": 1, "dead_time": 12, "minimum_on": 14, "minimum_off": 1,
}  # fmt: skip
DEAD_TIME = 240  # clocks, of commutations that are looked at
TRIES = 4_000


#: Least checks of `old`.
OLD = {"before": 2, "missing": 1, "off": 1, "all but one": 1}


async def bus_source(system: System) -> None:
    """Measurements come from the ports again."""
    await system.bus.write("system.control", enable=0, registers_as_source=0)


async def commit(system: System) -> None:
    """What was written, in force."""
    await system.bus.write("system.command", commit=1)
    await system.settled()


async def settings(system: System, **others: int) -> None:
    """The guard's settings, with the gates disabled."""
    for name, value in (SETTINGS | others).items():
        _, fields = system.bus.registers[f"guard.{name}"]
        await system.bus.write(f"guard.{name}", **{next(iter(fields)): value})
    await widest(system)
    await commit(system)


def shipped(system: System) -> dict[str, int]:
    """Parameters of the drive that the controller ships with."""
    five = system.controller == "mpdcc"
    drive = states.shipped("anpc5l_6kv") if five else mptc_rows.shipped("induction_2kw2")
    found = registers.values(drive).words
    return {
        n: found.get(f"parameters.{n}", 0) for n in system.words if not system.words[n].optional
    }


async def flags(system: System) -> None:
    """A flag tells of a decision, once."""
    bus, board, rng = system.bus, system.board, system.rng
    parameters = dict.fromkeys(system.words, 0) | shipped(system) | {"method_mpfc": 1}
    await system.write_parameters({n: parameters[n] for n in shipped(system)})
    await commit(system)
    await bus.write("system.control", own_positions=0)
    loop = mptc_rows.recorded("induction_2kw2", "MPFC", 800.0, 5.0, 120).measurements
    for wanted in ((0, 0), (1, 0), (0, 1), (1, 1), (0, 0)):
        for _ in range(TRIES):
            m = system.any_measurements()
            if rng.random() < 0.5:
                m |= dict(zip(system.inputs, map(int, rng.choice(list(loop))), strict=False))
            if rng.random() < 0.3:
                m |= {"torque_ref": 32_767, "psi_ref": 100}
            if system.model(parameters, m)[1:] == wanted:
                break
        else:
            raise AssertionError(f"no decision has the flags {wanted}")
        await bus.write("system.flags", saturated=1, clamped=1)
        await system.decide(m)
        board.check("decision", system.decided()[1:], wanted)
        shown = [await bus.read("system.flags", name) for name in ("saturated", "clamped")]
        board.check("flags", tuple(shown), wanted)
        # cleared, they stay so, whatever the decision still says
        await bus.write("system.flags", saturated=1, clamped=1)
        shown = [await bus.read("system.flags", name) for name in ("saturated", "clamped")]
        board.check("cleared", tuple(shown), (0, 0), wanted)


async def commutations(system: System) -> None:
    """The status tells of a commutation while it lasts."""
    bus, board, dut = system.bus, system.board, system.dut
    await settings(system, dead_time=DEAD_TIME)
    await system.write_parameters(shipped(system))
    await commit(system)
    dut.enable.value = 1
    await bus.write("system.control", enable=1, own_positions=1)
    loop = mptc_rows.recorded("induction_2kw2", "MPTC", 800.0, 5.0, 400).measurements
    for n, row in enumerate(np.asarray(loop)[:24]):
        await system.decide(dict(zip(system.inputs, map(int, row), strict=False)) | {"u": 0})
        for _ in range(20):
            await FallingEdge(dut.clk)
        resting = number(dut.i_shell.is_resting)
        status = await bus.read("system.status", "commutating")
        if number(dut.i_shell.is_resting) == resting:
            board.check("commutating", status, 1 - resting, f"decision {n}")
            board.cover("moves", int(not resting))
        for _ in range(4 * DEAD_TIME):
            await FallingEdge(dut.clk)
        board.check("rests", await bus.read("system.status", "commutating"), 0, f"decision {n}")
    board.check("no fault", number(dut.faults), 0)
    await bus.write("system.control", enable=0)


async def copied(system: System, rounds: int) -> None:
    """Shadows of parameters stay as they are until all have been copied."""
    bus, board = system.bus, system.board
    words = shipped(system)
    await system.write_parameters(words)
    await commit(system)
    await bus.write("system.control", own_positions=0)
    address, fields = bus.registers["parameters.bound_current"]
    mask = (1 << fields["value"][1]) - 1
    for n in range(rounds):
        await bus.write("system.command", commit=1)
        for _ in range(3 * n):
            await FallingEdge(system.dut.clk)
        waits = number(system.dut.load_waits)
        response = await bus.write_word(address, (words["bound_current"] ^ 0x55) & mask)
        if waits:
            board.check("copied", response, SLVERR, f"{3 * n} clocks behind a commit")
        await system.settled()
        # the others are as they were committed
        await bus.write_word(address, words["bound_current"] & mask)
        board.cover("while copied", waits)


async def not_in_force(system: System, rounds: int) -> None:
    """A setting whose commit waits for a decision is not in force: no enable."""
    bus, board, rng, dut = system.bus, system.board, system.rng, system.dut
    control, _ = bus.registers["system.control"]
    await bus.write_word(control, 0)
    for n in range(rounds):
        await bus.write("guard.watchdog", clocks=50_000 + n)
        deciding = cocotb.start_soon(system.decide(near(system, rng)))
        for _ in range(4):
            await FallingEdge(dut.clk)
        await bus.write("system.command", commit=1)
        for _ in range(rng.randrange(4)):
            await FallingEdge(dut.clk)
        response = await bus.write_word(control, 1)
        board.check("deciding", number(dut.busy), 1)
        board.check("not in force", response, SLVERR, f"round {n}")
        await deciding
        await system.settled()
        board.check("in force", number(dut.i_shell.i_guard.watchdog), 50_000 + n)
        board.check("enable", await bus.write_word(control, 1), OKAY)
        await bus.write_word(control, 0)


async def late(system: System) -> None:
    """The guard measures a decision from its start, whatever comes between two."""
    bus, board, rng, dut = system.bus, system.board, system.rng, system.dut
    every = dict.fromkeys(bus.registers["system.faults"][1], 1)
    dut.enable.value = 1
    for limit, wanted in ((140, 0), (12, 1), (140, 0), (8, 1)):
        await bus.write("system.control", enable=0)
        await settings(system, decision_limit=limit)
        await bus.write("system.faults", **every)
        await bus.write("system.control", enable=1, own_positions=1)
        for _ in range(3):
            await system.decide(near(system, rng))
            for _ in range(300):
                await FallingEdge(dut.clk)
        for name in every:
            shown = await bus.read("system.faults", name)
            board.check("faults", shown, wanted if name == "late" else 0, f"{name}, limit {limit}")
    await bus.write("system.control", enable=0)


async def old(system: System) -> None:
    """Nothing old reaches a gate: no measurement of before, none twice, none that lacks a part."""
    bus, board, rng, dut = system.bus, system.board, system.rng, system.dut
    five = system.controller == "mpdcc"
    every = dict.fromkeys(bus.registers["system.faults"][1], 1)
    loop = [] if five else mptc_rows.recorded("induction_2kw2", "MPTC", 800.0, 5.0, 60).measurements
    # a decision for the next step takes effect with the next start
    needed = 1 if five else 2

    def measured() -> dict[str, int]:
        if five:
            return near(system, rng)
        return dict(zip(system.inputs, map(int, rng.choice(list(loop))), strict=False)) | {"u": 0}

    async def put(names: list[str]) -> None:
        m = measured()
        for name in names:
            await bus.write(f"measurements.{name}", value=m[name])

    async def start() -> tuple[int, int]:
        """Decide on the registers; whether gates follow, and the flag."""
        await bus.write("system.flags", old_measurement=1)
        await bus.write("system.command", start=1)
        while await bus.read("system.status", "busy"):
            pass
        for _ in range(20):
            await FallingEdge(dut.clk)
        return number(dut.running), await bus.read("system.flags", "old_measurement")

    async def anew() -> None:
        await bus.write("system.control", enable=0, registers_as_source=1, own_positions=1)
        await bus.write("system.faults", **every)

    names = [name for name in system.inputs if not name.startswith("s_prev") and name != "u"]
    dut.enable.value = 1
    await system.write_parameters(shipped(system))
    await anew()
    await settings(system, watchdog=4_000, decision_limit=3_000)
    # measured before the guard was enabled, however whole
    await put(names)
    await bus.write("system.control", enable=1, registers_as_source=1, own_positions=1)
    for n in range(2):
        board.check("before", await start(), (0, 1), f"start {n}")
    # all of them since, once for each start
    for n in range(needed):
        await put(names)
        board.check("new", await start(), (int(n == needed - 1), 0), f"start {n}")
    # starts alone go on: they keep no gate on
    for _ in range(300):
        if not (await start())[0]:
            break
        board.cover("commands alone")
    found = [name for name in every if await bus.read("system.faults", name)]
    board.check("missing", found, ["missing"], str(system.board.covered))
    board.check("off", number(dut.gates), 0)
    # all but one
    await anew()
    await bus.write("system.control", enable=1, registers_as_source=1, own_positions=1)
    for n in range(2):
        await put(names[1:])
        if (await bus.read("system.status", "fault")) == 0:
            board.check("all but one", await start(), (0, 1), f"start {n}")
    await anew()


async def upset(system: System) -> None:
    """A setting in force that changes by itself, and a gate driver's fault, stop the drive."""
    bus, board, rng, dut = system.bus, system.board, system.rng, system.dut
    every = dict.fromkeys(bus.registers["system.faults"][1], 1)

    async def found() -> list[str]:
        return [name for name in every if await bus.read("system.faults", name)]

    async def runs() -> None:
        await bus.write("system.control", enable=0)
        dut.driver_fault.value = 0
        await settings(system)
        await bus.write("system.faults", **every)
        await bus.write("system.control", enable=1, own_positions=1)
        for _ in range(4):
            # gates have been off for their times by then
            for _ in range(80):
                await FallingEdge(dut.clk)
            await system.decide(near(system, rng))
        for _ in range(20):
            await FallingEdge(dut.clk)
        context = f"faults {number(dut.faults):x}, live {dut.i_shell.live.value}"
        board.check("runs", number(dut.running), 1, context)
        board.check("settings", await bus.read("system.status", "in_force"), 1)

    for bit in rng.sample(range(48), 4):
        await runs()
        word = dut.i_shell.bands_in_force
        right = number(word)
        word.value = right ^ 1 << bit
        for _ in range(4):
            await FallingEdge(dut.clk)
        board.check("stopped", number(dut.running), 0, f"bit {bit}")
        board.check("upset", await found(), ["upset"], f"bit {bit}")
        board.check("settings", await bus.read("system.status", "in_force"), 0)
        # it does not go away by itself
        await bus.write("system.control", enable=0)
        await bus.write("system.faults", **every)
        await bus.write("system.control", enable=1, own_positions=1)
        board.check("again", await found(), ["upset"], f"bit {bit}")
        word.value = right
    await runs()
    dut.driver_fault.value = 1
    for _ in range(2):
        await FallingEdge(dut.clk)
    board.check("stopped", number(dut.running), 0)
    board.check("driver", await found(), ["driver"])
    await bus.write("system.control", enable=0)
    dut.driver_fault.value = 0
    await bus.write("system.faults", **every)


@cocotb.test()
async def system_shell(dut) -> None:
    """The shell of either system."""
    given = arguments()
    system = System(dut, given)
    await system.begin()
    if given["controller"] == "mptc":
        await flags(system)
        await old(system)
        await bus_source(system)
        await commutations(system)
        system.board.finish(
            {"flags": 5, "cleared": 5, "commutating": 16, "rests": 24} | OLD,
            {"moves": 3, "commands alone": 2},
        )
        return
    await copied(system, 26)
    await not_in_force(system, 8)
    await old(system)
    await bus_source(system)
    await late(system)
    await upset(system)
    least = {"upset": 4, "again": 4, "driver": 1, "runs": 5} | {
        "copied": 10,
        "not in force": 8,
        "in force": 8,
        "enable": 8,
        "faults": 36,
    }
    system.board.finish(least | OLD, {"while copied": 10, "commands alone": 2})
