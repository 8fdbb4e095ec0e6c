-- Hands candidates of the root to the explorers: the probe, then what is enumerated.
--
-- The probe is s(k-1) and goes to explorer 0. A candidate, or with BLOCKS a block of candidates, goes to
-- the lowest-numbered explorer that is free. With one_explorer all go to explorer 0, so that the queue of the
-- second level takes one candidate a clock.
--
-- Formats: see candidate_t.
-- Latency: none from probe to valid(0) and from ready to valid; the first candidate is valid two clocks after
-- enumerate; one per clock.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

library work;
  use work.converter_leg.all;
  use work.directmpc_math.all;
  use work.mpdcc_types.all;

entity candidate_handout is
  generic (
    EXPLORERS : positive range 1 to 8 := 2;    -- number of explorers
    BLOCKS    : boolean               := false -- true: the explorers expand phase c
  );
  port (
    clk          : in    std_logic;                                -- rising edge
    rst          : in    std_logic;                                -- synchronous, active high
    previous     : in    positions_t;                              -- s(k-1), stable
    negative     : in    std_logic_vector(2 downto 0);             -- '1': negative phase current, a in bit 0; stable
    probing      : in    std_logic;                                -- '1': candidate is the probe
    probe        : in    std_logic;                                -- '1' for one clock, with probing: offer it
    enumerate    : in    std_logic;                                -- '1' for one clock: begin with the candidates
    searching    : in    std_logic;                                -- '1': offer them
    one_explorer : in    std_logic;                                -- '1': to explorer 0 alone, stable
    ready        : in    std_logic_vector(EXPLORERS - 1 downto 0); -- '1': explorer is free
    valid        : out   std_logic_vector(EXPLORERS - 1 downto 0); -- one-hot: who takes candidate
    candidate    : out   candidate_t;                              -- the probe, or a candidate
    done         : out   std_logic                                 -- '1': every candidate has been taken
  );
end entity candidate_handout;

architecture rtl of candidate_handout is

  signal enumerate_valid : std_logic;
  signal enumerate_ready : std_logic;
  signal enumerated      : candidate_t;

begin

  i_enumerator : entity work.candidate_enumerator
    generic map (
      BLOCKS => BLOCKS
    )
    port map (
      clk       => clk,
      rst       => rst,
      start     => enumerate,
      previous  => previous,
      negative  => negative,
      valid     => enumerate_valid,
      ready     => enumerate_ready,
      candidate => enumerated,
      done      => done
    );

  p_valid : process (probe, searching, enumerate_valid, ready, one_explorer) is
  begin

    enumerate_ready <= '0';
    valid           <= (others => '0');

    if (probe = '1') then
      valid(0) <= '1';
    end if;

    if (searching = '1' and enumerate_valid = '1') then
      valid           <= first_of(ready);
      enumerate_ready <= to_std_logic(ready /= (ready'range => '0'));

      if (one_explorer = '1') then
        valid           <= (others => '0');
        valid(0)        <= ready(0);
        enumerate_ready <= ready(0);
      end if;
    end if;

  end process p_valid;

  p_candidate : process (probing, previous, enumerated) is
  begin

    candidate <= enumerated;

    if (probing = '1') then
      candidate <= (
        probe    => '1',
        index    => (others => '0'),
        position => previous,
        effort   => (others => '0')
      );
    end if;

  end process p_candidate;

end architecture rtl;
