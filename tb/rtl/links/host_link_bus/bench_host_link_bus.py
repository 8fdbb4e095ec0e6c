"""Cocotb side of ``test_host_link_bus``."""

from __future__ import annotations

import random
from collections.abc import Iterator

import cocotb

from directmpc.host.protocol import Type
from tb.helpers.scoreboard import arguments, number
from tb.rtl.links.host_link.bench_host_link import REGISTERS, UART, Bench, random_request


def pauses(rng: random.Random, share: float) -> Iterator[bool]:
    """Clocks in which a channel of the bus pauses."""
    while True:
        yield rng.random() < share


#: Channels that an access goes through: of a write the first three, of a read the others.
SEEN = {f"WRITE with slow {n}": 3 for n in (0, 1, 2, 5)}
SEEN |= {f"READ with slow {n}": 3 for n in (3, 4, 5)}


@cocotb.test()
async def accesses(dut) -> None:
    """Reads and writes of registers whose bus is slow in one way or another."""
    given = arguments()
    rng = random.Random(given["seed"])
    bench = Bench(dut, UART, 125_000)
    await bench.start()
    channels = (
        bench.ram.write_if.aw_channel, bench.ram.write_if.w_channel, bench.ram.write_if.b_channel,
        bench.ram.read_if.ar_channel, bench.ram.read_if.r_channel,
    )  # fmt: skip
    model = bench.models[UART]
    count = 0
    while count < given["frames"]:
        frame = random_request(rng, model.last)
        if frame.kind not in (Type.READ, Type.WRITE):
            continue
        # one slow channel, or all of them
        slow = rng.choice([0, 1, 2, 5] if frame.kind == Type.WRITE else [3, 4, 5])
        for n, channel in enumerate(channels):
            channel.set_pause_generator(pauses(rng, 0.9 if slow in (n, 5) else 0.0))
        await bench.exchange(UART, frame.wire())
        bench.board.cover(f"{Type(frame.kind).name} with slow {slow}")
        count += 1
    for channel in channels:
        channel.clear_pause_generator()
    for address in range(0, REGISTERS, 4):
        word = int.from_bytes(bench.ram.read(address, 4), "little")
        bench.board.check("register", word, bench.words.get(address, 0), hex(address))
    bench.board.check("nothing waits", number(dut.awvalid) | number(dut.arvalid), 0)
    bench.board.finish({"reply": given["frames"] // 2, "register": 256}, SEEN)
