"""Cocotb side of ``test_mptc_coordinates``."""

from __future__ import annotations

import random
from dataclasses import dataclass

import cocotb

from directmpc.mptc import formats as f
from directmpc.mptc import program
from directmpc.mptc.sequence import TIME_STEPS
from scripts.hdl.mptc_job import FAMILY_METHODS
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed, word

MPFC2, MPFC3, MPC2, SVM = (FAMILY_METHODS[name] for name in ("MPFC2", "MPFC3", "MPC2", "SVM"))
METHODS = (MPFC2, MPFC3, MPC2, SVM)

SUM_WIDTH = f.ACCUMULATOR_WIDTH
WIDTH = f.QUOTIENT_WIDTH + 2  # bits of a coordinate
ONE = 1 << f.HEXAGON_FRACTION  # the way of a vector

#: Low bits of a sum that a way and a coordinate of e are without.
WAY_SHIFT = f.PRODUCT_FRACTION - f.REST_FRACTION
E_SHIFT = WAY_SHIFT - 1
WAY_WIDTH = SUM_WIDTH - WAY_SHIFT - 2
SIZE_WIDTH = SUM_WIDTH - 1 - E_SHIFT
#: Largest quotient, and doublings of a way to the end of its range.
MOST = (1 << f.QUOTIENT_WIDTH - 1) - 1
RANGE = f.QUOTIENT_WIDTH - 1 - f.QUOTIENT_FRACTION

#: Clocks counted from the one in which e is taken: halved, turned, share, and the last one.
HALVED = f.FAR_STEPS + 1
TURNED = program.FIRST_CHOICE - program.REST
SHARED = TURNED + f.TIME_WIDTH + 1
LAST = program.HEXAGON_LAST - program.REST - 1
#: The counter stays there where nobody takes the decision.
HELD = LAST + 1


@dataclass(frozen=True)
class Sums:
    """Contents of the accumulators: the ways along alpha and beta, then -e along both."""

    way_alpha: int
    way_beta: int
    alpha: int
    beta: int


@dataclass(frozen=True)
class Missing:
    """e in coordinates of a leading vector."""

    leader: int
    g: int
    h: int
    far: int

    def turned(self) -> Missing:
        """The same e in coordinates of the vector 60 degrees on."""
        return Missing(self.leader + 1, self.g + self.h, -self.g, self.far)

    @property
    def share(self) -> int | None:
        """Time of the first vector where both fill the period; None where it has all of it."""
        return TIME_STEPS * self.g // (self.g + self.h) if self.h > 0 else None


def quotient(part: int, way: int) -> int:
    """How often a way goes into a part of e, cut off towards zero; the largest where beyond."""
    size = max(part, ~part)
    found = MOST if way <= 0 else min((size << f.QUOTIENT_FRACTION) // way, MOST)
    return found if part >= 0 else -found


def coordinates(sums: Sums) -> Missing:
    """e along u_1 and u_2: x = g + h/2 and y = h in ways of a vector, after halvings."""
    x, y = ~(sums.alpha >> E_SHIFT), ~(sums.beta >> E_SHIFT)
    way_x, way_y = sums.way_alpha >> WAY_SHIFT, sums.way_beta >> WAY_SHIFT
    far = 0
    for _ in range(f.FAR_STEPS):
        if max(x, ~x) < way_x << RANGE and max(y, ~y) < way_y << RANGE:
            break
        x, y, far = x >> 1, y >> 1, 1
    x, y = quotient(x, way_x), quotient(y, way_y)
    return Missing(1, 2 * x - y, 2 * y, far)


def stands(method: int, base: int, e: Missing) -> bool:
    """Whether the leading vector is the one that a method asks for."""
    if method == MPC2:
        return e.g >= e.h and e.g + 2 * e.h >= 0
    if method == SVM:
        return e.h >= 0 and (e.g > 0 or e.g == e.h == 0)
    return e.leader == base


def led(method: int, base: int, e: Missing) -> Missing:
    """The same where the leading vector stands where u_1 does."""
    while not stands(method, base, e):
        e = e.turned()
    return e


def some_place(rng: random.Random) -> tuple[int, int]:
    """Coordinates of e: at zero, in the hexagon, on its lines and an LSB beside, far away."""
    half, kind, less = ONE >> 1, rng.random(), rng.choice([-2, -1, 0, 0, 0, 1, 2])
    if kind < 0.06:
        return rng.choice([0, 0, 1, -1, 2]), rng.choice([0, 0, 2, -2])
    if kind < 0.12:
        return rng.randint(-2, 2) * half, rng.randint(-2, 2) * half
    if kind < 0.35:
        # in a triangle of two vectors and zero voltage, its last side among it
        h = rng.randint(0, ONE)
        e = Missing(1, rng.choice([ONE - h, rng.randint(0, ONE - h)]), h, 0)
        for _ in range(rng.randrange(6)):
            e = e.turned()
        return e.g, e.h
    along = rng.choice([rng.randint(-2 * ONE, 2 * ONE), rng.randint(-7 * ONE, 7 * ONE)])
    if kind < 0.65:
        # one of g, h and their sum is that of a line
        line = rng.choice([-2, -1, 0, 0, 1, 2]) * half + less
        return rng.choice([(line, along), (along, line), (line - along, along)])
    if kind < 0.85:
        # midway between two vectors, where the nearest one changes
        return rng.choice([(along + less, along), (less - 2 * along, along),
                           (along, less - 2 * along)])  # fmt: skip
    return rng.randint(-4 * ONE, 4 * ONE), rng.randint(-4 * ONE, 4 * ONE)


def some_way(rng: random.Random) -> int:
    """A way of a vector: of any size, hardly any, none, one below zero."""
    kind = rng.random()
    if kind < 0.02:
        return -rng.randrange(1, 1 << WAY_WIDTH - 1)
    if kind < 0.06:
        return rng.choice([0, 0, 1, (1 << WAY_WIDTH - 1) - 1])
    return rng.randrange(1, 1 << WAY_WIDTH - 1) >> rng.choice([0, 1, 2, rng.randrange(12)])


def some_sums(rng: random.Random) -> Sums:
    """Contents of the accumulators: any, at the end of the range, for some place of e."""
    ways = [some_way(rng), some_way(rng)]
    kind = rng.random()
    if kind < 0.1:
        parts = [word(rng, SIZE_WIDTH + 1) for _ in ways]
    else:
        g, h = some_place(rng)
        y = h >> 1
        # the smallest with this quotient
        sizes = [-(-abs(q) * way >> f.QUOTIENT_FRACTION)
                 for q, way in zip((g + y >> 1, y), ways, strict=True)]  # fmt: skip
        if kind < 0.2:
            at = rng.randrange(2)
            sizes[at] = max((ways[at] << RANGE) + rng.choice([-1, 0, 1]), 0)
        elif kind < 0.3:
            longer = rng.randrange(9)
            sizes = [size << longer for size in sizes]
        sizes = [min(max(size, 0), (1 << SIZE_WIDTH) - 1) for size in sizes]
        parts = [size if q > 0 or (q == 0 and rng.getrandbits(1)) else ~size
                 for q, size in zip((g + y >> 1, y), sizes, strict=True)]  # fmt: skip
    alpha, beta = (~(part << E_SHIFT | rng.getrandbits(E_SHIFT)) for part in parts)
    way_alpha, way_beta = (way << WAY_SHIFT | rng.getrandbits(WAY_SHIFT) for way in ways)
    return Sums(way_alpha, way_beta, alpha, beta)


class Bench:
    """The entity, the counter before it, and what was found last."""

    def __init__(self, dut, rng: random.Random) -> None:
        self.dut, self.rng = dut, rng
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.method, self.found = MPFC2, None
        self.context = ""

    def scramble(self) -> None:
        """Any inputs where none is read."""
        for name in ("sum", "sum_alpha", "sum_beta"):
            getattr(self.dut, name).value = self.rng.getrandbits(SUM_WIDTH)
        for name in ("way_alpha", "way_beta", "rest"):
            getattr(self.dut, name).value = 0
        self.dut.base.value = self.rng.randrange(1, 7)
        self.dut.method.value = self.rng.choice(METHODS)

    def check(self, count: int) -> None:
        """What has to be there this many clocks after that of rest."""
        dut, e, board = self.dut, self.found, self.board
        context = f"{self.context}, clock {count}"
        if e is None:
            return
        if count >= HALVED:
            board.check("far", number(dut.far), e.far, context)
        if count >= TURNED:
            board.check("leader", number(dut.leader), e.leader, context)
            for name, want in (("g", e.g), ("h", e.h), ("total", e.g + e.h)):
                board.check(name, signed(number(getattr(dut, name)), WIDTH), want, context)
        if count >= SHARED and self.method == SVM and e.share is not None:
            board.check("share", number(dut.share), e.share, context)

    async def tick(self, count: int, since: int | None = None) -> None:
        """One clock with a counter, which may have stopped since."""
        self.dut.clock.value = count
        await self.clock.settle()
        self.check(count if since is None else since)
        await self.clock.edge()

    async def idle(self, clocks: int) -> None:
        """Clocks in which nothing is counted; what was found stays."""
        for _ in range(clocks):
            self.scramble()
            await self.tick(0, LAST)

    async def begin(self, method: int, sums: Sums, pauses: int) -> None:
        """Both ways, then e."""
        dut, rng = self.dut, self.rng
        for name, key, value in (("way_alpha", "sum", sums.way_alpha),
                                 ("way_beta", "sum", sums.way_beta), ("rest", "", 0)):  # fmt: skip
            await self.idle(rng.randrange(pauses + 1))
            self.scramble()
            dut.method.value = method
            getattr(dut, name).value = 1
            if key:
                getattr(dut, key).value = bits(value, SUM_WIDTH)
            else:
                dut.sum_alpha.value = bits(sums.alpha, SUM_WIDTH)
                dut.sum_beta.value = bits(sums.beta, SUM_WIDTH)
            await self.tick(0, LAST)

    async def count(self, method: int, base: int, counts: list[int]) -> None:
        """Clocks behind the one of rest."""
        for count in counts:
            self.scramble()
            self.dut.method.value = method
            if method in (MPFC2, MPFC3):
                self.dut.base.value = base
            await self.tick(count)

    def cover(self) -> None:
        """What has been found."""
        name = next(name for name, code in FAMILY_METHODS.items() if code == self.method)
        e = self.found
        self.board.cover(f"{name} {e.leader}")
        self.board.cover("far", e.far)
        self.board.cover("nothing", int(e.g == e.h == 0))
        self.board.cover("largest", int(MOST * 2 in (abs(e.h), abs(e.g), abs(e.g + e.h))))
        if self.method == MPC2:
            self.board.cover("between two", int(e.g == e.h or e.g + 2 * e.h == 0))
        if self.method == SVM:
            self.board.cover("along one", int(e.h == 0))


@cocotb.test()
async def random_coordinates(dut) -> None:
    """Tasks of all methods, some of them given up."""
    given = arguments()
    rng = random.Random(given["seed"])
    bench = Bench(dut, rng)
    pauses = 3 * given["throttle"]
    for n in range(given["tasks"]):
        method, base, sums = rng.choice([*METHODS, SVM]), rng.randrange(1, 7), some_sums(rng)
        await bench.begin(method, sums, pauses)
        bench.method = method
        bench.found = led(method, base, coordinates(sums))
        bench.context = f"task {n}: method {method}, base {base}, {sums}"
        if rng.random() < 0.12:
            # as a reset of the counter does it
            await bench.count(method, base, list(range(1, rng.randint(2, LAST))))
            bench.found = None
            bench.board.cover("given up")
            await bench.idle(rng.randrange(pauses + 1))
            continue
        held = [HELD] * rng.randrange(pauses + 1)
        await bench.count(method, base, [*range(1, HELD), *held])
        bench.cover()
        await bench.idle(rng.randrange(2 * pauses + 1))
    few = given["tasks"] // 40
    often = {f"{name} {leader}": few // 4 for name in ("MPFC2", "MPFC3", "MPC2", "SVM")
             for leader in range(1, 7)}  # fmt: skip
    often |= dict.fromkeys(("far", "largest", "along one"), few)
    often |= dict.fromkeys(("nothing", "between two"), few // 3)
    bench.board.finish(
        dict.fromkeys(("far", "leader", "g", "h", "total"), 400 * few) | {"share": 80 * few},
        often | {"given up": few},
    )
