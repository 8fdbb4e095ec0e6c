-- Stream of pairs of voltage vectors (Paper B, sections 5.1 and 5.2): finds the duty of each and keeps the cheapest.
--
-- MPTC2 tries the six active vectors with zero voltage, GTV these and the six pairs of vectors one leg apart. MPTC1 has
-- one pair: the vector that mptc_vector_stream found, with zero. Four mptc_duty search at a time, begun a clock apart;
-- after DUTY_CLOCKS each gives its result and takes the next pair. A result goes on to the magnitude and to the cost
-- as a vector does in mptc_vector_stream. A tie goes to the earliest pair. Zero voltage beside a vector is u_0 after
-- 1, 3, 5 and u_7 after 2, 4, 6.
--
-- Every pair is a start and a direction: the second vector, and the active vector that is the first less the second.
--
-- Formats: as in model/directmpc/mptc/formats.py; times 1/4096 of the period.
-- Latency: pair n is looked up n mod 4 + DUTY_CLOCKS * (n / 4) clocks after the clock that follows begin_pairs, its
-- search begins PAIR_AHEAD clocks later; its
-- result comes DUTY_CLOCKS clocks later, its flux PAIR_REGISTERS after that, its comparison STREAM_COMPARE after its
-- flux. chosen is stable one clock after
-- last.
-- Overflow: none here; a distance that does not fit is flagged by mptc_vector_stream.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_pair_stream is
  port (
    clk         : in    std_logic;       -- rising edge
    rst         : in    std_logic;       -- synchronous, active high
    begin_pairs : in    std_logic;       -- '1': the first pair is looked up a clock later
    last        : in    std_logic;       -- '1': the last pair has been compared, or MPTC1's duty is there
    method      : in    family_t;         -- FAMILY_NONE, FAMILY_MPTC1, FAMILY_MPTC2 or FAMILY_GTV, stable
    leader      : in    vector_t;        -- MPTC1's vector, active
    state       : in    mptc_state_t;    -- flux and torque terms, stable
    sum         : in    sum_t;           -- cost of the pair that is compared, signed
    tried       : out   mptc_tried_t;    -- flux of a pair, and its torque error when the cost takes it
    chosen      : out   mptc_sequence_t  -- what to apply next
  );
end entity mptc_pair_stream;

architecture rtl of mptc_pair_stream is

  constant ROUNDS : positive := EDGE_PAIRS / SEARCHES + 1; -- in the last one results come, and none begins

  constant FLUX_WIDTH : positive := LENGTH_WIDTH + WAY_GUARD;

  subtype flux_t is signed(FLUX_WIDTH - 1 downto 0);

  subtype cost_t is signed(COST_WIDTH - COST_DROPPED - 1 downto 0);

  type founds_t is array (0 to SEARCHES - 1) of mptc_found_t;

  subtype named_t is std_logic_vector(TIME_WIDTH + 5 downto 0); -- duty, first and second vector

  type pair_t is record
    first     : vector_t;  -- active
    second    : vector_t;  -- active, or zero voltage as u_0
    direction : vector_t;  -- first less second, active
    there     : std_logic; -- '1': there is such a pair
  end record pair_t;

  type pairs_of_units_t is array (0 to SEARCHES - 1) of pair_t;

  signal active      : std_logic;
  signal slot        : natural range 0 to DUTY_CLOCKS - 1;
  signal turn        : natural range 0 to ROUNDS - 1;
  signal pair        : pair_t;                        -- what is looked up in this clock
  signal pair_1      : pair_t;                        -- a clock later: its torques are formed
  signal pair_2      : pair_t;                        -- two clocks later: its search begins
  signal active_1    : std_logic;
  signal active_2    : std_logic;
  signal slot_1      : natural range 0 to DUTY_CLOCKS - 1;
  signal slot_2      : natural range 0 to DUTY_CLOCKS - 1;
  signal later_1     : std_logic;                     -- '1': not in the first round
  signal later_2     : std_logic;
  signal held        : pairs_of_units_t;              -- what the units search
  signal request     : mptc_search_t;
  signal load        : std_logic_vector(0 to SEARCHES - 1);
  signal founds      : founds_t;
  signal outcome     : mptc_found_t;                  -- result of this clock
  signal searched    : pair_t;                        -- its pair
  signal found       : mptc_found_t;                  -- both a clock later
  signal owner       : pair_t;
  signal on_way      : std_logic_vector(STREAM_COMPARE + PAIR_REGISTERS downto 1); -- results on their way, by clocks
  signal left        : std_logic_vector(TERM_WIDTH - 1 downto 0);
  signal delayed     : std_logic_vector(TERM_WIDTH - 1 downto 0);
  signal named       : named_t;
  signal compared    : named_t;
  signal cost        : cost_t;
  signal best_cost   : cost_t;
  signal best        : named_t;
  signal better      : std_logic;
  signal winner      : named_t;

  -- pair number of a method; given is MPTC1's vector
  function pair_of (rule : family_t; index : natural; given : vector_t) return pair_t is

    variable result : pair_t;

  begin

    result.second := "000";

    if (rule = FAMILY_GTV) then
      result.first     := std_logic_vector(to_unsigned(PAIR_TABLE(index mod 16, 0), 3));
      result.second    := std_logic_vector(to_unsigned(PAIR_TABLE(index mod 16, 1), 3));
      result.direction := std_logic_vector(to_unsigned(PAIR_TABLE(index mod 16, 2), 3));
      result.there     := to_std_logic(index < EDGE_PAIRS);
    else
      result.first := std_logic_vector(to_unsigned((index + 1) mod 8, 3));

      if (rule = FAMILY_MPTC1) then
        result.first := given;
        result.there := to_std_logic(index = 0);
      else
        result.there := to_std_logic(index < ZERO_PAIRS);
      end if;

      result.direction := result.first;
    end if;

    return result;

  end function pair_of;

  -- torque of a vector in quarters of a torque term
  function fine_change (number : vector_t; along, across : term_t) return error_t is

    variable part  : error_t;
    variable total : error_t;

  begin

    part := resize(along, ERROR_WIDTH);

    if (whole_alpha(number) = '1') then
      part := shift_left(part, 1);
    end if;

    total := gated(part, has_alpha(number));

    if (negative_alpha(number) = '1') then
      total := -total;
    end if;

    part  := gated(shift_left(resize(across, ERROR_WIDTH), 1), has_beta(number));
    return moved(total, part, not negative_beta(number));

  end function fine_change;

  -- way of a vector along alpha, and along beta
  function way_alpha (number : vector_t; step : signed_word_t) return way_t is

    variable part : way_t;

  begin

    part := gated(resize(step, WAY_WIDTH), has_alpha(number));

    if (whole_alpha(number) = '1') then
      part := shift_left(part, 1);
    end if;

    if (negative_alpha(number) = '1') then
      part := -part;
    end if;

    return part;

  end function way_alpha;

  function way_beta (number : vector_t; step : signed_word_t) return way_t is

    variable part : way_t;

  begin

    part := gated(shift_left(resize(step, WAY_WIDTH), 1), has_beta(number));

    if (negative_beta(number) = '1') then
      part := -part;
    end if;

    return part;

  end function way_beta;

begin

  ---------------------------------------------------------------------------------------------
  -- Who searches what, and when
  ---------------------------------------------------------------------------------------------

  p_slots : process (clk) is
  begin

    if rising_edge(clk) then
      if (active = '1') then
        if (slot /= DUTY_CLOCKS - 1) then
          slot <= slot + 1;
        else
          slot <= 0;

          if (turn /= ROUNDS - 1) then
            turn <= turn + 1;
          else
            active <= '0';
          end if;
        end if;
      end if;

      if (begin_pairs = '1') then
        active <= '1';
        slot   <= 0;
        turn   <= 0;
      end if;

      -- the method may be another one from now on
      if (rst = '1' or last = '1') then
        active <= '0';
      end if;
    end if;

  end process p_slots;

  pair <= pair_of(method, SEARCHES * turn + slot mod SEARCHES, leader);

  p_ahead : process (clk) is
  begin

    if rising_edge(clk) then
      pair_1   <= pair;
      pair_2   <= pair_1;
      slot_1   <= slot;
      slot_2   <= slot_1;
      later_1  <= to_std_logic(turn /= 0);
      later_2  <= later_1;
      active_1 <= active;
      active_2 <= active_1;
    end if;

  end process p_ahead;

  p_request : process (clk) is

    variable error : error_t;
    variable span  : error_t;
    variable sign  : error_t;

  begin

    if rising_edge(clk) then
      -- rotor_alpha: what the one's complement in level is off
      error := shift_left(resize(state.level, ERROR_WIDTH), DUTY_SHIFT)
               - shift_right(state.rotor_alpha, TERM_SHIFT - DUTY_SHIFT)
               - fine_change(pair_1.second, state.along, state.across);
      span  := fine_change(pair_1.direction, state.along, state.across);
      sign  := (others => span(ERROR_WIDTH - 1));

      request.error <= error xor sign;
      request.span  <= span xor sign;
      request.way_x <= way_alpha(pair_1.direction, state.step_alpha);
      request.way_y <= way_beta(pair_1.direction, state.step_beta);
    end if;

  end process p_request;

  g_units : for n in 0 to SEARCHES - 1 generate

    load(n) <= to_std_logic(active_2 = '1' and slot_2 = n);

    i_duty : entity work.mptc_duty
      port map (
        clk     => clk,
        load    => load(n),
        request => request,
        result  => founds(n)
      );

    p_held : process (clk) is
    begin

      if rising_edge(clk) then
        if (load(n) = '1') then
          held(n) <= pair_2;
        end if;

        if (begin_pairs = '1' or rst = '1') then
          held(n).there <= '0';
        end if;
      end if;

    end process p_held;

  end generate g_units;

  ---------------------------------------------------------------------------------------------
  -- Results
  ---------------------------------------------------------------------------------------------

  p_outcome : process (slot_2, founds, held) is
  begin

    outcome  <= founds(0);
    searched <= held(0);

    for n in 1 to SEARCHES - 1 loop
      if (slot_2 = n) then
        outcome  <= founds(n);
        searched <= held(n);
      end if;
    end loop;

  end process p_outcome;

  p_found : process (clk) is
  begin

    if rising_edge(clk) then
      found <= outcome;
      owner <= searched;
    end if;

  end process p_found;

  p_left : process (found) is
  begin

    left <= std_logic_vector(resize(shift_right(found.error, DUTY_SHIFT + 1), TERM_WIDTH));

    if (found.within = '1') then
      left <= std_logic_vector(resize(shift_right(found.error, DUTY_SHIFT + 1 + TIME_WIDTH), TERM_WIDTH));
    end if;

  end process p_left;

  p_flux : process (clk) is

    variable x : flux_t;
    variable y : flux_t;

  begin

    if rising_edge(clk) then
      x := shift_left(resize(state.stator_alpha, FLUX_WIDTH), LENGTH_GUARD + WAY_GUARD)
           + way_alpha(owner.second, state.step_alpha) + found.way_x;
      y := shift_left(resize(state.stator_beta, FLUX_WIDTH), LENGTH_GUARD + WAY_GUARD)
           + way_beta(owner.second, state.step_beta) + found.way_y;

      tried.x <= x(FLUX_WIDTH - 1 downto WAY_GUARD);
      tried.y <= y(FLUX_WIDTH - 1 downto WAY_GUARD);
    end if;

  end process p_flux;

  named <= found.duty & owner.first & owner.second;

  p_on_way : process (clk) is
  begin

    if rising_edge(clk) then
      on_way <= on_way(on_way'high - 1 downto 1)
                & (to_std_logic(active_2 = '1' and slot_2 < SEARCHES) and later_2 and searched.there);

      if (rst = '1') then
        on_way <= (others => '0');
      end if;
    end if;

  end process p_on_way;

  i_left : entity work.delay_line
    generic map (
      WIDTH  => TERM_WIDTH,
      CLOCKS => STREAM_TERM + PAIR_REGISTERS - 1
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => left,
      delayed => delayed
    );

  i_named : entity work.delay_line
    generic map (
      WIDTH  => TIME_WIDTH + 6,
      CLOCKS => STREAM_COMPARE + PAIR_REGISTERS - 1
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => named,
      delayed => compared
    );

  tried.enable <= on_way(PAIR_REGISTERS) and to_std_logic(method /= FAMILY_MPTC1);
  tried.take   <= on_way(STREAM_TERM + PAIR_REGISTERS);
  tried.left   <= signed(delayed);

  ---------------------------------------------------------------------------------------------
  -- Comparison
  ---------------------------------------------------------------------------------------------

  cost   <= sum(COST_WIDTH - 1 downto COST_DROPPED);
  better <= on_way(STREAM_COMPARE + PAIR_REGISTERS) and to_std_logic(cost < best_cost);

  winner <= named when method = FAMILY_MPTC1 else
            best;

  p_best : process (clk) is

    variable zero : vector_t;

  begin

    if rising_edge(clk) then
      if (better = '1') then
        best      <= compared;
        best_cost <= cost;
      end if;

      -- before the first comparison: worse than any cost
      if (begin_pairs = '1') then
        best_cost                       <= (others => '1');
        best_cost(best_cost'length - 1) <= '0';
      end if;

      if (last = '1') then
        zero := (others => zero_is_u_7(winner(5 downto 3)));

        chosen.u1 <= winner(5 downto 3);
        chosen.u2 <= winner(2 downto 0);
        chosen.u3 <= winner(2 downto 0);

        if (winner(2 downto 0) = "000") then
          chosen.u2 <= zero;
          chosen.u3 <= zero;
        end if;

        chosen.t1 <= '0' & winner(TIME_WIDTH + 5 downto 6);
        chosen.t2 <= std_logic_vector(to_unsigned(2 ** TIME_WIDTH, TIME_WIDTH + 1)
                                      - unsigned('0' & winner(TIME_WIDTH + 5 downto 6)));
      end if;
    end if;

  end process p_best;

end architecture rtl;
