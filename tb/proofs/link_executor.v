// Proof that link_executor acts on whole frames that wait alone, once on each, and as their rules allow.
//
// What a frame holds is free; frame_receiver has a proof of its own: what waits has passed its checks.
//
// CONTROLLER, STEP_WORDS: as link_executor's.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input control, input [1:0] pending, input [7:0] content, input shown, input [31:0] value,
  input reply_busy, input bus_done, input [31:0] bus_rdata, input [1:0] bus_response, input step_busy,
  input decision_valid, input [15:0] decision, input [7:0] decision_flags, input [7:0] decision_length,
  input [15:0] decision_cycles, input [15:0] applied, input applied_known, input enabled, input tripped,
  input [15:0] faults, input [31:0] gates
);

  wire link; wire [5:0] address; wire [1:0] served; wire [3:0] outcome; wire look; wire [4:0] index;
  wire [1:0] reply_begins; wire reply_valid; wire [7:0] reply_data; wire reply_last; wire bus_start; wire bus_write;
  wire [15:0] bus_address; wire [31:0] bus_wdata; wire step_start; wire [16*`STEP_WORDS-1:0] measurements;
  wire [15:0] step_position;

  link_executor i_dut (
    .clk(clk), .rst(rst), .control(control), .pending(pending), .content(content), .shown(shown), .value(value),
    .reply_busy(reply_busy), .bus_done(bus_done), .bus_rdata(bus_rdata), .bus_response(bus_response),
    .step_busy(step_busy), .decision_valid(decision_valid), .decision(decision), .decision_flags(decision_flags),
    .decision_length(decision_length), .decision_cycles(decision_cycles), .applied(applied),
    .applied_known(applied_known), .enabled(enabled), .tripped(tripped), .faults(faults), .gates(gates), .link(link),
    .address(address), .served(served), .outcome(outcome), .look(look), .index(index), .reply_begins(reply_begins),
    .reply_valid(reply_valid), .reply_data(reply_data), .reply_last(reply_last), .bus_start(bus_start),
    .bus_write(bus_write), .bus_address(bus_address), .bus_wdata(bus_wdata), .step_start(step_start),
    .measurements(measurements), .step_position(step_position)
  );

  localparam IDLE = 0, FETCH = 1, CHECK = 2, BUS = 3, REPLY = 5, DONE = 4;
  localparam WRITE = 4, STEP = 5, CONTROL = 12;

  (* inside = "i_dut.r" *) wire [35:0] r;
  (* inside = "i_dut.verdict" *) wire [3:0] verdict;
  (* inside = "i_dut.accesses" *) wire accesses;
  (* inside = "i_dut.steps" *) wire steps;
  (* inside = "i_dut.next_number" *) wire next_number;
  (* inside = "i_dut.next_address" *) wire next_address;
  (* inside = "i_dut.i_step.phase" *) wire [2:0] step_phase;
  (* inside = "i_dut.i_check.type_now" *) wire [7:0] kind;
  (* inside = "i_dut.i_check.size" *) wire [7:0] size;
  (* inside = "i_dut.i_check.number_now" *) wire [31:0] number;
  (* inside = "i_dut.i_check.lasts" *) wire [61:0] lasts;
  (* inside = "i_dut.i_check.noted" *) wire noted;
  (* inside = "i_dut.i_check.fresh" *) wire fresh;
  (* inside = "i_dut.i_check.quiet" *) wire quiet;
  wire [2:0] phase = r[2:0];
  wire [5:0] place = r[9:4], asked_at = r[15:10], at = r[22:17];
  wire asked = r[16], there = r[23], resumed = r[28], intact = r[29], step_link = r[30];
  wire step_go = r[31], fetched = r[32], serves = r[35];

  wire assume_reply = !(next_number || next_address) || phase == REPLY;
  reg [1:0] pending_last, served_last;
  wire assume_waits = (pending_last & ~served_last & ~pending) == 0;

  wire accepted = phase == CHECK && verdict == 0;
  wire acts = accepted && (accesses || steps);
  wire changes = acts && (kind == WRITE || kind == STEP);

  reg [1:0] acted;  // the frame that waits has been acted upon
  reg accessed, stepped, go_last;
  reg [31:0] number_last;
  reg [61:0] lasts_last;
  reg link_last, sure;

  always @(posedge clk) begin
    pending_last <= rst ? 0 : pending;
    served_last <= served;
    acted <= rst ? 0 : (acted & ~served) | (acts << link);
    accessed <= accepted && accesses && !rst;
    stepped <= accepted && !accesses && steps && !rst;
    go_last <= step_go && !rst;
    number_last <= number;
    lasts_last <= lasts;
    link_last <= link;
    sure <= !rst;
  end

  // link 0's number stands on the left
  wire [30:0] own_last = link ? lasts[30:0] : lasts[61:31];
  wire [30:0] ahead = number[30:0] - own_last;
  wire [30:0] own_before = link_last ? lasts_last[30:0] : lasts_last[61:31];
  wire [30:0] behind = own_before - number_last[30:0];
  wire step_live = step_go || step_phase != 0;
  wire [1:0] of_step = 2'b01 << step_link;
  wire [1:0] now = 2'b01 << link;

  wire fact_phase = phase <= REPLY && step_phase <= DONE;
  wire fact_fetch = phase == FETCH || (!asked && !there);
  wire fact_places = phase != FETCH || ((!asked || asked_at == place - 6'd1) && (!there || (asked && at == place - 6'd2)));
  wire fact_begins = phase != FETCH || ((there || place <= 1) && (asked || place == 0) && (!resumed || (place <= 7 && asked == (place != 0) && there == (place >= 2))));
  wire fact_go = !step_go || (phase == IDLE && step_phase == 0);
  wire fact_resumed = !(resumed && (phase != IDLE || fetched))
                      || (step_phase == DONE && step_link == link && phase != CHECK && phase != BUS);
  wire fact_fetched = !fetched || (serves && resumed && phase == IDLE);
  wire fact_served = !serves || phase == IDLE;
  wire fact_serves_step = !(serves && step_live && step_link == link) || fetched;
  wire fact_step = !step_live || (acted & of_step) != 0;
  wire fact_acted = (acted & ~(step_live ? of_step : 2'b00)
                    & ~((serves || phase >= BUS) && phase <= REPLY ? now : 2'b00)) == 0;
  wire fact_new = !((phase == FETCH || phase == CHECK) && !resumed) || (acted & now) == 0;
  wire fact_not_twice = !(phase >= BUS && !resumed && step_live) || step_link != link;
  wire fact_pending = (phase == IDLE || (pending & now) != 0) && (acted & ~pending) == 0
                      && (!serves || (pending & now) != 0);
  wire fact_kind = !(phase >= BUS && phase <= REPLY && !resumed) || !kind[7];
  wire fact_noted = !noted || (phase != FETCH && phase != CHECK);
  wire fact_number = !(phase == CHECK && size[5:0] != 0)
                     || (number == number_last && lasts == lasts_last && link == link_last);
  wire fact_fresh = !sure || fresh == (behind[30] && number_last[31] == link_last);
  wire [5:0] zeros = at - 6'd8;  // bytes of the word that are there
  wire fact_quiet = !(phase == FETCH && there && quiet && zeros >= 1 && zeros <= 3)
                    || (bus_wdata[31:24] == 0 && (zeros < 2 || bus_wdata[23:16] == 0) && (zeros < 3 || bus_wdata[15:8] == 0));
  wire fact_word = !(phase == CHECK && quiet && size[5:0] == 6) || bus_wdata == 0;

  wire prove_frame_waits = !acts || (pending & now) != 0;
  wire prove_once = !acts || (acted & now) == 0;
  wire prove_accepted_first = bus_start == accessed && step_go == stepped && step_start == go_last;
  wire prove_new_number = !(changes && sure) || (ahead >= 1 && ahead <= 31'h40000000 && number[31] == link);
  wire prove_link_in_control = !changes || link == control
                               || (kind == WRITE && bus_address == CONTROL && bus_wdata == 0);
  wire prove_replies_are_not_answered = reply_begins == 0 || resumed || !kind[7];

endmodule
