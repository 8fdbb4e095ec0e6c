-- Stand-in for the clock of a part: the core's clock is the input, locked and the oscillator come from a bench.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity board_clock is
  generic (
    CORE_MHZ : positive -- MHz of the core's clock
  );
  port (
    clock      : in    std_logic; -- rising edge
    core_clock : out   std_logic; -- rising edge
    locked     : out   std_logic; -- '1': core_clock is as it should be
    oscillator : out   std_logic  -- rising edge
  );
end entity board_clock;

architecture bench of board_clock is

  signal lock_given       : std_logic := '0'; -- by a bench
  signal oscillator_given : std_logic := '0'; -- by a bench

begin

  core_clock <= clock;
  locked     <= lock_given;
  oscillator <= oscillator_given;

end architecture bench;
