-- Takes the explorers' results, one a clock, and keeps the best.
--
-- The lowest-numbered explorer with a result is first. Ties go to the earliest candidate, in whatever order
-- results arrive (see better). With several fast explorers, or with two levels, a register stands between the results
-- and the comparison; the clock needs it. A single fast explorer that searches one level has one result (ONE_RESULT).
-- Two levels (two_levels): leaves of the root come one by one (whole), before the root's own result. Of the other
-- results those are compared that come while leaves are searched and are feasible. The root's own result is that of
-- explorer 0, which alone searches it. If no leaf is feasible, it is the decision (adopt).
--
-- Formats: see result_t.
-- Latency: results are taken at once; best counts a result one clock later, two with REGISTERED.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_math.all;
  use work.mpdcc_types.all;

entity result_collector is
  generic (
    EXPLORERS  : positive range 1 to 8 := 2;   -- number of explorers
    REGISTERED : boolean               := true; -- true: a register before the comparison
    ONE_RESULT : boolean               := false -- true: one result comes for a decision, nothing is compared
  );
  port (
    clk          : in    std_logic;                                -- rising edge
    rst          : in    std_logic;                                -- synchronous, active high
    clear        : in    std_logic;                                -- '1': no result is known
    result_valid : in    std_logic_vector(EXPLORERS - 1 downto 0); -- '1': explorer has a result
    result_ready : out   std_logic_vector(EXPLORERS - 1 downto 0); -- one-hot: whose result is taken
    results      : in    results_t(0 to EXPLORERS - 1);            -- of every explorer
    two_levels   : in    std_logic;                                -- '1': two levels, without ONE_RESULT; stable
    leaves       : in    std_logic;                                -- '1': leaves are searched
    whole        : in    std_logic;                                -- '1': what is evaluated is a leaf of the root
    evaluated    : in    evaluated_t;                              -- by explorer 0
    adopt        : in    std_logic;                                -- '1': explorer 0's, if none; not right behind whole
    best         : out   result_t                                  -- the best so far; feasible is '0' after clear
  );
end entity result_collector;

architecture rtl of result_collector is

  signal take    : std_logic_vector(EXPLORERS - 1 downto 0);
  signal takes   : std_logic;
  signal chosen  : result_t;
  signal offers  : std_logic; -- '1': offered may be the best
  signal offered : result_t;  -- the result that is taken, or a leaf of the root
  signal arrival : result_t;  -- the result to compare
  signal compare : std_logic; -- '1': compare it
  signal smaller : std_logic; -- '1': it is better than what is kept
  signal any     : std_logic; -- '1': kept holds a result
  signal kept    : result_t;

  signal whole_arrives : std_logic; -- '1': a leaf of the root is evaluated, and counts

begin

  assert not ONE_RESULT or EXPLORERS = 1
    report "result_collector: several explorers have several results, ONE_RESULT needs EXPLORERS = 1"
    severity failure;

  take         <= first_of(result_valid);
  takes        <= to_std_logic(take /= (take'range => '0'));
  result_ready <= take;

  p_choose : process (take, results) is
  begin

    chosen <= results(0);

    for i in 1 to EXPLORERS - 1 loop
      if (take(i) = '1') then
        chosen <= results(i);
      end if;
    end loop;

  end process p_choose;

  whole_arrives <= whole and two_levels;

  p_offer : process (takes, chosen, two_levels, whole_arrives, leaves, evaluated) is
  begin

    offers  <= takes;
    offered <= chosen;

    if (two_levels = '1') then
      offers <= whole_arrives or (takes and chosen.feasible and leaves);
    end if;

    if (whole_arrives = '1') then
      offered.feasible  <= '1';
      offered.saturated <= evaluated.saturated;
      offered.index     <= evaluated.index;
      offered.length    <= evaluated.length;
      offered.rank      <= resize(evaluated.cost, RANK_WIDTH);
    end if;

  end process p_offer;

  g_registered : if REGISTERED generate

    p_arrived : process (clk) is
    begin

      if rising_edge(clk) then
        compare <= offers;
        arrival <= offered;

        if (rst = '1') then
          compare <= '0';
        end if;
      end if;

    end process p_arrived;

  end generate g_registered;

  g_direct : if not REGISTERED generate
    compare <= offers;
    arrival <= offered;
  end generate g_direct;

  smaller <= '1' when ONE_RESULT else
             not any or better(arrival, kept);

  p_best : process (clk) is
  begin

    if rising_edge(clk) then
      if (compare = '1' and smaller = '1') then
        kept <= arrival;
        any  <= '1';
      end if;

      if (adopt = '1' and any = '0') then
        kept <= results(0);
      end if;

      if (clear = '1') then
        any           <= '0';
        kept.feasible <= '0';
      end if;
    end if;

  end process p_best;

  best <= kept;

end architecture rtl;
