-- One inverter leg: takes positions, switches gates one at a time, keeps dead and minimum times.
--
-- A position that accept brings becomes the goal.  As soon as the leg has rested, a commutation begins: its
-- single-gate actions follow each other dead_time clocks apart (gate_tables says in what order).
-- After the last action the leg rests for rest_time clocks, so that every gate stays on or off for
-- that long.  A goal that comes meanwhile waits; blocked says that a further one would be lost.
--
-- stop overrides everything: all gates are off after the same edge, minimum on time or not.  refuse
-- says that the next pattern would be a forbidden one; gate_supervisor then raises stop.
-- The first position after a stop turns its gates on in one clock.  That is safe: a part of a legal pattern is
-- legal, and gate_supervisor keeps stop up for dead and minimum times.
--
-- Formats: positions as in gate_tables; times in clocks, at least 1, stable while the leg is not stopped.
-- Latency: gates move two clocks after accept when the leg has rested; stop, one clock.
-- Overflow: none; the counter stops at zero.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.gate_tables.all;

entity gate_leg is
  generic (
    FIVE_LEVEL : boolean := true -- true: ANPC leg of 8 gates, false: two-level leg of 2
  );
  port (
    clk       : in    std_logic;                                               -- rising edge
    stop      : in    std_logic;                                               -- '1': all gates off, and forget
    accept    : in    std_logic;                                               -- '1' for one clock: goal is new
    goal      : in    std_logic_vector(2 downto 0);                            -- position, 0 to 7 or bit 0
    dead_time : in    std_logic_vector(TIME_WIDTH - 1 downto 0); -- between two actions, clocks, 1 at least
    rest_time : in    std_logic_vector(TIME_WIDTH - 1 downto 0); -- after the last one, clocks, 1 at least
    legal     : out   std_logic;                                               -- '1': goal follows position
    blocked   : out   std_logic; -- '1': goal moves, but a move waits already
    resting   : out   std_logic;                                               -- '1': off or at rest, nothing to do
    refuse    : out   std_logic;                                               -- '1': the next pattern is forbidden
    gates     : out   std_logic_vector(gates_of(FIVE_LEVEL) - 1 downto 0)      -- '1': on
  );
end entity gate_leg;

architecture rtl of gate_leg is

  constant GATES_OF_LEG : positive := gates_of(FIVE_LEVEL);

  type phase_t is (STOPPED, STARTING, RESTED, ACTING);

  signal phase    : phase_t;
  signal accepted : std_logic_vector(2 downto 0);
  signal origin   : std_logic_vector(2 downto 0);
  signal target   : std_logic_vector(2 downto 0);
  signal action   : unsigned(2 downto 0);
  signal left     : unsigned(TIME_WIDTH - 1 downto 0); -- clocks until the next action may be
  -- off from configuration on, before any reset
  -- vsg_off signal_007
  signal driven   : std_logic_vector(GATES_OF_LEG - 1 downto 0) := (others => '0');
  -- vsg_on signal_007
  signal changed  : std_logic_vector(GATES_OF_LEG - 1 downto 0);
  signal act      : std_logic;
  signal waiting  : std_logic;

begin

  waiting <= '0' when phase = STOPPED or phase = STARTING or accepted = target else
             '1';

  legal   <= '1' when phase = STOPPED else
             is_edge(FIVE_LEVEL, accepted, goal);
  blocked <= '1' when (phase = STARTING or waiting = '1') and goal /= accepted else
             '0';
  resting <= '1' when phase = STOPPED or (phase = RESTED and left = 0 and waiting = '0') else
             '0';

  -- the gates after this edge, were there no stop
  p_act : process (phase, left, waiting, driven, accepted, origin, target, action) is
  begin

    act     <= '0';
    changed <= driven;

    if (phase = STARTING) then
      act     <= '1';
      changed <= pattern_of(FIVE_LEVEL, accepted);
    elsif (left = 0 and phase = RESTED and waiting = '1') then
      act     <= '1';
      changed <= driven xor action_of(FIVE_LEVEL, target, accepted, "000");
    elsif (left = 0 and phase = ACTING) then
      act     <= '1';
      changed <= driven xor action_of(FIVE_LEVEL, origin, target, action);
    end if;

  end process p_act;

  refuse <= is_forbidden(FIVE_LEVEL, changed);

  p_leg : process (clk) is
  begin

    if rising_edge(clk) then
      if (left /= 0) then
        left <= left - 1;
      end if;

      if (accept = '1') then
        accepted <= goal;

        if (phase = STOPPED) then
          phase <= STARTING;
        end if;
      end if;

      if (act = '1') then
        driven <= changed;

        if (phase = STARTING) then
          phase  <= RESTED;
          target <= accepted;
          left   <= unsigned(rest_time) - 1;
        elsif (phase = RESTED) then
          phase  <= ACTING;
          origin <= target;
          target <= accepted;
          action <= "001";
          left   <= unsigned(dead_time) - 1;
        elsif (action = last_action(FIVE_LEVEL, origin, target)) then
          phase <= RESTED;
          left  <= unsigned(rest_time) - 1;
        else
          action <= action + 1;
          left   <= unsigned(dead_time) - 1;
        end if;
      end if;

      if (stop = '1') then
        phase  <= STOPPED;
        driven <= (others => '0');
        left   <= (others => '0');
      end if;
    end if;

  end process p_leg;

  gates    <= driven;

end architecture rtl;
