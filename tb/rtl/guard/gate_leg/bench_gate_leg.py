"""Cocotb side of ``test_gate_leg``: every output of every clock against the reference."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import cocotb

from directmpc.host.gate_guard import Leg, commutation
from directmpc.mpdcc import inverter as anpc
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

#: Gates that are never on together, as docs/gate-guard.md has them; of a two-level leg the first.
REFUSED = [{1, 2}, {3, 4}, {2, 3}, {6, 7}, {1, 4}, {1, 5, 8}, {4, 5, 8}]


def following(tabled_leg: bool, position: int) -> list[int]:
    """Positions that a position may move to."""
    near = [int(s) for s in anpc.NEXT_POSITIONS[position]] if tabled_leg else [0, 1]
    return sorted(set(near) - {position})


@dataclass
class Unguarded(Leg):
    """A leg that nobody keeps from goals which are no edges, or too early: it has the interlock."""

    #: Position that a move would begin from, and gate that would begin it.
    origin: int = 0
    first: int = 0
    #: Gates that would have been on after the last action.
    tried: set[int] = field(default_factory=set)
    refused: bool = False  #: Whether the action of this edge was refused.

    def actions(self, goal: int) -> list[int]:
        """Gates that change one after the other: the first of g, a and b that differs moves."""
        if not self.tabled_leg:
            return [1, 2] if self.origin & 1 else [2, 1]
        differs = self.origin ^ goal
        if differs & 4:  # one order for all moves of g, edges or not
            move = (2, 4) if goal & 4 else (4, 2)
        else:
            move = (self.origin, self.origin ^ (2 if differs & 2 else 1))
        return [abs(action) for action in commutation(True, *move)]

    def clock(self, now: int, dead: int, rest: int) -> None:
        """One rising edge, as `Leg.clock`."""
        self.refused = False
        if self.starts_at == now:
            super().clock(now, dead, rest)
            self.plan = [(when, abs(action)) for when, action in self.plan]
            self.origin = self.goal
            return
        if self.alive and not self.plan and self.goal != self.settled and now >= self.ready_at:
            gates = [self.first, *self.actions(self.goal)[1:]]
            self.plan = [(now + i * dead, gate) for i, gate in enumerate(gates)]
            self.origin = self.settled = self.goal
            self.ready_at = self.plan[-1][0] + rest
        if self.plan and self.plan[0][0] == now:
            self.tried = self.on ^ {self.plan.pop(0)[1]}
            pairs = REFUSED if self.tabled_leg else REFUSED[:1]
            self.refused = any(pair <= self.tried for pair in pairs)
            self.on = self.on if self.refused else self.tried
            # the one count waits for the rest behind a last action
            self.changed_at = now if self.plan else now + rest - dead

    def aim(self, now: int) -> None:
        """A stop with a move's first action: the move has begun, for the first of the next."""
        moves = not self.plan and self.goal != self.settled and now >= self.ready_at
        if self.alive and (self.starts_at == now or (self.starts_at is None and moves)):
            self.origin = self.goal

    def stop(self, now: int, dead: int) -> None:
        """One rising edge, as `Leg.stop`."""
        self.refused = False
        super().stop(now, dead)

    def kill(self) -> None:
        """All gates off, as `Leg.kill`."""
        self.refused = False
        super().kill()


class Bench:
    """A leg, and the leg as it should be."""

    def __init__(self, dut, tabled_leg: bool) -> None:
        self.dut, self.tabled_leg = dut, tabled_leg
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.leg, self.now = Leg(tabled_leg), 0
        self.dead = self.rest = 1
        #: At the port in the clock before: what a decision of this clock takes.
        self.goal = 0

    def times(self, dead: int, rest: int) -> None:
        """Dead and rest time, clocks; while all gates are off only."""
        self.dead, self.rest = dead, rest
        self.dut.dead_time.value, self.dut.rest_time.value = dead, rest

    async def step(
        self,
        coming: int,
        *,
        decided: bool = False,
        stop: bool = False,
        admit: bool = False,
        kill: bool = False,
    ) -> None:
        """One clock: all outputs before its edge, which the reference then passes too.

        ``coming`` is the goal that a decision of the next clock takes.
        """
        dut, leg, board = self.dut, self.leg, self.board
        goal, self.goal = self.goal, coming
        # of a two-level leg two bits of three do not count
        port = coming if self.tabled_leg else coming | (self.now & 3) << 1
        dut.goal.value, dut.decided.value = port, int(decided)
        dut.stop.value, dut.admit.value, dut.kill.value = int(stop), int(admit), int(kill)
        await self.clock.settle()
        if self.now > 1:
            context = f"clock {self.now}, goal {goal}, {leg}"
            on = sum(1 << (gate - 1) for gate in leg.on)
            board.check("gates", number(dut.gates), on, context)
            board.check("off", number(dut.off), int(not on), context)
            board.check("legal", number(dut.legal), int(leg.legal(goal)), context)
            board.check("blocked", number(dut.blocked), int(leg.blocked(goal)), context)
            board.check("waits", number(dut.waits), int(leg.waits), context)
            board.check("resting", number(dut.resting), int(leg.resting(self.now)), context)
            if leg.taken is not None:
                board.check("position", number(dut.position), leg.taken, context)
            refused = isinstance(leg, Unguarded) and leg.refused
            board.check("refused", number(dut.refused), int(refused), context)
            board.cover(f"{leg.goal} to {goal}", int(leg.alive))
        self.now += 1
        board.cover("stopped in a move", int(stop and bool(leg.plan)))
        board.cover("killed", int(kill and bool(leg.on)))
        board.cover("decided too early", int(decided and bool(leg.on) and not leg.alive))
        before, was_on = leg.settled, frozenset(leg.on)
        first = leg.actions(goal)[0] if decided and isinstance(leg, Unguarded) else 0
        if stop and isinstance(leg, Unguarded):
            leg.aim(self.now)
        if kill:
            leg.kill()
        elif stop or (leg.on and not leg.alive):
            leg.stop(self.now, self.dead)
            board.cover(f"stop from {sorted(was_on)}")
        else:
            leg.clock(self.now, self.dead, self.rest)
        if decided and isinstance(leg, Unguarded):
            leg.first = first
        taken = decided and (admit or not stop)
        board.cover("admitted", int(admit))
        if taken:
            leg.goal = goal
        if taken and (leg.alive or not was_on):
            if not leg.alive:
                leg.alive, leg.starts_at, leg.settled = True, self.now + 1, goal
        elif leg.settled != before:
            board.cover(f"moved {before} to {leg.settled}")
        await self.clock.edge()

    async def live(self, rng: random.Random, clocks: int) -> None:
        """Goals at any time; what a supervisor would not let pass comes with a stop."""
        leg = self.leg
        positions = 8 if self.tabled_leg else 2
        for n in range(clocks):
            refused = leg.alive and (not leg.legal(self.goal) or leg.blocked(self.goal))
            decided = rng.random() < (0.03 if refused else 0.2)
            stop = n < 2 or rng.random() < 0.02 or (decided and refused)
            kill = n < 2 or (stop and rng.random() < 0.1)
            # as gate_supervisor starts a leg: stop is still up
            admit = decided and not stop and not leg.alive and not leg.on and rng.random() < 0.7
            stop |= admit
            coming, kept = rng.randrange(positions), self.goal if decided else leg.goal
            if rng.random() < 0.6:
                near = following(self.tabled_leg, kept)
                coming = kept if decided or leg.waits else rng.choice(near)
            if not leg.alive and not leg.on and not decided:
                dead, rest = rng.randrange(1, 5), rng.randrange(1, 7)
                self.times(*rng.choice([(dead, rest), (dead, rest), (dead, 40), (40, rest)]))
            await self.step(coming, decided=decided, stop=stop, admit=admit, kill=kill)

    async def stray(self, rng: random.Random, clocks: int) -> None:
        """Goals that are no edges: gates and position part, and the interlock is what is left."""
        for stop, decided in ((1, 0), (0, 1), (0, 0), (0, 0), (1, 0)):
            await self.step(0, decided=bool(decided), stop=bool(stop), kill=bool(stop))
        self.leg = Unguarded(self.tabled_leg)
        for _ in range(clocks):
            stop = rng.random() < 0.005
            kill = stop and rng.random() < 0.2
            decided = rng.random() < (0.1 if self.leg.waits else 0.3)
            if not self.leg.alive and not self.leg.on and not decided:
                self.times(rng.randrange(1, 4), rng.randrange(1, 4))
            coming = rng.randrange(8 if self.tabled_leg else 2)
            await self.step(coming, decided=decided, stop=stop, kill=kill)
            self.board.cover("refused", int(self.leg.refused))
            for pair in REFUSED:
                alone = [one for one in REFUSED if one <= self.leg.tried] == [pair]
                self.board.cover(f"{pair} alone", int(self.leg.refused and alone))

    async def upset(self, rng: random.Random) -> bool:
        """Flip a gate so that the pattern may not be, out of a life; whether there is one."""
        dut, board = self.dut, self.board
        size = 8 if self.tabled_leg else 2
        self.leg, self.now = Leg(self.tabled_leg), 0
        await self.live(rng, rng.randrange(10, 60))
        pairs = REFUSED if self.tabled_leg else REFUSED[:1]
        gates = [g for g in range(1, size + 1) if any(p <= self.leg.on ^ {g} for p in pairs)]
        dut.decided.value = dut.stop.value = dut.admit.value = dut.kill.value = 0
        await self.clock.settle()
        if not gates or number(dut.change):
            return False
        board.cover("upset while live" if self.leg.alive else "upset in a stop")
        gate = rng.choice(gates)
        flipped = sum(1 << (g - 1) for g in self.leg.on ^ {gate})
        dut.goal.value, dut.rest_time.value = gate - 1, 0  # what the altered leg flips a gate by
        await self.clock.tick()
        dut.rest_time.value = self.rest
        await self.clock.settle()
        board.check("upset", number(dut.gates), flipped)
        await self.clock.edge()
        await self.clock.settle()
        board.check("after an upset", number(dut.gates), 0, f"{flipped:08b}")
        board.check("told of an upset", number(dut.refused), 1, f"{flipped:08b}")
        return True


@cocotb.test(skip=arguments()["upsets"] == 0)
async def every_upset(dut) -> None:
    """Flips of one gate each, out of lives under a supervisor."""
    given = arguments()
    rng = random.Random(given["seed"])
    bench = Bench(dut, given["TABLED_LEG"] == "true")
    bench.times(1, 1)
    left = given["upsets"]
    while left:
        left -= await bench.upset(rng)
    bench.board.finish({"after an upset": given["upsets"]}, {"upset while live": 20})


@cocotb.test(skip=arguments()["upsets"] > 0)
async def every_clock(dut) -> None:
    """A random life under a supervisor, then one without."""
    given = arguments()
    tabled_leg = given["TABLED_LEG"] == "true"
    rng = random.Random(given["seed"])
    bench = Bench(dut, tabled_leg)
    bench.times(1, 1)
    await bench.live(rng, given["clocks"])
    await bench.stray(rng, 2 * given["clocks"])
    positions = range(8 if tabled_leg else 2)
    looked = [f"{a} to {b}" for a in positions for b in positions]
    moved = [f"moved {a} to {b}" for a in positions for b in following(tabled_leg, a)]
    refused = [f"{pair} alone" for pair in (REFUSED if tabled_leg else REFUSED[:1])]
    bench.board.finish(
        {"gates": 3 * given["clocks"] - 1},
        dict.fromkeys([*looked, *moved, *refused], 1)
        | {"stopped in a move": 10, "refused": 50, "admitted": 20}
        | {"killed": 3, "decided too early": 3 * tabled_leg},
    )
