-- The host links of a board: UART and SPI, one frame protocol (docs/protocol.md), one executor.
--
-- One receiver, one transmitter and one set of counters serve both links, each in every second clock, with a memory
-- each. The executor answers both, reaches the registers through AXI4-Lite and hands the measurements of a step to
-- the core. Link 0 is the UART, link 1 SPI; `control` says which is in control, the other one may watch and disable.
--
-- Formats: see link_executor for the steps, docs/protocol.md for the frames.
-- Latency: see link_executor; a frame of n payload bytes is n + 13 bytes on the line.
-- Overflow: none; see frame_receiver and link_executor for what is refused.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.link_constants.all;

entity host_link is
  generic (
    CONTROLLER     : positive range 1 to 3 := CONTROLLER_MPDCC; -- one of the constants CONTROLLER_
    STEP_WORDS     : positive              := STEP_WORDS_MPDCC; -- 16-bit words of measurements in a STEP
    EXPLORERS      : natural               := 2;                -- reported to the host
    OPTION         : boolean               := false;            -- reported to the host, bit 0 of options
    CLOCK_HZ       : positive              := 25_000_000;       -- clk, Hz
    BAUD           : positive              := 3_000_000;        -- UART, 1/s
    LIMIT          : positive              := 125_000;          -- clocks a frame may take
    DECISION_LIMIT : positive              := LONGEST_DECISION; -- clocks a decision may take
    RECORDER       : boolean               := false;            -- true: either link writes the recorder's registers
    ADDRESS_WIDTH  : positive              := 10                -- bits of a register's byte address
  );
  port (
    clk             : in    std_logic;                                      -- rising edge
    rst             : in    std_logic;                                      -- synchronous, active high
    control         : in    std_logic;                                      -- link in control; '0': UART, '1': SPI
    -- lines, asynchronous
    uart_rx         : in    std_logic;                                      -- idle high
    uart_tx         : out   std_logic;                                      -- idle high
    spi_sck         : in    std_logic;                                      -- mode 0
    spi_cs_n        : in    std_logic;                                      -- active low
    spi_mosi        : in    std_logic;                                      -- master to slave
    spi_miso        : out   std_logic;                                      -- to be driven while spi_cs_n is low
    -- AXI4-Lite master
    awready         : in    std_logic;                                      -- as in the standard
    awvalid         : out   std_logic;                                      -- as in the standard
    awaddr          : out   std_logic_vector(ADDRESS_WIDTH - 1 downto 0);   -- bytes
    awprot          : out   std_logic_vector(2 downto 0);                   -- as in the standard
    wready          : in    std_logic;                                      -- as in the standard
    wvalid          : out   std_logic;                                      -- as in the standard
    wdata           : out   std_logic_vector(31 downto 0);                  -- word
    wstrb           : out   std_logic_vector(3 downto 0);                   -- as in the standard
    bready          : out   std_logic;                                      -- as in the standard
    bvalid          : in    std_logic;                                      -- as in the standard
    bresp           : in    std_logic_vector(1 downto 0);                   -- "00": okay
    arready         : in    std_logic;                                      -- as in the standard
    arvalid         : out   std_logic;                                      -- as in the standard
    araddr          : out   std_logic_vector(ADDRESS_WIDTH - 1 downto 0);   -- bytes
    arprot          : out   std_logic_vector(2 downto 0);                   -- as in the standard
    rready          : out   std_logic;                                      -- as in the standard
    rvalid          : in    std_logic;                                      -- as in the standard
    rdata           : in    std_logic_vector(31 downto 0);                  -- word
    rresp           : in    std_logic_vector(1 downto 0);                   -- "00": okay
    -- steps, see link_executor
    step_start      : out   std_logic;                                      -- '1' for one clock: decide
    measurements    : out   std_logic_vector(16 * STEP_WORDS - 1 downto 0); -- with step_start, ports in order
    step_position   : out   std_logic_vector(15 downto 0);                  -- s(k-1) or u, with step_start
    step_busy       : in    std_logic;                                      -- '1': a decision is under way
    decision_valid  : in    std_logic;                                      -- '1' for one clock: decision is new
    decision        : in    std_logic_vector(15 downto 0);                  -- position of a STEP reply
    decision_flags  : in    std_logic_vector(7 downto 0);                   -- FLAG_HELD to FLAG_CLAMPED, EXHAUSTED
    decision_length : in    std_logic_vector(7 downto 0);                   -- L*
    decision_cycles : in    std_logic_vector(15 downto 0);                  -- of the core, clock after decision_valid
    applied         : in    std_logic_vector(15 downto 0);                  -- position the gates are at
    applied_known   : in    std_logic;                                      -- '1': they are at one
    enabled         : in    std_logic;                                      -- '1': gates are let through
    tripped         : in    std_logic;                                      -- '1': a fault is latched
    faults          : in    std_logic_vector(15 downto 0);                  -- latched fault codes
    gates           : in    std_logic_vector(31 downto 0)                   -- gate signals, '1': on
  );
end entity host_link;

architecture rtl of host_link is

  constant UART : natural := 0;
  constant SPI  : natural := 1;

  type bytes_t is array (0 to 1) of byte_t;

  signal turn         : std_logic; -- link of this clock
  signal rx_valid     : std_logic_vector(1 downto 0);
  signal rx_data      : bytes_t;
  signal rx_broken    : std_logic_vector(1 downto 0);
  signal ended        : std_logic_vector(1 downto 0);
  signal tx_offered   : std_logic_vector(1 downto 0);
  signal tx_data      : bytes_t;
  signal tx_taken     : std_logic_vector(1 downto 0);
  signal pending      : std_logic_vector(1 downto 0);
  signal link         : std_logic;
  signal address      : std_logic_vector(5 downto 0);
  signal content      : byte_t;
  signal rejected     : std_logic_vector(1 downto 0);
  signal rejection    : outcome_t;
  signal served       : std_logic_vector(1 downto 0);
  signal outcome      : outcome_t;
  signal look         : std_logic;
  signal index        : std_logic_vector(4 downto 0);
  signal shown        : std_logic;
  signal value        : std_logic_vector(31 downto 0);
  signal reply_busy   : std_logic;
  signal reply_begins : std_logic_vector(1 downto 0);
  signal reply_valid  : std_logic;
  signal reply_data   : byte_t;
  signal reply_last   : std_logic;
  signal bus_start    : std_logic;
  signal bus_write    : std_logic;
  signal bus_address  : std_logic_vector(15 downto 0);
  signal bus_wdata    : std_logic_vector(31 downto 0);
  signal bus_done     : std_logic;
  signal bus_rdata    : std_logic_vector(31 downto 0);
  signal bus_response : std_logic_vector(1 downto 0);

begin

  p_turn : process (clk) is
  begin

    if rising_edge(clk) then
      turn <= not turn;

      if (rst = '1') then
        turn <= '0';
      end if;
    end if;

  end process p_turn;

  i_uart_receiver : entity work.uart_receiver
    generic map (
      CLOCK_HZ => CLOCK_HZ,
      BAUD     => BAUD
    )
    port map (
      clk    => clk,
      rst    => rst,
      rx     => uart_rx,
      valid  => rx_valid(UART),
      data   => rx_data(UART),
      broken => rx_broken(UART)
    );

  i_uart_transmitter : entity work.uart_transmitter
    generic map (
      CLOCK_HZ => CLOCK_HZ,
      BAUD     => BAUD
    )
    port map (
      clk   => clk,
      rst   => rst,
      valid => tx_offered(UART),
      data  => tx_data(UART),
      taken => tx_taken(UART),
      tx    => uart_tx
    );

  ended(UART) <= '0';

  i_spi_slave : entity work.spi_slave
    port map (
      clk      => clk,
      rst      => rst,
      sck      => spi_sck,
      cs_n     => spi_cs_n,
      mosi     => spi_mosi,
      miso     => spi_miso,
      rx_valid => rx_valid(SPI),
      rx_data  => rx_data(SPI),
      tx_data  => tx_data(SPI),
      tx_taken => tx_taken(SPI),
      ended    => ended(SPI)
    );

  rx_broken(SPI) <= '0';

  i_frame_receiver : entity work.frame_receiver
    generic map (
      LIMIT => LIMIT
    )
    port map (
      clk      => clk,
      rst      => rst,
      turn     => turn,
      valid    => rx_valid,
      data_0   => rx_data(UART),
      data_1   => rx_data(SPI),
      broken   => rx_broken,
      ended    => ended,
      pending  => pending,
      link     => link,
      address  => address,
      content  => content,
      served   => served,
      rejected => rejected,
      outcome  => rejection
    );

  i_frame_transmitter : entity work.frame_transmitter
    port map (
      clk        => clk,
      rst        => rst,
      turn       => turn,
      begins     => reply_begins,
      valid      => reply_valid,
      data       => reply_data,
      last       => reply_last,
      busy       => reply_busy,
      offered    => tx_offered,
      next_out_0 => tx_data(UART),
      next_out_1 => tx_data(SPI),
      taken      => tx_taken,
      ended      => ended
    );

  i_outcome_counters : entity work.outcome_counters
    port map (
      clk             => clk,
      rst             => rst,
      received        => rejected,
      receive_outcome => rejection,
      served          => served,
      serve_outcome   => outcome,
      look            => look,
      index           => index,
      shown           => shown,
      value           => value
    );

  i_link_executor : entity work.link_executor
    generic map (
      CONTROLLER     => CONTROLLER,
      STEP_WORDS     => STEP_WORDS,
      EXPLORERS      => EXPLORERS,
      OPTION         => OPTION,
      CLOCK_HZ       => CLOCK_HZ,
      LIMIT          => LIMIT,
      DECISION_LIMIT => DECISION_LIMIT,
      RECORDER       => RECORDER
    )
    port map (
      clk             => clk,
      rst             => rst,
      control         => control,
      pending         => pending,
      link            => link,
      address         => address,
      content         => content,
      served          => served,
      outcome         => outcome,
      look            => look,
      index           => index,
      shown           => shown,
      value           => value,
      reply_busy      => reply_busy,
      reply_begins    => reply_begins,
      reply_valid     => reply_valid,
      reply_data      => reply_data,
      reply_last      => reply_last,
      bus_start       => bus_start,
      bus_write       => bus_write,
      bus_address     => bus_address,
      bus_wdata       => bus_wdata,
      bus_done        => bus_done,
      bus_rdata       => bus_rdata,
      bus_response    => bus_response,
      step_start      => step_start,
      measurements    => measurements,
      step_position   => step_position,
      step_busy       => step_busy,
      decision_valid  => decision_valid,
      decision        => decision,
      decision_flags  => decision_flags,
      decision_length => decision_length,
      decision_cycles => decision_cycles,
      applied         => applied,
      applied_known   => applied_known,
      enabled         => enabled,
      tripped         => tripped,
      faults          => faults,
      gates           => gates
    );

  i_axi_lite_master : entity work.axi_lite_master
    generic map (
      ADDRESS_WIDTH => ADDRESS_WIDTH
    )
    port map (
      clk      => clk,
      rst      => rst,
      start    => bus_start,
      write    => bus_write,
      address  => bus_address,
      wdata    => bus_wdata,
      done     => bus_done,
      rdata    => bus_rdata,
      response => bus_response,
      awready  => awready,
      awvalid  => awvalid,
      awaddr   => awaddr,
      awprot   => awprot,
      wready   => wready,
      wvalid   => wvalid,
      wword    => wdata,
      wstrb    => wstrb,
      bready   => bready,
      bvalid   => bvalid,
      bresp    => bresp,
      arready  => arready,
      arvalid  => arvalid,
      araddr   => araddr,
      arprot   => arprot,
      rready   => rready,
      rvalid   => rvalid,
      rword    => rdata,
      rresp    => rresp
    );

end architecture rtl;
