-- node_preparation with its records as vectors, see mpdcc_flat.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.anpc5l_leg.all;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;
  use directmpc.second_level_types.all;

library work;
  use work.mpdcc_flat.all;

entity node_preparation_flat is
  generic (
    INWARDS : boolean := false -- true: the rule inwards besides
  );
  port (
    clk         : in    std_logic;                                           -- rising edge
    rst         : in    std_logic;                                           -- synchronous, active high
    capacitors  : in    std_logic;                                           -- '1' for one clock: find the rows
    successor   : in    std_logic;                                           -- with it: those of a successor
    bank        : in    std_logic;                                           -- with it: which table
    turn        : in    std_logic;                                           -- '1' for one clock: find thresholds
    show_turn   : in    std_logic;                                           -- '1': they become those of band
    limits      : in    std_logic_vector(LIMITS_BITS - 1 downto 0);          -- limits_t
    node        : in    std_logic_vector(NODE_BITS - 1 downto 0);            -- node_t
    previous    : in    std_logic_vector(8 downto 0);                        -- s(k-1), a on the right
    negative    : in    std_logic_vector(2 downto 0);                        -- '1': negative phase current
    error_ahead : in    std_logic_vector(3 * TRAJECTORY_WIDTH - 1 downto 0); -- of the thresholds, a on the right
    band        : out   std_logic_vector(BAND_BITS - 1 downto 0);            -- band_t
    row_write   : out   std_logic;                                           -- of capacitor, '1': a row is new
    row_bank    : out   std_logic                                            -- likewise, its table
  );
end entity node_preparation_flat;

architecture bench of node_preparation_flat is

  signal preparation : preparation_t;
  signal positions   : positions_t;
  signal ahead       : trajectories_t;
  signal band_record : band_t;
  signal row         : capacitor_t;

begin

  preparation.capacitors <= capacitors;
  preparation.successor  <= successor;
  preparation.bank       <= bank;
  preparation.turn       <= turn;
  preparation.show_turn  <= show_turn;

  g_phases : for x in 0 to 2 generate
    positions(x) <= unsigned(previous(3 * x + 2 downto 3 * x));
    ahead(x)     <= signed(error_ahead((x + 1) * TRAJECTORY_WIDTH - 1 downto x * TRAJECTORY_WIDTH));
  end generate g_phases;

  i_preparation : entity directmpc.node_preparation
    generic map (
      SECOND_LEVEL => true,
      INWARDS      => INWARDS
    )
    port map (
      clk         => clk,
      rst         => rst,
      preparation => preparation,
      limits      => to_limits(limits),
      node        => to_node(node),
      previous    => positions,
      negative    => negative,
      error_ahead => ahead,
      band        => band_record,
      capacitor   => row,
      ready       => open,
      held        => open
    );

  band      <= to_vector(band_record);
  row_write <= row.write;
  row_bank  <= row.bank;

end architecture bench;
