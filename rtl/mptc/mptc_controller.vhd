-- MPTC and MPFC (Paper B) with records as ports; mptc_core is the same with flat ports and explains what it
-- decides.
--
-- Parts: mptc_sequencer counts the clocks and reads the program; mptc_datapath predicts the state with three
-- mac_blocks; mptc_vector_stream tries the vectors; mptc_flux_reference forms the reference of MPFC. With FAMILY
-- mptc_shares takes the mean of the running sequence, mptc_pair_stream tries the pairs of MPTC1, MPTC2 and GTV, and
-- mptc_hexagon finds the vectors and times of the flux methods.
--
-- Formats, latency, overflow: as in mptc_core.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_controller is
  generic (
    FLUX_CONTROL : boolean := true; -- true: MPFC can be chosen at run time
    FAMILY       : boolean := false -- true: methods of several vectors too; needs FLUX_CONTROL
  );
  port (
    clk          : in    std_logic;           -- rising edge
    rst          : in    std_logic;           -- synchronous, active high
    start        : in    std_logic;           -- '1' for one clock: decide; ignored while busy
    inputs       : in    mptc_inputs_t;       -- measurements and references, sampled with start
    running      : in    mptc_sequence_t;     -- FAMILY: what is being applied, sampled with start
    coefficients : in    mptc_coefficients_t; -- parameters from a drive file, stable from start to valid
    method_mpfc  : in    std_logic;           -- '1': MPFC, '0': MPTC; sampled with start
    family_method : in    family_t;            -- FAMILY: method of several vectors; sampled with start
    duty_rule     : in    duty_rule_t;         -- FAMILY: how MPTC1 and MPTC2 find a duty; sampled with start
    decision     : out   mptc_decision_t;     -- stable until the next valid
    cost         : out   compared_t;          -- of a single vector, signed, with valid
    chosen       : out   mptc_sequence_t      -- what to apply next, stable until the next valid
  );
end entity mptc_controller;

architecture rtl of mptc_controller is

  signal accept     : std_logic;
  signal busy       : std_logic;
  signal idle       : std_logic;
  signal mpfc       : std_logic;
  signal sample     : mptc_inputs_t;
  signal products   : mptc_products_t;
  signal events     : mptc_events_t;
  signal state      : mptc_state_t;
  signal sum        : sum_t;
  signal overflow   : std_logic;
  signal difference : word_t;
  signal too_far    : std_logic;
  signal term       : term_t;
  signal target     : mptc_reference_t;
  signal number     : vector_t;
  signal method     : family_t;
  signal mean       : std_logic;
  signal both       : std_logic;
  signal length     : mptc_length_t;
  signal tried      : mptc_tried_t;
  signal residues   : mptc_residues_t;
  signal sum_alpha  : sum_t;
  signal sum_beta   : sum_t;
  signal far        : std_logic;
  signal long       : std_logic; -- '1': the times of what is being applied are more than the period
  signal leader     : vector_t;
  signal cheaper    : std_logic;
  signal mean_alpha : word_t;
  signal mean_beta  : word_t;
  signal u_next     : vector_t;

begin

  i_sequencer : entity work.mptc_sequencer
    generic map (
      FLUX_CONTROL => FLUX_CONTROL,
      FAMILY       => FAMILY
    )
    port map (
      clk         => clk,
      rst         => rst,
      start       => start,
      method_mpfc => method_mpfc,
      family_method => family_method,
      duty_rule   => duty_rule,
      accept      => accept,
      mpfc        => mpfc,
      method      => method,
      mean        => mean,
      both_duties => both,
      products    => products,
      events      => events,
      valid       => decision.valid,
      busy        => busy
    );

  decision.busy <= busy;
  idle          <= not busy;

  p_sample : process (clk) is
  begin

    if rising_edge(clk) then
      if (accept = '1') then
        sample <= inputs;
      end if;
    end if;

  end process p_sample;

  i_datapath : entity work.mptc_datapath
    generic map (
      FLUX_CONTROL => FLUX_CONTROL,
      FAMILY       => FAMILY
    )
    port map (
      clk          => clk,
      idle         => idle,
      mpfc         => mpfc,
      products     => products,
      events       => events,
      sample       => sample,
      mean_alpha   => mean_alpha,
      mean_beta    => mean_beta,
      coefficients => coefficients,
      difference   => difference,
      too_far      => too_far,
      term         => term,
      target       => target,
      state        => state,
      residues     => residues,
      sum_alpha    => sum_alpha,
      sum_beta     => sum_beta,
      sum          => sum,
      overflow     => overflow
    );

  g_flux_control : if FLUX_CONTROL generate

    i_reference : entity work.mptc_flux_reference
      port map (
        clk       => clk,
        rst       => rst,
        square    => events.square,
        rest      => events.radicand,
        sum       => sum,
        moment    => state.moment,
        target    => target
      );

  end generate g_flux_control;

  g_torque_control : if not FLUX_CONTROL generate
    target.along  <= (others => '0');
    target.across <= (others => '0');
    target.beyond <= '0';
  end generate g_torque_control;

  i_stream : entity work.mptc_vector_stream
    generic map (
      FLUX_CONTROL => FLUX_CONTROL,
      FAMILY       => FAMILY
    )
    port map (
      clk          => clk,
      rst          => rst,
      begin_stream => events.begin_stream,
      last         => events.last,
      mpfc         => mpfc,
      applied      => sample.u,
      psi_ref      => sample.psi_ref,
      state        => state,
      method       => method,
      both_duties  => both,
      tried        => tried,
      sum          => sum,
      sum_beta     => sum_alpha,
      difference   => difference,
      term         => term,
      overflow     => too_far,
      length       => length,
      cheaper      => cheaper,
      leader       => leader,
      number       => number,
      least        => cost
    );

  ---------------------------------------------------------------------------------------------
  -- Several vectors
  ---------------------------------------------------------------------------------------------

  g_family : if FAMILY generate

    signal applied  : mptc_sequence_t;
    signal single   : std_logic;       -- '1': the last decision is MPTC's or MPFC's
    signal pair     : mptc_sequence_t;
    signal flux     : mptc_sequence_t;
    signal several  : mptc_sequence_t;
    signal found    : mptc_duty_t;

  begin

    p_applied : process (clk) is
    begin

      if rising_edge(clk) then
        if (accept = '1') then
          applied <= fitted(running);
          long    <= too_long(running);
        end if;

        if (events.last = '1') then
          single  <= to_std_logic(method = FAMILY_NONE);
          several <= pair;

          if (method(2) = '1') then
            several <= flux;
          end if;
        end if;
      end if;

    end process p_applied;

    i_shares : entity work.mptc_shares
      port map (
        clk        => clk,
        begin_mean => accept,
        running    => applied,
        found      => found,
        alpha      => mean_alpha,
        beta       => mean_beta
      );

    i_pairs : entity work.mptc_pair_stream
      port map (
        clk         => clk,
        rst         => rst,
        begin_pairs => events.begin_pairs,
        last        => events.last,
        method      => method,
        mean        => mean,
        both_duties => both,
        leader      => leader,
        state       => state,
        length      => length,
        product     => sum_beta,
        cheaper     => cheaper,
        found       => found,
        tried       => tried,
        chosen      => pair
      );

    i_hexagon : entity work.mptc_hexagon
      port map (
        clk       => clk,
        rst       => rst,
        method    => method,
        running   => applied,
        way_alpha => events.way_alpha,
        way_beta  => events.way_beta,
        sum       => sum,
        rest      => events.rest,
        sum_alpha => sum_alpha,
        sum_beta  => sum_beta,
        last      => events.last,
        residues  => residues,
        chosen    => flux,
        far       => far
      );

    p_chosen : process (single, several, number) is
    begin

      if (single = '1') then
        chosen <= (number, number, number, WHOLE_PERIOD, (others => '0'));
        u_next <= number;
      else
        chosen <= several;
        u_next <= several.u1;
      end if;

    end process p_chosen;

  end generate g_family;

  g_one_vector : if not FAMILY generate
    mean_alpha <= (others => '0');
    mean_beta  <= (others => '0');
    tried      <= NOTHING_TRIED;
    residues   <= NO_RESIDUES;
    far        <= '0';
    long       <= '0';
    u_next     <= number;
    chosen.u1  <= number;
    chosen.u2  <= number;
    chosen.u3  <= number;
    chosen.t1  <= WHOLE_PERIOD;
    chosen.t2  <= (others => '0');
  end generate g_one_vector;

  p_flags : process (clk) is
  begin

    if rising_edge(clk) then
      if (events.last = '1') then
        decision.saturated <= overflow or (far and method(2)) or long;
        decision.clamped   <= target.beyond and mpfc;
      end if;
    end if;

  end process p_flags;

  decision.u_next   <= u_next;
  decision.switches <= switches_of_vector(u_next);

end architecture rtl;
