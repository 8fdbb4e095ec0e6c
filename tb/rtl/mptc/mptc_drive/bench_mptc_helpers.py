"""Cocotb side of ``test_mptc_helpers``: observer, pre-excitation and the joined drive, by steps."""

from __future__ import annotations

import random
from collections.abc import Callable

import cocotb
import numpy as np

from directmpc.mptc import drive_twin as joined
from directmpc.mptc import formats as f
from directmpc.mptc import observer, preexcitation
from directmpc.mptc.coefficients import COEFFICIENTS
from scripts.hdl.clocks import clocks_of
from tb.helpers import mptc_rows as core
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

LATENCY = {
    "mptc_observer": clocks_of("mptc_observer", "latency"),
    "mptc_preexcitation": clocks_of("mptc_preexcitation", "latency"),
}
DRIVE_LATENCY = {
    "mptc": clocks_of("mptc_drive", "mptc"),
    "mpfc": clocks_of("mptc_drive", "mpfc"),
}


async def transaction(
    dut,
    clock: Clock,
    rng: random.Random,
    rows: dict[str, tuple[int, int]],
    waiting: Callable[[], None] = lambda: None,
) -> int:
    """Give inputs (value, width) with start, random ones after it; the clocks until valid.

    `waiting` is called in every clock before that of valid.
    """
    for name, (value, width) in rows.items():
        getattr(dut, name).value = bits(value, width) if value < 0 else value
    dut.start.value = 1
    await clock.tick()
    dut.start.value = 0
    count = 1
    while True:
        for name, (_, width) in rows.items():
            getattr(dut, name).value = rng.getrandbits(width)
        # a start while busy has to be ignored
        dut.start.value = int(count < 8 and rng.random() < 0.5)
        await clock.settle()
        if number(dut.valid):
            dut.start.value = 0
            await clock.edge()
            return count
        waiting()
        assert count < 100, "no valid within 100 clocks"
        await clock.edge()
        count += 1


@cocotb.test()
async def steps(dut) -> None:
    """Random and recorded inputs; resets in between."""
    given = arguments()
    name = given["entity"]
    if name == "mptc_drive":
        await drive(dut, given)
    else:
        await (observe if name == "mptc_observer" else excite)(dut, given, LATENCY[name])


async def observe(dut, given, latency: int) -> None:
    """The observer: a closed loop's currents, then anything."""
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    recorded = core.recorded("motulator_2kw2", "MPTC", 900.0, 7.0, given["steps"])
    words = observer.coefficients(core.shipped("motulator_2kw2"))
    dut.start.value = 0
    state = np.zeros(4, dtype=np.int64)
    last: list[tuple[int, int, int]] = []

    async def step(c: dict[str, int], m: np.ndarray, u: int, place: str) -> int:
        for key, value in c.items():
            getattr(dut, f"c_{key}").value = bits(value, f.WORD_WIDTH)
        names = ("is_alpha", "is_beta", "omega_r", "v_dc")
        rows = {key: (int(m[i]), 16) for i, key in enumerate(names)} | {"u": (u, 3)}
        wanted = observer.step_words(observer.array(c), state, m, u)

        def outputs() -> tuple[int, int, int]:
            alpha, beta = number(dut.psis_alpha), number(dut.psis_beta)
            return signed(alpha, 16), signed(beta, 16), number(dut.saturated)

        def unchanged() -> None:
            if last:
                board.check("stable", outputs(), last[0], place)

        clocks = await transaction(dut, clock, rng, rows, unchanged)
        got = outputs()
        last[:] = [got]
        board.check("estimate", got, tuple(int(v) for v in wanted), place)
        board.check("clocks", clocks, latency, place)
        return int(wanted[2])

    for n in range(given["steps"]):
        wild = n % 3 == 2
        if n % 40 == 0 or n == 0:
            await clock.reset(2)
            state[:] = 0
            board.cover("reset")
        m = recorded.measurements[n][[0, 1, 4, 5]].copy()
        c = dict(words)
        if wild:
            m = np.array([word(rng, 16), word(rng, 16), word(rng, 16), word(rng, 16, signed=False)])
            if n % 2:
                c = {k: word(rng, f.WORD_WIDTH) >> rng.randrange(12) for k in c}
        if n % 40 > 30:
            # states that double with every step
            c |= dict.fromkeys(("rotor", "drop_flux"), f.WORD_HIGH)
        u = int(recorded.u[n]) if not wild else rng.randrange(8)
        board.cover("saturated", await step(c, m, u, f"step {n}"))
    # a flux at its end stays there, half an LSB beyond its port
    none = dict.fromkeys(observer.COEFFICIENTS, 0)
    pushed = none | dict.fromkeys(("current", "gain_stator"), f.WORD_HIGH)
    for alpha, beta in ((2**15 - 1, 0), (0, 2**15 - 1)):
        await clock.reset(2)
        state[:] = 0
        for _ in range(3):
            await step(pushed, np.array([alpha, beta, 0, 0]), 0, "to its end")
        board.cover("port alone", await step(none, np.zeros(4, dtype=np.int64), 0, "at its end"))
        # beyond its end in the last sum of a step alone, back within it in the next step
        await clock.reset(2)
        state[:] = 0
        end = np.array([alpha, beta, 0, 0])
        flagged = await step(pushed | {"drop_flux": f.WORD_HIGH}, end, 0, "beyond its end")
        board.cover("flag alone", flagged - await step(pushed, -end, 0, "back"))
    board.finish({"estimate": given["steps"]}, {"port alone": 2, "flag alone": 2})


async def excite(dut, given, latency: int) -> None:
    """The pre-excitation: values at, below and above both levels."""
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    dut.start.value = 0
    dut.restart.value = 0
    await clock.reset(2)
    done = 0
    for n in range(given["steps"]):
        limit, level = rng.randrange(2**15), rng.randrange(2**15)
        m = np.array([word(rng, 16) for _ in range(4)], dtype=np.int64)
        if n % 4 == 1:
            m[rng.randrange(2)], m[rng.randrange(2)] = 0, limit
            m[1] = 0 if m[0] == limit else m[1]
        if n % 4 == 2:
            m[2:] = rng.choice([(level, 0), (0, -level), (level - 1, 0), (3 * level // 5, 0)])
        if n % 4 != 2:
            m[2:] = m[2:] >> 8
        if rng.random() < 0.3:
            dut.restart.value = 1
            await clock.tick()
            dut.restart.value = 0
            done = 0
            board.cover("restart")
        dut.limit.value, dut.level.value = limit, level
        u, limited, done = preexcitation.decide_words(m, limit, level, done)
        names = ("is_alpha", "is_beta", "psis_alpha", "psis_beta")
        rows = {key: (int(m[i]), 16) for i, key in enumerate(names)}
        clocks = await transaction(dut, clock, rng, rows)
        got = (number(dut.u_next), number(dut.limited), number(dut.finished))
        board.check("decision", got, (int(u), int(limited), int(done)), f"step {n}: {m}")
        board.check("clocks", clocks, latency, f"step {n}")
        board.cover("limited" if limited else "free")
        board.cover("finished" if done else "not yet")
    board.finish(
        {"decision": given["steps"]},
        {"limited": 5, "free": 5, "finished": 5, "not yet": 5, "restart": 5},
    )


async def drive(dut, given) -> None:
    """The joined drive: stretches of periods, each from a reset, with and without magnetising."""
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    dut.start.value = 0
    dut.restart.value = 0
    for stretch in core.stretches(given["seed"], given["steps"]):
        await clock.reset(2)
        state = joined.initial()
        for words in (
            zip(COEFFICIENTS, stretch.parameters.core, strict=False),
            zip(observer.COEFFICIENTS, stretch.parameters.observer, strict=True),
        ):
            for key, value in words:
                getattr(dut, f"c_{key}").value = bits(int(value), f.WORD_WIDTH)
        dut.limit.value = stretch.parameters.limit
        dut.level.value = stretch.parameters.level
        for n, m in enumerate(stretch.measurements):
            if n == stretch.restart_at:
                dut.restart.value = 1
                await clock.tick()
                dut.restart.value = 0
                state[-1] = 0
                board.cover("restart")
            rows = {key: (int(m[i]), width) for i, (key, width) in enumerate(core.DRIVE_INPUTS)}
            rows["excite"] = (stretch.parameters.excite, 1)
            rows["method_mpfc"] = (int(stretch.parameters.core[-1]), 1)
            u, saturated, clamped, exciting = joined.step_words(stretch.parameters, state, m)
            clocks = await transaction(dut, clock, rng, rows)
            got = (
                number(dut.u_next),
                number(dut.switches),
                number(dut.saturated),
                number(dut.clamped),
                number(dut.exciting),
                signed(number(dut.psis_alpha), 16),
                signed(number(dut.psis_beta), 16),
            )
            wanted = (u, int(core.SWITCHES[u]), saturated, clamped, exciting, *state[4:6])
            board.check("decision", got, tuple(int(v) for v in wanted), f"step {n}")
            method = "mpfc" if stretch.parameters.core[-1] else "mptc"
            board.check("clocks", clocks, DRIVE_LATENCY[method], f"step {n}")
            board.cover("exciting" if exciting else "controlling")
            board.cover("saturated", int(saturated))
    board.finish(
        {"decision": 8 * given["steps"]},
        {"exciting": 20, "controlling": 50, "saturated": 5, "restart": 1},
    )
