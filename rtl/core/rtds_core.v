// rtds_core: two motor units, left and right, the parameter unit they share, and the effect unit beside them.
//
// Purpose    Each strobe makes one simulation step of both motors. An input acts in the step of the strobe that
//            reads it; a parameter set acts one step later. The coefficients change all at once, between two steps.
// Handshake  strobe_i while ready_o: inputs and parameters are taken at that edge, the inputs straight into the
//            multipliers (give them from registers of this clock). A strobe while not ready, or together with clear_i, is
//            not taken and gives overrun_o for one clock.
//            clear_i: state and step count to zero, a step under way is dropped (no valid_o); the coefficients and
//            a parameter set under way stay.
// Latency    Counted in edges after the one that takes the strobe, always the same:
//              11  high words and valid_o (one clock); the words hold until the next
//              18  low words (scratch from the 9th on)
//              26  earliest next strobe; ready_o is seen after the 25th
//             107  the same if the strobe brought changed parameters, 93 if those were unusable
//            With effects (fx_on_i at the strobe): 15, 22 (scratch from the 3rd on) and 50; 147 if the strobe brought
//            changed parameters, 271 if each side has its own besides (fx_own_i).
// Effects    fx_on_i: V and T act one step later, through effect_unit, and dry friction takes its part at the end of the
//            step (docs/effect-unit.md). fx_own_i: p2_*_i are the right motor's parameters, p_*_i the left one's.
//            EFFECTS 0: without effect_unit, for simulation: fx_on_i and fx_wr_* are not looked at; states and clocks are the same.
//            fx_* and p2_* are taken at the strobe like the parameters. fx_wr_*: see effect_unit.
// Format     binary32, SI at the motor shaft: V, N.m (opposing load positive), A, rad/s, ohm, H, N.m/A, V.s/rad,
//            kg.m2, N.m.s/rad, s. A state is the sum of its high and low word. One NaN: 7FC00000.
// Faults     param_fault_o: the last parameter set is unusable (zero, negative, NaN, infinite or subnormal, or such a
//            coefficient); the old coefficients stay in force. nonfinite_o: an infinity or NaN in the state; it
//            changes with the high words and lasts until clear_i.
// Start      After reset the coefficients are zero: the first step rests, and brings the first parameter set.
// Crossing   none: one clock. rst_ni is asserted asynchronously and released synchronously to clk_i.
`default_nettype none

module rtds_core #(
  parameter EFFECTS = 1
) (
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
  input  wire        fx_on_i,
  input  wire        fx_own_i,
  input  wire [11:0] fx_delay_i,
  input  wire [15:0] fx_stride_i,
  input  wire [31:0] p2_r_i,
  input  wire [31:0] p2_l_i,
  input  wire [31:0] p2_km_i,
  input  wire [31:0] p2_kb_i,
  input  wire [31:0] p2_j_i,
  input  wire [31:0] p2_b_i,
  input  wire        fx_wr_valid_i,
  input  wire [13:0] fx_wr_addr_i,
  input  wire [31:0] fx_wr_data_i,
  output wire        fx_wr_ready_o,
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
  wire sequencer_idle;
  wire sequencer_ready;
  wire param_pending;
  wire fx_on = fx_on_i & (EFFECTS != 0);
  reg  fx_q;  // effects act in the step in hand
  wire accept = strobe_i & ready_o & ~clear_i;

  assign ready_o = sequencer_ready & ~param_pending;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) overrun_o <= 1'b0;
    else overrun_o <= strobe_i & ~accept;
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) fx_q <= 1'b0;
    else if (accept) fx_q <= fx_on;
  end

  // ---- parameters: taken at the strobe, computed beside the step, committed after it -----------------------------
  // The right motor's stand apart only where it has its own: without, they cannot start a computation.
  wire [191:0] param2_in = fx_own_i ? {p2_b_i, p2_j_i, p2_kb_i, p2_km_i, p2_l_i, p2_r_i} : 192'd0;
  wire [226:0] param_in  = {fx_own_i, fx_on, method_i, p_h_i, p_b_i, p_j_i, p_kb_i, p_km_i, p_l_i, p_r_i};
  reg  [226:0] given_q;    // what there was in the last clock
  reg  [191:0] given2_q;
  reg          differs_q;  // and that it is not the last set read
  reg          accept_q;
  reg  [226:0] param_q;    // the last set read, from the second clock after the strobe on
  reg  [191:0] param2_q;
  reg          seen_q;     // there was one
  reg          second_q;   // the right motor's coefficients are being computed, or stand
  reg          again_q;    // they start
  reg          waiting_q;  // coefficients stand, not yet committed
  reg  [287:0] left_q;     // the left motor's, while the right one's are computed
  reg          fault_q;    // and whether they are unusable
  reg  [287:0] coef_l_q;   // in force: {rho, G22, G21, G12, G11, B, Km, Kb, R}
  reg  [287:0] coef_r_q;
  wire [255:0] coef;
  wire  [31:0] rho;
  wire         param_busy;
  wire         param_done;
  wire         fault_one;

  wire         own     = param_q[226];
  wire [191:0] motor   = second_q ? param2_q : param_q[191:0];
  wire         fault   = fault_one | (own & fault_q);
  wire         commit  = waiting_q & sequencer_idle;
  wire         refresh = commit & ~fault;

  // The strobe comes late in its clock: it chooses among so many bits in the next one.
  wire         start   = accept_q & (~seen_q | differs_q);

  // In the clock of `start` a step has just begun: nothing else starts in it.
  assign param_pending = again_q | param_busy | param_done | waiting_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      given_q       <= 227'd0;
      given2_q      <= 192'd0;
      differs_q     <= 1'b0;
      accept_q      <= 1'b0;
    end else begin
      given_q       <= param_in;
      given2_q      <= param2_in;
      differs_q     <= (param_in != param_q) | (param2_in != param2_q);
      accept_q      <= accept;
    end
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      param_q       <= 227'd0;
      param2_q      <= 192'd0;
      seen_q        <= 1'b0;
      second_q      <= 1'b0;
      again_q       <= 1'b0;
      waiting_q     <= 1'b0;
      left_q        <= 288'd0;
      fault_q       <= 1'b0;
      coef_l_q      <= 288'd0;
      coef_r_q      <= 288'd0;
      param_fault_o <= 1'b0;
    end else if (accept_q | param_pending) begin
      again_q <= param_done & own & ~second_q;
      if (accept_q) begin
        param_q  <= given_q;
        param2_q <= given2_q;
        seen_q   <= 1'b1;
        second_q <= 1'b0;
      end
      if (param_done & own & ~second_q) begin
        second_q <= 1'b1;
        left_q   <= {rho, coef};
        fault_q  <= fault_one;
      end
      if (param_done & (~own | second_q)) waiting_q <= 1'b1;
      else if (commit) waiting_q <= 1'b0;
      if (commit) param_fault_o <= fault;
      if (refresh) begin
        coef_l_q <= own ? left_q : {rho, coef};
        coef_r_q <= {rho, coef};
      end
    end
  end

  rtds_param_unit u_param_unit (
    .clk_i   (clk_i),
    .rst_ni  (rst_ni),
    .start_i (start | again_q),
    .r_i     (motor[0+:32]),
    .l_i     (motor[32+:32]),
    .km_i    (motor[64+:32]),
    .kb_i    (motor[96+:32]),
    .j_i     (motor[128+:32]),
    .b_i     (motor[160+:32]),
    .h_i     (param_q[192+:32]),
    .rho_i   (param_q[225]),
    .method_i(param_q[224]),
    .busy_o  (param_busy),
    .done_o  (param_done),
    .fault_o (fault_one),
    .coef_o  (coef),
    .rho_o   (rho)
  );

  wire        new_state;  // valid_o in the next clock

  // ---- effects ---------------------------------------------------------------------------------------------------
  wire [63:0] u_v;
  wire [63:0] u_t;
  wire [63:0] level_f;
  wire [63:0] level_b;

  // Without effects the unit rests since the clock after the first strobe without them; no step reads it in that clock.
  reg fx_rest_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) fx_rest_q <= 1'b0;
    else fx_rest_q <= accept & fx_q & ~fx_on;
  end

  generate
    if (EFFECTS != 0) begin : g_effects
      effect_unit u_effects (
        .clk_i     (clk_i),
        .rst_ni    (rst_ni),
        .rest_i    (clear_i | fx_rest_q),
        .strobe_i  (accept & fx_on),
        .v_i       ({v_r_i, v_l_i}),
        .t_i       ({t_r_i, t_l_i}),
        .delay_i   (fx_delay_i),
        .stride_i  (fx_stride_i),
        .r_l_i     (coef_l_q[0+:32]),
        .r_r_i     (coef_r_q[0+:32]),
        .kb_l_i    (coef_l_q[32+:32]),
        .kb_r_i    (coef_r_q[32+:32]),
        .i_l_i     (i_l_o),
        .i_r_i     (i_r_o),
        .w_l_i     (w_l_o),
        .w_r_i     (w_r_o),
        .u_v_o     (u_v),
        .u_t_o     (u_t),
        .level_f_o (level_f),
        .level_b_o (level_b),
        .wr_valid_i(fx_wr_valid_i),
        .wr_addr_i (fx_wr_addr_i),
        .wr_data_i (fx_wr_data_i),
        .wr_ready_o(fx_wr_ready_o)
      );
    end else begin : g_ideal
      assign {u_v, u_t, level_f, level_b} = 256'd0;
      assign fx_wr_ready_o                = 1'b1;
    end
  endgenerate

  // ---- motors ----------------------------------------------------------------------------------------------------
  wire       add_en_n;  // *_n: of the next clock
  wire       mul_en_n;
  wire [6:0] add_n;
  wire [3:0] mul_n;
  wire       save_p_n;
  wire       save_c;
  wire       save_lo_n;
  wire       save_last;
  wire       save_f;
  wire       save_b;
  wire       save_taken;
  wire       ahead_n;
  wire       take;

  rtds_sequencer u_sequencer (
    .clk_i    (clk_i),
    .rst_ni   (rst_ni),
    .clear_i  (clear_i),
    .start_i  (accept),
    .refresh_i(refresh),
    .fx_on_i  (fx_on),
    .effects_i(fx_q & (EFFECTS != 0)),
    .hold_i   (param_pending),
    .idle_o   (sequencer_idle),
    .ready_o  (sequencer_ready),
    .next_o   (new_state),
    .valid_o  (valid_o),
    .add_en_n_o  (add_en_n),
    .mul_en_n_o  (mul_en_n),
    .add_n_o     (add_n),
    .mul_n_o     (mul_n),
    .save_p_n_o  (save_p_n),
    .save_c_o (save_c),
    .save_lo_n_o (save_lo_n),
    .save_last_o (save_last),
    .save_f_o    (save_f),
    .save_b_o    (save_b),
    .save_taken_o(save_taken),
    .ahead_n_o   (ahead_n),
    .take_o      (take)
  );

  rtds_motor u_left (
    .clk_i    (clk_i),
    .rst_ni   (rst_ni),
    .clear_i  (clear_i),
    .take_i   (take),
    .add_en_n_i (add_en_n),
    .mul_en_n_i (mul_en_n),
    .add_n_i    (add_n),
    .mul_n_i    (mul_n),
    .save_p_n_i (save_p_n),
    .save_c_i (save_c),
    .save_hi_n_i(new_state),
    .save_lo_n_i(save_lo_n),
    .save_last_i (save_last),
    .save_f_i    (save_f & (EFFECTS != 0)),
    .save_b_i    (save_b & (EFFECTS != 0)),
    .save_taken_i(save_taken & (EFFECTS != 0)),
    .ahead_n_i  (ahead_n & (EFFECTS != 0)),
    .effects_i(fx_q & (EFFECTS != 0)),
    .rest_i   (fx_rest_q),
    .rho_i    (coef_l_q[256+:32]),
    .u_v_i    (u_v[0+:32]),
    .u_t_i    (u_t[0+:32]),
    .level_f_i(level_f[0+:32]),
    .level_b_i(level_b[0+:32]),
    .coef_i   (coef_l_q[255:0]),
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
    .take_i   (take),
    .add_en_n_i (add_en_n),
    .mul_en_n_i (mul_en_n),
    .add_n_i    (add_n),
    .mul_n_i    (mul_n),
    .save_p_n_i (save_p_n),
    .save_c_i (save_c),
    .save_hi_n_i(new_state),
    .save_lo_n_i(save_lo_n),
    .save_last_i (save_last),
    .save_f_i    (save_f & (EFFECTS != 0)),
    .save_b_i    (save_b & (EFFECTS != 0)),
    .save_taken_i(save_taken & (EFFECTS != 0)),
    .ahead_n_i  (ahead_n & (EFFECTS != 0)),
    .effects_i(fx_q & (EFFECTS != 0)),
    .rest_i   (fx_rest_q),
    .rho_i    (coef_r_q[256+:32]),
    .u_v_i    (u_v[32+:32]),
    .u_t_i    (u_t[32+:32]),
    .level_f_i(level_f[32+:32]),
    .level_b_i(level_b[32+:32]),
    .coef_i   (coef_r_q[255:0]),
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
    else if (new_state) step_count_o <= step_count_o + 32'd1;
  end
endmodule

`default_nettype wire
