// Proof that read_gate answers every read once with the registers' data, and never keeps the registers waiting.
//
// Licence: Apache-2.0

module proof (
  input clk, input rst, input m_arvalid, input m_rready, input s_arready, input s_rvalid, input [31:0] s_rdata,
  input [1:0] s_rresp, input s_stands, input [31:0] standing
);

  wire m_arready, m_rvalid, s_arvalid, s_rready;
  wire [31:0] m_rdata;
  wire [1:0] m_rresp;

  read_gate i_dut (
    .clk(clk), .rst(rst), .m_arvalid(m_arvalid), .m_arready(m_arready), .m_rready(m_rready), .m_rvalid(m_rvalid),
    .m_rdata(m_rdata), .m_rresp(m_rresp), .s_arvalid(s_arvalid), .s_arready(s_arready), .s_rready(s_rready),
    .s_rvalid(s_rvalid), .s_rdata(s_rdata), .s_rresp(s_rresp), .s_stands(s_stands), .standing(standing)
  );

  (* inside = "i_dut.r" *) wire [1:0] r;
  (* inside = "i_dut.data" *) wire [31:0] data;
  (* inside = "i_dut.resp" *) wire [1:0] resp;
  wire under_way = r[0], there = r[1];

  reg open;    // a read has been taken from the master and not been answered
  reg owed;    // the registers have taken it and not answered
  reg [33:0] said;  // what they have answered, zero for data that stands
  reg waits_r; // the answer was there and not taken
  reg [33:0] was;
  reg [31:0] stood;

  wire assume_answer = !s_rvalid || owed;
  wire assume_it_stands = !waits_r || standing == stood;

  wire taken = m_arready && m_arvalid;
  wire answered = m_rvalid && m_rready;

  always @(posedge clk) begin
    open <= !rst && (taken || (open && !answered));
    owed <= !rst && ((s_arvalid && s_arready) || (owed && !(s_rvalid && s_rready)));
    if (s_rvalid && s_rready) said <= {s_rresp, s_stands ? 32'd0 : s_rdata};
    waits_r <= !rst && m_rvalid && !m_rready;
    was <= {m_rresp, m_rdata};
    stood <= standing;
  end

  wire fact_open = open == under_way;
  wire fact_there = there == (open && !owed);
  wire fact_owed = !owed || open;
  wire fact_kept = !there || {resp, data} == said;
  wire fact_waits = !waits_r || (there && {resp, data | standing} == was);

  wire prove_one_at_a_time = !(open && taken);
  wire prove_what_is_taken_reaches_the_registers = taken == (s_arvalid && s_arready);
  wire prove_answered_once = !m_rvalid || (open && !owed);
  wire prove_the_answer_is_the_registers = !m_rvalid || {m_rresp, m_rdata} == (said | standing);
  wire prove_an_answer_stays = !waits_r || (m_rvalid && {m_rresp, m_rdata} == was);
  wire prove_the_registers_never_wait = !s_rvalid || s_rready;

endmodule
