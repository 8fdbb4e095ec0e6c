"""Pictures that are drawn from stored files can be read: nothing is cut off, titles say of what.

Stimulus: every picture that stored tables are enough for, drawn anew; figures with seeded faults.
Checks: no title, label or mark of a tick leaves its picture; no curve, bar or interval leaves its
axes; a title names the drive, or says that both five-level drives are meant.
Does not prove: that a picture is well understood, nor that the file in reports/ is the one drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from scripts.measure import sweep
from scripts.publish import noise
from scripts.shared import figures, rows
from scripts.shared.tools import ROOT
from scripts.studies import bounds, horizon, lengths, pwm, robustness
from scripts.studies.fidelity import plots, study

DRIVE = ROOT / "drives" / "anpc5l_6kv.toml"


def _horizon(out: Path) -> None:
    for name in ("sese.csv", "sese.md"):
        (out / name).write_bytes((horizon.REPORTS / name).read_bytes())
    horizon.draw_stored(DRIVE, out)


def _bounds(out: Path) -> None:
    stored = bounds.read(bounds.REPORT)
    bounds.draw(stored, out / "bounds.png")
    bounds.draw_capacitors(stored, out / "capacitors.png")


def _pwm(out: Path) -> None:
    pwm.draw(rows.read(pwm.REPORT, pwm.Setting, pwm.FIGURES), out / "pwm.png")


def _robustness(out: Path) -> None:
    noise.draw(robustness.read(robustness.REPORT), out / "x.png")


DRAWN: dict[str, tuple[ModuleType, Callable[[Path], None], int]] = {
    "fidelity": (plots, lambda out: study.draw_stored(out=out), 3),
    "sese": (horizon, _horizon, 2),
    "bounds": (bounds, _bounds, 2),
    "lengths": (lengths, lambda out: lengths.draw(lengths.read(lengths.REPORT), out / "x.png"), 1),
    "pwm": (pwm, _pwm, 1),
    "robustness": (noise, _robustness, 1),
    "sweep": (sweep, lambda out: sweep.draw(sweep.stored_rows(), "0" * 12, out / "x.png"), 1),
}
"""Name -> module that saves, what draws into a folder, number of pictures."""


def faults(figure: Any) -> list[str]:
    """What cannot be seen of a figure.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        As it is saved.

    Returns
    -------
    list of str
        Texts that leave the picture, axes that show less than they hold.
    """
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
            spare = 1e-9 * (high - low)
            if least < low - spare or most > high + spare:
                found.append(f"{name} from {low:g} to {high:g} shows not {least:g} to {most:g}")
    return found


def titles(figure: Any) -> str:
    """All titles of a figure."""
    return " ".join([figure.get_suptitle(), *(axis.get_title() for axis in figure.axes)])


@pytest.mark.parametrize("name", DRAWN)
def test_pictures_can_be_read(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module, draw, count = DRAWN[name]
    seen: list[tuple[str, list[str], str]] = []

    def _look(figure: Any, path: Path, **_: Any) -> None:
        seen.append((path.name, faults(figure), titles(figure)))

    monkeypatch.setattr(module, "save_png", _look)
    draw(tmp_path)
    assert len(seen) == count
    for path, found, said in seen:
        assert not found, path
        assert "kV" in said or "five-level drives" in said, path


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
