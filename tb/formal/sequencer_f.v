// Proof of the core's step: a step that is not cleared gives its valid exactly LATENCY clocks after its start, no valid
// comes otherwise, and the core is idle again SPACING clocks after the start at the latest.
`default_nettype none

module sequencer_f (
    input wire clk,
    input wire rst_n,
    input wire clear,
    input wire start,
    input wire refresh
);
  localparam LATENCY = 16;
  localparam SPACING = 23;

  wire idle, valid;

  rtds_sequencer dut (
      .clk_i(clk), .rst_ni(rst_n), .clear_i(clear), .start_i(start), .refresh_i(refresh), .idle_o(idle), .valid_o(valid)
  );

  // Signals inside of dut, joined by Yosys when it flattens.
  (* hierconn *) wire \dut.refresh_q ;

  reg started = 1'b0;
  reg [LATENCY-1:0] due = 0;   // a step on its way, one place a clock
  reg [4:0] since = 5'd31;     // clocks since the last start

  always @(posedge clk) begin
    started <= 1'b1;
    if (!rst_n || clear) due <= 0;
    else due <= {due[LATENCY-2:0], start};
    if (!rst_n || clear) since <= 5'd31;
    else if (start) since <= 5'd1;
    else if (since != 5'd31) since <= since + 5'd1;
  end

  always @* begin
    if (!started) assume (!rst_n);
    // The contract of the handshake.
    if (!idle) assume (!start && !refresh);
    assume (!(start && refresh) && !(clear && start));
  end

  always @* if (started && rst_n) begin
    assert (valid == due[LATENCY-1]);
    if (since >= SPACING && since != 5'd31) assert (idle || dut.refresh_q);
    cover (valid && idle == 1'b0);
    cover (valid && since == LATENCY);
    cover (since == SPACING && idle && start);
  end
endmodule
