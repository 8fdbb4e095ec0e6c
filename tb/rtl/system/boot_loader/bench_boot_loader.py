"""Cocotb side of ``test_boot_loader``."""

from __future__ import annotations

import random

import cocotb

from directmpc.host import boot
from directmpc.host.boot import Access, Entry, Outcome
from tb.helpers.scoreboard import Clock, Scoreboard, arguments, lowest_bit, number

#: Inputs that stand still until the slave sets them.
QUIET = ("awready", "wready", "bvalid", "bresp", "arready", "rvalid", "rdata", "rresp")
SLVERR, DECERR = 2, 3
ADDRESSES = 256
RESETS = 8  # most of a boot that is reset before its end


def any_rom(rng: random.Random) -> list[Entry]:
    """Entries of every kind; the corners of address and word among them."""
    words = (0, 1, 0xFFFFFFFF, 0x80000000, rng.getrandbits(32))
    return [
        Entry(
            rng.choice((boot.CHECKED, boot.CHECKED, boot.WRITE, boot.WAIT, 3)),
            4 * rng.choice((0, ADDRESSES - 1, rng.randrange(ADDRESSES))),
            rng.choice(words),
        )
        for _ in range(rng.choice((1, 2, 12, 40)))
    ]


class Slave:
    """Registers that keep words; accesses that fail, words that are lost, bits that stay set."""

    def __init__(self, dut, rng: random.Random, share: float, pace: float) -> None:
        self.dut, self.rng, self.share, self.pace = dut, rng, share, pace
        self.words: dict[int, int] = {}
        self.loses = 0.0  # share of words that are lost
        self.stuck = False  # nothing is ever okay, or every bit stays set
        self.refuses = 0  # accesses from now on that are refused
        self.taken: dict[str, int] = {}
        self.seen: list[Access] = []
        self.answer: tuple[int, int] | None = None

    def decide(self, access: Access) -> tuple[int, int]:
        """The answer to an access."""
        rng = self.rng
        refused = self.refuses > 0
        self.refuses -= refused
        if refused or self.stuck or rng.random() < self.share:
            # nothing of the access has an effect, and its word means nothing
            return rng.choice((SLVERR, DECERR)), rng.getrandbits(32)
        if access.write:
            lost = 1 << rng.randrange(32) if rng.random() < self.loses else 0
            self.words[access.address] = access.word ^ lost
            return boot.OKAY, 0
        held = self.words.get(access.address)
        # a status clears by and by
        return boot.OKAY, rng.choice((0, rng.getrandbits(32))) if held is None else held

    def reset(self) -> None:
        """Forget the access that is under way."""
        self.taken, self.answer = {}, None
        for name in QUIET:
            getattr(self.dut, f"m_axil_{name}").value = 0

    async def clock(self, clock: Clock) -> Access | None:
        """One clock; the access that has been answered in it."""
        dut, rng = self.dut, self.rng
        ready = {c: int(rng.random() < self.pace) for c in ("aw", "w", "ar")}
        for name, value in ready.items():
            getattr(dut, f"m_axil_{name}ready").value = value if name not in self.taken else 0
        whole = {"aw", "w"} <= set(self.taken) or "ar" in self.taken
        if whole and self.answer is None:
            write = "aw" in self.taken
            address = self.taken["aw" if write else "ar"]
            self.seen.append(Access(write, address, self.taken.get("w", 0)))
            self.answer = self.decide(self.seen[-1])
        answers = whole and rng.random() < self.pace
        write = "aw" in self.taken
        dut.m_axil_bvalid.value = int(answers and write)
        dut.m_axil_rvalid.value = int(answers and not write)
        response, word = self.answer or (0, 0)
        dut.m_axil_bresp.value = dut.m_axil_rresp.value = response
        dut.m_axil_rdata.value = word
        await clock.settle()
        ended = None
        if answers and lowest_bit(dut.m_axil_bready if write else dut.m_axil_rready):
            ended, self.taken = self.seen[-1], {}
        else:
            for name in ("aw", "w", "ar"):
                valid = lowest_bit(getattr(dut, f"m_axil_{name}valid"))
                if valid and ready[name] and name not in self.taken:
                    word_of = "m_axil_wdata" if name == "w" else f"m_axil_{name}addr"
                    self.taken[name] = number(getattr(dut, word_of))
        await clock.edge()
        return ended


@cocotb.test()
async def boots(dut) -> None:
    """Whole boots against the model: every access, the outcome and its place."""
    given = arguments()
    rng, board, clock = random.Random(given["seed"]), Scoreboard(), Clock(dut)
    for name in QUIET:
        getattr(dut, f"m_axil_{name}").value = 0
    dut.entry.value = 0
    kinds = ("quick", "slow", "lost", "stuck", "refused", "reset")
    for n in range(given["boots"]):
        kind = kinds[n % len(kinds)]
        entries = any_rom(rng)
        share = 0.3 if kind in ("slow", "refused", "reset") else 0.0
        slave = Slave(dut, rng, share, 1.0 if kind == "quick" else 0.5)
        slave.loses = 0.5 if kind == "lost" else 0.0
        stuck_at = rng.randrange(3 * len(entries)) if kind == "stuck" else None
        registered = n // len(kinds) % 2
        resets = RESETS if kind == "reset" else 0
        step: Access | Outcome | None = None  # none yet behind a reset
        while step is None or isinstance(step, Access):
            if step is None:
                slave.reset()
                dut.last.value, dut.entry.value = len(entries) - 1, entries[0].bits()
                await clock.reset()
                got = (number(dut.done), number(dut.failed), number(dut.place))
                board.check("reset", got, (0, 0, 0))
                asked = boot.accesses(entries, given["TRIES"])
                step = next(asked)
                shown = waited = tried = back = 0
            place = number(dut.place)
            dut.entry.value = entries[shown if registered else place].bits()
            shown = place
            slave.stuck = stuck_at is not None and len(slave.seen) >= stuck_at
            ended = await slave.clock(clock)
            board.check("early", (number(dut.done), number(dut.failed)), (0, 0), kind)
            waited = 0 if ended else waited + 1
            board.check("waits", waited < 100, True, f"boot {n}, {kind}")
            if ended:
                board.check("access", ended, step, f"boot {n}, {kind}")
                tried, back = int(slave.answer[0] != boot.OKAY), int(step.write)
                step = asked.send(slave.answer)
                back &= int(isinstance(step, Access) and not step.write and not tried)
                slave.answer = None
            if resets and slave.seen and rng.random() < 0.1:
                resets -= 1
                step = None
                board.cover("reset behind a refusal", tried)
                board.cover("reset before a word is read back", back)
                # all tries but one are needed anew
                slave.refuses = rng.choice((0, given["TRIES"] - 1))
        slave.reset()
        for _ in range(4):
            await clock.tick()
        for clocks in range(8):
            got = (number(dut.done), number(dut.failed), number(dut.place))
            want = (int(step.done), int(not step.done), step.place)
            board.check("outcome", got, want, f"boot {n}, {kind}, {clocks} clocks later")
            offers = [lowest_bit(getattr(dut, f"m_axil_{c}valid")) for c in ("aw", "w", "ar")]
            board.check("silence", offers, [0, 0, 0], f"boot {n}, {kind}")
            await clock.tick()
        assert isinstance(step, Outcome)
        board.cover("done" if step.done else f"failed {kind}")
        board.cover("repeated", int(len(slave.seen) > 2 * len(entries)))
    assert {access.write for access in slave.seen}
    board.finish(
        {"access": given["boots"], "outcome": 8 * given["boots"]},
        {
            "done": 3,
            "failed lost": 1,
            "failed stuck": 1,
            "repeated": 1,
            "reset behind a refusal": 5,
            "reset before a word is read back": 2,
        },
    )
