-- Duty of a pair of vectors: the part of the period in which the first is applied, and what comes of it.
--
-- The torque is linear in the duty d: error(d) = error - d * span, with the error at d = 0 and span, what the first
-- vector adds to the torque beyond the second. d = error/span is found bit by bit, each bit by one subtraction. With
-- every bit the way so far is doubled, and the whole way is added where the bit is set: with the last one d * way
-- stands there, exactly. No multiplier and no divider (docs/specification.md, section 3.6).
--
-- Formats: error and span quarters of a torque term, span not negative; way WAY_GUARD bits below the LSB of a length;
-- duty 12 bits, unsigned, 1/4096 of the period, cut off; the part of the way is cut off to the way's LSB.
-- Latency: outputs are stable DUTY_CLOCKS clocks after load and stay so until the next load.
-- Overflow: none inside. A duty beyond the period becomes 4095, one below zero becomes 0. Equal torques (span of
-- zero): 4095. The error that remains is twice 4096 times as large where the duty is within, else twice.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;

entity mptc_duty is
  port (
    clk     : in    std_logic;     -- rising edge
    load    : in    std_logic;     -- '1': a search begins with the following inputs
    request : in    mptc_search_t; -- error, span and way
    result  : out   mptc_found_t   -- duty, remaining error, part of the way
  );
end entity mptc_duty;

architecture rtl of mptc_duty is

  constant PART_WIDTH : positive := WAY_WIDTH + TIME_WIDTH;

  subtype part_t is signed(PART_WIDTH - 1 downto 0);

  signal first  : std_logic;                                -- the comparison with the whole period
  signal within : std_logic;                                -- the duty is between 0 and 1
  signal beyond : std_logic;                                -- the duty is that of the whole period
  signal error  : double_error_t;                           -- twice what the last comparison left
  signal span   : error_t;
  signal bits   : std_logic_vector(TIME_WIDTH - 1 downto 0);
  signal count  : natural range 0 to TIME_WIDTH;            -- bits that are to come
  signal way_x  : way_t;
  signal way_y  : way_t;
  signal part_x : part_t;
  signal part_y : part_t;

begin

  p_search : process (clk) is

    variable trial   : double_error_t;
    variable rest    : double_error_t;
    variable fits    : std_logic;
    variable bit_set : std_logic;

  begin

    if rising_edge(clk) then
      trial   := error - span;
      fits    := not trial(ERROR_WIDTH);
      bit_set := beyond or (within and fits);
      rest    := error;

      if (fits = '1') then
        rest := trial;
      end if;

      if (first = '1' or (within = '1' and count /= 0)) then
        error <= shift_left(rest, 1);
      end if;

      if (first = '1') then
        first  <= '0';
        within <= not fits and not error(ERROR_WIDTH);
        beyond <= fits or to_std_logic(span = 0);
        part_x <= (others => '0');
        part_y <= (others => '0');
      elsif (count /= 0) then
        count  <= count - 1;
        bits   <= bits(TIME_WIDTH - 2 downto 0) & bit_set;
        part_x <= shift_left(part_x, 1) + gated(resize(way_x, PART_WIDTH), bit_set);
        part_y <= shift_left(part_y, 1) + gated(resize(way_y, PART_WIDTH), bit_set);
      end if;

      if (load = '1') then
        first <= '1';
        count <= TIME_WIDTH;
        error <= resize(request.error, ERROR_WIDTH + 1);
        span  <= request.span;
        way_x <= request.way_x;
        way_y <= request.way_y;
      end if;
    end if;

  end process p_search;

  result.duty   <= bits;
  result.within <= within;
  result.error  <= error;
  result.way_x  <= part_x(PART_WIDTH - 1 downto TIME_WIDTH);
  result.way_y  <= part_y(PART_WIDTH - 1 downto TIME_WIDTH);

end architecture rtl;
