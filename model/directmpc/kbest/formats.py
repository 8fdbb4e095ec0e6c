"""Number formats of the K-best core: the only place where its widths and scales are written down.

Vectors stand in the coordinates u = x_alpha and w = x_beta / sqrt(3), so that a move of a phase
changes both by whole multiples of one word and |x|^2 = u^2 + 3 w^2. The measurements are those of
MPDCC. The scales are such that every weight of the cost is a power of two.

============================== ===== ======= ==================== ===================
word                           width signed  LSB per unit         range (pu)
============================== ===== ======= ==================== ===================
error of a node                22    yes     256000               +-8.19
error that is squared          18    yes     16000                +-8.19
v_n and v_ph - v_dc/4          18    yes     64012.5              +-2.05
reference, drift of a step     18    yes     64000                +-2.05
flux                           18    yes     36000                +-3.64
costs, keys                    27    no      62500                0 .. 2147
============================== ===== ======= ==================== ===================

The cost of the errors has 16000^2 / 2^12 = 62500 LSB per square unit, that of the voltages
64012.5^2 / 2^16 = 62524; they are taken for the same.
"""

from __future__ import annotations

from directmpc.mpdcc.formats import MEASUREMENTS as MEASUREMENTS

FACTOR_WIDTH = 18  # both operands of every product, signed
ERROR_WIDTH = 22  # u and w of a node, signed
ERROR_SCALE = 256_000.0
SQUARED_SHIFT = 4  # from the error of a node to the one that is squared
VOLTAGE_WIDTH = 18  # v_n and deviations of v_ph, signed
VOLTAGE_SCALE = 64_012.5
VECTOR_WIDTH = 18  # reference and drift, signed
VECTOR_SCALE = 64_000.0
VECTOR_SHIFT = 2  # from a current's word to the reference, and from the drift to a node's error
FLUX_SCALE = 36_000.0
FLUX_SHIFT = 2  # from the flux's word
CHARGE_WIDTH = 18  # what a stage adds to a voltage, signed
LEVEL_WIDTH = 18  # a quarter of the dc link as a change of the error, signed
COST_WIDTH = 27  # J and keys, unsigned
COST_SCALE = 62_500.0
EFFORT_WIDTH = 15  # lambda_u, unsigned

COST_SHIFT = 12  # from the squares of errors to the cost
VOLTAGE_COST_SHIFT = 16  # from the squares of voltages to the cost
CURRENT_AHEAD_SHIFT = 13  # half of the square of the error ahead
CAPACITOR_AHEAD_SHIFT = 18  # a quarter of the square of v_ph ahead
NEUTRAL_AHEAD_SHIFT = 14  # four times the square of v_n ahead
WEIGHT_EXPONENTS = range(11)  # weight_vn and weight_vph are 2 to one of these

ANGLE_FRACTION = 18  # bits of an angle below one
SINE_FRACTION = 17  # of sqrt(3) sin and sin / sqrt(3)
COSINE_FRACTION = 23  # of 1 - cos
DECAY_FRACTION = 18  # of 1 - a11
FLUX_FACTOR_FRACTION = 16  # of a12
FORCED_FRACTION = 15  # of the change of an error by a voltage
CHARGE_FRACTION = 18  # of the change of a voltage by a current
SPEED_FRACTION = 16  # products with a speed

#: Coefficients of the core in port order; each is a signed word of FACTOR_WIDTH bits.
COEFFICIENTS = (
    "angle",  # of a step, per LSB of omega_s
    "decay_1", "decay_2",  # 1 - a11 over one step and two
    "flux_0", "flux_2",  # a12: constant and with the square of the speed
    "flux_u", "flux_w",  # a12: with the speed, times sqrt(3) and over sqrt(3)
    "forced_1", "forced_2",  # b/3 on v_n and v_ph
    "level_1", "level_2",  # b/3 on a quarter of v_dc
    "neutral", "capacitor",  # T_s / (2 xdc) and T_s / xph
)  # fmt: skip

#: Settings of the core in port order, unsigned.
SETTINGS = (
    "effort",  # lambda_u
    "bound_neutral", "bound_phase",  # where the cost of an excess begins
    "weight_neutral", "weight_phase",  # exponents of two
    "short_stages",
    "compensate",
)  # fmt: skip
