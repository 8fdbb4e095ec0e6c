"""What a simulation returns: quantities over time, their SI values, figures of merit, a picture."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc.distortion import thd
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc import trace
from directmpc.mpdcc.drive import Drive, FiveLevelDrive
from directmpc.mpdcc.metrics import switching_frequency
from directmpc.mptc import trace as mptc_trace
from directmpc.mptc.closed_loop import RPM
from directmpc.mptc.drive import MptcDrive
from directmpc.states import VectorSequence

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]


class Units(NamedTuple):
    """SI value of 1 in the unit of the drive file, for each kind of quantity."""

    current: float
    flux: float
    torque: float
    speed: float
    power: float


class SiResult(NamedTuple):
    """Quantities of a run in SI; every array has one row per control step.

    Attributes
    ----------
    time : (n,)
        s.
    current, flux : (n,) complex
        Stator current (A peak) and flux linkage (Wb peak), alpha + j*beta.
    torque : (n,)
        N*m; of a drive per unit, whose pole pairs its file does not say, N*m per pole pair.
    omega_r : (n,)
        Electrical rotor speed, rad/s.
    power : (n,)
        W.
    """

    time: FloatArray
    current: ComplexArray
    flux: ComplexArray
    torque: FloatArray
    omega_r: FloatArray
    power: FloatArray


@dataclass(frozen=True)
class SimulationResult:
    """A recorded closed loop; every array has one row per control step.

    Units are those of the drive file: per unit for MPDCC, SI for MPTC (A, Wb, N*m, rad/s).

    Attributes
    ----------
    drive
        What the controller was set up for.
    controller : str
        "ideal", "model", "rtl", or the name of the class of an own one.
    speed : float
        Stator angular frequency, pu or rad/s.
    time : (n,)
        s.
    current : (n,) complex
        Stator current, alpha + j*beta.
    flux : (n,) complex
        MPDCC: rotor flux linkage; MPTC: stator flux linkage.
    torque : (n,)
        Electromagnetic torque.
    omega_r : (n,)
        Electrical rotor speed.
    applied : (n, 3), (n,) or (n, 5)
        Switch positions, the voltage vector's number, or u1, u2, u3, t1, t2, during each step.
    trace : MpdccTrace or MptcTrace
        What the controller saw.
    decisions : Decisions or MptcDecisions
        What it decided on it.
    current_inside : (n * m,) complex, or None
        Methods of two and three vectors: stator current at m equal distances in every step.
    commutations : (n,) or None
        MPTC: legs that switch in each step.
    speed_ref, load : (n,) or None
        Speed reference and load torque of a run with a speed controller.
    """

    drive: Drive | KbestDrive | MptcDrive
    controller: str
    speed: float
    time: FloatArray
    current: ComplexArray
    flux: ComplexArray
    torque: FloatArray
    omega_r: FloatArray
    applied: IntArray | FloatArray
    trace: trace.MpdccTrace | mptc_trace.MptcTrace
    decisions: trace.Decisions | mptc_trace.MptcDecisions
    current_inside: ComplexArray | None = None
    commutations: IntArray | None = None
    speed_ref: FloatArray | None = None
    load: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.time)

    @property
    def power(self) -> FloatArray:
        """Active power: on the shaft of a machine, into a grid, or of a resistance.

        Returns
        -------
        ndarray of float64, shape (n,)
            pu, or W for MPTC.
        """
        if isinstance(self.drive, FiveLevelDrive):
            return self.drive.machine.power(self.current, self.flux, self.omega_r)
        return self.torque * self.omega_r / self.drive.machine.pole_pairs

    @property
    def phase_currents(self) -> FloatArray:
        """Currents of the phases a, b, c (inverse Clarke transformation; Paper A, eq. 1).

        Returns
        -------
        ndarray of float64, shape (n, 3)
            In the unit of `current`.
        """
        return _phases(self.current)

    def thd(self) -> float:
        """Total harmonic distortion of the phase currents, a ratio, rms of the three phases.

        Sampled once a step; with `current_inside` at all of its samples.

        Returns
        -------
        float
            A ratio: 0.05 is 5 %.

        Raises
        ------
        ValueError
            If the run does not cover one period of the stator frequency.
        """
        ts = self.drive.ts_pu if isinstance(self.drive, FiveLevelDrive) else self.drive.control.ts
        samples = self.phase_currents
        if self.current_inside is not None:
            ts *= len(self) / len(self.current_inside)
            samples = _phases(self.current_inside)
        found = thd(samples, self.speed, ts)
        return float(np.sqrt(np.mean(found**2)))

    @property
    def switching_frequency(self) -> float:
        """Mean switching frequency of a switch: how often it turns on in a second.

        Returns
        -------
        float
            Hz, over all switches of the converter.
        """
        ts = self.drive.control.ts
        if isinstance(self.trace, trace.MpdccTrace):
            assert isinstance(self.drive, FiveLevelDrive)
            positions = np.vstack([self.trace.s_prev[:1], self.applied])
            return switching_frequency(positions, ts, self.drive.converter).per_device
        assert self.commutations is not None
        return float(self.commutations.sum() / (6.0 * ts * len(self)))

    @property
    def _units(self) -> Units:
        """SI of 1 in the drive's unit."""
        if isinstance(self.drive, MptcDrive):
            return Units(1.0, 1.0, 1.0, 1.0, 1.0)
        base = self.drive.base
        omega = 2.0 * math.pi * base.frequency
        power = 1.5 * base.voltage * base.current
        return Units(base.current, base.voltage / omega, power / omega, omega, power)

    def si(self) -> SiResult:
        """The quantities in SI.

        Returns
        -------
        SiResult
            Of the same steps.
        """
        unit = self._units
        return SiResult(
            self.time, unit.current * self.current, unit.flux * self.flux,
            unit.torque * self.torque, unit.speed * self.omega_r, unit.power * self.power,
        )  # fmt: skip

    def plot(self) -> Any:
        """Draw speed, torque, phase currents and flux over time.

        On the left the unit of the drive file; on the right SI, of a two-level drive r/min.

        Returns
        -------
        matplotlib.figure.Figure
            Four axes below each other; ``figure.savefig("run.png")`` writes it.

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        from matplotlib import pyplot as plt  # here: who draws nothing does not need it

        unit = self._units
        figure, axes = plt.subplots(4, 1, sharex=True, figsize=(8.0, 9.0), layout="constrained")
        speed, torque, current, flux = axes
        if isinstance(self.drive, MptcDrive):
            name = f"{self.drive.control.method}, {self.drive.inverter.vdc:g} V dc link"
            labels = ("rad/s", "N m", "A", "Wb")
            right = [(speed, "r/min", 1.0 / (self.drive.machine.pole_pairs * RPM))]
            psi, reference = "stator flux", getattr(self.trace, "psi_ref", None)
        else:
            volts = math.sqrt(1.5) * self.drive.base.voltage
            name = f"{self.drive.controller}, {volts / 1e3:.3g} kV"
            labels, psi, reference = ("pu",) * 4, "rotor flux", None
            right = [
                (speed, "Hz, electrical", self.drive.base.frequency),
                (torque, "N m per pole pair", unit.torque),
                (current, "A", unit.current), (flux, "Wb", unit.flux),
            ]  # fmt: skip
        given = {"color": "0.5", "linestyle": "--", "linewidth": 1.0}
        if self.speed_ref is not None:
            speed.plot(self.time, self.speed_ref, **given, label="reference")
        speed.plot(self.time, self.omega_r, label="speed")
        torque.plot(self.time, self.torque, linewidth=0.5, label="torque")
        if self.load is not None:
            torque.plot(self.time, self.load, **given, label="load")
        for phase, values in zip("abc", self.phase_currents.T, strict=True):
            current.plot(self.time, values, linewidth=0.5, label=f"i_{phase}")
        if reference is not None:
            flux.plot(self.time, reference, **given, label="reference")
        flux.plot(self.time, np.abs(self.flux), linewidth=0.8, label=psi)
        for axis, what, of in zip(
            axes, ("electrical speed", "torque", "current", psi), labels, strict=True
        ):
            axis.set_ylabel(f"{what} ({of})")
            axis.grid(alpha=0.3)
            axis.legend(loc="upper right", fontsize="small", ncols=3)
        for axis, label, factor in right:
            other = axis.secondary_yaxis(
                "right", functions=(lambda y, f=factor: y * f, lambda y, f=factor: y / f)
            )
            other.set_ylabel(label)
        flux.set_xlabel("time (s)")
        known = {"model": "bit-true model", "rtl": "RTL", "ideal": "ideal controller"}
        engine = known.get(self.controller, self.controller)
        figure.suptitle(f"{name}, {1e6 * self.drive.control.ts:g} us: {engine}")
        return figure

    def table(self) -> dict[str, NDArray[Any]]:
        """Columns by name, each of shape (n,): time, the trace's, torque, then the decision's.

        The decision's columns begin with `next_`. ``pandas.DataFrame(result.table())`` takes it.

        Returns
        -------
        dict of str to ndarray, shape (n,)
            In the units of the drive file, `time` in s.
        """
        t, d = self.trace, self.decisions
        columns: dict[str, NDArray[Any]] = {"time": self.time}
        if isinstance(t, trace.MpdccTrace) and isinstance(d, trace.Decisions):
            names = ("is_alpha", "is_beta", "psir_alpha", "psir_beta")
            columns |= dict(zip(names, t.x_m.T, strict=True))
            names = ("v_n", "v_ph_a", "v_ph_b", "v_ph_c")
            columns |= dict(zip(names, t.x_inv.T, strict=True))
            columns |= {"iref_alpha": t.iref[:, 0], "iref_beta": t.iref[:, 1], "v_dc": t.vdc}
            columns |= {"omega_s": t.omega_s, "omega_r": t.omega_r}
            columns |= {f"s_{x}": t.s_prev[:, i] for i, x in enumerate("abc")}
            columns["torque"] = self.torque
            columns |= {f"next_s_{x}": d.s[:, i] for i, x in enumerate("abc")}
            columns |= {"next_held": d.held, "next_deadlock": d.deadlock, "next_length": d.length}
        elif isinstance(t, mptc_trace.MptcTrace) and isinstance(d, mptc_trace.MptcDecisions):
            columns |= {"is_alpha": t.i_s[:, 0], "is_beta": t.i_s[:, 1]}
            columns |= {"psis_alpha": t.psi_s[:, 0], "psis_beta": t.psi_s[:, 1]}
            columns |= {"omega_r": t.omega_r, "torque_ref": t.torque_ref, "psi_ref": t.psi_ref}
            columns |= {"u": t.u}
            if t.vectors is not None and t.times is not None:
                columns |= _sequence_columns("", t.vectors, t.times)
            columns |= {"torque": self.torque, "next_u": d.u}
            if d.vectors is not None and d.times is not None:
                columns |= _sequence_columns("next_", d.vectors, d.times)
        columns["next_saturated"] = d.saturated
        return columns

    def write_trace(self, path: str | os.PathLike[str]) -> None:
        """Write what the controller saw as a trace file that `make replay` takes.

        Parameters
        ----------
        path : str or path
            File to write or to replace.

        Raises
        ------
        TraceError
            If the file cannot be written; nothing is left behind then.
        """
        if isinstance(self.trace, trace.MpdccTrace):
            trace.write_trace(path, self.trace)
        else:
            mptc_trace.write_trace(path, self.trace)


def _phases(current: ComplexArray) -> FloatArray:
    """Currents of the phases a, b, c, shape (n, 3)."""
    turns = np.exp(-2j * np.pi / 3 * np.arange(3))
    return np.real(current[:, None] * turns)


def _sequence_columns(prefix: str, vectors: IntArray, times: FloatArray) -> dict[str, NDArray[Any]]:
    """Columns u1, u2, u3, t1, t2."""
    columns = [*vectors.T, *times.T]
    return {f"{prefix}{n}": c for n, c in zip(VectorSequence._fields, columns, strict=True)}
