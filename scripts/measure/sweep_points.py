"""Points of `make sweep`: designs with other constants, and what is measured of one.

A point is the design with other constants. ``formats.py`` alone has them, so they are changed
there, in a copy of the tree under ``build/sweep``. The copy's model, its generated VHDL package and
its RTL follow, and every point is held to bit-exactness on simulated rows before anything is
measured of it.

What can be swept so: the number of explorers and the variant (generics), the word length of
trajectories, the fraction of the cost, the width of a length (and with it the longest horizon and
the stages of the search), the grain of the test for a turn. What cannot: bits of the length that a
stage of the search decides, and registers inside a stage. They are the structure of
explorer_fast and not a constant of it; reports/design_space.md says what is known of them.
"""

from __future__ import annotations

import os
import re
import shutil
import statistics
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.hdl.clocks import clocks_of, worst_clocks
from scripts.measure import budgets, pnr, synth
from scripts.shared import cache, tools
from scripts.shared.tools import BUILD, ROOT, ToolError

#: The one file in which a point differs from this design.
FORMATS = "model/directmpc/mpdcc/formats.py"
#: What a design is made of, and what measures it.
DESIGN = ("rtl/**/*.vhd", "model/directmpc/**/*.py")
DESIGNED = ("rtl", "model")
MEASURING = ("scripts", "tb", "converters", "drives", "constraints")
SPEEDS = (-1.0, -0.7, -0.4, -0.2, 0.2, 0.4, 0.7, 1.0)
STEPS = 20_000  # of the closed loop, per speed
#: Seeds of placement: a trend is asked for here, `make report` takes five.
SEEDS = 2
#: Variants and explorers that are placed: a placement takes minutes per seed.
PLACED = (("fast", 1), ("fast", 2), ("fast", 4), ("paper", 2))
DRIVE = "anpc5l_6kv"

#: Words that hold trajectory units, by their width in the default design; they get longer and
#: shorter together, because the unit does.
TRAJECTORY_WORDS = (
    "TERM_WIDTH", "CURRENT_TERM_WIDTH", "TRAJECTORY_WIDTH", "SEARCH_WIDTH", "CURVATURE_TERM_WIDTH",
    "CURVATURE_WIDTH", "START_SLOPE_WIDTH", "SLOPE_WIDTH", "MARGIN_WIDTH", "TURN_SHIFT",
    "TURN_WIDTH", "FORCED_WIDTH", "BOUND_WIDTH",
)  # fmt: skip


@dataclass(frozen=True)
class Point:
    """One design."""

    #: What is swept, and its value, for people.
    dimension: str
    setting: str
    #: Generics of the core.
    variant: str = "fast"
    explorers: int = 1
    #: Bits added to every trajectory word, 0 or fewer: with more, bounds do not fit their ports.
    trajectory: int = 0
    cost_fraction: int | None = None  #: Fractional bits of the cost, or None for the default.
    length_width: int | None = None  #: Bits of a length; the horizon is 2**length_width - 1.
    #: Bits of the slope that the test for a turn leaves out, or None.
    turn_shift: int | None = None
    seeds: int = 0  #: Of placement; 0: not placed.

    @property
    def is_default(self) -> bool:
        """Whether the constants are the shipped ones."""
        changed = (self.cost_fraction, self.length_width, self.turn_shift)
        return self.trajectory == 0 and all(value is None for value in changed)


def points() -> list[Point]:
    """The sweep."""
    found = []
    for variant in ("fast", "paper"):
        for n in range(1, 7):
            seeds = SEEDS if (variant, n) in PLACED else 0
            found.append(Point("explorers", f"{n}", variant, n, seeds=seeds))
    # 20 bits are left out: a word of 544 bits comes out as zeros, and GHDL 2.0 may have made it so
    for bits in (-1, -2, -3, -5):
        seeds = SEEDS if bits == -2 else 0
        found.append(Point("trajectory word", f"{24 + bits} bits", trajectory=bits, seeds=seeds))
    for fraction in (16, 12):
        found.append(Point("cost fraction", f"{fraction} bits", cost_fraction=fraction))
    found.append(Point("horizon", "15 steps", length_width=4))
    for shift in (0,):
        found.append(Point("turn test", f"{shift} bits left out", turn_shift=shift))
    return found


# --- the design with other constants --------------------------------------------------------------


@dataclass
class Edit:
    """Texts of one file and what stands there instead; each has to be there exactly once."""

    file: str
    pairs: list[tuple[str, str]] = field(default_factory=list)

    def apply(self, root: Path) -> None:
        """Rewrite the file below `root`."""
        path = root / self.file
        text = path.read_text(encoding="utf-8")
        for old, new in self.pairs:
            pattern = re.compile(old, re.M)
            if len(pattern.findall(text)) != 1:
                raise ToolError(
                    f"sweep: {self.file} has no single '{old}' any more: its author has moved what "
                    "this sweep changes; adapt scripts/measure/sweep_points.py"
                )
            text = pattern.sub(new, text)
        path.write_text(text, encoding="utf-8")


def _default_constants() -> dict[str, int]:
    """Integers of formats.py by name."""
    from directmpc.mpdcc import formats

    return {k: v for k, v in vars(formats).items() if k.isupper() and isinstance(v, int)}


def edit_of(point: Point) -> Edit:
    """What makes a copy of the tree the point's design: other constants in formats.py."""
    if point.trajectory > 0:
        raise ToolError("sweep: longer trajectory words need bounds wider than a host's")
    now = _default_constants()
    constants: dict[str, int] = {}
    if point.trajectory:
        constants |= {name: now[name] + point.trajectory for name in TRAJECTORY_WORDS}
    if point.cost_fraction is not None:
        constants["RECIPROCAL_FRACTION"] = point.cost_fraction
        constants["COST_WIDTH"] = (
            now["COST_WIDTH"] - now["RECIPROCAL_FRACTION"] + point.cost_fraction
        )
    if point.length_width is not None:
        constants["LENGTH_WIDTH"] = point.length_width
    if point.turn_shift is not None:
        constants["TURN_SHIFT"] = point.turn_shift
    found = Edit(FORMATS, [(rf"^{k} = \d+", f"{k} = {v}") for k, v in constants.items()])
    if point.cost_fraction is not None:
        # a unit this short has no room for equal f_s/L as equal words
        table = "[0] + [round(COST_UNIT / n) for n in range(1, 2 ** (LENGTH_WIDTH + 1))]"
        found.pairs += [
            (r"^COST_UNIT = 16_934_400", f"COST_UNIT = {2**point.cost_fraction}"),
            (
                r"^RECIPROCALS = _reciprocals\(\)",
                f"RECIPROCALS = np.array({table}, dtype=np.int64)",
            ),
        ]
    if point.trajectory:
        factor = 2.0**point.trajectory
        found.pairs += [
            (r'"fast": 29000\}', f'"fast": {int(29000 * factor)}}}'),
            (r"^COEFFICIENT_SHARE = 1.0", f"COEFFICIENT_SHARE = {factor}"),
        ]
    return found


def tree_of(point: Point) -> Path:
    """A tree with the point's design: this one, or a copy with other constants."""
    if point.is_default:
        return ROOT
    wanted = edit_of(point)
    files = [p for kind in DESIGN for p in sorted(ROOT.glob(kind))]
    key = cache.key(["scripts.generate.mpdcc_package"], repr(wanted), *files)
    tree = BUILD / "sweep" / f"{point.dimension.replace(' ', '_')}-{key}"
    ready = (tree / "ready").exists()
    if not ready:
        shutil.rmtree(tree, ignore_errors=True)
    # what measures is copied always, what is measured belongs to the key
    for folder in MEASURING if ready else (*DESIGNED, *MEASURING):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / folder, tree / folder, ignore=ignored, dirs_exist_ok=True)
    if ready:
        return tree
    (tree / "build").symlink_to(BUILD, target_is_directory=True)
    wanted.apply(tree)
    inside(tree, "-m", "scripts", "generate", "mpdcc_package")
    (tree / "ready").write_text(repr(wanted), encoding="utf-8")
    return tree


def inside(tree: Path, *command: str) -> str:
    """Run Python on a tree's own modules; what it prints."""
    path = os.pathsep.join([str(tree / "model"), str(tree)])
    done = subprocess.run(
        [sys.executable, *command],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": path},
        text=True,
        capture_output=True,
        check=False,
    )
    if done.returncode:
        raise ToolError("\n".join((done.stdout + done.stderr).strip().splitlines()[-15:]))
    return done.stdout


# --- measuring, inside the point's tree -----------------------------------------------------------


def _simulated(point: Point) -> dict[str, Any]:
    """Bit-exactness on the simulated RTL, and cycles of its slowest and its held decisions.

    The shipped design's are asserted by the tests, thousands of rows of them, and read here.
    """
    import numpy as np

    from directmpc.mpdcc import formats as f
    from directmpc.mpdcc.coefficients import COEFFICIENTS, OPTIONS

    if point.is_default:
        return {
            "cycles_worst": worst_clocks(point.explorers, point.variant),
            "cycles_hold": clocks_of("mpdcc_core", "hold", point.variant),
            "bit_exact_rows": None,
        }
    from scripts.hdl import mpdcc_rows as core
    from scripts.hdl import states

    rng = np.random.default_rng(5)
    rows = core.join(
        [
            core.slow_rows(point.variant),
            core.recorded_rows(12, rng, point.variant),
            *(_near(core, states, rng, point.variant) for _ in range(20)),
        ]
    )
    horizon = [*COEFFICIENTS, *OPTIONS].index("horizon")
    rows.registers[:, horizon] = np.minimum(rows.registers[:, horizon], 2**f.LENGTH_WIDTH - 1)
    expected = rows.model(point.variant)
    found = core.simulate(rows, point.explorers, point.variant, bound=budgets.PATIENCE)
    wrong = int(np.any(found.decisions != expected, axis=1).sum())
    if wrong:
        raise ToolError(f"{wrong} of {len(rows)} decisions of the RTL differ from the model")
    held = expected[:, 3] == 1
    return {
        "cycles_worst": int(found.cycles[~held].max()),
        "cycles_hold": int(found.cycles[held].max()),
        "bit_exact_rows": len(rows),
    }


def _near(core: Any, states: Any, rng: Any, variant: str) -> Any:
    """One disturbed state of a random drive."""
    from directmpc.mpdcc.coefficients import registers

    drive = states.random_drive(rng)
    return core.of_trace(states.near(drive, 1, rng), registers(drive, variant).array())


def _accuracy(point: Point) -> dict[str, Any]:
    """Share of decisions that differ from the ideal controller's, on the same states."""
    import numpy as np

    from directmpc.mpdcc import closed_loop, ideal
    from directmpc.mpdcc import formats as f
    from directmpc.mpdcc.closed_loop import OperatingPoint
    from directmpc.mpdcc.variants import VARIANTS
    from scripts.hdl import states

    drive = states.shipped(DRIVE)
    horizon = min(drive.control.horizon, 2**f.LENGTH_WIDTH - 1)
    shortened = drive.with_control(horizon=horizon)
    chosen = VARIANTS[point.variant]
    # a shorter horizon is an approximation: the ideal controller keeps the drive's own; its states
    # are the same for every point
    reference = ideal.ideal_parameters(drive)
    steps = searches = differing = searched = 0
    for speed in SPEEDS:
        run = closed_loop.simulate(
            drive, ideal.decide, reference, OperatingPoint(speed), STEPS, settle=2000
        )
        found = chosen.run(shortened, run.trace())
        wrong = np.any(found.s != run.decisions.s, axis=1)
        search = run.decisions.held == 0
        steps += len(wrong)
        searches += int(search.sum())
        differing += int(wrong.sum())
        searched += int((wrong & search).sum())
    return {
        "steps": steps,
        "mismatch_pct": round(100 * differing / steps, 3),
        "search_mismatch_pct": round(100 * searched / searches, 2),
    }


def _area(point: Point) -> dict[str, Any]:
    """Spartan-3 resources."""
    found = synth.measure("mpdcc_core", _generics(point), "xc3s")
    keys = ("lut", "ff", "mult", "bram", "slices_unpacked", "slices_packed")
    return {key: found[key] for key in keys}


def _frequency(point: Point) -> dict[str, Any]:
    """Clock frequency on ECP5."""
    if not point.seeds:
        return {"fmax_worst_mhz": None, "fmax_median_mhz": None, "seeds": 0}
    mapped = pnr.map_core(synth.Configuration("mpdcc_core", _generics(point)))
    values = []
    for seed in range(1, point.seeds + 1):
        report, config = pnr.place_seed(mapped, seed)
        values.append(pnr.evaluate(report, config, seed)["fmax_mhz"])
    return {
        "fmax_worst_mhz": min(values),
        "fmax_median_mhz": round(statistics.median(values), 2),
        "seeds": point.seeds,
    }


def _generics(point: Point) -> tools.Generics:
    return {"EXPLORERS": point.explorers, "FOLDED": point.variant == "paper"}


STEPS_OF_A_POINT: dict[str, Callable[[Point], dict[str, Any]]] = {
    "simulated": _simulated,
    "accuracy": _accuracy,
    "area": _area,
    "frequency": _frequency,
}

#: Fields of a point that a step does not depend on.
INDEPENDENT = {
    "simulated": ("seeds",),
    "accuracy": ("explorers", "seeds"),
    "area": ("seeds",),
    "frequency": (),
}
