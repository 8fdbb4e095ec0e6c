-- What a successor of a node is computed from.
--
-- Keeps the words of a node (keep) while successors replace them, and forms what the successor's
-- program of common_terms multiplies. With L1 steps under s1, x one component of the plane:
--
--   secant  d_x = b_x(s1) + c_x * L1                mean slope of the current error
--   error   e_x + d_x * L1                          its parabola at L1
--   slope   S_x + 2 * c_x * L1                      natural slope there; the curvature stays
--   drift   (r_x - d_x) / 2                         half of what the current moves by, r: of the reference
--   charge  slopes of v_ph and v_n under s1         straight lines
--
-- Formats: trajectory units; operands of OPERAND_WIDTH bits, errors and slopes b clipped to BASE_WIDTH.
-- Latency: none from the words and the entry to base, which common_terms samples operand by operand
-- for 16 clocks; one clock from keep.
-- Overflow: a kept error that does not fit BASE_WIDTH is clipped and flagged; the root of a search has
-- none unless it is outside its bound. The secant of a candidate that stays inside fits its word.
-- Tried and dropped: exact rotation of reference, natural slope and curvature: three times the
-- products, and as many decisions differ from the ideal controller's.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_types.all;

entity node_base is
  port (
    clk         : in    std_logic;      -- rising edge
    keep        : in    std_logic;      -- '1': take the node as it is now
    words       : in    words_t;        -- results of common_terms, RESULT_* order
    position    : in    positions_t;    -- s1, stable for 16 clocks
    slope       : in    start_slopes_t; -- slopes of the current errors under s1, likewise
    base        : out   base_words_t;   -- operands A, signed, BASE order
    slope_ahead : out   plane_t;        -- natural slope of the successor, trajectory units per step
    clipped     : out   std_logic       -- '1': a kept error did not fit
  );
end entity node_base;

architecture rtl of node_base is

  subtype operand_t is signed(OPERAND_WIDTH - 1 downto 0);

  type operands_t is array (0 to BASE_COUNT - 1) of operand_t;

  type errors_in_t is array (0 to 5) of base_t;

  subtype current_in_t is signed(CURRENT_TERM_WIDTH - 1 downto 0);

  type currents_t is array (0 to 1) of current_in_t;

  subtype weight_in_t is signed(WEIGHT_SLOPE_WIDTH - 1 downto 0);

  type weight_plane_t is array (0 to 1) of weight_in_t;

  signal error    : errors_in_t; -- alpha, beta, v_n, v_ph_a, v_ph_b, v_ph_c
  signal natural_slope  : plane_t;
  signal phase    : currents_t;
  signal midpoint : currents_t;
  signal weight   : weight_plane_t;
  signal start    : weight_t;

  signal operands : operands_t;

  function term (bus_words : words_t; result : natural) return term_t is
  begin

    return signed(word(bus_words, result, TERM_WIDTH));

  end function term;

begin

  p_keep : process (clk) is

    variable found : std_logic;

  begin

    if rising_edge(clk) then
      if (keep = '1') then
        found := '0';

        for j in 0 to 5 loop
          error(j) <= clip(term(words, RESULT_ERROR_ALPHA + j), BASE_WIDTH);
          found    := found or overflows(term(words, RESULT_ERROR_ALPHA + j), BASE_WIDTH);
        end loop;

        clipped  <= found;

        for x in 0 to 1 loop
          natural_slope(x)  <= term(words, RESULT_SLOPE_ALPHA + x);
          phase(x)    <= resize(term(words, RESULT_PHASE_ALPHA + x), CURRENT_TERM_WIDTH);
          midpoint(x) <= resize(term(words, RESULT_MIDPOINT_ALPHA + x), CURRENT_TERM_WIDTH);
          weight(x)   <= resize(term(words, RESULT_WEIGHT_ALPHA + x), WEIGHT_SLOPE_WIDTH);
        end loop;

        start <= resize(term(words, RESULT_WEIGHT_START), WEIGHT_WIDTH);
      end if;
    end if;

  end process p_keep;

  p_operands : process (words, position, slope, error, natural_slope, phase, midpoint, weight, start) is

    variable v       : operands_t;
    variable step    : term_t;
    variable secant  : signed(OPERAND_WIDTH downto 0);
    variable drift   : signed(OPERAND_WIDTH downto 0);
    variable between : signed(BASE_WIDTH downto 0);
    variable charge  : signed(CURRENT_TERM_WIDTH downto 0);
    variable neutral : current_terms_t;
    variable weights : weights_t;

  begin

    for x in 0 to 1 loop
      step := term(words, RESULT_BEND_STEP_ALPHA + x);

      -- three phases add up to zero: beta is b and half of a
      between := resize(slope(0), BASE_WIDTH + 1);

      if (x = 1) then
        between := resize(slope(1), BASE_WIDTH + 1) + shift_right(slope(0), 1);
      end if;

      secant := resize(step(OPERAND_WIDTH - 1 downto 0), OPERAND_WIDTH + 1) + between;

      v(BASE_BEND_ALPHA + x)   := resize(term(words, RESULT_CURVATURE_ALPHA + x), OPERAND_WIDTH);
      v(BASE_SECANT_ALPHA + x) := clip(secant, OPERAND_WIDTH);

      drift := resize(term(words, RESULT_REFERENCE_SLOPE_ALPHA + x)(OPERAND_WIDTH - 1 downto 0), OPERAND_WIDTH + 1)
               - v(BASE_SECANT_ALPHA + x);

      v(BASE_DRIFT_ALPHA + x)         := drift(OPERAND_WIDTH downto 1);
      v(BASE_BASE_ERROR_ALPHA + x)    := resize(error(x), OPERAND_WIDTH);
      v(BASE_BASE_PHASE_ALPHA + x)    := resize(phase(x), OPERAND_WIDTH);
      v(BASE_BASE_MIDPOINT_ALPHA + x) := resize(midpoint(x), OPERAND_WIDTH);
      v(BASE_BASE_WEIGHT_ALPHA + x)   := resize(weight(x), OPERAND_WIDTH);

      slope_ahead(x) <= natural_slope(x) + shift_left(resize(step(OPERAND_WIDTH - 1 downto 0), TERM_WIDTH), 1);
    end loop;

    v(BASE_BASE_ERROR_NEUTRAL) := resize(error(2), OPERAND_WIDTH);
    v(BASE_BASE_WEIGHT_START)  := start;
    v(BASE_QUARTER_LINK)       := resize(shift_right(term(words, RESULT_FORCED_LINK), 2), OPERAND_WIDTH);

    for x in 0 to 2 loop
      v(BASE_BASE_ERROR_A + x) := resize(error(3 + x), OPERAND_WIDTH);
      v(BASE_AHEAD_A + x)      := term(words, RESULT_ERROR_A + x)(OPERAND_WIDTH - 1 downto 0);

      charge                := adjusted((charge'range => '0'), phase_of(phase(0), phase(1), x),
                                        is_in(position(x), CAPACITOR_DISCHARGE), is_in(position(x), CAPACITOR_CHARGE));
      v(BASE_CHARGE_A + x)  := resize(charge, OPERAND_WIDTH);

      neutral(x) := resize(phase_of(midpoint(0), midpoint(1), x), CURRENT_TERM_WIDTH);
      weights(x) := phase_of(weight(0), weight(1), x);
    end loop;

    v(BASE_NEUTRAL_SLOPE) := resize(share_of(neutral, neutral_pattern(position)), OPERAND_WIDTH);
    v(BASE_WEIGHT_SLOPE)  := share_of(weights, neutral_pattern(position));
    operands              <= v;

  end process p_operands;

  g_base : for i in 0 to BASE_COUNT - 1 generate
    base((i + 1) * OPERAND_WIDTH - 1 downto i * OPERAND_WIDTH) <= std_logic_vector(operands(i));
  end generate g_base;

end architecture rtl;
