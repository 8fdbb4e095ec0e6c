-- Observers of the MPDCC drive: filters of the capacitors' voltages, rotor flux, estimate of the leakage.
--
--   v(k)    = v(k-1) + 2**-q (y(k) - v(k-1)) + (1 - 2**-q) h dv/dt        v_n and each v_ph, filtered
--   psi_c'  = -(1/tau_r - j omega_r) psi_c + xm/tau_r i_s                   current model
--   psi_s'  = v - rs i_s + k (xm/xr psi_c + D/xr i_s - psi_s)               voltage model
--   psi_r   = xr/xm psi_s - D/xm i_s                                        rotor flux
--   phi     = h (xr/D v - j omega_r xm/D psi_r)                             step of the current, predicted
--   theta  <= theta + mu Re(conj(phi) (i(k) - i(k-1) - theta phi))          leakage, within 0.5 and 2
--
-- A step takes all of them from k-1 to k.  It needs the measurements at k and the positions applied from k-1 to k.
-- with_filters, with_flux and with_leakage say with start which parts the step has; the leakage needs the flux.
-- Without its filters v_n and v_ph pass unchanged; with q = 0, and in the first step after forget_filters, too.
-- start with scale multiplies the coefficients of the current's slopes by theta instead.  Where theta is 1, as it is
-- after forget_leakage, they come out as they are.  The first step of the leakage only remembers the current.
--
-- How: one mac_block forms all products.  Its operand A and its first summand come from a register file, a RAM of
-- 16 words.  Coefficients come from a block RAM that is written word by word, at the places that state_observer_program
-- names; a product's place is told a clock ahead.  The RAM outlasts a reset, and what has not been written is unknown.
-- Two mac_sequencers go in step, one for products, one for what happens with sums and words
-- (model/directmpc/mpdcc/state_program.py).  All sums are cut at one bit.  The four voltages move around a ring.  The
-- scaled coefficients move into a chain of words.
-- Formats: ports as those of mpdcc_core.  Operands have 18 bits; the flux's states 12 more, the voltages' 6 more than
-- 16, theta's 10 more than 17.  Fractional bits of coefficients stand with the twins.
-- Twins: model/directmpc/mpdcc/capacitor_observer.py, observer.py, leakage.py.
-- Latency: filters_valid 12 clocks after start.  valid 19 clocks after start, 27 with filters; busy for 36, 44 with
-- filters.  leakage_valid 60 or 68, busy for one less.  busy for 11 where there are filters alone.  A scaling takes
-- 17 clocks.  The next start may come when busy has fallen.
-- Overflow: values saturate and set their part's flag; a state that saturates after valid sets saturated of the next
-- step, a scaled coefficient sets clipped.  A step that would take theta out of its limits leaves it, and is no
-- overflow.  Nothing wraps.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_math.all;
  use work.guarded_states.all;
  use work.mac_programs.all;
  use work.state_observer_program.all;

entity state_observer is
  generic (
    FILTERS : boolean := true; -- true: v_n and v_ph can be filtered
    LEAKAGE : boolean := true  -- true: the leakage can be estimated
  );
  port (
    clk               : in    std_logic;                     -- rising edge
    rst               : in    std_logic;                     -- synchronous, active high; all begins anew
    forget_filters    : in    std_logic;                     -- '1': the filters begin anew; between two steps
    forget_leakage    : in    std_logic;                     -- '1': theta is 1; between two steps
    start             : in    std_logic;                     -- '1' for one clock: step or scaling; ignored while busy
    scale             : in    std_logic;                     -- '1' with start: a scaling; only with LEAKAGE
    -- parts of the step, sampled with start
    with_filters      : in    std_logic;                     -- '1': filters; stable while busy
    with_flux         : in    std_logic;                     -- '1': flux
    with_leakage      : in    std_logic;                     -- '1': leakage
    observed          : in    std_logic;                     -- '1': psir is the estimate, given with valid
    -- measurements at k, stable for 19 clocks from start on, 12 where there are filters alone
    is_alpha          : in    std_logic_vector(15 downto 0); -- stator current, signed, 1/16000 pu
    is_beta           : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    v_n               : in    std_logic_vector(15 downto 0); -- neutral point potential, signed, 1/64012.5 pu
    v_ph_a            : in    std_logic_vector(15 downto 0); -- phase capacitor voltage, unsigned, 1/32006.25 pu
    v_ph_b            : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    v_ph_c            : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    v_dc              : in    std_logic_vector(15 downto 0); -- dc-link voltage, unsigned, 1/16003.125 pu
    omega_r           : in    std_logic_vector(15 downto 0); -- rotor speed, signed, 1/16000 pu
    s_a               : in    std_logic_vector(2 downto 0);  -- position of phase a from k-1 to k, 0 to 7
    s_b               : in    std_logic_vector(2 downto 0);  -- position of phase b from k-1 to k, 0 to 7
    s_c               : in    std_logic_vector(2 downto 0);  -- position of phase c from k-1 to k, 0 to 7
    -- rotor flux for the leakage, likewise; with observed stable from valid on for 3 clocks
    psir_alpha        : in    std_logic_vector(15 downto 0); -- signed, 1/9000 pu
    psir_beta         : in    std_logic_vector(15 downto 0); -- signed, 1/9000 pu
    -- parameters, stable while busy
    f_q_midpoint      : in    std_logic_vector(2 downto 0);  -- q of v_n, unsigned; 0: no filter
    f_q_phase         : in    std_logic_vector(2 downto 0);  -- q of v_ph, unsigned; 0: no filter
    frozen            : in    std_logic;                     -- '1': theta stays
    -- coefficients, while not busy and not with start
    c_write           : in    std_logic;                     -- '1': c_word is stored
    c_place           : in    std_logic_vector(PLACE_BITS - 1 downto 0); -- where, unsigned
    c_word            : in    std_logic_vector(17 downto 0); -- signed; where it has 16 bits, the lower ones
    busy              : out   std_logic;                     -- '1': a step or a scaling is under way
    scaling           : out   std_logic;                     -- '1': a scaling is
    -- voltages at k; with filters new with filters_valid and stable until the next start, else those measured
    filters_valid     : out   std_logic;                     -- '1' for one clock: they are new
    used_n            : out   std_logic_vector(15 downto 0); -- v_n, signed, 1/64012.5 pu
    used_a            : out   std_logic_vector(15 downto 0); -- v_ph of phase a, unsigned, 1/32006.25 pu
    used_b            : out   std_logic_vector(15 downto 0); -- v_ph of phase b, unsigned, 1/32006.25 pu
    used_c            : out   std_logic_vector(15 downto 0); -- v_ph of phase c, unsigned, 1/32006.25 pu
    filters_saturated : out   std_logic;                     -- '1': a voltage did not fit its word
    -- rotor flux at k, stable until the next valid
    valid             : out   std_logic;                     -- '1' for one clock: the estimate is new
    flux_alpha        : out   std_logic_vector(15 downto 0); -- signed, 1/9000 pu
    flux_beta         : out   std_logic_vector(15 downto 0); -- signed, 1/9000 pu
    saturated         : out   std_logic;                     -- '1': a value did not fit its word
    -- leakage at k, stable until the next start
    leakage_valid     : out   std_logic;                     -- '1' for one clock: theta is new
    theta             : out   std_logic_vector(16 downto 0); -- unsigned, 16 fractional bits
    leakage_saturated : out   std_logic;                     -- '1': a word of the step did not hold its value
    -- slopes' coefficients times theta, stable until the next scale; only with LEAKAGE
    scaled            : out   std_logic_vector(STATE_SLOPES * 16 - 1 downto 0); -- signed, word 0 rightmost
    clipped           : out   std_logic                      -- '1': one did not fit its word
  );
end entity state_observer;

architecture rtl of state_observer is

  constant WORD        : natural := 18;                   -- bits of an operand
  constant STATE       : natural := 30;                   -- bits of a word of the register file
  constant GUARD       : natural := STATE - WORD;
  constant PORTS       : natural := 16;                   -- bits of a measurement
  constant CUT         : natural := 13;                   -- bits of a sum below a state
  constant SUM         : natural := STATE_SUM_WIDTH;      -- six products of 45 bits
  constant PHASE_WIDTH : natural := STATE_PHASE_WIDTH;    -- bits of a phase voltage, signed, 1/64012.5 pu
  constant VOLTAGE     : natural := PORTS + 6;            -- bits of a filtered voltage
  constant VOLTAGE_CUT : natural := SUM - 5 - VOLTAGE;    -- bits of a sum below it
  constant A_BITS      : natural := 9;                    -- place of a word, not old, half, complement, source
  constant SOURCE_BITS : natural := selector_width(B_SOURCES);
  constant B_BITS      : natural := 1 + SOURCE_BITS + PLACE_BITS; -- from the memory, source, place
  constant MOVE_BITS   : natural := 6;                    -- what is moved, not joined, observed alone, moves
  constant RATIO_GUARD : natural := 10;                   -- bits of theta's state below its LSB
  constant RATIO       : natural := PORTS + 1 + RATIO_GUARD;
  constant CHANGE      : natural := 2 * PORTS;            -- bits of a product of error and step
  constant FIRST_CLOCK : natural := choose(FILTERS, 0, FLUX_PART);
  constant LAST_CLOCK  : natural := choose(LEAKAGE, SCALING_END, FLUX_END);

  -- clocks of the events, each the last but one of a part; what a build does not have ends with the flux
  constant ENDS : mac_clocks_t(0 to DUE_EVENTS - 1) := (
    DUE_FILTERS => FILTERS_END - 1,
    DUE_FLUX    => FLUX_END - 1,
    DUE_LEAKAGE => choose(LEAKAGE, LEAKAGE_END, FLUX_END) - 1
  );

  subtype word_t is std_logic_vector(WORD - 1 downto 0);

  subtype state_t is signed(STATE - 1 downto 0);

  subtype sum_t is std_logic_vector(SUM - 1 downto 0);

  type factors_t is array (0 to B_SOURCES - 1) of word_t;

  signal active       : std_logic;
  signal entry        : std_logic_vector(1 downto 0);
  signal leaving      : std_logic;                                 -- this clock of the step is its last
  signal estimated    : std_logic;                                 -- and the leakage's part of it ends
  signal begins       : std_logic;                                 -- a step does
  signal due          : std_logic_vector(DUE_EVENTS - 1 downto 0); -- parts end in the next clock
  signal issue        : std_logic;
  signal gathering    : std_logic;
  signal aligned      : std_logic_vector(1 downto 0);
  signal a_choice     : std_logic_vector(A_BITS - 1 downto 0);
  signal b_choice     : std_logic_vector(B_BITS - 1 downto 0);
  signal b_ahead      : std_logic_vector(B_BITS - 1 downto 0);     -- that of the next clock
  signal seeds        : std_logic_vector(SEED_KINDS - 1 downto 0);
  signal target       : std_logic_vector(3 downto 0);              -- word that is written
  signal move         : std_logic_vector(MOVE_BITS - 1 downto 0);
  signal marks        : std_logic_vector(1 downto 0);
  signal takes        : std_logic_vector(TAKERS - 1 downto 0);     -- what happens with the sum
  signal filters_on   : std_logic;                                 -- parts of this step
  signal flux_on      : std_logic;
  signal leakage_on   : std_logic;
  signal observed_on  : std_logic;
  signal turned       : std_logic;                                 -- currents at k and k-1 have changed places
  signal no_current   : std_logic;                                 -- there is no current at k-1
  signal no_flux      : std_logic;                                 -- there is no flux at k-1
  signal read_place   : std_logic_vector(3 downto 0);
  signal write_place  : std_logic_vector(3 downto 0);
  signal write        : std_logic;
  signal moving       : std_logic;                                 -- a word is moved in this clock
  signal joins        : std_logic;                                 -- one that was joined is written
  signal joined_place : std_logic_vector(3 downto 0);
  signal joined_word  : std_logic_vector(STATE - 1 downto 0);
  signal read_word    : std_logic_vector(STATE - 1 downto 0);
  signal flux_word    : std_logic;                                 -- the word read is a state of the flux
  signal known        : std_logic;                                 -- the word read counts, else it is zero
  signal read_state   : state_t;
  signal write_state  : std_logic_vector(STATE - 1 downto 0);
  signal measured     : std_logic_vector(PORTS - 1 downto 0);      -- word that is moved
  signal from_result  : std_logic;
  signal result       : state_t;
  signal voltage_a    : word_t;                                    -- along alpha, from k-1 to k
  signal voltage_b    : word_t;
  signal reading      : std_logic;                                 -- a coefficient is read
  signal kept         : word_t;                                    -- coefficient that is written
  signal stored       : word_t;                                    -- coefficient of this clock
  signal whole        : std_logic;                                 -- operand A: all of the word
  signal inverted     : std_logic;
  signal lowest       : std_logic;                                 -- its lowest bit counts
  signal operand      : word_t;
  signal factor       : word_t;
  signal factors      : factors_t;
  signal sources    : std_logic_vector(B_SOURCES * WORD - 1 downto 0);
  signal source     : std_logic_vector(SOURCE_BITS - 1 downto 0);
  signal from_memory  : std_logic;                                 -- operand B is the coefficient
  signal elsewhere    : word_t;                                    -- what it is otherwise
  signal b_operand    : word_t;
  signal seed         : sum_t;
  signal total        : sum_t;
  signal cut_state    : state_t;                                   -- the sum, cut and saturated
  signal full         : std_logic;                                 -- it did not fit
  signal narrow       : std_logic;                                 -- 16 bits have to hold it
  signal phase        : unsigned(1 downto 0);
  signal phase_1      : unsigned(1 downto 0);
  signal phase_2      : unsigned(1 downto 0);
  signal forms        : std_logic_vector(3 downto 1);
  signal held_a       : std_logic_vector(2 downto 0);                -- positions, a clock later
  signal held_b       : std_logic_vector(2 downto 0);
  signal held_c       : std_logic_vector(2 downto 0);
  signal applied      : std_logic_vector(2 downto 0);                -- position of the phase
  signal charged      : std_logic_vector(1 downto 0);                -- the capacitor counts, positive, negative
  signal storage      : std_logic_vector(PORTS - 1 downto 0);        -- v_ph of the phase, measured or filtered
  signal given_ph     : std_logic_vector(PORTS - 1 downto 0);        -- v_ph of the phase, measured
  signal potential    : std_logic_vector(PORTS - 1 downto 0);        -- v_n, measured or filtered
  signal midpoint     : signed(PHASE_WIDTH - 1 downto 0);            -- without the phase capacitor
  signal phase_value  : signed(PHASE_WIDTH - 1 downto 0);
  signal alpha_sum    : signed(PHASE_WIDTH + 2 downto 0);
  signal beta_sum     : signed(PHASE_WIDTH downto 0);
  signal bent         : std_logic;                                 -- voltage along alpha did not fit
  signal overflow     : std_logic;
  signal flux_taken   : std_logic;                                 -- the sum is one of the flux
  signal charging     : std_logic;                                 -- operand A is a charge
  signal charge_none  : std_logic;                                 -- it is zero
  signal charge_half  : std_logic;
  signal charge_minus : std_logic;
  signal corrected    : signed(VOLTAGE - 1 downto 0);
  signal ratio_state  : unsigned(RATIO - 1 downto 0);              -- theta

  -- a bit of a table of positions
  function has (mask : positions_mask_t; position : std_logic_vector) return std_logic is
  begin

    return mask(to_integer(unsigned(position)));

  end function has;

  -- address of a word
  function placed (place : std_logic_vector; exchanged : std_logic) return std_logic_vector is

    variable address : std_logic_vector(3 downto 0);

  begin

    address    := place;
    address(1) := address(1) xor (exchanged and not address(2) and not address(3));
    return address;

  end function placed;

  -- how many rows of a program are from one clock to another
  function rows_of (listed : mac_program_t; first, last : natural) return natural is

    variable count : natural;

  begin

    count := 0;

    for i in listed'range(1) loop
      if (listed(i, 0) >= first and listed(i, 0) <= last) then
        count := count + 1;
      end if;
    end loop;

    return count;

  end function rows_of;

  -- these rows
  function part (listed : mac_program_t; first, last : natural) return mac_program_t is

    variable rows  : mac_program_t(0 to rows_of(listed, first, last) - 1, 0 to 4);
    variable count : natural;

  begin

    count := 0;

    for i in listed'range(1) loop
      if (listed(i, 0) >= first and listed(i, 0) <= last) then
        for column in 0 to 4 loop
          rows(count, column) := listed(i, column);
        end loop;

        count := count + 1;
      end if;
    end loop;

    return rows;

  end function part;

begin

  ---------------------------------------------------------------------------------------------
  -- Sequence
  ---------------------------------------------------------------------------------------------

  begins   <= start and not active and not entry(1);
  entry(1) <= scale when LEAKAGE else
              '0';
  entry(0) <= not with_filters when FILTERS else
              '1';

  i_products : entity work.mac_sequencer
    generic map (
      MAC_PROGRAM => part(STATE_PRODUCTS, FIRST_CLOCK, LAST_CLOCK),
      EVENTS      => ENDS,
      VALID_AT    => FLUX_END,
      LAST_AT     => LAST_CLOCK,
      A_BITS      => A_BITS,
      B_BITS      => B_BITS,
      SEEDS       => SEED_KINDS,
      SECOND_AT   => FLUX_PART,
      THIRD_AT    => choose(LEAKAGE, SCALING_PART, FLUX_PART),
      IN_RAM      => true
    )
    port map (
      clk         => clk,
      rst         => rst,
      start       => start,
      entry       => entry,
      leave       => leaving,
      enable      => issue,
      accumulate  => gathering,
      alignment   => aligned,
      a_select    => a_choice,
      b_select    => b_choice,
      seed_select => seeds,
      b_ahead     => b_ahead,
      due         => due,
      valid       => open,
      busy        => active
    );

  i_moves : entity work.mac_sequencer
    generic map (
      MAC_PROGRAM => part(STATE_MOVES, FIRST_CLOCK, LAST_CLOCK),
      EVENTS      => ENDS,
      VALID_AT    => FLUX_END,
      LAST_AT     => LAST_CLOCK,
      A_BITS      => target'length,
      B_BITS      => MOVE_BITS,
      SEEDS       => TAKERS,
      SECOND_AT   => FLUX_PART,
      THIRD_AT    => choose(LEAKAGE, SCALING_PART, FLUX_PART),
      IN_RAM      => true
    )
    port map (
      clk         => clk,
      rst         => rst,
      start       => start,
      entry       => entry,
      leave       => leaving,
      enable      => open,
      accumulate  => open,
      alignment   => marks,
      a_select    => target,
      b_select    => move,
      seed_select => takes,
      b_ahead     => open,
      due         => open,
      valid       => open,
      busy        => open
    );

  busy <= active;

  p_parts : process (clk) is
  begin

    if rising_edge(clk) then
      if (begins = '1') then
        filters_on  <= with_filters;
        flux_on     <= with_flux;
        leakage_on  <= with_leakage and to_std_logic(LEAKAGE);
        observed_on <= observed;
      elsif (active = '0') then
        filters_on <= '0';
      end if;

      leaving   <= (due(DUE_FILTERS) and not flux_on) or (due(DUE_FLUX) and not leakage_on) or due(DUE_LEAKAGE);
      estimated <= due(DUE_LEAKAGE);

      if (leaving = '1') then
        turned     <= not turned;
        no_current <= '0';
      end if;

      if (leaving = '1' and flux_on = '1') then
        no_flux <= '0';
      end if;

      filters_valid <= takes(TAKE_LAST_VOLTAGE) and filters_on;
      valid         <= takes(TAKE_FLUX_ALPHA);
      leakage_valid <= estimated and to_std_logic(LEAKAGE);

      if (rst = '1') then
        leaving       <= '0';
        estimated     <= '0';
        filters_on    <= '0';
        turned        <= '0';
        no_current    <= '1';
        no_flux       <= '1';
        filters_valid <= '0';
        valid         <= '0';
        leakage_valid <= '0';
      end if;
    end if;

  end process p_parts;

  ---------------------------------------------------------------------------------------------
  -- Register file.  Currents at k and k-1 change places by one bit of their address.  What is joined to the word read
  -- is written a clock later than what is moved as it is.
  ---------------------------------------------------------------------------------------------

  read_place  <= placed(a_choice(3 downto 0), turned);
  moving      <= move(5) and (observed_on or not move(4));
  write_place <= joined_place when joins = '1' else
                 placed(target xor WRITTEN_FIRST, turned);
  write       <= joins or (moving and move(3));

  i_file : entity work.ram
    generic map (
      ADDRESS_WIDTH => 4,
      WIDTH         => STATE,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write,
      write_address => write_place,
      write_word    => write_state,
      read          => '1',
      read_address  => read_place,
      read_word     => read_word
    );

  -- not a word of a step that never was, nor a current that moves no charge
  known      <= (a_choice(4) or (not no_current and not flux_word) or (not no_flux and flux_word))
                and not charge_none;
  flux_word  <= a_choice(3) or (a_choice(2) and a_choice(1));
  read_state <= gated(signed(read_word), known);

  from_result <= to_std_logic(unsigned(move(2 downto 0)) = MOVE_RESULT);

  p_measured : process (move, is_alpha, is_beta, omega_r, psir_alpha, psir_beta) is
  begin

    case to_integer(unsigned(move(2 downto 0))) is

      when MOVE_IS_ALPHA =>

        measured <= is_alpha;

      when MOVE_IS_BETA =>

        measured <= is_beta;

      when MOVE_OMEGA_R =>

        measured <= omega_r;

      when MOVE_PSIR_ALPHA =>

        measured <= psir_alpha;

      when others =>

        measured <= psir_beta;

    end case;

  end process p_measured;

  write_state <= joined_word when joins = '1' else
                 std_logic_vector(result) when from_result = '1' else
                 std_logic_vector(shift_left(resize(signed(measured), STATE), STATE - PORTS));

  p_join : process (clk) is

    variable current : std_logic_vector(PORTS - 1 downto 0);
    variable addend  : signed(STATE downto 0);
    variable joined  : signed(STATE downto 0);

  begin

    if rising_edge(clk) then
      if (move(0) = '1') then
        current := is_beta;
      else
        current := is_alpha;
      end if;

      -- half of a sum or difference with the word read; a word of 16 bits counts four times in a state's upper bits
      if (from_result = '1') then
        addend := resize(result, STATE + 1);
      else
        addend := shift_left(resize(signed(current), STATE + 1), STATE - PORTS);
      end if;

      joined       := adjusted(addend, resize(read_state, STATE + 1), not from_result, from_result);
      joined_word  <= std_logic_vector(joined(STATE downto 1));
      joined_place <= placed(target xor WRITTEN_FIRST, turned);
      joins        <= begins or (moving and not move(3));
    end if;

  end process p_join;

  ---------------------------------------------------------------------------------------------
  -- Products
  ---------------------------------------------------------------------------------------------

  whole    <= not (a_choice(5) or charge_half);
  inverted <= a_choice(6) or charge_minus;
  lowest   <= whole and not charging;

  -- never both at once: the word that is read need not be told from the one that is written
  reading <= not c_write;

  p_kept : process (c_place, c_word) is
  begin

    kept <= c_word;

    -- coefficients of charges have 16 bits
    if (unsigned(c_place) >= PLACE_F_MIDPOINT_ALPHA and unsigned(c_place) <= PLACE_F_PHASE_BETA) then
      kept(WORD - 1 downto PORTS) <= (others => c_word(PORTS - 1));
    end if;

  end process p_kept;

  i_coefficients : entity work.ram
    generic map (
      ADDRESS_WIDTH => PLACE_BITS,
      WIDTH         => WORD,
      LATENCY       => 1,
      STYLE         => "block"
    )
    port map (
      clk           => clk,
      write         => c_write,
      write_address => c_place,
      write_word    => kept,
      read          => reading,
      read_address  => b_ahead(PLACE_BITS - 1 downto 0),
      read_word     => stored
    );

  p_operand : process (a_choice, read_state, voltage_a, voltage_b, stored, whole, inverted, lowest) is

    variable chosen : signed(WORD - 1 downto 0);
    variable other  : word_t;

  begin

    chosen := read_state(STATE - 1 downto GUARD);

    if (whole = '0') then
      chosen := shift_right(chosen, 1);
    end if;

    for i in 0 to WORD - 1 loop
      chosen(i) := chosen(i) xor inverted;
    end loop;

    chosen(0) := chosen(0) and lowest;

    case a_choice(8 downto 7) is

      when "01" =>

        other := voltage_a;

      when "10" =>

        other := voltage_b;

      when others =>

        other := std_logic_vector(chosen);

    end case;

    -- the coefficient comes late from its memory
    if (a_choice(8 downto 7) = "11") then
      operand <= stored(PORTS - 1 downto 0) & "00";
    else
      operand <= other;
    end if;

  end process p_operand;

  factors(B_FACTOR)        <= factor;
  factors(B_THETA)         <= '0' & std_logic_vector(ratio_state(RATIO - 1 downto RATIO_GUARD));
  factors(B_ZERO)          <= (others => '0');
  factors(B_TWO)           <= std_logic_vector(to_signed(2, WORD));
  factors(B_QUARTER)       <= std_logic_vector(to_signed(2 ** (PORTS - 2), WORD));
  factors(B_MINUS_QUARTER) <= std_logic_vector(to_signed(-(2 ** (PORTS - 2)), WORD));

  g_b : for i in 0 to B_SOURCES - 1 generate
    sources((i + 1) * WORD - 1 downto i * WORD) <= factors(i);
  end generate g_b;

  source    <= b_choice(B_BITS - 2 downto PLACE_BITS);
  elsewhere <= selected(sources, source, WORD);

  p_from_memory : process (clk) is
  begin

    if rising_edge(clk) then
      from_memory <= b_ahead(B_BITS - 1);
    end if;

  end process p_from_memory;

  b_operand <= stored when from_memory = '1' else
               elsewhere;

  p_seed : process (seeds, read_state, corrected) is

    variable value : signed(SUM - 1 downto 0);

  begin

    value := shift_left(resize(gated(read_state, seeds(SEED_STATE)), SUM), CUT);

    if (FILTERS) then
      value(VOLTAGE_CUT + VOLTAGE - 1 downto VOLTAGE_CUT) := value(VOLTAGE_CUT + VOLTAGE - 1 downto VOLTAGE_CUT)
                                                             or gated(corrected, seeds(SEED_CORRECTED));
      for i in VOLTAGE_CUT + VOLTAGE to SUM - 1 loop
        value(i) := value(i) or (corrected(VOLTAGE - 1) and seeds(SEED_CORRECTED));
      end loop;

      value(VOLTAGE_CUT - 1) := value(VOLTAGE_CUT - 1) or seeds(SEED_CORRECTED);
    end if;

    value(CUT - 1)         := seeds(SEED_STATE);
    value(CUT + GUARD - 1) := value(CUT + GUARD - 1) or seeds(SEED_WORD);
    value(CUT + GUARD + 1) := value(CUT + GUARD + 1) or seeds(SEED_PORT);

    seed <= std_logic_vector(value);

  end process p_seed;

  i_mac : entity work.mac_block
    generic map (
      A_WIDTH           => WORD,
      B_WIDTH           => WORD,
      A_WORDS           => 1,
      B_WORDS           => 1,
      ALIGNMENT_STEP    => 3,
      ACCUMULATOR_WIDTH => SUM
    )
    port map (
      clk         => clk,
      enable      => issue,
      a_inputs    => operand,
      a_select    => "0",
      b_inputs    => b_operand,
      b_select    => "0",
      alignment   => aligned,
      accumulate  => gathering,
      seed        => seed,
      accumulator => total
    );

  ---------------------------------------------------------------------------------------------
  -- Sums
  ---------------------------------------------------------------------------------------------

  narrow <= takes(TAKE_STEP) or takes(TAKE_ERROR);

  p_cut : process (total, narrow, takes) is

    variable wide : signed(SUM - CUT - 1 downto 0);
    variable over : std_logic;

  begin

    wide := signed(total(SUM - 1 downto CUT));
    over := overflows(wide, STATE) or (narrow and overflows(wide, STATE - WORD + PORTS));
    full <= over;

    cut_state <= wide(STATE - 1 downto 0);

    if (over = '1') then
      cut_state            <= (others => not wide(SUM - CUT - 1));
      cut_state(STATE - 1) <= wide(SUM - CUT - 1);

      if (narrow = '1') then
        for i in STATE - WORD + PORTS - 1 to STATE - 1 loop
          cut_state(i) <= wide(SUM - CUT - 1);
        end loop;
      end if;
    end if;

    -- a word of 16 bits, four times itself
    if (takes(TAKE_EMF) = '1') then
      cut_state(STATE - PORTS - 1 downto GUARD) <= (others => '0');
    end if;

  end process p_cut;

  flux_taken <= takes(TAKE_STATE) or takes(TAKE_ANGLE) or takes(TAKE_FLUX_BETA) or takes(TAKE_FLUX_ALPHA);

  p_take : process (clk) is
  begin

    if rising_edge(clk) then
      if (takes(TAKE_STATE) = '1' or takes(TAKE_EMF) = '1' or takes(TAKE_STEP) = '1') then
        result <= cut_state;
      end if;

      if (takes(TAKE_ANGLE) = '1' or takes(TAKE_EMF) = '1' or takes(TAKE_ERROR) = '1') then
        factor <= std_logic_vector(cut_state(STATE - 1 downto GUARD));
      end if;

      if (takes(TAKE_FLUX_BETA) = '1') then
        flux_beta <= std_logic_vector(cut_state(STATE - 1 downto STATE - PORTS));
      end if;

      if (takes(TAKE_FLUX_ALPHA) = '1') then
        flux_alpha <= std_logic_vector(cut_state(STATE - 1 downto STATE - PORTS));
        saturated  <= overflow or full or bent;
        overflow   <= '0';
      elsif (flux_taken = '1' and full = '1') then
        overflow <= '1';
      end if;

      if (rst = '1') then
        overflow <= '0';
      end if;
    end if;

  end process p_take;

  ---------------------------------------------------------------------------------------------
  -- Voltages along alpha and beta: phase b, c, a one after the other, in 1/64012.5 pu, then
  -- (2 v_a - v_b - v_c) and (v_b - v_c) in 1/16003.125 pu
  ---------------------------------------------------------------------------------------------

  applied <= held_b when phase = 0 else
             held_c when phase = 1 else
             held_a;

  given_ph <= v_ph_b when phase_1 = 0 else
              v_ph_c when phase_1 = 1 else
              v_ph_a;

  p_phases : process (clk) is

    variable half : signed(PHASE_WIDTH - 1 downto 0);
    variable more : signed(PHASE_WIDTH - 1 downto 0);

  begin

    if rising_edge(clk) then
      held_a  <= s_a;
      held_b  <= s_b;
      held_c  <= s_c;
      forms   <= forms(2 downto 1) & marks(1);
      phase_1 <= phase;
      phase_2 <= phase_1;

      if (active = '0') then
        phase <= (others => '0');
      elsif (marks(1) = '1') then
        phase <= phase + 1;
      end if;

      half     := signed(resize(unsigned(v_dc) & '0', PHASE_WIDTH));
      midpoint <= adjusted(gated(resize(signed(potential), PHASE_WIDTH), has(NEUTRAL_VOLTAGE, applied)), half,
                           has(LINK_POSITIVE, applied), has(LINK_NEGATIVE, applied));
      charged  <= has(CAPACITOR_POSITIVE, applied) & has(CAPACITOR_NEGATIVE, applied);

      more        := signed(resize(unsigned(storage) & '0', PHASE_WIDTH));
      phase_value <= adjusted(midpoint, more, charged(1), charged(0));

      -- two, to round
      if (forms(2) = '1') then
        if (phase_2 = 0) then
          alpha_sum <= to_signed(2, PHASE_WIDTH + 3) - resize(phase_value, PHASE_WIDTH + 3);
          beta_sum  <= to_signed(2, PHASE_WIDTH + 1) + resize(phase_value, PHASE_WIDTH + 1);
        elsif (phase_2 = 1) then
          alpha_sum <= alpha_sum - resize(phase_value, PHASE_WIDTH + 3);
          beta_sum  <= beta_sum - resize(phase_value, PHASE_WIDTH + 1);
        else
          alpha_sum <= alpha_sum + shift_left(resize(phase_value, PHASE_WIDTH + 3), 1);
        end if;
      end if;

      if (forms(3) = '1') then
        voltage_a <= std_logic_vector(clip(alpha_sum(PHASE_WIDTH + 2 downto 2), WORD));
        bent      <= overflows(alpha_sum(PHASE_WIDTH + 2 downto 2), WORD);
      end if;
    end if;

  end process p_phases;

  voltage_b <= std_logic_vector(beta_sum(WORD + 1 downto 2));

  ---------------------------------------------------------------------------------------------
  -- Filters: the head of the ring is compared with its measurement and corrected; it comes back
  -- at the end of the ring with its charge.  Order: v_n, phase b, phase c, phase a.
  ---------------------------------------------------------------------------------------------

  g_filters : if FILTERS generate

    type states_t is array (0 to 3) of signed(VOLTAGE - 1 downto 0);

    type words_t is array (0 to 3) of std_logic_vector(PORTS - 1 downto 0);

    constant BELOW : natural := VOLTAGE - PORTS; -- bits of a state below a word's LSB

    signal begun      : std_logic;                               -- there are states to predict from
    signal ring       : states_t;
    signal words      : words_t;                                 -- the upper bits of the states
    signal lane       : unsigned(1 downto 0);                    -- of the ring's head
    signal turns      : std_logic;
    signal comes_back : std_logic;
    signal present    : std_logic_vector(PORTS - 1 downto 0);    -- its measurement, signed
    signal q          : std_logic_vector(2 downto 0);
    signal innovation : signed(VOLTAGE downto 0);
    signal charge     : unsigned(2 downto 0);                    -- next product
    signal flag       : std_logic;                               -- a voltage did not fit
    signal filters_n  : std_logic;                               -- v_n is filtered in this step
    signal filters_ph : std_logic;

    -- a word with half its range added, or taken away
    function unsigned_of (value : std_logic_vector) return std_logic_vector is
    begin

      return (not value(value'high)) & value(value'high - 1 downto 0);

    end function unsigned_of;

  begin

    filters_n  <= begun and (f_q_midpoint(0) or f_q_midpoint(1) or f_q_midpoint(2));
    filters_ph <= begun and (f_q_phase(0) or f_q_phase(1) or f_q_phase(2));

    -- a clock ahead: share and sign of a charge
    p_charge : process (clk) is

      variable charges    : std_logic_vector(2 downto 0); -- a current > 0 charges the capacitor of phase a, b, c
      variable discharges : std_logic_vector(2 downto 0);
      variable neutral    : std_logic_vector(2 downto 0); -- a phase is connected to the midpoint
      variable moves      : std_logic;
      variable whole_word : std_logic;
      variable minus      : std_logic;

    begin

      if rising_edge(clk) then
        charges    := has(CAPACITOR_CHARGE, s_c) & has(CAPACITOR_CHARGE, s_b) & has(CAPACITOR_CHARGE, s_a);
        discharges := has(CAPACITOR_DISCHARGE, s_c) & has(CAPACITOR_DISCHARGE, s_b) & has(CAPACITOR_DISCHARGE, s_a);
        neutral    := has(NEUTRAL_CURRENT, s_c) & has(NEUTRAL_CURRENT, s_b) & has(NEUTRAL_CURRENT, s_a);

        whole_word := charge(0);

        case to_integer(charge) is

          when 0 =>

            -- 2 n(s_a) - n(s_b) - n(s_c), halves
            whole_word := not (neutral(1) xor neutral(2));
            minus      := not neutral(0);
            moves      := ((neutral(0) xor neutral(1)) or (neutral(0) xor neutral(2))) and filters_n;

          when 1 =>

            -- n(s_b) - n(s_c)
            minus  := neutral(2);
            moves  := (neutral(1) xor neutral(2)) and filters_n;

          when 2 =>

            minus  := charges(1);
            moves  := (charges(1) or discharges(1)) and filters_ph;

          when 3 =>

            minus  := discharges(1);
            moves  := (charges(1) or discharges(1)) and filters_ph;

          when 4 | 5 =>

            minus  := charges(2);
            moves  := (charges(2) or discharges(2)) and filters_ph;

          when others =>

            whole_word := '1';
            minus      := discharges(0);
            moves      := (charges(0) or discharges(0)) and filters_ph;

        end case;

        charging     <= '1';
        charge_none  <= not moves;
        charge_half  <= not whole_word;
        charge_minus <= minus and moves;

        if (filters_on = '0' or charge = 7) then
          charging     <= '0';
          charge_none  <= '0';
          charge_half  <= '0';
          charge_minus <= '0';
        end if;

        if (active = '0') then
          charge <= (others => '0');
        elsif (charge /= 7) then
          charge <= charge + 1;
        end if;
      end if;

    end process p_charge;

    turns      <= marks(0) and filters_on;
    comes_back <= (takes(TAKE_FIRST_VOLTAGE) or takes(TAKE_VOLTAGE) or takes(TAKE_LAST_VOLTAGE)) and filters_on;

    p_present : process (lane, v_n, v_ph_a, v_ph_b, v_ph_c) is
    begin

      case lane is

        when "00" =>

          present <= v_n;

        when "01" =>

          present <= unsigned_of(v_ph_b);

        when "10" =>

          present <= unsigned_of(v_ph_c);

        when others =>

          present <= unsigned_of(v_ph_a);

      end case;

    end process p_present;

    p_gain : process (lane, begun, f_q_midpoint, f_q_phase) is
    begin

      q <= (others => '0');

      if (begun = '1') then
        if (lane = "00") then
          q <= f_q_midpoint;
        else
          q <= f_q_phase;
        end if;
      end if;

    end process p_gain;

    p_ring : process (clk) is

      variable goal  : signed(VOLTAGE - 1 downto 0);
      variable moved : signed(VOLTAGE downto 0);

    begin

      if rising_edge(clk) then
        -- half an LSB is part of a state
        goal            := (others => '0');
        goal(BELOW - 1) := '1';
        goal(VOLTAGE - 1 downto BELOW) := signed(present);
        innovation      <= resize(goal, VOLTAGE + 1) - ring(0);

        -- between state and measurement, so that it fits
        moved     := ring(0) + shift_right(innovation, to_integer(unsigned(q)));
        corrected <= moved(VOLTAGE - 1 downto 0);

        if (turns = '1') then
          ring(0) <= ring(1);
          ring(1) <= ring(2);
          ring(2) <= ring(3);
          lane    <= lane + 1;
        end if;

        if (comes_back = '1') then
          ring(3) <= cut_state(STATE - 1 downto STATE - VOLTAGE);
        end if;

        if (takes(TAKE_LAST_VOLTAGE) = '1') then
          lane <= (others => '0');
        end if;

        if (comes_back = '1') then
          flag <= full or (flag and not takes(TAKE_FIRST_VOLTAGE));
        end if;

        if (takes(TAKE_LAST_VOLTAGE) = '1' and filters_on = '1') then
          begun <= '1';
        end if;

        if (rst = '1' or forget_filters = '1') then
          begun <= '0';
        end if;

        if (rst = '1') then
          ring <= (others => (others => '0'));
          lane <= (others => '0');
        end if;
      end if;

    end process p_ring;

    filters_saturated <= flag;

    g_words : for i in 0 to 3 generate
      words(i) <= std_logic_vector(ring(i)(VOLTAGE - 1 downto BELOW));
    end generate g_words;

    used_n <= words(0) when with_filters = '1' else
              v_n;
    used_b <= unsigned_of(words(1)) when with_filters = '1' else
              v_ph_b;
    used_c <= unsigned_of(words(2)) when with_filters = '1' else
              v_ph_c;
    used_a <= unsigned_of(words(3)) when with_filters = '1' else
              v_ph_a;

    -- the phases begin two clocks before the last voltage is in the ring
    potential <= v_n when with_filters = '0' else
                 words(2) when phase = 0 else
                 words(1);

    storage <= given_ph when with_filters = '0' else
               unsigned_of(words(2)) when phase_1 = 0 else
               unsigned_of(words(3));

  end generate g_filters;

  g_no_filters : if not FILTERS generate
    charging          <= '0';
    charge_none       <= '0';
    charge_half       <= '0';
    charge_minus      <= '0';
    corrected         <= (others => '0');
    filters_saturated <= '0';
    used_n            <= v_n;
    used_a            <= v_ph_a;
    used_b            <= v_ph_b;
    used_c            <= v_ph_c;
    potential         <= v_n;
    storage           <= given_ph;
  end generate g_no_filters;

  ---------------------------------------------------------------------------------------------
  -- Leakage: the sum of a step is the negative of theta's change.  Scaled coefficients join the
  -- chain's upper end.
  ---------------------------------------------------------------------------------------------

  g_leakage : if LEAKAGE generate

    signal begun   : std_logic;                        -- there is a current at k-1
    signal moved   : signed(CHANGE - 1 downto 0);      -- theta with its change
    signal bad     : std_logic;                        -- a word of this step did not hold its value
    signal scales  : std_logic;
    signal clips   : std_logic;
    signal chain   : std_logic_vector(STATE_SLOPES * PORTS - 1 downto 0);

  begin

    moved <= signed(resize(ratio_state, CHANGE)) - signed(total(CHANGE - 1 downto 0));

    p_theta : process (clk) is
    begin

      if rising_edge(clk) then
        if (takes(TAKE_THETA) = '1' and begun = '1' and frozen = '0') then
          -- within 0.5 and 2
          if (moved(CHANGE - 1 downto RATIO) = 0 and moved(RATIO - 1 downto RATIO - 2) /= 0) then
            ratio_state <= unsigned(moved(RATIO - 1 downto 0));
          end if;
        end if;

        if (takes(TAKE_EMF) = '1') then
          bad <= full and begun;
        elsif (narrow = '1') then
          bad <= bad or (full and begun);
        end if;

        if (estimated = '1') then
          begun <= '1';
        end if;

        if (rst = '1' or forget_leakage = '1') then
          begun                  <= '0';
          ratio_state            <= (others => '0');
          ratio_state(RATIO - 1) <= '1';
        end if;
      end if;

    end process p_theta;

    p_scale : process (clk) is
    begin

      if rising_edge(clk) then
        if (active = '0') then
          scales <= start and scale;
        end if;

        if (takes(TAKE_SLOPE) = '1') then
          chain <= std_logic_vector(cut_state(STATE - 1 downto STATE - PORTS))
                   & chain(STATE_SLOPES * PORTS - 1 downto PORTS);
          clips <= clips or full;
        elsif (active = '0' and start = '1' and scale = '1') then
          clips <= '0';
        end if;

        if (rst = '1') then
          scales <= '0';
        end if;
      end if;

    end process p_scale;

    scaling           <= scales;
    scaled            <= chain;
    clipped           <= clips;
    theta             <= std_logic_vector(ratio_state(RATIO - 1 downto RATIO_GUARD));
    leakage_saturated <= bad;

  end generate g_leakage;

  g_no_leakage : if not LEAKAGE generate
    scaling           <= '0';
    ratio_state       <= (others => '0');
    scaled            <= (others => '0');
    theta             <= (PORTS => '1', others => '0');
    leakage_saturated <= '0';
    clipped           <= '0';
  end generate g_no_leakage;

end architecture rtl;
