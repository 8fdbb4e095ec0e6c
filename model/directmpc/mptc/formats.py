"""Number formats of ``mptc_core``: the only place where its widths and scales are written down.

Inside the core every multiplier operand is a **word**: 18 bits, two's complement, 17 of them
fractional, so a fraction of the base of its quantity in [-1, 1).  The bases follow from the full
scales in the drive file (block scaling), and a host computes the coefficients with them:

=============  ===============================================================  ============
quantity       base                                                             port
=============  ===============================================================  ============
current        I = current_max * 32768/32767                                    16 bits
flux           P = psi_max * 32768/32767                                        16 bits
speed          O = speed_max * 32768/32767                                      16 bits
torque         torque_max * 32768/32767                                         16 bits
v_dc           2 * inverter.vdc                                                 16, unsigned
psi_ref        P, times half of the magnitude's gain (below)                     15, unsigned
coefficients   1                                                                18 bits
w              W >= I + lambda*L_r*P, see below                                 inside
torque terms   1.5*N_p*P*W                                                      inside
=============  ===============================================================  ============

w = i_s - lambda*L_r*psi_s = -lambda*L_m*psi_r takes the current's place as a state: the equations
are the same (Heun's method does not see a linear change of coordinates), i_s0 of eq. 14 becomes one
Euler step of w, and its base is what the largest current and flux add up to.  W is raised by the
little (at most 2^-12 of it for usual drives) that makes the torque's coefficient an exact word.

Why 18 bits and not 16: with 16-bit coefficients and states the rounding of lambda*L_r*psi_s alone
moves the predicted torque of the 2.2 kW drive by 4 mN*m, more than the quantisation of its 16-bit
inputs does.  Eighteen bits cost no multiplier.  Wider are the accumulators (sums of whole products,
ACCUMULATOR_WIDTH), the torque terms (TORQUE_WIDTH: their base is about ten times the torque, hence
three more fractional bits) and the vectors of the magnitude (MAGNITUDE_WIDTH: a guard bit).
"""

from __future__ import annotations

import math

from directmpc.fixed_point import Format
from directmpc.mptc.drive import MptcDrive

WORD_WIDTH = 18  # bits of a multiplier operand, two's complement
FRACTION = 17  # fractional bits of a word
MEASUREMENT_WIDTH = 16  # bits of a measurement port
#: Left shift of a port that makes it a word.
MEASUREMENT_SHIFT = WORD_WIDTH - MEASUREMENT_WIDTH
LINK_SHIFT = 1  # v_dc is unsigned
REFERENCE_WIDTH = 15  # bits of psi_ref, unsigned

PRODUCT_FRACTION = 2 * FRACTION  # fractional bits of a product of two words
ACCUMULATOR_WIDTH = PRODUCT_FRACTION + 4  # three products and a seed below 1 each, and a sign
TORQUE_FRACTION = 20  # fractional bits of torque terms
TORQUE_WIDTH = 24  # bits of torque terms: |T| < 8 times their base
TORQUE_SHIFT = PRODUCT_FRACTION - TORQUE_FRACTION

MAGNITUDE_FRACTION = 18  # fractional bits of the vectors in the magnitude
MAGNITUDE_WIDTH = 21  # bits: K*|psi| < 4 for components of 1.5 at most
ITERATIONS = 8  # micro-rotations 0 to 7
#: Residual angle atan(2^-7) makes the length too small by at most this share.
MAGNITUDE_SHARE = 1.0 - math.cos(math.atan(2.0 ** (1 - ITERATIONS)))
#: Gain of the micro-rotations, less half of that share: the error lies around zero.
MAGNITUDE_GAIN = math.prod(math.sqrt(1.0 + 4.0**-i) for i in range(ITERATIONS)) * (
    1.0 - MAGNITUDE_SHARE / 2.0
)
#: Half of it as a word. psi_ref comes in with this factor: it is half of what lengths are compared
#: with, and MPFC scales its own terms alike.
GAIN = round(MAGNITUDE_GAIN / 2.0 * 2**FRACTION)
#: Bits of MPFC's torque reference below a word: it is shifted to the left as the rotor flux is.
MOMENT_GUARD = 8
DIFFERENCE_FRACTION = 16  # fractional bits of the flux error as a multiplier operand

#: k_psi's coefficient counts this many bits more than its fraction says, so that it reaches 8
#: torque bases per flux base (k_psi = 4000 N*m/Wb for the 2.2 kW drive, 40 times what Paper B finds
#: best); its rounding at k_psi = 100 is 2e-4 of it.
WEIGHT_SHIFT = 4
COST_SHIFT = TORQUE_SHIFT - WEIGHT_SHIFT  # a torque term's place in a cost
COST_WIDTH = 36  # bits of a cost: five torque bases and the weighted flux error stay below 2^35
COST_DROPPED = 8  # low bits of a cost that are not compared

TIME_WIDTH = 12  # bits of a duty, one for each step of its search
#: Bits of a time: 0 to 4096 steps of a period.
TIME_PORT_WIDTH = TIME_WIDTH + 1
WAY_GUARD = 1  # bits below a length's LSB of a pair's flux: half of a step along alpha
#: Torque differences of a search count a quarter of a torque term: u_2's share is a quarter.
DUTY_SHIFT = 2

#: Flux methods of several vectors: e and ways before the division, times |w|^2; below 2.
REST_FRACTION = 24
#: Coordinates of e in ways of a vector, a sign and 3 bits before the point: the hexagon has 1.
QUOTIENT_FRACTION = 13
QUOTIENT_WIDTH = QUOTIENT_FRACTION + 4
FAR_STEPS = 5  # halvings of a longer e: 256 ways of a vector
HEXAGON_FRACTION = QUOTIENT_FRACTION + 1  # h/2 is exact
RESIDUE_FRACTION = 13  # a residue is below 16 ways: a word

SQRT3_2 = round(math.sqrt(3.0) / 2.0 * 2**FRACTION)  # a word
NORMALISE_STEPS = 7  # of two bits each, for the rotor flux of MPFC
ROOT_WIDTH = FRACTION  # bits of the square root in MPFC, one a clock

WORD_HIGH = 2 ** (WORD_WIDTH - 1) - 1

#: Measurement ports in port order (u, the vector that is being applied, follows).
MEASUREMENTS: tuple[str, ...] = (
    "is_alpha",
    "is_beta",
    "psis_alpha",
    "psis_beta",
    "omega_r",
    "v_dc",
    "torque_ref",
    "psi_ref",
)


def measurement_formats(drive: MptcDrive) -> dict[str, Format]:
    """Formats of the ports for a drive, LSB per A, Wb, rad/s, V and N*m, in port order.

    psi_ref has half of the magnitude's gain.
    """
    c = drive.control
    high = 2 ** (MEASUREMENT_WIDTH - 1) - 1
    current = Format(MEASUREMENT_WIDTH, True, high / c.current_max)
    flux = Format(MEASUREMENT_WIDTH, True, high / c.psi_max)
    return {
        "is_alpha": current,
        "is_beta": current,
        "psis_alpha": flux,
        "psis_beta": flux,
        "omega_r": Format(MEASUREMENT_WIDTH, True, high / c.speed_max),
        "v_dc": Format(MEASUREMENT_WIDTH, False, 2 ** (MEASUREMENT_WIDTH - 1) / drive.inverter.vdc),
        "torque_ref": Format(MEASUREMENT_WIDTH, True, high / c.torque_max),
        "psi_ref": Format(REFERENCE_WIDTH, False, high / c.psi_max * MAGNITUDE_GAIN / 2.0),
    }
