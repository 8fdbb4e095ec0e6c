"""The controllers of the library as objects, and one decision by a function call."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from directmpc.api.kinds import ENGINES, kind_of
from directmpc.kbest.drive import KbestDrive
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.leakage import LeakageEstimate
from directmpc.mpdcc.variants import DEFAULT_VARIANT, VARIANTS
from directmpc.mptc.drive import MptcDrive
from directmpc.native import Design
from directmpc.states import Decision, State


def check_engine(engine: Any, variant: Any) -> None:
    """ValueError for an engine or a variant that there is not; it says which there are."""
    for name, value, known in (("engine", engine, ENGINES), ("variant", variant, VARIANTS)):
        if not isinstance(value, str) or value not in known:
            allowed = " or ".join(f'"{one}"' for one in known)
            raise ValueError(f"{name}: got {value!r:.40}; it must be {allowed}")


def state_of(drive: Drive | KbestDrive | MptcDrive, state: State | Mapping[str, Any]) -> State:
    """A state of the drive's kind (per unit or SI), or one made of a row of its trace file.

    TypeError if it is neither; StateError if a row lacks a column or a value is impossible.
    """
    wanted = kind_of(drive).state
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
        self.drive, self._kind = drive, kind_of(drive)
        self._decide, self._parameters = self._kind.compiled(drive, "ideal", DEFAULT_VARIANT)

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
        known = self._kind.shown(self.drive, self._parameters, state_of(self.drive, state))
        return self._kind.decide(self.drive, self._decide, self._parameters, known)


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
        self.drive, self._kind = drive, kind_of(drive)
        check_engine("model", variant)
        self._decide, self._parameters = self._kind.compiled(drive, "model", variant)
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
        return self._kind.decide(self.drive, self._decide, self._parameters, known)

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
    design : Design, optional
        An instance of the core; a native library of its own if not given.

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
        self,
        drive: Drive | KbestDrive | MptcDrive,
        variant: str = DEFAULT_VARIANT,
        design: Any = None,
    ) -> None:
        check_engine("rtl", variant)
        self.drive, self._kind = drive, kind_of(drive)
        self.cycles: list[int] = []
        self.words: list[int] = []
        parameters, self._given = self._kind.core(drive, variant)
        self._places, self._encode = list(parameters), self._kind.encoder(drive)
        self.design = design or Design(self._kind.library(drive, variant))
        self._kind.set_up(self.design, parameters)

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
        words, applied, clipped = self._encode(state_of(self.drive, state))
        self.words = list(words.values())
        self.design.give(words | applied)
        out, cycles = self.design.decide()
        self.cycles.append(cycles)
        return self._kind.decision(self.drive, out, bool(out["saturated"] or clipped))

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


class Estimating:
    """A core of MPDCC with the bit-true estimate of the leakage beside it, as a system has it."""

    def __init__(self, core: RtlController) -> None:
        self._core, self._estimate = core, LeakageEstimate(core.drive)
        self._delayed = core.drive.control.delay_compensation
        self._before: tuple[int, ...] = ()

    def decide(self, state: State | Mapping[str, Any]) -> Decision:
        """Scale the slopes, decide, estimate anew."""
        self._core.scale(self._estimate)
        decision = self._core.decide(state)
        applied = tuple(state.applied)
        self._estimate.step(self._core.words, (self._delayed and self._before) or applied)
        self._before = applied
        return decision


def compiled_controller(
    drive: Drive | KbestDrive | MptcDrive, engine: str, variant: str
) -> tuple[Any, Any]:
    """Compiled `decide` of the engine "ideal" or "model" of a drive, and its first argument.

    ValueError if there is no such engine, or the model cannot represent the drive.
    """
    return kind_of(drive).compiled(drive, engine, variant)


def make_controller(
    drive: Drive | KbestDrive | MptcDrive, engine: str = "ideal", variant: str = DEFAULT_VARIANT
) -> IdealController | ModelController | RtlController:
    """The controller of an engine and, for MPDCC, a variant.

    TypeError if `drive` is none; ValueError if there is no such engine, or the model cannot
    represent it.
    """
    kind_of(drive)
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
