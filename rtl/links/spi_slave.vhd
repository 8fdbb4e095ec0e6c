-- SPI slave, mode 0 (SCK idles low, data sampled on its rising edge), most significant bit first, bytes.
--
-- The shift registers run on SCK itself, so that SCK may be as fast as the core's clock or faster; only
-- whole bytes cross into clk. A byte rests in a holding register for eight periods of SCK; a toggle
-- tells the other side through three flip-flops, so the register is stable when it is looked at:
-- received bytes go SCK to clk, bytes to send clk to SCK. What is offered on tx_data is taken over for
-- the byte after the one that is beginning.
-- While CS_n is high the output register is held at zero: the first byte of every transaction is 0x00,
-- which is what the frame protocol sends between frames, so nothing has to be ready in advance.
-- Clocks while CS_n is high belong to another slave: nothing is received, and nothing is taken.
--
-- Formats: bytes. Rate: a byte has to last at least 6 periods of clk, that is SCK up to 4/3 of clk; CS_n
-- has to stay high for at least 6 periods of clk.
-- Latency: valid 3 to 4 clocks after the eighth rising edge of SCK.
-- Overflow: none; bits of a byte that CS_n cuts off are dropped, and ended says that CS_n went up.
-- Constraints: SCK is a clock; paths between it and clk are false paths, the holding registers are
-- stable by the protocol above.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.link_constants.all;

entity spi_slave is
  port (
    clk      : in    std_logic; -- rising edge
    rst      : in    std_logic; -- synchronous, active high
    sck      : in    std_logic; -- the master's clock, idle low
    cs_n     : in    std_logic; -- chip select, active low
    mosi     : in    std_logic; -- master to slave
    miso     : out   std_logic; -- slave to master; to be driven while cs_n is low
    rx_valid : out   std_logic; -- '1' for one clock: rx_data is a new byte
    rx_data  : out   byte_t;    -- stable until the next rx_valid
    tx_data  : in    byte_t;    -- the next byte to send; 0x00 when there is none
    tx_taken : out   std_logic; -- '1' for one clock: tx_data of the clock before has begun to be sent
    ended    : out   std_logic  -- '1' for one clock: cs_n has gone high
  );
end entity spi_slave;

architecture rtl of spi_slave is

  -- places in seen
  constant RX : natural := 0;
  constant TX : natural := 1;
  constant CS : natural := 2;

  -- driven by sck
  signal count     : unsigned(2 downto 0); -- rising edges since the byte began
  signal shift_in  : std_logic_vector(6 downto 0);
  signal shift_out : byte_t;
  signal rx_hold   : byte_t;
  -- no reset reaches SCK's side: any value will do, but it has to be one
  -- vsg_off signal_007
  signal rx_toggle : std_logic := '0';
  signal tx_toggle : std_logic := '0';
  -- vsg_on signal_007

  -- driven by clk
  signal tx_hold : byte_t;
  signal seen    : std_logic_vector(2 downto 0); -- SCK's side, synchronous to clk: RX, TX, CS
  signal earlier : std_logic_vector(2 downto 0); -- seen a clock ago
  signal rising  : std_logic; -- cs_n has gone high
  signal taken   : std_logic;

begin

  p_count : process (sck, cs_n) is
  begin

    if (cs_n = '1') then
      count <= (others => '0');
    elsif rising_edge(sck) then
      count <= count + 1;
    end if;

  end process p_count;

  p_in : process (sck) is
  begin

    if rising_edge(sck) then
      shift_in <= shift_in(5 downto 0) & mosi;

      if (count = 7) then
        rx_hold   <= shift_in & mosi;
        rx_toggle <= not rx_toggle;
      end if;
    end if;

  end process p_in;

  p_out : process (sck, cs_n) is
  begin

    if (cs_n = '1') then
      shift_out <= (others => '0');
    elsif falling_edge(sck) then
      shift_out <= shift_out(6 downto 0) & '0';

      if (count = 0) then
        shift_out <= tx_hold;
      end if;
    end if;

  end process p_out;

  p_taken : process (sck) is
  begin

    if falling_edge(sck) then
      if (count = 0 and cs_n = '0') then
        tx_toggle <= not tx_toggle;
      end if;
    end if;

  end process p_taken;

  miso <= shift_out(7);

  taken <= earlier(TX) xor seen(TX);

  i_sync_bits : entity work.sync_bits
    generic map (
      WIDTH  => 3,
      STAGES => 2
    )
    port map (
      clk              => clk,
      asynchronous(RX) => rx_toggle,
      asynchronous(TX) => tx_toggle,
      asynchronous(CS) => cs_n,
      synchronous      => seen
    );

  p_cross : process (clk) is
  begin

    if rising_edge(clk) then
      earlier  <= seen;
      rx_valid <= earlier(RX) xor seen(RX);
      rising   <= seen(CS) and not earlier(CS);
      ended    <= rising;                      -- behind the rx_valid of the last byte

      if (earlier(RX) /= seen(RX)) then
        rx_data <= rx_hold;
      end if;

      -- changes only just after SCK has taken it over: eight periods of SCK before it does so again
      if (taken = '1') then
        tx_hold <= tx_data;
      end if;

      -- cut off: what waits here is sent again with its frame
      if (rising = '1') then
        tx_hold <= x"00";
      end if;

      if (rst = '1') then
        tx_hold  <= x"00";
        rx_valid <= '0';
        rising   <= '0';
        ended    <= '0';
      end if;
    end if;

  end process p_cross;

  tx_taken <= taken;

end architecture rtl;
