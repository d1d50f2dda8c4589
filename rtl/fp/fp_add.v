// fp_add: binary32 a + b, or a - b.
//
// Purpose    IEEE-754 addition, round to nearest even, subnormals in and out. An exact zero from operands of
//            unlike sign is +0. Any NaN result is the canonical NaN 7FC00000.
// Handshake  none: a result for every enabled clock. en_i has a bit for each stage, stage 1 in bit 0: a stage whose bit is
//            0 keeps what it has. All bits alike: 0 freezes the whole pipeline. A one that moves up by a place each clock
//            takes one pair of operands through, and the result then holds.
// Latency    3 clocks: operands in clock n (before edge n + 1) give the result after edge n + 3.
// Stages     1 compare, swap, distance | 2 align, add; beside it the difference of near operands and its leading zeros |
//            3 round the sum, or shift the difference; pack.
//            No result needs a long shift and a rounding, too: places are lost in number only where operands of unlike
//            sign are less than two exponents apart, and then the difference has no places that a rounding could drop
//            (M. P. Farmwald, "On the Design of High Performance Digital Arithmetic Units", 1981: near and far path).
// Style      What a stage computes stands in functions called under its enable, so that a compiled simulation passes
//            over a stage at rest; otherwise these would be most of its time. Automatic ones: what a static function
//            computes on its way is kept in memory.
// Crossing   none. Registers have no reset: nothing in them counts until an operand has passed through.
`default_nettype none

module fp_add (
  input  wire        clk_i,
  input  wire  [2:0] en_i,
  input  wire        sub_i,
  input  wire [31:0] a_i,
  input  wire [31:0] b_i,
  output wire [31:0] y_o
);
  // ---- stage 1: which is larger, and by how many places ----------------------------------------------------------
  function automatic is_nan;  // one operand is, or infinity less infinity
    input [30:0] a;
    input [30:0] b;
    input        unlike;
    is_nan = ((&a[30:23]) & ((|a[22:0]) | ((&b[30:23]) & unlike))) | ((&b[30:23]) & (|b[22:0]));
  endfunction

  function automatic [3:0] signs;  // {sign of the sum, unlike signs, NaN, infinite}
    input [31:0] a;
    input [31:0] b;
    signs = {(a[30:0] < b[30:0]) ? b[31] : a[31], a[31] ^ b[31], is_nan(a[30:0], b[30:0], a[31] ^ b[31]),
             (&a[30:23]) | (&b[30:23])};
  endfunction

  function automatic [7:0] exponent;  // subnormals count from exponent 1
    input [7:0] x;
    exponent = {x[7:1], x[0] | ~(|x)};
  endfunction

  reg         sign1_q;
  reg         unlike1_q;
  reg  [30:0] big1_q;
  reg  [30:0] small1_q;
  reg   [7:0] distance1_q;
  reg         nan1_q;
  reg         inf1_q;

  always @(posedge clk_i) begin
    if (en_i[0]) begin
      {sign1_q, unlike1_q, nan1_q, inf1_q} <= signs(a_i, {b_i[31] ^ sub_i, b_i[30:0]});
      big1_q      <= (a_i[30:0] < b_i[30:0]) ? b_i[30:0] : a_i[30:0];
      small1_q    <= (a_i[30:0] < b_i[30:0]) ? a_i[30:0] : b_i[30:0];
      distance1_q <= (a_i[30:0] < b_i[30:0]) ? exponent(b_i[30:23]) - exponent(a_i[30:23])
                                             : exponent(a_i[30:23]) - exponent(b_i[30:23]);
    end
  end

  // ---- stage 2: align the smaller, add or subtract -------------------------------------------------------------
  /* verilator lint_off UNUSEDSIGNAL */
  function automatic [27:0] sum;  // 25 bits, two guard bits and a sticky bit
    input        unlike;
    input [30:0] big;
    input [30:0] small_op;
    input  [7:0] distance;
    reg   [25:0] mant;
    reg   [25:0] by8;   // shifted by 8, by 2 and by 1; what falls off joins the sticky bit
    reg   [25:0] by2;
    reg          lost;
    reg   [26:0] aligned;
    begin
      mant     = {|small_op[30:23], small_op[22:0], 2'd0};
      by8      = mant >> {distance[4:3], 3'd0};
      by2      = by8 >> {distance[2:1], 1'd0};
      lost     = (|(mant & ~(26'h3FF_FFFF << {distance[4:3], 3'd0})))
               | (|(by8 & ~(26'h3FF_FFFF << {distance[2:1], 1'd0}))) | (by2[0] & distance[0]);
      aligned  = (|distance[7:5]) ? {26'd0, |mant} : {by2 >> distance[0], lost};
      sum      = {1'b0, |big[30:23], big[22:0], 3'd0} + ({1'b0, aligned} ^ {28{unlike}}) + {27'd0, unlike};
    end
  endfunction

  `include "fp_lzc.vh"

  // One at the place beyond which a left shift would pass exponent 1: the count stops there.
  function automatic [27:0] limit;
    input [7:0] exp;
    limit = (exp > 8'd27) ? 28'd0 : (28'h800_0000 >> exp[4:0]);
  endfunction

  // Left shift of the sum (of 28 bits) that near operands of unlike sign need: their difference has 25 bits.
  function automatic [4:0] near_zeros;
    input [30:0] big;
    input [30:0] small_op;
    input        apart;  // by one place
    reg   [27:0] stop;
    reg   [24:0] difference;
    begin
      stop       = limit(exponent(big[30:23]));
      difference = {|big[30:23], big[22:0], 1'b0}
                 - (apart ? {1'b0, |small_op[30:23], small_op[22:0]} : {|small_op[30:23], small_op[22:0], 1'b0});
      near_zeros = leading_zeros({1'b0, difference | stop[26:2], 6'd0});
    end
  endfunction
  /* verilator lint_on UNUSEDSIGNAL */

  reg         sign2_q;
  reg         unlike2_q;
  reg   [7:0] exp2_q;
  reg  [27:0] sum2_q;
  reg   [1:0] stop2_q;   // a shift ends at the first place, at the second one
  reg   [4:0] zeros2_q;
  reg         nan2_q;
  reg         inf2_q;

  always @(posedge clk_i) begin
    if (en_i[1]) begin
      sign2_q   <= sign1_q;
      unlike2_q <= unlike1_q;
      exp2_q    <= exponent(big1_q[30:23]);
      sum2_q    <= sum(unlike1_q, big1_q, small1_q, distance1_q);
      stop2_q   <= {big1_q[30:24] == 7'd0, big1_q[30:23] == 8'd2};
      zeros2_q  <= near_zeros(big1_q, small1_q, distance1_q[0]);
      nan2_q    <= nan1_q;
      inf2_q    <= inf1_q;
    end
  end

  // ---- stage 3: round or shift, pack ---------------------------------------------------------------------------
  /* verilator lint_off UNUSEDSIGNAL */
  // The leading one stands at bit 27, 26 or 25, or the shift stops there. It counts one in the exponent, a subnormal has none.
  function automatic [30:0] far;
    input  [7:0] exp;
    input [27:0] s;
    input        first;   // no shift, or
    input        second;  // one of one place
    reg   [27:0] left;
    reg    [7:0] exp_less;
    begin
      left     = first ? s : second ? {s[26:0], 1'b0} : {s[25:0], 2'd0};
      exp_less = first ? exp : second ? exp - 8'd1 : exp - 8'd2;
      far      = {exp_less, 23'd0} + {7'd0, left[27:4]} + {30'd0, left[3] & ((|left[2:0]) | left[4])};
    end
  endfunction

  // A difference that lost its upper places, or stops: exact.
  function automatic [30:0] near;
    input  [7:0] exp;
    input [27:0] s;
    input  [4:0] zeros;
    reg   [27:0] left;
    reg    [7:0] exp_more;
    begin
      left     = s << zeros;
      exp_more = exp - {3'd0, zeros} + 8'd1;
      near     = {left[27] ? exp_more : 8'd0, left[26:4]};
    end
  endfunction
  /* verilator lint_on UNUSEDSIGNAL */

  function automatic [30:0] rounded;
    input  [7:0] exp;
    input [27:0] s;
    input  [1:0] stop;
    input  [4:0] zeros;
    rounded = ((|s[27:25]) | (|stop)) ? far(exp, s, s[27], s[26] | stop[1]) : near(exp, s, zeros);
  endfunction

  // Past the largest number, known without the rounded sum. A carry out of the fraction leaves infinity's word by itself.
  function automatic over;
    input [7:0] exp;
    input       top;  // the sum's bit 27
    over = (exp == 8'd254) & top;
  endfunction

  function automatic [31:0] pack;
    input        sign;
    input        unlike;
    input        zero;
    input        nan;
    input        infinite;
    input [30:0] word;
    begin
      if (nan)                       pack = 32'h7FC0_0000;
      else if (zero)                 pack = {sign & ~unlike, 31'd0};
      else if (infinite)             pack = {sign, 31'h7F80_0000};
      else                           pack = {sign, word};
    end
  endfunction

  reg  [31:0] y_q;

  always @(posedge clk_i) begin
    if (en_i[2])
      y_q <= pack(sign2_q, unlike2_q, ~(|sum2_q), nan2_q, inf2_q | over(exp2_q, sum2_q[27]),
                  rounded(exp2_q, sum2_q, stop2_q, zeros2_q));
  end

  assign y_o = y_q;
endmodule

`default_nettype wire
