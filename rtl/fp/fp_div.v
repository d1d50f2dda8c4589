// fp_div: binary32 a / b, one at a time.
//
// Purpose    IEEE-754 division, round to nearest even, subnormals in and out. Any NaN result is the canonical NaN
//            7FC00000; a finite number over zero is an infinity. One quotient bit a clock: small, and used where a
//            result is wanted now and then (the parameter unit).
// Handshake  start_i with the operands; valid_o for one clock with the result, which then holds. A start_i while
//            busy starts over. en_i = 0 freezes everything, start_i included.
// Latency    32 clocks: start_i in clock n (before edge n + 1) gives valid_o and the result after edge n + 32.
// Steps      1 take | 2, 3 shift a, b | 4 .. 29 quotient | 30 place | 31 round | 32 pack
// Crossing   none.
`default_nettype none

module fp_div (
  input  wire        clk_i,
  input  wire        rst_ni,
  input  wire        en_i,
  input  wire        start_i,
  input  wire [31:0] a_i,
  input  wire [31:0] b_i,
  output reg         valid_o,
  output reg  [31:0] y_o
);
  localparam [4:0] STEP_IDLE    = 5'd0;
  localparam [4:0] STEP_SHIFT_A = 5'd1;
  localparam [4:0] STEP_SHIFT_B = 5'd2;
  localparam [4:0] STEP_FIRST   = 5'd3;
  localparam [4:0] STEP_LAST    = 5'd28;
  localparam [4:0] STEP_PLACE   = 5'd29;
  localparam [4:0] STEP_ROUND   = 5'd30;
  localparam [4:0] STEP_PACK    = 5'd31;

  reg  [4:0] step_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      step_q  <= STEP_IDLE;
      valid_o <= 1'b0;
    end else if (en_i) begin
      valid_o <= (step_q == STEP_PACK) & ~start_i;
      if (start_i)                  step_q <= STEP_SHIFT_A;
      else if (step_q == STEP_PACK) step_q <= STEP_IDLE;
      else if (step_q != STEP_IDLE) step_q <= step_q + 5'd1;
    end
  end

  // ---- operands, one after the other brought to a leading one ----------------------------------------------------
  reg [31:0] a_q;
  reg [31:0] b_q;

  wire        a_max  = &a_q[30:23];
  wire        b_max  = &b_q[30:23];
  wire        a_nan  = a_max & (|a_q[22:0]);
  wire        b_nan  = b_max & (|b_q[22:0]);
  wire        a_zero = ~(|a_q[30:0]);
  wire        b_zero = ~(|b_q[30:0]);

  wire [30:0] operand = (step_q == STEP_SHIFT_A) ? a_q[30:0] : b_q[30:0];
  wire        normal  = |operand[30:23];
  wire  [4:0] zeros;
  wire        none_left;

  fp_lzc u_lzc (
    .x_i    ({normal, operand[22:0], 8'd0}),
    .count_o(zeros),
    .zero_o (none_left)
  );

  wire        [23:0] mant = {normal, operand[22:0]} << zeros;
  wire signed  [9:0] exp  = $signed({2'd0, operand[30:24], operand[23] | ~normal}) - $signed({5'd0, zeros});

  // ---- quotient, placing, rounding -------------------------------------------------------------------------------
  reg        [24:0] rest_q;   // remainder, below twice the divisor
  reg        [23:0] divisor_q;
  reg        [25:0] quot_q;   // bit 25: the place of 1
  reg signed  [9:0] exp_q;    // of a quotient in [1, 2), biased: -149 to 403
  reg               sticky_q;
  reg        [30:0] packed_q;
  reg               over_q;

  wire [25:0] minus    = {1'b0, rest_q} - {2'd0, divisor_q};
  wire        fits     = ~minus[25];
  wire [24:0] left_over = fits ? minus[24:0] : rest_q;

  // Put the leading one at bit 25, or leave it lower where the result is subnormal.
  wire               top      = quot_q[25];
  wire        [25:0] quot     = top ? quot_q : {quot_q[24:0], 1'b0};
  wire signed  [9:0] exp_norm = top ? exp_q : exp_q - 10'sd1;
  wire               tiny     = exp_norm < 10'sd1;
  wire signed  [9:0] deep     = 10'sd1 - exp_norm;
  wire         [4:0] right    = ~tiny ? 5'd0 : (deep > 10'sd31) ? 5'd31 : deep[4:0];

  // Shifted by 8, by 2 and by 1; what falls off joins the sticky bit.
  reg [25:0] by8;
  reg        lost8;
  reg [25:0] by2;
  reg        lost2;

  always @* begin
    case (right[4:3])
      2'd0: begin
        by8   = quot;
        lost8 = |rest_q;
      end
      2'd1: begin
        by8   = {8'd0, quot[25:8]};
        lost8 = (|rest_q) | (|quot[7:0]);
      end
      2'd2: begin
        by8   = {16'd0, quot[25:16]};
        lost8 = (|rest_q) | (|quot[15:0]);
      end
      default: begin
        by8   = {24'd0, quot[25:24]};
        lost8 = (|rest_q) | (|quot[23:0]);
      end
    endcase
    case (right[2:1])
      2'd0: begin
        by2   = by8;
        lost2 = lost8;
      end
      2'd1: begin
        by2   = {2'd0, by8[25:2]};
        lost2 = lost8 | (|by8[1:0]);
      end
      2'd2: begin
        by2   = {4'd0, by8[25:4]};
        lost2 = lost8 | (|by8[3:0]);
      end
      default: begin
        by2   = {6'd0, by8[25:6]};
        lost2 = lost8 | (|by8[5:0]);
      end
    endcase
  end

  wire [25:0] placed = right[0] ? {1'b0, by2[25:1]} : by2;
  wire        lost   = lost2 | (right[0] & by2[0]);

  wire up = quot_q[1] & (quot_q[0] | sticky_q | quot_q[2]);

  always @(posedge clk_i) begin
    if (en_i) begin
      if (start_i) begin
        a_q <= a_i;
        b_q <= b_i;
      end
      if (step_q == STEP_SHIFT_A) begin
        rest_q <= {1'b0, mant};
        exp_q  <= exp + 10'sd127;
      end
      if (step_q == STEP_SHIFT_B) begin
        divisor_q <= mant;
        exp_q     <= exp_q - exp;
        quot_q    <= 26'd0;
      end
      if (step_q >= STEP_FIRST && step_q <= STEP_LAST) begin
        quot_q <= {quot_q[24:0], fits};
        rest_q <= {left_over[23:0], 1'b0};
      end
      if (step_q == STEP_PLACE) begin
        quot_q   <= placed;
        sticky_q <= lost;
        exp_q    <= tiny ? (placed[25] ? 10'sd1 : 10'sd0) : exp_norm;
      end
      if (step_q == STEP_ROUND) begin
        packed_q <= {exp_q[7:0], quot_q[24:2]} + {30'd0, up};
        over_q   <= exp_q > 10'sd254;
      end
      if (step_q == STEP_PACK) begin
        if (a_nan | b_nan | (a_max & b_max) | (a_zero & b_zero)) y_o <= 32'h7FC0_0000;
        else if (a_max | b_zero | (~b_max & ~a_zero & (over_q | (&packed_q[30:23]))))
          y_o <= {a_q[31] ^ b_q[31], 31'h7F80_0000};
        else if (a_zero | b_max) y_o <= {a_q[31] ^ b_q[31], 31'd0};
        else y_o <= {a_q[31] ^ b_q[31], packed_q};
      end
    end
  end

  wire unused = &{1'b0, none_left, left_over[24], deep[9:5]};
endmodule

`default_nettype wire
