// fp_div: binary32 a / b, one at a time.
//
// Purpose    IEEE-754 division, round to nearest even, subnormals in and out. Any NaN result is the canonical NaN
//            7FC00000; a finite number over zero is an infinity. One quotient bit a clock: small, and used where a
//            result is wanted now and then (the parameter unit).
// Handshake  start_i with the operands; valid_o for one clock with the result, which then holds. A start_i while
//            busy starts over. en_i = 0 freezes everything, start_i included.
// Latency    31 clocks: start_i in clock n (before edge n + 1) gives valid_o and the result after edge n + 31.
// Steps      1 take | 2 shift | 3 .. 28 quotient | 29 place | 30 round | 31 pack
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
  localparam [4:0] STEP_IDLE  = 5'd0;
  localparam [4:0] STEP_SHIFT = 5'd1;
  localparam [4:0] STEP_FIRST = 5'd2;
  localparam [4:0] STEP_LAST  = 5'd27;
  localparam [4:0] STEP_PLACE = 5'd28;
  localparam [4:0] STEP_ROUND = 5'd29;
  localparam [4:0] STEP_PACK  = 5'd30;

  reg  [4:0] step_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      step_q  <= STEP_IDLE;
      valid_o <= 1'b0;
    end else if (en_i) begin
      valid_o <= (step_q == STEP_PACK) & ~start_i;
      if (start_i)                  step_q <= STEP_SHIFT;
      else if (step_q == STEP_PACK) step_q <= STEP_IDLE;
      else if (step_q != STEP_IDLE) step_q <= step_q + 5'd1;
    end
  end

  // ---- operands, both brought to a leading one -------------------------------------------------------------------
  reg [31:0] a_q;
  reg [31:0] b_q;

  wire        a_normal = |a_q[30:23];
  wire        b_normal = |b_q[30:23];
  wire        a_max    = &a_q[30:23];
  wire        b_max    = &b_q[30:23];
  wire        a_nan    = a_max & (|a_q[22:0]);
  wire        b_nan    = b_max & (|b_q[22:0]);
  wire        a_zero   = ~(|a_q[30:0]);
  wire        b_zero   = ~(|b_q[30:0]);
  wire  [4:0] a_zeros;
  wire  [4:0] b_zeros;
  wire        a_none;
  wire        b_none;

  fp_lzc u_lzc_a (
    .x_i    ({a_normal, a_q[22:0], 8'd0}),
    .count_o(a_zeros),
    .zero_o (a_none)
  );
  fp_lzc u_lzc_b (
    .x_i    ({b_normal, b_q[22:0], 8'd0}),
    .count_o(b_zeros),
    .zero_o (b_none)
  );

  wire [23:0] a_mant = {a_normal, a_q[22:0]} << a_zeros;
  wire [23:0] b_mant = {b_normal, b_q[22:0]} << b_zeros;
  // Biased exponent of a quotient in [1, 2): signed, -149 to 403.
  wire signed [9:0] exp_raw = $signed({2'd0, a_q[30:24], a_q[23] | ~a_normal}) - $signed({5'd0, a_zeros})
                            - $signed({2'd0, b_q[30:24], b_q[23] | ~b_normal}) + $signed({5'd0, b_zeros})
                            + 10'sd127;

  // ---- quotient, placing, rounding -------------------------------------------------------------------------------
  reg        [24:0] rest_q;   // remainder, below twice the divisor
  reg        [23:0] divisor_q;
  reg        [25:0] quot_q;   // bit 25: the place of 1
  reg signed  [9:0] exp_q;
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
  wire        [56:0] placed   = {quot, 31'd0} >> right;
  wire               lost     = (|placed[30:0]) | (|rest_q);

  wire up = quot_q[1] & (quot_q[0] | sticky_q | quot_q[2]);

  always @(posedge clk_i) begin
    if (en_i) begin
      if (start_i) begin
        a_q <= a_i;
        b_q <= b_i;
      end
      if (step_q == STEP_SHIFT) begin
        rest_q    <= {1'b0, a_mant};
        divisor_q <= b_mant;
        exp_q     <= exp_raw;
        quot_q    <= 26'd0;
      end
      if (step_q >= STEP_FIRST && step_q <= STEP_LAST) begin
        quot_q <= {quot_q[24:0], fits};
        rest_q <= {left_over[23:0], 1'b0};
      end
      if (step_q == STEP_PLACE) begin
        quot_q   <= placed[56:31];
        sticky_q <= lost;
        exp_q    <= tiny ? (placed[56] ? 10'sd1 : 10'sd0) : exp_norm;
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

  wire unused = &{1'b0, a_none, b_none, left_over[24], deep[9:5]};
endmodule

`default_nettype wire
