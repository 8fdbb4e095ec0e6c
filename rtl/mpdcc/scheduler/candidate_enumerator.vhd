-- Enumerates the candidates that follow a switch position, one per clock.
--
-- Order (docs/specification.md, section 2.3): Cartesian product of the phases' next positions, phase a
-- outermost, each phase's positions ascending.  index holds the three choices, so that it ascends too.
-- With BLOCKS the phases a and b alone are enumerated: an explorer that takes one candidate a clock
-- expands phase c itself, so that one enumerator feeds up to four of them.  effort is f_s, the sum of
-- the transition weights of the phases, which may depend on the signs of the phase currents.
-- Formats: positions 0 to 7; effort unsigned.
-- Latency: the first candidate is valid two clocks after start; one per clock while ready is '1'.
-- done rises with the clock in which the last candidate is taken and stays until the next start.
-- Overflow: none; the tables' sums are checked against EFFORT_WIDTH where they are generated.
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
  use work.mpdcc_types.all;

entity candidate_enumerator is
  generic (
    BLOCKS : boolean := false -- true: phases a and b only, phase c stays at its first choice with no effort
  );
  port (
    clk      : in    std_logic;                    -- rising edge
    rst      : in    std_logic;                    -- synchronous, active high
    start    : in    std_logic;                    -- '1' for one clock: begin
    previous : in    positions_t;                  -- s(k-1), stable while enumerating
    negative : in    std_logic_vector(2 downto 0); -- '1': current of phase a (bit 0), b, c is negative; stable
    valid    : out   std_logic;                    -- '1': candidate is new
    ready    : in    std_logic;                    -- '1': candidate is taken in this clock
    candidate     : out   candidate_t;                       -- candidate, probe = '0'
    done     : out   std_logic                     -- '1': every candidate has been taken
  );
end entity candidate_enumerator;

architecture rtl of candidate_enumerator is

  constant LAST_PHASE : natural := choose(BLOCKS, 1, 2);

  subtype choice_t is natural range 0 to 3;

  type choices_t is array (0 to 2) of choice_t;

  type state_t is record
    running : std_logic;                          -- choices point at a candidate
    choice  : choices_t;                          -- which of its next positions each phase takes
    valid   : std_logic;
    candidate    : candidate_t;
  end record state_t;

  constant STATE_INIT : state_t := (
    running => '0',
    choice  => (others => 0),
    valid   => '0',
    candidate    => (
      probe    => '0',
      index    => (others => '0'),
      position => (others => (others => '0')),
      effort   => (others => '0')
    )
  );

  signal r      : state_t;
  signal r_next : state_t;

begin

  p_next : process (r, start, previous, negative, ready) is

    variable v      : state_t;
    variable effort : unsigned(EFFORT_WIDTH - 1 downto 0);
    variable carry  : boolean;

  begin

    v := r;

    if (ready = '1') then
      v.valid := '0';
    end if;

    if (r.running = '1' and v.valid = '0') then
      effort := (others => '0');

      for x in 0 to LAST_PHASE loop
        effort := effort + transition_weight(previous(x), negative(x), to_unsigned(r.choice(x), 2));
      end loop;

      for x in 0 to 2 loop
        v.candidate.position(x) := next_position(previous(x), to_unsigned(r.choice(x), 2));
      end loop;

      v.valid            := '1';
      v.candidate.probe  := '0';
      v.candidate.effort := effort;
      v.candidate.index  := to_unsigned(r.choice(0), 2) & to_unsigned(r.choice(1), 2)
                            & to_unsigned(r.choice(2), 2);

      -- the last phase counts fastest
      carry := true;

      for x in LAST_PHASE downto 0 loop
        if (carry) then
          if (r.choice(x) = NEXT_LAST(to_integer(previous(x)))) then
            v.choice(x) := 0;
          else
            v.choice(x) := r.choice(x) + 1;
            carry       := false;
          end if;
        end if;
      end loop;

      if (carry) then
        v.running := '0';
      end if;
    end if;

    if (start = '1') then
      v.running := '1';
      v.choice  := (others => 0);
      v.valid   := '0';
    end if;

    r_next <= v;

  end process p_next;

  p_state : process (clk) is
  begin

    if rising_edge(clk) then
      r <= r_next;

      if (rst = '1') then
        r.running <= STATE_INIT.running;
        r.valid   <= STATE_INIT.valid;
      end if;
    end if;

  end process p_state;

  valid <= r.valid;
  candidate  <= r.candidate;
  done  <= not (r.running or r.valid);

end architecture rtl;
