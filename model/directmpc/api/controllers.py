"""The controllers of the library as objects, and one decision by a function call."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from directmpc.kbest import bit_true as kbest_bit_true
from directmpc.kbest import ideal as kbest_ideal
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc import ideal as mpdcc_ideal
from directmpc.mpdcc.bit_true import common as mpdcc_words
from directmpc.mpdcc.drive import Drive, FiveLevelDrive, only_default
from directmpc.mpdcc.formats import MEASUREMENTS as MPDCC_MEASUREMENTS
from directmpc.mpdcc.leakage import LeakageEstimate
from directmpc.mpdcc.trace import MpdccTrace
from directmpc.mpdcc.variants import DEFAULT_VARIANT, VARIANTS
from directmpc.mptc import bit_true as mptc_bit_true
from directmpc.mptc import bit_true_sequences, ideal_sequences
from directmpc.mptc import coefficients as mptc_coefficients
from directmpc.mptc import ideal as mptc_ideal
from directmpc.mptc.drive import MptcDrive
from directmpc.mptc.formats import MEASUREMENTS as MPTC_MEASUREMENTS
from directmpc.mptc.ideal_sequences import TOO_LARGE
from directmpc.mptc.sequence import TIME_STEPS, whole
from directmpc.native import Design
from directmpc.states import (
    Decision,
    MpdccDecision,
    MpdccState,
    MptcDecision,
    MptcState,
    State,
    StateError,
    VectorSequence,
)

ENGINES = ("ideal", "model", "rtl")
KBEST_ENGINES = ("ideal", "model")


def check_drive(drive: Any) -> None:
    """Refuse what is no drive.

    Parameters
    ----------
    drive : any
        What a caller gave as a drive.

    Raises
    ------
    TypeError
        If it is none; the message says what it is and what makes one.
    """
    if not isinstance(drive, FiveLevelDrive | MptcDrive):
        raise TypeError(f"drive: got a {type(drive).__name__}; load_drive makes what is needed")


def check_engine(engine: Any, variant: Any) -> None:
    """Refuse an engine or a variant that there is not.

    Parameters
    ----------
    engine : any
        What a caller gave; one of `ENGINES`.
    variant : any
        What a caller gave; "fast" or "paper".

    Raises
    ------
    ValueError
        If there is none of this name; the message says which there are.
    """
    for name, value, known in (("engine", engine, ENGINES), ("variant", variant, VARIANTS)):
        if not isinstance(value, str) or value not in known:
            allowed = " or ".join(f'"{one}"' for one in known)
            raise ValueError(f"{name}: got {value!r:.40}; it must be {allowed}")


def served_by(drive: Drive | KbestDrive | MptcDrive, engine: str) -> None:
    """Refuse an engine that a drive's controller does not have.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        Whose controller it is.
    engine : str
        One of `ENGINES`.

    Raises
    ------
    ValueError
        If the controller does not have it.
    """
    if isinstance(drive, KbestDrive) and engine not in KBEST_ENGINES:
        allowed = " and ".join(f'"{one}"' for one in KBEST_ENGINES)
        raise ValueError(f'engine: got "{engine}"; a drive of kbest has {allowed}')


def state_of(drive: Drive | KbestDrive | MptcDrive, state: State | Mapping[str, Any]) -> State:
    """Check that a state is one of the drive's kind; a row of a trace becomes one.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        What the state is of.
    state : MpdccState, MptcState or mapping
        Per unit or SI, as the drive's kind is; or the names of the trace file's columns to values.

    Returns
    -------
    MpdccState or MptcState
        The state itself, or one made of the row.

    Raises
    ------
    TypeError
        If it is neither; the message says what is needed.
    StateError
        If a row lacks a column or a value is impossible.
    """
    wanted = MpdccState if isinstance(drive, FiveLevelDrive) else MptcState
    if isinstance(state, wanted):
        return state
    if isinstance(state, Mapping):
        return wanted.from_row(state)
    raise TypeError(
        f"state: got a {type(state).__name__}; a drive of {drive.controller} needs a "
        f"{wanted.__name__}, or a row of its trace by column names"
    )


class IdealController:
    """The decision in float64, nothing approximated (docs/specification.md, sections 2, 3 and 10).

    That of K-best keeps its plan from one decision to the next.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        What it is set up for; of either kind.

    Raises
    ------
    TypeError
        If it is no drive.
    """

    def __init__(self, drive: Drive | KbestDrive | MptcDrive) -> None:
        check_drive(drive)
        self.drive = drive
        self._decide, self._parameters = compiled_controller(drive, "ideal", DEFAULT_VARIANT)

    def decide(self, state: State | Mapping[str, Any]) -> Decision:
        """Decide on one step.

        Parameters
        ----------
        state : MpdccState, MptcState or mapping
            As of `decide` in this module: of the drive's kind.

        Returns
        -------
        MpdccDecision or MptcDecision
            What to apply next, and flags; never saturated.

        Raises
        ------
        TypeError
            If the state is not of the drive's kind.
        StateError
            If a value of the state is impossible; a ValueError.
        """
        known = state_of(self.drive, state)
        if isinstance(self.drive, Drive) and self.drive.control.delay_compensation:
            known = _one_step_on(self.drive, self._parameters, known)
        return _decision(self.drive, self._decide, self._parameters, known)


class ModelController:
    """The bit-true model: word for word what the cores compute.

    That of K-best keeps its plan from one decision to the next.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        What it is set up for; of either kind.
    variant : str
        "fast" or "paper"; MPDCC alone has variants.

    Raises
    ------
    ValueError
        If there is no such variant, it does not serve the drive's settings, or a value of the drive
        cannot be represented; the message names the key.
    """

    def __init__(
        self, drive: Drive | KbestDrive | MptcDrive, variant: str = DEFAULT_VARIANT
    ) -> None:
        check_drive(drive)
        check_engine("model", variant)
        self.drive = drive
        self._decide, self._parameters = compiled_controller(drive, "model", variant)
        self._given = self._parameters

    def decide(self, state: State | Mapping[str, Any]) -> Decision:
        """Decide on one step.

        Parameters
        ----------
        state : MpdccState, MptcState or mapping
            As of `decide` in this module: of the drive's kind.

        Returns
        -------
        MpdccDecision or MptcDecision
            What to apply next, and flags; `saturated` covers the inputs.

        Raises
        ------
        TypeError
            If the state is not of the drive's kind.
        StateError
            If a value of the state is impossible; a ValueError.
        """
        known = state_of(self.drive, state)
        return _decision(self.drive, self._decide, self._parameters, known)

    def scale(self, estimate: LeakageEstimate) -> bool:
        """Scale the slopes of the current for the decisions to come; MPDCC alone.

        Parameters
        ----------
        estimate : LeakageEstimate
            Whose theta it is by.

        Returns
        -------
        bool
            Whether a coefficient did not hold its value.
        """
        self._parameters, saturated = estimate.scaled(self._given)
        return saturated


class RtlController:
    """The RTL itself: the core as a native library, made from its converted VHDL.

    The library is built at first use, which takes about a minute (`directmpc.native.library`).

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        What it is set up for; of either kind.
    variant : str
        "fast" or "paper"; MPDCC alone has variants.

    Attributes
    ----------
    design : Design
        The instance that decides.
    cycles : list of int
        Clock cycles of each decision, from start to valid.
    words : list of int
        Words of the measurement ports at the last decision.

    Raises
    ------
    NativeError
        If the library cannot be built or loaded.
    ValueError
        If there is no such variant, it does not serve the drive's settings, or a value of the drive
        cannot be represented; the message names the key.
    """

    def __init__(
        self, drive: Drive | KbestDrive | MptcDrive, variant: str = DEFAULT_VARIANT
    ) -> None:
        check_drive(drive)
        check_engine("rtl", variant)
        served_by(drive, "rtl")
        self.drive = drive
        self.cycles: list[int] = []
        self.words: list[int] = []
        self._formats: tuple[Any, ...] = ()
        if isinstance(drive, Drive):
            only_default(drive)
            given = VARIANTS[variant].registers(drive)
            name, parameters = "mpdcc_core" + "_paper" * (variant == "paper"), given.ports()
            self._given, self._places = given.array(), list(parameters)
        else:
            assert isinstance(drive, MptcDrive)
            chosen = mptc_coefficients.registers(drive).ports()
            parameters = {n: v for n, v in chosen.items() if n.startswith("c_")}
            parameters["method_mpfc"] = int(drive.control.method == "MPFC")
            self._formats = mptc_bit_true.parameters(drive)[1:]
            name = "mptc_core"
            if drive.control.sequences:
                name = "mptc_family_core"
                _, method, rule, *_ = bit_true_sequences.parameters(drive)
                parameters |= {"family_method": method + 1, "duty_rule": rule}
        self.design = Design(name)
        self.design.give(parameters)

    def decide(self, state: State | Mapping[str, Any]) -> Decision:
        """Decide on one step.

        Parameters
        ----------
        state : MpdccState, MptcState or mapping
            As of `decide` in this module: of the drive's kind.

        Returns
        -------
        MpdccDecision or MptcDecision
            What to apply next, and flags; `saturated` covers the inputs.

        Raises
        ------
        TypeError
            If the state is not of the drive's kind.
        StateError
            If a value of the state is impossible; a ValueError.
        NativeError
            If the core does not answer.
        """
        known = state_of(self.drive, state)
        if isinstance(known, MpdccState):
            row = mpdcc_row(self.drive, known)
            words, clipped = mpdcc_words.encode_row(
                row.x_m[0], row.x_inv[0], row.vdc[0], row.iref[0], row.omega_s[0], row.omega_r[0]
            )
            names = MPDCC_MEASUREMENTS
            positions = {f"s_prev_{x}": s for x, s in zip("abc", known.applied, strict=True)}
        else:
            assert isinstance(self.drive, MptcDrive)
            applied = _applied(self.drive, known)
            words, clipped = mptc_bit_true.encode_row(
                *self._formats, known.current, known.flux, known.omega_r,
                self.drive.inverter.vdc, known.torque_ref, known.psi_ref,
            )  # fmt: skip
            names = MPTC_MEASUREMENTS
            positions = {"u": applied} if isinstance(applied, int) else _sequence_ports(applied)
        self.words = [int(word) for word in words]
        self.design.give(dict(zip(names, self.words, strict=True)) | positions)
        out, cycles = self.design.decide()
        self.cycles.append(cycles)
        saturated = bool(out["saturated"] or clipped)
        if isinstance(known, MpdccState):
            apply = (out["s_a"], out["s_b"], out["s_c"])
            return MpdccDecision(
                apply, bool(out["held"]), bool(out["deadlock"]), out["length"], saturated
            )
        u: int | VectorSequence = out["u_next"]
        if isinstance(self.drive, MptcDrive) and self.drive.control.sequences:
            times = (out[f"next_t{n}"] / TIME_STEPS for n in (1, 2))
            u = VectorSequence(out["next_u1"], out["next_u2"], out["next_u3"], *times)
        return MptcDecision(u, saturated, bool(out["clamped"]))

    def scale(self, estimate: LeakageEstimate) -> bool:
        """Scale the slopes of the current for the decisions to come; MPDCC alone.

        Parameters
        ----------
        estimate : LeakageEstimate
            Whose theta it is by.

        Returns
        -------
        bool
            Whether a coefficient did not hold its value.
        """
        parameters, saturated = estimate.scaled(self._given)
        ports = parameters.tolist()[: len(self._places)]  # what is built in is none
        self.design.give(dict(zip(self._places, ports, strict=True)))
        return saturated


def _sequence_ports(applied: VectorSequence) -> dict[str, int]:
    """A running sequence as the ports of mptc_family_core; u is its last vector."""
    u1, u2, u3, t1, t2 = (int(value) for value in bit_true_sequences.in_steps(applied))
    return {"u": u1, "u1": u1, "u2": u2, "u3": u3, "t1": t1, "t2": t2}


def compiled_controller(
    drive: Drive | KbestDrive | MptcDrive, engine: str, variant: str
) -> tuple[Any, Any]:
    """Compiled function of an engine and its parameters.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        What it is set up for.
    engine : str
        "ideal" or "model".
    variant : str
        "fast" or "paper", for the model of MPDCC.

    Returns
    -------
    decide : compiled function
        With the arguments and results of `mpdcc.ideal.decide`, or of `mptc.ideal.decide`.
    parameters
        Its first argument.

    Raises
    ------
    ValueError
        If the controller has no such engine, or the model cannot represent the drive.
    """
    served_by(drive, engine)
    if isinstance(drive, KbestDrive):
        chosen = kbest_ideal if engine == "ideal" else kbest_bit_true
        return chosen.decide, chosen.parameters_of(drive)
    if isinstance(drive, Drive):
        if engine == "ideal":
            return mpdcc_ideal.decide, mpdcc_ideal.ideal_parameters(drive)
        return VARIANTS[variant].decide, VARIANTS[variant].registers(drive).array()
    if engine == "ideal" and drive.control.sequences:
        return ideal_sequences.decide, ideal_sequences.sequence_parameters(drive)
    if engine == "ideal":
        return mptc_ideal.decide, mptc_ideal.ideal_parameters(drive)
    if drive.control.sequences:
        return bit_true_sequences.decide, bit_true_sequences.parameters(drive)
    return mptc_bit_true.decide, mptc_bit_true.parameters(drive)


def _decision(
    drive: Drive | KbestDrive | MptcDrive, decide: Any, parameters: Any, state: State
) -> Decision:
    """Call a compiled function with the values of a state."""
    if isinstance(state, MpdccState):
        row = mpdcc_row(drive, state)
        s_a, s_b, s_c, held, deadlock, length, saturated = decide(
            parameters, row.x_m[0], row.x_inv[0], row.vdc[0], row.iref[0], row.omega_s[0],
            row.omega_r[0], row.s_prev[0],
        )  # fmt: skip
        apply = (int(s_a), int(s_b), int(s_c))
        return MpdccDecision(apply, bool(held), bool(deadlock), int(length), bool(saturated))
    assert isinstance(drive, MptcDrive)
    u, saturated, clamped = decide(
        parameters, state.current, state.flux, state.omega_r, _applied(drive, state),
        drive.inverter.vdc if state.vdc is None else state.vdc, state.torque_ref, state.psi_ref,
    )  # fmt: skip
    chosen = VectorSequence(*u) if drive.control.sequences else int(u)
    if isinstance(chosen, VectorSequence) and not math.isfinite(chosen.t1 + chosen.t2):
        raise StateError(TOO_LARGE)
    return MptcDecision(chosen, bool(saturated), bool(clamped))


def _applied(drive: MptcDrive, state: MptcState) -> int | VectorSequence:
    """What is being applied, as the drive's method takes it."""
    applied = state.applied
    if drive.control.sequences:
        return whole(applied) if isinstance(applied, int) else applied
    if not isinstance(applied, int):
        raise StateError(
            f"applied: got {tuple(applied)}; {drive.control.method} applies one vector a period, "
            "its number is needed"
        )
    return applied


def mpdcc_row(drive: Drive | KbestDrive | MptcDrive, state: MpdccState) -> MpdccTrace:
    """A state as a trace of one row.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        Gives v_dc where the state has none.
    state : MpdccState
        Per unit.

    Returns
    -------
    MpdccTrace
        One row, per unit.

    Raises
    ------
    StateError
        If the converter has not got a position of the state.
    """
    vdc = drive.inverter.vdc if state.vdc is None else state.vdc
    if isinstance(drive, FiveLevelDrive) and max(state.applied) >= drive.converter.positions:
        raise StateError(
            f"applied: got {tuple(state.applied)}; {drive.converter.name} has the positions 0 to "
            f"{drive.converter.positions - 1}"
        )
    return MpdccTrace(
        x_m=np.array([[state.current.real, state.current.imag, state.flux.real, state.flux.imag]]),
        x_inv=np.array([[state.v_n, *state.v_ph]]),
        vdc=np.array([vdc]),
        iref=np.array([[state.current_ref.real, state.current_ref.imag]]),
        omega_s=np.array([state.omega_s]),
        omega_r=np.array([state.omega_r]),
        s_prev=np.array([state.applied], dtype=np.int64),
    )


def _one_step_on(drive: Drive, parameters: Any, state: State) -> MpdccState:
    """The state at k + 1 under s(k-1), as a drive with delay compensation decides on it."""
    assert isinstance(state, MpdccState)
    row = mpdcc_ideal.one_step_on(parameters, mpdcc_row(drive, state))
    return MpdccState(
        current=complex(*row.x_m[0, :2]),
        flux=complex(*row.x_m[0, 2:]),
        v_n=row.x_inv[0, 0],
        v_ph=tuple(row.x_inv[0, 1:]),
        current_ref=complex(*row.iref[0]),
        omega_s=state.omega_s,
        omega_r=state.omega_r,
        applied=state.applied,
        vdc=float(row.vdc[0]),
    )


def make_controller(
    drive: Drive | KbestDrive | MptcDrive, engine: str = "ideal", variant: str = DEFAULT_VARIANT
) -> IdealController | ModelController | RtlController:
    """Make the controller of an engine.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        What it is set up for; of either kind.
    engine : str
        "ideal", "model" or "rtl".
    variant : str
        "fast" or "paper", for the model and the RTL of MPDCC.

    Returns
    -------
    IdealController, ModelController or RtlController
        Its `decide` takes one state at a time.

    Raises
    ------
    TypeError
        If `drive` is no drive.
    ValueError
        If there is no such engine or variant, or the model cannot represent the drive.
    """
    check_drive(drive)
    check_engine(engine, variant)
    if engine == "ideal":
        return IdealController(drive)
    return ModelController(drive, variant) if engine == "model" else RtlController(drive, variant)


def decide(
    drive: Drive | KbestDrive | MptcDrive,
    state: State | Mapping[str, Any],
    engine: str = "ideal",
    variant: str = DEFAULT_VARIANT,
) -> Decision:
    """Decide on one step.

    Parameters
    ----------
    drive : Drive, KbestDrive or MptcDrive
        From `load_drive`, of either kind.
    state : MpdccState, MptcState or mapping
        A state (per unit or SI), as the drive's kind is; or a row of its trace,
        the names of the trace file's columns to values.
    engine : str
        "ideal": float64, nothing approximated. "model": the bit-true model of the core. "rtl": the
        core itself, a native library made from its VHDL.
    variant : str
        "fast" or "paper", for the model and the RTL of MPDCC.

    Returns
    -------
    MpdccDecision or MptcDecision
        What to apply next, and flags.

    Raises
    ------
    TypeError
        If `drive` is no drive or `state` not of its kind.
    StateError
        If a value of the state is impossible; a ValueError.
    ValueError
        If there is no such engine or variant, or the model cannot represent the drive.
    """
    return make_controller(drive, engine, variant).decide(state)
