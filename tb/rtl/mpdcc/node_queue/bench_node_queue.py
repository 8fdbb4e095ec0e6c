"""Cocotb side of ``test_node_queue``."""

from __future__ import annotations

import random

import cocotb

from directmpc.mpdcc import formats as f
from tb.helpers import plain
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

EFFORTS = 10  # 0 to the most that a candidate takes
SLOPE_BITS = 2 * f.BASE_WIDTH
#: Clocks without an entry after the root is closed, and after one is taken.
BETWEEN = 2


class Root:
    """Candidates of one root in the order in which they come, and what is to come of them."""

    def __init__(self, rng: random.Random, share: float) -> None:
        self.previous = tuple(rng.randrange(8) for _ in range(3))
        self.horizon = rng.choice([2**f.LENGTH_WIDTH - 1, rng.randint(2, 2**f.LENGTH_WIDTH - 1)])
        every = [s for s, _ in plain.candidates(self.previous)]
        self.position = {plain.choices(self.previous, s): s for s in every}
        self.come = [place for place in self.position if rng.random() < share]
        few = rng.random() < 0.5  # efforts, so that lists are long
        self.effort = {p: rng.randrange(2 if few else EFFORTS) for p in self.come}
        self.length = {p: rng.choice([1, self.horizon, rng.randint(1, self.horizon)])
                       for p in self.come}  # fmt: skip
        self.slope = {p: rng.getrandbits(SLOPE_BITS) for p in self.position}

    def order(self) -> list[int]:
        """Places as they are shown: the smallest effort first, of one effort the latest."""
        found: list[int] = []
        for effort in range(EFFORTS):
            mine = [p for p in self.come if self.effort[p] == effort]
            found += [p for p in reversed(mine) if self.length[p] != self.horizon]
        return found


class Bench:
    """One queue, with inputs that are random where nothing is said of them."""

    def __init__(self, dut, rng: random.Random, throttle: float) -> None:
        self.dut, self.rng, self.throttle = dut, rng, throttle
        self.board, self.clock = Scoreboard(), Clock(dut)

    def scramble(self) -> None:
        """Nothing is evaluated, put in or taken."""
        dut, rng = self.dut, self.rng
        for name in ("evaluated_slope_valid", "evaluated_valid", "taken", "clear", "rst"):
            getattr(dut, name).value = 0
        dut.evaluated_slope_index.value = rng.getrandbits(f.INDEX_WIDTH)
        dut.evaluated_slope.value = rng.getrandbits(SLOPE_BITS)
        dut.evaluated_index.value = rng.getrandbits(f.INDEX_WIDTH)
        dut.evaluated_effort.value = rng.randrange(EFFORTS)
        dut.evaluated_length.value = rng.getrandbits(f.LENGTH_WIDTH)

    async def evaluate(self, root: Root) -> None:
        """The candidates come, each some clocks after its slopes."""
        dut, rng, board = self.dut, self.rng, self.board
        dut.open_root.value = 1
        dut.horizon.value = root.horizon
        dut.previous.value = sum(p << (3 * x) for x, p in enumerate(root.previous))
        slopes = list(root.position)
        coming, behind = list(root.come), []
        for _ in range(3):
            self.scramble()
            await self.clock.tick()
        while slopes or coming:
            self.scramble()
            if slopes and rng.random() >= self.throttle:
                place = slopes.pop(0)
                dut.evaluated_slope_valid.value = 1
                dut.evaluated_slope_index.value, dut.evaluated_slope.value = (
                    place,
                    root.slope[place],
                )
                behind.append(place)
            now = None
            if coming and coming[0] in behind[:-4] + (behind if not slopes else []):
                now = coming.pop(0) if rng.random() >= self.throttle else None
            if now is not None:
                dut.evaluated_valid.value = 1
                dut.evaluated_index.value, dut.evaluated_effort.value = now, root.effort[now]
                dut.evaluated_length.value = root.length[now]
            else:
                dut.evaluated_length.value = rng.choice(
                    [root.horizon, rng.getrandbits(f.LENGTH_WIDTH)]
                )
            await self.clock.settle()
            whole = now is not None and root.length[now] == root.horizon
            board.check("whole", number(dut.whole), int(whole), f"{now}")
            board.check("none is shown", number(dut.valid), 0)
            await self.clock.edge()
        for _ in range(4):
            self.scramble()
            await self.clock.tick()
        await self.clock.settle()
        # the probe's slopes, which the prediction takes
        board.check("slope of place 0", number(dut.entry_slope), root.slope[0])
        board.check("empty", number(dut.empty), int(not root.order()))

    async def take(self, root: Root, cut: int | None) -> None:
        """Entries are taken one after another."""
        dut, rng, board = self.dut, self.rng, self.board
        self.scramble()
        dut.open_root.value = 0
        for n, place in enumerate(root.order()):
            if cut == n:
                return
            for k in range(BETWEEN):
                await self.clock.settle()
                board.check("not shown yet", number(dut.valid), 0, f"clock {k}")
                board.check("whole", number(dut.whole), 0, f"clock {k}")
                await self.clock.edge()
                self.scramble()
                dut.evaluated_valid.value = dut.evaluated_slope_valid.value = rng.randrange(2)
                if rng.random() < 0.5:
                    dut.evaluated_length.value = root.horizon
            wait = rng.randrange(1, 5) if rng.random() < self.throttle else 0
            for k in range(wait + 1):
                dut.taken.value = int(k == wait)
                await self.clock.settle()
                board.check("shown", number(dut.valid), 1, f"entry {n}")
                board.check("empty", number(dut.empty), 0)
                got = (
                    number(dut.entry_index), number(dut.entry_effort), number(dut.entry_length),
                    number(dut.entry_position),
                )  # fmt: skip
                position = sum(p << (3 * x) for x, p in enumerate(root.position[place]))
                want = (place, root.effort[place], root.length[place], position)
                board.check("entry", got, want, f"entry {n}")
                if k:
                    board.check("slopes", number(dut.entry_slope), root.slope[place])
                await self.clock.edge()
                self.scramble()
            # slopes stay a clock behind the entry
            await self.clock.settle()
            if not wait:
                board.check("slopes", number(dut.entry_slope), root.slope[place])
        for k in range(6):
            await self.clock.settle()
            board.check("none is left", number(dut.valid), 0)
            if k >= 1 + bool(root.order()):
                board.check("empty", number(dut.empty), 1)
            await self.clock.edge()
            self.scramble()
        board.cover("all taken")


@cocotb.test()
async def random_roots(dut) -> None:
    """Roots whose candidates are all taken, or some of them; then the queue is emptied."""
    given = arguments()
    rng = random.Random(given["seed"])
    bench = Bench(dut, rng, given["throttle"])
    bench.scramble()
    dut.open_root.value = 0
    await bench.clock.reset(3)
    for _ in range(given["roots"]):
        root = Root(rng, rng.choice([0.0, 0.2, 1.0, 1.0]))
        await bench.evaluate(root)
        cut = rng.randrange(64) if rng.random() < 0.3 else None
        await bench.take(root, cut)
        name = rng.choice(["clear", "rst"])
        getattr(dut, name).value = 1
        await bench.clock.tick()
        bench.scramble()
        await bench.clock.tick()
        await bench.clock.settle()
        bench.board.check("emptied", number(dut.empty), 1, name)
        bench.board.check("emptied", number(dut.valid), 0, name)
        bench.board.cover(name)
    bench.board.finish(
        {"entry": 10 * given["roots"], "slopes": 10 * given["roots"]},
        {"all taken": 5, "clear": 2, "rst": 2},
    )
