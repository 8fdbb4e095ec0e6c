-- Queue of the nodes of the second level: candidates of the root with 0 < L1 < N.
--
-- Takes the root's candidates as an explorer evaluates them. One whose length is the whole horizon is
-- a leaf itself (whole); the others wait in one list for each effort f_s. The entry
-- shown is the latest of the smallest effort: nodes with few switchings most likely lead to
-- the cheapest leaf, so that a budget loses little.
--
--   lists      a head for each effort, the place of the next one for each candidate, so that one
--              clock puts a candidate in and three show the next
--   slopes     of every candidate's current errors as the explorer formed them, so that no successor
--              has to form them again
--
-- Formats: as evaluated_t and entry_t.
-- Latency: an entry is shown three clocks after it can be, its slope four; the next one three clocks after taken.
-- Overflow: none, there is room for all 64 candidates.
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
  use work.mpdcc_types.all;
  use work.second_level_types.all;

entity node_queue is
  port (
    clk       : in    std_logic;   -- rising edge
    rst       : in    std_logic;   -- synchronous, active high
    clear     : in    std_logic;   -- '1': empty the queue
    open_root : in    std_logic;   -- '1': candidates of the root are evaluated
    evaluated : in    evaluated_t; -- by the explorer
    horizon   : in    length_t;    -- N
    previous  : in    positions_t; -- s(k-1), stable
    whole     : out   std_logic;   -- '1': what is evaluated has the whole horizon
    valid     : out   std_logic;   -- '1': entry is the next
    entry     : out   entry_t;     -- stable while valid, its slope from a clock later on: place 0's until one is in
    taken     : in    std_logic;   -- '1' for one clock: entry is taken, with valid
    empty     : out   std_logic    -- '1': no entry is left, a clock after the last one is taken
  );
end entity node_queue;

architecture rtl of node_queue is

  constant EFFORTS : natural := MOST_EFFORT + 1;

  subtype place_t is unsigned(INDEX_WIDTH - 1 downto 0);

  subtype link_t is std_logic_vector(INDEX_WIDTH + LENGTH_WIDTH downto 0); -- length, more, next place

  subtype slopes_word_t is std_logic_vector(2 * BASE_WIDTH - 1 downto 0);

  type heads_t is array (0 to EFFORTS - 1) of place_t;

  type stage_t is (CHOOSE, READ, SHOW);

  signal heads : heads_t;

  signal used       : std_logic_vector(EFFORTS - 1 downto 0); -- '1': the list of this effort has entries
  signal stage      : stage_t;
  signal lowest     : unsigned(EFFORT_WIDTH - 1 downto 0);
  signal place      : place_t;
  signal link       : link_t;
  signal link_in    : link_t;
  signal slope_word : slopes_word_t;
  signal slope_in   : slopes_word_t;
  signal store_link : std_logic;                      -- '1': a candidate is put in
  signal store_slope : std_logic;                     -- '1': its slopes come
  signal list       : natural range 0 to EFFORTS - 1; -- whose head is read and written
  signal head       : place_t;
  signal whole_now  : std_logic;

begin

  list <= to_integer(evaluated.effort) when open_root = '1' and evaluated.valid = '1' else
          to_integer(lowest);
  head <= heads(list);

  p_lowest : process (used) is
  begin

    lowest <= (others => '0');

    for i in EFFORTS - 1 downto 0 loop
      if (used(i) = '1') then
        lowest <= to_unsigned(i, EFFORT_WIDTH);
      end if;
    end loop;

  end process p_lowest;

  p_lists : process (clk) is

    variable write      : std_logic;
    variable write_head : place_t;

  begin

    if rising_edge(clk) then
      write      := '0';
      write_head := evaluated.index;

      -- in
      if (store_link = '1') then
        used(list) <= '1';
        write      := '1';
      end if;

      -- out, once the root is done
      case stage is

        when CHOOSE =>

          place <= head;

          if (open_root = '1') then
            -- entry 0 holds the probe's slope, which the prediction uses
            place <= (others => '0');
          elsif (used /= (used'range => '0')) then
            stage <= READ;
          end if;

        when READ =>

          stage <= SHOW;

        when SHOW =>

          if (taken = '1') then
            write      := '1';
            write_head := unsigned(link(INDEX_WIDTH - 1 downto 0));

            -- still the lowest, nothing was put in since
            used(list) <= link(INDEX_WIDTH);
            stage      <= CHOOSE;
          end if;

      end case;

      if (write = '1') then
        heads(list) <= write_head;
      end if;

      if (rst = '1' or clear = '1') then
        used  <= (others => '0');
        stage <= CHOOSE;
      end if;
    end if;

  end process p_lists;

  ---------------------------------------------------------------------------------------------
  -- Places
  ---------------------------------------------------------------------------------------------

  store_link  <= open_root and evaluated.valid and not whole_now;
  store_slope <= open_root and evaluated.slope_valid;
  link_in     <= std_logic_vector(evaluated.length) & used(list) & std_logic_vector(head);
  slope_in    <= std_logic_vector(evaluated.slope(1)) & std_logic_vector(evaluated.slope(0));

  i_links : entity work.ram
    generic map (
      ADDRESS_WIDTH => INDEX_WIDTH,
      WIDTH         => INDEX_WIDTH + LENGTH_WIDTH + 1
    )
    port map (
      clk           => clk,
      write         => store_link,
      write_address => std_logic_vector(evaluated.index),
      write_word    => link_in,
      read          => '1',
      read_address  => std_logic_vector(place),
      read_word     => link
    );

  i_slopes : entity work.ram
    generic map (
      ADDRESS_WIDTH => INDEX_WIDTH,
      WIDTH         => 2 * BASE_WIDTH,
      LATENCY       => 2
    )
    port map (
      clk           => clk,
      write         => store_slope,
      write_address => std_logic_vector(evaluated.slope_index),
      write_word    => slope_in,
      read          => '1',
      read_address  => std_logic_vector(place),
      read_word     => slope_word
    );

  ---------------------------------------------------------------------------------------------
  -- What is shown
  ---------------------------------------------------------------------------------------------

  whole_now <= to_std_logic(evaluated.length = horizon);

  whole <= open_root and evaluated.valid and whole_now;
  valid <= to_std_logic(stage = SHOW);

  -- a register between the lists and what the scheduler makes of it
  p_empty : process (clk) is
  begin

    if rising_edge(clk) then
      empty <= to_std_logic(used = (used'range => '0'));
    end if;

  end process p_empty;

  entry.index  <= place;
  entry.effort <= lowest;
  entry.length <= unsigned(link(link'high downto INDEX_WIDTH + 1));

  g_phases : for x in 0 to 2 generate
    entry.position(x) <= next_position(previous(x), place(5 - 2 * x downto 4 - 2 * x));
  end generate g_phases;

  g_slopes : for x in 0 to 1 generate
    entry.slope(x) <= signed(slope_word((x + 1) * BASE_WIDTH - 1 downto x * BASE_WIDTH));
  end generate g_slopes;

end architecture rtl;
