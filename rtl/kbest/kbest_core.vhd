-- K-best direct MPC of a five-level ANPC drive: the core (docs/specification.md, section 10).
--
-- A decision searches the plan of least cost over STAGES stages, of which the BEAM best live on from
-- stage to stage.  Give the measurements, the positions and the plan with a one-clock start; valid comes
-- with the positions to apply and the plan for the next decision.
--
-- The children of a stage's nodes stream through one pipeline, one a clock, into a sorted list.  Their
-- states lie in a memory with two halves: one is read as the nodes of this stage, the other one written
-- with those of the next.  The planned node of the next stage is known early; its children follow those
-- of the last node of this stage at once.
--
-- Formats: per unit with the scales at each port; parameters as directmpc.kbest.coefficients computes
-- them from a drive file.
-- Latency: 1050 clocks at most with BEAM = 8 and STAGES = 12, 1075 with compensate.  One decision at a
-- time; the next start may come with valid.
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
    -- where the switches are, and the plan, sampled with start
    s_prev_a : in    std_logic_vector(2 downto 0);              -- switch position s(k-1) of phase a, 0 to 7
    s_prev_b : in    std_logic_vector(2 downto 0);              -- switch position s(k-1) of phase b, 0 to 7
    s_prev_c : in    std_logic_vector(2 downto 0);              -- switch position s(k-1) of phase c, 0 to 7
    plan     : in    std_logic_vector(4 * STAGES - 1 downto 0); -- code of each stage, the first rightmost
    odd      : in    std_logic;                                 -- '1': the period is an odd one
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
    plan_next : out   std_logic_vector(4 * STAGES - 1 downto 0); -- plan for the next start
    odd_next  : out   std_logic;                                 -- '1': its period is an odd one
    cost      : out   std_logic_vector(COST_WIDTH - 1 downto 0); -- key of the plan found, unsigned, 1/15625 pu**2
    saturated : out   std_logic                                  -- '1': a value did not fit its word
  );
end entity kbest_core;

architecture rtl of kbest_core is

  subtype path_t is std_logic_vector(4 * STAGES - 1 downto 0);

  subtype place_t is unsigned(5 downto 0);

  constant WORD_WIDTH : natural := NODE_WIDTH + 4 * STAGES;
  constant DELAY      : natural := 7; -- from a child's code to the child
  constant LAST_PLACE : place_t := to_unsigned(STAGES, place_t'length);

  type paths_t is array (1 to DELAY) of path_t;

  type state_t is (IDLE, TERMS, SEARCH, BEST, SHOW);

  signal coefficients : coefficients_t;
  signal settings     : settings_t;

  signal state     : state_t;
  signal begin_all : std_logic;
  signal positions : positions_t;
  signal planned   : path_t;    -- codes of the plan, the next stage's rightmost
  signal period    : std_logic; -- '1': an odd one
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
  signal deviations   : voltages_t;

  -- stage terms
  signal error_w     : error_t;
  signal terms_ready : std_logic;
  signal terms_new   : stage_t;
  signal terms_taken : std_logic;
  signal terms_clip  : std_logic;
  signal terms_kept  : stage_t; -- of the stage whose nodes are prepared
  signal terms_now   : stage_t;

  -- places are stages, counted from 1; place 0 is the stage in front of the first
  signal f_place    : place_t;              -- node that is read next
  signal f_at       : unsigned(4 downto 0); -- its place in the list
  signal f_known    : std_logic;
  signal f_slot     : slot_t;
  signal read       : std_logic;
  signal g_valid    : std_logic;            -- '1': node_word is a node that waits
  signal g_place    : place_t;
  signal g_first    : std_logic;            -- '1': the first of its stage
  signal node_word  : std_logic_vector(WORD_WIDTH - 1 downto 0);
  signal fetched    : node_t;
  signal prepare    : std_logic;
  signal preparing  : std_logic;            -- '1': a node is being prepared, or waits to be loaded
  signal node_done  : std_logic;
  signal node_up    : std_logic;            -- '1': prepared is whole
  signal node_clip  : std_logic;
  signal prepared   : prepared_t;
  signal p_place    : place_t;
  signal p_first    : std_logic;
  signal p_path     : path_t;
  signal load       : std_logic;
  signal load_alone : std_logic;
  signal load_plan  : std_logic;
  signal load_code  : code_t;
  signal l_path     : path_t;
  signal paths      : paths_t;

  -- the stage that is collected in the list
  signal c_place    : place_t;
  signal c_width    : unsigned(4 downto 0); -- its nodes
  signal c_loaded   : unsigned(4 downto 0); -- those that are loaded
  signal c_ahead    : std_logic;            -- '1': the first node of the next stage is loaded
  signal c_order    : std_logic_vector(4 * BEAM - 1 downto 0);
  signal complete   : std_logic;
  signal warm_known : std_logic;            -- '1': the planned node of stage f_place is in the memory
  signal warm_slot  : slot_t;

  -- children
  signal busy_children : std_logic;
  signal pending       : std_logic_vector(1 downto 0);
  signal child_valid   : std_logic;
  signal child         : node_t;
  signal child_places  : std_logic_vector(8 downto 0);
  signal child_key     : cost_t;
  signal child_code    : code_t;
  signal child_planned : std_logic;
  signal child_first   : std_logic;
  signal child_parity  : std_logic;
  signal child_clip    : std_logic;

  -- list and memory
  signal accepted      : std_logic;
  signal slot          : slot_t;
  signal least         : cost_t;
  signal order         : std_logic_vector(4 * BEAM - 1 downto 0);
  signal used          : std_logic_vector(BEAM - 1 downto 0);
  signal write_first   : std_logic;
  signal write         : std_logic;
  signal write_address : std_logic_vector(4 downto 0);
  signal write_word    : std_logic_vector(WORD_WIDTH - 1 downto 0);
  signal read_address  : std_logic_vector(4 downto 0);
  signal first_node    : node_t;

  -- how many entries are in use
  function count (bits : std_logic_vector) return unsigned is

    variable result : unsigned(4 downto 0);

  begin

    result := (others => '0');

    for i in bits'range loop
      if (bits(i) = '1') then
        result := result + 1;
      end if;
    end loop;

    return result;

  end function count;

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

  begin_all <= '1' when state = IDLE and start = '1' else
               '0';

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
      ready        => terms_ready,
      stage        => terms_new,
      taken        => terms_taken,
      saturated    => terms_clip
    );

  -- the node of the measurements
  first_node.u         <= shift_left(resize(m_iref_alpha, ERROR_WIDTH) - m_is_alpha, VECTOR_SHIFT);
  first_node.w         <= error_w;
  first_node.v_n       <= shift_right(m_v_n, VOLTAGE_SHIFT);
  first_node.d         <= deviations;
  first_node.cost      <= (others => '0');
  first_node.positions <= positions;
  write_first          <= '1' when state = TERMS and terms_ready = '1' else
                          '0';

  -- the next node: the planned one as soon as it is there, the others when the list is whole
  f_known <= '0' when state /= SEARCH else
             warm_known when f_at = 0 else
             used(1 mod BEAM) when complete = '1' and f_at = 1 and f_place = c_place + 1 and BEAM > 1 else
             '1' when f_place = c_place and f_at < c_width else
             '0';
  -- the second node is read in the clock in which the list is whole
  f_slot  <= warm_slot when f_at = 0 else
             unsigned(order(4 * (1 mod BEAM) + 3 downto 4 * (1 mod BEAM))) when complete = '1' else
             unsigned(selected(c_order, std_logic_vector(f_at), 4));
  read    <= '1' when state = BEST or (f_known = '1' and g_valid = '0') else
             '0';

  read_address <= LAST_PLACE(0) & order(3 downto 0) when state = BEST else
                  not f_place(0) & std_logic_vector(f_slot);

  fetched   <= to_node(node_word(WORD_WIDTH - 1 downto 4 * STAGES));
  prepare   <= '1' when g_valid = '1' and (preparing = '0' or load = '1') and (g_first = '0' or terms_ready = '1') else
               '0';
  terms_now <= terms_new when g_first = '1' else
               terms_kept;

  terms_taken <= '1' when prepare = '1' and g_first = '1' and g_place /= LAST_PLACE else
                 '0';

  node : entity work.kbest_node
    port map (
      clk       => clk,
      rst       => rst,
      start     => prepare,
      node      => fetched,
      stage     => terms_now,
      settings  => settings,
      done      => node_done,
      prepared  => prepared,
      saturated => node_clip
    );

  load       <= (node_done or node_up) and not busy_children;
  load_alone <= '1' when p_place = 0 else
                '0';
  load_plan  <= '1' when p_first = '1' and p_place /= LAST_PLACE else
                '0';
  load_code  <= "0000" when p_place = 0 else
                unsigned(planned(3 downto 0));

  children : entity work.kbest_children
    port map (
      clk           => clk,
      rst           => rst,
      load          => load,
      prepared      => prepared,
      alone         => load_alone,
      has_plan      => load_plan,
      plan          => load_code,
      first         => p_first,
      parity        => p_place(0),
      settings      => settings,
      busy          => busy_children,
      pending       => pending,
      child_valid   => child_valid,
      child         => child,
      child_key     => child_key,
      child_code    => child_code,
      child_planned => child_planned,
      child_first   => child_first,
      child_parity  => child_parity,
      saturated     => child_clip
    );

  child_places <= std_logic_vector(child.positions(0)) & std_logic_vector(child.positions(1))
                  & std_logic_vector(child.positions(2));

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
      order     => order,
      used      => used
    );

  write         <= write_first or accepted;
  write_address <= not c_place(0) & "0000" when write_first = '1' else
                   child_parity & std_logic_vector(slot);
  write_word    <= to_word(first_node) & (path_t'range => '0') when write_first = '1' else
                   to_word(child) & std_logic_vector(child_code) & paths(DELAY)(4 * STAGES - 1 downto 4);

  memory : entity work.ram
    generic map (
      ADDRESS_WIDTH => 5,
      WIDTH         => WORD_WIDTH,
      LATENCY       => 1,
      STYLE         => "block"
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

  -- all nodes of the collected stage are loaded, and none of its children is under way
  complete <= '1' when state = SEARCH and c_loaded = c_width
                       and ((c_place(0) = '1' and pending(1) = '0') or (c_place(0) = '0' and pending(0) = '0')) else
              '0';

  p_search : process (clk) is

    variable wide : signed(17 downto 0);
    variable path : path_t;
    variable code : natural range 0 to 15;
    variable move : positions_t;

  begin

    if rising_edge(clk) then
      valid <= '0';

      if (terms_clip = '1' or node_clip = '1' or child_clip = '1') then
        flagged <= '1';
      end if;

      paths <= l_path & paths(1 to DELAY - 1);

      -- reading and preparing nodes
      if (node_done = '1') then
        node_up <= '1';
      end if;

      if (load = '1') then
        preparing <= '0';
        node_up   <= '0';
        l_path    <= p_path;

        if (p_place /= 0 and p_first = '1') then
          planned <= "0000" & planned(4 * STAGES - 1 downto 4);
        end if;

        if (p_place = c_place) then
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
        p_path    <= node_word(4 * STAGES - 1 downto 0);

        if (g_first = '1') then
          terms_kept <= terms_new;
        end if;
      end if;

      if (state = SEARCH and f_known = '1' and g_valid = '0') then
        g_valid <= '1';
        g_place <= f_place;
        g_first <= '0';
        f_at    <= f_at + 1;

        if (f_at = 0) then
          g_first    <= '1';
          warm_known <= '0';
        end if;
      elsif (state = SEARCH and f_at /= 0 and f_place = c_place and f_at = c_width and f_place /= LAST_PLACE) then
        f_at    <= (others => '0');
        f_place <= f_place + 1;
      end if;

      if (accepted = '1' and child_planned = '1') then
        warm_known <= '1';
        warm_slot  <= slot;
      end if;

      case state is

        when IDLE =>
          if (start = '1') then
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
            planned       <= plan;
            period        <= odd;
            flagged       <= '0';
            wide          := signed('0' & v_ph_a & '0') - signed(resize(unsigned(v_dc), wide'length));
            deviations(0) <= wide(VOLTAGE_SHIFT + VOLTAGE_WIDTH - 1 downto VOLTAGE_SHIFT);
            wide          := signed('0' & v_ph_b & '0') - signed(resize(unsigned(v_dc), wide'length));
            deviations(1) <= wide(VOLTAGE_SHIFT + VOLTAGE_WIDTH - 1 downto VOLTAGE_SHIFT);
            wide          := signed('0' & v_ph_c & '0') - signed(resize(unsigned(v_dc), wide'length));
            deviations(2) <= wide(VOLTAGE_SHIFT + VOLTAGE_WIDTH - 1 downto VOLTAGE_SHIFT);

            c_place    <= to_unsigned(1, place_t'length);
            f_place    <= to_unsigned(1, place_t'length);

            if (compensate = '1') then
              c_place <= to_unsigned(0, place_t'length);
              f_place <= to_unsigned(0, place_t'length);
            end if;

            f_at       <= (others => '0');
            c_width    <= to_unsigned(1, c_width'length);
            c_loaded   <= (others => '0');
            c_ahead    <= '0';
            warm_known <= '1';
            warm_slot  <= (others => '0');
            g_valid    <= '0';
          end if;

        when TERMS =>
          if (terms_ready = '1') then
            state <= SEARCH;
          end if;

        when SEARCH =>
          if (complete = '1') then
            if (c_place = LAST_PLACE) then
              state <= BEST;
            else
              c_place  <= c_place + 1;
              c_width  <= count(used);
              c_order  <= order;
              c_ahead  <= '0';
              c_loaded <= (others => '0');

              -- the next stage's first node may be loaded already, or just now
              if (c_ahead = '1' or (load = '1' and p_place /= c_place)) then
                c_loaded <= to_unsigned(1, c_loaded'length);
              end if;
            end if;
          end if;

        when BEST =>
          state <= SHOW;

        when SHOW =>
          state     <= IDLE;
          valid     <= '1';
          saturated <= flagged;
          odd_next  <= not period;
          cost      <= std_logic_vector(least);
          path      := node_word(4 * STAGES - 1 downto 0);
          code      := to_integer(unsigned(path(3 downto 0)));
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

          s_a       <= std_logic_vector(move(0));
          s_b       <= std_logic_vector(move(1));
          s_c       <= std_logic_vector(move(2));
          plan_next <= "0000" & path(4 * STAGES - 1 downto 4);

          if (period = '1') then
            for j in 0 to STAGES - 1 loop
              if (j + 1 = to_integer(unsigned(short_stages))) then
                plan_next(4 * j + 3 downto 4 * j) <= "0000";
              elsif (j >= to_integer(unsigned(short_stages))) then
                plan_next(4 * j + 3 downto 4 * j) <= path(4 * j + 3 downto 4 * j);
              end if;
            end loop;
          end if;

      end case;

      if (rst = '1') then
        state      <= IDLE;
        preparing  <= '0';
        node_up    <= '0';
        g_valid    <= '0';
        warm_known <= '0';
      end if;
    end if;

  end process p_search;

  busy <= '0' when state = IDLE else
          '1';

end architecture rtl;
