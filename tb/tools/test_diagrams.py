"""Block diagrams: what is drawn is what the VHDL says.

Stimulus: every entity of the design; a made-up one; faults in the reader and in the VHDL.
Checks: instances and processes against those that GHDL elaborates; connections of the made-up
entity against what its text says; every block and every connection is in the picture once; nothing
overlaps; the same bytes twice.
Does not prove: what the pictures look like.
"""

from __future__ import annotations

import re
import sys
import types
from pathlib import Path
from xml.etree import ElementTree

import pytest

from scripts.generate.fusesoc_cores import PUBLIC
from scripts.hdl import sources, structure
from scripts.hdl.structure import INPUTS, OUTPUTS
from scripts.measure import budgets
from scripts.publish import diagrams, entity_pages, site
from scripts.shared import tools

SVG = "{http://www.w3.org/2000/svg}"
INTERFACES = {"adder": {"clk": "in", "rst": "in", "a": "in", "b": "in", "sum": "out"}}
VHDL = """\
entity unit is
  port (
    clk, rst, tick : in std_logic; -- clock
    x    : in std_logic_vector(3 downto 0);
    sel  : in std_logic;
    y, z : out std_logic_vector(3 downto 0)
  );
end entity unit;

architecture rtl of unit is
  -- signal ghost : std_logic;
  type pair_t is record
    x : std_logic; -- a field with the name of a port
    q : std_logic;
  end record pair_t;
  function f (signal a : std_logic; x : natural) return natural is
    variable v : natural;
  begin
    if x = 1 then
      return 1;
    end if;
    return 0;
  end function f;
  signal word, total : std_logic_vector(3 downto 0);
  signal pair : pair_t;
  attribute keep of word : signal is "begin x;";
begin
  word <= ';' when sel = '1' else x;

  g_add : for i in 0 to 1 generate
    signal local : std_logic;
  begin
    i_adder : entity work.adder
      generic map (WIDTH => 4)
      port map (clk => clk, rst => rst, a => word(i), -- not sel
        b => pair.x, sum(0) => total(i));
    local <= total(i);
  end generate g_add;

  assert sel = '0' report "x <= y;" severity note;

  p_pair : process (tick) is
    variable x_seen : boolean;
  begin
    if rising_edge(tick) then
      if (total <= "0011" and pair.q = '0') then
        pair.q <= sel;
      end if;
    end if;
  end process p_pair;

  y <= total;
  z <= (x => pair.q, others => x'length);
end architecture rtl;
"""

CONNECTIONS = {
    (INPUTS, "i_adder"): {"word"},
    ("p_pair", "i_adder"): {"pair"},
    ("i_adder", "p_pair"): {"total"},
    (INPUTS, "p_pair"): {"sel"},
    ("i_adder", OUTPUTS): {"y"},
    ("p_pair", OUTPUTS): {"z"},
}


def read(text: str = VHDL) -> structure.Structure:
    return structure.structure(text, "unit", INTERFACES)


# --- the reader -----------------------------------------------------------------------------------


def test_a_made_up_entity_is_read() -> None:
    found = read()
    assert [(b.label, b.entity, b.condition) for b in found.blocks] == [
        ("i_adder", "adder", "for i in 0 to 1"), ("p_pair", "", ""),
    ]  # fmt: skip
    assert found.inputs == ("clk", "rst", "tick", "x", "sel")
    assert found.clocks == {"clk", "tick"}
    assert found.connections() == CONNECTIONS


FAULTS = {
    "comments": ('re.sub(r"--[^\\n]*", "", text))', "text)"),
    "literals": ("_LITERAL.sub('\"0\"', ", "str("),
    "fields": ('before not in (".", "\'")', 'before not in ("\'",)'),
    "attributes": ('after not in ("=>", "\'")', 'after != "=>"'),
    "formals": ('after not in ("=>", "\'")', 'after != "\'"'),
    "target": ("code[place - 1].lower() in starts", "True"),
    "direction": ('directions[formal] == "in"', 'directions[formal] != "in"'),
    "clock": ("self.clocks.add(code[place + 2].lower())", "pass"),
    "wiring": ("todo += sorted(", "_ = sorted("),
    "itself": ("self.origins(name) - {reader}", "self.origins(name)"),
    "generate": ("(*conditions, _spaced(head))", "conditions"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_the_reader_is_found(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = FAULTS[name]
    source = Path(structure.__file__).read_text(encoding="utf-8")
    assert source.count(old) >= 1
    broken = types.ModuleType("broken_structure")
    monkeypatch.setitem(sys.modules, "broken_structure", broken)
    exec(compile(source.replace(old, new), "broken", "exec"), broken.__dict__)
    try:
        found = broken.structure(VHDL, "unit", INTERFACES)
    except (ValueError, LookupError, tools.ToolError, StopIteration):
        return
    same = found.connections() == CONNECTIONS and found.clocks == {"clk", "tick"}
    assert not (same and found.blocks[0].condition)


@pytest.mark.parametrize(
    ("old", "new", "changed"),
    [
        ("a => word(i)", "a => sel", (INPUTS, "i_adder")),
        ("b => pair.x", "b => '0'", ("p_pair", "i_adder")),
        ("total <= \"0011\"", "word <= \"0011\"", ("i_adder", "p_pair")),
        ("y <= total", "y <= word", ("i_adder", OUTPUTS)),
        ("sum(0) => total(i)", "sum(0) => open", ("i_adder", OUTPUTS)),
        ("pair.q <= sel", "pair.q <= '1'", (INPUTS, "p_pair")),
    ],
)  # fmt: skip
def test_another_connection_is_read_as_another(
    old: str, new: str, changed: tuple[str, str]
) -> None:
    assert VHDL.count(old) == 1
    before, after = read().connections(), read(VHDL.replace(old, new)).connections()
    assert before.get(changed) != after.get(changed)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("b => pair.x", "none => pair.x", "unit: i_adder: adder has no port none"),
        ("work.adder", "work.other", "unit: other: no entity and no component of that name"),
        ("  y <= total;", "  call(y);", "unit: a statement of an unknown kind: call"),
        ("end generate g_add", "end block g_add", "unit: "),
        ("end architecture rtl;", "", "unit: no end of the architecture"),
    ],
)
def test_what_cannot_be_read_is_told(old: str, new: str, message: str) -> None:
    with pytest.raises(structure.StructureError, match=message):
        read(VHDL.replace(old, new))
    with pytest.raises(structure.StructureError, match="none: no architecture"):
        structure.structure(VHDL, "none", INTERFACES)


def test_every_entity_of_the_design_is_read() -> None:
    drawn = {entity: diagrams.read(entity) for entity in sources.entities()}
    assert len(drawn) > 80
    for entity, one in drawn.items():
        wired = {driven for driven, _ in one.wires}  # perhaps with a constant alone
        assert [n for n in one.outputs if not one.origins(n) and n not in wired] == [], entity


# --- against GHDL ---------------------------------------------------------------------------------


def elaborated(folder: Path, top: str) -> dict[str, set[str]]:
    """Labels of instances and processes that GHDL elaborates, of each entity below a top."""
    files = sources.compile_order(top, sources.rtl_files())
    standard = f"--std={sources.standard(files)}"
    ghdl = tools.tool("ghdl")
    tools.run([*ghdl, "-a", standard, *map(str, files)], cwd=folder)
    command = [*ghdl, "--elab-run", standard, top, "--disp-tree=proc", "--stop-time=1ns"]
    found: dict[str, set[str]] = {}
    around: list[str] = []  # the entity at each depth
    for line in tools.run(command, cwd=folder).stdout.splitlines():
        row = re.match(r"([ |]*)(?:[+`]-)?(\w+)(?:\([\w-]+\))? \[(\w+)", line)
        if row is None:
            continue
        depth = len(row[1]) // 2 + (row[1] != "" or "-" in line.partition("[")[0])
        owner = around[depth - 1] if depth else ""
        del around[depth:]
        around.append(row[2] if row[3] == "entity" else owner)
        found.setdefault(around[-1], set())
        if row[3] in ("instance", "process") and not re.fullmatch(r"P\d+", row[2]):
            found[owner].add(row[2])
    return found


@pytest.mark.parametrize("top", ["gate_guard", "mptc_family_core", "mpdcc_core", "host_link"])
def test_blocks_are_those_that_ghdl_elaborates(top: str, tmp_path: Path) -> None:
    found = elaborated(tmp_path, top)
    assert top in found
    assert sum(map(len, found.values())) > 10
    for entity, labels in found.items():
        blocks = diagrams.read(entity).blocks
        names = {block.label.partition(" (")[0] for block in blocks}
        always = {block.label for block in blocks if "if " not in block.condition}
        assert always <= labels <= names, entity


# --- the picture ----------------------------------------------------------------------------------


def titles(picture: str, kind: str) -> list[str]:
    groups = ElementTree.fromstring(picture).iter(f"{SVG}g")
    return [g.findtext(f"{SVG}title", "") for g in groups if g.get("class") == kind]


@pytest.mark.parametrize("entity", PUBLIC)
def test_the_picture_holds_every_block_and_connection_once(entity: str) -> None:
    pictures = entity_pages.pictures(entity)
    for name in diagrams.nested(entity):
        drawn = diagrams.joined(diagrams.read(name))
        picture = pictures[f"{name}-blocks.svg"]
        assert sorted(t.split(":")[0] for t in titles(picture, "block")) == sorted(
            block.label for block in drawn.blocks
        )
        wanted = {
            f"{origin} to {reader}: {', '.join(sorted(names))}"
            for (origin, reader), names in drawn.connections().items()
        }
        got = titles(picture, "signals")
        assert set(got) == wanted
        assert len(got) == len(wanted)
        arrows = [p for p in ElementTree.fromstring(picture).iter(f"{SVG}path") if p.get("d")]
        assert sum(p.get("marker-end") is not None for p in arrows) == len(wanted)


def test_no_two_boxes_and_texts_overlap() -> None:
    for entity in ("gate_guard", "mpdcc_system", "mptc_core", "board_top"):
        for name, picture in entity_pages.pictures(entity).items():
            boxes = []
            for group in ElementTree.fromstring(picture).iter(f"{SVG}g"):
                if group.get("class") in ("block", "signals"):
                    found = group.find(f"{SVG}rect")
                    assert found is not None
                    x, y, w, h = (float(found.get(k, "")) for k in ("x", "y", "width", "height"))
                    boxes.append((x, y, x + w, y + h))
            for k, (a, b, c, d) in enumerate(boxes):
                for e, f, g, h in boxes[:k]:
                    assert c <= e or g <= a or d <= f or h <= b, name


def test_a_picture_is_the_same_when_drawn_again() -> None:
    assert entity_pages.pictures("host_link") == entity_pages.pictures("host_link")


def test_long_cells_are_cut_and_groups_joined() -> None:
    names = [f"p{k}" for k in range(6)]
    groups = dict.fromkeys(names[:4], "measurements, sampled with start")
    said = diagrams.lines(frozenset(names), names, groups)
    assert said == ("4 ports: measurements", "p4", "p5")
    many = frozenset(f"s{k:02}" for k in range(9))
    assert diagrams.lines(many, [], {}) == ("s00", "s01", "s02", "s03", "s04", "s05", "and 3 more")


def test_the_page_shows_the_pictures() -> None:
    page = entity_pages.page("mptc_core", budgets.load(), site.ENTITIES / "mptc_core.md")
    assert "[![Block diagram of mptc_core](mptc_core-blocks.svg)](mptc_core-blocks.svg)" in page
    assert "Inside `mptc_controller`:" in page
    assert "(mptc_controller-blocks.svg)" in page
