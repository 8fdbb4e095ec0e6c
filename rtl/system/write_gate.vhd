-- Lets AXI4-Lite writes through one at a time, and answers those that are refused itself.
--
-- A write is refused where refuse is up in the clock in which both its address and its data are there: it is
-- taken, nothing reaches the registers, and its response is SLVERR. No write is kept waiting but by hold, which
-- its owner raises for a few clocks at most. Reads are not touched.
--
-- Formats: AXI4-Lite; address and data are taken in the same clock.
-- Latency: none for a write that passes; a refused one has its response in the next clock. A write every second
-- clock after its response at best.
-- Overflow: none.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity write_gate is
  port (
    clk       : in    std_logic;                    -- rising edge
    rst       : in    std_logic;                    -- synchronous, active high
    hold      : in    std_logic;                    -- '1': let no write begin
    refuse    : in    std_logic;                    -- '1': the write that is there is refused
    passed    : out   std_logic;                    -- '1': the write that is there goes to the registers
    -- from the master
    m_awvalid : in    std_logic;                    -- '1': address there
    m_awready : out   std_logic;                    -- '1': address taken
    m_wvalid  : in    std_logic;                    -- '1': data there
    m_wready  : out   std_logic;                    -- '1': data taken
    m_bready  : in    std_logic;                    -- '1': response taken
    m_bvalid  : out   std_logic;                    -- '1': response there
    m_bresp   : out   std_logic_vector(1 downto 0); -- "00": okay, "10": SLVERR
    -- to the registers
    s_awvalid : out   std_logic;                    -- '1': address there
    s_awready : in    std_logic;                    -- '1': address taken
    s_wvalid  : out   std_logic;                    -- '1': data there
    s_wready  : in    std_logic;                    -- '1': data taken
    s_bready  : out   std_logic;                    -- '1': response taken
    s_bvalid  : in    std_logic;                    -- '1': response there
    s_bresp   : in    std_logic_vector(1 downto 0)  -- "00": okay, "10": SLVERR
  );
end entity write_gate;

architecture rtl of write_gate is

  constant SLVERR : std_logic_vector(1 downto 0) := "10";

  signal under_way : std_logic; -- a write has been taken and not been answered
  signal refused   : std_logic; -- it was refused: the answer comes from here
  signal free      : std_logic; -- the write that is there may be taken
  signal pass      : std_logic; -- it goes to the registers
  signal stop      : std_logic; -- it is refused
  signal answered  : std_logic;

begin

  free <= m_awvalid and m_wvalid and not (hold or under_way);
  pass <= free and s_awready and s_wready and not refuse;
  stop <= free and refuse;

  m_awready <= pass or stop;
  m_wready  <= pass or stop;
  s_awvalid <= pass;
  s_wvalid  <= pass;
  passed    <= pass;

  answered <= refused or s_bvalid;
  m_bvalid <= answered;
  m_bresp  <= SLVERR when refused = '1' else
              s_bresp;
  s_bready <= m_bready and not refused;

  p_gate : process (clk) is
  begin

    if rising_edge(clk) then
      if (pass = '1' or stop = '1') then
        under_way <= '1';
        refused   <= stop;
      elsif (answered = '1' and m_bready = '1') then
        under_way <= '0';
        refused   <= '0';
      end if;

      if (rst = '1') then
        under_way <= '0';
        refused   <= '0';
      end if;
    end if;

  end process p_gate;

end architecture rtl;
