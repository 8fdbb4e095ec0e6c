"""Filters, rotor flux and leakage: the RTL against its twins.

Sweep: all parts, and builds without filters, without leakage, without both.
Stimulus: a drive's coefficients and measurements with noise, words, positions and coefficients of
any content, all words at their ends; steps of any parts one after the other; parameters that
change between steps; scalings; resets of all and of one part; `start` repeated while busy, `scale`
at any time; any pause between steps, and none. Ports change as soon as the header allows it.
Every state, word and voltage driven out of its word alone.
Checks: every output bit for bit from its valid on, the valids, busy and scaling in every clock;
theta of 1 leaves the coefficients as they are.
Timing: filters 12 clocks, flux 24 or 32, leakage 65 or 73, a scaling 17.
Faults: signs, shares and places of products and words, wrong states and gains, limits, rounding,
a part that begins or counts when it has not to, states that survive a reset, each overflow untold
or kept.
Does not prove: that the observers are good for a drive (tb/model/test_rotor_flux.py,
tb/model/test_capacitor_observer.py, tb/model/test_leakage.py).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from directmpc.mpdcc import state_program
from scripts.hdl.clocks import clocks_of
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run


def bench(
    steps: int,
    rtl: Path = RTL,
    *,
    pauses: tuple[int, ...] = (0, 0, 1, 5),
    filters: bool = True,
    leakage: bool = True,
    alone: str = "",
) -> Outcome:
    return run(
        "state_observer",
        "tb.rtl.observers.state_observer.bench_state_observer",
        units=["state_observer"],
        generics={"FILTERS": str(filters).lower(), "LEAKAGE": str(leakage).lower()},
        arguments={
            "seed": 4, "steps": steps, "pauses": pauses, "filters": filters, "leakage": leakage,
            "alone": alone,
        },
        rtl=rtl,
    )  # fmt: skip


@pytest.mark.parametrize("pauses", [(0,), (0, 0, 1, 5)], ids=["full speed", "throttled"])
def test_it_steps_as_its_twins(pauses: tuple[int, ...]) -> None:
    assert bench(360, pauses=pauses).checks["estimate"] >= 120


def test_every_state_that_overflows_is_told_by_itself() -> None:
    assert bench(0, alone="flux").checks["estimate"] >= 200


def test_every_voltage_that_overflows_is_told_by_itself() -> None:
    assert bench(0, alone="filters").checks["voltages"] >= 24


@pytest.mark.parametrize(("filters", "leakage"), [(False, False), (True, False), (False, True)])
def test_a_part_steps_without_the_others(filters: bool, leakage: bool) -> None:
    assert bench(180, filters=filters, leakage=leakage).checks["estimate"] >= 60


def test_the_program_takes_the_clocks_that_are_promised() -> None:
    p, flux = state_program, state_program.FLUX
    assert clocks_of("state_observer", "filters") == p.FILTERS_END + 2
    assert clocks_of("state_observer", "filters_busy") == p.FILTERS_END + 1
    assert clocks_of("state_observer", "filtered") == p.FLUX_AT + 2
    assert clocks_of("state_observer", "flux") == p.FLUX_AT + 2 - flux
    assert clocks_of("state_observer", "flux_busy") == p.FLUX_END + 1 - flux
    assert clocks_of("state_observer", "leakage") == p.LEAKAGE_END + 2 - flux
    assert clocks_of("state_observer", "scaling") == p.SCALING_END + 1 - p.SCALING


def _products(*changes: tuple[int, state_program.Product]) -> list[state_program.Product]:
    by_clock = {p.clock: p for p in state_program.PRODUCTS}
    return [p for _, p in sorted((by_clock | dict(changes)).items())]


def _moved(*more: state_program.Move) -> list[state_program.Move]:
    by_clock = {m.clock: m for m in state_program.MOVES} | {m.clock: m for m in more}
    return [m for _, m in sorted(by_clock.items())]


_P = state_program.Product
_M = state_program.Move


@pytest.mark.parametrize(
    ("products", "moves", "message"),
    [
        (_products((17, _P(17, "m_alpha", "nothing", "state"))), None, "no such operand"),
        (_products((17, _P(17, "m_alpha", "pull", "third"))), None, "no such seed"),
        (_products((8, _P(8, "old s_beta", "pull", "state", "", 4))), None, "from 0 to 3"),
        (_products((8, _P(8, "old s_beta", "pull", ""))), None, "no beginning"),
        (_products((12, _P(12, "m_beta", "pull", "state"))), None, "no beginning"),
        (_products((13, _P(13, "s_beta", "pull", "state"))), None, "s_beta has not been written"),
        (_products((18, _P(18, "m_beta", "pull", "", "state"))), None, "no beginning"),
        ([_P(3, "m_alpha", "pull", "state"), _P(3, "m_alpha", "pull")], None, "does not follow"),
        ([_P(3, "m_alpha", "pull", "state")], None, "the last sum has no end"),
        (None, [_M(5, "e_alpha", "result")], "there is no result"),
        (None, [_M(5, "c_alpha", "is_alpha"), _M(5, "c_beta", "is_beta")], "does not follow"),
        (None, [_M(29, "m_beta", "is_beta", joined=True)], "nothing is read"),
        (None, [_M(28, "m_beta", "omega_r", joined=True)], "omega_r is never joined"),
        (None, [_M(20, "s_beta", "result")], "is not moved"),
        (None, _moved(_M(10, "f_beta", "is_beta")), "clock 10: two words are written"),
        (None, _moved(_M(8, "f_beta", "is_beta")), "clock 8: two words are written"),
        (_products((1, _P(1, "m_beta", "charge", "corrected"))), None, "m_beta is being written"),
        (_products((0, _P(0, "m_alpha"))), None, "m_alpha is being written"),
    ],
)
def test_a_program_that_contradicts_itself_is_refused(products, moves, message: str) -> None:
    given = {} if products is None else {"products": products}
    given |= {} if moves is None else {"moves": moves}
    with pytest.raises(ValueError, match=message):
        state_program.check(**given)


ENTITY = "state_observer"
PROGRAM = f"{ENTITY}_program"
OPEN, GAIN = "filters_n  <= begun", "f_q_midpoint(0) or f_q_midpoint(1) or f_q_midpoint(2)"
FAULTS = {
    "sign of a charge": (ENTITY, "minus  := charges(1);", "minus  := discharges(1);"),
    "share": (ENTITY, "not (neutral(1) xor neutral(2));", "(neutral(1) xor neutral(2));"),
    "coefficient": (PROGRAM, "(4, 21, 569, 3, -1)", "(4, 21, 568, 3, -1)"),
    "bits of a charge": (ENTITY, "<= PLACE_F_PHASE_BETA) then", "< PLACE_F_PHASE_BETA) then"),
    "unread": (ENTITY, "reading <= not c_write;", "reading <= begins;"),
    "late coefficient": (ENTITY, "=> b_ahead(PLACE_BITS", "=> b_choice(PLACE_BITS"),
    "lowest bit": (ENTITY, "lowest   <= whole and not charging;", "lowest   <= whole;"),
    "early turn": (PROGRAM, "(4, 7, 41, 1, 0)", "(4, 7, 41, 0, 0)"),
    "lane": (ENTITY, 'if (lane = "00") then', 'if (lane = "01") then'),
    "early gain": (
        ENTITY,
        "if (begun = '1') then\n        if (lane",
        "if (begun /= 'X') then\n        if (lane",
    ),
    "open filter": (ENTITY, f"{OPEN} and ({GAIN});", f"{OPEN};"),
    "rounding": (ENTITY, "value(VOLTAGE_CUT - 1) or seeds(SEED_CORRECTED);", "'0';"),
    "filters survive": (
        ENTITY,
        "if (rst = '1' or forget_filters = '1') then",
        "if (rst = '1') then",
    ),
    "filters unasked": (
        ENTITY,
        "turns      <= marks(0) and filters_on;",
        "turns      <= marks(0);",
    ),
    "measured": (ENTITY, "potential <= v_n when with_filters = '0' else", "potential <="),
    "potential of a phase": (
        ENTITY,
        "words(2) when phase = 0 else",
        "words(1) when phase = 0 else",
    ),
    "cross term": (PROGRAM, "(28, 71, 0, 2, -1)", "(28, 7, 0, 2, -1)"),
    "flux survives": (ENTITY, "no_flux       <= '1';", "null;"),
    "current survives": (ENTITY, "no_current    <= '1';", "null;"),
    "never changed": (ENTITY, "turned     <= not turned;", "null;"),
    "flux unasked": (
        ENTITY,
        "if (leaving = '1' and flux_on = '1') then",
        "if (leaving = '1') then",
    ),
    "voltage of a phase": (
        ENTITY,
        "unsigned_of(words(2)) when phase_1 = 0 else",
        "unsigned_of(words(1)) when phase_1 = 0 else",
    ),
    "order of phases": (ENTITY, "v_ph_c when phase_1 = 1 else", "v_ph_b when phase_1 = 1 else"),
    "half a step": (ENTITY, "not from_result, from_result);", "not from_result, '0');"),
    "difference": (PROGRAM, "(30, 1, 37, 0, 0)", "(30, 0, 37, 0, 0)"),
    "wrap": (ENTITY, "cut_state(STATE - 1) <= wide(SUM - CUT - 1);", "null;"),
    "narrow": (
        ENTITY,
        "narrow <= takes(TAKE_STEP) or takes(TAKE_ERROR);",
        "narrow <= takes(TAKE_ERROR);",
    ),
    "lower bits": (
        ENTITY,
        "if (takes(TAKE_EMF) = '1') then\n      cut",
        "if (false) then\n      cut",
    ),
    "other flux": (ENTITY, "(observed_on or not move(4))", "(not move(4))"),
    "frozen": (ENTITY, " and begun = '1' and frozen = '0'", " and begun = '1'"),
    "first step": (ENTITY, " and begun = '1' and frozen = '0'", " and frozen = '0'"),
    "lower limit": (ENTITY, "downto RATIO - 2) /= 0", "downto RATIO - 3) /= 0"),
    "upper limit": (ENTITY, "moved(CHANGE - 1 downto RATIO) = 0", "moved(CHANGE - 1) = '0'"),
    "theta survives": (
        ENTITY,
        "if (rst = '1' or forget_leakage = '1') then",
        "if (rst = '1') then",
    ),
    "order": (PROGRAM, "(70, 400, 70, 3, 3)", "(70, 400, 71, 3, 3)"),
    "scaled while stepping": (ENTITY, "scales <= start and scale;", "scales <= scale;"),
    "clipping untold": (ENTITY, "clips <= clips or full;", "clips <= '0';"),
    "clipping kept": (ENTITY, "clips <= '0';", "null;"),
    "leakage untold": (ENTITY, "bad <= bad or (full and begun);", "null;"),
    "leakage kept": (ENTITY, "bad <= full and begun;", "bad <= bad or full;"),
}
OUTPUTS = "voltages|estimate|theta|scaled|clipped|busy|scaling"
SEEN = rf"({OUTPUTS}|\w*valid): got|\w+ is undefined"


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, *FAULTS[name])
    with pytest.raises(CheckError, match=SEEN):
        bench(270, rtl)


FLAG = "saturated  <= overflow or full or bent;"
#: Overflows that are not told, or told for longer.
SILENT = {
    "flux late": ("flux", "overflow <= '1';", "null;"),
    "flux kept": ("flux", "overflow   <= '0';\n      elsif", "null;\n      elsif"),
    "flux through a reset": (
        "flux",
        "if (rst = '1') then\n        overflow <= '0';",
        "if (false) then\n        overflow <= '0';",
    ),
    **{f"flux {x}": ("flux", FLAG, FLAG.replace(x, "'0'")) for x in ("overflow", "full", "bent")},
    **{
        f"flux {name.lower()}": ("flux", f"takes(TAKE_{name}) or ", "")
        for name in ("ANGLE", "FLUX_BETA")
    },
    "first voltage": (
        "filters",
        "flag <= full or",
        "flag <= (full and not takes(TAKE_FIRST_VOLTAGE)) or",
    ),
    "voltage": ("filters", "flag <= full or", "flag <= (full and not takes(TAKE_VOLTAGE)) or"),
    "last voltage": (
        "filters",
        "flag <= full or",
        "flag <= (full and not takes(TAKE_LAST_VOLTAGE)) or",
    ),
    "voltages kept": ("filters", "(flag and not takes(TAKE_FIRST_VOLTAGE))", "flag"),
}


@pytest.mark.parametrize("name", SILENT)
def test_a_fault_is_told(name: str, tmp_path: Path) -> None:
    alone, old, new = SILENT[name]
    rtl = altered(tmp_path, ENTITY, old, new)
    with pytest.raises(CheckError, match=r"(estimate|voltages): got|is undefined"):
        bench(0, rtl, alone=alone)
