-- Full-order observer of the stator flux (Paper B, eqs. 8 and 9), so that mptc_core needs the stator
-- currents, the speed and the dc-link voltage alone.
--
--   dx/dt = A x + B u + G (i_s - i_s,est),   G = -[2b; b/(lambda*L_r)],   b = -40 1/s by default
--
-- One step takes the estimate from k to k+1 with the current, speed and voltage measured at k and
-- the vector applied from k to k+1; Heun's method, the innovation held over the step.  The flux it
-- answers belongs to k+1: register it, and give it to the core's psis ports at the next start.  The
-- equations, in the states w = i_s - lambda*L_r*psi_s and psi_s, stand in
-- model/directmpc/mptc/observer.py; in those both rows of G are -b.
--
-- Formats: ports and words as in mptc_core (model/directmpc/mptc/formats.py); the states carry 8 bits
-- more than a word, 26 in all: a step's share of the innovation is a few millionths of them.
-- Latency: valid 39 clocks after start, always; one mac_block, one multiplier.
-- Overflow: states and words saturate and set saturated; nothing wraps.  A reset clears the state.
-- Alternative tried: states of a word alone come to rest where the innovation's share of a step is
-- below half an LSB, 0.2 A off; a second mac_block would halve the latency, which nobody waits for.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;

entity mptc_observer is
  port (
    clk             : in    std_logic;                                 -- rising edge
    rst             : in    std_logic;                                 -- synchronous, active high; clears the state
    start           : in    std_logic;                                 -- '1' for one clock: a step; ignored while busy
    -- measurements at k, sampled with start
    is_alpha        : in    std_logic_vector(15 downto 0);             -- stator current, signed, current_max/32767
    is_beta         : in    std_logic_vector(15 downto 0);             -- signed, current_max/32767
    omega_r         : in    std_logic_vector(15 downto 0);             -- electrical speed, signed, speed_max/32767
    v_dc            : in    std_logic_vector(15 downto 0);             -- dc-link voltage, unsigned, vdc/32768
    u               : in    std_logic_vector(2 downto 0);              -- number of the vector applied from k to k+1
    -- parameters, stable from start to valid; signed, 17 fractional bits
    c_current       : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_flux          : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_rotor         : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_rotor_flux    : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_drop          : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_drop_flux     : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_speed         : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_voltage_alpha : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_voltage_beta  : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_gain_rotor    : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- -b*T_s: innovation in w
    c_gain_stator   : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- innovation in psi_s
    -- estimate for k+1, stable until the next valid
    valid           : out   std_logic;                                 -- '1' for one clock: the estimate is new
    busy            : out   std_logic;                                 -- '1': a step is under way
    psis_alpha      : out   std_logic_vector(15 downto 0);             -- stator flux, signed, psi_max/32767
    psis_beta       : out   std_logic_vector(15 downto 0);             -- signed, psi_max/32767
    saturated       : out   std_logic                                  -- '1': a value did not fit its word
  );
end entity mptc_observer;

architecture rtl of mptc_observer is

  constant GUARD       : natural := 8; -- bits of a state below a word's LSB
  constant STATE_WIDTH : natural := WORD_WIDTH + GUARD;
  constant STATE_SHIFT : natural := FRACTION - GUARD;
  constant PORT_SHIFT  : natural := GUARD + MEASUREMENT_SHIFT;
  constant FACTORS_A     : natural := 16;
  constant FACTORS_B     : natural := 14;
  constant STEPS       : natural := 34;
  constant LATCH       : natural := 23; -- address: the innovations give way to w's half steps
  constant ENDING      : natural := 37; -- address: the last state has been written
  constant PARKED      : natural := 63; -- address of an idle observer

  subtype word_t is std_logic_vector(WORD_WIDTH - 1 downto 0);

  subtype sum_t is signed(SUM_WIDTH - 1 downto 0);

  subtype state_t is signed(STATE_WIDTH - 1 downto 0);

  type words_t is array (natural range <>) of word_t;

  type signed_words_t is array (natural range <>) of signed(WORD_WIDTH - 1 downto 0);

  type states_t is array (0 to 3) of state_t;

  type program_t is array (0 to STEPS - 1, 0 to 2) of integer;

  type places_t is array (natural range <>) of natural;

  -- operand A, operand B, seed (-1: accumulate, -2: nothing is issued), in clocks from start on
  constant PROGRAM : program_t := (
    (0, 6, 0), -- omega_r * speed: angle
    (1, 7, 0), -- v_dc * voltage_alpha: step_alpha
    (1, 8, 0), -- v_dc * voltage_beta: step_beta
    (2, 0, 1), -- is_alpha * current
    (4, 1, -1), -- psi_alpha * flux: e_alpha
    (3, 0, 2), -- is_beta * current
    (5, 1, -1), -- psi_beta * flux: e_beta
    (6, 2, 3), -- w_alpha * rotor
    (4, 3, -1), -- psi_alpha * rotor_flux
    (8, 11, -1), -- not w_beta * angle
    (9, 9, -1), -- e_alpha * gain_rotor: following 0
    (7, 2, 4), -- w_beta * rotor
    (5, 3, -1), -- psi_beta * rotor_flux
    (6, 11, -1), -- w_alpha * angle
    (10, 9, -1), -- e_beta * gain_rotor: following 1
    (6, 4, 5), -- w_alpha * drop
    (4, 5, -1), -- psi_alpha * drop_flux
    (14, 12, -1), -- step_alpha * share_alpha
    (9, 10, -1), -- e_alpha * gain_stator: following 2
    (7, 4, 6), -- w_beta * drop
    (5, 5, -1), -- psi_beta * drop_flux
    (15, 13, -1), -- step_beta * share_beta
    (10, 10, -1), -- e_beta * gain_stator: following 3
    (0, 0, -2), -- the half steps take the innovations' place
    (12, 3, 7), -- half_alpha * rotor_flux
    (9, 2, -1), -- half step of w_alpha * rotor
    (11, 11, -1), -- not half step of w_beta * angle: state 0
    (13, 3, 8), -- half_beta * rotor_flux
    (10, 2, -1), -- half step of w_beta * rotor
    (9, 11, -1), -- half step of w_alpha * angle: state 1
    (9, 4, 9), -- half step of w_alpha * drop
    (12, 5, -1), -- half_alpha * drop_flux: state 2
    (10, 4, 10), -- half step of w_beta * drop
    (13, 5, -1) -- half_beta * drop_flux: state 3
  );

  -- addresses at which sums are complete
  constant FOLLOWING_AT : places_t(0 to 3) := (13, 17, 21, 25);
  constant STATE_AT     : places_t(0 to 3) := (29, 32, 34, 36);
  constant INNOVATION_AT : places_t(0 to 1) := (7, 9);
  constant ANGLE_AT     : natural := 3;
  constant STEP_AT      : places_t(0 to 1) := (4, 5);

  signal active  : std_logic;
  signal address : natural range 0 to 63;

  signal sample_is_alpha : std_logic_vector(15 downto 0);
  signal sample_is_beta  : std_logic_vector(15 downto 0);
  signal sample_omega_r  : std_logic_vector(15 downto 0);
  signal sample_v_dc     : std_logic_vector(15 downto 0);
  signal applied         : unsigned(2 downto 0);

  signal state      : states_t; -- w alpha, beta, psi_s alpha, beta
  signal following  : states_t; -- predictor
  signal innovation : signed_words_t(0 to 1);
  signal angle      : signed(WORD_WIDTH - 1 downto 0);
  signal step_of    : signed_words_t(0 to 1);
  signal overflow   : std_logic;

  signal a_words  : words_t(0 to FACTORS_A - 1);
  signal b_words  : words_t(0 to FACTORS_B - 1);
  signal a_inputs : std_logic_vector(FACTORS_A * WORD_WIDTH - 1 downto 0);
  signal b_inputs : std_logic_vector(FACTORS_B * WORD_WIDTH - 1 downto 0);
  signal a_choice : std_logic_vector(3 downto 0);
  signal b_choice : std_logic_vector(3 downto 0);
  signal issue    : std_logic;
  signal gather   : std_logic;
  signal seed     : sum_t;
  signal seed_in  : std_logic_vector(SUM_WIDTH - 1 downto 0);
  signal total    : std_logic_vector(SUM_WIDTH - 1 downto 0);

  -- a measurement as a word
  function as_word (value : std_logic_vector) return word_t is
  begin

    return std_logic_vector(shift_left(resize(signed(value), WORD_WIDTH), MEASUREMENT_SHIFT));

  end function as_word;

  -- a state without its guard bits
  function coarse (value : state_t) return word_t is
  begin

    return std_logic_vector(value(STATE_WIDTH - 1 downto GUARD));

  end function coarse;

  -- half of what a state has moved
  function half_of (value, from_value : state_t) return signed is

    variable moved : signed(STATE_WIDTH downto 0);

  begin

    moved := resize(value, STATE_WIDTH + 1) - resize(from_value, STATE_WIDTH + 1);
    return moved(STATE_WIDTH downto GUARD + 1);

  end function half_of;

  -- a state as a seed, with the constant that rounds the sum to a state
  function seed_of (value : state_t) return sum_t is

    variable result : sum_t;

  begin

    result                  := shift_left(resize(value, SUM_WIDTH), STATE_SHIFT);
    result(STATE_SHIFT - 1) := '1';
    return result;

  end function seed_of;

begin

  p_sequence : process (clk) is
  begin

    if rising_edge(clk) then
      valid <= '0';

      if (active = '1') then
        if (address = ENDING) then
          active  <= '0';
          valid   <= '1';
          address <= PARKED;
        else
          address <= (address + 1) mod 64;
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

  busy <= active;

  p_sample : process (clk) is
  begin

    if rising_edge(clk) then
      if (active = '0' and start = '1') then
        sample_is_alpha <= is_alpha;
        sample_is_beta  <= is_beta;
        sample_omega_r  <= omega_r;
        sample_v_dc     <= v_dc;
        applied         <= unsigned(u);
      end if;
    end if;

  end process p_sample;

  ---------------------------------------------------------------------------------------------
  -- Operands
  ---------------------------------------------------------------------------------------------

  a_words(0)  <= as_word(sample_omega_r);
  a_words(1)  <= std_logic_vector(shift_left(resize(unsigned(sample_v_dc), WORD_WIDTH), LINK_SHIFT));
  a_words(2)  <= as_word(sample_is_alpha);
  a_words(3)  <= as_word(sample_is_beta);
  a_words(4)  <= coarse(state(2));
  a_words(5)  <= coarse(state(3));
  a_words(6)  <= coarse(state(0));
  a_words(7)  <= coarse(state(1));
  a_words(8)  <= not coarse(state(1));
  a_words(9)  <= std_logic_vector(innovation(0));
  a_words(10) <= std_logic_vector(innovation(1));
  a_words(11) <= not std_logic_vector(innovation(1));
  a_words(12) <= std_logic_vector(half_of(following(2), state(2)));
  a_words(13) <= std_logic_vector(half_of(following(3), state(3)));
  a_words(14) <= std_logic_vector(step_of(0));
  a_words(15) <= std_logic_vector(step_of(1));

  b_words(0)  <= c_current;
  b_words(1)  <= c_flux;
  b_words(2)  <= c_rotor;
  b_words(3)  <= c_rotor_flux;
  b_words(4)  <= c_drop;
  b_words(5)  <= c_drop_flux;
  b_words(6)  <= c_speed;
  b_words(7)  <= c_voltage_alpha;
  b_words(8)  <= c_voltage_beta;
  b_words(9)  <= c_gain_rotor;
  b_words(10) <= c_gain_stator;
  b_words(11) <= std_logic_vector(angle);

  -- what u takes of the steps: 1/2 or 1/4 of either sign, or nothing
  p_share : process (applied) is

    variable negative_alpha : std_logic;
    variable negative_beta  : std_logic;
    variable whole          : std_logic;
    variable none           : std_logic;
    variable alpha          : word_t;
    variable beta           : word_t;

  begin

    negative_alpha              := to_std_logic(applied = 3 or applied = 4 or applied = 5);
    negative_beta               := to_std_logic(applied = 5 or applied = 6);
    whole                       := to_std_logic(applied = 1 or applied = 4);
    none                        := to_std_logic(applied = 0 or applied = 7);
    alpha                       := (others => negative_alpha);
    alpha(FRACTION - 2 downto 0) := (others => '0');
    alpha(FRACTION - 2)         := not none and not whole;
    alpha(FRACTION - 1)         := not none and (whole or negative_alpha);
    beta                        := (others => negative_beta);
    beta(FRACTION - 1 downto 0) := (others => '0');
    beta(FRACTION - 1)          := not none and not whole;
    b_words(12)                 <= alpha;
    b_words(13)                 <= beta;

  end process p_share;

  g_a : for i in 0 to FACTORS_A - 1 generate
    a_inputs((i + 1) * WORD_WIDTH - 1 downto i * WORD_WIDTH) <= a_words(i);
  end generate g_a;

  g_b : for i in 0 to FACTORS_B - 1 generate
    b_inputs((i + 1) * WORD_WIDTH - 1 downto i * WORD_WIDTH) <= b_words(i);
  end generate g_b;

  ---------------------------------------------------------------------------------------------
  -- Products
  ---------------------------------------------------------------------------------------------

  p_issue : process (address, state, following) is

    variable chosen : sum_t;

  begin

    issue    <= '0';
    gather   <= '0';
    a_choice <= (others => '0');
    b_choice <= (others => '0');
    chosen   := to_signed(2 ** (FRACTION - 1), SUM_WIDTH);

    for i in 0 to STEPS - 1 loop
      if (address = i) then
        issue    <= to_std_logic(PROGRAM(i, 2) > -2);
        gather   <= to_std_logic(PROGRAM(i, 2) = -1);
        a_choice <= std_logic_vector(to_unsigned(PROGRAM(i, 0), a_choice'length));
        b_choice <= std_logic_vector(to_unsigned(PROGRAM(i, 1), b_choice'length));

        case PROGRAM(i, 2) is

          when 1 | 2 =>

            -- less the estimate, as one's complement
            chosen               := resize(signed(not coarse(state(PROGRAM(i, 2) - 1))), SUM_WIDTH);
            chosen               := shift_left(chosen, FRACTION);
            chosen(FRACTION - 1) := '1';

          when 3 | 4 | 5 | 6 =>

            chosen := seed_of(state(PROGRAM(i, 2) - 3));

          when 7 | 8 | 9 | 10 =>

            chosen := seed_of(following(PROGRAM(i, 2) - 7));

          when others =>

            null;

        end case;
      end if;
    end loop;

    seed <= chosen;

  end process p_issue;

  seed_in <= std_logic_vector(seed);

  i_mac : entity work.mac_block
    generic map (
      A_WIDTH           => WORD_WIDTH,
      B_WIDTH           => WORD_WIDTH,
      A_WORDS           => FACTORS_A,
      B_WORDS           => FACTORS_B,
      ALIGNMENT_STEP    => 0,
      ACCUMULATOR_WIDTH => SUM_WIDTH
    )
    port map (
      clk         => clk,
      enable      => issue,
      a_inputs    => a_inputs,
      a_select    => a_choice,
      b_inputs    => b_inputs,
      b_select    => b_choice,
      alignment   => "00",
      accumulate  => gather,
      seed        => seed_in,
      accumulator => total
    );

  p_results : process (clk) is

    variable word_sum  : signed(SUM_WIDTH - FRACTION - 1 downto 0);
    variable state_sum : signed(SUM_WIDTH - STATE_SHIFT - 1 downto 0);
    variable as_one    : std_logic;

  begin

    if rising_edge(clk) then
      word_sum  := signed(total(SUM_WIDTH - 1 downto FRACTION));
      state_sum := signed(total(SUM_WIDTH - 1 downto STATE_SHIFT));
      as_one    := '0';

      if (address = ANGLE_AT) then
        angle  <= clip(word_sum, WORD_WIDTH);
        as_one := overflows(word_sum, WORD_WIDTH);
      end if;

      for i in 0 to 1 loop
        if (address = STEP_AT(i)) then
          step_of(i) <= clip(word_sum, WORD_WIDTH);
          as_one     := overflows(word_sum, WORD_WIDTH);
        end if;

        if (address = INNOVATION_AT(i)) then
          innovation(i) <= clip(word_sum, WORD_WIDTH);
          as_one        := overflows(word_sum, WORD_WIDTH);
        end if;

        if (address = LATCH) then
          innovation(i) <= half_of(following(i), state(i));
        end if;
      end loop;

      for i in 0 to 3 loop
        if (address = FOLLOWING_AT(i)) then
          following(i) <= clip(state_sum, STATE_WIDTH);
          as_one       := overflows(state_sum, STATE_WIDTH);
        end if;

        if (address = STATE_AT(i)) then
          state(i) <= clip(state_sum, STATE_WIDTH);
          as_one   := overflows(state_sum, STATE_WIDTH);
        end if;
      end loop;

      if (active = '0') then
        overflow <= '0';
      elsif (as_one = '1') then
        overflow <= '1';
      end if;

      if (rst = '1') then
        state <= (others => (others => '0'));
      end if;
    end if;

  end process p_results;

  p_output : process (clk) is

    variable alpha : signed(STATE_WIDTH downto 0);
    variable beta  : signed(STATE_WIDTH downto 0);

  begin

    if rising_edge(clk) then
      if (address = ENDING) then
        alpha      := resize(state(2), STATE_WIDTH + 1) + 2 ** (PORT_SHIFT - 1);
        beta       := resize(state(3), STATE_WIDTH + 1) + 2 ** (PORT_SHIFT - 1);
        psis_alpha <= std_logic_vector(clip(alpha(STATE_WIDTH downto PORT_SHIFT), 16));
        psis_beta  <= std_logic_vector(clip(beta(STATE_WIDTH downto PORT_SHIFT), 16));
        saturated  <= overflow;
      end if;
    end if;

  end process p_output;

end architecture rtl;
