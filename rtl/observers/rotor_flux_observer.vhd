-- Rotor-flux observer, so that mpdcc_core needs the stator currents, the speed and the inverter's
-- voltages alone.
--
--   psi_c' = -(1/tau_r - j omega_r) psi_c + xm/tau_r i_s                   current model
--   psi_s' = v - rs i_s + k (xm/xr psi_c + D/xr i_s - psi_s)               voltage model
--   psi_r  = xr/xm psi_s - D/xm i_s
--
-- The current model rules below the frequency k, the voltage model above it.  One step takes the estimate from
-- k-1 to k with what is measured at k and the positions applied between: give it what the core gets, and
-- start the core with valid.  Heun's method for the current model.
--
-- How: two mac_blocks, alpha and beta, follow one program of 13 products.
-- Formats: ports as mpdcc_core's; operands 18 bits, states 12 bits more (model/directmpc/
-- rotor_flux_observer.py, where the fractional bits of each coefficient stand).
-- Latency: valid 15 clocks after start, busy 17; the next start may come when busy has fallen.
-- Overflow: states and words saturate and set saturated; a state that saturates after valid sets the next
-- one.  Nothing wraps.  A reset clears the states.
-- Weighed, not built (figures estimated): one mac_block takes 28 clocks; 8 guard bits instead of 12 make the
-- rounding of a state 5 % of what a step of the slowest drive adds to it.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.anpc5l_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;

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
    saturated        : out   std_logic                      -- '1': a value did not fit its word
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
  constant A_COUNT      : natural := 10;
  constant B_COUNT      : natural := 10;
  constant STEPS        : natural := 14;

  -- addresses at which sums are complete, and others
  constant ANGLE_AT  : natural := 3;
  constant FLUX_AT   : natural := 8;
  constant AHEAD_AT  : natural := 11;
  constant OUTPUT_AT : natural := 13;
  constant STATE_AT  : natural := 16;
  constant PARKED    : natural := 31;

  subtype word_t is std_logic_vector(WORD - 1 downto 0);

  subtype state_t is signed(STATE - 1 downto 0);

  subtype sum_t is signed(SUM - 1 downto 0);

  type words_t is array (0 to 1) of word_t;

  type states_t is array (0 to 1) of state_t;

  type samples_t is array (0 to 1) of signed(15 downto 0);

  type flags_t is array (0 to 1) of std_logic;

  type phases_t is array (0 to 2) of signed(PHASE_WIDTH - 1 downto 0);

  type positions_t is array (0 to 2) of std_logic_vector(2 downto 0);

  type capacitors_t is array (0 to 2) of std_logic_vector(15 downto 0);

  type program_t is array (0 to STEPS - 1, 0 to 3) of integer;

  constant NOTHING : integer := -2;
  constant GATHER  : integer := -1;

  -- operand A, operand B, steps of alignment, seed (or what is done instead of taking one)
  constant PROGRAM : program_t := (
    (0, 0, 0, 0),         -- omega_r * speed: angle
    (1, 1, 2, 1),         -- voltage
    (2, 2, 0, GATHER),    -- mean current * drop
    (3, 5, 1, GATHER),    -- last current * pull_current
    (4, 4, 1, GATHER),    -- psi_c * pull_flux
    (5, 3, 1, GATHER),    -- psi_s * pull: psi_s
    (4, 6, 0, 2),         -- psi_c * decay
    (2, 7, 0, GATHER),    -- mean current * excitation
    (6, 8, 2, GATHER),    -- psi_c of the other axis * angle: psi_c, Euler
    (5, 9, 3, 3),         -- psi_s * output_flux
    (7, 9, 3, GATHER),    -- current * output_current: psi_r
    (0, 0, 0, NOTHING),
    (8, 6, 0, 4),         -- half of the step * decay
    (9, 8, 2, GATHER)     -- half of the other axis's step * angle: psi_c
  );

  signal active      : std_logic;
  signal address     : natural range 0 to PARKED;
  signal current     : samples_t;
  signal previous    : samples_t; -- current at k-1
  signal speed       : std_logic_vector(15 downto 0);
  signal neutral     : signed(15 downto 0);
  signal capacitors  : capacitors_t;
  signal link        : std_logic_vector(15 downto 0);
  signal positions   : positions_t;
  signal phases      : phases_t;
  signal voltage     : words_t;
  signal angle       : word_t;
  signal rotor       : states_t; -- psi_c
  signal stator      : states_t; -- psi_s
  signal ahead       : states_t; -- psi_c, Euler
  signal estimate    : samples_t;
  signal overflow    : std_logic;
  signal clipped     : flags_t;  -- by lane, in this clock
  signal bent        : flags_t;  -- voltage did not fit
  signal turned      : std_logic; -- angle did not fit
  signal issue       : std_logic;
  signal gathering   : std_logic;
  signal aligned     : std_logic_vector(1 downto 0);
  signal a_choice    : std_logic_vector(3 downto 0);
  signal b_choice    : std_logic_vector(3 downto 0);
  signal seed_choice : natural range 0 to 4;
  signal output_step : std_logic;
  signal first_total : std_logic_vector(SUM - 1 downto 0);

  -- a state without its guard bits
  function coarse (value : state_t) return word_t is
  begin

    return std_logic_vector(value(STATE - 1 downto GUARD));

  end function coarse;

  -- half of what a state has moved
  function half_of (value, origin : state_t) return word_t is

    variable moved : signed(STATE downto 0);

  begin

    moved := resize(value, STATE + 1) - resize(origin, STATE + 1);
    return std_logic_vector(moved(STATE downto GUARD + 1));

  end function half_of;

  -- a state as a seed, with the constant that rounds the sum to a state
  function seed_of (value : state_t) return sum_t is

    variable result : sum_t;

  begin

    result                  := shift_left(resize(value, SUM), STATE_SHIFT);
    result(STATE_SHIFT - 1) := '1';
    return result;

  end function seed_of;

  -- a bit of a table of positions
  function has (mask : positions_mask_t; position : std_logic_vector(2 downto 0)) return std_logic is
  begin

    return mask(to_integer(unsigned(position)));

  end function has;

begin

  p_sequence : process (clk) is
  begin

    if rising_edge(clk) then
      valid <= to_std_logic(active = '1' and address = OUTPUT_AT);

      if (active = '1') then
        if (address = STATE_AT) then
          active  <= '0';
          address <= PARKED;
        else
          address <= address + 1;
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
        current(0)    <= signed(is_alpha);
        current(1)    <= signed(is_beta);
        speed         <= omega_r;
        neutral       <= signed(v_n);
        capacitors(0) <= v_ph_a;
        capacitors(1) <= v_ph_b;
        capacitors(2) <= v_ph_c;
        link          <= v_dc;
        positions(0)  <= s_a;
        positions(1)  <= s_b;
        positions(2)  <= s_c;
      end if;

      if (address = STATE_AT) then
        previous <= current;
      end if;

      if (rst = '1') then
        previous <= (others => (others => '0'));
      end if;
    end if;

  end process p_sample;

  ---------------------------------------------------------------------------------------------
  -- Voltages: phases in 1/64012.5 pu, then (2 v_a - v_b - v_c) and (v_b - v_c) in 1/16003.125 pu
  ---------------------------------------------------------------------------------------------

  g_phases : for x in 0 to 2 generate

    p_phase : process (link, neutral, capacitors, positions) is

      variable half      : signed(PHASE_WIDTH - 1 downto 0);
      variable capacitor : signed(PHASE_WIDTH - 1 downto 0);
      variable midpoint  : signed(PHASE_WIDTH - 1 downto 0);

    begin

      half      := signed(resize(unsigned(link) & '0', PHASE_WIDTH));
      capacitor := signed(resize(unsigned(capacitors(x)) & '0', PHASE_WIDTH));
      midpoint  := gated(resize(neutral, PHASE_WIDTH), has(NEUTRAL_VOLTAGE, positions(x)));
      midpoint  := adjusted(midpoint, half, has(LINK_POSITIVE, positions(x)), has(LINK_NEGATIVE, positions(x)));
      phases(x) <= adjusted(midpoint, capacitor, has(CAPACITOR_POSITIVE, positions(x)),
                            has(CAPACITOR_NEGATIVE, positions(x)));

    end process p_phase;

  end generate g_phases;

  p_voltage : process (clk) is

    variable alpha : signed(PHASE_WIDTH + 2 downto 0);
    variable beta  : signed(PHASE_WIDTH + 2 downto 0);

  begin

    if rising_edge(clk) then
      if (address = 0) then
        alpha := shift_left(resize(phases(0), PHASE_WIDTH + 3), 1) - phases(1) - phases(2) + 2;
        beta  := resize(phases(1), PHASE_WIDTH + 3) - phases(2) + 2;

        voltage(0) <= std_logic_vector(clip(alpha(PHASE_WIDTH + 2 downto 2), WORD));
        voltage(1) <= std_logic_vector(clip(beta(PHASE_WIDTH + 2 downto 2), WORD));
        bent(0)    <= overflows(alpha(PHASE_WIDTH + 2 downto 2), WORD);
        bent(1)    <= overflows(beta(PHASE_WIDTH + 2 downto 2), WORD);
      end if;
    end if;

  end process p_voltage;

  ---------------------------------------------------------------------------------------------
  -- Products
  ---------------------------------------------------------------------------------------------

  p_issue : process (address) is
  begin

    issue       <= '0';
    gathering   <= '0';
    aligned     <= "00";
    a_choice    <= (others => '0');
    b_choice    <= (others => '0');
    seed_choice <= 0;

    for i in 0 to STEPS - 1 loop
      if (address = i) then
        issue     <= to_std_logic(PROGRAM(i, 3) /= NOTHING);
        gathering <= to_std_logic(PROGRAM(i, 3) = GATHER);
        aligned   <= std_logic_vector(to_unsigned(PROGRAM(i, 2), 2));
        a_choice  <= std_logic_vector(to_unsigned(PROGRAM(i, 0), 4));
        b_choice  <= std_logic_vector(to_unsigned(PROGRAM(i, 1), 4));

        if (PROGRAM(i, 3) >= 0) then
          seed_choice <= PROGRAM(i, 3);
        end if;
      end if;
    end loop;

    output_step <= to_std_logic(address = 10);

  end process p_issue;

  p_angle : process (clk) is

    variable value : signed(SUM - ANGLE_SHIFT - 1 downto 0);

  begin

    if rising_edge(clk) then
      if (address = ANGLE_AT) then
        value  := signed(first_total(SUM - 1 downto ANGLE_SHIFT));
        angle  <= std_logic_vector(clip(value, WORD));
        turned <= overflows(value, WORD);
      end if;
    end if;

  end process p_angle;

  g_lanes : for x in 0 to 1 generate

    signal a_inputs : std_logic_vector(A_COUNT * WORD - 1 downto 0);
    signal b_inputs : std_logic_vector(B_COUNT * WORD - 1 downto 0);
    signal mean     : signed(16 downto 0);
    signal cross    : word_t;
    signal turning  : word_t;
    signal own_volt : word_t;
    signal last_b   : word_t;
    signal seed     : sum_t;
    signal seed_in  : std_logic_vector(SUM - 1 downto 0);
    signal total    : std_logic_vector(SUM - 1 downto 0);

  begin

    mean <= resize(current(x), 17) + previous(x);

    g_alpha : if x = 0 generate
      cross       <= not coarse(rotor(1));
      turning     <= not half_of(ahead(1), rotor(1));
      own_volt    <= o_voltage_alpha;
      first_total <= total;
    end generate g_alpha;

    g_beta : if x = 1 generate
      cross    <= coarse(rotor(0));
      turning  <= half_of(ahead(0), rotor(0));
      own_volt <= o_voltage_beta;
    end generate g_beta;

    -- the last coefficient serves two products that follow one another
    last_b <= o_output_current when output_step = '1' else
              o_output_flux;

    a_inputs <= turning & half_of(ahead(x), rotor(x)) & std_logic_vector(current(x)) & "00" & cross
                & coarse(stator(x)) & coarse(rotor(x)) & std_logic_vector(previous(x)) & "00"
                & std_logic_vector(mean) & '0' & voltage(x) & speed & "00";
    b_inputs <= last_b & angle & o_excitation & o_decay & o_pull_current & o_pull_flux & o_pull & o_drop
                & own_volt & o_speed;

    p_seed : process (seed_choice, stator, rotor, ahead) is
    begin

      seed <= (others => '0');

      case seed_choice is

        when 1 =>

          seed <= seed_of(stator(x));

        when 2 =>

          seed <= seed_of(rotor(x));

        when 3 =>

          seed(PORT_SHIFT - 1) <= '1';

        when 4 =>

          seed <= seed_of(ahead(x));

        when others =>

          seed(ANGLE_SHIFT - 1) <= '1';

      end case;

    end process p_seed;

    seed_in <= std_logic_vector(seed);

    i_mac : entity work.mac_block
      generic map (
        A_WIDTH           => WORD,
        B_WIDTH           => WORD,
        A_WORDS           => A_COUNT,
        B_WORDS           => B_COUNT,
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
        seed        => seed_in,
        accumulator => total
      );

    p_results : process (clk) is

      variable value  : signed(SUM - STATE_SHIFT - 1 downto 0);
      variable result : signed(SUM - PORT_SHIFT - 1 downto 0);

    begin

      if rising_edge(clk) then
        value  := signed(total(SUM - 1 downto STATE_SHIFT));
        result := signed(total(SUM - 1 downto PORT_SHIFT));

        if (address = FLUX_AT) then
          stator(x) <= clip(value, STATE);
        end if;

        if (address = AHEAD_AT) then
          ahead(x) <= clip(value, STATE);
        end if;

        if (address = STATE_AT) then
          rotor(x) <= clip(value, STATE);
        end if;

        if (address = OUTPUT_AT) then
          estimate(x) <= clip(result, 16);
        end if;

        if (rst = '1') then
          stator(x) <= (others => '0');
          rotor(x)  <= (others => '0');
        end if;
      end if;

    end process p_results;

    p_clipped : process (address, total) is

      variable value  : signed(SUM - STATE_SHIFT - 1 downto 0);
      variable result : signed(SUM - PORT_SHIFT - 1 downto 0);

    begin

      value      := signed(total(SUM - 1 downto STATE_SHIFT));
      result     := signed(total(SUM - 1 downto PORT_SHIFT));
      clipped(x) <= '0';

      if (address = FLUX_AT or address = AHEAD_AT or address = STATE_AT) then
        clipped(x) <= overflows(value, STATE);
      elsif (address = OUTPUT_AT) then
        clipped(x) <= overflows(result, 16);
      end if;

    end process p_clipped;

  end generate g_lanes;

  psir_alpha <= std_logic_vector(estimate(0));
  psir_beta  <= std_logic_vector(estimate(1));

  p_overflow : process (clk) is
  begin

    if rising_edge(clk) then
      if (address = OUTPUT_AT) then
        saturated <= overflow or clipped(0) or clipped(1) or bent(0) or bent(1) or turned;
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
