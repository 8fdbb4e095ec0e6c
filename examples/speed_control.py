"""Start, reversal and load step of a 4 kW and a 6.6 kV machine behind a speed controller.

Run it with: python examples/speed_control.py
"""

from pathlib import Path

from directmpc import SimulationResult, load_drive, simulate
from directmpc.api.dynamics import SCENARIOS, scenario

HERE = Path(__file__).parent


def main(
    engine: str = "model", folder: str = ".", steps: int | None = None
) -> dict[str, SimulationResult]:
    """Run the three scenarios with both drives and draw them; the results by name."""
    results = {}
    for name in ("induction_4kw", "anpc5l_6kv6"):
        drive = load_drive(HERE / f"{name}.toml")
        for what in SCENARIOS:
            asked = scenario(drive, what)  # speed and load over time, start, steps
            result = simulate(drive, engine, **asked | ({"steps": steps} if steps else {}))
            result.plot().savefig(Path(folder) / f"{name}_{what}.png")
            print(f"{name}, {what}: {result.switching_frequency:.0f} Hz, ends at", end=" ")
            print(f"{result.omega_r[-1]:.3g} of {result.speed_ref[-1]:.3g}")
            results[f"{name} {what}"] = result
    return results


if __name__ == "__main__":
    main()
