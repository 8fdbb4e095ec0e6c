"""What ``state_observer`` does in which clock: products, moves of words, and the taking of sums.

The equations stand in ``capacitor_observer``, ``observer`` and ``leakage``. One multiply-accumulate
block forms all products, one after the other. Its operand A comes from a register file of 16 words,
which has one place to read and one to write. So a clock reads one word: for operand A, for the
first summand, and for a difference or a sum that is moved. The program has four parts:

    filters     v_n and v_ph; a step begins here where one of them is filtered
    flux        the rotor flux, then the states of the next step; else a step begins here
    leakage     theta
    scaling     coefficients times theta; a step of its own

A sum is taken three clocks after its last product was issued (``TAKEN``). What is taken stands in
the register ``result`` and can be moved to a word of the file in the next clock.

Sums are aligned so that all of them are cut at one bit. A state has 18 bits and 12 more below. A
word of 16 bits that is taken as a state is four times itself in operand A.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Words of the register file, in the order of their places. Currents at k (c) and k-1 (p) change
#: places with every step, which is why they come first.
WORDS = (
    "p_alpha", "p_beta", "c_alpha", "c_beta",
    "m_alpha", "m_beta",  # sum of both currents, later half of Euler's step, later speed times emf
    "r_alpha", "r_beta",  # flux of the current model
    "s_alpha", "s_beta",  # flux of the voltage model
    "e_alpha", "e_beta",  # r after Euler's step, later the predicted step of the current
    "speed", "spare",
    "f_alpha", "f_beta",  # rotor flux as the core gets it
)  # fmt: skip

#: Sources of operand A: the word read, voltages along alpha and beta, the coefficient of a slope.
SOURCES = ("word", "v_alpha", "v_beta", "given")

#: Words of operand B. ``charge`` has the coefficient of a charge; operand A is zero where no charge
#: moves. The last four are constants.
FACTORS = (
    "speed", "voltage_alpha", "voltage_beta", "drop", "pull", "pull_flux", "pull_current", "decay",
    "excitation", "output_flux", "output_current", "charge", "factor", "l_voltage_alpha",
    "l_voltage_beta", "l_emf", "theta", "zero", "two", "quarter", "minus_quarter",
)  # fmt: skip

#: First summands: a state that is read, a voltage as corrected; half of what is cut off.
SEEDS = ("state", "corrected", "word", "port", "none")

#: What happens with a sum.
TAKERS = (
    "none",
    "state",  # into result; a state of the flux
    "angle",  # into factor: speed times the period
    "flux_beta", "flux_alpha",  # the estimate; with flux_alpha it is complete
    "first_voltage", "voltage", "last_voltage",  # into the ring of voltages
    "emf",  # into result and factor: speed times emf, the leakage's first
    "step",  # into result: predicted step of the current
    "error",  # into factor
    "theta",
    "slope",  # a coefficient times theta
)  # fmt: skip

#: What is moved: result, or a word that is measured.
MOVED = ("is_alpha", "is_beta", "omega_r", "psir_alpha", "psir_beta", "result")
#: What can be joined to the word that is read; bit 0 of its number tells the currents apart.
JOINED = ("is_alpha", "is_beta", "result")

TAKEN = 3  # clocks from a sum's last product until it is taken
SUM_WIDTH = 48  # bits of a sum of products
PHASE_WIDTH = 20  # bits of a phase voltage, signed


@dataclass(frozen=True)
class Product:
    """One product, or with B = "" a word that is read for a move."""

    clock: int  # Clock in which it is issued
    # Word of the register file, or a source. In front of it may stand: "-" for its complement,
    # "half " for half of it, "old " for a state that is zero in the first step.
    a: str
    b: str = ""  # Word of operand B
    seed: str = ""  # What the sum begins with; empty: the product is added to the sum so far
    taker: str = ""  # What happens with the sum that it ends; empty: the sum goes on
    alignment: int = 0  # Steps of three bits

    @property
    def source(self) -> str:
        """What is read: a word of the register file, or one of ``SOURCES``."""
        return self.a.removeprefix("-").removeprefix("half ").removeprefix("old ")

    @property
    def select(self) -> int:
        """Operand A in bits: place, a bit each for not old, half, complement, then the source."""
        word = self.source in WORDS
        place = WORDS.index(self.source) if word else 0
        flags = 16 * ("old " not in self.a) + 32 * ("half " in self.a) + 64 * self.a.startswith("-")
        return place + flags + 128 * (0 if word else SOURCES.index(self.source))


@dataclass(frozen=True)
class Move:
    """One move into the register file."""

    clock: int  # Clock at whose end it is written; a clock later, if it is joined
    word: str  # Word that is written
    what: str  # One of ``MOVED``
    # Whether it is a sum with the word that is read, or for result a difference from it; half of it
    # is written.
    joined: bool = False
    observed: bool = False  # Whether only a step whose flux is used moves it

    @property
    def select(self) -> int:
        """The move in bits: what moves, a bit each for not joined, observed alone, moves."""
        return MOVED.index(self.what) + 8 * (not self.joined) + 16 * self.observed + 32


#: First clocks of the parts, and last ones. A step without a part ends before it.
FILTERS, FILTERS_END = 0, 10
FLUX = 8
FLUX_END = FLUX + 35
LEAKAGE_END = FLUX + 58
SCALING = LEAKAGE_END + 1
SLOPES = 13
SCALING_END = SCALING + SLOPES + TAKEN

_F = FLUX
_PART_FILTERS = (
    # joined to the current before, by MOVES
    Product(0, "old p_beta"),
    Product(1, "m_alpha", "charge", "corrected", alignment=3),
    Product(2, "m_beta", "charge", "", "first_voltage", 3),
    Product(3, "m_alpha", "charge", "corrected", alignment=3),
    Product(4, "m_beta", "charge", "", "voltage", 3),
    Product(5, "m_alpha", "charge", "corrected", alignment=3),
    Product(6, "m_beta", "charge", "", "voltage", 3),
    Product(7, "m_alpha", "charge", "corrected", "last_voltage", 3),
)
_PART_FLUX = (
    # the voltage is formed meanwhile; beta comes first, since it needs two phases alone
    Product(_F, "old s_beta", "pull", "state", alignment=1),
    Product(_F + 1, "old p_beta", "pull_current", alignment=1),
    Product(_F + 2, "old r_beta", "pull_flux", alignment=1),
    Product(_F + 3, "m_beta", "drop"),
    Product(_F + 4, "v_beta", "voltage_beta", "", "state", 2),
    Product(_F + 5, "old s_alpha", "pull", "state", alignment=1),
    Product(_F + 6, "old p_alpha", "pull_current", alignment=1),
    Product(_F + 7, "m_alpha", "drop"),
    Product(_F + 8, "old r_alpha", "pull_flux", alignment=1),
    Product(_F + 9, "v_alpha", "voltage_alpha", "", "state", 2),
    # the state last, when it has come
    Product(_F + 10, "c_beta", "output_current", "port", alignment=3),
    Product(_F + 11, "s_beta", "output_flux", "", "flux_beta", 3),
    Product(_F + 12, "half speed", "speed", "word", "angle", 3),
    Product(_F + 13, "c_alpha", "output_current", "port", alignment=3),
    Product(_F + 14, "s_alpha", "output_flux", "", "flux_alpha", 3),
    # Euler's step
    Product(_F + 15, "old r_beta", "decay", "state"),
    Product(_F + 16, "m_beta", "excitation"),
    Product(_F + 17, "old r_alpha", "factor", "", "state", 2),
    Product(_F + 18, "old r_alpha", "decay", "state"),
    Product(_F + 19, "m_alpha", "excitation"),
    Product(_F + 20, "-old r_beta", "factor", "", "state", 2),
    Product(_F + 22, "old r_beta"),
    Product(_F + 25, "old r_alpha"),
    # Heun's
    Product(_F + 26, "e_beta", "zero", "state"),
    Product(_F + 27, "m_beta", "decay"),
    Product(_F + 28, "m_alpha", "factor", "", "state", 2),
    Product(_F + 29, "e_alpha", "zero", "state"),
    Product(_F + 30, "m_alpha", "decay"),
    Product(_F + 31, "-m_beta", "factor", "", "state", 2),
    # the leakage's first
    Product(_F + 32, "speed", "l_emf", "port", "emf", 3),
)
_PART_LEAKAGE = (
    Product(_F + 36, "half f_beta", "factor", "word", alignment=2),
    Product(_F + 37, "v_alpha", "l_voltage_alpha", "", "step", 3),
    # the complement of half a word is two less than its negative: the factor is added twice
    Product(_F + 38, "-half f_alpha", "factor", "word", alignment=2),
    Product(_F + 39, "m_alpha", "two", alignment=2),
    Product(_F + 40, "v_beta", "l_voltage_beta", "", "step", 3),
    Product(_F + 41, "old p_alpha", "quarter", "word", alignment=3),
    Product(_F + 42, "c_alpha", "minus_quarter", alignment=3),
    Product(_F + 43, "e_alpha", "theta", "", "error", 3),
    Product(_F + 47, "e_alpha", "factor", "none", "theta"),
    Product(_F + 48, "old p_beta", "quarter", "word", alignment=3),
    Product(_F + 49, "c_beta", "minus_quarter", alignment=3),
    Product(_F + 51, "e_beta", "theta", "", "error", 3),
    Product(_F + 55, "e_beta", "factor", "none", "theta"),
)
_PART_SCALING = tuple(
    Product(SCALING + 1 + n, "given", "theta", "port", "slope", 3) for n in range(SLOPES)
)
PRODUCTS = _PART_FILTERS + _PART_FLUX + _PART_LEAKAGE + _PART_SCALING

#: What is written in the clock of the start: is_alpha joined to p_alpha, the first of ``WORDS``.
WRITTEN_FIRST = "m_alpha"

MOVES = (
    Move(0, "m_beta", "is_beta", joined=True),
    Move(3, "c_alpha", "is_alpha"),
    Move(4, "c_beta", "is_beta"),
    Move(_F + 1, "m_beta", "is_beta", joined=True),
    Move(_F + 5, "c_alpha", "is_alpha"),
    Move(_F + 6, "c_beta", "is_beta"),
    Move(_F + 7, "speed", "omega_r"),
    Move(_F + 8, "s_beta", "result"),
    Move(_F + 9, "f_alpha", "psir_alpha"),
    Move(_F + 10, "f_beta", "psir_beta"),
    Move(_F + 13, "s_alpha", "result"),
    Move(_F + 18, "f_alpha", "psir_alpha", observed=True),
    Move(_F + 19, "f_beta", "psir_beta", observed=True),
    Move(_F + 21, "e_beta", "result"),
    Move(_F + 22, "m_beta", "result", joined=True),
    Move(_F + 24, "e_alpha", "result"),
    Move(_F + 25, "m_alpha", "result", joined=True),
    Move(_F + 32, "r_beta", "result"),
    Move(_F + 35, "r_alpha", "result"),
    Move(_F + 36, "m_alpha", "result"),
    Move(_F + 41, "e_alpha", "result"),
    Move(_F + 44, "e_beta", "result"),
)

#: Clocks in which a voltage leaves the head of the ring, and a phase's voltage is formed.
TURNS = (0, 2, 4, 6, 8, 10)
PHASES = (_F, _F + 1, _F + 2)

#: Clock in which the estimate, and theta, are complete.
FLUX_AT = _F + 17
LEAKAGE_AT = _F + 58


def takings(products: Sequence[Product] = PRODUCTS) -> dict[int, str]:
    """Clock -> what takes the sum that stands in the accumulator, of ``TAKERS``."""
    return {p.clock + TAKEN: p.taker for p in products if p.taker}


#: Takers that write the register ``result``.
_RESULTS = ("state", "emf", "step")


def check(products: Sequence[Product] = PRODUCTS, moves: Sequence[Move] = MOVES) -> None:
    """Raise ValueError where the program contradicts itself.

    One product, one move a clock; words that exist; sums that have a beginning and an end; a result
    moved before the next one; nothing behind its part's end; one word written a clock, none read
    before.
    """
    taken = takings(products)
    if len(taken) != sum(bool(p.taker) for p in products):
        raise ValueError("two sums are taken in one clock")
    summing, before = False, -1
    for p in products:
        if p.clock <= before:
            raise ValueError(f"clock {p.clock} does not follow clock {before}")
        before = p.clock
        if p.source not in WORDS + SOURCES[1:] or p.b not in ("", *FACTORS):
            raise ValueError(f"clock {p.clock}: no such operand")
        if p.seed not in ("", *SEEDS) or p.taker not in ("", *TAKERS[1:]):
            raise ValueError(f"clock {p.clock}: no such seed or taker")
        if not 0 <= p.alignment <= 3:
            raise ValueError(f"clock {p.clock}: alignment has to be from 0 to 3")
        if summing == (bool(p.seed) or not p.b):
            raise ValueError(f"the sum in clock {p.clock} has no beginning or no end")
        summing = bool(p.b) and not p.taker
    if summing:
        raise ValueError("the last sum has no end")
    reads = {p.clock for p in products}
    results = sorted(clock for clock, taker in taken.items() if taker in _RESULTS)
    before = -1
    for m in moves:
        if m.clock <= before:
            raise ValueError(f"move {m.clock} does not follow move {before}")
        before = m.clock
        if m.joined and m.what not in JOINED:
            raise ValueError(f"move {m.clock}: {m.what} is never joined")
        if m.joined and m.clock not in reads:
            raise ValueError(f"move {m.clock}: nothing is read")
        if m.what == "result" and not any(clock < m.clock for clock in results):
            raise ValueError(f"move {m.clock}: there is no result")
    # every result of a part is moved at least once while it stands
    for n, clock in enumerate(results):
        end = results[n + 1] if n + 1 < len(results) else LEAKAGE_END
        if not any(m.what == "result" and clock < m.clock <= end for m in moves):
            raise ValueError(f"the result of clock {clock} is not moved")
    plain = {m.clock: m.word for m in moves if not m.joined}
    joined = {m.clock + 1: m.word for m in moves if m.joined}
    # in the first clock of a step that of the start
    for clock in sorted((plain.keys() & joined.keys()) | (plain.keys() & {FILTERS, FLUX})):
        raise ValueError(f"clock {clock}: two words are written")
    joined |= dict.fromkeys((FILTERS, FLUX), WRITTEN_FIRST)
    for p in products:
        if p.clock in joined and p.source == joined[p.clock]:
            raise ValueError(f"clock {p.clock}: {p.source} is being written")
    written = set()
    for clock in range(SCALING):
        for p in products:
            fresh = p.clock == clock and p.source in WORDS and "old " not in p.a
            if fresh and p.source not in written:
                raise ValueError(f"clock {clock}: {p.source} has not been written")
        written |= {words[clock] for words in (plain, joined) if clock in words}


check()
