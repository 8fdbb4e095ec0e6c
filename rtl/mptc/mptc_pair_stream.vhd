-- Stream of pairs of voltage vectors (Paper B, sections 5.1 and 5.2): finds the duty of each and keeps the cheapest.
--
-- MPTC2 tries the six active vectors with zero voltage, GTV these and the six pairs of vectors one leg apart. MPTC1
-- has one pair: the vector that mptc_vector_stream found, with zero. Four mptc_duty search at a time, begun two clocks
-- apart; after DUTY_CLOCKS each gives its result and takes the next pair. mptc_shares makes the pair's share of it,
-- two mac_blocks its way. Then it goes on to the magnitude and to the cost as a vector does in mptc_vector_stream,
-- which compares. A tie goes to the earliest pair. Beside a vector zero is u_0 after 1, 3, 5 and u_7 after 2, 4, 6.
--
-- Every pair is a start and a direction: the second vector, and the active vector that is the first less the second.
-- Torque of both is formed by one addition, a clock after the other. A duty beyond the period becomes 4095, one below
-- zero becomes 0: the first comparison tells, and the search then means nothing. Equal torques: 4095.
--
-- Formats: as in model/directmpc/mptc/formats.py; times 1/4096 of the period.
-- Latency: pair n is looked up PAIR_SPACING * (n mod 4) + DUTY_CLOCKS * (n / 4) clocks after the clock that follows
-- begin_pairs; its search begins PAIR_AHEAD clocks later; its result comes DUTY_CLOCKS clocks later, its flux
-- PAIR_REGISTERS after that, its comparison STREAM_COMPARE after its flux. chosen is valid with last.
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
    method      : in    family_t;        -- FAMILY_NONE, FAMILY_MPTC1, FAMILY_MPTC2 or FAMILY_GTV, stable
    leader      : in    vector_t;        -- MPTC1's vector, active
    state       : in    mptc_state_t;    -- torque terms, stable
    cheaper     : in    std_logic;       -- '1': the pair that is compared is the cheapest so far
    found       : out   mptc_duty_t;     -- a pair with its duty
    tried       : out   mptc_tried_t;    -- when its flux is there, and its torque error when the cost takes it
    chosen      : out   mptc_sequence_t  -- what to apply next; with last
  );
end entity mptc_pair_stream;

architecture rtl of mptc_pair_stream is

  constant ROUNDS : positive := EDGE_PAIRS / SEARCHES + 1; -- in the last one results come, and none begins

  constant REST_WIDTH : positive := ERROR_WIDTH - DUTY_SHIFT - TIME_WIDTH; -- bits of a torque error within

  subtype double_error_t is signed(ERROR_WIDTH downto 0);

  subtype slot_t is unsigned(3 downto 0);

  subtype duty_t is std_logic_vector(TIME_WIDTH - 1 downto 0);

  type duties_t is array (0 to SEARCHES - 1) of duty_t;

  type errors_t is array (0 to SEARCHES - 1) of error_t;

  subtype named_t is std_logic_vector(TIME_WIDTH + 5 downto 0); -- duty, first and second vector

  type pair_t is record
    first     : vector_t;  -- active
    second    : vector_t;  -- active, or zero voltage as u_0
    direction : vector_t;  -- first less second, active
    there     : std_logic; -- '1': there is such a pair
  end record pair_t;

  -- what is known of a pair before its search

  subtype known_t is std_logic_vector(TERM_WIDTH + 11 downto 0);

  signal active      : std_logic;
  signal slot        : slot_t;                        -- 0 to DUTY_CLOCKS - 1
  signal turn        : unsigned(1 downto 0);          -- 0 to ROUNDS - 1
  signal index       : unsigned(3 downto 0);          -- number of the pair that is looked up
  signal pair        : pair_t;                        -- what is looked up in an even slot
  signal pair_1      : pair_t;                        -- a clock later: its torques are formed
  signal pair_2      : pair_t;                        -- two more later: its search begins
  signal number      : vector_t;                      -- vector whose torque is formed
  signal change      : error_t;                       -- torque of a vector, as if its part along alpha was positive
  signal opposed     : std_logic;                     -- '1': that is negative
  signal level       : error_t;                       -- torque error without voltage
  signal total       : error_t;                       -- span; a clock later the torque error with the second vector
  signal falls       : std_logic;                     -- '1': span was negative: complements
  signal error       : error_t;
  signal span        : error_t;
  signal trial       : double_error_t;                -- error less span
  signal within      : std_logic;                     -- the duty is between 0 and 1
  signal beyond      : std_logic;                     -- the duty is that of the whole period
  signal outside     : term_t;                        -- torque error that is left where it is not within
  signal known       : known_t;
  signal known_late  : known_t;                       -- the same, with its result
  signal load        : std_logic_vector(0 to SEARCHES - 1);
  signal duties      : duties_t;
  signal errors      : errors_t;
  signal bits        : duty_t;                        -- what was found
  signal rest        : unsigned(REST_WIDTH - 1 downto 0);
  signal duty        : duty_t;                        -- the same, with its limits
  signal first       : vector_t;                      -- its pair
  signal second      : vector_t;
  signal result_due  : std_logic;                     -- '1': a search ends
  signal ended       : std_logic;                     -- '1': a search has ended
  signal on_way      : std_logic_vector(STREAM_COMPARE + PAIR_REGISTERS downto 2); -- results on their way, by clocks
  signal flux_due    : std_logic;                     -- '1': its way is in the accumulators
  signal left        : std_logic_vector(TERM_WIDTH - 1 downto 0);
  signal delayed     : std_logic_vector(TERM_WIDTH - 1 downto 0);
  signal named       : named_t;
  signal compared    : named_t;
  signal best        : named_t;
  signal winner      : named_t;

  -- pair number of a method; given is MPTC1's vector
  function pair_of (rule : family_t; place : natural; given : vector_t) return pair_t is

    variable result : pair_t;

  begin

    result.second := "000";

    if (rule = FAMILY_GTV) then
      result.first     := std_logic_vector(to_unsigned(PAIR_TABLE(place mod 16, 0), 3));
      result.second    := std_logic_vector(to_unsigned(PAIR_TABLE(place mod 16, 1), 3));
      result.direction := std_logic_vector(to_unsigned(PAIR_TABLE(place mod 16, 2), 3));
      result.there     := to_std_logic(place < EDGE_PAIRS);
    else
      result.first := std_logic_vector(to_unsigned((place + 1) mod 8, 3));

      if (rule = FAMILY_MPTC1) then
        result.first := given;
        result.there := to_std_logic(place = 0);
      else
        result.there := to_std_logic(place < ZERO_PAIRS);
      end if;

      result.direction := result.first;
    end if;

    return result;

  end function pair_of;

begin

  assert PAIR_SPACING = 2 and SEARCHES = 4 and DUTY_CLOCKS = 12 and PAIR_AHEAD = 4
    report "mptc_pair_stream: the slots are those of four searches, two clocks apart"
    severity failure;

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
          slot <= (others => '0');

          if (turn /= ROUNDS - 1) then
            turn <= turn + 1;
          else
            active <= '0';
          end if;
        end if;
      end if;

      if (begin_pairs = '1') then
        active <= '1';
        slot   <= (others => '0');
        turn   <= (others => '0');
      end if;

      -- the method may be another one from now on
      if (rst = '1' or last = '1') then
        active <= '0';
      end if;
    end if;

  end process p_slots;

  index <= turn & slot(2 downto 1);
  pair  <= pair_of(method, to_integer(index), leader);

  p_ahead : process (clk) is
  begin

    if rising_edge(clk) then
      if (slot(0) = '0') then
        pair_1       <= pair;
        pair_1.there <= pair.there and active and not slot(3);
        pair_2       <= pair_1;
      end if;
    end if;

  end process p_ahead;

  ---------------------------------------------------------------------------------------------
  -- Torques: of the direction, then of the second vector
  ---------------------------------------------------------------------------------------------

  number <= pair_1.direction when slot(0) = '1' else
            pair_1.second;

  p_change : process (clk) is

    variable step : error_t;

  begin

    if rising_edge(clk) then
      step := resize(state.along, ERROR_WIDTH);

      if (whole_alpha(number) = '0') then
        step := gated(shift_left(resize(state.across, ERROR_WIDTH), 1), has_beta(number));
      end if;

      change  <= moved(gated(resize(state.along, ERROR_WIDTH), has_alpha(number)), step,
                       has_beta(number) and not (negative_alpha(number) xor negative_beta(number)));
      opposed <= negative_alpha(number);

      -- rotor_alpha: what the one's complement in level is off
      level <= shift_left(resize(state.level, ERROR_WIDTH), DUTY_SHIFT)
               - shift_right(state.rotor_alpha, TERM_SHIFT - DUTY_SHIFT);
    end if;

  end process p_change;

  total <= moved(gated(level, slot(0)), change, opposed xor slot(0));

  p_request : process (clk) is

    variable sign : error_t;

  begin

    if rising_edge(clk) then
      if (slot(0) = '0') then
        sign  := (others => sign_of(total));
        span  <= total xor sign;
        falls <= sign_of(total);
      else
        sign  := (others => falls);
        error <= total xor sign;
      end if;
    end if;

  end process p_request;

  ---------------------------------------------------------------------------------------------
  -- Searches
  ---------------------------------------------------------------------------------------------

  trial  <= resize(error, ERROR_WIDTH + 1) - span;
  within <= not sign_of(error) and sign_of(trial);
  beyond <= not sign_of(trial) or to_std_logic(span = 0);

  outside <= error(ERROR_WIDTH - 1 downto DUTY_SHIFT) when sign_of(trial) = '1' else
             trial(ERROR_WIDTH - 1 downto DUTY_SHIFT);

  known <= pair_2.first & pair_2.second & pair_2.direction & pair_2.there & within & beyond
           & std_logic_vector(outside);

  i_known : entity work.delay_line
    generic map (
      WIDTH  => TERM_WIDTH + 12,
      CLOCKS => DUTY_CLOCKS + 1
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => known,
      delayed => known_late
    );

  g_units : for n in 0 to SEARCHES - 1 generate

    load(n) <= to_std_logic(slot = PAIR_AHEAD + PAIR_SPACING * n);

    i_duty : entity work.mptc_duty
      port map (
        clk   => clk,
        load  => load(n),
        error => error,
        span  => span,
        duty  => duties(n),
        left  => errors(n)
      );

  end generate g_units;

  ---------------------------------------------------------------------------------------------
  -- Results
  ---------------------------------------------------------------------------------------------

  p_result : process (clk) is

    variable unit : natural range 0 to SEARCHES - 1;

  begin

    if rising_edge(clk) then
      unit := to_integer(unsigned(std_logic_vector'(slot(3) & slot(1))));
      bits <= duties(unit);
      rest <= unsigned(errors(unit)(ERROR_WIDTH - 1 downto DUTY_SHIFT + TIME_WIDTH));
    end if;

  end process p_result;

  first  <= known_late(TERM_WIDTH + 11 downto TERM_WIDTH + 9);
  second <= known_late(TERM_WIDTH + 8 downto TERM_WIDTH + 6);

  p_limits : process (known_late, bits, rest) is
  begin

    duty <= (others => known_late(TERM_WIDTH));
    left <= known_late(TERM_WIDTH - 1 downto 0);

    if (known_late(TERM_WIDTH + 1) = '1') then
      duty <= bits;
      left <= std_logic_vector(resize(rest, TERM_WIDTH));
    end if;

  end process p_limits;

  found.duty      <= duty;
  found.second    <= second;
  found.direction <= known_late(TERM_WIDTH + 5 downto TERM_WIDTH + 3);
  found.take      <= ended and known_late(TERM_WIDTH + 2);

  named <= duty & first & second;

  result_due <= active and to_std_logic(turn /= 0) and not slot(0) and (slot(2) or slot(3));

  p_on_way : process (clk) is
  begin

    if rising_edge(clk) then
      ended    <= result_due;
      flux_due <= on_way(PAIR_REGISTERS - 2) and to_std_logic(method /= FAMILY_MPTC1);
      on_way   <= on_way(on_way'high - 1 downto 2) & (ended and known_late(TERM_WIDTH + 2));

      -- a pair on its way does not go on into the next decision
      if (rst = '1' or last = '1') then
        ended    <= '0';
        flux_due <= '0';
        on_way   <= (others => '0');
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

  tried.enable  <= flux_due;
  tried.take    <= on_way(STREAM_TERM + PAIR_REGISTERS);
  tried.left    <= signed(delayed);
  tried.compare <= on_way(STREAM_COMPARE + PAIR_REGISTERS);

  ---------------------------------------------------------------------------------------------
  -- Comparison
  ---------------------------------------------------------------------------------------------

  winner <= named when method = FAMILY_MPTC1 else
            best;

  p_best : process (clk) is
  begin

    if rising_edge(clk) then
      if (on_way(STREAM_COMPARE + PAIR_REGISTERS) = '1' and cheaper = '1') then
        best <= compared;
      end if;
    end if;

  end process p_best;

  p_chosen : process (winner) is

    variable zero : vector_t;

  begin

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

  end process p_chosen;

end architecture rtl;
