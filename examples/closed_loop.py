"""Close the loop around the bit-true model of each controller, and look at the current.

Run it with: python examples/closed_loop.py
"""

from directmpc import SimulationResult, load_drive, simulate


def main(steps: int = 2000) -> dict[str, SimulationResult]:
    """Run `steps` control steps with each of two shipped drives; the results by name."""
    results = {}
    for name, settings in (
        ("anpc5l_6kv", {"speed": 1.0}),  # per unit: rated speed and rated current
        ("induction_2kw2", {"speed": 188.5, "torque": 7.0, "flux": 0.95}),  # rad/s, N*m, Wb
    ):
        result = simulate(load_drive(name), "model", steps=steps, settle=200, **settings)
        table = result.table()  # a dictionary of columns; pandas.DataFrame(table) takes it
        print(
            f"{name}: {len(result)} steps, mean torque {result.torque.mean():.3f}, "
            f"current THD {100 * result.thd():.1f} %, columns {', '.join(list(table)[:4])}, ..."
        )
        results[name] = result
    return results


if __name__ == "__main__":
    main()
