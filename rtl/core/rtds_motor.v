// rtds_motor: one motor unit, the two rows of the update side by side.
//
// Purpose    x+ = x + G (u - S x) for x = (i, w), u = (V, T): armature current and shaft speed after one step with
//            the inputs held. Derivation and signs: docs/theory-motor-unit.md.
// Handshake  none of its own: control comes from rtds_sequencer, the same for both motors.
//            With effects, u_v and u_t stand in the places of V and T, and friction takes its part of the speed before the
//            state is saved (rtds_friction).
// Latency    i_hi_o, w_hi_o change 11 clocks after the strobe; i_lo_o, w_lo_o belong to them 18 clocks after it, and are
//            scratch from the 9th clock on. With effects 15, 22 and from the 3rd on.
// Format     binary32, SI at the motor shaft: V, N.m (opposing load positive), A, rad/s. A state is hi + lo.
// Crossing   none.
`default_nettype none

module rtds_motor (
  input  wire         clk_i,
  input  wire         rst_ni,
  input  wire         clear_i,
  // from rtds_sequencer
  input  wire         take_i,
  input  wire         add_en_d_i,   // *_d_i: of the next clock
  input  wire         mul_en_d_i,
  input  wire   [6:0] add_d_i,
  input  wire   [3:0] mul_d_i,
  input  wire         save_p_d_i,
  input  wire         save_c_i,
  input  wire         save_hi_d_i,
  input  wire         save_lo_d_i,
  input  wire         save_last_i,
  input  wire         save_f_i,
  input  wire         save_b_i,
  input  wire         save_taken_i,
  input  wire         ahead_d_i,    // the multiplier's factor is of the effect unit
  // effects: what stands for V and T, levels of dry friction, N.m, the one backward with a minus
  input  wire         effects_i,
  input  wire         rest_i,       // no friction until the next levels
  input  wire  [31:0] u_v_i,
  input  wire  [31:0] u_t_i,
  input  wire  [31:0] level_f_i,
  input  wire  [31:0] level_b_i,
  input  wire [287:0] coef_i,       // see rtds_core_records.vh
  // inputs, used in the clock of the strobe
  input  wire  [31:0] v_i,
  input  wire  [31:0] t_i,
  output wire  [31:0] i_hi_o,
  output wire  [31:0] w_hi_o,
  output wire  [31:0] i_lo_o,
  output wire  [31:0] w_lo_o
);
  `include "rtds_core_records.vh"

  wire [31:0] y_electrical;
  wire [31:0] y_mechanical;
  wire [31:0] m_electrical;
  wire [31:0] m_mechanical;
  wire [31:0] taken;
  wire        held;

  // The multipliers take T a clock after V.
  reg  [31:0] t_q;

  always @(posedge clk_i) begin
    if (take_i) t_q <= t_i;
  end

  reg ahead_q;  // each motor's own, as in rtds_row

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) ahead_q <= 1'b0;
    else ahead_q <= ahead_d_i;
  end

  wire [31:0] v = ahead_q ? u_v_i : v_i;
  wire [31:0] t = ahead_q ? u_t_i : t_q;

  rtds_friction u_friction (
    .clk_i       (clk_i),
    .rst_ni      (rst_ni),
    .clear_i     (clear_i | rest_i),
    .save_f_i    (save_f_i),
    .save_b_i    (save_b_i),
    .save_taken_i(save_taken_i),
    .product_i   (m_mechanical),
    .free_i      (y_mechanical),
    .taken_o     (taken),
    .held_o      (held)
  );

  rtds_row #(
    .ELECTRICAL(1)
  ) u_electrical (
    .clk_i    (clk_i),
    .rst_ni   (rst_ni),
    .clear_i  (clear_i),
    .add_en_d_i (add_en_d_i),
    .mul_en_d_i (mul_en_d_i),
    .add_d_i    (add_d_i),
    .mul_d_i    (mul_d_i),
    .save_p_d_i (save_p_d_i),
    .save_c_i   (save_c_i),
    .save_hi_d_i(save_hi_d_i),
    .save_lo_d_i(save_lo_d_i),
    .zero_i   (1'b0),
    .k_i      (coef_i[COEF_RHO+:32]),
    .y4_i     (taken),
    .y5_i     (taken),
    .taken_i  (taken),
    .m_o      (m_electrical),
    .a1_i     (coef_i[COEF_R+:32]),
    .a2_i     (coef_i[COEF_KB+:32]),
    .g1_i     (coef_i[COEF_G11+:32]),
    .g2_i     (coef_i[COEF_G12+:32]),
    .v_i      (v),
    .t_i      (t),
    .i_hi_i   (i_hi_o),
    .w_hi_i   (w_hi_o),
    .s1_i     (y_electrical),
    .s2_i     (y_mechanical),
    .y_o      (y_electrical),
    .hi_o     (i_hi_o),
    .lo_o     (i_lo_o)
  );

  rtds_row #(
    .ELECTRICAL(0)
  ) u_mechanical (
    .clk_i    (clk_i),
    .rst_ni   (rst_ni),
    .clear_i  (clear_i),
    .add_en_d_i (add_en_d_i),
    .mul_en_d_i (mul_en_d_i),
    .add_d_i    (add_d_i),
    .mul_d_i    (mul_d_i),
    .save_p_d_i (save_p_d_i),
    .save_c_i   (save_c_i),
    .save_hi_d_i(save_hi_d_i),
    .save_lo_d_i(save_lo_d_i),
    .zero_i   (effects_i & held & save_last_i),
    .k_i      (coef_i[COEF_G22+:32]),
    .y4_i     (level_f_i),
    .y5_i     (level_b_i),
    .taken_i  (taken),
    .m_o      (m_mechanical),
    .a1_i     (coef_i[COEF_KM+:32]),
    .a2_i     (coef_i[COEF_B+:32]),
    .g1_i     (coef_i[COEF_G21+:32]),
    .g2_i     (coef_i[COEF_G22+:32]),
    .v_i      (v),
    .t_i      (t),
    .i_hi_i   (i_hi_o),
    .w_hi_i   (w_hi_o),
    .s1_i     (y_electrical),
    .s2_i     (y_mechanical),
    .y_o      (y_mechanical),
    .hi_o     (w_hi_o),
    .lo_o     (w_lo_o)
  );

  wire unused = ^m_electrical;
endmodule

`default_nettype wire
