// serial_bridge: serial frames to an Avalon-MM master.
//
// Purpose     the register file over two pins. Request and answer have nine bytes each:
//               request  A5, {tag[3:0], op[3:0]},     address, data[7:0], [15:8], [23:16], [31:24], crc[15:8], crc[7:0]
//               answer   5A, {tag[3:0], status[3:0]}, address, data[7:0], [15:8], [23:16], [31:24], crc[15:8], crc[7:0]
//             op: 1 read, 2 write. status: 0 done, 1 unknown op, 2 refused by the register (read only),
//             3 no such register. The address counts 32-bit words. CRC-16/CCITT-FALSE over the seven bytes
//             before it. A damaged, cut or mis-framed request gets no answer and error_o pulses: the client
//             times out and repeats (every register operation may be repeated).
// Handshake   byte streams as in uart_rx and uart_tx (tx: valid/ready). Avalon-MM master, word addresses,
//             reads pipelined with readdatavalid, writes with writeresponsevalid, both with response
//             (0 okay, 2 slave error, 3 decode error). Requests that arrive during an answer are not seen.
// Latency     2 clocks from the last byte of a request to the bus, 2 from the bus's answer to the first byte.
`default_nettype none

module serial_bridge #(
  parameter TIMEOUT_CLKS = 100000  // longest pause inside a request, < 2**20
) (
  input  wire        clk_i,
  input  wire        rst_ni,

  input  wire        rx_valid_i,
  input  wire [ 7:0] rx_data_i,
  input  wire        rx_error_i,
  output wire        tx_valid_o,
  input  wire        tx_ready_i,
  output wire [ 7:0] tx_data_o,

  output wire [ 7:0] avm_address_o,
  output wire        avm_read_o,
  output wire        avm_write_o,
  output wire [31:0] avm_writedata_o,
  input  wire [31:0] avm_readdata_i,
  input  wire        avm_readdatavalid_i,
  input  wire        avm_writeresponsevalid_i,
  input  wire [ 1:0] avm_response_i,

  output wire        error_o
);

  // A value that the widths here cannot hold ends the elaboration, with its name.
  generate
    if (TIMEOUT_CLKS < 1 || TIMEOUT_CLKS > 1048575) begin : g_bad_timeout_clks
      TIMEOUT_CLKS_must_be_1_to_1048575 u_error ();
    end
  endgenerate

  localparam [7:0] SOF_REQUEST = 8'hA5;
  localparam [7:0] SOF_ANSWER = 8'h5A;

  localparam [3:0] OP_READ = 4'd1;
  localparam [3:0] OP_WRITE = 4'd2;

  localparam [3:0] ST_DONE = 4'd0;
  localparam [3:0] ST_BAD_OP = 4'd1;
  localparam [3:0] ST_REFUSED = 4'd2;
  localparam [3:0] ST_NO_REGISTER = 4'd3;

  localparam [2:0] S_HUNT = 3'd0;
  localparam [2:0] S_COLLECT = 3'd1;
  localparam [2:0] S_CHECK = 3'd2;
  localparam [2:0] S_BUS = 3'd3;
  localparam [2:0] S_SEND = 3'd4;

  reg  [ 2:0] state_q, state_d;
  reg  [ 3:0] count_q, count_d;      // bytes collected or sent
  reg  [63:0] frame_q, frame_d;      // newest byte at the bottom
  reg  [15:0] crc_q, crc_d;
  reg  [19:0] gap_q, gap_d;
  reg         read_q, read_d;
  reg         write_q, write_d;
  reg         error_q, error_d;

  // One CRC unit, used for both directions.
  wire [ 7:0] tx_byte = (count_q == 4'd0) ? SOF_ANSWER :
                        (count_q == 4'd7) ? crc_q[15:8] :
                        (count_q == 4'd8) ? crc_q[7:0] : frame_q[63:56];
  wire [ 7:0] crc_byte = (state_q == S_SEND) ? tx_byte : rx_data_i;
  wire [15:0] crc_start = (state_q == S_HUNT) ? 16'hFFFF : crc_q;
  wire [15:0] crc_next;

  crc16 u_crc (
    .crc_i (crc_start),
    .data_i(crc_byte),
    .crc_o (crc_next)
  );

  // Collected request: op, address, four data bytes, two CRC bytes.
  wire [ 3:0] op = frame_q[59:56];
  wire [ 3:0] tag = frame_q[63:60];
  wire [ 7:0] address = frame_q[55:48];
  wire [31:0] data = {frame_q[23:16], frame_q[31:24], frame_q[39:32], frame_q[47:40]};
  wire        answered = avm_readdatavalid_i || avm_writeresponsevalid_i;
  wire [ 3:0] status = (avm_response_i == 2'd0) ? ST_DONE :
                       (avm_response_i == 2'd3) ? ST_NO_REGISTER : ST_REFUSED;
  wire [31:0] answer = avm_readdatavalid_i ? avm_readdata_i : data;

  always @* begin
    state_d = state_q;
    count_d = count_q;
    frame_d = frame_q;
    crc_d   = crc_q;
    gap_d   = gap_q + 20'd1;
    read_d  = 1'b0;
    write_d = 1'b0;
    error_d = rx_error_i;
    case (state_q)
      S_HUNT: begin
        gap_d   = 20'd0;
        count_d = 4'd0;
        if (rx_valid_i && rx_data_i == SOF_REQUEST) begin
          state_d = S_COLLECT;
          crc_d   = crc_next;
        end
      end
      S_COLLECT: begin
        if (rx_error_i) begin
          state_d = S_HUNT;
        end else if (rx_valid_i) begin
          gap_d   = 20'd0;
          frame_d = {frame_q[55:0], rx_data_i};
          crc_d   = crc_next;
          count_d = count_q + 4'd1;
          if (count_q == 4'd7) state_d = S_CHECK;
        end else if (gap_q == TIMEOUT_CLKS) begin
          state_d = S_HUNT;
          error_d = 1'b1;
        end
      end
      S_CHECK: begin
        count_d = 4'd0;
        if (crc_q != 16'd0) begin  // the CRC over a frame and its own CRC is zero
          state_d = S_HUNT;
          error_d = 1'b1;
        end else if (op == OP_READ || op == OP_WRITE) begin
          state_d = S_BUS;
          read_d  = (op == OP_READ);
          write_d = (op == OP_WRITE);
        end else begin
          state_d = S_SEND;
          frame_d = {tag, ST_BAD_OP, frame_q[55:0]};
          crc_d   = 16'hFFFF;
        end
      end
      S_BUS: begin
        if (answered) begin
          state_d = S_SEND;
          frame_d = {tag, status, address, answer[7:0], answer[15:8], answer[23:16], answer[31:24], 16'd0};
          crc_d   = 16'hFFFF;
        end
      end
      S_SEND: begin
        if (tx_ready_i) begin
          count_d = count_q + 4'd1;
          if (count_q < 4'd7) crc_d = crc_next;
          if (count_q != 4'd0) frame_d = {frame_q[55:0], 8'd0};
          if (count_q == 4'd8) state_d = S_HUNT;
        end
      end
      default: state_d = S_HUNT;
    endcase
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= S_HUNT;
      count_q <= 4'd0;
      frame_q <= 64'd0;
      crc_q   <= 16'd0;
      gap_q   <= 20'd0;
      read_q  <= 1'b0;
      write_q <= 1'b0;
      error_q <= 1'b0;
    end else begin
      state_q <= state_d;
      count_q <= count_d;
      frame_q <= frame_d;
      crc_q   <= crc_d;
      gap_q   <= gap_d;
      read_q  <= read_d;
      write_q <= write_d;
      error_q <= error_d;
    end
  end

  assign tx_valid_o      = (state_q == S_SEND);
  assign tx_data_o       = tx_byte;
  assign avm_address_o   = address;
  assign avm_read_o      = read_q;
  assign avm_write_o     = write_q;
  assign avm_writedata_o = data;
  assign error_o         = error_q;

endmodule

`default_nettype wire
