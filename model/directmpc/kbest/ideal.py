"""The ideal K-best controller: the search in float64, nothing approximated.

docs/specification.md, section 10, is its contract. The controller knows the converter through a
table (`Converter`) and the load through its matrices, so that it serves any of either.
Its plan is the one thing that it keeps from step to step. `search` takes the plan and gives the
next one and keeps nothing; `decide` keeps the plan in its parameters, so that it has the arguments
and results of `mpdcc.ideal.decide`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc import converter as converters
from directmpc.compiled import njit
from directmpc.kbest.drive import KbestDrive
from directmpc.loads.load import FloatArray, Matrices, discretise
from directmpc.mpdcc.trace import Decisions, MpdccTrace

IntArray = NDArray[np.int64]

KEEP = 0
"""Code of the child that keeps all positions."""

NEIGHBOURS = 3
"""Codes of a phase: code 1 + 3 x + m moves phase x to the m-th neighbour of its position."""

CURRENT_AHEAD, CAPACITOR_AHEAD = 8.0, 4.0
"""Steps over which the key looks ahead, of the current error and of the voltages."""

CURRENT_SHARE, CAPACITOR_SHARE, NEUTRAL_SHARE = 0.5, 0.25, 4.0
"""Weights of the squares of what the key sees ahead."""

SAME_POSITION = 2
"""Most nodes of a stage that have the same positions: D."""


class Converter(NamedTuple):
    """A converter as data, for compiled code; p positions a phase.

    The voltage of a phase is dc[s] v_dc + neutral[s] v_n + capacitor[s] v_ph.
    """

    # dc, neutral, capacitor: (p,): Coefficients of the phase voltage.
    dc: FloatArray
    neutral: FloatArray
    capacitor: FloatArray
    # neutral_current, capacitor_current: (p,): n(s) and c(s): how the phase current moves v_n and
    # v_ph; 0 where there is no such capacitor.
    neutral_current: FloatArray
    capacitor_current: FloatArray
    capacitor_share: float  # Reference of v_ph, a share of v_dc; 0 where there is none
    # xdc, xph: Reactances of a dc-link capacitor and of a phase capacitor, per unit.
    xdc: float
    xph: float
    count: IntArray  # (p,): Number of neighbours of a position, itself not among them, 1 to 3
    neighbours: IntArray  # (p, 3): Neighbours, ascending
    weight: FloatArray  # (2, p, p): Turn-ons of a transition: [phase current negative][from][to]


class IdealParameters(NamedTuple):
    """All that `search` knows of a drive, per unit."""

    ts: float  # Control period
    # converter, load: What is controlled.
    converter: Converter
    load: Matrices
    # short, stages: Stages of one step in an even period, and all stages, H.
    short: int
    stages: int
    beam: int  # K
    # lambda_u, weight_vn, weight_vph: Cost of a turn-on, and of the square of an excess.
    lambda_u: float
    weight_vn: float
    weight_vph: float
    # bound_vn, bound_vph: Where the cost of the excess begins.
    bound_vn: float
    bound_vph: float
    delay: bool  # Whether the decision is for k + 1
    # (H + 1,): The plan of `decide`: a code of each stage, and 1 where the coming period is an odd
    # one.
    plan: IntArray


def converter_of(leg: converters.Converter, xdc: float, xph: float) -> Converter:
    """A converter as a table of the search; reactances of its capacitors, per unit."""
    others = [[t for t in row if t != s] for s, row in enumerate(leg.next_positions)]
    neighbours = [row + row[-1:] * (NEIGHBOURS - len(row)) for row in others]
    return Converter(
        dc=0.5 * leg.half_dc,
        neutral=leg.neutral.astype(np.float64),
        capacitor=leg.capacitor.astype(np.float64),
        neutral_current=leg.neutral_current.astype(np.float64),
        capacitor_current=leg.capacitor_current.astype(np.float64),
        capacitor_share=leg.capacitor_share,
        xdc=float(xdc),
        xph=float(xph),
        count=np.array([len(row) for row in others], dtype=np.int64),
        neighbours=np.array(neighbours, dtype=np.int64),
        weight=leg.transition_weight.astype(np.float64),
    )


def parameters_of(drive: KbestDrive, converter: Converter | None = None) -> IdealParameters:
    """Parameters of the ideal controller; every stage keeps its positions, the period is even."""
    c = drive.control
    if converter is None:
        converter = converter_of(drive.converter, drive.inverter.xdc, drive.inverter.xph)
    stages = c.short_stages + c.long_stages
    return IdealParameters(
        ts=drive.ts_pu,
        converter=converter,
        load=drive.machine.matrices,
        short=int(c.short_stages),
        stages=int(stages),
        beam=int(c.beam),
        lambda_u=float(c.lambda_u),
        weight_vn=float(c.weight_vn),
        weight_vph=float(c.weight_vph),
        bound_vn=float(c.bound_vn - c.soft_margin),
        bound_vph=float(c.bound_vph - c.soft_margin),
        delay=bool(c.delay_compensation),
        plan=np.full(stages + 1, KEEP, dtype=np.int64),
    )


@njit
def _square_ahead(now, before, factor):
    """Square of where a straight line from `before` to `now` leads."""
    ahead = now + factor * (now - before)
    return ahead * ahead


@njit
def _excess(value, bound):
    """Square of the excess over a bound."""
    over = abs(value) - bound
    return over * over if over > 0.0 else 0.0


@njit
def search(p, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev, plan, following):
    """The plan of least cost: code of its first move, its key, and the second key.

    docs/specification.md, section 10. Per unit; `plan` (H + 1,) is that of the period before,
    `following` is filled with the next. The second key is the least with another first move,
    infinite where there is none, not known where it was cut off on the way.
    """
    c = p.converter
    stages, beam = p.stages, p.beam
    share = c.capacitor_share * vdc
    odd = plan[stages] & 1

    # a node: two error components, v_n, three deviations of v_ph, cost of squares, turn-ons; these
    # two apart, so that plans which are alike cost alike after rounding too
    node = np.empty((beam, 8))
    place = np.empty((beam, 3), np.int64)
    ahead_node = np.empty((beam, 8))
    ahead_place = np.empty((beam, 3), np.int64)
    key = np.empty(beam)
    parents = np.empty((stages, beam), np.int64)
    codes = np.empty((stages, beam), np.int64)
    first = np.empty(beam, np.int64)
    ahead_first = np.empty(beam, np.int64)
    node[0, 0], node[0, 1] = iref[0] - x_m[0], iref[1] - x_m[1]
    node[0, 2] = x_inv[0]
    for x in range(3):
        node[0, 3 + x] = x_inv[1 + x] - share
        place[0, x] = s_prev[x]
    node[0, 6] = node[0, 7] = 0.0
    width = 1

    short_step = discretise(p.load, omega_r, p.ts)
    long_step = discretise(p.load, omega_r, 2.0 * p.ts)
    reference, flux = complex(iref[0], iref[1]), complex(x_m[2], x_m[3])
    root = math.sqrt(3.0) / 3.0
    axes = (complex(2.0 / 3.0), complex(-1.0 / 3.0, root), complex(-1.0 / 3.0, -root))
    charge = np.empty(3)
    child = np.empty(8)
    moved = np.empty(3, np.int64)
    second = np.inf
    # a stage in front of the first, where the state is to be taken to k + 1
    for j in range(-1 if p.delay else 0, stages):
        n = 1 if j < p.short - odd else 2
        a11, a12, _, _, b, _ = short_step if n == 1 else long_step
        turn = np.exp(1j * omega_s * p.ts * n)
        drift = (turn - a11) * reference - a12 * flux
        middle = reference * np.exp(0.5j * omega_s * p.ts * n)
        length = n * p.ts
        charge[0] = length * middle.real
        charge[1] = length * (-0.5 * middle.real + 0.5 * math.sqrt(3.0) * middle.imag)
        charge[2] = length * (-0.5 * middle.real - 0.5 * math.sqrt(3.0) * middle.imag)
        last = j == stages - 1
        found = 0
        for parent in range(width):
            own = node[parent]
            warm = parent == 0
            planned = KEEP
            if warm and j >= 0 and 1 <= plan[j] <= 3 * NEIGHBOURS:
                phase, m = (plan[j] - 1) // NEIGHBOURS, (plan[j] - 1) % NEIGHBOURS
                if m < c.count[place[0, phase]]:
                    planned = plan[j]
            for code in range(3 * NEIGHBOURS + 1):
                turn_ons = 0.0
                for x in range(3):
                    moved[x] = place[parent, x]
                if code != KEEP:
                    if j < 0:
                        break
                    phase, m = (code - 1) // NEIGHBOURS, (code - 1) % NEIGHBOURS
                    s = moved[phase]
                    if m >= c.count[s]:
                        continue
                    moved[phase] = c.neighbours[s, m]
                    turn_ons = c.weight[1 if charge[phase] < 0.0 else 0, s, moved[phase]]
                vector = 0j
                for x in range(3):
                    s = moved[x]
                    volt = c.dc[s] * vdc + c.neutral[s] * own[2]
                    volt += c.capacitor[s] * (share + own[3 + x])
                    vector += volt * axes[x]
                error = a11 * complex(own[0], own[1]) + drift - b * vector
                child[0], child[1] = error.real, error.imag
                child[2] = own[2]
                for x in range(3):
                    s = moved[x]
                    child[2] -= c.neutral_current[s] * charge[x] / (2.0 * c.xdc)
                    child[3 + x] = own[3 + x] + c.capacitor_current[s] * charge[x] / c.xph
                if j < 0:
                    child[6] = child[7] = 0.0
                    ahead_node[0] = child
                    ahead_place[0] = moved
                    found = 1
                    continue
                outside = p.weight_vn * _excess(child[2], p.bound_vn)
                ahead = 0.0
                for x in range(3):
                    outside += p.weight_vph * _excess(child[3 + x], p.bound_vph)
                    ahead += _square_ahead(child[3 + x], own[3 + x], CAPACITOR_AHEAD / n)
                square = child[0] * child[0] + child[1] * child[1]
                child[6] = own[6] + n * (square + outside)
                child[7] = own[7] + turn_ons
                ranked = child[6] + p.lambda_u * child[7] + CAPACITOR_SHARE * ahead
                ranked += NEUTRAL_SHARE * _square_ahead(child[2], own[2], CAPACITOR_AHEAD / n)
                ranked += CURRENT_SHARE * (
                    _square_ahead(child[0], own[0], CURRENT_AHEAD / n)
                    + _square_ahead(child[1], own[1], CURRENT_AHEAD / n)
                )
                begun = code if j == 0 else first[parent]
                if last:
                    if found == 0 or ranked < key[0]:
                        if found > 0 and begun != ahead_first[0]:
                            second = key[0]
                        found = 1
                        key[0] = ranked
                        parents[j, 0], codes[j, 0], ahead_first[0] = parent, code, begun
                    elif begun != ahead_first[0] and ranked < second:
                        second = ranked
                    continue
                if warm and code == planned:
                    ranked = -np.inf
                # where it stands among those kept, and how many of its positions stand before it
                at, same, worst = found, 0, -1
                for i in range(found - 1, -1, -1):
                    if ranked < key[i]:
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
                    ahead_first[i] = ahead_first[i - 1]
                key[at] = ranked
                ahead_node[at] = child
                ahead_place[at] = moved
                parents[j, at], codes[j, at], ahead_first[at] = parent, code, begun
        node, ahead_node = ahead_node, node
        place, ahead_place = ahead_place, place
        first, ahead_first = ahead_first, first
        width = found
        reference *= turn
        flux *= turn
    at, chosen = 0, KEEP
    for j in range(stages):
        following[j] = KEEP
    for j in range(stages - 1, -1, -1):
        chosen = codes[j, at]
        # an odd period begins the long stages a step earlier, so that they stand still in time
        if odd and j >= p.short:
            following[j] = chosen
        elif j > 0:
            following[j - 1] = chosen
        at = parents[j, at]
    following[stages] = 1 - odd
    return chosen, key[0], second


@njit
def decide(parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """Decide on the next positions, per unit, and keep the plan in the parameters.

    The signature of `mpdcc.ideal.decide`; held is 1 if they are s(k-1).
    """
    following = np.empty_like(parameters.plan)
    code, _, _ = search(
        parameters, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev, parameters.plan, following
    )
    parameters.plan[:] = following
    s_a, s_b, s_c = moved_by(parameters.converter, s_prev, code)
    return s_a, s_b, s_c, 1 if code == KEEP else 0, 0, 0, 0


@njit
def moved_by(converter, s_prev, code):
    """Positions behind a move of an admissible code."""
    s_a, s_b, s_c = s_prev[0], s_prev[1], s_prev[2]
    if code != KEEP:
        phase, m = (code - 1) // NEIGHBOURS, (code - 1) % NEIGHBOURS
        if phase == 0:
            s_a = converter.neighbours[s_a, m]
        elif phase == 1:
            s_b = converter.neighbours[s_b, m]
        else:
            s_c = converter.neighbours[s_c, m]
    return s_a, s_b, s_c


def run(drive: KbestDrive, trace: MpdccTrace) -> Decisions:
    """Decide on every row of a trace, each with the plan of the row before; the first has none."""
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
