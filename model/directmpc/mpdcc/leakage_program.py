"""What the multiply-accumulate block of ``leakage_observer`` does in which clock.

The equations stand in ``leakage``. alpha takes its step first, beta follows with the new theta. One
register holds the product of speed and emf first and phi then (``phi``), so that beta forms that
product once more. The error of a step is never stored: its product takes it from the accumulator,
in the one clock in which it is complete. Voltages are read from clock 5 on, so that an observer
that forms them may begin at the same time. The currents become those of k-1 with their last product
(``remember``).
"""

from __future__ import annotations

from directmpc.mac_program import Product, Program, Word, plain

_A: dict[str, Word] = {
    **plain("speed", "voltage_alpha", "voltage_beta"),
    **plain("cross_alpha", "cross_beta"),  # flux of the other axis, negative for beta
    **plain("moved_alpha", "moved_beta"),  # current at k-1 less current at k
    "phi_alpha": Word("phi", {"phi_alpha": 1, "angle_beta": 0}),
    "phi_beta": Word("phi", {"phi_beta": 1}),
}
_B: dict[str, Word] = {
    **plain("voltage_alpha", "voltage_beta", "emf"),
    "angle_alpha": Word("phi", {"angle_alpha": 1, "phi_alpha": 0}),
    "angle_beta": Word("phi", {"angle_beta": 1, "phi_beta": 0}),
    "theta": Word("theta", {"theta_alpha": 0}),
    "new_theta": Word("theta", {"theta_alpha": 1, "theta_beta": 0}),
    **plain("one", "error"),
}

_PRODUCTS = (
    Product(0, "speed", "emf", "half", "angle_alpha"),
    Product(4, "cross_alpha", "angle_alpha", "half"),
    Product(5, "voltage_alpha", "voltage_alpha", "", "phi_alpha"),
    Product(9, "phi_alpha", "theta", "half"),
    Product(10, "moved_alpha", "one", "", "error_alpha"),
    Product(11, "speed", "emf", "half", "angle_beta"),
    Product(13, "phi_alpha", "error", "none", "theta_alpha"),
    Product(15, "cross_beta", "angle_beta", "half"),
    Product(16, "voltage_beta", "voltage_beta", "", "phi_beta"),
    Product(20, "phi_beta", "new_theta", "half"),
    Product(21, "moved_beta", "one", "", "error_beta"),
    Product(24, "phi_beta", "error", "none", "theta_beta"),
)

PROGRAM = Program(
    a=_A,
    b=_B,
    seeds=plain("half", "none"),  # half rounds the sum
    products=_PRODUCTS,
    actions={"remember": 21},
    valid_after=27,
    last=27,
)
PROGRAM.check({"remember": ()})
for _axis in ("alpha", "beta"):
    if PROGRAM.events[f"error_{_axis}"] + 3 != PROGRAM.events[f"theta_{_axis}"]:
        raise ValueError("an error is not in the accumulator when its product is issued")
if PROGRAM.actions["remember"] < max(p.clock for p in _PRODUCTS if p.a.startswith("moved")):
    raise ValueError("a current is replaced before its last product")
