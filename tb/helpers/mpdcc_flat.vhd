-- Records of mpdcc_types as vectors and back, for benches whose language knows no records.
--
-- Fields stand in the order of the records, the first one rightmost; arrays likewise.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.anpc5l_leg.all;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;

package mpdcc_flat is

  constant NODE_BITS      : natural := (OUTPUTS + 3) * TRAJECTORY_WIDTH + 5 * FORCED_WIDTH
                                       + 6 * CURRENT_TERM_WIDTH + 4 * WEIGHT_WIDTH + 3 * CURVATURE_WIDTH;
  constant BAND_BITS      : natural := 2 * TRAJECTORY_WIDTH + 6 * (MARGIN_WIDTH + 1) + 3 * TURN_WIDTH + 15
                                       + 3 * BOUND_WIDTH;
  constant CAPACITOR_BITS : natural := 6 + LENGTH_WIDTH + TRAJECTORY_WIDTH;
  constant LIMITS_BITS    : natural := 3 * BOUND_WIDTH + LENGTH_WIDTH + 4;
  constant CANDIDATE_BITS : natural := 1 + INDEX_WIDTH + 9 + EFFORT_WIDTH;
  constant RESULT_BITS    : natural := 2 + INDEX_WIDTH + LENGTH_WIDTH + RANK_WIDTH;
  constant DECISION_BITS  : natural := 9 + 2 + LENGTH_WIDTH + 2;

  function to_vector (value : node_t) return std_logic_vector;

  function to_vector (value : band_t) return std_logic_vector;

  function to_vector (value : capacitor_t) return std_logic_vector;

  function to_vector (value : candidate_t) return std_logic_vector;

  function to_vector (value : result_t) return std_logic_vector;

  function to_vector (value : decision_t) return std_logic_vector;

  function to_positions (value : std_logic_vector) return positions_t;

  function to_node (value : std_logic_vector) return node_t;

  function to_band (value : std_logic_vector) return band_t;

  function to_capacitor (value : std_logic_vector) return capacitor_t;

  function to_limits (value : std_logic_vector) return limits_t;

  function to_candidate (value : std_logic_vector) return candidate_t;

  function to_result (value : std_logic_vector) return result_t;

  function to_measurement (value : std_logic_vector) return measurement_t;

  function to_coefficients (value : std_logic_vector) return coefficients_t;

end package mpdcc_flat;

package body mpdcc_flat is

  function to_vector (value : node_t) return std_logic_vector is

    variable errors   : std_logic_vector(OUTPUTS * TRAJECTORY_WIDTH - 1 downto 0);
    variable slopes   : std_logic_vector(3 * TRAJECTORY_WIDTH - 1 downto 0);
    variable forced   : std_logic_vector(5 * FORCED_WIDTH - 1 downto 0);
    variable currents : std_logic_vector(6 * CURRENT_TERM_WIDTH - 1 downto 0);
    variable weights  : std_logic_vector(4 * WEIGHT_WIDTH - 1 downto 0);
    variable bends    : std_logic_vector(3 * CURVATURE_WIDTH - 1 downto 0);

  begin

    for i in 0 to OUTPUTS - 1 loop
      errors((i + 1) * TRAJECTORY_WIDTH - 1 downto i * TRAJECTORY_WIDTH) := std_logic_vector(value.error(i));
    end loop;

    forced(FORCED_WIDTH - 1 downto 0)                := std_logic_vector(value.forced_link);
    forced(2 * FORCED_WIDTH - 1 downto FORCED_WIDTH) := std_logic_vector(value.forced_neutral);
    weights(WEIGHT_WIDTH - 1 downto 0)               := std_logic_vector(value.weight_start);

    for i in 0 to 2 loop
      slopes((i + 1) * TRAJECTORY_WIDTH - 1 downto i * TRAJECTORY_WIDTH)           := std_logic_vector(value.slope(i));
      forced((i + 3) * FORCED_WIDTH - 1 downto (i + 2) * FORCED_WIDTH)             :=
        std_logic_vector(value.forced_phase(i));
      currents((i + 1) * CURRENT_TERM_WIDTH - 1 downto i * CURRENT_TERM_WIDTH)       :=
        std_logic_vector(value.phase_current(i));
      currents((i + 4) * CURRENT_TERM_WIDTH - 1 downto (i + 3) * CURRENT_TERM_WIDTH) :=
        std_logic_vector(value.neutral_current(i));
      weights((i + 2) * WEIGHT_WIDTH - 1 downto (i + 1) * WEIGHT_WIDTH)            :=
        std_logic_vector(value.weight_slope(i));
      bends((i + 1) * CURVATURE_WIDTH - 1 downto i * CURVATURE_WIDTH)              :=
        std_logic_vector(value.curvature(i));
    end loop;

    return bends & weights & currents & forced & slopes & errors;

  end function to_vector;

  function to_vector (value : positions_t) return std_logic_vector is
  begin

    return std_logic_vector(value(2)) & std_logic_vector(value(1)) & std_logic_vector(value(0));

  end function to_vector;

  function to_vector (value : band_t) return std_logic_vector is

    variable firsts : std_logic_vector(2 * TRAJECTORY_WIDTH - 1 downto 0);
    variable ups    : std_logic_vector(3 * margin_t'length - 1 downto 0);
    variable downs  : std_logic_vector(3 * margin_t'length - 1 downto 0);
    variable limits : std_logic_vector(3 * BOUND_WIDTH - 1 downto 0);
    variable turns  : std_logic_vector(3 * TURN_WIDTH - 1 downto 0);

  begin

    for i in 0 to 1 loop
      firsts((i + 1) * TRAJECTORY_WIDTH - 1 downto i * TRAJECTORY_WIDTH) := std_logic_vector(value.first(i));
    end loop;

    for i in 0 to 2 loop
      ups((i + 1) * margin_t'length - 1 downto i * margin_t'length)      := std_logic_vector(value.margin_up(i));
      downs((i + 1) * margin_t'length - 1 downto i * margin_t'length)    := std_logic_vector(value.margin_down(i));
      limits((i + 1) * BOUND_WIDTH - 1 downto i * BOUND_WIDTH)           := std_logic_vector(value.limit(i));
      turns((i + 1) * TURN_WIDTH - 1 downto i * TURN_WIDTH)              := std_logic_vector(value.turn(i));
    end loop;

    return limits & value.negative & to_vector(value.previous) & turns & value.outside & downs & ups & firsts;

  end function to_vector;

  function to_vector (value : capacitor_t) return std_logic_vector is
  begin

    return std_logic_vector(value.excess) & std_logic_vector(value.length) & std_logic_vector(value.row) & value.write;

  end function to_vector;

  function to_vector (value : candidate_t) return std_logic_vector is
  begin

    return std_logic_vector(value.effort) & to_vector(value.position) & std_logic_vector(value.index) & value.probe;

  end function to_vector;

  function to_vector (value : result_t) return std_logic_vector is
  begin

    return std_logic_vector(value.rank) & std_logic_vector(value.length) & std_logic_vector(value.index)
           & value.saturated & value.feasible;

  end function to_vector;

  function to_vector (value : decision_t) return std_logic_vector is
  begin

    return value.exhausted & value.saturated & std_logic_vector(value.length) & value.deadlock & value.held
           & to_vector(value.position);

  end function to_vector;

  function to_positions (value : std_logic_vector) return positions_t is

    variable bits   : std_logic_vector(8 downto 0);
    variable result : positions_t;

  begin

    bits := value;

    for i in 0 to 2 loop
      result(i) := unsigned(bits(3 * i + 2 downto 3 * i));
    end loop;

    return result;

  end function to_positions;

  function to_node (value : std_logic_vector) return node_t is

    variable bits   : std_logic_vector(NODE_BITS - 1 downto 0);
    variable used   : natural;
    variable result : node_t;

    procedure take (target : out signed) is
    begin

      target := signed(bits(used + target'length - 1 downto used));
      used   := used + target'length;

    end procedure take;

  begin

    bits := value;
    used := 0;

    for i in 0 to OUTPUTS - 1 loop
      take(result.error(i));
    end loop;

    for i in 0 to 2 loop
      take(result.slope(i));
    end loop;

    take(result.forced_link);
    take(result.forced_neutral);

    for i in 0 to 2 loop
      take(result.forced_phase(i));
    end loop;

    for i in 0 to 2 loop
      take(result.phase_current(i));
    end loop;

    for i in 0 to 2 loop
      take(result.neutral_current(i));
    end loop;

    take(result.weight_start);

    for i in 0 to 2 loop
      take(result.weight_slope(i));
    end loop;

    for i in 0 to 2 loop
      take(result.curvature(i));
    end loop;

    return result;

  end function to_node;

  function to_band (value : std_logic_vector) return band_t is

    variable bits   : std_logic_vector(BAND_BITS - 1 downto 0);
    variable used   : natural;
    variable result : band_t;

    procedure take (target : out signed) is
    begin

      target := signed(bits(used + target'length - 1 downto used));
      used   := used + target'length;

    end procedure take;

  begin

    bits := value;
    used := 0;

    for i in 0 to 1 loop
      take(result.first(i));
    end loop;

    for i in 0 to 2 loop
      take(result.margin_up(i));
    end loop;

    for i in 0 to 2 loop
      take(result.margin_down(i));
    end loop;

    result.outside := bits(used + 2 downto used);
    used           := used + 3;

    for i in 0 to 2 loop
      take(result.turn(i));
    end loop;

    result.previous := to_positions(bits(used + 8 downto used));
    result.negative := bits(used + 11 downto used + 9);
    used            := used + 12;

    for i in 0 to 2 loop
      result.limit(i) := unsigned(bits(used + BOUND_WIDTH - 1 downto used));
      used            := used + BOUND_WIDTH;
    end loop;

    return result;

  end function to_band;

  function to_capacitor (value : std_logic_vector) return capacitor_t is

    variable bits   : std_logic_vector(CAPACITOR_BITS - 1 downto 0);
    variable result : capacitor_t;

  begin

    bits             := value;
    result.write     := bits(0);
    result.row       := unsigned(bits(5 downto 1));
    result.length    := unsigned(bits(5 + LENGTH_WIDTH downto 6));
    result.excess    := signed(bits(CAPACITOR_BITS - 1 downto 6 + LENGTH_WIDTH));
    result.bank      := '0';
    result.is_inside := '0';
    return result;

  end function to_capacitor;

  function to_limits (value : std_logic_vector) return limits_t is

    variable bits   : std_logic_vector(LIMITS_BITS - 1 downto 0);
    variable result : limits_t;

  begin

    bits                 := value;
    result.bound_current := unsigned(bits(BOUND_WIDTH - 1 downto 0));
    result.bound_neutral := unsigned(bits(2 * BOUND_WIDTH - 1 downto BOUND_WIDTH));
    result.bound_phase   := unsigned(bits(3 * BOUND_WIDTH - 1 downto 2 * BOUND_WIDTH));
    result.horizon       := unsigned(bits(LIMITS_BITS - 5 downto 3 * BOUND_WIDTH));
    result.weight_scale  := unsigned(bits(LIMITS_BITS - 3 downto LIMITS_BITS - 4));
    result.deadlock_rule := bits(LIMITS_BITS - 2);
    result.outside_inwards := bits(LIMITS_BITS - 1);
    return result;

  end function to_limits;

  function to_candidate (value : std_logic_vector) return candidate_t is

    variable bits   : std_logic_vector(CANDIDATE_BITS - 1 downto 0);
    variable result : candidate_t;

  begin

    bits            := value;
    result.probe    := bits(0);
    result.index    := unsigned(bits(INDEX_WIDTH downto 1));
    result.position := to_positions(bits(INDEX_WIDTH + 9 downto INDEX_WIDTH + 1));
    result.effort   := unsigned(bits(CANDIDATE_BITS - 1 downto INDEX_WIDTH + 10));
    return result;

  end function to_candidate;

  function to_result (value : std_logic_vector) return result_t is

    constant LENGTH_AT : natural := INDEX_WIDTH + 2;
    constant RANK_AT   : natural := LENGTH_AT + LENGTH_WIDTH;

    variable bits   : std_logic_vector(RESULT_BITS - 1 downto 0);
    variable result : result_t;

  begin

    bits             := value;
    result.feasible  := bits(0);
    result.saturated := bits(1);
    result.index     := unsigned(bits(LENGTH_AT - 1 downto 2));
    result.length    := unsigned(bits(RANK_AT - 1 downto LENGTH_AT));
    result.rank      := unsigned(bits(RESULT_BITS - 1 downto RANK_AT));
    return result;

  end function to_result;

  function to_measurement (value : std_logic_vector) return measurement_t is

    variable bits   : std_logic_vector(207 downto 0);
    variable result : measurement_t;

  begin

    bits              := value;
    result.is_alpha   := signed(bits(15 downto 0));
    result.is_beta    := signed(bits(31 downto 16));
    result.psir_alpha := signed(bits(47 downto 32));
    result.psir_beta  := signed(bits(63 downto 48));
    result.v_n        := signed(bits(79 downto 64));
    result.v_ph_a     := unsigned(bits(95 downto 80));
    result.v_ph_b     := unsigned(bits(111 downto 96));
    result.v_ph_c     := unsigned(bits(127 downto 112));
    result.v_dc       := unsigned(bits(143 downto 128));
    result.iref_alpha := signed(bits(159 downto 144));
    result.iref_beta  := signed(bits(175 downto 160));
    result.omega_s    := signed(bits(191 downto 176));
    result.omega_r    := signed(bits(207 downto 192));
    return result;

  end function to_measurement;

  function to_coefficients (value : std_logic_vector) return coefficients_t is

    variable bits   : std_logic_vector(COEFFICIENT_COUNT * COEFFICIENT_WIDTH - 1 downto 0);
    variable result : coefficients_t;

  begin

    bits := value;

    for i in coefficients_t'range loop
      result(i) := bits((i + 1) * COEFFICIENT_WIDTH - 1 downto i * COEFFICIENT_WIDTH);
    end loop;

    return result;

  end function to_coefficients;

end package body mpdcc_flat;
