// fp_smoke: sums, products and quotients known by heart through the operators of rtds:lib:fp, for a project that takes them in.
// The operators' own benches (tb/fp) compare millions; this one shows that all files are there and fit together.
`default_nettype none
`timescale 1ns / 1ps

module fp_smoke;
  reg         clk;
  reg         rst_n;
  reg         start;
  reg  [31:0] a;
  reg  [31:0] b;
  wire [31:0] sum;
  wire [31:0] difference;
  wire [31:0] product;
  wire [31:0] quotient;
  wire        quotient_valid;
  wire [31:0] whole;
  wire [31:0] back;
  integer     wrong;

  fp_add u_add (.clk_i(clk), .en_i(3'b111), .sub_i(1'b0), .a_i(a), .b_i(b), .y_o(sum));
  fp_add u_sub (.clk_i(clk), .en_i(3'b111), .sub_i(1'b1), .a_i(a), .b_i(b), .y_o(difference));
  fp_mul u_mul (.clk_i(clk), .en_i(3'b111), .a_i(a), .b_i(b), .y_o(product));
  fp_div u_div (
    .clk_i(clk), .rst_ni(rst_n), .en_i(1'b1), .start_i(start), .a_i(a), .b_i(b), .valid_o(quotient_valid), .y_o(quotient)
  );
  fp_to_int #(.FRAC(0)) u_to_int (.clk_i(clk), .en_i(1'b1), .x_i(a), .y_o(whole), .sat_o(), .nan_o());
  fp_from_int #(.FRAC(0)) u_from_int (.clk_i(clk), .en_i(1'b1), .x_i(whole), .y_o(back));

  initial clk = 1'b0;
  always #10 clk = !clk;

  task check;
    input [31:0] got;
    input [31:0] wanted;
    if (got !== wanted) begin
      wrong = wrong + 1;
      $display("%h %h: %h instead of %h", a, b, got, wanted);
    end
  endtask

  task try_pair;
    input [31:0] x;
    input [31:0] y;
    input [127:0] wanted;  // sum, difference, product, quotient
    begin
      @(negedge clk);
      a     = x;
      b     = y;
      start = 1'b1;
      @(negedge clk);
      start = 1'b0;
      while (!quotient_valid) @(negedge clk);
      check(sum, wanted[127:96]);
      check(difference, wanted[95:64]);
      check(product, wanted[63:32]);
      check(quotient, wanted[31:0]);
    end
  endtask

  initial begin
    wrong = 0;
    rst_n = 1'b0;
    start = 1'b0;
    a     = 32'd0;
    b     = 32'd0;
    repeat (3) @(negedge clk);
    rst_n = 1'b1;
    try_pair(32'h40C00000, 32'h40000000, {32'h41000000, 32'h40800000, 32'h41400000, 32'h40400000});  // 6, 2
    check(whole, 32'd6);
    check(back, 32'h40C00000);
    try_pair(32'hBF800000, 32'h3F000000, {32'hBF000000, 32'hBFC00000, 32'hBF000000, 32'hC0000000});  // -1, 0.5
    check(whole, 32'hFFFFFFFF);
    try_pair(32'h3F800000, 32'h00000000, {32'h3F800000, 32'h3F800000, 32'h00000000, 32'h7F800000});  // 1, 0
    if (wrong != 0) begin
      $display("fp_smoke: %0d wrong", wrong);
      $fatal;
    end
    $display("fp_smoke: passed");
    $finish;
  end
endmodule

`default_nettype wire
