"""`make coverage`: counters in netlists, goals, and that a goal that is missed turns it red.

Stimulus: a netlist as GHDL writes it, with what its simulation would write; mptc_preexcitation,
converted, with a few rows and with many; a few hundred decisions; figures made up.
Checks: conditions, arms and bits are told apart and joined; what no vector does is not counted;
every kind of goal is missed once, by the exit code too; the goals that are published exist.
Does not prove: the shares of the page; `make coverage` measures them.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from directmpc.host.safe_torque_off import SafeTorqueOff
from scripts.commands.coverage import cli
from scripts.hdl import conversion, coverage, netlist_check, sources
from scripts.shared.tools import ToolError
from scripts.studies.coverage import functional, goals, rtl

NETLIST = """\
module countdown_12
  (input  clk,
   input  rst,
   input  load,
   output [1:0] left);
  wire [1:0] held;
  wire [3:0] steps;
  wire n5_o;
  reg [1:0] n6_q;
  assign left = held;
  assign steps = 4'b1010;
  /* countdown.vhd:33:10 */
  assign held = n6_q; // (signal)
  /* countdown.vhd:45:7 */
  assign n7_o = n5_o ? n6_q : held;
  /* countdown.vhd:50:5 */
  always @*
    case (held)
      2'b01: n8_o <= n7_o;
      2'b10: n8_o <= n6_q;
      default: n8_o <= 2'b00;
    endcase
endmodule
module table_only
  (input  [1:0] which,
   output told);
  assign told = which[0];
endmodule
"""


def test_conditions_arms_and_bits_are_counted() -> None:
    text, modules = coverage.instrument(NETLIST, {"countdown": Path("countdown.vhd")})
    assert list(modules) == ["countdown_12"]
    module = modules["countdown_12"]
    assert module.entity == "countdown"
    assert [str(one) for one in module.conditions] == [
        "countdown.vhd:45",
        "countdown.vhd:50 arm 2'b01",
        "countdown.vhd:50 arm 2'b10",
    ]
    assert module.signals == [("load", 1), ("left", 2), ("held", 2), ("steps", 4)]
    assert module.nets == ["n5_o", "held", "held"]
    assert "{(held == 2'b10), (held == 2'b01), n5_o}" in text
    assert "{steps, held, left, load}" in text
    assert text.count("endmodule") == 2
    # low, then high; two instances are joined
    told = ("c 0 3 3 1", "s 0 9 005 007", "c 0 3 0 2", "s 0 9 002 000")
    lines = "".join(f"countdown_12 {one}\n" for one in told)
    seen = coverage.collect(lines, modules)["countdown"]
    assert list(seen.conditions.values()) == [3, 3, 0]
    assert seen.of_conditions() == (2, 3)
    assert seen.of_lines("countdown.vhd") == (1, 2)
    assert seen.of_lines("other.vhd") == (0, 0)
    assert seen.of_bits() == (3, 9)
    # what is tied to a level does not count, nor an arm that a tied bit excludes
    tied = {"countdown_12": {("steps", bit): "1" for bit in range(4)} | {("held", 1): "0"}}
    fewer = coverage.collect(lines, modules, tied)["countdown"]
    assert [str(one) for one in fewer.conditions] == [
        "countdown.vhd:45", "countdown.vhd:50 arm 2'b01",
    ]  # fmt: skip
    assert fewer.of_bits() == (3, 4)
    assert goals.unpacked(json.loads(json.dumps(goals.packed({"countdown": seen})))) == {
        "countdown": seen
    }


TIED = """\
module leaf
  (input  clk,
   input  rst,
   input  go,
   input  [2:0] mode,
   output [2:0] q);
  wire [2:0] held;
  reg [2:0] n9_q;
  assign q = held;
  assign held = n9_q;
  always @(posedge clk)
    if (go) n9_q <= mode;
endmodule
module top
  (input  clk,
   input  rst,
   input  go,
   input  free,
   output [2:0] a,
   output [2:0] b);
  wire [2:0] i_first_q;
  wire [2:0] i_second_q;
  assign a = i_first_q;
  assign b = i_second_q;
  leaf i_first (
    .clk(clk),
    .rst(rst),
    .go(go),
    .mode({free, 2'b01}),
    .q(i_first_q));
  leaf i_second (
    .clk(clk),
    .rst(rst),
    .go(1'b1),
    .mode({2'b00, 1'b1}),
    .q(i_second_q));
endmodule
"""


def test_what_no_stimulus_changes_is_found_through_the_hierarchy(tmp_path: Path) -> None:
    netlist = tmp_path / "tied.v"
    netlist.write_text(TIED, encoding="utf-8")
    found = coverage.constants(netlist, "top")
    # bit 2 and go are free in one instance, a register holds what it is given
    assert found["leaf"] == {
        (name, bit): level
        for name in ("mode", "n9_q", "held", "q")
        for bit, level in enumerate("10")
    }
    assert ("i_second_q", 2) in found["top"]
    assert ("i_first_q", 2) not in found["top"]
    with pytest.raises(ToolError):
        coverage.constants(netlist, "nothing")


def _preexcitation(rows: int, folder: Path) -> coverage.Seen:
    text, modules = coverage.instrument(
        conversion.cached("mptc_preexcitation").read_text(encoding="utf-8")
    )
    netlist = folder / "instrumented.v"
    netlist.write_text(text, encoding="utf-8")
    ports = netlist_check.ports_of(netlist, "mptc_preexcitation")
    rng = np.random.default_rng(1)
    small = rng.integers(0, 16, rows)
    inputs = {
        name: rng.integers(0, 2**width, rows) >> np.minimum(small, width - 1)
        for name, width in ports.inputs.items()
    }
    netlist_check.simulate(
        "mptc_preexcitation", {}, inputs, ports=ports, verilog=netlist, folder=folder
    )
    counts = (folder / coverage.FILE).read_text(encoding="utf-8")
    return coverage.collect(counts, modules)["mptc_preexcitation"]


def test_vectors_are_seen_in_a_netlist(tmp_path: Path) -> None:
    for name in ("one", "many"):
        (tmp_path / name).mkdir()
    one, many = _preexcitation(1, tmp_path / "one"), _preexcitation(400, tmp_path / "many")
    assert many.of_conditions()[1] == one.of_conditions()[1] >= 5
    assert one.of_bits()[0] < 0.7 * many.of_bits()[0]
    assert goals.percent(many.of_conditions()) == 100
    assert goals.percent(many.of_bits()) >= 85
    assert goals.percent(one.of_bits()) < 70


def test_every_clock_of_two_channels_is_seen_and_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    found = goals.shares(rtl.measure("safe_torque_off"))
    least = goals.read().rtl
    for entity, one in found.items():
        reached = [goals.percent(one[what]) for what in ("conditions", "bits")]
        assert min(np.subtract(reached, least[entity])) >= 0.0, entity
    monkeypatch.setattr(
        SafeTorqueOff, "permit", property(lambda _: 0, lambda *_: None), raising=False
    )
    with pytest.raises(ToolError, match=r"safe_torque_off: transaction .*: permit is 0x1, not 0x0"):
        rtl.measure("safe_torque_off")


def test_decisions_do_what_the_goals_name() -> None:
    found = {
        "one_switching": functional.one_switching(16, 64, 2),
        "two_switchings": functional.two_switchings(4, 24, 2),
        "mptc": functional.mptc(12, 2) + functional.ties_of_vectors(),
    }
    wanted = goals.read()
    assert found["one_switching"]["search"] >= 20
    assert found["two_switchings"]["the choice is a node"] >= 1
    assert found["mptc"]["MPTC: tie of all vectors"] == 64
    for group, names in wanted.functional.items():
        met = sum(found[group][name] > 0 for name in names)
        # a sample of the states that the goals ask for
        assert met >= 0.7 * len(names), group


def _reached(wanted: goals.Goals) -> dict:
    return {
        "commit": "0" * 40,
        "functional": {
            group: dict.fromkeys(names, wanted.least) for group, names in wanted.functional.items()
        },
        "python": {part: [100, 100] for part in wanted.python},
        "rtl": {
            entity: {"conditions": [9, 9], "lines": [4, 4], "bits": [50, 50]}
            for entity in wanted.rtl
        },
        "mapped": {"one_core, ecp5": [wanted.mapped, 0], "one_core, xc3s": [wanted.mapped, 0]},
    }


def test_every_kind_of_goal_can_be_missed() -> None:
    wanted = goals.read()
    assert goals.missed(_reached(wanted), wanted) == []
    found = _reached(wanted)
    found["functional"]["one_switching"]["deadlock"] = wanted.least - 1
    part = next(iter(wanted.python))
    found["python"][part] = [1, 100]
    entity, other, gone = list(wanted.rtl)[:3]
    found["rtl"][entity]["conditions"] = [0, 9]
    found["rtl"][other]["bits"] = [1, 50]
    del found["rtl"][gone]
    found["rtl"]["new_entity"] = {"conditions": [1, 1], "lines": [1, 1], "bits": [1, 1]}
    found["mapped"]["one_core, ecp5"] = [wanted.mapped, 1]
    found["mapped"]["one_core, xc3s"] = [wanted.mapped - 1, 0]
    assert [line.partition(":")[0] for line in goals.missed(found, wanted)] == [
        "one_switching", part, entity, other, gone, "new_entity",
        "one_core, ecp5, mapped", "one_core, xc3s, mapped",
    ]  # fmt: skip


def test_every_part_has_its_tables(tmp_path: Path) -> None:
    wanted = goals.read()
    page = tmp_path / "page.md"
    empty = ["\n".join([*goals.marks(part), ""]) for part in goals.PARTS]
    page.write_text("".join(empty), encoding="utf-8")
    found = _reached(wanted)
    goals.publish(found | {"rtl": {}}, wanted, page)
    # an entity with a goal has its row before it is measured
    assert "| `mac_block` | not measured |" in page.read_text(encoding="utf-8")
    goals.publish({"commit": "1" * 40, "rtl": found["rtl"]}, wanted, page)
    text = page.read_text(encoding="utf-8")
    assert text.count("Measured at commit `000000000000`") == len(goals.PARTS) - 1
    assert text.count("Measured at commit `111111111111`") == 1
    for name in ("`mac_block`", "`host`", "one_core", "u_7", "100.0 %"):
        assert name in text, name


def test_a_goal_that_is_missed_ends_with_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wanted = goals.read()
    found = _reached(wanted)["functional"]
    monkeypatch.setattr(goals, "of_functions", lambda: found)
    monkeypatch.setattr(goals, "KEPT", tmp_path / "first")
    out = tmp_path / "coverage.json"
    assert cli.main(["functional", "--out", str(out)]) == 0
    del found["mptc"]["MPTC: u_3"]
    # what was measured stays as it is, until something changes that it depends on
    assert cli.main(["functional", "--out", str(out)]) == 0
    monkeypatch.setattr(goals, "KEPT", tmp_path / "second")
    assert cli.main(["functional", "--out", str(out)]) == 1
    assert "coverage: mptc: 'MPTC: u_3' 0 times, not" in capsys.readouterr().err
    with pytest.raises(SystemExit) as refused:
        cli.main(["everything"])
    assert refused.value.code == 2


def test_goals_that_cannot_be_meant_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "goals.toml"
    for text in ("[functional\n", "[functional]\none = []\n", "[functional]\nleast = 1\n"):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(ToolError, match=r"goals\.toml: "):
            goals.read(path)


def test_goals_are_of_what_there_is() -> None:
    wanted = goals.read()
    known = set(sources.entities())
    assert set(wanted.rtl) <= known
    assert set(wanted.argued) <= set(wanted.rtl)
    assert len(wanted.rtl) >= 10
    for conditions, bits in wanted.rtl.values():
        assert 0 < bits <= 100
        assert 0 < conditions <= 100
    for test in wanted.tests:
        path, _, name = test.partition("::")
        text = (goals.ROOT / path).read_text(encoding="utf-8")
        assert not name or f"\ndef {name}(" in text, test
    assert {top for top, _, _ in rtl.RUNS.values()} <= known


def test_the_page_has_the_goals_in_force() -> None:
    begin, end = goals.marks("rtl")
    page = goals.PAGE.read_text(encoding="utf-8")
    text = page.partition(begin)[2].partition(end)[0]
    for entity, least in goals.read().rtl.items():
        row = re.search(rf"^\| `{entity}` \|.*$", text, re.M)
        assert row is not None, entity
        assert " / ".join(f"{one:g} %" for one in least) in row[0], entity
