// adc_sequencer: reads the LTC2308 for ever, one sequence each 400 clocks of 40 MHz (10 us).
//
// Purpose    A sequence is five conversions: one of the four parameter channels (in turn: B, J, Km, Kb), then
//            T_left, T_right, V_left, V_right: the voltages are the freshest when the step starts.
//            Channel of the device: 0 V_l, 1 V_r, 2 T_l, 3 T_r, 4 B, 5 J, 6 Km, 7 Kb.
//
// Handshake  At the end of a sequence the whole record (code_*_o, index_p_o) changes at one edge of clk_i and
//            done_toggle_o changes with it: the record then holds for 400 clocks, which is what the crossing to
//            50 MHz relies on (held data and a toggle). With enable_i = 0 the running sequence is finished,
//            then the device is left alone; the next one starts with the parameter B.
//
// Silence    A sequence in which all five codes are 000 or all are FFF is what a dead line gives: the record
//            and the toggle then stay as they were (no step is made from it) and silent_o is 1 from that end
//            of sequence until the next good one.
//
// Latency    The toggle changes 78 clocks after the start of the fifth cycle: 1.95 us after V_right was sampled, 9.95
//            us after the parameter was. First toggle after reset with enable_i = 1: 80 clocks of waiting,
//            one cycle that only sends the first word, and a sequence.
//
// Crossing   Outputs are registers of clk_i; enable_i must be synchronous to clk_i.
`default_nettype none

module adc_sequencer (
  input  wire        clk_i,          // 40 MHz
  input  wire        clk_cnv_i,      // 40 MHz, 7.5 ns after clk_i (see ltc2308_spi)
  input  wire        rst_ni,         // asserted asynchronously, released with clk_i
  input  wire        enable_i,       // level, in the clk_i domain
  // the record, held between two toggles
  output wire [11:0] code_v_l_o,
  output wire [11:0] code_v_r_o,
  output wire [11:0] code_t_l_o,
  output wire [11:0] code_t_r_o,
  output wire [11:0] code_p_o,
  output wire  [1:0] index_p_o,      // 0 B, 1 J, 2 Km, 3 Kb
  output wire        done_toggle_o,  // changes at the end of every good sequence
  output wire        silent_o,       // level: the last sequence was all zeros or all ones
  // pins
  output wire        adc_convst_o,
  output wire        adc_sck_o,
  output wire        adc_sdi_o,
  input  wire        adc_sdo_i
);
endmodule

`default_nettype wire
