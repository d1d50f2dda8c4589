// serial_tb: serial pins -> uart_rx -> serial_bridge -> rtds_regs and back, as rtds_chip has them.
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
    output wire [1151:0] config_o,
    output wire          error_o
);

  wire        rx_valid;
  wire [ 7:0] rx_data;
  wire        rx_error;
  wire        tx_valid;
  wire        tx_ready;
  wire [ 7:0] tx_data;
  wire [ 7:0] address;
  wire        read;
  wire        write;
  wire [31:0] writedata;
  wire [31:0] readdata;
  wire        readdatavalid;
  wire        writeresponsevalid;
  wire [ 1:0] response;

  uart_rx #(
      .CLKS_PER_BIT(CLKS_PER_BIT)
  ) u_rx (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .rx_i   (rx_i),
      .valid_o(rx_valid),
      .data_o (rx_data),
      .error_o(rx_error)
  );

  uart_tx #(
      .CLKS_PER_BIT(CLKS_PER_BIT)
  ) u_tx (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .valid_i(tx_valid),
      .ready_o(tx_ready),
      .data_i (tx_data),
      .tx_o   (tx_o)
  );

  serial_bridge #(
      .TIMEOUT_CLKS(TIMEOUT_CLKS)
  ) u_bridge (
      .clk_i                   (clk_i),
      .rst_ni                  (rst_ni),
      .rx_valid_i              (rx_valid),
      .rx_data_i               (rx_data),
      .rx_error_i              (rx_error),
      .tx_valid_o              (tx_valid),
      .tx_ready_i              (tx_ready),
      .tx_data_o               (tx_data),
      .avm_address_o           (address),
      .avm_read_o              (read),
      .avm_write_o             (write),
      .avm_writedata_o         (writedata),
      .avm_readdata_i          (readdata),
      .avm_readdatavalid_i     (readdatavalid),
      .avm_writeresponsevalid_i(writeresponsevalid),
      .avm_response_i          (response),
      .error_o                 (error_o)
  );

  rtds_regs #(
      .BUILD_ID(32'hC0FFEE11)
  ) u_regs (
      .clk_i                   (clk_i),
      .rst_ni                  (rst_ni),
      .avs_address_i           (address),
      .avs_read_i              (read),
      .avs_write_i             (write),
      .avs_writedata_i         (writedata),
      .avs_readdata_o          (readdata),
      .avs_readdatavalid_o     (readdatavalid),
      .avs_writeresponsevalid_o(writeresponsevalid),
      .avs_response_o          (response),
      .run_o                   (),
      .blank_o                 (),
      .config_o                (config_o),
      .clear_o                 (),
      .idle_i                  (idle_i),
      .open_i                  (1'b1),
      .event_i                 ({1'b0, error_o, 9'd0}),
      .live_i                  (6'd0),
      .step_i                  (1'b0),
      .serial_error_i          (error_o),
      .latency_i               (32'd0),
      .now_i                   (384'd0),
      .codes_i                 (160'd0)
  );

endmodule

`default_nettype wire
