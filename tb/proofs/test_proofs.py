"""The proofs of `tb/proofs/`: all hold, each fails on a fault, and none holds for a wrong reason.

Sweep: every entity and configuration of proofs.toml; every property's fault; what asks for a leg or
its graph with the packages of each converter.
Checks: that properties and facts are proven; that each property notices its fault without the help
of any fact, so that none of them can be switched off unnoticed; that facts which contradict one
another, a property without a proof and a list with mistakes are refused; that the page has every
property.
Does not prove: that the properties are all that one might ask for.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from directmpc.mpdcc import tables
from scripts.__main__ import main
from scripts.hdl import converter_package, sources
from scripts.measure import proofs
from scripts.measure.ranges import table as ranges
from scripts.shared import tools
from scripts.shared.tables import inside
from tb.helpers.faults import altered


def has_solver() -> bool:
    """Whether there is Yices, of which some machines have no package."""
    try:
        tools.tool("yices-smt2")
    except tools.ToolError:
        return False
    return True


pytestmark = pytest.mark.skipif(
    not has_solver(), reason="no yices-smt2: requirements-proofs.txt, or YICES"
)

LISTED = proofs.listed()
CONFIGURATIONS = [(proof, name) for proof in LISTED for name in proof.configurations]
PROPERTIES = [(proof, one) for proof in LISTED for one in proof.properties]
#: With the packages of another converter; those of the guard are in the list.
OTHERS = [
    (name, proof) for name in tables.NAMES if name != tables.DEFAULT
    for proof in proofs.of_converter(name, LISTED)
]  # fmt: skip
#: What breaks a leg that stops at once, where the fault of the list is none in it. That positions
#: of the two-level one follow edges nothing breaks: any follows any.
AT_ONCE = {
    "a_stop_ends_in_time": (
        "at_rail(TABLED_LEG, driven) or (aged and not dark);", "aged and not dark;"
    ),
    "order_of_a_stop": ("lowered <= stop_of(TABLED_LEG, driven);", "lowered <= not driven;"),
    "order_of_a_start": (
        "driven xor first when",
        'driven xor first xor action_of(TABLED_LEG, target, accepted, "001") when',
    ),
}  # fmt: skip
FAULTS = [
    (name, proof, one)
    for name, proof in OTHERS for one in proof.properties
    if (name, one.name) != ("two_level", "positions_follow_edges")
]  # fmt: skip
GRAPHS = [
    (name, proof, configuration)
    for name, proof in OTHERS if proof.entity != "gate_guard"
    for configuration in proof.configurations
]  # fmt: skip

SMALL = """
[countdown.configurations]
wide = { WIDTH = 4 }

[countdown.properties.over_at_zero]
says = "over is up when nothing is left"

[countdown.properties.over_at_zero.fault]
unit = "countdown"
text = "left = 1"
fault = "left = 2"
"""


def small(folder: Path, facts: str, holds: str = "!loaded || over == (left == 0)") -> proofs.Proof:
    """A proof about `countdown`, with facts of one's own."""
    (folder / "proofs.toml").write_text(SMALL)
    (folder / "countdown.v").write_text(
        f"""module proof (input clk, input rst, input load, input [3:0] clocks);
  wire over;
  countdown i_dut (.clk(clk), .load(load), .clocks(clocks), .over(over));
  (* inside = "i_dut.left" *) wire [3:0] left;
  reg loaded;
  always @(posedge clk) loaded <= !rst && (load || loaded);
  wire prove_over_at_zero = {holds};
  {facts}
endmodule
"""
    )
    return proofs.listed(folder / "proofs.toml")[0]


@pytest.mark.parametrize(
    ("proof", "name"), CONFIGURATIONS, ids=[f"{p.entity}-{name}" for p, name in CONFIGURATIONS]
)
def test_everything_holds(proof: proofs.Proof, name: str) -> None:
    found = proofs.prove(proof, name)
    assert found.holds, (found.refuted, found.unanswered)
    assert len(found.proven) >= len(proof.properties)


@pytest.mark.parametrize(
    ("proof", "one"), PROPERTIES, ids=[f"{p.entity}-{one.name}" for p, one in PROPERTIES]
)
def test_a_fault_is_noticed(proof: proofs.Proof, one: proofs.Property, tmp_path: Path) -> None:
    rtl = altered(tmp_path, one.fault.unit, one.fault.text, one.fault.fault)
    assert proofs.notices(proof, one, rtl)


@pytest.mark.parametrize(
    ("name", "proof", "configuration"),
    GRAPHS, ids=[f"{name}-{proof.entity}-{one}" for name, proof, one in GRAPHS],
)  # fmt: skip
def test_a_graph_holds(name: str, proof: proofs.Proof, configuration: str) -> None:
    found = proofs.prove(proof, configuration)
    assert found.holds, (found.refuted, found.unanswered)


@pytest.mark.parametrize(
    ("name", "proof", "one"),
    FAULTS, ids=[f"{name}-{proof.entity}-{one.name}" for name, proof, one in FAULTS],
)  # fmt: skip
def test_a_fault_is_noticed_in_each_converter(
    name: str, proof: proofs.Proof, one: proofs.Property, tmp_path: Path
) -> None:
    text, fault = one.fault.text, one.fault.fault
    if tables.leg_of(name).stop_steps == 1:
        text, fault = AT_ONCE.get(one.name, (text, fault))
    design = converter_package.rtl_of(name)
    rtl = altered(tmp_path, one.fault.unit, text, fault, design=design)
    assert proofs.notices(proof, one, rtl)


def test_what_asks_for_a_leg_is_proven_with_the_packages_of_any() -> None:
    found = proofs.of_converter("npc3l", LISTED)
    assert {"gate_guard", "candidate_enumerator", "leaf_dispatcher"} <= {p.entity for p in found}
    assert "countdown" not in {proof.entity for proof in found}
    for proof in found:
        assert all(one["CONVERTER"] == "npc3l" for one in proof.configurations.values())
        assert {p.fault.configuration for p in proof.properties} <= set(proof.configurations)


def test_a_proof_holds_and_its_fault_breaks_it(tmp_path: Path) -> None:
    proof = small(tmp_path, "")
    assert proofs.prove(proof, "wide").holds
    one = proof.properties[0]
    rtl = altered(tmp_path, one.fault.unit, one.fault.text, one.fault.fault)
    found = proofs.prove(proof, "wide", rtl)
    assert found.refuted == ("prove_over_at_zero",)
    assert not found.holds
    assert proofs.notices(proof, one, rtl)


def test_a_property_that_is_switched_off_notices_nothing(tmp_path: Path) -> None:
    # what the proof itself cannot tell: it holds, and with facts the fault is even seen
    proof = small(tmp_path, "wire fact_a = !loaded || over == (left == 0);", "1")
    one = proof.properties[0]
    assert proofs.prove(proof, "wide").holds
    rtl = altered(tmp_path, one.fault.unit, one.fault.text, one.fault.fault)
    assert proofs.prove(proof, "wide", rtl).refuted == ("fact_a",)
    assert not proofs.notices(proof, one, rtl)


def test_a_property_without_a_fault_is_whole(tmp_path: Path) -> None:
    proof = small(tmp_path, "")
    assert not proofs.notices(proof, proof.properties[0], sources.RTL)


def test_a_property_that_holds_at_first_only_is_refuted(tmp_path: Path) -> None:
    found = proofs.prove(small(tmp_path, "", "!over || left != 0 || !loaded"), "wide")
    assert found.refuted == ("prove_over_at_zero",)


def test_facts_that_contradict_one_another_prove_nothing(tmp_path: Path) -> None:
    proof = small(tmp_path, "wire fact_a = left == 3; wire fact_b = left == 4;", "0")
    with pytest.raises(proofs.ProofError, match="step: the facts contradict one another"):
        proofs.prove(proof, "wide")


def test_an_assumption_that_cannot_be_kept_proves_nothing(tmp_path: Path) -> None:
    proof = small(tmp_path, "wire assume_never = 0;", "0")
    with pytest.raises(proofs.ProofError, match="reset: the facts contradict one another"):
        proofs.prove(proof, "wide")


def test_an_unknown_signal_is_an_error(tmp_path: Path) -> None:
    proof = small(tmp_path, '(* inside = "i_dut.right" *) wire right; wire fact_a = right;')
    with pytest.raises(proofs.ProofError, match=r"i_dut\.right"):
        proofs.prove(proof, "wide")


def test_a_property_that_nobody_wrote_is_an_error(tmp_path: Path) -> None:
    proof = small(tmp_path, "")
    more = dataclasses.replace(proof.properties[0], name="more")
    proof = dataclasses.replace(proof, properties=(*proof.properties, more))
    with pytest.raises(proofs.ProofError, match="name other properties: more"):
        proofs.prove(proof, "wide")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("says =", "claims =", r"countdown\.properties\.over_at_zero: 'says' is missing"),
        ("text =", "texts =", r"over_at_zero\.fault: 'text' is missing"),
        ("[countdown.conf", "[[", "proofs.toml: "),
        ("[countdown.conf", "[countdown]\nx = 1\n[countdown.conf", "unknown key 'x'"),
        ("[countdown.properties.", "[countdown.", "countdown: 'properties' is missing"),
    ],
)
def test_a_mistake_in_the_list_is_named(old: str, new: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "proofs.toml"
    path.write_text(SMALL.replace(old, new))
    with pytest.raises(proofs.ProofError, match=said):
        proofs.listed(path)


def test_the_command_names_what_does_not_hold(tmp_path, monkeypatch, capsys) -> None:
    proof = small(tmp_path, "", "left != 3")
    monkeypatch.setattr(proofs, "listed", lambda: [proof])
    out = tmp_path / "proofs.json"
    assert main(["prove", "--jobs", "1", "--out", str(out)]) == 1
    said = capsys.readouterr()
    assert "prove: countdown, wide: prove_over_at_zero does not hold" in said.err
    found = json.loads(out.read_text())["proof"]["countdown"]["over_at_zero"]
    assert (found["method"], found["depth"], found["holds"]) == ("induction", 1, False)


def test_the_command_proves_what_is_asked_for(tmp_path, monkeypatch, capsys) -> None:
    proof = small(tmp_path, "")
    monkeypatch.setattr(proofs, "listed", lambda: [proof])
    out = tmp_path / "proofs.json"
    assert main(["prove", "countdown", "--jobs", "1", "--out", str(out)]) == 0
    assert json.loads(out.read_text())["proof"]["countdown"]["over_at_zero"]["holds"]
    assert "yes" in capsys.readouterr().out
    assert main(["prove", "counter"]) != 0
    assert "no proof of 'counter'; there are proofs of: countdown" in capsys.readouterr().err


def test_the_page_has_every_property() -> None:
    page = inside(proofs.PAGE.read_text(encoding="utf-8"), *proofs.MARKS)
    rows = [row for row in page.splitlines() if row.startswith("| `")]
    said = [one.says for _, one in PROPERTIES] + [check.says for check in ranges.CHECKS]
    assert [row.split(" | ")[1] for row in rows] == said
    assert all(proof.entity in sources.entities() for proof in LISTED)
