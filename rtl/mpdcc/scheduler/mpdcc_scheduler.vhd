-- Central scheduler (Paper A, Section V, Algorithm 1).
--
-- Samples the measurements and has the common terms computed. Asks an explorer whether s(k-1) keeps
-- every output inside its bound for one more step; if so, the position is held. If not, hands every
-- candidate to the first free explorer and keeps the best result: the smallest J where some length is
-- above zero, else the smallest J_dl. Ties go to the earliest candidate, in whatever order results
-- arrive. With ADVANCES the best candidates of the root go on to second_level.
--
-- The order of events stands here. The work is done by measurement_operands, common_terms,
-- node_preparation, candidate_handout, result_collector, second_level and decision_register.
--
-- Formats: see mpdcc_types.
-- Latency: 21 clocks from start to valid for a held position, 28 with the paper's explorers; a
-- search at most 112, 82, 73, 70 with one, two, three, more explorers, whatever they find; with the
-- paper's 62 + 22 * (63 / EXPLORERS) + 63 mod EXPLORERS. One decision at a time.
-- The probe goes out 10 clocks after start, 14 with the paper's explorers. valid comes 1 clock after its answer,
-- or 3 clocks after the last result is taken.
-- With two_switchings (SESE, SECOND_LEVEL) a search takes at most 3470, 1928, 1755 with one to three
-- explorers and 1191 with more; compensate adds 30 clocks to a hold and 33 to a search.
-- Overflow: saturation of a common term or of the chosen candidate's weight, and with the rule inwards an error too
-- far outside to be followed, are flagged with the decision.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_types.all;
  use work.second_level_types.all;

entity mpdcc_scheduler is
  generic (
    EXPLORERS    : positive range 1 to 8 := 2;     -- number of explorers
    FOLDED       : boolean               := false; -- true: the paper's explorers, false: the fast ones
    SECOND_LEVEL : boolean               := false; -- true: fast variant with SESE and delay compensation
    INWARDS      : boolean               := false  -- true: fast variant with the rule inwards to choose
  );
  port (
    clk          : in    std_logic;                         -- rising edge
    rst          : in    std_logic;                         -- synchronous, active high
    start        : in    std_logic;                         -- '1' for one clock: decide; ignored while busy
    measurement  : in    measurement_t;                     -- sampled with start
    previous     : in    positions_t;                       -- s(k-1), sampled with start
    coefficients : in    coefficients_t;                    -- signed, FACTOR_* order, stable while busy
    limits       : in    limits_t;                          -- bounds and horizon, stable while busy
    options      : in    options_t;                         -- of SECOND_LEVEL, stable while busy
    valid        : out   std_logic;                         -- '1' for one clock: decision is new
    busy         : out   std_logic;                         -- '1': a decision is under way
    decision     : out   decision_t;                        -- stable until the next valid
    broadcast    : out   broadcast_t;                       -- to every explorer
    assignments  : out   assignments_t(0 to EXPLORERS - 1); -- one to each explorer
    answers      : in    answers_t(0 to EXPLORERS - 1)      -- one of each explorer
  );
end entity mpdcc_scheduler;

architecture rtl of mpdcc_scheduler is

  type phase_t is (IDLE, PREPARE, AWAIT, PREDICTING, SEARCH, LEAVES, FINISH);

  type state_t is record
    phase     : phase_t;
    started   : std_logic; -- first clock of the search is over
    predicted : std_logic; -- the node is that of k+1
  end record state_t;

  constant STATE_INIT : state_t := (
    phase     => IDLE,
    started   => '0',
    predicted => '0'
  );

  -- whether successors of a node are searched at all
  constant ADVANCES : boolean := SECOND_LEVEL and not FOLDED;

  signal r : state_t;

  signal s_before : positions_t;
  signal negative : std_logic_vector(2 downto 0); -- '1': negative phase current

  -- common terms
  signal begins      : std_logic; -- '1' for one clock: a decision begins
  signal operands    : root_operands_t;
  signal successor   : successor_t;
  signal terms       : terms_progress_t;
  signal words       : words_t;
  signal node        : node_t;
  signal error_ahead : trajectories_t;
  signal preparation : preparation_t;
  signal ask         : std_logic; -- '1' for one clock: the node is there for the probe
  signal lines_held  : std_logic; -- '1': s(k-1) keeps capacitors and v_n inside
  signal lines_ready : std_logic; -- '1': candidates may be handed out

  -- the second level
  signal level_phase : level_phase_t;
  signal level_start : level_start_t;
  signal level       : level_report_t;
  signal over        : std_logic; -- '1': no more leaves will come
  signal leaf_valid  : std_logic_vector(EXPLORERS - 1 downto 0);
  signal leaf        : leaves_t(0 to EXPLORERS - 1);
  signal two_levels  : std_logic; -- '1': SESE

  -- events of Algorithm 1, each '1' for one clock
  signal predict  : std_logic; -- take the node on to k+1
  signal hold     : std_logic; -- s(k-1) is kept
  signal opened   : std_logic; -- the root has a feasible candidate: on to the second level
  signal stopped  : std_logic; -- it has none: deadlock
  signal searched : std_logic; -- everything is compared

  -- candidates and results
  signal probing         : std_logic;
  signal probe           : std_logic;
  signal enumerate       : std_logic;
  signal enumerated      : std_logic; -- '1': every candidate of the root has been taken
  signal may_search      : std_logic;
  signal candidate_valid : std_logic_vector(EXPLORERS - 1 downto 0);
  signal candidate_ready : std_logic_vector(EXPLORERS - 1 downto 0);
  signal result_valid    : std_logic_vector(EXPLORERS - 1 downto 0);
  signal result_ready    : std_logic_vector(EXPLORERS - 1 downto 0);
  signal results         : results_t(0 to EXPLORERS - 1);
  signal explorer_busy   : std_logic_vector(EXPLORERS - 1 downto 0);
  signal explorers_idle  : std_logic;
  signal best            : result_t;

  -- the decision
  signal decide        : std_logic;
  signal choice        : result_t;
  signal decision_flag : std_logic;
  signal exhausted     : std_logic;

begin

  assert not (FOLDED and SECOND_LEVEL)
    report "mpdcc_scheduler: SECOND_LEVEL needs the fast explorer, FOLDED = false"
    severity failure;

  p_previous : process (clk) is
  begin

    if rising_edge(clk) then
      if (begins = '1') then
        s_before <= previous;
      end if;
    end if;

  end process p_previous;

  ---------------------------------------------------------------------------------------------
  -- Common terms
  ---------------------------------------------------------------------------------------------

  begins <= to_std_logic(r.phase = IDLE) and start;

  i_operands : entity work.measurement_operands
    port map (
      clk         => clk,
      take        => begins,
      measurement => measurement,
      operands    => operands
    );

  i_common_terms : entity work.common_terms
    generic map (
      FOLDED       => FOLDED,
      SECOND_LEVEL => ADVANCES
    )
    port map (
      clk          => clk,
      rst          => rst,
      start        => begins,
      operands     => operands,
      coefficients => coefficients,
      successor    => successor,
      progress     => terms,
      node         => node,
      words        => words,
      error_ahead  => error_ahead
    );

  -- the capacitor-current terms carry the signs of the phase currents
  g_signs : for x in 0 to 2 generate
    negative(x) <= node.phase_current(x)(CURRENT_TERM_WIDTH - 1);
  end generate g_signs;

  ---------------------------------------------------------------------------------------------
  -- The second level
  ---------------------------------------------------------------------------------------------

  level_phase.idle       <= to_std_logic(r.phase = IDLE);
  level_phase.probing    <= to_std_logic(r.phase = AWAIT) and not r.predicted;
  level_phase.predicting <= to_std_logic(r.phase = PREDICTING);
  level_phase.leaves     <= to_std_logic(r.phase = LEAVES);

  level_start.previous <= s_before;
  level_start.negative <= negative;
  level_start.horizon  <= limits.horizon;
  level_start.budget   <= options.budget;

  two_levels <= options.two_switchings and to_std_logic(ADVANCES);

  g_one_level : if not ADVANCES generate
    successor              <= SUCCESSOR_NONE;
    preparation.capacitors <= terms.capacitors;
    preparation.successor  <= '0';
    preparation.bank       <= '0';
    preparation.turn       <= terms.done;
    preparation.show_turn  <= '1';
    level                  <= LEVEL_NONE;
    over                   <= '1';
    leaf_valid             <= (others => '0');
    leaf                   <= (others => LEAF_INIT);
    broadcast.node         <= node;
    broadcast.reached      <= REACHED_INIT;
  end generate g_one_level;

  g_two_levels : if ADVANCES generate

    i_level : entity work.second_level
      generic map (
        EXPLORERS => EXPLORERS
      )
      port map (
        clk         => clk,
        rst         => rst,
        phase       => level_phase,
        origin      => level_start,
        predict     => predict,
        evaluated   => answers(0).evaluated,
        terms       => terms,
        node        => node,
        words       => words,
        successor   => successor,
        preparation => preparation,
        shown       => broadcast.node,
        reached     => broadcast.reached,
        leaf_valid  => leaf_valid,
        leaf        => leaf,
        level       => level
      );

    -- costs no clock where there are leaves: an explorer is busy with the last one for longer
    p_over : process (clk) is
    begin

      if rising_edge(clk) then
        over <= to_std_logic(r.phase = LEAVES) and r.started and level.over;
      end if;

    end process p_over;

  end generate g_two_levels;

  ---------------------------------------------------------------------------------------------
  -- What the explorers of a variant need besides
  ---------------------------------------------------------------------------------------------

  g_paper : if FOLDED generate
    ask         <= terms.done;
    lines_held  <= '1';
    lines_ready <= '1';

    -- the paper's explorers look at capacitors themselves and have no use for these
    broadcast.band.first       <= (others => (others => '0'));
    broadcast.band.margin_up   <= (others => (others => '0'));
    broadcast.band.margin_down <= (others => (others => '0'));
    broadcast.band.outside     <= (others => '0');
    broadcast.band.limit       <= (others => (others => '0'));
    broadcast.band.turn        <= (others => (others => '0'));
    broadcast.band.previous    <= s_before;
    broadcast.band.negative    <= negative;
    broadcast.capacitor        <= CAPACITOR_NONE;
  end generate g_paper;

  g_fast : if not FOLDED generate
    -- the probe needs the node a few stages down its pipeline
    ask <= terms.issued;

    i_preparation : entity work.node_preparation
      generic map (
        SECOND_LEVEL => ADVANCES,
        INWARDS      => INWARDS
      )
      port map (
        clk         => clk,
        rst         => rst,
        preparation => preparation,
        limits      => limits,
        node        => node,
        previous    => s_before,
        negative    => negative,
        error_ahead => error_ahead,
        band        => broadcast.band,
        capacitor   => broadcast.capacitor,
        ready       => lines_ready,
        held        => lines_held
      );

  end generate g_fast;

  ---------------------------------------------------------------------------------------------
  -- Candidates to the explorers, results from them
  ---------------------------------------------------------------------------------------------

  g_explorers : for i in 0 to EXPLORERS - 1 generate
    assignments(i).candidate_valid <= candidate_valid(i);
    assignments(i).result_ready    <= result_ready(i);
    assignments(i).leaf_valid      <= leaf_valid(i);
    assignments(i).leaf            <= leaf(i);
    candidate_ready(i)             <= answers(i).candidate_ready;
    result_valid(i)                <= answers(i).result_valid;
    results(i)                     <= answers(i).result;
    explorer_busy(i)               <= answers(i).busy;
  end generate g_explorers;

  probing    <= to_std_logic(r.phase = PREPARE or r.phase = AWAIT or r.phase = PREDICTING);
  probe      <= (to_std_logic(r.phase = PREPARE) and ask) or (to_std_logic(r.phase = PREDICTING) and level.settle);
  enumerate  <= to_std_logic(r.phase = AWAIT) and answers(0).probe_done and not predict and not hold;
  may_search <= to_std_logic(r.phase = SEARCH) and lines_ready;

  i_handout : entity work.candidate_handout
    generic map (
      EXPLORERS => EXPLORERS,
      BLOCKS    => not FOLDED
    )
    port map (
      clk          => clk,
      rst          => rst,
      previous     => s_before,
      negative     => negative,
      probing      => probing,
      probe        => probe,
      enumerate    => enumerate,
      searching    => may_search,
      one_explorer => two_levels,
      ready        => candidate_ready,
      valid        => candidate_valid,
      candidate    => broadcast.candidate,
      done         => enumerated
    );

  i_collector : entity work.result_collector
    generic map (
      EXPLORERS  => EXPLORERS,
      REGISTERED => (EXPLORERS > 1 or ADVANCES) and not FOLDED,
      ONE_RESULT => EXPLORERS = 1 and not FOLDED and not ADVANCES
    )
    port map (
      clk          => clk,
      rst          => rst,
      clear        => level_phase.idle,
      result_valid => result_valid,
      result_ready => result_ready,
      results      => results,
      two_levels   => two_levels,
      leaves       => level_phase.leaves,
      whole        => level.whole,
      evaluated    => answers(0).evaluated,
      adopt        => opened,
      best         => best
    );

  broadcast.last       <= (to_std_logic(r.phase = SEARCH) and r.started and enumerated)
                          or (to_std_logic(r.phase = LEAVES) and r.started and over);
  broadcast.best_valid <= best.feasible;
  broadcast.best_cost  <= resize(best.rank, COST_WIDTH);

  ---------------------------------------------------------------------------------------------
  -- Algorithm 1
  ---------------------------------------------------------------------------------------------

  explorers_idle <= to_std_logic(explorer_busy = (explorer_busy'range => '0'));

  predict <= to_std_logic(ADVANCES and r.phase = AWAIT) and answers(0).probe_done and options.compensate
             and not level.unfit and not r.predicted;
  hold    <= to_std_logic(r.phase = AWAIT) and answers(0).probe_done and not predict and answers(0).probe_held
             and lines_held;
  -- with two levels the root is explorer 0's alone: no other one has a result then
  opened  <= to_std_logic(r.phase = SEARCH) and two_levels and result_valid(0) and results(0).feasible;
  stopped <= to_std_logic(r.phase = SEARCH) and two_levels and result_valid(0) and not results(0).feasible;

  -- the enumerator still shows the last search's end in the first clock; what arrived is compared
  -- by then, and what has not is busy
  searched <= r.started and explorers_idle
              and ((to_std_logic(r.phase = SEARCH) and not two_levels and enumerated)
                   or (to_std_logic(r.phase = LEAVES) and over));

  p_phase : process (clk) is
  begin

    if rising_edge(clk) then
      r.started <= to_std_logic(r.phase = SEARCH or r.phase = LEAVES);

      case r.phase is

        when IDLE =>

          r.predicted <= '0';

          if (start = '1') then
            r.phase <= PREPARE;
          end if;

        when PREPARE =>

          if (ask = '1') then
            r.phase <= AWAIT;
          end if;

        when AWAIT =>

          if (predict = '1') then
            r.predicted <= '1';
            r.phase     <= PREDICTING;
          elsif (hold = '1') then
            r.phase <= IDLE;
          elsif (answers(0).probe_done = '1') then
            r.phase <= SEARCH;
          end if;

        when PREDICTING =>

          if (level.settle = '1') then
            r.phase <= AWAIT;
          end if;

        when SEARCH =>

          if (opened = '1') then
            r.phase   <= LEAVES;
            r.started <= '0';
          elsif (stopped = '1') then
            r.phase <= IDLE;
          elsif (searched = '1') then
            r.phase <= FINISH;
          end if;

        when LEAVES =>

          if (searched = '1') then
            r.phase <= FINISH;
          end if;

        when FINISH =>

          r.phase <= IDLE;

      end case;

      if (rst = '1') then
        r.phase <= STATE_INIT.phase;
      end if;
    end if;

  end process p_phase;

  ---------------------------------------------------------------------------------------------
  -- The decision
  ---------------------------------------------------------------------------------------------

  g_flag : if not INWARDS generate
    decision_flag <= terms.saturated or level.saturated or (options.compensate and level.unfit and not r.predicted);
  end generate g_flag;

  -- what is too far outside to be followed counts as dead: of the root, before candidates are searched
  g_inwards_flag : if INWARDS generate

    signal far : std_logic; -- '1': an error of the root is

  begin

    decision_flag <= terms.saturated or level.saturated or (far and not hold)
                     or (options.compensate and level.unfit and not r.predicted);

    p_far : process (clk) is

      variable beyond : std_logic;

    begin

      if rising_edge(clk) then
        beyond := '0';

        for i in node.error'range loop
          beyond := beyond or overflows(node.error(i), BASE_WIDTH);
        end loop;

        if (r.phase = IDLE) then
          far <= '0';
        elsif (r.phase = AWAIT) then
          far <= beyond and limits.outside_inwards;
        end if;
      end if;

    end process p_far;

  end generate g_inwards_flag;

  decide        <= stopped or to_std_logic(r.phase = FINISH);
  choice        <= results(0) when stopped = '1' else
                   best;
  exhausted     <= level.cut and not stopped;

  i_decision : entity work.decision_register
    port map (
      clk       => clk,
      rst       => rst,
      previous  => s_before,
      hold      => hold,
      decide    => decide,
      choice    => choice,
      saturated => decision_flag,
      exhausted => exhausted,
      valid     => valid,
      decision  => decision
    );

  busy <= not level_phase.idle;

end architecture rtl;
