-- The decision and its pulse: s(k-1) is kept, or a candidate is decided for.
--
-- Formats: see decision_t.
-- Latency: one clock from hold or decide to valid.
-- Overflow: none; saturated passes on what was flagged before.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.mpdcc_math.all;
  use work.mpdcc_types.all;

entity decision_register is
  port (
    clk       : in    std_logic;   -- rising edge
    rst       : in    std_logic;   -- synchronous, active high
    previous  : in    positions_t; -- s(k-1)
    hold      : in    std_logic;   -- '1' for one clock: keep s(k-1)
    decide    : in    std_logic;   -- '1' for one clock: decide for choice
    choice    : in    result_t;    -- best candidate, with decide
    saturated : in    std_logic;   -- '1': a value did not fit its word; with hold or decide
    exhausted : in    std_logic;   -- '1': the budget ended the search; with decide
    valid     : out   std_logic;   -- '1' for one clock: decision is new
    decision  : out   decision_t   -- stable until the next valid
  );
end entity decision_register;

architecture rtl of decision_register is

  -- the decision to hold s(k-1)
  function kept (last : positions_t; flag : std_logic) return decision_t is

    variable result : decision_t;

  begin

    result.position  := last;
    result.held      := '1';
    result.deadlock  := '0';
    result.length    := (others => '0');
    result.saturated := flag;
    result.exhausted := '0';
    return result;

  end function kept;

  -- the decision for a candidate
  function decided (
    best : result_t;
    last : positions_t;
    flag : std_logic;
    cut  : std_logic
  ) return decision_t is

    variable result : decision_t;

  begin

    for x in 0 to 2 loop
      result.position(x) := next_position(last(x), choice_of(best.index, x));
    end loop;

    result.held      := '0';
    result.deadlock  := not best.feasible;
    result.length    := best.length;
    result.saturated := flag or best.saturated;
    result.exhausted := cut;
    return result;

  end function decided;

begin

  p_decision : process (clk) is
  begin

    if rising_edge(clk) then
      valid <= hold or decide;

      if (hold = '1') then
        decision <= kept(previous, saturated);
      end if;

      if (decide = '1') then
        decision <= decided(choice, previous, saturated, exhausted);
      end if;

      if (rst = '1') then
        valid <= '0';
      end if;
    end if;

  end process p_decision;

end architecture rtl;
