"""Cocotb side of ``test_step_port``: every output of every clock."""

from __future__ import annotations

import random
from dataclasses import dataclass

import cocotb

from tb.helpers.scoreboard import Clock, Scoreboard, arguments, number

WIDTHS = {"decision": 16, "decision_flags": 8, "decision_length": 8, "decision_cycles": 16}
ANSWER = {"decision": "position", "decision_flags": "flags", "decision_length": "length"}


@dataclass
class Step:
    """A step from its start until its answer is fetched."""

    age: int = 0  #: Clocks since start.
    decided: int | None = None  #: Age at which the core has decided; None: it has not, or too late.
    answer: dict[str, int] | None = None  #: What it decided, by output.
    given_up: bool = False  #: Whether the core took too long.

    @property
    def done(self) -> bool:
        """Whether the step waits no longer."""
        return self.given_up or (self.decided is not None and self.age > self.decided + 1)


@cocotb.test()
async def every_clock(dut) -> None:
    """Decisions in time, at the last moment, too late, and some that nobody waits for."""
    given = arguments()
    limit = int(given["LIMIT"])
    rng, board, clock = random.Random(8), Scoreboard(), Clock(dut)
    step: Step | None = None
    due = 0
    for n in range(given["clocks"]):
        # start comes only while no step is there
        i = {name: rng.getrandbits(width) for name, width in WIDTHS.items()}
        i["rst"] = int(n < 2 or rng.random() < 0.002)
        i["start"] = int(step is None and rng.random() < 0.1)
        i["fetched"] = int(rng.random() < 0.1)
        waits = step is not None and step.age > 0 and not step.done and step.decided is None
        i["decision_valid"] = int(step.age == due if waits else rng.random() < 0.05)
        for name, value in i.items():
            getattr(dut, name).value = value
        await clock.settle()
        if n > 1:
            context = f"clock {n}, {step}"
            board.check(
                "step_start", number(dut.step_start), int(bool(step) and not step.age), context
            )
            board.check("waiting", number(dut.waiting), int(step is not None), context)
            board.check("done", number(dut.done), int(bool(step) and step.done), context)
            if step and step.done:
                board.check("no_answer", number(dut.no_answer), int(step.given_up), context)
                for name, value in (step.answer or {}).items():
                    board.check(name, number(getattr(dut, name)), value, context)
                board.cover("given up" if step.given_up else "answered")
                board.cover("at the last moment", int(step.decided == limit))
        if i["rst"]:
            board.cover("reset in a step", int(step is not None))
            step = None
        elif step is None:
            if i["start"]:
                # the core decides at any time, or late
                step, due = Step(), rng.choice([1, 2, limit // 2, limit - 1, limit, limit + 1])
        elif step.done:
            step = None if i["fetched"] else step
        else:
            if step.decided is not None:
                assert step.answer is not None
                step.answer["cycles"] = i["decision_cycles"]
            elif i["decision_valid"] and step.age > 0:
                step.decided = step.age
                step.answer = {name: i[wire] for wire, name in ANSWER.items()}
            elif step.age == limit:
                step.given_up = True
            step.age += 1
        await clock.edge()
    board.finish(
        {"position": 100, "cycles": 100, "no_answer": 200},
        dict.fromkeys(["given up", "answered", "at the last moment", "reset in a step"], 2),
    )
