-- Parameters of a system: the host's words in a block RAM, and those in force.
--
-- The host reads and writes the RAM, a word at a time; bits that a word does not have are zero. What it writes
-- changes nothing else. After load the words of the RAM are copied, one in a clock, once they are not in use:
--   core       coefficients, bounds and choices, to registers that are used in parallel
--   observer   every word to its memory; it reads coefficients there
-- Coefficients of the slopes that the observer scales are kept here only with SLOPES.
-- The words in parallel are MPDCC's. A system with other parameters leaves them open, and takes c_word by its place.
--
-- So a word in force may change in any clock of a copy, which is whole when waits falls. Until then nothing may begin
-- to use one, and the host may not write: that is up to the owner. load comes between two decisions. Another one in the
-- meantime is one with it, since no word has been written. No set of shadow registers stands between RAM and words in
-- force: a decision that begins behind a commit waits for the copy instead.
-- After a reset all words are zero: a copy begins by itself, and clears the RAM, too. Until it is over reads give zero.
--
-- Coefficients and bounds move along a chain, whose end each word enters: none of them needs an address.
-- Formats: places and widths as mpdcc_parameter_places; coefficients have 16 bits.
-- Latency: a write is done a clock after its request, and a read has its word then. waits is up from the clock after
-- load on, for 67 clocks with 64 words, unless words are in use, behind rst for 66; one more for each access, which
-- goes first. taken is up in the last of them: all words are in force in the next.
-- Overflow: none; bits that a word does not have are dropped.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mpdcc_parameter_places.all;

entity parameter_memory is
  generic (
    SLOPES : boolean  := false;         -- true: coefficients has those of the slopes, false: zeros in their places
    BITS   : places_t := PARAMETER_BITS -- of each parameter, from 0 on; at most 64 of them
  );
  port (
    clk             : in    std_logic;                     -- rising edge
    rst             : in    std_logic;                     -- synchronous, active high
    -- host, one access after the other
    request         : in    std_logic;                     -- '1' for one clock: an access; the next behind its done
    writes          : in    std_logic;                     -- '1' with request: a write, '0': a read
    host_place      : in    std_logic_vector(5 downto 0);  -- word of the access, unsigned
    host_word       : in    std_logic_vector(17 downto 0); -- word to write
    write_done      : out   std_logic;                     -- '1' for one clock: a write is done
    read_done       : out   std_logic;                     -- '1' for one clock: read_word is there
    read_word       : out   std_logic_vector(17 downto 0); -- word with read_done
    -- commit
    load            : in    std_logic;                     -- '1' for one clock: the host's words are to take effect
    in_use          : in    std_logic;                     -- '1': words in force may not change; no rise while waits
    waits           : out   std_logic;                     -- '1': they have not, or not all of them
    taken           : out   std_logic;                     -- '1' for one clock: they have in the next, waits ends
    -- to the observer's memory
    c_write         : out   std_logic;                     -- '1': c_word is to be stored
    c_place         : out   std_logic_vector(5 downto 0);  -- where, unsigned
    c_word          : out   std_logic_vector(17 downto 0); -- as the host's
    -- in force, formats as mpdcc_core and state_observer
    coefficients    : out   std_logic_vector(COEFFICIENT_COUNT * 16 - 1 downto 0); -- signed, word 0 rightmost
    bound_current   : out   std_logic_vector(15 downto 0); -- bound of the currents, unsigned
    bound_neutral   : out   std_logic_vector(15 downto 0); -- bound of v_n, unsigned
    bound_phase     : out   std_logic_vector(15 downto 0); -- bound of v_ph, unsigned
    horizon         : out   std_logic_vector(5 downto 0);  -- steps, unsigned
    weight_scale    : out   std_logic_vector(1 downto 0);  -- fractional bits of the weighted v_n
    two_switchings  : out   std_logic;                     -- '1': SESE
    budget          : out   std_logic_vector(11 downto 0); -- candidates of the second level, unsigned, 0: all
    compensate      : out   std_logic;                     -- '1': decide for k+1
    deadlock_rule   : out   std_logic;                     -- '1': weighted
    outside_inwards : out   std_logic;                     -- '1': rule inwards
    f_q_midpoint    : out   std_logic_vector(2 downto 0);  -- q of v_n's filter, unsigned
    f_q_phase       : out   std_logic_vector(2 downto 0);  -- q of v_ph's filter, unsigned
    l_mode          : out   std_logic_vector(1 downto 0)   -- 0: theta is 1, bit 0: estimated, bit 1: frozen
  );
end entity parameter_memory;

architecture rtl of parameter_memory is

  constant WORD_BITS    : positive := 18;
  constant CHAINED_BITS : positive := 16;                    -- of a word of the chain
  constant CHAIN_COUNT  : positive := COEFFICIENT_COUNT + 3; -- coefficients, then bounds
  constant LAST         : natural  := BITS'length - 1;

  subtype word_t is std_logic_vector(WORD_BITS - 1 downto 0);

  subtype chained_t is std_logic_vector(CHAINED_BITS - 1 downto 0);

  type chain_t is array (0 to CHAIN_COUNT - 1) of chained_t;

  signal loading      : std_logic; -- words are to take effect
  signal clearing     : std_logic; -- this copy is that of a reset
  signal blank        : std_logic; -- what was read in the clock before is zero
  signal active       : std_logic; -- words are still to be fetched
  signal next_place   : unsigned(5 downto 0);
  signal reads        : std_logic;
  signal fetches      : std_logic; -- the copy fetches a word in this clock
  signal fetched      : std_logic; -- it has fetched one in the clock before
  signal fetched_at   : unsigned(5 downto 0);
  signal sent         : std_logic; -- the word of a clock ago is on its way into force
  signal sent_at      : unsigned(5 downto 0);
  signal sent_word    : word_t;
  signal ends         : std_logic;
  signal is_taken     : std_logic;
  signal busy         : std_logic;
  signal host_mask    : word_t;    -- bits that the word of the access has
  signal written      : std_logic; -- a write is to be stored
  signal written_at   : std_logic_vector(5 downto 0);
  signal written_word : word_t;
  signal mask         : word_t;    -- host_mask of it
  signal stores       : std_logic;
  signal rests        : std_logic; -- nothing is stored
  signal stored_place : std_logic_vector(5 downto 0);
  signal stored_word  : word_t;
  signal shown_place  : std_logic_vector(5 downto 0);
  signal ram_word     : word_t;
  signal shown        : word_t;
  signal moves        : std_logic; -- the word fetched enters the chain
  signal chain        : chain_t;

  -- whether the chain has the word of a place
  function kept (at : natural) return boolean is
  begin

    for i in SLOPE_PLACES'range loop
      if (SLOPE_PLACES(i) = at and not SLOPES) then
        return false;
      end if;
    end loop;

    return at < CHAIN_COUNT;

  end function kept;

  -- place of the next word of the chain; none: CHAIN_COUNT
  function behind (at : natural) return natural is

    variable found : natural;

  begin

    found := CHAIN_COUNT;

    for i in CHAIN_COUNT - 1 downto 0 loop
      if (i > at and kept(i)) then
        found := i;
      end if;
    end loop;

    return found;

  end function behind;

begin

  assert LAST <= 63
    report "parameter_memory: a place has six bits"
    severity failure;

  ---------------------------------------------------------------------------------------------
  -- The host's words
  ---------------------------------------------------------------------------------------------

  reads        <= request and not writes;
  stores       <= written or clearing;
  stored_place <= std_logic_vector(next_place) when clearing = '1' else
                  written_at;
  stored_word  <= written_word and mask;
  shown_place  <= host_place when reads = '1' else
                  std_logic_vector(next_place);

  p_mask : process (host_place) is

    variable mine : std_logic; -- the access is to this place
    variable ones : word_t;

  begin

    ones := (others => '0');

    for i in BITS'range loop
      mine := to_std_logic(unsigned(host_place) = i);

      for n in ones'range loop
        if (n < BITS(i)) then
          ones(n) := ones(n) or mine;
        end if;
      end loop;
    end loop;

    host_mask <= ones;

  end process p_mask;

  p_host : process (clk) is
  begin

    if rising_edge(clk) then
      read_done     <= reads;
      blank         <= clearing;
      written       <= request and writes;
      written_at    <= host_place;
      written_word  <= host_word;

      mask          <= host_mask;

      if (rst = '1') then
        read_done <= '0';
        written   <= '0';
      end if;

      if (rst = '1' or clearing = '1') then
        mask <= (others => '0');
      end if;
    end if;

  end process p_host;

  -- never both at once: the word that is read need not be told from the one that is written
  rests <= not stores;

  i_words : entity work.ram
    generic map (
      ADDRESS_WIDTH => 6,
      WIDTH         => WORD_BITS,
      LATENCY       => 1,
      STYLE         => "block"
    )
    port map (
      clk           => clk,
      write         => stores,
      write_address => stored_place,
      write_word    => stored_word,
      read          => rests,
      read_address  => shown_place,
      read_word     => ram_word
    );

  shown      <= ram_word when blank = '0' else
                (others => '0');
  read_word  <= shown;
  write_done <= written;

  ---------------------------------------------------------------------------------------------
  -- Copy
  ---------------------------------------------------------------------------------------------

  fetches <= active and not (reads or written);
  ends    <= fetched and to_std_logic(fetched_at = LAST);
  busy    <= active or fetched or is_taken;

  p_copy : process (clk) is
  begin

    if rising_edge(clk) then
      fetched    <= fetches;
      fetched_at <= next_place;
      is_taken   <= ends;

      if (load = '1') then
        loading <= '1';
      elsif (is_taken = '1') then
        loading <= '0';
      end if;

      if (fetches = '1') then
        active     <= to_std_logic(next_place /= LAST);
        next_place <= next_place + 1;

        if (LAST < 63 and next_place = LAST) then
          next_place <= (others => '0');
        end if;
      elsif (loading = '1' and in_use = '0' and busy = '0') then
        active <= '1';
      end if;

      if (ends = '1') then
        clearing <= '0';
      end if;

      if (rst = '1') then
        fetched    <= '0';
        is_taken   <= '0';
        loading    <= '1';
        active     <= '1';
        clearing   <= '1';
        next_place <= (others => '0');
      end if;
    end if;

  end process p_copy;

  waits <= loading;
  taken <= is_taken;

  -- the word comes late from its RAM, and has far to go
  p_sent : process (clk) is
  begin

    if rising_edge(clk) then
      sent      <= fetched;
      sent_at   <= fetched_at;
      sent_word <= shown;

      if (rst = '1') then
        sent <= '0';
      end if;
    end if;

  end process p_sent;

  c_write <= sent;
  c_place <= std_logic_vector(sent_at);
  c_word  <= sent_word;

  ---------------------------------------------------------------------------------------------
  -- Words that are used in parallel
  ---------------------------------------------------------------------------------------------

  p_moves : process (sent, sent_at) is

    variable one : std_logic; -- the word is one of the chain

  begin

    one := '0';

    for i in 0 to CHAIN_COUNT - 1 loop
      if (kept(i)) then
        one := one or to_std_logic(sent_at = i);
      end if;
    end loop;

    moves <= sent and one;

  end process p_moves;

  p_chain : process (clk) is
  begin

    if rising_edge(clk) then
      if (moves = '1') then
        for i in 0 to CHAIN_COUNT - 1 loop
          if (behind(i) < CHAIN_COUNT) then
            chain(i) <= chain(behind(i));
          else
            chain(i) <= sent_word(CHAINED_BITS - 1 downto 0);
          end if;
        end loop;
      end if;
    end if;

  end process p_chain;

  g_coefficients : for i in 0 to COEFFICIENT_COUNT - 1 generate
    coefficients((i + 1) * CHAINED_BITS - 1 downto i * CHAINED_BITS) <= chain(i) when kept(i) else
                                                                        (others => '0');
  end generate g_coefficients;

  bound_current <= chain(PLACE_BOUND_CURRENT);
  bound_neutral <= chain(PLACE_BOUND_NEUTRAL);
  bound_phase   <= chain(PLACE_BOUND_PHASE);

  p_settings : process (clk) is
  begin

    if rising_edge(clk) then
      if (sent = '1') then
        if (sent_at = PLACE_HORIZON) then
          horizon <= sent_word(5 downto 0);
        end if;

        if (sent_at = PLACE_WEIGHT_SCALE) then
          weight_scale <= sent_word(1 downto 0);
        end if;

        if (sent_at = PLACE_TWO_SWITCHINGS) then
          two_switchings <= sent_word(0);
        end if;

        if (sent_at = PLACE_BUDGET) then
          budget <= sent_word(11 downto 0);
        end if;

        if (sent_at = PLACE_COMPENSATE) then
          compensate <= sent_word(0);
        end if;

        if (sent_at = PLACE_DEADLOCK_RULE) then
          deadlock_rule <= sent_word(0);
        end if;

        if (sent_at = PLACE_OUTSIDE_INWARDS) then
          outside_inwards <= sent_word(0);
        end if;

        if (sent_at = PLACE_F_Q_MIDPOINT) then
          f_q_midpoint <= sent_word(2 downto 0);
        end if;

        if (sent_at = PLACE_F_Q_PHASE) then
          f_q_phase <= sent_word(2 downto 0);
        end if;

        if (sent_at = PLACE_L_MODE) then
          l_mode <= sent_word(1 downto 0);
        end if;
      end if;
    end if;

  end process p_settings;

end architecture rtl;
