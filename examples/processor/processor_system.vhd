-- mpdcc_system beside a processor: registers on AXI4-Lite, one interrupt, gates on pins.
--
-- The processor writes the measurements, starts a decision and reads it, see directmpc.h. Its bus and this entity have
-- one clock. A board puts its own bus bridge in front of s_axil, and its own converters where the processor gets its
-- measurements from.
--
-- Interrupt: a level. It is high
--   - from a decision on until the processor has read result.decision;
--   - while a fault of the gate guard is latched, until the processor clears it.
-- Safety: external_trip and permit may come from any clock, or from none. permit = '0' turns the pins off without a
-- clock (gate_release). Both latch the fault external_trip while the drive is enabled.
-- Formats: as mpdcc_system.
-- Latency: the interrupt comes one clock after the decision. external_trip takes two clocks more than mpdcc_system's.
-- Overflow: a decision that is not read before the next one is replaced by it.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;

entity processor_system is
  generic (
    EXPLORERS       : positive range 1 to 8    := 1; -- number of explorers
    LEAST_DEAD_TIME : positive range 1 to 4095 := 10 -- clocks; shorter dead times are raised to it
  );
  port (
    clk            : in    std_logic;                     -- rising edge, the bus's clock
    rst            : in    std_logic;                     -- synchronous, active high
    permit         : in    std_logic;                     -- '1': gates may be on; asynchronous
    external_trip  : in    std_logic;                     -- '1': all gates off; asynchronous
    interrupt      : out   std_logic;                     -- '1': a decision to read, or a fault
    gates          : out   std_logic_vector(23 downto 0); -- '1': on; S1 to S8 of a, b, c
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
end entity processor_system;

architecture rtl of processor_system is

  constant DECISION_ADDRESS : std_logic_vector(9 downto 0) := "0010000000"; -- result.decision, 0x080

  constant NOTHING  : std_logic_vector(15 downto 0) := (others => '0'); -- measurements come from the registers
  constant POSITION : std_logic_vector(2 downto 0)  := (others => '0');

  signal asynchronous  : std_logic_vector(0 downto 0);
  signal synchronous   : std_logic_vector(0 downto 0);
  signal permitted     : std_logic;
  signal trip          : std_logic;
  signal system_gates  : std_logic_vector(23 downto 0);
  signal system_valid  : std_logic;
  signal system_faults : std_logic_vector(14 downto 0);
  signal axil_arready  : std_logic;
  signal unread        : std_logic; -- a decision waits to be read

begin

  asynchronous(0) <= external_trip;

  i_trip : entity directmpc.sync_bits
    port map (
      clk          => clk,
      asynchronous => asynchronous,
      synchronous  => synchronous
    );

  i_release : entity directmpc.gate_release
    generic map (
      WIDTH => gates'length
    )
    port map (
      clk       => clk,
      permit    => permit,
      gates     => system_gates,
      pins      => gates,
      permitted => permitted
    );

  trip <= synchronous(0) or not permitted;

  i_system : entity directmpc.mpdcc_system
    generic map (
      EXPLORERS       => EXPLORERS,
      LEAST_DEAD_TIME => LEAST_DEAD_TIME
    )
    port map (
      clk            => clk,
      rst            => rst,
      enable         => '1',
      external_trip  => trip,
      start          => '0',
      is_alpha       => NOTHING,
      is_beta        => NOTHING,
      psir_alpha     => NOTHING,
      psir_beta      => NOTHING,
      v_n            => NOTHING,
      v_ph_a         => NOTHING,
      v_ph_b         => NOTHING,
      v_ph_c         => NOTHING,
      v_dc           => NOTHING,
      iref_alpha     => NOTHING,
      iref_beta      => NOTHING,
      omega_s        => NOTHING,
      omega_r        => NOTHING,
      s_prev_a       => POSITION,
      s_prev_b       => POSITION,
      s_prev_c       => POSITION,
      valid          => system_valid,
      busy           => open,
      s_a            => open,
      s_b            => open,
      s_c            => open,
      held           => open,
      deadlock       => open,
      length         => open,
      saturated      => open,
      exhausted      => open,
      cycles         => open,
      flux_alpha     => open,
      flux_beta      => open,
      gates          => system_gates,
      running        => open,
      faults         => system_faults,
      s_axil_awready => s_axil_awready,
      s_axil_awvalid => s_axil_awvalid,
      s_axil_awaddr  => s_axil_awaddr,
      s_axil_awprot  => s_axil_awprot,
      s_axil_wready  => s_axil_wready,
      s_axil_wvalid  => s_axil_wvalid,
      s_axil_wdata   => s_axil_wdata,
      s_axil_wstrb   => s_axil_wstrb,
      s_axil_bready  => s_axil_bready,
      s_axil_bvalid  => s_axil_bvalid,
      s_axil_bresp   => s_axil_bresp,
      s_axil_arready => axil_arready,
      s_axil_arvalid => s_axil_arvalid,
      s_axil_araddr  => s_axil_araddr,
      s_axil_arprot  => s_axil_arprot,
      s_axil_rready  => s_axil_rready,
      s_axil_rvalid  => s_axil_rvalid,
      s_axil_rdata   => s_axil_rdata,
      s_axil_rresp   => s_axil_rresp
    );

  s_axil_arready <= axil_arready;

  p_unread : process (clk) is
  begin

    if rising_edge(clk) then
      if (s_axil_arvalid = '1' and axil_arready = '1' and s_axil_araddr = DECISION_ADDRESS) then
        unread <= '0';
      end if;

      -- a decision in the clock of the read is not the one that is read
      if (system_valid = '1') then
        unread <= '1';
      end if;

      if (rst = '1') then
        unread <= '0';
      end if;
    end if;

  end process p_unread;

  interrupt <= '1' when unread = '1' or unsigned(system_faults) /= 0 else
               '0';

end architecture rtl;
