-- Central scheduler (Paper A, Section V, Algorithm 1).
--
-- Samples the measurements and has the common terms computed. Asks an explorer whether s(k-1) keeps
-- every output inside its bound for one more step; if so, the position is held. If not, hands every
-- candidate to the first free explorer and keeps the best result: the smallest J where some length is
-- above zero, else the smallest J_dl. Ties go to the earliest candidate, in whatever order results
-- arrive. With ADVANCES the best candidates of the root go on to second_level.
--
-- Formats: see mpdcc_types.
-- Latency: 21 clocks from start to valid for a held position, 28 with the paper's explorers; a
-- search at most 112, 82, 73, 70 with one, two, three, more explorers, whatever they find; with the
-- paper's 62 + 22 * (63 / EXPLORERS) + 63 mod EXPLORERS. One decision at a time.
-- With two_switchings (SESE, SECOND_LEVEL) a search takes at most 3470, 1928, 1755 with one to three
-- explorers and 1191 with more; compensate adds 30 clocks to a hold and 33 to a search.
-- Overflow: saturation of a common term, or of the chosen candidate's weight, is flagged with the
-- decision.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.anpc5l_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.mpdcc_types.all;

entity mpdcc_scheduler is
  generic (
    EXPLORERS    : positive range 1 to 8 := 2;     -- number of explorers
    FOLDED       : boolean               := false; -- true: the paper's explorers, false: the fast ones
    SECOND_LEVEL : boolean               := false  -- true: fast variant with SESE and delay compensation
  );
  port (
    clk             : in    std_logic;                                                          -- rising edge
    rst             : in    std_logic; -- synchronous, active high
    start           : in    std_logic; -- '1' for one clock: decide; ignored while busy
    measurement     : in    measurement_t;                                                      -- sampled with start
    previous        : in    positions_t; -- s(k-1), sampled with start
    limits          : in    limits_t; -- bounds and horizon, stable
    coefficients : in std_logic_vector(COEFFICIENT_COUNT * COEFFICIENT_WIDTH - 1 downto 0); -- FACTOR_* order, stable
    valid           : out   std_logic; -- '1' for one clock: decision is new
    decision        : out   decision_t; -- stable until the next valid
    busy            : out   std_logic; -- '1': a decision is under way
    node            : out   node_t;                                                             -- to every explorer
    band            : out   band_t; -- to every fast explorer
    capacitor       : out   capacitor_t; -- to every fast explorer
    last            : out   std_logic; -- to every explorer: no candidate of this node is left
    best_valid      : out   std_logic; -- to every explorer: J_dl is not needed any more
    best_cost       : out   cost_t; -- to every explorer, valid with best_valid
    candidate_valid : out   std_logic_vector(EXPLORERS - 1 downto 0); -- one-hot: who takes candidate
    candidate_ready : in    std_logic_vector(EXPLORERS - 1 downto 0); -- '1': explorer is free
    candidate       : out   candidate_t;                                                        -- to every explorer
    probe_done      : in    std_logic; -- explorer 0 answers the probe
    probe_held      : in    std_logic; -- '1': step one stays inside every bound
    result_valid    : in    std_logic_vector(EXPLORERS - 1 downto 0); -- '1': explorer has a result
    result_ready    : out   std_logic_vector(EXPLORERS - 1 downto 0); -- one-hot: whose result is taken
    results         : in    results_t(0 to EXPLORERS - 1);                                      -- of every explorer
    explorer_busy   : in    std_logic_vector(EXPLORERS - 1 downto 0); -- '1': work is under way
    -- SECOND_LEVEL alone; without it the first and the third have to be '0'
    two_switchings  : in    std_logic; -- '1': SESE, '0': SE; stable, as the next two
    budget          : in    unsigned(BUDGET_WIDTH - 1 downto 0); -- candidates, 0: no limit
    compensate      : in    std_logic; -- '1': decide for k+1 from the state predicted under s(k-1)
    evaluated       : in    evaluated_t; -- by explorer 0
    leaf_valid      : out   std_logic_vector(EXPLORERS - 1 downto 0); -- '1': leaf of this explorer is valid
    leaf            : out   leaves_t(0 to EXPLORERS - 1); -- one to each explorer
    reached         : out   reached_t -- to every explorer: how the node of the leaves was reached
  );
end entity mpdcc_scheduler;

architecture rtl of mpdcc_scheduler is

  type phase_t is (IDLE, PREPARE, AWAIT, PREDICTING, SEARCH, LEAVES, FINISH);

  type state_t is record
    phase     : phase_t;
    started   : std_logic; -- first clock of the search is over
    any       : std_logic; -- best holds a result
    best      : result_t;
    predicted : std_logic; -- the node is that of k+1
    valid     : std_logic;
    decision  : decision_t;
  end record state_t;

  constant STATE_INIT : state_t := (
    phase     => IDLE,
    started   => '0',
    any       => '0',
    best      => RESULT_INIT,
    predicted => '0',
    valid     => '0',
    decision  => DECISION_INIT
  );

  -- '1' for the lowest set bit only
  function first_of (bits : std_logic_vector) return std_logic_vector is

    variable result : std_logic_vector(bits'range);
    variable found  : std_logic;

  begin

    found := '0';

    for i in bits'low to bits'high loop
      result(i) := bits(i) and not found;
      found     := found or bits(i);
    end loop;

    return result;

  end function first_of;

  -- the decision to hold s(k-1)
  function kept (before : positions_t; saturated : std_logic) return decision_t is

    variable result : decision_t;

  begin

    result.position  := before;
    result.held      := '1';
    result.deadlock  := '0';
    result.length    := (others => '0');
    result.saturated := saturated;
    result.exhausted := '0';
    return result;

  end function kept;

  -- the decision for a candidate
  function decided (
    best      : result_t;
    before    : positions_t;
    saturated : std_logic;
    exhausted : std_logic
  ) return decision_t is

    variable result : decision_t;

  begin

    for x in 0 to 2 loop
      result.position(x) := next_position(before(x), choice_of(best.index, x));
    end loop;

    result.held      := '0';
    result.deadlock  := not best.feasible;
    result.length    := best.length;
    result.saturated := saturated or best.saturated;
    result.exhausted := exhausted;
    return result;

  end function decided;

  -- whether successors of a node are searched at all
  constant ADVANCES : boolean := SECOND_LEVEL and not FOLDED;

  signal r : state_t;

  signal sample   : measurement_t;
  signal s_before : positions_t;
  signal signals  : std_logic_vector(SIGNAL_COUNT * OPERAND_WIDTH - 1 downto 0);
  signal speeds   : std_logic_vector(2 * COEFFICIENT_WIDTH - 1 downto 0);
  signal negative : std_logic_vector(2 downto 0);

  signal terms_start     : std_logic;
  signal terms_issued    : std_logic;
  signal terms_charged   : std_logic;
  signal terms_done      : std_logic;
  signal ask             : std_logic;
  signal lines_held      : std_logic;
  signal lines_ready     : std_logic;
  signal terms_saturated : std_logic;
  signal terms_node      : node_t;

  signal enumerate_start : std_logic;
  signal enumerate_valid : std_logic;
  signal enumerate_ready : std_logic;
  signal enumerate_done  : std_logic;
  signal enumerated      : candidate_t;

  -- the second level
  signal level       : level_phase_t;
  signal advance     : std_logic;
  signal advanced    : std_logic;
  signal overflowed  : std_logic;
  signal error_ahead : trajectories_t;
  signal words       : words_t;
  signal base        : base_words_t;
  signal lengths     : signed_lengths_t;
  signal slope_ahead : plane_t;
  signal show_slope  : std_logic;
  signal show_error  : std_logic;
  signal show_turn   : std_logic;
  signal start_lines : std_logic;
  signal successor   : std_logic;
  signal line_bank   : std_logic;
  signal start_turn  : std_logic;
  signal settle      : std_logic; -- the node of k+1 is complete
  signal unfit       : std_logic; -- '1': the state of k+1 does not fit its words and is not predicted
  signal ahead_flag  : std_logic; -- '1': a value of the node of k+1 saturated
  signal whole       : std_logic; -- '1': a leaf of the root is evaluated
  signal over        : std_logic; -- no more leaves will come
  signal cut         : std_logic; -- the budget has run out

  signal two_levels    : std_logic; -- '1': SESE
  signal whole_arrives : std_logic; -- '1': SESE, and a leaf of the root is evaluated
  signal decision_flag : std_logic;

  -- events of Algorithm 1, each '1' for one clock
  signal predict     : std_logic; -- take the node on to k+1
  signal hold        : std_logic; -- s(k-1) is kept
  signal opened      : std_logic; -- the root has a feasible candidate: on to the second level
  signal stopped     : std_logic; -- it has none: deadlock
  signal searched    : std_logic; -- everything is compared
  signal explorers_idle : std_logic;

  signal take     : std_logic_vector(EXPLORERS - 1 downto 0);
  signal taken    : std_logic;
  signal incoming : result_t;
  signal arrived  : std_logic; -- '1': a result waits in the register
  signal arrival  : result_t;  -- the result to compare
  signal compare  : std_logic; -- '1': compare it

begin

  assert not (FOLDED and SECOND_LEVEL)
    report "mpdcc_scheduler: SECOND_LEVEL needs the fast explorer, FOLDED = false"
    severity failure;

  p_sample : process (clk) is
  begin

    if rising_edge(clk) then
      if (start = '1' and r.phase = IDLE) then
        sample   <= measurement;
        s_before <= previous;
      end if;
    end if;

  end process p_sample;

  ---------------------------------------------------------------------------------------------
  -- Common terms
  ---------------------------------------------------------------------------------------------

  p_signals : process (sample) is

    variable bus_words : std_logic_vector(SIGNAL_COUNT * OPERAND_WIDTH - 1 downto 0);

    procedure put (index : natural; value : signed) is
    begin

      bus_words((index + 1) * OPERAND_WIDTH - 1 downto index * OPERAND_WIDTH) :=
        std_logic_vector(resize(value, OPERAND_WIDTH));

    end procedure put;

    -- difference of two voltages that puts v_dc/4 - v_ph at twice the scale of v_ph
    function difference (v_dc, v_ph : unsigned) return signed is
    begin

      return signed(resize(v_dc, OPERAND_WIDTH)) - signed(shift_left(resize(v_ph, OPERAND_WIDTH), 1));

    end function difference;

  begin

    bus_words := (others => '0');
    put(OPERAND_IS_ALPHA, sample.is_alpha);
    put(OPERAND_IS_BETA, sample.is_beta);
    put(OPERAND_PSIR_ALPHA, sample.psir_alpha);
    put(OPERAND_PSIR_BETA, sample.psir_beta);
    put(OPERAND_V_N, sample.v_n);
    put(OPERAND_V_PH_A, signed(resize(sample.v_ph_a, OPERAND_WIDTH)));
    put(OPERAND_V_PH_B, signed(resize(sample.v_ph_b, OPERAND_WIDTH)));
    put(OPERAND_V_PH_C, signed(resize(sample.v_ph_c, OPERAND_WIDTH)));
    put(OPERAND_V_DC, signed(resize(sample.v_dc, OPERAND_WIDTH)));
    put(OPERAND_IREF_ALPHA, sample.iref_alpha);
    put(OPERAND_IREF_BETA, sample.iref_beta);
    put(OPERAND_DIFFERENCE_ALPHA, resize(sample.iref_alpha, OPERAND_WIDTH) - sample.is_alpha);
    put(OPERAND_DIFFERENCE_BETA, resize(sample.iref_beta, OPERAND_WIDTH) - sample.is_beta);
    put(OPERAND_DIFFERENCE_A, difference(sample.v_dc, sample.v_ph_a));
    put(OPERAND_DIFFERENCE_B, difference(sample.v_dc, sample.v_ph_b));
    put(OPERAND_DIFFERENCE_C, difference(sample.v_dc, sample.v_ph_c));
    signals   <= bus_words;

  end process p_signals;

  speeds <= std_logic_vector(sample.omega_r) & std_logic_vector(sample.omega_s);

  i_common_terms : entity work.common_terms
    generic map (
      FOLDED       => FOLDED,
      SECOND_LEVEL => SECOND_LEVEL
    )
    port map (
      clk          => clk,
      rst          => rst,
      start        => terms_start,
      signals      => signals,
      speeds       => speeds,
      coefficients => coefficients,
      issued       => terms_issued,
      capacitors   => terms_charged,
      done         => terms_done,
      node         => terms_node,
      saturated    => terms_saturated,
      advance      => advance,
      lengths      => lengths,
      base         => base,
      slope_ahead  => slope_ahead,
      show_slope   => show_slope,
      show_error   => show_error,
      advanced     => advanced,
      overflowed   => overflowed,
      error_ahead  => error_ahead,
      words        => words
    );

  level.idle       <= to_std_logic(r.phase = IDLE);
  level.probing    <= to_std_logic(r.phase = AWAIT) and not r.predicted;
  level.predicting <= to_std_logic(r.phase = PREDICTING);
  level.leaves     <= to_std_logic(r.phase = LEAVES);

  g_one_level : if not ADVANCES generate
    node        <= terms_node;
    reached     <= REACHED_INIT;
    leaf_valid  <= (others => '0');
    leaf        <= (others => LEAF_INIT);
    advance     <= '0';
    lengths     <= (others => '0');
    base        <= (others => '0');
    slope_ahead <= (others => (others => '0'));
    show_slope  <= '0';
    show_error  <= '0';
    show_turn   <= '1';
    start_lines <= terms_charged;
    successor   <= '0';
    line_bank   <= '0';
    start_turn  <= terms_done;
    settle      <= '0';
    unfit       <= '0';
    ahead_flag  <= '0';
    whole       <= '0';
    over        <= '1';
    cut         <= '0';
  end generate g_one_level;

  g_two_levels : if ADVANCES generate

    i_level : entity work.second_level
      generic map (
        EXPLORERS => EXPLORERS
      )
      port map (
        clk         => clk,
        rst         => rst,
        phase       => level,
        predict     => predict,
        previous    => s_before,
        negative    => negative,
        horizon     => limits.horizon,
        budget      => budget,
        evaluated   => evaluated,
        done        => terms_done,
        charged     => terms_charged,
        advanced    => advanced,
        overflowed  => overflowed,
        node        => terms_node,
        words       => words,
        advance     => advance,
        lengths     => lengths,
        base        => base,
        slope_ahead => slope_ahead,
        show_slope  => show_slope,
        show_error  => show_error,
        start_lines => start_lines,
        successor   => successor,
        bank        => line_bank,
        start_turn  => start_turn,
        show_turn   => show_turn,
        shown       => node,
        reached     => reached,
        leaf_valid  => leaf_valid,
        leaf        => leaf,
        settle      => settle,
        unfit       => unfit,
        saturated   => ahead_flag,
        whole       => whole,
        over        => over,
        cut         => cut
      );

  end generate g_two_levels;

  g_paper : if FOLDED generate
    ask        <= terms_done;
    lines_held  <= '1';
    lines_ready <= '1';

    -- the paper's explorers look at capacitors themselves and have no use for these
    band.first       <= (others => (others => '0'));
    band.margin_up   <= (others => (others => '0'));
    band.margin_down <= (others => (others => '0'));
    band.outside     <= (others => '0');
    band.turn        <= (others => (others => '0'));
    band.previous    <= s_before;
    band.negative    <= negative;
    capacitor.write  <= '0';
    capacitor.row    <= (others => '0');
    capacitor.length <= (others => '0');
    capacitor.excess <= (others => '0');
    capacitor.bank   <= '0';
  end generate g_paper;

  g_fast : if not FOLDED generate
    -- the probe needs the node a few stages down its pipeline
    ask <= terms_issued;

    i_preparation : entity work.node_preparation
      generic map (
        SECOND_LEVEL => ADVANCES
      )
      port map (
        clk             => clk,
        rst             => rst,
        capacitors_done => start_lines,
        limits          => limits,
        node            => terms_node,
        previous        => s_before,
        negative        => negative,
        error_ahead     => error_ahead,
        turn_start      => start_turn,
        show_turn       => show_turn,
        successor       => successor,
        bank            => line_bank,
        band            => band,
        capacitor       => capacitor,
        ready           => lines_ready,
        held            => lines_held
      );

  end generate g_fast;

  decision_flag <= terms_saturated or ahead_flag or (compensate and unfit and not r.predicted);
  two_levels    <= two_switchings and to_std_logic(ADVANCES);
  whole_arrives <= whole and two_levels;

  ---------------------------------------------------------------------------------------------
  -- Enumeration
  ---------------------------------------------------------------------------------------------

  -- the capacitor-current terms carry the signs of the phase currents
  g_signs : for x in 0 to 2 generate
    negative(x) <= terms_node.phase_current(x)(CURRENT_TERM_WIDTH - 1);
  end generate g_signs;

  i_enumerator : entity work.candidate_enumerator
    generic map (
      BLOCKS => not FOLDED
    )
    port map (
      clk       => clk,
      rst       => rst,
      start     => enumerate_start,
      previous  => s_before,
      negative  => negative,
      valid     => enumerate_valid,
      ready     => enumerate_ready,
      candidate => enumerated,
      done      => enumerate_done
    );

  ---------------------------------------------------------------------------------------------
  -- Collection: one result a clock, the lowest-numbered explorer first
  ---------------------------------------------------------------------------------------------

  take         <= first_of(result_valid);
  result_ready <= take;

  p_collect : process (take, results) is
  begin

    incoming <= results(0);

    for i in 1 to EXPLORERS - 1 loop
      if (take(i) = '1') then
        incoming <= results(i);
      end if;
    end loop;

  end process p_collect;

  taken <= to_std_logic(take /= (take'range => '0'));

  -- a register between the explorers' results and the comparison: the fast variant's clock needs it
  g_registered : if not FOLDED generate

    p_arrived : process (clk) is
    begin

      if rising_edge(clk) then
        arrived <= taken;
        arrival <= incoming;

        -- leaves of the root come one by one, before its result; of the others' none may be feasible
        if (two_levels = '1') then
          arrived <= whole_arrives or (taken and incoming.feasible and to_std_logic(r.phase = LEAVES));
        end if;

        if (whole_arrives = '1') then
          arrival.feasible  <= '1';
          arrival.saturated <= evaluated.saturated;
          arrival.index     <= evaluated.index;
          arrival.length    <= evaluated.length;
          arrival.rank      <= resize(evaluated.cost, RANK_WIDTH);
        end if;

        if (rst = '1') then
          arrived <= '0';
        end if;
      end if;

    end process p_arrived;

    compare <= arrived;

  end generate g_registered;

  g_direct : if FOLDED generate
    arrived <= '0';
    arrival <= incoming;
    compare <= taken;
  end generate g_direct;

  ---------------------------------------------------------------------------------------------
  -- Algorithm 1
  ---------------------------------------------------------------------------------------------

  explorers_idle <= to_std_logic(explorer_busy = (explorer_busy'range => '0'));

  predict <= to_std_logic(ADVANCES and r.phase = AWAIT) and probe_done and compensate and not unfit
             and not r.predicted;
  hold    <= to_std_logic(r.phase = AWAIT) and probe_done and not predict and probe_held and lines_held;
  opened  <= to_std_logic(r.phase = SEARCH) and two_levels and taken and incoming.feasible;
  stopped <= to_std_logic(r.phase = SEARCH) and two_levels and taken and not incoming.feasible;

  -- the enumerator still shows the last search's end in the first clock; what arrived is compared
  -- now, and what has not is busy
  searched <= r.started and explorers_idle
              and ((to_std_logic(r.phase = SEARCH) and not two_levels and enumerate_done)
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
          elsif (probe_done = '1') then
            r.phase <= SEARCH;
          end if;

        when PREDICTING =>

          if (settle = '1') then
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

  p_best : process (clk) is
  begin

    if rising_edge(clk) then
      if (compare = '1' and (r.any = '0' or better(arrival, r.best) = '1')) then
        r.best <= arrival;
        r.any  <= '1';
      end if;

      -- the first level's decision, for want of a leaf
      if (opened = '1' and r.any = '0') then
        r.best <= incoming;
      end if;

      if (r.phase = IDLE) then
        r.any           <= '0';
        r.best.feasible <= '0';
      end if;
    end if;

  end process p_best;

  p_decision : process (clk) is
  begin

    if rising_edge(clk) then
      r.valid <= hold or stopped or to_std_logic(r.phase = FINISH);

      if (hold = '1') then
        r.decision <= kept(s_before, decision_flag);
      end if;

      if (stopped = '1') then
        r.decision <= decided(incoming, s_before, decision_flag, '0');
      end if;

      if (r.phase = FINISH) then
        r.decision <= decided(r.best, s_before, decision_flag, cut);
      end if;

      if (rst = '1') then
        r.valid <= STATE_INIT.valid;
      end if;
    end if;

  end process p_decision;

  ---------------------------------------------------------------------------------------------
  -- Candidates to the explorers: the probe, then what is enumerated
  ---------------------------------------------------------------------------------------------

  terms_start     <= to_std_logic(r.phase = IDLE) and start;
  enumerate_start <= to_std_logic(r.phase = AWAIT) and probe_done and not predict and not hold;

  p_candidate : process (r, ask, settle, s_before, enumerated, enumerate_valid, lines_ready, candidate_ready,
                         two_levels) is
  begin

    enumerate_ready <= '0';
    candidate_valid <= (others => '0');
    candidate       <= enumerated;

    if ((r.phase = PREPARE and ask = '1') or (r.phase = PREDICTING and settle = '1')) then
      candidate_valid(0) <= '1';
    end if;

    if (r.phase = SEARCH and enumerate_valid = '1' and lines_ready = '1') then
      candidate_valid <= first_of(candidate_ready);
      enumerate_ready <= to_std_logic(candidate_ready /= (candidate_ready'range => '0'));

      -- one explorer alone, so that the queue takes one candidate a clock
      if (two_levels = '1') then
        candidate_valid    <= (others => '0');
        candidate_valid(0) <= candidate_ready(0);
        enumerate_ready    <= candidate_ready(0);
      end if;
    end if;

    if (r.phase = PREPARE or r.phase = AWAIT or r.phase = PREDICTING) then
      candidate <= (
        probe    => '1',
        index    => (others => '0'),
        position => s_before,
        effort   => (others => '0')
      );
    end if;

  end process p_candidate;

  last       <= (to_std_logic(r.phase = SEARCH) and r.started and enumerate_done)
                or (to_std_logic(r.phase = LEAVES) and r.started and over);
  best_valid <= r.best.feasible;
  best_cost  <= resize(r.best.rank, COST_WIDTH);
  valid      <= r.valid;
  decision   <= r.decision;
  busy       <= to_std_logic(r.phase /= IDLE);

end architecture rtl;
