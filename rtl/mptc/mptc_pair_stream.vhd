-- Stream of pairs of voltage vectors (Paper B, sections 5.1 and 5.2): finds the duty of each and keeps the cheapest.
--
-- MPTC2 tries the six active vectors with zero voltage, GTV these and the six pairs of vectors one leg apart. MPTC1
-- has one pair: the vector that mptc_vector_stream found, with zero. mptc_shares makes the pair's share of its duty,
-- two mac_blocks its way. Then it goes on to the magnitude and to the cost as a vector does in mptc_vector_stream,
-- which compares. Of equal ones the lowest first vector wins, then the lowest second. Beside a vector zero is u_0 after
-- 1, 3, 5 and u_7 after 2, 4, 6.
--
-- Every pair is a start and a direction: the second vector, and the active vector that is the first less the second.
-- Torque of both is formed by one addition, a clock after the other. A duty beyond the period becomes 4095, one below
-- zero becomes 0: the first comparison tells, and no search is needed. Equal torques: 4095. What torque a duty leaves
-- is a product of mptc_datapath.
--
-- With mean, MPTC1's and MPTC2's duties d make the mean torque of the period the reference. Beside zero voltage the
-- square of 1 - d is one less the quotient of a constant and span: the constant is the torque error without voltage
-- at the end of the period and the one at its beginning, added. It takes the place of the first of these two, and the
-- direction that of the second vector: so both quotients come out of the same additions. mptc_duty finds the root.
--
-- With both_duties each pair of MPTC1 and MPTC2 is tried twice, with a duty by the torque and with one by the flux's
-- length. The latter is a quotient too: the length's error without voltage by that error less the one with the vector.
-- A memory of 8 words has the errors with the vectors, a register that without voltage; both come from the single
-- vectors. Limits are those of the torque. A pair whose duty the length tells is ranked behind the same pair by the
-- torque: its second vector counts as 1, which no other pair has. LENGTH_TABLE has the places of these searches: each
-- begins when one of the two is free.
--
-- Two mptc_duty search at a time. That is enough, because the torque is linear: of a vector and the opposite one with
-- zero at most one has a duty between 0 and 1, and at most two pairs of active vectors have: those with the torques of
-- both on either side of the reference. So opposite vectors have one search between them, the first one's end being
-- given up where the second needs it. Pairs of active vectors are tried without a search first. high tells which
-- vectors have more torque than the reference; the two pairs that it finds are looked up again and searched.
-- PAIR_TABLE has the order. A root takes twice as long: with mean the last two vectors wait for the first search.
--
-- Formats: as in model/directmpc/mptc/formats.py; times 1/4096 of the period; errors of lengths 16 fractional bits.
-- Latency: place n of PAIR_TABLE is looked up PAIR_SPACING * n clocks after the clock that follows begin_pairs; its
-- search begins PAIR_AHEAD clocks later; its result comes DUTY_CLOCKS clocks later, with mean ROOT_CLOCKS, its flux
-- PAIR_REGISTERS after that, its comparison STREAM_COMPARE after its flux. chosen is valid with last. length comes
-- before the first place whose duty it tells is looked up, leader a clock after the first place is, product a clock
-- after the flux. begin_pairs comes FIRST_PAIR clocks or more after the end of the decision before.
-- Overflow: none here; a distance that does not fit is flagged by mptc_vector_stream.
-- Considered and rejected: rtl/alternatives.md.
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
    mean        : in    std_logic;       -- '1': duties by the mean torque, '0': by the torque at the end; stable
    both_duties : in    std_logic;       -- '1': the latter, and duties by the flux's length; stable
    leader      : in    vector_t;        -- MPTC1's vector, active
    state       : in    mptc_state_t;    -- torque terms, stable
    length      : in    mptc_length_t;   -- of the flux with a single vector, both_duties
    product     : in    sum_t;           -- torque error that a pair leaves; a clock after tried.enable
    cheaper     : in    std_logic;       -- '1': the pair that is compared is the cheapest so far
    found       : out   mptc_duty_t;     -- a pair with its duty
    tried       : out   mptc_tried_t;    -- when its flux is there, and its torque error when the cost takes it
    chosen      : out   mptc_sequence_t  -- what to apply next; with last
  );
end entity mptc_pair_stream;

architecture rtl of mptc_pair_stream is

  subtype double_error_t is signed(ERROR_WIDTH downto 0);

  subtype slot_t is unsigned(6 downto 0);

  subtype place_t is unsigned(3 downto 0);

  constant LENGTH_PLACES : natural := 3; -- bits of a place in the memory of lengths

  constant BY_LENGTH : vector_t := "001"; -- second vector of a pair whose duty the length tells: zero voltage

  subtype duty_t is std_logic_vector(TIME_WIDTH - 1 downto 0);

  type duties_t is array (0 to SEARCHES - 1) of duty_t;

  subtype named_t is std_logic_vector(TIME_WIDTH + 5 downto 0); -- duty, first and second vector

  type pair_t is record
    first     : vector_t;  -- active
    second    : vector_t;  -- active, zero voltage as u_0, or BY_LENGTH
    direction : vector_t;  -- first less second, active
    there     : std_logic; -- '1': there is such a pair
    other     : std_logic; -- '1': the second search serves it
    probe     : std_logic; -- '1': tried only where it needs no search
  end record pair_t;

  -- what is known of a pair before its search ends: vectors, search, there, within, all of the period

  constant KNOWN_WIDTH  : positive := 13;
  constant KNOWN_PLACES : positive := 3; -- bits of a place in the memory of it: those of the pairs that are searched

  subtype known_t is std_logic_vector(KNOWN_WIDTH - 1 downto 0);

  subtype known_place_t is unsigned(KNOWN_PLACES - 1 downto 0);

  -- places that are looked up from when it is written to when it is read
  constant WRITTEN_BEHIND  : positive := (PAIR_AHEAD + 1) / PAIR_SPACING;
  constant QUOTIENT_BEHIND : positive := (PAIR_AHEAD + DUTY_CLOCKS) / PAIR_SPACING - WRITTEN_BEHIND;
  constant ROOT_BEHIND     : positive := (PAIR_AHEAD + ROOT_CLOCKS) / PAIR_SPACING - WRITTEN_BEHIND;

  signal active     : std_logic;
  signal slot       : slot_t;                               -- clocks since the first pair was looked up
  signal place      : place_t;                              -- row of PAIR_TABLE
  signal crossed    : std_logic_vector(0 to 5);             -- '1': the reference lies between, pairs as in PAIR_TABLE
  signal high       : std_logic_vector(5 downto 0);         -- '1': more torque than the reference: 1, 4, 2, 5, 3, 6
  signal pair       : pair_t;                               -- what is looked up in an even slot
  signal pair_1     : pair_t;                               -- a clock later
  signal given      : pair_t;                               -- the same, or MPTC1's: its torques are formed
  signal pair_2     : pair_t;                               -- two more later: its search begins
  signal number     : vector_t;                             -- vector whose torque is formed
  signal change     : error_t;                              -- torque of a vector whose part along alpha is positive
  signal opposed    : std_logic;                            -- '1': that is negative
  signal lengthwise : std_logic;                            -- '1': both of the length, and its duty is searched
  signal far        : signed_word_t;                        -- length less reference without voltage
  signal place_first : std_logic_vector(LENGTH_PLACES - 1 downto 0); -- where that of the pair's first vector stands
  signal far_first  : std_logic_vector(WORD_WIDTH - 1 downto 0); -- that with the first vector
  signal level      : error_t;                              -- torque error without voltage; mean: with that at k+1
  signal dividend   : mptc_rest_t;
  signal base       : error_t;
  signal total      : error_t;                              -- span; a clock later the dividend, or less one of it
  signal falls      : std_logic;                            -- '1': span was negative: complements
  signal left       : error_t;                              -- dividend, not negative where there is a search
  signal error      : error_t;                              -- the same, a clock later
  signal span       : error_t;
  signal trial      : double_error_t; -- error less span
  signal without    : std_logic;      -- '1': there is no span
  signal is_duty    : std_logic;      -- the duty is between 0 and 1
  signal beyond     : std_logic;      -- the duty is that of the whole period
  signal wanted     : std_logic;      -- '0': surely not within, told early
  signal there      : std_logic;      -- '1': the pair is tried
  signal known      : known_t;
  signal known_read : known_t;                              -- the same, with its result
  signal known_late : known_t;                              -- the same, a clock later
  signal known_write : std_logic;
  signal known_place : known_place_t;                       -- where it is read
  signal load     : std_logic_vector(0 to SEARCHES - 1);
  signal duties   : duties_t;
  signal bits     : duty_t;    -- what was found
  signal duty     : duty_t;    -- the same, with its limits
  signal has_duty : std_logic; -- '1': the duty was searched
  signal first    : vector_t;  -- its pair
  signal second   : vector_t;
  signal ended    : std_logic; -- '1': a search has ended
  -- results on their way, by clocks
  signal on_way     : std_logic_vector(STREAM_COMPARE + PAIR_REGISTERS downto 2);
  signal flux_due   : std_logic;                            -- '1': its way is in the accumulators
  signal remaining  : std_logic_vector(TERM_WIDTH - 1 downto 0); -- product, when the cost takes it
  signal named      : named_t;
  signal ranked     : named_t;                              -- the same, with a rank of zero where no pairs are compared
  signal compared   : named_t;
  signal best       : named_t;
  signal winner     : named_t;

  -- place of a pair of active vectors: the first or the last one that is marked
  function place_of (marks : std_logic_vector(0 to 5); last_one : boolean) return place_t is

    type places_t is array (0 to 5) of natural;

    constant PLACES : places_t := (6, 7, 8, 9, 10, 11); -- in PAIR_TABLE

    variable result : place_t;

  begin

    result := to_unsigned(PLACES(0), place_t'length);

    for i in 0 to 5 loop
      if (last_one and marks(i) = '1') then
        result := to_unsigned(PLACES(i), place_t'length);
      elsif (not last_one and marks(5 - i) = '1') then
        result := to_unsigned(PLACES(5 - i), place_t'length);
      end if;
    end loop;

    return result;

  end function place_of;

  -- zero voltage as u_0, whatever tells the duty
  function without_rule (vector : vector_t) return vector_t is

    variable result : vector_t;

  begin

    result    := vector;
    result(0) := vector(0) and (vector(2) or vector(1));
    return result;

  end function without_rule;

  -- pair at a place; lengths: places of duties by length too, whose number is nth; roots: those that wait
  function pair_of (rule : family_t; lengths, roots : std_logic; row : place_t; nth : unsigned(4 downto 0))
    return pair_t is

    variable result : pair_t;
    variable index  : natural range 0 to 15;
    variable vector : natural range 0 to 7;

  begin

    index            := to_integer(row);
    vector           := LENGTH_TABLE(to_integer(nth), 0);
    result.first     := std_logic_vector(to_unsigned(PAIR_TABLE(index, 0), 3));
    result.second    := std_logic_vector(to_unsigned(PAIR_TABLE(index, 1), 3));
    result.direction := std_logic_vector(to_unsigned(PAIR_TABLE(index, 2), 3));
    result.there     := to_std_logic(rule = FAMILY_GTV or PAIR_TABLE(index, 1) = 0) and not nth(4);
    result.other     := to_std_logic(PAIR_TABLE(to_integer(nth(3 downto 0)), 3) = 1);
    result.probe     := to_std_logic(PAIR_TABLE(to_integer(nth(3 downto 0)), 1) /= 0
                                     and nth /= FIRST_CROSSED and nth /= LAST_CROSSED) and not roots;

    -- the last two vectors, when their search is free
    if (roots = '1' and nth >= LAST_ZERO - 1 and nth < LAST_ZERO - 1 + ROOT_PAUSE) then
      result.there := '0';
    end if;

    if (lengths = '1' and vector /= 0) then
      result.first     := std_logic_vector(to_unsigned(vector, 3));
      result.second    := BY_LENGTH;
      result.direction := result.first;
      result.there     := '1';
      result.other     := to_std_logic(LENGTH_TABLE(to_integer(nth), 1) = 1);
      result.probe     := '0';
    end if;

    -- its vector is not there yet
    if (rule = FAMILY_MPTC1) then
      result.second := "00" & nth(0);
      result.there  := to_std_logic(nth = 0 or (nth = 1 and lengths = '1'));
      result.other  := nth(0);
      result.probe  := '0';
    end if;

    return result;

  end function pair_of;

begin

  assert PAIR_SPACING = 2 and SEARCHES = 2 and PAIR_AHEAD = 3 and DUTY_CLOCKS mod 2 = 0 and ROOT_CLOCKS mod 2 = 0
    report "mptc_pair_stream: the slots are those of two searches, two clocks apart"
    severity failure;

  assert ROOT_BEHIND < 2 ** KNOWN_PLACES
    report "mptc_pair_stream: what is known of a pair is overwritten before it is read"
    severity failure;

  ---------------------------------------------------------------------------------------------
  -- Who searches what, and when
  ---------------------------------------------------------------------------------------------

  p_slots : process (clk) is
  begin

    if rising_edge(clk) then
      slot <= slot + 1;

      if (begin_pairs = '1') then
        active <= '1';
        slot   <= (others => '0');
      end if;

      -- the method may be another one from now on
      if (rst = '1' or last = '1') then
        active <= '0';
      end if;

      -- counts while idle too, so that nothing is there when the next pairs begin
      if (rst = '1') then
        slot <= (others => '0');
      end if;
    end if;

  end process p_slots;

  -- of u_1 and u_2, u_2 and u_3, u_3 and u_4, u_4 and u_5, u_5 and u_6, u_6 and u_1
  crossed <= (high(5) xor high(3)) & (high(3) xor high(1)) & (high(1) xor high(4)) & (high(4) xor high(2))
             & (high(2) xor high(0)) & (high(0) xor high(5));

  p_place : process (slot, crossed, mean) is
  begin

    place <= slot(4 downto 1);

    if (slot(4 downto 1) = FIRST_CROSSED) then
      place <= place_of(crossed, false);
    elsif (slot(4 downto 1) = LAST_CROSSED) then
      place <= place_of(crossed, true);
    end if;

    if (mean = '1' and slot(4 downto 1) >= LAST_ZERO - 1) then
      place <= slot(4 downto 1) - ROOT_PAUSE;
    end if;

  end process p_place;

  pair <= pair_of(method, both_duties, mean, place, slot(5 downto 1));

  p_ahead : process (clk) is
  begin

    if rising_edge(clk) then
      if (slot(0) = '0') then
        pair_1       <= pair;
        pair_1.there <= pair.there and active and not slot(6);
        pair_2       <= given;
      end if;
    end if;

  end process p_ahead;

  p_given : process (pair_1, method, leader) is
  begin

    given <= pair_1;

    if (method = FAMILY_MPTC1) then
      given.first     <= leader;
      given.direction <= leader;
    end if;

  end process p_given;

  ---------------------------------------------------------------------------------------------
  -- Lengths of the fluxes with the vectors
  ---------------------------------------------------------------------------------------------

  p_without : process (clk) is
  begin

    if rising_edge(clk) then
      -- zero voltage comes last
      if (length.take = '1') then
        far <= length.error;
      end if;
    end if;

  end process p_without;

  place_first <= std_logic_vector(unsigned(given.direction) + LENGTH_LATENCY);

  i_lengths : entity work.ram
    generic map (
      ADDRESS_WIDTH => LENGTH_PLACES,
      WIDTH         => WORD_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => length.take,
      write_address => length.place,
      write_word    => std_logic_vector(length.error),
      read          => '1',
      read_address  => place_first,
      read_word     => far_first
    );

  ---------------------------------------------------------------------------------------------
  -- Torques: of the direction, then of the second vector; or lengths
  ---------------------------------------------------------------------------------------------

  number <= given.direction when slot(0) = '1' or mean = '1' else
            without_rule(given.second);

  p_change : process (clk) is

    variable step       : error_t;
    variable complement : error_t; -- what the one's complement in level is off

  begin

    if rising_edge(clk) then
      step := resize(state.along, ERROR_WIDTH);

      if (whole_alpha(number) = '0') then
        step := gated(shift_left(resize(state.across, ERROR_WIDTH), 1), has_beta(number));
      end if;

      change  <= moved(gated(resize(state.along, ERROR_WIDTH), has_alpha(number)), step,
                       has_beta(number) and not (negative_alpha(number) xor negative_beta(number)));
      opposed   <= negative_alpha(number);
      lengthwise <= to_std_logic(given.second = BY_LENGTH);

      if (given.second = BY_LENGTH) then
        change  <= gated(resize(signed(far_first), ERROR_WIDTH), slot(0));
        opposed <= '1';
      end if;

      complement := resize(shift_right(state.rotor_alpha, TERM_SHIFT - DUTY_SHIFT), ERROR_WIDTH);

      if (mean = '1') then
        complement := shift_left(complement, 1);
      end if;

      step  := resize(state.level, ERROR_WIDTH) + gated(resize(state.opening, ERROR_WIDTH), mean);
      level <= shift_left(step, DUTY_SHIFT) - complement;
    end if;

  end process p_change;

  base  <= resize(far, ERROR_WIDTH) when lengthwise = '1' else
           gated(level, slot(0));
  total <= moved(base, change, opposed xor slot(0));

  left <= total xor (error_t'range => falls xor mean);

  p_request : process (clk) is
  begin

    if rising_edge(clk) then
      if (slot(0) = '0') then
        span  <= total xor (error_t'range => sign_of(total));
        falls <= sign_of(total);
      else
        error <= left;
      end if;
    end if;

  end process p_request;

  ---------------------------------------------------------------------------------------------
  -- Searches
  ---------------------------------------------------------------------------------------------

  trial  <= resize(error, ERROR_WIDTH + 1) - span;

  without <= to_std_logic(span = 0);

  is_duty <= not sign_of(error) and sign_of(trial);
  beyond  <= (sign_of(trial) xnor mean) or without;

  -- of two opposite vectors one has a dividend that is not negative, but for its one's complement; others have no such
  wanted <= (sign_of(level) xnor falls) or to_std_logic(pair_2.second /= "000");

  p_high : process (clk) is
  begin

    if rising_edge(clk) then
      if (slot(0) = '0' and pair_2.second = "000") then
        high <= high(4 downto 0) & ((sign_of(trial) xor falls) and not (falls and to_std_logic(trial = 0)));
      end if;
    end if;

  end process p_high;

  dividend <= shift_left(unsigned(resize(left, ERROR_WIDTH + 1)), 1) when mean = '1' else
              unsigned(resize(left, ERROR_WIDTH + 1));

  there <= pair_2.there and not (pair_2.probe and is_duty);
  known <= pair_2.first & pair_2.second & pair_2.direction & pair_2.other & there & is_duty & beyond;

  known_place <= slot(KNOWN_PLACES downto 1) - ROOT_BEHIND when mean = '1' else
                 slot(KNOWN_PLACES downto 1) - QUOTIENT_BEHIND;

  -- written while idle too, so that nothing is there when the next pairs begin
  i_known : entity work.ram
    generic map (
      ADDRESS_WIDTH => KNOWN_PLACES,
      WIDTH         => KNOWN_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => known_write,
      write_address => std_logic_vector(slot(KNOWN_PLACES downto 1)),
      write_word    => known,
      read          => '1',
      read_address  => std_logic_vector(known_place),
      read_word     => known_read
    );

  known_write <= not slot(0);

  g_units : for n in 0 to SEARCHES - 1 generate

    load(n) <= slot(0) and pair_2.there and not pair_2.probe and wanted and (pair_2.other xor to_std_logic(n = 0));

    i_duty : entity work.mptc_duty
      port map (
        clk   => clk,
        load  => load(n),
        mean  => mean,
        error => dividend,
        span  => span,
        duty  => duties(n)
      );

  end generate g_units;

  ---------------------------------------------------------------------------------------------
  -- Results
  ---------------------------------------------------------------------------------------------

  p_result : process (clk) is

    variable unit : natural range 0 to SEARCHES - 1;

  begin

    if rising_edge(clk) then
      unit := 0;

      if (known_read(3) = '1') then
        unit := 1;
      end if;

      bits       <= duties(unit) xor (TIME_WIDTH - 1 downto 0 => mean);
      known_late <= known_read;
    end if;

  end process p_result;

  first    <= known_late(KNOWN_WIDTH - 1 downto KNOWN_WIDTH - 3);
  second   <= known_late(KNOWN_WIDTH - 4 downto KNOWN_WIDTH - 6);
  has_duty <= known_late(1);
  duty     <= bits when has_duty = '1' else
              (others => known_late(0));

  found.duty      <= duty;
  found.second    <= without_rule(second);
  found.direction <= known_late(KNOWN_WIDTH - 7 downto KNOWN_WIDTH - 9);
  found.take      <= ended and known_late(2);

  named  <= duty & first & second;
  ranked <= duty & ((first & second) and (5 downto 0 => ended and known_late(2)));

  p_on_way : process (clk) is
  begin

    if rising_edge(clk) then
      ended    <= active and slot(0);
      flux_due <= on_way(PAIR_REGISTERS - 2) and (to_std_logic(method /= FAMILY_MPTC1) or both_duties);
      on_way   <= on_way(on_way'high - 1 downto 2) & (ended and known_late(2));

      -- a pair on its way does not go on into the next decision
      if (rst = '1' or last = '1') then
        ended    <= '0';
        flux_due <= '0';
        on_way   <= (others => '0');
      end if;
    end if;

  end process p_on_way;

  i_remaining : entity work.delay_line
    generic map (
      WIDTH  => TERM_WIDTH,
      CLOCKS => STREAM_TERM_FAMILY
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => std_logic_vector(product(TERM_SHIFT + TERM_WIDTH - 1 downto TERM_SHIFT)),
      delayed => remaining
    );

  i_named : entity work.delay_line
    generic map (
      WIDTH  => TIME_WIDTH + 6,
      CLOCKS => STREAM_COMPARE + PAIR_REGISTERS - 1
    )
    port map (
      clk     => clk,
      rst     => rst,
      word    => ranked,
      delayed => compared
    );

  tried.enable  <= flux_due;
  tried.take    <= on_way(STREAM_TERM_FAMILY + PAIR_REGISTERS);
  tried.left    <= signed(remaining);
  tried.compare <= on_way(STREAM_COMPARE + PAIR_REGISTERS);
  tried.rank    <= compared(5 downto 0);
  tried.best    <= best(5 downto 0);

  ---------------------------------------------------------------------------------------------
  -- Comparison
  ---------------------------------------------------------------------------------------------

  winner <= named when method = FAMILY_MPTC1 and both_duties = '0' else
            best;

  p_best : process (clk) is
  begin

    if rising_edge(clk) then
      if (on_way(STREAM_COMPARE + PAIR_REGISTERS) = '1' and cheaper = '1') then
        best <= compared;
      end if;

      -- a rank of zero for single vectors
      if (rst = '1' or last = '1') then
        best <= (others => '0');
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

    if (winner(2 downto 1) = "00") then
      chosen.u2 <= zero;
      chosen.u3 <= zero;
    end if;

    chosen.t1 <= '0' & winner(TIME_WIDTH + 5 downto 6);
    chosen.t2 <= std_logic_vector(to_unsigned(2 ** TIME_WIDTH, TIME_WIDTH + 1)
                                  - unsigned('0' & winner(TIME_WIDTH + 5 downto 6)));

  end process p_chosen;

end architecture rtl;
