-- Turns the switch states that a sequence asks for into goals of the gate guard, none too early.
--
-- A leg that moves, or rests after a move, takes one more goal and no other until that move has begun: a further one
-- would be an overrun, a fault.  So the goal of a leg that waits is kept, and what the sequence asks for at the end of
-- the wait is the next one.  A vector that is shorter than dead and minimum time is applied later, or not at all.
-- A goal is given when a leg's changes, and once for every new sequence, so that the guard's watchdog sees that
-- decisions come.
--
-- Formats: legs a, b, c in bits 2, 1, 0; '1': upper gate.
-- Latency: goal in the clock of wanted, decided one clock later, as gate_guard takes them; two clocks at least from one
-- goal to the next.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity goal_holder is
  port (
    clk     : in    std_logic;                    -- rising edge
    rst     : in    std_logic;                    -- synchronous, active high
    fresh   : in    std_logic;                    -- '1' for one clock: a new sequence begins
    playing : in    std_logic;                    -- '1': wanted is of a sequence
    wanted  : in    std_logic_vector(2 downto 0); -- switch states to apply
    waits   : in    std_logic_vector(2 downto 0); -- '1': this leg takes no other goal yet; a clock after decided
    decided : out   std_logic;                    -- '1' for one clock: goal of the clock before is to be taken
    goal    : out   std_logic_vector(2 downto 0); -- switch states for the guard, one clock before decided
    delayed : out   std_logic                     -- '1': a leg's goal is kept because it waits
  );
end entity goal_holder;

architecture rtl of goal_holder is

  signal given  : std_logic_vector(2 downto 0); -- goals
  signal taken  : std_logic_vector(2 downto 0); -- goals that may be given now
  signal now    : std_logic;                    -- they are new with the next clock
  signal latest : std_logic;                    -- they became new with the last one: waits is not there yet
  signal asked  : std_logic;                    -- a sequence has begun that the guard does not know of

begin

  taken <= (given and waits) or (wanted and not waits);
  now   <= '1' when playing = '1' and latest = '0' and (asked = '1' or taken /= given) else
           '0';

  p_goal : process (clk) is
  begin

    if rising_edge(clk) then
      latest <= now;

      if (fresh = '1') then
        asked <= '1';
      elsif (now = '1') then
        asked <= '0';
      end if;

      if (now = '1') then
        given <= taken;
      end if;

      if (rst = '1') then
        latest <= '0';
        asked  <= '0';
        given  <= (others => '0');
      end if;
    end if;

  end process p_goal;

  decided <= latest;
  goal    <= taken;
  delayed <= '0' when playing = '0' or latest = '1' or ((wanted xor given) and waits) = "000" else
             '1';

end architecture rtl;
