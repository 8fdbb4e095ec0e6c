-- Samples a measurement and forms the operands that common_terms multiplies.
--
-- Every quantity is an operand itself. So are the differences
--   iref - is        of alpha and beta
--   v_dc/4 - v_ph    of each phase, with HALF_CAPACITORS v_dc/2 - v_ph
-- The second is v_dc - 2 * v_ph in words, or v_dc - v_ph: the LSB of v_dc is twice that of v_ph.
--
-- Formats: operands signed, OPERAND_WIDTH bits, OPERAND_* order; the scale is the quantity's own.
-- Latency: one clock from take.
-- Overflow: none; OPERAND_WIDTH holds the differences of two 16-bit words, one of them doubled.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.half_capacitors;
  use work.directmpc_constants.all;
  use work.mpdcc_types.all;

entity measurement_operands is
  port (
    clk         : in    std_logic;       -- rising edge
    take        : in    std_logic;       -- '1': sample measurement
    measurement : in    measurement_t;   -- sampled with take
    operands    : out   root_operands_t  -- stable until the next take
  );
end entity measurement_operands;

architecture rtl of measurement_operands is

  -- bits by which v_ph is shifted beside v_dc
  constant PH_SHIFT : natural := 1 - boolean'pos(HALF_CAPACITORS);

  signal sample : measurement_t;

begin

  p_sample : process (clk) is
  begin

    if rising_edge(clk) then
      if (take = '1') then
        sample <= measurement;
      end if;
    end if;

  end process p_sample;

  p_signals : process (sample) is

    variable bus_words : std_logic_vector(SIGNAL_COUNT * OPERAND_WIDTH - 1 downto 0);

    procedure put (index : natural; value : signed) is
    begin

      bus_words((index + 1) * OPERAND_WIDTH - 1 downto index * OPERAND_WIDTH) :=
        std_logic_vector(resize(value, OPERAND_WIDTH));

    end procedure put;

    -- difference of two voltages: v_dc/4 - v_ph at twice the scale of v_ph, or v_dc/2 - v_ph at the same
    function difference (v_dc, v_ph : unsigned) return signed is
    begin

      return signed(resize(v_dc, OPERAND_WIDTH)) - signed(shift_left(resize(v_ph, OPERAND_WIDTH), PH_SHIFT));

    end function difference;

  begin

    bus_words := (others => '0');
    put(OPERAND_IS_ALPHA, sample.is_alpha);
    put(OPERAND_IS_BETA, sample.is_beta);
    put(OPERAND_PSIR_ALPHA, sample.psir_alpha);
    put(OPERAND_PSIR_BETA, sample.psir_beta);
    put(OPERAND_V_N, sample.v_n);
    put(OPERAND_V_PH_A, signed(resize(sample.v_ph_a, OPERAND_WIDTH)));
    put(OPERAND_V_PH_B, signed(resize(sample.v_ph_b, OPERAND_WIDTH)));
    put(OPERAND_V_PH_C, signed(resize(sample.v_ph_c, OPERAND_WIDTH)));
    put(OPERAND_V_DC, signed(resize(sample.v_dc, OPERAND_WIDTH)));
    put(OPERAND_IREF_ALPHA, sample.iref_alpha);
    put(OPERAND_IREF_BETA, sample.iref_beta);
    put(OPERAND_DIFFERENCE_ALPHA, resize(sample.iref_alpha, OPERAND_WIDTH) - sample.is_alpha);
    put(OPERAND_DIFFERENCE_BETA, resize(sample.iref_beta, OPERAND_WIDTH) - sample.is_beta);
    put(OPERAND_DIFFERENCE_A, difference(sample.v_dc, sample.v_ph_a));
    put(OPERAND_DIFFERENCE_B, difference(sample.v_dc, sample.v_ph_b));
    put(OPERAND_DIFFERENCE_C, difference(sample.v_dc, sample.v_ph_c));
    operands.signals <= bus_words;

  end process p_signals;

  operands.speeds <= std_logic_vector(sample.omega_r) & std_logic_vector(sample.omega_s);

end architecture rtl;
