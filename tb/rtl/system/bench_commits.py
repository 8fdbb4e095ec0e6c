"""Cocotb side of ``test_commits``: a commit at one clock after the other of a decision."""

from __future__ import annotations

import cocotb
from cocotb.triggers import ClockCycles, FallingEdge

from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import arguments, number
from tb.rtl.system.bench_system import NOT_THE_CORE_S, System

#: Words that differ between two sets.
CHANGED = 8
#: Clocks in which no write passes, from a commit's command on.
HELD = 3
#: Clocks after a decision's end at which the last one is.
AFTER = 4
#: Clocks for which MPDCC's parameters are prepared behind a commit: copied, then scaled.
PREPARED = clocks_of("parameter_memory", "waits") + clocks_of("state_observer", "scaling") + 3
#: Clocks before a start at which the first commit is asked for: all of a copy lies in them.
BEFORE = {"mpdcc": 12 + PREPARED, "mptc": 12}


class Sweep:
    """Sets of parameters, of which each decision has to be one's."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.names = [name for name in system.words if not name.startswith(NOT_THE_CORE_S)]
        self.in_force = system.any_parameters()
        self.copies = system.controller == "mpdcc"
        self.before = BEFORE[system.controller]

    async def write(self, words: dict[str, int], *, behind: bool = False) -> None:
        """Shadows, of which none may be refused, but behind a commit that is still copied."""
        for name, word in words.items():
            address, fields = self.system.bus.registers[f"parameters.{name}"]
            word &= (1 << fields["value"][1]) - 1
            response = await self.system.bus.write_word(address, word)
            while behind and self.copies and response:
                self.system.board.cover("refused")
                response = await self.system.bus.write_word(address, word)
            self.system.board.check("written", response, 0, name)

    async def commit(self) -> None:
        """Ask for a commit."""
        await self.system.bus.write("system.command", commit=1)

    async def held(self) -> None:
        """No write passes in the clock of a commit's command and in the two after it."""
        rules = self.system.dut.i_shell.i_rules
        since = HELD
        while True:
            await FallingEdge(self.system.dut.clk)
            since = 0 if number(rules.commit) else since + 1
            if since < HELD:
                passed = number(rules.passed)
                self.system.board.check("held", passed, 0, f"{since} clocks behind a command")

    async def prepared(self) -> None:
        """How long a commit at rest is pending behind its load."""
        counted = 0

        async def count() -> None:
            nonlocal counted
            for _ in range(4 * PREPARED):
                await ClockCycles(self.system.dut.clk, 1)
                counted += number(self.system.dut.preparing)

        task = cocotb.start_soon(count())
        await self.commit()
        await task
        self.system.board.check("prepared", counted, PREPARED, "a commit at rest")

    async def behind(self) -> None:
        """Shadows that are written right behind a commit are the next one's."""
        system, board = self.system, self.system.board
        fresh, m = self.differing()
        # the last words first: a copy that is under way has them still before it
        changed = {
            name: fresh[name] for name in self.names[::-1] if fresh[name] != self.in_force[name]
        }
        asked = cocotb.start_soon(self.commit())
        written = cocotb.start_soon(self.write(changed, behind=True))
        await asked
        await written
        await system.settled()
        await system.decide(m)
        board.check("behind", system.decided(), system.model(self.in_force, m), "not in force yet")
        await self.commit()
        await system.settled()
        self.in_force = fresh
        await system.decide(m)
        board.check("behind", system.decided(), system.model(fresh, m), "in force")

    def differing(self) -> tuple[dict[str, int], dict[str, int]]:
        """Another set, and measurements for which it decides something else."""
        while True:
            fresh = dict(self.in_force)
            other = self.system.any_parameters()
            for name in self.system.rng.sample(self.names, CHANGED):
                fresh[name] = other[name]
            for _ in range(20):
                m = self.system.any_measurements()
                if self.system.model(fresh, m) != self.system.model(self.in_force, m):
                    return fresh, m

    async def once(self, clock: int) -> tuple[bool, int]:
        """A commit ``clock`` clocks after a start; whether the decision is new, and its clocks."""
        system, board = self.system, self.system.board
        fresh, m = self.differing()
        changed = [name for name in self.names if fresh[name] != self.in_force[name]]
        await self.write({name: fresh[name] for name in changed})

        async def host() -> None:
            await ClockCycles(system.dut.clk, self.before + clock)
            await self.commit()

        task = cocotb.start_soon(host())
        await ClockCycles(system.dut.clk, self.before)
        clocks = await system.decide(m)
        got = system.decided()
        old, new = system.model(self.in_force, m), system.model(fresh, m)
        board.check("one set", got in (old, new), True, f"commit at {clock}: {got}")
        await task
        await system.settled()
        self.in_force = fresh
        await system.decide(m)
        board.check("next", system.decided(), new, f"commit at {clock}")
        return got == new, clocks


@cocotb.test()
async def commits(dut) -> None:
    """Old before, new after; in between every decision keeps what it began with."""
    given = arguments()
    system = System(dut, given)
    board = system.board
    await system.begin()
    await system.bus.write("system.control", own_positions=0)
    sweep = Sweep(system)
    cocotb.start_soon(sweep.held())
    await system.settled()  # the commit of the reset
    await sweep.write(sweep.in_force)
    await sweep.commit()
    await system.settled()
    await system.decide(system.any_measurements())
    if given["controller"] == "mpdcc":
        await sweep.prepared()
    for _ in range(3):
        await sweep.behind()
    changes = []
    clock, longest = -sweep.before, 0
    while clock < longest + AFTER:
        new, clocks = await sweep.once(clock)
        changes.append((clock, new))
        # a new one may have waited for the copy
        longest = max(longest, clocks - PREPARED * (new and sweep.copies))
        clock += given["stride"]
    # a commit before the start has taken effect; from one clock on none has
    first_old = min(clock for clock, new in changes if not new)
    for clock, new in changes:
        board.check("order", new, clock < first_old, f"commit at {clock}")
    board.check("begins old", -12 < first_old < given["stride"], True, str(first_old))
    during = sum(first_old <= clock <= longest for clock, _ in changes)
    board.cover("during", during)
    board.longest("clocks", longest)
    board.longest("during", during)
    board.finish(
        {"next": len(changes), "held": HELD * len(changes)},
        {"during": longest // given["stride"], "refused": 3 * sweep.copies},
    )
