// Leading zeros of a 32-bit word, as a tree: for `include inside a module.
//
// Purpose    Each node joins two halves: its own "all zero" and the count of the half that holds the first one. Five levels,
//            no chain. All nodes of a level stand in one word, a node at its lowest bit: few operations for a compiled
//            simulation.
// Format     zeros above the first one of x, from bit 31 down; 31 when x is zero.
// verilator lint_save
// verilator lint_off UNUSEDSIGNAL
function automatic [4:0] leading_zeros;
  input [31:0] x;
  reg [31:0] z;  // at a node's lowest bit: all of its bits are zero
  reg [31:0] h;  // there, too: all of its upper half are
  reg [31:0] s;  // h at each place of a count
  reg [31:0] c;  // leading zeros within, from the node's lowest bit up
  begin
    h = {1'b0, ~x[31:1]} & 32'h5555_5555;  // nodes of two bits
    z = ~x & h;
    c = h;
    h = {2'd0, z[31:2]} & 32'h1111_1111;   // of four
    c = (c & h) | ({2'd0, c[31:2]} & 32'h1111_1111 & ~h) | {h[30:0], 1'b0};
    z = z & h;
    h = {4'd0, z[31:4]} & 32'h0101_0101;   // of eight
    s = h | {h[30:0], 1'b0};
    c = (c & s) | ({4'd0, c[31:4]} & 32'h0303_0303 & ~s) | {h[29:0], 2'd0};
    z = z & h;
    h = {8'd0, z[31:8]} & 32'h0001_0001;   // of sixteen
    s = h | {h[30:0], 1'b0} | {h[29:0], 2'd0};
    c = (c & s) | ({8'd0, c[31:8]} & 32'h0007_0007 & ~s) | {h[28:0], 3'd0};
    leading_zeros = {z[16] & h[16], (z[16] & h[16]) ? c[3:0] : c[19:16]};
  end
endfunction
// verilator lint_restore
