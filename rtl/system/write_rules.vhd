-- Says which register writes are refused.
--
-- Refused are
--   writes of some bytes of a word, not all;
--   shadows (guard and parameters) while a commit waits: they stay as they were when it was asked for. It waits, too,
--   until its parameters are in force;
--   the guard's limits and times while control.enable is set: they are locked;
--   control with enable set while a commit waits, or while the guard has settings that no commit has brought into
--   force;
--   bounds of MPDCC above BOUND_LIMIT, beyond which the fast explorers' sums would leave their words.
-- So the guard's settings in force are those of its registers whenever the gates may be on. Every other write
-- passes at any time: control, command, flags and faults never wait for a decision.
--
-- A commit that takes effect at once is not refused but waited for: hold is up for three clocks, that of the command
-- and two after it. The settings take effect in the second, MPTC's parameters in the third, unless a decision is under
-- way or begins. MPDCC's are copied from then on. In the clock of load a commit still waits, so no shadow changes with
-- it.
--
-- Formats: byte addresses; blocks of registers as in directmpc_system_registers_pkg.
-- Latency: none; a setting counts as uncommitted from the clock after its write.
-- Overflow: none.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.directmpc_system_registers_pkg.all;

entity write_rules is
  generic (
    FIRST_BOUND : natural range 0 to 61    := 0;    -- place of MPDCC's three bounds among the parameters
    BOUND_LIMIT : natural range 0 to 65535 := 65535 -- trajectory units; 65535: any bound passes
  );
  port (
    clk     : in    std_logic;                    -- rising edge
    rst     : in    std_logic;                    -- synchronous, active high
    address : in    std_logic_vector(9 downto 0); -- of the write that is there, bytes
    whole   : in    std_logic;                    -- '1': all bytes of the word are written
    word    : in    std_logic_vector(15 downto 0); -- lower half of its word
    passed  : in    std_logic;                    -- '1': it goes to the registers
    enabled : in    std_logic;                    -- control.enable
    commit  : in    std_logic;                    -- '1' for one clock: a commit is asked for
    pending : in    std_logic;                    -- '1': a commit waits
    load    : in    std_logic;                    -- '1' for one clock: the shadows take effect; pending is up
    hold    : out   std_logic;                    -- '1': the write waits
    refuse  : out   std_logic                     -- '1': the write is refused
  );
end entity write_rules;

architecture rtl of write_rules is

  signal of_guard    : std_logic;
  signal of_shadows  : std_logic;
  signal enables     : std_logic;
  signal too_wide    : std_logic; -- a bound beyond BOUND_LIMIT
  signal uncommitted : std_logic; -- a setting of the guard has not taken effect
  signal asked       : std_logic_vector(1 downto 0); -- commit a clock ago, and two

begin

  of_guard   <= '1' when address(GUARD_BLOCK'range) = GUARD_BLOCK else
                '0';
  of_shadows <= '1' when address(PARAMETER_BLOCK'range) = PARAMETER_BLOCK else
                of_guard;
  enables    <= word(0) when address(9 downto 2) = CONTROL_ADDRESS(9 downto 2) else
                '0';

  g_bounds : if BOUND_LIMIT < 65535 generate
    too_wide <= '1' when address(PARAMETER_BLOCK'range) = PARAMETER_BLOCK
                         and unsigned(address(7 downto 2)) >= FIRST_BOUND
                         and unsigned(address(7 downto 2)) <= FIRST_BOUND + 2
                         and unsigned(word) > BOUND_LIMIT else
                '0';
  end generate g_bounds;

  g_any_bounds : if BOUND_LIMIT = 65535 generate
    too_wide <= '0';
  end generate g_any_bounds;

  hold   <= commit or asked(0) or asked(1);
  refuse <= (of_shadows and pending) or (of_guard and enabled) or (enables and (uncommitted or pending)) or too_wide
            or not whole;

  p_settings : process (clk) is
  begin

    if rising_edge(clk) then
      asked <= asked(0) & commit;

      if (passed = '1' and of_guard = '1') then
        uncommitted <= '1';
      elsif (load = '1') then
        uncommitted <= '0';
      end if;

      if (rst = '1') then
        asked       <= (others => '0');
        uncommitted <= '0';
      end if;
    end if;

  end process p_settings;

end architecture rtl;
