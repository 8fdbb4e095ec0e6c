"""``mptc_family_core`` against its bit-true twins: every decision, time, flag and clock.

Sweep: MPTC, MPFC and the seven methods of several vectors, and the duty rule, chosen anew for every
decision; both drives that ship, and machines of 4 and 75 kW at any flux, speed and load.
Stimulus: states out of closed loops; states whose references a period reaches; measurements and
registers of any content, with corners, zero flux and zero torque; running sequences of any content,
with times of zero, of a whole period and of more; hardly any dc-link voltage, and none; flux at its
reference; all inputs random on every clock but the start's, `start`
repeated while busy; decisions without a clock between them, of every method after every other.
Checks: vectors, times, switch states, flags bit for bit. The twins against float64 in
test_mptc_sequences.
Timing: 54, 73 and 77 clocks for MPTC1, MPTC2 and GTV, 110 for MPFC2, MPFC3, MPC2 and SVM, 39 and
78 for MPTC and MPFC, 64 and 79 for MPTC1 and MPTC2 with the rule best, always; the bench ends a
simulation in which a decision takes more than 64, 80, 90, 110, 40, 80, 64 and 80.
Resets: at every edge of a decision of each method; the next one, of any method, is the twin's.
Faults: in each file that the methods of several vectors add, in the sequencer, in what they share.
Does not prove: parameters that change between start and valid, which is forbidden.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mptc import cycles
from scripts.hdl import mptc_simulation as rtl_simulation
from scripts.hdl.clocks import clocks_of
from scripts.hdl.ghdl import CheckError
from scripts.hdl.mptc_job import FAMILY_METHODS, Job
from scripts.hdl.sources import RTL
from tb.helpers import mptc_pairs
from tb.helpers.faults import altered
from tb.helpers.mptc_pairs import PairRows
from tb.helpers.simulation import Outcome, run


def ghdl(rows: PairRows, rtl: Path | None = None, wanted: np.ndarray | None = None) -> np.ndarray:
    """Decisions of the RTL, as ``PairRows.expected`` has them, up to the first not as wanted."""
    job = Job(
        rows.rows.registers[0],
        rows.rows.measurements,
        rows.rows.u,
        each_registers=rows.rows.registers,
        family=True,
        family_method=rows.pairs,
        duty_rule=rows.rules,
        applied=rows.applied,
        wanted=wanted,
    )
    answer = rtl_simulation.simulate(job, rtl=rtl)
    return np.hstack([answer["decisions"], answer["sequences"]])


def test_rtl_decides_as_the_twins() -> None:
    rows = mptc_pairs.together(
        mptc_pairs.mixed(seed=1, n=70),
        mptc_pairs.near(seed=2, n=40),
        mptc_pairs.hardly_any_voltage(seed=3, n=6),
        mptc_pairs.nothing_missing(),
        mptc_pairs.longer_by_an_lsb(),
        mptc_pairs.machines(seed=8, n=8),
    )
    # a wrong decision ends the simulation
    expected = rows.expected()
    got = ghdl(rows, wanted=expected)
    np.testing.assert_array_equal(got, expected[: len(got)])
    assert len(got) == 1027 + 224
    assert got[:, 2].sum() >= 20
    assert got[:, 3].sum() >= 20
    long = rows.applied[:, 3:].sum(axis=1) > 4096
    assert long.sum() >= 15
    assert got[long, 2].all()
    for code, name in enumerate(mptc_pairs.METHODS, start=1):
        mine = rows.pairs == code
        assert mine.sum() > 80
        clocks = {clocks_of("mptc_family_core", name.lower())}
        if name in cycles.BEST:
            clocks.add(clocks_of("mptc_family_core", f"{name.lower()}_best"))
        assert set(got[mine, 1].tolist()) == clocks
        t1, t2 = got[mine, 8], got[mine, 9]
        assert ((t1 > 0) & (t1 < 4095)).sum() >= 10
        assert np.isin(t1, (0, 4095, 4096)).sum() >= 10 or name == "SVM"
        assert ((t1 + t2 < 4096).sum() >= 5) == (name in ("MPFC3", "SVM"))
    for code in (FAMILY_METHODS["MPTC1"], FAMILY_METHODS["MPTC2"]):
        # the rule best takes the duty by the length, and the one by the torque
        chosen = [rows.by_length(k) for k in np.flatnonzero((rows.pairs == code) & rows.best())]
        assert min(sum(chosen), len(chosen) - sum(chosen)) >= 8
    pairs = {name: got[rows.pairs == code] for name, code in FAMILY_METHODS.items()}
    assert ((pairs["GTV"][:, 6] % 7) != 0).sum() >= 5  # pairs of two active vectors
    assert ((pairs["MPFC2"][:, 5] % 7) == 0).sum() >= 10  # after zero voltage
    assert ((pairs["MPC2"][:, 5] % 7) == 0).sum() >= 2  # the second vector first
    assert (pairs["MPC2"][:, 5] == pairs["MPC2"][:, 7]).sum() >= 10  # one vector alone
    assert set(pairs["MPFC3"][:, 6].tolist()) == {0, 7}


def test_clocks_are_those_of_the_program() -> None:
    for name, clocks in cycles.FAMILY.items():
        assert clocks_of("mptc_family_core", name.lower()) == clocks
    for name, clocks in cycles.BEST.items():
        assert clocks_of("mptc_family_core", f"{name.lower()}_best") == clocks


FAULTS = {
    "mean": ("mptc_shares", "less    <= step(0);", "less    <= '0';"),
    "mean of a pair": ("mptc_shares", "whole   <= found.second;", 'whole   <= "000";'),
    "span's sign": (
        "mptc_pair_stream",
        "span  <= total xor (error_t'range => sign_of(total));",
        "span  <= total;",
    ),
    "error's sign": (
        "mptc_pair_stream",
        "left <= total xor (error_t'range => falls xor mean);",
        "left <= total xor (error_t'range => mean);",
    ),
    "second vector": ("mptc_pair_stream", "opposed xor slot(0));", "opposed);"),
    "whole period": ("mptc_pair_stream", "(others => known_late(0));", "(others => '0');"),
    "duty within": (
        "mptc_pair_stream",
        "bits when has_duty = '1' else",
        "bits when has_duty = '0' else",
    ),
    "long times": ("mptc_controller", "fitted(running);", "running;"),
    "flag of long times": (
        "mptc_controller",
        "(far and method(2)) or long;",
        "(far and method(2));",
    ),
    "longer by an LSB": (
        "mptc_types",
        "bits(HEXAGON_FRACTION - 1 downto 0) /= 0)",
        "bits(HEXAGON_FRACTION - 1 downto 1) /= 0)",
    ),
    "last bit": ("mptc_duty", "found <= bits & one when", "found <= bits & '0' when"),
    "second bit": ("mptc_duty", "& one & next_one;", "& one & one;"),
    "subtraction": (
        "mptc_duty",
        "remains <= trial(mptc_rest_t'range);",
        "remains <= shift_left(rest, 1);",
    ),
    "two bits at once": ("mptc_duty", "remains <= behind_1;", "remains <= behind_0;"),
    "three times the span": ("mptc_duty", "early_t'length), 1);", "early_t'length), 0);"),
    "flux": ("mptc_vector_stream", "step_y  := sum_beta(", "step_y  := sum("),
    "pairs": (
        "mptc_constants",
        "(2, 3, 1, 0),\n    (3, 4, 2, 0),",
        "(2, 3, 1, 0),\n    (3, 4, 1, 0),",
    ),
    "complement": (
        "mptc_pair_stream",
        "level <= shift_left(step, DUTY_SHIFT) - complement;",
        "level <= shift_left(step, DUTY_SHIFT);",
    ),
    "mean torque": ("mptc_pair_stream", "falls xor mean);", "falls);"),
    "torque at k+1": (
        "mptc_datapath",
        "TERM_OPENING) <= terms(TERM_LEVEL) - wide;",
        "TERM_OPENING) <= wide;",
    ),
    "complement of the mean": (
        "mptc_pair_stream",
        "complement := shift_left(complement, 1);",
        "complement := shift_left(complement, 2);",
    ),
    "direction by the mean": (
        "mptc_pair_stream",
        "given.direction when slot(0) = '1' or mean = '1' else",
        "given.direction when slot(0) = '1' else",
    ),
    "limits by the mean": (
        "mptc_pair_stream",
        "(sign_of(trial) xnor mean) or without;",
        "(not sign_of(trial)) or without;",
    ),
    "root": (
        "mptc_duty",
        "shift_left(resize(sum, TRIAL_WIDTH), 1)",
        "resize(sum, TRIAL_WIDTH)",
    ),
    "root times span": (
        "mptc_duty",
        "if (one = '1') then\n          sum",
        "if (mean = '1') then\n          sum",
    ),
    "halves of a root": ("mptc_duty", "unit <= shift_right(unit, 1);", "unit <= unit;"),
    "one bit of a root": ("mptc_duty", "remains <= shift_left(rest, 1);", "null;"),
    "bit behind a zero": ("mptc_duty", "remains <= behind_0;", "null;"),
    "bit behind a one": ("mptc_duty", "remains <= behind_1;", "null;"),
    "search for two": (
        "mptc_pair_stream",
        "and not pair_2.probe and wanted and (",
        "and not pair_2.probe and (",
    ),
    "which search": (
        "mptc_pair_stream",
        "if (known_read(3) = '1') then",
        "if (known_read(3) = '0') then",
    ),
    "pause of a root": ("mptc_pair_stream", "slot(4 downto 1) - ROOT_PAUSE;", "slot(4 downto 1);"),
    "what is known of a root": ("mptc_pair_stream", "- ROOT_BEHIND when", "- QUOTIENT_BEHIND when"),
    "pair without a search": (
        "mptc_pair_stream",
        "pair_2.there and not (pair_2.probe and is_duty);",
        "pair_2.there and not pair_2.probe;",
    ),
    "vectors of more torque": (
        "mptc_pair_stream",
        "((sign_of(trial) xor falls)",
        "((sign_of(trial))",
    ),
    "first crossed pair": (
        "mptc_pair_stream",
        "place_of(crossed, false)",
        "place_of(crossed, true)",
    ),
    "last crossed pair": (
        "mptc_pair_stream",
        "place_of(crossed, true)",
        "place_of(crossed, false)",
    ),
    "tie of pairs": (
        "mptc_vector_stream",
        "signed('0' & tried.rank & '0') <",
        "signed('0' & not tried.rank & '0') <",
    ),
    "rule": ("mptc_sequencer", "FAMILY_MPTC1 or family_method = FAMILY_MPTC2);", "FAMILY_MPTC1);"),
    "length without voltage": (
        "mptc_pair_stream",
        "base  <= resize(far, ERROR_WIDTH) when lengthwise = '1' else",
        "base  <= shift_left(resize(far, ERROR_WIDTH), 1) when lengthwise = '1' else",
    ),
    "length of another vector": (
        "mptc_pair_stream",
        "unsigned(given.direction) + LENGTH_LATENCY",
        "unsigned(given.second) + LENGTH_LATENCY",
    ),
    "sign of a length": (
        "mptc_vector_stream",
        "signed(distance xor (word_t'range => short and to_std_logic(FAMILY)))",
        "signed(distance)",
    ),
    "lengths of pairs": (
        "mptc_vector_stream",
        "length.take  <= length_valid and to_std_logic(stream /= 0);",
        "length.take  <= length_valid;",
    ),
    "difference of lengths": ("mptc_pair_stream", "opposed <= '1';", "opposed <= '0';"),
    "which length is searched": (
        "mptc_constants",
        "(2, 0),\n    (3, 1),",
        "(2, 0),\n    (3, 0),",
    ),
    "which search of MPTC1": (
        "mptc_pair_stream",
        "result.other  := nth(0);",
        "result.other  := '0';",
    ),
    "lead of MPTC1": ("mptc_sequencer", "PAIR_ADDRESS + MPTC1_LEAD;", "PAIR_ADDRESS;"),
    "vector of MPTC1": ("mptc_pair_stream", "given.direction <= leader;", "null;"),
    "torque along": (
        "mptc_datapath",
        "<= not word_of(terms(TERM_ALONG));",
        "<= word_of(terms(TERM_ALONG));",
    ),
    "torque that is left": (
        "mptc_pair_stream",
        "product(TERM_SHIFT + TERM_WIDTH - 1 downto TERM_SHIFT)",
        "product(TERM_SHIFT + TERM_WIDTH - 2 downto TERM_SHIFT - 1)",
    ),
    "seed of a cost": (
        "mptc_vector_stream",
        "choose(FAMILY, STREAM_TERM_FAMILY, STREAM_TERM)",
        "STREAM_TERM",
    ),
    "costs of MPTC1's duties": ("mptc_vector_stream", "or (pair_length and not pairs);", ";"),
    "duty of MPTC1": (
        "mptc_pair_stream",
        "method = FAMILY_MPTC1 and both_duties = '0' else",
        "method = FAMILY_MPTC1 else",
    ),
    "zero beside a length's duty": (
        "mptc_pair_stream",
        'if (winner(2 downto 1) = "00") then',
        'if (winner(2 downto 0) = "000") then',
    ),
    "zero": (
        "mptc_pair_stream",
        "zero := (others => zero_is_u_7(winner(5 downto 3)));",
        "zero := (others => '0');",
    ),
    "cheapest pair": (
        "mptc_vector_stream",
        "(tried.compare or (not pairs and to_std_logic(stream /= 0)))",
        "(tried.compare or pairs or (not pairs and to_std_logic(stream /= 0)))",
    ),
    "pairs in order": ("mptc_pair_stream", "= '1' and cheaper = '1') then", "= '1') then"),
    "zero for MPTC1": (
        "mptc_vector_stream",
        "and not to_std_logic(method = FAMILY_MPTC1 and stream = STREAM_LAST)",
        "",
    ),
    "end": ("mptc_sequencer", "address = LAST_MPTC2 - 1 and", "address = LAST_MPTC2 - 2 and"),
    "result": (
        "mptc_controller",
        "to_std_logic(method = FAMILY_NONE);",
        "to_std_logic(method = FAMILY_NONE or method = FAMILY_MPTC1);",
    ),
    "quotient": ("mptc_quotient", "QUOTIENT_RANGE - 1);", "QUOTIENT_RANGE);"),
    "halving": ("mptc_coordinates", "clock < HALVINGS)", "clock < HALVINGS - 1)"),
    "far": ("mptc_controller", "or (far and method(2))", ""),
    "sign of e": ("mptc_coordinates", "negative_y <= not sum_beta", "negative_y <= sum_beta"),
    "turn": ("mptc_coordinates", "e.h     <= turned_h;", "e.h     <= e.g;"),
    "turn of a sum": ("mptc_coordinates", "e.total <= e.h;", "e.total <= e.g;"),
    "sum of e": ("mptc_choices", "to_std_logic(wanted = SUM_APART));", "'0');"),
    "sector of SVM": ("mptc_coordinates", "not sign_of(e.h) and (sign_of", "(sign_of"),
    "nothing missing": ("mptc_coordinates", "(sign_of(turned_h) or none)", "sign_of(turned_h)"),
    "share of SVM": ("mptc_coordinates", "CHOICE_CLOCK + TIME_WIDTH));", "CHOICE_CLOCK + 11));"),
    "nearest of MPC2": (
        "mptc_coordinates",
        "not sign_of(apart) and not",
        "not sign_of(apart) or not",
    ),
    "edge": (
        "mptc_choices",
        "shift_left(resize(form, WAY_BITS), 1) + 2 ** (WHOLE_BIT - 1);",
        "shift_left(resize(form, WAY_BITS), 1) + 2 ** (WHOLE_BIT - 2);",
    ),
    "opposite spoke": ("mptc_choices", 'or turn = "011" or turn = "100"', 'or turn = "011"'),
    "residue": ("mptc_choices", "moved(fine, taken, '1')", "moved(fine, taken, '0')"),
    "inside": ("mptc_choices", "if (held = KIND_INSIDE) then", "if (later = '0') then"),
    "full": ("mptc_choices", "full <= beyond_total;", "full <= '0';"),
    "turns": ("mptc_choices", "row & next_number", 'row & "001"'),
    "tie of choices": ("mptc_choices", "0)) < least)", "0)) <= least)"),
    "choices of MPC2": ("mptc_choices", "SLOTS_BEHIND + NEAR_CHOICES)", "SLOTS_BEHIND + CHOICES)"),
    "last vector": (
        "mptc_hexagon",
        "elsif (unsigned(given.t2) /= 0) then",
        "elsif (unsigned(given.t1) /= 0) then",
    ),
    "zero between": (
        "mptc_hexagon",
        "zero_is_u_7(row) and zero_is_u_7(best.other)",
        "zero_is_u_7(row)",
    ),
    "order of MPC2": (
        "mptc_choices",
        "(from_leader and not from_ended) /=",
        "(from_leader and from_ended) /=",
    ),
    "third": ("mptc_hexagon", "downto 0 => sign_of(e.h))", "downto 0 => '0')"),
    "way": ("mptc_sequencer", "(FIRST_WAY + 1) * ENTRY", "FIRST_WAY * ENTRY"),
    "fork": ("mptc_sequencer", "address = HEXAGON_FORK - 1", "address = HEXAGON_FORK"),
    "left of the period": ("mptc_hexagon", "WHOLE_PERIOD) - size_h;", "WHOLE_PERIOD);"),
    "reference counts twice": ("mptc_datapath", "doubled  <= brief;", "doubled  <= '0';"),
    "half of the root": (
        "mptc_datapath",
        "shift_right(results(RESULT_ROTOR_BETA), 1), SUM_WIDTH);",
        "shift_right(results(RESULT_ROTOR_BETA), 16), SUM_WIDTH);",
    ),
    "torque reference below its word": (
        "mptc_datapath",
        "guard <= sums(WORD_WRITES(i, 1))(FRACTION - 1 downto FRACTION - MOMENT_GUARD);",
        "guard <= (others => '0');",
    ),
    "torque reference rounded": ("mptc_datapath", "to_round <= '1';", "to_round <= '0';"),
    "powerless": ("mptc_datapath", "unsigned(sample.v_dc) = 0", "unsigned(sample.v_dc) = 7"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found_with_several_vectors(name: str, tmp_path: Path) -> None:
    where, old, new = FAULTS[name]
    rtl = altered(tmp_path, where, old, new)
    if name == "nothing missing":
        rows = mptc_pairs.nothing_missing()
    elif name == "powerless":
        rows = mptc_pairs.hardly_any_voltage(seed=7, n=10)
    elif name == "longer by an LSB":
        rows = mptc_pairs.longer_by_an_lsb()
    else:  # few rows find most faults
        rows = mptc_pairs.together(
            *(
                part
                for n in (3, 16)
                for part in (mptc_pairs.mixed(seed=5, n=n), mptc_pairs.near(seed=6, n=2 * n))
            )
        )
    expected = rows.expected()
    got = ghdl(rows, rtl, expected)
    assert np.any(got != expected[: len(got)])


def resets(rtl: Path = RTL) -> Outcome:
    return run(
        "mptc_core_bench",
        "tb.rtl.mptc.mptc_core.bench_mptc_family_reset",
        units=["mptc_core", "mptc_family_core"],
        files=[rtl_simulation.BENCH],
        generics={"FLUX_CONTROL": "true", "FAMILY": "true"},
        rtl=rtl,
        timeout=900,
    )


def test_a_reset_leaves_no_search_behind() -> None:
    assert resets().checks["decision"] == 787


def full_speed(rtl: Path = RTL, *, mixed: int = 40, near: int = 70, powerless: int = 15) -> Outcome:
    return run(
        "mptc_family_core",
        "tb.rtl.mptc.mptc_core.bench_mptc_family_full_speed",
        arguments={"mixed": mixed, "near": near, "powerless": powerless},
        rtl=rtl,
        timeout=900,
    )


def test_no_decision_goes_on_into_the_next() -> None:
    assert full_speed().checks["decision"] == 995


def test_a_pair_that_goes_on_into_the_next_decision_is_found(tmp_path: Path) -> None:
    rtl = altered(
        tmp_path,
        "mptc_pair_stream",
        "if (rst = '1' or last = '1') then\n        ended    <= '0';",
        "if (rst = '1') then\n        ended    <= '0';",
    )
    with pytest.raises(CheckError, match="decision"):
        full_speed(rtl, mixed=8, near=12, powerless=4)
