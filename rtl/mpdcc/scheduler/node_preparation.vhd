-- Prepares the part of a node that fast explorers need in addition to the common terms.
--
-- Per phase: the error at k+1 without the slope (a and b; c follows from them), the margins from
-- both bounds, whether the error is outside at k, and the slope from which it leaves before it turns;
-- and the table of the capacitors' lengths, which every explorer keeps a copy of. See turn_threshold
-- and capacitor_search.
--
-- Formats: see band_t and capacitor_t.
-- Latency: band but for turn with the node, turn 9 clocks after preparation.turn; table and held
-- as in capacitor_search after preparation.capacitors.
-- Overflow: margins are void where the error is outside at k; nothing reads them there.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_types.all;
  use work.second_level_types.all;

entity node_preparation is
  generic (
    SECOND_LEVEL : boolean := false; -- true: with successors
    INWARDS      : boolean := false  -- true: the rule inwards besides
  );
  port (
    clk         : in    std_logic;                    -- rising edge
    rst         : in    std_logic;                    -- synchronous, active high
    preparation : in    preparation_t;                -- when to begin, and with which node
    limits      : in    limits_t;                     -- bounds and horizon, stable
    node        : in    node_t;                       -- common terms, stable
    previous    : in    positions_t;                  -- s(k-1), stable
    negative    : in    std_logic_vector(2 downto 0); -- '1': negative phase current, stable
    error_ahead : in    trajectories_t;               -- current errors that the thresholds are for
    band        : out   band_t;                       -- to the explorers
    capacitor   : out   capacitor_t;                  -- to the explorers, row by row
    ready       : out   std_logic;                    -- '1': the last row of the table is out 6 clocks later
    held        : out   std_logic                     -- '1': s(k-1) keeps capacitors and v_n inside at k+1
  );
end entity node_preparation;

architecture rtl of node_preparation is

  subtype threshold_t is unsigned(TURN_WIDTH - 2 downto 0);

  type thresholds_t is array (0 to 2) of threshold_t;

  signal thresholds  : thresholds_t;
  signal shown       : thresholds_t;
  signal show_third  : std_logic;
  signal margin_up   : margins_t;
  signal margin_down : margins_t;

begin

  g_thresholds : for x in 0 to 2 generate

    signal room     : trajectory_t;
    signal room_up  : margin_t;
    signal room_low : margin_t;

  begin

    -- bound + error or bound - error, whichever the threshold needs
    room     <= adjusted(signed(resize(limits.bound_current, TRAJECTORY_WIDTH)), error_ahead(x),
                         not node.curvature(x)(CURVATURE_WIDTH - 1), node.curvature(x)(CURVATURE_WIDTH - 1));
    room_low <= room(MARGIN_WIDTH downto 0);
    room_up  <= not room_low;

    i_threshold : entity work.turn_threshold
      generic map (
        INWARDS => INWARDS
      )
      port map (
        clk         => clk,
        start       => preparation.turn,
        margin_up   => room_up,
        margin_down => room_low,
        curvature   => node.curvature(x),
        threshold   => thresholds(x)
      );

  end generate g_thresholds;

  p_shown : process (clk) is
  begin

    if rising_edge(clk) then
      show_third <= preparation.show_turn;

      for x in 0 to 2 loop
        if ((x < 2 and preparation.show_turn = '1') or (x = 2 and show_third = '1')) then
          shown(x) <= thresholds(x);
        end if;
      end loop;
    end if;

  end process p_shown;

  -- sums of what the node's registers hold; explorers register what they make of them
  p_band : process (limits, node, shown, previous, negative) is

    variable bound   : trajectory_t;
    variable above   : trajectory_t;
    variable below   : trajectory_t;
    variable falling : unsigned(TURN_WIDTH - 1 downto 0);
    variable outside : std_logic;
    variable follow  : std_logic;

  begin

    bound := signed(resize(limits.bound_current, TRAJECTORY_WIDTH));

    for x in 0 to 2 loop
      above   := node.error(x) - bound - 1;
      below   := node.error(x) + bound;
      falling := (others => node.curvature(x)(CURVATURE_WIDTH - 1));

      outside := not above(TRAJECTORY_WIDTH - 1) or below(TRAJECTORY_WIDTH - 1);
      follow  := to_std_logic(INWARDS) and limits.outside_inwards and not overflows(node.error(x), BASE_WIDTH);

      margin_up(x)    <= above(MARGIN_WIDTH downto 0);
      margin_down(x)  <= below(MARGIN_WIDTH downto 0);
      band.outside(x) <= outside and not follow;
      -- threshold, or -threshold - 1: the sign of slope + turn tells in either case
      band.turn(x)    <= signed(('0' & shown(x)) xor falling);
    end loop;

    for x in 0 to 1 loop
      band.first(x) <= node.error(x) + node.curvature(x);
    end loop;

    band.previous <= previous;
    band.negative <= negative;

  end process p_band;

  band.margin_up   <= margin_up;
  band.margin_down <= margin_down;

  g_bounds : if not INWARDS generate
    band.limit <= (others => (others => '0'));
  end generate g_bounds;

  -- the bound, or what is nearer than the error at k
  g_limits : if INWARDS generate

    p_limits : process (clk) is

      variable nearer : trajectory_t;

    begin

      if rising_edge(clk) then
        for x in 0 to 2 loop
          nearer := node.error(x) - 1;

          if (node.error(x)(TRAJECTORY_WIDTH - 1) = '1') then
            nearer := not node.error(x);
          end if;

          band.limit(x) <= limits.bound_current;

          if (margin_up(x)(MARGIN_WIDTH) = '0' or margin_down(x)(MARGIN_WIDTH) = '1') then
            band.limit(x) <= unsigned(nearer(BOUND_WIDTH - 1 downto 0));
          end if;
        end loop;
      end if;

    end process p_limits;

  end generate g_limits;

  i_capacitors : entity work.capacitor_search
    generic map (
      SECOND_LEVEL => SECOND_LEVEL,
      INWARDS      => INWARDS
    )
    port map (
      clk       => clk,
      rst       => rst,
      start     => preparation.capacitors,
      limits    => limits,
      node      => node,
      previous  => previous,
      successor => preparation.successor,
      bank      => preparation.bank,
      held      => held,
      ready     => ready,
      entry     => capacitor
    );

end architecture rtl;
