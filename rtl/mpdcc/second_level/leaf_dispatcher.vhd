-- Hands the candidates that follow a node of the second level to all explorers in step.
--
-- Phases a and b are counted; each explorer gets next positions of phase c.  With four explorers and
-- more a block of up to four candidates goes out in one clock, with two or three in two clocks, with
-- one in four.  A node may follow another without a gap.
--
-- Order: that of candidate_enumerator.  It does not matter here: of the leaves below one s1 the cheapest
-- counts, whichever it is.
-- Formats: effort counts both levels.
-- Latency: the first leaf comes two clocks after load, with launch; a node takes one clock for every
-- EXPLORERS next positions of phase c, for every combination of phases a and b: 9 to 64.
-- Overflow: none; two efforts fit TOTAL_EFFORT_WIDTH.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_types.all;
  use work.second_level_types.all;

entity leaf_dispatcher is
  generic (
    EXPLORERS : positive range 1 to 8 := 2 -- number of explorers
  );
  port (
    clk        : in    std_logic;                                -- rising edge
    rst        : in    std_logic;                                -- synchronous, active high
    load       : in    std_logic;                                -- '1' for one clock: begin with a node, with ready
    visit      : in    visit_t;                                  -- the node, sampled with load; its length is not read
    negative   : in    std_logic_vector(2 downto 0);             -- '1': negative phase current, sampled with load
    ready      : out   std_logic;                                -- '1': a node may be loaded
    ending     : out   std_logic;                                -- '1': ready at most 8 clocks later
    active     : out   std_logic;                                -- '1': leaves come or are about to
    launch     : out   std_logic;                                -- '1': first leaf of a node
    leaf_valid : out   std_logic_vector(EXPLORERS - 1 downto 0); -- '1': leaf of this explorer is valid
    leaf       : out   leaves_t(0 to EXPLORERS - 1)              -- one for each explorer
  );
end entity leaf_dispatcher;

architecture rtl of leaf_dispatcher is

  -- clocks that the next positions of phase c take, at most
  constant ROUNDS : positive := choose(EXPLORERS >= 4, 1, choose(EXPLORERS >= 2, 2, 4));

  -- blocks that are left where ending rises
  constant LAST_BLOCKS : natural := ENDING_CLOCKS / ROUNDS;

  subtype choice_t is natural range 0 to 3;

  signal running       : std_logic;
  signal fresh         : std_logic; -- the first clock of a node
  signal from          : positions_t;
  signal effort_so_far : unsigned(EFFORT_WIDTH - 1 downto 0);
  signal sign          : std_logic_vector(2 downto 0);
  signal bank_now      : std_logic;
  signal place         : unsigned(INDEX_WIDTH - 1 downto 0);
  signal passing       : std_logic; -- a leaf is out
  signal choice_a      : choice_t;
  signal choice_b      : choice_t;
  signal choice_c      : choice_t;             -- of explorer 0
  signal left          : unsigned(3 downto 0); -- blocks after this one
  signal end_c         : std_logic;
  signal finished      : std_logic;

begin

  end_c    <= to_std_logic(choice_c + EXPLORERS > NEXT_LAST(to_integer(from(2))));
  active   <= running or passing;
  finished <= end_c and to_std_logic(left = 0);
  ready    <= not running or finished;
  ending   <= to_std_logic(running = '0' or left < LAST_BLOCKS);

  p_count : process (clk) is
  begin

    if rising_edge(clk) then
      fresh <= '0';

      if (running = '1') then
        if (end_c = '0') then
          choice_c <= choice_c + EXPLORERS;
        else
          choice_c <= 0;

          -- the last block leaves any count behind, nothing reads it
          left <= left - 1;

          if (choice_b /= NEXT_LAST(to_integer(from(1)))) then
            choice_b <= choice_b + 1;
          else
            choice_b <= 0;
            choice_a <= (choice_a + 1) mod 4;
          end if;
        end if;

        if (finished = '1') then
          running <= '0';
        end if;
      end if;

      if (load = '1') then
        running       <= '1';
        fresh         <= '1';
        from          <= visit.position;
        effort_so_far <= visit.effort;
        sign          <= negative;
        bank_now      <= visit.bank;
        place         <= visit.index;
        choice_a      <= 0;
        choice_b      <= 0;
        choice_c      <= 0;
        left          <= resize(combinations(visit.position, 2, 1), left'length);
      end if;

      if (rst = '1') then
        running <= '0';
        fresh   <= '0';
        left    <= (others => '0');
      end if;
    end if;

  end process p_count;

  p_leaf : process (clk) is

    variable a     : unsigned(1 downto 0);
    variable b     : unsigned(1 downto 0);
    variable c     : unsigned(1 downto 0);
    variable both  : unsigned(TOTAL_EFFORT_WIDTH - 1 downto 0);

  begin

    if rising_edge(clk) then
      launch  <= fresh;
      passing <= running;

      a    := to_unsigned(choice_a, 2);
      b    := to_unsigned(choice_b, 2);
      both := resize(effort_so_far, TOTAL_EFFORT_WIDTH) + transition_weight(from(0), sign(0), a)
              + transition_weight(from(1), sign(1), b);

      for i in 0 to EXPLORERS - 1 loop
        leaf_valid(i) <= '0';

        if (i < 4) then
          c := to_unsigned(choice_c, 2) + i;

          leaf_valid(i) <= running and to_std_logic(choice_c + i <= NEXT_LAST(to_integer(from(2))));

          leaf(i).position(0) <= next_position(from(0), a);
          leaf(i).position(1) <= next_position(from(1), b);
          leaf(i).position(2) <= next_position(from(2), c);
          leaf(i).effort      <= both + transition_weight(from(2), sign(2), c);
          leaf(i).bank        <= bank_now;
          leaf(i).index       <= place;
        else
          leaf(i) <= LEAF_INIT;
        end if;
      end loop;

      if (rst = '1') then
        launch     <= '0';
        passing    <= '0';
        leaf_valid <= (others => '0');
      end if;
    end if;

  end process p_leaf;

end architecture rtl;
