-- Brings bits of another clock, or of none, to this clock: a chain of flip-flops for each bit.
--
-- The first flip-flop may become metastable; the others give it time to settle. Every bit settles
-- for itself: bits of one word that change together may arrive a clock apart. A word crosses by a
-- bit that tells when the word is stable.
-- The attributes keep the chain a chain of flip-flops, close together and without a copy:
--   Vivado                    async_reg, shreg_extract
--   XST                       shreg_extract, register_balancing, register_duplication
--   Quartus                   preserve, altera_attribute (synchronizer identification)
--   Diamond (Synplify, LSE)   syn_preserve, syn_srlstyle, syn_replicate
-- GHDL's conversion to Verilog drops them; Yosys then has to be told not to make shift registers
-- of LUTs where the family has them (it has none of them for ECP5 and Spartan-3).
--
-- Formats: any.
-- Latency: STAGES clocks for a bit that is stable at the edge, else that or one more.
-- Overflow: none. A pulse shorter than a clock may be missed.
-- Power-up: unknown for STAGES clocks; there is no reset.
-- Constraints: the path to the first stage is a false path.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity sync_bits is
  generic (
    WIDTH  : positive             := 1; -- bits, each on its own
    STAGES : positive range 2 to 8 := 2 -- flip-flops in a row
  );
  port (
    clk          : in    std_logic;                            -- rising edge
    asynchronous : in    std_logic_vector(WIDTH - 1 downto 0); -- bits of any clock
    synchronous  : out   std_logic_vector(WIDTH - 1 downto 0)  -- the same bits, of clk
  );
end entity sync_bits;

architecture rtl of sync_bits is

  type stages_t is array (1 to STAGES) of std_logic_vector(WIDTH - 1 downto 0);

  signal stage : stages_t; -- 1 is the one that may become metastable

  attribute async_reg : string;
  attribute async_reg of stage            : signal is "TRUE";
  attribute shreg_extract : string;
  attribute shreg_extract of stage        : signal is "no";
  attribute register_balancing : string;
  attribute register_balancing of stage   : signal is "no";
  attribute register_duplication : string;
  attribute register_duplication of stage : signal is "no";
  attribute preserve : boolean;
  attribute preserve of stage             : signal is true;
  attribute altera_attribute : string;
  attribute altera_attribute of stage     : signal is
    "-name SYNCHRONIZER_IDENTIFICATION ""FORCED IF ASYNCHRONOUS""";
  attribute syn_preserve : boolean;
  attribute syn_preserve of stage         : signal is true;
  attribute syn_srlstyle : string;
  attribute syn_srlstyle of stage         : signal is "registers";
  attribute syn_replicate : boolean;
  attribute syn_replicate of stage        : signal is false;

begin

  p_chain : process (clk) is
  begin

    if rising_edge(clk) then
      stage <= asynchronous & stage(1 to STAGES - 1);
    end if;

  end process p_chain;

  synchronous <= stage(STAGES);

end architecture rtl;
