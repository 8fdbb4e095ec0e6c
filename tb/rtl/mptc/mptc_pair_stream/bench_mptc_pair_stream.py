"""Cocotb side of ``test_mptc_pair_stream``."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import cocotb

from directmpc.mptc import bit_true_sequences as twin
from directmpc.mptc import formats as f
from directmpc.mptc import program
from directmpc.mptc.bit_true import VECTOR_ALPHA, VECTOR_BETA
from directmpc.mptc.inverter import ZERO_FROM
from directmpc.mptc.sequence import TIME_STEPS
from scripts.hdl.mptc_job import FAMILY_METHODS
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed

NONE = 0
MPTC1, MPTC2, GTV = (FAMILY_METHODS[name] for name in ("MPTC1", "MPTC2", "GTV"))
DEADBEAT, MEAN, BEST = "deadbeat", "mean", "best"
KINDS = (
    (NONE, DEADBEAT), (MPTC1, DEADBEAT), (MPTC1, MEAN), (MPTC1, BEST), (MPTC2, DEADBEAT),
    (MPTC2, MEAN), (MPTC2, BEST), (GTV, DEADBEAT),
)  # fmt: skip

#: Clocks from the one that follows begin_pairs to a result, for place 0; then from a result on.
RESULT = dict.fromkeys((DEADBEAT, BEST), program.PAIR_AHEAD + program.DUTY_CLOCKS + 1)
RESULT[MEAN] = program.PAIR_AHEAD + program.ROOT_CLOCKS + 1
WAY = program.PAIR_REGISTERS - 2  # the ways are in the accumulators
TORQUE = program.PAIR_REGISTERS - 1 + program.STREAM_TERM + program.SEED_WAIT
COST = program.PAIR_REGISTERS - 1 + program.STREAM_COMPARE
PRODUCT = program.PAIR_REGISTERS - 1  # product is that of the pair
#: Fewest clocks from the end of a decision to begin_pairs of the next one.
GAP = program.FIRST_PAIR
#: Clocks in which ranks come out that were on their way at an end or at a reset.
STALE = COST + 2
#: Second vector in the rank of a pair whose duty the length tells.
BY_LENGTH = 1

VECTORS = [(int(VECTOR_ALPHA[u]), int(VECTOR_BETA[u])) for u in range(7)]
MOST_TERM = 1 << f.TORQUE_FRACTION  # of a step; errors reach three of them
FINE = 1 << f.DUTY_SHIFT


def direction_of(first: int, second: int) -> int:
    """Active vector that is the first one less the second."""
    (a, b), (c, d) = VECTORS[first], VECTORS[second]
    return VECTORS.index((a - c, b - d))


def positive(error: int, span: int) -> tuple[int, int]:
    """Dividend and divisor, complements where the divisor is negative."""
    return (~error, ~span) if span < 0 else (error, span)


def quotient(error: int, span: int) -> int:
    """Duty that takes an error away, by one division."""
    error, span = positive(error, span)
    if span == 0 or error >= span:
        return TIME_STEPS - 1
    return max(error, 0) * TIME_STEPS // span


@dataclass(frozen=True)
class Pair:
    """A pair with its duty, and the clock of it; clocks from the one behind begin_pairs on."""

    clock: int
    first: int
    second: int
    direction: int
    duty: int

    @property
    def rank(self) -> int:
        """Both vectors."""
        return self.first << 3 | self.second

    @property
    def sequence(self) -> tuple[int, int, int, int, int]:
        """What it applies."""
        second = int(ZERO_FROM[self.first]) if self.second in (0, BY_LENGTH) else self.second
        return self.first, second, second, self.duty, TIME_STEPS - self.duty


NOTHING = Pair(0, 0, 0, 0, 0)


@dataclass
class Decision:
    """Inputs of a decision."""

    method: int
    rule: str
    leader: int
    along: int
    across: int
    level: int
    opening: int
    rotor_alpha: int
    lengths: list[int] = field(default_factory=list)  # of u_1 to u_6, then without voltage

    def change(self, vector: int) -> int:
        """Torque of a vector, in quarters of a torque term."""
        alpha, beta = VECTORS[vector]
        return alpha * self.along - 2 * beta * self.across

    @property
    def error(self) -> int:
        """Torque error without voltage, the same; by the mean both errors, added."""
        complement = self.rotor_alpha >> (f.TORQUE_SHIFT - f.DUTY_SHIFT)
        if self.rule == MEAN:
            return FINE * (self.level + self.opening) - 2 * complement
        return FINE * self.level - complement

    def by_torque(self, first: int, second: int) -> int:
        """Duty of a pair."""
        span = self.change(direction_of(first, second))
        if self.rule == MEAN:
            return int(twin.mean_search(self.error, span))
        return quotient(self.error - self.change(second), span)

    def by_length(self, first: int) -> int:
        """Duty of a vector with zero voltage that makes the length the reference's."""
        without = self.lengths[6]
        return quotient(without, without - self.lengths[first - 1])

    def crossed(self, first: int, second: int) -> bool:
        """Whether one vector has more torque than the reference, and the other has not."""
        return (self.change(first) > self.error) != (self.change(second) > self.error)

    def searched(self, first: int, second: int) -> bool:
        """Whether a duty is between 0 and 1."""
        span = self.change(direction_of(first, second))
        error, span = positive(self.error - self.change(second), span)
        return 0 <= error < span

    def pairs(self) -> list[Pair]:
        """Pairs in the order in which they come."""
        found: list[Pair] = []

        def take(place: int, first: int, second: int, duty: int) -> None:
            clock = program.PAIR_SPACING * place + RESULT[self.rule]
            direction = direction_of(first, 0 if second == BY_LENGTH else second)
            found.append(Pair(clock, first, second, direction, duty))

        if self.method == MPTC1:
            take(0, self.leader, 0, self.by_torque(self.leader, 0))
            if self.rule == BEST:
                take(1, self.leader, BY_LENGTH, self.by_length(self.leader))
        if self.method in (MPTC2, GTV):
            for place, (first, _) in enumerate(program.PAIR_SLOTS[: program.LAST_ZERO + 1]):
                waits = self.rule == MEAN and place >= program.LAST_ZERO - 1
                late = place + program.ROOT_PAUSE * waits
                take(late, first, 0, self.by_torque(first, 0))
        if self.method == MPTC2 and self.rule == BEST:
            for place, (first, _) in program.LENGTH_SLOTS.items():
                take(place, first, BY_LENGTH, self.by_length(first))
        if self.method == GTV:
            edges = program.PAIR_SLOTS[program.LAST_ZERO + 1 : program.FIRST_CROSSED]
            # without any the first pair is looked up again
            crossed = [edge for edge in edges if self.crossed(*edge)] or edges[:1]
            again = {program.FIRST_CROSSED: crossed[0], program.LAST_CROSSED: crossed[-1]}
            for place in range(program.LAST_ZERO + 1, len(program.PAIR_SLOTS)):
                edge = again.get(place, program.PAIR_SLOTS[place])
                # one that needs a search waits for its second look-up; the table's end is filled up
                if place in again or not self.searched(*edge):
                    take(place, *edge, self.by_torque(*edge))
        return found

    def ends(self) -> int:
        """Clock of the last result that counts."""
        if self.method == GTV:
            return program.PAIR_SPACING * program.LAST_CROSSED + RESULT[self.rule]
        return self.pairs()[-1].clock


def some_length(rng: random.Random) -> int:
    """An error of a length, a word."""
    high = (1 << f.WORD_WIDTH - 1) - 1
    small = rng.randint(-high - 1, high) >> rng.choice([3, 8, 14])
    return rng.choice([rng.randint(-high - 1, high), small, small, high, ~high, 0, -1])


def some_decision(rng: random.Random, method: int, rule: str) -> Decision:
    """Torques of any size; the reference anywhere, or as near to a vector's torque as can be."""
    scale = MOST_TERM >> rng.choice([0, 0, 0, 1, 4, 9, 16, 20])
    terms = [*[rng.randint(-scale, scale) for _ in range(5)], scale, -scale, 0, rng.choice([1, -1])]
    made = Decision(
        method, rule, rng.randrange(1, 7), rng.choice(terms), rng.choice(terms), 0, 0, 0
    )
    changes = [made.change(vector) for vector in range(7)]
    most = max(map(abs, changes)) + 2
    rail = 3 * MOST_TERM
    far = FINE * rail * (2 if rule == MEAN else 1)
    between = sorted((0, made.change(made.leader)))
    error = rng.choice([
        *[rng.randint(*between) for _ in range(3)], *[rng.randint(-most, most) for _ in range(3)],
        rng.randint(-2 * most, 2 * most), far, -far,
        *[rng.choice(changes) + rng.randint(-1, 1) for _ in range(3)],
    ])  # fmt: skip
    share = 2 if rule == MEAN else 1
    # what the complement takes away makes the error a whole term
    error -= error % share
    complement = rng.randrange(-32, 32)
    complement += -(error // share + complement) % (FINE // share)
    complement -= 32 * (complement > 31)
    total = min(max((error + share * complement) // FINE, -share * rail), share * rail)
    made.rotor_alpha = complement << (f.TORQUE_SHIFT - f.DUTY_SHIFT) | rng.getrandbits(12)
    if rule == MEAN:
        made.level = rng.randint(max(-rail, total - rail), min(rail, total + rail))
        made.opening = total - made.level
    else:
        made.level = total
        made.opening = signed(rng.getrandbits(f.TORQUE_WIDTH), f.TORQUE_WIDTH)
    without = some_length(rng)
    # the reference between both lengths, a length that no vector changes, or any
    made.lengths = [
        rng.choice([~without >> rng.randrange(4), without, some_length(rng), some_length(rng)])
        for _ in range(6)
    ]
    made.lengths.append(without)
    return made


class Bench:
    """The entity, and what is the cheapest pair so far."""

    def __init__(self, dut, rng: random.Random, throttle: int) -> None:
        self.dut, self.rng, self.throttle = dut, rng, throttle
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.best: Pair | None = None
        self.stale = STALE
        self.products: dict[int, int] = {}
        self.held: dict[str, int] = {}

    def put(self, **inputs: int) -> None:
        """Write what is not there already."""
        for name, value in inputs.items():
            if self.held.get(name) != value:
                self.held[name] = value
                getattr(self.dut, name).value = value

    def scramble(self) -> None:
        """Inputs of a clock in which nothing is asked and nothing begins."""
        rng = self.rng
        place, error = rng.getrandbits(3), rng.getrandbits(f.WORD_WIDTH)
        self.put(begin_pairs=0, last=0, leader=rng.randrange(1, 7), cheaper=rng.getrandbits(1))
        self.put(length_take=0, length_place=place, length_error=error)

    def scramble_method(self) -> None:
        """Any method, while there is none."""
        method, rule = self.rng.choice(KINDS)
        self.place_method(method, rule)

    def place_method(self, method: int, rule: str) -> None:
        """A method and its rule."""
        self.put(method=method, mean=int(rule == MEAN), both_duties=int(rule == BEST))

    def place_state(self, given: Decision, clock: int) -> None:
        """Torque terms as mptc_datapath writes them: the steps' a clock before level."""
        for name, since in (("along", 1), ("across", 1), ("level", 2), ("opening", 0)):
            value = getattr(given, name) if clock >= since else self.rng.getrandbits(f.TORQUE_WIDTH)
            self.put(**{name: bits(value, f.TORQUE_WIDTH)})
        rotor = given.rotor_alpha if clock >= 0 else self.rng.getrandbits(f.WORD_WIDTH)
        self.put(rotor_alpha=bits(rotor, f.WORD_WIDTH))

    def lengths(self, given: Decision) -> dict[int, tuple[int, int]]:
        """Clock -> place and error of a length; that without voltage is the last one."""
        rng = self.rng
        # as the single vectors pass: before MPTC1's pair, and beside the first pairs
        first = -8 if given.method == MPTC1 else 3
        clocks, order = list(range(first, first + 7)), list(range(6))
        if self.throttle:
            clocks = sorted(rng.sample(range(-GAP + 1, 2 if given.method == MPTC1 else 12), 7))
            rng.shuffle(order)
        order.append(6)
        places = [(vector + 1 + program.LENGTH_LATENCY) % 8 for vector in order]
        errors = [given.lengths[vector] for vector in order]
        return dict(zip(clocks, zip(places, errors, strict=True), strict=True))

    def check(self, clock: int, pairs: list[Pair], context: str) -> None:
        """Every output that is told of in this clock."""
        dut, check = self.dut, self.board.check
        found, way, torque, cost = (
            next((pair for pair in pairs if pair.clock + late == clock), None)
            for late in (0, WAY, TORQUE, COST)
        )
        check("found", number(dut.found_take), int(found is not None), context)
        if found is not None:
            check("duty", number(dut.found_duty), found.duty, context)
            second = 0 if found.second == BY_LENGTH else found.second
            check("second", number(dut.found_second), second, context)
            check("direction", number(dut.found_direction), found.direction, context)
        check("way", number(dut.tried_enable), int(way is not None), context)
        check("torque", number(dut.tried_take), int(torque is not None), context)
        if torque is not None:
            product = self.products[clock - TORQUE + PRODUCT]
            left = signed(product >> f.TORQUE_SHIFT, f.TORQUE_WIDTH)
            check("left", signed(number(dut.tried_left), f.TORQUE_WIDTH), left, context)
        check("cost", number(dut.tried_compare), int(cost is not None), context)
        if self.stale:
            self.stale -= 1
        else:
            check("rank", number(dut.tried_rank), cost.rank if cost else 0, context)
        check("cheapest", number(dut.tried_best), self.best.rank if self.best else 0, context)

    def chosen(self, pair: Pair, context: str) -> None:
        """What is to be applied."""
        names = ("u1", "u2", "u3", "t1", "t2")
        got = tuple(number(getattr(self.dut, f"chosen_{name}")) for name in names)
        self.board.check("chosen", got, pair.sequence, context)

    async def decide(self, given: Decision, context: str, *, cut: bool) -> None:
        """One decision from the end of the one before; cut: a reset ends it before."""
        rng, board = self.rng, self.board
        pairs, lengths = given.pairs(), self.lengths(given)
        # pairs that are compared; of MPTC1 with one duty none is
        alone = given.method == MPTC1 and given.rule != BEST
        tried = [] if alone else pairs
        end = -GAP + rng.randrange(2, 2 * GAP)
        if alone:
            end = pairs[0].clock
        elif pairs:
            late = rng.choice([0, 0, rng.randrange(12), rng.randrange(12), 60]) * self.throttle
            end = given.ends() + COST + 1 + late
            board.cover("long after", int(late == 60))
        reset = rng.randrange(-GAP, end) if cut else None
        self.products = {}
        for clock in range(-GAP - rng.randrange(6) * self.throttle, end + 1):
            self.scramble()
            if clock > -GAP:
                self.place_method(given.method, given.rule)
            elif self.throttle:
                self.scramble_method()
            if clock <= 2:
                self.place_state(given, clock)
            if given.method == MPTC1 and 1 <= clock < RESULT[given.rule] + COST:
                self.put(leader=given.leader)
            self.put(begin_pairs=int(clock == -1 and given.method != NONE))
            self.put(last=int(clock == end), rst=int(clock == reset))
            # with GTV no single vector passes
            if clock in lengths and given.method != GTV:
                place, error = lengths[clock]
                error = bits(error, f.WORD_WIDTH)
                self.put(length_take=1, length_place=place, length_error=error)
            self.products[clock] = rng.getrandbits(f.ACCUMULATOR_WIDTH)
            self.put(product=self.products[clock])
            compared = next((pair for pair in tried if pair.clock + COST == clock), None)
            cheaper = int(compared is not None and (self.best is None or rng.random() < 0.5))
            if compared is not None:
                self.put(cheaper=cheaper)
            await self.clock.settle()
            self.check(clock, pairs, f"{context}, clock {clock}")
            self.cover(given, clock, pairs)
            if clock == end and pairs:
                self.chosen(pairs[0] if alone else self.best or NOTHING, context)
            await self.clock.edge()
            if cheaper:
                self.best = compared
            if clock == reset:
                board.cover("reset")
                break
        self.best = None
        if cut or any(pair.clock + COST > end for pair in pairs):
            self.stale = STALE

    def cover(self, given: Decision, clock: int, pairs: list[Pair]) -> None:
        """What has been found in this clock."""
        name = f"{given.method} {given.rule}"
        for pair in pairs:
            if pair.clock == clock and 0 < pair.duty < TIME_STEPS - 1:
                self.board.cover(f"{name} within")
                self.board.cover(f"{name} by length", int(pair.second == BY_LENGTH))
                self.board.cover(f"{name} edge", int(pair.second > BY_LENGTH))
            elif pair.clock == clock:
                self.board.cover(f"{name} {pair.duty}")


@cocotb.test()
async def random_decisions(dut) -> None:
    """Decisions of all methods and rules in random order."""
    given = arguments()
    rng = random.Random(given["seed"])
    bench = Bench(dut, rng, given["throttle"])
    bench.scramble()
    bench.scramble_method()
    await bench.clock.reset(2)
    count = given["rounds"] * len(KINDS)
    for n in range(given["rounds"]):
        for method, rule in rng.sample(KINDS, len(KINDS)):
            decision = some_decision(rng, method, rule)
            await bench.decide(decision, f"round {n}: {decision}", cut=rng.random() < 0.12)
    several = [f"{method} {rule}" for method, rule in KINDS if method != NONE]
    covered = [f"{name} within" for name in several]
    covered += [f"{name} {duty}" for name in several for duty in (0, TIME_STEPS - 1)]
    covered += [f"{MPTC1} {BEST} by length", f"{MPTC2} {BEST} by length", f"{GTV} {DEADBEAT} edge"]
    bench.board.finish(
        dict.fromkeys(("found", "rank", "cheapest"), 40 * count)
        | dict.fromkeys(("duty", "second", "direction", "left"), 2 * count)
        | {"chosen": count // 2},
        dict.fromkeys(covered, 2) | {"reset": count // 40, "long after": given["throttle"]},
    )
