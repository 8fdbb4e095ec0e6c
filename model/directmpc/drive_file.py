"""Drive files: the TOML a user writes, checked and turned into frozen objects.

Keys, units, ranges and defaults: docs/specification.md, section 4.1.

What depends on several keys is checked by the models themselves, so `changed` and `with_control`
refuse what a file may not hold either. A drive that ships is found by its name as well.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar, get_args, get_origin

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from directmpc.mpdcc.machine import InductionMachine

TS_PU_MIN = 0.006
TS_PU_MAX = 0.063

LEAKAGE_MIN = 1e-9
"""Least 1 - lm**2/(ls*lr): below it the rounding of the file's numbers is the leakage."""


class DriveError(ValueError):
    """A drive cannot be as it is asked to be; the message names the key and what is allowed."""


class DriveFileError(DriveError):
    """A drive file cannot be used; the message names file, key and what is allowed."""


def _refuse(key: str, message: str) -> PydanticCustomError:
    """Error of a check over several keys; `key` is the one that is named."""
    return PydanticCustomError("across_keys", "{key}: {message}", {"key": key, "message": message})


def _number(low: float, high: float, unit: str) -> Any:
    """Annotate a finite number with its closed range and, in words, what is allowed."""
    words = f"a number from {low:g} to {high:g} {unit}".rstrip()
    return Annotated[
        float, Field(strict=True, ge=low, le=high, allow_inf_nan=False, description=words)
    ]


def _integer(low: int, high: int) -> Any:
    """Annotate an integer with its closed range and, in words, what is allowed."""
    words = f"an integer from {low} to {high}"
    return Annotated[int, Field(strict=True, ge=low, le=high, description=words)]


class _Section(BaseModel):
    """A table of a drive file: frozen, without room for unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class _Drive(_Section):
    """What the drives of all controllers can do."""

    def changed(self, **tables: Mapping[str, Any]) -> Self:
        """Make the same drive with other values, checked as a drive file is.

        Parameters
        ----------
        **tables
            Name of a table of the drive file (`machine`, `inverter`, `control`, ...) to the keys
            to change: ``drive.changed(machine={"rs": 0.006}, control={"horizon": 20})``.

        Returns
        -------
        Drive or MptcDrive
            A new drive; this one stays as it is.

        Raises
        ------
        DriveError
            If a table or key is unknown or a value is not allowed; names key and allowed range.
        """
        data: dict[str, Any] = {}
        for name in _keys(type(self)):
            value = getattr(self, name)
            data[name] = {k: getattr(value, k) for k in _keys(type(value))} or value
        for name, keys in tables.items():
            if not isinstance(keys, Mapping):
                raise DriveError(f"{name}: got {_describe(keys)}; a table of keys is needed")
            plain = {k: v.item() if isinstance(v, np.generic) else v for k, v in keys.items()}
            old = data.get(name, {})
            data[name] = {**old, **plain} if isinstance(old, dict) else plain
        return _validated(type(self), data)

    def with_control(self, **keys: Any) -> Self:
        """Make the same drive with other keys of its table `control`; as `changed`."""
        return self.changed(control=keys)


class Base(_Section):
    """Base values: voltage (V, peak phase) and current (A, peak) for display, frequency (Hz)."""

    voltage: _number(1.0, 1e6, "V")
    current: _number(0.01, 1e6, "A")
    frequency: _number(1.0, 1000.0, "Hz")


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Machine(InductionMachine):
    """Machine parameters, per unit (Paper A, Table I), with the equations of their machine."""

    rs: _number(0.001, 0.05, "pu")
    rr: _number(0.001, 0.05, "pu")
    xls: _number(0.03, 0.3, "pu")
    xlr: _number(0.03, 0.3, "pu")
    xm: _number(1.0, 5.0, "pu")


class Inverter(_Section):
    """Five-level ANPC inverter, per unit; xdc is one half of the dc-link."""

    topology: Literal["anpc5l"]
    vdc: _number(1.5, 2.5, "pu")
    xdc: _number(0.5, 10.0, "pu")
    xph: _number(0.5, 10.0, "pu")


class Control(_Section):
    """Settings of the MPDCC controller: ts in s, bounds as half widths in pu.

    `budget` limits the second level of SESE to so many candidates (0: no limit), in the cores and
    their model; `delay_compensation` decides for k + 1 from the state predicted under s(k-1).
    `deadlock_rule` says what is chosen where no candidate stays inside its bounds: "largest" takes
    the least of the largest excesses, "weighted" weighs v_n's and adds a share of the currents'.
    """

    ts: Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=False)]
    bound_current: _number(0.02, 0.5, "pu")
    bound_vn: _number(0.02, 0.5, "pu")
    bound_vph: _number(0.02, 0.5, "pu")
    lambda_n: _number(0.0, 100.0, "")
    horizon: _integer(1, 63)
    switching_horizon: Literal["SE", "SESE"] = "SE"
    budget: _integer(0, 4095) = 0
    delay_compensation: Annotated[bool, Field(strict=True, description="true or false")] = False
    deadlock_rule: Literal["largest", "weighted"] = "largest"


class Drive(_Drive):
    """An MPDCC drive as its file describes it, per unit."""

    controller: Literal["mpdcc"]
    base: Base
    machine: Machine
    inverter: Inverter
    control: Control

    @model_validator(mode="after")
    def _check_sampling(self) -> Self:
        if not TS_PU_MIN <= self.ts_pu <= TS_PU_MAX:
            unit = 2 * math.pi * self.base.frequency
            raise _refuse(
                "control.ts",
                f"got {self.control.ts:g} s; it must be a number from {TS_PU_MIN / unit:.4g} to "
                f"{TS_PU_MAX / unit:.4g} s ({TS_PU_MIN} to {TS_PU_MAX} pu) with base.frequency = "
                f"{self.base.frequency:g} Hz",
            )
        return self

    @property
    def ts_pu(self) -> float:
        """Sampling interval in units of 1/(2 pi f_base)."""
        return 2 * math.pi * self.base.frequency * self.control.ts

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Half widths y_bnd on [i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c], shape (7,)."""
        c = self.control
        return np.array([c.bound_current] * 3 + [c.bound_vn] + [c.bound_vph] * 3)


class MptcMachine(_Section):
    """Machine parameters of an MPTC drive, SI (Paper B).

    Any machine with ls*lr > lm**2 is one, whatever its turns ratio: the T circuit with both
    inductances above lm, the inverse-gamma circuit with lr = lm, the gamma circuit with ls = lm.
    """

    rs: _number(1e-6, 1e3, "ohm")
    rr: _number(1e-6, 1e3, "ohm")
    lm: _number(1e-6, 1e3, "H")
    ls: _number(1e-6, 1e3, "H")
    lr: _number(1e-6, 1e3, "H")
    pole_pairs: _integer(1, 64)

    @model_validator(mode="after")
    def _check_leakage(self) -> Self:
        if 1.0 - self.lm * self.lm / (self.ls * self.lr) < LEAKAGE_MIN:
            raise _refuse(
                "lm",
                f"got {self.lm!r}; it must be below {math.sqrt(self.ls * self.lr):.7g} H, the "
                f"square root of ls*lr, with ls = {self.ls:g} H and lr = {self.lr:g} H (a leakage "
                f"factor 1 - lm**2/(ls*lr) of {LEAKAGE_MIN:g} at least)",
            )
        return self


class MptcInverter(_Section):
    """Two-level inverter, SI."""

    topology: Literal["two_level"]
    vdc: _number(1.0, 1e5, "V")


class MptcControl(_Section):
    """Settings and full scales of the MPTC controller, SI."""

    ts: _number(1e-6, 1e-2, "s")
    k_psi: _number(0.0, 1e6, "N*m/Wb")
    psi_max: _number(1e-4, 1e4, "Wb")
    current_max: _number(1e-3, 1e6, "A")
    torque_max: _number(1e-4, 1e8, "N*m")
    speed_max: _number(1.0, 1e5, "rad/s (electrical)")
    method: Literal["MPTC", "MPFC"] = "MPTC"


class MptcDrive(_Drive):
    """An MPTC drive as its file describes it, SI."""

    controller: Literal["mptc"]
    machine: MptcMachine
    inverter: MptcInverter
    control: MptcControl


_DriveModel = TypeVar("_DriveModel", bound=_Drive)


def _describe(value: Any) -> str:
    """Show a value as a TOML user knows it, shortened."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, str):
        text = f'"{value}"'
    else:
        try:
            text = repr(value)
        except ValueError:  # an integer too long for Python to print
            return "an overlong integer"
    return text if len(text) <= 40 else text[:37] + "..."


def _keys(table: Any) -> dict[str, FieldInfo]:
    """Keys of a table by name; empty if it is none."""
    return getattr(table, "__pydantic_fields__", {})


def _allowed(table: type, key: str) -> str:
    """What a key of a table may be, in words."""
    field = _keys(table)[key]
    if field.description:
        return field.description
    annotation = field.annotation
    if get_origin(annotation) is Literal:
        return " or ".join(f'"{choice}"' for choice in get_args(annotation))
    if _keys(annotation):
        return f"a table [{key}] with the keys {', '.join(_keys(annotation))}"
    return f"a number of seconds, {TS_PU_MIN} to {TS_PU_MAX} pu of the base frequency"


def _explain(model: type[BaseModel], error: Any) -> str:
    """Turn one pydantic error into "key: what is wrong, what is allowed"."""
    location = [str(part) for part in error["loc"]]
    if error["type"] == "across_keys":
        return ".".join([*location, error["msg"]])
    dotted = ".".join(location)
    table: Any = model
    for part in location[:-1]:
        table = _keys(table)[part].annotation
    name = f"[{'.'.join(location[:-1])}]" if location[:-1] else "the file's top level"
    if error["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{dotted}: unknown key; {name} may hold {', '.join(_keys(table))}"
    allowed = _allowed(table, location[-1])
    if error["type"] == "missing":
        return f"{dotted}: missing; it must be {allowed}"
    return f"{dotted}: got {_describe(error['input'])}; it must be {allowed}"


def _read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a TOML file, all that can fail turned into a `DriveFileError`."""
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except OSError as error:
        reason = error.strerror or str(error)
        raise DriveFileError(
            f"{path}: cannot be read ({reason}); a readable TOML drive file is needed"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise DriveFileError(
            f"{path}: not a TOML file ({error}); a drive file is TOML in UTF-8"
        ) from error


def _validated(model: type[_DriveModel], data: Any) -> _DriveModel:
    """Validate the tables of a drive; raises `DriveError` in words."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problems = "; ".join(_explain(model, e) for e in error.errors(include_url=False))
        raise DriveError(problems) from None


def shipped_drives() -> dict[str, str]:
    """Drive files that come with the package: name (``"anpc5l_6kv"``) to text."""
    folder = resources.files("directmpc") / "drives"
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return {f.name.removesuffix(".toml"): f.read_text(encoding="utf-8") for f in files}


def _read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Tables of a drive file, or of the drive that ships under this name."""
    name = os.fspath(path)
    if name == os.path.basename(name) and not os.path.lexists(name):
        shipped = shipped_drives()
        if name.removesuffix(".toml") in shipped:
            return tomllib.loads(shipped[name.removesuffix(".toml")])
        try:
            return _read_toml(path)
        except DriveFileError as error:
            raise DriveFileError(f"{error}, or the name of one: {', '.join(shipped)}") from error
    return _read_toml(path)


def load_drive(path: str | os.PathLike[str]) -> Drive | MptcDrive:
    """Load a drive file of either controller.

    Parameters
    ----------
    path
        TOML file as docs/specification.md, section 4.1, describes it, or the name of one of
        `shipped_drives` (``"anpc5l_6kv"``). A file of that name in the current folder comes first.

    Returns
    -------
    Drive or MptcDrive
        As the file's key `controller` says.

    Raises
    ------
    DriveFileError
        If the file cannot be read, is not TOML, or a key is unknown, missing, of the wrong type
        or out of range. The message is one paragraph: file, dotted key, what is allowed.
    """
    data = _read(path)
    controller = data.get("controller")
    try:
        if controller == "mpdcc":
            return _validated(Drive, data)
        if controller == "mptc":
            return _validated(MptcDrive, data)
    except DriveError as error:
        raise DriveFileError(f"{path}: {error}") from None
    found = f"got {_describe(controller)}" if "controller" in data else "missing"
    raise DriveFileError(f'{path}: controller: {found}; it must be "mpdcc" or "mptc"')


def load_mpdcc_drive(path: str | os.PathLike[str]) -> Drive:
    """Load an MPDCC drive file; raises `DriveFileError` as `load_drive`, or if it is MPTC."""
    drive = load_drive(path)
    if not isinstance(drive, Drive):
        raise DriveFileError(f'{path}: controller: got "mptc"; it must be "mpdcc" here')
    return drive


def load_mptc_drive(path: str | os.PathLike[str]) -> MptcDrive:
    """Load an MPTC drive file; raises `DriveFileError` as `load_drive`, or if it is MPDCC."""
    drive = load_drive(path)
    if not isinstance(drive, MptcDrive):
        raise DriveFileError(f'{path}: controller: got "mpdcc"; it must be "mptc" here')
    return drive
