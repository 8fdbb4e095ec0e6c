"""Cocotb side of ``test_explorer_paper``."""

from __future__ import annotations

import random

import cocotb
import numpy as np

from tb.helpers import plain
from tb.helpers.mpdcc_ports import example, pack_candidate, unpack_result
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

#: Clocks after which a candidate has been evaluated and waits for its cost.
EVALUATED = 60
#: Clocks from the hand-over to the cost until its result is shown: of a dead candidate, of another.
COSTED = {False: 1, True: 9}


@cocotb.test()
async def a_taker_that_stalls(dut) -> None:
    """Three candidates of a node; results are taken late."""
    given = arguments()
    rng = random.Random(given["seed"])
    generator = np.random.default_rng(given["seed"])
    board, clock = Scoreboard(), Clock(dut)

    def idle() -> None:
        dut.candidate_valid.value = dut.result_ready.value = 0
        dut.candidate.value = rng.getrandbits(20)

    async def tick(clocks: int = 1) -> None:
        for _ in range(clocks):
            idle()
            await clock.tick()

    for name in ("best_valid", "best_cost", "limits", "node", "band", "capacitor", "last"):
        getattr(dut, name).value = 0
    idle()
    await clock.reset(3)
    for n in range(given["nodes"]):
        node, limits, s_prev = example(rng, generator, n)
        dut.node.value, dut.limits.value = plain.pack_node(node), limits.pack()
        chosen = rng.sample(plain.candidates(s_prev), 3)
        wanted = [plain.evaluate(node, limits, s, effort) for s, effort in chosen]

        async def offer(m: int, s_prev=s_prev, chosen=chosen) -> None:
            s, effort = chosen[m]
            idle()
            dut.candidate.value = pack_candidate(0, plain.choices(s_prev, s), s, effort)
            dut.candidate_valid.value = 1
            await clock.settle()
            board.check("ready", number(dut.candidate_ready), 1, f"candidate {m}")
            await clock.edge()

        def shown(m: int, valid: int, wanted=wanted, s_prev=s_prev, chosen=chosen) -> None:
            board.check("result in its clock", number(dut.result_valid), valid, f"candidate {m}")
            if valid:
                got = unpack_result(number(dut.result))
                board.check("index", got["index"], plain.choices(s_prev, chosen[m][0]))
                board.check("feasible", got["feasible"], int(wanted[m].feasible))
                board.check("length", got["length"], wanted[m].length)

        await offer(0)
        await tick(EVALUATED)
        await offer(1)
        await tick(EVALUATED)
        for m in range(3):
            # the clock that takes a result hands the next candidate over
            idle()
            dut.result_ready.value = 1
            await clock.settle()
            shown(m, 1)
            if m < 2:
                board.check("waits", number(dut.candidate_ready), 0, f"candidate {m + 1}")
            await clock.edge()
            if m == 2:
                break
            clocks = COSTED[wanted[m + 1].feasible]
            board.cover("alive" if wanted[m + 1].feasible else "dead")
            for k in range(1, clocks):
                idle()
                await clock.settle()
                shown(m + 1, 0)
                board.check("free", number(dut.candidate_ready), 1, f"clock {k}")
                await clock.edge()
            await clock.settle()
            shown(m + 1, 1)
            if m == 0:
                await offer(2)
                await tick(EVALUATED)
        await tick(2)
        board.check("idle", number(dut.busy), 0)
    board.finish(
        {"result in its clock": 3 * given["nodes"], "waits": 2 * given["nodes"]},
        {"alive": given["nodes"] // 4, "dead": given["nodes"] // 4},
    )
