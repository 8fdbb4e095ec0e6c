-- Step one of a candidate by the rule "inwards": whether a current is neither inside nor nearer at k+1.
--
-- A current that is outside its bound at k may be outside at k+1 too, if it is nearer there:
--
--   abs(e(k+1)) <= limit,   limit: the bound, or abs(e(k)) - 1 where that is larger
--
-- node_preparation makes the limits, one for each current. A candidate is dead whatever its limits if band.outside
-- says so, or if a slope does not fit the words of length_search.
--
--   stage 4   what band.outside says of a and b; whether their slopes fit
--   stage 5   limits of a and b; what band.outside says of c; whether its slope fits
--   stage 6   limit of c
--   stage 7   the answer
--
-- Third current: the opposite of phase c, the sum of a and b.
-- Formats: trajectory units; limits of BOUND_WIDTH bits.
-- Latency: PROBE_STAGE - SLOPE_STAGE clocks from the slopes; one candidate a clock.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.explorer_types.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_types.all;

entity inward_step is
  port (
    clk    : in    std_logic; -- rising edge
    band   : in    band_t;    -- what is outside at k, and the limits
    valid  : in    stages_t;  -- '1': the stage holds a candidate
    slopes : in    slopes_t;  -- of the candidate, stages 3 and 4
    leaves : out   std_logic  -- '1': a current is neither inside nor nearer, stage PROBE_STAGE
  );
end entity inward_step;

architecture rtl of inward_step is

  signal dead  : std_logic_vector(ERROR_STAGE to PROBE_STAGE); -- '1': found so far
  signal third : trajectory_t;                                -- error of the third current, stage SEARCH

  -- '1': the error's magnitude is above its limit
  function beyond (error : trajectory_t; limit : bound_t) return std_logic is

    variable room : trajectory_t;

  begin

    room := adjusted(signed(resize(limit, TRAJECTORY_WIDTH)), error, error(TRAJECTORY_WIDTH - 1),
                     not error(TRAJECTORY_WIDTH - 1));

    return room(TRAJECTORY_WIDTH - 1);

  end function beyond;

begin

  p_dead : process (clk) is
  begin

    if rising_edge(clk) then
      if (valid(SLOPE_STAGE) = '1') then
        dead(ERROR_STAGE) <= band.outside(0) or band.outside(1) or overflows(slopes.slope(0), START_SLOPE_WIDTH)
                             or overflows(slopes.slope(1), START_SLOPE_WIDTH);
      end if;

      if (valid(ERROR_STAGE) = '1') then
        dead(SEARCH) <= dead(ERROR_STAGE) or band.outside(2) or overflows(slopes.sum, START_SLOPE_WIDTH)
                        or beyond(slopes.error(0), band.limit(0)) or beyond(slopes.error(1), band.limit(1));
        third        <= slopes.error(0) + slopes.error(1);
      end if;

      if (valid(SEARCH) = '1') then
        dead(SEARCH + 1) <= dead(SEARCH) or beyond(third, band.limit(2));
      end if;

      if (valid(SEARCH + 1) = '1') then
        dead(PROBE_STAGE) <= dead(SEARCH + 1);
      end if;
    end if;

  end process p_dead;

  leaves <= dead(PROBE_STAGE);

end architecture rtl;
