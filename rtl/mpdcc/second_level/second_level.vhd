-- The second level of the search (SESE), and the prediction of k+1: takes a node on to its successors.
--
-- At the root the unit keeps the node (node_base) and lists the candidates that stay inside their bounds
-- for a while (node_queue). Then it takes one of them after another: a program of common_terms computes
-- the state at k + L1, capacitor_search and turn_threshold follow, leaf_dispatcher hands all candidates
-- of the new node to the explorers, and node_shown changes the node under way in time with their stages.
-- The same program makes the node of k+1 under s(k-1) for the prediction.
--
-- Two nodes may be under way: the program of the next one begins while leaves of the one before are
-- handed out. A node is begun only if the budget covers all its candidates.
-- Formats: see mpdcc_types.
-- Latency: clocks of mpdcc_timing, from the pulse successor.advance. A node takes SUCCESSOR_CLOCKS clocks at least, or
-- as long as its leaves take (see leaf_dispatcher). Of the first, the first leaf is loaded after HAND_OUT_AT.
-- Overflow: level.unfit says that the state of k+1 does not fit; level.saturated that a value of it saturated.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_types.all;
  use work.second_level_types.all;

entity second_level is
  generic (
    EXPLORERS : positive range 1 to 8 := 2 -- number of explorers
  );
  port (
    clk         : in    std_logic;                                -- rising edge
    rst         : in    std_logic;                                -- synchronous, active high
    phase       : in    level_phase_t;                            -- where the decision is
    origin      : in    level_start_t;                            -- what the search starts from
    predict     : in    std_logic;                                -- '1' for one clock: begin with the node of k+1
    evaluated   : in    evaluated_t;                              -- candidates of the root, by explorer 0
    terms       : in    terms_progress_t;                         -- of common_terms
    node        : in    node_t;                                   -- of common_terms, as it stands there
    words       : in    words_t;                                  -- of common_terms, results, RESULT_* order
    successor   : out   successor_t;                              -- to common_terms
    preparation : out   preparation_t;                            -- to node_preparation
    shown       : out   node_t;                                   -- to the explorers: the node of their stages
    reached     : out   reached_t;                                -- to the explorers: how it was reached
    leaf_valid  : out   std_logic_vector(EXPLORERS - 1 downto 0); -- '1': leaf of this explorer is valid
    leaf        : out   leaves_t(0 to EXPLORERS - 1);             -- one to each explorer
    level       : out   level_report_t                            -- to the scheduler
  );
end entity second_level;

architecture rtl of second_level is

  type state_t is record
    cut          : std_logic;                           -- the budget has run out
    left         : unsigned(BUDGET_WIDTH - 1 downto 0); -- candidates that it still covers
    pending      : natural range 0 to 2;                -- nodes begun but not handed out
    may_begin    : std_logic;                           -- the next node may begin
    may_hand_out : std_logic;                           -- the first of them may be handed out
    bank         : std_logic;                           -- table of the capacitors for the next node
  end record state_t;

  constant STATE_INIT : state_t := (
    cut          => '0',
    left         => (others => '0'),
    pending      => 0,
    may_begin    => '1',
    may_hand_out => '0',
    bank         => '0'
  );

  signal r      : state_t;
  signal r_next : state_t;

  signal follow    : std_logic; -- '1': the root's node or that of k+1, no leaves are under way
  signal begins    : std_logic; -- '1': a node is begun
  signal load      : std_logic; -- '1': a node is handed out
  signal goes      : std_logic; -- '1': a program of common_terms begins
  signal completed : std_logic; -- '1': the node of k+1 is complete

  signal since          : std_logic_vector(1 to HAND_OUT_AT); -- clocks since the begin of a program
  signal visit_position : positions_t;                        -- of the node begun last
  signal visit_table    : std_logic;                          -- and its table of the capacitors
  signal visit_steps    : length_t;                           -- and its L1
  signal waiting        : visit_t;                            -- handed out next
  signal lead           : length_t;                           -- of the node handed out last
  signal flagged        : std_logic;                          -- '1': a value of it saturated

  signal keep            : std_logic;
  signal base_unfit      : std_logic;
  signal start_unfit     : std_logic;
  signal completed_late  : std_logic;
  signal predicted_flag  : std_logic;

  signal slope_due : std_logic;
  signal error_due : std_logic;

  signal queue_valid : std_logic;
  signal queue_entry : entry_t;
  signal queue_taken : std_logic;
  signal queue_empty : std_logic;
  signal leaf_count  : unsigned(BUDGET_WIDTH - 1 downto 0); -- candidates of the entry, registered: due once it is valid

  signal launch        : std_logic;
  signal leaves_ready  : std_logic;
  signal leaves_ending : std_logic;
  signal leaves_active : std_logic;

begin

  follow      <= not phase.leaves;
  completed   <= terms.advanced and phase.predicting;
  keep        <= terms.done or completed;
  visit_steps <= queue_entry.length when follow = '0' else
                 to_unsigned(1, LENGTH_WIDTH);
  queue_taken <= since(TAKEN_AT) and not follow;
  goes        <= predict or begins;

  successor.advance    <= goes;
  successor.show_slope <= slope_due or completed;
  successor.show_error <= error_due or completed;

  preparation.capacitors <= terms.capacitors or completed or (since(CAPACITORS_AT) and not follow);
  preparation.successor  <= since(CAPACITORS_AT);
  preparation.bank       <= visit_table and not follow;
  preparation.turn       <= terms.done or completed or (since(TURN_AT) and not follow);
  preparation.show_turn  <= error_due or follow;

  level.settle    <= completed;
  level.unfit     <= base_unfit or start_unfit;
  level.saturated <= predicted_flag;
  level.cut       <= r.cut;
  level.over      <= to_std_logic(r.pending = 0) and not leaves_active and (r.cut or queue_empty);

  ---------------------------------------------------------------------------------------------
  -- Which node is begun, which is handed out
  ---------------------------------------------------------------------------------------------

  p_next : process (r, phase, since, origin, queue_valid, leaf_count, leaves_ready, leaves_ending) is

    variable v    : state_t;
    variable rest : unsigned(BUDGET_WIDTH downto 0);

  begin

    v      := r;
    begins <= '0';
    load   <= '0';
    rest   := ('0' & r.left) - leaf_count;

    if (phase.idle = '1') then
      v.cut       := '0';
      v.may_begin := '1';
      v.bank      := '0';
    end if;

    if (phase.leaves = '0') then
      v.left := origin.budget;
    else
      if (since(NEXT_AT) = '1') then
        v.may_begin := '1';
      end if;

      if (since(HAND_OUT_AT) = '1') then
        v.may_hand_out := '1';
      end if;

      -- hand out the first node that is complete
      if ((r.may_hand_out = '1' or since(HAND_OUT_AT) = '1') and leaves_ready = '1') then
        load           <= '1';
        v.may_hand_out := '0';
        v.pending      := v.pending - 1;
      end if;

      -- begin with the next while its predecessor's words are still needed for ENDING_CLOCKS at most
      if (queue_valid = '1' and r.cut = '0' and r.may_begin = '1'
          and (r.pending = 0 or (r.pending = 1 and leaves_ending = '1'))) then
        if (origin.budget /= 0 and rest(BUDGET_WIDTH) = '1') then
          v.cut := '1';
        else
          begins      <= '1';
          v.left      := rest(BUDGET_WIDTH - 1 downto 0);
          v.pending   := v.pending + 1;
          v.may_begin := '0';
          v.bank      := not r.bank;
        end if;
      end if;
    end if;

    r_next <= v;

  end process p_next;

  p_state : process (clk) is
  begin

    if rising_edge(clk) then
      r <= r_next;

      if (rst = '1') then
        r.pending      <= STATE_INIT.pending;
        r.may_hand_out <= STATE_INIT.may_hand_out;
      end if;
    end if;

  end process p_state;

  p_leaf_count : process (clk) is
  begin

    if rising_edge(clk) then
      leaf_count <= combinations(queue_entry.position, 3);
    end if;

  end process p_leaf_count;

  ---------------------------------------------------------------------------------------------
  -- The nodes under way
  ---------------------------------------------------------------------------------------------

  p_visits : process (clk) is
  begin

    if rising_edge(clk) then
      since <= goes & since(1 to HAND_OUT_AT - 1);

      if (goes = '1') then
        visit_position <= queue_entry.position;
        visit_table    <= r.bank;

        if (follow = '1') then
          visit_position <= origin.previous;
        end if;
      end if;

      if (since(CAPACITORS_AT) = '1') then
        waiting.index    <= queue_entry.index;
        waiting.position <= visit_position;
        waiting.effort   <= queue_entry.effort;
        waiting.length   <= queue_entry.length;
        waiting.bank     <= visit_table;
      end if;

      if (load = '1') then
        lead    <= waiting.length;
        flagged <= terms.overflowed;
      end if;

      if (rst = '1') then
        since <= (others => '0');
      end if;
    end if;

  end process p_visits;

  p_flags : process (clk) is
  begin

    if rising_edge(clk) then
      if (evaluated.slope_valid = '1' and phase.probing = '1') then
        start_unfit <= evaluated.unfit;
      end if;

      completed_late <= completed;

      if (completed_late = '1') then
        predicted_flag <= terms.overflowed;
      end if;

      if (phase.idle = '1') then
        predicted_flag <= '0';
      end if;

      if (rst = '1') then
        completed_late <= '0';
      end if;
    end if;

  end process p_flags;

  ---------------------------------------------------------------------------------------------
  -- The units
  ---------------------------------------------------------------------------------------------

  i_base : entity work.node_base
    port map (
      clk         => clk,
      keep        => keep,
      words       => words,
      position    => visit_position,
      steps       => visit_steps,
      slope       => queue_entry.slope,
      base        => successor.base,
      lengths     => successor.lengths,
      slope_ahead => successor.slope,
      unfit       => base_unfit
    );

  i_queue : entity work.node_queue
    port map (
      clk       => clk,
      rst       => rst,
      clear     => phase.idle,
      open_root => follow,
      evaluated => evaluated,
      horizon   => origin.horizon,
      previous  => origin.previous,
      whole     => level.whole,
      valid     => queue_valid,
      entry     => queue_entry,
      taken     => queue_taken,
      empty     => queue_empty
    );

  i_leaves : entity work.leaf_dispatcher
    generic map (
      EXPLORERS => EXPLORERS
    )
    port map (
      clk        => clk,
      rst        => rst,
      load       => load,
      visit      => waiting,
      negative   => origin.negative,
      ready      => leaves_ready,
      ending     => leaves_ending,
      active     => leaves_active,
      launch     => launch,
      leaf_valid => leaf_valid,
      leaf       => leaf
    );

  i_shown : entity work.node_shown
    port map (
      clk        => clk,
      rst        => rst,
      follow     => follow,
      launch     => launch,
      node       => node,
      words      => words,
      lead       => lead,
      saturated  => flagged,
      shown      => shown,
      reached    => reached,
      show_slope => slope_due,
      show_error => error_due
    );

end architecture rtl;
