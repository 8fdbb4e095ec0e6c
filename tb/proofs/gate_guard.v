// Proof that gate_guard keeps the safety properties of gate_guard_checked, in every clock after the first reset.
//
// gate_guard_checked has the properties. Here stand the facts that make each of them follow from one clock to the
// next. A fact is proven as a property is: it holds after a reset, and one clock after all facts have held.
//
// TABLED_LEG, LEAST_DEAD_TIME: as gate_guard's.  What a leg is comes from the converter's file, converter.vh.
// Assumed: settings change only after renew, for property 9 alone.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input enable, input external_trip, input driver_fault, input upset,
  input [14:0] clear,
  input measured, input [15:0] is_alpha, input [15:0] is_beta, input [15:0] v_dc,
  input start, input decided, input [2:0] position_a, input [2:0] position_b, input [2:0] position_c,
  input renew, input [11:0] dead_time, input [11:0] minimum_on, input [11:0] minimum_off,
  input [15:0] decision_limit, input [15:0] watchdog,
  input [15:0] current_limit, input [15:0] link_high, input [15:0] link_low,
  input [15:0] v_n, input [15:0] v_ph_a, input [15:0] v_ph_b, input [15:0] v_ph_c, input [15:0] omega_r,
  input [15:0] v_ph_high, input [15:0] v_ph_low, input [15:0] v_n_limit, input [15:0] speed_limit,
  input [7:0] frozen_limit
);

  `include "converter.vh"

  localparam COUNT = 3 * SIZE;
  localparam [2:0] COUNTS = `TABLED_LEG ? 7 : 1;  // bits of a position
  localparam [11:0] LEAST = `LEAST_DEAD_TIME;
  localparam [1:0] OFF = 0, ARMED = 1, ACTIVE = 2;
  localparam [1:0] STOPPED = 0, STARTING = 1, RESTED = 2, ACTING = 3;

  wire [13:0] violations;

  gate_guard_checked i_checked (
    .clk(clk), .rst(rst), .enable(enable), .external_trip(external_trip), .driver_fault(driver_fault),
    .upset(upset), .clear(clear), .measured(measured),
    .is_alpha(is_alpha), .is_beta(is_beta), .v_dc(v_dc), .start(start), .decided(decided),
    .position_a(position_a), .position_b(position_b), .position_c(position_c), .renew(renew),
    .dead_time(dead_time), .minimum_on(minimum_on), .minimum_off(minimum_off),
    .decision_limit(decision_limit), .watchdog(watchdog), .current_limit(current_limit),
    .link_high(link_high), .link_low(link_low), .v_n(v_n), .v_ph_a(v_ph_a), .v_ph_b(v_ph_b), .v_ph_c(v_ph_c),
    .omega_r(omega_r), .v_ph_high(v_ph_high), .v_ph_low(v_ph_low), .v_n_limit(v_n_limit),
    .speed_limit(speed_limit), .frozen_limit(frozen_limit), .violations(violations)
  );

  // the properties' own memory
  (* inside = "i_checked.known" *) wire known;
  (* inside = "i_checked.g" *) wire [COUNT-1:0] gates;
  (* inside = "i_checked.earlier" *) wire [COUNT-1:0] before;
  (* inside = "i_checked.was_on" *) wire was_on;
  (* inside = "i_checked.ages" *) wire [13*COUNT-1:0] ages;
  (* inside = "i_checked.floor_dead" *) wire [11:0] floor_dead;
  (* inside = "i_checked.most_dead", when = "STEPPED" *) wire [11:0] most_dead;
  (* inside = "i_checked.since", when = "STEPPED" *) wire [14:0] since;
  (* inside = "i_checked.cut" *) wire cut;
  (* inside = "i_checked.floor_on" *) wire [11:0] floor_on;
  (* inside = "i_checked.floor_off" *) wire [11:0] floor_off;
  (* inside = "i_checked.fresh" *) wire fresh;
  (* inside = "i_checked.whole", when = "TABLED_LEG" *) wire [8:0] whole;
  (* inside = "i_checked.entered", when = "TABLED_LEG" *) wire [2:0] entered;
  (* inside = "i_checked.offered" *) wire [8:0] offered;
  (* inside = "i_checked.wanted" *) wire [8:0] accepted_last;
  (* inside = "i_checked.hungry" *) wire [16:0] hungry;
  (* inside = "i_checked.awaited" *) wire awaited;
  (* inside = "i_checked.due" *) wire [16:0] due;
  (* inside = "i_checked.beyond" *) wire [2:0] beyond;
  (* inside = "i_checked.astray" *) wire [2:0] astray;
  (* inside = "i_checked.limits" *) wire [47:0] limits;
  (* inside = "i_checked.vetted" *) wire vetted;

  // the supervisor
  (* inside = "i_checked.i_guard.i_supervisor.armed" *) wire armed;
  (* inside = "i_checked.i_guard.i_supervisor.active" *) wire active;
  (* inside = "i_checked.i_guard.i_supervisor.primed" *) wire primed;
  (* inside = "i_checked.i_guard.i_supervisor.compared" *) wire compared;
  (* inside = "i_checked.i_guard.i_supervisor.off_for" *) wire [11:0] off_for;
  (* inside = "i_checked.i_guard.i_supervisor.dead" *) wire [11:0] dead;
  (* inside = "i_checked.i_guard.i_supervisor.rest" *) wire [11:0] rest;
  (* inside = "i_checked.i_guard.i_supervisor.latched" *) wire [14:0] latched;
  (* inside = "i_checked.i_guard.i_supervisor.parity" *) wire parity;
  (* inside = "i_checked.i_guard.i_supervisor.altered" *) wire altered;
  (* inside = "i_checked.i_guard.i_supervisor.faulty" *) wire faulty;
  (* inside = "i_checked.i_guard.i_supervisor.i_starved.left" *) wire [15:0] starved_left;
  (* inside = "i_checked.i_guard.i_supervisor.i_starved.done" *) wire starved_done;
  (* inside = "i_checked.i_guard.i_supervisor.expected" *) wire expected;
  (* inside = "i_checked.i_guard.i_supervisor.i_late.left" *) wire [15:0] late_left;
  (* inside = "i_checked.i_guard.i_supervisor.i_late.done" *) wire late_done;

  // the second supervisor, which is at what the first one is at
  (* inside = "i_checked.i_guard.g_second_i_second.armed", when = "SECOND_SUPERVISOR" *) wire second_armed;
  (* inside = "i_checked.i_guard.g_second_i_second.active", when = "SECOND_SUPERVISOR" *) wire second_active;
  (* inside = "i_checked.i_guard.g_second_i_second.primed", when = "SECOND_SUPERVISOR" *) wire second_primed;
  (* inside = "i_checked.i_guard.g_second_i_second.compared", when = "SECOND_SUPERVISOR" *) wire second_compared;
  (* inside = "i_checked.i_guard.g_second_i_second.expected", when = "SECOND_SUPERVISOR" *) wire second_expected;
  (* inside = "i_checked.i_guard.g_second_i_second.off_for", when = "SECOND_SUPERVISOR" *) wire [11:0] second_off_for;
  (* inside = "i_checked.i_guard.g_second_i_second.dead", when = "SECOND_SUPERVISOR" *) wire [11:0] second_dead;
  (* inside = "i_checked.i_guard.g_second_i_second.rest", when = "SECOND_SUPERVISOR" *) wire [11:0] second_rest;
  (* inside = "i_checked.i_guard.g_second_i_second.latched", when = "SECOND_SUPERVISOR" *) wire [14:0] second_latched;
  (* inside = "i_checked.i_guard.g_second_i_second.parity", when = "SECOND_SUPERVISOR" *) wire second_parity;
  (* inside = "i_checked.i_guard.g_second_i_second.altered", when = "SECOND_SUPERVISOR" *) wire second_altered;
  (* inside = "i_checked.i_guard.g_second_i_second.faulty", when = "SECOND_SUPERVISOR" *) wire second_faulty;
  (* inside = "i_checked.i_guard.g_second_i_second.i_starved.left", when = "SECOND_SUPERVISOR" *) wire [15:0] second_starved_left;
  (* inside = "i_checked.i_guard.g_second_i_second.i_starved.done", when = "SECOND_SUPERVISOR" *) wire second_starved_done;
  (* inside = "i_checked.i_guard.g_second_i_second.i_late.left", when = "SECOND_SUPERVISOR" *) wire [15:0] second_late_left;
  (* inside = "i_checked.i_guard.g_second_i_second.i_late.done", when = "SECOND_SUPERVISOR" *) wire second_late_done;
  (* inside = "i_checked.i_guard.g_second_disagree", when = "SECOND_SUPERVISOR" *) wire disagree;
`ifdef SECOND_SUPERVISOR
  wire fact_second = !disagree
    && {second_armed, second_active, second_primed, second_compared, second_expected, second_off_for,
        second_dead, second_rest, second_latched, second_parity, second_altered, second_faulty}
       == {armed, active, primed, compared, expected, off_for,
           dead, rest, latched, parity, altered, faulty};
  wire fact_second_starved = !(armed || active)
    || {second_starved_left, second_starved_done} == {starved_left, starved_done};
  wire fact_second_late = !expected || {second_late_left, second_late_done} == {late_left, late_done};
`endif

  // the comparator
  (* inside = "i_checked.i_guard.i_comparator.valid_1" *) wire valid_1;
  (* inside = "i_checked.i_guard.i_comparator.valid_2" *) wire valid_2;
  (* inside = "i_checked.i_guard.i_comparator.count_1" *) wire count_1;
  (* inside = "i_checked.i_guard.i_comparator.count_2" *) wire count_2;
  (* inside = "i_checked.i_guard.i_comparator.checked" *) wire checked;
  (* inside = "i_checked.i_guard.i_comparator.alpha_1" *) wire [15:0] alpha_1;
  (* inside = "i_checked.i_guard.i_comparator.alpha_2" *) wire [15:0] alpha_2;
  (* inside = "i_checked.i_guard.i_comparator.beta_1" *) wire [24:0] beta_1;
  (* inside = "i_checked.i_guard.i_comparator.b_2" *) wire [24:0] b_2;
  (* inside = "i_checked.i_guard.i_comparator.c_2" *) wire [24:0] c_2;
  (* inside = "i_checked.i_guard.i_comparator.high_1" *) wire high_1;
  (* inside = "i_checked.i_guard.i_comparator.high_2" *) wire high_2;
  (* inside = "i_checked.i_guard.i_comparator.low_1" *) wire low_1;
  (* inside = "i_checked.i_guard.i_comparator.low_2" *) wire low_2;
  (* inside = "i_checked.i_guard.i_comparator.over_current" *) wire over_current;
  (* inside = "i_checked.i_guard.i_comparator.over_voltage" *) wire over_voltage;
  (* inside = "i_checked.i_guard.i_comparator.under_voltage" *) wire under_voltage;

  // the bands
  (* inside = "i_checked.i_guard.i_bands.valid_1" *) wire banded_1;
  (* inside = "i_checked.i_guard.i_bands.capacitor_1", when = "HAS_CAPACITORS" *) wire capacitor_1;
  (* inside = "i_checked.i_guard.i_bands.neutral_1", when = "HAS_NEUTRAL" *) wire neutral_1;
  (* inside = "i_checked.i_guard.i_bands.speed_1" *) wire speed_1;
  (* inside = "i_checked.i_guard.i_bands.capacitor_2", when = "HAS_CAPACITORS" *) wire capacitor_2;
  (* inside = "i_checked.i_guard.i_bands.neutral_2", when = "HAS_NEUTRAL" *) wire neutral_2;
  (* inside = "i_checked.i_guard.i_bands.speed_2" *) wire speed_2;
  (* inside = "i_checked.i_guard.i_bands.capacitor", when = "HAS_CAPACITORS" *) wire capacitor_3;
  (* inside = "i_checked.i_guard.i_bands.neutral", when = "HAS_NEUTRAL" *) wire neutral_3;
  (* inside = "i_checked.i_guard.i_bands.speed" *) wire speed_3;

  // the legs
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.live" *) wire live_a;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.phase" *) wire [1:0] phase_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.live" *) wire live_b;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.phase" *) wire [1:0] phase_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.live" *) wire live_c;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.phase" *) wire [1:0] phase_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.accepted" *) wire [2:0] accepted_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.accepted" *) wire [2:0] accepted_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.accepted" *) wire [2:0] accepted_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.origin" *) wire [2:0] origin_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.origin" *) wire [2:0] origin_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.origin" *) wire [2:0] origin_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.target" *) wire [2:0] target_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.target" *) wire [2:0] target_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.target" *) wire [2:0] target_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.action" *) wire [2:0] action_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.action" *) wire [2:0] action_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.action" *) wire [2:0] action_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.first" *) wire [SIZE-1:0] first_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.first" *) wire [SIZE-1:0] first_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.first" *) wire [SIZE-1:0] first_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.further" *) wire [SIZE-1:0] further_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.further" *) wire [SIZE-1:0] further_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.further" *) wire [SIZE-1:0] further_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.ends" *) wire ends_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.ends" *) wire ends_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.ends" *) wire ends_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.starts", when = "TABLED_LEG" *) wire starts_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.starts", when = "TABLED_LEG" *) wire starts_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.starts", when = "TABLED_LEG" *) wire starts_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.i_countdown.left" *) wire [11:0] left_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.i_countdown.left" *) wire [11:0] left_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.i_countdown.left" *) wire [11:0] left_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.i_countdown.done" *) wire done_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.i_countdown.done" *) wire done_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.i_countdown.done" *) wire done_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.g_own_age_i_age.left", when = "OWN_AGE" *) wire [11:0] age_left_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.g_own_age_i_age.left", when = "OWN_AGE" *) wire [11:0] age_left_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.g_own_age_i_age.left", when = "OWN_AGE" *) wire [11:0] age_left_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.g_own_age_i_age.done", when = "OWN_AGE" *) wire age_done_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.g_own_age_i_age.done", when = "OWN_AGE" *) wire age_done_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.g_own_age_i_age.done", when = "OWN_AGE" *) wire age_done_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.asked" *) wire [2:0] asked_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.asked" *) wire [2:0] asked_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.asked" *) wire [2:0] asked_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.follows", when = "TABLED_LEG" *) wire follows_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.follows", when = "TABLED_LEG" *) wire follows_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.follows", when = "TABLED_LEG" *) wire follows_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.moves" *) wire moves_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.moves" *) wire moves_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.moves" *) wire moves_c;
  (* inside = "i_checked.i_guard.g_legs_n1_i_leg.waiting" *) wire waiting_a;
  (* inside = "i_checked.i_guard.g_legs_n2_i_leg.waiting" *) wire waiting_b;
  (* inside = "i_checked.i_guard.g_legs_n3_i_leg.waiting" *) wire waiting_c;

  // gates that the actions before one have changed
  function [SIZE-1:0] changed(input [2:0] a, input [2:0] b, input [2:0] n);
    integer i;
    begin
      changed = 0;
      for (i = 0; i < 7; i = i + 1) if (i < n) changed = changed | gate_of(a, b, i);
    end
  endfunction

  // a current that trips, from the comparator's sums: 64 alpha, 111 beta
  function trips_at(input [15:0] alpha, input [24:0] sum_b, input [24:0] sum_c, input [15:0] limit);
    reg signed [27:0] a, b, c, l;
    begin
      a = {{12{alpha[15]}}, alpha};
      b = {{3{sum_b[24]}}, sum_b};
      c = {{3{sum_c[24]}}, sum_c};
      l = {12'b0, limit};
      trips_at = a > l || a < -l || b > l * 128 || b < -l * 128 || c > l * 128 || c < -l * 128 || limit > 32766;
    end
  endfunction

  wire [1:0] state = active ? ACTIVE : armed ? ARMED : OFF;
  wire [24:0] alpha_64 = {{3{alpha_1[15]}}, alpha_1, 6'b0};
  wire [11:0] floor = floor_dead < LEAST ? LEAST : floor_dead;
  wire [11:0] most = most_dead < LEAST ? LEAST : most_dead;

  reg renewed;  // renew in the clock before
  reg steady;   // since the reset limits have changed after renew only
  wire [47:0] limits_now = {current_limit, link_high, link_low};
  always @(posedge clk) begin
    renewed <= renew;
    steady <= rst || (steady && (renewed || limits == limits_now));
  end

  // the properties, by their numbers
  wire prove_no_source_is_shorted = !violations[0];
  wire prove_dead_time = !violations[1];
  wire prove_minimum_on_time = !violations[2];
  wire prove_minimum_off_time = !violations[3];
  wire prove_positions_follow_edges = !violations[4];
  wire prove_off_after_every_cause = !violations[5];
  wire prove_on_only_while_running = !violations[6];
  wire prove_runs_only_when_primed = !violations[7];
  wire prove_off_without_decisions = !violations[8];
  wire prove_runs_only_when_measured = !steady || !violations[9];
  wire prove_a_stop_ends_in_time = !violations[10];
  wire prove_order_of_a_stop = !violations[11];
  wire prove_order_of_a_start = !violations[12];
  wire prove_off_when_late = !violations[13];


  wire fact_known = known;
  wire fact_state = !(armed && active);
  wire fact_faulty = faulty == (latched != 0);
  wire fact_primed = !primed || (fresh && !faulty);
  wire fact_runs = state == OFF || primed;
  wire fact_parity = parity == ^{dead, rest} && !altered;
  wire fact_dead = dead >= LEAST && rest >= 1;
  wire fact_off = !(state == OFF && was_on) || off_for == 0;
  wire fact_armed = !(state == ARMED && was_on);
  wire fact_dark = state != ARMED || gates == 0;
  wire fact_bright = gates == 0 || off_for == 0;
  wire fact_changed = before == 0 || off_for == 0;
  wire fact_most = !`STEPPED || (state == OFF && gates == 0 && off_for == 0) || dead <= most;
  wire fact_since = !`STEPPED || state != ACTIVE || !was_on || since == 0;
  wire fact_floor = (floor <= dead && floor_on <= rest && floor_off <= rest);
  wire fact_starved = state != ACTIVE || (hungry == starved_left + 17'd2 && starved_done == (starved_left == 0));
  wire fact_fresh = faulty || primed == fresh;
  wire fact_expected = expected == awaited;
  wire fact_late = !expected || state != ACTIVE || (due == late_left + 17'd1 && late_done == (late_left == 0));
  // 111 i_beta is the same in the comparator, by shifts, and in the properties, by a multiplication
  wire signed [24:0] beta = $signed(is_beta);
  wire signed [24:0] alpha = $signed(is_alpha);
  wire signed [24:0] product = beta * 25'sd111;
  wire signed [24:0] shifted = (beta << 7) - ((beta << 4) + beta);
  wire signed [26:0] product_27 = product;
  wire signed [26:0] alpha_27 = $signed({is_alpha, 6'b0});
  wire signed [24:0] minus = (alpha << 6) - shifted;
  wire signed [24:0] plus = (alpha << 6) + shifted;
  wire signed [26:0] minus_27 = minus;
  wire signed [26:0] plus_27 = plus;
  wire fact_product = product == shifted;
  wire fact_minus = product_27 - alpha_27 == -minus_27;
  wire fact_plus = product_27 + alpha_27 == plus_27;
  wire fact_valid = banded_1 == valid_1;
  wire fact_beyond_0 = !beyond[0] || (valid_1 && (high_1 || low_1
                      || trips_at(alpha_1, alpha_64 - beta_1, alpha_64 + beta_1, limits[47:32])));
  wire fact_beyond_1 = !beyond[1] || (valid_2 && (high_2 || low_2 || trips_at(alpha_2, b_2, c_2, limits[47:32])));
  wire fact_beyond_2 = !beyond[2] || over_current || over_voltage || under_voltage;
  wire fact_astray_0 = !astray[0] || (banded_1 && (speed_1 || capacitor_1 || neutral_1));
  wire fact_astray_1 = !astray[1] || speed_2 || capacitor_2 || neutral_2;
  wire fact_astray_2 = !astray[2] || speed_3 || capacitor_3 || neutral_3;
  wire fact_sum = beta_1 + 25'd3637248 <= 25'd7274385;
  wire fact_count_1 = !(steady && count_1) || (!renewed && (vetted || beyond[0] || astray[0]));
  wire fact_count_2 = !(steady && count_2) || (!renewed && (vetted || beyond[1] || astray[1]));
  wire fact_checked = !(steady && checked) || (!renewed && (vetted || beyond[2] || astray[2]));
  wire fact_compared = !(steady && compared) || vetted || faulty;

  genvar i, x;
  generate
    for (x = 0; x < 3; x = x + 1) begin : leg
      wire live = x == 0 ? live_a : x == 1 ? live_b : live_c;
      wire [1:0] encoded = x == 0 ? phase_a : x == 1 ? phase_b : phase_c;
      wire [1:0] phase = !live ? STOPPED : encoded + 2'd1;
      wire [2:0] asked = x == 0 ? asked_a : x == 1 ? asked_b : asked_c;
      wire follows_now = !`TABLED_LEG || (x == 0 ? follows_a : x == 1 ? follows_b : follows_c);
      wire moves_now = x == 0 ? moves_a : x == 1 ? moves_b : moves_c;
      wire waiting = x == 0 ? waiting_a : x == 1 ? waiting_b : waiting_c;
      wire [2:0] accepted = x == 0 ? accepted_a : x == 1 ? accepted_b : accepted_c;
      wire [2:0] origin = x == 0 ? origin_a : x == 1 ? origin_b : origin_c;
      wire [2:0] target = x == 0 ? target_a : x == 1 ? target_b : target_c;
      wire [2:0] action = x == 0 ? action_a : x == 1 ? action_b : action_c;
      wire [SIZE-1:0] first = x == 0 ? first_a : x == 1 ? first_b : first_c;
      wire [SIZE-1:0] further = x == 0 ? further_a : x == 1 ? further_b : further_c;
      wire starts = `TABLED_LEG && (x == 0 ? starts_a : x == 1 ? starts_b : starts_c);
      wire ends = x == 0 ? ends_a : x == 1 ? ends_b : ends_c;
      wire [11:0] left = x == 0 ? left_a : x == 1 ? left_b : left_c;
      wire done = x == 0 ? done_a : x == 1 ? done_b : done_c;
      // until a stop may take a step
      wire [11:0] age_left_now = !`OWN_AGE ? left : x == 0 ? age_left_a : x == 1 ? age_left_b : age_left_c;
      wire age_done_now = !`OWN_AGE ? done : x == 0 ? age_done_a : x == 1 ? age_done_b : age_done_c;
      wire [SIZE-1:0] driven = gates[SIZE*x +: SIZE];
      wire [2:0] known_goal = accepted_last[3*(2-x) +: 3];
      wire [2:0] seen = whole[3*(2-x) +: 3];
      wire moves = phase == RESTED || phase == ACTING;
      wire going = !live && driven != 0;  // in a stop
      wire aging = `OWN_AGE ? driven != 0 : phase == ACTING || going;
      // gates of this move so far, and the one of them that changed last
      wire [SIZE-1:0] move = starts ? begun(target, action) : changed(origin, target, action);
      wire [SIZE-1:0] latest = starts ? 0 : gate_of(origin, target, action - 3'd1);

      wire fact_encoded = !live || encoded != 3;
      wire fact_phase = (state == ACTIVE) == (phase != STOPPED);
      wire fact_asked = asked == (offered[3*(2-x) +: 3] & COUNTS);
      wire fact_verdict = (!`TABLED_LEG || follows_now == follows(accepted, asked)) && moves_now == (accepted != asked);
      wire fact_waiting = waiting == (phase == STARTING || (moves && accepted != target));
      wire fact_idle = phase != STARTING || driven == 0;
      wire fact_no_rail = live || !rail(driven);
      wire fact_stop = !going || steps(driven) != 0;
      wire fact_left = !aging || age_left_now < dead;
      wire [14:0] times = dead * (STOPS + 3'd1 - steps(driven));
      wire fact_in_time = !going || since + age_left_now + 15'd1 <= times;
      wire fact_goal = phase == STOPPED || accepted == (known_goal & COUNTS);
      wire fact_rested = phase != RESTED || driven == full(target);
      wire fact_first = !moves || (follows(target, accepted)
                       && (target == accepted || first == gate_of(target, accepted, 0)));
      wire fact_starts = phase != ACTING || !starts || (action >= 1 && action <= GROUPS - 1
                        && further == (begun(target, action + 3'd1) & ~begun(target, action))
                        && ends == (action == GROUPS - 1) && driven == begun(target, action));
      wire fact_acting = phase != ACTING || starts || (follows(origin, target) && origin != target && action >= 1
                        && action <= last(origin, target) && further == gate_of(origin, target, action)
                        && ends == (action == last(origin, target)) && driven == (full(origin) ^ move));
      wire fact_done = !(moves || going) || done == (left == 0);
      wire fact_aged = !aging || age_done_now == (age_left_now == 0);
      wire fact_entered = !entered[x] || phase == RESTED || phase == ACTING || was_on;
      wire fact_unentered = phase != STARTING || !entered[x];
      wire fact_starting = !(phase == ACTING && starts && entered[x]) || follows(seen, target);
      wire fact_whole = !(phase == RESTED && entered[x]) || follows(seen, target);
      wire fact_between = phase != ACTING || starts || !`TABLED_LEG || (entered[x] && seen == origin);
      wire fact_position = position(asked) && (phase == STOPPED || position(accepted))
                           && (!moves || position(target)) && (phase != ACTING || starts || position(origin));

      wire [SIZE-1:0] recent;  // on, or off for less than a dead time
      wire [SIZE-1:0] old;     // unchanged for a dead time
      wire [SIZE-1:0] was = before[SIZE*x +: SIZE];
      wire free = was == driven || (state != ACTIVE && (cut || latched[8]));  // of any order

      for (i = 0; i < SIZE; i = i + 1) begin : gate
        localparam N = SIZE * x + i;
        wire [12:0] stored = ages[13*(COUNT-1-N) +: 13];
        // clocks since it changed; 0 in the first
        wire [12:0] age = gates[N] != before[N] ? 0 : stored;

        assign old[i] = stored >= {1'b0, floor};
        assign recent[i] = gates[N] || before[N] || stored < {1'b0, floor};
        wire fact_recent = !(moves && recent[i] && !driven[i])
                           || (phase == ACTING && !starts && action[0] && latest[i]);
        wire fact_on_long = !(before[N] && !gates[N] && state == ACTIVE) || stored >= floor_on;
        wire fact_off_long = !(!before[N] && gates[N] && state == ACTIVE) || stored >= floor_off;
        wire fact_off = state != OFF || off_for == 0 || age >= off_for;
        wire fact_ready = !(state == ARMED || phase == STARTING) || (age >= dead && age >= rest);
        wire fact_rest = phase != RESTED || age + left + 1 >= rest;
        wire fact_dead = phase != RESTED || driven[i] || age >= dead;
        wire fact_kept = !(phase == ACTING && !move[i]) || age >= rest;
        wire fact_apart = !(phase == ACTING && !driven[i]) || age >= dead || (latest[i] && age + left + 1 >= dead);
        wire fact_steady = !(phase == ACTING || (going && !`OWN_AGE)) || age + left + 1 >= dead;
        wire fact_old = !aging || age + age_left_now + 1 >= dead;
      end

      wire fact_order = free || (state == ACTIVE ? is_step(was, driven) : driven == stopped(was));
      wire fact_order_waits = free || (state == ACTIVE ? was == 0 || is_whole(was) : rail(was)) || &old;
      wire fact_extended = driven == 0 || !shorts(recent);
    end
  endgenerate

endmodule
