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

from dataclasses import dataclass

from directmpc import formats as f

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
    "difference_a",  # v_dc - 2*v_ph: 4*(v_dc/4 - v_ph) at the scale of v_ph
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
    "weight_alpha",  # its slope per step and ampere, two extra fractional bits
    "weight_beta",
)

SPEEDS: tuple[str, ...] = ("omega_s", "omega_r")


@dataclass(frozen=True)
class Step:
    """One product of the program.

    Parameters
    ----------
    a : str
        Operand A: one of SIGNALS or PRODUCTS.
    b : str
        Operand B: one of COEFFICIENTS or SPEEDS.
    alignment : int
        Index into ``formats.ALIGNMENT``: left shift of the product.
    result : str
        One of PRODUCTS or TERMS; successive steps of one block with the same result accumulate.
    """

    a: str
    b: str
    alignment: int
    result: str


def _component(name: str, other: str, flux2: str) -> list[Step]:
    """Slope of one component of the current error, five products."""
    return [
        Step(f"is_{name}", f"stator_{name}", 0, f"slope_{name}"),
        Step(f"psir_{name}", f"rotor_{name}", 0, f"slope_{name}"),
        Step(f"reference_speed_{other}", f"reference_{name}", 0, f"slope_{name}"),
        Step(f"flux_speed_{other}", f"emf_{name}", 1, f"slope_{name}"),
        Step(flux2, f"correction_{name}", 1, f"slope_{name}"),
    ]


def _block(name: str, other: str) -> list[Step]:
    """Program of the block that owns one current component."""
    return [
        Step(f"psir_{name}", "omega_r", 1, f"flux_speed_{name}"),
        Step(f"difference_{name}", f"error_{name}", 2, f"error_{name}"),
        Step(f"is_{name}", f"phase_{name}", 0, f"phase_{name}"),
        Step(f"is_{name}", f"midpoint_{name}", 0, f"midpoint_{name}"),
        *_component(name, other, f"flux_speed2_{name}"),
    ]


#: One list per multiply-accumulate block; position in the list is the clock it is issued.
PROGRAM: tuple[tuple[Step, ...], ...] = (
    tuple(_block("alpha", "beta")),
    tuple(_block("beta", "alpha")),
    (
        Step("iref_alpha", "omega_s", 1, "reference_speed_alpha"),
        Step("v_n", "error_neutral", 2, "error_neutral"),
        Step("difference_b", "error_phase", 2, "error_b"),
        Step("v_dc", "forced_voltage", 1, "forced_link"),
        Step("flux_speed_alpha", "omega_r", 0, "flux_speed2_alpha"),
        Step("v_ph_a", "forced_voltage", 1, "forced_a"),
        Step("v_ph_c", "forced_voltage", 1, "forced_c"),
        Step("is_alpha", "weight_alpha", 1, "weight_alpha"),
    ),
    (
        Step("iref_beta", "omega_s", 1, "reference_speed_beta"),
        Step("difference_a", "error_phase", 2, "error_a"),
        Step("difference_c", "error_phase", 2, "error_c"),
        Step("v_n", "forced_neutral", 1, "forced_neutral"),
        Step("flux_speed_beta", "omega_r", 0, "flux_speed2_beta"),
        Step("v_ph_b", "forced_voltage", 1, "forced_b"),
        Step("v_n", "weight", 1, "weight_start"),
        Step("is_beta", "weight_beta", 1, "weight_beta"),
    ),
)

#: Clocks from issuing a product until its rounded result can be an operand.
RESULT_LATENCY = 4
PROGRAM_LENGTH = max(len(block) for block in PROGRAM)


def result_width(name: str) -> int:
    """Width in bits of a result (saturating)."""
    if name == "weight_start" or name in PRODUCTS:
        return f.OPERAND_WIDTH
    if name.removesuffix("_alpha").removesuffix("_beta") in ("phase", "midpoint"):
        return f.CURRENT_TERM_WIDTH
    if name in ("weight_alpha", "weight_beta"):
        return f.WEIGHT_SLOPE_WIDTH
    if name.startswith("forced_"):
        return f.FORCED_WIDTH
    return f.TERM_WIDTH


def check_program() -> None:
    """Raise ValueError where a step reads a product before it exists or a sum is interrupted."""
    ready: dict[str, int] = {}
    for block in PROGRAM:
        for clock, step in enumerate(block):
            if step.result in PRODUCTS:
                ready[step.result] = clock + RESULT_LATENCY
    seen: set[str] = set()
    for block in PROGRAM:
        last = ""
        for clock, step in enumerate(block):
            if step.a not in SIGNALS and clock < ready[step.a]:
                raise ValueError(f"{step.a} is read at clock {clock}, ready at {ready[step.a]}")
            if step.b not in COEFFICIENTS and step.b not in SPEEDS:
                raise ValueError(f"unknown operand B {step.b}")
            if step.result in seen and step.result != last:
                raise ValueError(f"the sum {step.result} is interrupted at clock {clock}")
            seen.add(step.result)
            last = step.result
    missing = (set(TERMS) | set(PRODUCTS)) - seen
    if missing:
        raise ValueError(f"no step computes {sorted(missing)}")


check_program()
