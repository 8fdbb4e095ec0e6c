"""Operation without a speed sensor (Paper B, section 6.2): a controller on estimates, and its loop.

The controller measures the current alone. Flux and speed are those of `speed_observer`, and so is
the speed that a speed PI sees, behind a low-pass. `simulate` runs any method with a shaft and a
speed PI; `SensorlessController` is any `Controller` behind the observer, for loops of others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from directmpc.compiled import njit
from directmpc.mptc import bit_true, bit_true_sequences, drive_twin, speed_observer
from directmpc.mptc import formats as f
from directmpc.mptc.closed_loop import Observing, Run, Scenario, controller_of, no_wish, run
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.errors import EXACT, CompiledErrors, MptcErrors
from directmpc.mptc.plant import PlantParameters
from directmpc.mptc.sequence import mean_voltage, whole
from directmpc.mptc.speed_observer import SpeedGains
from directmpc.mptc.trace import FloatArray
from directmpc.states import Controller, MptcDecision, MptcState, VectorSequence, mptc_decision

FILTER_TIME = 3.2e-3
"""Time constant of the low-pass between the estimate and the speed PI, s.

With `speed_observer.KP` and `KI` the estimate has its own resonance near 800 rad/s, where noise of
the current is passed on most. The low-pass lies well below it, and well above the speed loop.
"""


@dataclass(frozen=True)
class CurrentErrors:
    """What the current measurement adds; ValueError if a number makes no sense."""

    noise: float = 0.0  # Standard deviation of each component, A
    bits: int = 0  # Word length of the converter, full scale `current_max`; 0: not quantised
    seed: int = 1  # Of the noise

    def __post_init__(self) -> None:
        if not (np.isfinite(self.noise) and self.noise >= 0.0):
            raise ValueError(f"noise: got {self.noise!r:.40}; 0 or more A is needed")
        if self.bits != 0 and not 2 <= self.bits <= 32:
            raise ValueError(f"bits: got {self.bits!r:.40}; 0, or from 2 to 32, is needed")

    def compiled(self, drive: MptcDrive, n: int) -> CompiledErrors:
        """The errors of a run for compiled code."""
        rng = np.random.default_rng(self.seed)
        noise = self.noise * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
        lsb = drive.control.current_max / 2 ** (self.bits - 1) if self.bits else 0.0
        return EXACT._replace(added=np.column_stack([noise.real, noise.imag]), lsb=lsb)


@njit
def _estimates(p, measured):
    """Speed (rad/s) and flux (Wb) at k."""
    return speed_observer.speed(p, measured), p.state[1]


@njit
def _advance(p, measured, omega, applied, vdc):
    """Take the observer to k+1; never saturated."""
    speed_observer.advance(p, measured, omega, mean_voltage(applied, p.machine.unit) * vdc)
    return 0


class _Twin(NamedTuple):
    """The bit-true observer in a loop of real numbers.

    `scales`, `lows` and `highs` are those of ``bit_true.parameters``; `flux` is the estimate as the
    ports have it, Wb.
    """

    coefficient: np.ndarray
    state: np.ndarray
    flux: np.ndarray
    scales: FloatArray
    lows: FloatArray
    highs: FloatArray


@njit
def _encoded(p, measured, vdc):
    """Current and dc-link voltage as the ports take them, and whether one did not fit."""
    seen, clipped = bit_true.encode_row(p.scales, p.lows, p.highs, measured, 0j, 0.0, vdc, 0.0, 0.0)
    return np.array([seen[0], seen[1], seen[5]]), clipped


@njit
def _estimates_words(p, measured):
    """``_estimates`` bit by bit; both are values that the ports take without rounding."""
    m, _ = _encoded(p, measured, 0.0)
    now = speed_observer.speed_words(p.coefficient, p.state, m[0], m[1])
    return now.port / p.scales[4], p.flux[0]


@njit
def _advance_words(p, measured, omega, applied, vdc):
    """``_advance`` bit by bit, and whether a word did not hold its value."""
    m, clipped = _encoded(p, measured, vdc)
    _, psi_a, psi_b, saturated = speed_observer.step_words(
        p.coefficient, p.state, m, bit_true_sequences.in_steps(applied)
    )
    p.flux[0] = complex(psi_a / p.scales[2], psi_b / p.scales[3])
    return saturated | clipped


def _twin(
    drive: MptcDrive, gains: SpeedGains | None, current: complex, flux: complex, omega_r: float
) -> _Twin:
    """Bit-true observer that begins with a state."""
    _, scales, lows, highs = bit_true.parameters(drive)
    words = drive_twin.parameters(drive)
    begun = drive_twin.state_at(drive, words, current, flux)
    base = drive.control.speed_max * 32768.0 / 32767.0
    integral = round(omega_r / base * 2 ** (f.FRACTION + speed_observer.GUARD))
    state = np.array([*begun[:4], integral], dtype=np.int64)
    coefficient = speed_observer.array(speed_observer.coefficients(drive, gains))
    seen = np.array([begun[4] / scales[2] + 1j * begun[5] / scales[3]])
    return _Twin(coefficient, state, seen, scales, lows, highs)


def _observer(
    drive: MptcDrive,
    engine: str,
    gains: SpeedGains | None,
    current: complex,
    flux: complex,
    omega_r: float,
) -> tuple[Any, Any, Any]:
    """Observer that begins with a state, and its two steps."""
    if engine not in ("ideal", "model"):
        raise ValueError(f'engine: got {engine!r:.40}; it must be "ideal" or "model"')
    begun = complex(current), complex(flux), float(omega_r)
    known = speed_observer.speed_observer(drive, gains, *begun)  # checks the gains for both
    if engine == "ideal":
        return known, _estimates, _advance
    return _twin(drive, gains, *begun), _estimates_words, _advance_words


class _Seen(NamedTuple):
    """An observer in a loop, with the low-pass between its estimate and the speed PI."""

    observer: Any
    share: float
    smooth: FloatArray


@njit
def _see(p, measured, psi, omega_r):
    """Flux and speed for the controller, speed for the PI."""
    omega, flux = _estimates(p.observer, measured)
    p.smooth[0] += p.share * (omega - p.smooth[0])
    return flux, omega, p.smooth[0]


@njit
def _see_words(p, measured, psi, omega_r):
    """``_see`` with the bit-true observer."""
    omega, flux = _estimates_words(p.observer, measured)
    p.smooth[0] += p.share * (omega - p.smooth[0])
    return flux, omega, p.smooth[0]


@njit
def _go_on(p, measured, omega, applied, vdc):
    return _advance(p.observer, measured, omega, applied, vdc)


@njit
def _go_on_words(p, measured, omega, applied, vdc):
    return _advance_words(p.observer, measured, omega, applied, vdc)


def observing(
    drive: MptcDrive,
    engine: str,
    scenario: Scenario,
    gains: SpeedGains | None = None,
    filter_time: float = FILTER_TIME,
) -> Observing:
    """The observer in a loop, in float64 ("ideal") or bit-true ("model"), from a scenario's state.

    `filter_time` (s) is that of the low-pass to the speed PI, none for a control period or less;
    the controller always has the estimate itself. ValueError for a wrong sign, or a value that the
    model cannot represent.
    """
    if not (np.isfinite(filter_time) and filter_time >= 0.0):
        raise ValueError(f"filter_time: got {filter_time!r:.40}; 0 or more s is needed")
    ts, omega_r = drive.control.ts, float(scenario.omega_r)
    known, _, _ = _observer(drive, engine, gains, scenario.current, scenario.flux, omega_r)
    seen = _Seen(known, min(1.0, ts / max(filter_time, ts)), np.array([omega_r]))
    return Observing(*((_see, _go_on) if engine == "ideal" else (_see_words, _go_on_words)), seen)


def simulate(
    drive: MptcDrive,
    scenario: Scenario,
    *,
    engine: str = "ideal",
    gains: SpeedGains | None = None,
    plant: PlantParameters | None = None,
    errors: CurrentErrors | MptcErrors | None = None,
    filter_time: float = FILTER_TIME,
) -> Run:
    """Run a closed loop on estimates, with an engine's controller; ValueError as `observing`."""
    return run(
        drive, scenario, controller_of(drive, engine), wish=(no_wish, 0),
        observing=observing(drive, engine, scenario, gains, filter_time), plant=plant, inside=True,
        errors=(errors or CurrentErrors()).compiled(drive, len(scenario.torque_ref)),
    )  # fmt: skip


class SensorlessController:
    """A controller that sees estimates in place of the flux and the speed that it is given.

    Parameters
    ----------
    drive : MptcDrive
        What the observer knows.
    controller : Controller
        Asked with the measured current, the estimated flux and the estimated speed.
    gains : SpeedGains, optional
        Of the observer.
    engine : str
        "ideal": the observer in float64; "model": bit-true.

    Attributes
    ----------
    seen : list of tuple
        Estimated flux (Wb) and speed (rad/s) in every period so far.

    Raises
    ------
    ValueError
        If a gain has the wrong sign.
    """

    def __init__(
        self,
        drive: MptcDrive,
        controller: Controller,
        gains: SpeedGains | None = None,
        engine: str = "ideal",
    ) -> None:
        self.controller = controller
        self.seen: list[tuple[complex, float]] = []
        self._drive, self._gains, self._engine = drive, gains, engine
        self.begin(0j, 0j, 0.0)

    def begin(self, current: complex, flux: complex, omega_r: float) -> None:
        """Give the observer a state to start from; without, all is zero.

        Parameters
        ----------
        current, flux : complex
            Stator current (A) and stator flux (Wb).
        omega_r : float
            Electrical speed, rad/s.
        """
        observed = _observer(self._drive, self._engine, self._gains, current, flux, omega_r)
        self._parameters, self._estimates, self._advance = observed
        self.seen.clear()

    def decide(self, state: MptcState) -> MptcDecision:
        """Estimate, then let the controller decide.

        Parameters
        ----------
        state : MptcState
            Its current, references and what is being applied count.

        Returns
        -------
        MptcDecision
            The controller's; `saturated` is set as well where a word of the observer did not hold
            its value.
        """
        omega, flux = self._estimates(self._parameters, state.current)
        self.seen.append((flux, omega))
        shown = replace(state, flux=flux, omega_r=omega)
        decision = mptc_decision(self.controller.decide(shown), len(self.seen) - 1)
        applied = whole(state.applied) if isinstance(state.applied, int) else state.applied
        vdc = self._drive.inverter.vdc
        sequence = VectorSequence(*map(int, applied[:3]), *map(float, applied[3:]))
        saturated = self._advance(self._parameters, state.current, omega, sequence, vdc)
        return replace(decision, saturated=True) if saturated else decision
