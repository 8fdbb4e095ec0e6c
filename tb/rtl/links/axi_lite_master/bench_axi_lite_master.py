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
#: Outputs that are low after a reset.
AT_REST = ("awvalid", "wvalid", "arvalid", "bready", "rready", "done")


class Slave:
    """Takes and answers at random, or not at all; remembers what it owes."""

    def __init__(self, dut, rng: random.Random) -> None:
        self.dut, self.rng = dut, rng
        self.taken: set[str] = set()
        self.answers = True
        self.code, self.word = 0, 0

    def drive(self) -> dict[str, int]:
        """Inputs of this clock; which channels it takes."""
        dut, rng = self.dut, self.rng
        ready = {c: int(self.answers and rng.random() < 0.4) for c in ("aw", "w", "ar")}
        for name, value in ready.items():
            getattr(dut, f"{name}ready").value = value
        answers = self.answers and rng.random() < 0.5
        dut.bvalid.value = int(answers and self.taken == {"aw", "w"})
        dut.rvalid.value = int(answers and self.taken == {"ar"})
        dut.bresp.value = dut.rresp.value = self.code
        dut.rword.value = self.word
        return ready

    def look(self, ready: dict[str, int]) -> None:
        """Remember what is taken; forget an access that ends."""
        if number(self.dut.bvalid) or number(self.dut.rvalid):
            self.taken = set()
        for name, value in ready.items():
            if value and lowest_bit(getattr(self.dut, f"{name}valid")):
                self.taken.add(name)


async def access(
    dut, clock: Clock, rng: random.Random, slave: Slave, *, write: bool, address: int
) -> dict:
    """One access; what was seen."""
    word = rng.getrandbits(32)
    slave.code, slave.word = rng.choice([0, 0, 2, 3]), rng.getrandbits(32)
    dut.start.value, dut.write.value = 1, int(write)
    dut.address.value, dut.wdata.value = address, word
    slave.look(slave.drive())
    await clock.tick()
    dut.start.value = 0
    dut.address.value, dut.wdata.value = rng.getrandbits(16), rng.getrandbits(32)
    channels = ("aw", "w") if write else ("ar",)
    seen = {"offers": 0, "clocks": 0, "wrong": 0}
    seen["want"] = (slave.code, 0 if write else slave.word)
    while not lowest_bit(dut.done):
        seen["clocks"] += 1
        assert seen["clocks"] < 100, "no end of the access"
        ready = slave.drive()
        await clock.settle()
        for name in ("aw", "w", "ar"):
            if not lowest_bit(getattr(dut, f"{name}valid")):
                continue
            seen["offers"] += 1
            seen["wrong"] += int(name not in channels or name in slave.taken)
            if name == "w":
                seen["wrong"] += int(number(dut.wword) != word)
            else:
                seen["wrong"] += int(number(getattr(dut, f"{name}addr")) != address)
        slave.look(ready)
        await clock.edge()
    for name in ("awready", "wready", "arready", "bvalid", "rvalid"):
        getattr(dut, name).value = 0
    seen["got"] = (number(dut.response), number(dut.rdata))
    return seen


@cocotb.test()
async def accesses(dut) -> None:
    """Reads and writes, addresses that are none; a slave that answers late, and what follows."""
    given = arguments()
    rng, board, clock = random.Random(6), Scoreboard(), Clock(dut)
    for name in QUIET:
        getattr(dut, name).value = 0
    for round_ in range(4):
        if round_:
            # in the middle of an access, which nobody takes
            dut.start.value, dut.write.value, dut.address.value = 1, round_ % 2, 0
            await clock.tick()
            dut.start.value = 0
            await clock.tick()
        await clock.reset()
        offered = {name: str(getattr(dut, name).value) for name in AT_REST}
        board.check("reset", offered, dict.fromkeys(AT_REST, "0"))
        slave = Slave(dut, rng)
        for n in range(given["accesses"]):
            # outside, crooked, or a register's
            address = 4 * rng.randrange(256)
            kind = rng.random()
            if kind < 0.1:
                address |= 1 << rng.randrange(10, 16)
            elif kind < 0.2:
                address |= rng.randrange(1, 4)
            seen = await access(dut, clock, rng, slave, write=bool(n % 2), address=address)
            if kind < 0.2:
                want = (3 if kind < 0.1 else 2, 0)
                board.check("no register", (seen["got"], seen["offers"]), (want, 0), hex(address))
                continue
            board.check("answer", seen["got"], seen["want"], f"access {n}")
            board.check("offer", seen["wrong"], 0, f"access {n}")
        slave.answers = False
        write = bool(round_ % 2)
        address = 4 * rng.randrange(256)
        seen = await access(dut, clock, rng, slave, write=write, address=address)
        board.check("given up", seen["got"], (2, 0))
        board.check("time", seen["clocks"], given["LIMIT"] + 1)
        # it is still offered, and nothing else is
        offer = [lowest_bit(getattr(dut, f"{name}valid")) for name in ("aw", "w", "ar")]
        board.check("owed", offer, [write, write, not write])
        for n in range(4):
            seen = await access(dut, clock, rng, slave, write=bool(n % 2), address=4 * n)
            board.check("owed", (seen["got"], seen["clocks"]), ((2, 0), 1))
            place = dut.awaddr if write else dut.araddr
            board.check("owed", number(place), address, "the access under way has changed")
        # the slave answers at last: the answer is dropped, the bus goes on
        slave.answers = True
        for _ in range(60):
            ready = slave.drive()
            await clock.settle()
            slave.look(ready)
            await clock.edge()
            board.check("dropped", lowest_bit(dut.done), 0)
        dut.bvalid.value = dut.rvalid.value = 0
        seen = await access(dut, clock, rng, slave, write=True, address=0x0C)
        board.check("goes on", seen["got"], seen["want"])
        seen = await access(dut, clock, rng, slave, write=False, address=0x0C)
        board.check("goes on", seen["got"], seen["want"])
        # an answer on the channel that nothing was asked on ends nothing
        write = round_ % 2
        stray = dut.rvalid if write else dut.bvalid
        stray.value, dut.start.value = 1, 1
        dut.write.value, dut.address.value = write, 0
        for _ in range(6):
            await clock.tick()
            dut.start.value = 0
            board.check("stray", lowest_bit(dut.done), 0)
        stray.value = 0
    least = {"stray": 24, "owed": 36, "goes on": 8, "no register": 20, "reset": 4}
    board.finish({"answer": 2 * given["accesses"], **least})
