-- The children of a node, one a clock (docs/specification.md, sections 10.2 and 10.7).
--
-- A prepared node comes with load.  Its children follow in the order of their codes: first the one that
-- keeps all positions, then the moves of phase a, b and c.  A child differs from the one that keeps by
-- what its phase changes.  Its state is there before its key, so that it can be stored at once: under the number
-- that it has in its stage.
-- Formats: see kbest_types.
-- Latency: from a child's code 3 clocks to state_valid and 8 to child_valid; initiation interval one clock.  busy is
-- '0' in the last child's clock, so that the next node may be loaded then.  prepared is read in the clock of load
-- and in the next one.
-- Overflow: words saturate; saturated says so in the clock of child_valid.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.kbest_constants.all;
  use work.kbest_types.all;

entity kbest_children is
  port (
    clk           : in    std_logic;                    -- rising edge
    rst           : in    std_logic;                    -- synchronous, active high
    load          : in    std_logic;                    -- '1': prepared is given, while busy is '0'
    prepared      : in    prepared_t;                   -- with load, stable for one more clock
    node          : in    node_t;                       -- the node, with load, stable for one more clock
    half          : in    std_logic;                    -- with load: half of the memories of its phases
    place         : in    unsigned(1 downto 0);         -- with load: last bits of its stage's place
    -- what belongs to a phase of the node
    effect_at     : out   std_logic_vector(2 downto 0); -- half and phase
    effect        : in    error_t;                      -- change of the error by v_ph - v_dc/4
    share_at      : out   std_logic_vector(2 downto 0); -- half and phase
    share         : in    prepared_phase_t;             -- the others
    charge_at     : out   std_logic_vector(3 downto 0); -- place and phase
    neutral       : in    voltage_t;                    -- what the charge of that phase takes from v_n
    charge        : in    voltage_t;                    -- what it adds to v_ph
    alone         : in    std_logic;                    -- '1': with load: one child, that keeps, and free
    has_plan      : in    std_logic;                    -- '1': with load: planned node, not of the last stage
    plan          : in    code_t;                       -- code of the plan, with load
    first         : in    std_logic;                    -- '1': with load: the node is the first of its stage
    settings      : in    settings_t;                   -- stable
    busy          : out   std_logic;                    -- '1': more children of the node follow
    state_valid   : out   std_logic;                    -- '1': a child's state is there
    state         : out   node_t;                       -- its state, without J
    state_code    : out   code_t;                       -- its code
    state_number  : out   number_t;                     -- its number in the stage
    state_parity  : out   std_logic;                    -- of its stage
    child_valid   : out   std_logic;                    -- '1': a child's key is there
    child_cost    : out   cost_t;                       -- its J
    child_places  : out   std_logic_vector(8 downto 0); -- its positions, phase a on the left
    child_key     : out   cost_t;                       -- its key, 0 if it follows the plan
    child_number  : out   number_t;                     -- its number in the stage
    child_planned : out   std_logic;                    -- '1': it follows the plan
    child_first   : out   std_logic;                    -- '1': it is the first of its stage
    child_parity  : out   std_logic;                    -- of its stage
    pending       : out   std_logic_vector(1 downto 0); -- '1': a child of a stage of this parity is under way
    saturated     : out   std_logic                     -- '1': a word of it has saturated
  );
end entity kbest_children;

architecture rtl of kbest_children is

  constant LAST : natural := 7; -- clocks from a child's code to its key

  type tag_t is record
    valid   : std_logic;
    code    : code_t;
    number  : number_t;
    planned : std_logic;
    first   : std_logic;
    parity  : std_logic;
    alone   : std_logic;
    clipped : std_logic;
  end record tag_t;

  constant TAG_INIT : tag_t := ('0', (others => '0'), (others => '0'), '0', '0', '0', '0', '0');

  type tags_t is array (1 to LAST) of tag_t;

  type places_t is array (2 to LAST) of std_logic_vector(8 downto 0);

  type squares_t is array (0 to 1) of unsigned(2 * FACTOR_WIDTH - 1 downto 0);

  type factors_t is array (0 to 1) of factor_t;

  type aheads_in_t is array (0 to 3) of ahead_t;

  type ahead_squares_t is array (0 to 3) of unsigned(2 * AHEAD_WIDTH - 1 downto 0);

  -- issue
  signal running   : std_logic;
  signal single    : std_logic;
  signal is_first  : std_logic;
  signal of_stage  : std_logic;
  signal code      : code_t;
  signal number    : number_t;
  signal target    : code_t;       -- code of the plan
  signal warm      : std_logic;
  signal phase     : natural range 0 to 2;
  signal index     : natural range 0 to 2;
  signal moving    : std_logic;
  signal ending    : std_logic;    -- '1': no child follows
  signal positions : positions_t;
  signal level     : factor_t;
  signal on_neutral : error_t;
  signal my_half    : std_logic;
  signal my_place   : unsigned(1 downto 0);

  -- behind the first register
  signal tags      : tags_t;
  signal loaded    : std_logic;    -- '1': take what the second register needs
  signal active    : prepared_t;   -- for the second register
  signal former    : node_t;       -- the node
  signal half_1    : std_logic;
  signal place_1   : unsigned(1 downto 0);
  signal phase_1   : natural range 0 to 2;
  signal index_1   : natural range 0 to 2;
  signal moving_1  : std_logic;
  signal delta_1   : change_t;

  -- behind the second
  signal states   : node_t;
  signal places   : places_t;
  signal before_2 : node_t;
  signal from_2   : voltage_t;     -- v_ph of the phase that moves, in front of the stage
  signal move_2   : std_logic;
  signal long_2   : std_logic;
  signal cost_2   : wide_cost_t;
  signal ahead_2  : ahead_cost_t;

  signal factors  : factors_t;
  signal aheads_3 : aheads_in_t;
  signal move_3   : std_logic;
  signal long_3   : std_logic;
  signal cost_3   : wide_cost_t;
  signal ahead_3  : ahead_cost_t;
  signal over_n_3 : factor_t;
  signal over_p_3 : factor_t;

  signal squares  : squares_t;
  signal aheads_4 : ahead_squares_t;
  signal square_n : unsigned(2 * EXCESS_WIDTH - 1 downto 0);
  signal square_p : unsigned(2 * EXCESS_WIDTH - 1 downto 0);
  signal move_4   : std_logic;
  signal long_4   : std_logic;
  signal cost_4   : wide_cost_t;
  signal ahead_4  : ahead_cost_t;

  signal cost_5   : wide_cost_t;
  signal error_5  : unsigned(COST_WIDTH - 1 downto 0);
  signal ahead_5  : ahead_cost_t;
  signal ahead_e5 : ahead_cost_t;

  signal total_6  : wide_cost_t;
  signal ahead_6  : ahead_cost_t;

  signal cost_7   : cost_t;
  signal key_7    : cost_t;

  -- neighbours of the positions of a phase
  function count (s : position_t) return natural is
  begin

    return COUNT_OF(to_integer(s));

  end function count;

  -- code as a phase and a neighbour

  procedure split (value : code_t; variable x, m : out natural) is
  begin

    case to_integer(value) is

      when 1 | 2 | 3 =>
        x := 0;
        m := to_integer(value) - 1;

      when 4 | 5 | 6 =>
        x := 1;
        m := to_integer(value) - 4;

      when 7 | 8 | 9 =>
        x := 2;
        m := to_integer(value) - 7;

      when others =>
        x := 0;
        m := 0;

    end case;

  end procedure split;

  -- a + 3 b of two squares
  function three (a, b : unsigned) return unsigned is
  begin

    return a + b + shift_left(b, 1);

  end function three;

  -- square of an error as a cost
  function error_cost (square : unsigned; long : std_logic) return unsigned is
  begin

    if (long = '1') then
      return resize(shift_right(square, COST_SHIFT - 1), COST_WIDTH);
    end if;

    return resize(shift_right(square, COST_SHIFT), COST_WIDTH);

  end function error_cost;

begin

  moving <= '0' when code = 0 else
            '1';
  ending  <= '1' when single = '1' or (moving = '1' and phase = 2 and index = count(positions(2)) - 1) else
            '0';
  busy   <= running and not ending;

  p_issue : process (clk) is

    variable x : natural range 0 to 2;
    variable m : natural range 0 to 2;

  begin

    if rising_edge(clk) then
      if (running = '1') then
        number <= number + 1;

        if (ending = '1') then
          running <= '0';
        elsif (moving = '0') then
          code  <= to_unsigned(1, code'length);
          phase <= 0;
          index <= 0;
        elsif (index = count(positions(phase)) - 1) then
          code  <= to_unsigned(3 * phase + 4, code'length);
          phase <= phase + 1;
          index <= 0;
        else
          code  <= code + 1;
          index <= index + 1;
        end if;
      end if;

      if (load = '1') then
        positions  <= node.positions;
        level      <= prepared.level;
        on_neutral <= prepared.on_neutral;
        my_half    <= half;
        my_place   <= place;

        running  <= '1';
        single   <= alone;
        is_first <= first;
        of_stage <= place(0);
        code     <= (others => '0');
        phase    <= 0;
        index    <= 0;

        if (first = '1') then
          number <= (others => '0');
        end if;

        warm     <= has_plan;
        target   <= (others => '0');
        split(plan, x, m);

        if (plan >= 1 and plan <= 9) then
          if (m < count(node.positions(x))) then
            target <= plan;
          end if;
        end if;
      end if;

      if (rst = '1') then
        running <= '0';
      end if;
    end if;

  end process p_issue;

  p_children : process (clk) is

    variable s       : natural range 0 to 7;
    variable effort  : natural range 0 to 3;
    variable more_effort : unsigned(EFFORT_WIDTH + 1 downto 0);
    variable t       : natural range 0 to 7;
    variable delta   : change_t;
    variable rises   : std_logic;    -- '1': the move adds to u
    variable twice   : wide_error_t;
    variable u       : wide_error_t;
    variable w       : wide_error_t;
    variable drawn   : signed(VOLTAGE_WIDTH + 2 downto 0);
    variable d       : signed(VOLTAGE_WIDTH downto 0);
    variable flags   : std_logic;
    variable child   : node_t;
    variable limited : cost_t;
    variable total   : unsigned(COST_WIDTH downto 0);
    variable cost    : wide_cost_t;
    variable more    : ahead_cost_t;

    constant MOST : cost_t := (others => '1');

  begin

    if rising_edge(clk) then
      -- 1: what the child's move changes
      tags(1) <= TAG_INIT;

      if (running = '1') then
        tags(1).valid  <= '1';
        tags(1).code   <= code;
        tags(1).number <= number;
        tags(1).alone  <= single;

        if (warm = '1' and code = target) then
          tags(1).planned <= '1';
        end if;

        if (is_first = '1' and moving = '0') then
          tags(1).first <= '1';
        end if;

        tags(1).parity <= of_stage;
      end if;

      loaded   <= load;
      phase_1  <= phase;
      index_1  <= index;
      moving_1 <= moving;
      s        := to_integer(positions(phase));
      -- with the sign of the level, which every move changes by one
      delta   := adjusted(resize(level, change_t'length), resize(effect, change_t'length),
                          to_std_logic(CAPACITOR_STEP(s, index) = LEVEL_STEP(s, index)),
                          to_std_logic(CAPACITOR_STEP(s, index) /= LEVEL_STEP(s, index)));
      delta_1 <= adjusted(delta, resize(on_neutral, change_t'length),
                          to_std_logic(NEUTRAL_STEP(s, index) = LEVEL_STEP(s, index)),
                          to_std_logic(NEUTRAL_STEP(s, index) = -LEVEL_STEP(s, index)));
      half_1   <= my_half;
      place_1  <= my_place;

      -- 2: its state
      if (loaded = '1') then
        active <= prepared;
        former <= node;
      end if;

      tags(2 to LAST) <= tags(1 to LAST - 1);
      child           := former;
      s               := to_integer(former.positions(phase_1));
      t               := NEIGHBOUR_OF(s, index_1);

      rises := to_std_logic(LEVEL_STEP(s, index_1) > 0);
      twice := resize(delta_1, twice'length);

      if (phase_1 = 0) then
        twice := shift_left(twice, 1);
        rises := not rises;
      end if;

      u     := adjusted(active.keep_u, twice, moving_1 and rises, moving_1 and not rises);
      w     := adjusted(active.keep_w, resize(delta_1, w'length),
                        moving_1 and to_std_logic((phase_1 = 2 and rises = '1') or (phase_1 = 1 and rises = '0')),
                        moving_1 and to_std_logic((phase_1 = 1 and rises = '1') or (phase_1 = 2 and rises = '0')));
      drawn := adjusted(active.drawn, resize(neutral, drawn'length),
                        moving_1 and to_std_logic(DRAWN_STEP(s, index_1) < 0),
                        moving_1 and to_std_logic(DRAWN_STEP(s, index_1) > 0));
      d     := adjusted(resize(share.d, d'length), resize(charge, d'length),
                        to_std_logic(CHARGED_OF(t) > 0), to_std_logic(CHARGED_OF(t) < 0));
      flags := '0';

      child.d := clip(d, VOLTAGE_WIDTH);

      if (moving_1 = '1') then
        child.positions(phase_1) := to_unsigned(t, position_t'length);
        flags                    := overflows(d, VOLTAGE_WIDTH);
      end if;

      child.u         := clip(u, ERROR_WIDTH);
      child.w         := clip(w, ERROR_WIDTH);
      child.v_n       := clip(drawn, VOLTAGE_WIDTH);
      flags           := flags or overflows(u, ERROR_WIDTH) or overflows(w, ERROR_WIDTH)
                         or overflows(drawn, VOLTAGE_WIDTH);
      states          <= child;
      places(2)       <= std_logic_vector(child.positions(0)) & std_logic_vector(child.positions(1))
                         & std_logic_vector(child.positions(2));
      tags(2).clipped <= flags;
      before_2        <= former;
      from_2          <= share.d;
      move_2          <= moving_1;
      long_2          <= active.long;
      effort := 0;

      if (moving_1 = '1') then
        if (charge(VOLTAGE_WIDTH - 1) = '1') then
          effort := EFFORT_BACKWARDS(s, index_1);
        else
          effort := EFFORT_FORWARDS(s, index_1);
        end if;
      end if;

      more_effort := (others => '0');

      if (effort = 1) then
        more_effort := resize(settings.effort, more_effort'length);
      elsif (effort = 2) then
        more_effort := shift_left(resize(settings.effort, more_effort'length), 1);
      elsif (effort = 3) then
        more_effort := shift_left(resize(settings.effort, more_effort'length), 1) + settings.effort;
      end if;

      cost := active.total + more_effort;
      more := active.ahead;

      if (moving_1 = '1') then
        cost := cost - share.cost;
        more := more - share.ahead;
      end if;

      cost_2  <= cost;
      ahead_2 <= more;

      -- 3: what is squared
      places(3 to LAST) <= places(2 to LAST - 1);
      factors(0)        <= resize(shift_right(states.u, SQUARED_SHIFT), FACTOR_WIDTH);
      factors(1)        <= resize(shift_right(states.w, SQUARED_SHIFT), FACTOR_WIDTH);
      aheads_3(0)       <= ahead(states.u, before_2.u, long_2, 3, ERROR_AHEAD_SHIFT);
      aheads_3(1)       <= ahead(states.w, before_2.w, long_2, 3, ERROR_AHEAD_SHIFT);
      aheads_3(2)       <= ahead(states.v_n, before_2.v_n, long_2, 2, VOLTAGE_AHEAD_SHIFT);
      aheads_3(3)       <= ahead(states.d, from_2, long_2, 2, VOLTAGE_AHEAD_SHIFT);
      over_n_3          <= excess(states.v_n, settings.bound_neutral);
      over_p_3          <= excess(states.d, settings.bound_phase);
      move_3            <= move_2;
      long_3            <= long_2;
      cost_3            <= cost_2;
      ahead_3           <= ahead_2;

      -- 4: squares
      for i in 0 to 1 loop
        squares(i) <= unsigned(factors(i) * factors(i));
      end loop;

      for i in 0 to 3 loop
        aheads_4(i) <= unsigned(aheads_3(i) * aheads_3(i));
      end loop;

      square_n <= resize(unsigned(over_n_3 * over_n_3), square_n'length);
      square_p <= resize(unsigned(over_p_3 * over_p_3), square_p'length);
      move_4   <= move_3;
      long_4   <= long_3;
      cost_4   <= cost_3;
      ahead_4  <= ahead_3;

      -- 5: costs
      error_5  <= three(error_cost(squares(0), long_4), error_cost(squares(1), long_4));
      ahead_e5 <= three(resize(shift_right(aheads_4(0), CURRENT_AHEAD_SHIFT), ahead_cost_t'length),
                        resize(shift_right(aheads_4(1), CURRENT_AHEAD_SHIFT), ahead_cost_t'length));
      cost     := cost_4 + cost_of(square_n, EXCESS_SHIFT, settings.weight_neutral, long_4);
      more     := ahead_4 + resize(shift_right(aheads_4(2), NEUTRAL_AHEAD_SHIFT), ahead_cost_t'length);

      if (move_4 = '1') then
        cost := cost + cost_of(square_p, EXCESS_SHIFT, settings.weight_phase, long_4);
        more := more + resize(shift_right(aheads_4(3), CAPACITOR_AHEAD_SHIFT), ahead_cost_t'length);
      end if;

      cost_5  <= cost;
      ahead_5 <= more;

      -- 6: J
      total_6 <= cost_5 + error_5;
      ahead_6 <= ahead_5 + ahead_e5;

      -- 7: J and key, limited
      if (tags(6).alone = '1') then
        limited := (others => '0');
      elsif (total_6 > resize(MOST, total_6'length)) then
        limited         := MOST;
        tags(7).clipped <= '1';
      else
        limited := resize(total_6, COST_WIDTH);
      end if;

      cost_7 <= limited;
      total  := resize(limited, total'length) + ahead_6;

      if (tags(6).planned = '1') then
        key_7 <= (others => '0');
      elsif (total(COST_WIDTH) = '1') then
        key_7 <= MOST;
      else
        key_7 <= resize(total, COST_WIDTH);
      end if;

      if (rst = '1') then
        loaded <= '0';

        for i in tags'range loop
          tags(i).valid <= '0';
        end loop;
      end if;
    end if;

  end process p_children;

  effect_at <= my_half & std_logic_vector(to_unsigned(phase, 2));
  share_at  <= half_1 & std_logic_vector(to_unsigned(phase_1, 2));
  charge_at <= std_logic_vector(place_1) & std_logic_vector(to_unsigned(phase_1, 2));

  state_valid  <= tags(2).valid;
  state        <= states;
  state_code   <= tags(2).code;
  state_number <= tags(2).number;
  state_parity <= tags(2).parity;

  child_valid   <= tags(LAST).valid;
  child_cost    <= cost_7;
  child_places  <= places(LAST);
  child_key     <= key_7;
  child_number  <= tags(LAST).number;
  child_planned <= tags(LAST).planned;
  child_first   <= tags(LAST).first;
  child_parity  <= tags(LAST).parity;
  saturated     <= tags(LAST).valid and tags(LAST).clipped;

  p_pending : process (running, of_stage, tags) is
  begin

    pending(1) <= running and of_stage;
    pending(0) <= running and not of_stage;

    for i in tags'range loop
      if (tags(i).valid = '1' and tags(i).parity = '1') then
        pending(1) <= '1';
      end if;

      if (tags(i).valid = '1' and tags(i).parity = '0') then
        pending(0) <= '1';
      end if;
    end loop;

  end process p_pending;

end architecture rtl;
