-- Receives frames from a stream of bytes: takes off the stuffing, checks everything that the bytes alone
-- can tell, and keeps a good frame until it is released.
--
-- COBS: each code byte says how many bytes follow until the next zero of the frame, or its end; a zero
-- byte on the line ends the frame in any state, so one frame at most is lost to whatever happened.
-- Checks in the order of the protocol page: broken line, more than MAX_FRAME bytes, stuffing, fewer
-- than OVERHEAD bytes, length byte, CRC-32, time, and whether the frame before is still here; the first
-- that fails is the outcome. The memory is written while no frame waits in it, and a frame is shown to
-- the outside only after its last check.
--
-- Formats: the frame's bytes in order, type first, at addresses 0 to MAX_FRAME - 1.
-- Latency: pending or rejected one clock after the delimiter's valid; a byte every second clock at most.
-- Overflow: see the checks; bytes beyond MAX_FRAME are counted nowhere and written nowhere.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.link_constants.all;

entity frame_receiver is
  generic (
    LIMIT : positive := 125_000 -- clocks a frame may take from its first byte to its end
  );
  port (
    clk      : in    std_logic;                    -- rising edge
    rst      : in    std_logic;                    -- synchronous, active high
    -- from the line
    valid    : in    std_logic;                    -- '1' for one clock: data is a new byte
    data     : in    byte_t;                       -- stuffed
    broken   : in    std_logic;                    -- '1' for one clock: a byte was lost
    ended    : in    std_logic;                    -- '1' for one clock: a frame under way is cut off here
    -- a frame that passed
    pending  : out   std_logic;                    -- '1': there is one
    address  : in    std_logic_vector(5 downto 0); -- of a byte of it
    content  : out   byte_t;                       -- that byte, same clock
    served  : in    std_logic;                    -- '1' for one clock: done with it
    -- a frame that did not
    rejected : out   std_logic;                    -- '1' for one clock
    outcome  : out   outcome_t                     -- why; valid with rejected
  );
end entity frame_receiver;

architecture rtl of frame_receiver is

  type state_t is record
    inside   : std_logic;            -- a byte has come since the last delimiter
    left     : unsigned(7 downto 0); -- bytes until the next code
    size     : unsigned(5 downto 0); -- bytes taken off, up to MAX_FRAME
    line     : std_logic;            -- a byte was lost
    over     : std_logic;            -- more than MAX_FRAME
    late     : std_logic;            -- beyond LIMIT
    blocked  : std_logic;            -- the memory was not free
    pending  : std_logic;
    rejected : std_logic;
  end record state_t;

  constant STATE_INIT : state_t := (
    inside   => '0',
    left     => (others => '0'),
    size     => (others => '0'),
    line     => '0',
    over     => '0',
    late     => '0',
    blocked  => '0',
    pending  => '0',
    rejected => '0'
  );

  signal r      : state_t;
  signal crc    : crc_t;
  signal length : unsigned(7 downto 0);                   -- the frame's length byte
  signal timer  : natural range 0 to LIMIT;
  signal plain  : byte_t;                                  -- byte without stuffing
  signal keep   : std_logic;                               -- '1': plain is written to the memory
  signal store  : std_logic;                               -- '1': plain belongs to the frame
  signal found  : outcome_t;

begin

  -- a code ends the zero before it, but for the first one
  plain <= x"00" when r.left = 0 else
           data;
  store <= '1' when valid = '1' and data /= x"00" and r.line = '0' and not (r.left = 0 and r.inside = '0') else
           '0';

  keep <= '1' when store = '1' and r.size /= MAX_FRAME and r.pending = '0' else
          '0';

  i_memory : entity work.ram
    generic map (
      ADDRESS_WIDTH => 6,
      WIDTH         => 8,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => keep,
      write_address => std_logic_vector(r.size),
      write_word    => plain,
      read          => '1',
      read_address  => address,
      read_word     => content
    );

  p_judge : process (r, length, crc) is
  begin

    if (r.line = '1') then
      found <= OUTCOME_LINE;
    elsif (r.over = '1') then
      found <= OUTCOME_OVERSIZED;
    elsif (r.left /= 0) then
      found <= OUTCOME_STUFFING;
    elsif (r.size < OVERHEAD) then
      found <= OUTCOME_SHORT;
    elsif (length + OVERHEAD /= resize(r.size, 9) or length > MAX_PAYLOAD) then
      found <= OUTCOME_LENGTH;
    elsif (crc /= CRC_RESIDUE) then
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
      v          := r;
      v.rejected := '0';
      outcome    <= found;

      if (served = '1') then
        v.pending := '0';
      end if;

      if (r.inside = '0') then
        timer <= 0;
      elsif (timer = LIMIT) then
        v.late := '1';
      else
        timer <= timer + 1;
      end if;

      if (store = '1') then
        if (r.size = MAX_FRAME) then
          v.over := '1';
        else
          v.size := r.size + 1;
        end if;

        crc <= crc_next(crc, plain);

        if (r.size = 1) then
          length <= unsigned(plain);
        end if;
      end if;

      if (broken = '1') then
        v.inside := '1';
        v.line   := '1';
      elsif (ended = '1' and r.inside = '1') then
        -- cut off: as a broken byte and a delimiter
        v.rejected := '1';
        outcome    <= OUTCOME_LINE;
        v.inside   := '0';
      elsif (valid = '1' and data = x"00") then
        v.inside := '0';

        if (r.inside = '1') then
          if (found = OUTCOME_ACCEPTED) then
            v.pending := '1';
          else
            v.rejected := '1';
          end if;
        end if;
      elsif (valid = '1') then
        v.inside  := '1';
        v.blocked := r.blocked or r.pending;

        if (r.left = 0) then
          v.left := unsigned(data) - 1;
        else
          v.left := r.left - 1;
        end if;
      end if;

      if (v.inside = '0') then
        v.left    := (others => '0');
        v.size    := (others => '0');
        v.line    := '0';
        v.over    := '0';
        v.late    := '0';
        v.blocked := '0';
        crc       <= (others => '1');
      end if;

      if (rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_receive;

  pending  <= r.pending;
  rejected <= r.rejected;

end architecture rtl;
