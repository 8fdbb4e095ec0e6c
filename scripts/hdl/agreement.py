"""Whether an entity and its converted Verilog do the same: both are simulated with the same inputs.

GHDL simulates the VHDL, Verilator the netlist. In every clock every output is compared that the
VHDL knows and that does not depend on what registers hold at first. Inputs are random: each is
held, changes in every clock, or in a few. The reset is held at first and given now and then.

Clock and reset are found by their names. A clock is an input of one bit called `clk` or `clock`; a
reset `rst` or `reset`, low active with `_n`. Ports have to be `std_logic` or a vector of it,
`unsigned` or `signed`. A design with other ports cannot be compared, and `compare` says so.
"""

from __future__ import annotations

import random
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scripts.hdl import conversion, netlist_check, sources
from scripts.hdl.conversion import NetlistError, Repairs
from scripts.shared import tools
from scripts.shared.tools import Generics, ToolError

#: Clocks that are compared unless a caller wants others.
CLOCKS = 4000
#: Runs of the netlist, each with other contents of its registers. A bit that depends on them is
#: taken for one that does not in one of 2**15 cases.
RUNS = 16
_KINDS = {
    "std_logic": "{}", "std_ulogic": "{}", "std_logic_vector": "{}",
    "std_ulogic_vector": "std_ulogic_vector({})", "unsigned": "unsigned({})",
    "signed": "signed({})",
}  # fmt: skip
_CLOCK = re.compile(r"(?:^|_)(?:clk|clock)(?:_|$)")
#: Inputs that may be clocks, too: they change when the others have settled.
_LATE = re.compile(r"cl(?:oc)?k|sck|oscillator")
_RESET = re.compile(r"(?:^|_)a?(?:rst|reset)(?:_|n?$)")


class NotComparableError(ToolError):
    """The design has ports that the comparison cannot drive or read; the message names one."""


@dataclass(frozen=True)
class Agreement:
    """How much was compared."""

    clocks: int  #: Clocks.
    known: float  #: Share of the output bits in these clocks that were compared.

    def __str__(self) -> str:
        return (
            f"does as the VHDL in {self.clocks} clocks of random inputs "
            f"({self.known:.0%} of the output bits are known)"
        )


@dataclass(frozen=True)
class _Port:
    name: str
    width: int
    kind: str


def _ports(top: str, files: Sequence[Path], verilog: Path) -> tuple[list[_Port], list[_Port]]:
    """Inputs and outputs; the clock first, then what may be one last."""
    kinds: dict[str, str] = {}
    for names, kind in conversion.interface(top, files).ports:
        kinds |= {name.lower(): kind.lower() for name in names}
    for name, kind in kinds.items():
        if kind not in _KINDS:
            raise NotComparableError(f"its port {name} is of the type {kind}")
    every = netlist_check.ports_of(verilog, top, besides=())
    if missing := [name for name in kinds if name not in every.inputs | every.outputs]:
        raise NotComparableError(f"its port {missing[0]} is neither an input nor an output")
    inputs, outputs = (
        [_Port(name, width, kinds[name]) for name, width in side.items()]
        for side in (every.inputs, every.outputs)
    )
    inputs.sort(key=lambda port: port.width == 1 and _LATE.search(port.name) is not None)
    if not outputs:
        raise NotComparableError("it has no output")
    return inputs, outputs


def _clock(inputs: Sequence[_Port]) -> str | None:
    """The input that is the clock."""
    found = [port.name for port in inputs if port.width == 1 and _CLOCK.search(port.name)]
    return min(found, key=len, default=None)


def _bits(port: _Port, clocks: int, draw: random.Random) -> list[int]:
    """Values of an input."""
    width, values, now = port.width, [], 0
    reset = width == 1 and _RESET.search(port.name)
    if reset:
        active = 0 if port.name.endswith("n") else 1
        return [active if n < 8 or draw.random() < 0.002 else 1 - active for n in range(clocks)]
    while len(values) < clocks:
        change = draw.choice((0.0, 0.03, 0.2, 1.0))
        ones = draw.choice((0.04, 0.5, 0.96))
        for _ in range(draw.randrange(40, 400)):
            if draw.random() < change:
                if width == 1:
                    now = int(draw.random() < ones)
                else:
                    now = draw.choice((0, 2**width - 1, *(draw.getrandbits(width),) * 8))
            elif width == 1 and change < 1:
                now = int(ones > 0.5)
            values.append(now)
    return values[:clocks]


_BENCH = """library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
use std.textio.all;
entity agreement_bench is
end entity;
architecture bench of agreement_bench is
  signal clk_bench : std_logic := '0';
  signal i : std_logic_vector({inputs} downto 0) := (others => '0');
  signal o : std_logic_vector({outputs} downto 0);
begin
  i_design : entity work.{top}{generics}
    port map ({ports});
  process
    file given : text open read_mode is "inputs.txt";
    file found : text open write_mode is "outputs.txt";
    variable l : line;
    variable s : string(1 to {inputs} + 1);
    variable r : string(1 to {outputs} + 1);
  begin
    while not endfile(given) loop
      readline(given, l);
      read(l, s);
      for phase in 0 to 1 loop
        for n in s'range loop
          if (n > {early}) = (phase = 1) then
            if s(n) = '1' then
              i({inputs} + 1 - n) <= '1';
            else
              i({inputs} + 1 - n) <= '0';
            end if;
          end if;
        end loop;
        wait for 1 ns;
      end loop;
      for n in r'range loop
        r(n) := std_logic'image(o({outputs} + 1 - n))(2);
      end loop;
      write(l, r);
      writeline(found, l);
      clk_bench <= '1';
      wait for 1 ns;
      clk_bench <= '0';
      wait for 1 ns;
    end loop;
    wait;
  end process;
end architecture;
"""

_HARNESS = """#include <cstdint>
#include <cstdio>
#include <vector>
#include "Vcore.h"
#include "verilated.h"
double sc_time_stamp() {{ return 0; }}
int main(int argc, char **argv) {{
    Verilated::commandArgs(argc, argv);
    std::vector<uint32_t> first, same;
    for (int run = 0; run < {runs}; run++) {{
        Verilated::randReset(run < 2 ? run : 2);
        Verilated::randSeed(run + 1);
        Vcore *m = new Vcore;
        FILE *given = fopen("inputs.bin", "rb");
        uint32_t in[{inputs}];
        size_t place = 0;
        while (fread(in, 4, {inputs}, given) == {inputs}) {{
            {early}
            m->eval();
            {late}
            m->eval();
            uint32_t out[{outputs}] = {{0}};
            {get}
            for (int k = 0; k < {outputs}; k++, place++) {{
                if (run == 0) {{ first.push_back(out[k]); same.push_back(~0u); }}
                else same[place] &= ~(first[place] ^ out[k]);
            }}
            {tick}
        }}
        fclose(given);
        m->final();
        delete m;
    }}
    FILE *found = fopen("outputs.bin", "wb");
    fwrite(first.data(), 4, first.size(), found);
    fwrite(same.data(), 4, same.size(), found);
    fclose(found);
    return 0;
}}
"""


def _words(ports: Sequence[_Port]) -> int:
    return sum((port.width + 31) // 32 for port in ports)


def _to_words(values: dict[str, list[int]], ports: Sequence[_Port], clocks: int) -> bytes:
    columns = [
        [value >> 32 * n & 0xFFFFFFFF for value in values[port.name]]
        for port in ports
        for n in range((port.width + 31) // 32)
    ]
    return np.array(columns or [[0] * clocks], dtype="<u4").T.tobytes()


def _put(ports: Sequence[_Port], offset: int) -> str:
    lines = []
    for port in ports:
        if port.width <= 32:
            lines.append(f"m->{port.name} = in[{offset}];")
        elif port.width <= 64:
            lines.append(f"m->{port.name} = in[{offset}] | (uint64_t)in[{offset + 1}] << 32;")
        else:
            count = (port.width + 31) // 32
            lines += [f"m->{port.name}[{n}] = in[{offset + n}];" for n in range(count)]
        offset += (port.width + 31) // 32
    return " ".join(lines)


def _get(ports: Sequence[_Port]) -> str:
    lines, offset = [], 0
    for port in ports:
        count = (port.width + 31) // 32
        if port.width <= 64:
            shifts = (f"(uint32_t)((uint64_t)m->{port.name} >> {32 * n})" for n in range(count))
        else:
            shifts = (f"m->{port.name}[{n}]" for n in range(count))
        lines += [f"out[{offset + n}] = {text};" for n, text in enumerate(shifts)]
        offset += count
    return " ".join(lines)


def _of_netlist(
    verilog: Path,
    top: str,
    inputs: Sequence[_Port],
    outputs: Sequence[_Port],
    clock: str | None,
    folder: Path,
) -> tuple[np.ndarray, np.ndarray]:
    """Outputs of the netlist, bits with the last port's lowest last, and which are sure."""
    early = [port for port in inputs if not (port.width == 1 and _LATE.search(port.name))]
    late = [port for port in inputs if port not in early]
    tick = f"m->{clock} = 1; m->eval(); m->{clock} = 0; m->eval();" if clock else ""
    harness = _HARNESS.format(
        runs=RUNS, inputs=max(_words(inputs), 1), outputs=_words(outputs),
        early=_put(early, 0), late=_put(late, _words(early)), get=_get(outputs), tick=tick,
    )  # fmt: skip
    (folder / "harness.cpp").write_text(harness, encoding="utf-8")
    (folder / "core.v").write_bytes(verilog.read_bytes())
    options = [*netlist_check.OPTIONS, "--top-module", top.lower()]
    command = [*tools.tool("verilator"), *options, "-o", "core", "core.v", "harness.cpp"]
    tools.run(command, cwd=folder, timeout=900)
    tools.run([str(folder / "obj" / "core")], cwd=folder)
    words = np.fromfile(folder / "outputs.bin", dtype="<u4").reshape(2, -1, _words(outputs))
    parts, offset = [], 0
    for port in outputs:
        count = (port.width + 31) // 32
        raw = words[:, :, offset : offset + count]
        bits = np.unpackbits(np.ascontiguousarray(raw).view(np.uint8), axis=2, bitorder="little")[
            :, :, : port.width
        ]
        parts.append(bits[:, :, ::-1])
        offset += count
    values, sure = np.concatenate(parts, axis=2)
    return values, sure


def _of_vhdl(
    top: str,
    generics: Generics,
    files: Sequence[Path],
    std: str,
    inputs: Sequence[_Port],
    outputs: Sequence[_Port],
    clock: str | None,
    folder: Path,
    values: Mapping[str, Sequence[int]],
) -> np.ndarray:
    """Outputs of the VHDL as characters, in the order of `_of_netlist`."""
    lines = (
        "".join(f"{word:0{port.width}b}" for word, port in zip(row, inputs, strict=True)) or "0"
        for row in zip(*(values[port.name] for port in inputs), strict=True)
    )
    (folder / "inputs.txt").write_text("\n".join(lines) + "\n", encoding="ascii")
    maps = [f"{clock} => clk_bench"] if clock else []
    for side, signal in ((inputs, "i"), (outputs, "o")):
        offset = sum(port.width for port in side)
        for port in side:
            offset -= port.width
            wide = not port.kind.endswith("logic")
            place = f"{offset + port.width - 1} downto {offset}" if wide else f"{offset}"
            actual, formal = f"{signal}({place})", port.name
            if signal == "i":
                actual = _KINDS[port.kind].format(actual)
            elif _KINDS[port.kind] != "{}":
                formal = f"std_logic_vector({formal})"
            maps.append(f"{formal} => {actual}")
    chosen = [f"{name} => {tools.generic_text(value)}" for name, value in generics.items()]
    late = [port for port in inputs if port.width == 1 and _LATE.search(port.name)]
    wide_in = max(sum(port.width for port in inputs), 1)
    text = _BENCH.format(
        inputs=wide_in - 1, outputs=sum(port.width for port in outputs) - 1, top=top,
        generics=f" generic map ({', '.join(chosen)})" if chosen else "",
        ports=", ".join(maps), early=wide_in - len(late),
    )  # fmt: skip
    (folder / "bench.vhd").write_text(text, encoding="utf-8")
    ghdl = tools.tool("ghdl")
    options = [f"--std={std}", f"--work={sources.LIBRARY}"]
    names = [str(path.resolve()) for path in files]
    tools.run([*ghdl, "-a", *options, *names, "bench.vhd"], cwd=folder)
    # a circuit with random inputs may be told so by assertions; outputs alone are compared
    quiet = ["--ieee-asserts=disable", "--assert-level=none"]
    tools.run([*ghdl, "--elab-run", *options, "agreement_bench", *quiet], cwd=folder)
    found = (folder / "outputs.txt").read_bytes().split()
    return np.frombuffer(b"".join(found), "S1").reshape(len(found), -1)


def answers(
    top: str, generics: Generics, verilog: Path, values: Mapping[str, Sequence[int]]
) -> dict[str, np.ndarray]:
    """What the VHDL of an entity of rtl/ answers to inputs, clock by clock, in GHDL.

    Parameters
    ----------
    top : str
        The entity.
    generics : Generics
        Those that are not at their defaults.
    verilog : Path
        Its converted Verilog, for the widths of its ports.
    values : Mapping[str, Sequence[int]]
        Words of every input but the clock, for each clock; an input that is left out is 0.

    Returns
    -------
    dict[str, np.ndarray]
        Output -> unsigned words that the edge at the end of each clock sees; -1 where the VHDL
        does not know a bit.

    Raises
    ------
    NotComparableError
        If a port cannot be driven or read.
    ToolError
        If a tool is missing or fails.
    """
    files = sources.compile_order(top, sources.rtl_files(sources.RTL))
    inputs, outputs = _ports(top, files, verilog)
    clock = _clock(inputs)
    inputs = [port for port in inputs if port.name != clock]
    clocks = len(next(iter(values.values())))
    every = {port.name: values.get(port.name, [0] * clocks) for port in inputs}
    with tempfile.TemporaryDirectory(prefix="agreement-") as name:
        bits = _of_vhdl(
            top, generics, files, sources.standard(files), inputs, outputs, clock, Path(name), every
        )
    found, place = {}, 0
    for port in outputs:
        part = bits[:, place : place + port.width]
        place += port.width
        weights = 1 << np.arange(port.width, dtype=np.int64)[::-1]
        words = np.isin(part, [b"1", b"H"]) @ weights
        known = np.isin(part, [b"0", b"1", b"L", b"H"]).all(axis=1)
        found[port.name] = np.where(known, words, -1)
    return found


def compare(
    top: str,
    generics: Generics,
    files: Sequence[Path],
    std: str,
    verilog: Path,
    *,
    clocks: int = CLOCKS,
    seed: int = 1,
) -> Agreement:
    """Compare an entity with its converted Verilog."""
    inputs, outputs = _ports(top, files, verilog)
    clock = _clock(inputs)
    inputs = [port for port in inputs if port.name != clock]
    draw = random.Random(seed)
    values = {port.name: _bits(port, clocks, draw) for port in inputs}
    with tempfile.TemporaryDirectory(prefix="agreement-") as name:
        folder = Path(name)
        (folder / "inputs.bin").write_bytes(_to_words(values, inputs, clocks))
        got, sure = _of_netlist(verilog, top, inputs, outputs, clock, folder)
        want = _of_vhdl(top, generics, files, std, inputs, outputs, clock, folder, values)
    ones = np.isin(want, [b"1", b"H"])
    known = (ones | np.isin(want, [b"0", b"L"])) & (sure == 1)
    wrong = known & (ones != (got == 1))
    if wrong.any():
        at, bit = (int(n) for n in np.argwhere(wrong)[0])
        port = next(
            p for n, p in enumerate(outputs) if bit < sum(q.width for q in outputs[: n + 1])
        )
        raise NetlistError(
            f"{top}: the netlist is refused; its output {port.name} differs from the VHDL in clock "
            f"{at}"
        )
    return Agreement(clocks, float(known.mean()))


def checked(
    top: str,
    generics: Generics | None = None,
    out: Path | None = None,
    *,
    files: Sequence[Path] | None = None,
    std: str | None = None,
) -> tuple[Path, Repairs, str]:
    """Convert an entity, compare the Verilog with the VHDL, and write it if they agree."""
    generics = generics or {}
    files = files or sources.compile_order(top, sources.rtl_files())
    std = std or sources.standard(files)
    target = out or tools.BUILD / "verilog" / f"{tools.configuration_name(top, generics)}.v"
    with tools.replacing(target) as temporary:
        _, repairs = conversion.convert(top, generics, temporary, files=files, std=std)
        try:
            said = str(compare(top, generics, files, std, temporary))
        except NotComparableError as error:
            said = f"not simulated beside the VHDL: {error}"
    return target, repairs, said
