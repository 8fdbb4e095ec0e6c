-- What every system has around its controller: start and commit, counters, gate guard, shared registers.
--
-- A system consists of its register block, its observer, its core and this shell. The shell gates the bus writes
-- (write_rules, write_gate) and reads (read_gate), orders decisions and commits (decision_sequencer), counts clocks
-- (decision_monitor) and drives the gates (gate_guard). It fills all of the shared registers' inputs. With
-- RECORDER_ROWS the recorder stands between the gates of the bus and the registers.
--
-- The guard's settings are shadows: they are taken over with load, as the parameters are by the system. Those in force
-- are compared with the registers in every clock. While the guard is enabled no write changes either of them, so a
-- difference is an upset: the guard's fault upset.
-- Faults: the guard latches them and the register shows them. What software clears in the register is cleared in the
-- guard one clock later.
--
-- Nothing old reaches a gate: a decision counts for the guard only if it began while the guard was live, with
-- measurements that were new (measurement_watch), and the guard has been live since. current says so of the decision
-- made last. Where it is '0', apply is not given to the guard, and its watchdog runs on.
--
-- Formats: as gate_guard; registers as docs/registers.md.
-- Latency: go one clock after start; gates as gate_guard; registers show a state one clock later.
-- Overflow: none; a start while a decision is under way is dropped and flagged.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.selector_width;
  use work.directmpc_math.to_std_logic;
  use work.directmpc_system_registers_pkg.all;
  use work.converter_leg.converter;
  use work.gate_tables.all;
  use work.recorder_format.all;

entity system_shell is
  generic (
    TABLED_LEG      : boolean                  := true; -- true: legs of the converter's package, false: half bridges
    MEASUREMENTS    : positive range 1 to 16   := 13;   -- registers that a measurement has, positions not counted
    LEAST_DEAD_TIME : positive range 1 to 4095 := 10;   -- clocks; shorter dead times are raised to it
    SECOND_SUPERVISOR : boolean                := false; -- true: the gate guard has two supervisors
    FIRST_BOUND     : natural range 0 to 61    := 0;    -- place of MPDCC's three bounds among the parameters
    BOUND_LIMIT     : natural range 0 to 65535 := 65535; -- of MPDCC's bounds, trajectory units; 65535: any bound passes
    RECORDER_ROWS   : natural range 0 to 1024  := 0;    -- steps that are recorded: 0, or a power of two from 8 on
    RECORD_INPUTS   : positive                 := MPDCC_INPUTS; -- words of a record before the decision
    RECORD_RESULTS  : positive                 := MPDCC_RESULTS -- words of it from the decision on
  );
  port (
    clk                : in    std_logic;                     -- rising edge
    rst                : in    std_logic;                     -- synchronous, active high
    enable             : in    std_logic;                     -- '1': gates may be on, if control.enable is set too
    external_trip      : in    std_logic;                     -- '1': all gates off; synchronous to clk
    driver_fault       : in    std_logic;                     -- '1': likewise, of a gate driver
    second_clock       : in    std_logic;                     -- '1': the second oscillator runs; for the status alone
    start              : in    std_logic;                     -- '1' for one clock: measurements are at the ports
    -- bus, from the master and to the register block
    m_awvalid          : in    std_logic;                     -- '1': address there
    m_awready          : out   std_logic;                     -- '1': address taken
    m_wvalid           : in    std_logic;                     -- '1': data there
    m_wready           : out   std_logic;                     -- '1': data taken
    m_bready           : in    std_logic;                     -- '1': response taken
    m_awaddr           : in    std_logic_vector(9 downto 0);  -- byte address
    m_wdata            : in    std_logic_vector(31 downto 0); -- data
    m_wstrb            : in    std_logic_vector(3 downto 0);  -- '1': byte is written
    m_bvalid           : out   std_logic;                     -- '1': response there
    m_bresp            : out   std_logic_vector(1 downto 0);  -- "00": okay, "10": SLVERR
    m_araddr           : in    std_logic_vector(9 downto 0);  -- byte address
    m_arvalid          : in    std_logic;                     -- '1': address there
    m_arready          : out   std_logic;                     -- '1': address taken
    m_rready           : in    std_logic;                     -- '1': data taken
    m_rvalid           : out   std_logic;                     -- '1': data there
    m_rdata            : out   std_logic_vector(31 downto 0); -- data
    m_rresp            : out   std_logic_vector(1 downto 0);  -- "00": okay, "10": SLVERR
    s_awvalid          : out   std_logic;                     -- '1': address there
    s_awready          : in    std_logic;                     -- '1': address taken
    s_wvalid           : out   std_logic;                     -- '1': data there
    s_wready           : in    std_logic;                     -- '1': data taken
    s_bready           : out   std_logic;                     -- '1': response taken
    s_bvalid           : in    std_logic;                     -- '1': response there
    s_bresp            : in    std_logic_vector(1 downto 0);  -- "00": okay, "10": SLVERR
    s_arvalid          : out   std_logic;                     -- '1': address there
    s_arready          : in    std_logic;                     -- '1': address taken
    s_rready           : out   std_logic;                     -- '1': data taken
    s_rvalid           : in    std_logic;                     -- '1': data there
    s_rdata            : in    std_logic_vector(31 downto 0); -- data
    s_rresp            : in    std_logic_vector(1 downto 0);  -- "00": okay, "10": SLVERR
    -- registers
    written            : in    system_registers_out_t;        -- what software has written
    settings           : in    guard_registers_out_t;         -- shadows of the guard's settings
    bands              : in    std_logic_vector(47 downto 0); -- shadows of v_ph_high, v_ph_low, v_n_limit
    capabilities       : in    \system_registers.capabilities_in_t\; -- what was built, constant
    shown              : out   system_registers_in_t;         -- what software reads
    -- decisions
    take               : out   std_logic;                     -- '1': measurements are taken from the ports
    begins             : out   std_logic;                     -- '1': go in the next clock
    go                 : out   std_logic;                     -- '1' for one clock: begin, measurements are in registers
    deciding           : out   std_logic;                     -- '1': a decision is under way
    observing          : out   std_logic;                     -- '1': this decision uses the observer's flux
    owning             : out   std_logic;                     -- '1': it goes on from the system's own last decision
    forget             : out   std_logic;                     -- '1': the observer is to begin anew, once not deciding
    load               : out   std_logic;                     -- '1' for one clock: shadows take effect
    load_at_rest       : out   std_logic;                     -- '1': a commit waits, no decision is under way
    load_waits         : in    std_logic;                     -- '1': parameters are not taken over yet
    preparing          : in    std_logic;                     -- '1': they are not yet in force
    decides            : in    std_logic;                     -- '1' for one clock: the core begins
    decided            : in    std_logic;                     -- '1' for one clock: the core has decided
    saturated          : in    std_logic;                     -- '1' with decided: a value did not fit its word
    deadlock           : in    std_logic;                     -- '1' with decided: no candidate stays inside
    clamped            : in    std_logic;                     -- '1' with decided: MPFC cannot reach the torque
    observer_saturated : in    std_logic;                     -- '1': a value of the observer did not fit its word
    cycles             : out   std_logic_vector(15 downto 0); -- of the last decision, unsigned
    step_words         : in    record_t;                      -- to be recorded, but for what the shell knows
    -- gates
    is_alpha           : in    std_logic_vector(15 downto 0); -- measured stator current, signed, valid with go
    is_beta            : in    std_logic_vector(15 downto 0); -- signed, unit as is_alpha
    v_dc               : in    std_logic_vector(15 downto 0); -- measured dc-link voltage, unsigned, valid with go
    v_n                : in    std_logic_vector(15 downto 0); -- neutral point, signed, valid with go
    v_ph_a             : in    std_logic_vector(15 downto 0); -- phase capacitor, unsigned, valid with go
    v_ph_b             : in    std_logic_vector(15 downto 0); -- likewise
    v_ph_c             : in    std_logic_vector(15 downto 0); -- likewise
    omega_r            : in    std_logic_vector(15 downto 0); -- speed, signed, valid with go
    apply              : in    std_logic;                     -- '1': the positions of the clock before are a decision
    position_a         : in    std_logic_vector(2 downto 0);  -- wanted position of phase a, one clock before apply
    position_b         : in    std_logic_vector(2 downto 0);  -- wanted position of phase b, likewise
    position_c         : in    std_logic_vector(2 downto 0);  -- wanted position of phase c, likewise
    gates              : out   std_logic_vector(3 * gates_of(TABLED_LEG) - 1 downto 0); -- '1': on
    waits              : out   std_logic_vector(2 downto 0);  -- a, b, c; '1': no other position yet
    taken_a            : out   std_logic_vector(2 downto 0);  -- position of the gates of phase a, while running
    taken_b            : out   std_logic_vector(2 downto 0);  -- position of the gates of phase b, while running
    taken_c            : out   std_logic_vector(2 downto 0);  -- position of the gates of phase c, while running
    running            : out   std_logic;                     -- '1': gates follow decisions
    current            : out   std_logic;                     -- '1': the decision made last may reach gates
    faults             : out   std_logic_vector(FAULT_COUNT - 1 downto 0) -- latched, bits as in gate_tables
  );
end entity system_shell;

architecture rtl of system_shell is

  subtype faults_t is std_logic_vector(FAULT_COUNT - 1 downto 0);

  -- after a reset: every measurement trips
  constant NO_SETTINGS : guard_registers_out_t := (
    dead_time      => (clocks  => (value => (others => '0'))),
    minimum_on     => (clocks  => (value => (others => '0'))),
    minimum_off    => (clocks  => (value => (others => '0'))),
    decision_limit => (clocks  => (value => (others => '0'))),
    watchdog       => (clocks  => (value => (others => '0'))),
    current_limit  => (value   => (value => (others => '0'))),
    link_high      => (value   => (value => (others => '0'))),
    link_low       => (value   => (value => (others => '0'))),
    speed_limit    => (value   => (value => (others => '0'))),
    frozen         => (periods => (value => (others => '0')))
  );

  signal in_force     : guard_registers_out_t; -- settings of the guard
  signal bands_in_force : std_logic_vector(47 downto 0);
  signal differ       : std_logic;             -- they are not those of the registers
  signal altered      : std_logic;             -- they have changed by themselves
  signal heard_awvalid : std_logic;            -- between gates and recorder
  signal heard_awready : std_logic;
  signal heard_wvalid  : std_logic;
  signal heard_wready  : std_logic;
  signal heard_bready  : std_logic;
  signal heard_bvalid  : std_logic;
  signal heard_bresp   : std_logic_vector(1 downto 0);
  signal heard_arvalid : std_logic;
  signal heard_arready : std_logic;
  signal heard_rready  : std_logic;
  signal heard_rvalid  : std_logic;
  signal heard_rresp   : std_logic_vector(1 downto 0);
  signal recorded      : std_logic;                     -- the answer to a read is the recorder's
  signal recorded_data : std_logic_vector(31 downto 0); -- its data
  signal hold         : std_logic;             -- a write waits
  signal refuse       : std_logic;             -- a write is refused
  signal passed       : std_logic;             -- a write goes to the registers
  signal answered     : std_logic;             -- the answer to a write is there
  signal answer       : std_logic_vector(1 downto 0);
  signal whole        : std_logic;             -- all bytes of its word
  signal begun        : std_logic;
  signal busy         : std_logic;
  signal ignored      : std_logic;             -- a start, of either kind
  signal taking_over  : std_logic;
  signal taken        : std_logic;             -- measurements, from the ports
  signal beginning    : std_logic;             -- go in the next clock
  signal live         : std_logic;             -- the guard is enabled, without a fault
  signal fresh        : std_logic;             -- measurements of the decision under way are new
  signal measured     : std_logic;             -- they are there, and new
  signal counts       : std_logic;             -- it may reach gates
  signal made         : std_logic;             -- the decision before may
  signal applied      : std_logic;
  signal pending      : std_logic;
  signal unchanged    : std_logic; -- shadows stay as they are: a commit waits, or is not carried out yet
  signal commits      : std_logic_vector(15 downto 0);
  signal last_cycles  : std_logic_vector(15 downto 0);
  signal worst_cycles : std_logic_vector(15 downto 0);
  signal decisions    : std_logic_vector(31 downto 0);
  signal enabled      : std_logic;
  signal all_gates    : std_logic_vector(3 * gates_of(TABLED_LEG) - 1 downto 0);
  signal is_running   : std_logic;
  signal is_resting   : std_logic;
  signal latched      : faults_t;
  signal tripped      : std_logic;             -- there is one
  signal faults_shown : faults_t;              -- as the register has them
  signal faults_until : faults_t;              -- a clock ago
  signal clear        : faults_t;
  signal set          : faults_t;

  -- every bit of the settings
  function words_of (s : guard_registers_out_t) return std_logic_vector is
  begin

    return s.dead_time.clocks.value & s.minimum_on.clocks.value & s.minimum_off.clocks.value
           & s.decision_limit.clocks.value & s.watchdog.clocks.value
           & s.current_limit.value.value & s.link_high.value.value & s.link_low.value.value
           & s.speed_limit.value.value & s.frozen.periods.value;

  end function words_of;

begin

  unchanged <= pending or load_waits;

  ---------------------------------------------------------------------------------------------
  -- Bus
  ---------------------------------------------------------------------------------------------

  whole <= '1' when m_wstrb = "1111" else
           '0';

  i_rules : entity work.write_rules
    generic map (
      FIRST_BOUND => FIRST_BOUND,
      BOUND_LIMIT => BOUND_LIMIT
    )
    port map (
      clk     => clk,
      rst     => rst,
      address => m_awaddr,
      whole   => whole,
      word    => m_wdata(15 downto 0),
      passed  => passed,
      enabled => written.control.enable.value,
      commit  => written.command.commit.value,
      pending => unchanged,
      load    => taking_over,
      hold    => hold,
      refuse  => refuse
    );

  i_gate : entity work.write_gate
    port map (
      clk       => clk,
      rst       => rst,
      hold      => hold,
      refuse    => refuse,
      passed    => passed,
      m_awvalid => m_awvalid,
      m_awready => m_awready,
      m_wvalid  => m_wvalid,
      m_wready  => m_wready,
      m_bready  => m_bready,
      m_bvalid  => answered,
      m_bresp   => answer,
      s_awvalid => heard_awvalid,
      s_awready => heard_awready,
      s_wvalid  => heard_wvalid,
      s_wready  => heard_wready,
      s_bready  => heard_bready,
      s_bvalid  => heard_bvalid,
      s_bresp   => heard_bresp
    );

  m_bvalid <= answered;
  m_bresp  <= answer;

  i_read_gate : entity work.read_gate
    port map (
      clk       => clk,
      rst       => rst,
      m_arvalid => m_arvalid,
      m_arready => m_arready,
      m_rready  => m_rready,
      m_rvalid  => m_rvalid,
      m_rdata   => m_rdata,
      m_rresp   => m_rresp,
      s_arvalid => heard_arvalid,
      s_arready => heard_arready,
      s_rready  => heard_rready,
      s_rvalid  => heard_rvalid,
      s_rdata   => s_rdata,
      s_rresp   => heard_rresp,
      s_stands  => recorded,
      standing  => recorded_data
    );

  ---------------------------------------------------------------------------------------------
  -- Recorder
  ---------------------------------------------------------------------------------------------

  g_recorder : if RECORDER_ROWS > 0 generate

    signal words : record_t;

  begin

    assert RECORDER_ROWS = 2 ** selector_width(RECORDER_ROWS) and RECORDER_ROWS >= 8
      report "RECORDER_ROWS has to be 0, or a power of two from 8 to 1024"
      severity failure;

    p_words : process (all) is
    begin

      words <= step_words;
      words(RECORD_GATES + 23 downto RECORD_GATES) <= std_logic_vector(resize(unsigned(all_gates), 24));
      words(RECORD_CYCLES + 15 downto RECORD_CYCLES) <= last_cycles;
      words(RECORD_NUMBER + 15 downto RECORD_NUMBER) <= decisions(15 downto 0);
      words(RECORD_FAULTS + FAULT_COUNT - 1 downto RECORD_FAULTS) <= latched;
      words(RECORD_SATURATED) <= saturated;

    end process p_words;

    i_recorder : entity work.recorder
      generic map (
        ROWS_LOG2 => selector_width(RECORDER_ROWS),
        INPUTS    => RECORD_INPUTS,
        RESULTS   => RECORD_RESULTS
      )
      port map (
        clk        => clk,
        rst        => rst,
        begins     => decides,
        busy       => busy,
        decided    => decided,
        step_words => words,
        deadlock   => deadlock,
        saturated  => saturated,
        tripped    => tripped,
        awaddr     => m_awaddr,
        wdata      => m_wdata,
        m_awvalid  => heard_awvalid,
        m_awready  => heard_awready,
        m_wvalid   => heard_wvalid,
        m_wready   => heard_wready,
        m_bready   => heard_bready,
        m_bvalid   => heard_bvalid,
        m_bresp    => heard_bresp,
        araddr     => m_araddr,
        m_arvalid  => heard_arvalid,
        m_arready  => heard_arready,
        m_rready   => heard_rready,
        m_rvalid   => heard_rvalid,
        own_data   => recorded,
        m_rdata    => recorded_data,
        m_rresp    => heard_rresp,
        s_awvalid  => s_awvalid,
        s_awready  => s_awready,
        s_wvalid   => s_wvalid,
        s_wready   => s_wready,
        s_bready   => s_bready,
        s_bvalid   => s_bvalid,
        s_bresp    => s_bresp,
        s_arvalid  => s_arvalid,
        s_arready  => s_arready,
        s_rready   => s_rready,
        s_rvalid   => s_rvalid,
        s_rresp    => s_rresp
      );

  end generate g_recorder;

  g_no_recorder : if RECORDER_ROWS = 0 generate
    s_awvalid     <= heard_awvalid;
    heard_awready <= s_awready;
    s_wvalid      <= heard_wvalid;
    heard_wready  <= s_wready;
    s_bready      <= heard_bready;
    heard_bvalid  <= s_bvalid;
    heard_bresp   <= s_bresp;
    s_arvalid     <= heard_arvalid;
    heard_arready <= s_arready;
    s_rready      <= heard_rready;
    heard_rvalid  <= s_rvalid;
    recorded      <= '0';
    recorded_data <= (others => '0');
    heard_rresp   <= s_rresp;
  end generate g_no_recorder;

  ---------------------------------------------------------------------------------------------
  -- Start, commit
  ---------------------------------------------------------------------------------------------

  i_sequencer : entity work.decision_sequencer
    port map (
      clk            => clk,
      rst            => rst,
      start          => start,
      command_start  => written.command.start.value,
      from_registers => written.control.registers_as_source.value,
      use_observer   => written.control.use_observer.value,
      own_positions  => written.control.own_positions.value,
      reset_observer => written.command.reset_observer.value,
      commit         => written.command.commit.value,
      ending         => decided,
      take           => taken,
      begins         => beginning,
      go             => begun,
      deciding       => busy,
      ignored        => ignored,
      observing      => observing,
      owning         => owning,
      forget         => forget,
      load           => taking_over,
      load_at_rest   => load_at_rest,
      pending        => pending,
      commits        => commits
    );

  i_monitor : entity work.decision_monitor
    port map (
      clk       => clk,
      rst       => rst,
      clear     => written.command.clear_counters.value,
      start     => begun,
      valid     => decided,
      last      => last_cycles,
      worst     => worst_cycles,
      decisions => decisions
    );

  i_watch : entity work.measurement_watch
    generic map (
      COUNT => MEASUREMENTS
    )
    port map (
      clk     => clk,
      rst     => rst,
      live    => live,
      address => m_awaddr,
      passed  => passed,
      limit   => in_force.watchdog.clocks.value,
      take    => taken,
      begins  => beginning,
      fresh   => fresh
    );

  p_current : process (clk) is
  begin

    if rising_edge(clk) then
      if (begun = '1') then
        counts <= fresh;
      end if;

      if (decided = '1') then
        made <= counts;
      end if;

      if (live = '0' or rst = '1') then
        counts <= '0';
        made   <= '0';
      end if;
    end if;

  end process p_current;

  measured <= begun and fresh;
  applied  <= apply and made;
  current  <= made;
  take     <= taken;
  begins   <= beginning;

  go       <= begun;
  deciding <= busy;
  load     <= taking_over;
  cycles   <= last_cycles;

  ---------------------------------------------------------------------------------------------
  -- Gates
  ---------------------------------------------------------------------------------------------

  p_settings : process (clk) is
  begin

    if rising_edge(clk) then
      if (taking_over = '1') then
        in_force       <= settings;
        bands_in_force <= bands;
      end if;

      differ <= to_std_logic(words_of(in_force) /= words_of(settings) or bands_in_force /= bands);

      -- enable is refused until the first load
      if (rst = '1') then
        in_force       <= NO_SETTINGS;
        bands_in_force <= (others => '0');
      end if;
    end if;

  end process p_settings;

  enabled <= enable and written.control.enable.value;
  altered <= differ and enabled;

  i_guard : entity work.gate_guard
    generic map (
      TABLED_LEG        => TABLED_LEG,
      LEAST_DEAD_TIME   => LEAST_DEAD_TIME,
      SECOND_SUPERVISOR => SECOND_SUPERVISOR
    )
    port map (
      clk            => clk,
      rst            => rst,
      enable         => enabled,
      external_trip  => external_trip,
      driver_fault   => driver_fault,
      upset          => altered,
      clear          => clear,
      measured       => measured,
      is_alpha       => is_alpha,
      is_beta        => is_beta,
      v_dc           => v_dc,
      v_n            => v_n,
      v_ph_a         => v_ph_a,
      v_ph_b         => v_ph_b,
      v_ph_c         => v_ph_c,
      omega_r        => omega_r,
      start          => measured,
      decided        => applied,
      position_a     => position_a,
      position_b     => position_b,
      position_c     => position_c,
      renew          => taking_over,
      dead_time      => in_force.dead_time.clocks.value,
      minimum_on     => in_force.minimum_on.clocks.value,
      minimum_off    => in_force.minimum_off.clocks.value,
      decision_limit => in_force.decision_limit.clocks.value,
      watchdog       => in_force.watchdog.clocks.value,
      current_limit  => in_force.current_limit.value.value,
      link_high      => in_force.link_high.value.value,
      link_low       => in_force.link_low.value.value,
      v_ph_high      => bands_in_force(47 downto 32),
      v_ph_low       => bands_in_force(31 downto 16),
      v_n_limit      => bands_in_force(15 downto 0),
      speed_limit    => in_force.speed_limit.value.value,
      frozen_limit   => in_force.frozen.periods.value,
      gates          => all_gates,
      waits          => waits,
      running        => is_running,
      live           => live,
      resting        => is_resting,
      taken_a        => taken_a,
      taken_b        => taken_b,
      taken_c        => taken_c,
      faults         => latched
    );

  faults_shown(FAULT_EXTERNAL)     <= written.faults.external_trip.value;
  faults_shown(FAULT_OVER_CURRENT) <= written.faults.over_current.value;
  faults_shown(FAULT_LINK_HIGH)    <= written.faults.link_high.value;
  faults_shown(FAULT_LINK_LOW)     <= written.faults.link_low.value;
  faults_shown(FAULT_ILLEGAL)      <= written.faults.illegal_edge.value;
  faults_shown(FAULT_LATE)         <= written.faults.late.value;
  faults_shown(FAULT_MISSING)      <= written.faults.missing.value;
  faults_shown(FAULT_OVERRUN)      <= written.faults.overrun.value;
  faults_shown(FAULT_INTERLOCK)    <= written.faults.interlock.value;
  faults_shown(FAULT_CAPACITOR)    <= written.faults.capacitor.value;
  faults_shown(FAULT_NEUTRAL)      <= written.faults.neutral_point.value;
  faults_shown(FAULT_SPEED)        <= written.faults.over_speed.value;
  faults_shown(FAULT_FROZEN)       <= written.faults.frozen.value;
  faults_shown(FAULT_UPSET)        <= written.faults.upset.value;
  faults_shown(FAULT_DRIVER)       <= written.faults.driver.value;

  clear        <= faults_until and not faults_shown;
  set          <= latched and not clear;

  p_until : process (clk) is
  begin

    if rising_edge(clk) then
      faults_until <= faults_shown;

      if (rst = '1') then
        faults_until <= (others => '0');
      end if;
    end if;

  end process p_until;

  tripped <= '0' when latched = (latched'range => '0') else '1';
  gates   <= all_gates;
  running <= is_running;
  faults  <= latched;

  ---------------------------------------------------------------------------------------------
  -- What the registers show
  ---------------------------------------------------------------------------------------------

  shown.capabilities <= capabilities;

  -- half bridges beside the package's legs are those of MPTC and MPFC: their map says nothing of it
  shown.gates.converter.next_q <= std_logic_vector(to_unsigned(CONVERTER, 4)) when TABLED_LEG else
                                  "0000";

  shown.status.busy.next_q           <= busy;
  shown.status.commit_pending.next_q <= pending or preparing;
  shown.status.running.next_q        <= is_running;
  shown.status.commutating.next_q    <= not is_resting;
  shown.status.fault.next_q          <= tripped;
  shown.status.enabled.next_q        <= enabled;
  shown.status.in_force.next_q       <= not differ;
  shown.status.second_clock.next_q   <= second_clock;

  shown.flags.saturated.hwset          <= decided and saturated;
  shown.flags.deadlock.hwset           <= decided and deadlock;
  shown.flags.start_ignored.hwset      <= ignored;
  shown.flags.write_refused.hwset      <= answered and answer(1);
  shown.flags.observer_saturated.hwset <= observer_saturated;
  shown.flags.clamped.hwset            <= decided and clamped;
  shown.flags.old_measurement.hwset    <= begun and live and not fresh;

  shown.faults.external_trip.hwset <= set(FAULT_EXTERNAL);
  shown.faults.over_current.hwset  <= set(FAULT_OVER_CURRENT);
  shown.faults.link_high.hwset     <= set(FAULT_LINK_HIGH);
  shown.faults.link_low.hwset      <= set(FAULT_LINK_LOW);
  shown.faults.illegal_edge.hwset  <= set(FAULT_ILLEGAL);
  shown.faults.late.hwset          <= set(FAULT_LATE);
  shown.faults.missing.hwset       <= set(FAULT_MISSING);
  shown.faults.overrun.hwset       <= set(FAULT_OVERRUN);
  shown.faults.interlock.hwset     <= set(FAULT_INTERLOCK);
  shown.faults.capacitor.hwset     <= set(FAULT_CAPACITOR);
  shown.faults.neutral_point.hwset <= set(FAULT_NEUTRAL);
  shown.faults.over_speed.hwset    <= set(FAULT_SPEED);
  shown.faults.frozen.hwset        <= set(FAULT_FROZEN);
  shown.faults.upset.hwset         <= set(FAULT_UPSET);
  shown.faults.driver.hwset        <= set(FAULT_DRIVER);

  shown.cycles.last.next_q     <= last_cycles;
  shown.cycles.worst.next_q    <= worst_cycles;
  shown.decisions.count.next_q <= decisions;
  shown.commits.count.next_q   <= commits;
  shown.gates.gates.next_q     <= std_logic_vector(resize(unsigned(all_gates), 24));

end architecture rtl;
