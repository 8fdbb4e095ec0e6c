-- Explorer unit: evaluates candidates of a node (Paper A, Section VI).
--
-- One entity, two variants: FOLDED = true is the paper's, one candidate at a time over shared
-- hardware (explorer_paper); FOLDED = false takes one candidate per clock (explorer_fast).
-- Tasks are taken while ready is '1'.  A result may stand for several tasks: only those that can
-- still win are reported.  busy is '0' when every candidate taken is accounted for.
-- Formats, latency, overflow: see the variant.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library work;
  use work.mpdcc_types.all;

entity mpdcc_explorer is
  generic (
    FOLDED            : boolean := false; -- true: the paper's variant, false: the fast one
    SECOND_LEVEL      : boolean := false; -- true: fast variant with leaves of the second level
    WEIGHTED_DEADLOCK : boolean := false  -- true: fast variant with the weighted deadlock rule to choose
  );
  port (
    clk             : in    std_logic;   -- rising edge
    rst             : in    std_logic;   -- synchronous, active high
    limits          : in    limits_t;    -- bounds and horizon, stable while busy
    node            : in    node_t;      -- where trajectories start, stable while busy
    band            : in    band_t;      -- fast variant: the band seen from there, stable while busy
    capacitor       : in    capacitor_t; -- fast variant: table of the capacitors' lengths, row by row
    last            : in    std_logic;   -- '1': no candidate of this node is left
    best_valid      : in    std_logic;   -- '1': a candidate with length > 0 is known, J_dl is not needed any more
    best_cost       : in    cost_t;      -- its cost, valid with best_valid
    candidate_valid : in    std_logic;   -- '1': candidate is new
    candidate_ready : out   std_logic;   -- '1': candidate is taken in this clock
    candidate       : in    candidate_t; -- what to evaluate
    probe_done      : out   std_logic;   -- '1' for one clock: answer to a probe
    probe_held      : out   std_logic;   -- '1': step one stays inside every bound
    result_valid    : out   std_logic;   -- '1': result is new
    result_ready    : in    std_logic;   -- '1': result is taken in this clock
    result          : out   result_t;    -- evaluation of a candidate
    busy            : out   std_logic;   -- '1': tasks or results are under way
    leaf_valid      : in    std_logic;   -- SECOND_LEVEL: '1': leaf is evaluated
    leaf            : in    leaf_t;      -- SECOND_LEVEL: a candidate of the second level
    reached         : in    reached_t;   -- SECOND_LEVEL: how its node was reached
    evaluated       : out   evaluated_t  -- SECOND_LEVEL: every candidate, for the second level
  );
end entity mpdcc_explorer;

architecture rtl of mpdcc_explorer is

begin

  assert not (FOLDED and (SECOND_LEVEL or WEIGHTED_DEADLOCK))
    report "mpdcc_explorer: SECOND_LEVEL and WEIGHTED_DEADLOCK need the fast variant, FOLDED = false"
    severity failure;

  g_paper : if FOLDED generate

    i_explorer : entity work.explorer_paper
      port map (
        clk             => clk,
        rst             => rst,
        limits          => limits,
        node            => node,
        best_valid      => best_valid,
        best_cost       => best_cost,
        candidate_valid => candidate_valid,
        candidate_ready => candidate_ready,
        candidate       => candidate,
        probe_done      => probe_done,
        probe_held      => probe_held,
        result_valid    => result_valid,
        result_ready    => result_ready,
        result          => result,
        busy            => busy
      );

    evaluated <= EVALUATED_INIT;

  end generate g_paper;

  g_fast : if not FOLDED generate

    i_explorer : entity work.explorer_fast
      generic map (
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
        candidate_valid => candidate_valid,
        candidate_ready => candidate_ready,
        candidate       => candidate,
        probe_done      => probe_done,
        probe_held      => probe_held,
        result_valid    => result_valid,
        result_ready    => result_ready,
        result          => result,
        busy            => busy,
        leaf_valid      => leaf_valid,
        leaf            => leaf,
        reached         => reached,
        evaluated       => evaluated
      );

  end generate g_fast;

end architecture rtl;
