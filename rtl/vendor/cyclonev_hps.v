// Ports of two primitives of the vendor's, for tools that do not have them (lint, Yosys). Quartus has its own: this file is
// not in its project. They are named after what Quartus' Platform Designer writes for an HPS; none was compiled for this
// repository.
`default_nettype none

(* blackbox *)
module cyclonev_hps_interface_clocks_resets (
  input  wire f2h_cold_rst_req_n,
  input  wire f2h_dbg_rst_req_n,
  input  wire f2h_warm_rst_req_n,
  input  wire f2h_pending_rst_ack,
  output wire h2f_rst_n
);
endmodule

(* blackbox *)
module cyclonev_hps_interface_hps2fpga_light_weight (
  input  wire        clk,
  output wire [11:0] awid,
  output wire [20:0] awaddr,
  output wire  [3:0] awlen,
  output wire  [2:0] awsize,
  output wire  [1:0] awburst,
  output wire  [1:0] awlock,
  output wire  [3:0] awcache,
  output wire  [2:0] awprot,
  output wire        awvalid,
  input  wire        awready,
  output wire [11:0] wid,
  output wire [31:0] wdata,
  output wire  [3:0] wstrb,
  output wire        wlast,
  output wire        wvalid,
  input  wire        wready,
  input  wire [11:0] bid,
  input  wire  [1:0] bresp,
  input  wire        bvalid,
  output wire        bready,
  output wire [11:0] arid,
  output wire [20:0] araddr,
  output wire  [3:0] arlen,
  output wire  [2:0] arsize,
  output wire  [1:0] arburst,
  output wire  [1:0] arlock,
  output wire  [3:0] arcache,
  output wire  [2:0] arprot,
  output wire        arvalid,
  input  wire        arready,
  input  wire [11:0] rid,
  input  wire [31:0] rdata,
  input  wire  [1:0] rresp,
  input  wire        rlast,
  input  wire        rvalid,
  output wire        rready
);
endmodule

`default_nettype wire
