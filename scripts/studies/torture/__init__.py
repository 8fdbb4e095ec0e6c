"""The bit-true twins against slow second writings of their decisions, state after state."""
