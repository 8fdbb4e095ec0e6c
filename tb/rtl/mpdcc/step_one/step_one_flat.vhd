-- step_one with vectors for its records; what belongs to one candidate comes in one clock.
--
-- A delay brings each word to the stage in which step_one reads it. A probe leaves the stages behind its answer, as
-- explorer_fast has it.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.directmpc_math.all;
  use directmpc.explorer_types.all;
  use directmpc.mpdcc_timing.all;
  use directmpc.mpdcc_types.all;

entity step_one_flat is
  generic (
    SECOND_LEVEL      : boolean := false; -- true: two tables
    WEIGHTED_DEADLOCK : boolean := false; -- true: the weighted deadlock rule besides
    INWARDS           : boolean := false  -- true: the rule inwards besides
  );
  port (
    clk        : in    std_logic;                                           -- rising edge
    bound      : in    std_logic_vector(BOUND_WIDTH - 1 downto 0);          -- limits_t.bound_current, traj. units
    horizon    : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0);         -- limits_t.horizon, steps
    rule       : in    std_logic;                                           -- limits_t.deadlock_rule, '1': weighted
    write      : in    std_logic;                                           -- capacitor_t.write, '1': a row is new
    row        : in    std_logic_vector(4 downto 0);                        -- capacitor_t.row, unsigned
    row_length : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0);         -- capacitor_t.length, steps
    row_excess : in    std_logic_vector(TRAJECTORY_WIDTH - 1 downto 0);     -- capacitor_t.excess, trajectory units
    row_bank   : in    std_logic;                                           -- capacitor_t.bank, which table
    row_inside : in    std_logic;                                           -- capacitor_t.inside, '1': inside at k
    valid      : in    std_logic;                                           -- '1': a candidate, stage SLOPE_STAGE
    probe      : in    std_logic;                                           -- '1': it only asks for held
    outside    : in    std_logic_vector(2 downto 0);                        -- band_t.outside, of its node
    errors     : in    std_logic_vector(2 * TRAJECTORY_WIDTH - 1 downto 0); -- of a and b at k+1; a on the right
    bank       : in    std_logic;                                           -- connection_t.bank, which table
    pattern    : in    std_logic_vector(2 downto 0);                        -- connection_t.pattern, a on the right
    kinds      : in    std_logic_vector(5 downto 0);                        -- connection_t.kind, a on the right
    gone       : in    std_logic;                                           -- '1': a current is dead, rule inwards
    index      : in    std_logic_vector(INDEX_WIDTH - 1 downto 0);          -- its place
    held       : out   std_logic;                                           -- as of step_one
    allowed    : out   std_logic_vector(LENGTH_WIDTH - 1 downto 0);         -- steps; 0: a current is outside
    dead_valid : out   std_logic;                                           -- dead_t.valid, '1': a candidate
    dead_rank  : out   std_logic_vector(RANK_WIDTH - 1 downto 0);           -- dead_t.rank, unsigned
    dead_index : out   std_logic_vector(INDEX_WIDTH - 1 downto 0)           -- dead_t.index, its place
  );
end entity step_one_flat;

architecture bench of step_one_flat is

  constant DEAD_AT : natural := DEAD_STAGE + choose(SECOND_LEVEL, 1, 0); -- stage in which index is read

  type indices_t is array (SLOPE_STAGE to DEAD_AT) of index_t;

  type connections_t is array (SLOPE_STAGE to SEARCH) of connection_t;

  signal stages     : stages_t := (others => '0');
  signal probes     : std_logic_vector(SLOPE_STAGE to PROBE_STAGE);
  signal outside_c  : std_logic; -- of the third current, stage ERROR_STAGE
  signal error      : pair_t;
  signal connected  : connections_t;
  signal gones      : std_logic_vector(SLOPE_STAGE to PROBE_STAGE);
  signal indices    : indices_t;
  signal limits     : limits_t;
  signal band       : band_t;
  signal capacitor  : capacitor_t;
  signal found      : length_t;
  signal candidates : dead_t;

begin

  limits.bound_current   <= unsigned(bound);
  limits.bound_neutral   <= (others => '0');
  limits.bound_phase     <= (others => '0');
  limits.horizon         <= unsigned(horizon);
  limits.weight_scale    <= (others => '0');
  limits.deadlock_rule   <= rule;
  limits.outside_inwards <= '0';

  capacitor.write     <= write;
  capacitor.row       <= unsigned(row);
  capacitor.length    <= unsigned(row_length);
  capacitor.excess    <= signed(row_excess);
  capacitor.bank      <= row_bank;
  capacitor.is_inside <= row_inside;

  stages(SLOPE_STAGE)    <= valid;
  probes(SLOPE_STAGE)    <= probe;
  gones(SLOPE_STAGE)     <= gone;
  indices(SLOPE_STAGE)   <= index;
  connected(SLOPE_STAGE) <= to_connection(bank & pattern & kinds);

  band.outside <= outside_c & outside(1 downto 0);

  p_stages : process (clk) is
  begin

    if rising_edge(clk) then
      stages(ERROR_STAGE to COST_STAGE)  <= stages(SLOPE_STAGE to COST_STAGE - 1);
      stages(PROBE_STAGE + 1)            <= stages(PROBE_STAGE) and not probes(PROBE_STAGE);
      probes(ERROR_STAGE to PROBE_STAGE) <= probes(SLOPE_STAGE to PROBE_STAGE - 1);
      gones(ERROR_STAGE to PROBE_STAGE)  <= gones(SLOPE_STAGE to PROBE_STAGE - 1);
      indices(ERROR_STAGE to DEAD_AT)    <= indices(SLOPE_STAGE to DEAD_AT - 1);
      connected(ERROR_STAGE to SEARCH)   <= connected(SLOPE_STAGE to SEARCH - 1);
      outside_c                          <= outside(2);
      error(0)                           <= signed(errors(TRAJECTORY_WIDTH - 1 downto 0));
      error(1)                           <= signed(errors(2 * TRAJECTORY_WIDTH - 1 downto TRAJECTORY_WIDTH));
    end if;

  end process p_stages;

  i_step : entity directmpc.step_one
    generic map (
      SECOND_LEVEL      => SECOND_LEVEL,
      WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK,
      INWARDS           => INWARDS
    )
    port map (
      clk       => clk,
      limits    => limits,
      band      => band,
      capacitor => capacitor,
      valid     => stages,
      error     => error,
      connected => connected(SEARCH),
      gone      => gones(PROBE_STAGE),
      index     => indices(DEAD_AT),
      held      => held,
      allowed   => found,
      dead      => candidates
    );

  allowed    <= std_logic_vector(found);
  dead_valid <= candidates.valid;
  dead_rank  <= std_logic_vector(candidates.rank);
  dead_index <= candidates.index;

end architecture bench;
