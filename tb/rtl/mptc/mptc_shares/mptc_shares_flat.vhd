-- mptc_shares and mptc_mean_share side by side, with vectors for their records.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library directmpc;
  use directmpc.mptc_constants.all;
  use directmpc.mptc_types.all;

entity mptc_shares_flat is
  port (
    clk        : in    std_logic;                                 -- rising edge
    begin_mean : in    std_logic;                                 -- '1': running is what is being applied
    vectors    : in    std_logic_vector(8 downto 0);              -- u1, u2, u3 of it; u1 on the right
    t1         : in    std_logic_vector(TIME_WIDTH downto 0);     -- unsigned, 1/4096 of the period
    t2         : in    std_logic_vector(TIME_WIDTH downto 0);     -- likewise
    take       : in    std_logic;                                 -- '1': a pair with its duty
    duty       : in    std_logic_vector(TIME_WIDTH - 1 downto 0); -- unsigned, 1/4096 of the period
    second     : in    std_logic_vector(2 downto 0);              -- second vector
    direction  : in    std_logic_vector(2 downto 0);              -- first less second
    alpha      : out   std_logic_vector(WORD_WIDTH - 1 downto 0); -- of mptc_shares, signed
    beta       : out   std_logic_vector(WORD_WIDTH - 1 downto 0); -- likewise
    mean_alpha : out   std_logic_vector(WORD_WIDTH - 1 downto 0); -- of mptc_mean_share, signed
    mean_beta  : out   std_logic_vector(WORD_WIDTH - 1 downto 0)  -- likewise
  );
end entity mptc_shares_flat;

architecture bench of mptc_shares_flat is

  signal running : mptc_sequence_t;
  signal found   : mptc_duty_t;

begin

  running.u1 <= vectors(2 downto 0);
  running.u2 <= vectors(5 downto 3);
  running.u3 <= vectors(8 downto 6);
  running.t1 <= t1;
  running.t2 <= t2;

  found.take      <= take;
  found.duty      <= duty;
  found.second    <= second;
  found.direction <= direction;

  i_shares : entity directmpc.mptc_shares
    port map (
      clk        => clk,
      begin_mean => begin_mean,
      running    => running,
      found      => found,
      alpha      => alpha,
      beta       => beta
    );

  i_mean : entity directmpc.mptc_mean_share
    port map (
      clk     => clk,
      running => running,
      alpha   => mean_alpha,
      beta    => mean_beta
    );

end architecture bench;
