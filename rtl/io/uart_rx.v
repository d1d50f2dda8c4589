// uart_rx: serial receiver, 8 data bits, no parity, 1 stop bit, LSB first.
//
// Purpose     takes bytes from an asynchronous line; each bit is the majority of three samples around its middle.
// Handshake   valid_o: one clock a byte, data_o valid with it. error_o: one clock when the stop bit is low
//             (the byte is dropped).
// Latency     valid_o about half a bit time + 3 clocks after the start of the stop bit.
// Crossing    rx_i is asynchronous and enters through cdc_sync (inverted, so that reset means an idle line).
`default_nettype none

module uart_rx #(
  parameter CLKS_PER_BIT = 50  // 8 .. 65535
) (
  input  wire       clk_i,
  input  wire       rst_ni,
  input  wire       rx_i,
  output wire       valid_o,
  output wire [7:0] data_o,
  output wire       error_o
);

  // A value that the widths here cannot hold ends the elaboration, with its name.
  generate
    if (CLKS_PER_BIT < 8 || CLKS_PER_BIT > 65535) begin : g_bad_clks_per_bit
      CLKS_PER_BIT_must_be_8_to_65535 u_error ();
    end
  endgenerate

  localparam [15:0] LAST = CLKS_PER_BIT - 1;
  localparam [15:0] MID = CLKS_PER_BIT / 2;

  wire line_n;

  cdc_sync u_rx (
    .clk_i (clk_i),
    .rst_ni(rst_ni),
    .d_i   (!rx_i),
    .q_o   (line_n)
  );

  wire       line = !line_n;
  reg        busy_q;
  reg        prev_q;
  reg [15:0] tick_q;
  reg [ 3:0] bit_q;   // 0 start, 1..8 data, 9 stop
  reg [ 1:0] vote_q;
  reg [ 7:0] data_q;
  reg        valid_q;
  reg        error_q;

  wire [1:0] vote = vote_q + {1'b0, line};
  wire       level = vote[1];  // at least two of three
  wire       decide = (tick_q == MID + 16'd1);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      busy_q  <= 1'b0;
      prev_q  <= 1'b0;
      tick_q  <= 16'd0;
      bit_q   <= 4'd0;
      vote_q  <= 2'd0;
      data_q  <= 8'd0;
      valid_q <= 1'b0;
      error_q <= 1'b0;
    end else begin
      prev_q  <= line;
      valid_q <= 1'b0;
      error_q <= 1'b0;
      if (!busy_q) begin
        tick_q <= 16'd0;
        bit_q  <= 4'd0;
        vote_q <= 2'd0;
        if (prev_q && !line) busy_q <= 1'b1;  // an edge, so that a stuck-low line stays silent
      end else begin
        tick_q <= (tick_q == LAST) ? 16'd0 : tick_q + 16'd1;
        if (tick_q == LAST) bit_q <= bit_q + 4'd1;
        if (tick_q == MID - 16'd1) vote_q <= {1'b0, line};
        if (tick_q == MID) vote_q <= vote;
        if (decide) begin
          if (bit_q == 4'd0) begin
            if (level) busy_q <= 1'b0;  // a glitch, not a start bit
          end else if (bit_q == 4'd9) begin
            busy_q  <= 1'b0;
            valid_q <= level;
            error_q <= !level;
          end else begin
            data_q <= {level, data_q[7:1]};
          end
        end
      end
    end
  end

  assign valid_o = valid_q;
  assign data_o  = data_q;
  assign error_o = error_q;

endmodule

`default_nettype wire
