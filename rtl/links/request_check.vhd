-- Takes a request apart and says whether it may act.
--
-- The request comes byte by byte. What only its meaning tells is checked in the order of the protocol page: type and
-- size, sequence number, authority, position, count of the measurement. Sequence numbers are of one link each: bit 31
-- is the link, the other bits have to lie above the last number that acted on this link, by 1 to 2**30 modulo 2**31.
-- So a frame that was recorded on one link is stale on the other.
--
-- The count of a STEP's measurement stands above its position. While the position is known it has to lie above that of
-- the last STEP that acted on this link, by 1 to 2**(COUNT_BITS - 1) modulo 2**COUNT_BITS. So a host that goes on with
-- an old measurement steps no further.
--
-- Authority: the link in control may do everything. The other one reads, and writes zero to system.control,
-- which disables the gates. With RECORDER it writes the recorder's registers, too: they change nothing of the drive.
--
-- Formats: frames as in docs/protocol.md. measurements and position are the payload of a STEP, first word lowest.
-- Latency: outcome is valid in the clock after the last byte. A number counts in the second clock after acted.
-- Overflow: none; a payload has at most as many bytes as a frame.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.link_constants.all;

entity request_check is
  generic (
    CONTROLLER : positive range 1 to 3 := CONTROLLER_MPDCC; -- one of the constants CONTROLLER_
    STEP_WORDS : positive              := STEP_WORDS_MPDCC; -- 16-bit words of measurements in a STEP
    RECORDER   : boolean               := false             -- true: either link writes the recorder's registers
  );
  port (
    clk           : in    std_logic;                                      -- rising edge
    rst           : in    std_logic;                                      -- synchronous, active high
    -- the request
    link          : in    std_logic;                                      -- where it came from
    valid         : in    std_logic;                                      -- '1': data is a byte of it
    place         : in    std_logic_vector(5 downto 0);                   -- of that byte, type at 0
    data          : in    byte_t;                                         -- byte
    complete      : out   std_logic;                                      -- '1' with its last byte
    -- what it is, from its last byte on
    kind          : out   byte_t;                                         -- type
    number        : out   byte_t;                                         -- lowest byte of the sequence number
    next_number   : in    std_logic;                                      -- '1': show its next byte
    address       : out   std_logic_vector(15 downto 0);                  -- first two bytes of the payload
    next_address  : in    std_logic;                                      -- '1': shift its next byte down
    accesses      : out   std_logic;                                      -- '1': READ or WRITE
    writes        : out   std_logic;                                      -- '1': WRITE
    steps         : out   std_logic;                                      -- '1': STEP
    word          : out   std_logic_vector(31 downto 0);                  -- last four bytes
    measurements  : out   std_logic_vector(16 * STEP_WORDS - 1 downto 0); -- of a STEP
    position      : out   std_logic_vector(15 downto 0);                  -- of a STEP: last two bytes
    -- verdict
    control       : in    std_logic;                                      -- link in control
    step_busy     : in    std_logic;                                      -- '1': no step can begin
    applied       : in    std_logic_vector(15 downto 0);  -- position the gates are at; stays while step_busy = '0'
    applied_known : in    std_logic;                                      -- '1': they are at one
    outcome       : out   outcome_t;                                      -- ACCEPTED or why not
    acted         : in    std_logic;                                      -- '1' for one clock: it acts
    last          : out   std_logic_vector(31 downto 0)                   -- last number that acted on this link
  );
end entity request_check;

architecture rtl of request_check is

  constant STEP_SIZE   : natural := 2 * STEP_WORDS + 2;
  constant WIDTH       : natural := 8 * STEP_SIZE; -- of the payload register
  constant NUMBER_BITS : natural := 31;

  -- bits of a position: MPDCC three switch positions, MPTC a vector
  constant POSITION_BITS : natural := choose(CONTROLLER = CONTROLLER_MPTC, 3, 9);

  type counts_t is array (0 to 1) of unsigned(COUNT_BITS - 1 downto 0);

  type last_t is array (0 to 1) of unsigned(NUMBER_BITS - 1 downto 0);

  signal type_now    : byte_t;
  signal size        : unsigned(7 downto 0);
  signal number_now  : std_logic_vector(31 downto 0);
  signal address_now : std_logic_vector(15 downto 0);
  signal payload     : std_logic_vector(WIDTH - 1 downto 0); -- last byte on the left
  signal quiet       : std_logic;                            -- the word so far is zero
  signal lasts       : last_t;                               -- last number that acted, by link
  signal counts      : counts_t;                             -- measurement of the last STEP that acted, by link
  signal count_now   : unsigned(COUNT_BITS - 1 downto 0);    -- of this one
  signal passed      : unsigned(COUNT_BITS - 1 downto 0);    -- the last one less this one
  signal last_now    : unsigned(NUMBER_BITS - 1 downto 0);
  signal behind      : unsigned(NUMBER_BITS - 1 downto 0);   -- last number less this one
  signal fresh       : std_logic;                            -- the number is new, and of this link
  signal known       : std_logic;                            -- type and size are
  signal changes     : std_logic;                            -- it changes something: WRITE, STEP
  signal noted       : std_logic;                            -- it has acted and changed something: its number counts
  signal writing     : std_logic;                            -- it is a WRITE
  signal stepping    : std_logic;                            -- it is a STEP
  signal disables    : std_logic;                            -- it writes zero to system.control
  signal records     : std_logic;                            -- it writes one of the recorder's registers
  signal stands      : std_logic_vector(POSITION_BITS - 1 downto 0); -- applied, a clock ago

begin

  p_take : process (clk) is
  begin

    if rising_edge(clk) then
      -- what is shown to a reply is shifted out as it came in
      if (next_number = '1') then
        number_now <= data & number_now(31 downto 8);
      end if;

      if (next_address = '1') then
        address_now <= data & address_now(15 downto 8);
      end if;

      if (valid = '1') then

        case to_integer(unsigned(place)) is

          when 0 =>
            type_now <= data;

          when 1 =>
            size <= unsigned(data);

          when 2 | 3 | 4 | 5 =>
            number_now <= data & number_now(31 downto 8);

          when others =>
            payload <= data & payload(WIDTH - 1 downto 8);

        end case;

        if (place = std_logic_vector(to_unsigned(HEADER_SIZE, 6))
            or place = std_logic_vector(to_unsigned(HEADER_SIZE + 1, 6))) then
          address_now <= data & address_now(15 downto 8);
          quiet       <= '1';
        elsif (data /= x"00") then
          quiet <= '0';
        end if;
      end if;
    end if;

  end process p_take;

  complete <= to_std_logic(unsigned(place) = size(5 downto 0) + (HEADER_SIZE - 1)
                           and unsigned(place) >= HEADER_SIZE - 1);

  ---------------------------------------------------------------------------------------------
  -- Type and size
  ---------------------------------------------------------------------------------------------

  p_known : process (type_now, size, address_now) is
  begin

    case type_now is

      when TYPE_IDENTIFY =>
        known <= to_std_logic(size = SIZE_IDENTIFY);

      when TYPE_COUNTERS =>
        -- the one byte of its payload has gone half as far as an address
        known <= to_std_logic(size = SIZE_COUNTERS and (address_now(15 downto 8) and not x"08") = x"00");

      when TYPE_READ =>
        known <= to_std_logic(size = SIZE_READ);

      when TYPE_WRITE =>
        known <= to_std_logic(size = SIZE_WRITE);

      when TYPE_STEP =>
        known <= to_std_logic(size = STEP_SIZE);

      when others =>
        known <= '0';

    end case;

  end process p_known;

  writing  <= to_std_logic(type_now = TYPE_WRITE);
  stepping <= to_std_logic(type_now = TYPE_STEP);
  changes  <= writing or stepping;

  records  <= writing and to_std_logic(RECORDER and address_now(15 downto 7) = RECORDER_BLOCK);
  disables <= quiet and to_std_logic(address_now = std_logic_vector(to_unsigned(CONTROL_ADDRESS, 16)));

  ---------------------------------------------------------------------------------------------
  -- Sequence numbers
  ---------------------------------------------------------------------------------------------

  last_now  <= lasts(0) when link = '0' else
               lasts(1);
  count_now <= unsigned(payload(WIDTH - 1 downto WIDTH - COUNT_BITS));
  passed    <= counts(0) - count_now when link = '0' else
               counts(1) - count_now;
  behind    <= last_now - unsigned(number_now(NUMBER_BITS - 1 downto 0));

  p_numbers : process (clk) is
  begin

    if rising_edge(clk) then
      -- ahead by 1 to 2**30: the difference is negative
      fresh <= behind(NUMBER_BITS - 1) and not (number_now(31) xor link);

      -- a clock later: a verdict is late, and number and link still stand
      noted <= acted and changes;

      if (noted = '1') then
        if (link = '0') then
          lasts(0) <= unsigned(number_now(NUMBER_BITS - 1 downto 0));
        else
          lasts(1) <= unsigned(number_now(NUMBER_BITS - 1 downto 0));
        end if;
      end if;

      if (noted = '1' and stepping = '1') then
        if (link = '0') then
          counts(0) <= count_now;
        else
          counts(1) <= count_now;
        end if;
      end if;

      if (rst = '1') then
        lasts  <= (others => (others => '0'));
        counts <= (others => (others => '0'));
        noted  <= '0';
      end if;
    end if;

  end process p_numbers;

  ---------------------------------------------------------------------------------------------
  -- Verdict
  ---------------------------------------------------------------------------------------------

  -- it comes from far, and is only looked at where it has been the same for a clock
  p_stands : process (clk) is
  begin

    if rising_edge(clk) then
      stands <= applied(POSITION_BITS - 1 downto 0);
    end if;

  end process p_stands;

  p_verdict : process (known, changes, stepping, fresh, link, control, disables, records, step_busy, applied_known,
                       payload, stands, passed) is

    variable asked : std_logic_vector(15 downto 0);

  begin

    asked   := payload(WIDTH - 1 downto WIDTH - 16);
    outcome <= OUTCOME_ACCEPTED;

    if (known = '0') then
      outcome <= OUTCOME_TYPE;
    elsif (changes = '1') then
      if (fresh = '0') then
        outcome <= OUTCOME_STALE;
      elsif (link /= control and (stepping = '1' or (disables or records) = '0')) then
        outcome <= OUTCOME_LINK;
      elsif (stepping = '1' and step_busy = '1') then
        outcome <= OUTCOME_BUSY;
      elsif (stepping = '1' and applied_known = '1'
             and asked(POSITION_BITS - 1 downto 0) /= stands) then
        outcome <= OUTCOME_POSITION;
      elsif (stepping = '1' and applied_known = '1' and passed(COUNT_BITS - 1) = '0') then
        outcome <= OUTCOME_REPEATED;
      end if;
    end if;

  end process p_verdict;

  kind         <= type_now;
  accesses     <= writing or to_std_logic(type_now = TYPE_READ);
  writes       <= writing;
  steps        <= stepping;
  number       <= number_now(7 downto 0);
  address      <= address_now;
  word         <= payload(WIDTH - 1 downto WIDTH - 32);
  measurements <= payload(16 * STEP_WORDS - 1 downto 0);
  position     <= payload(WIDTH - 1 downto WIDTH - 16);
  last         <= link & std_logic_vector(last_now);

end architecture rtl;
