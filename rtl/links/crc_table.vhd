-- CRC-32 of every byte value from a register of zeros, in block RAM.
--
-- A register takes a byte on by  crc(next) = crc / 2**8  xor  table(crc mod 2**8 xor byte).
--
-- Formats: reflected CRC-32 of Ethernet and zlib, see docs/protocol.md.
-- Latency: one clock from index to word.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.link_constants.all;

entity crc_table is
  port (
    clk   : in    std_logic; -- rising edge
    index : in    byte_t;    -- lowest byte of the register xor the byte
    word  : out   crc_t      -- what to add to the register's other bytes, a clock later
  );
end entity crc_table;

architecture rtl of crc_table is

  constant BITS : natural := crc_t'length;

  subtype table_t is std_logic_vector(256 * BITS - 1 downto 0);

  -- all words, that of zero rightmost
  function all_words return table_t is

    variable result : table_t;

  begin

    for i in 0 to 255 loop
      result((i + 1) * BITS - 1 downto i * BITS) := crc_next((others => '0'), std_logic_vector(to_unsigned(i, 8)));
    end loop;

    return result;

  end function all_words;

  constant WORDS : table_t := all_words;

begin

  i_table : entity work.ram
    generic map (
      ADDRESS_WIDTH => 8,
      WIDTH         => BITS,
      LATENCY       => 1,
      STYLE         => "block",
      CONTENTS      => WORDS
    )
    port map (
      clk           => clk,
      write         => '0',
      write_address => (others => '0'),
      write_word    => (others => '0'),
      read          => '1',
      read_address  => index,
      read_word     => word
    );

end architecture rtl;
