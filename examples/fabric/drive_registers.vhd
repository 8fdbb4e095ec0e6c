-- Boot ROM of anpc5l_6kv.toml for boot_loader.
-- Times are in clocks of 100 MHz: the core has to have this clock.

library ieee;
  use ieee.std_logic_1164.all;

package drive_registers is

  -- counts of a measurement's port, per pu
  constant COUNTS_IS_ALPHA : real := 16000.0;
  constant COUNTS_IS_BETA : real := 16000.0;
  constant COUNTS_PSIR_ALPHA : real := 9000.0;
  constant COUNTS_PSIR_BETA : real := 9000.0;
  constant COUNTS_V_N : real := 64012.5;
  constant COUNTS_V_PH_A : real := 32006.25;
  constant COUNTS_V_PH_B : real := 32006.25;
  constant COUNTS_V_PH_C : real := 32006.25;
  constant COUNTS_V_DC : real := 16003.125;
  constant COUNTS_IREF_ALPHA : real := 16000.0;
  constant COUNTS_IREF_BETA : real := 16000.0;
  constant COUNTS_OMEGA_S : real := 16000.0;
  constant COUNTS_OMEGA_R : real := 16000.0;

  type boot_rom_t is array (0 to 80) of std_logic_vector(47 downto 0);

  constant BOOT_ROM : boot_rom_t := (
      0 => x"801400000002", -- no commit is pending
      1 => x"0040000000C8", -- guard.dead_time
      2 => x"004400000190", -- guard.minimum_on
      3 => x"004800000190", -- guard.minimum_off
      4 => x"004C00001194", -- guard.decision_limit
      5 => x"005000001D4C", -- guard.watchdog
      6 => x"005400007080", -- guard.current_limit
      7 => x"005800009C47", -- guard.link_high
      8 => x"005C00005DC5", -- guard.link_low
      9 => x"006000005DC0", -- guard.speed_limit
     10 => x"006400000014", -- guard.frozen
     11 => x"007000005784", -- bands.v_ph_high
     12 => x"007400002582", -- bands.v_ph_low
     13 => x"007800003202", -- bands.v_n_limit
     14 => x"010000003C69", -- parameters.c_error_alpha
     15 => x"010400003451", -- parameters.c_error_beta
     16 => x"01080000F0E7", -- parameters.c_error_neutral
     17 => x"010C00000F19", -- parameters.c_error_phase
     18 => x"01100000035A", -- parameters.c_stator_alpha
     19 => x"0114000002E7", -- parameters.c_stator_beta
     20 => x"01180000FEF9", -- parameters.c_rotor_alpha
     21 => x"011C0000FF1D", -- parameters.c_rotor_beta
     22 => x"01200000E0E5", -- parameters.c_reference_alpha
     23 => x"012400001AF0", -- parameters.c_reference_beta
     24 => x"01280000DAC9", -- parameters.c_emf_alpha
     25 => x"012C0000203B", -- parameters.c_emf_beta
     26 => x"013000000000", -- parameters.c_correction_alpha
     27 => x"013400000000", -- parameters.c_correction_beta
     28 => x"013800001C42", -- parameters.c_forced_voltage
     29 => x"013C00000E21", -- parameters.c_forced_neutral
     30 => x"014000002769", -- parameters.c_phase_alpha
     31 => x"014400002221", -- parameters.c_phase_beta
     32 => x"014800000DCC", -- parameters.c_midpoint_alpha
     33 => x"014C00000BF3", -- parameters.c_midpoint_beta
     34 => x"0150000029A2", -- parameters.c_weight
     35 => x"01540000FD9F", -- parameters.c_weight_alpha
     36 => x"01580000FDF1", -- parameters.c_weight_beta
     37 => x"015C00000020", -- parameters.c_curvature_emf_alpha
     38 => x"01600000FFE5", -- parameters.c_curvature_emf_beta
     39 => x"01640000F67B", -- parameters.c_curvature_flux_alpha
     40 => x"01680000F7C2", -- parameters.c_curvature_flux_beta
     41 => x"016C0000FF00", -- parameters.c_curvature_reference_alpha
     42 => x"01700000FF23", -- parameters.c_curvature_reference_beta
     43 => x"017400000538", -- parameters.c_change_phase
     44 => x"0178000001D4", -- parameters.c_change_midpoint
     45 => x"017C0000F4F9", -- parameters.c_change_weight
     46 => x"01800000FC42", -- parameters.c_error_forced
     47 => x"018400005E64", -- parameters.bound_current
     48 => x"018800004B81", -- parameters.bound_neutral
     49 => x"018C00007141", -- parameters.bound_phase
     50 => x"01900000003F", -- parameters.horizon
     51 => x"019400000002", -- parameters.weight_scale
     52 => x"019800000000", -- parameters.two_switchings
     53 => x"019C00000190", -- parameters.budget
     54 => x"01A000000000", -- parameters.compensate
     55 => x"01A4000041E2", -- parameters.o_speed
     56 => x"01A80000181F", -- parameters.o_voltage_alpha
     57 => x"01AC000029C8", -- parameters.o_voltage_beta
     58 => x"01B00003F966", -- parameters.o_drop
     59 => x"01B40003F847", -- parameters.o_pull
     60 => x"01B800000771", -- parameters.o_pull_flux
     61 => x"01BC000000C7", -- parameters.o_pull_current
     62 => x"01C00003FC6A", -- parameters.o_decay
     63 => x"01C400000506", -- parameters.o_excitation
     64 => x"01C80001098E", -- parameters.o_output_flux
     65 => x"01CC0003E541", -- parameters.o_output_current
     66 => x"01D000000001", -- parameters.deadlock_rule
     67 => x"01D400000001", -- parameters.outside_inwards
     68 => x"01D80000FC93", -- parameters.f_midpoint_alpha
     69 => x"01DC0000FD08", -- parameters.f_midpoint_beta
     70 => x"01E0000004E5", -- parameters.f_phase_alpha
     71 => x"01E40000043D", -- parameters.f_phase_beta
     72 => x"01E800000004", -- parameters.f_q_midpoint
     73 => x"01EC00000004", -- parameters.f_q_phase
     74 => x"01F00000077C", -- parameters.l_voltage_alpha
     75 => x"01F400000CF7", -- parameters.l_voltage_beta
     76 => x"01F800009DA7", -- parameters.l_emf
     77 => x"01FC00000000", -- parameters.l_mode
     78 => x"401000000001", -- commit
     79 => x"801400000002", -- no commit is pending
     80 => x"000C0000000D"  -- system.control: from here on gates may be on
  );

end package drive_registers;
