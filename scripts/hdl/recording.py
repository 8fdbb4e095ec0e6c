"""Records the ports of one entity, clock by clock, from a short run of GHDL.

The bench is written here: one signal for each port, a clock, and the inputs that are given. Inputs
change with the edge that begins a clock, as if registers drove them. What is recorded of a clock is
what the edge at its end samples.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scripts.hdl import sources
from scripts.shared import tools
from scripts.shared.tools import ToolError

BENCH = "recorded"
PERIOD_NS = 10
CLOCKS = ("clk", "clock")
"""Names of the clock's port."""

Values = dict[str, list[int | None]]
"""Port -> value in each clock, unsigned; None where a bit is undefined."""


@dataclass(frozen=True)
class Recorded:
    """Ports of an entity during a run."""

    values: Values  #: Of each port in each clock.
    bits: dict[str, int]  #: Width of each port.


class RecordingError(ToolError):
    """The run cannot be recorded; the message says why."""


def _clauses(text: str, entity: str) -> tuple[str, str, str]:
    """Context, generic clause and port clause of an entity, without comments."""
    code = re.sub(r"--[^\n]*", "", text)
    found = re.search(rf"^entity {entity} is\b(.*?)^end entity", code, re.S | re.M)
    if found is None:
        raise RecordingError(f"{entity}: no entity of that name")
    context = code[: found.start()]
    generic = re.search(r"^  generic \((.*?)^  \);", found[1], re.S | re.M)
    port = re.search(r"^  port \((.*?)^  \);", found[1], re.S | re.M)
    if port is None:
        raise RecordingError(f"{entity}: no ports")
    return context, generic[1] if generic else "", port[1]


def _literal(value: int, name: str, kind: str) -> str:
    """A value for a port, as wide as the port."""
    if kind == "std_logic":
        return f"'{value & 1}'"
    value = int(value)
    word = format(value if value >= 0 else value & ((1 << value.bit_length() + 1) - 1), "b")
    way = "signed" if value < 0 else "unsigned"
    return f"std_logic_vector(resize({way}'(\"{word}\"), {name}'length))"


def bench(text: str, entity: str, clocks: Sequence[Mapping[str, int]]) -> str:
    """VHDL of the bench."""
    context, generic, port = _clauses(text, entity)
    kinds: dict[str, str] = {}
    signals = []
    for line in port.split(";"):
        row = re.match(r"\s*(\w+)\s*:\s*(in|out)\s+(.*?\S)\s*(?::=.*)?$", line, re.S)
        if row is None or not row[3].startswith("std_logic"):
            raise RecordingError(f"{entity}: no flat port: {line.strip()}")
        kinds[row[1]] = "std_logic" if row[3] == "std_logic" else "vector"
        start = "'0'" if kinds[row[1]] == "std_logic" else "(others => '0')"
        given = f" := {start}" if row[2] == "in" else ""
        signals.append(f"  signal {row[1]} : {row[3]}{given};")
    steps = []
    for number, inputs in enumerate(clocks):
        steps.append("    wait until rising_edge(@);")
        for name, value in inputs.items():
            if name not in kinds:
                raise RecordingError(f"{entity}, clock {number}: no port {name}")
            steps.append(f"    {name} <= {_literal(value, name, kinds[name])};")
    clock = next((name for name in CLOCKS if name in kinds), None)
    if clock is None:
        raise RecordingError(f"{entity}: no clock")
    names = [row for row in re.findall(r"(\w+)\s*:(?!=)", generic) if row]
    passed = ", ".join(f"{name} => {name}" for name in names)
    context = context if "numeric_std" in context else f"{context}  use ieee.numeric_std.all;\n"
    return "\n".join(
        [
            context,
            f"entity {BENCH} is",
            f"  generic ({generic});" if generic else "",
            "end entity;",
            f"architecture bench of {BENCH} is",
            *signals,
            "begin",
            f"  {clock} <= not {clock} after {PERIOD_NS // 2} ns;",
            f"  i_unit : entity work.{entity}",
            f"    generic map ({passed})" if names else "",
            f"    port map ({', '.join(f'{name} => {name}' for name in kinds)});",
            "  process is begin",
            *(step.replace("@", clock) for step in steps),
            "    wait;",
            "  end process;",
            "end architecture;",
            "",
        ]
    )


def read_vcd(text: str, scope: Sequence[str], clocks: int) -> Recorded:
    """Values of the signals of one scope in each clock."""
    head, _, body = text.partition("$enddefinitions $end")
    names: dict[str, list[str]] = {}
    bits: dict[str, int] = {}
    around: list[str] = []
    for found in re.finditer(r"\$(scope|upscope|var)\s+(.*?)\s*\$end", head, re.S):
        words = found[2].split()
        if found[1] == "scope":
            around.append(words[1])
        elif found[1] == "upscope":
            around.pop()
        elif around == list(scope):
            name = words[3].partition("[")[0]
            names.setdefault(words[2], []).append(name)
            bits[name] = int(words[1])
    if not names:
        return Recorded({}, {})
    now: dict[str, str] = dict.fromkeys(names, "x")
    values: Values = {name: [] for found in names.values() for name in found}
    fs = 1_000_000

    def _sampled(until: int) -> None:
        """Note the clocks that have ended at a time."""
        while (done := len(next(iter(values.values()), []))) < clocks:
            if PERIOD_NS * fs * (done + 1) + PERIOD_NS * fs // 2 > until:
                return
            for mark, found in names.items():
                word = now[mark]
                for name in found:
                    values[name].append(int(word, 2) if set(word) <= {"0", "1"} else None)

    for line in body.split("\n"):
        if line.startswith("#"):
            _sampled(int(line[1:]))
        elif line.startswith("b"):
            word, _, mark = line[1:].partition(" ")
            if mark in now:
                now[mark] = word.lower()
        elif line and line[0] in "01uxzwlhUXZWLH-" and line[1:] in now:
            now[line[1:]] = line[0].lower()
    _sampled((clocks + 2) * PERIOD_NS * fs)
    return Recorded(values, bits)


def record(
    entity: str,
    clocks: Sequence[Mapping[str, int]],
    generics: Mapping[str, int | bool] | None = None,
    rtl: Path = sources.RTL,
    within: Sequence[str] = (),
) -> Recorded:
    """Run an entity and record its ports."""
    files = sources.compile_order(entity, sources.rtl_files(rtl))
    path = next(unit.path for unit in sources.scan(files) if entity in unit.entities)
    text = bench(path.read_text(encoding="utf-8"), entity, clocks)
    ghdl = tools.tool("ghdl")
    standard = f"--std={sources.standard(files)}"
    chosen = [f"-g{name}={tools.generic_text(v)}" for name, v in (generics or {}).items()]
    stop = f"--stop-time={(len(clocks) + 1) * PERIOD_NS}ns"
    with tempfile.TemporaryDirectory(prefix="directmpc-recording-") as name:
        folder = Path(name)
        (folder / "bench.vhd").write_text(text, encoding="utf-8")
        tools.run([*ghdl, "-a", standard, *map(str, files), "bench.vhd"], cwd=folder)
        command = [*ghdl, "--elab-run", standard, BENCH, *chosen, stop]
        tools.run([*command, "--vcd=waves.vcd", "--ieee-asserts=disable"], cwd=folder)
        text = (folder / "waves.vcd").read_text("latin-1")
    found = read_vcd(text, [BENCH, *(["i_unit", *within] if within else [])], len(clocks))
    if not found.bits:
        raise RecordingError(f"{entity}: no instance {'.'.join(within)}")
    return found
