-- Records between mptc_core and the parts of the controller, and the types in them.
--
-- Formats as in model/directmpc/mptc/formats.py.  All records are valid in the clock in which they are given.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_vectors.all;

package mptc_types is

  subtype measurement_t is std_logic_vector(MEASUREMENT_WIDTH - 1 downto 0);

  subtype signed_word_t is signed(WORD_WIDTH - 1 downto 0); -- a word that is written by a sum

  subtype sum_t is signed(SUM_WIDTH - 1 downto 0); -- sum of products

  subtype term_t is signed(TERM_WIDTH - 1 downto 0); -- torque term

  -- measurements and references of a decision
  type mptc_inputs_t is record
    is_alpha   : measurement_t;                                  -- signed
    is_beta    : measurement_t;                                  -- signed
    psis_alpha : measurement_t;                                  -- signed
    psis_beta  : measurement_t;                                  -- signed
    omega_r    : measurement_t;                                  -- signed
    v_dc       : measurement_t;                                  -- unsigned
    torque_ref : measurement_t;                                  -- signed
    psi_ref    : std_logic_vector(REFERENCE_WIDTH - 1 downto 0); -- unsigned
    u          : std_logic_vector(2 downto 0);                   -- number of the vector being applied
  end record mptc_inputs_t;

  -- parameters from a drive file
  type mptc_coefficients_t is record
    current       : word_t;
    flux          : word_t;
    rotor         : word_t;
    rotor_flux    : word_t;
    drop_current  : word_t;
    drop          : word_t;
    drop_flux     : word_t;
    speed         : word_t;
    voltage_alpha : word_t;
    voltage_beta  : word_t;
    torque        : word_t;
    weight        : word_t;
  end record mptc_coefficients_t;

  -- what a decision brings
  type mptc_decision_t is record
    valid     : std_logic;                    -- '1' for one clock: the others are new
    busy      : std_logic;                    -- '1': a decision is under way
    u_next    : std_logic_vector(2 downto 0); -- number of the vector to apply next
    switches  : std_logic_vector(2 downto 0); -- its switch states a, b, c; '1': positive rail
    saturated : std_logic;                    -- '1': a value did not fit its word
    clamped   : std_logic;                    -- '1': MPFC cannot reach the torque reference
  end record mptc_decision_t;

  -- a cost as it is compared

  constant COMPARED_WIDTH : natural := COST_WIDTH - COST_DROPPED;

  subtype compared_t is std_logic_vector(COMPARED_WIDTH - 1 downto 0);

  subtype family_t is std_logic_vector(2 downto 0); -- method of several vectors; bit 2: a flux method

  constant FAMILY_NONE  : family_t := "000"; -- one vector: MPTC or MPFC
  constant FAMILY_MPTC1 : family_t := "001";
  constant FAMILY_MPTC2 : family_t := "010";
  constant FAMILY_GTV   : family_t := "011";
  constant FAMILY_MPFC2 : family_t := "100";
  constant FAMILY_MPFC3 : family_t := "101";
  constant FAMILY_MPC2  : family_t := "110";
  constant FAMILY_SVM   : family_t := "111";

  subtype duty_rule_t is std_logic_vector(1 downto 0); -- how MPTC1 and MPTC2 find a duty; bit 1: best

  constant RULE_DEADBEAT : duty_rule_t := "00"; -- by the torque at the end of the period
  constant RULE_MEAN     : duty_rule_t := "01"; -- by the mean torque

  subtype time_t is std_logic_vector(TIME_WIDTH downto 0); -- unsigned, 1/4096 of the period, at most 4096

  -- vectors of a period in the order applied; the third has the rest of the time
  type mptc_sequence_t is record
    u1 : vector_t;
    u2 : vector_t;
    u3 : vector_t;
    t1 : time_t;
    t2 : time_t;
  end record mptc_sequence_t;

  constant WHOLE_PERIOD : time_t := (TIME_WIDTH => '1', others => '0');

  constant NO_VOLTAGE : mptc_sequence_t := ("000", "000", "000", (others => '0'), (others => '0'));

  -- '1': the first two times of a sequence are more than the period
  function too_long (given : mptc_sequence_t) return std_logic;

  -- a sequence as it is used: where they are, the third vector has all of the period
  function fitted (given : mptc_sequence_t) return mptc_sequence_t;

  subtype error_t is signed(ERROR_WIDTH - 1 downto 0); -- quarters of a torque term

  subtype mptc_rest_t is unsigned(ERROR_WIDTH downto 0); -- rest of a search of a duty: up to four times a span

  subtype mptc_taken_t is unsigned(ERROR_WIDTH - 1 downto 0); -- up to twice a span

  -- a duty that has been found, on its way to the mean share
  type mptc_duty_t is record
    take      : std_logic;                                 -- '1': the others are new
    duty      : std_logic_vector(TIME_WIDTH - 1 downto 0); -- unsigned, 1/4096 of the period
    second    : vector_t;                                  -- second vector, zero as u_0
    direction : vector_t;                                  -- first less second, active
  end record mptc_duty_t;

  -- length of the flux with a single vector
  type mptc_length_t is record
    take  : std_logic;                    -- '1': the others are new
    place : std_logic_vector(2 downto 0); -- number of the vector plus LENGTH_LATENCY, modulo 8; zero voltage as 7
    error : signed_word_t;                -- length less reference, 16 fractional bits, times the magnitude's gain
  end record mptc_length_t;

  constant NO_DUTY : mptc_duty_t := ('0', (others => '0'), "000", "000");

  subtype rank_t is std_logic_vector(5 downto 0); -- first and second vector of a pair, zero voltage as u_0

  -- a pair on its way through magnitude and cost
  type mptc_tried_t is record
    enable  : std_logic; -- '1': the ways of a pair are in the accumulators
    take    : std_logic; -- '1': left is the torque error of a pair
    left    : term_t;
    compare : std_logic; -- '1': the cost of a pair is compared
    rank    : rank_t;    -- of that, else zero
    best    : rank_t;    -- of the cheapest so far, else zero; of equal ones the lowest wins
  end record mptc_tried_t;

  constant NOTHING_TRIED : mptc_tried_t := ('0', '0', (others => '0'), '0', (others => '0'), (others => '0'));

  subtype hexagon_t is signed(HEXAGON_WIDTH - 1 downto 0); -- coordinate along a vector, in ways of a vector

  subtype form_t is signed(HEXAGON_WIDTH downto 0); -- sum of two coordinates, one of them doubled

  -- what is missing to the reference, e, in the coordinates of the leading vector
  type mptc_missing_t is record
    g     : hexagon_t; -- along the leading vector
    h     : hexagon_t; -- along the next one
    total : hexagon_t; -- g + h
  end record mptc_missing_t;

  -- what remains of e, as operands of its square
  type mptc_residues_t is record
    along  : word_t; -- along the leading vector
    beside : word_t; -- along the next one
    total  : word_t; -- sum of both
  end record mptc_residues_t;

  constant NO_RESIDUES : mptc_residues_t := ((others => '0'), (others => '0'), (others => '0'));

  subtype kind_t is std_logic_vector(1 downto 0); -- where the point of a choice lies

  constant KIND_SPOKE  : kind_t := "00"; -- between zero voltage and the choice's vector
  constant KIND_EDGE   : kind_t := "01"; -- between the choice's vector and the leading one
  constant KIND_ALONE  : kind_t := "10"; -- MPFC3: between zero voltage and the leading vector
  constant KIND_INSIDE : kind_t := "11"; -- MPFC3: at e

  -- choice of a second vector
  type mptc_choice_t is record
    number : std_logic_vector(2 downto 0); -- column of TURNS
    other  : vector_t;                     -- its vector
    beside : std_logic;                    -- '1': it is the leading vector's neighbour, or the next one's
    fewer  : std_logic;                    -- '1': it takes fewer commutations than the leading one
    part   : time_t;                       -- time of the leading vector, of a spoke that of the choice's vector
    kind   : kind_t;
  end record mptc_choice_t;

  subtype blocks_t is std_logic_vector(0 to BLOCK_COUNT - 1); -- one bit for each mac_block

  subtype select_t is std_logic_vector(4 downto 0); -- place in a list

  type selects_t is array (0 to BLOCK_COUNT - 1) of select_t;

  -- products that the blocks begin in this clock
  type mptc_products_t is record
    issue       : blocks_t;  -- '1': a product
    gather      : blocks_t;  -- '1': it is added to the sum so far
    halve       : blocks_t;  -- '1': half of B
    lead        : blocks_t;  -- '1': one plus half of B
    a_choice    : selects_t; -- place in A_LISTS
    b_choice    : selects_t; -- place in B_LISTS
    seed_choice : selects_t; -- place in SEED_LISTS
  end record mptc_products_t;

  -- what is due in this clock
  type mptc_events_t is record
    word_writes  : std_logic_vector(WORD_WRITES'length(1) - 1 downto 0); -- row of WORD_WRITES
    term_writes  : std_logic_vector(TERM_WRITES'length(1) - 1 downto 0); -- row of TERM_WRITES
    normalise    : std_logic;                                            -- MPFC: bring w to full size, one shift
    orient       : std_logic;                                            -- MPFC: last shift, w without size
    square       : std_logic; -- MPFC: the square of the reference's length is in the last block's accumulator
    radicand     : std_logic; -- MPFC: the same less the torque's part
    begin_stream : std_logic;                                            -- the first vector follows
    last         : std_logic;                                            -- the last vector or pair is compared
    begin_pairs  : std_logic;                                            -- the first pair follows
    way_alpha    : std_logic; -- flux methods of several vectors: the way along alpha is in the accumulator
    way_beta     : std_logic; -- the same: the way along beta
    rest         : std_logic; -- the same: what is missing to the reference is in the accumulators
  end record mptc_events_t;

  -- state at k+2 without voltage, and what the vectors add to it
  type mptc_state_t is record
    stator_alpha : signed_word_t; -- flux
    stator_beta  : signed_word_t;
    step_alpha   : signed_word_t; -- twice the whole step of a vector along alpha
    step_beta    : signed_word_t;
    level        : term_t;        -- MPTC: torque reference less torque; MPFC: size of a step in the cost
    along        : term_t;        -- torque, or cost, of a step along alpha
    across       : term_t;        -- torque, or cost, of a step along beta
    opening      : term_t;        -- FAMILY, MPTC: torque reference less torque at k+1
    moment       : signed_word_t; -- MPFC: torque reference as flux across the rotor flux
    rotor_alpha  : signed_word_t; -- MPTC: i_s0 along alpha
  end record mptc_state_t;

  -- MPFC's reference of the stator flux in the coordinates of the rotor flux
  type mptc_reference_t is record
    along  : word_t;    -- part along the rotor flux
    across : word_t;    -- part across it
    beyond : std_logic; -- '1': no part along it is left, the torque reference is out of reach
  end record mptc_reference_t;

  -- as many of a table's entries as a configuration has
  function counted (flux_control : boolean; every, without : natural) return natural;

  -- value + step or value - step, one adder
  function moved (value, step : signed; negative : std_logic) return signed;

  -- '1': negative
  function sign_of (value : signed) return std_logic;

  -- '1': a coordinate of the hexagon, or a sum of them, is more than the way of a vector
  function beyond_one (value : signed) return std_logic;

end package mptc_types;

package body mptc_types is

  function counted (flux_control : boolean; every, without : natural) return natural is
  begin

    if (flux_control) then
      return every;
    else
      return without;
    end if;

  end function counted;

  function too_long (given : mptc_sequence_t) return std_logic is

    variable sum : unsigned(TIME_WIDTH + 1 downto 0);

  begin

    sum := resize(unsigned(given.t1), TIME_WIDTH + 2) + unsigned(given.t2);
    return sum(TIME_WIDTH + 1) or (sum(TIME_WIDTH) and to_std_logic(sum(TIME_WIDTH - 1 downto 0) /= 0));

  end function too_long;

  function fitted (given : mptc_sequence_t) return mptc_sequence_t is

    variable result : mptc_sequence_t;

  begin

    result := given;

    if (too_long(given) = '1') then
      result.t1 := (others => '0');
      result.t2 := (others => '0');
    end if;

    return result;

  end function fitted;

  function moved (value, step : signed; negative : std_logic) return signed is

    variable a : signed(value'length downto 0);
    variable b : signed(value'length downto 0);

  begin

    a := value & '1';
    b := resize(step, value'length) & '0';

    if (negative = '1') then
      b := not b;
    end if;

    a := a + b;
    return a(value'length downto 1);

  end function moved;

  function sign_of (value : signed) return std_logic is
  begin

    return value(value'high);

  end function sign_of;

  function beyond_one (value : signed) return std_logic is

    variable bits   : signed(value'length - 1 downto 0);
    variable result : std_logic;

  begin

    bits   := value;
    result := to_std_logic(bits(HEXAGON_FRACTION - 1 downto 0) /= 0) and bits(HEXAGON_FRACTION);

    for i in HEXAGON_FRACTION + 1 to value'length - 2 loop
      result := result or bits(i);
    end loop;

    return result and not bits(value'length - 1);

  end function beyond_one;

end package body mptc_types;
