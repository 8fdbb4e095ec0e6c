"""directmpc: direct model predictive control of electric drives, bit-true and in float64."""

__version__ = "0.1.0"
