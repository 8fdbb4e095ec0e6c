// Proof that mpdcc_scheduler decides only after every candidate has been taken and every result compared, for any
// explorers that keep their side: what they say, and when, is free. So are the numbers they work on.
//
// One result is watched: any one, it never changes and nothing is known of it.
//
// EXPLORERS, FOLDED: as mpdcc_scheduler's.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input start, input [15:0] measurement_is_alpha, input [15:0] measurement_is_beta,
  input [15:0] measurement_psir_alpha, input [15:0] measurement_psir_beta, input [15:0] measurement_v_n,
  input [15:0] measurement_v_ph_a, input [15:0] measurement_v_ph_b, input [15:0] measurement_v_ph_c,
  input [15:0] measurement_v_dc, input [15:0] measurement_iref_alpha, input [15:0] measurement_iref_beta,
  input [15:0] measurement_omega_s, input [15:0] measurement_omega_r, input [8:0] previous,
  input [527:0] coefficients, input [15:0] limits_bound_current, input [15:0] limits_bound_neutral,
  input [15:0] limits_bound_phase, input [5:0] limits_horizon, input [1:0] limits_weight_scale,
  input limits_deadlock_rule, input limits_outside_inwards, input options_two_switchings,
  input [11:0] options_budget, input options_compensate, input [141*`EXPLORERS-1:0] answers, input [44:0] watched
);

  wire valid; wire busy; wire [8:0] decision_position; wire decision_held; wire decision_deadlock;
  wire [5:0] decision_length; wire decision_saturated; wire decision_exhausted; wire [540:0] broadcast_node;
  wire [275:0] broadcast_band; wire [37:0] broadcast_capacitor; wire broadcast_last; wire broadcast_best_valid;
  wire [30:0] broadcast_best_cost; wire [19:0] broadcast_candidate; wire [13:0] broadcast_reached;
  wire [24*`EXPLORERS-1:0] assignments;

  mpdcc_scheduler i_dut (
    .clk(clk), .rst(rst), .start(start), .measurement_is_alpha(measurement_is_alpha),
    .measurement_is_beta(measurement_is_beta), .measurement_psir_alpha(measurement_psir_alpha),
    .measurement_psir_beta(measurement_psir_beta), .measurement_v_n(measurement_v_n),
    .measurement_v_ph_a(measurement_v_ph_a), .measurement_v_ph_b(measurement_v_ph_b),
    .measurement_v_ph_c(measurement_v_ph_c), .measurement_v_dc(measurement_v_dc),
    .measurement_iref_alpha(measurement_iref_alpha), .measurement_iref_beta(measurement_iref_beta),
    .measurement_omega_s(measurement_omega_s), .measurement_omega_r(measurement_omega_r), .previous(previous),
    .coefficients(coefficients), .limits_bound_current(limits_bound_current),
    .limits_bound_neutral(limits_bound_neutral), .limits_bound_phase(limits_bound_phase),
    .limits_horizon(limits_horizon), .limits_weight_scale(limits_weight_scale),
    .limits_deadlock_rule(limits_deadlock_rule), .limits_outside_inwards(limits_outside_inwards),
    .options_two_switchings(options_two_switchings), .options_budget(options_budget),
    .options_compensate(options_compensate), .answers(answers), .valid(valid), .busy(busy),
    .decision_position(decision_position), .decision_held(decision_held), .decision_deadlock(decision_deadlock),
    .decision_length(decision_length), .decision_saturated(decision_saturated),
    .decision_exhausted(decision_exhausted), .broadcast_node(broadcast_node), .broadcast_band(broadcast_band),
    .broadcast_capacitor(broadcast_capacitor), .broadcast_last(broadcast_last),
    .broadcast_best_valid(broadcast_best_valid), .broadcast_best_cost(broadcast_best_cost),
    .broadcast_candidate(broadcast_candidate), .broadcast_reached(broadcast_reached), .assignments(assignments)
  );

  localparam N = `EXPLORERS;
  localparam BLOCKS = !`FOLDED, REGISTERED = N > 1 && !`FOLDED;
  localparam IDLE = 0, SEARCH = 4, FINISH = 6;

  (* inside = "i_dut.r" *) wire [4:0] state;
  (* inside = "i_dut.hold" *) wire hold;
  (* inside = "i_dut.decide" *) wire decide;
  (* inside = "i_dut.enumerate" *) wire enumerate;
  (* inside = "i_dut.s_before" *) wire [8:0] previous_kept;
  (* inside = "i_dut.i_handout.i_enumerator.r" *) wire [27:0] r;
  (* inside = "i_dut.i_handout.i_enumerator.valid" *) wire enumerated_valid;
  (* inside = "i_dut.i_handout.i_enumerator.ready" *) wire enumerated_ready;
  (* inside = "i_dut.i_handout.i_enumerator.candidate_index" *) wire [5:0] index;
  (* inside = "i_dut.i_collector.compare" *) wire compare;
  (* inside = "i_dut.i_collector.arrival" *) wire [44:0] arrival;
  (* inside = "i_dut.i_collector.any" *) wire any;
  (* inside = "i_dut.i_collector.takes" *) wire taken;
  (* inside = "i_dut.i_collector.chosen" *) wire [44:0] incoming;
  (* inside = "i_dut.best" *) wire [44:0] best;
  wire [2:0] phase = state[2:0];
  wire running = r[0];
  wire [1:0] choice_a = r[6:5], choice_b = r[4:3], choice_c = r[2:1];
  wire [2:0] from_a = previous_kept[8:6], from_b = previous_kept[5:3], from_c = previous_kept[2:0];

  `include "switch_graph.vh"

  // feasible ones first, then the smaller rank, then the earlier place
  function [38:0] key(input [44:0] result);
    key = {!result[0], result[44:14], result[7:2], result[1]};
  endfunction

  reg [44:0] watched_last;
  wire assume_the_same_is_watched = watched == watched_last;

  // the explorers' side: a result comes of candidates that were taken, with the fast ones after the last; an explorer
  // is busy until its result has been taken
  reg [N-1:0] has;
  reg side;
  reg [N-1:0] takes, gives;
  integer i;
  always @* begin
    side = 1;
    takes = 0;
    gives = 0;
    for (i = 0; i < N; i = i + 1) begin
      takes[i] = assignments[24*(N-1-i)] && answers[141*(N-1-i)] && !broadcast_candidate[0];
      gives[i] = assignments[24*(N-1-i)+1] && answers[141*(N-1-i)+3];
      if (has[i] && !answers[141*(N-1-i)+49]) side = 0;
      if (answers[141*(N-1-i)+3] && !(has[i] && (`FOLDED || broadcast_last))) side = 0;
      if (`FOLDED && has[i] && answers[141*(N-1-i)]) side = 0;
    end
  end
  wire assume_explorers = side;

  reg begun;            // enumeration has begun, and no reset since
  reg [1:0] a, b, c;    // choices of the next candidate that is taken
  reg all;              // every one has been taken
  reg owed;             // a decision is
  reg due;              // it was made in the clock before
  reg on_way, met, some;
  wire c_ends = BLOCKS || c == count(from_c) - 1;
  wire b_ends = b == count(from_b) - 1;
  wire a_ends = a == count(from_a) - 1;
  wire goes = enumerated_valid && enumerated_ready;
  wire takes_it = taken && incoming == watched;
  wire compares_it = REGISTERED ? on_way : takes_it;
  wire clear = phase == IDLE;

  always @(posedge clk) begin
    watched_last <= watched;
    has <= rst ? 0 : (has & ~gives) | takes;
    if (goes) begin
      c <= c_ends ? 0 : c + 1;
      if (c_ends) b <= b_ends ? 0 : b + 1;
      if (c_ends && b_ends) a <= a + 1;
      if (c_ends && b_ends && a_ends) all <= 1;
    end
    if (enumerate) begin
      begun <= 1;
      all <= 0;
      a <= 0;
      b <= 0;
      c <= 0;
    end
    if (phase == IDLE && start) owed <= 1;
    if (hold || decide) owed <= 0;
    due <= (hold || decide) && !rst;
    on_way <= !rst && takes_it;
    met <= !rst && !clear && (met || compares_it);
    some <= !rst && !clear && (some || compare);
    if (rst) begin
      begun <= 0;
      owed <= 0;
    end
  end

  wire [5:0] now = {a, b, c};
  wire [5:0] after = {choice_a, choice_b, choice_c};
  wire [5:0] successor = {c_ends && b_ends ? a + 2'd1 : a, c_ends ? (b_ends ? 2'd0 : b + 2'd1) : b,
                          c_ends ? 2'd0 : c + 2'd1};
  wire searching = phase == SEARCH;

  wire fact_phase = phase <= FINISH && phase != 3 && phase != 5;
  wire fact_begun = (begun || !(running || enumerated_valid)) && (!searching || begun) && (phase != FINISH || begun);
  wire fact_rests = searching || !(running || enumerated_valid);
  wire fact_in_range = !(searching && !all) || (a < count(from_a) && b < count(from_b)
                       && (BLOCKS ? c == 0 : c < count(from_c)));
  wire fact_shown = !enumerated_valid || (!all && index == now);
  wire fact_waits = !(searching && !enumerated_valid && !all) || (running && after == now);
  wire fact_next = !enumerated_valid || (running ? !(c_ends && b_ends && a_ends) && after == successor
                   : c_ends && b_ends && a_ends);
  wire fact_ended = !all || !(running || enumerated_valid);
  wire fact_has = searching || has == 0;
  wire fact_owed = owed == (phase != IDLE);
  wire fact_on_way = !(REGISTERED && on_way) || (compare && arrival == watched);
  wire fact_compare = !(REGISTERED && compare && arrival == watched) || on_way;
  wire fact_late = !(REGISTERED && compare) || searching;
  wire fact_any = phase == IDLE || some == any;
  wire fact_met = phase == IDLE || !met || any;
  wire fact_none_yet = searching || phase == FINISH || phase == IDLE || (!some && !met && !any);
  wire fact_one_result = !(N == 1 && !`FOLDED && (some || on_way)) || phase == IDLE || (all && has == 0);

  wire prove_all_candidates_first = phase != FINISH || all;
  wire prove_none_under_way = phase != FINISH || has == 0;
  wire prove_best_is_least = !(met && phase != IDLE) || key(best) <= key(watched);
  wire prove_all_compared = phase != FINISH || !REGISTERED || !compare;
  wire prove_one_decision_a_start = valid == due && (!(hold || decide) || owed) && busy == owed;

endmodule
