// cdc_handshake: a word into another clock domain, held still while it crosses.
//
// Purpose     moves WIDTH bits from src_clk_i to dst_clk_i whatever the two frequencies and phases are.
// Handshake   source: a word is taken at a src_clk_i edge with src_valid_i and src_ready_o both high;
//             src_ready_o falls until the destination has acknowledged. A word offered while
//             src_ready_o is low is not taken: src_dropped_o pulses, so that it cannot vanish unseen.
//             destination: dst_valid_o is high for exactly one dst_clk_i cycle a word, dst_data_o holds the
//             word from that cycle on until the next one. No back-pressure at the destination.
// Latency     dst_valid_o is high 3 dst_clk_i edges after the source edge that took the word (a fourth if
//             the first flop resolves late); src_ready_o is back after 2 to 3 further src_clk_i edges.
// Format      opaque bits.
// Reset       both sides have to be reset together (the sides' release may come in either order); a reset of
//             one side alone would leave request and acknowledge apart.
// Crossing    `cdc_hold_q` does not change between the request's toggle and its acknowledgement, so the
//             paths cdc_hold_q -> cdc_data_q only have to be shorter than two destination clocks
//             (set_max_delay / set_net_delay in quartus/rtds.sdc); request and acknowledge end in the
//             `cdc_meta_q` of their synchronisers.
`default_nettype none

module cdc_handshake #(
  parameter WIDTH = 8
) (
  input  wire             src_clk_i,
  input  wire             src_rst_ni,
  input  wire             src_valid_i,
  output wire             src_ready_o,
  input  wire [WIDTH-1:0] src_data_i,
  output wire             src_dropped_o,

  input  wire             dst_clk_i,
  input  wire             dst_rst_ni,
  output wire             dst_valid_o,
  output wire [WIDTH-1:0] dst_data_o
);

  // Source side: hold the word, toggle the request.
  reg  [WIDTH-1:0] cdc_hold_q;
  reg              req_q;
  wire             src_ack;
  wire             src_take = src_valid_i && src_ready_o;

  assign src_ready_o   = (req_q == src_ack);
  assign src_dropped_o = src_valid_i && !src_ready_o;

  always @(posedge src_clk_i or negedge src_rst_ni) begin
    if (!src_rst_ni) begin
      cdc_hold_q <= {WIDTH{1'b0}};
      req_q      <= 1'b0;
    end else if (src_take) begin
      cdc_hold_q <= src_data_i;
      req_q      <= !req_q;
    end
  end

  // Destination side: a change of the request is one word.
  reg  [WIDTH-1:0] cdc_data_q;
  reg              ack_q;
  reg              valid_q;
  wire             dst_req;
  wire             dst_take = (dst_req != ack_q);

  always @(posedge dst_clk_i or negedge dst_rst_ni) begin
    if (!dst_rst_ni) begin
      cdc_data_q <= {WIDTH{1'b0}};
      ack_q      <= 1'b0;
      valid_q    <= 1'b0;
    end else begin
      ack_q   <= dst_req;
      valid_q <= dst_take;
      if (dst_take) cdc_data_q <= cdc_hold_q;
    end
  end

  assign dst_valid_o = valid_q;
  assign dst_data_o  = cdc_data_q;

  cdc_sync u_req (
    .clk_i (dst_clk_i),
    .rst_ni(dst_rst_ni),
    .d_i   (req_q),
    .q_o   (dst_req)
  );

  cdc_sync u_ack (
    .clk_i (src_clk_i),
    .rst_ni(src_rst_ni),
    .d_i   (ack_q),
    .q_o   (src_ack)
  );

`ifdef FORMAL
  // For tb/formal: words taken at either side are counted (modulo 8), and the state of the two synchronisers is
  // pinned down far enough for the proof to close by induction.
  reg [2:0] f_sent;
  reg [2:0] f_taken;
  reg [2:0] f_shown;
  reg [WIDTH-1:0] f_word;

  always @(posedge src_clk_i or negedge src_rst_ni) begin
    if (!src_rst_ni) f_sent <= 3'd0;
    else if (src_take) begin
      f_sent <= f_sent + 3'd1;
      f_word <= src_data_i;
    end
  end

  always @(posedge dst_clk_i or negedge dst_rst_ni) begin
    if (!dst_rst_ni) begin
      f_taken <= 3'd0;
      f_shown <= 3'd0;
    end else begin
      if (dst_take) f_taken <= f_taken + 3'd1;
      if (dst_valid_o) f_shown <= f_shown + 3'd1;
    end
  end

  (* hierconn *) wire \u_req.cdc_sync_q ;
  (* hierconn *) wire \u_req.cdc_meta_q ;
  (* hierconn *) wire \u_ack.cdc_sync_q ;
  (* hierconn *) wire \u_ack.cdc_meta_q ;
  wire f_out = u_req.cdc_sync_q;
  wire f_mid = u_req.cdc_meta_q;
  wire b_out = u_ack.cdc_sync_q;
  wire b_mid = u_ack.cdc_meta_q;
  wire f_on_way = (req_q != ack_q);

  always @* begin
    // No loss, no duplicate: what was sent and not yet taken is one word at most, the one that is on its way.
    assert (f_sent - f_taken == {2'b00, f_on_way});
    // Each word taken is shown by exactly one cycle of dst_valid_o.
    assert (f_taken - f_shown == {2'b00, dst_valid_o});
    // While a word is on its way it is the word that was sent.
    if (f_on_way) assert (cdc_hold_q == f_word);
    // The synchronisers carry one change at most, forth while a word is on its way, else back.
    if (f_on_way) assert (b_mid == ack_q && b_out == ack_q && (f_out != req_q || f_mid == req_q));
    else assert (f_mid == req_q && f_out == req_q && (b_out != ack_q || b_mid == ack_q));
    // Until the other side is out of reset, nothing has come back from it.
    if (!src_rst_ni) assert (!req_q && !f_mid && !f_out && !ack_q && f_taken == 3'd0 && f_shown == 3'd0);
    if (!dst_rst_ni) assert (!ack_q && !b_mid && !b_out && f_taken == 3'd0 && f_shown == 3'd0);
  end
`endif

endmodule

`default_nettype wire
