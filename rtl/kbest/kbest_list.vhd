-- The children of a stage that live on, by rank (docs/specification.md, section 10.3).
--
-- The list has up to BEAM entries.  A child comes in every clock.  Of equal keys the earlier one stays in
-- front.  Of one position at most two entries stay.  A planned child goes to the front whatever its key.
-- Entries never move: each has a slot, and its rank counts how many stand in front of it.  A child takes the
-- slot of the entry that it drives out.  The ranks are a permutation of all slots, used or not.
-- Formats: keys unsigned; positions of the three phases, 3 bits each.
-- Latency: accepted and slot in the clock of the child; the list behind the next edge.
-- Overflow: none; a child behind BEAM others is dropped.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.kbest_constants.all;
  use work.kbest_types.all;

entity kbest_list is
  generic (
    BEAM : positive range 1 to 16 := 8 -- K, entries
  );
  port (
    clk       : in    std_logic;                    -- rising edge
    rst       : in    std_logic;                    -- synchronous, active high: empties the list
    insert    : in    std_logic;                    -- '1': a child comes
    first     : in    std_logic;                    -- '1': with insert: it is the first of its stage
    planned   : in    std_logic;                    -- '1': it follows the plan
    key       : in    cost_t;                       -- of the child
    positions : in    std_logic_vector(8 downto 0); -- of the child, phase a on the left
    accepted  : out   std_logic;                    -- '1': the child is in the list
    slot      : out   slot_t;                       -- the slot that it takes
    least     : out   cost_t;                       -- key of the first entry, unless that one is planned
    used      : out   unsigned(4 downto 0);         -- number of entries
    hold      : in    std_logic;                    -- '1': the ranks are kept for rank
    rank      : in    unsigned(4 downto 0);         -- a rank in the list, or in the one that is kept
    kept      : in    std_logic;                    -- '1': in the one that is kept
    ranked    : out   slot_t                        -- slot of that rank
  );
end entity kbest_list;

architecture rtl of kbest_list is

  subtype rank_t is natural range 0 to BEAM - 1;

  subtype flags_t is std_logic_vector(BEAM - 1 downto 0);

  type keys_t is array (0 to BEAM - 1) of cost_t;

  type ranks_t is array (0 to BEAM - 1) of rank_t;

  type places_t is array (0 to BEAM - 1) of std_logic_vector(8 downto 0);

  -- each slot has its own number as its rank
  function in_turn return ranks_t is

    variable result : ranks_t;

  begin

    for i in result'range loop
      result(i) := i;
    end loop;

    return result;

  end function in_turn;

  signal keys     : keys_t;
  signal places   : places_t;
  signal ranks    : ranks_t;
  signal earlier  : ranks_t; -- ranks that are kept
  signal valid    : flags_t;
  signal second   : flags_t; -- '1': another entry of the same position stands in front
  signal number   : unsigned(4 downto 0);
  signal in_front : flags_t; -- '1': entry stands in front of the child
  signal same     : flags_t; -- '1': entry has the child's position
  signal victim   : flags_t; -- '1': entry that the child drives out
  signal placed   : rank_t;  -- rank of the child
  signal limit    : rank_t;  -- rank of the victim
  signal enters   : std_logic;

begin

  p_compare : process (keys, places, ranks, valid, second, first, planned, key, positions) is

    variable crowded  : std_logic;
    variable distance : unsigned(COST_WIDTH downto 0);
    variable front   : flags_t;
    variable alike   : flags_t;
    variable out_of  : flags_t;
    variable count   : natural range 0 to BEAM;
    variable last    : natural range 0 to 15;

  begin

    for i in 0 to BEAM - 1 loop
      front(i) := '0';
      alike(i) := '0';

      if (valid(i) = '1' and first = '0') then
        -- a difference, as a comparison costs inverters
        distance := ('0' & key) - ('0' & keys(i));
        front(i) := not (planned or distance(COST_WIDTH));

        if (positions = places(i)) then
          alike(i) := '1';
        end if;
      end if;
    end loop;

    crowded := '0';

    for i in 0 to BEAM - 1 loop
      crowded := crowded or (alike(i) and second(i));
    end loop;

    count := 0;
    last  := 0;

    for i in 0 to BEAM - 1 loop
      out_of(i) := '0';

      if ((crowded = '1' and alike(i) = '1' and second(i) = '1') or (crowded = '0' and ranks(i) = BEAM - 1)) then
        out_of(i) := '1';
      end if;

      if (front(i) = '1') then
        count := count + 1;
      end if;
    end loop;

    slot  <= (others => '0');
    limit <= 0;

    for i in 0 to BEAM - 1 loop
      if (out_of(i) = '1') then
        slot  <= to_unsigned(i, slot_t'length);
        limit <= ranks(i);
      end if;
    end loop;

    enters <= '1';

    if ((out_of and front) /= (flags_t'range => '0')) then
      enters <= '0';
    end if;

    placed <= 0;

    if (count < BEAM) then
      placed <= count;
    end if;

    in_front <= front;
    same     <= alike;
    victim   <= out_of;

  end process p_compare;

  accepted <= insert and enters;

  p_entries : process (clk) is
  begin

    if rising_edge(clk) then
      if (insert = '1' and first = '1') then
        valid  <= (others => '0');
        number <= (others => '0');
      end if;

      if (insert = '1' and enters = '1') then
        for i in 0 to BEAM - 1 loop
          if (victim(i) = '1') then
            keys(i)   <= key;
            places(i) <= positions;
            ranks(i)  <= placed;
            valid(i)  <= '1';
            second(i) <= '0';

            if ((same and in_front) /= (flags_t'range => '0')) then
              second(i) <= '1';
            end if;

            if (first = '1') then
              number <= to_unsigned(1, number'length);
            elsif (valid(i) = '0') then
              number <= number + 1;
            end if;
          elsif (in_front(i) = '0' and ranks(i) < limit) then
            ranks(i) <= ranks(i) + 1;
          end if;

          if (victim(i) = '0' and in_front(i) = '0' and same(i) = '1') then
            second(i) <= '1';
          end if;
        end loop;

        if (placed = 0) then
          least <= key;
        end if;
      end if;

      if (hold = '1') then
        earlier <= ranks;
      end if;

      if (rst = '1') then
        ranks  <= in_turn;
        valid  <= (others => '0');
        number <= (others => '0');
      end if;
    end if;

  end process p_entries;

  p_find : process (ranks, earlier, rank, kept) is
  begin

    ranked <= (others => '0');

    for i in 0 to BEAM - 1 loop
      if ((kept = '1' and earlier(i) = rank) or (kept = '0' and ranks(i) = rank)) then
        ranked <= to_unsigned(i, slot_t'length);
      end if;
    end loop;

  end process p_find;

  used <= number;

end architecture rtl;
