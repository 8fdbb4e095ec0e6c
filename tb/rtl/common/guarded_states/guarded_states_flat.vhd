-- The functions of guarded_states as outputs of an entity, each without a clock.
--
-- The state reaches them in a range that does not end at 0: what they return must not depend on it.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.guarded_states.all;

entity guarded_states_flat is
  generic (
    WIDTH     : positive := 30; -- bits of a state
    GUARD     : natural  := 12; -- guard bits of a state
    SUM_WIDTH : positive := 48; -- bits of a sum, at least WIDTH + SHIFT
    SHIFT     : positive := 13; -- bits of a sum that are cut off
    WORDS     : positive := 5   -- words to choose from
  );
  port (
    value      : in    std_logic_vector(WIDTH - 1 downto 0);             -- state, two's complement
    origin     : in    std_logic_vector(WIDTH - 1 downto 0);             -- state before, two's complement
    candidates : in    std_logic_vector(WORDS * SUM_WIDTH - 1 downto 0); -- words, word 0 rightmost
    choice     : in    std_logic_vector(WORDS - 1 downto 0);             -- '1': take this word
    coarse_out : out   std_logic_vector(WIDTH - GUARD - 1 downto 0);     -- state without guard bits
    round_out  : out   std_logic_vector(WIDTH - GUARD - 1 downto 0);     -- state, GUARD + 1 bits rounded off
    half_out   : out   std_logic_vector(WIDTH - GUARD - 1 downto 0);     -- half of what it has moved
    seed_out   : out   std_logic_vector(SUM_WIDTH - 1 downto 0);         -- state as first summand
    lsb_out    : out   std_logic_vector(SUM_WIDTH - 1 downto 0);         -- half an LSB as first summand
    chosen_out : out   std_logic_vector(SUM_WIDTH - 1 downto 0)          -- word that is chosen
  );
end entity guarded_states_flat;

architecture bench of guarded_states_flat is

  signal state   : signed(WIDTH + 2 downto 3);
  signal earlier : signed(WIDTH + 4 downto 5);

begin

  state   <= signed(value);
  earlier <= signed(origin);

  coarse_out <= coarse(state, GUARD);
  round_out  <= std_logic_vector(rounded(state, GUARD + 1));
  half_out   <= half_of(state, earlier, GUARD);
  seed_out   <= seed_of(state, SUM_WIDTH, SHIFT);
  lsb_out    <= half_lsb(SUM_WIDTH, SHIFT);
  chosen_out <= chosen_word(candidates, choice);

end architecture bench;
