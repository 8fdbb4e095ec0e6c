-- Gate guard: protects the gates of a three-phase inverter from wrong, late and missing decisions.
--
-- Decisions come in as switch positions; gates come out with interlock, dead time and minimum times
-- (gate_leg), only along edges of the switch graph, only while decisions come in time, only while currents, dc-link
-- voltage, phase capacitors, neutral point and speed are inside their limits, and while currents do not stand still
-- (trip_comparator, band_comparator, gate_supervisor).  A fault and a disable turn all gates off, step by step where
-- the converter needs it; a reset and a refused pattern turn them off at once.  All off is not a zero vector: the
-- diodes carry the current.
--
-- With SECOND_SUPERVISOR a second gate_supervisor gets the same inputs. Either one stops the legs, and the fault upset
-- follows a clock after their outputs differ.
--
-- To run: rst, enable = '0' for a clock with no fault latched, enable = '1', a measurement, decisions.  Gates come
-- on with the first decision that finds a measurement compared since enable rose and since renew.
-- docs/gate-guard.md has states, times and the safety properties that are checked.
--
-- Formats: positions a, b, c of three bits each, of half bridges bit 0 alone ('1': upper gate); gates of phase
-- a from bit 0 on, then b, then c; S1 first; a half bridge: upper, lower.
-- Protocol: positions are at the ports one clock before decided; in the clock of decided they may change again.
-- Positions taken are those that the gates have, or move to: a move that waits has not begun. They are right while
-- running, from two clocks after the first decision on.
-- Latency: gates begin to move two clocks after decided. Gates at the rails are off one clock (10 ns at 100 MHz)
-- after external_trip, driver_fault, upset, decided for an illegal decision, a lapse of time or enable = '0' is at
-- the ports, and four clocks (40 ns at 100 MHz) after measured brings a value beyond its limit. All gates
-- are off 3 dead times later at most, those of half bridges with the first ones. All gates are off one
-- clock after rst.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.positions_t;
  use work.directmpc_math.to_std_logic;
  use work.gate_tables.all;

entity gate_guard is
  generic (
    TABLED_LEG        : boolean                  := true; -- true: legs of the converter's package, false: half bridges
    LEAST_DEAD_TIME   : positive range 1 to 4095 := 10;   -- clocks; shorter dead times are raised to it
    SECOND_SUPERVISOR : boolean                  := false -- true: a second supervisor, compared in every clock
  );
  port (
    clk            : in    std_logic;                                              -- rising edge
    rst            : in    std_logic;                                              -- synchronous, active high
    enable         : in    std_logic;                                              -- '1': gates may be on
    external_trip  : in    std_logic;                                              -- '1': all gates off; synchronous
    -- may be left open
    -- vsg_off port_012
    driver_fault   : in    std_logic := '0';                                       -- '1': likewise, of a gate driver
    upset          : in    std_logic := '0';                                       -- '1': likewise, settings are wrong
    -- vsg_on port_012
    clear          : in    std_logic_vector(FAULT_COUNT - 1 downto 0);             -- '1': forget this fault
    -- measurements
    measured       : in    std_logic;                                              -- '1': they are new in this clock
    is_alpha       : in    std_logic_vector(15 downto 0);                          -- stator current, signed
    is_beta        : in    std_logic_vector(15 downto 0);                          -- signed, unit as is_alpha
    v_dc           : in    std_logic_vector(15 downto 0);                          -- dc-link voltage, unsigned
    v_n            : in    std_logic_vector(15 downto 0);                          -- neutral point, signed
    v_ph_a         : in    std_logic_vector(15 downto 0);                          -- phase capacitor, unsigned
    v_ph_b         : in    std_logic_vector(15 downto 0);                          -- likewise
    v_ph_c         : in    std_logic_vector(15 downto 0);                          -- likewise
    omega_r        : in    std_logic_vector(15 downto 0);                          -- speed, signed
    -- decisions
    start          : in    std_logic;                                              -- '1': a decision has begun
    decided        : in    std_logic;                    -- '1': the positions of the clock before are a decision
    position_a     : in    std_logic_vector(2 downto 0); -- wanted position of phase a, one clock before decided
    position_b     : in    std_logic_vector(2 downto 0); -- wanted position of phase b, likewise
    position_c     : in    std_logic_vector(2 downto 0); -- wanted position of phase c, likewise
    -- settings; the first three are read while off only
    renew          : in    std_logic;                                              -- '1': they change after this clock
    dead_time      : in    std_logic_vector(TIME_WIDTH - 1 downto 0);              -- unsigned, clocks
    minimum_on     : in    std_logic_vector(TIME_WIDTH - 1 downto 0);              -- unsigned, clocks
    minimum_off    : in    std_logic_vector(TIME_WIDTH - 1 downto 0);              -- unsigned, clocks
    decision_limit : in    std_logic_vector(LIMIT_WIDTH - 1 downto 0);             -- start to decided, clocks
    watchdog       : in    std_logic_vector(LIMIT_WIDTH - 1 downto 0);             -- between decisions, clocks
    current_limit  : in    std_logic_vector(15 downto 0);                          -- unsigned, unit as is_alpha
    link_high      : in    std_logic_vector(15 downto 0);                          -- unsigned, unit as v_dc
    link_low       : in    std_logic_vector(15 downto 0);                          -- unsigned, unit as v_dc
    v_ph_high      : in    std_logic_vector(15 downto 0);                          -- unsigned, unit as v_ph_a
    v_ph_low       : in    std_logic_vector(15 downto 0);                          -- unsigned, unit as v_ph_a
    v_n_limit      : in    std_logic_vector(15 downto 0);                          -- unsigned, unit as v_n
    speed_limit    : in    std_logic_vector(15 downto 0);                          -- unsigned, unit as omega_r
    frozen_limit   : in    std_logic_vector(7 downto 0);                           -- equal currents, 0: any number
    -- result
    gates          : out   std_logic_vector(3 * gates_of(TABLED_LEG) - 1 downto 0); -- '1': on
    running        : out   std_logic;                                              -- '1': gates follow decisions
    live           : out   std_logic;                                              -- '1': enabled, without a fault
    waits          : out   std_logic_vector(2 downto 0);                           -- a, b, c; '1': no other goal yet
    resting        : out   std_logic;                                              -- '1': no leg is moving or about to
    taken_a        : out   std_logic_vector(2 downto 0);                           -- position of the gates of phase a
    taken_b        : out   std_logic_vector(2 downto 0);                           -- position of the gates of phase b
    taken_c        : out   std_logic_vector(2 downto 0);                           -- position of the gates of phase c
    faults         : out   std_logic_vector(FAULT_COUNT - 1 downto 0)              -- latched, bits as in gate_tables
  );
end entity gate_guard;

architecture rtl of gate_guard is

  constant GATES_OF_LEG : positive := gates_of(TABLED_LEG);

  signal goals    : positions_t;
  signal trips    : std_logic_vector(3 downto 0);
  signal bands    : std_logic_vector(5 downto 0);
  signal active   : std_logic;
  signal legal    : std_logic_vector(2 downto 0);
  signal blocked  : std_logic_vector(2 downto 0);
  signal at_rest  : std_logic_vector(2 downto 0);
  signal taken    : std_logic_vector(8 downto 0);
  signal refused  : std_logic_vector(2 downto 0);
  signal off      : std_logic_vector(2 downto 0);
  signal dark     : std_logic;
  signal kill     : std_logic;
  signal all_legal   : std_logic;
  signal any_blocked : std_logic;
  signal any_refused : std_logic;
  signal stop     : std_logic;
  signal first_stop : std_logic;
  signal admit      : std_logic;
  signal first_admit : std_logic;
  signal first_kill : std_logic;
  signal checked  : std_logic;
  signal forget   : std_logic;
  signal dead_now : std_logic_vector(TIME_WIDTH - 1 downto 0);
  signal rest_now : std_logic_vector(TIME_WIDTH - 1 downto 0);
  signal is_live  : std_logic;
  signal latched  : std_logic_vector(FAULT_COUNT - 1 downto 0);

begin

  goals(0) <= unsigned(position_a);
  goals(1) <= unsigned(position_b);
  goals(2) <= unsigned(position_c);

  trips(FAULT_EXTERNAL) <= external_trip;

  i_comparator : entity work.trip_comparator
    port map (
      clk           => clk,
      rst           => rst,
      measured      => measured,
      forget        => forget,
      is_alpha      => is_alpha,
      is_beta       => is_beta,
      v_dc          => v_dc,
      current_limit => current_limit,
      link_high     => link_high,
      link_low      => link_low,
      checked       => checked,
      over_current  => trips(FAULT_OVER_CURRENT),
      over_voltage  => trips(FAULT_LINK_HIGH),
      under_voltage => trips(FAULT_LINK_LOW)
    );

  i_bands : entity work.band_comparator
    generic map (
      TABLED_LEG => TABLED_LEG
    )
    port map (
      clk          => clk,
      rst          => rst,
      measured     => measured,
      running      => active,
      is_alpha     => is_alpha,
      is_beta      => is_beta,
      v_n          => v_n,
      v_ph_a       => v_ph_a,
      v_ph_b       => v_ph_b,
      v_ph_c       => v_ph_c,
      omega_r      => omega_r,
      v_ph_high    => v_ph_high,
      v_ph_low     => v_ph_low,
      v_n_limit    => v_n_limit,
      speed_limit  => speed_limit,
      frozen_limit => frozen_limit,
      capacitor    => bands(0),
      neutral      => bands(1),
      speed        => bands(2),
      frozen       => bands(3)
    );

  bands(5) <= driver_fault;

  running <= active;
  live    <= is_live;

  all_legal   <= legal(0) and legal(1) and legal(2);
  any_blocked <= blocked(0) or blocked(1) or blocked(2);
  any_refused <= refused(0) or refused(1) or refused(2);
  dark        <= off(0) and off(1) and off(2);
  resting     <= at_rest(0) and at_rest(1) and at_rest(2);

  taken_a <= taken(2 downto 0);
  taken_b <= taken(5 downto 3);
  taken_c <= taken(8 downto 6);

  i_supervisor : entity work.gate_supervisor
    generic map (
      LEAST_DEAD_TIME => LEAST_DEAD_TIME
    )
    port map (
      clk            => clk,
      rst            => rst,
      enable         => enable,
      start          => start,
      decided        => decided,
      legal          => all_legal,
      blocked        => any_blocked,
      refused        => any_refused,
      dark           => dark,
      trips          => trips,
      bands          => bands,
      checked        => checked,
      renew          => renew,
      clear          => clear,
      dead_time      => dead_time,
      minimum_on     => minimum_on,
      minimum_off    => minimum_off,
      decision_limit => decision_limit,
      watchdog       => watchdog,
      stop           => first_stop,
      admit          => first_admit,
      kill           => first_kill,
      forget         => forget,
      dead_now       => dead_now,
      rest_now       => rest_now,
      running        => active,
      live           => is_live,
      faults         => latched
    );

  g_second : if SECOND_SUPERVISOR generate

    signal forgets : std_logic;
    signal dead    : std_logic_vector(TIME_WIDTH - 1 downto 0);
    signal rest    : std_logic_vector(TIME_WIDTH - 1 downto 0);
    signal runs    : std_logic;
    signal lives   : std_logic;
    signal second_stop   : std_logic;
    signal second_admit  : std_logic;
    signal second_kill   : std_logic;
    signal second_faults : std_logic_vector(FAULT_COUNT - 1 downto 0);
    signal disagree      : std_logic; -- the two differed a clock ago

    -- tools that merge what is equal may not merge the two
    attribute dont_touch : string;
    attribute dont_touch of i_second     : label is "true";
    attribute keep_hierarchy : string;
    attribute keep_hierarchy of i_second : label is "true";
    attribute syn_hier : string;
    attribute syn_hier of i_second       : label is "hard";

  begin

    i_second : entity work.gate_supervisor
      generic map (
        LEAST_DEAD_TIME => LEAST_DEAD_TIME
      )
      port map (
        clk            => clk,
        rst            => rst,
        enable         => enable,
        start          => start,
        decided        => decided,
        legal          => all_legal,
        blocked        => any_blocked,
        refused        => any_refused,
        dark           => dark,
        trips          => trips,
        bands          => bands,
        checked        => checked,
        renew          => renew,
        clear          => clear,
        dead_time      => dead_time,
        minimum_on     => minimum_on,
        minimum_off    => minimum_off,
        decision_limit => decision_limit,
        watchdog       => watchdog,
        stop           => second_stop,
        admit          => second_admit,
        kill           => second_kill,
        forget         => forgets,
        dead_now       => dead,
        rest_now       => rest,
        running        => runs,
        live           => lives,
        faults         => second_faults
      );

    bands(4) <= upset or disagree;
    stop     <= first_stop or second_stop;
    admit    <= first_admit and second_admit;
    kill     <= first_kill or second_kill;
    faults   <= latched or second_faults;

    p_compare : process (clk) is
    begin

      if rising_edge(clk) then
        disagree <= to_std_logic(first_stop /= second_stop or first_admit /= second_admit
                                 or first_kill /= second_kill or forget /= forgets
                                 or dead_now /= dead or rest_now /= rest or active /= runs or is_live /= lives
                                 or latched /= second_faults);

        if (rst = '1') then
          disagree <= '0';
        end if;
      end if;

    end process p_compare;

  end generate g_second;

  g_alone : if not SECOND_SUPERVISOR generate
    bands(4) <= upset;
    stop     <= first_stop;
    admit    <= first_admit;
    kill     <= first_kill;
    faults   <= latched;
  end generate g_alone;

  g_legs : for x in 0 to 2 generate

    i_leg : entity work.gate_leg
      generic map (
        TABLED_LEG => TABLED_LEG
      )
      port map (
        clk       => clk,
        stop      => stop,
        admit     => admit,
        kill      => kill,
        decided   => decided,
        goal      => std_logic_vector(goals(x)),
        dead_time => dead_now,
        rest_time => rest_now,
        legal     => legal(x),
        blocked   => blocked(x),
        waits     => waits(2 - x),
        resting   => at_rest(x),
        position  => taken(3 * x + 2 downto 3 * x),
        refused   => refused(x),
        off       => off(x),
        gates     => gates((x + 1) * GATES_OF_LEG - 1 downto x * GATES_OF_LEG)
      );

  end generate g_legs;

end architecture rtl;
