"""What the multiply-accumulate block of ``capacitor_observer`` does in which clock.

The equations stand in ``capacitor_observer``. A word of operand A is a sum of two currents along
alpha or beta with the sign and the share that the positions give it; it is zero where they move no
charge. Phase a has no part along beta. The voltage of a sum leaves the ring of states two clocks
before the sum is complete (``take``), so that it has been corrected by then.
"""

from __future__ import annotations

from directmpc.mac_program import Product, Program, plain

_A = plain(
    "a_alpha", "b_alpha", "b_beta", "c_alpha", "c_beta", "midpoint_alpha", "midpoint_beta"
)  # fmt: skip
_B = plain("midpoint_alpha", "midpoint_beta", "phase_alpha", "phase_beta")

_PRODUCTS = (
    Product(0, "a_alpha", "phase_alpha", "half", "phase_a"),
    Product(1, "b_alpha", "phase_alpha", "half"),
    Product(2, "b_beta", "phase_beta", "", "phase_b"),
    Product(3, "c_alpha", "phase_alpha", "half"),
    Product(4, "c_beta", "phase_beta", "", "phase_c"),
    Product(5, "midpoint_alpha", "midpoint_alpha", "half"),
    Product(6, "midpoint_beta", "midpoint_beta", "", "midpoint"),
)

#: Sums in the order in which the states leave the ring.
LANES = ("phase_a", "phase_b", "phase_c", "midpoint")

PROGRAM = Program(
    a=_A,
    b=_B,
    seeds=plain("half"),  # rounds the sum
    products=_PRODUCTS,
    actions={f"take_{lane}": 2 * n + 2 for n, lane in enumerate(LANES)},
    valid_after=9,
    last=9,
)
PROGRAM.check({f"take_{lane}": () for lane in LANES})
for _lane in LANES:
    if PROGRAM.events[_lane] != PROGRAM.events[f"take_{_lane}"] + 1:
        raise ValueError(f"{_lane} is not complete when its voltage is")
