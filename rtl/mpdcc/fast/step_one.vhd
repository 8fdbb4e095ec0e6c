-- Step one of a candidate: what is outside at k or k+1, how far, and how long the capacitors allow.
--
-- The lengths and excesses of the capacitor voltages and of v_n do not depend on the whole candidate.
-- capacitor_search writes them into a table here, row by row; a candidate reads four rows.
--
--   stage 5   largest of the three current errors at k+1
--   stage 6   its magnitude; rows of the three phases and of v_n
--   stage 7   excess of the currents over their bound, which answers a probe; rows compared in pairs
--   stage 8   allowed: shortest length of the four rows; 0 if a current is outside at k or k+1
--   stage 9   worst excess, for the deadlock rule
--
-- Largest error: the three add up to zero. Where a and b have one sign it is their sum, else the one
-- of them whose sign the sum has.
-- Weighted deadlock rule (WEIGHTED_DEADLOCK, chosen with limits.deadlock_rule): instead of the excess
--   16 * max(e_i, 8 * e_n, e_ph) + max(e_i),   e: excesses at k+1 of the currents, v_n and v_ph
-- is compared, in sixteenths of a trajectory unit, after one stage more. No decision takes longer for
-- it. Without deadlock_rule it is 16 times the excess, of the same order.
-- Formats: trajectory units; the rank is unsigned, of the order of the excess.
-- Latency: from the error at stage ERROR_STAGE 3 clocks to held, 4 to allowed, 5 to dead, 6 with the
-- weighted rule; one candidate a clock.
-- Overflow: the weighted rule's word holds every sum: an error of v_n at k has TERM_WIDTH bits, its
-- slope CURRENT_TERM_WIDTH + 1 at most, so that 128 * e_n is below 2**(RANK_WIDTH - 1).
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.explorer_types.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_types.all;

entity step_one is
  generic (
    SECOND_LEVEL      : boolean := false; -- true: two tables, and rows are written while others are read
    WEIGHTED_DEADLOCK : boolean := false  -- true: the weighted deadlock rule besides
  );
  port (
    clk       : in    std_logic;    -- rising edge
    limits    : in    limits_t;     -- bound of the currents, trajectory units
    band      : in    band_t;       -- what is outside at k
    capacitor : in    capacitor_t;  -- rows of the table as they come
    valid     : in    stages_t;     -- '1': the stage holds a candidate
    error     : in    pair_t;       -- of a and b at k+1, trajectory units, stage ERROR_STAGE
    connected : in    connection_t; -- rows of the candidate, stage SEARCH
    index     : in    index_t;      -- its place, stage DEAD_STAGE
    held      : out   std_logic;    -- '1': the currents are inside at k+1, stage PROBE_STAGE
    allowed   : out   length_t;     -- steps, stage ALLOW_STAGE; 0: a current is outside
    dead      : out   dead_t        -- for the deadlock rule, stage DEAD_STAGE or one later
  );
end entity step_one;

architecture rtl of step_one is

  constant ROW_BITS     : natural := choose(SECOND_LEVEL, 6, 5); -- of the phases' table
  constant NEUTRAL_BITS : natural := choose(SECOND_LEVEL, 4, 3); -- of the neutral point's
  -- bits that the weight on v_n adds to an excess
  constant WORST_WIDTH  : natural := TRAJECTORY_WIDTH + choose(WEIGHTED_DEADLOCK, DEADLOCK_NEUTRAL_SHIFT, 0);

  subtype entry_t is std_logic_vector(LENGTH_WIDTH + TRAJECTORY_WIDTH - 1 downto 0);

  type entries_t is array (0 to 2) of entry_t;

  subtype row_t is std_logic_vector(ROW_BITS - 1 downto 0);

  subtype neutral_row_t is std_logic_vector(NEUTRAL_BITS - 1 downto 0);

  subtype worst_t is signed(WORST_WIDTH - 1 downto 0);

  type excesses_t is array (0 to 1) of worst_t;

  type lengths_t is array (0 to 1) of length_t;

  function length_of (entry : entry_t) return length_t is
  begin

    return unsigned(entry(entry'high downto TRAJECTORY_WIDTH));

  end function length_of;

  function excess_of (entry : entry_t) return trajectory_t is
  begin

    return signed(entry(TRAJECTORY_WIDTH - 1 downto 0));

  end function excess_of;

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

  -- rows of the neutral point: two memories, each small enough for Yosys to keep it in LUTs
  signal neutral_write   : std_logic;
  signal neutral_place   : std_logic;
  signal neutral_number  : unsigned(3 downto 0);
  signal neutral_read    : neutral_row_t; -- row that the candidate reads
  signal neutral_new     : std_logic_vector(3 downto 0); -- row that comes
  signal neutral_row     : neutral_row_t; -- row at the read port
  signal neutral_written : neutral_row_t; -- row at the write port
  signal neutral_length  : std_logic_vector(LENGTH_WIDTH - 1 downto 0);
  signal neutral_excess  : std_logic_vector(TRAJECTORY_WIDTH - 1 downto 0);

  signal entry_6          : entries_t; -- of the phases
  signal neutral_length_6 : length_t;
  signal neutral_excess_6 : worst_t;

  signal outside     : std_logic_vector(SEARCH - 1 to PROBE_STAGE); -- '1': a current error is outside at k
  signal largest_5   : trajectory_t;
  signal distance_6  : trajectory_t;
  signal excess_7    : trajectory_t;
  signal excess_8    : trajectory_t; -- of the currents
  signal excess_caps : excesses_t;
  signal length_caps : lengths_t;
  signal caps_8      : worst_t;      -- of everything else
  signal excess_9    : worst_t;

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
    row    <= std_logic_vector(number(ROW_BITS - 1 downto 0));

    i_rows : entity work.ram
      generic map (
        ADDRESS_WIDTH => ROW_BITS,
        WIDTH         => LENGTH_WIDTH + TRAJECTORY_WIDTH
      )
      port map (
        clk           => clk,
        write         => capacitor.write,
        write_address => table_row,
        write_word    => written,
        read          => valid(SEARCH),
        read_address  => row,
        read_word     => entry_6(x)
      );

  end generate g_phases;

  ---------------------------------------------------------------------------------------------
  -- Rows of the neutral point
  ---------------------------------------------------------------------------------------------

  neutral_write  <= capacitor.write and capacitor.row(4);
  neutral_place  <= connected.bank and to_std_logic(connected.pattern /= "000");
  neutral_number <= neutral_place & unsigned(connected.pattern);
  neutral_read   <= std_logic_vector(neutral_number(NEUTRAL_BITS - 1 downto 0));
  neutral_new    <= capacitor.bank & std_logic_vector(capacitor.row(2 downto 0));

  g_two_ports : if SECOND_LEVEL generate
    neutral_row     <= neutral_read;
    neutral_written <= neutral_new(NEUTRAL_BITS - 1 downto 0);
  end generate g_two_ports;

  -- without a second level nothing is read while rows are written: a single port takes half the LUTs
  g_one_port : if not SECOND_LEVEL generate
    neutral_row     <= neutral_new(NEUTRAL_BITS - 1 downto 0) when capacitor.write = '1' else
                       neutral_read;
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
      if (valid(SEARCH) = '1') then
        neutral_length_6 <= unsigned(neutral_length);
        weighed          := resize(signed(neutral_excess), WORST_WIDTH);

        if (WEIGHTED_DEADLOCK and limits.deadlock_rule = '1') then
          weighed := shift_left(weighed, DEADLOCK_NEUTRAL_SHIFT);
        end if;

        neutral_excess_6 <= weighed;
      end if;
    end if;

  end process p_neutral;

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

  held <= to_std_logic(excess_7 <= 0);

  p_worst : process (clk) is

    variable shortest : length_t;

  begin

    if rising_edge(clk) then
      if (valid(SEARCH + 1) = '1') then
        excess_caps(0) <= worse(resize(excess_of(entry_6(0)), WORST_WIDTH),
                                resize(excess_of(entry_6(1)), WORST_WIDTH));
        excess_caps(1) <= worse(resize(excess_of(entry_6(2)), WORST_WIDTH), neutral_excess_6);
        length_caps(0) <= shorter(length_of(entry_6(0)), length_of(entry_6(1)));
        length_caps(1) <= shorter(length_of(entry_6(2)), neutral_length_6);
      end if;

      if (valid(PROBE_STAGE) = '1') then
        excess_8 <= excess_7;
        caps_8   <= worse(excess_caps(0), excess_caps(1));
        shortest := shorter(length_caps(0), length_caps(1));

        if (excess_7 > 0 or outside(PROBE_STAGE) = '1') then
          shortest := (others => '0');
        end if;

        allowed <= shortest;
      end if;

      if (valid(ALLOW_STAGE) = '1') then
        excess_9 <= worse(resize(excess_8, WORST_WIDTH), caps_8);
      end if;
    end if;

  end process p_worst;

  g_largest : if not WEIGHTED_DEADLOCK generate
    dead.valid <= valid(DEAD_STAGE);
    dead.rank  <= ranked(excess_9);
    dead.index <= index;
  end generate g_largest;

  g_weighted : if WEIGHTED_DEADLOCK generate

    signal current_9 : trajectory_t; -- worst excess of the currents

  begin

    dead.valid <= valid(DEAD_STAGE + 1);

    -- the sum has no carry into the low bits, which bypass the adder; signed order becomes unsigned
    -- order with the sign bit inverted
    p_rank : process (clk) is

      variable share : trajectory_t;
      variable sum   : worst_t;

    begin

      if rising_edge(clk) then
        if (valid(ALLOW_STAGE) = '1') then
          current_9 <= excess_8;
        end if;

        if (valid(DEAD_STAGE) = '1') then
          share := gated(current_9, limits.deadlock_rule);
          sum   := excess_9 + share(TRAJECTORY_WIDTH - 1 downto DEADLOCK_CURRENT_SHIFT);

          dead.rank  <= resize((not sum(WORST_WIDTH - 1)) & unsigned(sum(WORST_WIDTH - 2 downto 0))
                               & unsigned(share(DEADLOCK_CURRENT_SHIFT - 1 downto 0)), RANK_WIDTH);
          dead.index <= index;
        end if;
      end if;

    end process p_rank;

  end generate g_weighted;

end architecture rtl;
