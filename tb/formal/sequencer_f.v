// Proof of the core's step: a step that is not cleared gives its valid exactly LATENCY clocks after its start, MORE later
// with effects, no valid comes otherwise, the rows are idle again SPACING clocks (and MORE) after the start at the latest,
// and what a step prepares for the next is saved before that one needs it.
`default_nettype none

module sequencer_f (
    input wire clk,
    input wire rst_n,
    input wire clear,
    input wire start,
    input wire refresh,
    input wire effects
);
  localparam LATENCY = 12;
  localparam SPACING = 26;
  localparam MORE = 10;

  wire idle, valid;
  reg effects_q = 1'b0;  // from the clock after a start to the next

  always @(posedge clk) if (start) effects_q <= effects;

  rtds_sequencer dut (
      .clk_i(clk), .rst_ni(rst_n), .clear_i(clear), .start_i(start), .refresh_i(refresh), .effects_i(effects_q), .idle_o(idle), .valid_o(valid)
  );

  // Signals inside of dut, joined by Yosys when it flattens.
  (* hierconn *) wire \dut.refresh_q ;
  (* hierconn *) wire [5:0] \dut.slot_q ;
  (* hierconn *) wire [2:0] \dut.c_later_q ;

  reg started = 1'b0;
  reg [LATENCY+MORE-1:0] due = 0;  // a step on its way, one place a clock
  reg [5:0] since = 6'd63;         // clocks since the last start
  wire [5:0] spacing = effects_q ? SPACING + MORE : SPACING;

  always @(posedge clk) begin
    started <= 1'b1;
    if (!rst_n || clear) due <= 0;
    else due <= {due[LATENCY+MORE-2:0], start && effects} | (start && !effects) << MORE;
    if (!rst_n || clear) since <= 6'd63;
    else if (start) since <= 6'd1;
    else if (since != 6'd63) since <= since + 6'd1;
  end

  always @* begin
    if (!started) assume (!rst_n);
    // The contract of the handshake.
    if (!idle) assume (!start && !refresh);
    assume (!(start && refresh) && !(clear && start));
  end

  always @* if (started && rst_n) begin
    assert (valid == due[LATENCY+MORE-1]);
    if (since >= spacing && since != 6'd63) assert (idle || dut.refresh_q);
    // What a step adds first, in slot 3, was saved by then, however soon after the last step it comes.
    if (dut.slot_q == 6'd3) assert (dut.c_later_q == 3'd0);
    cover (dut.slot_q == 6'd2 && dut.c_later_q[2]);
    cover (valid && idle == 1'b0);
    cover (valid && since == LATENCY && !effects_q);
    cover (valid && since == LATENCY + MORE && effects_q);
    cover (since == spacing && idle && start && effects_q);
  end
endmodule
