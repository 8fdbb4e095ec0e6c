"""Paper B's figures with the bit-true twin: sweeps, starts, steps, robustness; as numbers.

`results` computes all of them; the command line prints them as JSON.  The paper's machine is not
published, `drives/induction_2kw2.toml` says what is assumed.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from directmpc.drive import MptcDrive, load_mptc_drive
from directmpc.metrics import thd
from directmpc.mptc import bit_true, closed_loop, ideal, observer, preexcitation
from directmpc.mptc.closed_loop import RPM, Run, Scenario, as_trace
from directmpc.mptc.plant import PlantParameters, plant_parameters, step, torque
from directmpc.mptc.vectors import COMMUTATIONS
from directmpc.trace import FloatArray

DRIVES = Path(__file__).resolve().parents[3] / "drives"
WEIGHTS = (14.2, 32.0, 100.0, 250.0, 350.0)
RATED_TORQUE = 14.0  # N*m, Paper B
RATED_FLUX = 0.986  # Wb: rated torque over the paper's 14.2
INERTIA = 0.015  # kg*m^2, of a 2.2 kW machine; assumed


@dataclass(frozen=True)
class Observed:
    """A run on the observer's flux.

    Attributes
    ----------
    run : Run
        Its trace holds the plant's own flux.
    estimate : (n, 2)
        What the controller saw instead, Wb.
    """

    run: Run
    estimate: FloatArray


def changed(drive: MptcDrive, **control: object) -> MptcDrive:
    """The same drive with other settings of its controller."""
    return drive.model_copy(update={"control": drive.control.model_copy(update=control)})


def _loop(
    drive: MptcDrive,
    scenario: Scenario,
    plant: PlantParameters,
    *,
    observe: bool = False,
    excite: float | None = None,
) -> Observed:
    """A loop with observer or pre-excitation, one step of every part a period, in words."""
    p, reference = bit_true.parameters(drive), ideal.ideal_parameters(drive)
    gains = observer.array(observer.coefficients(drive))
    state = np.zeros(4, dtype=np.int64)
    limit, level = preexcitation.levels(
        drive, excite if excite is not None else 0.0, float(scenario.psi_ref[0])
    )
    done = int(excite is None)
    n = len(scenario.torque_ref)
    seen, seen_u = np.empty((n, 7)), np.empty(n, dtype=np.int64)
    estimate, out, result = np.empty((n, 2)), np.empty((n, 4), dtype=np.int64), np.empty((n, 3))
    current, flux, omega_r = complex(scenario.current), complex(scenario.flux), scenario.omega_r
    applied, integral = 0, 0.0
    shown = np.zeros(2, dtype=np.int64)
    vdc = drive.inverter.vdc
    if observe:
        # begin at the plant's state, with an estimate that is 20 % too small
        word = bit_true.encode_row(*p[1:], current, 0.8 * flux, 0.0, vdc, 0.0, 0.0)[0]
        state[2:] = word[2:4] << (observer.GUARD + 2)
        product = word[0:2] * 4 * gains[0] + word[2:4] * 4 * gains[1]
        state[:2] = product >> (17 - observer.GUARD)
        shown[:] = word[2:4]
    for k in range(n):
        wanted = float(scenario.torque_ref[k])
        if scenario.speed_ref is not None:
            gain, rate, bound = scenario.gains
            error = float(scenario.speed_ref[k]) - omega_r / plant.pole_pairs
            if done and abs(gain * error + integral) < bound:
                integral += rate * error * plant.ts
            wanted += min(max(gain * error + integral, -bound), bound)
        inputs = (current, flux, omega_r, applied, vdc, wanted, float(scenario.psi_ref[k]))
        words, clipped = bit_true.encode_row(*p[1:], current, flux, omega_r, vdc, *inputs[5:])
        if observe:
            words[2:4] = shown
        estimate[k] = words[2:4] / p[1][2]
        u, saturated, clamped = bit_true.decide_words(p[0], words, applied)
        if not done:
            u, _, done = preexcitation.decide_words(words[:4], limit, level, done)
        if observe:
            shown[0], shown[1], _ = observer.step_words(gains, state, words[[0, 1, 4, 5]], applied)
        seen[k] = (current.real, current.imag, flux.real, flux.imag, omega_r, *inputs[5:])
        seen_u[k] = applied
        out[k] = (u, saturated | clipped, clamped, ideal.decide(reference, *inputs)[0])
        result[k] = torque(plant, current, flux), abs(flux), ideal.margin(reference, *inputs)
        current, flux, omega_r = step(
            plant, current, flux, omega_r, applied, float(scenario.load[k])
        )
        applied = int(u)
    found = Run(
        ts=plant.ts,
        trace=as_trace(seen, seen_u),
        u=out[:, 0],
        saturated=out[:, 1],
        clamped=out[:, 2],
        torque=result[:, 0],
        flux=result[:, 1],
        shadow=out[:, 3],
        margin=result[:, 2],
    )
    return Observed(found, estimate)


def observed(drive: MptcDrive, scenario: Scenario, plant: PlantParameters) -> Observed:
    """A run on the observer's flux, begun with an estimate that is 20 % too small."""
    return _loop(drive, scenario, plant, observe=True)


def start(drive: MptcDrive, *, excited: bool, limit: float = 8.0, steps: int = 6000) -> Run:
    """Start from standstill to 1500 r/min without flux, with or without pre-excitation (Fig. 21).

    Parameters
    ----------
    drive : MptcDrive
    excited : bool
        Whether pre-excitation comes first.
    limit : float
        Its current limit, A.
    steps : int
        Control periods.
    """
    scenario = Scenario(
        np.zeros(steps),
        np.full(steps, 0.9),
        np.zeros(steps),
        np.full(steps, 1500.0 * RPM),
        gains=(1.0, 10.0, 1.2 * RATED_TORQUE),
    )
    plant = plant_parameters(drive, INERTIA)
    return _loop(drive, scenario, plant, excite=limit if excited else None).run


def figures(run: Run, omega_s: float | None = None) -> dict[str, float]:
    """Torque and flux ripple (standard deviations), switching frequency, and THD of the current.

    Parameters
    ----------
    run : Run
        Its first tenth is left out.
    omega_s : float, optional
        Fundamental, rad/s; without it no THD.
    """
    first = len(run.u) // 10
    changes = COMMUTATIONS[run.trace.u[first:-1], run.trace.u[first + 1 :]].sum()
    found = {
        "torque_ripple_nm": float(run.torque[first:].std()),
        "torque_mean_nm": float(run.torque[first:].mean()),
        "flux_ripple_wb": float(run.flux[first:].std()),
        "switching_hz": float(changes / (6.0 * len(run.u[first:]) * run.ts)),
        "mismatch_pct": 100.0 * run.mismatch,
        "worst_margin": run.worst_margin,
    }
    if omega_s is not None:
        found["thd_pct"] = 100.0 * float(thd(run.trace.i_s[first:, 0], omega_s, run.ts))
    return found


def weights(drive: MptcDrive, steps: int = 60_000) -> dict[str, dict[str, float]]:
    """Fig. 5: 1500 r/min without load, MPTC over k_psi and MPFC."""
    rows = {}
    omega = 1500.0 * RPM * drive.machine.pole_pairs
    for key, one in [
        *((f"{k:g}", changed(drive, k_psi=k, method="MPTC")) for k in WEIGHTS),
        ("MPFC", changed(drive, method="MPFC")),
    ]:
        scenario = closed_loop.constant(one, 1500.0, 0.0, 0.9, steps)
        rows[key] = figures(closed_loop.simulate(one, scenario), omega)
    return rows


def low_speed(drive: MptcDrive, steps: int = 200_000) -> dict[str, dict[str, float]]:
    """Figs. 6 and 9: 150 r/min without load."""
    omega = 150.0 * RPM * drive.machine.pole_pairs
    rows = {}
    for key, one in (
        ("MPTC 32", changed(drive, k_psi=32.0)),
        ("MPTC 100", drive),
        ("MPFC", changed(drive, method="MPFC")),
    ):
        scenario = closed_loop.constant(one, 150.0, 0.0, RATED_FLUX, steps)
        rows[key] = figures(closed_loop.simulate(one, scenario), omega)
    return rows


def torque_step(drive: MptcDrive) -> dict[str, float]:
    """Fig. 30: rise of the torque to 95 % of a step from 0 to 120 %, ms, at several speeds."""
    rows = {}
    for rpm in (0.0, 150.0, 500.0, 900.0):
        n = 600
        scenario = closed_loop.constant(drive, rpm, 0.0, RATED_FLUX, n)
        wanted = np.where(np.arange(n) < 200, 0.0, 1.2 * RATED_TORQUE)
        run = closed_loop.simulate(
            drive,
            Scenario(
                wanted, scenario.psi_ref, wanted, None, scenario.current, scenario.flux,
                scenario.omega_r,
            ),
        )  # fmt: skip
        rise = int(np.argmax(run.torque[200:] >= 0.95 * 1.2 * RATED_TORQUE))
        rows[f"{rpm:g}"] = rise * run.ts * 1e3
    return rows


def robustness(drive: MptcDrive, steps: int = 20_000) -> dict[str, dict[str, float]]:
    """Fig. 1: resistances of the machine 50 % and 100 % above the controller's, on the observer."""
    rows = {}
    for rpm in (150.0, 1500.0):
        for factor in (1.0, 1.5, 2.0):
            plant = plant_parameters(drive, rs=factor, rr=factor)
            found = observed(drive, closed_loop.constant(drive, rpm, 0.0, 0.9, steps), plant)
            half = steps // 2
            error = np.hypot(*(found.estimate - found.run.trace.psi_s).T)[half:]
            rows[f"{rpm:g} r/min, {factor:g}"] = {
                "flux_mean_wb": float(found.run.flux[half:].mean()),
                "flux_ripple_wb": float(found.run.flux[half:].std()),
                "torque_ripple_nm": float(found.run.torque[half:].std()),
                "estimate_error_wb": float(error.max()),
            }
    return rows


def starts(drive: MptcDrive) -> dict[str, dict[str, float]]:
    """Fig. 21: start with MPFC, without and with pre-excitation."""
    rows = {}
    one = changed(drive, method="MPFC")
    for key, excited in (("without", False), ("with", True)):
        run = start(one, excited=excited)
        rpm = run.trace.omega_r / drive.machine.pole_pairs / RPM
        rows[key] = {
            "peak_current_a": float(np.hypot(*run.trace.i_s.T).max()),
            "ms_to_1400_rpm": float(np.argmax(rpm > 1400.0) * run.ts * 1e3),
            "ms_to_flux": float(np.argmax(run.flux >= 0.89) * run.ts * 1e3),
        }
    return rows


def fidelity(drive: MptcDrive, steps: int = 20_000) -> dict[str, dict[str, float]]:
    """Decisions against ideal over the operating points of the specification."""
    rows = {}
    for method in ("MPTC", "MPFC"):
        one = changed(drive, method=method)
        for rpm in (150.0, 900.0, 1500.0, -150.0, -900.0, -1500.0):
            for load in (0.0, RATED_TORQUE):
                scenario = closed_loop.constant(one, rpm, load, RATED_FLUX, steps)
                run = closed_loop.simulate(one, scenario)
                rows[f"{method} {rpm:g} r/min {load:g} N*m"] = {
                    "mismatch_pct": 100.0 * run.mismatch,
                    "worst_margin": run.worst_margin,
                }
    return rows


def results(name: str = "induction_2kw2") -> dict[str, object]:
    """All of them for a drive that ships."""
    drive = load_mptc_drive(DRIVES / f"{name}.toml")
    return {
        "weights": weights(drive),
        "low_speed": low_speed(drive),
        "torque_step_ms": torque_step(drive),
        "robustness": robustness(drive),
        "starts": starts(drive),
        "fidelity": fidelity(drive),
    }


def main() -> None:
    """Command line: print the results as JSON."""
    parser = argparse.ArgumentParser(prog="study", description=main.__doc__)
    parser.add_argument("drive", nargs="?", default="induction_2kw2", help="name in drives/")
    print(json.dumps(results(parser.parse_args().drive), indent=1))


if __name__ == "__main__":
    main()
