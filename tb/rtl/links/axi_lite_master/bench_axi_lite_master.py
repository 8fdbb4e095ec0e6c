"""Cocotb side of ``test_axi_lite_master``."""

from __future__ import annotations

import random

import cocotb

from tb.helpers.scoreboard import Clock, Scoreboard, arguments, lowest_bit, number

#: Inputs that stand still until a slave or a caller sets them.
QUIET = (
    "start", "write", "address", "wdata", "awready", "wready", "bvalid", "bresp", "arready",
    "rvalid", "rword", "rresp",
)  # fmt: skip
OFFERS = ("awvalid", "wvalid", "arvalid")


async def access(dut, clock: Clock, rng: random.Random, *, write: bool, answers: bool) -> dict:
    """One access with a slave that takes and answers at random, or never; what was seen."""
    address, word = rng.getrandbits(10), rng.getrandbits(32)
    code, answer = rng.choice([0, 0, 2, 3]), rng.getrandbits(32)
    dut.start.value, dut.write.value = 1, int(write)
    dut.address.value, dut.wdata.value = address, word
    await clock.tick()
    dut.start.value = 0
    dut.address.value, dut.wdata.value = rng.getrandbits(10), rng.getrandbits(32)
    channels = ("aw", "w") if write else ("ar",)
    taken: set[str] = set()
    seen = {"offers": 0, "clocks": 0, "want": (code, 0 if write else answer), "wrong": 0}
    while not lowest_bit(dut.done):
        seen["clocks"] += 1
        assert seen["clocks"] < 100, "no end of the access"
        ready = {c: int(answers and rng.random() < 0.4) for c in ("aw", "w", "ar")}
        for name, value in ready.items():
            getattr(dut, f"{name}ready").value = value
        answered = "b" if write else "r"
        response = answers and taken == set(channels) and rng.random() < 0.5
        getattr(dut, f"{answered}valid").value = int(response)
        dut.bresp.value = dut.rresp.value = code
        dut.rword.value = answer
        await clock.settle()
        for name in ("aw", "w", "ar"):
            if not lowest_bit(getattr(dut, f"{name}valid")):
                continue
            seen["offers"] += 1
            seen["wrong"] += int(name not in channels or name in taken)
            if name == "w":
                seen["wrong"] += int(number(dut.wword) != word)
            else:
                seen["wrong"] += int(number(getattr(dut, f"{name}addr")) != address)
            if ready[name]:
                taken.add(name)
        await clock.edge()
    for name in ("awready", "wready", "arready", "bvalid", "rvalid"):
        getattr(dut, name).value = 0
    seen["got"] = (number(dut.response), number(dut.rdata))
    return seen


@cocotb.test()
async def accesses(dut) -> None:
    """Reads and writes; then a slave that never answers, and what follows it."""
    given = arguments()
    rng, board, clock = random.Random(6), Scoreboard(), Clock(dut)
    for name in QUIET:
        getattr(dut, name).value = 0
    for _ in range(3):
        await clock.reset()
        for n in range(given["accesses"]):
            seen = await access(dut, clock, rng, write=bool(n % 2), answers=True)
            board.check("answer", seen["got"], seen["want"], f"access {n}")
            board.check("offer", seen["wrong"], 0, f"access {n}")
        seen = await access(dut, clock, rng, write=bool(rng.random() < 0.5), answers=False)
        board.check("given up", seen["got"], (2, 0))
        board.check("time", seen["clocks"], given["LIMIT"] + 1)
        for n in range(4):
            seen = await access(dut, clock, rng, write=bool(n % 2), answers=True)
            board.check("dead", (seen["got"], seen["offers"], seen["clocks"]), ((2, 0), 0, 1))
    board.finish({"answer": 3 * given["accesses"], "dead": 12})
