-- mpdcc_explorer with its records as vectors, see mpdcc_flat.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;

library work;
  use work.mpdcc_flat.all;

entity mpdcc_explorer_flat is
  generic (
    FOLDED            : boolean := true; -- variant of the explorer
    WEIGHTED_DEADLOCK : boolean := false; -- true: the weighted deadlock rule built in
    INWARDS           : boolean := false  -- true: the rule inwards built in
  );
  port (
    clk             : in    std_logic;                                     -- rising edge
    rst             : in    std_logic;                                     -- synchronous, active high
    limits          : in    std_logic_vector(LIMITS_BITS - 1 downto 0);    -- limits_t
    node            : in    std_logic_vector(NODE_BITS - 1 downto 0);      -- node_t
    band            : in    std_logic_vector(BAND_BITS - 1 downto 0);      -- band_t
    capacitor       : in    std_logic_vector(CAPACITOR_BITS - 1 downto 0); -- capacitor_t
    last            : in    std_logic;                                     -- '1': no candidate is left
    best_valid      : in    std_logic;                                     -- '1': J_dl is not needed any more
    best_cost       : in    std_logic_vector(COST_WIDTH - 1 downto 0);     -- best cost so far
    candidate_valid : in    std_logic;                                     -- '1': candidate is new
    candidate_ready : out   std_logic;                                     -- '1': candidate is taken in this clock
    candidate       : in    std_logic_vector(CANDIDATE_BITS - 1 downto 0); -- candidate_t
    probe_done      : out   std_logic;                                     -- '1' for one clock: answer to a probe
    probe_held      : out   std_logic;                                     -- '1': step one stays inside
    result_valid    : out   std_logic;                                     -- '1': result is new
    result_ready    : in    std_logic;                                     -- '1': result is taken in this clock
    result          : out   std_logic_vector(RESULT_BITS - 1 downto 0);    -- result_t
    busy            : out   std_logic                                      -- '1': work is under way
  );
end entity mpdcc_explorer_flat;

architecture bench of mpdcc_explorer_flat is

  signal broadcast  : broadcast_t;
  signal assignment : assignment_t;
  signal answer     : answer_t;

begin

  broadcast.node       <= to_node(node);
  broadcast.band       <= to_band(band);
  broadcast.capacitor  <= to_capacitor(capacitor);
  broadcast.last       <= last;
  broadcast.best_valid <= best_valid;
  broadcast.best_cost  <= unsigned(best_cost);
  broadcast.candidate  <= to_candidate(candidate);
  broadcast.reached    <= REACHED_INIT;

  assignment.candidate_valid <= candidate_valid;
  assignment.result_ready    <= result_ready;
  assignment.leaf_valid      <= '0';
  assignment.leaf            <= LEAF_INIT;

  i_explorer : entity directmpc.mpdcc_explorer
    generic map (
      FOLDED            => FOLDED,
      WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK,
      INWARDS           => INWARDS
    )
    port map (
      clk        => clk,
      rst        => rst,
      limits     => to_limits(limits),
      broadcast  => broadcast,
      assignment => assignment,
      answer     => answer
    );

  candidate_ready <= answer.candidate_ready;
  probe_done      <= answer.probe_done;
  probe_held      <= answer.probe_held;
  result_valid    <= answer.result_valid;
  result          <= to_vector(answer.result);
  busy            <= answer.busy;

end architecture bench;
