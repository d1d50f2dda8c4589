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
//            With effects (FX_ON at the strobe): 15, 22 (scratch from the 3rd on) and 50; 147 if the strobe brought
//            changed parameters, 271 if each side has its own besides (FX_OWN).
// Effects    FX_ON: V and T act one step later, through effect_unit, and dry friction takes its part at the end of the
//            step (docs/effect-unit.md). FX_OWN: motor_r_i is the right motor, motor_l_i the left one; else motor_l_i is both.
//            EFFECTS 0: without effect_unit, for simulation: FX_ON and word_* are not looked at; states and clocks are the same.
//            All settings are taken at the strobe like the parameters. word_*: see effect_unit.
// Format     records of named fields: rtds_core_records.vh (inputs_i, motor_*_i, settings_i, word_i; state_o and low_o have the same
//            fields). Words are binary32, SI at the motor shaft, an opposing load positive. A state is the sum of its high
//            word (state_o) and its low word (low_o). One NaN: 7FC00000.
// Faults     param_fault_o: the last parameter set is unusable (zero, negative, NaN, infinite or subnormal, or such a
//            coefficient); the old coefficients stay in force. nonfinite_o: an infinity or NaN in the state; it
//            changes with the high words and lasts until clear_i.
// Start      After reset the coefficients are zero: the first step rests, and brings the first parameter set.
// Crossing   none: one clock. rst_ni is asserted asynchronously and released synchronously to clk_i.
`default_nettype none

module rtds_core #(
  parameter EFFECTS = 1
) (
  input  wire         clk_i,
  input  wire         rst_ni,
  input  wire         strobe_i,
  input  wire         clear_i,
  input  wire [127:0] inputs_i,
  input  wire [191:0] motor_l_i,
  input  wire [191:0] motor_r_i,
  input  wire  [62:0] settings_i,
  input  wire         word_valid_i,
  input  wire  [45:0] word_i,
  output wire         word_ready_o,
  output wire         valid_o,
  output wire [127:0] state_o,
  output wire [127:0] low_o,
  output wire         ready_o,
  output wire         overrun_o,
  output wire         nonfinite_o,
  output wire         param_fault_o,
  output wire  [31:0] step_count_o
);
  `include "rtds_core_records.vh"

  reg         overrun_q;
  reg         param_fault_q;
  reg  [31:0] step_count_q;

  // ---- strobe ----------------------------------------------------------------------------------------------------
  wire sequencer_idle;
  wire sequencer_ready;
  wire param_pending;
  wire fx_on = settings_i[SETTINGS_FX_ON] & (EFFECTS != 0);
  reg  fx_q;  // effects act in the step in hand
  wire accept = strobe_i & ready_o & ~clear_i;

  assign ready_o = sequencer_ready & ~param_pending;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) overrun_q <= 1'b0;
    else overrun_q <= strobe_i & ~accept;
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) fx_q <= 1'b0;
    else if (accept) fx_q <= fx_on;
  end

  // ---- parameters: taken at the strobe, computed beside the step, committed after it -----------------------------
  // A set is all that the coefficients follow from: the settings below the delay, and both motors.
  localparam integer SET_MOTOR_L = SETTINGS_DELAY;
  localparam integer SET_MOTOR_R = SET_MOTOR_L + MOTOR_BITS;
  localparam integer SET_BITS    = SET_MOTOR_R + MOTOR_BITS;
  localparam integer PART_BITS   = 32;  // compared at once
  localparam integer SET_PARTS   = (SET_BITS + PART_BITS - 1) / PART_BITS;

  wire [SET_BITS-1:0] set_in;

  assign set_in[SETTINGS_H+:32]          = settings_i[SETTINGS_H+:32];
  assign set_in[SETTINGS_METHOD]         = settings_i[SETTINGS_METHOD];
  assign set_in[SETTINGS_FX_ON]          = fx_on;
  assign set_in[SETTINGS_FX_OWN]         = settings_i[SETTINGS_FX_OWN];
  assign set_in[SET_MOTOR_L+:MOTOR_BITS] = motor_l_i;
  // The right motor's are its own or nothing: without, they cannot start a computation.
  assign set_in[SET_MOTOR_R+:MOTOR_BITS] = settings_i[SETTINGS_FX_OWN] ? motor_r_i : {MOTOR_BITS{1'b0}};

  reg   [SET_BITS-1:0] given_q;    // what there was in the last clock
  reg [SET_PARTS-1:0]  differs_q;  // and which parts of it are not those of the last set read
  reg                  accept_q;
  reg   [SET_BITS-1:0] set_q;      // the last set read, from the second clock after the strobe on
  reg                  seen_q;     // there was one
  reg                  second_q;   // the right motor's coefficients are being computed, or stand
  reg                  again_q;    // they start
  reg                  waiting_q;  // coefficients stand, not yet committed
  reg  [COEF_BITS-1:0] left_q;     // the left motor's, while the right one's are computed
  reg                  fault_q;    // and whether they are unusable
  wire [COEF_BITS-1:0] coef;
  wire                 param_busy;
  wire                 param_done;
  wire                 fault_one;

  reg  [2*COEF_BITS-1:0] coef_q;   // in force, of both sides

  wire own     = set_q[SETTINGS_FX_OWN];
  wire fault   = fault_one | (own & fault_q);
  wire commit  = waiting_q & sequencer_idle;
  wire refresh = commit & ~fault;

  // The strobe comes late in its clock: it chooses among so many bits in the next one.
  wire start   = accept_q & (~seen_q | (|differs_q));

  // In the clock of `start` a step has just begun: nothing else starts in it.
  assign param_pending = again_q | param_busy | param_done | waiting_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      given_q  <= {SET_BITS{1'b0}};
      accept_q <= 1'b0;
    end else begin
      given_q  <= set_in;
      accept_q <= accept;
    end
  end

  genvar part;
  generate
    for (part = 0; part < SET_PARTS; part = part + 1) begin : g_part
      localparam integer FIRST = PART_BITS * part;
      localparam integer BITS  = (part == SET_PARTS - 1) ? SET_BITS - FIRST : PART_BITS;

      always @(posedge clk_i or negedge rst_ni) begin
        if (!rst_ni) differs_q[part] <= 1'b0;
        else differs_q[part] <= set_in[FIRST+:BITS] != set_q[FIRST+:BITS];
      end
    end
  endgenerate

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      set_q         <= {SET_BITS{1'b0}};
      seen_q        <= 1'b0;
      second_q      <= 1'b0;
      again_q       <= 1'b0;
      waiting_q     <= 1'b0;
      left_q        <= {COEF_BITS{1'b0}};
      fault_q       <= 1'b0;
      coef_q        <= {(2 * COEF_BITS){1'b0}};
      param_fault_q <= 1'b0;
    end else if (accept_q | param_pending) begin
      again_q <= param_done & own & ~second_q;
      if (accept_q) begin
        set_q    <= given_q;
        seen_q   <= 1'b1;
        second_q <= 1'b0;
      end
      if (param_done & own & ~second_q) begin
        second_q <= 1'b1;
        left_q   <= coef;
        fault_q  <= fault_one;
      end
      if (param_done & (~own | second_q)) waiting_q <= 1'b1;
      else if (commit) waiting_q <= 1'b0;
      if (commit) param_fault_q <= fault;
      if (refresh) begin
        coef_q[COEF_BITS*LEFT+:COEF_BITS]  <= own ? left_q : coef;
        coef_q[COEF_BITS*RIGHT+:COEF_BITS] <= coef;
      end
    end
  end

  rtds_param_unit u_param_unit (
    .clk_i   (clk_i),
    .rst_ni  (rst_ni),
    .start_i (start | again_q),
    .motor_i (second_q ? set_q[SET_MOTOR_R+:MOTOR_BITS] : set_q[SET_MOTOR_L+:MOTOR_BITS]),
    .h_i     (set_q[SETTINGS_H+:32]),
    .rho_i   (set_q[SETTINGS_FX_ON]),
    .method_i(set_q[SETTINGS_METHOD]),
    .busy_o  (param_busy),
    .done_o  (param_done),
    .fault_o (fault_one),
    .coef_o  (coef)
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
        .clk_i       (clk_i),
        .rst_ni      (rst_ni),
        .rest_i      (clear_i | fx_rest_q),
        .strobe_i    (accept & fx_on),
        .inputs_i    (inputs_i),
        .delay_i     (settings_i[SETTINGS_DELAY+:12]),
        .stride_i    (settings_i[SETTINGS_STRIDE+:16]),
        .r_i         ({coef_q[COEF_BITS*RIGHT+COEF_R+:32], coef_q[COEF_BITS*LEFT+COEF_R+:32]}),
        .kb_i        ({coef_q[COEF_BITS*RIGHT+COEF_KB+:32], coef_q[COEF_BITS*LEFT+COEF_KB+:32]}),
        .state_i     (state_o),
        .u_v_o       (u_v),
        .u_t_o       (u_t),
        .level_f_o   (level_f),
        .level_b_o   (level_b),
        .word_valid_i(word_valid_i),
        .word_i      (word_i),
        .word_ready_o(word_ready_o)
      );
    end else begin : g_ideal
      assign {u_v, u_t, level_f, level_b} = 256'd0;
      assign word_ready_o                 = 1'b1;
    end
  endgenerate

  // ---- motors ----------------------------------------------------------------------------------------------------
  wire       add_en_d;  // *_d: of the next clock
  wire       mul_en_d;
  wire [6:0] add_d;
  wire [3:0] mul_d;
  wire       save_p_d;
  wire       save_c;
  wire       save_lo_d;
  wire       save_last;
  wire       save_f;
  wire       save_b;
  wire       save_taken;
  wire       ahead_d;
  wire       take;

  rtds_sequencer u_sequencer (
    .clk_i       (clk_i),
    .rst_ni      (rst_ni),
    .clear_i     (clear_i),
    .start_i     (accept),
    .refresh_i   (refresh),
    .fx_on_i     (fx_on),
    .effects_i   (fx_q & (EFFECTS != 0)),
    .hold_i      (param_pending),
    .idle_o      (sequencer_idle),
    .ready_o     (sequencer_ready),
    .next_o      (new_state),
    .valid_o     (valid_o),
    .add_en_d_o  (add_en_d),
    .mul_en_d_o  (mul_en_d),
    .add_d_o     (add_d),
    .mul_d_o     (mul_d),
    .save_p_d_o  (save_p_d),
    .save_c_o    (save_c),
    .save_lo_d_o (save_lo_d),
    .save_last_o (save_last),
    .save_f_o    (save_f),
    .save_b_o    (save_b),
    .save_taken_o(save_taken),
    .ahead_d_o   (ahead_d),
    .take_o      (take)
  );

  genvar side;
  generate
    for (side = LEFT; side <= RIGHT; side = side + 1) begin : g_side
      rtds_motor u_motor (
        .clk_i       (clk_i),
        .rst_ni      (rst_ni),
        .clear_i     (clear_i),
        .take_i      (take),
        .add_en_d_i  (add_en_d),
        .mul_en_d_i  (mul_en_d),
        .add_d_i     (add_d),
        .mul_d_i     (mul_d),
        .save_p_d_i  (save_p_d),
        .save_c_i    (save_c),
        .save_hi_d_i (new_state),
        .save_lo_d_i (save_lo_d),
        .save_last_i (save_last),
        .save_f_i    (save_f & (EFFECTS != 0)),
        .save_b_i    (save_b & (EFFECTS != 0)),
        .save_taken_i(save_taken & (EFFECTS != 0)),
        .ahead_d_i   (ahead_d & (EFFECTS != 0)),
        .effects_i   (fx_q & (EFFECTS != 0)),
        .rest_i      (fx_rest_q),
        .u_v_i       (u_v[32*side+:32]),
        .u_t_i       (u_t[32*side+:32]),
        .level_f_i   (level_f[32*side+:32]),
        .level_b_i   (level_b[32*side+:32]),
        .coef_i      (coef_q[COEF_BITS*side+:COEF_BITS]),
        .v_i         (inputs_i[(side == LEFT ? INPUTS_V_L : INPUTS_V_R)+:32]),
        .t_i         (inputs_i[(side == LEFT ? INPUTS_T_L : INPUTS_T_R)+:32]),
        .i_hi_o      (state_o[(side == LEFT ? STATE_I_L : STATE_I_R)+:32]),
        .w_hi_o      (state_o[(side == LEFT ? STATE_W_L : STATE_W_R)+:32]),
        .i_lo_o      (low_o[(side == LEFT ? STATE_I_L : STATE_I_R)+:32]),
        .w_lo_o      (low_o[(side == LEFT ? STATE_W_L : STATE_W_R)+:32])
      );
    end
  endgenerate

  // ---- status ----------------------------------------------------------------------------------------------------
  assign nonfinite_o = (&state_o[STATE_I_L+23+:8]) | (&state_o[STATE_W_L+23+:8])
                     | (&state_o[STATE_I_R+23+:8]) | (&state_o[STATE_W_R+23+:8]);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) step_count_q <= 32'd0;
    else if (clear_i) step_count_q <= 32'd0;
    else if (new_state) step_count_q <= step_count_q + 32'd1;
  end

  assign overrun_o     = overrun_q;
  assign param_fault_o = param_fault_q;
  assign step_count_o  = step_count_q;
endmodule

`default_nettype wire
