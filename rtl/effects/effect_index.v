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
  wire  [7:0] exp     = u_i[30:23];
  wire [22:0] frac    = u_i[22:0];
  wire        below1  = exp < 8'd127;  // one
  wire        nan     = (&exp) & (|frac);
  wire  [7:0] placed  = {1'b1, frac[22:16]} >> ~(exp[2:0] + 3'd1);  // from 1 to below 256
  wire  [7:0] whole   = below1 ? 8'd0 : placed;
  wire  [6:0] below   = 7'h7F >> (exp[2:0] + 3'd1);  // of frac[22:16], the places that are left
  wire        rest    = below1 ? (|u_i[30:0]) : ((|(frac[22:16] & below)) | (|frac[15:0]));

  // Of both signs: 128 + whole, or 128 - whole - rest, which is the complement and one if nothing rests; else whole + 1. What
  // is out of range is known from the argument, beside the sum.
  wire        minus   = u_i[31] & signed_i;
  wire  [7:0] place   = (whole ^ {8{minus}}) + {7'd0, minus ? ~rest : ~signed_i};
  wire        above   = ~u_i[31] & ((exp >= 8'd135) | ((exp == 8'd134) & (signed_i | (&frac[22:16]))));
  wire        under   = u_i[31] & (signed_i ? (exp >= 8'd134) : (|u_i[30:0]));

  assign cell_o = nan ? {signed_i, 6'd0, ~signed_i}
                : (above | under) ? {8{above}}
                : {place[7] ^ signed_i, place[6:0]};
endmodule

`default_nettype wire
