// Proof that the gate guard's settings in force are those of its registers whenever the gates may be on, and that
// shadows stay as they were while a commit waits. It waits in the clock of load, too: no_commit_is_lost of
// decision_sequencer.
//
// Licence: Apache-2.0

module proof (
  input clk, input rst, input [9:0] address, input whole, input sets, input passed, input enabled, input commit,
  input pending, input load
);

  wire hold, refuse;

  write_rules i_dut (
    .clk(clk), .rst(rst), .address(address), .whole(whole), .sets(sets), .passed(passed), .enabled(enabled), .commit(commit),
    .pending(pending), .load(load), .hold(hold), .refuse(refuse)
  );

  (* inside = "i_dut.of_guard" *) wire of_guard;
  (* inside = "i_dut.of_shadows" *) wire of_shadows;
  (* inside = "i_dut.enables" *) wire enables;
  (* inside = "i_dut.uncommitted" *) wire uncommitted;

  reg differs;     // a setting of the guard has been written that is not in force
  reg may_enable;  // enable has been up, or has been written in the clock before

  // write_gate lets no write through that is held or refused; enable rises by a write of it alone
  wire assume_gate = !passed || !(hold || refuse);
  wire assume_enable = !enabled || may_enable;

  always @(posedge clk) begin
    differs <= !rst && ((passed && of_guard) || (differs && !load));
    may_enable <= !rst && (enabled || (passed && enables));
  end

  wire fact_same = differs == uncommitted;
  wire fact_locked = !(may_enable && differs);

  wire prove_settings_in_force_while_enabled = !(enabled && differs);
  wire prove_settings_are_locked = !(passed && of_guard && enabled);
  wire prove_shadows_stay_while_a_commit_waits = !(passed && of_shadows && pending);
  wire prove_whole_words = !(passed && !whole);

endmodule
