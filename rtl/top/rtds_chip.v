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
// Parts       rtds_port: the serial pins and the registers; rtds_front: the ADC and the crossing of its records; rtds_report:
//             events, levels and LEDs; here the resets and the way from a record to the DAC.
// Crossings   in rtds_front, and the resets.
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
  `include "rtds_core_records.vh"
  `include "adc_record.vh"

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
  wire [WORD_BITS-1:0] fx_word;
  wire          fx_ready;

  `include "rtds_regs_fields.vh"

  // What of it is the core's, as its records.
  wire [   MOTOR_BITS-1:0] motor_regs;  // the left motor, before the choice of sources
  wire [   MOTOR_BITS-1:0] motor_r;
  wire [SETTINGS_BITS-1:0] settings;
  wire [              3:0] from_adc;    // which parameters have the ADC for a source

  assign from_adc[PARAM_B]  = cfg_config_b_from_adc;
  assign from_adc[PARAM_J]  = cfg_config_j_from_adc;
  assign from_adc[PARAM_KM] = cfg_config_km_from_adc;
  assign from_adc[PARAM_KB] = cfg_config_kb_from_adc;

  assign motor_regs[MOTOR_R+:32]  = cfg_r;
  assign motor_regs[MOTOR_L+:32]  = cfg_l;
  assign motor_regs[MOTOR_KM+:32] = cfg_km;
  assign motor_regs[MOTOR_KB+:32] = cfg_kb;
  assign motor_regs[MOTOR_J+:32]  = cfg_j;
  assign motor_regs[MOTOR_B+:32]  = cfg_b;

  assign motor_r[MOTOR_R+:32]  = cfg_r_r;
  assign motor_r[MOTOR_L+:32]  = cfg_l_r;
  assign motor_r[MOTOR_KM+:32] = cfg_km_r;
  assign motor_r[MOTOR_KB+:32] = cfg_kb_r;
  assign motor_r[MOTOR_J+:32]  = cfg_j_r;
  assign motor_r[MOTOR_B+:32]  = cfg_b_r;

  assign settings[SETTINGS_H+:32]      = cfg_h;
  assign settings[SETTINGS_METHOD]     = cfg_config_method;
  assign settings[SETTINGS_FX_ON]      = cfg_effects_on;
  assign settings[SETTINGS_FX_OWN]     = cfg_effects_own;
  assign settings[SETTINGS_DELAY+:12]  = cfg_delay[11:0];
  assign settings[SETTINGS_STRIDE+:16] = cfg_delay[31:16];

  rtds_port #(
    .BUILD_ID         (BUILD_ID),
    .UART_CLKS_PER_BIT(UART_CLKS_PER_BIT)
  ) u_port (
    .clk_i       (clk_sys_i),
    .rst_ni      (rst_sys_n),
    .uart_rx_i   (uart_rx_i),
    .uart_tx_o   (uart_tx_o),
    .run_o       (run),
    .blank_o     (blank),
    .clear_o     (clear),
    .config_o    (cfg),
    .fx_valid_o  (fx_valid),
    .fx_address_o(fx_word[WORD_ADDRESS+:14]),
    .fx_data_o   (fx_word[WORD_DATA+:32]),
    .fx_ready_i  (fx_ready),
    .idle_i      (idle),
    .open_i      (open),
    .step_i      (step_done),
    .event_i     (events),
    .live_i      (live),
    .latency_i   (latency),
    .now_i       (now),
    .codes_i     (codes)
  );

  // --- the ADC's records -------------------------------------------------------------------------------------
  wire        record_valid;
  wire [RECORD_BITS-1:0] record;
  wire        silent;
  wire        lost;

  rtds_front u_front (
    .clk_sys_i     (clk_sys_i),
    .rst_run_ni    (rst_run_n),
    .clk_adc_i     (clk_adc_i),
    .clk_cnv_i     (clk_cnv_i),
    .rst_adc_ni    (rst_adc_n),
    .run_i         (run),
    .record_valid_o(record_valid),
    .record_o      (record),
    .silent_o      (silent),
    .lost_o        (lost),
    .adc_convst_o  (adc_convst_o),
    .adc_sck_o     (adc_sck_o),
    .adc_sdi_o     (adc_sdi_o),
    .adc_sdo_i     (adc_sdo_i)
  );

  // --- 50 MHz: scaling, core, scaling, DAC -----------------------------------------------------------------------
  wire         scale_start;
  wire         scale_valid;
  wire         scale_params;
  wire [127:0] scaled;        // parameters by the ADC, see adc_record.vh
  wire         core_strobe;
  wire [INPUTS_BITS-1:0] core_inputs;
  wire [MOTOR_BITS-1:0] motor_l;
  wire         core_valid;
  wire         core_ready;
  wire         core_overrun;
  wire         core_nonfinite;
  wire         core_param_fault;
  wire [STATE_BITS-1:0] core_state;
  wire [STATE_BITS-1:0] core_low;
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
  wire         dac_updated;
  wire         run_idle;
  wire         run_fx_ready;
  wire         alive;
  wire         halted;
  wire         silent_event;
  wire         dropped_event;

  // The command comes from the registers and goes to all of the core; a record that comes with it is still ten clocks from its step.
  reg clear_q;

  always @(posedge clk_sys_i or negedge rst_run_n) begin
    if (!rst_run_n) clear_q <= 1'b0;
    else clear_q <= clear;
  end

  rtds_ctrl u_ctrl (
    .clk_i           (clk_sys_i),
    .rst_ni          (rst_run_n),
    .run_i           (run),
    .blank_i         (blank),
    .clear_i         (clear_q),
    .motor_i         (motor_regs),
    .from_adc_i      (from_adc),
    .idle_o          (run_idle),
    .record_valid_i  (record_valid),
    .record_codes_i  (record[RECORD_INDEX-1:0]),
    .silent_i        (silent),
    .dropped_i       (lost || dac_dropped),
    .scale_start_o   (scale_start),
    .scale_valid_i   (scale_valid),
    .scale_values_i  (scaled),
    .scale_params_i  (scale_params),
    .core_strobe_o   (core_strobe),
    .motor_o         (motor_l),
    .core_ready_i    (core_ready),
    .core_nonfinite_i(core_nonfinite),
    .codes_valid_i   (codes_valid),
    .dac_write_o     (dac_write),
    .dac_fault_o     (dac_fault),
    .dac_ldac_ni     (!dac_updated),
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
    .code_v_l_i    (record[RECORD_V_L+:CODE_BITS]),
    .code_v_r_i    (record[RECORD_V_R+:CODE_BITS]),
    .code_t_l_i    (record[RECORD_T_L+:CODE_BITS]),
    .code_t_r_i    (record[RECORD_T_R+:CODE_BITS]),
    .code_p_i      (record[RECORD_P+:CODE_BITS]),
    .index_p_i     (record[RECORD_INDEX+:2]),
    .from_adc_i    ({cfg_config_t_from_adc, cfg_config_v_from_adc}),
    .v_l_i         (cfg_v_l),
    .v_r_i         (cfg_v_r),
    .t_l_i         (cfg_t_l),
    .t_r_i         (cfg_t_r),
    .gain_i        (cfg_adc_gain),
    .offset_i      (cfg_adc_offset),
    .valid_o       (scale_valid),
    .v_l_o         (core_inputs[INPUTS_V_L+:32]),
    .v_r_o         (core_inputs[INPUTS_V_R+:32]),
    .t_l_o         (core_inputs[INPUTS_T_L+:32]),
    .t_r_o         (core_inputs[INPUTS_T_R+:32]),
    .p_b_o         (scaled[32*PARAM_B+:32]),
    .p_j_o         (scaled[32*PARAM_J+:32]),
    .p_km_o        (scaled[32*PARAM_KM+:32]),
    .p_kb_o        (scaled[32*PARAM_KB+:32]),
    .params_valid_o(scale_params)
  );

  rtds_core u_core (
    .clk_i        (clk_sys_i),
    .rst_ni       (rst_run_n),
    .strobe_i     (core_strobe),
    .clear_i      (clear_q),
    .inputs_i     (core_inputs),
    .motor_l_i    (motor_l),
    .motor_r_i    (motor_r),
    .settings_i   (settings),
    .word_valid_i (fx_valid),
    .word_i       (fx_word),
    .word_ready_o (run_fx_ready),
    .valid_o      (core_valid),
    .state_o      (core_state),
    .low_o        (core_low),
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
    .i_l_i   (core_state[STATE_I_L+:32]),
    .w_l_i   (core_state[STATE_W_L+:32]),
    .i_r_i   (core_state[STATE_I_R+:32]),
    .w_r_i   (core_state[STATE_W_R+:32]),
    .gain_i  (cfg_dac_gain),
    .offset_i(cfg_dac_offset),
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
    .updated_o   (dac_updated),
    .dac_db_o    (dac_db_o),
    .dac_a_o     (dac_a_o),
    .dac_cs_no   (dac_cs_no),
    .dac_rw_o    (dac_rw_o),
    .dac_ldac_no (dac_ldac_no),
    .dac_reset_no(dac_reset_no)
  );

  // --- reports -----------------------------------------------------------------------------------------------------
  rtds_report u_report (
    .clk_i             (clk_sys_i),
    .rst_ni            (rst_sys_n),
    .open_i            (open),
    .held_i            (held),
    .locked_i          (locked),
    .idle_i            (run_idle),
    .fx_ready_i        (run_fx_ready),
    .core_valid_i      (core_valid),
    .core_ready_i      (core_ready),
    .core_overrun_i    (core_overrun),
    .core_nonfinite_i  (core_nonfinite),
    .core_param_fault_i(core_param_fault),
    .alive_i           (alive),
    .halted_i          (halted),
    .silent_event_i    (silent_event),
    .dropped_event_i   (dropped_event),
    .codes_valid_i     (codes_valid),
    .dac_sat_i         (dac_sat),
    .dac_safe_i        (dac_safe),
    .dac_ready_i       (dac_ready),
    .dac_fault_i       (dac_fault),
    .state_i           (core_state),
    .inputs_i          (core_inputs),
    .motor_i           (motor_l),
    .record_i          (record),
    .dac_codes_i       (dac_codes),
    .run_i             (run),
    .lock_lost_i       (lock_lost),
    .uart_rx_i         (uart_rx_i),
    .uart_tx_i         (uart_tx_o),
    .idle_o            (idle),
    .fx_ready_o        (fx_ready),
    .step_o            (step_done),
    .event_o           (events),
    .live_o            (live),
    .now_o             (now),
    .codes_o           (codes),
    .led_o             (led_o)
  );

  wire unused = ^{cfg, core_low, core_steps, dac_nan};

endmodule

`default_nettype wire
