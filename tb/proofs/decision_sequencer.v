// Proof that the values in force change between two decisions only, and that every commit takes effect once.
//
// Licence: Apache-2.0

module proof (
  input clk, input rst, input start, input command_start, input from_registers, input use_observer,
  input own_positions, input reset_observer, input commit, input ending
);

  wire take, go, deciding, ignored, observing, owning, forget, load, pending;
  wire [15:0] commits;

  decision_sequencer i_dut (
    .clk(clk), .rst(rst), .start(start), .command_start(command_start), .from_registers(from_registers),
    .use_observer(use_observer), .own_positions(own_positions), .reset_observer(reset_observer), .commit(commit),
    .ending(ending), .take(take), .go(go), .deciding(deciding), .ignored(ignored), .observing(observing),
    .owning(owning), .forget(forget), .load(load), .pending(pending), .commits(commits)
  );

  // ending is the clock of valid: a decision is under way, and ends once
  wire assume_ends_once = !ending || deciding;

  reg seen;              // there has been a reset, and a clock after it
  reg begun;             // a decision has begun, or is under way, after this edge
  reg owed;              // a commit has been asked for and has not taken effect
  reg was_load, was_go, was_deciding, was_ending, was_observing, was_owning;
  reg [15:0] loads;
  wire begins = !deciding && (from_registers ? command_start : start);

  always @(posedge clk) begin
    seen <= !rst;
    begun <= !rst && (begins || (begun && !ending));
    owed <= rst || commit || (owed && !load);
    loads <= rst ? 0 : loads + load;
    was_load <= load;
    was_go <= go;
    was_deciding <= deciding && !rst;
    was_ending <= ending;
    was_observing <= observing;
    was_owning <= owning;
  end

  wire fact_begun = begun == deciding;
  wire fact_owed = pending == owed;

  // the edge of load changes the values; a decision reads them from the clock after its start on
  wire prove_no_change_under_a_decision = !load || !deciding || ending;
  wire prove_no_change_with_a_start = !load || !begins;
  wire prove_no_commit_is_lost = pending == owed && (!load || owed);
  wire prove_no_commit_waits_idle = !(owed && !deciding && !start && !command_start) || load;
  wire prove_every_load_is_counted = commits == loads;
  wire prove_choices_stay = !(seen && deciding && was_deciding) || (observing == was_observing && owning == was_owning);
  wire prove_no_start_is_lost = !(begins && !rst) || !ignored || (from_registers ? start : command_start);
  wire prove_one_start_a_decision = !go || (deciding && !was_deciding) || !seen;

endmodule
