// fp_div: binary32 a / b, one at a time.
//
// Purpose    IEEE-754 division, round to nearest even, subnormals in and out. Any NaN result is the canonical NaN
//            7FC00000; a finite number over zero is an infinity. One quotient bit a clock: small, and used where a
//            result is wanted now and then (the parameter unit).
// Handshake  start_i with the operands; valid_o for one clock with the result, which then holds. A start_i while
//            busy starts over. en_i = 0 freezes everything, start_i included.
// Latency    32 clocks: start_i in clock n (before edge n + 1) gives valid_o and the result after edge n + 32.
// Steps      1 take | 2, 3 shift a, b | 4 .. 29 quotient; its first bit says where it will be placed | 30 place | 31 round |
//            32 pack
// Style      What a step computes stands in functions called in that step: see fp_add.
// Crossing   none.
`default_nettype none

module fp_div (
  input  wire        clk_i,
  input  wire        rst_ni,
  input  wire        en_i,
  input  wire        start_i,
  input  wire [31:0] a_i,
  input  wire [31:0] b_i,
  output wire        valid_o,
  output wire [31:0] y_o
);
  reg         valid_q;
  reg  [31:0] y_q;

  localparam [4:0] STEP_IDLE    = 5'd0;
  localparam [4:0] STEP_SHIFT_A = 5'd1;
  localparam [4:0] STEP_SHIFT_B = 5'd2;
  localparam [4:0] STEP_FIRST   = 5'd3;
  localparam [4:0] STEP_NORM    = 5'd4;   // the quotient's first bit stands in its lowest place
  localparam [4:0] STEP_RIGHT   = 5'd5;
  localparam [4:0] STEP_LAST    = 5'd28;
  localparam [4:0] STEP_PLACE   = 5'd29;
  localparam [4:0] STEP_ROUND   = 5'd30;
  localparam [4:0] STEP_PACK    = 5'd31;

  reg  [4:0] step_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      step_q  <= STEP_IDLE;
      valid_q <= 1'b0;
    end else if (en_i) begin
      valid_q <= (step_q == STEP_PACK) & ~start_i;
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

  /* verilator lint_off UNUSEDSIGNAL */  // of a function's arguments not every bit is used
  `include "fp_lzc.vh"

  function automatic [4:0] places;  // to shift left by
    input [30:0] x;
    places = (|x[30:23]) ? 5'd0 : leading_zeros({1'b0, x[22:0], 8'd0});
  endfunction

  function automatic [23:0] mantissa;  // brought to a leading one
    input [30:0] x;
    input  [4:0] zeros;
    mantissa = {|x[30:23], x[22:0]} << zeros;
  endfunction

  function automatic [9:0] exponent;  // of that, signed; subnormals count from exponent 1
    input [30:0] x;
    input  [4:0] zeros;
    exponent = {2'd0, x[30:24], x[23] | ~(|x[30:23])} - {5'd0, zeros};
  endfunction

  // ---- quotient, placing, rounding -------------------------------------------------------------------------------
  reg         [4:0] zeros_q;  // of the operand that is shifted next
  reg        [24:0] rest_q;   // remainder, below twice the divisor
  reg        [23:0] divisor_q;
  reg        [25:0] quot_q;   // bit 25: the place of 1
  reg signed  [9:0] exp_q;    // of a quotient in [1, 2), biased: -149 to 403; then the result's, 0 of a subnormal one
  reg         [4:0] right_q;  // places that a subnormal result is shifted by
  reg               sticky_q;
  reg        [30:0] packed_q;
  reg               over_q;

  function automatic [25:0] divide;  // {quotient's bit, remainder}
    input [24:0] rest;
    input [23:0] divisor;
    reg   [25:0] minus;
    begin
      minus  = {1'b0, rest} - {2'd0, divisor};
      divide = minus[25] ? {1'b0, rest[23:0], 1'b0} : {1'b1, minus[23:0], 1'b0};
    end
  endfunction

  function automatic [4:0] deep;  // places below exponent 1, 31 at most
    input signed [9:0] exp;
    reg          [9:0] less;
    begin
      less = 10'd1 - exp;
      deep = (exp >= 10'sd1) ? 5'd0 : (|less[9:5]) ? 5'd31 : less[4:0];
    end
  endfunction

  // {lost, quotient}: the leading one at bit 25 or, of a subnormal result, lower.
  function automatic [26:0] placed;
    input [25:0] quot;
    input  [4:0] right;
    input        rest;  // what is left is not zero
    reg   [25:0] from;
    begin
      from   = quot[25] ? quot : {quot[24:0], 1'b0};
      placed = {rest | (|(from & ~(26'h3FF_FFFF << right))), from >> right};
    end
  endfunction
  /* verilator lint_on UNUSEDSIGNAL */

  wire up = quot_q[1] & (quot_q[0] | sticky_q | quot_q[2]);

  always @(posedge clk_i) begin
    if (en_i) begin
      if (start_i) begin
        a_q     <= a_i;
        b_q     <= b_i;
        zeros_q <= places(a_i[30:0]);
      end
      if (step_q == STEP_SHIFT_A) begin
        rest_q  <= {1'b0, mantissa(a_q[30:0], zeros_q)};
        exp_q   <= exponent(a_q[30:0], zeros_q) + 10'd127;
        zeros_q <= places(b_q[30:0]);
      end
      if (step_q == STEP_SHIFT_B) begin
        divisor_q <= mantissa(b_q[30:0], zeros_q);
        exp_q     <= exp_q - exponent(b_q[30:0], zeros_q);
        quot_q    <= 26'd0;
      end
      if (step_q >= STEP_FIRST && step_q <= STEP_LAST) begin
        quot_q[25:1]        <= quot_q[24:0];
        {quot_q[0], rest_q} <= divide(rest_q, divisor_q);
      end
      if (step_q == STEP_NORM) exp_q <= exp_q - {9'd0, ~quot_q[0]};
      if (step_q == STEP_RIGHT) begin
        right_q <= deep(exp_q);
        exp_q   <= (exp_q >= 10'sd1) ? exp_q : 10'sd0;
      end
      if (step_q == STEP_PLACE) {sticky_q, quot_q} <= placed(quot_q, right_q, |rest_q);
      if (step_q == STEP_ROUND) begin
        packed_q <= {exp_q[7:0], quot_q[24:2]} + {30'd0, up};
        over_q   <= exp_q > 10'sd254;
      end
      if (step_q == STEP_PACK) begin
        if (a_nan | b_nan | (a_max & b_max) | (a_zero & b_zero)) y_q <= 32'h7FC0_0000;
        else if (a_max | b_zero | (~b_max & ~a_zero & (over_q | (&packed_q[30:23]))))
          y_q <= {a_q[31] ^ b_q[31], 31'h7F80_0000};
        else if (a_zero | b_max) y_q <= {a_q[31] ^ b_q[31], 31'd0};
        else y_q <= {a_q[31] ^ b_q[31], packed_q};
      end
    end
  end

  assign valid_o = valid_q;
  assign y_o     = y_q;
endmodule

`default_nettype wire
