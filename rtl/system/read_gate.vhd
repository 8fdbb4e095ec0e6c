-- Lets AXI4-Lite reads through one at a time, and keeps their data until the master takes it.
--
-- The registers get rid of their data at once. So a master that does not take it, rready low, keeps no write waiting.
-- The recorder keeps its own data until it has been taken. It is added behind the register, where that costs least.
--
-- Formats: AXI4-Lite.
-- Latency: an address passes in its clock, data comes a clock later than the registers have it. A read every second
-- clock after the data of the one before at best.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity read_gate is
  port (
    clk       : in    std_logic;                     -- rising edge
    rst       : in    std_logic;                     -- synchronous, active high
    -- from the master
    m_arvalid : in    std_logic;                     -- '1': address there
    m_arready : out   std_logic;                     -- '1': address taken
    m_rready  : in    std_logic;                     -- '1': data taken
    m_rvalid  : out   std_logic;                     -- '1': data there
    m_rdata   : out   std_logic_vector(31 downto 0); -- data
    m_rresp   : out   std_logic_vector(1 downto 0);  -- "00": okay, "10": SLVERR
    -- to the registers, which take the address from the master
    s_arvalid : out   std_logic;                     -- '1': address there
    s_arready : in    std_logic;                     -- '1': address taken
    s_rready  : out   std_logic;                     -- '1': data taken
    s_rvalid  : in    std_logic;                     -- '1': data there
    s_rdata   : in    std_logic_vector(31 downto 0); -- data
    s_rresp   : in    std_logic_vector(1 downto 0);  -- "00": okay, "10": SLVERR
    -- data that stands until it is taken, and need not be kept here
    s_stands  : in    std_logic;                     -- '1': the answer that is there has its data in standing
    standing  : in    std_logic_vector(31 downto 0)  -- data; zero unless it is an answer's
  );
end entity read_gate;

architecture rtl of read_gate is

  type state_t is record
    under_way : std_logic; -- a read has been taken, and its data not
    there     : std_logic; -- its data is here
  end record state_t;

  constant STATE_INIT : state_t := (
    under_way => '0',
    there     => '0'
  );

  signal r    : state_t;
  signal data : std_logic_vector(31 downto 0);
  signal resp : std_logic_vector(1 downto 0);

begin

  m_arready <= s_arready and not r.under_way;
  s_arvalid <= m_arvalid and not r.under_way;
  s_rready  <= not r.there;

  m_rvalid <= r.there;
  m_rdata  <= data or standing;
  m_rresp  <= resp;

  p_gate : process (clk) is
  begin

    if rising_edge(clk) then
      if (r.there = '0' and s_rvalid = '1') then
        data <= s_rdata;
        resp <= s_rresp;

        if (s_stands = '1') then
          data <= (others => '0');
        end if;
      end if;

      if (r.under_way = '0') then
        r.under_way <= m_arvalid and s_arready;
      elsif (r.there = '0') then
        r.there <= s_rvalid;
      elsif (m_rready = '1') then
        r <= STATE_INIT;
      end if;

      if (rst = '1') then
        r <= STATE_INIT;
      end if;
    end if;

  end process p_gate;

end architecture rtl;
