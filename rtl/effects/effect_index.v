// effect_index: the cell of a table in which a scaled argument lies.
//
// Purpose    cell = floor(u) + origin, held in 0 .. 255. A NaN is in the cell of zero: its line makes a NaN of it again.
// Handshake  none: a cell for every clock with en_i; it holds until the next. Latency 1.
// Style      as in fp_add: a function called under the enable.
// Format     u binary32, in cells. Tables of arguments of both signs have their zero at 128, the others at 1.
// Crossing   none.
`default_nettype none

module effect_index (
  input  wire        clk_i,
  input  wire        en_i,
  input  wire [31:0] u_i,
  input  wire        signed_i,
  output reg   [7:0] cell_o
);
  /* verilator lint_off UNUSEDSIGNAL */
  function automatic [7:0] place_of;  // of u_i
    input         both_signs;
    reg           below1;  // one
    reg     [2:0] places;  // exponent less 127, where it matters
    reg    [30:0] placed;
    reg           rest;
    reg     [9:0] size;
    reg     [9:0] origin;
    reg     [9:0] place;   // -256 .. 511: bit 9 is the sign
    begin
      below1 = u_i[30:23] < 8'd127;
      places = u_i[25:23] + 3'd1;
      placed = {7'd0, 1'b1, u_i[22:0]} << places;
      rest   = below1 ? (|u_i[30:0]) : (|placed[22:0]);
      size   = {2'd0, below1 ? 8'd0 : placed[30:23]} + {9'd0, u_i[31] & rest};
      origin = both_signs ? 10'd128 : 10'd1;
      place  = u_i[31] ? origin - size : origin + size;
      place_of = ((&u_i[30:23]) & (|u_i[22:0])) ? origin[7:0]  // a NaN
               : (u_i[30:23] >= 8'd135) ? {8{~u_i[31]}}        // 256 or more
               : place[9] ? 8'd0
               : place[8] ? 8'd255
               : place[7:0];
    end
  endfunction
  /* verilator lint_on UNUSEDSIGNAL */

  always @(posedge clk_i) begin
    if (en_i) cell_o <= place_of(signed_i);
  end
endmodule

`default_nettype wire
