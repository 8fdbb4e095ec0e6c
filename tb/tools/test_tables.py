"""Tables and pictures have one form: CSV, what stands between two markers, PNG files.

Does not prove: what the tables of the reports say.
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

from scripts.shared import tables
from scripts.shared.figures import STYLE, pyplot, save_png


def test_csv_has_comments_columns_and_rounding() -> None:
    rows = [{"a": 1, "b": 0.123456, "c": "x, y"}, {"a": 2, "b": 2.0, "c": ""}]
    text = tables.csv_text(rows, ["commit: 1"], ["c", "b"], digits=4)
    assert text == '# commit: 1\nc,b\n"x, y",0.1235\n,2.0\n'
    whole = tables.csv_text(rows)
    first = next(csv.DictReader(io.StringIO(whole)))
    assert first == {"a": "1", "b": "0.123456", "c": "x, y"}
    assert tables.csv_text([], columns=["a"]) == "a\n"


def test_only_what_stands_between_the_markers_changes() -> None:
    page = "before\n<b>\nold\nlines\n<e>\nafter\n"
    assert tables.between(page, "new", "<b>", "<e>") == "before\n<b>\nnew\n<e>\nafter\n"
    for broken in ("no markers", "<b> only", "only <e>"):
        with pytest.raises(tables.MarkerError, match="missing"):
            tables.between(broken, "new", "<b>", "<e>")


def test_markdown_has_a_rule_and_escapes_bars() -> None:
    rows = [("x|y", 1), ("", 2.5)]
    assert tables.markdown(("a", "b"), rows, "lr") == (
        "| a | b |\n| --- | ---: |\n| x\\|y | 1 |\n|  | 2.5 |"
    )
    assert tables.markdown("abcd", [], "lr").splitlines()[1] == "| --- | ---: | ---: | ---: |"
    assert tables.markdown("ab", []) == "| a | b |\n|---|---|"
    with pytest.raises(ValueError, match="1 cells, the table 2 columns"):
        tables.markdown("ab", ["c"])
    for wrong in ("", "c"):
        with pytest.raises(ValueError, match="letters l and r"):
            tables.markdown("ab", [], wrong)


def test_a_page_is_rewritten_whole_or_not_at_all(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    text = "<a>\nold\n</a>\n<b>\nold\n</b>\n"
    page.write_text(text)
    assert tables.inside(text, "<b>", "</b>") == "\nold\n"
    with pytest.raises(tables.MarkerError, match=r"page\.md: the markers '<c>'"):
        tables.rewrite(page, {("<a>", "</a>"): "new", ("<c>", "</c>"): "new"})
    assert page.read_text() == text
    tables.rewrite(page, {("<a>", "</a>"): "one", ("<b>", "</b>"): "two"})
    assert page.read_text() == "<a>\none\n</a>\n<b>\ntwo\n</b>\n"


def test_csv_is_read_without_its_comments(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text(tables.csv_text([{"a": 1, "b": "x, y"}], ["commit: 1"]))
    assert tables.read_csv(path) == [{"a": "1", "b": "x, y"}]


def test_a_picture_is_small_and_in_the_style(tmp_path: Path) -> None:
    plt = pyplot()
    assert all(plt.rcParams[name] == value for name, value in STYLE.items())
    figure, axes = plt.subplots()
    axes.plot([0, 1], [0, 1])
    path = tmp_path / "folder" / "x.png"
    save_png(figure, path)
    plt.close(figure)
    assert path.read_bytes().startswith(b"\x89PNG")
    assert path.stat().st_size < 20_000
    assert [one.name for one in path.parent.iterdir()] == ["x.png"]
