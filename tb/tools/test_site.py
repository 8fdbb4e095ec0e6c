"""`make site`: every page and link arrives, each public entity has its page, without a network.

Stimulus: the repository's pages; made-up pages, headers and ports.
Checks: links as they are rewritten; groups of docs/README.md as navigation; an entity's page has
its header, ports and clocks; its paragraph on latency has every figure that a bench asserts; MkDocs
in strict mode has no warning; no page loads anything from another host; every link and picture of
every page is there; built twice the same bytes; a dead anchor fails the build and leaves the site
that stood there.
Does not prove: what the pages look like.
"""

from __future__ import annotations

import contextlib
import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from directmpc.host import protocol
from scripts.commands.site import cli
from scripts.hdl import sources
from scripts.hdl.clocks import clocks_of
from scripts.measure import budgets
from scripts.publish import entity_pages, site
from scripts.shared.tools import ROOT

DOCS = ROOT / "docs"


# --- pages in Markdown ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "place"),
    [
        ("README.md", "index.md"),
        ("docs/README.md", "pages.md"),
        ("docs/check.md", "check.md"),
        ("docs/system.svg", "system.svg"),
        ("CHANGELOG.md", "files/CHANGELOG.md"),
        ("rtl/mpdcc/mpdcc_core.vhd", "files/rtl/mpdcc/mpdcc_core.vhd.md"),
        ("reports/run.png", "files/reports/run.png"),
        ("examples", "files/examples.md"),
    ],
)
def test_every_file_has_its_place(path: str, place: str) -> None:
    assert site.place(ROOT / path) == place


def test_links_are_rewritten_outside_of_code() -> None:
    text = (
        "[a](check.md#what-is-compared) ![b](../reports/run.png) [c](../rtl/mpdcc/mpdcc_core.vhd)\n"
        "[d](#here) [e](https://example.org/x) [f](../README.md)\n```\n[g](none.md)\n```\n"
    )
    wanted: list[Path] = []
    found = site.rewritten(text, DOCS / "entities" / ".." / "hil.md", wanted.append)
    assert "[a](check.md#what-is-compared) ![b](files/reports/run.png)" in found
    assert "[c](files/rtl/mpdcc/mpdcc_core.vhd.md)" in found
    assert "[d](#here) [e](https://example.org/x) [f](index.md)" in found
    assert "[g](none.md)" in found
    assert ROOT / "reports" / "run.png" in wanted


@pytest.mark.parametrize(
    ("link", "message"), [("none.md", "leads to no file"), ("../../x", "leaves the repository")]
)
def test_a_dead_link_is_told_with_its_page(link: str, message: str) -> None:
    with pytest.raises(site.SiteError, match=rf"docs/hil\.md: the link {link} {message}"):
        site.rewritten(f"[a]({link})", DOCS / "hil.md", lambda _: None)


def test_the_navigation_is_the_list_of_pages() -> None:
    found = site.groups((DOCS / "README.md").read_text(encoding="utf-8"))
    listed = [file for files in found.values() for file in files]
    assert sorted(listed) == sorted(p.name for p in DOCS.glob("*.md") if p.name != "README.md")
    assert len(found["Start here"]) == 4
    with pytest.raises(site.SiteError, match="'Empty' has no page"):
        site.groups("# x\n\n## Empty\n\nnothing\n")


def test_source_pages_hold_whole_files(tmp_path: Path) -> None:
    page = site.source_page(ROOT / "rtl" / "common" / "mac_block.vhd")
    assert (ROOT / "rtl" / "common" / "mac_block.vhd").read_text(encoding="utf-8").rstrip() in page
    assert "```vhdl\n" in page
    own = ROOT / "docs" / "check.md"
    assert "\n````text\n" in site.source_page(own), "the fence is longer than those inside"
    listing = site.source_page(ROOT / "examples")
    assert "- [own_host.py](examples/own_host.py)" in listing


# --- entities -------------------------------------------------------------------------------------

VHDL = """\
-- A unit: counts_up.
-- It has two lines.
--
--   y = x + 1
--
-- More, see docs/check.md.
-- Formats: x unsigned, x < 3.
-- Latency: one
-- clock.
-- Licence: Apache-2.0

entity unit is
  generic (
    WIDTH : positive range 1 to 8 := 4 -- bits of x
  );
  port (
    clk : in    std_logic;                            -- rising edge
    -- data
    x   : in    std_logic_vector(WIDTH - 1 downto 0); -- unsigned | pu
    y   : out   std_logic                             -- '1': done
  );
end entity unit;
"""


def test_a_header_is_read_by_its_paragraphs() -> None:
    assert entity_pages.header(VHDL) == [
        ("", "A unit: counts_up. It has two lines."),
        ("", "  y = x + 1"),
        ("", "More, see docs/check.md."),
        ("Formats", "x unsigned, x < 3."),
        ("Latency", "one clock."),
        ("Licence", "Apache-2.0"),
    ]


def test_generics_and_ports_are_read() -> None:
    (width,) = entity_pages.generics(VHDL, "unit")
    assert (width.name, width.kind, width.default) == ("WIDTH", "positive range 1 to 8", "4")
    assert width.comment == "bits of x"
    found = entity_pages.ports(VHDL, "unit")
    assert [(p.name, p.direction, p.group) for p in found] == [
        ("clk", "in", ""), ("x", "in", "data"), ("y", "out", "data"),
    ]  # fmt: skip
    assert (found[1].kind, found[1].comment) == (
        "std_logic_vector(WIDTH - 1 downto 0)", "unsigned | pu",
    )  # fmt: skip
    with pytest.raises(site.ToolError, match="no entity other"):
        entity_pages.ports(VHDL, "other")
    with pytest.raises(site.ToolError, match="no declaration with a comment: y"):
        entity_pages.ports(VHDL.replace("-- '1': done", ""), "unit")


@pytest.mark.parametrize("entity", entity_pages.PUBLIC)
def test_every_public_entity_has_its_page(entity: str) -> None:
    held = budgets.load()
    page = entity_pages.page(entity, held, site.ENTITIES / f"{entity}.md")
    text = sources.entities()[entity].read_text(encoding="utf-8")
    clause = text.partition(f"entity {entity} is")[2].partition("end entity")[0]
    names = re.findall(r"^ {4}(\w+) *:", clause, re.M)
    assert re.findall(r"^\| `(\w+)` \|", page[page.index("\n## ") :], re.M) == names
    for name, family in (("lut", "Spartan-3"), ("lut", "ECP5")):
        rows = {k: row for k, row in held.resources.items() if k.split("-")[0] == entity}
        key = {"Spartan-3": "xc3s", "ECP5": "ecp5"}[family]
        for row in (row[key] for row in rows.values() if key in row):
            assert f"| {family} | {row[name]} | {row['ff']} |" in page
    for label in ("formats", "latency", "overflow"):
        assert label in page.lower()
    for value in held.cycles.get(entity, {}).values():
        if isinstance(value, int):
            assert f" | {value} |" in page


WORDS = {"one": 1, "two": 2, "three": 3, "four": 4, "five": 5}


def clocks_said(text: str, defaults: dict[str, int]) -> set[int]:
    """Numbers and values of formulas in the paragraph on latency, for 1 to 8 explorers."""
    (said,) = (said for label, said in entity_pages.header(text) if label == "Latency")
    found = {WORDS[word] for word in re.findall(r"[a-z]+", said) if word in WORDS}
    known = {"EXPLORERS", *defaults}
    tokens = re.findall(r"[\w.,;]+|[()+*/]", said)
    formula: list[str] = []
    for token in [*tokens, "."]:
        word = token.rstrip(".,;")
        part = word.isdigit() or word in known or word in ("mod", *"()+*/")
        if part:
            formula.append({"mod": "%", "/": "//"}.get(word, word))
        if not part or word != token:
            while formula and formula[-1] in ("%", "//", "+", "*", "("):
                formula.pop()
            for explorers in range(1, 9):
                with contextlib.suppress(SyntaxError, TypeError):
                    value = eval(" ".join(formula), {**defaults, "EXPLORERS": explorers})
                    found.add(int(value))
            formula = []
    return found


def flat(value: object) -> set[int]:
    """All numbers of a table of clocks."""
    if isinstance(value, dict):
        return set().union(*map(flat, value.values()))
    if isinstance(value, list):
        return set(value)
    return {value} if isinstance(value, int) else set()


def test_formulas_of_a_header_are_evaluated() -> None:
    text = "-- x.\n-- Latency: W + 2 clocks, at most 4 + 3 * (6 / EXPLORERS) + 6 mod EXPLORERS. two"
    got = clocks_said(text, {"W": 5})
    assert {7, 22, 13, 10, 2} <= got
    assert 21 not in got


ELSEWHERE = {
    # clock by clock, beside the model: test_gate_guard
    "gate_guard": {1, 2, 4},
    # header, check sum, stuffing and two ends of a frame: test_host_link
    "host_link": {protocol.OVERHEAD + 3},
    "mpdcc_system": {clocks_of("state_observer", one) for one in ("filters", "flux", "filtered")},
    "mptc_system": {clocks_of("mptc_speed_observer", "speed") + 1},
}
"""Clocks on pages of entities that the file of budgets has none of, and what asserts them."""


@pytest.mark.parametrize("entity", [one for one in entity_pages.PUBLIC if one != "board_top"])
def test_the_latency_on_a_page_is_what_a_bench_asserts(entity: str) -> None:
    wanted = flat(budgets.load().cycles.get(entity, {})) | ELSEWHERE.get(entity, set())
    if entity == "mpdcc_scheduler":
        wanted |= flat(budgets.load().cycles["mpdcc_core"])
    assert wanted, "no latency is known"
    text = sources.entities()[entity].read_text(encoding="utf-8")
    defaults = {
        one.name: int(one.default)
        for one in entity_pages.generics(text, entity)
        if one.default.isdigit()
    }
    assert wanted - clocks_said(text, defaults) == set()


def test_the_board_adds_no_latency_of_its_own() -> None:
    text = sources.entities()["board_top"].read_text(encoding="utf-8")
    assert "Latency: see host_link, controller and gate guard." in text


# --- the site -------------------------------------------------------------------------------------


class Page(HTMLParser):
    """What a page loads, what it leads to, and the names of its places."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag refers to."""
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if "src" in given:
            self.loaded.append(given["src"])
        if "href" in given:
            (self.links if tag == "a" else self.loaded).append(given["href"])


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built in strict mode."""
    pytest.importorskip("material", reason="requirements-site.txt is not installed: make site")
    folder = tmp_path_factory.mktemp("site")
    site.build(folder / "site", folder / "pages")
    return folder / "site"


def dead(pages: dict[Path, Page]) -> list[str]:
    """What pages load or lead to that is not there."""
    found = []
    for path, page in pages.items():
        for target in (*page.loaded, *page.links):
            parts = urlsplit(target)
            if parts.scheme or path.name == "404.html":
                continue
            goal = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            known = goal.exists() and not goal.is_dir()
            named = not parts.fragment or unquote(parts.fragment) in getattr(
                pages.get(goal), "anchors", {unquote(parts.fragment)}
            )
            if not (known and named) and parts.fragment != "__skip":
                found.append(f"{path.name}: {target}")
    return found


def test_the_site_is_whole_and_loads_nothing_from_elsewhere(built: Path) -> None:
    pages = {path.resolve(): Page(path.read_text("utf-8")) for path in built.rglob("*.html")}
    for name in ("index", "check", "start-fpga", "pages", "entities/mpdcc_core"):
        assert (built / f"{name}.html").resolve() in pages
    elsewhere = [t for page in pages.values() for t in page.loaded if re.match(r"(\w+:)?//", t)]
    assert elsewhere == []
    assert dead(pages) == []
    for sheet in built.rglob("*.css"):
        assert not re.search(r"url\(\s*['\"]?(https?:)?//", sheet.read_text("utf-8")), sheet.name


def test_the_site_is_the_same_when_built_again(built: Path, tmp_path: Path) -> None:
    site.build(tmp_path / "site", tmp_path / "pages")
    files = {p.relative_to(built): p.read_bytes() for p in built.rglob("*") if p.is_file()}
    again = tmp_path / "site"
    assert files == {p.relative_to(again): p.read_bytes() for p in again.rglob("*") if p.is_file()}


def test_the_site_that_stands_survives_a_warning(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "site"
    out.mkdir()
    (out / "sitemap.xml").write_text("before", encoding="utf-8")
    monkeypatch.setattr(site, "PAGES", tmp_path / "pages")
    monkeypatch.setattr(entity_pages, "index", lambda _: "# E\n\n[x](../check.md#none)\n")
    assert cli.main(["--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "check.md#none" in said
    assert "entities/index.md" in said
    assert [path.name for path in out.iterdir()] == ["sitemap.xml"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pages", "site"]


def test_a_folder_that_is_no_site_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("x", encoding="utf-8")
    with pytest.raises(site.SiteError, match="is no site"):
        site.build(tmp_path, tmp_path / "pages")
    assert (tmp_path / "precious.txt").exists()
