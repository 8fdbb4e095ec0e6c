-- turn_threshold with vectors for its signed and unsigned ports.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;

entity turn_threshold_flat is
  generic (
    INWARDS : boolean := false -- true: for errors outside the band too
  );
  port (
    clk         : in    std_logic;                                      -- rising edge
    start       : in    std_logic;                                      -- '1' for one clock: take margin and curvature
    margin_up   : in    std_logic_vector(MARGIN_WIDTH downto 0);        -- margin_t
    margin_down : in    std_logic_vector(MARGIN_WIDTH downto 0);        -- margin_t
    curvature   : in    std_logic_vector(CURVATURE_WIDTH - 1 downto 0); -- curvature_t
    threshold   : out   std_logic_vector(TURN_WIDTH - 2 downto 0)       -- unsigned
  );
end entity turn_threshold_flat;

architecture bench of turn_threshold_flat is

  signal threshold_word : unsigned(TURN_WIDTH - 2 downto 0);

begin

  i_threshold : entity directmpc.turn_threshold
    generic map (
      INWARDS => INWARDS
    )
    port map (
      clk         => clk,
      start       => start,
      margin_up   => signed(margin_up),
      margin_down => signed(margin_down),
      curvature   => signed(curvature),
      threshold   => threshold_word
    );

  threshold <= std_logic_vector(threshold_word);

end architecture bench;
