"""The fast variant in float64, with every rounding and every approximation on a switch of its own.

All roundings and approximations on, it decides as ``bit_true_fast`` does; all off, as ``ideal`` (a
test asserts both).  In between it tells what each of them costs.

A *grain* is the spacing of the numbers a signal can take, in LSB of the word as built: 0 for an
exact signal, 1 as built, 4 for a word two bits shorter.  A *trajectory* says how far the prediction
of the current errors is simplified::

    EXACT    matrix exponential at every step, as the ideal controller
    OWN      for each candidate a parabola through its exact values at NEAR and FAR steps
    COMMON   the candidate's exact slope, but one curvature for all candidates
    FITTED   slopes and curvature from polynomials in the speed: as built
    CHORD    a straight line through the exact value one step ahead, for comparison
    EULER    Paper A's straight line: an Euler step with its correction p, for comparison

and the first exit from the band is found in one of three ways::

    EVERY_STEP  by looking at every step
    THRESHOLD   by ``turn_threshold`` and one monotone binary search: as built
    PLAIN       by a binary search that takes the parabola for monotone

What a coarser trajectory gets wrong is computed in float64 and taken off the rounded one, so that
roundings stay as they are while approximations are switched.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc.compiled import njit
from directmpc.loads.load import discretise
from directmpc.mpdcc import coefficients as co
from directmpc.mpdcc import formats, ideal, inverter
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.extrapolation import choose_extrapolation
from directmpc.mpdcc.parabola import FAR, NEAR, fit_parabola
from directmpc.mpdcc.program import COEFFICIENTS, PRODUCTS, TERMS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

EXACT, OWN, COMMON, FITTED, CHORD, EULER = range(6)
EVERY_STEP, THRESHOLD, PLAIN = range(3)

_SCALES = np.array([fmt.scale for fmt in formats.MEASUREMENTS.values()])
_RESULTS = PRODUCTS + TERMS
_N_SIGNALS = common.N_SIGNALS
_N_PRODUCTS = len(PRODUCTS)
_N_COEFFICIENTS = len(COEFFICIENTS)
_PROGRAM = common.FAST_PROGRAM
_SHIFT = 2.0**formats.RESULT_SHIFT
_FORCED = 2.0**formats.FORCED_FRACTION
_WEIGHT = 2.0**formats.WEIGHT_SLOPE_FRACTION
_UNITY = float(formats.COST_UNIT)
_RECIPROCALS = formats.RECIPROCALS
_COST_SHIFTS = 2.0 ** np.array(formats.WEIGHT_SHIFTS)
_CURVATURE_HIGH = 2.0 ** (formats.CURVATURE_WIDTH - 1) - 1
_TURN = 2.0**formats.TURN_SHIFT
_REACH = 2.0**formats.MARGIN_WIDTH
_BITS = formats.LENGTH_WIDTH
_COUNT, _NEXT, _TRANSITION = inverter.NEXT_COUNT, inverter.NEXT_TABLE, inverter.TRANSITION_WEIGHT
_HALF_DC, _NEUTRAL, _CAPACITOR = inverter.HALF_DC, inverter.NEUTRAL, inverter.CAPACITOR
_FROM_NEUTRAL, _FROM_CAPACITOR = inverter.NEUTRAL_CURRENT, inverter.CAPACITOR_CURRENT


class Replica(NamedTuple):
    """What `decide` needs, as numbers and arrays."""

    exact: ideal.IdealParameters  #: The drive.
    #: (13,): grains of the measurements, in the order of ``formats.MEASUREMENTS``.
    measurement: FloatArray
    coefficients: FloatArray  #: (29,): register values, rounded or not.
    result: FloatArray  #: (30,): grains of products and terms.
    #: Grains of a component halved on its way to the phases, of the sum of the voltage terms, and
    #: of the parts of the cost (LSB of each).
    half: float
    forced: float
    cost: float
    bounds: FloatArray  #: (7,): half widths, trajectory units.
    scale: int  #: Index into ``formats.WEIGHT_FRACTIONS``.
    unit: float  #: Trajectory units per unit.
    trajectory: int  #: EXACT to EULER.
    first_exit: int  #: EVERY_STEP, THRESHOLD or PLAIN.
    fit: FloatArray  #: (8,): slopes and curvatures of ``second_order.Parabola``, in its order.
    #: (5,): slopes of Paper A's prediction: factors of i_s, psi_r, j*omega_r*psi_r,
    #: -omega_r^2*psi_r and minus the stator voltage.
    euler: FloatArray


#: Switches of `replica` that are grains, and the signals each acts on.
MEASURED: dict[str, tuple[str, ...]] = {
    "currents": ("is_alpha", "is_beta"),
    "references": ("iref_alpha", "iref_beta"),
    "flux": ("psir_alpha", "psir_beta"),
    "speeds": ("omega_s", "omega_r"),
    "v_n": ("v_n",),
    "v_ph": ("v_ph_a", "v_ph_b", "v_ph_c"),
    "v_dc": ("v_dc",),
}
COMPUTED: dict[str, tuple[str, ...]] = {
    "products": PRODUCTS,
    "errors": tuple(n for n in TERMS if n.startswith("error_")),
    "slopes": ("slope_alpha", "slope_beta"),
    "curvature": ("curvature_alpha", "curvature_beta"),
    "voltage_terms": tuple(n for n in TERMS if n.startswith("forced_")),
    "current_terms": ("phase_alpha", "phase_beta", "midpoint_alpha", "midpoint_beta"),
    "weight_terms": ("weight_start", "weight_alpha", "weight_beta"),
}
OTHER = ("halves", "voltage_sum", "cost", "coefficients", "bounds")
GRAINS: tuple[str, ...] = (*MEASURED, *COMPUTED, *OTHER)


def replica(
    drive: Drive,
    grains: Mapping[str, float] | float = 1.0,
    trajectory: int = FITTED,
    first_exit: int = THRESHOLD,
) -> Replica:
    """Set up the replica of a drive's controller."""
    if not isinstance(grains, Mapping):
        grains = dict.fromkeys(GRAINS, float(grains))
    unknown = set(grains) - set(GRAINS)
    if unknown:
        raise ValueError(f"no such rounding: {', '.join(sorted(unknown))}")
    grain = {name: float(grains.get(name, 0.0)) for name in GRAINS}

    def _spread(groups: Mapping[str, tuple[str, ...]], names: tuple[str, ...]) -> FloatArray:
        values = {n: grain[group] for group, members in groups.items() for n in members}
        return np.array([values[n] for n in names])

    full = co.unrounded(drive, "fast")
    exact = np.array([full.coefficients[n] for n in COEFFICIENTS])
    coefficients = _round(exact, grain["coefficients"])
    q = fit_parabola(drive.machine, drive.ts_pu)
    i, n, v = full.bounds
    # as built, a bound takes the rounded gain of its error
    errors = [
        COEFFICIENTS.index(f"error_{name}")
        for name in ("alpha", "alpha", "alpha", "neutral", "phase", "phase", "phase")
    ]
    bounds = np.array([i, i, i, n, v, v, v]) * coefficients[errors] / exact[errors]
    return Replica(
        exact=ideal.ideal_parameters(drive),
        measurement=_spread(MEASURED, tuple(formats.MEASUREMENTS)),
        coefficients=coefficients,
        result=_spread(COMPUTED, _RESULTS),
        half=grain["halves"],
        forced=grain["voltage_sum"],
        cost=grain["cost"],
        bounds=_round(bounds, grain["bounds"]),
        scale=full.weight_scale,
        unit=full.unit,
        trajectory=trajectory,
        first_exit=first_exit,
        fit=np.array(
            [
                q.stator, q.rotor, q.emf, q.reference, q.forced,
                q.curvature_emf, q.curvature_flux, q.curvature_reference,
            ]
        ),
        euler=_euler(drive),
    )  # fmt: skip


def _euler(drive: Drive) -> FloatArray:
    """Slopes of Paper A's prediction (14), per step."""
    m, h = drive.machine.matrices, drive.ts_pu
    length, p = choose_extrapolation(drive)
    return np.array(
        [
            -h * m.a0[0, 0], -h * m.a0[0, 1], -h * m.a1[0, 1], p * length * h * h, h * m.b[0],
        ]
    )  # fmt: skip


def _round(values: FloatArray, grain: float) -> FloatArray:
    """To multiples of a grain, as Python's round does."""
    return grain * np.rint(values / grain) if grain else values


@njit
def _near(value, grain):
    """To the nearest multiple of a grain, halves upwards."""
    return grain * np.floor(value / grain + 0.5) if grain > 0.0 else value


@njit
def _below(value, grain):
    """To the next multiple of a grain below."""
    return grain * np.floor(value / grain) if grain > 0.0 else value


@njit
def _terms(p, measured):
    """The program of ``common_terms``; measured (13,) in LSB; returns TERMS."""
    operand = np.zeros(_N_SIGNALS + _N_PRODUCTS)
    operand[0:11] = measured[0:11]
    operand[11] = measured[9] - measured[0]
    operand[12] = measured[10] - measured[1]
    for x in range(3):
        operand[13 + x] = measured[8] - 2 * measured[5 + x]
    total = np.zeros(len(p.result))
    results = np.zeros(len(p.result))
    for row in range(_PROGRAM.shape[0]):
        a, b, shift, result, last = _PROGRAM[row]
        factor = p.coefficients[b] if b < _N_COEFFICIENTS else measured[11 + b - _N_COEFFICIENTS]
        total[result] += operand[a] * factor * 2.0**shift
        if last:
            results[result] = _near(total[result] / _SHIFT, p.result[result])
            if result < _N_PRODUCTS:
                operand[_N_SIGNALS + result] = results[result]
    return results[_N_PRODUCTS:]


@njit
def _phases(alpha, beta, grain, out):
    """Inverse Clarke transformation into out[0:3]; beta already carries sqrt(3)/2."""
    half = _below(0.5 * alpha, grain)
    out[0], out[1], out[2] = alpha, beta - half, -half - beta


@njit
def _threshold(error, curvature, bound, grain):
    """``bit_true_fast.turn_threshold``."""
    room = bound + error if curvature >= 0 else bound - error
    steep = abs(curvature)
    threshold = np.inf
    for k in range(1, _BITS + 1):
        threshold = min(threshold, _below(room / 2.0**k, grain) + steep * 2.0**k)
    return threshold


@njit
def _first_exit(error, slope, curvature, bound, threshold):
    """``bit_true_fast.first_exit``."""
    upwards = curvature >= 0
    exceeds = slope < -threshold if upwards else slope > threshold
    side_up = upwards != exceeds
    value = error
    length = 0
    beta = slope
    for m in range(_BITS - 1, -1, -1):
        reach = 2.0**m
        secant = beta + curvature * reach
        step = secant * reach
        trial = value + step
        inside = trial <= bound if side_up else trial >= -bound
        tail = np.floor(secant / _TURN) + np.floor(curvature * reach / _TURN)
        turned = tail >= 0 if upwards else tail < 0
        if -_REACH <= step < _REACH and inside and not (exceeds and turned and m > 0):
            value = trial
            beta = secant + curvature * reach
            length += 1 << m
    return length


@njit
def _scan(error, slope, curvature, bound, horizon):
    """Last step of 0..horizon before the parabola's first exit, by looking at every step."""
    for step in range(1, horizon + 1):
        if abs(error + slope * step + curvature * step * step) > bound:
            return step - 1
    return horizon


@njit
def _plain(error, slope, curvature, bound):
    """Binary search of the length that ignores that a parabola may come back."""
    length = 0
    for m in range(_BITS - 1, -1, -1):
        step = length + (1 << m)
        if abs(error + slope * step + curvature * step * step) <= bound:
            length = step
    return length


@njit
def _straight(error, slope, bound, horizon):
    """Last step of 0..horizon that a straight line is inside."""
    step = abs(slope)
    room = bound - error if slope >= 0 else bound + error
    if step * horizon <= room:
        return horizon
    return int(np.floor(room / step))


@njit
def _split(near, far):
    """Slope and curvature of the parabola through 0, (NEAR, near), (FAR, far)."""
    c = (far / FAR - near / NEAR) / (FAR - NEAR)
    return near / NEAR - c * NEAR, c


@njit
def _share(s, weights, grain):
    """``bit_true_fast.share_of``: two shares are the complement of the third."""
    hanging = _FROM_NEUTRAL[s[0]] + _FROM_NEUTRAL[s[1]] + _FROM_NEUTRAL[s[2]]
    total = 0.0
    for x in range(3):
        if hanging == 1 and _FROM_NEUTRAL[s[x]] == 1:
            total = weights[x]
        elif hanging == 2 and _FROM_NEUTRAL[s[x]] == 0:
            total = -weights[x] - grain
    return total


@njit
def _slopes(p, s, natural, forced, phase, midpoint, out):
    """``common.slopes``."""
    u = np.empty(3)
    out[3] = _share(s, midpoint, p.half)
    for x in range(3):
        u[x] = (
            _HALF_DC[s[x]] * forced[0]
            + _NEUTRAL[s[x]] * forced[1]
            + _CAPACITOR[s[x]] * forced[2 + x]
        )
        out[4 + x] = -_FROM_CAPACITOR[s[x]] * phase[x]
    for x in range(3):
        difference = 2 * u[x] - u[(x + 1) % 3] - u[(x + 2) % 3]
        out[x] = natural[x] - _near(difference / _FORCED, p.forced)


@njit
def decide(p, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """Decide as the fast variant would with these roundings, horizon SE (Paper A, Algorithm 1)."""
    horizon = p.exact.horizon
    measured = np.empty(13)
    measured[0:4] = x_m
    measured[4:8] = x_inv
    measured[8] = vdc
    measured[9:11] = iref
    measured[11], measured[12] = omega_s, omega_r
    for k in range(13):
        measured[k] = _near(measured[k] * _SCALES[k], p.measurement[k])
    t = _terms(p, measured)
    error, slope, curvature = np.empty(7), np.empty(7), np.empty(3)
    natural, phase, midpoint, weights = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    _phases(t[0], t[1], p.half, error)
    error[3:7] = t[2:6]
    _phases(t[6], t[7], p.half, natural)
    forced = t[8:13]
    _phases(t[13], t[14], p.half, phase)
    _phases(t[15], t[16], p.half, midpoint)
    _phases(t[18], t[19], p.half, weights)
    _phases(t[20], t[21], p.half, curvature)
    # as built, what belongs to the current of phase c is its opposite, the sum of a's and b's
    error[2], curvature[2] = error[0] + error[1], curvature[0] + curvature[1]
    for x in range(3):
        curvature[x] = min(max(curvature[x], -_CURVATURE_HIGH - 1), _CURVATURE_HIGH)

    # what the trajectory as built gets wrong, float64 throughout
    current, flux = complex(x_m[0], x_m[1]), complex(x_m[2], x_m[3])
    reference = complex(iref[0], iref[1])
    i_a, i_b, i_c = ideal.phases(current)
    jw_s, jw_r = 1j * omega_s, 1j * omega_r
    q = p.fit
    slope_fit = q[0] * current + (q[1] + q[2] * jw_r) * flux + q[3] * jw_s * reference
    curvature_fit = (q[5] * jw_r + q[6] * jw_r**2) * flux + q[7] * jw_s**2 * reference
    natural_exact = forced_exact = np.zeros(1, np.complex128)
    near, far, near_forced = 0j, 0j, 0j
    forced_slope, forced_curvature, common = 0j, 0j, 0j
    if p.trajectory != FITTED:
        e = p.exact
        one = discretise(e.load, omega_r, NEAR * e.ts)
        many = discretise(e.load, omega_r, FAR * e.ts)
        near = reference * (np.exp(jw_s * NEAR * e.ts) - 1.0) + current
        near -= one[0] * current + one[1] * flux
        far = reference * (np.exp(jw_s * FAR * e.ts) - 1.0) + current
        far -= many[0] * current + many[1] * flux
        near_forced = one[4]
        forced_slope, forced_curvature = _split(one[4], many[4])
        flux_slope, _ = _split(-one[1] * flux, -many[1] * flux)
        common = -forced_curvature * (flux_slope / forced_slope)

    first = np.empty(7)
    s = np.empty(3, dtype=np.int64)
    s[:] = s_prev
    feasible = False
    best_cost, best_excess = np.inf, np.inf
    best_length = 0
    best = np.empty(3, dtype=np.int64)
    none_yet = True
    sloped, curved, more = np.empty(3), np.empty(3), np.zeros(3)
    voltage = 0j
    for index in range(-1, _COUNT[s_prev[0]] * _COUNT[s_prev[1]] * _COUNT[s_prev[2]]):
        if index >= 0:  # before that, the hold test
            s[2] = _NEXT[s_prev[2], index % _COUNT[s_prev[2]]]
            rest = index // _COUNT[s_prev[2]]
            s[1] = _NEXT[s_prev[1], rest % _COUNT[s_prev[1]]]
            s[0] = _NEXT[s_prev[0], rest // _COUNT[s_prev[1]]]
        _slopes(p, s, natural, forced, phase, midpoint, slope)
        slope[2] = slope[0] + slope[1]
        first[:] = error + slope
        for x in range(3):
            sloped[x], curved[x] = slope[x], curvature[x]
        if p.trajectory != FITTED:
            voltage, _, _, _, _ = ideal.inputs(
                p.exact, vdc, x_inv[0], x_inv[1], x_inv[2], x_inv[3], i_a, i_b, i_c,
                s[0], s[1], s[2],
            )  # fmt: skip
            if p.trajectory == EXACT:
                residual = near - near_forced * voltage
                residual -= slope_fit - q[4] * voltage + curvature_fit
                more[0], more[1], _ = ideal.phases(p.unit * residual)
                more[2] = more[0] + more[1]
            else:
                b, c = _split(near, far)
                b = b - forced_slope * voltage
                if p.trajectory == OWN:
                    c = c - forced_curvature * voltage
                elif p.trajectory == COMMON:
                    c = c + common
                elif p.trajectory == CHORD:
                    b, c = near - near_forced * voltage, 0j
                else:
                    g = p.euler
                    b = g[0] * current + (g[1] + g[2] * jw_r + g[3] * jw_r**2) * flux
                    b, c = b + jw_s * p.exact.ts * reference - g[4] * voltage, 0j
                db = ideal.phases(p.unit * (b - (slope_fit - q[4] * voltage)))
                dc = ideal.phases(p.unit * (c - curvature_fit))
                for x in range(2):
                    sloped[x] += db[x]
                    curved[x] += dc[x]
                sloped[2] += db[0] + db[1]
                curved[2] += dc[0] + dc[1]
        for x in range(2):
            first[x] = error[x] + sloped[x] + curved[x] + more[x]
        first[2] = first[0] + first[1]
        excess = -np.inf
        for j in range(7):
            excess = max(excess, abs(first[j]) - p.bounds[j])
        if index < 0:
            if excess <= 0.0:
                return s_prev[0], s_prev[1], s_prev[2], 1, 0, 0, 0
            if p.trajectory == EXACT:
                _, _, _, _, natural_exact, forced_exact, _, turned = ideal.prepare(
                    p.exact, x_m, iref, omega_s, omega_r, horizon
                )
                for step in range(horizon + 1):
                    natural_exact[step] = turned[step] - reference - natural_exact[step] + current
            continue
        length = horizon
        for j in range(7):
            if abs(first[j]) > p.bounds[j] or abs(error[j]) > p.bounds[j]:
                length = 0
        for j in range(3, 7):
            if length > 0:
                length = min(length, _straight(error[j], slope[j], p.bounds[j], horizon))
        if p.trajectory == EXACT:
            for step in range(1, length + 1):
                residual = natural_exact[step] - forced_exact[step] * voltage
                residual -= (slope_fit - q[4] * voltage) * step + curvature_fit * step**2
                more[0], more[1], _ = ideal.phases(p.unit * residual)
                more[2] = more[0] + more[1]
                outside = False
                for x in range(3):
                    value = error[x] + sloped[x] * step + curved[x] * step**2 + more[x]
                    outside |= abs(value) > p.bounds[x]
                if outside:
                    length = step - 1
                    break
        for x in range(3):
            if length == 0 or p.trajectory == EXACT:
                break
            if p.first_exit == EVERY_STEP:
                length = _scan(error[x], sloped[x], curved[x], p.bounds[x], length)
            elif p.first_exit == PLAIN:
                length = min(length, _plain(error[x], sloped[x], curved[x], p.bounds[x]))
            else:
                threshold = _threshold(error[x], curved[x], p.bounds[x], p.half)
                length = min(
                    length, _first_exit(error[x], sloped[x], curved[x], p.bounds[x], threshold)
                )
        if length > 0:
            effort = 0.0
            for x in range(3):
                effort += _TRANSITION[1 if phase[x] < 0 else 0, s_prev[x], s[x]]
            drift = _share(s, weights, p.half)
            w = t[17] + _below(length * drift / _WEIGHT, p.cost)
            cost = effort * (_RECIPROCALS[length] if p.cost > 0.0 else _UNITY / length)
            cost += _below(w * w / _COST_SHIFTS[p.scale], p.cost)
            if not feasible or cost < best_cost:
                feasible, best_cost, best_length = True, cost, length
                best[:] = s
        elif not feasible and (none_yet or excess < best_excess):
            best_excess = excess
            best[:] = s
        none_yet = False
    return best[0], best[1], best[2], 0, 0 if feasible else 1, best_length, 0


@njit
def _run(p, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev, out):
    """``decide`` for every row; out (n, 7)."""
    for k in range(len(vdc)):
        d = decide(p, x_m[k], x_inv[k], vdc[k], iref[k], omega_s[k], omega_r[k], s_prev[k])
        for column in range(7):
            out[k, column] = d[column]


def run(parameters: Replica, trace: Any) -> IntArray:
    """Decisions on every row of a trace: (n, 7), as ``decide`` returns them."""
    out = np.empty((len(trace), 7), np.int64)
    _run(
        parameters, trace.x_m, trace.x_inv, trace.vdc, trace.iref, trace.omega_s, trace.omega_r,
        trace.s_prev.astype(np.int64), out,
    )  # fmt: skip
    return out
