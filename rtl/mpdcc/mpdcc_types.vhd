-- Records between scheduler and explorers. Arithmetic on them stands in mpdcc_math, records of the second
-- level alone in second_level_types.
--
-- A node is a state together with the switch position it is reached with; everything about it that
-- does not depend on the candidate is computed once.  An explorer takes any node, not only the
-- root of the step.  Trajectory units, see model/directmpc/mpdcc/formats.py.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;

package mpdcc_types is

  constant OUTPUTS : natural := 7; -- i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c

  subtype trajectory_t is signed(TRAJECTORY_WIDTH - 1 downto 0);

  subtype forced_t is signed(FORCED_WIDTH - 1 downto 0);

  subtype current_term_t is signed(CURRENT_TERM_WIDTH - 1 downto 0);

  subtype weight_t is signed(WEIGHT_WIDTH - 1 downto 0);

  subtype bound_t is unsigned(BOUND_WIDTH - 1 downto 0);

  subtype length_t is unsigned(LENGTH_WIDTH - 1 downto 0);

  subtype cost_t is unsigned(COST_WIDTH - 1 downto 0);

  subtype rank_t is unsigned(RANK_WIDTH - 1 downto 0);

  subtype curvature_t is signed(CURVATURE_WIDTH - 1 downto 0);

  -- an error that is inside needs MARGIN_WIDTH bits

  subtype margin_t is signed(MARGIN_WIDTH downto 0);

  subtype turn_t is signed(TURN_WIDTH - 1 downto 0);

  type errors_t is array (0 to OUTPUTS - 1) of trajectory_t;

  type trajectories_t is array (0 to 2) of trajectory_t;

  type pair_t is array (0 to 1) of trajectory_t;

  type forced_terms_t is array (0 to 2) of forced_t;

  type current_terms_t is array (0 to 2) of current_term_t;

  type curvatures_t is array (0 to 2) of curvature_t;

  type margins_t is array (0 to 2) of margin_t;

  type turns_t is array (0 to 2) of turn_t;

  type reaches_t is array (0 to 2) of bound_t;

  type weights_t is array (0 to 2) of weight_t;

  type node_t is record
    error           : errors_t;        -- y* - y at k, trajectory units; i_c: the fast variant has y - y*
    slope           : trajectories_t;  -- natural part of the current errors' slopes, per step; likewise
    forced_link     : forced_t;        -- term of v_dc/2 in the slopes, FORCED_FRACTION extra bits
    forced_neutral  : forced_t;        -- term of v_n
    forced_phase    : forced_terms_t;  -- term of v_ph, per phase
    phase_current   : current_terms_t; -- slope of v_ph per phase at c(s) = 1
    neutral_current : current_terms_t; -- share of each phase in the slope of v_n
    weight_start    : weight_t;        -- sqrt(lambda_n) * v_n at k
    weight_slope    : weights_t;       -- share of each phase in its slope, WEIGHT_SLOPE_FRACTION extra bits
    curvature       : curvatures_t;    -- of the current errors, per square step; fast variant alone, likewise
  end record node_t;

  -- what the fast explorer needs too: the band as seen from k, per phase; where the node holds
  -- the opposite of phase c, so does the band
  type band_t is record
    first       : pair_t;                       -- error + curvature: the error at k+1 but for the slope; a and b
    margin_up   : margins_t;                    -- error - bound - 1: negative inside the upper bound; without the
    --                                             error where length_search adds it
    margin_down : margins_t;                    -- error + bound: not negative inside the lower bound; likewise
    outside     : std_logic_vector(2 downto 0); -- '1': the error is outside at k, and dead for it
    limit       : reaches_t;                    -- INWARDS: what the error at k+1 may be; one clock late
    turn        : turns_t;                      -- threshold, or -threshold - 1 with a negative curvature
    previous    : positions_t;                  -- s(k-1)
    negative    : std_logic_vector(2 downto 0); -- '1': negative phase current
  end record band_t;

  -- lengths and excesses of the capacitor voltages and v_n: rows 4 * phase + kind, then 16 + pattern

  subtype capacitor_row_t is unsigned(4 downto 0);

  type capacitor_t is record
    write     : std_logic;    -- '1': a row is new
    row       : capacitor_row_t;
    length    : length_t;     -- steps, at most the horizon
    excess    : trajectory_t; -- |error at k+1| - bound
    bank      : std_logic;    -- which of two tables; successors of the root take turns
    is_inside : std_logic;    -- INWARDS: '1': inside at k
  end record capacitor_t;

  constant CAPACITOR_NONE : capacitor_t := (
    write     => '0',
    row       => (others => '0'),
    length    => (others => '0'),
    excess    => (others => '0'),
    bank      => '0',
    is_inside => '0'
  );

  type limits_t is record
    bound_current   : bound_t;              -- trajectory units
    bound_neutral   : bound_t;              -- trajectory units
    bound_phase     : bound_t;              -- trajectory units
    horizon         : length_t;             -- N, steps
    weight_scale    : unsigned(1 downto 0); -- index into WEIGHT_SHIFTS
    deadlock_rule   : std_logic;            -- '1': weighted, '0': largest excess; WEIGHTED_DEADLOCK alone
    outside_inwards : std_logic;            -- '1': what is outside at k is followed inwards; INWARDS alone
  end record limits_t;

  -- what common_terms multiplies at the root, stable while it does

  type root_operands_t is record
    signals : std_logic_vector(SIGNAL_COUNT * OPERAND_WIDTH - 1 downto 0); -- operands A, signed, OPERAND_* order
    speeds  : std_logic_vector(2 * COEFFICIENT_WIDTH - 1 downto 0);        -- omega_s, omega_r, signed, 1/16000 pu
  end record root_operands_t;

  -- parameters, FACTOR_* order

  type coefficients_t is array (0 to COEFFICIENT_COUNT - 1) of std_logic_vector(COEFFICIENT_WIDTH - 1 downto 0);

  -- of the second level; without SECOND_LEVEL two_switchings and compensate have to be '0'

  type options_t is record
    two_switchings : std_logic;                           -- '1': SESE, '0': SE
    budget         : unsigned(BUDGET_WIDTH - 1 downto 0); -- candidates of the second level, 0: no limit
    compensate     : std_logic;                           -- '1': decide for k+1 from the state predicted under s(k-1)
  end record options_t;

  type measurement_t is record
    is_alpha   : signed(CURRENT_WIDTH - 1 downto 0);   -- stator current, 1/16000 pu
    is_beta    : signed(CURRENT_WIDTH - 1 downto 0);   -- 1/16000 pu
    psir_alpha : signed(FLUX_WIDTH - 1 downto 0);   -- rotor flux, 1/9000 pu
    psir_beta  : signed(FLUX_WIDTH - 1 downto 0);   -- 1/9000 pu
    v_n        : signed(NEUTRAL_VOLTAGE_WIDTH - 1 downto 0);   -- neutral point potential, 1/64012.5 pu
    v_ph_a     : unsigned(CAPACITOR_VOLTAGE_WIDTH - 1 downto 0); -- phase capacitor voltages, 1/32006.25 pu
    v_ph_b     : unsigned(CAPACITOR_VOLTAGE_WIDTH - 1 downto 0); -- 1/32006.25 pu
    v_ph_c     : unsigned(CAPACITOR_VOLTAGE_WIDTH - 1 downto 0); -- 1/32006.25 pu
    v_dc       : unsigned(LINK_VOLTAGE_WIDTH - 1 downto 0); -- dc-link voltage, 1/16003.125 pu
    iref_alpha : signed(CURRENT_WIDTH - 1 downto 0);   -- current reference, 1/16000 pu
    iref_beta  : signed(CURRENT_WIDTH - 1 downto 0);   -- 1/16000 pu
    omega_s    : signed(SPEED_WIDTH - 1 downto 0);   -- stator frequency, 1/16000 pu
    omega_r    : signed(SPEED_WIDTH - 1 downto 0);   -- rotor speed, 1/16000 pu
  end record measurement_t;

  type decision_t is record
    position  : positions_t; -- s(k)
    held      : std_logic;   -- '1': s(k-1) was kept
    deadlock  : std_logic;   -- '1': no candidate stays inside its bounds
    length    : length_t;    -- L* of the choice, 0 when held or deadlocked, steps
    saturated : std_logic;   -- '1': a value did not fit its word
    exhausted : std_logic;   -- '1': the budget ended the search
  end record decision_t;

  type candidate_t is record
    probe    : std_logic;                          -- '1': only ask whether step one stays inside
    index    : unsigned(INDEX_WIDTH - 1 downto 0); -- which next position of phases a, b, c, two bits each
    position : positions_t;                        -- candidate
    effort   : unsigned(EFFORT_WIDTH - 1 downto 0); -- f_s, weighted transitions
  end record candidate_t;

  type result_t is record
    feasible  : std_logic;                          -- '1': length > 0; '0': none stays inside
    saturated : std_logic;                          -- '1': the weight on v_n saturated
    index     : unsigned(INDEX_WIDTH - 1 downto 0); -- as in candidate_t, in the order of enumeration
    length    : length_t;                           -- L*, steps
    rank      : rank_t;                             -- J, RECIPROCAL_FRACTION fractional bits; or ranked J_dl
  end record result_t;

  type results_t is array (natural range <>) of result_t;

  -- a candidate of the second level, handed to an explorer past its blocks

  type leaf_t is record
    position : positions_t;                               -- candidate
    effort   : unsigned(TOTAL_EFFORT_WIDTH - 1 downto 0); -- f_s of both levels
    bank     : std_logic;                                 -- table of the capacitors' lengths
    index    : unsigned(INDEX_WIDTH - 1 downto 0);        -- place of the s1 that it follows
  end record leaf_t;

  type leaves_t is array (natural range <>) of leaf_t;

  constant LEAF_INIT : leaf_t := (
    position => (others => (others => '0')),
    effort   => (others => '0'),
    bank     => '0',
    index    => (others => '0')
  );

  -- how the node that leaves start from was reached, in time with the explorers' last stages

  type reached_t is record
    second    : std_logic;                          -- '1': leaves of the second level
    lead      : length_t;                           -- L1, as candidate_cost reads it in stage LENGTH_STAGE
    length    : length_t;                           -- L1, with the comparison
    saturated : std_logic;                          -- '1': a value of the node saturated, with the comparison
  end record reached_t;

  constant REACHED_INIT : reached_t := (
    second    => '0',
    lead      => (others => '0'),
    length    => (others => '0'),
    saturated => '0'
  );

  subtype base_t is signed(BASE_WIDTH - 1 downto 0);

  type start_slopes_t is array (0 to 1) of base_t; -- of a and b

  -- what the second level needs of a candidate of the first

  type evaluated_t is record
    slope_valid : std_logic;                              -- '1': slope is new
    slope_index : unsigned(INDEX_WIDTH - 1 downto 0);     -- place of the candidate that it belongs to
    slope       : start_slopes_t;                         -- of the current errors
    unfit       : std_logic;                              -- '1': one of them does not fit
    valid       : std_logic;                              -- '1': a candidate with length > 0
    index       : unsigned(INDEX_WIDTH - 1 downto 0);     -- its place
    effort      : unsigned(EFFORT_WIDTH - 1 downto 0);    -- f_s
    length      : length_t;                               -- L*, steps
    cost        : cost_t;                                 -- J
    saturated   : std_logic;                              -- '1': its weight on v_n saturated
  end record evaluated_t;

  constant EVALUATED_INIT : evaluated_t := (
    slope_valid => '0',
    slope_index => (others => '0'),
    slope       => (others => (others => '0')),
    unfit       => '0',
    valid       => '0',
    index       => (others => '0'),
    effort      => (others => '0'),
    length      => (others => '0'),
    cost        => (others => '0'),
    saturated   => '0'
  );

  -- to every explorer

  type broadcast_t is record
    node       : node_t;      -- where trajectories start, stable while busy
    band       : band_t;      -- fast variant: the band seen from there, stable while busy
    capacitor  : capacitor_t; -- fast variant: table of the capacitors' lengths, row by row
    last       : std_logic;   -- '1': no candidate of this node is left
    best_valid : std_logic;   -- '1': a candidate with length > 0 is known, J_dl is not needed any more
    best_cost  : cost_t;      -- its cost, valid with best_valid
    candidate  : candidate_t; -- what to evaluate, valid with candidate_valid of one explorer
    reached    : reached_t;   -- SECOND_LEVEL: how the node of the leaves was reached
  end record broadcast_t;

  -- to one explorer

  type assignment_t is record
    candidate_valid : std_logic; -- '1': candidate is new and is this explorer's
    result_ready    : std_logic; -- '1': result is taken in this clock
    leaf_valid      : std_logic; -- SECOND_LEVEL: '1': leaf is evaluated
    leaf            : leaf_t;    -- SECOND_LEVEL: a candidate of the second level
  end record assignment_t;

  type assignments_t is array (natural range <>) of assignment_t;

  -- of one explorer

  type answer_t is record
    candidate_ready : std_logic;   -- '1': candidate is taken in this clock
    probe_done      : std_logic;   -- '1' for one clock: answer to a probe
    probe_held      : std_logic;   -- '1': step one stays inside every bound
    result_valid    : std_logic;   -- '1': result is new
    result          : result_t;    -- evaluation of a candidate
    busy            : std_logic;   -- '1': tasks or results are under way
    evaluated       : evaluated_t; -- SECOND_LEVEL: every candidate, for the second level
  end record answer_t;

  type answers_t is array (natural range <>) of answer_t;

end package mpdcc_types;
