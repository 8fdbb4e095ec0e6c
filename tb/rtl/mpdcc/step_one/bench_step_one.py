"""Cocotb side of ``test_step_one``."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import cocotb
from cocotb.handle import LogicArrayObject, LogicObject

from directmpc.mpdcc import formats as f
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, join, number, word

WIDTH = f.TRAJECTORY_WIDTH
MOST = 2 ** (WIDTH - 1) - 1  # magnitude of an error
HALF = 2 ** (WIDTH - 2)
#: Magnitude of an excess of v_n, from which the weighted rule's word is made.
MOST_NEUTRAL = 2 ** (f.TERM_WIDTH - 1) + 2**f.CURRENT_TERM_WIDTH - 1
NEUTRAL = 3  # lane of v_n, behind those of the phases
#: Rows that do not move; rows that do.
RESTING = [0, 4, 8, 16]
MOVING = [4 * x + kind for x in range(3) for kind in (1, 2)] + list(range(17, 24))
#: Clocks from a candidate to its answers, as the entity's header has them: errors come a clock
#: behind it.
HELD, ALLOWED, DEAD = 1 + 3, 1 + 4, 1 + 5
#: Clocks from a candidate to the first in which the rows that it has read may change.
READ = 5
#: Decisions after which every register has been loaded.
SETTLED = 4


@dataclass(frozen=True)
class Variant:
    """What is built in."""

    second_level: bool
    weighted: bool
    inwards: bool

    @property
    def allowed(self) -> int:
        """Clocks from a candidate to its length."""
        return ALLOWED + self.second_level

    @property
    def dead(self) -> int:
        """Clocks from a candidate to its rank."""
        return DEAD + self.second_level + self.weighted


@dataclass(frozen=True)
class Limits:
    """What stays for a decision; the scale of its excesses besides."""

    bound: int
    horizon: int
    rule: int
    scale: int


@dataclass(frozen=True)
class Candidate:
    """What comes of a candidate in one clock."""

    probe: int
    errors: list[int]
    kinds: list[int]
    pattern: int
    gone: int
    index: int

    @property
    def largest(self) -> int:
        """Magnitude of the largest of the three errors."""
        return max(abs(e) for e in (*self.errors, sum(self.errors)))

    @property
    def rows(self) -> list[int]:
        """Rows that it reads, of phases a, b, c and of v_n."""
        return [*(4 * x + kind for x, kind in enumerate(self.kinds)), 16 + self.pattern]


@dataclass
class Node:
    """A root or a successor: its table, what is inside and outside, its candidates."""

    bank: int
    inside: list[int]  # phases, v_n
    outside: list[int]  # currents
    length: dict[int, int]  # by row
    excess: dict[int, int]
    candidates: list[Candidate] = field(default_factory=list)


@dataclass(frozen=True)
class Answer:
    """What has to come out."""

    held: int
    allowed: int
    rank: int
    index: int


def lane(row: int) -> int:
    """Which of three phases and v_n a row is of."""
    return min(row // 4, NEUTRAL)


def lengths(variant: Variant, limits: Limits, root: Node, node: Node, one: Candidate) -> list[int]:
    """Lengths of the four rows; what does not move has the root's, or the whole horizon."""
    found = []
    for row in one.rows:
        if row not in RESTING:
            found.append(node.length[row])
        elif variant.second_level and variant.inwards and node.inside[lane(row)]:
            found.append(limits.horizon)
        else:
            found.append(root.length[row])
    return found


def excesses(limits: Limits, root: Node, node: Node, one: Candidate) -> list[int]:
    """Excesses at k+1: of the currents, the phases, v_n."""
    rows = [(root if row in RESTING else node).excess[row] for row in one.rows]
    return [one.largest - limits.bound, *rows]


def weights(variant: Variant, limits: Limits) -> list[int]:
    """Factors of the excesses where the largest is looked for."""
    return [1, 1, 1, 1, 8 if variant.weighted and limits.rule else 1]


def answer(variant: Variant, limits: Limits, root: Node, node: Node, one: Candidate) -> Answer:
    """The answer by the definitions."""
    found = excesses(limits, root, node, one)
    currents = found[0]
    leaves = bool(one.gone) if variant.inwards else currents > 0 or any(node.outside)
    worst = max(w * e for w, e in zip(weights(variant, limits), found, strict=True))
    if variant.weighted:
        rank = 16 * worst + limits.rule * currents + 2 ** (f.RANK_WIDTH - 1)
    else:
        rank = worst + 2 ** (WIDTH - 1)
    allowed = 0 if leaves else min(lengths(variant, limits, root, node, one))
    return Answer(int(currents <= 0), allowed, rank, one.index)


# --- stimulus -------------------------------------------------------------------------------------


def chosen_limits(rng: random.Random) -> Limits:
    """Limits of a decision."""
    most = 2**f.BOUND_WIDTH - 1
    longest = 2**f.LENGTH_WIDTH - 1
    return Limits(
        bound=rng.choice([0, 1, most, rng.randint(0, most), rng.randint(0, 3000)]),
        horizon=rng.choice([1, longest, rng.randint(2, longest), rng.randint(2, longest)]),
        rule=rng.randrange(2),
        scale=rng.choice([2, 60, 4000, 2**17, 2**21]),
    )


def chosen_excess(rng: random.Random, variant: Variant, limits: Limits, row: int) -> int:
    """An excess: of the decision's scale, or any word."""
    weighs = row >= 16 and variant.weighted and limits.rule
    if rng.random() < 0.1:
        found = word(rng, WIDTH)
        return max(-MOST_NEUTRAL, min(MOST_NEUTRAL, found)) if weighs else found
    scale = limits.scale // 8 if weighs and rng.random() < 0.6 else limits.scale
    return rng.randint(-scale, scale)


def chosen_errors(rng: random.Random, limits: Limits) -> list[int]:
    """Errors of a and b: the largest of the three about its bound, or any word."""
    kind, sign = rng.random(), rng.choice([-1, 1])
    if kind < 0.06:
        # beyond half of the word, and smaller than the sum
        two = rng.choice([HALF + 1, MOST - 1, rng.randint(HALF + 1, MOST - 1)])
        one = rng.choice([1, MOST - two, rng.randint(1, MOST - two)])
        return [sign * one, sign * two] if rng.random() < 0.6 else [sign * two, sign * one]
    if kind < 0.25:
        most = limits.bound + rng.choice([0, 1])
    elif kind < 0.4:
        most = rng.choice([0, 1, MOST, HALF - 1, HALF, HALF + 1, rng.randint(0, MOST)])
    else:
        most = max(0, limits.bound + rng.randint(-limits.scale, limits.scale))
    part = rng.choice([0, 1, most // 2, most, rng.randint(0, most)])
    part = min(part, most)
    if rng.random() < 0.4:
        return [sign * part, sign * (most - part)]  # the sum is the largest
    found = [sign * most, -sign * part]
    return found if rng.random() < 0.5 else found[::-1]


def chosen_candidate(rng: random.Random, limits: Limits, probe: int | None = None) -> Candidate:
    """A candidate; some are probes."""
    return Candidate(
        probe=int(rng.random() < 0.05) if probe is None else probe,
        errors=chosen_errors(rng, limits),
        kinds=[rng.choice([0, 0, 1, 2]) for _ in range(3)],
        pattern=rng.choice([0, 0, 0, *range(8)]),
        gone=int(rng.random() < 0.3),
        index=rng.getrandbits(f.INDEX_WIDTH),
    )


def chosen_node(rng: random.Random, variant: Variant, limits: Limits, bank: int | None) -> Node:
    """A node with its table; the root has no bank, and all rows."""
    rows = MOVING if bank is not None else sorted([*RESTING, *MOVING])
    inside = [rng.randrange(2) for _ in range(4)]
    kind = rng.random()
    outside = [int(kind < 0.3 and x == int(10 * kind)) for x in range(3)]
    if kind > 0.95:
        outside = [rng.randrange(2) for _ in range(3)]
    some = [*[limits.horizon] * 5, 0]
    length = {
        row: rng.choice([*some, *(rng.randint(0, limits.horizon) for _ in range(6))])
        for row in rows
    }
    for row in RESTING:
        # what does not move and is inside stays there
        if row in rows and variant.inwards and inside[lane(row)]:
            length[row] = limits.horizon
    return Node(
        bank=bank or 0,
        inside=inside,
        outside=outside,
        length=length,
        excess={row: chosen_excess(rng, variant, limits, row) for row in rows},
        candidates=[chosen_candidate(rng, limits) for _ in range(rng.randint(1, 24))],
    )


def chosen_nodes(rng: random.Random, variant: Variant, limits: Limits) -> list[Node]:
    """The root of a decision, with a second level its successors, which take tables in turn."""
    bank = rng.randrange(2)
    nodes = [chosen_node(rng, variant, limits, None)]
    if variant.second_level:
        count = rng.randint(0, 6)
        nodes += [chosen_node(rng, variant, limits, (bank + n) % 2) for n in range(count)]
    return nodes


@dataclass
class Plan:
    """Which row and which candidate comes in which clock of a decision."""

    rows: dict[int, tuple[Node, int]]
    candidates: dict[int, tuple[Node, Candidate]]

    @property
    def clocks(self) -> range:
        """Clocks until nothing is under way."""
        return range(max(*self.rows, *self.candidates) + DEAD + 3)


def plan(rng: random.Random, nodes: list[Node], throttle: float) -> Plan:
    """Rows and candidates as early as they may come, or later.

    The first candidate of a node comes a clock before the last row, and reads a clock behind it.
    Rows of a table come as soon as the candidates of its last node have read.
    """
    found = Plan({}, {})

    def idle() -> int:
        clocks = 0
        while rng.random() < throttle:
            clocks += 1
        return clocks

    row_clock = clock = 0
    free = [0, 0]  # by table: clock from which its rows may change
    for node in nodes:
        row_clock = max(row_clock, free[node.bank])
        for row in rng.sample(list(node.length), len(node.length)):
            row_clock += idle()
            found.rows[row_clock] = (node, row)
            row_clock += 1
        clock = max(clock, row_clock - 2)
        for one in node.candidates:
            clock += idle()
            found.candidates[clock] = (node, one)
            clock += 1
        free[node.bank] = clock - 1 + READ
    return found


# --- bench ----------------------------------------------------------------------------------------


class Bench:
    """Drives a decision after the other, and holds every output in its clock."""

    def __init__(self, dut, variant: Variant, rng: random.Random) -> None:
        self.dut, self.variant, self.rng = dut, variant, rng
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.held: dict[int, tuple[Answer, str]] = {}  # by the clock in which it is due
        self.allowed: dict[int, tuple[Answer, str]] = {}
        self.dead: dict[int, tuple[Answer, str]] = {}

    def drive_row(self, coming: tuple[Node, int] | None) -> None:
        """A row of a node; where none comes the words are void."""
        dut, rng = self.dut, self.rng
        dut.write.value = int(coming is not None)
        if coming is not None:
            node, row = coming
            dut.row.value = row
            dut.row_length.value = node.length[row]
            dut.row_excess.value = bits(node.excess[row], WIDTH)
            dut.row_bank.value = node.bank
            dut.row_inside.value = node.inside[lane(row)]
        else:
            dut.row.value = rng.getrandbits(5)
            dut.row_length.value = rng.getrandbits(f.LENGTH_WIDTH)
            dut.row_excess.value = rng.getrandbits(WIDTH)
            dut.row_bank.value = rng.randrange(2)
            dut.row_inside.value = rng.randrange(2)

    def drive_candidate(self, node: Node, one: Candidate, *, valid: int) -> None:
        """A candidate of a node."""
        dut = self.dut
        dut.valid.value = valid
        dut.probe.value = one.probe
        dut.outside.value = sum(bit << x for x, bit in enumerate(node.outside))
        dut.errors.value = join(one.errors, WIDTH)
        dut.bank.value = node.bank
        dut.pattern.value = one.pattern
        dut.kinds.value = sum(kind << 2 * x for x, kind in enumerate(one.kinds))
        dut.gone.value = one.gone
        dut.index.value = one.index

    async def tick(self) -> None:
        """One clock with its checks."""
        await self.clock.settle()
        dut, check, now = self.dut, self.board.check, self.clock.count
        if now in self.held:
            want, context = self.held.pop(now)
            check("held", number(dut.held), want.held, context)
        if now in self.allowed:
            want, context = self.allowed.pop(now)
            check("allowed", number(dut.allowed), want.allowed, context)
        check("dead valid", number(dut.dead_valid), int(now in self.dead), f"clock {now}")
        if now in self.dead:
            want, context = self.dead.pop(now)
            check("rank", number(dut.dead_rank), want.rank, context)
            check("index", number(dut.dead_index), want.index, context)
        await self.clock.edge()

    async def power_up(self) -> None:
        """Any contents of the memories, which nothing may depend on."""
        rng, limits = self.rng, Limits(0, 2**f.LENGTH_WIDTH - 1, 0, 2**21)
        self.drive_candidate(
            chosen_node(rng, self.variant, limits, None), chosen_candidate(rng, limits), valid=0
        )
        for bank in range(1 + self.variant.second_level):
            node = chosen_node(rng, self.variant, limits, None)
            node.bank = bank
            for row in node.length:
                self.drive_row((node, row))
                await self.tick()
        self.drive_row(None)
        for _ in range(DEAD + 3):
            await self.tick()

    def check_drivers(self, context: str) -> None:
        """Every signal of the unit has one driver: none or two leave something undefined.

        A comparison takes an undefined bit for '0', a synthesis for what it likes.
        """
        for handle in self.dut.i_step:
            if isinstance(handle, LogicObject | LogicArrayObject):
                unknown = set(str(handle.value)) - {"0", "1"}
                self.board.check("driver", unknown, set(), f"{handle._name}, {context}")

    def expect(self, limits: Limits, root: Node, node: Node, one: Candidate) -> None:
        """Note what is due, and when."""
        want = answer(self.variant, limits, root, node, one)
        text = (
            f"{limits}, {one}, outside {node.outside}, bank {node.bank}, "
            f"lengths {lengths(self.variant, limits, root, node, one)}, "
            f"excesses {excesses(limits, root, node, one)}, inside {node.inside}"
        )
        now = self.clock.count
        self.held[now + HELD] = (want, text)
        if one.probe:
            self.board.cover("probe")
        else:
            self.allowed[now + self.variant.allowed] = (want, text)
            self.dead[now + self.variant.dead] = (want, text)
            self.cover(limits, root, node, one)

    def cover(self, limits: Limits, root: Node, node: Node, one: Candidate) -> None:
        """Count what had to happen."""
        variant, cover = self.variant, self.board.cover
        leaves = one.gone if variant.inwards else one.largest > limits.bound or any(node.outside)
        found = lengths(variant, limits, root, node, one)
        if not leaves and found.count(min(found)) == 1:
            cover(f"shortest {found.index(min(found))}")
        inside_alone = one.largest <= limits.bound and sum(node.outside) == 1
        if inside_alone and min(found) and not variant.inwards:
            cover(f"outside {node.outside.index(1)} alone")
        weighed = [
            w * e
            for w, e in zip(
                weights(variant, limits), excesses(limits, root, node, one), strict=True
            )
        ]
        if weighed.count(max(weighed)) == 1:
            cover(f"worst {weighed.index(max(weighed))}, rule {limits.rule}")
        cover("at the bound", int(one.largest == limits.bound))
        cover("one beyond", int(one.largest == limits.bound + 1))
        three = [abs(e) for e in (*one.errors, sum(one.errors))]
        if three.count(max(three)) == 1:
            cover(f"largest {three.index(max(three))}, sign {int(one.errors[0] < 0)}")
        first, second = one.errors
        large = abs(second) > HALF and first * second > 0
        cover("half a word", int(large and weighed.index(max(weighed)) == 0))
        rests = [row for row in one.rows if row in RESTING]
        cover("the root's from the second table", int(node.bank and bool(rests)))
        if variant.second_level and variant.inwards and not leaves:
            own = [root.length[r] if r in RESTING else node.length[r] for r in one.rows]
            cover("horizon instead of the root's", int(min(own) < min(found)))

    async def decide(self, throttle: float) -> None:
        """A decision: rows and candidates of its nodes."""
        rng, variant = self.rng, self.variant
        limits = chosen_limits(rng)
        self.dut.bound.value = limits.bound
        self.dut.horizon.value = limits.horizon
        self.dut.rule.value = limits.rule
        nodes = chosen_nodes(rng, variant, limits)
        planned = plan(rng, nodes, throttle)
        first = min(planned.candidates)
        for k in range(first):
            # the hold test does not wait for the rows
            if rng.random() < 0.1:
                planned.candidates[k] = (nodes[0], chosen_candidate(rng, limits, probe=1))
        for k in planned.clocks:
            self.drive_row(planned.rows.get(k))
            if k in planned.candidates:
                node, one = planned.candidates[k]
                self.drive_candidate(node, one, valid=1)
                self.expect(limits, nodes[0], node, one)
                before = planned.candidates.get(k - 1, (node, one))[0]
                self.board.cover("nodes back to back", int(before is not node))
                other = planned.rows.get(k, (node, 0))[0]
                self.board.cover("written while read", int(other.bank != node.bank))
            else:
                void = chosen_node(rng, variant, limits, None)
                void.bank = rng.randrange(1 + variant.second_level)
                self.drive_candidate(void, chosen_candidate(rng, limits), valid=0)
            await self.tick()


@cocotb.test()
async def random_decisions(dut) -> None:
    """Decisions with random tables and candidates."""
    given = arguments()
    variant = Variant(given["second_level"], given["weighted"], given["inwards"])
    bench = Bench(dut, variant, random.Random(given["seed"]))
    await bench.power_up()
    for n in range(given["decisions"]):
        await bench.decide(given["throttle"])
        if n >= SETTLED:
            bench.check_drivers(f"decision {n}")
    due = [*bench.held, *bench.allowed, *bench.dead]
    assert due == [], f"answers are still due in clocks {due}"
    candidates = given["decisions"] * (20 if variant.second_level else 8)
    covered = {"probe": 40, "at the bound": 60, "one beyond": 60, "half a word": 20}
    covered |= {f"shortest {n}": 30 for n in range(4)}
    covered |= {f"worst {n}, rule {rule}": 20 for n in range(5) for rule in range(2)}
    covered |= {f"largest {n}, sign {sign}": 30 for n in range(3) for sign in range(2)}
    if not variant.inwards:
        covered |= {f"outside {n} alone": 10 for n in range(3)}
    if variant.second_level:
        covered |= {"the root's from the second table": 200, "written while read": 100}
        covered |= {"nodes back to back": 10}
    if variant.second_level and variant.inwards:
        covered |= {"horizon instead of the root's": 60}
    bench.board.finish(
        {"held": candidates, "allowed": candidates, "rank": candidates, "driver": 1000}, covered
    )
