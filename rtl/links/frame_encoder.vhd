-- Makes a frame of bytes: adds the CRC-32 and stuffs them by COBS into a memory.
--
-- The code of a block is known at its end: the place in front of the block stays free until a zero
-- closes it, and that one write is the zero's own, so that a byte takes one clock.
--
-- Formats: bytes; a frame of at most MAX_FRAME bytes, one COBS block at most.
-- Latency: filled 6 clocks after the last byte came in.
-- Overflow: none; the caller keeps to MAX_PAYLOAD.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.link_constants.all;

entity frame_encoder is
  port (
    clk    : in    std_logic;                    -- rising edge
    rst    : in    std_logic;                    -- synchronous, active high
    -- a frame, type byte first, without CRC
    begins : in    std_logic;                    -- '1' for one clock, before the first byte
    valid  : in    std_logic;                    -- '1': data is the next byte
    data   : in    byte_t;                       -- byte of the frame
    last   : in    std_logic;                    -- '1' with the last byte
    busy   : out   std_logic;                    -- '1': a frame is being made
    -- memory
    write  : out   std_logic;                    -- '1': value is stored
    place  : out   std_logic_vector(5 downto 0); -- where
    value  : out   byte_t;                       -- stuffed byte
    filled : out   std_logic;                    -- '1' for one clock: the frame is there
    size   : out   std_logic_vector(5 downto 0)  -- its stuffed bytes; with filled
  );
end entity frame_encoder;

architecture rtl of frame_encoder is

  type phase_t is (PHASE_IDLE, PHASE_FILL, PHASE_CRC, PHASE_CLOSE, PHASE_FULL);

  type state_t is record
    phase : phase_t;
    code  : unsigned(5 downto 0); -- place of the open block's code
    place : unsigned(5 downto 0); -- of the next byte
    bytes : unsigned(1 downto 0); -- of the CRC, written
  end record state_t;

  constant STATE_INIT : state_t := (
    phase => PHASE_IDLE,
    code  => (others => '0'),
    place => (others => '0'),
    bytes => (others => '0')
  );

  signal r       : state_t;
  signal crc     : crc_t;
  signal came    : std_logic; -- '1': byte_in is the next one of the frame
  signal zero    : std_logic; -- it closes a block
  signal byte_in : byte_t;

begin

  came    <= to_std_logic(r.phase = PHASE_CRC or (r.phase = PHASE_FILL and valid = '1'));
  byte_in <= data when r.phase = PHASE_FILL else
             not crc(7 downto 0);
  zero    <= to_std_logic(byte_in = x"00" or r.phase = PHASE_CLOSE);

  -- a zero is not written: it closes the block in front of it
  write <= came or to_std_logic(r.phase = PHASE_CLOSE);
  place <= std_logic_vector(r.code) when zero = '1' else
           std_logic_vector(r.place);
  value <= std_logic_vector(resize(r.place - r.code, 8)) when zero = '1' else
           byte_in;

  p_encode : process (clk) is

    variable v : state_t;

  begin

    if rising_edge(clk) then
      v := r;

      if (came = '1') then
        v.place := r.place + 1;

        if (zero = '1') then
          v.code := r.place;
        end if;
      end if;

      case r.phase is

        when PHASE_FILL =>
          if (valid = '1') then
            crc <= crc_next(crc, data);

            if (last = '1') then
              v.phase := PHASE_CRC;
            end if;
          end if;

        when PHASE_CRC =>
          crc     <= x"FF" & crc(31 downto 8);
          v.bytes := r.bytes + 1;

          if (r.bytes = CRC_SIZE - 1) then
            v.phase := PHASE_CLOSE;
          end if;

        when PHASE_CLOSE =>
          v.phase := PHASE_FULL;

        when others =>
          v.phase := PHASE_IDLE;

      end case;

      if (begins = '1') then
        v       := STATE_INIT;
        v.phase := PHASE_FILL;
        v.place := to_unsigned(1, v.place'length);
        crc     <= (others => '1');
      end if;

      if (rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_encode;

  busy   <= to_std_logic(r.phase /= PHASE_IDLE);
  filled <= to_std_logic(r.phase = PHASE_FULL);
  size   <= std_logic_vector(r.place);

end architecture rtl;
