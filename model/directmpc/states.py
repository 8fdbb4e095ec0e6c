"""What passes between a drive and its controller in one step: a state in, a decision out.

Values are in the units of the drive file: per unit for MPDCC, SI for MPTC. Space vectors are
amplitude-invariant and complex, alpha + j*beta.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Protocol, Self, runtime_checkable

POSITIONS = range(8)


FRACTION = "a fraction of the period, 0 to 1,"


class StateError(ValueError):
    """A state or a decision has a value that cannot be; the message names it and what is needed."""


class VectorSequence(NamedTuple):
    """Vectors of a control period and their times.

    Attributes
    ----------
    u1, u2, u3 : int
        Numbers of the vectors in the order applied, 0 to 7.
    t1, t2 : float
        Fractions of the period of the first and the second; the third has the rest.
    """

    u1: int
    u2: int
    u3: int
    t1: float
    t2: float


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _number(name: str, value: Any, unit: str) -> float:
    """A finite number, or a sentence."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise StateError(f"{name}: got {_shown(value)}; a finite number in {unit} is needed")
    return number


def _vector(name: str, value: Any, unit: str) -> complex:
    """A finite space vector from a complex number or from two components, or a sentence."""
    try:
        vector = complex(*value) if hasattr(value, "__len__") else complex(value)
    except (TypeError, ValueError):
        vector = complex(math.nan)
    if not (math.isfinite(vector.real) and math.isfinite(vector.imag)):
        raise StateError(
            f"{name}: got {_shown(value)}; a complex number alpha + j*beta in {unit} is needed"
        )
    return vector


def _position(name: str, value: Any) -> int:
    """An integer from 0 to 7, or a sentence."""
    try:
        number = int(value)
        if number == value and number in POSITIONS:
            return number
    except (TypeError, ValueError):
        pass
    raise StateError(f"{name}: got {_shown(value)}; an integer from 0 to 7 is needed")


def _three(name: str, value: Any, needed: str) -> tuple[Any, Any, Any]:
    """Three entries, or a sentence."""
    try:
        a, b, c = value
    except (TypeError, ValueError):
        raise StateError(f"{name}: got {_shown(value)}; {needed} are needed") from None
    return a, b, c


def three_positions(name: str, value: Any) -> tuple[int, int, int]:
    """Positions of three phases; StateError, which says `name`, unless integers from 0 to 7."""
    a, b, c = _three(name, value, "three switch positions, 0 to 7,")
    return _position(f"{name}[0]", a), _position(f"{name}[1]", b), _position(f"{name}[2]", c)


def _sequence(name: str, value: Any) -> VectorSequence:
    """Three vectors and two times, or a sentence."""
    needed = "the number of a vector, or u1, u2, u3, t1, t2, is needed"
    if not hasattr(value, "__len__") or isinstance(value, str) or len(value) != 5:
        raise StateError(f"{name}: got {_shown(value)}; {needed}")
    vectors = [_position(f"{name}.u{n}", u) for n, u in enumerate(value[:3], start=1)]
    times = [_number(f"{name}.t{n}", t, "periods") for n, t in enumerate(value[3:], start=1)]
    for n, time in enumerate(times, start=1):
        if not 0.0 <= time <= 1.0:
            raise StateError(f"{name}.t{n}: got {time:g}; {FRACTION} is needed")
    if sum(times) > 1.0 + 1e-9:
        raise StateError(f"{name}: t1 + t2 is {sum(times):g}; 1 at most is needed")
    return VectorSequence(vectors[0], vectors[1], vectors[2], times[0], times[1])


def vector_or_sequence(name: str, value: Any) -> int | VectorSequence:
    """A vector's number or u1, u2, u3, t1, t2 as a sequence; StateError for anything else."""
    if hasattr(value, "__len__") and not isinstance(value, str):
        return _sequence(name, value)
    return _position(name, value)


def _column(row: Mapping[str, Any], name: str) -> Any:
    """A value of a row; a text, as a CSV reader gives it, becomes a number."""
    if name not in row:
        raise StateError(f"state: has no column {name}; it has {', '.join(map(str, row))}")
    value = row[name]
    return _number(f"column {name}", value, "the file's unit") if isinstance(value, str) else value


def _columns(row: Mapping[str, Any], name: str, stem: str, unit: str) -> complex:
    """A space vector from the columns `stem`_alpha and `stem`_beta, or a sentence."""
    return _vector(name, (_column(row, f"{stem}_alpha"), _column(row, f"{stem}_beta")), unit)


@dataclass(frozen=True)
class MpdccState:
    """What an MPDCC controller sees at step k, per unit.

    Attributes
    ----------
    current : complex
        Stator current i_s.
    flux : complex
        Rotor flux linkage psi_r.
    v_n : float
        Neutral point voltage.
    v_ph : tuple of 3 floats
        Phase capacitor voltages, a to c.
    current_ref : complex
        Current reference i*.
    omega_s, omega_r : float
        Stator and rotor angular speed (electrical).
    applied : tuple of 3 ints
        Switch positions until now, s(k-1), 0 to 7.
    vdc : float, optional
        Measured dc-link voltage; the drive's nominal one if None. A drive whose gates are on needs
        it.

    Raises
    ------
    StateError
        If a value is not finite, or not of its kind; the message names it.
    """

    current: complex
    flux: complex
    reference: ClassVar[str] = "current_ref"  # What a ramp takes away
    v_n: float
    v_ph: tuple[float, float, float]
    current_ref: complex
    omega_s: float
    omega_r: float
    applied: tuple[int, int, int]
    vdc: float | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        for name in ("current", "flux", "current_ref"):
            put(self, name, _vector(name, getattr(self, name), "pu"))
        for name in ("v_n", "omega_s", "omega_r"):
            put(self, name, _number(name, getattr(self, name), "pu"))
        voltages = _three("v_ph", self.v_ph, "three numbers in pu")
        put(self, "v_ph", tuple(_number(f"v_ph[{i}]", v, "pu") for i, v in enumerate(voltages)))
        put(self, "applied", three_positions("applied", self.applied))
        if self.vdc is not None:
            put(self, "vdc", _number("vdc", self.vdc, "pu"))

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> Self:
        """Make a state from a row of a trace.

        Parameters
        ----------
        row : mapping of str to number or str
            Columns of the trace file to values, per unit; `v_dc` may be missing.

        Returns
        -------
        MpdccState
            Per unit.

        Raises
        ------
        StateError
            If a column is missing or a value is impossible.
        """
        return cls(
            current=_columns(row, "current", "is", "pu"),
            flux=_columns(row, "flux", "psir", "pu"),
            v_n=_column(row, "v_n"),
            v_ph=(_column(row, "v_ph_a"), _column(row, "v_ph_b"), _column(row, "v_ph_c")),
            current_ref=_columns(row, "current_ref", "iref", "pu"),
            omega_s=_column(row, "omega_s"),
            omega_r=_column(row, "omega_r"),
            applied=(_column(row, "s_a"), _column(row, "s_b"), _column(row, "s_c")),
            vdc=row.get("v_dc"),
        )


@dataclass(frozen=True)
class MptcState:
    """What a two-level controller sees at step k, SI.

    Attributes
    ----------
    current : complex
        Stator current i_s, A.
    flux : complex
        Stator flux linkage psi_s, Wb.
    omega_r : float
        Electrical rotor speed, rad/s.
    torque_ref : float
        Torque reference, N*m.
    psi_ref : float
        Reference of the stator flux's magnitude, Wb.
    applied : int or VectorSequence
        Number of the voltage vector that is being applied, u(k), 0 to 7; with the methods of two
        and three vectors also u1, u2, u3, t1, t2.
    vdc : float, optional
        Measured dc-link voltage, V; the drive's nominal one if None. A drive whose gates are on
        needs it.

    Raises
    ------
    StateError
        If a value is not finite, or not of its kind; the message names it.
    """

    current: complex
    flux: complex
    omega_r: float
    reference: ClassVar[str] = "torque_ref"
    torque_ref: float
    psi_ref: float
    applied: int | VectorSequence = 0
    vdc: float | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "current", _vector("current", self.current, "A"))
        put(self, "flux", _vector("flux", self.flux, "Wb"))
        put(self, "omega_r", _number("omega_r", self.omega_r, "rad/s"))
        put(self, "torque_ref", _number("torque_ref", self.torque_ref, "N*m"))
        put(self, "psi_ref", _number("psi_ref", self.psi_ref, "Wb"))
        put(self, "applied", vector_or_sequence("applied", self.applied))
        if self.vdc is not None:
            put(self, "vdc", _number("vdc", self.vdc, "V"))

    @classmethod
    def from_row(cls, row: Mapping[str, Any]) -> Self:
        """Make a state from a row of a trace.

        Parameters
        ----------
        row : mapping of str to number or str
            Columns of the trace file to values, SI; `v_dc` may be missing. With u1, u2, u3, t1, t2
            `u` has no meaning.

        Returns
        -------
        MptcState
            SI.

        Raises
        ------
        StateError
            If a column is missing or a value is impossible.
        """
        return cls(
            current=_columns(row, "current", "is", "A"),
            flux=_columns(row, "flux", "psis", "Wb"),
            omega_r=_column(row, "omega_r"),
            torque_ref=_column(row, "torque_ref"),
            psi_ref=_column(row, "psi_ref"),
            applied=_column(row, "u")
            if "u1" not in row
            else [_column(row, name) for name in VectorSequence._fields],
            vdc=row.get("v_dc"),
        )


@dataclass(frozen=True)
class MpdccDecision:
    """What an MPDCC controller decides.

    Attributes
    ----------
    apply : tuple of 3 ints
        Switch positions s(k), 0 to 7.
    held
        Whether s(k-1) is kept without a search.
    deadlock
        Whether no candidate stays inside the bounds.
    length
        Steps that the choice stays inside them, L*; 0 when held or in a deadlock.
    saturated
        Whether a value left its number format.
    """

    apply: tuple[int, int, int]
    held: bool = False
    deadlock: bool = False
    length: int = 0
    saturated: bool = False


@dataclass(frozen=True)
class MptcDecision:
    """What a two-level controller decides.

    Attributes
    ----------
    apply : int or VectorSequence
        Number of the voltage vector to apply from k+1 on, 0 to 7; with the methods of two and three
        vectors u1, u2, u3, t1, t2.
    saturated
        Whether a value left its number format.
    clamped
        Flux methods: whether the torque asked for is beyond what the flux can make.
    """

    apply: int | VectorSequence
    saturated: bool = False
    clamped: bool = False


State = MpdccState | MptcState
Decision = MpdccDecision | MptcDecision


@runtime_checkable
class Controller(Protocol):
    """Whatever can close a control loop: `ideal`, the bit-true model, a board, an own class."""

    def decide(self, state: Any, /) -> Any:
        """Decide on one step.

        Parameters
        ----------
        state : MpdccState or MptcState
            As the drive's kind is. It is called once per control step,
            in order, so a controller may keep a state of its own.

        Returns
        -------
        Decision
            `MpdccDecision` or `MptcDecision`; or only what these hold in `apply`: three switch
            positions, or the number of a voltage vector.
        """
        ...


def mpdcc_decision(answer: Any, step: int) -> MpdccDecision:
    """An MPDCC controller's answer, or its positions alone, as a decision; else StateError."""
    name = f"step {step}: decision"
    if isinstance(answer, MpdccDecision):
        three_positions(name, answer.apply)
        return answer
    return MpdccDecision(three_positions(name, answer))


def mptc_decision(answer: Any, step: int) -> MptcDecision:
    """An MPTC controller's answer, or its `apply` alone, as a decision; else StateError."""
    name = f"step {step}: decision"
    if isinstance(answer, MptcDecision):
        vector_or_sequence(name, answer.apply)
        return answer
    return MptcDecision(vector_or_sequence(name, answer))


def ramped(state: State, share: float) -> State:
    """A state with a part of its reference: the current of MPDCC, the torque of MPTC.

    `share` is from 0 to 1; the flux reference of MPTC stays.
    """
    return replace(state, **{state.reference: share * getattr(state, state.reference)})
