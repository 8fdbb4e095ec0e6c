-- UART receiver: 8 data bits, no parity, one stop bit, least significant bit first.
--
-- The phase accumulator of uart_timing marks the middle of every bit.
--
-- Formats: rates as uart_timing; BAUD up to a quarter of CLOCK_HZ.
-- Latency: valid or broken 3 clocks after the middle of the stop bit; a byte every ten bits.
-- Overflow: a stop bit that is low gives broken instead of valid; the next start bit is looked for only
-- after the line has been high again, so a line held low is one broken byte.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.link_constants.all;
  use work.uart_timing.all;

entity uart_receiver is
  generic (
    CLOCK_HZ : positive := 25_000_000; -- clk, Hz
    BAUD     : positive := 3_000_000   -- bit rate, 1/s
  );
  port (
    clk    : in    std_logic; -- rising edge
    rst    : in    std_logic; -- synchronous, active high
    rx     : in    std_logic; -- the line, asynchronous, idle high
    valid  : out   std_logic; -- '1' for one clock: data is a new byte
    data   : out   byte_t;    -- stable until the next byte's first data bit
    broken : out   std_logic  -- '1' for one clock: a byte without stop bit was dropped
  );
end entity uart_receiver;

architecture rtl of uart_receiver is

  constant INCREMENT : natural := phase_increment(CLOCK_HZ, BAUD);

  type state_t is record
    busy   : std_logic;
    phase  : unsigned(PHASE_WIDTH downto 0); -- carry on top: middle of a bit
    count  : unsigned(3 downto 0);
    valid  : std_logic;
    broken : std_logic;
  end record state_t;

  constant STATE_INIT : state_t := (
    busy   => '0',
    phase  => (others => '0'),
    count  => (others => '0'),
    valid  => '0',
    broken => '0'
  );

  signal line    : std_logic; -- rx, synchronous to clk
  signal earlier : std_logic; -- line a clock ago
  signal r       : state_t;
  signal bits_in : byte_t;

begin

  assert rates_fit(CLOCK_HZ, BAUD)
    report "uart_receiver: BAUD above a quarter of CLOCK_HZ, or a rate that is no multiple of 100"
    severity failure;

  i_sync_bits : entity work.sync_bits
    generic map (
      WIDTH  => 1,
      STAGES => 3
    )
    port map (
      clk            => clk,
      asynchronous(0) => rx,
      synchronous(0)  => line
    );

  p_receive : process (clk) is

    variable v : state_t;

  begin

    if rising_edge(clk) then
      earlier  <= line;
      v        := r;
      v.valid  := '0';
      v.broken := '0';

      if (r.busy = '0') then
        -- half a bit before the first sample; the line has to fall for a start bit
        v.phase := to_unsigned(2 ** (PHASE_WIDTH - 1), PHASE_WIDTH + 1);
        v.count := (others => '0');
        v.busy  := earlier and not line;
      else
        v.phase := ('0' & r.phase(PHASE_WIDTH - 1 downto 0)) + INCREMENT;

        if (v.phase(PHASE_WIDTH) = '1') then
          v.count := r.count + 1;

          if (r.count = 0) then
            v.busy := not line;          -- a spike is no start bit
          elsif (r.count = FRAME_BITS - 1) then
            v.busy   := '0';
            v.valid  := line;
            v.broken := not line;
          else
            bits_in <= line & bits_in(7 downto 1);
          end if;
        end if;
      end if;

      if (rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_receive;

  valid  <= r.valid;
  broken <= r.broken;
  data   <= bits_in;

end architecture rtl;
