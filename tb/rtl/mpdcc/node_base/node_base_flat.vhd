-- node_base with vectors for its arrays.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.anpc5l_leg.all;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;
  use directmpc.second_level_types.all;

entity node_base_flat is
  port (
    clk         : in    std_logic;                                                        -- rising edge
    keep        : in    std_logic;                                                        -- '1': take the node
    words       : in    std_logic_vector(RESULT_COUNT * TERM_WIDTH - 1 downto 0);         -- RESULT_* order
    position    : in    std_logic_vector(8 downto 0);                                     -- s1, a on the right
    steps       : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0);                      -- L1
    slope       : in    std_logic_vector(2 * BASE_WIDTH - 1 downto 0);                    -- of a and b, a on the right
    base        : out   std_logic_vector(BASE_COUNT * OPERAND_WIDTH - 1 downto 0);        -- operands A, BASE order
    lengths     : out   std_logic_vector(SIGNED_LENGTHS * (LENGTH_WIDTH + 1) - 1 downto 0); -- L1 and with signs
    slope_ahead : out   std_logic_vector(2 * TERM_WIDTH - 1 downto 0);                    -- alpha on the right
    unfit       : out   std_logic                                                         -- '1': an error does not fit
  );
end entity node_base_flat;

architecture bench of node_base_flat is

  signal positions : positions_t;
  signal slopes    : start_slopes_t;
  signal ahead     : plane_t;

begin

  g_positions : for x in 0 to 2 generate
    positions(x) <= unsigned(position(3 * x + 2 downto 3 * x));
  end generate g_positions;

  slopes(0) <= signed(slope(BASE_WIDTH - 1 downto 0));
  slopes(1) <= signed(slope(2 * BASE_WIDTH - 1 downto BASE_WIDTH));

  i_base : entity directmpc.node_base
    port map (
      clk         => clk,
      keep        => keep,
      words       => words,
      position    => positions,
      steps       => unsigned(steps),
      slope       => slopes,
      base        => base,
      lengths     => lengths,
      slope_ahead => ahead,
      unfit       => unfit
    );

  slope_ahead <= std_logic_vector(ahead(1)) & std_logic_vector(ahead(0));

end architecture bench;
