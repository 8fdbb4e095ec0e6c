"""A drive file as register values: what a host writes into a system, as CSV, C, VHDL or a table."""

from directmpc.host import registers
from scripts.shared.command import Program

cli = Program(registers.main)
