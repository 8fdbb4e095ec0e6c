"""Cocotb side of ``test_kbest_system``."""

from __future__ import annotations

import cocotb
from cocotb.triggers import FallingEdge

from directmpc.kbest import bit_true, coefficients
from tb.helpers.scoreboard import arguments, number
from tb.rtl.system.bench_system import System
from tb.rtl.system.mpdcc_system.bench_mpdcc_system import (
    POSITIONS,
    capabilities,
    commit,
    forgotten,
    handed_over,
    parameters_alone,
    resets,
    shipped,
    state_near,
)

#: Words of settings that no drive file has.
OUT_OF_RANGE = ({"short_stages": 0}, {"short_stages": 15}, {"weight_neutral": 15})


async def hurried(system: System, count: int, throttled: int) -> None:
    """Starts and commits right behind a decision, while the core gathers its plan."""
    bus, board, rng, dut = system.bus, system.board, system.rng, system.dut
    base = shipped(system)
    values = [base | {"compensate": n, "effort": base["effort"] << n} for n in range(2)]
    chosen = coefficients.registers(system.shipped())
    gather = chosen.stages + 2
    await commit(system, values[0])
    await bus.write("system.control", own_positions=1)
    await bus.write("system.command", reset_observer=1)
    system.forget()
    last, known = [0, 0, 0], values[0]
    bus.throttle(0.4 * throttled)
    await FallingEdge(dut.clk)
    for n in range(count):
        m = state_near(system) | dict(zip(POSITIONS, last, strict=True))
        wanted = system.follow(known, m)
        system.put(m)
        dut.start.value = 1
        await FallingEdge(dut.clk)
        dut.start.value = 0
        system.put(system.any_measurements())
        clocks = 0
        while not number(dut.valid):
            clocks += 1
            assert clocks < 3_000, "no decision"
            await FallingEdge(dut.clk)
        board.check("hurried", system.decided(), wanted, f"decision {n}")
        bound = bit_true.most_clocks(chosen) + 30 + gather + 50
        board.check("in time", clocks < bound, True, f"decision {n}: {clocks}")
        board.longest("clocks", clocks)
        last = wanted[:3]
        if n % 3 == 2:
            known = values[n // 3 % 2]
            await bus.write("parameters.compensate", value=known["compensate"])
            await bus.write("parameters.effort", value=known["effort"])
            await bus.write("system.command", commit=1)
            await system.settled()
            await FallingEdge(dut.clk)
        else:
            for _ in range(rng.choice([1, 1, 2, gather - 1, gather, gather + 1])):
                board.cover("gathering", number(dut.core_busy))
                await FallingEdge(dut.clk)
    bus.throttle(0.0)


async def ends(system: System) -> None:
    """A decision ends, whatever the settings; also with those that a reset leaves."""
    base = shipped(system)
    for words in (dict.fromkeys(base, 0), *(base | words for words in OUT_OF_RANGE)):
        await commit(system, words)
        for _ in range(3):
            await system.decide(state_near(system))
            system.board.cover("ended")
    await system.bus.write("system.command", reset_observer=1)
    system.forget()


@cocotb.test()
async def system(dut) -> None:
    """What a system of K-best does beside what all have in common."""
    given = arguments()
    under_test = System(dut, given | {"controller": "kbest"})
    await under_test.begin()
    board = under_test.board
    if given["only"]:
        await hurried(under_test, given["rounds"], given["throttled"])
        board.finish({"hurried": given["rounds"]}, {"gathering": given["rounds"] // 3})
        return
    names = under_test.bus.registers["system.capabilities"][1]
    built = dict.fromkeys(names, 0) | {
        "controller": 3, "capacitor_filter": 1, "observer": 1, "least_dead_time": 10
    }  # fmt: skip
    await capabilities(under_test, built)
    await ends(under_test)
    await parameters_alone(under_test)
    assert not [name for name in board.covered if name.startswith("without effect")]
    await handed_over(under_test)
    await forgotten(under_test)
    await resets(under_test, given["rounds"])
    board.finish(
        {"alone": 20, "back": 20, "decision": 3 * given["rounds"], "quiet": 200 * given["rounds"],
         "handed over": 3, "forgotten": 24},
        {"ended": 12, "waited": given["rounds"] // 6},
    )  # fmt: skip
