-- A complete MPTC/MPFC controller with a bus: registers, stator-flux observer, core, gate guard.
--
-- Measurements come with start, from the ports or from registers (control.registers_as_source, then
-- command.start), and are kept there.  The core decides for the next control period: the guard gets a decision
-- with the start that follows, as Paper B's prediction over two steps wants it.  With control.use_observer
-- the flux is the observer's, which works on the next one meanwhile.  Parameters and the guard's settings are
-- shadows that take effect together between two decisions (decision_sequencer).
--
-- Formats: as mptc_core and gate_guard; registers as docs/registers.md.
-- Latency: the core starts one clock after start; gates move with the start after.
-- Overflow: saturates and sets flags; a start while busy is ignored and sets one.
-- Weighed, not built: as mpdcc_system's.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_mptc_registers_pkg.all;
  use work.gate_tables.all;

entity mptc_system is
  generic (
    FLUX_CONTROL    : boolean                  := true; -- true: MPFC can be chosen at run time
    LEAST_DEAD_TIME : positive range 1 to 4095 := 10    -- clocks; shorter dead times are raised to it
  );
  port (
    clk            : in    std_logic;                     -- rising edge
    rst            : in    std_logic;                     -- synchronous, active high
    enable         : in    std_logic;                     -- '1': gates may be on, if control.enable is set too
    external_trip  : in    std_logic;                     -- '1': all gates off
    start          : in    std_logic;                     -- '1' for one clock: measurements are there, decide
    is_alpha       : in    std_logic_vector(15 downto 0); -- signed, current_max/32767
    is_beta        : in    std_logic_vector(15 downto 0); -- signed, current_max/32767
    psis_alpha     : in    std_logic_vector(15 downto 0); -- signed, psi_max/32767
    psis_beta      : in    std_logic_vector(15 downto 0); -- signed, psi_max/32767
    omega_r        : in    std_logic_vector(15 downto 0); -- signed, speed_max/32767
    v_dc           : in    std_logic_vector(15 downto 0); -- unsigned, vdc/32768
    torque_ref     : in    std_logic_vector(15 downto 0); -- signed, torque_max/32767
    psi_ref        : in    std_logic_vector(14 downto 0); -- unsigned, psi_max/26979
    u              : in    std_logic_vector(2 downto 0);  -- unsigned, Number of the vector being applied
    -- decision, stable until the next valid
    valid          : out   std_logic;                     -- '1' for one clock: decision is new
    busy           : out   std_logic;                     -- '1': a start would be ignored
    u_next         : out   std_logic_vector(2 downto 0);  -- number of the vector to apply next
    switches       : out   std_logic_vector(2 downto 0);  -- its switch states a, b, c; '1': upper gate
    saturated      : out   std_logic;                     -- '1': a value did not fit its word
    clamped        : out   std_logic;                     -- '1': MPFC cannot reach torque_ref
    cycles         : out   std_logic_vector(15 downto 0); -- of the decision, unsigned, one clock after valid
    -- gates
    gates          : out   std_logic_vector(5 downto 0);  -- '1': on; upper, lower of a, b, c
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
end entity mptc_system;

architecture rtl of mptc_system is

  signal from_hardware  : directmpc_mptc_in_t;
  signal to_hardware    : directmpc_mptc_out_t;
  signal control        : \system_registers.control_out_t\;
  signal command        : \system_registers.command_out_t\;
  signal parameters     : mptc_parameters_out_t;
  signal guard_settings : guard_registers_out_t;
  signal sample         : mptc_measurements_out_t;

  -- parameters and settings in force
  signal c_current_now                    : std_logic_vector(17 downto 0);
  signal c_flux_now                       : std_logic_vector(17 downto 0);
  signal c_rotor_now                      : std_logic_vector(17 downto 0);
  signal c_rotor_flux_now                 : std_logic_vector(17 downto 0);
  signal c_drop_current_now               : std_logic_vector(17 downto 0);
  signal c_drop_now                       : std_logic_vector(17 downto 0);
  signal c_drop_flux_now                  : std_logic_vector(17 downto 0);
  signal c_speed_now                      : std_logic_vector(17 downto 0);
  signal c_voltage_alpha_now              : std_logic_vector(17 downto 0);
  signal c_voltage_beta_now               : std_logic_vector(17 downto 0);
  signal c_torque_now                     : std_logic_vector(17 downto 0);
  signal c_weight_now                     : std_logic_vector(17 downto 0);
  signal c_gain_rotor_now                 : std_logic_vector(17 downto 0);
  signal c_gain_stator_now                : std_logic_vector(17 downto 0);
  signal method_mpfc_now                  : std_logic;
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
  signal core_valid     : std_logic;
  signal core_u         : std_logic_vector(2 downto 0);
  signal core_switches  : std_logic_vector(2 downto 0);
  signal core_saturated : std_logic;
  signal core_clamped   : std_logic;
  signal own_u          : std_logic_vector(2 downto 0);
  signal own_switches   : std_logic_vector(2 downto 0);
  signal until_u        : std_logic_vector(2 downto 0);
  signal estimated      : std_logic; -- the observer has taken a step
  signal ready          : std_logic; -- there is a decision that has not been applied
  signal apply          : std_logic;
  signal goal_a         : std_logic_vector(2 downto 0);
  signal goal_b         : std_logic_vector(2 downto 0);
  signal goal_c         : std_logic_vector(2 downto 0);
  signal last_cycles    : std_logic_vector(15 downto 0);
  signal worst_cycles   : std_logic_vector(15 downto 0);
  signal decisions      : std_logic_vector(31 downto 0);
  signal enabled        : std_logic;
  signal all_gates      : std_logic_vector(5 downto 0);
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

  i_registers : entity work.directmpc_mptc_registers
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
        c_current_now                    <= parameters.c_current.value.value;
        c_flux_now                       <= parameters.c_flux.value.value;
        c_rotor_now                      <= parameters.c_rotor.value.value;
        c_rotor_flux_now                 <= parameters.c_rotor_flux.value.value;
        c_drop_current_now               <= parameters.c_drop_current.value.value;
        c_drop_now                       <= parameters.c_drop.value.value;
        c_drop_flux_now                  <= parameters.c_drop_flux.value.value;
        c_speed_now                      <= parameters.c_speed.value.value;
        c_voltage_alpha_now              <= parameters.c_voltage_alpha.value.value;
        c_voltage_beta_now               <= parameters.c_voltage_beta.value.value;
        c_torque_now                     <= parameters.c_torque.value.value;
        c_weight_now                     <= parameters.c_weight.value.value;
        c_gain_rotor_now                 <= parameters.c_gain_rotor.value.value;
        c_gain_stator_now                <= parameters.c_gain_stator.value.value;
        method_mpfc_now                  <= parameters.method_mpfc.value.value;
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
  from_hardware.measurements.psis_alpha.value.next_q <= psis_alpha;
  from_hardware.measurements.psis_alpha.value.we     <= take;
  from_hardware.measurements.psis_beta.value.next_q <= psis_beta;
  from_hardware.measurements.psis_beta.value.we     <= take;
  from_hardware.measurements.omega_r.value.next_q <= omega_r;
  from_hardware.measurements.omega_r.value.we     <= take;
  from_hardware.measurements.v_dc.value.next_q <= v_dc;
  from_hardware.measurements.v_dc.value.we     <= take;
  from_hardware.measurements.torque_ref.value.next_q <= torque_ref;
  from_hardware.measurements.torque_ref.value.we     <= take;
  from_hardware.measurements.psi_ref.value.next_q <= psi_ref;
  from_hardware.measurements.psi_ref.value.we     <= take;
  from_hardware.measurements.u.value.next_q <= u;
  from_hardware.measurements.u.value.we     <= take;

  ---------------------------------------------------------------------------------------------
  -- Observer and core
  ---------------------------------------------------------------------------------------------

  until_u <= own_u when owning = '1' else
             sample.u.value.value;

  observer_rst   <= rst or (forget and not (deciding or observer_busy));
  observer_start <= go;

  -- one step on from the measurements of this decision, for the next one
  i_observer : entity work.mptc_observer
    port map (
      clk             => clk,
      rst             => observer_rst,
      start           => observer_start,
      is_alpha        => sample.is_alpha.value.value,
      is_beta         => sample.is_beta.value.value,
      omega_r         => sample.omega_r.value.value,
      v_dc            => sample.v_dc.value.value,
      u               => until_u,
      c_current       => c_current_now,
      c_flux          => c_flux_now,
      c_rotor         => c_rotor_now,
      c_rotor_flux    => c_rotor_flux_now,
      c_drop          => c_drop_now,
      c_drop_flux     => c_drop_flux_now,
      c_speed         => c_speed_now,
      c_voltage_alpha => c_voltage_alpha_now,
      c_voltage_beta  => c_voltage_beta_now,
      c_gain_rotor    => c_gain_rotor_now,
      c_gain_stator   => c_gain_stator_now,
      valid           => observer_valid,
      busy            => observer_busy,
      psis_alpha      => observer_alpha,
      psis_beta       => observer_beta,
      saturated       => observer_full
    );

  -- until its first step has ended the observer knows no flux
  flux_alpha <= sample.psis_alpha.value.value when observing = '0' else
                observer_alpha when estimated = '1' else
                (others => '0');
  flux_beta  <= sample.psis_beta.value.value when observing = '0' else
                observer_beta when estimated = '1' else
                (others => '0');

  p_estimated : process (clk) is
  begin

    if rising_edge(clk) then
      if (observer_valid = '1') then
        estimated <= '1';
      end if;

      if (observer_rst = '1') then
        estimated <= '0';
      end if;
    end if;

  end process p_estimated;

  i_core : entity work.mptc_core
    generic map (
      FLUX_CONTROL => FLUX_CONTROL
    )
    port map (
      clk                         => clk,
      rst                         => rst,
      start                       => go,
      is_alpha                    => sample.is_alpha.value.value,
      is_beta                     => sample.is_beta.value.value,
      psis_alpha                  => flux_alpha,
      psis_beta                   => flux_beta,
      omega_r                     => sample.omega_r.value.value,
      v_dc                        => sample.v_dc.value.value,
      torque_ref                  => sample.torque_ref.value.value,
      psi_ref                     => sample.psi_ref.value.value,
      u                           => until_u,
      c_current                   => c_current_now,
      c_flux                      => c_flux_now,
      c_rotor                     => c_rotor_now,
      c_rotor_flux                => c_rotor_flux_now,
      c_drop_current              => c_drop_current_now,
      c_drop                      => c_drop_now,
      c_drop_flux                 => c_drop_flux_now,
      c_speed                     => c_speed_now,
      c_voltage_alpha             => c_voltage_alpha_now,
      c_voltage_beta              => c_voltage_beta_now,
      c_torque                    => c_torque_now,
      c_weight                    => c_weight_now,
      method_mpfc                 => method_mpfc_now,
      valid                       => core_valid,
      busy                        => open,
      u_next                      => core_u,
      switches                    => core_switches,
      saturated                   => core_saturated,
      clamped                     => core_clamped
    );

  -- a decision is applied with the start that follows it
  apply  <= go and ready;
  goal_a <= "00" & own_switches(2);
  goal_b <= "00" & own_switches(1);
  goal_c <= "00" & own_switches(0);

  p_own : process (clk) is
  begin

    if rising_edge(clk) then
      if (core_valid = '1') then
        own_u        <= core_u;
        own_switches <= core_switches;
        ready        <= '1';
      elsif (apply = '1') then
        ready <= '0';
      end if;

      if (rst = '1') then
        own_u        <= (others => '0');
        own_switches <= (others => '0');
        ready        <= '0';
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
      FIVE_LEVEL      => false,
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
      decided        => apply,
      position_a     => goal_a,
      position_b     => goal_b,
      position_c     => goal_c,
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

  from_hardware.system.capabilities.controller.next_q      <= "0010";
  from_hardware.system.capabilities.explorers.next_q       <= "0000";
  from_hardware.system.capabilities.folded.next_q          <= '0';
  from_hardware.system.capabilities.second_level.next_q    <= '0';
  from_hardware.system.capabilities.weighted_deadlock.next_q <= '0';
  from_hardware.system.capabilities.flux_control.next_q    <= '1' when FLUX_CONTROL else '0';
  from_hardware.system.capabilities.observer.next_q        <= '1';
  from_hardware.system.capabilities.least_dead_time.next_q <= std_logic_vector(to_unsigned(LEAST_DEAD_TIME, 12));

  from_hardware.system.status.busy.next_q           <= deciding;
  from_hardware.system.status.commit_pending.next_q <= pending;
  from_hardware.system.status.running.next_q        <= is_running;
  from_hardware.system.status.commutating.next_q    <= not is_resting;
  from_hardware.system.status.fault.next_q          <= '0' when latched = "000000000" else '1';
  from_hardware.system.status.enabled.next_q        <= enabled;

  from_hardware.system.flags.saturated.hwset          <= core_valid and core_saturated;
  from_hardware.system.flags.deadlock.hwset           <= '0';
  from_hardware.system.flags.start_ignored.hwset      <= ignored;
  from_hardware.system.flags.observer_saturated.hwset <= observer_valid and observer_full;
  from_hardware.system.flags.clamped.hwset            <= core_valid and core_clamped;

  from_hardware.system.cycles.last.next_q     <= last_cycles;
  from_hardware.system.cycles.worst.next_q    <= worst_cycles;
  from_hardware.system.decisions.count.next_q <= decisions;
  from_hardware.system.commits.count.next_q   <= commits;
  from_hardware.system.gates.gates.next_q     <= (23 downto 6 => '0') & all_gates;

  from_hardware.result.decision.u_next.next_q    <= core_u;
  from_hardware.result.decision.u_next.we <= core_valid;
  from_hardware.result.decision.switches.next_q  <= core_switches;
  from_hardware.result.decision.switches.we <= core_valid;
  from_hardware.result.decision.saturated.next_q <= core_saturated;
  from_hardware.result.decision.saturated.we <= core_valid;
  from_hardware.result.decision.clamped.next_q   <= core_clamped;
  from_hardware.result.decision.clamped.we <= core_valid;
  from_hardware.result.stator_flux.alpha.next_q  <= flux_alpha;
  from_hardware.result.stator_flux.alpha.we <= core_valid;
  from_hardware.result.stator_flux.beta.next_q   <= flux_beta;
  from_hardware.result.stator_flux.beta.we <= core_valid;

  valid     <= core_valid;
  u_next    <= core_u;
  switches  <= core_switches;
  saturated <= core_saturated;
  clamped   <= core_clamped;
  cycles    <= last_cycles;
  gates     <= all_gates;
  running   <= is_running;
  faults    <= latched;

end architecture rtl;
