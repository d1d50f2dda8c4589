// rtds_row: one row of the motor's update, that is, one state variable in two words.
//
// Purpose    Computes, in binary32 and in this order, with (i, w) the high words of both rows:
//              t = (c + g1 V) +/- (g2 T);  hi' = hi + t;  lo' = t - (hi' - hi)
//            and of the new state, before the next input is known,
//              s1 = (R i) + (Kb w);  s2 = (Km i) - (B w);  c = (lo - g1 s1) -/+ (g2 s2)
//            ELECTRICAL = 1: state x = i, s = s1, the upper signs; 0: x = w, s = s2, the lower ones.
//            With effects, between hi' and the rest, after rtds_friction has taken its part of the free speed:
//              t' = t + k y4   ELECTRICAL = 1: k = rho, y4 = the speed taken
//              t' = t - taken  ELECTRICAL = 0; and k y4, k y5 before it: k = g2, y4, y5 = levels of friction
//            One adder and one multiplier; the sequencer says what they work on (it has the table).
// Handshake  none of its own: what enters the operators, the enables and the saves come from rtds_sequencer. v_i is used in the clock of the
//            strobe only, t_i in the clock after it.
// Latency    fp_add and fp_mul 3 clocks; of the step: see rtds_sequencer.
// Crossing   none.
`default_nettype none

module rtds_row #(
  parameter ELECTRICAL = 1
) (
  input  wire        clk_i,
  input  wire        rst_ni,
  input  wire        clear_i,     // state to zero
  // from rtds_sequencer; *_d_i is of the next clock: each row has it in registers of its own
  input  wire        add_en_d_i,  // operands enter the adder
  input  wire        mul_en_d_i,
  input  wire  [6:0] add_d_i,     // which: {minus (2), second (3), first (2)}
  input  wire  [3:0] mul_d_i,     // into the multiplier: {friction, input, G rather than S, second rather than first}
  input  wire        save_p_d_i,  // first product of two
  input  wire        save_c_i,
  input  wire        save_hi_d_i,
  input  wire        save_lo_d_i, // t, later lo'
  input  wire        zero_i,      // what is saved is zero: the shaft is held
  // coefficients: R, Kb, G11, G12 or Km, B, G21, G22
  input  wire [31:0] a1_i,
  input  wire [31:0] a2_i,
  input  wire [31:0] g1_i,
  input  wire [31:0] g2_i,
  // of friction, with effects
  input  wire [31:0] k_i,
  input  wire [31:0] y4_i,
  input  wire [31:0] y5_i,
  input  wire [31:0] taken_i,
  output wire [31:0] m_o,         // the multiplier's result
  // inputs, state of both rows, s of both rows
  input  wire [31:0] v_i,
  input  wire [31:0] t_i,
  input  wire [31:0] i_hi_i,
  input  wire [31:0] w_hi_i,
  input  wire [31:0] s1_i,
  input  wire [31:0] s2_i,
  output wire [31:0] y_o,         // the adder's result
  output wire [31:0] hi_o,        // the new one in the clock in which it is saved
  output wire [31:0] lo_o         // t while a step is between its two sums
);
  `include "rtds_ops.vh"

  // ---- control -----------------------------------------------------------------------------------------------------
  // The same in all four rows, and so many operands read it that each row's own stands beside them. A tool would join them again
  // unless told not to: quartus/*.qsf and tb/common/own_registers.py do.
  reg  [6:0] add_q;
  reg  [3:0] mul_q;
  reg  [2:0] add_en_q;  // a bit for each stage, the first in bit 0
  reg  [2:0] mul_en_q;
  reg        save_p_q;
  reg        save_hi_q;
  reg        save_lo_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      add_q     <= ADD_Z0;
      mul_q     <= MUL_V;
      add_en_q  <= 3'b001;
      mul_en_q  <= 3'b001;
      save_p_q  <= 1'b0;
      save_hi_q <= 1'b0;
      save_lo_q <= 1'b0;
    end else begin
      add_q     <= add_d_i;
      mul_q     <= mul_d_i;
      add_en_q  <= {add_en_q[1:0], add_en_d_i};
      mul_en_q  <= {mul_en_q[1:0], mul_en_d_i};
      save_p_q  <= save_p_d_i;
      save_hi_q <= save_hi_d_i;
      save_lo_q <= save_lo_d_i;
    end
  end

  wire [31:0] m;
  wire [31:0] y;
  reg  [31:0] p_q;   // first product, until it is added to the second
  reg  [31:0] c_q;
  reg  [31:0] hi_q;
  reg  [31:0] lo_q;

  // ---- multiplier --------------------------------------------------------------------------------------------------
  reg  [31:0] mul_a;
  reg  [31:0] mul_b;

  always @* begin
    mul_a = mul_q[0] ? a2_i : a1_i;
    if (mul_q[1]) mul_a = mul_q[0] ? g2_i : g1_i;
    if (mul_q[3]) mul_a = k_i;
    case ({mul_q[3] | mul_q[2], mul_q[3] | mul_q[1], mul_q[0]})
      3'b000:  mul_b = i_hi_i;
      3'b001:  mul_b = w_hi_i;
      3'b010:  mul_b = s1_i;
      3'b011:  mul_b = s2_i;
      3'b110:  mul_b = mul_q[3] ? y4_i : v_i;
      default: mul_b = mul_q[3] ? y5_i : t_i;
    endcase
  end

  fp_mul u_mul (
    .clk_i(clk_i),
    .en_i (mul_en_q),
    .a_i  (mul_a),
    .b_i  (mul_b),
    .y_o  (m)
  );

  // ---- adder -------------------------------------------------------------------------------------------------------
  reg [31:0] add_a;
  reg [31:0] add_b;

  always @* begin
    case (add_q[1:0])
      A_C:     add_a = c_q;
      A_Y:     add_a = y;
      A_P:     add_a = p_q;
      default: add_a = lo_q;
    endcase
    case (add_q[4:2])
      B_M:     add_b = m;
      B_P:     add_b = p_q;
      B_HI:    add_b = hi_q;
      B_Y:     add_b = y;
      default: add_b = (ELECTRICAL != 0) ? m : taken_i;
    endcase
  end

  fp_add u_add (
    .clk_i(clk_i),
    .en_i (add_en_q),
    .sub_i((ELECTRICAL != 0) ? add_q[5] : add_q[6]),
    .a_i  (add_a),
    .b_i  (add_b),
    .y_o  (y)
  );

  // ---- state -------------------------------------------------------------------------------------------------------
  wire [31:0] new_word = zero_i ? 32'd0 : y;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      hi_q <= 32'd0;
      lo_q <= 32'd0;
      p_q  <= 32'd0;
      c_q  <= 32'd0;
    end else if (clear_i) begin
      hi_q <= 32'd0;
      lo_q <= 32'd0;
      p_q  <= 32'd0;
      c_q  <= 32'd0;  // of a zero state, whatever the coefficients
    end else begin
      if (save_hi_q) hi_q <= new_word;
      if (save_lo_q) lo_q <= new_word;
      if (save_p_q) p_q <= m;
      if (save_c_i) c_q <= y;
    end
  end

  assign hi_o = save_hi_q ? new_word : hi_q;
  assign y_o  = y;
  assign m_o  = m;

  assign lo_o = lo_q;
endmodule

`default_nettype wire
