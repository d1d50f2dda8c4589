// rtds_port: the serial pins and the registers behind them.
//
// Purpose    bytes -> frames -> Avalon-MM -> rtds_regs, and back; what the registers say and hear leaves as it is there.
// Handshake, latency, format: see serial_bridge and rtds_regs.
// Crossing   none: one clock, 50 MHz, and the reset that follows the button alone.
`default_nettype none

module rtds_port #(
  parameter [31:0] BUILD_ID = 32'd0,
  parameter        UART_CLKS_PER_BIT = 50,  // 1 Mbaud
  parameter        TIMEOUT_CLKS = UART_CLKS_PER_BIT * 2000  // a pause inside a request that cuts it
) (
  input  wire          clk_i,
  input  wire          rst_ni,
  input  wire          uart_rx_i,
  output wire          uart_tx_o,
  // what the registers say
  output wire          run_o,
  output wire          blank_o,
  output wire          clear_o,
  output wire [1407:0] config_o,   // see rtds_regs_fields.vh
  output wire          fx_valid_o,
  output wire [  13:0] fx_address_o,
  output wire [  31:0] fx_data_o,
  // what they hear
  input  wire          fx_ready_i,
  input  wire          idle_i,
  input  wire          open_i,
  input  wire          step_i,
  input  wire [  10:0] event_i,      // but for the serial line's own
  input  wire [   5:0] live_i,
  input  wire [  31:0] latency_i,
  input  wire [ 383:0] now_i,
  input  wire [ 159:0] codes_i
);

  wire          rx_valid;
  wire [   7:0] rx_data;
  wire          rx_error;
  wire          tx_valid;
  wire          tx_ready;
  wire [   7:0] tx_data;
  wire [   7:0] avs_address;
  wire          avs_read;
  wire          avs_write;
  wire [  31:0] avs_writedata;
  wire [  31:0] avs_readdata;
  wire          avs_readdatavalid;
  wire          avs_writeresponsevalid;
  wire [   1:0] avs_response;
  wire          serial_error;

  `include "rtds_regs_map.vh"

  wire [10:0] events = event_i | ({10'd0, serial_error} << BIT_STATUS_SERIAL_ERROR);

  uart_rx #(
    .CLKS_PER_BIT(UART_CLKS_PER_BIT)
  ) u_uart_rx (
    .clk_i  (clk_i),
    .rst_ni (rst_ni),
    .rx_i   (uart_rx_i),
    .valid_o(rx_valid),
    .data_o (rx_data),
    .error_o(rx_error)
  );

  uart_tx #(
    .CLKS_PER_BIT(UART_CLKS_PER_BIT)
  ) u_uart_tx (
    .clk_i  (clk_i),
    .rst_ni (rst_ni),
    .valid_i(tx_valid),
    .ready_o(tx_ready),
    .data_i (tx_data),
    .tx_o   (uart_tx_o)
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
    .avm_address_o           (avs_address),
    .avm_read_o              (avs_read),
    .avm_write_o             (avs_write),
    .avm_writedata_o         (avs_writedata),
    .avm_readdata_i          (avs_readdata),
    .avm_readdatavalid_i     (avs_readdatavalid),
    .avm_writeresponsevalid_i(avs_writeresponsevalid),
    .avm_response_i          (avs_response),
    .error_o                 (serial_error)
  );

  // The request takes a clock on its way: so many registers hang on its address and data that it cannot stand beside both the
  // bridge and them. The bridge waits for the answer.
  reg [ 7:0] address_q;
  reg        read_q;
  reg        write_q;
  reg [31:0] writedata_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      address_q   <= 8'd0;
      read_q      <= 1'b0;
      write_q     <= 1'b0;
      writedata_q <= 32'd0;
    end else begin
      address_q   <= avs_address;
      read_q      <= avs_read;
      write_q     <= avs_write;
      writedata_q <= avs_writedata;
    end
  end

  rtds_regs #(
    .BUILD_ID(BUILD_ID)
  ) u_regs (
    .clk_i                   (clk_i),
    .rst_ni                  (rst_ni),
    .avs_address_i           (address_q),
    .avs_read_i              (read_q),
    .avs_write_i             (write_q),
    .avs_writedata_i         (writedata_q),
    .avs_readdata_o          (avs_readdata),
    .avs_readdatavalid_o     (avs_readdatavalid),
    .avs_writeresponsevalid_o(avs_writeresponsevalid),
    .avs_response_o          (avs_response),
    .run_o                   (run_o),
    .blank_o                 (blank_o),
    .config_o                (config_o),
    .clear_o                 (clear_o),
    .fx_valid_o              (fx_valid_o),
    .fx_address_o            (fx_address_o),
    .fx_data_o               (fx_data_o),
    .fx_ready_i              (fx_ready_i),
    .idle_i                  (idle_i),
    .open_i                  (open_i),
    .event_i                 (events),
    .live_i                  (live_i),
    .step_i                  (step_i),
    .serial_error_i          (serial_error),
    .latency_i               (latency_i),
    .now_i                   (now_i),
    .codes_i                 (codes_i)
  );

endmodule

`default_nettype wire
