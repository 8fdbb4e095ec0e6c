// Proof that frame_receiver accepts a frame only with the right length and CRC-32, and keeps it until it is released.
//
// Beside the receiver stand, for each link, the bytes that the stuffing leaves: their number, their length byte, and
// their CRC-32, a bit at a time. `plain` and `store` of the receiver are these bytes.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input turn, input [1:0] valid, input [7:0] data_0, input [7:0] data_1, input [1:0] broken,
  input [1:0] ended, input link, input [5:0] address, input [1:0] served
);

  localparam [6:0] MAX_FRAME = 42, OVERHEAD = 10;
  localparam [31:0] RESIDUE = 32'hDEBB20E3, POLYNOMIAL = 32'hEDB88320;

  wire [1:0] pending, rejected;
  wire [7:0] content;
  wire [3:0] outcome;

  frame_receiver i_dut (
    .clk(clk), .rst(rst), .turn(turn), .valid(valid), .data_0(data_0), .data_1(data_1), .broken(broken),
    .ended(ended), .pending(pending), .link(link), .address(address), .content(content), .served(served),
    .rejected(rejected), .outcome(outcome)
  );

  // states: that of the link in turn, that of the other
  (* inside = "i_dut.r" *) wire [59:0] r;
  (* inside = "i_dut.other" *) wire [59:0] other;
  (* inside = "i_dut.facts" *) wire [5:0] known;
  (* inside = "i_dut.come" *) wire [1:0] come;
  (* inside = "i_dut.added" *) wire [31:0] added;
  (* inside = "i_dut.byte_in" *) wire byte_in;
  (* inside = "i_dut.zero" *) wire zero;
  (* inside = "i_dut.loss" *) wire loss;
  (* inside = "i_dut.stop" *) wire stop;
  (* inside = "i_dut.busy" *) wire busy;
  (* inside = "i_dut.plain" *) wire [7:0] plain;
  (* inside = "i_dut.store" *) wire store;
  (* inside = "i_dut.keep" *) wire keep;

  // the CRC after one more byte
  function [31:0] crc_next(input [31:0] crc, input [7:0] data);
    integer k;
    begin
      crc_next = crc ^ data;
      for (k = 0; k < 8; k = k + 1) crc_next = crc_next[0] ? (crc_next >> 1) ^ POLYNOMIAL : crc_next >> 1;
    end
  endfunction

  reg turned;
  wire assume_turns = turn != turned;
  always @(posedge clk) turned <= turn;

  // registers of the link in turn
  wire fact_byte_in = byte_in == come[turn];
  wire fact_one_thing = !(byte_in && loss) && !(byte_in && stop) && !(loss && stop);
  wire fact_busy_in_turn = busy == pending[turn];

  genvar x;
  generate
    for (x = 0; x < 2; x = x + 1) begin : of_link
      wire now = turn == x;
      wire [59:0] s = now ? r : other;
      wire inside = s[0], line = s[23], over = s[24], blocked = s[26], adds = s[59];
      wire [7:0] left = s[8:1], length = s[22:15];
      wire [5:0] size = s[14:9];
      wire [31:0] crc = s[58:27];

      // a byte in every fourth clock at most
      reg [2:0] since;  // clocks since the last one, up to 4
      wire assume_rate = !valid[x] || since == 4;

      // the frame that comes in
      reg under_way, lost, stored_all;
      reg [6:0] count;      // bytes, up to MAX_FRAME + 1
      reg [7:0] announced;  // the length byte
      reg [31:0] check;
      wire ends = now && under_way && ((byte_in && zero) || (stop && !loss && !byte_in));
      wire good = byte_in && zero && under_way && !lost && left == 0 && check == RESIDUE && count <= MAX_FRAME
                  && count >= OVERHEAD && count == announced + OVERHEAD && stored_all;

      reg seen, ended_last, good_last, pending_last;
      always @(posedge clk) begin
        seen <= !rst;
        since <= rst ? 4 : valid[x] ? 1 : since == 4 ? 4 : since + 1;
        ended_last <= ends;
        good_last <= ends && good;
        pending_last <= pending[x] && !served[x];
        if (now && store) begin
          check <= crc_next(check, plain);
          count <= count > MAX_FRAME ? count : count + 1;
          if (count == 1) announced <= plain;
          if (!keep) stored_all <= 0;
        end
        if (now && loss) begin
          under_way <= 1;
          lost <= 1;
        end
        if (now && byte_in && !zero) under_way <= 1;
        if (rst || ends || (now && !under_way && !(loss || (byte_in && !zero)))) begin
          under_way <= 0;
          lost <= 0;
          count <= 0;
          announced <= 0;
          check <= 32'hFFFFFFFF;
          stored_all <= 1;
        end
      end

      wire fact_since = since >= 1 && since <= 4;
      wire fact_come = !come[x] || since == 1 || (now && since == 2);
      wire fact_adds = !adds || (now ? since >= 3 : since == 2 || since == 3);
      wire fact_inside = inside == under_way && (inside || s[59:1] == {1'b0, 32'hFFFFFFFF, 26'b0});
      wire fact_lost = line == lost;
      wire fact_size = size == (count > MAX_FRAME ? MAX_FRAME : count) && over == (count > MAX_FRAME);
      wire fact_length = length == announced;
      wire fact_stored = stored_all || blocked || over;
      wire fact_busy = !(pending[x] && under_way) || blocked || lost;
      wire fact_crc = check == (adds && !now ? (crc >> 8) ^ added : crc);
      // the sum of a length byte beyond 245 wraps; such a frame is short
      wire [7:0] whole = length + OVERHEAD;
      wire fact_known = !now || (known[0] == (left == 0) && known[1] == (size == MAX_FRAME) && known[2] == (size < OVERHEAD)
                        && known[3] == (whole != size) && (adds || known[4] == (crc == RESIDUE)));

      wire prove_accepted_frames_are_sound = !(seen && pending[x] && !pending_last) || good_last;
      wire prove_every_frame_has_one_outcome = !seen || ended_last == ((pending[x] && !pending_last) != rejected[x]);
      wire prove_no_outcome_without_a_frame = !seen || ended_last || !(rejected[x] || (pending[x] && !pending_last));
      wire prove_a_waiting_frame_stays = !(keep && now && pending[x]);
      wire prove_a_frame_waits_until_served = !(seen && pending_last) || pending[x];
    end
  endgenerate

endmodule
