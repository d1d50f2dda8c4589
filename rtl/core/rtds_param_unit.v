// rtds_param_unit: from motor constants and step to the coefficients of the update.
//
// Purpose    th = h theta (theta 1 or 1/2), L' = L + th R, J' = J + th B, c = th Kb, d = th Km, D = L' J' + c d,
//            q = h / D, then G11 = q J', G12 = q c, G21 = q d, G22 = q L'. Nothing is subtracted, so nothing
//            cancels. One multiplier, one adder, one divider, one operation after the other.
//            With rho_i also rho = c / L' = G12 / G22, which friction needs; else the record's stays.
//            fault_o: a parameter or a coefficient is no positive normal number (zero, negative, NaN, infinite,
//            subnormal).
// Handshake  start_i for one clock; the parameters stay from the next clock to done_o. done_o for one clock, when the coefficients
//            and fault_o stand; they hold until the next start_i. A start_i while busy is not allowed.
// Latency    start_i in clock n (before edge n + 1) gives done_o after edge n + 90, with rho_i n + 123, always.
// Format     binary32, SI. motor_i and coef_o: rtds_core_records.vh.
// Crossing   none.
`default_nettype none

module rtds_param_unit (
  input  wire         clk_i,
  input  wire         rst_ni,
  input  wire         start_i,
  input  wire [191:0] motor_i,
  input  wire  [31:0] h_i,
  input  wire         rho_i,
  input  wire         method_i,   // 0 backward Euler (theta 1), 1 trapezoidal (theta 1/2)
  output wire         busy_o,
  output wire         done_o,
  output wire         fault_o,
  output wire [287:0] coef_o
);
  `include "fp_clocks.vh"
  `include "rtds_core_records.vh"

  // Which motor it is was chosen far away: what is computed comes from registers here. The first operation needs none of it.
  reg [MOTOR_BITS-1:0] motor_q;

  always @(posedge clk_i) motor_q <= motor_i;

  wire [31:0] r  = motor_q[MOTOR_R+:32];
  wire [31:0] l  = motor_q[MOTOR_L+:32];
  wire [31:0] km = motor_q[MOTOR_KM+:32];
  wire [31:0] kb = motor_q[MOTOR_KB+:32];
  wire [31:0] j  = motor_q[MOTOR_J+:32];
  wire [31:0] b  = motor_q[MOTOR_B+:32];

  localparam [31:0] ONE  = 32'h3F80_0000;
  localparam [31:0] HALF = 32'h3F00_0000;

  // The operations, in order. lp, jp, c, d end as G22, G11, G12, G21.
  localparam [3:0] OP_TH    = 4'd0;   // x  = h * theta
  localparam [3:0] OP_A     = 4'd1;   // y  = x * R
  localparam [3:0] OP_LP    = 4'd2;   // lp = L + y
  localparam [3:0] OP_B     = 4'd3;   // y  = x * B
  localparam [3:0] OP_JP    = 4'd4;   // jp = J + y
  localparam [3:0] OP_C     = 4'd5;   // c  = x * Kb
  localparam [3:0] OP_D     = 4'd6;   // d  = x * Km
  localparam [3:0] OP_CD    = 4'd7;   // y  = c * d
  localparam [3:0] OP_LJ    = 4'd8;   // x  = lp * jp
  localparam [3:0] OP_DET   = 4'd9;   // y  = x + y
  localparam [3:0] OP_SCALE = 4'd10;  // x  = h / y
  localparam [3:0] OP_G11   = 4'd11;  // jp = x * jp
  localparam [3:0] OP_G12   = 4'd12;  // c  = x * c
  localparam [3:0] OP_G21   = 4'd13;  // d  = x * d
  localparam [3:0] OP_G22   = 4'd14;  // lp = x * lp
  localparam [3:0] OP_RHO   = 4'd15;  // rho = c / lp, between d and c d

  // Clocks of an operation, less one: latency of the operator.
  localparam [5:0] LAST_OTHER = (FP_ADD_CLOCKS[5:0] > FP_MUL_CLOCKS[5:0]) ? FP_ADD_CLOCKS[5:0] : FP_MUL_CLOCKS[5:0];
  localparam [5:0] LAST_DIV   = FP_DIV_CLOCKS[5:0];

  reg  [31:0] x_q;
  reg  [31:0] y_q;
  reg  [31:0] lp_q;
  reg  [31:0] jp_q;
  reg  [31:0] c_q;
  reg  [31:0] d_q;
  reg  [31:0] rho_q;

  // ---- sequence --------------------------------------------------------------------------------------------------
  reg       busy_q;
  reg [3:0] op_q;
  reg [5:0] clock_q;   // clock within the operation
  reg       first_q;   // its first clock
  reg       done_q;
  reg       fault_q;

  wire       is_add = (op_q == OP_LP) | (op_q == OP_JP) | (op_q == OP_DET);
  wire       is_rho = op_q == OP_RHO;
  wire       is_div = (op_q == OP_SCALE) | is_rho;
  wire [5:0] last   = is_div ? LAST_DIV : LAST_OTHER;

  // ---- operators -------------------------------------------------------------------------------------------------
  reg  [31:0] mul_a;
  reg  [31:0] mul_b;
  wire [31:0] mul_y;
  wire [31:0] add_y;
  wire [31:0] div_y;
  wire        div_valid;

  always @* begin
    mul_a = x_q;
    mul_b = lp_q;
    case (op_q)
      OP_TH: begin
        mul_a = h_i;
        mul_b = method_i ? HALF : ONE;
      end
      OP_A:   mul_b = r;
      OP_B:   mul_b = b;
      OP_C:   mul_b = kb;
      OP_D:   mul_b = km;
      OP_CD: begin
        mul_a = c_q;
        mul_b = d_q;
      end
      OP_LJ:  mul_a = jp_q;
      OP_G11: mul_b = jp_q;
      OP_G12: mul_b = c_q;
      OP_G21: mul_b = d_q;
      default: ;
    endcase
  end

  fp_mul u_mul (
    .clk_i(clk_i),
    .en_i ({3{busy_q}}),
    .a_i  (mul_a),
    .b_i  (mul_b),
    .y_o  (mul_y)
  );
  fp_add u_add (
    .clk_i(clk_i),
    .en_i ({3{busy_q}}),
    .sub_i(1'b0),
    .a_i  ((op_q == OP_LP) ? l : (op_q == OP_JP) ? j : x_q),
    .b_i  (y_q),
    .y_o  (add_y)
  );
  fp_div u_div (
    .clk_i  (clk_i),
    .rst_ni (rst_ni),
    .en_i   (busy_q),
    .start_i(first_q & is_div),
    .a_i    (is_rho ? c_q : h_i),
    .b_i    (is_rho ? lp_q : y_q),
    .valid_o(div_valid),
    .y_o    (div_y)
  );

  wire [31:0] result = is_div ? div_y : is_add ? add_y : mul_y;

  // ---- sequence, results, fault ----------------------------------------------------------------------------------
  function automatic usable;  // a positive normal number; the argument is {sign, exponent}
    input [8:0] x;
    usable = ~x[8] & (|x[7:0]) & ~(&x[7:0]);
  endfunction

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      busy_q  <= 1'b0;
      op_q    <= OP_TH;
      clock_q <= 6'd0;
      first_q <= 1'b0;
      done_q  <= 1'b0;
      fault_q <= 1'b0;
      x_q     <= 32'd0;
      y_q     <= 32'd0;
      lp_q    <= 32'd0;
      jp_q    <= 32'd0;
      c_q     <= 32'd0;
      d_q     <= 32'd0;
      rho_q   <= 32'd0;
    end else begin
      done_q  <= 1'b0;
      first_q <= start_i;
      if (start_i) begin
        busy_q  <= 1'b1;
        op_q    <= OP_TH;
        clock_q <= 6'd0;
      end else if (busy_q) begin
        clock_q <= clock_q + 6'd1;
        if (op_q == OP_TH)
          fault_q <= ~(usable(r[31:23]) & usable(l[31:23]) & usable(km[31:23]) & usable(kb[31:23])
                     & usable(j[31:23]) & usable(b[31:23]) & usable(h_i[31:23]));
        if (clock_q == last) begin
          clock_q <= 6'd0;
          op_q    <= is_rho ? OP_CD : (rho_i & (op_q == OP_D)) ? OP_RHO : op_q + 4'd1;
          first_q <= 1'b1;
          case (op_q)
            OP_TH, OP_LJ, OP_SCALE:    x_q  <= result;
            OP_A, OP_B, OP_CD, OP_DET: y_q  <= result;
            OP_LP, OP_G22:             lp_q <= result;
            OP_JP, OP_G11:             jp_q <= result;
            OP_C, OP_G12:              c_q  <= result;
            OP_D, OP_G21:              d_q  <= result;
            OP_RHO:                    rho_q <= result;
            default: ;
          endcase
          if (op_q == OP_G11 || op_q == OP_G12 || op_q == OP_G21 || op_q == OP_G22)
            fault_q <= fault_q | ~usable(result[31:23]);
          if (op_q == OP_G22) begin
            busy_q  <= 1'b0;
            first_q <= 1'b0;
            done_q  <= 1'b1;
          end
        end
      end
    end
  end

  assign coef_o[COEF_R+:32]   = r;
  assign coef_o[COEF_KB+:32]  = kb;
  assign coef_o[COEF_KM+:32]  = km;
  assign coef_o[COEF_B+:32]   = b;
  assign coef_o[COEF_G11+:32] = jp_q;
  assign coef_o[COEF_G12+:32] = c_q;
  assign coef_o[COEF_G21+:32] = d_q;
  assign coef_o[COEF_G22+:32] = lp_q;
  assign coef_o[COEF_RHO+:32] = rho_q;
  assign busy_o               = busy_q;

  wire unused = &{1'b0, div_valid};

  assign done_o  = done_q;
  assign fault_o = fault_q;
endmodule

`default_nettype wire
