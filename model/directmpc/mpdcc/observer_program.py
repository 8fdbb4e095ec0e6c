"""What both multiply-accumulate blocks of ``rotor_flux_observer`` do in which clock.

The equations stand in ``observer``. Two blocks, alpha and beta, follow this one program; words are
those of the block's own axis. psi_c is the flux of the current model, psi_s that of the voltage
model, ``ahead`` psi_c after Euler's step. Fractional bits of the coefficients differ, so products
are aligned by steps of three bits.
"""

from __future__ import annotations

from directmpc.mac_program import Product, Program, Word, plain

#: Words of operand A.
_A: dict[str, Word] = {
    **plain("speed"),  # omega_r
    "voltage": Word("voltage", {"voltage": 1}),
    **plain("mean", "previous"),  # mean current of the interval, current at its beginning
    "rotor": Word("rotor", {"rotor": 0}),  # psi_c
    "stator": Word("stator", {"stator": 0}),  # psi_s
    "new_stator": Word("stator", {"stator": 1}),
    "cross": Word("cross", {"rotor": 0}),  # psi_c of the other axis, negative for alpha
    **plain("current"),
    "half": Word("half", {"rotor": 0, "ahead": 1}),  # half of Euler's step
    "turning": Word("turning", {"rotor": 0, "ahead": 1}),  # that of the other axis, as cross
}

#: Words of operand B: the coefficients, and the angle of a step.
_B: dict[str, Word] = {
    **plain("speed", "voltage", "drop", "pull", "pull_flux", "pull_current", "decay", "excitation"),
    "angle": Word("angle", {"angle": 1}),
    # one place, where the action output_current changes the coefficient for one clock
    "output_flux": Word("output"),
    "output_current": Word("output"),
}

#: First summands.
_SEEDS: dict[str, Word] = {
    "angle_half": Word("angle_half"),  # rounds the angle
    "stator": Word("stator", {"stator": 0}),
    "rotor": Word("rotor", {"rotor": 0}),
    "port_half": Word("port_half"),  # rounds the estimate
    "ahead": Word("ahead", {"ahead": 1}),
}

_PRODUCTS = (
    Product(0, "speed", "speed", "angle_half", "angle"),
    Product(1, "mean", "drop", "stator"),
    Product(2, "previous", "pull_current", alignment=1),
    Product(3, "rotor", "pull_flux", alignment=1),
    Product(4, "stator", "pull", alignment=1),
    # last, because the voltage is formed meanwhile
    Product(5, "voltage", "voltage", "", "stator", alignment=2),
    Product(6, "rotor", "decay", "rotor"),
    Product(7, "mean", "excitation"),
    Product(8, "cross", "angle", "", "ahead", alignment=2),
    Product(9, "new_stator", "output_flux", "port_half", alignment=3),
    Product(10, "current", "output_current", "", "estimate", alignment=3),
    Product(12, "half", "decay", "ahead"),
    Product(13, "turning", "angle", "", "rotor", alignment=2),
)

PROGRAM = Program(
    a=_A,
    b=_B,
    seeds=_SEEDS,
    products=_PRODUCTS,
    actions={"voltage": 4, "output_current": 10},
    valid_after=13,
    last=16,
)
PROGRAM.check({"output_current": ()})
for _product in _PRODUCTS:
    if (_product.b == "output_current") != (
        _product.clock == PROGRAM.actions["output_current"]
    ) or (_product.b == "output_flux" and _product.clock in PROGRAM.actions.values()):
        raise ValueError("the place of the output coefficients holds the other one")
