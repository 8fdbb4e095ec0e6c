-- What all nodes of a stage share: drift of the error, charges, decay (docs/specification.md, 10.1 and 10.7).
--
-- One multiplier and one sum work through a program.  Its first part forms the angle of a step, the
-- reference and the drift of one step at k, and the first error.  Its second part runs once for each
-- stage, or twice for one of two steps, and turns reference and drift by a step at a time.
-- Formats: as directmpc.kbest.formats has them.
-- Latency: 47 clocks from start to the first stage; 18 more after taken for a stage of one step, 30 for
-- one of two.
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
    ready        : out   std_logic;            -- '1': stage is the next one, stable until taken
    stage        : out   stage_t;              -- terms of that stage
    taken        : in    std_logic;            -- '1': the stage is taken, go on with the one behind it
    saturated    : out   std_logic             -- '1': a word has saturated
  );
end entity kbest_terms;

architecture rtl of kbest_terms is

  type source_t is (
    ANGLE, LESS, CUBIC, SINE, SINE_U, SINE_W, REF_U, REF_W, FLUX_U, FLUX_W, SQUARE, STRAIGHT, ACROSS_U,
    ACROSS_W, DRIFT_U, DRIFT_W, LEVEL_1, LEVEL_2, NEXT_U, NEXT_W, LATER_U, LATER_W, LOSS_U, LOSS_W,
    DRAWN_A, DRAWN_B, CHARGED_A, CHARGED_B, ERROR_B,
    OMEGA_STATOR, OMEGA_ROTOR, REF_BETA, FLUX_BETA, LINK, DIFFERENCE, MIDDLE_A, MIDDLE_B,
    C_ANGLE, C_DECAY, C_FLUX_0, C_FLUX_2, C_FLUX_U, C_FLUX_W, C_LEVEL_1, C_LEVEL_2, C_NEUTRAL, C_CAPACITOR,
    K_ROOT, K_INVERSE, K_THIRD, NONE
  );

  type step_t is record
    a     : source_t;
    b     : source_t;
    shift : natural range 0 to 10; -- left shift of the product
    minus : boolean;               -- it is taken off
    first : boolean;               -- of a sum
    last  : boolean;
    base  : source_t;              -- what the sum is added to
    goal  : source_t;              -- register of the result
  end record step_t;

  type program_t is array (natural range <>) of step_t;

  constant IDLE : step_t := (NONE, NONE, 0, false, true, false, NONE, NONE);

  constant WORK_STEPS : program_t := (
    (OMEGA_STATOR, C_ANGLE, 7, false, true, true, NONE, ANGLE),
    (REF_BETA, K_INVERSE, 8, false, true, true, NONE, REF_W),
    (FLUX_BETA, K_INVERSE, 8, false, true, true, NONE, FLUX_W),
    (OMEGA_ROTOR, OMEGA_ROTOR, 7, false, true, true, NONE, SQUARE),
    (ANGLE, ANGLE, 9, false, true, true, NONE, LESS),
    (OMEGA_ROTOR, C_FLUX_U, 7, false, true, true, NONE, ACROSS_U),
    (OMEGA_ROTOR, C_FLUX_W, 7, false, true, true, NONE, ACROSS_W),
    (SQUARE, C_FLUX_2, 7, false, true, true, C_FLUX_0, STRAIGHT),
    (ANGLE, LESS, 0, false, true, true, NONE, CUBIC),
    (LINK, C_LEVEL_1, 8, false, true, true, NONE, LEVEL_1),
    (LINK, C_LEVEL_2, 8, false, true, true, NONE, LEVEL_2),
    (DIFFERENCE, K_INVERSE, 10, false, true, true, NONE, ERROR_B),
    (CUBIC, K_THIRD, 6, true, true, true, ANGLE, SINE),
    IDLE, IDLE, IDLE,
    (SINE, K_ROOT, 6, false, true, true, NONE, SINE_U),
    (SINE, K_INVERSE, 5, false, true, true, NONE, SINE_W),
    (LESS, REF_U, 0, true, true, false, NONE, NONE),
    (REF_U, C_DECAY, 5, false, false, false, NONE, NONE),
    (ACROSS_U, FLUX_W, 7, false, false, false, NONE, NONE),
    (STRAIGHT, FLUX_U, 7, true, false, false, NONE, NONE),
    (SINE_U, REF_W, 6, true, false, true, NONE, DRIFT_U),
    (LESS, REF_W, 0, true, true, false, NONE, NONE),
    (REF_W, C_DECAY, 5, false, false, false, NONE, NONE),
    (ACROSS_W, FLUX_U, 7, true, false, false, NONE, NONE),
    (STRAIGHT, FLUX_W, 7, true, false, false, NONE, NONE),
    (SINE_W, REF_U, 6, false, false, true, NONE, DRIFT_W),
    -- once a step
    (LESS, REF_U, 0, true, true, false, NONE, NONE),
    (SINE_U, REF_W, 6, true, false, true, REF_U, NEXT_U),
    (LESS, REF_W, 0, true, true, false, NONE, NONE),
    (SINE_W, REF_U, 6, false, false, true, REF_W, NEXT_W),
    (LESS, DRIFT_U, 0, true, true, false, NONE, NONE),
    (SINE_U, DRIFT_W, 6, true, false, true, DRIFT_U, LATER_U),
    (LESS, DRIFT_W, 0, true, true, false, NONE, NONE),
    (SINE_W, DRIFT_U, 6, false, false, true, DRIFT_W, LATER_W),
    -- once a stage
    (DRIFT_U, C_DECAY, 7, false, true, true, NONE, LOSS_U),
    (DRIFT_W, C_DECAY, 7, false, true, true, NONE, LOSS_W),
    (MIDDLE_A, C_NEUTRAL, 5, false, true, true, NONE, DRAWN_A),
    (MIDDLE_B, C_NEUTRAL, 5, false, true, true, NONE, DRAWN_B),
    (MIDDLE_A, C_CAPACITOR, 5, false, true, true, NONE, CHARGED_A),
    (MIDDLE_B, C_CAPACITOR, 5, false, true, true, NONE, CHARGED_B),
    IDLE, IDLE, IDLE, IDLE
  );

  constant STAGE_FROM : natural := 28; -- first step of a turn
  constant TURN_LAST  : natural := 35; -- last step of a turn
  constant TURN_DONE  : natural := 39; -- its results are there
  constant STAGE_DONE : natural := 45; -- the stage's are

  subtype stored_t is source_t range ANGLE to CHARGED_B;

  type registers_t is array (stored_t) of factor_t;

  constant SUM_WIDTH : natural := 49;
  constant HALF      : signed(SUM_WIDTH - 1 downto 0) := to_signed(2 ** (COSINE_FRACTION - 1), SUM_WIDTH);

  signal registers : registers_t;
  signal running   : std_logic;
  signal second    : std_logic; -- '1': second step of a long stage
  signal waiting   : std_logic;
  signal counter   : natural range 0 to 63;
  signal place     : unsigned(5 downto 0); -- stage that is computed, one more than its index
  signal odd_n     : unsigned(0 downto 0);
  signal long      : std_logic;
  signal middle_u  : signed(FACTOR_WIDTH downto 0);
  signal middle_w  : signed(FACTOR_WIDTH downto 0);
  signal across    : signed(FACTOR_WIDTH + 2 downto 0);

  signal step_1  : step_t;
  signal step_2  : step_t;
  signal step_3  : step_t;
  signal a       : factor_t;
  signal b       : factor_t;
  signal product : signed(2 * FACTOR_WIDTH - 1 downto 0);
  signal sum     : signed(SUM_WIDTH - 1 downto 0);
  signal active  : std_logic;
  signal active_1 : std_logic;
  signal active_2 : std_logic;
  signal active_3 : std_logic;
  signal stage_i : stage_t;
  signal error_i : error_t;

begin

  -- '1' from the first stage of two steps on; place 0 is the one in front of the first
  odd_n(0) <= odd;
  long     <= '0' when place + odd_n < resize(short, place'length) + 1 else
              '1';

  -- reference in the middle of the stage: the mean over a step, the step's end over two
  middle_u <= resize(registers(NEXT_U), FACTOR_WIDTH + 1) when long = '1' else
              shift_right(resize(registers(REF_U), FACTOR_WIDTH + 1) + registers(NEXT_U), 1);
  middle_w <= resize(registers(NEXT_W), FACTOR_WIDTH + 1) when long = '1' else
              shift_right(resize(registers(REF_W), FACTOR_WIDTH + 1) + registers(NEXT_W), 1);
  across   <= shift_right(resize(middle_w, FACTOR_WIDTH + 3) + shift_left(resize(middle_w, FACTOR_WIDTH + 3), 1)
              - resize(middle_u, FACTOR_WIDTH + 3), 1);

  p_run : process (clk) is

    procedure read (source : source_t; signal word : out factor_t) is
    begin

      case source is

        when OMEGA_STATOR =>
          word <= resize(omega_s, FACTOR_WIDTH);

        when OMEGA_ROTOR =>
          word <= resize(omega_r, FACTOR_WIDTH);

        when REF_BETA =>
          word <= resize(iref_beta, FACTOR_WIDTH);

        when FLUX_BETA =>
          word <= resize(psir_beta, FACTOR_WIDTH);

        when LINK =>
          word <= signed(resize(v_dc, FACTOR_WIDTH));

        when DIFFERENCE =>
          word <= resize(iref_beta, FACTOR_WIDTH) - resize(is_beta, FACTOR_WIDTH);

        when MIDDLE_A =>
          word <= resize(middle_u, FACTOR_WIDTH);

        when MIDDLE_B =>
          word <= clip(across, FACTOR_WIDTH);

        when C_ANGLE =>
          word <= coefficients.angle;

        when C_DECAY =>
          word <= coefficients.decay_1;

        when C_FLUX_2 =>
          word <= coefficients.flux_2;

        when C_FLUX_U =>
          word <= coefficients.flux_u;

        when C_FLUX_W =>
          word <= coefficients.flux_w;

        when C_LEVEL_1 =>
          word <= coefficients.level_1;

        when C_LEVEL_2 =>
          word <= coefficients.level_2;

        when C_NEUTRAL =>
          word <= coefficients.neutral;

        when C_CAPACITOR =>
          word <= coefficients.capacitor;

        when K_ROOT =>
          word <= to_signed(ROOT, FACTOR_WIDTH);

        when K_INVERSE =>
          word <= to_signed(INVERSE_ROOT, FACTOR_WIDTH);

        when K_THIRD =>
          word <= to_signed(THIRD, FACTOR_WIDTH);

        when NONE | ERROR_B | C_FLUX_0 =>
          word <= (others => '0');

        when others =>
          word <= registers(source);

      end case;

    end procedure read;

    variable step   : step_t;
    variable wide   : signed(SUM_WIDTH - 1 downto 0);
    variable result : signed(SUM_WIDTH - COSINE_FRACTION - 1 downto 0);
    variable base   : factor_t;
    variable last   : signed(FACTOR_WIDTH downto 0);
    variable drift  : error_t;

  begin

    if rising_edge(clk) then
      saturated <= '0';
      step      := WORK_STEPS(counter);

      -- operands
      read(step.a, a);
      read(step.b, b);
      step_1   <= step;
      active_1 <= active;

      if (step.goal = DRAWN_A or step.goal = DRAWN_B or step.goal = CHARGED_A or step.goal = CHARGED_B) then
        if (long = '1') then
          step_1.shift <= step.shift + 1;
        end if;

        if (active = '1') then
          saturated <= overflows(across, FACTOR_WIDTH);
        end if;
      end if;

      -- product
      product  <= a * b;
      step_2   <= step_1;
      active_2 <= active_1;

      -- sum
      wide     := shift_left(resize(product, SUM_WIDTH), step_2.shift);

      if (step_2.minus) then
        wide := -wide;
      end if;

      if (step_2.first) then
        sum <= wide + HALF;
      else
        sum <= sum + wide;
      end if;

      step_3   <= step_2;
      active_3 <= active_2;

      -- result
      if (active_3 = '1' and step_3.last) then
        base := (others => '0');

        if (step_3.base = C_FLUX_0) then
          base := coefficients.flux_0;
        elsif (step_3.base /= NONE) then
          base := registers(step_3.base);
        end if;

        result := sum(SUM_WIDTH - 1 downto COSINE_FRACTION) + resize(base, result'length);

        if (step_3.goal = ERROR_B) then
          error_i <= resize(result, ERROR_WIDTH);
        else
          registers(step_3.goal) <= clip(result, FACTOR_WIDTH);

          if (overflows(result, FACTOR_WIDTH) = '1') then
            saturated <= '1';
          end if;
        end if;
      end if;

      -- program
      if (running = '1') then
        counter <= counter + 1;

        if (second = '1' and counter = TURN_LAST) then
          active <= '0';
        elsif (second = '1' and counter = TURN_DONE) then
          registers(REF_U)   <= registers(NEXT_U);
          registers(REF_W)   <= registers(NEXT_W);
          registers(DRIFT_U) <= registers(LATER_U);
          registers(DRIFT_W) <= registers(LATER_W);
          second             <= '0';
          running            <= '0';
          waiting            <= '1';
          place              <= place + 1;
        elsif (counter = STAGE_DONE) then
          stage_i.long       <= long;
          stage_i.neutral(0) <= registers(DRAWN_A);
          stage_i.neutral(1) <= registers(DRAWN_B);
          last               := -resize(registers(DRAWN_A), FACTOR_WIDTH + 1) - registers(DRAWN_B);
          stage_i.neutral(2) <= clip(last, FACTOR_WIDTH);
          saturated          <= overflows(last, FACTOR_WIDTH);
          stage_i.phase(0)   <= registers(CHARGED_A);
          stage_i.phase(1)   <= registers(CHARGED_B);
          last               := -resize(registers(CHARGED_A), FACTOR_WIDTH + 1) - registers(CHARGED_B);
          stage_i.phase(2)   <= clip(last, FACTOR_WIDTH);

          if (overflows(last, FACTOR_WIDTH) = '1') then
            saturated <= '1';
          end if;

          if (long = '1') then
            stage_i.level   <= registers(LEVEL_2);
            stage_i.forced  <= coefficients.forced_2;
            stage_i.decay   <= coefficients.decay_2;
            drift           := resize(registers(DRIFT_U), ERROR_WIDTH) + registers(LATER_U);
            stage_i.drift_u <= shift_left(drift, VECTOR_SHIFT) - registers(LOSS_U);
            drift           := resize(registers(DRIFT_W), ERROR_WIDTH) + registers(LATER_W);
            stage_i.drift_w <= shift_left(drift, VECTOR_SHIFT) - registers(LOSS_W);
            counter         <= STAGE_FROM;
            second          <= '1';
          else
            stage_i.level   <= registers(LEVEL_1);
            stage_i.forced  <= coefficients.forced_1;
            stage_i.decay   <= coefficients.decay_1;
            stage_i.drift_u <= shift_left(resize(registers(DRIFT_U), ERROR_WIDTH), VECTOR_SHIFT);
            stage_i.drift_w <= shift_left(resize(registers(DRIFT_W), ERROR_WIDTH), VECTOR_SHIFT);
            counter         <= STAGE_FROM;
            running         <= '0';
            active          <= '0';
            waiting         <= '1';
            place           <= place + 1;
          end if;

          registers(REF_U)   <= registers(NEXT_U);
          registers(REF_W)   <= registers(NEXT_W);
          registers(DRIFT_U) <= registers(LATER_U);
          registers(DRIFT_W) <= registers(LATER_W);
        end if;
      elsif (waiting = '1' and taken = '1') then
        waiting <= '0';
        running <= '1';
        active  <= '1';
        counter <= STAGE_FROM;
      end if;

      if (start = '1') then
        running           <= '1';
        active            <= '1';
        waiting           <= '0';
        second            <= '0';
        counter           <= 0;
        registers(REF_U)  <= shift_left(resize(iref_alpha, FACTOR_WIDTH), VECTOR_SHIFT);
        registers(FLUX_U) <= shift_left(resize(psir_alpha, FACTOR_WIDTH), FLUX_SHIFT);

        if (compensate = '1') then
          place <= to_unsigned(0, place'length);
        else
          place <= to_unsigned(1, place'length);
        end if;
      end if;

      if (rst = '1') then
        running  <= '0';
        waiting  <= '0';
        second   <= '0';
        active   <= '0';
        active_1 <= '0';
        active_2 <= '0';
        active_3 <= '0';
        counter  <= 0;
      end if;
    end if;

  end process p_run;

  ready   <= waiting;
  stage   <= stage_i;
  error_w <= error_i;

end architecture rtl;
