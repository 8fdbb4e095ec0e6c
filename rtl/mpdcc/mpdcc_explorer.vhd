-- Explorer unit: evaluates candidates of a node (Paper A, Section VI).
--
-- One entity, two variants: FOLDED = true is the paper's, one candidate at a time over shared
-- hardware (explorer_paper); FOLDED = false takes one candidate per clock (explorer_fast).
-- Tasks are taken while ready is '1'.  A result may stand for several tasks: only those that can
-- still win are reported.  busy is '0' when every candidate taken is accounted for.
-- Latency: fast, a probe is answered 10 clocks after it is taken, and the result of n candidates is there
-- 20 + n clocks after their first block is taken; paper, a probe takes at most 13 clocks and a candidate 30,
-- and the next candidate is taken after at most 22 clocks, 14 when dead.
-- Formats, overflow: see the variant.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library work;
  use work.mpdcc_types.all;

entity mpdcc_explorer is
  generic (
    FOLDED            : boolean := false; -- true: the paper's variant, false: the fast one
    SECOND_LEVEL      : boolean := false; -- true: fast variant with leaves of the second level
    WEIGHTED_DEADLOCK : boolean := false; -- true: fast variant with the weighted deadlock rule to choose
    INWARDS           : boolean := false  -- true: fast variant with the rule inwards to choose
  );
  port (
    clk        : in    std_logic;    -- rising edge
    rst        : in    std_logic;    -- synchronous, active high
    limits     : in    limits_t;     -- bounds and horizon, stable while busy
    broadcast  : in    broadcast_t;  -- to every explorer
    assignment : in    assignment_t; -- to this explorer
    answer     : out   answer_t      -- of this explorer
  );
end entity mpdcc_explorer;

architecture rtl of mpdcc_explorer is

begin

  assert not (FOLDED and (SECOND_LEVEL or WEIGHTED_DEADLOCK or INWARDS))
    report "mpdcc_explorer: SECOND_LEVEL, WEIGHTED_DEADLOCK and INWARDS need the fast variant, FOLDED = false"
    severity failure;

  g_paper : if FOLDED generate

    i_explorer : entity work.explorer_paper
      port map (
        clk             => clk,
        rst             => rst,
        limits          => limits,
        node            => broadcast.node,
        best_valid      => broadcast.best_valid,
        best_cost       => broadcast.best_cost,
        candidate_valid => assignment.candidate_valid,
        candidate_ready => answer.candidate_ready,
        candidate       => broadcast.candidate,
        probe_done      => answer.probe_done,
        probe_held      => answer.probe_held,
        result_valid    => answer.result_valid,
        result_ready    => assignment.result_ready,
        result          => answer.result,
        busy            => answer.busy
      );

    answer.evaluated <= EVALUATED_INIT;

  end generate g_paper;

  g_fast : if not FOLDED generate

    i_explorer : entity work.explorer_fast
      generic map (
        SECOND_LEVEL      => SECOND_LEVEL,
        WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK,
        INWARDS           => INWARDS
      )
      port map (
        clk             => clk,
        rst             => rst,
        limits          => limits,
        node            => broadcast.node,
        band            => broadcast.band,
        capacitor       => broadcast.capacitor,
        last            => broadcast.last,
        candidate_valid => assignment.candidate_valid,
        candidate_ready => answer.candidate_ready,
        candidate       => broadcast.candidate,
        probe_done      => answer.probe_done,
        probe_held      => answer.probe_held,
        result_valid    => answer.result_valid,
        result_ready    => assignment.result_ready,
        result          => answer.result,
        busy            => answer.busy,
        leaf_valid      => assignment.leaf_valid,
        leaf            => assignment.leaf,
        reached         => broadcast.reached,
        evaluated       => answer.evaluated
      );

  end generate g_fast;

end architecture rtl;
