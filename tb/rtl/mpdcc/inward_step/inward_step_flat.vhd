-- inward_step with vectors for its records; what belongs to one candidate comes in one clock.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.explorer_types.all;
  use directmpc.mpdcc_timing.all;
  use directmpc.mpdcc_types.all;

entity inward_step_flat is
  port (
    clk     : in    std_logic;                                           -- rising edge
    outside : in    std_logic_vector(2 downto 0);                        -- band_t.outside, of the node
    limits  : in    std_logic_vector(3 * BOUND_WIDTH - 1 downto 0);      -- band_t.limit, of the node; a on the right
    valid   : in    std_logic;                                           -- '1': a candidate comes, stage SLOPE_STAGE
    slopes  : in    std_logic_vector(3 * TRAJECTORY_WIDTH - 1 downto 0); -- of a, b and their sum; a on the right
    errors  : in    std_logic_vector(2 * TRAJECTORY_WIDTH - 1 downto 0); -- of a and b at k+1; a on the right
    shown   : out   std_logic;                                           -- '1': leaves is a candidate's
    leaves  : out   std_logic                                            -- as of inward_step
  );
end entity inward_step_flat;

architecture bench of inward_step_flat is

  signal stages : stages_t := (others => '0');
  signal band   : band_t;
  signal pipe   : slopes_t;

  function word (vector : std_logic_vector; place : natural) return trajectory_t is

    alias words : std_logic_vector(vector'length - 1 downto 0) is vector;

  begin

    return signed(words((place + 1) * TRAJECTORY_WIDTH - 1 downto place * TRAJECTORY_WIDTH));

  end function word;

begin

  band.outside <= outside;

  g_limits : for x in 0 to 2 generate
    band.limit(x) <= unsigned(limits((x + 1) * BOUND_WIDTH - 1 downto x * BOUND_WIDTH));
  end generate g_limits;

  stages(SLOPE_STAGE) <= valid;

  pipe.slope(0) <= word(slopes, 0);
  pipe.slope(1) <= word(slopes, 1);

  p_stages : process (clk) is
  begin

    if rising_edge(clk) then
      stages(ERROR_STAGE to PROBE_STAGE) <= stages(SLOPE_STAGE to PROBE_STAGE - 1);

      pipe.sum      <= word(slopes, 2);
      pipe.error(0) <= word(errors, 0);
      pipe.error(1) <= word(errors, 1);
    end if;

  end process p_stages;

  i_step : entity directmpc.inward_step
    port map (
      clk    => clk,
      band   => band,
      valid  => stages,
      slopes => pipe,
      leaves => leaves
    );

  shown <= stages(PROBE_STAGE);

end architecture bench;
