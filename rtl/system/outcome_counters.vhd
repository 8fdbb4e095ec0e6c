-- One counter for every outcome a frame may have, in a small memory that is kept twice, once for each read port.
--
-- Two sources: the receiver and the executor; when both count in the same clock the latter
-- waits for one. After a reset the counters are cleared, one a clock.
--
-- Formats: 32 bits unsigned.
-- Latency: a count shows two clocks after it (three when both came at once). One count of each source
-- in every second clock at most, which frames of at least two bytes keep.
-- Overflow: a counter stays at its largest value.
-- Considered and rejected: docs/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.link_constants.all;

entity outcome_counters is
  port (
    clk             : in    std_logic;                     -- rising edge
    rst             : in    std_logic;                     -- synchronous, active high: clears
    received        : in    std_logic;                     -- '1' for one clock: count receive_outcome
    receive_outcome : in    outcome_t;                     -- what the receiver made of a frame
    served          : in    std_logic;                     -- '1' for one clock: count serve_outcome
    serve_outcome   : in    outcome_t;                     -- what became of a frame that was received
    index           : in    std_logic_vector(3 downto 0);  -- counter to look at
    value           : out   std_logic_vector(31 downto 0)  -- its value, same clock
  );
end entity outcome_counters;

architecture rtl of outcome_counters is

  signal clearing : unsigned(4 downto 0); -- counter being cleared; 16: done
  signal pending  : std_logic;
  signal waiting  : outcome_t;
  signal chosen   : outcome_t;
  signal present  : std_logic_vector(31 downto 0); -- count of chosen
  signal counting : std_logic;                     -- '1': chosen is counted
  signal write    : std_logic;
  signal place    : outcome_t;                     -- counter that is written
  signal fresh    : std_logic_vector(31 downto 0); -- its new value

begin

  chosen  <= receive_outcome when received = '1' else
             waiting;

  counting <= (received or pending) when present /= x"FFFFFFFF" else
              '0';

  -- one write port: clearing and counting never meet
  write <= counting or not clearing(4);
  place <= std_logic_vector(clearing(3 downto 0)) when clearing(4) = '0' else
           chosen;
  fresh <= (others => '0') when clearing(4) = '0' else
           std_logic_vector(unsigned(present) + 1);

  i_counted : entity work.ram
    generic map (
      ADDRESS_WIDTH => 4,
      WIDTH         => 32,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write,
      write_address => place,
      write_word    => fresh,
      read          => '1',
      read_address  => chosen,
      read_word     => present
    );

  -- the same once more, for its own read port
  i_shown : entity work.ram
    generic map (
      ADDRESS_WIDTH => 4,
      WIDTH         => 32,
      LATENCY       => 0,
      STYLE         => "distributed"
    )
    port map (
      clk           => clk,
      write         => write,
      write_address => place,
      write_word    => fresh,
      read          => '1',
      read_address  => index,
      read_word     => value
    );

  p_count : process (clk) is
  begin

    if rising_edge(clk) then
      if (clearing(4) = '0') then
        clearing <= clearing + 1;
      end if;

      if (received = '0') then
        pending <= '0';
      end if;

      if (served = '1') then
        waiting <= serve_outcome;
        pending <= '1';
      end if;

      if (rst = '1') then
        clearing <= (others => '0');
        pending  <= '0';
      end if;
    end if;

  end process p_count;

end architecture rtl;
