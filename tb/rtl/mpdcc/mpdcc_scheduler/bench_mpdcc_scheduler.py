"""Cocotb side of ``test_mpdcc_scheduler``."""

from __future__ import annotations

import random
from dataclasses import dataclass

import cocotb
import numpy as np

from directmpc.mpdcc import formats as f
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.program import COEFFICIENTS
from scripts.hdl import states
from scripts.hdl.clocks import clocks_of
from tb.helpers import plain, plain_states
from tb.helpers.mpdcc_ports import RANKED, pack_candidate, unpack_row
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, join, lowest_bit, number, signed

#: Clocks from start to the first row of the capacitors' table.
FIRST_ROW = 14

#: Clocks from the first block's offer until the table of the capacitors is complete.
TABLE_AFTER = 7

#: Clocks from start to candidate_valid of the probe, from the probe's answer to valid, and from
#: the taking of the last result to valid.
TO_PROBE = {v: clocks_of("mpdcc_scheduler", "to_probe", v) for v in ("paper", "fast")}
FROM_PROBE = {v: clocks_of("mpdcc_scheduler", "from_probe", v) for v in ("paper", "fast")}
FROM_LAST = {v: clocks_of("mpdcc_scheduler", "from_last", v) for v in ("paper", "fast")}

RESULT_BITS = 2 + f.INDEX_WIDTH + f.LENGTH_WIDTH + f.RANK_WIDTH


@dataclass
class Answer:
    """What a stub says about a candidate."""

    feasible: bool
    saturated: bool
    index: int
    s: tuple[int, ...]
    length: int
    cost: int
    excess: int
    dropped: bool = False

    def pack(self) -> int:
        """The result as the flat bench takes it."""
        value = offset = 0
        for field, width in (
            (self.feasible, 1), (self.saturated, 1), (self.index, f.INDEX_WIDTH),
            (self.length, f.LENGTH_WIDTH),
            (self.cost if self.feasible else self.excess + RANKED, f.RANK_WIDTH),
        ):  # fmt: skip
            value |= (int(field) & ((1 << width) - 1)) << offset
            offset += width
        return value

    @property
    def key(self) -> tuple[int, int, int]:
        """Order of Algorithm 1: feasible first, then cost or excess, then place."""
        return (0, self.cost, self.index) if self.feasible else (1, self.excess, self.index)


class Stub:
    """An explorer that answers as the script says, when it likes to.

    A fast one takes blocks at any time and answers with its best candidate after the last.
    """

    def __init__(self, fast: bool) -> None:
        self.answer: Answer | None = None
        self.due = 0
        self.fast = fast

    def free(self) -> bool:
        """Whether it takes a candidate."""
        return self.fast or self.answer is None

    def busy(self) -> bool:
        """Whether a candidate is under way."""
        return self.answer is not None

    def add(self, answers: list[Answer]) -> None:
        """Take a candidate, or those of a block."""
        self.answer = min([*answers, *([self.answer] if self.busy() else [])], key=lambda a: a.key)


def check_band(
    board: Scoreboard, packed: int, node: plain.Node, limits: plain.Limits, s: tuple[int, ...],
    inwards: bool,
) -> None:  # fmt: skip
    """Hold the band against what it should be; what belongs to a dead error is void."""
    want = plain.band(node, limits, s)
    for name, words, width in plain.BAND_FIELDS:
        for i in range(words):
            value, packed = packed & ((1 << width) - 1), packed >> width
            expected = getattr(want, name)[i] if words > 1 else getattr(want, name)
            if name.startswith(("margin", "turn", "limit")) and want.outside >> i & 1:
                continue
            if name == "limit" and not inwards:
                continue
            if name == "turn" and abs(node.error[i]) > limits.bound_current:
                board.cover("from outside")
                # where it comes back ever faster there is no threshold
                if (node.curvature[i] >= 0) != (node.error[i] > 0):
                    continue
            if name not in ("outside", "previous", "negative", "limit"):
                value = signed(value, width)
            board.check(f"band {name}", value, expected)


def situation(
    rng: random.Random, generator: np.random.Generator, variant: str, reach: float
) -> tuple[list[int], list[int], tuple[int, ...]]:
    """Registers, measurements and s(k-1): of any content, or of a drive near its reference."""
    if rng.random() < 0.5:
        s_prev = tuple(rng.choice([rng.randrange(8), rng.randrange(2, 6)]) for _ in range(3))
        return states.any_registers(generator, variant), states.words(1, generator)[0], s_prev
    drive = states.shipped(rng.choice(states.SHIPPED))
    trace = states.near(drive, 1, generator, reach)
    s_prev = tuple(int(p) for p in trace.s_prev[0])
    return registers(drive, variant).array(), states.trace_words(trace)[0], s_prev


def script(
    rng: random.Random, s_prev: tuple[int, ...], candidates: list[tuple[tuple[int, ...], int]]
) -> list[Answer]:
    """Answers with many ties, one set for a whole search."""
    kind = rng.choice(["mixed", "dead", "alive", "late"])
    costs = [0, 2**f.COST_WIDTH - 1, *(rng.getrandbits(f.COST_WIDTH) for _ in range(3))]
    span = 2 ** (f.TRAJECTORY_WIDTH - 1)
    excesses = [-1, 0, 1, span - 1, -span, rng.randrange(span), rng.randrange(1000)]
    chosen_costs = rng.sample(costs, rng.randint(1, 3))
    chosen_excesses = rng.sample(excesses, rng.randint(1, 4))
    share = {"mixed": rng.random(), "dead": 0.0, "alive": 1.0, "late": 0.04}[kind]
    return [
        Answer(
            feasible=rng.random() < share,
            saturated=rng.random() < 0.5,
            index=plain.choices(s_prev, s),
            s=s,
            length=rng.randrange(1, 64),
            cost=rng.choice(chosen_costs),
            excess=rng.choice(chosen_excesses),
        )
        for s, _ in candidates
    ]


@cocotb.test()
async def random_searches(dut) -> None:
    """Decisions with stubs in place of explorers."""
    given = arguments()
    explorers, variant, inwards = given["EXPLORERS"], given["variant"], given["inwards"]
    fast = variant == "fast"
    rng = random.Random(given["seed"])
    generator = np.random.default_rng(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    for name in (
        "start", "measurement", "previous", "limits", "coefficients", "answers_candidate_ready",
        "answers_probe_done", "answers_probe_held", "answers_result_valid", "answers_result",
        "answers_busy", "answers_evaluated",
        "options_two_switchings", "options_budget", "options_compensate",
    ):  # fmt: skip
        getattr(dut, name).value = 0
    await clock.reset(3)

    for n in range(given["decisions"]):
        array, row, s_prev = situation(rng, generator, variant, 1.5 if inwards else 0.7)
        off_limits = inwards and n % 6 == 5
        if off_limits:  # a current far outside
            row = [*row]
            row[0], row[9] = rng.choice([(-32768, 32767), (32767, -32768)])
        node, limits = (
            plain_states.plain_node(array, row, variant),
            plain_states.plain_limits(array),
        )
        # without the option the bit changes nothing
        limits.outside_inwards = int(n % 5 < 3)
        dut.limits.value = limits.pack()
        limits.outside_inwards &= int(inwards)
        # the fast explorers' probe is about the currents alone
        ends = zip(plain.after_one(node, s_prev)[3:], limits.bounds[3:], strict=True)
        lines = all(abs(e) <= bound for e, bound in ends)
        says_held = rng.random() < (0.9 if off_limits else 0.4 if fast else 0.2)
        held = says_held and (lines or not fast)
        board.cover("held by currents alone", int(says_held and not held))
        slowness = rng.choice([1, 4, 40])
        throttle = rng.choice([0.0, 0.0, 0.5])
        candidates = plain.candidates(s_prev)
        answers = script(rng, s_prev, candidates)
        handed = plain.blocks(s_prev) if fast else candidates
        each = len(candidates) // len(handed)
        table: dict[int, tuple[int, int]] = {}
        first_offer = -1
        cut = rng.randrange(60) if rng.random() < 0.1 else None
        dut.coefficients.value = join(
            [int(v) for v in array[: len(COEFFICIENTS)]], f.COEFFICIENT_WIDTH
        )
        stubs = [Stub(fast) for _ in range(explorers)]
        given_out, taken, order = 0, [], []
        probe_due: int | None = None
        probed = False
        shown = -1
        noise: list[int] = []
        answered_at = last_taken_at = last_drop_at = -1
        for k in range(20_000):
            dut.start.value = int(k == 0 or (rng.random() < 0.05 and k < 15))
            renew = k < 4 or k % 16 == 0  # wide ports are slow to write
            if renew:
                noise = [rng.getrandbits(RESULT_BITS) for _ in stubs]
                packed = sum((int(v) & 0xFFFF) << (16 * i) for i, v in enumerate(row))
                dut.measurement.value = packed if k == 0 else rng.getrandbits(208)
            dut.previous.value = (
                s_prev[0] | s_prev[1] << 3 | s_prev[2] << 6 if k == 0 else rng.getrandbits(9)
            )
            if cut is not None and k == cut:
                dut.start.value = dut.answers_candidate_ready.value = 0
                dut.answers_result_valid.value = dut.answers_busy.value = (
                    dut.answers_probe_done.value
                ) = 0
                await clock.reset(1)
                for _ in range(20):
                    await clock.settle()
                    board.check("idle after reset", (number(dut.busy), number(dut.valid)), (0, 0))
                    await clock.edge()
                board.cover("reset")
                break
            ready = 0
            results, valid_mask, busy_mask = 0, 0, 0
            for i, stub in enumerate(stubs):
                if probed and stub.free() and rng.random() >= throttle:
                    ready |= 1 << i
                if stub.busy():
                    busy_mask |= 1 << i
                    if k >= stub.due and (not fast or number(dut.last)):
                        if stub.answer.dropped:
                            stub.answer = None
                            busy_mask &= ~(1 << i)
                            last_drop_at = k
                            continue
                        valid_mask |= 1 << i
                        results |= stub.answer.pack() << (RESULT_BITS * i)
                        continue
                results |= noise[i] << (RESULT_BITS * i)
            if probe_due is None:
                ready |= 1
            elif not probed:
                busy_mask |= 1
            now = probe_due is not None and not probed and k >= probe_due
            dut.answers_probe_done.value = int(now)
            dut.answers_probe_held.value = int(says_held) if now else rng.randrange(2)
            dut.answers_candidate_ready.value = ready
            dut.answers_result_valid.value = valid_mask
            if results != shown:
                dut.answers_result.value = shown = results
            dut.answers_busy.value = busy_mask
            await clock.settle()
            board.check("busy", number(dut.busy), int(k != 0 and number(dut.valid) == 0), f"{k}")
            offered = number(dut.candidate_valid)
            board.check("one-hot", offered & (offered - 1), 0)
            if offered and probe_due is None:
                board.check("clocks to the probe", k, TO_PROBE[variant])
                board.check("offered to the first explorer", offered, 1)
                # the second level keeps the probe's slope at place 0
                board.check("probe", number(dut.candidate), pack_candidate(1, 0, s_prev, 0))
                if not fast:
                    board.check("node", number(dut.node), plain.pack_node(node))
                probe_due = k + (rng.randrange(10, 15) if fast else rng.randrange(1, 14))
            elif offered:
                board.check("no candidate before the probe is answered", probed, True)
                board.check("offered to a free one", offered & ready, offered)
                lowest = ready & -ready
                board.check("offered to the first free one", offered, lowest)
                s, effort = handed[given_out]
                want = pack_candidate(0, plain.choices(s_prev, s), s, effort)
                board.check("candidate", number(dut.candidate), want)
                if fast and first_offer < 0:
                    first_offer = k
                    board.check("node", number(dut.node), plain.pack_node(node))
                    check_band(board, number(dut.band), node, limits, s_prev, inwards)
                stub = stubs[offered.bit_length() - 1]
                stub.add(answers[given_out * each : (given_out + 1) * each])
                stub.due = k + rng.randrange(1, slowness + 1)
                known = [a.cost for a in taken if a.feasible]
                loser = bool(known) and (not stub.answer.feasible or stub.answer.cost > min(known))
                stub.answer.dropped = not fast and loser and rng.random() < 0.7
                board.cover("dropped", int(stub.answer.dropped))
                given_out += 1
            # what is left of a table after a held decision comes earlier
            if k >= FIRST_ROW and lowest_bit(dut.capacitor):
                line, content = unpack_row(number(dut.capacitor))
                board.check("row once", line in table, False)
                table[line] = content
            if first_offer >= 0 and k == first_offer + TABLE_AFTER:
                board.check("table", table, plain.capacitor_rows(node, limits), f"{n}")
            if number(dut.busy) and number(dut.last):
                board.check("last", (probed, given_out), (True, len(handed)))
            if now:
                probed, answered_at = True, k
            accepted = number(dut.result_ready)
            if valid_mask:
                board.check("takes the first result", accepted, valid_mask & -valid_mask)
                board.cover("results at once", int(valid_mask & (valid_mask - 1) != 0))
                stub = stubs[accepted.bit_length() - 1]
                taken.append(stub.answer)
                order.append(stub.answer.index)
                stub.answer = None
                last_taken_at = k
            else:
                board.check("takes nothing", accepted, 0)
            if number(dut.best_valid):
                # a result reaches the comparison two clocks after it is taken
                costs = [a.cost for a in taken if a.feasible]
                board.check(
                    "best cost is one of the results'", number(dut.best_cost) in costs, True
                )
            done = number(dut.valid)
            if done:
                break
            await clock.edge()
        if cut is not None and k == cut:
            continue
        got = number(dut.decision)
        if held:
            want = plain_decision(s_prev, 1, 0, 0, node.saturated)
            board.check("clocks from the probe", k - answered_at, FROM_PROBE[variant])
            far = plain.too_far(node, limits) and not node.saturated
            board.cover("held far outside", int(far))
        else:
            board.check("every candidate was given out", given_out, len(handed))
            best = min(taken, key=lambda a: a.key)
            flagged = node.saturated or plain.too_far(node, limits)
            want = plain_decision(
                best.s, 0, not best.feasible, best.length, flagged or best.saturated
            )
            if last_taken_at > last_drop_at:
                after = FROM_LAST[variant]
                board.check("clocks after the last result", k - last_taken_at, after)
            board.cover("ties", int(sum(a.key[:2] == best.key[:2] for a in taken) > 1))
            board.cover(
                "earliest arrived later",
                int(next(a.index for a in taken if a.key[:2] == best.key[:2]) != best.index),
            )
            board.cover("out of order", int(order != sorted(order)))
            board.cover("deadlock", int(not best.feasible))
            board.cover("late feasible", int(not taken[0].feasible and best.feasible))
        board.check("decision", got, want, f"decision {n}, s(k-1) {s_prev}, held {held}")
        board.cover("held" if held else "searched")
        dut.start.value = 0
        await clock.edge()
        # back to back, or after a pause in which nothing may happen
        for _ in range(rng.choice([0, 0, 3])):
            await clock.settle()
            board.check("one pulse", (number(dut.valid), number(dut.busy)), (0, 0))
            board.check("decision stays", number(dut.decision), want)
            await clock.edge()
    board.finish(
        {"decision": int(0.7 * given["decisions"]), "candidate": given["decisions"]}
        | ({"table": given["decisions"] // 3} if fast else {})
    )


def plain_decision(s, held, deadlock, length, saturated) -> int:
    """A decision as the flat bench shows it; with one level none is exhausted."""
    return (
        s[0] | s[1] << 3 | s[2] << 6 | int(held) << 9 | int(deadlock) << 10
        | int(length) << 11 | int(saturated) << 17
    )  # fmt: skip
