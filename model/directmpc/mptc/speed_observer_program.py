"""Order of the products of the speed-adaptive observer on one multiply-accumulate block.

The equations stand in ``speed_observer``; names as in ``observer_program``. ``eps`` is the error of
the speed, ``omega`` the estimate, ``integral`` its state. The fluxes' Euler steps come before the
speed is known: they do not need it. ``mptc_speed_observer`` follows this program; the test of the
twin executes it as well.
"""

from __future__ import annotations

from directmpc.mac_program import Product, Program, Word, plain

_AXES = ("alpha", "beta")

#: Words of operand A.
_A: dict[str, Word] = {
    **plain("v_dc", "is_alpha", "is_beta"),
    **{f"psi_{x}": Word(f"psi_{x}", {f"psi_{x}": 0}) for x in _AXES},
    **{f"w_{x}": Word(f"w_{x}", {f"w_{x}": 0}) for x in _AXES},
    "not_w_beta": Word("not_w_beta", {"w_beta": 0}),
    **{f"e_{x}": Word(f"e_{x}", {f"e_{x}": 1}) for x in _AXES},
    **{f"half_w_{x}": Word(f"e_{x}", {f"e_{x}": 2}) for x in _AXES},
    "not_half_w_beta": Word("not_e_beta", {"e_beta": 2}),
    **{f"half_psi_{x}": Word(f"half_psi_{x}", {f"psi_{x}": 0, f"next_psi_{x}": 1}) for x in _AXES},
    **{f"step_{x}": Word(f"step_{x}", {f"step_{x}": 1}) for x in _AXES},
    "eps": Word("eps", {"eps": 1}),
    "omega": Word("omega", {"omega": 1}),
}

#: Words of operand B.
_B: dict[str, Word] = {
    **plain("current", "flux", "rotor", "rotor_flux", "drop", "drop_flux", "speed"),
    **plain("voltage_alpha", "voltage_beta", "gain_rotor", "gain_stator"),
    **plain("gain_speed", "gain_integral"),
    "angle": Word("angle", {"angle": 1}),
    **{f"error_{x}": Word(f"error_{x}", {f"e_{x}": 1}) for x in _AXES},
    **plain("share_alpha", "share_beta"),
}

#: First summands.
_SEEDS: dict[str, Word] = {
    **plain("word_half", "eps_half"),  # round a word, and eps
    **{f"less_w_{x}": Word(f"less_w_{x}", {f"w_{x}": 0}) for x in _AXES},
    **{f"w_{x}": Word(f"w_{x}", {f"w_{x}": 0}) for x in _AXES},
    **{f"psi_{x}": Word(f"psi_{x}", {f"psi_{x}": 0}) for x in _AXES},
    "integral": Word("integral", {"integral": 0}),
    **{f"next_w_{x}": Word(f"next_w_{x}", {f"next_w_{x}": 1}) for x in _AXES},
    **{f"next_psi_{x}": Word(f"next_psi_{x}", {f"next_psi_{x}": 1}) for x in _AXES},
}

_PRODUCTS = (
    Product(0, "v_dc", "voltage_alpha", "word_half", "step_alpha"),
    Product(1, "v_dc", "voltage_beta", "word_half", "step_beta"),
    Product(2, "is_alpha", "current", "less_w_alpha"),
    Product(3, "psi_alpha", "flux", "", "e_alpha"),
    Product(4, "is_beta", "current", "less_w_beta"),
    Product(5, "psi_beta", "flux", "", "e_beta"),
    Product(6, "w_alpha", "drop", "psi_alpha"),
    Product(7, "psi_alpha", "drop_flux"),
    Product(8, "step_alpha", "share_alpha"),
    Product(9, "e_alpha", "gain_stator", "", "next_psi_alpha"),
    Product(10, "w_alpha", "error_beta", "eps_half"),
    Product(11, "not_w_beta", "error_alpha", "", "eps"),
    Product(12, "w_beta", "drop", "psi_beta"),
    Product(13, "psi_beta", "drop_flux"),
    Product(14, "step_beta", "share_beta"),
    Product(15, "e_beta", "gain_stator", "", "next_psi_beta"),
    Product(16, "eps", "gain_speed", "integral", "omega"),
    Product(17, "eps", "gain_integral", "integral", "integral"),
    Product(20, "omega", "speed", "word_half", "angle"),
    Product(21, "w_alpha", "rotor", "w_alpha"),
    Product(22, "psi_alpha", "rotor_flux"),
    Product(23, "e_alpha", "gain_rotor"),
    Product(24, "not_w_beta", "angle", "", "next_w_alpha"),
    Product(25, "w_beta", "rotor", "w_beta"),
    Product(26, "psi_beta", "rotor_flux"),
    Product(27, "e_beta", "gain_rotor"),
    Product(28, "w_alpha", "angle", "", "next_w_beta"),
    Product(33, "half_psi_alpha", "rotor_flux", "next_w_alpha"),
    Product(34, "half_w_alpha", "rotor"),
    Product(35, "not_half_w_beta", "angle", "", "w_alpha"),
    Product(36, "half_psi_beta", "rotor_flux", "next_w_beta"),
    Product(37, "half_w_beta", "rotor"),
    Product(38, "half_w_alpha", "angle", "", "w_beta"),
    Product(39, "half_w_alpha", "drop", "next_psi_alpha"),
    Product(40, "half_psi_alpha", "drop_flux", "", "psi_alpha"),
    Product(41, "half_w_beta", "drop", "next_psi_beta"),
    Product(42, "half_psi_beta", "drop_flux", "", "psi_beta"),
)

PROGRAM = Program(
    a=_A,
    b=_B,
    seeds=_SEEDS,
    products=_PRODUCTS,
    actions={"half_w": 32, "output": 46},
    valid_after=46,
    last=46,
)
PROGRAM.check({"half_w": ("e_alpha", "e_beta"), "output": ()})
