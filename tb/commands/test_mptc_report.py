"""What is published of the two-level drive is what was measured, and as good as promised.

Stimulus: the files that are checked in; short runs for what the report computes.
Checks: the pages and reports/mptc.md agree with metrics.json; the promised keys are there,
limits kept; distortion is taken at the flux's own frequency; a fidelity that breaks the promise,
and RTL that is not its model's, publish nothing.
Does not prove: that a figure is right; `make report` measures it.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from directmpc.mptc import closed_loop, cycles
from directmpc.mptc.trace import Sequences
from scripts.measure import budgets
from scripts.publish import mptc_report as report
from scripts.publish.reporting import ReportError
from scripts.shared import tables, tools
from scripts.studies import mptc as study
from tb.helpers import mptc_rows as core


@pytest.fixture(scope="module")
def figures() -> dict:
    return json.loads((report.REPORTS / "metrics.json").read_text(encoding="utf-8"))["mptc"]


def test_texts_show_the_measured_figures(figures: dict, tmp_path: Path) -> None:
    sources = report.PAGE, report.MANUAL, report.REPORT
    copies = tmp_path / "figures.md", tmp_path / "mptc.md", tmp_path / "report.md"
    for copy, source in zip(copies, sources, strict=True):
        copy.write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
    report.write_texts(figures, *copies)
    for copy, source in zip(copies, sources, strict=True):
        assert copy.read_text(encoding="utf-8") == source.read_text(encoding="utf-8")
    copies[1].write_text("no markers", encoding="utf-8")
    with pytest.raises(tables.MarkerError, match=r"mptc\.md: the markers"):
        report.write_texts(figures, *copies)


def test_metrics_have_the_promised_shape(figures: dict) -> None:
    assert figures["cycles"] <= 40
    assert figures["mpfc"]["cycles"] <= 80
    for key, *_ in report.DESIGNS:
        one = figures[key] if key else figures
        slices = one["xc3s"]
        assert {"lut", "ff", "mult", "bram"} <= set(slices)
        assert slices["slices_packed"] == -(-max(slices["lut"], slices["ff"]) // 2)
        assert slices["slices_unpacked"] == -(-(slices["lut"] + slices["ff"]) // 2)
        if key in report.PLACED:
            assert one["ecp5"]["fmax_worst_mhz"] <= one["ecp5"]["fmax_median_mhz"]
            assert one["ecp5"]["fmax_worst_mhz"] >= 100.0
            assert one["ecp5"]["seeds"] >= 5
    assert figures["xc3s"]["slices_unpacked"] <= 1500
    assert figures["xc3s"]["mult"] <= 6
    assert figures["family"]["xc3s"]["mult"] <= 4
    assert figures["family"]["ecp5"]["dsp"] <= 4
    slowest = max(*cycles.CORE.values(), *cycles.FAMILY.values(), *cycles.BEST.values())
    assert figures["family"]["cycles"] == slowest == cycles.LIMIT
    assert figures["fidelity"]["steps"] >= 200_000
    assert figures["fidelity"]["worst_point_mismatch_pct"] <= 1.0
    assert figures["fidelity"]["worst_lead_nm"] <= 0.14
    assert figures["replay"]["differing"] == 0
    assert figures["replay"]["rows"] >= 40_000
    for tour in figures["tour"].values():
        assert tour["saturated"] == 0
        assert abs(tour["end_rpm"] + 1500.0) < 30.0


def test_figures_are_joined_at_every_depth() -> None:
    placed = {"mpfc": {"ecp5": {"fmax_worst_mhz": 107.4, "lut": 1}, "cycles": 78}, "cycles": 39}
    area = {"mpfc": {"ecp5": {"lut": 2}}, "cycles": 40}
    assert report.merged(placed, area) == {
        "mpfc": {"ecp5": {"fmax_worst_mhz": 107.4, "lut": 2}, "cycles": 78},
        "cycles": 40,
    }


def test_published_resources_are_those_that_are_held(figures: dict) -> None:
    held = budgets.load().resources
    compared = 0
    for key, entity, generics in report.DESIGNS:
        one = figures[key] if key else figures
        for family, row in held[tools.configuration_name(entity, generics)].items():
            assert {name: one[family][name] for name in row} == row, (key, family)
            compared += 1
    assert compared >= 14


def test_paper_b_is_reproduced(figures: dict) -> None:
    paper = figures["paper_b"]
    weights, low = paper["weights"], paper["low_speed"]
    assert weights["14.2"]["flux_ripple_wb"] > 5 * weights["100"]["flux_ripple_wb"]
    assert weights["350"]["torque_ripple_nm"] > 1.1 * weights["100"]["torque_ripple_nm"]
    assert weights["MPFC"]["torque_ripple_nm"] < 1.2 * weights["100"]["torque_ripple_nm"]
    assert weights["MPFC"]["flux_ripple_wb"] < 1.1 * weights["100"]["flux_ripple_wb"]
    assert abs(low["100"]["thd_pct"] - 8.90) < 0.5
    assert low["MPFC"]["thd_pct"] < low["100"]["thd_pct"] < low["32"]["thd_pct"]
    for rpm in ("0", "150", "500", "900"):
        assert paper["torque_step"][rpm]["rise_longest_ms"] < 1.0
    starts = paper["starts"]
    assert starts["with"]["peak_current_a"] < 0.4 * starts["without"]["peak_current_a"]


def test_distortion_is_taken_at_the_frequency_of_the_flux() -> None:
    drive = core.shipped("induction_2kw2")
    run = closed_loop.simulate(drive, closed_loop.constant(drive, 150.0, 0.0, 0.986, 200))
    n = 100_000
    t = run.ts * np.arange(n)
    turning = np.exp(2j * np.pi * 4.99 * t)
    vector = np.column_stack([turning.real, turning.imag])
    trace = replace(
        run.trace, i_s=4.0 * vector, psi_s=0.9 * vector, u=np.zeros(n, dtype=np.int64)
    )  # a clean sine, 0.01 Hz from where the speed would have it
    nothing = np.zeros(n)
    zero = Sequences(np.zeros((n, 3), dtype=np.int64), np.zeros((n, 2)))
    clean = replace(
        run,
        trace=trace,
        current_inside=4.0 * turning,
        decided=zero,
        wanted=zero,
        torque=nothing,
        flux=nothing,
    )
    assert study.figures(clean)["thd_pct"] < 0.01
    assert abs(study.figures(clean)["fundamental_hz"] - 4.99) < 1e-6
    assert study.figures(clean, 2 * np.pi * 5.0)["thd_pct"] > 5.0
    assert study.band_limited(clean, 1000.0) < 0.1


def test_a_broken_promise_is_not_published() -> None:
    row = {"steps": 1000, "saturated": 0, "mismatch_pct": 0.1, "worst_margin": 0.01}
    good = {"MPTC a": row, "MPFC a": row}
    assert report.fidelity(good)["decision_mismatch_pct"] == pytest.approx(0.1)
    for worse in ({"mismatch_pct": 1.1}, {"worst_margin": 0.15}):
        with pytest.raises(ReportError, match="fidelity"):
            report.fidelity({**good, "MPTC b": row | worse})


def test_recorded_runs_are_compared_on_the_rtl(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = core.shipped("induction_2kw2")
    other = drive.with_control(method="MPFC")
    runs = {
        name: (one, closed_loop.simulate(one, closed_loop.constant(one, 900.0, 7.0, 0.9, 60)))
        for name, one in (("MPTC", drive), ("MPFC", other))
    }
    monkeypatch.setattr(report, "SAMPLE_GHDL", 10)
    assert report.replayed(runs) == {
        "runs": 2,
        "rows": 120,
        "rows_ghdl": 20,
        "differing": 0,
    }
    monkeypatch.setattr(report.bit_true, "run_words", lambda _a, _b, _c, out: out.fill(0))
    with pytest.raises(ReportError, match="differ"):
        report.replayed(runs)
