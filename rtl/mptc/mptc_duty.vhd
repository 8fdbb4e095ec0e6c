-- Duty of a pair of vectors: the part of the period in which the first is applied, bit by bit.
--
-- The torque is linear in the duty d: error(d) = error - d * span, with the error at d = 0 and span, what the first
-- vector adds to the torque beyond the second. d = error/span is found by one subtraction a bit, the highest first. No
-- divider (docs/specification.md, section 3.6). The next search may be loaded with the clock of the last bit.
-- With mean it finds the root of error/span: 1 - d, whose square times span is half of error. A bit of the root r takes
-- 2*r*span + unit from twice the rest; unit is span, halved with every bit, and r*span is added up on the way, so that
-- nothing is multiplied. The last bit does not come into that: a sum behind the subtraction would end the clock.
--
-- Formats: error and span quarters of a torque term, 0 <= error < span, with mean 0 <= error < 2 * span; duty 12 bits,
-- unsigned, 1/4096 of the period, cut off. The error that remains is 4096 times as large.
-- Latency: duty, left and taken are given in clock DUTY_CLOCKS after load, in that clock only.
-- Overflow: none where error is in its range; else they mean nothing.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;

entity mptc_duty is
  port (
    clk   : in    std_logic;                                 -- rising edge
    load  : in    std_logic;                                 -- '1': a search begins with the following inputs
    mean  : in    std_logic;                                 -- '1': a root, '0': a quotient; stable
    error : in    mptc_rest_t;                               -- dividend; torque error without the first
    span  : in    error_t;                                   -- divisor, not negative; what the first takes from it
    duty  : out   std_logic_vector(TIME_WIDTH - 1 downto 0); -- unsigned, 1/4096 of the period
    left  : out   mptc_rest_t;                               -- quotient: error that remains
    taken : out   mptc_taken_t                               -- root: twice span times it, without the last bit
  );
end entity mptc_duty;

architecture rtl of mptc_duty is

  constant TRIAL_WIDTH : positive := mptc_rest_t'length + 2;

  subtype trial_t is unsigned(TRIAL_WIDTH - 1 downto 0);

  signal rest    : mptc_rest_t;                               -- what the last subtraction left
  signal unit    : mptc_taken_t;                              -- span, halved with every bit of a root
  signal sum     : mptc_taken_t;                              -- twice the root so far, times span
  signal bits    : std_logic_vector(TIME_WIDTH - 2 downto 0);
  signal trial   : trial_t;                                   -- twice the rest, less what a bit takes
  signal one     : std_logic;                                 -- the bit
  signal remains : mptc_rest_t;

begin

  trial <= shift_left(resize(rest, TRIAL_WIDTH), 1)
           - (shift_left(resize(sum, TRIAL_WIDTH), 1) + resize(unit, TRIAL_WIDTH));
  one   <= not trial(TRIAL_WIDTH - 1);

  remains <= trial(mptc_rest_t'range) when one = '1' else
             shift_left(rest, 1);

  p_search : process (clk) is
  begin

    if rising_edge(clk) then
      rest <= remains;
      bits <= bits(TIME_WIDTH - 3 downto 0) & one;

      if (load = '1') then
        rest <= error;
        sum  <= (others => '0');
        unit <= unsigned(span);
      elsif (mean = '1') then
        unit <= shift_right(unit, 1);

        if (one = '1') then
          sum <= sum + unit;
        end if;
      end if;
    end if;

  end process p_search;

  duty  <= bits & one;
  left  <= remains;
  taken <= sum;

end architecture rtl;
