"""Cocotb side of ``test_frame_encoder``: every output of every clock, and what the memory has."""

from __future__ import annotations

import random
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field

import cocotb

from directmpc.host.protocol import stuff
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

SIZES = (1, 2, 6, 7, 18, 38)  # bytes of a frame without its CRC


@dataclass
class Encoder:
    """What the encoder writes in each clock."""

    body: bytearray = field(default_factory=bytearray)  #: Bytes of the frame that have come.
    #: Place -> byte, as written since the frame began.
    memory: dict[int, int] = field(default_factory=dict)
    state: str = "idle"
    left: list[int] = field(default_factory=list)
    code: int = 0
    place: int = 1

    def written(self, i: dict[str, int]) -> tuple[int, int] | None:
        """Place and byte of this clock."""
        byte = None
        if self.state == "fill" and i["valid"]:
            byte = i["data"]
        elif self.state == "crc":
            byte = self.left[0]
        elif self.state == "close":
            byte = 0
        if byte is None:
            return None
        return (self.place, byte) if byte else (self.code, self.place - self.code)

    def edge(self, i: dict[str, int]) -> None:
        """One clock."""
        written = self.written(i)
        if written is not None:
            self.memory[written[0]] = written[1]
            if written[0] != self.place and self.state != "close":
                self.code = self.place
            self.place += self.state != "close"
        if self.state == "fill" and i["valid"]:
            self.body.append(i["data"])
            if i["last"]:
                self.state, self.left = "crc", list(zlib.crc32(self.body).to_bytes(4, "little"))
        elif self.state == "crc":
            self.left.pop(0)
            self.state = "crc" if self.left else "close"
        elif self.state in ("close", "full"):
            self.state = "full" if self.state == "close" else "idle"
        if i["begins"]:
            self.state, self.code, self.place = "fill", 0, 1
            self.body.clear()
            self.memory.clear()
        if i["rst"]:
            self.state = "idle"


def requests(rng: random.Random, encoder: Encoder, clocks: int) -> Iterator[dict[str, int]]:
    """Frames with pauses in them, some given up for another one or by a reset."""
    data: list[int] = []
    for n in range(clocks):
        rare = rng.random()
        i = {
            "rst": int(n < 2 or rare < 0.003),
            "begins": 0,
            "valid": 0,
            "data": rng.choice([0, rng.randrange(256)]),
            "last": rng.randrange(2),
        }
        idle = encoder.state == "idle"
        if rng.random() < 0.2 if idle else rare > 0.995:
            # a reset comes first, whatever begins
            i["begins"] = 1
            zeros = rng.random()
            data = [rng.randrange(256) * (rng.random() > zeros) for _ in range(rng.choice(SIZES))]
        elif encoder.state == "fill" and rng.random() < 0.6:
            i |= {"valid": 1, "data": data.pop(0), "last": int(not data)}
        elif encoder.state != "fill":
            i["valid"] = rng.randrange(2)
        yield i


@cocotb.test()
async def every_clock(dut) -> None:
    """Frames of all sizes."""
    given = arguments()
    rng, board, clock = random.Random(7), Scoreboard(), Clock(dut)
    encoder, since = Encoder(), 0
    for n, i in enumerate(requests(rng, encoder, given["clocks"])):
        for name, value in i.items():
            getattr(dut, name).value = value
        await clock.settle()
        if n > 1:
            context = f"clock {n}, {i}, {encoder.state}"
            written = encoder.written(i)
            board.check("busy", number(dut.busy), int(encoder.state != "idle"), context)
            board.check("filled", number(dut.filled), int(encoder.state == "full"), context)
            board.check("write", number(dut.write), int(written is not None), context)
            if written is not None:
                board.check("place", number(dut.place), written[0], context)
                board.check("value", number(dut.value), written[1], context)
            if encoder.state == "full":
                wanted = stuff(encoder.body + zlib.crc32(encoder.body).to_bytes(4, "little"))
                board.check("size", number(dut.size), len(wanted), context)
                stored = bytes(encoder.memory[k] for k in range(len(wanted)))
                board.check("memory", stored, wanted, context)
                board.check("latency", since, 6, context)
                board.cover(f"{len(encoder.body)} bytes")
        board.cover(f"reset, {encoder.state}", int(n > 1 and i["rst"]))
        board.cover(f"begins, {encoder.state}", i["begins"])
        since = 1 if encoder.state == "fill" and i["valid"] and i["last"] else since + 1
        encoder.edge(i)
        await clock.edge()
    board.finish(
        {"memory": given["clocks"] // 100, "value": given["clocks"] // 10},
        dict.fromkeys([f"{size} bytes" for size in SIZES], 3)
        | dict.fromkeys(["reset, fill", "reset, crc", "reset, idle", "begins, fill"], 1),
    )
