// uart_tx: serial transmitter, 8 data bits, no parity, 1 stop bit, LSB first.
//
// Handshake   a byte is taken at a clock with valid_i and ready_o both high.
// Latency     the start bit begins with the next clock; ready_o is back 10 bit times later, so bytes follow
//             each other without a gap.
`default_nettype none

module uart_tx #(
  parameter CLKS_PER_BIT = 50  // 8 .. 65535
) (
  input  wire       clk_i,
  input  wire       rst_ni,
  input  wire       valid_i,
  output wire       ready_o,
  input  wire [7:0] data_i,
  output wire       tx_o
);

  // A value that the widths here cannot hold ends the elaboration, with its name.
  generate
    if (CLKS_PER_BIT < 8 || CLKS_PER_BIT > 65535) begin : g_bad_clks_per_bit
      CLKS_PER_BIT_must_be_8_to_65535 u_error ();
    end
  endgenerate

  localparam [15:0] LAST = CLKS_PER_BIT - 1;

  reg [15:0] tick_q;
  reg [ 3:0] left_q;   // bits still to send, the one on the line included
  reg [ 8:0] shift_q;  // inverted, so that reset (0) means an idle (high) line

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      tick_q  <= 16'd0;
      left_q  <= 4'd0;
      shift_q <= 9'd0;
    end else if (left_q == 4'd0) begin
      tick_q <= 16'd0;
      if (valid_i) begin
        left_q  <= 4'd10;
        shift_q <= {~data_i, 1'b1};
      end
    end else if (tick_q == LAST) begin
      tick_q  <= 16'd0;
      left_q  <= left_q - 4'd1;
      shift_q <= {1'b0, shift_q[8:1]};
    end else begin
      tick_q <= tick_q + 16'd1;
    end
  end

  assign ready_o = (left_q == 4'd0);
  assign tx_o    = !shift_q[0];

endmodule

`default_nettype wire
