-- Receives frames from two streams of bytes: takes off the stuffing, checks everything that the bytes alone
-- can tell, and keeps a good frame of each until it is released.
--
-- COBS: each code byte says how many bytes follow until the next zero of the frame, or its end; a zero
-- byte on the line ends the frame in any state, so one frame at most is lost to whatever happened.
-- Checks in the order of the protocol page: broken line, more than MAX_FRAME bytes, stuffing, fewer
-- than OVERHEAD bytes, length byte, CRC-32, time, and whether the frame before is still here; the first
-- that fails is the outcome. A link's memory is written while no frame waits in it, and a frame is shown to
-- the outside only after its last check.
--
-- One logic serves both links, each in every second clock: their states go round through two registers. On the way
-- the byte is added to the CRC, and what a check needs is made. What comes of a link is taken into registers in the
-- clock before its turn. Neither link can delay the other.
--
-- Formats: the frame's bytes in order, type first, at addresses 0 to MAX_FRAME - 1 of the link's half.
-- Latency: pending or rejected two to four clocks after the delimiter's valid; a byte of each link in every fourth
-- clock at most. content two clocks after address.
-- Overflow: see the checks; bytes beyond MAX_FRAME are counted nowhere and written nowhere.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.link_constants.all;

entity frame_receiver is
  generic (
    LIMIT : positive := 125_000 -- clocks a frame may take from its first byte to its end, rounded down to even
  );
  port (
    clk      : in    std_logic;                    -- rising edge
    rst      : in    std_logic;                    -- synchronous, active high
    turn     : in    std_logic;                    -- link of this clock; toggles in every one
    -- from the lines, link 0 on the right
    valid    : in    std_logic_vector(1 downto 0); -- '1' for one clock: the link's data is a new byte
    data_0   : in    byte_t;                       -- stuffed, stable for two clocks from valid on
    data_1   : in    byte_t;                       -- stuffed, stable for two clocks from valid on
    broken   : in    std_logic_vector(1 downto 0); -- '1' for one clock: a byte was lost
    ended    : in    std_logic_vector(1 downto 0); -- '1' for one clock: a frame under way is cut off here
    -- frames that passed
    pending  : out   std_logic_vector(1 downto 0); -- '1': there is one
    link     : in    std_logic;                    -- whose is read
    address  : in    std_logic_vector(5 downto 0); -- of a byte of it
    content  : out   byte_t;                       -- that byte, two clocks later
    served   : in    std_logic_vector(1 downto 0); -- '1' for one clock: done with it
    -- frames that did not
    rejected : out   std_logic_vector(1 downto 0); -- '1' for one clock, one link at a time
    outcome  : out   outcome_t                     -- why; valid with rejected
  );
end entity frame_receiver;

architecture rtl of frame_receiver is

  constant TURNS : positive := maximum_of(LIMIT / 2, 1); -- a frame may take

  -- what is known of a link
  type state_t is record
    in_frame : std_logic;            -- a byte has come since the last delimiter
    left     : unsigned(7 downto 0); -- bytes until the next code
    size     : unsigned(5 downto 0); -- bytes taken off, up to MAX_FRAME
    length   : unsigned(7 downto 0); -- the frame's length byte
    line     : std_logic;            -- a byte was lost
    over     : std_logic;            -- more than MAX_FRAME
    late     : std_logic;            -- beyond LIMIT
    blocked  : std_logic;            -- the memory was not free
    crc      : crc_t;
    adds     : std_logic;            -- a byte is to be added to the CRC
  end record state_t;

  constant STATE_INIT : state_t := (
    in_frame => '0',
    left     => (others => '0'),
    size     => (others => '0'),
    length   => (others => '0'),
    line     => '0',
    over     => '0',
    late     => '0',
    blocked  => '0',
    crc      => (others => '1'),
    adds     => '0'
  );

  -- what follows from a state, made while the other link has its turn
  type facts_t is record
    at_code : std_logic; -- the next byte is a code
    full    : std_logic; -- MAX_FRAME bytes are there
    short   : std_logic; -- fewer than OVERHEAD are
    wrong   : std_logic; -- the length byte is not that of the frame, which has at most MAX_FRAME bytes
    sound   : std_logic; -- the CRC is right
    old     : std_logic; -- the time is over
  end record facts_t;

  constant FACTS_INIT : facts_t := (
    at_code => '1',
    full    => '0',
    short   => '1',
    wrong   => '1',
    sound   => '0',
    old     => '0'
  );

  subtype timer_t is natural range 0 to TURNS;

  -- what a state tells
  function facts_of (state : state_t; timer : timer_t) return facts_t is
  begin

    return (
      at_code => to_std_logic(state.left = 0),
      full    => to_std_logic(state.size = MAX_FRAME),
      short   => to_std_logic(state.size < OVERHEAD),
      wrong   => to_std_logic(state.length + OVERHEAD /= resize(state.size, 9)),
      sound   => to_std_logic(state.crc = CRC_RESIDUE),
      old     => to_std_logic(timer = TURNS)
    );

  end function facts_of;

  signal r       : state_t; -- of the link in turn
  signal facts    : facts_t;
  signal timer   : timer_t; -- turns since its first byte
  signal other   : state_t;
  signal waiting : timer_t; -- timer of the other
  signal come    : std_logic_vector(1 downto 0); -- a byte, not looked at
  signal lost    : std_logic_vector(1 downto 0); -- broken, not looked at
  signal cut     : std_logic_vector(1 downto 0); -- ended, not looked at
  signal here    : std_logic_vector(1 downto 0); -- '1' at the link in turn
  signal apart   : std_logic_vector(1 downto 0); -- '1' at the other, which is next
  signal coming  : std_logic;                    -- a byte of the other
  signal losing  : std_logic;                    -- the other's is broken
  signal next_up : byte_t;                       -- data of the other
  signal kept    : std_logic_vector(1 downto 0); -- a frame waits
  signal byte_in : std_logic;                    -- of the link in turn, as the next five
  signal loss    : std_logic;
  signal stop    : std_logic;
  signal busy    : std_logic;
  signal data    : byte_t;
  signal zero    : std_logic;
  signal plain   : byte_t;                       -- byte without stuffing
  signal store   : std_logic;                    -- '1': plain belongs to the frame
  signal keep    : std_logic;                    -- '1': plain is written to the memory
  signal index   : byte_t;                       -- of the CRC's table
  signal added   : crc_t;                        -- what the other's byte adds to the CRC
  signal found   : outcome_t;
  signal place   : std_logic_vector(6 downto 0); -- where plain is written
  signal wanted  : std_logic_vector(6 downto 0); -- where content is read

begin

  here    <= turn & not turn;
  apart   <= not here;
  coming  <= to_std_logic(((valid or come) and apart) /= "00");
  losing  <= to_std_logic(((broken or lost) and apart) /= "00");
  next_up <= data_1 when turn = '0' else
             data_0;

  -- a code ends the zero before it, but for the first one
  plain <= x"00" when facts.at_code = '1' else
           data;
  store <= byte_in and not (zero or r.line or (facts.at_code and not r.in_frame));
  keep  <= store and not (facts.full or busy);
  place <= turn & std_logic_vector(r.size);

  index <= r.crc(7 downto 0) xor plain;

  i_table : entity work.crc_table
    port map (
      clk   => clk,
      index => index,
      word  => added
    );

  wanted <= link & address;

  i_memory : entity work.ram
    generic map (
      ADDRESS_WIDTH => 7,
      WIDTH         => 8,
      LATENCY       => 2,
      STYLE         => "block"
    )
    port map (
      clk           => clk,
      write         => keep,
      write_address => place,
      write_word    => plain,
      read          => '1',
      read_address  => wanted,
      read_word     => content
    );

  p_judge : process (r, facts) is
  begin

    if (r.line = '1') then
      found <= OUTCOME_LINE;
    elsif (r.over = '1') then
      found <= OUTCOME_OVERSIZED;
    elsif (facts.at_code = '0') then
      found <= OUTCOME_STUFFING;
    elsif (facts.short = '1') then
      found <= OUTCOME_SHORT;
    elsif (facts.wrong = '1') then
      found <= OUTCOME_LENGTH;
    elsif (facts.sound = '0') then
      found <= OUTCOME_CRC;
    elsif (r.late = '1') then
      found <= OUTCOME_LATE;
    elsif (r.blocked = '1') then
      found <= OUTCOME_BUSY;
    else
      found <= OUTCOME_ACCEPTED;
    end if;

  end process p_judge;

  p_receive : process (clk) is

    variable v : state_t;

  begin

    if rising_edge(clk) then
      v        := r;
      v.adds   := store;
      rejected <= "00";
      outcome  <= found;

      come <= valid or (come and not here);
      lost <= broken or (lost and not (here and (1 downto 0 => loss)));
      cut  <= ended or (cut and not (here and (1 downto 0 => stop)));
      kept <= kept and not served;

      byte_in <= coming;
      loss    <= losing and not coming;
      stop    <= to_std_logic(((ended or cut) and apart) /= "00") and not (coming or losing);
      busy    <= to_std_logic((kept and not served and apart) /= "00");
      data    <= next_up;
      zero    <= to_std_logic(next_up = x"00");

      if (r.in_frame = '1' and facts.old = '1') then
        v.late := '1';
      end if;

      if (store = '1') then
        if (facts.full = '1') then
          v.over := '1';
        else
          v.size := r.size + 1;
        end if;

        if (r.size = 1) then
          v.length := unsigned(plain);
        end if;
      end if;

      if (loss = '1') then
        v.in_frame := '1';
        v.line     := '1';
      elsif (stop = '1' and r.in_frame = '1') then
        -- cut off: as a broken byte and a delimiter
        rejected <= here;
        outcome  <= OUTCOME_LINE;
        v.in_frame := '0';
      elsif (byte_in = '1' and zero = '1') then
        v.in_frame := '0';

        if (r.in_frame = '1') then
          if (found = OUTCOME_ACCEPTED) then
            kept <= (kept and not served) or here;
          else
            rejected <= here;
          end if;
        end if;
      elsif (byte_in = '1') then
        v.in_frame := '1';
        v.blocked  := r.blocked or busy;

        if (facts.at_code = '1') then
          v.left := unsigned(data) - 1;
        else
          v.left := r.left - 1;
        end if;
      end if;

      if (v.in_frame = '0') then
        v := STATE_INIT;
      end if;

      other   <= v;
      waiting <= 0;

      if (v.in_frame = '1') then
        waiting <= timer;

        if (facts.old = '0') then
          waiting <= timer + 1;
        end if;
      end if;

      r     <= other;

      if (other.adds = '1') then
        r.crc <= (x"00" & other.crc(31 downto 8)) xor added;
      end if;

      timer <= waiting;
      facts  <= facts_of(other, waiting);

      if (rst = '1') then
        r       <= STATE_INIT;
        other   <= STATE_INIT;
        facts    <= FACTS_INIT;
        timer   <= 0;
        waiting <= 0;
        come    <= "00";
        lost    <= "00";
        cut     <= "00";
        kept    <= "00";
        byte_in <= '0';
        loss    <= '0';
        stop    <= '0';
        busy    <= '0';
      end if;
    end if;

  end process p_receive;

  pending <= kept;

end architecture rtl;
