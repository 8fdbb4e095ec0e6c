"""Another project's plant: motulator's induction machine and converter (PyPI `motulator`).

motulator integrates its own Gamma-model machine, stiff shaft and converter with scipy's RK45 and
calls the controller once per control period; its computational delay of one period is the
delay of docs/specification.md, section 3.2.  The controller is the bit-true model, the ideal
controller, or any object with the method `decide` of `directmpc.Controller`.  Imported by tests and
reports only: the models themselves do not need motulator.

motulator runs the loop and calls back, so that the library's loops cannot serve here.
"""

from __future__ import annotations

import math
from typing import Any

import matplotlib
import numpy as np

with matplotlib.rc_context():  # motulator sets a style for every plot there is
    from motulator.drive import model
    from motulator.drive.utils import InductionMachineInvGammaPars, InductionMachinePars

from directmpc.api.controllers import make_controller
from directmpc.mptc import drive_twin as joined
from directmpc.mptc import ideal
from directmpc.mptc.closed_loop import Run, Scenario
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.inverter import STATES
from directmpc.mptc.trace import FloatArray, IntArray
from directmpc.states import Controller, MptcState, mptc_decision
from scripts.hdl import mptc_drive_loop


def _machine_parameters(drive: MptcDrive) -> InductionMachinePars:
    """motulator's parameters of a drive's machine (T circuit to inverse-Gamma to Gamma)."""
    m = drive.machine
    magnetising = m.lm * m.lm / m.lr
    inverse_gamma = InductionMachineInvGammaPars(
        n_p=m.pole_pairs,
        R_s=m.rs,
        R_R=m.rr * (m.lm / m.lr) ** 2,
        L_sgm=m.ls - magnetising,
        L_M=magnetising,
    )
    return InductionMachinePars.from_inv_gamma_model_pars(inverse_gamma)


def _plant(
    drive: MptcDrive,
    scenario: Scenario,
    inertia: float = math.inf,
) -> model.Drive:
    """motulator's drive in a scenario's first state."""
    m = drive.machine
    machine = model.InductionMachine(_machine_parameters(drive))
    # The Gamma model's rotor flux from the T circuit's currents: i_r,T = i_r,Gamma * L_s/L_m
    rotor = (scenario.flux - m.ls * scenario.current) / m.lm
    machine.state.psi_ss = complex(scenario.flux)
    leakage = machine.par.L_ell
    machine.state.psi_rs = complex(scenario.flux + leakage * rotor * m.lm / m.ls)
    mechanical = scenario.omega_r / m.pole_pairs
    load, ts = scenario.load, drive.control.ts

    def torque(t: Any) -> Any:
        k = np.minimum(np.asarray(t / ts + 1e-6).astype(int), len(load) - 1)
        return load[k]

    if math.isinf(inertia):
        mechanics = model.ExternalRotorSpeed(w_M=lambda t: mechanical + 0 * t)
    else:
        mechanics = model.StiffMechanicalSystem(J=inertia, tau_L=torque)
        mechanics.state.w_M = mechanical
    return model.Drive(model.VoltageSourceConverter(u_dc=drive.inverter.vdc), machine, mechanics)


class _Periods:
    """What motulator calls once per control period."""

    def __init__(self, drive: MptcDrive, scenario: Scenario, controller: Controller) -> None:
        n = len(scenario.torque_ref)
        self.drive, self.scenario = drive, scenario
        self.controller = controller
        self.reference = ideal.ideal_parameters(drive)
        self.k, self.applied, self.integral = 0, 0, 0.0
        self.seen: FloatArray = np.empty((n, 7))
        self.seen_u: IntArray = np.empty(n, dtype=np.int64)
        self.out: IntArray = np.empty((n, 4), dtype=np.int64)
        self.result: FloatArray = np.empty((n, 3))

    def __call__(self, mdl: model.Drive) -> tuple[float, list[int]]:
        """Measure, decide, and hand out duty ratios of 0 and 1."""
        mdl.mechanics.set_outputs(mdl.t0)
        k, s = min(self.k, len(self.seen) - 1), self.scenario
        current, flux = complex(mdl.machine.i_ss), complex(mdl.machine.state.psi_ss)
        mechanical = float(np.real(mdl.mechanics.out.w_M))
        wanted, ts = float(s.torque_ref[k]), self.drive.control.ts
        if s.speed_ref is not None:
            gain, rate, limit = s.gains
            error = float(s.speed_ref[k]) - mechanical
            if abs(gain * error + self.integral) < limit:
                self.integral += rate * error * ts
            wanted += min(max(gain * error + self.integral, -limit), limit)
        omega_r = mechanical * self.drive.machine.pole_pairs
        psi_ref = float(s.psi_ref[k])
        state = MptcState(current, flux, omega_r, wanted, psi_ref, self.applied)
        decision = mptc_decision(self.controller.decide(state), self.k)
        vdc = float(mdl.converter.u_dc)
        inputs = (current, flux, omega_r, self.applied, vdc, wanted, psi_ref)
        self.seen[k] = (
            current.real, current.imag, flux.real, flux.imag, omega_r, wanted, psi_ref,
        )  # fmt: skip
        self.seen_u[k] = self.applied
        self.out[k] = (
            decision.apply, decision.saturated, decision.clamped,
            ideal.decide(self.reference, *inputs)[0],
        )  # fmt: skip
        self.result[k] = (
            1.5 * self.drive.machine.pole_pairs * (flux.conjugate() * current).imag,
            abs(flux),
            ideal.margin(self.reference, *inputs),
        )
        self.applied = int(decision.apply)
        self.k += 1
        return ts, STATES[self.applied].tolist()

    def post_process(self) -> None:
        """Nothing to do: the run is recorded step by step."""


def simulate(
    drive: MptcDrive,
    scenario: Scenario,
    controller: str | Controller = "model",
    *,
    inertia: float = math.inf,
) -> Run:
    """Run a closed loop around motulator's plant."""
    if isinstance(controller, str):
        controller = make_controller(drive, controller)
    periods = _Periods(drive, scenario, controller)
    simulation = model.Simulation(_plant(drive, scenario, inertia), periods)
    steps = len(scenario.torque_ref)
    simulation.simulate(t_stop=(steps - 0.5) * drive.control.ts)
    return Run.recorded(drive.control.ts, periods.seen, periods.seen_u, periods.out, periods.result)


def run_rtl(drive: MptcDrive, words: joined.Parameters, scenario: Scenario, inertia: float) -> Run:
    """One scenario from standstill without flux: the RTL with motulator's machine."""
    with mptc_drive_loop.controller(drive, words) as rtl:
        return simulate(drive, scenario, rtl, inertia=inertia)
