-- Common terms of one decision (Paper A, Section V-A), computed by four multiply-accumulate blocks.
--
-- The list of products is data: PROGRAM_* in directmpc_constants, generated from
-- model/directmpc/mpdcc/program.py, which has the equations.
--
-- Formats: operand A 18 bits (differences of 16-bit words as the scheduler forms them), operand B
-- 16 bits, products kept whole, sums rounded half up at the bit PROGRAM_SHIFT and saturated to
-- RESULT_WIDTHS.
-- Latency: done PROGRAM_LENGTHS + 5 clocks after start, one pulse, with the node registered; one
-- decision at a time.  Inputs must be stable from start to done.
-- Successors (SECOND_LEVEL): after a node, successor.advance runs a second program on the same blocks that
-- takes it on to k + L1 (see node_base and node_queue); initiation interval 16 clocks,
-- progress.advanced 20 clocks later.  Its results replace the words as they come; node.error of the currents
-- and node.slope, which explorers read, change with successor.show_error and show_slope only.
-- Overflow: results saturate and set saturated; with operands above the most negative code none
-- does but weight_slope, and that only far outside any drive's range.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.mpdcc_program.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_types.all;
  use work.second_level_types.all;

entity common_terms is
  generic (
    FOLDED       : boolean := false; -- true: the paper's program, false: the fast variant's
    SECOND_LEVEL : boolean := false  -- true: with the fast variant's program for successors
  );
  port (
    clk          : in    std_logic;        -- rising edge
    rst          : in    std_logic;        -- synchronous, active high
    start        : in    std_logic;        -- '1' for one clock: begin
    operands     : in    root_operands_t;  -- of the root, stable from start to done
    coefficients : in    coefficients_t;   -- signed, FACTOR_* order, likewise
    successor    : in    successor_t;      -- SECOND_LEVEL: which successor of the node is computed
    progress     : out   terms_progress_t; -- how far the node and its successor are
    node         : out   node_t;           -- stable until the next done
    words        : out   words_t;          -- results, alpha and beta
    error_ahead  : out   trajectories_t    -- current errors by the words as they are
  );
end entity common_terms;

architecture rtl of common_terms is

  constant VARIANT : natural := variant_of(FOLDED);

  constant LENGTH_OF_PROGRAM : natural := PROGRAM_LENGTHS(VARIANT);

  -- whether successors are computed
  constant ADVANCES : boolean := SECOND_LEVEL and not FOLDED;

  -- whether the curvature is of use before the rest of the node
  constant EARLY : boolean := curves_early and not SECOND_LEVEL and not FOLDED;

  constant LAST_STEP : natural := choose(ADVANCES, PROGRAM_STEPS, LENGTH_OF_PROGRAM); -- of all programs that are run

  constant LENGTH_AT : natural := COEFFICIENT_COUNT + 2; -- place of the first length among the factors

  subtype accumulator_t is std_logic_vector(ACCUMULATOR_WIDTH - 1 downto 0);

  type accumulators_t is array (0 to BLOCK_COUNT - 1) of accumulator_t;

  subtype result_t is signed(TERM_WIDTH - 1 downto 0);

  type wide_curvatures_t is array (0 to 2) of signed(CURVATURE_TERM_WIDTH downto 0);

  type terms_t is array (0 to RESULT_COUNT - 1) of result_t;

  -- row of the tables that depend on what is run
  constant RUN : natural := choose(ADVANCES, 2, VARIANT);

  -- whether a program computes a result at all
  function computed (result : natural) return boolean is
  begin

    for b in 0 to BLOCK_COUNT - 1 loop
      for i in 0 to LAST_STEP - 1 loop
        if (PROGRAM_RESULT(VARIANT, b, i) = result) then
          return true;
        end if;
      end loop;
    end loop;

    return false;

  end function computed;

  signal a_words      : std_logic_vector(OPERAND_COUNT * OPERAND_WIDTH - 1 downto 0);
  signal factors      : std_logic_vector(FACTOR_COUNT * COEFFICIENT_WIDTH - 1 downto 0);
  signal step         : std_logic_vector(0 to LAST_STEP - 1); -- '1': is issued
  signal complete     : std_logic_vector(0 to LAST_STEP - 1); -- '1': its sum is in the accumulator
  signal root         : std_logic_vector(0 to LENGTH_OF_PROGRAM - 1 + MAC_STAGES);
  signal ahead        : std_logic_vector(LENGTH_OF_PROGRAM to LAST_STEP - 1 + MAC_STAGES);
  signal begins_ahead : std_logic;                            -- '1': the successor's first sum is complete
  signal slopes_ahead : std_logic;                            -- '1': its natural slope is due
  signal accumulators : accumulators_t;
  signal kept         : terms_t;                              -- registers; some serve two results in turn
  signal terms        : terms_t;                              -- results, from their registers
  signal curvature    : wide_curvatures_t;
  signal bend         : curvatures_t;
  signal error_at     : trajectories_t;                       -- of the phases, by the terms as they are
  signal slope_at     : trajectories_t;
  signal error        : trajectories_t;                       -- the same, of the node
  signal slope        : trajectories_t;
  signal overflow     : std_logic;
  signal last         : std_logic;
  signal ended        : std_logic;
  signal done         : std_logic;
  signal saturated    : std_logic;
  signal overflowed   : std_logic;
  signal show_third   : std_logic;

  -- the fast variant takes the opposite of phase c, so that three errors add up to zero exactly
  function current_of (alpha, beta : signed; phase : natural) return signed is
  begin

    if (phase = 2 and not FOLDED) then
      return opposite_of_c(alpha, beta);
    else
      return phase_of(alpha, beta, phase);
    end if;

  end function current_of;

begin

  assert not (FOLDED and SECOND_LEVEL)
    report "common_terms: the paper's program has no successors, SECOND_LEVEL needs FOLDED = false"
    severity failure;

  a_words(SIGNAL_COUNT * OPERAND_WIDTH - 1 downto 0) <= operands.signals;
  a_words(OPERAND_COUNT * OPERAND_WIDTH - 1 downto (SIGNAL_COUNT + PRODUCT_COUNT) * OPERAND_WIDTH) <= successor.base;

  g_coefficients : for i in 0 to COEFFICIENT_COUNT - 1 generate
    factors((i + 1) * COEFFICIENT_WIDTH - 1 downto i * COEFFICIENT_WIDTH) <= coefficients(i);
  end generate g_coefficients;

  factors(LENGTH_AT * COEFFICIENT_WIDTH - 1 downto COEFFICIENT_COUNT * COEFFICIENT_WIDTH) <= operands.speeds;

  -- 128 * L1 and its signed forms, and the powers of two that put a word where the products of its sum are
  g_lengths : for i in 0 to SIGNED_LENGTHS - 1 generate
    factors((LENGTH_AT + i + 1) * COEFFICIENT_WIDTH - 1 downto (LENGTH_AT + i) * COEFFICIENT_WIDTH) <=
      std_logic_vector(shift_left(resize(signed(word(successor.lengths, i, LENGTH_WIDTH + 1)), COEFFICIENT_WIDTH), 7));
  end generate g_lengths;

  factors(FACTOR_COUNT * COEFFICIENT_WIDTH - 1 downto (FACTOR_COUNT - 3) * COEFFICIENT_WIDTH) <=
    x"4000" & x"2000" & x"0080";

  g_products : for i in 0 to PRODUCT_COUNT - 1 generate
    a_words((SIGNAL_COUNT + i + 1) * OPERAND_WIDTH - 1 downto (SIGNAL_COUNT + i) * OPERAND_WIDTH) <=
      std_logic_vector(resize(terms(i), OPERAND_WIDTH));
  end generate g_products;

  g_blocks : for block_number in 0 to BLOCK_COUNT - 1 generate

    signal a_word     : std_logic_vector(OPERAND_WIDTH - 1 downto 0);
    signal b_word     : std_logic_vector(COEFFICIENT_WIDTH - 1 downto 0);
    signal alignment  : std_logic_vector(1 downto 0);
    signal accumulate : std_logic;
    signal rounding   : accumulator_t; -- half an LSB of the result
    signal sum        : std_logic_vector(ACCUMULATOR_WIDTHS(RUN, block_number) - 1 downto 0);

  begin

    p_words : process (a_words, factors, step) is

      variable a_steps : std_logic; -- a step that takes this word
      variable b_steps : std_logic;
      variable a_now   : std_logic_vector(OPERAND_WIDTH - 1 downto 0);
      variable b_now   : std_logic_vector(COEFFICIENT_WIDTH - 1 downto 0);

    begin

      a_now := (others => '0');
      b_now := (others => '0');

      for w in 0 to LAST_STEP - 1 loop
        a_steps := '0';
        b_steps := '0';

        for i in 0 to LAST_STEP - 1 loop
          if (PROGRAM_SELECT_A(VARIANT, block_number, i) = w) then
            a_steps := a_steps or step(i);
          end if;

          if (PROGRAM_SELECT_B(VARIANT, block_number, i) = w) then
            b_steps := b_steps or step(i);
          end if;
        end loop;

        if (a_steps = '1' and PROGRAM_WORDS_A(VARIANT, block_number, w) >= 0) then
          a_now := a_now or word(a_words, maximum_of(PROGRAM_WORDS_A(VARIANT, block_number, w), 0), OPERAND_WIDTH);
        end if;

        if (b_steps = '1' and PROGRAM_WORDS_B(VARIANT, block_number, w) >= 0) then
          b_now := b_now or word(factors, maximum_of(PROGRAM_WORDS_B(VARIANT, block_number, w), 0), COEFFICIENT_WIDTH);
        end if;
      end loop;

      a_word <= a_now;
      b_word <= b_now;

    end process p_words;

    p_controls : process (step) is

      variable shift : std_logic_vector(1 downto 0);

    begin

      shift      := "00";
      accumulate <= '0';
      rounding   <= (others => '0');

      for i in 0 to LAST_STEP - 1 loop
        if (step(i) = '1' and PROGRAM_SELECT_A(VARIANT, block_number, i) >= 0) then
          shift := shift or std_logic_vector(to_unsigned(PROGRAM_ALIGNMENT(VARIANT, block_number, i), 2));

          if (PROGRAM_ACCUMULATE(VARIANT, block_number, i) = 1) then
            accumulate <= '1';
          else
            rounding(PROGRAM_SHIFT(VARIANT, block_number, i) - 1) <= '1';
          end if;
        end if;
      end loop;

      alignment <= shift;

    end process p_controls;

    -- one word is chosen; in idle clocks the block multiplies 0 by 0
    i_mac : entity work.mac_block
      generic map (
        A_WIDTH           => OPERAND_WIDTH,
        B_WIDTH           => COEFFICIENT_WIDTH,
        A_WORDS           => 1,
        B_WORDS           => 1,
        ALIGNMENT_STEP    => ALIGNMENT_STEP,
        ACCUMULATOR_WIDTH => ACCUMULATOR_WIDTHS(RUN, block_number)
      )
      port map (
        clk         => clk,
        enable      => '1',
        a_inputs    => a_word,
        a_select    => "0",
        b_inputs    => b_word,
        b_select    => "0",
        alignment   => alignment,
        accumulate  => accumulate,
        seed        => rounding(sum'range),
        accumulator => sum
      );

    accumulators(block_number) <= std_logic_vector(resize(signed(sum), ACCUMULATOR_WIDTH));

  end generate g_blocks;

  p_results : process (clk) is

    variable value   : signed(ACCUMULATOR_WIDTH - 1 downto 0);
    variable result  : natural;
    variable exceeds : std_logic;

  begin

    if rising_edge(clk) then
      if (start = '1' or begins_ahead = '1') then
        overflow <= '0';
      end if;

      for b in 0 to BLOCK_COUNT - 1 loop
        for i in 0 to LAST_STEP - 1 loop
          if (PROGRAM_RESULT(VARIANT, b, i) >= 0 and complete(i) = '1') then
            result := maximum_of(PROGRAM_RESULT(VARIANT, b, i), 0);
            value  := resize(shift_right(signed(accumulators(b)), PROGRAM_SHIFT(VARIANT, b, i)), value'length);

            -- most results cannot exceed their words and need no logic for it
            if (RESULT_SATURATES(VARIANT, result) = 1) then
              exceeds := overflows(value, RESULT_WIDTHS(result));

              kept(RESULT_PLACES(RUN, result)) <= resize(clip(value, RESULT_WIDTHS(result)), TERM_WIDTH);

              if (exceeds = '1') then
                overflow <= '1';
              end if;
            else
              kept(RESULT_PLACES(RUN, result)) <= value(TERM_WIDTH - 1 downto 0);
            end if;
          end if;
        end loop;
      end loop;

      if (slopes_ahead = '1') then
        kept(RESULT_PLACES(RUN, RESULT_SLOPE_ALPHA)) <= successor.slope(0);
        kept(RESULT_PLACES(RUN, RESULT_SLOPE_BETA))  <= successor.slope(1);
      end if;
    end if;

  end process p_results;

  g_terms : for i in 0 to RESULT_COUNT - 1 generate

    g_computed : if computed(i) generate
      terms(i) <= resize(kept(RESULT_PLACES(RUN, i))(RESULT_WIDTHS(i) - 1 downto 0), TERM_WIDTH);
    end generate g_computed;

    g_none : if not computed(i) generate
      terms(i) <= (others => '0');
    end generate g_none;

  end generate g_terms;

  g_results : for i in 0 to RESULT_COUNT - 1 generate
    words((i + 1) * TERM_WIDTH - 1 downto i * TERM_WIDTH) <= std_logic_vector(terms(i));
  end generate g_results;

  g_at : for x in 0 to 2 generate
    error_at(x) <= resize(current_of(terms(RESULT_ERROR_ALPHA), terms(RESULT_ERROR_BETA), x), TRAJECTORY_WIDTH);
    slope_at(x) <= resize(current_of(terms(RESULT_SLOPE_ALPHA), terms(RESULT_SLOPE_BETA), x), TRAJECTORY_WIDTH);
  end generate g_at;

  error_ahead <= error_at;

  progress.issued     <= step(LENGTH_OF_PROGRAM - 1);
  progress.capacitors <= complete(CAPACITOR_STEP);
  progress.done       <= done;
  progress.saturated  <= saturated;
  progress.advanced   <= ended;
  progress.overflowed <= overflowed;

  -- '1' where a program is, a bit for each step and three for those still in the blocks: what is
  -- encoded would have to be decoded before every operand and every result
  g_root : for i in 0 to LENGTH_OF_PROGRAM - 1 generate
    step(i)     <= root(i);
    complete(i) <= root(i + MAC_STAGES);
  end generate g_root;

  g_successor : if ADVANCES generate
    begins_ahead <= complete(SUCCESSOR_FIRST);
    slopes_ahead <= complete(SLOPE_STEP);
  end generate g_successor;

  g_alone : if not ADVANCES generate
    begins_ahead <= '0';
    slopes_ahead <= '0';
  end generate g_alone;

  g_ahead : for i in LENGTH_OF_PROGRAM to LAST_STEP - 1 generate
    step(i)     <= ahead(i);
    complete(i) <= ahead(i + MAC_STAGES);
  end generate g_ahead;

  p_sequence : process (clk) is
  begin

    if rising_edge(clk) then
      root  <= start & root(0 to root'high - 1);
      ahead <= (successor.advance and to_std_logic(ADVANCES)) & ahead(ahead'low to ahead'high - 1);
      last  <= complete(LENGTH_OF_PROGRAM - 1);
      done  <= last;
      ended <= complete(LAST_STEP - 1);

      if (ended = '1') then
        overflowed <= overflow;
      end if;

      if (rst = '1') then
        root  <= (others => '0');
        ahead <= (others => '0');
        last  <= '0';
        ended <= '0';
        done  <= '0';
      end if;
    end if;

  end process p_sequence;

  -- the terms stay until the next decision, so most of the node is wires
  g_phases : for x in 0 to 2 generate
    -- what needs no sum is the term itself, unless successors replace it while explorers read it
    node.error(x)           <= error_at(x) when x = 0 and not ADVANCES else
                               error(x);
    node.slope(x)           <= slope_at(x) when x = 0 and not ADVANCES else
                               slope(x);
    node.phase_current(x)   <= resize(phase_of(terms(RESULT_PHASE_ALPHA)(CURRENT_TERM_WIDTH - 1 downto 0),
                                               terms(RESULT_PHASE_BETA)(CURRENT_TERM_WIDTH - 1 downto 0), x),
                                      CURRENT_TERM_WIDTH);
    node.neutral_current(x) <= resize(phase_of(terms(RESULT_MIDPOINT_ALPHA)(CURRENT_TERM_WIDTH - 1 downto 0),
                                               terms(RESULT_MIDPOINT_BETA)(CURRENT_TERM_WIDTH - 1 downto 0), x),
                                      CURRENT_TERM_WIDTH);
    node.weight_slope(x)    <= phase_of(terms(RESULT_WEIGHT_ALPHA)(WEIGHT_SLOPE_WIDTH - 1 downto 0),
                                        terms(RESULT_WEIGHT_BETA)(WEIGHT_SLOPE_WIDTH - 1 downto 0), x);
    node.curvature(x)       <= bend(x);
    curvature(x)            <= current_of(terms(RESULT_CURVATURE_ALPHA)(CURVATURE_TERM_WIDTH - 1 downto 0),
                                          terms(RESULT_CURVATURE_BETA)(CURVATURE_TERM_WIDTH - 1 downto 0), x);
  end generate g_phases;

  node.error(3)        <= resize(terms(RESULT_ERROR_NEUTRAL), TRAJECTORY_WIDTH);
  node.error(4)        <= resize(terms(RESULT_ERROR_A), TRAJECTORY_WIDTH);
  node.error(5)        <= resize(terms(RESULT_ERROR_B), TRAJECTORY_WIDTH);
  node.error(6)        <= resize(terms(RESULT_ERROR_C), TRAJECTORY_WIDTH);
  node.forced_link     <= resize(terms(RESULT_FORCED_LINK), FORCED_WIDTH);
  node.forced_neutral  <= resize(terms(RESULT_FORCED_NEUTRAL), FORCED_WIDTH);
  node.forced_phase(0) <= resize(terms(RESULT_FORCED_A), FORCED_WIDTH);
  node.forced_phase(1) <= resize(terms(RESULT_FORCED_B), FORCED_WIDTH);
  node.forced_phase(2) <= resize(terms(RESULT_FORCED_C), FORCED_WIDTH);
  node.weight_start    <= resize(terms(RESULT_WEIGHT_START), WEIGHT_WIDTH);

  p_node : process (clk) is
  begin

    if rising_edge(clk) then
      show_third <= successor.show_error;

      -- explorers look at the third one a clock later
      for x in 0 to 2 loop
        if (last = '1' or (x < 2 and successor.show_error = '1') or (x = 2 and show_third = '1')) then
          error(x) <= error_at(x);
        end if;
      end loop;

      if (last = '1' or successor.show_slope = '1') then
        slope <= slope_at;
      end if;

      if (last = '1') then
        for x in 0 to 2 loop
          bend(x) <= clip(curvature(x), CURVATURE_WIDTH);
        end loop;

        saturated <= overflow;

        if (not FOLDED and (overflows(curvature(0), CURVATURE_WIDTH) = '1'
                            or overflows(curvature(1), CURVATURE_WIDTH) = '1'
                            or overflows(curvature(2), CURVATURE_WIDTH) = '1')) then
          saturated <= '1';
        end if;
      end if;

      if (EARLY) then
        for x in 0 to 2 loop
          bend(x) <= clip(curvature(x), CURVATURE_WIDTH);
        end loop;
      end if;
    end if;

  end process p_node;

end architecture rtl;
