"""What Paper A publishes of its own design (Table II), for 1 to 6 explorers."""

from __future__ import annotations

CYCLES = {1: 2223, 2: 1135, 3: 772, 4: 591, 5: 482, 6: 410}
"""Clock cycles of a decision, worst case, by number of explorers."""
LIMIT = 1200
"""Clock cycles that a decision was allowed: 30 us at 40 MHz (section IV)."""
SLICES = (4700, 7900, 11200, 14400, 17700, 20900)
"""Slices of the paper's device, from one explorer on."""
MULTIPLIERS = (10, 14, 18, 22, 26, 30)
"""18 x 18 multipliers, from one explorer on."""
