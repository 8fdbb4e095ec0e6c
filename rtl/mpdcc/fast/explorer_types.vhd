-- Records between the units of the fast explorer.
--
-- Stages as in mpdcc_timing. A field's comment says in which stage it is valid.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.directmpc_math.all;
  use work.mpdcc_timing.all;
  use work.mpdcc_types.all;

package explorer_types is

  -- '1': the registers of a stage hold a candidate

  subtype stages_t is std_logic_vector(0 to COST_STAGE);

  -- place of a candidate in the order of enumeration

  subtype index_t is std_logic_vector(INDEX_WIDTH - 1 downto 0);

  -- weighted transitions of both levels

  subtype efforts_t is unsigned(TOTAL_EFFORT_WIDTH - 1 downto 0);

  type kinds_t is array (0 to 2) of unsigned(1 downto 0);

  -- which rows of the capacitors' table a candidate reads
  type connection_t is record
    bank    : std_logic;                    -- table
    pattern : std_logic_vector(2 downto 0); -- phases connected to the neutral point, phase a in bit 0
    kind    : kinds_t;                      -- per phase: 0 rests, 1 charged, 2 discharged by i > 0
  end record connection_t;

  constant CONNECTION_BITS : natural := 10;

  -- slopes and errors of the currents, trajectory units, of a and b
  type slopes_t is record
    slope : pair_t;       -- per step, stage SLOPE_STAGE
    sum   : trajectory_t; -- sum of both slopes, stage ERROR_STAGE
    error : pair_t;       -- at k+1, stage ERROR_STAGE
  end record slopes_t;

  -- a candidate as the deadlock rule compares it
  type dead_t is record
    valid : std_logic; -- '1': a candidate, stable inside its bounds or not
    rank  : rank_t;    -- its excess, ranked
    index : index_t;   -- its place
  end record dead_t;

  -- a candidate with its cost, stage COST_STAGE
  type costed_t is record
    feasible  : std_logic; -- '1': a candidate with length > 0
    saturated : std_logic; -- '1': its weight on v_n saturated
    effort    : efforts_t; -- f_s
    length    : length_t;  -- L*, steps
    cost      : cost_t;    -- J, RECIPROCAL_FRACTION fractional bits
  end record costed_t;

  function to_vector (value : connection_t) return std_logic_vector;

  function to_connection (value : std_logic_vector(CONNECTION_BITS - 1 downto 0)) return connection_t;

  -- the smaller of two lengths
  function shorter (a, b : length_t) return length_t;

  -- bits of the effort of a candidate, or of two in turn
  function effort_bits_of (second_level : boolean) return natural;

end package explorer_types;

package body explorer_types is

  function to_vector (value : connection_t) return std_logic_vector is
  begin

    return value.bank & value.pattern & std_logic_vector(value.kind(2)) & std_logic_vector(value.kind(1))
           & std_logic_vector(value.kind(0));

  end function to_vector;

  function to_connection (value : std_logic_vector(CONNECTION_BITS - 1 downto 0)) return connection_t is

    variable result : connection_t;

  begin

    result.bank    := value(9);
    result.pattern := value(8 downto 6);

    for x in 0 to 2 loop
      result.kind(x) := unsigned(value(2 * x + 1 downto 2 * x));
    end loop;

    return result;

  end function to_connection;

  function shorter (a, b : length_t) return length_t is
  begin

    if (a < b) then
      return a;
    else
      return b;
    end if;

  end function shorter;

  function effort_bits_of (second_level : boolean) return natural is
  begin

    return selector_width(MOST_EFFORT * choose(second_level, 2, 1) + 1);

  end function effort_bits_of;

end package body explorer_types;
