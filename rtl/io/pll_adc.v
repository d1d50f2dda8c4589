// pll_adc: the ADC's two 40 MHz clocks out of the board's 50 MHz.
//
// Purpose     for synthesis the Cyclone V primitive altera_pll, set up by hand; for simulation a behavioural
//             branch that locks LOCK_NS after its reference runs, and loses lock when the reference stops,
//             when rst_i rises or when a test raises `fail`.
// Latency     locked_o rises LOCK_NS after rst_i falls (simulation); in hardware within 1 ms.
// Clocks      outclk_adc_o 40 MHz, phase 0; outclk_cnv_o 40 MHz, 7.5 ns later (see ltc2308_spi).
// Crossing    locked_o is asynchronous to every clock. The outputs have a fixed phase to refclk_i, yet the
//             crossings of this chip do not depend on it (cdc_handshake).
`default_nettype none
`ifndef SYNTHESIS
`timescale 1ns / 1ps
`endif

module pll_adc #(
  parameter LOCK_NS = 2000  // simulation only
) (
  input  wire refclk_i,
  input  wire rst_i,
  output wire outclk_adc_o,
  output wire outclk_cnv_o,
  output wire locked_o
);

`ifdef SYNTHESIS

  wire fb;

  altera_pll #(
    .fractional_vco_multiplier("false"),
    .reference_clock_frequency("50.0 MHz"),
    .operation_mode("direct"),
    .number_of_clocks(2),
    .output_clock_frequency0("40.000000 MHz"),
    .phase_shift0("0 ps"),
    .duty_cycle0(50),
    .output_clock_frequency1("40.000000 MHz"),
    .phase_shift1("7500 ps"),
    .duty_cycle1(50),
    .pll_type("General"),
    .pll_subtype("General")
  ) u_pll (
    .rst     (rst_i),
    .refclk  (refclk_i),
    .fbclk   (fb),
    .fboutclk(fb),
    .outclk  ({outclk_cnv_o, outclk_adc_o}),
    .locked  (locked_o)
  );

`else

  reg     clk_q;
  reg     cnv_q;
  reg     locked_q;
  reg     fail;       // raised by a test: lock is lost while it is high
  integer good;       // half periods since everything was well
  real    last_edge;  // of the reference

  initial begin
    clk_q     = 1'b0;
    cnv_q     = 1'b0;
    locked_q  = 1'b0;
    fail      = 1'b0;
    good      = 0;
    last_edge = -1.0e9;
  end

  always @(posedge refclk_i) last_edge = $realtime;

  // A reference without an edge for 100 ns has stopped.
  always begin
    #12.5;
    clk_q = !clk_q;
    good  = good + 1;
    if (rst_i !== 1'b0 || fail || $realtime - last_edge > 100.0) good = 0;
    locked_q = (good * 12.5 >= LOCK_NS);
  end

  always @(clk_q) cnv_q <= #7.5 clk_q;

  assign outclk_adc_o = clk_q;
  assign outclk_cnv_o = cnv_q;
  assign locked_o     = locked_q;

`endif

endmodule

`default_nettype wire
