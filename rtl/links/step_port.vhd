-- Hands a step to the core, waits for the decision, and keeps it until it is fetched.
--
-- A core without an answer after LIMIT clocks gives no_answer instead of a decision. What it decides after that is
-- nobody's answer.
--
-- Formats: decision as in the STEP reply of docs/protocol.md.
-- Latency: step_start one clock after start; done two clocks after decision_valid.
-- Overflow: none; start comes only while not waiting.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;

library work;
  use work.link_constants.all;

entity step_port is
  generic (
    LIMIT : positive := LONGEST_DECISION -- clocks a decision may take
  );
  port (
    clk             : in    std_logic;                     -- rising edge
    rst             : in    std_logic;                     -- synchronous, active high
    start           : in    std_logic;                     -- '1' for one clock: a step begins
    waiting         : out   std_logic;                     -- '1': a step waits for its decision, or is done
    done            : out   std_logic;                     -- '1': it waits no longer
    fetched         : in    std_logic;                     -- '1' for one clock: the answer is no longer needed
    -- core
    step_start      : out   std_logic;                     -- '1' for one clock: decide
    decision_valid  : in    std_logic;                     -- '1' for one clock: decision is new
    decision        : in    std_logic_vector(15 downto 0); -- position
    decision_flags  : in    byte_t;                        -- FLAG_HELD to FLAG_CLAMPED, EXHAUSTED
    decision_length : in    byte_t;                        -- L*
    decision_cycles : in    std_logic_vector(15 downto 0); -- of the core, clock after decision_valid
    -- answer, valid while done
    no_answer       : out   std_logic;                     -- '1': there is none, the next four are of no step
    position        : out   std_logic_vector(15 downto 0); -- decision
    flags           : out   byte_t;                        -- as decision_flags
    length          : out   byte_t;                        -- L*
    cycles          : out   std_logic_vector(15 downto 0)  -- clocks that it took
  );
end entity step_port;

architecture rtl of step_port is

  type phase_t is (PHASE_IDLE, PHASE_START, PHASE_WAIT, PHASE_COUNT, PHASE_DONE);

  signal phase : phase_t;
  signal count : natural range 0 to LIMIT; -- clocks waited

begin

  p_step : process (clk) is
  begin

    if rising_edge(clk) then

      case phase is

        when PHASE_IDLE =>
          count     <= 0;
          no_answer <= '0';

          if (start = '1') then
            phase <= PHASE_START;
          end if;

        when PHASE_START =>
          phase <= PHASE_WAIT;

        when PHASE_WAIT =>
          count <= count + 1;

          if (decision_valid = '1') then
            phase <= PHASE_COUNT;
          elsif (count = LIMIT - 1) then
            no_answer <= '1';
            phase     <= PHASE_DONE;
          end if;

        when PHASE_COUNT =>
          phase <= PHASE_DONE;

        when PHASE_DONE =>
          if (fetched = '1') then
            phase <= PHASE_IDLE;
          end if;

      end case;

      if (phase = PHASE_WAIT) then
        position <= decision;
        flags    <= decision_flags;
        length   <= decision_length;
      end if;

      if (phase = PHASE_COUNT) then
        cycles <= decision_cycles;
      end if;

      if (rst = '1') then
        phase <= PHASE_IDLE;
      end if;
    end if;

  end process p_step;

  step_start <= '1' when phase = PHASE_START else
                '0';
  waiting    <= '0' when phase = PHASE_IDLE else
                '1';
  done       <= '1' when phase = PHASE_DONE else
                '0';

end architecture rtl;
