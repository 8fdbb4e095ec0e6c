// Proof that a system's guard works with the settings of its registers whenever control.enable is set, on the system as
// it is: register block, gates of the bus, shell and, with MPDCC, the memory of parameters.
//
// The register block holds a write for a clock and more before the register has it, so what it holds is followed.
//
// FLUX_CONTROL: there with mptc_system.  EXPLORERS: there with mpdcc_system.
// Licence: Apache-2.0

module proof (
  input clk, input rst, input enable, input external_trip, input start, input [15:0] is_alpha, input [15:0] is_beta,
  input [15:0] omega_r, input [15:0] v_dc, input s_axil_awvalid, input [9:0] s_axil_awaddr, input [2:0] s_axil_awprot,
  input s_axil_wvalid, input [31:0] s_axil_wdata, input [3:0] s_axil_wstrb, input s_axil_bready, input s_axil_arvalid,
  input [9:0] s_axil_araddr, input [2:0] s_axil_arprot, input s_axil_rready, input [15:0] psis_alpha,
  input [15:0] psis_beta, input [15:0] torque_ref, input [14:0] psi_ref, input [2:0] u, input [15:0] psir_alpha,
  input [15:0] psir_beta, input [15:0] v_n, input [15:0] v_ph_a, input [15:0] v_ph_b, input [15:0] v_ph_c,
  input [15:0] iref_alpha, input [15:0] iref_beta, input [15:0] omega_s, input [2:0] s_prev_a, input [2:0] s_prev_b,
  input [2:0] s_prev_c, input second_clock
);

`ifdef FLUX_CONTROL
  mptc_system i_dut (
    .psis_alpha(psis_alpha), .psis_beta(psis_beta), .torque_ref(torque_ref), .psi_ref(psi_ref), .u(u),
`else
  mpdcc_system i_dut (
    .psir_alpha(psir_alpha), .psir_beta(psir_beta), .v_n(v_n), .v_ph_a(v_ph_a), .v_ph_b(v_ph_b), .v_ph_c(v_ph_c),
    .iref_alpha(iref_alpha), .iref_beta(iref_beta), .omega_s(omega_s), .s_prev_a(s_prev_a), .s_prev_b(s_prev_b),
    .s_prev_c(s_prev_c),
`endif
    .clk(clk), .rst(rst), .enable(enable), .external_trip(external_trip), .start(start), .is_alpha(is_alpha),
    .second_clock(second_clock),
    .is_beta(is_beta), .omega_r(omega_r), .v_dc(v_dc), .s_axil_awvalid(s_axil_awvalid), .s_axil_awaddr(s_axil_awaddr),
    .s_axil_awprot(s_axil_awprot), .s_axil_wvalid(s_axil_wvalid), .s_axil_wdata(s_axil_wdata),
    .s_axil_wstrb(s_axil_wstrb), .s_axil_bready(s_axil_bready), .s_axil_arvalid(s_axil_arvalid),
    .s_axil_araddr(s_axil_araddr), .s_axil_arprot(s_axil_arprot), .s_axil_rready(s_axil_rready)
  );

  // the register block: what it holds, and what it has answered
  (* inside = "i_dut.i_registers.axil_awvalid" *) wire held;
  (* inside = "i_dut.i_registers.axil_wvalid" *) wire held_word;
  (* inside = "i_dut.i_registers.axil_awaddr" *) wire [9:0] held_at;
  (* inside = "i_dut.i_registers.axil_wdata" *) wire [31:0] held_data;
  (* inside = "i_dut.i_registers.axil_n_in_flight" *) wire [1:0] in_flight;
  (* inside = "i_dut.i_registers.axil_resp_rptr" *) wire [1:0] answer_begin;
  (* inside = "i_dut.i_registers.axil_resp_wptr" *) wire [1:0] answer_end;
  (* inside = "i_dut.i_registers.axil_resp_buffer" *) wire [67:0] answer;
  (* inside = "i_dut.i_registers.cpuif_req_stall_sr" *) wire stalls;
  (* inside = "i_dut.i_registers.readback_done_rt" *) wire reading;
  (* inside = "i_dut.i_registers.external_pending", when = "EXPLORERS" *) wire outside;
  (* inside = "i_dut.i_registers.readback_external_rd_ack", when = "EXPLORERS" *) wire word_shown;
  (* inside = "i_dut.i_parameters.written", when = "EXPLORERS" *) wire word_written;
  (* inside = "i_dut.i_parameters.read_done", when = "EXPLORERS" *) wire word_read;

  // the shell
  (* inside = "i_dut.i_shell.i_gate.r" *) wire [3:0] gate;
  (* inside = "i_dut.i_shell.i_rules.uncommitted" *) wire uncommitted;
  (* inside = "i_dut.i_shell.i_rules.enabled" *) wire enabled;
  (* inside = "i_dut.i_shell.i_rules.commit" *) wire commit;
  (* inside = "i_dut.i_shell.pending" *) wire waiting;
  (* inside = "i_dut.i_shell.settings_dead_time" *) wire [11:0] dead_time;
  (* inside = "i_dut.i_shell.settings_minimum_on" *) wire [11:0] minimum_on;
  (* inside = "i_dut.i_shell.settings_minimum_off" *) wire [11:0] minimum_off;
  (* inside = "i_dut.i_shell.settings_decision_limit" *) wire [15:0] decision_limit;
  (* inside = "i_dut.i_shell.settings_watchdog" *) wire [15:0] watchdog;
  (* inside = "i_dut.i_shell.settings_current_limit" *) wire [15:0] current_limit;
  (* inside = "i_dut.i_shell.settings_link_high" *) wire [15:0] link_high;
  (* inside = "i_dut.i_shell.settings_link_low" *) wire [15:0] link_low;
  (* inside = "i_dut.i_shell.settings_speed_limit" *) wire [15:0] speed_limit;
  (* inside = "i_dut.i_shell.settings_frozen" *) wire [7:0] frozen;
  (* inside = "i_dut.i_shell.bands", when = "EXPLORERS" *) wire [47:0] bands;
  (* inside = "i_dut.i_shell.in_force" *) wire [139:0] guard_in_force;
  (* inside = "i_dut.i_shell.bands_in_force", when = "EXPLORERS" *) wire [47:0] bands_in_force;

  localparam CONTROL = 3;  // word of control
  localparam GUARD = 1;    // block of the guard's registers

  wire [187:0] settings = {bands, frozen, speed_limit, link_low, link_high, current_limit, watchdog, decision_limit,
                           minimum_off, minimum_on, dead_time};
  wire same = {bands_in_force, guard_in_force} == settings;

  wire owed = gate[0] && !gate[1];  // the block has taken a write and not answered it
  wire [1:0] level = answer_end - answer_begin;
  wire first = answer_begin[0];
  wire [1:0] answers = (level != 0 && (first ? answer[34] : answer[0]))
                       + (level == 2 && (first ? answer[0] : answer[34]));
  wire sets = held && held_at[9:6] == GUARD;
  wire enables = held && held_at[9:2] == CONTROL && held_data[0];

  reg was_enabled, was_waiting, sure;
  reg [187:0] settings_last;

  always @(posedge clk) begin
    sure <= !rst;
    was_enabled <= enabled;
    was_waiting <= waiting;
    settings_last <= settings;
  end

  wire fact_level = level <= 2 && in_flight <= 2 && in_flight == level + reading + outside;
  wire fact_outside = outside == 2'd0 + word_written + word_read + word_shown;
  wire fact_reading = !reading || (stalls && !outside);
  wire fact_pair = held == held_word;
  wire fact_one_write = owed == held + answers + word_written;

  wire fact_commit = !commit || (owed && !held);
  wire fact_sets = !sets || (uncommitted && !waiting && !commit && !enabled);
  wire fact_same = uncommitted || sets || waiting || same;
  wire fact_enables = !enables || (same && !uncommitted && !waiting && !commit);
  wire fact_enabled = !enabled || (same && !uncommitted && !sets);

  wire prove_settings_in_force_while_enabled = !enabled || same;
  wire prove_settings_are_locked = !(sure && was_enabled) || settings == settings_last;
  wire prove_no_enable_while_a_commit_waits = !(sure && enabled && !was_enabled) || !was_waiting;

endmodule
