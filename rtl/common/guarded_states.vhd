-- States that carry guard bits below the LSB of a word, and what Heun's method makes of them.
--
-- A step adds little to a state.  Guard bits keep what rounding to a word would lose.  A multiplier takes the
-- state without them.  All values are two's complement.  Nothing here overflows where a sum has room for what
-- begins it: see seed_of.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

package guarded_states is

  -- a state without its guard bits
  function coarse (value : signed; guard : natural) return std_logic_vector;

  -- the nearest word to a state whose last bits are cut off; of two, the larger; a bit longer than the rest of the
  -- state, which the largest states need
  function rounded (value : signed; cut : positive) return signed;

  -- half of what a state has moved from origin, without guard bits; as long as coarse
  function half_of (value, origin : signed; guard : natural) return std_logic_vector;

  -- first summand of a sum of the given width: value, shift bits to the left, and half of its LSB, which rounds
  -- the sum when those bits are cut off; width has to be value'length + shift or more
  function seed_of (value : signed; width, shift : positive) return std_logic_vector;

  -- first summand of a sum of the given width that is rounded by cutting off shift bits
  function half_lsb (width, shift : positive) return std_logic_vector;

  -- word of a bus (downto 0) of words, word 0 rightmost, whose bit of choice is '1'; at most one bit is, and
  -- without one the word is zero
  function chosen_word (words, choice : std_logic_vector) return std_logic_vector;

end package guarded_states;

package body guarded_states is

  function coarse (value : signed; guard : natural) return std_logic_vector is

    variable bits : signed(value'length - 1 downto 0);

  begin

    bits := value;
    return std_logic_vector(bits(value'length - 1 downto guard));

  end function coarse;

  function rounded (value : signed; cut : positive) return signed is

    variable sum : signed(value'length downto 0);

  begin

    sum := resize(value, value'length + 1) + 2 ** (cut - 1);
    return sum(value'length downto cut);

  end function rounded;

  function half_of (value, origin : signed; guard : natural) return std_logic_vector is

    variable moved : signed(value'length downto 0);

  begin

    moved := resize(value, value'length + 1) - resize(origin, value'length + 1);
    return std_logic_vector(moved(value'length downto guard + 1));

  end function half_of;

  function seed_of (value : signed; width, shift : positive) return std_logic_vector is

    variable result : signed(width - 1 downto 0);

  begin

    result            := shift_left(resize(value, width), shift);
    result(shift - 1) := '1';
    return std_logic_vector(result);

  end function seed_of;

  function half_lsb (width, shift : positive) return std_logic_vector is

    variable result : std_logic_vector(width - 1 downto 0);

  begin

    result            := (others => '0');
    result(shift - 1) := '1';
    return result;

  end function half_lsb;

  function chosen_word (words, choice : std_logic_vector) return std_logic_vector is

    constant COUNT : natural := choice'length;
    constant WIDTH : natural := words'length / COUNT;

    variable result : std_logic_vector(WIDTH - 1 downto 0);

  begin

    result := (others => '0');

    for i in 0 to COUNT - 1 loop
      result := result or (words((i + 1) * WIDTH - 1 downto i * WIDTH) and (WIDTH - 1 downto 0 => choice(i)));
    end loop;

    return result;

  end function chosen_word;

end package body guarded_states;
