// cdc_sync: one level signal into another clock domain, two flip-flops.
//
// Purpose     level (not pulse) synchroniser; a pulse shorter than one destination clock may be missed.
// Handshake   none.
// Latency     2 clk_i edges after the input has settled (one more if the first flop resolves late).
// Format      one bit.
// Crossing    `cdc_meta_q` is the only flop that may go metastable. quartus/rtds.sdc cuts every path that
//             ends in a register of that name, so no other register may carry it.
`default_nettype none

module cdc_sync (
  input  wire clk_i,
  input  wire rst_ni,
  input  wire d_i,
  output wire q_o
);

  (* altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED" *)
  reg cdc_meta_q;
  reg cdc_sync_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      cdc_meta_q <= 1'b0;
      cdc_sync_q <= 1'b0;
    end else begin
      cdc_meta_q <= d_i;
      cdc_sync_q <= cdc_meta_q;
    end
  end

  assign q_o = cdc_sync_q;

endmodule

`default_nettype wire
