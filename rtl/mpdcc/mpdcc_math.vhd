-- Arithmetic on the records of mpdcc_types: phases of a plane, slopes of a position, next positions, order of
-- results.
--
-- Formats: trajectory units, see model/directmpc/mpdcc/formats.py.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_types.all;

package mpdcc_math is

  -- inverse Clarke transformation; beta already carries sqrt(3)/2; one bit wider than alpha
  function phase_of (alpha, beta : signed; phase : natural) return signed;

  -- the sum of phases a and b, exactly: the opposite of phase c but for the rounding of that one
  function opposite_of_c (alpha, beta : signed) return signed;

  function is_in (position : position_t; mask : positions_mask_t) return std_logic;

  -- h*Xr/(3D) * v_x of one phase, FORCED_FRACTION extra fractional bits, one bit of headroom
  function phase_voltage (node : node_t; phase : natural; position : position_t) return signed;

  -- sum of the neutral-point shares of the phases connected to it
  function neutral_slope (node : node_t; position : positions_t) return signed;

  function weight_slope_of (node : node_t; position : positions_t) return weight_t;

  -- 0: neither charged nor discharged by a positive current, 1: charged, 2: discharged
  function charge_kind (position : position_t) return unsigned;

  -- which phases are connected to the neutral point, phase a in bit 0
  function neutral_pattern (position : positions_t) return std_logic_vector;

  -- the phase alone in a pattern or alone not in it; all or none: any or none
  function single_of (pattern : std_logic_vector(2 downto 0)) return std_logic_vector;

  -- sum of the shares of the phases in a pattern; shares add up to zero, so that two of them are the
  -- complement of the third and all three nothing
  function share_of (shares : current_terms_t; pattern : std_logic_vector(2 downto 0)) return current_term_t;

  function share_of (shares : weights_t; pattern : std_logic_vector(2 downto 0)) return weight_t;

  -- which next position an index chooses for a phase
  function choice_of (index : unsigned(INDEX_WIDTH - 1 downto 0); phase : natural) return unsigned;

  -- next position that a choice stands for
  function next_position (previous : position_t; choice : unsigned(1 downto 0)) return position_t;

  -- weight of the transition to it
  function transition_weight (
    previous : position_t;
    negative : std_logic;
    choice   : unsigned(1 downto 0)
  ) return unsigned;

  -- J_dl in trajectory units as an unsigned number of the same order
  function ranked (excess : trajectory_t) return rank_t;

  -- '1' where a is better than b: feasible first, then cost or excess, then place, then not saturated
  function better (a, b : result_t) return std_logic;

end package mpdcc_math;

package body mpdcc_math is

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

  function opposite_of_c (alpha, beta : signed) return signed is

    variable left  : signed(alpha'length + 1 downto 0);
    variable right : signed(alpha'length + 1 downto 0);

  begin

    -- alpha + beta - alpha/2, where alpha/2 is rounded down: half of alpha, its odd bit once more, beta
    left  := resize(alpha, left'length);
    right := resize(beta, alpha'length + 1) & alpha(alpha'low);
    left  := left + right;
    return left(left'high downto 1);

  end function opposite_of_c;

  function is_in (position : position_t; mask : positions_mask_t) return std_logic is
  begin

    return mask(to_integer(position));

  end function is_in;

  function phase_voltage (node : node_t; phase : natural; position : position_t) return signed is

    variable low     : std_logic;
    variable minus   : std_logic;
    variable charged : std_logic;
    variable left    : signed(FORCED_WIDTH + 1 downto 0);
    variable right   : signed(FORCED_WIDTH + 1 downto 0);

  begin

    -- A position connects the phase to one end of the dc-link or to the neutral point, and no position
    -- subtracts both v_dc/2 and v_ph (asserted where the table is written): one carry serves both signs.
    low     := is_in(position, LINK_NEGATIVE);
    minus   := is_in(position, CAPACITOR_NEGATIVE);
    charged := is_in(position, CAPACITOR_POSITIVE) or minus;
    left    := resize(node.forced_link, FORCED_WIDTH + 1) & '0';
    right   := resize(node.forced_phase(phase), FORCED_WIDTH + 1) & '0';

    for i in left'range loop
      left(i)  := (left(i) xor low) and not is_in(position, NEUTRAL_VOLTAGE);
      right(i) := (right(i) xor minus) and charged;
    end loop;

    if (is_in(position, NEUTRAL_VOLTAGE) = '1') then
      left := resize(node.forced_neutral, FORCED_WIDTH + 1) & '0';
    end if;

    left(0)  := low or minus;
    right(0) := low or minus;
    left     := left + right;
    return left(FORCED_WIDTH + 1 downto 1);

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

  function charge_kind (position : position_t) return unsigned is

    variable result : unsigned(1 downto 0);

  begin

    result(0) := is_in(position, CAPACITOR_CHARGE);
    result(1) := is_in(position, CAPACITOR_DISCHARGE);
    return result;

  end function charge_kind;

  function neutral_pattern (position : positions_t) return std_logic_vector is

    variable result : std_logic_vector(2 downto 0);

  begin

    for x in 0 to 2 loop
      result(x) := is_in(position(x), NEUTRAL_CURRENT);
    end loop;

    return result;

  end function neutral_pattern;

  function single_of (pattern : std_logic_vector(2 downto 0)) return std_logic_vector is

    variable result : std_logic_vector(2 downto 0);

  begin

    result(0) := to_std_logic(pattern = "001" or pattern = "110");
    result(1) := to_std_logic(pattern = "010" or pattern = "101");
    result(2) := to_std_logic(pattern = "100" or pattern = "011");
    return result;

  end function single_of;

  function picked (a, b, c : signed; pattern : std_logic_vector(2 downto 0)) return signed is

    variable chosen : signed(a'length - 1 downto 0);
    variable two    : std_logic;

  begin

    case pattern is

      when "001" | "110" =>

        chosen := a;

      when "010" | "101" =>

        chosen := b;

      when "100" | "011" =>

        chosen := c;

      when others =>

        chosen := (others => '0');

    end case;

    two := to_std_logic(pattern = "110" or pattern = "101" or pattern = "011");

    for i in chosen'range loop
      chosen(i) := chosen(i) xor two;
    end loop;

    return chosen;

  end function picked;

  function share_of (shares : current_terms_t; pattern : std_logic_vector(2 downto 0)) return current_term_t is
  begin

    return picked(shares(0), shares(1), shares(2), pattern);

  end function share_of;

  function share_of (shares : weights_t; pattern : std_logic_vector(2 downto 0)) return weight_t is
  begin

    return picked(shares(0), shares(1), shares(2), pattern);

  end function share_of;

  function choice_of (index : unsigned(INDEX_WIDTH - 1 downto 0); phase : natural) return unsigned is

    variable result : unsigned(1 downto 0);

  begin

    result := index(5 - 2 * phase downto 4 - 2 * phase);
    return result;

  end function choice_of;

  function next_position (previous : position_t; choice : unsigned(1 downto 0)) return position_t is
  begin

    return to_unsigned(NEXT_POSITIONS(to_integer(previous), to_integer(choice)), 3);

  end function next_position;

  function transition_weight (
    previous : position_t;
    negative : std_logic;
    choice   : unsigned(1 downto 0)
  ) return unsigned is

    variable row : unsigned(3 downto 0);

  begin

    row := negative & previous;
    return to_unsigned(TRANSITION_WEIGHTS(to_integer(row), to_integer(choice)), EFFORT_WIDTH);

  end function transition_weight;

  function ranked (excess : trajectory_t) return rank_t is

    variable result : unsigned(TRAJECTORY_WIDTH - 1 downto 0);

  begin

    -- signed order becomes unsigned order with the sign bit inverted
    result                       := unsigned(excess);
    result(TRAJECTORY_WIDTH - 1) := not result(TRAJECTORY_WIDTH - 1);
    return resize(result, RANK_WIDTH);

  end function ranked;

  function better (a, b : result_t) return std_logic is
  begin

    return to_std_logic(unsigned'(not a.feasible & a.rank & a.index & a.saturated)
                        < unsigned'(not b.feasible & b.rank & b.index & b.saturated));

  end function better;

end package body mpdcc_math;
