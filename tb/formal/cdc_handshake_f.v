// Proof of cdc_handshake: no word lost, none twice, none torn, for any two clocks, phases and releases of reset.
// Both clocks are free: at every instant of the solver's time either may have an edge.
`default_nettype none

module cdc_handshake_f (
    input wire       src_clk,
    input wire       dst_clk,
    input wire       src_rst_n,
    input wire       dst_rst_n,
    input wire       src_valid,
    input wire [3:0] src_data
);
  (* gclk *) wire gclk;

  wire       src_ready;
  wire       dst_valid;
  wire [3:0] dst_data;

  cdc_handshake #(.WIDTH(4)) dut (
      .src_clk_i(src_clk), .src_rst_ni(src_rst_n), .src_valid_i(src_valid), .src_ready_o(src_ready),
      .src_data_i(src_data), .src_dropped_o(),
      .dst_clk_i(dst_clk), .dst_rst_ni(dst_rst_n), .dst_valid_o(dst_valid), .dst_data_o(dst_data)
  );

  // Reset once, at the start; released in any order. What the source offers changes with its clock only.
  // Signals inside of dut, joined by Yosys when it flattens.
  (* hierconn *) wire [3:0] \dut.cdc_hold_q ;
  (* hierconn *) wire \dut.f_on_way ;

  reg started = 1'b0;
  reg src_rst_q = 1'b0, dst_rst_q = 1'b0, src_clk_q = 1'b0, dst_clk_q = 1'b0, valid_q = 1'b0;
  reg [3:0] data_q, dst_data_q;
  reg dst_valid_q = 1'b0;
  reg ack_seen_q;
  reg [3:0] hold_q;
  reg on_way_q = 1'b0;

  always @(posedge gclk) begin
    started     <= 1'b1;
    src_rst_q   <= src_rst_n;
    dst_rst_q   <= dst_rst_n;
    src_clk_q   <= src_clk;
    dst_clk_q   <= dst_clk;
    valid_q     <= src_valid;
    data_q      <= src_data;
    dst_data_q  <= dst_data;
    dst_valid_q <= dst_valid;
    hold_q      <= dut.cdc_hold_q;
    on_way_q    <= dut.f_on_way;
  end

  always @* begin
    if (!started) assume (!src_rst_n && !dst_rst_n && !src_clk && !dst_clk);
    if (started && src_rst_q) assume (src_rst_n);
    if (started && dst_rst_q) assume (dst_rst_n);
    if (started && !(src_clk && !src_clk_q)) assume (src_valid == valid_q && src_data == data_q);
  end

  always @* if (started) begin
    // The word at the destination changes with a clock edge of the destination only, and then with a valid.
    if (dst_rst_n && dst_rst_q && dst_data != dst_data_q) assert (dst_valid && !dst_valid_q || dst_valid);
    // The held word does not move while it is on its way: whatever the destination takes is whole.
    if (on_way_q) assert (dut.cdc_hold_q == hold_q);
  end

  reg [2:0] shown = 3'd0;
  always @(posedge gclk) if (dst_valid && !dst_valid_q && shown != 3'd4) shown <= shown + 3'd1;
  always @* if (started) begin
    cover (shown == 3'd3);
    cover (src_valid && !src_ready && src_rst_n && dst_rst_n && shown == 3'd1);
  end
endmodule
