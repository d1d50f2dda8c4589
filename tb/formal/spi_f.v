// Proof of the SPI counts: twelve pulses and one result a cycle (the assertions stand in ltc2308_spi), a CONVST no
// sooner than 80 clocks after the one before. The clock-forwarding cell has a proof of its own (sck_f).
`default_nettype none

module spi_f (
    input wire       clk,
    input wire       rst_n,
    input wire       run,
    input wire [2:0] next_ch,
    input wire       sdo
);
  wire valid, convst;

  ltc2308_spi dut (
      .clk_i(clk), .clk_cnv_i(clk), .rst_ni(rst_n), .run_i(run), .next_ch_i(next_ch), .valid_o(valid),
      .adc_convst_o(convst), .adc_sdo_i(sdo)
  );

  // Signals inside of dut, joined by Yosys when it flattens.
  (* hierconn *) wire \dut.active_q ;
  (* hierconn *) wire [6:0] \dut.count_q ;
  (* hierconn *) wire \dut.cnv_q ;

  reg started = 1'b0;
  reg convst_q = 1'b0;
  reg [6:0] since = 7'd127;  // clocks since the last rising CONVST, saturating

  always @(posedge clk) begin
    started  <= 1'b1;
    convst_q <= convst;
    if (!rst_n) since <= 7'd127;
    else if (convst && !convst_q) since <= 7'd1;
    else if (since != 7'd127) since <= since + 7'd1;
  end

  always @* if (!started) assume (!rst_n);

`ifdef COVER
  // What is reached with inputs that stand still is reached without that too; the proof below is free of this.
  always @* assume (rst_n == started && run && next_ch == 3'd0 && !sdo);
`endif

  always @* if (started && rst_n) begin
    // One clock of CONVST, 80 clocks apart or more; `since` is tied to the cycle's counter for the induction.
    if (convst_q) assert (!convst);
    if (convst) assert (since >= 7'd80);
    if (dut.active_q && dut.count_q >= 7'd2) assert (since == dut.count_q - 7'd1);
    if (dut.active_q && dut.count_q == 7'd1) assert (convst && !convst_q);
    if (dut.active_q && dut.count_q == 7'd0) assert (dut.cnv_q && !convst && since >= 7'd79);
    if (!dut.active_q) assert (since >= 7'd79 && !dut.cnv_q && !convst);
    cover (valid && since == 7'd76);
    cover (convst && since == 7'd80);
  end
endmodule
