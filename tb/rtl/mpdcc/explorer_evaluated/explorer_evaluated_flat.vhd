-- explorer_fast with SECOND_LEVEL and with vectors for its records, see mpdcc_flat. Nothing was reached before the
-- node, so that a leaf is costed as a candidate of its position and its effort.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;

library work;
  use work.mpdcc_flat.all;

entity explorer_evaluated_flat is
  port (
    clk             : in    std_logic;                                         -- rising edge
    rst             : in    std_logic;                                         -- synchronous, active high
    limits          : in    std_logic_vector(LIMITS_BITS - 1 downto 0);        -- limits_t
    node            : in    std_logic_vector(NODE_BITS - 1 downto 0);          -- node_t
    band            : in    std_logic_vector(BAND_BITS - 1 downto 0);          -- band_t
    capacitor       : in    std_logic_vector(CAPACITOR_BITS - 1 downto 0);     -- capacitor_t
    last            : in    std_logic;                                         -- '1': no candidate is left
    candidate_valid : in    std_logic;                                         -- '1': candidate is new
    candidate_ready : out   std_logic;                                         -- '1': candidate is taken in this clock
    candidate       : in    std_logic_vector(CANDIDATE_BITS - 1 downto 0);     -- candidate_t
    leaf_valid      : in    std_logic;                                         -- '1': a leaf is evaluated
    leaf_position   : in    std_logic_vector(8 downto 0);                      -- leaf_t.position, phase a on the right
    leaf_effort     : in    std_logic_vector(TOTAL_EFFORT_WIDTH - 1 downto 0); -- leaf_t.effort
    leaf_index      : in    std_logic_vector(INDEX_WIDTH - 1 downto 0);        -- leaf_t.index
    probe_done      : out   std_logic;                                         -- '1' for one clock: answer to a probe
    result_valid    : out   std_logic;                                         -- '1': result is new
    busy            : out   std_logic;                                         -- '1': work is under way
    -- evaluated_t, field by field
    slope_valid     : out   std_logic;                                         -- '1': slopes are new
    slope_index     : out   std_logic_vector(INDEX_WIDTH - 1 downto 0);        -- place of their candidate
    slopes          : out   std_logic_vector(2 * BASE_WIDTH - 1 downto 0);     -- of a and b; a on the right
    unfit           : out   std_logic;                                         -- '1': one of them does not fit
    costed          : out   std_logic;                                         -- '1': a candidate with length > 0
    index           : out   std_logic_vector(INDEX_WIDTH - 1 downto 0);        -- its place
    effort          : out   std_logic_vector(EFFORT_WIDTH - 1 downto 0);       -- f_s
    length          : out   std_logic_vector(LENGTH_WIDTH - 1 downto 0);       -- L*, steps
    cost            : out   std_logic_vector(COST_WIDTH - 1 downto 0);         -- J
    saturated       : out   std_logic                                          -- '1': its weight on v_n saturated
  );
end entity explorer_evaluated_flat;

architecture bench of explorer_evaluated_flat is

  signal leaf      : leaf_t;
  signal evaluated : evaluated_t;

begin

  leaf.position <= to_positions(leaf_position);
  leaf.effort   <= unsigned(leaf_effort);
  leaf.bank     <= '0';
  leaf.index    <= unsigned(leaf_index);

  i_explorer : entity directmpc.explorer_fast
    generic map (
      SECOND_LEVEL => true
    )
    port map (
      clk             => clk,
      rst             => rst,
      limits          => to_limits(limits),
      node            => to_node(node),
      band            => to_band(band),
      capacitor       => to_capacitor(capacitor),
      last            => last,
      candidate_valid => candidate_valid,
      candidate_ready => candidate_ready,
      candidate       => to_candidate(candidate),
      probe_done      => probe_done,
      probe_held      => open,
      result_valid    => result_valid,
      result_ready    => '1',
      result          => open,
      busy            => busy,
      leaf_valid      => leaf_valid,
      leaf            => leaf,
      reached         => REACHED_INIT,
      evaluated       => evaluated
    );

  slope_valid <= evaluated.slope_valid;
  slope_index <= std_logic_vector(evaluated.slope_index);
  slopes      <= std_logic_vector(evaluated.slope(1)) & std_logic_vector(evaluated.slope(0));
  unfit       <= evaluated.unfit;
  costed      <= evaluated.valid;
  index       <= std_logic_vector(evaluated.index);
  effort      <= std_logic_vector(evaluated.effort);
  length      <= std_logic_vector(evaluated.length);
  cost        <= std_logic_vector(evaluated.cost);
  saturated   <= evaluated.saturated;

end architecture bench;
