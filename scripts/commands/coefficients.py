"""From a drive to register values: what a host computes and writes once per drive."""

from directmpc.mpdcc import coefficients
from scripts.shared.command import Program

COMMAND = Program(coefficients.main)
