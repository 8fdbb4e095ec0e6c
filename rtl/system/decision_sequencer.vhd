-- Lets one decision follow the other: when it begins, with which choices, and what changes in between.
--
-- A decision begins with start or, where from_registers says so, with command_start.  What comes while one is under
-- way is ignored and flagged, and so is command_start where start counts.  start where command_start counts is ignored
-- without a flag: a timer at the port may go on.  The choices that a decision works with are those of its beginning.
-- A commit and a reset of the observer wait for the end of the decision.
--
-- Formats: none. Latency: go one clock after start; load as commit_control's.
-- Overflow: none; a start that comes too early is dropped and flagged.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity decision_sequencer is
  port (
    clk            : in    std_logic;                    -- rising edge
    rst            : in    std_logic;                    -- synchronous, active high
    start          : in    std_logic;                    -- '1' for one clock: measurements are at the ports
    command_start  : in    std_logic;                    -- '1' for one clock: they are in the registers
    from_registers : in    std_logic;                    -- '1': command_start counts, '0': start
    use_observer   : in    std_logic;                    -- choice
    own_positions  : in    std_logic;                    -- choice
    reset_observer : in    std_logic;                    -- '1' for one clock: the observer is to begin anew
    commit         : in    std_logic;                    -- '1' for one clock: new parameters are to take effect
    ending         : in    std_logic;                    -- '1' for one clock: the core has decided
    take           : out   std_logic;                    -- '1': measurements are taken from the ports
    begins         : out   std_logic;                    -- '1': go in the next clock
    go             : out   std_logic;                    -- '1' for one clock: begins, measurements are in registers
    deciding       : out   std_logic;                    -- '1': a decision is under way
    ignored        : out   std_logic;                    -- '1': a start was ignored
    observing      : out   std_logic;                    -- use_observer of this decision
    owning         : out   std_logic;                    -- own_positions of this decision
    forget         : out   std_logic;                    -- '1': the observer is to begin anew, once not deciding
    load           : out   std_logic;                    -- '1': parameters take effect
    load_at_rest   : out   std_logic;                    -- '1': a commit waits, no decision is under way
    pending        : out   std_logic;                    -- '1': a commit waits
    commits        : out   std_logic_vector(15 downto 0) -- that took effect, unsigned
  );
end entity decision_sequencer;

architecture rtl of decision_sequencer is

  signal begun   : std_logic;
  signal any     : std_logic; -- start of either kind
  signal running : std_logic;
  signal waiting : std_logic; -- the observer is to begin anew

begin

  take    <= start and not running and not from_registers;
  begun   <= (start and not running and not from_registers)
             or (command_start and not running and from_registers);
  ignored <= (start and not from_registers and running) or (command_start and (running or not from_registers));
  any     <= start or command_start;
  begins  <= begun;

  p_sequence : process (clk) is
  begin

    if rising_edge(clk) then
      go <= begun;

      if (begun = '1') then
        running   <= '1';
        observing <= use_observer;
        owning    <= own_positions;
      elsif (ending = '1') then
        running <= '0';
      end if;

      if (reset_observer = '1') then
        waiting <= '1';
      elsif (running = '0') then
        waiting <= '0';
      end if;

      if (rst = '1') then
        running <= '0';
        go      <= '0';
        waiting <= '0';
      end if;
    end if;

  end process p_sequence;

  deciding <= running;
  forget   <= waiting;

  i_commit : entity work.commit_control
    port map (
      clk     => clk,
      rst     => rst,
      request => commit,
      start   => any,
      busy    => running,
      ending  => ending,
      load    => load,
      at_rest => load_at_rest,
      pending => pending,
      count   => commits
    );

end architecture rtl;
