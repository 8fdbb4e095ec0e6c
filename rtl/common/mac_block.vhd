-- Three-stage multiply-accumulate block (Paper A, Fig. 3).
--
--   stage 1  operand multiplexers, registers a_1 and b_1
--   stage 2  multiplier, register product_2
--   stage 3  adder: accumulator_3 <= (accumulate ? accumulator_3 : seed) + product_2 * 2**(align)
--
-- Formats: operands two's complement; the accumulator is wide enough for the caller's longest sum,
-- the block itself never rounds or saturates.  A rounding constant is added by seeding with it.
-- Latency: three clocks from the controls to accumulator; initiation interval one clock.  All
-- controls are given together with the operands, the block delays what later stages need.  Without
-- enable nothing moves: the accumulator keeps the last sum.
-- Overflow: none as long as ACCUMULATOR_WIDTH >= A_WIDTH + B_WIDTH + alignment + log2(terms); the
-- part that does not depend on the caller is asserted.
-- Differs from the paper: its adder is 16 bits wide.  Sums here are kept whole and rounded once,
-- which costs 24 LUTs a block and removes one rounding error per product.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;

entity mac_block is
  generic (
    A_WIDTH           : positive := 16; -- bits of operand A, 18 at most for one multiplier
    B_WIDTH           : positive := 16; -- bits of operand B, 18 at most for one multiplier
    A_WORDS           : positive := 4;  -- words on the operand A multiplexer
    B_WORDS           : positive := 4;  -- words on the operand B multiplexer
    ALIGNMENT_STEP    : natural  := 3;  -- bits of left shift per alignment step
    ACCUMULATOR_WIDTH : positive := 43  -- bits of seed and accumulator
  );
  port (
    clk         : in    std_logic;                                                      -- rising edge
    enable      : in    std_logic; -- '1': operands are given in this clock
    a_inputs    : in    std_logic_vector(A_WORDS * A_WIDTH - 1 downto 0); -- signed words, word 0 rightmost
    a_select    : in    std_logic_vector(selector_width(A_WORDS) - 1 downto 0);        -- word for operand A
    b_inputs    : in    std_logic_vector(B_WORDS * B_WIDTH - 1 downto 0); -- signed words, word 0 rightmost
    b_select    : in    std_logic_vector(selector_width(B_WORDS) - 1 downto 0);        -- word for operand B
    alignment   : in    std_logic_vector(1 downto 0); -- left shift of the product, 0 to 2 steps
    accumulate  : in    std_logic; -- '1': add to the sum, '0': to the seed
    seed        : in    std_logic_vector(ACCUMULATOR_WIDTH - 1 downto 0);               -- signed, first summand
    accumulator : out   std_logic_vector(ACCUMULATOR_WIDTH - 1 downto 0)                -- signed, three clocks later
  );
end entity mac_block;

architecture rtl of mac_block is

  signal enable_1      : std_logic;
  signal enable_2      : std_logic;
  signal a_1           : signed(A_WIDTH - 1 downto 0);
  signal b_1           : signed(B_WIDTH - 1 downto 0);
  signal alignment_1   : std_logic_vector(1 downto 0);
  signal accumulate_1  : std_logic;
  signal seed_1        : signed(ACCUMULATOR_WIDTH - 1 downto 0);
  signal product_2     : signed(A_WIDTH + B_WIDTH - 1 downto 0);
  signal alignment_2   : std_logic_vector(1 downto 0);
  signal accumulate_2  : std_logic;
  signal seed_2        : signed(ACCUMULATOR_WIDTH - 1 downto 0);
  signal accumulator_3 : signed(ACCUMULATOR_WIDTH - 1 downto 0);

begin

  assert A_WIDTH <= 18 and B_WIDTH <= 18
    report "mac_block: operands wider than 18 bits take more than one multiplier"
    severity failure;

  assert ACCUMULATOR_WIDTH >= A_WIDTH + B_WIDTH
    report "mac_block: the accumulator does not hold one product"
    severity failure;

  p_pipeline : process (clk) is

    variable aligned : signed(ACCUMULATOR_WIDTH - 1 downto 0);

  begin

    if rising_edge(clk) then
      -- stage 1: operands
      enable_1 <= enable;

      if (enable = '1') then
        a_1          <= signed(selected(a_inputs, a_select, A_WIDTH));
        b_1          <= signed(selected(b_inputs, b_select, B_WIDTH));
        alignment_1  <= alignment;
        accumulate_1 <= accumulate;
        seed_1       <= signed(seed);
      end if;

      -- stage 2: product
      enable_2 <= enable_1;

      if (enable_1 = '1') then
        product_2    <= a_1 * b_1;
        alignment_2  <= alignment_1;
        accumulate_2 <= accumulate_1;
        seed_2       <= seed_1;
      end if;

      -- stage 3: sum
      if (enable_2 = '1') then
        aligned := resize(product_2, ACCUMULATOR_WIDTH);

        if (alignment_2(0) = '1') then
          aligned := shift_left(aligned, ALIGNMENT_STEP);
        end if;

        if (alignment_2(1) = '1') then
          aligned := shift_left(aligned, 2 * ALIGNMENT_STEP);
        end if;

        if (accumulate_2 = '1') then
          aligned := aligned + accumulator_3;
        else
          aligned := aligned + seed_2;
        end if;

        accumulator_3 <= aligned;
      end if;
    end if;

  end process p_pipeline;

  accumulator <= std_logic_vector(accumulator_3);

end architecture rtl;
