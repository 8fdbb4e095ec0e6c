-- mpdcc_system without a host: words of converters come in, gates go out, a boot ROM sets it up.
--
-- With tick the words are sampled, scaled and transformed; then the system decides. boot_loader writes
-- the registers of drive_registers, which `make registers ARGS=--vhdl` makes of a drive file. Before it
-- is done no decision begins and no gate is on. If it fails, this stays so until the next reset. A reset
-- also clears faults of the gate guard.
-- flux_alpha and flux_beta are for the loop that makes iref, omega_s and omega_r.
--
-- Formats: as mpdcc_system; converters of 12 bits, ranges as the constants below say.
-- Latency: decision 5 clocks after tick begins; valid as mpdcc_system.
-- Overflow: measurements saturate; a tick while a decision is under way is dropped.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;

library work;
  use work.drive_registers.all;

entity fabric_system is
  port (
    clk        : in    std_logic;                     -- rising edge
    rst        : in    std_logic;                     -- synchronous, active high
    permit     : in    std_logic;                     -- '0': all pins off, without a clock; any clock
    -- converters, sampled with tick
    tick       : in    std_logic;                     -- '1' for one clock, once a control period
    adc_i_a    : in    std_logic_vector(11 downto 0); -- current of phase a, 2048: 0, 2 pu full scale
    adc_i_b    : in    std_logic_vector(11 downto 0); -- current of phase b, likewise
    adc_v_n    : in    std_logic_vector(11 downto 0); -- neutral point, 2048: 0, 0.25 pu full scale
    adc_v_a    : in    std_logic_vector(11 downto 0); -- phase capacitor a, 1 pu full scale
    adc_v_b    : in    std_logic_vector(11 downto 0); -- phase capacitor b, likewise
    adc_v_c    : in    std_logic_vector(11 downto 0); -- phase capacitor c, likewise
    adc_v_dc   : in    std_logic_vector(11 downto 0); -- dc link, 4 pu full scale
    -- outer loop, stable from tick until valid
    iref_alpha : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    iref_beta  : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    omega_s    : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    omega_r    : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    flux_alpha : out   std_logic_vector(15 downto 0); -- rotor flux, signed, 1/9000 pu, from one clock after valid
    flux_beta  : out   std_logic_vector(15 downto 0); -- likewise
    -- state
    booted     : out   std_logic;                     -- '1': the system is set up
    failed     : out   std_logic;                     -- '1': it could not be
    valid      : out   std_logic;                     -- '1' for one clock: decision is new
    s_a        : out   std_logic_vector(2 downto 0);  -- switch position of phase a
    s_b        : out   std_logic_vector(2 downto 0);  -- switch position of phase b
    s_c        : out   std_logic_vector(2 downto 0);  -- switch position of phase c
    faults     : out   std_logic_vector(14 downto 0); -- latched, bits as in gate_tables
    pins       : out   std_logic_vector(23 downto 0)  -- gates, '1': on; S1 to S8 of a, b, c
  );
end entity fabric_system;

architecture rtl of fabric_system is

  constant STEPS   : real    := 4096.0; -- of a converter
  constant LATENCY : natural := 5;      -- clocks from tick to start

  subtype word_t is std_logic_vector(15 downto 0);

  subtype adc_t is std_logic_vector(11 downto 0);

  -- counts of a measurement a step of the converter, 8 fractional bits
  function gain (counts, span : real) return word_t is
  begin

    return std_logic_vector(to_unsigned(integer(counts * span / STEPS * 256.0), 16));

  end function gain;

  constant MIDDLE : adc_t := x"800"; -- word of a converter that means 0
  constant BOTTOM : adc_t := x"000";

  -- spans are from the lowest to the highest word
  constant GAIN_I    : word_t := gain(COUNTS_IS_ALPHA, 4.0);
  constant GAIN_V_N  : word_t := gain(COUNTS_V_N, 0.5);
  constant GAIN_V_PH : word_t := gain(COUNTS_V_PH_A, 1.0);
  constant GAIN_V_DC : word_t := gain(COUNTS_V_DC, 4.0);

  type adcs_t is array (0 to 6) of adc_t;

  type words_t is array (0 to 6) of word_t;

  constant OFFSETS : adcs_t  := (0 | 1 | 2 => MIDDLE, others => BOTTOM);
  constant GAINS   : words_t := (GAIN_I, GAIN_I, GAIN_V_N, GAIN_V_PH, GAIN_V_PH, GAIN_V_PH, GAIN_V_DC);

  signal sampled    : adcs_t;
  signal scaled     : words_t;
  signal is_alpha   : word_t;
  signal is_beta    : word_t;
  signal ticks      : std_logic_vector(LATENCY downto 1); -- tick, that many clocks ago
  signal start      : std_logic;
  signal permitted  : std_logic;
  signal trip       : std_logic;
  signal done       : std_logic;
  signal gates      : std_logic_vector(23 downto 0);
  signal place      : std_logic_vector(9 downto 0);
  signal entry      : std_logic_vector(47 downto 0);
  signal awready    : std_logic;
  signal awvalid    : std_logic;
  signal awaddr     : std_logic_vector(9 downto 0);
  signal awprot     : std_logic_vector(2 downto 0);
  signal wready     : std_logic;
  signal wvalid     : std_logic;
  signal wdata      : std_logic_vector(31 downto 0);
  signal wstrb      : std_logic_vector(3 downto 0);
  signal bready     : std_logic;
  signal bvalid     : std_logic;
  signal bresp      : std_logic_vector(1 downto 0);
  signal arready    : std_logic;
  signal arvalid    : std_logic;
  signal araddr     : std_logic_vector(9 downto 0);
  signal arprot     : std_logic_vector(2 downto 0);
  signal rready     : std_logic;
  signal rvalid     : std_logic;
  signal rdata      : std_logic_vector(31 downto 0);
  signal rresp      : std_logic_vector(1 downto 0);

begin

  ---------------------------------------------------------------------------------------------
  -- Measurements
  ---------------------------------------------------------------------------------------------

  p_sample : process (clk) is
  begin

    if rising_edge(clk) then
      if (tick = '1') then
        sampled <= (adc_i_a, adc_i_b, adc_v_n, adc_v_a, adc_v_b, adc_v_c, adc_v_dc);
      end if;

      ticks <= ticks(LATENCY - 1 downto 1) & tick;

      if (rst = '1') then
        ticks <= (others => '0');
      end if;
    end if;

  end process p_sample;

  g_scaling : for i in sampled'range generate

    i_scaling : entity work.adc_scaling
      generic map (
        POSITIVE => i > 2
      )
      port map (
        clk    => clk,
        word   => sampled(i),
        offset => OFFSETS(i),
        gain   => GAINS(i),
        value  => scaled(i)
      );

  end generate g_scaling;

  i_clarke : entity work.clarke
    port map (
      clk   => clk,
      a     => scaled(0),
      b     => scaled(1),
      alpha => is_alpha,
      beta  => is_beta
    );

  start <= ticks(LATENCY) and done;

  ---------------------------------------------------------------------------------------------
  -- Boot
  ---------------------------------------------------------------------------------------------

  p_rom : process (clk) is
  begin

    if rising_edge(clk) then
      if (unsigned(place) <= BOOT_ROM'high) then
        entry <= BOOT_ROM(to_integer(unsigned(place)));
      end if;
    end if;

  end process p_rom;

  i_boot : entity directmpc.boot_loader
    port map (
      clk            => clk,
      rst            => rst,
      place          => place,
      entry          => entry,
      last           => std_logic_vector(to_unsigned(BOOT_ROM'high, 10)),
      done           => done,
      failed         => failed,
      m_axil_awready => awready,
      m_axil_awvalid => awvalid,
      m_axil_awaddr  => awaddr,
      m_axil_awprot  => awprot,
      m_axil_wready  => wready,
      m_axil_wvalid  => wvalid,
      m_axil_wdata   => wdata,
      m_axil_wstrb   => wstrb,
      m_axil_bready  => bready,
      m_axil_bvalid  => bvalid,
      m_axil_bresp   => bresp,
      m_axil_arready => arready,
      m_axil_arvalid => arvalid,
      m_axil_araddr  => araddr,
      m_axil_arprot  => arprot,
      m_axil_rready  => rready,
      m_axil_rvalid  => rvalid,
      m_axil_rdata   => rdata,
      m_axil_rresp   => rresp
    );

  booted <= done;

  ---------------------------------------------------------------------------------------------
  -- System and pins
  ---------------------------------------------------------------------------------------------

  i_release : entity directmpc.gate_release
    generic map (
      WIDTH => pins'length
    )
    port map (
      clk       => clk,
      permit    => permit,
      gates     => gates,
      pins      => pins,
      permitted => permitted
    );

  trip <= not permitted;

  i_system : entity directmpc.mpdcc_system
    port map (
      clk            => clk,
      rst            => rst,
      enable         => done,
      external_trip  => trip,
      start          => start,
      is_alpha       => is_alpha,
      is_beta        => is_beta,
      psir_alpha     => (others => '0'),
      psir_beta      => (others => '0'),
      v_n            => scaled(2),
      v_ph_a         => scaled(3),
      v_ph_b         => scaled(4),
      v_ph_c         => scaled(5),
      v_dc           => scaled(6),
      iref_alpha     => iref_alpha,
      iref_beta      => iref_beta,
      omega_s        => omega_s,
      omega_r        => omega_r,
      s_prev_a       => (others => '0'),
      s_prev_b       => (others => '0'),
      s_prev_c       => (others => '0'),
      valid          => valid,
      busy           => open,
      s_a            => s_a,
      s_b            => s_b,
      s_c            => s_c,
      held           => open,
      deadlock       => open,
      length         => open,
      saturated      => open,
      exhausted      => open,
      cycles         => open,
      flux_alpha     => flux_alpha,
      flux_beta      => flux_beta,
      gates          => gates,
      running        => open,
      faults         => faults,
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

end architecture rtl;
