-- Plays a decision of up to three vectors: the switch states of every clock of a control period.
--
-- start begins a period with u1 for t1, then u2 for t2, then u3 for the rest.  A vector without time is not
-- applied.  The last vector stays until the next period begins, so that there is no gap and the times fill the
-- period whatever its length.
-- A t1 of 4095 is the largest duty that the torque methods give.  u1 has the whole period then: the gates would make a
-- real pulse of what is left.  The next prediction has t1 and t2 as they are given.  Its mean voltage is off by 1/4096
-- of the difference of two vectors, which moves the flux by less than half an LSB of its port (shipped drive).
-- With segmented, space-vector modulation has seven segments: u_0, the odd one of u1 and u2, the even one, u_7, and
-- back; the zero voltage has four quarters, each of the others two halves.  One leg switches at a time then, and times
-- are played as they are.
-- Dead times and least on-times are the gate guard's.
--
-- How: a phase grows by rate in every clock, 2^32 for a period.  Nothing is multiplied or divided.  A vector ends in
-- the first clock whose phase has reached the sum of the times so far.  model/directmpc/mptc/vector_sequencer.py is
-- the bit-true twin.
-- Formats: times 1/4096 of the period, 4096 for all of it; the phase is compared in quarters of that.
-- Latency: u and switches of a sequence begin 5 clocks after start, early and invalid 4, always; the next start may
-- come in any clock.
-- Overflow: where t1 + t2 is above 4096, the period's end cuts what is in front of it, and invalid is set.  The phase
-- stops at its end.  A start before the end sets early: rate is too small, or start too early.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_vectors.all;

entity vector_sequencer is
  port (
    clk       : in    std_logic;                                 -- rising edge
    rst       : in    std_logic;                                 -- synchronous, active high: u_0 until a start
    start     : in    std_logic;                                 -- '1' for one clock: a control period begins
    -- sampled with start
    u1        : in    std_logic_vector(2 downto 0);              -- first vector, 0 to 7
    u2        : in    std_logic_vector(2 downto 0);              -- second vector, 0 to 7
    u3        : in    std_logic_vector(2 downto 0);              -- third vector, 0 to 7
    t1        : in    std_logic_vector(TIME_WIDTH downto 0);     -- time of the first, unsigned, 1/4096
    t2        : in    std_logic_vector(TIME_WIDTH downto 0);     -- time of the second, unsigned, 1/4096
    segmented : in    std_logic;                                 -- '1': space-vector modulation, '0': u1, u2, u3
    -- stable while periods run
    rate      : in    std_logic_vector(RATE_WIDTH - 1 downto 0); -- 2^32 by the clocks of a period, unsigned
    -- what is applied
    playing   : out   std_logic;                                 -- '1': there has been a start
    u         : out   std_logic_vector(2 downto 0);              -- number of the vector, 0 to 7
    switches  : out   std_logic_vector(2 downto 0);              -- its switch states a, b, c; '1': positive rail
    -- of the latest start, from 4 clocks after it
    early     : out   std_logic;                                 -- '1': the period before was not over
    invalid   : out   std_logic                                  -- '1': t1 + t2 is above 4096
  );
end entity vector_sequencer;

architecture rtl of vector_sequencer is

  constant ENDS     : positive := 6; -- of all segments but the last
  constant STEP     : natural  := POSITION_WIDTH - TIME_WIDTH;
  constant SUM_BITS : positive := POSITION_WIDTH + 3;

  subtype sum_t is unsigned(SUM_BITS - 1 downto 0);

  type ends_t is array (1 to ENDS) of sum_t;

  type order_t is array (0 to ENDS) of vector_t;

  -- a sequence on its way to its ends: one sum in a clock
  type sequence_t is record
    order     : order_t; -- vectors of the segments
    segmented : std_logic;
    invalid   : std_logic;
    t1        : sum_t;
    both      : sum_t;   -- t1 and t2
    rest      : sum_t;   -- time of the third
    odd       : sum_t;   -- time of the vector with the odd number
    even      : sum_t;   -- time of the other one
    to_second : sum_t;   -- end of the second segment
    to_third  : sum_t;   -- end of the third one
    rest3     : sum_t;   -- three times rest
    twice     : sum_t;   -- twice both and even
  end record sequence_t;

  type state_t is record
    given   : std_logic_vector(2 downto 0); -- a start is on its way, '1' in the last bit: its ends are there next
    running : std_logic; -- a phase is that of a start
    playing : std_logic;
    early   : std_logic;
    u       : vector_t;
    phase   : unsigned(PHASE_WIDTH - 1 downto 0);
  end record state_t;

  constant INIT : state_t := (
    given   => (others => '0'),
    running => '0',
    playing => '0',
    early   => '0',
    u       => (others => '0'),
    phase   => (others => '1')
  );

  signal r      : state_t;
  signal next_r : state_t;
  signal asked  : sequence_t; -- as given
  signal summed : sequence_t; -- with both and rest
  signal added  : sequence_t; -- with sums of these
  signal order  : order_t;    -- vectors of the segments
  signal last   : ends_t;     -- positions at which the segments end

  -- vectors of the segments; in seven of them the odd one of the first two comes first
  function order_of (first, second, third : vector_t; split : std_logic) return order_t is
  begin

    if (split = '0') then
      return (first, second, third, "000", "000", "000", "000");
    elsif (first(0) = '1') then
      return ("000", first, second, "111", second, first, "000");
    else
      return ("000", second, first, "111", first, second, "000");
    end if;

  end function order_of;

  -- positions at which the segments end; what is not used is never reached
  function ends_of (value : sequence_t) return ends_t is

    variable result : ends_t;

  begin

    result := (others => (others => '1'));

    if (value.segmented = '1') then
      result(1) := value.rest;
      result(2) := value.to_second;
      result(3) := value.to_third;
      result(4) := value.rest3 + shift_left(value.both, 1);
      result(5) := value.rest3 + value.twice;
      result(6) := value.rest3 + shift_left(value.both, 2);
    else
      result(1) := shift_left(value.t1, STEP);
      result(2) := shift_left(value.both, STEP);
    end if;

    return result;

  end function ends_of;

begin

  p_next : process (r, rate, start, order, last) is

    variable v        : state_t;
    variable grown    : unsigned(PHASE_WIDTH downto 0);
    variable position : unsigned(POSITION_WIDTH - 1 downto 0);

  begin

    v       := r;
    v.given := r.given(1 downto 0) & start;

    grown    := resize(r.phase, PHASE_WIDTH + 1) + unsigned(rate);
    position := grown(PHASE_WIDTH - 1 downto PHASE_WIDTH - POSITION_WIDTH);

    if (r.given(2) = '1') then
      v.phase   := (others => '0');
      v.running := '1';
      v.early   := not grown(PHASE_WIDTH) and to_std_logic(position < 2 ** POSITION_WIDTH - 1);
    elsif (grown(PHASE_WIDTH) = '1') then
      v.phase := (others => '1');
    else
      v.phase := grown(PHASE_WIDTH - 1 downto 0);
    end if;

    position  := r.phase(PHASE_WIDTH - 1 downto PHASE_WIDTH - POSITION_WIDTH);
    v.playing := r.running;

    if (r.running = '1') then
      v.u := order(0);

      for i in 1 to ENDS loop
        if (position >= last(i)) then
          v.u := order(i);
        end if;
      end loop;
    end if;

    next_r <= v;

  end process p_next;

  p_registers : process (clk) is
  begin

    if rising_edge(clk) then
      r <= next_r;

      asked.order     <= order_of(u1, u2, u3, segmented);

      if (segmented = '0' and unsigned(t1) = 2 ** TIME_WIDTH - 1) then
        asked.order <= order_of(u1, u1, u1, segmented);
      end if;

      asked.segmented <= segmented;
      asked.t1        <= resize(unsigned(t1), SUM_BITS);
      asked.odd       <= resize(unsigned(t2), SUM_BITS);
      asked.even      <= resize(unsigned(t1), SUM_BITS);
      asked.both      <= resize(unsigned(t1), SUM_BITS) + unsigned(t2);

      if (u1(0) = '1') then
        asked.odd  <= resize(unsigned(t1), SUM_BITS);
        asked.even <= resize(unsigned(t2), SUM_BITS);
      end if;

      summed         <= asked;
      summed.rest    <= (others => '0');
      summed.invalid <= '1';

      if (asked.both <= 2 ** TIME_WIDTH) then
        summed.rest    <= 2 ** TIME_WIDTH - asked.both;
        summed.invalid <= '0';
      end if;

      added           <= summed;
      added.to_second <= summed.rest + shift_left(summed.odd, 1);
      added.to_third  <= summed.rest + shift_left(summed.both, 1);
      added.rest3     <= summed.rest + shift_left(summed.rest, 1);
      added.twice     <= shift_left(summed.both, 1) + shift_left(summed.even, 1);

      if (r.given(2) = '1') then
        order   <= added.order;
        last    <= ends_of(added);
        invalid <= added.invalid;
      end if;

      if (rst = '1') then
        r       <= INIT;
        invalid <= '0';
      end if;
    end if;

  end process p_registers;

  playing  <= r.playing;
  u        <= r.u;
  switches <= switches_of_vector(r.u);
  early    <= r.early;

end architecture rtl;
