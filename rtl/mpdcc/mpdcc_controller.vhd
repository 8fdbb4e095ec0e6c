-- Model predictive direct current control with records as ports; mpdcc_core is the same with flat ports
-- and explains what it decides.
--
-- One scheduler and EXPLORERS explorers of the variant that FOLDED chooses.
-- Formats, latency, overflow: as in mpdcc_core.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.mpdcc_types.all;

entity mpdcc_controller is
  generic (
    EXPLORERS         : positive range 1 to 8 := 2;     -- number of explorers
    FOLDED            : boolean               := false; -- true: the paper's explorer, false: the fast one
    SECOND_LEVEL      : boolean               := false; -- true: SESE and delay compensation, fast explorer alone
    WEIGHTED_DEADLOCK : boolean               := false; -- true: the weighted deadlock rule, fast explorer alone
    INWARDS           : boolean               := false  -- true: the rule inwards, fast explorer alone
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
    decision     : out   decision_t;     -- stable until the next valid
    cost         : out   std_logic_vector(COST_WIDTH - 1 downto 0) -- J of it, unsigned; none if held or deadlock
  );
end entity mpdcc_controller;

architecture rtl of mpdcc_controller is

  signal broadcast   : broadcast_t;
  signal assignments : assignments_t(0 to EXPLORERS - 1);
  signal answers     : answers_t(0 to EXPLORERS - 1);

begin

  assert not (FOLDED and SECOND_LEVEL)
    report "mpdcc_controller: SECOND_LEVEL needs the fast explorer, FOLDED = false"
    severity failure;

  assert not (FOLDED and WEIGHTED_DEADLOCK)
    report "mpdcc_controller: WEIGHTED_DEADLOCK needs the fast explorer, FOLDED = false"
    severity failure;

  assert not (FOLDED and INWARDS)
    report "mpdcc_controller: INWARDS needs the fast explorer, FOLDED = false"
    severity failure;

  -- each is a register that the search has in any case: a single result is not kept a second time
  g_one_result : if EXPLORERS = 1 and not FOLDED and not SECOND_LEVEL generate
    cost <= std_logic_vector(resize(answers(0).result.rank, COST_WIDTH));
  end generate g_one_result;

  g_results : if EXPLORERS > 1 or FOLDED or SECOND_LEVEL generate
    cost <= std_logic_vector(broadcast.best_cost);
  end generate g_results;

  i_scheduler : entity work.mpdcc_scheduler
    generic map (
      EXPLORERS    => EXPLORERS,
      FOLDED       => FOLDED,
      SECOND_LEVEL => SECOND_LEVEL,
      INWARDS      => INWARDS
    )
    port map (
      clk          => clk,
      rst          => rst,
      start        => start,
      measurement  => measurement,
      previous     => previous,
      coefficients => coefficients,
      limits       => limits,
      options      => options,
      valid        => valid,
      busy         => busy,
      decision     => decision,
      broadcast    => broadcast,
      assignments  => assignments,
      answers      => answers
    );

  g_explorers : for i in 0 to EXPLORERS - 1 generate

    i_explorer : entity work.mpdcc_explorer
      generic map (
        FOLDED            => FOLDED,
        SECOND_LEVEL      => SECOND_LEVEL,
        WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK,
        INWARDS           => INWARDS
      )
      port map (
        clk        => clk,
        rst        => rst,
        limits     => limits,
        broadcast  => broadcast,
        assignment => assignments(i),
        answer     => answers(i)
      );

  end generate g_explorers;

end architecture rtl;
