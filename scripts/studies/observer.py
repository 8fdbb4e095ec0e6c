"""How far the rotor-flux observer is off, over speed and where the machine is not as assumed.

The drive runs in closed loop on the estimate alone: bit-true controller and observer, exact plant.
The plant's parameters are changed, controller and observer keep those of the drive file.  Each run
begins at the true flux and lasts two rotor time constants, of which the last eighth is looked at.

``python -m scripts observer`` writes reports/observer.csv, reports/observer.png and the
table in reports/observer.md.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from directmpc.compiled import njit
from directmpc.mpdcc import observer as rotor_flux_observer
from directmpc.mpdcc.bit_true import common
from directmpc.mpdcc.bit_true import fast as bit_true_fast
from directmpc.mpdcc.closed_loop import OperatingPoint, constant_profile
from directmpc.mpdcc.coefficients import registers
from directmpc.mpdcc.drive import Drive
from directmpc.mpdcc.plant import plant_data, plant_step
from scripts.hdl import states
from scripts.shared import progress, tables, tools
from scripts.shared.figures import drive_title, pyplot, save_png
from scripts.shared.tools import ROOT

SPEEDS = (0.05, 0.1, 0.2, 0.5, 1.0)
CROSSOVERS = (0.03, 0.1, 0.3)
COLOURS = {0.03: "C1", 0.1: "C0", 0.3: "C2"}
#: Looked at with every crossover; the others with the default one.
THOROUGH = ("none", "rs * 1.5", "rr * 1.5")
#: Name -> factors on the plant's machine, and on the speed that is measured.
MISMATCHES: dict[str, dict[str, float]] = {
    "none": {},
    "rs * 1.5": {"rs": 1.5},
    "rs * 0.5": {"rs": 0.5},
    "rr * 1.5": {"rr": 1.5},
    "rr * 0.7": {"rr": 0.7},
    "xm * 1.2": {"xm": 1.2},
    "xm * 0.8": {"xm": 0.8},
    "xls, xlr * 1.2": {"xls": 1.2, "xlr": 1.2},
    "speed * 1.001": {"speed": 1.001},
}


@dataclass(frozen=True)
class Error:
    """Error of an estimate against the plant's flux."""

    magnitude: float  #: Mean of |estimate|/|flux| - 1, percent.
    angle: float  #: Mean angle of estimate/flux, degrees; positive leads.
    vector: float  #: Mean of |estimate - flux|/|flux|, percent.
    worst: float  #: Largest of the same.
    flux: float  #: Mean of |flux|, pu: what the drive settles at.


@njit
def _loop(plant, register, c, state, x, s, iref, omega_s, omega_r, measured, vdc, estimate, flux):
    """Run the controller on the estimate, step by step; keep estimates and true fluxes.

    The loop is compiled for speed: the study has runs of many rotor time constants in all. It
    takes no `Controller`, since a compiled function cannot call an object's method.
    """
    order = np.array([0, 1, 4, 5, 6, 7, 8, 12])
    reference = np.empty(2)
    for k in range(len(iref)):
        reference[0], reference[1] = iref[k].real, iref[k].imag
        words, _ = common.encode_row(x[:4], x[4:], vdc, reference, omega_s, measured)
        a, b, _ = rotor_flux_observer.step_words(c, state, words[order], s)
        words[2], words[3] = a, b
        d = bit_true_fast.decide_words(register, words, s)
        estimate[k] = complex(a, b) / 9000.0
        flux[k] = complex(x[2], x[3])
        s[0], s[1], s[2] = d[0], d[1], d[2]
        plant_step(plant, x, s, omega_r, vdc)


def run(
    drive: Drive,
    omega_s: float,
    factors: dict[str, float] | None = None,
    crossover: float = rotor_flux_observer.CROSSOVER,
    steps: int | None = None,
    begin: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Estimates and true rotor fluxes of a run, per unit, complex."""
    factors = dict(factors or {})
    measured = factors.pop("speed", 1.0)
    machine = drive.machine
    changed = {name: factor * getattr(machine, name) for name, factor in factors.items()}
    real = dataclasses.replace(machine, **changed)
    count = steps or round(2.0 * machine.tau_r / drive.ts_pu)
    profile = constant_profile(drive, OperatingPoint(omega_s=omega_s), count)
    start = profile.start
    x = np.array([
        start.i_s.real, start.i_s.imag, start.psi_r.real, start.psi_r.imag, 0.0,
        *[0.25 * drive.inverter.vdc] * 3,
    ])  # fmt: skip
    turn = profile.iref[0] / start.i_s
    x[0], x[1] = (start.i_s * turn).real, (start.i_s * turn).imag
    x[2], x[3] = (start.psi_r * turn).real, (start.psi_r * turn).imag
    scale = rotor_flux_observer.FLUX_SCALE * 2**rotor_flux_observer.GUARD
    psi_r, i_s = begin * start.psi_r * turn, start.i_s * turn
    psi_s = machine.xm / machine.xr * psi_r + machine.d / machine.xr * i_s
    state = np.zeros(rotor_flux_observer.STATE_WORDS, dtype=np.int64)
    state[:4] = [round(v * scale) for v in (psi_r.real, psi_r.imag, psi_s.real, psi_s.imag)]
    state[4:6] = [round(v * 16_000.0) for v in (i_s.real, i_s.imag)]
    words, _ = rotor_flux_observer.coefficients(drive, crossover)
    estimate, flux = np.empty(count, dtype=complex), np.empty(count, dtype=complex)
    omega_r = float(profile.omega_r[0])
    _loop(
        plant_data(real, drive.inverter.xdc, drive.inverter.xph, drive.ts_pu),
        registers(drive, "fast").array(), rotor_flux_observer.array(words), state, x,
        np.array([3, 3, 3]), profile.iref, omega_s, omega_r, omega_r * measured,
        drive.inverter.vdc, estimate, flux,
    )  # fmt: skip
    return estimate, flux


def error(estimate: np.ndarray, flux: np.ndarray) -> Error:
    """Error over the last eighth of a run."""
    last = slice(len(flux) - len(flux) // 8, None)
    ratio = estimate[last] / flux[last]
    return Error(
        magnitude=100.0 * float(np.mean(np.abs(ratio)) - 1.0),
        angle=float(np.degrees(np.angle(np.mean(ratio)))),
        vector=100.0 * float(np.mean(np.abs(ratio - 1.0))),
        worst=100.0 * float(np.max(np.abs(ratio - 1.0))),
        flux=float(np.mean(np.abs(flux[last]))),
    )


def _table(drive: Drive) -> list[dict[str, object]]:
    """All operating points: a row of the CSV each."""
    rows: list[dict[str, object]] = []
    work = [
        (name, k, w)
        for name in MISMATCHES
        for k in CROSSOVERS
        for w in SPEEDS
        if name in THOROUGH or k == rotor_flux_observer.CROSSOVER
    ]
    with progress.counter("observer in closed loop", len(work)) as advance:
        for name, crossover, speed in work:
            found = error(*run(drive, speed, MISMATCHES[name], crossover))
            rows.append(
                {"mismatch": name, "crossover_pu": crossover, "omega_s_pu": speed}
                | {
                    "magnitude_pct": round(found.magnitude, 3),
                    "angle_deg": round(found.angle, 3),
                    "vector_pct": round(found.vector, 3),
                    "worst_pct": round(found.worst, 3),
                    "flux_pu": round(found.flux, 4),
                }
            )
            advance()
    return rows


def _markdown(rows: list[dict[str, object]]) -> str:
    table = []
    for name in MISMATCHES:
        chosen = [
            row
            for row in rows
            if row["mismatch"] == name and row["crossover_pu"] == rotor_flux_observer.CROSSOVER
        ]
        cells = [f"{row['magnitude_pct']:+.1f} %, {row['angle_deg']:+.1f}°" for row in chosen]
        table.append([name, *cells])
    return tables.markdown(["plant differs in", *(f"{w:g}" for w in SPEEDS)], table, "lr")


def _plot(rows: list[dict[str, object]], name_of: str, path: Path) -> None:
    plt = pyplot()
    figure, axes = plt.subplots(3, 3, figsize=(11, 8), sharex=True, layout="constrained")
    for axis, name in zip(axes.flat, MISMATCHES, strict=True):
        for crossover in CROSSOVERS:
            chosen = [r for r in rows if r["mismatch"] == name and r["crossover_pu"] == crossover]
            if not chosen:
                continue
            speeds = [r["omega_s_pu"] for r in chosen]
            values = [r["vector_pct"] for r in chosen]
            axis.loglog(
                speeds,
                values,
                marker="o",
                markersize=3,
                color=COLOURS[crossover],
                label=f"{crossover:g} pu",
            )
        what = f"plant: {name}" if name != "none" else "plant as the observer assumes it"
        axis.set_title(what, fontsize=9)
        axis.grid(visible=True, which="both", alpha=0.3)
        axis.set_ylim(0.05, 1000.0)
    axes[0, 0].legend(title="crossover of the observer", fontsize=7, title_fontsize=7)
    for axis in axes[-1]:
        axis.set_xlabel("stator frequency (pu)")
    for axis in axes[:, 0]:
        axis.set_ylabel("error of the flux vector (%)")
    figure.suptitle(
        f"Rotor-flux observer, {name_of}, closed loop: error of the estimate in % of the flux\n"
        "crossovers of 0.1 and 0.3 pu were run for three plants",
        fontsize=10,
    )
    save_png(figure, path)
    plt.close(figure)


def study(drive_file: str | Path = ROOT / "drives" / "anpc5l_6kv.toml") -> None:
    """Write CSV, plot and table for a drive."""
    drive = states.of_file(drive_file)
    rows = _table(drive)
    tools.write(ROOT / "reports" / "observer.csv", tables.csv_text(rows))
    _plot(rows, drive_title(drive.base.voltage), ROOT / "reports" / "observer.png")
    write_page()


def write_page(page: Path = ROOT / "reports" / "observer.md") -> None:
    """Bring the table of the page up to date with reports/observer.csv."""
    rows: list[dict[str, object]] = [
        {name: value if name == "mismatch" else float(value) for name, value in row.items()}
        for row in tables.read_csv(ROOT / "reports" / "observer.csv")
    ]
    tables.rewrite(page, {("<!-- table: begin -->", "<!-- table: end -->"): _markdown(rows)})
