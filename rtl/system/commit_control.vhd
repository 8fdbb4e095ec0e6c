-- Lets a set of shadow registers take effect together, never while a decision uses them.
--
-- A request is kept until load may be: when nothing decides, or in the clock in which a decision ends.  load
-- is up for one clock; the owner of the values in force takes all shadows over at its edge.  After a
-- reset a first load brings the shadows' reset values into force.
--
-- The clock of start belongs to the decision: shadows that were taken over at the same edge would meet
-- measurements that a host took for the old ones.
-- Formats: single bits; the count wraps.
-- Latency: load one clock after the request when nothing decides.
-- Overflow: requests that come while one waits are one with it.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity commit_control is
  port (
    clk     : in    std_logic;                    -- rising edge
    rst     : in    std_logic;                    -- synchronous, active high
    request : in    std_logic;                    -- '1' for one clock: commit
    start   : in    std_logic;                    -- '1': a decision begins
    busy    : in    std_logic;                    -- '1': a decision is under way
    ending  : in    std_logic;                    -- '1' for one clock: it ends, no start is possible
    load    : out   std_logic;                    -- '1' for one clock: take all shadows over
    at_rest : out   std_logic;                    -- '1': a request waits, no decision is under way
    pending : out   std_logic;                    -- '1': a request waits
    count   : out   std_logic_vector(15 downto 0) -- loads since the reset, unsigned
  );
end entity commit_control;

architecture rtl of commit_control is

  signal waiting : std_logic;
  signal now     : std_logic;
  signal loads   : unsigned(15 downto 0);

begin

  now <= waiting and (ending or not (busy or start));

  p_commit : process (clk) is
  begin

    if rising_edge(clk) then
      if (request = '1') then
        waiting <= '1';
      elsif (now = '1') then
        waiting <= '0';
      end if;

      if (now = '1') then
        loads <= loads + 1;
      end if;

      if (rst = '1') then
        waiting <= '1';
        loads   <= (others => '0');
      end if;
    end if;

  end process p_commit;

  load    <= now;
  at_rest <= waiting and not busy;
  pending <= waiting;
  count   <= std_logic_vector(loads);

end architecture rtl;
