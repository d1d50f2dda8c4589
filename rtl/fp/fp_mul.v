// fp_mul: binary32 a * b.
//
// Purpose    IEEE-754 multiplication, round to nearest even, subnormals in and out. Any NaN result is the canonical
//            NaN 7FC00000. One 24 x 24 product: a 27 x 27 DSP block of Cyclone V.
// Handshake  none: a result for every enabled clock. en_i has a bit for each stage, stage 1 in bit 0: a stage whose bit is
//            0 keeps what it has. All bits alike: 0 freezes the whole pipeline. A one that moves up by a place each
//            clock takes one pair of factors through, and the product then holds.
// Latency    3 clocks: operands in clock n (before edge n + 1) give the result after edge n + 3.
// Stages     1 take the factors (a choice may stand before it), exponent | 2 product, place of the result, zeros and NaNs |
//            3 shift, round, pack.
// Style      What a stage computes stands in functions called under its enable: see fp_add.
// Crossing   none. Registers have no reset: nothing in them counts until an operand has passed through.
`default_nettype none

module fp_mul (
  input  wire        clk_i,
  input  wire  [2:0] en_i,
  input  wire [31:0] a_i,
  input  wire [31:0] b_i,
  output wire [31:0] y_o
);
  /* verilator lint_off UNUSEDSIGNAL */  // of a function's arguments not every bit is used
  // ---- stage 1 ---------------------------------------------------------------------------------------------------
  // One less than the biased exponent of the product's bit 46, signed, -126 to 380: also the left shift that would
  // bring it to exponent 1.
  function automatic [9:0] exponent;
    input [7:0] a;
    input [7:0] b;
    exponent = {2'd0, a[7:1], a[0] | ~(|a)} + {2'd0, b[7:1], b[0] | ~(|b)} - 10'd128;
  endfunction

  reg        sign1_q;
  reg [23:0] a1_q;
  reg [23:0] b1_q;
  reg        a_small1_q;  // a is subnormal or zero; a1_q[23] says so, too, but is drawn to the product's blocks
  reg        b_small1_q;
  reg  [9:0] exp1_q;
  reg        a_max1_q;
  reg        b_max1_q;

  always @(posedge clk_i) begin
    if (en_i[0]) begin
      sign1_q    <= a_i[31] ^ b_i[31];
      a1_q       <= {|a_i[30:23], a_i[22:0]};
      b1_q       <= {|b_i[30:23], b_i[22:0]};
      a_small1_q <= ~(|a_i[30:23]);
      b_small1_q <= ~(|b_i[30:23]);
      exp1_q     <= exponent(a_i[30:23], b_i[30:23]);
      a_max1_q   <= &a_i[30:23];
      b_max1_q   <= &b_i[30:23];
    end
  end

  // ---- stage 2 ---------------------------------------------------------------------------------------------------
  `include "fp_lzc.vh"

  function automatic is_nan;  // one factor is, or infinity times zero
    input [23:0] a;
    input [23:0] b;
    input        a_max;
    input        b_max;
    is_nan = (a_max & ((|a[22:0]) | ~(|b))) | (b_max & ((|b[22:0]) | ~(|a)));
  endfunction

  // Fraction of the subnormal factor, its upper end a one if there is none. Of two subnormals the product is far below the
  // smallest one: the leading zeros of one are enough.
  function automatic [23:0] subnormal;
    input [22:0] a;
    input [22:0] b;
    input        a_small;
    input        b_small;
    subnormal = {~a_small & ~b_small, a_small ? a : b};
  endfunction

  // {right shift of {product, 24 zeros}: 24 less the left shift, 1 to 56;
  //  one less than the exponent of bit 46 after the shift, 0 to 380}
  function automatic [14:0] place;
    input [23:0] fraction;
    input  [9:0] exp_above;
    input        zero;
    reg [4:0] zeros;
    reg [9:0] exp_left;
    reg       limited;
    reg       deep;
    begin
      zeros    = leading_zeros({fraction, 8'd0});
      exp_left = exp_above - {5'd0, zeros};
      // A left shift stops at exponent 1; a negative one is a right shift, of which 31 is enough.
      limited  = exp_left[9];
      deep     = exp_above[9] & ~(&exp_above[8:5]);
      place    = {limited ? (deep ? 6'd55 : 6'd24 - exp_above[5:0]) : 6'd24 - {1'b0, zeros},
                  (limited | zero) ? 9'd0 : exp_left[8:0]};
    end
  endfunction

  reg        sign2_q;
  reg [47:0] product2_q;
  reg  [5:0] right2_q;
  reg  [8:0] exp2_q;
  reg        nan2_q;
  reg        inf2_q;

  always @(posedge clk_i) begin
    if (en_i[1]) begin
      sign2_q            <= sign1_q;
      product2_q         <= a1_q * b1_q;
      {right2_q, exp2_q} <= place(subnormal(a1_q[22:0], b1_q[22:0], a_small1_q, b_small1_q), exp1_q,
                                  ~(|a1_q) | ~(|b1_q));
      nan2_q             <= is_nan(a1_q, b1_q, a_max1_q, b_max1_q);
      inf2_q             <= a_max1_q | b_max1_q;
    end
  end

  // ---- stage 3 ---------------------------------------------------------------------------------------------------
  function automatic [31:0] rounded;  // {it has overflowed, magnitude}
    input [47:0] product;
    input  [5:0] right;
    input  [8:0] exp;
    reg  [62:22] by16;     // shifted by 16, by 4 and by 1; what falls off joins `lost`
    reg          lost16;
    reg  [50:22] by4;
    reg          lost4;
    reg  [47:22] placed;
    reg          lost;
    reg          top;
    reg   [22:0] frac;
    reg          guard;
    reg          sticky;
    reg          over;
    reg   [30:0] word;
    begin
      // {product, 24 zeros} >> right, of which places 47..22 matter.
      case (right[5:4])
        2'd0: begin
          by16   = {product[38:0], 2'd0};
          lost16 = 1'b0;
        end
        2'd1: begin
          by16   = {7'd0, product[47:14]};
          lost16 = |product[13:0];
        end
        2'd2: begin
          by16   = {23'd0, product[47:30]};
          lost16 = |product[29:0];
        end
        default: begin
          by16   = {39'd0, product[47:46]};
          lost16 = |product[45:0];
        end
      endcase
      case (right[3:2])
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
      case (right[1:0])
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
      top     = placed[47];
      frac    = top ? placed[46:24] : placed[45:23];
      guard   = top ? placed[23] : placed[22];
      sticky  = (top & placed[22]) | lost;
      // The leading one counts one in the exponent, or two at the upper place; a subnormal has none.
      word    = {exp[7:0], 23'd0} + {6'd0, top, placed[46] & ~top, frac} + {30'd0, guard & (sticky | frac[0])};
      // Whether that passes the largest number is known without its sum: above exponent 1 the leading one stands at one of the
      // two places. A carry out of the fraction leaves infinity's word by itself.
      over    = (exp >= 9'd254) | ((exp == 9'd253) & top);
      rounded = {over, word};
    end
  endfunction

  function automatic [31:0] pack;
    input        sign;
    input        nan;
    input        infinite;
    input [31:0] word;
    begin
      if (nan)                                  pack = 32'h7FC0_0000;
      else if (infinite | word[31])             pack = {sign, 31'h7F80_0000};
      else                                      pack = {sign, word[30:0]};
    end
  endfunction
  /* verilator lint_on UNUSEDSIGNAL */

  reg  [31:0] y_q;

  always @(posedge clk_i) begin
    if (en_i[2]) y_q <= pack(sign2_q, nan2_q, inf2_q, rounded(product2_q, right2_q, exp2_q));
  end

  assign y_o = y_q;
endmodule

`default_nettype wire
