// Proof of axi_slave: every transaction gets its answers, as many as it has beats, and no more; each valid holds with what
// belongs to it until its ready; a refused beat does not reach the registers. The master and the registers do what they like, but
// for keeping AXI's own rule that a valid holds.
`default_nettype none

module axi_f (
    input wire        clk,
    input wire        rst_n,
    input wire [1:0]  awid,
    input wire [3:0]  awaddr,
    input wire [3:0]  awlen,
    input wire [2:0]  awsize,
    input wire [1:0]  awburst,
    input wire        awvalid,
    input wire [31:0] wdata,
    input wire [3:0]  wstrb,
    input wire        wlast,
    input wire        wvalid,
    input wire        bready,
    input wire [1:0]  arid,
    input wire [3:0]  araddr,
    input wire [3:0]  arlen,
    input wire [2:0]  arsize,
    input wire [1:0]  arburst,
    input wire        arvalid,
    input wire        rready,
    input wire        reg_ready,
    input wire        reg_error,
    input wire [31:0] reg_rdata
);
  wire awready, wready, bvalid, arready, rlast, rvalid, reg_valid, reg_write;
  wire [1:0]  bid, bresp, rid, rresp;
  wire [31:0] rdata, reg_wdata;
  wire [3:0]  reg_addr;

  axi_slave #(.ID_BITS(2), .ADDR_BITS(4)) dut (
      .clk_i(clk), .rst_ni(rst_n),
      .s_axi_awid(awid), .s_axi_awaddr(awaddr), .s_axi_awlen(awlen), .s_axi_awsize(awsize), .s_axi_awburst(awburst),
      .s_axi_awvalid(awvalid), .s_axi_awready(awready),
      .s_axi_wdata(wdata), .s_axi_wstrb(wstrb), .s_axi_wlast(wlast), .s_axi_wvalid(wvalid), .s_axi_wready(wready),
      .s_axi_bid(bid), .s_axi_bresp(bresp), .s_axi_bvalid(bvalid), .s_axi_bready(bready),
      .s_axi_arid(arid), .s_axi_araddr(araddr), .s_axi_arlen(arlen), .s_axi_arsize(arsize), .s_axi_arburst(arburst),
      .s_axi_arvalid(arvalid), .s_axi_arready(arready),
      .s_axi_rid(rid), .s_axi_rdata(rdata), .s_axi_rresp(rresp), .s_axi_rlast(rlast), .s_axi_rvalid(rvalid),
      .s_axi_rready(rready),
      .reg_valid_o(reg_valid), .reg_write_o(reg_write), .reg_addr_o(reg_addr), .reg_wdata_o(reg_wdata),
      .reg_ready_i(reg_ready), .reg_error_i(reg_error), .reg_rdata_i(reg_rdata)
  );

  // State inside of dut, joined by Yosys when it flattens: what induction needs to know of it.
  (* hierconn *) wire [2:0] \dut.state_q ;
  (* hierconn *) wire [3:0] \dut.left_q ;
  (* hierconn *) wire [1:0] \dut.id_q ;
  (* hierconn *) wire       \dut.write_q ;
  (* hierconn *) wire       \dut.refused_q ;

  reg past = 1'b0;
  always @(posedge clk) past <= 1'b1;
  always @* if (!past) assume (!rst_n);

  // ---- what goes in and out, counted ------------------------------------------------------------------------------
  reg        reading = 1'b0, writing = 1'b0;   // a transaction has been accepted and not been answered in full
  reg        refused = 1'b0;                   // its beats must not reach the registers
  reg  [1:0] id = 2'd0;
  reg  [4:0] r_due = 5'd0;                     // answers of the read, beats of data of the write, still to come
  reg  [4:0] w_due = 5'd0;

  always @(posedge clk or negedge rst_n) begin
    if (!rst_n) begin
      {reading, writing, refused, id, r_due, w_due} <= 15'd0;
    end else begin
      if (awvalid & awready) begin
        writing <= 1'b1;
        id      <= awid;
        w_due   <= {1'b0, awlen} + 5'd1;
        refused <= (awsize != 3'd2) | (|awaddr[1:0]) | awburst[1];
      end
      if (arvalid & arready) begin
        reading <= 1'b1;
        id      <= arid;
        r_due   <= {1'b0, arlen} + 5'd1;
        refused <= (arsize != 3'd2) | (|araddr[1:0]) | arburst[1];
      end
      if (wvalid & wready) w_due <= w_due - 5'd1;
      if (rvalid & rready) begin
        r_due <= r_due - 5'd1;
        if (rlast) reading <= 1'b0;
      end
      if (bvalid & bready) writing <= 1'b0;
    end
  end

  // AXI's rule for the master: what is offered holds until it is taken.
  always @(posedge clk)
    if (past && rst_n && $past(rst_n)) begin
      if ($past(awvalid & ~awready))
        assume (awvalid & awid == $past(awid) & awaddr == $past(awaddr) & awlen == $past(awlen) & awsize == $past(awsize)
                & awburst == $past(awburst));
      if ($past(arvalid & ~arready))
        assume (arvalid & arid == $past(arid) & araddr == $past(araddr) & arlen == $past(arlen) & arsize == $past(arsize)
                & arburst == $past(arburst));
      if ($past(wvalid & ~wready))
        assume (wvalid & wdata == $past(wdata) & wstrb == $past(wstrb) & wlast == $past(wlast));
    end

  always @* if (rst_n) begin
    assert (!(reading & writing));                       // one at a time
    assert (!(awready | arready) | !(reading | writing));
    if (bvalid) assert (writing & w_due == 5'd0 & bid == id);
    if (rvalid) assert (reading & r_due != 5'd0 & rid == id & rlast == (r_due == 5'd1));
    if (wready) assert (writing & w_due != 5'd0);
    if (reg_valid) assert (!refused & (reading | writing) & reg_write == writing);
    if (refused & rvalid) assert (rresp == 2'b10);
    assert (bresp[0] == 1'b0 & rresp[0] == 1'b0);
    // the design's own state, as the counts have it
    if (\dut.state_q == 3'd1) assert (\dut.write_q & writing & w_due == {1'b0, \dut.left_q } + 5'd1);
    if (\dut.state_q == 3'd2) assert (\dut.write_q ? writing & w_due == {1'b0, \dut.left_q }
                                                   : reading & r_due == {1'b0, \dut.left_q } + 5'd1);
    if (\dut.state_q == 3'd3) assert (!\dut.write_q & reading & r_due == {1'b0, \dut.left_q } + 5'd1);
    if (\dut.state_q == 3'd4) assert (writing & w_due == 5'd0);
    if (\dut.state_q == 3'd0 | \dut.state_q >= 3'd5) assert (!reading & !writing);
    if (reading | writing) assert (\dut.refused_q == refused & \dut.id_q == id);
    assert (\dut.state_q != 3'd7);
    // accepted only where there is one: the master's valid holds through the clock of the choice
    if (\dut.state_q == 3'd5) assert (awvalid);
    if (\dut.state_q == 3'd6) assert (arvalid);
  end

  always @(posedge clk)
    if (past && rst_n && $past(rst_n)) begin
      if ($past(bvalid & ~bready)) assert (bvalid & bid == $past(bid) & bresp == $past(bresp));
      if ($past(rvalid & ~rready))
        assert (rvalid & rid == $past(rid) & rdata == $past(rdata) & rresp == $past(rresp) & rlast == $past(rlast));
      if ($past(reg_valid & ~reg_ready))
        assert (reg_valid & reg_write == $past(reg_write) & reg_addr == $past(reg_addr) & reg_wdata == $past(reg_wdata));
    end

`ifdef COVER
  reg written = 1'b0;
  always @(posedge clk) if (rst_n) begin
    if (bvalid & bready & bresp == 2'b00) written <= 1'b1;
    cover (written & rvalid & rready & rlast & rresp == 2'b00);
    cover (bvalid & bready & bresp == 2'b10);
    cover (rvalid & rready & rlast & $past(rvalid & rready & ~rlast, 2));
  end
`endif
endmodule

`default_nettype wire
