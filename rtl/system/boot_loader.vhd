-- Sets up a system without a host: carries out the entries of a ROM over AXI4-Lite, from a reset on.
--
-- The ROM stands outside. `make registers ARGS=--vhdl` writes it as a package: wait until no commit is pending, write
-- the drive's registers, commit, wait, enable.  Each entry is one of three operations:
--   00  write word to address, then read address: the word read has to be the word written
--   01  write word to address
--   1-  read address until every bit that is set in word reads as '0'
-- An access that is answered with an error is repeated, and so is a read that waits.  An entry has TRIES accesses.
--
-- done stays up behind the last entry: every word stands as the ROM has it.  failed stays up instead if an entry has
-- used its accesses or another word was read; place then is that entry.  Nothing follows a failure, so the entry that
-- enables the system comes last.  Neither changes before the next reset.
--
-- Formats: an entry is operation (2 bits), address in bytes (14 bits), word (32 bits), operation leftmost.
-- Latency: an entry takes one clock and its accesses, each as axi_lite_master's.
-- Overflow: none.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity boot_loader is
  generic (
    ADDRESS_WIDTH : positive range 2 to 14 := 10;   -- bits of a byte address on the bus
    TRIES         : positive               := 4095; -- accesses of an entry before it fails
    LIMIT         : positive               := 255   -- clocks an access may take
  );
  port (
    clk            : in    std_logic;                                    -- rising edge
    rst            : in    std_logic;                                    -- synchronous, active high; begins after it
    -- ROM
    place          : out   std_logic_vector(9 downto 0);                 -- number of an entry, unsigned
    entry          : in    std_logic_vector(47 downto 0);                -- that entry, at most a clock behind place
    last           : in    std_logic_vector(9 downto 0);                 -- number of the last entry, unsigned, stays
    -- outcome
    done           : out   std_logic;                                    -- '1': all entries are carried out
    failed         : out   std_logic;                                    -- '1': the entry at place is not
    -- AXI4-Lite
    m_axil_awready : in    std_logic;                                    -- slave takes the address
    m_axil_awvalid : out   std_logic;                                    -- write address is there
    m_axil_awaddr  : out   std_logic_vector(ADDRESS_WIDTH - 1 downto 0); -- bytes
    m_axil_awprot  : out   std_logic_vector(2 downto 0);                 -- always "000"
    m_axil_wready  : in    std_logic;                                    -- slave takes the word
    m_axil_wvalid  : out   std_logic;                                    -- word is there
    m_axil_wdata   : out   std_logic_vector(31 downto 0);                -- word to write
    m_axil_wstrb   : out   std_logic_vector(3 downto 0);                 -- always "1111"
    m_axil_bready  : out   std_logic;                                    -- response is taken
    m_axil_bvalid  : in    std_logic;                                    -- response is there
    m_axil_bresp   : in    std_logic_vector(1 downto 0);                 -- "00": okay
    m_axil_arready : in    std_logic;                                    -- slave takes the address
    m_axil_arvalid : out   std_logic;                                    -- read address is there
    m_axil_araddr  : out   std_logic_vector(ADDRESS_WIDTH - 1 downto 0); -- bytes
    m_axil_arprot  : out   std_logic_vector(2 downto 0);                 -- always "000"
    m_axil_rready  : out   std_logic;                                    -- word is taken
    m_axil_rvalid  : in    std_logic;                                    -- word is there
    m_axil_rdata   : in    std_logic_vector(31 downto 0);                -- word read
    m_axil_rresp   : in    std_logic_vector(1 downto 0)                  -- "00": okay
  );
end entity boot_loader;

architecture rtl of boot_loader is

  type phase_t is (FETCH, BEGINS, UNDER_WAY, IS_DONE, HAS_FAILED);

  type state_t is record
    phase : phase_t;
    place : unsigned(9 downto 0);
    back  : std_logic;                      -- the word is read back
    tried : natural range 0 to TRIES - 1;   -- accesses of this entry that have ended without success
  end record state_t;

  constant STATE_INIT : state_t := (
    phase => FETCH,
    place => (others => '0'),
    back  => '0',
    tried => 0
  );

  constant OKAY : std_logic_vector(1 downto 0) := "00";

  signal r        : state_t;
  signal start    : std_logic;
  signal write    : std_logic;
  signal waits    : std_logic; -- the entry waits for bits
  signal checks   : std_logic; -- the entry's word is read back
  signal address  : std_logic_vector(15 downto 0);
  signal word     : std_logic_vector(31 downto 0);
  signal ended    : std_logic;
  signal rdata    : std_logic_vector(31 downto 0);
  signal response : std_logic_vector(1 downto 0);

begin

  waits   <= entry(47);
  checks  <= not (entry(47) or entry(46));
  address <= "00" & entry(45 downto 32);
  word    <= entry(31 downto 0);
  write   <= not (waits or r.back);
  start   <= '1' when r.phase = BEGINS else
             '0';

  p_state : process (clk) is

    variable v       : state_t;
    variable again   : boolean; -- the access is to be repeated
    variable forward : boolean; -- the entry is carried out

  begin

    if rising_edge(clk) then
      v       := r;
      again   := false;
      forward := false;

      case r.phase is

        when FETCH =>

          v.phase := BEGINS;

        when BEGINS =>

          v.phase := UNDER_WAY;

        when UNDER_WAY =>

          if (ended = '1') then
            if (response /= OKAY) then
              again := true;
            elsif (waits = '1') then
              again   := (rdata and word) /= (word'range => '0');
              forward := not again;
            elsif (r.back = '1') then
              forward := rdata = word;

              if (not forward) then
                v.phase := HAS_FAILED;
              end if;
            elsif (checks = '1') then
              v.back  := '1';
              v.phase := BEGINS;
            else
              forward := true;
            end if;
          end if;

        when others =>

          null;

      end case;

      if (again) then
        v.phase := BEGINS;

        if (r.tried = TRIES - 1) then
          v.phase := HAS_FAILED;
        else
          v.tried := r.tried + 1;
        end if;
      end if;

      if (forward) then
        v.back  := '0';
        v.tried := 0;
        v.phase := IS_DONE;

        if (r.place /= unsigned(last)) then
          v.place := r.place + 1;
          v.phase := FETCH;
        end if;
      end if;

      if (rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_state;

  i_master : entity work.axi_lite_master
    generic map (
      ADDRESS_WIDTH => ADDRESS_WIDTH,
      LIMIT         => LIMIT
    )
    port map (
      clk      => clk,
      rst      => rst,
      start    => start,
      write    => write,
      address  => address,
      wdata    => word,
      done     => ended,
      rdata    => rdata,
      response => response,
      awready  => m_axil_awready,
      awvalid  => m_axil_awvalid,
      awaddr   => m_axil_awaddr,
      awprot   => m_axil_awprot,
      wready   => m_axil_wready,
      wvalid   => m_axil_wvalid,
      wword    => m_axil_wdata,
      wstrb    => m_axil_wstrb,
      bready   => m_axil_bready,
      bvalid   => m_axil_bvalid,
      bresp    => m_axil_bresp,
      arready  => m_axil_arready,
      arvalid  => m_axil_arvalid,
      araddr   => m_axil_araddr,
      arprot   => m_axil_arprot,
      rready   => m_axil_rready,
      rvalid   => m_axil_rvalid,
      rword    => m_axil_rdata,
      rresp    => m_axil_rresp
    );

  place  <= std_logic_vector(r.place);
  done   <= '1' when r.phase = IS_DONE else
            '0';
  failed <= '1' when r.phase = HAS_FAILED else
            '0';

end architecture rtl;
