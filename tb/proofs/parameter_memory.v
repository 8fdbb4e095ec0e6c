// Proof that words in force change only while they may, and that a copy is whole: behind it a word of any place is what
// the host wrote there last, in the observer's memory, in the chain and among the settings.
//
// Licence: Apache-2.0

module proof (
  input clk, input rst, input request, input writes, input [5:0] host_place, input [17:0] host_word, input load,
  input in_use, input [5:0] place
);

  wire write_done, read_done, waits, taken, c_write;
  wire [17:0] read_word, c_word;
  wire [5:0] c_place;
  wire [527:0] coefficients;
  wire [15:0] bound_current, bound_neutral, bound_phase;
  wire [5:0] horizon;
  wire [1:0] weight_scale, l_mode;
  wire [11:0] budget;
  wire [2:0] f_q_midpoint, f_q_phase;
  wire two_switchings, compensate, deadlock_rule, outside_inwards;

  parameter_memory i_dut (
    .clk(clk), .rst(rst), .request(request), .writes(writes), .host_place(host_place), .host_word(host_word),
    .write_done(write_done), .read_done(read_done), .read_word(read_word), .load(load), .in_use(in_use), .waits(waits),
    .taken(taken), .c_write(c_write), .c_place(c_place), .c_word(c_word), .coefficients(coefficients),
    .bound_current(bound_current), .bound_neutral(bound_neutral), .bound_phase(bound_phase), .horizon(horizon),
    .weight_scale(weight_scale), .two_switchings(two_switchings), .budget(budget), .compensate(compensate),
    .deadlock_rule(deadlock_rule), .outside_inwards(outside_inwards), .f_q_midpoint(f_q_midpoint),
    .f_q_phase(f_q_phase), .l_mode(l_mode)
  );

  (* inside = "i_dut.active" *) wire active;
  (* inside = "i_dut.fetched" *) wire fetched;
  (* inside = "i_dut.fetched_at" *) wire [5:0] fetched_at;
  (* inside = "i_dut.clearing" *) wire clearing;
  (* inside = "i_dut.blank" *) wire blank;
  (* inside = "i_dut.next_place" *) wire [5:0] next_place;
  (* inside = "i_dut.written" *) wire written;
  (* inside = "i_dut.mask" *) wire [17:0] mask;
  (* inside = "i_dut.written_at" *) wire [5:0] written_at;
  (* inside = "i_dut.stored_word" *) wire [17:0] stored_word;
  (* inside = "i_dut.ram_word" *) wire [17:0] ram_word;
  (* inside = "i_dut.i_words.memory", words = "64" *) wire [1151:0] memory;

  localparam CHAIN = 36, KEPT = `SLOPES ? 36 : 23;

  // bits of a word
  function [17:0] bits_of(input [5:0] p);
    bits_of = p < 36 || (p >= 54 && p <= 57) ? 18'h0ffff : (p >= 41 && p <= 51) || (p >= 60 && p <= 62) ? 18'h3ffff
              : p == 36 ? 18'h3f : p == 39 ? 18'hfff : p == 58 || p == 59 ? 18'h7 : p == 37 || p == 63 ? 18'h3 : 18'h1;
  endfunction

  // whether the chain has a word: without SLOPES not theirs
  function kept(input [6:0] p);
    kept = p < CHAIN && (`SLOPES || !((p >= 4 && p <= 7) || p == 10 || p == 11 || p == 14 || p == 15
                                      || (p >= 23 && p <= 26) || p == 32));
  endfunction

  // how many words of the chain stand before a place
  function [5:0] rank(input [6:0] p);
    integer k;
    begin
      rank = 0;
      for (k = 0; k < CHAIN; k = k + 1) rank = rank + (k < p && kept(k));
    end
  endfunction

  // word of a rank
  function [15:0] chained(input [575:0] words, input [5:0] r);
    integer k;
    begin
      chained = 0;
      for (k = 0; k < CHAIN; k = k + 1) chained = chained | (kept(k) && rank(k) == r ? words[16 * k +: 16] : 16'h0);
    end
  endfunction

  // word of the host's memory
  function [17:0] word_of(input [1151:0] words, input [5:0] p);
    integer k;
    begin
      word_of = 0;
      for (k = 0; k < 64; k = k + 1) if (p == k) word_of = word_of | words[18 * k +: 18];
    end
  endfunction

  // a setting, and which bits are
  wire [17:0] setting = place == 36 ? horizon : place == 37 ? weight_scale : place == 38 ? two_switchings
                        : place == 39 ? budget : place == 40 ? compensate : place == 52 ? deadlock_rule
                        : place == 53 ? outside_inwards : place == 58 ? f_q_midpoint : place == 59 ? f_q_phase : l_mode;
  wire is_setting = (place >= 36 && place <= 40) || place == 52 || place == 53 || place == 58 || place == 59 || place == 63;

  wire [575:0] chain = {bound_phase, bound_neutral, bound_current, coefficients};
  wire [607:0] in_force = {chain, horizon, weight_scale, two_switchings, budget, compensate, deadlock_rule,
                           outside_inwards, f_q_midpoint, f_q_phase, l_mode};
  wire [17:0] stored = word_of(memory, place);
  wire busy = active || fetched || taken;

  reg [5:0] watched;        // the place that is watched
  reg sure;                 // there was no reset in the clock before
  reg was_waiting, was_taken, was_in_use, was_request, was_reading, could_change;
  reg [5:0] was_place;
  reg [17:0] was_word;
  reg [607:0] was_in_force;
  reg [17:0] host;          // what the host wrote at the place last, zero since a reset
  reg [17:0] copied;        // what the observer's memory got there last
  reg changed;              // the host has written there since

  // an access comes behind the done of the one before; while words wait none is written, and no use of them begins
  wire assume_the_same_is_watched = place == watched;
  wire assume_one_access = !(request && was_request);
  wire assume_no_write = !(request && writes && waits);
  wire assume_no_use_begins = !(was_waiting && !was_in_use && in_use);

  always @(posedge clk) begin
    watched <= place;
    sure <= !rst;
    was_waiting <= waits || rst;
    was_taken <= taken;
    was_in_use <= in_use && !rst;
    was_request <= request && !rst;
    was_reading <= request && !writes && !rst;
    was_place <= host_place;
    was_word <= host_word;
    could_change <= waits && !in_use;
    was_in_force <= in_force;
    if (written && written_at == place) begin
      host <= was_word & bits_of(place);
      changed <= 1;
    end
    if (c_write && c_place == place) begin
      copied <= c_word;
      changed <= 0;
    end
    if (rst) begin
      host <= 0;
      changed <= 0;
    end
  end

  // the place whose word goes to the observer next, 64 between two copies; what stands before it is in force
  wire [6:0] fetching = fetched ? fetched_at : active ? next_place : 64;
  wire [6:0] coming = c_write ? c_place : fetching;
  wire passed = place < coming;
  wire [5:0] moved = rank(coming);

  wire fact_waits = !busy || waits;
  wire fact_order = !(taken && (active || fetched)) && (active || next_place == 0)
                    && (!fetched || fetched_at == next_place - 6'd1) && !(fetched && active && next_place == 0);
  wire fact_clearing = (!clearing || mask == 0) && (!clearing || active || fetched) && (!fetched || clearing == blank);
  wire fact_sends = !c_write || (waits && fetching == c_place + 7'd1);
  wire fact_ends = !taken || (c_write && c_place == 63);
  wire fact_unused = !(busy || c_write) || (was_waiting && !was_in_use);
  wire fact_unwritten = !(busy && written) && (!written || was_request);
  wire fact_written = !written || (written_at == was_place && stored_word == (was_word & bits_of(written_at)));
  wire fact_cleared = !clearing || (host == 0 && (stored == 0 || (active && next_place <= place)));
  wire fact_stored = clearing || stored == host;
  wire fact_fetched = !(fetched && fetched_at == place && !blank) || ram_word == host;
  wire fact_sent = !(c_write && c_place == place) || c_word == host;
  wire fact_masked = (host & ~bits_of(place)) == 0;
  wire fact_copied = !passed || changed || copied == host;
  wire fact_same = !(busy && passed) || !changed;
  wire fact_chained = !(passed && kept(place)) || chained(chain, KEPT - moved + rank(place)) == copied[15:0];
  wire fact_set = !(passed && is_setting) || setting == copied;

  wire prove_words_in_force_stay = !sure || in_force == was_in_force || could_change;
  wire prove_the_observers_words_stay = !c_write || (waits && !in_use);
  wire prove_a_copy_is_whole = !(sure && was_taken) || (copied == host && (!kept(place) || chained(chain, rank(place)) == host[15:0])
                                          && (!is_setting || setting == host));
  wire prove_reads_are_what_was_written = !(was_reading && was_place == place) || (read_done && read_word == host);
  wire prove_waits_end_with_a_copy = !sure || !was_waiting || waits || was_taken;

endmodule
