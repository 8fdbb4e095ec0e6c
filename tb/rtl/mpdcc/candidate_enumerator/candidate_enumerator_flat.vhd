-- candidate_enumerator with its records as vectors, see mpdcc_flat.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library directmpc;
  use directmpc.mpdcc_types.all;

library work;
  use work.mpdcc_flat.all;

entity candidate_enumerator_flat is
  generic (
    BLOCKS : boolean := false -- phases a and b only
  );
  port (
    clk       : in    std_logic;                                     -- rising edge
    rst       : in    std_logic;                                     -- synchronous, active high
    start     : in    std_logic;                                     -- '1' for one clock: begin
    previous  : in    std_logic_vector(8 downto 0);                  -- s(k-1), phase a rightmost
    negative  : in    std_logic_vector(2 downto 0);                  -- '1': phase current is negative
    valid     : out   std_logic;                                     -- '1': candidate is new
    ready     : in    std_logic;                                     -- '1': candidate is taken in this clock
    candidate : out   std_logic_vector(CANDIDATE_BITS - 1 downto 0); -- candidate_t
    done      : out   std_logic                                      -- '1': every candidate has been taken
  );
end entity candidate_enumerator_flat;

architecture bench of candidate_enumerator_flat is

  signal candidate_record : candidate_t;

begin

  i_enumerator : entity directmpc.candidate_enumerator
    generic map (
      BLOCKS => BLOCKS
    )
    port map (
      clk       => clk,
      rst       => rst,
      start     => start,
      previous  => to_positions(previous),
      negative  => negative,
      valid     => valid,
      ready     => ready,
      candidate => candidate_record,
      done      => done
    );

  candidate <= to_vector(candidate_record);

end architecture bench;
