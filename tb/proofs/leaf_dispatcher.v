// Proof that leaf_dispatcher gives every leaf of a node once, to one explorer, in the published number of clocks.
//
// One leaf is watched: any one, by the numbers of its positions among those that follow.
//
// EXPLORERS: as leaf_dispatcher's.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input load, input [5:0] visit_index, input [8:0] visit_position, input [3:0] visit_effort,
  input [5:0] visit_length, input visit_bank, input [2:0] negative,
  input [1:0] of_a, input [1:0] of_b, input [1:0] of_c  // the leaf that is watched
);

  localparam N = `EXPLORERS;
  localparam STEP = N < 4 ? N : 4;  // positions of phase c a clock

  wire ready, ending, active, launch;
  wire [N-1:0] leaf_valid;
  wire [21*N-1:0] leaf;

  leaf_dispatcher i_dut (
    .clk(clk), .rst(rst), .load(load), .visit_index(visit_index), .visit_position(visit_position),
    .visit_effort(visit_effort), .visit_length(visit_length), .visit_bank(visit_bank), .negative(negative),
    .ready(ready), .ending(ending), .active(active), .launch(launch), .leaf_valid(leaf_valid), .leaf(leaf)
  );

  (* inside = "i_dut.running" *) wire running;
  (* inside = "i_dut.fresh" *) wire fresh;
  (* inside = "i_dut.from" *) wire [8:0] from;
  (* inside = "i_dut.choice_a" *) wire [1:0] a;
  (* inside = "i_dut.choice_b" *) wire [1:0] b;
  (* inside = "i_dut.choice_c" *) wire [1:0] c;
  (* inside = "i_dut.left" *) wire [3:0] left;
  (* inside = "i_dut.finished" *) wire finished;
  (* inside = "i_dut.effort_so_far" *) wire [3:0] effort_now;
  (* inside = "i_dut.bank_now" *) wire bank_now;
  (* inside = "i_dut.place" *) wire [5:0] index_now;

  `include "switch_graph.vh"

  wire assume_load = !load || ready;

  reg [5:0] of_last;
  wire assume_the_same_is_watched = {of_a, of_b, of_c} == of_last;

  reg [8:0] from_out;          // the node whose leaves are out
  reg [5:0] index_in, index_out;
  reg bank_in, bank_out;
  reg [3:0] effort_in, effort_out;
  reg out, last_out;           // leaves are out, the last ones of the node
  reg [1:0] before;            // how often it has come, up to 3
  reg [6:0] clocks;            // since the node was loaded

  wire there = of_a < count(from_out[8:6]) && of_b < count(from_out[5:3]) && of_c < count(from_out[2:0]);
  wire [8:0] position = {next(from_out[8:6], of_a), next(from_out[5:3], of_b), next(from_out[2:0], of_c)};
  wire [4:0] cost = effort_out + effort(from_out[8:6], position[8:6]) + effort(from_out[5:3], position[5:3])
                    + effort(from_out[2:0], position[2:0]);

  integer i;
  reg [3:0] hits;
  reg whole;  // effort, place and bank are right
  reg [20:0] one;
  always @* begin
    hits = 0;
    whole = 1;
    for (i = 0; i < N; i = i + 1) begin
      one = leaf[21*(N-1-i) +: 21];
      if (leaf_valid[i] && there && one[8:0] == position) begin
        hits = hits + 1;
        if (one[13:9] != cost || one[14] != bank_out || one[20:15] != index_out) whole = 0;
      end
    end
  end

  wire [3:0] total = (launch ? 0 : before) + hits;

  always @(posedge clk) begin
    of_last <= {of_a, of_b, of_c};
    from_out <= from;
    index_out <= index_in;
    bank_out <= bank_in;
    effort_out <= effort_in;
    out <= !rst && running;
    last_out <= !rst && running && finished;
    before <= total > 3 ? 3 : total;
    clocks <= clocks + 1;
    if (load) begin
      index_in <= visit_index;
      bank_in <= visit_bank;
      effort_in <= visit_effort;
      clocks <= 0;
    end
  end

  wire [2:0] count_a = count(from[8:6]), count_b = count(from[5:3]), count_c = count(from[2:0]);
  wire [2:0] rounds = (count_c + STEP - 1) / STEP;
  wire inside_node = of_a < count_a && of_b < count_b && of_c < count_c;
  wire has_come = {of_a, of_b} < {a, b} || ({of_a, of_b} == {a, b} && of_c < c);
  wire [6:0] blocks = a * count_b + b;

  wire fact_range = !running || (a < count_a && b < count_b && c < count_c && c % STEP == 0);
  wire fact_left = !running || left == count_a * count_b - 1 - blocks;
  wire fact_runs = !fresh || running;
  wire fact_fresh = !(running && fresh) || (a == 0 && b == 0 && c == 0);
  wire fact_node = !running || (effort_now == effort_in && bank_now == bank_in && index_now == index_in);
  wire fact_out = out == (leaf_valid != 0);
  wire fact_launch = !launch || out;
  wire fact_same = !(running && !fresh) || (out && !last_out && from_out == from && index_out == index_in
                   && bank_out == bank_in && effort_out == effort_in);
  wire fact_others = fresh || running || !out || last_out;
  wire fact_total = !(running && !fresh && inside_node) || total == has_come;
  wire fact_clocks = !running || clocks == blocks * rounds + c / STEP;

  wire prove_each_once = !(last_out && there) || total == 1;
  wire prove_none_twice = !(out && there) || total <= 1;
  wire prove_as_the_node_says = !out || whole;
  wire prove_in_time = !running || clocks < count_a * count_b * rounds;
  wire prove_no_leaf_without_a_node = out || leaf_valid == 0;

endmodule
