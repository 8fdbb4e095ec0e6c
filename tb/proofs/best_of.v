// Proof that best_of keeps the best of all candidates since the last result.
//
// One candidate is watched: any one, it never changes and nothing is known of it.
//
// SECOND_LEVEL: as best_of's.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input dead_valid, input [30:0] dead_rank, input [5:0] dead_index, input costed_feasible,
  input costed_saturated, input [4:0] costed_effort, input [5:0] costed_length, input [30:0] costed_cost,
  input [5:0] index, input reached_second, input [5:0] reached_lead, input [5:0] reached_length,
  input reached_saturated, input settled, input last, input result_ready,
  input [30:0] watched_rank, input [5:0] watched_index
);

  wire result_valid, waiting;
  wire result_feasible, result_saturated;
  wire [5:0] result_index, result_length;
  wire [30:0] result_rank;

  best_of i_dut (
    .clk(clk), .rst(rst), .dead_valid(dead_valid), .dead_rank(dead_rank), .dead_index(dead_index),
    .costed_feasible(costed_feasible), .costed_saturated(costed_saturated), .costed_effort(costed_effort),
    .costed_length(costed_length), .costed_cost(costed_cost), .index(index), .reached_second(reached_second),
    .reached_lead(reached_lead), .reached_length(reached_length), .reached_saturated(reached_saturated),
    .settled(settled), .last(last), .result_ready(result_ready), .result_valid(result_valid),
    .result_feasible(result_feasible), .result_saturated(result_saturated), .result_index(result_index),
    .result_length(result_length), .result_rank(result_rank), .waiting(waiting)
  );

  reg [36:0] watched_last;
  wire assume_the_same_is_watched = {watched_rank, watched_index} == watched_last;

  // since the last result: one came, one with a length came, their last places
  reg some, some_costed;
  reg [5:0] dead_last, costed_last;
  reg met, met_costed;  // the one that is watched came, with a length

  wire assume_settled = !(settled && (dead_valid || costed_feasible));
  wire assume_order = `SECOND_LEVEL || ((!dead_valid || !some || dead_index > dead_last)
                                        && (!costed_feasible || !some_costed || index > costed_last));

  wire taken = result_valid && result_ready;

  always @(posedge clk) begin
    watched_last <= {watched_rank, watched_index};
    if (dead_valid) begin
      some <= 1;
      dead_last <= dead_index;
      if (dead_rank == watched_rank && dead_index == watched_index) met <= 1;
    end
    if (costed_feasible) begin
      some_costed <= 1;
      costed_last <= index;
      if (costed_cost == watched_rank && index == watched_index) met_costed <= 1;
    end
    if (rst || taken) begin
      some <= 0;
      some_costed <= 0;
      met <= 0;
      met_costed <= 0;
    end
  end

  wire [36:0] watched = {watched_rank, watched_index};
  wire [36:0] best = {result_rank, result_index};

  wire fact_some = some == waiting;
  wire fact_feasible = some_costed == result_feasible;
  wire fact_met = (!met || some) && (!met_costed || some_costed);
  wire fact_last = `SECOND_LEVEL || !some_costed || result_index <= costed_last;
  wire fact_last_dead = `SECOND_LEVEL || !some || some_costed || result_index <= dead_last;

  wire prove_least_cost = !met_costed || (result_feasible && best <= watched);
  wire prove_least_excess = !met || result_feasible
                            || (`SECOND_LEVEL ? result_rank <= watched_rank : best <= watched);
  wire prove_one_of_them = !((waiting || result_feasible) && best == watched) || (result_feasible ? met_costed : met || !some);
  wire prove_result_is_whole = result_valid == (waiting && settled && last);
  wire prove_forgotten = some || !(result_valid || result_feasible) || some_costed;

endmodule
