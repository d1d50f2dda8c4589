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

  // One less than the biased exponent of the product's bit 46, signed, -126 to 380: also the left shift that would
  // bring it to exponent 1. A left shift stops there; a negative one is a right shift, of which 31 is enough.
  wire [8:0] exp_sum   = {1'b0, a_i[30:24], a_i[23] | ~a_normal} + {1'b0, b_i[30:24], b_i[23] | ~b_normal};
  wire [9:0] exp_above = {1'b0, exp_sum} - 10'd128;
  wire [9:0] exp_left  = exp_above - {5'd0, zeros};
  wire       limited   = exp_left[9];
  wire       deep      = exp_above[9] & ~(&exp_above[8:5]);
  wire [5:0] shift     = limited ? (deep ? 6'h21 : exp_above[5:0]) : {1'b0, zeros};

  reg        sign_q;
  reg [47:0] product_q;
  reg  [5:0] right_q;     // right shift of {product, 24 zeros}: 24 less the left shift, 1 to 56
  reg  [8:0] exp_q;       // one less than the exponent of bit 46 after the shift, 0 to 380
  reg        nan_q;
  reg        inf_q;

  always @(posedge clk_i) begin
    if (en_i) begin
      sign_q    <= a_i[31] ^ b_i[31];
      product_q <= a_mant * b_mant;
      right_q   <= 6'd24 - shift;
      exp_q     <= (limited | a_zero | b_zero) ? 9'd0 : exp_left[8:0];
      nan_q     <= a_nan | b_nan | (a_max & b_zero) | (b_max & a_zero);
      inf_q     <= a_max | b_max;
    end
  end

  // ---- stage 2 ---------------------------------------------------------------------------------------------------
  // {product, 24 zeros} >> right_q, of which places 47..22 matter; by 16, by 4, by 1, what falls off below joins the
  // sticky bit on the way.
  wire [110:0] whole  = {39'd0, product_q, 24'd0};
  reg   [62:22] by16;
  reg           lost16;
  reg   [50:22] by4;
  reg           lost4;
  reg   [47:22] placed;
  reg           lost;

  always @* begin
    case (right_q[5:4])
      2'd0: begin
        by16   = whole[62:22];
        lost16 = 1'b0;
      end
      2'd1: begin
        by16   = whole[78:38];
        lost16 = |whole[37:24];
      end
      2'd2: begin
        by16   = whole[94:54];
        lost16 = |whole[53:24];
      end
      default: begin
        by16   = whole[110:70];
        lost16 = |whole[69:24];
      end
    endcase
    case (right_q[3:2])
      2'd0: begin
        by4   = by16[50:22];
        lost4 = lost16;
      end
      2'd1: begin
        by4   = by16[54:26];
        lost4 = lost16 | (|by16[25:22]);
      end
      2'd2: begin
        by4   = by16[58:30];
        lost4 = lost16 | (|by16[29:22]);
      end
      default: begin
        by4   = by16[62:34];
        lost4 = lost16 | (|by16[33:22]);
      end
    endcase
    case (right_q[1:0])
      2'd0: begin
        placed = by4[47:22];
        lost   = lost4;
      end
      2'd1: begin
        placed = by4[48:23];
        lost   = lost4 | by4[22];
      end
      2'd2: begin
        placed = by4[49:24];
        lost   = lost4 | (|by4[23:22]);
      end
      default: begin
        placed = by4[50:25];
        lost   = lost4 | (|by4[24:22]);
      end
    endcase
  end

  wire        top      = placed[47];
  wire [22:0] frac     = top ? placed[46:24] : placed[45:23];
  wire        guard    = top ? placed[23] : placed[22];
  wire        sticky   = (top & placed[22]) | lost;
  wire        up       = guard & (sticky | frac[0]);
  // The leading one counts one in the exponent, or two at the upper place; a subnormal has none.
  wire [31:0] word     = {exp_q, 23'd0} + {7'd0, top, placed[46] & ~top, frac} + {31'd0, up};
  wire        overflow = inf_q | word[31] | (&word[30:23]);

  always @(posedge clk_i) begin
    if (en_i) begin
      if (nan_q)         y_o <= 32'h7FC0_0000;
      else if (overflow) y_o <= {sign_q, 31'h7F80_0000};
      else               y_o <= {sign_q, word[30:0]};
    end
  end

  wire unused = &{1'b0, none_left, whole[21:0]};
endmodule

`default_nettype wire
