-- Flat bench around mpdcc_core: presents one row of inputs on the start edge and random values on
-- every other, counts clocks from the accepting edge to the one that samples valid, and hands the
-- decision out. The clock is made here: a simulator toggles it much faster than a coroutine.
--
-- A decision slower than the published bound ends the simulation with a failure.
--
-- Paper variant: with P clocks between two candidates of one explorer and one candidate
-- handed out a clock, candidate k goes out at d(k) <= max(d(k-1) + 1, d(k-EXPLORERS) + P), since
-- fewer than EXPLORERS explorers can be occupied by candidates younger than k-EXPLORERS. The last
-- of 64 goes out P * (63 / EXPLORERS) + 63 mod EXPLORERS clocks after the first. From start to the
-- first candidate pass at most 29 clocks, from the last candidate to valid 33.
--
-- Fast variant: the clocks of a search depend on s(k-1) alone. 16 blocks of four candidates are the
-- most; one a clock is handed out, an explorer takes one every fourth clock and holds two. With one
-- explorer the search is 64 candidates and 46 clocks; from four explorers on the enumerator is the
-- limit. Whether explorers finish in the same clock counts too: their results are taken in turn.
-- With two switchings directmpc.mpdcc.cycles counts them, for every s(k-1).
--
-- Words keep their places in row, parameters and response if bounds and lengths are shorter.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;
  use directmpc.directmpc_constants.all;

entity mpdcc_core_bench is
  generic (
    EXPLORERS         : positive := 2;     -- explorers of the core
    FOLDED            : boolean  := true;  -- variant of the explorers
    SECOND_LEVEL      : boolean  := false; -- true: SESE and delay compensation built in
    WEIGHTED_DEADLOCK : boolean  := false; -- true: the weighted deadlock rule built in
    INWARDS           : boolean  := false; -- true: the rule inwards built in
    MOST_CLOCKS       : positive;          -- most clocks a decision may take, from scripts/measure/budgets.toml
    SESE_CLOCKS       : positive := 1;     -- the same with two switchings, likewise
    PREDICTION_CLOCKS : natural  := 0      -- further clocks with delay compensation, likewise
  );
  port (
    rst        : in    std_logic;                      -- synchronous, active high
    request    : in    std_logic;                      -- a change asks for a decision on row
    row        : in    std_logic_vector(216 downto 0); -- s_prev c, b, a, then measurements, is_alpha rightmost
    parameters : in    std_logic_vector(599 downto 0); -- parameter ports, c_error_alpha rightmost
    finished   : out   std_logic := '0';               -- changes when response is new
    response   : out   std_logic_vector(18 downto 0);  -- exhausted, saturated, length, deadlock, held, s_c, s_b, s_a
    cycles     : out   std_logic_vector(15 downto 0);  -- clocks from start to valid
    bound      : out   std_logic_vector(15 downto 0)   -- most clocks a decision may take
  );
end entity mpdcc_core_bench;

architecture bench of mpdcc_core_bench is

  constant PATIENCE : natural := 100_000; -- clocks

  signal bound_clocks : positive := MOST_CLOCKS;

  signal idle     : natural := 0; -- clocks since the last request
  signal clk      : std_logic := '0';
  signal start    : std_logic := '0';
  signal inputs   : std_logic_vector(216 downto 0) := (others => '0');
  signal noise    : std_logic_vector(63 downto 0) := x"9E3779B97F4A7C15";
  signal answered : std_logic := '0';
  signal count    : unsigned(15 downto 0) := (others => '0');
  signal valid    : std_logic;
  signal busy     : std_logic;
  signal decision : std_logic_vector(18 downto 0) := (others => '0'); -- a shorter length leaves zeros

begin

  p_bound : process (parameters) is

    variable clocks : positive;

  begin

    clocks := MOST_CLOCKS;

    if (SECOND_LEVEL and parameters(584) = '1') then
      clocks := SESE_CLOCKS;
    end if;

    if (SECOND_LEVEL and parameters(597) = '1') then
      clocks := clocks + PREDICTION_CLOCKS;
    end if;

    bound_clocks <= clocks;

  end process p_bound;

  bound <= std_logic_vector(to_unsigned(bound_clocks, 16));

  clk <= not clk after 5 ns;

  p_inputs : process (clk) is

    variable v : std_logic_vector(63 downto 0);

  begin

    if rising_edge(clk) then
      -- xorshift64
      v     := noise xor (noise(50 downto 0) & "0000000000000");
      v     := v xor ("0000000" & v(63 downto 7));
      v     := v xor (v(46 downto 0) & "00000000000000000");
      noise <= v;
      start <= '0';
      count <= count + 1;

      if (start = '1') then
        count <= x"0001";
      end if;

      if (request /= answered and start = '0' and busy = '0') then
        inputs   <= row;
        start    <= '1';
        answered <= request;
        idle     <= 0;
      else
        idle   <= idle + 1;
        inputs <= v(24 downto 0) & v & (v xor x"5555555555555555") & v;
      end if;

      -- the clock never stops by itself: end a simulation that nobody attends to
      assert idle < PATIENCE
        report "no request for " & integer'image(PATIENCE) & " clocks"
        severity failure;

      assert busy = '0' or start = '1' or count <= bound_clocks
        report "a decision takes more than " & integer'image(bound_clocks) & " clocks"
        severity failure;

      if (valid = '1') then
        finished <= answered;
        response <= decision;
        cycles   <= std_logic_vector(count);
      end if;
    end if;

  end process p_inputs;

  i_core : entity directmpc.mpdcc_core
    generic map (
      EXPLORERS         => EXPLORERS,
      FOLDED            => FOLDED,
      SECOND_LEVEL      => SECOND_LEVEL,
      WEIGHTED_DEADLOCK => WEIGHTED_DEADLOCK,
      INWARDS           => INWARDS
    )
    port map (
      clk                => clk,
      rst                => rst,
      start              => start,
      is_alpha           => inputs(15 downto 0),
      is_beta            => inputs(31 downto 16),
      psir_alpha         => inputs(47 downto 32),
      psir_beta          => inputs(63 downto 48),
      v_n                => inputs(79 downto 64),
      v_ph_a             => inputs(95 downto 80),
      v_ph_b             => inputs(111 downto 96),
      v_ph_c             => inputs(127 downto 112),
      v_dc               => inputs(143 downto 128),
      iref_alpha         => inputs(159 downto 144),
      iref_beta          => inputs(175 downto 160),
      omega_s            => inputs(191 downto 176),
      omega_r            => inputs(207 downto 192),
      s_prev_a           => inputs(210 downto 208),
      s_prev_b           => inputs(213 downto 211),
      s_prev_c           => inputs(216 downto 214),
      c_error_alpha      => parameters(15 downto 0),
      c_error_beta       => parameters(31 downto 16),
      c_error_neutral    => parameters(47 downto 32),
      c_error_phase      => parameters(63 downto 48),
      c_stator_alpha     => parameters(79 downto 64),
      c_stator_beta      => parameters(95 downto 80),
      c_rotor_alpha      => parameters(111 downto 96),
      c_rotor_beta       => parameters(127 downto 112),
      c_reference_alpha  => parameters(143 downto 128),
      c_reference_beta   => parameters(159 downto 144),
      c_emf_alpha        => parameters(175 downto 160),
      c_emf_beta         => parameters(191 downto 176),
      c_correction_alpha => parameters(207 downto 192),
      c_correction_beta  => parameters(223 downto 208),
      c_forced_voltage   => parameters(239 downto 224),
      c_forced_neutral   => parameters(255 downto 240),
      c_phase_alpha      => parameters(271 downto 256),
      c_phase_beta       => parameters(287 downto 272),
      c_midpoint_alpha   => parameters(303 downto 288),
      c_midpoint_beta    => parameters(319 downto 304),
      c_weight           => parameters(335 downto 320),
      c_weight_alpha     => parameters(351 downto 336),
      c_weight_beta      => parameters(367 downto 352),
      c_curvature_emf_alpha => parameters(383 downto 368),
      c_curvature_emf_beta => parameters(399 downto 384),
      c_curvature_flux_alpha => parameters(415 downto 400),
      c_curvature_flux_beta => parameters(431 downto 416),
      c_curvature_reference_alpha => parameters(447 downto 432),
      c_curvature_reference_beta => parameters(463 downto 448),
      c_change_phase     => parameters(479 downto 464),
      c_change_midpoint  => parameters(495 downto 480),
      c_change_weight    => parameters(511 downto 496),
      c_error_forced     => parameters(527 downto 512),
      bound_current      => parameters(528 + BOUND_WIDTH - 1 downto 528),
      bound_neutral      => parameters(544 + BOUND_WIDTH - 1 downto 544),
      bound_phase        => parameters(560 + BOUND_WIDTH - 1 downto 560),
      horizon            => parameters(576 + LENGTH_WIDTH - 1 downto 576),
      weight_scale       => parameters(583 downto 582),
      two_switchings     => parameters(584),
      budget             => parameters(596 downto 585),
      compensate         => parameters(597),
      deadlock_rule      => parameters(598),
      outside_inwards    => parameters(599),
      valid              => valid,
      busy               => busy,
      s_a                => decision(2 downto 0),
      s_b                => decision(5 downto 3),
      s_c                => decision(8 downto 6),
      held               => decision(9),
      deadlock           => decision(10),
      length             => decision(11 + LENGTH_WIDTH - 1 downto 11),
      saturated          => decision(17),
      exhausted          => decision(18)
    );

end architecture bench;
