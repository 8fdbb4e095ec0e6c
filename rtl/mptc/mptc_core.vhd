-- Predictive torque control (MPTC) and predictive flux control (MPFC) of an induction machine on a
-- two-level inverter (Paper B): the core.
--
-- Give the measurements, the references and the vector that is being applied with a one-clock
-- start; valid comes with the vector to apply next.  The decision (docs/specification.md, section 3):
-- the state is taken to k+1 by Heun's method (eqs. 4, 5), i_s0 is formed once (eq. 14), one stator
-- flux and one torque per vector (eqs. 13, 15), cost (eq. 11) with k_psi, or for MPFC the distance
-- from the reference vector of eqs. 18 to 21 (eq. 17, its square).  Ties go to the lowest number;
-- u_0 or u_7 stands for zero voltage, whichever takes fewer commutations from u.
--
-- How: three mac_blocks follow the program in mptc_constants (directmpc/mptc/program.py, where every
-- product stands with its clock).  w = i_s - lambda*L_r*psi_s takes the current's place as a state,
-- which makes i_s0 one Euler step of it (directmpc/mptc/formats.py).  Then the seven vectors stream
-- past, one a clock: flux by two additions, its length by mptc_magnitude, torque by two additions,
-- cost by the third mac_block, comparison.  MPFC needs neither arcsine nor division: multiplied by
-- |w|**2 its reference vector is made of products and one square root (mptc_root).
--
-- Formats: fractions of the drive's full scales, directmpc/mptc/formats.py; parameters as
-- directmpc.mptc.coefficients computes them from a drive file.
-- Latency: valid 39 clocks after start for MPTC, 78 for MPFC, always; one decision at a time, the
-- next start may come with valid.
-- Overflow: saturates and sets saturated; nothing wraps.  clamped says that the torque reference was
-- beyond what the rotor flux allows (the arcsine's argument beyond 1).
-- Defined corners: with all costs equal the lowest number wins; without rotor flux MPFC takes it to
-- lie along alpha (an angle of zero, docs/specification.md, section 3.4), so that a start from zero flux moves.
-- FLUX_CONTROL = false leaves MPFC out: the core then takes flux_control for '0'.
-- Alternatives tried, in xc3s slices (LUT + flip-flop)/2: adder, subtractor and a multiplexer behind
-- them, where one adder with an inverted operand does, here and in mptc_magnitude: 220 more; the
-- halves of Heun's steps by subtractors instead of halved coefficients, T_s*u by adders instead of a
-- product: 110 more; a run-time scale for c_weight: 22 more, for a range that nobody asks for.
-- With MPFC the program is decoded a clock ahead: decoding and choosing among its longer lists in one
-- clock ends at 95 to 105 MHz on ECP5, five seeds, where this reaches 107 at least.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;

entity mptc_core is
  generic (
    FLUX_CONTROL : boolean := true -- true: MPFC can be chosen at run time
  );
  port (
    clk             : in    std_logic;                                  -- rising edge
    rst             : in    std_logic;                                  -- synchronous, active high
    start           : in    std_logic;                                  -- '1' for one clock: decide; ignored while busy
    -- measurements and references, sampled with start
    is_alpha        : in    std_logic_vector(15 downto 0);              -- stator current, signed, current_max/32767
    is_beta         : in    std_logic_vector(15 downto 0);              -- signed, current_max/32767
    psis_alpha      : in    std_logic_vector(15 downto 0);              -- stator flux linkage, signed, psi_max/32767
    psis_beta       : in    std_logic_vector(15 downto 0);              -- signed, psi_max/32767
    omega_r         : in    std_logic_vector(15 downto 0);              -- electrical speed, signed, speed_max/32767
    v_dc            : in    std_logic_vector(15 downto 0);              -- dc-link voltage, unsigned, vdc/32768
    torque_ref      : in    std_logic_vector(15 downto 0);              -- torque reference, signed, torque_max/32767
    psi_ref         : in    std_logic_vector(14 downto 0);              -- flux reference, unsigned, psi_max/26979
    u               : in    std_logic_vector(2 downto 0);               -- number of the vector being applied, 0 to 7
    -- parameters from a drive file, stable from start to valid; coefficients signed, 17 fractional bits
    c_current       : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- I/W: current in w
    c_flux          : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- -lambda*L_r*P/W: flux in w
    c_rotor         : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- w in T_s*dw/dt
    c_rotor_flux    : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- flux in T_s*dw/dt
    c_drop_current  : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- -T_s*R_s*I/P: current in T_s*dpsi_s/dt
    c_drop          : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- w in T_s*dpsi_s/dt
    c_drop_flux     : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- flux in T_s*dpsi_s/dt
    c_speed         : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- T_s*speed_max
    c_voltage_alpha : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- 2*T_s*2/3*v_dc in fluxes
    c_voltage_beta  : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- 2*T_s*v_dc/sqrt(3) in fluxes
    c_torque        : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- torque_max in torque terms
    c_weight        : in    std_logic_vector(WORD_WIDTH - 1 downto 0);  -- k_psi, not negative
    method_mpfc     : in    std_logic;                                  -- '1': MPFC, '0': MPTC; sampled with start
    -- decision, stable until the next valid
    valid           : out   std_logic;                                  -- '1' for one clock: decision is new
    busy            : out   std_logic;                                  -- '1': a decision is under way
    u_next          : out   std_logic_vector(2 downto 0);               -- number of the vector to apply next, 0 to 7
    switches        : out   std_logic_vector(2 downto 0);               -- its switch states a, b, c; '1': positive rail
    saturated       : out   std_logic;                                  -- '1': a value did not fit its word
    clamped         : out   std_logic                                   -- '1': MPFC cannot reach torque_ref
  );
end entity mptc_core;

architecture rtl of mptc_core is

  subtype word_t is std_logic_vector(WORD_WIDTH - 1 downto 0);

  subtype sum_t is signed(SUM_WIDTH - 1 downto 0);

  subtype term_t is signed(TERM_WIDTH - 1 downto 0);

  subtype cost_t is signed(COST_WIDTH - COST_DROPPED - 1 downto 0);

  subtype number_t is unsigned(2 downto 0);

  type words_t is array (0 to OPERAND_COUNT - 1) of word_t;

  type results_t is array (0 to RESULT_COUNT - 1) of signed(WORD_WIDTH - 1 downto 0);

  type terms_t is array (0 to TERM_COUNT - 1) of term_t;

  type sums_t is array (0 to BLOCK_COUNT - 1) of sum_t;

  type seeds_t is array (0 to SEED_COUNT_ALL - 1) of sum_t;

  subtype select_t is std_logic_vector(4 downto 0);

  type selects_t is array (0 to BLOCK_COUNT - 1) of select_t;

  subtype blocks_t is std_logic_vector(0 to BLOCK_COUNT - 1);

  -- as many of a table's entries as this configuration has
  function counted (every, without : natural) return natural is
  begin

    if (FLUX_CONTROL) then
      return every;
    else
      return without;
    end if;

  end function counted;

  constant PARKED      : natural := counted(2 ** 7 - 1, 2 ** 6 - 1); -- address of an idle core
  constant STEPS       : natural := counted(STEP_COUNT, STEP_COUNT_MPTC);
  constant WORD_EVENTS : natural := counted(WORD_WRITES'length(1), WORD_WRITES_MPTC);
  constant TERM_EVENTS : natural := counted(TERM_WRITES'length(1), TERM_WRITES_MPTC);

  -- a measurement as a word
  function as_word (value : std_logic_vector) return word_t is
  begin

    return std_logic_vector(shift_left(resize(signed(value), WORD_WIDTH), MEASUREMENT_SHIFT));

  end function as_word;

  -- half of a word, or one plus half of it for negative words
  function halved (value : word_t; leading : std_logic) return word_t is

    variable result : word_t;

  begin

    result                 := std_logic_vector(shift_right(signed(value), 1));
    result(WORD_WIDTH - 1) := value(WORD_WIDTH - 1) xor leading;
    return result;

  end function halved;

  -- value + step or value - step, one adder
  function moved (value, step : signed; negative : std_logic) return signed is

    variable a : signed(value'length downto 0);
    variable b : signed(value'length downto 0);

  begin

    a := value & '1';
    b := resize(step, value'length) & '0';

    if (negative = '1') then
      b := not b;
    end if;

    a := a + b;
    return a(value'length downto 1);

  end function moved;

  -- a word as a seed, with the constant that rounds the sum
  function seed_of (value : signed) return sum_t is

    variable result : sum_t;

  begin

    result               := shift_left(resize(value, SUM_WIDTH), FRACTION);
    result(FRACTION - 1) := '1';
    return result;

  end function seed_of;

  -- sequence
  signal active   : std_logic;
  signal address  : natural range 0 to 2 ** 7 - 1;
  signal mpfc     : std_logic;
  signal finished : std_logic;

  -- sampled inputs
  signal sample_is_alpha   : std_logic_vector(15 downto 0);
  signal sample_is_beta    : std_logic_vector(15 downto 0);
  signal sample_psis_alpha : std_logic_vector(15 downto 0);
  signal sample_psis_beta  : std_logic_vector(15 downto 0);
  signal sample_omega_r    : std_logic_vector(15 downto 0);
  signal sample_v_dc       : std_logic_vector(15 downto 0);
  signal sample_torque_ref : std_logic_vector(15 downto 0);
  signal sample_psi_ref    : std_logic_vector(14 downto 0);
  signal applied           : number_t;

  -- program
  signal words     : words_t;
  signal results   : results_t;
  signal terms     : terms_t;
  signal sums      : sums_t;
  signal seeds     : seeds_t;
  signal issue     : blocks_t;  -- '1': a product
  signal gather    : blocks_t;  -- '1': added to the sum so far
  signal halve     : blocks_t;  -- '1': half of B
  signal lead      : blocks_t;  -- '1': one plus half of B
  signal a_choice  : selects_t; -- place in A_LISTS
  signal b_choice  : selects_t; -- place in B_LISTS
  signal s_choice  : selects_t; -- place in SEED_LISTS
  -- the same, of the address or with FLUX_CONTROL of the next one
  signal a_choice_decoded : selects_t;
  signal b_choice_decoded : selects_t;
  signal s_choice_decoded : selects_t;
  signal issue_decoded    : blocks_t;
  signal gather_decoded   : blocks_t;
  signal halve_decoded    : blocks_t;
  signal lead_decoded     : blocks_t;
  signal overflow  : std_logic;

  -- flux control
  signal root_load     : std_logic;
  signal root_bits     : std_logic_vector(2 * ROOT_WIDTH - 1 downto 0);
  signal root          : std_logic_vector(ROOT_WIDTH - 1 downto 0);
  signal beyond        : std_logic;
  signal root_along    : word_t;
  signal root_across   : word_t;
  signal radicand_fits : std_logic;

  -- stream of vectors: 1 to 6, then 7 for zero voltage; 0: none
  signal length_number : number_t;
  signal length_enable : std_logic;
  signal x             : signed(LENGTH_WIDTH - 1 downto 0);
  signal y             : signed(LENGTH_WIDTH - 1 downto 0);
  signal x_bits        : std_logic_vector(LENGTH_WIDTH - 1 downto 0);
  signal y_bits        : std_logic_vector(LENGTH_WIDTH - 1 downto 0);
  signal difference    : word_t;
  signal too_far       : std_logic;
  signal length_valid  : std_logic;
  signal cost_number   : number_t;
  signal stream        : unsigned(3 downto 0);
  signal term_whole    : std_logic; -- '1': all of the step along alpha, '0': half of it
  signal term_alpha    : std_logic; -- '1': a step along alpha
  signal term_beta     : std_logic; -- '1': a step along beta
  signal term_add      : std_logic; -- '1': alpha's is subtracted
  signal term_subtract : std_logic; -- '1': beta's is subtracted
  signal term          : term_t;
  signal cost          : cost_t;
  signal best_cost     : cost_t;
  signal best          : number_t;
  signal better        : std_logic;
  signal wins_tie      : std_logic;
  signal winner        : number_t;
  signal u_chosen      : number_t;

  -- +1, 0 or -1 times the whole step along beta, as sign and magnitude
  function has_beta (number : number_t) return std_logic is
  begin

    return to_std_logic(number = 2 or number = 3 or number = 5 or number = 6);

  end function has_beta;

  function negative_beta (number : number_t) return std_logic is
  begin

    return to_std_logic(number = 5 or number = 6);

  end function negative_beta;

  function negative_alpha (number : number_t) return std_logic is
  begin

    return to_std_logic(number = 3 or number = 4 or number = 5);

  end function negative_alpha;

  function whole_alpha (number : number_t) return std_logic is
  begin

    return to_std_logic(number = 1 or number = 4);

  end function whole_alpha;

  function has_alpha (number : number_t) return std_logic is
  begin

    return to_std_logic(number /= 0 and number /= 7);

  end function has_alpha;

begin

  ---------------------------------------------------------------------------------------------
  -- Sequence
  ---------------------------------------------------------------------------------------------

  p_sequence : process (clk) is
  begin

    if rising_edge(clk) then
      valid <= '0';

      if (active = '1') then
        if (finished = '1') then
          active  <= '0';
          valid   <= '1';
          address <= PARKED;
        elsif (FLUX_CONTROL and mpfc = '1' and address = FORK - 1) then
          address <= FORK_ADDRESS;
        else
          address <= (address + 1) mod 2 ** 7;
        end if;
      elsif (start = '1') then
        active  <= '1';
        address <= 0;
      end if;

      if (rst = '1') then
        active  <= '0';
        address <= PARKED;
        valid   <= '0';
      end if;
    end if;

  end process p_sequence;

  finished <= to_std_logic(address = LAST_MPTC - 1 or (FLUX_CONTROL and address = LAST_MPFC - 1));
  busy     <= active;

  p_sample : process (clk) is
  begin

    if rising_edge(clk) then
      if (active = '0' and start = '1') then
        sample_is_alpha   <= is_alpha;
        sample_is_beta    <= is_beta;
        sample_psis_alpha <= psis_alpha;
        sample_psis_beta  <= psis_beta;
        sample_omega_r    <= omega_r;
        sample_v_dc       <= v_dc;
        sample_torque_ref <= torque_ref;
        sample_psi_ref    <= psi_ref;
        applied           <= unsigned(u);
      end if;
    end if;

  end process p_sample;

  ---------------------------------------------------------------------------------------------
  -- Operands and seeds
  ---------------------------------------------------------------------------------------------

  words(OPERAND_IS_ALPHA)   <= as_word(sample_is_alpha);
  words(OPERAND_IS_BETA)    <= as_word(sample_is_beta);
  words(OPERAND_PSIS_ALPHA) <= as_word(sample_psis_alpha);
  words(OPERAND_PSIS_BETA)  <= as_word(sample_psis_beta);
  words(OPERAND_OMEGA_R)    <= as_word(sample_omega_r);
  words(OPERAND_V_DC)       <= std_logic_vector(shift_left(resize(unsigned(sample_v_dc), WORD_WIDTH), LINK_SHIFT));
  words(OPERAND_TORQUE_REF) <= as_word(sample_torque_ref);
  words(OPERAND_PSI_REF)    <= as_word('0' & sample_psi_ref);

  words(OPERAND_C_CURRENT)       <= c_current;
  words(OPERAND_C_FLUX)          <= c_flux;
  words(OPERAND_C_ROTOR)         <= c_rotor;
  words(OPERAND_C_ROTOR_FLUX)    <= c_rotor_flux;
  words(OPERAND_C_DROP_CURRENT)  <= c_drop_current;
  words(OPERAND_C_DROP)          <= c_drop;
  words(OPERAND_C_DROP_FLUX)     <= c_drop_flux;
  words(OPERAND_C_SPEED)         <= c_speed;
  words(OPERAND_C_VOLTAGE_ALPHA) <= c_voltage_alpha;
  words(OPERAND_C_VOLTAGE_BETA)  <= c_voltage_beta;
  words(OPERAND_C_TORQUE)        <= c_torque;
  words(OPERAND_C_WEIGHT)        <= c_weight;

  words(OPERAND_GAIN)       <= std_logic_vector(to_unsigned(GAIN, WORD_WIDTH));
  words(OPERAND_ROOT3_2)    <= std_logic_vector(to_unsigned(ROOT3_2, WORD_WIDTH));
  words(OPERAND_DIFFERENCE) <= difference and (word_t'range => not mpfc);

  g_results : for i in 0 to counted(RESULT_COUNT, RESULT_COUNT_MPTC) - 1 generate
    words(OPERAND_START_ALPHA + i) <= std_logic_vector(results(i));
  end generate g_results;

  words(OPERAND_NOT_START_BETA)      <= not words(OPERAND_START_BETA);
  words(OPERAND_NOT_ROTOR_BETA)      <= not words(OPERAND_ROTOR_BETA);
  words(OPERAND_NOT_STATOR_BETA)     <= not words(OPERAND_STATOR_BETA);

  seeds(SEED_HALF)            <= to_signed(2 ** (FRACTION - 1), SUM_WIDTH);
  seeds(SEED_TORQUE_HALF)     <= to_signed(2 ** (TERM_SHIFT - 1), SUM_WIDTH);
  seeds(SEED_ROTOR_ALPHA)     <= seed_of(results(RESULT_ROTOR_ALPHA));
  seeds(SEED_ROTOR_BETA)      <= seed_of(results(RESULT_ROTOR_BETA));
  seeds(SEED_STATOR_ALPHA)    <= seed_of(results(RESULT_STATOR_ALPHA));
  seeds(SEED_STATOR_BETA)     <= seed_of(results(RESULT_STATOR_BETA));
  seeds(SEED_NONE)            <= (others => '0');

  seeds(SEED_PSIS_ALPHA)  <= seed_of(signed(words(OPERAND_PSIS_ALPHA)));
  seeds(SEED_PSIS_BETA)   <= seed_of(signed(words(OPERAND_PSIS_BETA)));
  seeds(SEED_START_ALPHA) <= seed_of(results(RESULT_START_ALPHA));
  seeds(SEED_START_BETA)  <= seed_of(results(RESULT_START_BETA));

  -- what u takes of the steps: 1/2 or 1/4 of either sign, or nothing
  p_share : process (applied) is

    variable alpha : word_t;
    variable beta  : word_t;

  begin

    alpha                          := (others => negative_alpha(applied));
    alpha(FRACTION - 2 downto 0)   := (others => '0');
    alpha(FRACTION - 2)            := has_alpha(applied) and not whole_alpha(applied);
    alpha(FRACTION - 1)            := has_alpha(applied) and (whole_alpha(applied) or negative_alpha(applied));
    beta                           := (others => negative_beta(applied));
    beta(FRACTION - 1 downto 0)    := (others => '0');
    beta(FRACTION - 1)             := has_beta(applied);
    words(OPERAND_SHARE_ALPHA)     <= alpha;
    words(OPERAND_SHARE_BETA)      <= beta;

  end process p_share;

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

  p_decode : process (address, active, start, mpfc) is

    variable due      : boolean;
    variable a_chosen : selects_t;
    variable b_chosen : selects_t;
    variable s_chosen : selects_t;
    variable halving  : blocks_t;
    variable leading  : blocks_t;
    variable issued   : blocks_t;
    variable gathered : blocks_t;

    -- an index that is not negative, as bits
    function bits_of (index : integer) return select_t is
    begin

      if (index < 0) then
        return (others => '0');
      else
        return std_logic_vector(to_unsigned(index, select_t'length));
      end if;

    end function bits_of;

  begin

    a_chosen := (others => (others => '0'));
    b_chosen := (others => (others => '0'));
    s_chosen := (others => (others => '0'));
    issued   := (others => '0');
    gathered := (others => '0');
    halving  := (others => '0');
    leading  := (others => '0');

    for i in 0 to STEPS - 1 loop
      if (not FLUX_CONTROL) then
        due := address = PROGRAM(i, 0);
      elsif (PROGRAM(i, 0) = 0) then
        due := start = '1' and active = '0';
      elsif (PROGRAM(i, 0) = FORK) then
        due := address = FORK - 1 and mpfc = '0';
      elsif (PROGRAM(i, 0) = FORK_ADDRESS) then
        due := address = FORK - 1 and mpfc = '1';
      else
        due := address = PROGRAM(i, 0) - 1;
      end if;

      if (due) then
        a_chosen(PROGRAM(i, 1)) := a_chosen(PROGRAM(i, 1)) or bits_of(PROGRAM(i, 2));
        b_chosen(PROGRAM(i, 1)) := b_chosen(PROGRAM(i, 1)) or bits_of(PROGRAM(i, 3));
        s_chosen(PROGRAM(i, 1)) := s_chosen(PROGRAM(i, 1)) or bits_of(PROGRAM(i, 4));
        issued(PROGRAM(i, 1))   := '1';
        gathered(PROGRAM(i, 1)) := gathered(PROGRAM(i, 1)) or to_std_logic(PROGRAM(i, 4) < 0);
        halving(PROGRAM(i, 1))  := halving(PROGRAM(i, 1)) or to_std_logic(PROGRAM(i, 5) > 0);
        leading(PROGRAM(i, 1))  := leading(PROGRAM(i, 1)) or to_std_logic(PROGRAM(i, 5) > 1);
      end if;
    end loop;

    a_choice_decoded <= a_chosen;
    b_choice_decoded <= b_chosen;
    s_choice_decoded <= s_chosen;
    issue_decoded    <= issued;
    gather_decoded   <= gathered;
    halve_decoded    <= halving;
    lead_decoded     <= leading;

  end process p_decode;

  -- MPFC's longer lists leave no time for decoding and choosing in one clock
  g_ahead : if FLUX_CONTROL generate

    p_ahead : process (clk) is
    begin

      if rising_edge(clk) then
        a_choice <= a_choice_decoded;
        b_choice <= b_choice_decoded;
        s_choice <= s_choice_decoded;
        issue    <= issue_decoded;
        gather   <= gather_decoded;
        halve    <= halve_decoded;
        lead     <= lead_decoded;
      end if;

    end process p_ahead;

  end generate g_ahead;

  g_at_once : if not FLUX_CONTROL generate
    a_choice <= a_choice_decoded;
    b_choice <= b_choice_decoded;
    s_choice <= s_choice_decoded;
    issue    <= issue_decoded;
    gather   <= gather_decoded;
    halve    <= halve_decoded;
    lead     <= lead_decoded;
  end generate g_at_once;

  g_blocks : for n in 0 to BLOCK_COUNT - 1 generate

    constant A_WORDS     : natural := counted(A_COUNT(n), A_COUNT_MPTC(n));
    constant B_WORDS     : natural := counted(B_COUNT(n), B_COUNT_MPTC(n));
    constant SEED_WORDS  : natural := counted(SEED_COUNT(n), SEED_COUNT_MPTC(n));

    signal a_inputs    : std_logic_vector(A_WORDS * WORD_WIDTH - 1 downto 0);
    signal b_inputs    : std_logic_vector(B_WORDS * WORD_WIDTH - 1 downto 0);
    signal seed_inputs : std_logic_vector(SEED_WORDS * SUM_WIDTH - 1 downto 0);
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

    seed    <= selected(seed_inputs, s_choice(n)(selector_width(SEED_WORDS) - 1 downto 0), SUM_WIDTH);
    b_word  <= selected(b_inputs, b_choice(n)(selector_width(B_WORDS) - 1 downto 0), WORD_WIDTH);
    b_input <= b_word when halve(n) = '0' else
               halved(b_word, lead(n));

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
        enable      => issue(n),
        a_inputs    => a_inputs,
        a_select    => a_choice(n)(selector_width(A_WORDS) - 1 downto 0),
        b_inputs    => b_input,
        b_select    => "0",
        alignment   => "00",
        accumulate  => gather(n),
        seed        => seed,
        accumulator => total
      );

    sums(n) <= signed(total);

  end generate g_blocks;

  p_results : process (clk) is

    variable value : signed(SUM_WIDTH - FRACTION - 1 downto 0);
    variable wide  : term_t;

  begin

    if rising_edge(clk) then
      if (active = '0') then
        overflow <= '0';
      end if;

      if (too_far = '1' and length_valid = '1') then
        overflow <= '1';
      end if;

      for i in 0 to WORD_EVENTS - 1 loop
        if (address = WORD_WRITES(i, 0)) then
          value                      := sums(WORD_WRITES(i, 1))(SUM_WIDTH - 1 downto FRACTION);
          results(WORD_WRITES(i, 2)) <= clip(value, WORD_WIDTH);

          if (overflows(value, WORD_WIDTH) = '1' and (i < WORD_WRITES_MPTC or mpfc = '1')) then
            overflow <= '1';
          end if;
        end if;
      end loop;

      for i in 0 to TERM_EVENTS - 1 loop
        if (address = TERM_WRITES(i, 0)) then
          wide := sums(TERM_WRITES(i, 1))(TERM_SHIFT + TERM_WIDTH - 1 downto TERM_SHIFT);

          if (TERM_WRITES(i, 2) = TERM_ALONG or TERM_WRITES(i, 2) = TERM_ACROSS) then
            terms(TERM_WRITES(i, 2)) <= wide;
          end if;
        end if;
      end loop;

      -- torque reference, less torque without voltage
      for i in 0 to TERM_WRITES_MPTC - 1 loop
        if (address = TERM_WRITES(i, 0)) then
          wide := sums(TERM_WRITES(i, 1))(TERM_SHIFT + TERM_WIDTH - 1 downto TERM_SHIFT);

          if (TERM_WRITES(i, 2) = TERM_DEMAND) then
            terms(TERM_LEVEL) <= wide;
          elsif (TERM_WRITES(i, 2) = TERM_LEVEL) then
            terms(TERM_LEVEL) <= terms(TERM_LEVEL) - wide;
          end if;
        end if;
      end loop;

      for i in TERM_WRITES_MPTC to TERM_EVENTS - 1 loop
        if (address = TERM_WRITES(i, 0) and TERM_WRITES(i, 2) = TERM_LEVEL) then
          wide              := sums(TERM_WRITES(i, 1))(TERM_SHIFT + TERM_WIDTH - 1 downto TERM_SHIFT);
          terms(TERM_LEVEL) <= shift_right(wide, 3);
        end if;
      end loop;

      -- MPFC: bring w and the torque reference to full size; without rotor flux take it along alpha
      if (FLUX_CONTROL and address >= FIRST_NORMALISE
          and address < FIRST_NORMALISE + NORMALISE_STEPS) then
        if (overflows(results(RESULT_ROTOR_ALPHA), WORD_WIDTH - 2) = '0'
            and overflows(results(RESULT_ROTOR_BETA), WORD_WIDTH - 2) = '0') then
          results(RESULT_ROTOR_ALPHA) <= shift_left(results(RESULT_ROTOR_ALPHA), 2);
          results(RESULT_ROTOR_BETA)  <= shift_left(results(RESULT_ROTOR_BETA), 2);
          results(RESULT_MOMENT)      <= clip(results(RESULT_MOMENT) & "00", WORD_WIDTH);

          if (overflows(results(RESULT_MOMENT), WORD_WIDTH - 2) = '1') then
            overflow <= '1';
          end if;
        end if;
      end if;

      if (FLUX_CONTROL and address = FIRST_NORMALISE + NORMALISE_STEPS) then
        if (results(RESULT_ROTOR_ALPHA) = 0 and results(RESULT_ROTOR_BETA) = 0) then
          results(RESULT_ROTOR_ALPHA)(WORD_WIDTH - 1 downto WORD_WIDTH - 2) <= "11";
        end if;
      end if;
    end if;

  end process p_results;

  ---------------------------------------------------------------------------------------------
  -- MPFC: part of the reference along the rotor flux, and across it
  ---------------------------------------------------------------------------------------------

  g_flux_control : if FLUX_CONTROL generate

    p_method : process (clk) is
    begin

      if rising_edge(clk) then
        if (active = '0' and start = '1') then
          mpfc <= method_mpfc;
        end if;
      end if;

    end process p_method;

    words(OPERAND_NOT_HALF_ANGLE) <= not std_logic_vector(shift_right(results(RESULT_ANGLE), 1));
    words(OPERAND_NOT_MOMENT)     <= not words(OPERAND_MOMENT);
    words(OPERAND_ROOT_ALONG)     <= root_along;
    words(OPERAND_ROOT_ACROSS)    <= root_across;

    -- first the square of the reference's length, then, where it stays positive, less the torque's
    radicand_fits <= not sums(BLOCK_COUNT - 1)(SUM_WIDTH - 1);
    root_load     <= to_std_logic(address = FIRST_ROOT)
                     or (to_std_logic(address = FIRST_ROOT + 1) and radicand_fits);
    root_bits     <= std_logic_vector(sums(BLOCK_COUNT - 1)(2 * ROOT_WIDTH - 1 downto 0));

    i_root : entity work.mptc_root
      port map (
        clk      => clk,
        rst      => rst,
        load     => root_load,
        radicand => root_bits,
        root     => root
      );

    p_beyond : process (clk) is
    begin

      if rising_edge(clk) then
        if (address = FIRST_ROOT + 1) then
          beyond <= not radicand_fits;
        end if;
      end if;

    end process p_beyond;

    p_parts : process (beyond, root, results) is
    begin

      root_along  <= '0' & root;
      root_across <= std_logic_vector(results(RESULT_MOMENT));

      if (beyond = '1') then
        root_along <= (others => '0');

        if (results(RESULT_MOMENT)(WORD_WIDTH - 1) = '1') then
          root_across <= not ('0' & root);
        else
          root_across <= '0' & root;
        end if;
      end if;

    end process p_parts;

  end generate g_flux_control;

  g_torque_control_only : if not FLUX_CONTROL generate
    mpfc   <= '0';
    beyond <= '0';
  end generate g_torque_control_only;

  ---------------------------------------------------------------------------------------------
  -- Stream of vectors: lengths
  ---------------------------------------------------------------------------------------------

  -- one counter for all: 1 to 7 at the lengths, 5 to 11 at the torque terms, 9 to 15 at the comparison
  p_stream : process (clk) is

    variable following : unsigned(3 downto 0);
    variable number    : number_t;

  begin

    if rising_edge(clk) then
      following := "0000";

      if (stream /= 0) then
        following := stream + 1;
      elsif (address = FIRST_LENGTH - 1 or (FLUX_CONTROL and address = FIRST_STREAM_MPFC - 1)) then
        following := "0001";
      end if;

      if (rst = '1') then
        following := "0000";
      end if;

      stream        <= following;
      number        := following(3) & following(1 downto 0);
      term_whole    <= whole_alpha(number);
      term_alpha    <= has_alpha(number);
      term_beta     <= has_beta(number);
      term_add      <= negative_alpha(number) xnor mpfc;
      term_subtract <= negative_beta(number) xor mpfc;
      wins_tie      <= to_std_logic(following = 15) and not ZERO_IS_SEVEN(to_integer(applied));
    end if;

  end process p_stream;

  length_number <= stream(2 downto 0);
  cost_number   <= stream(2 downto 0);

  p_lengths : process (length_number, results) is

    variable step_x : signed(LENGTH_WIDTH - 1 downto 0);
    variable step_y : signed(LENGTH_WIDTH - 1 downto 0);

  begin

    step_x := shift_left(resize(results(RESULT_STEP_ALPHA), LENGTH_WIDTH), LENGTH_GUARD - 1);

    if (whole_alpha(length_number) = '0') then
      step_x := shift_right(step_x, 1);
    end if;

    step_x := gated(step_x, has_alpha(length_number));
    step_y := shift_left(resize(gated(results(RESULT_STEP_BETA), has_beta(length_number)), LENGTH_WIDTH),
                         LENGTH_GUARD - 1);
    x      <= moved(shift_left(resize(results(RESULT_STATOR_ALPHA), LENGTH_WIDTH), LENGTH_GUARD), step_x,
                    negative_alpha(length_number));
    y      <= moved(shift_left(resize(results(RESULT_STATOR_BETA), LENGTH_WIDTH), LENGTH_GUARD), step_y,
                    negative_beta(length_number));

  end process p_lengths;

  length_enable <= to_std_logic(stream /= 0 and stream < 8 and mpfc = '0');

  x_bits <= std_logic_vector(x);
  y_bits <= std_logic_vector(y);

  i_magnitude : entity work.mptc_magnitude
    port map (
      clk            => clk,
      rst            => rst,
      enable         => length_enable,
      x              => x_bits,
      y              => y_bits,
      half_reference => words(OPERAND_PSI_REF),
      valid          => length_valid,
      difference     => difference,
      overflow       => too_far
    );

  ---------------------------------------------------------------------------------------------
  -- Stream of vectors: torque terms, costs, comparison
  ---------------------------------------------------------------------------------------------

  -- MPTC: demand - torque; MPFC: the same with the opposite vector's sign
  p_term : process (clk) is

    variable whole  : term_t;
    variable along  : term_t;
    variable across : term_t;

  begin

    if rising_edge(clk) then
      if (stream /= 0) then
        along := shift_right(terms(TERM_ALONG), 1);

        if (term_whole = '0') then
          along := shift_right(along, 1);
        end if;

        along  := gated(along, term_alpha);
        across := gated(shift_right(terms(TERM_ACROSS), 1), term_beta);
        whole  := gated(terms(TERM_LEVEL), not mpfc or term_alpha);
        whole  := moved(whole, along, term_add);
        whole  := moved(whole, across, term_subtract);
        term   <= whole;
      end if;
    end if;

  end process p_term;

  cost <= sums(BLOCK_COUNT - 1)(COST_WIDTH - 1 downto COST_DROPPED);

  -- zero voltage comes last and is number 0 or 7: as 0 it wins a tie
  better <= to_std_logic(cost & '0' < best_cost & wins_tie);

  winner <= best when better = '0' else
            cost_number;

  p_best : process (clk) is

    variable chosen : number_t;

  begin

    if rising_edge(clk) then
      if (better = '1') then
        best      <= cost_number;
        best_cost <= cost;
      end if;

      -- before the first comparison: worse than any cost
      if (stream <= 8) then
        best_cost                      <= (others => '1');
        best_cost(best_cost'length - 1) <= '0';
      end if;

      if (finished = '1') then
        chosen := winner;

        if (winner = 7 and ZERO_IS_SEVEN(to_integer(applied)) = '0') then
          chosen := "000";
        end if;

        u_chosen  <= chosen;
        saturated <= overflow;
        clamped   <= beyond and mpfc;
      end if;
    end if;

  end process p_best;

  p_switches : process (u_chosen) is
  begin

    switches <= SWITCHES_OF(to_integer(u_chosen));

  end process p_switches;

  u_next <= std_logic_vector(u_chosen);

end architecture rtl;
