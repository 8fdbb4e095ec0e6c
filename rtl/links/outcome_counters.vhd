-- One counter for every outcome a frame may have, for each of two links, in one memory.
--
-- Three sources: what the receiver rejects, of either link, and what the executor has served. Each waits until
-- its turn; a count takes three clocks: read, keep, write one more. After a reset the counters are cleared, one a
-- clock. A look at a counter waits for counts.
--
-- Formats: WIDTH bits unsigned. Index: the link above the outcome.
-- Latency: a count shows at most twelve clocks after it. Each source counts once in twelve clocks at most, which frames
-- of at least two bytes keep. A look is answered at most twelve clocks after it began, 40 after a reset.
-- Overflow: a counter stays at its largest value.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.link_constants.all;

entity outcome_counters is
  generic (
    WIDTH : positive := 32 -- bits of a counter
  );
  port (
    clk             : in    std_logic;                            -- rising edge
    rst             : in    std_logic;                            -- synchronous, active high: clears
    received        : in    std_logic_vector(1 downto 0);         -- '1' for one clock: count receive_outcome, by link
    receive_outcome : in    outcome_t;                            -- what the receiver made of a frame
    served          : in    std_logic_vector(1 downto 0);         -- '1' for one clock: count serve_outcome, by link
    serve_outcome   : in    outcome_t;                            -- what became of a frame that was received
    look            : in    std_logic;                            -- '1' until shown: value of index is wanted
    index           : in    std_logic_vector(4 downto 0);         -- counter to look at, stable while look
    shown           : out   std_logic;                            -- '1' for one clock: value is that of index
    value           : out   std_logic_vector(WIDTH - 1 downto 0)  -- count, stable until the next shown
  );
end entity outcome_counters;

architecture rtl of outcome_counters is

  subtype index_t is std_logic_vector(4 downto 0);

  type state_t is record
    clearing : unsigned(5 downto 0);         -- counter being cleared; 32: done
    wanted   : std_logic_vector(2 downto 0); -- sources that wait: receiver's links, executor
    reading  : std_logic;                    -- the count of place is read
    counting : std_logic;                    -- present is the count of place
    looking  : std_logic;                    -- what is looked at is read
    looked   : std_logic;                    -- present is what was looked at
    shown    : std_logic;
  end record state_t;

  constant STATE_INIT : state_t := (
    clearing => (others => '0'),
    wanted   => "000",
    reading  => '0',
    counting => '0',
    looking  => '0',
    looked   => '0',
    shown    => '0'
  );

  signal r        : state_t;
  signal reason_0 : outcome_t;                        -- link 0's, of the receiver
  signal reason_1 : outcome_t;                        -- link 1's, of the receiver
  signal reason   : index_t;                          -- of the executor
  signal chosen   : index_t;                          -- counter that is read
  signal place    : index_t;                          -- counter that is counted
  signal present  : std_logic_vector(WIDTH - 1 downto 0);
  signal fresh    : unsigned(WIDTH downto 0);         -- one more; carry on top
  signal cleared  : std_logic;                        -- all are
  signal write    : std_logic;
  signal read     : std_logic;
  signal write_at : index_t;
  signal word     : std_logic_vector(WIDTH - 1 downto 0);

begin

  cleared <= r.clearing(5);

  chosen <= '0' & reason_0 when r.wanted(0) = '1' else
            '1' & reason_1 when r.wanted(1) = '1' else
            reason when r.wanted(2) = '1' else
            index;

  fresh    <= unsigned('0' & present) + 1;
  write    <= (r.counting and not fresh(WIDTH)) or not cleared;
  -- never both: no memory has to know what a word is that is read while it is written
  read     <= cleared and not r.counting;
  write_at <= place when cleared = '1' else
              std_logic_vector(r.clearing(4 downto 0));
  word     <= std_logic_vector(fresh(WIDTH - 1 downto 0)) when cleared = '1' else
              (others => '0');

  i_memory : entity work.ram
    generic map (
      ADDRESS_WIDTH => 5,
      WIDTH         => WIDTH,
      LATENCY       => 2,
      STYLE         => "block"
    )
    port map (
      clk           => clk,
      write         => write,
      write_address => write_at,
      write_word    => word,
      read          => read,
      read_address  => chosen,
      read_word     => present
    );

  p_count : process (clk) is

    variable v : state_t;

  begin

    if rising_edge(clk) then
      v          := r;
      v.reading  := '0';
      v.counting := r.reading;
      v.looking  := '0';
      v.looked   := r.looking;
      v.shown    := r.looked;

      if (r.reading = '0') then
        place <= chosen;
      end if;

      if (cleared = '0') then
        v.clearing := r.clearing + 1;
      elsif (r.reading = '0' and r.counting = '0') then
        -- the memory is free: whoever waits, the look last
        if (r.wanted(0) = '1') then
          v.wanted(0) := '0';
          v.reading   := '1';
        elsif (r.wanted(1) = '1') then
          v.wanted(1) := '0';
          v.reading   := '1';
        elsif (r.wanted(2) = '1') then
          v.wanted(2) := '0';
          v.reading   := '1';
        else
          v.looking := look and not (r.looking or r.looked or r.shown);
        end if;
      end if;

      if (r.looked = '1') then
        value <= present;
      end if;

      if (received(0) = '1') then
        reason_0    <= receive_outcome;
        v.wanted(0) := '1';
      end if;

      if (received(1) = '1') then
        reason_1    <= receive_outcome;
        v.wanted(1) := '1';
      end if;

      if (served /= "00") then
        reason      <= served(1) & serve_outcome;
        v.wanted(2) := '1';
      end if;

      if (rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_count;

  shown <= r.shown;

end architecture rtl;
