-- A complete MPDCC controller with a bus: registers, rotor-flux observer, core, gate guard.
--
-- Measurements come with start, from the ports or from registers (control.registers_as_source, then
-- command.start), and are kept there.  With control.use_observer the observer takes its step first and its
-- flux replaces psir.  The core decides; the guard turns the decision into gates.  Parameters and the guard's
-- settings are shadows that take effect together between two decisions (decision_sequencer).
--
-- Formats: as mpdcc_core and gate_guard; registers as docs/registers.md.
-- Latency: the core starts one clock after start, or when the observer is done (valid 15 clocks later).
-- Overflow: saturates and sets flags; a start while busy is ignored and sets one.
-- Weighed, not built: a bus of our own, which saves a few dozen flip-flops (estimated) and loses every tool that
-- knows AXI.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_mpdcc_registers_pkg.all;
  use work.gate_tables.all;

entity mpdcc_system is
  generic (
    EXPLORERS         : positive range 1 to 8    := 2;     -- number of explorers
    FOLDED            : boolean                  := false; -- true: the paper's explorer, false: the fast one
    SECOND_LEVEL      : boolean                  := true;  -- true: SESE and delay compensation, fast explorer alone
    WEIGHTED_DEADLOCK : boolean                  := true;  -- true: the weighted deadlock rule, fast explorer alone
    LEAST_DEAD_TIME   : positive range 1 to 4095 := 10     -- clocks; shorter dead times are raised to it
  );
  port (
    clk            : in    std_logic;                     -- rising edge
    rst            : in    std_logic;                     -- synchronous, active high
    enable         : in    std_logic;                     -- '1': gates may be on, if control.enable is set too
    external_trip  : in    std_logic;                     -- '1': all gates off
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
    -- gates
    gates          : out   std_logic_vector(23 downto 0); -- '1': on; S1 to S8 of a, b, c
    running        : out   std_logic;                     -- '1': gates follow decisions
    faults         : out   std_logic_vector(8 downto 0);  -- latched, bits as in gate_tables
    -- AXI4-Lite, registers as docs/registers.md has them
    s_axil_awready : out   std_logic;                     -- '1': write address taken
    s_axil_awvalid : in    std_logic;                     -- '1': write address there
    s_axil_awaddr  : in    std_logic_vector(9 downto 0);  -- byte address
    s_axil_awprot  : in    std_logic_vector(2 downto 0);  -- protection, ignored
    s_axil_wready  : out   std_logic;                     -- '1': data taken
    s_axil_wvalid  : in    std_logic;                     -- '1': data there
    s_axil_wdata   : in    std_logic_vector(31 downto 0); -- data
    s_axil_wstrb   : in    std_logic_vector(3 downto 0);  -- '1': byte is written
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

  signal from_hardware  : directmpc_mpdcc_in_t;
  signal to_hardware    : directmpc_mpdcc_out_t;
  signal control        : \system_registers.control_out_t\;
  signal command        : \system_registers.command_out_t\;
  signal parameters     : mpdcc_parameters_out_t;
  signal guard_settings : guard_registers_out_t;
  signal sample         : mpdcc_measurements_out_t;

  -- parameters and settings in force
  signal c_error_alpha_now                : std_logic_vector(15 downto 0);
  signal c_error_beta_now                 : std_logic_vector(15 downto 0);
  signal c_error_neutral_now              : std_logic_vector(15 downto 0);
  signal c_error_phase_now                : std_logic_vector(15 downto 0);
  signal c_stator_alpha_now               : std_logic_vector(15 downto 0);
  signal c_stator_beta_now                : std_logic_vector(15 downto 0);
  signal c_rotor_alpha_now                : std_logic_vector(15 downto 0);
  signal c_rotor_beta_now                 : std_logic_vector(15 downto 0);
  signal c_reference_alpha_now            : std_logic_vector(15 downto 0);
  signal c_reference_beta_now             : std_logic_vector(15 downto 0);
  signal c_emf_alpha_now                  : std_logic_vector(15 downto 0);
  signal c_emf_beta_now                   : std_logic_vector(15 downto 0);
  signal c_correction_alpha_now           : std_logic_vector(15 downto 0);
  signal c_correction_beta_now            : std_logic_vector(15 downto 0);
  signal c_forced_voltage_now             : std_logic_vector(15 downto 0);
  signal c_forced_neutral_now             : std_logic_vector(15 downto 0);
  signal c_phase_alpha_now                : std_logic_vector(15 downto 0);
  signal c_phase_beta_now                 : std_logic_vector(15 downto 0);
  signal c_midpoint_alpha_now             : std_logic_vector(15 downto 0);
  signal c_midpoint_beta_now              : std_logic_vector(15 downto 0);
  signal c_weight_now                     : std_logic_vector(15 downto 0);
  signal c_weight_alpha_now               : std_logic_vector(15 downto 0);
  signal c_weight_beta_now                : std_logic_vector(15 downto 0);
  signal c_curvature_emf_alpha_now        : std_logic_vector(15 downto 0);
  signal c_curvature_emf_beta_now         : std_logic_vector(15 downto 0);
  signal c_curvature_flux_alpha_now       : std_logic_vector(15 downto 0);
  signal c_curvature_flux_beta_now        : std_logic_vector(15 downto 0);
  signal c_curvature_reference_alpha_now  : std_logic_vector(15 downto 0);
  signal c_curvature_reference_beta_now   : std_logic_vector(15 downto 0);
  signal bound_current_now                : std_logic_vector(15 downto 0);
  signal bound_neutral_now                : std_logic_vector(15 downto 0);
  signal bound_phase_now                  : std_logic_vector(15 downto 0);
  signal horizon_now                      : std_logic_vector(5 downto 0);
  signal weight_scale_now                 : std_logic_vector(1 downto 0);
  signal two_switchings_now               : std_logic;
  signal budget_now                       : std_logic_vector(11 downto 0);
  signal compensate_now                   : std_logic;
  signal deadlock_rule_now                : std_logic;
  signal c_change_phase_now               : std_logic_vector(15 downto 0);
  signal c_change_midpoint_now            : std_logic_vector(15 downto 0);
  signal c_change_weight_now              : std_logic_vector(15 downto 0);
  signal c_error_forced_now               : std_logic_vector(15 downto 0);
  signal o_speed_now                      : std_logic_vector(17 downto 0);
  signal o_voltage_alpha_now              : std_logic_vector(17 downto 0);
  signal o_voltage_beta_now               : std_logic_vector(17 downto 0);
  signal o_drop_now                       : std_logic_vector(17 downto 0);
  signal o_pull_now                       : std_logic_vector(17 downto 0);
  signal o_pull_flux_now                  : std_logic_vector(17 downto 0);
  signal o_pull_current_now               : std_logic_vector(17 downto 0);
  signal o_decay_now                      : std_logic_vector(17 downto 0);
  signal o_excitation_now                 : std_logic_vector(17 downto 0);
  signal o_output_flux_now                : std_logic_vector(17 downto 0);
  signal o_output_current_now             : std_logic_vector(17 downto 0);
  signal dead_time_now                    : std_logic_vector(11 downto 0);
  signal minimum_on_now                   : std_logic_vector(11 downto 0);
  signal minimum_off_now                  : std_logic_vector(11 downto 0);
  signal decision_limit_now               : std_logic_vector(15 downto 0);
  signal watchdog_now                     : std_logic_vector(15 downto 0);
  signal current_limit_now                : std_logic_vector(15 downto 0);
  signal link_high_now                    : std_logic_vector(15 downto 0);
  signal link_low_now                     : std_logic_vector(15 downto 0);

  signal hold           : std_logic; -- a commit has not taken effect
  signal gated_awvalid  : std_logic;
  signal gated_awready  : std_logic;
  signal gated_wvalid   : std_logic;
  signal gated_wready   : std_logic;
  signal response       : std_logic;
  signal take           : std_logic; -- measurements come from the ports
  signal go             : std_logic; -- a decision begins, measurements are in their registers
  signal deciding       : std_logic;
  signal ignored        : std_logic; -- a start, of either kind
  signal observing      : std_logic; -- control.use_observer, as it was when the decision began
  signal owning         : std_logic; -- control.own_positions, likewise
  signal forget         : std_logic; -- the observer is to begin anew, between two decisions
  signal load           : std_logic;
  signal pending        : std_logic;
  signal commits        : std_logic_vector(15 downto 0);
  signal observer_rst   : std_logic;
  signal observer_start : std_logic;
  signal observer_valid : std_logic;
  signal observer_busy  : std_logic;
  signal observer_alpha : std_logic_vector(15 downto 0);
  signal observer_beta  : std_logic_vector(15 downto 0);
  signal observer_full  : std_logic;
  signal flux_alpha     : std_logic_vector(15 downto 0);
  signal flux_beta      : std_logic_vector(15 downto 0);
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
  signal own_a          : std_logic_vector(2 downto 0);
  signal own_b          : std_logic_vector(2 downto 0);
  signal own_c          : std_logic_vector(2 downto 0);
  signal until_a        : std_logic_vector(2 downto 0);
  signal until_b        : std_logic_vector(2 downto 0);
  signal until_c        : std_logic_vector(2 downto 0);
  signal last_cycles    : std_logic_vector(15 downto 0);
  signal worst_cycles   : std_logic_vector(15 downto 0);
  signal decisions      : std_logic_vector(31 downto 0);
  signal enabled        : std_logic;
  signal all_gates      : std_logic_vector(23 downto 0);
  signal is_running     : std_logic;
  signal is_resting     : std_logic;
  signal latched        : std_logic_vector(8 downto 0);
  signal shown          : std_logic_vector(8 downto 0); -- faults as the register has them
  signal shown_before   : std_logic_vector(8 downto 0);
  signal clear          : std_logic_vector(8 downto 0);

begin

  i_gate : entity work.write_gate
    port map (
      clk       => clk,
      rst       => rst,
      hold      => hold,
      m_awvalid => s_axil_awvalid,
      m_awready => s_axil_awready,
      m_wvalid  => s_axil_wvalid,
      m_wready  => s_axil_wready,
      m_bready  => s_axil_bready,
      s_awvalid => gated_awvalid,
      s_awready => gated_awready,
      s_wvalid  => gated_wvalid,
      s_wready  => gated_wready,
      s_bvalid  => response
    );

  hold          <= command.commit.value or pending;
  s_axil_bvalid <= response;

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
      s_axil_wstrb   => s_axil_wstrb,
      s_axil_bready  => s_axil_bready,
      s_axil_bvalid  => response,
      s_axil_bresp   => s_axil_bresp,
      s_axil_arready => s_axil_arready,
      s_axil_arvalid => s_axil_arvalid,
      s_axil_araddr  => s_axil_araddr,
      s_axil_arprot  => s_axil_arprot,
      s_axil_rready  => s_axil_rready,
      s_axil_rvalid  => s_axil_rvalid,
      s_axil_rdata   => s_axil_rdata,
      s_axil_rresp   => s_axil_rresp,
      hwif_in        => from_hardware,
      hwif_out       => to_hardware
    );

  control        <= to_hardware.system.control;
  command        <= to_hardware.system.command;
  parameters     <= to_hardware.parameters;
  guard_settings <= to_hardware.guard;
  sample         <= to_hardware.measurements;

  ---------------------------------------------------------------------------------------------
  -- Start, and what is in force
  ---------------------------------------------------------------------------------------------

  i_sequencer : entity work.decision_sequencer
    port map (
      clk            => clk,
      rst            => rst,
      start          => start,
      command_start  => command.start.value,
      from_registers => control.registers_as_source.value,
      use_observer   => control.use_observer.value,
      own_positions  => control.own_positions.value,
      reset_observer => command.reset_observer.value,
      commit         => command.commit.value,
      ending         => core_valid,
      take           => take,
      go             => go,
      deciding       => deciding,
      ignored        => ignored,
      observing      => observing,
      owning         => owning,
      forget         => forget,
      load           => load,
      pending        => pending,
      commits        => commits
    );

  busy <= deciding;

  p_active : process (clk) is
  begin

    if rising_edge(clk) then
      if (load = '1') then
        c_error_alpha_now                <= parameters.c_error_alpha.value.value;
        c_error_beta_now                 <= parameters.c_error_beta.value.value;
        c_error_neutral_now              <= parameters.c_error_neutral.value.value;
        c_error_phase_now                <= parameters.c_error_phase.value.value;
        c_stator_alpha_now               <= parameters.c_stator_alpha.value.value;
        c_stator_beta_now                <= parameters.c_stator_beta.value.value;
        c_rotor_alpha_now                <= parameters.c_rotor_alpha.value.value;
        c_rotor_beta_now                 <= parameters.c_rotor_beta.value.value;
        c_reference_alpha_now            <= parameters.c_reference_alpha.value.value;
        c_reference_beta_now             <= parameters.c_reference_beta.value.value;
        c_emf_alpha_now                  <= parameters.c_emf_alpha.value.value;
        c_emf_beta_now                   <= parameters.c_emf_beta.value.value;
        c_correction_alpha_now           <= parameters.c_correction_alpha.value.value;
        c_correction_beta_now            <= parameters.c_correction_beta.value.value;
        c_forced_voltage_now             <= parameters.c_forced_voltage.value.value;
        c_forced_neutral_now             <= parameters.c_forced_neutral.value.value;
        c_phase_alpha_now                <= parameters.c_phase_alpha.value.value;
        c_phase_beta_now                 <= parameters.c_phase_beta.value.value;
        c_midpoint_alpha_now             <= parameters.c_midpoint_alpha.value.value;
        c_midpoint_beta_now              <= parameters.c_midpoint_beta.value.value;
        c_weight_now                     <= parameters.c_weight.value.value;
        c_weight_alpha_now               <= parameters.c_weight_alpha.value.value;
        c_weight_beta_now                <= parameters.c_weight_beta.value.value;
        c_curvature_emf_alpha_now        <= parameters.c_curvature_emf_alpha.value.value;
        c_curvature_emf_beta_now         <= parameters.c_curvature_emf_beta.value.value;
        c_curvature_flux_alpha_now       <= parameters.c_curvature_flux_alpha.value.value;
        c_curvature_flux_beta_now        <= parameters.c_curvature_flux_beta.value.value;
        c_curvature_reference_alpha_now  <= parameters.c_curvature_reference_alpha.value.value;
        c_curvature_reference_beta_now   <= parameters.c_curvature_reference_beta.value.value;
        bound_current_now                <= parameters.bound_current.value.value;
        bound_neutral_now                <= parameters.bound_neutral.value.value;
        bound_phase_now                  <= parameters.bound_phase.value.value;
        horizon_now                      <= parameters.horizon.value.value;
        weight_scale_now                 <= parameters.weight_scale.value.value;
        two_switchings_now               <= parameters.two_switchings.value.value;
        budget_now                       <= parameters.budget.value.value;
        compensate_now                   <= parameters.compensate.value.value;
        deadlock_rule_now                <= parameters.deadlock_rule.value.value;
        c_change_phase_now               <= parameters.c_change_phase.value.value;
        c_change_midpoint_now            <= parameters.c_change_midpoint.value.value;
        c_change_weight_now              <= parameters.c_change_weight.value.value;
        c_error_forced_now               <= parameters.c_error_forced.value.value;
        o_speed_now                      <= parameters.o_speed.value.value;
        o_voltage_alpha_now              <= parameters.o_voltage_alpha.value.value;
        o_voltage_beta_now               <= parameters.o_voltage_beta.value.value;
        o_drop_now                       <= parameters.o_drop.value.value;
        o_pull_now                       <= parameters.o_pull.value.value;
        o_pull_flux_now                  <= parameters.o_pull_flux.value.value;
        o_pull_current_now               <= parameters.o_pull_current.value.value;
        o_decay_now                      <= parameters.o_decay.value.value;
        o_excitation_now                 <= parameters.o_excitation.value.value;
        o_output_flux_now                <= parameters.o_output_flux.value.value;
        o_output_current_now             <= parameters.o_output_current.value.value;
        dead_time_now                    <= guard_settings.dead_time.clocks.value;
        minimum_on_now                   <= guard_settings.minimum_on.clocks.value;
        minimum_off_now                  <= guard_settings.minimum_off.clocks.value;
        decision_limit_now               <= guard_settings.decision_limit.clocks.value;
        watchdog_now                     <= guard_settings.watchdog.clocks.value;
        current_limit_now                <= guard_settings.current_limit.value.value;
        link_high_now                    <= guard_settings.link_high.value.value;
        link_low_now                     <= guard_settings.link_low.value.value;
      end if;
    end if;

  end process p_active;

  from_hardware.measurements.is_alpha.value.next_q <= is_alpha;
  from_hardware.measurements.is_alpha.value.we     <= take;
  from_hardware.measurements.is_beta.value.next_q <= is_beta;
  from_hardware.measurements.is_beta.value.we     <= take;
  from_hardware.measurements.psir_alpha.value.next_q <= psir_alpha;
  from_hardware.measurements.psir_alpha.value.we     <= take;
  from_hardware.measurements.psir_beta.value.next_q <= psir_beta;
  from_hardware.measurements.psir_beta.value.we     <= take;
  from_hardware.measurements.v_n.value.next_q <= v_n;
  from_hardware.measurements.v_n.value.we     <= take;
  from_hardware.measurements.v_ph_a.value.next_q <= v_ph_a;
  from_hardware.measurements.v_ph_a.value.we     <= take;
  from_hardware.measurements.v_ph_b.value.next_q <= v_ph_b;
  from_hardware.measurements.v_ph_b.value.we     <= take;
  from_hardware.measurements.v_ph_c.value.next_q <= v_ph_c;
  from_hardware.measurements.v_ph_c.value.we     <= take;
  from_hardware.measurements.v_dc.value.next_q <= v_dc;
  from_hardware.measurements.v_dc.value.we     <= take;
  from_hardware.measurements.iref_alpha.value.next_q <= iref_alpha;
  from_hardware.measurements.iref_alpha.value.we     <= take;
  from_hardware.measurements.iref_beta.value.next_q <= iref_beta;
  from_hardware.measurements.iref_beta.value.we     <= take;
  from_hardware.measurements.omega_s.value.next_q <= omega_s;
  from_hardware.measurements.omega_s.value.we     <= take;
  from_hardware.measurements.omega_r.value.next_q <= omega_r;
  from_hardware.measurements.omega_r.value.we     <= take;
  from_hardware.measurements.s_prev_a.value.next_q <= s_prev_a;
  from_hardware.measurements.s_prev_a.value.we     <= take;
  from_hardware.measurements.s_prev_b.value.next_q <= s_prev_b;
  from_hardware.measurements.s_prev_b.value.we     <= take;
  from_hardware.measurements.s_prev_c.value.next_q <= s_prev_c;
  from_hardware.measurements.s_prev_c.value.we     <= take;

  ---------------------------------------------------------------------------------------------
  -- Observer and core
  ---------------------------------------------------------------------------------------------

  until_a <= own_a when owning = '1' else
             sample.s_prev_a.value.value;
  until_b <= own_b when owning = '1' else
             sample.s_prev_b.value.value;
  until_c <= own_c when owning = '1' else
             sample.s_prev_c.value.value;

  observer_rst   <= rst or (forget and not deciding);
  observer_start <= go and observing;

  i_observer : entity work.rotor_flux_observer
    port map (
      clk              => clk,
      rst              => observer_rst,
      start            => observer_start,
      is_alpha         => sample.is_alpha.value.value,
      is_beta          => sample.is_beta.value.value,
      v_n              => sample.v_n.value.value,
      v_ph_a           => sample.v_ph_a.value.value,
      v_ph_b           => sample.v_ph_b.value.value,
      v_ph_c           => sample.v_ph_c.value.value,
      v_dc             => sample.v_dc.value.value,
      omega_r          => sample.omega_r.value.value,
      s_a              => until_a,
      s_b              => until_b,
      s_c              => until_c,
      o_speed          => o_speed_now,
      o_voltage_alpha  => o_voltage_alpha_now,
      o_voltage_beta   => o_voltage_beta_now,
      o_drop           => o_drop_now,
      o_pull           => o_pull_now,
      o_pull_flux      => o_pull_flux_now,
      o_pull_current   => o_pull_current_now,
      o_decay          => o_decay_now,
      o_excitation     => o_excitation_now,
      o_output_flux    => o_output_flux_now,
      o_output_current => o_output_current_now,
      valid            => observer_valid,
      busy             => observer_busy,
      psir_alpha       => observer_alpha,
      psir_beta        => observer_beta,
      saturated        => observer_full
    );

  flux_alpha <= observer_alpha when observing = '1' else
                sample.psir_alpha.value.value;
  flux_beta  <= observer_beta when observing = '1' else
                sample.psir_beta.value.value;
  core_start <= observer_valid when observing = '1' else
                go;

  i_core : entity work.mpdcc_core
    generic map (
      EXPLORERS         => EXPLORERS,
      FOLDED            => FOLDED,
      SECOND_LEVEL      => SECOND_LEVEL,
      WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK
    )
    port map (
      clk                         => clk,
      rst                         => rst,
      start                       => core_start,
      is_alpha                    => sample.is_alpha.value.value,
      is_beta                     => sample.is_beta.value.value,
      psir_alpha                  => flux_alpha,
      psir_beta                   => flux_beta,
      v_n                         => sample.v_n.value.value,
      v_ph_a                      => sample.v_ph_a.value.value,
      v_ph_b                      => sample.v_ph_b.value.value,
      v_ph_c                      => sample.v_ph_c.value.value,
      v_dc                        => sample.v_dc.value.value,
      iref_alpha                  => sample.iref_alpha.value.value,
      iref_beta                   => sample.iref_beta.value.value,
      omega_s                     => sample.omega_s.value.value,
      omega_r                     => sample.omega_r.value.value,
      s_prev_a                    => until_a,
      s_prev_b                    => until_b,
      s_prev_c                    => until_c,
      c_error_alpha               => c_error_alpha_now,
      c_error_beta                => c_error_beta_now,
      c_error_neutral             => c_error_neutral_now,
      c_error_phase               => c_error_phase_now,
      c_stator_alpha              => c_stator_alpha_now,
      c_stator_beta               => c_stator_beta_now,
      c_rotor_alpha               => c_rotor_alpha_now,
      c_rotor_beta                => c_rotor_beta_now,
      c_reference_alpha           => c_reference_alpha_now,
      c_reference_beta            => c_reference_beta_now,
      c_emf_alpha                 => c_emf_alpha_now,
      c_emf_beta                  => c_emf_beta_now,
      c_correction_alpha          => c_correction_alpha_now,
      c_correction_beta           => c_correction_beta_now,
      c_forced_voltage            => c_forced_voltage_now,
      c_forced_neutral            => c_forced_neutral_now,
      c_phase_alpha               => c_phase_alpha_now,
      c_phase_beta                => c_phase_beta_now,
      c_midpoint_alpha            => c_midpoint_alpha_now,
      c_midpoint_beta             => c_midpoint_beta_now,
      c_weight                    => c_weight_now,
      c_weight_alpha              => c_weight_alpha_now,
      c_weight_beta               => c_weight_beta_now,
      c_curvature_emf_alpha       => c_curvature_emf_alpha_now,
      c_curvature_emf_beta        => c_curvature_emf_beta_now,
      c_curvature_flux_alpha      => c_curvature_flux_alpha_now,
      c_curvature_flux_beta       => c_curvature_flux_beta_now,
      c_curvature_reference_alpha => c_curvature_reference_alpha_now,
      c_curvature_reference_beta  => c_curvature_reference_beta_now,
      bound_current               => bound_current_now,
      bound_neutral               => bound_neutral_now,
      bound_phase                 => bound_phase_now,
      horizon                     => horizon_now,
      weight_scale                => weight_scale_now,
      two_switchings              => two_switchings_now,
      budget                      => budget_now,
      compensate                  => compensate_now,
      deadlock_rule               => deadlock_rule_now,
      c_change_phase              => c_change_phase_now,
      c_change_midpoint           => c_change_midpoint_now,
      c_change_weight             => c_change_weight_now,
      c_error_forced              => c_error_forced_now,
      valid                       => core_valid,
      busy                        => open,
      s_a                         => core_a,
      s_b                         => core_b,
      s_c                         => core_c,
      held                        => core_held,
      deadlock                    => core_deadlock,
      length                      => core_length,
      saturated                   => core_saturated,
      exhausted                   => core_exhausted
    );

  p_own : process (clk) is
  begin

    if rising_edge(clk) then
      if (core_valid = '1') then
        own_a <= core_a;
        own_b <= core_b;
        own_c <= core_c;
      end if;

      if (rst = '1') then
        own_a <= (others => '0');
        own_b <= (others => '0');
        own_c <= (others => '0');
      end if;
    end if;

  end process p_own;

  i_monitor : entity work.decision_monitor
    port map (
      clk       => clk,
      rst       => rst,
      clear     => command.clear_counters.value,
      start     => go,
      valid     => core_valid,
      last      => last_cycles,
      worst     => worst_cycles,
      decisions => decisions
    );

  ---------------------------------------------------------------------------------------------
  -- Gates
  ---------------------------------------------------------------------------------------------

  enabled <= enable and control.enable.value;

  i_guard : entity work.gate_guard
    generic map (
      FIVE_LEVEL      => true,
      LEAST_DEAD_TIME => LEAST_DEAD_TIME
    )
    port map (
      clk            => clk,
      rst            => rst,
      enable         => enabled,
      external_trip  => external_trip,
      clear          => clear,
      measured       => go,
      is_alpha       => sample.is_alpha.value.value,
      is_beta        => sample.is_beta.value.value,
      v_dc           => sample.v_dc.value.value,
      start          => go,
      decided        => core_valid,
      position_a     => core_a,
      position_b     => core_b,
      position_c     => core_c,
      dead_time      => dead_time_now,
      minimum_on     => minimum_on_now,
      minimum_off    => minimum_off_now,
      decision_limit => decision_limit_now,
      watchdog       => watchdog_now,
      current_limit  => current_limit_now,
      link_high      => link_high_now,
      link_low       => link_low_now,
      gates          => all_gates,
      running        => is_running,
      resting        => is_resting,
      faults         => latched
    );

  -- the guard latches; the register shows it, and what software clears there is cleared in the guard
  shown <= to_hardware.system.faults.interlock.value & to_hardware.system.faults.overrun.value
           & to_hardware.system.faults.missing.value & to_hardware.system.faults.late.value
           & to_hardware.system.faults.illegal_edge.value & to_hardware.system.faults.link_low.value
           & to_hardware.system.faults.link_high.value & to_hardware.system.faults.over_current.value
           & to_hardware.system.faults.external_trip.value;
  clear <= shown_before and not shown;

  p_shown : process (clk) is
  begin

    if rising_edge(clk) then
      shown_before <= shown;

      if (rst = '1') then
        shown_before <= (others => '0');
      end if;
    end if;

  end process p_shown;

  from_hardware.system.faults.external_trip.hwset <= latched(FAULT_EXTERNAL) and not clear(FAULT_EXTERNAL);
  from_hardware.system.faults.over_current.hwset  <= latched(FAULT_OVER_CURRENT) and not clear(FAULT_OVER_CURRENT);
  from_hardware.system.faults.link_high.hwset     <= latched(FAULT_LINK_HIGH) and not clear(FAULT_LINK_HIGH);
  from_hardware.system.faults.link_low.hwset      <= latched(FAULT_LINK_LOW) and not clear(FAULT_LINK_LOW);
  from_hardware.system.faults.illegal_edge.hwset  <= latched(FAULT_ILLEGAL) and not clear(FAULT_ILLEGAL);
  from_hardware.system.faults.late.hwset          <= latched(FAULT_LATE) and not clear(FAULT_LATE);
  from_hardware.system.faults.missing.hwset       <= latched(FAULT_MISSING) and not clear(FAULT_MISSING);
  from_hardware.system.faults.overrun.hwset       <= latched(FAULT_OVERRUN) and not clear(FAULT_OVERRUN);
  from_hardware.system.faults.interlock.hwset     <= latched(FAULT_INTERLOCK) and not clear(FAULT_INTERLOCK);

  ---------------------------------------------------------------------------------------------
  -- What registers and ports show
  ---------------------------------------------------------------------------------------------

  from_hardware.system.capabilities.controller.next_q      <= "0001";
  from_hardware.system.capabilities.explorers.next_q       <= std_logic_vector(to_unsigned(EXPLORERS, 4));
  from_hardware.system.capabilities.folded.next_q          <= '1' when FOLDED else '0';
  from_hardware.system.capabilities.second_level.next_q    <= '1' when SECOND_LEVEL and not FOLDED else '0';
  from_hardware.system.capabilities.weighted_deadlock.next_q <= '1' when WEIGHTED_DEADLOCK and not FOLDED else '0';
  from_hardware.system.capabilities.flux_control.next_q    <= '0';
  from_hardware.system.capabilities.observer.next_q        <= '1';
  from_hardware.system.capabilities.least_dead_time.next_q <= std_logic_vector(to_unsigned(LEAST_DEAD_TIME, 12));

  from_hardware.system.status.busy.next_q           <= deciding;
  from_hardware.system.status.commit_pending.next_q <= pending;
  from_hardware.system.status.running.next_q        <= is_running;
  from_hardware.system.status.commutating.next_q    <= not is_resting;
  from_hardware.system.status.fault.next_q          <= '0' when latched = "000000000" else '1';
  from_hardware.system.status.enabled.next_q        <= enabled;

  from_hardware.system.flags.saturated.hwset          <= core_valid and core_saturated;
  from_hardware.system.flags.deadlock.hwset           <= core_valid and core_deadlock;
  from_hardware.system.flags.start_ignored.hwset      <= ignored;
  from_hardware.system.flags.observer_saturated.hwset <= observer_valid and observer_full;
  from_hardware.system.flags.clamped.hwset            <= '0';

  from_hardware.system.cycles.last.next_q     <= last_cycles;
  from_hardware.system.cycles.worst.next_q    <= worst_cycles;
  from_hardware.system.decisions.count.next_q <= decisions;
  from_hardware.system.commits.count.next_q   <= commits;
  from_hardware.system.gates.gates.next_q     <= all_gates;

  from_hardware.result.decision.s_a.next_q       <= core_a;
  from_hardware.result.decision.s_a.we <= core_valid;
  from_hardware.result.decision.s_b.next_q       <= core_b;
  from_hardware.result.decision.s_b.we <= core_valid;
  from_hardware.result.decision.s_c.next_q       <= core_c;
  from_hardware.result.decision.s_c.we <= core_valid;
  from_hardware.result.decision.held.next_q      <= core_held;
  from_hardware.result.decision.held.we <= core_valid;
  from_hardware.result.decision.deadlock.next_q  <= core_deadlock;
  from_hardware.result.decision.deadlock.we <= core_valid;
  from_hardware.result.decision.exhausted.next_q <= core_exhausted;
  from_hardware.result.decision.exhausted.we <= core_valid;
  from_hardware.result.decision.saturated.next_q <= core_saturated;
  from_hardware.result.decision.saturated.we <= core_valid;
  from_hardware.result.decision.length.next_q    <= core_length;
  from_hardware.result.decision.length.we <= core_valid;
  from_hardware.result.rotor_flux.alpha.next_q   <= flux_alpha;
  from_hardware.result.rotor_flux.alpha.we <= core_valid;
  from_hardware.result.rotor_flux.beta.next_q    <= flux_beta;
  from_hardware.result.rotor_flux.beta.we <= core_valid;

  valid     <= core_valid;
  s_a       <= core_a;
  s_b       <= core_b;
  s_c       <= core_c;
  held      <= core_held;
  deadlock  <= core_deadlock;
  length    <= core_length;
  saturated <= core_saturated;
  exhausted <= core_exhausted;
  cycles    <= last_cycles;
  gates     <= all_gates;
  running   <= is_running;
  faults    <= latched;

end architecture rtl;
