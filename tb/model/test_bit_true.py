"""The paper variant's bit-true model: every decision as documented, fast.

Sweep: both shipped drives, 200 random drives over the specified ranges, five speeds.
Stimulus: random and corner words; closed loops of the ideal controller with the bit-true one as
its shadow.
Checks: decisions against a slow second writing of them in integers; flags of saturation; agreement
with the ideal controller; coefficients; generated package; speed. Widths: tb/proofs.
Timing: 20,000 decisions a second, asserted with a margin for a busy machine.
Does not prove: anything about the RTL; see tb/mpdcc.
"""

from __future__ import annotations

import itertools
import time
from fractions import Fraction

import numpy as np
import pytest

from directmpc.mpdcc import closed_loop, ideal
from directmpc.mpdcc import coefficients as co
from directmpc.mpdcc import formats as f
from directmpc.mpdcc import inverter as anpc
from directmpc.mpdcc import program as programs
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.bit_true import paper as bit_true
from directmpc.mpdcc.closed_loop import OperatingPoint
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.program import PROGRAMS
from scripts.generate import core_shells
from scripts.hdl import constants_package as vhdl_package
from scripts.hdl import converter_package, states
from scripts.hdl.mpdcc_rows import DECIDE
from tb.helpers import plain, plain_states


@pytest.mark.parametrize("kind", ["near", "wide", "any words", "any registers"])
def test_decisions_are_those_of_the_documentation(kind: str) -> None:
    rng = np.random.default_rng(len(kind))
    seen = np.zeros(3, dtype=int)
    for k in range(60):
        drive = states.shipped(states.SHIPPED[k % 2]) if k % 4 else states.random_drive(rng)
        array = (
            states.any_registers(rng)
            if kind == "any registers"
            else co.registers(drive, "paper").array()
        )
        trace = states.near(drive, 1, rng, 0.8) if kind == "near" else states.wide(1, rng, 1.3)
        row = states.words(1, rng)[0] if kind.startswith("any") else states.trace_words(trace)[0]
        s_prev = trace.s_prev[0]
        expected = plain.decide(
            plain_states.plain_node(array, row),
            plain_states.plain_limits(array),
            [int(p) for p in s_prev],
        )
        found = bit_true.decide_words(array, row, s_prev)
        assert tuple(int(v) for v in found) == tuple(int(v) for v in expected), (k, row, s_prev)
        seen += [found[3], found[4], found[6]]
    if kind == "near":
        assert seen[0] >= 3
        assert seen[1] >= 3


@pytest.mark.parametrize("seed", range(4))
def test_a_length_is_the_last_step_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(2000):
        bound = int(rng.choice([0, 1, 65535, rng.integers(0, 65536)]))
        slope = int(rng.integers(-(2**23), 2**23)) >> int(rng.integers(0, 24))
        offset = int(rng.integers(-bound - 2, bound + 3))
        horizon = int(rng.choice([1, 63, rng.integers(1, 64)]))
        length = 0
        if abs(offset) <= bound:
            while length < horizon and abs(offset + (length + 1) * slope) <= bound:
                length += 1
        assert common.search_length(offset, slope, bound, horizon) == length


def test_fast_enough(drive: Drive) -> None:
    trace = states.recorded(drive, 20_000, 1.0)
    bit_true.run(drive, trace.rows(slice(0, 10)))
    best = np.inf
    for _ in range(3):
        began = time.perf_counter()
        bit_true.run(drive, trace)
        best = min(best, time.perf_counter() - began)
    assert len(trace) / best > 20_000


def test_values_outside_their_words_saturate_and_flag(drive: Drive) -> None:
    rng = np.random.default_rng(4)
    inside = states.wide(500, rng)
    words, clipped = common.encode(inside)
    assert not clipped.any()
    low = np.array([m.low for m in f.MEASUREMENTS.values()])
    high = np.array([m.high for m in f.MEASUREMENTS.values()])
    assert (words > low).all()
    assert (words < high).all()
    outside = states.wide(500, rng, beyond=3.0)
    words, clipped = common.encode(outside)
    assert ((words >= low) & (words <= high)).all()
    at_end = ((words == low) | (words == high)).any(axis=1)
    assert clipped.sum() > 400
    assert at_end[clipped].all()
    assert (bit_true.run(drive, outside).saturated[clipped] == 1).all()
    for k in (0, 1, 250):
        one, flag = common.encode_row(
            outside.x_m[k], outside.x_inv[k], outside.vdc[k], outside.iref[k],
            outside.omega_s[k], outside.omega_r[k],
        )  # fmt: skip
        np.testing.assert_array_equal(one, words[k])
        assert flag == clipped[k]


@pytest.mark.parametrize("name", states.SHIPPED)
def test_nearly_every_decision_is_the_ideal_controllers(name: str) -> None:
    drive = states.shipped(name)
    steps = differing = searched = searched_differing = 0
    for speed in (0.2, 0.4, 0.6, 0.8, 1.0):
        result = closed_loop.simulate(
            drive, ideal.decide, ideal.ideal_parameters(drive),
            OperatingPoint(speed, current=1.0), 6000, settle=500,
            shadow=bit_true.decide, shadow_parameters=co.registers(drive, "paper").array(),
        )  # fmt: skip
        count = result.shadow_count()
        steps, differing = steps + count.steps, differing + count.differing
        searched += count.searched
        searched_differing += count.searched_differing
    print(f"{name}: {differing / steps:.2%} of steps, {searched_differing / searched:.2%} searches")
    assert steps >= 20_000
    assert differing / steps <= 0.016
    assert searched_differing / searched <= 0.06


@pytest.mark.parametrize("variant", PROGRAMS)
def test_registers_of_any_drive_are_representable(variant: str) -> None:
    rng = np.random.default_rng(8)
    worst = 0.0
    for _ in range(200):
        drive = states.random_drive(rng)
        registers = co.registers(drive, variant)
        ports = registers.ports()
        for name, value in ports.items():
            if name.startswith("c_"):
                assert abs(value) < 2**15, name
            else:
                assert 0 <= value < {"horizon": 64, "weight_scale": 4}.get(name, 2**16), name
        for bound in ("bound_current", "bound_neutral", "bound_phase"):
            assert 100 <= ports[bound] <= f.BOUND_HIGH[variant], (bound, drive)
        # what decides over lengths: the voltage's and the capacitors' slopes, and the errors
        real = co._per_unit(drive, co._prediction(drive, variant)[0])
        for name in ("error_alpha", "error_neutral", "error_phase", "forced_voltage"):
            exact = real[name] * registers.unit
            worst = max(worst, abs(registers.coefficients[name] / exact - 1))
    print(f"largest relative error of a leading coefficient: {worst:.2e}")
    assert worst < 0.02


def test_registers_refuse_what_does_not_fit(drive: Drive) -> None:
    beyond_any_file = drive.control.model_copy(update={"lambda_n": 1e6})
    with pytest.raises(ValueError, match="lambda_n"):
        co.registers(drive.model_copy(update={"control": beyond_any_file}), "paper")


@pytest.mark.parametrize(
    ("setting", "port", "value"),
    [
        ({"switching_horizon": "SESE"}, "two_switchings", 1),
        ({"delay_compensation": True}, "compensate", 1),
        ({"deadlock_rule": "weighted"}, "deadlock_rule", 1),
    ],
)
def test_registers_refuse_what_the_paper_variant_cannot_do(
    drive: Drive, setting: dict, port: str, value: int
) -> None:
    asked = drive.with_control(**setting)
    assert co.registers(asked, "fast").ports()[port] == value
    assert co.registers(drive, "paper").ports()[port] == 0
    (key,) = setting
    with pytest.raises(ValueError, match=rf"^control\.{key}: got .*; the variant paper serves"):
        co.registers(asked, "paper")


def test_a_budget_without_sese_has_no_effect(drive: Drive) -> None:
    asked = drive.with_control(budget=7)
    assert co.registers(asked, "fast").ports()["budget"] == 7
    assert co.registers(asked, "paper") == co.registers(drive, "paper")


@pytest.mark.parametrize(
    ("run", "result", "product", "why"),
    [
        ("fast", "flux_speed_alpha", "reference_speed_alpha", "not of one block"),
        ("fast", "error_alpha", "reference_speed2_alpha", "different alignments"),
        ("fast", "phase_alpha", "reference_speed2_alpha", "is read after"),
        ("successor", "forced_b", "reference_speed_alpha", "is read after"),
    ],
)
def test_no_result_takes_a_register_that_is_still_read(
    run: str, result: str, product: str, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(programs.REGISTERS, run, {result: product})
    with pytest.raises(ValueError, match=f"{product}.*{why}"):
        programs.check_registers(run)


def test_the_generated_packages_are_up_to_date() -> None:
    rtl = vhdl_package.Path(vhdl_package.__file__).parents[2] / "rtl"
    constants = (rtl / "mpdcc" / "directmpc_constants.vhd").read_text(encoding="utf-8")
    assert constants == vhdl_package.text()
    leg = (rtl / "converter" / "converter_leg.vhd").read_text(encoding="utf-8")
    assert leg == converter_package.text()
    shell = (rtl / "mpdcc" / "mpdcc_core.vhd").read_text(encoding="utf-8")
    assert shell == core_shells.text(core_shells.MPDCC)


def test_equal_shares_of_effort_and_length_cost_the_same() -> None:
    lengths = range(1, 2**f.LENGTH_WIDTH)
    efforts = range(1, 3 * int(anpc.TRANSITION_WEIGHT.max()) + 1)
    costs: dict[Fraction, set[int]] = {}
    for length, effort in itertools.product(lengths, efforts):
        word = effort * int(f.RECIPROCALS[length])
        costs.setdefault(Fraction(effort, length), set()).add(word)
        assert abs(word * length - effort * f.COST_UNIT) <= 1e-5 * effort * f.COST_UNIT
        # what the paper variant's shortest length of use relies on
        assert word * length >= effort << f.RECIPROCAL_FRACTION
    assert all(len(words) == 1 for words in costs.values())
    ordered = [costs[share].pop() for share in sorted(costs)]
    assert all(low < high for low, high in itertools.pairwise(ordered))


@pytest.mark.parametrize("variant", ["fast", "paper"])
@pytest.mark.parametrize("words", [-1, 1])
def test_registers_of_another_length_are_refused(variant: str, words: int) -> None:
    array = co.registers(states.shipped("anpc5l_6kv"), variant).array()
    wrong = array[:words] if words < 0 else np.append(array, 0)
    with pytest.raises(ValueError, match="as many words"):
        DECIDE[variant](wrong, np.zeros(13, dtype=np.int64), np.zeros(3, dtype=np.int64))
