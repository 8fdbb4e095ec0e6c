-- mptc_pair_stream with vectors for its records and its signed ports.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.mptc_constants.all;
  use directmpc.mptc_types.all;

entity mptc_pair_stream_flat is
  port (
    clk             : in    std_logic;                                 -- rising edge
    rst             : in    std_logic;                                 -- synchronous, active high
    begin_pairs     : in    std_logic;                                 -- '1': the first pair follows
    last            : in    std_logic;                                 -- '1': the decision is there
    method          : in    std_logic_vector(2 downto 0);              -- family_t
    mean            : in    std_logic;                                 -- '1': duties by the mean torque
    both_duties     : in    std_logic;                                 -- '1': duties by the length too
    leader          : in    std_logic_vector(2 downto 0);              -- MPTC1's vector, unsigned
    level           : in    std_logic_vector(TERM_WIDTH - 1 downto 0); -- of state, signed
    along           : in    std_logic_vector(TERM_WIDTH - 1 downto 0); -- likewise
    across          : in    std_logic_vector(TERM_WIDTH - 1 downto 0); -- likewise
    opening         : in    std_logic_vector(TERM_WIDTH - 1 downto 0); -- likewise
    rotor_alpha     : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- likewise
    length_take     : in    std_logic;                                 -- of length, '1': the others are new
    length_place    : in    std_logic_vector(2 downto 0);              -- of length, unsigned
    length_error    : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- of length, signed
    product         : in    std_logic_vector(SUM_WIDTH - 1 downto 0);  -- torque error that a pair leaves, signed
    cheaper         : in    std_logic;                                 -- '1': what is compared is the cheapest so far
    found_take      : out   std_logic;                                 -- of found, '1': the others are new
    found_duty      : out   std_logic_vector(TIME_WIDTH - 1 downto 0); -- of found, 1/4096 of the period, unsigned
    found_second    : out   std_logic_vector(2 downto 0);              -- of found, number of a vector
    found_direction : out   std_logic_vector(2 downto 0);              -- likewise
    tried_enable    : out   std_logic;                                 -- of tried, '1': a pair's ways are there
    tried_take      : out   std_logic;                                 -- of tried, '1': tried_left is new
    tried_left      : out   std_logic_vector(TERM_WIDTH - 1 downto 0); -- of tried, torque term, signed
    tried_compare   : out   std_logic;                                 -- of tried, '1': a pair's cost is compared
    tried_rank      : out   std_logic_vector(5 downto 0);              -- of tried, first and second vector
    tried_best      : out   std_logic_vector(5 downto 0);              -- likewise
    chosen_u        : out   std_logic_vector(8 downto 0);              -- of chosen, u1, u2, u3; u1 on the right
    chosen_t1       : out   std_logic_vector(TIME_WIDTH downto 0);     -- of chosen, 1/4096 of the period, unsigned
    chosen_t2       : out   std_logic_vector(TIME_WIDTH downto 0)      -- likewise
  );
end entity mptc_pair_stream_flat;

architecture bench of mptc_pair_stream_flat is

  signal state  : mptc_state_t;
  signal length : mptc_length_t;
  signal found  : mptc_duty_t;
  signal tried  : mptc_tried_t;
  signal chosen : mptc_sequence_t;

begin

  state.stator_alpha <= (others => 'X');
  state.stator_beta  <= (others => 'X');
  state.step_alpha   <= (others => 'X');
  state.step_beta    <= (others => 'X');
  state.moment       <= (others => 'X');
  state.level        <= signed(level);
  state.along        <= signed(along);
  state.across       <= signed(across);
  state.opening      <= signed(opening);
  state.rotor_alpha  <= signed(rotor_alpha);

  length.take  <= length_take;
  length.place <= length_place;
  length.error <= signed(length_error);

  i_stream : entity directmpc.mptc_pair_stream
    port map (
      clk         => clk,
      rst         => rst,
      begin_pairs => begin_pairs,
      last        => last,
      method      => method,
      mean        => mean,
      both_duties => both_duties,
      leader      => leader,
      state       => state,
      length      => length,
      product     => signed(product),
      cheaper     => cheaper,
      found       => found,
      tried       => tried,
      chosen      => chosen
    );

  found_take      <= found.take;
  found_duty      <= found.duty;
  found_second    <= found.second;
  found_direction <= found.direction;

  tried_enable  <= tried.enable;
  tried_take    <= tried.take;
  tried_left    <= std_logic_vector(tried.left);
  tried_compare <= tried.compare;
  tried_rank    <= tried.rank;
  tried_best    <= tried.best;

  chosen_u  <= chosen.u3 & chosen.u2 & chosen.u1;
  chosen_t1 <= chosen.t1;
  chosen_t2 <= chosen.t2;

end architecture bench;
