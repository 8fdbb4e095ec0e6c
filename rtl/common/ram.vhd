-- Memory with one write port and one read port, both on one clock.
--
-- The memory is inferred; the attributes say what it is to be made of. STYLE is one of
--   "auto"         the tool chooses
--   "block"        block RAM
--   "apart"        block RAM of which no word is read in the clock in which it is written
--   "distributed"  RAM in LUTs
-- and reaches Vivado and XST as ram_style, Quartus as ramstyle, and Diamond (Synplify, LSE) as
-- syn_ramstyle. Quartus has no word for a block RAM of any family: "block" leaves it the choice.
-- Yosys chooses by size; GHDL's conversion to Verilog drops attributes. So "block" makes at least 512 words, as many as
-- a block RAM of any family has: what is not addressed costs nothing there, and Yosys chooses block RAM.
--
-- Formats: any.
-- Latency: LATENCY clocks from read_address to read_word.
--   0  combinational, read is without effect; no block RAM can do it
--   1  one register, that of a block RAM
--   2  a second register behind it, which a block RAM may take in
-- Initiation interval: one clock for each port.
-- Without read the first register keeps its word, whatever is written in the meantime.
-- A word that is read in the clock in which it is written is the old one, and unknown with STYLE "apart", which saves
-- some families a comparison.
-- Overflow: none; every address has a word.
-- Power-up: CONTENTS, where given; else the words are unknown until they are written. There is no
-- reset.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity ram is
  generic (
    ADDRESS_WIDTH : positive             := 6;      -- bits of an address: 2 ** ADDRESS_WIDTH words
    WIDTH         : positive             := 16;     -- bits of a word
    LATENCY       : natural range 0 to 2 := 1;      -- clocks from address to word
    STYLE         : string               := "auto"; -- "auto", "block", "apart" or "distributed"
    CONTENTS      : std_logic_vector     := ""      -- all words, word 0 rightmost; "" for none
  );
  port (
    clk           : in    std_logic;                                    -- rising edge
    write         : in    std_logic;                                    -- '1': write_word is stored
    write_address : in    std_logic_vector(ADDRESS_WIDTH - 1 downto 0); -- unsigned
    write_word    : in    std_logic_vector(WIDTH - 1 downto 0);         -- word to store
    read          : in    std_logic;                                    -- '1': the word at read_address is fetched
    read_address  : in    std_logic_vector(ADDRESS_WIDTH - 1 downto 0); -- unsigned
    read_word     : out   std_logic_vector(WIDTH - 1 downto 0)          -- word, LATENCY clocks later
  );
end entity ram;

architecture rtl of ram is

  constant WORDS : positive := 2 ** ADDRESS_WIDTH;
  constant LEAST : positive := 512; -- words of a block RAM, in any family

  -- words that are made
  function places return positive is
  begin

    if ((STYLE = "block" or STYLE = "apart") and WORDS < LEAST) then
      return LEAST;
    else
      return WORDS;
    end if;

  end function places;

  -- descending: GHDL 2.0 reverses the addresses of an ascending one that has contents
  type memory_t is array (places - 1 downto 0) of std_logic_vector(WIDTH - 1 downto 0);

  -- contents at power-up, unknown where none are given
  function first_words return memory_t is

    constant GIVEN  : std_logic_vector(CONTENTS'length - 1 downto 0) := CONTENTS;
    variable result : memory_t;

  begin

    result := (others => (others => 'U'));

    if (CONTENTS'length = WORDS * WIDTH) then
      for i in WORDS - 1 downto 0 loop
        result(i) := GIVEN((i + 1) * WIDTH - 1 downto i * WIDTH);
      end loop;
    end if;

    return result;

  end function first_words;

  -- the word of Quartus for a style
  function quartus_style return string is
  begin

    if (STYLE = "distributed") then
      return "MLAB";
    else
      return "auto";
    end if;

  end function quartus_style;

  -- the word of Synplify and of Lattice's LSE for a style
  function lattice_style return string is
  begin

    if (STYLE = "block" or STYLE = "apart") then
      return "block_ram";
    else
      return STYLE;
    end if;

  end function lattice_style;

  -- the word of Vivado and XST for a style
  function xilinx_style return string is
  begin

    if (STYLE = "apart") then
      return "block";
    else
      return STYLE;
    end if;

  end function xilinx_style;

  constant XILINX  : string := xilinx_style;
  constant QUARTUS : string := quartus_style;
  constant LATTICE : string := lattice_style;

  -- vsg_off signal_007
  signal memory : memory_t := first_words;
  -- vsg_on signal_007
  signal word   : std_logic_vector(WIDTH - 1 downto 0);

  attribute ram_style : string;
  attribute ram_style of memory    : signal is XILINX;
  attribute ramstyle : string;
  attribute ramstyle of memory     : signal is QUARTUS;
  attribute syn_ramstyle : string;
  attribute syn_ramstyle of memory : signal is LATTICE;

begin

  assert STYLE = "auto" or STYLE = "block" or STYLE = "apart" or STYLE = "distributed"
    report "ram: STYLE is " & STYLE & ", but has to be auto, block, apart or distributed"
    severity failure;

  assert (STYLE /= "block" and STYLE /= "apart") or LATENCY > 0
    report "ram: a block RAM has a latency of at least one clock"
    severity failure;

  assert CONTENTS'length = 0 or CONTENTS'length = WORDS * WIDTH
    report "ram: CONTENTS has to hold every word, or none"
    severity failure;

  p_write : process (clk) is
  begin

    if rising_edge(clk) then
      if (write = '1') then
        memory(to_integer(unsigned(write_address))) <= write_word;
      end if;
    end if;

  end process p_write;

  g_combinational : if LATENCY = 0 generate
    word      <= memory(to_integer(unsigned(read_address)));
    read_word <= word;
  end generate g_combinational;

  g_registered : if LATENCY > 0 and STYLE /= "apart" generate

    p_read : process (clk) is
    begin

      if rising_edge(clk) then
        if (read = '1') then
          word <= memory(to_integer(unsigned(read_address)));
        end if;
      end if;

    end process p_read;

  end generate g_registered;

  g_apart : if STYLE = "apart" generate

    p_read : process (clk) is
    begin

      if rising_edge(clk) then
        if (read = '1') then
          word <= memory(to_integer(unsigned(read_address)));

          if (write = '1' and write_address = read_address) then
            word <= (others => 'X');
          end if;
        end if;
      end if;

    end process p_read;

  end generate g_apart;

  g_direct : if LATENCY = 1 generate
    read_word <= word;
  end generate g_direct;

  g_output_register : if LATENCY = 2 generate

    p_output : process (clk) is
    begin

      if rising_edge(clk) then
        read_word <= word;
      end if;

    end process p_output;

  end generate g_output_register;

end architecture rtl;
