"""`make field-bench` and `make field-score`: the score says what was changed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from directmpc.api.drive_file import load_drive
from directmpc.mpdcc import ideal, trace
from scripts.commands import field_bench, field_score
from scripts.studies import field_bench as study

SE, SESE = "mpdcc-6kv-se-full-speed", "mpdcc-6kv-sese-full-speed"
MPTC, GTV = "two-level-mptc", "two-level-gtv"
STEPS = 60


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small bench."""
    out = tmp_path_factory.mktemp("field") / "bench"
    assert field_bench.cli.main(["--out", str(out), "--steps", str(STEPS)]) == 0
    return out


def changed(bench: Path, name: str, path: Path, row: int, fields: dict[str, str]) -> Path:
    """The ideal decisions with some fields of a row replaced."""
    lines = (bench / name / "ideal.csv").read_text(encoding="utf-8").splitlines()
    head, cells = lines[0].split(","), lines[row + 1].split(",")
    for column, value in fields.items():
        cells[head.index(column)] = value
    lines[row + 1] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def candidates(bench: Path, name: str) -> list[list[str]]:
    """Lines of the costs without their header."""
    text = (bench / name / "costs.csv").read_text(encoding="utf-8")
    return [line.split(",") for line in text.splitlines()[1:]]


@pytest.mark.parametrize("name", [SE, SESE])
def test_the_cheapest_candidate_is_the_ideal_decision(bench: Path, name: str) -> None:
    drive = load_drive(bench / name / "drive.toml")
    own = trace.read_decisions(bench / name / "ideal.csv")
    rows = trace.read_trace(bench / name / "trace.csv", drive)
    parameters = ideal.ideal_parameters(drive)
    state = ideal.one_step_on(parameters, rows) if drive.control.delay_compensation else rows
    searched = 0
    for k in range(STEPS):
        held, positions, lengths, costs = ideal.candidates(
            parameters, state.x_m[k], state.x_inv[k], state.vdc[k], state.iref[k],
            state.omega_s[k], state.omega_r[k], state.s_prev[k],
        )  # fmt: skip
        assert held == own.held[k]
        if held:
            continue
        searched += 1
        column = next(i for i in (1, 0, 2) if np.isfinite(costs[:, i]).any())
        best = int(costs[:, column].argmin())
        assert tuple(positions[best]) == tuple(own.s[k])
        assert lengths[best] == own.length[k]
        assert ((lengths == 0) == np.isfinite(costs[:, 2])).all()
    assert searched > 5


@pytest.mark.parametrize("name", [SE, SESE, MPTC, GTV])
def test_the_ideal_decisions_lose_nothing(bench: Path, name: str) -> None:
    found = study.score(bench, name, bench / name / "ideal.csv")
    assert found["rows"] == STEPS
    assert all(value in (0, None) for key, value in found.items() if key != "rows")


def test_a_dearer_candidate_loses_what_it_costs_more(bench: Path, tmp_path: Path) -> None:
    table = candidates(bench, SE)
    own = trace.read_decisions(bench / SE / "ideal.csv")
    row = int(np.flatnonzero((own.held == 0) & (own.deadlock == 0))[0])
    costs = sorted((float(c[6]), c[2:5]) for c in table if int(c[0]) == row and c[6])
    best, (dearer, s) = costs[0][0], costs[-1]
    fields = dict(zip(("s_a", "s_b", "s_c"), s, strict=True))
    found = study.score(bench, SE, changed(bench, SE, tmp_path / "d.csv", row, fields))
    assert (found["unlike"], found["ties"]) == (1, 0)
    assert found["unlike_pct"] == pytest.approx(100 / STEPS)
    assert found["lost_max_pct"] == pytest.approx(100 * (dearer - best) / best)
    dead = next(c[2:5] for c in table if int(c[0]) == row and c[5] == "0")
    fields = dict(zip(("s_a", "s_b", "s_c"), dead, strict=True))
    found = study.score(bench, SE, changed(bench, SE, tmp_path / "d.csv", row, fields))
    assert (found["unlike"], found["leaves"], found["lost_max_pct"]) == (1, 1, 0)
    length = {"length": str(int(own.length[row]) + 1)}
    found = study.score(bench, SE, changed(bench, SE, tmp_path / "d.csv", row, length))
    assert (found["unlike"], found["length"]) == (0, 1)
    held = int(np.flatnonzero(own.held == 1)[0])
    reached = {tuple(c[2:5]) for c in table if int(c[0]) == held}
    other = next(s for s in reached if s != tuple(str(p) for p in own.s[held]))
    fields = dict(zip(("s_a", "s_b", "s_c"), other, strict=True))
    found = study.score(bench, SE, changed(bench, SE, tmp_path / "d.csv", held, fields))
    assert (found["unlike"], found["moved"]) == (1, 1)


def test_another_vector_and_another_time_are_seen(bench: Path, tmp_path: Path) -> None:
    own = [line for line in candidates(bench, MPTC) if line[0] == "7"]
    cost = {int(u): float(c) for _, u, c in own}
    assert cost[0] == cost[7]
    worst = max(cost, key=cost.__getitem__)
    found = study.score(bench, MPTC, changed(bench, MPTC, tmp_path / "d.csv", 7, {"u": str(worst)}))
    best = min(cost.values())
    assert found["unlike"] == 1
    assert found["lost_max_pct"] == pytest.approx(100 * (cost[worst] - best) / best)
    lines = (bench / GTV / "ideal.csv").read_text(encoding="utf-8").splitlines()
    head = lines[0].split(",")
    t1 = [float(line.split(",")[head.index("t1")]) for line in lines[1:]]
    row = next(k for k, t in enumerate(t1) if 0.01 < t < 0.5)
    fields = {"t1": repr(t1[row] + 8 / 4096)}
    found = study.score(bench, GTV, changed(bench, GTV, tmp_path / "d.csv", row, fields))
    assert found["unlike"] == 0
    assert found["time_max_lsb"] == pytest.approx(8.0, abs=0.01)


def test_the_command_says_and_writes_the_score(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "score.json"
    given = ["--bench", str(bench), "--set", MPTC, "--json", str(out)]
    own = ["--decisions", str(bench / MPTC / "ideal.csv")]
    assert field_score.cli.main([*given, *own]) == 0
    assert json.loads(out.read_text(encoding="utf-8"))["unlike"] == 0
    assert "unlike_pct" in capsys.readouterr().out


def test_the_rtl_has_an_entry_of_each_controller() -> None:
    page = study.PAGE.read_text(encoding="utf-8")
    table = page[page.index(study.MARKS[0]) : page.index(study.MARKS[1])].split("\n\n")[-1]
    head, _, *rows = [line.strip("| ").split("|") for line in table.strip().splitlines()]
    column = [cell.strip() for cell in head].index("`cycles_worst`")
    found = {row[0].strip(" `"): int(row[column]) for row in rows}
    assert set(found) == set(field_bench.ON_RTL) <= {setting.name for setting in study.SETTINGS}
    assert all(cycles > 0 for cycles in found.values())
    for name in found:  # the RTL decides as the model does
        (model,) = [line for line in page.splitlines() if f"`{name}`" in line and "RTL" not in line
                    and "paper" not in line]  # fmt: skip
        (rtl,) = [row for row in rows if name in row[0]]
        assert [cell.strip() for cell in model.strip("| ").split("|")][2:5] == [
            cell.strip() for cell in rtl
        ][2:5]


def test_what_cannot_be_scored_is_told(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "bench"
    shutil.copytree(bench, copy)
    given = ["--bench", str(copy), "--set", MPTC, "--decisions"]
    few = tmp_path / "few.csv"
    lines = (copy / MPTC / "ideal.csv").read_text(encoding="utf-8").splitlines()
    few.write_text("\n".join(lines[:-1]) + "\n", encoding="utf-8")
    assert field_score.cli.main([*given, str(few)]) == 2
    assert f"has {STEPS - 1} rows" in capsys.readouterr().err
    few.write_text("\n".join([lines[0], "9,,0", *lines[2:]]) + "\n", encoding="utf-8")
    assert field_score.cli.main([*given, str(few)]) == 2
    assert "line 2" in capsys.readouterr().err
    assert field_score.cli.main(["--bench", str(copy), "--set", "none", "--decisions", "x"]) == 2
    assert f"there are: {SE}" in capsys.readouterr().err
    with (copy / MPTC / "costs.csv").open("a", encoding="utf-8") as file:
        file.write("0,0,1.0\n")
    assert field_score.cli.main([*given, str(copy / MPTC / "ideal.csv")]) == 2
    assert "is not the file that the manifest names" in capsys.readouterr().err


def test_a_bench_is_made_twice_alike_and_replaces_no_other_folder(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (bench / study.MANIFEST).read_bytes()
    assert field_bench.cli.main(["--out", str(bench), "--steps", str(STEPS)]) == 0
    assert (bench / study.MANIFEST).read_bytes() == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes").write_text("mine", encoding="utf-8")
    assert field_bench.cli.main(["--out", str(tmp_path / "mine")]) == 2
    assert "exists and is no bench" in capsys.readouterr().err
    assert (tmp_path / "mine" / "notes").read_text(encoding="utf-8") == "mine"
