-- node_shown with vectors for its records, see mpdcc_flat.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;

library work;
  use work.mpdcc_flat.all;

entity node_shown_flat is
  port (
    clk               : in    std_logic;                                             -- rising edge
    rst               : in    std_logic;                                             -- synchronous, active high
    follow            : in    std_logic;                                             -- '1': the root
    launch            : in    std_logic;                                             -- '1' for one clock: leaves begin
    node              : in    std_logic_vector(NODE_BITS - 1 downto 0);              -- node_t
    words             : in    std_logic_vector(RESULT_COUNT * TERM_WIDTH - 1 downto 0); -- RESULT_* order
    lead              : in    std_logic_vector(LENGTH_WIDTH - 1 downto 0);           -- L1
    saturated         : in    std_logic;                                             -- '1': a value saturated
    shown             : out   std_logic_vector(NODE_BITS - 1 downto 0);              -- node_t
    reached_second    : out   std_logic;                                             -- reached_t
    reached_lead      : out   std_logic_vector(LENGTH_WIDTH - 1 downto 0);           -- likewise
    reached_length    : out   std_logic_vector(LENGTH_WIDTH - 1 downto 0);           -- likewise
    reached_saturated : out   std_logic;                                             -- likewise
    show_slope        : out   std_logic;                                             -- '1': slopes are to change
    show_error        : out   std_logic                                              -- '1': errors are to change
  );
end entity node_shown_flat;

architecture bench of node_shown_flat is

  signal shown_record : node_t;
  signal reached      : reached_t;

begin

  i_shown : entity directmpc.node_shown
    port map (
      clk        => clk,
      rst        => rst,
      follow     => follow,
      launch     => launch,
      node       => to_node(node),
      words      => words,
      lead       => unsigned(lead),
      saturated  => saturated,
      shown      => shown_record,
      reached    => reached,
      show_slope => show_slope,
      show_error => show_error
    );

  shown             <= to_vector(shown_record);
  reached_second    <= reached.second;
  reached_lead      <= std_logic_vector(reached.lead);
  reached_length    <= std_logic_vector(reached.length);
  reached_saturated <= reached.saturated;

end architecture bench;
