-- common_terms with its node as a vector, see mpdcc_flat.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library directmpc;
  use directmpc.directmpc_constants.all;
  use directmpc.mpdcc_types.all;
  use directmpc.second_level_types.all;

library work;
  use work.mpdcc_flat.all;

entity common_terms_flat is
  generic (
    FOLDED : boolean := true -- variant whose program runs
  );
  port (
    clk          : in    std_logic;                                                            -- rising edge
    rst          : in    std_logic; -- synchronous, active high
    start        : in    std_logic; -- '1' for one clock: begin
    signals      : in    std_logic_vector(SIGNAL_COUNT * OPERAND_WIDTH - 1 downto 0); -- operands A, OPERAND_* order
    speeds       : in    std_logic_vector(2 * COEFFICIENT_WIDTH - 1 downto 0);                 -- omega_s rightmost
    coefficients : in    std_logic_vector(COEFFICIENT_COUNT * COEFFICIENT_WIDTH - 1 downto 0); -- operands B
    issued       : out   std_logic; -- '1' for one clock: five clocks before done
    capacitors   : out   std_logic; -- '1' for one clock: capacitor terms are new with the next
    done         : out   std_logic; -- '1' for one clock: node is new
    node         : out   std_logic_vector(NODE_BITS - 1 downto 0);                             -- node_t
    saturated    : out   std_logic -- '1': a result saturated
  );
end entity common_terms_flat;

architecture bench of common_terms_flat is

  signal operands    : root_operands_t;
  signal progress    : terms_progress_t;
  signal node_record : node_t;

begin

  i_common_terms : entity directmpc.common_terms
    generic map (
      FOLDED => FOLDED
    )
    port map (
      clk          => clk,
      rst          => rst,
      start        => start,
      operands     => operands,
      coefficients => to_coefficients(coefficients),
      successor    => SUCCESSOR_NONE,
      progress     => progress,
      node         => node_record,
      words        => open,
      error_ahead  => open
    );

  operands.signals <= signals;
  operands.speeds  <= speeds;

  issued     <= progress.issued;
  capacitors <= progress.capacitors;
  done       <= progress.done;
  saturated  <= progress.saturated;

  node <= to_vector(node_record);

end architecture bench;
