// board_port_tb: rtds_port with every parameter as the board has it: 1 Mbaud, a pause of 2000 bit times cuts a request.
`default_nettype none

module board_port_tb (
    input  wire clk_i,
    input  wire rst_ni,
    input  wire rx_i,
    output wire tx_o
);

  rtds_port u_port (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .uart_rx_i   (rx_i),
      .uart_tx_o   (tx_o),
      .run_o       (),
      .blank_o     (),
      .clear_o     (),
      .config_o    (),
      .fx_valid_o  (),
      .fx_address_o(),
      .fx_data_o   (),
      .fx_ready_i  (1'b1),
      .idle_i      (1'b1),
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
