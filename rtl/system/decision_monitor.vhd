-- Counts decisions and the clock cycles they take, and keeps the worst.
--
-- Cycles run from the edge that accepts start to the one that sees valid, as the cores count theirs.
-- Formats: 16 bits of cycles, which stop at their end; 32 bits of decisions, which wrap.
-- Latency: one clock after valid.
-- Overflow: as said; a start without a valid is not counted.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity decision_monitor is
  port (
    clk       : in    std_logic;                     -- rising edge
    rst       : in    std_logic;                     -- synchronous, active high
    clear     : in    std_logic;                     -- '1': begin anew
    start     : in    std_logic;                     -- '1': a decision begins
    valid     : in    std_logic;                     -- '1': it is there
    last      : out   std_logic_vector(15 downto 0); -- cycles of the last decision, unsigned
    worst     : out   std_logic_vector(15 downto 0); -- cycles of the longest, unsigned
    decisions : out   std_logic_vector(31 downto 0)  -- count, unsigned
  );
end entity decision_monitor;

architecture rtl of decision_monitor is

  signal cycles   : unsigned(15 downto 0);
  signal latest   : unsigned(15 downto 0);
  signal longest  : unsigned(15 downto 0);
  signal numbered : unsigned(31 downto 0);

begin

  p_monitor : process (clk) is
  begin

    if rising_edge(clk) then
      if (start = '1') then
        cycles <= to_unsigned(1, 16);
      elsif (cycles /= (cycles'range => '1')) then
        cycles <= cycles + 1;
      end if;

      if (valid = '1') then
        latest   <= cycles;
        numbered <= numbered + 1;

        if (cycles > longest) then
          longest <= cycles;
        end if;
      end if;

      if (rst = '1' or clear = '1') then
        latest   <= (others => '0');
        longest  <= (others => '0');
        numbered <= (others => '0');
      end if;
    end if;

  end process p_monitor;

  last      <= std_logic_vector(latest);
  worst     <= std_logic_vector(longest);
  decisions <= std_logic_vector(numbered);

end architecture rtl;
