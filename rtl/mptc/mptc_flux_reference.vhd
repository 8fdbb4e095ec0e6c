-- MPFC's reference of the stator flux, in parts along the rotor flux and across it (Paper B, eqs. 18 to 21).
--
-- The part across the rotor flux makes the torque.  What is left of the reference's length is the part along it: the
-- square root of psi_ref**2 less the square of the part across.  Multiplied by |w|**2 no division and no arcsine is
-- needed.  Where the torque reference takes more than psi_ref, the part across becomes psi_ref and the part along
-- zero: the arcsine's argument is clamped to [-1, 1].
--
-- Formats: sum as in model/directmpc/mptc/formats.py, both squares times |w|**2; parts are words.
-- Latency: the parts are stable ROOT_WIDTH clocks after rest and stay so until the next square.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.mptc_constants.all;
  use work.mptc_types.all;

entity mptc_flux_reference is
  port (
    clk       : in    std_logic;       -- rising edge
    rst       : in    std_logic;       -- synchronous, active high
    square    : in    std_logic;       -- '1': sum is the square of the reference's length
    rest      : in    std_logic;       -- '1', a clock later: sum is that less the square of the part across
    sum       : in    sum_t;           -- accumulator, signed
    moment    : in    signed_word_t;   -- part across that the torque reference asks for, word
    target    : out   mptc_reference_t -- parts of the reference, and whether it was clamped
  );
end entity mptc_flux_reference;

architecture rtl of mptc_flux_reference is

  signal fits      : std_logic; -- the radicand is not negative
  signal load      : std_logic;
  signal root_bits : std_logic_vector(2 * ROOT_WIDTH - 1 downto 0);
  signal root      : std_logic_vector(ROOT_WIDTH - 1 downto 0);
  signal beyond    : std_logic;

begin

  fits      <= not sum(SUM_WIDTH - 1);
  load      <= square or (rest and fits);
  root_bits <= std_logic_vector(sum(2 * ROOT_WIDTH - 1 downto 0));

  i_root : entity work.mptc_root
    port map (
      clk      => clk,
      rst      => rst,
      load     => load,
      radicand => root_bits,
      root     => root
    );

  p_beyond : process (clk) is
  begin

    if rising_edge(clk) then
      if (rest = '1') then
        beyond <= not fits;
      end if;
    end if;

  end process p_beyond;

  p_parts : process (beyond, root, moment) is
  begin

    target.beyond <= beyond;
    target.along  <= '0' & root;
    target.across <= std_logic_vector(moment);

    if (beyond = '1') then
      target.along <= (others => '0');

      if (moment(WORD_WIDTH - 1) = '1') then
        target.across <= not ('0' & root);
      else
        target.across <= '0' & root;
      end if;
    end if;

  end process p_parts;

end architecture rtl;
