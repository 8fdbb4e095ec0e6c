"""The sweep's designs can be made from the design as it is, and what it published is whole.

Sweep: the texts of every point; trees of the extreme ones.
Stimulus: the sources as they are; made-up figures for the frontier.
Checks: that each constant is found and changed; that the changed models import, their packages are
generated and the RTL analyses and elaborates as VHDL-93; points of the CSV.
Does not prove: bit-exactness of the points; `make sweep` checks it before it measures anything.
"""

from __future__ import annotations

import subprocess

import pytest

from scripts.hdl import sources
from scripts.measure import sweep, sweep_points
from scripts.measure.sweep_points import Edit, Point
from scripts.shared import tables, tools

POINTS = sweep_points.points()
CHANGED = [point for point in POINTS if not point.is_default]


@pytest.mark.parametrize("point", CHANGED, ids=lambda p: f"{p.dimension} {p.setting}")
def test_the_constants_of_a_point_are_found(point: Point, tmp_path) -> None:
    edit = sweep_points.edit_of(point)
    # a word length changes in one place
    assert edit.pairs
    assert edit.file == "model/directmpc/mpdcc/formats.py"
    path = tmp_path / edit.file
    path.parent.mkdir(parents=True)
    before = (tools.ROOT / edit.file).read_text(encoding="utf-8")
    path.write_text(before, encoding="utf-8")
    edit.apply(tmp_path)
    assert path.read_text(encoding="utf-8") != before


@pytest.mark.parametrize(
    "point",
    [
        Point("trajectory word", "19 bits", trajectory=-5),
        Point("cost fraction", "12 bits", cost_fraction=12),
        Point("horizon", "15 steps", length_width=4),
    ],
    ids=lambda p: p.setting,
)
def test_a_point_is_a_design(point: Point, tmp_path) -> None:
    tree = sweep_points.tree_of(point)
    constants = (tree / "rtl" / "mpdcc" / "directmpc_constants.vhd").read_text(encoding="utf-8")
    own = (tools.ROOT / "rtl" / "mpdcc" / "directmpc_constants.vhd").read_text(encoding="utf-8")
    assert constants != own
    files = sources.compile_order("mpdcc_core", sources.rtl_files(tree / "rtl"))
    options = ["--std=93", f"--workdir={tmp_path}"]
    for command in (
        ["-a", *options, *map(str, files)],
        ["--elab-run", *options, "mpdcc_core", "--no-run"],
    ):
        ghdl = [*tools.tool("ghdl"), *command]
        done = subprocess.run(ghdl, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_longer_words_are_refused() -> None:
    with pytest.raises(tools.ToolError, match="wider than a host's"):
        sweep_points.edit_of(Point("trajectory word", "25 bits", trajectory=1))


def test_a_text_that_is_gone_is_an_error(tmp_path) -> None:
    (tmp_path / "a.py").write_text("X = 1\nY = 2\nY = 3\n")
    for text in ("Z = ", "Y = "):
        with pytest.raises(tools.ToolError, match=r"a\.py has no single"):
            Edit("a.py", [(text, "Q = ")]).apply(tmp_path)


def test_frontier() -> None:
    rows = [
        {"cycles_worst": c, "slices_unpacked": s}
        for c, s in ((100, 10), (90, 12), (90, 13), (80, 30), (100, 10), (120, 9))
    ]
    best = sweep.frontier(rows)
    assert [rows.index(row) for row in best] == [0, 1, 3, 0, 5]


def test_points_are_distinct_and_published() -> None:
    assert len(set(POINTS)) == len(POINTS)
    assert {p.explorers for p in POINTS if p.variant == "fast"} >= set(range(1, 7))
    rows = tables.read_csv(sweep.CSV)
    published = {(r["dimension"], r["setting"], r["variant"], r["explorers"]) for r in rows}
    assert published == {(p.dimension, p.setting, p.variant, str(p.explorers)) for p in POINTS}
    for row in rows:
        assert int(row["cycles_worst"]) > int(row["cycles_hold"]) > 0
        assert int(row["slices_unpacked"]) >= int(row["slices_packed"]) > 0
        assert 0 < float(row["mismatch_pct"]) < 100
        assert bool(row["fmax_worst_mhz"]) == (int(row["seeds"]) > 0)
    assert any(row["on_frontier"] == "1" for row in rows)
    page = sweep.PAGE.read_text(encoding="utf-8")
    shown = sweep.table(sweep.stored_rows(), sweep.measured_at())
    assert tables.between(page, shown, sweep.BEGIN, sweep.END) == page, "make sweep ARGS=--plot"
    assert sweep.PLOT.stat().st_size < 150_000
