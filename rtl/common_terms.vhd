-- Common terms of one decision (Paper A, Section V-A), computed by four multiply-accumulate blocks.
--
-- What is multiplied with what is data: PROGRAM_* in directmpc_constants, written by
-- directmpc/common_terms.py, where the equations stand.
--
-- Formats: operand A 18 bits, operand B 16 bits, products kept whole, sums rounded half up at bit
-- RESULT_SHIFT and saturated to RESULT_WIDTHS.
-- Latency: done PROGRAM_LENGTH + 5 clocks after start, one pulse, with the node registered; one
-- decision at a time.  Inputs must be stable from start to done.
-- Overflow: results saturate and set saturated; with operands above the most negative code none
-- does but weight_slope, and that only far outside any drive's range.
-- Tried and dropped: one product per clock on a single block takes 34 clocks instead of 9.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_types.all;

entity common_terms is
  port (
    clk          : in    std_logic;                                                       -- rising edge
    rst          : in    std_logic;                                                       -- synchronous, active high
    start        : in    std_logic;                                                       -- '1' for one clock: begin
    signals      : in    std_logic_vector(SIGNAL_COUNT * OPERAND_WIDTH - 1 downto 0);          -- operands A, signed, OPERAND_* order
    speeds       : in    std_logic_vector(2 * COEFFICIENT_WIDTH - 1 downto 0);            -- omega_s, omega_r, signed, 1/16000 pu
    coefficients : in    std_logic_vector(COEFFICIENT_COUNT * COEFFICIENT_WIDTH - 1 downto 0); -- operands B, signed, FACTOR_* order
    done         : out   std_logic;                                                       -- '1' for one clock: node is new
    node         : out   node_t;                                                          -- stable until the next done
    saturated    : out   std_logic                                                        -- '1': a result of this node saturated
  );
end entity common_terms;

architecture rtl of common_terms is

  -- controls travel with the block: three stages of the block, then the result register
  constant STAGES : natural := 3;

  type clocks_t is array (0 to STAGES) of natural range 0 to PROGRAM_LENGTH;

  subtype accumulator_t is std_logic_vector(ACCUMULATOR_WIDTH - 1 downto 0);

  type accumulators_t is array (0 to BLOCK_COUNT - 1) of accumulator_t;

  subtype result_t is signed(TERM_WIDTH - 1 downto 0);

  type terms_t is array (0 to RESULT_COUNT - 1) of result_t;

  constant ROUNDING : accumulator_t := (RESULT_SHIFT - 1 => '1', others => '0');

  signal operands     : std_logic_vector(OPERAND_COUNT * OPERAND_WIDTH - 1 downto 0);
  signal factors      : std_logic_vector(FACTOR_COUNT * COEFFICIENT_WIDTH - 1 downto 0);
  signal clock_count  : clocks_t; -- PROGRAM_LENGTH: idle
  signal accumulators : accumulators_t;
  signal terms        : terms_t;
  signal overflow     : std_logic;
  signal last         : std_logic;

begin

  operands(SIGNAL_COUNT * OPERAND_WIDTH - 1 downto 0) <= signals;
  factors                                        <= speeds & coefficients;

  g_products : for i in 0 to PRODUCT_COUNT - 1 generate
    operands((SIGNAL_COUNT + i + 1) * OPERAND_WIDTH - 1 downto (SIGNAL_COUNT + i) * OPERAND_WIDTH) <=
      std_logic_vector(resize(terms(i), OPERAND_WIDTH));
  end generate g_products;

  g_blocks : for block_number in 0 to BLOCK_COUNT - 1 generate

    signal a_inputs   : std_logic_vector(PROGRAM_LENGTH * OPERAND_WIDTH - 1 downto 0);
    signal b_inputs   : std_logic_vector(PROGRAM_LENGTH * COEFFICIENT_WIDTH - 1 downto 0);
    signal step       : std_logic_vector(selector_width(PROGRAM_LENGTH) - 1 downto 0);
    signal alignment  : std_logic_vector(1 downto 0);
    signal accumulate : std_logic;
    signal enable     : std_logic;

  begin

    g_steps : for i in 0 to PROGRAM_LENGTH - 1 generate
      a_inputs((i + 1) * OPERAND_WIDTH - 1 downto i * OPERAND_WIDTH)         <=
        word(operands, PROGRAM_A(block_number, i), OPERAND_WIDTH);
      b_inputs((i + 1) * COEFFICIENT_WIDTH - 1 downto i * COEFFICIENT_WIDTH) <=
        word(factors, PROGRAM_B(block_number, i), COEFFICIENT_WIDTH);
    end generate g_steps;

    step   <= std_logic_vector(to_unsigned(clock_count(0), step'length));
    enable <= to_std_logic(clock_count(0) /= PROGRAM_LENGTH);

    p_controls : process (clock_count(0)) is
    begin

      alignment  <= "00";
      accumulate <= '0';

      for i in 0 to PROGRAM_LENGTH - 1 loop
        if (clock_count(0) = i) then
          alignment  <= std_logic_vector(to_unsigned(PROGRAM_ALIGNMENT(block_number, i), 2));
          accumulate <= to_std_logic(PROGRAM_ACCUMULATE(block_number, i) = 1);
        end if;
      end loop;

    end process p_controls;

    i_mac : entity work.mac_block
      generic map (
        A_WIDTH           => OPERAND_WIDTH,
        B_WIDTH           => COEFFICIENT_WIDTH,
        A_WORDS           => PROGRAM_LENGTH,
        B_WORDS           => PROGRAM_LENGTH,
        ALIGNMENT_STEP    => ALIGNMENT_STEP,
        ACCUMULATOR_WIDTH => ACCUMULATOR_WIDTH
      )
      port map (
        clk         => clk,
        enable      => enable,
        a_inputs    => a_inputs,
        a_select    => step,
        b_inputs    => b_inputs,
        b_select    => step,
        alignment   => alignment,
        accumulate  => accumulate,
        seed        => ROUNDING,
        accumulator => accumulators(block_number)
      );

  end generate g_blocks;

  p_results : process (clk) is

    variable value : signed(ACCUMULATOR_WIDTH - RESULT_SHIFT - 1 downto 0);

  begin

    if rising_edge(clk) then
      if (start = '1') then
        overflow <= '0';
      end if;

      for b in 0 to BLOCK_COUNT - 1 loop
        value := signed(accumulators(b)(ACCUMULATOR_WIDTH - 1 downto RESULT_SHIFT));

        for i in 0 to PROGRAM_LENGTH - 1 loop
          if (PROGRAM_RESULT(b, i) >= 0 and clock_count(STAGES) = i) then
            terms(PROGRAM_RESULT(b, i)) <=
              resize(clip(value, RESULT_WIDTHS(PROGRAM_RESULT(b, i))), TERM_WIDTH);

            if (overflows(value, RESULT_WIDTHS(PROGRAM_RESULT(b, i))) = '1') then
              overflow <= '1';
            end if;
          end if;
        end loop;

      end loop;
    end if;

  end process p_results;

  p_sequence : process (clk) is
  begin

    if rising_edge(clk) then
      clock_count(1 to STAGES) <= clock_count(0 to STAGES - 1);
      last                     <= to_std_logic(clock_count(STAGES) = PROGRAM_LENGTH - 1);
      done                     <= last;

      if (start = '1') then
        clock_count(0) <= 0;
      elsif (clock_count(0) /= PROGRAM_LENGTH) then
        clock_count(0) <= clock_count(0) + 1;
      end if;

      if (rst = '1') then
        clock_count <= (others => PROGRAM_LENGTH);
        last        <= '0';
        done        <= '0';
      end if;
    end if;

  end process p_sequence;

  p_node : process (clk) is
  begin

    if rising_edge(clk) then
      if (last = '1') then
        for x in 0 to 2 loop
          node.error(x)           <= resize(phase_of(terms(RESULT_ERROR_ALPHA),
                                                     terms(RESULT_ERROR_BETA), x), TRAJECTORY_WIDTH);
          node.slope(x)           <= resize(phase_of(terms(RESULT_SLOPE_ALPHA),
                                                     terms(RESULT_SLOPE_BETA), x), TRAJECTORY_WIDTH);
          node.phase_current(x)   <= resize(phase_of(terms(RESULT_PHASE_ALPHA),
                                                     terms(RESULT_PHASE_BETA), x), CURRENT_TERM_WIDTH);
          node.neutral_current(x) <= resize(phase_of(terms(RESULT_MIDPOINT_ALPHA),
                                                     terms(RESULT_MIDPOINT_BETA), x), CURRENT_TERM_WIDTH);
          node.weight_slope(x)    <= resize(phase_of(terms(RESULT_WEIGHT_ALPHA),
                                                     terms(RESULT_WEIGHT_BETA), x), WEIGHT_WIDTH);
        end loop;

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
        saturated            <= overflow;
      end if;
    end if;

  end process p_node;

end architecture rtl;
