// dac_parallel: writes four codes to a DAC7624 or DAC7625 and updates its outputs with one LDAC.
//
// Handshake  write_i for one clock while ready_o is 1 takes code_i (output c at 12*c+11..12*c, c = A B C D). A
//            write_i while ready_o is 0 is not taken: dropped_o is 1 for one clock.
//
// Latency    clocks of 50 MHz from the edge that takes write_i, at the pins' registers:
//              0+5c  address and data of output c;  1+5c CS low;  4+5c CS high
//              22    LDAC low (60 ns after the last CS high);  25 LDAC high, ready_o
//            The four outputs move with the one falling edge of LDAC at 22: never torn.
//
// Safe value SAFE_CODE (mid-scale: 0 A, 0 rad/s). While rst_ni is 0 (reset or lock lost) /RESET is low, at once
//            and without a clock: a DAC7624 then shows mid-scale by itself. After release /RESET stays low for 4 clocks
//            and the safe codes are written (a DAC7625 comes up at zero-scale, so this is what makes it safe),
//            then ready_o rises. fault_i (level): a running transfer is finished, its values being whole, then
//            the safe codes are written once and ready_o stays 0 until fault_i falls: at most 26 + 22 clocks
//            from fault_i to the LDAC of the safe value. safe_o is 1 while the outputs show the safe value.
//
// SDC        Output delays against the 50 MHz clock; every pin is a register. R/W is tied low: output only.
`default_nettype none

module dac_parallel #(
  parameter [11:0] SAFE_CODE = 12'h800
) (
  input  wire        clk_i,       // 50 MHz
  input  wire        rst_ni,      // asserted asynchronously, also on lost lock
  input  wire        write_i,
  input  wire [47:0] code_i,
  input  wire        fault_i,     // level, in the clk_i domain
  output wire        ready_o,
  output wire        dropped_o,
  output wire        safe_o,
  // pins
  output wire [11:0] dac_db_o,
  output wire  [1:0] dac_a_o,
  output wire        dac_cs_no,
  output wire        dac_rw_o,
  output wire        dac_ldac_no,
  output wire        dac_reset_no
);
endmodule

`default_nettype wire
