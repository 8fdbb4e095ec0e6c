// Proof that node_queue shows every node that was put in once: the latest of those with the smallest effort.
//
// One list is watched, any one, of its places one, and for the slopes one candidate. What the list should hold is told anew, as a stack.
//
// EFFORTS, LAST_HEAD: how many efforts a candidate can have, and the last bit of a place for each.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input clear, input open_root, input slope_valid, input [5:0] slope_index,
  input [33:0] slope, input evaluated_valid, input [5:0] index, input [3:0] evaluated_effort, input [5:0] length,
  input [5:0] horizon, input [8:0] previous, input taken,
  input [3:0] watched_list, input [6:0] watched_depth, input [5:0] watched_place
);

  localparam LISTS = `EFFORTS;  // from 0 on

  wire whole, valid, empty;
  wire [5:0] entry_index, entry_length;
  wire [8:0] entry_position;
  wire [3:0] entry_effort;
  wire [33:0] entry_slope;

  node_queue i_dut (
    .clk(clk), .rst(rst), .clear(clear), .open_root(open_root), .evaluated_slope_valid(slope_valid),
    .evaluated_slope_index(slope_index), .evaluated_slope(slope), .evaluated_unfit(1'b0),
    .evaluated_valid(evaluated_valid), .evaluated_index(index), .evaluated_effort(evaluated_effort), .evaluated_length(length),
    .evaluated_cost(31'b0), .evaluated_saturated(1'b0), .horizon(horizon), .previous(previous), .taken(taken),
    .whole(whole), .valid(valid), .entry_index(entry_index), .entry_position(entry_position),
    .entry_effort(entry_effort), .entry_length(entry_length), .entry_slope(entry_slope), .empty(empty)
  );

  // its registers and memories; a link is length, more, next place
  (* inside = "i_dut.used" *) wire [LISTS - 1:0] used;
  (* inside = "i_dut.stage" *) wire [1:0] stage;
  (* inside = "i_dut.lowest" *) wire [3:0] lowest;
  (* inside = "i_dut.place" *) wire [5:0] place;
  (* inside = "i_dut.link_in" *) wire [12:0] link_in;
  (* inside = "i_dut.link" *) wire [12:0] link;
  (* inside = "i_dut.i_slopes.word" *) wire [33:0] slope_on_way;
  (* inside = "i_dut.heads", words = "`EFFORTS" *) wire [`LAST_HEAD:0] heads;
  (* inside = "i_dut.i_links.memory", words = "64" *) wire [831:0] links;
  (* inside = "i_dut.i_slopes.memory", words = "64" *) wire [2175:0] slopes;
  localparam CHOOSE = 0, READ = 1, SHOW = 2;

  `include "switch_graph.vh"

  reg [16:0] watched_last;
  wire [16:0] watched = {watched_list, watched_depth, watched_place};
  wire assume_the_same_is_watched = watched == watched_last && watched_list < LISTS && watched_depth < 64;
  wire assume_effort = evaluated_effort < LISTS;

  // once the root is closed nothing comes in before clear
  reg closed;
  wire assume_closed = !(closed && open_root && (evaluated_valid || slope_valid));
  wire assume_taken = !taken || (valid && !open_root);

  // the list that is watched, as a stack of lengths and places, and the places of all that came
  reg [6:0] depth;
  reg [11:0] stack [0:63];
  reg [63:0] came;
  wire put = open_root && evaluated_valid && length != horizon;
  wire push = put && evaluated_effort == watched_list;
  wire pop = taken && entry_effort == watched_list;
  wire assume_once = !put || !came[index];
  wire assume_room = !(push && depth == 64);  // there are 64 places, and each comes once

  // the link that was stored last for the place that is watched
  reg has_link;
  reg [12:0] own_link;

  // the slope that was stored last for the place that is watched
  reg has_slope;
  reg [33:0] own_slope;
  reg second;  // the entry is shown for the second clock, or later

  reg sure;      // there was no reset in the clock before
  reg had_none;  // the list was without entries in the clock before

  always @(posedge clk) begin
    watched_last <= watched;
    if (!open_root) closed <= 1;
    if (push) begin
      stack[depth[5:0]] <= {length, index};
      depth <= depth + 1;
    end
    if (pop) depth <= depth - 1;
    if (put) came[index] <= 1;
    if (put && index == watched_place) begin
      has_link <= 1;
      own_link <= link_in;
    end
    if (open_root && slope_valid && slope_index == watched_place) begin
      has_slope <= 1;
      own_slope <= slope;
    end
    second <= valid && !taken && !rst && !clear;
    sure <= !rst;
    had_none <= depth == 0;
    if (rst || clear) begin
      closed <= 0;
      depth <= 0;
      came <= 0;
    end
    if (rst) begin
      has_link <= 0;
      has_slope <= 0;
    end
  end

  wire [11:0] top = stack[depth[5:0] - 6'd1];
  wire [11:0] below = stack[depth[5:0] - 6'd2];
  wire shown = lowest == watched_list && stage != CHOOSE;

  function [12:0] link_of(input [831:0] words, input [5:0] i);
    integer k;
    begin
      link_of = 0;
      for (k = 0; k < 64; k = k + 1) if (i == k) link_of = link_of | words[13 * k +: 13];
    end
  endfunction

  function [33:0] slope_of(input [2175:0] words, input [5:0] i);
    integer k;
    begin
      slope_of = 0;
      for (k = 0; k < 64; k = k + 1) if (i == k) slope_of = slope_of | words[34 * k +: 34];
    end
  endfunction

  // the second word of the slopes stands on the left in memory
  wire [33:0] own_word = {own_slope[16:0], own_slope[33:17]};

  // a place of the stack holds what the link of its candidate holds, if it is in use
  function fits(input [6:0] d, input [11:0] own, input [11:0] under, input [12:0] word, input there);
    fits = d >= depth || (there && word[12:7] == own[11:6] && word[6] == (d != 0)
                          && (d == 0 || word[5:0] == under[5:0]));
  endfunction

  wire [11:0] own = stack[watched_depth[5:0]], under = stack[watched_depth[5:0] - 6'd1];

  wire fact_stage = stage <= SHOW;
  wire fact_depth = depth <= 64;
  wire fact_used = used[watched_list] == (depth != 0);
  wire fact_head = depth == 0 || heads[6 * watched_list +: 6] == top[5:0];

  wire fact_came = !came[watched_place] || has_link;
  wire fact_link = own[5:0] != watched_place || fits(watched_depth, own, under, own_link, came[watched_place]);
  wire given_link_of_the_top = fits(depth - 1, top, below, link_of(links, top[5:0]), came[top[5:0]]);

  wire fact_closed = stage == CHOOSE || closed;
  wire fact_shown = !shown || (depth != 0 && place == top[5:0]);
  wire fact_lowest = stage == CHOOSE || depth == 0 || lowest <= watched_list;
  wire fact_word = !(shown && stage == SHOW) || (link[12:7] == top[11:6] && link[6] == (depth != 1)
                                                 && (depth == 1 || link[5:0] == below[5:0]));
  wire fact_memory = !has_link || link_of(links, watched_place) == own_link;
  wire fact_slope = !has_slope || slope_of(slopes, watched_place) == own_word;
  wire fact_slope_read = !(stage == SHOW && place == watched_place && has_slope) || slope_on_way == own_word;
  wire fact_slope_shown = !(second && place == watched_place && has_slope) || entry_slope == own_slope;
  wire fact_second = !second || stage == SHOW;

  wire prove_latest = !(valid && entry_effort == watched_list)
                      || (depth != 0 && entry_index == top[5:0] && entry_length == top[11:6]);
  wire prove_of_the_smallest_effort = !(valid && depth != 0) || entry_effort <= watched_list;
  wire prove_none_lost = !(empty && sure) || had_none;
  wire [5:0] is = entry_index;
  wire exists = is[5:4] < count(previous[8:6]) && is[3:2] < count(previous[5:3]) && is[1:0] < count(previous[2:0]);
  wire prove_position = !(valid && exists) || entry_position == {next(previous[8:6], is[5:4]),
                                                     next(previous[5:3], is[3:2]),
                                                     next(previous[2:0], is[1:0])};
  wire prove_slope = !(second && entry_index == watched_place && has_slope) || entry_slope == own_slope;
  wire prove_whole = whole == (open_root && evaluated_valid && length == horizon);

endmodule
