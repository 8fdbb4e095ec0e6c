-- Slope from which a current error leaves the band before it turns.
--
-- The error of a phase is e(l) = e + b*l + c*l**2 with the same c for every candidate. With
-- M the room at k on the side opposite to sgn(c),
--
--   threshold = min over l = 2, 4, 8 .. 64 of M / l + abs(c) * l
--
-- A slope against the curvature that is larger makes the error leave on that side, at one of these l
-- at the latest; otherwise it goes at most an eighth of M beyond it (where no l of the list is near
-- the turn) before it comes back, and can leave on the side of sgn(c) alone. What is outside at l = 1
-- is dead whatever the threshold, so that l is left out.
--
-- Search: from one l to the next M / l is halved, rounded down, and abs(c) * l doubled. So the sum falls, or stays, as
-- long as 2 * abs(c) * l does not exceed M / l, and then rises: the unit stops at the first l where it would rise.
--
-- Formats: trajectory units; threshold unsigned, 0 to 2**18 - 1.
-- Latency: threshold is valid LENGTH_WIDTH + 1 clocks after start at the latest and stable until the next start.
-- Overflow: none as long as the margins are those of an error inside its band, or with INWARDS of one outside on the
-- side of sgn(c) that BASE_WIDTH bits hold; elsewhere the threshold is void (and unused).
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_types.all;

entity turn_threshold is
  generic (
    INWARDS : boolean := false -- true: for errors outside the band too, on the side of sgn(c)
  );
  port (
    clk         : in    std_logic;                         -- rising edge
    start       : in    std_logic;                         -- '1' for one clock: take margin and curvature
    margin_up   : in    margin_t;                          -- error - bound - 1, trajectory units, negative
    margin_down : in    margin_t;                          -- error + bound, trajectory units, not negative
    curvature   : in    curvature_t;                       -- trajectory units per square step
    threshold   : out   unsigned(TURN_WIDTH - 2 downto 0)  -- trajectory units per step
  );
end entity turn_threshold;

architecture rtl of turn_threshold is

  constant ROOM_WIDTH  : natural := MARGIN_WIDTH - choose(INWARDS, 1, 2);
  constant STEEP_WIDTH : natural := maximum_of(CURVATURE_WIDTH + 1, ROOM_WIDTH);

  signal room  : unsigned(ROOM_WIDTH - 1 downto 0);        -- M / l
  signal steep : unsigned(STEEP_WIDTH - 1 downto 0);       -- abs(c) * l
  signal left  : natural range 0 to LENGTH_WIDTH - 1;      -- lengths after this one

begin

  p_threshold : process (clk) is
  begin

    if rising_edge(clk) then
      -- twice the length is no worse as long as 2 * abs(c) * l does not exceed M / l
      if (left /= 0 and shift_left(resize(steep, STEEP_WIDTH + 1), 1) <= room) then
        room  <= shift_right(room, 1);
        steep <= shift_left(steep, 1);
        left  <= left - 1;
      end if;

      if (start = '1') then
        -- bound - error is the complement of error - bound - 1
        if (curvature >= 0) then
          room <= unsigned(margin_down(ROOM_WIDTH downto 1));
        else
          room <= unsigned(not margin_up(ROOM_WIDTH downto 1));
        end if;

        steep <= shift_left(resize(magnitude(curvature), STEEP_WIDTH), 1);
        left  <= LENGTH_WIDTH - 1;
      end if;
    end if;

  end process p_threshold;

  threshold <= resize(room, TURN_WIDTH - 1) + steep;

end architecture rtl;
