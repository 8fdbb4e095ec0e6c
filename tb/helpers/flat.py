"""Wrappers of entities whose ports are records and numbers, for benches that see vectors alone.

A record among the ports becomes a port for each of its fields, ``PORT_FIELD``; the same of an array
of records, whose elements stand side by side. Any other array, and a record in a record, becomes
one vector. The first field and the first element are rightmost. A natural number has 31 bits.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from scripts.hdl.sources import LIBRARY, RTL
from tb.helpers.faults import file_of

_COMMENT = re.compile(r"--[^\n]*")
_USED = re.compile(r"\buse\s+work\.(\w+)\.all", re.I)
_SUBTYPE = re.compile(r"\bsubtype\s+(\w+)\s+is\s+([^;]+);", re.I)
_ARRAY = re.compile(r"\btype\s+(\w+)\s+is\s+array\s*\(([^)]*)\)\s*of\s+([^;]+);", re.I)
_RECORD = re.compile(r"\btype\s+(\w+)\s+is\s+record\b(.*?)\bend\s+record\b", re.I | re.S)
_FIELD = re.compile(r"(\w+)\s*:\s*([^;]+);")
_ENTITY = r"\bentity\s+%s\s+is\s*(?:generic\s*\((.*?)\)\s*;\s*)?port\s*\((.*?)\)\s*;\s*end\b"
_PORT = re.compile(r"(\w+)\s*:\s*(in|out)\s+(.+?)(?::=(.*))?\s*$", re.S)
_MARKS = ("std_logic_vector", "signed", "unsigned")
_BASE = """
  function flat (value : std_logic) return std_logic_vector is

    constant WORD : std_logic_vector(0 downto 0) := (others => value);

  begin

    return WORD;

  end function flat;

  function flat (value : std_logic_vector) return std_logic_vector is
  begin

    return value;

  end function flat;

  function flat (value : unsigned) return std_logic_vector is
  begin

    return std_logic_vector(value);

  end function flat;

  function flat (value : signed) return std_logic_vector is
  begin

    return std_logic_vector(value);

  end function flat;

  function flat (value : natural) return std_logic_vector is
  begin

    return std_logic_vector(to_unsigned(value, 31));

  end function flat;
"""


@dataclass(frozen=True)
class Flat:
    """How an entity is wrapped."""

    #: Records among the ports that become one vector each.
    whole: tuple[str, ...] = ()
    #: Records among the ports whose fields keep their names.
    bare: tuple[str, ...] = ()
    #: Ports that the wrapper has not: a constant, or ``open`` for an output.
    tied: Mapping[str, str] = field(default_factory=dict)
    #: Generics that the wrapper has not, and what they are.
    fixed: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class _Type:
    """A type of VHDL: its mark, the bits of its vector, and what it consists of."""

    mark: str
    bits: str
    #: Fields of a record; of an array its element, without a name.
    parts: tuple[tuple[str, _Type], ...] = ()
    #: Elements of an array whose type leaves them open.
    elements: str = ""

    @property
    def composite(self) -> bool:
        return bool(self.parts)

    @property
    def record(self) -> bool:
        return self.composite and self.parts[0][0] != ""

    def of(self, bits: str, low: str) -> str:
        """This type's value that begins at a bit of a vector."""
        if self.mark == "std_logic":
            return f"{bits}({low})"
        part = f"{bits}({low} + {self.bits} - 1 downto {low})"
        if self.mark == "std_logic_vector":
            return part
        if self.mark == "natural":
            return f"to_integer(unsigned({part}))"
        return f"{f'to_{self.mark}' if self.composite else self.mark}({part})"


def _count(bounds: str) -> str:
    """Elements between two bounds."""
    left, down, right = re.split(r"\s+(downto|to)\s+", bounds.strip())
    return f"(({left}) - ({right}) + 1)" if down == "downto" else f"(({right}) - ({left}) + 1)"


class _Types:
    """The types of packages, by name."""

    def __init__(self, packages: list[str]) -> None:
        self._subtypes = {k: v for one in packages for k, v in _SUBTYPE.findall(one)}
        self._arrays = {k: (b, e) for one in packages for k, b, e in _ARRAY.findall(one)}
        self._records = {k: _FIELD.findall(v) for one in packages for k, v in _RECORD.findall(one)}

    def of(self, text: str) -> _Type:
        """The type that a declaration names."""
        mark, _, bounds = text.strip().partition("(")
        mark, bounds = mark.strip(), bounds.rstrip().removesuffix(")")
        if mark == "std_logic":
            return _Type(mark, "1")
        if mark.startswith("natural"):
            return _Type("natural", "31")
        if mark in _MARKS:
            return _Type(mark, _count(bounds))
        if mark in self._subtypes:
            return _Type(self.of(self._subtypes[mark]).mark, f"{mark}'length")
        if mark in self._arrays:
            one = self.of(self._arrays[mark][1])
            count = _count(bounds) if bounds else f"{mark}'length"
            return _Type(mark, f"({count} * {one.bits})", (("", one),), count if bounds else "")
        parts = tuple((name, self.of(kind)) for name, kind in self._records[mark])
        return _Type(mark, f"({' + '.join(one.bits for _, one in parts)})", parts)


def _composites(kind: _Type) -> Iterator[_Type]:
    """Types that need functions of their own, inner ones first."""
    for _, part in kind.parts:
        yield from _composites(part)
    if kind.composite:
        yield kind


def _functions(kind: _Type) -> str:
    """Both ways between a type and its vector."""
    if kind.record:
        joined = " & ".join(f"flat(value.{name})" for name, _ in reversed(kind.parts))
        there = f"return {joined};"
        back = "".join(
            f"result.{name} := {part.of('bits', 'used')}; used := used + {part.bits};\n"
            for name, part in kind.parts
        )
    else:
        ((_, part),) = kind.parts
        there = (
            f"for i in value'range loop result(i * {part.bits} + {part.bits} - 1 downto "
            f"i * {part.bits}) := flat(value(i)); end loop; return result;"
        )
        back = f"for i in result'range loop result(i) := {part.of('bits', 'used')}; "
        back += f"used := used + {part.bits}; end loop;\n"
    return f"""
  function flat (value : {kind.mark}) return std_logic_vector is
    variable result : std_logic_vector({kind.bits} - 1 downto 0);
  begin
    {there}
  end function flat;

  function to_{kind.mark} (value : std_logic_vector) return {kind.mark} is
    variable bits   : std_logic_vector(value'length - 1 downto 0) := value;
    variable used   : natural := 0;
    variable result : {kind.mark};
  begin
    {back}    return result;
  end function to_{kind.mark};
"""


def _port(name: str, mode: str, bits: str) -> str:
    return f"{name} : {mode} std_logic_vector({bits} - 1 downto 0)"


def _leaves(name: str, mode: str, kind: _Type, how: Flat) -> tuple[list[str], list[str]]:
    """Ports of a record, or of an array of records, and the assignments to or from a signal."""
    ports, lines = [], []
    one = kind if kind.record else kind.parts[0][1]
    for part, field_ in (("", one),) if name in how.whole else one.parts:
        own = "_".join(filter(None, (part,) if name in how.bare else (name, part)))
        inner, of = f"own_{name}", f".{part}" if part else ""
        if field_.mark == "std_logic" and kind.record:
            ports.append(f"{own} : {mode} std_logic")
            lines.append(f"{inner}{of} <= {own};" if mode == "in" else f"{own} <= {inner}{of};")
        elif kind.record:
            ports.append(_port(own, mode, field_.bits))
            there = f"{own} <= flat({inner}{of});"
            lines.append(f"{inner}{of} <= {field_.of(own, '0')};" if mode == "in" else there)
        else:
            ports.append(_port(own, mode, f"{kind.elements} * {field_.bits}"))
            low = f"i * {field_.bits}"
            there = f"{own}({low} + {field_.bits} - 1 downto {low}) <= flat({inner}(i){of});"
            back = f"{inner}(i){of} <= {field_.of(own, low)};"
            lines += [
                f"g_{own} : for i in 0 to {kind.elements} - 1 generate",
                back if mode == "in" else there,
                "end generate;",
            ]
    return ports, lines


def wrapper(entity: str, how: Flat, rtl: Path = RTL) -> str:
    """VHDL of ``ENTITY_flat``."""
    text = _COMMENT.sub("", file_of(entity, rtl).read_text(encoding="utf-8"))
    found = re.search(_ENTITY % entity, text, re.S)
    assert found is not None, f"{entity}: no entity in its file"
    used = list(dict.fromkeys(_USED.findall(text)))
    packages = []
    for one in used:  # which grows by what they use themselves
        packages.append(_COMMENT.sub("", file_of(one, rtl).read_text(encoding="utf-8")))
        used += [further for further in _USED.findall(packages[-1]) if further not in used]
    generics = [one.strip() for one in (found[1] or "").split(";") if one.strip()]
    kept = [one for one in generics if one.split()[0] not in how.fixed]
    maps = {one.split()[0]: one.split()[0] for one in kept} | dict(how.fixed)
    types, needed = _Types(packages), {}
    ports, signals, lines, joined = [], [], [], []
    for one in found[2].split(";"):
        matched = _PORT.fullmatch(one.strip())
        assert matched is not None, f"{entity}: {one}"
        name, mode, kind = matched[1], matched[2], types.of(matched[3])
        if name in how.tied:
            joined.append(f"{name} => {how.tied[name]}")
            continue
        if kind.mark in ("std_logic", "std_logic_vector"):
            bit = kind.mark == "std_logic"
            ports.append(f"{name} : {mode} std_logic" if bit else _port(name, mode, kind.bits))
            joined.append(f"{name} => {name}")
            continue
        needed |= {inner.mark: inner for inner in _composites(kind)}
        joined.append(f"{name} => own_{name}")
        signals.append(f"signal own_{name} : {matched[3].strip()};")
        inner = kind.parts[0][1] if kind.composite else kind
        if kind.record or inner.record:
            further = _leaves(name, mode, kind, how)
            ports += further[0]
            lines += further[1]
            continue
        ports.append(_port(name, mode, kind.bits))
        lines.append(
            f"own_{name} <= {kind.of(name, '0')};"
            if mode == "in"
            else f"{name} <= flat(own_{name});"
        )
    unused = [mark for mark, kind in needed.items() if kind.elements]
    functions = "".join(_functions(kind) for mark, kind in needed.items() if mark not in unused)
    declared = [
        "library ieee;", "use ieee.std_logic_1164.all;", "use ieee.numeric_std.all;",
        f"library {LIBRARY};", *(f"use {LIBRARY}.{one}.all;" for one in used),
        f"entity {entity}_flat is",
        *(["generic (", ";\n".join(kept), ");"] if kept else []),
        "port (", ";\n".join(ports), ");", f"end entity {entity}_flat;",
    ]  # fmt: skip
    mapped = ", ".join(f"{generic} => {value}" for generic, value in maps.items())
    body = [
        f"architecture bench of {entity}_flat is", _BASE, functions, *signals,
        "begin", f"i_own : entity {LIBRARY}.{entity}",
        *([f"generic map ({mapped})"] if maps else []),
        "port map (", ",\n".join(joined), ");", *lines, "end architecture bench;",
    ]  # fmt: skip
    return "\n".join([*declared, *body, ""])
