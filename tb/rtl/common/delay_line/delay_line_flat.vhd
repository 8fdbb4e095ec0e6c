-- delay_line with every delay it takes, and what lets the netlist's harness see all its clocks.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library directmpc;

entity delay_line_flat is
  generic (
    WIDTH : positive := 8 -- bits of a word
  );
  port (
    clk     : in    std_logic;                                -- rising edge
    rst     : in    std_logic;                                -- synchronous, active high
    word    : in    std_logic_vector(WIDTH - 1 downto 0);     -- word of this clock
    delayed : out   std_logic_vector(15 * WIDTH - 1 downto 0) -- lines of 3 to 17 clocks, 3 rightmost
  );
end entity delay_line_flat;

architecture bench of delay_line_flat is

begin

  g_lines : for clocks in 3 to 17 generate

    i_line : entity directmpc.delay_line
      generic map (
        WIDTH  => WIDTH,
        CLOCKS => clocks
      )
      port map (
        clk     => clk,
        rst     => rst,
        word    => word,
        delayed => delayed((clocks - 2) * WIDTH - 1 downto (clocks - 3) * WIDTH)
      );

  end generate g_lines;

end architecture bench;
