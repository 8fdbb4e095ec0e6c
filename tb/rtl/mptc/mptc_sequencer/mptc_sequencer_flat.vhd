-- mptc_sequencer with vectors for its records; operands, seeds and results by their numbers in mptc_constants.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.mptc_constants.all;
  use directmpc.mptc_types.all;

entity mptc_sequencer_flat is
  generic (
    FLUX_CONTROL : boolean := true; -- true: MPFC can be chosen at run time
    FAMILY       : boolean := false -- true: methods of several vectors too
  );
  port (
    clk           : in    std_logic;                                               -- rising edge
    rst           : in    std_logic;                                               -- synchronous, active high
    start         : in    std_logic;                                               -- '1': decide
    method_mpfc   : in    std_logic;                                               -- '1': MPFC
    family_method : in    std_logic_vector(2 downto 0);                            -- family_t
    duty_rule     : in    std_logic_vector(1 downto 0);                            -- duty_rule_t
    accept        : out   std_logic;                                               -- '1': start is accepted
    mpfc          : out   std_logic;                                               -- '1': MPFC
    method        : out   std_logic_vector(2 downto 0);                            -- family_t
    mean          : out   std_logic;                                               -- '1': rule mean
    both_duties   : out   std_logic;                                               -- '1': rule best
    issue         : out   std_logic_vector(BLOCK_COUNT - 1 downto 0);              -- of products, block 0 rightmost
    gather        : out   std_logic_vector(BLOCK_COUNT - 1 downto 0);              -- likewise
    halve         : out   std_logic_vector(BLOCK_COUNT - 1 downto 0);              -- likewise
    lead          : out   std_logic_vector(BLOCK_COUNT - 1 downto 0);              -- likewise
    a             : out   std_logic_vector(8 * BLOCK_COUNT - 1 downto 0);          -- OPERAND_*, 8 bits for each block
    b             : out   std_logic_vector(8 * BLOCK_COUNT - 1 downto 0);          -- likewise
    seed          : out   std_logic_vector(8 * BLOCK_COUNT - 1 downto 0);          -- SEED_*, 8 bits for each block
    words         : out   std_logic_vector(16 * BLOCK_COUNT - 1 downto 0);         -- bit RESULT_* of 16 for each block
    terms         : out   std_logic_vector(16 * BLOCK_COUNT - 1 downto 0);         -- bit TERM_* of 16 for each block
    normalise     : out   std_logic;                                               -- of events
    orient        : out   std_logic;                                               -- of events
    square        : out   std_logic;                                               -- of events
    radicand      : out   std_logic;                                               -- of events
    begin_stream  : out   std_logic;                                               -- of events
    begin_pairs   : out   std_logic;                                               -- of events
    way_alpha     : out   std_logic;                                               -- of events
    way_beta      : out   std_logic;                                               -- of events
    rest          : out   std_logic;                                               -- of events
    last          : out   std_logic;                                               -- of events
    valid         : out   std_logic;                                               -- '1': the decision is new
    busy          : out   std_logic                                                -- '1': a decision is under way
  );
end entity mptc_sequencer_flat;

architecture bench of mptc_sequencer_flat is

  signal products : mptc_products_t;
  signal events   : mptc_events_t;

  -- place in a list; any that there is where the choice has none
  function place (choice : select_t; count : positive) return natural is
  begin

    if (is_x(choice)) then
      return 0;
    else
      return to_integer(unsigned(choice)) mod count;
    end if;

  end function place;

  function byte_of (value : natural) return std_logic_vector is
  begin

    return std_logic_vector(to_unsigned(value, 8));

  end function byte_of;

begin

  i_sequencer : entity directmpc.mptc_sequencer
    generic map (
      FLUX_CONTROL => FLUX_CONTROL,
      FAMILY       => FAMILY
    )
    port map (
      clk           => clk,
      rst           => rst,
      start         => start,
      method_mpfc   => method_mpfc,
      family_method => family_method,
      duty_rule     => duty_rule,
      accept        => accept,
      mpfc          => mpfc,
      method        => method,
      mean          => mean,
      both_duties   => both_duties,
      products      => products,
      events        => events,
      valid         => valid,
      busy          => busy
    );

  g_blocks : for n in 0 to BLOCK_COUNT - 1 generate
    issue(n)  <= products.issue(n);
    gather(n) <= products.gather(n);
    halve(n)  <= products.halve(n);
    lead(n)   <= products.lead(n);

    a(8 * n + 7 downto 8 * n)    <= byte_of(A_LISTS(n, place(products.a_choice(n), A_LISTS'length(2))));
    b(8 * n + 7 downto 8 * n)    <= byte_of(B_LISTS(n, place(products.b_choice(n), B_LISTS'length(2))));
    seed(8 * n + 7 downto 8 * n) <= byte_of(SEED_LISTS(n, place(products.seed_choice(n), SEED_LISTS'length(2))));
  end generate g_blocks;

  p_writes : process (events.word_writes, events.term_writes) is
  begin

    words <= (others => '0');
    terms <= (others => '0');

    for i in WORD_WRITES'range(1) loop
      if (events.word_writes(i) /= '0') then
        words(16 * WORD_WRITES(i, 1) + WORD_WRITES(i, 2)) <= events.word_writes(i);
      end if;
    end loop;

    for i in TERM_WRITES'range(1) loop
      if (events.term_writes(i) /= '0') then
        terms(16 * TERM_WRITES(i, 1) + TERM_WRITES(i, 2)) <= events.term_writes(i);
      end if;
    end loop;

  end process p_writes;

  normalise    <= events.normalise;
  orient       <= events.orient;
  square       <= events.square;
  radicand     <= events.radicand;
  begin_stream <= events.begin_stream;
  begin_pairs  <= events.begin_pairs;
  way_alpha    <= events.way_alpha;
  way_beta     <= events.way_beta;
  rest         <= events.rest;
  last         <= events.last;

end architecture bench;
