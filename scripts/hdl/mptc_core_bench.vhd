-- Flat bench around mptc_core, or mptc_family_core: presents one row of inputs on the start edge and random values on
-- every other, counts clocks from the accepting edge to the one that samples valid, and hands the
-- decision out. The clock is made here: a simulator toggles it much faster than a coroutine.
--
-- The bound on the clocks of a decision stands here: a slower one ends the simulation with a
-- failure, and so does a bench that nobody attends to.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library directmpc;

entity mptc_core_bench is
  generic (
    FLUX_CONTROL : boolean := true; -- of mptc_core
    FAMILY       : boolean := false -- true: mptc_family_core
  );
  port (
    rst        : in    std_logic;                      -- synchronous, active high
    request    : in    std_logic;                      -- a change asks for a decision on row
    row        : in    std_logic_vector(164 downto 0); -- t2, t1, u3, u2, u1, u, psi_ref, ... is_alpha rightmost
    parameters : in    std_logic_vector(221 downto 0); -- duty rule, family method, method, ... c_current rightmost
    finished   : out   std_logic := '0';               -- changes when response is new
    response   : out   std_logic_vector(42 downto 0);  -- t2, t1, u3, u2, u1, clamped, saturated, switches, u_next
    cycles     : out   std_logic_vector(15 downto 0)   -- clocks from start to valid
  );
end entity mptc_core_bench;

architecture bench of mptc_core_bench is

  constant PATIENCE         : natural := 100_000; -- clocks
  constant MOST_CLOCKS_MPTC : natural := 40;
  constant MOST_CLOCKS_MPFC : natural := 80;

  type most_t is array (1 to 7) of natural;

  constant MOST_CLOCKS_FAMILY : most_t := (64, 80, 90, 110, 110, 110, 110);
  constant MOST_CLOCKS_BEST   : most_t := (64, 80, 90, 110, 110, 110, 110); -- duty rule best

  signal idle     : natural := 0; -- clocks since the last request
  signal clk      : std_logic := '0';
  signal start    : std_logic := '0';
  signal inputs   : std_logic_vector(164 downto 0) := (others => '0');
  signal method   : std_logic := '0';
  signal several  : std_logic_vector(2 downto 0) := "000";
  signal rule     : std_logic_vector(1 downto 0) := "00";
  signal noise    : std_logic_vector(63 downto 0) := x"9E3779B97F4A7C15";
  signal answered : std_logic := '0';
  signal count    : unsigned(15 downto 0) := (others => '0');
  signal valid    : std_logic;
  signal busy     : std_logic;
  signal decision : std_logic_vector(42 downto 0);

begin

  clk <= not clk after 5 ns;

  p_inputs : process (clk) is

    variable v : std_logic_vector(63 downto 0);

  begin

    if rising_edge(clk) then
      -- xorshift64
      v      := noise xor (noise(50 downto 0) & "0000000000000");
      v      := v xor ("0000000" & v(63 downto 7));
      v      := v xor (v(46 downto 0) & "00000000000000000");
      noise  <= v;
      start  <= '0';
      method <= v(3);
      several <= v(9 downto 7);
      rule    <= v(12 downto 11);
      count  <= count + 1;

      if (start = '1' and busy = '0') then
        count <= x"0001";
      end if;

      if (request /= answered and start = '0' and busy = '0') then
        inputs   <= row;
        method   <= parameters(216);
        several  <= parameters(219 downto 217);
        rule     <= parameters(221 downto 220);
        start    <= '1';
        answered <= request;
        idle     <= 0;
      else
        idle   <= idle + 1;
        inputs <= v(36 downto 0) & v & (v xor x"5555555555555555");
        -- a start while busy has to be ignored
        if (busy = '1' and count < 30) then
          start <= v(5);
        end if;
      end if;

      -- the clock never stops by itself: end a simulation that nobody attends to
      assert idle < PATIENCE
        report "no request for " & integer'image(PATIENCE) & " clocks"
        severity failure;

      assert busy = '0' or count <= MOST_CLOCKS_MPFC or (FAMILY and parameters(219 downto 217) /= "000")
        report "a decision takes more than " & integer'image(MOST_CLOCKS_MPFC) & " clocks"
        severity failure;

      assert busy = '0' or count <= MOST_CLOCKS_MPTC or parameters(216) = '1'
             or (FAMILY and parameters(219 downto 217) /= "000")
        report "a decision takes more than " & integer'image(MOST_CLOCKS_MPTC) & " clocks"
        severity failure;

      for code in 1 to 7 loop
        assert busy = '0' or not FAMILY or to_integer(unsigned(parameters(219 downto 217))) /= code
               or count <= MOST_CLOCKS_FAMILY(code)
               or (parameters(221) = '1' and count <= MOST_CLOCKS_BEST(code))
          report "a decision takes more than " & integer'image(MOST_CLOCKS_FAMILY(code)) & " clocks"
          severity failure;
      end loop;

      if (valid = '1') then
        finished <= answered;
        response <= decision;
        cycles   <= std_logic_vector(count);
      end if;
    end if;

  end process p_inputs;

  g_single : if not FAMILY generate

    i_core : entity directmpc.mptc_core
      generic map (
        FLUX_CONTROL => FLUX_CONTROL
      )
      port map (
        clk             => clk,
        rst             => rst,
        start           => start,
        is_alpha        => inputs(15 downto 0),
        is_beta         => inputs(31 downto 16),
        psis_alpha      => inputs(47 downto 32),
        psis_beta       => inputs(63 downto 48),
        omega_r         => inputs(79 downto 64),
        v_dc            => inputs(95 downto 80),
        torque_ref      => inputs(111 downto 96),
        psi_ref         => inputs(126 downto 112),
        u               => inputs(129 downto 127),
        c_current       => parameters(17 downto 0),
        c_flux          => parameters(35 downto 18),
        c_rotor         => parameters(53 downto 36),
        c_rotor_flux    => parameters(71 downto 54),
        c_drop_current  => parameters(89 downto 72),
        c_drop          => parameters(107 downto 90),
        c_drop_flux     => parameters(125 downto 108),
        c_speed         => parameters(143 downto 126),
        c_voltage_alpha => parameters(161 downto 144),
        c_voltage_beta  => parameters(179 downto 162),
        c_torque        => parameters(197 downto 180),
        c_weight        => parameters(215 downto 198),
        method_mpfc     => method,
        valid           => valid,
        busy            => busy,
        u_next          => decision(2 downto 0),
        switches        => decision(5 downto 3),
        saturated       => decision(6),
        clamped         => decision(7)
      );

    -- one vector for the whole period
    decision(16 downto 8)  <= decision(2 downto 0) & decision(2 downto 0) & decision(2 downto 0);
    decision(29 downto 17) <= "1000000000000";
    decision(42 downto 30) <= (others => '0');

  end generate g_single;

  g_family : if FAMILY generate

    i_core : entity directmpc.mptc_family_core
      port map (
        clk             => clk,
        rst             => rst,
        start           => start,
        is_alpha        => inputs(15 downto 0),
        is_beta         => inputs(31 downto 16),
        psis_alpha      => inputs(47 downto 32),
        psis_beta       => inputs(63 downto 48),
        omega_r         => inputs(79 downto 64),
        v_dc            => inputs(95 downto 80),
        torque_ref      => inputs(111 downto 96),
        psi_ref         => inputs(126 downto 112),
        u               => inputs(129 downto 127),
        c_current       => parameters(17 downto 0),
        c_flux          => parameters(35 downto 18),
        c_rotor         => parameters(53 downto 36),
        c_rotor_flux    => parameters(71 downto 54),
        c_drop_current  => parameters(89 downto 72),
        c_drop          => parameters(107 downto 90),
        c_drop_flux     => parameters(125 downto 108),
        c_speed         => parameters(143 downto 126),
        c_voltage_alpha => parameters(161 downto 144),
        c_voltage_beta  => parameters(179 downto 162),
        c_torque        => parameters(197 downto 180),
        c_weight        => parameters(215 downto 198),
        method_mpfc     => method,
        family_method   => several,
        duty_rule       => rule,
        u1              => inputs(132 downto 130),
        u2              => inputs(135 downto 133),
        u3              => inputs(138 downto 136),
        t1              => inputs(151 downto 139),
        t2              => inputs(164 downto 152),
        valid           => valid,
        busy            => busy,
        u_next          => decision(2 downto 0),
        switches        => decision(5 downto 3),
        saturated       => decision(6),
        clamped         => decision(7),
        next_u1         => decision(10 downto 8),
        next_u2         => decision(13 downto 11),
        next_u3         => decision(16 downto 14),
        next_t1         => decision(29 downto 17),
        next_t2         => decision(42 downto 30)
      );

  end generate g_family;

end architecture bench;
