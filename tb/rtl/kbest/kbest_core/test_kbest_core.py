"""The K-best core against its bit-true twin: every decision, every plan, every flag.

Sweep: beam 8 with 12 stages, a beam of 1, 3 and 16; with and without delay compensation; even and
odd periods; registers of both drives that ship.
Stimulus: states near the reference; words of any content, with corners; plans of any codes; every
input random but at start, `start` repeated while busy.
Checks: positions, held, saturated, the next plan and its period, the key, bit for bit.
Timing: no decision takes more clocks than the model says; rows with most children are among them.
Netlist: the converted Verilog does as the VHDL.
Resets: at any clock of a decision; the next one is the twin's.
Faults: one in each file and one in the timing; each must turn the comparison red.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from directmpc.kbest import bit_true
from directmpc.kbest.coefficients import registers
from scripts.hdl import agreement, conversion
from scripts.hdl.clocks import clocks_of
from scripts.hdl.ghdl import CheckError
from scripts.hdl.sources import RTL, compile_order, rtl_files
from tb.helpers.faults import altered
from tb.helpers.simulation import Outcome, run
from tb.model.test_kbest import NAMES, random_rows, row_of, shipped
from tb.model.test_kbest_bit_true import random_words


def rows_of(drive: Any, words: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Inputs with what the twin makes of them."""
    parameters, found = bit_true.parameters_of(drive), registers(drive)
    n = len(words)
    s_prev = rng.integers(0, 8, (n, 3))
    plan = rng.integers(0, 16, (n, found.stages + 1))
    wanted = np.empty((n, 7 + found.stages), np.int64)
    for k in range(n):
        following = np.empty(found.stages + 1, np.int64)
        code, flag, _, cost = bit_true.decide_words(
            parameters, words[k], s_prev[k], plan[k], following
        )
        s = s_prev[k].copy()
        if code:
            x, m = (code - 1) // 3, (code - 1) % 3
            s[x] = parameters.tables.neighbours[s[x], m]
        wanted[k] = [*s, int(code == 0), flag, *following, cost]
    values = np.array(list(found.values.values()))
    return {
        "registers": np.tile(values, (n, 1)), "words": words, "s_prev": s_prev, "plan": plan,
        "wanted": wanted,
    }  # fmt: skip


def inputs(drive: Any, n: int, seed: int) -> dict[str, np.ndarray]:
    """A third near the reference, a third of any words, a third with corners."""
    rng = np.random.default_rng(seed)
    rows = random_rows(rng, n, 0.05)
    near = [bit_true.encode_row(*row_of(rows, k)[:-1])[0] for k in range(n)]
    words = np.concatenate([near, random_words(rng, n, 0.0), random_words(rng, n, 0.5)])
    return rows_of(drive, words, rng)


def bench(
    folder: Path, n: int, *, name: str = NAMES[0], throttled: bool = False, resets: bool = False,
    rtl: Path = RTL, seed: int = 1, rows: dict[str, np.ndarray] | None = None, **settings: Any,
) -> Outcome:  # fmt: skip
    drive = shipped(name, **settings)
    path = folder / "rows.npz"
    np.savez(path, **(rows or inputs(drive, n, seed)))
    found = registers(drive)
    outcome = run(
        "kbest_core",
        "tb.rtl.kbest.kbest_core.bench_kbest_core",
        units=["kbest_core"],
        generics={"BEAM": found.beam, "STAGES": found.stages},
        arguments={"seed": seed, "rows": str(path), "throttled": throttled, "resets": resets},
        rtl=rtl,
    )
    assert outcome.measured["cycles"] <= bit_true.most_clocks(found)
    return outcome


def test_decisions_are_the_twins(tmp_path: Path) -> None:
    found = bench(tmp_path, 6)
    assert found.checks["decision"] == 18
    assert found.covered["saturated"] >= 3
    assert found.covered["held"] >= 1
    assert found.measured["cycles"] <= clocks_of("kbest_core", "decision")


@pytest.mark.parametrize(
    "settings",
    [
        {"name": NAMES[1], "delay_compensation": True},
        {"beam": 1, "short_stages": 1, "long_stages": 3},
        {"beam": 3, "short_stages": 8, "long_stages": 1, "delay_compensation": True},
        {"beam": 16, "long_stages": 16},
    ],
    ids=str,
)
def test_other_configurations(settings: dict[str, Any], tmp_path: Path) -> None:
    found = bench(tmp_path, 3, throttled=True, seed=2, **settings)
    assert found.checks["decision"] == 9


def test_the_longest_decisions_are_in_time(tmp_path: Path) -> None:
    """Rows of all three kinds, those with the most children; the loops have 881 at most."""
    drive = shipped()
    parameters = bit_true.parameters_of(drive)
    rng = np.random.default_rng(9)
    made = [rows_of(drive, random_words(rng, 300, 0.1), rng)]
    near = random_rows(rng, 300, 0.01)
    words = [bit_true.encode_row(*row_of(near, k)[:-1])[0] for k in range(len(near))]
    made.append(rows_of(drive, np.array(words), rng))
    rows = {name: np.concatenate([part[name] for part in made]) for name in made[0]}
    following = np.empty(13, np.int64)
    counts = [
        bit_true.decide_words(parameters, w, s, p, following)[2]
        for w, s, p in zip(rows["words"], rows["s_prev"], rows["plan"], strict=True)
    ]
    most = np.argsort(counts)[-6:]
    assert counts[most[-1]] > 840
    found = bench(tmp_path, 0, rows={name: values[most] for name, values in rows.items()})
    assert found.measured["cycles"] <= clocks_of("kbest_core", "decision")


def test_a_reset_leaves_nothing_behind(tmp_path: Path) -> None:
    found = bench(tmp_path, 4, resets=True, seed=3)
    assert found.covered["reset"] >= 5


@pytest.mark.parametrize(
    ("unit", "old", "new"),
    [
        ("kbest_list", "('0' & left) - ('0' & right)", "('0' & left) - ('0' & right) - 1"),
        ("kbest_list", "leaves <= same and second;", "leaves <= (others => '0');"),
        ("kbest_list", "second(i) <= any(same and front);", "second(i) <= '1';"),
        ("kbest_list", "if (newest(i) = '1') then", "if (newest(i) = '0') then"),
        ("kbest_terms", "(resize(result, charge'length), 1)", "(resize(result, charge'length), 0)"),
        ("kbest_node", "own_code >= 7 and", "own_code >= 8 and"),
        ("kbest_node", "found.keep_w <= sum_w + change;", "found.keep_w <= sum_w - change;"),
        ("kbest_children", "and m < count(", "and m <= count("),
        ("kbest_children", "DRAWN_STEP(s, index) < 0", "DRAWN_STEP(s, index) > 0"),
        ("kbest_core", "t_zero = '0' and (period = '0'", "t_zero = '0' and (period = '1'"),
        ("kbest_core", "w_rank <= v_rank;", "w_rank <= l_rank;"),
        ("kbest_types", "change_e := shift_left(change_e, 1);", "change_e := change_e;"),
    ],
)
def test_faults_are_found(unit: str, old: str, new: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, unit, old, new)
    with pytest.raises(CheckError, match="decision"):
        bench(tmp_path, 8, beam=4, short_stages=2, long_stages=4, rtl=rtl)


def test_the_netlist_does_as_the_vhdl() -> None:
    """Of one plan and two stages: ten decisions or so on any inputs, all outputs in every clock."""
    top, built = "kbest_core", {"BEAM": 1, "STAGES": 2}
    files, netlist = compile_order(top, rtl_files()), conversion.cached(top, built)
    found = agreement.compare(top, built, files, "93", netlist, clocks=1_500)
    assert found.known > 0.8
