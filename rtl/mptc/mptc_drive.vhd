-- Induction drive from measured currents to switch states: observer, pre-excitation and core together.
-- Stator currents, speed and dc-link voltage are all that is measured.
--
-- Give the measurements of period k with a one-clock start.  valid comes with the vector to apply from k+1 on.  The
-- three parts work at the same time.  mptc_core decides with the flux that mptc_observer estimated for k in the period
-- before.  mptc_preexcitation decides in its place until the flux is there (excite).  The observer takes the estimate
-- on to k+1 with the vector that is being applied.  That is the last decision, which is kept here: apply it, or hold
-- rst.
--
-- Formats: those of the parts (model/directmpc/mptc/formats.py); the twin is
-- model/directmpc/mptc/drive_twin.py.
-- Latency: valid 40 clocks after start for MPTC, 79 for MPFC, always; one decision at a time, the next
-- start may come with valid.  Five multipliers.
-- Overflow: saturates and sets saturated; nothing wraps.  While pre-excitation decides, what the core
-- makes of a machine without flux (saturated, clamped) is left out.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;
  use work.mptc_vectors.all;

entity mptc_drive is
  generic (
    FLUX_CONTROL : boolean := true -- true: MPFC can be chosen at run time
  );
  port (
    clk             : in    std_logic;                                 -- rising edge
    rst             : in    std_logic;                                 -- synchronous, active high: no flux, u_0 applied
    start           : in    std_logic;                                 -- '1' for one clock: decide; ignored while busy
    -- measurements at k and references, sampled with start
    is_alpha        : in    std_logic_vector(15 downto 0);             -- stator current, signed, current_max/32767
    is_beta         : in    std_logic_vector(15 downto 0);             -- signed, current_max/32767
    omega_r         : in    std_logic_vector(15 downto 0);             -- electrical speed, signed, speed_max/32767
    v_dc            : in    std_logic_vector(15 downto 0);             -- dc-link voltage, unsigned, vdc/32768
    torque_ref      : in    std_logic_vector(15 downto 0);             -- torque reference, signed, torque_max/32767
    psi_ref         : in    std_logic_vector(14 downto 0);             -- flux reference, unsigned, psi_max/26979
    excite          : in    std_logic;                                 -- '1': magnetise first, '0': control at once
    method_mpfc     : in    std_logic;                                 -- '1': MPFC, '0': MPTC
    -- at any time
    restart         : in    std_logic;                                 -- '1': magnetise again, where excite says so
    -- parameters, stable from start to valid; coefficients signed, 17 fractional bits
    limit           : in    std_logic_vector(14 downto 0);             -- as mptc_preexcitation's
    level           : in    std_logic_vector(14 downto 0);             -- as mptc_preexcitation's
    c_current       : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_flux          : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_rotor         : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_rotor_flux    : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_drop_current  : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_drop          : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_drop_flux     : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_speed         : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_voltage_alpha : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_voltage_beta  : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_torque        : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_weight        : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_core's
    c_gain_rotor    : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_observer's
    c_gain_stator   : in    std_logic_vector(WORD_WIDTH - 1 downto 0); -- as mptc_observer's
    -- decision, stable until the next valid
    valid           : out   std_logic;                                 -- '1' for one clock: decision is new
    busy            : out   std_logic;                                 -- '1': a decision is under way
    u_next          : out   std_logic_vector(2 downto 0);              -- number of the vector to apply next, 0 to 7
    switches        : out   std_logic_vector(2 downto 0);              -- its switch states a, b, c; '1': positive rail
    psis_alpha      : out   std_logic_vector(15 downto 0);             -- stator flux at k+1, signed, psi_max/32767
    psis_beta       : out   std_logic_vector(15 downto 0);             -- signed, psi_max/32767
    exciting        : out   std_logic;                                 -- '1': the decision is pre-excitation's
    saturated       : out   std_logic;                                 -- '1': a value did not fit its word
    clamped         : out   std_logic                                  -- '1': MPFC cannot reach torque_ref
  );
end entity mptc_drive;

architecture rtl of mptc_drive is

  signal active         : std_logic;
  signal begin_step     : std_logic;
  signal by_excitation  : std_logic;                     -- who decides on this step
  signal applied        : std_logic_vector(2 downto 0);
  signal estimated      : std_logic;                     -- '0': no estimate since the reset
  signal estimate_alpha : std_logic_vector(15 downto 0);
  signal estimate_beta  : std_logic_vector(15 downto 0);
  signal flux_alpha     : std_logic_vector(15 downto 0);
  signal flux_beta      : std_logic_vector(15 downto 0);
  signal core_valid     : std_logic;
  signal core_u         : std_logic_vector(2 downto 0);
  signal core_saturated : std_logic;
  signal core_clamped   : std_logic;
  signal flux_saturated : std_logic;
  signal excitation_u   : std_logic_vector(2 downto 0);
  signal magnetised     : std_logic;

begin

  -- the parts are a clock shorter than this: they must not begin before
  begin_step <= start and not active;

  i_core : entity work.mptc_core
    generic map (
      FLUX_CONTROL => FLUX_CONTROL
    )
    port map (
      clk             => clk,
      rst             => rst,
      start           => begin_step,
      is_alpha        => is_alpha,
      is_beta         => is_beta,
      psis_alpha      => flux_alpha,
      psis_beta       => flux_beta,
      omega_r         => omega_r,
      v_dc            => v_dc,
      torque_ref      => torque_ref,
      psi_ref         => psi_ref,
      u               => applied,
      c_current       => c_current,
      c_flux          => c_flux,
      c_rotor         => c_rotor,
      c_rotor_flux    => c_rotor_flux,
      c_drop_current  => c_drop_current,
      c_drop          => c_drop,
      c_drop_flux     => c_drop_flux,
      c_speed         => c_speed,
      c_voltage_alpha => c_voltage_alpha,
      c_voltage_beta  => c_voltage_beta,
      c_torque        => c_torque,
      c_weight        => c_weight,
      method_mpfc     => method_mpfc,
      valid           => core_valid,
      busy            => open,
      u_next          => core_u,
      switches        => open,
      saturated       => core_saturated,
      clamped         => core_clamped
    );

  i_observer : entity work.mptc_observer
    port map (
      clk             => clk,
      rst             => rst,
      start           => begin_step,
      is_alpha        => is_alpha,
      is_beta         => is_beta,
      omega_r         => omega_r,
      v_dc            => v_dc,
      u               => applied,
      c_current       => c_current,
      c_flux          => c_flux,
      c_rotor         => c_rotor,
      c_rotor_flux    => c_rotor_flux,
      c_drop          => c_drop,
      c_drop_flux     => c_drop_flux,
      c_speed         => c_speed,
      c_voltage_alpha => c_voltage_alpha,
      c_voltage_beta  => c_voltage_beta,
      c_gain_rotor    => c_gain_rotor,
      c_gain_stator   => c_gain_stator,
      valid           => open,
      busy            => open,
      psis_alpha      => estimate_alpha,
      psis_beta       => estimate_beta,
      saturated       => flux_saturated
    );

  -- the observer's outputs hold nothing before its first step; its state is zero then
  flux_alpha <= std_logic_vector(gated(signed(estimate_alpha), estimated));
  flux_beta  <= std_logic_vector(gated(signed(estimate_beta), estimated));

  i_preexcitation : entity work.mptc_preexcitation
    port map (
      clk        => clk,
      rst        => rst,
      restart    => restart,
      start      => begin_step,
      is_alpha   => is_alpha,
      is_beta    => is_beta,
      psis_alpha => flux_alpha,
      psis_beta  => flux_beta,
      limit      => limit,
      level      => level,
      valid      => open,
      busy       => open,
      u_next     => excitation_u,
      limited    => open,
      finished   => magnetised
    );

  p_step : process (clk) is
  begin

    if rising_edge(clk) then
      valid <= '0';

      if (begin_step = '1') then
        active        <= '1';
        by_excitation <= excite and not magnetised;
      end if;

      -- the core is never quicker than the others
      if (core_valid = '1') then
        active    <= '0';
        valid     <= '1';
        estimated <= '1';
        exciting  <= by_excitation;
        saturated <= flux_saturated or (core_saturated and not by_excitation);
        clamped   <= core_clamped and not by_excitation;
        applied   <= core_u;

        if (by_excitation = '1') then
          applied <= excitation_u;
        end if;
      end if;

      if (rst = '1') then
        active    <= '0';
        valid     <= '0';
        estimated <= '0';
        applied   <= (others => '0');
      end if;
    end if;

  end process p_step;

  busy       <= active;
  u_next     <= applied;
  switches   <= switches_of_vector(applied);
  psis_alpha <= flux_alpha;
  psis_beta  <= flux_beta;

end architecture rtl;
