"""Cocotb side of ``test_measurement_watch``."""

from __future__ import annotations

import random

import cocotb

from directmpc.host.registers import registers_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number


class Watch:
    """Which registers have been written, and when the first of them was."""

    def __init__(self, needed: set[int]) -> None:
        self.needed, self.written = needed, dict[int, int]()
        self.now, self.limit, self.fresh = 0, 0, 0

    def old(self) -> bool:
        """Whether the first write lies too far back."""
        return bool(self.written) and self.now > min(self.written.values()) + self.limit

    def edge(self, i: dict[str, int]) -> None:
        """One clock."""
        if not self.written:
            self.limit = i["limit"]  # read until a first register is written
        old, whole = self.old(), set(self.written) == self.needed
        if i["begins"]:
            self.fresh = int(i["take"] or whole)
        if i["passed"] and i["address"] & ~3 in self.needed:
            self.written.setdefault(i["address"] & ~3, self.now)
        if i["begins"] or old or not i["live"] or i["rst"]:
            self.written = {}
        if i["rst"]:
            self.fresh = 0
        self.now += 1


@cocotb.test()
async def random_writes(dut) -> None:
    """Rounds of writes, whole or not, quick or slow, and starts between them."""
    given = arguments()
    rng, board, clock = random.Random(6), Scoreboard(), Clock(dut)
    names = [n for n in registers_of(given["controller"]) if n.startswith("measurements.")]
    addresses = [registers_of(given["controller"])[name][0] for name in names]
    watch = Watch(set(addresses[: int(given["COUNT"])]))
    others = [0x00C, 0x050, 0x100, 0x280, *addresses[int(given["COUNT"]) :]]
    queue: list[int] = []
    slow = live = 0
    for n in range(given["clocks"]):
        if not queue and rng.random() < 0.4:
            queue = addresses.copy()
            rng.shuffle(queue)
            if rng.random() < 0.3:
                queue.remove(rng.choice(sorted(watch.needed)))
            slow = rng.random() < 0.3
        passed = rng.random() < (0.1 if slow else 0.6)
        if queue and passed:
            address = queue.pop() if rng.random() < 0.95 else rng.choice(others)
        else:
            address = rng.choice([*others, *addresses])
            passed = passed and address in others
        begins = rng.random() < (0.004 if queue else 0.3)
        live = int(rng.random() > 0.003) if live else int(rng.random() < 0.3)
        i = {
            "rst": int(n < 2 or rng.random() < 0.001),
            "live": live,
            "address": address,
            "passed": int(passed),
            "limit": rng.choice([40, 60, 160]),
            "take": int(begins and rng.random() < 0.1),
            "begins": int(begins),
        }
        for name, value in i.items():
            getattr(dut, name).value = value
        await clock.tick()
        starts = bool(i["begins"] and not i["take"])
        missing = len(watch.needed) - len(watch.written)
        watch.edge(i)
        if n > 2:
            board.check("fresh", number(dut.fresh), watch.fresh, f"clock {n}, {i}")
            board.cover("from registers", int(starts and watch.fresh))
            board.cover("all but one", int(starts and missing == 1 and not watch.fresh))
            board.cover("not new", int(i["begins"] and not watch.fresh))
            board.cover("old", int(watch.old()))
    board.finish(
        {"fresh": given["clocks"] - 3},
        {"from registers": 20, "all but one": 20, "not new": 100, "old": 50},
    )
