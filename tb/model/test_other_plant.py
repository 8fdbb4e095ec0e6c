"""Plants that are not the controller's, and the rotor flux of the observer, in `simulate`.

Sweep: every factor of both kinds of drive; the ideal controller and the bit-true one.
Stimulus: short closed loops from the steady state.
Checks: a factor changes its keys of the plant and no other, and the loop is that of a plant given
as a drive; a rotor resistance that is wrong shows in the flux of the observer; what the controller
saw is the observer's step by step; values that are not allowed are refused.
Does not prove: what a wrong plant costs, see test_robustness_study.
"""

from __future__ import annotations

import numpy as np
import pytest

from directmpc import decide, load_drive, simulate
from directmpc.api.simulation import factors_of, plant_with
from directmpc.drive_tables import DriveError
from directmpc.mpdcc import observer
from directmpc.mpdcc.closed_loop import OperatingPoint, constant_profile, initial_conditions
from directmpc.mpdcc.errors import DriveErrors
from scripts.hdl import states


@pytest.mark.parametrize(
    ("drive_name", "name"),
    [
        (drive, name)
        for drive in ("anpc5l_6kv", "anpc5l_pmsm", "anpc5l_grid", "anpc5l_rl")
        for name in factors_of(load_drive(drive))
    ],
)
def test_a_factor_changes_its_keys_of_the_plant(drive_name: str, name: str) -> None:
    drive = load_drive(drive_name)
    real = plant_with(drive, {name: 0.8})
    table = "inverter" if name in ("xdc", "xph") else "machine"
    keys = drive.machine.factors.get(name, (name,))
    for part in ("machine", "inverter", "control"):
        for key in vars(getattr(drive, part)):
            old, new = (getattr(getattr(one, part), key) for one in (drive, real))
            assert new == (0.8 * old if (part, key in keys) == (table, True) else old), key


def test_factors_of_a_two_level_plant_keep_what_they_do_not_name() -> None:
    m = load_drive("induction_2kw2").machine
    found = {
        name: plant_with(load_drive("induction_2kw2"), {name: 1.25}).machine
        for name in load_drive("induction_2kw2").plant_factors
    }
    assert found["rs"] == m.model_copy(update={"rs": 1.25 * m.rs})
    assert found["rr"] == m.model_copy(update={"rr": 1.25 * m.rr})
    assert found["leakage"].lm == m.lm
    assert found["leakage"].ls == pytest.approx(m.lm + 1.25 * (m.ls - m.lm))
    assert found["leakage"].lr == pytest.approx(m.lm + 1.25 * (m.lr - m.lm))
    assert found["lm"].lm == 1.25 * m.lm
    assert found["lm"].ls - found["lm"].lm == pytest.approx(m.ls - m.lm)


@pytest.mark.parametrize("name", ["anpc5l_6kv", "induction_2kw2"])
def test_the_plant_has_the_factors_and_the_controller_has_not(name: str) -> None:
    drive = load_drive(name)
    factors = {"rs": 1.5, "leakage": 0.7}
    found = simulate(drive, steps=40, plant_factors=factors)
    given = simulate(drive, steps=40, plant=plant_with(drive, factors))
    np.testing.assert_array_equal(found.current, given.current)
    same = simulate(drive, steps=40, plant_factors={"rs": 1.0})
    np.testing.assert_array_equal(same.current, simulate(drive, steps=40).current)
    assert np.abs(found.current - same.current).max() > 1e-3
    # the controller's drive is what it was: it decides alike on the same state
    table = found.table()
    row = {column: values[30] for column, values in table.items()}
    applied = decide(drive, row).apply
    assert np.array_equal(applied, found.applied[30] if name == "anpc5l_6kv" else row["next_u"])


def observed(drive, **options) -> tuple[np.ndarray, np.ndarray]:
    """Rotor flux that the controller saw, and the plant's."""
    result = simulate(drive, "model", steps=60, flux_observer=True, **options)
    return result.trace.x_m[:, 2] + 1j * result.trace.x_m[:, 3], result.flux


def test_the_controller_sees_the_flux_of_the_observer() -> None:
    drive = load_drive("anpc5l_6kv").with_papers_rules()
    errors = DriveErrors(offset_current=0.01, offset_voltage=0.01, seed=2)
    result = simulate(drive, "model", steps=60, flux_observer=True, errors=errors)
    # the observer once more, by hand, on what was measured and applied
    profile = constant_profile(drive, OperatingPoint(1.0), 60)
    state, positions = initial_conditions(profile)
    words = observer.array(observer.coefficients(drive)[0])
    twin = observer.state_of(drive.machine, complex(*state[:2]), complex(*state[2:4]))
    until = np.vstack([positions, result.applied[:-1]])
    np.testing.assert_array_equal(result.trace.x_m[0, 2:], state[2:4])
    for k in range(1, 60):
        x = np.concatenate([result.trace.x_m[k], result.trace.x_inv[k]])
        x[2:4] = 0.0
        observer.step_row(words, twin, x, result.trace.vdc[k], result.omega_r[k], until[k])
        np.testing.assert_array_equal(x[2:4], result.trace.x_m[k, 2:])
    assert np.abs(result.trace.x_m[:, 2] - result.flux.real).max() > 1e-4
    # and it decides on it
    table = result.table()
    for k in range(0, 60, 7):
        row = {column: values[k] for column, values in table.items()}
        assert list(decide(drive, row, "model").apply) == result.applied[k].tolist()


def test_a_wrong_machine_shows_in_the_flux_of_the_observer() -> None:
    drive = load_drive("anpc5l_6kv").with_control(**states.STUDIED)
    seen, flux = observed(drive)
    assert np.abs(seen - flux).max() < 2e-3
    seen, flux = observed(drive, plant_factors={"leakage": 0.6})
    assert np.abs(seen - flux).max() > 1e-2
    # without the observer the flux is the plant's
    plain = simulate(drive, "model", steps=60, plant_factors={"leakage": 0.6})
    np.testing.assert_array_equal(plain.trace.x_m[:, 2], plain.flux.real)


@pytest.mark.parametrize(
    ("name", "given", "kind", "words"),
    [
        ("anpc5l_6kv", {"plant_factors": {"rs": 0.49}}, ValueError, "rs: got 0.49; .* 0.5 to 1.5"),
        ("anpc5l_6kv", {"plant_factors": {"xm": 1.51}}, ValueError, "xm: got 1.51; .* 0.5 to 1.5"),
        ("anpc5l_6kv", {"plant_factors": {"rs": np.nan}}, ValueError, "rs: got nan; .* number"),
        ("anpc5l_6kv", {"plant_factors": {"rs": "2"}}, ValueError, "rs: got '2'; .* number"),
        ("anpc5l_6kv", {"plant_factors": {"lm": 1.0}}, ValueError, "got 'lm'; .* leakage, xm, xdc"),
        ("anpc5l_6kv", {"plant_factors": 0.8}, TypeError, "got a float; a mapping"),
        ("anpc5l_6kv", {"flux_observer": 1}, TypeError, "flux_observer: got a int; True or False"),
        ("induction_2kw2", {"plant_factors": {"xdc": 1}}, ValueError, "got 'xdc'; .* leakage, lm"),
        ("induction_2kw2", {"flux_observer": True}, TypeError, "flux_observer: given for .* MPTC"),
    ],
)
def test_what_is_not_allowed_is_refused(
    name: str, given: dict, kind: type[Exception], words: str
) -> None:
    with pytest.raises(kind, match=words):
        simulate(load_drive(name), steps=3, **given)


def test_a_plant_that_no_drive_file_may_hold_is_refused() -> None:
    drive = load_drive("anpc5l_6kv").changed(machine={"rs": 0.0015})
    with pytest.raises(DriveError, match=r"plant_factors: machine\.rs: got 0\.00075; .* 0\.001 to"):
        simulate(drive, steps=3, plant_factors={"rs": 0.5})
