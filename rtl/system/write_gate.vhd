-- Lets AXI4-Lite writes through one at a time, keeps their responses, and answers those that are refused itself.
--
-- A write is refused where refuse is up in the clock in which both its address and its data are there: it is
-- taken, nothing reaches the registers, and its response is SLVERR. No write is kept waiting but by hold, which
-- its owner raises for a few clocks at most.
--
-- The registers get rid of a response at once. So a master that does not take it, bready low, keeps no read waiting.
--
-- Formats: AXI4-Lite; address and data are taken in the same clock, so a master offers both.
-- Latency: none for a write that passes, and a clock for its response; a refused one has its response in the next
-- clock. A write every second clock after its response at best.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
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

  type state_t is record
    under_way : std_logic;                    -- a write has been taken, and its response not
    answered  : std_logic;                    -- its response is here
    resp      : std_logic_vector(1 downto 0); -- what it is
  end record state_t;

  constant STATE_INIT : state_t := (
    under_way => '0',
    answered  => '0',
    resp      => "00"
  );

  signal r    : state_t;
  signal free : std_logic; -- the write that is there may be taken
  signal pass : std_logic; -- it goes to the registers
  signal stop : std_logic; -- it is refused

begin

  free <= m_awvalid and m_wvalid and not (hold or r.under_way);
  pass <= free and s_awready and s_wready and not refuse;
  stop <= free and refuse;

  m_awready <= pass or stop;
  m_wready  <= pass or stop;
  s_awvalid <= pass;
  s_wvalid  <= pass;
  passed    <= pass;

  s_bready <= not r.answered;
  m_bvalid <= r.answered;
  m_bresp  <= r.resp;

  p_gate : process (clk) is
  begin

    if rising_edge(clk) then
      if (r.under_way = '0') then
        r.under_way <= pass or stop;
        r.answered  <= stop;
        r.resp      <= SLVERR;
      elsif (r.answered = '0') then
        r.answered <= s_bvalid;
        r.resp     <= s_bresp;
      elsif (m_bready = '1') then
        r <= STATE_INIT;
      end if;

      if (rst = '1') then
        r <= STATE_INIT;
      end if;
    end if;

  end process p_gate;

end architecture rtl;
