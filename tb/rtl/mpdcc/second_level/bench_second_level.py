"""Cocotb side of ``test_second_level``."""

from __future__ import annotations

import itertools
import random
from dataclasses import dataclass
from typing import NamedTuple

import cocotb

from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.program import BASE, SUCCESSOR, SUCCESSOR_LENGTH
from tb.helpers import plain
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, join, number, signed
from tb.rtl.mpdcc.node_base.bench_node_base import NAMES, Words, alone, in_phases, results, value
from tb.rtl.mpdcc.node_shown.bench_node_shown import FIELDS, NODE_BITS, Shown
from tb.rtl.mpdcc.node_shown.bench_node_shown import field as words_of

#: A step of common_terms: to issue it, three clocks of the block, the register of its result.
STEP_CLOCKS = 5


def readable(result: str) -> int:
    """Clocks from successor.advance to the first in which a result can be read."""
    last = max(
        n for block in SUCCESSOR for n, step in enumerate(block) if step and step.result == result
    )
    return last + STEP_CLOCKS


# Clocks from successor.advance, as mpdcc_timing derives them.
ADVANCED = SUCCESSOR_LENGTH - 1 + STEP_CLOCKS  # every word is new
NATURAL_SLOPE = 10 + STEP_CLOCKS - 1  # common_terms stores it with the result of step 10
LINES = readable("phase_alpha") - 2  # capacitor_search reads the terms two clocks after its start
TAKEN = LINES + 1
TURN = readable("error_alpha")
LAST_ROW = 1 + 13 + 5  # of capacitor_search: 13 lines, five stages
HAND_OUT = LINES + LAST_ROW + 1 - (2 + 1 + 5)  # a leaf reads the table so long after its load

SHOWS = 3  # node_queue: clocks until an entry is shown
LAUNCH = 2  # leaf_dispatcher: clocks from load to the first leaf
SOON = 8  # leaf_dispatcher: clocks that its end is announced by, at most
SLOPE_DUE, ERROR_DUE = 2, 3  # node_shown: clocks from launch until common_terms is told
LEAD_DUE = 12  # node_shown: clocks from launch until L1 is taken
COSTED = 13  # explorer_fast: clocks from a candidate's slopes to its length
DRAINED = 19  # explorer_fast: clocks from the last leaf until it is compared
LEAF_BITS = 21
POOL = 100  # different terms of each kind


class Terms(NamedTuple):
    """Results of common_terms and the node that goes with them, also as the ports take them."""

    words: Words
    packed: int
    node: int
    fields: dict[str, list[int]]
    fits: bool  # every error fits what node_base keeps


def some_terms(rng: random.Random, *, fits: bool) -> Terms:
    """Any terms."""
    words, node = results(rng, fits), rng.getrandbits(NODE_BITS)
    packed = join([words[name] for name in NAMES], f.TERM_WIDTH)
    return Terms(words, packed, node, {name: words_of(node, name) for name in FIELDS}, fits)


class Candidate(NamedTuple):
    """A candidate of the root as explorer 0 shows it."""

    place: int
    position: tuple[int, ...]
    effort: int
    length: int

    @property
    def following(self) -> int:
        """Candidates that follow it."""
        return len(plain.candidates(self.position))


def in_order(candidates: list[Candidate]) -> list[Candidate]:
    """Nodes as they are looked at: smallest effort first, of one effort the latest first."""
    latest_first = candidates[::-1]
    return sorted(latest_first, key=lambda c: c.effort)


@dataclass
class Program:
    """A program of common_terms: of a node of the second level, or of k+1."""

    at: int  # the clock of successor.advance
    position: tuple[int, ...]
    steps: int
    slope: list[int]
    saturates: bool
    candidate: Candidate | None = None  # None: k+1
    table: int = 0
    handed_out: bool = False


@dataclass
class Inputs:
    """What the ports get in one clock."""

    phase: str
    terms: Terms
    rst: bool = False
    predict: bool = False
    capacitors: bool = False
    done: bool = False
    advanced: bool = False
    overflowed: bool = False
    slope: tuple[int, list[int]] | None = None
    unfit: bool = False
    candidate: Candidate | None = None
    saturates: bool = False  # if a program begins: a value of it will

    @property
    def follow(self) -> bool:
        """Whether there are no leaves."""
        return self.phase != "leaves"

    @property
    def completed(self) -> bool:
        """Whether the node of k+1 is complete."""
        return self.advanced and self.phase == "predicting"


@dataclass
class Origin:
    """What a decision starts from."""

    previous: tuple[int, ...]
    horizon: int
    budget: int


@dataclass
class Wanted:
    """What the second level does in one clock."""

    outputs: dict[str, int]
    leaves: list[int]
    begins: Candidate | None = None
    cuts: bool = False
    hands_out: Program | None = None


class Level:
    """The second level, from the header's words and the clocks above."""

    def __init__(self, explorers: int, board: Scoreboard) -> None:
        self.explorers, self.board = explorers, board
        # the root
        self.waiting: list[Candidate] = []  # in the order in which they came
        self.slopes: dict[int, list[int]] = {}
        self.kept: Terms | None = None
        self.before: Words = {}  # of the clock before
        self.start_fits: bool | None = None
        # the search
        self.begun: list[Program] = []
        self.shows: int | None = None  # the clock from which on an entry is shown
        self.opened = False
        self.left, self.cut, self.empty = 0, False, True
        # the leaves: when the next node may come, when that is announced, the last one with work
        self.free = self.soon = self.active = 0
        self.leaves: dict[int, list[int]] = {}
        self.launches: dict[int, Program] = {}
        # all programs that are still of use
        self.programs: list[Program] = []
        self.settled = False
        self.flag = False  # a value of k+1 saturated
        self.shown = Shown()

    @property
    def unfit(self) -> bool | None:
        """Whether k+1 cannot be predicted; None as long as nobody can know."""
        if self.kept is None or self.start_fits is None:
            return None
        return not (self.kept.fits and self.start_fits)

    def pending(self) -> list[Program]:
        """Nodes that are begun and not handed out."""
        return [one for one in self.begun if not one.handed_out]

    def wanted(self, now: int, given: Inputs, origin: Origin) -> Wanted:
        """What is to be seen in this clock."""
        pending, leaves = self.pending(), not given.follow
        for_leaves = [one for one in self.programs if one.candidate is not None]
        lines = [one for one in for_leaves if one.at + LINES == now]
        want = Wanted({}, self.leaves.get(now, []))
        if leaves and pending and now >= max(pending[0].at + HAND_OUT, self.free):
            want.hands_out = pending[0]
        # two nodes may be under way: the next begins once the leaves of the first are about to end
        room = not pending or (len(pending) == 1 and now >= self.soon)
        next_at = self.begun[-1].at + SUCCESSOR_LENGTH if self.begun else now
        shown = self.shows is not None and now >= self.shows
        if leaves and shown and not self.cut and room and now >= next_at:
            entry = in_order(self.waiting)[0]
            if origin.budget and entry.following > self.left:
                want.cuts = True
            else:
                want.begins = entry
        slope_due, error_due = self.shown.due(SLOPE_DUE), self.shown.due(ERROR_DUE)
        want.outputs = {
            "advance": int(given.predict or want.begins is not None),
            "show_slope": int(slope_due or given.completed),
            "show_error": int(error_due or given.completed),
            "preparation_capacitors": int(given.capacitors or given.completed or bool(lines)),
            "preparation_turn": int(
                given.done or given.completed or any(one.at + TURN == now for one in for_leaves)
            ),
            "preparation_show_turn": int(error_due or given.follow),
            "level_settle": int(given.completed),
            "level_cut": int(self.cut),
            "level_over": int(not pending and now > self.active and (self.cut or self.empty)),
            "level_saturated": int(self.flag),
            "level_whole": int(
                given.follow
                and given.candidate is not None
                and given.candidate.length == origin.horizon
            ),
        }
        if want.outputs["preparation_capacitors"]:
            want.outputs["preparation_successor"] = int(bool(lines))
            want.outputs["preparation_bank"] = lines[0].table if lines else 0
        if self.unfit is not None:
            want.outputs["level_unfit"] = int(self.unfit)
        return want

    def edge(self, now: int, given: Inputs, origin: Origin, want: Wanted) -> None:
        """All that changes behind this clock."""
        self.shown.edge(
            {
                "follow": given.follow,
                "node": given.terms.node,
                "words": given.terms.packed,
                "rst": given.rst,
                **self.reached(now),
            }
        )
        self.empty = not self.waiting
        self.root(now, given, origin)
        self.search(now, given, origin, want)
        if self.settled:
            self.flag = given.overflowed
        self.settled = given.completed and not given.rst
        if given.phase == "idle":
            self.flag = self.cut = self.opened = False
        if given.rst or given.phase == "idle":
            self.waiting, self.begun, self.shows = [], [], None
        if given.rst:
            self.programs, self.leaves, self.launches = [], {}, {}
            self.free = self.soon = self.active = now

    def reached(self, now: int) -> dict[str, int]:
        """L1 and the flag of the node whose leaves the explorers cost next."""
        program = self.launches.get(now - LEAD_DUE)
        if program is None:
            return {"lead": 0, "saturated": 0}
        return {"lead": program.steps, "saturated": int(program.saturates)}

    def root(self, now: int, given: Inputs, origin: Origin) -> None:
        """The node that is kept, and its candidates."""
        if given.done or given.completed:
            self.kept = given.terms
        self.before = given.terms.words
        if given.slope is not None and given.phase == "probing":
            self.start_fits = not given.unfit
        if given.follow:
            if given.slope is not None:
                self.slopes[given.slope[0]] = given.slope[1]
            if given.candidate is not None and given.candidate.length != origin.horizon:
                self.waiting.append(given.candidate)
        if given.predict:
            self.programs.append(
                Program(now, origin.previous, 1, self.slopes.get(0, []), given.saturates)
            )

    def search(self, now: int, given: Inputs, origin: Origin, want: Wanted) -> None:
        """The nodes, one after another."""
        if given.follow:
            self.left = origin.budget
            return
        if not self.opened:
            self.opened = True
            self.shows = now + SHOWS - 1 if self.waiting else None
        if self.begun and self.begun[-1].at + TAKEN == now:
            self.waiting.remove(self.begun[-1].candidate)
            self.shows = now + SHOWS if self.waiting else None
        self.cut |= want.cuts
        if want.begins is not None:
            c = want.begins
            self.board.cover("begun before the last is handed out", int(bool(self.pending())))
            self.left -= c.following
            program = Program(now, c.position, c.length, self.slopes[c.place], given.saturates)
            program.candidate, program.table = c, len(self.begun) % 2
            self.begun.append(program)
            self.programs.append(program)
            self.shows = None
        if want.hands_out is not None:
            self.hand_out(now, want.hands_out)

    def hand_out(self, now: int, program: Program) -> None:
        """The leaves of a node, as many a clock as explorers can take."""
        program.handed_out = True
        self.board.cover("leaves without a gap", int(now == self.free and now > 1))
        c = program.candidate
        packed = [
            a | b << 3 | s << 6 | c.effort + more << 9 | program.table << 14 | c.place << 15
            for (a, b, s), more in plain.candidates(c.position)
        ]
        block = len(anpc.NEXT_POSITIONS[c.position[2]])
        in_step = min(self.explorers, 4)
        clocks = [
            packed[n : min(n + in_step, last)]
            for last in range(block, len(packed) + 1, block)
            for n in range(last - block, last, in_step)
        ]
        each = -(-block // in_step)
        self.free = now + len(clocks)
        # blocks that are left when the end is announced, each of them as long as any
        spare = SOON // -(-4 // in_step)
        self.soon = now + 1 + max(0, len(packed) // block - spare) * each
        self.active = self.free + 1
        self.leaves |= {now + LAUNCH + n: leaves for n, leaves in enumerate(clocks)}
        self.launches[now + LAUNCH] = program


@dataclass
class Root:
    """A decision that the environment makes."""

    origin: Origin
    every: list[Candidate]  # in the order of enumeration
    come: list[Candidate]  # those with a length

    def nodes(self) -> list[Candidate]:
        """Candidates whose successors are to be looked at, in their order."""
        return in_order([c for c in self.come if c.length != self.origin.horizon])


class EndedError(Exception):
    """A reset has ended a decision."""


class Bench:
    """The scheduler, common_terms and explorer 0 around a second level."""

    def __init__(self, dut, rng: random.Random, explorers: int, throttle: float) -> None:
        self.dut, self.rng, self.throttle = dut, rng, throttle
        self.explorers = explorers
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.level = Level(explorers, self.board)
        self.origin = Origin((0, 0, 0), 1, 0)
        self.fuse: int | None = None  # clocks until a reset
        self.doomed = False  # a reset comes in the search
        self.overflowed = False
        self.fit = [some_terms(rng, fits=True) for _ in range(POOL)]
        self.unfit = [some_terms(rng, fits=False) for _ in range(POOL)]
        self.awake = False  # the first reset is over
        self.seen = 0  # nodes that were begun in a search

    # --- one clock --------------------------------------------------------------------------------

    async def tick(self, phase: str, *, rst: bool = False, **events) -> Wanted:
        """One clock of a phase: inputs, every output, the edge."""
        rng, level, now = self.rng, self.level, self.clock.count
        if self.fuse is not None:
            self.fuse -= 1
            rst = self.fuse < 0
        ending = [one for one in level.programs if one.at + ADVANCED == now]
        for one in level.programs:
            if one.at + ADVANCED + 1 == now:
                self.overflowed = one.saturates
        kept = events.get("done") or ending
        given = Inputs(
            phase,
            rng.choice(self.fit if rng.random() < (0.85 if kept else 0.5) else self.unfit),
            rst=rst,
            advanced=bool(ending),
            overflowed=self.overflowed,
            saturates=rng.random() < 0.5,
            **events,
        )
        if phase == "leaves":
            # an explorer shows its leaves there too
            length = rng.choice([self.origin.horizon, rng.randrange(2**f.LENGTH_WIDTH)])
            given.candidate = Candidate(rng.randrange(64), (0, 0, 0), rng.randrange(10), length)
            given.candidate = rng.choice([None, given.candidate])
            given.slope = rng.choice([None, (rng.randrange(64), [value(rng, 17) for _ in "ab"])])
            given.unfit = rng.random() < 0.5
        self.drive(given)
        await self.clock.settle()
        want = level.wanted(now, given, self.origin)
        if self.awake:
            self.check(given, want, now)
        await self.clock.edge()
        level.edge(now, given, self.origin, want)
        level.programs = [one for one in level.programs if one.at + 2 * ADVANCED > now]
        if self.fuse is not None and rst:
            self.fuse = None
            self.board.cover(f"reset while {phase or 'searching'}")
            raise EndedError
        return want

    def drive(self, given: Inputs) -> None:
        """Put a clock's inputs on the ports; those without a meaning are anything."""
        dut, rng = self.dut, self.rng
        for name in ("idle", "probing", "predicting", "leaves"):
            getattr(dut, name).value = int(given.phase == name)
        dut.rst.value = int(given.rst)
        dut.predict.value = int(given.predict)
        dut.capacitors.value, dut.done.value = int(given.capacitors), int(given.done)
        dut.advanced.value, dut.overflowed.value = int(given.advanced), int(given.overflowed)
        dut.issued.value, dut.saturated.value = rng.getrandbits(1), rng.getrandbits(1)
        dut.node.value, dut.words.value = given.terms.node, given.terms.packed
        dut.negative.value = rng.getrandbits(3)
        dut.previous.value = sum(p << (3 * x) for x, p in enumerate(self.origin.previous))
        dut.horizon.value, dut.budget.value = self.origin.horizon, self.origin.budget
        place, slope = given.slope or (rng.randrange(64), [value(rng, 17) for _ in "ab"])
        dut.evaluated_slope_valid.value = int(given.slope is not None)
        dut.evaluated_slope_index.value, dut.evaluated_slope.value = (
            place,
            join(slope, f.BASE_WIDTH),
        )
        dut.evaluated_unfit.value = (
            int(given.unfit) if given.slope is not None else rng.getrandbits(1)
        )
        c = given.candidate
        dut.evaluated_valid.value = int(c is not None)
        dut.evaluated_index.value = rng.randrange(64) if c is None else c.place
        dut.evaluated_effort.value = rng.randrange(10) if c is None else c.effort
        dut.evaluated_length.value = (
            rng.choice([self.origin.horizon, rng.randrange(64)]) if c is None else c.length
        )

    # --- what is compared -------------------------------------------------------------------------

    def check(self, given: Inputs, want: Wanted, now: int) -> None:
        """Hold every output in this clock."""
        dut, board = self.dut, self.board
        context = f"clock {now}, {given.phase}"
        for name, wanted in want.outputs.items():
            board.check(name, number(getattr(dut, name)), wanted, context)
        self.seen += number(dut.advance) if given.phase == "leaves" else 0
        # explorers take leaves in step, the first one first
        got = number(dut.leaf_valid)
        board.check("how many leaves", got, (1 << len(want.leaves)) - 1, context)
        if want.leaves:
            packed = int(str(dut.leaf.value).replace("U", "0").replace("X", "0"), 2)
            for i, leaf in enumerate(want.leaves):
                part = packed >> (LEAF_BITS * i) & (1 << LEAF_BITS) - 1
                board.check("leaf", part, leaf, f"{context}, explorer {i}")
        if now in self.level.launches:
            self.level.shown.since.append(0)
        self.check_shown(given, context)
        for program in self.level.programs:
            self.check_program(program, given, now)

    def check_shown(self, given: Inputs, context: str) -> None:
        """Hold the node that the explorers see, and how it was reached."""
        dut, board, shown = self.dut, self.board, self.level.shown
        board.check("second", number(dut.reached_second), int(not given.follow), context)
        if shown.weight is not None and shown.start is not None:
            packed = number(dut.shown)
            neutral, phase = shown.forced
            held = {"forced_neutral": neutral, "forced_phase": phase,
                    "weight_slope": shown.weight, "weight_start": shown.start}  # fmt: skip
            got = {name: words_of(packed, name) for name in FIELDS}
            board.check("shown", got, given.terms.fields | held, context)
        if shown.lead is not None:
            board.check("lead", number(dut.reached_lead), shown.lead, context)
        if shown.length is not None and not given.follow:
            board.check("length", number(dut.reached_length), shown.length, context)
        if shown.saturated is not None:
            board.check("flag", number(dut.reached_saturated), shown.saturated, context)

    def check_program(self, program: Program, given: Inputs, now: int) -> None:
        """Hold what common_terms reads for a program in this clock."""
        dut, board, since = self.dut, self.board, now - program.at
        context = f"clock {since} of {program}"
        if since == NATURAL_SLOPE:
            packed = number(dut.slope)
            kept, words = self.level.kept.words, given.terms.words
            got = [packed >> (x * f.TERM_WIDTH) for x in range(2)]
            want = [kept[f"slope_{x}"] + 2 * words[f"bend_step_{x}"] for x in ("alpha", "beta")]
            got, want = ([signed(one, f.TERM_WIDTH) for one in each] for each in (got, want))
            board.check("slope ahead", got, want, context)
        if not 1 <= since <= SUCCESSOR_LENGTH:
            return
        for step in (block[since - 1] for block in SUCCESSOR):
            if step is None:
                continue
            if step.b == "length_neutral":
                got = self.operand(step.a) * self.length(step.b)
                board.check("v_n", got, self.moved(program), context)
                continue
            if step.a in BASE and (want := self.operand_of(step.a, program, given)) is not None:
                board.check("operand", self.operand(step.a), want, f"{step.a}, {context}")
            if step.b.startswith("length"):
                want = self.length_of(step.b, program)
                board.check(
                    "length of a program", self.length(step.b), want, f"{step.b}, {context}"
                )

    def operand(self, name: str) -> int:
        """An operand A as it stands on the port."""
        bits = str(self.dut.base.value)[::-1]
        at = BASE.index(name) * f.OPERAND_WIDTH
        return signed(int(bits[at : at + f.OPERAND_WIDTH][::-1], 2), f.OPERAND_WIDTH)

    def length(self, name: str) -> int:
        """A signed length as it stands on the port."""
        width = f.LENGTH_WIDTH + 1
        at = ("length", "length_a", "length_b", "length_c", "length_neutral").index(name)
        return signed(number(self.dut.lengths) >> (at * width), width)

    def operand_of(self, name: str, program: Program, given: Inputs) -> int | None:
        """An operand as the specification makes it of the node; None if it has no meaning."""
        kept, now, before = self.level.kept.words, given.terms.words, self.level.before
        kind, _, axis = name.rpartition("_")
        # beta is b and half of a
        a, b = program.slope
        secant = before.get(f"bend_step_{axis}", 0) + (a if axis == "alpha" else b + (a >> 1))
        currents = in_phases(kept, "phase")
        if kind == "base_error" and not self.level.kept.fits:
            return None
        found = {
            "bend": lambda: now[f"curvature_{axis}"],
            "secant": lambda: secant,
            "drift": lambda: (now[f"reference_slope_{axis}"] - secant) >> 1,
            "base_error": lambda: kept[f"error_{axis}"],
            "base_phase": lambda: kept[f"phase_{axis}"],
            "base_midpoint": lambda: kept[f"midpoint_{axis}"],
            "midpoint_ahead": lambda: 4 * now[f"midpoint_{axis}"],
            "ahead": lambda: now[f"error_{axis}"],
            # the operand of phase c is its opposite
            "charge": lambda: -currents[2] if axis == "c" else currents["abc".index(axis)],
            "quarter": lambda: now["forced_link"] >> 2,
        }
        return found[kind]()

    def length_of(self, name: str, program: Program) -> int:
        """L1, or with the sign of the slope of a capacitor's error."""
        if name == "length":
            return program.steps
        x = "abc".index(name[-1])
        charged = int(anpc.CAPACITOR_CURRENT[program.position[x]]) * program.steps
        return charged if x == 2 else -charged

    def moved(self, program: Program) -> int:
        """What v_n moves by, over all steps."""
        mover = alone(list(program.position))
        if mover is None:
            return 0
        phase, sign = mover
        return sign * in_phases(self.level.kept.words, "midpoint")[phase] * program.steps

    # --- a decision -------------------------------------------------------------------------------

    def gap(self) -> int:
        """Clocks in which nothing new comes."""
        return self.rng.randrange(1, 6) if self.rng.random() < self.throttle else 0

    def some_slope(self) -> list[int]:
        """Slopes of i_a and i_b."""
        return [value(self.rng, f.BASE_WIDTH) for _ in "ab"]

    def new_root(self, n: int) -> Root:
        """Candidates and a budget that leaves nothing, all or something to be done."""
        rng = self.rng
        previous = tuple(rng.randrange(anpc.POSITIONS) for _ in range(3))
        longest = 2**f.LENGTH_WIDTH - 1
        horizon = 1 if rng.random() < 0.05 else rng.choice([longest, rng.randint(2, longest)])
        every = [
            Candidate(
                plain.choices(previous, s),
                s,
                effort,
                horizon if rng.random() < 0.15 else rng.randint(1, horizon),
            )
            for s, effort in plain.candidates(previous)
        ]
        share = rng.choice([0.05, 0.1, 0.2])
        come = [c for c in every if rng.random() < share]
        root = Root(Origin(previous, horizon, 0), every, come)
        counts = [c.following for c in root.nodes()]
        some = counts[: rng.randrange(1, max(2, len(counts)))]
        budgets = [0, sum(counts), sum(counts) - 1, sum(some), sum(some) - 1]
        root.origin.budget = max(0, [*budgets, rng.choice([26, 4095])][n % 6])
        return root

    async def probe(self, phase: str, clocks: int, done_at: int | None = None) -> None:
        """The probe's slopes, and what common_terms has left to say; not the answer's clock."""
        slope_at = self.rng.randrange(3, 6) + self.gap()
        for k in range(max(clocks, slope_at + 4) + self.gap()):
            events = {}
            if k == slope_at:
                events["slope"] = (0, self.some_slope())
                events["unfit"] = self.rng.random() < 0.2
            events["done"] = k == done_at
            await self.tick(phase, **events)

    async def prediction(self) -> None:
        """The node is taken on to k+1, and its probe is answered."""
        await self.tick("probing", predict=True)
        for _ in range(ADVANCED):
            await self.tick("predicting")
        self.board.cover("predicted")
        self.board.cover("prediction saturates", int(self.level.programs[-1].saturates))
        await self.probe("", 7)

    async def candidates(self, root: Root) -> None:
        """Explorer 0 shows slopes of all candidates of the root, and the length of some."""
        slopes, lengths, k = {}, {}, 4
        for c in root.every:
            k += 1 + self.gap()
            slopes[k] = c
            lengths[k + COSTED] = c
        for at in range(k + COSTED + self.rng.randrange(3, 6)):
            events = {}
            if at in slopes:
                events["slope"] = (slopes[at].place, self.some_slope())
                events["unfit"] = self.rng.random() < 0.5
            if at in lengths and lengths[at] in root.come:
                events["candidate"] = lengths[at]
            await self.tick("", **events)

    async def search(self, root: Root) -> None:
        """Nodes of the second level until no more leaves come."""
        if self.doomed:
            self.fuse = self.rng.randrange(120)
        nodes, budget, self.seen, quiet = root.nodes(), root.origin.budget, 0, 0
        while quiet < (DRAINED if nodes else 2):
            want = await self.tick("leaves")
            quiet = quiet + 1 if want.outputs["level_over"] else 0
        counts = [c.following for c in nodes]
        spent = list(itertools.accumulate(counts, initial=0))
        done = max(n for n, sum_so_far in enumerate(spent) if not budget or sum_so_far <= budget)
        cut = done < len(nodes)
        self.board.check("nodes", self.seen, done, f"{counts}, budget {budget}")
        self.board.check("cut at the end", number(self.dut.level_cut), int(cut), f"budget {budget}")
        self.board.longest("nodes", done)
        self.board.cover("search")
        self.board.cover("node", done)
        self.board.cover("node saturates", sum(p.saturates for p in self.level.begun))
        self.board.cover("empty search", int(not nodes))
        self.board.cover("no budget", int(not budget and done > 2))
        self.board.cover("budget exactly enough", int(spent[done] == budget > 0 and not cut))
        self.board.cover("budget exactly spent", int(spent[done] == budget > 0 and cut))
        self.board.cover("one too few", int(cut and spent[done + 1] == budget + 1))
        await self.tick("")

    async def decision(self, root: Root, *, compensate: bool, end: str) -> None:
        """All phases of one decision."""
        rng = self.rng
        self.origin = root.origin
        for k in range(1, 11):
            await self.tick("", capacitors=k == 7)
        await self.probe("probing", 8, done_at=4)
        if compensate and self.level.unfit is False:
            await self.prediction()
        else:
            self.board.cover("not to be predicted", int(compensate))
            await self.tick("probing")
        if end == "hold":
            return
        await self.candidates(root)
        if end == "one level" or not root.come:
            for _ in range(rng.randrange(4)):
                await self.tick("")
            return
        await self.search(root)

    async def between(self, clocks: int, resets: int = 0) -> None:
        """No decision is under way: what a decision starts from may change."""
        rng, self.fuse = self.rng, None
        for k in range(clocks):
            previous = tuple(rng.randrange(anpc.POSITIONS) for _ in range(3))
            self.origin = Origin(previous, rng.randrange(64), rng.randrange(2**f.BUDGET_WIDTH))
            await self.tick("idle", rst=k < resets)


@cocotb.test()
async def random_decisions(dut) -> None:
    """Decisions of all kinds one after another, some ended by a reset."""
    given = arguments()
    rng = random.Random(given["seed"])
    bench = Bench(dut, rng, given["EXPLORERS"], given["throttle"])
    await bench.between(3, 3)
    bench.awake = True
    for n in range(given["decisions"]):
        root, early = bench.new_root(n), n % 7 == 4
        if early:
            bench.fuse = rng.choice([rng.randrange(20, 50), rng.randrange(150)])
        bench.doomed = n % 3 == 2
        try:
            await bench.decision(
                root,
                compensate=early or rng.random() < 0.5,
                end=rng.choice(["hold", "one level", *["leaves"] * 10]),
            )
            await bench.between(rng.choice([1, 1, 2, 5]))
        except EndedError:
            resets = rng.choice([0, 0, 1, 3])
            await bench.between(rng.choice([1, 2, 4]) + resets, resets)
    decisions = given["decisions"]
    bench.board.finish(
        {"advance": 80 * decisions, "operand": 20 * decisions, "leaf": 20 * decisions,
         "shown": 80 * decisions, "length": 10 * decisions, "preparation_bank": decisions},
        {"predicted": 8, "not to be predicted": 2, "search": 10, "empty search": 1,
         "no budget": 1, "budget exactly enough": 2, "budget exactly spent": 1, "one too few": 2,
         "begun before the last is handed out": 20, "leaves without a gap": 20,
         "prediction saturates": 3, "node saturates": 10,
         "reset while leaves": 5, "reset while searching": 1, "reset while predicting": 1},
    )  # fmt: skip
