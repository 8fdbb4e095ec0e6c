"""The host program of a board, or of a virtual one, over its UART."""

from directmpc.host.__main__ import main
from scripts.shared.command import Program

cli = Program(main)
