"""Paper A's linear extrapolation: its correction factor p and its length L, chosen for a drive."""

from directmpc.mpdcc import extrapolation
from scripts.shared.command import Program

COMMAND = Program(extrapolation.main)
