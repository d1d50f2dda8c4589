// effect_index: the cell of a table in which a scaled argument lies.
//
// Purpose    cell = floor(u) + origin, held in 0 .. 255. A NaN is in the cell of zero: its line makes a NaN of it again.
// Handshake  none. Latency 0 (logic): the cell goes to the address of the tables' memories.
// Format     u binary32, in cells. Tables of arguments of both signs have their zero at 128, the others at 1.
// Crossing   none.
`default_nettype none

module effect_index (
  input  wire [31:0] u_i,
  input  wire        signed_i,
  output wire  [7:0] cell_o
);
  wire        below1 = u_i[30:23] < 8'd127;  // one
  wire  [2:0] places = u_i[25:23] + 3'd1;    // exponent less 127, where it matters
  wire [30:0] placed = {7'd0, 1'b1, u_i[22:0]} << places;
  wire        rest   = below1 ? (|u_i[30:0]) : (|placed[22:0]);
  wire  [9:0] size   = {2'd0, below1 ? 8'd0 : placed[30:23]} + {9'd0, u_i[31] & rest};
  wire  [9:0] origin = signed_i ? 10'd128 : 10'd1;
  wire  [9:0] place  = u_i[31] ? origin - size : origin + size;  // -256 .. 511: bit 9 is the sign

  assign cell_o = ((&u_i[30:23]) & (|u_i[22:0])) ? origin[7:0]  // a NaN
                : (u_i[30:23] >= 8'd135) ? {8{~u_i[31]}}        // 256 or more
                : place[9] ? 8'd0
                : place[8] ? 8'd255
                : place[7:0];
endmodule

`default_nettype wire
