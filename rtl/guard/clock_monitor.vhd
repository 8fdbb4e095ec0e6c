-- Watches a clock with a second oscillator and says whether it runs, neither too slow nor too fast.
--
-- The watched clock is divided by 2**(DIVIDE_BITS + 1).  The oscillator counts the time between two edges of the
-- divided clock.  The clock runs when that time lies between SHORTEST and LONGEST.
--
--   choose SHORTEST + 1 < T < LONGEST - 1 with T = 2**DIVIDE_BITS * f_oscillator / f_clk, at all frequencies that the
--   two may have
--
-- Formats: times in clocks of the oscillator.
-- Latency: alive falls LONGEST + 4 clocks of the oscillator after the last edge of the divided clock at the latest, or
-- with the first time that is too short.  It rises with the end of the first time that fits, so that the watched clock
-- has had 2**DIVIDE_BITS edges by then.
-- Overflow: none; the count stops at LONGEST.
-- Power-up: alive is '0'; there is no reset.
-- Constraints: the path from clk to the first stage of i_sync_bits is a false path.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;

entity clock_monitor is
  generic (
    DIVIDE_BITS : positive := 6;  -- the divided clock changes every 2**DIVIDE_BITS clocks
    SHORTEST    : positive := 8;  -- clocks of the oscillator between two changes, at least
    LONGEST     : positive := 40  -- clocks of the oscillator between two changes, at most; above SHORTEST
  );
  port (
    clk        : in    std_logic; -- watched, rising edge
    oscillator : in    std_logic; -- second oscillator, rising edge
    alive      : out   std_logic  -- '1': clk runs; synchronous to oscillator
  );
end entity clock_monitor;

architecture rtl of clock_monitor is

  -- nothing resets them: a clock that never comes may not count as one
  -- vsg_off signal_007
  signal divided : unsigned(DIVIDE_BITS downto 0) := (others => '0');
  signal since   : natural range 0 to LONGEST     := LONGEST; -- clocks since the last change, stops at LONGEST
  signal runs    : std_logic                      := '0';
  -- vsg_on signal_007
  signal beat    : std_logic; -- divided clock, synchronous to oscillator
  signal earlier : std_logic; -- a clock ago
  signal change  : std_logic;

begin

  assert SHORTEST < LONGEST
    report "clock_monitor: SHORTEST has to be below LONGEST"
    severity failure;

  p_divide : process (clk) is
  begin

    if rising_edge(clk) then
      divided <= divided + 1;
    end if;

  end process p_divide;

  i_sync_bits : entity work.sync_bits
    generic map (
      WIDTH  => 1,
      STAGES => 2
    )
    port map (
      clk             => oscillator,
      asynchronous(0) => divided(DIVIDE_BITS),
      synchronous(0)  => beat
    );

  change <= beat xor earlier;

  p_watch : process (oscillator) is
  begin

    if rising_edge(oscillator) then
      earlier <= beat;

      if (change = '1') then
        -- since does not count this clock
        runs  <= to_std_logic(since + 1 >= SHORTEST and since < LONGEST);
        since <= 0;
      elsif (since = LONGEST) then
        runs <= '0';
      else
        since <= since + 1;
      end if;
    end if;

  end process p_watch;

  alive <= runs;

end architecture rtl;
