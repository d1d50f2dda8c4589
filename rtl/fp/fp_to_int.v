// fp_to_int: binary32 to signed 32-bit fixed point.
//
// Purpose    y = x * 2^FRAC (FRAC 0 to 31), round to nearest even, clamped to -2^31 .. 2^31 - 1.
//            sat_o: x was out of range (infinities included) and y is the nearer end. nan_o: x was no number and
//            y is 0.
// Handshake  none: a result for every enabled clock. en_i = 0 freezes the whole pipeline.
// Latency    2 clocks: x in clock n (before edge n + 1) gives the result after edge n + 2.
// Stages     1 shift | 2 round, negate, clamp.
// Crossing   none. Registers have no reset: nothing in them counts until an operand has passed through.
`default_nettype none

module fp_to_int #(
  parameter FRAC = 0
) (
  input  wire        clk_i,
  input  wire        en_i,
  input  wire [31:0] x_i,
  output wire [31:0] y_o,
  output wire        sat_o,
  output wire        nan_o
);
  generate
    if (FRAC < 0 || FRAC > 31) begin : g_bad_frac
      FRAC_must_be_0_to_31 u_error ();
    end
  endgenerate

  localparam [8:0] EXP_TOP = 9'd158 - FRAC;  // biased exponent at which the leading one stands at bit 31

  // Bits 56..25 of `placed` are the integer, 24 the half, the rest (and `below`) sticky.
  wire  [7:0] exp    = x_i[30:23];
  wire        normal = |exp;
  wire        over   = {1'b0, exp} > EXP_TOP;
  wire  [8:0] right  = EXP_TOP - {1'b0, exp};
  wire        below  = ~over & (|right[8:6]);
  wire [56:0] placed = {normal, x_i[22:0], 33'd0} >> right[5:0];

  reg        sign1_q;
  reg        max1_q;
  reg        nan1_q;
  reg [31:0] whole1_q;
  reg        half1_q;
  reg        rest1_q;

  always @(posedge clk_i) begin
    if (en_i) begin
      sign1_q  <= x_i[31];
      max1_q   <= over;
      nan1_q   <= (&exp) & (|x_i[22:0]);
      whole1_q <= below ? 32'd0 : placed[56:25];
      half1_q  <= ~below & placed[24];
      rest1_q  <= |placed[23:0];
    end
  end

  wire        up    = half1_q & (rest1_q | whole1_q[0]);
  // Rounding up needs places below the point, and then the magnitude is below 2^24: it cannot carry out of the range.
  wire        beyond = max1_q | (whole1_q[31] & ~(sign1_q & ~(|whole1_q[30:0])));
  // -(n + 1) is ~n, -n is ~n + 1: rounding and negation in one sum.
  wire [31:0] rounded = (whole1_q ^ {32{sign1_q}}) + {31'd0, sign1_q ^ up};

  reg  [31:0] y_q;
  reg         sat_q;
  reg         nan_q;

  always @(posedge clk_i) begin
    if (en_i) begin
      nan_q <= nan1_q;
      sat_q <= beyond & ~nan1_q;
      if (nan1_q)      y_q <= 32'd0;
      else if (beyond) y_q <= sign1_q ? 32'h8000_0000 : 32'h7FFF_FFFF;
      else            y_q <= rounded;
    end
  end

  assign y_o   = y_q;
  assign sat_o = sat_q;
  assign nan_o = nan_q;
endmodule

`default_nettype wire
