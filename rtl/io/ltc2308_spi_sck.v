// ltc2308_spi_sck: forwards the 40 MHz clock to the SCK pin, one pulse for each clock with en_i = 1.
//
// Latency    en_i taken at edge n gives a pulse that rises half a clock later and falls at edge n+1.
// Pin        No gate stands in the clock's way. In Quartus (which defines ALTERA_RESERVED_QIS) the output cell's
//            own double-data-rate register makes the pulse: 0 in the high half of clk_i, en_i in the low half.
//            Elsewhere two registers, one on each edge, of which exactly one changes at an edge; their
//            exclusive or therefore has one changing input at a time and cannot glitch.
// SDC        create_generated_clock -invert of clk_i on the port; see ltc2308_spi.
`default_nettype none

module ltc2308_spi_sck (
  input  wire clk_i,
  input  wire rst_ni,
  input  wire en_i,
  output wire sck_o
);
endmodule

`default_nettype wire
