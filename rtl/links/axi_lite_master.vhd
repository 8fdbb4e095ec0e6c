-- AXI4-Lite master for single accesses: one read or write at a time.
--
-- Address and data of a write are offered together and each is withdrawn when it has been accepted.
-- An address that is no multiple of 4 or lies beyond ADDRESS_WIDTH bits is no alias of a register: it is answered
-- here and never reaches the bus.
--
-- Formats: addresses in bytes, ADDRESS_WIDTH bits of them on the bus; words of 32 bits, all four strobes set.
-- Latency: done two clocks after the slave's response is accepted, three after start for an address that is refused.
-- No access while another is under way.
-- Overflow: none.  If the slave does not answer within LIMIT clocks of start, the access is given up with the
-- response SLVERR. AXI cannot take it back: it stays on the bus until the slave has answered, its answer is dropped,
-- and accesses until then are answered with SLVERR at once. The bus then goes on.
-- Considered and rejected: rtl/alternatives.md.
-- Licence: Apache-2.0

library ieee;
  use ieee.std_logic_1164.all;
  use ieee.numeric_std.all;

entity axi_lite_master is
  generic (
    ADDRESS_WIDTH : positive range 2 to 15 := 12; -- bits of a byte address on the bus
    LIMIT         : positive               := 255 -- clocks an access may take
  );
  port (
    clk      : in    std_logic; -- rising edge
    rst      : in    std_logic; -- synchronous, active high
    -- access
    start    : in    std_logic;                                    -- '1' for one clock; ignored while busy
    write    : in    std_logic;                                    -- '1': write, '0': read; with start
    address  : in    std_logic_vector(15 downto 0);                -- bytes, with start
    wdata    : in    std_logic_vector(31 downto 0);                -- with start
    done     : out   std_logic;                                    -- '1' for one clock: access has ended
    rdata    : out   std_logic_vector(31 downto 0);                -- word read, else zero; from done on
    response : out   std_logic_vector(1 downto 0);                 -- "00": okay, else as AXI's RESP; from done on
    -- AXI4-Lite, names as in the standard
    awready  : in    std_logic;                                    -- slave takes the address
    awvalid  : out   std_logic;                                    -- write address is there
    awaddr   : out   std_logic_vector(ADDRESS_WIDTH - 1 downto 0); -- bytes
    awprot   : out   std_logic_vector(2 downto 0);                 -- always "000"
    wready   : in    std_logic;                                    -- slave takes the word
    wvalid   : out   std_logic;                                    -- word is there
    wword    : out   std_logic_vector(31 downto 0);                -- WDATA
    wstrb    : out   std_logic_vector(3 downto 0);                 -- always "1111"
    bready   : out   std_logic;                                    -- response is taken
    bvalid   : in    std_logic;                                    -- response is there
    bresp    : in    std_logic_vector(1 downto 0);                 -- "00": okay
    arready  : in    std_logic;                                    -- slave takes the address
    arvalid  : out   std_logic;                                    -- read address is there
    araddr   : out   std_logic_vector(ADDRESS_WIDTH - 1 downto 0); -- bytes
    arprot   : out   std_logic_vector(2 downto 0);                 -- always "000"
    rready   : out   std_logic;                                    -- word is taken
    rvalid   : in    std_logic;                                    -- word is there
    rword    : in    std_logic_vector(31 downto 0);                -- RDATA
    rresp    : in    std_logic_vector(1 downto 0)                  -- "00": okay
  );
end entity axi_lite_master;

architecture rtl of axi_lite_master is

  type state_t is record
    busy    : std_logic;
    refused : std_logic; -- this access is answered from here
    owed    : std_logic; -- an access that was given up has not been answered
    awvalid : std_logic;
    wvalid  : std_logic;
    bready  : std_logic;
    arvalid : std_logic;
    rready  : std_logic;
    done    : std_logic;
  end record state_t;

  constant STATE_INIT : state_t := (
    busy    => '0',
    refused => '0',
    owed    => '0',
    awvalid => '0',
    wvalid  => '0',
    bready  => '0',
    arvalid => '0',
    rready  => '0',
    done    => '0'
  );

  constant RESP_SLVERR : std_logic_vector(1 downto 0) := "10";
  constant RESP_DECERR : std_logic_vector(1 downto 0) := "11";

  signal r       : state_t;
  signal outside : std_logic; -- the address lies beyond the bus
  signal crooked : std_logic; -- it is no multiple of 4
  signal place   : std_logic_vector(ADDRESS_WIDTH - 1 downto 0);
  signal timer   : natural range 0 to LIMIT;

begin

  outside <= '0' when unsigned(address(15 downto ADDRESS_WIDTH)) = 0 else
             '1';
  crooked <= '0' when address(1 downto 0) = "00" else
             '1';

  p_access : process (clk) is

    variable v    : state_t;
    variable ends : std_logic; -- the slave answers

  begin

    if rising_edge(clk) then
      v      := r;
      v.done := '0';

      if (r.busy = '0') then
        timer <= 0;

        if (start = '1') then
          v.busy := '1';
          rdata  <= (others => '0');

          if (outside = '1' or crooked = '1' or r.owed = '1') then
            v.refused := '1';
            response  <= RESP_SLVERR;

            if (outside = '1') then
              response <= RESP_DECERR;
            end if;
          else
            place     <= address(ADDRESS_WIDTH - 1 downto 0);
            wword     <= wdata;
            v.awvalid := write;
            v.wvalid  := write;
            v.bready  := write;
            v.arvalid := not write;
            v.rready  := not write;
          end if;
        end if;
      elsif (r.refused = '1') then
        v.refused := '0';
        v.busy    := '0';
        v.done    := '1';
      elsif (timer = LIMIT) then
        v.owed   := '1';
        v.busy   := '0';
        v.done   := '1';
        response <= RESP_SLVERR;
      else
        timer <= timer + 1;
      end if;

      if (awready = '1') then
        v.awvalid := v.awvalid and not r.awvalid;
      end if;

      if (wready = '1') then
        v.wvalid := v.wvalid and not r.wvalid;
      end if;

      if (arready = '1') then
        v.arvalid := v.arvalid and not r.arvalid;
      end if;

      ends := (r.bready and bvalid) or (r.rready and rvalid);

      if (ends = '1') then
        v.bready := '0';
        v.rready := '0';
        v.owed   := '0';

        -- the answer to an access that was given up is dropped
        if (r.owed = '0') then
          v.busy   := '0';
          v.done   := '1';
          response <= bresp;

          if (r.rready = '1') then
            response <= rresp;
            rdata    <= rword;
          end if;
        end if;
      end if;

      if (rst = '1') then
        v := STATE_INIT;
      end if;

      r <= v;
    end if;

  end process p_access;

  done    <= r.done;
  awvalid <= r.awvalid;
  awaddr  <= place;
  awprot  <= "000";
  wvalid  <= r.wvalid;
  wstrb   <= "1111";
  bready  <= r.bready;
  arvalid <= r.arvalid;
  araddr  <= place;
  arprot  <= "000";
  rready  <= r.rready;

end architecture rtl;
