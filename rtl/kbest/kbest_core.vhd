-- K-best direct MPC of a multilevel drive: the core (docs/specification.md, section 10).
--
-- A decision searches the plan of least cost over STAGES stages, of which the BEAM best live on from
-- stage to stage.  Give the measurements, the positions and the plan with a one-clock start; valid comes
-- with the positions to apply and the plan for the next decision.
--
-- The children of a stage's nodes stream through one pipeline, one a clock, into a list of the best.  Their
-- states lie in a memory with two halves, under their numbers: one half is read as the nodes of this stage, the
-- other one is written with those of the next.  The planned node of the next stage is known early; its children
-- follow those of the last node of this stage at once.  Each node that is read leaves its code and the rank of
-- its parent; the plan found is gathered from these behind the decision.
--
-- Formats: per unit with the scales at each port; parameters as directmpc.kbest.coefficients computes
-- them from a drive file.
-- Latency: 1039 clocks at most with BEAM = 8 and STAGES = 12, 1068 with compensate.  busy falls
-- STAGES + 2 clocks behind valid, when plan_next is there; the next start may come then.
-- Overflow: saturates and sets saturated; nothing wraps.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.kbest_constants.all;
  use work.kbest_types.all;

entity kbest_core is
  generic (
    BEAM   : positive range 1 to 16 := 8; -- K, plans that live on
    STAGES : positive range 2 to 24 := 12 -- H, stages of the horizon
  );
  port (
    clk   : in    std_logic; -- rising edge
    rst   : in    std_logic; -- synchronous, active high
    start : in    std_logic; -- '1' for one clock: decide; ignored while busy
    -- measurements, sampled with start
    is_alpha   : in    std_logic_vector(15 downto 0); -- stator current, signed, 1/16000 pu
    is_beta    : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    psir_alpha : in    std_logic_vector(15 downto 0); -- rotor flux, signed, 1/9000 pu
    psir_beta  : in    std_logic_vector(15 downto 0); -- signed, 1/9000 pu
    v_n        : in    std_logic_vector(15 downto 0); -- neutral point, signed, 1/64012.5 pu
    v_ph_a     : in    std_logic_vector(15 downto 0); -- capacitor, unsigned, 1/32006.25 pu
    v_ph_b     : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    v_ph_c     : in    std_logic_vector(15 downto 0); -- unsigned, 1/32006.25 pu
    v_dc       : in    std_logic_vector(15 downto 0); -- dc link, unsigned, 1/16003.125 pu
    iref_alpha : in    std_logic_vector(15 downto 0); -- current reference, signed, 1/16000 pu
    iref_beta  : in    std_logic_vector(15 downto 0); -- signed, 1/16000 pu
    omega_s    : in    std_logic_vector(15 downto 0); -- stator frequency, signed, 1/16000 pu
    omega_r    : in    std_logic_vector(15 downto 0); -- rotor speed, signed, 1/16000 pu
    -- where the switches are, sampled with start, and the plan, stable from start to valid
    s_prev_a : in    std_logic_vector(2 downto 0);              -- switch position s(k-1) of phase a, 0 to 7
    s_prev_b : in    std_logic_vector(2 downto 0);              -- switch position s(k-1) of phase b, 0 to 7
    s_prev_c : in    std_logic_vector(2 downto 0);              -- switch position s(k-1) of phase c, 0 to 7
    plan     : in    std_logic_vector(4 * STAGES - 1 downto 0); -- code of each stage, the first rightmost
    odd      : in    std_logic;                                 -- '1': the period is an odd one, sampled with start
    -- parameters from a drive file, stable from start to valid; coefficients signed
    c_angle     : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- angle of a step times sqrt(3), of omega_s
    c_decay_1   : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- 1 - a11 over one step
    c_decay_2   : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- 1 - a11 over two steps
    c_flux_0    : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- a12, constant
    c_flux_2    : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- a12, with omega_r**2
    c_flux_u    : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- a12, with omega_r, times sqrt(3)
    c_flux_w    : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- a12, with omega_r, over sqrt(3)
    c_forced_1  : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- b/3 over one step, of v_n and v_ph
    c_forced_2  : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- b/3 over two steps
    c_level_1   : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- b/3 over one step, of v_dc/4
    c_level_2   : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- b/3 over two steps, of v_dc/4
    c_neutral   : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- T_s/(2 X_dc)
    c_capacitor : in    std_logic_vector(FACTOR_WIDTH - 1 downto 0); -- T_s/X_ph
    -- settings, stable from start to valid
    effort         : in    std_logic_vector(EFFORT_WIDTH - 1 downto 0);  -- lambda_u, unsigned
    bound_neutral  : in    std_logic_vector(VOLTAGE_WIDTH - 2 downto 0); -- unsigned, 1/16003.125 pu
    bound_phase    : in    std_logic_vector(VOLTAGE_WIDTH - 2 downto 0); -- unsigned, 1/16003.125 pu
    weight_neutral : in    std_logic_vector(3 downto 0);                 -- exponent of two, 0 to 10
    weight_phase   : in    std_logic_vector(3 downto 0);                 -- exponent of two, 0 to 10
    short_stages   : in    std_logic_vector(3 downto 0);                 -- stages of one step, 1 to 8
    compensate     : in    std_logic;                                    -- '1': decide for k+1
    -- decision, stable until the next valid
    valid     : out   std_logic;                                 -- '1' for one clock: decision is new
    busy      : out   std_logic;                                 -- '1': a decision is under way
    s_a       : out   std_logic_vector(2 downto 0);              -- switch position s(k) of phase a, 0 to 7
    s_b       : out   std_logic_vector(2 downto 0);              -- switch position s(k) of phase b, 0 to 7
    s_c       : out   std_logic_vector(2 downto 0);              -- switch position s(k) of phase c, 0 to 7
    held      : out   std_logic;                                 -- '1': s(k-1) is kept
    plan_next : out   std_logic_vector(4 * STAGES - 1 downto 0); -- plan for the next start, stable while busy is '0'
    odd_next  : out   std_logic;                                 -- '1': its period is an odd one
    cost      : out   std_logic_vector(COST_WIDTH - 1 downto 0); -- key of the plan found, unsigned, 1/15625 pu**2
    saturated : out   std_logic                                  -- '1': a value did not fit its word
  );
end entity kbest_core;

architecture rtl of kbest_core is

  subtype place_t is unsigned(5 downto 0);

  constant WORD_WIDTH : natural := NODE_WIDTH + 12;
  constant LAST_PLACE : place_t := to_unsigned(STAGES, place_t'length);

  type state_t is (IDLE, TERMS, SEARCH, LEAD, SHOW, TRACE);

  signal coefficients : coefficients_t;
  signal settings     : settings_t;

  signal state     : state_t;
  signal ready     : std_logic;   -- '1': state is IDLE
  signal begin_all : std_logic;
  signal positions : positions_t;
  signal period    : std_logic;   -- '1': an odd one
  signal flagged   : std_logic;

  -- measurements as they came
  signal m_is_alpha   : signed(15 downto 0);
  signal m_is_beta    : signed(15 downto 0);
  signal m_psir_alpha : signed(15 downto 0);
  signal m_psir_beta  : signed(15 downto 0);
  signal m_v_n        : signed(15 downto 0);
  signal m_v_dc       : unsigned(15 downto 0);
  signal m_iref_alpha : signed(15 downto 0);
  signal m_iref_beta  : signed(15 downto 0);
  signal m_omega_s    : signed(15 downto 0);
  signal m_omega_r    : signed(15 downto 0);
  signal m_v_ph       : std_logic_vector(47 downto 0); -- phase c on the left

  -- stage terms
  signal error_w     : error_t;
  signal terms_begun : std_logic;
  signal terms_ready : std_logic;
  signal terms_long  : std_logic;
  signal node_at       : std_logic_vector(3 downto 0);
  signal node_neutral  : voltage_t;
  signal node_charge   : voltage_t;
  signal child_at      : std_logic_vector(3 downto 0);
  signal child_neutral : voltage_t;
  signal child_charge  : voltage_t;
  signal linear_at     : std_logic_vector(3 downto 0);
  signal linear        : factor_t;
  signal terms_taken : std_logic;
  signal terms_clip  : std_logic;

  -- places are stages, counted from 1; place 0 is the stage in front of the first
  signal f_place    : place_t;              -- node that is read next
  signal f_at       : unsigned(4 downto 0); -- its place in the list
  signal f_zero     : std_logic;            -- '1': f_at is 0
  signal f_one      : std_logic;            -- '1': f_at is 1
  signal f_more     : std_logic;            -- '1': its stage is collected, and its slot is in ranked
  signal f_slot     : slot_t;
  signal fetch      : std_logic;
  signal read       : std_logic;
  signal g_valid    : std_logic;            -- '1': node_word is a node that waits
  signal g_place    : place_t;
  signal g_rank     : unsigned(4 downto 0);
  signal g_first    : std_logic;            -- '1': the first of its stage
  signal node_word  : std_logic_vector(WORD_WIDTH - 1 downto 0);
  signal node_cost  : std_logic_vector(COST_WIDTH - 1 downto 0);
  signal fetched    : node_t;               -- as it is read
  signal held_node  : node_t;               -- as it is prepared
  signal prepare    : std_logic;
  signal preparing  : std_logic;            -- '1': a node is being prepared, or waits to be loaded
  signal node_ends  : std_logic;
  signal node_up    : std_logic;            -- '1': prepared is whole
  signal node_clip  : std_logic;
  signal prepared   : prepared_t;
  signal half       : std_logic;
  signal effect     : error_t;
  signal voltage_at : std_logic_vector(2 downto 0);
  signal voltage    : voltage_t;
  signal share_at   : std_logic_vector(2 downto 0);
  signal share      : prepared_phase_t;
  signal node_long  : std_logic;
  signal kept_long  : std_logic;
  signal root       : std_logic;
  signal root_phase : unsigned(1 downto 0);
  signal root_at    : std_logic_vector(2 downto 0);
  signal root_word  : voltage_t;
  signal p_place    : place_t;
  signal p_first    : std_logic;
  signal p_rank     : slot_t;
  signal p_lead     : code_t;               -- first code of the node's plan
  signal load       : std_logic;
  signal load_alone : std_logic;
  signal load_plan  : std_logic;
  signal p_code     : code_t;               -- code of the plan
  signal codes      : std_logic_vector(4 * STAGES + 3 downto 0); -- the plan, by places
  signal l_root     : std_logic;            -- '1': the node is the first stage's
  signal l_rank     : slot_t;
  signal l_lead     : code_t;
  signal v_root     : std_logic;            -- the same, for the child that is on its way
  signal v_rank     : slot_t;
  signal v_lead     : code_t;
  signal w_root     : std_logic;            -- the same, for the child whose state is there
  signal w_rank     : slot_t;
  signal w_lead     : code_t;

  -- the stage that is collected in the list
  signal c_place    : place_t;
  signal c_width    : unsigned(4 downto 0); -- its nodes
  signal c_loaded   : unsigned(4 downto 0); -- those that are loaded
  signal c_ahead    : std_logic;            -- '1': the first node of the next stage is loaded
  signal whole      : std_logic;            -- '1': its list will be whole in the next clock
  signal complete   : std_logic;            -- '1': it is, and another stage follows
  signal finished   : std_logic;            -- '1': it is, and no stage follows
  signal warm_known : std_logic;            -- '1': the planned node of stage f_place is in the memory
  signal warm_slot  : slot_t;

  -- children
  signal busy_children : std_logic;
  signal pending       : std_logic_vector(1 downto 0);
  signal state_valid   : std_logic;
  signal child_state   : node_t;
  signal state_code    : code_t;
  signal state_number  : number_t;
  signal state_parity  : std_logic;
  signal child_valid   : std_logic;
  signal child_cost    : cost_t;
  signal child_places  : std_logic_vector(8 downto 0);
  signal child_key     : cost_t;
  signal child_number  : number_t;
  signal child_planned : std_logic;
  signal child_first   : std_logic;
  signal child_parity  : std_logic;
  signal listed_number  : number_t;
  signal listed_planned : std_logic;
  signal listed_parity  : std_logic;
  signal child_clip    : std_logic;

  -- list and memories
  signal accepted      : std_logic;
  signal slot          : slot_t;
  signal least         : cost_t;
  signal used          : unsigned(4 downto 0);
  signal best          : slot_t;
  signal next_best     : slot_t;
  signal ranked        : slot_t;
  signal write_first   : std_logic;
  signal write         : std_logic;
  signal write_address : std_logic_vector(8 downto 0);
  signal write_word    : std_logic_vector(WORD_WIDTH - 1 downto 0);
  signal cost_write    : std_logic;
  signal cost_address  : std_logic_vector(8 downto 0);
  signal cost_word     : std_logic_vector(COST_WIDTH - 1 downto 0);
  signal name_write    : std_logic;
  signal name_address  : std_logic_vector(4 downto 0);
  signal name_word     : std_logic_vector(7 downto 0);
  signal name_read     : std_logic_vector(4 downto 0);
  signal name          : std_logic_vector(7 downto 0);
  signal read_address  : std_logic_vector(8 downto 0);
  signal first_node    : node_t;

  -- the plan found
  signal t_place   : place_t;               -- stage whose code comes next
  signal t_first   : std_logic;             -- '1': it is the last one, whose child is in node_word
  signal t_short   : std_logic;             -- '1': t_place is short_stages
  signal t_zero    : std_logic;             -- '1': the code that no stage has is in the plan
  signal t_read    : std_logic;
  signal t_address : std_logic_vector(8 downto 0);
  signal t_word    : std_logic_vector(7 downto 0);
  signal t_code    : code_t;
  signal first_code : code_t;              -- the first one of the plan found
  signal t_parent  : slot_t;
  signal t_skip    : std_logic;             -- '1': that code comes now
  signal trail     : std_logic_vector(4 * STAGES - 1 downto 0);
  signal trace_at  : std_logic_vector(8 downto 0);

begin

  coefficients.angle     <= signed(c_angle);
  coefficients.decay_1   <= signed(c_decay_1);
  coefficients.decay_2   <= signed(c_decay_2);
  coefficients.flux_0    <= signed(c_flux_0);
  coefficients.flux_2    <= signed(c_flux_2);
  coefficients.flux_u    <= signed(c_flux_u);
  coefficients.flux_w    <= signed(c_flux_w);
  coefficients.forced_1  <= signed(c_forced_1);
  coefficients.forced_2  <= signed(c_forced_2);
  coefficients.level_1   <= signed(c_level_1);
  coefficients.level_2   <= signed(c_level_2);
  coefficients.neutral   <= signed(c_neutral);
  coefficients.capacitor <= signed(c_capacitor);

  settings.effort         <= unsigned(effort);
  settings.bound_neutral  <= unsigned(bound_neutral);
  settings.bound_phase    <= unsigned(bound_phase);
  settings.weight_neutral <= unsigned(weight_neutral);
  settings.weight_phase   <= unsigned(weight_phase);

  begin_all <= ready and start;

  terms_of_stages : entity work.kbest_terms
    port map (
      clk          => clk,
      rst          => rst,
      start        => begin_all,
      is_beta      => m_is_beta,
      psir_alpha   => m_psir_alpha,
      psir_beta    => m_psir_beta,
      v_dc         => m_v_dc,
      iref_alpha   => m_iref_alpha,
      iref_beta    => m_iref_beta,
      omega_s      => m_omega_s,
      omega_r      => m_omega_r,
      coefficients => coefficients,
      short        => unsigned(short_stages),
      odd          => period,
      compensate   => compensate,
      error_w      => error_w,
      begun        => terms_begun,
      ready        => terms_ready,
      long         => terms_long,
      node_at      => node_at,
      node_neutral => node_neutral,
      node_phase   => node_charge,
      child_at     => child_at,
      child_neutral => child_neutral,
      child_phase  => child_charge,
      linear_at    => linear_at,
      linear       => linear,
      taken        => terms_taken,
      saturated    => terms_clip
    );

  -- the node of the measurements
  first_node.u         <= shift_left(resize(m_iref_alpha, ERROR_WIDTH) - m_is_alpha, VECTOR_SHIFT);
  first_node.w         <= error_w;
  first_node.v_n       <= shift_right(m_v_n, VOLTAGE_SHIFT);
  first_node.d         <= (others => '0'); -- all three are written apart
  first_node.cost      <= (others => '0');
  first_node.positions <= positions;
  write_first          <= '1' when state = TERMS and terms_begun = '1' else
                          '0';

  -- the next node: the planned one as soon as it is there, the others when the list is whole; f_place is c_place or
  -- the place behind it
  f_slot  <= best when finished = '1' else
             warm_slot when f_zero = '1' else
             next_best when complete = '1' else
             ranked;
  fetch   <= not g_valid and ((f_zero and warm_known) or f_more
                              or (complete and f_one and to_std_logic(used > 1)));
  read    <= fetch or finished;

  name_read    <= LAST_PLACE(0) & std_logic_vector(f_slot) when finished = '1' else
                  not f_place(0) & std_logic_vector(f_slot);
  read_address <= name_read(4) & name;

  p_fetched : process (node_word, node_cost) is
  begin

    fetched      <= to_node(node_word(WORD_WIDTH - 1 downto 12));
    fetched.cost <= unsigned(node_cost);

  end process p_fetched;

  prepare <= '1' when g_valid = '1' and preparing = '0' and (g_first = '0' or terms_ready = '1') else
             '0';

  terms_taken <= '1' when prepare = '1' and g_first = '1' and g_place /= LAST_PLACE else
                 '0';

  node : entity work.kbest_node
    port map (
      clk          => clk,
      rst          => rst,
      start        => prepare,
      node         => fetched,
      code         => unsigned(node_word(11 downto 8)),
      parent       => unsigned(node_word(7 downto 4)),
      rank         => g_rank(3 downto 0),
      place        => g_place(1 downto 0),
      long         => node_long,
      coefficients => coefficients,
      settings     => settings,
      root         => root,
      root_at      => root_at,
      root_word    => root_word,
      charge_at    => node_at,
      neutral      => node_neutral,
      charge       => node_charge,
      linear_at    => linear_at,
      linear       => linear,
      done         => node_ends,
      held         => held_node,
      prepared     => prepared,
      half         => half,
      voltage_at   => voltage_at,
      voltage      => voltage,
      effect       => effect,
      share_at     => share_at,
      share        => share,
      saturated    => node_clip
    );

  -- the first node's v_ph - v_dc/4, one phase after the other
  root      <= '1' when state = TERMS and root_phase /= 3 else
               '0';
  root_at   <= not c_place(0) & std_logic_vector(root_phase);
  root_word <= resize(shift_right(signed('0' & selected(m_v_ph, std_logic_vector(root_phase), 16) & '0')
                                  - signed(resize(m_v_dc, 18)), VOLTAGE_SHIFT), VOLTAGE_WIDTH);

  node_long <= terms_long when g_first = '1' else
               kept_long;

  codes      <= plan & "0000";
  load       <= (node_ends or node_up) and not busy_children;
  load_alone <= '1' when p_place = 0 else
                '0';
  load_plan  <= '1' when p_first = '1' and p_place /= LAST_PLACE else
                '0';
  children : entity work.kbest_children
    port map (
      clk           => clk,
      rst           => rst,
      load          => load,
      prepared      => prepared,
      node          => held_node,
      half          => half,
      place         => p_place(1 downto 0),
      voltage_at    => voltage_at,
      voltage       => voltage,
      effect        => effect,
      share_at      => share_at,
      share         => share,
      charge_at     => child_at,
      neutral       => child_neutral,
      charge        => child_charge,
      alone         => load_alone,
      has_plan      => load_plan,
      plan          => p_code,
      first         => p_first,
      settings      => settings,
      busy          => busy_children,
      state_valid   => state_valid,
      state         => child_state,
      state_code    => state_code,
      state_number  => state_number,
      state_parity  => state_parity,
      child_valid   => child_valid,
      child_cost    => child_cost,
      child_places  => child_places,
      child_key     => child_key,
      child_number  => child_number,
      child_planned => child_planned,
      child_first   => child_first,
      child_parity  => child_parity,
      listed_number  => listed_number,
      listed_planned => listed_planned,
      listed_parity  => listed_parity,
      pending       => pending,
      saturated     => child_clip
    );

  list : entity work.kbest_list
    generic map (
      BEAM => BEAM
    )
    port map (
      clk       => clk,
      rst       => rst,
      insert    => child_valid,
      first     => child_first,
      planned   => child_planned,
      key       => child_key,
      positions => child_places,
      accepted  => accepted,
      slot      => slot,
      least     => least,
      used      => used,
      best      => best,
      next_best => next_best,
      hold      => complete,
      rank      => f_at,
      ranked    => ranked
    );

  write         <= write_first or state_valid;
  write_address <= not c_place(0) & x"00" when write_first = '1' else
                   state_parity & std_logic_vector(state_number);
  write_word    <= to_word(first_node) & x"000" when write_first = '1' else
                   to_word(child_state) & std_logic_vector(state_code) & std_logic_vector(w_rank)
                   & std_logic_vector(state_code) when w_root = '1' else
                   to_word(child_state) & std_logic_vector(state_code) & std_logic_vector(w_rank)
                   & std_logic_vector(w_lead);

  memory : entity work.ram
    generic map (
      ADDRESS_WIDTH => 9,
      WIDTH         => WORD_WIDTH,
      LATENCY       => 1,
      STYLE         => "apart"
    )
    port map (
      clk           => clk,
      write         => write,
      write_address => write_address,
      write_word    => write_word,
      read          => read,
      read_address  => read_address,
      read_word     => node_word
    );

  cost_write   <= write_first or child_valid;
  cost_address <= not c_place(0) & x"00" when write_first = '1' else
                  child_parity & std_logic_vector(child_number);
  cost_word    <= (others => '0') when write_first = '1' else
                  std_logic_vector(child_cost);

  costs : entity work.ram
    generic map (
      ADDRESS_WIDTH => 9,
      WIDTH         => COST_WIDTH,
      LATENCY       => 1,
      STYLE         => "apart"
    )
    port map (
      clk           => clk,
      write         => cost_write,
      write_address => cost_address,
      write_word    => cost_word,
      read          => read,
      read_address  => read_address,
      read_word     => node_cost
    );

  -- numbers of the children in the slots
  name_write   <= write_first or accepted;
  name_address <= not c_place(0) & x"0" when write_first = '1' else
                  listed_parity & std_logic_vector(slot);
  name_word    <= (others => '0') when write_first = '1' else
                  std_logic_vector(listed_number);

  names : entity work.ram
    generic map (
      ADDRESS_WIDTH => 5,
      WIDTH         => 8,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => name_write,
      write_address => name_address,
      write_word    => name_word,
      read          => '1',
      read_address  => name_read,
      read_word     => name
    );

  -- code of each node and rank of its parent
  trace_at  <= std_logic_vector(g_place(4 downto 0)) & std_logic_vector(g_rank(3 downto 0));
  t_code    <= unsigned(node_word(11 downto 8)) when t_first = '1' else
               unsigned(t_word(7 downto 4));
  t_parent  <= unsigned(node_word(7 downto 4)) when t_first = '1' else
               unsigned(t_word(3 downto 0));
  t_skip    <= '1' when t_zero = '0' and (period = '0' or t_short = '1') else
               '0';
  t_read    <= '1' when state = TRACE and t_skip = '0' else
               '0';
  t_address <= std_logic_vector(t_place(4 downto 0)) & std_logic_vector(t_parent);

  traces : entity work.ram
    generic map (
      ADDRESS_WIDTH => 9,
      WIDTH         => 8,
      LATENCY       => 1,
      STYLE         => "apart"
    )
    port map (
      clk           => clk,
      write         => prepare,
      write_address => trace_at,
      write_word    => node_word(11 downto 4),
      read          => t_read,
      read_address  => t_address,
      read_word     => t_word
    );

  -- all nodes of the collected stage are loaded, and the last of its children is being listed
  whole <= '1' when state = SEARCH and complete = '0' and finished = '0' and c_loaded = c_width
                    and ((c_place(0) = '1' and pending(1) = '0') or (c_place(0) = '0' and pending(0) = '0')) else
           '0';

  p_search : process (clk) is

    variable code : natural range 0 to 15;
    variable move : positions_t;

  begin

    if rising_edge(clk) then
      valid    <= '0';
      complete <= whole and not to_std_logic(c_place = LAST_PLACE);
      finished <= whole and to_std_logic(c_place = LAST_PLACE);
      f_more   <= not fetch and not f_zero and to_std_logic(f_place(0) = c_place(0) and f_at < c_width);

      if (terms_clip = '1' or node_clip = '1' or child_clip = '1') then
        flagged <= '1';
      end if;

      -- what a node gives to its children, to their states' clock
      v_root <= l_root;
      v_rank <= l_rank;
      v_lead <= l_lead;
      w_root <= v_root;
      w_rank <= v_rank;
      w_lead <= v_lead;

      -- reading and preparing nodes
      if (node_ends = '1') then
        node_up <= '1';
      end if;

      if (load = '1') then
        preparing <= '0';
        node_up   <= '0';
        l_root    <= to_std_logic(p_place = 1);
        l_rank    <= p_rank;
        l_lead    <= p_lead;

        if (p_place(0) = c_place(0)) then
          c_loaded <= c_loaded + 1;
        else
          c_ahead <= '1';
        end if;
      end if;

      if (prepare = '1') then
        g_valid   <= '0';
        preparing <= '1';
        p_place   <= g_place;
        p_first   <= g_first;
        p_rank    <= g_rank(3 downto 0);
        p_lead    <= unsigned(node_word(3 downto 0));
        kept_long <= node_long;
      end if;

      -- none of the stage in front of the first
      p_code <= unsigned(selected(codes, std_logic_vector(p_place), 4));

      if (fetch = '1') then
        g_valid <= '1';
        g_place <= f_place;
        g_rank  <= f_at;
        g_first <= '0';
        f_at    <= f_at + 1;
        f_zero  <= '0';
        f_one   <= f_zero;

        if (f_zero = '1') then
          g_first    <= '1';
          warm_known <= '0';
        end if;
      elsif (f_zero = '0' and f_place(0) = c_place(0) and f_at = c_width and f_place /= LAST_PLACE) then
        f_at    <= (others => '0');
        f_zero  <= '1';
        f_one   <= '0';
        f_place <= f_place + 1;
      end if;

      if (accepted = '1' and listed_planned = '1') then
        warm_known <= '1';
        warm_slot  <= slot;
      end if;

      if (complete = '1') then
        c_place  <= c_place + 1;
        c_width  <= used;
        c_ahead  <= '0';
        c_loaded <= (others => '0');

        -- the next stage's first node may be loaded already, or just now
        if (c_ahead = '1' or (load = '1' and p_place(0) /= c_place(0))) then
          c_loaded <= to_unsigned(1, c_loaded'length);
        end if;
      end if;

      case state is

        when IDLE =>
          null;

        when TERMS =>
          if (root = '1') then
            root_phase <= root_phase + 1;
          end if;

          if (terms_begun = '1') then
            state      <= SEARCH;
            warm_known <= '1';
          end if;

        when SEARCH =>
          if (finished = '1') then
            state <= LEAD;
          end if;

        when LEAD =>
          state      <= SHOW;
          first_code <= unsigned(node_word(3 downto 0));

        when SHOW =>
          state     <= TRACE;
          valid     <= '1';
          saturated <= flagged;
          cost      <= std_logic_vector(least);
          code      := to_integer(first_code);
          move      := positions;
          held      <= '0';

          case code is

            when 1 | 2 | 3 =>
              move(0) := to_unsigned(NEIGHBOUR_OF(to_integer(positions(0)), code - 1), 3);

            when 4 | 5 | 6 =>
              move(1) := to_unsigned(NEIGHBOUR_OF(to_integer(positions(1)), code - 4), 3);

            when 7 | 8 | 9 =>
              move(2) := to_unsigned(NEIGHBOUR_OF(to_integer(positions(2)), code - 7), 3);

            when others =>
              held <= '1';

          end case;

          s_a     <= std_logic_vector(move(0));
          s_b     <= std_logic_vector(move(1));
          s_c     <= std_logic_vector(move(2));
          t_place <= LAST_PLACE;
          t_short <= to_std_logic(LAST_PLACE = unsigned(short_stages));
          t_first <= '1';
          t_zero  <= '0';

        when TRACE =>
          -- from the last stage to the first, whose code is the decision
          if (t_skip = '1') then
            t_zero <= '1';
            trail  <= trail(4 * STAGES - 5 downto 0) & "0000";
          elsif (t_place = 1) then
            state    <= IDLE;
            ready    <= '1';
            odd_next <= not period;
          else
            t_first <= '0';
            t_place <= t_place - 1;
            t_short <= to_std_logic(t_place = resize(unsigned(short_stages), place_t'length) + 1);
            trail   <= trail(4 * STAGES - 5 downto 0) & std_logic_vector(t_code);
          end if;

      end case;

      if (begin_all = '1') then
        ready         <= '0';
        state         <= TERMS;
        m_is_alpha    <= signed(is_alpha);
        m_is_beta     <= signed(is_beta);
        m_psir_alpha  <= signed(psir_alpha);
        m_psir_beta   <= signed(psir_beta);
        m_v_n         <= signed(v_n);
        m_v_dc        <= unsigned(v_dc);
        m_iref_alpha  <= signed(iref_alpha);
        m_iref_beta   <= signed(iref_beta);
        m_omega_s     <= signed(omega_s);
        m_omega_r     <= signed(omega_r);
        positions     <= (unsigned(s_prev_a), unsigned(s_prev_b), unsigned(s_prev_c));
        period        <= odd;
        flagged       <= '0';
        m_v_ph        <= v_ph_c & v_ph_b & v_ph_a;
        root_phase    <= (others => '0');

        c_place    <= to_unsigned(1, place_t'length);
        f_place    <= to_unsigned(1, place_t'length);

        if (compensate = '1') then
          c_place <= to_unsigned(0, place_t'length);
          f_place <= to_unsigned(0, place_t'length);
        end if;

        f_at       <= (others => '0');
        f_zero     <= '1';
        f_one      <= '0';
        c_width    <= to_unsigned(1, c_width'length);
        c_loaded   <= (others => '0');
        c_ahead    <= '0';
        warm_slot  <= (others => '0');
        g_valid    <= '0';
      end if;

      if (rst = '1') then
        state      <= IDLE;
        ready      <= '1';
        preparing  <= '0';
        node_up    <= '0';
        g_valid    <= '0';
        warm_known <= '0';
        complete   <= '0';
        finished   <= '0';
        f_zero     <= '1';
        f_more     <= '0';
      end if;
    end if;

  end process p_search;

  busy      <= not ready;
  plan_next <= trail;

end architecture rtl;
