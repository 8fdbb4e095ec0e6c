"""Cocotb side of ``test_mptc_observer``."""

from __future__ import annotations

import random

import cocotb
import numpy as np

from directmpc.mptc import formats as f
from directmpc.mptc import observer
from scripts.hdl.clocks import clocks_of
from tb.helpers import mptc_rows as core
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

LATENCY = clocks_of("mptc_observer", "latency")
#: Ports that are sampled with start, with their bits.
SAMPLED = {"is_alpha": 16, "is_beta": 16, "omega_r": 16, "v_dc": 16, "u": 3}


@cocotb.test()
async def steps_without_a_pause(dut) -> None:
    """The next step begins with `valid`."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    coefficients = observer.coefficients(core.shipped("motulator_2kw2"))
    for name, value in coefficients.items():
        getattr(dut, f"c_{name}").value = bits(value, f.WORD_WIDTH)
    dut.start.value = 0
    await clock.reset(2)
    state = np.zeros(4, dtype=np.int64)
    for n in range(given["steps"]):
        m = np.array([word(rng, 16) >> 3 for _ in range(3)] + [rng.randrange(2**15, 2**16)])
        u = rng.randrange(8)
        wanted = observer.step_words(observer.array(coefficients), state, m, u)
        for name, value in zip(SAMPLED, [*m, u], strict=True):
            getattr(dut, name).value = bits(int(value), SAMPLED[name])
        dut.start.value = 1
        for k in range(1, LATENCY + 1):
            await clock.tick()
            for name, width in SAMPLED.items():
                getattr(dut, name).value = rng.getrandbits(width)
            dut.start.value = 0
            await clock.settle()
            place = f"clock {k} of step {n}"
            board.check("valid", number(dut.valid), int(k == LATENCY), place)
            board.check("busy", number(dut.busy), int(k < LATENCY), place)
        got = signed(number(dut.psis_alpha), 16), signed(number(dut.psis_beta), 16)
        board.check("estimate", (*got, number(dut.saturated)), tuple(int(v) for v in wanted))
    board.finish({"estimate": given["steps"], "busy": LATENCY * given["steps"]})
