"""Ranges of sums (`scripts/measure/ranges`): every word fits, and a narrower format does not.

Sweep: every check and its fault; ways of errors at random and at the ends of what is said of them;
nodes of random registers and measurements; coordinates, running sequences and radicands at random
and at their ends.
Checks: that each check passes and fails with its fault; that the bounds of the search, of a way to
a successor and of its words, and of times, residues, roots and shares hold for the bit-true twins,
and are not far above them.
Does not prove: that the ranges name every sum of the VHDL.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from directmpc.mpdcc import capacitor_observer, leakage, state_program
from directmpc.mpdcc import formats as f
from directmpc.mpdcc.bit_true import common, fast
from directmpc.mpdcc.coefficients import INDEX
from directmpc.mpdcc.program import TERMS
from directmpc.mptc import bit_true_hexagon as hexagon
from directmpc.mptc import bit_true_sequences as sequences
from directmpc.mptc import formats as g
from directmpc.mptc import observer, vector_sequencer
from directmpc.mptc.bit_true import VECTOR_ALPHA, magnitude, square_root
from directmpc.mptc.sequence import TIME_STEPS
from scripts.__main__ import main
from scripts.measure.ranges import intervals, mpdcc, mptc, mptc_times, observers, second_level
from scripts.measure.ranges import table as ranges

BOUND = f.BOUND_HIGH["fast"]
LONGEST = 2**f.LENGTH_WIDTH - 1

#: Further formats with which a word is too narrow: what is run, and what says so.
FAULTS = [
    (second_level.bases, intervals.Fault("START_SLOPE_WIDTH", 1), "slope of a candidate"),
    (second_level.bases, intervals.Fault("CURVATURE_TERM_WIDTH", 2), "operand secant_"),
    (second_level.leaves, intervals.Fault("BUDGET_WIDTH", -6), "leaves of a node"),
    (second_level.leaves, intervals.Fault("INDEX_WIDTH", -1), "place of a candidate"),
    (mptc.magnitude, intervals.Fault("FRACTION", -1, g), "length after rotation 0"),
    (mptc.vectors, intervals.Fault("TORQUE_WIDTH", -2, g), "MPTC: level"),
    (mptc.vectors, intervals.Fault("ROOT_WIDTH", -1, g), "radicand that has a root"),
    (mptc.pairs, intervals.Fault("COST_WIDTH", -1, g), "cost of a pair"),
    (mptc.coordinates, intervals.Fault("QUOTIENT_FRACTION", -1, g), "way of a vector"),
    (mptc_times.quotients, intervals.Fault("HEXAGON_FRACTION", 8, g), "SVM's divisor"),
    (
        mptc_times.flux_reference,
        intervals.Fault("REFERENCE_WIDTH", 1, g),
        "length of the reference",
    ),
    (mptc_times.duties, intervals.Fault("TORQUE_WIDTH", -8, g), "span of a length"),
    (mptc_times.duties, intervals.Fault("LINK_SHIFT", 1, g), "dc link as a word"),
    (mptc_times.choices, intervals.Fault("QUOTIENT_FRACTION", -1, g), "coordinate"),
    (mptc_times.choices, intervals.Fault("RESIDUE_FRACTION", 1, g), "residue along"),
    (mptc_times.hexagon, intervals.Fault("TIME_PORT_WIDTH", -1, g), "both times inside"),
    (mptc_times.shares, intervals.Fault("WORD_WIDTH", -1, g), "share of a sequence"),
    (mptc_times.running_shares, intervals.Fault("TIME_WIDTH", -1, g), "time of the third"),
    (mptc_times.segments, intervals.Fault("TIME_PORT_WIDTH", 2, g), "invalid: second end"),
    (mptc_times.segments, intervals.Fault("RATE_WIDTH", 9, vector_sequencer), "phase of the next"),
    (mptc_times.preexcitation, intervals.Fault("MEASUREMENT_WIDTH", 3, g), "measurement as a word"),
    (observers.states, intervals.Fault("SUM_WIDTH", -3, state_program), "sum of clock"),
    (observers.states, intervals.Fault("STATE_WIDTH", 6, leakage), "theta moved"),
    (observers.states, intervals.Fault("GUARD", 1, capacitor_observer), "goal"),
    (observers.speed, intervals.Fault("GUARD", -2, observer), "half of a state's way"),
    (observers.stator_flux, intervals.Fault("MEASUREMENT_SHIFT", 1, g), "measurement as a word"),
]


@pytest.mark.parametrize("check", ranges.CHECKS, ids=lambda check: check.name)
def test_sums_fit_their_words(check: intervals.Check, monkeypatch: pytest.MonkeyPatch) -> None:
    assert ranges.shown(check)[0] == ""
    fault = check.fault
    monkeypatch.setattr(fault.module, fault.name, getattr(fault.module, fault.name) + fault.by)
    problem, _ = ranges.shown(check)
    assert "does not fit" in problem or "may" in problem


@pytest.mark.parametrize(("run", "fault", "said"), FAULTS, ids=[said for *_, said in FAULTS])
def test_a_fault_is_named(run, fault: intervals.Fault, said: str, monkeypatch) -> None:
    monkeypatch.setattr(fault.module, fault.name, getattr(fault.module, fault.name) + fault.by)
    with pytest.raises(intervals.RangeError, match=f"^{said}.* does not fit"):
        run()


def test_the_dip_of_a_search_is_the_deepest_of_all_lengths() -> None:
    room, start = 2_000, 2**16
    found = mpdcc._steepest(room, 6, start)[1]
    deepest = 0
    for c in range(7):
        for wide in range(room + 1):
            threshold = min((wide >> k) + (c << k) for k in range(f.LENGTH_WIDTH + 1))
            deepest = max(deepest, *(threshold * n - c * n * n - wide for n in range(64)))
    assert found == deepest


def test_a_range_that_does_not_fit_is_named() -> None:
    intervals.demand("sum", (-8, 7), 4)
    intervals.demand("sum", (0, 15), 4, signed=False)
    for low, high in ((-9, 0), (0, 8)):
        with pytest.raises(intervals.RangeError, match=f"sum: {low} to {high} does not fit 4 bits"):
            intervals.demand("sum", (low, high), 4)
    assert intervals.times((-3, 2), (-5, 4)) == (-12, 15)
    assert intervals.hull([(1, 2), (-4, 0)]) == (-4, 2)


def test_ranges_are_shown_by_entity(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "proofs.json"
    assert main(["prove", "step_one", "--out", str(out)]) == 0
    (found,) = json.loads(out.read_text())["proof"]["step_one"].values()
    assert (found["method"], found["holds"]) == ("intervals", True)
    assert "step_one" in capsys.readouterr().out


def way_length(inwards: int, error: int, slope: int, curvature: int) -> int:
    """Length of a candidate one of whose currents moves, the longest horizon, by the twin."""
    words = np.zeros((3, 7), dtype=np.int64)
    words[0, 0], words[1, 0], words[2, 0] = error, error + curvature, slope
    bend = np.array([curvature, 0, 0], dtype=np.int64)
    bound = np.full(7, BOUND, dtype=np.int64)
    threshold = np.array([fast.turn_threshold(error, curvature, BOUND), 0, 0], dtype=np.int64)
    rule = fast.Rule(0, inwards)
    return int(fast.length_of(rule, *words, bend, bound, threshold, LONGEST))


@pytest.mark.parametrize("inwards", [0, 1])
def test_no_error_moves_farther_than_it_reaches(inwards: int) -> None:
    rng = np.random.default_rng(11 + inwards)
    outside = (0, 2 ** (f.BASE_WIDTH - 1) - BOUND)[inwards]
    reach = second_level.reaches(outside)
    most = BOUND + outside
    nearest = np.zeros(LONGEST)
    steps = np.arange(1, LONGEST)
    for _ in range(15_000):
        error = int(rng.integers(-most, most))
        curvature = int(rng.choice([-1, 1]) * min(2 ** rng.uniform(-1, 10), 1023))
        # to a place near a bound after some steps, or as steep as the threshold
        end, last = int(rng.choice([-1, 1]) * (BOUND - rng.exponential(300))), rng.integers(1, 64)
        slope = (end - error) // int(last) - curvature * int(last)
        if rng.random() < 0.5:
            sign = -1 if curvature >= 0 else 1
            threshold = fast.turn_threshold(error, curvature, BOUND)
            slope = sign * (threshold + int(rng.integers(-3, 4)))
        length = way_length(inwards, error, slope, curvature)
        taken = steps[: min(length, LONGEST - 1)]
        way = np.abs(slope * taken + curvature * taken * taken)
        allowed = reach[abs(curvature), taken]
        assert (way <= allowed).all(), (error, slope, curvature)
        nearest[taken] = np.maximum(nearest[taken], way / reach[:, taken].max(axis=0))
    assert nearest[2:].min() > 0.75


def any_node(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Registers of any content, and measurements that are often near their references."""
    register = np.zeros(max(INDEX.values()) + 1, dtype=np.int64)
    for place in INDEX.values():
        register[place] = rng.choice([-1, 1]) * min(
            2 ** rng.uniform(0, rng.choice([6, 10, 15])), 32767
        )
    for name in ("bound_current", "bound_neutral", "bound_phase"):
        register[INDEX[name]] = rng.integers(100, BOUND + 1)
    register[INDEX["horizon"]] = LONGEST
    register[INDEX["first_row"]] = 0
    words = {
        name: int(rng.integers(-32768, 32768)) >> rng.integers(8) if word.signed else 40_000
        for name, word in f.MEASUREMENTS.items()
    }
    for x in ("alpha", "beta"):
        wanted = words[f"is_{x}"] + (int(rng.integers(-3000, 3000)) >> rng.integers(8))
        words[f"iref_{x}"] = max(-32768, min(32767, wanted))
    for x in "abc":
        words[f"v_ph_{x}"] = 20_000 + (int(rng.integers(-2000, 2000)) >> rng.integers(8))
    return register, np.array(list(words.values()), dtype=np.int64)


def test_no_successor_leaves_what_is_said_of_it() -> None:
    rng = np.random.default_rng(7)
    ranges_of = second_level.nodes()[1]
    least, most = np.array([ranges_of[name] for name in TERMS]).T
    slope, start = np.empty(7, dtype=np.int64), np.empty(2, dtype=np.int64)
    lengths = set()
    for n in range(1500):
        register, measurement = any_node(rng)
        results, t, node = fast._root(register, measurement)
        reference, bound = fast._reference(register, results), common.options(register).bound
        first = fast.first_errors(node.error, node.curvature)
        threshold = np.array(
            [fast.turn_threshold(node.error[x], node.curvature[x], bound[x]) for x in range(3)]
        )
        for s in rng.integers(0, 8, (12, 3)):
            fast._start_slopes(s, node, slope, start)
            steps = int(
                fast.length_of(
                    fast.Rule(0, n % 2), node.error, first, slope, node.curvature, bound, threshold,
                    LONGEST,
                )
            )  # fmt: skip
            if not 0 < steps < LONGEST:
                continue
            lengths.add(steps)
            assert fast.has_successors(t, start)
            found, _ = fast.successor(register, reference, t, start, s, steps)
            assert ((found >= least) & (found <= most)).all(), (register, measurement, s)
    assert len(lengths) > 40


@pytest.mark.parametrize("inwards", [0, 1])
def test_a_current_without_room_has_no_way(inwards: int) -> None:
    # the steepest curvature leaves after a few steps, whatever error and slope are
    reach = second_level.reaches((0, 2 ** (f.BASE_WIDTH - 1) - BOUND)[inwards])
    steepest = reach[2 ** (f.CURVATURE_WIDTH - 1)]
    assert steepest[1] > 0
    assert (steepest[LONGEST // 2 :] == -1).all()


def test_a_wider_bound_lets_an_operand_leave_its_word(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(f.BOUND_HIGH, "fast", 4 * BOUND)
    monkeypatch.setattr(f, "START_SLOPE_WIDTH", f.START_SLOPE_WIDTH + 2)
    with pytest.raises(intervals.RangeError, match=r"operand drift_alpha after \d+ steps"):
        second_level.successors()


def test_the_last_half_lsb_of_a_flux_is_limited_and_flagged() -> None:
    coefficient = np.zeros(len(observer.COEFFICIENTS), dtype=np.int64)
    coefficient[observer.COEFFICIENTS.index("voltage_alpha")] = g.WORD_HIGH
    state = np.zeros(4, dtype=np.int64)
    for v_dc in (65535, 65535, 1):
        measured = np.array([0, 0, 0, v_dc], dtype=np.int64)
        flux, _, saturated = observer.step_words(coefficient, state, measured, 1)
    port = observer.GUARD + g.MEASUREMENT_SHIFT
    assert (flux, saturated) == (32767, 1)
    assert (int(state[2]) + (1 << (port - 1))) >> port == 32768


def test_a_pair_beyond_its_vectors_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    # u_1 after u_1 would make twice its step
    monkeypatch.setattr(sequences, "ZERO_PAIRS", np.array([[1, 1, 1]]))
    with pytest.raises(intervals.RangeError, match="the flux with 1 and 1 may leave its word"):
        mptc.pairs()


def test_a_root_leaves_no_more_than_is_said() -> None:
    rng = np.random.default_rng(3)
    for span in (1, 5, 4095, 3 * 2**20, *rng.integers(1, 3 * 2**20, 200).tolist()):
        for part in (0, span - 1, int(rng.integers(0, span))):
            rest, unit, taken = part << 1, span, 0
            for k in range(g.TIME_WIDTH):
                assert rest < 2 * taken + 2 * unit + 2**k
                rest = 2 * rest - 2 * taken - unit
                if rest >= 0:
                    taken += unit
                else:
                    rest += 2 * taken + unit
                unit >>= 1
            assert taken <= 2 * span


def test_rotations_stay_inside_their_words() -> None:
    rng = np.random.default_rng(5)
    most = mptc._fluxes()[0]
    ends = [(x, y) for x in most for y in most]
    flux = np.array([*ends, *rng.integers(most[0], most[1] + 1, (20_000, 2))])
    u, v = np.where(flux[:, 0] < 0, ~flux[:, 0], flux[:, 0]), flux[:, 1].copy()
    for i in range(g.ITERATIONS):
        up = v >= 0
        along, across = v >> i, u >> i
        u, v = u + np.where(up, along, ~along), v + np.where(up, ~across, across)
        assert np.abs(v).max() < 2 ** (g.MAGNITUDE_WIDTH - 1 - i)
    assert u.max() == max(magnitude(x, y) for x, y in ends)
    assert 0.85 * 2 ** (g.MAGNITUDE_WIDTH - 1) < u.max() < 2 ** (g.MAGNITUDE_WIDTH - 1)


def coordinates_of(rng: np.random.Generator, n: int) -> np.ndarray:
    """Quotients of any size, and both of them at their ends."""
    most = 2 ** (g.QUOTIENT_WIDTH - 1) - 1
    size = (2 ** rng.uniform(0, g.QUOTIENT_WIDTH - 1, (n, 2))).astype(np.int64)
    ends = [(x, y) for x in (-most, most) for y in (-most, most)]
    return np.array([*ends, *(rng.choice([-1, 1], (n, 2)) * np.minimum(size, most))])


def test_times_and_residues_of_choices_are_those_of_the_twin() -> None:
    whole, shift = 4 << g.HEXAGON_FRACTION, g.HEXAGON_FRACTION + 2 - g.RESIDUE_FRACTION
    both = coordinates_of(np.random.default_rng(13), 150)
    least, most, allowed = np.zeros(3), np.zeros(3), []
    for e in mptc_times.leaders():
        for line in mptc_times.lines():
            kind, turn = line.name.split()
            find = hexagon.spoke if kind == "spoke" else hexagon.edge
            bounds = np.array(mptc_times.residues(line, e))
            allowed.append(bounds)
            for along, beside in (both @ np.array(e).T).tolist():
                time, at_g, at_h = find(along, beside, int(turn))
                told = line.of_g * along + line.of_h * beside + line.offset
                complement = 2 * (kind == "spoke" and turn in "234")
                assert time == min(max(told - complement, 0), whole)
                left = [(4 * along - at_g) >> shift, (4 * beside - at_h) >> shift]
                left.append(sum(left))
                assert (bounds[:, 0] <= left).all()
                assert (left <= bounds[:, 1]).all()
                squares = np.abs(bounds).max(axis=1) ** 2
                assert 2 * hexagon.square(along, beside, at_g, at_h) <= squares.sum()
                least, most = np.minimum(least, left), np.maximum(most, left)
    assert (least < 0.9 * np.min(allowed, axis=0)[:, 0]).all()
    assert (most > 0.9 * np.max(allowed, axis=0)[:, 1]).all()


def test_a_time_that_is_not_exact_is_named() -> None:
    with pytest.raises(intervals.RangeError, match="far: a time may not be exact"):
        mptc_times._line("far", (0, 0), (2, 1))


def any_times(rng: np.random.Generator) -> np.ndarray:
    """A sequence whose times make one period, or less."""
    t1 = int(rng.choice([0, TIME_STEPS, rng.integers(TIME_STEPS + 1)]))
    t2 = int(rng.choice([0, TIME_STEPS - t1, rng.integers(TIME_STEPS - t1 + 1)]))
    return np.array([*rng.integers(0, 8, 3), t1, t2])


def test_both_times_of_a_flux_method_are_one_period_at_most() -> None:
    rng = np.random.default_rng(17)
    methods = (hexagon.mpfc2, hexagon.mpfc3, hexagon.mpc2, lambda *given: hexagon.svm(*given[:2]))
    met = [set() for _ in methods]
    e = next(iter(mptc_times.leaders()))
    for along, beside in (coordinates_of(rng, 4000) @ np.array(e).T).tolist():
        applied = any_times(rng)
        for n, method in enumerate(methods):
            t1, t2 = method(along, beside, applied)[3:]
            assert min(t1, t2) >= 0
            assert t1 + t2 <= TIME_STEPS
            met[n] |= {t1, t2}
    for times in met:
        assert {0, TIME_STEPS} <= times
        assert len(times) > 500


def test_no_share_of_times_of_one_period_leaves_its_word() -> None:
    rng = np.random.default_rng(19)
    found, sums = set(), set()
    for _ in range(3000):
        applied = any_times(rng)
        found |= set(sequences.shares(applied))
        # as mptc_shares forms them
        u1, u2, u3 = (int(VECTOR_ALPHA[u]) for u in applied[:3])
        total = TIME_STEPS * u3
        for part, time in ((u1, 3), (-u3, 3), (u2, 4), (-u3, 4)):
            total += part * int(applied[time])
            sums.add(total)
    assert (min(found), max(found)) == (-(2 ** (g.FRACTION - 1)), 2 ** (g.FRACTION - 1))
    assert (min(sums), max(sums)) == (-4 * TIME_STEPS, 4 * TIME_STEPS)
    # why longer times are not used
    beyond = np.array([1, 1, 4, TIME_STEPS, TIME_STEPS])
    assert sequences.shares(beyond)[0] > g.WORD_HIGH
    used, too_long = sequences.fitted(beyond)
    assert (used.tolist(), too_long) == ([1, 1, 4, 0, 0], 1)


def test_the_rest_of_a_root_is_twice_the_root_at_most() -> None:
    rng = np.random.default_rng(23)
    most = mptc_times._radicand()[1]
    widest = 0
    for radicand in (0, most, *rng.integers(0, most, 500).tolist()):
        rest, root = 0, 0
        for k in range(g.ROOT_WIDTH - 1, -1, -1):
            rest = 4 * rest + (radicand >> 2 * k & 3)
            bit = rest >= 4 * root + 1
            rest, root = rest - (4 * root + 1) * bit, 2 * root + bit
            assert rest <= 2 * root
            widest = max(widest, rest)
        assert root == square_root(radicand)
    assert widest > 0.9 * 2 ** (g.ROOT_WIDTH + 1)


def test_no_end_of_a_segment_leaves_its_word() -> None:
    rng = np.random.default_rng(29)
    high = 2**g.TIME_PORT_WIDTH - 1
    rows = [(u, 0, 0, t1, t2) for u in (1, 2) for t1 in (0, high) for t2 in (0, high)]
    rows += [(*rng.integers(0, 8, 3), *any_times(rng)[3:]) for _ in range(500)]
    last: dict[bool, int] = {False: 0, True: 0}
    for row in rows:
        for segmented in (False, True):
            _, ends, invalid = vector_sequencer.plan(row, segmented)
            last[invalid] = max(last[invalid], *ends)
    assert last[False] == 2**vector_sequencer.POSITION_WIDTH
    assert 0.4 < last[True] / 2 ** (vector_sequencer.POSITION_WIDTH + 3) < 1.0
