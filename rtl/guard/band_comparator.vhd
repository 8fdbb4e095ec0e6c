-- Compares the voltages of the phase capacitors, the neutral point and the speed with their limits, and finds currents
-- that stand still.
--
-- A measurement whose currents are both those of the one before is a repetition.  frozen_limit of them in succession,
-- while running, are frozen; with frozen_limit = 0 they are not counted.
--
-- TABLED_LEG = false: there are no capacitors; voltages and their limits are not looked at.
--
-- Formats: voltages of capacitors unsigned, v_n and omega_r signed, 16 bits; limits unsigned in the same units.
-- A limit that a measurement cannot exceed trips with every measurement: v_ph_high = 65535, v_n_limit and speed_limit
-- from 32767 on.
-- Latency: the outputs are up three clocks after measured, for one clock, as those of trip_comparator.  Limits are read
-- with measured, running and frozen_limit a clock later.  Interval: one clock.
-- Overflow: none; the count stops at its end.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_math.all;

entity band_comparator is
  generic (
    TABLED_LEG : boolean := true -- true: there is what the converter's package says, false: neither capacitors nor v_n
  );
  port (
    clk          : in    std_logic;                     -- rising edge
    rst          : in    std_logic;                     -- synchronous, active high: forgets what is on its way
    measured     : in    std_logic;                     -- '1': the measurements are new
    running      : in    std_logic;                     -- '1': gates follow decisions
    is_alpha     : in    std_logic_vector(15 downto 0); -- stator current
    is_beta      : in    std_logic_vector(15 downto 0); -- stator current
    v_n          : in    std_logic_vector(15 downto 0); -- neutral point, signed
    v_ph_a       : in    std_logic_vector(15 downto 0); -- capacitor of phase a, unsigned
    v_ph_b       : in    std_logic_vector(15 downto 0); -- capacitor of phase b, unsigned
    v_ph_c       : in    std_logic_vector(15 downto 0); -- capacitor of phase c, unsigned
    omega_r      : in    std_logic_vector(15 downto 0); -- speed, signed
    v_ph_high    : in    std_logic_vector(15 downto 0); -- unsigned, unit as v_ph_a
    v_ph_low     : in    std_logic_vector(15 downto 0); -- unsigned, unit as v_ph_a
    v_n_limit    : in    std_logic_vector(15 downto 0); -- unsigned, unit as v_n, either sign
    speed_limit  : in    std_logic_vector(15 downto 0); -- unsigned, unit as omega_r, either sign
    frozen_limit : in    std_logic_vector(7 downto 0);  -- repetitions, unsigned; 0: any number
    capacitor    : out   std_logic;                     -- '1': a capacitor was outside its band
    neutral      : out   std_logic;                     -- '1': v_n was beyond its limit
    speed        : out   std_logic;                     -- '1': omega_r was beyond its limit
    frozen       : out   std_logic                      -- '1': the currents stand still
  );
end entity band_comparator;

architecture rtl of band_comparator is

  constant HIGHEST_SIGNED : natural               := 2 ** 15 - 1;     -- of a signed measurement
  constant HIGHEST        : unsigned(15 downto 0) := (others => '1'); -- of an unsigned one

  -- suffixes: clocks after measured
  signal valid_1     : std_logic;
  signal capacitor_1 : std_logic;
  signal neutral_1   : std_logic;
  signal speed_1     : std_logic;
  signal same_1      : std_logic;
  signal capacitor_2 : std_logic;
  signal neutral_2   : std_logic;
  signal speed_2     : std_logic;
  signal frozen_2    : std_logic;
  signal last_alpha  : std_logic_vector(15 downto 0); -- of the measurement before
  signal last_beta   : std_logic_vector(15 downto 0);
  signal repeated    : unsigned(7 downto 0);          -- repetitions in succession

  -- '1': value lies outside a band that includes its ends
  function leaves (value, low, high : std_logic_vector) return std_logic is
  begin

    return to_std_logic(unsigned(value) > unsigned(high) or unsigned(value) < unsigned(low));

  end function leaves;

  -- '1': value lies above limit or below -limit, or nothing can
  function beyond (value, limit : std_logic_vector) return std_logic is

    variable bound : signed(17 downto 0);

  begin

    bound := signed(resize(unsigned(limit), 18));
    return to_std_logic(resize(signed(value), 18) > bound or resize(signed(value), 18) < -bound
                        or unsigned(limit) >= HIGHEST_SIGNED);

  end function beyond;

begin

  p_compare : process (clk) is

    variable again : unsigned(7 downto 0);

  begin

    if rising_edge(clk) then
      valid_1     <= measured;
      capacitor_1 <= '0';
      neutral_1   <= '0';
      speed_1     <= beyond(omega_r, speed_limit);
      same_1      <= to_std_logic(is_alpha = last_alpha and is_beta = last_beta);

      if (TABLED_LEG and HAS_CAPACITORS) then
        capacitor_1 <= leaves(v_ph_a, v_ph_low, v_ph_high) or leaves(v_ph_b, v_ph_low, v_ph_high)
                       or leaves(v_ph_c, v_ph_low, v_ph_high) or to_std_logic(unsigned(v_ph_high) = HIGHEST);
      end if;

      if (TABLED_LEG and HAS_NEUTRAL) then
        neutral_1   <= beyond(v_n, v_n_limit);
      end if;

      if (measured = '1') then
        last_alpha <= is_alpha;
        last_beta  <= is_beta;
      end if;

      capacitor_2 <= valid_1 and capacitor_1;
      neutral_2   <= valid_1 and neutral_1;
      speed_2     <= valid_1 and speed_1;
      frozen_2    <= '0';

      if (valid_1 = '1') then
        again := (others => '0');

        if (same_1 = '1' and running = '1') then
          again := repeated;

          if (repeated /= (repeated'range => '1')) then
            again := repeated + 1;
          end if;

          frozen_2 <= to_std_logic(again >= unsigned(frozen_limit) and unsigned(frozen_limit) /= 0);
        end if;

        repeated <= again;
      end if;

      capacitor <= capacitor_2;
      neutral   <= neutral_2;
      speed     <= speed_2;
      frozen    <= frozen_2;

      if (rst = '1') then
        valid_1     <= '0';
        capacitor_2 <= '0';
        neutral_2   <= '0';
        speed_2     <= '0';
        frozen_2    <= '0';
        capacitor   <= '0';
        neutral     <= '0';
        speed       <= '0';
        frozen      <= '0';
        last_alpha  <= (others => '0');
        last_beta   <= (others => '0');
        repeated    <= (others => '0');
      end if;
    end if;

  end process p_compare;

end architecture rtl;
