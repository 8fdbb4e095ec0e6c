"""Cocotb side of ``test_parameter_memory``: a host, copies and resets, clock by clock."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import cocotb

from directmpc.mpdcc.coefficients import CURRENT_SLOPES
from scripts.generate import register_files
from scripts.hdl.clocks import clocks_of
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, join, number, word

WORDS = register_files.parameters("mpdcc")
COUNT = len(WORDS)
BITS = 18
WAITS = clocks_of("parameter_memory", "waits")
READ = clocks_of("parameter_memory", "read")
WRITE = clocks_of("parameter_memory", "write")
COEFFICIENTS = [n for n, w in enumerate(WORDS) if w.name.startswith("c_")]
SLOPES = {n for n in COEFFICIENTS if WORDS[n].name.removeprefix("c_") in CURRENT_SLOPES}
#: Words that have a port of their own, and their places.
PORTS = {
    w.name: n
    for n, w in enumerate(WORDS)
    if w.name.startswith(("bound_", "f_q_"))
    or w.name
    in (
        "horizon", "weight_scale", "two_switchings", "budget", "compensate", "deadlock_rule",
        "outside_inwards", "l_mode",
    )
}  # fmt: skip


@dataclass
class Model:
    """What the host wrote, and what is in force."""

    host: list[int] = field(default_factory=lambda: [0] * COUNT)
    force: list[int] = field(default_factory=lambda: [0] * COUNT)
    loading: bool = True
    clearing: bool = True
    left: list[int] = field(default_factory=lambda: list(range(COUNT)))  # places not yet fetched
    fetched: int | None = None  # place
    value: int = 0  # of that place
    sent: tuple[int, int] | None = None  # place and word for the observer
    taken: bool = False
    write: tuple[int, int] | None = None  # place and word that are being stored
    read: int | None = None  # word that is shown
    waited: int = 0  # clocks of this copy that accesses took

    @property
    def copying(self) -> bool:
        """Whether a copy is under way."""
        return bool(self.left) or self.fetched is not None or self.taken

    def edge(self, access: tuple[bool, int, int] | None, load: bool, in_use: bool) -> None:
        """One clock; an access is: a write, place, word."""
        starts = self.loading and not self.copying and not in_use
        reads = access is not None and not access[0]
        ended = self.fetched == COUNT - 1
        if self.sent is not None:
            self.force[self.sent[0]] = self.sent[1]
        self.sent = None if self.fetched is None else (self.fetched, self.value)
        fetched = None
        if self.left and (reads or self.write is not None):
            self.waited += 1
        elif self.left:
            fetched = self.left.pop(0)
            self.value = 0 if self.clearing else self.host[fetched]
        if self.clearing:
            self.host = [0] * COUNT
        elif self.write is not None:
            place, value = self.write
            self.host[place] = value & (1 << WORDS[place].width) - 1
        # a word that is read while a reset clears is zero, whatever it was
        self.read = self.host[access[1]] if access is not None and reads else None
        self.write = None
        if access is not None and access[0]:
            self.write = access[1], 0 if self.clearing else access[2]
        was_taken, self.taken, self.fetched = self.taken, ended, fetched
        self.clearing = self.clearing and not ended
        self.loading = load or (self.loading and not was_taken)
        if starts:
            self.left, self.waited = list(range(COUNT)), 0


@cocotb.test()
async def words(dut) -> None:
    """A host that reads and writes, copies, resets at any time; every output in every clock."""
    given = arguments()
    rng = random.Random(given["seed"])
    board, clock = Scoreboard(), Clock(dut)
    dut.request.value, dut.writes.value, dut.load.value, dut.in_use.value = 0, 0, 0, 0
    dut.host_place.value, dut.host_word.value = 0, 0
    await clock.reset(2)
    model = Model()
    # the copy behind a reset is a clock ahead
    wait, since, quiet, in_use = 0, 1, True, False
    for n in range(given["clocks"]):
        # now and then nobody asks for anything, and a copy takes as long as it is promised to
        if rng.random() < 0.005:
            quiet = not quiet
        reset = rng.random() < 0.0015
        load = rng.random() < (0.5 if n % 3000 < 1000 else 0.01)
        # a use may go on, but it does not begin while words wait
        in_use = rng.random() < 0.9 if in_use else not model.loading and rng.random() < 0.1
        access = None
        if wait == 0 and rng.random() < (0.01 if quiet else given["rate"]):
            access = rng.random() < 0.5, rng.randrange(COUNT), word(rng, BITS, signed=False)
            wait = 1 + (WRITE if access[0] else READ)
        wait = max(0, wait - 1)
        dut.rst.value, dut.load.value = int(reset), int(load)
        dut.in_use.value = int(in_use)
        dut.request.value = int(access is not None)
        dut.writes.value = int(access[0]) if access else rng.randrange(2)
        dut.host_place.value = access[1] if access else rng.randrange(COUNT)
        dut.host_word.value = access[2] if access else rng.getrandbits(BITS)
        await clock.settle()
        where = f"clock {n}"
        board.check("write_done", number(dut.write_done), int(model.write is not None), where)
        board.check("read_done", number(dut.read_done), int(model.read is not None), where)
        if model.read is not None:
            board.check("read", number(dut.read_word), model.read, where)
        board.check("waits", number(dut.waits), int(model.loading), where)
        board.check("taken", number(dut.taken), int(model.taken), where)
        board.check("c_write", number(dut.c_write), int(model.sent is not None), where)
        if model.sent is not None:
            got = number(dut.c_place), number(dut.c_word)
            board.check("copied", got, model.sent, where)
        if not model.left and model.fetched is None and model.sent is None:
            wanted = [
                0 if place in SLOPES and not given["slopes"] else model.force[place]
                for place in COEFFICIENTS
            ]
            board.check("coefficients", number(dut.coefficients), join(wanted, 16), where)
            for name, place in PORTS.items():
                board.check("in force", number(getattr(dut, name)), model.force[place], name)
        since = since + 1 if model.loading and not in_use else 0
        if model.taken:
            board.check("clocks", since, WAITS + model.waited, where)
            board.cover("undisturbed", int(model.waited == 0))
            since = 0
        board.cover("load while copying", int(load and model.copying))
        board.cover("waits while in use", int(in_use and model.loading))
        board.cover("access while copying", int(access is not None and model.copying))
        board.cover("write while clearing", int(bool(access and access[0] and model.clearing)))
        board.cover("read while clearing", int(bool(access and not access[0] and model.clearing)))
        board.cover("reset while copying", int(reset and model.copying and not model.clearing))
        if reset:
            board.cover("nonzero before", int(any(model.host)))
            model = Model(force=model.force)
            wait, since, in_use = 0, 1, False
        else:
            model.edge(access, load, in_use)
        await clock.edge()
    many = given["clocks"] // 1000
    board.finish(
        {
            "read": 10 * many,
            "coefficients": 200 * many,
            "in force": 2000 * many,
            "clocks": 3 * many,
        },
        {
            "waits while in use": 10 * many,
            "load while copying": 20 * many,
            "access while copying": 10 * many,
            "write while clearing": many,
            "read while clearing": many,
            "reset while copying": 5,
            "nonzero before": 5,
            "undisturbed": 5,
        },
    )
