"""A whole run: blocks until enough decisions are made; a next run goes on with the file.

The file holds sums only, and the states that differ as block and number, which
`blocks.run_mpdcc` and `blocks.run_mptc` make again.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.shared import tables, tools
from scripts.shared.tools import ROOT, ToolError
from scripts.shared.workers import Pool
from scripts.studies.torture import blocks

RESULTS = ROOT / "reports" / "torture.json"
PAGE = ROOT / "reports" / "torture.md"
MARKS = ("<!-- torture: begin (written by make torture) -->", "<!-- torture: end -->")
DECISIONS = 10_000_000
CONTROLLERS = ("mpdcc", "mptc")
_RUN = {"mpdcc": blocks.run_mpdcc, "mptc": blocks.run_mptc}
#: Blocks from one write of the file to the next.
_EVERY = 32


@dataclass
class Sums:
    """What has been decided so far by one controller."""

    done: set[int] = field(default_factory=set)  #: Numbers of the blocks.
    #: Kind of states -> its decisions, and those that differ.
    kinds: dict[str, list[int]] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)  #: What happened how often.
    worst: float = 0.0  #: As of ``blocks.Outcome``.
    #: Block and number of states that differ.
    listed: list[list[int]] = field(default_factory=list)

    def add(self, number: int, found: blocks.Outcome) -> None:
        """Count a block."""
        self.done.add(number)
        kind = self.kinds.setdefault(found.kind, [0, 0])
        kind[0] += found.counts["decisions"]
        kind[1] += found.counts["differing"]
        self.counts.update(found.counts)
        self.worst = max(self.worst, found.worst)
        self.listed += [[number, row] for row in found.listed]

    def document(self) -> dict[str, Any]:
        """The sums as JSON can hold them."""
        return {
            "done": _runs(self.done),
            "kinds": self.kinds,
            "counts": dict(sorted(self.counts.items())),
            "worst": self.worst,
            "listed": sorted(self.listed),
        }


def _runs(numbers: set[int]) -> list[list[int]]:
    """Numbers as the first and last of each stretch."""
    found: list[list[int]] = []
    for number in sorted(numbers):
        if found and found[-1][1] == number - 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    return found


def _read(path: Path, seed: int) -> dict[str, Sums]:
    """What the file has of this seed; nothing where there is none."""
    if not path.exists():
        return {name: Sums() for name in CONTROLLERS}
    kept = json.loads(path.read_text(encoding="utf-8"))
    if (kept["seed"], kept["rows"]) != (seed, blocks.ROWS):
        raise ToolError(
            f"{path.name}: is of seed {kept['seed']}; with --anew a run begins at the first block"
        )
    return {
        name: Sums(
            {n for first, last in kept[name]["done"] for n in range(first, last + 1)},
            kept[name]["kinds"],
            Counter(kept[name]["counts"]),
            kept[name]["worst"],
            kept[name]["listed"],
        )
        for name in CONTROLLERS
    }


def _write(path: Path, seed: int, sums: dict[str, Sums]) -> None:
    commit, _ = tools.git_state()
    document: dict[str, Any] = {"seed": seed, "rows": blocks.ROWS, "commit": commit}
    document |= {name: one.document() for name, one in sums.items()}
    tools.write_json(path, document)


def _one(controller: str, number: int, seed: int) -> blocks.Outcome:
    return _RUN[controller](number, seed)


def run(
    decisions: int,
    seed: int,
    jobs: int,
    path: Path,
    *,
    anew: bool = False,
    scheduler: str | None = None,
) -> dict[str, Sums]:
    """Run the blocks that are missing, half of the decisions for each controller."""
    sums = {name: Sums() for name in CONTROLLERS} if anew else _read(path, seed)
    wanted = math.ceil(decisions / len(CONTROLLERS) / blocks.ROWS)
    calls = [
        (name, number, seed)
        for number in range(wanted)
        for name in CONTROLLERS
        if number not in sums[name].done
    ]
    if not calls:
        return sums
    try:
        with Pool(jobs, scheduler) as pool:
            for n, (which, found) in enumerate(pool.each("blocks of decisions", _one, calls)):
                controller, number, _ = calls[which]
                sums[controller].add(number, found)
                if n % _EVERY == _EVERY - 1:
                    _write(path, seed, sums)
    finally:
        _write(path, seed, sums)
    return sums


def problems(sums: dict[str, Sums]) -> list[str]:
    """A line for each state that was found to differ."""
    return [
        f"{name}: block {number}, state {row}" for name in sums for number, row in sums[name].listed
    ]


def markdown(document: dict[str, Any]) -> str:
    """The tables of the page."""
    lines = [f"Seed {document['seed']}, commit `{document['commit'][:12]}`."]
    titles = {"mpdcc": "MPDCC, fast variant", "mptc": "MPTC and MPFC"}
    rows: list[Sequence[object]] = []
    for name, title in titles.items():
        for kind, (decisions, differing) in sorted(document[name]["kinds"].items()):
            rows.append((title, kind, f"{decisions:,}", f"{differing:,}"))
    whole = [document[name]["counts"] for name in titles]
    made = sum(one["decisions"] for one in whole)
    rows.append(("all", "", f"{made:,}", f"{sum(one['differing'] for one in whole):,}"))
    lines += ["", tables.markdown(("controller", "states", "decisions", "differ"), rows, "llrr")]
    counts = [
        (title, what, f"{count:,}")
        for name, title in titles.items()
        for what, count in sorted(document[name]["counts"].items())
        if what not in ("decisions", "differing")
    ]
    lines += ["", "What happened in them:", ""]
    lines.append(tables.markdown(("controller", "what", "decisions"), counts, "llr"))
    worst = document["mptc"]["worst"]
    lines += ["", f"MPTC and MPFC: at most {worst:.0%} of what rounding may explain."]
    return "\n".join(lines)


def publish(path: Path = RESULTS, page: Path = PAGE) -> None:
    """Write the tables of the page from the file of the results."""
    tables.rewrite(page, {MARKS: markdown(json.loads(path.read_text(encoding="utf-8")))})
