// adc_scale: the record of one ADC sequence to binary32 (V, N.m at the motor shaft, parameters in SI).
//
// Format     y = fl(fl(n * gain) + offset), binary32, round to nearest even, with
//              n = code - 2048 for V and T (offset binary), n = code for the parameters (straight binary).
//            gain_i and offset_i hold eight binary32 words, channel c at bits 32*c+31..32*c, numbered as the
//            ADC's channels: 0 V_l, 1 V_r, 2 T_l, 3 T_r, 4 B, 5 J, 6 Km, 7 Kb. Defaults: io_ranges.vh.
//
// Handshake  valid_i for one clock with the record (taken at that edge). valid_o for one clock when everything
//            stands; outputs hold until the next valid_o and change together with it.
//            A valid_i while busy is ignored (records come 500 clocks apart). The parameters that were not in
//            the record keep their value; params_valid_o is 1 once each of the four was read since reset.
//
// Latency    LATENCY clocks from valid_i to valid_o (see the localparam), always; at most 12.
`default_nettype none

module adc_scale (
  input  wire         clk_i,          // 50 MHz
  input  wire         rst_ni,
  input  wire         valid_i,
  input  wire  [11:0] code_v_l_i,
  input  wire  [11:0] code_v_r_i,
  input  wire  [11:0] code_t_l_i,
  input  wire  [11:0] code_t_r_i,
  input  wire  [11:0] code_p_i,
  input  wire   [1:0] index_p_i,      // 0 B, 1 J, 2 Km, 3 Kb
  input  wire [255:0] gain_i,
  input  wire [255:0] offset_i,
  output wire         valid_o,
  output wire  [31:0] v_l_o,
  output wire  [31:0] v_r_o,
  output wire  [31:0] t_l_o,
  output wire  [31:0] t_r_o,
  output wire  [31:0] p_b_o,
  output wire  [31:0] p_j_o,
  output wire  [31:0] p_km_o,
  output wire  [31:0] p_kb_o,
  output wire         params_valid_o
);
endmodule

`default_nettype wire
