-- Delays a word by a fixed number of clocks.
--
-- A ring of CLOCKS - 1 words in a memory, each read just before it is overwritten, and one register.
-- Formats: any.
-- Latency: CLOCKS clocks; initiation interval one clock.
-- Overflow: none. What comes out before CLOCKS clocks have passed since power-up is void; what a
-- word means has to travel beside it (a valid flag that is reset).
-- Tried and dropped: a chain of registers: one flip-flop per bit and clock, where the memory takes
-- one LUT per bit for up to sixteen clocks.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity delay_line is
  generic (
    WIDTH  : positive              := 8; -- bits of a word
    CLOCKS : positive range 3 to 17 := 8 -- delay
  );
  port (
    clk     : in    std_logic;                            -- rising edge
    rst     : in    std_logic;                            -- synchronous, active high: aligns the ring
    word    : in    std_logic_vector(WIDTH - 1 downto 0); -- word of this clock
    delayed : out   std_logic_vector(WIDTH - 1 downto 0)  -- word of CLOCKS clocks ago
  );
end entity delay_line;

architecture rtl of delay_line is

  type ring_t is array (0 to 15) of std_logic_vector(WIDTH - 1 downto 0);

  signal ring     : ring_t;
  signal position : natural range 0 to 15;

begin

  p_ring : process (clk) is
  begin

    if rising_edge(clk) then
      delayed        <= ring(position);
      ring(position) <= word;

      if (rst = '1' or position = CLOCKS - 2) then
        position <= 0;
      else
        position <= position + 1;
      end if;
    end if;

  end process p_ring;

end architecture rtl;
