-- The children of a stage that live on, by rank (docs/specification.md, section 10.3).
--
-- The list has up to BEAM entries, the best one first.  A child may come in every clock.  Of equal keys the earlier one
-- stays in front.  Of one position at most two entries stay.  A planned child goes to the front whatever its key.
-- Each entry has a slot; a child takes that of the entry that it drives out.
--
-- A child is compared with all entries in one clock and put among them in the next, while the one behind it is
-- compared: what moves in between takes the results of its comparison along.
-- Formats: keys unsigned; positions of the three phases, 3 bits each.
-- Latency: accepted and slot in the clock behind the child's; the list in the one behind that.  ranked is that of the
-- clock before.
-- Overflow: none; a child behind BEAM others is dropped.
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
    clk       : in    std_logic;                    -- rising edge
    rst       : in    std_logic;                    -- synchronous, active high: empties the list
    insert    : in    std_logic;                    -- '1': a child comes
    first     : in    std_logic;                    -- '1': with insert: it is the first of its stage
    planned   : in    std_logic;                    -- '1': it follows the plan
    key       : in    cost_t;                       -- of the child
    positions : in    std_logic_vector(8 downto 0); -- of the child, phase a on the left
    accepted  : out   std_logic;                    -- '1': the child is in the list
    slot      : out   slot_t;                       -- the slot that it takes
    least     : out   cost_t;                       -- key of the first entry, 0 if that one is planned
    used      : out   unsigned(4 downto 0);         -- number of entries
    best      : out   slot_t;                       -- slot of the first entry
    next_best : out   slot_t;                       -- slot of the second one
    hold      : in    std_logic;                    -- '1': the slots are kept for rank
    rank      : in    unsigned(4 downto 0);         -- a rank in the list that is kept
    ranked    : out   slot_t                        -- slot of that rank
  );
end entity kbest_list;

architecture rtl of kbest_list is

  subtype flags_t is std_logic_vector(BEAM - 1 downto 0);

  type keys_t is array (0 to BEAM - 1) of cost_t;

  type slots_t is array (0 to BEAM - 1) of slot_t;

  type places_t is array (0 to BEAM - 1) of std_logic_vector(8 downto 0);

  constant RUNNER_UP : natural := choose(BEAM > 1, 1, 0);

  -- entries by rank
  signal keys    : keys_t;
  signal places  : places_t;
  signal slots   : slots_t;
  signal earlier : slots_t;            -- slots that are kept
  signal valid   : flags_t;
  signal second  : flags_t;            -- '1': another entry of the same position stands in front
  signal number  : unsigned(4 downto 0);

  -- the child in its second clock
  signal enters_now   : std_logic;
  signal first_now    : std_logic;
  signal key_now      : cost_t;
  signal place_now    : std_logic_vector(8 downto 0);
  signal less         : flags_t;       -- '1': it stands in front of the entry, before that moved
  signal alike        : flags_t;       -- '1': entry has its position
  signal less_newest  : std_logic;     -- the same beside the child before it
  signal alike_newest : std_logic;
  signal newest       : flags_t;       -- '1': entry is that child
  signal moved        : flags_t;       -- '1': entry had the rank before

  signal front    : flags_t;           -- '1': entry stands in front of the child
  signal same     : flags_t;           -- '1': entry has the child's position
  signal leaves   : flags_t;           -- '1': entry would be the third of its position
  signal loads    : flags_t;           -- '1': entry gives way to the child
  signal enters   : std_logic;
  signal taken    : slot_t;            -- slot of the entry that leaves

  function is_less (left, right : cost_t) return std_logic is

    variable distance : unsigned(COST_WIDTH downto 0);

  begin

    -- a difference, as a comparison costs inverters
    distance := ('0' & left) - ('0' & right);
    return distance(COST_WIDTH);

  end function is_less;

  function any (bits : std_logic_vector) return std_logic is
  begin

    return to_std_logic(bits /= (bits'range => '0'));

  end function any;

begin

  p_entries_now : process (less, alike, less_newest, alike_newest, newest, moved) is
  begin

    for i in 0 to BEAM - 1 loop
      front(i) <= not less(i);
      same(i)  <= alike(i);

      if (newest(i) = '1') then
        front(i) <= not less_newest;
        same(i)  <= alike_newest;
      elsif (moved(i) = '1' and i > 0) then
        front(i) <= not less(maximum_of(i, 1) - 1);
        same(i)  <= alike(maximum_of(i, 1) - 1);
      end if;
    end loop;

  end process p_entries_now;

  leaves <= same and second;
  -- where the last entry is in front, all of them are
  enters <= not (front(BEAM - 1) or any(front and leaves));

  p_leave : process (front, leaves, slots) is

    variable one : slot_t;

  begin

    one := (others => '0');

    if (any(leaves) = '0') then
      one := slots(BEAM - 1);
    end if;

    for i in 0 to BEAM - 1 loop
      loads(i) <= not front(i);

      if (i > 0 and any(leaves(maximum_of(i, 1) - 1 downto 0)) = '1') then
        loads(i) <= '0';
      end if;

      if (leaves(i) = '1') then
        one := one or slots(i);
      end if;
    end loop;

    taken <= one;

  end process p_leave;

  accepted <= enters_now and enters;
  slot     <= taken;

  p_entries : process (clk) is
  begin

    if rising_edge(clk) then
      enters_now   <= insert;
      first_now    <= first;
      key_now      <= key;
      place_now    <= positions;
      less_newest  <= is_less(key, key_now) or planned or first;
      alike_newest <= to_std_logic(positions = place_now) and not first;
      newest       <= (others => '0');
      moved        <= (others => '0');

      for i in 0 to BEAM - 1 loop
        less(i)  <= is_less(key, keys(i)) or planned;
        alike(i) <= to_std_logic(positions = places(i));

        -- the entry is not one of this stage
        if (valid(i) = '0' or first = '1' or (enters_now = '1' and first_now = '1')) then
          less(i)  <= '1';
          alike(i) <= '0';
        end if;

        -- none of them where the child does not enter
        if (enters_now = '1' and loads(i) = '1') then
          if (i > 0 and front(maximum_of(i, 1) - 1) = '0') then
            moved(i)  <= '1';
            keys(i)   <= keys(maximum_of(i, 1) - 1);
            places(i) <= places(maximum_of(i, 1) - 1);
            slots(i)  <= slots(maximum_of(i, 1) - 1);
            valid(i)  <= valid(maximum_of(i, 1) - 1) and not first_now;
            second(i) <= second(maximum_of(i, 1) - 1) or same(maximum_of(i, 1) - 1);
          else
            newest(i) <= '1';
            keys(i)   <= key_now;
            places(i) <= place_now;
            slots(i)  <= taken;
            valid(i)  <= '1';
            second(i) <= any(same and front);
          end if;
        end if;
      end loop;

      if (enters_now = '1' and first_now = '1') then
        number <= to_unsigned(1, number'length);
      elsif (enters_now = '1' and any(leaves) = '0' and valid(BEAM - 1) = '0') then
        number <= number + 1;
      end if;

      if (hold = '1') then
        earlier <= slots;
      end if;

      ranked <= (others => '0');

      for i in 0 to BEAM - 1 loop
        if (rank = i) then
          ranked <= earlier(i);
        end if;
      end loop;

      if (rst = '1') then
        enters_now <= '0';
        valid      <= (others => '0');

        for i in 0 to BEAM - 1 loop
          slots(i) <= to_unsigned(i, slot_t'length);
        end loop;
      end if;
    end if;

  end process p_entries;

  least     <= keys(0);
  best      <= slots(0);
  next_best <= slots(RUNNER_UP);
  used <= number;

end architecture rtl;
