-- node_queue with vectors for its records.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.anpc5l_leg.all;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;
  use directmpc.second_level_types.all;

entity node_queue_flat is
  port (
    clk            : in    std_logic;                                     -- rising edge
    rst            : in    std_logic;                                     -- synchronous, active high
    clear          : in    std_logic;                                     -- '1': empty the queue
    open_root      : in    std_logic;                                     -- '1': candidates are evaluated
    slope_valid    : in    std_logic;                                     -- of evaluated, as the following
    slope_index    : in    std_logic_vector(INDEX_WIDTH - 1 downto 0);    -- place
    slope          : in    std_logic_vector(2 * BASE_WIDTH - 1 downto 0); -- of a and b, a on the right
    evaluated      : in    std_logic;                                     -- '1': valid
    index          : in    std_logic_vector(INDEX_WIDTH - 1 downto 0);    -- place
    effort         : in    std_logic_vector(EFFORT_WIDTH - 1 downto 0);   -- f_s
    length         : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0);   -- L1, steps
    horizon        : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0);   -- N, steps
    previous       : in    std_logic_vector(8 downto 0);                  -- s(k-1), a on the right
    taken          : in    std_logic;                                     -- '1': entry is taken
    whole          : out   std_logic;                                     -- '1': the whole horizon
    valid          : out   std_logic;                                     -- '1': entry is the next
    empty          : out   std_logic;                                     -- '1': no entry is left
    entry_index    : out   std_logic_vector(INDEX_WIDTH - 1 downto 0);    -- of entry, as the following
    entry_position : out   std_logic_vector(8 downto 0);                  -- a on the right
    entry_effort   : out   std_logic_vector(EFFORT_WIDTH - 1 downto 0);   -- f_s
    entry_length   : out   std_logic_vector(LENGTH_WIDTH - 1 downto 0);   -- L1, steps
    entry_slope    : out   std_logic_vector(2 * BASE_WIDTH - 1 downto 0)  -- of a and b, a on the right
  );
end entity node_queue_flat;

architecture bench of node_queue_flat is

  signal candidate : evaluated_t;
  signal positions : positions_t;
  signal entry     : entry_t;

begin

  candidate.slope_valid <= slope_valid;
  candidate.slope_index <= unsigned(slope_index);
  candidate.slope(0)    <= signed(slope(BASE_WIDTH - 1 downto 0));
  candidate.slope(1)    <= signed(slope(2 * BASE_WIDTH - 1 downto BASE_WIDTH));
  candidate.unfit       <= '0';
  candidate.valid       <= evaluated;
  candidate.index       <= unsigned(index);
  candidate.effort      <= unsigned(effort);
  candidate.length      <= unsigned(length);
  candidate.cost        <= (others => '0');
  candidate.saturated   <= '0';

  g_phases : for x in 0 to 2 generate
    positions(x)                            <= unsigned(previous(3 * x + 2 downto 3 * x));
    entry_position(3 * x + 2 downto 3 * x) <= std_logic_vector(entry.position(x));
  end generate g_phases;

  i_queue : entity directmpc.node_queue
    port map (
      clk       => clk,
      rst       => rst,
      clear     => clear,
      open_root => open_root,
      evaluated => candidate,
      horizon   => unsigned(horizon),
      previous  => positions,
      whole     => whole,
      valid     => valid,
      entry     => entry,
      taken     => taken,
      empty     => empty
    );

  entry_index  <= std_logic_vector(entry.index);
  entry_effort <= std_logic_vector(entry.effort);
  entry_length <= std_logic_vector(entry.length);
  entry_slope  <= std_logic_vector(entry.slope(1)) & std_logic_vector(entry.slope(0));

end architecture bench;
