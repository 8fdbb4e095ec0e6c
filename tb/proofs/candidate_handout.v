// Proof that candidate_handout loses, doubles and reorders no candidate, for any explorers that are free.
//
// candidate_enumerator, which is inside, has a proof of its own: what it gives is complete and in order.
//
// EXPLORERS, BLOCKS: as candidate_handout's.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input [8:0] previous, input [2:0] negative, input probing, input probe, input enumerate,
  input searching, input one_explorer, input [`EXPLORERS-1:0] ready
);

  wire [`EXPLORERS-1:0] valid;
  wire candidate_probe, done;
  wire [5:0] candidate_index;
  wire [8:0] candidate_position;
  wire [3:0] candidate_effort;

  candidate_handout i_dut (
    .clk(clk), .rst(rst), .previous(previous), .negative(negative), .probing(probing), .probe(probe),
    .enumerate(enumerate), .searching(searching), .one_explorer(one_explorer), .ready(ready), .valid(valid),
    .candidate_probe(candidate_probe), .candidate_index(candidate_index), .candidate_position(candidate_position),
    .candidate_effort(candidate_effort), .done(done)
  );

  (* inside = "i_dut.enumerate_valid" *) wire enumerated;
  (* inside = "i_dut.enumerate_ready" *) wire consumed;
  (* inside = "i_dut.i_enumerator_candidate_index" *) wire [5:0] index;
  (* inside = "i_dut.i_enumerator_candidate_position" *) wire [8:0] position;
  (* inside = "i_dut.i_enumerator_candidate_probe" *) wire marked;
  (* inside = "i_dut.i_enumerator_candidate_effort" *) wire [3:0] effort;

  wire assume_one_thing = !(probe && searching) && (!probe || probing) && !(searching && probing);

  integer i;
  reg [3:0] takers;
  reg lower_free;  // a free explorer has a lower number than the one that takes
  always @* begin
    takers = 0;
    lower_free = 0;
    for (i = 0; i < `EXPLORERS; i = i + 1) begin
      takers = takers + valid[i];
      if (valid[i] && (ready & ((1 << i) - 1)) != 0) lower_free = 1;
    end
  end

  wire free = one_explorer ? ready[0] : ready != 0;

  wire fact_unmarked = !enumerated || !marked;

  wire prove_to_one_that_is_free = !searching || (takers <= 1 && (valid & ~ready) == 0 && !lower_free);
  wire prove_none_lost_or_doubled = (enumerated && consumed) == (searching && takers == 1);
  wire prove_none_waits_for_a_free_one = !(searching && enumerated && free) || takers == 1;
  wire prove_as_enumerated = !(searching && takers == 1) || (candidate_index == index && candidate_position == position
                             && candidate_effort == effort && !candidate_probe);
  wire prove_to_the_first_alone = !(searching && one_explorer) || (valid >> 1) == 0;
  wire prove_probe = !probe || (valid == 1 && candidate_probe && candidate_position == previous);

endmodule
