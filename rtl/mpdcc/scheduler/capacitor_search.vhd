-- Lengths and excesses of v_n and the phase capacitor voltages, for every position at once.
--
-- A phase capacitor's trajectory depends on the phase and on whether its position charges it,
-- discharges it or neither. That of v_n depends on which phases are connected to the neutral point.
-- So 9 + 8 straight lines serve all candidates of a node. They pass one pipeline, one line a clock.
-- Those of s(k-1) come first, so that the hold test has its answer early.
--
--   stage 0    which line, and the current term that it is made of
--   stage 1    slope of the line, one less where it is a complement; error at k
--   stage 2    the slope itself; room in its direction, error at k+1
--   stage 3-5  two bits of the length each: room - 2**m * abs(slope) >= 0
--
-- Formats: trajectory units; rows of the table as capacitor_t says.
-- Latency: held is valid 8 clocks after start, the last of the 17 rows is out 23 clocks after
-- start; initiation interval of a node 18 clocks.
-- Successors: the phases' lines without current and the neutral point without a phase do not move,
-- so 13 lines remain, out 7 to 19 clocks after start; a node follows another after 16 clocks.
-- Without phase capacitors their lines are left out: 8 for a root, 7 for a successor; rows are out 9 and 6 clocks
-- earlier.
-- For a root alone (without SECOND_LEVEL) each line then takes three clocks: held is valid 6 clocks after start, the
-- last of 8 rows is out 28 clocks after start.
-- Without a neutral point its lines are left out too.
-- Rule inwards (INWARDS, chosen with limits.outside_inwards): a line that starts outside and moves inwards
-- has the length up to the bound on the other side, instead of none. What BASE_WIDTH bits do not hold has none.
-- Overflow: none; abs(slope) has no more bits than a bound.
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

entity capacitor_search is
  generic (
    SECOND_LEVEL : boolean := false; -- true: successors, whose terms are complete a clock later
    INWARDS      : boolean := false  -- true: the rule inwards besides
  );
  port (
    clk      : in    std_logic;   -- rising edge
    rst      : in    std_logic;   -- synchronous, active high
    start    : in    std_logic;   -- '1' for one clock: begin
    limits   : in    limits_t;    -- bounds and horizon, stable
    node     : in    node_t;      -- errors of the capacitor voltages and current terms, stable
    previous : in    positions_t; -- s(k-1), stable
    successor : in   std_logic; -- with start: only lines with a current; the others are the root's
    bank     : in    std_logic; -- with start: which table
    held     : out   std_logic;   -- '1': the lines of s(k-1) are inside at k+1; see latency
    ready    : out   std_logic;   -- '1': the last row is out 6 clocks later, 8 where a line takes three clocks
    entry    : out   capacitor_t  -- rows of the table as they come
  );
end entity capacitor_search;

architecture rtl of capacitor_search is

  constant CAPACITORS : natural := 3 * boolean'pos(HAS_CAPACITORS);
  constant NEUTRALS   : natural := boolean'pos(HAS_NEUTRAL);

  -- first line of each kind, see p_which
  constant OTHER_KINDS    : natural := CAPACITORS + NEUTRALS;
  constant LAST_KINDS     : natural := OTHER_KINDS + CAPACITORS;
  constant OTHER_PATTERNS : natural := LAST_KINDS + CAPACITORS;
  constant CHARGED        : natural := OTHER_PATTERNS + 7 * NEUTRALS;
  constant DISCHARGED     : natural := CHARGED + CAPACITORS;
  constant ALL_PATTERNS   : natural := DISCHARGED + CAPACITORS;
  constant LINES          : natural := ALL_PATTERNS + 7 * NEUTRALS; -- of root and successor; idle

  -- what is outside has more room than the band
  constant ROOM_WIDTH : natural := BOUND_WIDTH + choose(INWARDS, 1, 0);

  -- lines of the neutral point alone are few: each takes three clocks, and one stage finds its length
  constant IN_TURN : boolean := not HAS_CAPACITORS and not SECOND_LEVEL;
  constant LAST    : natural := choose(IN_TURN, 3, CAPACITOR_STAGES); -- stage that completes a length

  subtype room_t is unsigned(ROOM_WIDTH + choose(IN_TURN, 4, 0) - 1 downto 0);

  subtype pace_t is unsigned(BOUND_WIDTH - 1 downto 0);

  type rooms_t is array (2 to CAPACITOR_STAGES) of room_t;

  type paces_t is array (2 to CAPACITOR_STAGES) of pace_t;

  type rows_t is array (2 to CAPACITOR_STAGES) of capacitor_row_t;

  type lengths_t is array (2 to CAPACITOR_STAGES) of length_t;

  type ends_t is array (2 to CAPACITOR_STAGES) of trajectory_t;

  subtype phase_t is natural range 0 to 3; -- 3: neutral point

  -- the current term that a line's slope is made of
  function term_of (terms : node_t; phase : phase_t; single : std_logic_vector(2 downto 0)) return current_term_t is

    variable result : current_term_t;

  begin

    result := (others => '0');

    for x in 0 to 2 loop
      if (phase = x) then
        result := result or terms.phase_current(x);
      end if;

      if (phase = 3 and single(x) = '1') then
        result := result or terms.neutral_current(x);
      end if;
    end loop;

    return result;

  end function term_of;

  -- which of all current terms that is: the neutral point's of phase a, b, c, then a phase's
  function select_of (phase : phase_t; single : std_logic_vector(2 downto 0)) return std_logic_vector is

    variable result : std_logic_vector(5 downto 0);

  begin

    for x in 0 to 2 loop
      result(x)     := to_std_logic(phase = 3) and single(x);
      result(3 + x) := to_std_logic(phase = x);
    end loop;

    return result;

  end function select_of;

  -- term_of, decoded before
  function selected_term (terms : node_t; selects : std_logic_vector(5 downto 0)) return current_term_t is

    variable result : current_term_t;

  begin

    result := (others => '0');

    for x in 0 to 2 loop
      result := result or gated(terms.neutral_current(x), selects(x)) or gated(terms.phase_current(x), selects(3 + x));
    end loop;

    return result;

  end function selected_term;

  signal line      : natural range 0 to LINES; -- LINES: idle
  signal beat      : natural range 0 to 2;     -- clock of the line, with IN_TURN
  signal valid     : std_logic_vector(0 to CAPACITOR_STAGES);
  signal first     : std_logic_vector(0 to 2);     -- '1': a line of s(k-1)
  signal phase_0   : phase_t;
  signal kind_0    : unsigned(1 downto 0);
  signal pattern_0 : std_logic_vector(2 downto 0);
  signal flips     : unsigned(2 downto 0);         -- how the next pattern differs from that of s(k-1)
  signal bank_now  : std_logic;
  signal bank_row  : std_logic_vector(1 to CAPACITOR_STAGES);

  signal early_0    : current_term_t; -- term of the line, registered
  signal term_0     : current_term_t; -- the same, or selected a clock later
  signal selects_0  : std_logic_vector(5 downto 0); -- which term, with SECOND_LEVEL alone
  signal moves_0    : std_logic;      -- '0': the line has no slope
  signal opposite_0 : std_logic;      -- '1': the slope is the term's complement
  signal negative_0 : std_logic;      -- '1': and one more

  signal slope_1 : signed(CURRENT_TERM_WIDTH downto 0); -- the slope, or one less
  signal more_1  : std_logic;                           -- '1': one less
  signal error_1 : trajectory_t;
  signal row_1   : capacitor_row_t;
  signal bound_1 : bound_t; -- by the row

  signal room_2   : room_t;
  signal pace_2   : pace_t;
  signal excess_2 : trajectory_t;
  signal inside_2 : std_logic;
  signal alive_2  : std_logic; -- inside, or on its way in
  signal row_2    : capacitor_row_t;

  signal room      : rooms_t;
  signal pace      : paces_t;
  signal length    : lengths_t;
  signal is_inside : std_logic_vector(2 to CAPACITOR_STAGES);
  signal alive     : std_logic_vector(2 to CAPACITOR_STAGES);
  signal excess    : ends_t;
  signal row       : rows_t;
  signal passed    : std_logic;

begin

  assert CURRENT_TERM_WIDTH <= BOUND_WIDTH
    report "capacitor_search: the magnitude of a slope has more bits than a bound"
    severity failure;

  -- between the node's registers and the sum of stage 1, where the node is complete that early
  g_early : if not SECOND_LEVEL generate
    term_0 <= early_0;
  end generate g_early;

  g_late : if SECOND_LEVEL generate
    term_0 <= selected_term(node, selects_0);
  end generate g_late;

  p_lines : process (clk) is
  begin

    if rising_edge(clk) then
      valid <= to_std_logic(line /= LINES) & valid(0 to CAPACITOR_STAGES - 1);

      if (beat = 2 or not IN_TURN) then
        beat <= 0;

        if (line = CHARGED - 1) then
          line <= LINES;
        elsif (line /= LINES) then
          line <= line + 1;
        end if;

        if ((line >= OTHER_PATTERNS and line < CHARGED) or line >= ALL_PATTERNS) then
          flips <= flips + 1;
        else
          flips <= "001";
        end if;
      else
        beat <= beat + 1;
      end if;

      if (start = '1') then
        line     <= 0;
        beat     <= 0;
        bank_now <= bank;

        if (successor = '1') then
          line <= CHARGED;
        end if;

        -- no line of a capacitor comes before the patterns of a successor
        if (SECOND_LEVEL and not HAS_CAPACITORS) then
          flips <= "001";
        end if;
      end if;

      if (rst = '1') then
        line  <= LINES;
        valid <= (others => '0');
      end if;
    end if;

  end process p_lines;

  -- stage 0
  --   root        0 to 2    phases as at s(k-1)
  --               3         neutral point as at s(k-1)
  --               4 to 9    the phases' other two kinds
  --               10 to 16  the other patterns of the neutral point
  --   successor   17 to 22  both kinds with a current, of each phase
  --               23 to 29  all patterns but none
  p_which : process (clk) is

    variable phase   : phase_t;
    variable pattern : std_logic_vector(2 downto 0);
    variable single  : std_logic_vector(2 downto 0);
    variable kind    : unsigned(1 downto 0);

  begin

    if rising_edge(clk) then
      pattern  := neutral_pattern(previous) xor std_logic_vector(flips);
      phase    := 3;
      kind     := "00";
      first(0) <= to_std_logic(line < OTHER_KINDS);

      if (line >= CHARGED) then
        pattern := std_logic_vector(flips);
      end if;

      if (line < OTHER_PATTERNS) then
        pattern := neutral_pattern(previous);
      end if;

      for x in 0 to CAPACITORS - 1 loop
        if (line = x or line = OTHER_KINDS + x or line = LAST_KINDS + x or line = CHARGED + x
            or line = DISCHARGED + x) then
          phase := x;
          kind  := charge_kind(previous(x));
        end if;
      end loop;

      -- the other two of 0, 1, 2 in turn
      if (line >= OTHER_KINDS and line < LAST_KINDS) then
        kind := kind(0) & (kind(0) nor kind(1));
      elsif (line >= LAST_KINDS and line < OTHER_PATTERNS) then
        kind := (kind(0) nor kind(1)) & kind(1);
      end if;

      if (line >= CHARGED and line < DISCHARGED) then
        kind := "01";
      elsif (line >= DISCHARGED and line < ALL_PATTERNS) then
        kind := "10";
      end if;

      single    := single_of(pattern);
      phase_0   <= phase;
      pattern_0 <= pattern;
      kind_0    <= kind;
      early_0   <= term_of(node, phase, single);

      if (SECOND_LEVEL) then
        selects_0 <= select_of(phase, single);
      end if;

      -- charged, discharged or neither; two phases together are the complement of the third
      if (phase = 3) then
        moves_0    <= to_std_logic(single /= "000");
        opposite_0 <= to_std_logic(single /= pattern);
        negative_0 <= '0';
      else
        moves_0    <= to_std_logic(kind /= "00");
        opposite_0 <= kind(0);
        negative_0 <= kind(0);
      end if;
    end if;

  end process p_which;

  -- stage 1
  p_slope : process (clk) is

    variable term : signed(CURRENT_TERM_WIDTH downto 0);

  begin

    if rising_edge(clk) then
      first(1) <= first(0);

      if (valid(0) = '1') then
        term := resize(term_0, term'length);

        for i in term'range loop
          term(i) := (term(i) xor opposite_0) and moves_0;
        end loop;

        slope_1 <= term;
        more_1  <= negative_0;

        if (phase_0 = 3) then
          error_1 <= node.error(3);
          row_1   <= unsigned'("10") & unsigned(pattern_0);
        else
          for x in 0 to 2 loop
            if (phase_0 = x) then
              error_1 <= node.error(4 + x);
            end if;
          end loop;

          row_1   <= to_unsigned(phase_0, 3) & kind_0;
        end if;
      end if;
    end if;

  end process p_slope;

  -- rows of the neutral point have bit 4
  bound_1 <= limits.bound_neutral when row_1(4) = '1' else
             limits.bound_phase;

  -- stage 2, and whether a line of s(k-1) is outside at k+1
  p_room : process (clk) is

    variable bound   : signed(TRAJECTORY_WIDTH downto 0);
    variable ahead   : signed(TRAJECTORY_WIDTH downto 0); -- room in the slope's direction
    variable behind  : signed(TRAJECTORY_WIDTH downto 0);
    variable sum     : signed(TRAJECTORY_WIDTH downto 0);
    variable error   : trajectory_t;
    variable steep   : unsigned(CURRENT_TERM_WIDTH downto 0);
    variable carry   : unsigned(0 downto 0);
    variable falls   : std_logic; -- either value where the slope is zero: nothing depends on it
    variable moves   : std_logic;
    variable follows : std_logic; -- what is outside behind the slope is on its way in

  begin

    if rising_edge(clk) then
      first(2) <= first(1);

      if (valid(1) = '1' and (beat = 2 or not IN_TURN)) then
        falls  := slope_1(CURRENT_TERM_WIDTH);
        bound  := signed(resize(bound_1, TRAJECTORY_WIDTH + 1));
        ahead  := adjusted(bound, error_1, falls, not falls);
        behind := adjusted(bound, error_1, not falls, falls);
        room_2 <= resize(unsigned(ahead(ROOM_WIDTH - 1 downto 0)), room_2'length);

        -- at most 2 ** (CURRENT_TERM_WIDTH - 1)
        moves := '0';

        for i in slope_1'range loop
          steep(i) := slope_1(i) xor falls;
          moves    := moves or (slope_1(i) xor more_1);
        end loop;

        carry(0) := falls xor more_1;
        pace_2   <= resize(steep + carry, BOUND_WIDTH);

        -- more_1 is the last bit of both summands: one adder
        sum      := (error_1 & more_1) + (slope_1 & more_1);
        error    := sum(TRAJECTORY_WIDTH downto 1);
        excess_2 <= signed(magnitude(error)) - signed(resize(bound_1, TRAJECTORY_WIDTH));
        inside_2 <= not (ahead(TRAJECTORY_WIDTH) or behind(TRAJECTORY_WIDTH));

        follows := to_std_logic(INWARDS) and limits.outside_inwards and moves and not overflows(error_1, BASE_WIDTH);
        alive_2 <= not ahead(TRAJECTORY_WIDTH) and (not behind(TRAJECTORY_WIDTH) or follows);
        row_2    <= row_1;
      end if;

      if (valid(2) = '1' and first(2) = '1' and excess_2 > 0) then
        passed <= '0';
      end if;

      if (start = '1') then
        passed <= '1';
      end if;
    end if;

  end process p_room;

  -- stages 3 to LAST; with IN_TURN the one stage takes a room four times as large in each clock
  room(2)      <= room_2;
  pace(2)      <= pace_2;
  is_inside(2) <= inside_2;
  alive(2)     <= alive_2;
  excess(2)    <= excess_2;
  row(2)       <= row_2;
  length(2)    <= (others => '0');

  g_stages : for i in 3 to LAST generate

    p_length : process (clk) is

      variable left : room_t;
      variable less : signed(ROOM_WIDTH downto 0);
      variable bits : length_t;

    begin

      if rising_edge(clk) then
        if (valid(i - 1) = '1') then
          left := room(i - 1);
          bits := length(i - 1);

          if (IN_TURN and beat /= 0) then
            left := room(i);
          end if;

          for place in 2 * (CAPACITOR_STAGES - i) + 1 downto 2 * (CAPACITOR_STAGES - i) loop
            -- the bits below place are unaffected by 2**place * pace and bypass the subtractor
            less := signed(resize(shift_right(left, place), less'length)) - signed(resize(pace(i - 1), less'length));

            if (less >= 0) then
              left(left'high downto place) := unsigned(less(left'high - place downto 0));
              bits(place)                  := '1';
            end if;
          end loop;

          room(i)   <= left;
          pace(i)   <= pace(i - 1);
          length(i) <= bits;

          if (IN_TURN) then
            room(i)   <= shift_left(left, 2);
            length(i) <= shift_left(length(i), 2) or shift_right(bits, LENGTH_WIDTH - 2);
          end if;

          if (beat = 2 or not IN_TURN) then
            is_inside(i) <= is_inside(i - 1);
            alive(i)     <= alive(i - 1);
            excess(i)    <= excess(i - 1);
            row(i)       <= row(i - 1);
          end if;
        end if;
      end if;

    end process p_length;

  end generate g_stages;

  p_bank : process (clk) is
  begin

    if rising_edge(clk) then
      bank_row <= bank_now & bank_row(1 to CAPACITOR_STAGES - 1);
    end if;

  end process p_bank;

  p_entry : process (valid, beat, row, bank_row, length, is_inside, alive, excess, limits) is
  begin

    entry.write     <= valid(CAPACITOR_STAGES) and to_std_logic(beat = 0 or not IN_TURN);
    entry.row       <= row(LAST);
    entry.bank      <= bank_row(LAST);
    entry.length    <= length(LAST);
    entry.excess    <= excess(LAST);
    entry.is_inside <= is_inside(LAST);

    if (alive(LAST) = '0') then
      entry.length <= (others => '0');
    elsif (length(LAST) > limits.horizon) then
      entry.length <= limits.horizon;
    end if;

  end process p_entry;

  held  <= passed;
  ready <= to_std_logic(line = LINES or (IN_TURN and (line = CHARGED - 1 or (line = CHARGED - 2 and beat > 0))));

end architecture rtl;
