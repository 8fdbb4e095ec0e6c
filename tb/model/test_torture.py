"""The bit-true twins against slow second writings of their decisions, as `make torture` does it.

Sweep: MPDCC by both deadlock rules and both outside rules; MPTC and MPFC; shipped and random
drives, parameters of any content.
Stimulus: 32 blocks of 256 states and 24 of 1024: near the references, over the specified ranges
and beyond them, any words, words at the rails; every position s(k-1) and every vector.
Checks: MPDCC's decisions in every field; the vectors of MPTC and MPFC within what rounding
explains; the slow writing of MPDCC against a third one, tb/helpers/plain.py; a run that goes on
where it was stopped.
Faults: one LSB of a bound, another position, a difference that wraps, a weight half as large
again, the speed turned over, a torque 3 % off, the other zero vector. Each is found.
Does not prove: two switchings, the prediction of k + 1, methods of several vectors.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from directmpc.mpdcc.coefficients import INDEX
from directmpc.mptc import bit_true as mptc_twin
from directmpc.mptc.coefficients import COEFFICIENTS, registers
from scripts.commands.torture import cli
from scripts.shared.tools import ToolError
from scripts.studies.torture import blocks, mpdcc, mptc, run
from tb.helpers import plain, plain_states

SEED = 11


def test_every_decision_of_mpdcc_is_the_slow_ones() -> None:
    seen: Counter[str] = Counter()
    for number in range(32):
        found = blocks.run_mpdcc(number, SEED, 256)
        assert found.listed == (), f"block {number}: {found.kind}"
        seen.update(found.counts)
    assert seen["decisions"] == 32 * 256
    assert seen["differing"] == 0
    for what in ("hold", "search", "deadlock", "saturated"):
        assert seen[what] >= 200, what
    for what in ("tie of costs", "leaves before it turns", "starts outside and returns"):
        assert seen[what] >= 20, what


def test_the_slow_decision_is_that_of_a_third_writing() -> None:
    compared = 0
    for number in range(32):
        block = blocks.mpdcc_block(number, SEED + 1, 512)
        some = np.arange(0, 512, 171)
        slow = mpdcc.decide(block.register, block.measurements[some], block.s_prev[some])
        limits = plain_states.plain_limits(block.register)
        for row, s_prev, told in zip(
            block.measurements[some], block.s_prev[some], slow.decision, strict=True
        ):
            node = plain_states.plain_node(block.register, row, "fast")
            wanted = plain.decide(node, limits, [int(s) for s in s_prev], "fast")
            assert tuple(int(v) for v in told) == tuple(int(v) for v in wanted)
            compared += 1
    assert compared == 96


def test_every_position_and_vector_is_a_start() -> None:
    s_prev = blocks.mpdcc_block(3, SEED, 1024).s_prev
    assert (np.unique(s_prev @ [64, 8, 1], return_counts=True)[1] == 2).all()
    assert (np.bincount(blocks.mptc_block(3, SEED, 1024).u) == 128).all()


def test_two_switchings_are_refused() -> None:
    block = blocks.mpdcc_block(0, SEED, 4)
    block.register[INDEX["two_switchings"]] = 1
    with pytest.raises(ValueError, match="one switching"):
        mpdcc.decide(block.register, block.measurements, block.s_prev)


def test_every_vector_of_mptc_and_mpfc_is_within_rounding() -> None:
    seen: Counter[str] = Counter()
    for number in range(24):
        found = blocks.run_mptc(number, SEED, 1024)
        assert found.listed == (), f"block {number}: {found.kind}"
        assert found.worst <= 1
        seen.update(found.counts)
    for method in blocks.METHODS:
        assert seen[f"judged, {method}"] >= 6000
        for vector in range(8):
            assert seen[f"u_{vector}, {method}"] >= 20
    assert seen["clamped, MPFC"] >= 500
    assert seen["saturated"] >= 500


# --- faults ---------------------------------------------------------------------------------------


def _wider(register: np.ndarray, measurements: np.ndarray, s_prev: np.ndarray) -> np.ndarray:
    changed = register.copy()
    changed[INDEX["bound_current"]] += 1
    return blocks.twin_of_mpdcc(changed, measurements, s_prev)


def _wraps(register: np.ndarray, measurements: np.ndarray, s_prev: np.ndarray) -> np.ndarray:
    # what a difference of two 16-bit words is that wraps
    changed = measurements.copy()
    difference = changed[:, 9] - changed[:, 0]
    changed[:, 9] -= difference - ((difference + 2**15) % 2**16 - 2**15)
    return blocks.twin_of_mpdcc(register, changed, s_prev)


def _other(register: np.ndarray, measurements: np.ndarray, s_prev: np.ndarray) -> np.ndarray:
    # another position in some of the rows
    told = blocks.twin_of_mpdcc(register, measurements, s_prev)
    told[::5, 0] ^= told[::5, 5] & 1
    return told


@pytest.mark.parametrize("twin", [_wider, _wraps, _other], ids=["bound", "wraps", "choice"])
def test_a_fault_is_found_in_mpdcc(twin: blocks.MpdccTwin) -> None:
    found = [blocks.run_mpdcc(number, SEED, 1024, twin) for number in (0, 1, 2, 3, 9, 22)]
    assert sum(one.counts["differing"] for one in found) >= 1
    assert any(one.listed for one in found)


def _changed(name: str, factor: float) -> blocks.MptcTwin:
    def twin(drive, measurements, u):
        register = registers(drive).array()
        place = COEFFICIENTS.index(name)
        register[place] = int(register[place] * factor)
        out = np.empty((len(u), 3), dtype=np.int64)
        mptc_twin.run_words(register, measurements, u, out)
        return out

    return twin


def _other_zero(drive, measurements, u):
    told = blocks.twin_of_mptc(drive, measurements, u)
    told[:, 0] = np.where(told[:, 0] == 0, 7, told[:, 0])
    return told


@pytest.mark.parametrize(
    "twin",
    [_changed("weight", 1.5), _changed("speed", -1.0), _changed("torque", 0.97), _other_zero],
    ids=["weight", "speed", "torque", "zero vector"],
)
def test_a_fault_is_found_in_mptc(twin: blocks.MptcTwin) -> None:
    found = [blocks.run_mptc(number, SEED, 2048, twin) for number in (0, 1, 8, 9)]
    assert sum(one.counts["differing"] for one in found) >= 3


# --- a run ----------------------------------------------------------------------------------------


class _Here:
    """Workers that are this process."""

    called: ClassVar[list[tuple[str, int]]] = []

    def __init__(self, *_: object) -> None:
        pass

    def __enter__(self) -> _Here:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def each(self, what, function, arguments) -> Iterator[tuple[int, blocks.Outcome]]:
        for n, one in enumerate(arguments):
            self.called.append(one[:2])
            yield n, function(*one)


def test_a_run_goes_on_where_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run, "Pool", _Here)
    path = tmp_path / "torture.json"
    one = 2 * blocks.ROWS
    _Here.called.clear()
    assert cli.main(["--decisions", str(one), "--out", str(path)]) == 0
    assert cli.main(["--decisions", str(2 * one), "--out", str(path)]) == 0
    assert _Here.called == [("mpdcc", 0), ("mptc", 0), ("mpdcc", 1), ("mptc", 1)]
    assert f"mpdcc: {one} decisions, 0 differ" in capsys.readouterr().out
    document = json.loads(path.read_text(encoding="utf-8"))
    text = run.markdown(document)
    assert f"{2 * one:,}" in text
    with pytest.raises(ToolError, match="seed 1"):
        run.run(one, 2, 1, path)


def test_a_difference_ends_with_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run, "Pool", _Here)
    monkeypatch.setitem(
        run._RUN, "mpdcc", lambda number, seed: blocks.run_mpdcc(number, seed, 512, _other)
    )
    path = tmp_path / "torture.json"
    assert cli.main(["--decisions", "10", "--out", str(path)]) == 1
    assert "torture: mpdcc: block 0, state" in capsys.readouterr().err


def test_zero_voltage_has_the_number_of_fewer_commutations() -> None:
    assert mptc.zero_from(np.arange(8)).tolist() == [0, 0, 7, 0, 7, 0, 7, 7]
