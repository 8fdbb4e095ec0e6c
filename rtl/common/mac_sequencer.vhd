-- Sequencer of a microprogram of products: counts the clocks of a step and tells mac_blocks what to do.
--
-- start begins a step.  In every clock the row of PROGRAM for that clock, if there is one, appears at enable,
-- accumulate, alignment and the three selects; due has one bit for each of EVENTS, '1' in its clock.  Whoever
-- uses it connects the first group to one mac_block or several, and writes sums to registers with due.
--
-- Formats: clocks are counted from 0 in the clock after the edge that accepts start; the tables are explained in
-- mac_programs.  A row without a product leaves all outputs of the first group at zero.
-- Latency: the outputs of clock n follow the edge that accepts start by n clocks, without a register between
-- counter and outputs.  valid is high in clock VALID_AT + 1, busy in clocks 0 to LAST_AT.
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
    PROGRAM   : mac_program_t := EXAMPLE_PROGRAM; -- rows: clock, word of A, word of B, alignment, seed
    EVENTS    : mac_clocks_t  := EXAMPLE_EVENTS;  -- clocks in which bits of due are '1', index from 0
    VALID_AT  : natural       := 6;               -- clock after which valid is '1'
    LAST_AT   : natural       := 7;               -- last clock of a step
    A_BITS    : positive      := 2;               -- bits of a_select
    B_BITS    : positive      := 2;               -- bits of b_select
    SEEDS     : positive      := 2                -- number of seeds
  );
  port (
    clk         : in    std_logic;                                    -- rising edge
    rst         : in    std_logic;                                    -- synchronous, active high: ends a step
    start       : in    std_logic;                                    -- '1' for one clock: a step; ignored while busy
    -- to the mac_blocks
    enable      : out   std_logic;                                    -- '1': a product is issued
    accumulate  : out   std_logic;                                    -- '1': it is added to the sum so far
    alignment   : out   std_logic_vector(1 downto 0);                 -- steps of alignment, unsigned
    a_select    : out   std_logic_vector(A_BITS - 1 downto 0);        -- word for operand A, unsigned
    b_select    : out   std_logic_vector(B_BITS - 1 downto 0);        -- word for operand B, unsigned
    seed_select : out   std_logic_vector(SEEDS - 1 downto 0);         -- '1': the sum begins with this seed
    -- sequence
    due         : out   std_logic_vector(EVENTS'length - 1 downto 0); -- '1': clock of this event
    valid       : out   std_logic;                                    -- '1' for one clock: the result is there
    busy        : out   std_logic                                     -- '1': a step is under way
  );
end entity mac_sequencer;

architecture rtl of mac_sequencer is

  constant PARKED : positive := 2 ** selector_width(LAST_AT + 2) - 1; -- address of an idle sequencer

  signal active  : std_logic;
  signal address : natural range 0 to PARKED;

  -- whether every number of the tables fits its port and its clock
  function fits (bits_of_a, bits_of_b, seed_count, last : natural) return boolean is
  begin

    for i in PROGRAM'range(1) loop
      if (PROGRAM(i, 0) > last or PROGRAM(i, 1) >= 2 ** bits_of_a or PROGRAM(i, 2) >= 2 ** bits_of_b
          or PROGRAM(i, 3) > 3 or PROGRAM(i, 4) >= seed_count) then
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

  assert PROGRAM'length(2) = 5 and EVENTS'low = 0 and VALID_AT <= LAST_AT
    report "mac_sequencer: a row of PROGRAM has five numbers, EVENTS begins at 0, VALID_AT is not behind LAST_AT"
    severity failure;

  assert fits(A_BITS, B_BITS, SEEDS, LAST_AT)
    report "mac_sequencer: a clock of PROGRAM or EVENTS is behind LAST_AT, or a number has more bits than its port"
    severity failure;

  p_sequence : process (clk) is
  begin

    if rising_edge(clk) then
      valid <= to_std_logic(active = '1' and address = VALID_AT);

      if (active = '1') then
        if (address = LAST_AT) then
          active  <= '0';
          address <= PARKED;
        else
          address <= (address + 1) mod (PARKED + 1);
        end if;
      elsif (start = '1') then
        active  <= '1';
        address <= 0;
      end if;

      if (rst = '1') then
        active  <= '0';
        address <= PARKED;
        valid   <= '0';
      end if;
    end if;

  end process p_sequence;

  busy <= active;

  p_decode : process (address) is
  begin

    enable      <= '0';
    accumulate  <= '0';
    alignment   <= (others => '0');
    a_select    <= (others => '0');
    b_select    <= (others => '0');
    seed_select <= (others => '0');

    for i in PROGRAM'range(1) loop
      if (address = PROGRAM(i, 0)) then
        enable     <= '1';
        accumulate <= to_std_logic(PROGRAM(i, 4) = GATHER);
        a_select   <= std_logic_vector(to_unsigned(PROGRAM(i, 1), A_BITS));
        b_select   <= std_logic_vector(to_unsigned(PROGRAM(i, 2), B_BITS));
        alignment  <= std_logic_vector(to_unsigned(PROGRAM(i, 3), 2));

        if (PROGRAM(i, 4) /= GATHER) then
          seed_select(PROGRAM(i, 4)) <= '1';
        end if;
      end if;
    end loop;

  end process p_decode;

  g_due : for i in EVENTS'range generate
    due(i) <= to_std_logic(address = EVENTS(i));
  end generate g_due;

end architecture rtl;
