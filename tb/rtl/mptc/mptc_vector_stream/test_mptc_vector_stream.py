"""Fluxes that are too long for the magnitude, in a core with methods of several vectors.

Stimulus: stator fluxes near the corners of their words, of which nothing but the length of a vector
or of a pair does not fit; MPTC, MPTC1, MPTC2 and GTV with every duty rule.
Checks: each decision and its flags are the twin's.
Timing: that of ``test_mptc_family``.
Does not prove: fluxes that fit; the benches of the core have them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from directmpc.mptc import bit_true
from directmpc.mptc.inverter import STATES
from scripts.hdl.mptc_job import FAMILY_METHODS
from tb.helpers import mptc_rows as core
from tb.helpers.faults import altered
from tb.helpers.mptc_pairs import PairRows
from tb.rtl.mptc.mptc_core.test_mptc_family import ghdl

METHODS = (0, *(FAMILY_METHODS[name] for name in ("MPTC1", "MPTC2", "GTV")))


def fits(register: np.ndarray, m: np.ndarray, applied: np.ndarray) -> bool:
    """Whether everything fits but lengths: the state at k+2, and the torque's terms."""
    c = bit_true.words(register)
    u1, *_ = (int(u) for u in applied[:3])
    alpha = bit_true.VECTOR_ALPHA[u1] << (bit_true._FRACTION - 2)
    beta = bit_true.VECTOR_BETA[u1] << (bit_true._FRACTION - 1)
    o = bit_true.outlook(c, m, alpha, beta)
    return not (o.saturated or bit_true.torque_terms(c, o)[4])


def too_long(seed: int, count: int) -> PairRows:
    """Rows in which a length overflows, and nothing else; the rest of the flux is any."""
    rng = np.random.default_rng(seed)
    register = core.registers(core.shipped("induction_2kw2").with_control(method="MPTC")).array()
    found: list[tuple[np.ndarray, int, np.ndarray, int]] = []
    lengths = 0
    while lengths < count:
        m = core.any_measurements(rng, 1)[0]
        m[0:2] = rng.integers(-400, 401, 2)
        m[2:4] = rng.integers(24_000, 32_600, 2) * rng.choice([-1, 1], 2)
        m[4], m[5] = rng.integers(-3_000, 3_001), rng.integers(0, 20_000)
        m[6:8] = rng.integers(-3_000, 3_001), rng.integers(0, 3_000)
        u = int(rng.integers(0, len(STATES)))
        applied = np.array([u, u, u, 4096, 0])
        if not fits(register, m, applied):
            continue
        method = METHODS[len(found) % len(METHODS)]
        row = (m, method, applied, int(rng.integers(0, 3)))
        flag = rows_of(register, [row]).expected()[0][2]
        lengths += int(flag)
        if flag or rng.random() < 0.1:
            found.append(row)
    return rows_of(register, found)


def rows_of(register: np.ndarray, rows: list[tuple[np.ndarray, int, np.ndarray, int]]) -> PairRows:
    """The rows as the core takes them."""
    m, methods, applied, rules = (np.array(column) for column in zip(*rows, strict=True))
    registers = np.tile(register, (len(rows), 1))
    return PairRows(core.Rows(registers, m, applied[:, 0]), methods, applied, rules)


def decided(rtl: Path | None = None) -> tuple[np.ndarray, np.ndarray, PairRows]:
    """Decisions of the core, up to a wrong one, those of the twin, and the rows."""
    rows = too_long(1, 60)
    expected = rows.expected()
    return ghdl(rows, rtl, wanted=expected), expected, rows


def test_a_length_that_does_not_fit_is_told() -> None:
    got, expected, rows = decided()
    np.testing.assert_array_equal(got, expected[: len(got)])
    assert len(got) == len(rows)
    for method in METHODS:
        assert got[rows.pairs == method, 2].sum() >= 10, method


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("and (to_std_logic(method = FAMILY_NONE or method = FAMILY_MPTC1) or ", "and ("),
        ("both_duties)) or pair_length;", "both_duties));"),
    ],
    ids=["vectors", "pairs"],
)
def test_an_overflow_untold_is_found(old: str, new: str, tmp_path: Path) -> None:
    rtl = altered(tmp_path, "mptc_vector_stream", old, new)
    got, expected, _ = decided(rtl)
    last = len(got) - 1
    # the flag of the first decision that is not the twin's, and nothing else of it
    assert (got[last] != expected[last]).nonzero()[0].tolist() == [2]
