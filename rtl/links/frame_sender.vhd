-- Gives a frame out byte by byte between two delimiters, as the line takes them.
--
-- A frame that waits or is under way is given up when a new one begins: a host that asks again has done
-- so itself. A line that is cut off before the byte behind the frame was taken gets the whole frame
-- again; a host drops what it has had already by the sequence number.
--
-- Formats: bytes. The memory is shared: look says in which clock place is read.
-- Latency: offered one clock after filled. next_out is that of a new place within four clocks, so the line takes a
-- byte in every fifth clock at most.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.link_constants.all;

entity frame_sender is
  port (
    clk      : in    std_logic;                    -- rising edge
    rst      : in    std_logic;                    -- synchronous, active high
    begins   : in    std_logic;                    -- '1' for one clock: another frame is being made
    filled   : in    std_logic;                    -- '1' for one clock: it is there
    size     : in    std_logic_vector(5 downto 0); -- its stuffed bytes; with filled
    -- memory
    place    : out   std_logic_vector(5 downto 0); -- of a byte
    look     : in    std_logic;                    -- '1': place is read in this clock; every second one
    content  : in    byte_t;                       -- a clock later
    -- line
    offered  : out   std_logic;                    -- '1': next_out belongs to a frame
    next_out : out   byte_t;                       -- byte to send; 0x00 between frames
    taken    : in    std_logic;                    -- '1' for one clock: next_out has been taken
    ended    : in    std_logic                     -- '1' for one clock: cut off, the byte taken last is lost
  );
end entity frame_sender;

architecture rtl of frame_sender is

  type phase_t is (PHASE_IDLE, PHASE_LEAD, PHASE_DATA, PHASE_TAIL, PHASE_GONE);

  type state_t is record
    phase  : phase_t;
    place  : unsigned(5 downto 0); -- of the next byte
    looked : std_logic;            -- content is the byte of a clock ago
  end record state_t;

  constant STATE_INIT : state_t := (
    phase  => PHASE_IDLE,
    place  => (others => '0'),
    looked => '0'
  );

  signal r      : state_t;
  signal bytes  : unsigned(5 downto 0); -- of the frame
  signal stored : byte_t;

begin

  p_send : process (clk) is

    variable v : state_t;

  begin

    if rising_edge(clk) then
      v        := r;
      v.looked := look;

      if (r.looked = '1') then
        stored <= content;
      end if;

      if (taken = '1') then

        case r.phase is

          when PHASE_LEAD =>
            v.phase := PHASE_DATA;

          when PHASE_DATA =>
            v.place := r.place + 1;

            if (v.place = bytes) then
              v.phase := PHASE_TAIL;
            end if;

          when PHASE_TAIL =>
            v.phase := PHASE_GONE;

          -- a line with a byte of its own in between has now sent the last one
          when others =>
            v.phase := PHASE_IDLE;

        end case;

      end if;

      if (ended = '1' and r.phase /= PHASE_IDLE) then
        v.phase := PHASE_LEAD;
        v.place := (others => '0');
      end if;

      if (filled = '1') then
        v.phase := PHASE_LEAD;
        v.place := (others => '0');
        bytes   <= unsigned(size);
      end if;

      if (begins = '1' or rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_send;

  place    <= std_logic_vector(r.place);
  offered  <= to_std_logic(r.phase = PHASE_LEAD or r.phase = PHASE_DATA or r.phase = PHASE_TAIL);
  next_out <= stored when r.phase = PHASE_DATA else
              x"00";

end architecture rtl;
