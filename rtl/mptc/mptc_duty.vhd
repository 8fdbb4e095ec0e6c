-- Duty of a pair of vectors: the part of the period in which the first is applied, two bits a clock or one.
--
-- The torque is linear in the duty d: error(d) = error - d * span, with the error at d = 0 and span, what the first
-- vector adds to the torque beyond the second. d = error/span is found by one subtraction a bit, the highest first. No
-- divider (docs/specification.md, section 3.6). A clock finds two bits: the second subtraction is done for either value
-- of the first bit, which then chooses. The next search may be loaded with the clock of the last bits.
-- With mean it finds the root of error/span: 1 - d, whose square times span is half of error. A bit of the root r takes
-- 2*r*span + unit from twice the rest; unit is span, halved with every bit, and r*span is added up on the way, so that
-- nothing is multiplied. A clock finds one bit of it.
--
-- Formats: error and span quarters of a torque term, 0 <= error < span, with mean 0 <= error < 2 * span; duty 12 bits,
-- unsigned, 1/4096 of the period, cut off.
-- Latency: duty is given in clock DUTY_CLOCKS after load, with mean in clock ROOT_CLOCKS, in that clock only.
-- Overflow: none where error is in its range; else duty means nothing.
-- Considered and rejected: rtl/alternatives.md.
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
    clk   : in    std_logic;                                -- rising edge
    load  : in    std_logic;                                -- '1': a search begins with the following inputs
    mean  : in    std_logic;                                -- '1': a root, '0': a quotient; stable
    error : in    mptc_rest_t;                              -- dividend; torque error without the first
    span  : in    error_t;                                  -- divisor, not negative; what the first takes from it
    duty  : out   std_logic_vector(TIME_WIDTH - 1 downto 0) -- unsigned, 1/4096 of the period
  );
end entity mptc_duty;

architecture rtl of mptc_duty is

  constant TRIAL_WIDTH : positive := mptc_rest_t'length + 2;

  subtype trial_t is unsigned(TRIAL_WIDTH - 1 downto 0);

  subtype early_t is unsigned(mptc_rest_t'range); -- of a second bit: above minus span, below span

  signal rest     : mptc_rest_t;                               -- what the last subtraction left
  signal unit     : mptc_taken_t;                              -- span, halved with every bit of a root
  signal triple   : early_t;                                   -- three times span
  signal sum      : mptc_taken_t;                              -- the root so far, times span
  signal bits     : std_logic_vector(TIME_WIDTH - 2 downto 0);
  signal trial    : trial_t;                                   -- twice the rest, less what the first bit takes
  signal behind_0 : early_t;                                   -- quotient: rest behind the bits 01
  signal behind_1 : early_t;                                   -- behind the bits 11
  signal one      : std_logic;                                 -- the first bit
  signal next_one : std_logic;                                 -- the second bit
  signal remains  : mptc_rest_t;
  signal found    : std_logic_vector(TIME_WIDTH - 1 downto 0);

begin

  assert TIME_WIDTH mod 2 = 0
    report "mptc_duty: a clock finds two bits of a quotient"
    severity failure;

  trial    <= shift_left(resize(rest, TRIAL_WIDTH), 1)
              - (shift_left(resize(sum, TRIAL_WIDTH), 1) + resize(unit, TRIAL_WIDTH));
  behind_0 <= shift_left(rest, 2) - resize(unit, early_t'length);
  behind_1 <= shift_left(rest, 2) - triple;

  one      <= not trial(TRIAL_WIDTH - 1);
  next_one <= not behind_1(behind_1'high) when one = '1' else
              not behind_0(behind_0'high);

  p_remains : process (mean, one, trial, rest, behind_0, behind_1) is
  begin

    if (one = '1') then
      remains <= trial(mptc_rest_t'high - 1 downto 0) & '0';

      if (mean = '1') then
        remains <= trial(mptc_rest_t'range);
      elsif (behind_1(behind_1'high) = '0') then
        remains <= behind_1;
      end if;
    else
      remains <= shift_left(rest, 2);

      if (mean = '1') then
        remains <= shift_left(rest, 1);
      elsif (behind_0(behind_0'high) = '0') then
        remains <= behind_0;
      end if;
    end if;

  end process p_remains;

  found <= bits & one when mean = '1' else
           bits(TIME_WIDTH - 3 downto 0) & one & next_one;

  p_search : process (clk) is
  begin

    if rising_edge(clk) then
      rest <= remains;
      bits <= found(TIME_WIDTH - 2 downto 0);

      if (load = '1') then
        rest   <= error;
        sum    <= (others => '0');
        unit   <= unsigned(span);
        triple <= resize(unsigned(span), early_t'length) + shift_left(resize(unsigned(span), early_t'length), 1);
      elsif (mean = '1') then
        unit <= shift_right(unit, 1);

        if (one = '1') then
          sum <= sum + unit;
        end if;
      end if;
    end if;

  end process p_search;

  duty <= found;

end architecture rtl;
