// rtds_chip: everything behind the pins except the PLL primitive.
//
// Purpose     ADC pins -> sequencer (40 MHz) -> crossing -> scaling -> both motor units -> scaling -> DAC pins,
//             and the register file behind two serial pins. Clocks and lock come from outside: the board's top
//             takes them from pll_adc, a simulation from its harness.
// Clocks      clk_sys_i  50 MHz, the board's own: registers, core, scaling, DAC
//             clk_adc_i  40 MHz: SPI master and sequencer; clk_cnv_i the same 7.5 ns later: CONVST alone
// Resets      see reset_ctrl. A lost lock clears the state and holds the DAC in reset; registers survive, and hear of
//             what it clears through reset_gates only.
// Latency     from the record's arrival in the 50 MHz domain to the falling edge of LDAC: constant, see
//             docs/chip.md and register LATENCY; the crossing adds 2 clocks of 40 MHz and 3 to 4 of 50 MHz.
// Crossings   u_record (record, cdc_handshake), u_silent, u_lost, u_enable (levels, cdc_sync), resets.
`default_nettype none

module rtds_chip #(
    parameter [31:0] BUILD_ID = 32'd0,
    parameter        UART_CLKS_PER_BIT = 50,  // 1 Mbaud
    parameter        LOCK_CLOCKS = 63
) (
    input  wire        clk_sys_i,
    input  wire        clk_adc_i,
    input  wire        clk_cnv_i,
    input  wire        pll_locked_i,
    input  wire        ext_rst_ni,

    output wire        adc_convst_o,
    output wire        adc_sck_o,
    output wire        adc_sdi_o,
    input  wire        adc_sdo_i,

    output wire [11:0] dac_db_o,
    output wire [ 1:0] dac_a_o,
    output wire        dac_cs_no,
    output wire        dac_rw_o,
    output wire        dac_ldac_no,
    output wire        dac_reset_no,

    input  wire        uart_rx_i,
    output wire        uart_tx_o,

    output wire [ 7:0] led_o
);

  `include "rtds_regs_map.vh"

  // --- resets --------------------------------------------------------------------------------------------
  wire rst_sys_n;
  wire rst_run_n;
  wire rst_pin_n;
  wire rst_adc_n;
  wire open;
  wire held;
  wire locked;
  wire lock_lost;

  reset_ctrl #(
      .LOCK_CLOCKS(LOCK_CLOCKS)
  ) u_reset (
      .clk_sys_i   (clk_sys_i),
      .clk_adc_i   (clk_adc_i),
      .ext_rst_ni  (ext_rst_ni),
      .pll_locked_i(pll_locked_i),
      .rst_sys_no  (rst_sys_n),
      .rst_run_no  (rst_run_n),
      .rst_pin_no  (rst_pin_n),
      .rst_adc_no  (rst_adc_n),
      .open_o      (open),
      .held_o      (held),
      .locked_o    (locked),
      .lock_lost_o (lock_lost)
  );

  // --- registers behind the serial port --------------------------------------------------------------------
  wire          rx_valid;
  wire [   7:0] rx_data;
  wire          rx_error;
  wire          tx_valid;
  wire          tx_ready;
  wire [   7:0] tx_data;
  wire [   7:0] avs_address;
  wire          avs_read;
  wire          avs_write;
  wire [  31:0] avs_writedata;
  wire [  31:0] avs_readdata;
  wire          avs_readdatavalid;
  wire          avs_writeresponsevalid;
  wire [   1:0] avs_response;
  wire          serial_error;
  wire          run;
  wire          blank;
  wire          clear;
  wire          idle;
  wire          step_done;
  wire [  10:0] events;
  wire [   5:0] live;
  wire [  31:0] latency;
  wire [ 383:0] now;
  wire [ 159:0] codes;
  wire [32*CFG_WORDS-1:0] cfg;
  wire          fx_valid;
  wire [  13:0] fx_address;
  wire [  31:0] fx_data;
  wire          fx_ready;

  uart_rx #(
      .CLKS_PER_BIT(UART_CLKS_PER_BIT)
  ) u_uart_rx (
      .clk_i  (clk_sys_i),
      .rst_ni (rst_sys_n),
      .rx_i   (uart_rx_i),
      .valid_o(rx_valid),
      .data_o (rx_data),
      .error_o(rx_error)
  );

  uart_tx #(
      .CLKS_PER_BIT(UART_CLKS_PER_BIT)
  ) u_uart_tx (
      .clk_i  (clk_sys_i),
      .rst_ni (rst_sys_n),
      .valid_i(tx_valid),
      .ready_o(tx_ready),
      .data_i (tx_data),
      .tx_o   (uart_tx_o)
  );

  serial_bridge #(
      .TIMEOUT_CLKS(UART_CLKS_PER_BIT * 2000)
  ) u_bridge (
      .clk_i                   (clk_sys_i),
      .rst_ni                  (rst_sys_n),
      .rx_valid_i              (rx_valid),
      .rx_data_i               (rx_data),
      .rx_error_i              (rx_error),
      .tx_valid_o              (tx_valid),
      .tx_ready_i              (tx_ready),
      .tx_data_o               (tx_data),
      .avm_address_o           (avs_address),
      .avm_read_o              (avs_read),
      .avm_write_o             (avs_write),
      .avm_writedata_o         (avs_writedata),
      .avm_readdata_i          (avs_readdata),
      .avm_readdatavalid_i     (avs_readdatavalid),
      .avm_writeresponsevalid_i(avs_writeresponsevalid),
      .avm_response_i          (avs_response),
      .error_o                 (serial_error)
  );

  rtds_regs #(
      .BUILD_ID(BUILD_ID)
  ) u_regs (
      .clk_i                   (clk_sys_i),
      .rst_ni                  (rst_sys_n),
      .avs_address_i           (avs_address),
      .avs_read_i              (avs_read),
      .avs_write_i             (avs_write),
      .avs_writedata_i         (avs_writedata),
      .avs_readdata_o          (avs_readdata),
      .avs_readdatavalid_o     (avs_readdatavalid),
      .avs_writeresponsevalid_o(avs_writeresponsevalid),
      .avs_response_o          (avs_response),
      .run_o                   (run),
      .blank_o                 (blank),
      .config_o                (cfg),
      .clear_o                 (clear),
      .fx_valid_o              (fx_valid),
      .fx_address_o            (fx_address),
      .fx_data_o               (fx_data),
      .fx_ready_i              (fx_ready),
      .idle_i                  (idle),
      .open_i                  (open),
      .event_i                 (events),
      .live_i                  (live),
      .step_i                  (step_done),
      .serial_error_i          (serial_error),
      .latency_i               (latency),
      .now_i                   (now),
      .codes_i                 (codes)
  );

  // --- 40 MHz: sequencer, and its record into 50 MHz -----------------------------------------------------------
  wire        enable_adc;
  wire [61:0] record_adc;
  wire        toggle_adc;
  wire        valid_adc;
  wire        silent_adc;
  wire        dropped_adc;
  reg         lost_q;

  cdc_sync u_enable (
      .clk_i (clk_adc_i),
      .rst_ni(rst_adc_n),
      .d_i   (run),
      .q_o   (enable_adc)
  );

  // record: {index_p[1:0], code_p, code_t_r, code_t_l, code_v_r, code_v_l}
  adc_sequencer u_sequencer (
      .clk_i        (clk_adc_i),
      .clk_cnv_i    (clk_cnv_i),
      .rst_ni       (rst_adc_n),
      .enable_i     (enable_adc),
      .code_v_l_o   (record_adc[11:0]),
      .code_v_r_o   (record_adc[23:12]),
      .code_t_l_o   (record_adc[35:24]),
      .code_t_r_o   (record_adc[47:36]),
      .code_p_o     (record_adc[59:48]),
      .index_p_o    (record_adc[61:60]),
      .done_toggle_o(toggle_adc),
      .valid_o      (valid_adc),
      .silent_o     (silent_adc),
      .adc_convst_o (adc_convst_o),
      .adc_sck_o    (adc_sck_o),
      .adc_sdi_o    (adc_sdi_o),
      .adc_sdo_i    (adc_sdo_i)
  );

  // A record that the crossing could not take is reported by a level that changes once a loss.
  always @(posedge clk_adc_i or negedge rst_adc_n) begin
    if (!rst_adc_n) lost_q <= 1'b0;
    else if (dropped_adc) lost_q <= !lost_q;
  end

  wire        record_valid;
  wire [61:0] record;
  wire        record_ready;
  wire        silent;
  wire        lost;
  reg         lost_prev_q;

  cdc_handshake #(
      .WIDTH(62)
  ) u_record (
      .src_clk_i    (clk_adc_i),
      .src_rst_ni   (rst_adc_n),
      .src_valid_i  (valid_adc),
      .src_ready_o  (record_ready),
      .src_data_i   (record_adc),
      .src_dropped_o(dropped_adc),
      .dst_clk_i    (clk_sys_i),
      .dst_rst_ni   (rst_run_n),
      .dst_valid_o  (record_valid),
      .dst_data_o   (record)
  );

  cdc_sync u_silent (
      .clk_i (clk_sys_i),
      .rst_ni(rst_run_n),
      .d_i   (silent_adc),
      .q_o   (silent)
  );

  cdc_sync u_lost (
      .clk_i (clk_sys_i),
      .rst_ni(rst_run_n),
      .d_i   (lost_q),
      .q_o   (lost)
  );

  always @(posedge clk_sys_i or negedge rst_run_n) begin
    if (!rst_run_n) lost_prev_q <= 1'b0;
    else            lost_prev_q <= lost;
  end

  // --- 50 MHz: scaling, core, scaling, DAC -----------------------------------------------------------------------
  wire         scale_start;
  wire         scale_valid;
  wire         scale_params;
  wire [255:0] scaled;        // V_L V_R T_L T_R B J KM KB, low to high
  wire         core_strobe;
  wire [127:0] core_inputs;   // V_L V_R T_L T_R
  wire [127:0] core_params;   // B J KM KB
  wire         core_valid;
  wire         core_ready;
  wire         core_overrun;
  wire         core_nonfinite;
  wire         core_param_fault;
  wire [ 31:0] i_l;
  wire [ 31:0] w_l;
  wire [ 31:0] i_r;
  wire [ 31:0] w_r;
  wire [127:0] low_words;
  wire [ 31:0] core_steps;
  wire         codes_valid;
  wire [ 47:0] dac_codes;
  wire [  3:0] dac_sat;
  wire [  3:0] dac_nan;
  wire         dac_write;
  wire         dac_fault;
  wire         dac_ready;
  wire         dac_dropped;
  wire         dac_safe;
  wire         run_idle;
  wire         run_fx_ready;
  wire         alive;
  wire         halted;
  wire         silent_event;
  wire         dropped_event;

  rtds_ctrl u_ctrl (
      .clk_i           (clk_sys_i),
      .rst_ni          (rst_run_n),
      .run_i           (run),
      .blank_i         (blank),
      .clear_i         (clear),
      .values_i        ({cfg[32*CFG_V_L+:128], cfg[32*CFG_KM+:128]}),
      .from_adc_i      (cfg[32*CFG_CONFIG+BIT_CONFIG_B_FROM_ADC+:6]),
      .idle_o          (run_idle),
      .record_valid_i  (record_valid),
      .record_codes_i  (record[59:0]),
      .silent_i        (silent),
      .dropped_i       (lost != lost_prev_q || dac_dropped),
      .scale_start_o   (scale_start),
      .scale_valid_i   (scale_valid),
      .scale_values_i  (scaled),
      .scale_params_i  (scale_params),
      .core_strobe_o   (core_strobe),
      .core_inputs_o   (core_inputs),
      .core_params_o   (core_params),
      .core_ready_i    (core_ready),
      .core_nonfinite_i(core_nonfinite),
      .codes_valid_i   (codes_valid),
      .dac_write_o     (dac_write),
      .dac_fault_o     (dac_fault),
      .dac_ldac_ni     (dac_ldac_no),
      .alive_o         (alive),
      .halted_o        (halted),
      .silent_event_o  (silent_event),
      .dropped_event_o (dropped_event),
      .latency_o       (latency)
  );

  adc_scale u_adc_scale (
      .clk_i         (clk_sys_i),
      .rst_ni        (rst_run_n),
      .valid_i       (scale_start),
      .code_v_l_i    (record[11:0]),
      .code_v_r_i    (record[23:12]),
      .code_t_l_i    (record[35:24]),
      .code_t_r_i    (record[47:36]),
      .code_p_i      (record[59:48]),
      .index_p_i     (record[61:60]),
      .gain_i        (cfg[32*CFG_ADC_V_L_GAIN+:256]),
      .offset_i      (cfg[32*CFG_ADC_V_L_OFFSET+:256]),
      .valid_o       (scale_valid),
      .v_l_o         (scaled[31:0]),
      .v_r_o         (scaled[63:32]),
      .t_l_o         (scaled[95:64]),
      .t_r_o         (scaled[127:96]),
      .p_b_o         (scaled[159:128]),
      .p_j_o         (scaled[191:160]),
      .p_km_o        (scaled[223:192]),
      .p_kb_o        (scaled[255:224]),
      .params_valid_o(scale_params)
  );

  rtds_core u_core (
      .clk_i        (clk_sys_i),
      .rst_ni       (rst_run_n),
      .strobe_i     (core_strobe),
      .clear_i      (clear),
      .v_l_i        (core_inputs[31:0]),
      .v_r_i        (core_inputs[63:32]),
      .t_l_i        (core_inputs[95:64]),
      .t_r_i        (core_inputs[127:96]),
      .p_r_i        (cfg[32*CFG_R+:32]),
      .p_l_i        (cfg[32*CFG_L+:32]),
      .p_km_i       (core_params[95:64]),
      .p_kb_i       (core_params[127:96]),
      .p_j_i        (core_params[63:32]),
      .p_b_i        (core_params[31:0]),
      .p_h_i        (cfg[32*CFG_H+:32]),
      .method_i     (cfg[32*CFG_CONFIG+BIT_CONFIG_METHOD]),
      .fx_on_i      (cfg[32*CFG_EFFECTS+BIT_EFFECTS_ON]),
      .fx_own_i     (cfg[32*CFG_EFFECTS+BIT_EFFECTS_OWN]),
      .fx_delay_i   (cfg[32*CFG_DELAY+:12]),
      .fx_stride_i  (cfg[32*CFG_DELAY+16+:16]),
      .p2_r_i       (cfg[32*CFG_R_R+:32]),
      .p2_l_i       (cfg[32*CFG_L_R+:32]),
      .p2_km_i      (cfg[32*CFG_KM_R+:32]),
      .p2_kb_i      (cfg[32*CFG_KB_R+:32]),
      .p2_j_i       (cfg[32*CFG_J_R+:32]),
      .p2_b_i       (cfg[32*CFG_B_R+:32]),
      .fx_wr_valid_i(fx_valid),
      .fx_wr_addr_i (fx_address),
      .fx_wr_data_i (fx_data),
      .fx_wr_ready_o(run_fx_ready),
      .valid_o      (core_valid),
      .i_l_o        (i_l),
      .w_l_o        (w_l),
      .i_r_o        (i_r),
      .w_r_o        (w_r),
      .i_l_lo_o     (low_words[31:0]),
      .w_l_lo_o     (low_words[63:32]),
      .i_r_lo_o     (low_words[95:64]),
      .w_r_lo_o     (low_words[127:96]),
      .ready_o      (core_ready),
      .overrun_o    (core_overrun),
      .nonfinite_o  (core_nonfinite),
      .param_fault_o(core_param_fault),
      .step_count_o (core_steps)
  );

  dac_scale u_dac_scale (
      .clk_i   (clk_sys_i),
      .rst_ni  (rst_run_n),
      .valid_i (core_valid),
      .i_l_i   (i_l),
      .w_l_i   (w_l),
      .i_r_i   (i_r),
      .w_r_i   (w_r),
      .gain_i  (cfg[32*CFG_DAC_I_L_GAIN+:128]),
      .offset_i(cfg[32*CFG_DAC_I_L_OFFSET+:128]),
      .valid_o (codes_valid),
      .code_o  (dac_codes),
      .sat_o   (dac_sat),
      .nan_o   (dac_nan)
  );

  dac_parallel u_dac (
      .clk_i       (clk_sys_i),
      .rst_ni      (rst_run_n),
      .rst_pin_ni  (rst_pin_n),
      .write_i     (dac_write),
      .code_i      (dac_codes),
      .fault_i     (dac_fault),
      .ready_o     (dac_ready),
      .dropped_o   (dac_dropped),
      .safe_o      (dac_safe),
      .dac_db_o    (dac_db_o),
      .dac_a_o     (dac_a_o),
      .dac_cs_no   (dac_cs_no),
      .dac_rw_o    (dac_rw_o),
      .dac_ldac_no (dac_ldac_no),
      .dac_reset_no(dac_reset_no)
  );

  // --- reports -----------------------------------------------------------------------------------------------------
  // The computing part is reset by a lost lock while the registers live on.
  wire [9:0] report = {
    dropped_event, core_param_fault, dac_sat & {4{codes_valid}}, silent_event, core_nonfinite, core_overrun, core_valid
  };
  wire [9:0] reported;
  wire [4:0] level = {dac_safe || !dac_ready && dac_fault, halted, core_param_fault, core_ready, alive};
  wire [4:0] levels;
  wire       gated_idle;

  reset_gate #(
      .WIDTH(17)
  ) u_gate (
      .open_i(open),
      .d_i   ({run_idle, run_fx_ready, level, report}),
      .q_o   ({gated_idle, fx_ready, levels, reported})
  );

  // While it stands in reset no step is in hand: a configuration may be taken over.
  assign idle = gated_idle || held;

  assign step_done                         = reported[0];
  assign events[BIT_STATUS_OVERRUN]        = reported[1];
  assign events[BIT_STATUS_NONFINITE]      = reported[2];
  assign events[BIT_STATUS_ADC_SILENT]     = reported[3];
  assign events[BIT_STATUS_SAT_I_L]        = reported[4];
  assign events[BIT_STATUS_SAT_W_L]        = reported[5];
  assign events[BIT_STATUS_SAT_I_R]        = reported[6];
  assign events[BIT_STATUS_SAT_W_R]        = reported[7];
  assign events[BIT_STATUS_PARAM_FAULT]    = reported[8];
  assign events[BIT_STATUS_DROPPED]        = reported[9];
  assign events[BIT_STATUS_LOCK_LOST]      = lock_lost;
  assign events[BIT_STATUS_SERIAL_ERROR]   = serial_error;

  assign live[BIT_LIVE_LOCKED]      = locked;
  assign live[BIT_LIVE_ADC_ALIVE]   = levels[0];
  assign live[BIT_LIVE_READY]       = levels[1];
  assign live[BIT_LIVE_PARAM_FAULT] = levels[2];
  assign live[BIT_LIVE_HALTED]      = levels[3];
  assign live[BIT_LIVE_BLANKED]     = levels[4];

  assign now = {
    core_params[127:96], core_params[95:64], core_params[63:32], core_params[31:0],
    core_inputs, w_r, i_r, w_l, i_l
  };
  assign codes = {
    4'd0, dac_codes[47:36], 4'd0, dac_codes[35:24],
    4'd0, dac_codes[23:12], 4'd0, dac_codes[11:0],
    14'd0, record[61:60], 4'd0, record[59:48],
    4'd0, record[47:36], 4'd0, record[35:24],
    4'd0, record[23:12], 4'd0, record[11:0]
  };

  // --- LEDs: alive, locked, halted, blanked, parameter fault, ADC alive, serial traffic, running ----------------
  reg [24:0] blink_q;

  always @(posedge clk_sys_i or negedge rst_sys_n) begin
    if (!rst_sys_n) blink_q <= 25'd0;
    else            blink_q <= blink_q + 25'd1;
  end

  assign led_o = {
    run, !uart_tx_o || !uart_rx_i, levels[0], levels[2], levels[4], levels[3], locked, blink_q[24]
  };

  wire unused = ^{toggle_adc, record_ready, low_words, core_steps, dac_nan};

endmodule

`default_nettype wire
