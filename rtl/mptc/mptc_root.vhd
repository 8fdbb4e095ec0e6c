-- Integer square root, one bit a clock: the largest root with root**2 <= radicand.
--
-- Digit by digit: two bits of the radicand come down a clock, and 4*root + 1 is taken off the
-- remainder where it fits.  MPFC takes the part of its flux reference along the rotor flux from it.
--
-- Formats: radicand 34 bits unsigned, root 17 bits unsigned.
-- Latency: root is stable ROOT_WIDTH clocks after the clock of load and stays until the next load; a
-- load at any time begins anew.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.mptc_constants.all;

entity mptc_root is
  port (
    clk      : in    std_logic;                                     -- rising edge
    rst      : in    std_logic;                                     -- synchronous, active high
    load     : in    std_logic;                                     -- '1': radicand is given in this clock
    radicand : in    std_logic_vector(2 * ROOT_WIDTH - 1 downto 0); -- unsigned
    root     : out   std_logic_vector(ROOT_WIDTH - 1 downto 0)      -- unsigned, ROOT_WIDTH clocks later
  );
end entity mptc_root;

architecture rtl of mptc_root is

  signal bits      : std_logic_vector(2 * ROOT_WIDTH - 1 downto 0);
  signal remainder : unsigned(ROOT_WIDTH + 1 downto 0);
  signal result    : unsigned(ROOT_WIDTH - 1 downto 0);
  signal left      : natural range 0 to ROOT_WIDTH;

begin

  p_digit : process (clk) is

    variable trial : unsigned(ROOT_WIDTH + 1 downto 0);
    variable rest  : unsigned(ROOT_WIDTH + 1 downto 0);

  begin

    if rising_edge(clk) then
      if (load = '1') then
        bits      <= radicand;
        remainder <= (others => '0');
        result    <= (others => '0');
      elsif (left /= 0) then
        bits      <= bits(2 * ROOT_WIDTH - 3 downto 0) & "00";
        rest      := remainder(ROOT_WIDTH - 1 downto 0)
                     & unsigned(bits(2 * ROOT_WIDTH - 1 downto 2 * ROOT_WIDTH - 2));
        trial     := result & "01";
        if (rest >= trial) then
          remainder <= rest - trial;
          result    <= result(ROOT_WIDTH - 2 downto 0) & '1';
        else
          remainder <= rest;
          result    <= result(ROOT_WIDTH - 2 downto 0) & '0';
        end if;
      end if;
    end if;

  end process p_digit;

  p_count : process (clk) is
  begin

    if rising_edge(clk) then
      if (load = '1') then
        left <= ROOT_WIDTH;
      elsif (left /= 0) then
        left <= left - 1;
      end if;

      if (rst = '1') then
        left <= 0;
      end if;
    end if;

  end process p_count;

  root <= std_logic_vector(result);

end architecture rtl;
