-- capacitor_search with its records as vectors, see mpdcc_flat.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library directmpc;
  use directmpc.mpdcc_types.all;

library work;
  use work.mpdcc_flat.all;

entity capacitor_search_flat is
  generic (
    SECOND_LEVEL : boolean := false; -- true: successors built in
    INWARDS      : boolean := false  -- true: the rule inwards built in
  );
  port (
    clk      : in    std_logic;                                  -- rising edge
    rst      : in    std_logic;                                  -- synchronous, active high
    start    : in    std_logic;                                  -- '1' for one clock: begin
    limits   : in    std_logic_vector(LIMITS_BITS - 1 downto 0); -- limits_t
    node     : in    std_logic_vector(NODE_BITS - 1 downto 0);   -- node_t
    previous : in    std_logic_vector(8 downto 0);               -- s(k-1), phase a rightmost
    successor : in    std_logic;                                 -- with start: '1': of a successor
    bank      : in    std_logic;                                 -- with start: which table
    held      : out   std_logic;                                 -- '1': the lines of s(k-1) are inside at k+1
    ready     : out   std_logic;                                 -- '1': the last row is out 5 clocks later
    entry     : out   std_logic_vector(CAPACITOR_BITS - 1 downto 0); -- capacitor_t, but for
    of_bank   : out   std_logic; -- its bank
    is_inside : out   std_logic  -- '1': it is inside at k
  );
end entity capacitor_search_flat;

architecture bench of capacitor_search_flat is

  signal entry_record : capacitor_t;

begin

  i_capacitors : entity directmpc.capacitor_search
    generic map (
      SECOND_LEVEL => SECOND_LEVEL,
      INWARDS      => INWARDS
    )
    port map (
      clk      => clk,
      rst      => rst,
      start    => start,
      limits   => to_limits(limits),
      node     => to_node(node),
      previous => to_positions(previous),
      successor => successor,
      bank     => bank,
      held     => held,
      ready    => ready,
      entry    => entry_record
    );

  entry     <= to_vector(entry_record);
  of_bank   <= entry_record.bank;
  is_inside <= entry_record.is_inside;

end architecture bench;
