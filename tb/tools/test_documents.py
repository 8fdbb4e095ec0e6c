"""The pages agree with what is built.

Checks: docs/specification.md has every key of the drive files with its range and default, every
column of traces and decisions, every generic of the public entities with its default, the public
names of the library, the clocks that the budgets hold, the paths of reports/metrics.json;
docs/commands.md has every make target; docs/positions.md has the table of the inverter; the
example of docs/drive-file.md gives the shipped 6 kV drive; docs/equations.md names every entity,
package and module, and nothing that does not exist; no dead link or anchor in any page, no path
of a file that does not exist; docs/README.md lists every page; rtl/alternatives.md has a row
for each header that refers to it.
Does not prove: that a sentence is right.
"""

from __future__ import annotations

import ast
import functools
import json
import re
import subprocess
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import numpy as np
import pytest

import directmpc
from directmpc.api import drive_file
from directmpc.drive_tables import GuardTable, kinds_of
from directmpc.loads import KINDS
from directmpc.mpdcc import drive as mpdcc_drive
from directmpc.mpdcc import inverter, trace
from directmpc.mptc import trace as mptc_trace
from scripts.hdl import sources
from scripts.hdl.clocks import clocks_of, worst_clocks
from scripts.shared.tools import ROOT

DOCS = ROOT / "docs"
SPECIFICATION = DOCS / "specification.md"
LIBRARY = ROOT / "model" / "directmpc"
PUBLIC = (
    "mpdcc_core", "mptc_core", "mptc_drive", "mpdcc_scheduler", "mpdcc_explorer", "binary_search",
    "mac_block", "gate_guard", "kbest_core", "mpdcc_system", "kbest_system",
    "mptc_system",
)  # fmt: skip

_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")


def between(path: Path, name: str) -> str:
    """What stands between a page's markers of a name."""
    text = path.read_text(encoding="utf-8")
    found = re.search(rf"<!-- {name}: begin[^>]*-->\n(.*?)<!-- {name}: end -->", text, re.S)
    assert found, f"{path.name}: the markers of '{name}' are missing"
    return found.group(1)


def rows(text: str) -> list[list[str]]:
    """Cells of the rows of a Markdown table, its head left out."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [
        [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        for line in lines[2:]
    ]


def ticked(text: str) -> list[str]:
    """What a text has between backticks."""
    return re.findall(r"`([^`]+)`", text)


# --- drive files ----------------------------------------------------------------------------------


def keys(table: Any, prefix: str = "") -> dict[str, Any]:
    """Every key of a drive file's model, dotted, with pydantic's description of it."""
    found: dict[str, Any] = {}
    for name, field in table.__pydantic_fields__.items():
        tables = list(kinds_of(field.annotation).values())
        inner = tables[0] if tables else field.annotation
        if hasattr(inner, "__pydantic_fields__"):
            found |= keys(inner, f"{prefix}{name}.")
        else:
            found[prefix + name] = field
    return found


def specified(name: str) -> dict[str, list[str]]:
    """Rows of a table of keys, by key."""
    return {ticked(row[0])[0]: row for row in rows(between(SPECIFICATION, f"keys of {name}"))}


def limits(field: Any) -> tuple[float, float] | None:
    """Least and largest value of a number."""
    low = [m.ge for m in field.metadata if hasattr(m, "ge")]
    high = [m.le for m in field.metadata if hasattr(m, "le")]
    return (float(low[0]), float(high[0])) if low and high else None


@pytest.mark.parametrize(
    ("name", "model", "prefix"),
    [
        *((name, model, "") for name, model in sorted(drive_file.DRIVES.items())),
        *((name, kind, "machine.") for name, kind in list(KINDS.items())[1:]),
    ],
)
def test_every_key_of_a_drive_file_is_specified(name: str, model: Any, prefix: str) -> None:
    written = specified(name)
    if name == "kbest":  # the other tables are MPDCC's
        shared = specified("mpdcc").items()
        written |= {key: row for key, row in shared if not key.startswith("control")}
    if not prefix:
        assert not set(written) & set(specified("guard"))
        written |= specified("guard")
    built = keys(model, prefix)
    assert set(written) == set(built)
    for key, field in built.items():
        _, allowed, default, _ = written[key]
        if get_origin(field.annotation) is Literal:
            choices = [f'"{choice}"' for choice in get_args(field.annotation)]
            assert ticked(allowed) == choices, key
        elif field.annotation is bool:
            assert ticked(allowed) == ["true", "false"], key
        else:
            shown = tuple(float(number) for number in _NUMBER.findall(allowed))
            expected = limits(field) or (mpdcc_drive.TS_PU_MIN, mpdcc_drive.TS_PU_MAX)
            assert shown == expected, key
        if field.is_required() or (prefix and key == "machine.type"):
            assert not default, key
        elif field.default is None:  # of the guard
            follows = key.removeprefix("guard.") in GuardTable.OPTIONAL
            starts = "to turn" if key.startswith("mechanics") else "to start"
            assert default == ("from `control.ts`" if follows else starts), key
        else:
            assert json.loads(default.strip("`")) == field.default, key


def test_the_example_gives_the_shipped_drive() -> None:
    names: dict[str, Any] = {}
    text = between(DOCS / "drive-file.md", "example")
    exec(text.partition("```python\n")[2].partition("```")[0], names)
    drive = drive_file.load_mpdcc_drive(ROOT / "drives" / "anpc5l_6kv.toml")
    for key in ("rs", "rr", "xls", "xlr", "xm"):
        assert names[key] == pytest.approx(getattr(drive.machine, key), rel=5e-3), key
    for key in ("vdc", "xdc", "xph"):
        assert names[key] == pytest.approx(getattr(drive.inverter, key), rel=5e-3), key
    assert names["voltage"] == pytest.approx(drive.base.voltage, rel=1e-3)
    assert names["current"] == pytest.approx(drive.base.current, rel=1e-3)


# --- traces and decisions -------------------------------------------------------------------------


def columns(name: str) -> list[str]:
    """Columns that a table of section 4 names."""
    return [cell for row in rows(between(SPECIFICATION, name)) for cell in ticked(row[0])]


def header(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()[0].split(",")


def test_every_column_is_specified(tmp_path: Path) -> None:
    real, flag, path = np.zeros(1), np.zeros(1, np.int64), tmp_path / "file.csv"
    state = trace.MpdccTrace(
        np.zeros((1, 4)), np.zeros((1, 4)), real, np.zeros((1, 2)), real, real,
        np.zeros((1, 3), np.int64),
    )  # fmt: skip
    trace.write_trace(path, state)
    assert header(path) == columns("trace of mpdcc")
    decisions = trace.Decisions(np.zeros((1, 3), np.int64), flag, flag, flag, flag, flag, flag)
    trace.write_decisions(path, decisions)
    assert header(path) == columns("decisions of mpdcc")
    vectors = np.zeros((1, 2))
    applied = np.zeros((1, 3), np.int64), vectors
    seen = mptc_trace.MptcTrace(vectors, vectors, real, real, real, flag, *applied, v_dc=real)
    mptc_trace.write_trace(path, seen)
    assert header(path) == columns("trace of mptc")
    mptc_trace.write_trace(path, mptc_trace.MptcTrace(vectors, vectors, real, real, real, flag))
    assert header(path) == columns("trace of mptc")[:-6]
    mptc_trace.write_decisions(path, mptc_trace.MptcDecisions(flag, flag, flag, *applied))
    several = header(path)
    assert several == columns("decisions of mptc")[1:]
    mptc_trace.write_decisions(path, mptc_trace.MptcDecisions(flag, flag, flag))
    assert header(path) == ["u", *several[-2:]] == [columns("decisions of mptc")[0], *several[-2:]]


def test_every_public_name_is_specified() -> None:
    listed = [name for row in rows(between(SPECIFICATION, "names")) for name in ticked(row[0])]
    assert sorted(listed) == sorted(directmpc.__all__)


# --- commands -------------------------------------------------------------------------------------


def test_every_make_target_is_described() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z][a-z-]*):[^=#]*##", text, re.M))
    page = (DOCS / "commands.md").read_text(encoding="utf-8")
    assert set(re.findall(r"\bmake (?:-s )?([a-z][a-z-]*)", page)) >= targets - {"help"}


# --- VHDL -----------------------------------------------------------------------------------------


@functools.cache
def units() -> tuple[dict[str, Path], dict[str, Path]]:
    """Entities and packages of the design with their files."""
    entities: dict[str, Path] = {}
    packages: dict[str, Path] = {}
    for path in sources.rtl_files():
        text = path.read_text(encoding="utf-8")
        entities |= dict.fromkeys(re.findall(r"^entity\s+(\w+)\s+is", text, re.M), path)
        packages |= dict.fromkeys(re.findall(r"^package\s+(?!body)(\w+)\s+is", text, re.M), path)
    return entities, packages


def generics(entity: str) -> dict[str, str]:
    """Generics of an entity with their defaults, in order."""
    text = units()[0][entity].read_text(encoding="utf-8")
    head = re.search(rf"^entity\s+{entity}\s+is\s+generic\s*\((.*?)^\s*\);", text, re.M | re.S)
    assert head, entity
    found = re.findall(r"^\s*([A-Z]\w*)\s*:[^;]*?:=\s*(\w+)", head.group(1), re.M)
    assert found, entity
    return dict(found)


def test_every_generic_is_specified() -> None:
    table = rows(between(SPECIFICATION, "generics"))
    written = {ticked(row[0])[0]: dict(re.findall(r"`(\w+)` (\w+)", row[1])) for row in table}
    assert set(written) == set(PUBLIC)
    for entity in PUBLIC:
        assert written[entity] == generics(entity), entity
    described = [name for row in rows(between(SPECIFICATION, "ranges")) for name in ticked(row[0])]
    assert sorted(described) == sorted({one for found in written.values() for one in found})


def test_the_instantiation_has_every_port() -> None:
    text = units()[0]["mpdcc_core"].read_text(encoding="utf-8")
    head = text.partition("  port (")[2].partition("end entity")[0]
    ports = re.findall(r"^\s*(\w+)\s*:\s*(?:in|out)\s", head, re.M)
    bench = (ROOT / "examples" / "own_bench.vhd").read_text(encoding="utf-8")
    instance = bench.partition("entity work.mpdcc_core")[2].partition("p_test")[0]
    shown = re.findall(r"(\w+) => ", instance)
    assert [name for name in shown if name.islower()] == ports
    assert [name for name in shown if name.isupper()] == list(generics("mpdcc_core"))


def test_the_clocks_are_the_budgets() -> None:
    text = SPECIFICATION.read_text(encoding="utf-8").partition("### 6.3")[2].partition("## 7")[0]
    table = {row[0]: row[1:] for row in rows(text)}
    for name, variant in (("fast", "fast"), ("paper", "paper")):
        held, searched = table[name]
        assert int(held) == clocks_of("mpdcc_core", "hold", variant)
        bounds = [int(x) for x in re.findall(r"\d+", searched.rpartition(":")[2].replace(",", " "))]
        if variant == "fast":
            assert bounds == [worst_clocks(n, variant) for n in range(1, 5)]
        else:
            shown = searched.rpartition(":")[2].split(", ")
            assert [int(x.replace(",", "")) for x in shown[:4]] == [
                worst_clocks(n, variant) for n in range(1, 5)
            ]
    shown = table["fast, SESE without a budget"][1].split(", ")
    assert [int(x.replace(",", "")) for x in shown] == [
        worst_clocks(n, "sese") for n in range(1, 5)
    ]


# --- positions ------------------------------------------------------------------------------------


def test_the_positions_are_the_inverters() -> None:
    page = rows(between(DOCS / "positions.md", "positions"))
    assert len(page) == inverter.POSITIONS
    for s, row in enumerate(page):
        g, a, b = s >> 2 & 1, s >> 1 & 1, s & 1
        following = ", ".join(map(str, inverter.NEXT_POSITIONS[s]))
        assert row[0] == str(s)
        assert row[1] == f"{g} {a} {b}"
        assert row[2] == f"{g} {1 - g} {g} {1 - g}"
        assert row[3] == f"{a} {b} {1 - b} {1 - a}"
        assert int(row[4]) == inverter.LEVEL[s]
        terms = (
            ("-v_dc/2", inverter.HALF_DC[s] < 0), ("+v_dc/2", inverter.HALF_DC[s] > 0),
            ("v_n", inverter.NEUTRAL[s] > 0), ("+ v_ph", inverter.CAPACITOR[s] > 0),
            ("- v_ph", inverter.CAPACITOR[s] < 0),
        )  # fmt: skip
        assert all((term in row[5]) == there for term, there in terms), s
        assert int(row[6]) == inverter.CAPACITOR_CURRENT[s]
        assert int(row[7]) == inverter.NEUTRAL_CURRENT[s]
        assert row[8] == following


# --- metrics --------------------------------------------------------------------------------------


def expanded(path: str) -> list[str]:
    """A path with braces as all the paths it stands for."""
    found = re.search(r"\{([^}]*)\}", path)
    if not found:
        return [path]
    return [
        one
        for choice in found.group(1).split(",")
        for one in expanded(path[: found.start()] + choice + path[found.end() :])
    ]


def test_the_paths_of_the_metrics_exist() -> None:
    document = json.loads((ROOT / "reports" / "metrics.json").read_text(encoding="utf-8"))
    named = [path for row in rows(between(SPECIFICATION, "metrics")) for path in ticked(row[0])]
    assert len(named) > 15
    for path in (one for name in named for one in expanded(name)):
        level = [document]
        for part in path.split("."):
            if part == "<n>":
                level = [value for one in level for key, value in one.items() if key.isdigit()]
            elif part.startswith("<"):
                level = [value for one in level for value in one.values()]
            else:
                level = [one[part] for one in level if part in one]
            assert level, path


# --- equations ------------------------------------------------------------------------------------


@functools.cache
def functions(path: Path) -> frozenset[str]:
    """Names that a module defines."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    kinds = (ast.FunctionDef, ast.ClassDef)
    return frozenset(node.name for node in tree.body if isinstance(node, kinds))


def test_the_equations_lead_somewhere() -> None:
    page = DOCS / "equations.md"
    entities, packages = units()
    text = page.read_text(encoding="utf-8").partition("## Paper A")[2].partition("## Entities")[0]
    seen = 0
    for row in (line for line in text.splitlines() if line.startswith("|")):
        cells = [cell.strip() for cell in row.split("|")[1:-1]]
        module: Path | None = None
        for name in ticked(cells[2]) if len(cells) > 2 else []:
            if name.endswith(".py"):
                module = LIBRARY / name
                assert module.is_file(), f"{page.name}: {name}"
            else:
                assert module, f"{page.name}: {name} stands behind no module"
                assert name in functions(module), f"{page.name}: {module.name} has no {name}"
            seen += 1
        for name in ticked(cells[3]) if len(cells) > 3 else []:
            assert name in entities, f"{page.name}: no entity {name}"
            seen += 1
    assert seen > 60
    for name, found in (("entities", entities), ("packages", packages)):
        listed = [one for row in rows(between(page, name)) for one in ticked(row[1])]
        assert sorted(listed) == sorted(found), f"{page.name}: each of the {name} once"
    built = {path.relative_to(LIBRARY).as_posix() for path in LIBRARY.rglob("*.py")}
    listed = [one for row in rows(between(page, "modules")) for one in ticked(row[1])]
    assert sorted(listed) == sorted(built), f"{page.name}: each module once"


def test_alternatives_and_headers_lead_to_each_other() -> None:
    page = ROOT / "rtl" / "alternatives.md"
    text = page.read_text(encoding="utf-8")
    named = set(re.findall(r"^\| `(\w+)` \|", text, re.M))
    entities, packages = units()
    assert named <= set(entities) | set(packages)
    for name, path in (entities | packages).items():
        if page.name in path.read_text(encoding="utf-8"):
            assert name in named, f"{page.name}: {name} refers to it and has no row"


# --- links ----------------------------------------------------------------------------------------


def pages() -> list[Path]:
    """Every Markdown page of the repository."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [ROOT / line for line in listed.stdout.splitlines() if (ROOT / line).is_file()]


def anchors(path: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    found: set[str] = set()
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
    for heading in re.findall(r"^#+ (.*)$", text, re.M):
        plain = re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")
        count = 0
        while (anchor := f"{plain}-{count}" if count else plain) in found:
            count += 1
        found.add(anchor)
    return found


def dead_links(path: Path) -> list[str]:
    """Links of a page to files or headings that do not exist."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
    dead = []
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+://", target):
            continue
        name, _, anchor = target.partition("#")
        goal = (path.parent / name).resolve() if name else path
        wrong_anchor = anchor and goal.suffix == ".md" and goal.is_file()
        if not goal.exists() or (wrong_anchor and anchor not in anchors(goal)):
            dead.append(target)
    return dead


def test_no_link_is_dead() -> None:
    found = {path.relative_to(ROOT).as_posix(): dead_links(path) for path in pages()}
    assert not {name: dead for name, dead in found.items() if dead}


def test_a_dead_link_is_found(tmp_path: Path) -> None:
    (tmp_path / "other.md").write_text("# One\n\n# One\n\n## `two`: 3.1 Four, five\n")
    page = tmp_path / "page.md"
    page.write_text(
        "# Here\n[a](other.md#one) [b](other.md#one-1) [c](other.md#two-31-four-five) [d](#here)\n"
        "[e](none.md) [f](other.md#none) [g](#none)\n```\n[h](in-code.md)\n```\n"
    )
    assert dead_links(page) == ["none.md", "other.md#none", "#none"]


def test_named_files_exist() -> None:
    """Paths of this repository that pages, comments and docstrings name."""
    path = re.compile(
        r"(?<![\w/.<-])((?:model|docs|scripts|tb|rtl|drives|constraints|registers|directmpc)/[\w/.-]*?"
        r"\.(?:py|vhd|md|toml|sh|cpp|lpf|rdl|xdc|ucf|tcl))\b"
    )
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    named = [
        f"{name}: {found}"
        for name in listed.stdout.splitlines()
        if name.startswith(("docs/", "model/", "rtl/", "scripts/", "README.md", "Makefile"))
        and name.endswith((".py", ".vhd", ".md", ".toml", ".sh", "Makefile"))
        and (ROOT / name).is_file()
        for found in path.findall((ROOT / name).read_text(encoding="utf-8"))
        if not any((base / found).exists() for base in (ROOT, ROOT / "model", (ROOT / name).parent))
    ]
    assert not named


#: Python of whoever reads, which may know neither the tools nor their packages.
BARE = re.compile(r"(?<!bin/)python3? -m scripts")


def test_commands_name_the_python_of_the_setup() -> None:
    """Comments of a page, as those around tables, are no commands."""
    assert BARE.search("run `python -m scripts pwm`")
    found = {
        path.name: BARE.findall(re.sub(r"<!--.*?-->", "", path.read_text("utf-8"), flags=re.S))
        for path in pages()
        if path.name != "CHANGELOG.md"
    }
    assert not {name: commands for name, commands in found.items() if commands}


def test_the_picture_of_the_system_names_entities() -> None:
    text = (DOCS / "system.svg").read_text(encoding="utf-8")
    named = set(re.findall(r"\b(?:mpdcc|mptc|gate)_\w+", text))
    assert {"mpdcc_system", "mptc_system", "mpdcc_core", "mptc_core", "gate_guard"} <= named
    assert named <= set(sources.entities())


def test_every_page_is_listed() -> None:
    listed = set(re.findall(r"\]\(([\w-]+\.md)\)", (DOCS / "README.md").read_text("utf-8")))
    assert listed == {path.name for path in DOCS.glob("*.md")} - {"README.md"}


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) < 200
