-- Records between scheduler and explorers, and the arithmetic on them that both need.
--
-- A node is a state together with the switch position it is reached with; everything about it that
-- does not depend on the candidate is computed once.  An explorer takes any node, not only the
-- root of the step.  Trajectory units, see directmpc/formats.py.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;

package mpdcc_types is

  constant OUTPUTS : natural := 7; -- i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c

  subtype trajectory_t is signed(TRAJECTORY_WIDTH - 1 downto 0);

  subtype forced_t is signed(FORCED_WIDTH - 1 downto 0);

  subtype current_term_t is signed(CURRENT_TERM_WIDTH - 1 downto 0);

  subtype weight_t is signed(WEIGHT_WIDTH - 1 downto 0);

  subtype bound_t is unsigned(BOUND_WIDTH - 1 downto 0);

  subtype length_t is unsigned(LENGTH_WIDTH - 1 downto 0);

  subtype cost_t is unsigned(COST_WIDTH - 1 downto 0);

  subtype position_t is unsigned(2 downto 0);

  type errors_t is array (0 to OUTPUTS - 1) of trajectory_t;

  type trajectories_t is array (0 to 2) of trajectory_t;

  type forced_terms_t is array (0 to 2) of forced_t;

  type current_terms_t is array (0 to 2) of current_term_t;

  type weights_t is array (0 to 2) of weight_t;

  type positions_t is array (0 to 2) of position_t;

  type node_t is record
    error           : errors_t;        -- y* - y at k, trajectory units
    slope           : trajectories_t;  -- natural part of the current errors' slopes, per step
    forced_link     : forced_t;        -- term of v_dc/2 in the slopes, FORCED_FRACTION extra bits
    forced_neutral  : forced_t;        -- term of v_n
    forced_phase    : forced_terms_t;  -- term of v_ph, per phase
    phase_current   : current_terms_t; -- slope of v_ph per phase at c(s) = 1
    neutral_current : current_terms_t; -- share of each phase in the slope of v_n
    weight_start    : weight_t;        -- sqrt(lambda_n) * v_n at k
    weight_slope    : weights_t;       -- share of each phase in its slope, WEIGHT_SLOPE_FRACTION extra bits
  end record node_t;

  type limits_t is record
    bound_current : bound_t;              -- trajectory units
    bound_neutral : bound_t;              -- trajectory units
    bound_phase   : bound_t;              -- trajectory units
    horizon       : length_t;             -- N, steps
    weight_scale  : unsigned(1 downto 0); -- index into WEIGHT_SHIFTS
  end record limits_t;

  type measurement_t is record
    is_alpha   : signed(15 downto 0);   -- stator current, 1/16000 pu
    is_beta    : signed(15 downto 0);   -- 1/16000 pu
    psir_alpha : signed(15 downto 0);   -- rotor flux, 1/9000 pu
    psir_beta  : signed(15 downto 0);   -- 1/9000 pu
    v_n        : signed(15 downto 0);   -- neutral point potential, 1/64000 pu
    v_ph_a     : unsigned(15 downto 0); -- phase capacitor voltages, 1/32000 pu
    v_ph_b     : unsigned(15 downto 0); -- 1/32000 pu
    v_ph_c     : unsigned(15 downto 0); -- 1/32000 pu
    v_dc       : unsigned(15 downto 0); -- dc-link voltage, 1/16000 pu
    iref_alpha : signed(15 downto 0);   -- current reference, 1/16000 pu
    iref_beta  : signed(15 downto 0);   -- 1/16000 pu
    omega_s    : signed(15 downto 0);   -- stator frequency, 1/16000 pu
    omega_r    : signed(15 downto 0);   -- rotor speed, 1/16000 pu
  end record measurement_t;

  type decision_t is record
    position  : positions_t; -- s(k)
    held      : std_logic;   -- '1': s(k-1) was kept
    deadlock  : std_logic;   -- '1': no candidate stays inside its bounds
    length    : length_t;    -- L* of the choice, 0 when held or deadlocked, steps
    saturated : std_logic;   -- '1': a value did not fit its word
  end record decision_t;

  constant DECISION_INIT : decision_t := (
    position  => (others => (others => '0')),
    held      => '0',
    deadlock  => '0',
    length    => (others => '0'),
    saturated => '0'
  );

  type candidate_t is record
    probe    : std_logic;                          -- '1': only ask whether step one stays inside
    index    : unsigned(INDEX_WIDTH - 1 downto 0); -- place in the order of enumeration
    position : positions_t;                        -- candidate
    effort   : unsigned(EFFORT_WIDTH - 1 downto 0); -- f_s, weighted transitions
  end record candidate_t;

  type result_t is record
    feasible  : std_logic;                          -- '1': length > 0, cost valid; '0': excess valid
    saturated : std_logic;                          -- '1': the weight on v_n saturated
    index     : unsigned(INDEX_WIDTH - 1 downto 0); -- place in the order of enumeration
    position  : positions_t;                        -- candidate
    length    : length_t;                           -- L*, steps
    cost      : cost_t;                             -- J, RECIPROCAL_FRACTION fractional bits
    excess    : trajectory_t;                       -- J_dl, trajectory units
  end record result_t;

  type results_t is array (natural range <>) of result_t;

  constant RESULT_INIT : result_t := (
    feasible  => '0',
    saturated => '0',
    index     => (others => '0'),
    position  => (others => (others => '0')),
    length    => (others => '0'),
    cost      => (others => '0'),
    excess    => (others => '0')
  );

  -- inverse Clarke transformation; beta already carries sqrt(3)/2; one bit wider than alpha
  function phase_of (alpha, beta : signed; phase : natural) return signed;

  function is_in (position : position_t; mask : positions_mask_t) return std_logic;

  -- h*Xr/(3D) * v_x of one phase, FORCED_FRACTION extra fractional bits, one bit of headroom
  function phase_voltage (node : node_t; phase : natural; position : position_t) return signed;

  -- sum of the neutral-point shares of the phases connected to it
  function neutral_slope (node : node_t; position : positions_t) return signed;

  function weight_slope_of (node : node_t; position : positions_t) return weight_t;

  -- '1' where a is better than b: feasible first, then cost or excess, then place
  function better (a, b : result_t) return std_logic;

end package mpdcc_types;

package body mpdcc_types is

  function phase_of (alpha, beta : signed; phase : natural) return signed is

    variable half   : signed(alpha'length downto 0);
    variable result : signed(alpha'length downto 0);

  begin

    half := shift_right(resize(alpha, alpha'length + 1), 1);

    case phase is

      when 0 =>

        result := resize(alpha, alpha'length + 1);

      when 1 =>

        result := resize(beta, alpha'length + 1) - half;

      when others =>

        result := -half - resize(beta, alpha'length + 1);

    end case;

    return result;

  end function phase_of;

  function is_in (position : position_t; mask : positions_mask_t) return std_logic is
  begin

    return mask(to_integer(position));

  end function is_in;

  function phase_voltage (node : node_t; phase : natural; position : position_t) return signed is

    variable result : signed(FORCED_WIDTH downto 0);

  begin

    result := weighted(node.forced_link, is_in(position, LINK_POSITIVE), is_in(position, LINK_NEGATIVE))
              + weighted(node.forced_phase(phase), is_in(position, CAPACITOR_POSITIVE),
                         is_in(position, CAPACITOR_NEGATIVE))
              + gated(node.forced_neutral, is_in(position, NEUTRAL_VOLTAGE));
    return result;

  end function phase_voltage;

  function neutral_slope (node : node_t; position : positions_t) return signed is

    variable result : signed(CURRENT_TERM_WIDTH + 1 downto 0);

  begin

    result := (others => '0');

    for x in 0 to 2 loop
      result := result + gated(node.neutral_current(x), is_in(position(x), NEUTRAL_CURRENT));
    end loop;

    return result;

  end function neutral_slope;

  function weight_slope_of (node : node_t; position : positions_t) return weight_t is

    variable result : weight_t;

  begin

    -- the three shares add up to rounding errors, so no partial sum needs more bits than one share
    result := (others => '0');

    for x in 0 to 2 loop
      result := result + gated(node.weight_slope(x), is_in(position(x), NEUTRAL_CURRENT));
    end loop;

    return result;

  end function weight_slope_of;

  function better (a, b : result_t) return std_logic is

    variable key_a : unsigned(COST_WIDTH downto 0);
    variable key_b : unsigned(COST_WIDTH downto 0);

  begin

    if (a.feasible = '1' and b.feasible = '0') then
      return '1';
    elsif (a.feasible = '0' and b.feasible = '1') then
      return '0';
    end if;

    if (a.feasible = '1') then
      key_a := '0' & a.cost;
      key_b := '0' & b.cost;
    else
      -- signed order becomes unsigned order with the sign bit inverted
      key_a                       := unsigned(resize(a.excess, COST_WIDTH + 1));
      key_b                       := unsigned(resize(b.excess, COST_WIDTH + 1));
      key_a(COST_WIDTH) := not key_a(COST_WIDTH);
      key_b(COST_WIDTH) := not key_b(COST_WIDTH);
    end if;

    return to_std_logic((key_a & a.index) < (key_b & b.index));

  end function better;

end package body mpdcc_types;
