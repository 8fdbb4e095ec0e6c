-- Sequencer of the two-level controllers: counts the clocks of a decision and reads the program for each.
--
-- The program stands in mptc_constants; model/directmpc/mptc/program.py explains and checks it.  MPTC and MPFC share
-- the clocks before FORK.  From FORK on, MPFC has addresses of its own, beginning with FORK_ADDRESS.  MPTC1, MPTC2 and
-- GTV go MPTC's way to its end and on from PAIR_ADDRESS.  MPFC2, MPFC3, MPC2 and SVM go MPFC's way up to HEXAGON_FORK
-- and on from HEXAGON_ADDRESS.
--
-- With FLUX_CONTROL the program is read a clock ahead, and products come from registers.  Reading and choosing among
-- the longer lists of MPFC in one clock ends at 95 to 105 MHz on ECP5, five seeds; this way it is 107 at least.
-- With FAMILY events come from registers too.
--
-- Formats: places as in the lists of mptc_constants.
-- Latency: products and events of clock n of the program come n clocks after the edge that accepts start.  valid
-- follows it by as many clocks of the program as the method's LAST_ says.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_types.all;

entity mptc_sequencer is
  generic (
    FLUX_CONTROL : boolean := true; -- true: MPFC can be chosen at run time
    FAMILY       : boolean := false -- true: methods of several vectors too; needs FLUX_CONTROL
  );
  port (
    clk         : in    std_logic;       -- rising edge
    rst         : in    std_logic;       -- synchronous, active high
    start       : in    std_logic;       -- '1' for one clock: decide; ignored while busy
    method_mpfc : in    std_logic;       -- '1': MPFC, '0': MPTC; sampled with start
    family_method : in    family_t;       -- method of several vectors, goes before method_mpfc; sampled with start
    duty_rule   : in    duty_rule_t;     -- FAMILY: how MPTC1 and MPTC2 find a duty; sampled with start
    accept      : out   std_logic;       -- '1': start is accepted with the next edge
    mpfc        : out   std_logic;       -- '1': the decision under way is MPFC's
    method      : out   family_t;        -- method of several vectors of the decision under way
    mean        : out   std_logic;       -- '1': its duties are those by the mean torque
    both_duties : out   std_logic;       -- '1': the cheaper one of a duty by the torque and one by the flux's length
    products    : out   mptc_products_t; -- what the mac_blocks begin
    events      : out   mptc_events_t;   -- what is due
    valid       : out   std_logic;       -- '1' for one clock: the decision is new
    busy        : out   std_logic        -- '1': a decision is under way
  );
end entity mptc_sequencer;

architecture rtl of mptc_sequencer is

  -- bits of an address: every one of the program, and one for an idle sequencer
  constant ADDRESS_BITS : positive := selector_width(choose(FAMILY, ADDRESS_COUNT_FAMILY, ADDRESS_COUNT) + 1);
  constant ADDRESSES    : natural  := counted(FLUX_CONTROL, ADDRESS_COUNT, LAST_MPTC + 1); -- without FAMILY
  constant PARKED_BITS  : positive := selector_width(choose(FAMILY, ADDRESS_COUNT_FAMILY, ADDRESSES) + 1);
  constant PARKED       : natural  := 2 ** PARKED_BITS - 1; -- address of an idle sequencer
  constant STEPS_SINGLE : natural  := counted(FLUX_CONTROL, STEP_COUNT_SINGLE, STEP_COUNT_MPTC);
  constant STEPS        : natural  := choose(FAMILY, STEP_COUNT, STEPS_SINGLE);
  constant WORD_EVENTS  : natural  := counted(FLUX_CONTROL, WORD_WRITES'length(1), WORD_WRITES_MPTC);
  constant TERM_SINGLE  : natural  := counted(FLUX_CONTROL, TERM_WRITES_SINGLE, TERM_WRITES_MPTC);
  constant TERM_EVENTS  : natural  := choose(FAMILY, TERM_WRITES'length(1), TERM_SINGLE);

  signal active  : std_logic;
  signal address : natural range 0 to 2 ** ADDRESS_BITS - 1;
  signal turned  : std_logic; -- the method is MPFC
  signal chosen  : family_t;  -- method of several vectors
  signal ruled   : std_logic; -- '1': it has a duty rule
  signal both    : std_logic; -- '1': the rule is best
  signal ends    : std_logic;       -- '1': the next clock is the last one
  signal ending  : std_logic;       -- '1': this is the last clock
  signal decoded : mptc_products_t;

  -- a place as bits; zero for what is no place
  function bits_of (index : integer) return select_t is
  begin

    if (index < 0) then
      return (others => '0');
    else
      return std_logic_vector(to_unsigned(index, select_t'length));
    end if;

  end function bits_of;

  -- '1': an event at a place of the program is due with the next clock
  function due_at (place, here : natural; mpfc_way : std_logic) return std_logic is
  begin

    if (place = FORK) then
      return to_std_logic(here = FORK - 1) and not mpfc_way;
    elsif (place = FORK_ADDRESS) then
      return to_std_logic(here = FORK - 1) and mpfc_way;
    else
      return to_std_logic(here = place - 1);
    end if;

  end function due_at;

begin

  assert FLUX_CONTROL or not FAMILY
    report "mptc_sequencer: FAMILY needs FLUX_CONTROL"
    severity failure;

  p_sequence : process (clk) is
  begin

    if rising_edge(clk) then
      valid <= '0';

      if (active = '1') then
        if (ending = '1') then
          active  <= '0';
          valid   <= '1';
          address <= PARKED;
        elsif (FLUX_CONTROL and turned = '1' and address = FORK - 1) then
          address <= FORK_ADDRESS;
        elsif (FAMILY and address = LAST_MPTC) then
          address <= PAIR_ADDRESS;
        elsif (FAMILY and chosen(2) = '1' and address = HEXAGON_FORK - 1) then
          address <= HEXAGON_ADDRESS;
        else
          address <= (address + 1) mod 2 ** ADDRESS_BITS;
        end if;
      elsif (start = '1') then
        active  <= '1';
        address <= 0;
      end if;

      if (rst = '1') then
        active  <= '0';
        address <= PARKED;
        valid   <= '0';
      end if;
    end if;

  end process p_sequence;

  g_ending : if not FAMILY generate
    ending <= to_std_logic(address = LAST_MPTC - 1 or (FLUX_CONTROL and address = LAST_MPFC - 1));
  end generate g_ending;

  g_ending_family : if FAMILY generate

    ends <= to_std_logic((address = LAST_MPTC - 2 and chosen = FAMILY_NONE) or address = LAST_MPFC - 2
                         or address = LAST_HEXAGON - 2
                         or (address = LAST_MPTC1 - 2 and chosen = FAMILY_MPTC1 and both = '0')
                         or (address = LAST_MPTC1_BEST - 2 and chosen = FAMILY_MPTC1)
                         or (address = LAST_MPTC2 - 2 and chosen = FAMILY_MPTC2 and both = '0')
                         or address = LAST_MPTC2_BEST - 2
                         or (address = LAST_GTV - 2 and chosen = FAMILY_GTV));

    p_ending : process (clk) is
    begin

      if rising_edge(clk) then
        ending <= ends and not rst;
      end if;

    end process p_ending;

  end generate g_ending_family;

  busy   <= active;
  accept <= start and not active;
  mpfc   <= turned;
  method <= chosen;

  both_duties <= both;

  g_method : if FLUX_CONTROL generate

    p_method : process (clk) is
    begin

      if rising_edge(clk) then
        if (active = '0' and start = '1') then
          turned <= method_mpfc;

          if (FAMILY and family_method /= FAMILY_NONE) then
            turned <= family_method(2);
          end if;
        end if;
      end if;

    end process p_method;

  end generate g_method;

  g_family : if FAMILY generate

    ruled <= to_std_logic(family_method = FAMILY_MPTC1 or family_method = FAMILY_MPTC2);

    p_chosen : process (clk) is
    begin

      if rising_edge(clk) then
        if (active = '0' and start = '1') then
          chosen <= family_method;
          mean   <= ruled and to_std_logic(duty_rule = RULE_MEAN);
          both   <= ruled and duty_rule(1);
        end if;
      end if;

    end process p_chosen;

  end generate g_family;

  g_one_vector : if not FAMILY generate
    chosen <= FAMILY_NONE;
    mean   <= '0';
    both   <= '0';
  end generate g_one_vector;

  g_one_method : if not FLUX_CONTROL generate
    turned <= '0';
  end generate g_one_method;

  ---------------------------------------------------------------------------------------------
  -- Products
  ---------------------------------------------------------------------------------------------

  p_decode : process (address, active, start, turned) is

    variable due    : boolean;
    variable issued : mptc_products_t;

  begin

    issued.issue       := (others => '0');
    issued.gather      := (others => '0');
    issued.halve       := (others => '0');
    issued.lead        := (others => '0');
    issued.a_choice    := (others => (others => '0'));
    issued.b_choice    := (others => (others => '0'));
    issued.seed_choice := (others => (others => '0'));

    for i in 0 to STEPS - 1 loop
      if (not FLUX_CONTROL) then
        due := address = PROGRAM(i, 0);
      elsif (PROGRAM(i, 0) = 0) then
        due := start = '1' and active = '0';
      elsif (PROGRAM(i, 0) = FORK) then
        due := address = FORK - 1 and turned = '0';
      elsif (PROGRAM(i, 0) = FORK_ADDRESS) then
        due := address = FORK - 1 and turned = '1';
      else
        due := address = PROGRAM(i, 0) - 1;
      end if;

      for n in 0 to BLOCK_COUNT - 1 loop
        if (due and PROGRAM(i, 1) = n) then
          issued.issue(n)       := '1';
          issued.gather(n)      := issued.gather(n) or to_std_logic(PROGRAM(i, 4) < 0);
          issued.halve(n)       := issued.halve(n) or to_std_logic(PROGRAM(i, 5) > 0);
          issued.lead(n)        := issued.lead(n) or to_std_logic(PROGRAM(i, 5) > 1);
          issued.a_choice(n)    := issued.a_choice(n) or bits_of(PROGRAM(i, 2));
          issued.b_choice(n)    := issued.b_choice(n) or bits_of(PROGRAM(i, 3));
          issued.seed_choice(n) := issued.seed_choice(n) or bits_of(PROGRAM(i, 4));
        end if;
      end loop;
    end loop;

    decoded <= issued;

  end process p_decode;

  g_ahead : if FLUX_CONTROL generate

    p_ahead : process (clk) is
    begin

      if rising_edge(clk) then
        products <= decoded;
      end if;

    end process p_ahead;

  end generate g_ahead;

  g_at_once : if not FLUX_CONTROL generate
    products <= decoded;
  end generate g_at_once;

  ---------------------------------------------------------------------------------------------
  -- Events
  ---------------------------------------------------------------------------------------------

  g_events_at_once : if not FAMILY generate

    p_events : process (address, ending) is
    begin

      events.word_writes  <= (others => '0');
      events.term_writes  <= (others => '0');
      events.normalise    <= '0';
      events.orient       <= '0';
      events.square       <= '0';
      events.radicand     <= '0';
      events.begin_stream <= to_std_logic(address = FIRST_LENGTH - 1);
      events.begin_pairs  <= '0';
      events.way_alpha    <= '0';
      events.way_beta     <= '0';
      events.rest         <= '0';
      events.last         <= ending;

      for i in 0 to WORD_EVENTS - 1 loop
        events.word_writes(i) <= to_std_logic(address = WORD_WRITES(i, 0));
      end loop;

      for i in 0 to TERM_EVENTS - 1 loop
        events.term_writes(i) <= to_std_logic(address = TERM_WRITES(i, 0));
      end loop;

      if (FLUX_CONTROL) then
        events.normalise    <= to_std_logic(address >= FIRST_NORMALISE and address < FIRST_NORMALISE + NORMALISE_STEPS);
        events.orient       <= to_std_logic(address = FIRST_NORMALISE + NORMALISE_STEPS);
        events.square       <= to_std_logic(address = FIRST_ROOT);
        events.radicand     <= to_std_logic(address = FIRST_ROOT + 1);
        events.begin_stream <= to_std_logic(address = FIRST_LENGTH - 1 or address = FIRST_STREAM_MPFC - 1);
      end if;

    end process p_events;

  end generate g_events_at_once;

  -- seen a clock ahead; no event stands at PAIR_ADDRESS or HEXAGON_ADDRESS
  g_events_ahead : if FAMILY generate

    p_events : process (clk) is
    begin

      if rising_edge(clk) then
        if (chosen = FAMILY_MPTC1) then
          events.begin_pairs <= (due_at(LAST_MPTC - 1, address, turned) and not both)
                                or (due_at(LAST_MPTC, address, turned) and both);
        else
          events.begin_pairs <= due_at(FIRST_PAIR - 1, address, turned) and to_std_logic(chosen /= FAMILY_NONE);
        end if;

        for i in 0 to WORD_EVENTS - 1 loop
          events.word_writes(i) <= due_at(WORD_WRITES(i, 0), address, turned);
        end loop;

        for i in 0 to TERM_EVENTS - 1 loop
          events.term_writes(i) <= due_at(TERM_WRITES(i, 0), address, turned);
        end loop;

        events.normalise    <= to_std_logic(address >= FIRST_NORMALISE - 1
                                            and address < FIRST_NORMALISE - 1 + NORMALISE_STEPS);
        events.orient       <= due_at(FIRST_NORMALISE + NORMALISE_STEPS, address, turned);
        events.square       <= due_at(FIRST_ROOT, address, turned);
        events.radicand     <= due_at(FIRST_ROOT + 1, address, turned);
        events.begin_stream <= due_at(FIRST_LENGTH - 1, address, turned)
                               or due_at(FIRST_STREAM_MPFC - 1, address, turned);
        events.way_alpha    <= due_at(FIRST_WAY, address, turned);
        events.way_beta     <= due_at(FIRST_WAY + 1, address, turned);
        events.rest         <= due_at(FIRST_REST, address, turned);
        events.last         <= ends;

        if (rst = '1') then
          events.word_writes  <= (others => '0');
          events.term_writes  <= (others => '0');
          events.normalise    <= '0';
          events.orient       <= '0';
          events.square       <= '0';
          events.radicand     <= '0';
          events.begin_stream <= '0';
          events.begin_pairs  <= '0';
          events.way_alpha    <= '0';
          events.way_beta     <= '0';
          events.rest         <= '0';
          events.last         <= '0';
        end if;
      end if;

    end process p_events;

  end generate g_events_ahead;

end architecture rtl;
