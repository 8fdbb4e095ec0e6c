"""Pictures that are drawn from stored files can be read: nothing is cut off, titles say of what.

Stimulus: every picture that stored tables are enough for, drawn anew; figures with seeded faults.
Checks: no title, label or mark of a tick leaves its picture; no curve, bar or interval leaves its
axes; a title names the drive, or says that both drives of MPDCC are meant, and the speed; title
or legend say what decides; the file in reports/ is the one drawn, but for one pixel in ten
thousand, because another processor may round otherwise; drawn twice, the bytes are the same.
Does not prove: that a picture is well understood; anything of pictures that need a run.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from scripts.measure import sweep
from scripts.publish import noise, paper_b
from scripts.shared import figures, rows, tables
from scripts.shared.tools import ROOT
from scripts.studies import bounds, deadlocks, horizon, lengths, observer, pwm, robustness
from scripts.studies.fidelity import plots, study

DRIVE = ROOT / "drives" / "anpc5l_6kv.toml"
REPORTS = ROOT / "reports"


def _horizon(out: Path) -> None:
    for name in ("sese.csv.gz", "sese.md"):
        (out / name).write_bytes((horizon.REPORTS / name).read_bytes())
    horizon.draw_stored(DRIVE, out)


def _bounds(out: Path) -> None:
    stored = bounds.read(bounds.REPORT)
    bounds.draw(stored, out / "bounds.png")
    bounds.draw_capacitors(stored, out / "bounds_capacitors.png")


def _pwm(out: Path) -> None:
    pwm.draw(rows.read(pwm.REPORT, pwm.Setting, pwm.FIGURES), out / "pwm.png")


def _robustness(out: Path) -> None:
    noise.draw(robustness.read(robustness.REPORT), out / "robustness.png")


def _lengths(out: Path) -> None:
    lengths.draw(lengths.read(lengths.REPORT), out / "lengths.png")


def _sweep(out: Path) -> None:
    sweep.draw(sweep.stored_rows(), out / "design_space.png")


def _deadlocks(out: Path) -> None:
    (out / "deadlocks.csv.gz").write_bytes((REPORTS / "deadlocks.csv.gz").read_bytes())
    deadlocks.draw_stored(DRIVE, out)


def _observer(out: Path) -> None:
    stored = tables.read_csv(REPORTS / "observer.csv")
    found = [{k: v if k == "mismatch" else float(v) for k, v in row.items()} for row in stored]
    observer._plot(found, "6 kV drive", out / "observer.png")


def _paper_b(out: Path) -> None:
    found = paper_b.stored()
    paper_b._draw_bars(found, out / "paper_b_bars.png")
    paper_b._draw_speeds(found, out / "paper_b_speeds.png")


DRAWN: dict[str, tuple[ModuleType, Callable[[Path], None], int]] = {
    "fidelity": (plots, lambda out: study.draw_stored(out=out), 3),
    "sese": (horizon, _horizon, 2),
    "bounds": (bounds, _bounds, 2),
    "lengths": (lengths, _lengths, 1),
    "deadlocks": (deadlocks, _deadlocks, 1),
    "observer": (observer, _observer, 1),
    "paper-b": (paper_b, _paper_b, 2),
    "pwm": (pwm, _pwm, 1),
    "robustness": (noise, _robustness, 1),
    "sweep": (sweep, _sweep, 1),
}
"""Name -> module that saves, what draws into a folder, number of pictures."""


HIDDEN = {"deadlocks": 5e-3}
"""Picture -> share of an axis that may be cut off: less than a line is wide; 1e-9 for the others.

An interval of v_n's excess ends 0.0007 pu below zero, where no excess can be.
"""


def faults(figure: Any, hidden: float = 1e-9) -> list[str]:
    """What cannot be seen of a figure."""
    from matplotlib.text import Text

    figure.canvas.draw()
    frame = figure.bbox.padded(1.0)  # a pixel: letters are smoothed
    found, undrawn = [], set()
    for axis in figure.axes:
        for side in (axis.xaxis, axis.yaxis):
            low, high = sorted(side.get_view_interval())
            for tick in (*side.get_major_ticks(), *side.get_minor_ticks()):
                if not low <= tick.get_loc() <= high:
                    undrawn |= {tick.label1, tick.label2}
    for text in figure.findobj(Text):
        if text not in undrawn and text.get_visible() and text.get_text().strip():
            box = text.get_window_extent()
            inside = frame.x0 <= box.x0 and box.x1 <= frame.x1
            if not (inside and frame.y0 <= box.y0 and box.y1 <= frame.y1):
                found.append(f"cut off: {text.get_text()}")
    for axis in figure.axes:
        for name in "xy":
            low, high = sorted(getattr(axis, f"get_{name}lim")())
            least, most = sorted(getattr(axis.dataLim, f"interval{name}"))
            if getattr(axis, f"get_{name}scale")() == "log":
                least = getattr(axis.dataLim, f"minpos{name}")  # bars stand on zero
            spare = hidden * (high - low)
            if least < low - spare or most > high + spare:
                found.append(f"{name} from {low:g} to {high:g} shows not {least:g} to {most:g}")
    return found


def titles(figure: Any) -> str:
    """All titles of a figure."""
    return " ".join([figure.get_suptitle(), *(axis.get_title() for axis in figure.axes)])


def legends(figure: Any) -> str:
    """All texts of legends of a figure."""
    found = [axis.get_legend() for axis in figure.axes] + figure.legends
    return " ".join(text.get_text() for legend in found if legend for text in legend.get_texts())


def unlike(one: Path, other: Path) -> float:
    """Share of the pixels of two PNG files that differ; 1 if their sizes do."""
    first, second = figures.pyplot().imread(one), figures.pyplot().imread(other)
    if first.shape != second.shape:
        return 1.0
    return float(np.any(np.abs(first - second) > 0.1, axis=2).mean())


@pytest.mark.parametrize("name", ["lengths", "observer", "pwm"])
def test_the_same_figures_give_the_same_bytes(name: str, tmp_path: Path) -> None:
    made = [tmp_path / one for one in ("first", "second")]
    for folder in made:
        folder.mkdir()
        DRAWN[name][1](folder)
    (first,), (second,) = (list(folder.glob("*.png")) for folder in made)
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("name", DRAWN)
def test_pictures_can_be_read(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module, draw, count = DRAWN[name]
    seen: list[tuple[str, list[str], str, str]] = []
    hidden = HIDDEN.get(name, 1e-9)

    save = module.save_png

    def _look(figure: Any, path: Path, **options: Any) -> None:
        seen.append((path.name, faults(figure, hidden), titles(figure), legends(figure)))
        save(figure, path, **options)

    monkeypatch.setattr(module, "save_png", _look)
    draw(tmp_path)
    assert len(seen) == count
    for picture, found, said, listed in seen:
        assert not found, picture
        assert re.search(r"\d kV|\d kW|drives of MPDCC", said), picture
        assert re.search(r"variant|fast|model|bserver", f"{said} {listed}"), picture
        assert re.search(r"speed|pu|r/min|operating points", said) or name == "sweep", picture
        differing = unlike(tmp_path / picture, REPORTS / picture)
        assert differing < 1e-4, f"{picture}: {differing:.2%}; `make report` draws it anew"


def test_another_picture_is_found(tmp_path: Path) -> None:
    plt = figures.pyplot()
    made = []
    for title in ("speed 1 pu", "speed 2 pu"):
        figure, axis = plt.subplots(figsize=(3.0, 2.0))
        axis.set_title(title)
        made.append(tmp_path / f"{title}.png")
        figures.save_png(figure, made[-1])
        plt.close(figure)
    assert unlike(made[0], made[0]) == 0.0
    assert unlike(*made) > 1e-4


def test_faults_are_found() -> None:
    plt = figures.pyplot()
    figure, axis = plt.subplots(figsize=(3.0, 2.0))
    axis.plot([0.0, 1.0], [0.0, 8.0])
    assert faults(figure) == []
    axis.set_ylim(0.0, 7.7)
    assert [text for text in faults(figure) if text.startswith("y from 0 to 7.7")]
    figures.from_zero(axis)
    assert faults(figure) == []
    axis.set_title("a title that is much longer than the picture is wide, and goes on")
    assert faults(figure) == [f"cut off: {axis.get_title()}"]
    plt.close(figure)
