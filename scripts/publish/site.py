"""`make site`: the documentation as a site of plain files, without network.

Pages are put together in ``build/site-pages``: those of docs/, a page for each public entity, and a
page for every other file of the repository that a page links to. Block diagrams of the entities are
drawn from the VHDL, waveforms from short runs of GHDL. Links between them are rewritten;
none leaves the site but those to other hosts. MkDocs builds the pages in strict mode, with the
looks of mkdocs.yml. Groups and order of the navigation are those of docs/README.md.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import yaml

from scripts.measure import budgets
from scripts.publish import entity_pages
from scripts.shared import progress, tools
from scripts.shared.tools import BUILD, ROOT, ToolError

DOCS = ROOT / "docs"
LOOKS = ROOT / "mkdocs.yml"
PAGES = BUILD / "site-pages"
SITE = BUILD / "site"
ENTITIES = DOCS / "entities"
"""Folder that the entities' pages would have in docs/."""

_LINK = re.compile(r"(\]\()([^)\s]+)(\))")
_FENCE = re.compile(r"^ *(```|~~~)")
_SCHEME = re.compile(r"^[a-z][a-z0-9+.-]*:")
_AS_THEY_ARE = (".png", ".svg", ".csv", ".gz", ".json", ".pdf")
_LANGUAGES = {
    ".vhd": "vhdl", ".v": "verilog", ".py": "python", ".toml": "toml", ".sh": "bash", ".tcl": "tcl",
    ".xdc": "tcl", ".yml": "yaml",
}  # fmt: skip
_MOVED = {ROOT / "README.md": "index.md", DOCS / "README.md": "pages.md"}
_PROJECT = ("CHANGELOG.md", "CONTRIBUTING.md", "LICENSE")
"""Files of the repository that the navigation has, whoever links to them."""


class SiteError(ToolError):
    """The site cannot be built; the message names the page."""


def place(path: Path) -> str:
    """Where a file of the repository stands in the site."""
    if path in _MOVED:
        return _MOVED[path]
    if path.is_relative_to(DOCS):
        return path.relative_to(DOCS).as_posix()
    name = f"files/{path.relative_to(ROOT).as_posix()}"
    whole = path.suffix in (*_AS_THEY_ARE, ".md")
    return name if whole and not path.is_dir() else f"{name}.md"


def rewritten(text: str, path: Path, wanted: Callable[[Path], None]) -> str:
    """A page with its links as they have to be in the site."""
    here = Path(place(path)).parent

    def _link(found: re.Match[str]) -> str:
        target = found[2]
        if _SCHEME.match(target) or target.startswith("#"):
            return found[0]
        name, sign, anchor = target.partition("#")
        goal = Path(os.path.normpath(path.parent / name))
        if not goal.is_relative_to(ROOT):
            raise SiteError(f"{path.relative_to(ROOT)}: the link {target} leaves the repository")
        if not goal.exists() and goal.parent != ENTITIES:
            raise SiteError(f"{path.relative_to(ROOT)}: the link {target} leads to no file")
        wanted(goal)
        moved = Path(os.path.relpath(place(goal), here)).as_posix()
        return f"{found[1]}{moved}{sign}{anchor}{found[3]}"

    lines, fenced = [], False
    for line in text.splitlines():
        fence = _FENCE.match(line)
        fenced ^= bool(fence)
        lines.append(line if fenced or fence else _LINK.sub(_link, line))
    return "\n".join(lines) + "\n"


def source_page(path: Path) -> str:
    """A page that shows a file of the repository, or lists the files of a folder."""
    head = ["---", "search:", "  exclude: true", "---", ""]
    title = path.relative_to(ROOT).as_posix()
    lines = [*head, f"# `{title}`", ""]
    if path.is_dir():
        files = sorted(p for p in path.iterdir() if p.is_file() and not p.name.startswith("."))
        return "\n".join([*lines, *(f"- [{p.name}]({path.name}/{p.name})" for p in files), ""])
    text = path.read_text(encoding="utf-8").rstrip("\n")
    longest = max((len(found) for found in re.findall(r"`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    language = _LANGUAGES.get(path.suffix, "text")
    return "\n".join([*lines, f"{fence}{language}", text, fence, ""])


def groups(text: str) -> dict[str, list[str]]:
    """Groups of docs/README.md and their pages, in its order."""
    found: dict[str, list[str]] = {}
    for part in re.split(r"^## ", text, flags=re.M)[1:]:
        heading, _, below = part.partition("\n")
        rows = re.findall(r"^\| \[[^\]]+\]\(([\w-]+\.md)\) \|", below, re.M)
        if not rows:
            raise SiteError(f"docs/README.md: the group '{heading}' has no page")
        found[heading.strip()] = rows
    return found


def navigation() -> list[str | dict[str, list[str]]]:
    """What the site's navigation holds, as mkdocs.yml would have it; titles are the pages' own."""
    listed = groups((DOCS / "README.md").read_text(encoding="utf-8"))
    entities = [f"entities/{entity}.md" for entity in entity_pages.PUBLIC]
    return [
        "index.md",
        *({heading: files} for heading, files in listed.items()),
        {"Entities": ["entities/index.md", *entities]},
        {"Project": ["pages.md", *(place(ROOT / name) for name in _PROJECT)]},
    ]


def stage(folder: Path) -> int:
    """Write every page of the site in Markdown, and mkdocs.yml with the navigation."""
    shutil.rmtree(folder, ignore_errors=True)
    held = budgets.load()
    made = {ENTITIES / f"{e}.md": entity_pages.page(e, held, ENTITIES / f"{e}.md")
            for e in entity_pages.PUBLIC}  # fmt: skip
    pictures: dict[Path, str] = {}
    for entity in entity_pages.PUBLIC:
        drawn = {**entity_pages.pictures(entity), **entity_pages.waveform(entity)}
        pictures |= {ENTITIES / name: picture for name, picture in drawn.items()}
    made[ENTITIES / "index.md"] = entity_pages.index(ENTITIES / "index.md")
    first = [ROOT / "README.md", *sorted(DOCS.glob("*.md")), *(ROOT / name for name in _PROJECT)]
    todo, known = [*first, *made], {*first, *made}

    def _want(path: Path) -> None:
        if path not in known:
            known.add(path)
            todo.append(path)

    done = 0
    while todo:
        path = todo.pop(0)
        out = folder / "docs" / place(path)
        out.parent.mkdir(parents=True, exist_ok=True)
        if path in pictures:
            tools.write(out, pictures[path])
        elif path.is_file() and path.suffix in _AS_THEY_ARE:
            shutil.copyfile(path, out)
        else:
            text = made.get(path)
            if text is None:
                markdown = path.suffix == ".md"
                text = path.read_text(encoding="utf-8") if markdown else source_page(path)
            tools.write(out, rewritten(text, path, _want))
        done += 1
    configuration = {
        "INHERIT": str(LOOKS), "docs_dir": "docs", "nav": navigation(),
    }  # fmt: skip
    tools.write(folder / "mkdocs.yml", yaml.safe_dump(configuration, sort_keys=False))
    return done


def _time() -> str:
    """Seconds since 1970 of the commit, which stand in the site's map; 0 outside a repository."""
    try:
        return tools.run(["git", "-C", str(ROOT), "log", "-1", "--format=%ct"]).stdout.strip()
    except (ToolError, OSError):
        return "0"


def build(out: Path = SITE, pages: Path | None = None) -> int:
    """Build the site, all of it or nothing."""
    if out.exists() and not (out / "sitemap.xml").exists() and any(out.iterdir()):
        raise SiteError(f"{out}: is no site; an empty or a new folder is needed")
    pages = PAGES if pages is None else pages
    with progress.busy("pages"):
        count = stage(pages)
    fresh = out.with_name(f".{out.name}.new")
    shutil.rmtree(fresh, ignore_errors=True)
    command = [sys.executable, "-m", "mkdocs", "build", "--strict"]
    command += ["--config-file", str(pages / "mkdocs.yml"), "--site-dir", str(fresh.resolve())]
    environment = {"SOURCE_DATE_EPOCH": _time(), "NO_MKDOCS_2_WARNING": "1"}
    try:
        with progress.busy(f"site of {count} files"):
            tools.run(["env", *(f"{k}={v}" for k, v in environment.items()), *command])
        shutil.rmtree(out, ignore_errors=True)
        fresh.rename(out)
    except ToolError as error:
        raise SiteError(f"MkDocs has no site to show for it: {error}") from None
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return count
