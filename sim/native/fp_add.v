// fp_add by the host's arithmetic, in place of rtl/fp/fp_add.v: compiled simulation only.
//
// Purpose    The same ports, enables and latency. The sum is formed when the first stage takes its operands and moves on
//            through the other two: a stage whose enable is 0 keeps what it has, so y_o is that of rtl/fp in every clock
//            (tb/fp/test_native.py). fp_native.h says what the host must do for it.
// Handshake  none: see rtl/fp/fp_add.v.
// Latency    3 clocks.
// Crossing   none. Registers have no reset, as there.
`default_nettype none

module fp_add (
  input  wire        clk_i,
  input  wire  [2:0] en_i,
  input  wire        sub_i,
  input  wire [31:0] a_i,
  input  wire [31:0] b_i,
  output reg  [31:0] y_o
);
`systemc_header
#include "fp_native.h"
`verilog
  reg [31:0] sum1_q;
  reg [31:0] sum2_q;

  always @(posedge clk_i) begin
    if (en_i[0]) sum1_q <= $c32("rtds_add(", a_i, ",", {b_i[31] ^ sub_i, b_i[30:0]}, ")");
    if (en_i[1]) sum2_q <= sum1_q;
    if (en_i[2]) y_o <= sum2_q;
  end
endmodule

`default_nettype wire
