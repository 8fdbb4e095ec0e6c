-- How long a linear trajectory stays inside its bound: Algorithm 2 of Paper A.
--
-- length = the largest l in 0..upper with l * x <= y, found without a division: the multiple
-- c = 2**LENGTH_WIDTH * x is halved once per step and subtracted wherever it fits.
--
-- Formats: x, y unsigned, same unit; lengths unsigned.  upper <= 2**LENGTH_WIDTH - 1.
-- Exits: (1) c <= y at once: length = upper; (2) the largest length still possible drops below
-- lower: below = '1', the candidate cannot win and length is void.
-- Latency: done rises LENGTH_WIDTH + 2 clocks after start, 2 clocks with exit 1, from 3 clocks on
-- with exit 2; it stays high, with the result, until the next start, which is accepted at any time.
-- Overflow: none; c is LENGTH_WIDTH bits wider than x and every halving is exact, so no guard bits
-- are needed.
-- Differs from the listing: (25b) says x*l <= y where the listing tests '<'; c starts at a power
-- of two above the horizon, as halving is wrong for any other, and the result is capped instead;
-- b + c <= y is tested as c <= y - b, one carry chain instead of two.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity binary_search is
  generic (
    WIDTH        : positive := 16; -- bits of x and y
    LENGTH_WIDTH : positive := 6   -- bits of a length
  );
  port (
    clk    : in    std_logic;                                   -- rising edge
    rst    : in    std_logic;                                   -- synchronous, active high
    start  : in    std_logic;                                   -- '1' for one clock: take x and y
    x      : in    std_logic_vector(WIDTH - 1 downto 0);        -- unsigned, step of the trajectory
    y      : in    std_logic_vector(WIDTH - 1 downto 0);        -- unsigned, room up to the bound
    lower  : in    std_logic_vector(LENGTH_WIDTH downto 0);     -- shortest length of use, steps, may change any time
    upper  : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0); -- longest length, steps, stable while searching
    done   : out   std_logic;                                   -- '1': length and below are valid
    below  : out   std_logic;                                   -- '1': no length of at least lower exists
    length : out   std_logic_vector(LENGTH_WIDTH - 1 downto 0)  -- steps
  );
end entity binary_search;

architecture rtl of binary_search is

  type state_t is record
    busy      : std_logic;
    done      : std_logic;
    first     : std_logic;                                   -- the test for exit 1 is due
    below     : std_logic;
    multiple  : unsigned(WIDTH + LENGTH_WIDTH - 1 downto 0); -- c of the listing
    remainder : unsigned(WIDTH - 1 downto 0);                -- y - b
    step      : std_logic_vector(LENGTH_WIDTH - 1 downto 0); -- one-hot: bit under test
    most      : unsigned(LENGTH_WIDTH - 1 downto 0);         -- a: largest length still possible
  end record state_t;

  constant STATE_INIT : state_t := (
    busy      => '0',
    done      => '0',
    first     => '0',
    below     => '0',
    multiple  => (others => '0'),
    remainder => (others => '0'),
    step      => (others => '0'),
    most      => (others => '0')
  );

  signal r      : state_t;
  signal r_next : state_t;

begin

  p_next : process (r, start, x, y, lower) is

    variable v          : state_t;
    variable difference : signed(WIDTH + LENGTH_WIDTH downto 0);

  begin

    v := r;

    if (r.busy = '1') then
      difference := signed(resize(r.remainder, WIDTH + LENGTH_WIDTH + 1))
                    - signed(resize(r.multiple, WIDTH + LENGTH_WIDTH + 1));
      v.multiple := '0' & r.multiple(r.multiple'high downto 1);
      v.first    := '0';

      if (r.first = '1') then
        if (difference >= 0) then
          -- exit 1: even 2**LENGTH_WIDTH steps fit; most is all ones
          v.busy := '0';
          v.done := '1';
        end if;
      else
        v.step := '0' & r.step(LENGTH_WIDTH - 1 downto 1);

        if (difference >= 0) then
          v.remainder := unsigned(difference(WIDTH - 1 downto 0));
        else
          v.most := r.most and not unsigned(r.step);
        end if;

        if (resize(v.most, LENGTH_WIDTH + 1) < unsigned(lower)) then
          -- exit 2
          v.busy  := '0';
          v.done  := '1';
          v.below := '1';
        elsif (r.step(0) = '1') then
          v.busy := '0';
          v.done := '1';
        end if;
      end if;
    end if;

    if (start = '1') then
      v.busy                   := '1';
      v.done                   := '0';
      v.first                  := '1';
      v.below                  := '0';
      v.multiple               := unsigned(x) & (LENGTH_WIDTH - 1 downto 0 => '0');
      v.remainder              := unsigned(y);
      v.step                   := (others => '0');
      v.step(LENGTH_WIDTH - 1) := '1';
      v.most                   := (others => '1');
    end if;

    r_next <= v;

  end process p_next;

  p_state : process (clk) is
  begin

    if rising_edge(clk) then
      r <= r_next;

      if (rst = '1') then
        r.busy <= STATE_INIT.busy;
        r.done <= STATE_INIT.done;
      end if;
    end if;

  end process p_state;

  -- bits of most that were never cleared are the length
  length <= upper when r.most > unsigned(upper) else
            std_logic_vector(r.most);
  done   <= r.done;
  below  <= r.below and r.done;

end architecture rtl;
