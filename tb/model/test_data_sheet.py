"""What a data sheet says of a drive, and the drives whose units are wrong.

Sweep: every drive that ships; wrong units one by one, as users mix them up.
Checks: rated speed, torque and times of known machines by other formulas; a shipped drive raises no
doubt; each wrong unit raises one that names the key; the command prints both and ends with 0.
Does not prove: that a value without a doubt is right.
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import pytest

from directmpc import load_drive, shipped_drives, simulate
from directmpc.api.data_sheet import data_sheet, doubts
from scripts.commands import drive_info


def sheet(drive) -> dict[str, float]:
    return {fact.name: fact.value for fact in data_sheet(drive)}


@pytest.mark.parametrize("name", shipped_drives())
def test_a_shipped_drive_raises_no_doubt(name: str) -> None:
    assert doubts(load_drive(name)) == []


def test_an_induction_machine_per_unit() -> None:
    drive = load_drive("anpc5l_3kv3")
    found = {fact.name: fact for fact in data_sheet(drive)}
    assert found["rated voltage"].si == "3300 V line-to-line rms"
    assert found["rated current"].si == "356 A rms"
    # published: omega_r = 0.9911
    assert found["rated speed"].value == pytest.approx(0.9911, abs=1e-4)
    assert found["rotor time constant"].si == f"{1e3 * (2.4593 / 0.0091) / (100 * math.pi):.4g} ms"
    # the circuit's breakdown torque, with the stator seen from the air gap (Thevenin)
    m = drive.machine
    z = 1j * m.xm * (m.rs + 1j * m.xls) / (m.rs + 1j * m.xs)
    v = abs(1j * m.xm / (m.rs + 1j * m.xs))
    peak = 0.5 * v * v / (z.real + math.hypot(z.real, z.imag + m.xlr))
    assert found["breakdown torque"].value == pytest.approx(peak, rel=1e-4)


def test_a_two_level_machine() -> None:
    found = sheet(load_drive("induction_2kw2"))
    assert found["rotor time constant"] == pytest.approx(0.230 / 1.879)
    assert found["leakage factor"] == pytest.approx(1.0 - 0.221**2 / 0.23**2)
    assert found["speed that vdc carries at it"] == pytest.approx(540 / math.sqrt(3) / 0.9375)


def test_the_highest_speed_of_a_magnet_machine_takes_the_whole_voltage() -> None:
    drive = load_drive("anpc5l_pmsm")
    omega = sheet(drive)["highest speed at rated current without field weakening"]
    needed = abs(drive.machine.steady_state(omega).v_s)
    assert needed == pytest.approx(drive.inverter.vdc / math.sqrt(3.0), rel=1e-9)


WRONG = [
    ("induction_2kw2", {"machine": {"lm": 221.0, "ls": 230.0, "lr": 230.0}}, "H"),  # mH
    (
        "induction_2kw2",  # per unit, everything
        {
            "machine": {"rs": 0.0712, "rr": 0.0428, "lm": 1.582, "ls": 1.646, "lr": 1.646},
            "inverter": {"vdc": 1.74},
            "control": {"psi_max": 1.27, "current_max": 4.5, "torque_max": 2.0, "speed_max": 1.6},
        },
        "rotor time constant",
    ),
    ("induction_2kw2", {"machine": {"rs": 3.126e-3, "rr": 1.879e-3}}, "resistances in ohm"),
    ("induction_2kw2", {"control": {"speed_max": 1500.0}}, "electrical rad/s"),
    ("induction_2kw2", {"control": {"current_max": 4.0}}, "control.current_max is in A"),
    ("induction_2kw2", {"control": {"torque_max": 4000.0}}, "control.torque_max is in N m"),
    ("anpc5l_6kv", {"machine": {"xls": 0.3, "xlr": 0.3, "xm": 1.0, "rr": 0.2}}, "machine"),
    ("anpc5l_6kv", {"inverter": {"vdc": 1.6}}, "inverter.vdc"),
    ("anpc5l_pmsm", {"machine": {"psi_m": 1.6}}, "psi_m is"),
    ("anpc5l_grid", {"machine": {"voltage": 0.3}}, "voltage is the peak"),
]


@pytest.mark.parametrize(("name", "tables", "said"), WRONG)
def test_wrong_units_raise_a_doubt(name: str, tables: dict, said: str) -> None:
    found = doubts(load_drive(name).changed(**tables))
    assert any(said in doubt for doubt in found)
    assert all("usual" in doubt and "\n" not in doubt for doubt in found)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert drive_info.cli.main(["anpc5l_6kv"]) == 0
    out, err = capsys.readouterr()
    assert "breakdown torque" in out
    assert "6000 V line-to-line rms" in out
    assert err == ""
    path = tmp_path / "fast.toml"
    text = shipped_drives()["induction_2kw2"]
    path.write_text(text.replace("speed_max = 500.0", "speed_max = 1500.0"))
    assert drive_info.cli.main([str(path)]) == 0
    out, err = capsys.readouterr()
    assert err.startswith("drive-info: warning: control.speed_max")
    assert err.count("\n") == 1
    assert drive_info.cli.main([str(tmp_path / "none.toml")]) == 2


@pytest.mark.parametrize(
    ("name", "asked", "said"),
    [
        ("anpc5l_6kv", {"speed": 314.0}, "speed: got 314; it must be from -2 to 2 pu"),
        ("anpc5l_6kv", {"speed": 3}, "speed: got 3; it must be from -2 to 2 pu"),
        ("anpc5l_6kv", {"torque": 9000.0}, "torque = 9000 pu: this needs a current of"),
        ("anpc5l_6kv", {"flux": 5.0, "torque": 0.1}, "flux = 5 pu: this needs a"),
        ("induction_2kw2", {"speed": 1500}, "with control.speed_max = 500 it must be from -500 to"),
        ("induction_2kw2", {"flux": 3}, "flux: got 3; with control.psi_max = 1.25"),
        (
            "induction_2kw2",
            {"torque": 41.0, "flux": 1.2},
            "torque: got 41; with control.tor",
        ),
    ],
)
def test_a_simulation_refuses_what_no_word_holds(name: str, asked: dict, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        simulate(load_drive(name), steps=10, **asked)


def test_a_simulation_says_what_it_did_not_reach() -> None:
    drive = load_drive("anpc5l_pmsm")
    with pytest.warns(UserWarning, match=r"the mean torque of the last period is .* 0.9 pu was"):
        simulate(drive, steps=400, speed=1.9)
    two = load_drive("induction_2kw2")
    with pytest.warns(UserWarning, match=r"mean torque .* 20 N\*m was asked"):
        simulate(two, steps=400, speed=500.0, torque=20.0, flux=1.2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulate(drive, steps=400, speed=1.0)
        simulate(drive, steps=30, speed=1.9)  # less than a period says nothing
        simulate(two, steps=800)
        simulate(load_drive("anpc5l_rl"), steps=400)


def test_a_shaft_has_a_run_up() -> None:
    drive = load_drive("anpc5l_6kv").changed(mechanics={"inertia": 0.5})
    assert sheet(drive)["run-up to rated frequency at 1 pu of torque"] == 1.0
    grams = load_drive("induction_2kw2").changed(mechanics={"inertia": 15.0})  # g m^2 for kg m^2
    assert any("mechanics.inertia is in kg m^2" in doubt for doubt in doubts(grams))
    with pytest.raises(ValueError, match=r'mechanics.inertia: given with machine.type = "grid"'):
        load_drive("anpc5l_grid").changed(mechanics={"inertia": 0.5})
