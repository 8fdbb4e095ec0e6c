-- Records of the K-best core.
--
-- Vectors stand in the coordinates u = x_alpha and w = x_beta / sqrt(3); docs/specification.md, section
-- 10.7, has scales and equations.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.kbest_constants.all;

package kbest_types is

  subtype factor_t is signed(FACTOR_WIDTH - 1 downto 0);

  subtype error_t is signed(ERROR_WIDTH - 1 downto 0);

  subtype ahead_t is signed(AHEAD_WIDTH - 1 downto 0);

  subtype voltage_t is signed(VOLTAGE_WIDTH - 1 downto 0);

  subtype cost_t is unsigned(COST_WIDTH - 1 downto 0);

  subtype position_t is unsigned(2 downto 0);

  subtype code_t is unsigned(3 downto 0);

  subtype slot_t is unsigned(3 downto 0);

  -- number of a child in its stage

  subtype number_t is unsigned(7 downto 0);

  -- sums of costs, not limited yet

  subtype wide_cost_t is unsigned(COST_WIDTH + 3 downto 0);

  -- what a key adds

  subtype ahead_cost_t is unsigned(COST_WIDTH - 1 downto 0);

  type voltages_t is array (0 to 2) of voltage_t;

  type positions_t is array (0 to 2) of position_t;

  type errors_t is array (0 to 2) of error_t;

  -- coefficients of the load, in port order, see directmpc.kbest.formats
  type coefficients_t is record
    angle     : factor_t;
    decay_1   : factor_t;
    decay_2   : factor_t;
    flux_0    : factor_t;
    flux_2    : factor_t;
    flux_u    : factor_t;
    flux_w    : factor_t;
    forced_1  : factor_t;
    forced_2  : factor_t;
    level_1   : factor_t;
    level_2   : factor_t;
    neutral   : factor_t;
    capacitor : factor_t;
  end record coefficients_t;

  -- settings of the search, see directmpc.kbest.formats
  type settings_t is record
    effort         : unsigned(EFFORT_WIDTH - 1 downto 0); -- lambda_u
    bound_neutral  : unsigned(VOLTAGE_WIDTH - 2 downto 0); -- where the cost of v_n's excess begins
    bound_phase    : unsigned(VOLTAGE_WIDTH - 2 downto 0); -- the same of v_ph
    weight_neutral : unsigned(3 downto 0); -- exponent of two, 0 to 10
    weight_phase   : unsigned(3 downto 0); -- the same of v_ph
  end record settings_t;

  -- state of a node
  type node_t is record
    u         : error_t;
    w         : error_t;
    v_n       : voltage_t;
    d         : voltage_t;   -- v_ph - v_dc/4 of the phase that its parent's child moved
    cost      : cost_t;     -- J
    positions : positions_t;
  end record node_t;

  constant NODE_WIDTH : natural := 2 * ERROR_WIDTH + 2 * VOLTAGE_WIDTH + 9; -- without J

  constant NODE_INIT : node_t := (
    (others => '0'), (others => '0'), (others => '0'), (others => '0'), (others => '0'),
    (others => (others => '0'))
  );

  function to_word (node : node_t) return std_logic_vector;

  function to_node (bits : std_logic_vector) return node_t;

  -- change of an error by the voltage of a phase

  subtype change_t is signed(ERROR_WIDTH downto 0);

  subtype drawn_t is signed(VOLTAGE_WIDTH + 2 downto 0);

  subtype wide_error_t is signed(ERROR_WIDTH + 3 downto 0);

  -- a node with what its children share
  type prepared_t is record
    long       : std_logic;    -- '1': the stage lasts two steps
    level      : factor_t;     -- change of the error by a quarter of v_dc
    on_neutral : error_t;      -- by v_n
    keep_u     : wide_error_t; -- error of the child that keeps, not limited yet
    keep_w     : wide_error_t;
    drawn      : drawn_t;      -- v_n of the child that keeps, not limited yet
    total      : wide_cost_t;  -- J and the cost of v_ph's excess of that child
    ahead      : ahead_cost_t; -- what the key adds for v_ph
  end record prepared_t;

  -- a weight is 2 ** 10 at most, and a long stage doubles it
  constant MOST_WEIGHT : natural := 11;

  constant SHARE_COST_WIDTH  : natural := 2 * EXCESS_WIDTH - EXCESS_SHIFT + MOST_WEIGHT;
  constant SHARE_AHEAD_WIDTH : natural := 2 * AHEAD_WIDTH - 1 - CAPACITOR_AHEAD_SHIFT;
  constant SHARE_WIDTH       : natural := SHARE_COST_WIDTH + SHARE_AHEAD_WIDTH;

  -- the same for each of its phases
  type prepared_phase_t is record
    cost  : wide_cost_t;  -- share in total
    ahead : ahead_cost_t; -- share in ahead
  end record prepared_phase_t;

  -- change of an error by the voltage of a phase at a position
  function change_of (s : position_t; level : factor_t; on_neutral, on_phase : error_t) return change_t;

  -- excess of a voltage over a bound, not negative
  function excess (value : voltage_t; bound : unsigned) return factor_t;

  -- where a straight line leads in 8 or 4 times its stage, less low bits, limited to its word
  function ahead (now, earlier : signed; long : std_logic; steps, low : natural) return ahead_t;

  -- shift of cost_of for an exponent of a weight; one less for a long stage, which doubles it
  function down_of (weight : unsigned; long : std_logic) return unsigned;

  -- square of an excess as a cost
  function cost_of (square, down : unsigned) return wide_cost_t;

end package kbest_types;

package body kbest_types is

  function to_word (node : node_t) return std_logic_vector is
  begin

    return std_logic_vector(node.u) & std_logic_vector(node.w) & std_logic_vector(node.v_n)
           & std_logic_vector(node.d)
           & std_logic_vector(node.positions(0))
           & std_logic_vector(node.positions(1)) & std_logic_vector(node.positions(2));

  end function to_word;

  function to_node (bits : std_logic_vector) return node_t is

    variable rest : std_logic_vector(NODE_WIDTH - 1 downto 0);
    variable node : node_t;
    variable at   : natural;

  begin

    rest := bits;

    for x in 2 downto 0 loop
      node.positions(x) := unsigned(rest((2 - x) * 3 + 2 downto (2 - x) * 3));
    end loop;

    node.cost := (others => '0');
    at        := 9;

    node.d    := signed(rest(at + VOLTAGE_WIDTH - 1 downto at));
    at        := at + VOLTAGE_WIDTH;

    node.v_n := signed(rest(at + VOLTAGE_WIDTH - 1 downto at));
    at       := at + VOLTAGE_WIDTH;
    node.w   := signed(rest(at + ERROR_WIDTH - 1 downto at));
    at       := at + ERROR_WIDTH;
    node.u   := signed(rest(at + ERROR_WIDTH - 1 downto at));
    return node;

  end function to_node;

  function change_of (s : position_t; level : factor_t; on_neutral, on_phase : error_t) return change_t is

    variable index  : natural range 0 to 7;
    variable scaled : change_t;
    variable result : change_t;

  begin

    index  := to_integer(s);
    scaled := resize(level, change_t'length);

    if (LEVEL_OF(index) = 2 or LEVEL_OF(index) = -2) then
      scaled := shift_left(scaled, 1);
    end if;

    result := gated(resize(on_neutral, change_t'length), to_std_logic(NEUTRAL_OF(index) > 0));
    result := adjusted(result, scaled, to_std_logic(LEVEL_OF(index) > 0), to_std_logic(LEVEL_OF(index) < 0));
    return adjusted(result, resize(on_phase, change_t'length), to_std_logic(CAPACITOR_OF(index) > 0),
                    to_std_logic(CAPACITOR_OF(index) < 0));

  end function change_of;

  function excess (value : voltage_t; bound : unsigned) return factor_t is

    variable size   : signed(VOLTAGE_WIDTH downto 0);
    variable over   : signed(VOLTAGE_WIDTH downto 0);
    variable result : factor_t;

  begin

    -- without the carry of a magnitude: a negative value counts one less
    size   := resize(value xor (value'range => value(value'high)), VOLTAGE_WIDTH + 1);
    over   := size - signed(resize(bound, VOLTAGE_WIDTH + 1));
    result := resize(over(EXCESS_WIDTH downto 0), FACTOR_WIDTH);

    if (over(over'high) = '1') then
      result := (others => '0');
    elsif (over(VOLTAGE_WIDTH - 1 downto EXCESS_WIDTH) /= 0) then
      result := to_signed(2 ** EXCESS_WIDTH - 1, FACTOR_WIDTH);
    end if;

    return result;

  end function excess;

  function ahead (now, earlier : signed; long : std_logic; steps, low : natural) return ahead_t is

    variable change_n : signed(now'length + 1 downto 0);
    variable change_e : signed(now'length + 1 downto 0);

  begin

    -- less the low bits that the change does not reach: then one sum of three
    change_n := resize(now, change_n'length);
    change_e := resize(earlier, change_e'length);

    if (long = '0') then
      change_n := shift_left(change_n, 1);
      change_e := shift_left(change_e, 1);
    end if;

    return clip(shift_right(shift_right(now, steps - 1) + change_n - change_e, low - steps + 1), AHEAD_WIDTH);

  end function ahead;

  function down_of (weight : unsigned; long : std_logic) return unsigned is
  begin

    if (long = '1') then
      return (MOST_WEIGHT - 1) - weight;
    end if;

    return MOST_WEIGHT - weight;

  end function down_of;

  function cost_of (square, down : unsigned) return wide_cost_t is
  begin

    return resize(shift_right(shift_right(square, EXCESS_SHIFT - MOST_WEIGHT), to_integer(down)), wide_cost_t'length);

  end function cost_of;

end package body kbest_types;
