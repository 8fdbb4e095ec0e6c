-- Delays a word by a fixed number of clocks.
--
-- A ring of CLOCKS - 1 words in a memory, each read just before it is overwritten, and one register.
-- The place in the ring is a shift register with one bit fed back, a LUT instead of a counter's chain
-- and comparison: any order of the places will do, and there is a cycle of every length.
-- Formats: any.
-- Latency: CLOCKS clocks; initiation interval one clock.
-- Overflow: none. What comes out before CLOCKS clocks have passed since power-up is void; what a
-- word means has to travel beside it (a valid flag that is reset).
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity delay_line is
  generic (
    WIDTH  : positive              := 8; -- bits of a word
    CLOCKS : positive range 3 to 17 := 8 -- delay
  );
  port (
    clk     : in    std_logic;                            -- rising edge
    rst     : in    std_logic;                            -- synchronous, active high: aligns the ring
    word    : in    std_logic_vector(WIDTH - 1 downto 0); -- word of this clock
    delayed : out   std_logic_vector(WIDTH - 1 downto 0)  -- word of CLOCKS clocks ago
  );
end entity delay_line;

architecture rtl of delay_line is

  constant PLACES : positive := CLOCKS - 1;

  -- bits of a place
  function bits_of (count : positive) return positive is
  begin

    if (count > 8) then
      return 4;
    elsif (count > 4) then
      return 3;
    elsif (count > 2) then
      return 2;
    else
      return 1;
    end if;

  end function bits_of;

  constant BITS : positive := bits_of(PLACES);

  type ring_t is array (0 to 15) of std_logic_vector(WIDTH - 1 downto 0);

  subtype place_t is natural range 0 to 2 ** BITS - 1;

  subtype feedback_t is std_logic_vector(0 to 15);

  type feedbacks_t is array (2 to 16) of feedback_t;

  -- bit that is shifted in at every place, for a cycle of that many places through 0
  constant FEEDBACKS : feedbacks_t := (
    "1000000000000000", "1000000000000000", "1100000000000000", "1100000000000000", "1101000000000000",
    "1010010000000000", "1011010000000000", "1000100001000000", "1001100001000000", "1001100101000000",
    "1011100001000000", "1000101001010100", "1000101101010100", "1000111001110000", "1000111101110000"
  );

  constant FEEDBACK : feedback_t := FEEDBACKS(PLACES);

  function following (place : place_t) return place_t is

    variable both : unsigned(BITS downto 0);

  begin

    both := to_unsigned(place, BITS) & FEEDBACK(place);

    return to_integer(both(BITS - 1 downto 0));

  end function following;

  -- whether the places are a cycle of that length through 0
  function is_cycle (count : positive) return boolean is

    variable place : place_t;

  begin

    place := 0;

    for i in 1 to count loop
      place := following(place);

      if ((place = 0) /= (i = count)) then
        return false;
      end if;
    end loop;

    return true;

  end function is_cycle;

  signal ring  : ring_t;
  signal place : place_t;

begin

  assert is_cycle(PLACES)
    report "delay_line: not a cycle of that many places"
    severity failure;

  p_ring : process (clk) is
  begin

    if rising_edge(clk) then
      delayed     <= ring(place);
      ring(place) <= word;

      place <= following(place);

      if (rst = '1') then
        place <= 0;
      end if;
    end if;

  end process p_ring;

end architecture rtl;
