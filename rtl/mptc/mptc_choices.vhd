-- Second vectors of the flux methods: finds the time of each choice, compares the distances and keeps the nearest.
--
-- A choice is the point that comes nearest to e on a line of the hexagon: a spoke from zero voltage to a vector, or an
-- edge from a vector to the leading one, which stands where u_1 does. In coordinates along two vectors all times are
-- sums of the coordinates (docs/mptc.md). Its distance from e is two products, formed by a mac_block. MPFC3 has both
-- times: e itself inside a triangle, else a point of one of its sides. Choices begin two clocks apart. A tie goes to
-- the earlier one; the table TURNS orders them by commutations.
--
-- Formats: g, h HEXAGON_FRACTION fractional bits; residues words with RESIDUE_SHIFT bits less than two bits finer
-- coordinates; time 1/4096 of the period, cut off, 4096 for all of it.
-- Latency: choice n begins at clock CHOICE_CLOCK + 2 * n, its products are issued 2 and 3 clocks later, and it is
-- compared CHOICE_COMPARE clocks later. best is stable a clock after the last comparison.
-- Overflow: none; a residue is below 16 ways of a vector, which is what a word holds.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_choices is
  port (
    clk      : in    std_logic;                         -- rising edge
    clock    : in    natural range 0 to HEXAGON_CLOCKS; -- clocks since e was taken; 0: none is counted
    method   : in    family_t;                          -- a flux method, stable
    row      : in    vector_t;                          -- row of TURNS, stable a clock after the first choice's first
    idle     : in    std_logic;                         -- '1': row is a zero vector, stable
    leader   : in    vector_t;                          -- leading vector, stable
    ended    : in    vector_t;                          -- vector that is applied last, stable
    missing  : in    mptc_missing_t;                    -- e, stable
    sum      : in    sum_t;                             -- square of a distance
    residues : out   mptc_residues_t;                   -- operands of the squares
    best     : out   mptc_choice_t                      -- the nearest so far
  );
end entity mptc_choices;

architecture rtl of mptc_choices is

  constant WAY_BITS   : positive := HEXAGON_WIDTH + 3; -- of a time before it is limited
  constant FINE_WIDTH : positive := HEXAGON_WIDTH + 3; -- of a residue

  constant WHOLE_BIT : natural := HEXAGON_FRACTION + 2; -- bit of a time that is the whole period

  constant TIME_SHIFT : natural := WHOLE_BIT - TIME_WIDTH;

  constant DISTANCE_WIDTH : positive := 2 * WORD_WIDTH - 1; -- of a square below 256, and what rounds it

  constant SLOTS_BEHIND : natural := CHOICE_COMPARE / 2; -- choices from one's beginning to its comparison

  subtype way_t is signed(WAY_BITS - 1 downto 0);

  subtype fine_t is signed(FINE_WIDTH - 1 downto 0);

  subtype part_t is unsigned(WHOLE_BIT downto 0); -- limited time

  subtype sum_of_e_t is std_logic_vector(2 downto 0); -- which one: g or g + h, with what is added

  constant SUM_LEAD    : sum_of_e_t := "011"; -- 2*g + h
  constant SUM_BY_NEXT : sum_of_e_t := "101"; -- g + 2*h
  constant SUM_APART   : sum_of_e_t := "010"; -- g - h
  constant SUM_ALONG   : sum_of_e_t := "000"; -- g
  constant SUM_TOTAL   : sum_of_e_t := "100"; -- g + h

  subtype distance_t is unsigned(DISTANCE_WIDTH - 1 downto 0);

  type founds_t is array (1 to SLOTS_BEHIND) of mptc_choice_t;

  signal active   : std_logic;
  signal later    : std_logic;                                   -- second clock of a choice
  signal slot     : natural range 0 to CHOICES + SLOTS_BEHIND - 1;
  signal next_number : std_logic_vector(2 downto 0);             -- of the choice behind this one
  signal turn     : turn_t;                                      -- turns to the vector of this choice, or the next
  signal following : kind_t;                                     -- kind of the next choice
  signal kind     : kind_t;
  signal wanted   : sum_of_e_t;
  signal form     : form_t;                                      -- that sum of e
  signal beyond_g : std_logic;                                   -- that sum of e is more than the period
  signal beyond_total : std_logic;
  signal beyond_next  : std_logic;
  signal beyond_apart : std_logic;
  signal full     : std_logic;                                   -- MPFC3: both times fill more than the period
  signal way      : way_t;
  signal held     : kind_t;                                      -- of the choice in way
  signal at       : turn_t;                                      -- turns to the vector whose spoke or edge it is
  signal asked    : turn_t;                                      -- turns to the choice's vector
  signal part     : part_t;
  signal residue_g : std_logic_vector(WORD_WIDTH - 1 downto 0);
  signal residue_h : std_logic_vector(WORD_WIDTH - 1 downto 0);
  signal residue_s : std_logic_vector(WORD_WIDTH - 1 downto 0);
  signal founds   : founds_t;
  signal nearest  : mptc_choice_t;
  signal least    : distance_t;
  signal better   : std_logic;

  -- a residue as a word
  function residue_word (value : fine_t) return std_logic_vector is
  begin

    return std_logic_vector(value(RESIDUE_SHIFT + WORD_WIDTH - 1 downto RESIDUE_SHIFT));

  end function residue_word;

  -- value and one whole period more or less
  function with_wholes (value : fine_t; wholes : std_logic_vector(1 downto 0)) return fine_t is

    variable result : fine_t;

  begin

    result                                    := value;
    result(FINE_WIDTH - 1 downto WHOLE_BIT) := value(FINE_WIDTH - 1 downto WHOLE_BIT)
                                               + resize(signed(wholes), FINE_WIDTH - WHOLE_BIT);
    return result;

  end function with_wholes;

begin

  ---------------------------------------------------------------------------------------------
  -- Choices, two clocks each
  ---------------------------------------------------------------------------------------------

  p_slots : process (clk) is
  begin

    if rising_edge(clk) then
      if (active = '1') then
        later <= not later;

        if (later = '1') then
          if (slot /= CHOICES + SLOTS_BEHIND - 1) then
            slot <= slot + 1;
          else
            active <= '0';
          end if;
        end if;
      end if;

      if (clock = CHOICE_CLOCK - 1) then
        active <= '1';
        later  <= '0';
        slot   <= 0;
      end if;

      if (clock = 0) then
        active <= '0';
      end if;
    end if;

  end process p_slots;

  -- looked up a clock ahead; in its second clock a choice makes room for what the next one asks
  p_turn : process (clk) is
  begin

    if rising_edge(clk) then
      turn <= TURNS(to_integer(unsigned(std_logic_vector'(row & next_number))));

      if (clock = CHOICE_CLOCK - 1) then
        turn <= "000";
      end if;
    end if;

  end process p_turn;

  next_number <= std_logic_vector(to_unsigned(slot + 1, 4)(2 downto 0));

  -- looked up a clock ahead as well
  p_kind : process (method, idle, slot, turn, missing, full) is

    variable beside_v : std_logic; -- sign of the time of the leading vector
    variable beside_l : std_logic; -- sign of the other's

  begin

    following <= KIND_EDGE;

    if (slot = 0 or idle = '1') then
      following <= KIND_SPOKE;
    end if;

    if (method = FAMILY_MPFC3) then
      beside_v := sign_of(missing.total);

      if (turn = "001" or turn = "100") then
        beside_v := sign_of(missing.g);
      end if;

      beside_l := sign_of(missing.h) xor turn(2);

      if (turn = "000" or turn = "011" or beside_v = '1') then
        following <= KIND_SPOKE;
      elsif (beside_l = '1') then
        following <= KIND_ALONE;
      elsif (full = '0') then
        following <= KIND_INSIDE;
      end if;
    end if;

  end process p_kind;

  p_following : process (clk) is
  begin

    if rising_edge(clk) then
      if (later = '1') then
        kind <= following;
      end if;

      -- the first choice
      if (clock = CHOICE_CLOCK - 1) then
        kind <= KIND_SPOKE;
      end if;
    end if;

  end process p_following;

  ---------------------------------------------------------------------------------------------
  -- Times
  ---------------------------------------------------------------------------------------------

  -- whether MPFC3's period is full; the first choice needs no sum and leaves its clocks to these two
  p_beyond : process (clk) is
  begin

    if rising_edge(clk) then
      beyond_g     <= beyond_one(missing.g);
      beyond_total <= beyond_one(missing.total);

      if (slot = 0 and later = '0') then
        beyond_apart <= beyond_one(form);
      end if;

      if (slot = 0 and later = '1') then
        beyond_next <= beyond_one(form);
      end if;
    end if;

  end process p_beyond;

  p_full : process (turn, beyond_g, beyond_total, beyond_next, beyond_apart) is
  begin

    case turn is

      when "001" =>
        full <= beyond_total;

      when "010" =>
        full <= beyond_next;

      when "100" =>
        full <= beyond_apart;

      when others =>
        full <= beyond_g;

    end case;

  end process p_full;

  -- looked up a clock ahead as well: the sum that makes the time
  p_wanted : process (clk) is
  begin

    if rising_edge(clk) then
      wanted <= SUM_LEAD;

      if (later = '0') then
        wanted <= SUM_BY_NEXT;
      elsif (following = KIND_EDGE) then

        case turn is

          when "001" =>
            wanted <= SUM_APART;

          when "010" =>
            wanted <= SUM_ALONG;

          when "100" =>
            wanted <= SUM_TOTAL;

          when "101" =>
            wanted <= SUM_BY_NEXT;

          when others =>
            null;

        end case;

      elsif (following = KIND_SPOKE) then

        case turn is

          when "001" | "100" =>
            wanted <= SUM_BY_NEXT;

          when "010" | "101" =>
            wanted <= SUM_APART;

          when others =>
            null;

        end case;

      end if;

      -- the first choice
      if (clock = CHOICE_CLOCK - 1) then
        wanted <= SUM_APART;
      end if;
    end if;

  end process p_wanted;

  p_form : process (missing, wanted) is

    variable first  : hexagon_t;
    variable second : hexagon_t;

  begin

    first  := missing.g;
    second := gated(missing.h, to_std_logic(wanted /= SUM_ALONG and wanted /= SUM_TOTAL));

    if (wanted(2) = '1') then
      first := missing.total;
    end if;

    if (wanted = SUM_LEAD) then
      second := missing.total;
    end if;

    form <= moved(resize(first, form_t'length), second, to_std_logic(wanted = SUM_APART));

  end process p_form;

  p_way : process (clk) is

    variable sign : form_t;

  begin

    if rising_edge(clk) then
      if (later = '0') then
        held  <= kind;
        asked <= turn;
        at    <= turn;

        -- the leading vector alone lies on its own spoke
        if (kind = KIND_ALONE) then
          at <= "000";
        end if;

        sign := (others => to_std_logic(kind = KIND_SPOKE and (turn = "010" or turn = "011" or turn = "100")));
        way  <= shift_left(resize(form xor sign, WAY_BITS), 1);

        if (kind = KIND_EDGE) then
          way <= shift_left(resize(form, WAY_BITS), 1) + 2 ** (WHOLE_BIT - 1);

          if (turn = "011") then
            way <= resize(form, WAY_BITS) + 2 ** (WHOLE_BIT - 1);
          end if;
        end if;

        -- the first choice: no other vector than the leading one, or zero voltage
        if (slot = 0) then
          way            <= (others => '0');
          way(WHOLE_BIT) <= not idle;
        end if;
      end if;
    end if;

  end process p_way;

  p_part : process (way) is
  begin

    part <= unsigned(way(WHOLE_BIT downto 0));

    if (way(WAY_BITS - 1) = '1') then
      part <= (others => '0');
    elsif (way(WAY_BITS - 2 downto WHOLE_BIT) /= 0) then
      part            <= (others => '0');
      part(WHOLE_BIT) <= '1';
    end if;

  end process p_part;

  ---------------------------------------------------------------------------------------------
  -- Residues: e less the point
  ---------------------------------------------------------------------------------------------

  p_residues : process (clk) is

    variable turned : std_logic; -- the point's coordinate is negative, or falls with the time
    variable fine   : fine_t;
    variable taken  : fine_t;

  begin

    if rising_edge(clk) then
      residue_s <= std_logic_vector(signed(residue_g) + signed(residue_h));

      if (later = '1') then
        -- along the leading vector
        fine   := shift_left(resize(missing.g, FINE_WIDTH), 2);
        taken  := signed(resize(part, FINE_WIDTH));
        turned := to_std_logic(at = "010" or at = "011");

        if (held = KIND_EDGE) then
          if (turned = '1') then
            fine  := with_wholes(fine, "01");
            taken := shift_left(taken, 1);
          elsif (at = "101") then
            fine := with_wholes(fine, "11");
          end if;

          taken := gated(taken, to_std_logic(at /= "101"));
          fine  := moved(fine, taken, '1');
        else
          taken := gated(taken, to_std_logic(at /= "001" and at /= "100"));
          fine  := moved(fine, taken, not turned);
        end if;

        residue_g <= residue_word(fine);

        -- along the next one
        fine   := shift_left(resize(missing.h, FINE_WIDTH), 2);
        taken  := signed(resize(part, FINE_WIDTH));
        turned := at(2);

        if (held = KIND_EDGE) then
          if (at /= "011") then
            fine := with_wholes(fine, (not turned) & '1');
          end if;

          turned := not turned;
        end if;

        taken     := gated(taken, to_std_logic(at /= "000" and at /= "011"));
        fine      := moved(fine, taken, not turned);
        residue_h <= residue_word(fine);

        if (held = KIND_INSIDE) then
          residue_g <= (others => '0');
          residue_h <= (others => '0');
        end if;
      end if;
    end if;

  end process p_residues;

  residues.along  <= residue_g;
  residues.beside <= residue_h;
  residues.total  <= residue_s;

  ---------------------------------------------------------------------------------------------
  -- Comparison
  ---------------------------------------------------------------------------------------------

  p_better : process (active, later, slot, method, sum, least) is
  begin

    better <= '0';

    if (active = '1' and later = '0' and slot >= SLOTS_BEHIND
        and unsigned(sum(DISTANCE_WIDTH - 1 downto 0)) < least) then
      better <= '1';
    end if;

    -- MPFC3 has a second vector always; MPC2 has fewer
    if ((method = FAMILY_MPFC3 and slot = SLOTS_BEHIND)
        or (method = FAMILY_MPC2 and slot >= SLOTS_BEHIND + NEAR_CHOICES)) then
      better <= '0';
    end if;

  end process p_better;

  p_best : process (clk) is

    variable other       : vector_t;
    variable from_leader : switches_t;
    variable from_ended  : switches_t;

  begin

    if rising_edge(clk) then
      if (active = '1' and later = '1') then
        other := turned(leader, asked);

        if (method /= FAMILY_MPFC3) then
          if (slot = 0) then
            other := row;
          elsif (slot = 1 and idle = '0') then
            other := (others => zero_is_u_7(row));
          end if;
        end if;

        founds(1).other  <= other;
        founds(1).beside <= to_std_logic(asked = "001" or asked = "100");
        founds(1).part   <= std_logic_vector(part(WHOLE_BIT downto TIME_SHIFT));
        founds(1).kind   <= held;

        for n in 2 to SLOTS_BEHIND loop
          founds(n) <= founds(n - 1);
        end loop;

        -- both stand at most one leg apart: it is fewer where the inverter has the choice's state in that leg
        from_leader     := switches_of_vector(founds(1).other) xor switches_of_vector(leader);
        from_ended      := switches_of_vector(founds(1).other) xor switches_of_vector(ended);
        founds(2).fewer <= to_std_logic((from_leader and not from_ended) /= "000");
      end if;

      if (better = '1') then
        least          <= unsigned(sum(DISTANCE_WIDTH - 1 downto 0));
        nearest        <= founds(SLOTS_BEHIND);
        nearest.number <= std_logic_vector(to_unsigned(slot - SLOTS_BEHIND, 3));
      end if;

      -- before the first comparison: farther than any
      if (clock = CHOICE_CLOCK - 1) then
        least <= (others => '1');
      end if;
    end if;

  end process p_best;

  best <= nearest;

end architecture rtl;
