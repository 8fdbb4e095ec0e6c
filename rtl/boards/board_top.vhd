-- The top of every board: clock, reset, host links, controller, gate guard, and the pins.
--
-- The core's clock is the oscillator's, divided by DIVIDE, or with PLL the output of board_clock. That is a
-- vendor's PLL with a second oscillator beside it, a file of its own for each family (rtl/boards/ecp5_clock.v).
-- Inputs come in through two flip-flops. The reset holds for the first 15 clocks after configuration, with PLL for the
-- first 15 after the clock has proved good.
-- The gates are registers of the gate guard and zero from configuration on. permit = '0' turns the pins off without a
-- clock (gate_release); the guard latches a fault with it. With PLL an unlocked PLL, or a clock that clock_monitor
-- finds too slow, too fast or dead, does the same, and resets the whole when the clock is back.
-- There the core's clock also watches the second oscillator, which alone could not tell that it stands: without it the
-- guard trips (external_trip), and status.second_clock is '0'.
-- With DRIVERS a '0' at driver_fault_n or driver_ready is the guard's fault driver: gates at the rails are off three
-- clocks after it. Without the generic the two pins are not read.
-- held_high is constant. Where another part of the board could reconfigure the FPGA, it keeps that part from doing so
-- (docs/boards.md).
--
-- Formats: see host_link. Latency: see host_link, controller and gate guard.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.gate_tables.gates_of;
  use work.link_constants.all;

entity board_top is
  generic (
    CONTROLLER        : positive range 1 to 3 := 1;          -- 1: MPDCC, 2: MPTC and MPFC, 3: K-best
    EXPLORERS         : positive range 1 to 8 := 1;          -- of MPDCC
    FOLDED            : boolean               := false;      -- MPDCC: true: the paper's explorers
    SECOND_LEVEL      : boolean               := true;       -- MPDCC: true: SESE, delay compensation; fast explorers
    WEIGHTED_DEADLOCK : boolean               := true;       -- MPDCC: true: the weighted deadlock rule; fast explorers
    INWARDS           : boolean               := true;       -- MPDCC: true: the rule inwards; fast explorers
    CAPACITOR_FILTER  : boolean               := true;       -- MPDCC, K-best: true: filters of v_n and v_ph
    LEAKAGE_ESTIMATE  : boolean               := true;       -- MPDCC: true: estimate of the leakage; fast explorers
    FLUX_OBSERVER     : boolean               := true;       -- MPDCC: true: of the flux; the two above bring it along
    BEAM              : positive              := 8;          -- K-best: plans that live on
    STAGES            : positive              := 12;         -- K-best: stages of the horizon
    FAMILY            : boolean               := false;      -- MPTC: true: methods of two and three vectors
    SENSORLESS        : boolean               := false;      -- MPTC: true: the speed can be estimated
    CLOCK_HZ          : positive              := 25_000_000; -- Hz, of the core: clock divided by DIVIDE, or PLL's
    DIVIDE            : positive range 1 to 4 := 1;          -- 1, 2 or 4; 1 with PLL
    PLL               : boolean               := false;      -- true: board_clock makes the core's clock
    BAUD              : positive              := 3_000_000;  -- UART, 1/s
    LEAST_DEAD_TIME   : positive              := 400;        -- ns; shorter dead times are raised to it
    DRIVERS           : boolean               := false;      -- true: the gate drivers' outputs are wired
    SECOND_SUPERVISOR : boolean               := false;      -- true: the gate guard has two supervisors
    RECORDER_ROWS     : natural               := 0           -- steps that are recorded: 0, or a power of two from 8 on
  );
  port (
    clock          : in    std_logic;                     -- oscillator
    uart_rx        : in    std_logic;                     -- from the host, idle high
    uart_tx        : out   std_logic;                     -- to the host, idle high
    spi_sck        : in    std_logic;                     -- SPI mode 0
    spi_cs_n       : in    std_logic;                     -- active low
    spi_mosi       : in    std_logic;                     -- from the rig
    spi_miso       : out   std_logic;                     -- to the rig; always driven, low while spi_cs_n is high
    steps_over_spi : in    std_logic;                     -- switch: '1': steps come over SPI, '0': UART
    permit         : in    std_logic;                     -- asynchronous, '0': gates off, fault; pulled down
    driver_fault_n : in    std_logic;                     -- asynchronous, '0': a gate driver has a fault; pulled down
    driver_ready   : in    std_logic;                     -- asynchronous, '0': one is not ready; pulled down
    gates          : out   std_logic_vector(23 downto 0); -- '1': on; S1, S2, ... of a, b, c; MPTC: bits 0 to 5
    leds           : out   std_logic_vector(3 downto 0);  -- 0: running, 1: fault, 2: deciding, 3: steps over SPI
    held_high      : out   std_logic_vector(2 downto 0)   -- always '1': pins that can have the FPGA reconfigured
  );
end entity board_top;

architecture rtl of board_top is

  constant STEP_WORDS     : positive := choose(CONTROLLER = CONTROLLER_MPTC, STEP_WORDS_MPTC, STEP_WORDS_MPDCC);
  constant DEAD_CLOCKS    : positive := clocks_in(LEAST_DEAD_TIME, CLOCK_HZ);

  -- clock: oscillator of the board; core_clock: CLOCK_HZ; locked: '1': core_clock is as it should be, asynchronous;
  -- oscillator: of the part, 2.42 MHz within 15 %
  -- CORE_MHZ: CLOCK_HZ in MHz
  component board_clock is
    generic (
      CORE_MHZ : positive
    );
    port (
      clock      : in    std_logic;
      core_clock : out   std_logic;
      locked     : out   std_logic;
      oscillator : out   std_logic
    );
  end component board_clock;

  signal core_clock      : std_logic;
  signal clock_good      : std_logic; -- '1': locked, and clock_monitor finds it running; asynchronous
  signal ready           : std_logic; -- '1': the reset may end; synchronous to core_clock
  signal allowed         : std_logic; -- '1': permitted and the clock is good; asynchronous
  -- what there is before the reset, which these two make
  -- vsg_off signal_007
  signal since_start     : unsigned(3 downto 0) := (others => '0');
  signal rst             : std_logic := '1';
  -- vsg_on signal_007
  signal control         : std_logic; -- steps_over_spi, synchronous to core_clock
  signal permitted       : std_logic; -- permit, synchronous to core_clock
  signal external_trip   : std_logic;
  signal second_clock    : std_logic; -- '1': the second oscillator runs, or there is none
  signal driver_fault    : std_logic; -- of a gate driver, synchronous to core_clock
  signal awready         : std_logic;
  signal awvalid         : std_logic;
  signal awaddr          : std_logic_vector(9 downto 0);
  signal awprot          : std_logic_vector(2 downto 0);
  signal wready          : std_logic;
  signal wvalid          : std_logic;
  signal wdata           : std_logic_vector(31 downto 0);
  signal wstrb           : std_logic_vector(3 downto 0);
  signal bready          : std_logic;
  signal bvalid          : std_logic;
  signal bresp           : std_logic_vector(1 downto 0);
  signal arready         : std_logic;
  signal arvalid         : std_logic;
  signal araddr          : std_logic_vector(9 downto 0);
  signal arprot          : std_logic_vector(2 downto 0);
  signal rready          : std_logic;
  signal rvalid          : std_logic;
  signal rdata           : std_logic_vector(31 downto 0);
  signal rresp           : std_logic_vector(1 downto 0);
  signal step_start      : std_logic;
  signal measurements    : std_logic_vector(16 * STEP_WORDS - 1 downto 0);
  signal step_position   : std_logic_vector(15 downto 0);
  signal step_busy       : std_logic;
  signal decision_valid  : std_logic;
  signal decision        : std_logic_vector(15 downto 0);
  signal decision_flags  : std_logic_vector(7 downto 0);
  signal decision_length : std_logic_vector(7 downto 0);
  signal decision_cycles : std_logic_vector(15 downto 0);
  signal running         : std_logic;
  signal tripped         : std_logic;
  signal faults          : std_logic_vector(15 downto 0);
  signal gates_now       : std_logic_vector(23 downto 0);
  signal gates_word      : std_logic_vector(31 downto 0);
  signal stretch         : unsigned(18 downto 0);

begin

  assert DIVIDE /= 3
    report "board_top: DIVIDE is 3, but has to be 1, 2 or 4"
    severity failure;

  assert DIVIDE = 1 or not PLL
    report "board_top: with PLL, DIVIDE has to be 1"
    severity failure;

  g_pll : if PLL generate

    constant DIVIDE_BITS   : positive := 9;
    constant OSCILLATOR_HZ : positive := 2_421_875;                                           -- 310 MHz / 128
    -- clocks of the oscillator, in thousandths, to 2**DIVIDE_BITS of the core's
    constant BEAT          : positive := 2 ** DIVIDE_BITS * OSCILLATOR_HZ / (CLOCK_HZ / 1000);
    constant TICK_BITS     : positive := 3;
    -- clocks of the core to 2**TICK_BITS of the oscillator
    constant TICK          : positive := 2 ** TICK_BITS * (CLOCK_HZ / 1000) / (OSCILLATOR_HZ / 1000);

    signal locked     : std_logic;
    signal oscillator : std_logic;
    signal alive      : std_logic;

  begin

    i_board_clock : component board_clock
      generic map (
        CORE_MHZ => CLOCK_HZ / 1_000_000
      )
      port map (
        clock      => clock,
        core_clock => core_clock,
        locked     => locked,
        oscillator => oscillator
      );

    i_clock_monitor : entity work.clock_monitor
      generic map (
        DIVIDE_BITS => DIVIDE_BITS,
        SHORTEST    => BEAT * 85 / 100_000 - 2,
        LONGEST     => BEAT * 115 / 100_000 + 3
      )
      port map (
        clk        => core_clock,
        oscillator => oscillator,
        alive      => alive
      );

    -- the other way round: each watches the other one
    i_oscillator_monitor : entity work.clock_monitor
      generic map (
        DIVIDE_BITS => TICK_BITS,
        SHORTEST    => TICK * 100 / 115 - 2,
        LONGEST     => TICK * 100 / 85 + 3
      )
      port map (
        clk        => oscillator,
        oscillator => core_clock,
        alive      => second_clock
      );

    clock_good <= locked and alive;

    i_ready : entity work.sync_bits
      generic map (
        WIDTH  => 1,
        STAGES => 2
      )
      port map (
        clk             => core_clock,
        asynchronous(0) => clock_good,
        synchronous(0)  => ready
      );

  end generate g_pll;

  g_direct : if DIVIDE = 1 and not PLL generate
    core_clock <= clock;
  end generate g_direct;

  g_no_pll : if not PLL generate
    clock_good   <= '1';
    ready        <= '1';
    second_clock <= '1';
  end generate g_no_pll;

  g_divided : if DIVIDE > 1 generate

    -- no reset before there is a clock
    -- vsg_off signal_007
    signal half    : std_logic := '0';
    signal quarter : std_logic := '0';

  begin

    -- vsg_on signal_007

    p_half : process (clock) is
    begin

      if rising_edge(clock) then
        half <= not half;

        if (half = '1') then
          quarter <= not quarter;
        end if;
      end if;

    end process p_half;

    core_clock <= half when DIVIDE = 2 else
                  quarter;

  end generate g_divided;

  i_sync_bits : entity work.sync_bits
    generic map (
      WIDTH  => 1,
      STAGES => 2
    )
    port map (
      clk             => core_clock,
      asynchronous(0) => steps_over_spi,
      synchronous(0)  => control
    );

  g_drivers : if DRIVERS generate

    signal said : std_logic_vector(1 downto 0);

  begin

    i_drivers : entity work.sync_bits
      generic map (
        WIDTH  => 2,
        STAGES => 2
      )
      port map (
        clk             => core_clock,
        asynchronous(0) => driver_fault_n,
        asynchronous(1) => driver_ready,
        synchronous     => said
      );

    driver_fault <= not (said(0) and said(1));

  end generate g_drivers;

  g_no_drivers : if not DRIVERS generate
    driver_fault <= '0';
  end generate g_no_drivers;

  allowed <= permit and clock_good;

  i_release : entity work.gate_release
    generic map (
      WIDTH => gates'length
    )
    port map (
      clk       => core_clock,
      permit    => allowed,
      gates     => gates_now,
      pins      => gates,
      permitted => permitted
    );

  p_start : process (core_clock) is
  begin

    if rising_edge(core_clock) then
      if (since_start /= 15) then
        since_start <= since_start + 1;
        rst         <= '1';
      else
        rst <= '0';
      end if;

      if (ready = '0') then
        since_start <= (others => '0');
        rst         <= '1';
      end if;
    end if;

  end process p_start;

  external_trip <= not permitted or not second_clock;
  held_high     <= (others => '1');

  i_host_link : entity work.host_link
    generic map (
      CONTROLLER     => CONTROLLER,
      STEP_WORDS     => STEP_WORDS,
      EXPLORERS      => choose(CONTROLLER = CONTROLLER_MPDCC, EXPLORERS, 0),
      OPTION         => FOLDED or CONTROLLER = CONTROLLER_MPTC,
      CLOCK_HZ       => CLOCK_HZ,
      BAUD           => BAUD,
      RECORDER       => RECORDER_ROWS > 0,
      LIMIT          => choose(BAUD < 1_000_000, CLOCK_HZ / 50, CLOCK_HZ / 200)
    )
    port map (
      clk             => core_clock,
      rst             => rst,
      control         => control,
      uart_rx         => uart_rx,
      uart_tx         => uart_tx,
      spi_sck         => spi_sck,
      spi_cs_n        => spi_cs_n,
      spi_mosi        => spi_mosi,
      spi_miso        => spi_miso,
      awready         => awready,
      awvalid         => awvalid,
      awaddr          => awaddr,
      awprot          => awprot,
      wready          => wready,
      wvalid          => wvalid,
      wdata           => wdata,
      wstrb           => wstrb,
      bready          => bready,
      bvalid          => bvalid,
      bresp           => bresp,
      arready         => arready,
      arvalid         => arvalid,
      araddr          => araddr,
      arprot          => arprot,
      rready          => rready,
      rvalid          => rvalid,
      rdata           => rdata,
      rresp           => rresp,
      step_start      => step_start,
      measurements    => measurements,
      step_position   => step_position,
      step_busy       => step_busy,
      decision_valid  => decision_valid,
      decision        => decision,
      decision_flags  => decision_flags,
      decision_length => decision_length,
      decision_cycles => decision_cycles,
      applied         => decision,
      applied_known   => running,
      enabled         => running,
      tripped         => tripped,
      faults          => faults,
      gates           => gates_word
    );

  -- the executor's own
  decision_flags(FLAG_TRIPPED downto FLAG_NO_ANSWER) <= (others => '0');

  gates_word <= x"00" & gates_now;
  tripped    <= '0' when faults = (faults'range => '0') else
                '1';

  g_mpdcc : if CONTROLLER = CONTROLLER_MPDCC generate

    i_system : entity work.mpdcc_system
      generic map (
        EXPLORERS         => EXPLORERS,
        FOLDED            => FOLDED,
        SECOND_LEVEL      => SECOND_LEVEL,
        WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK,
        INWARDS           => INWARDS,
        CAPACITOR_FILTER  => CAPACITOR_FILTER,
        LEAKAGE_ESTIMATE  => LEAKAGE_ESTIMATE,
        FLUX_OBSERVER     => FLUX_OBSERVER,
        LEAST_DEAD_TIME   => DEAD_CLOCKS,
        SECOND_SUPERVISOR => SECOND_SUPERVISOR,
        RECORDER_ROWS     => RECORDER_ROWS
      )
      port map (
        clk            => core_clock,
        rst            => rst,
        enable         => '1',
        external_trip  => external_trip,
        driver_fault   => driver_fault,
        second_clock   => second_clock,
        start          => step_start,
        is_alpha       => measurements(15 downto 0),
        is_beta        => measurements(31 downto 16),
        psir_alpha     => measurements(47 downto 32),
        psir_beta      => measurements(63 downto 48),
        v_n            => measurements(79 downto 64),
        v_ph_a         => measurements(95 downto 80),
        v_ph_b         => measurements(111 downto 96),
        v_ph_c         => measurements(127 downto 112),
        v_dc           => measurements(143 downto 128),
        iref_alpha     => measurements(159 downto 144),
        iref_beta      => measurements(175 downto 160),
        omega_s        => measurements(191 downto 176),
        omega_r        => measurements(207 downto 192),
        s_prev_a       => step_position(2 downto 0),
        s_prev_b       => step_position(5 downto 3),
        s_prev_c       => step_position(8 downto 6),
        valid          => decision_valid,
        busy           => step_busy,
        s_a            => decision(2 downto 0),
        s_b            => decision(5 downto 3),
        s_c            => decision(8 downto 6),
        held           => decision_flags(FLAG_HELD),
        deadlock       => decision_flags(FLAG_DEADLOCK),
        length         => decision_length(5 downto 0),
        saturated      => decision_flags(FLAG_SATURATED),
        exhausted      => decision_flags(FLAG_EXHAUSTED),
        cycles         => decision_cycles,
        flux_alpha     => open,
        flux_beta      => open,
        gates          => gates_now(3 * gates_of(true) - 1 downto 0),
        running        => running,
        faults         => faults(14 downto 0),
        s_axil_awready => awready,
        s_axil_awvalid => awvalid,
        s_axil_awaddr  => awaddr,
        s_axil_awprot  => awprot,
        s_axil_wready  => wready,
        s_axil_wvalid  => wvalid,
        s_axil_wdata   => wdata,
        s_axil_wstrb   => wstrb,
        s_axil_bready  => bready,
        s_axil_bvalid  => bvalid,
        s_axil_bresp   => bresp,
        s_axil_arready => arready,
        s_axil_arvalid => arvalid,
        s_axil_araddr  => araddr,
        s_axil_arprot  => arprot,
        s_axil_rready  => rready,
        s_axil_rvalid  => rvalid,
        s_axil_rdata   => rdata,
        s_axil_rresp   => rresp
      );

    decision(15 downto 9)        <= (others => '0');
    decision_flags(FLAG_CLAMPED) <= '0';
    decision_length(7 downto 6)  <= "00";

    g_no_gates : for i in 3 * gates_of(true) to 23 generate
      gates_now(i) <= '0';
    end generate g_no_gates;

  end generate g_mpdcc;

  g_kbest : if CONTROLLER = CONTROLLER_KBEST generate

    i_system : entity work.kbest_system
      generic map (
        BEAM              => BEAM,
        STAGES            => STAGES,
        CAPACITOR_FILTER  => CAPACITOR_FILTER,
        LEAST_DEAD_TIME   => DEAD_CLOCKS,
        SECOND_SUPERVISOR => SECOND_SUPERVISOR,
        RECORDER_ROWS     => RECORDER_ROWS
      )
      port map (
        clk            => core_clock,
        rst            => rst,
        enable         => '1',
        external_trip  => external_trip,
        driver_fault   => driver_fault,
        second_clock   => second_clock,
        start          => step_start,
        is_alpha       => measurements(15 downto 0),
        is_beta        => measurements(31 downto 16),
        psir_alpha     => measurements(47 downto 32),
        psir_beta      => measurements(63 downto 48),
        v_n            => measurements(79 downto 64),
        v_ph_a         => measurements(95 downto 80),
        v_ph_b         => measurements(111 downto 96),
        v_ph_c         => measurements(127 downto 112),
        v_dc           => measurements(143 downto 128),
        iref_alpha     => measurements(159 downto 144),
        iref_beta      => measurements(175 downto 160),
        omega_s        => measurements(191 downto 176),
        omega_r        => measurements(207 downto 192),
        s_prev_a       => step_position(2 downto 0),
        s_prev_b       => step_position(5 downto 3),
        s_prev_c       => step_position(8 downto 6),
        valid          => decision_valid,
        busy           => step_busy,
        s_a            => decision(2 downto 0),
        s_b            => decision(5 downto 3),
        s_c            => decision(8 downto 6),
        held           => decision_flags(FLAG_HELD),
        cost           => open,
        saturated      => decision_flags(FLAG_SATURATED),
        cycles         => decision_cycles,
        flux_alpha     => open,
        flux_beta      => open,
        gates          => gates_now(3 * gates_of(true) - 1 downto 0),
        running        => running,
        faults         => faults(14 downto 0),
        s_axil_awready => awready,
        s_axil_awvalid => awvalid,
        s_axil_awaddr  => awaddr,
        s_axil_awprot  => awprot,
        s_axil_wready  => wready,
        s_axil_wvalid  => wvalid,
        s_axil_wdata   => wdata,
        s_axil_wstrb   => wstrb,
        s_axil_bready  => bready,
        s_axil_bvalid  => bvalid,
        s_axil_bresp   => bresp,
        s_axil_arready => arready,
        s_axil_arvalid => arvalid,
        s_axil_araddr  => araddr,
        s_axil_arprot  => arprot,
        s_axil_rready  => rready,
        s_axil_rvalid  => rvalid,
        s_axil_rdata   => rdata,
        s_axil_rresp   => rresp
      );

    decision(15 downto 9)          <= (others => '0');
    decision_flags(FLAG_DEADLOCK)  <= '0';
    decision_flags(FLAG_CLAMPED)   <= '0';
    decision_flags(FLAG_EXHAUSTED) <= '0';
    decision_length                <= (others => '0');

    g_no_gates : for i in 3 * gates_of(true) to 23 generate
      gates_now(i) <= '0';
    end generate g_no_gates;

  end generate g_kbest;

  g_mptc : if CONTROLLER = CONTROLLER_MPTC generate

    i_system : entity work.mptc_system
      generic map (
        FAMILY            => FAMILY,
        SENSORLESS        => SENSORLESS,
        LEAST_DEAD_TIME   => DEAD_CLOCKS,
        SECOND_SUPERVISOR => SECOND_SUPERVISOR,
        RECORDER_ROWS     => RECORDER_ROWS
      )
      port map (
        clk            => core_clock,
        rst            => rst,
        enable         => '1',
        external_trip  => external_trip,
        driver_fault   => driver_fault,
        second_clock   => second_clock,
        start          => step_start,
        is_alpha       => measurements(15 downto 0),
        is_beta        => measurements(31 downto 16),
        psis_alpha     => measurements(47 downto 32),
        psis_beta      => measurements(63 downto 48),
        omega_r        => measurements(79 downto 64),
        v_dc           => measurements(95 downto 80),
        torque_ref     => measurements(111 downto 96),
        psi_ref        => measurements(126 downto 112),
        u              => step_position(2 downto 0),
        valid          => decision_valid,
        busy           => step_busy,
        u_next         => decision(2 downto 0),
        switches       => decision(5 downto 3),
        saturated      => decision_flags(FLAG_SATURATED),
        clamped        => decision_flags(FLAG_CLAMPED),
        cycles         => decision_cycles,
        flux_alpha     => open,
        flux_beta      => open,
        speed          => open,
        gates          => gates_now(5 downto 0),
        running        => running,
        faults         => faults(14 downto 0),
        s_axil_awready => awready,
        s_axil_awvalid => awvalid,
        s_axil_awaddr  => awaddr,
        s_axil_awprot  => awprot,
        s_axil_wready  => wready,
        s_axil_wvalid  => wvalid,
        s_axil_wdata   => wdata,
        s_axil_wstrb   => wstrb,
        s_axil_bready  => bready,
        s_axil_bvalid  => bvalid,
        s_axil_bresp   => bresp,
        s_axil_arready => arready,
        s_axil_arvalid => arvalid,
        s_axil_araddr  => araddr,
        s_axil_arprot  => arprot,
        s_axil_rready  => rready,
        s_axil_rvalid  => rvalid,
        s_axil_rdata   => rdata,
        s_axil_rresp   => rresp
      );

    decision(15 downto 6)          <= (others => '0');
    decision_flags(FLAG_HELD)      <= '0';
    decision_flags(FLAG_DEADLOCK)  <= '0';
    decision_flags(FLAG_EXHAUSTED) <= '0';
    decision_length                <= (others => '0');
    gates_now(23 downto 6)         <= (others => '0');

  end generate g_mptc;

  faults(15) <= '0';

  p_leds : process (core_clock) is
  begin

    if rising_edge(core_clock) then
      if (step_start = '1') then
        stretch <= (others => '1');
      elsif (stretch /= 0) then
        stretch <= stretch - 1;
      end if;

      if (rst = '1') then
        stretch <= (others => '0');
      end if;
    end if;

  end process p_leds;

  leds(0) <= running;
  leds(1) <= tripped;
  leds(2) <= stretch(stretch'left);
  leds(3) <= control;

end architecture rtl;
