// fp_bench_icarus: what fp_bench.cpp does, for Icarus, which sees X where a pipeline has no value.
//
//   vvp fp_bench_icarus.vvp +pairs=<file, 16 hex digits a line: a b> +out=<file> +count=<pairs> [+divide=<pairs>]
//
// out: a line a pair, add sub mul, the three from_, the three to_, flags in hex; then a line a division.
`timescale 1ns / 1ps
`default_nettype none

module fp_bench_icarus;
  reg clk;
  reg rst_n;
  reg start;
  reg [31:0] a;
  reg [31:0] b;
  wire [31:0] add;
  wire [31:0] sub;
  wire [31:0] mul;
  wire [31:0] div;
  wire div_valid;
  wire [197:0] converted;

  fp_bench u_bench (
    .clk_i(clk),
    .rst_ni(rst_n),
    .en_i(1'b1),
    .start_i(start),
    .a_i(a),
    .b_i(b),
    .add_o(add),
    .sub_o(sub),
    .mul_o(mul),
    .div_o(div),
    .div_valid_o(div_valid),
    .from_int_o(converted[197:166]),
    .from_fix16_o(converted[165:134]),
    .from_fix63_o(converted[133:102]),
    .to_int_o(converted[101:70]),
    .to_fix16_o(converted[69:38]),
    .to_fix31_o(converted[37:6]),
    .to_flags_o(converted[5:0])
  );

  reg [63:0] pairs[0:1048575];
  reg [8*512-1:0] pairs_name;
  reg [8*512-1:0] out_name;
  integer count;
  integer divide;
  integer out;
  integer k;
  integer clocks;

  // Results of latency 2 wait one clock for those of latency 3.
  reg [197:0] converted_d;

  task edge_of_clock;
    begin
      #10 clk = 1'b1;
      #10 clk = 1'b0;
    end
  endtask

  initial begin
    if (!$value$plusargs("pairs=%s", pairs_name)) $finish;
    if (!$value$plusargs("out=%s", out_name)) $finish;
    if (!$value$plusargs("count=%d", count)) $finish;
    if (!$value$plusargs("divide=%d", divide)) divide = count;
    $readmemh(pairs_name, pairs, 0, count - 1);
    out = $fopen(out_name, "w");
    clk = 1'b0;
    rst_n = 1'b0;
    start = 1'b0;
    a = 32'd0;
    b = 32'd0;
    edge_of_clock;
    rst_n = 1'b1;
    for (k = 0; k < count + 2; k = k + 1) begin
      if (k < count) {a, b} = pairs[k];
      converted_d = converted;
      edge_of_clock;
      if (k >= 2) begin
        $fwrite(out, "%h %h %h %h %h %h ", add, sub, mul, converted_d[197:166], converted_d[165:134],
                converted_d[133:102]);
        $fdisplay(out, "%h %h %h %h", converted_d[101:70], converted_d[69:38], converted_d[37:6], converted_d[5:0]);
      end
    end
    for (k = 0; k < divide; k = k + 1) begin
      {a, b} = pairs[k];
      start = 1'b1;
      edge_of_clock;
      start = 1'b0;
      clocks = 1;
      while (!div_valid && clocks < 40) begin
        edge_of_clock;
        clocks = clocks + 1;
      end
      $fdisplay(out, "%h %0d", div, clocks);
    end
    $fclose(out);
    $finish;
  end
endmodule

`default_nettype wire
