-- Slopes of the current errors of a candidate and the errors at k+1.
--
--   stage 1   u_x = h*Xr/(3D) * v_x of each phase
--   stage 2   u_a - u_c, u_b - u_c
--   stage 3   slope of a and b: natural slope - h*Xr/D * (v_x - (v_a + v_b + v_c)/3),
--             that is natural slope - (2*(u_x - u_c) - (u_y - u_c)), the last term rounded half up
--   stage 4   error at k+1: error + curvature + slope, and the sum of both slopes
--
-- Errors and slopes of the three phases add up to zero, so that a and b tell those of c.
-- Formats: trajectory units; voltages with FORCED_FRACTION extra fractional bits.
-- Latency: SLOPE_STAGE clocks from position to slope, ERROR_STAGE to error and sum; one candidate a clock.
-- Overflow: none; TRAJECTORY_WIDTH holds every sum that the largest inputs make.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.explorer_types.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_math.all;
  use work.mpdcc_types.all;

entity candidate_slopes is
  port (
    clk      : in    std_logic;   -- rising edge
    node     : in    node_t;      -- where trajectories start, see node_shown for when it changes
    band     : in    band_t;      -- the band seen from there
    valid    : in    stages_t;    -- '1': the stage holds a candidate
    position : in    positions_t; -- of the candidate, stage 0
    slopes   : out   slopes_t     -- of the candidate, stages 3 and 4
  );
end entity candidate_slopes;

architecture rtl of candidate_slopes is

  subtype voltage_t is signed(FORCED_WIDTH downto 0);

  type voltages_t is array (0 to 2) of voltage_t;

  subtype difference_t is signed(FORCED_WIDTH + 1 downto 0);

  type differences_t is array (0 to 1) of difference_t;

  signal voltage_1    : voltages_t;
  signal difference_2 : differences_t; -- of a and c, of b and c
  signal slope_3      : pair_t;        -- of a and b
  signal sum_4        : trajectory_t;
  signal error_4      : pair_t;

begin

  p_slopes : process (clk) is

    variable wide  : signed(TRAJECTORY_WIDTH + FORCED_FRACTION - 1 downto 0);
    variable twice : signed(TRAJECTORY_WIDTH + FORCED_FRACTION - 2 downto 0);

  begin

    if rising_edge(clk) then
      for x in 0 to 2 loop
        if (valid(0) = '1') then
          voltage_1(x) <= phase_voltage(node, x, position(x));
        end if;
      end loop;

      for x in 0 to 1 loop
        if (valid(1) = '1') then
          difference_2(x) <= resize(voltage_1(x), FORCED_WIDTH + 2) - voltage_1(2);
        end if;

        if (valid(SLOPE_STAGE - 1) = '1') then
          -- F = 2*(u_x - u_c) - (u_y - u_c) in quarters: floor((1 - F)/4) is -F/4, F/4 rounded half up
          wide  := node.slope(x) & (FORCED_FRACTION - 2 downto 0 => '0') & '1';
          -- twice a difference has no bit 0: the LSB is unaffected and bypasses the subtractor
          twice := wide(wide'high downto 1) - difference_2(x);
          wide  := twice & wide(0);
          wide  := wide + difference_2(1 - x);

          slope_3(x) <= wide(TRAJECTORY_WIDTH + FORCED_FRACTION - 1 downto FORCED_FRACTION);
        end if;

        if (valid(ERROR_STAGE - 1) = '1') then
          error_4(x) <= band.first(x) + slope_3(x);
        end if;
      end loop;

      if (valid(ERROR_STAGE - 1) = '1') then
        sum_4 <= slope_3(0) + slope_3(1);
      end if;
    end if;

  end process p_slopes;

  slopes.slope <= slope_3;
  slopes.sum   <= sum_4;
  slopes.error <= error_4;

end architecture rtl;
