"""Mapped netlists decide as the VHDL: LUTs, carry chains, flip-flops and multipliers of the part.

Sweep: ECP5 and Spartan-3.
Stimulus: mptc_preexcitation, 600 rows of words of every size.
Checks: every output of every row; what the models of the cells do not do is refused.
Faults: a LUT with other contents, a flip-flop that has lost what it takes.
Does not prove: the cores themselves; `make coverage ARGS=mapped` runs them.
"""

from __future__ import annotations

import re

import pytest

from scripts.shared.tools import ToolError
from scripts.studies import mapped

ENTITY = "mptc_preexcitation"


@pytest.mark.parametrize("family", mapped.FAMILIES)
def test_a_mapped_netlist_answers_as_the_vhdl(family: str) -> None:
    cells = mapped.mapped(ENTITY, family).read_text(encoding="utf-8")
    assert len(re.findall(r"^  LUT\d ", cells, re.M)) > 100
    assert len(re.findall(r"^  MULT18X18", cells, re.M)) >= 1
    result = mapped.check(ENTITY, family)
    assert result.checked == 600
    assert result.mismatches == []
    assert len(result.outputs) >= 4


def _inverted(match: re.Match[str]) -> str:
    return f".INIT(16'h{0xFFFF ^ int(match[1], 16):04x})"


#: What is wrong in a netlist for ECP5: the place in the middle of those that fit is changed.
FAULTS = {
    "changed LUT": (r"\.INIT\(16'h([0-9a-f]{4})\)", _inverted),
    "lost assignment": (r"\.DI\(is_alpha\[\d+\]\)", lambda _: ".DI(1'h0)"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_a_mapped_netlist_is_seen(fault: str) -> None:
    cells = mapped.mapped(ENTITY, "ecp5").read_text(encoding="utf-8")
    pattern, changed = FAULTS[fault]
    places = list(re.finditer(pattern, cells))
    one = places[len(places) // 2]
    wrong = cells[: one.start()] + changed(one) + cells[one.end() :]
    assert mapped.differing(mapped.check(ENTITY, "ecp5", wrong)) >= 1


def test_what_a_model_does_not_do_is_refused() -> None:
    signed = ".SIGNEDA(1'h1),\n    .SIGNEDB(1'h1)"
    for cells in (
        f"  MULT18X18D m (\n    .A0(a),\n    {signed.replace('h1', 'h0', 1)}\n  );\n",
        f'  MULT18X18D #(\n    .REG_OUTPUT_CLK("CLK0")\n  ) m (\n    {signed}\n  );\n',
        "  DP16KD #(\n    .DATA_WIDTH_A(32'd9)\n  ) r (\n    .WEA(1'h0)\n  );\n",
        "  DP16KD #(\n    .DATA_WIDTH_A(32'd18)\n  ) r (\n    .WEA(write)\n  );\n",
        '  RAMB16_S36_S36 #(\n    .WRITE_MODE_A("WRITE_FIRST")\n  ) r (\n    .SSRA(1\'h0)\n  );\n',
    ):
        with pytest.raises(ToolError, match=r"multiplier m is|the model of \w+ has no"):
            mapped.simulated("mptc_preexcitation", "ecp5", cells)
