-- Model predictive direct current control with records as ports; mpdcc_core is the same with flat ports
-- and explains what it decides.
--
-- One scheduler and EXPLORERS explorers of the variant that FOLDED chooses.
-- Formats, latency, overflow: as in mpdcc_core.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library work;
  use work.anpc5l_leg.all;
  use work.directmpc_constants.all;
  use work.mpdcc_types.all;

entity mpdcc_controller is
  generic (
    EXPLORERS         : positive range 1 to 8 := 2;     -- number of explorers
    FOLDED            : boolean               := false; -- true: the paper's explorer, false: the fast one
    SECOND_LEVEL      : boolean               := false; -- true: SESE and delay compensation, fast explorer alone
    WEIGHTED_DEADLOCK : boolean               := false  -- true: the weighted deadlock rule, fast explorer alone
  );
  port (
    clk          : in    std_logic;      -- rising edge
    rst          : in    std_logic;      -- synchronous, active high
    start        : in    std_logic;      -- '1' for one clock: decide; ignored while busy
    measurement  : in    measurement_t;  -- sampled with start
    previous     : in    positions_t;    -- s(k-1), sampled with start
    coefficients : in    coefficients_t; -- signed, FACTOR_* order, stable from start to valid
    limits       : in    limits_t;       -- bounds and horizon, stable from start to valid
    options      : in    options_t;      -- of SECOND_LEVEL, stable from start to valid
    valid        : out   std_logic;      -- '1' for one clock: decision is new
    busy         : out   std_logic;      -- '1': a decision is under way
    decision     : out   decision_t      -- stable until the next valid
  );
end entity mpdcc_controller;

architecture rtl of mpdcc_controller is

  signal factors         : std_logic_vector(COEFFICIENT_COUNT * COEFFICIENT_WIDTH - 1 downto 0);
  signal node            : node_t;
  signal band            : band_t;
  signal capacitor       : capacitor_t;
  signal last            : std_logic;
  signal best_valid      : std_logic;
  signal best_cost       : cost_t;
  signal candidate       : candidate_t;
  signal candidate_valid : std_logic_vector(EXPLORERS - 1 downto 0);
  signal candidate_ready : std_logic_vector(EXPLORERS - 1 downto 0);
  signal probe_done      : std_logic_vector(EXPLORERS - 1 downto 0);
  signal probe_held      : std_logic_vector(EXPLORERS - 1 downto 0);
  signal result_valid    : std_logic_vector(EXPLORERS - 1 downto 0);
  signal result_ready    : std_logic_vector(EXPLORERS - 1 downto 0);
  signal results         : results_t(0 to EXPLORERS - 1);
  signal explorer_busy   : std_logic_vector(EXPLORERS - 1 downto 0);
  signal evaluated       : evaluated_array_t(0 to EXPLORERS - 1);
  signal leaf_valid      : std_logic_vector(EXPLORERS - 1 downto 0);
  signal leaf            : leaves_t(0 to EXPLORERS - 1);
  signal reached         : reached_t;

begin

  assert not (FOLDED and SECOND_LEVEL)
    report "mpdcc_controller: SECOND_LEVEL needs the fast explorer, FOLDED = false"
    severity failure;

  assert not (FOLDED and WEIGHTED_DEADLOCK)
    report "mpdcc_controller: WEIGHTED_DEADLOCK needs the fast explorer, FOLDED = false"
    severity failure;

  g_factors : for i in 0 to COEFFICIENT_COUNT - 1 generate
    factors((i + 1) * COEFFICIENT_WIDTH - 1 downto i * COEFFICIENT_WIDTH) <= coefficients(i);
  end generate g_factors;

  i_scheduler : entity work.mpdcc_scheduler
    generic map (
      EXPLORERS    => EXPLORERS,
      FOLDED       => FOLDED,
      SECOND_LEVEL => SECOND_LEVEL
    )
    port map (
      clk             => clk,
      rst             => rst,
      start           => start,
      measurement     => measurement,
      previous        => previous,
      limits          => limits,
      coefficients    => factors,
      valid           => valid,
      decision        => decision,
      busy            => busy,
      node            => node,
      band            => band,
      capacitor       => capacitor,
      last            => last,
      best_valid      => best_valid,
      best_cost       => best_cost,
      candidate_valid => candidate_valid,
      candidate_ready => candidate_ready,
      candidate       => candidate,
      probe_done      => probe_done(0),
      probe_held      => probe_held(0),
      result_valid    => result_valid,
      result_ready    => result_ready,
      results         => results,
      explorer_busy   => explorer_busy,
      two_switchings  => options.two_switchings,
      budget          => options.budget,
      compensate      => options.compensate,
      evaluated       => evaluated(0),
      leaf_valid      => leaf_valid,
      leaf            => leaf,
      reached         => reached
    );

  g_explorers : for i in 0 to EXPLORERS - 1 generate

    i_explorer : entity work.mpdcc_explorer
      generic map (
        FOLDED            => FOLDED,
        SECOND_LEVEL      => SECOND_LEVEL,
        WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK
      )
      port map (
        clk             => clk,
        rst             => rst,
        limits          => limits,
        node            => node,
        band            => band,
        capacitor       => capacitor,
        last            => last,
        best_valid      => best_valid,
        best_cost       => best_cost,
        candidate_valid => candidate_valid(i),
        candidate_ready => candidate_ready(i),
        candidate       => candidate,
        probe_done      => probe_done(i),
        probe_held      => probe_held(i),
        result_valid    => result_valid(i),
        result_ready    => result_ready(i),
        result          => results(i),
        busy            => explorer_busy(i),
        leaf_valid      => leaf_valid(i),
        leaf            => leaf(i),
        reached         => reached,
        evaluated       => evaluated(i)
      );

  end generate g_explorers;

end architecture rtl;
