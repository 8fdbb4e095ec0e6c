-- Compares phase currents and dc-link voltage with their trip levels, without a multiplier.
--
--   i_a = i_alpha,  2 i_b = -i_alpha + sqrt(3) i_beta,  2 i_c = -i_alpha - sqrt(3) i_beta
--
-- with 111/64 for sqrt(3), 0.13 % more than it is: |64 i_alpha -+ 111 i_beta| is compared with 128 limits.
-- One addition or comparison a clock: 111 i_beta, the phase currents, the comparison.
--
-- checked says that a measurement has been compared, whatever came of it.  It does not come for a measurement that
-- was on its way while forget was up; the trips come all the same.
--
-- Formats: currents signed, 16 bits; limits unsigned in the same unit; v_dc and its limits unsigned.
-- A current limit of zero trips at any current that is not zero.  A limit that a measurement cannot exceed trips with
-- every measurement: current_limit from 32767 on, link_high = 65535.
-- Latency: the outputs are up three clocks after measured, for one clock.  The limits of the dc-link are read with
-- measured, the current limit two clocks later.  Interval: one clock.
-- Overflow: none; the sums have all the bits they need.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;

entity trip_comparator is
  port (
    clk           : in    std_logic;                     -- rising edge
    rst           : in    std_logic;                     -- synchronous, active high: forgets what is on its way
    measured      : in    std_logic;                     -- '1': the measurements are new
    forget        : in    std_logic;                     -- '1': what is on its way is not reported as checked
    is_alpha      : in    std_logic_vector(15 downto 0); -- stator current, signed
    is_beta       : in    std_logic_vector(15 downto 0); -- stator current, signed, unit as is_alpha
    v_dc          : in    std_logic_vector(15 downto 0); -- dc-link voltage, unsigned
    current_limit : in    std_logic_vector(15 downto 0); -- of a phase current, unsigned, unit as is_alpha
    link_high     : in    std_logic_vector(15 downto 0); -- unsigned, unit as v_dc
    link_low      : in    std_logic_vector(15 downto 0); -- unsigned, unit as v_dc
    checked       : out   std_logic;                     -- '1': a measurement has been compared
    over_current  : out   std_logic;                     -- '1': a phase current was above current_limit
    over_voltage  : out   std_logic;                     -- '1': v_dc was above link_high
    under_voltage : out   std_logic                      -- '1': v_dc was below link_low
  );
end entity trip_comparator;

architecture rtl of trip_comparator is

  constant SUM_WIDTH       : natural               := 25;              -- 175 * 2**15 and a sign
  constant HIGHEST_CURRENT : natural               := 2 ** 15 - 1;     -- of a measurement along alpha
  constant HIGHEST_VOLTAGE : unsigned(15 downto 0) := (others => '1'); -- of a measurement

  subtype sum_t is signed(SUM_WIDTH - 1 downto 0);

  -- suffixes: clocks after measured
  signal valid_1 : std_logic;
  signal valid_2 : std_logic;
  signal count_1 : std_logic;
  signal count_2 : std_logic;
  signal alpha_1 : signed(15 downto 0);
  signal alpha_2 : signed(15 downto 0);
  signal beta_1  : sum_t; -- 111 i_beta
  signal b_2     : sum_t; -- -128 i_b
  signal c_2     : sum_t; -- -128 i_c
  signal high_1  : std_logic;
  signal high_2  : std_logic;
  signal low_1   : std_logic;
  signal low_2   : std_logic;
  signal beyond  : std_logic;

  -- '1': value lies above limit or below -limit; one comparison deep
  function outside (value : signed; limit : unsigned) return std_logic is

    variable bound : signed(value'length + 1 downto 0);
    variable above : signed(value'length + 1 downto 0);
    variable below : signed(value'length + 1 downto 0);

  begin

    bound := signed(resize(limit, value'length + 2));
    above := bound - resize(value, value'length + 2);
    below := bound + resize(value, value'length + 2);
    return above(above'left) or below(below'left);

  end function outside;

begin

  beyond <= outside(alpha_2, unsigned(current_limit))
            or outside(b_2, shift_left(resize(unsigned(current_limit), SUM_WIDTH), 7))
            or outside(c_2, shift_left(resize(unsigned(current_limit), SUM_WIDTH), 7))
            or to_std_logic(unsigned(current_limit) >= HIGHEST_CURRENT);

  p_compare : process (clk) is

    variable beta  : sum_t;
    variable alpha : sum_t;

  begin

    if rising_edge(clk) then
      valid_1 <= measured;
      count_1 <= measured and not forget;
      alpha_1 <= signed(is_alpha);
      beta    := resize(signed(is_beta), SUM_WIDTH);
      beta_1  <= shift_left(beta, 7) - (shift_left(beta, 4) + beta);
      high_1  <= to_std_logic(unsigned(v_dc) > unsigned(link_high) or unsigned(link_high) = HIGHEST_VOLTAGE);
      low_1   <= to_std_logic(unsigned(v_dc) < unsigned(link_low));

      valid_2 <= valid_1;
      count_2 <= count_1 and not forget;
      alpha_2 <= alpha_1;
      alpha   := shift_left(resize(alpha_1, SUM_WIDTH), 6);
      b_2     <= alpha - beta_1;
      c_2     <= alpha + beta_1;
      high_2  <= high_1;
      low_2   <= low_1;

      checked       <= count_2 and not forget;
      over_current  <= valid_2 and beyond;
      over_voltage  <= valid_2 and high_2;
      under_voltage <= valid_2 and low_2;

      if (rst = '1') then
        valid_1       <= '0';
        valid_2       <= '0';
        count_1       <= '0';
        count_2       <= '0';
        checked       <= '0';
        over_current  <= '0';
        over_voltage  <= '0';
        under_voltage <= '0';
      end if;
    end if;

  end process p_compare;

end architecture rtl;
