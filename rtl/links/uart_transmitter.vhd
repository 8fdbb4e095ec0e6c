-- UART transmitter: 8 data bits, no parity, one stop bit, least significant bit first.
--
-- The phase accumulator of uart_timing runs all the time and marks the beginning of every bit.
--
-- Formats: rates as uart_timing; BAUD up to a quarter of CLOCK_HZ.
-- Latency: the start bit begins at the next bit clock after taken, less than a bit away; a byte every
-- ten bits while valid stays.
-- Overflow: none; a byte waits until it is taken.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.link_constants.all;
  use work.uart_timing.all;

entity uart_transmitter is
  generic (
    CLOCK_HZ : positive := 25_000_000; -- clk, Hz
    BAUD     : positive := 3_000_000   -- bit rate, 1/s
  );
  port (
    clk   : in    std_logic; -- rising edge
    rst   : in    std_logic; -- synchronous, active high
    valid : in    std_logic; -- '1': data is to be sent
    data  : in    byte_t;    -- stable while valid
    taken : out   std_logic; -- '1' for one clock: data has been taken
    tx    : out   std_logic  -- the line, idle high
  );
end entity uart_transmitter;

architecture rtl of uart_transmitter is

  constant INCREMENT : natural := phase_increment(CLOCK_HZ, BAUD);

  signal phase : unsigned(PHASE_WIDTH downto 0); -- carry on top: a bit begins
  -- the line idles from configuration on, before any reset
  -- vsg_off signal_007
  signal shift : std_logic_vector(FRAME_BITS - 1 downto 0) := (others => '1');
  -- vsg_on signal_007
  signal left  : unsigned(3 downto 0); -- bits that are still on the way

begin

  assert rates_fit(CLOCK_HZ, BAUD)
    report "uart_transmitter: BAUD above a quarter of CLOCK_HZ, or a rate that is no multiple of 100"
    severity failure;

  p_send : process (clk) is
  begin

    if rising_edge(clk) then
      phase <= ('0' & phase(PHASE_WIDTH - 1 downto 0)) + INCREMENT;
      taken <= '0';

      if (phase(PHASE_WIDTH) = '1') then
        shift <= '1' & shift(FRAME_BITS - 1 downto 1);

        if (left > 1) then
          left <= left - 1;
        elsif (valid = '1') then
          shift <= '1' & data & '0';
          left  <= to_unsigned(FRAME_BITS, 4);
          taken <= '1';
        else
          left <= (others => '0');
        end if;
      end if;

      if (rst = '1') then
        phase <= (others => '0');
        shift <= (others => '1');
        left  <= (others => '0');
        taken <= '0';
      end if;
    end if;

  end process p_send;

  tx <= shift(0);

end architecture rtl;
