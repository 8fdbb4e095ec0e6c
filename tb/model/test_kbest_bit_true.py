"""The bit-true K-best model: against a slow second writing, against the ideal, at its ends."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from directmpc import load_drive, simulate
from directmpc.kbest import bit_true, formats, ideal
from directmpc.kbest.coefficients import Registers, registers
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc import closed_loop, metrics
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc.closed_loop import OperatingPoint
from tb.model.test_kbest import NAMES, random_rows, row_of, shipped


def clip(value: int, bits: int) -> int:
    return min(max(value, -(2 ** (bits - 1))), 2 ** (bits - 1) - 1)


def near(value: int, shift: int) -> int:
    return (value + (1 << (shift - 1))) >> shift


class Slow:
    """Section 10.7 of the specification once more: Python integers, lists, sorting.

    `saturated` is set where a word is limited.
    """

    def __init__(self, found: Registers) -> None:
        self.r = found.values
        self.beam, self.stages = found.beam, found.stages
        self.saturated = False

    def word(self, value: int, bits: int) -> int:
        """The value, limited to a word."""
        limited = clip(value, bits)
        self.saturated |= limited != value
        return limited

    def total(self, value: int) -> int:
        """A sum of products as a word of the terms."""
        return self.word(near(value, 17), 18)

    def turn(self, vector: tuple[int, int]) -> tuple[int, int]:
        """The vector a step on."""
        u, w = vector
        less, sine_u, sine_w = self.angle
        return (
            self.total((u << 17) - less * u - sine_u * w),
            self.total((w << 17) - less * w + sine_w * u),
        )

    def begin(self, m: dict[str, int]) -> None:
        """Terms of the whole decision."""
        r = self.r
        omega_s, omega_r = 4 * m["omega_s"], 4 * m["omega_r"]
        sine_u = self.total(omega_s * r["angle"])
        half = self.total(sine_u * round(2**17 / 6))
        self.angle = self.total(sine_u * half), sine_u, self.total(sine_u * round(2**17 / 3))
        less, _, sine_w = self.angle
        root = round(2**17 / 3**0.5)
        self.reference = 4 * m["iref_alpha"], self.total(4 * m["iref_beta"] * root)
        flux_u, flux_w = 4 * m["psir_alpha"], self.total(4 * m["psir_beta"] * root)
        straight = self.total((r["flux_0"] << 17) + self.total(omega_r**2) * r["flux_2"])
        across_u, across_w = (self.total(omega_r * r[f"flux_{x}"]) for x in "uw")
        u, w = self.reference
        total_u = -less * u - sine_u * w + r["decay_1"] * u - straight * flux_u + across_u * flux_w
        total_w = -less * w + sine_w * u + r["decay_1"] * w - straight * flux_w - across_w * flux_u
        self.drift = self.total(total_u), self.total(total_w)
        self.level = [self.total(m["v_dc"] * r[f"level_{n}"]) for n in (1, 2)]

    def stage(self, n: int) -> tuple[list[int], list[int], list[int]]:
        """Drift of a stage, charges on v_n and on v_ph."""
        references, drifts = [self.reference], [self.drift]
        for _ in range(n):
            references.append(self.turn(references[-1]))
            drifts.append(self.turn(drifts[-1]))
        self.reference, self.drift = references[-1], drifts[-1]
        if n == 1:
            drift = list(drifts[0])
            u, w = (a + b for a, b in zip(*references, strict=True))
        else:
            drift = [
                self.total((a + b << 17) - a * self.r["decay_1"])
                for a, b in zip(drifts[0], drifts[1], strict=True)
            ]
            u, w = (2 * x for x in references[1])
        # halves of the currents
        a, b = self.total(u << 15), self.total(3 * w - u << 14)
        charges = [
            [
                self.word(self.total(i * self.r[name]) << (n - 1), 16)
                for i in (a, b, -a - b)
            ]
            for name in ("neutral", "capacitor")
        ]  # fmt: skip
        return drift, *charges

    def child(self, node: Any, positions: Any, n: int, stage: Any) -> list[int]:
        """u, w, v_n and the deviations of v_ph behind a stage."""
        state, drift, forced = node[0], stage[0], self.r[f"forced_{n}"]
        on_n = state[2] * forced >> 15
        on_phase = [d * forced >> 15 for d in state[3:]]
        g = [
            (anpc.LEVEL[s] * self.level[n - 1]) + anpc.NEUTRAL[s] * on_n + anpc.CAPACITOR[s] * d
            for s, d in zip(positions, on_phase, strict=True)
        ]
        kept = [x - ((x >> 2) * self.r[f"decay_{n}"] >> 15) + d
                for x, d in zip(state[:2], drift, strict=True)]  # fmt: skip
        v_n = state[2] - sum(
            anpc.NEUTRAL_CURRENT[s] * q for s, q in zip(positions, stage[1], strict=True)
        )
        return [
            self.word(int(kept[0] - 2 * g[0] + g[1] + g[2]), 19),
            self.word(int(kept[1] - g[1] + g[2]), 19),
            self.word(int(v_n), 16),
            *(
                self.word(int(d + anpc.CAPACITOR_CURRENT[s] * q), 16)
                for s, d, q in zip(positions, state[3:], stage[2], strict=True)
            ),
        ]

    def costs(self, now: list[int], before: list[int], n: int) -> tuple[int, int]:
        """What a stage adds to J, and what the key adds to that."""

        def ahead(a: int, b: int, shift: int, low: int) -> int:
            return clip((a + ((a - b) << shift)) >> low, 14) ** 2

        def excess(value: int, name: str) -> int:
            size = value if value >= 0 else -1 - value
            over = min(max(0, size - self.r[f"bound_{name}"]), 2**13 - 1)
            return over**2 >> (15 - self.r[f"weight_{name}"] - n)

        u, w, v_n, *d = now
        cost = (
            ((u >> 2) ** 2 >> (15 - n)) + 3 * ((w >> 2) ** 2 >> (15 - n)) + excess(v_n, "neutral")
        )
        rank = ahead(u, before[0], 4 - n, 6) >> 7
        rank += 3 * (ahead(w, before[1], 4 - n, 6) >> 7) + (ahead(v_n, before[2], 3 - n, 2) >> 8)
        for a, b in zip(d, before[3:], strict=True):
            cost += excess(a, "phase")
            rank += ahead(a, b, 3 - n, 2) >> 12
        return cost, rank

    def decide(self, words: Any, s_prev: Any, plan: list[int]) -> list[int]:
        """Code, the next plan, the key."""
        m = dict(zip(formats.MEASUREMENTS, (int(w) for w in words), strict=True))
        self.saturated = False
        self.begin(m)
        odd, short, most = plan[-1] & 1, self.r["short_stages"], 2**22 - 1
        root = round(2**17 / 3**0.5)
        state = [
            4 * (m["iref_alpha"] - m["is_alpha"]),
            near(4 * (m["iref_beta"] - m["is_beta"]) * root, 17),
            m["v_n"] >> 2,
            *(2 * m[f"v_ph_{x}"] - m["v_dc"] >> 2 for x in "abc"),
        ]
        nodes: list[Any] = [(state, tuple(int(s) for s in s_prev), 0, ())]
        if self.r["compensate"]:
            stage = self.stage(1)
            nodes = [(self.child(nodes[0], nodes[0][1], 1, stage), nodes[0][1], 0, ())]
        for j in range(self.stages):
            n = 1 if j < short - odd else 2
            stage = self.stage(n)
            found = []
            for order, node in enumerate(nodes):
                children = {0: (node[1], 0)}
                for x in range(3):
                    s = node[1][x]
                    for i, t in enumerate(t for t in anpc.NEXT_POSITIONS[s] if t != s):
                        weight = anpc.TRANSITION_WEIGHT[int(stage[2][x] < 0), s, t]
                        moved = (*node[1][:x], t, *node[1][x + 1 :])
                        children[1 + 3 * x + i] = moved, int(weight)
                planned = plan[j] if plan[j] in children else 0
                for code, (positions, turn_ons) in children.items():
                    now = self.child(node, positions, n, stage)
                    cost, rank = self.costs(now, node[0], n)
                    cost += node[2] + self.r["effort"] * turn_ons
                    self.saturated |= cost > most
                    cost = min(cost, most)
                    key = min(cost + rank, most)
                    warm = order == 0 and code == planned and j < self.stages - 1
                    entry = now, positions, cost, (*node[3], code)
                    found.append((not warm, key, len(found), entry))
            found.sort(key=lambda one: one[:3])
            nodes = []
            for *_, entry in found:
                if len(nodes) < self.beam and sum(k[1] == entry[1] for k in nodes) < 2:
                    nodes.append(entry)
        codes = list(found[0][3][3])
        following = [*codes[1:], 0]
        if odd:
            following[short - 1 :] = [0, *codes[short:]]
        return [codes[0], *following, 1 - odd, found[0][1]]


def random_words(rng: np.random.Generator, rows: int, extreme: float) -> np.ndarray:
    """Words of the ports: some of every width, `extreme` of them at the ends."""
    words = np.empty((rows, len(formats.MEASUREMENTS)), np.int64)
    for n, fmt in enumerate(formats.MEASUREMENTS.values()):
        words[:, n] = rng.integers(fmt.low, fmt.high + 1, rows) >> rng.integers(0, 9, rows)
        ends = rng.random(rows) < extreme
        words[ends, n] = rng.choice([fmt.low, fmt.high], ends.sum())
    return words


SETTINGS: list[dict[str, Any]] = [
    {},
    {"beam": 3, "short_stages": 1, "long_stages": 5, "weight_vn": 1.0},
    {"beam": 1, "delay_compensation": True, "weight_vph": 256.0},
    {"beam": 16, "long_stages": 2, "lambda_u": 0.1, "delay_compensation": True},
]


def agree(drive: KbestDrive, words: np.ndarray, rng: np.random.Generator) -> tuple[int, int]:
    """Compare both writings on rows of words; how many saturate, how many distinct codes."""
    parameters = bit_true.parameters_of(drive)
    slow = Slow(registers(drive))
    saturated, codes = 0, set()
    for row in words:
        plan = rng.integers(-2, 12, slow.stages + 1)
        s_prev = rng.integers(0, 8, 3)
        following = np.empty_like(plan)
        code, flag, _, key = bit_true.decide_words(parameters, row, s_prev, plan, following)
        assert [code, *following, key] == slow.decide(row, s_prev, plan.tolist())
        assert flag == slow.saturated
        saturated += flag
        codes.add(int(code))
    return saturated, len(codes)


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_both_writings_agree_on_states_near_the_reference(settings: dict[str, Any]) -> None:
    rng = np.random.default_rng(5)
    rows = random_rows(rng, 25, 0.05)
    words = np.array([bit_true.encode_row(*row_of(rows, k)[:-1])[0] for k in range(len(rows))])
    saturated, codes = agree(shipped(**settings), words, rng)
    assert not saturated
    assert codes > 4


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_both_writings_agree_on_any_words(settings: dict[str, Any]) -> None:
    rng = np.random.default_rng(6)
    some = agree(shipped(**settings), random_words(rng, 20, 0.0), rng)
    all_ends = agree(shipped(**settings), random_words(rng, 20, 1.0), rng)
    assert all_ends[0] > 0, "the ends of the words saturate"
    assert some[1] > 2


def test_a_decision_is_seldom_unlike_the_ideal_ones() -> None:
    """Both have the ideal plan in every step, so that each step is judged by itself."""
    differing = steps = 0
    for name in NAMES:
        for speed in (0.3, 1.0):
            drive = shipped(name)
            run = closed_loop.simulate(
                drive, ideal.decide, ideal.parameters_of(drive), OperatingPoint(speed), 1500,
                settle=200, disturbance=0.0,
            )  # fmt: skip
            rows = run.trace()
            exact, model = ideal.parameters_of(drive), bit_true.parameters_of(drive)
            other = np.empty_like(exact.plan)
            for k in range(len(rows)):
                row = row_of(rows, k)
                words, clipped = bit_true.encode_row(*row[:-1])
                code, saturated, _, _ = bit_true.decide_words(
                    model, words, row[-1], exact.plan, other
                )
                assert not saturated
                assert not clipped
                following = np.empty_like(exact.plan)
                differing += int(code != ideal.search(exact, *row, exact.plan, following)[0])
                exact.plan[:] = following
                steps += 1
    assert differing / steps < 0.01


def test_the_distortion_is_the_ideal_ones() -> None:
    """Means of four starts; a loop is chaotic, so single runs differ by some per cent."""
    products: dict[Any, list[float]] = {ideal: [], bit_true: []}
    shares = []
    for engine, found in products.items():
        for name in NAMES:
            drive = shipped(name)
            for speed in (0.6, 1.0):
                for seed in range(4):
                    run = closed_loop.simulate(
                        drive, engine.decide, engine.parameters_of(drive), OperatingPoint(speed),
                        3000, settle=400, seed=seed, disturbance=0.0,
                    )  # fmt: skip
                    summary = metrics.summarise(drive, run)
                    found.append(summary.switching.per_device * summary.thd_mean)
                    outside = metrics.deviations(run)[:, 3:] > drive.bounds[3:]
                    shares.append(outside.any(axis=1).mean())
                    assert (summary.violations[3:] < 0.03).all()
    exact, model = (np.mean(found) for found in products.values())
    assert model == pytest.approx(exact, rel=0.02)
    assert np.mean(shares) < 0.02, "the capacitors are seldom outside their bounds"


def test_candidates_do_not_exceed_their_bound() -> None:
    rng = np.random.default_rng(8)
    for settings in ({}, {"beam": 16, "long_stages": 16}):
        drive = shipped(**settings)
        parameters = bit_true.parameters_of(drive)
        found = registers(drive)
        plan = np.zeros(found.stages + 1, np.int64)
        following = np.empty_like(plan)
        most = 0
        for row in random_words(rng, 60, 0.1):
            code, _, count, _ = bit_true.decide_words(
                parameters, row, np.array([3, 4, 3]), plan, following
            )
            most = max(most, count)
            assert 0 <= code <= 9
        assert most <= 10 + (found.stages - 1) * 10 * found.beam


def test_delay_is_compensated_by_the_model() -> None:
    at_once, delayed = (
        simulate(shipped(delay_compensation=on), "model", steps=1200, settle=200).thd()
        for on in (False, True)
    )
    assert delayed < 1.15 * at_once


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"control": {"weight_vn": 100.0}}, r"control.weight_vn: got 100; the core needs a power"),
        ({"control": {"weight_vph": 0.0}}, r"control.weight_vph: got 0; the core needs a power"),
        (
            {"machine": {"xls": 0.03, "xlr": 0.03}, "control": {"ts": 200e-6}},
            r"machine: the core's coefficient flux_u would be -?\d+; it holds -131071 to 131071",
        ),
    ],
)
def test_what_does_not_fit_is_refused(change: dict[str, Any], message: str) -> None:
    drive = load_drive(NAMES[0]).changed(**change)
    assert isinstance(drive, KbestDrive)
    with pytest.raises(ValueError, match=message):
        registers(drive)
    with pytest.raises(ValueError, match=message):
        simulate(drive, "model", steps=3)


def test_registers_are_in_the_order_of_the_ports() -> None:
    found = registers(shipped(beam=5))
    assert tuple(found.values) == formats.COEFFICIENTS + formats.SETTINGS
    assert found.array().tolist() == [*found.values.values(), 5, 12]
    assert dataclasses.replace(found, beam=8).beam == 8
