"""What has to be reached, what was, and where it is less.

The goals stand in ``goals.toml``. What was measured is kept below build/coverage under a digest of
what it was measured from, so that a run that was stopped goes on there.
"""

from __future__ import annotations

import json
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from scripts.hdl import conversion, coverage, sources
from scripts.shared import progress, tables, tools
from scripts.shared.tools import BUILD, ROOT, ToolError
from scripts.studies import mapped
from scripts.studies.coverage import functional, python, rtl
from scripts.studies.torture import blocks

GOALS = Path(__file__).with_name("goals.toml")
RESULTS = BUILD / "coverage.json"
PAGE = ROOT / "reports" / "coverage.md"
PARTS = ("functional", "python", "rtl", "mapped")
KEPT = BUILD / "coverage"
BLOCKS = Path(blocks.__file__).parent
SEED = 3


@dataclass
class Goals:
    """As the file has them."""

    least: int  #: How often each functional goal has to be met.
    functional: dict[str, list[str]]  #: Group -> what has to happen in it.
    tests: list[str]  #: Tests whose branches count.
    python: dict[str, float]  #: Part of the library -> least share of its branches, in percent.
    rtl: dict[str, list[float]]  #: Entity -> least shares of conditions and of bits, in percent.
    mapped: int  #: Fewest decisions of each mapped netlist; none of them may differ.
    #: Entity -> why its shares are below those of others.
    argued: dict[str, str] = field(default_factory=dict)


def read(path: Path = GOALS) -> Goals:
    """Read the goals."""
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"))
        functional_goals = dict(found["functional"])
        return Goals(
            int(functional_goals.pop("least")),
            {name: list(_expanded(wanted)) for name, wanted in functional_goals.items()},
            list(found["python"]["tests"]),
            dict(found["python"]["branches"]),
            dict(found["rtl"]["shares"]),
            int(found["mapped"]["least"]),
            dict(found["rtl"].get("argued", {})),
        )
    except (tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise ToolError(f"{path.name}: {error}") from None


def _expanded(names: Iterable[str]) -> Iterable[str]:
    """Names with one list in braces stand for one name for each entry."""
    for name in names:
        before, brace, rest = name.partition("{")
        if not brace:
            yield name
            continue
        inside, _, after = rest.partition("}")
        for one in inside.split("|"):
            yield from _expanded([f"{before}{one.strip()}{after}"])


# --- measuring ------------------------------------------------------------------------------------


def of_functions(blocks: int = 64, rows: int = 512) -> dict[str, Counter[str]]:
    """Count what both algorithms do."""
    return {
        "one_switching": functional.one_switching(blocks, rows, SEED),
        "two_switchings": functional.two_switchings(max(blocks // 4, 4), max(rows // 3, 1), SEED),
        "mptc": functional.mptc(rows, SEED) + functional.ties_of_vectors(),
    }


def _kept(name: str, files: Iterable[Path | str], measured: Callable[[], Any]) -> Any:
    """What was measured from files as they are; measured now if nothing was."""
    path = KEPT / f"{name.replace(', ', '-').replace(' ', '_')}-{tools.digest(*files)[:16]}.json"
    if not path.exists():
        tools.write(path, json.dumps(measured()))
    return json.loads(path.read_text(encoding="utf-8"))


def _library() -> list[Path]:
    return sorted([*python.LIBRARY.rglob("*.py"), *python.LIBRARY.rglob("*.toml")])


def of_netlist(name: str) -> dict[str, coverage.Seen]:
    """Run the vectors of a netlist, or find what they saw."""
    top, chosen, vectors = rtl.RUNS[name]
    files = (vectors.__code__.co_filename, blocks.__file__, coverage.__file__)
    netlist = conversion.cached(top, chosen)
    found = _kept(name, (netlist, *map(Path, files)), lambda: packed(rtl.measure(name)))
    return unpacked(found)


def of_mapped() -> dict[str, list[int]]:
    """Decisions of the mapped netlists, or those that were made before."""
    found: dict[str, list[int]] = {}
    for entity in mapped.CORES:
        for family in mapped.FAMILIES:
            name = f"{entity}, {family}"
            with progress.busy(f"the mapped netlist of {name}"):
                netlist = mapped.mapped(entity, family)
                files = (netlist, Path(mapped.__file__), Path(blocks.__file__))
                found[name] = _kept(name, files, partial(_decisions, entity, family))
    return found


def _decisions(entity: str, family: str) -> list[int]:
    """Decisions of a mapped netlist, and how many of them differ."""
    result = mapped.check(entity, family)
    return [result.checked, mapped.differing(result)]


def packed(seen: Mapping[str, coverage.Seen]) -> dict[str, Any]:
    """What was seen, as JSON can hold it."""
    return {
        entity: {
            "conditions": [
                [c.file, c.line, c.column, c.arm, ways] for c, ways in one.conditions.items()
            ],
            "bits": [[signal, bit, ways] for (signal, bit), ways in one.bits.items()],
        }
        for entity, one in seen.items()
    }


def unpacked(document: Mapping[str, Any]) -> dict[str, coverage.Seen]:
    """The opposite of `packed`."""
    return {
        entity: coverage.Seen(
            {coverage.Condition(*place): ways for *place, ways in one["conditions"]},
            {(signal, bit): ways for signal, bit, ways in one["bits"]},
        )
        for entity, one in document.items()
    }


def of_rtl(names: Iterable[str]) -> dict[str, coverage.Seen]:
    """What all netlists have seen together."""
    found: dict[str, coverage.Seen] = {}
    for name in names:
        with progress.busy(f"vectors through {name}"):
            for entity, one in of_netlist(name).items():
                found.setdefault(entity, coverage.Seen()).join(one)
    return found


def shares(seen: Mapping[str, coverage.Seen]) -> dict[str, dict[str, list[int]]]:
    """Conditions, lines and bits of every entity."""
    files = {name: path.name for name, path in sources.entities().items()}
    return {
        entity: {
            "conditions": list(one.of_conditions()),
            "lines": list(one.of_lines(files.get(entity, f"{entity}.vhd"))),
            "bits": list(one.of_bits()),
        }
        for entity, one in sorted(seen.items())
    }


def measure(parts: Iterable[str], goals: Goals, netlists: Iterable[str] = ()) -> dict[str, Any]:
    """Measure some parts."""
    commit, _ = tools.git_state()
    found: dict[str, Any] = {"commit": commit}
    for part in parts:
        if part == "functional":
            with progress.busy("decisions of both algorithms"):
                written = [*_library(), Path(functional.__file__), *BLOCKS.glob("*.py")]
                found[part] = _kept(part, written, of_functions)
        elif part == "python":
            with progress.busy("tests of the library, with branches"):
                tests = [ROOT / test.partition("::")[0] for test in goals.tests]
                written = [*_library(), *tests, *goals.tests]
                found[part] = _kept(part, written, lambda: python.measure(goals.tests))
        elif part == "mapped":
            found[part] = of_mapped()
        else:
            found[part] = shares(of_rtl(list(netlists) or list(rtl.RUNS)))
    return found


# --- judging --------------------------------------------------------------------------------------


def percent(pair: Iterable[int]) -> float:
    """A share in percent; 100 of nothing."""
    some, of = pair
    return 100 * some / of if of else 100.0


def missed(found: Mapping[str, Any], goals: Goals) -> list[str]:
    """Goals that what was measured does not reach."""
    lines = []
    for group, wanted in goals.functional.items() if "functional" in found else ():
        counts = found["functional"].get(group, {})
        for name in wanted:
            if counts.get(name, 0) < goals.least:
                lines.append(f"{group}: '{name}' {counts.get(name, 0)} times, not {goals.least}")
    for part, least in goals.python.items() if "python" in found else ():
        reached = percent(found["python"].get(part, (0, 1)))
        if reached < least:
            lines.append(f"{part}: {reached:.1f} % of the branches, not {least:g} %")
    for entity, (conditions, bits) in goals.rtl.items() if "rtl" in found else ():
        one = found["rtl"].get(entity)
        if one is None:
            lines.append(f"{entity}: no vector reaches it")
            continue
        for what, least in (("conditions", conditions), ("bits", bits)):
            reached = percent(one[what])
            if reached < least:
                lines.append(f"{entity}: {reached:.1f} % of the {what}, not {least:g} %")
    if "rtl" in found:
        lines += [
            f"{entity}: no goal in {GOALS.name}"
            for entity in found["rtl"]
            if entity not in goals.rtl
        ]
    for name, (decisions, differing) in found.get("mapped", {}).items():
        if differing:
            lines.append(f"{name}, mapped: {differing} of {decisions} decisions differ")
        if decisions < goals.mapped:
            lines.append(f"{name}, mapped: {decisions} decisions, not {goals.mapped}")
    return lines


def _share(pair: Iterable[int]) -> str:
    some, of = pair
    return f"{some} of {of}" if of else "none"


def _of_functions(found: Mapping[str, Any], goals: Goals) -> list[str]:
    rows = [
        (group.replace("_", " "), name, f"{found[group].get(name, 0):,}")
        for group, wanted in goals.functional.items()
        for name in wanted
    ]
    head = f"Each of these has to happen {goals.least} times at least."
    return [head, "", tables.markdown(("group", "what", "decisions"), rows, "llr")]


def _of_library(found: Mapping[str, Any], goals: Goals) -> list[str]:
    files = Counter(test.partition("::")[0] for test in goals.tests)
    some = {file: f"{count} of " for file, count in files.items() if file not in goals.tests}
    head = "Branches that these tests take: " + ", ".join(
        f"{some.get(file, '')}`{file}`" for file in files
    )
    rows = [
        (f"`{part}`", _share(pair), f"{percent(pair):.1f} %", f"{goals.python.get(part, 0):g} %")
        for part, pair in found.items()
    ]
    return [f"{head}.", "", tables.markdown(("part", "branches", "share", "goal"), rows, "lrrr")]


def _of_entities(found: Mapping[str, Any], goals: Goals) -> list[str]:
    rows = []
    for entity in sorted({*found, *goals.rtl}):
        one = found.get(entity)
        least = " / ".join(f"{share:g} %" for share in goals.rtl.get(entity, ()))
        shares = ("not measured", "", "", "")
        if one is not None:
            counts = [_share(one[what]) for what in ("lines", "conditions", "bits")]
            shares = (*counts, f"{percent(one['bits']):.1f} %")
        rows.append((f"`{entity}`", *shares, least))
    head = ("entity", "lines", "conditions", "bits", "share of bits", "goal, conditions / bits")
    lines = [tables.markdown(head, rows, "lrrrrr")]
    if goals.argued:
        lines += ["", "Why some are lower:", ""]
        lines += [f"- `{entity}`: {why}" for entity, why in goals.argued.items()]
    return lines


def _of_cells(found: Mapping[str, Any], _: Goals) -> list[str]:
    rows = [
        (f"`{name.partition(', ')[0]}`", name.partition(", ")[2], f"{decisions:,}", str(differing))
        for name, (decisions, differing) in found.items()
    ]
    return [tables.markdown(("core", "family", "decisions", "differ"), rows, "llrr")]


_TABLES = {
    "functional": _of_functions, "python": _of_library, "rtl": _of_entities, "mapped": _of_cells,
}  # fmt: skip


def markdown(part: str, found: Mapping[str, Any], goals: Goals) -> str:
    """The tables of a part."""
    head = f"Measured at commit `{found['commit'][:12]}`."
    return "\n".join([head, "", *_TABLES[part](found[part], goals)])


def publish(found: Mapping[str, Any], goals: Goals, page: Path = PAGE) -> None:
    """Write the tables of the parts that were measured into the page."""
    texts = {marks(part): markdown(part, found, goals) for part in PARTS if part in found}
    tables.rewrite(page, texts)


def marks(part: str) -> tuple[str, str]:
    """What stands before and behind the tables of a part."""
    return (
        f"<!-- coverage, {part}: begin (written by make coverage) -->",
        f"<!-- coverage, {part}: end -->",
    )
