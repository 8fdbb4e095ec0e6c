-- How long the three currents of a candidate stay inside their bound: the shortest length.
--
-- The error of a phase is e(l) = e + b*l + c*l**2. One bit of its length is decided per stage, the
-- highest first. The stage of bit m tests e(l + 2**m) = e(l) + 2**m * secant, where l is the length so
-- far and secant = slope(l) + 2**m * c, which is carried from stage to stage.
--
--   stage 4-5    lane 0 to 2: which bound is left to test, the margin from it, the first secant;
--                a and b a stage before their sum
--   stage 5-11   one bit of the length each, a and b a stage before their sum
--   then         two stages for the shortest of the three lengths and the length that the capacitors allow
--
-- Third lane: the opposite of phase c, the sum of a and b.
-- One bound: the parabola may leave the band and come back. If the slope exceeds its threshold (see
-- turn_threshold) the error leaves before it turns, and steps beyond the turn do not count. Otherwise
-- it can leave on the side of the curvature alone. So one margin is tested, and the test is monotone.
-- Rule inwards (INWARDS): an error that starts outside is followed while it comes back. On the side of the curvature
-- a step is allowed that is inside or in which the error still comes nearer, which is monotone too. On the other side
-- it comes nearer ever faster, and can leave on the curvature's side alone. Step one is inward_step's.
-- Formats: trajectory units; MARGIN_WIDTH and SLOPE_WIDTH hold whatever stays inside a bound of
-- 29000 units.
-- Latency: LENGTH_STAGE - SLOPE_STAGE clocks from the slopes; one candidate a clock.
-- Overflow: a step that does not fit is outside. A slope beyond START_SLOPE_WIDTH leaves in one step: the
-- candidate is dead by allowed, whatever is searched.
-- Considered and rejected: rtl/alternatives.md.
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

entity length_search is
  generic (
    ALLOWED_AT : natural range ALLOW_STAGE to SHORTEST - 1 := ALLOW_STAGE; -- stage of allowed
    INWARDS    : boolean                                  := false;       -- true: errors that start outside, too
    SUMMED     : boolean                                  := false        -- true: margins come without the error
  );
  port (
    clk     : in    std_logic; -- rising edge
    node    : in    node_t;    -- curvatures; errors, with SUMMED
    band    : in    band_t;    -- margins and thresholds
    valid   : in    stages_t;  -- '1': the stage holds a candidate
    slopes  : in    slopes_t;  -- of the candidate, stages 3 and 4
    allowed : in    length_t;  -- length that the capacitors allow, steps, stage ALLOWED_AT; 0: dead
    length  : out   length_t   -- L*, steps, stage LENGTH_STAGE
  );
end entity length_search;

architecture rtl of length_search is

  subtype slope_t is signed(SLOPE_WIDTH - 1 downto 0);

  constant INSIDE_WIDTH : natural := MARGIN_WIDTH - choose(INWARDS, 0, 1);

  subtype inside_t is unsigned(INSIDE_WIDTH - 1 downto 0);

  type slope_set_t is array (0 to 2) of slope_t;

  -- one phase in the search
  type cell_t is record
    side_up : std_logic; -- '1': the upper bound is left to test
    outside : std_logic; -- INWARDS: '1': the error is beyond it at the length so far
    margin  : inside_t;  -- error there, seen from that bound; what is inside has side_up for a sign
    secant  : slope_t;   -- mean slope of the steps that the next stage tries
    length  : length_t;  -- length so far
  end record cell_t;

  type cells_t is array (0 to 2) of cell_t;

  type search_t is array (0 to LENGTH_WIDTH) of cells_t; -- by the bits that are decided

  type limit_stages_t is array (ALLOWED_AT to SHORTEST - 1) of length_t;

  -- stage that a lane of the search starts with: the third is one behind
  function start_of (lane : natural) return natural is
  begin

    return ERROR_STAGE + lane / 2;

  end function start_of;

  signal lane_slopes : trajectories_t;
  signal curvature   : curvatures_t; -- the node's; with INWARDS a clock later
  signal triple      : slope_set_t; -- three times the curvature, likewise
  signal lanes       : search_t;    -- of a and b, and of their sum
  signal limit       : limit_stages_t;
  signal short       : length_t;

begin

  lane_slopes <= (slopes.slope(0), slopes.slope(1), slopes.sum);

  g_lanes : for x in 0 to 2 generate

    p_lane : process (clk) is

      variable start   : signed(START_SLOPE_WIDTH - 1 downto 0);
      variable steeper : signed(TURN_WIDTH downto 0);
      variable exceeds : std_logic;
      variable side_up : std_logic;
      variable away    : std_logic;
      variable margin  : margin_t;

    begin

      if rising_edge(clk) then
        if (valid(start_of(x) - 1) = '1') then
          -- a slope that does not fit leaves in one step: the candidate is dead whatever the search says
          start := lane_slopes(x)(START_SLOPE_WIDTH - 1 downto 0);

          -- against the curvature and steeper than the threshold: it leaves on the curvature's other side
          steeper := resize(start, TURN_WIDTH + 1) + band.turn(x);
          exceeds := steeper(TURN_WIDTH) xor node.curvature(x)(CURVATURE_WIDTH - 1);

          -- outside on the curvature's other side: it comes back ever faster, there is no threshold
          away := band.margin_down(x)(MARGIN_WIDTH) and not node.curvature(x)(CURVATURE_WIDTH - 1);
          away := away or (not band.margin_up(x)(MARGIN_WIDTH) and node.curvature(x)(CURVATURE_WIDTH - 1));

          if (INWARDS and away = '1') then
            exceeds := '0';
          end if;

          side_up := node.curvature(x)(CURVATURE_WIDTH - 1) xnor exceeds;

          lanes(0)(x).side_up <= side_up;
          lanes(0)(x).secant  <= resize(start, SLOPE_WIDTH)
                                 + shift_left(resize(node.curvature(x), SLOPE_WIDTH), LENGTH_WIDTH - 1);
          lanes(0)(x).length  <= (others => '0');

          if (side_up = '1') then
            margin := band.margin_up(x);
          else
            margin := band.margin_down(x);
          end if;

          if (SUMMED) then
            margin := margin + node.error(x)(MARGIN_WIDTH downto 0);
          end if;

          lanes(0)(x).margin  <= unsigned(margin(INSIDE_WIDTH - 1 downto 0));
          lanes(0)(x).outside <= to_std_logic(INWARDS) and (margin(MARGIN_WIDTH) xor side_up);
        end if;
      end if;

    end process p_lane;

  end generate g_lanes;

  g_triple : for x in 0 to 2 generate

    g_now : if not INWARDS generate
      curvature(x) <= node.curvature(x);
      triple(x)    <= resize(node.curvature(x), SLOPE_WIDTH) + shift_left(resize(node.curvature(x), SLOPE_WIDTH), 1);
    end generate g_now;

    -- a choice and two more sums follow, so both are registered here: a clock behind the first slopes, still in time
    g_registered : if INWARDS generate

      p_triple : process (clk) is
      begin

        if rising_edge(clk) then
          curvature(x) <= node.curvature(x);
          triple(x)    <= resize(node.curvature(x), SLOPE_WIDTH)
                          + shift_left(resize(node.curvature(x), SLOPE_WIDTH), 1);
        end if;

      end process p_triple;

    end generate g_registered;

  end generate g_triple;

  g_bits : for m in 0 to LENGTH_WIDTH - 1 generate

    constant DECIDED : natural := LENGTH_WIDTH - m; -- bits, with this one

  begin

    p_bit : process (clk) is

      variable reduced   : cell_t;
      variable secant    : slope_t;
      variable curve     : slope_t; -- change of the slope over the steps tried
      variable rise      : slope_t; -- of the slope, up to the last step tried
      variable tail      : slope_t;
      variable outside   : std_logic;
      variable is_inside : std_logic;
      variable fits      : std_logic;
      variable moved     : signed(SLOPE_WIDTH - m downto 0);
      variable trial     : signed(SLOPE_WIDTH downto 0);
      variable side      : std_logic;
      variable exceeds   : std_logic;
      variable turned    : std_logic;
      variable accept    : std_logic;
      variable ahead     : unsigned(SLOPE_WIDTH - 1 downto 0);
      variable back      : unsigned(SLOPE_WIDTH - 1 downto 0);
      variable change    : unsigned(SLOPE_WIDTH downto 0);
      variable changed   : unsigned(SLOPE_WIDTH downto 0);

    begin

      if rising_edge(clk) then
        for x in 0 to 2 loop
          if (valid(start_of(x) + DECIDED - 1) = '1') then
            secant := lanes(DECIDED - 1)(x).secant;
            curve  := shift_left(resize(curvature(x), SLOPE_WIDTH), m);
            side   := lanes(DECIDED - 1)(x).side_up;

            outside := lanes(DECIDED - 1)(x).outside and to_std_logic(INWARDS);
            trial   := resize(signed((side xor outside) & std_logic_vector(lanes(DECIDED - 1)(x).margin)),
                              SLOPE_WIDTH + 1);

            -- the bits below bit m are unaffected by 2**m * secant and bypass the adder
            moved  := trial(SLOPE_WIDTH downto m) + secant(SLOPE_WIDTH - m - 1 downto 0);
            trial  := moved & trial(m - 1 downto 0);

            -- past the turn the slope has the sign of the curvature; of an error outside, what it moves by in
            -- the last step has: exactly for bits 0 to 2, by the slope after it for the others
            rise := curve;
            tail := secant;

            if (outside = '0') then
              -- with INWARDS those of rise may stay: alone they carry nothing
              if (not INWARDS) then
                rise(TURN_SHIFT - 1 downto 0) := (others => '0');
              end if;

              tail(TURN_SHIFT - 1 downto 0) := (others => '0');
            elsif (m = 1) then
              rise := resize(curvature(x), SLOPE_WIDTH);
            elsif (m = 2) then
              rise := triple(x);
            end if;

            -- of one step it is the mean slope; only an error outside asks
            if (m = 0) then
              tail := secant;
            else
              tail := tail + rise;
            end if;

            turned := tail(tail'high) xnor curvature(x)(CURVATURE_WIDTH - 1);

            -- the bound on the curvature's side is left unless the error leaves before it turns
            exceeds   := side xnor curvature(x)(CURVATURE_WIDTH - 1);
            is_inside := trial(SLOPE_WIDTH) xnor side;
            fits      := not overflows(secant, SLOPE_WIDTH - m);
            accept    := fits and is_inside and not (exceeds and turned and to_std_logic(m > 0));
            accept    := accept or (outside and fits and not turned);

            reduced           := lanes(DECIDED - 1)(x);
            reduced.length(m) := accept;

            if (accept = '1') then
              reduced.margin  := unsigned(trial(INSIDE_WIDTH - 1 downto 0));
              reduced.outside := not is_inside and to_std_logic(INWARDS);
            end if;

            -- an error may come nearer in step one by crossing the whole band
            if (INWARDS and m = 0 and reduced.length = 0) then
              reduced.length(0) := '1';
            end if;

            -- half the steps next: 3/2 of the change on where these are taken, 1/2 back where not
            ahead := unsigned(shift_right(shift_left(triple(x), m), 1));
            back  := unsigned(shift_right(curve, 1));

            for i in 0 to SLOPE_WIDTH - 1 loop
              change(i + 1) := (ahead(i) and accept) or (not back(i) and not accept);
            end loop;

            change(0) := not accept;
            changed   := (unsigned(secant) & '1') + change;

            reduced.secant := signed(changed(SLOPE_WIDTH downto 1));

            -- as a whole: of four assignments to parts of the signal GHDL 2.0 may lose one
            lanes(DECIDED)(x) <= reduced;
          end if;
        end loop;
      end if;

    end process p_bit;

  end generate g_bits;

  limit(ALLOWED_AT) <= allowed;

  p_limit : process (clk) is
  begin

    if rising_edge(clk) then
      limit(ALLOWED_AT + 1 to SHORTEST - 1) <= limit(ALLOWED_AT to SHORTEST - 2);
    end if;

  end process p_limit;

  p_shortest : process (clk) is
  begin

    if rising_edge(clk) then
      if (valid(SHORTEST - 1) = '1') then
        short <= shorter(shorter(lanes(LENGTH_WIDTH)(0).length, lanes(LENGTH_WIDTH)(1).length), limit(SHORTEST - 1));
      end if;

      if (valid(SHORTEST) = '1') then
        length <= shorter(short, lanes(LENGTH_WIDTH)(2).length);
      end if;
    end if;

  end process p_shortest;

end architecture rtl;
