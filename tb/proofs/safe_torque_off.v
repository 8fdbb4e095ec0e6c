// Proof that safe_torque_off permits with both channels alone, tolerates test pulses, and latches a difference.
//
// A level is a channel behind its two flip-flops.
//
// FILTER, DISCREPANCY: as safe_torque_off's.
// Licence: Apache-2.0

module proof (input clk, input rst, input [1:0] channels, input clear);

  localparam W = `FILTER < 2 ? 1 : $clog2(`FILTER);  // bits of a count of the filter
  localparam V = $clog2(`DISCREPANCY);
  localparam TOP = 4 + 2 * W + V;

  wire permit, fault;

  safe_torque_off i_dut (.clk(clk), .rst(rst), .channels(channels), .clear(clear), .permit(permit), .fault(fault));

  (* inside = "i_dut.level" *) wire [1:0] level;
  (* inside = "i_dut.r" *) wire [TOP:0] r;
  wire [1:0] counted = r[1:0];
  wire rested = r[2], permitted = r[3], latched = r[4];
  wire [W-1:0] other_0 = r[5+W +: W], other_1 = r[5 +: W];
  wire [V-1:0] apart = r[TOP -: V];

  // clocks that a level has been as it is, up to the one before this, as far as they matter
  reg [24:0] off_0, off_1, on_0, on_1, alone_0, alone_1;
  reg was_permit, was_fault, was_clear, sure, both_off;
  reg [1:0] was_counted;

  function [24:0] more(input [24:0] count, input again);
    more = !again ? 0 : count < `FILTER + `DISCREPANCY ? count + 25'd1 : count;
  endfunction

  always @(posedge clk) begin
    sure <= !rst;
    was_permit <= permit;
    was_fault <= fault;
    was_clear <= clear;
    was_counted <= counted;
    off_0 <= rst ? `FILTER : more(off_0, !level[0]);
    off_1 <= rst ? `FILTER : more(off_1, !level[1]);
    on_0 <= rst ? 0 : more(on_0, level[0]);
    on_1 <= rst ? 0 : more(on_1, level[1]);
    alone_0 <= rst ? 0 : more(alone_0, level == 2'b01);
    alone_1 <= rst ? 0 : more(alone_1, level == 2'b10);
    // both have been off since permit was up
    both_off <= rst || counted == 0 || (both_off && !permit);
  end

  wire fact_other = other_0 < `FILTER && other_1 < `FILTER && apart < `DISCREPANCY;
  wire fact_count_0 = counted[0] ? other_0 == off_0 : other_0 == on_0;
  wire fact_count_1 = counted[1] ? other_1 == off_1 : other_1 == on_1;
  wire fact_alone_0 = alone_0 <= on_0 && alone_0 <= off_1;
  wire fact_alone_1 = alone_1 <= on_1 && alone_1 <= off_0;
  wire fact_apart_0 = alone_0 < `FILTER || (counted == 2'b01 && (latched || apart >= alone_0 - `FILTER));
  wire fact_apart_1 = alone_1 < `FILTER || (counted == 2'b10 && (latched || apart >= alone_1 - `FILTER));
  wire fact_permit = permitted == (counted == 2'b11 && rested && !latched);
  wire fact_rested = !rested || both_off || permitted || counted == 0 || latched;

  wire prove_off_in_time = !permit || (off_0 < `FILTER && off_1 < `FILTER);
  wire prove_a_test_pulse_does_nothing = !(sure && was_permit && off_0 < `FILTER && off_1 < `FILTER) || permit;
  wire prove_both_were_off_before = !(sure && permit && !was_permit) || both_off;
  wire prove_a_difference_is_a_fault = (alone_0 < `FILTER + `DISCREPANCY && alone_1 < `FILTER + `DISCREPANCY) || fault;
  wire prove_a_fault_stays = !(sure && was_fault && !fault) || (was_clear && was_counted == 0);
  wire prove_no_permit_with_a_fault = !(permit && fault);

endmodule
