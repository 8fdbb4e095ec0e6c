"""From a drive to register values: what a host computes and writes once per drive.

Nothing here depends on the state, the speeds or the dc-link voltage; those products are formed in
fabric every step.

The trajectory unit ``1/U`` is chosen per drive as fine as its coefficients and
bounds allow, see ``formats``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from directmpc.mpdcc import formats as f
from directmpc.mpdcc import tables
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.extrapolation import choose_extrapolation
from directmpc.mpdcc.parabola import FAR, fit_parabola
from directmpc.mpdcc.program import COEFFICIENTS
from directmpc.straight_line import least, operation

#: Right shift that a product of each alignment undergoes on its way to the result.
_COARSE = 2.0 ** (f.RESULT_SHIFT - f.ALIGNMENT[1])
_FINE = 2.0 ** (f.RESULT_SHIFT - f.ALIGNMENT[0])
_ERROR = 2.0 ** (f.RESULT_SHIFT - f.ALIGNMENT[2])

#: Scales (LSB per unit) of the products that are fed back as operands.
_REFERENCE_SPEED = f.CURRENT.scale * f.SPEED.scale / _COARSE
_FLUX_SPEED = f.FLUX.scale * f.SPEED.scale / _COARSE
_FLUX_SPEED2 = _FLUX_SPEED * f.SPEED.scale / _FINE
_REFERENCE_SPEED2 = _REFERENCE_SPEED * f.SPEED.scale / _FINE

_HIGH = 2 ** (f.COEFFICIENT_WIDTH - 1) - 1
_SQRT3_2 = math.sqrt(3.0) / 2.0

#: Parameters of the core besides the coefficients, in port order.
OPTIONS = (
    "bound_current", "bound_neutral", "bound_phase", "horizon", "weight_scale",
    "two_switchings", "budget", "compensate", "deadlock_rule", "outside_inwards",
)  # fmt: skip

#: What the model knows besides the ports: the first row of the converter in ``tables``. The core is
#: built with its tables.
BUILT = ("first_row",)

#: Place of every parameter in ``Registers.array()``.
INDEX: dict[str, int] = {
    name: place for place, name in enumerate((*COEFFICIENTS, *OPTIONS, *BUILT))
}

#: Coefficients of the slopes and curvatures of the current, all proportional to 1/D: an estimate of
#: the leakage scales them, see ``leakage``.
CURRENT_SLOPES: tuple[str, ...] = (
    "stator_alpha", "stator_beta", "rotor_alpha", "rotor_beta", "emf_alpha", "emf_beta",
    "forced_voltage", "forced_neutral", "curvature_emf_alpha", "curvature_emf_beta",
    "curvature_flux_alpha", "curvature_flux_beta", "error_forced",
)  # fmt: skip

ROOM = 2.0
"""What that estimate may make of such a coefficient; the trajectory unit of a drive leaves it."""


@dataclass(frozen=True)
class Registers:
    """Run-time parameters of ``mpdcc_core`` as integers."""

    # One signed 16-bit value per name of ``common_terms.COEFFICIENTS``.
    coefficients: dict[str, int]
    # bound_current, bound_neutral, bound_phase: Half widths in trajectory units, unsigned 16 bits.
    bound_current: int
    bound_neutral: int
    bound_phase: int
    horizon: int  # N in steps, 1..63
    weight_scale: int  # Index into ``formats.WEIGHT_FRACTIONS``
    two_switchings: int  # 1 for the switching horizon SESE, fast variant alone
    budget: int  # Candidates of the second level that may be looked at, 0 without limit
    compensate: int  # 1 to decide for k+1, fast variant alone
    deadlock_rule: int  # 1 for the weighted rule in deadlocks, fast variant alone
    # 1 for the rule "inwards" of what starts outside its bound, fast variant alone.
    outside_inwards: int
    unit: float  # U, trajectory units per unit; for reports only, no register
    extrapolation: int  # L in steps that the correction p was fitted for; for reports only
    correction: float  # p; for reports only
    converter: str = tables.DEFAULT  # Whose tables the core has

    def ports(self) -> dict[str, int]:
        """Every parameter port of the core: name -> integer, in port order.

        Coefficients are signed, with ``c_`` before their name; all others unsigned.
        """
        return {
            **{f"c_{name}": self.coefficients[name] for name in COEFFICIENTS},
            **{name: getattr(self, name) for name in OPTIONS},
        }

    def array(self) -> NDArray[np.int64]:
        """``ports`` and ``BUILT`` as an array, for compiled code. ``INDEX`` has the places."""
        built = tables.base_of(self.converter)
        return np.array([*self.ports().values(), built], dtype=np.int64)


def second_level(values: NDArray[np.int64]) -> bool:
    """Whether ``Registers.array()``, or a row of n of them, needs SECOND_LEVEL built in."""
    return _any(values, "two_switchings", "compensate")


def weighted_deadlock(values: NDArray[np.int64]) -> bool:
    """Whether ``Registers.array()``, or a row of n of them, needs WEIGHTED_DEADLOCK built in."""
    return _any(values, "deadlock_rule")


def inwards(values: NDArray[np.int64]) -> bool:
    """Whether ``Registers.array()``, or a row of n of them, needs INWARDS built in."""
    return _any(values, "outside_inwards")


def _any(values: NDArray[np.int64], *options: str) -> bool:
    """Whether one of the options is set in a row of register values."""
    return bool(np.atleast_2d(values)[:, [INDEX[option] for option in options]].any())


def _prediction(drive: Drive, variant: str) -> tuple[dict[str, float], int, float]:
    """Real coefficients of slopes and curvatures for U = 1; L and p for reports."""
    m, h = drive.machine.matrices, drive.ts_pu
    if variant == "fast":
        q = fit_parabola(drive.machine, h)
        real = {
            "stator_alpha": q.stator * _FINE / f.CURRENT.scale,
            "rotor_alpha": q.rotor * _FINE / f.FLUX.scale,
            "reference_alpha": -q.reference * _FINE / _REFERENCE_SPEED,
            "emf_alpha": -q.emf * _COARSE / _FLUX_SPEED,
            "correction_alpha": 0.0,
            "curvature_emf_alpha": -q.curvature_emf * _FINE / _FLUX_SPEED,
            "curvature_flux_alpha": -q.curvature_flux * _FINE / _FLUX_SPEED2,
            "curvature_reference_alpha": -q.curvature_reference * _FINE / _REFERENCE_SPEED2,
        }
        return real | {"forced": q.forced}, FAR, 0.0
    length, correction = choose_extrapolation(drive)
    real = {
        "stator_alpha": -h * m.a0[0, 0] * _FINE / f.CURRENT.scale,
        "rotor_alpha": -h * m.a0[0, 1] * _FINE / f.FLUX.scale,
        "reference_alpha": -h * _FINE / _REFERENCE_SPEED,
        "emf_alpha": h * m.a1[0, 1] * _COARSE / _FLUX_SPEED,
        "correction_alpha": -correction * length * h * h * _COARSE / _FLUX_SPEED2,
        "curvature_emf_alpha": 0.0,
        "curvature_flux_alpha": 0.0,
        "curvature_reference_alpha": 0.0,
    }
    return real | {"forced": h * float(m.b[0])}, length, correction


def _parts(drive: Drive) -> tuple[bool, bool]:
    """Whether the converter has a neutral point, and capacitors of the phases."""
    return bool(drive.converter.neutral.any()), bool(drive.converter.capacitor.any())


def _per_unit(drive: Drive, real: dict[str, float]) -> dict[str, float]:
    """Add what the prediction does not depend on, and the beta components."""
    h = drive.ts_pu
    result = dict(real)
    forced = result.pop("forced") / 3.0 * 2.0**f.FORCED_FRACTION
    has_neutral, has_capacitors = _parts(drive)
    # weights by the current's sign take it from this term
    phase = h / drive.inverter.xph * (has_capacitors or drive.converter.has_signed_weights)
    result |= {
        "error_alpha": _ERROR / f.CURRENT.scale,
        "error_neutral": -_ERROR / f.NEUTRAL_VOLTAGE.scale * has_neutral,
        "error_phase": _ERROR
        / (2.0 * f.CAPACITOR_VOLTAGE.scale)
        * (4.0 * drive.converter.capacitor_share),
        "forced_voltage": forced * _COARSE / f.CAPACITOR_VOLTAGE.scale,
        "forced_neutral": forced * _COARSE / f.NEUTRAL_VOLTAGE.scale,
        "phase_alpha": phase * _FINE / f.CURRENT.scale,
        "midpoint_alpha": has_neutral * h / (2.0 * drive.inverter.xdc) * _FINE / f.CURRENT.scale,
    }
    for name in [n.removesuffix("_alpha") for n in result if n.endswith("_alpha")]:
        # cross terms change sign between the components
        sign = -1.0 if name in ("reference", "emf", "curvature_emf") else 1.0
        result[f"{name}_beta"] = sign * _SQRT3_2 * result[f"{name}_alpha"]
    return result


def _weight(drive: Drive) -> tuple[int, dict[str, float]]:
    """Finest scale of sqrt(lambda_n)*v_n that fits, and its three coefficients."""
    lambda_n = drive.control.lambda_n if _parts(drive)[0] else 0.0
    root = (lambda_n * f.COST_UNIT / 2**f.RECIPROCAL_FRACTION) ** 0.5
    slope = -root * drive.ts_pu / (2.0 * drive.inverter.xdc)
    for scale in reversed(range(len(f.WEIGHT_FRACTIONS))):
        unit = 2.0 ** f.WEIGHT_FRACTIONS[scale]
        alpha = slope * unit * 2.0**f.WEIGHT_SLOPE_FRACTION * _COARSE / f.CURRENT.scale
        values = {
            "weight": root * unit * _COARSE / f.NEUTRAL_VOLTAGE.scale,
            "weight_alpha": alpha,
            "weight_beta": _SQRT3_2 * alpha,
        }
        if all(abs(v) <= _HIGH for v in values.values()):
            return scale, values
    raise ValueError(
        f"control.lambda_n = {drive.control.lambda_n} with inverter.xdc = {drive.inverter.xdc} "
        "does not fit the weight on v_n; a smaller lambda_n is needed"
    )


#: Error that each bound is compared with.
_ERRORS = ("error_alpha", "error_neutral", "error_phase")


def _rounded_bounds(bounds: Sequence[float], errors: Iterable[float], unit: float) -> list[int]:
    """Bounds as integers, each with the gain that rounding leaves the error it is compared with.

    `bounds` and `errors`, the coefficients of `_ERRORS`, are per 1/`unit`.
    """
    pairs = zip(bounds, (error * unit for error in errors), strict=True)
    gains = ((bound, round(error) / error if error else 1.0) for bound, error in pairs)
    return [round(bound * unit * gain) for bound, gain in gains]


@operation
def bounds_fit(unit: float, high: float, *bounds_and_errors: float) -> float:
    """A unit, a little coarser where a bound in the rounded gain of its error is above the word.

    Three bounds, then their errors' coefficients per 1/`unit`; `high` is the largest word.
    """
    while max(_rounded_bounds(bounds_and_errors[:3], bounds_and_errors[3:], unit)) > high:
        unit *= 1.0 - 2.0**-16
    return unit


def _curvature_unit(drive: Drive) -> float:
    """Finest unit in which a phase's curvature fits its word, at rated speed, flux and current.

    Control periods below about 100 us leave room; beyond, a finer unit would clip the curvature.
    """
    q = fit_parabola(drive.machine, drive.ts_pu)
    largest = abs(q.curvature_emf) + abs(q.curvature_flux) + abs(q.curvature_reference)
    return (2 ** (f.CURVATURE_WIDTH - 1) - 1) / largest


def _successor(
    drive: Drive, real: dict[str, float], weight: dict[str, float], unit: float, variant: str
) -> dict[str, float]:
    """Coefficients of the successor's program: ratios, so they do not scale with U.

    A change of the current is counted in 2**-CHANGE_FRACTION trajectory units.  ``change_weight``
    makes sqrt(lambda_n)*v_n of the error of v_n. It is clipped where lambda_n is at its largest and
    the unit coarse: it only bends the weight on v_n at the second level.
    """
    if variant != "fast":
        return dict.fromkeys(
            ("change_phase", "change_midpoint", "change_weight", "error_forced"), 0
        )
    change = 2.0**-f.CHANGE_FRACTION
    h, (has_neutral, has_capacitors) = drive.ts_pu, _parts(drive)
    turned = -weight["weight"] * f.NEUTRAL_VOLTAGE.scale / unit
    return {
        "change_phase": has_capacitors * h / drive.inverter.xph * change * _COARSE,
        "change_midpoint": has_neutral * h / (2.0 * drive.inverter.xdc) * change * _COARSE,
        "change_weight": max(-_HIGH, min(_HIGH, turned)),
        "error_forced": -real["forced_voltage"] * f.CAPACITOR_VOLTAGE.scale,
    }


@dataclass(frozen=True)
class Unrounded:
    """Register values before they are rounded; names as in ``Registers``."""

    coefficients: dict[str, float]  # One value per name of ``common_terms.COEFFICIENTS``
    bounds: tuple[float, float, float]  # Half widths of currents, v_n and v_ph, trajectory units
    # weight_scale, unit, extrapolation, correction: As in ``Registers``.
    weight_scale: int
    unit: float
    extrapolation: int
    correction: float


def unrounded(drive: Drive, variant: str, room: float = 1.0) -> Unrounded:
    """Register values in full precision, LSB and trajectory units (Paper A, eqs. 2, 9 and 14).

    `room` is what ``CURRENT_SLOPES`` may grow by at run time, ``ROOM`` at least with an estimate of
    the leakage. ValueError names the drive file's key that cannot be represented.
    """
    prediction, length, correction = _prediction(drive, variant)
    real = _per_unit(drive, prediction)
    there = (True, *_parts(drive))
    given = (drive.control.bound_current, drive.control.bound_vn, drive.control.bound_vph)
    bounds = tuple(bound if has else 0.0 for bound, has in zip(given, there, strict=True))
    high = float(f.BOUND_HIGH[variant])
    unit = least(
        *(
            f.COEFFICIENT_SHARE * _HIGH / abs(value * (room if name in CURRENT_SLOPES else 1.0))
            for name, value in real.items()
            if value != 0.0
        ),
        *(high / bound for bound, has in zip(bounds, there, strict=True) if has),
        _curvature_unit(drive) if variant == "fast" else math.inf,
    )
    unit = bounds_fit(unit, high, *bounds, *(real[name] for name in _ERRORS))
    scale, weight = _weight(drive)
    return Unrounded(
        coefficients={name: value * unit for name, value in real.items()}
        | weight
        | _successor(drive, real, weight, unit, variant),
        # what a converter does not have is inside of the widest bound, and never the worst
        bounds=tuple(b * unit if has else high for b, has in zip(bounds, there, strict=True)),
        weight_scale=scale,
        unit=unit,
        extrapolation=length,
        correction=correction,
    )


def refuse_unserved(drive: Drive, variant: str) -> None:
    """ValueError with the key that explorers of "paper" or "fast" do not serve."""
    if variant == "fast":
        return
    # without this error the core would decide without these settings, and no output would tell;
    # a budget limits SESE alone and has no effect without it in any variant
    control = drive.control
    for key, asked, given, served in (
        ("switching_horizon", control.switching_horizon != "SE", '"SESE"', '"SE"'),
        ("delay_compensation", control.delay_compensation, "true", "false"),
        ("deadlock_rule", control.deadlock_rule != "largest", '"weighted"', '"largest"'),
        ("outside_rule", control.outside_rule != "dead", '"inwards"', '"dead"'),
        ("leakage_estimate", control.leakage_estimate, "true", "false"),
    ):
        if asked:
            raise ValueError(
                f"control.{key}: got {given}; the variant {variant} serves {served} alone"
            )


def registers(drive: Drive, variant: str, room: float = 1.0) -> Registers:
    """Register values of a drive, as `unrounded`; ValueError names the key that does not fit."""
    refuse_unserved(drive, variant)
    if drive.control.leakage_estimate:
        room = max(room, ROOM)
    exact = unrounded(drive, variant, room)
    coefficients = {name: round(exact.coefficients[name]) for name in COEFFICIENTS}
    errors = [exact.coefficients[name] for name in _ERRORS]
    bounds = _rounded_bounds(exact.bounds, errors, 1.0)
    return Registers(
        coefficients=coefficients,
        bound_current=bounds[0],
        bound_neutral=bounds[1],
        bound_phase=bounds[2],
        horizon=drive.control.horizon,
        weight_scale=exact.weight_scale,
        two_switchings=int(drive.control.switching_horizon == "SESE"),
        budget=drive.control.budget if variant == "fast" else 0,
        compensate=int(drive.control.delay_compensation),
        deadlock_rule=int(drive.control.deadlock_rule == "weighted"),
        outside_inwards=int(drive.control.outside_rule == "inwards"),
        unit=exact.unit,
        extrapolation=exact.extrapolation,
        correction=exact.correction,
        converter=drive.inverter.topology,
    )


def format_csv(values: Registers) -> str:
    """Registers as CSV: port, value, and the word to write in hexadecimal."""
    lines = ["port,value,hex"]
    for port, value in values.ports().items():
        digits = 4 if port.startswith(("c_", "bound")) else 3 if port == "budget" else 2
        lines.append(f"{port},{value},{value & (16**digits - 1):0{digits}x}")
    return "\n".join(lines)


def format_table(values: Registers) -> str:
    """Registers as text, then the trajectory unit and the extrapolation."""
    rows = [line.split(",") for line in format_csv(values).splitlines()]
    lines = [f"{port:20} {value:>8} {word:>6}" for port, value, word in rows]
    lines += [
        "",
        f"trajectory unit: 1/{values.unit:.6g} pu; extrapolation over L = {values.extrapolation} "
        f"steps with p = {values.correction:.5f}",
    ]
    return "\n".join(lines)
