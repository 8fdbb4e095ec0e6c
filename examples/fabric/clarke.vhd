-- Clarke's transformation of two phase currents, amplitude-invariant; the third is minus their sum.
--
--   alpha = a,  beta = (a + 2 b) / sqrt(3)
--
-- Formats: signed, 16 bits; 1/sqrt(3) is 18919/32768.
-- Latency: 2 clocks.
-- Overflow: beta saturates.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity clarke is
  port (
    clk   : in    std_logic;                     -- rising edge
    a     : in    std_logic_vector(15 downto 0); -- current of phase a, signed
    b     : in    std_logic_vector(15 downto 0); -- current of phase b, signed, unit as a
    alpha : out   std_logic_vector(15 downto 0); -- signed, unit as a
    beta  : out   std_logic_vector(15 downto 0)  -- signed, unit as a
  );
end entity clarke;

architecture rtl of clarke is

  constant SCALE : signed(15 downto 0) := to_signed(18919, 16); -- 2**15/sqrt(3)

  signal product : signed(33 downto 0);
  signal alpha_1 : std_logic_vector(15 downto 0); -- alpha a clock earlier

begin

  p_transform : process (clk) is

    variable sum     : signed(17 downto 0);
    variable rounded : signed(33 downto 0);
    variable whole   : signed(18 downto 0);

  begin

    if rising_edge(clk) then
      sum     := resize(signed(a), 18) + shift_left(resize(signed(b), 18), 1);
      product <= sum * SCALE;
      alpha_1 <= a;

      rounded := product + 2 ** 14;
      whole   := rounded(33 downto 15);

      if (whole < -2 ** 15) then
        whole := to_signed(-2 ** 15, 19);
      elsif (whole > 2 ** 15 - 1) then
        whole := to_signed(2 ** 15 - 1, 19);
      end if;

      alpha <= alpha_1;
      beta  <= std_logic_vector(whole(15 downto 0));
    end if;

  end process p_transform;

end architecture rtl;
