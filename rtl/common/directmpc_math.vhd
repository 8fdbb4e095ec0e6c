-- Arithmetic helpers with defined overflow.
--
-- numeric_std's resize of a signed value that does not fit keeps the sign bit and drops the rest;
-- no function here does that: clip saturates, and overflows tells beforehand.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

package directmpc_math is

  -- '1' where value does not fit width bits, two's complement
  function overflows (value : signed; width : positive) return std_logic;

  -- value in width bits, saturated
  function clip (value : signed; width : positive) return signed;

  -- magnitude, as many bits as value: never overflows
  function magnitude (value : signed) return unsigned;

  -- all bits of value where enable is '1', else zero
  function gated (value : signed; enable : std_logic) return signed;

  -- addend + value, addend - value, or addend; as long as addend, which has to hold the result
  function adjusted (addend, value : signed; plus, minus : std_logic) return signed;

  -- value, -value or zero
  function weighted (value : signed; positive_sign, negative_sign : std_logic) return signed;

  -- word number index of a bus (downto 0) of words of the given width, word 0 rightmost
  function word (words : std_logic_vector; index : natural; width : positive)
    return std_logic_vector;

  -- word number selector of a bus; zero where there is no such word
  function selected (words : std_logic_vector; selector : std_logic_vector; width : positive)
    return std_logic_vector;

  function to_std_logic (value : boolean) return std_logic;

  -- '1' for the lowest set bit only
  function first_of (bits : std_logic_vector) return std_logic_vector;

  -- yes where condition holds, else no; for constants that depend on generics
  function choose (condition : boolean; yes, no : integer) return integer;

  function choose (condition : boolean; yes, no : boolean) return boolean;

  function choose (condition : boolean; yes, no : std_logic) return std_logic;

  -- yes and no may differ in length
  function choose (condition : boolean; yes, no : std_logic_vector) return std_logic_vector;

  -- index of a variant in generated tables: 1 the paper's, 0 the fast one
  function variant_of (folded : boolean) return natural;

  function maximum_of (a, b : integer) return integer;

  -- bits that a selector of n words takes, at least one
  function selector_width (n : positive) return positive;

  -- clocks of a frequency in Hz that last so many nanoseconds at least; both up to 2 million and 1 GHz
  function clocks_in (nanoseconds, hertz : positive) return positive;

end package directmpc_math;

package body directmpc_math is

  function overflows (value : signed; width : positive) return std_logic is

    variable bits   : signed(value'length - 1 downto 0);
    variable result : std_logic;

  begin

    bits   := value;
    result := '0';

    for i in width - 1 to value'length - 1 loop
      result := result or (bits(i) xor bits(value'length - 1));
    end loop;

    return result;

  end function overflows;

  function clip (value : signed; width : positive) return signed is

    variable bits   : signed(value'length - 1 downto 0);
    variable result : signed(width - 1 downto 0);

  begin

    bits := value;

    if (value'length <= width) then
      result := resize(value, width);
    elsif (overflows(value, width) = '1') then
      result            := (others => not bits(value'length - 1));
      result(width - 1) := bits(value'length - 1);
    else
      result := bits(width - 1 downto 0);
    end if;

    return result;

  end function clip;

  function magnitude (value : signed) return unsigned is

    variable sign : std_logic_vector(0 downto 0);
    variable bits : std_logic_vector(value'length - 1 downto 0);

  begin

    -- complement and carry rather than a negation and a multiplexer: one LUT a bit
    sign := (others => value(value'high));
    bits := std_logic_vector(value) xor (value'length - 1 downto 0 => value(value'high));
    return unsigned(bits) + unsigned(sign);

  end function magnitude;

  function gated (value : signed; enable : std_logic) return signed is

    variable result : signed(value'length - 1 downto 0);

  begin

    result := value;

    for i in result'range loop
      result(i) := result(i) and enable;
    end loop;

    return result;

  end function gated;

  function adjusted (addend, value : signed; plus, minus : std_logic) return signed is

    variable left   : unsigned(addend'length downto 0);
    variable right  : unsigned(addend'length downto 0);
    variable result : unsigned(addend'length downto 0);

  begin

    -- complement and carry: the adder's own LUTs hold the sign
    left              := unsigned(addend) & minus;
    right             := unsigned(resize(value, addend'length)) & minus;

    for i in 1 to addend'length loop
      right(i) := (right(i) xor minus) and (plus or minus);
    end loop;

    result := left + right;
    return signed(result(addend'length downto 1));

  end function adjusted;

  function weighted (value : signed; positive_sign, negative_sign : std_logic) return signed is

    variable result : signed(value'length downto 0);

  begin

    result := resize(value, value'length + 1);

    if (negative_sign = '1') then
      result := -result;
    end if;

    return gated(result, positive_sign or negative_sign);

  end function weighted;

  function word (words : std_logic_vector; index : natural; width : positive)
    return std_logic_vector is

    variable result : std_logic_vector(width - 1 downto 0);

  begin

    result := words((index + 1) * width - 1 downto index * width);
    return result;

  end function word;

  function selected (words : std_logic_vector; selector : std_logic_vector; width : positive)
    return std_logic_vector is

    variable index  : natural;
    variable result : std_logic_vector(width - 1 downto 0);

  begin

    index := to_integer(unsigned(selector));

    -- and-or form: a four-input LUT holds two words of it, but only one 2:1 multiplexer
    result := (others => '0');

    for i in 0 to words'length / width - 1 loop
      if (index = i) then
        result := result or words((i + 1) * width - 1 downto i * width);
      end if;
    end loop;

    return result;

  end function selected;

  function to_std_logic (value : boolean) return std_logic is
  begin

    if (value) then
      return '1';
    else
      return '0';
    end if;

  end function to_std_logic;

  function first_of (bits : std_logic_vector) return std_logic_vector is

    variable result : std_logic_vector(bits'range);
    variable found  : std_logic;

  begin

    found := '0';

    for i in bits'low to bits'high loop
      result(i) := bits(i) and not found;
      found     := found or bits(i);
    end loop;

    return result;

  end function first_of;

  function choose (condition : boolean; yes, no : integer) return integer is
  begin

    if (condition) then
      return yes;
    else
      return no;
    end if;

  end function choose;

  function choose (condition : boolean; yes, no : boolean) return boolean is
  begin

    if (condition) then
      return yes;
    else
      return no;
    end if;

  end function choose;

  function choose (condition : boolean; yes, no : std_logic) return std_logic is
  begin

    if (condition) then
      return yes;
    else
      return no;
    end if;

  end function choose;

  function choose (condition : boolean; yes, no : std_logic_vector) return std_logic_vector is
  begin

    if (condition) then
      return yes;
    else
      return no;
    end if;

  end function choose;

  function variant_of (folded : boolean) return natural is
  begin

    return choose(folded, 1, 0);

  end function variant_of;

  function maximum_of (a, b : integer) return integer is
  begin

    if (a > b) then
      return a;
    else
      return b;
    end if;

  end function maximum_of;

  function selector_width (n : positive) return positive is

    variable result : positive;

  begin

    result := 1;

    while 2 ** result < n loop
      result := result + 1;
    end loop;

    return result;

  end function selector_width;

  function clocks_in (nanoseconds, hertz : positive) return positive is

    variable kilohertz : positive;

  begin

    -- rounded up twice, in steps that 31 bits hold
    kilohertz := (hertz - 1) / 1000 + 1;
    return (kilohertz / 1000) * nanoseconds / 1000 + ((kilohertz mod 1000) * nanoseconds
           + ((kilohertz / 1000) * nanoseconds mod 1000) * 1000 + 999_999) / 1_000_000;

  end function clocks_in;

end package body directmpc_math;
