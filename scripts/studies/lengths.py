"""By how many steps the predicted length of a choice errs: Paper A, section VII-B.

The paper: "the FPGA implementation sometimes suffers from an error of one time step on the
predicted length of the switching sequence". Here the bit-true model closes the loop, at the bounds
of `scripts.studies.bounds`. In each of its searches that find a candidate inside all bounds, the
ideal controller says how long the chosen candidate stays there; the difference of the two lengths
is counted. The RTL has the model's lengths, bit for bit.

``python -m scripts lengths`` writes reports/lengths.csv.gz, the picture and the table of
reports/bounds.md.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from directmpc.mpdcc import ideal
from directmpc.mpdcc.closed_loop import ClosedLoopResult
from directmpc.mpdcc.drive import Drive
from scripts.shared import tables, tools
from scripts.shared.figures import COLOURS, pyplot, save_png
from scripts.shared.tools import ROOT
from scripts.shared.workers import Pool
from scripts.studies import bounds
from scripts.studies.bounds import BOUNDS, NAMES, PAGE

REPORT = ROOT / "reports" / "lengths.csv.gz"
PICTURE = ROOT / "reports" / "lengths.png"
COLUMNS = ("bound_pu", "controller", "error_steps", "searches")
VARIANTS = ("paper", "fast")
STARTS = 4
BEGIN = "<!-- lengths: begin (written by python -m scripts lengths) -->"
END = "<!-- lengths: end -->"

Row = dict[str, Any]


def errors(drive: Drive, result: ClosedLoopResult) -> np.ndarray:
    """Predicted length of each choice less the ideal controller's of the same candidate."""
    rows, decided = result.trace(), result.decisions
    parameters = ideal.ideal_parameters(drive)
    found = []
    for k in np.flatnonzero((decided.held == 0) & (decided.deadlock == 0)):
        _, positions, lengths, _ = ideal.candidates(
            parameters, rows.x_m[k], rows.x_inv[k], rows.vdc[k], rows.iref[k],
            rows.omega_s[k], rows.omega_r[k], rows.s_prev[k],
        )  # fmt: skip
        (chosen,) = np.flatnonzero(np.all(positions == decided.s[k], axis=1))
        found.append(int(decided.length[k]) - int(lengths[chosen]))
    return np.array(found, dtype=np.int64)


def point(bound: float, controller: str, starts: int, steps: int) -> list[Row]:
    """Errors at a bound."""
    made = [
        errors(*bounds.loop(bound, controller, "largest", start, steps)) for start in range(starts)
    ]
    values, counts = np.unique(np.concatenate(made), return_counts=True)
    return [
        dict(zip(COLUMNS, (bound, controller, int(value), int(count)), strict=True))
        for value, count in zip(values, counts, strict=True)
    ]


def study(jobs: int, starts: int = STARTS, steps: int = bounds.STEPS) -> list[Row]:
    """All rows."""
    wanted = [(bound, name, starts, steps) for name, bound in itertools.product(VARIANTS, BOUNDS)]
    with Pool(jobs) as pool:
        return [row for rows in pool.all("predicted lengths", point, wanted) for row in rows]


def read(path: Path) -> list[Row]:
    """Rows of a stored study."""
    return [
        {
            "bound_pu": float(row["bound_pu"]), "controller": row["controller"],
            "error_steps": int(row["error_steps"]), "searches": int(row["searches"]),
        }
        for row in tables.read_csv(path)
    ]  # fmt: skip


def histogram(rows: Sequence[Row], controller: str) -> dict[int, float]:
    """Share of the searches by the error of the length, over all bounds."""
    counts: dict[int, int] = {}
    for row in rows:
        if row["controller"] == controller:
            counts[row["error_steps"]] = counts.get(row["error_steps"], 0) + row["searches"]
    whole = sum(counts.values())
    return {error: 100.0 * counts[error] / whole for error in sorted(counts)}


def table(rows: Sequence[Row]) -> str:
    """Shares of searches by the size of the error."""
    lines = []
    for name in VARIANTS:
        shares = histogram(rows, name)
        searches = sum(row["searches"] for row in rows if row["controller"] == name)
        one = shares.get(-1, 0.0) + shares.get(1, 0.0)
        more = sum(share for error, share in shares.items() if abs(error) > 1)
        lines.append(
            (NAMES[name], searches, f"{shares.get(0, 0.0):.2f}", f"{one:.2f}", f"{more:.2f}",
             f"{min(shares):+d} to {max(shares):+d}")
        )  # fmt: skip
    head = ("controller", "searches", "exact, %", "one step, %", "more, %", "errors, steps")
    return tables.markdown(head, lines, "lr")


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw the histogram."""
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(6.8, 3.6), layout="constrained")
    shares = {name: histogram(rows, name) for name in VARIANTS}
    low = min(min(one) for one in shares.values())
    high = max(max(one) for one in shares.values())
    places = np.arange(low, high + 1)
    for shift, name, colour in zip((-0.2, 0.2), VARIANTS, COLOURS[1::-1], strict=True):
        values = [shares[name].get(int(error), 0.0) for error in places]
        axis.bar(places + shift, values, width=0.4, color=colour, label=NAMES[name])
    axis.set_yscale("log")
    axis.set_xlabel("predicted length less the ideal controller's of the same candidate (steps)")
    axis.set_ylabel("share of the searches (%)")
    axis.legend(frameon=False)
    figure.suptitle(
        f"6 kV drive, rated speed and current, SE, bounds {BOUNDS[0]:g} to {BOUNDS[-1]:g} pu",
        fontsize=10,
    )
    save_png(figure, path)
    plt.close(figure)


def publish(rows: Sequence[Row], page: Path = PAGE, picture: Path = PICTURE) -> None:
    """Write table and picture."""
    draw(rows, picture)
    tables.rewrite(page, {(BEGIN, END): table(rows)})


def write(rows: Sequence[Row], path: Path) -> None:
    """Store a study."""
    head = (
        f"drive: {bounds.DRIVE}, omega_s 1.0 pu, rated current, SE; {STARTS} starts of "
        f"{bounds.STEPS} steps",
        "command: python -m scripts lengths",
    )
    tools.write(path, tables.csv_text(rows, head, COLUMNS))


def regenerate(jobs: int, tables_only: bool) -> None:
    """Run the study, or take its file, and publish."""
    if not tables_only:
        write(study(jobs), REPORT)
    publish(read(REPORT))
