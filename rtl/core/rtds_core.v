// rtds_core: two motor units, left and right, and the parameter unit they share.
//
// Purpose    Each strobe makes one simulation step of both motors. An input acts in the step of the strobe that
//            reads it; a parameter set acts one step later. The coefficients change all at once, between two steps.
// Handshake  strobe_i while ready_o: inputs and parameters are taken at that edge, the inputs straight into the
//            adders (give them from registers of this clock). A strobe while not ready, or together with clear_i, is
//            not taken and gives overrun_o for one clock.
//            clear_i: state and step count to zero, a step under way is dropped (no valid_o); the coefficients and
//            a parameter set under way stay.
// Latency    Counted in edges after the one that takes the strobe, always the same:
//              15  high words and valid_o (one clock); the words hold until the next
//              21  low words (scratch from the 12th on)
//              23  earliest next strobe; ready_o is seen after the 22nd
//              89  the same if the strobe brought changed parameters, 82 if those were unusable
// Format     binary32, SI at the motor shaft: V, N.m (opposing load positive), A, rad/s, ohm, H, N.m/A, V.s/rad,
//            kg.m2, N.m.s/rad, s. A state is the sum of its high and low word. One NaN: 7FC00000.
// Faults     param_fault_o: the last parameter set is unusable (zero, negative, NaN, infinite or subnormal, or such a
//            coefficient); the old coefficients stay in force. nonfinite_o: an infinity or NaN in the state; it
//            changes with the high words and lasts until clear_i.
// Start      After reset the coefficients are zero: the first step rests, and brings the first parameter set.
// Crossing   none: one clock. rst_ni is asserted asynchronously and released synchronously to clk_i.
`default_nettype none

module rtds_core (
  input  wire        clk_i,
  input  wire        rst_ni,
  input  wire        strobe_i,
  input  wire        clear_i,
  input  wire [31:0] v_l_i,
  input  wire [31:0] v_r_i,
  input  wire [31:0] t_l_i,
  input  wire [31:0] t_r_i,
  input  wire [31:0] p_r_i,
  input  wire [31:0] p_l_i,
  input  wire [31:0] p_km_i,
  input  wire [31:0] p_kb_i,
  input  wire [31:0] p_j_i,
  input  wire [31:0] p_b_i,
  input  wire [31:0] p_h_i,
  input  wire        method_i,
  output wire        valid_o,
  output wire [31:0] i_l_o,
  output wire [31:0] w_l_o,
  output wire [31:0] i_r_o,
  output wire [31:0] w_r_o,
  output wire [31:0] i_l_lo_o,
  output wire [31:0] w_l_lo_o,
  output wire [31:0] i_r_lo_o,
  output wire [31:0] w_r_lo_o,
  output wire        ready_o,
  output reg         overrun_o,
  output wire        nonfinite_o,
  output reg         param_fault_o,
  output reg  [31:0] step_count_o
);
  // ---- strobe ----------------------------------------------------------------------------------------------------
  wire idle;
  wire param_pending;
  wire accept = strobe_i & ready_o & ~clear_i;

  assign ready_o = idle & ~param_pending;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) overrun_o <= 1'b0;
    else overrun_o <= strobe_i & ~accept;
  end

  // ---- parameters: taken at the strobe, computed beside the step, committed after it -----------------------------
  wire [224:0] param_in = {method_i, p_h_i, p_b_i, p_j_i, p_kb_i, p_km_i, p_l_i, p_r_i};
  reg  [224:0] param_q;    // the last set read
  reg          seen_q;     // there was one
  reg          start_q;    // it differs from the one before
  reg          waiting_q;  // coefficients stand, not yet committed
  reg  [255:0] coef_q;     // in force
  wire [255:0] coef;
  wire         param_busy;
  wire         param_done;
  wire         fault;

  wire         commit  = waiting_q & idle;
  wire         refresh = commit & ~fault;

  assign param_pending = start_q | param_busy | param_done | waiting_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      param_q       <= 225'd0;
      seen_q        <= 1'b0;
      start_q       <= 1'b0;
      waiting_q     <= 1'b0;
      coef_q        <= 256'd0;
      param_fault_o <= 1'b0;
    end else begin
      start_q <= 1'b0;
      if (accept) begin
        start_q <= ~seen_q | (param_in != param_q);
        param_q <= param_in;
        seen_q  <= 1'b1;
      end
      if (param_done) waiting_q <= 1'b1;
      else if (commit) waiting_q <= 1'b0;
      if (commit) param_fault_o <= fault;
      if (refresh) coef_q <= coef;
    end
  end

  rtds_param_unit u_param_unit (
    .clk_i   (clk_i),
    .rst_ni  (rst_ni),
    .start_i (start_q),
    .r_i     (param_q[0+:32]),
    .l_i     (param_q[32+:32]),
    .km_i    (param_q[64+:32]),
    .kb_i    (param_q[96+:32]),
    .j_i     (param_q[128+:32]),
    .b_i     (param_q[160+:32]),
    .h_i     (param_q[192+:32]),
    .method_i(param_q[224]),
    .busy_o  (param_busy),
    .done_o  (param_done),
    .fault_o (fault),
    .coef_o  (coef)
  );

  // ---- motors ----------------------------------------------------------------------------------------------------
  wire [2:0] add_en;
  wire [1:0] mul_en;
  wire [2:0] op;
  wire [1:0] mul_sel;
  wire       save_p;
  wire       save_s;
  wire       save_hi;
  wire       save_lo;

  rtds_sequencer u_sequencer (
    .clk_i    (clk_i),
    .rst_ni   (rst_ni),
    .clear_i  (clear_i),
    .start_i  (accept),
    .refresh_i(refresh),
    .idle_o   (idle),
    .valid_o  (valid_o),
    .add_en_o (add_en),
    .mul_en_o (mul_en),
    .op_o     (op),
    .mul_sel_o(mul_sel),
    .save_p_o (save_p),
    .save_s_o (save_s),
    .save_hi_o(save_hi),
    .save_lo_o(save_lo)
  );

  rtds_motor u_left (
    .clk_i    (clk_i),
    .rst_ni   (rst_ni),
    .clear_i  (clear_i),
    .add_en_i (add_en),
    .mul_en_i (mul_en),
    .op_i     (op),
    .mul_sel_i(mul_sel),
    .save_p_i (save_p),
    .save_s_i (save_s),
    .save_hi_i(save_hi),
    .save_lo_i(save_lo),
    .coef_i   (coef_q),
    .v_i      (v_l_i),
    .t_i      (t_l_i),
    .i_hi_o   (i_l_o),
    .w_hi_o   (w_l_o),
    .i_lo_o   (i_l_lo_o),
    .w_lo_o   (w_l_lo_o)
  );

  rtds_motor u_right (
    .clk_i    (clk_i),
    .rst_ni   (rst_ni),
    .clear_i  (clear_i),
    .add_en_i (add_en),
    .mul_en_i (mul_en),
    .op_i     (op),
    .mul_sel_i(mul_sel),
    .save_p_i (save_p),
    .save_s_i (save_s),
    .save_hi_i(save_hi),
    .save_lo_i(save_lo),
    .coef_i   (coef_q),
    .v_i      (v_r_i),
    .t_i      (t_r_i),
    .i_hi_o   (i_r_o),
    .w_hi_o   (w_r_o),
    .i_lo_o   (i_r_lo_o),
    .w_lo_o   (w_r_lo_o)
  );

  // ---- status ----------------------------------------------------------------------------------------------------
  assign nonfinite_o = (&i_l_o[30:23]) | (&w_l_o[30:23]) | (&i_r_o[30:23]) | (&w_r_o[30:23]);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) step_count_o <= 32'd0;
    else if (clear_i) step_count_o <= 32'd0;
    else if (save_hi) step_count_o <= step_count_o + 32'd1;
  end
endmodule

`default_nettype wire
