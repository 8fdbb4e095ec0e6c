-- What all nodes of a stage share: drift of the error, charges, level (docs/specification.md, 10.1 and 10.7).
--
-- One multiplier and one sum work through a program, which lies in a block RAM; the words lie in two small
-- files, one for each operand.  The first part of the program forms the angle of a step, the reference and the
-- drift of one step at k, and the first error.  A part for a stage of one step and one for a stage of two turn
-- reference and drift by a step at a time.
-- Formats: as directmpc.kbest.formats has them.
-- Latency: 52 clocks from start to ready of the first stage; from taken to ready 28 for a stage of one step and 35
-- for one of two, up to 14 more where the stage before is taken at once.
-- Overflow: words saturate; saturated says so for one clock.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.kbest_constants.all;
  use work.kbest_types.all;

entity kbest_terms is
  port (
    clk          : in    std_logic;            -- rising edge
    rst          : in    std_logic;            -- synchronous, active high
    start        : in    std_logic;            -- '1' for one clock: begin with the measurements
    is_beta      : in    signed(15 downto 0);  -- current, 1/16000 pu, stable while it runs, as all below
    psir_alpha   : in    signed(15 downto 0);  -- flux, 1/9000 pu
    psir_beta    : in    signed(15 downto 0);  -- the same
    v_dc         : in    unsigned(15 downto 0); -- dc link, 1/16003.125 pu
    iref_alpha   : in    signed(15 downto 0);  -- reference, 1/16000 pu
    iref_beta    : in    signed(15 downto 0);  -- the same
    omega_s      : in    signed(15 downto 0);  -- stator frequency, 1/16000 pu
    omega_r      : in    signed(15 downto 0);  -- rotor speed, the same
    coefficients : in    coefficients_t;       -- of the load
    short        : in    unsigned(3 downto 0); -- stages of one step in an even period, 1 to 8
    odd          : in    std_logic;            -- '1': the period is an odd one
    compensate   : in    std_logic;            -- '1': a stage of one step comes in front of the first
    error_w      : out   error_t;              -- the first error's w
    begun        : out   std_logic;            -- '1' for one clock: error_w is there
    ready        : out   std_logic;            -- '1': the next stage's words are there
    long         : out   std_logic;            -- with ready: '1': that stage lasts two steps
    -- words of the last four stages; an address has a stage's place, its last two bits, and a phase or a linear_t
    node_at      : in    std_logic_vector(3 downto 0); -- place and phase
    node_neutral : out   voltage_t;            -- what the charge of the phase takes from v_n
    node_phase   : out   voltage_t;            -- what it adds to v_ph
    child_at     : in    std_logic_vector(3 downto 0); -- place and phase
    child_neutral : out  voltage_t;            -- what the charge of the phase takes from v_n
    child_phase  : out   voltage_t;            -- what it adds to v_ph
    linear_at    : in    std_logic_vector(3 downto 0); -- place and 1 drift_u, 2 drift_w, 3 level
    linear       : out   factor_t;             -- that word
    taken        : in    std_logic;            -- '1': with ready: go on with the stage behind it
    saturated    : out   std_logic             -- '1': a word has saturated
  );
end entity kbest_terms;

architecture rtl of kbest_terms is

  -- words of operand A; the first eight come in pairs, which change places after a step
  type a_word_t is (
    REF_U, NEXT_U, REF_W, NEXT_W, DRIFT_U, LATER_U, DRIFT_W, LATER_W,
    FLUX_U, FLUX_W, ANGLE_A, SQUARE, HALF_A, HALF_B, SPARE_A, SPARE_B,
    OMEGA_STATOR, OMEGA_ROTOR, REF_ALPHA, REF_BETA, FLUX_ALPHA, FLUX_BETA, LINK, CURRENT_BETA, ONE
  );

  -- words of operand B
  type b_word_t is (
    LESS, HALF_SINE, SINE_U, SINE_W, ACROSS_U, ACROSS_W, STRAIGHT, NONE,
    EIGHTH_1, EIGHTH_2, EIGHTH_3, EIGHTH_4, EIGHTH_6, INVERSE, THIRD_1, SIXTH_1,
    C_ANGLE, C_DECAY, C_FLUX_0, C_FLUX_2, C_FLUX_U, C_FLUX_W, C_LEVEL_1, C_LEVEL_2, C_NEUTRAL, C_CAPACITOR,
    B_ROTOR, B_ONE
  );

  -- where a sum goes: nowhere yet, a word of A, of B, of both, or out
  type goal_t is (NOT_YET, TO_A, TO_B, TO_BOTH, OUTSIDE);

  -- what goes out
  type out_word_t is (
    OUT_ERROR, OUT_DRIFT_U, OUT_DRIFT_W, OUT_LEVEL, OUT_NEUTRAL_A, OUT_NEUTRAL_B, OUT_NEUTRAL_C, OUT_SPARE,
    OUT_PHASE_A, OUT_PHASE_B, OUT_PHASE_C
  );

  type row_t is record
    a     : a_word_t;
    b     : b_word_t;
    plus  : boolean; -- the product is added, else taken off
    first : boolean; -- of a sum
    goal  : goal_t;
    place : natural range 0 to 15; -- number of the word
  end record row_t;

  type program_t is array (natural range <>) of row_t;

  -- ONE and B_ONE are -1, as 1 does not fit: what is taken off with them is added
  constant WORK_STEPS : program_t := (
    (OMEGA_STATOR, C_ANGLE, true, true, TO_BOTH, a_word_t'pos(ANGLE_A)),
    (REF_BETA, INVERSE, true, true, TO_A, a_word_t'pos(REF_W)),
    (FLUX_BETA, INVERSE, true, true, TO_A, a_word_t'pos(FLUX_W)),
    (OMEGA_ROTOR, B_ROTOR, true, true, TO_A, a_word_t'pos(SQUARE)),
    (ANGLE_A, THIRD_1, true, true, TO_B, b_word_t'pos(SINE_W)),
    (ANGLE_A, SIXTH_1, true, true, TO_B, b_word_t'pos(HALF_SINE)),
    (OMEGA_ROTOR, C_FLUX_U, true, true, TO_B, b_word_t'pos(ACROSS_U)),
    (OMEGA_ROTOR, C_FLUX_W, true, true, TO_B, b_word_t'pos(ACROSS_W)),
    (ONE, C_FLUX_0, false, true, NOT_YET, 0),
    (SQUARE, C_FLUX_2, true, false, TO_B, b_word_t'pos(STRAIGHT)),
    (ANGLE_A, HALF_SINE, true, true, TO_B, b_word_t'pos(LESS)),
    (REF_ALPHA, B_ONE, false, true, TO_A, a_word_t'pos(REF_U)),
    (FLUX_ALPHA, B_ONE, false, true, TO_A, a_word_t'pos(FLUX_U)),
    (REF_W, SINE_U, false, true, NOT_YET, 0),
    (FLUX_W, ACROSS_U, true, false, NOT_YET, 0),
    (REF_U, C_DECAY, true, false, NOT_YET, 0),
    (REF_U, LESS, false, false, NOT_YET, 0),
    (FLUX_U, STRAIGHT, false, false, TO_A, a_word_t'pos(DRIFT_U)),
    (REF_W, C_DECAY, true, true, NOT_YET, 0),
    (FLUX_U, ACROSS_W, false, false, NOT_YET, 0),
    (FLUX_W, STRAIGHT, false, false, NOT_YET, 0),
    (REF_U, SINE_W, true, false, NOT_YET, 0),
    (REF_W, LESS, false, false, TO_A, a_word_t'pos(DRIFT_W)),
    (REF_BETA, INVERSE, true, true, NOT_YET, 0),
    (CURRENT_BETA, INVERSE, false, false, OUTSIDE, out_word_t'pos(OUT_ERROR)),
    -- a stage of one step
    (REF_U, B_ONE, false, true, NOT_YET, 0),
    (REF_U, LESS, false, false, NOT_YET, 0),
    (REF_W, SINE_U, false, false, TO_A, a_word_t'pos(NEXT_U)),
    (REF_W, B_ONE, false, true, NOT_YET, 0),
    (REF_W, LESS, false, false, NOT_YET, 0),
    (REF_U, SINE_W, true, false, TO_A, a_word_t'pos(NEXT_W)),
    (LINK, C_LEVEL_1, true, true, OUTSIDE, out_word_t'pos(OUT_LEVEL)),
    (REF_U, EIGHTH_2, true, true, NOT_YET, 0),
    (NEXT_U, EIGHTH_2, true, false, TO_A, a_word_t'pos(HALF_A)),
    (REF_U, EIGHTH_1, false, true, NOT_YET, 0),
    (NEXT_U, EIGHTH_1, false, false, NOT_YET, 0),
    (REF_W, EIGHTH_3, true, false, NOT_YET, 0),
    (NEXT_W, EIGHTH_3, true, false, TO_A, a_word_t'pos(HALF_B)),
    (HALF_A, C_NEUTRAL, true, true, OUTSIDE, out_word_t'pos(OUT_NEUTRAL_A)),
    (HALF_A, C_CAPACITOR, true, true, OUTSIDE, out_word_t'pos(OUT_PHASE_A)),
    (DRIFT_U, B_ONE, false, true, OUTSIDE, out_word_t'pos(OUT_DRIFT_U)),
    (DRIFT_W, B_ONE, false, true, OUTSIDE, out_word_t'pos(OUT_DRIFT_W)),
    (HALF_B, C_NEUTRAL, true, true, OUTSIDE, out_word_t'pos(OUT_NEUTRAL_B)),
    (HALF_B, C_CAPACITOR, true, true, OUTSIDE, out_word_t'pos(OUT_PHASE_B)),
    (HALF_A, C_NEUTRAL, false, true, NOT_YET, 0),
    (HALF_B, C_NEUTRAL, false, false, OUTSIDE, out_word_t'pos(OUT_NEUTRAL_C)),
    (HALF_A, C_CAPACITOR, false, true, NOT_YET, 0),
    (HALF_B, C_CAPACITOR, false, false, OUTSIDE, out_word_t'pos(OUT_PHASE_C)),
    (DRIFT_U, B_ONE, false, true, NOT_YET, 0),
    (DRIFT_U, LESS, false, false, NOT_YET, 0),
    (DRIFT_W, SINE_U, false, false, TO_A, a_word_t'pos(LATER_U)),
    (DRIFT_W, B_ONE, false, true, NOT_YET, 0),
    (DRIFT_W, LESS, false, false, NOT_YET, 0),
    (DRIFT_U, SINE_W, true, false, TO_A, a_word_t'pos(LATER_W)),
    -- a stage of two steps
    (REF_U, B_ONE, false, true, NOT_YET, 0),
    (REF_U, LESS, false, false, NOT_YET, 0),
    (REF_W, SINE_U, false, false, TO_A, a_word_t'pos(NEXT_U)),
    (REF_W, B_ONE, false, true, NOT_YET, 0),
    (REF_W, LESS, false, false, NOT_YET, 0),
    (REF_U, SINE_W, true, false, TO_A, a_word_t'pos(NEXT_W)),
    (NEXT_U, EIGHTH_4, true, true, TO_A, a_word_t'pos(HALF_A)),
    (LINK, C_LEVEL_2, true, true, OUTSIDE, out_word_t'pos(OUT_LEVEL)),
    (NEXT_U, EIGHTH_2, false, true, NOT_YET, 0),
    (NEXT_W, EIGHTH_6, true, false, TO_A, a_word_t'pos(HALF_B)),
    (HALF_A, C_NEUTRAL, true, true, OUTSIDE, out_word_t'pos(OUT_NEUTRAL_A)),
    (HALF_A, C_CAPACITOR, true, true, OUTSIDE, out_word_t'pos(OUT_PHASE_A)),
    (DRIFT_U, B_ONE, false, true, NOT_YET, 0),
    (DRIFT_U, LESS, false, false, NOT_YET, 0),
    (DRIFT_W, SINE_U, false, false, TO_A, a_word_t'pos(LATER_U)),
    (HALF_B, C_NEUTRAL, true, true, OUTSIDE, out_word_t'pos(OUT_NEUTRAL_B)),
    (HALF_B, C_CAPACITOR, true, true, OUTSIDE, out_word_t'pos(OUT_PHASE_B)),
    (DRIFT_W, B_ONE, false, true, NOT_YET, 0),
    (DRIFT_W, LESS, false, false, NOT_YET, 0),
    (DRIFT_U, SINE_W, true, false, TO_A, a_word_t'pos(LATER_W)),
    (DRIFT_U, B_ONE, false, true, NOT_YET, 0),
    (LATER_U, B_ONE, false, false, NOT_YET, 0),
    (DRIFT_U, C_DECAY, false, false, OUTSIDE, out_word_t'pos(OUT_DRIFT_U)),
    (DRIFT_W, B_ONE, false, true, NOT_YET, 0),
    (LATER_W, B_ONE, false, false, NOT_YET, 0),
    (DRIFT_W, C_DECAY, false, false, OUTSIDE, out_word_t'pos(OUT_DRIFT_W)),
    (HALF_A, C_NEUTRAL, false, true, NOT_YET, 0),
    (HALF_B, C_NEUTRAL, false, false, OUTSIDE, out_word_t'pos(OUT_NEUTRAL_C)),
    (HALF_A, C_CAPACITOR, false, true, NOT_YET, 0),
    (HALF_B, C_CAPACITOR, false, false, OUTSIDE, out_word_t'pos(OUT_PHASE_C)),
    -- its second step, where the pairs have changed places
    (REF_U, B_ONE, false, true, NOT_YET, 0),
    (REF_U, LESS, false, false, NOT_YET, 0),
    (REF_W, SINE_U, false, false, TO_A, a_word_t'pos(NEXT_U)),
    (REF_W, B_ONE, false, true, NOT_YET, 0),
    (REF_W, LESS, false, false, NOT_YET, 0),
    (REF_U, SINE_W, true, false, TO_A, a_word_t'pos(NEXT_W)),
    (DRIFT_U, B_ONE, false, true, NOT_YET, 0),
    (DRIFT_U, LESS, false, false, NOT_YET, 0),
    (DRIFT_W, SINE_U, false, false, TO_A, a_word_t'pos(LATER_U)),
    (DRIFT_W, B_ONE, false, true, NOT_YET, 0),
    (DRIFT_W, LESS, false, false, NOT_YET, 0),
    (DRIFT_U, SINE_W, true, false, TO_A, a_word_t'pos(LATER_W))
  );

  constant SHORT_FROM : natural := 25; -- first row of a stage of one step
  constant LONG_FROM  : natural := 54; -- of a stage of two
  constant TURN_FROM  : natural := 84; -- of its second step
  constant ALL_ROWS   : natural := WORK_STEPS'length;

  constant ROW_WIDTH : natural := 19;

  -- a row as bits: A, B, place of the goal, minus, gather, to A, to B, out
  function bits_of (row : row_t) return std_logic_vector is

    variable result : std_logic_vector(ROW_WIDTH - 1 downto 0);

  begin

    result(4 downto 0)   := std_logic_vector(to_unsigned(a_word_t'pos(row.a), 5));
    result(9 downto 5)   := std_logic_vector(to_unsigned(b_word_t'pos(row.b), 5));
    result(13 downto 10) := std_logic_vector(to_unsigned(row.place, 4));
    result(14)           := to_std_logic(not row.plus);
    result(15)           := to_std_logic(not row.first);
    result(16)           := to_std_logic(row.goal = TO_A or row.goal = TO_BOTH);
    result(17)           := to_std_logic(row.goal = TO_B or row.goal = TO_BOTH);
    result(18)           := to_std_logic(row.goal = OUTSIDE);
    return result;

  end function bits_of;

  function rows_of return std_logic_vector is

    variable result : std_logic_vector(128 * ROW_WIDTH - 1 downto 0);

  begin

    result := (others => '0');

    for i in WORK_STEPS'range loop
      result((i + 1) * ROW_WIDTH - 1 downto i * ROW_WIDTH) := bits_of(WORK_STEPS(i));
    end loop;

    return result;

  end function rows_of;

  constant ROWS : std_logic_vector(128 * ROW_WIDTH - 1 downto 0) := rows_of;

  constant SUM_WIDTH : natural := 38; -- six products, the greatest of them
  constant HALF      : signed(SUM_WIDTH - 1 downto 0) := to_signed(2 ** (FRACTION - 1), SUM_WIDTH);
  constant WHOLE     : factor_t := to_signed(-2 ** FRACTION, FACTOR_WIDTH);

  -- what belongs to a row on its way
  type tag_t is record
    valid   : std_logic;
    minus   : std_logic;
    gather  : std_logic;
    to_a    : std_logic;
    to_b    : std_logic;
    outside : std_logic;
    place   : unsigned(3 downto 0);
  end record tag_t;

  type tags_t is array (1 to 3) of tag_t;

  signal counter : unsigned(6 downto 0);
  signal running : std_logic;
  signal ordered : std_logic;            -- '1': the next stage is wanted
  signal place   : unsigned(5 downto 0); -- stage that is computed, one more than its index
  signal odd_n   : unsigned(0 downto 0);
  signal long_i  : std_logic; -- '1': the stage that is computed lasts two steps
  signal flip    : std_logic;            -- '1': the pairs of A have changed places
  signal row     : std_logic_vector(ROW_WIDTH - 1 downto 0);
  signal issued  : std_logic;            -- '1': a row is read
  signal ends    : std_logic;            -- '1': it is the last one of a step
  signal valid   : std_logic;            -- of row
  signal turned  : std_logic;            -- '1': row is the last one of a step
  signal a_place : std_logic_vector(3 downto 0);
  signal goal    : unsigned(3 downto 0);
  signal a_word  : std_logic_vector(FACTOR_WIDTH - 1 downto 0);
  signal b_word  : std_logic_vector(FACTOR_WIDTH - 1 downto 0);
  signal a       : factor_t;
  signal b       : factor_t;
  signal product : signed(2 * FACTOR_WIDTH - 1 downto 0);
  signal sum     : signed(SUM_WIDTH - 1 downto 0);
  signal result  : signed(SUM_WIDTH - FRACTION - 1 downto 0);
  signal word    : std_logic_vector(FACTOR_WIDTH - 1 downto 0);
  signal tags    : tags_t;
  signal write_a : std_logic;
  signal write_b : std_logic;
  signal charge  : signed(SUM_WIDTH - FRACTION downto 0);
  signal amount  : std_logic_vector(VOLTAGE_WIDTH - 1 downto 0);
  signal leaving : std_logic;
  signal out_at  : std_logic_vector(3 downto 0);
  signal write_linear  : std_logic;
  signal write_neutral : std_logic;
  signal write_phase   : std_logic;
  signal linear_word        : std_logic_vector(FACTOR_WIDTH - 1 downto 0);
  signal node_neutral_word  : std_logic_vector(VOLTAGE_WIDTH - 1 downto 0);
  signal node_phase_word    : std_logic_vector(VOLTAGE_WIDTH - 1 downto 0);
  signal child_neutral_word : std_logic_vector(VOLTAGE_WIDTH - 1 downto 0);
  signal child_phase_word   : std_logic_vector(VOLTAGE_WIDTH - 1 downto 0);
  signal ready_i : std_logic;

begin

  odd_n(0) <= odd;

  i_rows : entity work.ram
    generic map (
      ADDRESS_WIDTH => 7,
      WIDTH         => ROW_WIDTH,
      LATENCY       => 2,
      STYLE         => "block",
      CONTENTS      => ROWS
    )
    port map (
      clk           => clk,
      write         => '0',
      write_address => (others => '0'),
      write_word    => (others => '0'),
      read          => '1',
      read_address  => std_logic_vector(counter),
      read_word     => row
    );

  -- the first eight words of A come in pairs
  a_place <= row(3 downto 1) & (row(0) xor (flip and not row(3)));
  goal    <= unsigned(row(13 downto 11)) & (row(10) xor (flip and row(16) and not row(13)));

  i_a : entity work.ram
    generic map (
      ADDRESS_WIDTH => 4,
      WIDTH         => FACTOR_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write_a,
      write_address => std_logic_vector(tags(3).place),
      write_word    => word,
      read          => '1',
      read_address  => a_place,
      read_word     => a_word
    );

  i_b : entity work.ram
    generic map (
      ADDRESS_WIDTH => 3,
      WIDTH         => FACTOR_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write_b,
      write_address => std_logic_vector(tags(3).place(2 downto 0)),
      write_word    => word,
      read          => '1',
      read_address  => row(7 downto 5),
      read_word     => b_word
    );

  result  <= sum(SUM_WIDTH - 1 downto FRACTION);
  word    <= std_logic_vector(clip(result, FACTOR_WIDTH));
  write_a <= tags(3).valid and tags(3).to_a;
  write_b <= tags(3).valid and tags(3).to_b;

  -- what goes out: the upper two bits of the place tell neutral, phase and linear apart
  charge <= shift_left(resize(result, charge'length), 1) when long_i = '1' else
            resize(result, charge'length);
  amount <= std_logic_vector(clip(charge, VOLTAGE_WIDTH));

  leaving       <= tags(3).valid and tags(3).outside;
  write_linear  <= leaving and to_std_logic(tags(3).place(3 downto 2) = "00");
  write_neutral <= leaving and to_std_logic(tags(3).place(3 downto 2) = "01");
  write_phase   <= leaving and tags(3).place(3);
  out_at        <= std_logic_vector(place(1 downto 0)) & std_logic_vector(tags(3).place(1 downto 0));

  i_linear : entity work.ram
    generic map (
      ADDRESS_WIDTH => 4,
      WIDTH         => FACTOR_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write_linear,
      write_address => out_at,
      write_word    => word,
      read          => '1',
      read_address  => linear_at,
      read_word     => linear_word
    );

  i_node_neutral : entity work.ram
    generic map (
      ADDRESS_WIDTH => 4,
      WIDTH         => VOLTAGE_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write_neutral,
      write_address => out_at,
      write_word    => amount,
      read          => '1',
      read_address  => node_at,
      read_word     => node_neutral_word
    );

  i_node_phase : entity work.ram
    generic map (
      ADDRESS_WIDTH => 4,
      WIDTH         => VOLTAGE_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write_phase,
      write_address => out_at,
      write_word    => amount,
      read          => '1',
      read_address  => node_at,
      read_word     => node_phase_word
    );

  i_child_neutral : entity work.ram
    generic map (
      ADDRESS_WIDTH => 4,
      WIDTH         => VOLTAGE_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write_neutral,
      write_address => out_at,
      write_word    => amount,
      read          => '1',
      read_address  => child_at,
      read_word     => child_neutral_word
    );

  i_child_phase : entity work.ram
    generic map (
      ADDRESS_WIDTH => 4,
      WIDTH         => VOLTAGE_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write_phase,
      write_address => out_at,
      write_word    => amount,
      read          => '1',
      read_address  => child_at,
      read_word     => child_phase_word
    );

  p_run : process (clk) is

    variable addend    : signed(SUM_WIDTH - 1 downto 0);
    variable following : unsigned(5 downto 0);

  begin

    if rising_edge(clk) then
      saturated <= '0';
      begun     <= '0';
      following := place;

      -- rows
      issued <= running;
      valid  <= issued;
      ends   <= '0';
      turned <= ends;

      if (running = '1') then
        counter <= counter + 1;

        if (counter = SHORT_FROM - 1 and long_i = '1') then
          counter <= to_unsigned(LONG_FROM, counter'length);
        end if;

        if (counter = LONG_FROM - 1 or counter = TURN_FROM - 1 or counter = ALL_ROWS - 1) then
          ends <= '1';
        end if;

        if (counter = LONG_FROM - 1 or counter = ALL_ROWS - 1) then
          running   <= '0';
          following := place + 1;
        end if;
      elsif (ordered = '1') then
        ordered <= '0';
        running <= '1';
        counter <= to_unsigned(SHORT_FROM, counter'length);

        if (long_i = '1') then
          counter <= to_unsigned(LONG_FROM, counter'length);
        end if;
      end if;

      flip <= flip xor turned;

      -- '1' from the first stage of two steps on; place 0 is the one in front of the first
      place  <= following;
      long_i <= not to_std_logic(following + odd_n < resize(short, place'length) + 1);

      -- operands
      case to_integer(unsigned(row(4 downto 0))) is

        when a_word_t'pos(OMEGA_STATOR) =>
          a <= shift_left(resize(omega_s, FACTOR_WIDTH), SPEED_SHIFT);

        when a_word_t'pos(OMEGA_ROTOR) =>
          a <= shift_left(resize(omega_r, FACTOR_WIDTH), SPEED_SHIFT);

        when a_word_t'pos(REF_ALPHA) =>
          a <= shift_left(resize(iref_alpha, FACTOR_WIDTH), VECTOR_SHIFT);

        when a_word_t'pos(REF_BETA) =>
          a <= shift_left(resize(iref_beta, FACTOR_WIDTH), VECTOR_SHIFT);

        when a_word_t'pos(FLUX_ALPHA) =>
          a <= shift_left(resize(psir_alpha, FACTOR_WIDTH), FLUX_SHIFT);

        when a_word_t'pos(FLUX_BETA) =>
          a <= shift_left(resize(psir_beta, FACTOR_WIDTH), FLUX_SHIFT);

        when a_word_t'pos(LINK) =>
          a <= signed(resize(v_dc, FACTOR_WIDTH));

        when a_word_t'pos(CURRENT_BETA) =>
          a <= shift_left(resize(is_beta, FACTOR_WIDTH), VECTOR_SHIFT);

        when a_word_t'pos(ONE) =>
          a <= WHOLE;

        when others =>
          a <= signed(a_word);

      end case;

      case to_integer(unsigned(row(9 downto 5))) is

        when b_word_t'pos(EIGHTH_1) =>
          b <= to_signed(EIGHTH, FACTOR_WIDTH);

        when b_word_t'pos(EIGHTH_2) =>
          b <= to_signed(2 * EIGHTH, FACTOR_WIDTH);

        when b_word_t'pos(EIGHTH_3) =>
          b <= to_signed(3 * EIGHTH, FACTOR_WIDTH);

        when b_word_t'pos(EIGHTH_4) =>
          b <= to_signed(4 * EIGHTH, FACTOR_WIDTH);

        when b_word_t'pos(EIGHTH_6) =>
          b <= to_signed(6 * EIGHTH, FACTOR_WIDTH);

        when b_word_t'pos(INVERSE) =>
          b <= to_signed(INVERSE_ROOT, FACTOR_WIDTH);

        when b_word_t'pos(THIRD_1) =>
          b <= to_signed(THIRD, FACTOR_WIDTH);

        when b_word_t'pos(SIXTH_1) =>
          b <= to_signed(SIXTH, FACTOR_WIDTH);

        when b_word_t'pos(C_ANGLE) =>
          b <= coefficients.angle;

        when b_word_t'pos(C_DECAY) =>
          b <= coefficients.decay_1;

        when b_word_t'pos(C_FLUX_0) =>
          b <= coefficients.flux_0;

        when b_word_t'pos(C_FLUX_2) =>
          b <= coefficients.flux_2;

        when b_word_t'pos(C_FLUX_U) =>
          b <= coefficients.flux_u;

        when b_word_t'pos(C_FLUX_W) =>
          b <= coefficients.flux_w;

        when b_word_t'pos(C_LEVEL_1) =>
          b <= coefficients.level_1;

        when b_word_t'pos(C_LEVEL_2) =>
          b <= coefficients.level_2;

        when b_word_t'pos(C_NEUTRAL) =>
          b <= coefficients.neutral;

        when b_word_t'pos(C_CAPACITOR) =>
          b <= coefficients.capacitor;

        when b_word_t'pos(B_ROTOR) =>
          b <= shift_left(resize(omega_r, FACTOR_WIDTH), SPEED_SHIFT);

        when b_word_t'pos(B_ONE) =>
          b <= WHOLE;

        when others =>
          b <= signed(b_word);

      end case;

      tags(1) <= (valid, row(14), row(15), row(16), row(17), row(18), goal);
      tags(2) <= tags(1);
      tags(3) <= tags(2);

      -- product and sum
      product <= a * b;

      addend := HALF;

      if (tags(2).gather = '1') then
        addend := sum;
      end if;

      sum <= adjusted(addend, resize(product, SUM_WIDTH), not tags(2).minus, tags(2).minus);

      -- results
      if (tags(3).valid = '1' and (tags(3).to_a = '1' or tags(3).to_b = '1')) then
        saturated <= overflows(result, FACTOR_WIDTH);
      end if;

      if (ready_i = '1' and taken = '1') then
        ready_i <= '0';
        ordered <= '1';
      end if;

      if (leaving = '1') then
        if (tags(3).place = out_word_t'pos(OUT_ERROR)) then
          error_w <= resize(result, ERROR_WIDTH);
          begun   <= '1';
        elsif (tags(3).place(3 downto 2) = "00") then
          saturated <= overflows(result, FACTOR_WIDTH);
        else
          saturated <= overflows(charge, VOLTAGE_WIDTH);
        end if;

        -- the last word but one of a stage; the last one is there when it is needed
        if (tags(3).place = out_word_t'pos(OUT_NEUTRAL_C)) then
          ready_i <= '1';
          long    <= long_i;
        end if;
      end if;

      if (start = '1') then
        running <= '1';
        ordered <= '0';
        ready_i <= '0';
        counter <= (others => '0');
        flip    <= '0';
        issued  <= '0';
        valid   <= '0';
        ends    <= '0';
        turned  <= '0';
        place   <= to_unsigned(1, place'length);

        if (compensate = '1') then
          place <= to_unsigned(0, place'length);
        end if;

        for i in tags'range loop
          tags(i).valid <= '0';
        end loop;
      end if;

      if (rst = '1') then
        running <= '0';
        issued  <= '0';
        valid   <= '0';
        ordered <= '0';
        ready_i <= '0';
        ends    <= '0';
        turned  <= '0';

        for i in tags'range loop
          tags(i).valid <= '0';
        end loop;
      end if;
    end if;

  end process p_run;

  ready         <= ready_i;
  linear        <= signed(linear_word);
  node_neutral  <= signed(node_neutral_word);
  node_phase    <= signed(node_phase_word);
  child_neutral <= signed(child_neutral_word);
  child_phase   <= signed(child_phase_word);

end architecture rtl;
