"""What a simulation returns: quantities over time, their SI values, figures of merit, a picture."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from directmpc.api.kinds import kind_of
from directmpc.distortion import thd
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc import trace
from directmpc.mpdcc.drive import Drive
from directmpc.mptc import trace as mptc_trace
from directmpc.mptc.drive import MptcDrive

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]


class SiResult(NamedTuple):
    """Quantities of a run in SI; every array has one row per control step."""

    time: FloatArray  # (n,): s
    # current, flux: (n,): Stator current (A peak) and flux linkage (Wb peak), alpha + j*beta.
    current: ComplexArray
    flux: ComplexArray
    # (n,): N*m; of a drive per unit, whose pole pairs its file does not say, N*m per pole pair.
    torque: FloatArray
    omega_r: FloatArray  # (n,): Electrical rotor speed, rad/s
    power: FloatArray  # (n,): W


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
        return kind_of(self.drive).power(self)

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
        ts = kind_of(self.drive).ts(self.drive)
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
        return kind_of(self.drive).switching_frequency(self)

    def si(self) -> SiResult:
        """The quantities in SI.

        Returns
        -------
        SiResult
            Of the same steps.
        """
        unit = kind_of(self.drive).units(self.drive)
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

        look = kind_of(self.drive).look(self.drive)
        figure, axes = plt.subplots(4, 1, sharex=True, figsize=(8.0, 9.0), layout="constrained")
        speed, torque, current, flux = axes
        reference = getattr(self.trace, "psi_ref", None)
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
        flux.plot(self.time, np.abs(self.flux), linewidth=0.8, label=look.flux)
        for axis, what, of in zip(
            axes, ("electrical speed", "torque", "current", look.flux), look.units, strict=True
        ):
            axis.set_ylabel(f"{what} ({of})")
            axis.grid(alpha=0.3)
            axis.legend(loc="upper right", fontsize="small", ncols=3)
        for number, label, factor in look.right:
            other = axes[number].secondary_yaxis(
                "right", functions=(lambda y, f=factor: y * f, lambda y, f=factor: y / f)
            )
            other.set_ylabel(label)
        flux.set_xlabel("time (s)")
        known = {"model": "bit-true model", "rtl": "RTL", "ideal": "ideal controller"}
        engine = known.get(self.controller, self.controller)
        figure.suptitle(f"{look.title}, {1e6 * self.drive.control.ts:g} us: {engine}")
        return figure

    def table(self) -> dict[str, NDArray[Any]]:
        """Columns by name, each of shape (n,): time, the trace's, torque, then the decision's.

        The decision's columns begin with `next_`. ``pandas.DataFrame(result.table())`` takes it.

        Returns
        -------
        dict of str to ndarray, shape (n,)
            In the units of the drive file, `time` in s.
        """
        kind = kind_of(self.drive)
        columns = kind.columns(self.trace) | {"torque": self.torque} | kind.decided(self.decisions)
        return {"time": self.time} | columns | {"next_saturated": self.decisions.saturated}

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
        kind_of(self.drive).write_trace(path, self.trace)


def _phases(current: ComplexArray) -> FloatArray:
    """Currents of the phases a, b, c, shape (n, 3)."""
    turns = np.exp(-2j * np.pi / 3 * np.arange(3))
    return np.real(current[:, None] * turns)
