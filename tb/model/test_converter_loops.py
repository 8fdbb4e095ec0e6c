"""Every converter in closed loop, and what refuses one that it does not serve.

Sweep: the converters that ship, each with the machine of `npc3l_3kv3`; SE and SESE; ideal
controllers, the bit-true model, the exact plant; K-best's ideal controller.
Checks: the loop keeps its bounds and switches along the graph; the model decides as the ideal
controller does; a converter without capacitors has none in its state; the plant follows the matrix
exponential of its equations; `simulate` and `decide` take such a drive; positions that a converter
has not got, and what is built for the usual one alone, are refused.
Does not prove: the RTL, see tb/rtl/mpdcc/mpdcc_core/test_converters.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from directmpc import StateError, decide, load_drive, simulate
from directmpc.csv_table import TraceError
from directmpc.fmu.variables import system_of
from directmpc.host.registers import values
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc import closed_loop, ideal, metrics, tables, trace
from directmpc.mpdcc.bit_true import fast, paper
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.plant import Plant


def drive_of(name: str) -> Drive:
    drive = load_drive("npc3l_3kv3")
    assert isinstance(drive, Drive)
    return drive.changed(inverter={"topology": name})


@pytest.mark.parametrize("name", tables.NAMES)
def test_a_loop_keeps_its_bounds(name: str) -> None:
    drive = drive_of(name)
    leg = drive.converter
    point = closed_loop.OperatingPoint(0.6)
    parameters = ideal.ideal_parameters(drive)
    found = closed_loop.simulate(drive, ideal.decide, parameters, point, 3000, settle=400, seed=2)
    summary = metrics.summarise(drive, found)
    assert 0.04 < summary.thd_mean < 0.09
    assert summary.violations.max() < 0.04
    assert summary.deadlock_share < 0.12
    assert 0.6 < summary.held_share < 0.95
    before, after = found.positions[:-1].ravel(), found.positions[1:].ravel()
    walked = {(s, t) for s, t in zip(before.tolist(), after.tolist(), strict=True)}
    edges = {(s, t) for s, row in enumerate(leg.next_positions) for t in row}
    assert walked <= edges
    assert len(walked) >= 0.9 * len(edges)
    assert found.state[:, 4].any() == leg.neutral.any()
    assert (found.state[:, 5:] != 0).any() == (leg.capacitor_share != 0)


@pytest.mark.parametrize("horizon", ["SE", "SESE"])
@pytest.mark.parametrize("name", tables.NAMES)
def test_the_model_decides_as_the_ideal_controller(name: str, horizon: str) -> None:
    drive = drive_of(name).with_control(switching_horizon=horizon, budget=0)
    found = closed_loop.simulate(
        drive, fast.decide, registers(drive, "fast").array(), closed_loop.OperatingPoint(0.6), 4000,
        settle=400, shadow=ideal.decide, shadow_parameters=ideal.ideal_parameters(drive),
    )  # fmt: skip
    assert found.shadow is not None
    differing = np.any(found.decisions.s != found.shadow.s, axis=1)
    assert differing.mean() <= (0.0125 if horizon == "SESE" else 0.0025)
    assert not found.decisions.saturated.any()


@pytest.mark.parametrize("name", tables.NAMES)
def test_the_paper_variant_decides_too(name: str) -> None:
    drive = drive_of(name).with_papers_rules()
    found = closed_loop.simulate(
        drive, paper.decide, registers(drive, "paper").array(), closed_loop.OperatingPoint(0.6),
        1500, settle=300,
    )  # fmt: skip
    assert metrics.summarise(drive, found).violations.max() < 0.1
    assert set(found.decisions.s.ravel().tolist()) == set(range(drive.converter.positions))


@pytest.mark.parametrize("name", tables.NAMES)
def test_the_plant_is_the_matrix_exponential(name: str) -> None:
    plant = Plant(drive_of(name), 0.6)
    rng = np.random.default_rng(3)
    for _ in range(5):
        s = rng.integers(0, plant.leg.positions, 3)
        state = plant.state.copy()
        a, b = plant.system(s)
        whole = np.zeros((9, 9))
        whole[:8, :8], whole[:8, 8] = a, b * plant.vdc
        expected = (expm(whole * plant.data.ts) @ [*state, 1.0])[:8]
        assert plant.step(s) == pytest.approx(expected, abs=1e-12)
        voltage = plant.leg.phase_voltages(s, plant.vdc, state[4], state[5:])
        current = np.array([[1, 0], [-0.5, 0.75**0.5], [-0.5, -(0.75**0.5)]]) @ state[:2]
        # no power is lost: what leaves the leg comes from the link's halves and the capacitors
        drawn = voltage @ current
        link = (plant.leg.half_dc[s] * plant.vdc / 2) @ current
        neutral = state[4] * (plant.leg.neutral_current[s] @ current)
        capacitors = -(plant.leg.capacitor_current[s] * state[5:]) @ current
        assert drawn == pytest.approx(link + neutral + capacitors, abs=1e-12)


@pytest.mark.parametrize("engine", ["ideal", "model"])
def test_simulate_and_decide_take_such_a_drive(engine: str) -> None:
    drive = load_drive("npc3l_3kv3")
    result = simulate(drive, engine, steps=40)
    table = result.table()
    assert result.applied.max() <= 2
    row = {column: column_values[1] for column, column_values in table.items()}
    assert all(0 <= s <= 2 for s in decide(drive, row, engine).apply)


def test_kbest_serves_a_converter_of_a_file() -> None:
    drive = load_drive("anpc5l_3kv3_kbest")
    assert isinstance(drive, KbestDrive)
    result = simulate(drive.changed(inverter={"topology": "npc3l"}), steps=800)
    table = result.table()
    error = [table[f"iref_{axis}"][200:] - table[f"is_{axis}"][200:] for axis in ("alpha", "beta")]
    assert 0.01 < np.sqrt(np.mean(np.square(error))) < 0.1
    assert result.applied.max() == 2
    with pytest.raises(ValueError, match=r'inverter\.topology: got "npc3l"'):
        simulate(drive.changed(inverter={"topology": "npc3l"}), "model", steps=1)


def test_a_position_that_there_is_not(tmp_path: Path) -> None:
    drive = load_drive("npc3l_3kv3")
    assert isinstance(drive, Drive)
    result = simulate(drive, steps=3)
    row = {column: column_values[1] for column, column_values in result.table().items()}
    with pytest.raises(StateError, match="npc3l has the positions 0 to 2"):
        decide(drive, row | {"s_a": 3})
    file = tmp_path / "trace.csv"
    result.write_trace(file)
    lines = file.read_text(encoding="utf-8").splitlines()
    header, first = lines[0].split(","), lines[1].split(",")
    first[header.index("s_a")] = "3"
    file.write_text("\n".join([lines[0], ",".join(first)]) + "\n", encoding="utf-8")
    with pytest.raises(TraceError, match="0 to 2"):
        trace.read_trace(file, drive)


def test_a_converter_has_a_system_of_its_own() -> None:
    assert not any("v_ph" in said for said in values(drive_of("npc3l")).missing)
    assert system_of(drive_of("npc3l")) == "mpdcc_system_npc3l"
