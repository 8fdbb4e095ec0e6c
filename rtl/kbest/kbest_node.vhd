-- Prepares a node: what its children share, formed once (docs/specification.md, 10.2 and 10.7).
--
-- Three multipliers work for four clocks: effects of the voltages and decay of the error; squares of
-- the phase capacitors' excess and of where they are going, for the child that keeps all positions.
-- Formats: see kbest_types.
-- Latency: 8 clocks from start to done; prepared is stable until the next start.
-- Overflow: words saturate; saturated says so in the clock of done.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.kbest_constants.all;
  use work.kbest_types.all;

entity kbest_node is
  port (
    clk       : in    std_logic;  -- rising edge
    rst       : in    std_logic;  -- synchronous, active high
    start     : in    std_logic;  -- '1' for one clock: node and stage are given
    node      : in    node_t;     -- the node, sampled with start
    fresh     : in    std_logic;  -- '1': with start: the node is the first of its stage
    stage     : in    stage_t;    -- terms of its stage, sampled with start and fresh
    settings  : in    settings_t; -- stable
    done      : out   std_logic;  -- '1' for one clock: prepared is new
    prepared  : out   prepared_t; -- the node with what its children share
    saturated : out   std_logic   -- '1': a word has saturated
  );
end entity kbest_node;

architecture rtl of kbest_node is

  type products_t is array (0 to 2) of signed(2 * FACTOR_WIDTH - 1 downto 0);

  type factors_t is array (0 to 2) of factor_t;

  signal found    : prepared_t;
  signal steps    : std_logic_vector(0 to 7);
  signal change   : change_t;     -- of the error by the voltage of a phase
  signal base_u   : wide_error_t; -- error with drift and decay
  signal base_w   : wide_error_t;
  signal sum_u    : wide_error_t; -- of the voltages
  signal sum_w    : wide_error_t;
  signal a        : factors_t;
  signal b        : factors_t;
  signal products : products_t;
  signal clipped  : std_logic;

  -- product as a change of an error
  function effect (product : signed) return error_t is
  begin

    return resize(shift_right(product, FORCED_FRACTION), ERROR_WIDTH);

  end function effect;

  -- product as a decay of an error
  function decay_of (product : signed) return error_t is

    constant SHIFT : natural := FRACTION - SQUARED_SHIFT;

  begin

    return resize(shift_right(product, SHIFT), ERROR_WIDTH);

  end function decay_of;

begin

  p_prepare : process (clk) is

    variable wide  : signed(VOLTAGE_WIDTH downto 0);
    variable drawn : signed(VOLTAGE_WIDTH + 2 downto 0);
    variable terms : stage_t;
    variable flags : std_logic;
    variable cost  : wide_cost_t;
    variable more  : ahead_cost_t;

  begin

    if rising_edge(clk) then
      steps     <= start & steps(0 to 6);
      saturated <= '0';

      for i in 0 to 2 loop
        products(i) <= a(i) * b(i);
      end loop;

      if (start = '1') then
        found.node <= node;
        terms      := found.stage;

        if (fresh = '1') then
          terms := stage;
        end if;

        found.stage <= terms;
        flags       := '0';
        drawn       := resize(node.v_n, drawn'length);

        for x in 0 to 2 loop
          wide       := resize(node.d(x), wide'length)
                        + resize(times(terms.phase(x), CHARGED_OF(to_integer(node.positions(x)))), wide'length);
          found.d(x) <= clip(wide, VOLTAGE_WIDTH);
          flags      := flags or overflows(wide, VOLTAGE_WIDTH);
          drawn      := drawn
                        - resize(times(terms.neutral(x), DRAWN_OF(to_integer(node.positions(x)))), drawn'length);
        end loop;

        found.drawn <= drawn;
        clipped     <= flags;
      end if;

      -- operands: v_n and two of v_ph; the third; decay of the error, beside the squares
      if (steps(0) = '1') then
        a(0) <= resize(found.node.v_n, FACTOR_WIDTH);
        a(1) <= resize(found.node.d(0), FACTOR_WIDTH);
        a(2) <= resize(found.node.d(1), FACTOR_WIDTH);

        for i in 0 to 2 loop
          b(i) <= found.stage.forced;
        end loop;
      elsif (steps(1) = '1') then
        a(0) <= resize(found.node.d(2), FACTOR_WIDTH);
      elsif (steps(2) = '1') then
        a(0) <= resize(shift_right(found.node.w, SQUARED_SHIFT), FACTOR_WIDTH);
        b(0) <= found.stage.decay;
      else
        a(0) <= resize(shift_right(found.node.u, SQUARED_SHIFT), FACTOR_WIDTH);
      end if;

      for x in 0 to 2 loop
        if (steps(x + 1) = '1') then
          a(1) <= excess(found.d(x), settings.bound_phase);
          b(1) <= excess(found.d(x), settings.bound_phase);
          a(2) <= resize(ahead(found.d(x), found.node.d(x), found.stage.long, 2, VOLTAGE_AHEAD_SHIFT),
                         FACTOR_WIDTH);
          b(2) <= resize(ahead(found.d(x), found.node.d(x), found.stage.long, 2, VOLTAGE_AHEAD_SHIFT), FACTOR_WIDTH);
        end if;
      end loop;

      -- results
      if (steps(2) = '1') then
        found.on_neutral  <= effect(products(0));
        found.on_phase(0) <= effect(products(1));
        found.on_phase(1) <= effect(products(2));
      end if;

      if (steps(3) = '1') then
        found.on_phase(2) <= effect(products(0));
      end if;

      cost := cost_of(unsigned(products(1)(2 * EXCESS_WIDTH - 1 downto 0)), EXCESS_SHIFT, settings.weight_phase,
                      found.stage.long);
      more := resize(shift_right(unsigned(products(2)(2 * AHEAD_WIDTH - 1 downto 0)), CAPACITOR_AHEAD_SHIFT),
                     ahead_cost_t'length);

      for x in 0 to 2 loop
        if (steps(x + 3) = '1') then
          found.costs(x)  <= cost;
          found.aheads(x) <= more;
        end if;
      end loop;

      if (steps(3) = '1') then
        found.total <= found.node.cost + cost;
        found.ahead <= more;
      elsif (steps(4) = '1' or steps(5) = '1') then
        found.total <= found.total + cost;
        found.ahead <= found.ahead + more;
      end if;

      -- effects of the phases, one after the other
      for x in 0 to 2 loop
        if (steps(x + 3) = '1') then
          change <= change_of(found.node.positions(x), found.stage.level, found.on_neutral, found.on_phase(x));
        end if;
      end loop;

      if (steps(4) = '1') then
        base_w <= resize(found.node.w, base_w'length) + found.stage.drift_w - decay_of(products(0));
        sum_u  <= -shift_left(resize(change, sum_u'length), 1);
      end if;

      if (steps(5) = '1') then
        base_u <= resize(found.node.u, base_u'length) + found.stage.drift_u - decay_of(products(0));
        sum_u  <= sum_u + change;
        sum_w  <= base_w - change;
      end if;

      if (steps(6) = '1') then
        found.keep_u <= base_u + sum_u + change;
        found.keep_w <= sum_w + change;
        saturated    <= clipped;
      end if;

      if (rst = '1') then
        steps <= (others => '0');
      end if;
    end if;

  end process p_prepare;

  done     <= steps(7);
  prepared <= found;

end architecture rtl;
