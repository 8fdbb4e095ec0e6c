"""Number formats of the K-best core: the only place where its widths and scales are written down.

Vectors stand in the coordinates u = x_alpha and w = x_beta / sqrt(3), so that a move of a phase
changes both by whole multiples of one word and |x|^2 = u^2 + 3 w^2. The measurements are those of
MPDCC. The scales are such that every weight of the cost is a power of two.

============================== ===== ======= ==================== ===================
word                           width signed  LSB per unit         range (pu)
============================== ===== ======= ==================== ===================
error of a node                19    yes     64000                +-4.09
error that is squared          17    yes     16000                +-4.09
error ahead                    14    yes     1000                 +-8.19
v_n and v_ph - v_dc/4          16    yes     16003.125            +-2.05
voltage ahead                  14    yes     4000.78              +-2.05
reference, drift               18    yes     64000                +-2.05
flux                           18    yes     36000                +-3.64
costs, keys                    22    no      15625                0 .. 268
============================== ===== ======= ==================== ===================

The cost of the errors has 16000^2 / 2^14 = 15625 LSB per square unit, that of the voltages
16003.125^2 / 2^14 = 15631; they are taken for the same.
"""

from __future__ import annotations

from directmpc.mpdcc.formats import MEASUREMENTS as MEASUREMENTS

FACTOR_WIDTH = 18  # both operands of every product, signed
ERROR_WIDTH = 19  # u and w of a node, signed
ERROR_SCALE = 64_000.0
SQUARED_SHIFT = 2  # from the error of a node to the one that is squared
VOLTAGE_WIDTH = 16  # v_n and deviations of v_ph, signed
VOLTAGE_SCALE = 16_003.125
VOLTAGE_SHIFT = 2  # from measured voltages to these words, downwards
VECTOR_SCALE = 64_000.0  # of reference and drift
VECTOR_SHIFT = 2  # from a current's word to the reference and to an error
FLUX_SCALE = 36_000.0
FLUX_SHIFT = 2  # from the flux's word
COST_WIDTH = 22  # J and keys, unsigned
COST_SCALE = 15_625.0
EFFORT_WIDTH = 13  # lambda_u, unsigned

COST_SHIFT = 14  # from the square of an error to the cost
EXCESS_WIDTH = 13  # excess of a voltage, unsigned
EXCESS_SHIFT = 14  # from its square to the cost
AHEAD_WIDTH = 14  # where a straight line leads, signed
ERROR_AHEAD_SHIFT = 6  # from an error to the error ahead
VOLTAGE_AHEAD_SHIFT = 2  # from a voltage to the voltage ahead
CURRENT_AHEAD_SHIFT = 7  # half of the square of the error ahead
CAPACITOR_AHEAD_SHIFT = 12  # a quarter of the square of v_ph ahead
NEUTRAL_AHEAD_SHIFT = 8  # four times the square of v_n ahead
WEIGHT_EXPONENTS = range(11)  # weight_vn and weight_vph are 2 to one of these

SPEED_SHIFT = 2  # left shift of a speed's word
FRACTION = 17  # right shift of every sum of products of the stages' terms
FORCED_FRACTION = 15  # bits of the change of an error by a voltage below one

#: Coefficients of the core in port order; each is a signed word of FACTOR_WIDTH bits.
COEFFICIENTS = (
    "angle",  # sqrt(3) times the angle of a step, per LSB of omega_s
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
