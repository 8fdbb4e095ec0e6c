"""Cocotb side of ``test_mptc_choices``."""

from __future__ import annotations

import random
from dataclasses import dataclass

import cocotb
import numpy as np

from directmpc.mptc import bit_true_hexagon as twin
from directmpc.mptc import formats as f
from directmpc.mptc import program
from directmpc.mptc.inverter import COMMUTATIONS, ZERO_FROM
from directmpc.mptc.sequence import TIME_STEPS
from scripts.hdl.mptc_job import FAMILY_METHODS
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed

MPFC2, MPFC3, MPC2, SVM = (FAMILY_METHODS[name] for name in ("MPFC2", "MPFC3", "MPC2", "SVM"))
METHODS = (MPFC2, MPFC3, MPC2, SVM)
SPOKE, EDGE, ALONE, INSIDE = range(4)

#: Clocks counted from the one in which e is taken, as the header has them.
FIRST = program.FIRST_CHOICE - program.REST
RESIDUE, COMPARE = program.RESIDUE, program.CHOICE_COMPARE
STABLE = FIRST + program.CHOICE_CLOCKS * (twin.CHOICES - 1) + COMPARE + 1
#: The counter stays there where nobody takes the decision.
HELD = STABLE + 1

WIDTH = f.QUOTIENT_WIDTH + 2  # bits of a coordinate
ONE = 1 << f.HEXAGON_FRACTION  # the way of a vector
WHOLE = ONE << 2  # the whole period, and the way, where both are finer
TIME_SHIFT = f.HEXAGON_FRACTION + 2 - f.TIME_WIDTH
RESIDUE_SHIFT = f.HEXAGON_FRACTION + 2 - f.RESIDUE_FRACTION
ROUNDING = 1 << (f.TORQUE_SHIFT - 1)  # first summand of a square
MOST = (256 << 2 * f.RESIDUE_FRACTION) + ROUNDING
#: No distance is nearer than this one.
FARTHEST = 2 * (256 << 2 * f.RESIDUE_FRACTION) - 1


@dataclass(frozen=True)
class Choice:
    """A second vector, with the point that comes nearest to e; None where nobody reads a field."""

    other: int
    beside: int
    fewer: int | None
    part: int | None
    kind: int
    along: int
    across: int

    @property
    def square(self) -> int:
        """Square of the distance, as the multipliers form it."""
        return self.along * (self.along + self.across) + self.across**2 + ROUNDING


@dataclass(frozen=True)
class Task:
    """What the choices are made of; g and h in the coordinates of the leading vector."""

    method: int
    row: int
    leader: int
    ended: int
    g: int
    h: int

    @property
    def idle(self) -> int:
        """Whether the first vector is a zero vector."""
        return int(self.row in (0, 7))

    def point(self, n: int, turn: int) -> tuple[int, int, int, int]:
        """Kind of a choice, time, and its point."""
        if n == 0:
            time = 0 if self.idle else WHOLE
            return SPOKE, time, time, 0
        if self.method == MPFC3:
            return self.point_of_three(turn)
        if n == 1 or self.idle:
            return SPOKE, *twin.spoke(self.g, self.h, turn)
        return EDGE, *twin.edge(self.g, self.h, turn)

    def point_of_three(self, turn: int) -> tuple[int, int, int, int]:
        """The same where both vectors have a time of their own."""
        g, h = self.g, self.h
        if turn not in (0, 3):
            # in the coordinates of the sides of the triangle; one's complement of a negative one
            first = g if turn in (1, 4) else g + h
            second = h if turn in (1, 2) else ~h
            if first >= 0 and second < 0:
                return ALONE, *twin.spoke(g, h, 0)
            if first >= 0:
                filled = first + (h if turn in (1, 2) else -h)
                if filled > ONE:
                    return EDGE, *twin.edge(g, h, turn)
                return INSIDE, 0, g << 2, h << 2
        return SPOKE, *twin.spoke(g, h, turn)

    def choice(self, n: int) -> Choice:
        """Choice number n."""
        turn = int(twin.TURNS[self.row, n])
        kind, time, at_g, at_h = self.point(n, turn)
        other = (self.leader - 1 + turn) % 6 + 1
        if self.method != MPFC3 and n == 0:
            other = self.row
        elif self.method != MPFC3 and n == 1 and not self.idle:
            other = int(ZERO_FROM[self.row])
        fewer = None
        if COMMUTATIONS[other, self.leader] <= 1:
            away = COMMUTATIONS[self.ended]
            fewer = int(away[other] < away[self.leader])
        return Choice(
            other, int(turn in (1, 4)), fewer, None if kind == INSIDE else int(time) >> TIME_SHIFT,
            kind, ((self.g << 2) - int(at_g)) >> RESIDUE_SHIFT,
            ((self.h << 2) - int(at_h)) >> RESIDUE_SHIFT,
        )  # fmt: skip

    def choices(self) -> list[Choice]:
        """All of them."""
        return [self.choice(n) for n in range(twin.CHOICES)]

    def compared(self) -> range:
        """Numbers of those that are compared."""
        if self.method == MPFC3:
            return range(1, twin.CHOICES)
        return range(twin.NEAR_CHOICES if self.method == MPC2 else twin.CHOICES)


def fits(task: Task) -> bool:
    """Whether e and what remains of it are in their ranges."""
    e = (task.g, task.h, task.g + task.h)
    remains = [x for c in task.choices() for x in (c.along, c.across, c.along + c.across)]
    widths = ((e, WIDTH), (remains, f.WORD_WIDTH))
    return all(-(1 << w - 1) <= x < 1 << w - 1 for words, w in widths for x in words)


def turned(g: int, h: int, turns: int) -> tuple[int, int]:
    """Coordinates along the vectors that stand some turns by 60 degrees on."""
    for _ in range(turns):
        g, h = g + h, -g
    return g, h


def some_e(rng: random.Random) -> tuple[int, int]:
    """Coordinates: in the hexagon and around it, on its lines, far away, at the rails."""
    kind = rng.random()
    half = ONE >> 1
    if kind < 0.15:
        return rng.randint(-3 * half, 3 * half), rng.randint(-3 * half, 3 * half)
    if kind < 0.45:
        # in a triangle of two vectors and zero voltage, its last side among it
        h = rng.randint(0, ONE)
        return turned(rng.choice([ONE - h, rng.randint(0, ONE - h)]), h, rng.randrange(6))
    if kind < 0.75:
        # one of g, h and their sum is that of a line, or an LSB beside it
        line = rng.choice([-2, -1, -1, 0, 0, 1, 1, 2]) * half + rng.choice([-1, 0, 0, 1])
        more = rng.choice([rng.randint(-2 * ONE, 2 * ONE), rng.choice([-1, 0, 1]) * half])
        return rng.choice([(line, more), (more, line), (line - more, more), (line, line)])
    if kind < 0.88:
        most = (1 << (f.QUOTIENT_WIDTH - 1)) - 1
        x, y = (rng.choice([-most, most, rng.randint(-most, most)]) for _ in range(2))
        return turned(2 * x - y, 2 * y, rng.randrange(6))
    rail = rng.choice([(1 << (WIDTH - 1)) - 1, -(1 << (WIDTH - 1))])
    less = rng.randint(0, 2 * ONE) * (-1 if rail > 0 else 1)
    return rng.choice([(rail + less, -rail), (-rail, rail + less), (rail + less, 0)])


def some_task(rng: random.Random) -> Task:
    """One of any method."""
    while True:
        method = rng.choice([*METHODS, MPFC3])
        row, ended = rng.randrange(1, 7), rng.randrange(8)
        g, h = some_e(rng)
        if method == MPFC2:
            row = rng.choice([0, 7, rng.randrange(1, 7), rng.randrange(1, 7)])
            ended = row
        if method == MPC2:
            # the leading vector is the nearest one, the first one from u_1 on
            row = 1
            while row < 6 and (g < h or g + 2 * h < 0):
                g, h = turned(g, h, 1)
                row += 1
        task = Task(method, row, 1 if row in (0, 7) else row, ended, g, h)
        if fits(task):
            return task


def decided(task: Task) -> tuple[int, ...]:
    """What the twin applies; e goes back to the coordinates of u_1."""
    g, h = turned(task.g, task.h, (7 - task.leader) % 6)
    applied = np.array([task.ended] * 3 + [TIME_STEPS, 0], dtype=np.int64)
    if task.method == MPFC3:
        # the leading vector before the last one, which may be a zero vector
        applied = np.array([task.leader, task.ended, task.ended, 0, 0], dtype=np.int64)
        if task.ended not in (0, 7):
            applied[:3] = task.leader
        return tuple(map(int, twin.mpfc3(g, h, applied)))
    if task.method == MPFC2:
        return tuple(map(int, twin.mpfc2(g, h, applied)))
    return tuple(map(int, twin.mpc2(g, h, applied)))


class Bench:
    """The entity, the counter before it, and what best has to be."""

    def __init__(self, dut, rng: random.Random, throttle: int) -> None:
        self.dut, self.rng, self.throttle = dut, rng, throttle
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.best: tuple[int, Choice] | None = None
        self.least = FARTHEST
        self.context = ""

    def scramble(self, task: Task | None = None) -> None:
        """Any inputs; of a task that has begun only the leading vector is late."""
        dut, rng = self.dut, self.rng
        if task is None:
            dut.method.value, dut.ended.value = rng.choice(METHODS), rng.randrange(8)
            dut.idle.value, dut.row.value = rng.getrandbits(1), rng.randrange(8)
        dut.leader.value = rng.randrange(1, 7)
        for name in ("g", "h", "total"):
            getattr(dut, name).value = rng.getrandbits(WIDTH)

    def place(self, task: Task) -> None:
        """Inputs of a task."""
        dut = self.dut
        dut.method.value, dut.ended.value, dut.idle.value = task.method, task.ended, task.idle
        dut.leader.value, dut.row.value = task.leader, task.row
        dut.g.value, dut.h.value = bits(task.g, WIDTH), bits(task.h, WIDTH)
        dut.total.value = bits(task.g + task.h, WIDTH)

    def noise(self) -> int:
        """A sum of which nobody may take notice, often the nearest of all."""
        return self.rng.choice([0, 0, self.rng.getrandbits(f.ACCUMULATOR_WIDTH)])

    async def tick(self, count: int, total: int) -> None:
        """One clock, best held."""
        self.dut.clock.value, self.dut.sum.value = count, total
        await self.clock.settle()
        if self.best is not None:
            n, choice = self.best
            dut, context = self.dut, f"{self.context}, clock {count}"
            self.board.check("number", number(dut.best_number), n, context)
            self.board.check("other", number(dut.best_other), choice.other, context)
            self.board.check("neighbour", number(dut.best_beside), choice.beside, context)
            self.board.check("kind", number(dut.best_kind), choice.kind, context)
            if choice.part is not None:
                self.board.check("part", number(dut.best_part), choice.part, context)
            if choice.fewer is not None:
                self.board.check("fewer", number(dut.best_fewer), choice.fewer, context)
        await self.clock.edge()

    def residues(self, count: int, choices: list[Choice]) -> None:
        """What remains of e in this clock."""
        dut, context = self.dut, f"{self.context}, clock {count}"
        n = (count - FIRST - RESIDUE) // program.CHOICE_CLOCKS
        if 0 <= n < twin.CHOICES:
            along = signed(number(dut.residues_along), f.WORD_WIDTH)
            self.board.check("along", along, choices[n].along, context)
            across = signed(number(dut.residues_beside), f.WORD_WIDTH)
            self.board.check("beside", across, choices[n].across, context)
        n = (count - FIRST - RESIDUE - 1) // program.CHOICE_CLOCKS
        if 0 <= n < twin.CHOICES:
            total = signed(number(dut.residues_total), f.WORD_WIDTH)
            self.board.check("total", total, choices[n].along + choices[n].across, context)

    def distance(self, choice: Choice, *, squares: bool) -> int:
        """The square of a distance, or any that there may be, ties among them."""
        if squares:
            return choice.square
        if self.least == FARTHEST:
            return self.rng.choice([0, MOST, self.rng.randint(0, MOST)])
        near = [self.least, self.least, self.least + 1, max(self.least - 1, 0)]
        return min(self.rng.choice([*near, self.rng.randint(0, MOST)]), MOST)

    async def run(self, task: Task, *, squares: bool, until: int) -> None:
        """Count from the clock before the first choice to the last comparison, or less far."""
        rng, choices = self.rng, task.choices()
        self.least = FARTHEST
        for count in range(FIRST - 1, until):
            self.place(task)
            if count < FIRST:
                self.scramble(task)
            if count <= FIRST and not task.idle:
                self.dut.row.value = rng.randrange(1, 7)
            total, n = self.noise(), None
            if count >= FIRST + COMPARE and (count - FIRST - COMPARE) % program.CHOICE_CLOCKS == 0:
                n = (count - FIRST - COMPARE) // program.CHOICE_CLOCKS
                total = self.distance(choices[n], squares=squares)
            await self.clock.settle()
            self.residues(count, choices)
            await self.tick(count, total)
            if n in task.compared():
                self.board.cover("tie", int(total == self.least))
                if total < self.least:
                    self.least, self.best = total, (n, choices[n])
                self.cover(task, choices[n])

    def cover(self, task: Task, choice: Choice) -> None:
        """What has been compared."""
        name = next(name for name, code in FAMILY_METHODS.items() if code == task.method)
        self.board.cover(f"{name} {('spoke', 'edge', 'alone', 'inside')[choice.kind]}")
        if choice.part in (0, TIME_STEPS):
            self.board.cover(f"time {choice.part}")

    def decision(self, task: Task) -> None:
        """Hold best against the twin's decision."""
        assert self.best is not None
        n, choice = self.best
        first, middle, last, t1, t2 = decided(task)
        context = f"{self.context}: {task}"
        if task.method == MPFC3:
            self.board.check("decision", (choice.other, task.leader), (last, first), context)
            if choice.kind != INSIDE:
                times = {SPOKE: (0, TIME_STEPS - choice.part), EDGE: (choice.part, 0),
                         ALONE: (choice.part, TIME_STEPS - choice.part)}  # fmt: skip
                self.board.check("decision", times[choice.kind], (t1, t2), context)
            return
        pair, part = [task.row, choice.other], choice.part
        if task.method == MPFC2 and n == 0:
            part = 0
        elif task.idle or (task.method == MPC2 and choice.fewer):
            part = TIME_STEPS - part
        if task.method == MPC2 and choice.fewer:
            pair.reverse()
            self.board.cover("fewer")
        self.board.check("decision", (*pair, part), (first, middle, t1), context)


@cocotb.test()
async def random_choices(dut) -> None:
    """Tasks of all methods, with the squares of their distances and with others."""
    given = arguments()
    rng = random.Random(given["seed"])
    bench = Bench(dut, rng, given["throttle"])
    for n in range(given["tasks"]):
        task = some_task(rng)
        squares = rng.random() < 0.6
        bench.context = f"task {n}: {task}"
        if given["throttle"]:
            begin = rng.choice([1, *[FIRST - 3] * 4])
            for count in [*[0] * rng.randrange(4), *range(begin, FIRST - 1)]:
                bench.scramble()
                await bench.tick(count, bench.noise())
        cut = n > 4 and rng.random() < 0.15
        until = rng.randint(FIRST, STABLE - 1) if cut else STABLE
        await bench.run(task, squares=squares, until=until)
        bench.scramble()
        if cut:
            # nothing is counted any more; the clock that tells it may be that of a comparison
            await bench.tick(0, FARTHEST)
            for _ in range(rng.randrange(1, 24)):
                bench.scramble()
                await bench.tick(0, bench.noise())
            bench.board.cover("cut")
            continue
        await bench.tick(STABLE, bench.noise())
        if squares and task.method != SVM:
            bench.decision(task)
        for _ in range(rng.randrange(6) * given["throttle"]):
            bench.scramble()
            await bench.tick(HELD, bench.noise())
    kinds = [*(f"{name} {kind}" for name in ("MPFC2", "MPC2", "SVM") for kind in ("spoke", "edge")),
             *(f"MPFC3 {kind}" for kind in ("spoke", "edge", "alone", "inside"))]  # fmt: skip
    few = given["tasks"] // 20
    checks = dict.fromkeys(("along", "beside", "total", "number", "part"), 20 * few)
    often = dict.fromkeys(("cut", "tie", "fewer", "time 0", f"time {TIME_STEPS}"), few // 2)
    bench.board.finish(
        checks | {"fewer": few, "decision": 5 * few}, often | dict.fromkeys(kinds, few)
    )
