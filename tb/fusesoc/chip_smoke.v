// chip_smoke: the chip of rtds:sim:chip after power-up, for a project that takes it in: it waits for the lock, then converts and
// writes its DAC every 10 us. The benches in tb/top check every code; this one shows that all files are there and fit together.
`default_nettype none
`timescale 1ns / 1ps

module chip_smoke;
  reg         clk_sys;
  reg         clk_adc;
  reg         clk_cnv;
  reg         locked;
  reg         rst_n;
  reg         sdo;
  wire        convst;
  wire        sck;
  wire        ldac_n;
  wire        dac_reset_n;
  wire [ 7:0] led;
  integer     conversions;
  integer     updates;
  real        last;
  real        gap;

  initial begin
    clk_sys = 1'b0;
    clk_adc = 1'b0;
    clk_cnv = 1'b0;
  end
  always #10 clk_sys = !clk_sys;
  always #12.5 clk_adc = !clk_adc;
  always @(clk_adc) clk_cnv <= #7.5 clk_adc;

  // Any code but all zeros and all ones: a line that is alive.
  always @(negedge sck) sdo <= !sdo;

  rtds_chip u_chip (
      .clk_sys_i   (clk_sys),
      .clk_adc_i   (clk_adc),
      .clk_cnv_i   (clk_cnv),
      .pll_locked_i(locked),
      .ext_rst_ni  (rst_n),
      .adc_convst_o(convst),
      .adc_sck_o   (sck),
      .adc_sdi_o   (),
      .adc_sdo_i   (sdo),
      .dac_db_o    (),
      .dac_a_o     (),
      .dac_cs_no   (),
      .dac_rw_o    (),
      .dac_ldac_no (ldac_n),
      .dac_reset_no(dac_reset_n),
      .uart_rx_i   (1'b1),
      .uart_tx_o   (),
      .led_o       (led)
  );

  always @(posedge convst) conversions = conversions + 1;
  always @(negedge ldac_n) begin
    updates = updates + 1;
    gap     = $realtime - last;
    last    = $realtime;
  end

  task fail;
    begin
      $display("chip_smoke: %0d conversions, %0d updates, the last one after %0.0f ns, LEDs %b", conversions, updates, gap, led);
      $fatal;
    end
  endtask

  initial begin
    sdo         = 1'b0;
    locked      = 1'b0;
    rst_n       = 1'b0;
    conversions = 0;
    updates     = 0;
    last        = 0.0;
    gap         = 0.0;
    #200 rst_n = 1'b1;
    #3000;
    if (conversions != 0 || updates != 0 || dac_reset_n !== 1'b0) fail;
    locked = 1'b1;
    #100000;
    if (conversions < 40 || updates < 4 || gap != 10000.0 || led[1] !== 1'b1 || led[7] !== 1'b1) fail;
    $display("chip_smoke: passed");
    $finish;
  end
endmodule

`default_nettype wire
