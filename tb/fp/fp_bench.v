// fp_bench: all operators of rtl/fp side by side, for the vector benches. Latency and ports are the operators' own.
`default_nettype none

module fp_bench #(
  parameter FRAC_FROM = 0,
  parameter FRAC_TO   = 0
) (
  input  wire        clk_i,
  input  wire        rst_ni,
  input  wire        en_i,
  input  wire        start_i,   // of the divider
  input  wire [31:0] a_i,
  input  wire [31:0] b_i,
  output wire [31:0] add_o,
  output wire [31:0] sub_o,
  output wire [31:0] mul_o,
  output wire [31:0] div_o,
  output wire        div_valid_o,
  output wire [31:0] from_int_o,
  output wire [31:0] to_int_o,
  output wire  [1:0] to_int_flags_o
);
  fp_add u_add (.clk_i(clk_i), .en_i(en_i), .sub_i(1'b0), .a_i(a_i), .b_i(b_i), .y_o(add_o));
  fp_add u_sub (.clk_i(clk_i), .en_i(en_i), .sub_i(1'b1), .a_i(a_i), .b_i(b_i), .y_o(sub_o));
  fp_mul u_mul (.clk_i(clk_i), .en_i(en_i), .a_i(a_i), .b_i(b_i), .y_o(mul_o));
  fp_div u_div (
    .clk_i  (clk_i),
    .rst_ni (rst_ni),
    .en_i   (en_i),
    .start_i(start_i),
    .a_i    (a_i),
    .b_i    (b_i),
    .valid_o(div_valid_o),
    .y_o    (div_o)
  );
  fp_from_int #(.FRAC(FRAC_FROM)) u_from_int (.clk_i(clk_i), .en_i(en_i), .x_i(a_i), .y_o(from_int_o));
  fp_to_int #(.FRAC(FRAC_TO)) u_to_int (
    .clk_i(clk_i),
    .en_i (en_i),
    .x_i  (a_i),
    .y_o  (to_int_o),
    .sat_o(to_int_flags_o[1]),
    .nan_o(to_int_flags_o[0])
  );
endmodule

`default_nettype wire
