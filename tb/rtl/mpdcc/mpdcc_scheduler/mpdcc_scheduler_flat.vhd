-- mpdcc_scheduler with its records as vectors, see mpdcc_flat.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;

library work;
  use work.mpdcc_flat.all;

entity mpdcc_scheduler_flat is
  generic (
    EXPLORERS : positive range 1 to 8 := 2;   -- number of explorers
    FOLDED    : boolean               := true -- variant of the explorers
  );
  port (
    clk             : in    std_logic;                                                            -- rising edge
    rst             : in    std_logic; -- synchronous, active high
    start           : in    std_logic; -- '1' for one clock: decide
    measurement     : in    std_logic_vector(207 downto 0);                                       -- is_alpha rightmost
    previous        : in    std_logic_vector(8 downto 0); -- s(k-1), phase a rightmost
    limits          : in    std_logic_vector(LIMITS_BITS - 1 downto 0);                           -- limits_t
    coefficients    : in    std_logic_vector(COEFFICIENT_COUNT * COEFFICIENT_WIDTH - 1 downto 0); -- FACTOR_* order
    valid           : out   std_logic; -- '1' for one clock: decision is new
    decision        : out   std_logic_vector(DECISION_BITS - 1 downto 0);                         -- decision_t
    busy            : out   std_logic; -- '1': a decision is under way
    node            : out   std_logic_vector(NODE_BITS - 1 downto 0);                             -- node_t
    band            : out   std_logic_vector(BAND_BITS - 1 downto 0);                             -- band_t
    capacitor       : out   std_logic_vector(CAPACITOR_BITS - 1 downto 0);                        -- capacitor_t
    last            : out   std_logic; -- '1': no candidate is left
    best_valid      : out   std_logic; -- '1': J_dl is not needed any more
    best_cost       : out   std_logic_vector(COST_WIDTH - 1 downto 0);                            -- best cost so far
    candidate_valid : out   std_logic_vector(EXPLORERS - 1 downto 0);                             -- one-hot
    candidate_ready : in    std_logic_vector(EXPLORERS - 1 downto 0); -- '1': explorer is free
    candidate       : out   std_logic_vector(CANDIDATE_BITS - 1 downto 0);                        -- candidate_t
    probe_done      : in    std_logic; -- answer to the probe
    probe_held      : in    std_logic; -- '1': step one stays inside
    result_valid    : in    std_logic_vector(EXPLORERS - 1 downto 0); -- '1': explorer has a result
    result_ready    : out   std_logic_vector(EXPLORERS - 1 downto 0);                             -- one-hot
    results         : in    std_logic_vector(EXPLORERS * RESULT_BITS - 1 downto 0); -- result_t, 0 rightmost
    explorer_busy   : in    std_logic_vector(EXPLORERS - 1 downto 0) -- '1': work is under way
  );
end entity mpdcc_scheduler_flat;

architecture bench of mpdcc_scheduler_flat is

  signal node_record      : node_t;
  signal band_record      : band_t;
  signal capacitor_record : capacitor_t;
  signal candidate_record : candidate_t;
  signal decision_record  : decision_t;
  signal result_records   : results_t(0 to EXPLORERS - 1);
  signal cost             : cost_t;

begin

  i_scheduler : entity directmpc.mpdcc_scheduler
    generic map (
      EXPLORERS => EXPLORERS,
      FOLDED    => FOLDED
    )
    port map (
      clk             => clk,
      rst             => rst,
      start           => start,
      measurement     => to_measurement(measurement),
      previous        => to_positions(previous),
      limits          => to_limits(limits),
      coefficients    => coefficients,
      valid           => valid,
      decision        => decision_record,
      busy            => busy,
      node            => node_record,
      band            => band_record,
      capacitor       => capacitor_record,
      last            => last,
      best_valid      => best_valid,
      best_cost       => cost,
      candidate_valid => candidate_valid,
      candidate_ready => candidate_ready,
      candidate       => candidate_record,
      probe_done      => probe_done,
      probe_held      => probe_held,
      result_valid    => result_valid,
      result_ready    => result_ready,
      results         => result_records,
      explorer_busy   => explorer_busy,
      two_switchings  => '0',
      budget          => (others => '0'),
      compensate      => '0',
      evaluated       => EVALUATED_INIT,
      leaf_valid      => open,
      leaf            => open,
      reached         => open
    );

  g_results : for i in 0 to EXPLORERS - 1 generate
    result_records(i) <= to_result(results((i + 1) * RESULT_BITS - 1 downto i * RESULT_BITS));
  end generate g_results;

  node      <= to_vector(node_record);
  band      <= to_vector(band_record);
  capacitor <= to_vector(capacitor_record);
  candidate <= to_vector(candidate_record);
  decision  <= to_vector(decision_record);
  best_cost <= std_logic_vector(cost);

end architecture bench;
