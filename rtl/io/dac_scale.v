// dac_scale: the four outputs of the motor units to 12-bit offset-binary codes.
//
// Format     code = clamp(2048 + round(fl(fl(x * gain) + offset)), 0, 4095), round to nearest even; gain in steps
//            a unit, offset in steps. gain_i and offset_i hold four binary32 words, output c at 32*c+31..32*c;
//            order of outputs, also of code_o (12 bits each), sat_o and nan_o:
//              0 i_left (A), 1 w_left (rad/s), 2 i_right, 3 w_right: DAC outputs A, B, C, D.
//            sat_o[c]: the value lay outside of the range and was clamped (infinities included).
//            nan_o[c]: the value was not a number; the code is then 2048 (the safe one), sat_o[c] is 1 too.
//
// Handshake  valid_i for one clock with the four values (taken at that edge; a valid_i while busy is ignored),
//            valid_o for one clock with the codes; codes and flags change together and hold.
//
// Latency    LATENCY clocks from valid_i to valid_o (see the localparam), always; at most 12.
`default_nettype none

module dac_scale (
  input  wire         clk_i,       // 50 MHz
  input  wire         rst_ni,
  input  wire         valid_i,
  input  wire  [31:0] i_l_i,
  input  wire  [31:0] w_l_i,
  input  wire  [31:0] i_r_i,
  input  wire  [31:0] w_r_i,
  input  wire [127:0] gain_i,
  input  wire [127:0] offset_i,
  output wire         valid_o,
  output wire  [47:0] code_o,
  output wire   [3:0] sat_o,
  output wire   [3:0] nan_o
);
endmodule

`default_nettype wire
