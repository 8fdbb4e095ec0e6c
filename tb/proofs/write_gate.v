// Proof that write_gate answers every write once, lets no refused one through, and keeps the rules of AXI4-Lite.
//
// Licence: Apache-2.0

module proof (
  input clk, input rst, input hold, input refuse, input m_awvalid, input m_wvalid, input m_bready, input s_awready,
  input s_wready, input s_bvalid, input [1:0] s_bresp
);

  wire passed, m_awready, m_wready, m_bvalid, s_awvalid, s_wvalid, s_bready;
  wire [1:0] m_bresp;

  write_gate i_dut (
    .clk(clk), .rst(rst), .hold(hold), .refuse(refuse), .passed(passed), .m_awvalid(m_awvalid),
    .m_awready(m_awready), .m_wvalid(m_wvalid), .m_wready(m_wready), .m_bready(m_bready), .m_bvalid(m_bvalid),
    .m_bresp(m_bresp), .s_awvalid(s_awvalid), .s_awready(s_awready), .s_wvalid(s_wvalid), .s_wready(s_wready),
    .s_bready(s_bready), .s_bvalid(s_bvalid), .s_bresp(s_bresp)
  );

  (* inside = "i_dut.r" *) wire [3:0] r;
  wire under_way = r[0], kept = r[1];
  wire [1:0] resp = r[3:2];

  reg owed;    // the registers have taken a write and not answered it
  reg open;    // a write has been taken from the master and not been answered
  reg turned;  // it was refused
  reg given;   // the registers have answered it
  reg [1:0] said;  // with this
  reg waits_b; // the answer was there and not taken
  reg [1:0] was_resp;
  reg was_s_b, was_s_bready;
  reg [1:0] was_s_resp;

  // the registers answer what they have taken, and an answer stays until it is taken
  wire assume_answer = !s_bvalid || owed;
  wire assume_answer_stays = !was_s_b || (s_bvalid && s_bresp == was_s_resp);

  wire taken = m_awready && m_awvalid;
  wire answered = m_bvalid && m_bready;

  always @(posedge clk) begin
    owed <= !rst && ((s_awvalid && s_awready) || (owed && !(s_bvalid && s_bready)));
    open <= !rst && (taken || (open && !answered));
    if (taken) turned <= refuse;
    given <= !rst && ((s_bvalid && s_bready) || (given && !answered));
    if (s_bvalid && s_bready) said <= s_bresp;
    waits_b <= !rst && m_bvalid && !m_bready;
    was_resp <= m_bresp;
    was_s_b <= !rst && s_bvalid && !s_bready;
    was_s_resp <= s_bresp;
  end

  wire fact_open = open == under_way;
  wire fact_kept = kept == (open && (turned || given));
  wire fact_owed = owed == (open && !turned && !given);
  wire fact_given = !given || (open && !turned);
  wire fact_resp = !kept || resp == (turned ? 2'd2 : said);

  wire prove_address_and_word_together = m_awready == m_wready && s_awvalid == s_wvalid
                                         && (!m_awready || (m_awvalid && m_wvalid));
  wire prove_one_at_a_time = !(open && taken);
  wire prove_refused_ones_stay_outside = !(s_awvalid && (refuse || hold)) && s_awvalid == passed;
  wire prove_what_is_taken_passes_or_is_refused = !taken || passed != refuse;
  wire prove_answered_once = !m_bvalid || open;
  wire prove_refused_means_slverr = !(m_bvalid && turned) || m_bresp == 2;
  wire prove_the_answer_is_the_registers = !(m_bvalid && !turned) || (given && m_bresp == said);
  wire prove_the_registers_never_wait = !s_bvalid || s_bready;
  wire prove_an_answer_stays = !waits_b || (m_bvalid && m_bresp == was_resp);

endmodule
