// serial_tb: rtds_port with a chip at rest behind it.
`default_nettype none

module serial_tb #(
    parameter CLKS_PER_BIT = 16,
    parameter TIMEOUT_CLKS = 1280
) (
    input  wire          clk_i,
    input  wire          rst_ni,
    input  wire          rx_i,
    output wire          tx_o,
    input  wire          idle_i,
    output wire [1407:0] config_o
);

  rtds_port #(
      .BUILD_ID         (32'hC0FFEE11),
      .UART_CLKS_PER_BIT(CLKS_PER_BIT),
      .TIMEOUT_CLKS     (TIMEOUT_CLKS)
  ) u_port (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .uart_rx_i   (rx_i),
      .uart_tx_o   (tx_o),
      .run_o       (),
      .blank_o     (),
      .clear_o     (),
      .config_o    (config_o),
      .fx_valid_o  (),
      .fx_address_o(),
      .fx_data_o   (),
      .fx_ready_i  (1'b1),
      .idle_i      (idle_i),
      .open_i      (1'b1),
      .step_i      (1'b0),
      .event_i     (11'd0),
      .live_i      (6'd0),
      .latency_i   (32'd0),
      .now_i       (384'd0),
      .codes_i     (160'd0)
  );

endmodule

`default_nettype wire
