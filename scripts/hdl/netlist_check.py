"""A second simulator for every core: its converted Verilog in Verilator, checked by value.

The harness follows the protocol all cores share: `clk`, `rst` (synchronous, high), `start` (one
clock when idle), `valid` (one clock with the outputs stable in it). A transaction's inputs are on
the ports at the `start` edge and random values at every other edge, so a core that looks at its
inputs later is found out. `cycles` is the number of the edge at which `valid` is sampled high less
that of the `start` edge. Registers without a reset begin with random contents (a seed reproduces
them).

`simulate` returns the outputs of many transactions, `check` compares them, `Simulator` takes them
one by one and so closes a loop around the core at Verilator's speed.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

import numpy as np

from scripts.hdl import conversion as netlist
from scripts.shared import tools
from scripts.shared.tools import Generics, ToolError

#: Verilator's, and how its C++ is compiled: compiling takes most of the time, so it is quick.
OPTIONS = (
    *("--cc", "--exe", "--build", "-O3", "--prefix", "Vcore", "--Mdir", "obj"),
    *("--x-assign", "unique", "--x-initial", "unique", "--no-timing"),
    *("-Wno-fatal", "-Wno-lint", "-Wno-style"),
    *("-CFLAGS", "-std=c++17", "-MAKEFLAGS", "-s OPT_FAST=-O1 OPT_SLOW=-O0 OPT_GLOBAL=-O0"),
)
CONTROL = ("clk", "rst", "start", "valid")
_PORT = re.compile(r"^\s*\(?(input|output)\s+(?:\[(\d+):0\] )?(\w+)[,)]", re.M)


@dataclass(frozen=True)
class Ports:
    """Data ports of a core, name to width in bits."""

    inputs: dict[str, int]
    outputs: dict[str, int]
    hold: tuple[str, ...] = ()  # inputs that keep their value until the next start

    def words(self, side: str) -> int:
        """32-bit words one transaction takes on one side."""
        return sum((w + 31) // 32 for w in getattr(self, side).values())


@dataclass
class Result:
    """What a check found."""

    checked: int
    mismatches: list[str]
    cycles: list[int]
    clocks: int = 0
    seconds: float = 0.0
    outputs: dict[str, list[int]] = field(default_factory=dict)

    @property
    def clocks_per_second(self) -> float:
        """Speed of the simulation proper."""
        return self.clocks / self.seconds if self.seconds else 0.0


def ports_of(verilog: Path, top: str, besides: Collection[str] = CONTROL) -> Ports:
    """Data ports of a module as GHDL prints its header."""
    text = verilog.read_text(encoding="utf-8")
    header = re.search(rf"^module {top.lower()}\n(.*?);\n", text, re.M | re.S)
    if header is None:
        raise ToolError(f"no module {top.lower()} in {verilog.name}")
    found: dict[str, dict[str, int]] = {"input": {}, "output": {}}
    for direction, high, name in _PORT.findall(header.group(1) + ")"):
        if name not in besides:
            found[direction][name] = int(high) + 1 if high else 1
    return Ports(found["input"], found["output"])


def _harness(top: str, ports: Ports) -> str:
    """C++ main of the simulation."""

    def put(name: str, width: int, source: str, offset: int) -> list[str]:
        count = (width + 31) // 32
        if width <= 32:
            mask = f" & 0x{(1 << width) - 1:x}u"
            return [f"m->{name} = {source}[{offset}]{mask};"]
        if width <= 64:
            mask = f" & 0x{(1 << width) - 1:x}ull"
            return [
                f"m->{name} = ({source}[{offset}] | (uint64_t){source}[{offset + 1}] << 32){mask};"
            ]
        last = f" & 0x{(1 << ((width - 1) % 32 + 1)) - 1:x}u"
        return [
            f"m->{name}[{i}] = {source}[{offset + i}]{last if i == count - 1 else ''};"
            for i in range(count)
        ]

    def get(name: str, width: int, offset: int) -> list[str]:
        if width <= 32:
            return [f"out[{offset}] = m->{name};"]
        if width <= 64:
            return [
                f"out[{offset}] = (uint32_t)m->{name};",
                f"out[{offset + 1}] = (uint32_t)(m->{name} >> 32);",
            ]
        return [f"out[{offset + i}] = m->{name}[{i}];" for i in range((width + 31) // 32)]

    show, scramble, sample = [], [], []
    offset = 0
    for name, width in ports.inputs.items():
        show += put(name, width, "in", offset)
        if name not in ports.hold:
            scramble += put(name, width, "noise", offset)
        offset += (width + 31) // 32
    inputs = offset
    offset = 2
    for name, width in ports.outputs.items():
        sample += get(name, width, offset)
        offset += (width + 31) // 32
    outputs = offset
    body = "\n    "
    head = f"""// Generated: drives {top} as its callers do.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include "Vcore.h"
#include "verilated.h"

double sc_time_stamp() {{ return 0; }}

static uint64_t state;
static inline uint32_t draw() {{  // xorshift64*: quick, and the same on every machine
    state ^= state >> 12; state ^= state << 25; state ^= state >> 27;
    return (uint32_t)((state * 2685821657736338717ull) >> 32);
}}

static Vcore *m;
static uint32_t in[{max(inputs, 1)}], noise[{max(inputs, 1)}], out[{outputs}];
static uint64_t edges = 0;

static void show() {{
    {body.join(show)}
}}
static void scramble() {{
    for (unsigned i = 0; i < {inputs}; i++) noise[i] = draw();
    {body.join(scramble)}
}}
static void sample() {{
    {body.join(sample)}
}}
"""
    if "rst" in ports.inputs:
        return head + _clocked(inputs, outputs)
    return (
        head
        + f"""// Inputs settle with the clock low; what an edge samples is read just before it.
static inline bool settle() {{ m->clk = 0; m->eval(); return m->valid; }}
static inline void edge() {{ m->clk = 1; m->eval(); edges++; }}

int main(int argc, char **argv) {{
    Verilated::commandArgs(argc, argv);
    const uint64_t limit = strtoull(argv[1], nullptr, 0);
    state = strtoull(argv[2], nullptr, 0) * 2 + 0x9e3779b97f4a7c15ull;
    const unsigned gap = atoi(argv[3]);
    const bool interactive = argv[4][0] == '1';
    m = new Vcore;
    m->start = 0;
    m->rst = 1;
    for (int i = 0; i < 4; i++) {{ scramble(); settle(); edge(); }}
    m->rst = 0;
    while ({
            "fread(in, 4, " + str(inputs) + ", stdin) == " + str(inputs)
            if inputs
            else "fread(noise, 4, 1, stdin) == 1"
        }) {{
        for (unsigned i = gap ? draw() % (gap + 1) : 0; i; i--) {{
            scramble();
            if (settle()) {{ fprintf(stderr, "valid while idle\\n"); return 3; }}
            edge();
        }}
        m->start = 1;
        show();
        if (settle()) {{ fprintf(stderr, "valid at the start edge\\n"); return 3; }}
        edge();
        m->start = 0;
        uint64_t cycles = 1;
        for (;; cycles++) {{
            scramble();
            if (settle()) break;
            if (cycles >= limit) {{ fprintf(stderr, "no valid within %llu clocks\\n", (unsigned
            long long)limit); fflush(stdout); return 4; }} edge();
        }}
        sample();
        edge();
        out[0] = (uint32_t)cycles;
        out[1] = (uint32_t)edges;
        fwrite(out, 4, {outputs}, stdout);
        if (interactive) fflush(stdout);
    }}
    fflush(stdout);
    m->final();
    delete m;
    return 0;
}}
"""
    )


def _clocked(inputs: int, outputs: int) -> str:
    """Main of an entity without transactions: a row is a clock, outputs are before its edge."""
    return f"""int main(int argc, char **argv) {{
    Verilated::commandArgs(argc, argv);
    m = new Vcore;
    while (fread(in, 4, {inputs}, stdin) == {inputs}) {{
        show();
        m->clk = 0;
        m->eval();
        sample();
        m->clk = 1;
        m->eval();
        out[0] = 1;
        out[1] = (uint32_t)++edges;
        fwrite(out, 4, {outputs}, stdout);
    }}
    fflush(stdout);
    m->final();
    delete m;
    return 0;
}}
"""


def key(top: str, verilog: Path, ports: Ports) -> str:
    """Sixteen digits that change with all that decides what a netlist's simulation does."""
    text = netlist.meaning(verilog.read_text(encoding="utf-8"))
    return tools.digest(text, _harness(top, ports), tools.version("verilator"), *OPTIONS)[:16]


def build(
    top: str,
    generics: Generics | None = None,
    ports: Ports | None = None,
    *,
    verilog: Path | None = None,
    std: str | None = None,
) -> tuple[Path, Ports]:
    """Compile the simulation of a configuration, or find it compiled."""
    source = verilog or netlist.cached(top, generics, std=std)
    ports = ports or ports_of(source, top)
    harness = _harness(top, ports)
    stem = tools.configuration_name(top, generics or {})
    program = tools.BUILD / "verilated" / f"{stem}-{key(top, source, ports)}" / "core"
    if not program.exists():
        # Built elsewhere and moved: Verilator's makefiles work in no path with a blank in it.
        with tempfile.TemporaryDirectory(prefix="verilated-") as name:
            folder = Path(name)
            (folder / "harness.cpp").write_text(harness, encoding="utf-8")
            shutil.copy(source, folder / "core.v")
            tools.run(
                [
                    *tools.tool("verilator"),
                    *(*OPTIONS, "--top-module", top.lower()),
                    *("-o", "core", "core.v", "harness.cpp"),
                ],
                cwd=folder,
                timeout=900,
            )
            with tools.replacing(program) as temporary:
                shutil.copy(folder / "obj" / "core", temporary)
            program.chmod(0o755)
    return program, ports


def _pack(values: Mapping[str, Sequence[int]], widths: Mapping[str, int]) -> np.ndarray:
    """Columns of integers to the harness's 32-bit words, one row a transaction."""
    missing = [name for name in widths if name not in values]
    if missing:
        raise ToolError(f"no values for input {', '.join(missing)}")
    columns = []
    for name, width in widths.items():
        if width <= 32:
            column = np.asarray(values[name], dtype=np.int64) & ((1 << width) - 1)
            columns.append(column.astype(np.uint32))
            continue
        mask = (1 << width) - 1
        wide = [int(v) & mask for v in values[name]]
        for word in range((width + 31) // 32):
            columns.append(np.array([v >> 32 * word & 0xFFFFFFFF for v in wide], dtype=np.uint32))
    return (
        np.ascontiguousarray(np.column_stack(columns)) if columns else np.empty((0, 0), np.uint32)
    )


def _unpack(words: np.ndarray, widths: Mapping[str, int]) -> dict[str, list[int]]:
    """The harness's words to unsigned integers."""
    result: dict[str, list[int]] = {}
    offset = 0
    for name, width in widths.items():
        count = (width + 31) // 32
        if count == 1:
            result[name] = words[:, offset].tolist()
        else:
            parts = words[:, offset : offset + count].tolist()
            result[name] = [sum(w << 32 * i for i, w in enumerate(row)) for row in parts]
        offset += count
    return result


def simulate(
    top: str,
    generics: Generics | None,
    inputs: Mapping[str, Sequence[int]],
    *,
    ports: Ports | None = None,
    verilog: Path | None = None,
    seed: int = 1,
    limit: int = 100_000,
    gap: int = 3,
    std: str | None = None,
    folder: Path | None = None,
) -> Result:
    """Run transactions."""
    program, ports = build(top, generics, ports, verilog=verilog, std=std)
    if not ports.inputs:
        raise ToolError(f"{top} has no data inputs")
    rows = _pack(inputs, ports.inputs)
    command = [str(program), str(limit), str(seed), str(gap), "0"]
    command += [f"+verilator+seed+{seed % 2**31 or 1}", "+verilator+rand+reset+2"]
    began = time.perf_counter()
    done = subprocess.run(
        command, input=rows.tobytes(), capture_output=True, check=False, cwd=folder
    )
    seconds = time.perf_counter() - began
    width = 2 + ports.words("outputs")
    words = np.frombuffer(done.stdout, dtype=np.uint32)
    words = words[: len(words) // width * width].reshape(-1, width)
    if done.returncode or len(words) != len(rows):
        reason = done.stderr.decode(errors="replace").strip() or f"status {done.returncode}"
        raise ToolError(f"{top}: transaction {len(words)} of {len(rows)}: {reason}")
    clocks = int(words[-1, 1]) if len(words) else 0
    outputs = _unpack(words[:, 2:], ports.outputs)
    return Result(len(rows), [], words[:, 0].tolist(), clocks, seconds, outputs)


def check(
    top: str,
    generics: Generics | None,
    inputs: Mapping[str, Sequence[int]],
    expected: Mapping[str, Sequence[int]],
    cycles: Sequence[int | None] | None = None,
    **options: object,
) -> Result:
    """Compare outputs (signed or unsigned) and cycle counts; outputs not expected are free."""
    result = simulate(top, generics, inputs, **options)
    _, ports = build(
        top,
        generics,
        options.get("ports"),
        verilog=options.get("verilog"),
        std=options.get("std"),
    )
    if not expected or result.checked == 0:
        raise ToolError(f"{top}: nothing to check")
    for name, column in expected.items():
        if name not in ports.outputs:
            raise ToolError(f"{top} has no output {name}")
        if len(column) != result.checked:
            raise ToolError(f"{name}: {len(column)} expected values, {result.checked} transactions")
        mask = (1 << ports.outputs[name]) - 1
        for index, (want, got) in enumerate(zip(column, result.outputs[name], strict=True)):
            if int(want) & mask != got:
                result.mismatches.append(
                    f"transaction {index}: {name} is {got:#x}, not {int(want) & mask:#x}"
                )
    for index, want in enumerate(cycles or []):
        if want is not None and want != result.cycles[index]:
            result.mismatches.append(
                f"transaction {index}: {result.cycles[index]} cycles, not {want}"
            )
    return result


class Simulator:
    """A core that answers one transaction at a time, for loops closed in Python."""

    def __init__(self, program: Path, ports: Ports, seed: int = 1, limit: int = 100_000) -> None:
        self.ports = ports
        command = [str(program), str(limit), str(seed), "0", "1"]
        command += [f"+verilator+seed+{seed % 2**31 or 1}", "+verilator+rand+reset+2"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._size = 4 * (2 + ports.words("outputs"))

    def step(self, inputs: Mapping[str, int]) -> tuple[dict[str, int], int]:
        """Outputs (unsigned) and cycles of one transaction."""
        row = _pack({name: [value] for name, value in inputs.items()}, self.ports.inputs)
        stdin: IO[bytes] = self._process.stdin
        stdout: IO[bytes] = self._process.stdout
        stdin.write(row.tobytes())
        stdin.flush()
        data = stdout.read(self._size)
        if len(data) != self._size:
            raise ToolError("the simulated core gave no answer")
        words = np.frombuffer(data, dtype=np.uint32).reshape(1, -1)
        outputs = _unpack(words[:, 2:], self.ports.outputs)
        return {name: column[0] for name, column in outputs.items()}, int(words[0, 0])

    def close(self) -> None:
        """End the simulation."""
        if self._process.stdin:
            self._process.stdin.close()
        self._process.wait(timeout=30)
        if self._process.stdout:
            self._process.stdout.close()


@contextmanager
def simulator(
    top: str, generics: Generics | None = None, *, seed: int = 1, **options: object
) -> Iterator[Simulator]:
    """A running simulation of a configuration, ended with the block."""
    program, ports = build(top, generics, **options)
    running = Simulator(program, ports, seed)
    try:
        yield running
    finally:
        running.close()


def check_file(
    top: str, generics: Generics, vectors: Path, ports_file: Path | None = None, seed: int = 1
) -> Result:
    """Check a core against a file of transactions."""
    try:
        ports = None
        if ports_file:
            read = json.loads(ports_file.read_text(encoding="utf-8"))
            ports = Ports(read["inputs"], read["outputs"], tuple(read.get("hold", ())))
        lines = [
            json.loads(line) for line in vectors.read_text(encoding="utf-8").splitlines() if line
        ]
        if not lines:
            raise ToolError(f"{vectors}: no transactions")
        inputs = {name: [line["inputs"][name] for line in lines] for name in lines[0]["inputs"]}
        expected = {name: [line["outputs"][name] for line in lines] for name in lines[0]["outputs"]}
        cycles = [line.get("cycles") for line in lines]
        return check(top, generics, inputs, expected, cycles, ports=ports, seed=seed)
    except (KeyError, json.JSONDecodeError) as error:
        raise ToolError(f"{vectors}: {error}") from None
