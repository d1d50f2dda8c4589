// stage_bench: adder and multiplier with an enable for each stage, to hold two implementations against each other.
`default_nettype none

module stage_bench (
  input  wire        clk_i,
  input  wire  [2:0] en_i,
  input  wire        sub_i,
  input  wire [31:0] a_i,
  input  wire [31:0] b_i,
  output wire [31:0] sum_o,
  output wire [31:0] product_o
);
  fp_add u_add (.clk_i(clk_i), .en_i(en_i), .sub_i(sub_i), .a_i(a_i), .b_i(b_i), .y_o(sum_o));
  fp_mul u_mul (.clk_i(clk_i), .en_i(en_i), .a_i(a_i), .b_i(b_i), .y_o(product_o));
endmodule

`default_nettype wire
