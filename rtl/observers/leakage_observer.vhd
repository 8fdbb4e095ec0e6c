-- Leakage estimate: the ratio theta of the step that the stator current makes to the predicted one, and the
-- coefficients of the current's slopes times theta.
--
--   phi    = h (xr/D v - j omega_r xm/D psi_r)                            predicted step
--   e      = i(k) - i(k-1) - theta phi                                    its error
--   theta <= theta + mu Re(conj(phi) e)                                   within 0.5 and 2
--
-- start takes theta from k-1 to k.  It needs current, rotor flux and speed at k, and the voltages from k-1 to k as
-- rotor_flux_observer forms them.  scale multiplies the slopes' coefficients by theta.  Where theta is 1, as it is
-- after a reset, they come out as they are.  The first step after a reset only remembers the current.
--
-- How: one mac_block.  A step is a program of 12 products (model/directmpc/mpdcc/leakage_program.py), which a
-- mac_sequencer reads.  The scaled coefficients move into a chain of words, one a clock.
-- Formats: ports as those of mpdcc_core; sums of products are cut by 16 bits, l_emf has 32 fractional bits.  Steps and
-- errors are words of the current.  theta has 10 bits below its LSB: mu is 3.81 per square of the current in pu.
-- Twin: model/directmpc/mpdcc/leakage.py.
-- Latency: valid 29 clocks after start, busy for 28 clocks.  scaled is complete when busy falls, 16 clocks after
-- scale.  The next start or scale may come when busy has fallen.
-- Overflow: words saturate and set saturated, scaled coefficients saturate and set clipped.  A step that would take
-- theta out of its limits leaves it as it is, and is no overflow.  Nothing wraps.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.guarded_states.all;
  use work.leakage_observer_program.all;

entity leakage_observer is
  generic (
    SLOPES : positive := 13 -- number of coefficients that are scaled
  );
  port (
    clk             : in    std_logic;                                 -- rising edge
    rst             : in    std_logic;                                 -- synchronous, active high; theta is 1
    start           : in    std_logic;                                 -- '1' for one clock: a step; ignored while busy
    scale           : in    std_logic;                                 -- '1' for one clock: scale; start goes first
    -- measurements at k, stable for 22 clocks from start on
    is_alpha        : in    std_logic_vector(15 downto 0);             -- stator current, signed, 1/16000 pu
    is_beta         : in    std_logic_vector(15 downto 0);             -- signed, 1/16000 pu
    psir_alpha      : in    std_logic_vector(15 downto 0);             -- rotor flux, signed, 1/9000 pu
    psir_beta       : in    std_logic_vector(15 downto 0);             -- signed, 1/9000 pu
    omega_r         : in    std_logic_vector(15 downto 0);             -- rotor speed, signed, 1/16000 pu
    -- voltages from k-1 to k, stable from 5 to 17 clocks after start
    v_alpha         : in    std_logic_vector(17 downto 0);             -- 2 v_a - v_b - v_c, signed, 1/16003.125 pu
    v_beta          : in    std_logic_vector(17 downto 0);             -- v_b - v_c, signed, 1/16003.125 pu
    -- parameters, stable while busy; signed
    frozen          : in    std_logic;                                 -- '1': theta stays
    l_voltage_alpha : in    std_logic_vector(17 downto 0);             -- h*xr/(3*D)
    l_voltage_beta  : in    std_logic_vector(17 downto 0);             -- h*xr/(sqrt(3)*D)
    l_emf           : in    std_logic_vector(17 downto 0);             -- h*xm/D
    given           : in    std_logic_vector(SLOPES * 16 - 1 downto 0); -- coefficients, signed, word 0 rightmost
    -- estimate at k, stable until the next start
    valid           : out   std_logic;                                 -- '1' for one clock: theta is new
    busy            : out   std_logic;                                 -- '1': a step or a scaling is under way
    theta           : out   std_logic_vector(16 downto 0);             -- unsigned, 16 fractional bits
    saturated       : out   std_logic;                                 -- '1': a word of the step did not hold its value
    -- coefficients times theta, stable until the next scale
    scaled          : out   std_logic_vector(SLOPES * 16 - 1 downto 0); -- signed, word 0 rightmost
    clipped         : out   std_logic                                  -- '1': one did not fit its word
  );
end entity leakage_observer;

architecture rtl of leakage_observer is

  constant WORD     : natural := 16;                       -- bits of a measurement, a step and a coefficient given
  constant OPERAND  : natural := 18;                       -- bits of both operands
  constant FRACTION : natural := 16;                       -- fractional bits of theta and of the products
  constant GUARD    : natural := 10;                       -- bits of theta's state below its LSB
  constant STATE    : natural := FRACTION + 1 + GUARD;
  constant SUM      : natural := 2 * OPERAND;
  constant MOVE     : natural := 2 * WORD;                 -- bits of a product of error and step
  constant A_BITS   : natural := selector_width(A_PLACES);
  constant B_BITS   : natural := selector_width(B_PLACES);
  constant PLACES   : natural := selector_width(SLOPES);
  constant LATENCY  : natural := 3;                        -- of mac_block

  subtype operand_t is std_logic_vector(OPERAND - 1 downto 0);

  type operands_t is array (0 to B_PLACES - 1) of operand_t;

  signal stepping    : std_logic;
  signal idle        : std_logic;
  signal begins      : std_logic;
  signal due         : std_logic_vector(DUE_EVENTS - 1 downto 0); -- clocks of the program's events
  signal issue       : std_logic;
  signal gathering   : std_logic;
  signal a_choice    : std_logic_vector(A_BITS - 1 downto 0);
  signal b_choice    : std_logic_vector(B_BITS - 1 downto 0);
  signal begun       : std_logic; -- there is a current at k-1
  signal previous_a  : signed(WORD - 1 downto 0);  -- current at k-1, along alpha
  signal previous_b  : signed(WORD - 1 downto 0);
  signal phi         : signed(WORD - 1 downto 0);  -- product of speed and emf, then the step
  signal ratio       : unsigned(STATE - 1 downto 0); -- theta
  signal moved       : signed(MOVE - 1 downto 0);    -- theta with its change
  signal value       : signed(OPERAND - 1 downto 0);
  signal a_word      : operand_t;
  signal b_words     : operands_t;
  signal b_inputs    : std_logic_vector(B_PLACES * OPERAND - 1 downto 0);
  signal b_word      : std_logic_vector(B_BITS - 1 downto 0);
  signal rounds      : std_logic; -- the sum will be rounded
  signal seed        : std_logic_vector(SUM - 1 downto 0);
  signal enable      : std_logic;
  signal total       : std_logic_vector(SUM - 1 downto 0);
  signal result      : signed(WORD - 1 downto 0);  -- of a sum that is rounded
  signal overflow    : std_logic;
  signal full        : std_logic; -- a word of this step did not hold its value
  signal seeds       : std_logic_vector(SEED_KINDS - 1 downto 0);
  signal place       : unsigned(PLACES - 1 downto 0); -- coefficient that is scaled
  signal scaling     : std_logic; -- its product is issued
  signal on_its_way  : std_logic_vector(LATENCY - 1 downto 0); -- the product is in the block; highest: complete
  signal chain       : std_logic_vector(SLOPES * WORD - 1 downto 0);

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
      start       => begins,
      enable      => issue,
      accumulate  => gathering,
      alignment   => open,
      a_select    => a_choice,
      b_select    => b_choice,
      seed_select => seeds,
      due         => due,
      valid       => valid,
      busy        => stepping
    );

  idle   <= not (stepping or scaling or on_its_way(0) or on_its_way(1) or on_its_way(2));
  begins <= start and idle;
  busy   <= not idle;

  p_previous : process (clk) is
  begin

    if rising_edge(clk) then
      if (due(DUE_REMEMBER) = '1') then
        previous_a <= signed(is_alpha);
        previous_b <= signed(is_beta);
      end if;

      if (due(DUE_THETA_BETA) = '1') then
        begun <= '1';
      end if;

      if (rst = '1') then
        begun <= '0';
      end if;
    end if;

  end process p_previous;

  ---------------------------------------------------------------------------------------------
  -- Scaling: one coefficient a clock; the result joins the chain's upper end
  ---------------------------------------------------------------------------------------------

  p_scale : process (clk) is
  begin

    if rising_edge(clk) then
      if (idle = '1') then
        scaling <= scale and not start;
      elsif (place = SLOPES - 1) then
        scaling <= '0';
      end if;

      if (scaling = '1') then
        place <= place + 1;
      else
        place <= (others => '0');
      end if;

      on_its_way <= on_its_way(LATENCY - 2 downto 0) & scaling;

      if (rst = '1') then
        scaling    <= '0';
        on_its_way <= (others => '0');
      end if;
    end if;

  end process p_scale;

  p_chain : process (clk) is
  begin

    if rising_edge(clk) then
      if (on_its_way(LATENCY - 1) = '1') then
        chain <= std_logic_vector(result) & chain(SLOPES * WORD - 1 downto WORD);
      end if;

      if (scaling = '1' and place = 0) then
        clipped <= '0';
      elsif (on_its_way(LATENCY - 1) = '1' and overflow = '1') then
        clipped <= '1';
      end if;
    end if;

  end process p_chain;

  scaled <= chain;

  ---------------------------------------------------------------------------------------------
  -- Products
  ---------------------------------------------------------------------------------------------

  p_value : process (a_choice, scaling, place, given, is_alpha, is_beta, psir_alpha, psir_beta, omega_r, v_alpha,
                     v_beta, phi) is

    variable measured : std_logic_vector(WORD - 1 downto 0);

  begin

    measured := (others => '0');

    case to_integer(unsigned(a_choice)) is

      when A_SPEED =>

        measured := omega_r;

      when A_CROSS_ALPHA =>

        measured := psir_beta;

      when A_CROSS_BETA =>

        measured := psir_alpha;

      when A_MOVED_ALPHA =>

        measured := is_alpha;

      when A_MOVED_BETA =>

        measured := is_beta;

      when A_PHI =>

        measured := std_logic_vector(phi);

      when others =>

        null;

    end case;

    if (scaling = '1') then
      measured := selected(given, std_logic_vector(place), WORD);
    end if;

    value <= resize(signed(measured), OPERAND);

    if (to_integer(unsigned(a_choice)) = A_VOLTAGE_ALPHA) then
      value <= signed(v_alpha);
    elsif (to_integer(unsigned(a_choice)) = A_VOLTAGE_BETA) then
      value <= signed(v_beta);
    end if;

  end process p_value;

  p_operand : process (a_choice, value, previous_a, previous_b) is

    variable origin   : signed(OPERAND - 1 downto 0); -- current at k-1
    variable negative : std_logic;                    -- the value is subtracted from it

  begin

    origin   := (others => '0');
    negative := '0';

    case to_integer(unsigned(a_choice)) is

      when A_CROSS_BETA =>

        negative := '1';

      when A_MOVED_ALPHA =>

        negative := '1';
        origin   := resize(previous_a, OPERAND);

      when A_MOVED_BETA =>

        negative := '1';
        origin   := resize(previous_b, OPERAND);

      when others =>

        null;

    end case;

    a_word <= std_logic_vector(adjusted(origin, value, not negative, negative));

  end process p_operand;

  b_words(B_VOLTAGE_ALPHA) <= l_voltage_alpha;
  b_words(B_VOLTAGE_BETA)  <= l_voltage_beta;
  b_words(B_EMF)           <= l_emf;
  b_words(B_PHI)           <= std_logic_vector(resize(phi, OPERAND));
  b_words(B_THETA)         <= '0' & std_logic_vector(ratio(STATE - 1 downto GUARD));
  b_words(B_ONE)           <= (FRACTION => '1', others => '0');
  b_words(B_ERROR)         <= std_logic_vector(resize(result, OPERAND));

  g_b : for i in 0 to B_PLACES - 1 generate
    b_inputs((i + 1) * OPERAND - 1 downto i * OPERAND) <= b_words(i);
  end generate g_b;

  b_word <= std_logic_vector(to_unsigned(B_THETA, B_BITS)) when scaling = '1' else
            b_choice;
  enable <= issue or scaling;
  rounds <= scaling or seeds(SEED_HALF);

  p_seed : process (rounds) is
  begin

    seed               <= (others => '0');
    seed(FRACTION - 1) <= rounds;

  end process p_seed;

  i_mac : entity work.mac_block
    generic map (
      A_WIDTH           => OPERAND,
      B_WIDTH           => OPERAND,
      A_WORDS           => 1,
      B_WORDS           => B_PLACES,
      ALIGNMENT_STEP    => 0,
      ACCUMULATOR_WIDTH => SUM
    )
    port map (
      clk         => clk,
      enable      => enable,
      a_inputs    => a_word,
      a_select    => "0",
      b_inputs    => b_inputs,
      b_select    => b_word,
      alignment   => "00",
      accumulate  => gathering,
      seed        => seed,
      accumulator => total
    );

  result   <= clip(signed(total(SUM - 1 downto FRACTION)), WORD);
  overflow <= overflows(signed(total(SUM - 1 downto FRACTION)), WORD);

  p_results : process (clk) is
  begin

    if rising_edge(clk) then
      if (due(DUE_ANGLE_ALPHA) = '1' or due(DUE_PHI_ALPHA) = '1' or due(DUE_ANGLE_BETA) = '1'
          or due(DUE_PHI_BETA) = '1') then
        phi <= result;
      end if;

      if (due(DUE_ANGLE_ALPHA) = '1') then
        full <= overflow and begun;
      elsif (due(DUE_PHI_ALPHA) = '1' or due(DUE_ERROR_ALPHA) = '1' or due(DUE_PHI_BETA) = '1'
             or due(DUE_ERROR_BETA) = '1') then
        full <= full or (overflow and begun);
      end if;
    end if;

  end process p_results;

  saturated <= full;

  ---------------------------------------------------------------------------------------------
  -- theta: the sum is the negative of its change
  ---------------------------------------------------------------------------------------------

  moved <= signed(resize(ratio, MOVE)) - signed(total(MOVE - 1 downto 0));

  p_theta : process (clk) is
  begin

    if rising_edge(clk) then
      if ((due(DUE_THETA_ALPHA) = '1' or due(DUE_THETA_BETA) = '1') and begun = '1' and frozen = '0') then
        -- within 0.5 and 2
        if (moved(MOVE - 1 downto STATE) = 0 and moved(STATE - 1 downto STATE - 2) /= 0) then
          ratio <= unsigned(moved(STATE - 1 downto 0));
        end if;
      end if;

      if (rst = '1') then
        ratio            <= (others => '0');
        ratio(STATE - 1) <= '1';
      end if;
    end if;

  end process p_theta;

  theta <= std_logic_vector(ratio(STATE - 1 downto GUARD));

end architecture rtl;
