-- Flux control with two and three vectors a period: MPFC2, MPFC3, MPC2 and SVM (Paper B, sections 5.3, 6.2 and 7).
--
-- mptc_coordinates brings what is missing to MPFC's reference vector into coordinates along two voltage vectors;
-- mptc_choices finds the second vector and its time. Here stands which vector is the first, and what a choice means
-- to each method: MPFC2 goes on with the last vector, MPFC3 with the last active one, then zero voltage; MPC2 begins
-- with the vector nearest to e, or with the second where that takes fewer commutations; SVM takes the two beside e.
--
-- Formats: as in mptc_types; times 1/4096 of the period.
-- Latency: chosen is valid with last, HEXAGON_CLOCKS - 1 clocks after rest.
-- Overflow: far tells that e was halved; nothing wraps.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_hexagon is
  port (
    clk       : in    std_logic;       -- rising edge
    rst       : in    std_logic;       -- synchronous, active high
    method    : in    family_t;        -- a flux method, or another: then chosen means nothing; stable
    running   : in    mptc_sequence_t; -- what is being applied, stable
    way_alpha : in    std_logic;       -- '1': sum is the way of u_1 along alpha
    way_beta  : in    std_logic;       -- '1': sum is the way of u_2 along beta
    sum       : in    sum_t;           -- accumulator, signed
    rest      : in    std_logic;       -- '1': -e is in the following two
    sum_alpha : in    sum_t;           -- accumulator, signed; later the square of a distance
    sum_beta  : in    sum_t;           -- accumulator, signed
    last      : in    std_logic;       -- '1': the last choice has been compared
    residues  : out   mptc_residues_t; -- operands of the squares
    chosen    : out   mptc_sequence_t; -- what to apply next; with last
    far       : out   std_logic        -- '1': e was so long that it was halved
  );
end entity mptc_hexagon;

architecture rtl of mptc_hexagon is

  constant PART_SHIFT : natural := HEXAGON_FRACTION - TIME_WIDTH;

  subtype steps_t is unsigned(TIME_WIDTH downto 0);

  signal clock    : natural range 0 to HEXAGON_CLOCKS;
  signal ended    : vector_t;                                  -- vector that is applied last
  signal base     : vector_t;                                  -- first active vector of MPFC2 and MPFC3
  signal leader   : vector_t;
  signal row      : vector_t;                                  -- first vector
  signal idle     : std_logic;                                 -- '1': it is a zero vector
  signal e        : mptc_missing_t;
  signal share    : std_logic_vector(TIME_WIDTH - 1 downto 0);
  signal best     : mptc_choice_t;
  signal size_h   : steps_t;                                   -- h, its complement where negative; SVM: the second time
  signal beyond   : std_logic;                                 -- g and h fill more than the period
  signal flat     : std_logic;                                 -- h is zero
  signal is_svm   : std_logic;                                 -- '1': the method is SVM
  signal is_mpfc3 : std_logic;
  signal is_mpfc2 : std_logic;
  signal leading  : steps_t; -- SVM: time of the leading vector
  signal left     : steps_t; -- what that leaves of the period
  signal first    : steps_t; -- time of the leading vector, of a spoke the other's
  signal unspent  : steps_t; -- what is left to it and to the last
  signal rest_t   : steps_t; -- what it leaves of that

  -- '1': u_1 to u_6
  function is_active (number : vector_t) return std_logic is
  begin

    return has_alpha(number);

  end function is_active;

  -- vector that is applied last
  function last_of (given : mptc_sequence_t) return vector_t is

    variable sum_of_two : steps_t;

  begin

    sum_of_two := unsigned(given.t1) + unsigned(given.t2);

    if (sum_of_two(TIME_WIDTH) = '0') then
      return given.u3;
    elsif (unsigned(given.t2) /= 0) then
      return given.u2;
    else
      return given.u1;
    end if;

  end function last_of;

  -- active vector that is applied last
  function last_active_of (given : mptc_sequence_t) return vector_t is

    variable sum_of_two : steps_t;

  begin

    sum_of_two := unsigned(given.t1) + unsigned(given.t2);

    if (sum_of_two(TIME_WIDTH) = '0' and is_active(given.u3) = '1') then
      return given.u3;
    elsif (unsigned(given.t2) /= 0 and is_active(given.u2) = '1') then
      return given.u2;
    elsif (is_active(given.u1) = '1') then
      return given.u1;
    elsif (is_active(given.u2) = '1') then
      return given.u2;
    elsif (is_active(given.u3) = '1') then
      return given.u3;
    else
      return "001";
    end if;

  end function last_active_of;

begin

  ---------------------------------------------------------------------------------------------
  -- Clocks and first vectors
  ---------------------------------------------------------------------------------------------

  p_clock : process (clk) is
  begin

    if rising_edge(clk) then
      if (clock /= 0 and clock /= HEXAGON_CLOCKS) then
        clock <= clock + 1;
      end if;

      if (rest = '1') then
        clock <= 1;
      end if;

      if (rst = '1' or last = '1') then
        clock <= 0;
      end if;
    end if;

  end process p_clock;

  p_first : process (clk) is

    variable vector : vector_t;

  begin

    if rising_edge(clk) then
      if (rest = '1') then
        vector := last_of(running);
        ended  <= vector;
        base   <= vector;

        if (is_active(vector) = '0') then
          base <= "001";
        end if;

        if (method = FAMILY_MPFC3) then
          base <= last_active_of(running);
        end if;
      end if;
    end if;

  end process p_first;

  -- a clock late: the leading vector is there a clock before the first choice looks at it
  p_row : process (clk) is
  begin

    if rising_edge(clk) then
      row  <= leader;
      idle <= '0';

      if (method = FAMILY_MPFC2) then
        row  <= ended;
        idle <= not is_active(ended);
      end if;
    end if;

  end process p_row;

  i_coordinates : entity work.mptc_coordinates
    port map (
      clk       => clk,
      way_alpha => way_alpha,
      way_beta  => way_beta,
      sum       => sum,
      rest      => rest,
      sum_alpha => sum_alpha,
      sum_beta  => sum_beta,
      clock     => clock,
      method    => method,
      base      => base,
      leader    => leader,
      missing   => e,
      share     => share,
      far       => far
    );

  i_choices : entity work.mptc_choices
    port map (
      clk      => clk,
      clock    => clock,
      method   => method,
      row      => row,
      idle     => idle,
      leader   => leader,
      ended    => ended,
      missing  => e,
      sum      => sum_alpha,
      residues => residues,
      best     => best
    );

  ---------------------------------------------------------------------------------------------
  -- What the nearest choice means
  ---------------------------------------------------------------------------------------------

  -- e is stable long before the last choice
  p_ahead : process (clk) is
  begin

    if rising_edge(clk) then
      size_h <= unsigned(e.h(HEXAGON_FRACTION downto PART_SHIFT) xor (TIME_WIDTH downto 0 => sign_of(e.h)));
      beyond <= beyond_one(e.total);
      flat   <= to_std_logic(e.h = 0);

      is_svm   <= to_std_logic(method = FAMILY_SVM);
      is_mpfc3 <= to_std_logic(method = FAMILY_MPFC3);
      is_mpfc2 <= to_std_logic(method = FAMILY_MPFC2);

      leading <= unsigned(e.g(HEXAGON_FRACTION downto PART_SHIFT));
      left    <= unsigned(WHOLE_PERIOD) - size_h;

      if (is_svm = '1' and beyond = '1') then
        leading <= '0' & unsigned(share);
        left    <= unsigned(WHOLE_PERIOD);

        if (flat = '1') then
          leading <= unsigned(WHOLE_PERIOD);
        end if;
      end if;
    end if;

  end process p_ahead;

  -- after the last choice: one of these, and one subtraction
  p_times : process (is_svm, is_mpfc3, is_mpfc2, best, e, leading, left) is
  begin

    first   <= unsigned(best.part);
    unspent <= unsigned(WHOLE_PERIOD);

    if (is_svm = '1') then
      first   <= leading;
      unspent <= left;
    elsif (is_mpfc3 = '1' and best.kind = KIND_INSIDE) then
      first   <= unsigned(e.total(HEXAGON_FRACTION downto PART_SHIFT));
      unspent <= left;

      if (best.beside = '1') then
        first <= leading;
      end if;
    elsif (is_mpfc2 = '1' and best.number = "000") then
      first <= (others => '0');
    end if;

  end process p_times;

  rest_t <= unspent - first;

  p_chosen : process (is_svm, is_mpfc3, is_mpfc2, row, leader, idle, best, first, size_h, rest_t, beyond) is
  begin

    chosen.u1 <= row;
    chosen.u2 <= best.other;
    chosen.u3 <= best.other;
    chosen.t1 <= std_logic_vector(first);
    chosen.t2 <= std_logic_vector(rest_t);

    if (is_svm = '1') then
      chosen.u2 <= turned(leader, "001");
      chosen.u3 <= "000";

      if (beyond = '0') then
        chosen.t2 <= std_logic_vector(size_h);
      end if;
    elsif (is_mpfc3 = '1') then
      -- u_7 takes fewer commutations between two vectors of even number
      chosen.u2 <= (others => zero_is_u_7(row) and zero_is_u_7(best.other));

      if (best.kind = KIND_SPOKE) then
        chosen.t1 <= (others => '0');
      elsif (best.kind = KIND_EDGE) then
        chosen.t2 <= (others => '0');
      end if;
    elsif (is_mpfc2 = '1') then
      -- on a spoke from zero voltage the time is the other vector's
      if (idle = '1' and best.number /= "000") then
        chosen.t1 <= std_logic_vector(rest_t);
        chosen.t2 <= std_logic_vector(first);
      end if;
    elsif (best.fewer = '1') then
      chosen.u1 <= best.other;
      chosen.u2 <= row;
      chosen.u3 <= row;
      chosen.t1 <= std_logic_vector(rest_t);
      chosen.t2 <= std_logic_vector(first);
    end if;

  end process p_chosen;

end architecture rtl;
