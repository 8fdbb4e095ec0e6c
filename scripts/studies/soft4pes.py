"""MPDCC beside the controllers of Soft4PES, on the medium-voltage drive of Soft4PES.

Soft4PES (TAU-Power-Electronic-Systems/Soft4PES, MIT licence) runs as it is, from a clone of
`COMMIT`: its machine, its converter, its simulation, its current controllers. MPDCC decides at the
same operating point with the same machine data. Its bounds are set so that it switches as often.
The switchings of all of them then go through one exact plant, which has to follow the states that
Soft4PES computed, and what comes out is measured alike.

The neutral point stands, since Soft4PES has none. Its file of parameters gives the resistances of
this machine in milliohms where its code takes ohms.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.compiled import njit
from directmpc.distortion import thd
from directmpc.loads.load import CLARKE_INVERSE, FloatArray, SteadyState
from directmpc.mpdcc import closed_loop, metrics
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.plant import plant_data, plant_step
from directmpc.mpdcc.trace import IntArray
from directmpc.mpdcc.variants import DEFAULT_VARIANT, VARIANTS
from scripts.shared import progress, tools
from scripts.shared.command import UsageError
from scripts.shared.tables import markdown
from scripts.shared.tools import ROOT, ToolError
from scripts.studies.pwm_loop import IDEAL

COMMIT = "5ac9ca9"
NEEDS = ("qpsolvers==4.13.0", "daqp==0.11.0", "matplotlib")
DRIVE = "npc3l_3kv3"
PAGE = ROOT / "reports" / "soft4pes.md"
BEGIN = "<!-- soft4pes: begin (written by python -m scripts soft4pes CLONE --page) -->"
END = "<!-- soft4pes: end -->"

FINE = 5e-6
"""Interval in which all of them are measured, s."""
TS = 50e-6
"""Control period of the direct controllers, s."""
SETTLE, PERIODS = 5, 10
"""Periods of 50 Hz that are not measured, and those that are."""
CARRIERS = (1.5e-3, 1e-3, 5e-4)
"""Half periods of the carrier, s: a switch turns on about once in four of them."""
WEIGHTS = {1: (2e-3, 4e-3, 8e-3), 2: (8e-3, 1.6e-2, 3.2e-2)}
"""Horizon of Soft4PES's direct controller -> its weights on switching."""
LEAST, MOST = 0.02, 0.4
"""Bounds of the current that are tried, per unit."""

HEAD = (
    "Soft4PES", "Hz", "THD", "ripple", "MPDCC, SE: Hz", "THD", "ripple", "SESE: Hz", "THD", "ripple"
)  # fmt: skip


@dataclass(frozen=True)
class Found:
    """Figures of one run."""

    fsw: float  #: Turn-ons of a switch, Hz.
    thd: float  #: Of the currents, root mean square of the phases, a ratio.
    ripple: float  #: Root mean square of what the torque differs from its mean by, of that mean.


class Theirs:
    """Soft4PES from its clone, and its drive."""

    def __init__(self, clone: Path) -> None:
        told = ["git", "-C", str(clone), "rev-parse", "HEAD"]
        said = subprocess.run(told, capture_output=True, text=True, check=False)
        if not said.stdout.startswith(COMMIT):
            raise UsageError(
                f"argument CLONE: {clone} is no clone of Soft4PES whose commit {COMMIT} is "
                "checked out"
            )
        sys.path.insert(0, str(clone))
        try:
            from soft4pes import model
            from soft4pes.control import common, lin, modulation, mpc
            from soft4pes.sim import Simulation
            from soft4pes.utils import Sequence
        except ImportError as error:
            raise ToolError(f"{error}: Soft4PES needs pip install {' '.join(NEEDS)}") from None
        finally:
            sys.path.remove(str(clone))
        self._model, self._simulation = model, Simulation
        self._common, self._lin, self._modulation, self._mpc = common, lin, modulation, mpc
        file = clone / "examples" / "machine" / "pars" / "machine_parameter_sets.json"
        read = json.loads(file.read_text(encoding="utf-8"))
        self._machine = read["machines"]["MV_Induction_Machine"]
        self._converter = read["converters"]["3L_MV_Converter"]
        rated = self._machine["pf"]  # its torque is per unit of the apparent power
        self._references = SimpleNamespace(
            T_ref_seq=Sequence(np.array([0, 1e3]), np.full(2, rated))
        )
        self.rated = rated

    def system(self) -> Any:
        """A new instance of the drive, in the steady state of rated torque and flux."""
        own = self._machine
        ratings = {key: own[key] for key in ("Vm_R_SI", "Im_R_SI", "fm_R_SI", "npp", "pf")}
        base = self._model.machine.BaseMachine(**ratings)
        ohms = {key: own[key] / 1e3 for key in ("Rs_SI", "Rr_SI")}
        henries = {key: own[key] for key in ("Lls_SI", "Llr_SI", "Lm_SI")}
        par = self._model.machine.InductionMachineParameters(
            fs_SI=own["fm_R_SI"], pf=own["pf"], base=base, **ohms, **henries
        )
        converter = self._converter
        conv = self._model.conv.Converter(
            v_dc_SI=converter["Vdc_SI"], nl=converter["conv_nl"], base=base
        )
        return self._model.machine.InductionMachine(
            par=par, conv=conv, base=base, psiS_mag_ref=1, T_ref_init=1
        )

    def run(self, loop: Any, system: Any, ts: float, **around: Any) -> tuple[IntArray, FloatArray]:
        """Positions and states (n, 4) at intervals of `FINE`, from the start."""
        control = self._common.ControlSystem(
            control_loops=[loop], ref_seq=self._references, Ts=ts, **around
        )
        made = self._simulation(system, control, Ts_sim=FINE, disc_method="exact_discretization")
        steps = round((SETTLE + PERIODS) * 0.02 / ts)
        with contextlib.redirect_stdout(io.StringIO()):
            data = made.simulate((steps + 0.5) * ts).sys
        if len(data.x) != round(steps * ts / FINE):
            raise ToolError(f"Soft4PES made {len(data.x)} steps of {steps * ts} s")
        return np.rint(data.u_abc).astype(np.int64) + 1, np.asarray(data.x)

    def direct(self, horizon: int, weight: float) -> tuple[IntArray, FloatArray]:
        """Its direct model predictive current control."""
        loop = self._mpc.algorithms.IMCurrCtr(
            solver=self._mpc.solvers.BranchAndBound(), lambda_u=weight, Np=horizon,
            disc_method="exact_discretization",
        )  # fmt: skip
        return self.run(loop, self.system(), TS)

    def modulated(self, ts: float, injection: bool) -> tuple[IntArray, FloatArray]:
        """Its field-oriented control and carrier PWM; space-vector PWM with the injection."""
        system, around = self.system(), {"pwm": self._modulation.CarrierPWM()}
        if injection:
            around["common_mode_inj"] = self._modulation.CommonModeInjection(mode="MinMax")
        return self.run(self._lin.FOCCurrCtr(sys=system), system, ts, **around)


@njit
def _follow(plant, state, positions, omega_r, vdc, found):
    """Fill the currents and flux of a plant under positions."""
    for k in range(len(positions)):
        found[k] = state[:4]
        plant_step(plant, state, positions[k], omega_r, vdc)


class Bench:
    """The plant that all of them are measured on, and MPDCC in front of it."""

    def __init__(self, theirs: Theirs) -> None:
        system = theirs.system()
        par = system.par
        machine = {"rs": par.Rs, "rr": par.Rr, "xls": par.Xls, "xlr": par.Xlr, "xm": par.Xm}
        self.drive = drive = load_mpdcc_drive(DRIVE).changed(
            machine={key: float(value) for key, value in machine.items()},
            inverter={"vdc": float(system.conv.v_dc)},
            control={"ts": TS, "capacitor_filter": 0},
        )
        self.w, self.first = 2 * math.pi * drive.base.frequency, np.asarray(system.x)
        self.omega_r = float(system.wr)
        i_d, i_q = system.calc_stator_current(system.psiR_mag_ref, theirs.rated)
        flux = float(system.psiR_mag_ref)
        omega = self.omega_r + par.Rr * par.Xm / par.Xr * i_q / flux
        current = complex(i_d, i_q)
        stator = (par.D * current + par.Xm * flux) / par.Xr
        torque = par.Xm / par.Xr * flux * i_q
        self.factor = float(par.Xm / par.Xr)
        self.point = SteadyState(
            float(omega), self.omega_r, current, complex(flux),
            par.Rs * current + 1j * omega * stator, float(torque),
        )  # fmt: skip

    def states(self, positions: IntArray, first: FloatArray) -> FloatArray:
        """Currents and flux (n, 4) of the exact plant under positions at intervals of `FINE`."""
        drive = self.drive
        plant = plant_data(drive.machine, IDEAL, IDEAL, FINE * self.w, drive.converter)
        state, found = np.zeros(8), np.empty((len(positions), 4))
        state[:4] = first
        _follow(plant, state, positions, self.omega_r, float(drive.inverter.vdc), found)
        return found

    def figures(self, positions: IntArray, states: FloatArray) -> Found:
        """Figures of a run from its start on, of which the first periods are left out."""
        kept = slice(round(SETTLE * 0.02 / FINE), None)
        positions, states = positions[kept], states[kept]
        currents = states[:, :2] @ CLARKE_INVERSE.T
        each = thd(currents, self.point.omega_s, FINE * self.w)
        torque = self.factor * (states[:, 2] * states[:, 1] - states[:, 3] * states[:, 0])
        leg = self.drive.converter
        return Found(
            metrics.switching_frequency(positions, FINE, leg).per_device,
            float(np.sqrt(np.mean(each**2))),
            float(torque.std() / torque.mean()),
        )

    def of(self, run: tuple[IntArray, FloatArray]) -> Found:
        """Figures of a run of Soft4PES, on this plant."""
        positions, theirs = run
        ours = self.states(positions, self.first)
        if (apart := float(np.abs(ours - theirs).max())) > 1e-6:
            raise ToolError(f"the two plants differ by {apart:.2g} pu under the same switchings")
        return self.figures(positions, ours)

    def mpdcc(self, horizon: str, bound: float) -> Found:
        """Figures of MPDCC's bit-true model with a bound of the current."""
        drive: Drive = self.drive.with_control(switching_horizon=horizon, bound_current=bound)
        still = drive.inverter.model_copy(update={"xdc": IDEAL})
        drive = drive.model_copy(update={"inverter": still})
        steps = round((SETTLE + PERIODS) * 0.02 / TS)
        turned = self.point.i_s * np.exp(1j * self.point.omega_s * drive.ts_pu * np.arange(steps))
        profile = closed_loop.Profile(
            self.point, np.full(steps, self.point.omega_s), np.full(steps, self.omega_r),
            np.full(steps, float(drive.inverter.vdc)), turned,
        )  # fmt: skip
        chosen = VARIANTS[DEFAULT_VARIANT]
        registers = chosen.registers(drive).array()
        run = closed_loop.simulate(drive, chosen.decide, registers, profile, steps, disturbance=0.0)
        positions = np.repeat(run.positions[1:], round(TS / FINE), axis=0)
        return self.figures(positions, self.states(positions, run.state[0, :4]))

    def as_often(self, horizon: str, fsw: float) -> Found:
        """MPDCC with the bound at which it switches nearest to so often."""
        low, high = LEAST, MOST
        tried: list[Found] = []
        for _ in range(8):
            middle = math.sqrt(low * high)
            tried.append(self.mpdcc(horizon, round(middle, 4)))
            low, high = (middle, high) if tried[-1].fsw > fsw else (low, middle)
        return min(tried, key=lambda found: abs(found.fsw - fsw))


def table(clone: Path) -> str:
    """Run all of them."""
    theirs = Theirs(clone)
    bench = Bench(theirs)
    runs: list[tuple[str, Callable[[], tuple[IntArray, FloatArray]]]] = []
    for ts in CARRIERS:
        for injection, name in ((False, "carrier PWM"), (True, "space-vector PWM")):
            runs.append((f"FOC, {name}", lambda ts=ts, on=injection: theirs.modulated(ts, on)))
    for horizon, weights in WEIGHTS.items():
        for weight in weights:
            runs.append(
                (
                    f"direct MPC, {horizon} step{'s' * (horizon > 1)}, weight {weight:g}",
                    lambda n=horizon, w=weight: theirs.direct(n, w),
                )
            )
    rows = []
    with progress.counter("Soft4PES and MPDCC", len(runs)) as advance:
        for name, run in runs:
            found = bench.of(run())
            others = [bench.as_often(horizon, found.fsw) for horizon in ("SE", "SESE")]
            cells = [
                text
                for one in (found, *others)
                for text in (
                    f"{one.fsw:.0f}",
                    f"{100 * one.thd:.1f} %",
                    f"{100 * one.ripple:.1f} %",
                )
            ]
            rows.append((found.fsw, [name, *cells]))
            advance()
    rows.sort(key=lambda row: row[0])
    commit, dirty = tools.git_state()
    return (
        f"{markdown(HEAD, [cells for _, cells in rows], 'lr')}\n\n"
        f"Commit {commit[:9]}{', with changes' * dirty}, Soft4PES {COMMIT}."
    )
