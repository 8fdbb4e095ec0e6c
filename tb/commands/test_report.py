"""What is published is what was measured: pages and reports agree, figures are of the right shape.

Stimulus: the files that are checked in, and made-up figures.
Does not prove: that a figure is right; `make report` measures it.
"""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest

from scripts.commands import coefficients
from scripts.hdl import states
from scripts.publish import report
from scripts.shared.tools import ROOT
from scripts.studies import observer as observer_study


@pytest.fixture(scope="module")
def document() -> dict:
    return json.loads((report.REPORTS / "metrics.json").read_text(encoding="utf-8"))


def test_the_pages_show_the_measured_figures(document: dict) -> None:
    for path, table in (
        (report.PAGE, report.page_figures(document)),
        (report.README, report.readme_figures(document)),
    ):
        text = path.read_text(encoding="utf-8")
        shown = text.partition(report.BEGIN)[2].partition(report.END)[0].strip()
        assert shown == table.strip(), "make report, or report --tables"


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


def test_the_rest_of_the_pages_stays(tmp_path: Path, document: dict) -> None:
    paths = tmp_path / "figures.md", tmp_path / "README.md"
    for path in paths:
        path.write_text(f"before\n{report.BEGIN}\nold\n{report.END}\nafter\n")
    report.write_tables(document, *paths)
    first = [path.read_text() for path in paths]
    for text in first:
        assert text.startswith("before\n")
        assert text.endswith("\nafter\n")
        assert "\nold\n" not in text
    report.write_tables(document, *paths)
    assert [path.read_text() for path in paths] == first


def test_the_observers_page_shows_what_was_measured() -> None:
    with (report.REPORTS / "observer.csv").open(encoding="utf-8", newline="") as file:
        rows = [
            {k: v if k == "mismatch" else float(v) for k, v in row.items()}
            for row in csv.DictReader(file)
        ]
    page = (ROOT / "reports" / "observer.md").read_text(encoding="utf-8")
    assert f"<!-- table: begin -->\n{observer_study._markdown(rows)}\n<!-- table: end -->" in page
    # one of its points anew; another libm turns roundings, and closed loops part after some steps
    drive = states.shipped(report.DRIVES[0])
    (row,) = [
        row
        for row in rows
        if (row["mismatch"], row["omega_s_pu"]) == ("rr * 1.5", 1.0)
        and row["crossover_pu"] == observer_study.rotor_flux_observer.CROSSOVER
    ]
    found = observer_study.error(
        *observer_study.run(drive, 1.0, observer_study.MISMATCHES["rr * 1.5"])
    )
    assert row["magnitude_pct"] == pytest.approx(found.magnitude, abs=0.05)
    assert row["angle_deg"] == pytest.approx(found.angle, abs=0.05)


def test_coefficients_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    drive = str(ROOT / "drives" / "anpc5l_6kv.toml")
    assert coefficients.cli.main([drive, "--csv"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "port,value,hex"
    core = (ROOT / "rtl" / "mpdcc" / "mpdcc_core.vhd").read_text(encoding="utf-8")
    inputs = re.findall(r"^ {4}(\w+) *: in ", core, re.MULTILINE)
    listed = [line.split(",")[0] for line in lines[1:]]
    assert [port for port in inputs if port in listed] == listed, "in port order"
    assert len(inputs) - len(listed) == 3 + 13 + 3, "clk, rst, start; measurements; s(k-1)"
    for line in lines[1:]:
        port, value, word = line.split(",")
        whole = 16 ** len(word) if int(value) < 0 else 0
        assert int(word, 16) - whole == int(value), port
    assert coefficients.cli.main([drive]) == 0
    assert "horizon" in capsys.readouterr().out
    assert coefficients.cli.main(["none.toml"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
