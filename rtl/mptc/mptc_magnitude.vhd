-- Distance of a vector's length from a reference length: | K*reference - K*|(x, y)| |.
--
-- CORDIC in vectoring mode without the angle: eight micro-rotations turn the vector onto the x axis,
-- where its length is K times what it was, K = 1.6467.  K*reference comes in as half of it, one
-- product of the reference with a constant, so that nothing has to be divided.
--
-- Formats: x, y 21 bits with 18 fractional ones (a guard bit below a word); half_reference a word
-- (18 bits, 17 fractional); difference 17 bits with 16 fractional ones, in units K times the flux's.
-- Error: the last rotation leaves an angle of at most atan(2^-7), which shortens the vector by 3.05e-5
-- of its length; K has half of that taken off, so +-1.53e-5 of the length remains.  Every rotation
-- drops less than one LSB of 2^-18 from x, and less than two from y, which moves x by at most 2^-6 of
-- that in the end; absolute values are one's complements, one LSB each; the difference is cut to
-- 2^-16.  Beside the relative error that is less than 16 * 2^-18 in K times the flux, 3.8e-5 of the
-- full scale.  The bench asserts the bound.  At 1 Wb and psi_max = 1.25 Wb: 63 uWb at most together,
-- 6.3 mN*m at k_psi = 100, and most of it is common to the vectors that are compared.
-- Latency: 5 clocks, initiation interval one clock.  Nothing holds the stages.
-- Overflow: none inside for components up to 1.5; a difference of 2 and more saturates, overflow says so.
-- y gets one bit narrower with each rotation, as its bound allows.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;

entity mptc_magnitude is
  port (
    clk            : in    std_logic;                                   -- rising edge
    rst            : in    std_logic;                                   -- synchronous, active high
    enable         : in    std_logic;                                   -- '1': x and y are given in this clock
    x              : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0); -- signed, 18 fractional bits, at most 1.5
    y              : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0); -- signed, 18 fractional bits, at most 1.5
    half_reference : in    std_logic_vector(WORD_WIDTH - 1 downto 0);   -- K*reference/2, word, not negative, stable
    valid          : out   std_logic;                                   -- '1': difference is new
    difference     : out   std_logic_vector(WORD_WIDTH - 1 downto 0);   -- not negative, 16 fractional bits, times K
    short          : out   std_logic;                                   -- '1': the length is below the reference
    overflow       : out   std_logic                                    -- '1': difference saturated
  );
end entity mptc_magnitude;

architecture rtl of mptc_magnitude is

  constant STAGES : natural := ITERATIONS / 2 + 1;

  subtype component_t is signed(LENGTH_WIDTH - 1 downto 0);

  -- registers behind micro-rotations 0, 2, 4 and 6; the last one shares its clock with the difference
  type components_t is array (0 to STAGES - 2) of component_t;

  procedure rotate (i : natural; variable u, v : inout component_t) is

    -- one micro-rotation; v stays within 2**(2 - i) and needs a bit less each time
    variable du   : component_t;
    variable dv   : component_t;
    variable sign : component_t;

  begin

    du   := shift_right(v, i);
    dv   := shift_right(u, i);
    sign := (others => v(LENGTH_WIDTH - 1));

    -- one's complement of what is taken off: one adder each, no carry to put in
    u := u + (du xor sign);
    v := resize(v(LENGTH_WIDTH - 1 - i downto 0)
                + (dv(LENGTH_WIDTH - 1 - i downto 0) xor not sign(LENGTH_WIDTH - 1 - i downto 0)), LENGTH_WIDTH);

  end procedure rotate;

  signal along     : components_t;
  signal aside     : components_t;
  signal enabled   : std_logic_vector(0 to STAGES - 1);
  signal error     : signed(WORD_WIDTH - 1 downto 0);
  signal too_large : std_logic;

begin

  p_rotate : process (clk) is

    variable u : component_t;
    variable v : component_t;

  begin

    if rising_edge(clk) then
      u := signed(x);
      v := signed(y);

      if (u(LENGTH_WIDTH - 1) = '1') then
        u := not u;
      end if;

      rotate(0, u, v);
      along(0) <= u;
      aside(0) <= v;

      for stage in 1 to STAGES - 2 loop
        u := along(stage - 1);
        v := aside(stage - 1);
        rotate(2 * stage - 1, u, v);
        rotate(2 * stage, u, v);
        along(stage) <= u;
        aside(stage) <= v;
      end loop;

    end if;

  end process p_rotate;

  p_difference : process (clk) is

    variable u    : component_t;
    variable v    : component_t;
    variable wide : signed(LENGTH_WIDTH downto 0);

  begin

    if rising_edge(clk) then
      u    := along(STAGES - 2);
      v    := aside(STAGES - 2);
      rotate(ITERATIONS - 1, u, v);
      wide := resize(u, LENGTH_WIDTH + 1)
              - shift_left(resize(signed(half_reference), LENGTH_WIDTH + 1), LENGTH_GUARD + 1);

      short <= wide(LENGTH_WIDTH);

      if (wide(LENGTH_WIDTH) = '1') then
        wide := not wide;
      end if;

      wide      := shift_right(wide, DIFFERENCE_SHIFT);
      too_large <= overflows(wide, WORD_WIDTH);
      error     <= clip(wide, WORD_WIDTH);
    end if;

  end process p_difference;

  p_enabled : process (clk) is
  begin

    if rising_edge(clk) then
      enabled <= enable & enabled(0 to STAGES - 2);

      if (rst = '1') then
        enabled <= (others => '0');
      end if;
    end if;

  end process p_enabled;

  valid      <= enabled(STAGES - 1);
  difference <= std_logic_vector(error);
  overflow   <= too_large;

end architecture rtl;
