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
    FOLDED    : boolean               := true; -- variant of the explorers
    INWARDS   : boolean               := false -- true: the rule inwards besides
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

  -- one level alone
  constant OPTIONS : options_t := (
    two_switchings => '0',
    budget         => (others => '0'),
    compensate     => '0'
  );

  signal decision_record : decision_t;
  signal broadcast       : broadcast_t;
  signal assignments     : assignments_t(0 to EXPLORERS - 1);
  signal answers         : answers_t(0 to EXPLORERS - 1);

begin

  i_scheduler : entity directmpc.mpdcc_scheduler
    generic map (
      EXPLORERS => EXPLORERS,
      FOLDED    => FOLDED,
      INWARDS   => INWARDS
    )
    port map (
      clk          => clk,
      rst          => rst,
      start        => start,
      measurement  => to_measurement(measurement),
      previous     => to_positions(previous),
      coefficients => to_coefficients(coefficients),
      limits       => to_limits(limits),
      options      => OPTIONS,
      valid        => valid,
      busy         => busy,
      decision     => decision_record,
      broadcast    => broadcast,
      assignments  => assignments,
      answers      => answers
    );

  g_explorers : for i in 0 to EXPLORERS - 1 generate
    candidate_valid(i)         <= assignments(i).candidate_valid;
    result_ready(i)            <= assignments(i).result_ready;
    answers(i).candidate_ready <= candidate_ready(i);
    answers(i).result_valid    <= result_valid(i);
    answers(i).result          <= to_result(results((i + 1) * RESULT_BITS - 1 downto i * RESULT_BITS));
    answers(i).busy            <= explorer_busy(i);
    answers(i).evaluated       <= EVALUATED_INIT;
  end generate g_explorers;

  -- explorer 0 answers the probe
  g_probe : for i in 0 to EXPLORERS - 1 generate
    answers(i).probe_done <= probe_done when i = 0 else '0';
    answers(i).probe_held <= probe_held when i = 0 else '0';
  end generate g_probe;

  decision   <= to_vector(decision_record);
  node       <= to_vector(broadcast.node);
  band       <= to_vector(broadcast.band);
  capacitor  <= to_vector(broadcast.capacitor);
  last       <= broadcast.last;
  best_valid <= broadcast.best_valid;
  best_cost  <= std_logic_vector(broadcast.best_cost);
  candidate  <= to_vector(broadcast.candidate);

end architecture bench;
