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
  // Invariants that let the proof of tb/formal/cdc_handshake close by induction: the request may lead the
  // acknowledge by one word only, and the flops between them hold nothing but the old or the new level.
  // req, u_req.meta, u_req.sync, ack, u_ack.meta, u_ack.sync form a ring with at most one change in it.
  wire [5:0] ring = {req_q, u_req.cdc_meta_q, u_req.cdc_sync_q, ack_q, u_ack.cdc_meta_q, u_ack.cdc_sync_q};
  wire [5:0] edges = ring ^ {ring[4:0], ring[5]};
  wire [2:0] edge_count = {2'b0, edges[0]} + {2'b0, edges[1]} + {2'b0, edges[2]} + {2'b0, edges[3]} +
                          {2'b0, edges[4]} + {2'b0, edges[5]};
  always @* assert (edge_count == 3'd0 || edge_count == 3'd2);
`endif

endmodule

`default_nettype wire
