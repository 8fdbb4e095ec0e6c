"""Counting rules of `make synth`, refusals of `make pnr`, the documentation check of `make lint`.

Stimulus: hand-made netlists and reports, and three multipliers through Yosys.
Checks: counts, that each doubtful place-and-route report is refused, the configurations' file.
Does not prove: that a vendor's mapper reaches the same figures.
"""

from __future__ import annotations

import copy
import json

import pytest

from scripts.hdl import conversion as netlist
from scripts.hdl.netlist_check import Ports
from scripts.measure import checks, pnr, synth
from scripts.shared import tools


def cell(kind: str, **connections: list) -> dict:
    directions = {name: "output" if name in ("O", "CO", "Q") else "input" for name in connections}
    return {"type": kind, "connections": connections, "port_directions": directions}


def test_spartan_3_counts():
    cells = {
        "l1": cell("LUT2", I0=[2], I1=[3], O=[4]),
        "l2": cell("LUT4", I0=[2], O=[5]),
        "inv": cell("INV", I=[2], O=[6]),
        "ram": cell("RAM16X1D"),
        "f": cell("FDRE", D=[4], Q=[7]),
        "m": cell("MULT18X18"),
        "b": cell("RAMB16_S36_S36"),
        "w": cell("MUXF5"),
        # Positions: with a LUT of its own, fed by a register, with a taken LUT, with an inverter.
        "c1": cell("MUXCY", S=[4], O=[10]),
        "x1": cell("XORCY", LI=[4], O=[11]),
        "c2": cell("MUXCY", S=[7], O=[12]),
        "c3": cell("MUXCY", S=[4], O=[13]),
        "c4": cell("MUXCY", S=[6], O=[14]),
    }
    got = synth.count(cells, "xc3s")
    assert (got["lut"], got["ff"], got["mult"], got["bram"]) == (2 + 1 + 2 + 2, 1, 1, 1)
    assert got["carry_feeds"] == 2
    assert (got["slices_packed"], got["slices_unpacked"]) == (4, 4)


def test_other_families():
    cells = {
        "a": cell("CCU2C"),
        "l": cell("LUT4"),
        "f": cell("TRELLIS_FF"),
        "m": cell("MULT18X18D"),
    }
    got = synth.count(cells, "ecp5")
    assert (got["lut"], got["ff"], got["dsp"], got["bram"]) == (3, 1, 1, 0)
    # A chain of four of which two sums are used, both fed by LUTs.
    used = cell("CARRY4", S=[2, 3, "0", "0"], O=[20, 21, 22, 23], CO=[24, 25, 26, 27])
    cells = {
        "c": used,
        "l0": cell("LUT2", O=[2]),
        "l1": cell("LUT2", O=[3]),
        "f0": cell("FDRE", D=[20]),
        "f1": cell("FDRE", D=[21]),
    }
    assert synth.count(cells, "xc7")["lut"] == 2


def test_unknown_cell_is_an_error():
    with pytest.raises(tools.ToolError, match="NEW_CELL"):
        synth.count({"a": cell("NEW_CELL")}, "xc7")


@pytest.mark.parametrize(("a", "b"), [(16, 16), (17, 16), (18, 18)])
def test_a_product_takes_one_multiplier(tmp_path, a, b):
    # GHDL widens operands to the width of the result; Yosys has to narrow them again.
    source = tmp_path / "product.vhd"
    source.write_text(
        "library ieee;\nuse ieee.std_logic_1164.all;\nuse ieee.numeric_std.all;\n"
        f"entity product is port (a : in std_logic_vector({a - 1} downto 0);\n"
        f"b : in std_logic_vector({b - 1} downto 0);\n"
        f"y : out std_logic_vector({a + b - 1} downto 0));\n"
        "end entity;\narchitecture rtl of product is begin\n"
        "y <= std_logic_vector(signed(a) * signed(b));\nend architecture;\n"
    )
    verilog, _ = netlist.convert("product", {}, tmp_path / "product.v", files=[source], check=False)
    out = tmp_path / "product.json"
    synth.map_netlist(verilog, "product", f"{synth.FLOWS['xc3s']} -top product", out)
    got = synth.count(json.loads(out.read_text())["modules"]["product"]["cells"], "xc3s")
    assert (got["mult"], got["lut"], got["ff"]) == (1, 0, 0)


def test_every_entity_has_a_configuration():
    missing = [
        line for line in synth.coverage(synth.configurations()) if "no configuration" in line
    ]
    assert not missing


def test_configurations_with_an_unknown_family_are_refused(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text('[[configuration]]\nentity = "x"\nfamilies = ["xc9"]\n')
    with pytest.raises(tools.ToolError, match="xc9"):
        synth.configurations(path)
    path.write_text('[[configuration]]\nentitty = "x"\n')
    with pytest.raises(tools.ToolError):
        synth.configurations(path)


def step(kind: str, delay: float, cell_from: str, cell_to: str, net: str | None = None) -> dict:
    entry = {"type": kind, "delay": delay, "from": {"cell": cell_from}, "to": {"cell": cell_to}}
    return entry | ({"net": net} if net else {})


REPORT = {
    "fmax": {"$glbnet$clk": {"achieved": 100.0, "constraint": float(pnr.TARGET_MHZ)}},
    "critical_paths": [
        {
            "from": "posedge $glbnet$clk",
            "to": "posedge $glbnet$clk",
            "path": [
                step(
                    "clk-to-q", 0.5, "u_core.u_a.n1_q_TRELLIS_FF_Q", "u_core.u_a.n1_q_TRELLIS_FF_Q"
                ),
                step(
                    "routing",
                    5.5,
                    "u_core.u_a.n1_q_TRELLIS_FF_Q",
                    "u_core.n2_o_LUT4_Z",
                    "u_core.n1",
                ),
                step("logic", 3.5, "u_core.n2_o_LUT4_Z", "u_core.n2_o_LUT4_Z"),
                step("setup", 0.5, "u_core.n2_o_LUT4_Z", "captured_TRELLIS_FF_Q"),
            ],
        }
    ],
}
CONFIG = f".device {pnr.DEVICE}\n\n.comment Part: {pnr.PART}\n"
VERILOG = """module leaf
  /* leaf.vhd:12:3 */
  always @(posedge clk)
    n1_q <= n0_o;
  assign count = n1_q; // (signal)
endmodule
module top
  /* top.vhd:7:5 */
  assign n2_o = a & b;
  leaf u_a (
    .clk(clk));
endmodule
"""


def test_evaluation_names_the_path():
    got = pnr.evaluate(REPORT, CONFIG, 3, pnr.Origins(VERILOG, "top"))
    assert (got["seed"], got["fmax_mhz"], got["levels"]) == (3, 100.0, 1)
    assert (got["logic_ns"], got["routing_ns"]) == (4.5, 5.5)
    assert got["from"] == "u_core.u_a.n1_q_TRELLIS_FF_Q"
    assert got["from_vhdl"] == "leaf.vhd:12"
    assert got["to_vhdl"] == "", "the last register is the wrapper's"
    assert got["words"] == ("from leaf.count (leaf.vhd:12) through 1 LUT to the wrapper's register")
    assert pnr.Origins(VERILOG, "top").of("u_core.n2_o_LUT4_Z_1") == "top.vhd:7"
    memory = pnr.Origins(VERILOG, "top").words("u_core.u_a.n1_q.0.0")
    assert memory == "a block RAM of leaf.count (leaf.vhd:12)"


def test_what_a_path_goes_through_is_counted():
    cells = ("n1_CCU2C_S0$CCU2_COMB0", "n1_MULT18X18D_P0", "n1_MULT18X18D_P0_LUT4_Z", "n2_PFUMX_Z")
    path = [step("logic", 0.1, "a", f"u_core.{name}") for name in cells]
    path.append(step("routing", 0.1, "a", "u_core.n1_q_LUT4_Z"))
    assert pnr._between(path) == "1 multiplier and 1 carry step and 2 LUTs"
    assert pnr._between(path[-1:]) == "wires alone"


def changed(**changes) -> dict:
    report = copy.deepcopy(REPORT)
    report["fmax"]["$glbnet$clk"].update(changes)
    return report


def renamed() -> dict:
    return json.loads(json.dumps(REPORT).replace("u_core.", "shift_"))


@pytest.mark.parametrize(
    ("report", "config", "message"),
    [
        (changed(achieved=pnr.TARGET_MHZ + 1.0), CONFIG, "was met"),
        (changed(constraint=12.0), CONFIG, "constrained to"),
        (changed(achieved=120.0), CONFIG, "sums to"),
        (REPORT | {"fmax": {}}, CONFIG, "0 clocks"),
        (REPORT | {"critical_paths": []}, CONFIG, "no critical path"),
        (renamed(), CONFIG, "in the wrapper"),
        (REPORT, CONFIG.replace("25F\n", "45F\n"), "placed on LFE5U-45F"),
        (REPORT, CONFIG.replace("-6", "-8"), "placed on LFE5U-25F-8"),
        (REPORT, "", "no device"),
    ],
)
def test_doubtful_reports_are_refused(report, config, message):
    with pytest.raises(tools.ToolError, match=message):
        pnr.evaluate(report, config, 1)


def test_wrapper_connects_every_bit_once():
    text = pnr.wrapper("Core", Ports({"a": 16, "b": 1}, {"y": 3, "z": 8}), has_protocol=True)
    assert ".a(shift_in[15:0])" in text
    assert ".b(shift_in[16:16])" in text
    assert ".z(result[10:3])" in text
    assert "reg [16:0] shift_in;" in text
    assert "reg [10:0] captured, shift_out;" in text


def test_ports_without_a_comment_are_found():
    text = """entity e is
  generic (
    N : positive := 2; -- number of explorers
    FOLDED : boolean := false
  );
  port (
    clk : in std_logic; -- rising edge
    a, b : in std_logic_vector(N - 1 downto 0); --
    -- y is the result
    y : out std_logic_vector(7 downto 0) -- S0.7
  );
end entity e;
architecture rtl of e is
  signal s : std_logic;
begin
end architecture rtl;
"""
    got = checks.undocumented(text, "e.vhd")
    assert [line.split(": ", 1)[1] for line in got] == [
        "e: FOLDED has no comment on its line",
        "e: a, b has no comment on its line",
    ]
    assert got[0].startswith("e.vhd:4:")
    assert checks.undocumented("entity f is port (x : in bit); end entity;", "f") != []


def test_names_that_are_keywords_of_systemverilog_are_found() -> None:
    text = """
architecture rtl of e is
  signal inside, kept : std_logic; -- output of the first stage
  signal count : unsigned(7 downto 0);
begin
  assert kept'event report "no priority";
  entry.Output <= inside;
end architecture rtl;
"""
    assert checks.keyword_names(text, "e.vhd") == [
        "e.vhd:3: the name inside is a keyword of SystemVerilog",
        "e.vhd:7: the name Output is a keyword of SystemVerilog",
        "e.vhd:7: the name inside is a keyword of SystemVerilog",
    ]


def test_lines_that_name_a_converter_are_found() -> None:
    text = "drive = load('anpc5l_6kv')\nif topology == 'npc3l':\n    five_level = two_levels\n"
    assert checks.converters_named(text, "a.py") == [
        "a.py:2: names the converter npc3l; its file says what it has",
        "a.py:3: names the converter five_level; its file says what it has",
    ]
