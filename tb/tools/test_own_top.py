"""A user's own top around a core: what GHDL makes of it, and what `convert` does.

Sweep: the plain `ghdl --synth` and the command `convert`, of the same files.
Stimulus: recorded and random rows of both drives through both netlists in Verilator.
Checks: every decision against the bit-true model. The plain netlist of GHDL 2.0 is wrong, that
of GHDL 5 and newer rightly; the converted one decides rightly with each. Wrong arguments and files
are refused in one line, and no file is written. A netlist that differs from its VHDL is refused.
Does not prove: anything about other tools that read the VHDL.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from directmpc.mpdcc.coefficients import registers
from scripts import __main__ as program
from scripts.hdl import agreement, conversion, netlist_check, sources, states
from scripts.hdl import mpdcc_rows as core
from scripts.hdl.mpdcc_cosimulation import pack_parameters, pack_row
from scripts.shared import tools

OWN = Path(__file__).with_name("own_top.vhd")
LOSSY = conversion.loses(tools.version("ghdl"))
ROWS = 300


@pytest.fixture(scope="module")
def rows() -> core.Rows:
    """Rows near the bounds of both shipped drives."""
    draw = np.random.default_rng(4)
    drives = [states.shipped(name) for name in states.SHIPPED]
    return core.join(
        [
            core.of_trace(
                states.near(drive, ROWS // len(drives), draw), registers(drive, "fast").array()
            )
            for drive in drives
        ]
    )


def wrong(verilog: Path, rows: core.Rows) -> int:
    """Rows that a netlist of the own top decides otherwise than the model."""
    every = netlist_check.ports_of(verilog, "own_top")
    ports = netlist_check.Ports(every.inputs, every.outputs, ("parameters",))
    low = [pack_row(m, s) for m, s in zip(rows.measurements, rows.s_prev, strict=True)]
    inputs = {
        "measurements": [word & (1 << 208) - 1 for word in low],
        "positions": [word >> 208 for word in low],
        "parameters": [pack_parameters(one) for one in rows.registers],
    }
    found = netlist_check.simulate("own_top", {}, inputs, ports=ports, verilog=verilog)
    expected = rows.model("fast")[:, :3] @ (1, 8, 64)
    return int((np.array(found.outputs["decision"]) != expected).sum())


def test_plain_synthesis_is_wrong_where_ghdl_loses_and_right_where_it_does_not(
    rows: core.Rows, tmp_path: Path
) -> None:
    files = sources.with_own("own_top", [OWN])
    plain = tmp_path / "plain.v"
    plain.write_text(conversion._synthesise("own_top", {}, files, "verilog", "08"))
    share = wrong(plain, rows) / len(rows)
    if LOSSY:
        assert share > 0.2, "GHDL 2.0 has to show what `convert` is for"
    else:
        assert share == 0


def test_the_command_writes_a_netlist_that_decides_as_the_model(
    rows: core.Rows, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    out = tmp_path / "own_top.v"
    assert program.main(["convert", "--top", "own_top", str(OWN), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert re.search(r"does as the VHDL in \d+ clocks", said), said
    assert wrong(out, rows) == 0


TYPED = """library ieee;
  use ieee.std_logic_1164.all;
entity leaf is
  generic (MASK : std_logic_vector(3 downto 0) := "0101"; FAST : boolean := false);
  port (clk : in std_logic; y : out std_logic);
end entity leaf;
architecture rtl of leaf is
begin
  y <= MASK(0) and clk when FAST else '0';
end architecture rtl;
"""
LEAF = """library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;
entity leaf is
  generic (WIDTH : positive := 8);
  port (clk : in std_logic; a : in signed(WIDTH - 1 downto 0); y : out signed(WIDTH - 1 downto 0));
end entity leaf;
architecture rtl of leaf is
  signal inside, priority : signed(WIDTH - 1 downto 0); -- keywords of SystemVerilog
begin
  inside <= a when rising_edge(clk);
  priority <= {value} when rising_edge(clk);
  y <= priority;
end architecture rtl;
"""
TOP = """library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;
entity top is
  generic (WIDTH : positive := 8);
  port (clk : in std_logic; a : in signed(WIDTH - 1 downto 0);
    synced : out std_logic_vector(0 downto 0); y : out signed(WIDTH - 1 downto 0));
end entity top;
architecture rtl of top is
begin
  i_leaf : entity work.leaf
    generic map (WIDTH => WIDTH)
    port map (clk => clk, a => a, y => y);
  i_sync : entity work.sync_bits
    generic map (WIDTH => 1)
    port map (clk => clk, asynchronous => std_logic_vector(a(0 downto 0)), synchronous => synced);
end architecture rtl;
"""


def own(folder: Path, value: str = "inside + 1") -> list[Path]:
    """Two files, the top's first."""
    paths = [folder / "a_top.vhd", folder / "leaf.vhd"]
    for path, text in zip(paths, (TOP, LEAF.replace("{value}", value)), strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


def test_own_files_come_in_any_order_and_use_the_library_work(tmp_path: Path) -> None:
    paths = own(tmp_path)
    out = tmp_path / "top.v"
    for files in (paths, paths[::-1]):
        names = [str(path) for path in files]
        given = ["convert", "--top", "top", *names, "-g", "WIDTH=12", "--out", str(out)]
        assert program.main(given) == 0
        assert "input  [11:0] a" in out.read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--top", "top", "{0}", "{1}", "gone.vhd"], "convert: gone.vhd: no such file"),
        (["--top", "pot", "{0}", "{1}"], "no entity 'pot' in .*; there is: leaf, top"),
        (["--top", "top", "{0}", "{1}", "-g", "N=3"], "top has no generic N; there is: WIDTH"),
        (["--top", "top", "{0}", "{1}", "-g", "WIDTH=x"], "'x' is no integer or boolean"),
        (["--top", "top", "{0}", "{1}", "-g", "width=true"], "WIDTH is of .*: give an integer"),
        (["--top", "leaf", "{4}", "-g", "MASK=1111"], "MASK is of the type std_logic_vector; only"),
        (["--top", "leaf", "{4}", "-g", "FAST=1"], "FAST is of .*: give true or false"),
        (["--top", "mpdcc_core", "-g", "EXPLORERS=9"], "(?i)convert: [^/]*explorers"),
        (["--top", "top", "{5}"], "is a folder; name the VHDL files in it"),
        (["--top", "top", "{0}", "{1}", "{2}"], r"broken\.vhd:3:\d+:"),
        (["--top", "top", "{0}", "{1}", "{3}"], "leaf is declared in .*again.vhd"),
        (["--top", "top", "{0}"], r"a_top\.vhd:\d+:\d+:.*leaf"),
        (["{0}"], "the following arguments are required: --top"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture, arguments: list[str], message: str
) -> None:
    paths = own(tmp_path)
    broken, again = tmp_path / "broken.vhd", tmp_path / "again.vhd"
    broken.write_text("entity broken is\nend entity;\narchitecture of broken is begin end;\n")
    again.write_text(paths[1].read_text())
    typed = tmp_path / "typed.vhd"
    typed.write_text(TYPED)
    out = tmp_path / "out.v"
    given = [text.format(*paths, broken, again, typed, tmp_path) for text in arguments]
    try:
        code = program.main(["convert", *given, "--out", str(out)])
    except SystemExit as ended:
        code = ended.code
    said = capsys.readouterr().err.strip()
    assert code == 2
    assert re.search(message, said), said
    assert "Traceback" not in said
    assert not out.exists()


def test_no_source_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    paths = [str(path) for path in own(tmp_path)]
    before = Path(paths[0]).read_text()
    link = tmp_path / "link.v"
    link.symlink_to(paths[0])
    for out in (paths[0], str(link), str(sources.entities()["mac_block"])):
        assert program.main(["convert", "--top", "top", *paths, "--out", out]) == 2
        assert "is one of the VHDL files; --out needs another name" in capsys.readouterr().err
    assert Path(paths[0]).read_text() == before


@pytest.mark.skipif(not LOSSY, reason="this GHDL converts it rightly")
def test_what_two_conversions_agree_on_is_still_compared_with_the_vhdl(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    # GHDL 2.0 writes `a - 2` for `2 - a`, in every conversion and in both forms
    paths = own(tmp_path, "2 - inside")
    out = tmp_path / "top.v"
    out.write_text("before")
    given = ["convert", "--top", "top", *map(str, paths), "--out", str(out)]
    assert program.main(given) == 1
    assert re.search("top: .*output y differs from the VHDL in clock", capsys.readouterr().err)
    assert out.read_text() == "before"


def test_every_output_of_a_netlist_is_compared(tmp_path: Path) -> None:
    paths = own(tmp_path)
    files = sources.with_own("top", paths)
    out, _ = conversion.convert("top", {}, tmp_path / "top.v", files=files, std="08")
    found = agreement.compare("top", {}, files, "08", out, clocks=300)
    assert found.clocks == 300
    assert found.known > 0.95
    text = out.read_text()
    for old, new in ((r"assign y = (?=\S*i_leaf)", "assign y = ~"), (r"\+ 8'b", "- 8'b")):
        changed, count = re.subn(old, new, text)
        assert count == 1
        out.write_text(changed)
        with pytest.raises(conversion.NetlistError, match="output y differs"):
            agreement.compare("top", {}, files, "08", out, clocks=300)


def test_a_port_that_cannot_be_driven_is_named(tmp_path: Path) -> None:
    path = tmp_path / "counted.vhd"
    path.write_text(
        "entity counted is port (a : in natural range 0 to 7; y : out natural range 0 to 7); "
        "end entity;\narchitecture rtl of counted is\nbegin\n  y <= a;\nend architecture;\n"
    )
    out, _, said = agreement.checked("counted", {}, tmp_path / "c.v", files=[path], std="08")
    assert out.exists()
    assert said == "not simulated beside the VHDL: its port a is of the type natural"
