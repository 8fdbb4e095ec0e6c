-- Records control steps in a ring of block RAM, until something triggers; a host reads them while the drive runs.
--
-- A record is written a word a clock: INPUTS words from begins on, RESULTS words from decided on. They are read where
-- they stand, so nothing is kept twice. A decision that comes before its inputs have been written leaves no record.
-- The recorder listens: no output of it reaches a decision, a gate or a fault.
--
-- Trigger: a trip, a deadlock, a saturated value, half of a word beside a level, or a command. The record of the step
-- in which it happens is kept, and settings.after ones behind it; then nothing is written until the recorder is armed.
-- A trip between two decisions counts at once. After a reset it is armed, and a trip triggers. decimation leaves steps
-- out, but never that of the trigger. Triggers look at every step.
--
-- The bus goes through it. An access to an address of its own is answered here, any other passes in its clock, both
-- ways; its own data goes past the gate of the reads (read_gate), which adds it. The host reads with the RAM's
-- second port: neither waits for the other. It reads a row that it has named.
--
-- Formats: as recorder_format and docs/recorder.md; addresses in bytes.
-- Latency: a record is whole RESULTS + 1 clocks after decided. A read's data comes two clocks after its address, a
-- write's response one.
-- Overflow: the oldest record is written over. The row of the next one is that under way, so one less than all can be
-- read. A step of which decided comes less than INPUTS + RESULTS + 5 clocks after begins may be left out.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.recorder_format.all;

entity recorder is
  generic (
    ROWS_LOG2 : positive range 3 to 10        := 8; -- records of the ring, as a power of two
    INPUTS    : positive range 2 to RESULTS_AT := 8; -- words before the decision
    RESULTS   : positive range 2 to 5        := 3  -- words of the decision
  );
  port (
    clk       : in    std_logic;                     -- rising edge
    rst       : in    std_logic;                     -- synchronous, active high
    -- the step
    begins    : in    std_logic;                     -- '1' for one clock: inputs stand, until decided and one on
    busy      : in    std_logic;                     -- '1': a decision is under way; before begins, too
    decided   : in    std_logic;                     -- '1' for one clock: results stand, until RESULTS + 1 clocks on
    step_words : in    record_t;                      -- both, formats as recorder_format
    deadlock  : in    std_logic;                     -- '1': no candidate stays inside; stands as the results do
    saturated : in    std_logic;                     -- '1': a value did not fit its word; likewise
    tripped   : in    std_logic;                     -- '1': the guard holds a fault
    -- bus, from its gates
    awaddr    : in    std_logic_vector(9 downto 0);  -- byte address of a write
    wdata     : in    std_logic_vector(31 downto 0); -- data
    m_awvalid : in    std_logic;                     -- '1': address there
    m_awready : out   std_logic;                     -- '1': address taken
    m_wvalid  : in    std_logic;                     -- '1': data there, with the address
    m_wready  : out   std_logic;                     -- '1': data taken
    m_bready  : in    std_logic;                     -- '1': response taken
    m_bvalid  : out   std_logic;                     -- '1': response there
    m_bresp   : out   std_logic_vector(1 downto 0);  -- "00": okay, "10": SLVERR
    araddr    : in    std_logic_vector(9 downto 0);  -- byte address of a read
    m_arvalid : in    std_logic;                     -- '1': address there; none while a read is under way
    m_arready : out   std_logic;                     -- '1': address taken
    m_rready  : in    std_logic;                     -- '1': data taken
    m_rvalid  : out   std_logic;                     -- '1': data there
    own_data  : out   std_logic;                     -- '1': the answer that is there has its data in m_rdata
    m_rdata   : out   std_logic_vector(31 downto 0); -- data of its own, until taken; zero otherwise
    m_rresp   : out   std_logic_vector(1 downto 0);  -- "00": okay, "10": SLVERR
    -- to the other registers
    s_awvalid : out   std_logic;                     -- '1': address there
    s_awready : in    std_logic;                     -- '1': address taken
    s_wvalid  : out   std_logic;                     -- '1': data there
    s_wready  : in    std_logic;                     -- '1': data taken
    s_bready  : out   std_logic;                     -- '1': response taken
    s_bvalid  : in    std_logic;                     -- '1': response there
    s_bresp   : in    std_logic_vector(1 downto 0);  -- "00": okay, "10": SLVERR
    s_arvalid : out   std_logic;                     -- '1': address there
    s_arready : in    std_logic;                     -- '1': address taken
    s_rready  : out   std_logic;                     -- '1': data taken
    s_rvalid  : in    std_logic;                     -- '1': data there
    s_rresp   : in    std_logic_vector(1 downto 0)   -- "00": okay, "10": SLVERR
  );
end entity recorder;

architecture rtl of recorder is

  constant PLACE_BITS : positive := 4;
  constant SETTLES    : positive := 4; -- clocks from the last word's fetch until it has been compared

  subtype word_t is std_logic_vector(31 downto 0);

  subtype row_t is unsigned(ROWS_LOG2 - 1 downto 0);

  subtype place_t is std_logic_vector(PLACE_BITS - 1 downto 0);

  subtype places_t is std_logic_vector(RESULTS_AT + RESULTS + SETTLES - 1 downto 0);

  subtype half_t is std_logic_vector(15 downto 0);

  -- rests; writes what comes before the decision; waits for it; writes it
  type phase_t is (PHASE_REST, PHASE_INPUTS, PHASE_WAIT, PHASE_RESULTS);

  type state_t is record
    phase     : phase_t;
    place     : places_t;  -- '0' where a word is fetched; behind the words: clocks until all has settled
    due       : std_logic; -- a decision has begun, its inputs have not been fetched
    fetched   : std_logic; -- a word of the record is on its way
    stores    : std_logic; -- word is to be stored
    ends      : std_logic; -- all of a record has been, and compared
    ended     : std_logic; -- a clock later
    now       : causes_t;  -- what has happened in the clock before
    hit       : std_logic; -- something has since the record before
    closes    : std_logic; -- a record is to count, or a trigger at rest
    whole     : std_logic; -- it is a record
    fires     : std_logic; -- it triggers
    row       : row_t;     -- of this record
    full      : std_logic;
    recording : std_logic;
    triggered : std_logic;
    cause     : causes_t;  -- what has triggered
    count     : row_t;     -- records since the trigger
    skip      : unsigned(7 downto 0); -- steps since the last that the decimation keeps
    grid      : std_logic; -- it keeps this one
    tripped   : std_logic; -- a clock ago
    known     : std_logic; -- above is
    above     : std_logic; -- the channel was at the level or above
  end record state_t;

  constant STATE_INIT : state_t := (
    phase     => PHASE_REST,
    place     => (others => '1'),
    due       => '0',
    fetched   => '0',
    stores    => '0',
    ends      => '0',
    ended     => '0',
    now       => (others => '0'),
    hit       => '0',
    closes    => '0',
    whole     => '0',
    fires     => '0',
    row       => (others => '0'),
    full      => '0',
    recording => '1',
    triggered => '0',
    cause     => (others => '0'),
    count     => (others => '0'),
    skip      => (others => '0'),
    grid      => '1',
    tripped   => '0',
    known     => '0',
    above     => '0'
  );

  type bus_t is record
    written  : std_logic; -- a write has been taken
    wrong    : std_logic; -- it was none that is allowed
    arm      : std_logic;
    trigger  : std_logic;
    looks    : std_logic; -- a read has been taken
    there    : std_logic; -- its word has been fetched
    answered : std_logic; -- its data is there
    shows    : std_logic; -- what is read stands, or is about to
    refused  : std_logic; -- it was none that is allowed
    settings : std_logic_vector(SETTINGS_CHANNEL + 4 downto 0);
  end record bus_t;

  constant BUS_INIT : bus_t := (
    written  => '0',
    wrong    => '0',
    arm      => '0',
    trigger  => '0',
    looks    => '0',
    there    => '0',
    answered => '0',
    shows    => '0',
    refused  => '0',
    settings => (SETTINGS_FAULT => '1', others => '0')
  );

  type words_t is array (0 to RECORD_WORDS - 1) of word_t;

  signal r          : state_t;
  signal b          : bus_t;
  signal behind     : row_t;
  signal value      : half_t;               -- level
  signal decimation : unsigned(7 downto 0);
  signal read_row   : row_t;
  signal own_write  : std_logic;            -- the write that is there is of this entity
  signal own_read   : std_logic;            -- the read that is there is
  signal words      : words_t;
  signal word       : word_t;               -- of the record
  signal fetched_at : place_t;              -- which will be in word
  signal word_at    : place_t;              -- which is
  signal half       : half_t;               -- that is compared, sign turned over
  signal level      : half_t;               -- likewise
  signal met        : std_logic;            -- the word is the channel's
  signal chosen     : std_logic;            -- half has come
  signal counted    : std_logic;            -- a clock later
  signal compared   : std_logic;            -- another one: above and higher are of the channel
  signal higher     : std_logic;            -- half is above the level, or in the clock before not below
  signal above      : std_logic;            -- it is not below
  signal stores     : std_logic;
  signal store_at   : std_logic_vector(ROWS_LOG2 + PLACE_BITS - 1 downto 0);
  signal fetch_at   : std_logic_vector(ROWS_LOG2 + PLACE_BITS - 1 downto 0);
  signal rests      : std_logic;            -- nothing is stored
  signal fetches    : std_logic;            -- a read is taken
  signal looked_at  : std_logic_vector(6 downto 2);
  signal fetched    : word_t;               -- from the RAM
  signal status     : word_t;
  signal settings   : word_t;
  signal shown_record   : word_t;           -- what a read gives: one of these, the others are zero
  signal shown_status   : word_t;
  signal shown_settings : word_t;
  signal shown_compare  : word_t;

begin

  ---------------------------------------------------------------------------------------------
  -- Steps
  ---------------------------------------------------------------------------------------------

  -- each word has a register that is zero unless its word is fetched: a multiplexer of flip-flops
  g_words : for i in 0 to RECORD_WORDS - 1 generate

    g_there : if i < INPUTS or (i >= RESULTS_AT and i < RESULTS_AT + RESULTS) generate

      p_fetch : process (clk) is
      begin

        if rising_edge(clk) then
          words(i) <= step_words(32 * i + 31 downto 32 * i);

          if (r.place(i) = '1') then
            words(i) <= (others => '0');
          end if;
        end if;

      end process p_fetch;

    end generate g_there;

    g_none : if not (i < INPUTS or (i >= RESULTS_AT and i < RESULTS_AT + RESULTS)) generate
      words(i) <= (others => '0');
    end generate g_none;

  end generate g_words;

  p_word : process (clk) is

    variable any : word_t;
    variable at  : place_t;

  begin

    if rising_edge(clk) then
      any := (others => '0');
      at  := (others => '0');

      for i in words'range loop
        any := any or words(i);
      end loop;

      for i in 0 to RESULTS_AT + RESULTS - 1 loop
        if (r.place(i) = '0') then
          at := at or std_logic_vector(to_unsigned(i, PLACE_BITS));
        end if;
      end loop;

      word       <= any;
      fetched_at <= at;
      word_at    <= fetched_at;
    end if;

  end process p_word;

  ---------------------------------------------------------------------------------------------
  -- Level: a clock for the half, one to see whether it is not below the level, one whether it is above
  ---------------------------------------------------------------------------------------------

  met <= r.stores and to_std_logic(word_at = b.settings(SETTINGS_CHANNEL + 4 downto SETTINGS_CHANNEL + 1));

  p_level : process (clk) is

    variable turn : std_logic; -- signed numbers are compared with their signs turned over

  begin

    if rising_edge(clk) then
      turn := not b.settings(SETTINGS_NO_SIGN);

      if (met = '1') then
        half <= (word(15) xor turn) & word(14 downto 0);

        if (b.settings(SETTINGS_CHANNEL) = '1') then
          half <= (word(31) xor turn) & word(30 downto 16);
        end if;
      end if;

      level    <= (value(15) xor turn) & value(14 downto 0);
      higher   <= to_std_logic(unsigned(half & chosen) >= unsigned(level & '1'));
      above    <= higher;
      chosen   <= met;
      counted  <= chosen;
      compared <= counted;
    end if;

  end process p_level;

  p_record : process (clk) is

    variable v     : state_t;
    variable now   : causes_t;
    variable kept  : std_logic; -- this record is
    variable idle  : std_logic; -- no decision is under way

  begin

    if rising_edge(clk) then
      v         := r;
      v.tripped := tripped;
      v.due     := r.due or begins;
      v.fetched := '0';
      v.stores  := r.fetched;
      v.ends    := '0';
      v.closes  := '0';

      case r.phase is

        when PHASE_REST =>
          null;

        when PHASE_INPUTS =>
          if (b.looks = '0') then
            v.fetched := '1';
            v.place   := r.place(r.place'high - 1 downto 0) & '1';

            if (r.place(INPUTS - 1) = '0') then
              v.phase := PHASE_WAIT;
              v.place := (others => '1');
            end if;
          end if;

          if (decided = '1') then
            v.phase := PHASE_REST;
          end if;

        when PHASE_WAIT =>
          if (decided = '1') then
            v.phase             := PHASE_RESULTS;
            v.place(RESULTS_AT) := '0';
          end if;

        when PHASE_RESULTS =>
          if (b.looks = '0') then
            v.fetched := to_std_logic(r.place(RESULTS_AT + RESULTS - 1 downto RESULTS_AT) /= (1 to RESULTS => '1'));
            v.place   := r.place(r.place'high - 1 downto 0) & '1';

            if (r.place(r.place'high) = '0') then
              v.ends  := '1';
              v.phase := PHASE_REST;
            end if;
          end if;

      end case;

      if (v.due = '1' and r.phase /= PHASE_RESULTS and not (r.phase = PHASE_WAIT and decided = '1')) then
        v.phase    := PHASE_INPUTS;
        v.place    := (others => '1');
        v.place(0) := '0';
        v.due      := '0';
      end if;

      if (compared = '1') then
        v.known := '1';
        v.above := above;
      end if;

      now                  := (others => '0');
      now(CAUSE_FAULT)     := tripped and not r.tripped and b.settings(SETTINGS_FAULT);
      now(CAUSE_DEADLOCK)  := r.ends and deadlock and b.settings(SETTINGS_DEADLOCK);
      now(CAUSE_SATURATED) := r.ends and saturated and b.settings(SETTINGS_SATURATED);
      now(CAUSE_LEVEL)     := compared and ((b.settings(SETTINGS_EQUAL) and above and not higher)
                                            or (r.known and not r.above and above and b.settings(SETTINGS_RISING))
                                            or (r.known and r.above and not above and b.settings(SETTINGS_FALLING)));
      now(CAUSE_MANUAL)    := b.trigger;

      -- what happened, in the clock of ends too, counts in the next
      v.now  := now;
      idle   := to_std_logic(r.phase = PHASE_REST) and not (busy or r.due or begins or r.ends or r.closes);
      v.ended := r.ends;

      if (r.recording = '1') then
        v.cause := r.cause or r.now;

        if (r.now /= (r.now'range => '0')) then
          v.hit := '1';
        end if;
      end if;

      if (r.ended = '1' or (idle = '1' and v.hit = '1')) then
        v.fires  := v.hit and not r.triggered;
        v.hit    := '0';
        v.whole  := r.ended;
        v.closes := '1';
      end if;

      kept := r.whole and (r.fires or r.grid);

      if (r.closes = '1' and r.recording = '1') then
        v.triggered := r.triggered or r.fires;

        if (r.fires = '1' or (r.triggered = '1' and kept = '1')) then
          v.count := r.count + 1;

          if (r.count = behind) then
            v.recording := '0';
          end if;
        end if;

        if (kept = '1') then
          v.row  := r.row + 1;
          v.full := r.full or to_std_logic(r.row = 2 ** ROWS_LOG2 - 1);
        end if;

        if (r.whole = '1') then
          v.skip := r.skip + 1;
          v.grid := '0';

          if (r.skip = decimation) then
            v.skip := (others => '0');
            v.grid := '1';
          end if;
        end if;
      end if;

      if (rst = '1' or b.arm = '1') then
        v         := STATE_INIT;
        v.tripped := tripped;
      end if;

      r <= v;
    end if;

  end process p_record;

  stores   <= r.stores;
  store_at <= std_logic_vector(r.row) & word_at;
  fetch_at <= std_logic_vector(read_row) & looked_at(5 downto 2);
  rests    <= not stores;

  i_ring : entity work.ram
    generic map (
      ADDRESS_WIDTH => ROWS_LOG2 + PLACE_BITS,
      WIDTH         => 32,
      LATENCY       => 1,
      STYLE         => "block"
    )
    port map (
      clk           => clk,
      write         => stores,
      write_address => store_at,
      write_word    => word,
      read          => rests,
      read_address  => fetch_at,
      read_word     => fetched
    );

  ---------------------------------------------------------------------------------------------
  -- Bus
  ---------------------------------------------------------------------------------------------

  own_write <= to_std_logic(awaddr(RECORDER_BLOCK'range) = RECORDER_BLOCK);
  own_read  <= to_std_logic(araddr(RECORDER_BLOCK'range) = RECORDER_BLOCK);

  s_awvalid <= m_awvalid and not own_write;
  s_wvalid  <= m_wvalid and not own_write;
  s_bready  <= m_bready and not b.written;
  m_awready <= s_awready or own_write;
  m_wready  <= s_wready or own_write;
  m_bvalid  <= s_bvalid or b.written;
  m_bresp   <= s_bresp when b.written = '0' else
               b.wrong & "0";

  s_arvalid <= m_arvalid and not own_read;
  s_rready  <= m_rready and not b.answered;
  m_arready <= s_arready or own_read;
  m_rvalid  <= s_rvalid or b.answered;
  m_rresp   <= s_rresp when b.answered = '0' else
               b.refused & "0";
  own_data  <= b.answered;
  m_rdata   <= shown_record or shown_status or shown_settings or shown_compare;

  fetches <= m_arvalid and own_read;

  p_status : process (r) is
  begin

    status                              <= (others => '0');
    status(STATUS_RECORDING)            <= r.recording;
    status(STATUS_TRIGGERED)            <= r.triggered;
    status(STATUS_FULL)                 <= r.full;
    status(STATUS_CAUSE + r.cause'high downto STATUS_CAUSE) <= r.cause;
    status(STATUS_NEXT_ROW + ROWS_LOG2 - 1 downto STATUS_NEXT_ROW) <= std_logic_vector(r.row);
    status(STATUS_ROWS_LOG2 + 3 downto STATUS_ROWS_LOG2) <= std_logic_vector(to_unsigned(ROWS_LOG2, 4));

  end process p_status;

  p_settings : process (b, behind) is
  begin

    settings                    <= (others => '0');
    settings(b.settings'range)  <= b.settings;
    settings(SETTINGS_AFTER + ROWS_LOG2 - 1 downto SETTINGS_AFTER) <= std_logic_vector(behind);

  end process p_settings;

  -- each has a register that is zero unless it is read
  p_shown : process (clk) is
  begin

    if rising_edge(clk) then
      if (b.there = '1') then
        shown_record   <= fetched;
        shown_status   <= status;
        shown_settings <= settings;
        shown_compare  <= std_logic_vector(decimation) & x"00" & value;
      end if;

      if (b.shows = '0' or looked_at(6) = '0') then
        shown_record <= (others => '0');
      end if;

      if (b.shows = '0' or looked_at(6) = '1' or looked_at(3 downto 2) /= RECORDER_STATUS(3 downto 2)) then
        shown_status <= (others => '0');
      end if;

      if (b.shows = '0' or looked_at(6) = '1' or looked_at(3 downto 2) /= RECORDER_SETTINGS(3 downto 2)) then
        shown_settings <= (others => '0');
      end if;

      if (b.shows = '0' or looked_at(6) = '1' or looked_at(3 downto 2) /= RECORDER_COMPARE(3 downto 2)) then
        shown_compare <= (others => '0');
      end if;
    end if;

  end process p_shown;

  p_bus : process (clk) is

    variable v     : bus_t;
    variable taken : std_logic;

  begin

    if rising_edge(clk) then
      v         := b;
      v.arm     := '0';
      v.trigger := '0';
      v.looks   := '0';
      taken     := m_awvalid and own_write;

      if (b.written = '1') then
        v.written := not m_bready;
      elsif (taken = '1') then
        v.written := '1';
        v.wrong   := '0';

        case awaddr(6 downto 2) is

          when RECORDER_SETTINGS =>
            v.settings(SETTINGS_NO_SIGN downto 0) := wdata(SETTINGS_NO_SIGN downto 0);
            v.settings(SETTINGS_CHANNEL + 4 downto SETTINGS_CHANNEL) :=
              wdata(SETTINGS_CHANNEL + 4 downto SETTINGS_CHANNEL);
            behind <= unsigned(wdata(SETTINGS_AFTER + ROWS_LOG2 - 1 downto SETTINGS_AFTER));

          when RECORDER_COMPARE =>
            value      <= wdata(15 downto 0);
            decimation <= unsigned(wdata(COMPARE_DECIMATION + 7 downto COMPARE_DECIMATION));

          when RECORDER_COMMAND =>
            v.arm     := wdata(COMMAND_ARM);
            v.trigger := wdata(COMMAND_TRIGGER);

          when RECORDER_ROW =>
            read_row <= unsigned(wdata(ROWS_LOG2 - 1 downto 0));

          when others =>
            v.wrong := '1';

        end case;

      end if;

      if (fetches = '1') then
        v.looks   := '1';
        looked_at <= araddr(6 downto 2);
        v.refused := to_std_logic(araddr(6) = '0' and unsigned(araddr(5 downto 2)) > unsigned(RECORDER_COMPARE));
      end if;

      v.there    := b.looks and rests;
      v.looks    := v.looks or (b.looks and not rests);
      v.answered := b.there;
      v.shows    := v.there or b.there or b.answered or (b.shows and not m_rready);

      if (rst = '1') then
        v          := BUS_INIT;
        behind      <= (others => '0');
        value      <= (others => '0');
        decimation <= (others => '0');
        read_row   <= (others => '0');
      end if;

      b <= v;
    end if;

  end process p_bus;

end architecture rtl;
