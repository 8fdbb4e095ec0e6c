-- Gate guard with its safety properties, as logic: violations is zero or the guard is wrong.
--
-- Written against docs/gate-guard.md and not against the RTL.  What a converter's leg is stands in its package; how its
-- tables are to be followed is told anew.
-- It is synthesisable, so that the same text serves a simulation of millions of clocks and a proof.
--
--   0  no pattern of gates that is forbidden: it shorts a source, or overloads a device
--   1  dead time: nor with the gates that were on in the last dead-time clocks
--   2  minimum on time, but in a stop
--   3  minimum off time, but in a stop
--   4  whole positions follow one another along edges only
--   5  all gates off after the edge of a reset and with a refused pattern; the gates at the rails, those that
--      a stop turns off at once, off after the edge of an external trip, enable = '0' or an illegal
--      decision, and three clocks later after that of a measurement beyond a limit that stays where it is meanwhile
--   6  gates at the rails are on only while running and without a fault
--   7  running begins only after enable has been down since the last reset or fault
--   8  no decision for watchdog + 1 clocks: off
--   9  running begins only after a measurement inside the limits, taken since enable was down, a fault was latched
--      and the settings changed
--  10  all gates are off the longest stop of the table after running has ended, of half bridges at once
--  11  a stop takes the steps of the table; where no gate at a rail is on, a step comes when no gate has changed for a
--      dead time.  A reset and a refused pattern keep no order
--  12  while running, gates change as the tables of starts and commutations say, step by step; within one, a step comes
--      when no gate has changed for a dead time
--  11 and 12 do not speak of half bridges: with all gates at the rails, 0, 1 and 5 say it all.
--  13  no decision within decision_limit + 1 clocks of the start that began it: off
-- Times in force are not seen from outside: the shortest that was asked for since all gates went off is taken, and
-- LEAST_DEAD_TIME; for property 10 the longest.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.converter_leg.all;
  use directmpc.directmpc_math.all;
  use directmpc.gate_tables.all;

entity gate_guard_checked is
  generic (
    TABLED_LEG        : boolean                  := true; -- this and all that follows as gate_guard's
    LEAST_DEAD_TIME   : positive range 1 to 4095 := 2;    -- clocks
    SECOND_SUPERVISOR : boolean                  := false -- true: two, compared
  );
  port (
    clk            : in    std_logic;                     -- rising edge
    rst            : in    std_logic;                     -- synchronous, active high; first clock
    enable         : in    std_logic;                     -- this and all that follows as gate_guard's
    external_trip  : in    std_logic;                     -- '1': all gates off
    driver_fault   : in    std_logic;                     -- '1': all gates off
    upset          : in    std_logic;                     -- '1': all gates off
    clear          : in    std_logic_vector(14 downto 0); -- '1': forget this fault
    measured       : in    std_logic;                     -- '1': new measurements
    is_alpha       : in    std_logic_vector(15 downto 0); -- signed
    is_beta        : in    std_logic_vector(15 downto 0); -- signed
    v_dc           : in    std_logic_vector(15 downto 0); -- unsigned
    start          : in    std_logic;                     -- '1': a decision has begun
    decided        : in    std_logic;                     -- '1': the positions of the clock before are a decision
    position_a     : in    std_logic_vector(2 downto 0);  -- position, a clock before decided
    position_b     : in    std_logic_vector(2 downto 0);  -- position, a clock before decided
    position_c     : in    std_logic_vector(2 downto 0);  -- position, a clock before decided
    renew          : in    std_logic;                     -- '1': settings change after this clock
    dead_time      : in    std_logic_vector(11 downto 0); -- clocks
    minimum_on     : in    std_logic_vector(11 downto 0); -- clocks
    minimum_off    : in    std_logic_vector(11 downto 0); -- clocks
    decision_limit : in    std_logic_vector(15 downto 0); -- clocks
    watchdog       : in    std_logic_vector(15 downto 0); -- clocks
    current_limit  : in    std_logic_vector(15 downto 0); -- unsigned
    link_high      : in    std_logic_vector(15 downto 0); -- unsigned
    link_low       : in    std_logic_vector(15 downto 0); -- unsigned
    v_n            : in    std_logic_vector(15 downto 0); -- signed
    v_ph_a         : in    std_logic_vector(15 downto 0); -- unsigned
    v_ph_b         : in    std_logic_vector(15 downto 0); -- unsigned
    v_ph_c         : in    std_logic_vector(15 downto 0); -- unsigned
    omega_r        : in    std_logic_vector(15 downto 0); -- signed
    v_ph_high      : in    std_logic_vector(15 downto 0); -- unsigned
    v_ph_low       : in    std_logic_vector(15 downto 0); -- unsigned
    v_n_limit      : in    std_logic_vector(15 downto 0); -- unsigned
    speed_limit    : in    std_logic_vector(15 downto 0); -- unsigned
    frozen_limit   : in    std_logic_vector(7 downto 0);  -- unsigned
    gates          : out   std_logic_vector(23 downto 0); -- '1': on
    running        : out   std_logic;                     -- '1': gates follow decisions
    faults         : out   std_logic_vector(14 downto 0); -- latched
    goals          : out   std_logic_vector(8 downto 0);  -- positions accepted last, for a stimulus
    violations     : out   std_logic_vector(13 downto 0)  -- '1': a property does not hold
  );
end entity gate_guard_checked;

architecture rtl of gate_guard_checked is

  constant SIZE  : positive := gates_of(TABLED_LEG);
  constant COUNT : positive := 3 * SIZE;
  constant WHOLES : positive := choose(TABLED_LEG, POSITIONS, 2);

  subtype age_t is unsigned(12 downto 0);

  type ages_t is array (0 to COUNT - 1) of age_t;

  signal g       : std_logic_vector(COUNT - 1 downto 0);
  signal now_on  : std_logic;
  signal latched : std_logic_vector(14 downto 0);
  signal known   : std_logic := '0'; -- there has been a reset
  signal earlier : std_logic_vector(COUNT - 1 downto 0);
  signal was_on  : std_logic;
  signal ages    : ages_t;           -- clocks since the gate changed
  signal floor_dead : unsigned(11 downto 0);
  signal most_dead  : unsigned(11 downto 0);
  signal floor_on   : unsigned(11 downto 0);
  signal floor_off  : unsigned(11 downto 0);
  signal must_stop : std_logic;
  signal cut       : std_logic;             -- the last edge was a reset's
  signal since     : unsigned(14 downto 0); -- clocks since running has ended
  signal beyond    : std_logic_vector(2 downto 0);  -- current or link beyond a limit one, two and three clocks ago
  signal astray    : std_logic_vector(2 downto 0);  -- capacitors, neutral point or speed, likewise
  signal limits    : std_logic_vector(47 downto 0); -- a clock ago
  signal vetted    : std_logic;        -- a measurement since enable, fault and renew was inside the limits
  signal fresh     : std_logic;        -- enable has been down since the last reset or fault
  signal whole     : positions_t;      -- last whole position of each leg
  signal entered   : std_logic_vector(2 downto 0);
  signal offered   : positions_t;      -- positions of the clock before
  signal wanted    : positions_t;      -- positions accepted last
  signal hungry    : unsigned(16 downto 0);
  signal wakeful   : std_logic;              -- starts are watched
  signal awaited   : std_logic;              -- a decision has begun and is not there
  signal due       : unsigned(16 downto 0);  -- clocks until it has to be
  signal found     : std_logic_vector(13 downto 0);

  -- gates before a step and behind it; the same where there is none
  type steps_t is array (natural range 0 to 8 * START_GROUPS'length + 32 * MOVE_GATES'length(2) - 1) of
    std_logic_vector(2 * leg_gates_t'length - 1 downto 0);

  -- steps of starts and of commutations
  function steps_of_tables return steps_t is

    variable steps : steps_t;
    variable n     : natural;
    variable goal  : natural;
    variable row   : natural;
    variable edge  : std_logic_vector(5 downto 0);
    variable on_0  : leg_gates_t;
    variable on_1  : leg_gates_t;

  begin

    steps := (others => (others => '0'));
    n     := 0;

    for s in 0 to POSITIONS - 1 loop
      if (not HAS_START_THROUGH or unsigned(START_THROUGH) = s) then
        on_0 := (others => '0');

        for k in START_GROUPS'range loop
          on_1     := on_0 or (PATTERNS(s) and START_GROUPS(k));
          steps(n) := on_0 & on_1;
          on_0     := on_1;
          n        := n + 1;
        end loop;
      end if;

      for i in 0 to 3 loop
        goal := NEXT_POSITIONS(s, i);

        if (goal /= s) then
          edge := std_logic_vector(to_unsigned(s, 3) xor to_unsigned(goal, 3)) & std_logic_vector(to_unsigned(s, 3));
          row  := 0;

          for k in MOVE_CARE'high downto 0 loop
            if (unsigned((edge xor MOVE_VALUE(k)) and MOVE_CARE(k)) = 0) then
              row := k;
            end if;
          end loop;

          on_0 := PATTERNS(s);

          for k in 0 to MOVE_LAST(row) loop
            on_1                     := on_0;
            on_1(MOVE_GATES(row, k)) := not on_0(MOVE_GATES(row, k));
            steps(n)                 := on_0 & on_1;
            on_0                     := on_1;
            n                        := n + 1;
          end loop;
        end if;
      end loop;
    end loop;

    return steps;

  end function steps_of_tables;

  constant STEPS : steps_t := steps_of_tables;

  -- whether one pattern follows another one while running
  function is_step (s, t : std_logic_vector) return boolean is

    variable result : boolean;

  begin

    result := false;

    for n in STEPS'range loop
      result := result or STEPS(n) = s & t;
    end loop;

    return result;

  end function is_step;

  -- gates that a step of a stop leaves on
  function stopped (s : std_logic_vector) return std_logic_vector is

    variable result : leg_gates_t;

  begin

    result := (others => '0');

    for i in STOP_RULES'high(1) downto 0 loop
      if ((s and STOP_RULES(i, 0)) = STOP_RULES(i, 0) and unsigned(s and STOP_RULES(i, 1)) = 0) then
        result := s xor STOP_RULES(i, 2);
      end if;
    end loop;

    return result;

  end function stopped;

  -- the pattern that may never be
  function shorts (s : std_logic_vector) return boolean is

    variable result : boolean;

  begin

    result := s = (s'range => '1');

    if (TABLED_LEG) then
      result := false;

      for i in FORBIDDEN'range loop
        result := result or (s and FORBIDDEN(i)) = FORBIDDEN(i);
      end loop;
    end if;

    return result;

  end function shorts;

  -- gates of a position, the last one leftmost
  function full (position : natural) return std_logic_vector is
  begin

    if (TABLED_LEG) then
      return PATTERNS(position);
    elsif (position = 1) then
      return "01";
    else
      return "10";
    end if;

  end function full;

  -- an edge apart, or the same
  function follows (a, b : unsigned(2 downto 0)) return boolean is

    variable result : boolean;

  begin

    result := not TABLED_LEG;

    for s in 0 to POSITIONS - 1 loop
      for i in 0 to 3 loop
        result := result or (a = s and b = NEXT_POSITIONS(s, i));
      end loop;
    end loop;

    return result;

  end function follows;

  -- position that a code stands for
  function meant (code : std_logic_vector(2 downto 0)) return unsigned is
  begin

    if (TABLED_LEG) then
      return unsigned(POSITION_OF_CODE(to_integer(unsigned(code))));
    else
      return unsigned(code);
    end if;

  end function meant;

  -- what cannot be exceeded is exceeded by every measurement
  function trip_of (alpha, beta, limit, volts, high, low : std_logic_vector(15 downto 0)) return boolean is

    variable a : signed(26 downto 0);
    variable b : signed(26 downto 0);
    variable l : signed(26 downto 0);

  begin

    a := resize(signed(alpha) * to_signed(64, 9), 27);
    b := resize(signed(beta) * to_signed(111, 9), 27);
    l := signed(resize(unsigned(limit), 27));
    l := shift_left(l, 7);
    return a + a > l or a + a < -l or b - a > l or b - a < -l or b + a > l or b + a < -l
           or unsigned(volts) > unsigned(high) or unsigned(volts) < unsigned(low)
           or unsigned(limit) > 32766 or unsigned(high) > 65534;

  end function trip_of;

  -- whether a gate at a rail is on
  function rail (s : std_logic_vector) return boolean is
  begin

    if (TABLED_LEG) then
      return not (unsigned(s and RAIL_GATES) = 0);
    else
      return unsigned(s) /= 0;
    end if;

  end function rail;

  -- dead times of the longest stop; without a gate at a rail its first step waits for one
  function stop_times return natural is

    variable most : natural;
    variable n    : natural;
    variable on_0 : leg_gates_t;

  begin

    most := 0;

    for i in STEPS'range loop
      on_0 := STEPS(i)(leg_gates_t'range);
      n    := choose(rail(on_0), 0, 1);

      -- no stop turns more gates on and off
      for k in natural range 1 to 2 * leg_gates_t'length loop
        if (not (unsigned(on_0) = 0)) then
          on_0 := stopped(on_0);
          n    := n + 1;
        end if;
      end loop;

      if (n > most + 1) then
        most := n - 1;
      end if;
    end loop;

    return most;

  end function stop_times;

  -- the same of what else has a band
  function outside (
    a, b, c, high, low, n, n_limit, omega, omega_limit : std_logic_vector(15 downto 0)
  ) return boolean is

    variable result : boolean;

  begin

    result := signed(omega(15) & omega) > signed('0' & omega_limit)
             or signed(omega(15) & omega) < -signed('0' & omega_limit) or unsigned(omega_limit) > 32766;

    if (TABLED_LEG and HAS_CAPACITORS) then
      result := result or unsigned(a) > unsigned(high) or unsigned(b) > unsigned(high) or unsigned(c) > unsigned(high)
               or unsigned(a) < unsigned(low) or unsigned(b) < unsigned(low) or unsigned(c) < unsigned(low)
               or unsigned(high) > 65534;
    end if;

    if (TABLED_LEG and HAS_NEUTRAL) then
      result := result or signed(n(15) & n) > signed('0' & n_limit)
               or signed(n(15) & n) < -signed('0' & n_limit) or unsigned(n_limit) > 32766;
    end if;

    return result;

  end function outside;

  function smaller (a, b : unsigned) return unsigned is
  begin

    if (a < b) then
      return a;
    else
      return b;
    end if;

  end function smaller;

begin

  i_guard : entity directmpc.gate_guard
    generic map (
      TABLED_LEG        => TABLED_LEG,
      LEAST_DEAD_TIME   => LEAST_DEAD_TIME,
      SECOND_SUPERVISOR => SECOND_SUPERVISOR
    )
    port map (
      clk            => clk,
      rst            => rst,
      enable         => enable,
      external_trip  => external_trip,
      driver_fault   => driver_fault,
      upset          => upset,
      clear          => clear,
      measured       => measured,
      is_alpha       => is_alpha,
      is_beta        => is_beta,
      v_dc           => v_dc,
      start          => start,
      decided        => decided,
      position_a     => position_a,
      position_b     => position_b,
      position_c     => position_c,
      renew          => renew,
      dead_time      => dead_time,
      minimum_on     => minimum_on,
      minimum_off    => minimum_off,
      decision_limit => decision_limit,
      watchdog       => watchdog,
      current_limit  => current_limit,
      link_high      => link_high,
      link_low       => link_low,
      v_n            => v_n,
      v_ph_a         => v_ph_a,
      v_ph_b         => v_ph_b,
      v_ph_c         => v_ph_c,
      omega_r        => omega_r,
      v_ph_high      => v_ph_high,
      v_ph_low       => v_ph_low,
      v_n_limit      => v_n_limit,
      speed_limit    => speed_limit,
      frozen_limit   => frozen_limit,
      gates          => g,
      running        => now_on,
      resting        => open,
      faults         => latched
    );

  wakeful <= not rst and enable and fresh and to_std_logic(latched = (latched'range => '0'));

  p_history : process (clk) is

    variable tripped : boolean;
    variable strayed : boolean;

  begin

    if rising_edge(clk) then
      if (rst = '1') then
        known <= '1';
      end if;

      earlier <= g;
      was_on  <= now_on;

      for i in 0 to COUNT - 1 loop
        if (rst = '1' and known = '0') then
          ages(i) <= (others => '1');
        elsif (g(i) /= earlier(i)) then
          ages(i) <= to_unsigned(1, age_t'length);
        elsif (ages(i) /= (age_t'range => '1')) then
          ages(i) <= ages(i) + 1;
        end if;
      end loop;

      -- what may be in force, from the first clock with all gates off on
      if (rst = '1' or (now_on = '0' and g = (g'range => '0') and earlier /= (earlier'range => '0'))) then
        floor_dead <= unsigned(dead_time);
        most_dead  <= unsigned(dead_time);
        floor_on   <= unsigned(minimum_on);
        floor_off  <= unsigned(minimum_off);
      elsif (now_on = '0' and g = (g'range => '0')) then
        if (most_dead < unsigned(dead_time)) then
          most_dead <= unsigned(dead_time);
        end if;

        floor_dead <= smaller(floor_dead, unsigned(dead_time));
        floor_on   <= smaller(floor_on, unsigned(minimum_on));
        floor_off  <= smaller(floor_off, unsigned(minimum_off));
      end if;

      offered(0) <= meant(position_a);
      offered(1) <= meant(position_b);
      offered(2) <= meant(position_c);

      cut <= rst;

      if (now_on = '1') then
        since <= (others => '0');
      elsif (since /= (since'range => '1')) then
        since <= since + 1;
      end if;

      must_stop <= rst or external_trip or driver_fault or upset or not enable or beyond(2) or astray(2);
      limits    <= current_limit & link_high & link_low;
      vetted    <= vetted and enable and not renew;
      beyond    <= beyond(1 downto 0) & '0';
      astray    <= astray(1 downto 0) & '0';

      if (measured = '1') then
        tripped := trip_of(is_alpha, is_beta, current_limit, v_dc, link_high, link_low);
        strayed := outside(v_ph_a, v_ph_b, v_ph_c, v_ph_high, v_ph_low, v_n, v_n_limit, omega_r, speed_limit);
        beyond(0) <= to_std_logic(tripped);
        astray(0) <= to_std_logic(strayed);

        if (not (tripped or strayed) and enable = '1' and renew = '0') then
          vetted <= '1';
        end if;
      end if;

      if (limits /= (current_limit & link_high & link_low)) then
        beyond(2 downto 1) <= "00";
      end if;

      if (rst = '1' or latched /= (latched'range => '0')) then
        vetted <= '0';
        beyond <= "000";
        astray <= "000";
      end if;

      for x in 0 to 2 loop
        if (now_on = '1' and decided = '1' and not follows(wanted(x), offered(x))) then
          must_stop <= '1';
        end if;

        -- the first of a run is free; what is refused stops everything, so this may be wrong then
        if (decided = '1') then
          wanted(x) <= offered(x);
        end if;

        entered(x) <= entered(x) and now_on;

        for s in 0 to WHOLES - 1 loop
          if (now_on = '1' and g((x + 1) * SIZE - 1 downto x * SIZE) = full(s)) then
            whole(x)   <= to_unsigned(s, 3);
            entered(x) <= '1';
          end if;
        end loop;
      end loop;

      if (rst = '1') then
        fresh <= '0';
      elsif (latched /= (latched'range => '0')) then
        fresh <= '0';
      elsif (enable = '0') then
        fresh <= '1';
      end if;

      -- clocks that have been hungry, from what was asked for with the last decision on
      if (decided = '1' or now_on = '0') then
        hungry <= resize(unsigned(watchdog), 17) + 2;
      elsif (hungry /= 0) then
        hungry <= hungry - 1;
      end if;

      -- the same of the decision that follows a start, from the limit of that start on
      if (start = '1' and wakeful = '1' and (decided = '1' or awaited = '0')) then
        awaited <= '1';
        due     <= resize(unsigned(decision_limit), 17) + 1;
      else
        awaited <= awaited and wakeful and not decided;

        if (due /= 0) then
          due <= due - 1;
        end if;
      end if;
    end if;

  end process p_history;

  p_properties : process (g, earlier, ages, now_on, was_on, latched, known, floor_dead, most_dead, floor_on, floor_off,
                          must_stop, cut, since, fresh, whole, entered, hungry, awaited, due, vetted) is

    variable leg      : std_logic_vector(SIZE - 1 downto 0);
    variable extended : std_logic_vector(SIZE - 1 downto 0);
    variable dead     : unsigned(11 downto 0);
    variable most     : unsigned(14 downto 0);
    variable was      : std_logic_vector(SIZE - 1 downto 0);
    variable aged     : boolean;                      -- no gate of the leg has changed for a dead time
    variable rests    : boolean;                      -- all its gates were off, or those of a position on
    variable n        : natural;

  begin

    found <= (others => '0');
    dead  := floor_dead;

    if (dead < LEAST_DEAD_TIME) then
      dead := to_unsigned(LEAST_DEAD_TIME, 12);
    end if;

    most := resize(most_dead, 15);

    if (most < LEAST_DEAD_TIME) then
      most := to_unsigned(LEAST_DEAD_TIME, 15);
    end if;

    if (TABLED_LEG) then
      most := resize(most * to_unsigned(stop_times, 3), 15);
    else
      most := (others => '0');
    end if;

    if (now_on = '0' and since >= most and g /= (g'range => '0')) then
      found(10) <= '1';
    end if;

    for x in 0 to 2 loop
      leg      := g((x + 1) * SIZE - 1 downto x * SIZE);
      was      := earlier((x + 1) * SIZE - 1 downto x * SIZE);
      extended := leg;
      aged     := true;

      for i in 0 to SIZE - 1 loop
        n := x * SIZE + i;

        -- ages count what was before this clock
        if (earlier(n) = '1' or (g(n) = '0' and ages(n) < dead)) then
          extended(i) := '1';
        end if;

        if (g(n) = '0' and earlier(n) = '1' and now_on = '1' and ages(n) < floor_on) then
          found(2) <= '1';
        end if;

        if (g(n) = '1' and earlier(n) = '0' and now_on = '1' and ages(n) < floor_off) then
          found(3) <= '1';
        end if;

        if (ages(n) < dead) then
          aged := false;
        end if;
      end loop;

      if (TABLED_LEG and leg /= was) then
        if (now_on = '1') then
          rests := unsigned(was) = 0;

          for s in 0 to WHOLES - 1 loop
            rests := rests or was = full(s);
          end loop;

          if (not is_step(was, leg) or not (aged or rests)) then
            found(12) <= '1';
          end if;
        elsif (cut = '0' and latched(FAULT_INTERLOCK) = '0'
               and (leg /= stopped(was) or not (aged or rail(was)))) then
          found(11) <= '1';
        end if;
      end if;

      if (shorts(leg)) then
        found(0) <= '1';
      end if;

      if (shorts(extended) and leg /= (leg'range => '0')) then
        found(1) <= '1';
      end if;

      for s in 0 to WHOLES - 1 loop
        if (entered(x) = '1' and leg = full(s) and not follows(whole(x), to_unsigned(s, 3))) then
          found(4) <= '1';
        end if;
      end loop;
    end loop;

    if ((cut = '1' or latched(FAULT_INTERLOCK) = '1') and g /= (g'range => '0')) then
      found(5) <= '1';
    end if;

    for x in 0 to 2 loop
      leg := g((x + 1) * SIZE - 1 downto x * SIZE);

      if (must_stop = '1' and rail(leg)) then
        found(5) <= '1';
      end if;

      if (rail(leg) and (now_on = '0' or latched /= (latched'range => '0'))) then
        found(6) <= '1';
      end if;
    end loop;

    if (now_on = '1' and was_on = '0' and fresh = '0') then
      found(7) <= '1';
    end if;

    if (now_on = '1' and hungry = 0) then
      found(8) <= '1';
    end if;

    if (now_on = '1' and awaited = '1' and due = 0) then
      found(13) <= '1';
    end if;

    if (now_on = '1' and was_on = '0' and vetted = '0') then
      found(9) <= '1';
    end if;

    if (known = '0') then
      found <= (others => '0');
    end if;

  end process p_properties;

  gates(COUNT - 1 downto 0) <= g;

  g_unused : if COUNT < 24 generate
    gates(23 downto COUNT) <= (others => '0');
  end generate g_unused;

  goals      <= std_logic_vector(wanted(2)) & std_logic_vector(wanted(1)) & std_logic_vector(wanted(0));
  running    <= now_on;
  faults     <= latched;
  violations <= found;

end architecture rtl;
