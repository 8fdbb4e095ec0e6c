-- Mean share of a running sequence of vectors in the steps along alpha and beta.
--
-- A vector takes +-1/2, +-1/4 or nothing of twice the step along alpha, +-1/2 or nothing of twice the step along beta
-- (mptc_vectors). Three vectors with their times take the mean: each time is added, shifted or not, with the sign of
-- its vector. Nothing is rounded: a time has 12 bits, a word 17 fractional ones.
--
-- Formats: sequence as in mptc_types, t1 + t2 at most 4096; shares are words.
-- Latency: one clock.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.mptc_constants.all;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_mean_share is
  port (
    clk     : in    std_logic;       -- rising edge
    running : in    mptc_sequence_t; -- what is being applied
    alpha   : out   word_t;          -- share of twice the step along alpha, signed
    beta    : out   word_t           -- share of twice the step along beta, signed
  );
end entity mptc_mean_share;

architecture rtl of mptc_mean_share is

  constant SUM_BITS : positive := TIME_WIDTH + 4;

  subtype share_t is signed(SUM_BITS - 1 downto 0);

  -- part of a vector in the sum along alpha: its time, twice for a whole share
  function part_alpha (number : vector_t; time_of : unsigned) return share_t is

    variable part : share_t;

  begin

    part := signed(resize(time_of, SUM_BITS));

    if (whole_alpha(number) = '1') then
      part := shift_left(part, 1);
    elsif (has_alpha(number) = '0') then
      part := (others => '0');
    end if;

    return part;

  end function part_alpha;

  -- part of a vector in the sum along beta
  function part_beta (number : vector_t; time_of : unsigned) return share_t is
  begin

    if (has_beta(number) = '1') then
      return signed(resize(time_of, SUM_BITS));
    else
      return (others => '0');
    end if;

  end function part_beta;

begin

  p_sum : process (clk) is

    variable t1    : unsigned(TIME_WIDTH downto 0);
    variable t2    : unsigned(TIME_WIDTH downto 0);
    variable t3    : unsigned(TIME_WIDTH downto 0);
    variable total : share_t;

  begin

    if rising_edge(clk) then
      t1 := unsigned(running.t1);
      t2 := unsigned(running.t2);
      t3 := to_unsigned(2 ** TIME_WIDTH, TIME_WIDTH + 1) - t1 - t2;

      total := moved((share_t'range => '0'), part_alpha(running.u1, t1), negative_alpha(running.u1));
      total := moved(total, part_alpha(running.u2, t2), negative_alpha(running.u2));
      total := moved(total, part_alpha(running.u3, t3), negative_alpha(running.u3));
      alpha <= std_logic_vector(shift_left(resize(total, WORD_WIDTH), FRACTION - 2 - TIME_WIDTH));

      total := moved((share_t'range => '0'), part_beta(running.u1, t1), negative_beta(running.u1));
      total := moved(total, part_beta(running.u2, t2), negative_beta(running.u2));
      total := moved(total, part_beta(running.u3, t3), negative_beta(running.u3));
      beta  <= std_logic_vector(shift_left(resize(total, WORD_WIDTH), FRACTION - 1 - TIME_WIDTH));
    end if;

  end process p_sum;

end architecture rtl;
