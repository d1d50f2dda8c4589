// fp_bench: all operators of rtl/fp side by side, for the vector benches. Latency and ports are the operators' own.
`default_nettype none

module fp_bench (
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
  output wire [31:0] from_int_o,     // of an integer, of 16 and 63 places
  output wire [31:0] from_fix16_o,
  output wire [31:0] from_fix63_o,
  output wire [31:0] to_int_o,       // to an integer, to 16 and 31 places; flags {saturated, NaN}
  output wire [31:0] to_fix16_o,
  output wire [31:0] to_fix31_o,
  output wire  [5:0] to_flags_o      // of 31 places, 16 places, integer
);
  fp_add u_add (.clk_i(clk_i), .en_i({3{en_i}}), .sub_i(1'b0), .a_i(a_i), .b_i(b_i), .y_o(add_o));
  fp_add u_sub (.clk_i(clk_i), .en_i({3{en_i}}), .sub_i(1'b1), .a_i(a_i), .b_i(b_i), .y_o(sub_o));
  fp_mul u_mul (.clk_i(clk_i), .en_i({3{en_i}}), .a_i(a_i), .b_i(b_i), .y_o(mul_o));
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
  fp_from_int #(.FRAC(0)) u_from_int (.clk_i(clk_i), .en_i(en_i), .x_i(a_i), .y_o(from_int_o));
  fp_from_int #(.FRAC(16)) u_from_fix16 (.clk_i(clk_i), .en_i(en_i), .x_i(a_i), .y_o(from_fix16_o));
  fp_from_int #(.FRAC(63)) u_from_fix63 (.clk_i(clk_i), .en_i(en_i), .x_i(a_i), .y_o(from_fix63_o));
  fp_to_int #(.FRAC(0)) u_to_int (
    .clk_i(clk_i),
    .en_i (en_i),
    .x_i  (a_i),
    .y_o  (to_int_o),
    .sat_o(to_flags_o[1]),
    .nan_o(to_flags_o[0])
  );
  fp_to_int #(.FRAC(16)) u_to_fix16 (
    .clk_i(clk_i),
    .en_i (en_i),
    .x_i  (a_i),
    .y_o  (to_fix16_o),
    .sat_o(to_flags_o[3]),
    .nan_o(to_flags_o[2])
  );
  fp_to_int #(.FRAC(31)) u_to_fix31 (
    .clk_i(clk_i),
    .en_i (en_i),
    .x_i  (a_i),
    .y_o  (to_fix31_o),
    .sat_o(to_flags_o[5]),
    .nan_o(to_flags_o[4])
  );
endmodule

`default_nettype wire
