-- Sequencer of a microprogram of products: counts the clocks of a step and tells mac_blocks what to do.
--
-- start begins a step.  In every clock the row of MAC_PROGRAM for that clock, if there is one, appears at enable,
-- accumulate, alignment and the three selects; due has one bit for each of EVENTS, '1' in its clock.  Whoever
-- uses it connects the first group to one mac_block or several, and writes sums to registers with due.
--
-- A program can have parts.  A step begins where entry says.  leave ends it with any clock.
--
-- The rows are in LUTs, or with IN_RAM in block RAM: fewer LUTs for a long program, and the same clocks.
--
-- Formats: clocks are counted from 0 in the clock after the edge that accepts start; the tables are explained in
-- mac_programs.  A row without a product leaves all outputs of the first group at zero.
-- Latency: the outputs of clock n follow the edge that accepts start by n clocks.  They are registers: the tables are
-- read a clock ahead.  b_ahead is early by that clock, for words of operand B in a RAM.  valid is high in clock
-- VALID_AT + 1, busy in clocks 0 to LAST_AT.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mac_programs.all;

entity mac_sequencer is
  generic (
    MAC_PROGRAM : mac_program_t := EXAMPLE_PROGRAM; -- rows: clock, word of A, word of B, alignment, seed
    EVENTS      : mac_clocks_t  := EXAMPLE_EVENTS;  -- clocks in which bits of due are '1', index from 0
    VALID_AT    : natural       := 6;               -- clock after which valid is '1'
    LAST_AT     : natural       := 7;               -- last clock of a step
    A_BITS      : positive      := 2;               -- bits of a_select
    B_BITS      : positive      := 2;               -- bits of b_select
    SEEDS       : positive      := 2;               -- number of seeds
    SECOND_AT   : natural       := 0;               -- clock of the second entry
    THIRD_AT    : natural       := 0;               -- clock of the third entry
    IN_RAM      : boolean       := false            -- true: the rows are in block RAM, false: in LUTs
  );
  port (
    clk         : in    std_logic;                                    -- rising edge
    rst         : in    std_logic;                                    -- synchronous, active high: ends a step
    start       : in    std_logic;                                    -- '1' for one clock: a step; ignored while busy
    entry       : in    std_logic_vector(1 downto 0);                 -- a step begins: 0 first, 1 second, else third
    leave       : in    std_logic;                                    -- '1': this clock of the step is its last
    -- to the mac_blocks
    enable      : out   std_logic;                                    -- '1': a product is issued
    accumulate  : out   std_logic;                                    -- '1': it is added to the sum so far
    alignment   : out   std_logic_vector(1 downto 0);                 -- steps of alignment, unsigned
    a_select    : out   std_logic_vector(A_BITS - 1 downto 0);        -- word for operand A, unsigned
    b_select    : out   std_logic_vector(B_BITS - 1 downto 0);        -- word for operand B, unsigned
    seed_select : out   std_logic_vector(SEEDS - 1 downto 0);         -- '1': the sum begins with this seed
    b_ahead     : out   std_logic_vector(B_BITS - 1 downto 0);        -- b_select of the next clock, unless it idles
    -- sequence
    due         : out   std_logic_vector(EVENTS'length - 1 downto 0); -- '1': clock of this event
    valid       : out   std_logic;                                    -- '1' for one clock: the result is there
    busy        : out   std_logic                                     -- '1': a step is under way
  );
end entity mac_sequencer;

architecture rtl of mac_sequencer is

  constant PARKED : positive := 2 ** selector_width(LAST_AT + 2) - 1; -- address of an idle sequencer

  type row_t is record
    enable      : std_logic;
    accumulate  : std_logic;
    alignment   : std_logic_vector(1 downto 0);
    a_select    : std_logic_vector(A_BITS - 1 downto 0);
    b_select    : std_logic_vector(B_BITS - 1 downto 0);
    seed_select : std_logic_vector(SEEDS - 1 downto 0);
    due         : std_logic_vector(EVENTS'length - 1 downto 0);
  end record row_t;

  constant NO_ROW : row_t := (
    enable      => '0',
    accumulate  => '0',
    alignment   => (others => '0'),
    a_select    => (others => '0'),
    b_select    => (others => '0'),
    seed_select => (others => '0'),
    due         => (others => '0')
  );

  signal active    : std_logic;
  signal address   : natural range 0 to PARKED;
  signal first     : natural range 0 to PARKED; -- of a step that starts now
  signal shown     : natural range 0 to PARKED; -- clock whose row is read
  signal following : natural range 0 to PARKED; -- clock behind that of address
  signal idles     : std_logic;                 -- in the next clock
  signal next_row  : row_t;                     -- that of following
  signal row       : row_t;                     -- of the next clock, unless it idles
  signal outputs   : row_t;

  -- the row of a clock
  function row_of (clock : natural) return row_t is

    variable found : row_t;

  begin

    found := NO_ROW;

    for i in MAC_PROGRAM'range(1) loop
      if (clock = MAC_PROGRAM(i, 0)) then
        found.enable     := '1';
        found.accumulate := to_std_logic(MAC_PROGRAM(i, 4) = GATHER);
        found.a_select   := std_logic_vector(to_unsigned(MAC_PROGRAM(i, 1), A_BITS));
        found.b_select   := std_logic_vector(to_unsigned(MAC_PROGRAM(i, 2), B_BITS));
        found.alignment  := std_logic_vector(to_unsigned(MAC_PROGRAM(i, 3), 2));

        if (MAC_PROGRAM(i, 4) /= GATHER) then
          found.seed_select(MAC_PROGRAM(i, 4)) := '1';
        end if;
      end if;
    end loop;

    for i in EVENTS'range loop
      found.due(i) := to_std_logic(clock = EVENTS(i));
    end loop;

    return found;

  end function row_of;

  -- whether every number of the tables fits its port and its clock
  function fits (bits_of_a, bits_of_b, seed_count, last : natural) return boolean is
  begin

    for i in MAC_PROGRAM'range(1) loop
      if (MAC_PROGRAM(i, 0) > last or MAC_PROGRAM(i, 1) >= 2 ** bits_of_a or MAC_PROGRAM(i, 2) >= 2 ** bits_of_b
          or MAC_PROGRAM(i, 3) > 3 or MAC_PROGRAM(i, 4) >= seed_count) then
        return false;
      end if;
    end loop;

    for i in EVENTS'range loop
      if (EVENTS(i) > last) then
        return false;
      end if;
    end loop;

    return true;

  end function fits;

begin

  assert MAC_PROGRAM'length(2) = 5 and EVENTS'low = 0 and VALID_AT <= LAST_AT
    report "mac_sequencer: a row of MAC_PROGRAM has five numbers, EVENTS begins at 0, VALID_AT is not behind LAST_AT"
    severity failure;

  assert fits(A_BITS, B_BITS, SEEDS, LAST_AT)
    report "mac_sequencer: a clock of MAC_PROGRAM or EVENTS is behind LAST_AT, or a number has more bits than its port"
    severity failure;

  first  <= THIRD_AT when entry(1) = '1' else
            SECOND_AT when entry(0) = '1' else
            0;

  p_sequence : process (clk) is
  begin

    if rising_edge(clk) then
      valid <= to_std_logic(active = '1' and address = VALID_AT);

      if (active = '1') then
        if (address = LAST_AT or leave = '1') then
          active  <= '0';
          address <= PARKED;
        else
          address <= (address + 1) mod (PARKED + 1);
        end if;
      elsif (start = '1') then
        active  <= '1';
        address <= first;
      end if;

      if (rst = '1') then
        active  <= '0';
        address <= PARKED;
        valid   <= '0';
      end if;
    end if;

  end process p_sequence;

  busy <= active;

  shown <= first when active = '0' else
           following;
  idles <= (leave or to_std_logic(address = LAST_AT)) when active = '1' else
           not start;

  -- the first rows are constants: entry is late and does not go through the table
  row <= next_row when active = '1' else
         row_of(THIRD_AT) when entry(1) = '1' else
         row_of(SECOND_AT) when entry(0) = '1' else
         row_of(0);

  g_luts : if not IN_RAM generate
    next_row <= row_of(following);
  end generate g_luts;

  g_ram : if IN_RAM generate

    constant ROW_BITS     : positive := 4 + A_BITS + B_BITS + SEEDS + EVENTS'length;
    constant ADDRESS_BITS : positive := selector_width(PARKED + 1);

    subtype bits_t is std_logic_vector(ROW_BITS - 1 downto 0);

    subtype rows_t is std_logic_vector((PARKED + 1) * ROW_BITS - 1 downto 0);

    -- all rows, that of clock 0 rightmost
    function packed_rows return std_logic_vector is

      variable one  : row_t;
      variable rows : rows_t;

    begin

      for clock in 0 to PARKED loop
        one := row_of(clock);
        rows((clock + 1) * ROW_BITS - 1 downto clock * ROW_BITS) := one.due & one.seed_select & one.b_select
                                                                    & one.a_select & one.alignment & one.accumulate
                                                                    & one.enable;
      end loop;

      return rows;

    end function packed_rows;

    constant ROWS : rows_t := packed_rows;

    signal place : std_logic_vector(ADDRESS_BITS - 1 downto 0);
    signal bits  : bits_t;

  begin

    -- the word comes when following has this clock
    place <= std_logic_vector(to_unsigned((shown + 1) mod (PARKED + 1), ADDRESS_BITS));

    i_rows : entity work.ram
      generic map (
        ADDRESS_WIDTH => ADDRESS_BITS,
        WIDTH         => ROW_BITS,
        LATENCY       => 1,
        STYLE         => "block",
        CONTENTS      => ROWS
      )
      port map (
        clk           => clk,
        write         => '0',
        write_address => (others => '0'),
        write_word    => (others => '0'),
        read          => '1',
        read_address  => place,
        read_word     => bits
      );

    next_row.enable      <= bits(0);
    next_row.accumulate  <= bits(1);
    next_row.alignment   <= bits(3 downto 2);
    next_row.a_select    <= bits(3 + A_BITS downto 4);
    next_row.b_select    <= bits(3 + A_BITS + B_BITS downto 4 + A_BITS);
    next_row.seed_select <= bits(3 + A_BITS + B_BITS + SEEDS downto 4 + A_BITS + B_BITS);
    next_row.due         <= bits(ROW_BITS - 1 downto 4 + A_BITS + B_BITS + SEEDS);

  end generate g_ram;

  p_outputs : process (clk) is
  begin

    if rising_edge(clk) then
      outputs   <= row;
      following <= (shown + 1) mod (PARKED + 1);

      if (rst = '1' or idles = '1') then
        outputs <= NO_ROW;
      end if;
    end if;

  end process p_outputs;

  enable      <= outputs.enable;
  accumulate  <= outputs.accumulate;
  alignment   <= outputs.alignment;
  a_select    <= outputs.a_select;
  b_select    <= outputs.b_select;
  b_ahead     <= row.b_select;
  seed_select <= outputs.seed_select;
  due         <= outputs.due;

end architecture rtl;
