-- Central scheduler (Paper A, Section V, Algorithm 1).
--
-- Samples the measurements, has the common terms computed, asks an explorer whether s(k-1) keeps
-- every output inside its bound for one more step, and if not hands every candidate to the first
-- free explorer and keeps the best result: smallest J where some length is above zero, else the
-- smallest J_dl; ties go to the earliest candidate, in whatever order results arrive.
--
-- Formats: see mpdcc_types.
-- Latency: 21 clocks from start to valid for a held position, 28 with the paper's explorers; a
-- search at most 112, 82, 73, 70 with one, two, three, more explorers, whatever they find; with the
-- paper's 62 + 22 * (63 / EXPLORERS) + 63 mod EXPLORERS. One decision at a time.
-- With two_switchings (SESE, SECOND_LEVEL) a search takes at most 3470, 1928, 1755 with one to three
-- explorers and 1191 with more; compensate adds 30 clocks to a hold and 33 to a search.
-- Overflow: saturation of a common term, or of the chosen candidate's weight, is flagged with the
-- decision.
-- Weighed, not built (figures estimated): starting the enumeration before the probe is answered saves 12 clocks of a
-- search and costs a cancellation through every explorer.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
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

  type phase_t is (IDLE, PREPARE, AWAIT, PREDICT, SEARCH, LEAVES, FINISH);

  type state_t is record
    phase     : phase_t;
    started   : std_logic; -- first clock of the search is over
    any       : std_logic; -- best holds a result
    best      : result_t;
    predicted : std_logic; -- the node is that of k+1
    cut       : std_logic; -- the budget has run out
    left      : unsigned(BUDGET_WIDTH - 1 downto 0); -- candidates of the second level
    pending   : natural range 0 to 2; -- nodes begun but not handed out
    cool      : std_logic; -- the next node may begin
    ripe      : std_logic; -- the first of them may be handed out
    bank      : std_logic; -- table of the capacitors for the next node
    valid     : std_logic;
    decision  : decision_t;
  end record state_t;

  constant STATE_INIT : state_t := (
    phase    => IDLE,
    started  => '0',
    any      => '0',
    best     => RESULT_INIT,
    predicted => '0',
    cut       => '0',
    left      => (others => '0'),
    pending   => 0,
    cool      => '1',
    ripe      => '0',
    bank      => '0',
    valid    => '0',
    decision => DECISION_INIT
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

  function decided (
    best      : result_t;
    before    : positions_t;
    saturated : std_logic
  ) return decision_t is

    variable result : decision_t;

  begin

    for x in 0 to 2 loop
      result.position(x) := next_position(before(x), best.index(5 - 2 * x downto 4 - 2 * x));
    end loop;

    result.held      := '0';
    result.deadlock  := not best.feasible;
    result.length    := best.length;
    result.saturated := saturated or best.saturated;
    result.exhausted := '0';
    return result;

  end function decided;

  -- whether successors of a node are searched at all
  constant ADVANCES : boolean := SECOND_LEVEL and not FOLDED;

  -- clocks from the begin of a successor's program: its capacitor terms are complete two clocks
  -- later, the queue may show the next entry, the errors are complete, the first leaf may be loaded,
  -- the next program may begin one clock later
  constant CAPACITORS_AT : natural := 12;
  constant TAKEN_AT      : natural := 13;
  constant TURN_AT       : natural := 18;
  constant RIPE_AT       : natural := 24;
  constant COOL_AT       : natural := 15;

  -- a node from its begin to its leaves
  type visit_t is record
    index    : unsigned(INDEX_WIDTH - 1 downto 0);
    position : positions_t;
    effort   : unsigned(EFFORT_WIDTH - 1 downto 0);
    length   : length_t;
    bank     : std_logic;
  end record visit_t;

  -- candidates that follow a position: 27, 36, 48 or 64
  function candidates_of (position : positions_t) return unsigned is

    variable fours : unsigned(1 downto 0);

  begin

    fours := "00";

    for x in 0 to 2 loop
      if (NEXT_LAST(to_integer(position(x))) = 3) then
        fours := fours + 1;
      end if;
    end loop;

    case fours is

      when "00" =>

        return to_unsigned(27, BUDGET_WIDTH);

      when "01" =>

        return to_unsigned(36, BUDGET_WIDTH);

      when "10" =>

        return to_unsigned(48, BUDGET_WIDTH);

      when others =>

        return to_unsigned(64, BUDGET_WIDTH);

    end case;

  end function candidates_of;

  signal r      : state_t;
  signal r_next : state_t;

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
  signal advance         : std_logic;
  signal advanced        : std_logic;
  signal overflowed      : std_logic;
  signal error_ahead     : trajectories_t;
  signal words           : words_t;
  signal base            : base_words_t;
  signal lengths         : signed_lengths_t;
  signal base_unfit      : std_logic;
  signal unfit           : std_logic; -- '1': the state of k+1 does not fit its words and is not predicted
  signal slope_ahead     : plane_t;
  signal keep            : std_logic;
  signal settle          : std_logic; -- the node of k+1 is complete
  signal show_slope      : std_logic;
  signal show_error      : std_logic;
  signal slope_now       : std_logic;
  signal error_now       : std_logic;
  signal follow          : std_logic;
  signal two_levels      : std_logic; -- '1': SESE
  signal whole_arrives   : std_logic; -- '1': a leaf of the root is evaluated
  signal capacitors_go   : std_logic;
  signal turn_go         : std_logic;
  signal turn_now        : std_logic;
  signal visit_bank      : std_logic;
  signal since           : std_logic_vector(1 to RIPE_AT); -- clocks since the begin
  signal visit_position  : positions_t;                    -- of the node begun last
  signal visit_table     : std_logic;                      -- and its table of the capacitors
  signal visit_steps     : length_t;                       -- and its L1
  signal waiting         : visit_t;                        -- handed out next
  signal lead            : length_t;                       -- of the node handed out last
  signal flagged         : std_logic;
  signal start_unfit     : std_logic;
  signal advanced_late   : std_logic;
  signal predicted_flag  : std_logic;
  signal decision_flag   : std_logic;
  signal queue_clear     : std_logic;
  signal queue_open      : std_logic;
  signal queue_whole     : std_logic;
  signal queue_valid     : std_logic;
  signal queue_entry     : entry_t;
  signal queue_taken     : std_logic;
  signal queue_empty     : std_logic;
  signal load            : std_logic;
  signal launch          : std_logic;
  signal leaves_ready    : std_logic;
  signal leaves_ending   : std_logic;
  signal leaves_active   : std_logic;
  signal over            : std_logic; -- no more leaves will come

  signal take     : std_logic_vector(EXPLORERS - 1 downto 0);
  signal taken    : std_logic;
  signal incoming : result_t;
  signal arrived  : std_logic; -- '1': a result waits in the register
  signal arrival  : result_t;  -- the result to compare
  signal compare  : std_logic; -- '1': compare it

begin

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
      show_slope   => slope_now,
      show_error   => error_now,
      advanced     => advanced,
      overflowed   => overflowed,
      error_ahead  => error_ahead,
      words        => words
    );

  g_one_level : if not ADVANCES generate
    node <= terms_node;

    leaf_valid     <= (others => '0');
    leaf           <= (others => LEAF_INIT);
    reached        <= REACHED_INIT;
    base           <= (others => '0');
    slope_ahead    <= (others => (others => '0'));
    slope_now      <= '0';
    error_now      <= '0';
    turn_now       <= '1';
    capacitors_go  <= terms_charged;
    turn_go        <= terms_done;
    queue_whole    <= '0';
    queue_valid    <= '0';
    queue_entry    <= ENTRY_INIT;
    queue_empty    <= '1';
    leaves_ready   <= '1';
    leaves_ending  <= '1';
    leaves_active  <= '0';
    settle         <= '0';
    predicted_flag <= '0';
    unfit          <= '0';
    since          <= (others => '0');
    lengths        <= (others => '0');
    visit_bank     <= '0';
  end generate g_one_level;

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
        capacitors_done => capacitors_go,
        limits          => limits,
        node            => terms_node,
        previous        => s_before,
        negative        => negative,
        error_ahead     => error_ahead,
        turn_start      => turn_go,
        show_turn       => turn_now,
        successor       => since(CAPACITORS_AT),
        bank            => visit_bank,
        band            => band,
        capacitor       => capacitor,
        ready           => lines_ready,
        held            => lines_held
      );

  end generate g_fast;

  g_two_levels : if ADVANCES generate
    -------------------------------------------------------------------------------------------
    -- Second level: the node that common_terms holds is kept, and taken on to each successor
    -------------------------------------------------------------------------------------------

    follow        <= to_std_logic(r.phase /= LEAVES);
    settle        <= advanced and to_std_logic(r.phase = PREDICT);
    keep          <= terms_done or settle;
    unfit         <= base_unfit or start_unfit;
    slope_now     <= show_slope or settle;
    error_now     <= show_error or settle;
    turn_now      <= show_error or follow;
    capacitors_go <= terms_charged or settle or (since(CAPACITORS_AT) and not follow);
    turn_go       <= terms_done or settle or (since(TURN_AT) and not follow);
    visit_bank    <= visit_table and not follow;
    visit_steps   <= queue_entry.length when follow = '0' else
                     to_unsigned(1, LENGTH_WIDTH);
    queue_taken   <= since(TAKEN_AT) and not follow;

    i_base : entity work.node_base
      port map (
        clk         => clk,
        keep        => keep,
        words       => words,
        position    => visit_position,
        steps       => visit_steps,
        slope       => queue_entry.slope,
        base        => base,
        lengths     => lengths,
        slope_ahead => slope_ahead,
        unfit       => base_unfit
      );

    i_queue : entity work.node_queue
      port map (
        clk       => clk,
        rst       => rst,
        clear     => queue_clear,
        open_root => follow,
        evaluated => evaluated,
        horizon   => limits.horizon,
        previous  => s_before,
        whole     => queue_whole,
        valid     => queue_valid,
        entry     => queue_entry,
        taken     => queue_taken,
        empty     => queue_empty
      );

    p_visits : process (clk) is
    begin

      if rising_edge(clk) then
        since <= advance & since(1 to RIPE_AT - 1);

        if (advance = '1') then
          visit_position <= queue_entry.position;
          visit_table    <= r.bank;

          if (follow = '1') then
            visit_position <= s_before;
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
          flagged <= overflowed;
        end if;

        if (evaluated.slope_valid = '1' and r.phase = AWAIT and r.predicted = '0') then
          start_unfit <= evaluated.unfit;
        end if;

        advanced_late <= settle;

        if (advanced_late = '1') then
          predicted_flag <= overflowed;
        end if;

        if (r.phase = IDLE) then
          predicted_flag <= '0';
        end if;

        if (rst = '1') then
          since         <= (others => '0');
          advanced_late <= '0';
        end if;
      end if;

    end process p_visits;

    i_leaves : entity work.leaf_dispatcher
      generic map (
        EXPLORERS => EXPLORERS
      )
      port map (
        clk        => clk,
        rst        => rst,
        load       => load,
        position   => waiting.position,
        effort     => waiting.effort,
        negative   => negative,
        bank       => waiting.bank,
        index      => waiting.index,
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
        node       => terms_node,
        words      => words,
        lead       => lead,
        saturated  => flagged,
        shown      => node,
        reached    => reached,
        show_slope => show_slope,
        show_error => show_error
      );

  end generate g_two_levels;

  decision_flag <= terms_saturated or predicted_flag or (compensate and unfit and not r.predicted);
  two_levels    <= two_switchings and to_std_logic(ADVANCES);
  whole_arrives <= queue_whole and two_levels;

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

  over <= to_std_logic(r.pending = 0) and not leaves_active and (r.cut or queue_empty);

  p_next : process (r, start, ask, lines_held, lines_ready, decision_flag, candidate_ready, probe_done, probe_held,
                    s_before, enumerate_valid, enumerate_done, enumerated, taken, arrival, compare, incoming,
                    explorer_busy, two_levels, compensate, unfit, budget, settle, since, queue_valid,
                    queue_entry, leaves_ready, leaves_ending, over) is

    variable v     : state_t;
    variable wants : unsigned(BUDGET_WIDTH - 1 downto 0);
    variable rest  : unsigned(BUDGET_WIDTH downto 0);

  begin

    v               := r;
    v.valid         := '0';
    rest            := (others => '0');
    v.started       := to_std_logic(r.phase = SEARCH or r.phase = LEAVES);
    terms_start     <= '0';
    enumerate_start <= '0';
    enumerate_ready <= '0';
    candidate_valid <= (others => '0');
    candidate       <= enumerated;
    advance         <= '0';
    queue_clear     <= '0';
    load            <= '0';

    if (compare = '1' and (r.any = '0' or better(arrival, r.best) = '1')) then
      v.best := arrival;
      v.any  := '1';
    end if;

    case r.phase is

      when IDLE =>

        v.any           := '0';
        v.best.feasible := '0';
        v.predicted     := '0';
        v.cut           := '0';
        v.cool          := '1';
        v.bank          := '0';
        queue_clear     <= '1';

        if (start = '1') then
          v.phase     := PREPARE;
          terms_start <= '1';
        end if;

      when PREPARE =>

        if (ask = '1') then
          candidate_valid(0) <= '1';
          v.phase            := AWAIT;
        end if;

      when AWAIT =>

        if (probe_done = '1') then
          if (ADVANCES and compensate = '1' and unfit = '0' and r.predicted = '0') then
            advance     <= '1';
            v.predicted := '1';
            v.phase     := PREDICT;
          elsif (probe_held = '1' and lines_held = '1') then
            v.phase              := IDLE;
            v.valid              := '1';
            v.decision.position  := s_before;
            v.decision.held      := '1';
            v.decision.deadlock  := '0';
            v.decision.length    := (others => '0');
            v.decision.saturated := decision_flag;
            v.decision.exhausted := '0';
          else
            v.phase         := SEARCH;
            enumerate_start <= '1';
          end if;
        end if;

      when PREDICT =>

        if (settle = '1') then
          candidate_valid(0) <= '1';
          v.phase            := AWAIT;
        end if;

      when SEARCH =>

        if (enumerate_valid = '1' and lines_ready = '1') then
          candidate_valid <= first_of(candidate_ready);
          enumerate_ready <= to_std_logic(candidate_ready /= (candidate_ready'range => '0'));

          -- one explorer alone, so that the queue takes one candidate a clock
          if (two_levels = '1') then
            candidate_valid    <= (others => '0');
            candidate_valid(0) <= candidate_ready(0);
            enumerate_ready    <= candidate_ready(0);
          end if;
        end if;

        if (two_levels = '1') then
          if (taken = '1' and incoming.feasible = '1') then
            v.phase   := LEAVES;
            v.started := '0';
            v.left    := budget;

            -- the first level's decision, for want of a leaf
            if (r.any = '0') then
              v.best := incoming;
            end if;
          elsif (taken = '1') then
            v.phase    := IDLE;
            v.valid    := '1';
            v.decision := decided(incoming, s_before, decision_flag);
          end if;
        elsif (r.started = '1' and enumerate_done = '1' and explorer_busy = (explorer_busy'range => '0')) then
          -- the enumerator still shows the last search's end in the first clock; what arrived is compared
          -- now, and what has not is busy
          v.phase := FINISH;
        end if;

      when LEAVES =>

        wants := candidates_of(queue_entry.position);

        if (since(COOL_AT) = '1') then
          v.cool := '1';
        end if;

        if (since(RIPE_AT) = '1') then
          v.ripe := '1';
        end if;

        -- hand out the first node that is complete
        if ((r.ripe = '1' or since(RIPE_AT) = '1') and leaves_ready = '1') then
          load      <= '1';
          v.ripe    := '0';
          v.pending := v.pending - 1;
        end if;

        -- begin with the next while its predecessor's words are still needed for eight clocks at most
        if (queue_valid = '1' and r.cut = '0' and r.cool = '1'
            and (r.pending = 0 or (r.pending = 1 and leaves_ending = '1'))) then
          rest := ('0' & r.left) - wants;

          if (budget /= 0 and rest(BUDGET_WIDTH) = '1') then
            v.cut := '1';
          else
            advance     <= '1';
            v.left      := rest(BUDGET_WIDTH - 1 downto 0);
            v.pending   := v.pending + 1;
            v.cool      := '0';
            v.bank      := not r.bank;
          end if;
        end if;

        if (r.started = '1' and over = '1' and explorer_busy = (explorer_busy'range => '0')) then
          v.phase := FINISH;
        end if;

      when FINISH =>

        v.phase := IDLE;
        v.valid := '1';

        v.decision           := decided(r.best, s_before, decision_flag);
        v.decision.exhausted := r.cut;

    end case;

    if (r.phase = PREPARE or r.phase = AWAIT or r.phase = PREDICT) then
      candidate <= (
        probe    => '1',
        index    => (others => '0'),
        position => s_before,
        effort   => (others => '0')
      );
    end if;

    r_next <= v;

  end process p_next;

  p_state : process (clk) is
  begin

    if rising_edge(clk) then
      r <= r_next;

      if (rst = '1') then
        r.phase   <= STATE_INIT.phase;
        r.pending <= STATE_INIT.pending;
        r.ripe    <= STATE_INIT.ripe;
        r.valid <= STATE_INIT.valid;
      end if;
    end if;

  end process p_state;

  last       <= (to_std_logic(r.phase = SEARCH) and r.started and enumerate_done)
                or (to_std_logic(r.phase = LEAVES) and r.started and over);
  best_valid <= r.best.feasible;
  best_cost  <= resize(r.best.rank, COST_WIDTH);
  valid      <= r.valid;
  decision   <= r.decision;
  busy       <= to_std_logic(r.phase /= IDLE);

end architecture rtl;
