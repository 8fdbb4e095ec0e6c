-- Sends a frame: takes its bytes one a clock, adds the CRC-32, stuffs them by COBS into a memory, and
-- gives them out between two delimiters as the line takes them.
--
-- The code of a block is known at its end: the place in front of the block stays free until a zero
-- closes it, and that one write is the zero's own, so that a byte takes one clock.
-- A frame that waits or is under way is given up when a new one begins: a host that asks again has done
-- so itself. A line that is cut off before the byte behind the frame was taken gets the whole frame
-- again; a host drops what it has had already by the sequence number.
--
-- Formats: bytes; a frame of at most MAX_FRAME bytes, one COBS block at most.
-- Latency: offered 6 clocks after the last byte came in.
-- Overflow: none; the caller keeps to MAX_PAYLOAD.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.link_constants.all;

entity frame_transmitter is
  port (
    clk     : in    std_logic; -- rising edge
    rst     : in    std_logic; -- synchronous, active high
    -- a frame, type byte first, without CRC
    begins  : in    std_logic; -- '1' for one clock, before the first byte: drops what is left of another
    valid   : in    std_logic; -- '1': data is the next byte
    data    : in    byte_t;    -- byte of the frame
    last    : in    std_logic; -- '1' with the last byte
    -- to the line
    offered : out   std_logic; -- '1': next_out belongs to a frame
    next_out : out   byte_t;   -- byte to send; 0x00 between frames
    taken   : in    std_logic; -- '1' for one clock: next_out has been taken
    ended   : in    std_logic  -- '1' for one clock: the line was cut off, byte taken last is lost
  );
end entity frame_transmitter;

architecture rtl of frame_transmitter is

  type phase_t is (PHASE_IDLE, PHASE_FILL, PHASE_CRC, PHASE_CLOSE, PHASE_LEAD, PHASE_DATA, PHASE_TAIL, PHASE_GONE);

  type state_t is record
    phase : phase_t;
    code  : unsigned(5 downto 0); -- place of the open block's code
    place : unsigned(5 downto 0); -- of the next byte, written or read
    bytes : unsigned(1 downto 0); -- of the CRC, written
    size  : unsigned(5 downto 0); -- stuffed bytes
  end record state_t;

  constant STATE_INIT : state_t := (
    phase => PHASE_IDLE,
    code  => (others => '0'),
    place => (others => '0'),
    bytes => (others => '0'),
    size  => (others => '0')
  );

  signal r       : state_t;
  signal crc     : crc_t;
  signal came    : std_logic; -- '1': byte_in is the next one of the frame
  signal byte_in : byte_t;
  signal spot    : unsigned(5 downto 0);
  signal value   : byte_t;
  signal write   : std_logic;
  signal stored  : byte_t; -- at r.place

begin

  came    <= '1' when r.phase = PHASE_CRC or (r.phase = PHASE_FILL and valid = '1') else
             '0';
  byte_in <= data when r.phase = PHASE_FILL else
             not crc(7 downto 0);
  write   <= '1' when came = '1' or r.phase = PHASE_CLOSE else
             '0';

  -- a zero is not written: it closes the block in front of it
  spot  <= r.place when came = '1' and byte_in /= x"00" else
           r.code;
  value <= byte_in when came = '1' and byte_in /= x"00" else
           std_logic_vector(resize(r.place - r.code, 8));

  i_memory : entity work.ram
    generic map (
      ADDRESS_WIDTH => 6,
      WIDTH         => 8,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write,
      write_address => std_logic_vector(spot),
      write_word    => value,
      read          => '1',
      read_address  => std_logic_vector(r.place),
      read_word     => stored
    );

  p_frame : process (clk) is

    variable v : state_t;

  begin

    if rising_edge(clk) then
      v := r;

      if (came = '1') then
        v.place := r.place + 1;

        if (byte_in = x"00") then
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
          v.size  := r.place;
          v.place := (others => '0');
          v.phase := PHASE_LEAD;

        when PHASE_LEAD =>
          if (taken = '1') then
            v.phase := PHASE_DATA;
          end if;

        when PHASE_DATA =>
          if (taken = '1') then
            v.place := r.place + 1;

            if (v.place = r.size) then
              v.phase := PHASE_TAIL;
            end if;
          end if;

        when PHASE_TAIL =>
          if (taken = '1') then
            v.phase := PHASE_GONE;
          end if;

        -- a line with a byte of its own in between has now sent the last one
        when PHASE_GONE =>
          if (taken = '1') then
            v.phase := PHASE_IDLE;
          end if;

        when others =>
          null;

      end case;

      if (ended = '1' and (r.phase = PHASE_DATA or r.phase = PHASE_TAIL or r.phase = PHASE_GONE)) then
        v.phase := PHASE_LEAD;
        v.place := (others => '0');
      end if;

      if (begins = '1' or rst = '1') then
        v   := STATE_INIT;
        crc <= (others => '1');
      end if;

      if (begins = '1' and rst = '0') then
        v.phase := PHASE_FILL;
        v.place := to_unsigned(1, v.place'length);
      end if;

      r <= v;
    end if;

  end process p_frame;

  offered  <= '1' when r.phase = PHASE_LEAD or r.phase = PHASE_DATA or r.phase = PHASE_TAIL else
              '0';
  next_out <= stored when r.phase = PHASE_DATA else
              x"00";

end architecture rtl;
