-- Datapath of the MPTC and MPFC: three mac_blocks, their operands, and the registers that sums go to.
--
-- Takes the measurements to k+1 by Heun's method (eqs. 4 and 5) and to k+2 without voltage; forms i_s0 (eq. 14), the
-- torque terms, and for MPFC the rotor flux and the parts of the reference.  While the vectors stream past, the last
-- block forms their costs.  Of a pair the first and the last block form the flux, and the second one the torque that
-- it leaves.  With FAMILY the blocks are of its own, and take a seed two clocks after a product is begun.  Which
-- product is formed when, stands in model/directmpc/mptc/program.py; mptc_sequencer tells it clock by clock.
-- w = i_s - lambda*L_r*psi_s is a state in place of the current: i_s0 then is one Euler step of w
-- (model/directmpc/mptc/formats.py).
--
-- Formats: words, sums and torque terms as in model/directmpc/mptc/formats.py.
-- Latency: SUM_LATENCY clocks from a product to its sum; a register written from it can be read a clock later.
-- Overflow: a word that does not fit saturates and sets overflow, as does v_dc = 0; it is cleared while idle.
-- Nothing wraps.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.guarded_states.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_datapath is
  generic (
    FLUX_CONTROL : boolean := true; -- true: MPFC can be chosen at run time
    FAMILY       : boolean := false -- true: the mean share of a sequence in place of sample.u's; distances
  );
  port (
    clk          : in    std_logic;           -- rising edge
    idle         : in    std_logic;           -- '1': no decision is under way; clears overflow
    mpfc         : in    std_logic;           -- '1': MPFC, '0': MPTC; stable
    products     : in    mptc_products_t;     -- what the mac_blocks begin
    events       : in    mptc_events_t;       -- what is due
    sample       : in    mptc_inputs_t;       -- measurements and references, stable
    mean_alpha   : in    word_t;              -- FAMILY: mean share in the steps along alpha
    mean_beta    : in    word_t;              -- FAMILY: the same along beta
    coefficients : in    mptc_coefficients_t; -- stable
    difference   : in    word_t;              -- distance of a vector's length from the reference
    too_far      : in    std_logic;           -- '1': a distance saturated
    term         : in    term_t;              -- torque term of a vector, signed
    target       : in    mptc_reference_t;    -- MPFC's reference, stable when the program reads it
    residues     : in    mptc_residues_t;     -- FAMILY: what a choice leaves of e
    sum_alpha    : out   sum_t;               -- accumulator of the first block
    sum_beta     : out   sum_t;               -- accumulator of the second block
    state        : out   mptc_state_t;        -- what the stream of vectors needs
    sum          : out   sum_t;               -- accumulator of the last block: costs, MPFC's radicand
    overflow     : out   std_logic            -- '1': a value has not fitted its word since idle
  );
end entity mptc_datapath;

architecture rtl of mptc_datapath is

  type words_t is array (0 to OPERAND_COUNT - 1) of word_t;

  type results_t is array (0 to RESULT_COUNT - 1) of signed_word_t;

  type terms_t is array (0 to TERM_COUNT - 1) of term_t;

  type sums_t is array (0 to BLOCK_COUNT - 1) of sum_t;

  type seeds_t is array (0 to SEED_COUNT_ALL - 1) of sum_t;

  constant RESULTS_WRITTEN : natural := counted(FLUX_CONTROL, RESULT_COUNT, RESULT_COUNT_MPTC);
  constant WORD_EVENTS     : natural := counted(FLUX_CONTROL, WORD_WRITES'length(1), WORD_WRITES_MPTC);
  constant TERM_SINGLE     : natural := counted(FLUX_CONTROL, TERM_WRITES_SINGLE, TERM_WRITES_MPTC);
  constant TERM_EVENTS     : natural := choose(FAMILY, TERM_WRITES'length(1), TERM_SINGLE);

  signal words   : words_t;
  signal results : results_t;
  signal terms   : terms_t;
  signal sums    : sums_t;
  signal seeds   : seeds_t;
  signal flagged : std_logic;
  signal guard    : signed(MOMENT_GUARD - 1 downto 0);   -- MPFC: bits of the torque reference below its word
  signal brief    : std_logic;                           -- '1': |w|**2 in the accumulator is below a quarter
  signal doubled  : std_logic;                           -- '1': so it was, MPFC's reference counts twice
  signal to_round : std_logic;                           -- '1': the torque reference is shifted, its word is rounded

  -- half of a word, or one plus half of it for negative words
  function halved (value : word_t; leading : std_logic) return word_t is

    variable result : word_t;

  begin

    result                 := std_logic_vector(shift_right(signed(value), 1));
    result(WORD_WIDTH - 1) := value(WORD_WIDTH - 1) xor leading;
    return result;

  end function halved;

  -- a word as a seed, with the constant that rounds the sum
  function seed_word (value : signed) return sum_t is
  begin

    return signed(seed_of(value, SUM_WIDTH, FRACTION));

  end function seed_word;

  -- the part of a sum that is a torque term
  function term_of (value : sum_t) return term_t is
  begin

    return value(TERM_SHIFT + TERM_WIDTH - 1 downto TERM_SHIFT);

  end function term_of;

  -- a product of two words, a torque term, as a word; -1 times -1 does not come: a step along an axis is above -1
  function word_of (value : term_t) return word_t is
  begin

    return std_logic_vector(value(2 * FRACTION - TERM_SHIFT downto FRACTION - TERM_SHIFT));

  end function word_of;

begin

  ---------------------------------------------------------------------------------------------
  -- Operands
  ---------------------------------------------------------------------------------------------

  words(OPERAND_IS_ALPHA)   <= as_word(sample.is_alpha);
  words(OPERAND_IS_BETA)    <= as_word(sample.is_beta);
  words(OPERAND_PSIS_ALPHA) <= as_word(sample.psis_alpha);
  words(OPERAND_PSIS_BETA)  <= as_word(sample.psis_beta);
  words(OPERAND_OMEGA_R)    <= as_word(sample.omega_r);
  words(OPERAND_V_DC)       <= link_word(sample.v_dc);
  words(OPERAND_TORQUE_REF) <= as_word(sample.torque_ref);
  words(OPERAND_PSI_REF)    <= as_word('0' & sample.psi_ref);

  words(OPERAND_C_CURRENT)       <= coefficients.current;
  words(OPERAND_C_FLUX)          <= coefficients.flux;
  words(OPERAND_C_ROTOR)         <= coefficients.rotor;
  words(OPERAND_C_ROTOR_FLUX)    <= coefficients.rotor_flux;
  words(OPERAND_C_DROP_CURRENT)  <= coefficients.drop_current;
  words(OPERAND_C_DROP)          <= coefficients.drop;
  words(OPERAND_C_DROP_FLUX)     <= coefficients.drop_flux;
  words(OPERAND_C_SPEED)         <= coefficients.speed;
  words(OPERAND_C_VOLTAGE_ALPHA) <= coefficients.voltage_alpha;
  words(OPERAND_C_VOLTAGE_BETA)  <= coefficients.voltage_beta;
  words(OPERAND_C_TORQUE)        <= coefficients.torque;
  words(OPERAND_C_WEIGHT)        <= coefficients.weight;

  words(OPERAND_GAIN)       <= std_logic_vector(to_unsigned(GAIN, WORD_WIDTH));
  words(OPERAND_ROOT3_2)    <= std_logic_vector(to_unsigned(ROOT3_2, WORD_WIDTH));
  words(OPERAND_DIFFERENCE) <= difference;

  g_results : for i in 0 to RESULTS_WRITTEN - 1 generate
    words(OPERAND_START_ALPHA + i) <= std_logic_vector(results(i));
  end generate g_results;

  words(OPERAND_NOT_START_BETA)  <= not words(OPERAND_START_BETA);
  words(OPERAND_NOT_ROTOR_BETA)  <= not words(OPERAND_ROTOR_BETA);
  words(OPERAND_NOT_STATOR_BETA) <= not words(OPERAND_STATOR_BETA);

  g_mean : if FAMILY generate
    words(OPERAND_SHARE_ALPHA) <= mean_alpha;
    words(OPERAND_SHARE_BETA)  <= mean_beta;
    words(OPERAND_RESIDUE_G)   <= residues.along;
    words(OPERAND_RESIDUE_H)   <= residues.beside;
    words(OPERAND_RESIDUE_SUM) <= residues.total;
    words(OPERAND_NOT_ALONG)   <= not word_of(terms(TERM_ALONG));
    words(OPERAND_ACROSS)      <= word_of(terms(TERM_ACROSS));
    seeds(SEED_LEVEL)          <= shift_left(resize(terms(TERM_LEVEL), SUM_WIDTH), TERM_SHIFT);
  end generate g_mean;

  g_share : if not FAMILY generate
    words(OPERAND_SHARE_ALPHA) <= share_alpha(sample.u);
    words(OPERAND_SHARE_BETA)  <= share_beta(sample.u);
    seeds(SEED_LEVEL)          <= (others => '0');
  end generate g_share;

  g_flux_operands : if FLUX_CONTROL generate
    words(OPERAND_NOT_HALF_ANGLE) <= not std_logic_vector(shift_right(results(RESULT_ANGLE), 1));
    words(OPERAND_NOT_MOMENT)     <= not words(OPERAND_MOMENT);
    words(OPERAND_ROOT_ALONG)     <= target.along;
    words(OPERAND_ROOT_ACROSS)    <= target.across;

    -- half of an LSB of the modulus, and of MPFC's root times w
    seeds(SEED_MODULUS_HALF) <= (FRACTION => doubled, FRACTION - 1 => not doubled, others => '0');
    seeds(SEED_CENTRE_ALPHA) <= resize(shift_right(results(RESULT_ROTOR_ALPHA), 1), SUM_WIDTH);
    seeds(SEED_CENTRE_BETA)  <= resize(shift_right(results(RESULT_ROTOR_BETA), 1), SUM_WIDTH);
  end generate g_flux_operands;

  g_no_flux : if not FLUX_CONTROL generate
    seeds(SEED_MODULUS_HALF) <= (others => '0');
    seeds(SEED_CENTRE_ALPHA) <= (others => '0');
    seeds(SEED_CENTRE_BETA)  <= (others => '0');
  end generate g_no_flux;

  ---------------------------------------------------------------------------------------------
  -- First summands
  ---------------------------------------------------------------------------------------------

  seeds(SEED_HALF)         <= to_signed(2 ** (FRACTION - 1), SUM_WIDTH);
  seeds(SEED_TORQUE_HALF)  <= to_signed(2 ** (TERM_SHIFT - 1), SUM_WIDTH);
  seeds(SEED_PSIS_ALPHA)   <= seed_word(signed(words(OPERAND_PSIS_ALPHA)));
  seeds(SEED_PSIS_BETA)    <= seed_word(signed(words(OPERAND_PSIS_BETA)));
  seeds(SEED_START_ALPHA)  <= seed_word(results(RESULT_START_ALPHA));
  seeds(SEED_START_BETA)   <= seed_word(results(RESULT_START_BETA));
  seeds(SEED_ROTOR_ALPHA)  <= seed_word(results(RESULT_ROTOR_ALPHA));
  seeds(SEED_ROTOR_BETA)   <= seed_word(results(RESULT_ROTOR_BETA));
  seeds(SEED_STATOR_ALPHA) <= seed_word(results(RESULT_STATOR_ALPHA));
  seeds(SEED_STATOR_BETA)  <= seed_word(results(RESULT_STATOR_BETA));
  seeds(SEED_NONE)         <= (others => '0');

  -- MPTC: |term| as one's complement; MPFC: term
  p_cost_seed : process (term, mpfc) is

    variable size : sum_t;

  begin

    size := resize(term, SUM_WIDTH);

    if (mpfc = '0' and term(TERM_WIDTH - 1) = '1') then
      size := not size;
    end if;

    seeds(SEED_COST) <= shift_left(size, COST_SHIFT);

  end process p_cost_seed;

  ---------------------------------------------------------------------------------------------
  -- Products
  ---------------------------------------------------------------------------------------------

  g_blocks : for n in 0 to BLOCK_COUNT - 1 generate

    constant A_SINGLE    : natural := counted(FLUX_CONTROL, A_COUNT(n), A_COUNT_MPTC(n)); -- without FAMILY
    constant B_SINGLE    : natural := counted(FLUX_CONTROL, B_COUNT(n), B_COUNT_MPTC(n));
    constant SEED_SINGLE : natural := counted(FLUX_CONTROL, SEED_COUNT(n), SEED_COUNT_MPTC(n));
    constant A_WORDS     : natural := choose(FAMILY, A_COUNT_FAMILY(n), A_SINGLE);
    constant B_WORDS     : natural := choose(FAMILY, B_COUNT_FAMILY(n), B_SINGLE);
    constant SEED_WORDS  : natural := choose(FAMILY, SEED_COUNT_FAMILY(n), SEED_SINGLE);

    signal a_inputs    : std_logic_vector(A_WORDS * WORD_WIDTH - 1 downto 0);
    signal b_inputs    : std_logic_vector(B_WORDS * WORD_WIDTH - 1 downto 0);
    signal seed_inputs : std_logic_vector(SEED_WORDS * SUM_WIDTH - 1 downto 0);
    signal a_place     : std_logic_vector(selector_width(A_WORDS) - 1 downto 0);
    signal b_place     : std_logic_vector(selector_width(B_WORDS) - 1 downto 0);
    signal seed_early  : std_logic_vector(selector_width(SEED_WORDS) - 1 downto 0);
    signal seed_place  : std_logic_vector(selector_width(SEED_WORDS) - 1 downto 0);
    signal seed        : std_logic_vector(SUM_WIDTH - 1 downto 0);
    signal b_word      : word_t;
    signal b_input     : word_t;
    signal total       : std_logic_vector(SUM_WIDTH - 1 downto 0);

  begin

    g_a : for i in 0 to A_WORDS - 1 generate
      a_inputs((i + 1) * WORD_WIDTH - 1 downto i * WORD_WIDTH) <= words(A_LISTS(n, i));
    end generate g_a;

    g_b : for i in 0 to B_WORDS - 1 generate
      b_inputs((i + 1) * WORD_WIDTH - 1 downto i * WORD_WIDTH) <= words(B_LISTS(n, i));
    end generate g_b;

    g_seed : for i in 0 to SEED_WORDS - 1 generate
      seed_inputs((i + 1) * SUM_WIDTH - 1 downto i * SUM_WIDTH) <=
        std_logic_vector(seeds(SEED_LISTS(n, i)));
    end generate g_seed;

    a_place    <= products.a_choice(n)(selector_width(A_WORDS) - 1 downto 0);
    b_place    <= products.b_choice(n)(selector_width(B_WORDS) - 1 downto 0);
    seed_early <= products.seed_choice(n)(selector_width(SEED_WORDS) - 1 downto 0);

    seed    <= selected(seed_inputs, seed_place, SUM_WIDTH);
    b_word  <= selected(b_inputs, b_place, WORD_WIDTH);
    b_input <= b_word when products.halve(n) = '0' else
               halved(b_word, products.lead(n));

    g_block : if not FAMILY generate

      seed_place <= seed_early;

      i_mac : entity work.mac_block
        generic map (
          A_WIDTH           => WORD_WIDTH,
          B_WIDTH           => WORD_WIDTH,
          A_WORDS           => A_WORDS,
          B_WORDS           => 1,
          ALIGNMENT_STEP    => 0,
          ACCUMULATOR_WIDTH => SUM_WIDTH
        )
        port map (
          clk         => clk,
          enable      => products.issue(n),
          a_inputs    => a_inputs,
          a_select    => a_place,
          b_inputs    => b_input,
          b_select    => "0",
          alignment   => "00",
          accumulate  => products.gather(n),
          seed        => seed,
          accumulator => total
        );

    end generate g_block;

    -- a mac_block whose seed comes with the product: a place in a list waits for it in fewer registers than a seed
    g_late_seed : if FAMILY generate

      signal seed_later : std_logic_vector(selector_width(SEED_WORDS) - 1 downto 0);
      signal issued     : std_logic_vector(1 to 2); -- issue, as many clocks later
      signal gathered   : std_logic_vector(1 to 2);
      signal a          : signed_word_t;
      signal b          : signed_word_t;
      signal product    : signed(2 * WORD_WIDTH - 1 downto 0);
      signal held       : sum_t;

    begin

      p_block : process (clk) is
      begin

        if rising_edge(clk) then
          seed_later <= seed_early;
          seed_place <= seed_later;
          issued     <= products.issue(n) & issued(1);
          gathered   <= products.gather(n) & gathered(1);

          if (products.issue(n) = '1') then
            a <= signed(selected(a_inputs, a_place, WORD_WIDTH));
            b <= signed(b_input);
          end if;

          if (issued(1) = '1') then
            product <= a * b;
          end if;

          if (issued(2) = '1') then
            if (gathered(2) = '1') then
              held <= resize(product, SUM_WIDTH) + held;
            else
              held <= resize(product, SUM_WIDTH) + signed(seed);
            end if;
          end if;
        end if;

      end process p_block;

      total <= std_logic_vector(held);

    end generate g_late_seed;

    sums(n) <= signed(total);

  end generate g_blocks;

  sum       <= sums(BLOCK_COUNT - 1);
  sum_alpha <= sums(0);
  sum_beta  <= sums(1);

  ---------------------------------------------------------------------------------------------
  -- Results
  ---------------------------------------------------------------------------------------------

  brief <= to_std_logic(sums(0)(SUM_WIDTH - 1 downto 2 * FRACTION - 2) = 0);

  p_words : process (clk) is

    subtype value_t is signed(SUM_WIDTH - FRACTION - 1 downto 0);

    variable value : value_t;

  begin

    if rising_edge(clk) then
      if (idle = '1') then
        flagged <= '0';
        doubled <= '0';
      end if;

      -- without voltage no vector differs from another
      if (too_far = '1' or (idle = '0' and unsigned(sample.v_dc) = 0)) then
        flagged <= '1';
      end if;

      for i in 0 to WORD_EVENTS - 1 loop
        if (events.word_writes(i) = '1') then
          value := sums(WORD_WRITES(i, 1))(SUM_WIDTH - 1 downto FRACTION);

          -- MPFC: |w|**2 below a quarter counts four times, the modulus twice then
          if (FLUX_CONTROL and WORD_WRITES(i, 2) = RESULT_MODULUS) then
            if (WORD_WRITES(i, 1) = 0 and brief = '1') then
              value := sums(0)(SUM_WIDTH - 3 downto FRACTION - 2);
            elsif (WORD_WRITES(i, 1) /= 0 and doubled = '1') then
              value := shift_right(value, 1);
            end if;
          end if;

          results(WORD_WRITES(i, 2)) <= clip(value, WORD_WIDTH);

          if (overflows(value, WORD_WIDTH) = '1' and (i < WORD_WRITES_MPTC or mpfc = '1')) then
            flagged <= '1';
          end if;

          if (FLUX_CONTROL and WORD_WRITES(i, 2) = RESULT_MOMENT) then
            guard <= sums(WORD_WRITES(i, 1))(FRACTION - 1 downto FRACTION - MOMENT_GUARD);
          end if;

          if (FLUX_CONTROL and WORD_WRITES(i, 2) = RESULT_MODULUS and WORD_WRITES(i, 1) = 0) then
            doubled  <= brief;
            to_round <= '1';

            -- a torque that does not fit here is out of reach
            if (brief = '1') then
              results(RESULT_MOMENT) <= clip(results(RESULT_MOMENT) & guard(MOMENT_GUARD - 1), WORD_WIDTH);
              guard                  <= shift_left(guard, 1);
            end if;
          end if;
        end if;
      end loop;

      if (FLUX_CONTROL and to_round = '1') then
        to_round               <= '0';
        results(RESULT_MOMENT) <= clip(resize(results(RESULT_MOMENT), WORD_WIDTH + 1)
                                       + signed'('0' & guard(MOMENT_GUARD - 1)), WORD_WIDTH);
      end if;

      -- MPFC: bring w and the torque reference to full size; no shift makes |w|**2 more than one half
      if (FLUX_CONTROL and events.normalise = '1') then
        if (overflows(results(RESULT_ROTOR_ALPHA), WORD_WIDTH - 3) = '0'
            and overflows(results(RESULT_ROTOR_BETA), WORD_WIDTH - 3) = '0') then
          results(RESULT_ROTOR_ALPHA) <= shift_left(results(RESULT_ROTOR_ALPHA), 2);
          results(RESULT_ROTOR_BETA)  <= shift_left(results(RESULT_ROTOR_BETA), 2);
          results(RESULT_MOMENT)      <= clip(results(RESULT_MOMENT) & guard(MOMENT_GUARD - 1 downto MOMENT_GUARD - 2),
                                              WORD_WIDTH);
          guard                       <= shift_left(guard, 2);

          if (overflows(results(RESULT_MOMENT), WORD_WIDTH - 2) = '1') then
            flagged <= '1';
          end if;
        end if;
      end if;

      -- a last shift by one bit; without rotor flux take it to lie along alpha
      if (FLUX_CONTROL and events.orient = '1') then
        if (results(RESULT_ROTOR_ALPHA) = 0 and results(RESULT_ROTOR_BETA) = 0) then
          results(RESULT_ROTOR_ALPHA)(WORD_WIDTH - 1 downto WORD_WIDTH - 2) <= "11";
        elsif (overflows(results(RESULT_ROTOR_ALPHA), WORD_WIDTH - 2) = '0'
               and overflows(results(RESULT_ROTOR_BETA), WORD_WIDTH - 2) = '0') then
          results(RESULT_ROTOR_ALPHA) <= shift_left(results(RESULT_ROTOR_ALPHA), 1);
          results(RESULT_ROTOR_BETA)  <= shift_left(results(RESULT_ROTOR_BETA), 1);
          results(RESULT_MOMENT)      <= clip(results(RESULT_MOMENT) & guard(MOMENT_GUARD - 1), WORD_WIDTH);
          guard                       <= shift_left(guard, 1);

          if (overflows(results(RESULT_MOMENT), WORD_WIDTH - 1) = '1') then
            flagged <= '1';
          end if;
        end if;
      end if;
    end if;

  end process p_words;

  overflow <= flagged;

  p_terms : process (clk) is

    variable wide : term_t;

  begin

    if rising_edge(clk) then
      for i in 0 to TERM_EVENTS - 1 loop
        if (events.term_writes(i) = '1') then
          wide := term_of(sums(TERM_WRITES(i, 1)));

          if (TERM_WRITES(i, 2) = TERM_ALONG or TERM_WRITES(i, 2) = TERM_ACROSS) then
            terms(TERM_WRITES(i, 2)) <= wide;
          elsif (TERM_WRITES(i, 2) = TERM_DEMAND) then
            terms(TERM_LEVEL) <= wide;
          elsif (TERM_WRITES(i, 2) = TERM_OPENING) then
            -- torque reference, less torque at k+1
            terms(TERM_OPENING) <= terms(TERM_LEVEL) - wide;
          elsif (i < TERM_WRITES_MPTC) then
            -- torque reference, less torque without voltage
            terms(TERM_LEVEL) <= terms(TERM_LEVEL) - wide;
          else
            terms(TERM_LEVEL) <= shift_right(wide, 3);
          end if;
        end if;
      end loop;
    end if;

  end process p_terms;

  state.stator_alpha <= results(RESULT_STATOR_ALPHA);
  state.stator_beta  <= results(RESULT_STATOR_BETA);
  state.step_alpha   <= results(RESULT_STEP_ALPHA);
  state.step_beta    <= results(RESULT_STEP_BETA);
  state.level        <= terms(TERM_LEVEL);
  state.along        <= terms(TERM_ALONG);
  state.across       <= terms(TERM_ACROSS);
  state.opening      <= terms(TERM_OPENING);
  state.rotor_alpha  <= results(RESULT_ROTOR_ALPHA);
  state.moment       <= results(RESULT_MOMENT);

end architecture rtl;
