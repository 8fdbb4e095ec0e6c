-- Delays a word by a fixed number of clocks.
--
-- A ring of CLOCKS - 1 words in a memory, each read just before it is overwritten, and one register.
-- The place in the ring is a shift register with one bit fed back, a LUT instead of a counter's chain
-- and comparison: any order of the places will do, and there is a cycle of every length.
-- Formats: any.
-- Latency: CLOCKS clocks; initiation interval one clock.
-- Overflow: none. What comes out before CLOCKS clocks have passed since power-up is void; what a
-- word means has to travel beside it (a valid flag that is reset).
-- Tried and dropped: a chain of registers: one flip-flop per bit and clock, where the memory takes
-- one LUT per bit for up to sixteen clocks.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

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

  type ring_t is array (0 to 15) of std_logic_vector(WIDTH - 1 downto 0);

  type order_t is array (0 to 15) of natural range 0 to 15;

  subtype feedback_t is std_logic_vector(0 to 15);

  type feedbacks_t is array (2 to 16) of feedback_t;

  -- bit that is shifted in at every place, for a cycle of that many places through 0
  constant FEEDBACKS : feedbacks_t := (
    "1000000000000000", "1000000000000000", "1100000000000000", "1100000000000000", "1101000000000000",
    "1010010000000000", "1011010000000000", "1000100001000000", "1001100001000000", "1001100101000000",
    "1011100001000000", "1000101001010100", "1000101101010100", "1000111001110000", "1000111101110000"
  );

  function order_of (count : positive) return order_t is

    variable size  : positive;
    variable order : order_t;
    variable place : natural;

  begin

    -- as few bits as count places take
    if (count > 8) then
      size := 16;
    elsif (count > 4) then
      size := 8;
    elsif (count > 2) then
      size := 4;
    else
      size := 2;
    end if;

    for i in order'range loop
      order(i) := (2 * i) mod size;

      if (FEEDBACKS(count)(i) = '1') then
        order(i) := order(i) + 1;
      end if;
    end loop;

    place := 0;

    for i in 1 to count loop
      place := order(place);

      assert (place = 0) = (i = count)
        report "delay_line: not a cycle of that many places"
        severity failure;
    end loop;

    return order;

  end function order_of;

  constant ORDER : order_t := order_of(PLACES);

  signal ring     : ring_t;
  signal position : natural range 0 to 15;

begin

  p_ring : process (clk) is
  begin

    if rising_edge(clk) then
      delayed        <= ring(position);
      ring(position) <= word;

      position       <= ORDER(position);

      if (rst = '1') then
        position <= 0;
      end if;
    end if;

  end process p_ring;

end architecture rtl;
