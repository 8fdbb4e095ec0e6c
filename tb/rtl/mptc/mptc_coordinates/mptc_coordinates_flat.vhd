-- mptc_coordinates with vectors for its record, its counter and its signed ports.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.mptc_constants.all;
  use directmpc.mptc_types.all;

entity mptc_coordinates_flat is
  port (
    clk       : in    std_logic;                                    -- rising edge
    way_alpha : in    std_logic;                                    -- '1': sum is the way of u_1 along alpha
    way_beta  : in    std_logic;                                    -- '1': sum is the way of u_2 along beta
    sum       : in    std_logic_vector(SUM_WIDTH - 1 downto 0);     -- accumulator, signed
    rest      : in    std_logic;                                    -- '1': -e is in the following two
    sum_alpha : in    std_logic_vector(SUM_WIDTH - 1 downto 0);     -- accumulator, signed
    sum_beta  : in    std_logic_vector(SUM_WIDTH - 1 downto 0);     -- likewise
    clock     : in    std_logic_vector(5 downto 0);                 -- clocks since rest, unsigned; 0: none is counted
    method    : in    std_logic_vector(2 downto 0);                 -- family_t
    base      : in    std_logic_vector(2 downto 0);                 -- vector to turn to, unsigned
    leader    : out   std_logic_vector(2 downto 0);                 -- vector that stands where u_1 does, unsigned
    g         : out   std_logic_vector(HEXAGON_WIDTH - 1 downto 0); -- of missing, signed, HEXAGON_FRACTION
    h         : out   std_logic_vector(HEXAGON_WIDTH - 1 downto 0); -- likewise
    total     : out   std_logic_vector(HEXAGON_WIDTH - 1 downto 0); -- likewise
    share     : out   std_logic_vector(TIME_WIDTH - 1 downto 0);    -- 1/4096 of the period, unsigned
    far       : out   std_logic                                     -- '1': e was halved
  );
end entity mptc_coordinates_flat;

architecture bench of mptc_coordinates_flat is

  signal counted : natural range 0 to HEXAGON_CLOCKS;
  signal missing : mptc_missing_t;

begin

  counted <= to_integer(unsigned(clock));

  i_coordinates : entity directmpc.mptc_coordinates
    port map (
      clk       => clk,
      way_alpha => way_alpha,
      way_beta  => way_beta,
      sum       => signed(sum),
      rest      => rest,
      sum_alpha => signed(sum_alpha),
      sum_beta  => signed(sum_beta),
      clock     => counted,
      method    => method,
      base      => base,
      leader    => leader,
      missing   => missing,
      share     => share,
      far       => far
    );

  g     <= std_logic_vector(missing.g);
  h     <= std_logic_vector(missing.h);
  total <= std_logic_vector(missing.total);

end architecture bench;
