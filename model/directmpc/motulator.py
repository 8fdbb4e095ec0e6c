"""Another project's plant: motulator's induction machine and converter (PyPI `motulator`).

motulator integrates its own Gamma-model machine, stiff shaft and converter with scipy's RK45. Here
it stands for the plant of `mptc.closed_loop`; everything else of the loop is the same. The package
`motulator` has to be installed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np

with matplotlib.rc_context():  # motulator sets a style for every plot there is
    from motulator.common.model import Delay
    from motulator.drive import model
    from motulator.drive.utils import InductionMachineInvGammaPars, InductionMachinePars

from directmpc.api.controllers import make_controller
from directmpc.mptc.closed_loop import Run, Scenario, drive_controller
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.errors import NO_ERRORS, MptcErrors
from directmpc.mptc.inverter import COMMUTATIONS, STATES
from directmpc.states import Controller


def machine_parameters(drive: MptcDrive) -> InductionMachinePars:
    """motulator's Gamma model of a drive's machine (T circuit to inverse-Gamma to Gamma)."""
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


class Plant:
    """motulator's drive in a scenario's first state; moves on one control period at a time.

    With infinite inertia (kg*m^2) the speed is imposed.
    """

    def __init__(self, drive: MptcDrive, scenario: Scenario, inertia: float = math.inf) -> None:
        m = drive.machine
        machine = model.InductionMachine(machine_parameters(drive))
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
        converter = model.VoltageSourceConverter(u_dc=drive.inverter.vdc)
        self.model = model.Drive(converter, machine, mechanics)
        self.model.delay = Delay(0)  # the loop has the delay
        self._pole_pairs, self._ts, self._last = m.pole_pairs, ts, 0
        self._simulation = model.Simulation(self.model, self._duties)

    def _duties(self, _: model.Drive) -> tuple[float, list[int]]:
        """What motulator asks for once per control period: duty ratios of 0 and 1."""
        return self._ts, STATES[self._last].tolist()

    def state(self) -> tuple[complex, complex, float]:
        """Stator current (A), stator flux linkage (Wb) and electrical speed (rad/s)."""
        self.model.mechanics.set_outputs(self.model.t0)
        mechanical = float(np.real(self.model.mechanics.out.w_M))
        machine = self.model.machine
        return complex(machine.i_ss), complex(machine.state.psi_ss), mechanical * self._pole_pairs

    def switch(self, *given: Any) -> tuple[complex, complex, float, int]:
        """Apply a vector for a period: A, Wb, rad/s at k+1, and the switches that have changed.

        In the place of the plant of `mptc.closed_loop`; of `applied` the first vector counts.
        """
        *_, i, psi, _omega, applied, _load, current, made = given
        current[0] = i
        made[0] = 1.5 * self._pole_pairs * (psi.conjugate() * i).imag
        changes = int(COMMUTATIONS[self._last, applied.u1])
        self._last = int(applied.u1)
        self._simulation._simulation_loop(self.model.t0, np.inf)  # one period
        return *self.state(), changes


def simulate(
    drive: MptcDrive,
    scenario: Scenario,
    controller: str | Controller = "model",
    *,
    inertia: float = math.inf,
    errors: MptcErrors = NO_ERRORS,
) -> Run:
    """Run a closed loop around motulator's plant.

    The controller is "model", "ideal", or a `directmpc.Controller`, asked once a period with an
    `MptcState`. With infinite inertia (kg*m^2) the speed is imposed. StateError if an answer is no
    decision; ValueError for an engine that there is not, or a method of several vectors.
    """
    if drive.control.sequences:
        raise ValueError(f"control.method: got {drive.control.method}; motulator takes one vector")
    if isinstance(controller, str):
        controller = make_controller(drive, controller)
    plant = Plant(drive, scenario, inertia)
    current, flux, omega_r = plant.state()
    begun = replace(scenario, current=current, flux=flux, omega_r=omega_r)
    return drive_controller(drive, controller, begun, errors=errors, switch=plant.switch)
