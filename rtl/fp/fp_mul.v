// fp_mul: binary32 a * b.
//
// Purpose    IEEE-754 multiplication, round to nearest even, subnormals in and out. Any NaN result is the canonical
//            NaN 7FC00000. One 24 x 24 product: a 27 x 27 DSP block of Cyclone V.
// Handshake  none: a result for every enabled clock. en_i = 0 freezes the whole pipeline.
// Latency    2 clocks: operands in clock n (before edge n + 1) give the result after edge n + 2.
// Stages     1 product, exponent, place of the result | 2 shift, round, pack.
// Crossing   none. Registers have no reset: nothing in them counts until an operand has passed through.
`default_nettype none

module fp_mul (
  input  wire        clk_i,
  input  wire        en_i,
  input  wire [31:0] a_i,
  input  wire [31:0] b_i,
  output reg  [31:0] y_o
);
  // ---- stage 1 ---------------------------------------------------------------------------------------------------
  wire        a_normal = |a_i[30:23];
  wire        b_normal = |b_i[30:23];
  wire [23:0] a_mant   = {a_normal, a_i[22:0]};
  wire [23:0] b_mant   = {b_normal, b_i[22:0]};
  wire        a_max    = &a_i[30:23];
  wire        b_max    = &b_i[30:23];
  wire        a_nan    = a_max & (|a_i[22:0]);
  wire        b_nan    = b_max & (|b_i[22:0]);
  wire        a_zero   = ~a_normal & ~(|a_i[22:0]);
  wire        b_zero   = ~b_normal & ~(|b_i[22:0]);

  // Of two subnormals the product is far below the smallest one: the leading zeros of one operand are enough.
  wire  [4:0] zeros;
  wire        none_left;
  fp_lzc u_lzc (
    .x_i    ({a_normal ? b_mant : a_mant, 8'd0}),
    .count_o(zeros),
    .zero_o (none_left)
  );

  // Biased exponent of the product's bit 46; signed, -125 to 381.
  wire signed [9:0] exp_raw   = $signed({2'd0, a_i[30:24], a_i[23] | ~a_normal})
                              + $signed({2'd0, b_i[30:24], b_i[23] | ~b_normal}) - 10'sd127;
  wire signed [9:0] exp_above = exp_raw - 10'sd1;                // left shift at which exponent 1 is reached
  wire signed [9:0] zeros_ext = $signed({5'd0, zeros});
  wire              limited   = exp_above < zeros_ext;           // the result's exponent is 1 (or subnormal)
  wire signed [9:0] shift     = limited ? ((exp_above < -10'sd31) ? -10'sd31 : exp_above) : zeros_ext;
  wire signed [9:0] exp_norm  = limited ? 10'sd1 : exp_raw - zeros_ext;

  reg        sign_q;
  reg [47:0] product_q;
  reg  [5:0] right_q;     // right shift of {product, 24 zeros}: 24 less the left shift, 1 to 55
  reg  [8:0] exp_q;       // 1 to 381
  reg        nan_q;
  reg        inf_q;

  wire [5:0] right = 6'd24 - shift[5:0];

  always @(posedge clk_i) begin
    if (en_i) begin
      sign_q    <= a_i[31] ^ b_i[31];
      product_q <= a_mant * b_mant;
      right_q   <= right;
      exp_q     <= exp_norm[8:0];
      nan_q     <= a_nan | b_nan | (a_max & b_zero) | (b_max & a_zero);
      inf_q     <= a_max | b_max;
    end
  end

  // ---- stage 2 ---------------------------------------------------------------------------------------------------
  // Places of the product that a right shift of a subnormal result drops below `placed`.
  wire        to_right = right_q > 6'd24;
  wire  [4:0] dropped  = right_q[4:0] - 5'd24;
  wire [30:0] mask     = to_right ? ~(31'h7FFF_FFFF << dropped) : 31'd0;
  wire        lost     = |(product_q[30:0] & mask);
  wire [71:0] placed   = {product_q, 24'd0} >> right_q;

  wire        top      = placed[47];
  wire [23:0] mant     = top ? placed[47:24] : placed[46:23];
  wire        guard    = top ? placed[23] : placed[22];
  wire        sticky   = (|placed[21:0]) | (top & placed[22]) | lost;
  wire  [8:0] exp      = top ? exp_q + 9'd1 : placed[46] ? exp_q : 9'd0;
  wire        up       = guard & (sticky | mant[0]);
  wire [31:0] word   = {exp, mant[22:0]} + {31'd0, up};
  wire        overflow = inf_q | word[31] | (&word[30:23]);

  always @(posedge clk_i) begin
    if (en_i) begin
      if (nan_q)         y_o <= 32'h7FC0_0000;
      else if (overflow) y_o <= {sign_q, 31'h7F80_0000};
      else               y_o <= {sign_q, word[30:0]};
    end
  end

  wire unused = &{1'b0, none_left, mant[23], placed[71:48], shift[9:6], exp_norm[9]};
endmodule

`default_nettype wire
