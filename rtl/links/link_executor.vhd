-- Serves the frames of both links, one at a time: registers, counters, steps; and answers them.
--
-- A frame that has passed its receiver is read byte by byte, checked for what only its meaning tells
-- (request_check), acted upon, answered (reply_source), and released. Nothing reaches the registers or the core
-- before the last check. Only requests that act (WRITE, STEP) need a new sequence number and use it up; the others
-- change nothing and may be repeated. A reading host can so find out at any time where it stands, and a replayed
-- frame never acts.
--
-- A frame whose type has bit 7 is a reply. It is counted (TYPE) and not answered: on a line that echoes, or between two
-- boards, an answer would lead to another one without end.
--
-- Which of two frames that come in the same clock goes first does not matter: a link's next frame cannot wait before
-- its last one is released, so the other link is served in between.
--
-- A STEP waits for its decision in step_port while the other link is served; its own link has to wait. So a
-- disable of the other link never waits for a decision.
--
-- Formats: frames as in docs/protocol.md. measurements and step_position are the payload of a STEP,
-- first word lowest.
-- Latency, in clocks from pending to the last byte of the reply while nothing else is served: IDENTIFY 37; COUNTERS
-- at most 98; READ, WRITE at most 28 and the access; STEP 65 (MPDCC) or 55 (MPTC) and the decision. With the other
-- link's request before it a request is served within 256.
-- Overflow: none. A core without an answer after DECISION_LIMIT clocks gives a reply that says so, with
-- no decision in it.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.link_constants.all;

entity link_executor is
  generic (
    CONTROLLER     : positive range 1 to 3 := CONTROLLER_MPDCC; -- one of the constants CONTROLLER_
    STEP_WORDS     : positive              := STEP_WORDS_MPDCC; -- 16-bit words of measurements in a STEP
    EXPLORERS      : natural               := 2;                -- told in IDENTIFY
    OPTION         : boolean               := false;            -- told in IDENTIFY, bit 0 of options
    CLOCK_HZ       : positive              := 25_000_000;       -- told in IDENTIFY, Hz
    LIMIT          : positive              := 125_000;          -- told in IDENTIFY: the receiver's LIMIT
    DECISION_LIMIT : positive              := LONGEST_DECISION; -- clocks a decision may take
    RECORDER       : boolean               := false             -- true: either link writes the recorder's registers
  );
  port (
    clk             : in    std_logic;                                      -- rising edge
    rst             : in    std_logic;                                      -- synchronous, active high
    control         : in    std_logic;                                      -- link in control, '0' or '1'
    -- receiver, counters and transmitter, link 0 on the right
    pending         : in    std_logic_vector(1 downto 0);                   -- '1': a frame waits
    link            : out   std_logic;                                      -- whose frame is read
    address         : out   std_logic_vector(5 downto 0);                   -- of a byte of it
    content         : in    byte_t;                                         -- that byte, two clocks later
    served          : out   std_logic_vector(1 downto 0);                   -- '1' for one clock: served
    outcome         : out   outcome_t;                                      -- what became of it, with served
    look            : out   std_logic;                                      -- '1' until shown: a counter is wanted
    index           : out   std_logic_vector(4 downto 0);                   -- which: link, outcome
    shown           : in    std_logic;                                      -- '1' for one clock: value is there
    value           : in    std_logic_vector(31 downto 0);                  -- count
    reply_busy      : in    std_logic;                                      -- '1': no reply may begin
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

  type phase_t is (PHASE_IDLE, PHASE_FETCH, PHASE_CHECK, PHASE_BUS, PHASE_ANSWER, PHASE_REPLY);

  type state_t is record
    phase     : phase_t;
    link      : std_logic;            -- being served
    place     : unsigned(5 downto 0); -- of the byte that is read
    asked_at  : unsigned(5 downto 0); -- of the byte that is there in the next clock
    asked     : std_logic;
    at        : unsigned(5 downto 0); -- of the byte that is there
    there     : std_logic;
    outcome   : outcome_t;
    resumed   : std_logic;            -- it is a STEP whose decision is there
    intact    : std_logic;            -- nothing has been read since that STEP
    step_link : std_logic;            -- where the last STEP came from
    step_go   : std_logic;
    fetched   : std_logic;            -- its answer has been given
    bus_start : std_logic;
    begins    : std_logic;
    served    : std_logic;
  end record state_t;

  constant STATE_INIT : state_t := (
    phase     => PHASE_IDLE,
    link      => '0',
    place     => (others => '0'),
    asked_at  => (others => '0'),
    asked     => '0',
    at        => (others => '0'),
    there     => '0',
    outcome   => OUTCOME_ACCEPTED,
    resumed   => '0',
    intact    => '0',
    step_link => '0',
    step_go   => '0',
    fetched   => '0',
    bus_start => '0',
    begins    => '0',
    served    => '0'
  );

  signal r            : state_t;
  signal complete     : std_logic;                     -- the request's last byte is there
  signal kind         : byte_t;
  signal number       : byte_t;
  signal next_number  : std_logic;
  signal next_address : std_logic;
  signal request_at   : std_logic_vector(15 downto 0); -- address of READ and WRITE
  signal accesses     : std_logic;                     -- it is a READ or WRITE
  signal steps        : std_logic;                     -- it is a STEP
  signal is_reply     : std_logic;                     -- it is a reply
  signal silent       : std_logic;                     -- it is a STEP without a decision
  signal verdict      : outcome_t;
  signal acted        : std_logic;
  signal last         : std_logic_vector(31 downto 0);
  signal step_waiting : std_logic;
  signal step_done    : std_logic;
  signal parked       : std_logic;                     -- a STEP waits for its decision, or its answer for a reply
  signal no_step      : std_logic;                     -- no step can begin
  signal eligible     : std_logic_vector(1 downto 0);  -- links whose frame may be served
  signal no_answer    : std_logic;
  signal position     : std_logic_vector(15 downto 0);
  signal flags        : byte_t;
  signal length       : byte_t;
  signal cycles       : std_logic_vector(15 downto 0);
  signal ends         : std_logic;

begin

  assert (CONTROLLER = CONTROLLER_MPDCC and STEP_WORDS = STEP_WORDS_MPDCC)
         or (CONTROLLER = CONTROLLER_MPTC and STEP_WORDS = STEP_WORDS_MPTC)
         or (CONTROLLER = CONTROLLER_KBEST and STEP_WORDS = STEP_WORDS_KBEST)
    report "link_executor: STEP_WORDS has to be the constant STEP_WORDS_ of the controller"
    severity failure;

  i_check : entity work.request_check
    generic map (
      CONTROLLER => CONTROLLER,
      STEP_WORDS => STEP_WORDS,
      RECORDER   => RECORDER
    )
    port map (
      clk           => clk,
      rst           => rst,
      link          => r.link,
      valid         => r.there,
      place         => std_logic_vector(r.at),
      data          => content,
      complete      => complete,
      kind          => kind,
      number        => number,
      next_number   => next_number,
      address       => request_at,
      next_address  => next_address,
      accesses      => accesses,
      writes        => bus_write,
      steps         => steps,
      word          => bus_wdata,
      measurements  => measurements,
      position      => step_position,
      control       => control,
      step_busy     => no_step,
      applied       => applied,
      applied_known => applied_known,
      outcome       => verdict,
      acted         => acted,
      last          => last
    );

  acted <= to_std_logic(r.phase = PHASE_CHECK and verdict = OUTCOME_ACCEPTED);

  i_step : entity work.step_port
    generic map (
      LIMIT => DECISION_LIMIT
    )
    port map (
      clk             => clk,
      rst             => rst,
      start           => r.step_go,
      waiting         => step_waiting,
      done            => step_done,
      fetched         => r.fetched,
      step_start      => step_start,
      decision_valid  => decision_valid,
      decision        => decision,
      decision_flags  => decision_flags,
      decision_length => decision_length,
      decision_cycles => decision_cycles,
      position        => position,
      flags           => flags,
      length          => length,
      cycles          => cycles,
      no_answer       => no_answer
    );

  parked   <= step_waiting or r.step_go;
  no_step  <= step_busy or parked;
  eligible <= (pending(1) and not (parked and r.step_link)) & (pending(0) and not (parked and not r.step_link));

  p_serve : process (clk) is

    variable v : state_t;

  begin

    if rising_edge(clk) then
      v           := r;
      v.step_go   := '0';
      v.fetched   := '0';
      v.bus_start := '0';
      v.begins    := '0';
      v.served    := '0';

      case r.phase is

        when PHASE_IDLE =>
          v.place   := (others => '0');
          v.outcome := OUTCOME_ACCEPTED;
          v.resumed := '0';

          -- a frame that has just been released is still shown
          if (r.served = '0') then
            if (step_done = '1') then
              v.link    := r.step_link;
              v.resumed := '1';
              v.phase   := PHASE_FETCH;

              if (r.intact = '1') then
                v.phase := PHASE_ANSWER;
              end if;
            elsif (eligible /= "00") then
              v.link   := eligible(1);
              v.phase  := PHASE_FETCH;
              v.intact := '0';
            end if;
          end if;

        when PHASE_FETCH =>
          v.place    := r.place + 1;
          v.asked_at := r.place;
          v.asked    := '1';
          v.at       := r.asked_at;
          v.there    := r.asked;

          if (r.there = '1' and r.resumed = '1' and r.at = HEADER_SIZE - 1) then
            v.asked := '0';
            v.there := '0';
            v.phase := PHASE_ANSWER;
          elsif (r.there = '1' and complete = '1') then
            v.asked := '0';
            v.there := '0';
            v.phase := PHASE_CHECK;
          end if;

        when PHASE_CHECK =>
          v.outcome := verdict;
          v.phase   := PHASE_ANSWER;

          if (is_reply = '1') then
            v.served := '1';
            v.phase  := PHASE_IDLE;
          elsif (verdict = OUTCOME_ACCEPTED) then
            if (accesses = '1') then
              v.bus_start := '1';
              v.phase     := PHASE_BUS;
            elsif (steps = '1') then
              v.step_go   := '1';
              v.step_link := r.link;
              v.intact    := '1';
              v.phase     := PHASE_IDLE;
            end if;
          end if;

        when PHASE_BUS =>
          if (bus_done = '1') then
            v.phase := PHASE_ANSWER;
          end if;

        when PHASE_ANSWER =>
          if (reply_busy = '0') then
            v.begins := '1';
            v.phase  := PHASE_REPLY;
          end if;

        when PHASE_REPLY =>
          if (ends = '1') then
            v.served  := '1';
            v.fetched := r.resumed;
            v.phase   := PHASE_IDLE;
          end if;

      end case;

      if (rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_serve;

  silent   <= no_answer and r.resumed;
  is_reply <= to_std_logic((kind and TYPE_REPLY) = TYPE_REPLY);

  i_reply : entity work.reply_source
    generic map (
      CONTROLLER => CONTROLLER,
      EXPLORERS  => EXPLORERS,
      OPTION     => OPTION,
      CLOCK_HZ   => CLOCK_HZ,
      LIMIT      => LIMIT,
      PATIENCE   => DECISION_LIMIT
    )
    port map (
      clk         => clk,
      rst         => rst,
      begins      => r.begins,
      ends        => ends,
      link        => r.link,
      control     => control,
      outcome     => r.outcome,
      kind        => kind,
      number      => number,
      next_number => next_number,
      address     => request_at(7 downto 0),
      next_address => next_address,
      second_half => request_at(11),
      last        => last,
      response    => bus_response,
      rdata       => bus_rdata,
      look        => look,
      index       => index,
      shown       => shown,
      value       => value,
      no_answer   => silent,
      position    => position,
      flags       => flags,
      length      => length,
      cycles      => cycles,
      enabled     => enabled,
      tripped     => tripped,
      faults      => faults,
      gates       => gates,
      reply_valid => reply_valid,
      reply_data  => reply_data,
      reply_last  => reply_last
    );

  link         <= r.link;
  address      <= std_logic_vector(r.place);
  served       <= (r.served and r.link) & (r.served and not r.link);
  outcome      <= r.outcome;
  reply_begins <= (r.begins and r.link) & (r.begins and not r.link);

  bus_start   <= r.bus_start;
  bus_address <= request_at;

end architecture rtl;
