-- A complete MPDCC controller with a bus: registers, observer of capacitors, rotor flux and leakage, core, gate guard.
--
-- Measurements come with start, from the ports or from registers (control.registers_as_source, then
-- command.start), and are kept in the registers. The observer takes its step first. Where f_q_midpoint or
-- f_q_phase is not 0, it begins with the capacitors, and the core gets filtered voltages. With
-- control.use_observer its flux replaces psir. The core decides; the guard turns the decision into gates: at once, or
-- with compensate from the next start on, since it was made for that step. With l_mode the observer's step goes on with
-- the leakage beside the core, on what the core gets. Between two decisions the slopes'
-- coefficients are scaled for the next one. Parameters and the guard's settings are shadows that take effect together
-- between two decisions. The parameters' stand in a block RAM (parameter_memory): once the observer's step is over they
-- are copied, and a decision that begins meanwhile waits for all of them. What is common to all systems is in
-- system_shell.
--
-- The observer needs the positions applied since the measurement before. While the gates run these are the guard's:
-- a commutation that waits for a minimum time has not been applied. Else they are the decisions. The filters begin
-- anew once the guard has stopped.
--
-- Formats: as mpdcc_core and gate_guard; registers as docs/registers.md.
-- Latency: the core starts one clock after start, 12 clocks later with the filters, 19 with the flux, 27 with both.
-- Parameters are in force 68 clocks after the guard's settings, one more for each access to a parameter meanwhile, and
-- the commit is pending until then; a decision that begins in between waits, and has the new ones. So it does behind a
-- reset. The guard has a decision one clock after valid, with compensate one clock after the next start.
-- With LEAKAGE_ESTIMATE a commit is pending for 20 clocks more, in which no decision goes on; nor does it, with l_mode,
-- within 78 clocks after the last one has, 86 with the filters, or 19 after the last decision.
-- Overflow: values saturate and set flags; a start while busy is ignored and sets a flag.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.cost_width;
  use work.directmpc_math.all;
  use work.directmpc_mpdcc_registers_pkg.all;
  use work.directmpc_system_registers_pkg.all;
  use work.gate_tables.gates_of;
  use work.recorder_format.all;
  use work.mpdcc_parameter_places.all;

entity mpdcc_system is
  generic (
    EXPLORERS         : positive range 1 to 8    := 2;     -- number of explorers
    FOLDED            : boolean                  := false; -- true: the paper's explorer, false: the fast one
    SECOND_LEVEL      : boolean                  := true;  -- true: SESE and delay compensation, fast explorer alone
    WEIGHTED_DEADLOCK : boolean                  := true;  -- true: the weighted deadlock rule, fast explorer alone
    INWARDS           : boolean                  := true;  -- true: the rule inwards, fast explorer alone
    CAPACITOR_FILTER  : boolean                  := true;  -- true: filters of v_n and v_ph can be chosen
    LEAKAGE_ESTIMATE  : boolean                  := true;  -- true: the leakage can be estimated, fast explorer alone
    FLUX_OBSERVER     : boolean                  := true;  -- true: the flux can be; filters or leakage bring it along
    LEAST_DEAD_TIME   : positive range 1 to 4095 := 10;    -- clocks; shorter dead times are raised to it
    SECOND_SUPERVISOR : boolean                  := false; -- true: the gate guard has two supervisors
    RECORDER_ROWS     : natural range 0 to 1024  := 0      -- steps that are recorded: 0, or a power of two from 8 on
  );
  port (
    clk            : in    std_logic;                     -- rising edge
    rst            : in    std_logic;                     -- synchronous, active high
    enable         : in    std_logic;                     -- '1': gates may be on, if control.enable is set too
    external_trip  : in    std_logic;                     -- '1': all gates off; synchronous to clk
    -- may be left open
    -- vsg_off port_012
    driver_fault   : in    std_logic := '0';              -- '1': likewise; a gate driver has a fault or is not ready
    second_clock   : in    std_logic := '1';              -- '1': the second oscillator runs; for the status alone
    -- vsg_on port_012
    start          : in    std_logic;                     -- '1' for one clock: measurements are there, decide
    is_alpha       : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    is_beta        : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    psir_alpha     : in    std_logic_vector(15 downto 0); -- signed, 1/9000 pu
    psir_beta      : in    std_logic_vector(15 downto 0); -- signed, 1/9000 pu
    v_n            : in    std_logic_vector(15 downto 0); -- signed, 1/64012.5 pu
    v_ph_a         : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    v_ph_b         : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    v_ph_c         : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    v_dc           : in    std_logic_vector(15 downto 0); -- unsigned, 1/16003.125 pu
    iref_alpha     : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    iref_beta      : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    omega_s        : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    omega_r        : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    s_prev_a       : in    std_logic_vector(2 downto 0);  -- unsigned, Position until now
    s_prev_b       : in    std_logic_vector(2 downto 0);  -- unsigned, Position until now
    s_prev_c       : in    std_logic_vector(2 downto 0);  -- unsigned, Position until now
    -- decision, stable until the next valid
    valid          : out   std_logic;                     -- '1' for one clock: decision is new
    busy           : out   std_logic;                     -- '1': a start would be ignored
    s_a            : out   std_logic_vector(2 downto 0);  -- switch position of phase a
    s_b            : out   std_logic_vector(2 downto 0);  -- switch position of phase b
    s_c            : out   std_logic_vector(2 downto 0);  -- switch position of phase c
    held           : out   std_logic;                     -- '1': s(k-1) was kept
    deadlock       : out   std_logic;                     -- '1': no candidate stays inside its bounds
    length         : out   std_logic_vector(5 downto 0);  -- L* of the choice, steps
    saturated      : out   std_logic;                     -- '1': a value did not fit its word
    exhausted      : out   std_logic;                     -- '1': the budget ended the search, the best so far
    cycles         : out   std_logic_vector(15 downto 0); -- of the decision, unsigned, one clock after valid
    -- what the decision used, as in the registers: from one clock after valid until the next valid, 0 after a reset
    flux_alpha     : out   std_logic_vector(15 downto 0); -- rotor flux, the observer's or psir_alpha, signed, 1/9000 pu
    flux_beta      : out   std_logic_vector(15 downto 0); -- likewise
    -- gates
    gates          : out   std_logic_vector(3 * gates_of(true) - 1 downto 0); -- '1': on; S1 to S8 of a, b, c
    running        : out   std_logic;                     -- '1': gates follow decisions
    faults         : out   std_logic_vector(14 downto 0); -- latched, bits as in gate_tables
    -- AXI4-Lite, registers as docs/registers.md has them
    s_axil_awready : out   std_logic;                     -- '1': write address taken
    s_axil_awvalid : in    std_logic;                     -- '1': write address there
    s_axil_awaddr  : in    std_logic_vector(9 downto 0);  -- byte address
    s_axil_awprot  : in    std_logic_vector(2 downto 0);  -- protection, ignored
    s_axil_wready  : out   std_logic;                     -- '1': data taken
    s_axil_wvalid  : in    std_logic;                     -- '1': data there
    s_axil_wdata   : in    std_logic_vector(31 downto 0); -- data
    s_axil_wstrb   : in    std_logic_vector(3 downto 0);  -- '1': byte is written; all four, or the write is refused
    s_axil_bready  : in    std_logic;                     -- '1': response taken
    s_axil_bvalid  : out   std_logic;                     -- '1': response there
    s_axil_bresp   : out   std_logic_vector(1 downto 0);  -- "00" or "10", SLVERR
    s_axil_arready : out   std_logic;                     -- '1': read address taken
    s_axil_arvalid : in    std_logic;                     -- '1': read address there
    s_axil_araddr  : in    std_logic_vector(9 downto 0);  -- byte address
    s_axil_arprot  : in    std_logic_vector(2 downto 0);  -- protection, ignored
    s_axil_rready  : in    std_logic;                     -- '1': data taken
    s_axil_rvalid  : out   std_logic;                     -- '1': data there
    s_axil_rdata   : out   std_logic_vector(31 downto 0); -- data
    s_axil_rresp   : out   std_logic_vector(1 downto 0)   -- "00" or "10", SLVERR
  );
end entity mpdcc_system;

architecture rtl of mpdcc_system is

  constant ESTIMATES   : boolean := LEAKAGE_ESTIMATE and not FOLDED;
  constant OBSERVES    : boolean := FLUX_OBSERVER or CAPACITOR_FILTER or ESTIMATES;
  constant SLOPE_COUNT : natural := SLOPE_PLACES'length; -- coefficients of the current's slopes

  type coefficients_t is array (0 to COEFFICIENT_COUNT - 1) of std_logic_vector(15 downto 0);

  signal from_hardware  : directmpc_mpdcc_in_t;
  signal to_hardware    : directmpc_mpdcc_out_t;
  signal sample         : mpdcc_measurements_out_t; -- measurements of this decision
  signal bands          : std_logic_vector(47 downto 0); -- v_ph_high, v_ph_low, v_n_limit
  signal capabilities   : \system_registers.capabilities_in_t\;

  signal gated_awvalid  : std_logic;
  signal gated_awready  : std_logic;
  signal gated_wvalid   : std_logic;
  signal gated_wready   : std_logic;
  signal gated_bready   : std_logic;
  signal gated_bvalid   : std_logic;
  signal gated_bresp    : std_logic_vector(1 downto 0);
  signal gated_arvalid  : std_logic;
  signal gated_arready  : std_logic;
  signal gated_rready   : std_logic;
  signal gated_rvalid   : std_logic;
  signal gated_rdata    : std_logic_vector(31 downto 0);
  signal gated_rresp    : std_logic_vector(1 downto 0);
  signal take           : std_logic; -- measurements come from the ports
  signal begins         : std_logic; -- go in the next clock
  signal go             : std_logic; -- a decision begins, measurements are in their registers
  signal deciding       : std_logic;
  signal asked          : std_logic; -- control.use_observer, as it was when the decision began
  signal observing      : std_logic; -- asked, and there is an observer
  signal owning         : std_logic; -- control.own_positions, as it was when the decision began
  signal forget         : std_logic; -- the observer is to begin anew, between two decisions
  signal load           : std_logic; -- parameters take effect
  signal load_at_rest   : std_logic; -- a commit waits, no decision is under way; follows no port
  signal load_waits     : std_logic; -- they are not yet in force: they wait for the observer, or are being copied
  signal taking         : std_logic; -- the last one has been copied
  signal filtering      : std_logic; -- the capacitor filters take a step before the core
  signal delayed        : std_logic; -- positions take effect with the measurement, not before
  signal waiting        : std_logic; -- a decision waits for the observer
  signal may_begin      : std_logic; -- it goes on
  signal watching       : std_logic; -- the rotor flux is observed
  signal estimating     : std_logic; -- the leakage is estimated, beside the core
  signal forget_filters : std_logic;
  signal forget_leakage : std_logic;
  signal observer_rst   : std_logic;
  signal observer_start : std_logic;
  signal observer_busy  : std_logic;
  signal filters_valid  : std_logic;
  signal filters_full   : std_logic;
  signal filters_flag   : std_logic; -- filters_full of a step that has ended
  signal used_n         : std_logic_vector(15 downto 0); -- v_n that the core gets
  signal used_a         : std_logic_vector(15 downto 0);
  signal used_b         : std_logic_vector(15 downto 0);
  signal used_c         : std_logic_vector(15 downto 0);
  signal ready          : std_logic; -- voltages are there
  signal observer_valid : std_logic;
  signal observer_alpha : std_logic_vector(15 downto 0);
  signal observer_beta  : std_logic_vector(15 downto 0);
  signal observer_full  : std_logic;
  signal observer_flag  : std_logic; -- observer_full of a step that has ended
  signal leakage_valid  : std_logic;
  signal leakage_full   : std_logic;
  signal leakage_flag   : std_logic; -- a step that has ended, or a coefficient in use, did not fit
  signal estimate_flag  : std_logic; -- of any
  signal shadow_read    : std_logic; -- a parameter has been read by the host
  signal shadow_written : std_logic;
  signal shadow_word    : std_logic_vector(17 downto 0);
  signal c_write        : std_logic; -- a coefficient is written to the observer's memory
  signal c_place        : std_logic_vector(5 downto 0);
  signal c_word         : std_logic_vector(17 downto 0);
  signal copied         : std_logic_vector(16 * COEFFICIENT_COUNT - 1 downto 0); -- coefficients of the core
  signal slopes         : std_logic_vector(16 * SLOPE_COUNT - 1 downto 0); -- those of the current's slopes, scaled
  signal c              : coefficients_t; -- coefficients as the core gets them
  signal bound_current  : std_logic_vector(15 downto 0); -- parameters in force, as parameter_memory
  signal bound_neutral  : std_logic_vector(15 downto 0);
  signal bound_phase    : std_logic_vector(15 downto 0);
  signal horizon        : std_logic_vector(5 downto 0);
  signal weight_scale   : std_logic_vector(1 downto 0);
  signal two_switchings : std_logic;
  signal budget         : std_logic_vector(11 downto 0);
  signal compensate     : std_logic;
  signal deadlock_rule  : std_logic;
  signal inwards_rule   : std_logic;
  signal f_q_midpoint   : std_logic_vector(2 downto 0);
  signal f_q_phase      : std_logic_vector(2 downto 0);
  signal l_mode         : std_logic_vector(1 downto 0);
  signal stale          : std_logic; -- the slopes are to be scaled anew
  signal scale          : std_logic;
  signal scaling        : std_logic;
  signal clipped        : std_logic;
  signal theta          : std_logic_vector(16 downto 0);
  signal theta_stands   : std_logic;
  signal preparing      : std_logic; -- parameters taken over are not yet in force
  signal core_alpha     : std_logic_vector(15 downto 0); -- flux that the core gets
  signal core_beta      : std_logic_vector(15 downto 0);
  signal core_start     : std_logic;
  signal core_valid     : std_logic;
  signal core_a         : std_logic_vector(2 downto 0);
  signal core_b         : std_logic_vector(2 downto 0);
  signal core_c         : std_logic_vector(2 downto 0);
  signal core_held      : std_logic;
  signal core_deadlock  : std_logic;
  signal core_length    : std_logic_vector(5 downto 0);
  signal core_saturated : std_logic;
  signal core_exhausted : std_logic;
  signal core_cost      : std_logic_vector(COST_WIDTH - 1 downto 0);
  signal own_a          : std_logic_vector(2 downto 0);
  signal own_b          : std_logic_vector(2 downto 0);
  signal own_c          : std_logic_vector(2 downto 0);
  signal until_a        : std_logic_vector(2 downto 0);
  signal until_b        : std_logic_vector(2 downto 0);
  signal until_c        : std_logic_vector(2 downto 0);
  signal earlier_a      : std_logic_vector(2 downto 0); -- until_a of the decision before
  signal earlier_b      : std_logic_vector(2 downto 0);
  signal earlier_c      : std_logic_vector(2 downto 0);
  signal taken_a        : std_logic_vector(2 downto 0); -- position of the gates
  signal taken_b        : std_logic_vector(2 downto 0);
  signal taken_c        : std_logic_vector(2 downto 0);
  signal gates_a        : std_logic_vector(2 downto 0); -- the same when the decision began
  signal gates_b        : std_logic_vector(2 downto 0);
  signal gates_c        : std_logic_vector(2 downto 0);
  signal is_running     : std_logic; -- gates follow decisions
  signal followed       : std_logic; -- they have since the last start
  signal followed_on    : std_logic; -- the same when the decision began
  signal stopped        : std_logic; -- they no longer do; the filters have not begun anew
  signal waits_for_go   : std_logic; -- a decision is for the next start
  signal apply          : std_logic; -- the guard gets the core's decision
  signal watched_a      : std_logic_vector(2 downto 0); -- applied from k-1 to k
  signal watched_b      : std_logic_vector(2 downto 0);
  signal watched_c      : std_logic_vector(2 downto 0);

  signal step           : record_t;  -- what the core gets, and what it has decided

  -- number of a coefficient among those of the slopes; SLOPE_COUNT: it is none
  function slope_of (at : natural) return natural is
  begin

    for i in 0 to SLOPE_COUNT - 1 loop
      if (SLOPE_PLACES(i) = at) then
        return i;
      end if;
    end loop;

    return SLOPE_COUNT;

  end function slope_of;

begin

  i_registers : entity work.directmpc_mpdcc_registers
    port map (
      clk            => clk,
      rst            => rst,
      s_axil_awready => gated_awready,
      s_axil_awvalid => gated_awvalid,
      s_axil_awaddr  => s_axil_awaddr,
      s_axil_awprot  => s_axil_awprot,
      s_axil_wready  => gated_wready,
      s_axil_wvalid  => gated_wvalid,
      s_axil_wdata   => s_axil_wdata,
      s_axil_wstrb   => "1111",
      s_axil_bready  => gated_bready,
      s_axil_bvalid  => gated_bvalid,
      s_axil_bresp   => gated_bresp,
      s_axil_arready => gated_arready,
      s_axil_arvalid => gated_arvalid,
      s_axil_araddr  => s_axil_araddr,
      s_axil_arprot  => s_axil_arprot,
      s_axil_rready  => gated_rready,
      s_axil_rvalid  => gated_rvalid,
      s_axil_rdata   => gated_rdata,
      s_axil_rresp   => gated_rresp,
      hwif_in        => from_hardware,
      hwif_out       => to_hardware
    );

  sample <= to_hardware.measurements;
  bands  <= to_hardware.bands.v_ph_high.value.value & to_hardware.bands.v_ph_low.value.value
            & to_hardware.bands.v_n_limit.value.value;

  i_shell : entity work.system_shell
    generic map (
      TABLED_LEG        => true,
      LEAST_DEAD_TIME   => LEAST_DEAD_TIME,
      SECOND_SUPERVISOR => SECOND_SUPERVISOR,
      FIRST_BOUND       => PLACE_BOUND_CURRENT,
      BOUND_LIMIT       => choose(FOLDED, 65535, LARGEST_BOUND),
      RECORDER_ROWS     => RECORDER_ROWS,
      RECORD_INPUTS     => MPDCC_INPUTS,
      RECORD_RESULTS    => MPDCC_RESULTS
    )
    port map (
      clk                => clk,
      rst                => rst,
      enable             => enable,
      external_trip      => external_trip,
      driver_fault       => driver_fault,
      second_clock       => second_clock,
      start              => start,
      m_awvalid          => s_axil_awvalid,
      m_awready          => s_axil_awready,
      m_wvalid           => s_axil_wvalid,
      m_wready           => s_axil_wready,
      m_bready           => s_axil_bready,
      m_awaddr           => s_axil_awaddr,
      m_wdata            => s_axil_wdata,
      m_wstrb            => s_axil_wstrb,
      m_bvalid           => s_axil_bvalid,
      m_bresp            => s_axil_bresp,
      m_araddr           => s_axil_araddr,
      m_arvalid          => s_axil_arvalid,
      m_arready          => s_axil_arready,
      m_rready           => s_axil_rready,
      m_rvalid           => s_axil_rvalid,
      m_rdata            => s_axil_rdata,
      m_rresp            => s_axil_rresp,
      s_awvalid          => gated_awvalid,
      s_awready          => gated_awready,
      s_wvalid           => gated_wvalid,
      s_wready           => gated_wready,
      s_bready           => gated_bready,
      s_bvalid           => gated_bvalid,
      s_bresp            => gated_bresp,
      s_arvalid          => gated_arvalid,
      s_arready          => gated_arready,
      s_rready           => gated_rready,
      s_rvalid           => gated_rvalid,
      s_rdata            => gated_rdata,
      s_rresp            => gated_rresp,
      written            => to_hardware.system,
      settings           => to_hardware.guard,
      bands              => bands,
      capabilities       => capabilities,
      shown              => from_hardware.system,
      take               => take,
      begins             => begins,
      go                 => go,
      deciding           => deciding,
      observing          => asked,
      owning             => owning,
      forget             => forget,
      load               => load,
      load_at_rest       => load_at_rest,
      load_waits         => load_waits,
      preparing          => preparing,
      decides            => core_start,
      decided            => core_valid,
      saturated          => core_saturated,
      deadlock           => core_deadlock,
      clamped            => '0',
      observer_saturated => estimate_flag,
      cycles             => cycles,
      step_words         => step,
      is_alpha           => sample.is_alpha.value.value,
      is_beta            => sample.is_beta.value.value,
      v_dc               => sample.v_dc.value.value,
      v_n                => sample.v_n.value.value,
      v_ph_a             => sample.v_ph_a.value.value,
      v_ph_b             => sample.v_ph_b.value.value,
      v_ph_c             => sample.v_ph_c.value.value,
      omega_r            => sample.omega_r.value.value,
      apply              => apply,
      position_a         => core_a,
      position_b         => core_b,
      position_c         => core_c,
      gates              => gates,
      taken_a            => taken_a,
      taken_b            => taken_b,
      taken_c            => taken_c,
      running            => is_running,
      current            => open,
      faults             => faults
    );

  busy    <= deciding;
  running <= is_running;

  ---------------------------------------------------------------------------------------------
  -- Parameters: the observer may still work with those before; no decision and no scaling begins until all are in force
  ---------------------------------------------------------------------------------------------

  i_parameters : entity work.parameter_memory
    generic map (
      SLOPES => not ESTIMATES
    )
    port map (
      clk             => clk,
      rst             => rst,
      request         => to_hardware.parameters.req,
      writes          => to_hardware.parameters.req_is_wr,
      host_place      => to_hardware.parameters.addr(7 downto 2),
      host_word       => to_hardware.parameters.wr_data(17 downto 0),
      write_done      => shadow_written,
      read_done       => shadow_read,
      read_word       => shadow_word,
      load            => load,
      in_use          => observer_busy,
      waits           => load_waits,
      taken           => taking,
      c_write         => c_write,
      c_place         => c_place,
      c_word          => c_word,
      coefficients    => copied,
      bound_current   => bound_current,
      bound_neutral   => bound_neutral,
      bound_phase     => bound_phase,
      horizon         => horizon,
      weight_scale    => weight_scale,
      two_switchings  => two_switchings,
      budget          => budget,
      compensate      => compensate,
      deadlock_rule   => deadlock_rule,
      outside_inwards => inwards_rule,
      f_q_midpoint    => f_q_midpoint,
      f_q_phase       => f_q_phase,
      l_mode          => l_mode
    );

  from_hardware.parameters.wr_ack  <= shadow_written;
  from_hardware.parameters.rd_ack  <= shadow_read;
  from_hardware.parameters.rd_data <= (31 downto 18 => '0') & shadow_word;

  p_filtering : process (clk) is
  begin

    if rising_edge(clk) then
      if (taking = '1') then
        filtering <= (f_q_midpoint(0) or f_q_midpoint(1) or f_q_midpoint(2)
                      or f_q_phase(0) or f_q_phase(1) or f_q_phase(2)) and to_std_logic(CAPACITOR_FILTER);
      end if;
    end if;

  end process p_filtering;

  g_coefficients : for i in 0 to COEFFICIENT_COUNT - 1 generate

    g_as_copied : if not ESTIMATES or slope_of(i) = SLOPE_COUNT generate
      c(i) <= copied(16 * i + 15 downto 16 * i);
    end generate g_as_copied;

    g_scaled : if ESTIMATES and slope_of(i) < SLOPE_COUNT generate
      c(i) <= slopes(16 * slope_of(i) + 15 downto 16 * slope_of(i));
    end generate g_scaled;

  end generate g_coefficients;

  from_hardware.measurements.is_alpha.value <= (next_q => is_alpha, we => take);
  from_hardware.measurements.is_beta.value <= (next_q => is_beta, we => take);
  from_hardware.measurements.psir_alpha.value <= (next_q => psir_alpha, we => take);
  from_hardware.measurements.psir_beta.value <= (next_q => psir_beta, we => take);
  from_hardware.measurements.v_n.value <= (next_q => v_n, we => take);
  from_hardware.measurements.v_ph_a.value <= (next_q => v_ph_a, we => take);
  from_hardware.measurements.v_ph_b.value <= (next_q => v_ph_b, we => take);
  from_hardware.measurements.v_ph_c.value <= (next_q => v_ph_c, we => take);
  from_hardware.measurements.v_dc.value <= (next_q => v_dc, we => take);
  from_hardware.measurements.iref_alpha.value <= (next_q => iref_alpha, we => take);
  from_hardware.measurements.iref_beta.value <= (next_q => iref_beta, we => take);
  from_hardware.measurements.omega_s.value <= (next_q => omega_s, we => take);
  from_hardware.measurements.omega_r.value <= (next_q => omega_r, we => take);
  from_hardware.measurements.s_prev_a.value <= (next_q => s_prev_a, we => take);
  from_hardware.measurements.s_prev_b.value <= (next_q => s_prev_b, we => take);
  from_hardware.measurements.s_prev_c.value <= (next_q => s_prev_c, we => take);

  ---------------------------------------------------------------------------------------------
  -- Filters, observer and core
  ---------------------------------------------------------------------------------------------

  until_a <= own_a when owning = '1' else
             sample.s_prev_a.value.value;
  until_b <= own_b when owning = '1' else
             sample.s_prev_b.value.value;
  until_c <= own_c when owning = '1' else
             sample.s_prev_c.value.value;

  -- with delay compensation until_a to until_c take effect now, and those of the step before did until now
  delayed   <= compensate and to_std_logic(SECOND_LEVEL and not FOLDED);
  watched_a <= gates_a when followed_on = '1' else
               earlier_a when delayed = '1' else
               until_a;
  watched_b <= gates_b when followed_on = '1' else
               earlier_b when delayed = '1' else
               until_b;
  watched_c <= gates_c when followed_on = '1' else
               earlier_c when delayed = '1' else
               until_c;

  p_gates : process (clk) is
  begin

    if rising_edge(clk) then
      -- A decision for the next step waits for its start; what waits is given, whatever has been committed since. None
      -- begins in the clock of core_valid.
      apply <= (core_valid and not delayed) or (begins and waits_for_go);

      if (core_valid = '1') then
        waits_for_go <= delayed;
      elsif (go = '1') then
        waits_for_go <= '0';
      end if;

      -- until a decision begins; with go the guard may get the next one
      if (deciding = '0') then
        gates_a     <= taken_a;
        gates_b     <= taken_b;
        gates_c     <= taken_c;
        followed_on <= followed and is_running;
      end if;

      if (is_running = '0') then
        followed <= '0';
      elsif (go = '1') then
        followed <= '1';
      end if;

      if (followed = '1' and is_running = '0') then
        stopped <= '1';
      elsif (observer_busy = '0') then
        stopped <= '0';
      end if;

      if (rst = '1') then
        apply        <= '0';
        waits_for_go <= '0';
        followed_on  <= '0';
        followed     <= '0';
        stopped      <= '0';
      end if;
    end if;

  end process p_gates;

  -- A step begins before the decision, once the step before and a scaling are over.
  may_begin      <= (go or waiting) and not observer_busy and not load_waits and not stale;
  observing      <= asked and to_std_logic(OBSERVES);
  watching       <= observing or estimating;
  -- what is stale is scaled first: a step waits for it; the observer ignores start while it is busy
  observer_start <= (stale and not load_at_rest and not load_waits)
                    or ((go or waiting) and (filtering or watching) and not stale and not load_waits);
  observer_rst   <= rst or (forget and not deciding);
  forget_filters <= not filtering or (stopped and not observer_busy);

  p_waiting : process (clk) is
  begin

    if rising_edge(clk) then
      if (may_begin = '1') then
        waiting <= '0';
      elsif (go = '1') then
        waiting <= '1';
      end if;

      if (rst = '1') then
        waiting <= '0';
      end if;
    end if;

  end process p_waiting;

  g_observer : if OBSERVES generate

    i_observer : entity work.state_observer
      generic map (
        FILTERS => CAPACITOR_FILTER,
        LEAKAGE => ESTIMATES
      )
      port map (
        clk               => clk,
        rst               => observer_rst,
        forget_filters    => forget_filters,
        forget_leakage    => forget_leakage,
        start             => observer_start,
        scale             => stale,
        with_filters      => filtering,
        with_flux         => watching,
        with_leakage      => estimating,
        observed          => observing,
        is_alpha          => sample.is_alpha.value.value,
        is_beta           => sample.is_beta.value.value,
        v_n               => sample.v_n.value.value,
        v_ph_a            => sample.v_ph_a.value.value,
        v_ph_b            => sample.v_ph_b.value.value,
        v_ph_c            => sample.v_ph_c.value.value,
        v_dc              => sample.v_dc.value.value,
        omega_r           => sample.omega_r.value.value,
        s_a               => watched_a,
        s_b               => watched_b,
        s_c               => watched_c,
        psir_alpha        => core_alpha,
        psir_beta         => core_beta,
        f_q_midpoint      => f_q_midpoint,
        f_q_phase         => f_q_phase,
        frozen            => l_mode(1),
        c_write           => c_write,
        c_place           => c_place,
        c_word            => c_word,
        busy              => observer_busy,
        scaling           => scaling,
        filters_valid     => filters_valid,
        used_n            => used_n,
        used_a            => used_a,
        used_b            => used_b,
        used_c            => used_c,
        filters_saturated => filters_full,
        valid             => observer_valid,
        flux_alpha        => observer_alpha,
        flux_beta         => observer_beta,
        saturated         => observer_full,
        leakage_valid     => leakage_valid,
        theta             => theta,
        leakage_saturated => leakage_full,
        scaled            => slopes,
        clipped           => clipped
      );

  end generate g_observer;

  g_no_observer : if not OBSERVES generate
    observer_busy  <= '0';
    scaling        <= '0';
    filters_valid  <= '0';
    used_n         <= sample.v_n.value.value;
    used_a         <= sample.v_ph_a.value.value;
    used_b         <= sample.v_ph_b.value.value;
    used_c         <= sample.v_ph_c.value.value;
    filters_full   <= '0';
    observer_valid <= '0';
    observer_alpha <= (others => '0');
    observer_beta  <= (others => '0');
    observer_full  <= '0';
    leakage_valid  <= '0';
    theta          <= (16 => '1', others => '0');
    leakage_full   <= '0';
    slopes         <= (others => '0');
    clipped        <= '0';
  end generate g_no_observer;

  ready         <= filters_valid when filtering = '1' else
                   may_begin;
  filters_flag  <= filters_valid and filters_full;
  observer_flag <= observer_valid and observer_full and observing;
  leakage_flag  <= (leakage_valid and leakage_full) or (core_start and clipped);
  estimate_flag <= observer_flag or filters_flag or leakage_flag;

  core_alpha   <= observer_alpha when observing = '1' else
                  sample.psir_alpha.value.value;
  core_beta    <= observer_beta when observing = '1' else
                  sample.psir_beta.value.value;
  core_start   <= observer_valid when observing = '1' else
                  ready;
  theta_stands <= not observer_busy;

  g_leakage : if ESTIMATES generate

    signal loaded : std_logic; -- parameters have been taken over a clock ago

  begin

    estimating     <= l_mode(0);
    forget_leakage <= loaded and not estimating;
    -- under a decision of the core nothing is stale: a load at its end need not be waited for
    scale          <= stale and not observer_busy and not load_at_rest and not load_waits and not observer_rst;

    p_stale : process (clk) is
    begin

      if rising_edge(clk) then
        loaded <= taking;

        if (load = '1') then
          preparing <= '1';
        elsif (stale = '0' and scaling = '0' and load_waits = '0') then
          preparing <= '0';
        end if;

        -- a reset may end a scaling
        if (taking = '1' or (core_valid = '1' and estimating = '1')
            or (observer_rst = '1' and (estimating = '1' or scaling = '1'))) then
          stale <= '1';
        elsif (scale = '1') then
          stale <= '0';
        end if;

        if (rst = '1') then
          loaded    <= '0';
          preparing <= '0';
          stale     <= '1';
        end if;
      end if;

    end process p_stale;

  end generate g_leakage;

  g_no_leakage : if not ESTIMATES generate
    estimating     <= '0';
    forget_leakage <= '0';
    scale          <= '0';
    stale          <= '0';
    preparing      <= load_waits;
  end generate g_no_leakage;

  i_core : entity work.mpdcc_core
    generic map (
      EXPLORERS         => EXPLORERS,
      FOLDED            => FOLDED,
      SECOND_LEVEL      => SECOND_LEVEL and not FOLDED,
      WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK and not FOLDED,
      INWARDS           => INWARDS and not FOLDED
    )
    port map (
      clk                         => clk,
      rst                         => rst,
      start                       => core_start,
      is_alpha                    => sample.is_alpha.value.value,
      is_beta                     => sample.is_beta.value.value,
      psir_alpha                  => core_alpha,
      psir_beta                   => core_beta,
      v_n                         => used_n,
      v_ph_a                      => used_a,
      v_ph_b                      => used_b,
      v_ph_c                      => used_c,
      v_dc                        => sample.v_dc.value.value,
      iref_alpha                  => sample.iref_alpha.value.value,
      iref_beta                   => sample.iref_beta.value.value,
      omega_s                     => sample.omega_s.value.value,
      omega_r                     => sample.omega_r.value.value,
      s_prev_a                    => until_a,
      s_prev_b                    => until_b,
      s_prev_c                    => until_c,
      c_error_alpha               => c(PLACE_C_ERROR_ALPHA),
      c_error_beta                => c(PLACE_C_ERROR_BETA),
      c_error_neutral             => c(PLACE_C_ERROR_NEUTRAL),
      c_error_phase               => c(PLACE_C_ERROR_PHASE),
      c_stator_alpha              => c(PLACE_C_STATOR_ALPHA),
      c_stator_beta               => c(PLACE_C_STATOR_BETA),
      c_rotor_alpha               => c(PLACE_C_ROTOR_ALPHA),
      c_rotor_beta                => c(PLACE_C_ROTOR_BETA),
      c_reference_alpha           => c(PLACE_C_REFERENCE_ALPHA),
      c_reference_beta            => c(PLACE_C_REFERENCE_BETA),
      c_emf_alpha                 => c(PLACE_C_EMF_ALPHA),
      c_emf_beta                  => c(PLACE_C_EMF_BETA),
      c_correction_alpha          => c(PLACE_C_CORRECTION_ALPHA),
      c_correction_beta           => c(PLACE_C_CORRECTION_BETA),
      c_forced_voltage            => c(PLACE_C_FORCED_VOLTAGE),
      c_forced_neutral            => c(PLACE_C_FORCED_NEUTRAL),
      c_phase_alpha               => c(PLACE_C_PHASE_ALPHA),
      c_phase_beta                => c(PLACE_C_PHASE_BETA),
      c_midpoint_alpha            => c(PLACE_C_MIDPOINT_ALPHA),
      c_midpoint_beta             => c(PLACE_C_MIDPOINT_BETA),
      c_weight                    => c(PLACE_C_WEIGHT),
      c_weight_alpha              => c(PLACE_C_WEIGHT_ALPHA),
      c_weight_beta               => c(PLACE_C_WEIGHT_BETA),
      c_curvature_emf_alpha       => c(PLACE_C_CURVATURE_EMF_ALPHA),
      c_curvature_emf_beta        => c(PLACE_C_CURVATURE_EMF_BETA),
      c_curvature_flux_alpha      => c(PLACE_C_CURVATURE_FLUX_ALPHA),
      c_curvature_flux_beta       => c(PLACE_C_CURVATURE_FLUX_BETA),
      c_curvature_reference_alpha => c(PLACE_C_CURVATURE_REFERENCE_ALPHA),
      c_curvature_reference_beta  => c(PLACE_C_CURVATURE_REFERENCE_BETA),
      bound_current               => bound_current,
      bound_neutral               => bound_neutral,
      bound_phase                 => bound_phase,
      horizon                     => horizon,
      weight_scale                => weight_scale,
      two_switchings              => two_switchings,
      budget                      => budget,
      compensate                  => compensate,
      deadlock_rule               => deadlock_rule,
      outside_inwards             => inwards_rule,
      c_change_phase              => c(PLACE_C_CHANGE_PHASE),
      c_change_midpoint           => c(PLACE_C_CHANGE_MIDPOINT),
      c_change_weight             => c(PLACE_C_CHANGE_WEIGHT),
      c_error_forced              => c(PLACE_C_ERROR_FORCED),
      valid                       => core_valid,
      busy                        => open,
      s_a                         => core_a,
      s_b                         => core_b,
      s_c                         => core_c,
      held                        => core_held,
      deadlock                    => core_deadlock,
      length                      => core_length,
      saturated                   => core_saturated,
      exhausted                   => core_exhausted,
      cost                        => core_cost
    );

  p_own : process (clk) is
  begin

    if rising_edge(clk) then
      if (core_valid = '1') then
        own_a     <= core_a;
        own_b     <= core_b;
        own_c     <= core_c;
        earlier_a <= until_a;
        earlier_b <= until_b;
        earlier_c <= until_c;
      end if;

      if (rst = '1') then
        own_a     <= (others => '0');
        own_b     <= (others => '0');
        own_c     <= (others => '0');
        earlier_a <= (others => '0');
        earlier_b <= (others => '0');
        earlier_c <= (others => '0');
      end if;
    end if;

  end process p_own;

  ---------------------------------------------------------------------------------------------
  -- Recorder
  ---------------------------------------------------------------------------------------------

  p_step : process (all) is
  begin

    step <= (others => '0');
    step(MPDCC_IS_ALPHA + 15 downto MPDCC_IS_ALPHA) <= sample.is_alpha.value.value;
    step(MPDCC_IS_BETA + 15 downto MPDCC_IS_BETA) <= sample.is_beta.value.value;
    step(MPDCC_V_DC + 15 downto MPDCC_V_DC) <= sample.v_dc.value.value;
    step(MPDCC_IREF_ALPHA + 15 downto MPDCC_IREF_ALPHA) <= sample.iref_alpha.value.value;
    step(MPDCC_IREF_BETA + 15 downto MPDCC_IREF_BETA) <= sample.iref_beta.value.value;
    step(MPDCC_OMEGA_S + 15 downto MPDCC_OMEGA_S) <= sample.omega_s.value.value;
    step(MPDCC_OMEGA_R + 15 downto MPDCC_OMEGA_R) <= sample.omega_r.value.value;
    step(MPDCC_PSIR_ALPHA + 15 downto MPDCC_PSIR_ALPHA) <= core_alpha;
    step(MPDCC_PSIR_BETA + 15 downto MPDCC_PSIR_BETA) <= core_beta;
    step(MPDCC_V_N + 15 downto MPDCC_V_N) <= used_n;
    step(MPDCC_V_PH_A + 15 downto MPDCC_V_PH_A) <= used_a;
    step(MPDCC_V_PH_B + 15 downto MPDCC_V_PH_B) <= used_b;
    step(MPDCC_V_PH_C + 15 downto MPDCC_V_PH_C) <= used_c;
    step(MPDCC_APPLIED + 8 downto MPDCC_APPLIED) <= until_c & until_b & until_a;
    step(MPDCC_LEAKAGE + 16 downto MPDCC_LEAKAGE) <= theta;
    step(MPDCC_LENGTH + 5 downto MPDCC_LENGTH) <= core_length;
    step(MPDCC_HELD) <= core_held;
    step(MPDCC_DEADLOCK) <= core_deadlock;
    step(RECORD_APPLIED_NEXT + 8 downto RECORD_APPLIED_NEXT) <= core_c & core_b & core_a;
    step(MPDCC_EXHAUSTED) <= core_exhausted;
    step(MPDCC_COST + COST_WIDTH - 1 downto MPDCC_COST) <= core_cost;

  end process p_step;

  ---------------------------------------------------------------------------------------------
  -- What registers and ports show
  ---------------------------------------------------------------------------------------------

  capabilities.controller.next_q      <= "0001";
  capabilities.explorers.next_q       <= std_logic_vector(to_unsigned(EXPLORERS, 4));
  capabilities.folded.next_q          <= to_std_logic(FOLDED);
  capabilities.second_level.next_q    <= to_std_logic(SECOND_LEVEL and not FOLDED);
  capabilities.weighted_deadlock.next_q <= to_std_logic(WEIGHTED_DEADLOCK and not FOLDED);
  capabilities.inwards.next_q         <= to_std_logic(INWARDS and not FOLDED);
  capabilities.capacitor_filter.next_q <= to_std_logic(CAPACITOR_FILTER);
  capabilities.leakage_estimate.next_q <= to_std_logic(ESTIMATES);
  capabilities.flux_control.next_q    <= '0';
  capabilities.family.next_q <= '0';
  capabilities.sensorless.next_q <= '0';
  capabilities.recorder.next_q        <= to_std_logic(RECORDER_ROWS > 0);
  capabilities.observer.next_q        <= to_std_logic(OBSERVES);
  capabilities.least_dead_time.next_q <= std_logic_vector(to_unsigned(LEAST_DEAD_TIME, 12));

  from_hardware.result.decision.s_a <= (next_q => core_a, we => core_valid);
  from_hardware.result.decision.s_b <= (next_q => core_b, we => core_valid);
  from_hardware.result.decision.s_c <= (next_q => core_c, we => core_valid);
  from_hardware.result.decision.held <= (next_q => core_held, we => core_valid);
  from_hardware.result.decision.deadlock <= (next_q => core_deadlock, we => core_valid);
  from_hardware.result.decision.exhausted <= (next_q => core_exhausted, we => core_valid);
  from_hardware.result.decision.saturated <= (next_q => core_saturated, we => core_valid);
  from_hardware.result.decision.length <= (next_q => core_length, we => core_valid);
  from_hardware.result.rotor_flux.alpha <= (next_q => core_alpha, we => core_valid);
  from_hardware.result.rotor_flux.beta <= (next_q => core_beta, we => core_valid);
  from_hardware.result.leakage.theta <= (next_q => theta, we => theta_stands);

  flux_alpha <= to_hardware.result.rotor_flux.alpha.value;
  flux_beta  <= to_hardware.result.rotor_flux.beta.value;

  valid     <= core_valid;
  s_a       <= core_a;
  s_b       <= core_b;
  s_c       <= core_c;
  held      <= core_held;
  deadlock  <= core_deadlock;
  length    <= core_length;
  saturated <= core_saturated;
  exhausted <= core_exhausted;

end architecture rtl;
