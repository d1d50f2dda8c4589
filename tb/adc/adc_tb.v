// adc_tb: adc_sequencer, an LTC2308 and the pads between them, each pin with its own delay.
//
// The clocks are made here, so that Icarus runs at full speed; the phase of CONVST's clock is as the PLL makes it.
`default_nettype none
`timescale 1ps / 1ps

module adc_tb;

  // set by the test; times in ps
  reg         rst_n;
  reg         enable;
  reg  [95:0] codes;
  reg  [31:0] t_conv;
  reg  [31:0] d_convst;
  reg  [31:0] d_convst_fall;
  reg  [31:0] d_sck;
  reg  [31:0] d_sck_fall;
  reg  [31:0] d_sdi;
  reg  [31:0] d_sdo;
  reg         sdo_stuck;
  reg         sdo_level;
  reg         agent_clear;

  // looked at by the test
  reg         clk;
  reg         clk_cnv;
  wire [11:0] code_v_l;
  wire [11:0] code_v_r;
  wire [11:0] code_t_l;
  wire [11:0] code_t_r;
  wire [11:0] code_p;
  wire [ 1:0] index_p;
  wire        toggle;
  wire        valid;
  wire        silent;
  wire [15:0] violations;
  wire [31:0] violation_count;
  wire [31:0] conversions;
  wire [ 2:0] channel;
  wire        channel_known;
  wire [31:0] t_last_convst;

  wire        convst;
  wire        sck;
  wire        sdi;
  wire        sdo_at_part;
  reg         convst_at_part;
  reg         sck_at_part;
  reg         sdi_at_part;
  reg         sdo;

  initial begin
    rst_n          = 1'b0;
    enable         = 1'b0;
    codes          = 96'd0;
    t_conv         = 1600000;
    d_convst       = 4000;
    d_convst_fall  = 4000;
    d_sck          = 4000;
    d_sck_fall     = 4000;
    d_sdi          = 4000;
    d_sdo          = 4000;
    sdo_stuck      = 1'b0;
    sdo_level      = 1'b0;
    agent_clear    = 1'b0;
    convst_at_part = 1'b0;
    sck_at_part    = 1'b0;
    sdi_at_part    = 1'b0;
    sdo            = 1'b0;
    clk            = 1'b0;
    clk_cnv        = 1'b0;
  end

  always #12500 clk = !clk;
  always @(clk) clk_cnv <= #7500 clk;

  // Pads: transport delays, shorter than the shortest pulse; CONVST and SCK have one for each direction.
  always @(convst) convst_at_part <= #(convst ? d_convst : d_convst_fall) convst;
  always @(sck) sck_at_part <= #(sck ? d_sck : d_sck_fall) sck;
  always @(sdi) sdi_at_part <= #(d_sdi) sdi;
  always @(sdo_at_part or sdo_stuck or sdo_level) sdo <= #(d_sdo) level(sdo_stuck ? sdo_level : sdo_at_part);

  // An input buffer makes some level of a floating or undefined line: 0 here, so that no X gets past a pad.
  function level(input pin);
    level = (pin === 1'b1);
  endfunction

  // How long SDO has stood still at the edges that catch a bit, and for how long it does so after them.
  reg  [31:0] capture_setup_min;
  reg  [31:0] capture_hold_min;
  time        t_sdo;
  time        t_capture;
  reg         captured;
  wire        catches = dut.u_spi.active_q && (dut.u_spi.count_q >= 7'd64) && (dut.u_spi.count_q < 7'd76);

  initial begin
    capture_setup_min = 32'hFFFF_FFFF;
    capture_hold_min  = 32'hFFFF_FFFF;
    t_sdo             = 0;
    t_capture         = 0;
    captured          = 1'b0;
  end

  always @(sdo) begin
    if (captured && $time - t_capture < {32'd0, capture_hold_min}) capture_hold_min = $time - t_capture;
    captured = 1'b0;
    t_sdo    = $time;
  end

  always @(posedge clk)
    if (catches && rst_n && !sdo_stuck) begin
      if ($time - t_sdo < {32'd0, capture_setup_min}) capture_setup_min = $time - t_sdo;
      t_capture = $time;
      captured  = 1'b1;
    end

  adc_sequencer dut (
      .clk_i        (clk),
      .clk_cnv_i    (clk_cnv),
      .rst_ni       (rst_n),
      .enable_i     (enable),
      .code_v_l_o   (code_v_l),
      .code_v_r_o   (code_v_r),
      .code_t_l_o   (code_t_l),
      .code_t_r_o   (code_t_r),
      .code_p_o     (code_p),
      .index_p_o    (index_p),
      .done_toggle_o(toggle),
      .valid_o      (valid),
      .silent_o     (silent),
      .adc_convst_o (convst),
      .adc_sck_o    (sck),
      .adc_sdi_o    (sdi),
      .adc_sdo_i    (sdo)
  );

  ltc2308 part (
      .convst_i         (convst_at_part),
      .sck_i            (sck_at_part),
      .sdi_i            (sdi_at_part),
      .sdo_o            (sdo_at_part),
      .codes_i          (codes),
      .t_conv_ps_i      (t_conv),
      .clear_i          (agent_clear),
      .forgive_i        (1'b0),
      .violations_o     (violations),
      .violation_count_o(violation_count),
      .conversions_o    (conversions),
      .channel_o        (channel),
      .channel_known_o  (channel_known),
      .t_last_convst_o  (t_last_convst)
  );

endmodule

`default_nettype wire
