"""The core's netlist in a second simulator: GHDL's synthesis, Verilog, Verilator.

Sweep: two explorers of the paper's variant, one and two of the fast one; decisions
alone, every other configuration of the core whose area is published, where its netlist or the rows
are not those of decided.toml, with which it passed; the second level with two
explorers: SESE with and without a budget, with and without the prediction of k + 1,
the prediction alone, and one level after two in the same run; with either deadlock rule and either
outside rule where they are built in, the bits at random.
Stimulus: recorded rows of both drives, random drives, full ranges, words and parameters of any
content, the slowest decisions known; of SESE searches of closed loops and random drives and the
longest there is; measurements random but at the start edge, random idle clocks,
registers that begin with random contents.
Checks: every field of every decision against the bit-true model; deadlocks, holds and searches
occurred; a part of the cycle counts against the VHDL simulation, clock for clock; those of the
second level against its schedule, whether the budget ended it.
Timing: held as scripts/measure/budgets.toml says, none above the bound.
Does not prove: anything about a vendor's tools; see the synthesis reports.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mpdcc import formats as f
from directmpc.mpdcc.bit_true.fast import cost_words
from directmpc.mpdcc.coefficients import INDEX
from directmpc.mpdcc.program import COEFFICIENTS
from directmpc.mpdcc.variants import VARIANTS
from scripts.hdl import conversion as netlist
from scripts.hdl import mpdcc_rows as core
from scripts.hdl import netlist_check, states
from scripts.hdl.clocks import clocks_of, worst_cycles
from scripts.measure.synth import Configuration, configurations
from scripts.shared.tools import Generics
from tb.helpers import decided as decided_before
from tb.helpers.decided import Decided
from tb.rtl.mpdcc.mpdcc_core import second_level_rows

HELD = {variant: clocks_of("mpdcc_core", "hold", variant) for variant in VARIANTS}
HOLD = (
    *(f"c_{name}" for name in COEFFICIENTS),
    "bound_current", "bound_neutral", "bound_phase", "horizon", "weight_scale",
    "two_switchings", "budget", "compensate", "deadlock_rule", "outside_inwards",
)  # fmt: skip
OUTPUTS = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "saturated")
SECOND = 2  # explorers of the core with a second level; one netlist serves both tests of it
#: What the netlists that are not in `DECIDED` decided rightly before.
DECIDED_BEFORE = Path(__file__).with_name("decided.toml")
BOTH = 60  # rows that the VHDL simulation decides as well


def generics_of(explorers: int, variant: str, second: bool) -> Generics:
    """Generics of a core, those that differ from the defaults by name; `second`: all options."""
    found: Generics = {"EXPLORERS": explorers, "FOLDED": variant == "paper"}
    options = ("SECOND_LEVEL", "WEIGHTED_DEADLOCK", "INWARDS")
    return found | dict.fromkeys(options, True) if second else found


@pytest.fixture(scope="session")
def many_rows() -> dict[str, core.Rows]:
    found = {}
    for variant, chosen in VARIANTS.items():
        rng = np.random.default_rng(23)
        parts = [
            core.slow_rows(variant),
            core.random_rows(400, rng, variant),
            core.recorded_rows(200, rng, variant),
        ]
        for name in states.SHIPPED:
            drive = states.shipped(name)
            array = chosen.registers(drive).array()
            parts.append(core.of_trace(states.near(drive, 800, rng), array))
        found[variant] = core.join(parts)
    return found


def either_rule(rows: core.Rows, *, weighted: bool = True, inwards: bool = True) -> core.Rows:
    """The same rows, every other one or so by each rule that is built in."""
    chosen = np.random.default_rng(5).integers(0, 2, len(rows))
    for built_in, name, value in (
        (weighted, "deadlock_rule", chosen),
        (inwards, "outside_inwards", chosen[::-1]),
    ):
        if built_in:
            before = rows.model("fast")
            registers = rows.registers.copy()
            registers[:, INDEX[name]] = value
            rows = core.Rows(rows.measurements, rows.s_prev, registers)
            assert np.any(rows.model("fast") != before, axis=1).sum() >= 3
    return rows


def ports_of(verilog: Path) -> netlist_check.Ports:
    """Data ports of the core; parameters are held."""
    found = netlist_check.ports_of(verilog, "mpdcc_core")
    return netlist_check.Ports(found.inputs, found.outputs, HOLD)


def run(
    rows: core.Rows,
    generics: Generics,
    expected: np.ndarray,
    outputs: tuple[str, ...],
    cycles: list[int | None] | None = None,
) -> netlist_check.Result:
    """The netlist's answers to the rows, compared with what is expected of each output."""
    verilog = netlist.cached("mpdcc_core", generics)
    inputs = {
        **{name: rows.measurements[:, i].tolist() for i, name in enumerate(f.MEASUREMENTS)},
        **{f"s_prev_{x}": rows.s_prev[:, i].tolist() for i, x in enumerate("abc")},
        **{name: rows.registers[:, i].tolist() for i, name in enumerate(HOLD)},
    }
    return netlist_check.check(
        "mpdcc_core",
        generics,
        inputs,
        {name: expected[:, i].tolist() for i, name in enumerate(outputs)},
        cycles,
        ports=ports_of(verilog),
        verilog=verilog,
        seed=int(generics["EXPLORERS"]),
    )


#: Explorers, variant, and whether with all options.
DECIDED = ((1, "fast", False), (2, "paper", False), (SECOND, "fast", True))


@pytest.mark.parametrize(("explorers", "variant", "second"), DECIDED)
def test_the_netlist_decides_alike(
    many_rows: dict[str, core.Rows], explorers: int, variant: str, second: bool
) -> None:
    rows = many_rows[variant]
    if second:
        rows = either_rule(rows)
    expected = rows.model(variant)
    assert len(rows) >= 3000
    assert (expected[:, 4] == 1).sum() >= 300
    assert (expected[:, 3] == 1).sum() >= 300
    generics = generics_of(explorers, variant, second)
    result = run(rows, generics, expected, OUTPUTS)
    assert result.checked == len(rows)
    if variant == "fast" and not second:
        chooses = (expected[:, 3] | expected[:, 4]) == 0
        words = zip(rows.registers, rows.measurements, rows.s_prev, strict=True)
        costs = np.array([cost_words(*one) for one in words])
        assert chooses.sum() > 50
        assert np.array_equal(np.array(result.outputs["cost"])[chooses], costs[chooses])
    assert not result.mismatches, result.mismatches[:5]
    cycles = np.array(result.cycles)
    assert set(cycles[expected[:, 3] == 1]) == {HELD[variant]}

    some = np.r_[0:1, np.linspace(1, len(rows) - 1, BOTH).astype(int)]
    vhdl = core.simulate(rows.pick(some), explorers, variant, second=second)
    np.testing.assert_array_equal(vhdl.decisions, expected[some])
    np.testing.assert_array_equal(vhdl.cycles, cycles[some])
    assert cycles.max() <= vhdl.bound
    print(f"{explorers} explorers: {len(rows)} rows, slowest {cycles.max()}, bound {vhdl.bound}")


#: Options of the second level: two switchings, budgets in turn, prediction of k + 1.
LEVELS = (
    (1, (0,), 0),
    (1, (0,), 1),
    (1, (0, 27, 36, 150, 400), 0),
    (1, (2000, 64, 600, 48), 1),
    (0, (0, 9), 1),
    (0, (0, 9), 0),
)


@pytest.fixture(scope="session")
def two_level_rows() -> core.Rows:
    """The longest search, then every option after every other, all by the same rule."""
    parts = [second_level_rows.with_options(second_level_rows.longest(), 1, (0,), 0)]
    for seed, (two, limits, compensate) in enumerate(LEVELS):
        some = second_level_rows.rows_of(seed, 40, two, compensate)
        parts.append(second_level_rows.with_options(some, two, limits, compensate))
    rows = core.join(parts)
    order = np.random.default_rng(3).permutation(np.arange(1, len(rows)))
    return rows.pick(np.append(0, order))


def test_the_netlists_second_level_decides_alike(two_level_rows: core.Rows) -> None:
    explorers = SECOND
    rows = either_rule(two_level_rows)
    expected, schedule, nodes = second_level_rows.expected(rows, explorers)
    two = rows.registers[:, second_level_rows.TWO] == 1
    predicted = rows.registers[:, second_level_rows.COMPENSATE] == 1
    limited = rows.registers[:, second_level_rows.BUDGET] > 0
    cut, searched = expected[:, 7] == 1, nodes > 1
    for kind in (predicted, ~predicted):
        assert (kind & searched & ~cut).sum() >= 30
        assert (kind & cut).sum() >= 10
        assert (kind & limited & searched & ~cut).sum() >= 5
        assert (kind & (expected[:, 3] == 1)).sum() >= 3
        assert (kind & (expected[:, 4] == 1)).sum() >= 3
        assert (kind & ~two).sum() >= 100
    known = [int(clocks) or None for clocks in schedule]
    assert sum(clocks is not None for clocks in known) >= len(rows) // 3

    generics = generics_of(explorers, "fast", True)
    result = run(rows, generics, expected, (*OUTPUTS, "exhausted"), known)
    assert result.checked == len(rows)
    assert not result.mismatches, result.mismatches[:5]
    most = worst_cycles("fast", explorers, two_switchings=True)
    assert most - 8 <= result.cycles[0] <= most
    print(
        f"second level: {len(rows)} rows, {cut.sum()} cut, slowest {max(result.cycles)} of {most}"
    )


def others() -> list[Configuration]:
    """Configurations of the core whose area is published, but those decided with above."""
    done = [generics_of(*of) for of in DECIDED]
    measured = [one for one in configurations() if one.entity == "mpdcc_core"]
    return [one for one in measured if one.generics not in done]


@pytest.mark.parametrize("one", others(), ids=lambda one: one.name)
def test_every_netlist_that_is_measured_decides_alike(
    many_rows: dict[str, core.Rows],
    two_level_rows: core.Rows,
    one: Configuration,
    request: pytest.FixtureRequest,
) -> None:
    # what GHDL keeps in one conversion it may lose in another: see length_search
    variant = "paper" if one.generics.get("FOLDED", False) else "fast"
    rows, outputs = many_rows[variant], OUTPUTS
    if one.generics.get("SECOND_LEVEL", False):
        rows, outputs = two_level_rows, (*OUTPUTS, "exhausted")
    if variant == "fast":
        rows = either_rule(
            rows,
            weighted=bool(one.generics.get("WEIGHTED_DEADLOCK", False)),
            inwards=bool(one.generics.get("INWARDS", False)),
        )
    if one.generics.get("SECOND_LEVEL", False):
        expected, _, _ = second_level_rows.expected(rows, int(one.generics["EXPLORERS"]))
    else:
        expected = rows.model(variant)
    decided = Decided(DECIDED_BEFORE, request.config.getoption("--note-decided"))
    found = mark(rows, one.generics, expected, outputs)
    if decided.has(one.name, found):
        return
    result = run(rows, one.generics, expected, outputs)
    assert result.checked == len(rows) >= 200
    assert not result.mismatches, result.mismatches[:5]
    decided.passed(one.name, found)


def mark(
    rows: core.Rows, generics: Generics, expected: np.ndarray, outputs: tuple[str, ...] = OUTPUTS
) -> str:
    """Digest of a netlist with the rows that it is to decide, and how."""
    verilog = netlist.cached("mpdcc_core", generics)
    simulation = netlist_check.key("mpdcc_core", verilog, ports_of(verilog))
    return decided_before.digest(
        simulation, rows.measurements, rows.s_prev, rows.registers, expected,
        compared=outputs, seed=int(generics["EXPLORERS"]),
    )  # fmt: skip


def test_a_netlist_that_decides_otherwise_is_simulated(
    many_rows: dict[str, core.Rows], tmp_path: Path
) -> None:
    rows = many_rows["fast"].pick(slice(0, 20))
    generics = generics_of(1, "fast", False)
    expected = rows.model("fast")
    known = Decided(tmp_path / "decided.toml", note=True)
    known.passed("it", mark(rows, generics, expected))
    known = Decided(known.path)
    assert known.has("it", mark(rows, generics, expected))
    assert not known.has("another", mark(rows, generics, expected))
    assert not known.has("it", mark(rows, generics_of(2, "fast", False), expected))
    assert not known.has("it", mark(rows.pick(slice(0, 19)), generics, expected[:19]))
    assert not known.has("it", mark(rows, generics, expected, OUTPUTS[1:]))
    expected[-1, 0] ^= 1
    assert not known.has("it", mark(rows, generics, expected))
