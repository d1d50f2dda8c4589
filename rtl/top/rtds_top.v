// rtds_top: the chip on a DE10-Nano (Cyclone V 5CSEBA6U23I7), names of ports as on the board.
//
// Purpose     pins, PLL and nothing else; everything else is rtds_chip. KEY[0] is the reset. The DAC board sits on
//             GPIO_0, the serial port on GPIO_1 (quartus/rtds.qsf has the pins, docs/chip.md the wiring). A PLL that loses its
//             lock is reset.
// Clocks      FPGA_CLK1_50 drives registers, core and DAC; the PLL makes the ADC's two 40 MHz clocks of it.
// Crossing    KEY[0] enters reset synchronisers and the PLL's reset, the PLL's lock reset_ctrl and pll_restart, UART_RX a
//             cdc_sync.
`default_nettype none

module rtds_top #(
  parameter [31:0] BUILD_ID = 32'd0  // quartus/compile.tcl sets it from the commit
) (
  input  wire        FPGA_CLK1_50,
  input  wire [ 0:0] KEY,
  output wire [ 7:0] LED,

  output wire        ADC_CONVST,
  output wire        ADC_SCK,
  output wire        ADC_SDI,
  input  wire        ADC_SDO,

  output wire [11:0] DAC_DB,
  output wire [ 1:0] DAC_A,
  output wire        DAC_CS_N,
  output wire        DAC_RW,
  output wire        DAC_LDAC_N,
  output wire        DAC_RESET_N,

  input  wire        UART_RX,
  output wire        UART_TX
);

  wire clk_adc;
  wire clk_cnv;
  wire locked;
  wire restart_rst_n;
  wire restart;

  reset_sync u_restart_reset (
    .clk_i       (FPGA_CLK1_50),
    .async_rst_ni(KEY[0]),
    .rst_no      (restart_rst_n)
  );

  pll_restart u_pll_restart (
    .clk_i   (FPGA_CLK1_50),
    .rst_ni  (restart_rst_n),
    .locked_i(locked),
    .rst_o   (restart)
  );

  pll_adc u_pll_adc (
    .refclk_i    (FPGA_CLK1_50),
    .rst_i       (!KEY[0] || restart),
    .outclk_adc_o(clk_adc),
    .outclk_cnv_o(clk_cnv),
    .locked_o    (locked)
  );

  rtds_chip #(
    .BUILD_ID(BUILD_ID)
  ) u_chip (
    .clk_sys_i   (FPGA_CLK1_50),
    .clk_adc_i   (clk_adc),
    .clk_cnv_i   (clk_cnv),
    .pll_locked_i(locked),
    .ext_rst_ni  (KEY[0]),
    .adc_convst_o(ADC_CONVST),
    .adc_sck_o   (ADC_SCK),
    .adc_sdi_o   (ADC_SDI),
    .adc_sdo_i   (ADC_SDO),
    .dac_db_o    (DAC_DB),
    .dac_a_o     (DAC_A),
    .dac_cs_no   (DAC_CS_N),
    .dac_rw_o    (DAC_RW),
    .dac_ldac_no (DAC_LDAC_N),
    .dac_reset_no(DAC_RESET_N),
    .uart_rx_i   (UART_RX),
    .uart_tx_o   (UART_TX),
    .led_o       (LED)
  );

endmodule

`default_nettype wire
