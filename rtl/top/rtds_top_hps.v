// rtds_top_hps: the motor units on a DE10-Nano whose own ARM drives them. No converter, no serial adapter.
//
// Purpose     the primitives of the HPS' lightweight bridge and its reset, and rtds_hps. KEY[0] is a reset, too. The ARM sees the
//             registers at 0xFF20_0000 once the bridge is enabled (docs/hps-link.md). Never compiled by Quartus, never run.
// Clocks      FPGA_CLK1_50 drives all, and is the bridge's clock on this side; the bridge itself crosses to the ARM's.
// Crossing    KEY[0] and the HPS' reset enter a reset synchroniser.
`default_nettype none

module rtds_top_hps #(
  parameter [31:0] BUILD_ID = 32'd0
) (
  input  wire       FPGA_CLK1_50,
  input  wire [0:0] KEY,
  output wire [7:0] LED
);
  wire        hps_rst_n;
  wire        rst_n;
  wire [11:0] awid;
  wire [20:0] awaddr;
  wire  [3:0] awlen;
  wire  [2:0] awsize;
  wire  [1:0] awburst;
  wire        awvalid;
  wire        awready;
  wire [31:0] wdata;
  wire  [3:0] wstrb;
  wire        wlast;
  wire        wvalid;
  wire        wready;
  wire [11:0] bid;
  wire  [1:0] bresp;
  wire        bvalid;
  wire        bready;
  wire [11:0] arid;
  wire [20:0] araddr;
  wire  [3:0] arlen;
  wire  [2:0] arsize;
  wire  [1:0] arburst;
  wire        arvalid;
  wire        arready;
  wire [11:0] rid;
  wire [31:0] rdata;
  wire  [1:0] rresp;
  wire        rlast;
  wire        rvalid;
  wire        rready;

  cyclonev_hps_interface_clocks_resets u_resets (
    .f2h_cold_rst_req_n (1'b1),
    .f2h_dbg_rst_req_n  (1'b1),
    .f2h_warm_rst_req_n (1'b1),
    .f2h_pending_rst_ack(1'b1),
    .h2f_rst_n          (hps_rst_n)
  );

  cyclonev_hps_interface_hps2fpga_light_weight u_bridge (
    .clk    (FPGA_CLK1_50),
    .awid   (awid),
    .awaddr (awaddr),
    .awlen  (awlen),
    .awsize (awsize),
    .awburst(awburst),
    .awlock (),
    .awcache(),
    .awprot (),
    .awvalid(awvalid),
    .awready(awready),
    .wid    (),
    .wdata  (wdata),
    .wstrb  (wstrb),
    .wlast  (wlast),
    .wvalid (wvalid),
    .wready (wready),
    .bid    (bid),
    .bresp  (bresp),
    .bvalid (bvalid),
    .bready (bready),
    .arid   (arid),
    .araddr (araddr),
    .arlen  (arlen),
    .arsize (arsize),
    .arburst(arburst),
    .arlock (),
    .arcache(),
    .arprot (),
    .arvalid(arvalid),
    .arready(arready),
    .rid    (rid),
    .rdata  (rdata),
    .rresp  (rresp),
    .rlast  (rlast),
    .rvalid (rvalid),
    .rready (rready)
  );

  reset_sync u_reset (
    .clk_i       (FPGA_CLK1_50),
    .async_rst_ni(KEY[0] & hps_rst_n),
    .rst_no      (rst_n)
  );

  rtds_hps #(
    .BUILD_ID(BUILD_ID)
  ) u_hps (
    .clk_i        (FPGA_CLK1_50),
    .rst_ni       (rst_n),
    .s_axi_awid   (awid),
    .s_axi_awaddr (awaddr),
    .s_axi_awlen  (awlen),
    .s_axi_awsize (awsize),
    .s_axi_awburst(awburst),
    .s_axi_awvalid(awvalid),
    .s_axi_awready(awready),
    .s_axi_wdata  (wdata),
    .s_axi_wstrb  (wstrb),
    .s_axi_wlast  (wlast),
    .s_axi_wvalid (wvalid),
    .s_axi_wready (wready),
    .s_axi_bid    (bid),
    .s_axi_bresp  (bresp),
    .s_axi_bvalid (bvalid),
    .s_axi_bready (bready),
    .s_axi_arid   (arid),
    .s_axi_araddr (araddr),
    .s_axi_arlen  (arlen),
    .s_axi_arsize (arsize),
    .s_axi_arburst(arburst),
    .s_axi_arvalid(arvalid),
    .s_axi_arready(arready),
    .s_axi_rid    (rid),
    .s_axi_rdata  (rdata),
    .s_axi_rresp  (rresp),
    .s_axi_rlast  (rlast),
    .s_axi_rvalid (rvalid),
    .s_axi_rready (rready),
    .led_o        (LED)
  );
endmodule

`default_nettype wire
