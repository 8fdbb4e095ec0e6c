-- Central scheduler (Paper A, Section V, Algorithm 1).
--
-- Samples the measurements, has the common terms computed, asks an explorer whether s(k-1) keeps
-- every output inside its bound for one more step, and if not hands every candidate to the first
-- free explorer and keeps the best result: smallest J where some length is above zero, else the
-- smallest J_dl; ties go to the earliest candidate, in whatever order results arrive.
--
-- Formats: see mpdcc_types.
-- Latency: 21 clocks from start to valid for a held position, 28 with the paper's explorers; a
-- search at most 110, 83, 74, 71 with one, two, three, more explorers, whatever they find; with the
-- paper's 62 + 22 * (63 / EXPLORERS) + 63 mod EXPLORERS. One decision at a time.
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
    EXPLORERS : positive range 1 to 8 := 2;    -- number of explorers
    FOLDED    : boolean               := false -- true: the paper's explorers, false: the fast ones
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
    explorer_busy   : in    std_logic_vector(EXPLORERS - 1 downto 0) -- '1': work is under way
  );
end entity mpdcc_scheduler;

architecture rtl of mpdcc_scheduler is

  type phase_t is (IDLE, PREPARE, AWAIT, SEARCH, FINISH);

  type state_t is record
    phase     : phase_t;
    started   : std_logic; -- first clock of the search is over
    any       : std_logic; -- best holds a result
    best      : result_t;
    valid     : std_logic;
    decision  : decision_t;
  end record state_t;

  constant STATE_INIT : state_t := (
    phase    => IDLE,
    started  => '0',
    any      => '0',
    best     => RESULT_INIT,
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
    return result;

  end function decided;

  -- a single fast explorer reports once, so its result is the decision
  constant SINGLE : boolean := EXPLORERS = 1 and not FOLDED;

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
      FOLDED => FOLDED
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
      saturated    => terms_saturated
    );

  node <= terms_node;

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
      port map (
        clk             => clk,
        rst             => rst,
        capacitors_done => terms_charged,
        terms_done      => terms_done,
        limits          => limits,
        node            => terms_node,
        previous        => s_before,
        negative        => negative,
        band            => band,
        capacitor       => capacitor,
        ready           => lines_ready,
        held            => lines_held
      );

  end generate g_fast;

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
  g_registered : if not FOLDED and not SINGLE generate

    p_arrived : process (clk) is
    begin

      if rising_edge(clk) then
        arrived <= taken;

        if (taken = '1') then
          arrival <= incoming;
        end if;

        if (rst = '1') then
          arrived <= '0';
        end if;
      end if;

    end process p_arrived;

    compare <= arrived;

  end generate g_registered;

  g_direct : if FOLDED or SINGLE generate
    arrived <= '0';
    arrival <= incoming;
    compare <= taken;
  end generate g_direct;

  ---------------------------------------------------------------------------------------------
  -- Algorithm 1
  ---------------------------------------------------------------------------------------------

  p_next : process (r, start, ask, lines_held, lines_ready, terms_saturated, candidate_ready, probe_done, probe_held,
                    s_before, enumerate_valid, enumerate_done, enumerated, taken, arrived, arrival, compare, incoming,
                    explorer_busy) is

    variable v : state_t;

  begin

    v               := r;
    v.valid         := '0';
    v.started       := to_std_logic(r.phase = SEARCH);
    terms_start     <= '0';
    enumerate_start <= '0';
    enumerate_ready <= '0';
    candidate_valid <= (others => '0');
    candidate       <= enumerated;

    if (not SINGLE and compare = '1' and (r.any = '0' or better(arrival, r.best) = '1')) then
      v.best := arrival;
      v.any  := '1';
    end if;

    case r.phase is

      when IDLE =>

        v.any           := '0';
        v.best.feasible := '0';

        if (start = '1') then
          v.phase     := PREPARE;
          terms_start <= '1';
        end if;

      when PREPARE =>

        candidate <= (
          probe    => '1',
          index    => (others => '0'),
          position => s_before,
          effort   => (others => '0')
        );

        if (ask = '1') then
          candidate_valid(0) <= '1';
          v.phase            := AWAIT;
        end if;

      when AWAIT =>

        if (probe_done = '1') then
          if (probe_held = '1' and lines_held = '1') then
            v.phase              := IDLE;
            v.valid              := '1';
            v.decision.position  := s_before;
            v.decision.held      := '1';
            v.decision.deadlock  := '0';
            v.decision.length    := (others => '0');
            v.decision.saturated := terms_saturated;
          else
            v.phase         := SEARCH;
            enumerate_start <= '1';
          end if;
        end if;

      when SEARCH =>

        if (enumerate_valid = '1' and lines_ready = '1') then
          candidate_valid <= first_of(candidate_ready);
          enumerate_ready <= to_std_logic(candidate_ready /= (candidate_ready'range => '0'));
        end if;

        if (SINGLE and taken = '1') then
          v.phase    := IDLE;
          v.valid    := '1';
          v.decision := decided(incoming, s_before, terms_saturated);
        end if;

        -- the enumerator still shows the last search's end in the first clock
        if (not SINGLE and r.started = '1' and enumerate_done = '1' and taken = '0' and arrived = '0'
            and explorer_busy = (explorer_busy'range => '0')) then
          v.phase := FINISH;
        end if;

      when FINISH =>

        v.phase              := IDLE;
        v.valid              := '1';
        v.decision := decided(r.best, s_before, terms_saturated);

    end case;

    r_next <= v;

  end process p_next;

  p_state : process (clk) is
  begin

    if rising_edge(clk) then
      r <= r_next;

      if (rst = '1') then
        r.phase <= STATE_INIT.phase;
        r.valid <= STATE_INIT.valid;
      end if;
    end if;

  end process p_state;

  last       <= to_std_logic(r.phase = SEARCH) and r.started and enumerate_done;
  best_valid <= r.best.feasible;
  best_cost  <= r.best.cost;
  valid      <= r.valid;
  decision   <= r.decision;
  busy       <= to_std_logic(r.phase /= IDLE);

end architecture rtl;
