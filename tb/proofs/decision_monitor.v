// Proof that the clocks of a decision are counted without anything depending on it but their number when it ends, so
// that many clocks are one addition (model/directmpc/native/design.cpp).
//
// Licence: Apache-2.0

module proof (
  input clk, input rst, input clear, input start, input valid
);

  wire [15:0] last, worst;
  wire [31:0] decisions;

  decision_monitor i_dut (
    .clk(clk), .rst(rst), .clear(clear), .start(start), .valid(valid), .last(last), .worst(worst), .decisions(decisions)
  );

  (* inside = "i_dut.cycles" *) wire [15:0] cycles;

  reg counted; // in the clock before no decision began or ended, and the count was below its most
  reg still;   // in the clock before none ended, and nothing was cleared
  reg [15:0] was;
  reg [63:0] shown;

  always @(posedge clk) begin
    counted <= !rst && !start && cycles != 16'hffff;
    still <= !rst && !clear && !valid;
    was <= cycles;
    shown <= {last, worst, decisions};
  end

  wire prove_a_clock_is_one_addition = !counted || cycles == was + 16'd1;
  wire prove_the_count_reaches_nothing_else = !still || {last, worst, decisions} == shown;

endmodule
