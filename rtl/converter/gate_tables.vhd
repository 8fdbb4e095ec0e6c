-- Gates of a leg as data: which are on in a position, in what order they change, which may never be
-- on together.
--
-- Five-level ANPC leg: gate S1 is bit 0, S8 bit 7, position s = 4g + 2a + b; S1 and S3 carry g, S2 and
-- S4 its complement, S5 carries a and S8 its complement, S6 carries b and S7 its complement.
-- Two-level leg: bit 0 is the upper gate, bit 1 the lower one, position bit 0 '1': upper.
--
-- Order of an ANPC commutation (2 to 4, 3 to 5: g rises, a falls): S4 off, S8 on, S2 off, S3 on, S5 off,
-- S1 on; back the same in reverse.  With S8 on before S2 goes off the current has a way to go for
-- either sign, the output makes one step, at S2 for i < 0 and at S3 for i > 0, and S1, S4, S5 and S8
-- switch without current.  tb/rtl/guard/gate_guard/test_gate_commutation.py finds this from the circuit.
-- A stop and a start of an ANPC leg take several steps, a dead time apart (tables of anpc5l_leg): the gates at the
-- rails, S1 and S4, go off first and come on last.  All gates off in one clock would put up to 2.6 times its rating
-- on S5 or S8.  A two-level leg takes one step.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.anpc5l_leg.all;

package gate_tables is

  constant TIME_WIDTH  : natural := 12; -- bits of dead and minimum times, clocks
  constant LIMIT_WIDTH : natural := 16; -- bits of decision limit and watchdog, clocks
  constant FAULT_COUNT : natural := 13; -- kinds of faults

  constant FAULT_EXTERNAL     : natural := 0; -- external trip
  constant FAULT_OVER_CURRENT : natural := 1; -- phase current beyond its limit
  constant FAULT_LINK_HIGH    : natural := 2; -- dc-link voltage above its limit
  constant FAULT_LINK_LOW     : natural := 3; -- dc-link voltage below its limit
  constant FAULT_ILLEGAL      : natural := 4; -- no edge of the switch graph
  constant FAULT_LATE         : natural := 5; -- decision too long after its start
  constant FAULT_MISSING      : natural := 6; -- no decision for too long
  constant FAULT_OVERRUN      : natural := 7; -- leg moved while it waits to move
  constant FAULT_INTERLOCK    : natural := 8; -- pattern of gates that may never be

  constant FAULT_CAPACITOR    : natural := 9; -- voltage of a phase capacitor outside its band
  constant FAULT_NEUTRAL      : natural := 10; -- neutral point beyond its limit
  constant FAULT_SPEED        : natural := 11; -- speed beyond its limit
  constant FAULT_FROZEN       : natural := 12; -- the currents have not changed for too many measurements

  -- gates of one leg
  function gates_of (five_level : boolean) return positive;

  -- '1': the switch graph has this edge, staying included
  function is_edge (five_level : boolean; origin, goal : std_logic_vector(2 downto 0)) return std_logic;

  -- gates that are on in a position
  function pattern_of (five_level : boolean; position : std_logic_vector(2 downto 0))
    return std_logic_vector;

  -- number of the last single-gate action of a commutation
  function last_action (five_level : boolean; origin, goal : std_logic_vector(2 downto 0))
    return unsigned;

  -- the gate that an action changes, one bit set
  function action_of (five_level : boolean; origin, goal : std_logic_vector(2 downto 0);
    action : unsigned(2 downto 0)) return std_logic_vector;

  -- gates that a stop leaves on, a dead time after these
  function stop_of (five_level : boolean; gates : std_logic_vector) return std_logic_vector;

  -- '1': a gate at a rail is on; a stop then begins at once, whatever has changed before
  function at_rail (five_level : boolean; gates : std_logic_vector) return std_logic;

  -- number of the last step of a start
  function last_start (five_level : boolean) return natural;

  -- gates of a position that a step of its start turns on
  function start_of (five_level : boolean; position : std_logic_vector(2 downto 0); action : unsigned(2 downto 0))
    return std_logic_vector;

  -- '1': these gates together short a capacitor or the dc-link, or put too much voltage on a device
  function is_forbidden (five_level : boolean; gates : std_logic_vector) return std_logic;

end package gate_tables;

package body gate_tables is

  type order_t is array (0 to 5) of natural range 0 to 7;

  -- g rises; indices of bits, S1 is 0
  constant RISING : order_t := (3, 7, 1, 2, 4, 0);

  function gates_of (five_level : boolean) return positive is
  begin

    if (five_level) then
      return 8;
    else
      return 2;
    end if;

  end function gates_of;

  function is_edge (five_level : boolean; origin, goal : std_logic_vector(2 downto 0)) return std_logic is

    variable result : std_logic;

  begin

    result := '0';

    if (five_level) then

      for s in 0 to 7 loop
        for i in 0 to 3 loop
          if (unsigned(origin) = s and unsigned(goal) = NEXT_POSITIONS(s, i)) then
            result := '1';
          end if;
        end loop;
      end loop;

    else
      result := '1';
    end if;

    return result;

  end function is_edge;

  function pattern_of (five_level : boolean; position : std_logic_vector(2 downto 0))
    return std_logic_vector is

    variable g : std_logic;
    variable a : std_logic;
    variable b : std_logic;

  begin

    g := position(2);
    a := position(1);
    b := position(0);

    if (five_level) then
      return (not a) & (not b) & b & a & (not g) & g & (not g) & g;
    else
      return (not b) & b;
    end if;

  end function pattern_of;

  function last_action (five_level : boolean; origin, goal : std_logic_vector(2 downto 0))
    return unsigned is
  begin

    if (five_level and origin(2) /= goal(2)) then
      return "101";
    else
      return "001";
    end if;

  end function last_action;

  function action_of (five_level : boolean; origin, goal : std_logic_vector(2 downto 0);
    action : unsigned(2 downto 0)) return std_logic_vector is

    variable result : std_logic_vector(gates_of(five_level) - 1 downto 0);
    variable second : std_logic;

  begin

    result := (others => '0');
    second := action(0);

    if (not five_level) then
      -- the gate that is on goes off first
      result(0) := origin(0) xor second;
      result(1) := not (origin(0) xor second);
    elsif (origin(2) /= goal(2)) then

      for i in 0 to 5 loop
        if (goal(2) = '1' and action = i) then
          result(RISING(i)) := '1';
        end if;

        if (goal(2) = '0' and action = 5 - i) then
          result(RISING(i)) := '1';
        end if;
      end loop;

    elsif (origin(1) /= goal(1)) then
      result(4) := origin(1) xor second;
      result(7) := not (origin(1) xor second);
    else
      result(5) := origin(0) xor second;
      result(6) := not (origin(0) xor second);
    end if;

    return result;

  end function action_of;

  function stop_of (five_level : boolean; gates : std_logic_vector) return std_logic_vector is

    variable s      : std_logic_vector(gates'length - 1 downto 0);
    variable result : std_logic_vector(gates'length - 1 downto 0);

  begin

    s      := gates;
    result := (others => '0');

    if (five_level) then
      -- the first row that fits is the last to be looked at
      for i in STOP_RULES'high(1) downto 0 loop
        if ((s and STOP_RULES(i, 0)) = STOP_RULES(i, 0) and unsigned(s and STOP_RULES(i, 1)) = 0) then
          result := s xor STOP_RULES(i, 2);
        end if;
      end loop;

    end if;

    return result;

  end function stop_of;

  function at_rail (five_level : boolean; gates : std_logic_vector) return std_logic is

    variable s      : std_logic_vector(gates'length - 1 downto 0);
    variable result : std_logic;

  begin

    s      := gates;
    result := '0';

    for i in s'range loop
      if (not five_level or RAIL_GATES(i) = '1') then
        result := result or s(i);
      end if;
    end loop;

    return result;

  end function at_rail;

  function last_start (five_level : boolean) return natural is
  begin

    if (five_level) then
      return START_GROUPS'high;
    else
      return 0;
    end if;

  end function last_start;

  function start_of (five_level : boolean; position : std_logic_vector(2 downto 0); action : unsigned(2 downto 0))
    return std_logic_vector is

    variable result : std_logic_vector(gates_of(five_level) - 1 downto 0);

  begin

    result := pattern_of(five_level, position);

    if (five_level) then
      result := (others => '0');

      for i in START_GROUPS'range loop
        if (action = i) then
          result := pattern_of(five_level, position) and START_GROUPS(i);
        end if;
      end loop;

    end if;

    return result;

  end function start_of;

  function is_forbidden (five_level : boolean; gates : std_logic_vector) return std_logic is

    variable s : std_logic_vector(gates'length - 1 downto 0);

  begin

    s := gates;

    if (five_level) then
      return (s(0) and s(1))                            -- S1, S2: upper half of the dc-link
             or (s(2) and s(3))                         -- S3, S4: lower half
             or (s(1) and s(2))                         -- S2, S3: phase capacitor, through D5 and D8
             or (s(5) and s(6))                         -- S6, S7: phase capacitor
             or (s(0) and s(3))                         -- S1, S4: 3/4 of the dc-link on S5 or S8
             or ((s(0) or s(3)) and s(4) and s(7));     -- S5, S8: phase capacitor across one half
    else
      return s(0) and s(1);
    end if;

  end function is_forbidden;

end package body gate_tables;
