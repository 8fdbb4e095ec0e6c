"""A host of your own: a board decides, your simulator answers; here that is the library's plant.

In one terminal: make virtual-board
In another:      .venv/bin/python examples/own_host.py build/virtual-board
"""

import sys

from directmpc import MpdccState, load_drive
from directmpc.host.board import Board
from directmpc.mpdcc.closed_loop import OperatingPoint, constant_profile, initial_conditions
from directmpc.mpdcc.plant import Plant


def main(port: str, steps: int = 400) -> list[complex]:
    """Close the loop for some steps; the stator current in each, per unit."""
    drive = load_drive("anpc5l_6kv")
    profile = constant_profile(drive, OperatingPoint(1.0), steps)  # rated speed and current
    state, positions = initial_conditions(profile)
    simulator = Plant(drive, float(profile.omega_r[0]), state=state)
    Plant(drive).step(positions)  # compiled before the watchdog runs
    currents = []
    with Board(port) as board:  # however this block is left, the drive is off then
        board.load(drive)
        board.start()
        for k in range(steps):
            x = simulator.state  # what you measure
            measured = MpdccState(
                current=complex(x[0], x[1]),
                flux=complex(x[2], x[3]),
                v_n=x[4],
                v_ph=(x[5], x[6], x[7]),
                current_ref=profile.iref[k],
                omega_s=1.0,
                omega_r=simulator.omega_r,
                applied=tuple(positions),
                vdc=simulator.vdc,
            )
            positions = board.step(measured).apply  # what the inverter gets
            simulator.step(positions)
            currents.append(measured.current)
    return currents


if __name__ == "__main__":
    found = main(sys.argv[1])
    print(f"{len(found)} steps, mean current {sum(map(abs, found)) / len(found):.3f} pu")
