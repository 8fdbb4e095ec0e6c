"""Compile order of the VHDL files.

Sweep: small trees with packages, bodies, direct and component instantiation, names in comments.
Checks: order, completeness, what is left out, and the messages for what cannot be done.
Does not prove: that every analyser accepts the result; `make lint` analyses the real tree with
GHDL.
"""

from __future__ import annotations

import shutil
import subprocess

import pytest

from scripts import __main__ as program
from scripts.hdl import sources

PACKAGE = """library ieee;
use ieee.std_logic_1164.all;
package consts is
  constant WIDTH : natural := 4;
end package consts;
package body consts is
end package body consts;
"""


def entity(name: str, body: str = "", uses: str = "") -> str:
    return (
        f"{uses}\nentity {name} is\nend entity {name};\n"
        f"architecture rtl of {name} is\nbegin\n{body}\nend architecture rtl;\n"
    )


@pytest.fixture
def tree(tmp_path):
    # Names chosen so that the order of the alphabet is wrong.
    (tmp_path / "z_consts.vhd").write_text(PACKAGE)
    (tmp_path / "y_leaf.vhd").write_text(
        entity("leaf", uses="library work;\n  use work.consts.all;")
    )
    (tmp_path / "b_mid.vhd").write_text(
        entity("mid", "  u : component Leaf\n    port map (a => b);")
    )
    (tmp_path / "a_top.vhd").write_text(
        entity("top", '  u : entity WORK.mid;\n  assert false report "entity work.other";')
    )
    (tmp_path / "other.vhd").write_text(entity("other", "  -- u : entity work.top"))
    return tmp_path


def names(paths) -> list[str]:
    return [path.name for path in paths]


def test_each_file_after_what_it_needs(tree):
    order = sources.compile_order("top", sources.rtl_files(tree))
    assert names(order) == ["z_consts.vhd", "y_leaf.vhd", "b_mid.vhd", "a_top.vhd"]


def test_top_is_case_insensitive_and_nothing_else_is_listed(tree):
    assert names(sources.compile_order("LEAF", sources.rtl_files(tree))) == [
        "z_consts.vhd",
        "y_leaf.vhd",
    ]


def test_all_files(tree):
    order = names(sources.order_all(sources.rtl_files(tree)))
    assert sorted(order) == sorted(p.name for p in tree.iterdir())
    assert order.index("z_consts.vhd") < order.index("y_leaf.vhd") < order.index("b_mid.vhd")


def test_several_tops_list_each_file_once(tree, capsys):
    for tops in (["mid", "top", "other"], ["mid top other"]):
        assert program.main(["sources", "--rtl", str(tree), *tops]) == 0
        listed = [line.rsplit("/", 1)[-1] for line in capsys.readouterr().out.splitlines()]
        assert listed == ["z_consts.vhd", "y_leaf.vhd", "b_mid.vhd", "a_top.vhd", "other.vhd"]
    assert program.main(["sources", "--rtl", str(tree), "mid nothing"]) == 2
    assert "no unit 'nothing'" in capsys.readouterr().err


def test_unknown_top_names_the_entities(tree):
    with pytest.raises(sources.SourcesError, match="leaf, mid, other, top"):
        sources.compile_order("nothing", sources.rtl_files(tree))
    with pytest.raises(sources.SourcesError, match="TOP is not set; it may be one of: leaf"):
        sources.compile_order("", sources.rtl_files(tree))


def test_circle_is_an_error(tmp_path):
    (tmp_path / "a.vhd").write_text(entity("a", "  u : entity work.b;"))
    (tmp_path / "b.vhd").write_text(entity("b", "  u : entity work.a;"))
    with pytest.raises(sources.SourcesError, match="circular"):
        sources.compile_order("a", sources.rtl_files(tmp_path))


def test_two_declarations_are_an_error(tmp_path):
    (tmp_path / "a.vhd").write_text(entity("a"))
    (tmp_path / "b.vhd").write_text(entity("a"))
    with pytest.raises(sources.SourcesError, match="declared in"):
        sources.compile_order("a", sources.rtl_files(tmp_path))


def test_architecture_in_its_own_file_is_included(tmp_path):
    (tmp_path / "a_arch.vhd").write_text("architecture rtl of a is\nbegin\nend architecture rtl;\n")
    (tmp_path / "b_entity.vhd").write_text("entity a is\nend entity a;\n")
    order = sources.compile_order("a", sources.rtl_files(tmp_path))
    assert names(order) == ["b_entity.vhd", "a_arch.vhd"]


@pytest.mark.skipif(shutil.which("ghdl") is None, reason="GHDL is not installed")
def test_ghdl_accepts_the_order_of_every_entity(tmp_path):
    found = sources.entities()
    assert found, "no entities in rtl/"
    for index, name in enumerate(sorted(found)):
        workdir = tmp_path / str(index)
        workdir.mkdir()
        order = sources.compile_order(name, sources.rtl_files())
        std = sources.standard(order)
        command = ["ghdl", "-a", f"--std={std}", f"--workdir={workdir}", *map(str, order)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
