// Proof that recorder holds nothing up: what is another's passes the bus in its clock, unchanged, both ways, whatever
// the recorder does; its own accesses are answered in time; a trip ends a recording in time, and then nothing moves.
//
// Licence: Apache-2.0

module proof (
  input clk, input rst, input begins, input busy, input decided, input [512:0] step_words, input deadlock, input saturated,
  input tripped, input [9:0] awaddr, input [31:0] wdata, input m_awvalid, input m_wvalid, input m_bready,
  input [9:0] araddr, input m_arvalid, input s_awready, input s_wready, input s_bvalid,
  input [1:0] s_bresp, input s_arready, input s_rvalid, input [1:0] s_rresp,
  input takes
);

  wire m_awready, m_wready, m_bvalid, m_arready, m_rvalid, own_data, s_awvalid, s_wvalid, s_bready, s_arvalid, s_rready;
  wire [1:0] m_bresp, m_rresp;
  wire [31:0] m_rdata;

  recorder i_dut (
    .clk(clk), .rst(rst), .begins(begins), .busy(busy), .decided(decided), .step_words(step_words), .deadlock(deadlock),
    .saturated(saturated), .tripped(tripped), .awaddr(awaddr), .wdata(wdata), .m_awvalid(m_awvalid),
    .m_awready(m_awready), .m_wvalid(m_wvalid), .m_wready(m_wready), .m_bready(m_bready), .m_bvalid(m_bvalid),
    .m_bresp(m_bresp), .araddr(araddr), .m_arvalid(m_arvalid), .m_arready(m_arready), .m_rready(m_rready), .own_data(own_data),
    .m_rvalid(m_rvalid), .m_rdata(m_rdata), .m_rresp(m_rresp), .s_awvalid(s_awvalid), .s_awready(s_awready),
    .s_wvalid(s_wvalid), .s_wready(s_wready), .s_bready(s_bready), .s_bvalid(s_bvalid), .s_bresp(s_bresp),
    .s_arvalid(s_arvalid), .s_arready(s_arready), .s_rready(s_rready), .s_rvalid(s_rvalid),
    .s_rresp(s_rresp)
  );

  (* inside = "i_dut.r" *) wire [56:0] r;
  (* inside = "i_dut.b" *) wire [21:0] b;
  (* inside = "i_dut.shown_record" *) wire [31:0] shown_record;
  (* inside = "i_dut.shown_status" *) wire [31:0] shown_status;
  (* inside = "i_dut.shown_settings" *) wire [31:0] shown_settings;
  (* inside = "i_dut.shown_compare" *) wire [31:0] shown_compare;
  (* inside = "i_dut.looked_at" *) wire [4:0] looked_at;
  wire fetched = r[18], stores = r[19], hit = r[27], closes = r[28], fires = r[30], full = r[34], recording = r[35];
  wire triggered = r[36], was_tripped = r[54];
  wire [4:0] now = r[26:22];
  wire [2:0] row = r[33:31];
  wire written = b[0], arm = b[2], looks = b[4], there = b[5], answered = b[6], shows = b[7], on_trip = b[9];

  wire own_write = awaddr[9:7] == 7, own_read = araddr[9:7] == 7;

  reg write_mine, write_theirs;  // a write of the recorder is under way, one of the registers
  reg read_mine, read_theirs;
  reg kept_mine, kept_theirs;    // the gate has the answer, the master has not taken it
  reg showed;                    // shows, a clock ago
  reg [31:0] data;               // m_rdata, likewise
  reg [2:0] age;                 // clocks since the read was taken
  reg sure;                      // there was no reset in the clock before
  reg pending;                   // a trip has come that has to stop the recording
  reg held;                      // it had stopped, and was not armed
  reg [3:0] was;

  // the gates let one write and one read through at a time and take an answer at once, and the registers answer what
  // they have taken
  wire assume_one_write = !((write_mine || write_theirs) && (m_awvalid || m_wvalid)) && m_awvalid == m_wvalid;
  wire assume_one_read = !((read_mine || read_theirs || kept_mine || kept_theirs) && m_arvalid);
  wire assume_answers = (!s_bvalid || write_theirs) && (!s_rvalid || read_theirs);

  wire m_rready = !(kept_mine || kept_theirs);
  wire write_taken = m_awvalid && m_awready, read_taken = m_arvalid && m_arready;

  always @(posedge clk) begin
    sure <= !rst;
    write_mine <= !rst && ((write_taken && own_write) || (write_mine && !(m_bvalid && m_bready)));
    write_theirs <= !rst && ((write_taken && !own_write) || (write_theirs && !(m_bvalid && m_bready)));
    read_mine <= !rst && ((read_taken && own_read) || (read_mine && !(m_rvalid && m_rready)));
    read_theirs <= !rst && ((read_taken && !own_read) || (read_theirs && !(m_rvalid && m_rready)));
    kept_mine <= !rst && (kept_mine ? !takes : read_mine && m_rvalid && m_rready);
    kept_theirs <= !rst && (kept_theirs ? !takes : read_theirs && m_rvalid && m_rready);
    showed <= shows;
    data <= m_rdata;
    age <= read_mine ? age + 1 : 1;
    pending <= !rst && !arm && recording && !triggered && (pending || (tripped && !was_tripped && on_trip));
    held <= !rst && !arm && !recording;
    was <= {full, row};
  end

  wire fact_write = written == write_mine;
  wire fact_one_write = !(write_mine && write_theirs);
  wire fact_read = read_mine == (looks || there || answered);
  wire fact_one_read = read_mine + read_theirs + kept_mine + kept_theirs <= 1 && looks + there + answered <= 1;
  wire fact_shows = shows || !(there || answered || kept_mine);
  wire fact_shows_no_longer = !(shows && (read_theirs || kept_theirs)) && !(showed && kept_theirs);
  wire fact_zero = shows || showed || m_rdata == 0;
  wire fact_one_is_shown = !(answered || kept_mine)
    || ((looked_at[4] || shown_record == 0) && ((!looked_at[4] && looked_at[1:0] == 0) || shown_status == 0)
    && ((!looked_at[4] && looked_at[1:0] == 1) || shown_settings == 0)
    && ((!looked_at[4] && looked_at[1:0] == 2) || shown_compare == 0));
  wire fact_age = !read_mine || (age >= 1 && age <= 5);
  wire fact_fetches_stop = !(looks && age >= 2) || !fetched;
  wire fact_stores_stop = !(looks && age >= 3) || !stores;
  wire fact_looks_ends = (!looks || age <= 3) && (!there || age <= 4);
  wire fact_pending = !pending || hit || now != 0 || (closes && fires) || triggered || !recording;

  wire prove_writes_of_others_pass = own_write || write_mine
    || {s_awvalid, s_wvalid, m_awready, m_wready} == {m_awvalid, m_wvalid, s_awready, s_wready};
  wire prove_responses_of_others_pass = write_mine || {s_bready, m_bvalid, m_bresp} == {m_bready, s_bvalid, s_bresp};
  wire prove_reads_of_others_pass = own_read || read_mine || {s_arvalid, m_arready} == {m_arvalid, s_arready};
  wire prove_data_of_others_passes = read_mine
    || ({s_rready, m_rvalid} == {m_rready, s_rvalid} && (!s_rvalid || {own_data, m_rresp} == {1'b0, s_rresp}));
  wire prove_nothing_is_added_to_the_data_of_others = !kept_theirs || m_rdata == 0;
  wire prove_its_own_data_stands = !kept_mine || m_rdata == data;
  wire prove_its_own_stay_here = !(own_write && (s_awvalid || s_wvalid)) && !(own_read && s_arvalid);
  wire prove_its_own_are_taken_at_once = (!(own_write && m_awvalid) || (m_awready && m_wready))
    && (!(own_read && m_arvalid) || m_arready);
  wire prove_its_own_are_answered_in_time = (!write_mine || m_bvalid) && (!read_mine || age < 5 || m_rvalid);
  wire prove_a_trip_is_never_lost = fact_pending;
  wire prove_what_it_holds_stays = !(held && sure) || (!recording && {full, row} == was);

endmodule
