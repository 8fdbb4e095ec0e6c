-- Step one of a candidate: what is outside at k or k+1, how far, and how long the capacitors allow.
--
-- The lengths and excesses of the capacitor voltages and of v_n do not depend on the whole candidate.
-- capacitor_search writes them into a table here, row by row; a candidate reads four rows.
--
--   stage 5   largest of the three current errors at k+1
--   stage 6   its magnitude; rows of phases a and b
--   stage 7   excess of the currents over their bound, which answers a probe; worse of a and b; rows of phase c and v_n
--   stage 8   allowed: shortest length of the four rows; 0 if a current is outside at k or k+1; excesses in pairs
--   stage 9   worst excess, for the deadlock rule
--
-- With a second level the table is in block RAM, and a register follows it: rows and all that is made of them are a
-- stage later. What answers a probe is not.
--
-- Largest error: the three add up to zero. Where a and b have one sign it is their sum, else the one
-- of them whose sign the sum has.
-- Weighted deadlock rule (WEIGHTED_DEADLOCK, chosen with limits.deadlock_rule): instead of the excess
--   16 * max(e_i, 8 * e_n, e_ph) + max(e_i),   e: excesses at k+1 of the currents, v_n and v_ph
-- is compared, in sixteenths of a trajectory unit, after one stage more. No decision takes longer for
-- it. Without deadlock_rule it is 16 times the excess, of the same order.
-- Rule inwards (INWARDS): inward_step says whether a current is dead. With a second level the rows of what does not
-- move are the root's; what is inside at the node has the whole horizon there, whatever it was at the root.
-- Formats: trajectory units; the rank is unsigned, of the order of the excess.
-- Latency: from the error at stage ERROR_STAGE 3 clocks to held, 4 to allowed, 5 to dead; with a second level one more
-- to allowed and dead, with the weighted rule one more to dead; one candidate a clock.
-- Overflow: the weighted rule's word holds every sum: an error of v_n at k has TERM_WIDTH bits, its
-- slope CURRENT_TERM_WIDTH + 1 at most, so that 128 * e_n is below 2**(RANK_WIDTH - 1).
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.explorer_types.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_types.all;

entity step_one is
  generic (
    SECOND_LEVEL      : boolean := false; -- true: two tables, and rows are written while others are read
    WEIGHTED_DEADLOCK : boolean := false; -- true: the weighted deadlock rule besides
    INWARDS           : boolean := false  -- true: the rule inwards besides
  );
  port (
    clk       : in    std_logic;    -- rising edge
    limits    : in    limits_t;     -- bound of the currents, trajectory units
    band      : in    band_t;       -- what is outside at k
    capacitor : in    capacitor_t;  -- rows of the table as they come
    valid     : in    stages_t;     -- '1': the stage holds a candidate
    error     : in    pair_t;       -- of a and b at k+1, trajectory units, stage ERROR_STAGE
    connected : in    connection_t; -- rows of the candidate, stage SEARCH
    gone      : in    std_logic;    -- INWARDS: '1': a current is dead, stage PROBE_STAGE, see inward_step
    index     : in    index_t;      -- its place, stage DEAD_STAGE or one later
    held      : out   std_logic;    -- '1': the currents are inside at k+1, stage PROBE_STAGE
    allowed   : out   length_t;     -- steps, stage ALLOW_STAGE or one later; 0: a current is outside
    dead      : out   dead_t        -- for the deadlock rule, stage DEAD_STAGE or later
  );
end entity step_one;

architecture rtl of step_one is

  constant ROW_BITS     : natural := choose(SECOND_LEVEL, 6, 5); -- of the phases' table
  constant NEUTRAL_BITS : natural := choose(SECOND_LEVEL, 4, 3); -- of the neutral point's
  -- bits that the weight on v_n adds to an excess
  constant WORST_WIDTH  : natural := TRAJECTORY_WIDTH + choose(WEIGHTED_DEADLOCK, DEADLOCK_NEUTRAL_SHIFT, 0);

  constant LATE         : natural := choose(SECOND_LEVEL, 1, 0); -- clocks of the register behind the table
  constant FIRST_ROWS   : natural := SEARCH + 1 + LATE;          -- stage of the rows of phases a and b

  subtype entry_t is std_logic_vector(LENGTH_WIDTH + TRAJECTORY_WIDTH - 1 downto 0);

  type entries_t is array (0 to 2) of entry_t;

  subtype row_t is std_logic_vector(ROW_BITS - 1 downto 0);

  subtype neutral_row_t is std_logic_vector(NEUTRAL_BITS - 1 downto 0);

  type neutral_rows_t is array (0 to 1 + LATE) of neutral_row_t;

  subtype worst_t is signed(WORST_WIDTH - 1 downto 0);

  function length_of (entry : entry_t) return length_t is
  begin

    return unsigned(entry(entry'high downto TRAJECTORY_WIDTH));

  end function length_of;

  function excess_of (entry : entry_t) return trajectory_t is
  begin

    return signed(entry(TRAJECTORY_WIDTH - 1 downto 0));

  end function excess_of;

  -- the row's length, or the whole horizon
  function at_rest (length : length_t; rests : std_logic; horizon : length_t) return length_t is
  begin

    if (rests = '1') then
      return horizon;
    else
      return length;
    end if;

  end function at_rest;

  function worse (a, b : worst_t) return worst_t is
  begin

    if (a > b) then
      return a;
    else
      return b;
    end if;

  end function worse;

  -- rows of the phases, one table for each that reads it
  signal written    : entry_t;
  signal row_number : unsigned(5 downto 0);
  signal table_row  : row_t; -- row that comes
  signal row_late   : row_t; -- row that phase c reads

  -- rows of the neutral point: two memories, each small enough for Yosys to keep it in LUTs
  signal neutral_write   : std_logic;
  signal neutral_place   : std_logic;
  signal neutral_number  : unsigned(3 downto 0);
  signal neutral_reads   : neutral_rows_t; -- row that the candidate reads, by stage from SEARCH on
  signal neutral_new     : std_logic_vector(3 downto 0); -- row that comes
  signal neutral_row     : neutral_row_t; -- row at the read port
  signal neutral_written : neutral_row_t; -- row at the write port
  signal neutral_length  : std_logic_vector(LENGTH_WIDTH - 1 downto 0);
  signal neutral_excess  : std_logic_vector(TRAJECTORY_WIDTH - 1 downto 0);

  signal rows_read   : std_logic_vector(0 to 2); -- '1': the row of the phase is read
  signal entry       : entries_t;                -- of the phases: a and b in stage FIRST_ROWS, c in the next
  signal neutral_far : length_t;                 -- of v_n, stage FIRST_ROWS + 1
  signal neutral_off : worst_t;
  signal block_far   : length_t;                 -- the same where no phase has a capacitor
  signal block_off   : worst_t;

  -- '1': the row is of what does not move and is inside; phases, v_n
  signal rests_early : std_logic_vector(0 to 3); -- stage FIRST_ROWS
  signal rests_late  : std_logic_vector(0 to 3); -- stage FIRST_ROWS + 1

  signal outside     : std_logic_vector(SEARCH - 1 to PROBE_STAGE); -- '1': a current error is outside at k
  signal largest_5   : trajectory_t;
  signal distance_6  : trajectory_t;
  signal excess_7    : trajectory_t;
  signal leaves_7    : std_logic;    -- '1': a current is outside at k or k+1
  signal current     : trajectory_t; -- excess of the currents, stage FIRST_ROWS + 1
  signal leaves      : std_logic;    -- likewise
  signal worse_pair  : worst_t;      -- of a and b, stage FIRST_ROWS + 1
  signal short_pair  : length_t;
  signal worse_late  : worst_t;      -- of c and v_n, stage FIRST_ROWS + 2
  signal worse_early : worst_t;      -- of a, b and the currents
  signal worst       : worst_t;      -- of all, stage FIRST_ROWS + 3

begin

  assert CURRENT_TERM_WIDTH + 3 < TERM_WIDTH and TERM_WIDTH < TRAJECTORY_WIDTH
    report "step_one: the weighted excess does not fit a rank"
    severity failure;

  ---------------------------------------------------------------------------------------------
  -- Rows of the phases
  ---------------------------------------------------------------------------------------------

  written    <= std_logic_vector(capacitor.length) & std_logic_vector(capacitor.excess);
  row_number <= capacitor.bank & capacitor.row;
  table_row  <= std_logic_vector(row_number(ROW_BITS - 1 downto 0));

  g_phases : for x in 0 to 2 generate

    signal place  : std_logic; -- which table; what does not move is the root's, in the first one
    signal number : unsigned(5 downto 0);
    signal row    : row_t;

  begin

    place  <= connected.bank and (connected.kind(x)(1) or connected.kind(x)(0));
    number <= place & to_unsigned(x, 3) & connected.kind(x);

    g_first : if x < 2 generate
      row          <= std_logic_vector(number(ROW_BITS - 1 downto 0));
      rows_read(x) <= valid(SEARCH);
    end generate g_first;

    g_second : if x = 2 generate
      rows_read(x) <= valid(SEARCH + 1);
      row          <= row_late;

      p_late : process (clk) is
      begin

        if rising_edge(clk) then
          row_late <= std_logic_vector(number(ROW_BITS - 1 downto 0));
        end if;

      end process p_late;

    end generate g_second;

    i_rows : entity work.ram
      generic map (
        ADDRESS_WIDTH => ROW_BITS,
        WIDTH         => LENGTH_WIDTH + TRAJECTORY_WIDTH,
        LATENCY       => 1 + LATE
      )
      port map (
        clk           => clk,
        write         => capacitor.write,
        write_address => table_row,
        write_word    => written,
        read          => rows_read(x),
        read_address  => row,
        read_word     => entry(x)
      );

  end generate g_phases;

  ---------------------------------------------------------------------------------------------
  -- Rows of the neutral point
  ---------------------------------------------------------------------------------------------

  neutral_write  <= capacitor.write and capacitor.row(4);
  neutral_place  <= connected.bank and to_std_logic(connected.pattern /= "000");
  neutral_number <= neutral_place & unsigned(connected.pattern);

  neutral_reads(0) <= std_logic_vector(neutral_number(NEUTRAL_BITS - 1 downto 0));

  p_neutral_reads : process (clk) is
  begin

    if rising_edge(clk) then
      neutral_reads(1 to 1 + LATE) <= neutral_reads(0 to LATE);
    end if;

  end process p_neutral_reads;

  neutral_new    <= capacitor.bank & std_logic_vector(capacitor.row(2 downto 0));

  g_two_ports : if SECOND_LEVEL generate
    neutral_row     <= neutral_reads(1 + LATE);
    neutral_written <= neutral_new(NEUTRAL_BITS - 1 downto 0);
  end generate g_two_ports;

  -- without a second level nothing is read while rows are written: a single port takes half the LUTs
  g_one_port : if not SECOND_LEVEL generate
    neutral_row     <= neutral_new(NEUTRAL_BITS - 1 downto 0) when capacitor.write = '1' else
                       neutral_reads(1 + LATE);
    neutral_written <= neutral_row;
  end generate g_one_port;

  i_neutral_lengths : entity work.ram
    generic map (
      ADDRESS_WIDTH => NEUTRAL_BITS,
      WIDTH         => LENGTH_WIDTH,
      LATENCY       => 0
    )
    port map (
      clk           => clk,
      write         => neutral_write,
      write_address => neutral_written,
      write_word    => written(written'high downto TRAJECTORY_WIDTH),
      read          => '1',
      read_address  => neutral_row,
      read_word     => neutral_length
    );

  i_neutral_excesses : entity work.ram
    generic map (
      ADDRESS_WIDTH => NEUTRAL_BITS,
      WIDTH         => TRAJECTORY_WIDTH,
      LATENCY       => 0
    )
    port map (
      clk           => clk,
      write         => neutral_write,
      write_address => neutral_written,
      write_word    => written(TRAJECTORY_WIDTH - 1 downto 0),
      read          => '1',
      read_address  => neutral_row,
      read_word     => neutral_excess
    );

  p_neutral : process (clk) is

    variable weighed : worst_t;

  begin

    if rising_edge(clk) then
      if (valid(FIRST_ROWS) = '1') then
        neutral_far <= unsigned(neutral_length);
        weighed     := resize(signed(neutral_excess), WORST_WIDTH);

        if (WEIGHTED_DEADLOCK and limits.deadlock_rule = '1') then
          weighed := shift_left(weighed, DEADLOCK_NEUTRAL_SHIFT);
        end if;

        neutral_off <= weighed;
      end if;
    end if;

  end process p_neutral;

  -- where no phase has a table in block RAM, the neutral point's is in one, and that in LUTs is not read
  g_block : if not HAS_CAPACITORS generate

    signal stored  : std_logic_vector(LENGTH_WIDTH + WORST_WIDTH - 1 downto 0);
    signal fetched : std_logic_vector(LENGTH_WIDTH + WORST_WIDTH - 1 downto 0);

  begin

    p_stored : process (capacitor, limits) is

      variable off : worst_t;

    begin

      off := resize(capacitor.excess, WORST_WIDTH);

      if (limits.deadlock_rule = '1' and WEIGHTED_DEADLOCK) then
        off := shift_left(off, DEADLOCK_NEUTRAL_SHIFT);
      end if;

      stored <= std_logic_vector(capacitor.length) & std_logic_vector(off);

    end process p_stored;

    block_far <= unsigned(fetched(fetched'high downto WORST_WIDTH));
    block_off <= signed(fetched(WORST_WIDTH - 1 downto 0));

    i_neutral : entity work.ram
      generic map (
        ADDRESS_WIDTH => NEUTRAL_BITS,
        WIDTH         => LENGTH_WIDTH + WORST_WIDTH,
        STYLE         => "block"
      )
      port map (
        clk           => clk,
        write         => neutral_write,
        write_address => neutral_new(NEUTRAL_BITS - 1 downto 0),
        write_word    => stored,
        read          => valid(FIRST_ROWS),
        read_address  => neutral_reads(1 + LATE),
        read_word     => fetched
      );

  end generate g_block;

  g_no_block : if HAS_CAPACITORS generate
    block_far <= (others => '0');
    block_off <= (others => '0');
  end generate g_no_block;

  ---------------------------------------------------------------------------------------------
  -- What does not move
  ---------------------------------------------------------------------------------------------

  -- its row is the root's: with the rule inwards what was outside there may be inside at a successor
  g_all_inside : if not (SECOND_LEVEL and INWARDS) generate
    rests_early <= (others => '0');
    rests_late  <= (others => '0');
  end generate g_all_inside;

  g_some_outside : if SECOND_LEVEL and INWARDS generate

    signal first  : std_logic_vector(0 to 3); -- '1': inside at the node; phases and v_n, first table
    signal second : std_logic_vector(0 to 3); -- second table
    signal fresh  : std_logic_vector(0 to 3); -- what comes now
    signal rests  : std_logic_vector(0 to 3); -- stage SEARCH + 1

  begin

    g_fresh : for x in 0 to 2 generate
      fresh(x) <= capacitor.write and to_std_logic(capacitor.row = 4 * x + 1);
    end generate g_fresh;

    fresh(3) <= capacitor.write and to_std_logic(capacitor.row = 17);

    p_inside : process (clk) is
    begin

      if rising_edge(clk) then
        for x in 0 to 3 loop
          first(x)  <= (fresh(x) and not capacitor.bank and capacitor.is_inside)
                       or (first(x) and not (fresh(x) and not capacitor.bank));
          second(x) <= (fresh(x) and capacitor.bank and capacitor.is_inside)
                       or (second(x) and not (fresh(x) and capacitor.bank));
        end loop;

        for x in 0 to 2 loop
          rests(x) <= ((first(x) and not connected.bank) or (second(x) and connected.bank))
                      and to_std_logic(connected.kind(x) = 0);
        end loop;

        rests(3) <= ((first(3) and not connected.bank) or (second(3) and connected.bank))
                    and to_std_logic(connected.pattern = "000");

        rests_early <= rests;
        rests_late  <= rests_early;
      end if;

    end process p_inside;

  end generate g_some_outside;

  ---------------------------------------------------------------------------------------------
  -- Excesses and the shortest length
  ---------------------------------------------------------------------------------------------

  p_currents : process (clk) is

    variable sum : trajectory_t;

  begin

    if rising_edge(clk) then
      -- the third one is known a stage later
      outside(SEARCH - 1)               <= band.outside(0) or band.outside(1);
      outside(SEARCH)                   <= outside(SEARCH - 1) or band.outside(2);
      outside(SEARCH + 1 to PROBE_STAGE) <= outside(SEARCH to PROBE_STAGE - 1);

      if (valid(ERROR_STAGE) = '1') then
        sum := error(0) + error(1);

        if (error(0)(TRAJECTORY_WIDTH - 1) = error(1)(TRAJECTORY_WIDTH - 1)) then
          largest_5 <= sum;
        elsif (error(0)(TRAJECTORY_WIDTH - 1) = sum(TRAJECTORY_WIDTH - 1)) then
          largest_5 <= error(0);
        else
          largest_5 <= error(1);
        end if;
      end if;

      if (valid(SEARCH) = '1') then
        distance_6 <= signed(magnitude(largest_5));
      end if;

      if (valid(SEARCH + 1) = '1') then
        excess_7 <= distance_6 - signed(resize(limits.bound_current, TRAJECTORY_WIDTH));
      end if;
    end if;

  end process p_currents;

  held     <= to_std_logic(excess_7 <= 0);

  g_bounds : if not INWARDS generate
    leaves_7 <= to_std_logic(excess_7 > 0) or outside(PROBE_STAGE);
  end generate g_bounds;

  g_inwards : if INWARDS generate
    leaves_7 <= gone;
  end generate g_inwards;

  g_direct : if LATE = 0 generate
    current <= excess_7;
    leaves  <= leaves_7;
  end generate g_direct;

  g_late : if LATE = 1 generate

    p_late : process (clk) is
    begin

      if rising_edge(clk) then
        current <= excess_7;
        leaves  <= leaves_7;
      end if;

    end process p_late;

  end generate g_late;

  p_worst : process (clk) is

    variable shortest : length_t;

  begin

    if rising_edge(clk) then
      if (valid(FIRST_ROWS) = '1') then
        worse_pair <= worse(resize(excess_of(entry(0)), WORST_WIDTH), resize(excess_of(entry(1)), WORST_WIDTH));
        short_pair <= shorter(at_rest(length_of(entry(0)), rests_early(0), limits.horizon),
                              at_rest(length_of(entry(1)), rests_early(1), limits.horizon));
      end if;

      if (valid(FIRST_ROWS + 1) = '1') then
        -- what the converter does not have is never the worst, nor the first to leave
        if (HAS_CAPACITORS and HAS_NEUTRAL) then
          worse_late  <= worse(resize(excess_of(entry(2)), WORST_WIDTH), neutral_off);
          worse_early <= worse(worse_pair, resize(current, WORST_WIDTH));
          shortest    := shorter(short_pair, shorter(at_rest(length_of(entry(2)), rests_late(2), limits.horizon),
                                                     at_rest(neutral_far, rests_late(3), limits.horizon)));
        elsif (HAS_CAPACITORS) then
          worse_late  <= resize(excess_of(entry(2)), WORST_WIDTH);
          worse_early <= worse(worse_pair, resize(current, WORST_WIDTH));
          shortest    := shorter(short_pair, at_rest(length_of(entry(2)), rests_late(2), limits.horizon));
        elsif (HAS_NEUTRAL) then
          worse_late  <= block_off;
          worse_early <= resize(current, WORST_WIDTH);
          shortest    := at_rest(block_far, rests_late(3), limits.horizon);
        else
          worse_early <= resize(current, WORST_WIDTH);
          shortest    := limits.horizon;
        end if;

        if (leaves = '1') then
          shortest := (others => '0');
        end if;

        allowed <= shortest;
      end if;

      if (valid(FIRST_ROWS + 2) = '1') then
        if (HAS_CAPACITORS or HAS_NEUTRAL) then
          worst <= worse(worse_early, worse_late);
        else
          worst <= worse_early;
        end if;
      end if;
    end if;

  end process p_worst;

  g_largest : if not WEIGHTED_DEADLOCK generate
    dead.valid <= valid(FIRST_ROWS + 3);
    dead.rank  <= ranked(worst);
    dead.index <= index;
  end generate g_largest;

  g_weighted : if WEIGHTED_DEADLOCK generate

    signal current_late  : trajectory_t; -- excess of the currents, stage FIRST_ROWS + 2
    signal current_worst : trajectory_t; -- with worst

  begin

    dead.valid <= valid(FIRST_ROWS + 4);

    -- the sum has no carry into the low bits, which bypass the adder; signed order becomes unsigned
    -- order with the sign bit inverted
    p_rank : process (clk) is

      variable share : trajectory_t;
      variable sum   : worst_t;

    begin

      if rising_edge(clk) then
        current_late  <= current;
        current_worst <= current_late;

        if (valid(FIRST_ROWS + 3) = '1') then
          share := gated(current_worst, limits.deadlock_rule);
          sum   := worst + share(TRAJECTORY_WIDTH - 1 downto DEADLOCK_CURRENT_SHIFT);

          dead.rank  <= resize((not sum(WORST_WIDTH - 1)) & unsigned(sum(WORST_WIDTH - 2 downto 0))
                               & unsigned(share(DEADLOCK_CURRENT_SHIFT - 1 downto 0)), RANK_WIDTH);
          dead.index <= index;
        end if;
      end if;

    end process p_rank;

  end generate g_weighted;

end architecture rtl;
