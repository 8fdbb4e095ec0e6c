-- Capacitor filters: noise of v_n and v_ph taken out by what is known of the charge.
--
--   p(k) = v(k-1) + h dv/dt                dv_n/dt  = -(n(s_a) i_a + n(s_b) i_b + n(s_c) i_c)/(2 xdc)
--   v(k) = p(k) + 2**-q (y(k) - p(k))      dv_ph/dt = c(s) i/xph
--
-- A step takes v_n and the three v_ph from k-1 to k.  It needs the measurements y at k and the positions applied
-- from k-1 to k; i is the mean of the currents at k-1 and k.  q is a parameter, one for v_n and one for v_ph.  With
-- q = 0 the measurement passes unchanged, and so it does in the first step after a reset.
--
-- How: v(k) = v(k-1) + 2**-q (y(k) - v(k-1)) + (1 - 2**-q) h dv/dt.  The factor 1 - 2**-q stands in the coefficients.
-- One mac_block forms the seven products of the charges (model/directmpc/mpdcc/capacitor_program.py), which a
-- mac_sequencer reads.  The four states move around a ring and are corrected one after the other.
-- Formats: ports as those of mpdcc_core, coefficients 17 fractional bits.  A state has 16 bits and 6 more below; a
-- word of v_ph has an offset of half its range inside.  Half an LSB is part of a state, so that its upper bits are
-- the rounded word.  The sign of a current is a complement.
-- Twin: model/directmpc/mpdcc/capacitor_observer.py.
-- Latency: valid 11 clocks after start, busy for 10 clocks; the next start may come when busy has fallen.
-- Overflow: a state that would leave its word stays at the word's end and sets saturated.  Nothing wraps.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.anpc5l_leg.all;
  use work.capacitor_observer_program.all;
  use work.directmpc_math.all;
  use work.guarded_states.all;

entity capacitor_observer is
  port (
    clk              : in    std_logic;                     -- rising edge
    rst              : in    std_logic;                     -- synchronous, active high; clears the states
    start            : in    std_logic;                     -- '1' for one clock: a step; ignored while busy
    -- measurements at k, stable from start until valid
    is_alpha         : in    std_logic_vector(15 downto 0); -- stator current, signed, 1/16000 pu
    is_beta          : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    v_n              : in    std_logic_vector(15 downto 0); -- neutral point potential, signed, 1/64012.5 pu
    v_ph_a           : in    std_logic_vector(15 downto 0); -- phase capacitor voltage, unsigned, 1/32006.25 pu
    v_ph_b           : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    v_ph_c           : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    s_a              : in    std_logic_vector(2 downto 0);  -- position of phase a, 0 to 7
    s_b              : in    std_logic_vector(2 downto 0);  -- position of phase b, 0 to 7
    s_c              : in    std_logic_vector(2 downto 0);  -- position of phase c, 0 to 7
    delayed          : in    std_logic;                     -- '0': applied from k-1 to k; '1': applied from k on
    -- parameters, stable from start until valid; coefficients signed
    f_midpoint_alpha : in    std_logic_vector(15 downto 0); -- -(1 - 2**-q) h/xdc: charge along alpha in v_n
    f_midpoint_beta  : in    std_logic_vector(15 downto 0); -- sqrt(3)/2 of it: charge along beta in v_n
    f_phase_alpha    : in    std_logic_vector(15 downto 0); -- (1 - 2**-q) h/xph: charge along alpha in v_ph
    f_phase_beta     : in    std_logic_vector(15 downto 0); -- sqrt(3)/2 of it: charge along beta in v_ph
    f_q_midpoint     : in    std_logic_vector(2 downto 0);  -- q of v_n, unsigned; 0: no filter
    f_q_phase        : in    std_logic_vector(2 downto 0);  -- q of v_ph, unsigned; 0: no filter
    -- voltages at k, stable from valid until the next start
    valid            : out   std_logic;                     -- '1' for one clock: the voltages are new
    busy             : out   std_logic;                     -- '1': a step is under way
    filtered_n       : out   std_logic_vector(15 downto 0); -- v_n, signed, 1/64012.5 pu
    filtered_a       : out   std_logic_vector(15 downto 0); -- v_ph of phase a, unsigned, 1/32006.25 pu
    filtered_b       : out   std_logic_vector(15 downto 0); -- v_ph of phase b, unsigned, 1/32006.25 pu
    filtered_c       : out   std_logic_vector(15 downto 0); -- v_ph of phase c, unsigned, 1/32006.25 pu
    saturated        : out   std_logic                      -- '1': a voltage did not fit its word
  );
end entity capacitor_observer;

architecture rtl of capacitor_observer is

  constant WORD        : natural := 16;               -- bits of a voltage
  constant GUARD       : natural := 6;                -- bits of a state below a word's LSB
  constant STATE       : natural := WORD + GUARD;
  constant CHARGE      : natural := 17;               -- bits of operand A: a sum of two currents
  constant COEFFICIENT : natural := 16;               -- bits of operand B
  constant SHIFT       : natural := 11;               -- bits of a sum below a state's LSB
  constant SUM         : natural := CHARGE + COEFFICIENT + 1;
  constant B_WORDS     : natural := B_PLACES + 1;     -- the last one is zero: no charge moves
  constant Q_BITS      : natural := 3;
  constant A_BITS      : natural := selector_width(A_PLACES);
  constant B_BITS      : natural := selector_width(B_WORDS);
  constant LAST_LANE   : std_logic_vector(1 downto 0) := "11"; -- of v_n

  subtype state_t is signed(STATE - 1 downto 0);

  type states_t is array (0 to 3) of state_t;

  type samples_t is array (0 to 1) of signed(WORD - 1 downto 0);

  signal active      : std_logic;
  signal due         : std_logic_vector(DUE_EVENTS - 1 downto 0); -- clocks of the program's events
  signal issue       : std_logic;
  signal gathering   : std_logic;
  signal a_choice    : std_logic_vector(A_BITS - 1 downto 0);
  signal b_choice    : std_logic_vector(B_BITS - 1 downto 0);
  signal take        : std_logic; -- a state leaves the ring, corrected
  signal write       : std_logic; -- it comes back, with the charge
  signal begun       : std_logic; -- there are states to predict from
  signal previous    : samples_t; -- current at k-1
  signal before      : positions_t; -- positions given at k-1
  signal positions   : positions_t; -- applied from k-1 to k
  signal charging    : std_logic_vector(2 downto 0); -- a current > 0 charges the capacitor of phase a, b, c
  signal discharging : std_logic_vector(2 downto 0);
  signal neutral     : std_logic_vector(2 downto 0); -- a phase is connected to the midpoint
  signal filters_n   : std_logic; -- v_n is filtered in this step
  signal filters_ph  : std_logic; -- v_ph likewise
  signal current     : signed(WORD - 1 downto 0);     -- along alpha or beta
  signal earlier     : signed(WORD - 1 downto 0);
  signal both        : signed(CHARGE - 1 downto 0);   -- their sum
  signal along_beta  : std_logic; -- operand A: along beta, else along alpha
  signal whole       : std_logic; -- all of the sum along alpha, else half of it
  signal inverted    : std_logic;
  signal moving      : std_logic; -- a charge moves
  signal operand     : std_logic_vector(CHARGE - 1 downto 0);
  signal b_inputs    : std_logic_vector(B_WORDS * COEFFICIENT - 1 downto 0);
  signal b_word      : std_logic_vector(B_BITS - 1 downto 0);
  signal total       : std_logic_vector(SUM - 1 downto 0);
  signal lane        : unsigned(1 downto 0);          -- state at the head of the ring: phase a, b, c, v_n
  signal measured    : std_logic_vector(WORD - 1 downto 0); -- its measurement, signed
  signal q           : std_logic_vector(Q_BITS - 1 downto 0);
  signal ring        : states_t;
  signal innovation  : signed(STATE downto 0);
  signal corrected   : state_t;
  signal clipped     : std_logic;
  signal following   : state_t;                       -- what comes back into the ring

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
      alignment   => open,
      a_select    => a_choice,
      b_select    => b_choice,
      seed_select => open,
      due         => due,
      valid       => valid,
      busy        => active
    );

  busy  <= active;
  take  <= due(DUE_TAKE_PHASE_A) or due(DUE_TAKE_PHASE_B) or due(DUE_TAKE_PHASE_C) or due(DUE_TAKE_MIDPOINT);
  write <= due(DUE_PHASE_A) or due(DUE_PHASE_B) or due(DUE_PHASE_C) or due(DUE_MIDPOINT);

  p_previous : process (clk) is
  begin

    if rising_edge(clk) then
      if (due(DUE_MIDPOINT) = '1') then
        begun       <= '1';
        previous(0) <= signed(is_alpha);
        previous(1) <= signed(is_beta);
        before(0)   <= unsigned(s_a);
        before(1)   <= unsigned(s_b);
        before(2)   <= unsigned(s_c);
      end if;

      if (rst = '1') then
        begun    <= '0';
        previous <= (others => (others => '0'));
        before   <= (others => (others => '0'));
      end if;
    end if;

  end process p_previous;

  filters_n  <= begun and (f_q_midpoint(0) or f_q_midpoint(1) or f_q_midpoint(2));
  filters_ph <= begun and (f_q_phase(0) or f_q_phase(1) or f_q_phase(2));

  ---------------------------------------------------------------------------------------------
  -- Charges: a sum of two currents, by the positions all of it, half of it, negative or nothing
  ---------------------------------------------------------------------------------------------

  positions(0) <= before(0) when delayed = '1' else
                  unsigned(s_a);
  positions(1) <= before(1) when delayed = '1' else
                  unsigned(s_b);
  positions(2) <= before(2) when delayed = '1' else
                  unsigned(s_c);

  g_phases : for x in 0 to 2 generate
    charging(x)    <= has(CAPACITOR_CHARGE, positions(x));
    discharging(x) <= has(CAPACITOR_DISCHARGE, positions(x));
    neutral(x)     <= has(NEUTRAL_CURRENT, positions(x));
  end generate g_phases;

  current <= signed(is_beta) when along_beta = '1' else
             signed(is_alpha);
  earlier <= previous(1) when along_beta = '1' else
             previous(0);
  both    <= resize(current, CHARGE) + earlier;

  p_factor : process (a_choice, charging, discharging, neutral, filters_n, filters_ph) is

    variable moves : std_logic_vector(2 downto 0); -- phases whose capacitor has a current

  begin

    moves      := charging or discharging;
    along_beta <= '0';
    whole      <= '0';

    case to_integer(unsigned(a_choice)) is

      when A_A_ALPHA =>

        whole    <= '1';
        inverted <= discharging(0);
        moving   <= moves(0) and filters_ph;

      when A_B_ALPHA =>

        inverted <= charging(1);
        moving   <= moves(1) and filters_ph;

      when A_B_BETA =>

        along_beta <= '1';
        whole      <= '1';
        inverted   <= discharging(1);
        moving     <= moves(1) and filters_ph;

      when A_C_ALPHA =>

        inverted <= charging(2);
        moving   <= moves(2) and filters_ph;

      when A_C_BETA =>

        along_beta <= '1';
        whole      <= '1';
        inverted   <= charging(2);
        moving     <= moves(2) and filters_ph;

      when A_MIDPOINT_ALPHA =>

        -- 2 n(s_a) - n(s_b) - n(s_c), halves
        whole    <= not (neutral(1) xor neutral(2));
        inverted <= not neutral(0);
        moving   <= ((neutral(0) xor neutral(1)) or (neutral(0) xor neutral(2))) and filters_n;

      when others =>

        -- n(s_b) - n(s_c)
        along_beta <= '1';
        whole      <= '1';
        inverted   <= neutral(2);
        moving     <= (neutral(1) xor neutral(2)) and filters_n;

    end case;

  end process p_factor;

  p_operand : process (both, whole, inverted) is

    variable chosen : signed(CHARGE - 1 downto 0);

  begin

    if (whole = '1') then
      chosen := both;
    else
      chosen := shift_right(both, 1);
    end if;

    for i in chosen'range loop
      operand(i) <= chosen(i) xor inverted;
    end loop;

  end process p_operand;

  b_word <= b_choice when moving = '1' else
            std_logic_vector(to_unsigned(B_PLACES, B_BITS));

  b_inputs((B_MIDPOINT_ALPHA + 1) * COEFFICIENT - 1 downto B_MIDPOINT_ALPHA * COEFFICIENT) <= f_midpoint_alpha;
  b_inputs((B_MIDPOINT_BETA + 1) * COEFFICIENT - 1 downto B_MIDPOINT_BETA * COEFFICIENT)   <= f_midpoint_beta;
  b_inputs((B_PHASE_ALPHA + 1) * COEFFICIENT - 1 downto B_PHASE_ALPHA * COEFFICIENT)       <= f_phase_alpha;
  b_inputs((B_PHASE_BETA + 1) * COEFFICIENT - 1 downto B_PHASE_BETA * COEFFICIENT)         <= f_phase_beta;

  b_inputs(B_WORDS * COEFFICIENT - 1 downto B_PLACES * COEFFICIENT)                        <= (others => '0');

  i_mac : entity work.mac_block
    generic map (
      A_WIDTH           => CHARGE,
      B_WIDTH           => COEFFICIENT,
      A_WORDS           => 1,
      B_WORDS           => B_WORDS,
      ALIGNMENT_STEP    => 0,
      ACCUMULATOR_WIDTH => SUM
    )
    port map (
      clk         => clk,
      enable      => issue,
      a_inputs    => operand,
      a_select    => "0",
      b_inputs    => b_inputs,
      b_select    => b_word,
      alignment   => "00",
      accumulate  => gathering,
      seed        => half_lsb(SUM, SHIFT),
      accumulator => total
    );

  ---------------------------------------------------------------------------------------------
  -- Voltages: the head of the ring is compared with its measurement, corrected, and comes back at
  -- the end of the ring with its charge
  ---------------------------------------------------------------------------------------------

  p_measured : process (lane, v_n, v_ph_a, v_ph_b, v_ph_c) is
  begin

    case lane is

      when "00" =>

        measured <= (not v_ph_a(WORD - 1)) & v_ph_a(WORD - 2 downto 0);

      when "01" =>

        measured <= (not v_ph_b(WORD - 1)) & v_ph_b(WORD - 2 downto 0);

      when "10" =>

        measured <= (not v_ph_c(WORD - 1)) & v_ph_c(WORD - 2 downto 0);

      when others =>

        measured <= v_n;

    end case;

  end process p_measured;

  p_gain : process (lane, begun, f_q_midpoint, f_q_phase) is
  begin

    q <= (others => '0');

    if (begun = '1') then
      if (std_logic_vector(lane) = LAST_LANE) then
        q <= f_q_midpoint;
      else
        q <= f_q_phase;
      end if;
    end if;

  end process p_gain;

  p_ring : process (clk) is

    variable target : state_t;
    variable moved  : signed(STATE downto 0);

  begin

    if rising_edge(clk) then
      target             := (others => '0');
      target(GUARD - 1)  := '1';
      target(STATE - 1 downto GUARD) := signed(measured);
      innovation         <= resize(target, STATE + 1) - ring(0);

      -- between state and measurement, so that it fits
      moved     := ring(0) + shift_right(innovation, to_integer(unsigned(q)));
      corrected <= moved(STATE - 1 downto 0);

      if (take = '1') then
        ring(0) <= ring(1);
        ring(1) <= ring(2);
        ring(2) <= ring(3);
        lane    <= lane + 1;
      end if;

      if (write = '1') then
        ring(3) <= following;
      end if;

      if (rst = '1') then
        ring <= (others => (others => '0'));
        lane <= (others => '0');
      end if;
    end if;

  end process p_ring;

  p_following : process (corrected, total) is

    variable value : signed(STATE + 1 downto 0);

  begin

    value     := resize(corrected, STATE + 2) + signed(total(SUM - 1 downto SHIFT));
    following <= clip(value, STATE);
    clipped   <= overflows(value, STATE);

  end process p_following;

  p_saturated : process (clk) is
  begin

    if rising_edge(clk) then
      if (due(DUE_PHASE_A) = '1') then
        saturated <= clipped;
      elsif (write = '1' and clipped = '1') then
        saturated <= '1';
      end if;
    end if;

  end process p_saturated;

  filtered_a <= (not ring(0)(STATE - 1)) & std_logic_vector(ring(0)(STATE - 2 downto GUARD));
  filtered_b <= (not ring(1)(STATE - 1)) & std_logic_vector(ring(1)(STATE - 2 downto GUARD));
  filtered_c <= (not ring(2)(STATE - 1)) & std_logic_vector(ring(2)(STATE - 2 downto GUARD));
  filtered_n <= std_logic_vector(ring(3)(STATE - 1 downto GUARD));

end architecture rtl;
