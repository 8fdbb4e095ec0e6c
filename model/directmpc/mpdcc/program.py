"""The common terms of Paper A, Section V-A, as a program for the multiply-accumulate blocks.

Whatever does not depend on the candidate is computed once per step: errors at k, the natural part
of their slopes, and the voltage and capacitor-current terms from which a candidate's slopes are
put together by additions alone.  The list of products is data: the RTL sequencer, the bit-true
model and the documentation all read this program, so none of them can disagree about it.

The slopes of the current error e = i* - i, per step and in stationary coordinates, are Paper A's
(14) divided by L (the extrapolation is linear, so L enters the correction term alone)::

    b_alpha = -h*w_s*i*_beta + h/tau_s*i_alpha - h*Xm/(D*tau_r)*psi_alpha
              - h*Xm/D*w_r*psi_beta - p*L*h^2*w_r^2*psi_alpha
    b_beta  = +h*w_s*i*_alpha + h/tau_s*i_beta - h*Xm/(D*tau_r)*psi_beta
              + h*Xm/D*w_r*psi_alpha - p*L*h^2*w_r^2*psi_beta

The beta component carries the factor sqrt(3)/2 of the inverse Clarke transformation in its
coefficients, so that b_b = -b_alpha/2 + b_beta and b_c = -b_alpha/2 - b_beta need no product.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from directmpc.converter import Converter, load, names
from directmpc.mpdcc import formats as f

#: Coefficient ports of the core, in port order; all 16 bits signed.
COEFFICIENTS: tuple[str, ...] = (
    "error_alpha",
    "error_beta",
    "error_neutral",
    "error_phase",
    "stator_alpha",
    "stator_beta",
    "rotor_alpha",
    "rotor_beta",
    "reference_alpha",
    "reference_beta",
    "emf_alpha",
    "emf_beta",
    "correction_alpha",
    "correction_beta",
    "forced_voltage",
    "forced_neutral",
    "phase_alpha",
    "phase_beta",
    "midpoint_alpha",
    "midpoint_beta",
    "weight",
    "weight_alpha",
    "weight_beta",
    "curvature_emf_alpha",
    "curvature_emf_beta",
    "curvature_flux_alpha",
    "curvature_flux_beta",
    "curvature_reference_alpha",
    "curvature_reference_beta",
    "change_phase",
    "change_midpoint",
    "change_weight",
    "error_forced",
)

#: Operands A (18 bits): measurements, their differences, and products fed back.
SIGNALS: tuple[str, ...] = (
    "is_alpha",
    "is_beta",
    "psir_alpha",
    "psir_beta",
    "v_n",
    "v_ph_a",
    "v_ph_b",
    "v_ph_c",
    "v_dc",
    "iref_alpha",
    "iref_beta",
    "difference_alpha",  # iref - is
    "difference_beta",
    "difference_a",  # v_dc - 2*v_ph: 4*(v_dc/4 - v_ph) at the scale of v_ph; v_dc - v_ph for v_dc/2
    "difference_b",
    "difference_c",
)

#: Products kept as operands (18 bits).
PRODUCTS: tuple[str, ...] = (
    "reference_speed_alpha",  # w_s * iref_alpha
    "reference_speed_beta",
    "flux_speed_alpha",  # w_r * psir_alpha
    "flux_speed_beta",
    "flux_speed2_alpha",  # w_r^2 * psir_alpha
    "flux_speed2_beta",
    "reference_speed2_alpha",  # w_s^2 * iref_alpha
    "reference_speed2_beta",
    "reference_slope_alpha",  # of iref, trajectory units per step; from here on: successor
    "reference_slope_beta",
    "bend_step_alpha",  # curvature * length
    "bend_step_beta",
    "change_alpha",  # of the current, 16 trajectory units
    "change_beta",
    "neutral_ahead",  # error of v_n at the successor, once more
)

#: Operands A (18 bits) of the successor's program: the node it starts from, see `successor`.
BASE: tuple[str, ...] = (
    "bend_alpha",  # curvature
    "bend_beta",
    "secant_alpha",  # mean slope of the current error on the way
    "secant_beta",
    "drift_alpha",  # half of what the current moves by per step
    "drift_beta",
    "base_error_alpha",
    "base_error_beta",
    "base_phase_alpha",
    "base_phase_beta",
    "base_midpoint_alpha",
    "base_midpoint_beta",
    "base_error_neutral",
    "base_error_a",
    "base_error_b",
    "base_error_c",
    "charge_a",  # slopes of the errors of v_ph and v_n under s1, but for their signs
    "charge_b",
    "charge_c",
    "neutral_slope",
    "quarter_link",  # a quarter of forced_link
    "ahead_a",  # errors of v_ph at the successor
    "ahead_b",
    "ahead_c",
    "midpoint_ahead_alpha",  # four times the terms of the successor
    "midpoint_ahead_beta",
)

#: Terms of the node (23 bits), as the sequencer delivers them.
TERMS: tuple[str, ...] = (
    "error_alpha",
    "error_beta",
    "error_neutral",
    "error_a",
    "error_b",
    "error_c",
    "slope_alpha",
    "slope_beta",
    "forced_link",  # h*Xr/(3*D) * v_dc/2, two extra fractional bits, as the next four
    "forced_neutral",
    "forced_a",
    "forced_b",
    "forced_c",
    "phase_alpha",  # h/X_ph * i
    "phase_beta",
    "midpoint_alpha",  # h/(2*X_dc) * i
    "midpoint_beta",
    "weight_start",  # sqrt(lambda_n) * v_n
    "weight_alpha",  # its slope per step, two extra fractional bits
    "weight_beta",
    "curvature_alpha",  # of the current error, per square step; the fast variant alone
    "curvature_beta",
)

SPEEDS: tuple[str, ...] = ("omega_s", "omega_r")

#: Factors B of the successor's program: 128 * L1, the same with the signs of the slopes of v_ph and
#: v_n under s1 or zero, and powers of two.
STEPS: tuple[str, ...] = (
    "length", "length_a", "length_b", "length_c", "length_neutral",
    "power_7", "power_13", "power_14",
)  # fmt: skip


@dataclass(frozen=True)
class Step:
    """One product of the program."""

    a: str  # Operand A: one of SIGNALS or PRODUCTS
    b: str  # Operand B: one of COEFFICIENTS or SPEEDS
    alignment: int  # Index into ``formats.ALIGNMENT``: left shift of the product
    # One of PRODUCTS or TERMS; successive steps of one block with the same result accumulate.
    result: str


def _slope(name: str, other: str) -> list[Step]:
    """Slope of one component of the current error, without the correction."""
    return [
        Step(f"is_{name}", f"stator_{name}", 0, f"slope_{name}"),
        Step(f"psir_{name}", f"rotor_{name}", 0, f"slope_{name}"),
        Step(f"reference_speed_{other}", f"reference_{name}", 0, f"slope_{name}"),
        Step(f"flux_speed_{other}", f"emf_{name}", 1, f"slope_{name}"),
    ]


def _current(
    name: str, other: str, end: list[Step], before: tuple[Step, ...] = ()
) -> tuple[Step, ...]:
    """Program of the block that owns one current component; `before` comes before the slope."""
    return (
        Step(f"psir_{name}", "omega_r", 1, f"flux_speed_{name}"),
        Step(f"is_{name}", f"phase_{name}", 0, f"phase_{name}"),
        Step(f"is_{name}", f"midpoint_{name}", 0, f"midpoint_{name}"),
        Step(f"difference_{name}", f"error_{name}", 2, f"error_{name}"),
        *before,
        *_slope(name, other),
        *end,
    )


def _correction(name: str) -> Step:
    """Paper A's correction of the Euler step."""
    return Step(f"flux_speed2_{name}", f"correction_{name}", 1, f"slope_{name}")


def _curvature(name: str, other: str) -> tuple[Step, ...]:
    """Curvature of one component of the current error; the end of a program."""
    return (
        Step(f"flux_speed_{other}", f"curvature_emf_{name}", 0, f"curvature_{name}"),
        Step(f"flux_speed2_{name}", f"curvature_flux_{name}", 0, f"curvature_{name}"),
        Step(f"reference_speed2_{name}", f"curvature_reference_{name}", 0, f"curvature_{name}"),
    )


def _advance(name: str, other: str) -> tuple[Step | None, ...]:
    """Successor: the block that owns one current component."""
    change = f"change_{name}"
    return (
        Step(f"bend_{name}", "length", 3, f"bend_step_{name}"),
        Step(f"reference_speed_{other}", f"reference_{name}", 0, f"reference_slope_{name}"),
        None,
        None,
        None,
        Step(f"drift_{name}", "length", 2, change),
        None,
        None,
        Step(f"base_phase_{name}", "power_13", 1, f"phase_{name}"),
        Step(change, "change_phase", 1, f"phase_{name}"),
        Step(f"base_midpoint_{name}", "power_13", 1, f"midpoint_{name}"),
        Step(change, "change_midpoint", 1, f"midpoint_{name}"),
        Step(f"secant_{name}", "length", 3, f"error_{name}"),
        Step(f"base_error_{name}", "power_7", 3, f"error_{name}"),
        None,
        Step(f"midpoint_ahead_{name}", "change_weight", 1, f"weight_{name}"),
    )


def _charged(phase: str) -> tuple[Step, ...]:
    """Successor: error of a phase capacitor's voltage."""
    return (
        Step(f"charge_{phase}", f"length_{phase}", 3, f"error_{phase}"),
        Step(f"base_error_{phase}", "power_7", 3, f"error_{phase}"),
    )


def _voltage(phase: str, quarters: int) -> tuple[Step, ...]:
    """Successor: voltage term of a phase capacitor, whose reference is so many quarters of v_dc."""
    return (
        *[Step("quarter_link", "power_14", 1, f"forced_{phase}")] * quarters,
        Step(f"ahead_{phase}", "error_forced", 1, f"forced_{phase}"),
    )


_FORCED = {
    name: Step(signal, "forced_neutral" if signal == "v_n" else "forced_voltage", 1, name)
    for name, signal in (
        ("forced_link", "v_dc"),
        ("forced_neutral", "v_n"),
        ("forced_a", "v_ph_a"),
        ("forced_b", "v_ph_b"),
        ("forced_c", "v_ph_c"),
    )
}
_WEIGHT_ALPHA = Step("is_alpha", "weight_alpha", 1, "weight_alpha")
_WEIGHT_BETA = Step("is_beta", "weight_beta", 1, "weight_beta")
_WEIGHT_START = Step("v_n", "weight", 1, "weight_start")
_HEAD_2 = (
    Step("iref_alpha", "omega_s", 1, "reference_speed_alpha"),
    Step("difference_a", "error_phase", 2, "error_a"),
    Step("difference_b", "error_phase", 2, "error_b"),
    _FORCED["forced_link"],
    Step("flux_speed_alpha", "omega_r", 0, "flux_speed2_alpha"),
)
_HEAD_3 = (
    Step("iref_beta", "omega_s", 1, "reference_speed_beta"),
    Step("v_n", "error_neutral", 2, "error_neutral"),
    Step("difference_c", "error_phase", 2, "error_c"),
    _FORCED["forced_neutral"],
    Step("flux_speed_beta", "omega_r", 0, "flux_speed2_beta"),
)


def _squared(name: str) -> Step:
    """w_s^2 times one component of the reference."""
    return Step(f"reference_speed_{name}", "omega_s", 0, f"reference_speed2_{name}")


#: One list per multiply-accumulate block and variant; position in the list is the clock of issue.
#: A result belongs to one block in the fast variant's program and the successor's: a second one
#: would cost a multiplexer before its register and one more clipper.
PROGRAMS: dict[str, tuple[tuple[Step, ...], ...]] = {
    "paper": (
        _current("alpha", "beta", [_correction("alpha")]),
        _current("beta", "alpha", [_correction("beta")]),
        (*_HEAD_2, _FORCED["forced_a"], _FORCED["forced_c"], _WEIGHT_ALPHA),
        (*_HEAD_3, _FORCED["forced_b"], _WEIGHT_START, _WEIGHT_BETA),
    ),
    "fast": (
        _current("alpha", "beta", [_WEIGHT_ALPHA], (_squared("alpha"),)),
        _current("beta", "alpha", [_WEIGHT_BETA], (_squared("beta"),)),
        (*_HEAD_2, _FORCED["forced_a"], _FORCED["forced_b"], *_curvature("alpha", "beta")),
        (*_HEAD_3, _FORCED["forced_c"], _WEIGHT_START, *_curvature("beta", "alpha")),
    ),
}
PROGRAM = PROGRAMS["paper"]


def _successor(quarters: int) -> tuple[tuple[Step | None, ...], ...]:
    """The successor's program, run after the fast variant's on the same blocks; None: no product.

    `quarters` is the reference of v_ph, quarters of v_dc.
    """
    phase_b = (*_charged("b"), *_voltage("a", quarters), *_voltage("b", quarters))
    return (
        _advance("alpha", "beta"),
        _advance("beta", "alpha"),
        (*[None] * 4, *_charged("a"), *phase_b, *[None] * (6 - 2 * quarters)),
        (
            None,
            Step("neutral_slope", "length_neutral", 3, "neutral_ahead"),
            Step("base_error_neutral", "power_7", 3, "neutral_ahead"),
            None,
            *_charged("c"),
            None,
            None,
            *_voltage("c", quarters),
            *[None] * (2 - quarters),
            Step("neutral_ahead", "power_7", 3, "error_neutral"),
            Step("neutral_ahead", "error_forced", 1, "forced_neutral"),
            Step("neutral_ahead", "change_weight", 1, "weight_start"),
            None,
            None,
        ),
    )


SUCCESSOR = _successor(1)
SUCCESSOR_LENGTH = len(SUCCESSOR[0])

#: Results of the successor's program that are saturated; the others cannot exceed their words, as
#: long as the successor's errors are within their bounds or one step away from errors of
#: BASE_WIDTH: such an error and the largest slope make less than 2**17, which ``error_forced``
#: turns into less than 2**19 even with half of the largest ``forced_link`` added. Where v_ph's
#: reference is v_dc/2 all of it is added: there the voltage terms are saturated too.
SUCCESSOR_SATURATES: tuple[str, ...] = (
    "change_alpha", "change_beta", "phase_alpha", "phase_beta", "midpoint_alpha", "midpoint_beta",
    "weight_alpha", "weight_beta", "weight_start",
)  # fmt: skip

#: Clocks from issuing a product until its rounded result can be an operand.
RESULT_LATENCY = 4

#: Results that take the register of a product which no step reads any more: result to product, by
#: what is run: one variant's program alone, or the fast one's and the successor's.
REGISTERS: dict[str, dict[str, str]] = {
    "paper": {},
    "successor": {
        "slope_alpha": "reference_speed2_alpha",
        "slope_beta": "reference_speed2_beta",
        "weight_alpha": "flux_speed_alpha",
        "weight_beta": "flux_speed_beta",
        "curvature_alpha": "flux_speed2_alpha",
        "curvature_beta": "flux_speed2_beta",
    },
}
REGISTERS["fast"] = REGISTERS["successor"] | {
    "forced_b": "reference_speed_alpha",
    "forced_c": "reference_speed_beta",
}
PROGRAM_LENGTHS = {
    variant: max(len(block) for block in program) for variant, program in PROGRAMS.items()
}

Program = tuple[tuple[Step | None, ...], ...]


@dataclass(frozen=True)
class Plan:
    """What the blocks of a core run, by what its converter has."""

    programs: dict[str, Program]  # As ``PROGRAMS``
    successor: Program  # As ``SUCCESSOR``
    registers: dict[str, dict[str, str]]  # As ``REGISTERS``
    absent: frozenset[str]  # Results that no step computes
    capacitor_step: int  # Step that completes what the capacitor search needs
    successor_step: int  # Likewise of the successor's program, before its first read
    saturating: tuple[str, ...] = SUCCESSOR_SATURATES  # As ``SUCCESSOR_SATURATES``


#: Results that are about phase capacitors; phase_* gives the signs of the currents too.
_OF_CAPACITORS = ("error_a", "error_b", "error_c", "forced_a", "forced_b", "forced_c")
_OF_CAPACITOR_CURRENTS = ("phase_alpha", "phase_beta")
_OF_NEUTRAL = (
    "error_neutral", "forced_neutral", "neutral_ahead", "midpoint_alpha", "midpoint_beta",
    "weight_start", "weight_alpha", "weight_beta",
)  # fmt: skip


def _two_blocks(name: str, other: str, own: tuple[Step, Step]) -> tuple[Step, ...]:
    """Without phase capacitors two blocks do: the one that owns a current component.

    The other component's products are squared here, so that a block reads one component's alone.
    """
    stator, rotor, reference, emf = _slope(name, other)
    return (
        Step(f"psir_{name}", "omega_r", 1, f"flux_speed_{name}"),
        Step(f"iref_{name}", "omega_s", 1, f"reference_speed_{name}"),
        own[0],
        Step(f"is_{name}", f"midpoint_{name}", 0, f"midpoint_{name}"),
        Step(f"flux_speed_{other}", "omega_r", 0, f"flux_speed2_{other}"),
        _squared(other),
        Step(f"difference_{name}", f"error_{name}", 2, f"error_{name}"),
        *_curvature(name, other),
        own[1],
        *(emf, reference, stator, rotor),
        _WEIGHT_ALPHA if name == "alpha" else _WEIGHT_BETA,
    )


#: Registers of the two blocks' results, as ``REGISTERS``.
_TWO_BLOCKS_REGISTERS = {
    "slope_alpha": "reference_speed2_beta",
    "slope_beta": "reference_speed2_alpha",
    "weight_alpha": "flux_speed_alpha",
    "weight_beta": "flux_speed_beta",
    "curvature_alpha": "flux_speed2_beta",
    "curvature_beta": "flux_speed2_alpha",
}


USUAL = Plan(PROGRAMS, SUCCESSOR, REGISTERS, frozenset(), 3, 9)


def _without(program: Program, absent: Collection[str]) -> Program:
    """A program whose blocks pause instead of computing these results."""
    return tuple(
        tuple(None if step and step.result in absent else step for step in block)
        for block in program
    )


def plan_of(leg: Converter) -> Plan:
    """What the blocks run for a converter."""
    capacitors, neutral = bool(leg.capacitor.any()), bool(leg.neutral.any())
    capacitor_currents = capacitors or leg.has_signed_weights
    quarters = round(4 * leg.capacitor_share) or 1
    gone: tuple[str, ...] = () if capacitors else _OF_CAPACITORS
    gone += () if capacitor_currents else _OF_CAPACITOR_CURRENTS
    gone += () if neutral else _OF_NEUTRAL
    programs, registers, steps = PROGRAMS, REGISTERS, (3, 9)
    if not capacitor_currents:
        fast = (
            _two_blocks("alpha", "beta", (_HEAD_3[1], _FORCED["forced_link"])),
            _two_blocks("beta", "alpha", (_WEIGHT_START, _FORCED["forced_neutral"])),
            (),
            (),
        )
        programs = PROGRAMS | {"fast": fast}
        registers = REGISTERS | {
            "successor": _TWO_BLOCKS_REGISTERS,
            "fast": _TWO_BLOCKS_REGISTERS
            | {"forced_link": "reference_speed_alpha", "forced_neutral": "reference_speed_beta"},
        }
        steps = (3, 11)
    absent = frozenset(gone)
    return Plan(
        {variant: _without(program, absent) for variant, program in programs.items()},
        _without(_successor(quarters), absent),
        {
            run: {name: of for name, of in pairs.items() if name not in absent}
            for run, pairs in registers.items()
        },
        absent,
        *steps,
        SUCCESSOR_SATURATES + _OF_CAPACITORS[3:] * (quarters > 1),
    )


def result_width(name: str) -> int:
    """Width in bits of a result (saturating). The sign is included."""
    if name == "weight_start" or name in PRODUCTS:
        return f.OPERAND_WIDTH
    if name.removesuffix("_alpha").removesuffix("_beta") in ("phase", "midpoint"):
        return f.CURRENT_TERM_WIDTH - 1  # the sum of two of them has to fit
    if name in ("weight_alpha", "weight_beta"):
        return f.WEIGHT_SLOPE_WIDTH
    if name.startswith("forced_"):
        return f.FORCED_WIDTH
    if name.startswith("curvature_"):
        return f.CURVATURE_TERM_WIDTH
    return f.TERM_WIDTH


def _largest_signal(name: str) -> int:
    """Largest magnitude of an operand A that is no product."""
    if name in ("difference_alpha", "difference_beta"):
        return 2**16 - 1
    if name.startswith("difference_"):
        return 2 * (2**16 - 1)
    unsigned = name.startswith(("v_ph", "v_dc"))
    return 2**16 - 1 if unsigned else 2**15


def largest_sums(program: Program) -> dict[str, int]:
    """Largest magnitude of each sum before saturation, ``formats.RESULT_SHIFT`` bits below its LSB.

    Every operand and coefficient is taken at the extreme of its word, whatever a drive allows.
    """
    largest: dict[str, int] = {}
    for clock in range(max(len(block) for block in program)):
        for block in program:
            if clock >= len(block):
                continue
            step = block[clock]
            if step is None:
                continue
            if step.a in SIGNALS:
                a = _largest_signal(step.a)
            else:
                limit = 2 ** (result_width(step.a) - 1)
                a = min(limit, largest[step.a] >> f.RESULT_SHIFT)
            product = a * 2 ** (f.COEFFICIENT_WIDTH - 1) << f.ALIGNMENT[step.alignment]
            largest[step.result] = largest.get(step.result, 2 ** (f.RESULT_SHIFT - 1)) + product
    return largest


def saturates(variant: str, name: str, plan: Plan = USUAL) -> bool:
    """Whether a result can exceed its word at all: only then is there logic to saturate it."""
    sums = largest_sums(plan.programs[variant])
    if variant == "fast" and name in plan.saturating:
        return True
    return name in sums and sums[name] >> f.RESULT_SHIFT >= 2 ** (result_width(name) - 1)


def base_alignment(program: Program, result: str) -> int:
    """Smallest alignment among the products of a result: it costs no logic, only wiring.

    An index into ``formats.ALIGNMENT``.
    """
    return min(
        step.alignment for block in program for step in block if step and step.result == result
    )


def check_program(variant: str, plan: Plan = USUAL) -> None:
    """ValueError where a step reads a product before it exists, or a sum is interrupted."""
    program = plan.programs[variant]
    ready: dict[str, int] = {}
    for block in program:
        for clock, step in enumerate(block):
            if step and step.result in PRODUCTS:
                ready[step.result] = clock + RESULT_LATENCY
    seen: set[str] = set()
    for block in program:
        last = ""
        for clock, step in enumerate(block):
            if step is None:
                last = ""
                continue
            if step.a not in SIGNALS and clock < ready[step.a]:
                raise ValueError(f"{step.a} is read at clock {clock}, ready at {ready[step.a]}")
            if step.b not in COEFFICIENTS and step.b not in SPEEDS:
                raise ValueError(f"unknown operand B {step.b}")
            if step.result in seen and step.result != last:
                raise ValueError(f"the sum {step.result} is interrupted at clock {clock}")
            seen.add(step.result)
            last = step.result
    spared = ("reference_slope_", "bend_step_", "change_", "neutral_ahead")  # the successor's
    if variant == "paper":
        spared += ("curvature_", "reference_speed2_")
    if max(largest_sums(program).values()) >= 2 ** (f.ACCUMULATOR_WIDTH - 1):
        raise ValueError("a sum does not fit the accumulator")
    missing = {n for n in (*TERMS, *PRODUCTS) if not n.startswith(spared)} - seen - plan.absent
    if missing:
        raise ValueError(f"no step computes {sorted(missing)}")


def check_registers(run: str, plan: Plan = USUAL) -> None:
    """ValueError where a result takes the register of a product that is read later."""
    root = plan.programs["paper" if run == "paper" else "fast"]
    after = plan.successor if run == "successor" else ()
    # what both programs compute is taken at the same bit of the accumulator, whichever are run
    aligned = root if run == "paper" else (*root, *plan.successor)
    for result, product in plan.registers[run].items():
        owner = [b for b, block in enumerate(root) if any(s and s.result == result for s in block)]
        before = [
            b for b, block in enumerate(root) if any(s and s.result == product for s in block)
        ]
        if owner != before or product not in PRODUCTS:
            raise ValueError(f"{result} and {product} are not of one block")
        if base_alignment(aligned, result) != base_alignment(aligned, product):
            raise ValueError(f"{result} and {product} have different alignments")
        ends = max(i for i, step in enumerate(root[owner[0]]) if step and step.result == result)
        read = [i for block in root for i, step in enumerate(block) if step and step.a == product]
        steps = [step for block in after for step in block if step]
        later = [step for step in steps if product in (step.a, step.result)]
        if max(read) >= ends + RESULT_LATENCY or later:
            raise ValueError(f"{product} is read after {result} has taken its register")


def largest_of_blocks(run: str, plan: Plan = USUAL) -> list[int]:
    """Largest magnitude in each block's accumulator, in its LSB, whatever the operands are.

    `run` is "paper", "fast", or "successor" for the fast variant's program and the successor's.
    """
    root = plan.programs["paper" if run == "paper" else "fast"]
    aligned = root if run == "paper" else (*root, *plan.successor)
    # a block that always pauses holds one product, as each does
    found = [2 ** (f.OPERAND_WIDTH + f.COEFFICIENT_WIDTH - 2)] * len(root)
    for program in (root, plan.successor) if run == "successor" else (root,):
        for number, block in enumerate(program):
            before, total = "", 0
            for step in block:
                if step is None:
                    before = ""
                    continue
                known = step.a in SIGNALS
                a = _largest_signal(step.a) if known else 2 ** (f.OPERAND_WIDTH - 1)
                base = base_alignment(aligned, step.result)
                shift = f.ALIGNMENT[step.alignment] - f.ALIGNMENT[base]
                product = a * 2 ** (f.COEFFICIENT_WIDTH - 1) << shift
                total = product + (total if step.result == before else 2 ** (f.RESULT_SHIFT - 1))
                before = step.result
                found[number] = max(found[number], total)
    return found


def check_successor(program: Program) -> None:
    """ValueError where a product is read before it exists, or blocks differ in length."""
    ready = {
        step.result: clock + RESULT_LATENCY
        for block in program
        for clock, step in enumerate(block)
        if step
    }
    # operands that adders outside make of products of this program
    sources = {"secant": "bend_step", "drift": "reference_slope"}
    for block in program:
        for clock, step in enumerate(block):
            if step is None:
                continue
            name, _, component = step.a.rpartition("_")
            needed = [f"{sources[name]}_{component}"] if name in sources else []
            # the clocks of the registers in node_base: the secant's, and that of the signed lengths
            late = 1 if name in ("secant", "drift") else 0
            if step.b.startswith("length_") and clock < 1:
                raise ValueError(f"{step.b} is read at {clock}, ready at 1")
            if name == "ahead":
                needed = [f"error_{component}"]
            elif name == "midpoint_ahead":
                needed = [f"midpoint_{component}"]
            elif step.a in PRODUCTS and not step.a.startswith("reference_speed"):
                needed = [step.a]
            if name == "drift":
                needed.append(f"bend_step_{component}")
            for source in needed:
                due = ready[source] + (late if source.startswith("bend_step") else 0)
                if clock < due:
                    raise ValueError(f"{step.a} is read at {clock}, ready at {due}")
    if len({len(block) for block in program}) != 1:
        raise ValueError("the successor's blocks differ in length")


for _plan in (USUAL, *(plan_of(load(name)) for name in names())):
    for _variant in _plan.programs:
        check_program(_variant, _plan)
    for _run in _plan.registers:
        check_registers(_run, _plan)
for _quarters in (1, 2):
    check_successor(_successor(_quarters))
