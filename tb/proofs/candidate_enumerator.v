// Proof that candidate_enumerator gives every candidate once, in order, from any position, for any delay of its user.
//
// BLOCKS: as candidate_enumerator's.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input start, input [8:0] previous, input [2:0] negative, input ready
);

  wire valid, done, candidate_probe;
  wire [5:0] candidate_index;
  wire [8:0] candidate_position;
  wire [3:0] candidate_effort;

  candidate_enumerator i_dut (
    .clk(clk), .rst(rst), .start(start), .previous(previous), .negative(negative), .ready(ready), .valid(valid),
    .candidate_probe(candidate_probe), .candidate_index(candidate_index), .candidate_position(candidate_position),
    .candidate_effort(candidate_effort), .done(done)
  );

  // its registers: the candidate that comes after the one that is shown
  (* inside = "i_dut.r" *) wire [27:0] r;
  wire running = r[0];
  wire [1:0] choice_a = r[6:5], choice_b = r[4:3], choice_c = r[2:1];

  // phase a is the first element, which stands on the left
  wire [2:0] from_a = previous[8:6], from_b = previous[5:3], from_c = previous[2:0];

  `include "switch_graph.vh"

  // what has to come next
  reg begun;               // start, and no reset since
  reg [8:0] previous_kept;
  reg [2:0] negative_kept;
  reg [1:0] a, b, c;       // choices of the next candidate that is taken
  reg all;                 // every one has been taken
  reg had_start;
  wire c_ends = `BLOCKS || c == count(from_c) - 1;
  wire b_ends = b == count(from_b) - 1;
  wire a_ends = a == count(from_a) - 1;
  wire taken = valid && ready;

  always @(posedge clk) begin
    if (taken) begin
      c <= c_ends ? 0 : c + 1;
      if (c_ends) b <= b_ends ? 0 : b + 1;
      if (c_ends && b_ends) a <= a + 1;
      if (c_ends && b_ends && a_ends) all <= 1;
    end
    had_start <= start;
    if (start) begin
      begun <= 1;
      all <= 0;
      a <= 0;
      b <= 0;
      c <= 0;
      previous_kept <= previous;
      negative_kept <= negative;
    end
    if (rst) begun <= 0;
  end

  // they are stable from start on
  wire assume_stable = !begun || start || (previous == previous_kept && negative == negative_kept);

  wire [5:0] now = {a, b, c};
  wire [5:0] after = {choice_a, choice_b, choice_c};
  wire [5:0] successor = {c_ends && b_ends ? a + 2'd1 : a, c_ends ? (b_ends ? 2'd0 : b + 2'd1) : b,
                          c_ends ? 2'd0 : c + 2'd1};
  wire stable = previous == previous_kept && negative == negative_kept;

  wire fact_begun = begun || !(running || valid);
  wire fact_in_range = !(begun && stable && !all) || (a < count(from_a) && b < count(from_b)
                       && (`BLOCKS ? c == 0 : c < count(from_c)));
  wire fact_shown = !(valid && stable) || (!all && candidate_index == now);
  wire fact_waits = !(begun && stable && !valid && !all) || (running && after == now);
  wire fact_next = !(valid && stable) || (running ? !(c_ends && b_ends && a_ends) && after == successor
                   : c_ends && b_ends && a_ends);
  wire fact_ended = !(begun && all) || !(running || valid);

  wire prove_in_order = !(valid && stable) || candidate_index == now;
  wire prove_all = !(begun && done) || all;
  wire prove_none_twice = !(begun && valid) || !all;
  wire prove_positions = !(valid && stable) || candidate_position == {next(from_a, a), next(from_b, b), next(from_c, c)};
  wire prove_effort = !(valid && stable) || candidate_effort == effort(from_a, next(from_a, a))
                      + effort(from_b, next(from_b, b)) + (`BLOCKS ? 0 : effort(from_c, next(from_c, c)));
  wire prove_no_probe = !valid || !candidate_probe;
  wire prove_one_a_clock = !(begun && !had_start && !all) || valid;

endmodule
