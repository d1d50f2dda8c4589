// fp_add: binary32 a + b, or a - b.
//
// Purpose    IEEE-754 addition, round to nearest even, subnormals in and out. An exact zero from operands of
//            unlike sign is +0. Any NaN result is the canonical NaN 7FC00000.
// Handshake  none: a result for every enabled clock. en_i = 0 freezes the whole pipeline.
// Latency    3 clocks: operands in clock n (before edge n + 1) give the result after edge n + 3.
// Stages     1 compare, swap | 2 align, add | 3 normalise, round, pack.
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
  // ---- stage 1: which is larger --------------------------------------------------------------------------------
  wire        b_sign   = b_i[31] ^ sub_i;
  wire        b_larger = a_i[30:0] < b_i[30:0];
  wire [30:0] big      = b_larger ? b_i[30:0] : a_i[30:0];
  wire [30:0] small_op = b_larger ? a_i[30:0] : b_i[30:0];
  wire        unlike   = a_i[31] ^ b_sign;
  wire        a_max    = &a_i[30:23];
  wire        b_max    = &b_i[30:23];
  wire        a_nan    = a_max & (|a_i[22:0]);
  wire        b_nan    = b_max & (|b_i[22:0]);

  reg         sign1_q;
  reg         unlike1_q;
  reg  [30:0] big1_q;
  reg  [30:0] small1_q;
  reg         nan1_q;
  reg         inf1_q;

  always @(posedge clk_i) begin
    if (en_i) begin
      sign1_q   <= b_larger ? b_sign : a_i[31];
      unlike1_q <= unlike;
      big1_q    <= big;
      small1_q  <= small_op;
      nan1_q    <= a_nan | b_nan | (a_max & b_max & unlike);
      inf1_q    <= a_max | b_max;
    end
  end

  // ---- stage 2: align the smaller, add or subtract -------------------------------------------------------------
  wire        big_normal   = |big1_q[30:23];
  wire        small_normal = |small1_q[30:23];
  wire  [7:0] exp_big      = {big1_q[30:24], big1_q[23] | ~big_normal};  // subnormals count from exponent 1
  wire  [7:0] exp_small    = {small1_q[30:24], small1_q[23] | ~small_normal};
  wire [23:0] small_mant   = {small_normal, small1_q[22:0]};

  // 24 bits, two guard bits and a sticky bit: shifted by 8, by 2 and by 1, what falls off joins the sticky bit.
  wire  [7:0] distance = exp_big - exp_small;
  wire        far      = |distance[7:5];
  wire [49:0] whole    = {24'd0, small_mant, 2'd0};
  reg  [25:0] by8;
  reg         lost8;
  reg  [25:0] by2;
  reg         lost2;

  always @* begin
    case (distance[4:3])
      2'd0: begin
        by8   = whole[25:0];
        lost8 = 1'b0;
      end
      2'd1: begin
        by8   = whole[33:8];
        lost8 = |whole[7:2];
      end
      2'd2: begin
        by8   = whole[41:16];
        lost8 = |whole[15:2];
      end
      default: begin
        by8   = whole[49:24];
        lost8 = |whole[23:2];
      end
    endcase
    case (distance[2:1])
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

  wire        lost1    = lost2 | (distance[0] & by2[0]);
  wire [26:0] aligned  = far ? {26'd0, |small_mant} : {distance[0] ? {1'b0, by2[25:1]} : by2, lost1};
  wire [27:0] sum      = {1'b0, big_normal, big1_q[22:0], 3'd0}
                       + ({1'b0, aligned} ^ {28{unlike1_q}}) + {27'd0, unlike1_q};
  // One at the place beyond which a left shift would pass exponent 1: the leading-zero count stops there.
  wire [27:0] limit    = (exp_big > 8'd27) ? 28'd0 : (28'h800_0000 >> exp_big[4:0]);

  reg         sign2_q;
  reg         unlike2_q;
  reg   [7:0] exp2_q;
  reg  [27:0] sum2_q;
  reg  [27:0] limit2_q;
  reg         nan2_q;
  reg         inf2_q;

  always @(posedge clk_i) begin
    if (en_i) begin
      sign2_q   <= sign1_q;
      unlike2_q <= unlike1_q;
      exp2_q    <= exp_big;
      sum2_q    <= sum;
      limit2_q  <= limit;
      nan2_q    <= nan1_q;
      inf2_q    <= inf1_q;
    end
  end

  // ---- stage 3: normalise, round, pack -------------------------------------------------------------------------
  wire  [4:0] zeros;
  wire        none_left;
  fp_lzc u_lzc (
    .x_i    ({sum2_q | limit2_q, 4'd0}),
    .count_o(zeros),
    .zero_o (none_left)
  );
  wire [27:0] left     = sum2_q << zeros;
  wire        up       = left[3] & ((|left[2:0]) | left[4]);
  // The leading one of `left` counts one in the exponent; a subnormal has none.
  wire  [7:0] exp_less = exp2_q - {3'd0, zeros};
  wire [30:0] word     = {exp_less, 23'd0} + {7'd0, left[27:4]} + {30'd0, up};
  wire        overflow = inf2_q | (&word[30:23]);
  wire        zero     = ~(|sum2_q);

  always @(posedge clk_i) begin
    if (en_i) begin
      if (nan2_q)        y_o <= 32'h7FC0_0000;
      else if (zero)     y_o <= {sign2_q & ~unlike2_q, 31'd0};
      else if (overflow) y_o <= {sign2_q, 31'h7F80_0000};
      else               y_o <= {sign2_q, word};
    end
  end

  wire unused = &{1'b0, none_left};
endmodule

`default_nettype wire
