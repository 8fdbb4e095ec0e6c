-- The paper's explorer: one candidate at a time over shared hardware (Paper A, Section VI).
--
--   stage 1   voltages of the three phases, neutral-point and weight slopes of the candidate
--   stage 2-3 slope of one output a clock, in the order i_a, i_b, i_c, v_n, v_ph_a, v_ph_b, v_ph_c:
--             natural slope - h*Xr/D * (v_x - (v_a + v_b + v_c)/3), or the capacitor slope; of those that
--             the converter has
--   stage 4   room up to the bound in the slope's direction, error at k+1
--   stage 5   excess of that error over the bound
--   search    one binary_search per output, started one clock after the other
--   cost      J = f_s / L + (sqrt(lambda_n) * v_n(k+L))**2 with 1/L from a table, and the two
--             products on one mac_block, while the next candidate is already streaming
--
-- Exits: Algorithm 2's two (see binary_search), with the shortest length of use found from the best
-- cost so far by one more search; a candidate dead in step one is dropped at once when J_dl is not
-- needed any more (best_valid), else J_dl is reported as soon as the last output has passed.
-- None of them changes an answer: a candidate is dropped only if it costs strictly more.
--
-- Formats: trajectory units inside, cost with RECIPROCAL_FRACTION fractional bits.
-- Latency: 30 clocks from candidate to result; initiation interval 22 clocks, 14 when dead with
-- J_dl, less with an exit; a probe takes at most 13 clocks.
-- Overflow: trajectories cannot (a model test proves the ranges); |slope| is clipped at the search
-- width, which is at least twice any bound; sqrt(lambda_n)*v_n saturates and flags.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.mpdcc_types.all;

entity explorer_paper is
  port (
    clk             : in    std_logic;   -- rising edge
    rst             : in    std_logic;   -- synchronous, active high
    limits          : in    limits_t;    -- bounds and horizon, stable while busy
    node            : in    node_t;      -- where trajectories start, stable while busy
    best_valid      : in    std_logic;   -- '1': a candidate with length > 0 is known
    best_cost       : in    cost_t;      -- its cost, valid with best_valid
    candidate_valid : in    std_logic;   -- '1': candidate is new
    candidate_ready : out   std_logic;   -- '1': candidate is taken in this clock
    candidate       : in    candidate_t; -- what to evaluate
    probe_done      : out   std_logic;   -- '1' for one clock: answer to a probe
    probe_held      : out   std_logic;   -- '1': step one stays inside every bound
    result_valid    : out   std_logic;   -- '1': result is new
    result_ready    : in    std_logic;   -- '1': result is taken in this clock
    result          : out   result_t;    -- evaluation of a candidate
    busy            : out   std_logic    -- '1': candidates or results are under way
  );
end entity explorer_paper;

architecture rtl of explorer_paper is

  constant STAGE_COUNT : natural := 5;
  constant FIRST_PHASE : natural := 3 + boolean'pos(HAS_NEUTRAL);              -- place of v_ph_a among the outputs
  constant SERVED      : natural := FIRST_PHASE + 3 * boolean'pos(HAS_CAPACITORS); -- outputs that there are
  -- best cost plus the largest rounding error of effort/length, so that pruning is never too eager
  constant MARGIN : natural := 2 ** (EFFORT_WIDTH - 1);
  constant PRUNE_WIDTH : natural := COST_WIDTH + 1;

  type front_t is record
    busy      : std_logic;
    candidate : candidate_t;
    setup     : std_logic;                          -- the clock of stage 1
    issue     : natural range 0 to SERVED;          -- next output for stage 2, SERVED: all issued
    passed    : natural range 0 to SERVED;          -- outputs that have left stage 5
    dead      : std_logic;                          -- an output is outside at k or k+1
    violated  : std_logic;                          -- an output is outside at k+1
    excess    : trajectory_t;                       -- largest excess so far
    settle    : std_logic_vector(1 downto 0);       -- clocks since the last search finished
  end record front_t;

  type cost_state_t is record
    count     : natural range 0 to 9; -- 0: idle, 9: result waits
    candidate : candidate_t;
    feasible  : std_logic;
    saturated : std_logic;
    length    : length_t;
    slope     : weight_t;
    weight    : weight_t;
    inverse   : unsigned(RECIPROCAL_FRACTION downto 0);
    rate      : unsigned(RECIPROCAL_FRACTION + EFFORT_WIDTH downto 0);
    rank      : rank_t;
  end record cost_state_t;

  type outputs_t is array (1 to STAGE_COUNT) of natural range 0 to SERVED - 1;

  type lengths_t is array (0 to OUTPUTS - 1) of std_logic_vector(LENGTH_WIDTH - 1 downto 0);

  subtype voltage_t is signed(FORCED_WIDTH downto 0);

  type voltages_t is array (0 to 2) of voltage_t;

  subtype forced_sum_t is signed(FORCED_WIDTH + 2 downto 0);

  type inverses_t is array (natural range 0 to 2 ** LENGTH_WIDTH - 1) of reciprocal_t;

  -- 1/L for the lengths of one level: the whole table would become a block RAM, too slow for a sum in its clock
  function first_reciprocals return inverses_t is

    variable words : inverses_t;

  begin

    for l in natural range 0 to 2 ** LENGTH_WIDTH - 1 loop
      words(l) := RECIPROCALS(l);
    end loop;

    return words;

  end function first_reciprocals;

  constant INVERSES : inverses_t := first_reciprocals;

  -- place of an output in the node
  function error_of (place : natural) return natural is
  begin

    if (place >= FIRST_PHASE) then
      return place - FIRST_PHASE + 4;
    else
      return place;
    end if;

  end function error_of;

  function shorter (a, b : std_logic_vector) return std_logic_vector is
  begin

    if (unsigned(a) < unsigned(b)) then
      return a;
    else
      return b;
    end if;

  end function shorter;

  signal front      : front_t;
  signal front_next : front_t;
  signal back       : cost_state_t;
  signal back_next  : cost_state_t;
  signal accept     : std_logic;
  signal hand_over  : std_logic;

  signal valid     : std_logic_vector(1 to STAGE_COUNT); -- valid(n): stage n's registers hold an output
  signal output_of : outputs_t;

  signal voltage_1      : voltages_t;
  signal neutral_1      : trajectory_t;
  signal weight_slope_1 : weight_t;

  signal base_2   : trajectory_t;
  signal forced_2 : forced_sum_t;
  signal third_2  : voltage_t;
  signal error_2  : trajectory_t;
  signal bound_2  : bound_t;

  signal slope_3 : trajectory_t;
  signal error_3 : trajectory_t;
  signal bound_3 : bound_t;

  signal step_4   : unsigned(SEARCH_WIDTH - 1 downto 0);
  signal room_4   : unsigned(SEARCH_WIDTH - 1 downto 0);
  signal inside_4 : std_logic;
  signal end_4    : trajectory_t;
  signal bound_4  : bound_t;

  signal inside_5 : std_logic;
  signal excess_5 : trajectory_t;

  signal search_reset : std_logic;
  signal search_start : std_logic_vector(SERVED - 1 downto 0);
  signal search_done  : std_logic_vector(SERVED - 1 downto 0);
  signal search_below : std_logic_vector(SERVED - 1 downto 0);
  signal lengths      : lengths_t;
  signal shorter_01   : std_logic_vector(LENGTH_WIDTH - 1 downto 0);
  signal shorter_23   : std_logic_vector(LENGTH_WIDTH - 1 downto 0);
  signal shorter_456  : std_logic_vector(LENGTH_WIDTH - 1 downto 0);
  signal shortest     : std_logic_vector(LENGTH_WIDTH - 1 downto 0);

  signal prune_x      : std_logic_vector(PRUNE_WIDTH - 1 downto 0);
  signal prune_y      : std_logic_vector(PRUNE_WIDTH - 1 downto 0);
  signal prune_done   : std_logic;
  signal prune_length : std_logic_vector(LENGTH_WIDTH - 1 downto 0);
  signal prune        : std_logic;
  signal lower        : std_logic_vector(LENGTH_WIDTH downto 0);

  signal mac_a      : std_logic_vector(2 * WEIGHT_WIDTH - 1 downto 0);
  signal mac_b      : std_logic_vector(2 * WEIGHT_WIDTH - 1 downto 0);
  signal mac_enable : std_logic;
  signal mac_select : std_logic_vector(0 downto 0);
  signal mac_seed   : std_logic_vector(2 * WEIGHT_WIDTH - 1 downto 0);
  signal mac_sum    : std_logic_vector(2 * WEIGHT_WIDTH - 1 downto 0);

begin

  accept          <= candidate_valid and not front.busy;
  candidate_ready <= not front.busy;

  ---------------------------------------------------------------------------------------------
  -- Stages 1 to 5: one output a clock
  ---------------------------------------------------------------------------------------------

  p_stages : process (clk) is

    variable x       : natural range 0 to 2;
    variable charge  : signed(CURRENT_TERM_WIDTH downto 0);
    variable forced  : forced_sum_t;
    variable room_up : signed(TRAJECTORY_WIDTH downto 0);
    variable room_dn : signed(TRAJECTORY_WIDTH downto 0);
    variable step    : unsigned(TRAJECTORY_WIDTH - 1 downto 0);

  begin

    if rising_edge(clk) then
      -- stage 1
      if (front.setup = '1') then
        for phase in 0 to 2 loop
          voltage_1(phase) <= phase_voltage(node, phase, front.candidate.position(phase));
        end loop;

        neutral_1      <= resize(neutral_slope(node, front.candidate.position), TRAJECTORY_WIDTH);
        weight_slope_1 <= weight_slope_of(node, front.candidate.position);
      end if;

      -- stage 2: 2*u_x - u_y; the third phase follows one stage later
      if (valid(1) = '1') then
        forced_2 <= (others => '0');
        third_2  <= (others => '0');

        for phase in 0 to 2 loop
          if (output_of(1) = phase) then
            forced_2 <= shift_left(resize(voltage_1(phase), FORCED_WIDTH + 3), 1)
                        - voltage_1((phase + 1) mod 3);
            third_2  <= voltage_1((phase + 2) mod 3);
            base_2   <= node.slope(phase);
            bound_2  <= limits.bound_current;
          end if;

          if (HAS_CAPACITORS) then
            if (output_of(1) = FIRST_PHASE + phase) then
              charge  := weighted(node.phase_current(phase),
                                  is_in(front.candidate.position(phase), CAPACITOR_DISCHARGE),
                                  is_in(front.candidate.position(phase), CAPACITOR_CHARGE));
              base_2  <= resize(charge, TRAJECTORY_WIDTH);
              bound_2 <= limits.bound_phase;
            end if;
          end if;
        end loop;

        if (HAS_NEUTRAL) then
          if (output_of(1) = 3) then
            base_2  <= neutral_1;
            bound_2 <= limits.bound_neutral;
          end if;
        end if;

        for i in 0 to SERVED - 1 loop
          if (output_of(1) = i) then
            error_2 <= node.error(error_of(i));
          end if;
        end loop;
      end if;

      -- stage 3: slope of the error, the forced part rounded half up
      if (valid(2) = '1') then
        forced  := forced_2 - third_2 + 2 ** (FORCED_FRACTION - 1);
        slope_3 <= base_2 - shift_right(forced, FORCED_FRACTION);
        error_3 <= error_2;
        bound_3 <= bound_2;
      end if;

      -- stage 4: room at k in the direction of the slope, error at k+1
      if (valid(3) = '1') then
        room_up := signed(resize(bound_3, TRAJECTORY_WIDTH + 1)) - error_3;
        room_dn := signed(resize(bound_3, TRAJECTORY_WIDTH + 1)) + error_3;

        if (slope_3 >= 0) then
          room_4 <= unsigned(room_up(SEARCH_WIDTH - 1 downto 0));
        else
          room_4 <= unsigned(room_dn(SEARCH_WIDTH - 1 downto 0));
        end if;

        step := magnitude(slope_3);

        if (step(TRAJECTORY_WIDTH - 1 downto SEARCH_WIDTH) /= 0) then
          step_4 <= (others => '1');
        else
          step_4 <= step(SEARCH_WIDTH - 1 downto 0);
        end if;

        inside_4 <= not (room_up(TRAJECTORY_WIDTH) or room_dn(TRAJECTORY_WIDTH));
        end_4    <= error_3 + slope_3;
        bound_4  <= bound_3;
      end if;

      -- stage 5: excess at k+1
      if (valid(4) = '1') then
        inside_5 <= inside_4;
        excess_5 <= signed(magnitude(end_4)) - signed(resize(bound_4, TRAJECTORY_WIDTH));
      end if;
    end if;

  end process p_stages;

  p_valid : process (clk) is
  begin

    if rising_edge(clk) then
      valid(2 to STAGE_COUNT)     <= valid(1 to STAGE_COUNT - 1);
      output_of(2 to STAGE_COUNT) <= output_of(1 to STAGE_COUNT - 1);

      if (rst = '1' or front_next.busy = '0') then
        valid(2 to STAGE_COUNT) <= (others => '0');
      end if;
    end if;

  end process p_valid;

  -- stage 1's registers are loaded once per candidate; the outputs are counted out of them
  valid(1)     <= to_std_logic(front.busy = '1' and front.setup = '0' and front.issue /= SERVED);
  output_of(1) <= front.issue when front.issue /= SERVED else
                  0;

  ---------------------------------------------------------------------------------------------
  -- Searches
  ---------------------------------------------------------------------------------------------

  search_reset <= rst or accept;

  g_searches : for i in 0 to SERVED - 1 generate

    search_start(i) <= to_std_logic(valid(4) = '1' and output_of(4) = i);

    i_search : entity work.binary_search
      generic map (
        WIDTH        => SEARCH_WIDTH,
        LENGTH_WIDTH => LENGTH_WIDTH
      )
      port map (
        clk    => clk,
        rst    => search_reset,
        start  => search_start(i),
        x      => std_logic_vector(step_4),
        y      => std_logic_vector(room_4),
        lower  => lower,
        upper  => std_logic_vector(limits.horizon),
        done   => search_done(i),
        below  => search_below(i),
        length => lengths(i)
      );

  end generate g_searches;

  g_none : for i in SERVED to OUTPUTS - 1 generate
    lengths(i) <= (others => '1');
  end generate g_none;

  p_shortest : process (clk) is
  begin

    if rising_edge(clk) then
      shorter_01  <= shorter(lengths(0), lengths(1));
      shorter_23  <= shorter(lengths(2), lengths(3));
      shorter_456 <= shorter(lengths(4), shorter(lengths(5), lengths(6)));
      shortest    <= shorter(shorter(shorter_01, shorter_23), shorter_456);
    end if;

  end process p_shortest;

  -- lengths l with best_cost * l < effort cannot win; the shortest that can is one more
  prune_x <= std_logic_vector(resize(best_cost, PRUNE_WIDTH) + MARGIN);

  p_prune_y : process (front.candidate.effort) is

    variable effort : unsigned(PRUNE_WIDTH - 1 downto 0);

  begin

    effort := shift_left(resize(front.candidate.effort, PRUNE_WIDTH), RECIPROCAL_FRACTION);

    if (front.candidate.effort = 0) then
      prune_y <= (others => '0');
    else
      prune_y <= std_logic_vector(effort - 1);
    end if;

  end process p_prune_y;

  i_prune : entity work.binary_search
    generic map (
      WIDTH        => PRUNE_WIDTH,
      LENGTH_WIDTH => LENGTH_WIDTH
    )
    port map (
      clk    => clk,
      rst    => search_reset,
      start  => front.setup,
      x      => prune_x,
      y      => prune_y,
      lower  => (LENGTH_WIDTH downto 0 => '0'),
      upper  => (LENGTH_WIDTH - 1 downto 0 => '1'),
      done   => prune_done,
      below  => open,
      length => prune_length
    );

  p_lower : process (clk) is
  begin

    if rising_edge(clk) then
      if (front.setup = '1') then
        prune <= best_valid;
      end if;

      if (prune_done = '1' and prune = '1' and front.setup = '0') then
        lower <= std_logic_vector(unsigned('0' & prune_length) + 1);
      else
        lower <= (others => '0');
      end if;
    end if;

  end process p_lower;

  ---------------------------------------------------------------------------------------------
  -- Control of stages and searches
  ---------------------------------------------------------------------------------------------

  p_front : process (front, accept, candidate, valid, inside_5, excess_5, search_done, search_below,
                     best_valid, back, result_ready) is

    variable v         : front_t;
    variable finished  : std_logic;
    variable back_free : std_logic;

  begin

    v           := front;
    hand_over   <= '0';
    probe_done  <= '0';
    probe_held  <= '0';
    finished    := '0';
    back_free   := to_std_logic(back.count = 0 or (back.count = 9 and result_ready = '1'));

    if (front.busy = '1') then
      v.setup := '0';

      if (front.setup = '0' and front.issue /= SERVED) then
        v.issue := front.issue + 1;
      end if;

      if (valid(5) = '1') then
        v.passed := front.passed + 1;

        if (front.passed = 0 or excess_5 > front.excess) then
          v.excess := excess_5;
        end if;

        if (excess_5 > 0) then
          v.violated := '1';
          v.dead     := '1';
        end if;

        if (inside_5 = '0') then
          v.dead := '1';
        end if;
      end if;

      if (front.candidate.probe = '1') then
        if (front.violated = '1' or front.passed = SERVED) then
          probe_done <= '1';
          probe_held <= not front.violated;
          finished   := '1';
        end if;
      elsif (best_valid = '1' and (front.dead = '1' or search_below /= (search_below'range => '0'))) then
        -- cannot win, and J_dl is not needed any more
        finished := '1';
      elsif (front.passed = SERVED) then
        if (front.dead = '1') then
          hand_over <= back_free;
          finished  := back_free;
        elsif (search_done = (search_done'range => '1')) then
          v.settle := front.settle(0) & '1';

          if (front.settle = "11") then
            hand_over <= back_free;
            finished  := back_free;
          end if;
        end if;
      end if;

      if (finished = '1') then
        v.busy := '0';
      end if;
    elsif (accept = '1') then
      v.busy      := '1';
      v.candidate := candidate;
      v.setup     := '1';
      v.issue     := 0;
      v.passed    := 0;
      v.dead      := '0';
      v.violated  := '0';
      v.settle    := "00";
    end if;

    front_next <= v;

  end process p_front;

  ---------------------------------------------------------------------------------------------
  -- Cost
  ---------------------------------------------------------------------------------------------

  -- first product: length * slope of sqrt(lambda_n)*v_n; second: the square
  mac_a      <= std_logic_vector(back.weight) & std_logic_vector(back.slope);
  mac_b      <= std_logic_vector(back.weight)
                & std_logic_vector(resize(back.length, WEIGHT_WIDTH));
  mac_enable <= to_std_logic(back.count = 1 or back.count = 5);
  mac_select <= "1" when back.count > 4 else
                "0";
  mac_seed   <= std_logic_vector(shift_left(resize(node.weight_start, 2 * WEIGHT_WIDTH),
                                            WEIGHT_SLOPE_FRACTION)) when back.count <= 4 else
                (others => '0');

  i_mac : entity work.mac_block
    generic map (
      A_WIDTH           => WEIGHT_WIDTH,
      B_WIDTH           => WEIGHT_WIDTH,
      A_WORDS           => 2,
      B_WORDS           => 2,
      ALIGNMENT_STEP    => 0,
      ACCUMULATOR_WIDTH => 2 * WEIGHT_WIDTH
    )
    port map (
      clk         => clk,
      enable      => mac_enable,
      a_inputs    => mac_a,
      a_select    => mac_select,
      b_inputs    => mac_b,
      b_select    => mac_select,
      alignment   => "00",
      accumulate  => '0',
      seed        => mac_seed,
      accumulator => mac_sum
    );

  p_back : process (back, hand_over, front, shortest, weight_slope_1, mac_sum, limits, result_ready) is

    variable v      : cost_state_t;
    variable sum    : signed(2 * WEIGHT_WIDTH - 1 downto 0);
    variable square : unsigned(COST_WIDTH - 1 downto 0);

  begin

    v      := back;
    sum    := shift_right(signed(mac_sum), WEIGHT_SLOPE_FRACTION);
    square := (others => '0');

    for i in WEIGHT_SHIFTS'range loop
      if (limits.weight_scale = i) then
        square := resize(unsigned(mac_sum(2 * WEIGHT_WIDTH - 2 downto WEIGHT_SHIFTS(i))), COST_WIDTH);
      end if;
    end loop;

    if (back.count = 9) then
      if (result_ready = '1') then
        v.count := 0;
      end if;
    elsif (back.count /= 0) then
      v.count := back.count + 1;
    end if;

    case back.count is

      when 1 =>

        v.inverse := unsigned(INVERSES(to_integer(back.length)));

      when 2 =>

        -- shift and add: a multiplier would be wasted on four bits
        v.rate := (others => '0');

        for i in 0 to EFFORT_WIDTH - 1 loop
          if (back.candidate.effort(i) = '1') then
            v.rate := v.rate + shift_left(resize(back.inverse, v.rate'length), i);
          end if;
        end loop;

      when 4 =>

        v.weight    := clip(sum, WEIGHT_WIDTH);
        v.saturated := overflows(sum, WEIGHT_WIDTH);

      when 8 =>

        v.rank := resize(resize(back.rate, COST_WIDTH) + square, RANK_WIDTH);

      when others =>

        null;

    end case;

    if (hand_over = '1') then
      v.candidate := front.candidate;
      v.feasible  := not front.dead;
      v.saturated := '0';
      v.length    := unsigned(shortest);
      v.slope     := weight_slope_1;
      v.rank      := ranked(front.excess);

      if (front.dead = '1') then
        v.length := (others => '0');
        v.count  := 9;
      else
        v.count := 1;
      end if;
    end if;

    back_next <= v;

  end process p_back;

  p_state : process (clk) is
  begin

    if rising_edge(clk) then
      front <= front_next;
      back  <= back_next;

      if (rst = '1') then
        front.busy  <= '0';
        front.setup <= '0';
        back.count  <= 0;
      end if;
    end if;

  end process p_state;

  result_valid <= to_std_logic(back.count = 9);

  result.feasible  <= back.feasible;
  result.saturated <= back.saturated;
  result.index     <= back.candidate.index;
  result.length    <= back.length;
  result.rank      <= back.rank;

  busy <= front.busy or to_std_logic(back.count /= 0);

end architecture rtl;
