-- Gates of a leg as data: which are on in a position, in what order they change, which may never be
-- on together.
--
-- Two legs: that of the converter, from the tables of converter_leg, and a half bridge, whose bit 0 is the upper gate
-- and bit 1 the lower one, position bit 0 '1': upper.
--
-- A commutation changes one gate at a time, in an order that shorts nothing, gives the current a way for either sign
-- and moves the output in one step (docs/converters.md). The longest here, 2 to 4 and 3 to 5: S4 off,
-- S8 on, S2 off, S3 on, S5 off, S1 on; back the same in reverse. S1, S4, S5 and S8 switch without current.
-- A stop and a start may take several steps, a dead time apart: gates at the rails go off first and come on last.  All
-- gates off in one clock would put up to 2.6 times its rating on S5 or S8 of that leg.  A half bridge needs one step.
-- A start may lead through a position, as by the neutral point: it ends there, and a commutation follows.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;

package gate_tables is

  constant TIME_WIDTH  : natural := 12; -- bits of dead and minimum times, clocks
  constant LIMIT_WIDTH : natural := 16; -- bits of decision limit and watchdog, clocks
  constant FAULT_COUNT : natural := 15; -- kinds of faults

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
  constant FAULT_UPSET        : natural := 13; -- a setting in force has changed by itself
  constant FAULT_DRIVER       : natural := 14; -- a gate driver reports a fault, or is not ready

  -- gates of one leg
  function gates_of (tabled_leg : boolean) return positive;

  -- the position that a code stands for
  function position_of (tabled_leg : boolean; code : std_logic_vector(2 downto 0)) return std_logic_vector;

  -- '1': the switch graph has this edge, staying included
  function is_edge (tabled_leg : boolean; origin, goal : std_logic_vector(2 downto 0)) return std_logic;

  -- gates that are on in a position
  function pattern_of (tabled_leg : boolean; position : std_logic_vector(2 downto 0))
    return std_logic_vector;

  -- number of the last single-gate action of a commutation
  function last_action (tabled_leg : boolean; origin, goal : std_logic_vector(2 downto 0))
    return unsigned;

  -- the gate that an action changes, one bit set
  function action_of (tabled_leg : boolean; origin, goal : std_logic_vector(2 downto 0);
    action : unsigned(2 downto 0)) return std_logic_vector;

  -- gates that a stop leaves on, a dead time after these
  function stop_of (tabled_leg : boolean; gates : std_logic_vector) return std_logic_vector;

  -- '1': a gate at a rail is on; a stop then begins at once, whatever has changed before
  function at_rail (tabled_leg : boolean; gates : std_logic_vector) return std_logic;

  -- position that the start of a position leads to: itself, or the one that it goes through
  function first_of (tabled_leg : boolean; position : std_logic_vector(2 downto 0)) return std_logic_vector;

  -- number of the last step of a start
  function last_start (tabled_leg : boolean) return natural;

  -- gates that a step of the start of a position turns on
  function start_of (tabled_leg : boolean; position : std_logic_vector(2 downto 0); action : unsigned(2 downto 0))
    return std_logic_vector;

  -- '1': these gates together short a capacitor or the dc-link, or put too much voltage on a device
  function is_forbidden (tabled_leg : boolean; gates : std_logic_vector) return std_logic;

end package gate_tables;

package body gate_tables is

  function gates_of (tabled_leg : boolean) return positive is
  begin

    if (tabled_leg) then
      return GATES;
    else
      return 2;
    end if;

  end function gates_of;

  function position_of (tabled_leg : boolean; code : std_logic_vector(2 downto 0)) return std_logic_vector is
  begin

    if (not tabled_leg) then
      return "00" & code(0);
    elsif (POSITIONS = 8) then
      return code;
    else
      return POSITION_OF_CODE(to_integer(unsigned(code)));
    end if;

  end function position_of;

  function is_edge (tabled_leg : boolean; origin, goal : std_logic_vector(2 downto 0)) return std_logic is

    variable result : std_logic;

  begin

    result := '0';

    if (tabled_leg) then

      for s in 0 to POSITIONS - 1 loop
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

  function pattern_of (tabled_leg : boolean; position : std_logic_vector(2 downto 0))
    return std_logic_vector is
  begin

    if (tabled_leg) then
      return PATTERNS(to_integer(unsigned(position)));
    else
      return (not position(0)) & position(0);
    end if;

  end function pattern_of;

  function last_action (tabled_leg : boolean; origin, goal : std_logic_vector(2 downto 0))
    return unsigned is

    variable moved  : std_logic_vector(5 downto 0);
    variable result : unsigned(2 downto 0);

  begin

    moved  := (origin xor goal) & origin;
    result := "001";

    if (tabled_leg) then
      -- the first row that fits is the last to be looked at
      for i in MOVE_LAST'high downto 0 loop
        if ((moved and MOVE_CARE(i)) = (MOVE_VALUE(i) and MOVE_CARE(i))) then
          result := to_unsigned(MOVE_LAST(i), 3);
        end if;
      end loop;

    end if;

    return result;

  end function last_action;

  function action_of (tabled_leg : boolean; origin, goal : std_logic_vector(2 downto 0);
    action : unsigned(2 downto 0)) return std_logic_vector is

    variable moved  : std_logic_vector(5 downto 0);
    variable row    : std_logic_vector(gates_of(tabled_leg) - 1 downto 0);
    variable result : std_logic_vector(gates_of(tabled_leg) - 1 downto 0);
    variable second : std_logic;

  begin

    moved  := (origin xor goal) & origin;
    result := (others => '0');
    second := action(0);

    if (tabled_leg) then
      -- the first row that fits is the last to be looked at; of two actions the last bit tells
      for i in MOVE_LAST'high downto 0 loop
        row := (others => '0');

        for k in 0 to MOVE_LAST(i) loop
          if ((MOVE_LAST(i) < 2 and action(0) = to_unsigned(k, 3)(0)) or action = k) then
            row(MOVE_GATES(i, k)) := '1';
          end if;
        end loop;

        if ((moved and MOVE_CARE(i)) = (MOVE_VALUE(i) and MOVE_CARE(i))) then
          result := row;
        end if;
      end loop;

    else
      -- the gate that is on goes off first
      result(0) := origin(0) xor second;
      result(1) := not (origin(0) xor second);
    end if;

    return result;

  end function action_of;

  function stop_of (tabled_leg : boolean; gates : std_logic_vector) return std_logic_vector is

    variable s      : std_logic_vector(gates'length - 1 downto 0);
    variable result : std_logic_vector(gates'length - 1 downto 0);

  begin

    s      := gates;
    result := (others => '0');

    if (tabled_leg) then
      -- the first row that fits is the last to be looked at
      for i in STOP_RULES'high(1) downto 0 loop
        if ((s and STOP_RULES(i, 0)) = STOP_RULES(i, 0) and unsigned(s and STOP_RULES(i, 1)) = 0) then
          result := s xor STOP_RULES(i, 2);
        end if;
      end loop;

    end if;

    return result;

  end function stop_of;

  function at_rail (tabled_leg : boolean; gates : std_logic_vector) return std_logic is

    variable s      : std_logic_vector(gates'length - 1 downto 0);
    variable result : std_logic;

  begin

    s      := gates;
    result := '0';

    for i in s'range loop
      if (not tabled_leg or RAIL_GATES(i) = '1') then
        result := result or s(i);
      end if;
    end loop;

    return result;

  end function at_rail;

  function first_of (tabled_leg : boolean; position : std_logic_vector(2 downto 0)) return std_logic_vector is
  begin

    if (tabled_leg and HAS_START_THROUGH) then
      return START_THROUGH;
    else
      return position;
    end if;

  end function first_of;

  function last_start (tabled_leg : boolean) return natural is
  begin

    if (tabled_leg) then
      return START_GROUPS'high;
    else
      return 0;
    end if;

  end function last_start;

  function start_of (tabled_leg : boolean; position : std_logic_vector(2 downto 0); action : unsigned(2 downto 0))
    return std_logic_vector is

    variable result : std_logic_vector(gates_of(tabled_leg) - 1 downto 0);

  begin

    result := pattern_of(tabled_leg, position);

    if (tabled_leg) then
      result := (others => '0');

      for i in START_GROUPS'range loop
        if (action = i) then
          result := pattern_of(tabled_leg, first_of(tabled_leg, position)) and START_GROUPS(i);
        end if;
      end loop;

    end if;

    return result;

  end function start_of;

  function is_forbidden (tabled_leg : boolean; gates : std_logic_vector) return std_logic is

    variable s      : std_logic_vector(gates'length - 1 downto 0);
    variable result : std_logic;

  begin

    s := gates;

    if (tabled_leg) then
      result := '0';

      for i in FORBIDDEN'range loop
        if ((s and FORBIDDEN(i)) = FORBIDDEN(i)) then
          result := '1';
        end if;
      end loop;

      return result;
    else
      return s(0) and s(1);
    end if;

  end function is_forbidden;

end package body gate_tables;
