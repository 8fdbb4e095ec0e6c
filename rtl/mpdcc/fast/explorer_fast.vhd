-- The fast explorer: one candidate per clock, second-order trajectories.
--
-- Every quantity of a candidate is a common term of the node plus one contribution per phase, so
-- the pipeline holds additions and comparisons alone, but for the two products of the cost.
--
--   stage 0      here: one candidate of the block, its next position of phase c
--   stage 1-4    candidate_slopes: slopes of the current errors, errors at k+1
--   stage 4-12   length_search: one bit of the length per stage and phase, then the shortest
--   stage 5-9    step_one, beside: length that the capacitors allow, worst excess at k+1; 10 with leaves
--   stage 12-16  candidate_cost: J = f_s / L + (sqrt(lambda_n) * v_n(k+L))**2
--   then         best_of: best so far; as long as nothing is feasible, the least excess of stage 9
--
-- Stages are constants of mpdcc_timing; the numbers above are those of lengths of six bits.
-- Tasks: a probe asks step_one whether s(k-1) keeps the currents inside; any other candidate_t is a
-- block of up to four candidates, all next positions of phase c. Ties go to the earliest candidate.
-- Leaves: candidates of the second level come one a clock past the blocks, as leaf. node and band
-- change in time with the stages (see node_shown), steps and efforts of reached add to the leaf's.
-- Weighted deadlock rule (WEIGHTED_DEADLOCK, chosen with limits.deadlock_rule): see step_one.
-- Rule inwards (INWARDS, chosen with limits.outside_inwards): see inward_step, length_search, capacitor_search.
-- Formats: trajectory units. See model/directmpc/mpdcc/bit_true/fast.py.
-- Latency: a probe is answered 10 clocks after it is taken, a candidate is compared 19 clocks after
-- its block is taken; initiation interval one clock per candidate.
-- Overflow: none but sqrt(lambda_n)*v_n, which saturates and flags; see the units.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.explorer_types.all;
  use work.mpdcc_program.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_types.all;

entity explorer_fast is
  generic (
    SECOND_LEVEL      : boolean := false; -- true: leaves of the second level besides
    WEIGHTED_DEADLOCK : boolean := false; -- true: the weighted deadlock rule besides
    INWARDS           : boolean := false  -- true: the rule inwards besides
  );
  port (
    clk             : in    std_logic;   -- rising edge
    rst             : in    std_logic;   -- synchronous, active high
    limits          : in    limits_t;    -- bounds and horizon, stable while busy
    node            : in    node_t;      -- where trajectories start, stable while busy
    band            : in    band_t;      -- the band seen from there, stable while busy
    capacitor       : in    capacitor_t; -- table of the capacitors' lengths, row by row
    last            : in    std_logic;   -- '1': no candidate of this node is left, report the best
    candidate_valid : in    std_logic;   -- '1': candidate is new
    candidate_ready : out   std_logic;   -- '1': candidate is taken in this clock
    candidate       : in    candidate_t; -- a probe, or phases a and b of up to four candidates
    probe_done      : out   std_logic;   -- '1' for one clock: answer to a probe
    probe_held      : out   std_logic;   -- '1': step one keeps the currents inside their bound
    result_valid    : out   std_logic;   -- '1': result is new
    result_ready    : in    std_logic;   -- '1': result is taken in this clock
    result          : out   result_t;    -- the best of all candidates since the last result
    busy            : out   std_logic;   -- '1': candidates are under way or a result waits
    -- SECOND_LEVEL alone
    leaf_valid      : in    std_logic;   -- '1': leaf is evaluated, no block is under way
    leaf            : in    leaf_t;      -- a candidate of the second level
    reached         : in    reached_t;   -- how the node of the leaves was reached
    evaluated       : out   evaluated_t  -- every candidate, for the second level
  );
end entity explorer_fast;

architecture rtl of explorer_fast is

  constant EFFORT_BITS : natural := effort_bits_of(SECOND_LEVEL);
  constant LATE        : natural := choose(SECOND_LEVEL, 1, 0); -- clocks of the register behind step_one's table
  constant DEAD_AT     : natural := DEAD_STAGE + LATE;

  subtype effort_word_t is std_logic_vector(EFFORT_BITS - 1 downto 0);

  -- block under way and block that waits
  signal queue_valid : std_logic;
  signal queue       : candidate_t;
  signal block_valid : std_logic;
  signal block_now   : candidate_t;
  signal choice      : unsigned(1 downto 0);
  signal block_end   : std_logic;

  -- what travels beside the data, by stage
  signal valid : stages_t;
  signal probe : std_logic_vector(0 to PROBE_STAGE);

  -- the candidate of stage 0
  signal position  : positions_t;
  signal bank      : std_logic;
  signal connected : connection_t;
  signal index     : index_t;
  signal effort    : effort_word_t;

  signal rows         : std_logic_vector(CONNECTION_BITS - 1 downto 0);
  signal rows_late    : std_logic_vector(CONNECTION_BITS - 1 downto 0); -- stage SEARCH
  signal connected_5  : connection_t;
  signal pattern_late : std_logic_vector(2 downto 0);                  -- stage SHORTEST
  signal index_slope  : index_t;                                       -- stage SLOPE_STAGE
  signal index_dead   : index_t;                                       -- stage DEAD_AT
  signal index_last   : index_t;                                       -- stage COST_STAGE
  signal effort_late  : effort_word_t;                                 -- stage LENGTH_STAGE + 1
  signal effort_cost  : efforts_t;

  signal slopes  : slopes_t;
  signal gone    : std_logic; -- '1': a current is dead by the rule inwards
  signal allowed : length_t;
  signal length  : length_t;
  signal dead    : dead_t;
  signal costed  : costed_t;

  signal idle    : std_logic;
  signal settled : std_logic;
  signal waiting : std_logic;

begin

  ---------------------------------------------------------------------------------------------
  -- Blocks to candidates
  ---------------------------------------------------------------------------------------------

  candidate_ready <= not queue_valid or block_end;
  block_end       <= to_std_logic(block_valid = '0' or block_now.probe = '1'
                                  or choice = NEXT_LAST(to_integer(band.previous(2))));

  p_blocks : process (clk) is
  begin

    if rising_edge(clk) then
      valid(0) <= block_valid;
      probe(0) <= block_valid and block_now.probe;

      if (block_valid = '1') then
        for x in 0 to 1 loop
          position(x) <= next_position(band.previous(x), choice_of(block_now.index, x));
        end loop;

        position(2) <= next_position(band.previous(2), choice);

        if (block_now.probe = '1') then
          position <= band.previous;
        end if;

        index  <= std_logic_vector(block_now.index(INDEX_WIDTH - 1 downto 2)) & std_logic_vector(choice);
        effort <= std_logic_vector(resize(block_now.effort
                                          + transition_weight(band.previous(2), band.negative(2), choice),
                                          EFFORT_BITS));
        bank   <= '0';
      end if;

      if (SECOND_LEVEL and leaf_valid = '1') then
        valid(0) <= '1';
        position <= leaf.position;
        effort   <= std_logic_vector(resize(leaf.effort, EFFORT_BITS));
        bank     <= leaf.bank;
        index    <= std_logic_vector(leaf.index);
      end if;

      if (block_end = '1') then
        choice      <= (others => '0');
        block_valid <= queue_valid;
        block_now   <= queue;
        queue_valid <= '0';
      else
        choice <= choice + 1;
      end if;

      if (candidate_valid = '1' and (queue_valid = '0' or block_end = '1')) then
        queue       <= candidate;
        queue_valid <= '1';
      end if;

      if (rst = '1') then
        queue_valid <= '0';
        block_valid <= '0';
        valid(0)    <= '0';
        probe(0)    <= '0';
      end if;
    end if;

  end process p_blocks;

  ---------------------------------------------------------------------------------------------
  -- What travels beside the data
  ---------------------------------------------------------------------------------------------

  p_travel : process (clk) is
  begin

    if rising_edge(clk) then
      valid(1 to COST_STAGE)  <= valid(0 to COST_STAGE - 1);
      probe(1 to PROBE_STAGE) <= probe(0 to PROBE_STAGE - 1);

      -- a probe goes no further than its answer
      valid(PROBE_STAGE + 1) <= valid(PROBE_STAGE) and not probe(PROBE_STAGE);

      if (rst = '1') then
        valid(1 to COST_STAGE)  <= (others => '0');
        probe(1 to PROBE_STAGE) <= (others => '0');
      end if;
    end if;

  end process p_travel;

  connected.bank    <= bank;
  connected.pattern <= neutral_pattern(position);

  g_kinds : for x in 0 to 2 generate
    connected.kind(x) <= charge_kind(position(x));
  end generate g_kinds;

  rows        <= to_vector(connected);
  connected_5 <= to_connection(rows_late);

  i_rows : entity work.delay_line
    generic map (
      WIDTH  => CONNECTION_BITS,
      CLOCKS => SEARCH
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => rows,
      delayed => rows_late
    );

  i_pattern : entity work.delay_line
    generic map (
      WIDTH  => 3,
      CLOCKS => SHORTEST - SEARCH
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => connected_5.pattern,
      delayed => pattern_late
    );

  i_index_slope : entity work.delay_line
    generic map (
      WIDTH  => INDEX_WIDTH,
      CLOCKS => SLOPE_STAGE
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => index,
      delayed => index_slope
    );

  i_index_dead : entity work.delay_line
    generic map (
      WIDTH  => INDEX_WIDTH,
      CLOCKS => DEAD_AT
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => index,
      delayed => index_dead
    );

  i_index_last : entity work.delay_line
    generic map (
      WIDTH  => INDEX_WIDTH,
      CLOCKS => COST_STAGE - DEAD_AT
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => index_dead,
      delayed => index_last
    );

  i_effort : entity work.delay_line
    generic map (
      WIDTH  => EFFORT_BITS,
      CLOCKS => LENGTH_STAGE + 1
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => effort,
      delayed => effort_late
    );

  effort_cost <= resize(unsigned(effort_late), TOTAL_EFFORT_WIDTH);

  ---------------------------------------------------------------------------------------------
  -- The units
  ---------------------------------------------------------------------------------------------

  i_slopes : entity work.candidate_slopes
    port map (
      clk      => clk,
      node     => node,
      band     => band,
      valid    => valid,
      position => position,
      slopes   => slopes
    );

  g_bounds : if not INWARDS generate
    gone <= '0';
  end generate g_bounds;

  g_inwards : if INWARDS generate

    i_inward_step : entity work.inward_step
      port map (
        clk    => clk,
        band   => band,
        valid  => valid,
        slopes => slopes,
        leaves => gone
      );

  end generate g_inwards;

  i_step_one : entity work.step_one
    generic map (
      SECOND_LEVEL      => SECOND_LEVEL,
      WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK,
      INWARDS           => INWARDS
    )
    port map (
      clk       => clk,
      limits    => limits,
      band      => band,
      capacitor => capacitor,
      valid     => valid,
      error     => slopes.error,
      connected => connected_5,
      gone      => gone,
      index     => index_dead,
      held      => probe_held,
      allowed   => allowed,
      dead      => dead
    );

  probe_done <= probe(PROBE_STAGE);

  i_search : entity work.length_search
    generic map (
      ALLOWED_AT => ALLOW_STAGE + LATE,
      INWARDS    => INWARDS,
      SUMMED     => curves_early and not SECOND_LEVEL and not INWARDS
    )
    port map (
      clk     => clk,
      node    => node,
      band    => band,
      valid   => valid,
      slopes  => slopes,
      allowed => allowed,
      length  => length
    );

  i_cost : entity work.candidate_cost
    generic map (
      SECOND_LEVEL => SECOND_LEVEL
    )
    port map (
      clk     => clk,
      limits  => limits,
      node    => node,
      reached => reached,
      valid   => valid,
      pattern => pattern_late,
      effort  => effort_cost,
      length  => length,
      costed  => costed
    );

  i_best : entity work.best_of
    generic map (
      SECOND_LEVEL => SECOND_LEVEL
    )
    port map (
      clk          => clk,
      rst          => rst,
      dead         => dead,
      costed       => costed,
      index        => index_last,
      reached      => reached,
      settled      => settled,
      last         => last,
      result_valid => result_valid,
      result_ready => result_ready,
      result       => result,
      waiting      => waiting
    );

  idle <= to_std_logic(valid = (valid'range => '0')) and not block_valid and not queue_valid;

  -- a register between seventeen flags and the scheduler
  p_settled : process (clk) is
  begin

    if rising_edge(clk) then
      settled <= idle and not candidate_valid and not leaf_valid;

      if (rst = '1') then
        settled <= '1';
      end if;
    end if;

  end process p_settled;

  busy <= waiting or not settled;

  p_evaluated : process (valid, index_slope, slopes, index_last, costed) is
  begin

    evaluated.slope_valid <= valid(SLOPE_STAGE);
    evaluated.slope_index <= unsigned(index_slope);
    evaluated.unfit       <= '0';

    for x in 0 to 1 loop
      evaluated.slope(x) <= slopes.slope(x)(BASE_WIDTH - 1 downto 0);

      if (overflows(slopes.slope(x), BASE_WIDTH) = '1') then
        evaluated.unfit <= '1';
      end if;
    end loop;

    evaluated.valid     <= costed.feasible;
    evaluated.index     <= unsigned(index_last);
    evaluated.effort    <= costed.effort(EFFORT_WIDTH - 1 downto 0);
    evaluated.length    <= costed.length;
    evaluated.cost      <= costed.cost;
    evaluated.saturated <= costed.saturated;

  end process p_evaluated;

end architecture rtl;
