// Proof that nothing but the count itself moves while a countdown runs, so that many of its clocks are one subtraction
// (model/directmpc/native/design.cpp).
//
// Licence: Apache-2.0

module proof (
  input clk, input rst, input load, input [11:0] clocks
);

  wire over;

  countdown i_dut (.clk(clk), .load(load), .clocks(clocks), .over(over));

  (* inside = "i_dut.left" *) wire [11:0] left;

  reg counted; // in the clock before the count was neither loaded nor over, nor at its last place
  reg stood;   // in the clock before it was over and not loaded
  reg [11:0] was;

  always @(posedge clk) begin
    counted <= !rst && !load && !over && left != 1;
    stood <= !rst && !load && over;
    was <= left;
  end

  wire prove_a_clock_is_one_subtraction = !counted || (left == was - 12'd1 && !over);
  wire prove_what_is_over_stands = !stood || (left == was && over);

endmodule
