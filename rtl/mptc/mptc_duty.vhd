-- Duty of a pair of vectors: the part of the period in which the first is applied, bit by bit.
--
-- The torque is linear in the duty d: error(d) = error - d * span, with the error at d = 0 and span, what the first
-- vector adds to the torque beyond the second. d = error/span is found by one subtraction a bit, the highest first. No
-- divider (docs/specification.md, section 3.6). The next search may be loaded with the clock of the last bit.
--
-- Formats: error and span quarters of a torque term, 0 <= error < span; duty 12 bits, unsigned, 1/4096 of the period,
-- cut off. The error that remains is 4096 times as large.
-- Latency: duty and left are given in clock DUTY_CLOCKS after load, in that clock only.
-- Overflow: none where error < span; else they mean nothing.
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
    error : in    error_t;                                   -- torque error without the first vector, not negative
    span  : in    error_t;                                   -- what the first vector takes from it, not negative
    duty  : out   std_logic_vector(TIME_WIDTH - 1 downto 0); -- unsigned, 1/4096 of the period
    left  : out   error_t                                    -- error that remains, not negative
  );
end entity mptc_duty;

architecture rtl of mptc_duty is

  signal rest    : error_t;                                   -- what the last subtraction left
  signal taken   : error_t;
  signal bits    : std_logic_vector(TIME_WIDTH - 2 downto 0);
  signal trial   : signed(ERROR_WIDTH downto 0);
  signal remains : error_t;

begin

  trial <= signed(std_logic_vector(rest) & '0') - taken;

  remains <= trial(ERROR_WIDTH - 1 downto 0) when trial(ERROR_WIDTH) = '0' else
           shift_left(rest, 1);

  p_search : process (clk) is
  begin

    if rising_edge(clk) then
      rest <= remains;
      bits <= bits(TIME_WIDTH - 3 downto 0) & not trial(ERROR_WIDTH);

      if (load = '1') then
        rest  <= error;
        taken <= span;
      end if;
    end if;

  end process p_search;

  duty <= bits & not trial(ERROR_WIDTH);
  left <= remains;

end architecture rtl;
