// fp_lzc: leading zeros of a 32-bit word, as a tree.
//
// Purpose    Each node joins two halves: its own "all zero" and the count of the half that holds the first one.
//            Five levels, no chain: short in hardware, and few events in an event-driven simulator.
// Latency    0 (combinational).
// Format     count_o = zeros above the first one of x_i, from bit 31 down; 31 when x_i is zero (see zero_o).
// Crossing   none.
`default_nettype none

module fp_lzc (
  input  wire [31:0] x_i,
  output wire  [4:0] count_o,
  output wire        zero_o
);
  // Level k has 2^(5-k) nodes; node n covers bits n*2^k and up. z: all zero, c: leading zeros within.
  wire [15:0] z1;
  wire [15:0] c1;
  wire  [7:0] z2;
  wire [15:0] c2;
  wire  [3:0] z3;
  wire [11:0] c3;
  wire  [1:0] z4;
  wire  [7:0] c4;

  genvar n;
  generate
    for (n = 0; n < 16; n = n + 1) begin : g_level1
      assign z1[n] = ~(x_i[2*n+1] | x_i[2*n]);
      assign c1[n] = ~x_i[2*n+1];
    end
    for (n = 0; n < 8; n = n + 1) begin : g_level2
      assign z2[n] = z1[2*n+1] & z1[2*n];
      assign c2[2*n+:2] = {z1[2*n+1], z1[2*n+1] ? c1[2*n] : c1[2*n+1]};
    end
    for (n = 0; n < 4; n = n + 1) begin : g_level3
      assign z3[n] = z2[2*n+1] & z2[2*n];
      assign c3[3*n+:3] = {z2[2*n+1], z2[2*n+1] ? c2[4*n+:2] : c2[4*n+2+:2]};
    end
    for (n = 0; n < 2; n = n + 1) begin : g_level4
      assign z4[n] = z3[2*n+1] & z3[2*n];
      assign c4[4*n+:4] = {z3[2*n+1], z3[2*n+1] ? c3[6*n+:3] : c3[6*n+3+:3]};
    end
  endgenerate

  assign zero_o  = z4[1] & z4[0];
  assign count_o = {z4[1], z4[1] ? c4[3:0] : c4[7:4]};
endmodule

`default_nettype wire
