-- Cost of a candidate: J = f_s / L + (sqrt(lambda_n) * v_n(k+L))**2 (Paper A, eq. 10).
--
--   stage 12  (SHORTEST + 1) slope of sqrt(lambda_n) * v_n
--   stage 13  slope * L; steps of both levels
--   stage 14  sqrt(lambda_n) * v_n(k+L); f_s / L of the low and of the high bits of f_s, from one table
--   stage 15  its square; f_s / L
--   stage 16  J
--
-- With leaves of the second level, f_s and L count both levels.
-- Formats: J with RECIPROCAL_FRACTION fractional bits; sqrt(lambda_n) * v_n as limits.weight_scale says.
-- Latency: COST_STAGE - LENGTH_STAGE clocks from the length, LENGTH_STAGE + 1 - SHORTEST more from the pattern;
-- one candidate a clock.
-- Overflow: sqrt(lambda_n) * v_n saturates and flags; COST_WIDTH holds every sum.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.explorer_types.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_types.all;

entity candidate_cost is
  generic (
    SECOND_LEVEL : boolean := false -- true: efforts and lengths of two levels
  );
  port (
    clk     : in    std_logic;                    -- rising edge
    limits  : in    limits_t;                     -- scale of the weight
    node    : in    node_t;                       -- weight on v_n at k and its slopes
    reached : in    reached_t;                    -- steps before the node, second level
    valid   : in    stages_t;                     -- '1': the stage holds a candidate
    pattern : in    std_logic_vector(2 downto 0); -- phases connected to the neutral point, stage SHORTEST
    effort  : in    efforts_t;                    -- f_s, stage LENGTH_STAGE + 1
    length  : in    length_t;                     -- L*, steps, stage LENGTH_STAGE
    costed  : out   costed_t                      -- stage COST_STAGE
  );
end entity candidate_cost;

architecture rtl of candidate_cost is

  constant EFFORT_BITS : natural := effort_bits_of(SECOND_LEVEL);
  constant REACH_BITS  : natural := choose(SECOND_LEVEL, LENGTH_WIDTH + 1, LENGTH_WIDTH);
  constant PRODUCTS    : natural := 2 ** maximum_of(EFFORT_BITS - 2, 2); -- of a reciprocal, 0 included

  subtype multiple_t is std_logic_vector(RECIPROCAL_FRACTION + 3 downto 0);

  -- downwards: GHDL counts the addresses of an array from its last element, which takes inverters otherwise
  type multiples_t is array (natural range PRODUCTS * 2 ** REACH_BITS - 1 downto 0) of multiple_t;

  subtype rate_t is unsigned(RECIPROCAL_FRACTION + EFFORT_BITS - 1 downto 0);

  subtype effort_t is unsigned(EFFORT_BITS - 1 downto 0);

  type length_stages_t is array (LENGTH_STAGE to COST_STAGE) of length_t;

  type effort_stages_t is array (LENGTH_STAGE + 2 to COST_STAGE) of effort_t;

  -- 0 to 7 times 1/L
  function multiples_of_reciprocals return multiples_t is

    variable words : multiples_t;

  begin

    for k in natural range 0 to PRODUCTS - 1 loop
      for l in natural range 0 to 2 ** REACH_BITS - 1 loop
        words(k * 2 ** REACH_BITS + l) := std_logic_vector(unsigned(RECIPROCALS(l)) * to_unsigned(k, 3));
      end loop;
    end loop;

    return words;

  end function multiples_of_reciprocals;

  -- never written: a constant would become one block RAM for each of the two places that read it
  -- vsg_off signal_007
  signal multiples : multiples_t := multiples_of_reciprocals;
  -- vsg_on signal_007

  signal slope     : weight_t;                                         -- stage 12
  signal product   : signed(WEIGHT_WIDTH + LENGTH_WIDTH downto 0);     -- stage 13
  signal reach     : unsigned(REACH_BITS - 1 downto 0);                -- stage 13, steps of both levels
  signal effort_in : effort_t;
  signal rate_low  : multiple_t;                                       -- stage 14, of the two low bits of the effort
  signal rate_high : multiple_t;
  signal weight    : weight_t;
  signal square    : signed(2 * WEIGHT_WIDTH - 1 downto 0);            -- stage 15
  signal rate      : rate_t;
  signal cost      : cost_t;                                           -- stage 16

  signal lengths  : length_stages_t;
  signal efforts  : effort_stages_t;
  signal feasible : std_logic_vector(LENGTH_STAGE + 1 to COST_STAGE);
  signal clipped  : std_logic_vector(LENGTH_STAGE + 2 to COST_STAGE);

begin

  lengths(LENGTH_STAGE) <= length;
  effort_in             <= effort(EFFORT_BITS - 1 downto 0);

  p_cost : process (clk) is

    variable factor : signed(LENGTH_WIDTH downto 0);
    variable sum    : signed(WEIGHT_WIDTH + LENGTH_WIDTH downto 0);
    variable scaled : unsigned(COST_WIDTH - 1 downto 0);

  begin

    if rising_edge(clk) then
      -- stage 12
      if (valid(SHORTEST) = '1') then
        slope <= share_of(node.weight_slope, pattern);
      end if;

      -- stage 13
      if (valid(LENGTH_STAGE) = '1') then
        factor  := signed('0' & length);
        product <= slope * factor;
      end if;

      reach <= resize(length, REACH_BITS) + reached.lead;

      -- stage 14
      if (valid(LENGTH_STAGE + 1) = '1') then
        sum := shift_right(product, WEIGHT_SLOPE_FRACTION) + node.weight_start;

        weight                    <= clip(sum, WEIGHT_WIDTH);
        clipped(LENGTH_STAGE + 2) <= overflows(sum, WEIGHT_WIDTH);

        if (EFFORT_BITS > 2) then
          rate_low  <= multiples(to_integer(effort_in(1 downto 0) & reach));
          rate_high <= multiples(to_integer(effort_in(EFFORT_BITS - 1 downto 2) & reach));
        end if;
      end if;

      -- stage 15
      if (valid(LENGTH_STAGE + 2) = '1') then
        square <= weight * weight;

        -- two and three bits of effort, from one memory, are cheaper than 1/L and a product; where two bits are
        -- all, the memory is read a stage later
        if (EFFORT_BITS > 2) then
          rate <= resize(unsigned(rate_low), rate'length) + shift_left(resize(unsigned(rate_high), rate'length), 2);
        else
          rate_low <= multiples(to_integer(efforts(LENGTH_STAGE + 2) & lengths(LENGTH_STAGE + 2)));
        end if;
      end if;

      -- stage 16
      if (valid(LENGTH_STAGE + 3) = '1') then
        scaled := (others => '0');

        for i in WEIGHT_SHIFTS'range loop
          if (limits.weight_scale = i) then
            scaled := resize(unsigned(square(2 * WEIGHT_WIDTH - 2 downto WEIGHT_SHIFTS(i))), COST_WIDTH);
          end if;
        end loop;

        if (EFFORT_BITS > 2) then
          cost <= resize(rate, COST_WIDTH) + scaled;
        else
          cost <= resize(unsigned(rate_low), COST_WIDTH) + scaled;
        end if;
      end if;

      clipped(LENGTH_STAGE + 3 to COST_STAGE) <= clipped(LENGTH_STAGE + 2 to COST_STAGE - 1);
    end if;

  end process p_cost;

  -- what the cost is of, beside it
  p_beside : process (clk) is
  begin

    if rising_edge(clk) then
      feasible <= to_std_logic(length /= 0) & feasible(LENGTH_STAGE + 1 to COST_STAGE - 1);
      efforts  <= effort_in & efforts(LENGTH_STAGE + 2 to COST_STAGE - 1);

      lengths(LENGTH_STAGE + 1 to COST_STAGE) <= lengths(LENGTH_STAGE to COST_STAGE - 1);
    end if;

  end process p_beside;

  costed.feasible  <= valid(COST_STAGE) and feasible(COST_STAGE);
  costed.saturated <= clipped(COST_STAGE);
  costed.effort    <= resize(efforts(COST_STAGE), TOTAL_EFFORT_WIDTH);
  costed.length    <= lengths(COST_STAGE);
  costed.cost      <= cost;

end architecture rtl;
