"""Single upsets of flip-flops: what each does to the gates, on the netlist that is mapped for ECP5.

A mapped netlist becomes a function of its inputs and of the contents of its flip-flops, so that a
run can begin at any clock of another one. A drive runs, and trips in the end because its current is
too high. Each flip-flop is turned over at random clocks while it runs. What comes of it is one of
``OUTCOMES``. Memories are mapped to flip-flops too, and so are their bits turned over.

Flip-flops of other clocks than the core's stand still and are left out; an asynchronous reset is
taken for a synchronous one.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.converter import Converter
from directmpc.host.gate_guard import LEGS
from scripts.hdl import conversion, netlist_check
from scripts.hdl.sources import RTL
from scripts.shared import progress, tables, tools
from scripts.shared.tools import ROOT, Generics, ToolError
from scripts.studies import mapped

RESULTS = ROOT / "reports" / "upsets.json"
PAGE = ROOT / "reports" / "upsets.md"
MARKS = ("<!-- upsets: begin (written by make upsets) -->", "<!-- upsets: end -->")
HARNESS = ROOT / "scripts" / "hdl" / "upsets.cpp"
TIMES = 24
#: Flip-flops of a block.
BLOCK = 32
#: Outcome of the harness -> how it counts. The worst counts.
OUTCOMES = {
    "nothing": "nothing",
    "fault": "fault",
    "wrong": "wrong but inside limits",
    "close": "unsafe",
    "late": "unsafe",
    "shorted": "unsafe",
}
#: What is unsafe, told apart.
UNSAFE = {
    "shorted": "a shorted pattern for more than one clock",
    "late": "gates on after the trip",
    "close": "a gate on within the dead time of another one",
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


@dataclass(frozen=True)
class Case:
    """A netlist and how it is run."""

    #: What is mapped.
    entity: str
    generics: Generics
    leg: Converter  #: Of its inverter.
    outputs: tuple[str, str]  #: Ports of gates and faults.
    run: Callable[[Converter], Run]  #: Makes the run.
    #: Part -> what the names of its flip-flops hold; the first that fits counts.
    parts: dict[str, str]


@dataclass(frozen=True)
class Outcome:
    """What came of a flip: flip-flop, clock, key of ``OUTCOMES``, longest shorted pattern."""

    flip_flop: int
    clock: int
    kind: str
    shorted: int
    lasting: bool


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


_GUARD_PARTS = {
    "second supervisor": "second|disagree",
    "trip comparator": "i_comparator",
    "bands": "i_bands",
    "supervisor": r"i_supervisor|dead_time|rest_time|faults|running|live",
    "legs": ".",
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
}  # fmt: skip


#: Takes flips of each flip-flop, seed, first and last flip-flop.
Flips = Callable[[int, int, int, int], list[Outcome]]


@dataclass(frozen=True)
class Netlist:
    """A netlist as a function."""

    text: str  #: Verilog; the module upset_top has ports i, s, o and n.
    inputs: tuple[str, ...]  #: Ports in the order of the words of i.
    names: tuple[str, ...]  #: What each flip-flop drives.
    first: tuple[int, ...]  #: Contents of the flip-flops before the first clock.
    words: tuple[int, int, int]  #: Of i, s and o.


def netlist_of(case: Case, rtl: Path = RTL) -> Netlist:
    """Map a case's entity and take its flip-flops out."""
    verilog = conversion.cached(case.entity, case.generics, rtl=rtl)
    path = mapped.mapped(case.entity, "ecp5", "-nobram -nolutram", verilog)
    cells = path.read_text(encoding="utf-8")
    names: list[str] = []
    first: list[int] = []

    def _apart(match: re.Match[str]) -> str:
        kind = {name: value.strip('"') for name, value in _PAIR.findall(match[1])}
        ends = dict(_PAIR.findall(match[3]))
        if kind.get("CLKMUX", "CLK") != "CLK" or ends["CLK"].strip() != clock:
            return match[0]
        k, start = len(names), int(kind.get("REGSET") == "SET")
        names.append(ends["Q"].replace("\\", "").replace(" ", ""))
        first.append(start)
        taken = {"1": "1'b1", "0": "1'b0", "INV": f"~{ends.get('CE')}"}.get(
            kind.get("CEMUX", "1"), ends.get("CE", "1'b1")
        )
        reset = ends.get("LSR", "1'b0")
        reset = f"~{reset}" if kind.get("LSRMUX") == "INV" else reset
        now, after = f"upset_s[{k}]", f"upset_n[{k}]"
        return (
            f"  assign {ends['Q']} = {now};\n"
            f"  assign {after} = {reset} ? 1'b{start} : {taken} ? {ends['DI']} : {now};\n"
        )

    clock = "clk" if "input clk;" in cells else "clock"
    body = _CELL.sub(_apart, cells)
    bits = len(names)
    if not bits:
        raise ToolError(f"{case.entity}: no flip-flops were found")
    head = re.search(rf"^module {case.entity}\((.*?)\);\n", body, re.M | re.S)
    ports = f"  input [{bits - 1}:0] upset_s;\n  output [{bits - 1}:0] upset_n;\n"
    # no pattern in a replacement: names may hold backslashes
    body = body.replace(head[0], f"module {case.entity}({head[1]}, upset_s, upset_n);\n{ports}", 1)
    plain = mapped.simulated(case.entity, "ecp5", body)
    found = netlist_check.ports_of(verilog, case.entity, ())
    ins = {name: width for name, width in found.inputs.items() if name != clock}
    wires, shown = [f".{clock}(1'b0)", ".upset_s(s)", ".upset_n(n)"], []
    for k, (name, width) in enumerate(ins.items()):
        wires.append(f".{name}(i[{32 * k} +: {width}])")
    declared = []
    for name, width in found.outputs.items():
        declared.append(f"  wire [{width - 1}:0] {name};")
        wires.append(f".{name}({name})")
        if name not in case.outputs:
            shown.append((name, width))
    size = {name: found.outputs[name] for name in case.outputs}
    gates, faults = case.outputs
    padded = [f"{{{24 - size[gates]}'b0, {gates}}}" if size[gates] < 24 else gates,
              f"{{{16 - size[faults]}'b0, {faults}}}"]  # fmt: skip
    shown_last = [*padded, *(name for name, _ in shown)][::-1]
    outputs = 40 + sum(width for _, width in shown)
    words = (max(len(ins), 3), (bits + 31) // 32, max((outputs + 31) // 32, 3))
    top = [
        f"module upset_top(input [{32 * words[0] - 1}:0] i, input [{32 * words[1] - 1}:0] s,",
        f"  output [{32 * words[2] - 1}:0] o, output [{32 * words[1] - 1}:0] n);",
        *declared,
        f"  assign o = {{{', '.join(shown_last)}}};",
        f"  {case.entity} core({', '.join(wires)});",
        "endmodule",
    ]
    text = plain + "\n".join(top) + "\n"
    return Netlist(text, tuple(ins), tuple(names), tuple(first), words)


def _packed(bits: Sequence[int], words: int) -> bytes:
    whole = sum(bit << k for k, bit in enumerate(bits))
    return whole.to_bytes(4 * words, "little")


@contextmanager
def built(case: Case, rtl: Path = RTL) -> Iterator[tuple[Netlist, Flips]]:
    """Compile a case; yields its netlist, and what flips."""
    netlist = netlist_of(case, rtl)
    run = case.run(case.leg)
    clocks = len(next(iter(run.inputs.values())))
    table = np.zeros((clocks, netlist.words[0]), dtype=np.uint32)
    for k, name in enumerate(netlist.inputs):
        if name in run.inputs:
            table[:, k] = np.asarray(run.inputs[name]).astype(np.int64) & 0xFFFFFFFF
    with tempfile.TemporaryDirectory(prefix="upsets-") as folder_name:
        folder = Path(folder_name)
        (folder / "core.v").write_text(netlist.text, encoding="utf-8")
        (folder / "inputs").write_bytes(table.tobytes())
        (folder / "first").write_bytes(_packed(netlist.first, netlist.words[1]))
        # by its name: another order of the cells turns over nothing else
        seeds = [int(tools.digest(name)[:16], 16) for name in netlist.names]
        (folder / "seeds").write_bytes(np.array(seeds, dtype=np.uint64).tobytes())
        sizes = dict(zip(("INPUTS", "STATE", "OUTPUTS"), netlist.words, strict=True))
        sizes["GATES"] = gates = len(case.leg.switches)
        patterns = ({n + 1 for n in range(gates) if bits >> n & 1} for bits in range(2**gates))
        (folder / "forbidden").write_bytes(bytes(map(case.leg.is_forbidden, patterns)))
        flags = " ".join(f"-D{name}={value}" for name, value in sizes.items())
        tools.run(
            [
                *tools.tool("verilator"), *netlist_check.OPTIONS, "--top-module", "upset_top",
                "-CFLAGS", flags, "core.v", str(HARNESS),
            ],
            cwd=folder, timeout=1800,
        )  # fmt: skip

        def _flips(times: int, seed: int, first: int, last: int) -> list[Outcome]:
            said = tools.run(
                [
                    str(folder / "obj" / "Vcore"), "inputs", "first", "forbidden", "seeds",
                    *map(str, (clocks, run.first, run.last, run.deadline, run.dead)),
                    *map(str, (times, seed, first, last)),
                ],
                cwd=folder, timeout=7200,
            ).stdout.splitlines()  # fmt: skip
            if said[0] != "golden 0":
                raise ToolError(f"{case.entity}: the run without an upset has problems: {said[0]}")
            rows = [line.split() for line in said[1:]]
            return [Outcome(int(k), int(t), o, int(n), e == "1") for k, t, o, n, e in rows]

        yield netlist, _flips


def part_of(case: Case, name: str) -> str:
    """Part of a netlist that a flip-flop belongs to."""
    return next(part for part, pattern in case.parts.items() if re.search(pattern, name))


def read(path: Path = RESULTS) -> dict[str, Any]:
    """The file of the results."""
    return json.loads(path.read_text(encoding="utf-8"))


def _kept(path: Path, seed: int, times: int) -> dict[str, Any]:
    """What the file has; nothing where there is none."""
    document = {"seed": seed, "times": times, "cases": {}}
    if path.exists():
        document = read(path)
        if (document["seed"], document["times"]) != (seed, times):
            raise ToolError(
                f"{path.name}: is of seed {document['seed']} and {document['times']} flips of each "
                "flip-flop; with --anew a run begins at the first one"
            )
    return document


def _write(path: Path, document: dict[str, Any]) -> None:
    document["commit"], _ = tools.git_state()
    tools.write_json(path, document)


def run(
    path: Path, *, cases: Sequence[str], times: int = TIMES, seed: int = 1, jobs: int = 2,
    anew: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Turn over the flip-flops that are missing; a netlist that has changed begins again."""
    document = {"seed": seed, "times": times, "cases": {}} if anew else _kept(path, seed, times)
    for name in cases:
        case = CASES[name]
        with progress.busy(f"{name}: mapping and compiling"), built(case) as (netlist, flips):
            _one(case, name, netlist, flips, document, path, jobs)
    return document


def _one(
    case: Case, name: str, netlist: Netlist, flips: Flips, document: dict[str, Any], path: Path,
    jobs: int,
) -> None:  # fmt: skip
    """The blocks of a case that are missing."""
    digest = tools.digest(netlist.text)[:16]
    kept = document["cases"].get(name)
    if kept is None or kept["netlist"] != digest:
        sizes = Counter(part_of(case, one) for one in netlist.names)
        kept = {
            "netlist": digest,
            "done": 0,
            "flip_flops": {part: sizes[part] for part in case.parts if sizes[part]},
            "counts": {part: {} for part in case.parts if sizes[part]},
            "unsafe": [],
        }
        document["cases"][name] = kept
    starts = range(kept["done"], len(netlist.names), BLOCK)
    ends = [min(start + BLOCK, len(netlist.names)) - 1 for start in starts]
    times, seed = document["times"], document["seed"]
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
            lines.append(("", part, f"{kept['flip_flops'][part]:,}", *cells))
        size = sum(kept["flip_flops"].values())
        rows.append((name, "all", f"{size:,}", *(f"{whole[column]:,}" for column in columns)))
        rows += lines
    head = ("netlist", "part", "flip-flops", *columns)
    said = "; ".join(f"{what}: {whys[kind]:,}" for kind, what in UNSAFE.items())
    return "\n".join(
        [
            f"Commit `{document['commit'][:12]}`, {document['times']} flips of each flip-flop.",
            "",
            tables.markdown(head, rows, "ll" + "r" * (len(head) - 2)),
            "",
            f"What is unsafe: {said}.",
        ]
    )


def publish(path: Path = RESULTS, page: Path = PAGE) -> None:
    """Write the table of the page from the file of the results."""
    tables.rewrite(page, {MARKS: markdown(read(path))})
