// board_clock of the virtual board: the core's clock is the oscillator's, always locked, and the second oscillator has
// 2.5 MHz (see rtl/boards/ecp5_clock.v for the real one).
// Licence: Apache-2.0

module board_clock #(
  parameter CORE_MHZ = 75 // MHz, of core_clock: 75 or 100
) (
  input      clock,      // what the simulation drives, once per clock of the core
  output     core_clock, // clock
  output     locked,     // 1
  output reg oscillator  // clock / (CORE_MHZ / 2.5)
);

  reg [4:0] count;

  assign core_clock = clock;
  assign locked = 1'b1;

  always @(posedge clock)
    if (count >= CORE_MHZ / 5 - 1) begin
      count <= 5'd0;
      oscillator <= ~oscillator;
    end else
      count <= count + 5'd1;

endmodule
