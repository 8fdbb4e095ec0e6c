"""What the multiply-accumulate block of ``mptc_observer`` does in which clock.

The equations stand in ``observer``. w and psi are the states, ``e`` the innovation, ``next_w`` and
``next_psi`` the states after Euler's step, ``half_w`` and ``half_psi`` half of what that step
moved; ``not_x`` is the one's complement of x. The half steps of w take the innovations' place once
those have been used (action ``half_w``).
"""

from __future__ import annotations

from directmpc.mac_program import Product, Program, Word, plain

_AXES = ("alpha", "beta")

#: Words of operand A.
_A: dict[str, Word] = {
    **plain("omega_r", "v_dc", "is_alpha", "is_beta"),
    **{f"psi_{x}": Word(f"psi_{x}", {f"psi_{x}": 0}) for x in _AXES},
    **{f"w_{x}": Word(f"w_{x}", {f"w_{x}": 0}) for x in _AXES},
    "not_w_beta": Word("not_w_beta", {"w_beta": 0}),
    **{f"e_{x}": Word(f"e_{x}", {f"e_{x}": 1}) for x in _AXES},
    **{f"half_w_{x}": Word(f"e_{x}", {f"e_{x}": 2}) for x in _AXES},
    "not_half_w_beta": Word("not_e_beta", {"e_beta": 2}),
    **{f"half_psi_{x}": Word(f"half_psi_{x}", {f"psi_{x}": 0, f"next_psi_{x}": 1}) for x in _AXES},
    **{f"step_{x}": Word(f"step_{x}", {f"step_{x}": 1}) for x in _AXES},
}

#: Words of operand B: coefficients, angle of a step, share of the voltage step that u takes.
_B: dict[str, Word] = {
    **plain("current", "flux", "rotor", "rotor_flux", "drop", "drop_flux"),
    **plain("speed", "voltage_alpha", "voltage_beta", "gain_rotor", "gain_stator"),
    "angle": Word("angle", {"angle": 1}),
    **plain("share_alpha", "share_beta"),
}

#: First summands.
_SEEDS: dict[str, Word] = {
    **plain("word_half"),  # rounds a word
    **{f"less_w_{x}": Word(f"less_w_{x}", {f"w_{x}": 0}) for x in _AXES},
    **{f"w_{x}": Word(f"w_{x}", {f"w_{x}": 0}) for x in _AXES},
    **{f"psi_{x}": Word(f"psi_{x}", {f"psi_{x}": 0}) for x in _AXES},
    **{f"next_w_{x}": Word(f"next_w_{x}", {f"next_w_{x}": 1}) for x in _AXES},
    **{f"next_psi_{x}": Word(f"next_psi_{x}", {f"next_psi_{x}": 1}) for x in _AXES},
}

_PRODUCTS = (
    Product(0, "omega_r", "speed", "word_half", "angle"),
    Product(1, "v_dc", "voltage_alpha", "word_half", "step_alpha"),
    Product(2, "v_dc", "voltage_beta", "word_half", "step_beta"),
    Product(3, "is_alpha", "current", "less_w_alpha"),
    Product(4, "psi_alpha", "flux", "", "e_alpha"),
    Product(5, "is_beta", "current", "less_w_beta"),
    Product(6, "psi_beta", "flux", "", "e_beta"),
    Product(7, "w_alpha", "rotor", "w_alpha"),
    Product(8, "psi_alpha", "rotor_flux"),
    Product(9, "not_w_beta", "angle"),
    Product(10, "e_alpha", "gain_rotor", "", "next_w_alpha"),
    Product(11, "w_beta", "rotor", "w_beta"),
    Product(12, "psi_beta", "rotor_flux"),
    Product(13, "w_alpha", "angle"),
    Product(14, "e_beta", "gain_rotor", "", "next_w_beta"),
    Product(15, "w_alpha", "drop", "psi_alpha"),
    Product(16, "psi_alpha", "drop_flux"),
    Product(17, "step_alpha", "share_alpha"),
    Product(18, "e_alpha", "gain_stator", "", "next_psi_alpha"),
    Product(19, "w_beta", "drop", "psi_beta"),
    Product(20, "psi_beta", "drop_flux"),
    Product(21, "step_beta", "share_beta"),
    Product(22, "e_beta", "gain_stator", "", "next_psi_beta"),
    Product(24, "half_psi_alpha", "rotor_flux", "next_w_alpha"),
    Product(25, "half_w_alpha", "rotor"),
    Product(26, "not_half_w_beta", "angle", "", "w_alpha"),
    Product(27, "half_psi_beta", "rotor_flux", "next_w_beta"),
    Product(28, "half_w_beta", "rotor"),
    Product(29, "half_w_alpha", "angle", "", "w_beta"),
    Product(30, "half_w_alpha", "drop", "next_psi_alpha"),
    Product(31, "half_psi_alpha", "drop_flux", "", "psi_alpha"),
    Product(32, "half_w_beta", "drop", "next_psi_beta"),
    Product(33, "half_psi_beta", "drop_flux", "", "psi_beta"),
)

PROGRAM = Program(
    a=_A,
    b=_B,
    seeds=_SEEDS,
    products=_PRODUCTS,
    actions={"half_w": 23, "output": 37},
    valid_after=37,
    last=37,
)
PROGRAM.check({"half_w": ("e_alpha", "e_beta"), "output": ()})
