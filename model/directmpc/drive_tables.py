"""What the drive files of both controllers have in common: tables of keys that check themselves.

A table is a frozen pydantic model. The annotation of a key holds its range and the words of an
error. What depends on several keys is checked by the table itself, so `changed` and `with_control`
refuse what a file may not hold.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar, Union, get_args, get_origin

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    WrapValidator,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError


class DriveError(ValueError):
    """A drive cannot be as it is asked to be; the message names the key and what is allowed."""


class DriveFileError(DriveError):
    """A drive file cannot be used; the message names file, key and what is allowed."""


def refused(key: str, message: str) -> PydanticCustomError:
    """The error of a check over several keys, for a validator; `key` is ``"control.ts"``."""
    return PydanticCustomError("across_keys", "{key}: {message}", {"key": key, "message": message})


def number(low: float, high: float, unit: str) -> Any:
    """Annotate a finite number with its closed range, its unit and, in words, what is allowed."""
    words = f"a number from {low:g} to {high:g} {unit}".rstrip()
    return Annotated[
        float, Field(strict=True, ge=low, le=high, allow_inf_nan=False, description=words)
    ]


def integer(low: int, high: int) -> Any:
    """Annotate an integer with its closed range and, in words, what is allowed."""
    words = f"an integer from {low} to {high}"
    return Annotated[int, Field(strict=True, ge=low, le=high, description=words)]


def to_start(low: float, high: float, unit: str) -> Any:
    """Annotate a number that a file may leave out, but that something needs to start."""
    words = f"a number from {low:g} to {high:g} {unit}"
    return Annotated[
        float | None, Field(strict=True, ge=low, le=high, allow_inf_nan=False, description=words)
    ]


def auto_or(value: Any) -> Any:
    """Annotate a key that holds a number, or "auto" for one that follows from the drive."""
    words = next(m.description for m in value.__metadata__ if isinstance(m, FieldInfo))
    return Annotated[
        value,
        WrapValidator(lambda given, numbers: given if given == "auto" else numbers(given)),
        Field(description=f'"auto" or {words}'),
    ]


def _kind(given: Any, first: str) -> str:
    """Key `type` of a table as it is given."""
    if isinstance(given, Mapping):
        found = given.get("type", first)
        return found if isinstance(found, str) else repr(found)
    return getattr(given, "type", first)


def one_of(kinds: Mapping[str, type]) -> Any:
    """Annotate a table whose keys depend on its key `type`."""
    first = next(iter(kinds))
    tagged = tuple(Annotated[table, Tag(name)] for name, table in kinds.items())
    return Annotated[Union[tagged], Discriminator(lambda given: _kind(given, first))]  # noqa: UP007


def kinds_of(annotation: Any) -> dict[str, Any]:
    """Tables by type of a key of `one_of`; empty for any other key."""
    found = {}
    for member in get_args(annotation):
        for mark in getattr(member, "__metadata__", ()):
            if isinstance(mark, Tag):
                found[mark.tag] = get_args(member)[0]
    return found


class Section(BaseModel):
    """A table of a drive file: frozen, without room for unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @classmethod
    def ranges(cls, data: Any, table: str, key: str, low: float, high: float) -> str:
        """What a message adds to a range: the same in other units."""
        return ""


class GuardTable(Section):
    """Table `guard`: what the devices of the inverter need of the gate guard; times in s.

    Every key may be left out. Such a file simulates and replays, but its drive cannot be started:
    `missing` says what is needed. `decision_limit` and `watchdog` follow from the control period
    where they are left out. `frozen` is how often the currents may repeat themselves while gates
    are on, 0 for any number.
    """

    #: Keys without which the drive can be started.
    OPTIONAL: ClassVar[tuple[str, ...]] = ("decision_limit", "watchdog", "frozen")

    dead_time: to_start(1e-9, 1e-3, "s") = None
    minimum_on: to_start(1e-9, 1e-3, "s") = None
    minimum_off: to_start(1e-9, 1e-3, "s") = None
    decision_limit: to_start(1e-7, 1.0, "s") = None
    watchdog: to_start(1e-7, 1.0, "s") = None
    frozen: integer(0, 255) = 20

    def missing(self) -> list[str]:
        """A sentence for each key that has to be added before the drive can be started."""
        return [
            f"guard.{name}: missing; it must be {allowed(type(self), name)}"
            for name in keys_of(type(self))
            if getattr(self, name) is None and name not in self.OPTIONAL
        ]


class AnyDrive(Section):
    """What the drives of all controllers can do."""

    @property
    def absent(self) -> tuple[str, ...]:
        """Keys of `guard`, and registers of `bands`, of what the converter does not have."""
        return ()

    def changed(self, **tables: Mapping[str, Any]) -> Self:
        """Make the same drive with other values, checked as a drive file is.

        ``drive.changed(machine={"rs": 0.006}, control={"horizon": 20})``. DriveError names key and
        range.
        """
        data: dict[str, Any] = {}
        for name in keys_of(type(self)):
            value = getattr(self, name)
            data[name] = {k: getattr(value, k) for k in keys_of(type(value))} or value
        for name, keys in tables.items():
            if not isinstance(keys, Mapping):
                raise DriveError(f"{name}: got {described(keys)}; a table of keys is needed")
            plain = {k: v.item() if isinstance(v, np.generic) else v for k, v in keys.items()}
            old = data.get(name, {})
            if isinstance(old, dict) and plain.get("type", old.get("type")) != old.get("type"):
                old = {}  # another kind has other keys
            data[name] = {**old, **plain} if isinstance(old, dict) else plain
        return validated(type(self), data)

    def with_control(self, **keys: Any) -> Self:
        """Make the same drive with other keys of `control`: ``drive.with_control(horizon=20)``."""
        return self.changed(control=keys)


DriveModel = TypeVar("DriveModel", bound=Section)


def described(value: Any) -> str:
    """Show a value as a TOML user knows it, 40 characters at most."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, str) or hasattr(value, "text"):
        text = f'"{getattr(value, "text", value)}"'
    else:
        try:
            text = repr(value)
        except ValueError:  # an integer too long for Python to print
            return "an overlong integer"
    return text if len(text) <= 40 else text[:37] + "..."


def keys_of(table: Any) -> dict[str, FieldInfo]:
    """Keys of a table by name, as pydantic describes them; empty for what is no table."""
    return getattr(table, "__pydantic_fields__", {})


def allowed(table: type, key: str) -> str:
    """Range and unit, or choices, of a key of a table; KeyError if it has no such key."""
    field = keys_of(table)[key]
    if field.description:
        return field.description
    annotation = field.annotation
    if get_origin(annotation) is Literal:
        return " or ".join(f'"{choice}"' for choice in get_args(annotation))
    tables = kinds_of(annotation)
    keys = keys_of(next(iter(tables.values())) if tables else annotation)
    return f"a table [{key}] with the keys {', '.join(keys)}"


def _explain(model: type[Section], error: Any, data: Any) -> str:
    """Turn one pydantic error into "key: what is wrong, what is allowed"."""
    location: list[str] = []
    table: Any = model
    tables: list[Any] = []
    for part in map(str, error["loc"]):
        if part in kinds_of(table):  # the kind, which is no key
            table = kinds_of(table)[part]
            continue
        location.append(part)
        tables.append(table)
        table = keys_of(table)[part].annotation if part in keys_of(table) else None
    if error["type"] == "across_keys":
        return ".".join([*location, error["msg"]])
    dotted = ".".join(location)
    if error["type"] == "union_tag_invalid":
        choices = " or ".join(f'"{kind}"' for kind in kinds_of(table))
        return f"{dotted}.type: got {described(error['input']['type'])}; it must be {choices}"
    table = tables[-1]
    name = f"[{'.'.join(location[:-1])}]" if location[:-1] else "the file's top level"
    if location[:-1] and (kind := keys_of(table).get("type")):
        name += f' of the type "{kind.default}"'
    if error["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{dotted}: unknown key; {name} may hold {', '.join(keys_of(table))}"
    words = allowed(table, location[-1])
    ends = {
        n: getattr(m, n)
        for m in keys_of(table)[location[-1]].metadata
        for n in ("ge", "le")
        if hasattr(m, n)
    }
    if len(location) > 1 and len(ends) == 2:
        words += model.ranges(data, *location[-2:], *ends.values())
    if error["type"] == "missing":
        return f"{dotted}: missing; it must be {words}"
    return f"{dotted}: got {described(error['input'])}; it must be {words}"


def validated(model: type[DriveModel], data: Any) -> DriveModel:
    """The drive of tables as a TOML reader returns them.

    DriveError names the key that is unknown, missing, of the wrong type or out of range.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problems = "; ".join(_explain(model, e, data) for e in error.errors(include_url=False))
        raise DriveError(problems) from None
