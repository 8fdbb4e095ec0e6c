"""Cocotb side of ``test_recorder``."""

from __future__ import annotations

import random

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge, Timer

from directmpc.host.recorder import (
    CAUSES,
    RESULTS_AT,
    STRIDE,
    RecorderModel,
    RecorderStatus,
    Settings,
)
from directmpc.host.registers import packed, registers_of
from tb.helpers.scoreboard import Scoreboard, arguments, number

REGISTERS = registers_of("mpdcc")
OKAY, SLVERR = 0, 2
#: Clocks from a read's address to its word.
LONGEST_READ = 6
#: Clocks behind decided until a record counts; reads in between make it later.
SETTLED = 40
#: Clocks behind begins from which on nothing counts for the step before.
SHUTS = 14


class Rig:
    """A recorder, the step's signals and the host's end of the bus, which does as its gates do."""

    def __init__(self, dut, given: dict, rng: random.Random) -> None:
        self.dut, self.rng, self.board = dut, rng, Scoreboard()
        self.rows = 1 << given["ROWS_LOG2"]
        self.least = given["INPUTS"] + given["RESULTS"] + 9
        self.places = [*range(given["INPUTS"]), *range(RESULTS_AT, RESULTS_AT + given["RESULTS"])]
        self.model = RecorderModel(given["ROWS_LOG2"])
        self.tripped = False
        self.last = [0] * STRIDE

    async def begin(self) -> None:
        """Known values, the clock, a reset."""
        quiet = (
            "begins busy decided deadlock saturated tripped step_words awaddr araddr wdata "
            "m_awvalid m_wvalid m_bready m_arvalid s_awready s_wready s_bvalid s_bresp s_arready "
            "s_rvalid s_rresp"
        )
        for name in quiet.split():
            getattr(self.dut, name).value = 0

        async def run() -> None:
            while True:
                self.dut.clk.value = 0
                await Timer(5, "ns")
                self.dut.clk.value = 1
                await Timer(5, "ns")

        self.dut.m_rready.value = self.dut.rst.value = 1
        cocotb.start_soon(run())
        await self.clocks(3)
        self.dut.rst.value = 0

    async def clocks(self, count: int) -> None:
        """Let time pass."""
        for _ in range(count):
            await RisingEdge(self.dut.clk)

    async def write(self, name: str, response: int = OKAY, **fields: int) -> None:
        """Write a register."""
        dut = self.dut
        address, known = REGISTERS[name]
        dut.awaddr.value, dut.wdata.value = address, packed(name, known, fields)
        dut.m_awvalid.value = dut.m_wvalid.value = 1
        await FallingEdge(dut.clk)
        self.board.check("write taken", number(dut.m_awready) & number(dut.m_wready), 1)
        await RisingEdge(dut.clk)
        dut.m_awvalid.value = dut.m_wvalid.value = 0
        for _ in range(self.rng.choice((1, 1, 3))):
            await FallingEdge(dut.clk)
            self.board.check(
                "write answered", (number(dut.m_bvalid), number(dut.m_bresp)), (1, response)
            )
        dut.m_bready.value = 1
        await RisingEdge(dut.clk)
        dut.m_bready.value = 0

    async def read(self, address: int) -> tuple[int, int]:
        """Read a word, which stands until the gate may take the next answer; word and response."""
        dut = self.dut
        dut.araddr.value, dut.m_arvalid.value = address, 1
        await FallingEdge(dut.clk)
        self.board.check("read taken", number(dut.m_arready), 1)
        await RisingEdge(dut.clk)
        dut.m_arvalid.value = 0
        dut.araddr.value = self.rng.getrandbits(10)
        for age in range(1, LONGEST_READ + 1):
            await FallingEdge(dut.clk)
            if number(dut.m_rvalid):
                self.board.longest("read", age)
                self.board.check("own data", number(dut.own_data), 1)
                found = number(dut.m_rdata), number(dut.m_rresp)
                await RisingEdge(dut.clk)
                dut.m_rready.value = 0
                for _ in range(self.rng.choice((1, 1, 5))):
                    await FallingEdge(dut.clk)
                    self.board.check("data stands", number(dut.m_rdata), found[0])
                    await RisingEdge(dut.clk)
                dut.m_rready.value = 1
                return found
        raise AssertionError("read taken: it is not answered")

    async def status(self) -> RecorderStatus:
        """The register's fields."""
        address, fields = REGISTERS["recorder.status"]
        word, response = await self.read(address)
        self.board.check("response", response, OKAY)
        return RecorderStatus.of(
            {name: word >> low & (1 << width) - 1 for name, (low, width, _) in fields.items()}
        )

    async def row(self, row: int, places: list[int]) -> dict[int, int]:
        """Some words of a row."""
        await self.write("recorder.row", row=row)
        return {
            place: (await self.read(REGISTERS["recorder.record"][0] + 4 * place))[0]
            for place in places
        }

    def record(self) -> list[int]:
        """Words of a step; halves are small now and then, so that levels are met."""
        record = [0] * STRIDE
        for place in self.places:
            halves = [
                self.rng.choice((self.rng.getrandbits(16), self.rng.randrange(-4, 4) & 0xFFFF))
                for _ in range(2)
            ]
            record[place] = halves[0] | halves[1] << 16
        return record

    def put(self, inputs: list[int], results: list[int]) -> None:
        """Words at the port."""
        words = [*inputs[:RESULTS_AT], *results[RESULTS_AT:]]
        self.dut.step_words.value = sum(word << 32 * n for n, word in enumerate(words))

    async def step(self, fast: bool, trips: bool, manual: bool) -> None:
        """A decision, as short as may be or not; a trip or a command within."""
        dut, rng = self.dut, self.rng
        record = self.record()
        flags = {name: rng.random() < 0.1 for name in ("deadlock", "saturated")}
        dut.busy.value = 1
        early = trips and not fast and rng.random() < 0.5  # before the core begins
        for clock in range(rng.choice((0, 12))) if not fast else ():
            dut.tripped.value = int(self.tripped or (early and clock > 5))
            await RisingEdge(dut.clk)
        dut.begins.value = 1
        await RisingEdge(dut.clk)
        dut.begins.value = 0
        self.put(record, self.last)
        length = self.least if fast else self.least + rng.randrange(60)
        when = rng.randrange(SHUTS, length - 1)
        for clock in range(length):
            if clock == when and trips:
                dut.tripped.value = 1
            dut.decided.value = int(clock == length - 1)
            if not (clock == when and manual):
                await RisingEdge(dut.clk)
            else:
                await self.write("recorder.command", trigger=1)
        dut.decided.value = dut.busy.value = 0
        self.put(record, record)
        self.last = record
        for name, value in flags.items():
            getattr(dut, name).value = int(value)
        self.model.step(record, tripped=trips and not self.tripped, manual=manual, **flags)
        for name in CAUSES:
            if self.model.cause[name]:
                self.board.cover(name)
        self.tripped = self.tripped or trips
        await RisingEdge(dut.clk)
        self.put(self.record(), record)  # the next one's may come from here on

    def settings(self) -> Settings:
        """Any."""
        rng = self.rng
        place = rng.choice((rng.choice(self.places), self.places[-1]))
        flags = ("fault", "deadlock", "saturated", "rising", "falling", "equal", "unsigned")
        return Settings(
            **{name: rng.random() < 0.5 for name in flags},
            channel=2 * place + rng.getrandbits(1),
            level=rng.choice((rng.randrange(-4, 4), rng.randrange(-(2**15), 2**15))),
            after=rng.choice((0, 1, rng.randrange(self.rows - 1))),
            decimation=rng.choice((0, 0, 1, 3, 7)),
        )

    async def compare(self) -> None:
        """Status and every row that stands."""
        model, board = self.model, self.board
        found = await self.status()
        want = RecorderStatus(
            self.rows, model.recording, model.triggered,
            tuple(name for name in CAUSES if model.cause[name]), model.row,
            self.rows - 1 if model.full else model.row,
        )  # fmt: skip
        board.check("status", found, want)
        for n in range(1, found.records + 1):
            row = (model.row - n) % self.rows
            words = await self.row(row, self.places)
            for place, word in words.items():
                board.check("record", word, int(model.memory[row, place]), (row, place))


async def sessions(rig: Rig, count: int) -> None:
    """Armed with any settings, steps at any pace, events within and between, read at the end."""
    dut, rng, model, board = rig.dut, rig.rng, rig.model, rig.board
    board.check("status", (await rig.status()).recording, True)
    for session in range(count):
        if session:  # the first goes with what the reset gives
            model.settings = rig.settings()
            for name, fields in model.settings.registers().items():
                await rig.write(name, **fields)
                word, _ = await rig.read(REGISTERS[name][0])
                board.check("settings", word, packed(name, REGISTERS[name][1], fields), name)
            if rng.random() < 0.5:  # else what is latched is no trip any more
                dut.tripped.value, rig.tripped = 0, False
            await rig.clocks(3)
            await rig.write("recorder.command", arm=1)
            await rig.clocks(2)
            model.arm()
        fast = rng.random() < 0.4
        for _ in range(rng.choice((2, rig.rows, 3 * rig.rows))):
            trips, manual = rng.random() < 0.15, not fast and rng.random() < 0.02
            await rig.step(fast, trips and not rig.tripped, manual)
            if fast:
                continue
            await rig.clocks(SETTLED)
            kind = rng.random()
            if kind < 0.1 and not rig.tripped:
                dut.tripped.value, rig.tripped = 1, True
                model.event(tripped=True)
                await rig.clocks(6)
            elif kind < 0.13:
                await rig.write("recorder.command", trigger=1)
                model.event(manual=True)
                await rig.clocks(6)
            elif kind < 0.2:
                await rig.compare()
            elif kind < 0.3 and rig.tripped:
                dut.tripped.value, rig.tripped = 0, False
        await rig.clocks(SETTLED)
        await rig.compare()


async def responses(rig: Rig) -> None:
    """An access that a register does not allow is refused, and so is one of no register."""
    for name, (address, _) in REGISTERS.items():
        if name in ("recorder.command", "recorder.row"):
            rig.board.check("response", (await rig.read(address))[1], SLVERR, name)
        if name in ("recorder.status", "recorder.record"):
            await rig.write(name, SLVERR)
    rig.board.check("response", (await rig.read(REGISTERS["recorder.row"][0] + 4))[1], SLVERR)


async def reads_of_others(rig: Rig) -> None:
    """Nothing is added to the data of another register that is read behind one of its own."""
    dut, board = rig.dut, rig.board
    for _ in range(20):
        await rig.read(REGISTERS[rig.rng.choice(("recorder.status", "recorder.settings"))][0])
        dut.araddr.value, dut.m_arvalid.value, dut.s_arready.value = 0x80, 1, 1
        await RisingEdge(dut.clk)
        dut.m_arvalid.value = dut.s_arready.value = 0
        dut.s_rvalid.value = 1
        await RisingEdge(dut.clk)
        dut.s_rvalid.value = dut.m_rready.value = 0
        await FallingEdge(dut.clk)
        board.check("data of another", (number(dut.m_rdata), number(dut.own_data)), (0, 0))
        await RisingEdge(dut.clk)
        dut.m_rready.value = 1


async def reads_while_it_records(rig: Rig) -> None:
    """A host that reads without a pause, and steps as fast as they may come beside it."""
    rig.model.settings = Settings(fault=False)
    for name, fields in rig.model.settings.registers().items():
        await rig.write(name, **fields)
    await rig.write("recorder.command", arm=1)
    await rig.clocks(2)
    rig.model.arm()
    running = True

    async def host() -> None:
        while running:
            model = rig.model
            whole = [(model.row - n) % rig.rows for n in range(1, rig.rows - 1)]
            row = rig.rng.choice([r for r in whole if model.full or r < model.row] or [0])
            place = rig.rng.choice(rig.places)
            before, known = int(model.memory[row, place]), model.full or row < model.row
            found = (await rig.row(row, [place]))[place]
            if known and (rig.model.row - row) % rig.rows in range(2, rig.rows - 2):
                rig.board.check("record while it runs", found, before, (row, place))

    reader = cocotb.start_soon(host())
    rig.least += 16  # what reads may hold it back
    for _ in range(5 * rig.rows):
        await rig.step(True, False, False)
    running = False
    await reader
    await rig.clocks(SETTLED)
    await rig.compare()


@cocotb.test()
async def everything(dut) -> None:
    """All of the above, one behind the other."""
    given = arguments()
    rig = Rig(dut, given, random.Random(given["seed"]))
    await rig.begin()
    await sessions(rig, given["sessions"])
    await responses(rig)
    await reads_of_others(rig)
    await reads_while_it_records(rig)
    rig.board.finish(
        {
            "record": 200,
            "record while it runs": 10,
            "status": given["sessions"],
            "response": 5,
            "data stands": 200,
            "data of another": 20,
        },
        dict.fromkeys(CAUSES, 1),
    )
