-- Quotient of a coordinate and the way of a voltage vector, bit by bit, after halvings.
--
-- First the size of the coordinate is compared with QUOTIENT_RANGE doublings of the way, the end of the range,
-- and halved on demand. Then each step doubles it and takes these doublings off where they fit: one bit of the
-- quotient a step, the highest first. One subtraction serves both (Paper B, eqs. 17 to 21; docs/mptc.md).
--
-- Formats: dividend SIZE_WIDTH bits, unsigned; way STEP_WIDTH bits, signed, both with the same LSB. The quotient has
-- QUOTIENT_BITS bits, QUOTIENT_RANGE of them before the point, cut off.
-- Latency: a bit a step; quotient holds the bits of the steps so far behind those of before.
-- Overflow: a dividend beyond the range gives ones only, and so does a way of zero or below.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;

entity mptc_quotient is
  port (
    clk      : in    std_logic;                                     -- rising edge
    load     : in    std_logic;                                     -- '1': take the dividend
    dividend : in    std_logic_vector(SIZE_WIDTH - 1 downto 0);     -- unsigned
    way      : in    std_logic_vector(STEP_WIDTH - 1 downto 0);     -- signed, stable
    halve    : in    std_logic;                                     -- '1': half of what is left
    step     : in    std_logic;                                     -- '1': next bit; not with halve
    beyond   : out   std_logic;                                     -- without step, '1': the quotient is out of range
    quotient : out   std_logic_vector(QUOTIENT_BITS - 1 downto 0)   -- unsigned
  );
end entity mptc_quotient;

architecture rtl of mptc_quotient is

  constant TRIAL_WIDTH : positive := SIZE_WIDTH + 3;

  subtype trial_t is signed(TRIAL_WIDTH - 1 downto 0);

  signal left  : unsigned(SIZE_WIDTH - 1 downto 0);
  signal over  : std_logic;                                   -- it has grown beyond its bits: ones from now on
  signal bits  : std_logic_vector(QUOTIENT_BITS - 1 downto 0);
  signal trial : trial_t;
  signal fits  : std_logic;

begin

  p_trial : process (left, way, step) is

    variable subtrahend : trial_t;

  begin

    subtrahend := shift_left(resize(signed(way), TRIAL_WIDTH), QUOTIENT_RANGE);

    if (step = '1') then
      subtrahend := shift_left(resize(signed(way), TRIAL_WIDTH), QUOTIENT_RANGE - 1);
    end if;

    trial <= signed(resize(left, TRIAL_WIDTH)) - subtrahend;

  end process p_trial;

  fits   <= not trial(TRIAL_WIDTH - 1);
  beyond <= fits;

  p_left : process (clk) is
  begin

    if rising_edge(clk) then
      if (load = '1') then
        left <= unsigned(dividend);
        over <= '0';
      elsif (halve = '1') then
        left <= shift_right(left, 1);
      elsif (step = '1') then
        left <= shift_left(left, 1);

        if (fits = '1') then
          left <= unsigned(trial(SIZE_WIDTH - 2 downto 0)) & '0';
          over <= over or to_std_logic(trial(TRIAL_WIDTH - 2 downto SIZE_WIDTH - 1) /= 0);
        end if;
      end if;

      -- apart from the others: halve comes late in a clock
      if (step = '1') then
        bits <= bits(QUOTIENT_BITS - 2 downto 0) & (fits or over);
      end if;
    end if;

  end process p_left;

  quotient <= bits;

end architecture rtl;
