-- Safe torque off of two channels: permits gates while both ask for it, and latches a fault where they disagree.
--
-- Each channel is a level, '1': torque is allowed. It passes two flip-flops and a filter: a channel counts as off when
-- it has been '0' for FILTER clocks in succession, and as on when it has been '1' for as long. So test pulses of up to
-- FILTER - 1 clocks, of either level, do nothing.
--
-- permit is up while both count as on. When one goes off, permit falls, and comes back only after both have been off
-- together: a channel that goes off and on alone does not release the drive.
-- fault is latched, and permit stays '0', when the channels have differed for DISCREPANCY clocks. clear takes it away
-- while both are off, and at no other time.
--
-- It needs its clock: a clock that stands keeps permit as it is. So permit goes to gate_release together with what
-- watches the clock, as in board_top, and a second path to switch off stays outside. docs/safety.md says what this is
-- in the words of the standards, and what it is not.
--
-- Formats: single bits; times in clocks.
-- Latency: permit falls FILTER + 2 rising edges after a channel, counted from the first edge that finds it '0', and
-- rises as many after the second channel. fault rises DISCREPANCY clocks after the filtered channels have parted.
-- Overflow: none; counts stop at their ends.
-- Power-up: off.
-- Constraints: channels are asynchronous; their paths are false paths.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

entity safe_torque_off is
  generic (
    FILTER      : positive range 1 to 65535    := 100;   -- clocks a channel has to stay; longer than a test pulse
    DISCREPANCY : positive range 2 to 16777215 := 50000  -- clocks the channels may differ, more than FILTER
  );
  port (
    clk      : in    std_logic;                    -- rising edge
    rst      : in    std_logic;                    -- synchronous, active high
    channels : in    std_logic_vector(1 downto 0); -- asynchronous, '0': torque off
    clear    : in    std_logic;                    -- '1': forget the fault, if both channels are off
    permit   : out   std_logic;                    -- '1': gates may be on; to gate_release
    fault    : out   std_logic                     -- '1': the channels have differed, latched
  );
end entity safe_torque_off;

architecture rtl of safe_torque_off is

  type counts_t is array (0 to 1) of natural range 0 to FILTER - 1;

  type state_t is record
    counted : std_logic_vector(1 downto 0);             -- channels that count as on
    rested  : std_logic;                                -- both have been off since permit fell
    permit  : std_logic;
    fault   : std_logic;
    other   : counts_t;                                 -- clocks that a channel is not as it counts
    apart   : natural range 0 to DISCREPANCY - 1;       -- clocks that they count differently
  end record state_t;

  constant STATE_INIT : state_t := (
    counted => "00",
    rested  => '1',
    permit  => '0',
    fault   => '0',
    other   => (others => 0),
    apart   => 0
  );

  -- off from configuration on, before any reset
  -- vsg_off signal_007
  signal r     : state_t := STATE_INIT;
  -- vsg_on signal_007
  signal level : std_logic_vector(1 downto 0); -- channels, of clk

begin

  assert FILTER < DISCREPANCY
    report "safe_torque_off: FILTER has to be less than DISCREPANCY"
    severity failure;

  i_sync : entity work.sync_bits
    generic map (
      WIDTH => 2
    )
    port map (
      clk          => clk,
      asynchronous => channels,
      synchronous  => level
    );

  p_state : process (clk) is

    variable v : state_t;

  begin

    if rising_edge(clk) then
      v := r;

      for i in 0 to 1 loop
        if (level(i) = r.counted(i)) then
          v.other(i) := 0;
        elsif (r.other(i) = FILTER - 1) then
          v.counted(i) := level(i);
          v.other(i)   := 0;
        else
          v.other(i) := r.other(i) + 1;
        end if;
      end loop;

      if (clear = '1' and r.counted = "00") then
        v.fault := '0';
      end if;

      if (r.counted(0) = r.counted(1)) then
        v.apart := 0;
      elsif (r.apart = DISCREPANCY - 1) then
        v.fault := '1';
      else
        v.apart := r.apart + 1;
      end if;

      if (v.counted = "00") then
        v.rested := '1';
      elsif (r.permit = '1' and v.counted /= "11") then
        v.rested := '0';
      end if;

      v.permit := v.counted(0) and v.counted(1) and v.rested and not v.fault;

      if (rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_state;

  permit <= r.permit;
  fault  <= r.fault;

end architecture rtl;
