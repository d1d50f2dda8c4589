// axi_slave: an AXI3 slave of 32 bits in front of a register bus, for the HPS' lightweight bridge.
//
// Purpose    One transaction at a time. Reads and writes that come together take turns. Bursts (of up to 16 beats in AXI3) are
//            carried out beat by beat, each at the address of its own (INCR) or all at one (FIXED).
// Handshake  AXI: each ready is high in one state only and depends on no input; each valid holds, with what belongs to it, until
//            its ready. Register bus: reg_valid_o holds with address and data until the clock in which reg_ready_i is
//            high (wait states); reg_error_i and reg_rdata_i are looked at in that clock.
// Errors     SLVERR where the register bus refuses; where a write's beat does not have all four strobes; where a beat has
//            another size than 4 bytes, an address that is no multiple of 4, or the burst wraps; where wlast does not stand at the
//            burst's last beat. Such a beat does not reach the register bus but for the last case. A transaction ends always.
// Latency    read: 3 clocks from arvalid to rvalid without wait states; write: 4 clocks from awvalid to bvalid.
// Crossing   none: the bridge is given this clock. rst_ni is asserted asynchronously and released synchronously.
`default_nettype none

module axi_slave #(
  parameter ID_BITS   = 12,
  parameter ADDR_BITS = 21,
  parameter LEN_BITS  = 4   // 8: AXI4
) (
  input  wire                 clk_i,
  input  wire                 rst_ni,

  input  wire   [ID_BITS-1:0] s_axi_awid,
  input  wire [ADDR_BITS-1:0] s_axi_awaddr,
  input  wire  [LEN_BITS-1:0] s_axi_awlen,
  input  wire           [2:0] s_axi_awsize,
  input  wire           [1:0] s_axi_awburst,
  input  wire                 s_axi_awvalid,
  output wire                 s_axi_awready,
  input  wire          [31:0] s_axi_wdata,
  input  wire           [3:0] s_axi_wstrb,
  input  wire                 s_axi_wlast,
  input  wire                 s_axi_wvalid,
  output wire                 s_axi_wready,
  output wire   [ID_BITS-1:0] s_axi_bid,
  output wire           [1:0] s_axi_bresp,
  output wire                 s_axi_bvalid,
  input  wire                 s_axi_bready,
  input  wire   [ID_BITS-1:0] s_axi_arid,
  input  wire [ADDR_BITS-1:0] s_axi_araddr,
  input  wire  [LEN_BITS-1:0] s_axi_arlen,
  input  wire           [2:0] s_axi_arsize,
  input  wire           [1:0] s_axi_arburst,
  input  wire                 s_axi_arvalid,
  output wire                 s_axi_arready,
  output wire   [ID_BITS-1:0] s_axi_rid,
  output wire          [31:0] s_axi_rdata,
  output wire           [1:0] s_axi_rresp,
  output wire                 s_axi_rlast,
  output wire                 s_axi_rvalid,
  input  wire                 s_axi_rready,

  output wire                 reg_valid_o,
  output wire                 reg_write_o,
  output wire [ADDR_BITS-1:0] reg_addr_o,
  output wire          [31:0] reg_wdata_o,
  input  wire                 reg_ready_i,
  input  wire                 reg_error_i,
  input  wire          [31:0] reg_rdata_i
);
  localparam [2:0] IDLE = 3'd0;
  localparam [2:0] TAKE_W = 3'd1;  // a beat of data is awaited
  localparam [2:0] DO = 3'd2;      // a beat is on the register bus
  localparam [2:0] GIVE_R = 3'd3;
  localparam [2:0] GIVE_B = 3'd4;
  localparam [2:0] ACCEPT_W = 3'd5;
  localparam [2:0] ACCEPT_R = 3'd6;

  localparam [1:0] OKAY = 2'b00;
  localparam [1:0] SLVERR = 2'b10;
  localparam [1:0] FIXED = 2'b00;
  localparam [1:0] INCR = 2'b01;

  reg           [2:0] state_q;
  reg                 write_q;     // the transaction in hand, or the last one
  reg   [ID_BITS-1:0] id_q;
  reg [ADDR_BITS-1:0] addr_q;
  reg  [LEN_BITS-1:0] left_q;      // beats after this one
  reg                 fixed_q;
  reg                 refused_q;   // by size, address or kind of burst
  reg                 error_q;     // of this beat (read) or of any so far (write)
  reg          [31:0] data_q;

  wire last = left_q == {LEN_BITS{1'b0}};
  wire beat_ok = (s_axi_wstrb == 4'hF) & ~refused_q;

  assign s_axi_awready = state_q == ACCEPT_W;
  assign s_axi_arready = state_q == ACCEPT_R;
  assign s_axi_wready  = state_q == TAKE_W;
  assign s_axi_bvalid  = state_q == GIVE_B;
  assign s_axi_bid     = id_q;
  assign s_axi_bresp   = error_q ? SLVERR : OKAY;
  assign s_axi_rvalid  = state_q == GIVE_R;
  assign s_axi_rid     = id_q;
  assign s_axi_rresp   = error_q ? SLVERR : OKAY;
  assign s_axi_rlast   = last;
  assign s_axi_rdata   = data_q;
  assign reg_valid_o   = state_q == DO;
  assign reg_write_o   = write_q;
  assign reg_addr_o    = addr_q;
  assign reg_wdata_o   = data_q;

  function automatic refused;
    input [2:0] size;
    input [1:0] low;
    input [1:0] burst;
    refused = (size != 3'd2) | (low != 2'd0) | (burst != FIXED & burst != INCR);
  endfunction

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q   <= IDLE;
      write_q   <= 1'b0;
      id_q      <= {ID_BITS{1'b0}};
      addr_q    <= {ADDR_BITS{1'b0}};
      left_q    <= {LEN_BITS{1'b0}};
      fixed_q   <= 1'b0;
      refused_q <= 1'b0;
      error_q   <= 1'b0;
      data_q    <= 32'd0;
    end else begin
      case (state_q)
        IDLE: begin
          error_q <= 1'b0;
          // In turns where both come: the kind that was not served last goes first.
          if (s_axi_awvalid & (~s_axi_arvalid | ~write_q)) state_q <= ACCEPT_W;
          else if (s_axi_arvalid) state_q <= ACCEPT_R;
        end
        ACCEPT_W: begin
          write_q   <= 1'b1;
          id_q      <= s_axi_awid;
          addr_q    <= s_axi_awaddr;
          left_q    <= s_axi_awlen;
          fixed_q   <= s_axi_awburst == FIXED;
          refused_q <= refused(s_axi_awsize, s_axi_awaddr[1:0], s_axi_awburst);
          state_q   <= TAKE_W;
        end
        ACCEPT_R: begin
          write_q   <= 1'b0;
          id_q      <= s_axi_arid;
          addr_q    <= s_axi_araddr;
          left_q    <= s_axi_arlen;
          fixed_q   <= s_axi_arburst == FIXED;
          refused_q <= refused(s_axi_arsize, s_axi_araddr[1:0], s_axi_arburst);
          error_q   <= refused(s_axi_arsize, s_axi_araddr[1:0], s_axi_arburst);
          data_q    <= 32'd0;
          state_q   <= refused(s_axi_arsize, s_axi_araddr[1:0], s_axi_arburst) ? GIVE_R : DO;
        end
        TAKE_W:
        if (s_axi_wvalid) begin
          data_q <= s_axi_wdata;
          if (~beat_ok | (s_axi_wlast != last)) error_q <= 1'b1;
          if (beat_ok) state_q <= DO;
          else if (last) state_q <= GIVE_B;
          else left_q <= left_q - 1'b1;
          if (~beat_ok & ~fixed_q) addr_q <= addr_q + 4;
        end
        DO:
        if (reg_ready_i) begin
          if (write_q) begin
            if (reg_error_i) error_q <= 1'b1;
            if (last) state_q <= GIVE_B;
            else begin
              left_q  <= left_q - 1'b1;
              state_q <= TAKE_W;
            end
            if (~fixed_q) addr_q <= addr_q + 4;
          end else begin
            error_q <= reg_error_i;
            data_q  <= reg_rdata_i;
            state_q <= GIVE_R;
          end
        end
        GIVE_R:
        if (s_axi_rready) begin
          if (last) state_q <= IDLE;
          else begin
            left_q  <= left_q - 1'b1;
            error_q <= refused_q;
            state_q <= refused_q ? GIVE_R : DO;
          end
          if (~fixed_q) addr_q <= addr_q + 4;
        end
        GIVE_B:  if (s_axi_bready) state_q <= IDLE;
        default: state_q <= IDLE;
      endcase
    end
  end
endmodule

`default_nettype wire
