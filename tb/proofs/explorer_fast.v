// Proof that explorer_fast evaluates every candidate of a block once, and is busy as long as one is under way.
//
// One candidate is watched: any one, by the numbers of its positions among those that follow.
//
// SECOND_LEVEL, INWARDS: as explorer_fast's.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input [15:0] limits_bound_current, input [15:0] limits_bound_neutral,
  input [15:0] limits_bound_phase, input [5:0] limits_horizon, input [1:0] limits_weight_scale,
  input limits_deadlock_rule, input limits_outside_inwards, input [167:0] node_error, input [71:0] node_slope,
  input [19:0] node_forced_link, input [19:0] node_forced_neutral, input [59:0] node_forced_phase,
  input [47:0] node_phase_current, input [47:0] node_neutral_current, input [17:0] node_weight_start,
  input [53:0] node_weight_slope, input [32:0] node_curvature, input [47:0] band_first, input [53:0] band_margin_up,
  input [53:0] band_margin_down, input [2:0] band_outside, input [47:0] band_limit, input [56:0] band_turn,
  input [8:0] band_previous, input [2:0] band_negative, input capacitor_write, input [4:0] capacitor_row,
  input [5:0] capacitor_length, input [23:0] capacitor_excess, input capacitor_bank, input capacitor_is_inside,
  input last, input candidate_valid, input candidate_probe, input [5:0] candidate_index,
  input [8:0] candidate_position, input [3:0] candidate_effort, input result_ready, input leaf_valid,
  input [8:0] leaf_position, input [4:0] leaf_effort, input leaf_bank, input [5:0] leaf_index, input reached_second,
  input [5:0] reached_lead, input [5:0] reached_length, input reached_saturated, input [3:0] of_ab, input [1:0] of_c
);

  wire candidate_ready; wire probe_done; wire probe_held; wire result_valid; wire result_feasible;
  wire result_saturated; wire [5:0] result_index; wire [5:0] result_length; wire [30:0] result_rank; wire busy;
  wire evaluated_slope_valid; wire [5:0] evaluated_slope_index; wire [33:0] evaluated_slope; wire evaluated_unfit;
  wire evaluated_valid; wire [5:0] evaluated_index; wire [3:0] evaluated_effort; wire [5:0] evaluated_length;
  wire [30:0] evaluated_cost; wire evaluated_saturated;

  explorer_fast i_dut (
    .clk(clk), .rst(rst), .limits_bound_current(limits_bound_current), .limits_bound_neutral(limits_bound_neutral),
    .limits_bound_phase(limits_bound_phase), .limits_horizon(limits_horizon),
    .limits_weight_scale(limits_weight_scale), .limits_deadlock_rule(limits_deadlock_rule),
    .limits_outside_inwards(limits_outside_inwards), .node_error(node_error), .node_slope(node_slope),
    .node_forced_link(node_forced_link), .node_forced_neutral(node_forced_neutral),
    .node_forced_phase(node_forced_phase), .node_phase_current(node_phase_current),
    .node_neutral_current(node_neutral_current), .node_weight_start(node_weight_start),
    .node_weight_slope(node_weight_slope), .node_curvature(node_curvature), .band_first(band_first),
    .band_margin_up(band_margin_up), .band_margin_down(band_margin_down), .band_outside(band_outside),
    .band_limit(band_limit), .band_turn(band_turn), .band_previous(band_previous), .band_negative(band_negative),
    .capacitor_write(capacitor_write), .capacitor_row(capacitor_row), .capacitor_length(capacitor_length),
    .capacitor_excess(capacitor_excess), .capacitor_bank(capacitor_bank), .capacitor_is_inside(capacitor_is_inside),
    .last(last), .candidate_valid(candidate_valid), .candidate_probe(candidate_probe),
    .candidate_index(candidate_index), .candidate_position(candidate_position), .candidate_effort(candidate_effort),
    .result_ready(result_ready), .leaf_valid(leaf_valid), .leaf_position(leaf_position), .leaf_effort(leaf_effort),
    .leaf_bank(leaf_bank), .leaf_index(leaf_index), .reached_second(reached_second), .reached_lead(reached_lead),
    .reached_length(reached_length), .reached_saturated(reached_saturated), .candidate_ready(candidate_ready),
    .probe_done(probe_done), .probe_held(probe_held), .result_valid(result_valid), .result_feasible(result_feasible),
    .result_saturated(result_saturated), .result_index(result_index), .result_length(result_length),
    .result_rank(result_rank), .busy(busy), .evaluated_slope_valid(evaluated_slope_valid),
    .evaluated_slope_index(evaluated_slope_index), .evaluated_slope(evaluated_slope),
    .evaluated_unfit(evaluated_unfit), .evaluated_valid(evaluated_valid), .evaluated_index(evaluated_index),
    .evaluated_effort(evaluated_effort), .evaluated_length(evaluated_length), .evaluated_cost(evaluated_cost),
    .evaluated_saturated(evaluated_saturated)
  );

  // a block is probe, index, position, effort, from bit 0 on
  (* inside = "i_dut.queue_valid" *) wire queue_valid;
  (* inside = "i_dut.queue" *) wire [19:0] queue;
  (* inside = "i_dut.block_valid" *) wire block_valid;
  (* inside = "i_dut.block_now" *) wire [19:0] block_now;
  (* inside = "i_dut.choice" *) wire [1:0] choice;
  (* inside = "i_dut.valid" *) wire [16:0] valid;  // stage 0 on the left
  (* inside = "i_dut.index" *) wire [5:0] index;
  (* inside = "i_dut.settled" *) wire settled;
  (* inside = "i_dut.waiting" *) wire waiting;

  `include "switch_graph.vh"

  reg [5:0] of_last;
  reg [8:0] previous_last;
  reg busy_last;
  reg accepted;     // its block has been taken since the last result
  wire assume_the_same_is_watched = {of_ab, of_c} == of_last;
  wire assume_stable = !(busy_last || accepted) || band_previous == previous_last;
  wire assume_leaves = !(leaf_valid && (queue_valid || block_valid || candidate_valid));

  wire take = candidate_valid && candidate_ready;
  wire take_it = take && !candidate_probe && candidate_index[5:2] == of_ab;
  wire goes = block_valid && !block_now[0];
  wire goes_it = goes && {block_now[6:3], choice} == {of_ab, of_c};

  reg [1:0] times;  // how often it went into the pipeline since then
  reg [3:0] age;    // clocks since its block was taken
  reg went, leaf_went, probe_went;
  reg [5:0] index_went;
  wire assume_once = !take_it || !accepted;

  always @(posedge clk) begin
    of_last <= {of_ab, of_c};
    previous_last <= band_previous;
    busy_last <= busy && !rst;
    went <= goes && !rst;
    leaf_went <= `SECOND_LEVEL && leaf_valid && !rst;
    probe_went <= block_valid && block_now[0] && !rst;
    index_went <= {block_now[6:3], choice};
    if (goes_it && times != 3) times <= times + 1;
    if (age != 15) age <= age + 1;
    if (take_it) begin
      accepted <= 1;
      age <= 0;
    end
    if (rst || (result_valid && result_ready)) begin
      accepted <= take_it && !rst;
      times <= 0;
    end
  end

  wire [2:0] count_c = count(band_previous[2:0]);
  wire in_queue = queue_valid && !queue[0] && queue[6:3] == of_ab;
  wire in_work = goes && block_now[6:3] == of_ab;
  wire under_way = queue_valid || block_valid || valid != 0;

  wire fact_settled = !settled || !under_way;
  wire fact_choice = !goes || choice < count_c;
  wire fact_in_queue = !in_queue || (accepted && times == 0 && !in_work);
  wire fact_in_work = !in_work || (accepted && times == (of_c < choice));
  wire fact_not_taken = accepted || (times == 0 && !in_queue && !in_work);
  wire fact_through = !(accepted && !in_queue && !in_work) || times == (of_c < count_c);
  wire fact_age_queue = !in_queue || (block_valid ? choice >= age : age == 0);
  wire fact_age_work = !in_work || age <= choice + 4;

  wire prove_each_once = !(accepted && result_valid) || times == (of_c < count_c);
  wire prove_none_twice = times <= 1;
  wire prove_none_untaken = accepted || times == 0;
  wire prove_in_time = (!in_queue || age <= 3) && (!in_work || age <= 7);
  wire prove_as_it_went = valid[16] == (went || leaf_went || probe_went) && (!went || leaf_went || index == index_went);
  wire prove_busy = busy || !(under_way || waiting);
  wire prove_result_is_whole = !result_valid || (last && !under_way && waiting);

endmodule
