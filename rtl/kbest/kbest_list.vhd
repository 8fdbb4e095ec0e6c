-- Sorted list of the children of a stage that live on (docs/specification.md, section 10.3).
--
-- The list has up to BEAM entries in ascending order of their keys.  A child comes in every clock.  Of
-- equal keys the earlier one stays in front.  Of one position at most two entries stay.  A planned child
-- goes to the front whatever its key.  Each entry has a slot, which tells where its state is kept: a
-- child gets the slot of the entry that it drives out, so that the states never move.
-- Formats: keys unsigned; positions of the three phases, 3 bits each.
-- Latency: accepted and slot in the clock of the child; the list behind the next edge.
-- Overflow: none; a child that is in the list behind BEAM others is dropped.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.kbest_constants.all;
  use work.kbest_types.all;

entity kbest_list is
  generic (
    BEAM : positive range 1 to 16 := 8 -- K, entries
  );
  port (
    clk       : in    std_logic;                                -- rising edge
    rst       : in    std_logic;                                -- synchronous, active high: empties the list
    insert    : in    std_logic;                                -- '1': a child comes
    first     : in    std_logic;                                -- '1': with insert: it is the first of its stage
    planned   : in    std_logic;                                -- '1': it follows the plan
    key       : in    cost_t;                                   -- of the child
    positions : in    std_logic_vector(8 downto 0);             -- of the child, phase a on the left
    accepted  : out   std_logic;                                -- '1': the child is in the list
    slot      : out   slot_t;                                   -- where its state is to be kept
    least     : out   cost_t;                                   -- key of the first entry
    order     : out   std_logic_vector(4 * BEAM - 1 downto 0);  -- slots in the list's order, the first rightmost
    used      : out   std_logic_vector(BEAM - 1 downto 0)       -- '1': entry is in use, the first rightmost
  );
end entity kbest_list;

architecture rtl of kbest_list is

  type entry_t is record
    used      : std_logic;
    key       : cost_t;
    positions : std_logic_vector(8 downto 0);
    slot      : slot_t;
  end record entry_t;

  type entries_t is array (0 to BEAM - 1) of entry_t;

  -- no entry, and a slot for each
  function emptied return entries_t is

    variable result : entries_t;

  begin

    for i in result'range loop
      result(i) := ('0', (others => '0'), (others => '0'), to_unsigned(i, slot_t'length));
    end loop;

    return result;

  end function emptied;

  signal entries : entries_t;
  signal now     : entries_t;                           -- as the child finds them
  signal in_front  : std_logic_vector(BEAM - 1 downto 0); -- '1': entry stands in front of the child
  signal reaching   : std_logic_vector(BEAM - 1 downto 0); -- '1': entry is not behind the one that is driven out
  signal freed   : slot_t;                              -- slot of the one that is driven out

begin

  p_now : process (entries, first) is
  begin

    now <= entries;

    if (first = '1') then
      for i in now'range loop
        now(i).used <= '0';
        now(i).slot <= to_unsigned(i, slot_t'length);
      end loop;
    end if;

  end process p_now;

  p_compare : process (now, key, positions, planned) is

    variable same  : std_logic_vector(BEAM - 1 downto 0);
    variable seen  : std_logic;
    variable two   : std_logic;
    variable reach : std_logic_vector(BEAM - 1 downto 0);

  begin

    for i in 0 to BEAM - 1 loop
      in_front(i) <= '0';

      if (now(i).used = '1' and planned = '0' and not (key < now(i).key)) then
        in_front(i) <= '1';
      end if;

      same(i) := '0';

      if (now(i).used = '1' and positions = now(i).positions) then
        same(i) := '1';
      end if;
    end loop;

    seen := '0';
    two  := '0';

    for i in 0 to BEAM - 1 loop
      two  := two or (seen and same(i));
      seen := seen or same(i);
    end loop;

    -- the last entry of the same positions, or the first free one, or the last
    seen := '0';

    for i in BEAM - 1 downto 0 loop
      seen := seen or same(i);

      if (two = '1') then
        reach(i) := seen;
      elsif (i = 0) then
        reach(i) := '1';
      else
        reach(i) := now(i - 1).used;
      end if;
    end loop;

    reaching <= reach;
    freed <= now(BEAM - 1).slot;

    for i in BEAM - 2 downto 0 loop
      if (reach(i) = '1' and reach(i + 1) = '0') then
        freed <= now(i).slot;
      end if;
    end loop;

  end process p_compare;

  accepted <= '1' when insert = '1' and (reaching and not in_front) /= (BEAM - 1 downto 0 => '0') else
              '0';
  slot     <= freed;

  p_entries : process (clk) is
  begin

    if rising_edge(clk) then
      if (insert = '1') then
        for i in 0 to BEAM - 1 loop
          entries(i) <= now(i);

          if (reaching(i) = '1' and in_front(i) = '0') then
            if (i = 0 or in_front(maximum_of(i - 1, 0)) = '1') then
              entries(i) <= ('1', key, positions, freed);
            else
              entries(i) <= now(maximum_of(i - 1, 0));
            end if;
          end if;
        end loop;
      end if;

      if (rst = '1') then
        entries <= emptied;
      end if;
    end if;

  end process p_entries;

  least <= entries(0).key;

  g_out : for i in 0 to BEAM - 1 generate
    order(4 * i + 3 downto 4 * i) <= std_logic_vector(entries(i).slot);
    used(i)                       <= entries(i).used;
  end generate g_out;

end architecture rtl;
