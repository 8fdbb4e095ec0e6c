"""FMUs of a drive: its controller, which is the RTL itself, and its exact plant.

`write_controller` and `write_plant` write a file that every tool with FMI 2.0 or 3.0 for
co-simulation imports. ``python -m directmpc.fmu DRIVE --out x.fmu`` does it from a shell.
"""

from directmpc.fmu.archive import FmuError, write_controller, write_plant

__all__ = ["FmuError", "write_controller", "write_plant"]
