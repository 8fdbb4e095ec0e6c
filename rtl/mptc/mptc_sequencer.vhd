-- Sequencer of the MPTC and MPFC: counts the clocks of a decision and reads the program for each.
--
-- The program stands in mptc_constants; model/directmpc/mptc/program.py explains and checks it.  MPTC and MPFC share
-- the clocks before FORK.  From FORK on, MPFC has addresses of its own, beginning with FORK_ADDRESS.  MPTC1, MPTC2 and
-- GTV go MPTC's way to its end and on from PAIR_ADDRESS, MPTC1 a clock ahead of the others where its products want it.
-- MPFC2, MPFC3, MPC2 and SVM go MPFC's way up to HEXAGON_FORK
-- and on from HEXAGON_ADDRESS.
--
-- With FLUX_CONTROL the program is read a clock ahead, and products come from registers.  Reading and choosing among
-- the longer lists of MPFC in one clock ends at 95 to 105 MHz on ECP5, five seeds; this way it is 107 at least.
-- With FAMILY the program is a table in block RAM, with events in it.  What is due in a clock is addressed two clocks
-- before, for the register of the memory and one behind it.  So address is that of the next clock then, and the clock
-- that accepts start asks for clock 1: operands of clock 0 stand in the word of an idle sequencer, without their issue.
--
-- Formats: places as in the lists of mptc_constants.
-- Latency: products and events of clock n of the program come n clocks after the edge that accepts start.  valid
-- follows it by as many clocks of the program as the method's LAST_ says.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;

entity mptc_sequencer is
  generic (
    FLUX_CONTROL : boolean := true; -- true: MPFC can be chosen at run time
    FAMILY       : boolean := false -- true: methods of several vectors too; needs FLUX_CONTROL
  );
  port (
    clk         : in    std_logic;       -- rising edge
    rst         : in    std_logic;       -- synchronous, active high
    start       : in    std_logic;       -- '1' for one clock: decide; ignored while busy
    method_mpfc : in    std_logic;       -- '1': MPFC, '0': MPTC; sampled with start
    family_method : in    family_t;       -- method of several vectors, goes before method_mpfc; sampled with start
    duty_rule   : in    duty_rule_t;     -- FAMILY: how MPTC1 and MPTC2 find a duty; sampled with start
    accept      : out   std_logic;       -- '1': start is accepted with the next edge
    mpfc        : out   std_logic;       -- '1': the decision under way is MPFC's
    method      : out   family_t;        -- method of several vectors of the decision under way
    mean        : out   std_logic;       -- '1': its duties are those by the mean torque
    both_duties : out   std_logic;       -- '1': the cheaper one of a duty by the torque and one by the flux's length
    products    : out   mptc_products_t; -- what the mac_blocks begin
    events      : out   mptc_events_t;   -- what is due
    valid       : out   std_logic;       -- '1' for one clock: the decision is new
    busy        : out   std_logic        -- '1': a decision is under way
  );
end entity mptc_sequencer;

architecture rtl of mptc_sequencer is

  -- bits of an address: every one of the program, and one for an idle sequencer
  constant ADDRESS_BITS : positive := selector_width(choose(FAMILY, ADDRESS_COUNT_FAMILY, ADDRESS_COUNT) + 1);
  constant ADDRESSES    : natural  := counted(FLUX_CONTROL, ADDRESS_COUNT, LAST_MPTC + 1); -- without FAMILY
  constant PARKED_BITS  : positive := selector_width(choose(FAMILY, ADDRESS_COUNT_FAMILY, ADDRESSES) + 1);
  constant PARKED       : natural  := 2 ** PARKED_BITS - 1; -- address of an idle sequencer
  constant STEPS_SINGLE : natural  := counted(FLUX_CONTROL, STEP_COUNT_SINGLE, STEP_COUNT_MPTC);
  constant STEPS        : natural  := choose(FAMILY, STEP_COUNT, STEPS_SINGLE);
  constant WORD_EVENTS  : natural  := counted(FLUX_CONTROL, WORD_WRITES'length(1), WORD_WRITES_MPTC);
  constant TERM_SINGLE  : natural  := counted(FLUX_CONTROL, TERM_WRITES_SINGLE, TERM_WRITES_MPTC);
  constant TERM_EVENTS  : natural  := choose(FAMILY, TERM_WRITES'length(1), TERM_SINGLE);

  signal active  : std_logic;
  signal address : natural range 0 to 2 ** ADDRESS_BITS - 1; -- of this clock, with FAMILY of the next one
  signal turned  : std_logic; -- the method is MPFC
  signal chosen  : family_t;  -- method of several vectors
  signal ruled   : std_logic; -- '1': it has a duty rule
  signal both    : std_logic; -- '1': the rule is best
  signal rooted  : std_logic; -- '1': the rule is mean
  signal ends    : std_logic;       -- '1': the next clock is the last one
  signal ending  : std_logic;       -- '1': this is the last clock
  signal following : natural range 0 to 2 ** ADDRESS_BITS - 1; -- FAMILY: address of the clock after the next one

  -- a place as bits; zero for what is no place
  function bits_of (index : integer) return select_t is
  begin

    if (index < 0) then
      return (others => '0');
    else
      return std_logic_vector(to_unsigned(index, select_t'length));
    end if;

  end function bits_of;

begin

  assert FLUX_CONTROL or not FAMILY
    report "mptc_sequencer: FAMILY needs FLUX_CONTROL"
    severity failure;

  g_sequence : if not FAMILY generate

    p_sequence : process (clk) is
    begin

      if rising_edge(clk) then
        valid <= '0';

        if (active = '1') then
          if (ending = '1') then
            active  <= '0';
            valid   <= '1';
            address <= PARKED;
          elsif (FLUX_CONTROL and turned = '1' and address = FORK_CLOCK - 1) then
            address <= FORK_ADDRESS;
          else
            address <= (address + 1) mod 2 ** ADDRESS_BITS;
          end if;
        elsif (start = '1') then
          active  <= '1';
          address <= 0;
        end if;

        if (rst = '1') then
          active  <= '0';
          address <= PARKED;
          valid   <= '0';
        end if;
      end if;

    end process p_sequence;

  end generate g_sequence;

  g_sequence_ahead : if FAMILY generate

    p_following : process (rst, active, start, ending, address, turned, chosen) is
    begin

      following <= (address + 1) mod 2 ** ADDRESS_BITS;

      if (turned = '1' and address = FORK_CLOCK - 1) then
        following <= FORK_ADDRESS;
      elsif (address = LAST_MPTC) then
        following <= PAIR_ADDRESS;

        if (chosen = FAMILY_MPTC1) then
          following <= PAIR_ADDRESS + MPTC1_LEAD;
        end if;
      elsif (chosen(2) = '1' and address = HEXAGON_FORK - 1) then
        following <= HEXAGON_ADDRESS;
      end if;

      if (active = '0' and start = '1') then
        following <= 1;
      end if;

      if (rst = '1' or ending = '1' or (active = '0' and start = '0')) then
        following <= PARKED;
      end if;

    end process p_following;

    p_sequence : process (clk) is
    begin

      if rising_edge(clk) then
        valid   <= ending and not rst;
        address <= following;

        if (start = '1') then
          active <= '1';
        end if;

        if (rst = '1' or ending = '1') then
          active <= '0';
        end if;
      end if;

    end process p_sequence;

  end generate g_sequence_ahead;

  g_ending : if not FAMILY generate
    ending <= to_std_logic(address = LAST_MPTC - 1 or (FLUX_CONTROL and address = LAST_MPFC - 1));
  end generate g_ending;

  g_ending_family : if FAMILY generate

    ends <= to_std_logic((address = LAST_MPTC - 1 and chosen = FAMILY_NONE) or address = LAST_MPFC - 1
                         or address = LAST_HEXAGON - 1
                         or (address = LAST_MPTC1 - 1 and chosen = FAMILY_MPTC1 and both = '0')
                         or (address = LAST_MPTC1_BEST - 1 and chosen = FAMILY_MPTC1)
                         or (address = LAST_MPTC2 - 1 and chosen = FAMILY_MPTC2 and both = '0')
                         or address = LAST_MPTC2_BEST - 1
                         or (address = LAST_GTV - 1 and chosen = FAMILY_GTV));

    p_ending : process (clk) is
    begin

      if rising_edge(clk) then
        ending <= ends and not rst;
      end if;

    end process p_ending;

  end generate g_ending_family;

  busy   <= active;
  accept <= start and not active;
  mpfc   <= turned;
  method <= chosen;

  mean        <= rooted;
  both_duties <= both;

  g_method : if FLUX_CONTROL generate

    p_method : process (clk) is
    begin

      if rising_edge(clk) then
        if (active = '0' and start = '1') then
          turned <= method_mpfc;

          if (FAMILY and family_method /= FAMILY_NONE) then
            turned <= family_method(2);
          end if;
        end if;
      end if;

    end process p_method;

  end generate g_method;

  g_family : if FAMILY generate

    ruled <= to_std_logic(family_method = FAMILY_MPTC1 or family_method = FAMILY_MPTC2);

    p_chosen : process (clk) is
    begin

      if rising_edge(clk) then
        if (active = '0' and start = '1') then
          chosen <= family_method;
          rooted <= ruled and to_std_logic(duty_rule = RULE_MEAN);
          both   <= ruled and duty_rule(1);
        end if;
      end if;

    end process p_chosen;

  end generate g_family;

  g_one_vector : if not FAMILY generate
    chosen <= FAMILY_NONE;
    rooted <= '0';
    both   <= '0';
  end generate g_one_vector;

  g_one_method : if not FLUX_CONTROL generate
    turned <= '0';
  end generate g_one_method;

  ---------------------------------------------------------------------------------------------
  -- Products
  ---------------------------------------------------------------------------------------------

  g_decode : if not FAMILY generate

    signal decoded : mptc_products_t;

  begin

    p_decode : process (address, active, start, turned) is

      variable due    : boolean;
      variable issued : mptc_products_t;

    begin

      issued.issue       := (others => '0');
      issued.gather      := (others => '0');
      issued.halve       := (others => '0');
      issued.lead        := (others => '0');
      issued.a_choice    := (others => (others => '0'));
      issued.b_choice    := (others => (others => '0'));
      issued.seed_choice := (others => (others => '0'));

      for i in 0 to STEPS - 1 loop
        if (not FLUX_CONTROL) then
          due := address = MPTC_PROGRAM(i, 0);
        elsif (MPTC_PROGRAM(i, 0) = 0) then
          due := start = '1' and active = '0';
        elsif (MPTC_PROGRAM(i, 0) = FORK_CLOCK) then
          due := address = FORK_CLOCK - 1 and turned = '0';
        elsif (MPTC_PROGRAM(i, 0) = FORK_ADDRESS) then
          due := address = FORK_CLOCK - 1 and turned = '1';
        else
          due := address = MPTC_PROGRAM(i, 0) - 1;
        end if;

        for n in 0 to BLOCK_COUNT - 1 loop
          if (due and MPTC_PROGRAM(i, 1) = n) then
            issued.issue(n)       := '1';
            issued.gather(n)      := issued.gather(n) or to_std_logic(MPTC_PROGRAM(i, 4) < 0);
            issued.halve(n)       := issued.halve(n) or to_std_logic(MPTC_PROGRAM(i, 5) > 0);
            issued.lead(n)        := issued.lead(n) or to_std_logic(MPTC_PROGRAM(i, 5) > 1);
            issued.a_choice(n)    := issued.a_choice(n) or bits_of(MPTC_PROGRAM(i, 2));
            issued.b_choice(n)    := issued.b_choice(n) or bits_of(MPTC_PROGRAM(i, 3));
            issued.seed_choice(n) := issued.seed_choice(n) or bits_of(MPTC_PROGRAM(i, 4));
          end if;
        end loop;
      end loop;

      decoded <= issued;

    end process p_decode;

    g_ahead : if FLUX_CONTROL generate

      p_ahead : process (clk) is
      begin

        if rising_edge(clk) then
          products <= decoded;
        end if;

      end process p_ahead;

    end generate g_ahead;

    g_at_once : if not FLUX_CONTROL generate
      products <= decoded;
    end generate g_at_once;

  end generate g_decode;

  ---------------------------------------------------------------------------------------------
  -- Events
  ---------------------------------------------------------------------------------------------

  g_events_at_once : if not FAMILY generate

    p_events : process (address, ending) is
    begin

      events.word_writes  <= (others => '0');
      events.term_writes  <= (others => '0');
      events.normalise    <= '0';
      events.orient       <= '0';
      events.square       <= '0';
      events.radicand     <= '0';
      events.begin_stream <= to_std_logic(address = FIRST_LENGTH - 1);
      events.begin_pairs  <= '0';
      events.way_alpha    <= '0';
      events.way_beta     <= '0';
      events.rest         <= '0';
      events.last         <= ending;

      for i in 0 to WORD_EVENTS - 1 loop
        events.word_writes(i) <= to_std_logic(address = WORD_WRITES(i, 0));
      end loop;

      for i in 0 to TERM_EVENTS - 1 loop
        events.term_writes(i) <= to_std_logic(address = TERM_WRITES(i, 0));
      end loop;

      if (FLUX_CONTROL) then
        events.normalise    <= to_std_logic(address >= FIRST_NORMALISE and address < FIRST_NORMALISE + NORMALISE_STEPS);
        events.orient       <= to_std_logic(address = FIRST_NORMALISE + NORMALISE_STEPS);
        events.square       <= to_std_logic(address = FIRST_ROOT);
        events.radicand     <= to_std_logic(address = FIRST_ROOT + 1);
        events.begin_stream <= to_std_logic(address = FIRST_LENGTH - 1 or address = FIRST_STREAM_MPFC - 1);
      end if;

    end process p_events;

  end generate g_events_at_once;

  ---------------------------------------------------------------------------------------------
  -- Both as a table
  ---------------------------------------------------------------------------------------------

  g_table : if FAMILY generate

    constant A_BITS     : positive := selector_width(A_LISTS'length(2));
    constant B_BITS     : positive := selector_width(B_LISTS'length(2));
    constant SEED_BITS  : positive := selector_width(SEED_LISTS'length(2));
    constant BLOCK_BITS : positive := 4 + A_BITS + B_BITS + SEED_BITS; -- of what a mac_block begins

    -- places of events in a word, behind the blocks
    constant AT_WORDS     : natural  := BLOCK_COUNT * BLOCK_BITS;
    constant AT_TERMS     : natural  := AT_WORDS + WORD_EVENTS;
    constant AT_NORMALISE : natural  := AT_TERMS + TERM_EVENTS;
    constant AT_ORIENT    : natural  := AT_NORMALISE + 1;
    constant AT_SQUARE    : natural  := AT_ORIENT + 1;
    constant AT_RADICAND  : natural  := AT_SQUARE + 1;
    constant AT_STREAM    : natural  := AT_RADICAND + 1;
    constant AT_WAY_ALPHA : natural  := AT_STREAM + 1;
    constant AT_WAY_BETA  : natural  := AT_WAY_ALPHA + 1;
    constant AT_REST      : natural  := AT_WAY_BETA + 1;
    constant ENTRY_BITS   : positive := AT_REST + 1;

    subtype entry_t is std_logic_vector(ENTRY_BITS - 1 downto 0);

    subtype table_t is std_logic_vector(2 ** ADDRESS_BITS * ENTRY_BITS - 1 downto 0);

    -- a place with zeros in front
    function padded (bits : std_logic_vector) return select_t is
    begin

      return std_logic_vector(resize(unsigned(bits), select_t'length));

    end function padded;

    -- the program, word 0 rightmost
    function all_entries return table_t is

      variable result : table_t;
      variable base   : natural;

    begin

      result := (others => '0');

      for i in 0 to STEPS - 1 loop
        base := MPTC_PROGRAM(i, 0) * ENTRY_BITS;

        -- operands of clock 0 are those of an idle sequencer
        if (MPTC_PROGRAM(i, 0) = 0) then
          base := PARKED * ENTRY_BITS;
        end if;

        base             := base + MPTC_PROGRAM(i, 1) * BLOCK_BITS;
        result(base)     := to_std_logic(MPTC_PROGRAM(i, 0) /= 0);
        result(base + 1) := to_std_logic(MPTC_PROGRAM(i, 4) < 0);
        result(base + 2) := to_std_logic(MPTC_PROGRAM(i, 5) > 0);
        result(base + 3) := to_std_logic(MPTC_PROGRAM(i, 5) > 1);
        base             := base + 4;

        result(base + A_BITS - 1 downto base) := bits_of(MPTC_PROGRAM(i, 2))(A_BITS - 1 downto 0);
        base                                  := base + A_BITS;
        result(base + B_BITS - 1 downto base) := bits_of(MPTC_PROGRAM(i, 3))(B_BITS - 1 downto 0);
        base                                  := base + B_BITS;

        result(base + SEED_BITS - 1 downto base) := bits_of(MPTC_PROGRAM(i, 4))(SEED_BITS - 1 downto 0);
      end loop;

      for i in 0 to WORD_EVENTS - 1 loop
        result(WORD_WRITES(i, 0) * ENTRY_BITS + AT_WORDS + i) := '1';
      end loop;

      for i in 0 to TERM_EVENTS - 1 loop
        result(TERM_WRITES(i, 0) * ENTRY_BITS + AT_TERMS + i) := '1';
      end loop;

      for i in FIRST_NORMALISE to FIRST_NORMALISE + NORMALISE_STEPS - 1 loop
        result(i * ENTRY_BITS + AT_NORMALISE) := '1';
      end loop;

      result((FIRST_NORMALISE + NORMALISE_STEPS) * ENTRY_BITS + AT_ORIENT) := '1';
      result(FIRST_ROOT * ENTRY_BITS + AT_SQUARE)                          := '1';
      result((FIRST_ROOT + 1) * ENTRY_BITS + AT_RADICAND)                  := '1';
      result((FIRST_LENGTH - 1) * ENTRY_BITS + AT_STREAM)                  := '1';
      result((FIRST_STREAM_MPFC - 1) * ENTRY_BITS + AT_STREAM)             := '1';
      result(FIRST_WAY * ENTRY_BITS + AT_WAY_ALPHA)                        := '1';
      result((FIRST_WAY + 1) * ENTRY_BITS + AT_WAY_BETA)                   := '1';
      result(FIRST_REST * ENTRY_BITS + AT_REST)                            := '1';

      return result;

    end function all_entries;

    constant ENTRIES : table_t := all_entries;

    signal entry_at : std_logic_vector(ADDRESS_BITS - 1 downto 0);
    signal entry    : entry_t; -- of the next clock

  begin

    entry_at <= std_logic_vector(to_unsigned(following, ADDRESS_BITS));

    i_table : entity work.ram
      generic map (
        ADDRESS_WIDTH => ADDRESS_BITS,
        WIDTH         => ENTRY_BITS,
        LATENCY       => 1,
        STYLE         => "block",
        CONTENTS      => ENTRIES
      )
      port map (
        clk           => clk,
        write         => '0',
        write_address => (others => '0'),
        write_word    => (others => '0'),
        read          => '1',
        read_address  => entry_at,
        read_word     => entry
      );

    p_due : process (clk) is

      variable base : natural;

    begin

      if rising_edge(clk) then
        for n in 0 to BLOCK_COUNT - 1 loop
          base               := n * BLOCK_BITS;
          products.issue(n)  <= entry(base) or (start and not active);
          products.gather(n) <= entry(base + 1);
          products.halve(n)  <= entry(base + 2);
          products.lead(n)   <= entry(base + 3);
          base               := base + 4;

          products.a_choice(n)    <= padded(entry(base + A_BITS - 1 downto base));
          base                    := base + A_BITS;
          products.b_choice(n)    <= padded(entry(base + B_BITS - 1 downto base));
          base                    := base + B_BITS;
          products.seed_choice(n) <= padded(entry(base + SEED_BITS - 1 downto base));
        end loop;

        if (chosen = FAMILY_MPTC1) then
          events.begin_pairs <= to_std_logic(address = FIRST_MPTC1 - 1) and (rooted or both);

          if (rooted = '0' and both = '0') then
            events.begin_pairs <= to_std_logic(address = FIRST_MPTC1_LATE - 1);
          end if;
        else
          events.begin_pairs <= to_std_logic(address = FIRST_PAIR - 1 and chosen /= FAMILY_NONE);
        end if;

        events.word_writes  <= entry(AT_WORDS + WORD_EVENTS - 1 downto AT_WORDS);
        events.term_writes  <= entry(AT_TERMS + TERM_EVENTS - 1 downto AT_TERMS);
        events.normalise    <= entry(AT_NORMALISE);
        events.orient       <= entry(AT_ORIENT);
        events.square       <= entry(AT_SQUARE);
        events.radicand     <= entry(AT_RADICAND);
        events.begin_stream <= entry(AT_STREAM);
        events.way_alpha    <= entry(AT_WAY_ALPHA);
        events.way_beta     <= entry(AT_WAY_BETA);
        events.rest         <= entry(AT_REST);
        events.last         <= ends;

        if (rst = '1') then
          products.issue      <= (others => '0');
          events.word_writes  <= (others => '0');
          events.term_writes  <= (others => '0');
          events.normalise    <= '0';
          events.orient       <= '0';
          events.square       <= '0';
          events.radicand     <= '0';
          events.begin_stream <= '0';
          events.begin_pairs  <= '0';
          events.way_alpha    <= '0';
          events.way_beta     <= '0';
          events.rest         <= '0';
          events.last         <= '0';
        end if;
      end if;

    end process p_due;

  end generate g_table;

end architecture rtl;
