-- What is missing to MPFC's reference vector, e, in coordinates of the voltage vectors (Paper B, eqs. 17 to 21).
--
-- e = psi_s,ref - base and the ways of u_1 along alpha and of u_2 along beta come as sums of products, all times the
-- same factor, which drops out of the quotients x and y. A long e is halved until both are in range. Along u_1 and u_2
-- it has the coordinates g = 2*x - y and h = 2*y, in units of a vector's way. A turn by 60 degrees makes (g, h) into
-- (g + h, -g) in the coordinates of the next two vectors: e is turned until the leading vector stands where u_1 does.
-- The sum g + h turns along: it becomes the next g, and h the next sum. So a turn takes one negation and no sum.
-- For SVM outside the hexagon a third division gives the time of the first vector, g/(g + h).
--
-- Formats: sums as in mptc_types; all of missing signed with HEXAGON_FRACTION fractional bits; share
-- 1/4096 of the period, unsigned, cut off.
-- Latency: counted by clock from the clock of rest on: quotients from DIVISION_CLOCK on, turned from
-- CHOICE_CLOCK on, share TIME_WIDTH + 1 clocks later.
-- Overflow: e longer than QUOTIENT_RANGE doublings of the way sets far and keeps its direction down to HALVINGS
-- halvings; beyond them, or without a way, a coordinate becomes the largest.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_coordinates is
  port (
    clk       : in    std_logic;                          -- rising edge
    way_alpha : in    std_logic;                          -- '1': sum is the way of u_1 along alpha
    way_beta  : in    std_logic;                          -- '1': sum is the way of u_2 along beta
    sum       : in    sum_t;                              -- accumulator, signed
    rest      : in    std_logic;                          -- '1': -e is in the following two
    sum_alpha : in    sum_t;                              -- accumulator, signed
    sum_beta  : in    sum_t;                              -- accumulator, signed
    clock     : in    natural range 0 to HEXAGON_CLOCKS;  -- clocks since rest; 0: none is counted
    method    : in    family_t;                           -- a flux method, stable
    base      : in    vector_t;                           -- MPFC2, MPFC3: vector to turn to, stable after rest
    leader    : out   vector_t;                           -- vector that stands where u_1 does
    missing   : out   mptc_missing_t;                     -- e
    share     : out   std_logic_vector(TIME_WIDTH - 1 downto 0); -- g/total of a g below total
    far       : out   std_logic                           -- '1': e was halved
  );
end entity mptc_coordinates;

architecture rtl of mptc_coordinates is

  subtype size_t is std_logic_vector(SIZE_WIDTH - 1 downto 0);

  subtype step_t is std_logic_vector(STEP_WIDTH - 1 downto 0);

  subtype quotient_t is std_logic_vector(QUOTIENT_BITS - 1 downto 0);

  constant SIZE_SHIFT : natural := SUM_WIDTH - 1 - SIZE_WIDTH; -- low bits of a sum that are dropped

  signal way_x      : step_t;
  signal way_y      : step_t;
  signal size_x     : size_t;
  signal size_y     : size_t;
  signal negative_x : std_logic;
  signal negative_y : std_logic;
  signal beyond_x   : std_logic;
  signal beyond_y   : std_logic;
  signal quotient_x : quotient_t;
  signal quotient_y : quotient_t;
  signal again      : std_logic; -- '1': begin SVM's division
  signal load_x     : std_logic;
  signal fitting    : std_logic; -- '1': e may be halved
  signal halve      : std_logic;
  signal step       : std_logic;
  signal e          : mptc_missing_t;
  signal at         : vector_t;
  signal there      : std_logic; -- '1': turned far enough
  signal halved     : std_logic;
  signal none       : std_logic; -- '1': e is zero
  signal turned_h   : hexagon_t; -- h after the next turn
  signal apart      : form_t;    -- g - h: not negative where this vector is not behind the next one
  signal by_next    : form_t;    -- g + 2*h: the same of the one before

  -- size of a sum, one's complement where it is negative
  function size_of (value : sum_t) return size_t is

    variable bits : std_logic_vector(SUM_WIDTH - 1 downto 0);

  begin

    bits := std_logic_vector(value) xor (SUM_WIDTH - 1 downto 0 => value(SUM_WIDTH - 1));
    return bits(SUM_WIDTH - 2 downto SIZE_SHIFT);

  end function size_of;

begin

  ---------------------------------------------------------------------------------------------
  -- Quotients
  ---------------------------------------------------------------------------------------------

  again  <= to_std_logic(method = FAMILY_SVM and clock = CHOICE_CLOCK);
  load_x <= rest or again;
  size_y <= size_of(sum_beta);

  p_size : process (again, sum_alpha, e) is
  begin

    size_x <= size_of(sum_alpha);

    if (again = '1') then
      size_x <= std_logic_vector(shift_left(resize(unsigned(e.g), SIZE_WIDTH), QUOTIENT_RANGE));
    end if;

  end process p_size;

  p_ways : process (clk) is
  begin

    if rising_edge(clk) then
      if (way_alpha = '1') then
        way_x <= std_logic_vector(sum(REST_SHIFT + STEP_WIDTH - 1 downto REST_SHIFT));
      end if;

      if (way_beta = '1') then
        way_y <= std_logic_vector(sum(REST_SHIFT + STEP_WIDTH - 1 downto REST_SHIFT));
      end if;

      if (again = '1') then
        way_x <= std_logic_vector(resize(e.total, STEP_WIDTH));
      end if;

      -- the sum is that of -e
      if (rest = '1') then
        negative_x <= not sum_alpha(SUM_WIDTH - 1);
        negative_y <= not sum_beta(SUM_WIDTH - 1);
      end if;
    end if;

  end process p_ways;

  -- what the next clock is for
  p_phases : process (clk) is
  begin

    if rising_edge(clk) then
      fitting <= rest or to_std_logic(clock >= 1 and clock < HALVINGS);
      step    <= to_std_logic((clock >= DIVISION_CLOCK - 1 and clock < DIVISION_CLOCK + QUOTIENT_BITS - 1)
                              or (clock >= CHOICE_CLOCK and clock < CHOICE_CLOCK + TIME_WIDTH));
    end if;

  end process p_phases;

  halve <= fitting and (beyond_x or beyond_y);

  i_quotient_x : entity work.mptc_quotient
    port map (
      clk      => clk,
      load     => load_x,
      dividend => size_x,
      way      => way_x,
      halve    => halve,
      step     => step,
      beyond   => beyond_x,
      quotient => quotient_x
    );

  i_quotient_y : entity work.mptc_quotient
    port map (
      clk      => clk,
      load     => rest,
      dividend => size_y,
      way      => way_y,
      halve    => halve,
      step     => step,
      beyond   => beyond_y,
      quotient => quotient_y
    );

  share <= quotient_x(TIME_WIDTH - 1 downto 0);

  ---------------------------------------------------------------------------------------------
  -- Coordinates
  ---------------------------------------------------------------------------------------------

  turned_h <= -e.g;
  apart    <= resize(e.g, form_t'length) - e.h;
  by_next  <= resize(e.total, form_t'length) + e.h;

  p_there : process (method, at, base, e, apart, by_next, turned_h, none) is
  begin

    there <= to_std_logic(at = base);

    if (method = FAMILY_MPC2) then
      there <= not sign_of(apart) and not sign_of(by_next);
    elsif (method = FAMILY_SVM) then
      there <= not sign_of(e.h) and (sign_of(turned_h) or none);
    end if;

  end process p_there;

  p_turn : process (clk) is

    variable size : form_t; -- of the quotient along beta
    variable x    : form_t; -- twice the quotient along alpha

  begin

    if rising_edge(clk) then
      if (rest = '1') then
        halved <= '0';
        at     <= "001";
      end if;

      if (halve = '1') then
        halved <= '1';
      end if;

      if (clock = TURN_CLOCK - 1) then
        none      <= to_std_logic(unsigned(quotient_x) = 0 and unsigned(quotient_y) = 0);
        size      := signed(resize(unsigned(quotient_y), HEXAGON_WIDTH + 1));
        x         := moved((HEXAGON_WIDTH downto 0 => '0'),
                           signed(resize(unsigned(quotient_x & '0'), HEXAGON_WIDTH + 1)), negative_x);
        e.g     <= resize(moved(x, size, not negative_y), HEXAGON_WIDTH);
        e.h     <= moved((HEXAGON_WIDTH - 1 downto 0 => '0'),
                         signed(resize(unsigned(quotient_y & '0'), HEXAGON_WIDTH)), negative_y);
        e.total <= resize(moved(x, size, negative_y), HEXAGON_WIDTH);
      elsif (clock >= TURN_CLOCK and clock < CHOICE_CLOCK and there = '0') then
        e.g     <= e.total;
        e.h     <= turned_h;
        e.total <= e.h;
        at      <= std_logic_vector(unsigned(at) + 1);
      end if;
    end if;

  end process p_turn;

  leader  <= at;
  missing <= e;
  far     <= halved;

end architecture rtl;
