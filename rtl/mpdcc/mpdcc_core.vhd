-- Model predictive direct current control of a five-level ANPC drive (Paper A): the core.
--
-- One scheduler and EXPLORERS explorers. Give the measurements with a one-clock start; valid comes
-- with the switch position for this step.  docs/specification.md, section 2: hold while every output
-- stays inside its bound, else the candidate of least switching effort per step of validity.
--
-- Formats: per unit with the scales at each port; parameters as directmpc.mpdcc.coefficients computes
-- them from a drive file, in units of that drive.
-- Latency: fast 21 clocks when held, at most 112, 82, 73 with one to three explorers and 70 with
-- more; paper 28 when held, at most 62 + 22 * (63 / EXPLORERS) + 63 mod EXPLORERS. One decision at a
-- time, the next start may come one clock after valid.
-- With two_switchings (SESE, SECOND_LEVEL) a search takes at most 3470, 1928, 1755 with one to three
-- explorers and 1191 with more; compensate adds 30 clocks to a hold and 33 to a search.
-- Where no candidate stays inside its bounds the decision is the candidate of the least largest excess at
-- k+1; with deadlock_rule (WEIGHTED_DEADLOCK) v_n's counts eight times and a sixteenth of the currents'
-- largest is added, see explorer_fast and docs/deadlocks.md. It takes no clock more.
-- Overflow: saturates and sets saturated; nothing wraps.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_constants.all;
  use work.mpdcc_types.all;

entity mpdcc_core is
  generic (
    EXPLORERS         : positive range 1 to 8 := 2;     -- number of explorers
    FOLDED            : boolean               := false; -- true: the paper's explorer, false: the fast one
    SECOND_LEVEL      : boolean               := false; -- true: SESE and delay compensation, fast explorer alone
    WEIGHTED_DEADLOCK : boolean               := false  -- true: the weighted deadlock rule, fast explorer alone
  );
  port (
    clk                  : in    std_logic;                               -- rising edge
    rst                  : in    std_logic;                               -- synchronous, active high
    start                : in    std_logic; -- '1' for one clock: decide; ignored while busy
    -- measurements, sampled with start
    is_alpha             : in    std_logic_vector(15 downto 0);           -- stator current, signed, 1/16000 pu
    is_beta              : in    std_logic_vector(15 downto 0);           -- signed, 1/16000 pu
    psir_alpha           : in    std_logic_vector(15 downto 0);           -- rotor flux, signed, 1/9000 pu
    psir_beta            : in    std_logic_vector(15 downto 0);           -- signed, 1/9000 pu
    v_n                  : in    std_logic_vector(15 downto 0); -- neutral point potential, signed, 1/64012.5 pu
    v_ph_a               : in    std_logic_vector(15 downto 0); -- phase capacitor voltage, unsigned, 1/32006.25 pu
    v_ph_b               : in    std_logic_vector(15 downto 0);           -- unsigned, 1/32006.25 pu
    v_ph_c               : in    std_logic_vector(15 downto 0);           -- unsigned, 1/32006.25 pu
    v_dc                 : in    std_logic_vector(15 downto 0);           -- dc-link voltage, unsigned, 1/16003.125 pu
    iref_alpha           : in    std_logic_vector(15 downto 0);           -- current reference, signed, 1/16000 pu
    iref_beta            : in    std_logic_vector(15 downto 0);           -- signed, 1/16000 pu
    omega_s              : in    std_logic_vector(15 downto 0);           -- stator frequency, signed, 1/16000 pu
    omega_r              : in    std_logic_vector(15 downto 0);           -- rotor speed, signed, 1/16000 pu
    s_prev_a             : in    std_logic_vector(2 downto 0);            -- switch position s(k-1) of phase a, 0 to 7
    s_prev_b             : in    std_logic_vector(2 downto 0);            -- switch position s(k-1) of phase b, 0 to 7
    s_prev_c             : in    std_logic_vector(2 downto 0);            -- switch position s(k-1) of phase c, 0 to 7
    -- parameters from a drive file, stable from start to valid; signed unless said otherwise
    c_error_alpha        : in    std_logic_vector(15 downto 0);           -- (iref - is) to trajectory units, scaled
    c_error_beta         : in    std_logic_vector(15 downto 0);           -- the same times sqrt(3)/2, scaled
    c_error_neutral      : in    std_logic_vector(15 downto 0);           -- -v_n to trajectory units, scaled
    c_error_phase        : in    std_logic_vector(15 downto 0); -- (v_dc/4 - v_ph) to trajectory units, scaled
    c_stator_alpha       : in    std_logic_vector(15 downto 0);           -- h/tau_s, scaled
    c_stator_beta        : in    std_logic_vector(15 downto 0);           -- h/tau_s * sqrt(3)/2, scaled
    c_rotor_alpha        : in    std_logic_vector(15 downto 0);           -- -h*Xm/(D*tau_r), scaled
    c_rotor_beta         : in    std_logic_vector(15 downto 0);           -- -h*Xm/(D*tau_r) * sqrt(3)/2, scaled
    c_reference_alpha    : in    std_logic_vector(15 downto 0);           -- -h, scaled
    c_reference_beta     : in    std_logic_vector(15 downto 0);           -- h * sqrt(3)/2, scaled
    c_emf_alpha          : in    std_logic_vector(15 downto 0);           -- -h*Xm/D, scaled
    c_emf_beta           : in    std_logic_vector(15 downto 0);           -- h*Xm/D * sqrt(3)/2, scaled
    c_correction_alpha   : in    std_logic_vector(15 downto 0);           -- -p*L*h**2, scaled
    c_correction_beta    : in    std_logic_vector(15 downto 0);           -- -p*L*h**2 * sqrt(3)/2, scaled
    c_forced_voltage     : in    std_logic_vector(15 downto 0);           -- h*Xr/(3*D), for v_dc/2 and v_ph, scaled
    c_forced_neutral     : in    std_logic_vector(15 downto 0);           -- h*Xr/(3*D), for v_n, scaled
    c_phase_alpha        : in    std_logic_vector(15 downto 0);           -- h/X_ph, scaled
    c_phase_beta         : in    std_logic_vector(15 downto 0);           -- h/X_ph * sqrt(3)/2, scaled
    c_midpoint_alpha     : in    std_logic_vector(15 downto 0);           -- h/(2*X_dc), scaled
    c_midpoint_beta      : in    std_logic_vector(15 downto 0);           -- h/(2*X_dc) * sqrt(3)/2, scaled
    c_weight             : in    std_logic_vector(15 downto 0);           -- sqrt(lambda_n), scaled
    c_weight_alpha       : in    std_logic_vector(15 downto 0);           -- -sqrt(lambda_n)*h/(2*X_dc), scaled
    c_weight_beta        : in    std_logic_vector(15 downto 0); -- -sqrt(lambda_n)*h/(2*X_dc) * sqrt(3)/2, scaled
    c_curvature_emf_alpha : in std_logic_vector(15 downto 0); -- c: omega_r*psi_r; fast variant only
    c_curvature_emf_beta : in std_logic_vector(15 downto 0); -- c: the same, beta; fast variant only
    c_curvature_flux_alpha : in std_logic_vector(15 downto 0); -- c: omega_r**2*psi_r; fast variant only
    c_curvature_flux_beta : in std_logic_vector(15 downto 0); -- c: the same, beta; fast variant only
    c_curvature_reference_alpha : in std_logic_vector(15 downto 0); -- c: omega_s**2*iref; fast variant only
    c_curvature_reference_beta : in std_logic_vector(15 downto 0); -- c: the same, beta; fast variant only
    c_change_phase       : in    std_logic_vector(15 downto 0); -- h/X_ph * 16, scaled; SESE and prediction only
    c_change_midpoint    : in    std_logic_vector(15 downto 0); -- h/(2*X_dc) * 16, scaled; likewise
    c_change_weight      : in    std_logic_vector(15 downto 0); -- -sqrt(lambda_n)*h/(2*X_dc), scaled; likewise
    c_error_forced       : in    std_logic_vector(15 downto 0); -- -h*Xr/(3*D), scaled; likewise
    bound_current        : in    std_logic_vector(15 downto 0);           -- unsigned, trajectory units
    bound_neutral        : in    std_logic_vector(15 downto 0);           -- unsigned, trajectory units
    bound_phase          : in    std_logic_vector(15 downto 0);           -- unsigned, trajectory units
    horizon              : in    std_logic_vector(5 downto 0);            -- N, unsigned, steps, 1 to 63
    weight_scale         : in    std_logic_vector(1 downto 0); -- fractional bits of sqrt(lambda_n)*v_n: 14, 16, 18, 20
    two_switchings       : in    std_logic; -- switching horizon: '1': SESE, SECOND_LEVEL only, '0': SE
    budget               : in    std_logic_vector(11 downto 0); -- candidates of SESE's second level, 0: no limit
    compensate           : in    std_logic; -- '1': decide for k+1 from the state predicted under s(k-1); likewise
    deadlock_rule        : in    std_logic; -- '1': weighted, WEIGHTED_DEADLOCK only, '0': largest excess
    -- decision, stable until the next valid
    valid                : out   std_logic;                               -- '1' for one clock: decision is new
    busy                 : out   std_logic;                               -- '1': a decision is under way
    s_a                  : out   std_logic_vector(2 downto 0);            -- switch position s(k) of phase a, 0 to 7
    s_b                  : out   std_logic_vector(2 downto 0);            -- switch position s(k) of phase b, 0 to 7
    s_c                  : out   std_logic_vector(2 downto 0);            -- switch position s(k) of phase c, 0 to 7
    held                 : out   std_logic;                               -- '1': s(k-1) was kept
    deadlock             : out   std_logic;                               -- '1': no candidate stays inside its bounds
    length               : out   std_logic_vector(5 downto 0); -- L* of the choice, steps; 0 when held or deadlocked
    saturated            : out   std_logic;                               -- '1': a value did not fit its word
    exhausted            : out   std_logic -- '1': the budget ended the search, the decision is the best so far
  );
end entity mpdcc_core;

architecture rtl of mpdcc_core is

  signal measurement  : measurement_t;
  signal previous     : positions_t;
  signal coefficients : std_logic_vector(COEFFICIENT_COUNT * COEFFICIENT_WIDTH - 1 downto 0);
  signal limits       : limits_t;
  signal decision     : decision_t;

  signal node            : node_t;
  signal band            : band_t;
  signal capacitor       : capacitor_t;
  signal last            : std_logic;
  signal best_valid      : std_logic;
  signal best_cost       : cost_t;
  signal candidate       : candidate_t;
  signal candidate_valid : std_logic_vector(EXPLORERS - 1 downto 0);
  signal candidate_ready : std_logic_vector(EXPLORERS - 1 downto 0);
  signal probe_done      : std_logic_vector(EXPLORERS - 1 downto 0);
  signal probe_held      : std_logic_vector(EXPLORERS - 1 downto 0);
  signal result_valid    : std_logic_vector(EXPLORERS - 1 downto 0);
  signal result_ready    : std_logic_vector(EXPLORERS - 1 downto 0);
  signal results         : results_t(0 to EXPLORERS - 1);
  signal explorer_busy   : std_logic_vector(EXPLORERS - 1 downto 0);
  signal evaluated       : evaluated_array_t(0 to EXPLORERS - 1);
  signal leaf_valid      : std_logic_vector(EXPLORERS - 1 downto 0);
  signal leaf            : leaves_t(0 to EXPLORERS - 1);
  signal reached         : reached_t;

begin

  measurement.is_alpha   <= signed(is_alpha);
  measurement.is_beta    <= signed(is_beta);
  measurement.psir_alpha <= signed(psir_alpha);
  measurement.psir_beta  <= signed(psir_beta);
  measurement.v_n        <= signed(v_n);
  measurement.v_ph_a     <= unsigned(v_ph_a);
  measurement.v_ph_b     <= unsigned(v_ph_b);
  measurement.v_ph_c     <= unsigned(v_ph_c);
  measurement.v_dc       <= unsigned(v_dc);
  measurement.iref_alpha <= signed(iref_alpha);
  measurement.iref_beta  <= signed(iref_beta);
  measurement.omega_s    <= signed(omega_s);
  measurement.omega_r    <= signed(omega_r);

  previous(0) <= unsigned(s_prev_a);
  previous(1) <= unsigned(s_prev_b);
  previous(2) <= unsigned(s_prev_c);

  limits.bound_current <= unsigned(bound_current);
  limits.bound_neutral <= unsigned(bound_neutral);
  limits.bound_phase   <= unsigned(bound_phase);
  limits.horizon       <= unsigned(horizon);
  limits.weight_scale  <= unsigned(weight_scale);
  limits.deadlock_rule <= deadlock_rule;

  p_coefficients : process (c_error_alpha, c_error_beta, c_error_neutral, c_error_phase, c_stator_alpha,
                            c_stator_beta, c_rotor_alpha, c_rotor_beta, c_reference_alpha, c_reference_beta,
                            c_emf_alpha, c_emf_beta, c_correction_alpha, c_correction_beta, c_forced_voltage,
                            c_forced_neutral, c_phase_alpha, c_phase_beta, c_midpoint_alpha, c_midpoint_beta,
                            c_weight, c_weight_alpha, c_weight_beta,
                            c_curvature_emf_alpha, c_curvature_emf_beta, c_curvature_flux_alpha,
                            c_curvature_flux_beta, c_curvature_reference_alpha, c_curvature_reference_beta,
                            c_change_phase, c_change_midpoint, c_change_weight, c_error_forced) is

    procedure put (index : natural; value : std_logic_vector) is
    begin

      coefficients((index + 1) * COEFFICIENT_WIDTH - 1 downto index * COEFFICIENT_WIDTH) <= value;

    end procedure put;

  begin

    put(FACTOR_ERROR_ALPHA, c_error_alpha);
    put(FACTOR_ERROR_BETA, c_error_beta);
    put(FACTOR_ERROR_NEUTRAL, c_error_neutral);
    put(FACTOR_ERROR_PHASE, c_error_phase);
    put(FACTOR_STATOR_ALPHA, c_stator_alpha);
    put(FACTOR_STATOR_BETA, c_stator_beta);
    put(FACTOR_ROTOR_ALPHA, c_rotor_alpha);
    put(FACTOR_ROTOR_BETA, c_rotor_beta);
    put(FACTOR_REFERENCE_ALPHA, c_reference_alpha);
    put(FACTOR_REFERENCE_BETA, c_reference_beta);
    put(FACTOR_EMF_ALPHA, c_emf_alpha);
    put(FACTOR_EMF_BETA, c_emf_beta);
    put(FACTOR_CORRECTION_ALPHA, c_correction_alpha);
    put(FACTOR_CORRECTION_BETA, c_correction_beta);
    put(FACTOR_FORCED_VOLTAGE, c_forced_voltage);
    put(FACTOR_FORCED_NEUTRAL, c_forced_neutral);
    put(FACTOR_PHASE_ALPHA, c_phase_alpha);
    put(FACTOR_PHASE_BETA, c_phase_beta);
    put(FACTOR_MIDPOINT_ALPHA, c_midpoint_alpha);
    put(FACTOR_MIDPOINT_BETA, c_midpoint_beta);
    put(FACTOR_WEIGHT, c_weight);
    put(FACTOR_WEIGHT_ALPHA, c_weight_alpha);
    put(FACTOR_WEIGHT_BETA, c_weight_beta);
    put(FACTOR_CURVATURE_EMF_ALPHA, c_curvature_emf_alpha);
    put(FACTOR_CURVATURE_EMF_BETA, c_curvature_emf_beta);
    put(FACTOR_CURVATURE_FLUX_ALPHA, c_curvature_flux_alpha);
    put(FACTOR_CURVATURE_FLUX_BETA, c_curvature_flux_beta);
    put(FACTOR_CURVATURE_REFERENCE_ALPHA, c_curvature_reference_alpha);
    put(FACTOR_CURVATURE_REFERENCE_BETA, c_curvature_reference_beta);
    put(FACTOR_CHANGE_PHASE, c_change_phase);
    put(FACTOR_CHANGE_MIDPOINT, c_change_midpoint);
    put(FACTOR_CHANGE_WEIGHT, c_change_weight);
    put(FACTOR_ERROR_FORCED, c_error_forced);

  end process p_coefficients;

  i_scheduler : entity work.mpdcc_scheduler
    generic map (
      EXPLORERS    => EXPLORERS,
      FOLDED       => FOLDED,
      SECOND_LEVEL => SECOND_LEVEL
    )
    port map (
      clk             => clk,
      rst             => rst,
      start           => start,
      measurement     => measurement,
      previous        => previous,
      limits          => limits,
      coefficients    => coefficients,
      valid           => valid,
      decision        => decision,
      busy            => busy,
      node            => node,
      band            => band,
      capacitor       => capacitor,
      last            => last,
      best_valid      => best_valid,
      best_cost       => best_cost,
      candidate_valid => candidate_valid,
      candidate_ready => candidate_ready,
      candidate       => candidate,
      probe_done      => probe_done(0),
      probe_held      => probe_held(0),
      result_valid    => result_valid,
      result_ready    => result_ready,
      results         => results,
      explorer_busy   => explorer_busy,
      two_switchings  => two_switchings,
      budget          => unsigned(budget),
      compensate      => compensate,
      evaluated       => evaluated(0),
      leaf_valid      => leaf_valid,
      leaf            => leaf,
      reached         => reached
    );

  g_explorers : for i in 0 to EXPLORERS - 1 generate

    i_explorer : entity work.mpdcc_explorer
      generic map (
        FOLDED            => FOLDED,
        SECOND_LEVEL      => SECOND_LEVEL,
        WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK
      )
      port map (
        clk             => clk,
        rst             => rst,
        limits          => limits,
        node            => node,
        band            => band,
        capacitor       => capacitor,
        last            => last,
        best_valid      => best_valid,
        best_cost       => best_cost,
        candidate_valid => candidate_valid(i),
        candidate_ready => candidate_ready(i),
        candidate       => candidate,
        probe_done      => probe_done(i),
        probe_held      => probe_held(i),
        result_valid    => result_valid(i),
        result_ready    => result_ready(i),
        result          => results(i),
        busy            => explorer_busy(i),
        leaf_valid      => leaf_valid(i),
        leaf            => leaf(i),
        reached         => reached,
        evaluated       => evaluated(i)
      );

  end generate g_explorers;

  s_a       <= std_logic_vector(decision.position(0));
  s_b       <= std_logic_vector(decision.position(1));
  s_c       <= std_logic_vector(decision.position(2));
  held      <= decision.held;
  deadlock  <= decision.deadlock;
  length    <= std_logic_vector(decision.length);
  saturated <= decision.saturated;
  exhausted <= decision.exhausted;

end architecture rtl;
