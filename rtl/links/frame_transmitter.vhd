-- Sends frames on two links: one encoder for both, a memory with a half for each, a sender for each.
--
-- Formats: bytes; a frame of at most MAX_FRAME bytes.
-- Latency: offered 7 clocks after the last byte came in; a byte of a link in every fifth clock at most.
-- Overflow: none; the caller keeps to MAX_PAYLOAD, and begins no frame while busy.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library work;
  use work.link_constants.all;

entity frame_transmitter is
  port (
    clk        : in    std_logic;                    -- rising edge
    rst        : in    std_logic;                    -- synchronous, active high
    turn       : in    std_logic;                    -- toggles in every clock
    -- a frame, type byte first, without CRC
    begins     : in    std_logic_vector(1 downto 0); -- '1' for one clock: a frame for that link follows
    valid      : in    std_logic;                    -- '1': data is the next byte
    data       : in    byte_t;                       -- byte of the frame
    last       : in    std_logic;                    -- '1' with the last byte
    busy       : out   std_logic;                    -- '1': a frame is being made
    -- to the lines, link 0 on the right
    offered    : out   std_logic_vector(1 downto 0); -- '1': the link's next byte belongs to a frame
    next_out_0 : out   byte_t;                       -- byte to send; 0x00 between frames
    next_out_1 : out   byte_t;                       -- byte to send; 0x00 between frames
    taken      : in    std_logic_vector(1 downto 0); -- '1' for one clock: it has been taken
    ended      : in    std_logic_vector(1 downto 0)  -- '1' for one clock: cut off, the byte taken last is lost
  );
end entity frame_transmitter;

architecture rtl of frame_transmitter is

  type bytes_t is array (0 to 1) of byte_t;

  type places_t is array (0 to 1) of std_logic_vector(5 downto 0);

  signal begun    : std_logic;
  signal link     : std_logic; -- the frame that is being made is for
  signal write    : std_logic;
  signal place    : std_logic_vector(5 downto 0);
  signal value    : byte_t;
  signal filled   : std_logic;
  signal full     : std_logic_vector(1 downto 0); -- filled, by link
  signal size     : std_logic_vector(5 downto 0);
  signal wanted   : places_t;
  signal look     : std_logic_vector(1 downto 0);
  signal content  : byte_t;
  signal next_out : bytes_t;
  signal write_at : std_logic_vector(6 downto 0);
  signal read_at  : std_logic_vector(6 downto 0);

begin

  begun <= begins(0) or begins(1);

  p_link : process (clk) is
  begin

    if rising_edge(clk) then
      if (begun = '1') then
        link <= begins(1);
      end if;
    end if;

  end process p_link;

  i_encoder : entity work.frame_encoder
    port map (
      clk    => clk,
      rst    => rst,
      begins => begun,
      valid  => valid,
      data   => data,
      last   => last,
      busy   => busy,
      write  => write,
      place  => place,
      value  => value,
      filled => filled,
      size   => size
    );

  look     <= turn & not turn;
  write_at <= link & place;
  read_at  <= turn & wanted(1) when turn = '1' else
              turn & wanted(0);

  i_memory : entity work.ram
    generic map (
      ADDRESS_WIDTH => 7,
      WIDTH         => 8,
      LATENCY       => 1,
      STYLE         => "block"
    )
    port map (
      clk           => clk,
      write         => write,
      write_address => write_at,
      write_word    => value,
      read          => '1',
      read_address  => read_at,
      read_word     => content
    );

  full <= (filled and link) & (filled and not link);

  g_links : for i in 0 to 1 generate

    i_sender : entity work.frame_sender
      port map (
        clk      => clk,
        rst      => rst,
        begins   => begins(i),
        filled   => full(i),
        size     => size,
        place    => wanted(i),
        look     => look(i),
        content  => content,
        offered  => offered(i),
        next_out => next_out(i),
        taken    => taken(i),
        ended    => ended(i)
      );

  end generate g_links;

  next_out_0 <= next_out(0);
  next_out_1 <= next_out(1);

end architecture rtl;
