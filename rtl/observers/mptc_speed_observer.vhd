-- Speed-adaptive observer of stator flux and speed (Paper B, eqs. 8, 9 and 23).  With it a controller needs the
-- stator currents and the dc-link voltage, but neither a measured flux nor a speed sensor.
--
--   dx/dt   = A(omega_r) x + B u + G e,   e = i_s - i_s,est,   G = -[2b; b/(lambda*L_r)]
--   eps     = e_alpha psi_r,beta - e_beta psi_r,alpha
--   omega_r = kp eps + ki (integral of eps)
--
-- One step takes the current and the voltage measured at k and the sequence of vectors applied from k to k+1.  It
-- gives the speed at k first, then the flux at k+1.  So at k: start, take omega_r with speed_valid, and let the core
-- decide with it and with the flux at the outputs, which the step before has left there for k.  Eq. 23 as printed has
-- d omega_r/dt on the left, a misprint: the loop would have two integrators.  w = -lambda*L_m*psi_r is a state, so
-- eps is a cross product of e and w.  model/directmpc/mptc/speed_observer.py is the bit-true twin.
--
-- How: one mac_block follows a program of 37 products (model/directmpc/mptc/speed_observer_program.py), which a
-- mac_sequencer reads.  mptc_mean_share gives the mean voltage of the sequence.
-- Formats: ports and words as in mptc_core (model/directmpc/mptc/formats.py).  A state has 26 bits, 8 more than a
-- word, the integral too, in units of the full scale of the speed.  eps has ERROR_SHIFT fractional bits more than a
-- word: the error of the current is small beside its base.  Halves of steps have no offset: half an LSB would be seen
-- in the speed at a few r/min.
-- Latency: speed_valid 22, valid 48 clocks after start, always.  One multiplier.
-- Overflow: states, words, eps and ports saturate and set saturated; nothing wraps.  So do times above one period, of
-- which u3 has all then.  eps may do so while an estimate begins.  A reset clears the states.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.guarded_states.all;
  use work.mptc_constants.all;
  use work.mptc_speed_observer_program.all;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_speed_observer is
  port (
    clk             : in    std_logic;                                 -- rising edge
    rst             : in    std_logic;                                 -- synchronous, active high; clears the state
    start           : in    std_logic;                                 -- '1' for one clock: a step; ignored while busy
    -- measurements at k, sampled with start
    is_alpha        : in    std_logic_vector(15 downto 0);             -- stator current, signed, current_max/32767
    is_beta         : in    std_logic_vector(15 downto 0);             -- signed, current_max/32767
    v_dc            : in    std_logic_vector(15 downto 0);             -- dc-link voltage, unsigned, vdc/32768
    -- what is applied from k to k+1, sampled with start; a single vector: t1 = 4096
    u1              : in    std_logic_vector(2 downto 0);              -- first vector, 0 to 7
    u2              : in    std_logic_vector(2 downto 0);              -- second vector, 0 to 7
    u3              : in    std_logic_vector(2 downto 0);              -- third vector, 0 to 7
    t1              : in    std_logic_vector(12 downto 0);             -- its time, 1/4096; t1 + t2 at most 4096
    t2              : in    std_logic_vector(12 downto 0);             -- time of the second, 1/4096
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
    c_gain_speed    : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- kp: eps in omega_r
    c_gain_integral : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- ki*T_s: eps in the integral
    -- speed at k, stable until the next speed_valid
    speed_valid     : out   std_logic;                                 -- '1' for one clock: omega_r is new
    omega_r         : out   std_logic_vector(15 downto 0);             -- electrical speed, signed, speed_max/32767
    -- estimate for k+1, stable until the next valid
    valid           : out   std_logic;                                 -- '1' for one clock: the estimate is new
    busy            : out   std_logic;                                 -- '1': a step is under way
    psis_alpha      : out   std_logic_vector(15 downto 0);             -- stator flux, signed, psi_max/32767
    psis_beta       : out   std_logic_vector(15 downto 0);             -- signed, psi_max/32767
    saturated       : out   std_logic                                  -- '1': a value did not fit its word
  );
end entity mptc_speed_observer;

architecture rtl of mptc_speed_observer is

  constant GUARD       : natural := 8; -- bits of a state below a word's LSB
  constant STATE_WIDTH : natural := WORD_WIDTH + GUARD;
  constant STATE_SHIFT : natural := FRACTION - GUARD;
  constant PORT_SHIFT  : natural := GUARD + MEASUREMENT_SHIFT;
  constant PORT_WIDTH  : natural := STATE_WIDTH - PORT_SHIFT;
  constant ERROR_CUT   : natural := FRACTION - ERROR_SHIFT;
  constant A_BITS      : natural := selector_width(A_PLACES);
  constant B_BITS      : natural := selector_width(B_PLACES);

  subtype state_t is signed(STATE_WIDTH - 1 downto 0);

  type words_t is array (natural range <>) of word_t;

  type signed_words_t is array (natural range <>) of signed(WORD_WIDTH - 1 downto 0);

  type sums_t is array (0 to SEED_KINDS - 1) of std_logic_vector(SUM_WIDTH - 1 downto 0);

  type states_t is array (0 to 4) of state_t;

  type events_t is array (0 to 3) of natural;

  -- sums of Euler's step, which are not complete in the order of the states
  constant DUE_FOLLOWING : events_t :=
    (DUE_NEXT_W_ALPHA, DUE_NEXT_W_BETA, DUE_NEXT_PSI_ALPHA, DUE_NEXT_PSI_BETA);

  -- half of what a state has moved: both are cut before they are subtracted, so that half an LSB cancels on average
  function half_step (value, origin : state_t) return word_t is
  begin

    return std_logic_vector(resize(value(STATE_WIDTH - 1 downto GUARD + 1), WORD_WIDTH)
                            - resize(origin(STATE_WIDTH - 1 downto GUARD + 1), WORD_WIDTH));

  end function half_step;

  signal active : std_logic;
  signal due    : std_logic_vector(DUE_EVENTS - 1 downto 0); -- clocks of the program's events

  signal sample_is_alpha : std_logic_vector(15 downto 0);
  signal sample_is_beta  : std_logic_vector(15 downto 0);
  signal sample_v_dc     : std_logic_vector(15 downto 0);
  signal given           : mptc_sequence_t; -- what is applied, as it is on the ports
  signal applied         : mptc_sequence_t; -- as it is used
  signal long            : std_logic;       -- '1': its times are more than the period
  signal mean_alpha      : word_t;
  signal mean_beta       : word_t;

  signal state      : states_t;               -- w alpha, beta, psi_s alpha, beta, integral of the speed
  signal following  : states_t;               -- the first four after Euler's step; the speed at k
  signal innovation : signed_words_t(0 to 1); -- then half of what w has moved in Euler's step
  signal eps        : signed(WORD_WIDTH - 1 downto 0);
  signal angle      : signed(WORD_WIDTH - 1 downto 0);
  signal found      : std_logic;              -- the speed at k is there
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

  given <= (u1, u2, u3, t1, t2);

  p_sample : process (clk) is
  begin

    if rising_edge(clk) then
      if (active = '0' and start = '1') then
        sample_is_alpha <= is_alpha;
        sample_is_beta  <= is_beta;
        sample_v_dc     <= v_dc;
        applied         <= fitted(given);
        long            <= too_long(given);
      end if;
    end if;

  end process p_sample;

  i_mean_share : entity work.mptc_mean_share
    port map (
      clk     => clk,
      running => applied,
      alpha   => mean_alpha,
      beta    => mean_beta
    );

  ---------------------------------------------------------------------------------------------
  -- Operands
  ---------------------------------------------------------------------------------------------

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
  a_words(A_HALF_PSI_ALPHA) <= half_step(following(2), state(2));
  a_words(A_HALF_PSI_BETA)  <= half_step(following(3), state(3));
  a_words(A_STEP_ALPHA)     <= std_logic_vector(step_of(0));
  a_words(A_STEP_BETA)      <= std_logic_vector(step_of(1));
  a_words(A_EPS)            <= std_logic_vector(eps);
  a_words(A_OMEGA)          <= coarse(following(4), GUARD);

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
  b_words(B_GAIN_SPEED)    <= c_gain_speed;
  b_words(B_GAIN_INTEGRAL) <= c_gain_integral;
  b_words(B_ANGLE)         <= std_logic_vector(angle);
  b_words(B_ERROR_ALPHA)   <= std_logic_vector(innovation(0));
  b_words(B_ERROR_BETA)    <= std_logic_vector(innovation(1));
  b_words(B_SHARE_ALPHA)   <= mean_alpha;
  b_words(B_SHARE_BETA)    <= mean_beta;

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
  seeds(SEED_EPS_HALF)  <= half_lsb(SUM_WIDTH, ERROR_CUT);
  seeds(SEED_INTEGRAL)  <= seed_of(state(4), SUM_WIDTH, STATE_SHIFT);

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
    variable error_sum : signed(SUM_WIDTH - ERROR_CUT - 1 downto 0);
    variable as_one    : std_logic;

  begin

    if rising_edge(clk) then
      word_sum  := signed(total(SUM_WIDTH - 1 downto FRACTION));
      state_sum := signed(total(SUM_WIDTH - 1 downto STATE_SHIFT));
      error_sum := signed(total(SUM_WIDTH - 1 downto ERROR_CUT));
      as_one    := '0';

      if (due(DUE_EPS) = '1') then
        eps    <= clip(error_sum, WORD_WIDTH);
        as_one := overflows(error_sum, WORD_WIDTH);
      end if;

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
          innovation(i) <= signed(half_step(following(i), state(i)));
        end if;
      end loop;

      for i in 0 to 3 loop
        if (due(DUE_FOLLOWING(i)) = '1') then
          following(i) <= clip(state_sum, STATE_WIDTH);
          as_one       := overflows(state_sum, STATE_WIDTH);
        end if;

        if (due(DUE_W_ALPHA + i) = '1') then
          state(i) <= clip(state_sum, STATE_WIDTH);
          as_one   := overflows(state_sum, STATE_WIDTH);
        end if;
      end loop;

      if (due(DUE_OMEGA) = '1') then
        following(4) <= clip(state_sum, STATE_WIDTH);
        as_one       := overflows(state_sum, STATE_WIDTH);
      end if;

      if (due(DUE_INTEGRAL) = '1') then
        state(4) <= clip(state_sum, STATE_WIDTH);
        as_one   := overflows(state_sum, STATE_WIDTH);
      end if;

      if (found = '1') then
        as_one := as_one or overflows(rounded(following(4), PORT_SHIFT), PORT_WIDTH);
      end if;

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
      found       <= due(DUE_OMEGA);
      speed_valid <= found;

      if (found = '1') then
        omega_r <= std_logic_vector(clip(rounded(following(4), PORT_SHIFT), PORT_WIDTH));
      end if;

      if (due(DUE_OUTPUT) = '1') then
        psis_alpha <= std_logic_vector(clip(rounded(state(2), PORT_SHIFT), PORT_WIDTH));
        psis_beta  <= std_logic_vector(clip(rounded(state(3), PORT_SHIFT), PORT_WIDTH));
        saturated  <= overflow or long or overflows(rounded(state(2), PORT_SHIFT), PORT_WIDTH)
                      or overflows(rounded(state(3), PORT_SHIFT), PORT_WIDTH);
      end if;

      if (rst = '1') then
        found       <= '0';
        speed_valid <= '0';
      end if;
    end if;

  end process p_output;

end architecture rtl;
