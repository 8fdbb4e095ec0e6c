-- Records between the second level and the units around it.
--
-- The second level stands between common_terms, node_preparation and the explorers. It tells each what
-- comes next and hears from each what is complete. See second_level.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_constants.all;
  use work.mpdcc_types.all;

package second_level_types is

  -- where a decision is

  type level_phase_t is record
    idle       : std_logic; -- '1': no decision is under way
    probing    : std_logic; -- '1': the probe of the node of k is under way
    predicting : std_logic; -- '1': the node is taken on to k+1
    leaves     : std_logic; -- '1': nodes of the second level are searched
  end record level_phase_t;

  -- what the search starts from; stable while a decision is under way

  type level_start_t is record
    previous : positions_t;                         -- s(k-1)
    negative : std_logic_vector(2 downto 0);        -- '1': negative phase current, a in bit 0
    horizon  : length_t;                            -- N, steps
    budget   : unsigned(BUDGET_WIDTH - 1 downto 0); -- candidates, 0: no limit
  end record level_start_t;

  -- what the second level tells the scheduler

  type level_report_t is record
    settle    : std_logic; -- '1' for one clock: the node of k+1 is complete
    unfit     : std_logic; -- '1': the state of k+1 does not fit its words and is not predicted
    saturated : std_logic; -- '1': a value of the node of k+1 saturated
    whole     : std_logic; -- '1': what is evaluated is a leaf of the root
    over      : std_logic; -- '1': no more leaves will come
    cut       : std_logic; -- '1': the budget has run out
  end record level_report_t;

  -- without a second level
  constant LEVEL_NONE : level_report_t := (
    settle    => '0',
    unfit     => '0',
    saturated => '0',
    whole     => '0',
    over      => '1',
    cut       => '0'
  );

  -- words of the common terms before they are turned into phases, RESULT_* order

  subtype words_t is std_logic_vector(RESULT_COUNT * TERM_WIDTH - 1 downto 0);

  -- L1, then with the signs of the slopes of v_ph_a, v_ph_b, v_ph_c and v_n, or 0; steps, signed

  constant SIGNED_LENGTHS : natural := 5;

  subtype signed_lengths_t is std_logic_vector(SIGNED_LENGTHS * (LENGTH_WIDTH + 1) - 1 downto 0);

  -- operands A of a successor, signed, BASE order

  subtype base_words_t is std_logic_vector(BASE_COUNT * OPERAND_WIDTH - 1 downto 0);

  subtype term_t is signed(TERM_WIDTH - 1 downto 0);

  type plane_t is array (0 to 1) of term_t; -- alpha, beta

  -- to common_terms: a successor of the node

  type successor_t is record
    advance    : std_logic;        -- '1' for one clock: begin with a successor
    lengths    : signed_lengths_t; -- L1 and its signed forms, stable until it is complete
    base       : base_words_t;     -- operands A
    slope      : plane_t;          -- its natural slope, trajectory units per step
    show_slope : std_logic;        -- '1': node.slope becomes the successor's
    show_error : std_logic;        -- '1': node.error of i_a, i_b becomes the successor's, i_c's a clock later
  end record successor_t;

  -- without a second level
  constant SUCCESSOR_NONE : successor_t := (
    advance    => '0',
    lengths    => (others => '0'),
    base       => (others => '0'),
    slope      => (others => (others => '0')),
    show_slope => '0',
    show_error => '0'
  );

  -- of common_terms: how far the node is, and what a successor has become

  type terms_progress_t is record
    issued     : std_logic; -- '1' for one clock: the last product is issued, five clocks before done
    capacitors : std_logic; -- pulse: phase_current and neutral_current are valid from the next clock
    done       : std_logic; -- '1' for one clock: node is new
    saturated  : std_logic; -- '1': a result of this node saturated
    advanced   : std_logic; -- '1' for one clock: every word of the successor is new
    overflowed : std_logic; -- '1': one of them saturated, valid from the clock after advanced on
  end record terms_progress_t;

  -- to node_preparation: when it begins, and with which node

  type preparation_t is record
    capacitors : std_logic; -- '1' for one clock: begin with the capacitors' lines, their terms are complete with it
    successor  : std_logic; -- with capacitors: those of a successor
    bank       : std_logic; -- with capacitors: which table
    turn       : std_logic; -- '1' for one clock: begin with the thresholds
    show_turn  : std_logic; -- '1': band.turn becomes theirs, c's a clock later
  end record preparation_t;

  -- a node of the second level before its state is computed

  type entry_t is record
    index    : unsigned(INDEX_WIDTH - 1 downto 0);  -- place of s1
    position : positions_t;                         -- s1
    effort   : unsigned(EFFORT_WIDTH - 1 downto 0); -- f_s
    length   : length_t;                            -- L1, steps
    slope    : start_slopes_t;                      -- of the current errors at the root under s1
  end record entry_t;

  -- a node from the begin of its program until its leaves are handed out

  type visit_t is record
    index    : unsigned(INDEX_WIDTH - 1 downto 0);  -- place of s1
    position : positions_t;                         -- s1
    effort   : unsigned(EFFORT_WIDTH - 1 downto 0); -- f_s of s1
    length   : length_t;                            -- L1, steps
    bank     : std_logic;                           -- table of the capacitors
  end record visit_t;

  -- positions that the first phases can take after a position, all combinations; 64 at most.
  -- The result is less by a constant.
  function combinations (position : positions_t; phases : positive; less : natural := 0) return unsigned;

end package second_level_types;

package body second_level_types is

  -- some position has two next positions alone

  function has_twos return boolean is

    variable result : boolean;

  begin

    result := false;

    for s in NEXT_LAST'range loop
      result := result or NEXT_LAST(s) = 1;
    end loop;

    return result;

  end function has_twos;

  function combinations (position : positions_t; phases : positive; less : natural := 0) return unsigned is

    variable twos   : unsigned(1 downto 0);
    variable fours  : unsigned(1 downto 0);
    variable count  : natural;
    variable result : unsigned(BUDGET_WIDTH - 1 downto 0);

  begin

    -- phases with two and with four next positions; the others have three
    twos  := "00";
    fours := "00";

    for x in 0 to phases - 1 loop
      if (NEXT_LAST(to_integer(position(x))) = 3) then
        fours := fours + 1;
      end if;

      if (has_twos) then
        if (NEXT_LAST(to_integer(position(x))) = 1) then
          twos := twos + 1;
        end if;
      end if;
    end loop;

    result := (others => '0');

    for j in 0 to phases loop
      if (twos = j) then

        for i in 0 to phases - j loop
          count := 1;

          for x in 1 to phases loop
            if (x <= i) then
              count := count * 4;
            elsif (x <= i + j) then
              count := count * 2;
            else
              count := count * 3;
            end if;
          end loop;

          if (fours = i) then
            result := to_unsigned(count - less, BUDGET_WIDTH);
          end if;
        end loop;

      end if;
    end loop;

    return result;

  end function combinations;

end package body second_level_types;
