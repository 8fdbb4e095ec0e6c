-- Says whether the measurements of a decision are new: whole, taken since the last start, and not too old.
--
-- Measurements at the ports come with start and are new.  Those in registers are new if every one of their COUNT
-- registers was written since the start before and since live rose, and the first of these writes lies at most
-- limit + 1 clocks back.  So a program that stands still, and only the commands of which go on, brings nothing new.
--
-- Formats: byte addresses; the registers are words from MEASUREMENT_BLOCK on.
-- Latency: fresh in the clock after begins, until the next one.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_system_registers_pkg.all;

entity measurement_watch is
  generic (
    COUNT : positive range 1 to 16 := 13 -- registers that a measurement has
  );
  port (
    clk     : in    std_logic;                     -- rising edge
    rst     : in    std_logic;                     -- synchronous, active high
    live    : in    std_logic;                     -- '1': the guard is enabled and has no fault
    address : in    std_logic_vector(9 downto 0);  -- of the write that is there, bytes
    passed  : in    std_logic;                     -- '1': it goes to the registers
    limit   : in    std_logic_vector(15 downto 0); -- longest age, unsigned, clocks
    take    : in    std_logic;                     -- '1': measurements are taken from the ports
    begins  : in    std_logic;                     -- '1': a decision begins with the next clock
    fresh   : out   std_logic                      -- '1': its measurements are new
  );
end entity measurement_watch;

architecture rtl of measurement_watch is

  signal written : std_logic_vector(COUNT - 1 downto 0); -- since the last start
  signal none    : std_logic;
  signal whole   : std_logic;
  signal over    : std_logic;
  signal old     : std_logic;                            -- the first of these writes is

begin

  none  <= '1' when written = (written'range => '0') else
           '0';
  whole <= '1' when written = (written'range => '1') else
           '0';

  old   <= over and not none;

  i_age : entity work.countdown
    generic map (
      WIDTH => 16
    )
    port map (
      clk    => clk,
      load   => none,
      clocks => limit,
      over   => over
    );

  p_watch : process (clk) is
  begin

    if rising_edge(clk) then
      for i in 0 to COUNT - 1 loop
        if (passed = '1' and address(MEASUREMENT_BLOCK'range) = MEASUREMENT_BLOCK
            and unsigned(address(5 downto 2)) = i) then
          written(i) <= '1';
        end if;
      end loop;

      if (begins = '1') then
        fresh <= take or whole;
      end if;

      if (begins = '1' or old = '1' or live = '0' or rst = '1') then
        written <= (others => '0');
      end if;

      if (rst = '1') then
        fresh <= '0';
      end if;
    end if;

  end process p_watch;

end architecture rtl;
