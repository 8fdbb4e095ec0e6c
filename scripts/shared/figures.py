"""How pictures look and how they are saved."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

from scripts.shared import tools

COLOURS = ("#1b6ca8", "#d1495b", "#3a7d44")
"""Of three lines that belong together, phases for instance."""


STYLE = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}


def drive_title(base_voltage: float) -> str:
    """A drive as titles name it."""
    return f"{math.sqrt(1.5) * base_voltage / 1e3:.3g} kV drive"


def pyplot() -> Any:
    """matplotlib's pyplot in the style of all pictures, drawing into memory."""
    import matplotlib  # here, not above: who draws nothing starts without it

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    plt.rcParams.update(STYLE)
    return plt


def in_si(axis: Any, factor: float, label: str) -> None:
    """Show the ordinates in SI units as well, at the right-hand side."""
    other = axis.secondary_yaxis("right", functions=(lambda y: y * factor, lambda y: y / factor))
    other.set_ylabel(label)
    other.spines["right"].set_visible(True)


def counted(number: int, word: str) -> str:
    """A number with its noun."""
    return f"{number} {word}{'' if number == 1 else 's'}"


def from_zero(axis: Any) -> None:
    """Let an axis of ordinates begin at zero, with room above what it shows."""
    axis.set_ylim(0.0, 1.07 * axis.dataLim.y1)


def save_png(figure: Any, path: Path, true_colour: bool = False) -> None:
    """Save a matplotlib figure as a PNG, whole or not at all."""
    if true_colour:
        with tools.replacing(path) as temporary:
            figure.savefig(temporary, format="png", dpi=110)
        return
    from PIL import Image

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    image = Image.open(buffer).convert("RGB").quantize(128, dither=Image.Dither.NONE)
    with tools.replacing(path) as temporary:
        image.save(temporary, format="PNG", optimize=True)
