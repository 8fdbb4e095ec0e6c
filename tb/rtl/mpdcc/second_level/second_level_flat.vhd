-- second_level with vectors for its records, see mpdcc_flat.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;
  use directmpc.second_level_types.all;

library work;
  use work.mpdcc_flat.all;

entity second_level_flat is
  generic (
    EXPLORERS : positive range 1 to 8 := 2 -- number of explorers
  );
  port (
    clk               : in    std_logic;                                     -- rising edge
    rst               : in    std_logic;                                     -- synchronous, active high
    -- level_phase_t
    idle              : in    std_logic;                                     -- '1': no decision
    probing           : in    std_logic;                                     -- '1': probe of k under way
    predicting        : in    std_logic;                                     -- '1': on to k+1
    leaves            : in    std_logic;                                     -- '1': second level
    -- level_start_t
    previous          : in    std_logic_vector(8 downto 0);                  -- s(k-1), a on the right
    negative          : in    std_logic_vector(2 downto 0);                  -- '1': negative phase current
    horizon           : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0);   -- N, steps
    budget            : in    std_logic_vector(BUDGET_WIDTH - 1 downto 0);   -- candidates, 0: no limit
    predict           : in    std_logic;                                     -- '1': begin with k+1
    -- evaluated_t
    slope_valid       : in    std_logic;                                     -- '1': slope is new
    slope_index       : in    std_logic_vector(INDEX_WIDTH - 1 downto 0);    -- its place
    slope             : in    std_logic_vector(2 * BASE_WIDTH - 1 downto 0); -- of a and b, a on the right
    unfit             : in    std_logic;                                     -- '1': one does not fit
    evaluated         : in    std_logic;                                     -- '1': valid
    index             : in    std_logic_vector(INDEX_WIDTH - 1 downto 0);    -- place
    effort            : in    std_logic_vector(EFFORT_WIDTH - 1 downto 0);   -- f_s
    length            : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0);   -- L*, steps
    -- terms_progress_t
    issued            : in    std_logic;                                     -- pulse, active high
    capacitors        : in    std_logic;                                     -- pulse, active high
    done              : in    std_logic;                                     -- pulse, active high
    saturated         : in    std_logic;                                     -- '1': of the root
    advanced          : in    std_logic;                                     -- pulse, active high
    overflowed        : in    std_logic;                                     -- '1': of the successor
    node              : in    std_logic_vector(NODE_BITS - 1 downto 0);      -- node_t
    words             : in    std_logic_vector(RESULT_COUNT * TERM_WIDTH - 1 downto 0); -- RESULT_* order
    -- successor_t
    advance           : out   std_logic;                                     -- pulse, active high
    lengths           : out   std_logic_vector(SIGNED_LENGTHS * (LENGTH_WIDTH + 1) - 1 downto 0); -- L1 and signed
    base              : out   std_logic_vector(BASE_COUNT * OPERAND_WIDTH - 1 downto 0); -- operands A, BASE order
    slope_ahead       : out   std_logic_vector(2 * TERM_WIDTH - 1 downto 0); -- alpha on the right
    show_slope        : out   std_logic;                                     -- pulse, active high
    show_error        : out   std_logic;                                     -- pulse, active high
    -- preparation_t
    prepare_lines     : out   std_logic;                                     -- pulse, active high
    prepare_successor : out   std_logic;                                     -- '1': of a successor
    prepare_bank      : out   std_logic;                                     -- which table
    prepare_turn      : out   std_logic;                                     -- pulse, active high
    prepare_show_turn : out   std_logic;                                     -- '1': shown from now on
    -- node_t and reached_t
    shown             : out   std_logic_vector(NODE_BITS - 1 downto 0);      -- node_t
    reached_second    : out   std_logic;                                     -- '1': leaves
    reached_lead      : out   std_logic_vector(LENGTH_WIDTH - 1 downto 0);   -- L1, for the cost
    reached_length    : out   std_logic_vector(LENGTH_WIDTH - 1 downto 0);   -- L1, with the comparison
    reached_saturated : out   std_logic;                                     -- '1': a value saturated
    leaf_valid        : out   std_logic_vector(EXPLORERS - 1 downto 0);      -- '1': leaf is valid
    leaf              : out   std_logic_vector(21 * EXPLORERS - 1 downto 0); -- index, bank, effort, c, b, a
    -- level_report_t
    settle            : out   std_logic;                                     -- pulse, active high
    level_unfit       : out   std_logic;                                     -- '1': k+1 does not fit
    level_saturated   : out   std_logic;                                     -- '1': k+1 saturated
    whole             : out   std_logic;                                     -- '1': leaf of the root
    over              : out   std_logic;                                     -- '1': no more leaves
    cut               : out   std_logic                                      -- '1': the budget has run out
  );
end entity second_level_flat;

architecture bench of second_level_flat is

  signal phase            : level_phase_t;
  signal origin           : level_start_t;
  signal candidate        : evaluated_t;
  signal terms            : terms_progress_t;
  signal successor        : successor_t;
  signal preparation      : preparation_t;
  signal shown_record     : node_t;
  signal reached          : reached_t;
  signal leaf_array       : leaves_t(0 to EXPLORERS - 1);
  signal level            : level_report_t;

begin

  phase.idle       <= idle;
  phase.probing    <= probing;
  phase.predicting <= predicting;
  phase.leaves     <= leaves;

  origin.previous <= to_positions(previous);
  origin.negative <= negative;
  origin.horizon  <= unsigned(horizon);
  origin.budget   <= unsigned(budget);

  candidate.slope_valid <= slope_valid;
  candidate.slope_index <= unsigned(slope_index);
  candidate.slope(0)    <= signed(slope(BASE_WIDTH - 1 downto 0));
  candidate.slope(1)    <= signed(slope(2 * BASE_WIDTH - 1 downto BASE_WIDTH));
  candidate.unfit       <= unfit;
  candidate.valid       <= evaluated;
  candidate.index       <= unsigned(index);
  candidate.effort      <= unsigned(effort);
  candidate.length      <= unsigned(length);
  candidate.cost        <= (others => '0');
  candidate.saturated   <= '0';

  terms.issued     <= issued;
  terms.capacitors <= capacitors;
  terms.done       <= done;
  terms.saturated  <= saturated;
  terms.advanced   <= advanced;
  terms.overflowed <= overflowed;

  i_level : entity directmpc.second_level
    generic map (
      EXPLORERS => EXPLORERS
    )
    port map (
      clk         => clk,
      rst         => rst,
      phase       => phase,
      origin      => origin,
      predict     => predict,
      evaluated   => candidate,
      terms       => terms,
      node        => to_node(node),
      words       => words,
      successor   => successor,
      preparation => preparation,
      shown       => shown_record,
      reached     => reached,
      leaf_valid  => leaf_valid,
      leaf        => leaf_array,
      level       => level
    );

  advance     <= successor.advance;
  lengths     <= successor.lengths;
  base        <= successor.base;
  slope_ahead <= std_logic_vector(successor.slope(1)) & std_logic_vector(successor.slope(0));
  show_slope  <= successor.show_slope;
  show_error  <= successor.show_error;

  prepare_lines     <= preparation.capacitors;
  prepare_successor <= preparation.successor;
  prepare_bank      <= preparation.bank;
  prepare_turn      <= preparation.turn;
  prepare_show_turn <= preparation.show_turn;

  shown             <= to_vector(shown_record);
  reached_second    <= reached.second;
  reached_lead      <= std_logic_vector(reached.lead);
  reached_length    <= std_logic_vector(reached.length);
  reached_saturated <= reached.saturated;

  g_leaves : for i in 0 to EXPLORERS - 1 generate
    leaf(21 * i + 20 downto 21 * i) <= std_logic_vector(leaf_array(i).index) & leaf_array(i).bank
                                       & std_logic_vector(leaf_array(i).effort)
                                       & std_logic_vector(leaf_array(i).position(2))
                                       & std_logic_vector(leaf_array(i).position(1))
                                       & std_logic_vector(leaf_array(i).position(0));
  end generate g_leaves;

  settle          <= level.settle;
  level_unfit     <= level.unfit;
  level_saturated <= level.saturated;
  whole           <= level.whole;
  over            <= level.over;
  cut             <= level.cut;

end architecture bench;
