// Proof that shadows stay as they were while a commit waits. It waits in the clock of load, too: no_commit_is_lost of
// decision_sequencer. That the guard works with the settings of its registers is proven on the systems.
//
// Licence: Apache-2.0

module proof (
  input clk, input rst, input [9:0] address, input whole, input [15:0] word, input passed, input enabled, input commit,
  input pending, input load
);

  wire hold, refuse;

  write_rules i_dut (
    .clk(clk), .rst(rst), .address(address), .whole(whole), .word(word), .passed(passed), .enabled(enabled), .commit(commit),
    .pending(pending), .load(load), .hold(hold), .refuse(refuse)
  );

  (* inside = "i_dut.of_shadows" *) wire of_shadows;

  // write_gate lets no write through that is held or refused
  wire assume_gate = !passed || !(hold || refuse);

  wire prove_shadows_stay_while_a_commit_waits = !(passed && of_shadows && pending);
  // MPDCC's, three words from 0x184 on
  wire bound = address[9:4] == 6'b011000 && address[3:2] != 0;
  wire prove_no_bound_beyond_its_limit = !(passed && bound && word > 29000);
  wire prove_whole_words = !(passed && !whole);

endmodule
