// rtds_row: one row of the motor's update, that is, one state variable in two words.
//
// Purpose    Computes, in binary32 and in this order, with (i, w) the high words of both rows:
//              e = u - s                  s = (R i) + (Kb w)         ELECTRICAL = 1, u = V, state x = i
//              e = s - u                  s = (Km i) - (B w)         ELECTRICAL = 0, u = T, state x = w
//              d = (g1 e1) -/+ (g2 e2)    minus for the electrical row
//              t = d + lo;  hi' = hi + t;  lo' = t - (hi' - hi)
//            s of the next step is computed when hi' stands, before the next input is known.
//            With effects, between t and the last sums, after rtds_friction has taken its part of the free speed:
//              t' = t + k y4   ELECTRICAL = 1: k = rho, y4 = the speed taken
//              t' = t - taken  ELECTRICAL = 0; and k y4, k y5 before it: k = g2, y4, y5 = levels of friction
//            One adder and one multiplier; the sequencer says what they work on (it has the table).
// Handshake  none of its own: op_i, mul_sel_i, the enables and the save_*_i of rtds_sequencer. u_i is used in the clock
//            of the strobe only.
// Latency    fp_add 3, fp_mul 2 clocks; of the step: see rtds_sequencer.
// Crossing   none.
`default_nettype none

module rtds_row #(
  parameter ELECTRICAL = 1
) (
  input  wire        clk_i,
  input  wire        rst_ni,
  input  wire        clear_i,     // state to zero
  // from rtds_sequencer
  input  wire  [2:0] add_en_i,    // a bit for each stage of the adder, the first in bit 0
  input  wire  [1:0] mul_en_i,
  input  wire  [2:0] op_i,        // what enters the adder in this clock
  input  wire  [2:0] mul_sel_i,   // into the multiplier: {friction, G e rather than S x, second rather than first}
  input  wire        save_p_i,    // first product, or s
  input  wire        save_s_i,    // it is s
  input  wire        save_hi_i,
  input  wire        save_lo_i,   // t, later lo'
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
  // input, state of both rows, e of both rows
  input  wire [31:0] u_i,
  input  wire [31:0] i_hi_i,
  input  wire [31:0] w_hi_i,
  input  wire [31:0] e1_i,
  input  wire [31:0] e2_i,
  output wire [31:0] e_o,         // the adder's result; e while mul_sel_i[1] is 1
  output reg  [31:0] hi_o,
  output reg  [31:0] lo_o         // t while a step is between its two sums
);
  // The same codes as in rtds_sequencer.
  localparam [2:0] OP_E  = 3'd0;
  localparam [2:0] OP_D  = 3'd1;
  localparam [2:0] OP_T  = 3'd2;
  localparam [2:0] OP_HI = 3'd3;
  localparam [2:0] OP_Z  = 3'd4;
  localparam [2:0] OP_LO = 3'd5;
  localparam [2:0] OP_S  = 3'd6;
  localparam [2:0] OP_P  = 3'd7;

  wire [31:0] m;
  wire [31:0] y;
  reg  [31:0] p_q;   // s between the steps; then the first product, until it is added to the second
  reg  [31:0] mul_a;
  reg  [31:0] mul_b;

  always @* begin
    case (mul_sel_i)
      3'b000: begin
        mul_a = a1_i;
        mul_b = i_hi_i;
      end
      3'b001: begin
        mul_a = a2_i;
        mul_b = w_hi_i;
      end
      3'b010: begin
        mul_a = g1_i;
        mul_b = e1_i;
      end
      3'b011: begin
        mul_a = g2_i;
        mul_b = e2_i;
      end
      default: begin
        mul_a = k_i;
        mul_b = mul_sel_i[0] ? y5_i : y4_i;
      end
    endcase
  end

  fp_mul u_mul (
    .clk_i(clk_i),
    .en_i (mul_en_i),
    .a_i  (mul_a),
    .b_i  (mul_b),
    .y_o  (m)
  );

  // The adder takes p or its own result, negated or not, and one of four others.
  reg [31:0] add_a;
  reg [31:0] add_b;
  reg        sub;

  always @* begin
    add_a = p_q;
    add_b = m;
    sub   = 1'b0;
    case (op_i)
      OP_E: begin
        add_a[31] = p_q[31] ^ (ELECTRICAL != 0);
        add_b     = u_i;
        sub       = (ELECTRICAL == 0);
      end
      OP_D: sub = (ELECTRICAL != 0);
      OP_T: begin
        add_a = y;
        add_b = lo_o;
      end
      OP_HI: begin
        add_a = y;
        add_b = hi_o;
      end
      OP_Z: begin
        add_a = y;
        add_b = hi_o;
        sub   = 1'b1;
      end
      OP_LO: begin  // lo_o holds t
        add_a = {~y[31], y[30:0]};
        add_b = lo_o;
      end
      OP_S: sub = (ELECTRICAL == 0);
      OP_P: begin  // lo_o holds t
        add_a = lo_o;
        add_b = (ELECTRICAL != 0) ? m : taken_i;
        sub   = (ELECTRICAL == 0);
      end
      default: ;
    endcase
  end

  fp_add u_add (
    .clk_i(clk_i),
    .en_i (add_en_i),
    .sub_i(sub),
    .a_i  (add_a),
    .b_i  (add_b),
    .y_o  (y)
  );
  assign e_o = y;
  assign m_o = m;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      hi_o <= 32'd0;
      lo_o <= 32'd0;
      p_q  <= 32'd0;
    end else if (clear_i) begin
      hi_o <= 32'd0;
      lo_o <= 32'd0;
      p_q  <= 32'd0;  // s of a zero state, whatever the coefficients
    end else begin
      if (save_hi_i) hi_o <= zero_i ? 32'd0 : y;
      if (save_lo_i) lo_o <= zero_i ? 32'd0 : y;
      if (save_p_i) p_q <= save_s_i ? y : m;
    end
  end
endmodule

`default_nettype wire
