-- Tables that a mac_sequencer follows, and an example of them.
--
-- A program has one row for every product.  A row holds five numbers:
--   0  clock in which the product is issued, counted from 0 in the clock after start
--   1  word of the mac_block's operand A
--   2  word of its operand B
--   3  steps of alignment, 0 to 3
--   4  number of the seed that the sum begins with, or GATHER: the product is added to the sum so far
-- Clocks of events stand in a second table.
-- Licence: Apache-2.0

package mac_programs is

  type mac_program_t is array (natural range <>, natural range <>) of integer;

  type mac_clocks_t is array (natural range <>) of natural;

  constant GATHER : integer := -1; -- in place of a seed: add to the sum so far

  -- two sums, one of two products; what mac_sequencer has by default and its bench runs
  constant EXAMPLE_PROGRAM : mac_program_t(0 to 2, 0 to 4) := (
    (0, 1, 0, 0, 1),
    (2, 2, 3, 2, 0),
    (3, 0, 1, 1, GATHER)
  );

  constant EXAMPLE_EVENTS : mac_clocks_t(0 to 1) := (3, 6); -- clocks in which the sums are complete

end package mac_programs;
