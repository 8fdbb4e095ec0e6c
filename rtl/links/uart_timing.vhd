-- Bit clock of the UART: a phase accumulator that both directions share the arithmetic of.
--
-- The accumulator has PHASE_WIDTH bits and overflows once a bit: the baud rate need not divide the clock. 3 Mbaud from
-- 25 MHz are 8.33 clocks a bit.
-- Formats: rates in Hz and 1/s, both multiples of 100; the rate is exact to one part in 2**PHASE_WIDTH of the clock.
-- Licence: Apache-2.0

package uart_timing is

  constant PHASE_WIDTH : natural := 16;
  constant FRAME_BITS  : natural := 10; -- start, data, stop

  -- what the accumulator grows by a clock: 2 ** PHASE_WIDTH * baud / clock_hz, rounded
  function phase_increment (clock_hz, baud : positive) return natural;

  -- whether the rates can be served: baud at most a quarter of the clock, both multiples of 100
  function rates_fit (clock_hz, baud : positive) return boolean;

end package uart_timing;

package body uart_timing is

  function phase_increment (clock_hz, baud : positive) return natural is

    -- in two steps, since an integer has 31 bits
    constant RATE    : natural := baud / 100 * 2 ** 10;
    constant DIVISOR : natural := clock_hz / 100;

  begin

    return RATE / DIVISOR * 2 ** 6 + (RATE mod DIVISOR * 2 ** 6 + DIVISOR / 2) / DIVISOR;

  end function phase_increment;

  function rates_fit (clock_hz, baud : positive) return boolean is
  begin

    return baud <= clock_hz / 4 and clock_hz mod 100 = 0 and baud mod 100 = 0;

  end function rates_fit;

end package body uart_timing;
