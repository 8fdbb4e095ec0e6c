-- The children of a node, one a clock (docs/specification.md, sections 10.2 and 10.7).
--
-- A prepared node comes with load.  Its children follow in the order of their codes: first the one that
-- keeps all positions, then the moves of phase a, b and c.  A child differs from the one that keeps by
-- what its phase changes.  Its state is there before its key, so that it can be stored at once: under the number
-- that it has in its stage.
-- Formats: see kbest_types.
-- Latency: from a child's code 3 clocks to state_valid, 8 to child_valid and 9 to the listed words; initiation interval
-- one clock.  busy is '0' in the last child's clock, so that the next node may be loaded then.  prepared is read in the
-- clock of load and in the next one, but total and ahead in the fourth clock behind load.
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
    node          : in    node_t;                       -- the node, from two clocks before load to one behind it
    half          : in    std_logic;                    -- with load: half of the memories of its phases
    place         : in    unsigned(1 downto 0);         -- with load: last bits of its stage's place
    -- what belongs to a phase of the node
    voltage_at    : out   std_logic_vector(2 downto 0); -- half and phase
    voltage       : in    voltage_t;                    -- v_ph - v_dc/4 in front of the stage
    effect        : in    error_t;                      -- change of the error by it
    share_at      : out   std_logic_vector(2 downto 0); -- half and phase
    share         : in    prepared_phase_t;             -- shares in total and ahead
    charge_at     : out   std_logic_vector(3 downto 0); -- place and phase
    neutral       : in    voltage_t;                    -- what the charge of that phase takes from v_n
    charge        : in    voltage_t;                    -- what it adds to v_ph
    alone         : in    std_logic;                    -- '1': with load: one child, that keeps, and free
    has_plan      : in    std_logic;                    -- '1': with load: planned node, not of the last stage
    plan          : in    code_t;                       -- code of the plan, from a clock before load on
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
    -- the same a clock later, when the list tells whether it takes the child
    listed_number  : out   number_t;                    -- number in the stage
    listed_planned : out   std_logic;                   -- '1': it follows the plan
    listed_parity  : out   std_logic;                   -- of its stage
    pending        : out   std_logic_vector(1 downto 0); -- '1': a child of a stage of this parity is not listed yet
    saturated     : out   std_logic                     -- '1': a word of it has saturated
  );
end entity kbest_children;

architecture rtl of kbest_children is

  constant LAST   : natural := 7; -- clocks from a child's code to its key
  constant LISTED : natural := 8; -- to the list's answer

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

  type tags_t is array (1 to LISTED) of tag_t;

  type places_t is array (2 to LAST) of std_logic_vector(8 downto 0);

  type squares_t is array (0 to 1) of unsigned(2 * FACTOR_WIDTH - 1 downto 0);

  type factors_t is array (0 to 1) of factor_t;

  -- what a child needs behind its state
  type rest_t is record
    half   : std_logic;
    phase  : natural range 0 to 2;
    moves  : std_logic;
    long   : std_logic;
    effort : natural range 0 to 3; -- times lambda_u
  end record rest_t;

  type rests_t is array (2 to 4) of rest_t;

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
  signal checked   : code_t;       -- that of the next node, where it has such a child
  signal phase     : natural range 0 to 2;
  signal index     : natural range 0 to 2;
  signal moving    : std_logic;
  signal others_of : unsigned(3 downto 0); -- children of the next node, but for the one that keeps
  signal left      : unsigned(3 downto 0); -- children that follow
  signal ending    : std_logic;    -- '1': no child follows
  signal positions : positions_t;
  signal current   : position_t;   -- of the phase
  signal level     : factor_t;
  signal on_neutral : error_t;
  signal my_half    : std_logic;
  signal my_place   : unsigned(1 downto 0);

  -- behind the first register
  signal tags      : tags_t;
  signal loaded    : std_logic_vector(1 to 4); -- clocks behind load
  signal active    : prepared_t;   -- for the second register
  signal total     : wide_cost_t;  -- for the fifth
  signal ahead_all : ahead_cost_t;
  signal former    : node_t;       -- the node
  signal half_1    : std_logic;
  signal neutral_1 : voltage_t;
  signal charge_1  : voltage_t;
  signal phase_1   : natural range 0 to 2;
  signal moving_1  : std_logic;
  signal delta_1   : change_t;
  signal from_1    : voltage_t;    -- v_ph of the phase, in front of the stage
  signal to_1      : position_t;
  signal u_plus    : std_logic;
  signal u_minus   : std_logic;
  signal w_plus    : std_logic;
  signal w_minus   : std_logic;
  signal n_plus    : std_logic;
  signal n_minus   : std_logic;
  signal d_plus    : std_logic;
  signal d_minus   : std_logic;
  signal forwards  : natural range 0 to 3;
  signal backwards : natural range 0 to 3;

  -- behind the second
  signal states   : node_t;
  signal places   : places_t;
  signal before_2 : node_t;
  signal from_2   : voltage_t;
  signal rest     : rests_t;

  signal factors  : factors_t;
  signal aheads_3 : aheads_in_t;
  signal over_n_3 : factor_t;
  signal over_p_3 : factor_t;

  signal squares  : squares_t;
  signal aheads_4 : ahead_squares_t;
  signal square_n : unsigned(2 * EXCESS_WIDTH - 1 downto 0);
  signal square_p : unsigned(2 * EXCESS_WIDTH - 1 downto 0);
  signal down_n   : unsigned(3 downto 0);
  signal down_p   : unsigned(3 downto 0);
  signal effort_4 : unsigned(EFFORT_WIDTH + 1 downto 0);

  signal cost_5   : wide_cost_t;
  signal cost_n5  : wide_cost_t;
  signal cost_p5  : wide_cost_t;
  signal error_5  : unsigned(COST_WIDTH - 1 downto 0);
  signal ahead_5  : ahead_cost_t;
  signal ahead_v5 : ahead_cost_t;
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
  ending <= '1' when left = 0 else
            '0';
  busy   <= running and not ending;

  p_issue : process (clk) is

    variable x : natural range 0 to 2;
    variable m : natural range 0 to 2;

  begin

    if rising_edge(clk) then
      if (running = '1') then
        number <= number + 1;
        left   <= left - 1;

        if (ending = '1') then
          running <= '0';
        elsif (moving = '0') then
          code <= to_unsigned(1, code'length);
        elsif (index = count(current) - 1) then
          code  <= to_unsigned(7, code'length);
          phase <= 2;
          index <= 0;

          if (phase = 0) then
            code  <= to_unsigned(4, code'length);
            phase <= 1;
          end if;

          current   <= positions(1);
          positions <= (positions(0), positions(2), positions(2));
        else
          code  <= code + 1;
          index <= index + 1;
        end if;
      end if;

      -- of the node that is loaded next
      others_of <= to_unsigned(count(node.positions(0)) + count(node.positions(1)) + count(node.positions(2)), 4);
      split(plan, x, m);
      checked   <= (others => '0');

      if (plan >= 1 and plan <= 9 and m < count(node.positions(x))) then
        checked <= plan;
      end if;

      if (load = '1') then
        positions  <= node.positions;
        current    <= node.positions(0);
        level      <= prepared.level;
        on_neutral <= prepared.on_neutral;
        my_half    <= half;
        my_place   <= place;

        running  <= '1';
        left     <= others_of;
        is_first <= first;
        of_stage <= place(0);
        code     <= (others => '0');
        phase    <= 0;
        index    <= 0;
        single   <= alone;

        if (alone = '1') then
          left <= (others => '0');
        end if;

        if (first = '1') then
          number <= (others => '0');
        end if;

        warm   <= has_plan;
        target <= checked;
      end if;

      if (rst = '1') then
        running <= '0';
      end if;
    end if;

  end process p_issue;

  p_children : process (clk) is

    variable s       : natural range 0 to 7;
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
    variable key     : unsigned(COST_WIDTH downto 0);

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

      loaded   <= load & loaded(1 to 3);
      phase_1  <= phase;
      moving_1 <= moving;
      s        := to_integer(current);
      t        := NEIGHBOUR_OF(s, index);
      -- with the sign of the level, which every move changes by one
      delta   := adjusted(resize(level, change_t'length), resize(effect, change_t'length),
                          to_std_logic(CAPACITOR_STEP(s, index) = LEVEL_STEP(s, index)),
                          to_std_logic(CAPACITOR_STEP(s, index) /= LEVEL_STEP(s, index)));
      delta_1 <= adjusted(delta, resize(on_neutral, change_t'length),
                          to_std_logic(NEUTRAL_STEP(s, index) = LEVEL_STEP(s, index)),
                          to_std_logic(NEUTRAL_STEP(s, index) = -LEVEL_STEP(s, index)));
      from_1   <= voltage;
      half_1   <= my_half;
      neutral_1 <= neutral;
      charge_1  <= charge;

      to_1    <= to_unsigned(t, position_t'length);
      rises   := to_std_logic(LEVEL_STEP(s, index) > 0);
      u_plus  <= moving and (rises xor to_std_logic(phase = 0));
      u_minus <= moving and not (rises xor to_std_logic(phase = 0));
      w_plus  <= moving and to_std_logic((phase = 2 and rises = '1') or (phase = 1 and rises = '0'));
      w_minus <= moving and to_std_logic((phase = 1 and rises = '1') or (phase = 2 and rises = '0'));
      n_plus  <= moving and to_std_logic(DRAWN_STEP(s, index) < 0);
      n_minus <= moving and to_std_logic(DRAWN_STEP(s, index) > 0);
      d_plus  <= to_std_logic(CHARGED_OF(t) > 0);
      d_minus <= to_std_logic(CHARGED_OF(t) < 0);

      forwards  <= 0;
      backwards <= 0;

      if (moving = '1') then
        forwards  <= EFFORT_FORWARDS(s, index);
        backwards <= EFFORT_BACKWARDS(s, index);
      end if;

      -- 2: its state
      if (loaded(1) = '1') then
        active <= prepared;
        former <= node;
      end if;

      tags(2 to LISTED) <= tags(1 to LISTED - 1);
      child             := former;
      twice             := resize(delta_1, twice'length);

      if (phase_1 = 0) then
        twice := shift_left(twice, 1);
      end if;

      u     := adjusted(active.keep_u, twice, u_plus, u_minus);
      w     := adjusted(active.keep_w, resize(delta_1, w'length), w_plus, w_minus);
      drawn := adjusted(active.drawn, resize(neutral_1, drawn'length), n_plus, n_minus);
      d     := adjusted(resize(from_1, d'length), resize(charge_1, d'length), d_plus, d_minus);
      flags := '0';

      child.d := clip(d, VOLTAGE_WIDTH);

      if (moving_1 = '1') then
        child.positions(phase_1) := to_1;
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
      from_2          <= from_1;
      rest(2)         <= (half_1, phase_1, moving_1, active.long, forwards);

      if (charge_1(VOLTAGE_WIDTH - 1) = '1') then
        rest(2).effort <= backwards;
      end if;

      -- 3: what is squared
      places(3 to LAST) <= places(2 to LAST - 1);
      rest(3 to 4)      <= rest(2 to 3);
      factors(0)        <= resize(shift_right(states.u, SQUARED_SHIFT), FACTOR_WIDTH);
      factors(1)        <= resize(shift_right(states.w, SQUARED_SHIFT), FACTOR_WIDTH);
      aheads_3(0)       <= ahead(states.u, before_2.u, rest(2).long, 3, ERROR_AHEAD_SHIFT);
      aheads_3(1)       <= ahead(states.w, before_2.w, rest(2).long, 3, ERROR_AHEAD_SHIFT);
      aheads_3(2)       <= ahead(states.v_n, before_2.v_n, rest(2).long, 2, VOLTAGE_AHEAD_SHIFT);
      aheads_3(3)       <= ahead(states.d, from_2, rest(2).long, 2, VOLTAGE_AHEAD_SHIFT);
      over_n_3          <= excess(states.v_n, settings.bound_neutral);
      over_p_3          <= excess(states.d, settings.bound_phase);

      -- 4: squares
      for i in 0 to 1 loop
        squares(i) <= unsigned(factors(i) * factors(i));
      end loop;

      for i in 0 to 3 loop
        aheads_4(i) <= unsigned(aheads_3(i) * aheads_3(i));
      end loop;

      square_n <= resize(unsigned(over_n_3 * over_n_3), square_n'length);
      square_p <= resize(unsigned(over_p_3 * over_p_3), square_p'length);
      down_n   <= down_of(settings.weight_neutral, rest(3).long);
      down_p   <= down_of(settings.weight_phase, rest(3).long);

      case rest(3).effort is

        when 0 =>
          effort_4 <= (others => '0');

        when 1 =>
          effort_4 <= resize(settings.effort, effort_4'length);

        when 2 =>
          effort_4 <= shift_left(resize(settings.effort, effort_4'length), 1);

        when others =>
          effort_4 <= shift_left(resize(settings.effort, effort_4'length), 1) + settings.effort;

      end case;

      -- 5: costs
      if (loaded(4) = '1') then
        total     <= prepared.total;
        ahead_all <= prepared.ahead;
      end if;

      error_5  <= three(error_cost(squares(0), rest(4).long), error_cost(squares(1), rest(4).long));
      ahead_e5 <= three(resize(shift_right(aheads_4(0), CURRENT_AHEAD_SHIFT), ahead_cost_t'length),
                        resize(shift_right(aheads_4(1), CURRENT_AHEAD_SHIFT), ahead_cost_t'length));
      cost_n5  <= cost_of(square_n, down_n);
      ahead_v5 <= resize(shift_right(aheads_4(2), NEUTRAL_AHEAD_SHIFT), ahead_cost_t'length);
      cost_5   <= total;
      cost_p5  <= (others => '0');
      ahead_5  <= ahead_all;

      if (rest(4).moves = '1') then
        cost_5   <= total + effort_4 - share.cost;
        cost_p5  <= cost_of(square_p, down_p);
        ahead_5  <= ahead_all - share.ahead;
        ahead_v5 <= resize(shift_right(aheads_4(2), NEUTRAL_AHEAD_SHIFT), ahead_cost_t'length)
                    + resize(shift_right(aheads_4(3), CAPACITOR_AHEAD_SHIFT), ahead_cost_t'length);
      end if;

      -- 6: J
      total_6 <= cost_5 + error_5 + cost_n5 + cost_p5;
      ahead_6 <= ahead_5 + ahead_v5 + ahead_e5;

      -- 7: J and key, limited
      limited := resize(total_6, COST_WIDTH);

      if (tags(6).alone = '1') then
        limited := (others => '0');
      elsif (total_6(total_6'high downto COST_WIDTH) /= 0) then
        limited         := MOST;
        tags(7).clipped <= '1';
      end if;

      cost_7 <= limited;
      key    := resize(limited, key'length) + ahead_6;
      key_7  <= resize(key, COST_WIDTH);

      if (tags(6).planned = '1') then
        key_7 <= (others => '0');
      elsif (key(COST_WIDTH) = '1') then
        key_7 <= MOST;
      end if;

      if (rst = '1') then
        loaded <= (others => '0');

        for i in tags'range loop
          tags(i).valid <= '0';
        end loop;
      end if;
    end if;

  end process p_children;

  voltage_at <= my_half & std_logic_vector(to_unsigned(phase, 2));
  share_at   <= rest(4).half & std_logic_vector(to_unsigned(rest(4).phase, 2));
  charge_at  <= std_logic_vector(my_place) & std_logic_vector(to_unsigned(phase, 2));

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

  listed_number  <= tags(LISTED).number;
  listed_planned <= tags(LISTED).planned;
  listed_parity  <= tags(LISTED).parity;

  p_pending : process (running, of_stage, tags) is
  begin

    pending(1) <= running and of_stage;
    pending(0) <= running and not of_stage;

    for i in 1 to LAST loop
      if (tags(i).valid = '1' and tags(i).parity = '1') then
        pending(1) <= '1';
      end if;

      if (tags(i).valid = '1' and tags(i).parity = '0') then
        pending(0) <= '1';
      end if;
    end loop;

  end process p_pending;

end architecture rtl;
