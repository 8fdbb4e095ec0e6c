"""What no register, no measurement and no parameter can make overflow.

The formats of a core are numbers (`directmpc.mpdcc.formats`, `directmpc.mptc.formats`), and the
VHDL gets them from there. The program of products says what is added to what. So the least and the
largest value of every sum follow from the words that it begins with, by arithmetic on intervals,
without a sample. A sum that may leave its word has to be one that saturates with a flag.

`CHECKS` lists what is shown. Each check raises `RangeError` where a sum does not fit. Beside it
stands a fault: a format that is narrower, with which it does not.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

from directmpc.mpdcc import state_program
from directmpc.mptc import formats as mptc_formats
from directmpc.mptc import vector_sequencer
from scripts.measure.ranges import mpdcc, mptc, mptc_times, observers, second_level
from scripts.measure.ranges.intervals import Check, Fault, RangeError

METHOD = "intervals"


def shown(check: Check) -> tuple[str, float]:
    """Run a check."""
    began, problem = time.perf_counter(), ""
    try:
        check.run()
    except RangeError as error:
        problem = str(error)
    return problem, time.perf_counter() - began


CHECKS: Sequence[Check] = (
    Check("common_terms", "sums_fit",
          "no sum of products leaves its accumulator; a result that may leave its word saturates "
          "and flags",
          mpdcc.common_terms, Fault("ACCUMULATOR_WIDTH", -3)),
    Check("mpdcc_explorer", "trajectories_fit",
          "no error, slope, voltage or end of a step leaves its word", mpdcc.trajectories,
          Fault("TRAJECTORY_WIDTH", -1)),
    Check("candidate_cost", "costs_fit",
          "no effort, weight, square or cost leaves its word, up to the weight that saturates and "
          "flags", mpdcc.costs, Fault("COST_WIDTH", -1)),
    Check("step_one", "ranks_fit", "no excess and no rank of a deadlock leaves its word",
          mpdcc.ranks, Fault("RANK_WIDTH", -1)),
    Check("length_search", "search_fits",
          "no margin, slope or threshold of the fast search leaves its word", mpdcc.search,
          Fault("SLOPE_WIDTH", -1)),
    Check("node_base", "bases_fit",
          "no operand that a successor starts from leaves its word, but for what unfit tells of",
          second_level.bases, Fault("BASE_WIDTH", -1)),
    Check("common_terms", "successors_fit",
          "no result of a successor leaves its word, up to those that saturate and flag",
          second_level.successors, Fault("FORCED_WIDTH", -1)),
    Check("second_level", "leaves_fit",
          "no trajectory, effort, length or cost of a leaf leaves its word", second_level.leaves,
          Fault("TOTAL_EFFORT_WIDTH", -1)),
    Check("mptc_datapath", "sums_fit",
          "no sum of products leaves its accumulator, with any method and duty rule", mptc.sums,
          Fault("ACCUMULATOR_WIDTH", -1, mptc_formats)),
    Check("mptc_magnitude", "rotations_fit",
          "no component of a flux leaves its word, whichever rotation it is behind",
          mptc.magnitude, Fault("MAGNITUDE_WIDTH", -1, mptc_formats)),
    Check("mptc_vector_stream", "vectors_fit",
          "no torque term and no cost of a single vector leaves its word, nor MPFC's radicand",
          mptc.vectors, Fault("COST_WIDTH", -1, mptc_formats)),
    Check("mptc_pair_stream", "pairs_fit",
          "no torque error, rest of a search, flux or cost of a pair leaves its word", mptc.pairs,
          Fault("TORQUE_WIDTH", -1, mptc_formats)),
    Check("mptc_coordinates", "coordinates_fit",
          "no coordinate and no residue of a choice leaves its word, but for a quotient that far "
          "tells of", mptc.coordinates, Fault("RESIDUE_FRACTION", 1, mptc_formats)),
    Check("mptc_quotient", "quotients_fit",
          "no dividend, rest or trial of a quotient leaves its word, SVM's included",
          mptc_times.quotients, Fault("QUOTIENT_FRACTION", -1, mptc_formats)),
    Check("mptc_root", "roots_fit", "no rest and no trial of a root leaves its word",
          mptc_times.roots, Fault("ROOT_WIDTH", -1, mptc_formats)),
    Check("mptc_flux_reference", "references_fit",
          "no length, shift or part of MPFC's reference leaves its word, up to what saturates and "
          "flags", mptc_times.flux_reference, Fault("ROOT_WIDTH", 1, mptc_formats)),
    Check("mptc_duty", "duties_fit",
          "no error of a length, rest or duty leaves its word, nor a torque that goes on from it",
          mptc_times.duties, Fault("TORQUE_FRACTION", -1, mptc_formats)),
    Check("mptc_choices", "choices_fit",
          "no time, residue or square of a choice leaves its word, whichever vector leads",
          mptc_times.choices, Fault("WORD_WIDTH", -1, mptc_formats)),
    Check("mptc_hexagon", "times_fit",
          "no time of a flux method is below zero, and both are one period at most",
          mptc_times.hexagon, Fault("TIME_WIDTH", -1, mptc_formats)),
    Check("mptc_shares", "shares_fit",
          "no sum of times and no share leaves its word, with times of one period at most",
          mptc_times.shares, Fault("TIME_WIDTH", -1, mptc_formats)),
    Check("mptc_mean_share", "shares_fit",
          "no sum of times and no share leaves its word, with times of one period at most",
          mptc_times.running_shares, Fault("FRACTION", 1, mptc_formats)),
    Check("vector_sequencer", "ends_fit",
          "no end of a segment leaves its word, with any times; the phase stops at its end",
          mptc_times.segments, Fault("POSITION_WIDTH", -1, vector_sequencer)),
    Check("mptc_preexcitation", "squares_fit", "no sum of squares leaves its accumulator",
          mptc_times.preexcitation, Fault("ACCUMULATOR_WIDTH", -6, mptc_formats)),
    Check("state_observer", "states_fit",
          "no sum, voltage, state or change of theta leaves its word, up to what saturates and "
          "flags", observers.states, Fault("PHASE_WIDTH", -2, state_program)),
    Check("mptc_observer", "states_fit",
          "no sum and no half of a step leaves its word, up to what saturates and flags",
          observers.stator_flux, Fault("ACCUMULATOR_WIDTH", -1, mptc_formats)),
    Check("mptc_speed_observer", "states_fit",
          "no sum, half of a step or mean share leaves its word, up to what saturates and flags",
          observers.speed, Fault("ACCUMULATOR_WIDTH", -1, mptc_formats)),
)  # fmt: skip
"""All of it, for any content of registers and any measurement."""
