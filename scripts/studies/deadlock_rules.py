"""Experiments: the fast variant's bit-true search with other rules for deadlocks.

The search is ``bit_true.fast.search``; here are the parts of it that a `Rule` replaces. With the
rule's defaults, those of `docs/specification.md`, it decides as ``bit_true.fast.decide`` does
(`tb.model.test_deadlock_study`). The RTL has none of the other rules.

A rule sets:

* the *criterion* that chooses in a deadlock, where no candidate has L* > 0,
* the *tie* rule between candidates of equal criterion,
* weights of the excesses of currents, v_n and v_ph,
* the step at which the excess is taken (1 in the specification),
* whether a trajectory outside its bound that comes closer to it counts as admissible,
* a terminal weight on the phase capacitors' deviations in the cost J.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.mpdcc import formats as f
from directmpc.mpdcc.bit_true import fast
from directmpc.mpdcc.bit_true.common import encode_row, search_length
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.trace import IntArray

MAX, SUM, SQUARES, BLEND = 0, 1, 2, 3
"""Criteria: largest excess (specification; Paper A, eq. 15); sum of the positive excesses; sum of
their squares; largest excess and a share of the largest one of the currents."""

EARLIEST, LATEST, CURRENT, MAGNITUDES, SORTED, EFFORT = 0, 1, 2, 3, 4, 5
"""Ties: earliest candidate (specification); latest; least excess of the currents; least sum of the
magnitudes |error_j(k + 1)|; least second largest excess, then third and so on; least effort f_s."""

ONE = 16
"""Weights are in sixteenths, so that a product with one of them takes few adders."""


@dataclass(frozen=True)
class Rule:
    """A deadlock rule; the defaults are those of `docs/specification.md`."""

    #: One of MAX, SUM, SQUARES; one of EARLIEST, LATEST, CURRENT, MAGNITUDES, SORTED, EFFORT.
    criterion: int = MAX
    tie: int = EARLIEST
    #: Factors of the excesses of currents, v_n and v_ph, in sixteenths.
    weights: tuple[int, int, int] = (ONE, ONE, ONE)
    step: int = 1  #: The excess is taken at k + step.
    #: Whether a trajectory that is outside at k counts as admissible while it is closer to zero at
    #: k + 1 than at k and until it leaves on the other side.
    inward: bool = False
    blend: int = 1  #: With BLEND, the largest excess counts so many times the currents'.
    #: Weight in J of the sum of the squared deviations of v_ph at k + L*, 1/pu^2.
    lambda_ph: float = 0.0


class Numbers(NamedTuple):
    """A `Rule` in compiled code."""

    #: As in `Rule`.
    criterion: int
    tie: int
    #: `Rule.weights`.
    weight_current: int
    weight_neutral: int
    weight_phase: int
    step: int
    inward: int
    blend: int
    terminal: float  #: `Rule.lambda_ph` in cost units per square trajectory unit.


def parameters(drive: Drive, rule: Rule) -> tuple[IntArray, Numbers]:
    """First argument of ``decide``: registers of the drive, and the rule."""
    values = registers(drive, "fast")
    terminal = rule.lambda_ph * f.COST_UNIT / values.unit**2
    numbers = Numbers(
        rule.criterion, rule.tie, *rule.weights, rule.step, int(rule.inward), rule.blend, terminal
    )
    return values.array(), numbers


@njit
def _errors_ahead(first, slope, error, curvature, step, ahead):
    """Errors at k + step into `ahead`; for one step exactly what the core forms."""
    for j in range(7):
        if step == 1:
            ahead[j] = first[j] + slope[j]
        else:
            bend = curvature[j] * step * step if j < 3 else 0
            ahead[j] = error[j] + slope[j] * step + bend


@njit
def criterion(rule, ahead, bound, effort, keys):
    """What a deadlock compares."""
    keys[:] = 0
    excess = np.empty(7, dtype=np.int64)
    worst = -(1 << 50)
    for j in range(7):
        weight = rule.weight_phase
        if j < 3:
            weight = rule.weight_current
        elif j == 3:
            weight = rule.weight_neutral
        excess[j] = weight * (abs(ahead[j]) - bound[j])
        worst = max(worst, excess[j])
        positive = max(excess[j], 0)
        if rule.criterion == SUM:
            keys[0] += positive
        elif rule.criterion == SQUARES:
            keys[0] += positive * positive
    current = max(excess[0], max(excess[1], excess[2]))
    if rule.criterion == MAX:
        keys[0] = worst
    elif rule.criterion == BLEND:
        keys[0] = worst * rule.blend + current
    if rule.tie == CURRENT:
        keys[1] = current
    elif rule.tie == MAGNITUDES:
        for j in range(7):
            keys[1] += abs(ahead[j])
    elif rule.tie == SORTED:
        excess.sort()
        for j in range(6):
            keys[1 + j] = excess[5 - j]
    elif rule.tie == EFFORT:
        keys[1] = effort


@njit
def _better(keys, best, latest):
    """Whether `keys` beat those of the best; equal ones only where the latest is wanted."""
    for j in range(7):
        if keys[j] != best[j]:
            return keys[j] < best[j]
    return latest


@njit
def _length_of(rule, error, first, slope, curvature, bound, threshold, horizon):
    """``fast.length_inside``; with the inward rule, outputs that come closer do not end it.

    Arguments as ``fast.length_inside``, but for `rule`: ``Numbers``.
    """
    if not rule.inward:
        return fast.length_inside(0, error, first, slope, curvature, bound, threshold, horizon)
    length = horizon
    for j in range(7):
        size = abs(error[j])
        after = abs(first[j] + slope[j])
        outside = size > bound[j]
        if after > bound[j] and not (outside and after < size):
            return 0
        if j < 3:
            limit = size if outside else bound[j]
            edge = fast.turn_threshold(error[j], curvature[j], limit) if outside else threshold[j]
            found = fast.first_exit(error[j], slope[j], curvature[j], limit, edge)
        elif outside:
            found = (size + bound[j]) // abs(slope[j])
        else:
            found = search_length(error[j], slope[j], bound[j], horizon)
        length = min(length, found)
    return length


@njit
def _least_excess(rule, error, first, slope, curvature, bound, effort, record, none_yet):
    """``fast.least_excess`` for a rule.

    Arguments as ``fast.least_excess``, but for `rule`, ``Numbers``, and `record`: the keys of the
    best so far, then how many candidates tie with it.
    """
    ahead = np.empty(7, dtype=np.int64)
    keys = np.empty(7, dtype=np.int64)
    _errors_ahead(first, slope, error, curvature, rule.step, ahead)
    criterion(rule, ahead, bound, effort, keys)
    if none_yet or keys[0] < record[0]:
        record[7] = 1
    elif keys[0] == record[0]:
        record[7] += 1
    if none_yet or _better(keys, record, rule.tie == LATEST):
        record[:7] = keys
        return True
    return False


@njit
def _surcharge(rule, error, slope, length):
    """Terminal weight on the phase capacitors, cost units.

    Arguments as ``fast.no_surcharge``, but for `rule`: ``Numbers``.
    """
    if rule.terminal == 0.0:
        return 0
    total = 0.0
    for j in range(4, 7):
        total += float(error[j] + length * slope[j]) ** 2
    return int(rule.terminal * total)


@njit
def _search(given, measurement, s_prev, record):
    """``fast.search`` under a rule."""
    register, rule = given
    order = np.empty((fast.CANDIDATES, 5), dtype=np.int64)
    return fast.search(
        _length_of, _least_excess, _surcharge, rule, register, measurement, s_prev, order, record
    )


@njit
def decide_words(given, measurement, s_prev):
    """``fast.decide_words`` under a rule."""
    return _search(given, measurement, s_prev, np.zeros(8, dtype=np.int64))[:7]


@njit
def ties(given, measurement, s_prev):
    """Candidates that share the least value of the criterion in a deadlock, before the tie rule."""
    record = np.zeros(8, dtype=np.int64)
    deadlock = _search(given, measurement, s_prev, record)[4]
    return record[7] if deadlock else 0


@njit
def decide(given, x_m, x_inv, vdc, iref, omega_s, omega_r, s_prev):
    """``decide_words`` on real numbers."""
    measurement, clipped = encode_row(x_m, x_inv, vdc, iref, omega_s, omega_r)
    a, b, c, held, deadlock, length, saturated = decide_words(given, measurement, s_prev)
    return a, b, c, held, deadlock, length, saturated | clipped
