-- What a voltage vector is to the controllers: its part of the steps along alpha and beta, and a port as a word.
--
-- u_1 and u_4 take the whole step along alpha and none along beta; u_2, u_3, u_5 and u_6 take half of the step
-- along alpha and the whole step along beta, of either sign; u_0 and u_7 take nothing (Paper B, Fig. 3).
-- Formats: numbers 0 to 7; words as in model/directmpc/mptc/formats.py.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;

package mptc_vectors is

  subtype vector_t is std_logic_vector(2 downto 0); -- number of a vector, unsigned

  subtype word_t is std_logic_vector(WORD_WIDTH - 1 downto 0); -- operand of a multiplier

  -- '1': the vector has a part along alpha
  function has_alpha (number : vector_t) return std_logic;

  -- '1': its part along alpha is the whole step, '0': half of it
  function whole_alpha (number : vector_t) return std_logic;

  -- '1': its part along alpha is negative
  function negative_alpha (number : vector_t) return std_logic;

  -- '1': the vector has a part along beta
  function has_beta (number : vector_t) return std_logic;

  -- '1': its part along beta is negative
  function negative_beta (number : vector_t) return std_logic;

  -- its part of twice the step along alpha: +-1/2, +-1/4 or 0
  function share_alpha (number : vector_t) return word_t;

  -- its part of twice the step along beta: +-1/2 or 0
  function share_beta (number : vector_t) return word_t;

  -- '1': u_7 takes fewer commutations from this vector than u_0 does
  function zero_is_u_7 (number : vector_t) return std_logic;

  -- active vector that stands some turns by 60 degrees on from another
  function turned (number : vector_t; turns : turn_t) return vector_t;

  -- switch states a, b, c of a vector
  function switches_of_vector (number : vector_t) return switches_t;

  -- a measurement as a word
  function as_word (value : std_logic_vector) return word_t;

  -- the dc-link voltage, which is unsigned, as a word
  function link_word (value : std_logic_vector) return word_t;

end package mptc_vectors;

package body mptc_vectors is

  function has_alpha (number : vector_t) return std_logic is
  begin

    return to_std_logic(number /= "000" and number /= "111");

  end function has_alpha;

  function whole_alpha (number : vector_t) return std_logic is
  begin

    return to_std_logic(number = "001" or number = "100");

  end function whole_alpha;

  function negative_alpha (number : vector_t) return std_logic is
  begin

    return to_std_logic(number = "011" or number = "100" or number = "101");

  end function negative_alpha;

  function has_beta (number : vector_t) return std_logic is
  begin

    return to_std_logic(number = "010" or number = "011" or number = "101" or number = "110");

  end function has_beta;

  function negative_beta (number : vector_t) return std_logic is
  begin

    return to_std_logic(number = "101" or number = "110");

  end function negative_beta;

  function share_alpha (number : vector_t) return word_t is

    variable result : word_t;

  begin

    result                        := (others => negative_alpha(number));
    result(FRACTION - 2 downto 0) := (others => '0');
    result(FRACTION - 2)          := has_alpha(number) and not whole_alpha(number);
    result(FRACTION - 1)          := has_alpha(number) and (whole_alpha(number) or negative_alpha(number));
    return result;

  end function share_alpha;

  function share_beta (number : vector_t) return word_t is

    variable result : word_t;

  begin

    result                        := (others => negative_beta(number));
    result(FRACTION - 1 downto 0) := (others => '0');
    result(FRACTION - 1)          := has_beta(number);
    return result;

  end function share_beta;

  function zero_is_u_7 (number : vector_t) return std_logic is
  begin

    return ZERO_IS_SEVEN(to_integer(unsigned(number)));

  end function zero_is_u_7;

  function turned (number : vector_t; turns : turn_t) return vector_t is

    variable result : unsigned(3 downto 0);

  begin

    result := unsigned('0' & number) + unsigned(turns);

    if (result > 6) then
      result := result - 6;
    end if;

    return std_logic_vector(result(2 downto 0));

  end function turned;

  function switches_of_vector (number : vector_t) return switches_t is
  begin

    return SWITCHES_OF(to_integer(unsigned(number)));

  end function switches_of_vector;

  function as_word (value : std_logic_vector) return word_t is
  begin

    return std_logic_vector(shift_left(resize(signed(value), WORD_WIDTH), MEASUREMENT_SHIFT));

  end function as_word;

  function link_word (value : std_logic_vector) return word_t is
  begin

    return std_logic_vector(shift_left(resize(unsigned(value), WORD_WIDTH), LINK_SHIFT));

  end function link_word;

end package body mptc_vectors;
