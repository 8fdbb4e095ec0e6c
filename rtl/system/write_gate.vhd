-- Lets AXI4-Lite writes through one at a time, and none while hold is up.
--
-- The shadow registers have to stay as they are from the commit until it takes effect.  A write that follows
-- the commit is held back until then, and because no second write is ever under way, none can slip past.
-- Reads are not touched.
--
-- Formats: AXI4-Lite; address and data are taken in the same clock.
-- Latency: none; a write every second clock after its response at best.
-- Overflow: none.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity write_gate is
  port (
    clk       : in    std_logic; -- rising edge
    rst       : in    std_logic; -- synchronous, active high
    hold      : in    std_logic; -- '1': let no write begin
    -- from the master
    m_awvalid : in    std_logic; -- '1': address there
    m_awready : out   std_logic; -- '1': address taken
    m_wvalid  : in    std_logic; -- '1': data there
    m_wready  : out   std_logic; -- '1': data taken
    m_bready  : in    std_logic; -- '1': response taken
    -- to the registers
    s_awvalid : out   std_logic; -- '1': address there
    s_awready : in    std_logic; -- '1': address taken
    s_wvalid  : out   std_logic; -- '1': data there
    s_wready  : in    std_logic; -- '1': data taken
    s_bvalid  : in    std_logic  -- '1': response there
  );
end entity write_gate;

architecture rtl of write_gate is

  signal under_way : std_logic;
  signal pass      : std_logic;

begin

  pass <= m_awvalid and m_wvalid and s_awready and s_wready and not (hold or under_way);

  m_awready <= pass;
  m_wready  <= pass;
  s_awvalid <= pass;
  s_wvalid  <= pass;

  p_gate : process (clk) is
  begin

    if rising_edge(clk) then
      if (pass = '1') then
        under_way <= '1';
      elsif (s_bvalid = '1' and m_bready = '1') then
        under_way <= '0';
      end if;

      if (rst = '1') then
        under_way <= '0';
      end if;
    end if;

  end process p_gate;

end architecture rtl;
