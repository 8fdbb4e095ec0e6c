-- length_search with vectors for its records; what belongs to one candidate comes in one clock.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.explorer_types.all;
  use directmpc.mpdcc_timing.all;
  use directmpc.mpdcc_types.all;

entity length_search_flat is
  generic (
    INWARDS : boolean := false -- true: errors that start outside, too
  );
  port (
    clk         : in    std_logic;                                           -- rising edge
    curvature   : in    std_logic_vector(3 * CURVATURE_WIDTH - 1 downto 0);  -- node_t.curvature; a on the right
    margin_up   : in    std_logic_vector(3 * MARGIN_WIDTH + 2 downto 0);     -- band_t.margin_up, likewise
    margin_down : in    std_logic_vector(3 * MARGIN_WIDTH + 2 downto 0);     -- band_t.margin_down, likewise
    turn        : in    std_logic_vector(3 * TURN_WIDTH - 1 downto 0);       -- band_t.turn, likewise
    valid       : in    std_logic;                                           -- '1': a candidate, stage SLOPE_STAGE
    slopes      : in    std_logic_vector(3 * TRAJECTORY_WIDTH - 1 downto 0); -- of a, b and their sum; a on the right
    allowed     : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0);         -- steps; 0: dead
    shown       : out   std_logic;                                           -- '1': length is a candidate's
    length      : out   std_logic_vector(LENGTH_WIDTH - 1 downto 0)          -- steps
  );
end entity length_search_flat;

architecture bench of length_search_flat is

  type lengths_t is array (SLOPE_STAGE to ALLOW_STAGE) of length_t;

  signal stages : stages_t := (others => '0');
  signal node   : node_t;
  signal band   : band_t;
  signal pipe   : slopes_t;
  signal limit  : lengths_t;
  signal found  : length_t;

  function word (vector : std_logic_vector; place, width : natural) return signed is

    alias words : std_logic_vector(vector'length - 1 downto 0) is vector;

  begin

    return signed(words((place + 1) * width - 1 downto place * width));

  end function word;

begin

  g_lanes : for x in 0 to 2 generate
    node.curvature(x)   <= word(curvature, x, CURVATURE_WIDTH);
    band.margin_up(x)   <= word(margin_up, x, MARGIN_WIDTH + 1);
    band.margin_down(x) <= word(margin_down, x, MARGIN_WIDTH + 1);
    band.turn(x)        <= word(turn, x, TURN_WIDTH);
  end generate g_lanes;

  stages(SLOPE_STAGE) <= valid;
  limit(SLOPE_STAGE)  <= unsigned(allowed);
  pipe.slope(0)       <= word(slopes, 0, TRAJECTORY_WIDTH);
  pipe.slope(1)       <= word(slopes, 1, TRAJECTORY_WIDTH);

  p_stages : process (clk) is
  begin

    if rising_edge(clk) then
      stages(ERROR_STAGE to LENGTH_STAGE) <= stages(SLOPE_STAGE to LENGTH_STAGE - 1);
      limit(ERROR_STAGE to ALLOW_STAGE)   <= limit(SLOPE_STAGE to ALLOW_STAGE - 1);
      pipe.sum                            <= word(slopes, 2, TRAJECTORY_WIDTH);
    end if;

  end process p_stages;

  i_search : entity directmpc.length_search
    generic map (
      INWARDS => INWARDS
    )
    port map (
      clk     => clk,
      node    => node,
      band    => band,
      valid   => stages,
      slopes  => pipe,
      allowed => limit(ALLOW_STAGE),
      length  => found
    );

  shown  <= stages(LENGTH_STAGE);
  length <= std_logic_vector(found);

end architecture bench;
