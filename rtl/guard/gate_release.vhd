-- Lets gates reach the pins while that is permitted; works without a clock.
--
-- permit = '0' turns all pins off through gates alone: no clock, no reset and no register has a part in it.  It also
-- clears six flip-flops, which keep the pins off until permit has been '1' for six rising edges and all gates are off.
-- The guard behind sees every loss of permit that clears them, and has begun to turn its gates off by the fourth edge.
-- A pulse shorter than the least clear pulse of a flip-flop of the part, some ns, may clear some of the six or none: it
-- is a pulse at the pins as well, or nothing, and no fault. A filter outside has to keep such pulses away.
-- So a permit that comes back, with the clock or while it stands, lets nothing through that was decided before, and no
-- rest of a stop.
--
-- Off at once is no stop of a leg whose stop takes steps.  What the gate drivers have to do about it is in
-- docs/safety.md.
--
-- Formats: none.
-- Latency: pins follow gates and the fall of permit at once, and its rise after six rising edges or with the first edge
-- behind them that finds all gates off.  permitted falls two
-- or three edges after permit, stays '0' for two clocks at least, and rises four edges after permit.
-- Overflow: none.
-- Power-up: off.
-- Constraints: permit is asynchronous; its paths are false paths.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity gate_release is
  generic (
    WIDTH : positive := 24 -- gates
  );
  port (
    clk       : in    std_logic;                            -- rising edge; may stop
    permit    : in    std_logic;                            -- asynchronous, '0': all pins off
    gates     : in    std_logic_vector(WIDTH - 1 downto 0); -- '1': on
    pins      : out   std_logic_vector(WIDTH - 1 downto 0); -- '1': on
    permitted : out   std_logic                             -- synchronous to clk, '0': not permitted
  );
end entity gate_release;

architecture rtl of gate_release is

  -- off from configuration on, before there is a clock
  -- vsg_off signal_007
  signal held    : std_logic_vector(5 downto 0) := (others => '0'); -- '1': permit for 1 to 6 edges, no gate on
  -- vsg_on signal_007
  signal allowed : std_logic;

begin

  p_held : process (clk, permit) is
  begin

    if (permit = '0') then
      held <= (others => '0');
    elsif rising_edge(clk) then
      held <= held(4 downto 0) & '1';

      -- pins come back with all gates off
      if (held(5) = '0' and gates /= (gates'range => '0')) then
        held(5) <= '0';
      end if;
    end if;

  end process p_held;

  allowed <= permit and held(5);

  g_pins : for i in 0 to WIDTH - 1 generate
    pins(i) <= gates(i) and allowed;
  end generate g_pins;

  i_sync_bits : entity work.sync_bits
    generic map (
      WIDTH  => 1,
      STAGES => 2
    )
    port map (
      clk             => clk,
      asynchronous(0) => held(1),
      synchronous(0)  => permitted
    );

end architecture rtl;
