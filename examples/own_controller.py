"""Close the loop with a controller of one's own: direct torque control by a switching table.

Run it with: python examples/own_controller.py
"""

from cmath import phase
from math import pi

from directmpc import MptcDrive, MptcState, SimulationResult, load_drive, simulate


class SwitchingTable:
    """Hysteresis of torque and flux, and a table of vectors by the sector of the flux."""

    def __init__(self, drive: MptcDrive, torque_band: float = 0.5, flux_band: float = 0.01):
        self.pole_pairs = drive.machine.pole_pairs
        self.torque_band, self.flux_band = torque_band, flux_band  # N*m, Wb
        self.more_torque = self.more_flux = True

    def decide(self, state: MptcState) -> int:
        """Number of the voltage vector to apply next, 0 to 7."""
        torque = 1.5 * self.pole_pairs * (state.flux.conjugate() * state.current).imag
        if abs(state.torque_ref - torque) > self.torque_band:
            self.more_torque = torque < state.torque_ref
        if abs(state.psi_ref - abs(state.flux)) > self.flux_band:
            self.more_flux = abs(state.flux) < state.psi_ref
        if not self.more_torque:
            return 0 if state.applied in (0, 1, 3, 5) else 7  # the zero vector that is nearer
        sector = round(phase(state.flux) / (pi / 3))  # 0: around phase a
        return 1 + (sector + (1 if self.more_flux else 2)) % 6


def main(steps: int = 4000) -> dict[str, SimulationResult]:
    """Compare it with the ideal predictive controller; the results by name."""
    drive = load_drive("induction_2kw2")
    results = {}
    for name, controller in (("switching table", SwitchingTable(drive)), ("predictive", "ideal")):
        results[name] = result = simulate(
            drive, controller, steps=steps, settle=200, speed=188.5, torque=7.0, flux=0.95
        )
        print(
            f"{name}: torque {result.torque.mean():.2f} N*m, ripple {result.torque.std():.2f} N*m, "
            f"current THD {100 * result.thd():.1f} %"
        )
    return results


if __name__ == "__main__":
    main()
