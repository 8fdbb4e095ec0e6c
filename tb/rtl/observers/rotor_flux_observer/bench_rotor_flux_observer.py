"""Cocotb side of ``test_rotor_flux_observer``: step by step against the twin."""

from __future__ import annotations

import random

import cocotb
import numpy as np

from directmpc.mpdcc import observer
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

PORTS = ("is_alpha", "is_beta", "v_n", "v_ph_a", "v_ph_b", "v_ph_c", "v_dc", "omega_r")
SIGNED = {"is_alpha", "is_beta", "v_n", "omega_r"}
LATENCY = clocks_of("rotor_flux_observer", "latency")
BUSY = clocks_of("rotor_flux_observer", "busy")


def inputs(rng: random.Random, n: int) -> np.ndarray:
    """Measurements: a turning machine, or anything."""
    if n % 3 == 2:
        return np.array([word(rng, 16, signed=name in SIGNED) for name in PORTS], dtype=np.int64)
    angle = 0.015 * n
    current = 16_000 * np.exp(1j * angle)
    return np.array(
        [current.real, current.imag, rng.randrange(-900, 900)]
        + [16_000 + rng.randrange(-2000, 2000) for _ in range(3)]
        + [32_000, 15_900],
        dtype=np.int64,
    )


@cocotb.test()
async def steps(dut) -> None:
    """Random and turning inputs; coefficients of drives and of any content; resets in between."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    words = observer.coefficients(states.shipped("anpc5l_6kv"))[0]
    state = np.zeros(observer.STATE_WORDS, dtype=np.int64)
    dut.start.value = 0
    for n in range(given["steps"]):
        if n % 90 == 0:
            await clock.reset(2)
            state[:] = 0
            board.cover("reset")
        c = dict(words)
        if n % 90 >= 60:
            c = {k: word(rng, 18) >> rng.randrange(14) for k in c}
        if n % 90 >= 75:
            # states that grow until they do not fit
            c |= dict.fromkeys(("voltage_alpha", "voltage_beta", "pull", "decay"), 2**17 - 1)
        for key, value in c.items():
            getattr(dut, f"o_{key}").value = bits(value, 18)
        m, s = inputs(rng, n), np.array([rng.randrange(8) for _ in range(3)])
        if n % 90 >= 75:
            s = np.array([7, 7, 0])
            m[2:] = [0, 0, 0, 0, 60_000, m[7]]
        wanted = observer.step_words(observer.array(c), state, m, s)
        for name, value in zip(PORTS, m, strict=True):
            getattr(dut, name).value = bits(int(value), 16) if name in SIGNED else int(value)
        for name, value in zip("abc", s, strict=True):
            getattr(dut, f"s_{name}").value = int(value)
        dut.start.value = 1
        await clock.tick()
        for count in range(1, BUSY + 1):
            for name in PORTS:
                getattr(dut, name).value = rng.getrandbits(16)
            dut.s_a.value = rng.randrange(8)
            dut.start.value = int(rng.random() < 0.5 and count < BUSY)
            await clock.settle()
            board.check("valid", number(dut.valid), int(count == LATENCY), f"step {n}, {count}")
            board.check("busy", number(dut.busy), 1, f"step {n}, {count}")
            if count == LATENCY:
                got = (
                    signed(number(dut.psir_alpha), 16),
                    signed(number(dut.psir_beta), 16),
                    number(dut.saturated),
                )
                board.check("estimate", got, tuple(int(v) for v in wanted), f"step {n}")
            await clock.edge()
        dut.start.value = 0
        await clock.settle()
        board.check("busy", number(dut.busy), 0, f"step {n}")
        if rng.random() < 0.5:
            await clock.edge()
        board.cover("saturated", int(wanted[2]))
        board.cover("fits", int(not wanted[2]))
    board.finish(
        {"estimate": given["steps"]},
        {"reset": 2, "saturated": given["steps"] // 20, "fits": given["steps"] // 3},
    )
