"""Closed loop over a link, step by step: the board decides, a float64 plant is simulated here.

The board need not keep time: each step is one request and one reply. Every decision can be compared
with the bit-true model's on the states that the plant went through.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from directmpc.host.board import Board
from directmpc.host.link import LinkError
from directmpc.host.protocol import Flag, packed_positions
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.closed_loop import OperatingPoint, constant_profile, initial_conditions
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.plant import Plant
from directmpc.mpdcc.trace import Decisions, MpdccTrace
from directmpc.mpdcc.variants import FIELDS, VARIANTS, count_differences, decisions_of
from directmpc.mptc import bit_true as mptc_bit_true
from directmpc.mptc import closed_loop as mptc_closed_loop
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.plant import plant_parameters
from directmpc.mptc.plant import step as mptc_step

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class LockStep:
    """What a run over a link gave.

    Attributes
    ----------
    steps
        Decisions made.
    differing
        Decisions that differ from the bit-true model's on the same inputs.
    seconds
        Time it took.
    cycles
        (n,) clock cycles of each decision, counted by the board.
    gates
        (n,) gate signals at the time of each reply.
    running
        (n,) whether the gate guard let them through.
    faults
        Latched faults at the end.
    """

    steps: int
    differing: int
    seconds: float
    cycles: IntArray
    gates: IntArray
    running: IntArray
    faults: int

    @property
    def rate(self) -> float:
        """Steps a second.

        Returns
        -------
        float
            1/s; 0 where no time has passed.
        """
        return self.steps / self.seconds if self.seconds else 0.0


@contextmanager
def gates_enabled(board: Board) -> Iterator[None]:
    """Clear faults, enable the gate guard, and disable it again whatever happens.

    Parameters
    ----------
    board : Board
        Board that has been loaded.

    Yields
    ------
    None
        While the gates may switch.

    Raises
    ------
    LinkError
        If the board does not answer.
    """
    board.write("system.control", enable=0, own_positions=0)
    faults = board.read("system.faults")
    board.write("system.faults", **faults)
    board.write("system.control", enable=1, own_positions=0)
    try:
        yield
    finally:
        board.write("system.control", enable=0, own_positions=0)


def run_mpdcc(
    board: Board,
    drive: Drive,
    speed: float,
    steps: int,
    variant: str,
    progress: Callable[[int], None] | None = None,
) -> tuple[LockStep, MpdccTrace, Decisions]:
    """MPDCC at rated current from the steady state.

    Parameters
    ----------
    board : Board
        Board of an MPDCC core that has been loaded with `drive`.
    drive : Drive
        Machine and inverter of the plant; also what the model compares with.
    speed : float
        Stator frequency, per unit.
    steps : int
        Control steps.
    variant : str
        "fast" or "paper": which model decides on the same states.
    progress : callable, optional
        Called with the number of steps made.

    Returns
    -------
    run : LockStep
        Summary.
    seen : MpdccTrace
        What the board saw, a trace that can be replayed, per unit.
    decisions : Decisions
        What it decided, with `exhausted`.

    Raises
    ------
    LinkError
        If the board does not answer, or the core gives no decision.
    RefusedError
        If the board refuses a step.
    ValueError
        If there is no steady state at this speed.
    """
    profile = constant_profile(drive, OperatingPoint(speed), steps)
    state, applied = initial_conditions(profile)
    plant = Plant(drive, float(profile.omega_r[0]), float(profile.vdc[0]), state)
    iref = np.column_stack([profile.iref.real, profile.iref.imag])
    out = np.empty((steps, len(FIELDS)), dtype=np.int64)
    more = np.empty((steps, 2), dtype=np.int64)
    states = np.empty((steps, len(plant.state)))
    positions = np.empty((steps, 3), dtype=np.int64)
    clipped = np.zeros(steps, dtype=np.int64)
    applied = np.asarray(applied, dtype=np.int64)
    faults = 0
    began = time.perf_counter()
    for k in range(steps):
        states[k], positions[k] = plant.state, applied
        words, clipped[k] = common.encode_row(
            plant.state[:4], plant.state[4:], profile.vdc[k], iref[k], profile.omega_s[k],
            profile.omega_r[k],
        )  # fmt: skip
        answer = board.step([int(w) for w in words], packed_positions(applied))
        if answer.has(Flag.NO_ANSWER):
            raise LinkError(f"step {k}: the core gave no decision")
        out[k] = (
            *answer.positions, answer.has(Flag.HELD), answer.has(Flag.DEADLOCK), answer.length,
            answer.cycles, answer.has(Flag.SATURATED), answer.has(Flag.EXHAUSTED),
        )  # fmt: skip
        more[k] = answer.gates, answer.has(Flag.ENABLED)
        faults = answer.faults
        applied = out[k, 0:3].copy()
        plant.omega_r, plant.vdc = float(profile.omega_r[k]), float(profile.vdc[k])
        plant.step(applied)
        if progress is not None:
            progress(k + 1)
    seconds = time.perf_counter() - began
    seen = MpdccTrace(
        states[:, :4], states[:, 4:], profile.vdc, iref, profile.omega_s, profile.omega_r, positions
    )
    decisions = replace(decisions_of(out, clipped), exhausted=out[:, FIELDS.index("exhausted")])
    differing = count_differences(decisions, VARIANTS[variant].run(drive, seen))
    run = LockStep(steps, differing, seconds, out[:, 6], more[:, 0], more[:, 1], faults)
    return run, seen, decisions


def run_mptc(
    board: Board,
    drive: MptcDrive,
    rpm: float,
    load: float,
    psi_ref: float,
    steps: int,
    progress: Callable[[int], None] | None = None,
) -> LockStep:
    """MPTC or MPFC at a constant operating point; the decision acts one step later.

    Parameters
    ----------
    board : Board
        Board of an MPTC core that has been loaded with `drive`.
    drive : MptcDrive
        Machine and inverter of the plant; also what the model compares with.
    rpm : float
        Mechanical speed, 1/min.
    load : float
        Load torque and torque reference, N*m.
    psi_ref : float
        Stator flux reference, Wb.
    steps : int
        Control steps.
    progress : callable, optional
        Called with the number of steps made.

    Returns
    -------
    LockStep
        Summary.

    Raises
    ------
    LinkError
        If the board does not answer, or the core gives no decision.
    RefusedError
        If the board refuses a step.
    ValueError
        If the torque is beyond breakdown at this flux.
    """
    scenario = mptc_closed_loop.constant(drive, rpm, load, psi_ref, steps)
    plant = plant_parameters(drive)
    parameters = mptc_bit_true.parameters(drive)
    current, flux, omega_r = complex(scenario.current), complex(scenario.flux), scenario.omega_r
    applied, differing, faults = 0, 0, 0
    more = np.empty((steps, 3), dtype=np.int64)
    vdc = drive.inverter.vdc
    began = time.perf_counter()
    for k in range(steps):
        torque_ref, reference = float(scenario.torque_ref[k]), float(scenario.psi_ref[k])
        words, clipped = mptc_bit_true.encode_row(
            *parameters[1:], current, flux, omega_r, vdc, torque_ref, reference,
        )  # fmt: skip
        answer = board.step([int(w) for w in words], applied)
        if answer.has(Flag.NO_ANSWER):
            raise LinkError(f"step {k}: the core gave no decision")
        got = (
            answer.position & 7,
            int(answer.has(Flag.SATURATED) or clipped),
            int(answer.has(Flag.CLAMPED)),
        )
        want = mptc_bit_true.decide(
            parameters, current, flux, omega_r, applied, vdc, torque_ref, reference
        )
        differing += got != tuple(int(v) for v in want)
        more[k] = answer.cycles, answer.gates, answer.has(Flag.ENABLED)
        faults = answer.faults
        current, flux, omega_r = mptc_step(plant, current, flux, omega_r, applied, scenario.load[k])
        applied = got[0]
        if progress is not None:
            progress(k + 1)
    seconds = time.perf_counter() - began
    return LockStep(steps, differing, seconds, more[:, 0], more[:, 1], more[:, 2], faults)
