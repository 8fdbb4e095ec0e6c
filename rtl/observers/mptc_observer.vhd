-- Full-order observer of the stator flux (Paper B, eqs. 8 and 9).  With it mptc_core needs the stator currents,
-- the speed and the dc-link voltage, but no measured flux.
--
--   dx/dt = A x + B u + G (i_s - i_s,est),   G = -[2b; b/(lambda*L_r)],   b = -40 1/s by default
--
-- One step takes the estimate from k to k+1 with the current, speed and voltage measured at k and the vector
-- applied from k to k+1.  It is a step of Heun's method; the innovation i_s - i_s,est is held over the step.  The
-- flux at the outputs belongs to k+1: register it, and give it to the core's psis ports at the next start.  The
-- equations in the states w = i_s - lambda*L_r*psi_s and psi_s stand in model/directmpc/mptc/observer.py, the
-- bit-true twin; in these states both rows of G are -b.
--
-- How: one mac_block follows a program of 33 products (model/directmpc/mptc/observer_program.py), which a
-- mac_sequencer reads.
-- Formats: ports and words as in mptc_core (model/directmpc/mptc/formats.py).  A state has 26 bits, 8 more than a
-- word: the innovation adds a few millionths of the state in a step.
-- Latency: valid 39 clocks after start, always.  One multiplier.
-- Overflow: states, words and ports saturate and set saturated; nothing wraps.  A reset clears the state.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.guarded_states.all;
  use work.mptc_constants.all;
  use work.mptc_observer_program.all;
  use work.mptc_vectors.all;

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
  constant PORT_WIDTH  : natural := STATE_WIDTH - PORT_SHIFT;
  constant A_BITS      : natural := selector_width(A_PLACES);
  constant B_BITS      : natural := selector_width(B_PLACES);

  subtype state_t is signed(STATE_WIDTH - 1 downto 0);

  type words_t is array (natural range <>) of word_t;

  type signed_words_t is array (natural range <>) of signed(WORD_WIDTH - 1 downto 0);

  type sums_t is array (0 to SEED_KINDS - 1) of std_logic_vector(SUM_WIDTH - 1 downto 0);

  type states_t is array (0 to 3) of state_t;

  signal active : std_logic;
  signal due    : std_logic_vector(DUE_EVENTS - 1 downto 0); -- clocks of the program's events

  signal sample_is_alpha : std_logic_vector(15 downto 0);
  signal sample_is_beta  : std_logic_vector(15 downto 0);
  signal sample_omega_r  : std_logic_vector(15 downto 0);
  signal sample_v_dc     : std_logic_vector(15 downto 0);
  signal applied         : vector_t;

  signal state      : states_t;               -- w alpha, beta, psi_s alpha, beta
  signal following  : states_t;               -- the same after Euler's step
  signal innovation : signed_words_t(0 to 1); -- then half of what w has moved in Euler's step
  signal angle      : signed(WORD_WIDTH - 1 downto 0);
  signal step_of    : signed_words_t(0 to 1);
  signal overflow   : std_logic;

  signal a_words     : words_t(0 to A_PLACES - 1);
  signal b_words     : words_t(0 to B_PLACES - 1);
  signal a_inputs    : std_logic_vector(A_PLACES * WORD_WIDTH - 1 downto 0);
  signal b_inputs    : std_logic_vector(B_PLACES * WORD_WIDTH - 1 downto 0);
  signal a_choice    : std_logic_vector(A_BITS - 1 downto 0);
  signal b_choice    : std_logic_vector(B_BITS - 1 downto 0);
  signal seed_choice : std_logic_vector(SEED_KINDS - 1 downto 0);
  signal estimate    : signed_words_t(0 to 1); -- one's complement of w
  signal seeds       : sums_t;
  signal seed_inputs : std_logic_vector(SEED_KINDS * SUM_WIDTH - 1 downto 0);
  signal issue       : std_logic;
  signal gather      : std_logic;
  signal aligned     : std_logic_vector(1 downto 0);
  signal seed        : std_logic_vector(SUM_WIDTH - 1 downto 0);
  signal total       : std_logic_vector(SUM_WIDTH - 1 downto 0);

begin

  i_sequencer : entity work.mac_sequencer
    generic map (
      MAC_PROGRAM => OBSERVER_PROGRAM,
      EVENTS      => OBSERVER_EVENTS,
      VALID_AT    => VALID_AT,
      LAST_AT     => LAST_AT,
      A_BITS      => A_BITS,
      B_BITS      => B_BITS,
      SEEDS       => SEED_KINDS
    )
    port map (
      clk         => clk,
      rst         => rst,
      start       => start,
      entry       => "00",
      leave       => '0',
      enable      => issue,
      accumulate  => gather,
      alignment   => aligned,
      a_select    => a_choice,
      b_select    => b_choice,
      seed_select => seed_choice,
      b_ahead     => open,
      due         => due,
      valid       => valid,
      busy        => active
    );

  busy <= active;

  p_sample : process (clk) is
  begin

    if rising_edge(clk) then
      if (active = '0' and start = '1') then
        sample_is_alpha <= is_alpha;
        sample_is_beta  <= is_beta;
        sample_omega_r  <= omega_r;
        sample_v_dc     <= v_dc;
        applied         <= u;
      end if;
    end if;

  end process p_sample;

  ---------------------------------------------------------------------------------------------
  -- Operands
  ---------------------------------------------------------------------------------------------

  a_words(A_OMEGA_R)        <= as_word(sample_omega_r);
  a_words(A_V_DC)           <= link_word(sample_v_dc);
  a_words(A_IS_ALPHA)       <= as_word(sample_is_alpha);
  a_words(A_IS_BETA)        <= as_word(sample_is_beta);
  a_words(A_PSI_ALPHA)      <= coarse(state(2), GUARD);
  a_words(A_PSI_BETA)       <= coarse(state(3), GUARD);
  a_words(A_W_ALPHA)        <= coarse(state(0), GUARD);
  a_words(A_W_BETA)         <= coarse(state(1), GUARD);
  a_words(A_NOT_W_BETA)     <= not coarse(state(1), GUARD);
  a_words(A_E_ALPHA)        <= std_logic_vector(innovation(0));
  a_words(A_E_BETA)         <= std_logic_vector(innovation(1));
  a_words(A_NOT_E_BETA)     <= not std_logic_vector(innovation(1));
  a_words(A_HALF_PSI_ALPHA) <= half_of(following(2), state(2), GUARD);
  a_words(A_HALF_PSI_BETA)  <= half_of(following(3), state(3), GUARD);
  a_words(A_STEP_ALPHA)     <= std_logic_vector(step_of(0));
  a_words(A_STEP_BETA)      <= std_logic_vector(step_of(1));

  b_words(B_CURRENT)       <= c_current;
  b_words(B_FLUX)          <= c_flux;
  b_words(B_ROTOR)         <= c_rotor;
  b_words(B_ROTOR_FLUX)    <= c_rotor_flux;
  b_words(B_DROP)          <= c_drop;
  b_words(B_DROP_FLUX)     <= c_drop_flux;
  b_words(B_SPEED)         <= c_speed;
  b_words(B_VOLTAGE_ALPHA) <= c_voltage_alpha;
  b_words(B_VOLTAGE_BETA)  <= c_voltage_beta;
  b_words(B_GAIN_ROTOR)    <= c_gain_rotor;
  b_words(B_GAIN_STATOR)   <= c_gain_stator;
  b_words(B_ANGLE)         <= std_logic_vector(angle);
  b_words(B_SHARE_ALPHA)   <= share_alpha(applied);
  b_words(B_SHARE_BETA)    <= share_beta(applied);

  g_a : for i in 0 to A_PLACES - 1 generate
    a_inputs((i + 1) * WORD_WIDTH - 1 downto i * WORD_WIDTH) <= a_words(i);
  end generate g_a;

  g_b : for i in 0 to B_PLACES - 1 generate
    b_inputs((i + 1) * WORD_WIDTH - 1 downto i * WORD_WIDTH) <= b_words(i);
  end generate g_b;

  ---------------------------------------------------------------------------------------------
  -- Products
  ---------------------------------------------------------------------------------------------

  seeds(SEED_WORD_HALF) <= half_lsb(SUM_WIDTH, FRACTION);

  -- axes and states that follow one another in the program
  g_axes : for i in 0 to 1 generate
    -- less the estimate, as one's complement
    estimate(i)                  <= signed(not coarse(state(i), GUARD));
    seeds(SEED_LESS_W_ALPHA + i) <= seed_of(estimate(i), SUM_WIDTH, FRACTION);
  end generate g_axes;

  g_states : for i in 0 to 3 generate
    seeds(SEED_W_ALPHA + i)      <= seed_of(state(i), SUM_WIDTH, STATE_SHIFT);
    seeds(SEED_NEXT_W_ALPHA + i) <= seed_of(following(i), SUM_WIDTH, STATE_SHIFT);
  end generate g_states;

  g_seeds : for i in 0 to SEED_KINDS - 1 generate
    seed_inputs((i + 1) * SUM_WIDTH - 1 downto i * SUM_WIDTH) <= seeds(i);
  end generate g_seeds;

  seed <= chosen_word(seed_inputs, seed_choice);

  i_mac : entity work.mac_block
    generic map (
      A_WIDTH           => WORD_WIDTH,
      B_WIDTH           => WORD_WIDTH,
      A_WORDS           => A_PLACES,
      B_WORDS           => B_PLACES,
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
      alignment   => aligned,
      accumulate  => gather,
      seed        => seed,
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

      if (due(DUE_ANGLE) = '1') then
        angle  <= clip(word_sum, WORD_WIDTH);
        as_one := overflows(word_sum, WORD_WIDTH);
      end if;

      for i in 0 to 1 loop
        if (due(DUE_STEP_ALPHA + i) = '1') then
          step_of(i) <= clip(word_sum, WORD_WIDTH);
          as_one     := overflows(word_sum, WORD_WIDTH);
        end if;

        if (due(DUE_E_ALPHA + i) = '1') then
          innovation(i) <= clip(word_sum, WORD_WIDTH);
          as_one        := overflows(word_sum, WORD_WIDTH);
        end if;

        if (due(DUE_HALF_W) = '1') then
          innovation(i) <= signed(half_of(following(i), state(i), GUARD));
        end if;
      end loop;

      for i in 0 to 3 loop
        if (due(DUE_NEXT_W_ALPHA + i) = '1') then
          following(i) <= clip(state_sum, STATE_WIDTH);
          as_one       := overflows(state_sum, STATE_WIDTH);
        end if;

        if (due(DUE_W_ALPHA + i) = '1') then
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
  begin

    if rising_edge(clk) then
      if (due(DUE_OUTPUT) = '1') then
        psis_alpha <= std_logic_vector(clip(rounded(state(2), PORT_SHIFT), PORT_WIDTH));
        psis_beta  <= std_logic_vector(clip(rounded(state(3), PORT_SHIFT), PORT_WIDTH));
        saturated  <= overflow or overflows(rounded(state(2), PORT_SHIFT), PORT_WIDTH)
                      or overflows(rounded(state(3), PORT_SHIFT), PORT_WIDTH);
      end if;
    end if;

  end process p_output;

end architecture rtl;
