-- Compares phase currents and dc-link voltage with their trip levels, in one clock and without a
-- multiplier.
--
--   i_a = i_alpha,  2 i_b = -i_alpha + sqrt(3) i_beta,  2 i_c = -i_alpha - sqrt(3) i_beta
--
-- with 111/64 for sqrt(3), 0.13 % more than it is: |64 i_alpha -+ 111 i_beta| is compared with 128 limits.
--
-- Formats: currents signed, 16 bits; limits unsigned in the same unit; v_dc and its limits unsigned.
-- A limit of zero trips at any current that is not zero.
-- Latency: none, combinational: the gates have to be off after the next edge.
-- Overflow: none; the sums have all the bits they need.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;

entity trip_comparator is
  port (
    measured      : in    std_logic;                     -- '1': the measurements are new
    is_alpha      : in    std_logic_vector(15 downto 0); -- stator current, signed
    is_beta       : in    std_logic_vector(15 downto 0); -- stator current, signed, unit as is_alpha
    v_dc          : in    std_logic_vector(15 downto 0); -- dc-link voltage, unsigned
    current_limit : in    std_logic_vector(15 downto 0); -- of a phase current, unsigned, unit as is_alpha
    link_high     : in    std_logic_vector(15 downto 0); -- unsigned, unit as v_dc
    link_low      : in    std_logic_vector(15 downto 0); -- unsigned, unit as v_dc
    over_current  : out   std_logic;                     -- '1': a phase current is above current_limit
    over_voltage  : out   std_logic;                     -- '1': v_dc is above link_high
    under_voltage : out   std_logic                      -- '1': v_dc is below link_low
  );
end entity trip_comparator;

architecture rtl of trip_comparator is

  constant SUM_WIDTH : natural := 25; -- 175 * 2**15 and a sign

  signal limit : unsigned(SUM_WIDTH - 1 downto 0);
  signal a     : signed(SUM_WIDTH - 1 downto 0);
  signal b     : signed(SUM_WIDTH - 1 downto 0);
  signal c     : signed(SUM_WIDTH - 1 downto 0);

begin

  p_phases : process (is_alpha, is_beta) is

    variable alpha : signed(SUM_WIDTH - 1 downto 0);
    variable beta  : signed(SUM_WIDTH - 1 downto 0);

  begin

    alpha := shift_left(resize(signed(is_alpha), SUM_WIDTH), 6);
    beta  := resize(signed(is_beta), SUM_WIDTH);
    beta  := shift_left(beta, 7) - shift_left(beta, 4) - beta;
    a     <= shift_left(alpha, 1);
    b     <= alpha - beta;
    c     <= alpha + beta;

  end process p_phases;

  limit <= shift_left(resize(unsigned(current_limit), SUM_WIDTH), 7);

  over_current  <= measured and to_std_logic(magnitude(a) > limit or magnitude(b) > limit or magnitude(c) > limit);
  over_voltage  <= measured and to_std_logic(unsigned(v_dc) > unsigned(link_high));
  under_voltage <= measured and to_std_logic(unsigned(v_dc) < unsigned(link_low));

end architecture rtl;
