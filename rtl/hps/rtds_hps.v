// rtds_hps: rtds_core behind an AXI slave, for a processor on the same chip. Voltages and torques in, speeds and currents out,
// as numbers: no converter stands between.
//
// Purpose    Registers of 32 bits at byte addresses (docs/hps-link.md has the table); rtds_host.link.hps is the host's side.
// Handshake  AXI3: see axi_slave. A write to GO while a request is under way, to a register that is read only, and any access to
//            an address that is none are answered by SLVERR and change nothing. FX_DATA has wait states while the effect unit
//            holds the word before; a sample has one. Registers that a request uses can be written while none is under way only.
// Latency    see axi_slave and hps_run.
// Format     binary32 words, SI at the motor shaft; a sample is {i_l, w_l, i_r, w_r}, i_l at the lowest address.
// Crossing   none: one clock, which the bridge is given, too.
`default_nettype none

module rtds_hps #(
  parameter [31:0] BUILD_ID = 32'd0
) (
  input  wire        clk_i,
  input  wire        rst_ni,

  input  wire [11:0] s_axi_awid,
  input  wire [20:0] s_axi_awaddr,
  input  wire  [3:0] s_axi_awlen,
  input  wire  [2:0] s_axi_awsize,
  input  wire  [1:0] s_axi_awburst,
  input  wire        s_axi_awvalid,
  output wire        s_axi_awready,
  input  wire [31:0] s_axi_wdata,
  input  wire  [3:0] s_axi_wstrb,
  input  wire        s_axi_wlast,
  input  wire        s_axi_wvalid,
  output wire        s_axi_wready,
  output wire [11:0] s_axi_bid,
  output wire  [1:0] s_axi_bresp,
  output wire        s_axi_bvalid,
  input  wire        s_axi_bready,
  input  wire [11:0] s_axi_arid,
  input  wire [20:0] s_axi_araddr,
  input  wire  [3:0] s_axi_arlen,
  input  wire  [2:0] s_axi_arsize,
  input  wire  [1:0] s_axi_arburst,
  input  wire        s_axi_arvalid,
  output wire        s_axi_arready,
  output wire [11:0] s_axi_rid,
  output wire [31:0] s_axi_rdata,
  output wire  [1:0] s_axi_rresp,
  output wire        s_axi_rlast,
  output wire        s_axi_rvalid,
  input  wire        s_axi_rready,

  output wire  [7:0] led_o
);
  `include "rtds_core_records.vh"

  localparam [31:0] IDENTITY = 32'h5254_4453;  // "RTDS"
  localparam [31:0] VERSION = 32'd1;

  // Byte addresses, of 4 KiB; beyond it nothing answers. Read by rtds_host.link.hps.
  localparam [11:0] R_IDENTITY = 12'h000;
  localparam [11:0] R_VERSION = 12'h004;
  localparam [11:0] R_BUILD = 12'h008;
  localparam [11:0] R_STATUS = 12'h00C;
  localparam [11:0] R_GO = 12'h010;
  localparam [11:0] R_SAMPLE_STEPS = 12'h014;
  localparam [11:0] R_STEP_CLOCKS = 12'h018;
  localparam [11:0] R_SWITCHES = 12'h01C;
  localparam [11:0] R_H = 12'h020;
  localparam [11:0] R_FX_ADDRESS = 12'h024;
  localparam [11:0] R_FX_DATA = 12'h028;
  localparam [11:0] R_CLEAR = 12'h02C;
  localparam [11:0] R_STEP_COUNT = 12'h030;
  localparam [11:0] R_CLOCKS = 12'h034;
  localparam [11:0] R_LATE = 12'h038;
  localparam [11:0] R_COUNT = 12'h03C;
  localparam [11:0] R_INPUTS = 12'h040;   // 4 words
  localparam [11:0] R_MOTOR_L = 12'h060;  // 6 words
  localparam [11:0] R_MOTOR_R = 12'h080;  // 6 words
  localparam [11:0] R_STATE = 12'h100;    // 4 words
  localparam [11:0] R_SAMPLES = 12'h200;  // 32 of 4 words

  wire        reg_valid;
  wire        reg_write;
  wire [20:0] reg_addr;
  wire [31:0] reg_wdata;
  reg         reg_ready;
  reg         reg_error;
  reg  [31:0] reg_rdata;

  axi_slave u_slave (
    .clk_i        (clk_i),
    .rst_ni       (rst_ni),
    .s_axi_awid   (s_axi_awid),
    .s_axi_awaddr (s_axi_awaddr),
    .s_axi_awlen  (s_axi_awlen),
    .s_axi_awsize (s_axi_awsize),
    .s_axi_awburst(s_axi_awburst),
    .s_axi_awvalid(s_axi_awvalid),
    .s_axi_awready(s_axi_awready),
    .s_axi_wdata  (s_axi_wdata),
    .s_axi_wstrb  (s_axi_wstrb),
    .s_axi_wlast  (s_axi_wlast),
    .s_axi_wvalid (s_axi_wvalid),
    .s_axi_wready (s_axi_wready),
    .s_axi_bid    (s_axi_bid),
    .s_axi_bresp  (s_axi_bresp),
    .s_axi_bvalid (s_axi_bvalid),
    .s_axi_bready (s_axi_bready),
    .s_axi_arid   (s_axi_arid),
    .s_axi_araddr (s_axi_araddr),
    .s_axi_arlen  (s_axi_arlen),
    .s_axi_arsize (s_axi_arsize),
    .s_axi_arburst(s_axi_arburst),
    .s_axi_arvalid(s_axi_arvalid),
    .s_axi_arready(s_axi_arready),
    .s_axi_rid    (s_axi_rid),
    .s_axi_rdata  (s_axi_rdata),
    .s_axi_rresp  (s_axi_rresp),
    .s_axi_rlast  (s_axi_rlast),
    .s_axi_rvalid (s_axi_rvalid),
    .s_axi_rready (s_axi_rready),
    .reg_valid_o  (reg_valid),
    .reg_write_o  (reg_write),
    .reg_addr_o   (reg_addr),
    .reg_wdata_o  (reg_wdata),
    .reg_ready_i  (reg_ready),
    .reg_error_i  (reg_error),
    .reg_rdata_i  (reg_rdata)
  );

  // ---- registers -------------------------------------------------------------------------------------------------
  reg  [31:0] sample_steps_q;
  reg  [15:0] step_clocks_q;
  reg  [31:0] switches_q;  // {stride (16), delay (12), 0, own, on, method}
  reg  [31:0] h_q;
  reg  [13:0] fx_address_q;
  reg [127:0] inputs_q;
  reg [191:0] motor_l_q;
  reg [191:0] motor_r_q;
  reg  [31:0] clocks_q;
  reg         nonfinite_q;
  reg         overrun_q;
  reg         waited_q;    // a sample's word has had its clock

  wire         busy;
  wire         stuck;
  wire   [5:0] count;
  wire  [31:0] late;
  wire [127:0] sample;
  wire         strobe;
  wire         ready;
  wire         valid;
  wire [127:0] state;
  wire         overrun;
  wire         nonfinite;
  wire         param_fault;
  wire         fx_ready;
  wire  [31:0] step_count;

  wire [11:0] at        = reg_addr[11:0];
  wire        outside   = |reg_addr[20:12];
  wire        in_inputs = at[11:4] == R_INPUTS[11:4];
  wire        in_left   = (at[11:5] == R_MOTOR_L[11:5]) & (at[4:2] < 3'd6);
  wire        in_right  = (at[11:5] == R_MOTOR_R[11:5]) & (at[4:2] < 3'd6);
  wire        in_state  = at[11:4] == R_STATE[11:4];
  wire        in_sample = at[11:9] == R_SAMPLES[11:9];
  wire        at_fx     = (at == R_FX_DATA) & ~outside;
  wire        writes    = reg_valid & reg_write & ~outside;
  wire        at_set    = (at == R_SAMPLE_STEPS) | (at == R_STEP_CLOCKS) | (at == R_SWITCHES) | (at == R_H)
                        | (at == R_FX_ADDRESS) | in_inputs | in_left | in_right;
  wire        sets      = writes & at_set & ~busy;
  wire        go        = writes & (at == R_GO) & ~busy;
  wire        clears    = writes & (at == R_CLEAR);
  wire        fx_write  = writes & at_fx & ~busy & fx_ready;

  always @* begin
    reg_rdata = 32'd0;
    reg_error = outside;
    reg_ready = 1'b1;
    if (reg_write) begin
      if (at == R_GO | at_set) reg_error = outside | busy;
      else if (at == R_CLEAR) reg_error = outside;
      else if (at == R_FX_DATA) begin
        reg_error = outside | busy;
        reg_ready = outside | busy | fx_ready;
      end else reg_error = 1'b1;
    end else begin
      case (at)
        R_IDENTITY:     reg_rdata = IDENTITY;
        R_VERSION:      reg_rdata = VERSION;
        R_BUILD:        reg_rdata = BUILD_ID;
        R_STATUS:       reg_rdata = {26'd0, param_fault, nonfinite_q, overrun_q, stuck, ~fx_ready, busy};
        R_SAMPLE_STEPS: reg_rdata = sample_steps_q;
        R_STEP_CLOCKS:  reg_rdata = {16'd0, step_clocks_q};
        R_SWITCHES:     reg_rdata = switches_q;
        R_H:            reg_rdata = h_q;
        R_FX_ADDRESS:   reg_rdata = {18'd0, fx_address_q};
        R_STEP_COUNT:   reg_rdata = step_count;
        R_CLOCKS:       reg_rdata = clocks_q;
        R_LATE:         reg_rdata = late;
        R_COUNT:        reg_rdata = {26'd0, count};
        default: begin
          if (in_inputs) reg_rdata = inputs_q[{at[3:2], 5'd0}+:32];
          else if (in_left) reg_rdata = motor_l_q[{at[4:2], 5'd0}+:32];
          else if (in_right) reg_rdata = motor_r_q[{at[4:2], 5'd0}+:32];
          else if (in_state) reg_rdata = state[{at[3:2], 5'd0}+:32];
          else if (in_sample) begin
            reg_rdata = sample[{at[3:2], 5'd0}+:32];
            reg_ready = outside | waited_q;
          end else reg_error = 1'b1;
        end
      endcase
    end
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      sample_steps_q <= 32'd1;
      step_clocks_q  <= 16'd500;
      switches_q     <= 32'd0;
      h_q            <= 32'd0;
      fx_address_q   <= 14'd0;
      inputs_q       <= 128'd0;
      motor_l_q      <= 192'd0;
      motor_r_q      <= 192'd0;
      clocks_q       <= 32'd0;
      nonfinite_q    <= 1'b0;
      overrun_q      <= 1'b0;
      waited_q       <= 1'b0;
    end else begin
      clocks_q <= clocks_q + 32'd1;
      waited_q <= reg_valid & ~waited_q;
      if (clears) begin
        nonfinite_q <= 1'b0;
        overrun_q   <= 1'b0;
      end else begin
        if (valid & nonfinite) nonfinite_q <= 1'b1;
        if (overrun) overrun_q <= 1'b1;
      end
      if (sets) begin
        if (at == R_SAMPLE_STEPS) sample_steps_q <= reg_wdata;
        if (at == R_STEP_CLOCKS) step_clocks_q <= reg_wdata[15:0];
        if (at == R_SWITCHES) switches_q <= reg_wdata;
        if (at == R_H) h_q <= reg_wdata;
        if (at == R_FX_ADDRESS) fx_address_q <= reg_wdata[13:0];
        if (in_inputs) inputs_q[{at[3:2], 5'd0}+:32] <= reg_wdata;
        if (in_left) motor_l_q[{at[4:2], 5'd0}+:32] <= reg_wdata;
        if (in_right) motor_r_q[{at[4:2], 5'd0}+:32] <= reg_wdata;
      end
    end
  end

  wire [SETTINGS_BITS-1:0] settings;
  wire     [WORD_BITS-1:0] word;

  assign settings[SETTINGS_H+:32]      = h_q;
  assign settings[SETTINGS_METHOD]     = switches_q[0];
  assign settings[SETTINGS_FX_ON]      = switches_q[1];
  assign settings[SETTINGS_FX_OWN]     = switches_q[2];
  assign settings[SETTINGS_DELAY+:12]  = switches_q[15:4];
  assign settings[SETTINGS_STRIDE+:16] = switches_q[31:16];

  assign word[WORD_ADDRESS+:14] = fx_address_q;
  assign word[WORD_DATA+:32]    = reg_wdata;

  hps_run u_run (
    .clk_i         (clk_i),
    .rst_ni        (rst_ni),
    .clear_i       (clears),
    .go_i          (go),
    .steps_i       (reg_wdata),
    .sample_steps_i(sample_steps_q),
    .step_clocks_i (step_clocks_q),
    .busy_o        (busy),
    .stuck_o       (stuck),
    .count_o       (count),
    .late_o        (late),
    .sample_i      (at[8:4]),
    .sample_o      (sample),
    .strobe_o      (strobe),
    .ready_i       (ready),
    .valid_i       (valid),
    .state_i       (state)
  );

  rtds_core u_core (
    .clk_i        (clk_i),
    .rst_ni       (rst_ni),
    .strobe_i     (strobe),
    .clear_i      (clears),
    .inputs_i     (inputs_q),
    .motor_l_i    (motor_l_q),
    .motor_r_i    (motor_r_q),
    .settings_i   (settings),
    .word_valid_i (fx_write),
    .word_i       (word),
    .word_ready_o (fx_ready),
    .valid_o      (valid),
    .ready_o      (ready),
    .overrun_o    (overrun),
    .nonfinite_o  (nonfinite),
    .param_fault_o(param_fault),
    .step_count_o (step_count),
    .state_o      (state),
    .low_o        ()
  );

  assign led_o = {clocks_q[24], busy, stuck, nonfinite_q, param_fault, overrun_q, ~fx_ready, |late};
endmodule

`default_nettype wire
