-- mptc_choices with vectors for its records, its counter and its signed ports.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.mptc_constants.all;
  use directmpc.mptc_types.all;

entity mptc_choices_flat is
  port (
    clk             : in    std_logic;                                    -- rising edge
    clock           : in    std_logic_vector(5 downto 0);                 -- clocks since e was taken, unsigned
    method          : in    std_logic_vector(2 downto 0);                 -- family_t
    row             : in    std_logic_vector(2 downto 0);                 -- first vector, unsigned
    idle            : in    std_logic;                                    -- '1': that is a zero vector
    leader          : in    std_logic_vector(2 downto 0);                 -- leading vector, unsigned
    ended           : in    std_logic_vector(2 downto 0);                 -- vector that is applied last, unsigned
    g               : in    std_logic_vector(HEXAGON_WIDTH - 1 downto 0); -- of missing, signed
    h               : in    std_logic_vector(HEXAGON_WIDTH - 1 downto 0); -- likewise
    total           : in    std_logic_vector(HEXAGON_WIDTH - 1 downto 0); -- likewise
    sum             : in    std_logic_vector(SUM_WIDTH - 1 downto 0);     -- square of a distance, signed
    residues_along  : out   std_logic_vector(WORD_WIDTH - 1 downto 0);    -- of residues, signed
    residues_beside : out   std_logic_vector(WORD_WIDTH - 1 downto 0);    -- likewise
    residues_total  : out   std_logic_vector(WORD_WIDTH - 1 downto 0);    -- likewise
    best_number     : out   std_logic_vector(2 downto 0);                 -- of best, unsigned
    best_other      : out   std_logic_vector(2 downto 0);                 -- of best, number of a vector
    best_beside     : out   std_logic;                                    -- of best, '1': a neighbour
    best_fewer      : out   std_logic;                                    -- of best, '1': fewer commutations
    best_part       : out   std_logic_vector(TIME_WIDTH downto 0);        -- of best, 1/4096 of the period, unsigned
    best_kind       : out   std_logic_vector(1 downto 0)                  -- of best, kind_t
  );
end entity mptc_choices_flat;

architecture bench of mptc_choices_flat is

  signal counted  : natural range 0 to HEXAGON_CLOCKS;
  signal missing  : mptc_missing_t;
  signal residues : mptc_residues_t;
  signal best     : mptc_choice_t;

begin

  counted <= to_integer(unsigned(clock));

  missing.g     <= signed(g);
  missing.h     <= signed(h);
  missing.total <= signed(total);

  i_choices : entity directmpc.mptc_choices
    port map (
      clk      => clk,
      clock    => counted,
      method   => method,
      row      => row,
      idle     => idle,
      leader   => leader,
      ended    => ended,
      missing  => missing,
      sum      => signed(sum),
      residues => residues,
      best     => best
    );

  residues_along  <= residues.along;
  residues_beside <= residues.beside;
  residues_total  <= residues.total;

  best_number <= best.number;
  best_other  <= best.other;
  best_beside <= best.beside;
  best_fewer  <= best.fewer;
  best_part   <= best.part;
  best_kind   <= best.kind;

end architecture bench;
