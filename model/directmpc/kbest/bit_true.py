"""The bit-true model of the K-best core: word for word what the gates compute.

docs/specification.md, section 10.7, has the equations in words. The model is written from the
formats; it never reads the RTL. All numbers are int64, whose range no intermediate result comes
near.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc import fixed_point
from directmpc.compiled import njit
from directmpc.fixed_point import rounded, saturate
from directmpc.kbest import formats as f
from directmpc.kbest.coefficients import Registers, registers
from directmpc.kbest.drive import KbestDrive
from directmpc.kbest.ideal import KEEP, NEIGHBOURS, SAME_POSITION, converter_of
from directmpc.mpdcc import tables
from directmpc.mpdcc.trace import Decisions, MpdccTrace

IntArray = NDArray[np.int64]

_SCALES, _LOWS, _HIGHS = fixed_point.limits(list(f.MEASUREMENTS.values()))
_INDEX = {name: n for n, name in enumerate(f.COEFFICIENTS + f.SETTINGS)}
_ANGLE, _DECAY_1, _DECAY_2, _FLUX_0, _FLUX_2, _FLUX_U, _FLUX_W = range(7)
_FORCED_1, _FORCED_2, _LEVEL_1, _LEVEL_2, _NEUTRAL, _CAPACITOR = range(7, 13)
_EFFORT, _BOUND_NEUTRAL, _BOUND_PHASE, _WEIGHT_NEUTRAL, _WEIGHT_PHASE = range(13, 18)
_SHORT, _COMPENSATE, _BEAM, _STAGES = range(18, 22)

INVERSE_ROOT = round(2**f.FRACTION / 3.0**0.5)
"""1/sqrt(3)."""
THIRD = round(2**f.FRACTION / 3.0)
"""1/3."""
SIXTH = round(2**f.FRACTION / 6.0)
"""1/6."""
EIGHTH = 2**f.FRACTION // 8
"""1/8; the charges take whole multiples of it."""

_TERMS_CLOCKS = 51  # terms of a stage are there so long behind those of the stage before

COST_MOST = 2**f.COST_WIDTH - 1


class Tables(NamedTuple):
    """The converter in whole numbers, for compiled code."""

    level: IntArray  # (p,): Output level, quarters of v_dc
    # neutral, capacitor: (p,): Coefficients of v_n and v_ph in the phase voltage.
    neutral: IntArray
    capacitor: IntArray
    # neutral_current, capacitor_current: (p,): n(s) and c(s).
    neutral_current: IntArray
    capacitor_current: IntArray
    count: IntArray  # (p,): Number of neighbours
    neighbours: IntArray  # (p, 3): Neighbours, ascending
    weight: IntArray  # (2, p, p): Turn-ons: [phase current negative][from][to]


def _tables() -> Tables:
    table = converter_of(tables.leg_of(tables.DEFAULT), 1.0, 1.0)
    whole = [
        # v_ph counts as its reference of a quarter of v_dc here
        4.0 * (table.dc + table.capacitor * table.capacitor_share),
        *(table.neutral, table.capacitor, table.neutral_current, table.capacitor_current),
        *(table.count, table.neighbours, table.weight),
    ]
    return Tables(*(np.rint(values).astype(np.int64) for values in whole))


TABLES = _tables()


class Parameters(NamedTuple):
    """All that `decide` knows of a drive."""

    registers: IntArray  # (n,): `Registers.array()`
    tables: Tables  # Of the converter
    # (H + 1,): The plan: a code of each stage, and 1 where the coming period is an odd one.
    plan: IntArray


def parameters_of(drive: KbestDrive) -> Parameters:
    """Parameters of the model; every stage keeps its positions, the period is an even one.

    ValueError names the drive file's key whose word cannot hold its value.
    """
    found = registers(drive)
    return Parameters(found.array(), TABLES, np.full(found.stages + 1, KEEP, dtype=np.int64))


@njit
def summed(total):
    """Round a sum with `FRACTION` bits below the LSB to a word; and 1 where it saturated."""
    return rounded(total, f.FRACTION, f.FACTOR_WIDTH)


@njit
def turned(vector, turn):
    """Turn a vector (u, w) in place by (1 - cos, sqrt(3) sin, sin / sqrt(3)); 1 if it saturated."""
    u, w = vector[0], vector[1]
    vector[0], clip_u = summed((u << f.FRACTION) - turn[0] * u - turn[1] * w)
    vector[1], clip_w = summed((w << f.FRACTION) - turn[0] * w + turn[2] * u)
    return clip_u | clip_w


@njit
def start_terms(r, words, reference, drift, turn, level):
    """What all stages begin with: reference, drift, angle and levels; 1 where a word saturated.

    Filled: i*(k) and (exp(j omega_s T_s) - a11) i*(k) - a12 psi(k) as u and w; 1 - cos, sqrt(3) sin
    and sin / sqrt(3) of the angle of a step; change of the error by v_dc/4 in a stage of one and of
    two steps.
    """
    omega_s, omega_r = words[11] << f.SPEED_SHIFT, words[12] << f.SPEED_SHIFT
    # sin x = x and 1 - cos x = x^2/2
    turn[1], saturated = summed(omega_s * r[_ANGLE])
    turn[2], _ = summed(turn[1] * THIRD)
    half, _ = summed(turn[1] * SIXTH)
    turn[0], _ = summed(turn[1] * half)
    reference[0] = words[9] << f.VECTOR_SHIFT
    reference[1], _ = summed((words[10] << f.VECTOR_SHIFT) * INVERSE_ROOT)
    flux_u = words[2] << f.FLUX_SHIFT
    flux_w, _ = summed((words[3] << f.FLUX_SHIFT) * INVERSE_ROOT)
    square, clip0 = summed(omega_r * omega_r)
    straight, clip = summed((r[_FLUX_0] << f.FRACTION) + square * r[_FLUX_2])
    across_u, clip2 = summed(omega_r * r[_FLUX_U])
    across_w, clip3 = summed(omega_r * r[_FLUX_W])
    saturated |= clip0 | clip | clip2 | clip3
    i_u, i_w = reference[0], reference[1]
    total = (r[_DECAY_1] - turn[0]) * i_u - turn[1] * i_w
    drift[0], clip = summed(total + across_u * flux_w - straight * flux_u)
    total = (r[_DECAY_1] - turn[0]) * i_w + turn[2] * i_u
    drift[1], clip2 = summed(total - across_w * flux_u - straight * flux_w)
    saturated |= clip | clip2
    level[0], clip = summed(words[8] * r[_LEVEL_1])
    level[1], clip2 = summed(words[8] * r[_LEVEL_2])
    return saturated | clip | clip2


@njit
def stage_terms(r, steps, reference, drift, turn, drift_out, neutral, phase):
    """Drift (u, w) and charges of a stage of 1 or 2 steps; 1 where a word saturated.

    Reference and drift of a step go on to its end. Charges: what each phase takes from v_n and adds
    to v_ph.
    """
    u, w = reference[0], reference[1]
    drift_out[0], drift_out[1] = drift[0], drift[1]
    saturated = turned(reference, turn)
    saturated |= turned(drift, turn)
    # twice the reference in the middle of the stage: a mean over a step, the step's end over two
    if steps == 1:
        u, w = u + reference[0], w + reference[1]
    else:
        u, w = 2 * reference[0], 2 * reference[1]
        # the second step's drift, and the first one's with its decay
        for n in range(2):
            total = ((drift_out[n] + drift[n]) << f.FRACTION) - r[_DECAY_1] * drift_out[n]
            drift_out[n], clip = summed(total)
            saturated |= clip
        saturated |= turned(reference, turn)
        saturated |= turned(drift, turn)
    half_a, _ = summed(2 * EIGHTH * u)
    half_b, clip = summed(EIGHTH * (3 * w - u))
    saturated |= clip
    for n in range(3):
        current = half_a if n == 0 else half_b if n == 1 else -half_a - half_b
        by_neutral, clip = summed(current * r[_NEUTRAL])
        by_phase, clip2 = summed(current * r[_CAPACITOR])
        neutral[n], clip3 = saturate(by_neutral << (steps - 1), f.VOLTAGE_WIDTH)
        phase[n], clip4 = saturate(by_phase << (steps - 1), f.VOLTAGE_WIDTH)
        saturated |= clip | clip2 | clip3 | clip4
    return saturated


@njit
def _ahead(now, before, shift, low):
    """Square of where a straight line leads in 2^shift stages, less `low` bits, in a word."""
    word, _ = saturate((now + ((now - before) << shift)) >> low, f.AHEAD_WIDTH)
    return word * word


@njit
def voltage_terms(steps, bound, weight, now, before, low):
    """Cost of a voltage's excess, and what the key adds for where it is going.

    LSB of the cost. `now`, `before`: voltage behind and in front of the stage; `low`: right shift
    of the square of the voltage ahead; `weight`: exponent.
    """
    over = min(max(0, (now ^ (now >> 63)) - bound), 2**f.EXCESS_WIDTH - 1)
    cost = (over * over) >> (f.EXCESS_SHIFT - weight - (steps - 1))
    return cost, _ahead(now, before, 3 - steps, f.VOLTAGE_AHEAD_SHIFT) >> low


@njit
def error_terms(steps, u, w, before_u, before_w):
    """Cost of an error, and what the key adds for where it is going.

    LSB of the cost; errors u and w behind the stage and in front of it.
    """
    shift = f.COST_SHIFT - (steps - 1)
    by_u, by_w = u >> f.SQUARED_SHIFT, w >> f.SQUARED_SHIFT
    ahead_u = _ahead(u, before_u, 4 - steps, f.ERROR_AHEAD_SHIFT) >> f.CURRENT_AHEAD_SHIFT
    ahead_w = _ahead(w, before_w, 4 - steps, f.ERROR_AHEAD_SHIFT) >> f.CURRENT_AHEAD_SHIFT
    return (by_u * by_u >> shift) + 3 * (by_w * by_w >> shift), ahead_u + 3 * ahead_w


@njit
def decide_words(parameters, words, s_prev, plan, following):
    """Decide on words (13,): code of the first move, saturated, candidates, key of the plan.

    `plan` (H + 1,) is that of the period before; `following` is filled with the next one.
    """
    r, t = parameters.registers, parameters.tables
    stages, beam = r[_STAGES], r[_BEAM]
    odd = plan[stages] & 1
    reference = np.empty(2, np.int64)
    drift = np.empty(2, np.int64)
    turn = np.empty(3, np.int64)
    level = np.empty(2, np.int64)
    saturated = start_terms(r, words, reference, drift, turn, level)

    # u, w, v_n, deviations of v_ph, J
    node = np.empty((beam, 7), np.int64)
    place = np.empty((beam, 3), np.int64)
    ahead_node = np.empty((beam, 7), np.int64)
    ahead_place = np.empty((beam, 3), np.int64)
    key = np.empty(beam, np.int64)
    parents = np.empty((stages, beam), np.int64)
    codes = np.empty((stages, beam), np.int64)
    low = f.SQUARED_SHIFT
    node[0, 0] = (words[9] - words[0]) << f.VECTOR_SHIFT
    node[0, 1] = rounded(
        ((words[10] - words[1]) << f.VECTOR_SHIFT) * INVERSE_ROOT, f.FRACTION, f.ERROR_WIDTH
    )[0]
    node[0, 2] = words[4] >> f.VOLTAGE_SHIFT
    for x in range(3):
        node[0, 3 + x] = (2 * words[5 + x] - words[8]) >> f.VOLTAGE_SHIFT
        place[0, x] = s_prev[x]
    node[0, 6] = 0
    width = 1
    candidates = 0

    out = np.empty(2, np.int64)
    neutral = np.empty(3, np.int64)
    phase = np.empty(3, np.int64)
    child = np.empty(7, np.int64)
    moved = np.empty(3, np.int64)
    change = np.empty(3, np.int64)
    for j in range(-1 if r[_COMPENSATE] else 0, stages):
        steps = 1 if j < r[_SHORT] - odd else 2
        decay = r[_DECAY_1] if steps == 1 else r[_DECAY_2]
        forced = r[_FORCED_1] if steps == 1 else r[_FORCED_2]
        saturated |= stage_terms(r, steps, reference, drift, turn, out, neutral, phase)
        last = j == stages - 1
        found = 0
        for parent in range(width):
            own = node[parent]
            # what all children of a node share
            shift = f.FRACTION - low
            base_u = own[0] - ((own[0] >> low) * decay >> shift) + out[0]
            base_w = own[1] - ((own[1] >> low) * decay >> shift) + out[1]
            by_neutral = own[2] * forced >> f.FORCED_FRACTION
            planned = KEEP
            if parent == 0 and j >= 0 and 1 <= plan[j] <= 3 * NEIGHBOURS:
                x, m = (plan[j] - 1) // NEIGHBOURS, (plan[j] - 1) % NEIGHBOURS
                if m < t.count[place[0, x]]:
                    planned = plan[j]
            for code in range(3 * NEIGHBOURS + 1):
                turn_ons = 0
                for x in range(3):
                    moved[x] = place[parent, x]
                if code != KEEP:
                    if j < 0:
                        break
                    x, m = (code - 1) // NEIGHBOURS, (code - 1) % NEIGHBOURS
                    s = moved[x]
                    if m >= t.count[s]:
                        continue
                    moved[x] = t.neighbours[s, m]
                    turn_ons = t.weight[1 if phase[x] < 0 else 0, s, moved[x]]
                cost = own[6] + r[_EFFORT] * turn_ons
                child[2] = own[2]
                rank = 0
                for x in range(3):
                    s = moved[x]
                    by_phase = own[3 + x] * forced >> f.FORCED_FRACTION
                    change[x] = t.level[s] * level[steps - 1]
                    change[x] += t.neutral[s] * by_neutral + t.capacitor[s] * by_phase
                    child[2] -= t.neutral_current[s] * neutral[x]
                    child[3 + x], clip = saturate(
                        own[3 + x] + t.capacitor_current[s] * phase[x], f.VOLTAGE_WIDTH
                    )
                    saturated |= clip
                    more, ahead = voltage_terms(
                        steps, r[_BOUND_PHASE], r[_WEIGHT_PHASE], child[3 + x], own[3 + x],
                        f.CAPACITOR_AHEAD_SHIFT,
                    )  # fmt: skip
                    cost += more
                    rank += ahead
                child[2], clip = saturate(child[2], f.VOLTAGE_WIDTH)
                saturated |= clip
                child[0], clip = saturate(
                    base_u - 2 * change[0] + change[1] + change[2], f.ERROR_WIDTH
                )
                saturated |= clip
                child[1], clip = saturate(base_w - change[1] + change[2], f.ERROR_WIDTH)
                saturated |= clip
                if j < 0:
                    child[6] = 0
                    ahead_node[0] = child
                    ahead_place[0] = moved
                    found = 1
                    continue
                candidates += 1
                more, ahead = voltage_terms(
                    steps, r[_BOUND_NEUTRAL], r[_WEIGHT_NEUTRAL], child[2], own[2],
                    f.NEUTRAL_AHEAD_SHIFT,
                )  # fmt: skip
                cost += more
                rank += ahead
                more, ahead = error_terms(steps, child[0], child[1], own[0], own[1])
                cost += more
                rank += ahead
                if cost > COST_MOST:
                    cost, saturated = COST_MOST, 1
                child[6] = cost
                rank = min(cost + rank, COST_MOST)
                if last:
                    if found == 0 or rank < key[0]:
                        found, key[0] = 1, rank
                        parents[j, 0], codes[j, 0] = parent, code
                    continue
                warm = parent == 0 and code == planned
                if warm:
                    rank = 0
                at, same, worst = found, 0, -1
                for i in range(found - 1, -1, -1):
                    if rank < key[i] or warm:
                        at = i
                for i in range(found):
                    if (
                        ahead_place[i, 0] == moved[0]
                        and ahead_place[i, 1] == moved[1]
                        and ahead_place[i, 2] == moved[2]
                    ):
                        same += 1
                        worst = i
                if same >= SAME_POSITION:
                    if worst < at:
                        continue
                    end = worst
                elif found < beam:
                    end = found
                    found += 1
                elif at == beam:
                    continue
                else:
                    end = beam - 1
                for i in range(end, at, -1):
                    key[i] = key[i - 1]
                    ahead_node[i] = ahead_node[i - 1]
                    ahead_place[i] = ahead_place[i - 1]
                    parents[j, i], codes[j, i] = parents[j, i - 1], codes[j, i - 1]
                key[at] = rank
                ahead_node[at] = child
                ahead_place[at] = moved
                parents[j, at], codes[j, at] = parent, code
        node, ahead_node = ahead_node, node
        place, ahead_place = ahead_place, place
        width = found
    at, chosen = 0, KEEP
    for j in range(stages):
        following[j] = KEEP
    for j in range(stages - 1, -1, -1):
        chosen = codes[j, at]
        if odd and j >= r[_SHORT]:
            following[j] = chosen
        elif j > 0:
            following[j - 1] = chosen
        at = parents[j, at]
    following[stages] = 1 - odd
    return chosen, saturated, candidates, key[0]


def most_clocks(found: Registers) -> int:
    """Most clocks that a decision of the core takes, from start to valid.

    docs/specification.md, section 10.8.
    """
    # to the first node, and from there to the second stage's: terms of two steps take longer
    first, second = (58, 19) if found.values["short_stages"] > 2 else (65, 33)
    stage = max(6 + 10 * found.beam, _TERMS_CLOCKS)
    before = second + 10 if found.values["compensate"] else 0
    return first + before + second + 10 * found.beam + (found.stages - 2) * stage + 22


@njit
def encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r):
    """Words (13,) of the measurement ports for a row per unit, and 1 where one saturated."""
    real = np.empty(13)
    real[0:4] = x_m
    real[4:8] = x_inv
    real[8] = vdc
    real[9:11] = iref
    real[11], real[12] = omega_s, omega_r
    return fixed_point.encode_row(real, _SCALES, _LOWS, _HIGHS)


@njit
def decide(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """Decide on the next positions, per unit, and keep the plan in the parameters.

    The signature of `mpdcc.ideal.decide`; held is 1 if they are s(k-1).
    """
    words, clipped = encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r)
    following = np.empty_like(parameters.plan)
    code, saturated, _, _ = decide_words(parameters, words, s_prev, parameters.plan, following)
    parameters.plan[:] = following
    s_a, s_b, s_c = s_prev[0], s_prev[1], s_prev[2]
    if code != KEEP:
        x, m = (code - 1) // NEIGHBOURS, (code - 1) % NEIGHBOURS
        target = parameters.tables.neighbours[s_prev[x], m]
        if x == 0:
            s_a = target
        elif x == 1:
            s_b = target
        else:
            s_c = target
    return s_a, s_b, s_c, 1 if code == KEEP else 0, 0, 0, saturated | clipped


def run(drive: KbestDrive, trace: MpdccTrace) -> Decisions:
    """Decide on every row of a trace, each with the plan of the row before; the first has none.

    ValueError names the key whose word cannot hold its value.
    """
    parameters = parameters_of(drive)
    out = np.empty((len(trace), 7), np.int64)
    _run(
        parameters, trace.x_m, trace.x_inv, trace.vdc, trace.iref, trace.omega_s, trace.omega_r,
        trace.s_prev, out,
    )  # fmt: skip
    return Decisions.of_words(out)


@njit
def _run(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev, out):
    for k in range(len(vdc)):
        out[k, :] = decide(
            parameters, x_m[k], x_inv[k], vdc[k], iref[k], omega_s[k], omega_r[k], s_prev[k]
        )
