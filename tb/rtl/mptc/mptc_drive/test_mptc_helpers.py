"""Observer, pre-excitation, joined drive: RTL against twins, twins against what they are for.

Sweep: one configuration each; the verified machine.
Stimulus: currents of a closed loop, measurements and coefficients of any content, current and flux
at, below and above their levels; inputs random on every clock but the start's, `start` repeated
while busy; resets and restarts.
Checks: every output bit for bit in GHDL, and of the joined drive's converted netlist in Verilator;
the estimate converges, stays with the flux and survives wrong resistances; the drive runs on the
estimate alone; pre-excitation keeps the current at its limit and hands over with the flux at its
level.
Timing: 39, 11 and 40 (MPFC 79) clocks from start to valid, always.
Faults: a gain in the wrong place of the program, half steps taken late, a port's overflow untold, a
voltage of the wrong sign, a comparison turned round: each must turn the bench red.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mptc import closed_loop, observer, preexcitation
from directmpc.mptc import cycles as clocks
from directmpc.mptc import drive_twin as joined
from directmpc.mptc import formats as f
from directmpc.mptc.coefficients import COEFFICIENTS
from directmpc.mptc.plant import plant_parameters
from scripts.hdl import mptc_drive_loop as rtl_loop
from scripts.hdl import netlist_check
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from scripts.studies import mptc as study
from tb.helpers import mptc_rows as core
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run

DECIDED = (*("u_next", "switches", "saturated", "clamped", "exciting", "psis_alpha", "psis_beta"),)
SHARED = [name for name in COEFFICIENTS if name in observer.COEFFICIENTS]
CORE_SHARED = [COEFFICIENTS.index(name) for name in SHARED]
OBSERVER_SHARED = [observer.COEFFICIENTS.index(name) for name in SHARED]


def bench(entity: str, steps: int, rtl: Path = RTL) -> Outcome:
    return run(
        entity,
        "tb.rtl.mptc.mptc_drive.bench_mptc_helpers",
        units=[entity],
        arguments={"seed": 7, "steps": steps, "entity": entity},
        rtl=rtl,
    )


def test_observer_steps_as_its_twin() -> None:
    found = bench("mptc_observer", 240)
    assert found.checks["estimate"] == 240 + 2 * 6
    assert found.covered["saturated"] >= 10


def test_preexcitation_decides_as_its_twin() -> None:
    assert bench("mptc_preexcitation", 300).checks["decision"] == 300


def test_joined_drive_decides_as_its_twin() -> None:
    found = bench("mptc_drive", 40)
    assert found.checks["decision"] == 320
    assert found.checks["clocks"] == 320


def test_netlist_of_the_joined_drive_decides_as_its_twin() -> None:
    rng = np.random.default_rng(11)
    n, block = 4000, 40
    columns = [core.f.MEASUREMENTS.index(name) for name, _ in core.DRIVE_INPUTS]
    recorded = core.recorded("motulator_2kw2", "MPTC", 900.0, 7.0, n).measurements
    # every third block measures anything at all, every fourth has any coefficients
    wild = (np.arange(n) // block % 3 == 2)[:, None]
    measured = np.where(wild, core.any_measurements(rng, n), recorded)[:, columns]
    state, rows, found, cycles = joined.initial(), [], [], []
    for k in range(n):
        if k % block == 0:
            method = core.METHODS[k // block % 2]
            drive = core.shipped("motulator_2kw2").with_control(method=method)
            words = joined.parameters(drive, limit=8.0, flux=rng.uniform(0.01, 0.9))
            if k // block % 4 == 3:
                high = f.WORD_HIGH >> int(rng.integers(0, 6))
                wide = rng.integers(-high - 1, high + 1, len(words.observer))
                words = words._replace(observer=wide)
                words.core[CORE_SHARED] = wide[OBSERVER_SHARED]
            words = words._replace(excite=int(rng.random() < 0.7))
        restart = int(rng.random() < 0.02)
        u, saturated, clamped, exciting = joined.step_words(words, state, measured[k])
        found.append((u, core.SWITCHES[u], saturated, clamped, exciting, *state[4:6]))
        rows.append(rtl_loop.held_inputs(words) | {"restart": restart})
        cycles.append(clocks.DRIVE[method])
        if restart:  # held until the next start
            state[-1] = 0
    inputs = {name: [row[name] for row in rows] for name in rows[0]}
    inputs |= {name: measured[:, i].tolist() for i, (name, _) in enumerate(core.DRIVE_INPUTS)}
    wanted = {name: [int(row[i]) for row in found] for i, name in enumerate(DECIDED)}
    result = netlist_check.check(
        "mptc_drive", rtl_loop.GENERICS, inputs, wanted, cycles, ports=rtl_loop.ports(), limit=200
    )
    assert result.checked == n
    assert result.mismatches == []
    for name in ("saturated", "clamped", "exciting"):
        assert 100 < sum(wanted[name]) < n - 100, name


FAULTS = {
    "hand-over": (
        "mptc_drive",
        "by_excitation <= excite and not magnetised",
        "by_excitation <= excite",
    ),
    "stale estimate": (
        "mptc_drive",
        "signed(estimate_beta), estimated",
        "signed(estimate_beta), '1'",
    ),
    "gain": ("mptc_observer_program", "(10, 9, 9, 0, -1)", "(10, 10, 9, 0, -1)"),
    "half step": ("mptc_observer", "due(DUE_HALF_W) = '1'", "due(DUE_W_ALPHA) = '1'"),
    "flag of alpha's port": (
        "mptc_observer",
        "or overflows(rounded(state(2), PORT_SHIFT), PORT_WIDTH)",
        "",
    ),
    "flag of beta's port": (
        "mptc_observer",
        "or overflows(rounded(state(3), PORT_SHIFT), PORT_WIDTH)",
        "",
    ),
    "share": (
        "mptc_vectors",
        'to_std_logic(number = "101" or number = "110");',
        'to_std_logic(number = "101");',
    ),
    "comparison": ("mptc_preexcitation", "signed(total) > 0", "signed(total) >= 0"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    unit, old, new = FAULTS[name]
    rtl = altered(tmp_path, unit, old, new)
    entity = unit if unit in ("mptc_drive", "mptc_preexcitation") else "mptc_observer"
    with pytest.raises(CheckError, match=r"estimate|decision|is undefined"):
        bench(entity, 100 if entity != "mptc_drive" else 20, rtl)


@pytest.mark.parametrize(("rpm", "bound"), [(0.0, 0.012), (150.0, 0.008), (1500.0, 0.001)])
def test_estimate_converges_and_stays(rpm: float, bound: float) -> None:
    drive = core.shipped("motulator_2kw2")
    loop = closed_loop.constant(drive, rpm, 7.0, 0.9, 12_000)
    found = study.observed(drive, loop, plant_parameters(drive))
    error = np.hypot(*(found.estimate - found.run.trace.psi_s).T)
    assert error[0] > 0.17  # begun 20 % too small
    assert error[10_000:].max() < bound
    assert abs(found.run.flux[10_000:].mean() - 0.9) < 0.02
    assert abs(found.run.torque[10_000:].mean() - 7.0) < 0.2


@pytest.mark.parametrize(
    ("rpm", "factor", "least"), [(1500.0, 1.5, 0.89), (1500.0, 2.0, 0.89), (150.0, 2.0, 0.5)]
)
def test_drive_survives_wrong_resistances(rpm: float, factor: float, least: float) -> None:
    # at low speed the drop in the stator is most of the voltage: the flux itself comes out small
    drive = core.shipped("induction_2kw2")
    plant = plant_parameters(drive, rs=factor, rr=factor)
    found = study.observed(drive, closed_loop.constant(drive, rpm, 0.0, 0.9, 16_000), plant)
    assert least < found.run.flux[10_000:].mean() < 0.91
    assert np.ptp(found.run.flux[10_000:]) < 0.06
    assert np.abs(found.run.trace.i_s[10_000:]).max() < 7.0
    assert abs(found.run.torque[10_000:].mean()) < (0.5 if rpm > 1000.0 else 3.0)


def test_gain_outside_its_range_is_refused() -> None:
    drive = core.shipped("induction_2kw2")
    for gain in (1.0, -1e6):
        with pytest.raises(ValueError, match="gain"):
            observer.coefficients(drive, gain)


def test_levels_outside_their_range_are_refused() -> None:
    drive = core.shipped("induction_2kw2")
    for limit, flux in ((100.0, 0.9), (8.0, 2.0), (-1.0, 0.9)):
        with pytest.raises(ValueError, match="it must be a number"):
            preexcitation.levels(drive, limit, flux)


def test_preexcitation_spares_the_current() -> None:
    drive = core.shipped("induction_2kw2").with_control(method="MPFC")
    surge = study.start(drive, excited=False)
    gentle = study.start(drive, excited=True, limit=8.0)
    peak = [float(np.hypot(*r.trace.i_s.T).max()) for r in (surge, gentle)]
    assert peak[0] > 30.0
    assert peak[1] < 18.0
    assert gentle.trace.omega_r[-1] > 0.9 * 2 * 1500.0 * closed_loop.RPM
