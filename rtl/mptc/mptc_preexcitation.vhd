-- Pre-excitation (Paper B, section 6.1): builds up the flux before a start without a surge of current.
--
-- A fixed vector, u_1, is applied.  Where the current's magnitude is above its limit, u_0 is applied instead; it is
-- one commutation away.  When the stator flux has reached its level, finished rises and stays.  From then on the
-- drive uses u_next of mptc_core.  restart begins anew.  One decision a control period, in place of the core's.
--
-- Squares are compared instead of magnitudes: |i|**2 with limit**2, |psi|**2 with level**2.
--
-- Formats: as in mptc_core (model/directmpc/mptc/formats.py); limit in the unit of the current, level in the unit of
-- the flux, 15 bits unsigned.
-- Latency: valid 11 clocks after start, always; one mac_block, one multiplier.
-- Overflow: none: sums of three squares of 18 bits fit the accumulator.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_math.all;
  use work.mptc_constants.all;

entity mptc_preexcitation is
  port (
    clk        : in    std_logic;                     -- rising edge
    rst        : in    std_logic;                     -- synchronous, active high; as restart
    restart    : in    std_logic;                     -- '1': finished falls, excite again
    start      : in    std_logic;                     -- '1' for one clock: decide; ignored while busy
    -- sampled with start
    is_alpha   : in    std_logic_vector(15 downto 0); -- stator current, signed, current_max/32767
    is_beta    : in    std_logic_vector(15 downto 0); -- signed, current_max/32767
    psis_alpha : in    std_logic_vector(15 downto 0); -- stator flux linkage, signed, psi_max/32767
    psis_beta  : in    std_logic_vector(15 downto 0); -- signed, psi_max/32767
    -- parameters, stable from start to valid
    limit      : in    std_logic_vector(14 downto 0); -- of the current's magnitude, unsigned, current_max/32767
    level      : in    std_logic_vector(14 downto 0); -- flux magnitude that ends it, unsigned, psi_max/32767
    -- decision, stable until the next valid
    valid      : out   std_logic;                     -- '1' for one clock: decision is new
    busy       : out   std_logic;                     -- '1': a decision is under way
    u_next     : out   std_logic_vector(2 downto 0);  -- number of the vector to apply next, 1 or 0
    limited    : out   std_logic;                     -- '1': the current is above its limit
    finished   : out   std_logic                      -- '1': the flux has been reached, use the core
  );
end entity mptc_preexcitation;

architecture rtl of mptc_preexcitation is

  constant TERMS   : natural := 3;                           -- products of a sum: both components and the bound
  constant WORDS   : natural := 2 * TERMS;                   -- current, then flux; one product a clock
  constant CURRENT : natural := TERMS - 1 + SUM_LATENCY;     -- address: the current's sum is complete
  constant FLUX    : natural := WORDS - 1 + SUM_LATENCY;     -- address: the flux's sum is complete
  constant ENDING  : natural := FLUX + 1;                    -- address: both sums have been seen

  signal active   : std_logic;
  signal address  : natural range 0 to 15;
  signal samples  : std_logic_vector(WORDS * WORD_WIDTH - 1 downto 0);
  signal a_inputs : std_logic_vector(WORDS * WORD_WIDTH - 1 downto 0);
  signal b_inputs : std_logic_vector(WORDS * WORD_WIDTH - 1 downto 0);
  signal place    : unsigned(3 downto 0);
  signal choice   : std_logic_vector(2 downto 0);
  signal limit_word : std_logic_vector(WORD_WIDTH - 1 downto 0);
  signal level_word : std_logic_vector(WORD_WIDTH - 1 downto 0);
  signal issue    : std_logic;
  signal gather   : std_logic;
  signal seed     : std_logic_vector(SUM_WIDTH - 1 downto 0);
  signal total    : std_logic_vector(SUM_WIDTH - 1 downto 0);
  signal above    : std_logic;
  signal reached  : std_logic;
  signal done     : std_logic;

begin

  p_sequence : process (clk) is
  begin

    if rising_edge(clk) then
      valid <= '0';

      if (active = '1') then
        address <= (address + 1) mod 16;

        if (address = ENDING) then
          active <= '0';
          valid  <= '1';
        end if;
      elsif (start = '1') then
        active  <= '1';
        address <= 0;
        samples <= std_logic_vector(resize(unsigned(level), WORD_WIDTH))
                   & std_logic_vector(resize(signed(psis_beta), WORD_WIDTH))
                   & std_logic_vector(resize(signed(psis_alpha), WORD_WIDTH))
                   & std_logic_vector(resize(unsigned(limit), WORD_WIDTH))
                   & std_logic_vector(resize(signed(is_beta), WORD_WIDTH))
                   & std_logic_vector(resize(signed(is_alpha), WORD_WIDTH));
      end if;

      if (rst = '1') then
        active <= '0';
        valid  <= '0';
      end if;
    end if;

  end process p_sequence;

  busy <= active;

  -- a word times itself, the bounds times their one's complement: less x**2 + x; the seed puts x back
  g_words : for i in 0 to WORDS - 1 generate

    g_value : if i mod TERMS /= TERMS - 1 generate
      b_inputs((i + 1) * WORD_WIDTH - 1 downto i * WORD_WIDTH) <= word(samples, i, WORD_WIDTH);
    end generate g_value;

    g_bound : if i mod TERMS = TERMS - 1 generate
      b_inputs((i + 1) * WORD_WIDTH - 1 downto i * WORD_WIDTH) <= not word(samples, i, WORD_WIDTH);
    end generate g_bound;

  end generate g_words;

  a_inputs <= samples;
  place    <= to_unsigned(address, 4);
  choice   <= std_logic_vector(place(2 downto 0));
  issue    <= active and to_std_logic(address < WORDS);
  gather   <= to_std_logic(address /= 0 and address /= TERMS);

  limit_word <= word(samples, TERMS - 1, WORD_WIDTH);
  level_word <= word(samples, WORDS - 1, WORD_WIDTH);
  seed       <= std_logic_vector(resize(unsigned(limit_word), SUM_WIDTH)) when address = 0 else
                std_logic_vector(resize(unsigned(level_word), SUM_WIDTH));

  i_mac : entity work.mac_block
    generic map (
      A_WIDTH           => WORD_WIDTH,
      B_WIDTH           => WORD_WIDTH,
      A_WORDS           => WORDS,
      B_WORDS           => WORDS,
      ALIGNMENT_STEP    => 0,
      ACCUMULATOR_WIDTH => SUM_WIDTH
    )
    port map (
      clk         => clk,
      enable      => issue,
      a_inputs    => a_inputs,
      a_select    => choice,
      b_inputs    => b_inputs,
      b_select    => choice,
      alignment   => "00",
      accumulate  => gather,
      seed        => seed,
      accumulator => total
    );

  p_compare : process (clk) is
  begin

    if rising_edge(clk) then
      -- above the limit: the sum of squares less the limit's is positive
      if (address = CURRENT) then
        above <= to_std_logic(signed(total) > 0);
      end if;

      if (address = FLUX) then
        reached <= not total(SUM_WIDTH - 1);
      end if;

      if (active = '1' and address = ENDING) then
        u_next  <= "00" & not above;
        limited <= above;
        done    <= done or reached;
      end if;

      if (rst = '1' or restart = '1') then
        done <= '0';
      end if;
    end if;

  end process p_compare;

  finished <= done;

end architecture rtl;
