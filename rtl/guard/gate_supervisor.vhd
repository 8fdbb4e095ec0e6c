-- Decides when gates may be on: enable, trips, watchdogs, legality.  Latches the faults.
--
-- States: off; armed, all gates still off, a first decision is waited for; running.  From off to armed it
-- takes enable to rise after a reset or a fault, no fault latched, and that the gates have been off for the
-- dead and both minimum times.  Any fault leads to off: stop is up in the very clock of the cause, the
-- gates are off after its edge, the codes of that clock are latched and no later ones.  enable = '0' leads
-- to off too, and is no fault.
--
-- late: no decision within decision_limit clocks after the one that follows start.  missing: none within
-- watchdog clocks after arming or the decision before.  Both and the trips count whenever enable is up and
-- no fault is latched, also before the gates have been off long enough, so that a drive that cannot run
-- shows its fault.
--
-- Formats: times in clocks. Dead time below LEAST_DEAD_TIME is raised to it. dead_time, minimum_on and
-- minimum_off are read while off only, decision_limit at start, watchdog at each decision.
-- Latency: stop and accept are combinational; faults one clock.
-- Overflow: none; counters stop at their ends.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.gate_tables.all;

entity gate_supervisor is
  generic (
    LEAST_DEAD_TIME : positive range 1 to 4095 := 10 -- clocks; shorter dead times are raised to it
  );
  port (
    clk            : in    std_logic;                                   -- rising edge
    rst            : in    std_logic;                                   -- synchronous, active high
    enable         : in    std_logic;                                   -- '1': gates may be on
    start          : in    std_logic;                                   -- '1' for one clock: a decision has begun
    decided        : in    std_logic;                                   -- '1' for one clock: a decision is there
    legal          : in    std_logic;                                   -- '1': all its moves are edges
    blocked        : in    std_logic;                                   -- '1': it moves a leg that waits to move
    refuse         : in    std_logic;                                   -- '1': the next pattern of a leg is forbidden
    trips          : in    std_logic_vector(3 downto 0);                -- causes of faults 3 to 0, gate_tables
    clear          : in    std_logic_vector(FAULT_COUNT - 1 downto 0);  -- '1': forget this fault
    dead_time      : in    std_logic_vector(TIME_WIDTH - 1 downto 0);   -- unsigned, clocks
    minimum_on     : in    std_logic_vector(TIME_WIDTH - 1 downto 0);   -- unsigned, clocks
    minimum_off    : in    std_logic_vector(TIME_WIDTH - 1 downto 0);   -- unsigned, clocks
    decision_limit : in    std_logic_vector(LIMIT_WIDTH - 1 downto 0);  -- unsigned, clocks
    watchdog       : in    std_logic_vector(LIMIT_WIDTH - 1 downto 0);  -- unsigned, clocks
    stop           : out   std_logic;                                   -- '1': all gates off after this edge
    accept         : out   std_logic;                                   -- '1': legs take the decision
    dead_now       : out   std_logic_vector(TIME_WIDTH - 1 downto 0);   -- dead time in force, clocks
    rest_now       : out   std_logic_vector(TIME_WIDTH - 1 downto 0);   -- the longer minimum time, clocks
    running        : out   std_logic;                                   -- '1': gates follow decisions
    faults         : out   std_logic_vector(FAULT_COUNT - 1 downto 0)   -- latched, bits as in gate_tables
  );
end entity gate_supervisor;

architecture rtl of gate_supervisor is

  subtype clocks_t is unsigned(TIME_WIDTH - 1 downto 0);

  subtype limit_t is unsigned(LIMIT_WIDTH - 1 downto 0);

  type state_t is (OFF, ARMED, ACTIVE);

  signal state     : state_t;
  signal primed    : std_logic; -- enable has been down since the reset or the last fault
  signal wanted    : std_logic;
  signal expected  : std_logic; -- a decision has begun
  signal late_left : limit_t;
  signal dog_left  : limit_t;
  signal off_for   : clocks_t;
  signal dead      : clocks_t;
  signal rest      : clocks_t;
  signal latched   : std_logic_vector(FAULT_COUNT - 1 downto 0);
  signal arming    : std_logic;
  signal causes    : std_logic_vector(FAULT_COUNT - 1 downto 0);
  signal fault     : std_logic;
  signal halt      : std_logic;

  function or_of (bits : std_logic_vector) return std_logic is

    variable result : std_logic;

  begin

    result := '0';

    for i in bits'range loop
      result := result or bits(i);
    end loop;

    return result;

  end function or_of;

  function larger (a, b : unsigned) return unsigned is
  begin

    if (a > b) then
      return a;
    else
      return b;
    end if;

  end function larger;

begin

  wanted <= enable and primed and not or_of(latched);

  p_causes : process (wanted, state, trips, decided, legal, blocked, refuse, expected, late_left, dog_left) is
  begin

    causes <= (others => '0');

    if (wanted = '1') then
      causes(3 downto 0)    <= trips;
      causes(FAULT_LATE)    <= expected and not decided and to_std_logic(late_left = 0);
      causes(FAULT_MISSING) <= to_std_logic(state /= OFF and dog_left = 0) and not decided;
      -- in any state: no pattern depends on legs and states being in step
      causes(FAULT_INTERLOCK) <= refuse;
    end if;

    if (wanted = '1' and state = ACTIVE) then
      causes(FAULT_ILLEGAL) <= decided and not legal;
      causes(FAULT_OVERRUN) <= decided and blocked;
    end if;

  end process p_causes;

  fault <= or_of(causes);
  arming <= wanted and not fault and to_std_logic(state = OFF and off_for >= dead and off_for >= rest);

  halt  <= '1' when rst = '1' or wanted = '0' or fault = '1' or (state /= ARMED and state /= ACTIVE) else
           '0';

  p_state : process (clk) is

    variable limited : clocks_t;

  begin

    if rising_edge(clk) then
      latched <= (latched and not clear) or causes;

      if (enable = '0' and or_of(latched) = '0') then
        primed <= '1';
      elsif (fault = '1') then
        primed <= '0';
      end if;

      -- decisions in time
      if (decided = '1' or wanted = '0') then
        expected <= '0';
      end if;

      if (late_left /= 0) then
        late_left <= late_left - 1;
      end if;

      if (start = '1' and wanted = '1' and (expected = '0' or decided = '1')) then
        expected  <= '1';
        late_left <= unsigned(decision_limit);
      end if;

      if (dog_left /= 0) then
        dog_left <= dog_left - 1;
      end if;

      if (decided = '1' or state = OFF) then
        dog_left <= unsigned(watchdog);
      end if;

      -- times, as long as nothing depends on them
      if (state = OFF) then
        limited := unsigned(dead_time);

        if (limited < LEAST_DEAD_TIME) then
          limited := to_unsigned(LEAST_DEAD_TIME, TIME_WIDTH);
        end if;

        -- what arming has looked at is what stays in force
        if (arming = '0') then
          dead <= limited;
          rest <= larger(larger(unsigned(minimum_on), unsigned(minimum_off)), to_unsigned(1, TIME_WIDTH));
        end if;

        if (off_for /= (off_for'range => '1')) then
          off_for <= off_for + 1;
        end if;
      else
        off_for <= (others => '0');
      end if;

      case state is

        when OFF =>

          if (arming = '1') then
            state <= ARMED;
          end if;

        when ARMED =>

          if (decided = '1') then
            state <= ACTIVE;
          end if;

        when others =>

          null;

      end case;

      if (state /= OFF and halt = '1') then
        state <= OFF;
      end if;

      if (rst = '1') then
        state    <= OFF;
        primed   <= '0';
        expected <= '0';
        latched  <= (others => '0');
        off_for  <= (others => '0');
        dead     <= (others => '1');
        rest     <= (others => '1');
      end if;
    end if;

  end process p_state;

  -- legs stay stopped until the first decision
  stop        <= halt or (to_std_logic(state = ARMED) and not decided);
  accept      <= decided and not halt;
  dead_now    <= std_logic_vector(dead);
  rest_now    <= std_logic_vector(rest);
  running     <= to_std_logic(state = ACTIVE);
  faults      <= latched;

end architecture rtl;
