// Proof that result_collector keeps the best of all results that it has to compare, ties by their place: with one level
// of all that it takes, with two levels of the leaves of the root, and of the feasible ones that come while leaves are
// searched.
//
// One result is watched: any one, it never changes and nothing is known of it.
//
// EXPLORERS, REGISTERED: as result_collector's.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input clear, input [`EXPLORERS-1:0] result_valid, input [45*`EXPLORERS-1:0] results,
  input two_levels, input leaves, input whole, input adopt,
  input [5:0] evaluated_index, input [5:0] evaluated_length, input [30:0] evaluated_cost, input evaluated_saturated,
  input [44:0] watched
);

  localparam N = `EXPLORERS;

  wire [N-1:0] result_ready;
  wire [44:0] best;

  // a result: rank, length, index, saturated, feasible
  result_collector i_dut (
    .clk(clk), .rst(rst), .clear(clear), .result_valid(result_valid), .results(results), .two_levels(two_levels),
    .leaves(leaves), .whole(whole), .evaluated_slope_valid(1'b0), .evaluated_slope_index(6'b0),
    .evaluated_slope(34'b0), .evaluated_unfit(1'b0), .evaluated_valid(1'b0), .evaluated_index(evaluated_index),
    .evaluated_effort(4'b0), .evaluated_length(evaluated_length), .evaluated_cost(evaluated_cost),
    .evaluated_saturated(evaluated_saturated),
    .adopt(adopt), .result_ready(result_ready), .best_feasible(best[0]), .best_saturated(best[1]), .best_index(best[7:2]),
    .best_length(best[13:8]), .best_rank(best[44:14])
  );

  (* inside = "i_dut.takes" *) wire taken;
  (* inside = "i_dut.chosen" *) wire [44:0] incoming;
  (* inside = "i_dut.compare" *) wire compare;
  (* inside = "i_dut.arrival" *) wire [44:0] arrival;
  (* inside = "i_dut.any" *) wire any;

  wire leaf = two_levels && whole;  // of the root
  wire offer = two_levels ? whole || (taken && incoming[0] && leaves) : taken;
  wire [44:0] offered =
      leaf ? {evaluated_cost, evaluated_length, evaluated_index, evaluated_saturated, 1'b1} : incoming;

  wire assume_adopted_alone = !(adopt && (compare || clear));

  // feasible ones first, then the smaller rank, then the earlier place
  function [38:0] key(input [44:0] r);
    key = {!r[0], r[44:14], r[7:2], r[1]};
  endfunction

  reg [44:0] watched_last;
  wire assume_the_same_is_watched = watched == watched_last;

  reg begun;     // clear has been up since the reset
  reg on_way;    // it has been taken in the clock before
  reg met;       // it has been compared since clear
  reg some;      // one has been compared since clear
  reg adopted;   // the result of explorer 0 has been adopted since clear
  reg adopts;    // it was in the clock before, and none was known
  reg [44:0] first;
  wire takes_it = offer && offered == watched;
  wire compares_it = `REGISTERED ? on_way : takes_it;

  always @(posedge clk) begin
    watched_last <= watched;
    begun <= !rst && (begun || clear);
    on_way <= !rst && takes_it;
    met <= !clear && (met || compares_it);
    some <= !clear && (some || compare);
    adopted <= !clear && (adopted || adopt);
    adopts <= !rst && begun && adopt && !some;
    first <= results[45*(N-1) +: 45];
  end

  integer i;
  reg [3:0] takers;
  reg right;  // what comes in is the result of the lowest explorer that has one
  always @* begin
    takers = 0;
    right = 1;
    for (i = 0; i < N; i = i + 1) begin
      takers = takers + result_ready[i];
      if (result_ready[i] && (incoming != results[45*(N-1-i) +: 45]
                              || (result_valid & ((1 << i) - 1)) != 0)) right = 0;
    end
  end

  wire fact_on_way = !(`REGISTERED && on_way) || (compare && arrival == watched);
  wire fact_compare = !(`REGISTERED && compare && arrival == watched) || on_way;
  wire fact_some = !begun || some == any;
  wire fact_met = !(begun && met) || any;

  wire prove_one_is_taken = takers == (result_valid != 0) && taken == (result_valid != 0)
                            && (result_ready & ~result_valid) == 0 && right;
  wire prove_best_is_least = !(begun && met) || key(best) <= key(watched);
  wire prove_best_is_one_of_them = !(begun && some && best == watched) || met;
  wire prove_nothing_without_results = !(begun && !some && !adopted) || !best[0];
  wire prove_the_first_is_adopted = !adopts || best == first;

endmodule
