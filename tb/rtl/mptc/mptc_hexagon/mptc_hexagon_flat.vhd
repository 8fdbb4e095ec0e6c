-- mptc_hexagon with vectors for its records and its signed ports.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.mptc_constants.all;
  use directmpc.mptc_types.all;

entity mptc_hexagon_flat is
  port (
    clk             : in    std_logic;                                 -- rising edge
    rst             : in    std_logic;                                 -- synchronous, active high
    method          : in    std_logic_vector(2 downto 0);              -- family_t
    running_u1      : in    std_logic_vector(2 downto 0);              -- of running, number of a vector
    running_u2      : in    std_logic_vector(2 downto 0);              -- likewise
    running_u3      : in    std_logic_vector(2 downto 0);              -- likewise
    running_t1      : in    std_logic_vector(TIME_WIDTH downto 0);     -- of running, 1/4096 of the period, unsigned
    running_t2      : in    std_logic_vector(TIME_WIDTH downto 0);     -- likewise
    way_alpha       : in    std_logic;                                 -- '1': sum is the way of u_1 along alpha
    way_beta        : in    std_logic;                                 -- '1': sum is the way of u_2 along beta
    sum             : in    std_logic_vector(SUM_WIDTH - 1 downto 0);  -- accumulator, signed
    rest            : in    std_logic;                                 -- '1': -e is in the following two
    sum_alpha       : in    std_logic_vector(SUM_WIDTH - 1 downto 0);  -- likewise; later the square of a distance
    sum_beta        : in    std_logic_vector(SUM_WIDTH - 1 downto 0);  -- likewise
    last            : in    std_logic;                                 -- '1': the last choice has been compared
    residues_along  : out   std_logic_vector(WORD_WIDTH - 1 downto 0); -- of residues, signed
    residues_beside : out   std_logic_vector(WORD_WIDTH - 1 downto 0); -- likewise
    residues_total  : out   std_logic_vector(WORD_WIDTH - 1 downto 0); -- likewise
    u1              : out   std_logic_vector(2 downto 0);              -- of chosen, number of a vector
    u2              : out   std_logic_vector(2 downto 0);              -- likewise
    u3              : out   std_logic_vector(2 downto 0);              -- likewise
    t1              : out   std_logic_vector(TIME_WIDTH downto 0);     -- of chosen, 1/4096 of the period, unsigned
    t2              : out   std_logic_vector(TIME_WIDTH downto 0);     -- likewise
    far             : out   std_logic                                  -- '1': e was halved
  );
end entity mptc_hexagon_flat;

architecture bench of mptc_hexagon_flat is

  signal running  : mptc_sequence_t;
  signal residues : mptc_residues_t;
  signal chosen   : mptc_sequence_t;

begin

  running.u1 <= running_u1;
  running.u2 <= running_u2;
  running.u3 <= running_u3;
  running.t1 <= running_t1;
  running.t2 <= running_t2;

  i_hexagon : entity directmpc.mptc_hexagon
    port map (
      clk       => clk,
      rst       => rst,
      method    => method,
      running   => running,
      way_alpha => way_alpha,
      way_beta  => way_beta,
      sum       => signed(sum),
      rest      => rest,
      sum_alpha => signed(sum_alpha),
      sum_beta  => signed(sum_beta),
      last      => last,
      residues  => residues,
      chosen    => chosen,
      far       => far
    );

  residues_along  <= residues.along;
  residues_beside <= residues.beside;
  residues_total  <= residues.total;

  u1 <= chosen.u1;
  u2 <= chosen.u2;
  u3 <= chosen.u3;
  t1 <= chosen.t1;
  t2 <= chosen.t2;

end architecture bench;
