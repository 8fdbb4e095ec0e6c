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
-- Where the curvature comes early (curves_early) one unit finds the thresholds of a, b and c one after the other, and
-- whether the errors are outside: turn and outside of c are there 20 clocks after the node's curvature. It does not
-- look at preparation.turn.
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
  use work.mpdcc_program.all;
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

  -- whether one unit serves the three phases in turn
  constant IN_TURN : boolean := curves_early and not SECOND_LEVEL and not INWARDS;

  signal thresholds  : thresholds_t;
  signal shown       : thresholds_t;
  signal show_third  : std_logic;
  signal kept        : thresholds_t;             -- IN_TURN
  signal beyond      : std_logic_vector(0 to 2); -- '1': the error is outside at k
  signal margin_up   : margins_t;
  signal margin_down : margins_t;

begin

  g_thresholds : for x in 0 to choose(IN_TURN, -1, 2) generate

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

  -- six clocks each: the unit takes a phase while the result of the phase before is kept
  g_in_turn : if IN_TURN generate

    -- clocks from preparation.capacitors to the first in which the node has a curvature, less one
    constant LEAD : positive := curvature_step + 1 - CAPACITOR_STEP;

    signal lead_in   : std_logic_vector(1 to LEAD);
    signal phase     : natural range 0 to 3; -- 3: none is left
    signal beat      : natural range 0 to LENGTH_WIDTH - 1;
    signal takes     : std_logic;
    signal chosen    : trajectory_t;
    signal curvature : curvature_t;
    signal plus      : std_logic;
    signal room      : trajectory_t;
    signal room_up   : margin_t;
    signal room_low  : margin_t;
    signal threshold : threshold_t;

  begin

    takes <= to_std_logic(beat = 0 and phase < 3);

    p_chosen : process (phase, error_ahead, node) is

      variable error : trajectory_t;
      variable bend  : curvature_t;

    begin

      error := (others => '0');
      bend  := (others => '0');

      for x in 0 to 2 loop
        error := error or gated(error_ahead(x), to_std_logic(phase = x));
        bend  := bend or gated(node.curvature(x), to_std_logic(phase = x));
      end loop;

      chosen    <= error;
      curvature <= bend;

    end process p_chosen;

    -- bound + error or bound - error: first the one that the threshold needs, then the other one
    plus     <= curvature(CURVATURE_WIDTH - 1) xor takes;
    room     <= adjusted(signed(resize(limits.bound_current, TRAJECTORY_WIDTH)), chosen, plus, not plus);
    room_low <= room(MARGIN_WIDTH downto 0);
    room_up  <= not room_low;

    i_threshold : entity work.turn_threshold
      port map (
        clk         => clk,
        start       => takes,
        margin_up   => room_up,
        margin_down => room_low,
        curvature   => curvature,
        threshold   => threshold
      );

    p_turn : process (clk) is
    begin

      if rising_edge(clk) then
        if (beat = LENGTH_WIDTH - 1) then
          beat  <= 0;
          phase <= phase + 1;
        elsif (phase < 3) then
          beat <= beat + 1;
        end if;

        for x in 0 to 2 loop
          if (phase = x + 1 and beat = 0) then
            kept(x) <= threshold;
          end if;

          if (phase = x and beat = 0) then
            beyond(x) <= room(TRAJECTORY_WIDTH - 1);
          elsif (phase = x and beat = 1) then
            beyond(x) <= beyond(x) or room(TRAJECTORY_WIDTH - 1);
          end if;
        end loop;

        lead_in <= preparation.capacitors & lead_in(1 to LEAD - 1);

        if (lead_in(LEAD) = '1') then
          phase <= 0;
          beat  <= 0;
        end if;

        if (rst = '1') then
          lead_in <= (others => '0');
          phase   <= 3;
          beat    <= 0;
        end if;
      end if;

    end process p_turn;

  end generate g_in_turn;

  g_not_in_turn : if not IN_TURN generate
    kept   <= (others => (others => '0'));
    beyond <= (others => '0');
  end generate g_not_in_turn;

  -- sums of what the node's registers hold; explorers register what they make of them
  p_band : process (limits, node, shown, kept, beyond, previous, negative) is

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

      -- length_search adds the error
      if (IN_TURN) then
        margin_up(x)    <= not bound(MARGIN_WIDTH downto 0);
        margin_down(x)  <= bound(MARGIN_WIDTH downto 0);
        band.outside(x) <= beyond(x);
        band.turn(x)    <= signed(falling xor ('0' & kept(x)));
      end if;
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
