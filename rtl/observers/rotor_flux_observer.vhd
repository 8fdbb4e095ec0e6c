-- Rotor-flux observer.  With it mpdcc_core needs the stator currents, the speed and the inverter's voltages,
-- but no measured flux.
--
--   psi_c' = -(1/tau_r - j omega_r) psi_c + xm/tau_r i_s                   current model
--   psi_s' = v - rs i_s + k (xm/xr psi_c + D/xr i_s - psi_s)               voltage model
--   psi_r  = xr/xm psi_s - D/xm i_s                                        estimate
--
-- Below the frequency k the current model decides the estimate, above it the voltage model.  A step takes the
-- estimate from k-1 to k.  It needs the measurements at k and the positions applied from k-1 to k.  Give it the
-- measurements that the core gets, and start the core with valid.  The current model takes a step of Heun's
-- method.
--
-- How: two mac_blocks, one for alpha and one for beta, follow one program of 13 products
-- (model/directmpc/mpdcc/observer_program.py), which a mac_sequencer reads.
-- Formats: ports as those of mpdcc_core.  Operands have 18 bits, states 12 bits more.  The fractional bits of the
-- coefficients stand in model/directmpc/mpdcc/observer.py, which is also the bit-true twin.
-- Latency: valid 15 clocks after start, busy for 17 clocks; the next start may come when busy has fallen.
-- Overflow: states and words saturate and set saturated.  A state that saturates after valid sets saturated of
-- the next step.  Nothing wraps.  A reset clears the states.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.anpc5l_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.guarded_states.all;
  use work.rotor_flux_observer_program.all;

entity rotor_flux_observer is
  port (
    clk              : in    std_logic;                     -- rising edge
    rst              : in    std_logic;                     -- synchronous, active high; clears the states
    start            : in    std_logic;                     -- '1' for one clock: a step; ignored while busy
    -- measurements at k, sampled with start
    is_alpha         : in    std_logic_vector(15 downto 0); -- stator current, signed, 1/16000 pu
    is_beta          : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    v_n              : in    std_logic_vector(15 downto 0); -- neutral point potential, signed, 1/64012.5 pu
    v_ph_a           : in    std_logic_vector(15 downto 0); -- phase capacitor voltage, unsigned, 1/32006.25 pu
    v_ph_b           : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    v_ph_c           : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    v_dc             : in    std_logic_vector(15 downto 0); -- dc-link voltage, unsigned, 1/16003.125 pu
    omega_r          : in    std_logic_vector(15 downto 0); -- rotor speed, signed, 1/16000 pu
    s_a              : in    std_logic_vector(2 downto 0);  -- position of phase a from k-1 to k, 0 to 7
    s_b              : in    std_logic_vector(2 downto 0);  -- position of phase b from k-1 to k, 0 to 7
    s_c              : in    std_logic_vector(2 downto 0);  -- position of phase c from k-1 to k, 0 to 7
    -- parameters, stable from start until busy falls; signed
    o_speed          : in    std_logic_vector(17 downto 0); -- h: speed in the angle of a step
    o_voltage_alpha  : in    std_logic_vector(17 downto 0); -- h/3: 2 v_a - v_b - v_c in psi_s
    o_voltage_beta   : in    std_logic_vector(17 downto 0); -- h/sqrt(3): v_b - v_c in psi_s
    o_drop           : in    std_logic_vector(17 downto 0); -- -h*rs: current in psi_s
    o_pull           : in    std_logic_vector(17 downto 0); -- -h*k: psi_s in psi_s
    o_pull_flux      : in    std_logic_vector(17 downto 0); -- h*k*xm/xr: psi_c in psi_s
    o_pull_current   : in    std_logic_vector(17 downto 0); -- h*k*D/xr: current in psi_s
    o_decay          : in    std_logic_vector(17 downto 0); -- -h/tau_r: psi_c in psi_c
    o_excitation     : in    std_logic_vector(17 downto 0); -- h*xm/tau_r: current in psi_c
    o_output_flux    : in    std_logic_vector(17 downto 0); -- xr/xm: psi_s in psi_r
    o_output_current : in    std_logic_vector(17 downto 0); -- -D/xm: current in psi_r
    -- estimate at k, stable until the next valid
    valid            : out   std_logic;                     -- '1' for one clock: the estimate is new
    busy             : out   std_logic;                     -- '1': a step is under way
    psir_alpha       : out   std_logic_vector(15 downto 0); -- rotor flux, signed, 1/9000 pu
    psir_beta        : out   std_logic_vector(15 downto 0); -- signed, 1/9000 pu
    saturated        : out   std_logic;                     -- '1': a value did not fit its word
    -- from k-1 to k, stable from 5 clocks after start until 4 clocks after the next one
    v_alpha          : out   std_logic_vector(17 downto 0); -- 2 v_a - v_b - v_c, signed, 1/16003.125 pu
    v_beta           : out   std_logic_vector(17 downto 0)  -- v_b - v_c, signed, 1/16003.125 pu
  );
end entity rotor_flux_observer;

architecture rtl of rotor_flux_observer is

  constant WORD         : natural := 18; -- bits of an operand
  constant GUARD        : natural := 12; -- bits of a state below a word's LSB
  constant STATE        : natural := WORD + GUARD;
  constant FINE         : natural := 25; -- fractional bits of the finest products
  constant STATE_SHIFT  : natural := FINE - GUARD;
  constant PORT_SHIFT   : natural := FINE + 2;
  constant ANGLE_SHIFT  : natural := 17;
  constant ALIGNMENT    : natural := 3;  -- bits of left shift a step
  constant SUM          : natural := 48; -- six products of 45 bits
  constant PHASE_WIDTH  : natural := 20; -- bits of a phase voltage, signed, 1/64012.5 pu
  constant A_BITS       : natural := selector_width(A_PLACES);
  constant B_BITS       : natural := selector_width(B_PLACES);

  subtype word_t is std_logic_vector(WORD - 1 downto 0);

  subtype state_t is signed(STATE - 1 downto 0);

  type words_t is array (0 to 1) of word_t;

  type states_t is array (0 to 1) of state_t;

  type a_words_t is array (0 to A_PLACES - 1) of word_t;

  type b_words_t is array (0 to B_PLACES - 1) of word_t;

  type sums_t is array (0 to SEED_KINDS - 1) of std_logic_vector(SUM - 1 downto 0);

  type samples_t is array (0 to 1) of signed(15 downto 0);

  type flags_t is array (0 to 1) of std_logic;

  type phases_t is array (0 to 2) of signed(PHASE_WIDTH - 1 downto 0);

  type capacitors_t is array (0 to 2) of std_logic_vector(15 downto 0);

  signal active      : std_logic;
  signal due         : std_logic_vector(DUE_EVENTS - 1 downto 0); -- clocks of the program's events
  signal current     : samples_t;
  signal previous    : samples_t; -- current at k-1
  signal speed       : std_logic_vector(15 downto 0);
  signal neutral     : signed(15 downto 0);
  signal capacitors  : capacitors_t;
  signal link        : std_logic_vector(15 downto 0);
  signal positions   : positions_t;
  signal phases      : phases_t;
  signal others_sum  : signed(PHASE_WIDTH downto 0);     -- of phases b and c
  signal beta_sum    : signed(PHASE_WIDTH downto 0);     -- of b less c
  signal alpha_sum   : signed(PHASE_WIDTH + 2 downto 0); -- of a twice less b and c
  signal voltage     : words_t;
  signal angle       : word_t;
  signal rotor       : states_t; -- psi_c
  signal stator      : states_t; -- psi_s
  signal ahead       : states_t; -- psi_c, Euler
  signal estimate    : samples_t;
  signal overflow    : std_logic;
  signal clipped     : flags_t;   -- by lane, in this clock
  signal bent        : std_logic; -- voltage along alpha did not fit; the other one always does
  signal turned      : std_logic; -- angle did not fit
  signal issue       : std_logic;
  signal gathering   : std_logic;
  signal aligned     : std_logic_vector(1 downto 0);
  signal a_choice    : std_logic_vector(A_BITS - 1 downto 0);
  signal b_choice    : std_logic_vector(B_BITS - 1 downto 0);
  signal seed_choice : std_logic_vector(SEED_KINDS - 1 downto 0);
  signal first_total : std_logic_vector(SUM - 1 downto 0);

  -- a bit of a table of positions
  function has (mask : positions_mask_t; position : position_t) return std_logic is
  begin

    return mask(to_integer(position));

  end function has;

begin

  i_sequencer : entity work.mac_sequencer
    generic map (
      PROGRAM   => OBSERVER_PROGRAM,
      EVENTS    => OBSERVER_EVENTS,
      VALID_AT  => VALID_AT,
      LAST_AT   => LAST_AT,
      A_BITS    => A_BITS,
      B_BITS    => B_BITS,
      SEEDS     => SEED_KINDS
    )
    port map (
      clk         => clk,
      rst         => rst,
      start       => start,
      enable      => issue,
      accumulate  => gathering,
      alignment   => aligned,
      a_select    => a_choice,
      b_select    => b_choice,
      seed_select => seed_choice,
      due         => due,
      valid       => valid,
      busy        => active
    );

  busy <= active;

  p_sample : process (clk) is
  begin

    if rising_edge(clk) then
      if (active = '0' and start = '1') then
        current(0)    <= signed(is_alpha);
        current(1)    <= signed(is_beta);
        speed         <= omega_r;
        neutral       <= signed(v_n);
        capacitors(0) <= v_ph_a;
        capacitors(1) <= v_ph_b;
        capacitors(2) <= v_ph_c;
        link          <= v_dc;
        positions(0)  <= unsigned(s_a);
        positions(1)  <= unsigned(s_b);
        positions(2)  <= unsigned(s_c);
      end if;

      if (due(DUE_ROTOR) = '1') then
        previous <= current;
      end if;

      if (rst = '1') then
        previous <= (others => (others => '0'));
      end if;
    end if;

  end process p_sample;

  ---------------------------------------------------------------------------------------------
  -- Voltages: phases in 1/64012.5 pu, then (2 v_a - v_b - v_c) and (v_b - v_c) in 1/16003.125 pu.
  -- One addition a clock, from the measurements that stand still for the whole step.
  ---------------------------------------------------------------------------------------------

  g_phases : for x in 0 to 2 generate

    signal midpoint : signed(PHASE_WIDTH - 1 downto 0); -- without the phase capacitor

  begin

    p_phase : process (clk) is

      variable half      : signed(PHASE_WIDTH - 1 downto 0);
      variable capacitor : signed(PHASE_WIDTH - 1 downto 0);

    begin

      if rising_edge(clk) then
        half      := signed(resize(unsigned(link) & '0', PHASE_WIDTH));
        capacitor := signed(resize(unsigned(capacitors(x)) & '0', PHASE_WIDTH));
        midpoint  <= adjusted(gated(resize(neutral, PHASE_WIDTH), has(NEUTRAL_VOLTAGE, positions(x))), half,
                              has(LINK_POSITIVE, positions(x)), has(LINK_NEGATIVE, positions(x)));
        phases(x) <= adjusted(midpoint, capacitor, has(CAPACITOR_POSITIVE, positions(x)),
                              has(CAPACITOR_NEGATIVE, positions(x)));
      end if;

    end process p_phase;

  end generate g_phases;

  p_voltage : process (clk) is

    variable alpha : signed(PHASE_WIDTH + 2 downto 0);
    variable beta  : signed(PHASE_WIDTH downto 0);

  begin

    if rising_edge(clk) then
      others_sum <= resize(phases(1), PHASE_WIDTH + 1) + phases(2);
      beta_sum   <= resize(phases(1), PHASE_WIDTH + 1) - phases(2);

      alpha_sum <= shift_left(resize(phases(0), PHASE_WIDTH + 3), 1) - others_sum;

      if (due(DUE_VOLTAGE) = '1') then
        alpha := alpha_sum + 2;
        beta  := beta_sum + 2;

        voltage(0) <= std_logic_vector(clip(alpha(PHASE_WIDTH + 2 downto 2), WORD));
        voltage(1) <= std_logic_vector(beta(WORD + 1 downto 2));
        bent       <= overflows(alpha(PHASE_WIDTH + 2 downto 2), WORD);
      end if;
    end if;

  end process p_voltage;

  ---------------------------------------------------------------------------------------------
  -- Products
  ---------------------------------------------------------------------------------------------

  p_angle : process (clk) is

    variable value : signed(SUM - ANGLE_SHIFT - 1 downto 0);

  begin

    if rising_edge(clk) then
      if (due(DUE_ANGLE) = '1') then
        value  := signed(first_total(SUM - 1 downto ANGLE_SHIFT));
        angle  <= std_logic_vector(clip(value, WORD));
        turned <= overflows(value, WORD);
      end if;
    end if;

  end process p_angle;

  g_lanes : for x in 0 to 1 generate

    signal a_words  : a_words_t;
    signal b_words  : b_words_t;
    signal a_inputs : std_logic_vector(A_PLACES * WORD - 1 downto 0);
    signal b_inputs : std_logic_vector(B_PLACES * WORD - 1 downto 0);
    signal mean     : signed(16 downto 0);
    signal cross    : word_t;
    signal turning  : word_t;
    signal own_volt : word_t;
    signal seeds    : sums_t;
    signal seed     : std_logic_vector(SUM - 1 downto 0);
    signal total    : std_logic_vector(SUM - 1 downto 0);

  begin

    mean <= resize(current(x), 17) + previous(x);

    g_alpha : if x = 0 generate
      cross       <= not coarse(rotor(1), GUARD);
      turning     <= not half_of(ahead(1), rotor(1), GUARD);
      own_volt    <= o_voltage_alpha;
      first_total <= total;
    end generate g_alpha;

    g_beta : if x = 1 generate
      cross    <= coarse(rotor(0), GUARD);
      turning  <= half_of(ahead(0), rotor(0), GUARD);
      own_volt <= o_voltage_beta;
    end generate g_beta;

    a_words(A_SPEED)    <= speed & "00";
    a_words(A_VOLTAGE)  <= voltage(x);
    a_words(A_MEAN)     <= std_logic_vector(mean) & '0';
    a_words(A_PREVIOUS) <= std_logic_vector(previous(x)) & "00";
    a_words(A_ROTOR)    <= coarse(rotor(x), GUARD);
    a_words(A_STATOR)   <= coarse(stator(x), GUARD);
    a_words(A_CROSS)    <= cross;
    a_words(A_CURRENT)  <= std_logic_vector(current(x)) & "00";
    a_words(A_HALF)     <= half_of(ahead(x), rotor(x), GUARD);
    a_words(A_TURNING)  <= turning;

    b_words(B_SPEED)        <= o_speed;
    b_words(B_VOLTAGE)      <= own_volt;
    b_words(B_DROP)         <= o_drop;
    b_words(B_PULL)         <= o_pull;
    b_words(B_PULL_FLUX)    <= o_pull_flux;
    b_words(B_PULL_CURRENT) <= o_pull_current;
    b_words(B_DECAY)        <= o_decay;
    b_words(B_EXCITATION)   <= o_excitation;
    b_words(B_ANGLE)        <= angle;
    -- one place for both coefficients of the output: their products follow one another
    b_words(B_OUTPUT)       <= o_output_current when due(DUE_OUTPUT_CURRENT) = '1' else
                               o_output_flux;

    g_a : for i in 0 to A_PLACES - 1 generate
      a_inputs((i + 1) * WORD - 1 downto i * WORD) <= a_words(i);
    end generate g_a;

    g_b : for i in 0 to B_PLACES - 1 generate
      b_inputs((i + 1) * WORD - 1 downto i * WORD) <= b_words(i);
    end generate g_b;

    seeds(SEED_ANGLE_HALF) <= half_lsb(SUM, ANGLE_SHIFT);
    seeds(SEED_STATOR)     <= seed_of(stator(x), SUM, STATE_SHIFT);
    seeds(SEED_ROTOR)      <= seed_of(rotor(x), SUM, STATE_SHIFT);
    seeds(SEED_PORT_HALF)  <= half_lsb(SUM, PORT_SHIFT);
    seeds(SEED_AHEAD)      <= seed_of(ahead(x), SUM, STATE_SHIFT);

    p_seed : process (seed_choice, seeds) is
    begin

      seed <= seeds(SEED_ANGLE_HALF);

      for i in SEED_STATOR to SEED_AHEAD loop
        if (seed_choice(i) = '1') then
          seed <= seeds(i);
        end if;
      end loop;

    end process p_seed;

    i_mac : entity work.mac_block
      generic map (
        A_WIDTH           => WORD,
        B_WIDTH           => WORD,
        A_WORDS           => A_PLACES,
        B_WORDS           => B_PLACES,
        ALIGNMENT_STEP    => ALIGNMENT,
        ACCUMULATOR_WIDTH => SUM
      )
      port map (
        clk         => clk,
        enable      => issue,
        a_inputs    => a_inputs,
        a_select    => a_choice,
        b_inputs    => b_inputs,
        b_select    => b_choice,
        alignment   => aligned,
        accumulate  => gathering,
        seed        => seed,
        accumulator => total
      );

    p_results : process (clk) is

      variable value  : signed(SUM - STATE_SHIFT - 1 downto 0);
      variable result : signed(SUM - PORT_SHIFT - 1 downto 0);

    begin

      if rising_edge(clk) then
        value  := signed(total(SUM - 1 downto STATE_SHIFT));
        result := signed(total(SUM - 1 downto PORT_SHIFT));

        if (due(DUE_STATOR) = '1') then
          stator(x) <= clip(value, STATE);
        end if;

        if (due(DUE_AHEAD) = '1') then
          ahead(x) <= clip(value, STATE);
        end if;

        if (due(DUE_ROTOR) = '1') then
          rotor(x) <= clip(value, STATE);
        end if;

        if (due(DUE_ESTIMATE) = '1') then
          estimate(x) <= clip(result, 16);
        end if;

        if (rst = '1') then
          stator(x) <= (others => '0');
          rotor(x)  <= (others => '0');
        end if;
      end if;

    end process p_results;

    p_clipped : process (due, total) is

      variable value  : signed(SUM - STATE_SHIFT - 1 downto 0);
      variable result : signed(SUM - PORT_SHIFT - 1 downto 0);

    begin

      value      := signed(total(SUM - 1 downto STATE_SHIFT));
      result     := signed(total(SUM - 1 downto PORT_SHIFT));
      clipped(x) <= '0';

      if (due(DUE_STATOR) = '1' or due(DUE_AHEAD) = '1' or due(DUE_ROTOR) = '1') then
        clipped(x) <= overflows(value, STATE);
      elsif (due(DUE_ESTIMATE) = '1') then
        clipped(x) <= overflows(result, 16);
      end if;

    end process p_clipped;

  end generate g_lanes;

  psir_alpha <= std_logic_vector(estimate(0));
  psir_beta  <= std_logic_vector(estimate(1));
  v_alpha    <= voltage(0);
  v_beta     <= voltage(1);

  p_overflow : process (clk) is
  begin

    if rising_edge(clk) then
      if (due(DUE_ESTIMATE) = '1') then
        saturated <= overflow or clipped(0) or clipped(1) or bent or turned;
        overflow  <= '0';
      elsif (clipped(0) = '1' or clipped(1) = '1') then
        overflow <= '1';
      end if;

      if (rst = '1') then
        overflow <= '0';
      end if;
    end if;

  end process p_overflow;

end architecture rtl;
