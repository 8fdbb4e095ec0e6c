-- Somebody's own top around mpdcc_core: the decision of one clock ago. test_own_top.py converts it.
-- It is written as a user would, with the library directmpc. Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library directmpc;

entity own_top is
  generic (
    EXPLORERS : positive := 2 -- explorers of the core
  );
  port (
    clk          : in    std_logic;                       -- rising edge
    rst          : in    std_logic;                       -- synchronous, active high
    start        : in    std_logic;                       -- '1' for one clock: decide
    measurements : in    std_logic_vector(207 downto 0);  -- 16 bits each, is_alpha rightmost
    positions    : in    std_logic_vector(8 downto 0);    -- s(k-1), phase a rightmost
    parameters   : in    std_logic_vector(599 downto 0);  -- parameter ports, c_error_alpha rightmost
    valid        : out   std_logic;                       -- '1' for one clock: decision is new
    decision     : out   std_logic_vector(8 downto 0)     -- s(k), phase a rightmost
  );
end entity own_top;

architecture rtl of own_top is

  signal fresh : std_logic;
  signal s     : std_logic_vector(8 downto 0);

begin

  i_core : entity directmpc.mpdcc_core
    generic map (
      EXPLORERS => EXPLORERS
    )
    port map (
      clk                         => clk,
      rst                         => rst,
      start                       => start,
      is_alpha                    => measurements(15 downto 0),
      is_beta                     => measurements(31 downto 16),
      psir_alpha                  => measurements(47 downto 32),
      psir_beta                   => measurements(63 downto 48),
      v_n                         => measurements(79 downto 64),
      v_ph_a                      => measurements(95 downto 80),
      v_ph_b                      => measurements(111 downto 96),
      v_ph_c                      => measurements(127 downto 112),
      v_dc                        => measurements(143 downto 128),
      iref_alpha                  => measurements(159 downto 144),
      iref_beta                   => measurements(175 downto 160),
      omega_s                     => measurements(191 downto 176),
      omega_r                     => measurements(207 downto 192),
      s_prev_a                    => positions(2 downto 0),
      s_prev_b                    => positions(5 downto 3),
      s_prev_c                    => positions(8 downto 6),
      c_error_alpha               => parameters(15 downto 0),
      c_error_beta                => parameters(31 downto 16),
      c_error_neutral             => parameters(47 downto 32),
      c_error_phase               => parameters(63 downto 48),
      c_stator_alpha              => parameters(79 downto 64),
      c_stator_beta               => parameters(95 downto 80),
      c_rotor_alpha               => parameters(111 downto 96),
      c_rotor_beta                => parameters(127 downto 112),
      c_reference_alpha           => parameters(143 downto 128),
      c_reference_beta            => parameters(159 downto 144),
      c_emf_alpha                 => parameters(175 downto 160),
      c_emf_beta                  => parameters(191 downto 176),
      c_correction_alpha          => parameters(207 downto 192),
      c_correction_beta           => parameters(223 downto 208),
      c_forced_voltage            => parameters(239 downto 224),
      c_forced_neutral            => parameters(255 downto 240),
      c_phase_alpha               => parameters(271 downto 256),
      c_phase_beta                => parameters(287 downto 272),
      c_midpoint_alpha            => parameters(303 downto 288),
      c_midpoint_beta             => parameters(319 downto 304),
      c_weight                    => parameters(335 downto 320),
      c_weight_alpha              => parameters(351 downto 336),
      c_weight_beta               => parameters(367 downto 352),
      c_curvature_emf_alpha       => parameters(383 downto 368),
      c_curvature_emf_beta        => parameters(399 downto 384),
      c_curvature_flux_alpha      => parameters(415 downto 400),
      c_curvature_flux_beta       => parameters(431 downto 416),
      c_curvature_reference_alpha => parameters(447 downto 432),
      c_curvature_reference_beta  => parameters(463 downto 448),
      c_change_phase              => parameters(479 downto 464),
      c_change_midpoint           => parameters(495 downto 480),
      c_change_weight             => parameters(511 downto 496),
      c_error_forced              => parameters(527 downto 512),
      bound_current               => parameters(543 downto 528),
      bound_neutral               => parameters(559 downto 544),
      bound_phase                 => parameters(575 downto 560),
      horizon                     => parameters(581 downto 576),
      weight_scale                => parameters(583 downto 582),
      two_switchings              => parameters(584),
      budget                      => parameters(596 downto 585),
      compensate                  => parameters(597),
      deadlock_rule               => parameters(598),
      outside_inwards             => parameters(599),
      valid                       => fresh,
      busy                        => open,
      s_a                         => s(2 downto 0),
      s_b                         => s(5 downto 3),
      s_c                         => s(8 downto 6),
      held                        => open,
      deadlock                    => open,
      length                      => open,
      saturated                   => open,
      exhausted                   => open,
      cost                        => open
    );

  p_decision : process (clk) is
  begin

    if rising_edge(clk) then
      valid    <= fresh and not rst;
      decision <= s;
    end if;

  end process p_decision;

end architecture rtl;
