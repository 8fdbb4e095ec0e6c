-- One inverter leg: takes positions, switches gates one at a time, keeps dead and minimum times.
--
-- decided makes the position of the clock before the goal.  As soon as the leg has rested, a commutation begins: its
-- single-gate actions follow each other dead_time clocks apart (gate_tables says in what order).  What can be said of
-- a position is in registers when decided comes: the way from there to the gates of all legs is short.
-- After the last action the leg rests for rest_time clocks, so that every gate stays on or off for
-- that long.  A goal that comes meanwhile waits; blocked says that a further one would be lost.
--
-- stop overrides everything, minimum on time or not; a goal of that clock is forgotten, unless admit is up: the leg
-- takes it and starts.  Gates go off in the steps of
-- gate_tables, dead_time clocks apart: those at the rails, and all of a half bridge, after the same edge.
-- With no gate at a rail on, the first step waits until no gate has changed for dead_time clocks.  All gates are off
-- after 3 dead_time + 1 clocks at most.  kill turns all gates off after the same edge, which only a leg whose state
-- cannot be relied on should need: it may overload a device.
-- Interlock: a forbidden pattern never reaches the gates.  Where it would be the next one, the gates stay as they
-- are, and refused is up in the clock after; gate_supervisor then raises stop and kill.  The gates themselves are
-- looked at too: where an upset of a flip-flop makes them a forbidden pattern, the leg turns all of them off with the
-- next edge, and refused is up.
-- The first position after a stop turns its gates on in the steps of gate_tables, dead_time clocks apart: the gates at
-- the rails last.  Where a start leads through another position, the leg rests there, too, before it goes on.  A goal
-- before all gates are off is forgotten; gate_supervisor keeps stop up for dead and minimum times.
--
-- Formats: positions as in gate_tables, of half bridges bit 0 alone; a code that is no position counts as one that
-- differs in a bit; times in clocks, at least 1, stable while the leg is not stopped.
-- Latency: gates move two clocks after decided when the leg has rested; one clock after stop, if one at a rail is on.
-- Overflow: none; the counter stops at zero.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.always_at_rail;
  use work.directmpc_math.all;
  use work.gate_tables.all;

entity gate_leg is
  generic (
    TABLED_LEG : boolean := true -- true: leg of the converter's package, false: half bridge of 2 gates
  );
  port (
    clk       : in    std_logic;                                               -- rising edge
    stop      : in    std_logic; -- '1': all gates off, step by step, and forget
    admit     : in    std_logic; -- '1': the goal of this clock counts, stop or not; with decided only, and while off
    kill      : in    std_logic; -- '1': all gates off after this edge; with stop only
    decided   : in    std_logic;                                               -- '1' for one clock: goal is new
    goal      : in    std_logic_vector(2 downto 0); -- position of the next clock's decided, 0 to 7 or bit 0
    dead_time : in    std_logic_vector(TIME_WIDTH - 1 downto 0); -- between two actions, clocks, 1 at least
    rest_time : in    std_logic_vector(TIME_WIDTH - 1 downto 0); -- after the last one, clocks, 1 at least
    legal     : out   std_logic; -- '1': goal of the clock before follows the one in force
    blocked   : out   std_logic; -- '1': it moves, but a move waits already
    waits     : out   std_logic; -- '1': a move waits to begin: a goal that moves would be blocked
    resting   : out   std_logic;                                               -- '1': off or at rest, nothing to do
    position  : out   std_logic_vector(2 downto 0); -- that the gates have or move to; from clock 2 after the first on
    refused   : out   std_logic;                                               -- '1': a forbidden pattern was to come
    off       : out   std_logic;                                               -- '1': all gates are off
    gates     : out   std_logic_vector(gates_of(TABLED_LEG) - 1 downto 0)      -- '1': on
  );
end entity gate_leg;

architecture rtl of gate_leg is

  constant GATES_OF_LEG : positive := gates_of(TABLED_LEG);

  subtype gates_t is std_logic_vector(GATES_OF_LEG - 1 downto 0);

  type phase_t is (STARTING, RESTED, ACTING);

  -- beside the phase: stop ends at this register and at few others
  signal live     : std_logic; -- not stopped
  signal phase    : phase_t;   -- of a leg that is live
  signal offered  : std_logic_vector(2 downto 0); -- goal; of a half bridge bit 0 alone
  signal asked    : std_logic_vector(2 downto 0); -- offered in the clock before
  signal accepted : std_logic_vector(2 downto 0);
  signal kept     : std_logic_vector(2 downto 0); -- accepted after this edge
  signal follows  : std_logic; -- asked is accepted, or an edge away
  signal moves    : std_logic; -- asked is not accepted
  signal origin   : std_logic_vector(2 downto 0);
  signal target   : std_logic_vector(2 downto 0);
  signal action   : unsigned(2 downto 0);
  signal first    : gates_t;   -- gate that begins the move from target to accepted
  signal further  : gates_t;   -- gate of action, which is the next one
  signal ends     : std_logic; -- action is the last of its move
  signal starts   : std_logic; -- it comes from off, and has no origin
  -- off from configuration on, before any reset
  -- vsg_off signal_007
  signal driven   : gates_t := (others => '0');
  -- vsg_on signal_007
  signal changed  : gates_t;
  signal act      : std_logic;
  signal begins   : std_logic; -- act: target becomes accepted
  signal waiting  : std_logic; -- the first gates, or a move, are still to begin
  signal forbidden : std_logic;
  signal over     : std_logic; -- the next action may be
  signal aged     : std_logic; -- no gate has changed for dead_time clocks, if none at a rail is on
  signal dark     : std_logic; -- all gates are off
  signal going    : std_logic; -- a stop is under way, or begins
  signal lowered  : gates_t;   -- gates that its next step leaves on
  signal drop     : std_logic; -- that step may be, in a stop
  signal wrong    : std_logic; -- it is forbidden
  signal upset    : std_logic; -- the gates are, as no action has made them
  signal change   : std_logic; -- gates change after this edge
  signal pause    : std_logic_vector(TIME_WIDTH - 1 downto 0);

begin

  offered <= position_of(TABLED_LEG, goal);
  kept    <= asked when decided = '1' else
             accepted;
  legal   <= follows or not live;
  waits   <= waiting;
  blocked <= waiting and moves;
  resting <= '1' when (live = '0' and dark = '1')
                      or (live = '1' and phase = RESTED and over = '1' and waiting = '0') else
             '0';

  -- the gates after this edge, were there no stop
  act     <= '1' when live = '1' and (phase = STARTING
                                      or (over = '1' and (phase = ACTING or (phase = RESTED and waiting = '1')))) else
             '0';
  changed <= start_of(TABLED_LEG, accepted, "000") when phase = STARTING else
             driven xor first when phase = RESTED else
             driven xor further;
  begins  <= act and to_std_logic(phase /= ACTING);

  forbidden <= is_forbidden(TABLED_LEG, changed);

  -- a stop: told from the gates alone, and chosen late
  dark    <= to_std_logic(unsigned(driven) = 0);
  lowered <= stop_of(TABLED_LEG, driven);
  wrong   <= is_forbidden(TABLED_LEG, lowered);
  upset   <= is_forbidden(TABLED_LEG, driven);
  drop    <= at_rail(TABLED_LEG, driven) or (aged and not dark);
  going   <= stop or not live;
  change  <= drop when going = '1' else
             act;

  -- a clock less: over is seen in the clock after the count
  pause <= std_logic_vector(unsigned(rest_time) - 1) when going = '0' and
                                                          ((phase = STARTING and
                                                            last_start(TABLED_LEG) = 0) or
                                                           (phase = ACTING and ends = '1')) else
           std_logic_vector(unsigned(dead_time) - 1);

  i_countdown : entity work.countdown
    generic map (
      WIDTH => TIME_WIDTH
    )
    port map (
      clk    => clk,
      load   => change,
      clocks => pause,
      over   => over
    );

  -- at rest some gate at a rail is on: over tells of actions alone
  g_one_age : if not TABLED_LEG or ALWAYS_AT_RAIL generate
    aged <= over;
  end generate g_one_age;

  g_own_age : if TABLED_LEG and not ALWAYS_AT_RAIL generate

    signal dead_pause : std_logic_vector(TIME_WIDTH - 1 downto 0);
    signal switches   : std_logic; -- a gate changes after this edge: a step of a start may change none

  begin

    switches   <= change and (going or to_std_logic(changed /= driven));

    dead_pause <= std_logic_vector(unsigned(dead_time) - to_unsigned(1, TIME_WIDTH));

    i_age : entity work.countdown
      generic map (
        WIDTH => TIME_WIDTH
      )
      port map (
        clk    => clk,
        load   => switches,
        clocks => dead_pause,
        over   => aged
      );

  end generate g_own_age;

  p_leg : process (clk) is
  begin

    if rising_edge(clk) then
      asked    <= offered;
      accepted <= kept;
      follows  <= is_edge(TABLED_LEG, kept, offered);
      moves    <= to_std_logic(kept /= offered);

      -- while a move waits its goal stays, or gate_supervisor stops: first stays right
      if (decided = '1') then
        first <= action_of(TABLED_LEG, target, asked, "000");

        if (live = '0' and dark = '1') then
          live  <= '1';
          phase <= STARTING;
        end if;
      end if;

      if (begins = '1') then
        waiting <= decided and moves;
      elsif (decided = '1') then
        waiting <= to_std_logic((live = '0' and dark = '1') or (live = '1' and asked /= target));
      end if;

      refused <= upset or (change and ((going and wrong) or (not going and forbidden)));

      if (going = '1') then
        if (drop = '1' and wrong = '0') then
          driven <= lowered;
        end if;
      elsif (act = '1' and forbidden = '0') then
        driven <= changed;
      end if;

      if (act = '1') then
        if (phase = STARTING) then
          phase   <= RESTED;
          target  <= first_of(TABLED_LEG, accepted);
          starts  <= '1';
          action  <= "001";
          further <= start_of(TABLED_LEG, accepted, "001");
          ends    <= to_std_logic(last_start(TABLED_LEG) = 1);

          if (last_start(TABLED_LEG) > 0) then
            phase <= ACTING;
          end if;

          -- through another position: the move to the goal waits there
          if (first_of(TABLED_LEG, accepted) /= accepted) then
            first   <= action_of(TABLED_LEG, first_of(TABLED_LEG, accepted), accepted, "000");
            waiting <= '1';
          end if;
        elsif (phase = RESTED) then
          phase   <= ACTING;
          starts  <= '0';
          origin  <= target;
          target  <= accepted;
          action  <= "001";
          further <= action_of(TABLED_LEG, target, accepted, "001");
          ends    <= to_std_logic(last_action(TABLED_LEG, target, accepted) = 1);
        elsif (ends = '1') then
          phase <= RESTED;
        else
          action  <= action + 1;
          further <= action_of(TABLED_LEG, origin, target, action + 1);
          ends    <= to_std_logic(last_action(TABLED_LEG, origin, target) = action + 1);

          if (starts = '1') then
            further <= start_of(TABLED_LEG, target, action + 1);
            ends    <= to_std_logic(action + 1 = last_start(TABLED_LEG));
          end if;
        end if;
      end if;

      if (stop = '1' and admit = '0') then
        live    <= '0';
        waiting <= '0';
      end if;

      if (kill = '1' or upset = '1') then
        driven <= (others => '0');
      end if;
    end if;

  end process p_leg;

  off      <= dark;
  position <= target;
  gates    <= driven;

end architecture rtl;
