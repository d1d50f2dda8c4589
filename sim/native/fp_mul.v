// fp_mul by the host's arithmetic, in place of rtl/fp/fp_mul.v: compiled simulation only.
//
// Purpose    The same ports, enables and latency: see fp_add.v beside this file.
// Handshake  none: see rtl/fp/fp_mul.v.
// Latency    3 clocks.
// Crossing   none. Registers have no reset, as there.
`default_nettype none

module fp_mul (
  input  wire        clk_i,
  input  wire  [2:0] en_i,
  input  wire [31:0] a_i,
  input  wire [31:0] b_i,
  output reg  [31:0] y_o
);
`systemc_header
#include "fp_native.h"
`verilog
  reg [31:0] product1_q;
  reg [31:0] product2_q;

  always @(posedge clk_i) begin
    if (en_i[0]) product1_q <= $c32("rtds_mul(", a_i, ",", b_i, ")");
    if (en_i[1]) product2_q <= product1_q;
    if (en_i[2]) y_o <= product2_q;
  end
endmodule

`default_nettype wire
