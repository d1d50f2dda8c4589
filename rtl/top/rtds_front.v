// rtds_front: the ADC's side: sequencer at 40 MHz, and its records into 50 MHz.
//
// Purpose    ADC pins -> adc_sequencer -> crossing -> one record every 10 us; and whether the line is dead, or a record was lost.
// Handshake  record_valid_o one clock a record; record_o holds to the next. run_i: sequences are made.
// Latency    2 clocks of 40 MHz and 3 to 4 of 50 MHz from the end of a sequence to record_valid_o.
// Format     record_o: adc_record.vh.
// Crossings  u_record (cdc_handshake), u_silent, u_lost, u_enable (levels, cdc_sync).
`default_nettype none

module rtds_front (
  input  wire        clk_sys_i,       // 50 MHz
  input  wire        rst_run_ni,
  input  wire        clk_adc_i,       // 40 MHz, and 7.5 ns later
  input  wire        clk_cnv_i,
  input  wire        rst_adc_ni,
  input  wire        run_i,
  output wire        record_valid_o,
  output wire [61:0] record_o,
  output wire        silent_o,
  output wire        lost_o,          // one clock: a record did not cross
  output wire        adc_convst_o,
  output wire        adc_sck_o,
  output wire        adc_sdi_o,
  input  wire        adc_sdo_i
);

  `include "adc_record.vh"

  wire        enable_adc;
  wire [RECORD_BITS-1:0] record_adc;
  wire        toggle_adc;
  wire        valid_adc;
  wire        silent_adc;
  wire        dropped_adc;
  wire        record_ready;
  wire        lost;
  reg         lost_q;
  reg         lost_prev_q;

  cdc_sync u_enable (
    .clk_i (clk_adc_i),
    .rst_ni(rst_adc_ni),
    .d_i   (run_i),
    .q_o   (enable_adc)
  );

  adc_sequencer u_sequencer (
    .clk_i        (clk_adc_i),
    .clk_cnv_i    (clk_cnv_i),
    .rst_ni       (rst_adc_ni),
    .enable_i     (enable_adc),
    .code_v_l_o   (record_adc[RECORD_V_L+:CODE_BITS]),
    .code_v_r_o   (record_adc[RECORD_V_R+:CODE_BITS]),
    .code_t_l_o   (record_adc[RECORD_T_L+:CODE_BITS]),
    .code_t_r_o   (record_adc[RECORD_T_R+:CODE_BITS]),
    .code_p_o     (record_adc[RECORD_P+:CODE_BITS]),
    .index_p_o    (record_adc[RECORD_INDEX+:2]),
    .done_toggle_o(toggle_adc),
    .valid_o      (valid_adc),
    .silent_o     (silent_adc),
    .adc_convst_o (adc_convst_o),
    .adc_sck_o    (adc_sck_o),
    .adc_sdi_o    (adc_sdi_o),
    .adc_sdo_i    (adc_sdo_i)
  );

  // A record that the crossing could not take is reported by a level that changes once a loss.
  always @(posedge clk_adc_i or negedge rst_adc_ni) begin
    if (!rst_adc_ni) lost_q <= 1'b0;
    else if (dropped_adc) lost_q <= !lost_q;
  end

  cdc_handshake #(
    .WIDTH(RECORD_BITS)
  ) u_record (
    .src_clk_i    (clk_adc_i),
    .src_rst_ni   (rst_adc_ni),
    .src_valid_i  (valid_adc),
    .src_ready_o  (record_ready),
    .src_data_i   (record_adc),
    .src_dropped_o(dropped_adc),
    .dst_clk_i    (clk_sys_i),
    .dst_rst_ni   (rst_run_ni),
    .dst_valid_o  (record_valid_o),
    .dst_data_o   (record_o)
  );

  cdc_sync u_silent (
    .clk_i (clk_sys_i),
    .rst_ni(rst_run_ni),
    .d_i   (silent_adc),
    .q_o   (silent_o)
  );

  cdc_sync u_lost (
    .clk_i (clk_sys_i),
    .rst_ni(rst_run_ni),
    .d_i   (lost_q),
    .q_o   (lost)
  );

  always @(posedge clk_sys_i or negedge rst_run_ni) begin
    if (!rst_run_ni) lost_prev_q <= 1'b0;
    else             lost_prev_q <= lost;
  end

  assign lost_o = lost != lost_prev_q;

  wire unused = ^{toggle_adc, record_ready};

endmodule

`default_nettype wire
