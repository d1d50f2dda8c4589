// fp_add: binary32 a + b, or a - b.
//
// Purpose    IEEE-754 addition, round to nearest even, subnormals in and out. An exact zero from operands of
//            unlike sign is +0. Any NaN result is the canonical NaN 7FC00000.
// Handshake  none: a result for every enabled clock. en_i = 0 freezes the whole pipeline.
// Latency    3 clocks: operands in clock n (before edge n + 1) give the result after edge n + 3.
// Stages     1 compare, swap, distance | 2 align, add | 3 normalise, round, pack.
//            Only a cancellation of two or more places needs a long left shift, and only when the exponents
//            differ by at most one: that result is exact. So rounding and long shift are parallel paths.
// Crossing   none. Registers have no reset: nothing in them counts until an operand has passed through.
`default_nettype none

module fp_add (
  input  wire        clk_i,
  input  wire        en_i,
  input  wire        sub_i,
  input  wire [31:0] a_i,
  input  wire [31:0] b_i,
  output reg  [31:0] y_o
);
  // ---- stage 1: which is larger, and by how many places -------------------------------------------------------
  wire        b_sign   = b_i[31] ^ sub_i;
  wire        b_larger = a_i[30:0] < b_i[30:0];
  wire        a_normal = |a_i[30:23];
  wire        b_normal = |b_i[30:23];
  wire  [7:0] a_exp    = {a_i[30:24], a_i[23] | ~a_normal};  // subnormals count from exponent 1
  wire  [7:0] b_exp    = {b_i[30:24], b_i[23] | ~b_normal};
  wire  [7:0] a_over_b = a_exp - b_exp;
  wire  [7:0] b_over_a = b_exp - a_exp;
  wire        a_max    = &a_i[30:23];
  wire        b_max    = &b_i[30:23];
  wire        a_nan    = a_max & (|a_i[22:0]);
  wire        b_nan    = b_max & (|b_i[22:0]);
  wire        unlike   = a_i[31] ^ b_sign;

  reg         sign1_q;
  reg         unlike1_q;
  reg  [7:0]  exp1_q;
  reg [23:0]  big1_q;
  reg [23:0]  small1_q;
  reg  [7:0]  distance1_q;
  reg         nan1_q;
  reg         inf1_q;

  always @(posedge clk_i) begin
    if (en_i) begin
      sign1_q     <= b_larger ? b_sign : a_i[31];
      unlike1_q   <= unlike;
      exp1_q      <= b_larger ? b_exp : a_exp;
      big1_q      <= b_larger ? {b_normal, b_i[22:0]} : {a_normal, a_i[22:0]};
      small1_q    <= b_larger ? {a_normal, a_i[22:0]} : {b_normal, b_i[22:0]};
      distance1_q <= b_larger ? b_over_a : a_over_b;
      nan1_q      <= a_nan | b_nan | (a_max & b_max & unlike);
      inf1_q      <= a_max | b_max;
    end
  end

  // ---- stage 2: align the smaller, add or subtract -------------------------------------------------------------
  // 24 bits, two guard bits and a sticky bit.
  wire        far      = |distance1_q[7:5];
  wire [55:0] shifted  = {small1_q, 32'd0} >> distance1_q[4:0];
  wire [26:0] aligned  = far ? {26'd0, |small1_q} : {shifted[55:30], |shifted[29:0]};
  wire [27:0] sum      = unlike1_q ? {1'b0, big1_q, 3'd0} - {1'b0, aligned}
                                   : {1'b0, big1_q, 3'd0} + {1'b0, aligned};
  // One at the place beyond which a left shift would pass exponent 1: the leading-zero count stops there.
  wire [26:0] limit    = (exp1_q > 8'd27) ? 27'd0 : (27'd1 << (5'd27 - exp1_q[4:0]));

  reg         sign2_q;
  reg         unlike2_q;
  reg  [7:0]  exp2_q;
  reg [27:0]  sum2_q;
  reg [26:0]  limit2_q;
  reg         nan2_q;
  reg         inf2_q;

  always @(posedge clk_i) begin
    if (en_i) begin
      sign2_q   <= sign1_q;
      unlike2_q <= unlike1_q;
      exp2_q    <= exp1_q;
      sum2_q    <= sum;
      limit2_q  <= limit;
      nan2_q    <= nan1_q;
      inf2_q    <= inf1_q;
    end
  end

  // ---- stage 3: normalise, round, pack -------------------------------------------------------------------------
  // Long path: left shift by two or more, or a subnormal result. Exact.
  wire  [4:0] zeros;
  wire        none_left;
  fp_lzc u_lzc (
    .x_i    ({sum2_q[26:0] | limit2_q, 5'd0}),
    .count_o(zeros),
    .zero_o (none_left)
  );
  wire [26:0] left      = sum2_q[26:0] << zeros;
  wire [30:0] exact     = {left[26] ? exp2_q - {3'd0, zeros} : 8'd0, left[25:3]};

  // Short path: right shift by one, none, or left shift by one; then rounding.
  wire        carry     = sum2_q[27];
  wire        straight  = sum2_q[26];
  wire [23:0] mant      = carry ? sum2_q[27:4] : straight ? sum2_q[26:3] : sum2_q[25:2];
  wire        guard     = carry ? sum2_q[3] : straight ? sum2_q[2] : sum2_q[1];
  wire        sticky    = carry ? |sum2_q[2:0] : straight ? |sum2_q[1:0] : sum2_q[0];
  wire  [7:0] exp_short = carry ? exp2_q + 8'd1 : straight ? exp2_q : exp2_q - 8'd1;
  wire        up        = guard & (sticky | mant[0]);
  wire [30:0] rounded   = {exp_short, mant[22:0]} + {30'd0, up};

  wire        use_short = carry | straight | (sum2_q[25] & (exp2_q != 8'd1));
  wire [30:0] word    = use_short ? rounded : exact;
  wire        overflow  = inf2_q | (use_short & (&rounded[30:23]));
  wire        zero      = ~(|sum2_q);
  wire        sign      = sign2_q & ~(zero & unlike2_q);

  always @(posedge clk_i) begin
    if (en_i) begin
      if (nan2_q)        y_o <= 32'h7FC0_0000;
      else if (overflow) y_o <= {sign2_q, 31'h7F80_0000};
      else               y_o <= {sign, word};
    end
  end

  wire unused = &{1'b0, none_left, mant[23], left[2:0]};
endmodule

`default_nettype wire
