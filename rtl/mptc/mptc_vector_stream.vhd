-- Stream of voltage vectors: tries u_1 to u_6 and then zero voltage, one a clock, and keeps the cheapest.
--
-- For each vector: stator flux at k+2 (eq. 13) and the distance of its length from the reference (mptc_magnitude);
-- torque term (eq. 15); cost (eq. 11), which the last mac_block of mptc_datapath forms from both; comparison.  For
-- MPFC the torque term is the vector's part of |psi_s,ref - psi_s|**2 (eq. 17).  A tie goes to the lowest number.
-- Zero voltage comes last, as u_0 or u_7, whichever takes fewer commutations from the vector being applied; as u_0 it
-- wins a tie.
--
-- With FAMILY the pairs of mptc_pair_stream take the same way through length, torque term and comparison. For
-- MPTC1 zero voltage is not compared, and leader is the vector found. With both_duties the single vectors of MPTC2 pass
-- too, for their lengths, and the pairs of MPTC1 are compared with each other.
--
-- Formats: as in model/directmpc/mptc/formats.py.
-- Latency: one vector a clock.  The clocks between length, torque term and comparison of a vector stand in
-- mptc_constants (STREAM_*); number is stable one clock after last.
-- Overflow: a distance that does not fit saturates and sets overflow; nothing wraps.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_vector_stream is
  generic (
    FLUX_CONTROL : boolean := true; -- true: mpfc is heeded; a register stands between a vector's flux and its length
    FAMILY       : boolean := false -- true: pairs too; needs FLUX_CONTROL
  );
  port (
    clk          : in    std_logic;                                      -- rising edge
    rst          : in    std_logic;                                      -- synchronous, active high
    begin_stream : in    std_logic;                                      -- '1': the first vector comes a clock later
    last         : in    std_logic;                                      -- '1': the last vector is compared
    mpfc         : in    std_logic;                                      -- '1': MPFC, '0': MPTC; stable
    applied      : in    std_logic_vector(2 downto 0);                   -- number of the vector being applied, stable
    psi_ref      : in    std_logic_vector(REFERENCE_WIDTH - 1 downto 0); -- flux reference, unsigned, stable
    state        : in    mptc_state_t;                                   -- flux and torque terms, stable
    method       : in    family_t;                                        -- method of two vectors, stable
    both_duties  : in    std_logic;                                      -- '1': the rule of its duties is best, stable
    tried        : in    mptc_tried_t;                                   -- pair on its way
    sum          : in    sum_t;                                          -- cost of what is compared, a pair's way
    sum_beta     : in    sum_t;                                          -- way of a pair along beta, signed
    difference   : out   word_t;                                         -- distance of a length, not negative
    term         : out   term_t;                                         -- torque term of a vector, signed
    overflow     : out   std_logic;                                      -- '1': a distance saturated
    length       : out   mptc_length_t;                                  -- of a vector's flux, both_duties
    leader       : out   vector_t;                                       -- cheapest vector so far
    cheaper      : out   std_logic;                                      -- '1': what is compared is the cheapest so far
    number       : out   vector_t;                                       -- number of the vector to apply next
    least        : out   compared_t                                      -- its cost, in the clock after last
  );
end entity mptc_vector_stream;

architecture rtl of mptc_vector_stream is

  constant STREAM_WIDTH : positive := 4; -- bits of the counter, which returns to zero after STREAM_LAST

  -- clocks from a length to its torque term: with FAMILY the cost takes it two clocks later
  constant TERM_CLOCKS : positive := choose(FAMILY, STREAM_TERM_FAMILY, STREAM_TERM);

  constant WAY_SHIFT : natural := FRACTION - LENGTH_GUARD; -- bit of a sum that is the LSB of a length

  -- 0: no vector; else the vector's number plus 0 at the length, TERM_CLOCKS at the torque term and
  -- STREAM_COMPARE at the comparison
  signal stream        : unsigned(STREAM_WIDTH - 1 downto 0);
  signal length_number : vector_t;                           -- of the vector whose flux is formed
  signal length_enable : std_logic;
  signal length_valid  : std_logic;
  signal pair_length   : std_logic;                           -- '1': x_bits and y_bits are those of a pair
  signal x             : signed(LENGTH_WIDTH - 1 downto 0);
  signal y             : signed(LENGTH_WIDTH - 1 downto 0);
  signal x_bits        : std_logic_vector(LENGTH_WIDTH - 1 downto 0);
  signal y_bits        : std_logic_vector(LENGTH_WIDTH - 1 downto 0);
  signal half_length   : word_t;
  signal distance      : word_t;
  signal too_far       : std_logic;
  signal short         : std_logic;
  signal term_whole    : std_logic; -- '1': all of the step along alpha, '0': half of it
  signal term_alpha    : std_logic; -- '1': a step along alpha
  signal term_beta     : std_logic; -- '1': a step along beta
  signal term_add      : std_logic; -- '1': alpha's is subtracted
  signal term_subtract : std_logic; -- '1': beta's is subtracted
  signal cost          : signed(compared_t'range);
  signal cost_number   : vector_t;
  signal best_cost     : signed(compared_t'range);
  signal best          : vector_t;
  signal better        : std_logic;
  signal fresh         : std_logic;                           -- '1': nothing has been compared
  signal pairs         : std_logic;                           -- '1': pairs are compared, and no single vectors
  signal wins_tie      : std_logic;
  signal winner        : vector_t;

begin

  assert STREAM_LAST = 2 ** STREAM_WIDTH - 1 and STREAM_COMPARE mod 8 = 0
    report "mptc_vector_stream: the counter's low bits have to be the number that is compared, and 0 to follow the last"
    severity failure;

  p_stream : process (clk) is

    variable following : unsigned(STREAM_WIDTH - 1 downto 0);
    variable ahead     : unsigned(STREAM_WIDTH - 1 downto 0);
    variable vector    : vector_t;

  begin

    if rising_edge(clk) then
      following := (others => '0');

      if (stream /= 0) then
        following := stream + 1;
      elsif (begin_stream = '1') then
        following := to_unsigned(1, STREAM_WIDTH);
      end if;

      if (rst = '1') then
        following := (others => '0');
      end if;

      -- from the counter itself: where the next clock has no vector, nobody reads its terms
      ahead         := stream + 1 - TERM_CLOCKS;
      vector        := std_logic_vector(ahead(2 downto 0));
      stream        <= following;
      term_whole    <= whole_alpha(vector);
      term_alpha    <= has_alpha(vector);
      term_beta     <= has_beta(vector);
      term_add      <= negative_alpha(vector) xnor mpfc;
      term_subtract <= negative_beta(vector) xor mpfc;
      wins_tie      <= to_std_logic(stream = STREAM_LAST - 1) and not zero_is_u_7(applied);
    end if;

  end process p_stream;

  ---------------------------------------------------------------------------------------------
  -- Lengths
  ---------------------------------------------------------------------------------------------

  g_torque_number : if not FLUX_CONTROL generate
    length_number <= std_logic_vector(stream(2 downto 0));
  end generate g_torque_number;

  -- a clock ahead: the flux is registered
  g_flux_number : if FLUX_CONTROL generate
    length_number <= std_logic_vector(stream(2 downto 0) + 1);
  end generate g_flux_number;

  g_single_length : if not FAMILY generate
    length_enable <= to_std_logic(stream /= 0 and stream <= STREAM_VECTORS and mpfc = '0');
  end generate g_single_length;

  g_family_length : if FAMILY generate
    length_enable <= (to_std_logic(stream /= 0 and stream <= STREAM_VECTORS and mpfc = '0')
                      and (to_std_logic(method = FAMILY_NONE or method = FAMILY_MPTC1) or both_duties)) or pair_length;
  end generate g_family_length;

  p_lengths : process (length_number, state, tried, sum, sum_beta) is

    variable step_x  : signed(LENGTH_WIDTH - 1 downto 0);
    variable step_y  : signed(LENGTH_WIDTH - 1 downto 0);
    variable minus_x : std_logic;
    variable minus_y : std_logic;

  begin

    step_x := shift_left(resize(state.step_alpha, LENGTH_WIDTH), LENGTH_GUARD - 1);

    if (whole_alpha(length_number) = '0') then
      step_x := shift_right(step_x, 1);
    end if;

    step_x := gated(step_x, has_alpha(length_number));
    step_y := shift_left(resize(gated(state.step_beta, has_beta(length_number)), LENGTH_WIDTH), LENGTH_GUARD - 1);
    minus_x := negative_alpha(length_number);
    minus_y := negative_beta(length_number);

    -- a pair's way
    if (FAMILY and tried.enable = '1') then
      step_x  := sum(WAY_SHIFT + LENGTH_WIDTH - 1 downto WAY_SHIFT);
      step_y  := sum_beta(WAY_SHIFT + LENGTH_WIDTH - 1 downto WAY_SHIFT);
      minus_x := '0';
      minus_y := '0';
    end if;

    x      <= moved(shift_left(resize(state.stator_alpha, LENGTH_WIDTH), LENGTH_GUARD), step_x, minus_x);
    y      <= moved(shift_left(resize(state.stator_beta, LENGTH_WIDTH), LENGTH_GUARD), step_y, minus_y);

  end process p_lengths;

  g_torque_bits : if not FLUX_CONTROL generate
    x_bits <= std_logic_vector(x);
    y_bits <= std_logic_vector(y);
  end generate g_torque_bits;

  g_flux_bits : if FLUX_CONTROL generate

    p_flux : process (clk) is
    begin

      if rising_edge(clk) then
        pair_length <= tried.enable and to_std_logic(FAMILY);
        x_bits      <= std_logic_vector(x);
        y_bits      <= std_logic_vector(y);
      end if;

    end process p_flux;

  end generate g_flux_bits;

  half_length <= as_word('0' & psi_ref);

  i_magnitude : entity work.mptc_magnitude
    port map (
      clk            => clk,
      rst            => rst,
      enable         => length_enable,
      x              => x_bits,
      y              => y_bits,
      half_reference => half_length,
      valid          => length_valid,
      difference     => distance,
      short          => short,
      overflow       => too_far
    );

  difference <= distance and (word_t'range => not mpfc);
  overflow   <= too_far and length_valid;

  -- LENGTH_LATENCY clocks after its vector; a pair's comes while no vector is there
  length.take  <= length_valid and to_std_logic(stream /= 0);
  length.place <= std_logic_vector(stream(2 downto 0));
  length.error <= signed(distance xor (word_t'range => short and to_std_logic(FAMILY)));

  ---------------------------------------------------------------------------------------------
  -- Torque terms
  ---------------------------------------------------------------------------------------------

  -- MPTC: reference - torque; MPFC: the same with the opposite vector's sign
  p_term : process (clk) is

    variable whole  : term_t;
    variable along  : term_t;
    variable across : term_t;

  begin

    if rising_edge(clk) then
      if (stream /= 0) then
        along := shift_right(state.along, 1);

        if (term_whole = '0') then
          along := shift_right(along, 1);
        end if;

        along  := gated(along, term_alpha);
        across := gated(shift_right(state.across, 1), term_beta);
        whole  := gated(state.level, not mpfc or term_alpha);
        whole  := moved(whole, along, term_add);
        whole  := moved(whole, across, term_subtract);
        term   <= whole;
      end if;

      if (FAMILY and tried.take = '1') then
        term <= tried.left;
      end if;
    end if;

  end process p_term;

  ---------------------------------------------------------------------------------------------
  -- Comparison
  ---------------------------------------------------------------------------------------------

  cost        <= sum(COST_WIDTH - 1 downto COST_DROPPED);
  cost_number <= std_logic_vector(stream(2 downto 0));

  g_single_better : if not FAMILY generate
    fresh  <= to_std_logic(stream <= STREAM_COMPARE);
    better <= to_std_logic(cost & '0' < best_cost & wins_tie);
  end generate g_single_better;

  g_family_better : if FAMILY generate
    pairs <= not method(2) and method(1);
    fresh <= to_std_logic(stream /= 0 and (stream <= STREAM_COMPARE or pairs = '1'))
             or (pair_length and not pairs);

    -- of equal costs the lower rank; single vectors have none, and the bit behind it decides
    better <= to_std_logic(cost & signed('0' & tried.rank & '0') < best_cost & signed('0' & tried.best & wins_tie))
              and not to_std_logic(method = FAMILY_MPTC1 and stream = STREAM_LAST)
              and (tried.compare or (not pairs and to_std_logic(stream /= 0)));
  end generate g_family_better;

  cheaper <= better;

  leader <= best;
  least  <= std_logic_vector(best_cost);

  winner <= best when better = '0' else
            cost_number;

  p_best : process (clk) is

    variable chosen : vector_t;

  begin

    if rising_edge(clk) then
      if (better = '1') then
        best      <= cost_number;
        best_cost <= cost;
      end if;

      -- before the first comparison: worse than any cost
      if (fresh = '1') then
        best_cost                       <= (others => '1');
        best_cost(best_cost'length - 1) <= '0';
      end if;

      if (last = '1') then
        chosen := winner;

        if (winner = "111" and zero_is_u_7(applied) = '0') then
          chosen := "000";
        end if;

        number <= chosen;
      end if;
    end if;

  end process p_best;

end architecture rtl;
