-- The children of a node, one a clock (docs/specification.md, sections 10.2 and 10.7).
--
-- A prepared node comes with load.  Its children follow in the order of their codes: first the one that
-- keeps all positions, then the moves of phase a, b and c.  A child differs from the one that keeps by
-- what its phase changes.
-- Formats: see kbest_types.
-- Latency: 8 clocks from a child's code to child_valid; initiation interval one clock.  busy is '0' in the
-- last child's clock, so that the next node may be loaded then.
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
    clk           : in    std_logic;  -- rising edge
    rst           : in    std_logic;  -- synchronous, active high
    load          : in    std_logic;  -- '1': prepared is given, while busy is '0'
    prepared      : in    prepared_t; -- sampled with load
    alone         : in    std_logic;  -- '1': with load: the child that keeps is the only one, and free
    has_plan      : in    std_logic;  -- '1': with load: the node is the planned one of a stage that is not the last
    plan          : in    code_t;     -- code of the plan, with load
    first         : in    std_logic;  -- '1': with load: the node is the first of its stage
    parity        : in    std_logic;  -- with load: of the node's stage
    settings      : in    settings_t; -- stable
    busy          : out   std_logic;  -- '1': more children of the node follow
    child_valid   : out   std_logic;  -- '1': a child is there
    child         : out   node_t;     -- its state, J and positions
    child_key     : out   cost_t;     -- its key, 0 if it follows the plan
    child_code    : out   code_t;     -- its code
    child_planned : out   std_logic;  -- '1': it follows the plan
    child_first   : out   std_logic;  -- '1': it is the first of its stage
    child_parity  : out   std_logic;  -- of its stage
    pending       : out   std_logic_vector(1 downto 0); -- '1': a child of a stage of this parity is under way
    saturated     : out   std_logic   -- '1': a word of it has saturated
  );
end entity kbest_children;

architecture rtl of kbest_children is

  constant STAGES : natural := 7; -- behind the first register

  type tag_t is record
    valid   : std_logic;
    code    : code_t;
    planned : std_logic;
    first   : std_logic;
    parity  : std_logic;
    alone   : std_logic;
    clipped : std_logic;
  end record tag_t;

  constant TAG_INIT : tag_t := ('0', (others => '0'), '0', '0', '0', '0', '0');

  type tags_t is array (1 to STAGES) of tag_t;

  type states_t is array (2 to STAGES) of node_t;

  type squares_t is array (0 to 5) of unsigned(2 * FACTOR_WIDTH - 1 downto 0);

  type factors_t is array (0 to 5) of factor_t;

  subtype keep_t is signed(ERROR_WIDTH + 3 downto 0);

  -- issue
  signal active   : prepared_t;
  signal running  : std_logic;
  signal single   : std_logic;
  signal is_first : std_logic;
  signal of_stage : std_logic;
  signal code     : code_t;
  signal target   : code_t;   -- code of the plan
  signal warm     : std_logic;
  signal phase    : natural range 0 to 2;
  signal index    : natural range 0 to 2;
  signal moving   : std_logic;
  signal ending    : std_logic; -- '1': no child follows

  -- first register
  signal tags     : tags_t;
  signal node_1   : prepared_t;
  signal phase_1  : natural range 0 to 2;
  signal goal_1   : position_t;
  signal moving_1 : std_logic;
  signal effort_1 : unsigned(EFFORT_WIDTH + 1 downto 0);

  -- behind it
  signal states   : states_t;
  signal before_2 : node_t;
  signal moved_2  : voltage_t;  -- v_ph of the phase that moves, and in front of the stage
  signal from_2   : voltage_t;
  signal move_2   : std_logic;
  signal long_2   : std_logic;
  signal cost_2   : wide_cost_t;
  signal ahead_2  : ahead_cost_t;
  signal factors  : factors_t;
  signal move_3   : std_logic;
  signal long_3   : std_logic;
  signal cost_3   : wide_cost_t;
  signal ahead_3  : ahead_cost_t;
  signal over_n_3 : factor_t;
  signal over_p_3 : factor_t;
  signal squares  : squares_t;
  signal square_n : unsigned(2 * FACTOR_WIDTH - 1 downto 0);
  signal square_p : unsigned(2 * FACTOR_WIDTH - 1 downto 0);
  signal move_4   : std_logic;
  signal long_4   : std_logic;
  signal cost_4   : wide_cost_t;
  signal ahead_4  : ahead_cost_t;
  signal cost_5   : wide_cost_t;
  signal error_5  : wide_cost_t;
  signal volt_5   : wide_cost_t;
  signal ahead_5  : wide_cost_t;
  signal ahead_e5 : wide_cost_t;
  signal total_6  : wide_cost_t;
  signal ahead_6  : wide_cost_t;
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

    return resize(a, a'length + 3) + resize(b, a'length + 3) + shift_left(resize(b, a'length + 3), 1);

  end function three;

begin

  moving <= '0' when code = 0 else
            '1';
  ending  <= '1' when single = '1' or (moving = '1' and phase = 2 and index = count(active.node.positions(2)) - 1) else
            '0';
  busy   <= running and not ending;

  p_issue : process (clk) is

    variable x : natural range 0 to 2;
    variable m : natural range 0 to 2;

  begin

    if rising_edge(clk) then
      if (running = '1') then
        if (ending = '1') then
          running <= '0';
        elsif (moving = '0') then
          code  <= to_unsigned(1, code'length);
          phase <= 0;
          index <= 0;
        elsif (index = count(active.node.positions(phase)) - 1) then
          code  <= to_unsigned(3 * phase + 4, code'length);
          phase <= phase + 1;
          index <= 0;
        else
          code  <= code + 1;
          index <= index + 1;
        end if;
      end if;

      if (load = '1') then
        active   <= prepared;
        running  <= '1';
        single   <= alone;
        is_first <= first;
        of_stage <= parity;
        code     <= (others => '0');
        phase    <= 0;
        index    <= 0;
        warm     <= has_plan;
        target   <= (others => '0');
        split(plan, x, m);

        if (plan >= 1 and plan <= 9) then
          if (m < count(prepared.node.positions(x))) then
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
    variable t       : natural range 0 to 7;
    variable effort  : natural range 0 to 3;
    variable delta   : signed(ERROR_WIDTH + 1 downto 0);
    variable u       : keep_t;
    variable w       : keep_t;
    variable drawn   : signed(VOLTAGE_WIDTH + 2 downto 0);
    variable d       : signed(VOLTAGE_WIDTH downto 0);
    variable flags   : std_logic;
    variable state   : node_t;
    variable cost    : wide_cost_t;
    variable more    : wide_cost_t;
    variable ahead_of : ahead_cost_t;
    variable limited : cost_t;
    variable total   : unsigned(31 downto 0);

    constant MOST : cost_t := (others => '1');

  begin

    if rising_edge(clk) then
      -- 1: the child's phase and position
      tags(1) <= TAG_INIT;

      if (running = '1') then
        tags(1).valid <= '1';
        tags(1).code  <= code;
        tags(1).alone <= single;

        if (warm = '1' and code = target) then
          tags(1).planned <= '1';
        end if;

        if (is_first = '1' and moving = '0') then
          tags(1).first <= '1';
        end if;

        tags(1).parity <= of_stage;
      end if;

      node_1   <= active;
      phase_1  <= phase;
      moving_1 <= moving;
      s        := to_integer(active.node.positions(phase));
      goal_1   <= to_unsigned(NEIGHBOUR_OF(s, index), position_t'length);
      effort   := 0;

      if (moving = '1') then
        if (active.stage.phase(phase)(VOLTAGE_WIDTH - 1) = '1') then
          effort := EFFORT_BACKWARDS(s, index);
        else
          effort := EFFORT_FORWARDS(s, index);
        end if;
      end if;

      effort_1 <= (others => '0');

      if (effort = 1) then
        effort_1 <= resize(settings.effort, effort_1'length);
      elsif (effort = 2) then
        effort_1 <= shift_left(resize(settings.effort, effort_1'length), 1);
      elsif (effort = 3) then
        effort_1 <= shift_left(resize(settings.effort, effort_1'length), 1) + settings.effort;
      end if;

      -- 2: its state
      tags(2 to STAGES) <= tags(1 to STAGES - 1);
      state             := node_1.node;
      state.d           := node_1.d;
      u                 := node_1.keep_u;
      w                 := node_1.keep_w;
      drawn             := node_1.drawn;
      flags             := '0';
      s                 := to_integer(node_1.node.positions(phase_1));
      t                 := to_integer(goal_1);
      d                 := resize(node_1.node.d(phase_1), d'length)
                           + resize(times(node_1.stage.phase(phase_1), CHARGED_OF(t)), d'length);
      cost              := node_1.costs(0) + node_1.costs(1) + node_1.costs(2);
      ahead_of          := node_1.aheads(0) + node_1.aheads(1) + node_1.aheads(2);

      if (moving_1 = '1') then
        delta := resize(change_of(goal_1, node_1.stage.level, node_1.on_neutral,
                                  node_1.on_phase(phase_1)), delta'length)
                 - node_1.change(phase_1);

        if (phase_1 = 0) then
          u := u - shift_left(resize(delta, u'length), 1);
        elsif (phase_1 = 1) then
          u := u + delta;
          w := w - delta;
        else
          u := u + delta;
          w := w + delta;
        end if;

        if (DRAWN_OF(s) = 1) then
          drawn := drawn + node_1.stage.neutral(phase_1);
        end if;

        if (DRAWN_OF(t) = 1) then
          drawn := drawn - node_1.stage.neutral(phase_1);
        end if;

        state.d(phase_1)         := clip(d, VOLTAGE_WIDTH);
        state.positions(phase_1) := goal_1;
        flags                    := flags or overflows(d, VOLTAGE_WIDTH);
        cost                     := cost - node_1.costs(phase_1);
        ahead_of                 := ahead_of - node_1.aheads(phase_1);
      end if;

      state.u         := clip(u, ERROR_WIDTH);
      state.w         := clip(w, ERROR_WIDTH);
      state.v_n       := clip(drawn, VOLTAGE_WIDTH);
      flags           := flags or overflows(u, ERROR_WIDTH) or overflows(w, ERROR_WIDTH)
                         or overflows(drawn, VOLTAGE_WIDTH);
      states(2)       <= state;
      tags(2).clipped <= flags;
      before_2        <= node_1.node;
      moved_2         <= state.d(phase_1);
      from_2          <= node_1.node.d(phase_1);
      move_2          <= moving_1;
      long_2          <= node_1.stage.long;
      cost_2          <= cost + effort_1 + node_1.node.cost;
      ahead_2         <= ahead_of;

      -- 3: what is squared
      states(3)  <= states(2);
      factors(0) <= resize(shift_right(states(2).u, SQUARED_SHIFT), FACTOR_WIDTH);
      factors(1) <= resize(shift_right(states(2).w, SQUARED_SHIFT), FACTOR_WIDTH);
      factors(2) <= resize(ahead(states(2).u, before_2.u, long_2, 3, ERROR_AHEAD_SHIFT), FACTOR_WIDTH);
      factors(3) <= resize(ahead(states(2).w, before_2.w, long_2, 3, ERROR_AHEAD_SHIFT), FACTOR_WIDTH);
      factors(4) <= resize(ahead(states(2).v_n, before_2.v_n, long_2, 2, VOLTAGE_AHEAD_SHIFT), FACTOR_WIDTH);
      factors(5) <= resize(ahead(moved_2, from_2, long_2, 2, VOLTAGE_AHEAD_SHIFT), FACTOR_WIDTH);
      over_n_3   <= excess(states(2).v_n, settings.bound_neutral);
      over_p_3   <= excess(moved_2, settings.bound_phase);
      move_3     <= move_2;
      long_3     <= long_2;
      cost_3     <= cost_2;
      ahead_3    <= ahead_2;

      -- 4: squares
      states(4) <= states(3);

      for i in 0 to 5 loop
        squares(i) <= unsigned(factors(i) * factors(i));
      end loop;

      square_n <= unsigned(over_n_3 * over_n_3);
      square_p <= unsigned(over_p_3 * over_p_3);
      move_4   <= move_3;
      long_4   <= long_3;
      cost_4   <= cost_3;
      ahead_4  <= ahead_3;

      -- 5: costs
      states(5) <= states(4);
      error_5   <= resize(three(cost_of(squares(0), COST_SHIFT, "0", long_4),
                               cost_of(squares(1), COST_SHIFT, "0", long_4)), error_5'length);
      more      := cost_of(square_n(2 * EXCESS_WIDTH - 1 downto 0), EXCESS_SHIFT, settings.weight_neutral, long_4);

      if (move_4 = '1') then
        more := more + cost_of(square_p(2 * EXCESS_WIDTH - 1 downto 0), EXCESS_SHIFT, settings.weight_phase, long_4);
      end if;

      volt_5   <= more;
      cost_5   <= cost_4;
      ahead_e5 <= resize(three(shift_right(squares(2), CURRENT_AHEAD_SHIFT),
                                shift_right(squares(3), CURRENT_AHEAD_SHIFT)), 31);
      more     := resize(ahead_4, more'length) + resize(shift_right(squares(4), NEUTRAL_AHEAD_SHIFT), 31);

      if (move_4 = '1') then
        more := more + resize(shift_right(squares(5), CAPACITOR_AHEAD_SHIFT), 31);
      end if;

      ahead_5 <= more;

      -- 6: J
      states(6) <= states(5);
      total_6   <= cost_5 + error_5 + volt_5;
      ahead_6   <= ahead_5 + ahead_e5;

      -- 7: J and key, limited
      states(7) <= states(6);

      if (tags(6).alone = '1') then
        limited := (others => '0');
      elsif (total_6 > resize(MOST, total_6'length)) then
        limited         := MOST;
        tags(7).clipped <= '1';
      else
        limited := resize(total_6, COST_WIDTH);
      end if;

      states(7).cost <= limited;
      total          := resize(limited, 32) + ahead_6;

      if (tags(6).planned = '1') then
        key_7 <= (others => '0');
      elsif (total > resize(MOST, total'length)) then
        key_7 <= MOST;
      else
        key_7 <= resize(total, COST_WIDTH);
      end if;

      if (rst = '1') then
        for i in tags'range loop
          tags(i).valid <= '0';
        end loop;
      end if;
    end if;

  end process p_children;

  child_valid   <= tags(STAGES).valid;
  child         <= states(STAGES);
  child_key     <= key_7;
  child_code    <= tags(STAGES).code;
  child_planned <= tags(STAGES).planned;
  child_first   <= tags(STAGES).first;
  child_parity  <= tags(STAGES).parity;

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

  saturated     <= tags(STAGES).valid and tags(STAGES).clipped;

end architecture rtl;
