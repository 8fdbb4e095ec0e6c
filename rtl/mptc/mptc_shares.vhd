-- Mean shares of sequences of vectors in the steps along alpha and beta: of the one that is being applied, then of
-- pairs whose duty has been found. mptc_mean_share forms the first alone, in one clock.
--
-- A vector takes +-1/2, +-1/4 or nothing of twice the step along alpha, +-1/2 or nothing of twice the step along beta
-- (mptc_vectors). The share of three vectors is the third's, plus those of the others times their time, less the
-- third's times the same. These are four steps, a clock each. A pair is the second vector's share plus the direction's
-- times the duty, one step. Nothing is rounded: a time has 12 bits, a word 17 fractional ones.
--
-- Formats: sequence as in mptc_types, t1 + t2 at most 4096; shares are words.
-- Latency: five clocks from begin_mean; one clock from found.take, which stays away until then and comes every second
-- clock at most: the products of a share are begun in two clocks.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_shares is
  port (
    clk        : in    std_logic;       -- rising edge
    begin_mean : in    std_logic;       -- '1': running is what is being applied, from the next clock on
    running    : in    mptc_sequence_t; -- what is being applied, stable
    found      : in    mptc_duty_t;     -- a pair with its duty
    alpha      : out   word_t;          -- share of twice the step along alpha, signed
    beta       : out   word_t           -- share of twice the step along beta, signed
  );
end entity mptc_shares;

architecture rtl of mptc_shares is

  constant SUM_BITS : positive := TIME_WIDTH + 4;

  subtype share_t is signed(SUM_BITS - 1 downto 0);

  signal active      : std_logic;            -- '1': a step of the running sequence
  signal step        : unsigned(1 downto 0);
  signal whole       : vector_t;             -- vector whose share is taken whole
  signal number      : vector_t;             -- vector whose share is taken for a time
  signal time_of     : time_t;
  signal fresh       : std_logic;            -- '1': nothing has been added up
  signal less        : std_logic;            -- '1': that share is taken away
  signal total_alpha : share_t;
  signal total_beta  : share_t;

begin

  p_steps : process (clk) is
  begin

    if rising_edge(clk) then
      if (active = '1') then
        step <= step + 1;

        if (step = 3) then
          active <= '0';
        end if;
      end if;

      if (begin_mean = '1') then
        active <= '1';
        step   <= (others => '0');
      end if;
    end if;

  end process p_steps;

  p_choice : process (active, step, running, found) is
  begin

    whole   <= found.second;
    number  <= found.direction;
    time_of <= '0' & found.duty;
    fresh   <= '1';
    less    <= '0';

    if (active = '1') then
      whole   <= running.u3;
      time_of <= running.t1;
      number  <= running.u3;
      fresh   <= to_std_logic(step = 0);
      less    <= step(0);

      if (step(1) = '1') then
        time_of <= running.t2;
      end if;

      if (step = 0) then
        number <= running.u1;
      elsif (step = 2) then
        number <= running.u2;
      end if;
    end if;

  end process p_choice;

  p_sum : process (clk) is

    variable base : share_t;
    variable part : share_t;

  begin

    if rising_edge(clk) then
      if (active = '1' or found.take = '1') then
        base := total_alpha;

        if (fresh = '1') then
          base                          := (others => negative_alpha(whole));
          base(TIME_WIDTH - 1 downto 0) := (others => '0');
          base(TIME_WIDTH)              := has_alpha(whole) and not whole_alpha(whole);
          base(TIME_WIDTH + 1)          := negative_alpha(whole) or whole_alpha(whole);
        end if;

        part := signed(resize(unsigned(time_of), SUM_BITS));

        if (whole_alpha(number) = '1') then
          part := shift_left(part, 1);
        end if;

        total_alpha <= moved(base, gated(part, has_alpha(number)), negative_alpha(number) xor less);

        base := total_beta;

        if (fresh = '1') then
          base                          := (others => negative_beta(whole));
          base(TIME_WIDTH - 1 downto 0) := (others => '0');
          base(TIME_WIDTH)              := has_beta(whole);
        end if;

        part       := signed(resize(unsigned(time_of), SUM_BITS));
        total_beta <= moved(base, gated(part, has_beta(number)), negative_beta(number) xor less);
      end if;
    end if;

  end process p_sum;

  alpha <= std_logic_vector(shift_left(resize(total_alpha, WORD_WIDTH), FRACTION - 2 - TIME_WIDTH));
  beta  <= std_logic_vector(shift_left(resize(total_beta, WORD_WIDTH), FRACTION - 1 - TIME_WIDTH));

end architecture rtl;
