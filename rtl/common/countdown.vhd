-- Counts clocks down and says when they have passed.
--
-- load begins a count from clocks.  over is '0' from the next clock on and rises clocks later; with clocks = 0 it
-- does not fall.  over is a register of its own, so that what depends on it does not wait for a comparison.
--
-- Formats: clocks unsigned.
-- Latency: over is high from the clock that follows load by clocks + 1 on, until the next load.
-- Overflow: none; the count stops at zero.
-- Power-up: over is unknown until the first load; there is no reset.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;

entity countdown is
  generic (
    WIDTH : positive := 12 -- bits of the count
  );
  port (
    clk    : in    std_logic;                            -- rising edge
    load   : in    std_logic;                            -- '1': begin anew
    clocks : in    std_logic_vector(WIDTH - 1 downto 0); -- to count, unsigned, read with load
    over   : out   std_logic                             -- '1': they have passed
  );
end entity countdown;

architecture rtl of countdown is

  signal left : unsigned(WIDTH - 1 downto 0);
  signal done : std_logic; -- '1': left is zero

begin

  p_count : process (clk) is
  begin

    if rising_edge(clk) then
      if (load = '1') then
        left <= unsigned(clocks);
        done <= to_std_logic(unsigned(clocks) = 0);
      elsif (done = '0') then
        left <= left - 1;
        done <= to_std_logic(left = 1);
      end if;
    end if;

  end process p_count;

  over <= done;

end architecture rtl;
