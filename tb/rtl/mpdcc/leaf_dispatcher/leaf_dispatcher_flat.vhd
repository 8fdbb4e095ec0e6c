-- leaf_dispatcher with vectors for its records.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;
  use directmpc.second_level_types.all;

entity leaf_dispatcher_flat is
  generic (
    EXPLORERS : positive range 1 to 8 := 2 -- number of explorers
  );
  port (
    clk        : in    std_logic;                                     -- rising edge
    rst        : in    std_logic;                                     -- synchronous, active high
    load       : in    std_logic;                                     -- '1' for one clock: begin with a node
    position   : in    std_logic_vector(8 downto 0);                  -- of visit, a on the right
    effort     : in    std_logic_vector(EFFORT_WIDTH - 1 downto 0);   -- of visit
    index      : in    std_logic_vector(INDEX_WIDTH - 1 downto 0);    -- of visit
    bank       : in    std_logic;                                     -- of visit
    negative   : in    std_logic_vector(2 downto 0);                  -- '1': negative phase current
    ready      : out   std_logic;                                     -- '1': a node may be loaded
    ending     : out   std_logic;                                     -- '1': ready at most 8 clocks later
    active     : out   std_logic;                                     -- '1': leaves come or are about to
    launch     : out   std_logic;                                     -- '1': first leaf of a node
    leaf_valid : out   std_logic_vector(EXPLORERS - 1 downto 0);      -- '1': leaf of this explorer is valid
    leaf       : out   std_logic_vector(21 * EXPLORERS - 1 downto 0)  -- index, bank, effort, position c, b, a each
  );
end entity leaf_dispatcher_flat;

architecture bench of leaf_dispatcher_flat is

  signal visit  : visit_t;
  signal leaves : leaves_t(0 to EXPLORERS - 1);

begin

  g_phases : for x in 0 to 2 generate
    visit.position(x) <= unsigned(position(3 * x + 2 downto 3 * x));
  end generate g_phases;

  visit.effort <= unsigned(effort);
  visit.index  <= unsigned(index);
  visit.bank   <= bank;
  visit.length <= (others => '0');

  i_dispatcher : entity directmpc.leaf_dispatcher
    generic map (
      EXPLORERS => EXPLORERS
    )
    port map (
      clk        => clk,
      rst        => rst,
      load       => load,
      visit      => visit,
      negative   => negative,
      ready      => ready,
      ending     => ending,
      active     => active,
      launch     => launch,
      leaf_valid => leaf_valid,
      leaf       => leaves
    );

  g_leaves : for i in 0 to EXPLORERS - 1 generate
    leaf(21 * i + 20 downto 21 * i) <= std_logic_vector(leaves(i).index) & leaves(i).bank
                                       & std_logic_vector(leaves(i).effort)
                                       & std_logic_vector(leaves(i).position(2))
                                       & std_logic_vector(leaves(i).position(1))
                                       & std_logic_vector(leaves(i).position(0));
  end generate g_leaves;

end architecture bench;
