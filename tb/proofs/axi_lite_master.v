// Proof that axi_lite_master keeps the rules of AXI4-Lite, and ends every access in time.
//
// Licence: Apache-2.0

module proof (
  input clk, input rst, input start, input write, input [15:0] address, input [31:0] wdata,
  input awready, input wready, input bvalid, input [1:0] bresp,
  input arready, input rvalid, input [31:0] rword, input [1:0] rresp
);

  localparam [8:0] LIMIT = `LIMIT;

  wire done, awvalid, wvalid, bready, arvalid, rready;
  wire [31:0] rdata, wword;
  wire [1:0] response;
  wire [`ADDRESS_WIDTH-1:0] awaddr, araddr;
  wire [2:0] awprot, arprot;
  wire [3:0] wstrb;

  axi_lite_master i_dut (
    .clk(clk), .rst(rst), .start(start), .write(write), .address(address), .wdata(wdata), .awready(awready),
    .wready(wready), .bvalid(bvalid), .bresp(bresp), .arready(arready), .rvalid(rvalid), .rword(rword),
    .rresp(rresp), .done(done), .rdata(rdata), .response(response), .awvalid(awvalid), .awaddr(awaddr),
    .awprot(awprot), .wvalid(wvalid), .wword(wword), .wstrb(wstrb), .bready(bready), .arvalid(arvalid),
    .araddr(araddr), .arprot(arprot), .rready(rready)
  );

  (* inside = "i_dut.r" *) wire [8:0] r;
  (* inside = "i_dut.timer" *) wire [7:0] timer;
  wire busy = r[0], refused = r[1], owed = r[2];

  // a slave answers what it has taken: once, and a write only after address and word
  wire assume_write_answer = !bvalid || (w_taken && aw_taken);
  wire assume_read_answer = !rvalid || ar_taken;

  reg seen;                       // there has been a reset, and a clock after it
  reg aw_taken, w_taken, ar_taken;  // and not been answered
  reg was_aw, was_w, was_ar, was_b, was_r, was_done;
  reg [`ADDRESS_WIDTH-1:0] was_awaddr, was_araddr;
  reg [31:0] was_word;
  reg [8:0] clocks;               // of the access under way
  reg fine;                       // this access may reach the bus
  reg answered, was_answered;     // the slave has answered it with okay

  wire b = bready && bvalid;
  wire d = rready && rvalid;

  always @(posedge clk) begin
    seen <= !rst;
    aw_taken <= !rst && !b && (aw_taken || (awvalid && awready));
    w_taken <= !rst && !b && (w_taken || (wvalid && wready));
    ar_taken <= !rst && !d && (ar_taken || (arvalid && arready));
    was_aw <= awvalid && !awready;
    was_w <= wvalid && !wready;
    was_ar <= arvalid && !arready;
    was_b <= bready && !bvalid;
    was_r <= rready && !rvalid;
    was_awaddr <= awaddr;
    was_araddr <= araddr;
    was_word <= wword;
    was_done <= done && !rst;
    clocks <= busy ? clocks + 1 : 0;
    answered <= !owed && ((b && bresp == 0) || (d && rresp == 0));
    if (start && !busy) fine <= address[1:0] == 0 && address[15:`ADDRESS_WIDTH] == 0 && !owed;
  end

  wire fact_kinds = !(bready && rready) && !(awvalid && !bready) && !(wvalid && !bready) && !(arvalid && !rready);
  wire fact_aw = !bready || aw_taken == !awvalid;
  wire fact_w = !bready || w_taken == !wvalid;
  wire fact_ar = !rready || ar_taken == !arvalid;
  wire fact_none = (bready || !(aw_taken || w_taken)) && (rready || !ar_taken);
  wire fact_states = (!refused || (busy && !done)) && (!done || !busy) && !(owed && busy && !refused);
  wire fact_open = (owed || (busy && !refused)) == (bready || rready);
  wire fact_fine = !busy || (refused ? !fine : fine);
  wire fact_timer = !(busy && !refused) || (timer == clocks && clocks <= LIMIT);
  wire fact_refused = !refused || clocks == 0;
  wire fact_response = !refused || response[1];

  wire prove_valid_stays = !seen || ((!was_aw || awvalid) && (!was_w || wvalid) && (!was_ar || arvalid));
  wire prove_address_and_word_stay = !seen || ((!was_aw || awaddr == was_awaddr) && (!was_w || wword == was_word)
                                               && (!was_ar || araddr == was_araddr));
  wire prove_ready_stays = !seen || ((!was_b || bready) && (!was_r || rready));
  wire prove_one_at_a_time = !(bready && rready) && (!awvalid || !aw_taken) && (!wvalid || !w_taken)
                             && (!arvalid || !ar_taken);
  wire prove_whole_words = wstrb == 15 && (!(awvalid || arvalid) || awaddr[1:0] == 0) && awaddr == araddr
                           && awprot == 0 && arprot == 0;
  wire prove_wrong_addresses_stay_inside = !(busy && !fine) || refused;
  wire prove_okay_is_the_slaves = !(seen && done && response == 0) || answered;
  wire prove_in_time = !busy || clocks <= LIMIT;
  wire prove_done_once = !(done && was_done && seen);

endmodule
