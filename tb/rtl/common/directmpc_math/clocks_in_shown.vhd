-- Shows clocks_in of directmpc_math.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_math.all;

entity clocks_in_shown is
  generic (
    NANOSECONDS : positive := 400;        -- time
    HERTZ       : positive := 25_000_000  -- frequency of the clock, Hz
  );
  port (
    clocks : out   std_logic_vector(30 downto 0) -- unsigned
  );
end entity clocks_in_shown;

architecture rtl of clocks_in_shown is

begin

  clocks <= std_logic_vector(to_unsigned(clocks_in(NANOSECONDS, HERTZ), 31));

end architecture rtl;
