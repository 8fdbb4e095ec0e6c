"""What the three multiply-accumulate blocks of ``mptc_core`` do in which clock.

The equations stand in ``coefficients``; here they are laid out over three blocks: ALPHA and BETA
own one component of w each, FLUX owns both components of psi_s, the products of the inputs and,
while the vectors stream past, the weighting of the flux error.  The generated package carries this
program into the RTL; the bit-true twin does not read it.

Clock n is the clock cycle n clock edges after the one that accepts ``start``.  MPTC and MPFC share
the clocks before ``FORK``; after it MPFC's clocks have ``FORK_OFFSET`` added in the RTL's address.

Operands are words; ``not_x`` is the one's complement of x; as second factor ``half_x`` is x/2 and
``lead_x`` is 1 + x/2.  A seed is the first summand: ``half`` and ``torque_half`` round a word or a
torque term, a word's name is the word with its rounding.  ``modulus_half`` rounds the modulus,
``centre_x`` is what half an LSB of MPFC's root takes of w.  ``share_x`` is what u takes of
``step_x``.
"""

from __future__ import annotations

from dataclasses import dataclass

from directmpc.mac_program import SUM_LATENCY
from directmpc.mptc.coefficients import COEFFICIENTS
from directmpc.mptc.formats import (
    FAR_STEPS,
    ITERATIONS,
    MEASUREMENTS,
    NORMALISE_STEPS,
    QUOTIENT_WIDTH,
    ROOT_WIDTH,
    TIME_WIDTH,
)

ALPHA, BETA, FLUX = 0, 1, 2
BLOCKS = 3

#: Clocks from issuing a sum's last product until its word can be an operand.
LATENCY = SUM_LATENCY + 1
#: Clocks by which ``mptc_family_core`` takes a seed after its product is issued.
SEED_WAIT = 2
FORK = 16
FORK_OFFSET = 32

#: Words written by the program, MPFC's own ones last.
RESULTS: tuple[str, ...] = (
    "start_alpha",  # w(k)
    "start_beta",
    "rotor_alpha",  # dw, w(k+1), then i_s0 (MPTC) or w turned on by omega_r*T_s (MPFC)
    "rotor_beta",
    "stator_alpha",  # dpsi, psi_s(k+1), then psi_s(k+2) without voltage
    "stator_beta",
    "angle",  # T_s*omega_r
    "step_alpha",  # 2*T_s*2/3*v_dc
    "step_beta",  # 2*T_s*v_dc/sqrt(3)
    "turn",  # -angle**2/2
    "moment",  # torque_ref times the gain, then over 1.5*N_p
    "square",  # psi_ref**2
    "modulus",  # |w|**2, four times that below a quarter; then twice times the gain there, or once
)
FLUX_RESULTS = ("turn", "moment", "square", "modulus")

#: Torque terms written by the program.
TERMS: tuple[str, ...] = (
    "demand",  # torque_ref, into level
    "level",  # level less torque without voltage (MPTC), |w|**2*step/4 (MPFC)
    "along",  # per step along alpha
    "across",  # per step along beta
    "opening",  # demand less torque at k+1, of MPTC1 and MPTC2
)

COMPLEMENTS = ("not_start_beta", "not_rotor_beta", "not_stator_beta")
FLUX_COMPLEMENTS = ("not_half_angle", "not_moment")
#: What else is an operand: the flux error, constants, u, and the parts of MPFC's reference.
OTHERS = ("difference", "gain", "root3_2", "share_alpha", "share_beta")
FLUX_OTHERS = ("root_along", "root_across")
#: Distance of a choice from e, of the flux methods of several vectors.
FAMILY_OTHERS = ("residue_g", "residue_h", "residue_sum")
#: Torque terms as words, of the torque that a duty leaves.
PAIR_OTHERS = ("not_along", "across")

OPERANDS: tuple[str, ...] = (
    *MEASUREMENTS,
    *(f"c_{name}" for name in COEFFICIENTS),
    *RESULTS,
    *COMPLEMENTS,
    *FLUX_COMPLEMENTS,
    *OTHERS,
    *FLUX_OTHERS,
    *FAMILY_OTHERS,
    *PAIR_OTHERS,
)

SEEDS: tuple[str, ...] = (
    "half",
    "torque_half",
    "psis_alpha",
    "psis_beta",
    "start_alpha",
    "start_beta",
    "rotor_alpha",
    "rotor_beta",
    "stator_alpha",
    "stator_beta",
    "cost",
    "none",
    "level",
    "modulus_half",
    "centre_alpha",
    "centre_beta",
)


@dataclass(frozen=True)
class Step:
    """One product."""

    # clock, block: When and where it is issued.
    clock: int
    block: int
    # a, b: Operands.
    a: str
    b: str
    seed: str = ""  # One of SEEDS; empty: add to the sum so far
    result: str = ""  # One of RESULTS or TERMS where the sum is complete with this product
    taken: bool = False  # Whether another unit takes the sum when it is complete with this product


def _pass_flux(clock: int, seeds: str, lead: str = "", half: str = "") -> list[Step]:
    """psi_s from itself and w, both components, four clocks."""
    return [
        Step(clock, FLUX, "stator_alpha", f"{lead}c_drop_flux", f"{seeds}_alpha"),
        Step(clock + 1, FLUX, "rotor_alpha", f"{half}c_drop", "", "stator_alpha"),
        Step(clock + 2, FLUX, "stator_beta", f"{lead}c_drop_flux", f"{seeds}_beta"),
        Step(clock + 3, FLUX, "rotor_beta", f"{half}c_drop", "", "stator_beta"),
    ]


def _pass_rotor(clock: int, seeds: str, lead: str = "", half: str = "") -> list[Step]:
    """w from itself, its other component and psi_s, three clocks."""
    return [
        Step(clock, ALPHA, "rotor_alpha", f"{lead}c_rotor", f"{seeds}_alpha"),
        Step(clock + 1, ALPHA, "not_rotor_beta", f"{half}angle"),
        Step(clock + 2, ALPHA, "stator_alpha", f"{half}c_rotor_flux", "", "rotor_alpha"),
        Step(clock, BETA, "rotor_beta", f"{lead}c_rotor", f"{seeds}_beta"),
        Step(clock + 1, BETA, "rotor_alpha", f"{half}angle"),
        Step(clock + 2, BETA, "stator_beta", f"{half}c_rotor_flux", "", "rotor_beta"),
    ]


#: Both methods.
COMMON: tuple[Step, ...] = (
    Step(0, ALPHA, "is_alpha", "c_current", "half"),
    Step(1, ALPHA, "psis_alpha", "c_flux", "", "start_alpha"),
    Step(3, ALPHA, "psis_alpha", "c_rotor_flux", "half"),
    Step(5, ALPHA, "start_alpha", "c_rotor"),
    Step(6, ALPHA, "not_start_beta", "angle", "", "rotor_alpha"),
    Step(0, BETA, "is_beta", "c_current", "half"),
    Step(1, BETA, "psis_beta", "c_flux", "", "start_beta"),
    Step(3, BETA, "psis_beta", "c_rotor_flux", "half"),
    Step(5, BETA, "start_beta", "c_rotor"),
    Step(6, BETA, "start_alpha", "angle", "", "rotor_beta"),
    Step(0, FLUX, "omega_r", "c_speed", "half", "angle"),
    Step(1, FLUX, "v_dc", "c_voltage_alpha", "half", "step_alpha"),
    Step(2, FLUX, "v_dc", "c_voltage_beta", "half", "step_beta"),
    Step(5, FLUX, "is_alpha", "c_drop_current", "half"),
    Step(6, FLUX, "step_alpha", "share_alpha", "", "stator_alpha"),
    Step(7, FLUX, "is_beta", "c_drop_current", "half"),
    Step(8, FLUX, "step_beta", "share_beta", "", "stator_beta"),
    *_pass_rotor(10, "start", "lead_", "half_"),
    *_pass_flux(10, "psis", "lead_", "half_"),
)

_LAST_FLUX = _pass_flux(15, "stator")

#: Vectors that are tried: six, and zero voltage once.
VECTORS = 7
#: Clock in which the first torque term is formed; its cost is issued in the next.
MPTC_FIRST_TERM = 27
#: Clocks from a flux vector's way into the magnitude to the one in which its cost is issued.
LENGTH_LATENCY = ITERATIONS // 2 + 1
FIRST_LENGTH = MPTC_FIRST_TERM + 1 - LENGTH_LATENCY
#: Clocks from a vector's length to its torque term and to its comparison.
STREAM_TERM = MPTC_FIRST_TERM - FIRST_LENGTH
STREAM_COMPARE = STREAM_TERM + 1 + SUM_LATENCY

MPTC: tuple[Step, ...] = (
    *_LAST_FLUX,
    *_pass_rotor(16, "rotor"),
    Step(19, FLUX, "torque_ref", "c_torque", "torque_half", "demand"),
    Step(22, BETA, "rotor_beta", "stator_alpha", "torque_half"),
    Step(23, BETA, "rotor_alpha", "not_stator_beta", "", "level"),
    Step(22, FLUX, "rotor_beta", "step_alpha", "torque_half", "along"),
    Step(22, ALPHA, "rotor_alpha", "step_beta", "torque_half", "across"),
    *(
        Step(MPTC_FIRST_TERM + 1 + n, FLUX, "difference", "c_weight", "cost")
        for n in range(VECTORS)
    ),
)

#: Clocks of MPFC: normalising w, its modulus, the radicand and the root.
NORMALISE = 21
MODULUS = NORMALISE + NORMALISE_STEPS + 1
RADICAND = MODULUS + 1 + LATENCY
ROOT = RADICAND + 1 + SUM_LATENCY + 1
ALONG = ROOT + ROOT_WIDTH
MPFC_FIRST_TERM = ALONG + 2 + LATENCY + LATENCY

MPFC: tuple[Step, ...] = (
    Step(4, FLUX, "angle", "not_half_angle", "half", "turn"),
    Step(9, FLUX, "torque_ref", "gain", "half", "moment"),
    Step(13, BETA, "moment", "c_torque", "none", "moment"),
    Step(14, FLUX, "psi_ref", "psi_ref", "half", "square"),
    *_LAST_FLUX,
    Step(16, ALPHA, "rotor_alpha", "turn", "rotor_alpha"),
    Step(17, ALPHA, "not_rotor_beta", "angle", "", "rotor_alpha"),
    Step(16, BETA, "rotor_beta", "turn", "rotor_beta"),
    Step(17, BETA, "rotor_alpha", "angle", "", "rotor_beta"),
    Step(MODULUS, ALPHA, "rotor_alpha", "rotor_alpha", "torque_half"),
    Step(MODULUS + 1, ALPHA, "rotor_beta", "rotor_beta", "", "modulus"),
    Step(RADICAND, FLUX, "square", "modulus", "none"),
    Step(RADICAND + 1, FLUX, "not_moment", "moment", taken=True),
    Step(RADICAND + 2, BETA, "modulus", "gain", "modulus_half", "modulus"),
    Step(RADICAND + 2 + LATENCY, FLUX, "modulus", "step_alpha", "torque_half", "level"),
    Step(ALONG, ALPHA, "rotor_alpha", "root_along", "half"),
    Step(ALONG + 1, ALPHA, "not_rotor_beta", "root_across"),
    Step(ALONG + 2, ALPHA, "modulus", "stator_alpha", "", "along"),
    Step(ALONG, BETA, "rotor_beta", "root_along", "half"),
    Step(ALONG + 1, BETA, "rotor_alpha", "root_across"),
    Step(ALONG + 2, BETA, "modulus", "stator_beta", "", "stator_beta"),
    Step(ALONG + 2 + LATENCY, BETA, "not_stator_beta", "root3_2", "torque_half", "across"),
    *(
        Step(MPFC_FIRST_TERM + 1 + n, FLUX, "difference", "c_weight", "cost")
        for n in range(VECTORS)
    ),
)


def last_clock(first_term: int) -> int:
    """Clock in which ``valid`` is high: term, cost and comparison of the seventh vector."""
    return first_term + 1 + (VECTORS - 1) + SUM_LATENCY + 1


MPTC_LAST = last_clock(MPTC_FIRST_TERM)
MPFC_LAST = last_clock(MPFC_FIRST_TERM)

#: Pairs as they are looked up, two clocks each: first vector, second (0: zero). Of a vector and the
#: opposite one with zero voltage at most one needs a search, so these two have one between them. A
#: pair of active vectors needs one where the torques of both lie on either side of the reference:
#: two of the six do at most. They are met in any case, without a search; the two, the first and the
#: last one of them, are looked up again when the torques of all vectors are known.
PAIR_SLOTS: tuple[tuple[int, int], ...] = (
    (1, 0), (4, 0), (2, 0), (5, 0), (3, 0), (6, 0), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (1, 6),
    (1, 6), (1, 6), (1, 6), (1, 6),
)  # fmt: skip
#: Places of the two, and of the last pair of MPTC2.
FIRST_CROSSED, LAST_CROSSED, LAST_ZERO = 12, 13, 5
#: Searches of a duty at a time; bits that one finds in a clock, of a root one; clocks from one's
#: beginning to its result; clocks between the beginnings of two.
SEARCHES = 2
DUTY_BITS = 2
DUTY_CLOCKS = TIME_WIDTH // DUTY_BITS
ROOT_CLOCKS = TIME_WIDTH
PAIR_SPACING = 2
#: Places of the pairs that the second search serves.
SECOND_SEARCH = (2, 3, FIRST_CROSSED)
#: Places that MPTC2 waits for its first search with the rule mean, before its last two pairs.
ROOT_PAUSE = 3
#: Places of the duties by lengths of MPTC2 with the rule best: vector, search. Each begins when one
#: of the searches is free.
LENGTH_SLOTS: dict[int, tuple[int, int]] = {
    6: (1, 1), 8: (2, 0), 9: (3, 1), 11: (4, 0), 12: (5, 1), 14: (6, 0),
}  # fmt: skip
LAST_LENGTH = max(LENGTH_SLOTS)
#: Clocks from looking a pair up to the beginning of its search: a register behind the table, one
#: behind a vector's torque, one behind the torques' difference. The first two need not level, so
#: MPTC2 and GTV look up earlier.
PAIR_AHEAD = 3
FIRST_PAIR = MPTC_FIRST_TERM + 1 - PAIR_AHEAD
#: Clocks from a search's result to the pair's flux in the magnitude: a register behind the choice
#: between the searches, one behind the share, the product, and one in front of the magnitude.
PAIR_REGISTERS = 3 + SUM_LATENCY


def pair_clock(slot: int) -> int:
    """Clock in which the flux of a pair enters the magnitude."""
    return FIRST_PAIR + PAIR_AHEAD + PAIR_SPACING * slot + DUTY_CLOCKS + PAIR_REGISTERS


#: Clocks from a pair's product to its flux in the magnitude.
WAY_LATENCY = SUM_LATENCY + 1
#: Fluxes and costs of the pairs, and the torques that their duties leave: in MPTC's program and
#: behind it. ``share_x`` is that of the pair then. They are formed for a place without a pair too,
#: and not read. A root comes as many places later as its search takes longer.
PAIRS: tuple[Step, ...] = tuple(
    step
    for clock in map(pair_clock, range(LAST_LENGTH + 1))
    for step in (
        Step(clock - WAY_LATENCY, FLUX, "step_alpha", "share_alpha", "none", taken=True),
        Step(clock - WAY_LATENCY, ALPHA, "share_beta", "step_beta", "none", taken=True),
        Step(clock - WAY_LATENCY, BETA, "share_alpha", "not_along", "level"),
        Step(clock - WAY_LATENCY + 1, BETA, "share_beta", "across", taken=True),
        Step(clock + LENGTH_LATENCY, FLUX, "difference", "c_weight", "cost"),
    )
)

#: Torque at k+1, for a duty by the mean torque: both factors stand for few clocks. It is taken from
#: the demand before the torque at k+2 is.
OPENING: tuple[Step, ...] = (
    Step(19, BETA, "rotor_beta", "stator_alpha", "torque_half"),
    Step(20, BETA, "rotor_alpha", "not_stator_beta", "", "opening"),
)

#: MPTC1's vector is known a clock before MPTC's decision, and a clock after its pair is looked up.
#: Its duty comes out of the first register; a quotient is begun as much later as it takes less.
FIRST_MPTC1 = MPTC_LAST - 2
MPTC1_LAST = FIRST_MPTC1 + PAIR_AHEAD + ROOT_CLOCKS + 2
#: Clocks that a quotient takes less than a root.
QUOTIENT_GAIN = ROOT_CLOCKS - DUTY_CLOCKS
#: The last comparison, then the decision. With the rule mean that is the last root's.
MPTC2_LAST = pair_clock(LAST_ZERO + ROOT_PAUSE) + QUOTIENT_GAIN + STREAM_COMPARE + 2
GTV_LAST = pair_clock(LAST_CROSSED) + STREAM_COMPARE + 2
#: MPTC1 with the rule best: its pair for the torque, then for the length. Both costs are compared.
MPTC1_BEST_LAST = (
    FIRST_MPTC1 + PAIR_AHEAD + PAIR_SPACING + DUTY_CLOCKS + PAIR_REGISTERS + STREAM_COMPARE + 2
)
MPTC2_BEST_LAST = pair_clock(LAST_LENGTH) + STREAM_COMPARE + 2
#: Clocks that MPTC1 is ahead of the others in the program behind MPTC's last clock, so that the
#: products of its pairs are in the clocks of PAIRS.
MPTC1_LEAD = (FIRST_PAIR - FIRST_MPTC1) % PAIR_SPACING
#: What is added to a clock behind MPTC's last for its address.
PAIR_OFFSET = MPFC_LAST + FORK_OFFSET - MPTC_LAST


#: Clock of the flux methods of several vectors in which the way of u_1 is formed.
WAY = RADICAND + 2 + LATENCY + 1
#: Their first clock with an address of its own; nothing is issued or written around it.
HEXAGON_FORK = ALONG - 1
#: Clock in which e stands in the accumulators; it is taken, and halved where it is long.
REST = ALONG + 2 + SUM_LATENCY
#: First bit of the quotients, first turn, first choice; clocks.
DIVISION = REST + 1 + FAR_STEPS
TURN = DIVISION + QUOTIENT_WIDTH - 1 + 1
#: Turns by 60 degrees that bring any vector to u_1's place at most.
TURNS = 5
FIRST_CHOICE = TURN + TURNS
#: Choices of a second vector; clocks for each, and from its beginning to its residue.
CHOICES = 7
CHOICE_CLOCKS = 2
RESIDUE = 2


def choice_clock(n: int) -> int:
    """Clock in which a choice of a second vector begins."""
    return FIRST_CHOICE + CHOICE_CLOCKS * n


#: MPFC2, MPFC3, MPC2 and SVM: in MPFC's program, and in place of its end.
HEXAGON: tuple[Step, ...] = (
    Step(WAY, FLUX, "step_alpha", "modulus", "none", taken=True),
    Step(WAY + 1, FLUX, "step_beta", "modulus", "none", taken=True),
    Step(ALONG, ALPHA, "rotor_alpha", "root_along", "centre_alpha"),
    Step(ALONG + 1, ALPHA, "not_rotor_beta", "root_across"),
    Step(ALONG + 2, ALPHA, "modulus", "stator_alpha", taken=True),
    Step(ALONG, BETA, "rotor_beta", "root_along", "centre_beta"),
    Step(ALONG + 1, BETA, "rotor_alpha", "root_across"),
    Step(ALONG + 2, BETA, "modulus", "stator_beta", taken=True),
    *(
        step
        for n in range(CHOICES)
        for step in (
            Step(choice_clock(n) + RESIDUE, ALPHA, "residue_h", "residue_h", "torque_half"),
            Step(choice_clock(n) + RESIDUE + 1, ALPHA, "residue_g", "residue_sum", taken=True),
        )
    ),
)
#: Clocks from a choice's beginning to its comparison; clock in which ``valid`` is high.
CHOICE_COMPARE = RESIDUE + 1 + SUM_LATENCY
HEXAGON_LAST = choice_clock(CHOICES - 1) + CHOICE_COMPARE + 2
#: What is added to a clock from HEXAGON_FORK on for its address.
HEXAGON_OFFSET = MPTC2_BEST_LAST + PAIR_OFFSET + 1 - HEXAGON_FORK
#: MPFC's products that the others have too.
BEFORE_HEXAGON: tuple[Step, ...] = tuple(s for s in MPFC if s.clock < HEXAGON_FORK)


def base(name: str) -> str:
    """Operand without ``half_`` or ``lead_``. One of OPERANDS, or unknown."""
    return name.removeprefix("half_").removeprefix("lead_")


def address(clock: int, flux_control: bool) -> int:
    """Program address of a clock, 0 to 127, counted from the one that accepts ``start``."""
    return clock + FORK_OFFSET if flux_control and clock >= FORK else clock


def pair_address(clock: int, lead: int = 0) -> int:
    """Program address of a clock of MPTC1, MPTC2 and GTV.

    As MPTC's up to its last, then behind MPFC's. `lead` is MPTC1_LEAD for MPTC1.
    """
    return clock + PAIR_OFFSET + lead if clock > MPTC_LAST else clock


def hexagon_address(clock: int) -> int:
    """Program address of a clock of MPFC2, MPFC3, MPC2 and SVM.

    As MPFC's before HEXAGON_FORK, then behind the pairs'.
    """
    return clock + HEXAGON_OFFSET if clock >= HEXAGON_FORK else address(clock, True)


def check_lengths() -> None:
    """ValueError where the searches by lengths meet another one, or another pair.

    Of two opposite vectors the second may begin the search by the torque anew. A pair whose duty
    the length tells has 1 as its second vector.
    """
    if any(second == 1 for _, second in PAIR_SLOTS):
        raise ValueError("a pair with u_1 as its second vector stands for a duty by the length")
    torques = [n for n in range(LAST_ZERO + 1) if not PAIR_SLOTS[n][1]]
    for unit in range(SEARCHES):
        ends = max(n for n in torques if (n in SECOND_SEARCH) == bool(unit))
        for place in sorted(n for n, (_, search) in LENGTH_SLOTS.items() if search == unit):
            if PAIR_SPACING * (place - ends) < DUTY_CLOCKS:
                raise ValueError(f"the search at place {place} begins before the last one ends")
            ends = place
    if sorted(vector for vector, _ in LENGTH_SLOTS.values()) != list(range(1, VECTORS)):
        raise ValueError("not every vector has a duty by its length")
    if QUOTIENT_GAIN % PAIR_SPACING:
        raise ValueError("the products of roots are not in the clocks of PAIRS")
    if PAIR_SPACING * (LAST_ZERO - 1 + ROOT_PAUSE - 1) < ROOT_CLOCKS:
        raise ValueError("the third root begins before the first one ends")


def check(steps: tuple[Step, ...]) -> None:
    """ValueError where a method's program contradicts itself.

    Every operand must have been written in time and not be overwritten before, a block does one
    thing at a time, and a sum is not interrupted.
    """
    written: dict[str, list[int]] = {}
    occupied: set[tuple[int, int]] = set()
    for step in steps:
        if (step.clock, step.block) in occupied:
            raise ValueError(f"block {step.block} does two things in clock {step.clock}")
        occupied.add((step.clock, step.block))
        for name in (step.a, base(step.b)):
            if name not in OPERANDS:
                raise ValueError(f"unknown operand {name}")
        if step.seed and step.seed not in SEEDS:
            raise ValueError(f"unknown seed {step.seed}")
        if step.result:
            written.setdefault(step.result, []).append(step.clock + LATENCY)
    for step in steps:
        for name in (step.a, step.b, step.seed):
            plain = base(name).removeprefix("not_")
            if name == step.seed and any(
                step.clock < at <= step.clock + SEED_WAIT for at in written.get(plain, [])
            ):
                raise ValueError(f"seed {name} of clock {step.clock} is written as it waits")
            if plain in written and min(written[plain]) > step.clock:
                raise ValueError(f"{name} is read in clock {step.clock}, before it is written")
    for block in range(BLOCKS):
        order = sorted((s for s in steps if s.block == block), key=lambda s: s.clock)
        open_sum = False
        for step in order:
            if open_sum == bool(step.seed):
                raise ValueError(f"block {block}: the sum at clock {step.clock} has no beginning")
            open_sum = not step.result and not step.taken and step.seed != "cost"


if MPTC_LAST >= FORK + FORK_OFFSET:
    raise ValueError("the addresses of MPFC overlap those of MPTC")
check_lengths()
check(COMMON + MPTC)
check(COMMON + MPTC + OPENING + PAIRS)
check(COMMON + MPFC)
check(COMMON + BEFORE_HEXAGON + HEXAGON)
