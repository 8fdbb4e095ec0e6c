"""Cocotb side of ``test_mptc_sequencer``."""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field

import cocotb

from directmpc.mptc import cycles
from directmpc.mptc import program as p
from scripts.hdl.mptc_job import FAMILY_METHODS
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

RULES = ("deadbeat", "mean", "best")
RULED = ("MPTC1", "MPTC2")
HEXAGON = ("MPFC2", "MPFC3", "MPC2", "SVM")
EVENTS = (
    "normalise", "orient", "square", "radicand", "begin_stream", "begin_pairs",
    "way_alpha", "way_beta", "rest", "last",
)  # fmt: skip


@dataclass
class Due:
    """What is due in a clock."""

    products: dict[int, p.Step] = field(default_factory=dict)
    words: set[tuple[int, str]] = field(default_factory=set)
    terms: set[tuple[int, str]] = field(default_factory=set)
    events: set[str] = field(default_factory=set)


NOTHING = Due()


class Program:
    """The model's program by addresses, of a sequencer with these options."""

    def __init__(self, *, flux: bool, family: bool) -> None:
        self.at: defaultdict[int, Due] = defaultdict(Due)
        for step in p.COMMON + p.MPTC:
            self.add(step, step.clock, step.clock + p.SUM_LATENCY)
        self.event("begin_stream", p.FIRST_LENGTH - 1)
        if flux:
            for step in p.COMMON:  # begun before the fork, written behind it
                if step.clock + p.SUM_LATENCY >= p.FORK:
                    self.write(step, p.address(step.clock + p.SUM_LATENCY, True))
            for step in p.MPFC:
                self.add(step, p.address(step.clock, True),
                         p.address(step.clock + p.SUM_LATENCY, True))  # fmt: skip
            shifts = range(p.NORMALISE, p.NORMALISE + p.NORMALISE_STEPS)
            for clock in shifts:
                self.event("normalise", p.address(clock, True))
            self.event("orient", p.address(shifts.stop, True))
            self.event("square", p.address(p.RADICAND + p.SUM_LATENCY, True))
            self.event("radicand", p.address(p.RADICAND + p.SUM_LATENCY + 1, True))
            stream = p.MPFC_FIRST_TERM - p.MPTC_FIRST_TERM + p.FIRST_LENGTH
            self.event("begin_stream", p.address(stream - 1, True))
        if family:
            for step in p.OPENING + p.PAIRS:
                self.add(step, p.pair_address(step.clock),
                         p.pair_address(step.clock + p.SUM_LATENCY))  # fmt: skip
            for step in p.HEXAGON:
                self.add(step, p.hexagon_address(step.clock), None)
            self.event("way_alpha", p.address(p.WAY + p.SUM_LATENCY, True))
            self.event("way_beta", p.address(p.WAY + p.SUM_LATENCY + 1, True))
            self.event("rest", p.hexagon_address(p.REST))

    def event(self, name: str, address: int) -> None:
        """An event at an address."""
        self.at[address].events.add(name)

    def add(self, step: p.Step, address: int, when: int | None) -> None:
        """A product at an address, and where it has a result, that one at another."""
        self.at[address].products[step.block] = step
        self.write(step, when)

    def write(self, step: p.Step, when: int | None) -> None:
        """A result at an address."""
        if step.result:
            assert when is not None
            due = self.at[when]
            kind = due.words if step.result in p.RESULTS else due.terms
            kind.add((step.block, step.result))


@dataclass(frozen=True)
class Task:
    """A decision: a method and its rule."""

    method: str
    rule: str

    @property
    def last(self) -> int:
        """Clock of valid."""
        return cycles.of(self.method, self.rule) - 1

    @property
    def flux(self) -> bool:
        """Whether it goes MPFC's way."""
        return self.method == "MPFC" or self.method in HEXAGON

    def address(self, clock: int) -> int:
        """Place of a clock in the program."""
        if self.method in HEXAGON:
            return p.hexagon_address(clock)
        if self.method in FAMILY_METHODS:
            return p.pair_address(clock, p.MPTC1_LEAD * (self.method == "MPTC1"))
        return p.address(clock, self.method == "MPFC")

    def pairs(self) -> int | None:
        """Clock before the first pair."""
        if self.method == "MPTC1":
            return p.FIRST_MPTC1 - 1 + p.QUOTIENT_GAIN * (self.rule == "deadbeat")
        return p.FIRST_PAIR - 1 if self.method in ("MPTC2", "GTV") else None

    def due(self, program: Program, clock: int) -> Due:
        """What is due in a clock before valid."""
        found = program.at[self.address(clock)]
        events = set(found.events)
        if clock == self.pairs():
            events.add("begin_pairs")
        if clock == self.last - 1:
            events.add("last")
        return Due(found.products, found.words, found.terms, events)


class Bench:
    """The entity, what runs in it, and what it has to show."""

    def __init__(self, dut, rng: random.Random, *, flux: bool, family: bool) -> None:
        self.dut, self.rng = dut, rng
        self.flux, self.family = flux, family
        self.program = Program(flux=flux, family=family)
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.task: Task | None = None
        self.n = 0
        self.ended: Task | None = None  # valid of this one is due
        self.behind_reset = False

    def scramble(self) -> None:
        """Any method on the inputs."""
        self.dut.method_mpfc.value = self.rng.getrandbits(1)
        self.dut.family_method.value = self.rng.randrange(8)
        self.dut.duty_rule.value = self.rng.randrange(3)

    def place(self, task: Task) -> None:
        """A method on the inputs, and what it leaves open at random."""
        dut, rng = self.dut, self.rng
        in_family = task.method in FAMILY_METHODS
        dut.method_mpfc.value = rng.getrandbits(1) if in_family else int(task.method == "MPFC")
        none = 0 if self.family else rng.randrange(8)
        dut.family_method.value = FAMILY_METHODS[task.method] if in_family else none
        dut.duty_rule.value = RULES.index(task.rule)

    def some_task(self) -> Task:
        """A method that the sequencer has."""
        names = ["MPTC", *["MPFC"] * self.flux, *[*FAMILY_METHODS] * self.family]
        return Task(self.rng.choice(names), self.rng.choice(RULES))

    async def tick(self) -> None:
        """One clock: everything shown is what is due."""
        dut, board, task = self.dut, self.board, self.task
        await self.clock.settle()
        where = f"{task}, clock {self.n}"
        due = task.due(self.program, self.n) if task else NOTHING
        if self.ended and self.family:
            # products and words of the clock of valid are those of other methods; nobody takes them
            due = self.program.at[self.ended.address(self.ended.last)]
        board.check("valid", number(dut.valid), int(self.ended is not None), where)
        board.check("busy", number(dut.busy), int(task is not None), where)
        starts = number(dut.start)
        if not number(dut.rst):
            board.check("accept", number(dut.accept), int(starts and not task), where)
        for name in EVENTS:
            board.check(name, number(getattr(dut, name)), int(name in due.events), where)
        for name, kinds, wanted in (
            ("words", p.RESULTS, due.words), ("terms", p.TERMS, due.terms),
        ):  # fmt: skip
            bits = sum(1 << (16 * block + kinds.index(kind)) for block, kind in wanted)
            board.check(name, number(getattr(dut, name)), bits, where)
        # only these products come from registers without a reset
        if not (self.behind_reset and self.flux and not self.family):
            self.products(due, where)
        if task:
            method = FAMILY_METHODS.get(task.method, 0)
            ruled = task.rule if task.method in RULED else ""
            shown = [number(port) for port in (dut.method, dut.mpfc, dut.mean, dut.both_duties)]
            wanted = [method, int(task.flux), int(ruled == "mean"), int(ruled == "best")]
            board.check("method", shown, wanted, where)
        await self.clock.edge()
        self.behind_reset, self.ended = bool(number(dut.rst)), None
        if self.behind_reset:
            self.task, self.n = None, 0
        elif task:
            self.n += 1
            if self.n == task.last:
                self.task, self.ended = None, task

    def products(self, due: Due, where: str) -> None:
        """What the blocks begin."""
        dut, board = self.dut, self.board
        issued = sum(1 << block for block in due.products)
        board.check("issue", number(dut.issue), issued, where)
        for block, step in due.products.items():
            half = step.b.removesuffix(p.base(step.b))
            for name, wanted in (
                ("gather", not step.seed), ("halve", half), ("lead", half == "lead_"),
            ):  # fmt: skip
                bit = number(getattr(dut, name)) >> block & 1
                board.check(name, bit, int(bool(wanted)), where)
            for name, kinds, wanted in (
                ("a", p.OPERANDS, step.a), ("b", p.OPERANDS, p.base(step.b)),
                *([("seed", p.SEEDS, step.seed)] if step.seed else []),
            ):  # fmt: skip
                value = number(getattr(dut, name)) >> (8 * block) & 255
                board.check(name, kinds[value], wanted, f"{where}, block {block}")


def some(bench: Bench, count: int) -> Iterator[tuple[Task, int]]:
    """Decisions, and the clocks before a reset, or all."""
    rng = bench.rng
    for _ in range(count):
        task = bench.some_task()
        yield task, rng.randrange(task.last) if rng.random() < 0.4 else task.last


def resets_anywhere(bench: Bench) -> Iterator[tuple[Task, int]]:
    """A reset in each clock of each way through the program."""
    for name in ("MPTC", *["MPFC"] * bench.flux, *["MPTC1", "MPTC2", "SVM"] * bench.family):
        task = Task(name, "best")
        yield from ((task, clocks) for clocks in range(task.last))


@cocotb.test()
async def programs(dut) -> None:
    """Decisions of every method, some of them reset; the next begins at once or later."""
    given = arguments()
    rng = random.Random(given["seed"])
    bench = Bench(dut, rng, flux=given["FLUX_CONTROL"], family=given["FAMILY"])
    dut.start.value = 0
    bench.scramble()
    await bench.clock.reset(3)
    bench.behind_reset = True
    for _ in range(3 * given["throttle"] + 1):
        await bench.tick()
    for task, until in [*some(bench, given["decisions"]), *resets_anywhere(bench)]:
        bench.place(task)
        dut.start.value = 1
        await bench.tick()
        bench.task, bench.n = task, 0
        while bench.task and bench.n < until:
            dut.start.value = int(rng.random() < 0.3 and bench.n < task.last - 1)
            bench.scramble()
            await bench.tick()
        if bench.task:
            dut.rst.value = 1
            for _ in range(rng.choice([1, 1, 3])):
                dut.start.value = rng.randrange(2)
                await bench.tick()
            dut.rst.value = dut.start.value = 0
            bench.board.cover("reset")
        else:
            bench.board.cover(f"{task.method} {task.rule if task.method in RULED else ''}".strip())
        dut.start.value = 0
        for _ in range(rng.choice([0, 1, 9]) * given["throttle"]):
            bench.scramble()
            await bench.tick()
    few = given["decisions"] // 150
    names = ["MPTC", *["MPFC"] * bench.flux]
    if bench.family:
        names += ["GTV", *HEXAGON, *(f"{name} {rule}" for name in RULED for rule in RULES)]
    bench.board.finish(
        dict.fromkeys((*EVENTS, "valid", "busy", "accept", "words", "terms", "issue", "a", "b",
                       "seed", "gather", "halve", "lead", "method"), 100 * few),
        {"reset": 30 * few} | dict.fromkeys(names, few),
    )  # fmt: skip
