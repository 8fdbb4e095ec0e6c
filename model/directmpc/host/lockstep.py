"""Closed loop over a link, step by step: the board decides, a float64 plant is simulated here.

The board need not keep time: each step is one request and one reply. Every decision can be compared
with the bit-true model's on the states that the plant went through.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from directmpc.api.controllers import ModelController, state_of
from directmpc.api.drive_file import AnyDrive
from directmpc.api.kinds import kind_of
from directmpc.host.board import Board, decision_of
from directmpc.host.measurements import Encoder
from directmpc.host.protocol import Decision as Answer
from directmpc.host.protocol import Flag
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc import capacitor_observer
from directmpc.mpdcc import closed_loop as mpdcc_loop
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.formats import MEASUREMENTS
from directmpc.mpdcc.leakage import LeakageEstimate
from directmpc.mpdcc.trace import Decisions, MpdccTrace
from directmpc.mpdcc.variants import DEFAULT_VARIANT
from directmpc.mptc import closed_loop as mptc_loop
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.sensorless import SensorlessController
from directmpc.states import Controller, Decision, State, ramped

IntArray = NDArray[np.int64]
_VOLTAGES = [list(MEASUREMENTS).index(name) for name in ("v_n", "v_ph_a", "v_ph_b", "v_ph_c")]


@dataclass(frozen=True)
class LockStep:
    """What a run over a link gave."""

    steps: int  # Decisions made
    differing: int  # Decisions that differ from the bit-true model's on the same inputs
    seconds: float  # Time it took
    cycles: IntArray  # (n,) clock cycles of each decision, counted by the board
    gates: IntArray  # (n,) gate signals at the time of each reply
    running: IntArray  # (n,) whether the gate guard let them through
    faults: int  # Latched faults at the end

    @property
    def rate(self) -> float:
        """Steps a second; 0 where no time has passed."""
        return self.steps / self.seconds if self.seconds else 0.0


@contextmanager
def gates_enabled(board: Board) -> Iterator[None]:
    """Start the drive, and turn it off again whatever happens.

    LinkError or TrippedError where it cannot be started.
    """
    board.start()
    try:
        yield
    finally:
        board.stop()


class _Rehearsal:
    """Stands for a board in `warm_up`: what was applied stays, a sequence is the model's."""

    def __init__(self, drive: AnyDrive, variant: str) -> None:
        self._model = ModelController(drive, variant)
        self._decided: Any = None

    def forget_estimates(self) -> None:
        """It has none."""

    def refuse_unmeasured(self, state: State) -> None:
        """Note what the model decides."""
        self._decided = self._model.decide(state).apply

    def answer(self, words: list[int], position: int, name: str) -> Answer:
        """One step."""
        return Answer(position, 0, 1, 1, 0, 0)

    def sequence(self) -> Any:
        """What the model decided last: a sequence, or one vector."""
        return self._decided


def warm_up(drive: AnyDrive, variant: str = DEFAULT_VARIANT, *, sensorless: bool = False) -> None:
    """Run a loop without a board: what it needs is compiled before a gate is on.

    No step of a loop waits for it while a watchdog runs. And a signal that ends the program may
    crash a compiler: with gates on only the watchdog would turn them off. ValueError if the model
    cannot represent the drive.
    """
    board: Any = _Rehearsal(drive, variant)
    controller = BoardController(board, drive, variant, sensorless=sensorless)
    kind_of(drive).warm_up(drive, controller)


class BoardController:
    """A board as a controller (`directmpc.Controller`), every decision compared with the model's.

    A decision is one request and one reply. Where the drive has capacitor filters or an estimate of
    the leakage, those of the board begin anew, and the model has its own.

    Parameters
    ----------
    board : Board
        Board that has been loaded with `drive`.
    drive : Drive, KbestDrive or MptcDrive
        What the model beside it decides for.
    variant : str
        "fast" or "paper": which model of MPDCC it is.
    sensorless : bool
        Whether the board has been loaded to estimate the speed; the model beside it does too.
    ramp_down : tuple of int
        Step at which the reference begins to fall, and in how many it is at zero; never by default.
    progress : callable, optional
        Called with the number of decisions made.

    Attributes
    ----------
    answers : list of protocol.Decision
        What the board replied so far.
    differing : int
        Decisions so far that differ from the bit-true model's on the same state.
    leakage : LeakageEstimate or None
        The model's estimate of the leakage where the drive has one.

    Raises
    ------
    ValueError
        If there is no such variant, or the model cannot represent the drive.
    """

    def __init__(
        self,
        board: Board,
        drive: AnyDrive,
        variant: str = DEFAULT_VARIANT,
        *,
        sensorless: bool = False,
        ramp_down: tuple[int, int] = (0, 0),
        progress: Callable[[int], None] | None = None,
    ) -> None:
        self._ramp_down = ramp_down
        self.board, self.drive = board, drive
        self.answers: list[Answer] = []
        self.differing = 0
        self._progress = progress
        model = ModelController(drive, variant)
        self._model: Controller = model
        if sensorless and kind_of(drive).sensorless:
            self._model = SensorlessController(drive, model, engine="model")
        if sensorless or kind_of(drive).remembers(drive):
            board.forget_estimates()
        self._encoder = Encoder(drive)
        self._filters: capacitor_observer.CapacitorFilter | None = None
        if getattr(drive.control, "capacitor_filter", 0):
            self._filters = capacitor_observer.CapacitorFilter(drive)
            board.forget_estimates()
        self.leakage: LeakageEstimate | None = None
        if getattr(drive.control, "leakage_estimate", False):
            self.leakage, self._scaled = LeakageEstimate(drive), model
            self._before: tuple[int, ...] = (0, 0, 0)
            board.forget_estimates()

    def decide(self, state: State | Mapping[str, Any]) -> Decision:
        """Let the board decide on one step.

        Parameters
        ----------
        state : MpdccState, MptcState or mapping
            As the drive's kind is, per unit or SI; or a row of its trace by column names.

        Returns
        -------
        MpdccDecision or MptcDecision
            `saturated` also says whether a measurement lay outside its word.

        Raises
        ------
        LinkError
            If the board does not answer, or the core gives no decision.
        RefusedError
            If the board refuses the step.
        TrippedError
            If the drive was started and the gate guard holds a fault.
        TypeError, StateError
            If the state is none.
        """
        state = known = state_of(self.drive, state)
        begin, over = self._ramp_down
        if over and len(self.answers) >= begin:
            left = max(begin + over - 1 - len(self.answers), 0)
            state = known = ramped(known, left / over)
        self.board.refuse_unmeasured(known)
        words, clipped, position = self._encoder.words(known)
        answer = self.board.answer(words, position, f"step {len(self.answers)}")
        self.answers.append(answer)
        decision = decision_of(self.drive.controller, answer, clipped, self.board.sequence())
        self.differing += decision != self._modelled(words, state, clipped)
        if self._progress is not None:
            self._progress(len(self.answers))
        return decision

    def _modelled(
        self, words: list[int], state: State | Mapping[str, Any], clipped: bool
    ) -> Decision:
        """The model's decision, behind its filters where the drive has them."""
        known = state_of(self.drive, state)
        if self._filters is None and self.leakage is None:
            return self._model.decide(known)
        used = list(words)
        if self._filters is not None:
            v_n, *v_ph = self._filters.voltages(words, known.applied)
            known = replace(known, v_n=v_n, v_ph=tuple(v_ph))
            for place, value in zip(_VOLTAGES, (v_n, *v_ph), strict=True):
                used[place] = round(value * MEASUREMENTS[list(MEASUREMENTS)[place]].scale)
        if self.leakage is not None:
            self._scaled.scale(self.leakage)
            # with delay compensation the positions given until now take effect
            delayed = self.drive.control.delay_compensation
            self.leakage.step(used, self._before if delayed else known.applied)
            self._before = tuple(known.applied)
        found = self._model.decide(known)
        return replace(found, saturated=found.saturated or clipped)

    def column(self, value: Callable[[Answer], int]) -> IntArray:
        """One value of every reply.

        Parameters
        ----------
        value : callable
            Takes a reply and returns the value.

        Returns
        -------
        ndarray of int64, shape (n,)
            One row per decision.
        """
        return np.array([value(answer) for answer in self.answers], dtype=np.int64)

    def summary(self, seconds: float) -> LockStep:
        """What a run around this controller gave.

        Parameters
        ----------
        seconds : float
            Time it took.

        Returns
        -------
        LockStep
            Of all decisions so far.
        """
        return LockStep(
            steps=len(self.answers),
            differing=self.differing,
            seconds=seconds,
            cycles=self.column(lambda answer: answer.cycles),
            gates=self.column(lambda answer: answer.gates),
            running=self.column(lambda answer: answer.has(Flag.ENABLED)),
            faults=self.answers[-1].faults if self.answers else 0,
        )


def run_mpdcc(
    board: Board,
    drive: Drive | KbestDrive,
    speed: float,
    steps: int,
    variant: str,
    progress: Callable[[int], None] | None = None,
    *,
    ramp_down: int = 0,
) -> tuple[LockStep, MpdccTrace, Decisions]:
    """MPDCC or K-best at rated current from the steady state at a stator frequency per unit.

    Summary, what the board saw as a trace, and its decisions. In the last `ramp_down` steps the
    reference falls to zero. LinkError, RefusedError or TrippedError of the board; ValueError
    without a steady state.
    """
    profile = mpdcc_loop.constant_profile(drive, mpdcc_loop.OperatingPoint(speed), steps)
    ramp = (steps - ramp_down, ramp_down)
    controller = BoardController(board, drive, variant, ramp_down=ramp)
    began = time.perf_counter()
    # a transition that the inverter does not have is a decision that differs: counted, no error
    run = mpdcc_loop.drive_controller(
        drive, controller, profile, steps, checked=False, filtered=False, progress=progress
    )
    done = controller.summary(time.perf_counter() - began)
    exhausted = controller.column(lambda answer: answer.has(Flag.EXHAUSTED))
    shares = np.clip((steps - 1 - np.arange(steps)) / max(ramp_down, 1), 0.0, 1.0)
    seen = replace(run.seen, iref=run.seen.iref * shares[:, None]) if ramp_down else run.seen
    return done, seen, replace(run.decisions, cycles=done.cycles, exhausted=exhausted)


def run_mptc(
    board: Board,
    drive: MptcDrive,
    rpm: float,
    load: float,
    psi_ref: float,
    steps: int,
    progress: Callable[[int], None] | None = None,
    *,
    sensorless: bool = False,
    ramp_down: int = 0,
) -> LockStep:
    """A two-level drive at a constant operating point; the decision acts one step later.

    `rpm` in 1/min, torque in N*m, flux in Wb. In the last `ramp_down` steps the reference falls to
    zero. LinkError, RefusedError or TrippedError of the board; ValueError beyond the breakdown
    torque at this flux.
    """
    scenario = mptc_loop.constant(drive, rpm, load, psi_ref, steps)
    ramp = (steps - ramp_down, ramp_down)
    controller = BoardController(
        board, drive, sensorless=sensorless, ramp_down=ramp, progress=progress
    )
    began = time.perf_counter()
    mptc_loop.drive_controller(drive, controller, scenario)
    return controller.summary(time.perf_counter() - began)
