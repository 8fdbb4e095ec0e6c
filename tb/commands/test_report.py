"""What is published is what was measured: README and reports agree, figures are of the right shape.

Stimulus: the files that are checked in, and made-up figures.
Does not prove: that a figure is right; `make report` measures it.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from directmpc import coefficients, report
from directmpc.simulator import ROOT


@pytest.fixture(scope="module")
def document() -> dict:
    return json.loads((report.REPORTS / "metrics.json").read_text(encoding="utf-8"))


def test_readme_shows_the_measured_figures(document: dict) -> None:
    text = report.README.read_text(encoding="utf-8")
    shown = text.partition(report.BEGIN)[2].partition(report.END)[0].strip()
    assert shown == report.readme_figures(document).strip(), "make report, or report --readme"


def test_metrics_have_the_promised_shape(document: dict) -> None:
    for design in report.DESIGNS.values():
        figures = document[design.key]
        for n in map(str, report.EXPLORERS):
            assert figures["cycles_measured"][n] <= figures["cycles_worst"][n]
            slices = figures["xc3s"][n]
            assert slices["slices_packed"] == -(-max(slices["lut"], slices["ff"]) // 2)
            assert slices["slices_unpacked"] == -(-(slices["lut"] + slices["ff"]) // 2)
            assert {"mult", "bram"} <= set(slices)
        for family in ("xc6s", "xc7", "ecp5"):
            assert {"lut", "ff", "dsp", "bram"} <= set(figures[family][str(report.SHOWN)])
        placed = [row for row in figures["ecp5"].values() if "fmax_worst_mhz" in row]
        assert placed
        for row in placed:
            assert row["fmax_worst_mhz"] <= row["fmax_median_mhz"]
        assert figures["fidelity"]["steps"] >= 50_000
        assert {"decision_mismatch_pct", "search_mismatch_pct", "fsw_diff_pct", "thd_diff_pct"} <= (
            set(figures["fidelity"])
        )
        assert figures["cycles_hold"] < min(figures["cycles_worst"].values())
    assert {"ghdl", "yosys", "nextpnr", "cocotb"} <= set(document["tools"])
    assert document["commit"]


def test_pictures_are_small() -> None:
    for name in ("run.png", "fidelity.png"):
        assert (report.REPORTS / name).stat().st_size < 150_000


def test_the_rest_of_the_readme_stays(tmp_path: Path, document: dict) -> None:
    path = tmp_path / "README.md"
    path.write_text(f"before\n{report.BEGIN}\nold\n{report.END}\nafter\n")
    report.write_readme(document, path)
    first = path.read_text()
    assert first.startswith("before\n")
    assert first.endswith("\nafter\n")
    assert "old" not in first
    report.write_readme(document, path)
    assert path.read_text() == first


def test_coefficients_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    drive = str(ROOT / "drives" / "anpc5l_6kv.toml")
    assert coefficients.main([drive, "--csv"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "port,value,hex"
    assert len(lines) == 1 + 41
    for line in lines[1:]:
        port, value, word = line.split(",")
        assert int(value) % 16 ** len(word) == int(word, 16), port
    assert coefficients.main([drive]) == 0
    assert "horizon" in capsys.readouterr().out
    assert coefficients.main(["none.toml"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
