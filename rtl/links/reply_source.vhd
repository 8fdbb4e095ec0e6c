-- Gives out the bytes of a reply, without CRC: header, then the payload that the request's type asks for.
--
-- What stands at each place of each reply is a table in block RAM: a constant byte, or the source of one. What has
-- to be of one moment is kept when the reply begins: gates, faults, enabled, tripped. The rest is stable meanwhile,
-- by the contract of its owner. Counters are looked at one after the other.
--
-- Formats: replies as in docs/protocol.md. number and address show their lowest byte; next_number and next_address
-- ask for the one after it.
-- Latency: the first byte four clocks after begins, then a byte a clock; that of a counter four after it is shown.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.link_constants.all;

entity reply_source is
  generic (
    CONTROLLER : positive range 1 to 3 := CONTROLLER_MPDCC; -- told in IDENTIFY
    EXPLORERS  : natural               := 2;                -- told in IDENTIFY
    OPTION     : boolean               := false;            -- told in IDENTIFY, bit 0 of options
    CLOCK_HZ   : positive              := 25_000_000;       -- told in IDENTIFY, Hz
    LIMIT      : positive              := 125_000;          -- told in IDENTIFY: clocks a frame may take
    PATIENCE   : positive              := LONGEST_DECISION  -- told in a STEP's reply without a decision: clocks
  );
  port (
    clk          : in    std_logic;                     -- rising edge
    rst          : in    std_logic;                     -- synchronous, active high
    begins       : in    std_logic;                     -- '1' for one clock: give out a reply
    ends         : out   std_logic;                     -- '1' for one clock: all bytes are out
    -- the request, stable until ends
    link         : in    std_logic;                     -- where it came from
    control      : in    std_logic;                     -- link in control
    outcome      : in    outcome_t;                     -- ACCEPTED, or REFUSED's reason
    kind         : in    byte_t;                        -- type
    number       : in    byte_t;                        -- sequence number, a byte of it
    next_number  : out   std_logic;                     -- '1' for one clock: the next byte is wanted
    address      : in    byte_t;                        -- of a READ or WRITE, a byte of it
    next_address : out   std_logic;                     -- '1' for one clock: the next byte is wanted
    second_half  : in    std_logic;                     -- of COUNTERS: '1': counters 8 to 15
    last         : in    std_logic_vector(31 downto 0); -- last number that acted on this link
    -- what was found, stable until ends
    response     : in    std_logic_vector(1 downto 0);  -- of the register access
    rdata        : in    std_logic_vector(31 downto 0); -- word read
    look         : out   std_logic;                     -- '1' until shown: a counter is wanted
    index        : out   std_logic_vector(4 downto 0);  -- which
    shown        : in    std_logic;                     -- '1' for one clock: value is that counter's
    value        : in    std_logic_vector(31 downto 0); -- count
    no_answer    : in    std_logic;                     -- '1': it is a STEP without a decision
    position     : in    std_logic_vector(15 downto 0); -- of a STEP
    flags        : in    byte_t;                        -- of a STEP: HELD to CLAMPED, EXHAUSTED
    length       : in    byte_t;                        -- of a STEP
    cycles       : in    std_logic_vector(15 downto 0); -- of a STEP
    -- gates, looked at with begins
    enabled      : in    std_logic;                     -- '1': gates are let through
    tripped      : in    std_logic;                     -- '1': a fault is latched
    faults       : in    std_logic_vector(15 downto 0); -- latched fault codes
    gates        : in    std_logic_vector(31 downto 0); -- gate signals, '1': on
    -- reply
    reply_valid  : out   std_logic;                     -- '1': reply_data is its next byte
    reply_data   : out   byte_t;                        -- byte
    reply_last   : out   std_logic                      -- '1' with the last byte
  );
end entity reply_source;

architecture rtl of reply_source is

  ---------------------------------------------------------------------------------------------
  -- The table
  ---------------------------------------------------------------------------------------------

  constant SOURCES : natural := 30;          -- bytes that are no constants
  constant PAIRS   : natural := SOURCES / 2; -- of them: one and-or gate takes two

  -- an entry: last byte, odd source of its pair, one bit for each pair, constant byte; zeros where it is none of these
  constant TABLE_BITS : natural := PAIRS + 10;
  constant LAST_BIT   : natural := PAIRS + 9;
  constant ODD_BIT    : natural := PAIRS + 8;

  subtype entry_t is std_logic_vector(TABLE_BITS - 1 downto 0);

  subtype source_t is natural range 0 to SOURCES - 1;

  subtype table_t is std_logic_vector(512 * TABLE_BITS - 1 downto 0);

  -- Replies: upper bits of a place in the table; those of a request that is served are its type's lowest bits.
  -- They are no slices of the types: GHDL 5.0.1 takes the value of such a slice for 0.
  constant OF_REFUSAL  : natural := 0;
  constant OF_IDENTITY : natural := to_integer(unsigned(TYPE_IDENTIFY)) mod 8;
  constant OF_COUNTERS : natural := to_integer(unsigned(TYPE_COUNTERS)) mod 8;
  constant OF_READ     : natural := to_integer(unsigned(TYPE_READ)) mod 8;
  constant OF_WRITE    : natural := to_integer(unsigned(TYPE_WRITE)) mod 8;
  constant OF_STEP     : natural := to_integer(unsigned(TYPE_STEP)) mod 8;
  constant OF_SILENCE  : natural := 6; -- STEP, no answer from the core

  -- sources; of words that of the lowest byte
  constant FROM_NUMBER   : source_t := 0;
  constant FROM_ADDRESS  : source_t := 1;
  constant FROM_KIND     : source_t := 2;
  constant FROM_OUTCOME  : source_t := 3;
  constant FROM_RESPONSE : source_t := 4;
  constant FROM_OPTIONS  : source_t := 5;
  constant FROM_LAST     : source_t := 6;
  constant FROM_RDATA    : source_t := 10;
  constant FROM_VALUE    : source_t := 14;
  constant FROM_GATES    : source_t := 18;
  constant FROM_POSITION : source_t := 22;
  constant FROM_FLAGS    : source_t := 24;
  constant FROM_LENGTH   : source_t := 25;
  constant FROM_CYCLES   : source_t := 26;
  constant FROM_FAULTS   : source_t := 28;

  -- an entry that stands for a byte of a source
  function taken (source : source_t) return entry_t is

    variable result : entry_t;

  begin

    result := (others => '0');

    result(ODD_BIT)        := to_std_logic(source mod 2 = 1);
    result(8 + source / 2) := '1';

    return result;

  end function taken;

  -- an entry that stands for itself
  function fixed (code : natural) return entry_t is
  begin

    return std_logic_vector(to_unsigned(code, TABLE_BITS));

  end function fixed;

  -- entries one after another, the first one leftmost

  type entries_t is array (natural range <>) of entry_t;

  -- the bytes of a source of several bytes
  function bytes_of (source : source_t; count : positive) return entries_t is

    variable result : entries_t(0 to count - 1);

  begin

    for i in result'range loop
      result(i) := taken(source + i);
    end loop;

    return result;

  end function bytes_of;

  -- a number in bytes, the lowest one first
  function number_of (whole : natural; count : positive) return entries_t is

    variable result : entries_t(0 to count - 1);
    variable rest   : natural;

  begin

    rest := whole;

    for i in result'range loop
      result(i) := fixed(rest mod 256);
      rest      := rest / 256;
    end loop;

    return result;

  end function number_of;

  -- what every reply begins with
  function header_of (code : byte_t; size : natural) return entries_t is

    variable result : entries_t(0 to 5);

  begin

    result    := (others => taken(FROM_NUMBER));
    result(0) := fixed(to_integer(unsigned(code or TYPE_REPLY)));
    result(1) := fixed(size);

    return result;

  end function header_of;

  -- the address of an access and its response
  function address_of return entries_t is

    variable result : entries_t(0 to 2);

  begin

    result    := (others => taken(FROM_ADDRESS));
    result(2) := taken(FROM_RESPONSE);

    return result;

  end function address_of;

  -- the values of all counters of a reply
  function counters_of return entries_t is

    variable result : entries_t(0 to 4 * COUNTERS_PER_REPLY - 1);

  begin

    for i in result'range loop
      result(i) := taken(FROM_VALUE + i mod 4);
    end loop;

    return result;

  end function counters_of;

  -- a table with one more reply; its last entry ends it
  function with_reply (replies : table_t; reply : natural; entries : entries_t) return table_t is

    variable result : table_t;
    variable place  : natural;

  begin

    result := replies;
    place  := 64 * reply;

    for i in entries'range loop
      result((place + 1) * TABLE_BITS - 1 downto place * TABLE_BITS) := entries(i);
      place := place + 1;
    end loop;

    result((place - 1) * TABLE_BITS + LAST_BIT) := '1';

    return result;

  end function with_reply;

  -- the table of all replies; places beyond a reply's last byte are never reached
  function all_replies return table_t is

    variable result : table_t;

  begin

    result := (others => '1');
    result := with_reply(result, OF_REFUSAL, header_of(TYPE_REFUSED, SIZE_REPLY_REFUSED) & taken(FROM_OUTCOME)
                         & taken(FROM_KIND) & bytes_of(FROM_LAST, 4));
    result := with_reply(result, OF_IDENTITY, header_of(TYPE_IDENTIFY, SIZE_REPLY_IDENTIFY) & fixed(PROTOCOL_VERSION)
                         & fixed(CONTROLLER) & fixed(EXPLORERS) & taken(FROM_OPTIONS) & bytes_of(FROM_LAST, 4)
                         & number_of(CLOCK_HZ, 4) & number_of(LIMIT, 4));
    result := with_reply(result, OF_COUNTERS, header_of(TYPE_COUNTERS, SIZE_REPLY_COUNTERS) & counters_of);
    result := with_reply(result, OF_READ, header_of(TYPE_READ, SIZE_REPLY_READ) & address_of & bytes_of(FROM_RDATA, 4));
    result := with_reply(result, OF_WRITE, header_of(TYPE_WRITE, SIZE_REPLY_WRITE) & address_of);
    result := with_reply(result, OF_STEP, header_of(TYPE_STEP, SIZE_REPLY_STEP) & bytes_of(FROM_POSITION, 2)
                         & taken(FROM_FLAGS) & taken(FROM_LENGTH) & bytes_of(FROM_CYCLES, 2) & bytes_of(FROM_FAULTS, 2)
                         & bytes_of(FROM_GATES, 4));
    result := with_reply(result, OF_SILENCE, header_of(TYPE_STEP, SIZE_REPLY_STEP) & number_of(0, 2)
                         & taken(FROM_FLAGS) & fixed(0) & number_of(PATIENCE, 2) & bytes_of(FROM_FAULTS, 2)
                         & bytes_of(FROM_GATES, 4));

    return result;

  end function all_replies;

  constant REPLIES : table_t := all_replies;

  ---------------------------------------------------------------------------------------------
  -- The sequence
  ---------------------------------------------------------------------------------------------

  type state_t is record
    busy   : std_logic;
    place  : unsigned(5 downto 0); -- of the byte whose entry is read
    fresh  : std_logic;            -- the entry of a clock ago is wanted
    ready  : std_logic;            -- entry is wanted
    looked : std_logic;            -- the counter of this place is there
    valid  : std_logic;
    last   : std_logic;
    ends   : std_logic;
  end record state_t;

  constant STATE_INIT : state_t := (
    busy   => '0',
    place  => (others => '0'),
    fresh  => '0',
    ready  => '0',
    looked => '0',
    valid  => '0',
    last   => '0',
    ends   => '0'
  );

  type bytes_t is array (0 to SOURCES - 1) of byte_t;

  signal r           : state_t;
  signal what        : unsigned(2 downto 0); -- which reply
  signal counting    : std_logic;            -- it is of counters
  signal kept_gates  : std_logic_vector(31 downto 0);
  signal kept_faults : std_logic_vector(15 downto 0);
  signal kept_flags  : byte_t;
  signal table_at    : std_logic_vector(8 downto 0);
  signal entry       : entry_t;
  signal words       : std_logic_vector(8 * (SOURCES - FROM_LAST) - 1 downto 0); -- sources of 8 bits, first rightmost
  signal sources_now : bytes_t;
  signal stall       : std_logic;            -- the counter is not there yet

begin

  p_what : process (clk) is
  begin

    if rising_edge(clk) then
      if (begins = '1') then
        kept_gates  <= gates;
        kept_faults <= faults;
        kept_flags  <= flags;

        if (no_answer = '1') then
          kept_flags <= (others => '0');
        end if;

        kept_flags(FLAG_NO_ANSWER) <= no_answer;
        kept_flags(FLAG_ENABLED)   <= enabled;
        kept_flags(FLAG_TRIPPED)   <= tripped;

        counting <= '0';

        if (outcome /= OUTCOME_ACCEPTED) then
          what <= to_unsigned(OF_REFUSAL, 3);
        elsif (no_answer = '1') then
          what <= to_unsigned(OF_SILENCE, 3);
        else
          what     <= unsigned(kind(2 downto 0));
          counting <= to_std_logic(kind(2 downto 0) = TYPE_COUNTERS(2 downto 0));
        end if;
      end if;
    end if;

  end process p_what;

  table_at <= std_logic_vector(what & r.place);

  i_table : entity work.ram
    generic map (
      ADDRESS_WIDTH => 9,
      WIDTH         => TABLE_BITS,
      LATENCY       => 2,
      STYLE         => "block",
      CONTENTS      => REPLIES
    )
    port map (
      clk           => clk,
      write         => '0',
      write_address => (others => '0'),
      write_word    => (others => '0'),
      read          => '1',
      read_address  => table_at,
      read_word     => entry
    );

  p_sequence : process (clk) is

    variable v : state_t;

  begin

    if rising_edge(clk) then
      v       := r;
      v.fresh := r.busy and not stall;
      v.ready := r.fresh;
      v.valid := r.ready;
      v.last  := r.ready and entry(LAST_BIT);
      v.ends  := r.last;

      if (v.fresh = '1') then
        v.place := r.place + 1;
      end if;

      -- the last byte of a counter is under way: the next one is wanted
      v.looked := (r.looked or shown) and not (v.fresh and to_std_logic(r.place(1 downto 0) = "01"));

      -- what follows the last byte is not wanted
      if (v.last = '1') then
        v.busy  := '0';
        v.fresh := '0';
        v.ready := '0';
      end if;

      if (begins = '1') then
        v.busy   := '1';
        v.place  := (others => '0');
        v.looked := '0';
      end if;

      if (rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_sequence;

  stall <= counting and not r.looked
           and to_std_logic(r.place >= HEADER_SIZE and r.place < HEADER_SIZE + SIZE_REPLY_COUNTERS);
  look  <= r.busy and stall;
  index <= link & second_half & std_logic_vector(resize(shift_right(r.place - HEADER_SIZE, 2), 3));

  ---------------------------------------------------------------------------------------------
  -- The byte of an entry
  ---------------------------------------------------------------------------------------------

  next_number  <= r.ready and entry(8 + FROM_NUMBER / 2) and not entry(ODD_BIT);
  next_address <= r.ready and entry(8 + FROM_ADDRESS / 2) and entry(ODD_BIT);

  words <= kept_faults & cycles & length & kept_flags & position & kept_gates & value & rdata & last;

  p_sources : process (all) is
  begin

    sources_now(FROM_NUMBER)   <= number;
    sources_now(FROM_ADDRESS)  <= address;
    sources_now(FROM_KIND)     <= kind;
    sources_now(FROM_OUTCOME)  <= "0000" & outcome;
    sources_now(FROM_RESPONSE) <= "000000" & response;
    sources_now(FROM_OPTIONS)  <= "000000" & to_std_logic(link = control) & to_std_logic(OPTION);

    for i in FROM_LAST to SOURCES - 1 loop
      sources_now(i) <= words(8 * (i - FROM_LAST) + 7 downto 8 * (i - FROM_LAST));
    end loop;

  end process p_sources;

  p_byte : process (clk) is

    variable v : byte_t;

  begin

    if rising_edge(clk) then
      v := entry(7 downto 0);

      for pair in 0 to PAIRS - 1 loop
        if (entry(8 + pair) = '1') then
          if (entry(ODD_BIT) = '1') then
            v := v or sources_now(2 * pair + 1);
          else
            v := v or sources_now(2 * pair);
          end if;
        end if;
      end loop;

      reply_data <= v;
    end if;

  end process p_byte;

  reply_valid <= r.valid;
  reply_last  <= r.last;
  ends        <= r.ends;

end architecture rtl;
