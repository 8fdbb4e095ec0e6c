"""Traces and decisions: round trips, strict reading, all-or-nothing writing."""

from __future__ import annotations

import os
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.trace import (
    Decisions,
    MpdccTrace,
    TraceError,
    read_decisions,
    read_trace,
    write_decisions,
    write_trace,
)

HEADER = (
    "is_alpha,is_beta,psir_alpha,psir_beta,v_n,v_ph_a,v_ph_b,v_ph_c,"
    "iref_alpha,iref_beta,omega_s,omega_r,s_a,s_b,s_c"
)
ROW = "1.0,-.5,0.9,1e-3,+0.01,0.5,0.5,5e-1,1,0,1.0,0.99,0,3,7"
QUOTED = ",".join(f'"{field}"' for field in ROW.split(","))


@pytest.fixture
def trace() -> MpdccTrace:
    rng = np.random.default_rng(4)
    n = 50
    return MpdccTrace(
        x_m=rng.standard_normal((n, 4)),
        x_inv=rng.standard_normal((n, 4)) * 1e-20,
        vdc=rng.uniform(1.5, 2.5, n),
        iref=rng.standard_normal((n, 2)) * 1e20,
        omega_s=rng.standard_normal(n),
        omega_r=rng.standard_normal(n),
        s_prev=rng.integers(0, 8, (n, 3)),
    )


@pytest.fixture
def decisions() -> Decisions:
    return Decisions(
        s=np.array([[0, 1, 2], [7, 6, 5]]),
        held=np.array([1, 0]),
        deadlock=np.array([0, 1]),
        length=np.array([0, 63]),
        cycles=np.array([10, 77]),
        saturated=np.array([0, 1]),
    )


@pytest.mark.parametrize("exhausted", [None, [1, 0]])
def test_exhausted_is_a_column_where_somebody_tells(
    exhausted: list[int] | None, decisions: Decisions, tmp_path: Path
) -> None:
    path = tmp_path / "decisions.csv"
    told = None if exhausted is None else np.array(exhausted)
    write_decisions(path, replace(decisions, exhausted=told))
    assert path.read_text().splitlines()[0].endswith("saturated" if told is None else ",exhausted")
    read = read_decisions(path).exhausted
    assert (None if read is None else read.tolist()) == exhausted


def same(left: object, right: object) -> bool:
    return all(np.array_equal(getattr(left, f.name), getattr(right, f.name)) for f in fields(left))


def test_trace_round_trip_is_exact(trace: MpdccTrace, drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "trace.csv"
    write_trace(path, trace)
    assert same(read_trace(path, drive), trace)
    assert path.read_text().startswith(HEADER + ",v_dc\n")
    assert len(trace.rows(slice(3, 8))) == 5


def test_columns_in_any_order_and_default_dc_link(drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "trace.csv"
    names, values = HEADER.split(","), ROW.split(",")
    path.write_bytes(f"{HEADER}\n{ROW}\n{ROW}".encode())
    plain = read_trace(path, drive)
    assert plain.vdc.tolist() == [2.0, 2.0]
    assert plain.x_m[0].tolist() == [1.0, -0.5, 0.9, 1e-3]
    assert plain.s_prev[1].tolist() == [0, 3, 7]
    order = np.random.default_rng(0).permutation(len(names))
    shuffled = [",".join(line[i] for i in order) for line in (names, values, values)]
    path.write_bytes("\r\n".join([*shuffled, ""]).encode("utf-8-sig"))
    assert same(read_trace(path, drive), plain)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", ["line 1", "empty", "is_alpha"]),
        (HEADER, ["line 2", "no row"]),
        (HEADER + "\n", ["line 2", "no row"]),
        (ROW + "\n" + ROW, ["line 1, column 1", '"1.0"', "is_alpha"]),
        (HEADER.replace("v_n", "vn") + "\n" + ROW, ["line 1, column 5", '"vn"', "v_n"]),
        (HEADER.replace("v_n", " v_n") + "\n" + ROW, ["line 1, column 5", '" v_n"']),
        (HEADER.replace("v_n", "is_beta") + "\n" + ROW, ["line 1, column 5", "twice"]),
        (HEADER.replace(",s_c", "") + "\n" + ROW, ["line 1", "s_c", "missing"]),
        (HEADER + ",time\n" + ROW + ",0", ["line 1, column 16", '"time"', "v_dc?"]),
        (HEADER + ",v_dc\n" + ROW, ["line 2, column 16 (v_dc)", "missing", "15 fields"]),
        (f"{HEADER}\n{ROW}\n{ROW[:-2]}", ["line 3, column 15 (s_c)", "missing", "14 fields"]),
        (f"{HEADER}\n{ROW}\n{ROW},1", ["line 3, column 16", "unexpected", "16 fields"]),
        (f"{HEADER}\n{ROW}\n\n{ROW}", ["line 3, column 1 (is_alpha)", '""', "finite"]),
        (f"{HEADER}\nx{ROW}", ["line 2, column 1 (is_alpha)", '"x1.0"', "a finite number"]),
        (f"{HEADER}\n{ROW.replace('1e-3', 'nan')}", ["line 2, column 4", "psir_beta", "finite"]),
        (f"{HEADER}\n{ROW.replace('1e-3', 'inf')}", ["line 2, column 4", "finite"]),
        (f"{HEADER}\n{ROW.replace('1e-3', '1e999')}", ["line 2, column 4", "1e999", "finite"]),
        (f"{HEADER}\n{ROW.replace('1e-3', '1_0')}", ["line 2, column 4", "1_0"]),
        (f"{HEADER}\n{ROW.replace('1e-3', ' 1')}", ["line 2, column 4", '" 1"']),
        (f"{HEADER}\n{ROW.replace('1e-3', '0x1')}", ["line 2, column 4", "0x1"]),
        (f"{HEADER}\n{ROW}\n{ROW[:-1]}8", ["line 3, column 15 (s_c)", '"8"', "0 to 7"]),
        (f"{HEADER}\n{ROW[:-1]}-1", ["line 2, column 15 (s_c)", "0 to 7"]),
        (f"{HEADER}\n{ROW}.5", ["line 2, column 15 (s_c)", '"7.5"', "an integer from 0 to 7"]),
        (f"{HEADER}\n{ROW[:-1]}6.001e+00", ["line 2, column 15 (s_c)", "an integer from 0 to 7"]),
        (f"{HEADER}\n{ROW[:-1]}8.0", ["line 2, column 15 (s_c)", '"8.0"', "0 to 7"]),
        (f"{HEADER}\n{ROW[:-1]}", ["line 2, column 15 (s_c)", '""']),
        (f"{HEADER}\n{ROW[:-1]}{'9' * 60}", ["line 2, column 15 (s_c)", "9...", "0 to 7"]),
        (f"{HEADER}\n{ROW};{ROW}", ["line 2, column 15 (s_c)", "the separator must be a comma"]),
        (
            f"{HEADER};\n{ROW}\n".replace(",", ";"),
            ["line 1", "separator of the fields is semicolons", "must be a comma"],
        ),
        (
            f"{HEADER}\n{ROW}\n".replace(",", ";").replace(".", ","),
            ["line 1", "semicolons", "separator must be a comma", "decimal point"],
        ),
        (f"{HEADER}\n{ROW}\n".replace(",", "\t"), ["line 1", "tabs", "must be a comma"]),
        (f"{HEADER}\n{ROW}\n".replace(",", "  "), ["line 1", "blanks", "must be a comma"]),
        (f"{HEADER}\n0,5,1,25{ROW[3:].replace('.', ',')}", ["line 2", "decimal point"]),
        (f"{HEADER}\n{QUOTED.replace('1e-3', '0,5')}", ["line 2, column 4", '"0,5"', "point"]),
        (f'{HEADER}\n"{ROW}', ["line 2", "quoted field does not end"]),
        (f"{HEADER}\n{ROW}\n\udcff", ["line 3", "not UTF-8"]),
    ],
)
def test_bad_traces(drive: Drive, tmp_path: Path, text: str, named: list[str]) -> None:
    path = tmp_path / "bad.csv"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(TraceError) as caught:
        read_trace(path, drive)
    for part in [str(path), *named]:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        f"{HEADER}\n{QUOTED}\n",
        ",".join(f'"{name}"' for name in HEADER.split(",")) + f"\r\n{QUOTED}\r\n",
        f"{HEADER}\n{ROW}\n\n",
        f"{HEADER}\r\n{ROW}\r\n\r\n  \r\n",
        f"{HEADER}\n{ROW.replace(',0,3,7', ',0.0,3.,7.000e+00')}\n",
        f"\ufeff{HEADER}\n{QUOTED.replace('7', '0.7e1')}\n",
    ],
)
def test_what_other_programs_write_is_read(drive: Drive, tmp_path: Path, text: str) -> None:
    plain, path = tmp_path / "plain.csv", tmp_path / "other.csv"
    plain.write_text(f"{HEADER}\n{ROW}\n", encoding="utf-8")
    path.write_bytes(text.encode())
    assert same(read_trace(path, drive), read_trace(plain, drive))


def test_unreadable_trace(drive: Drive, tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="cannot be read"):
        read_trace(tmp_path / "none.csv", drive)


@pytest.mark.parametrize("clocked", [True, False])
def test_decisions_round_trip(decisions: Decisions, tmp_path: Path, clocked: bool) -> None:
    written = decisions if clocked else replace(decisions, cycles=None)
    path = tmp_path / "decisions.csv"
    write_decisions(path, written)
    cycles = ("10", "77") if clocked else ("", "")
    assert path.read_text() == (
        "s_a,s_b,s_c,held,deadlock,length,cycles,saturated\n"
        f"0,1,2,1,0,0,{cycles[0]},0\n7,6,5,0,1,63,{cycles[1]},1\n"
    )
    assert same(read_decisions(path), written)


@pytest.mark.parametrize(
    ("rows", "named"),
    [
        ("0,0,0,2,0,0,,0", ["line 2, column 4 (held)", "0 to 1"]),
        ("0,0,0,0,0,64,,0", ["line 2, column 6 (length)", "0 to 63"]),
        ("0,0,0,0,0,1,7,0\n0,0,0,0,0,1,,0", ["line 3, column cycles", "every row"]),
        ("0,0,0,0,0,1,x,0", ["line 2, column 7 (cycles)", "empty or an integer"]),
    ],
)
def test_bad_decisions(tmp_path: Path, rows: str, named: list[str]) -> None:
    path = tmp_path / "bad.csv"
    path.write_text("s_a,s_b,s_c,held,deadlock,length,cycles,saturated\n" + rows)
    with pytest.raises(TraceError) as caught:
        read_decisions(path)
    for part in [str(path), *named]:
        assert part in str(caught.value)


def test_writing_replaces_a_file_and_leaves_nothing_else(
    decisions: Decisions, tmp_path: Path
) -> None:
    path = tmp_path / "decisions.csv"
    path.write_text("old")
    write_decisions(path, decisions)
    assert os.listdir(tmp_path) == ["decisions.csv"]
    assert len(read_decisions(path)) == 2


def test_failed_writing_leaves_nothing(
    decisions: Decisions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = tmp_path / "folder.csv"
    taken.mkdir()
    with pytest.raises(TraceError, match="cannot be written"):
        write_decisions(taken, decisions)
    with pytest.raises(TraceError, match="cannot be written"):
        write_decisions(tmp_path / "none" / "decisions.csv", decisions)
    old = tmp_path / "old.csv"
    old.write_text("old")

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_decisions(old, decisions)
    assert sorted(os.listdir(tmp_path)) == ["folder.csv", "old.csv"]
    assert old.read_text() == "old"


def test_a_row_that_cannot_be_written_leaves_nothing(decisions: Decisions, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="shorter"):
        write_decisions(tmp_path / "x.csv", replace(decisions, cycles=np.array([1])))
    assert os.listdir(tmp_path) == []
