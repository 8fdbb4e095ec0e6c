-- Decides when gates may be on: enable, trips, watchdogs, legality.  Latches the faults.
--
-- States: off; armed, all gates still off, a first decision is waited for; running.  From off to armed it
-- takes enable to rise after a reset or a fault, no fault latched, and that the gates have been off for the
-- dead and both minimum times.  From armed to running it takes a decision and, before it, a measurement that was
-- taken and compared since enable rose and since the settings changed last.  Any fault leads to off: stop is up in
-- the very clock of the cause, legs begin to go off with its edge, the codes of that clock are latched and, but for a
-- refused pattern, no later ones.  enable = '0' leads to off too, and is no fault.  kill is up with rst and with a
-- refused pattern: legs that are in no known state go off at once.
--
-- late: no decision within decision_limit clocks after the one that follows start.  missing: none within
-- watchdog clocks after arming or the decision before.  Both and the trips count whenever enable is up and
-- no fault is latched, also before the gates have been off long enough, so that a drive that cannot run
-- shows its fault.
--
-- The times in force have a parity bit.  When an upset has changed one of them, the fault upset follows one clock
-- later.  Meanwhile they are read anew from the ports, so that the stop has its dead time.
--
-- Formats: times in clocks. Dead time below LEAST_DEAD_TIME is raised to it. dead_time, minimum_on and
-- minimum_off are read while off and with all gates off only, or after an upset, decision_limit at start, watchdog at
-- each decision.
-- Latency: stop, admit, kill and forget are combinational; faults one clock.
-- Overflow: none; counters stop at their ends.
-- Considered and rejected: rtl/alternatives.md.
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
    refused        : in    std_logic;                                   -- '1': a leg has refused a pattern
    dark           : in    std_logic;                                   -- '1': all gates are off
    trips          : in    std_logic_vector(3 downto 0);                -- causes of faults 3 to 0, gate_tables
    bands          : in    std_logic_vector(5 downto 0);                -- causes of faults 14 to 9
    checked        : in    std_logic;                                   -- '1': a measurement has been compared
    renew          : in    std_logic;                                   -- '1': settings change after this clock
    clear          : in    std_logic_vector(FAULT_COUNT - 1 downto 0);  -- '1': forget this fault
    dead_time      : in    std_logic_vector(TIME_WIDTH - 1 downto 0);   -- unsigned, clocks
    minimum_on     : in    std_logic_vector(TIME_WIDTH - 1 downto 0);   -- unsigned, clocks
    minimum_off    : in    std_logic_vector(TIME_WIDTH - 1 downto 0);   -- unsigned, clocks
    decision_limit : in    std_logic_vector(LIMIT_WIDTH - 1 downto 0);  -- unsigned, clocks
    watchdog       : in    std_logic_vector(LIMIT_WIDTH - 1 downto 0);  -- unsigned, clocks
    stop           : out   std_logic;                                   -- '1': legs go off, step by step
    admit          : out   std_logic;                                   -- '1': but start: this decision is the first
    kill           : out   std_logic;                                   -- '1': legs are off after this edge
    forget         : out   std_logic;                                   -- '1': comparisons under way do not count
    dead_now       : out   std_logic_vector(TIME_WIDTH - 1 downto 0);   -- dead time in force, clocks
    rest_now       : out   std_logic_vector(TIME_WIDTH - 1 downto 0);   -- the longer minimum time, clocks
    running        : out   std_logic;                                   -- '1': gates follow decisions
    live           : out   std_logic;                                   -- '1': enabled, without a fault
    faults         : out   std_logic_vector(FAULT_COUNT - 1 downto 0)   -- latched, bits as in gate_tables
  );
end entity gate_supervisor;

architecture rtl of gate_supervisor is

  subtype clocks_t is unsigned(TIME_WIDTH - 1 downto 0);

  -- two flags and no enumeration: a cause ends at them, without a decoder behind it
  signal armed     : std_logic;
  signal active    : std_logic;
  signal is_off    : std_logic; -- neither
  signal quiet     : std_logic; -- and all gates are off
  signal primed    : std_logic; -- enable has been down since the reset or the last fault
  signal wanted    : std_logic;
  signal compared  : std_logic; -- measurements are inside the limits in force, as far as is known
  signal expected  : std_logic; -- a decision has begun
  signal begins    : std_logic; -- the one that begins is watched
  signal late      : std_logic;
  signal lapsed    : std_logic; -- a time has run out, unless a decision comes now
  signal begun     : std_logic; -- from armed to running, were there no cause against it
  signal starved   : std_logic; -- watchdog clocks without a decision
  signal fed       : std_logic;
  signal off_for   : clocks_t;
  signal dead      : clocks_t;
  signal rest      : clocks_t;
  signal latched   : std_logic_vector(FAULT_COUNT - 1 downto 0);
  signal faulty    : std_logic; -- a fault is latched
  signal rested    : std_logic; -- gates have been off long enough
  signal parity    : std_logic; -- of dead and rest, as they were read
  signal differs   : std_logic; -- they have another one
  signal altered   : std_logic; -- they had, a clock ago
  signal events    : std_logic_vector(FAULT_COUNT - 1 downto 0); -- what would be a fault with enable up
  signal any_event : std_logic;
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

  function parity_of (bits : unsigned) return std_logic is

    variable result : std_logic;

  begin

    result := '0';

    for i in bits'range loop
      result := result xor bits(i);
    end loop;

    return result;

  end function parity_of;

  function larger (a, b : unsigned) return unsigned is
  begin

    if (a > b) then
      return a;
    else
      return b;
    end if;

  end function larger;

begin

  wanted <= enable and primed and not faulty;
  forget <= renew or not wanted;

  is_off <= not (armed or active);
  quiet  <= is_off and dark;
  differs <= parity xor parity_of(dead & rest);

  lapsed <= (expected and late) or (starved and not is_off);

  p_events : process (active, is_off, trips, bands, decided, legal, blocked, expected, late, starved, altered) is
  begin

    events                <= (others => '0');
    events(3 downto 0)    <= trips;
    events(14 downto 9)   <= bands;
    events(FAULT_UPSET)   <= bands(FAULT_UPSET - 9) or altered;
    events(FAULT_LATE)    <= expected and not decided and late;
    events(FAULT_MISSING) <= starved and not is_off and not decided;
    if (active = '1') then
      events(FAULT_ILLEGAL) <= decided and not legal;
      events(FAULT_OVERRUN) <= decided and blocked;
    end if;

  end process p_events;

  -- whether there is any of them, told anew from what comes late
  any_event <= or_of(trips) or or_of(bands) or altered or refused or (lapsed and not decided)
               or (active and decided and (blocked or not legal));

  p_causes : process (events, wanted, refused) is
  begin

    causes <= (others => '0');

    if (wanted = '1') then
      causes <= events;
    end if;

    -- in any state: no pattern depends on legs and states being in step
    causes(FAULT_INTERLOCK) <= refused;

  end process p_causes;

  fault  <= (any_event and wanted) or refused;
  rested <= wanted and quiet and to_std_logic(off_for >= dead and off_for >= rest);

  begins <= start and wanted and (decided or not expected);

  i_late : entity work.countdown
    generic map (
      WIDTH => LIMIT_WIDTH
    )
    port map (
      clk    => clk,
      load   => begins,
      clocks => decision_limit,
      over   => late
    );

  fed <= decided or is_off;

  i_starved : entity work.countdown
    generic map (
      WIDTH => LIMIT_WIDTH
    )
    port map (
      clk    => clk,
      load   => fed,
      clocks => watchdog,
      over   => starved
    );

  -- not wanted is a halt of its own, so the way from an event to the gates need not know it
  halt <= rst or not wanted or any_event;

  p_state : process (clk) is

    variable limited : clocks_t;
    variable longest : clocks_t;

  begin

    if rising_edge(clk) then
      latched <= (latched and not clear) or causes;
      faulty  <= or_of(latched and not clear) or fault;

      if (fault = '1') then
        primed <= '0';
      elsif (enable = '0' and faulty = '0') then
        primed <= '1';
      end if;

      if (wanted = '0' or renew = '1') then
        compared <= '0';
      elsif (checked = '1') then
        compared <= '1';
      end if;

      if (begins = '1') then
        expected <= '1';
      elsif (decided = '1' or wanted = '0') then
        expected <= '0';
      end if;

      limited := unsigned(dead_time);
      longest := larger(larger(unsigned(minimum_on), unsigned(minimum_off)), to_unsigned(1, TIME_WIDTH));

      if (limited < LEAST_DEAD_TIME) then
        limited := to_unsigned(LEAST_DEAD_TIME, TIME_WIDTH);
      end if;

      -- times, as long as nothing depends on them; what arming has looked at is what stays in force
      altered <= differs;

      if ((quiet = '1' and rested = '0') or differs = '1') then
        dead   <= limited;
        rest   <= longest;
        parity <= parity_of(limited & longest);
      end if;

      if (quiet = '1') then
        if (off_for /= (off_for'range => '1')) then
          off_for <= off_for + 1;
        end if;
      else
        off_for <= (others => '0');
      end if;

      if (rested = '1') then
        armed <= '1';
      elsif (begun = '1') then
        armed <= '0';
      end if;

      if (armed = '1' and begun = '1') then
        active <= '1';
      end if;

      if (halt = '1') then
        armed  <= '0';
        active <= '0';
      end if;

      if (rst = '1') then
        primed   <= '0';
        compared <= '0';
        expected <= '0';
        latched  <= (others => '0');
        faulty   <= '0';
        off_for  <= (others => '0');
        dead     <= (others => '1');
        rest     <= (others => '1');
        parity   <= '0'; -- of an even number of ones
        altered  <= '0';
      end if;
    end if;

  end process p_state;

  -- Legs stay stopped in the clock of the first decision that counts, too: it comes late, and many registers of a leg
  -- depend on stop.
  begun       <= decided and compared and not renew;
  stop        <= halt or not active;
  admit       <= armed and begun and not halt;
  kill        <= rst or refused;
  dead_now    <= std_logic_vector(dead);
  rest_now    <= std_logic_vector(rest);
  running     <= active;
  live        <= wanted;
  faults      <= latched;

end architecture rtl;
