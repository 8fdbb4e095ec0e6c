"""The picture of reports/robustness.md, from reports/robustness.csv.gz alone."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scripts.hdl import states
from scripts.publish import study_figures
from scripts.shared.figures import drive_title, pyplot, save_png
from scripts.studies import robustness

PICTURE = robustness.REPORT.with_name("robustness.png")
BOUND = 0.10
NOISES = (1.0, 2.0)
#: Outside rule and gain of the filters -> colour: the rules by hue, the filters by shade.
COLOURS = {
    ("dead", 1.0): "#d1495b",
    ("dead", robustness.GAIN): "#eda3ad",
    ("inwards", 1.0): "#1b6ca8",
    ("inwards", robustness.GAIN): "#6fa8d0",
    ("inwards", robustness.LOWER_GAIN): "#b9d6ea",
}


def draw(rows: Mapping[robustness.Setting, Mapping[str, float]], path: Path = PICTURE) -> None:
    """Draw what noise and remedies change of the switching frequency."""
    shipped = study_figures.shipped(rows)
    points = list(itertools.product(study_figures.HORIZONS, robustness.SPEEDS))
    plt = pyplot()
    figure, axes = plt.subplots(
        len(robustness.DRIVES), len(NOISES), figsize=(9.0, 6.4), sharex=True, sharey=True,
        layout="constrained",
    )  # fmt: skip
    places = itertools.product(robustness.DRIVES, NOISES)
    for (name, noise), axis in zip(places, axes.flat, strict=True):
        found = shipped[name][str(BOUND)]
        _bars(axis, found, noise, points)
        current, voltage = noise * robustness.NOISE_CURRENT, noise * robustness.NOISE_VOLTAGE
        axis.set_title(
            f"{drive_title(states.shipped(name).base.voltage)}, noise {noise:g}:\n"
            f"{current:g} pu rms on currents, {voltage:g} on voltages",
            fontsize=9,
        )
    for axis in axes[-1]:
        axis.set_xticks(range(len(points)), [f"{kind}\n{speed:g} pu" for kind, speed in points])
    for axis in axes[:, 0]:
        axis.set_ylabel("change of the switching frequency (%)")
    axes[0, 0].legend(frameon=False, loc="upper left")
    figure.suptitle(
        'Noisy measurements against exact ones with the rule "dead", by rule and filters\n'
        f"fast variant, weighted deadlock rule, compensated delay, bound {BOUND:g} pu, "
        "rated current; 1 and 0.6 pu speed; no bar: not run",
        fontsize=10,
    )
    save_png(figure, path)
    plt.close(figure)


def _bars(
    axis: Any, found: Mapping[str, Any], noise: float, points: list[tuple[str, float]]
) -> None:
    """A bar for each remedy at each point."""
    width = 0.8 / len(COLOURS)
    for n, ((rule, gain), colour) in enumerate(COLOURS.items()):
        known = found.get(study_figures.remedy(noise, rule, gain), {})
        values = [known.get(f"{k} {v}", {}).get("fsw_change_pct", np.nan) for k, v in points]
        axis.bar(
            np.arange(len(points)) + width * (n - (len(COLOURS) - 1) / 2), values, width,
            color=colour, label=study_figures.label(rule, gain),
        )  # fmt: skip
    axis.axhline(0.0, color="0.35", linewidth=0.8)
