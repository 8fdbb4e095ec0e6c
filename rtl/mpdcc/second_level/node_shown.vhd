-- Delays each field of a node until the pipeline stage that reads it has finished the node before.
--
-- Leaves of one node follow those of another without a gap, so that the early stages already work on
-- the new node while late ones finish the old. A pulse, launch, goes along with the first leaf;
-- a field changes when it reaches the stage before the one that reads it. At the root (follow)
-- every field is passed on at once. Errors and slopes are kept by common_terms, thresholds by
-- node_preparation, on the pulses show_slope and show_error.
--
-- Formats: as node_t and reached_t.
-- Latency: one clock at the root; for a successor 1, 3, 4, 12, 13, 14 and 17 clocks from launch.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_types.all;
  use work.second_level_types.all;

entity node_shown is
  port (
    clk        : in    std_logic;                          -- rising edge
    rst        : in    std_logic;                          -- synchronous, active high
    follow     : in    std_logic;                          -- '1': the root, no leaves are under way
    launch     : in    std_logic;                          -- '1' for one clock: with the first leaf of a node
    node       : in    node_t;                             -- of common_terms
    words      : in    words_t;                            -- of common_terms, RESULT_* order
    lead       : in    length_t;                           -- L1, valid from launch to 13 clocks later
    saturated  : in    std_logic;                          -- '1': a value of the node saturated, likewise
    shown      : out   node_t;                             -- to the explorers
    reached    : out   reached_t;                          -- to the explorers
    show_slope : out   std_logic;                          -- '1': node.slope is to change
    show_error : out   std_logic                           -- '1': current errors and thresholds are to change
  );
end entity node_shown;

architecture rtl of node_shown is

  subtype component_t is signed(WEIGHT_SLOPE_WIDTH - 1 downto 0);

  type weight_plane_t is array (0 to 1) of component_t;

  signal pulse : std_logic_vector(0 to BEST_READ);

  signal forced_neutral : forced_t;
  signal forced_phase   : forced_terms_t;
  signal weight_ahead   : weight_plane_t; -- held before it is turned into phases, a third less
  signal weight         : weight_plane_t;
  signal start_ahead    : weight_t;
  signal start          : weight_t;
  signal lead_late      : length_t;
  signal length_last    : length_t;
  signal saturated_late : std_logic;
  signal saturated_last : std_logic;

begin

  pulse(0) <= launch;

  p_pulse : process (clk) is
  begin

    if rising_edge(clk) then
      pulse(1 to BEST_READ) <= pulse(0 to BEST_READ - 1);

      if (rst = '1') then
        pulse(1 to BEST_READ) <= (others => '0');
      end if;
    end if;

  end process p_pulse;

  show_slope <= pulse(SLOPE_READ);
  show_error <= pulse(ERROR_READ);

  p_shown : process (clk) is
  begin

    if rising_edge(clk) then
      if (follow = '1' or pulse(0) = '1') then
        forced_neutral <= node.forced_neutral;
        forced_phase   <= node.forced_phase;
      end if;

      -- the words last until 4 clocks after launch, so what is read later waits here
      if (follow = '1' or pulse(ERROR_READ) = '1') then
        for x in 0 to 1 loop
          weight_ahead(x) <= signed(word(words, RESULT_WEIGHT_ALPHA + x, TERM_WIDTH)(WEIGHT_SLOPE_WIDTH - 1 downto 0));
        end loop;

        start_ahead <= node.weight_start;
      end if;

      if (follow = '1' or pulse(WEIGHT_READ) = '1') then
        weight <= weight_ahead;
      end if;

      if (follow = '1' or pulse(START_READ) = '1') then
        start <= start_ahead;
      end if;

      if (pulse(LEAD_READ) = '1') then
        lead_late      <= lead;
        saturated_late <= saturated;
      end if;

      -- leaves are compared with the root's candidates' stages, but for what was spent before
      if (follow = '1') then
        lead_late      <= (others => '0');
        saturated_last <= '0';
      end if;

      if (pulse(BEST_READ) = '1') then
        length_last    <= lead_late;
        saturated_last <= saturated_late;
      end if;
    end if;

  end process p_shown;

  p_node : process (node, forced_neutral, forced_phase, weight, start) is
  begin

    shown                <= node;
    shown.forced_neutral <= forced_neutral;
    shown.forced_phase   <= forced_phase;
    shown.weight_start   <= start;

    for x in 0 to 2 loop
      shown.weight_slope(x) <= phase_of(weight(0), weight(1), x);
    end loop;

  end process p_node;

  reached.second    <= not follow;
  reached.lead      <= lead_late;
  reached.length    <= length_last;
  reached.saturated <= saturated_last;

end architecture rtl;
