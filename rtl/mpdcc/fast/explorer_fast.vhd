-- The fast explorer: one candidate per clock, second-order trajectories.
--
-- Every quantity of a candidate is a common term of the node plus one contribution per phase, so
-- the pipeline holds additions and comparisons alone, but for the two products of the cost.
--
--   stage 0      one candidate of the block: next position of phase c
--   stage 1      h*Xr/(3D) * v_x of each phase
--   stage 2-3    slopes of the errors of a and b: natural - h*Xr/D * (v_x - (v_a + v_b + v_c)/3)
--   stage 4      errors at k+1; which bound is left to test (see turn_threshold); margin from it
--   stage 5-10   one bit of the length per stage and phase: e(l + 2**m) = e(l) + 2**m * secant is
--                tested, with secant = slope(l) + 2**m * c carried from stage to stage
--   stage 5-9    beside: length that the capacitors allow and worst excess at k+1, one comparison a stage
--   stage 11-12  shortest length
--
-- Third phase: errors, slopes and curvatures of the three phases add up to zero, exactly. The third
-- one searched is the opposite of c, the sum of a and b, a stage behind them; and the largest of the
-- three errors at k+1 is the sum where a and b have one sign, else the one of them whose sign it has.
--   stage 13-16  J = f_s / L + (sqrt(lambda_n) * v_n(k+L))**2
--   then         best so far; as long as nothing is feasible, the least excess of stage 9
--
-- Weighted deadlock rule (WEIGHTED_DEADLOCK, chosen with limits.deadlock_rule): instead of the excess of stage 9
--   16 * max(e_i, 8 * e_n, e_ph) + max(e_i),   e: excesses at k+1 of the currents, v_n and v_ph
-- is compared, in sixteenths of a trajectory unit, after one stage more that no decision takes longer for.
-- Without deadlock_rule it is 16 times the excess, of the same order. Ties go to the earliest either way.
--
-- First exit: the parabola may leave the band and come back. If the slope exceeds its threshold
-- it leaves before it turns, and steps beyond the turn do not count; otherwise it can leave on the
-- side of the curvature alone. One margin is tested, and the test is monotone.
-- Leaves: candidates of the second level come one a clock past the blocks, as leaf; node and band
-- change under way in time with the stages, their steps and efforts add to those of reached.
-- Formats: trajectory units; MARGIN_WIDTH and SLOPE_WIDTH hold whatever stays inside a bound of
-- 29000 units; a step of the search that does not fit is outside. See model/directmpc/mpdcc/bit_true/fast.py.
-- Latency: a probe is answered 10 clocks after it is taken, a candidate is compared 19 clocks after
-- its block is taken; initiation interval one clock per candidate.
-- Overflow: a slope beyond START_SLOPE_WIDTH leaves in one step, so the search may run on what is
-- left of it; sqrt(lambda_n)*v_n saturates and flags. The weighted rule's word holds every sum: an error of v_n
-- at k has TERM_WIDTH bits, its slope CURRENT_TERM_WIDTH + 1 at most, so that 128 * e_n is below 2**(RANK_WIDTH - 1).
-- Weighed, not built (figures estimated): carrying e(l) and testing both bounds takes a comparison more in each of the
-- 18 search cells, 330 LUTs, and is wrong after the first exit; two clocks per search stage double
-- the registers and bring no clock rate where the cell is margin, slope and two chained adders.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_types.all;

entity explorer_fast is
  generic (
    SECOND_LEVEL      : boolean := false; -- true: leaves of the second level besides
    WEIGHTED_DEADLOCK : boolean := false -- true: the weighted deadlock rule besides
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

  constant SEARCH      : natural := 5;                     -- first stage of the search
  constant SHORTEST    : natural := SEARCH + LENGTH_WIDTH; -- first stage of the minimum
  constant STAGE_COUNT : natural := SHORTEST + 5;          -- the stage that holds the cost

  -- what leaves need beyond the candidates of the first level: more effort, more steps, two tables
  function more (first, second : natural) return natural is
  begin

    if (SECOND_LEVEL) then
      return second;
    else
      return first;
    end if;

  end function more;

  -- bits that the weight on v_n adds to an excess
  function weight_bits return natural is
  begin

    if (WEIGHTED_DEADLOCK) then
      return DEADLOCK_NEUTRAL_SHIFT;
    else
      return 0;
    end if;

  end function weight_bits;

  constant WORST_WIDTH : natural := TRAJECTORY_WIDTH + weight_bits;

  constant EFFORT_BITS : natural := more(EFFORT_WIDTH, TOTAL_EFFORT_WIDTH);
  constant REACH_BITS  : natural := more(LENGTH_WIDTH, LENGTH_WIDTH + 1);
  constant ROW_BITS    : natural := more(5, 6); -- of the capacitors' table
  constant NEUTRAL_BITS : natural := more(3, 4); -- of the neutral point's
  constant PRODUCTS   : natural := 2 ** (EFFORT_BITS - 2); -- of a reciprocal, 0 included

  subtype voltage_t is signed(FORCED_WIDTH downto 0);

  type voltages_t is array (0 to 2) of voltage_t;

  subtype difference_t is signed(FORCED_WIDTH + 1 downto 0);

  type differences_t is array (0 to 1) of difference_t;

  subtype slope_t is signed(SLOPE_WIDTH - 1 downto 0);

  subtype inside_t is unsigned(MARGIN_WIDTH - 2 downto 0);

  type slopes_t is array (0 to 2) of slope_t;

  -- one phase in the search
  type cell_t is record
    side_up : std_logic; -- '1': the upper bound is left to test
    margin  : inside_t;  -- error at the length so far, seen from that bound; what is inside has side_up for a sign
    secant  : slope_t;   -- mean slope of the steps that the next stage tries
    length  : length_t;  -- length so far
  end record cell_t;

  type cells_t is array (0 to 2) of cell_t;

  type search_t is array (0 to LENGTH_WIDTH) of cells_t; -- by the bits that are decided

  subtype flags_t is std_logic_vector(2 downto 0);

  subtype entry_t is std_logic_vector(LENGTH_WIDTH + TRAJECTORY_WIDTH - 1 downto 0);

  type table_t is array (natural range 0 to 2 ** ROW_BITS - 1) of entry_t;

  subtype length_word_t is std_logic_vector(LENGTH_WIDTH - 1 downto 0);

  subtype worst_t is signed(WORST_WIDTH - 1 downto 0);

  subtype excess_word_t is std_logic_vector(TRAJECTORY_WIDTH - 1 downto 0);

  type neutral_lengths_t is array (natural range 0 to 2 ** NEUTRAL_BITS - 1) of length_word_t;

  type neutral_excesses_t is array (natural range 0 to 2 ** NEUTRAL_BITS - 1) of excess_word_t;

  subtype multiple_t is std_logic_vector(RECIPROCAL_FRACTION + 3 downto 0);

  -- downwards: GHDL counts the addresses of an array from its last element, which takes inverters otherwise
  type multiples_t is array (natural range PRODUCTS * 2 ** REACH_BITS - 1 downto 0) of multiple_t;

  type entries_t is array (0 to 2) of entry_t;

  type excesses_t is array (0 to 1) of worst_t;

  type lengths_t is array (0 to 1) of length_t;

  type limit_stages_t is array (SEARCH + 3 to SHORTEST - 1) of length_t;

  type length_stages_t is array (SHORTEST + 1 to STAGE_COUNT) of length_t;

  subtype rate_t is unsigned(RECIPROCAL_FRACTION + EFFORT_BITS - 1 downto 0);

  subtype effort_t is unsigned(EFFORT_BITS - 1 downto 0);

  type effort_stages_t is array (SHORTEST + 3 to STAGE_COUNT) of effort_t;

  subtype key_t is unsigned(RANK_WIDTH + INDEX_WIDTH downto 0);

  function length_of (entry : entry_t) return length_t is
  begin

    return unsigned(entry(entry'high downto TRAJECTORY_WIDTH));

  end function length_of;

  function excess_of (entry : entry_t) return trajectory_t is
  begin

    return signed(entry(TRAJECTORY_WIDTH - 1 downto 0));

  end function excess_of;

  -- 0 to 7 times 1/L
  function multiples_of_reciprocals return multiples_t is

    variable words : multiples_t;

  begin

    for k in natural range 0 to PRODUCTS - 1 loop
      for l in natural range 0 to 2 ** REACH_BITS - 1 loop
        words(k * 2 ** REACH_BITS + l) := std_logic_vector(unsigned(RECIPROCALS(l)) * to_unsigned(k, 3));
      end loop;
    end loop;

    return words;

  end function multiples_of_reciprocals;

  function shorter (a, b : length_t) return length_t is
  begin

    if (a < b) then
      return a;
    else
      return b;
    end if;

  end function shorter;

  -- stage that a lane of the search starts with: the third is one behind
  function start_of (lane : natural) return natural is
  begin

    return SEARCH - 1 + lane / 2;

  end function start_of;

  function worse (a, b : worst_t) return worst_t is
  begin

    if (a > b) then
      return a;
    else
      return b;
    end if;

  end function worse;

  -- block under way and block that waits
  signal queue_valid : std_logic;
  signal queue       : candidate_t;
  signal block_valid : std_logic;
  signal block_now   : candidate_t;
  signal choice      : unsigned(1 downto 0);
  signal block_end   : std_logic;

  -- what travels beside the data, by stage
  signal valid    : std_logic_vector(0 to STAGE_COUNT);
  signal probe    : std_logic_vector(0 to SEARCH + 2);
  signal limit    : limit_stages_t; -- length that the capacitors allow, 0 for a dead candidate
  signal length   : length_stages_t;
  signal feasible : std_logic_vector(SHORTEST + 2 to STAGE_COUNT);
  signal clipped  : std_logic_vector(SHORTEST + 3 to STAGE_COUNT);

  signal index_0     : std_logic_vector(INDEX_WIDTH - 1 downto 0);
  signal index_dead  : std_logic_vector(INDEX_WIDTH - 1 downto 0); -- with excess_9
  signal index_last  : std_logic_vector(INDEX_WIDTH - 1 downto 0); -- of the last stage
  signal index_3     : std_logic_vector(INDEX_WIDTH - 1 downto 0); -- with slope_3
  signal effort_0    : std_logic_vector(EFFORT_BITS - 1 downto 0);
  signal effort_late : std_logic_vector(EFFORT_BITS - 1 downto 0); -- with the length of the stage before
  signal effort_end  : effort_stages_t;
  signal bank_0      : std_logic;
  signal hangs_0     : std_logic_vector(9 downto 0);                -- bank, pattern and kinds of the candidate
  signal hangs_5     : std_logic_vector(9 downto 0);
  signal outside     : std_logic_vector(SEARCH - 1 to SEARCH + 2);  -- '1': a current error is outside at k
  signal pattern_11  : flags_t;

  signal position_0   : positions_t;
  signal voltage_1    : voltages_t;
  signal difference_2 : differences_t; -- of a and c, of b and c
  signal slope_3      : pair_t;        -- of a and b
  signal slope_4      : trajectory_t;  -- of their sum
  signal error_4      : pair_t;
  signal lane_slopes  : trajectories_t;
  signal triple       : slopes_t; -- three times the curvature
  signal lanes        : search_t; -- of a and b, and of their sum
  signal largest_5    : trajectory_t;
  signal distance_6   : trajectory_t;
  signal excess_7     : trajectory_t;
  signal entry_6      : entries_t; -- of the phases

  signal neutral_length_6 : length_t;
  signal neutral_excess_6 : worst_t;
  signal excess_caps  : excesses_t;
  signal length_caps  : lengths_t;
  signal excess_8     : trajectory_t; -- of the currents
  signal caps_8       : worst_t;      -- of everything else
  signal excess_9     : worst_t;

  -- a dead candidate as it is compared
  signal dead_valid : std_logic;
  signal dead_rank  : rank_t;
  signal dead_index : std_logic_vector(INDEX_WIDTH - 1 downto 0);

  signal capacitors : table_t;         -- rows of the phases; one block RAM for each that reads it
  -- never written: a constant would become one block RAM for each of the two places that read it
  -- vsg_off signal_007
  signal multiples : multiples_t := multiples_of_reciprocals;
  -- vsg_on signal_007
  -- rows of the neutral point: two memories, each small enough for Yosys to keep it in LUTs
  signal neutral_lengths  : neutral_lengths_t;
  signal neutral_excesses : neutral_excesses_t;

  signal short_11   : length_t;
  signal slope_12   : weight_t;
  signal product_13 : signed(WEIGHT_WIDTH + LENGTH_WIDTH downto 0);
  signal reach_13   : unsigned(REACH_BITS - 1 downto 0); -- steps of both levels
  signal low_14     : multiple_t; -- rate of the two low bits of the effort
  signal high_14    : multiple_t;
  signal weight_14  : weight_t;
  signal square_15  : signed(2 * WEIGHT_WIDTH - 1 downto 0);
  signal rate_15    : rate_t;
  signal cost_16    : cost_t;

  signal flagged  : std_logic;
  signal key_now  : key_t; -- of the last stage; leaves of one node tell each other apart by their flags alone
  signal key_best : key_t;

  -- the best of all candidates so far
  signal any         : std_logic;
  signal best        : result_t;
  signal idle        : std_logic;
  signal settled     : std_logic;
  signal reported    : std_logic;

begin

  assert SEARCH + LENGTH_WIDTH = 11
    report "explorer_fast: signals are named for lengths of six bits"
    severity failure;

  assert CURRENT_TERM_WIDTH + 3 < TERM_WIDTH and TERM_WIDTH < TRAJECTORY_WIDTH
    report "explorer_fast: the weighted excess does not fit a rank"
    severity failure;

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
          position_0(x) <= next_position(band.previous(x), block_now.index(5 - 2 * x downto 4 - 2 * x));
        end loop;

        position_0(2) <= next_position(band.previous(2), choice);

        if (block_now.probe = '1') then
          position_0 <= band.previous;
        end if;

        index_0    <= std_logic_vector(block_now.index(INDEX_WIDTH - 1 downto 2)) & std_logic_vector(choice);
        effort_0   <= std_logic_vector(resize(block_now.effort
                                              + transition_weight(band.previous(2), band.negative(2), choice),
                                              EFFORT_BITS));
        bank_0     <= '0';
      end if;

      if (SECOND_LEVEL and leaf_valid = '1') then
        valid(0)   <= '1';
        position_0 <= leaf.position;
        effort_0   <= std_logic_vector(resize(leaf.effort, EFFORT_BITS));
        bank_0     <= leaf.bank;
        index_0    <= std_logic_vector(leaf.index);
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

  p_travel : process (clk) is
  begin

    if rising_edge(clk) then
      valid(1 to STAGE_COUNT) <= valid(0 to STAGE_COUNT - 1);
      probe(1 to SEARCH + 2)  <= probe(0 to SEARCH + 1);

      -- a probe goes no further than its answer
      valid(SEARCH + 3) <= valid(SEARCH + 2) and not probe(SEARCH + 2);

      limit(SEARCH + 4 to SHORTEST - 1)   <= limit(SEARCH + 3 to SHORTEST - 2);
      length(SHORTEST + 2 to STAGE_COUNT) <= length(SHORTEST + 1 to STAGE_COUNT - 1);

      if (rst = '1') then
        valid(1 to STAGE_COUNT) <= (others => '0');
        probe(1 to SEARCH + 2)  <= (others => '0');
      end if;
    end if;

  end process p_travel;

  hangs_0 <= bank_0 & neutral_pattern(position_0) & std_logic_vector(charge_kind(position_0(2)))
             & std_logic_vector(charge_kind(position_0(1))) & std_logic_vector(charge_kind(position_0(0)));

  i_hangs : entity work.delay_line
    generic map (
      WIDTH  => 10,
      CLOCKS => SEARCH
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => hangs_0,
      delayed => hangs_5
    );

  i_pattern : entity work.delay_line
    generic map (
      WIDTH  => 3,
      CLOCKS => SHORTEST - SEARCH
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => hangs_5(8 downto 6),
      delayed => pattern_11
    );

  i_index_slope : entity work.delay_line
    generic map (
      WIDTH  => INDEX_WIDTH,
      CLOCKS => 3
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => index_0,
      delayed => index_3
    );

  i_index_dead : entity work.delay_line
    generic map (
      WIDTH  => INDEX_WIDTH,
      CLOCKS => SEARCH + 4
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => index_0,
      delayed => index_dead
    );

  i_index_last : entity work.delay_line
    generic map (
      WIDTH  => INDEX_WIDTH,
      CLOCKS => STAGE_COUNT - SEARCH - 4
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
      CLOCKS => SHORTEST + 2
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => effort_0,
      delayed => effort_late
    );

  ---------------------------------------------------------------------------------------------
  -- Stages 1 to 4: slopes, and which bound is left to test
  ---------------------------------------------------------------------------------------------

  p_slopes : process (clk) is

    variable wide  : signed(TRAJECTORY_WIDTH + FORCED_FRACTION - 1 downto 0);
    variable twice : signed(TRAJECTORY_WIDTH + FORCED_FRACTION - 2 downto 0);

  begin

    if rising_edge(clk) then
      for x in 0 to 2 loop
        if (valid(0) = '1') then
          voltage_1(x) <= phase_voltage(node, x, position_0(x));
        end if;
      end loop;

      for x in 0 to 1 loop
        if (valid(1) = '1') then
          difference_2(x) <= resize(voltage_1(x), FORCED_WIDTH + 2) - voltage_1(2);
        end if;

        -- 2*(u_x - u_c) - (u_y - u_c), rounded half up with the natural slope's empty fraction
        if (valid(2) = '1') then
          wide  := node.slope(x) & (FORCED_FRACTION - 2 downto 0 => '0') & '1';
          -- the LSB passes by
          twice := wide(wide'high downto 1) - difference_2(x);
          wide  := twice & wide(0);
          wide  := wide + difference_2(1 - x);

          slope_3(x) <= wide(TRAJECTORY_WIDTH + FORCED_FRACTION - 1 downto FORCED_FRACTION);
        end if;

        if (valid(3) = '1') then
          error_4(x) <= band.first(x) + slope_3(x);
        end if;
      end loop;

      if (valid(3) = '1') then
        slope_4 <= slope_3(0) + slope_3(1);
      end if;
    end if;

  end process p_slopes;

  lane_slopes <= (slope_3(0), slope_3(1), slope_4);

  g_lanes : for x in 0 to 2 generate

    p_lane : process (clk) is

      variable start   : signed(START_SLOPE_WIDTH - 1 downto 0);
      variable steeper : signed(TURN_WIDTH downto 0);
      variable exceeds : std_logic;
      variable side_up : std_logic;

    begin

      if rising_edge(clk) then
        if (valid(start_of(x) - 1) = '1') then
          -- a slope that does not fit leaves in one step: the candidate is dead whatever the search says
          start := lane_slopes(x)(START_SLOPE_WIDTH - 1 downto 0);

          -- against the curvature and steeper than the threshold: it leaves on the curvature's other side
          steeper := resize(start, TURN_WIDTH + 1) + band.turn(x);
          exceeds := steeper(TURN_WIDTH) xor node.curvature(x)(CURVATURE_WIDTH - 1);
          side_up := node.curvature(x)(CURVATURE_WIDTH - 1) xnor exceeds;

          lanes(0)(x).side_up <= side_up;
          lanes(0)(x).secant  <= resize(start, SLOPE_WIDTH)
                                 + shift_left(resize(node.curvature(x), SLOPE_WIDTH), LENGTH_WIDTH - 1);
          lanes(0)(x).length  <= (others => '0');

          if (side_up = '1') then
            lanes(0)(x).margin <= unsigned(band.margin_up(x)(MARGIN_WIDTH - 2 downto 0));
          else
            lanes(0)(x).margin <= unsigned(band.margin_down(x)(MARGIN_WIDTH - 2 downto 0));
          end if;
        end if;
      end if;

    end process p_lane;

  end generate g_lanes;

  ---------------------------------------------------------------------------------------------
  -- Stages 5 to 10: one bit of the length each
  ---------------------------------------------------------------------------------------------

  g_triple : for x in 0 to 2 generate
    triple(x) <= resize(node.curvature(x), SLOPE_WIDTH) + shift_left(resize(node.curvature(x), SLOPE_WIDTH), 1);
  end generate g_triple;

  g_bits : for m in 0 to LENGTH_WIDTH - 1 generate

    constant DECIDED : natural := LENGTH_WIDTH - m; -- bits, with this one

  begin

    p_bit : process (clk) is

      variable cell    : cell_t;
      variable secant  : slope_t;
      variable curve   : slope_t; -- change of the slope over the steps tried
      variable tail    : signed(SLOPE_WIDTH - TURN_SHIFT - 1 downto 0);
      variable moved   : signed(SLOPE_WIDTH - m downto 0);
      variable trial   : signed(SLOPE_WIDTH downto 0);
      variable side    : std_logic;
      variable exceeds : std_logic;
      variable turned  : std_logic;
      variable accept  : std_logic;
      variable ahead   : unsigned(SLOPE_WIDTH - 1 downto 0);
      variable back    : unsigned(SLOPE_WIDTH - 1 downto 0);
      variable change  : unsigned(SLOPE_WIDTH downto 0);
      variable changed : unsigned(SLOPE_WIDTH downto 0);

    begin

      if rising_edge(clk) then
        for x in 0 to 2 loop
          if (valid(start_of(x) + DECIDED - 1) = '1') then
            secant := lanes(DECIDED - 1)(x).secant;
            curve  := shift_left(resize(node.curvature(x), SLOPE_WIDTH), m);
            side   := lanes(DECIDED - 1)(x).side_up;
            trial  := resize(signed(side & std_logic_vector(lanes(DECIDED - 1)(x).margin)), SLOPE_WIDTH + 1);

            -- what lies below the secant's LSB passes by
            moved  := trial(SLOPE_WIDTH downto m) + secant(SLOPE_WIDTH - m - 1 downto 0);
            trial  := moved & trial(m - 1 downto 0);

            -- past the turn the slope has the sign of the curvature
            tail   := secant(SLOPE_WIDTH - 1 downto TURN_SHIFT) + curve(SLOPE_WIDTH - 1 downto TURN_SHIFT);
            turned := tail(tail'high) xnor node.curvature(x)(CURVATURE_WIDTH - 1);

            -- the bound on the curvature's side is left unless the error leaves before it turns
            exceeds := side xnor node.curvature(x)(CURVATURE_WIDTH - 1);
            accept  := not overflows(secant, SLOPE_WIDTH - m) and (trial(SLOPE_WIDTH) xnor side)
                       and not (exceeds and turned and to_std_logic(m > 0));

            cell           := lanes(DECIDED - 1)(x);
            cell.length(m) := accept;

            if (accept = '1') then
              cell.margin := unsigned(trial(MARGIN_WIDTH - 2 downto 0));
            end if;

            -- half the steps next: 3/2 of the change on where these are taken, 1/2 back where not
            ahead := unsigned(shift_right(shift_left(triple(x), m), 1));
            back  := unsigned(shift_right(curve, 1));

            for i in 0 to SLOPE_WIDTH - 1 loop
              change(i + 1) := (ahead(i) and accept) or (not back(i) and not accept);
            end loop;

            change(0) := not accept;
            changed   := (unsigned(secant) & '1') + change;

            cell.secant := signed(changed(SLOPE_WIDTH downto 1));

            -- as a whole: of four assignments to parts of the signal GHDL 2.0 may lose one
            lanes(DECIDED)(x) <= cell;
          end if;
        end loop;
      end if;

    end process p_bit;

  end generate g_bits;

  ---------------------------------------------------------------------------------------------
  -- Stages 5 to 9: step one; a candidate is dead if anything is outside now or then
  ---------------------------------------------------------------------------------------------

  p_step_one : process (clk) is

    variable sum         : trajectory_t;
    variable allowed     : length_t;
    variable place       : std_logic;
    variable row         : unsigned(5 downto 0);
    variable table_row   : unsigned(ROW_BITS - 1 downto 0);
    variable neutral_row : unsigned(NEUTRAL_BITS - 1 downto 0);
    variable weighed     : worst_t;
    variable written_row : unsigned(NEUTRAL_BITS - 1 downto 0);

  begin

    if rising_edge(clk) then
      place       := hangs_5(9) and to_std_logic(hangs_5(8 downto 6) /= "000");
      neutral_row := resize(place & unsigned(hangs_5(8 downto 6)), NEUTRAL_BITS);
      written_row := resize(capacitor.bank & capacitor.row(2 downto 0), NEUTRAL_BITS);

      -- without a second level nothing is read while rows are written: a single port takes half the LUTs
      if (not SECOND_LEVEL) then
        if (capacitor.write = '1') then
          neutral_row := written_row;
        end if;

        written_row := neutral_row;
      end if;

      if (capacitor.write = '1') then
        row       := capacitor.bank & capacitor.row;
        table_row := resize(row, ROW_BITS);
        capacitors(to_integer(table_row)) <= std_logic_vector(capacitor.length) & std_logic_vector(capacitor.excess);

        if (capacitor.row(4) = '1') then
          neutral_lengths(to_integer(written_row))  <= std_logic_vector(capacitor.length);
          neutral_excesses(to_integer(written_row)) <= std_logic_vector(capacitor.excess);
        end if;
      end if;

      -- the third one is known a stage later
      outside(SEARCH - 1)           <= band.outside(0) or band.outside(1);
      outside(SEARCH)               <= outside(SEARCH - 1) or band.outside(2);
      outside(SEARCH + 1 to SEARCH + 2) <= outside(SEARCH to SEARCH + 1);

      if (valid(SEARCH - 1) = '1') then
        sum := error_4(0) + error_4(1);

        if (error_4(0)(TRAJECTORY_WIDTH - 1) = error_4(1)(TRAJECTORY_WIDTH - 1)) then
          largest_5 <= sum;
        elsif (error_4(0)(TRAJECTORY_WIDTH - 1) = sum(TRAJECTORY_WIDTH - 1)) then
          largest_5 <= error_4(0);
        else
          largest_5 <= error_4(1);
        end if;
      end if;

      if (valid(SEARCH) = '1') then
        distance_6 <= signed(magnitude(largest_5));

        -- what does not move is the root's, in the first table
        for x in 0 to 2 loop
          place      := hangs_5(9) and (hangs_5(2 * x + 1) or hangs_5(2 * x));
          row        := place & to_unsigned(x, 3) & unsigned(hangs_5(2 * x + 1 downto 2 * x));
          table_row  := resize(row, ROW_BITS);
          entry_6(x) <= capacitors(to_integer(table_row));
        end loop;

        neutral_length_6 <= unsigned(neutral_lengths(to_integer(neutral_row)));
        weighed          := resize(signed(neutral_excesses(to_integer(neutral_row))), WORST_WIDTH);

        if (WEIGHTED_DEADLOCK and limits.deadlock_rule = '1') then
          weighed := shift_left(weighed, DEADLOCK_NEUTRAL_SHIFT);
        end if;

        neutral_excess_6 <= weighed;
      end if;

      if (valid(SEARCH + 1) = '1') then
        excess_7       <= distance_6 - signed(resize(limits.bound_current, TRAJECTORY_WIDTH));
        excess_caps(0) <= worse(resize(excess_of(entry_6(0)), WORST_WIDTH),
                                resize(excess_of(entry_6(1)), WORST_WIDTH));
        excess_caps(1) <= worse(resize(excess_of(entry_6(2)), WORST_WIDTH), neutral_excess_6);
        length_caps(0) <= shorter(length_of(entry_6(0)), length_of(entry_6(1)));
        length_caps(1) <= shorter(length_of(entry_6(2)), neutral_length_6);
      end if;

      if (valid(SEARCH + 2) = '1') then
        excess_8 <= excess_7;
        caps_8   <= worse(excess_caps(0), excess_caps(1));
        allowed  := shorter(length_caps(0), length_caps(1));

        if (excess_7 > 0 or outside(SEARCH + 2) = '1') then
          allowed := (others => '0');
        end if;

        limit(SEARCH + 3) <= allowed;
      end if;

      if (valid(SEARCH + 3) = '1') then
        excess_9 <= worse(resize(excess_8, WORST_WIDTH), caps_8);
      end if;
    end if;

  end process p_step_one;

  g_largest : if not WEIGHTED_DEADLOCK generate
    dead_valid <= valid(SEARCH + 4);
    dead_rank  <= ranked(excess_9);
    dead_index <= index_dead;
  end generate g_largest;

  g_weighted : if WEIGHTED_DEADLOCK generate

    signal current_9 : trajectory_t; -- worst excess of the currents

  begin

    dead_valid <= valid(SEARCH + 5);

    -- the low bits pass by; signed order becomes unsigned order with the sign bit inverted
    p_rank : process (clk) is

      variable share : trajectory_t;
      variable sum   : worst_t;

    begin

      if rising_edge(clk) then
        if (valid(SEARCH + 3) = '1') then
          current_9 <= excess_8;
        end if;

        if (valid(SEARCH + 4) = '1') then
          share := gated(current_9, limits.deadlock_rule);
          sum   := excess_9 + share(TRAJECTORY_WIDTH - 1 downto DEADLOCK_CURRENT_SHIFT);

          dead_rank  <= resize((not sum(WORST_WIDTH - 1)) & unsigned(sum(WORST_WIDTH - 2 downto 0))
                               & unsigned(share(DEADLOCK_CURRENT_SHIFT - 1 downto 0)), RANK_WIDTH);
          dead_index <= index_dead;
        end if;
      end if;

    end process p_rank;

  end generate g_weighted;

  probe_done <= probe(SEARCH + 2);
  probe_held <= to_std_logic(excess_7 <= 0);

  ---------------------------------------------------------------------------------------------
  -- Stages 11 and 12: shortest length
  ---------------------------------------------------------------------------------------------

  p_shortest : process (clk) is
  begin

    if rising_edge(clk) then
      if (valid(SHORTEST - 1) = '1') then
        short_11 <= shorter(shorter(lanes(LENGTH_WIDTH)(0).length, lanes(LENGTH_WIDTH)(1).length), limit(SHORTEST - 1));
      end if;

      if (valid(SHORTEST) = '1') then
        length(SHORTEST + 1) <= shorter(short_11, lanes(LENGTH_WIDTH)(2).length);
        slope_12             <= share_of(node.weight_slope, pattern_11);
      end if;
    end if;

  end process p_shortest;

  ---------------------------------------------------------------------------------------------
  -- Stages 13 to 16: cost
  ---------------------------------------------------------------------------------------------

  p_cost : process (clk) is

    variable factor : signed(LENGTH_WIDTH downto 0);
    variable sum    : signed(WEIGHT_WIDTH + LENGTH_WIDTH downto 0);
    variable square : unsigned(COST_WIDTH - 1 downto 0);

  begin

    if rising_edge(clk) then
      -- stage 13
      if (valid(SHORTEST + 1) = '1') then
        factor     := signed('0' & length(SHORTEST + 1));
        product_13 <= slope_12 * factor;
      end if;

      feasible(SHORTEST + 2) <= to_std_logic(length(SHORTEST + 1) /= 0);
      reach_13               <= resize(length(SHORTEST + 1), REACH_BITS) + reached.lead;

      -- stage 14
      if (valid(SHORTEST + 2) = '1') then
        sum := shift_right(product_13, WEIGHT_SLOPE_FRACTION) + node.weight_start;

        weight_14             <= clip(sum, WEIGHT_WIDTH);
        clipped(SHORTEST + 3) <= overflows(sum, WEIGHT_WIDTH);

        low_14  <= multiples(to_integer(unsigned(effort_late(1 downto 0)) & reach_13));
        high_14 <= multiples(to_integer(unsigned(effort_late(EFFORT_BITS - 1 downto 2)) & reach_13));
      end if;

      -- stage 15
      if (valid(SHORTEST + 3) = '1') then
        square_15 <= weight_14 * weight_14;

        -- two and three bits of effort, from one memory, are cheaper than 1/L and a product
        rate_15 <= resize(unsigned(low_14), rate_15'length) + shift_left(resize(unsigned(high_14), rate_15'length), 2);
      end if;

      -- stage 16
      if (valid(SHORTEST + 4) = '1') then
        square := (others => '0');

        for i in WEIGHT_SHIFTS'range loop
          if (limits.weight_scale = i) then
            square := resize(unsigned(square_15(2 * WEIGHT_WIDTH - 2 downto WEIGHT_SHIFTS(i))), COST_WIDTH);
          end if;
        end loop;

        cost_16 <= resize(rate_15, COST_WIDTH) + square;
      end if;

      feasible(SHORTEST + 3 to STAGE_COUNT) <= feasible(SHORTEST + 2 to STAGE_COUNT - 1);
      clipped(SHORTEST + 4 to STAGE_COUNT)  <= clipped(SHORTEST + 3 to STAGE_COUNT - 1);
      effort_end <= unsigned(effort_late) & effort_end(SHORTEST + 3 to STAGE_COUNT - 1);
    end if;

  end process p_cost;

  ---------------------------------------------------------------------------------------------
  -- Best so far; candidates come in the order of enumeration, so the earliest wins a tie
  ---------------------------------------------------------------------------------------------

  flagged <= clipped(STAGE_COUNT) or reached.saturated;

  -- candidates of a node come in order, but nodes do not
  g_ties : if SECOND_LEVEL generate
    key_now  <= resize(cost_16, RANK_WIDTH) & unsigned(index_last) & flagged;
    key_best <= best.rank & best.index & best.saturated;
  end generate g_ties;

  g_in_order : if not SECOND_LEVEL generate
    key_now  <= resize(cost_16, RANK_WIDTH) & (INDEX_WIDTH downto 0 => '0');
    key_best <= best.rank & (INDEX_WIDTH downto 0 => '0');
  end generate g_in_order;

  p_best : process (clk) is
  begin

    if rising_edge(clk) then
      -- of use where nothing is feasible
      if (dead_valid = '1') then
        any <= '1';

        if (best.feasible = '0' and (any = '0' or dead_rank < best.rank)) then
          best.saturated <= '0';
          best.index     <= unsigned(dead_index);
          best.length    <= (others => '0');
          best.rank      <= dead_rank;
        end if;
      end if;

      if (valid(STAGE_COUNT) = '1' and feasible(STAGE_COUNT) = '1'
          and (best.feasible = '0' or key_now < key_best)) then
        best.feasible  <= '1';
        best.saturated <= flagged;
        best.index     <= unsigned(index_last);
        best.length    <= length(STAGE_COUNT);
        best.rank      <= resize(cost_16, RANK_WIDTH);

        if (reached.second = '1') then
          best.length <= reached.length;
        end if;
      end if;

      if (rst = '1' or (reported = '1' and result_ready = '1')) then
        any           <= '0';
        best.feasible <= '0';
      end if;
    end if;

  end process p_best;

  p_evaluated : process (valid, index_3, slope_3, feasible, index_last, effort_end, length, cost_16, clipped) is
  begin

    evaluated.slope_valid <= valid(3);
    evaluated.slope_index <= unsigned(index_3);
    evaluated.unfit       <= '0';

    for x in 0 to 1 loop
      evaluated.slope(x) <= slope_3(x)(BASE_WIDTH - 1 downto 0);

      if (overflows(slope_3(x), BASE_WIDTH) = '1') then
        evaluated.unfit <= '1';
      end if;
    end loop;

    evaluated.valid     <= valid(STAGE_COUNT) and feasible(STAGE_COUNT);
    evaluated.index     <= unsigned(index_last);
    evaluated.effort    <= effort_end(STAGE_COUNT)(EFFORT_WIDTH - 1 downto 0);
    evaluated.length    <= length(STAGE_COUNT);
    evaluated.cost      <= cost_16;
    evaluated.saturated <= clipped(STAGE_COUNT);

  end process p_evaluated;

  idle <= to_std_logic(valid = (valid'range => '0')) and not block_valid and not queue_valid;

  -- a register between seventeen flags and the scheduler
  p_report : process (clk) is
  begin

    if rising_edge(clk) then
      settled <= idle and not candidate_valid and not leaf_valid;

      if (rst = '1') then
        settled <= '1';
      end if;
    end if;

  end process p_report;

  reported     <= any and settled and last;
  result_valid <= reported;
  busy         <= any or not settled;

  result       <= best;

end architecture rtl;
