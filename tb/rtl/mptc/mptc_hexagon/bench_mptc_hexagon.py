"""Cocotb side of ``test_mptc_hexagon``."""

from __future__ import annotations

import random
from dataclasses import dataclass

import cocotb
import numpy as np

from directmpc.mptc import bit_true_hexagon as twin
from directmpc.mptc import formats as f
from directmpc.mptc import program
from directmpc.mptc.sequence import TIME_STEPS, VectorSequence, is_active, last_active_of, last_of
from scripts.hdl.mptc_job import FAMILY_METHODS
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, bits, number, signed
from tb.rtl.mptc.mptc_choices.bench_mptc_choices import Choice, Task
from tb.rtl.mptc.mptc_coordinates.bench_mptc_coordinates import (
    HALVED,
    HELD,
    LAST,
    MPC2,
    MPFC2,
    MPFC3,
    ONE,
    SUM_WIDTH,
    SVM,
    TURNED,
    Missing,
    Sums,
    coordinates,
    led,
    some_sums,
)

METHODS = (MPFC2, MPFC3, MPC2, SVM)
NAMES = {code: name for name, code in FAMILY_METHODS.items()}
FIELDS = ("u1", "u2", "u3", "t1", "t2")


@dataclass(frozen=True)
class Decision:
    """A method, what it is applied to, and all that has to come of it."""

    method: int
    running: tuple[int, ...]
    sums: Sums

    @property
    def applied(self) -> VectorSequence:
        """What is being applied, times as fractions."""
        u1, u2, u3, t1, t2 = self.running
        return VectorSequence(u1, u2, u3, t1 / TIME_STEPS, t2 / TIME_STEPS)

    def task(self) -> Task:
        """What its choices are made of."""
        ended = int(last_of(self.applied))
        base = ended if is_active(ended) else 1
        if self.method == MPFC3:
            base = int(last_active_of(self.applied))
        e = led(self.method, base, self.missing())
        row = ended if self.method == MPFC2 else e.leader
        return Task(self.method, row, e.leader, ended, e.g, e.h)

    def missing(self) -> Missing:
        """e in coordinates of u_1 and u_2."""
        return coordinates(self.sums)

    def chosen(self) -> tuple[int, ...]:
        """What to apply, as the bit-true model has it."""
        e, running = self.missing(), np.array(self.running, dtype=np.int64)
        if self.method == MPFC2:
            found = twin.mpfc2(e.g, e.h, running)
        elif self.method == MPFC3:
            found = twin.mpfc3(e.g, e.h, running)
        elif self.method == MPC2:
            found = twin.mpc2(e.g, e.h, running)
        else:
            found = twin.svm(e.g, e.h)
        return tuple(int(x) for x in found)


def some_running(rng: random.Random) -> tuple[int, ...]:
    """Any three vectors with times of zero, of the whole period and between."""
    zero = rng.random() < 0.1
    vectors = [rng.choice([0, 7]) if zero else rng.choice([0, *range(8)]) for _ in range(3)]
    t1 = rng.choice([0, TIME_STEPS, rng.randint(0, TIME_STEPS), rng.randint(0, TIME_STEPS)])
    most = TIME_STEPS - t1
    t2 = rng.choice([0, most, max(most - 1, 0), rng.randint(0, most)])
    return (*vectors, t1, t2)


def some_decision(rng: random.Random) -> Decision:
    """One of any method; half of the e lie in the hexagon or hardly beyond it."""
    near, along = rng.random() < 0.5, rng.random() < 0.1
    while True:
        method, running, sums = rng.choice(METHODS), some_running(rng), some_sums(rng)
        e = coordinates(sums)
        if along:
            # the vector that is applied last is the nearest one to e
            running = (*[led(MPC2, 1, e).leader] * 3, 0, 0)
        if not near or 4 * max(abs(e.g), abs(e.h), abs(e.g + e.h)) < 5 * ONE:
            return Decision(method, running, sums)


class Bench:
    """The entity, the multipliers behind it, and what it was asked last."""

    def __init__(self, dut, rng: random.Random) -> None:
        self.dut, self.rng = dut, rng
        self.board, self.clock = Scoreboard(), Clock(dut)
        self.far: int | None = None
        self.context = ""
        dut.rst.value = 0

    def scramble(self, given: Decision | None = None) -> None:
        """Any inputs where none is read; method and running sequence of a decision stay."""
        dut, rng = self.dut, self.rng
        for name in ("sum", "sum_alpha", "sum_beta"):
            getattr(dut, name).value = rng.getrandbits(SUM_WIDTH) * rng.getrandbits(1)
        for name in ("way_alpha", "way_beta", "rest", "last", "rst"):
            getattr(dut, name).value = 0
        dut.method.value = rng.randrange(8) if given is None else given.method
        running = some_running(rng) if given is None else given.running
        for name, value in zip(FIELDS, running, strict=True):
            getattr(dut, f"running_{name}").value = value

    async def tick(self) -> None:
        """One clock; what is known of e's length stays."""
        await self.clock.settle()
        if self.far is not None:
            self.board.check("far", number(self.dut.far), self.far, self.context)
        await self.clock.edge()

    async def idle(self, clocks: int) -> None:
        """Clocks of other methods: ways, and a last choice that is none."""
        for _ in range(clocks):
            self.scramble()
            for name in ("way_alpha", "way_beta", "last"):
                getattr(self.dut, name).value = int(self.rng.random() < 0.2)
            await self.tick()

    async def begin(self, given: Decision, pauses: int, *, ended: str = "") -> bool:
        """Both ways, then e; perhaps a reset in one of these clocks. Whether there was none."""
        dut, sums = self.dut, given.sums
        steps = {"way_alpha": {"sum": sums.way_alpha}, "way_beta": {"sum": sums.way_beta},
                 "rest": {"sum_alpha": sums.alpha, "sum_beta": sums.beta}}  # fmt: skip
        for name, words in steps.items():
            for _ in range(self.rng.randrange(pauses + 1)):
                self.scramble(given)
                await self.tick()
            self.scramble(given)
            getattr(dut, name).value = 1
            for key, value in words.items():
                getattr(dut, key).value = bits(value, SUM_WIDTH)
            dut.rst.value = int(name == ended)
            await self.tick()
            if name == "rest":
                self.far = None
            if name == ended:
                return False
        return True

    def residues(self, count: int, choices: list[Choice]) -> None:
        """Operands of the squares: the second product's along and total come a clock later."""
        dut, board, context = self.dut, self.board, f"{self.context}, clock {count}"
        n, late = divmod(count - TURNED - program.RESIDUE, program.CHOICE_CLOCKS)
        if not 0 <= n < twin.CHOICES:
            return
        choice = choices[n]
        along = signed(number(dut.residues_along), f.WORD_WIDTH)
        board.check("along", along, choice.along, context)
        if late:
            total = signed(number(dut.residues_total), f.WORD_WIDTH)
            board.check("total", total, choice.along + choice.across, context)
        else:
            beside = signed(number(dut.residues_beside), f.WORD_WIDTH)
            board.check("beside", beside, choice.across, context)

    async def count(self, given: Decision, *, held: int, until: int) -> bool:
        """Clocks behind the one of rest, perhaps up to a reset. Whether there was none."""
        dut, choices, want = self.dut, given.task().choices(), given.chosen()
        clocks = [*range(1, HELD), *[HELD] * held]
        for place, count in enumerate(clocks, start=1):
            self.scramble(given)
            n, late = divmod(count - TURNED - program.CHOICE_COMPARE, program.CHOICE_CLOCKS)
            if 0 <= n < twin.CHOICES and late == 0:
                dut.sum_alpha.value = choices[n].square
            dut.last.value = int(place == len(clocks))
            dut.rst.value = int(place == until)
            if count == HALVED:
                self.far = given.missing().far
            await self.clock.settle()
            self.residues(count, choices)
            if count >= LAST:
                for name, value in zip(FIELDS, want, strict=True):
                    got = number(getattr(dut, name))
                    self.board.check(f"chosen {name}", got, value, f"{self.context}: {want}")
            await self.tick()
            if place == until:
                self.far = None
                return False
        return True

    def cover(self, given: Decision) -> None:
        """What has been decided."""
        name, task, cover = NAMES[given.method], given.task(), self.board.cover
        u1, u2, _, t1, t2 = given.chosen()
        cover(name)
        cover("far", given.missing().far)
        if given.method in (MPFC2, MPC2):
            cover(f"{name} alone", int(u1 == u2))
        if given.method == MPFC2:
            cover("MPFC2 after zero voltage", task.idle)
        elif given.method == MPFC3:
            cover("MPFC3 with u_7", int(u2 == 7))
            cover("MPFC3 inside", int(t1 > 0 and t2 > 0 and t1 + t2 < TIME_STEPS))
            cover("MPFC3 spoke", int(t1 == 0))
            cover("MPFC3 edge", int(t2 == 0))
            cover("MPFC3 without an active vector",
                  int(not any(is_active(u) for u in given.running[:3])))  # fmt: skip
        elif given.method == MPC2:
            cover("MPC2 the other way round", int(u1 != task.leader))
        else:
            cover("SVM beyond", int(task.g + task.h > ONE and task.h > 0))
            cover("SVM within", int(task.g + task.h <= ONE))
            cover("SVM beyond along one", int(task.h == 0 and task.g > ONE))


@cocotb.test()
async def random_decisions(dut) -> None:
    """Decisions of all methods, some of them ended by a reset."""
    given = arguments()
    rng = random.Random(given["seed"])
    bench = Bench(dut, rng)
    pauses = 3 * given["throttle"]
    bench.scramble()
    dut.rst.value = 1
    await bench.tick()
    for n in range(given["decisions"]):
        asked = some_decision(rng)
        bench.context = f"decision {n}: {asked}"
        reset = rng.random() < 0.15
        ended = rng.choice(["way_alpha", "way_beta", "rest", *[""] * 9]) if reset else ""
        until = rng.randint(1, LAST) if reset else 0
        done = await bench.begin(asked, pauses, ended=ended)
        if done:
            held = rng.randrange(pauses + 1)
            done = await bench.count(asked, held=held, until=until)
            bench.board.cover("held", int(held > 0))
        if done:
            bench.cover(asked)
        else:
            bench.board.cover("reset")
        await bench.idle(rng.randrange(2 * pauses + 1))
    few = given["decisions"] // 40
    bench.board.finish(
        {"along": 300 * few, "beside": 150 * few, "total": 150 * few, "far": 1000 * few}
        | {f"chosen {name}": 20 * few for name in FIELDS},
        dict.fromkeys((*(NAMES[m] for m in METHODS), "reset", "far"), 2 * few)
        | dict.fromkeys(
            ("MPFC2 after zero voltage", "MPFC3 with u_7", "MPFC3 inside",
             "MPFC3 spoke", "MPFC3 edge", "MPC2 alone", "MPC2 the other way round", "SVM beyond",
             "SVM within"), few)
        | {"SVM beyond along one": 1, "MPFC2 alone": 2, "MPFC3 without an active vector": 1}
        | {"held": few * given["throttle"]},
    )  # fmt: skip
