-- Keeps the best of all candidates of a node: the smallest cost, or the least excess in a deadlock.
--
-- As long as nothing is feasible, the candidate of the smallest rank by the deadlock rule is kept. The
-- first feasible one replaces it, and then the smallest cost counts. A tie goes to the candidate that
-- comes first in the order of enumeration.
--
-- Candidates of one node come in that order, so that the earlier one stays. Leaves of the second level
-- do not: they are compared by cost, place, then whether a value saturated.
-- Formats: ranks as in result_t.
-- Latency: one clock from a candidate to result. result is valid while last and settled are '1'.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.explorer_types.all;
  use work.mpdcc_types.all;

entity best_of is
  generic (
    SECOND_LEVEL : boolean := false -- true: candidates come in any order
  );
  port (
    clk          : in    std_logic; -- rising edge
    rst          : in    std_logic; -- synchronous, active high
    dead         : in    dead_t;    -- a candidate as the deadlock rule compares it
    costed       : in    costed_t;  -- a candidate with its cost, some clocks later
    index        : in    index_t;   -- its place
    reached      : in    reached_t; -- how the node of the candidates was reached
    settled      : in    std_logic; -- '1': no candidate is under way
    last         : in    std_logic; -- '1': no candidate of this node is left
    result_valid : out   std_logic; -- '1': result is new
    result_ready : in    std_logic; -- '1': result is taken in this clock
    result       : out   result_t;  -- the best of all candidates since the last result
    waiting      : out   std_logic  -- '1': a candidate has come since the last result
  );
end entity best_of;

architecture rtl of best_of is

  subtype key_t is unsigned(RANK_WIDTH + INDEX_WIDTH downto 0);

  -- '1' where a < b: the carry of b + not a, whose LUTs have room for the choice of a
  function is_below (a, b : unsigned) return std_logic is

    variable sum : unsigned(b'length downto 0);

  begin

    sum := resize(b, sum'length) + resize(not a, sum'length);
    return sum(sum'high);

  end function is_below;

  signal flagged   : std_logic;
  signal contender : rank_t;    -- what the best so far is compared with
  signal key_now   : key_t;     -- leaves of one node tell each other apart by their flags alone
  signal key_best  : key_t;
  signal smaller   : std_logic; -- '1': the contender comes before the best so far

  signal any      : std_logic;
  signal best     : result_t;
  signal reported : std_logic;

begin

  flagged <= costed.saturated or reached.saturated;

  -- one comparison serves both rules: as long as nothing is feasible excesses are compared, then costs
  contender <= resize(costed.cost, RANK_WIDTH) when best.feasible = '1' else
               dead.rank;

  -- candidates of a node come in order, but nodes do not
  g_ties : if SECOND_LEVEL generate
    key_now  <= contender & unsigned(index) & flagged when best.feasible = '1' else
                contender & best.index & best.saturated;
    key_best <= best.rank & best.index & best.saturated;
    smaller  <= is_below(key_now, key_best);
  end generate g_ties;

  g_in_order : if not SECOND_LEVEL generate
    smaller <= is_below(contender, best.rank);
  end generate g_in_order;

  p_best : process (clk) is
  begin

    if rising_edge(clk) then
      -- of use where nothing is feasible
      if (dead.valid = '1') then
        any <= '1';

        if (best.feasible = '0' and (any = '0' or smaller = '1')) then
          best.saturated <= '0';
          best.index     <= unsigned(dead.index);
          best.length    <= (others => '0');
          best.rank      <= dead.rank;
        end if;
      end if;

      if (costed.feasible = '1' and (best.feasible = '0' or smaller = '1')) then
        best.feasible  <= '1';
        best.saturated <= flagged;
        best.index     <= unsigned(index);
        best.length    <= costed.length;
        best.rank      <= resize(costed.cost, RANK_WIDTH);

        if (reached.second = '1') then
          best.length <= reached.length;
        end if;
      end if;

      if (rst = '1' or (reported = '1' and result_ready = '1')) then
        any           <= '0';
        best.feasible <= '0';
      end if;
    end if;

  end process p_best;

  reported     <= any and settled and last;
  result_valid <= reported;
  result       <= best;
  waiting      <= any;

end architecture rtl;
