-- delay_line_flat as a transaction of two clocks: the netlist's harness looks at every other clock.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity delay_line_pairs is
  generic (
    WIDTH : positive := 8 -- bits of a word
  );
  port (
    clk       : in    std_logic;                                 -- rising edge
    rst       : in    std_logic;                                 -- synchronous, active high
    start     : in    std_logic;                                 -- '1' in the first clock of two
    align_0   : in    std_logic;                                 -- reset of the lines in the first clock
    align_1   : in    std_logic;                                 -- reset of the lines in the second
    word_0    : in    std_logic_vector(WIDTH - 1 downto 0);      -- word of the first clock
    word_1    : in    std_logic_vector(WIDTH - 1 downto 0);      -- word of the second
    valid     : out   std_logic;                                 -- '1' in the second clock: outputs are valid
    delayed_0 : out   std_logic_vector(15 * WIDTH - 1 downto 0); -- before the edge of the first clock
    delayed_1 : out   std_logic_vector(15 * WIDTH - 1 downto 0)  -- after it
  );
end entity delay_line_pairs;

architecture bench of delay_line_pairs is

  signal align   : std_logic;
  signal word    : std_logic_vector(WIDTH - 1 downto 0);
  signal delayed : std_logic_vector(15 * WIDTH - 1 downto 0);

begin

  word  <= word_0 when start = '1' else
           word_1;
  align <= rst or align_0 when start = '1' else
           rst or align_1;

  i_lines : entity work.delay_line_flat
    generic map (
      WIDTH => WIDTH
    )
    port map (
      clk     => clk,
      rst     => align,
      word    => word,
      delayed => delayed
    );

  p_before : process (clk) is
  begin

    if rising_edge(clk) then
      delayed_0 <= delayed;
      valid     <= start;

      if (rst = '1') then
        valid <= '0';
      end if;
    end if;

  end process p_before;

  delayed_1 <= delayed;

end architecture bench;
