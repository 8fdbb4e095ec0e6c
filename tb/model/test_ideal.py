"""The ideal controller against section 2 of the specification, written a second time, plainly."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from directmpc.mpdcc import ideal
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.trace import MpdccTrace

NEXT = [[0, 1, 2], [0, 1, 3], [0, 2, 3, 4], [1, 2, 3, 5], [2, 4, 5, 6], [3, 4, 5, 7], [4, 6, 7],
        [5, 6, 7]]  # fmt: skip


def phase_voltage(s: int, vdc: float, v_n: float, v_ph: float) -> float:
    return [
        -vdc / 2, -vdc / 2 + v_ph, v_n - v_ph, v_n, v_n, v_n + v_ph, vdc / 2 - v_ph, vdc / 2
    ][s]  # fmt: skip


def transitions(s: int, t: int) -> int:
    return 0 if s == t else 3 if {s, t} in ({2, 4}, {3, 5}) else 1


class Specified:
    """Section 2 of docs/specification.md, step by step, no compiled code and no shared tables."""

    def __init__(self, drive: Drive, trace: MpdccTrace, row: int) -> None:
        self.drive = drive
        self.h = drive.ts_pu
        self.n = drive.control.horizon
        self.omega_s, self.vdc = trace.omega_s[row], trace.vdc[row]
        self.a, self.b = drive.machine.exact(trace.omega_r[row], self.h)
        self.iref = complex(*trace.iref[row])
        self.s_prev = tuple(int(s) for s in trace.s_prev[row])
        self.x_m, self.x_inv = trace.x_m[row], trace.x_inv[row]

    @staticmethod
    def phases(alpha: float, beta: float) -> list[float]:
        """Three-phase components of a space vector."""
        r = math.sqrt(3) / 2
        return [alpha, -alpha / 2 + r * beta, -alpha / 2 - r * beta]

    def deviations(self, x_m, x_inv, step: int) -> list[float]:
        """Absolute deviations |y* - y| at k + step, the seven outputs in order."""
        reference = self.iref * complex(
            math.cos(self.omega_s * step * self.h), math.sin(self.omega_s * step * self.h)
        )
        wanted = self.phases(reference.real, reference.imag) + [0.0] + [self.vdc / 4] * 3
        actual = self.phases(x_m[0], x_m[1]) + list(x_inv)
        return [abs(w - y) for w, y in zip(wanted, actual, strict=True)]

    def inside(self, x_m, x_inv, step: int) -> bool:
        """Whether all outputs keep their bounds at k + step."""
        deviations = self.deviations(x_m, x_inv, step)
        return all(d <= b for d, b in zip(deviations, self.drive.bounds, strict=True))

    def slopes(self, x_m, s) -> np.ndarray:
        """Change of the inverter state per step at the currents given."""
        currents = self.phases(x_m[0], x_m[1])
        drawn = sum(i for i, p in zip(currents, s, strict=True) if p in (2, 3, 4, 5))
        slopes = [-drawn / (2 * self.drive.inverter.xdc)]
        for i, p in zip(currents, s, strict=True):
            sign = 1 if p in (2, 6) else -1 if p in (1, 5) else 0
            slopes.append(sign * i / self.drive.inverter.xph)
        return self.h * np.array(slopes)

    def voltages(self, x_inv, s) -> np.ndarray:
        """Phase voltages of a position at an inverter state."""
        return np.array(
            [phase_voltage(p, self.vdc, x_inv[0], v) for p, v in zip(s, x_inv[1:], strict=True)]
        )

    def errors(self, x_m, x_inv, step: int) -> np.ndarray:
        """y - y* of the voltages, signed; |y* - y| of the currents."""
        found = np.array(self.deviations(x_m, x_inv, step))
        found[3:] = np.array([x_inv[0], *(v - self.vdc / 4 for v in x_inv[1:])])
        return found

    def comes_back(self, start, before, now, slopes) -> bool:
        """The rule inwards: step by step the currents, by their lines the voltages."""
        bounds = self.drive.bounds
        # a step may not raise the excess of a current that is outside after it
        for j in range(3):
            excess_before, excess = before[j] - bounds[j], now[j] - bounds[j]
            if excess > 0 and not excess < excess_before:
                return False
        for j in range(3, 7):
            slope = slopes[j - 3] if abs(slopes[j - 3]) > 1e-12 else 0.0
            if abs(start[j]) <= bounds[j]:
                alive = abs(now[j]) <= bounds[j]
            elif start[j] > 0:
                alive = slope < 0 and now[j] >= -bounds[j]
            else:
                alive = slope > 0 and now[j] <= bounds[j]
            if not alive:
                return False
        return True

    def extend(self, x_m, x_inv, s, offset: int):
        """L* from a state at k + offset, and the state there."""
        v, slopes = self.voltages(x_inv, s), self.slopes(x_m, s)
        states = [(x_m, x_inv)]
        if self.drive.control.outside_rule == "inwards":
            start = before = self.errors(x_m, x_inv, offset)
            for step in range(1, self.n + 1):
                following = self.a @ states[-1][0] + self.b @ v, x_inv + step * slopes
                now = self.errors(*following, offset + step)
                if not self.comes_back(start, before, now, slopes):
                    break
                states.append(following)
                before = now
            return len(states) - 1, *states[-1]
        for step in range(self.n + 1):
            if not self.inside(*states[step], offset + step):
                length = max(step - 1, 0)
                return length, *states[length]
            states.append((self.a @ states[step][0] + self.b @ v, x_inv + (step + 1) * slopes))
        return self.n, *states[self.n]

    def decide(self):
        """s_a, s_b, s_c, held, deadlock, length."""
        s = self.s_prev
        x_m = self.a @ self.x_m + self.b @ self.voltages(self.x_inv, s)
        if self.inside(x_m, self.x_inv + self.slopes(self.x_m, s), 1):
            return *self.s_prev, 1, 0, 0
        return self.search()

    def following(self, s):
        """Candidates after s, in order."""
        return [(a, b, c) for a in NEXT[s[0]] for b in NEXT[s[1]] for c in NEXT[s[2]]]

    def search(self):
        """Decide without the hold test."""
        lam = self.drive.control.lambda_n
        best_se, best_sese, best_dead = None, None, None
        for s1 in self.following(self.s_prev):
            f1 = sum(map(transitions, self.s_prev, s1))
            l1, x_m1, x_inv1 = self.extend(self.x_m, self.x_inv, s1, 0)
            if l1 == 0:
                x_m = self.a @ self.x_m + self.b @ self.voltages(self.x_inv, s1)
                x_inv = self.x_inv + self.slopes(self.x_m, s1)
                outside = np.array(self.deviations(x_m, x_inv, 1)) - self.drive.bounds
                excess = max(outside)
                if self.drive.control.deadlock_rule == "weighted":
                    excess = max(outside * (1, 1, 1, 8, 1, 1, 1)) + max(outside[:3]) / 16
                if best_dead is None or excess < best_dead[0]:
                    best_dead = excess, s1
                continue
            cost = f1 / l1 + lam * x_inv1[0] ** 2
            if best_se is None or cost < best_se[0]:
                best_se = cost, s1, l1
            if self.drive.control.switching_horizon == "SE":
                continue
            leaves = [cost] if l1 == self.n else []
            if l1 < self.n:
                for s2 in self.following(s1):
                    l2, _, x_inv2 = self.extend(x_m1, x_inv1, s2, l1)
                    if l2 > 0:
                        f2 = sum(map(transitions, s1, s2))
                        leaves.append((f1 + f2) / (l1 + l2) + lam * x_inv2[0] ** 2)
            for cost in leaves:
                if best_sese is None or cost < best_sese[0]:
                    best_sese = cost, s1, l1
        if best_se is None:
            return *best_dead[1], 0, 1, 0
        chosen = best_sese or best_se
        return *chosen[1], 0, 0, chosen[2]


def random_trace(drive: Drive, n: int, seed: int, spread: float = 1.2) -> MpdccTrace:
    """States around the bounds: most outputs inside, some just outside."""
    rng = np.random.default_rng(seed)
    omega_s = rng.uniform(-1.2, 1.2, n)
    iref = rng.uniform(0.3, 1.2, n) * np.exp(2j * np.pi * rng.random(n))
    flux = rng.uniform(0.5, 1.1, n) * np.exp(2j * np.pi * rng.random(n))
    b = drive.bounds
    radius = spread * b[0] * np.sqrt(rng.random(n))
    current = iref + radius * np.exp(2j * np.pi * rng.random(n))
    vdc = rng.uniform(1.8, 2.2, n)
    x_inv = spread * b[3:] * rng.uniform(-1, 1, (n, 4)) ** 3
    x_inv[:, 1:] += vdc[:, None] / 4
    return MpdccTrace(
        x_m=np.column_stack([current.real, current.imag, flux.real, flux.imag]),
        x_inv=x_inv,
        vdc=vdc,
        iref=np.column_stack([iref.real, iref.imag]),
        omega_s=omega_s,
        omega_r=omega_s + rng.uniform(-0.02, 0.02, n),
        s_prev=rng.integers(0, 8, (n, 3)),
    )


def as_rows(decisions) -> list[tuple[int, ...]]:
    columns = np.column_stack(
        [decisions.s, decisions.held, decisions.deadlock, decisions.length]
    ).tolist()
    return [tuple(row) for row in columns]


@pytest.mark.parametrize(
    ("control", "n"),
    [
        ({"horizon": 63}, 60),
        ({"horizon": 63, "lambda_n": 0.0, "bound_current": 0.2}, 60),  # nothing but ties
        ({"horizon": 63, "lambda_n": 100.0}, 60),
        ({"horizon": 1, "bound_current": 0.06}, 60),
        ({"horizon": 6, "switching_horizon": "SESE"}, 16),
        ({"horizon": 4, "switching_horizon": "SESE", "lambda_n": 0.0}, 16),
        ({"horizon": 63, "switching_horizon": "SESE", "bound_current": 0.05}, 12),
        ({"horizon": 9, "deadlock_rule": "weighted", "bound_current": 0.03}, 150),
        ({"horizon": 3, "switching_horizon": "SESE", "deadlock_rule": "weighted"}, 60),
        ({"outside_rule": "inwards"}, 300),
        ({"outside_rule": "inwards", "bound_current": 0.02, "bound_vn": 0.02}, 150),
        ({"outside_rule": "inwards", "horizon": 4, "deadlock_rule": "weighted"}, 150),
        ({"outside_rule": "inwards", "switching_horizon": "SESE", "horizon": 9}, 40),
        ({"outside_rule": "inwards", "switching_horizon": "SESE", "bound_vph": 0.03}, 12),
    ],
    ids=lambda value: ",".join(map(str, value.values())) if isinstance(value, dict) else None,
)
def test_ideal_is_as_specified(drive: Drive, control: dict, n: int) -> None:
    changed = drive.with_control(**control)
    trace = random_trace(changed, n, seed=len(str(control)))
    decisions = ideal.run(changed, trace)
    expected = [Specified(changed, trace, row).decide() for row in range(n)]
    assert as_rows(decisions) == expected
    assert decisions.cycles is None
    assert not decisions.saturated.any()
    # The random states must reach the branches, or the comparison says little.
    searched = decisions.held == 0
    assert searched.sum() > n // 4
    assert (decisions.length[searched] > 0).any()


@pytest.mark.parametrize("kind", ["SE", "SESE"])
def test_every_branch_occurs(drive: Drive, kind: str) -> None:
    changed = drive.with_control(switching_horizon=kind)
    decisions = ideal.run(changed, random_trace(changed, 3000, seed=5))
    assert decisions.held.mean() > 0.02
    assert decisions.deadlock.mean() > 0.02
    assert (decisions.length > 1).mean() > 0.02
    assert not (decisions.held & decisions.deadlock).any()
    assert not decisions.length[(decisions.held | decisions.deadlock) == 1].any()


@pytest.mark.parametrize("kind", ["SE", "SESE"])
def test_pruning_changes_nothing(drive: Drive, kind: str) -> None:
    changed = drive.with_control(switching_horizon=kind, lambda_n=0.0)
    parameters = ideal.ideal_parameters(changed)
    trace = random_trace(changed, 400, seed=8)
    for k in range(len(trace)):
        row = (
            trace.x_m[k], trace.x_inv[k], trace.vdc[k], trace.iref[k], trace.omega_s[k],
            trace.omega_r[k], trace.s_prev[k],
        )  # fmt: skip
        quick = ideal._search(parameters, *row, True)
        full = ideal._search(parameters, *row, False)
        assert quick[:6] == full[:6]


def test_bounds_are_inclusive(drive: Drive) -> None:
    # A still state exactly on a bound: zero currents and flux, no voltage across the machine.
    on_bound = np.array([[drive.control.bound_vn, 0.5, 0.5, 0.5]])
    above = np.nextafter(on_bound, 1.0)
    for x_inv, held in ((on_bound, 1), (above, 0)):
        trace = MpdccTrace(
            x_m=np.zeros((1, 4)), x_inv=x_inv, vdc=np.array([2.0]), iref=np.zeros((1, 2)),
            omega_s=np.zeros(1), omega_r=np.zeros(1), s_prev=np.full((1, 3), 3),
        )  # fmt: skip
        decisions = ideal.run(drive, trace)
        assert decisions.held.tolist() == [held]
        assert decisions.deadlock.tolist() == [1 - held]


def test_margins_tell_the_two_best(drive: Drive) -> None:
    parameters = ideal.ideal_parameters(drive)
    trace = random_trace(drive, 200, seed=9)
    decisions = ideal.run(drive, trace)
    for k in range(len(trace)):
        held, deadlock, best, second = ideal.margins(
            parameters, trace.x_m[k], trace.x_inv[k], trace.vdc[k], trace.iref[k],
            trace.omega_s[k], trace.omega_r[k], trace.s_prev[k],
        )  # fmt: skip
        assert best <= second
        assert held == decisions.held[k]
        if not held:
            assert deadlock == decisions.deadlock[k]


def test_absurd_states_still_get_an_admissible_answer(drive: Drive) -> None:
    trace = random_trace(drive, 4, seed=3)
    trace.x_m[0] = 1e308
    trace.x_inv[1] = -1e308
    trace.omega_r[2] = 1e300
    trace.vdc[3] = 1e308
    decisions = ideal.run(drive, trace)
    for before, after in zip(trace.s_prev, decisions.s, strict=True):
        assert all(t in NEXT[s] for s, t in zip(before, after, strict=True))


def at_bounds(drive: Drive, n: int, current: float, neutral: float, phase: float) -> MpdccTrace:
    """States whose errors of i_a, v_n and v_ph_a are so many bounds, all others 0."""
    trace = random_trace(drive, n, 6)
    bounds = drive.bounds
    # 2^-n are exact in binary, so that a sum with a bound of that kind is, too
    x_m, x_inv = trace.x_m.copy(), trace.x_inv.copy()
    iref = np.zeros((n, 2))
    iref[:, 0] = 0.5
    x_m[:, 0], x_m[:, 1] = 0.5 - current * bounds[0], 0.0
    x_inv[:, 0] = neutral * bounds[3]
    x_inv[:, 1:] = 0.5
    x_inv[:, 1] += phase * bounds[4]
    return dataclasses.replace(trace, x_m=x_m, x_inv=x_inv, iref=iref, vdc=np.full(n, 2.0))


EXACT = {"bound_current": 0.0625, "bound_vn": 0.0625, "bound_vph": 0.0625}


@pytest.mark.parametrize("rule", ["dead", "inwards"])
@pytest.mark.parametrize("place", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (-1, 1, -1)])
def test_what_is_on_its_bound_is_inside(drive: Drive, rule: str, place: tuple[int, ...]) -> None:
    changed = drive.with_control(**EXACT, outside_rule=rule)
    trace = at_bounds(changed, 200, *place)
    other = drive.with_control(**EXACT)
    assert as_rows(ideal.run(changed, trace)) == as_rows(ideal.run(other, trace))
    assert (ideal.run(changed, trace).length > 0).any()


@pytest.mark.parametrize("place", [(1.25, 0, 0), (0, 1.25, 0), (0, 0, -1.25), (1.5, -1.5, 1.5)])
def test_what_is_outside_ends_every_length_unless_it_comes_back(
    drive: Drive, place: tuple[float, ...]
) -> None:
    dead = drive.with_control(**EXACT)
    inwards = dead.with_control(outside_rule="inwards")
    trace = at_bounds(dead, 200, *place)
    before, after = ideal.run(dead, trace), ideal.run(inwards, trace)
    np.testing.assert_array_equal(before.held, after.held)
    assert not before.length.any()
    assert before.deadlock[before.held == 0].all()
    assert (after.length > 0).sum() >= 20


def test_a_voltage_that_rests_outside_is_dead(drive: Drive) -> None:
    # all three phases at the neutral point draw no current from it but for rounding
    inwards = drive.with_control(outside_rule="inwards", horizon=5)
    parameters = ideal.ideal_parameters(inwards)
    rests = 0
    for x_m in (np.array([0.3, 0.1, 0.0, 1.0]), np.array([0.7, -0.35, 0.2, 0.9])):
        drawn = sum(ideal.phases(complex(x_m[0], x_m[1])))
        rests += drawn != 0.0
        for v_n in (0.051, -0.051):
            x_inv = np.array([v_n, 0.5, 0.5, 0.5])
            for s in ((3, 3, 3), (4, 3, 3)):
                row = x_m, x_inv, 2.0, x_m[:2].copy(), 0.0, 0.0, np.array(s)
                s_a, s_b, s_c, _, deadlock, length, _ = ideal.decide(parameters, *row)
                chosen = sum(p in (2, 3, 4, 5) for p in (s_a, s_b, s_c))
                assert deadlock or length == 0 or chosen in (1, 2)
