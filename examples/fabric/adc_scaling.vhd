-- A converter's word as a measurement of a core: offset and gain, rounded, saturated.
--
--   value = (word - offset) * gain
--
-- Formats: word and offset unsigned; gain unsigned, 8 fractional bits; value signed, or unsigned with POSITIVE.
-- Latency: 2 clocks.
-- Overflow: saturates.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity adc_scaling is
  generic (
    POSITIVE : boolean := false -- true: value is unsigned, a negative one is 0
  );
  port (
    clk    : in    std_logic;                     -- rising edge
    word   : in    std_logic_vector(11 downto 0); -- of the converter, unsigned
    offset : in    std_logic_vector(11 downto 0); -- word that means 0, unsigned
    gain   : in    std_logic_vector(15 downto 0); -- counts a step of the converter, unsigned, 8 fractional bits
    value  : out   std_logic_vector(15 downto 0)  -- measurement, signed; unsigned with POSITIVE
  );
end entity adc_scaling;

architecture rtl of adc_scaling is

  function lowest return integer is
  begin

    if (POSITIVE) then
      return 0;
    end if;

    return -2 ** 15;

  end function lowest;

  constant HIGHEST : integer := lowest + 2 ** 16 - 1;

  signal product : signed(29 downto 0);

begin

  p_scale : process (clk) is

    variable difference : signed(12 downto 0);
    variable rounded    : signed(30 downto 0);
    variable whole      : signed(22 downto 0);

  begin

    if rising_edge(clk) then
      difference := signed('0' & word) - signed('0' & offset);
      product    <= difference * signed('0' & gain);

      rounded := resize(product, 31) + 128;
      whole   := rounded(30 downto 8);

      if (whole < lowest) then
        whole := to_signed(lowest, 23);
      elsif (whole > HIGHEST) then
        whole := to_signed(HIGHEST, 23);
      end if;

      value <= std_logic_vector(whole(15 downto 0));
    end if;

  end process p_scale;

end architecture rtl;
