-- Prepares a node: what its children share, formed once (docs/specification.md, 10.2 and 10.7).
--
-- The phases come one after the other, so that one adder and a few multipliers serve all of them.  What belongs
-- to a phase goes to small memories with two halves, one for each of two nodes; the children read it there.  A
-- node's word has v_ph of one phase alone, the one that moved last; those of the other phases are in a memory
-- where its parent has left them.
-- Formats: see kbest_types.
-- Latency: 6 clocks from start to done.  level and on_neutral are there with done, the rest of prepared a clock
-- later, but total and ahead three clocks later.  The next start may come in the clock behind done.  Then total and
-- ahead stay for five clocks more, the rest of prepared for one clock more.
-- Overflow: words saturate; saturated says so in the clock behind done.
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
    clk          : in    std_logic;                    -- rising edge
    rst          : in    std_logic;                    -- synchronous, active high
    start        : in    std_logic;                    -- '1' for one clock: a node is given
    node         : in    node_t;                       -- the node, sampled with start
    code         : in    code_t;                       -- its code, sampled with start
    parent       : in    slot_t;                       -- rank of its parent, sampled with start
    rank         : in    slot_t;                       -- its own rank, sampled with start
    place        : in    unsigned(1 downto 0);         -- last bits of its stage's place, sampled with start
    long         : in    std_logic;                    -- '1': its stage lasts two steps, sampled with start
    coefficients : in    coefficients_t;               -- of the load
    settings     : in    settings_t;                   -- stable
    -- v_ph - v_dc/4 of the first node, written before its start as if its parent had rank 0
    root         : in    std_logic;                    -- '1': a word is given
    root_at      : in    std_logic_vector(2 downto 0); -- last bit of the parent's place, and phase
    root_word    : in    voltage_t;                    -- the word
    -- terms of the stage
    charge_at    : out   std_logic_vector(3 downto 0); -- place and phase
    neutral      : in    voltage_t;                    -- what the charge of that phase takes from v_n
    charge       : in    voltage_t;                    -- what it adds to v_ph
    linear_at    : out   std_logic_vector(3 downto 0); -- place and word
    linear       : in    factor_t;                     -- that word
    done         : out   std_logic;                    -- '1' for one clock: the node is prepared
    held         : out   node_t;                       -- the node, until the clock behind the next start
    prepared     : out   prepared_t;                   -- what its children share
    half         : out   std_logic;                    -- half of the memories below, with done
    -- what belongs to a phase, for a node's children; an address has the half and a phase
    voltage_at   : in    std_logic_vector(2 downto 0); -- address
    voltage      : out   voltage_t;                    -- v_ph - v_dc/4 in front of the stage
    effect       : out   error_t;                      -- change of the error by it
    share_at     : in    std_logic_vector(2 downto 0); -- address
    share        : out   prepared_phase_t;             -- shares in total and ahead
    saturated    : out   std_logic                     -- '1': a word has saturated
  );
end entity kbest_node;

architecture rtl of kbest_node is

  subtype phase_t is natural range 0 to 2;

  type phases_t is array (0 to 5) of phase_t;

  signal found     : prepared_t;
  signal steps     : std_logic_vector(0 to 7);
  signal own       : node_t;
  signal own_code  : code_t;
  signal own_parent : slot_t;
  signal own_rank  : slot_t;
  signal own_place : unsigned(1 downto 0);
  signal own_half  : std_logic;
  signal last_half : std_logic; -- a clock behind
  signal phases    : phases_t;  -- whose voltage is in kept, d and so on
  signal s_1       : position_t; -- its position
  signal s_2       : position_t;
  signal long_of_now : std_logic; -- found.long a clock later
  signal d         : voltage_t; -- v_ph - v_dc/4 in front of the stage
  signal now       : voltage_t; -- behind it
  signal former    : voltage_t; -- in front of it
  signal change    : change_t;  -- of the error by the voltage of a phase
  signal base_u    : wide_error_t; -- error with drift and decay
  signal base_w    : wide_error_t;
  signal sum_u     : wide_error_t; -- of the voltages
  signal sum_w     : wide_error_t;
  signal forced    : factor_t;  -- coefficients of the stage
  signal decay     : factor_t;
  signal decay_now : factor_t;  -- of the node that is given
  signal a_1       : factor_t;
  signal b_1       : factor_t;
  signal a_2       : signed(ERROR_WIDTH - SQUARED_SHIFT - 1 downto 0);
  signal b_2       : factor_t;
  signal product_0 : signed(VOLTAGE_WIDTH + FACTOR_WIDTH - 1 downto 0);
  signal product_1 : signed(2 * FACTOR_WIDTH - 1 downto 0);
  signal product_2 : signed(ERROR_WIDTH - SQUARED_SHIFT + FACTOR_WIDTH - 1 downto 0);
  signal down      : unsigned(3 downto 0);
  signal cost      : wide_cost_t;
  signal ahead_of  : ahead_cost_t;
  signal clipped   : std_logic;

  signal kept_write   : std_logic;
  signal kept_address : std_logic_vector(8 downto 0);
  signal kept_word    : std_logic_vector(VOLTAGE_WIDTH - 1 downto 0);
  signal kept_read    : std_logic_vector(8 downto 0);
  signal kept         : std_logic_vector(VOLTAGE_WIDTH - 1 downto 0);
  signal d_write      : std_logic;
  signal d_address    : std_logic_vector(2 downto 0);
  signal d_word       : std_logic_vector(VOLTAGE_WIDTH - 1 downto 0);
  signal effect_write : std_logic;
  signal effect_write_at : std_logic_vector(2 downto 0);
  signal late_write   : std_logic;
  signal late_address : std_logic_vector(2 downto 0);
  signal late_word    : std_logic_vector(SHARE_WIDTH - 1 downto 0);
  signal late_read    : std_logic_vector(SHARE_WIDTH - 1 downto 0);
  signal effect_in       : std_logic_vector(ERROR_WIDTH - 1 downto 0);
  signal effect_word     : std_logic_vector(ERROR_WIDTH - 1 downto 0);

  -- product as a change of an error
  function effect_of (product : signed) return error_t is
  begin

    return resize(shift_right(product, FORCED_FRACTION), ERROR_WIDTH);

  end function effect_of;

  -- product as a decay of an error
  function decay_of (product : signed) return error_t is
  begin

    return resize(shift_right(product, FRACTION - SQUARED_SHIFT), ERROR_WIDTH);

  end function decay_of;

  function bits_of (x : phase_t) return std_logic_vector is
  begin

    return std_logic_vector(to_unsigned(x, 2));

  end function bits_of;

begin

  charge_at <= std_logic_vector(own_place) & bits_of(phases(1));
  linear_at <= std_logic_vector(own_place) & "11" when steps(0) = '1' else
               std_logic_vector(own_place) & "10" when steps(1) = '1' else
               std_logic_vector(own_place) & "01";

  -- voltages of the phases that have not moved; read a clock ahead
  kept_write   <= root or steps(2) or steps(3) or steps(4);
  kept_address <= "00" & root_at(2) & x"0" & root_at(1 downto 0) when root = '1' else
                  "00" & own_place(0) & std_logic_vector(own_rank) & bits_of(phases(2));
  kept_word    <= std_logic_vector(root_word) when root = '1' else
                  std_logic_vector(now);
  kept_read    <= "00" & not place(0) & std_logic_vector(parent) & "00" when start = '1' else
                  "00" & not own_place(0) & std_logic_vector(own_parent) & "01" when steps(0) = '1' else
                  "00" & not own_place(0) & std_logic_vector(own_parent) & "10";

  i_kept : entity work.ram
    generic map (
      ADDRESS_WIDTH => 9,
      WIDTH         => VOLTAGE_WIDTH,
      LATENCY       => 1,
      STYLE         => "apart"
    )
    port map (
      clk           => clk,
      write         => kept_write,
      write_address => kept_address,
      write_word    => kept_word,
      read          => '1',
      read_address  => kept_read,
      read_word     => kept
    );

  decay_now <= coefficients.decay_2 when long = '1' else
               coefficients.decay_1;
  forced    <= coefficients.forced_2 when found.long = '1' else
               coefficients.forced_1;
  decay     <= coefficients.decay_2 when found.long = '1' else
               coefficients.decay_1;

  -- what belongs to the phases
  d_write         <= steps(1) or steps(2) or steps(3);
  d_address       <= own_half & bits_of(phases(1));
  d_word          <= std_logic_vector(d);
  effect_write    <= steps(2) or steps(3) or steps(4);
  effect_write_at <= own_half & bits_of(phases(2));
  effect_in       <= std_logic_vector(effect_of(product_0));
  late_write      <= steps(5) or steps(6) or steps(7);
  late_address    <= last_half & bits_of(phases(5));
  late_word       <= std_logic_vector(cost(SHARE_COST_WIDTH - 1 downto 0))
                     & std_logic_vector(ahead_of(SHARE_AHEAD_WIDTH - 1 downto 0));

  i_d : entity work.ram
    generic map (
      ADDRESS_WIDTH => 3,
      WIDTH         => VOLTAGE_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => d_write,
      write_address => d_address,
      write_word    => d_word,
      read          => '1',
      read_address  => voltage_at,
      signed(read_word) => voltage
    );

  i_late : entity work.ram
    generic map (
      ADDRESS_WIDTH => 3,
      WIDTH         => SHARE_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => late_write,
      write_address => late_address,
      write_word    => late_word,
      read          => '1',
      read_address  => share_at,
      read_word     => late_read
    );

  i_effect : entity work.ram
    generic map (
      ADDRESS_WIDTH => 3,
      WIDTH         => ERROR_WIDTH,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => effect_write,
      write_address => effect_write_at,
      write_word    => effect_in,
      read          => '1',
      read_address  => voltage_at,
      read_word     => effect_word
    );

  p_prepare : process (clk) is

    variable s     : natural range 0 to 7;
    variable wide  : signed(VOLTAGE_WIDTH downto 0);
    variable drawn : drawn_t;

  begin

    if rising_edge(clk) then
      steps     <= start & steps(0 to 6);
      saturated <= '0';
      last_half   <= own_half;
      long_of_now <= found.long;

      product_0 <= d * forced;
      product_1 <= a_1 * b_1;
      product_2 <= a_2 * b_2;

      phases(1 to 5) <= phases(0 to 4);

      if (phases(0) /= 2) then
        phases(0) <= phases(0) + 1;
      end if;

      if (start = '1') then
        phases(0)  <= 0;
        own        <= node;
        own_code   <= code;
        own_parent <= parent;
        own_rank   <= rank;
        own_place  <= place;
        own_half   <= not own_half;
        found.long <= long;
        clipped    <= '0';
      end if;

      -- the voltages, a phase in each of three clocks
      d <= signed(kept);

      if ((own_code >= 1 and own_code <= 3 and phases(0) = 0) or (own_code >= 4 and own_code <= 6 and phases(0) = 1)
          or (own_code >= 7 and phases(0) = 2)) then
        d <= own.d;
      end if;

      -- and behind the stage
      s_1    <= own.positions(phases(0));
      s_2    <= s_1;
      s      := to_integer(s_1);
      wide   := adjusted(resize(d, wide'length), resize(charge, wide'length), to_std_logic(CHARGED_OF(s) > 0),
                         to_std_logic(CHARGED_OF(s) < 0));
      now    <= clip(wide, VOLTAGE_WIDTH);
      former <= d;
      drawn  := found.drawn;

      if (steps(1) = '1') then
        drawn := resize(own.v_n, drawn'length);
      end if;

      if (steps(1) = '1' or steps(2) = '1' or steps(3) = '1') then
        found.drawn <= adjusted(drawn, resize(neutral, drawn'length), '0', to_std_logic(DRAWN_OF(s) > 0));
        clipped     <= clipped or overflows(wide, VOLTAGE_WIDTH);
      end if;

      -- operands: v_n and the decays first, then squares
      a_1 <= resize(excess(now, settings.bound_phase), FACTOR_WIDTH);
      b_1 <= excess(now, settings.bound_phase);
      a_2 <= resize(ahead(now, former, long_of_now, 2, VOLTAGE_AHEAD_SHIFT), a_2'length);
      b_2 <= resize(ahead(now, former, long_of_now, 2, VOLTAGE_AHEAD_SHIFT), b_2'length);

      if (start = '1') then
        a_1 <= resize(node.v_n, FACTOR_WIDTH);
        b_1 <= coefficients.forced_1;

        if (long = '1') then
          b_1 <= coefficients.forced_2;
        end if;

        a_2 <= node.w(ERROR_WIDTH - 1 downto SQUARED_SHIFT);
        b_2 <= decay_now;
      elsif (steps(0) = '1') then
        a_1 <= resize(shift_right(own.u, SQUARED_SHIFT), FACTOR_WIDTH);
        b_1 <= decay;
      end if;

      -- results
      if (steps(0) = '1') then
        found.level <= linear;
      end if;

      if (steps(1) = '1') then
        found.on_neutral <= effect_of(product_1);
        base_w           <= resize(own.w, base_w'length) + linear - decay_of(product_2);
      end if;

      if (steps(2) = '1') then
        base_u <= resize(own.u, base_u'length) + linear - decay_of(product_1);
      end if;

      down     <= down_of(settings.weight_phase, found.long);
      cost     <= cost_of(unsigned(product_1(2 * EXCESS_WIDTH - 1 downto 0)), down);
      ahead_of <= resize(shift_right(unsigned(product_2(2 * AHEAD_WIDTH - 1 downto 0)), CAPACITOR_AHEAD_SHIFT),
                         ahead_cost_t'length);

      if (steps(5) = '1') then
        found.total <= own.cost + cost;
        found.ahead <= ahead_of;
      elsif (steps(6) = '1' or steps(7) = '1') then
        found.total <= found.total + cost;
        found.ahead <= found.ahead + ahead_of;
      end if;

      -- effects of the phases, one after the other
      change <= change_of(s_2, found.level, found.on_neutral, effect_of(product_0));

      if (steps(3) = '1') then
        sum_u <= -shift_left(resize(change, sum_u'length), 1);
      end if;

      if (steps(4) = '1') then
        sum_u <= sum_u + change;
        sum_w <= base_w - change;
      end if;

      if (steps(5) = '1') then
        found.keep_u <= base_u + sum_u + change;
        found.keep_w <= sum_w + change;
        saturated    <= clipped;
      end if;

      if (rst = '1') then
        steps    <= (others => '0');
        own_half <= '0';
      end if;
    end if;

  end process p_prepare;

  done        <= steps(5);
  held        <= own;
  prepared    <= found;
  half        <= own_half;
  effect      <= signed(effect_word);
  share.cost  <= resize(unsigned(late_read(SHARE_WIDTH - 1 downto SHARE_AHEAD_WIDTH)), wide_cost_t'length);
  share.ahead <= resize(unsigned(late_read(SHARE_AHEAD_WIDTH - 1 downto 0)), ahead_cost_t'length);

end architecture rtl;
