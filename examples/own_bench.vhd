-- A first bench for mpdcc_core: clock, reset, one set of measurements, one decision.
--
-- The parameters are those of drives/anpc5l_6kv.toml. `.venv/bin/python -m scripts coefficients --csv` prints them.
-- Measurements are scaled as docs/specification.md says in section 9: is_alpha is 0.88 pu, 14080 times 1/16000 pu.
-- The current leaves its bound there, so that the core has to search. The expected positions are the bit-true model's.
-- The simulation ends by itself. A wrong or late decision is a failure.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity own_bench is
end entity own_bench;

architecture bench of own_bench is

  constant PERIOD : time     := 10 ns;
  constant MOST   : positive := 82; -- clocks of a decision with two explorers

  signal clk   : std_logic := '0';
  signal rst   : std_logic := '1';
  signal start : std_logic := '0';
  signal ended : boolean   := false;

  signal valid : std_logic;
  signal s_a   : std_logic_vector(2 downto 0);
  signal s_b   : std_logic_vector(2 downto 0);
  signal s_c   : std_logic_vector(2 downto 0);

begin

  clk <= not clk after PERIOD / 2 when not ended else
         '0';

  i_core : entity work.mpdcc_core
    generic map (EXPLORERS => 2, FOLDED => false, SECOND_LEVEL => false, WEIGHTED_DEADLOCK => true,
      INWARDS => true)
    port map (
      clk => clk,
      rst => rst,
      start => start,
      -- measurements
      is_alpha => x"3700",
      is_beta => x"EFBD",
      psir_alpha => x"0FC7",
      psir_beta => x"E147",
      v_n => x"01E6",
      v_ph_a => x"3C6D",
      v_ph_b => x"3D49",
      v_ph_c => x"4013",
      v_dc => x"7D0D",
      iref_alpha => x"3C60",
      iref_beta => x"EFD3",
      omega_s => x"3E80",
      omega_r => x"3E2D",
      s_prev_a => "110",
      s_prev_b => "010",
      s_prev_c => "001",
      -- parameters of the drive
      c_error_alpha => x"3C69",
      c_error_beta => x"3451",
      c_error_neutral => x"F0E7",
      c_error_phase => x"0F19",
      c_stator_alpha => x"035A",
      c_stator_beta => x"02E7",
      c_rotor_alpha => x"FEF9",
      c_rotor_beta => x"FF1D",
      c_reference_alpha => x"E0E5",
      c_reference_beta => x"1AF0",
      c_emf_alpha => x"DAC9",
      c_emf_beta => x"203B",
      c_correction_alpha => x"0000",
      c_correction_beta => x"0000",
      c_forced_voltage => x"1C42",
      c_forced_neutral => x"0E21",
      c_phase_alpha => x"2769",
      c_phase_beta => x"2221",
      c_midpoint_alpha => x"0DCC",
      c_midpoint_beta => x"0BF3",
      c_weight => x"29A2",
      c_weight_alpha => x"FD9F",
      c_weight_beta => x"FDF1",
      c_curvature_emf_alpha => x"0020",
      c_curvature_emf_beta => x"FFE5",
      c_curvature_flux_alpha => x"F67B",
      c_curvature_flux_beta => x"F7C2",
      c_curvature_reference_alpha => x"FF00",
      c_curvature_reference_beta => x"FF23",
      c_change_phase => x"0538",
      c_change_midpoint => x"01D4",
      c_change_weight => x"F4F9",
      c_error_forced => x"FC42",
      bound_current => x"5E64",
      bound_neutral => x"4B81",
      bound_phase => x"7141",
      horizon => "111111",
      weight_scale => "10",
      two_switchings => '0',
      budget => x"190",
      compensate => '0',
      deadlock_rule => '1',
      outside_inwards => '1',
      -- decision
      valid => valid,
      busy => open,
      s_a => s_a,
      s_b => s_b,
      s_c => s_c,
      held => open,
      deadlock => open,
      length => open,
      saturated => open,
      exhausted => open,
      cost => open
    );

  p_test : process is

    variable clocks : natural;

  begin
    for k in 1 to 4 loop
      wait until rising_edge(clk);
    end loop;
    rst   <= '0';
    start <= '1';
    wait until rising_edge(clk);
    start <= '0';

    clocks := 0;
    while valid /= '1' or clocks = 0 loop
      wait until rising_edge(clk);
      clocks := clocks + 1;
      assert clocks <= MOST
        report "no decision after " & integer'image(clocks) & " clocks"
        severity failure;
    end loop;

    report "positions " & integer'image(to_integer(unsigned(s_a))) & ", " & integer'image(to_integer(unsigned(s_b)))
           & ", " & integer'image(to_integer(unsigned(s_c))) & " after " & integer'image(clocks) & " clocks";
    assert s_a = "111" and s_b = "011" and s_c = "000"
      report "the model decides 7, 3, 0"
      severity failure;
    ended <= true;
    wait;
  end process p_test;

end architecture bench;
