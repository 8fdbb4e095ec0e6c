-- common_terms with successors, and its records as vectors, see mpdcc_flat.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;
  use directmpc.second_level_types.all;

library work;
  use work.mpdcc_flat.all;

entity successors_flat is
  port (
    clk          : in    std_logic;                                                            -- rising edge
    rst          : in    std_logic; -- synchronous, active high
    start        : in    std_logic; -- '1' for one clock: begin
    signals      : in    std_logic_vector(SIGNAL_COUNT * OPERAND_WIDTH - 1 downto 0); -- operands A, OPERAND_* order
    speeds       : in    std_logic_vector(2 * COEFFICIENT_WIDTH - 1 downto 0);                 -- omega_s rightmost
    coefficients : in    std_logic_vector(COEFFICIENT_COUNT * COEFFICIENT_WIDTH - 1 downto 0); -- operands B
    advance      : in    std_logic; -- '1' for one clock: begin with a successor
    lengths      : in    std_logic_vector(SIGNED_LENGTHS * (LENGTH_WIDTH + 1) - 1 downto 0); -- L1 and its signed forms
    base         : in    std_logic_vector(BASE_COUNT * OPERAND_WIDTH - 1 downto 0); -- operands A of a successor
    slope        : in    std_logic_vector(2 * TERM_WIDTH - 1 downto 0); -- its natural slope, alpha rightmost
    show_slope   : in    std_logic; -- '1': node.slope becomes the successor's
    show_error   : in    std_logic; -- '1': node.error becomes the successor's
    done         : out   std_logic; -- '1' for one clock: node is new
    saturated    : out   std_logic; -- '1': a result of the node saturated
    advanced     : out   std_logic; -- '1' for one clock: the successor is new
    overflowed   : out   std_logic; -- '1': one of its results saturated
    node         : out   std_logic_vector(NODE_BITS - 1 downto 0);          -- node_t
    words        : out   std_logic_vector(RESULT_COUNT * TERM_WIDTH - 1 downto 0) -- results, RESULT_* order
  );
end entity successors_flat;

architecture bench of successors_flat is

  signal operands    : root_operands_t;
  signal successor   : successor_t;
  signal progress    : terms_progress_t;
  signal node_record : node_t;

begin

  i_common_terms : entity directmpc.common_terms
    generic map (
      FOLDED       => false,
      SECOND_LEVEL => true
    )
    port map (
      clk          => clk,
      rst          => rst,
      start        => start,
      operands     => operands,
      coefficients => to_coefficients(coefficients),
      successor    => successor,
      progress     => progress,
      node         => node_record,
      words        => words,
      error_ahead  => open
    );

  operands.signals <= signals;
  operands.speeds  <= speeds;

  successor.advance    <= advance;
  successor.lengths    <= lengths;
  successor.base       <= base;
  successor.slope(0)   <= signed(slope(TERM_WIDTH - 1 downto 0));
  successor.slope(1)   <= signed(slope(2 * TERM_WIDTH - 1 downto TERM_WIDTH));
  successor.show_slope <= show_slope;
  successor.show_error <= show_error;

  done       <= progress.done;
  saturated  <= progress.saturated;
  advanced   <= progress.advanced;
  overflowed <= progress.overflowed;

  node <= to_vector(node_record);

end architecture bench;
