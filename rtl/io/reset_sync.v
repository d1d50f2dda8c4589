// reset_sync: asynchronous assertion, synchronous release of a reset in one clock domain.
//
// Purpose     rst_no falls at once with async_rst_ni (no clock needed) and rises with clk_i.
// Handshake   none.
// Latency     release: 3 clk_i edges after async_rst_ni has risen (4 if the first flop resolves late).
// Crossing    `rst_meta_q` may go metastable at release; quartus/rtds.sdc cuts what comes from the button or the accepted
//             lock (lock_ok_q) into the clears of rst_meta_q, rst_sync_q and rst_out_q, and nothing behind rst_out_q.
`default_nettype none

module reset_sync (
  input  wire clk_i,
  input  wire async_rst_ni,
  output wire rst_no
);

  (* altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED" *)
  reg rst_meta_q;
  reg rst_sync_q;
  reg rst_out_q;

  // Cyclone V flops start at 0, so the reset is asserted from configuration on, clock or no clock.
  initial begin
    rst_meta_q = 1'b0;
    rst_sync_q = 1'b0;
    rst_out_q  = 1'b0;
  end

  always @(posedge clk_i or negedge async_rst_ni) begin
    if (!async_rst_ni) begin
      rst_meta_q <= 1'b0;
      rst_sync_q <= 1'b0;
      rst_out_q  <= 1'b0;
    end else begin
      rst_meta_q <= 1'b1;
      rst_sync_q <= rst_meta_q;
      rst_out_q  <= rst_sync_q;
    end
  end

  assign rst_no = rst_out_q;

endmodule

`default_nettype wire
