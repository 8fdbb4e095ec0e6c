-- A complete MPTC/MPFC controller with a bus: registers, stator-flux observer, core, gate guard.
--
-- Measurements come with start, from the ports or from registers (control.registers_as_source, then command.start),
-- and are kept in the registers. The core decides for the next control period: the guard gets a decision with the
-- start that follows, as Paper B's prediction over two steps wants it. With control.use_observer the flux is the
-- observer's, which works on the next one meanwhile. Parameters and the guard's settings are shadows that take effect
-- together between two decisions. What is common to all systems is in system_shell.
--
-- FAMILY: mptc_family_core decides, by one of nine methods.  vector_sequencer plays its decision of up to three vectors
-- from the next start on, goal_holder gives the guard what is played.  The sequence that is being applied enters the
-- next prediction: the one decided last, or with control.own_positions = 0 the one in running.vectors and
-- running.times, u where the method has one vector.  There is no observer then, but with SENSORLESS.
-- SENSORLESS: mptc_speed_observer in the place of mptc_observer.  The core begins when the speed is there, whether
-- parameters.sensorless chooses that speed or the measured one.
--
-- Formats: as mptc_core and gate_guard; registers as docs/registers.md.
-- Latency: the core starts one clock after start, with SENSORLESS 23; gates move with the start after.  FAMILY: the
-- guard has a vector's goal 6 clocks after its begin in the period, where no leg has to wait; that of the first vector
-- of a period so too.
-- Overflow: values saturate and set flags; a start while busy is ignored and sets a flag.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.directmpc_mptc_registers_pkg.all;
  use work.directmpc_system_registers_pkg.all;
  use work.recorder_format.all;
  use work.mptc_types.all;

entity mptc_system is
  generic (
    FLUX_CONTROL    : boolean                  := true; -- true: MPFC can be chosen at run time
    FAMILY          : boolean                  := false; -- true: two and three vectors too; includes MPFC
    SENSORLESS      : boolean                  := false; -- true: the speed can be the observer's
    LEAST_DEAD_TIME : positive range 1 to 4095 := 10;   -- clocks; shorter dead times are raised to it
    SECOND_SUPERVISOR : boolean                := false; -- true: the gate guard has two supervisors
    RECORDER_ROWS   : natural range 0 to 1024  := 0     -- steps that are recorded: 0, or a power of two from 8 on
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
    -- what the decision used, as in the registers: from one clock after valid until the next start, 0 after a reset
    flux_alpha     : out   std_logic_vector(15 downto 0); -- stator flux, the observer's or psis_alpha, signed
    flux_beta      : out   std_logic_vector(15 downto 0); -- likewise, unit as psis_beta
    speed          : out   std_logic_vector(15 downto 0); -- speed with SENSORLESS, else 0; signed, unit as omega_r
    -- gates
    gates          : out   std_logic_vector(5 downto 0);  -- '1': on; upper, lower of a, b, c
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
end entity mptc_system;

architecture rtl of mptc_system is

  constant NO_VOLTAGES : std_logic_vector(15 downto 0) := (others => '0'); -- there are no capacitors

  signal from_hardware  : directmpc_mptc_in_t;
  signal to_hardware    : directmpc_mptc_out_t;
  signal sample         : mptc_measurements_out_t; -- measurements of this decision
  signal in_force       : mptc_parameters_out_t; -- parameters
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
  signal go             : std_logic; -- a decision begins, measurements are in their registers
  signal deciding       : std_logic;
  signal observing      : std_logic; -- control.use_observer, as it was when the decision began
  signal owning         : std_logic; -- control.own_positions, likewise
  signal forget         : std_logic; -- the observer is to begin anew, between two decisions
  signal load           : std_logic; -- parameters take effect
  signal observer_rst   : std_logic;
  signal observer_start : std_logic;
  signal observer_valid : std_logic;
  signal observer_busy  : std_logic;
  signal observer_alpha : std_logic_vector(15 downto 0);
  signal observer_beta  : std_logic_vector(15 downto 0);
  signal observer_full  : std_logic;
  signal observer_flag  : std_logic; -- observer_full of a step that has ended
  signal core_alpha     : std_logic_vector(15 downto 0); -- flux that the core gets
  signal core_beta      : std_logic_vector(15 downto 0);
  signal core_valid     : std_logic;
  signal core_u         : std_logic_vector(2 downto 0);
  signal core_switches  : std_logic_vector(2 downto 0);
  signal core_saturated : std_logic;
  signal core_clamped   : std_logic;
  signal core_cost      : compared_t;
  signal cost_held      : compared_t; -- for the recorder, which takes it later
  signal own_u          : std_logic_vector(2 downto 0);
  signal until_u        : std_logic_vector(2 downto 0);
  signal estimated      : std_logic; -- the observer has taken a step
  signal ready          : std_logic; -- there is a decision that has not been applied
  signal apply          : std_logic;
  signal watching       : std_logic;       -- the flux is the observer's
  signal core_start     : std_logic;
  signal core_omega     : std_logic_vector(15 downto 0);
  signal sequence_now   : mptc_sequence_t; -- is being applied
  signal chosen         : mptc_sequence_t; -- decision
  signal early_set      : std_logic;
  signal invalid_set    : std_logic;
  signal delayed_set    : std_logic;
  signal built_family   : std_logic;
  signal built_speed    : std_logic;
  signal built_several  : std_logic;
  signal shown_alpha    : std_logic_vector(15 downto 0);
  signal shown_beta     : std_logic_vector(15 downto 0);
  signal shows          : std_logic; -- shown_alpha and shown_beta are those of the last decision
  signal is_running     : std_logic;
  signal forget_own     : std_logic;       -- what was decided last is forgotten
  signal waits          : std_logic_vector(2 downto 0);
  signal current        : std_logic;       -- the decision made last may reach gates
  signal play_rst       : std_logic;       -- no sequence is played
  signal give           : std_logic;       -- the guard takes the goal of the clock before
  signal goal           : std_logic_vector(2 downto 0); -- a clock before give
  signal goal_a         : std_logic_vector(2 downto 0);
  signal goal_b         : std_logic_vector(2 downto 0);
  signal goal_c         : std_logic_vector(2 downto 0);
  signal step           : record_t; -- what the core gets, and what it has decided
  signal seen_alpha     : std_logic_vector(15 downto 0); -- flux that the core got
  signal seen_beta      : std_logic_vector(15 downto 0);
  signal seen_omega     : std_logic_vector(15 downto 0); -- speed, likewise
  signal decided        : mptc_sequence_t;

begin

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

  i_shell : entity work.system_shell
    generic map (
      TABLED_LEG        => false,
      MEASUREMENTS      => 8,
      LEAST_DEAD_TIME   => LEAST_DEAD_TIME,
      SECOND_SUPERVISOR => SECOND_SUPERVISOR,
      RECORDER_ROWS     => RECORDER_ROWS,
      RECORD_INPUTS     => MPTC_INPUTS,
      RECORD_RESULTS    => MPTC_RESULTS
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
      bands              => (others => '0'),
      capabilities       => capabilities,
      shown              => from_hardware.system,
      take               => take,
      begins             => open,
      go                 => go,
      deciding           => deciding,
      observing          => observing,
      owning             => owning,
      forget             => forget,
      load               => load,
      load_at_rest       => open,
      load_waits         => '0',
      preparing          => '0',
      decides            => core_start,
      decided            => core_valid,
      saturated          => core_saturated,
      deadlock           => '0',
      clamped            => core_clamped,
      observer_saturated => observer_flag,
      cycles             => cycles,
      step_words         => step,
      is_alpha           => sample.is_alpha.value.value,
      is_beta            => sample.is_beta.value.value,
      v_dc               => sample.v_dc.value.value,
      v_n                => NO_VOLTAGES,
      v_ph_a             => NO_VOLTAGES,
      v_ph_b             => NO_VOLTAGES,
      v_ph_c             => NO_VOLTAGES,
      omega_r            => sample.omega_r.value.value,
      apply              => give,
      position_a         => goal_a,
      position_b         => goal_b,
      position_c         => goal_c,
      gates              => gates,
      waits              => waits,
      running            => is_running,
      current            => current,
      faults             => faults
    );

  busy    <= deciding;
  running <= is_running;

  p_parameters : process (clk) is
  begin

    if rising_edge(clk) then
      if (load = '1') then
        in_force <= to_hardware.parameters;
      end if;
    end if;

  end process p_parameters;

  from_hardware.measurements.is_alpha.value <= (next_q => is_alpha, we => take);
  from_hardware.measurements.is_beta.value <= (next_q => is_beta, we => take);
  from_hardware.measurements.psis_alpha.value <= (next_q => psis_alpha, we => take);
  from_hardware.measurements.psis_beta.value <= (next_q => psis_beta, we => take);
  from_hardware.measurements.omega_r.value <= (next_q => omega_r, we => take);
  from_hardware.measurements.v_dc.value <= (next_q => v_dc, we => take);
  from_hardware.measurements.torque_ref.value <= (next_q => torque_ref, we => take);
  from_hardware.measurements.psi_ref.value <= (next_q => psi_ref, we => take);
  from_hardware.measurements.u.value <= (next_q => u, we => take);

  ---------------------------------------------------------------------------------------------
  -- Observer and core
  ---------------------------------------------------------------------------------------------

  until_u <= own_u when owning = '1' else
             sample.u.value.value;

  observer_rst   <= rst or (forget and not (deciding or observer_busy));
  observer_flag  <= observer_valid and observer_full;
  observer_start <= go;

  g_observer : if not (FAMILY or SENSORLESS) generate

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
        c_current       => in_force.c_current.value.value,
        c_flux          => in_force.c_flux.value.value,
        c_rotor         => in_force.c_rotor.value.value,
        c_rotor_flux    => in_force.c_rotor_flux.value.value,
        c_drop          => in_force.c_drop.value.value,
        c_drop_flux     => in_force.c_drop_flux.value.value,
        c_speed         => in_force.c_speed.value.value,
        c_voltage_alpha => in_force.c_voltage_alpha.value.value,
        c_voltage_beta  => in_force.c_voltage_beta.value.value,
        c_gain_rotor    => in_force.c_gain_rotor.value.value,
        c_gain_stator   => in_force.c_gain_stator.value.value,
        valid           => observer_valid,
        busy            => observer_busy,
        psis_alpha      => observer_alpha,
        psis_beta       => observer_beta,
        saturated       => observer_full
      );

  end generate g_observer;

  g_measured : if not SENSORLESS generate
    core_start <= go;
    core_omega <= sample.omega_r.value.value;
  end generate g_measured;

  g_unobserved : if FAMILY and not SENSORLESS generate
    observer_valid <= '0';
    observer_busy  <= '0';
    observer_full  <= '0';
    observer_alpha <= (others => '0');
    observer_beta  <= (others => '0');
  end generate g_unobserved;

  g_speed : if SENSORLESS generate

    signal speed_valid    : std_logic;
    signal observer_speed : std_logic_vector(15 downto 0);

  begin

    -- the speed for this decision, then one step on for the next one
    i_observer : entity work.mptc_speed_observer
      port map (
        clk             => clk,
        rst             => observer_rst,
        start           => observer_start,
        is_alpha        => sample.is_alpha.value.value,
        is_beta         => sample.is_beta.value.value,
        v_dc            => sample.v_dc.value.value,
        u1              => sequence_now.u1,
        u2              => sequence_now.u2,
        u3              => sequence_now.u3,
        t1              => sequence_now.t1,
        t2              => sequence_now.t2,
        c_current       => in_force.c_current.value.value,
        c_flux          => in_force.c_flux.value.value,
        c_rotor         => in_force.c_rotor.value.value,
        c_rotor_flux    => in_force.c_rotor_flux.value.value,
        c_drop          => in_force.c_drop.value.value,
        c_drop_flux     => in_force.c_drop_flux.value.value,
        c_speed         => in_force.c_speed.value.value,
        c_voltage_alpha => in_force.c_voltage_alpha.value.value,
        c_voltage_beta  => in_force.c_voltage_beta.value.value,
        c_gain_rotor    => in_force.c_gain_rotor.value.value,
        c_gain_stator   => in_force.c_gain_stator.value.value,
        c_gain_speed    => in_force.c_gain_speed.value.value,
        c_gain_integral => in_force.c_gain_integral.value.value,
        speed_valid     => speed_valid,
        omega_r         => observer_speed,
        valid           => observer_valid,
        busy            => observer_busy,
        psis_alpha      => observer_alpha,
        psis_beta       => observer_beta,
        saturated       => observer_full
      );

    core_start <= speed_valid;
    core_omega <= observer_speed when in_force.sensorless.value.value = '1' else
                  sample.omega_r.value.value;

    -- the observer's outputs move on before the core has decided
    p_used : process (clk) is
    begin

      if rising_edge(clk) then
        if (core_start = '1') then
          shown_alpha                                <= core_alpha;
          shown_beta                                 <= core_beta;
          from_hardware.result.speed.omega_r.next_q  <= core_omega;
        end if;
      end if;

    end process p_used;

    from_hardware.result.speed.omega_r.we <= core_valid;

    shows <= core_valid;

  end generate g_speed;

  -- the observer's outputs move on with the decision of MPTC, and before that of MPFC
  g_no_speed : if not SENSORLESS generate
    shown_alpha                           <= core_alpha;
    shown_beta                            <= core_beta;
    shows                                 <= core_start;
    from_hardware.result.speed.omega_r    <= (next_q => (others => '0'), we => '0');
  end generate g_no_speed;

  -- until its first step has ended the observer knows no flux
  watching   <= observing and to_std_logic(SENSORLESS or not FAMILY);
  core_alpha <= sample.psis_alpha.value.value when watching = '0' else
                observer_alpha when estimated = '1' else
                (others => '0');
  core_beta  <= sample.psis_beta.value.value when watching = '0' else
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

  -- a decision is applied with the start that follows it
  apply <= go and ready;

  g_single : if not FAMILY generate

    i_core : entity work.mptc_core
      generic map (
        FLUX_CONTROL => FLUX_CONTROL
      )
      port map (
        clk                         => clk,
        rst                         => rst,
        start                       => core_start,
        is_alpha                    => sample.is_alpha.value.value,
        is_beta                     => sample.is_beta.value.value,
        psis_alpha                  => core_alpha,
        psis_beta                   => core_beta,
        omega_r                     => core_omega,
        v_dc                        => sample.v_dc.value.value,
        torque_ref                  => sample.torque_ref.value.value,
        psi_ref                     => sample.psi_ref.value.value,
        u                           => until_u,
        c_current                   => in_force.c_current.value.value,
        c_flux                      => in_force.c_flux.value.value,
        c_rotor                     => in_force.c_rotor.value.value,
        c_rotor_flux                => in_force.c_rotor_flux.value.value,
        c_drop_current              => in_force.c_drop_current.value.value,
        c_drop                      => in_force.c_drop.value.value,
        c_drop_flux                 => in_force.c_drop_flux.value.value,
        c_speed                     => in_force.c_speed.value.value,
        c_voltage_alpha             => in_force.c_voltage_alpha.value.value,
        c_voltage_beta              => in_force.c_voltage_beta.value.value,
        c_torque                    => in_force.c_torque.value.value,
        c_weight                    => in_force.c_weight.value.value,
        method_mpfc                 => in_force.method_mpfc.value.value,
        valid                       => core_valid,
        busy                        => open,
        u_next                      => core_u,
        switches                    => core_switches,
        saturated                   => core_saturated,
        clamped                     => core_clamped,
        cost                        => core_cost
      );

    sequence_now <= (until_u, until_u, until_u, WHOLE_PERIOD, (others => '0'));
    chosen       <= NO_VOLTAGE;
    give         <= apply;
    goal         <= core_switches;
    early_set    <= '0';
    invalid_set  <= '0';
    delayed_set  <= '0';
    forget_own   <= '0';

  end generate g_single;

  g_family : if FAMILY generate

    constant FLAGS : positive := 5; -- clocks after its start in which the sequencer's flags are of it

    signal own_sequence  : mptc_sequence_t; -- decided last
    signal own_segmented : std_logic;
    signal alone         : std_logic; -- a method of one vector
    signal begun         : std_logic_vector(FLAGS - 1 downto 0); -- starts of the sequencer, the latest in bit 0
    signal playing       : std_logic;
    signal wanted        : std_logic_vector(2 downto 0);
    signal early         : std_logic;
    signal invalid       : std_logic;

  begin

    i_core : entity work.mptc_family_core
      port map (
        clk                         => clk,
        rst                         => rst,
        start                       => core_start,
        is_alpha                    => sample.is_alpha.value.value,
        is_beta                     => sample.is_beta.value.value,
        psis_alpha                  => core_alpha,
        psis_beta                   => core_beta,
        omega_r                     => core_omega,
        v_dc                        => sample.v_dc.value.value,
        torque_ref                  => sample.torque_ref.value.value,
        psi_ref                     => sample.psi_ref.value.value,
        u                           => until_u,
        c_current                   => in_force.c_current.value.value,
        c_flux                      => in_force.c_flux.value.value,
        c_rotor                     => in_force.c_rotor.value.value,
        c_rotor_flux                => in_force.c_rotor_flux.value.value,
        c_drop_current              => in_force.c_drop_current.value.value,
        c_drop                      => in_force.c_drop.value.value,
        c_drop_flux                 => in_force.c_drop_flux.value.value,
        c_speed                     => in_force.c_speed.value.value,
        c_voltage_alpha             => in_force.c_voltage_alpha.value.value,
        c_voltage_beta              => in_force.c_voltage_beta.value.value,
        c_torque                    => in_force.c_torque.value.value,
        c_weight                    => in_force.c_weight.value.value,
        method_mpfc                 => in_force.method_mpfc.value.value,
        family_method               => in_force.family_method.value.value,
        duty_rule                   => in_force.duty_rule.value.value,
        u1                          => sequence_now.u1,
        u2                          => sequence_now.u2,
        u3                          => sequence_now.u3,
        t1                          => sequence_now.t1,
        t2                          => sequence_now.t2,
        valid                       => core_valid,
        busy                        => open,
        u_next                      => core_u,
        switches                    => core_switches,
        saturated                   => core_saturated,
        clamped                     => core_clamped,
        cost                        => core_cost,
        next_u1                     => chosen.u1,
        next_u2                     => chosen.u2,
        next_u3                     => chosen.u3,
        next_t1                     => chosen.t1,
        next_t2                     => chosen.t2
      );

    alone <= to_std_logic(in_force.family_method.value.value = FAMILY_NONE);

    p_now : process (owning, own_sequence, alone, sample, to_hardware) is
    begin

      if (owning = '1') then
        sequence_now <= own_sequence;
      elsif (alone = '1') then
        sequence_now.u1 <= sample.u.value.value;
        sequence_now.u2 <= sample.u.value.value;
        sequence_now.u3 <= sample.u.value.value;
        sequence_now.t1 <= WHOLE_PERIOD;
        sequence_now.t2 <= (others => '0');
      else
        sequence_now.u1 <= to_hardware.running.vectors.u1.value;
        sequence_now.u2 <= to_hardware.running.vectors.u2.value;
        sequence_now.u3 <= to_hardware.running.vectors.u3.value;
        sequence_now.t1 <= to_hardware.running.times.t1.value;
        sequence_now.t2 <= to_hardware.running.times.t2.value;
      end if;

    end process p_now;

    -- what the gates are at is never forgotten
    forget_own <= forget and not deciding and not is_running;

    p_own_sequence : process (clk) is
    begin

      if rising_edge(clk) then
        begun <= begun(FLAGS - 2 downto 0) & apply;

        if (core_valid = '1') then
          own_sequence  <= chosen;
          own_segmented <= to_std_logic(in_force.family_method.value.value = FAMILY_SVM);
        end if;

        if (rst = '1' or forget_own = '1') then
          own_sequence  <= NO_VOLTAGE;
          own_segmented <= '0';
        end if;

        if (rst = '1') then
          begun <= (others => '0');
        end if;
      end if;

    end process p_own_sequence;

    -- what was decided before a stop is not played behind it
    play_rst <= rst or not current;

    i_sequencer : entity work.vector_sequencer
      port map (
        clk       => clk,
        rst       => play_rst,
        start     => apply,
        u1        => own_sequence.u1,
        u2        => own_sequence.u2,
        u3        => own_sequence.u3,
        t1        => own_sequence.t1,
        t2        => own_sequence.t2,
        segmented => own_segmented,
        rate      => in_force.rate.value.value,
        playing   => playing,
        u         => open,
        switches  => wanted,
        early     => early,
        invalid   => invalid
      );

    i_holder : entity work.goal_holder
      port map (
        clk     => clk,
        rst     => play_rst,
        fresh   => apply,
        playing => playing,
        wanted  => wanted,
        waits   => waits,
        decided => give,
        goal    => goal,
        delayed => delayed_set
      );

    early_set   <= begun(FLAGS - 1) and early;
    invalid_set <= begun(FLAGS - 1) and invalid;

  end generate g_family;

  goal_a <= "00" & goal(2);
  goal_b <= "00" & goal(1);
  goal_c <= "00" & goal(0);

  p_own : process (clk) is
  begin

    if rising_edge(clk) then
      if (core_valid = '1') then
        own_u <= core_u;
        ready <= '1';
      elsif (apply = '1') then
        ready <= '0';
      end if;

      if (rst = '1' or forget_own = '1') then
        own_u <= (others => '0');
        ready <= '0';
      end if;
    end if;

  end process p_own;

  ---------------------------------------------------------------------------------------------
  -- Recorder
  ---------------------------------------------------------------------------------------------

  -- the observer's outputs move on before the core has decided; where they are kept depends on it
  g_speed_seen : if SENSORLESS generate
    seen_alpha <= shown_alpha;
    seen_beta  <= shown_beta;
    seen_omega <= from_hardware.result.speed.omega_r.next_q;
  end generate g_speed_seen;

  g_flux_seen : if not SENSORLESS generate
    seen_alpha <= to_hardware.result.stator_flux.alpha.value;
    seen_beta  <= to_hardware.result.stator_flux.beta.value;
    seen_omega <= sample.omega_r.value.value;
  end generate g_flux_seen;

  decided <= chosen when FAMILY else
             (core_u, core_u, core_u, WHOLE_PERIOD, (others => '0'));

  p_step : process (all) is
  begin

    step <= (others => '0');
    step(MPTC_IS_ALPHA + 15 downto MPTC_IS_ALPHA) <= sample.is_alpha.value.value;
    step(MPTC_IS_BETA + 15 downto MPTC_IS_BETA) <= sample.is_beta.value.value;
    step(MPTC_V_DC + 15 downto MPTC_V_DC) <= sample.v_dc.value.value;
    step(MPTC_TORQUE_REF + 15 downto MPTC_TORQUE_REF) <= sample.torque_ref.value.value;
    step(MPTC_PSI_REF + 14 downto MPTC_PSI_REF) <= sample.psi_ref.value.value;
    step(MPTC_PSIS_ALPHA + 15 downto MPTC_PSIS_ALPHA) <= seen_alpha;
    step(MPTC_PSIS_BETA + 15 downto MPTC_PSIS_BETA) <= seen_beta;
    step(MPTC_OMEGA_R + 15 downto MPTC_OMEGA_R) <= seen_omega;
    step(MPTC_APPLIED + 8 downto MPTC_APPLIED) <= sequence_now.u3 & sequence_now.u2 & sequence_now.u1;
    step(MPTC_T1 + 12 downto MPTC_T1) <= sequence_now.t1;
    step(MPTC_T2 + 12 downto MPTC_T2) <= sequence_now.t2;
    step(RECORD_APPLIED_NEXT + 8 downto RECORD_APPLIED_NEXT) <= decided.u3 & decided.u2 & decided.u1;
    step(MPTC_NEXT_T1 + 12 downto MPTC_NEXT_T1) <= decided.t1;
    step(MPTC_NEXT_T2 + 12 downto MPTC_NEXT_T2) <= decided.t2;
    step(MPTC_CLAMPED) <= core_clamped;
    step(MPTC_COST + COMPARED_WIDTH - 1 downto MPTC_COST) <= cost_held;

  end process p_step;

  p_cost : process (clk) is
  begin

    if rising_edge(clk) then
      if (core_valid = '1') then
        cost_held <= core_cost;
      end if;
    end if;

  end process p_cost;

  ---------------------------------------------------------------------------------------------
  -- What registers and ports show
  ---------------------------------------------------------------------------------------------

  capabilities.controller.next_q      <= "0010";
  capabilities.explorers.next_q       <= "0000";
  capabilities.folded.next_q          <= '0';
  capabilities.second_level.next_q    <= '0';
  capabilities.weighted_deadlock.next_q <= '0';
  capabilities.inwards.next_q         <= '0';
  capabilities.capacitor_filter.next_q <= '0';
  capabilities.leakage_estimate.next_q <= '0';
  capabilities.flux_control.next_q    <= to_std_logic(FLUX_CONTROL or FAMILY);
  capabilities.observer.next_q        <= to_std_logic(SENSORLESS or not FAMILY);
  capabilities.family.next_q          <= built_family;
  capabilities.sensorless.next_q      <= built_speed;
  capabilities.recorder.next_q        <= to_std_logic(RECORDER_ROWS > 0);
  capabilities.least_dead_time.next_q <= std_logic_vector(to_unsigned(LEAST_DEAD_TIME, 12));

  from_hardware.result.decision.u_next <= (next_q => core_u, we => core_valid);
  from_hardware.result.decision.switches <= (next_q => core_switches, we => core_valid);
  from_hardware.result.decision.saturated <= (next_q => core_saturated, we => core_valid);
  from_hardware.result.decision.clamped <= (next_q => core_clamped, we => core_valid);
  from_hardware.result.stator_flux.alpha <= (next_q => shown_alpha, we => shows);
  from_hardware.result.stator_flux.beta <= (next_q => shown_beta, we => shows);

  built_family  <= to_std_logic(FAMILY);
  built_speed   <= to_std_logic(SENSORLESS);
  built_several <= core_valid and built_family;

  -- what is not built keeps its reset value
  from_hardware.parameters.family_method.value <= (swwe => built_family);
  from_hardware.parameters.rate.value <= (swwe => built_family);
  from_hardware.parameters.duty_rule.value <= (swwe => built_family);
  from_hardware.parameters.c_gain_speed.value <= (swwe => built_speed);
  from_hardware.parameters.c_gain_integral.value <= (swwe => built_speed);
  from_hardware.parameters.sensorless.value <= (swwe => built_speed);
  from_hardware.running.vectors.u1 <= (swwe => built_family);
  from_hardware.running.vectors.u2 <= (swwe => built_family);
  from_hardware.running.vectors.u3 <= (swwe => built_family);
  from_hardware.running.times.t1 <= (swwe => built_family);
  from_hardware.running.times.t2 <= (swwe => built_family);
  from_hardware.result.vectors.u1 <= (next_q => chosen.u1, we => built_several);
  from_hardware.result.vectors.u2 <= (next_q => chosen.u2, we => built_several);
  from_hardware.result.vectors.u3 <= (next_q => chosen.u3, we => built_several);
  from_hardware.result.times.t1 <= (next_q => chosen.t1, we => built_several);
  from_hardware.result.times.t2 <= (next_q => chosen.t2, we => built_several);
  from_hardware.result.sequencer.early.hwset <= early_set;
  from_hardware.result.sequencer.invalid.hwset <= invalid_set;
  from_hardware.result.sequencer.delayed.hwset <= delayed_set;

  valid     <= core_valid;
  u_next    <= core_u;
  switches  <= core_switches;
  saturated <= core_saturated;
  clamped   <= core_clamped;

  flux_alpha <= to_hardware.result.stator_flux.alpha.value;
  flux_beta  <= to_hardware.result.stator_flux.beta.value;
  speed      <= to_hardware.result.speed.omega_r.value;

end architecture rtl;
