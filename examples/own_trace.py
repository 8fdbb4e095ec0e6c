"""Write recorded measurements as a trace, and see what the ideal and the bit-true model decide.

Run it with: python examples/own_trace.py
The same file runs through the VHDL: make replay DRIVE=drives/motulator_2kw2.toml IN=own_trace.csv
OUT=decisions.csv
"""

import csv
from cmath import exp
from math import pi
from pathlib import Path

from directmpc import decide, load_drive


def record(rows: int) -> list[dict[str, float | int]]:
    """Stand in for an oscilloscope: a flux that turns at 50 Hz, and the current that it needs."""
    found = []
    for k in range(rows):
        flux = 0.9 * exp(2j * pi * 50.0 * 50e-6 * k)
        current = flux * (4.0 - 3.0j).conjugate()
        found.append(
            {
                "is_alpha": current.real, "is_beta": current.imag,  # A
                "psis_alpha": flux.real, "psis_beta": flux.imag,  # Wb
                "omega_r": 300.0, "torque_ref": 8.0, "psi_ref": 0.9,  # rad/s, N*m, Wb
                "u": 0,  # the vector that is being applied
            }
        )  # fmt: skip
    return found


def main(path: str = "own_trace.csv", rows: int = 400) -> float:
    """Write the trace; the share of rows that both engines decide alike."""
    recorded = record(rows)
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, recorded[0])
        writer.writeheader()
        writer.writerows(recorded)
    drive = load_drive("motulator_2kw2")
    with Path(path).open(encoding="utf-8") as file:
        pairs = [
            (decide(drive, row).apply, decide(drive, row, "model").apply)
            for row in csv.DictReader(file)
        ]
    alike = sum(ideal == model for ideal, model in pairs) / len(pairs)
    print(f"{path}: {len(pairs)} rows, {100 * alike:.1f} % decided alike")
    return alike


if __name__ == "__main__":
    main()
