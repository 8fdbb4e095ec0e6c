// Proof that binary_search finds the largest length, for every x and y, with both exits, in the published time.
//
// x times a number is formed beside the search, without a multiplication: number and product begin at zero, and
// where the number grows by 2**j the product grows by 2**j x.
//
// WIDTH, LENGTH_WIDTH: as binary_search's.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input start,
  input [`WIDTH-1:0] x, input [`WIDTH-1:0] y, input [`LENGTH_WIDTH:0] lower, input [`LENGTH_WIDTH-1:0] upper
);

  localparam W = `WIDTH;
  localparam L = `LENGTH_WIDTH;
  localparam S = W + L + 1;  // bits of a product, and one more

  wire done, below;
  wire [L-1:0] length;

  binary_search i_dut (
    .clk(clk), .rst(rst), .start(start), .x(x), .y(y), .lower(lower), .upper(upper),
    .done(done), .below(below), .length(length)
  );

  // its registers; most: the largest length that is still possible
  (* inside = "i_dut.r" *) wire [2*W+3*L+3:0] r;
  wire busy, first, below_kept, done_kept;
  wire [W+L-1:0] multiple;
  wire [W-1:0] remainder;
  wire [L-1:0] step, most;
  assign {most, step, remainder, multiple, below_kept, first, done_kept, busy} = r;

  wire tests = busy && !first;
  wire fits = remainder >= multiple;

  // what was asked, and what has been found
  reg begun;              // a search has begun since the reset
  reg all_fit;            // it ended with exit 1
  reg [W-1:0] x_asked, y_asked;
  reg [L:0] lower_asked;  // lower in the last clock of the search
  reg [L-1:0] number;
  reg [S-1:0] product;    // x times number
  reg [S-1:0] more;       // the larger number that did not fit, or was not looked at, adds this
  reg [L:0] gap;          // to the product, and this to the number
  reg [3:0] clocks;       // since start

  wire [S-1:0] x_wide = x_asked, y_wide = y_asked, rest = remainder, c = multiple;

  always @(posedge clk) begin
    clocks <= clocks + (clocks != 15);
    if (busy) begin
      all_fit <= first;
      lower_asked <= lower;
    end
    if (tests) begin
      more <= c;
      gap <= step;
      if (fits) begin
        product <= product + c;
        number <= number + step;
      end
    end
    if (start) begin
      begun <= 1;
      x_asked <= x;
      y_asked <= y;
      clocks <= 1;
      product <= 0;
      number <= 0;
    end
    if (rst) begun <= 0;
  end

  // one bit of step is set; multiple belongs to it, and the number of clocks too
  integer i;
  reg in_step, one_more;
  always @* begin
    in_step = 0;
    one_more = 0;
    for (i = 0; i < L; i = i + 1) begin
      if (step == 1 << i && c == x_wide << i && clocks == L + 1 - i) in_step = 1;
      if (gap == 1 << i && more == x_wide << i) one_more = 1;
    end
  end

  wire [L-1:0] open = {step, 1'b0} - 1'b1;  // bits that are not decided: they are ones in most

  wire fact_begun = begun || !(busy || done);
  wire fact_either = !(busy && done) && (!begun || busy || done);
  wire fact_first = !(busy && first) || (c == x_wide << L && remainder == y_asked && most == {L{1'b1}}
                    && step == 1 << (L - 1) && clocks == 1 && !below_kept && product == 0 && number == 0);
  wire fact_step = !tests || (in_step && !below_kept);
  wire fact_open = !tests || most == (number | open) && (number & open) == 0;
  wire fact_room = !tests || rest < c << 1;
  wire fact_sum = !(tests || done && !all_fit) || (product <= y_wide && product + rest == y_wide);
  wire fact_last = !(done && !below && !all_fit) || (number == most && rest < x_wide);
  wire fact_all = !(done && all_fit) || (!below && most == {L{1'b1}} && x_wide << L <= y_wide);
  wire fact_more = !below || (one_more && number + gap == most + 1 && product + more > y_wide);

  // m: most, the length before it is capped
  wire prove_fits = !(done && !below) || (all_fit ? x_wide << L <= y_wide : number == most && product <= y_wide);
  wire prove_longest = !(done && !below) || most == {L{1'b1}} || (number == most && product + x_wide > y_wide);
  wire prove_capped = !(done && !below) || length == (most < upper ? most : upper);
  wire prove_none_above = !below || (number + gap <= lower_asked && product + more > y_wide && one_more);
  wire prove_in_time = !begun || done || clocks <= L + 1;

endmodule
