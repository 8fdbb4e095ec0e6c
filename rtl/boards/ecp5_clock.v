// Clock of the core on a board with an ECP5: 75 or 100 MHz from 25, and a second oscillator that watches it.
//
// The one file with a vendor's primitives: EHXPLLL (25 MHz * 3 or 4; its phase detector runs at 25 MHz, its oscillator
// at 600) and OSCG (310 MHz / 128).
// It is Verilog, because GHDL writes texts of generics as numbers, which place and route does not take.
// Any other CORE_MHZ is an error of elaboration: times in clocks would be wrong.
// Latency: locked rises within 15 ms of clock; see clock_monitor for what watches core_clock.
// Licence: Apache-2.0

module board_clock #(
  parameter CORE_MHZ = 75 // MHz, of core_clock: 75 or 100
) (
  input  clock,      // oscillator of the board, 25 MHz
  output core_clock, // CORE_MHZ
  output locked,     // 1: core_clock is as it should be; asynchronous
  output oscillator  // 2.42 MHz within 15 %
);

  generate
    if (CORE_MHZ != 75 && CORE_MHZ != 100)
      $error("board_clock: CORE_MHZ has to be 75 or 100");
  endgenerate

  (* FREQUENCY_PIN_CLKI = "25" *)
  (* ICP_CURRENT = "12" *)
  (* LPF_RESISTOR = "8" *)
  (* MFG_ENABLE_FILTEROPAMP = "1" *)
  (* MFG_GMCREF_SEL = "2" *)
  EHXPLLL #(
    .CLKI_DIV(1),
    .CLKFB_DIV(CORE_MHZ / 25),
    .CLKOP_DIV(600 / CORE_MHZ),
    .CLKOP_CPHASE(300 / CORE_MHZ - 1),
    .CLKOP_FPHASE(0),
    .CLKOP_ENABLE("ENABLED"),
    .FEEDBK_PATH("CLKOP"),
    .INTFB_WAKE("DISABLED"),
    .STDBY_ENABLE("DISABLED"),
    .DPHASE_SOURCE("DISABLED"),
    .PLLRST_ENA("DISABLED"),
    .OUTDIVIDER_MUXA("DIVA")
  ) pll (
    .CLKI(clock),
    .CLKFB(core_clock),
    .CLKOP(core_clock),
    .LOCK(locked),
    .RST(1'b0),
    .STDBY(1'b0),
    .PHASESEL0(1'b0),
    .PHASESEL1(1'b0),
    .PHASEDIR(1'b0),
    .PHASESTEP(1'b0),
    .PHASELOADREG(1'b0),
    .PLLWAKESYNC(1'b0),
    .ENCLKOP(1'b0)
  );

  OSCG #(.DIV(128)) second (.OSC(oscillator));

endmodule
