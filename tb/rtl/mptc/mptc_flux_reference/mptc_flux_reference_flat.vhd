-- mptc_flux_reference with vectors for its record and its signed ports.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.mptc_constants.all;
  use directmpc.mptc_types.all;

entity mptc_flux_reference_flat is
  port (
    clk    : in    std_logic;                                 -- rising edge
    rst    : in    std_logic;                                 -- synchronous, active high
    square : in    std_logic;                                 -- '1': sum is the square of the reference's length
    rest   : in    std_logic;                                 -- '1': sum is what is left of it
    sum    : in    std_logic_vector(SUM_WIDTH - 1 downto 0);  -- signed
    moment : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- part across that is asked for, signed
    along  : out   std_logic_vector(WORD_WIDTH - 1 downto 0); -- of target, word
    across : out   std_logic_vector(WORD_WIDTH - 1 downto 0); -- likewise
    beyond : out   std_logic                                  -- '1': the reference was clamped
  );
end entity mptc_flux_reference_flat;

architecture bench of mptc_flux_reference_flat is

  signal target : mptc_reference_t;

begin

  i_reference : entity directmpc.mptc_flux_reference
    port map (
      clk    => clk,
      rst    => rst,
      square => square,
      rest   => rest,
      sum    => signed(sum),
      moment => signed(moment),
      target => target
    );

  along  <= target.along;
  across <= target.across;
  beyond <= target.beyond;

end architecture bench;
