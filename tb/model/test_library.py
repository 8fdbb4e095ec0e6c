"""The library as a user's own program sees it: load_drive, decide, simulate, own controllers.

Sweep: shipped drives of both kinds; ideal and bit-true; step by step and compiled; rows as records
and as columns; wrong arguments of every kind.
Stimulus: closed loops from the steady state, rows of a trace.
Checks: one decision is the replay's of the same row; a result's trace replays to its decisions; the
loop holds current, torque and flux at what is asked for; both loops decide alike; messages.
Timing: none.
Does not prove: the arithmetic of the controllers, see test_ideal, test_bit_true*, test_mptc_model.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import directmpc
from directmpc import (
    Controller,
    Drive,
    IdealController,
    ModelController,
    MpdccDecision,
    MpdccState,
    MptcDrive,
    MptcState,
    StateError,
    decide,
    load_drive,
    simulate,
)
from directmpc.api import simulation
from directmpc.host.lockstep import BoardController
from directmpc.host.protocol import Decision as Answer
from directmpc.host.protocol import Flag
from directmpc.mptc import bit_true
from scripts.commands import replay

NAMES = ("anpc5l_6kv", "motulator_2kw2")


def rows_of(result: directmpc.SimulationResult) -> list[dict[str, float]]:
    """Rows of a result's table."""
    table = result.table()
    return [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]


def test_every_public_name_exists() -> None:
    for name in directmpc.__all__:
        assert getattr(directmpc, name).__doc__
    assert set(directmpc.__all__) <= set(dir(directmpc))
    with pytest.raises(AttributeError, match="'directmpc' has no attribute 'simulator'"):
        _ = directmpc.simulator


def test_a_host_starts_without_compiled_code() -> None:
    code = "import directmpc, sys; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("engine", ["ideal", "model"])
def test_a_decision_is_the_replays(name: str, engine: str, tmp_path: Path) -> None:
    result = simulate(load_drive(name), engine, steps=40)
    drive, trace, out = tmp_path / "drive.toml", tmp_path / "trace.csv", tmp_path / "out.csv"
    drive.write_text(directmpc.shipped_drives()[name], encoding="utf-8")
    result.write_trace(trace)
    arguments = ["--drive", str(drive), "--trace", str(trace), "--out", str(out)]
    assert replay.cli.main([*arguments, "--engine", engine]) == 0
    columns = np.genfromtxt(out, delimiter=",", names=True)
    for column in columns.dtype.names:
        if column != "cycles":
            np.testing.assert_array_equal(columns[column], result.table()[f"next_{column}"])
    for row in rows_of(result)[::7]:
        decision = decide(load_drive(drive), row, engine)
        wanted = [int(row[f"next_s_{x}"]) for x in "abc"] if "s_a" in row else int(row["next_u"])
        assert (list(decision.apply) if "s_a" in row else decision.apply) == wanted
        assert decision.saturated == row["next_saturated"]


def test_a_loop_of_mpdcc_holds_what_is_asked() -> None:
    drive = load_drive("anpc5l_6kv")
    result = simulate(drive, steps=800, settle=100)
    assert (len(result), result.controller, result.speed) == (800, "ideal", 1.0)
    assert result.time[1] == drive.control.ts
    assert abs(result.current).mean() == pytest.approx(1.0, abs=0.02)
    assert 0.04 < result.thd() < 0.09
    reference = result.trace.iref[:, 0] + 1j * result.trace.iref[:, 1]
    assert np.abs(result.current - reference).max() < 2.5 * drive.control.bound_current
    assert np.abs(result.phase_currents.sum(axis=1)).max() < 1e-12
    wanted = drive.machine.steady_state(0.5, torque=-0.4, flux=2.0)
    braked = simulate(drive, steps=900, settle=100, speed=0.5, torque=-0.4, flux=2.0)
    # the bounds of 0.1 pu let the current, and so the torque, lie to one side
    assert braked.torque.mean() == pytest.approx(-0.4, abs=0.1)
    assert np.abs(braked.flux).mean() == pytest.approx(2.0, abs=0.05)
    assert braked.omega_r[0] == pytest.approx(wanted.omega_r)


def test_a_loop_of_mptc_holds_what_is_asked() -> None:
    drive = load_drive("induction_2kw2")
    result = simulate(drive, steps=2000, settle=200, speed=200.0, torque=7.0, flux=0.95)
    assert result.torque.mean() == pytest.approx(7.0, abs=0.3)
    assert np.abs(result.flux).mean() == pytest.approx(0.95, abs=0.02)
    # the stator turns at the speed asked for, the rotor slower by the slip
    angle = np.unwrap(np.angle(result.flux))
    assert (angle[-1] - angle[0]) / result.time[-1] == pytest.approx(200.0, rel=0.01)
    assert 190.0 < result.omega_r[0] < 200.0
    assert result.thd() < 0.1


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("engine", ["ideal", "model"])
def test_both_loops_decide_alike(name: str, engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = load_drive(name)
    stepped = simulate(drive, engine, steps=150, settle=10, angle=0.3).table()
    monkeypatch.setattr(simulation, "COMPILED_FROM", 0)
    compiled = simulate(drive, engine, steps=150, settle=10, angle=0.3).table()
    assert list(stepped) == list(compiled)
    for column, values in stepped.items():
        np.testing.assert_allclose(values, compiled[column], rtol=0.0, atol=1e-9, err_msg=column)


def test_a_delayed_decision_is_replayed_as_it_was(tmp_path: Path) -> None:
    drive = load_drive("anpc5l_6kv").with_control(delay_compensation=True)
    for engine in ("ideal", "model"):
        result = simulate(drive, engine, steps=60)
        assert np.array_equal(result.applied[1:], result.decisions.s[:-1])
        table = result.table()
        for k in range(0, 60, 9):
            row = {column: values[k] for column, values in table.items()}
            assert list(decide(drive, row, engine).apply) == result.decisions.s[k].tolist()


def test_the_plant_may_be_another_machine() -> None:
    for name, ratio in (("anpc5l_6kv", 1.5), ("motulator_2kw2", 1.5)):
        drive = load_drive(name)
        other = drive.changed(machine={"rs": ratio * drive.machine.rs})
        own, strange = (simulate(drive, steps=80, plant=p) for p in (None, other))
        assert np.abs(own.current - strange.current).max() > 0.0
        assert abs(strange.current).mean() == pytest.approx(abs(own.current).mean(), rel=0.1)


class Square:
    """Six vectors in turn: a two-level inverter at its fundamental."""

    def __init__(self, drive, speed: float) -> None:
        self.turn, self.angle = speed * drive.control.ts, 0.0

    def decide(self, state: MptcState) -> int:
        """The vector whose angle is the nearest."""
        self.angle += self.turn
        return 1 + round(self.angle / (np.pi / 3)) % 6


class Wary:
    """Ideal, but it keeps what it applies whenever the current is below half."""

    def __init__(self, drive: Drive) -> None:
        self.ideal, self.seen = IdealController(drive), []

    def decide(self, state: MpdccState) -> MpdccDecision | tuple[int, int, int]:
        """As its class says."""
        self.seen.append(state)
        return state.applied if abs(state.current) < 0.5 else self.ideal.decide(state)


def test_own_controllers_close_the_loop() -> None:
    drive = load_drive("induction_2kw2")
    square = Square(drive, 300.0)
    assert isinstance(square, Controller)
    result = simulate(drive, square, steps=600, speed=300.0, torque=3.0)
    assert result.controller == "Square"
    assert set(result.decisions.u.tolist()) == {1, 2, 3, 4, 5, 6}
    mpdcc = load_drive("anpc5l_6kv")
    wary = Wary(mpdcc)
    assert simulate(mpdcc, wary, steps=50).decisions.s.tolist() == (
        simulate(mpdcc, steps=50).decisions.s.tolist()
    )
    assert len(wary.seen) == 50
    for made in (IdealController(mpdcc), ModelController(mpdcc.with_papers_rules(), "paper")):
        assert isinstance(made, Controller)


class TwinBoard:
    """A board whose core is the bit-true model of MPTC; it forgets one bit in one step."""

    def __init__(self, drive: MptcDrive, wrong: int) -> None:
        self.core, self.wrong, self.steps = bit_true.parameters(drive)[0], wrong, 0

    def answer(self, words: list[int], position: int, name: str) -> Answer:
        """As `Board.answer`."""
        u, saturated, clamped = bit_true.decide_words(self.core, np.array(words), position)
        u ^= self.steps == self.wrong
        self.steps += 1
        flags = saturated << Flag.SATURATED | clamped << Flag.CLAMPED
        return Answer(int(u), int(flags), 0, 39, 0, 0)

    def refuse_unmeasured(self, state: MptcState) -> None:
        """As `Board.refuse_unmeasured`: it was not started."""

    def sequence(self) -> None:
        """As `Board.sequence`: MPTC decides on one vector."""


def test_a_board_closes_the_loop_and_is_compared() -> None:
    drive = load_drive("motulator_2kw2")
    own = simulate(drive, "model", steps=40).decisions.u.tolist()
    board = BoardController(TwinBoard(drive, wrong=30), drive)
    assert isinstance(board, Controller)
    found = simulate(drive, board, steps=40).decisions.u.tolist()
    assert found[:30] == own[:30]
    assert found[30] == own[30] ^ 1
    assert board.differing == 1, "the others are the model's on the states that came of it"
    assert board.summary(2.0).rate == 20.0
    assert board.summary(2.0).cycles.tolist() == [39] * 40


class Answers:
    """Says the same whatever it sees."""

    def __init__(self, answer: object) -> None:
        self.answer = answer

    def decide(self, state: object) -> object:
        """The answer."""
        return self.answer


def test_wrong_arguments_get_a_sentence() -> None:
    mpdcc, mptc = load_drive("anpc5l_6kv"), load_drive("motulator_2kw2")
    state = MptcState(1 + 0j, (0.9, 0.1), 100.0, 5.0, 0.9)
    good = {"current": 1, "flux": 2, "v_n": 0, "v_ph": (0.5, 0.5, 0.5), "current_ref": 1,
            "omega_s": 1, "omega_r": 1, "applied": (0, 0, 7)}  # fmt: skip
    for kind, call, message in (
        (TypeError, lambda: decide("anpc5l_6kv", state), "drive: got a str; load_drive makes"),
        (TypeError, lambda: decide(mpdcc, state), "got a MptcState; .* mpdcc needs a MpdccState"),
        (TypeError, lambda: decide(mptc, [1, 2]), "state: got a list"),
        (ValueError, lambda: decide(mptc, state, "vhdl"), '"ideal" or "model" or "rtl"'),
        (ValueError, lambda: decide(mptc, state, "model", "x"), '"fast" or "paper"'),
        (StateError, lambda: decide(mptc, {"is_alpha": 1}), "has no column is_beta"),
        (StateError, lambda: MptcState("a", 1, 1, 1, 1), "current: got 'a'; a complex number"),
        (StateError, lambda: MptcState(1, 1, None, 1, 1), "omega_r: got None; a finite number"),
        (StateError, lambda: MptcState(1, 1, 1, 1, 1, 8), "applied: got 8; .* 0 to 7"),
        (StateError, lambda: MpdccState(**good | {"v_ph": (1, 2)}), r"v_ph: got \(1, 2\); three"),
        (StateError, lambda: MpdccState(**good | {"v_n": np.nan}), "v_n: got nan"),
        (StateError, lambda: MpdccState(**good | {"flux": (1, 2, 3)}), "flux: got"),
        (StateError, lambda: MpdccState(**good | {"applied": (0, 1, 1.5)}), r"applied\[2\]"),
        (TypeError, lambda: simulate(mpdcc, 3), "controller: got a int; .*decide"),
        (TypeError, lambda: simulate(mpdcc, Wary), "controller: got the class Wary"),
        (ValueError, lambda: simulate(mpdcc, "vhdl"), "engine: got 'vhdl'"),
        (TypeError, lambda: simulate(mpdcc, plant=mptc), "plant: got a MptcDrive"),
        (ValueError, lambda: simulate(mpdcc, steps=0), "steps: got 0; an integer from 1"),
        (ValueError, lambda: simulate(mpdcc, steps=1.5), "steps: got 1.5"),
        (ValueError, lambda: simulate(mpdcc, settle=-1), "settle: got -1"),
        (ValueError, lambda: simulate(mpdcc, speed="fast"), "speed: got 'fast'"),
        (ValueError, lambda: simulate(mpdcc, speed=0.0), "speed: got 0"),
        (ValueError, lambda: simulate(mptc, torque=1e4), "beyond the breakdown torque"),
        (ValueError, lambda: simulate(mptc, flux=-1.0), "flux: got -1"),
        (StateError, lambda: simulate(mptc, Answers("u1"), steps=3), "step 0: decision: got 'u1'"),
        (StateError, lambda: simulate(mpdcc, Answers(3), steps=3), "step 0: decision: got 3; thr"),
        (StateError, lambda: simulate(mpdcc, Answers((0, 0, 0)), steps=9), "phase . may not go"),
    ):
        with pytest.raises(kind, match=message) as caught:
            call()
        assert "\n" not in str(caught.value)
