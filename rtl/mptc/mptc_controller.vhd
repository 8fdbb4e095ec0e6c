-- Two-level controllers MPTC and MPFC (Paper B) with records as ports; mptc_core is the same with flat ports and
-- explains what it decides.
--
-- Parts: mptc_sequencer counts the clocks and reads the program; mptc_datapath predicts the state with three
-- mac_blocks; mptc_vector_stream tries the vectors; mptc_flux_reference forms the reference of MPFC.
--
-- Formats, latency, overflow: as in mptc_core.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library work;
  use work.mptc_types.all;
  use work.mptc_vectors.all;

entity mptc_controller is
  generic (
    FLUX_CONTROL : boolean := true -- true: MPFC can be chosen at run time
  );
  port (
    clk          : in    std_logic;           -- rising edge
    rst          : in    std_logic;           -- synchronous, active high
    start        : in    std_logic;           -- '1' for one clock: decide; ignored while busy
    inputs       : in    mptc_inputs_t;       -- measurements and references, sampled with start
    coefficients : in    mptc_coefficients_t; -- parameters from a drive file, stable from start to valid
    method_mpfc  : in    std_logic;           -- '1': MPFC, '0': MPTC; sampled with start
    decision     : out   mptc_decision_t      -- stable until the next valid
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

begin

  i_sequencer : entity work.mptc_sequencer
    generic map (
      FLUX_CONTROL => FLUX_CONTROL
    )
    port map (
      clk         => clk,
      rst         => rst,
      start       => start,
      method_mpfc => method_mpfc,
      accept      => accept,
      mpfc        => mpfc,
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
      FLUX_CONTROL => FLUX_CONTROL
    )
    port map (
      clk          => clk,
      idle         => idle,
      mpfc         => mpfc,
      products     => products,
      events       => events,
      sample       => sample,
      coefficients => coefficients,
      difference   => difference,
      too_far      => too_far,
      term         => term,
      target       => target,
      state        => state,
      sum          => sum,
      overflow     => overflow
    );

  g_flux_control : if FLUX_CONTROL generate

    i_reference : entity work.mptc_flux_reference
      port map (
        clk       => clk,
        rst       => rst,
        square    => events.square,
        rest      => events.rest,
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
    port map (
      clk          => clk,
      rst          => rst,
      begin_stream => events.begin_stream,
      last         => events.last,
      mpfc         => mpfc,
      applied      => sample.u,
      psi_ref      => sample.psi_ref,
      state        => state,
      sum          => sum,
      difference   => difference,
      term         => term,
      overflow     => too_far,
      number       => number
    );

  p_flags : process (clk) is
  begin

    if rising_edge(clk) then
      if (events.last = '1') then
        decision.saturated <= overflow;
        decision.clamped   <= target.beyond and mpfc;
      end if;
    end if;

  end process p_flags;

  decision.u_next   <= number;
  decision.switches <= switches_of_vector(number);

end architecture rtl;
