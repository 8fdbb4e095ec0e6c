-- Operands from which a successor of a node is computed.
--
-- Keeps the words of a node (keep) while successors replace them, and forms what the successor's
-- program of common_terms multiplies. With L1 steps under s1, x one component of the plane:
--
--   secant   d_x = b_x(s1) + c_x * L1                mean slope of the current error
--   error    e_x + d_x * L1                          its parabola at L1
--   slope    S_x + 2 * c_x * L1                      natural slope there; the curvature stays
--   drift    (r_x - d_x) / 2                         half of what the current moves by, r: of the reference
--   charge   slopes of v_ph and v_n under s1         straight lines; their signs go to L1
--   weight   -sqrt(lambda_n) times error and current terms of v_n there
--
-- Formats: trajectory units; operands of OPERAND_WIDTH bits, errors and slopes b of BASE_WIDTH.
-- Latency: none from the words and what is kept to base, which common_terms samples operand by operand for 16
-- clocks; one clock from the words and the slope to the secant, from position and steps to lengths and to the charge of
-- v_n, and from keep.
-- Overflow: a kept error that does not fit BASE_WIDTH is far outside any bound, so that no candidate of
-- this node has successors; unfit then tells the scheduler that no prediction is possible. Secants fit: how far a
-- candidate can have moved in L1 steps is bounded, with the rule inwards too, and a prediction takes one step with
-- slopes that fit (docs/evidence.md, Ranges).
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.mpdcc_types.all;
  use work.second_level_types.all;

entity node_base is
  port (
    clk         : in    std_logic;        -- rising edge
    keep        : in    std_logic;        -- '1': take the node as it is now
    words       : in    words_t;          -- results of common_terms, RESULT_* order
    position    : in    positions_t;      -- s1, stable for 16 clocks
    steps       : in    length_t;         -- L1, likewise
    slope       : in    start_slopes_t;   -- slopes of the current errors under s1, likewise
    base        : out   base_words_t;     -- operands A, signed, BASE order
    lengths     : out   signed_lengths_t; -- L1, then with the signs of the slopes of v_ph and v_n
    slope_ahead : out   plane_t;          -- natural slope of the successor, trajectory units per step
    unfit       : out   std_logic         -- '1': a kept error does not fit, this node has no successors
  );
end entity node_base;

architecture rtl of node_base is

  subtype operand_t is signed(OPERAND_WIDTH - 1 downto 0);

  type operands_t is array (0 to BASE_COUNT - 1) of operand_t;

  type secants_t is array (0 to 1) of operand_t;

  type errors_in_t is array (0 to 5) of base_t;

  subtype current_in_t is signed(CURRENT_TERM_WIDTH - 2 downto 0);

  type currents_t is array (0 to 1) of current_in_t;

  subtype signed_length_t is signed(LENGTH_WIDTH downto 0);

  signal error         : errors_in_t; -- alpha, beta, v_n, v_ph_a, v_ph_b, v_ph_c
  signal natural_slope : plane_t;
  signal phase         : currents_t;
  signal midpoint      : currents_t;

  signal secant   : secants_t; -- registered, a clock after the bend_step that it is made of
  signal single   : std_logic_vector(2 downto 0); -- term of the neutral point under s1, registered
  signal operands : operands_t;

  function term (bus_words : words_t; result : natural) return term_t is
  begin

    return signed(word(bus_words, result, TERM_WIDTH));

  end function term;

  -- current term of phase a, of phase b, of the opposite of phase c; with a mask of a single '1'
  function current_of (plane : currents_t; which : std_logic_vector(2 downto 0)) return signed is

    variable half  : signed(CURRENT_TERM_WIDTH - 1 downto 0);
    variable start : signed(CURRENT_TERM_WIDTH - 1 downto 0);

  begin

    half  := resize(shift_right(plane(0), 1), CURRENT_TERM_WIDTH);
    start := resize(plane(1), CURRENT_TERM_WIDTH);

    if (which(0) = '1') then
      start := resize(plane(0), CURRENT_TERM_WIDTH);
    end if;

    return adjusted(start, half, which(2), which(1));

  end function current_of;

begin

  p_keep : process (clk) is

    variable found : std_logic;

  begin

    if rising_edge(clk) then
      if (keep = '1') then
        found := '0';

        for j in 0 to 5 loop
          error(j) <= resize(term(words, RESULT_ERROR_ALPHA + j)(BASE_WIDTH - 1 downto 0), BASE_WIDTH);
          found    := found or overflows(term(words, RESULT_ERROR_ALPHA + j), BASE_WIDTH);
        end loop;

        unfit <= found;

        for x in 0 to 1 loop
          natural_slope(x) <= term(words, RESULT_SLOPE_ALPHA + x);
          phase(x)         <= resize(term(words, RESULT_PHASE_ALPHA + x), CURRENT_TERM_WIDTH - 1);
          midpoint(x)      <= resize(term(words, RESULT_MIDPOINT_ALPHA + x), CURRENT_TERM_WIDTH - 1);
        end loop;
      end if;
    end if;

  end process p_keep;

  -- a register between the sums and the operand multiplexers of common_terms
  p_secant : process (clk) is

    variable step    : term_t;
    variable between : operand_t;

  begin

    if rising_edge(clk) then
      for x in 0 to 1 loop
        step := term(words, RESULT_BEND_STEP_ALPHA + x);

        -- three phases add up to zero: beta is b and half of a
        between := resize(slope(0), OPERAND_WIDTH);

        if (x = 1) then
          between := resize(slope(1), OPERAND_WIDTH) + shift_right(slope(0), 1);
        end if;

        secant(x) <= step(OPERAND_WIDTH - 1 downto 0) + between;
      end loop;
    end if;

  end process p_secant;

  p_operands : process (words, single, secant, error, natural_slope, phase, midpoint) is

    variable v       : operands_t;
    variable step    : term_t;
    variable drift   : signed(OPERAND_WIDTH downto 0);
    variable which   : std_logic_vector(2 downto 0);

  begin

    for x in 0 to 1 loop
      step := term(words, RESULT_BEND_STEP_ALPHA + x);

      v(BASE_BEND_ALPHA + x)   := resize(term(words, RESULT_CURVATURE_ALPHA + x), OPERAND_WIDTH);
      v(BASE_SECANT_ALPHA + x) := secant(x);

      drift := resize(term(words, RESULT_REFERENCE_SLOPE_ALPHA + x)(OPERAND_WIDTH - 1 downto 0), OPERAND_WIDTH + 1)
               - secant(x);

      v(BASE_DRIFT_ALPHA + x)          := drift(OPERAND_WIDTH downto 1);
      v(BASE_BASE_ERROR_ALPHA + x)     := resize(error(x), OPERAND_WIDTH);
      v(BASE_BASE_PHASE_ALPHA + x)     := resize(phase(x), OPERAND_WIDTH);
      v(BASE_BASE_MIDPOINT_ALPHA + x)  := resize(midpoint(x), OPERAND_WIDTH);
      v(BASE_MIDPOINT_AHEAD_ALPHA + x) :=
        shift_left(resize(term(words, RESULT_MIDPOINT_ALPHA + x)(CURRENT_TERM_WIDTH - 2 downto 0), OPERAND_WIDTH), 2);

      slope_ahead(x) <= natural_slope(x) + shift_left(resize(step(OPERAND_WIDTH - 1 downto 0), TERM_WIDTH), 1);
    end loop;

    v(BASE_BASE_ERROR_NEUTRAL) := resize(error(2), OPERAND_WIDTH);
    v(BASE_QUARTER_LINK)       := resize(shift_right(term(words, RESULT_FORCED_LINK), 2), OPERAND_WIDTH);

    for x in 0 to 2 loop
      v(BASE_BASE_ERROR_A + x) := resize(error(3 + x), OPERAND_WIDTH);
      v(BASE_AHEAD_A + x)      := term(words, RESULT_ERROR_A + x)(OPERAND_WIDTH - 1 downto 0);

      which                := (others => '0');
      which(x)             := '1';
      v(BASE_CHARGE_A + x) := resize(current_of(phase, which), OPERAND_WIDTH);
    end loop;

    v(BASE_NEUTRAL_SLOPE) := resize(current_of(midpoint, single), OPERAND_WIDTH);
    operands              <= v;

  end process p_operands;

  p_lengths : process (clk) is

    variable value    : signed_length_t;
    variable lowered  : std_logic;
    variable pattern  : std_logic_vector(2 downto 0);
    variable negative : std_logic_vector(SIGNED_LENGTHS - 1 downto 0);
    variable present  : std_logic_vector(SIGNED_LENGTHS - 1 downto 0);

  begin

    if rising_edge(clk) then
      negative(0) := '0';
      present(0)  := '1';

      for x in 0 to 2 loop
        -- what discharges a capacitor raises its error; the operand of phase c is its opposite
        lowered         := is_in(position(x), CAPACITOR_CHARGE);
        present(x + 1)  := lowered or is_in(position(x), CAPACITOR_DISCHARGE);
        negative(x + 1) := lowered xor to_std_logic(x = 2);
      end loop;

      -- one phase on the neutral point, or two: the opposite of the third
      pattern     := neutral_pattern(position);
      single      <= single_of(pattern);
      present(4)  := to_std_logic(pattern /= "000" and pattern /= "111");
      negative(4) := to_std_logic(pattern = "011" or pattern = "101" or pattern = "110") xor single_of(pattern)(2);

      for i in 0 to SIGNED_LENGTHS - 1 loop
        value := adjusted((value'range => '0'), signed('0' & steps), present(i) and not negative(i),
                          present(i) and negative(i));

        lengths((i + 1) * (LENGTH_WIDTH + 1) - 1 downto i * (LENGTH_WIDTH + 1)) <= std_logic_vector(value);
      end loop;
    end if;

  end process p_lengths;

  g_base : for i in 0 to BASE_COUNT - 1 generate
    base((i + 1) * OPERAND_WIDTH - 1 downto i * OPERAND_WIDTH) <= std_logic_vector(operands(i));
  end generate g_base;

end architecture rtl;
