// fp_from_int: signed 32-bit fixed point to binary32.
//
// Purpose    y = x * 2^-FRAC, round to nearest even; FRAC 0 (an integer) to 63, so no result is subnormal.
//            Zero gives +0. Narrower numbers: sign-extend; unsigned ones of up to 31 bits: put a zero on top.
// Handshake  none: a result for every enabled clock. en_i = 0 freezes the whole pipeline.
// Latency    2 clocks: x in clock n (before edge n + 1) gives the result after edge n + 2.
// Stages     1 magnitude, its leading zeros | 2 normalise, round, pack.
// Crossing   none. Registers have no reset: nothing in them counts until an operand has passed through.
`default_nettype none

module fp_from_int #(
  parameter FRAC = 0
) (
  input  wire        clk_i,
  input  wire        en_i,
  input  wire [31:0] x_i,
  output wire [31:0] y_o
);
  generate
    if (FRAC < 0 || FRAC > 63) begin : g_bad_frac
      FRAC_must_be_0_to_63 u_error ();
    end
  endgenerate

  localparam [7:0] EXP_TOP = 8'd158 - FRAC;  // biased exponent of bit 31

  reg        sign1_q;
  reg [31:0] size1_q;
  reg  [4:0] zeros1_q;
  reg        zero1_q;

  wire [31:0] size = x_i[31] ? ~x_i + 32'd1 : x_i;

  `include "fp_lzc.vh"

  always @(posedge clk_i) begin
    if (en_i) begin
      sign1_q  <= x_i[31];
      size1_q  <= size;
      zeros1_q <= leading_zeros(size);
      zero1_q  <= ~(|size);
    end
  end

  wire [31:0] left   = size1_q << zeros1_q;
  wire        up     = left[7] & ((|left[6:0]) | left[8]);
  wire [30:0] word   = {EXP_TOP - {3'd0, zeros1_q}, left[30:8]} + {30'd0, up};

  reg  [31:0] y_q;

  always @(posedge clk_i) begin
    if (en_i) y_q <= zero1_q ? 32'd0 : {sign1_q, word};
  end

  wire unused = &{1'b0, left[31]};

  assign y_o = y_q;
endmodule

`default_nettype wire
