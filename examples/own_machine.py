"""From a machine's data in SI to a drive file, and to a closed loop with a machine that is hotter.

Run it with: python examples/own_machine.py
"""

from math import pi, sqrt
from pathlib import Path

from directmpc import SimulationResult, load_drive, simulate

# 3.3 kV, 200 A, 50 Hz; equivalent circuit in ohm and H, dc-link in V, capacitors in F
VOLTAGE, CURRENT, FREQUENCY = sqrt(2 / 3) * 3300.0, sqrt(2) * 200.0, 50.0  # peak values
Z, OMEGA = VOLTAGE / CURRENT, 2 * pi * FREQUENCY
TEXT = f"""controller = "mpdcc"
[base]
voltage = {VOLTAGE}
current = {CURRENT}
frequency = {FREQUENCY}
[machine]
rs = {0.09 / Z}
rr = {0.07 / Z}
xls = {OMEGA * 3.6e-3 / Z}
xlr = {OMEGA * 3.1e-3 / Z}
xm = {OMEGA * 75e-3 / Z}
[inverter]
topology = "anpc5l"
vdc = {5200.0 / VOLTAGE}
xdc = {OMEGA * 700e-6 * Z}
xph = {OMEGA * 500e-6 * Z}
[control]
ts = 50e-6
bound_current = 0.1
bound_vn = 0.08
bound_vph = 0.12
lambda_n = 0.1
horizon = 63
deadlock_rule = "weighted"
outside_rule = "inwards"
"""


def main(path: str = "own_machine.toml", steps: int = 1600) -> dict[str, SimulationResult]:
    """Write the drive file and run it; the results for the known and for the hotter machine."""
    Path(path).write_text(TEXT, encoding="utf-8")
    drive = load_drive(path)  # names file, key and allowed range if a value is out of range
    hot = drive.changed(machine={"rs": 1.4 * drive.machine.rs, "rr": 1.4 * drive.machine.rr})
    results = {}
    for name, plant in (("as known", drive), ("40 % more resistance", hot)):
        results[name] = result = simulate(drive, steps=steps, settle=200, plant=plant)
        amplitude = abs(result.current).mean() * CURRENT
        print(f"{name}: {amplitude:.0f} A peak, current THD {100 * result.thd():.1f} %")
    return results


if __name__ == "__main__":
    main()
