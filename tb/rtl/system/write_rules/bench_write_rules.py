"""Cocotb side of ``test_write_rules``."""

from __future__ import annotations

import random
from collections.abc import Mapping

import cocotb

from directmpc.host.registers import registers_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments


class Rules:
    """What is refused, by the names of the registers."""

    def __init__(self, controller: str, limit: int) -> None:
        self.limit = limit
        self.names = {address: name for name, (address, _) in registers_of(controller).items()}
        self.uncommitted = False
        self.asked = 0

    def name(self, given: Mapping[str, int]) -> str:
        """Of the register that is written."""
        return self.names.get(given["address"] & ~3, "")

    def refused(self, given: Mapping[str, int]) -> bool:
        """Whether the write that is there is."""
        name = self.name(given)
        if not given["whole"]:
            return True
        if name.startswith(("guard.", "bands.")):
            return bool(given["enabled"] or given["pending"])
        if name.startswith("parameters."):
            beyond = name.startswith("parameters.bound_") and given["word"] > self.limit
            return bool(given["pending"] or beyond)
        enables = name == "system.control" and given["word"] & 1
        return bool(enables and (self.uncommitted or given["pending"]))

    def edge(self, given: Mapping[str, int]) -> None:
        """One clock."""
        self.asked = 0 if given["rst"] else 2 if given["commit"] else max(self.asked - 1, 0)
        if given["passed"] and self.name(given).startswith(("guard.", "bands.")):
            self.uncommitted = True
        elif given["load"]:
            self.uncommitted = False
        if given["rst"]:
            self.uncommitted = False


@cocotb.test()
async def random_writes(dut) -> None:
    """Writes to every register in every state."""
    given = arguments()
    rng, board, clock = random.Random(8), Scoreboard(), Clock(dut)
    limit = given["BOUND_LIMIT"]
    rules = Rules(given["controller"], limit)
    known = sorted(rules.names)
    guard = [a for a in known if rules.names[a].startswith(("guard.", "bands."))]
    bounds = [a for a in known if 0x180 <= a < 0x194] or known
    for k in range(given["clocks"]):
        kind = rng.random()
        place = rng.choice(guard) if kind < 0.2 else 0x0C if kind < 0.5 else rng.choice(known)
        if kind > 0.8:  # MPDCC's bounds, and what is next to them
            place = rng.choice(bounds)
        values = {
            "address": place + rng.choice([0, 0, rng.randrange(4)]),
            "rst": int(k < 2 or rng.random() < 0.005),
            "word": rng.choice([limit, limit + 1 & 0xFFFF, rng.getrandbits(16)]),
        }
        for name, share in {
            "whole": 0.8, "passed": 0.3, "enabled": 0.3, "commit": 0.1,
            "pending": 0.3, "load": 0.1,
        }.items():  # fmt: skip
            values[name] = int(rng.random() < share)
        for name, value in values.items():
            getattr(dut, name).value = value
        await clock.settle()
        if k >= 2:
            want = rules.refused(values)
            context = f"clock {k}: {rules.name(values)} {values}"
            board.check("refuse", str(dut.refuse.value), str(int(want)), context)
            wait = values["commit"] or rules.asked > 0
            board.check("hold", str(dut.hold.value), str(int(wait)), context)
            board.cover(rules.name(values).partition(".")[0], int(want))
        rules.edge(values)
        await clock.edge()
    board.finish({"refuse": given["clocks"] - 2}, {"guard": 50, "parameters": 50, "system": 50})
