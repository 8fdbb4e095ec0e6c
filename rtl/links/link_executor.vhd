-- Serves the frames of both links, one at a time: registers, counters, steps; and answers them.
--
-- A frame that has passed its receiver is read byte by byte, checked for what only its meaning tells
-- (type and size, sequence number, which link, s(k-1)), acted upon, answered, and released. Nothing
-- reaches the registers or the core before the last check. Only requests that act (WRITE, STEP) need a
-- new sequence number and use it up; the others change nothing and may be repeated.
-- A reading host can so find out at any time where it stands, and a replayed frame never acts.
--
-- Formats: frames as in docs/protocol.md. measurements and step_position are the payload of a STEP,
-- first word lowest.
-- Latency, in clocks from pending to the last byte of the reply: IDENTIFY 33; READ, WRITE 24 to 26 and
-- the access; STEP 60 (MPDCC) or 50 (MPTC) and the decision.
-- Overflow: none. A core without an answer after DECISION_LIMIT clocks gives a reply that says so, with
-- no decision in it.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.link_constants.all;

entity link_executor is
  generic (
    CONTROLLER     : positive range 1 to 2 := CONTROLLER_MPDCC; -- CONTROLLER_MPDCC or CONTROLLER_MPTC
    STEP_WORDS     : positive              := STEP_WORDS_MPDCC; -- 16-bit words of measurements in a STEP
    EXPLORERS      : natural               := 2;                -- told in IDENTIFY
    OPTION         : boolean               := false;            -- told in IDENTIFY, bit 0 of options
    CLOCK_HZ       : positive              := 25_000_000;       -- told in IDENTIFY, Hz
    LIMIT_0        : positive              := 125_000;          -- told in IDENTIFY: receiver 0's LIMIT
    LIMIT_1        : positive              := 125_000;          -- told in IDENTIFY: receiver 1's LIMIT
    DECISION_LIMIT : positive              := LONGEST_DECISION  -- clocks a decision may take
  );
  port (
    clk             : in    std_logic;                                      -- rising edge
    rst             : in    std_logic;                                      -- synchronous, active high
    control         : in    std_logic;                                      -- link whose STEPs count, '0' or '1'
    -- receivers and transmitters, link 0 on the right
    pending         : in    std_logic_vector(1 downto 0);                   -- '1': a frame waits
    address         : out   std_logic_vector(5 downto 0);                   -- of a byte of it
    content_0       : in    byte_t;                                         -- link 0's byte there
    content_1       : in    byte_t;                                         -- link 1's byte there
    served         : out   std_logic_vector(1 downto 0);                   -- '1' for one clock: served
    outcome         : out   outcome_t;                                      -- what became of it, with served
    counter         : out   std_logic_vector(3 downto 0);                   -- outcome whose count is wanted
    count_0         : in    std_logic_vector(31 downto 0);                  -- link 0's, same clock
    count_1         : in    std_logic_vector(31 downto 0);                  -- link 1's, same clock
    reply_begins    : out   std_logic_vector(1 downto 0);                   -- '1' for one clock: a reply follows
    reply_valid     : out   std_logic;                                      -- '1': reply_data is its next byte
    reply_data      : out   byte_t;                                         -- byte of a reply
    reply_last      : out   std_logic;                                      -- '1' with the last byte
    -- registers
    bus_start       : out   std_logic;                                      -- '1' for one clock: access
    bus_write       : out   std_logic;                                      -- '1': write
    bus_address     : out   std_logic_vector(15 downto 0);                  -- bytes
    bus_wdata       : out   std_logic_vector(31 downto 0);                  -- word to write
    bus_done        : in    std_logic;                                      -- '1' for one clock
    bus_rdata       : in    std_logic_vector(31 downto 0);                  -- word read
    bus_response    : in    std_logic_vector(1 downto 0);                   -- "00": okay
    -- steps
    step_start      : out   std_logic;                                      -- '1' for one clock: decide
    measurements    : out   std_logic_vector(16 * STEP_WORDS - 1 downto 0); -- with step_start, ports in order
    step_position   : out   std_logic_vector(15 downto 0);                  -- s(k-1) or u, with step_start
    step_busy       : in    std_logic;                                      -- '1': a decision is under way
    decision_valid  : in    std_logic;                                      -- '1' for one clock: decision is new
    decision        : in    std_logic_vector(15 downto 0);                  -- position of a STEP reply
    decision_flags  : in    std_logic_vector(7 downto 0);                   -- FLAG_HELD to FLAG_CLAMPED, EXHAUSTED
    decision_length : in    std_logic_vector(7 downto 0);                   -- L*
    decision_cycles : in    std_logic_vector(15 downto 0);                  -- of the core, clock after decision_valid
    -- gates
    applied         : in    std_logic_vector(15 downto 0);                  -- position the gates are at
    applied_known   : in    std_logic;                                      -- '1': they are at one
    enabled         : in    std_logic;                                      -- '1': gates are let through
    tripped         : in    std_logic;                                      -- '1': a fault is latched
    faults          : in    std_logic_vector(15 downto 0);                  -- latched fault codes
    gates           : in    std_logic_vector(31 downto 0)                   -- gate signals, '1': on
  );
end entity link_executor;

architecture rtl of link_executor is

  constant STEP_SIZE   : natural := 2 * STEP_WORDS + 2;
  constant WIDTH       : natural := 8 * STEP_SIZE;           -- of the payload register
  constant REPLY_BYTES : natural := HEADER_SIZE + SIZE_REPLY_IDENTIFY; -- longest that is put together here

  subtype reply_t is std_logic_vector(8 * REPLY_BYTES - 1 downto 0);

  type phase_t is (PHASE_IDLE, PHASE_FETCH, PHASE_CHECK, PHASE_BUS, PHASE_STEP, PHASE_ANSWER, PHASE_REPLY);

  type state_t is record
    phase      : phase_t;
    link       : std_logic;            -- being served
    place      : unsigned(5 downto 0); -- of a byte, read or sent
    outcome    : outcome_t;
    served    : std_logic_vector(1 downto 0);
    begins     : std_logic_vector(1 downto 0);
    bus_start  : std_logic;
    step_start : std_logic;
    cycles     : unsigned(15 downto 0); -- waited for a decision
    no_answer  : std_logic;
  end record state_t;

  constant STATE_INIT : state_t := (
    phase      => PHASE_IDLE,
    link       => '0',
    place      => (others => '0'),
    outcome    => OUTCOME_ACCEPTED,
    served    => "00",
    begins     => "00",
    bus_start  => '0',
    step_start => '0',
    cycles     => (others => '0'),
    no_answer  => '0'
  );

  function word_of (value : natural; bits : positive) return std_logic_vector is
  begin

    return std_logic_vector(to_unsigned(value, bits));

  end function word_of;

  -- '1' at the place of a link
  function one_of (link : std_logic) return std_logic_vector is
  begin

    return link & not link;

  end function one_of;

  -- a reply's payload, zeros behind it
  function filled (bits : std_logic_vector) return reply_t is
  begin

    return std_logic_vector(resize(unsigned(bits), reply_t'length));

  end function filled;

  function limit_word (link : std_logic) return std_logic_vector is
  begin

    if (link = '0') then
      return word_of(LIMIT_0, 32);
    else
      return word_of(LIMIT_1, 32);
    end if;

  end function limit_word;

  -- positions of MPDCC are 9 bits, the vector of MPTC 3
  function same_position (left, right : std_logic_vector(15 downto 0)) return boolean is
  begin

    if (CONTROLLER = CONTROLLER_MPDCC) then
      return left(8 downto 0) = right(8 downto 0);
    else
      return left(2 downto 0) = right(2 downto 0);
    end if;

  end function same_position;

  signal r        : state_t;
  signal content  : byte_t;
  signal kind     : byte_t;
  signal size     : unsigned(7 downto 0);
  signal number : std_logic_vector(31 downto 0);
  signal payload  : std_logic_vector(WIDTH - 1 downto 0); -- last byte on the left
  signal last_0   : unsigned(31 downto 0);                -- last sequence number that acted, by link
  signal last_1   : unsigned(31 downto 0);
  signal last     : unsigned(31 downto 0);                -- sequence number of this link
  signal ahead    : signed(31 downto 0);
  signal verdict  : outcome_t;
  signal fetched  : std_logic;                            -- '1': this byte is the request's last
  signal acts     : std_logic;                            -- '1': the request uses up its sequence number
  signal flags    : byte_t;                               -- of a STEP's reply
  signal cycles   : std_logic_vector(15 downto 0);        -- of a STEP's reply
  signal answer   : reply_t;
  signal answer_bytes : unsigned(5 downto 0);
  signal reply    : reply_t;                              -- next byte on the right
  signal total    : unsigned(5 downto 0);                 -- bytes of the reply
  signal counting : std_logic;                            -- '1': the reply's payload are counters
  signal count    : std_logic_vector(31 downto 0);
  signal counted  : byte_t;

begin

  assert (CONTROLLER = CONTROLLER_MPDCC and STEP_WORDS = STEP_WORDS_MPDCC)
         or (CONTROLLER = CONTROLLER_MPTC and STEP_WORDS = STEP_WORDS_MPTC)
    report "link_executor: STEP_WORDS has to be STEP_WORDS_MPDCC for MPDCC, STEP_WORDS_MPTC for MPTC"
    severity failure;

  content <= content_0 when r.link = '0' else
             content_1;
  last    <= last_0 when r.link = '0' else
             last_1;
  ahead   <= signed(unsigned(number) - last);

  p_verdict : process (kind, size, payload, ahead, r, control, step_busy, applied, applied_known) is

    variable known : boolean;

  begin

    known := (kind = TYPE_IDENTIFY and size = SIZE_IDENTIFY)
             or (kind = TYPE_COUNTERS and size = SIZE_COUNTERS and payload(WIDTH - 1 downto WIDTH - 4) = "0000"
                 and payload(WIDTH - 6 downto WIDTH - 8) = "000")
             or (kind = TYPE_READ and size = SIZE_READ)
             or (kind = TYPE_WRITE and size = SIZE_WRITE)
             or (kind = TYPE_STEP and size = STEP_SIZE);

    verdict <= OUTCOME_ACCEPTED;

    if (not known) then
      verdict <= OUTCOME_TYPE;
    elsif (kind = TYPE_WRITE or kind = TYPE_STEP) then
      if (ahead <= 0) then
        verdict <= OUTCOME_STALE;
      elsif (kind = TYPE_STEP) then
        if (r.link /= control) then
          verdict <= OUTCOME_LINK;
        elsif (step_busy = '1') then
          verdict <= OUTCOME_BUSY;
        elsif (applied_known = '1' and not same_position(payload(WIDTH - 1 downto WIDTH - 16), applied)) then
          verdict <= OUTCOME_POSITION;
        end if;
      end if;
    end if;

  end process p_verdict;

  ---------------------------------------------------------------------------------------------
  -- The request, byte by byte
  ---------------------------------------------------------------------------------------------

  p_request : process (clk) is
  begin

    if rising_edge(clk) then
      if (r.phase = PHASE_FETCH) then

        case to_integer(r.place) is

          when 0 =>

            kind <= content;

          when 1 =>

            size <= unsigned(content);

          when 2 | 3 | 4 | 5 =>

            number <= content & number(31 downto 8);

          when others =>

            payload <= content & payload(WIDTH - 1 downto 8);

        end case;

      end if;
    end if;

  end process p_request;

  ---------------------------------------------------------------------------------------------
  -- The sequence of serving
  ---------------------------------------------------------------------------------------------

  fetched <= to_std_logic(r.place >= HEADER_SIZE - 1 and r.place = size + HEADER_SIZE - 1);
  acts    <= to_std_logic(kind = TYPE_WRITE or kind = TYPE_STEP);

  p_numbers : process (clk) is
  begin

    if rising_edge(clk) then
      if (r.phase = PHASE_CHECK and verdict = OUTCOME_ACCEPTED and acts = '1') then
        if (r.link = '0') then
          last_0 <= unsigned(number);
        else
          last_1 <= unsigned(number);
        end if;
      end if;

      if (rst = '1') then
        last_0 <= (others => '0');
        last_1 <= (others => '0');
      end if;
    end if;

  end process p_numbers;

  p_sequence : process (clk) is

    variable v : state_t;

  begin

    if rising_edge(clk) then
      v            := r;
      v.served    := "00";
      v.begins     := "00";
      v.bus_start  := '0';
      v.step_start := '0';

      case r.phase is

        when PHASE_IDLE =>
          v.place     := (others => '0');
          v.no_answer := '0';
          v.cycles    := (others => '0');

          -- a frame that has just been released is still shown; links take turns
          if (r.served = "00") then
            if (pending(0) = '1' and (r.link = '1' or pending(1) = '0')) then
              v.link  := '0';
              v.phase := PHASE_FETCH;
            elsif (pending(1) = '1') then
              v.link  := '1';
              v.phase := PHASE_FETCH;
            end if;
          end if;

        when PHASE_FETCH =>
          v.place := r.place + 1;

          if (fetched = '1') then
            v.phase := PHASE_CHECK;
          end if;

        when PHASE_CHECK =>
          v.outcome := verdict;
          v.phase   := PHASE_ANSWER;

          if (verdict = OUTCOME_ACCEPTED) then
            if (kind = TYPE_READ or kind = TYPE_WRITE) then
              v.bus_start := '1';
              v.phase     := PHASE_BUS;
            elsif (kind = TYPE_STEP) then
              v.step_start := '1';
              v.phase      := PHASE_STEP;
            end if;
          end if;

        when PHASE_BUS =>
          if (bus_done = '1') then
            v.phase := PHASE_ANSWER;
          end if;

        when PHASE_STEP =>
          if (r.step_start = '0') then
            v.cycles := r.cycles + 1;

            if (decision_valid = '1') then
              v.phase := PHASE_ANSWER;
            elsif (v.cycles = DECISION_LIMIT) then
              v.no_answer := '1';
              v.phase     := PHASE_ANSWER;
            end if;
          end if;

        when PHASE_ANSWER =>
          v.place := (others => '0');
          v.phase := PHASE_REPLY;
          v.begins := one_of(r.link);

        when PHASE_REPLY =>
          v.place := r.place + 1;

          if (r.begins /= "00") then
            v.place := (others => '0');
          elsif (v.place = total) then
            v.phase  := PHASE_IDLE;
            v.served := one_of(r.link);
          end if;

      end case;

      if (rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_sequence;

  ---------------------------------------------------------------------------------------------
  -- The reply: put together at once, sent byte by byte
  ---------------------------------------------------------------------------------------------

  p_flags : process (decision_flags, r, enabled, tripped) is
  begin

    flags                 <= decision_flags;
    flags(FLAG_NO_ANSWER) <= r.no_answer;
    flags(FLAG_ENABLED)   <= enabled;
    flags(FLAG_TRIPPED)   <= tripped;

  end process p_flags;

  cycles <= std_logic_vector(r.cycles) when r.no_answer = '1' else
            decision_cycles;

  p_answer : process (all) is

    variable code  : byte_t;
    variable bytes : natural range 0 to MAX_PAYLOAD;
    variable told  : reply_t; -- payload

  begin

    code := kind or TYPE_REPLY;
    told := (others => '0');

    if (r.outcome /= OUTCOME_ACCEPTED) then
      code  := TYPE_REFUSED or TYPE_REPLY;
      bytes := SIZE_REPLY_REFUSED;
      told  := filled(std_logic_vector(last) & kind & "0000" & r.outcome);
    elsif (kind = TYPE_IDENTIFY) then
      bytes := SIZE_REPLY_IDENTIFY;
      told  := filled(limit_word(r.link) & word_of(CLOCK_HZ, 32) & std_logic_vector(last)
                      & "000000" & to_std_logic(r.link = control) & to_std_logic(OPTION)
                      & word_of(EXPLORERS, 8) & word_of(CONTROLLER, 8) & word_of(PROTOCOL_VERSION, 8));
    elsif (kind = TYPE_COUNTERS) then
      bytes := SIZE_REPLY_COUNTERS;
    elsif (kind = TYPE_READ) then
      bytes := SIZE_REPLY_READ;
      told  := filled(bus_rdata & "000000" & bus_response & payload(WIDTH - 1 downto WIDTH - 16));
    elsif (kind = TYPE_WRITE) then
      bytes := SIZE_REPLY_WRITE;
      told  := filled("000000" & bus_response & payload(WIDTH - 33 downto WIDTH - 48));
    else
      bytes := SIZE_REPLY_STEP;
      told  := filled(gates & faults & cycles & decision_length & flags & decision);
    end if;

    answer       <= told(reply_t'left - 8 * HEADER_SIZE downto 0) & number & word_of(bytes, 8) & code;
    answer_bytes <= to_unsigned(HEADER_SIZE + bytes, 6);

  end process p_answer;

  p_reply : process (clk) is
  begin

    if rising_edge(clk) then
      if (r.phase = PHASE_ANSWER) then
        reply    <= answer;
        total    <= answer_bytes;
        counting <= to_std_logic(r.outcome = OUTCOME_ACCEPTED and kind = TYPE_COUNTERS);
      elsif (r.phase = PHASE_REPLY and r.begins = "00") then
        reply <= x"00" & reply(reply'left downto 8);
      end if;
    end if;

  end process p_reply;

  -- counters: four bytes each, behind six bytes of header
  counter <= payload(WIDTH - 5) & std_logic_vector(resize(shift_right(r.place - HEADER_SIZE, 2), 3));
  count   <= count_0 when r.link = '0' else
             count_1;

  counted <= count(7 downto 0) when r.place(1 downto 0) = "10" else
             count(15 downto 8) when r.place(1 downto 0) = "11" else
             count(23 downto 16) when r.place(1 downto 0) = "00" else
             count(31 downto 24);

  address      <= std_logic_vector(r.place);
  served      <= r.served;
  outcome      <= r.outcome;
  reply_begins <= r.begins;
  reply_valid  <= to_std_logic(r.phase = PHASE_REPLY and r.begins = "00");
  reply_data   <= counted when counting = '1' and r.place >= HEADER_SIZE else
                  reply(7 downto 0);
  reply_last   <= to_std_logic(r.place + 1 = total);

  bus_start   <= r.bus_start;
  bus_write   <= to_std_logic(kind = TYPE_WRITE);
  bus_address <= payload(WIDTH - 33 downto WIDTH - 48) when kind = TYPE_WRITE else
                 payload(WIDTH - 1 downto WIDTH - 16);
  bus_wdata   <= payload(WIDTH - 1 downto WIDTH - 32);

  step_start    <= r.step_start;
  measurements  <= payload(16 * STEP_WORDS - 1 downto 0);
  step_position <= payload(WIDTH - 1 downto WIDTH - 16);

end architecture rtl;
