// rtds_report: what the chip tells of itself: events and levels for the registers, words to be read, LEDs.
//
// Purpose    Everything that the registers hear of the computing part, which a lost lock resets while they live on, passes a
//            reset_gate here; then it is put in the order of the register map.
// Latency    0, but for the LED that blinks.
// Crossing   none: one clock, 50 MHz. open_i, held_i: see reset_ctrl.
`default_nettype none

module rtds_report (
  input  wire         clk_i,
  input  wire         rst_ni,              // of the registers
  input  wire         open_i,
  input  wire         held_i,
  input  wire         locked_i,
  // of the computing part
  input  wire         idle_i,
  input  wire         fx_ready_i,
  input  wire         core_valid_i,
  input  wire         core_ready_i,
  input  wire         core_overrun_i,
  input  wire         core_nonfinite_i,
  input  wire         core_param_fault_i,
  input  wire         alive_i,
  input  wire         halted_i,
  input  wire         silent_event_i,
  input  wire         dropped_event_i,
  input  wire         codes_valid_i,
  input  wire [  3:0] dac_sat_i,
  input  wire         dac_safe_i,
  input  wire         dac_ready_i,
  input  wire         dac_fault_i,
  // words to be read; the first three are records of rtds_core_records.vh
  input  wire [127:0] state_i,
  input  wire [127:0] inputs_i,
  input  wire [191:0] motor_i,             // but for R and L, which are in the configuration
  input  wire [ 61:0] record_i,
  input  wire [ 47:0] dac_codes_i,
  // of the rest
  input  wire         run_i,
  input  wire         lock_lost_i,
  input  wire         uart_rx_i,
  input  wire         uart_tx_i,
  // for the registers
  output wire         idle_o,
  output wire         fx_ready_o,
  output wire         step_o,
  output wire [ 10:0] event_o,             // but for the serial line's
  output wire [  5:0] live_o,
  output wire [383:0] now_o,
  output wire [159:0] codes_o,
  output wire [  7:0] led_o
);

  `include "rtds_regs_map.vh"
  `include "rtds_core_records.vh"
  `include "adc_record.vh"

  // What the computing part says, in the places of the register map. What comes from elsewhere joins it behind the gate.
  wire [ 3:0] saturated = dac_sat_i & {4{codes_valid_i}};
  wire [10:0] event_run;
  wire [ 5:0] live_run;
  wire [10:0] event_gated;
  wire [ 5:0] live_gated;
  wire        idle_gated;

  assign event_run[BIT_STATUS_OVERRUN]      = core_overrun_i;
  assign event_run[BIT_STATUS_NONFINITE]    = core_nonfinite_i;
  assign event_run[BIT_STATUS_ADC_SILENT]   = silent_event_i;
  assign event_run[BIT_STATUS_SAT_I_L]      = saturated[0];
  assign event_run[BIT_STATUS_SAT_W_L]      = saturated[1];
  assign event_run[BIT_STATUS_SAT_I_R]      = saturated[2];
  assign event_run[BIT_STATUS_SAT_W_R]      = saturated[3];
  assign event_run[BIT_STATUS_LOCK_LOST]    = 1'b0;
  assign event_run[BIT_STATUS_PARAM_FAULT]  = core_param_fault_i;
  assign event_run[BIT_STATUS_SERIAL_ERROR] = 1'b0;  // of rtds_port
  assign event_run[BIT_STATUS_DROPPED]      = dropped_event_i;

  assign live_run[BIT_LIVE_LOCKED]      = 1'b0;
  assign live_run[BIT_LIVE_ADC_ALIVE]   = alive_i;
  assign live_run[BIT_LIVE_READY]       = core_ready_i;
  assign live_run[BIT_LIVE_PARAM_FAULT] = core_param_fault_i;
  assign live_run[BIT_LIVE_HALTED]      = halted_i;
  assign live_run[BIT_LIVE_BLANKED]     = dac_safe_i || !dac_ready_i && dac_fault_i;

  // The computing part is reset by a lost lock while the registers live on.
  reset_gate #(
    .WIDTH(20)
  ) u_gate (
    .open_i(open_i),
    .d_i   ({idle_i, fx_ready_i, core_valid_i, live_run, event_run}),
    .q_o   ({idle_gated, fx_ready_o, step_o, live_gated, event_gated})
  );

  // While it stands in reset no step is in hand: a configuration may be taken over.
  assign idle_o  = idle_gated || held_i;
  assign event_o = event_gated | ({10'd0, lock_lost_i} << BIT_STATUS_LOCK_LOST);
  assign live_o  = live_gated | ({5'd0, locked_i} << BIT_LIVE_LOCKED);

  // Words to be read, the first one lowest.
  assign now_o[32*(ADDR_NOW_I_L-ADDR_NOW_I_L)+:32] = state_i[STATE_I_L+:32];
  assign now_o[32*(ADDR_NOW_W_L-ADDR_NOW_I_L)+:32] = state_i[STATE_W_L+:32];
  assign now_o[32*(ADDR_NOW_I_R-ADDR_NOW_I_L)+:32] = state_i[STATE_I_R+:32];
  assign now_o[32*(ADDR_NOW_W_R-ADDR_NOW_I_L)+:32] = state_i[STATE_W_R+:32];
  assign now_o[32*(ADDR_NOW_V_L-ADDR_NOW_I_L)+:32] = inputs_i[INPUTS_V_L+:32];
  assign now_o[32*(ADDR_NOW_V_R-ADDR_NOW_I_L)+:32] = inputs_i[INPUTS_V_R+:32];
  assign now_o[32*(ADDR_NOW_T_L-ADDR_NOW_I_L)+:32] = inputs_i[INPUTS_T_L+:32];
  assign now_o[32*(ADDR_NOW_T_R-ADDR_NOW_I_L)+:32] = inputs_i[INPUTS_T_R+:32];
  assign now_o[32*(ADDR_NOW_B-ADDR_NOW_I_L)+:32]   = motor_i[MOTOR_B+:32];
  assign now_o[32*(ADDR_NOW_J-ADDR_NOW_I_L)+:32]   = motor_i[MOTOR_J+:32];
  assign now_o[32*(ADDR_NOW_KM-ADDR_NOW_I_L)+:32]  = motor_i[MOTOR_KM+:32];
  assign now_o[32*(ADDR_NOW_KB-ADDR_NOW_I_L)+:32]  = motor_i[MOTOR_KB+:32];

  // Two codes a word, in its halves.
  assign codes_o[32*(ADDR_CODES_V-ADDR_CODES_V)+:32] = {
    4'd0, record_i[RECORD_V_R+:CODE_BITS], 4'd0, record_i[RECORD_V_L+:CODE_BITS]
  };
  assign codes_o[32*(ADDR_CODES_T-ADDR_CODES_V)+:32] = {
    4'd0, record_i[RECORD_T_R+:CODE_BITS], 4'd0, record_i[RECORD_T_L+:CODE_BITS]
  };
  assign codes_o[32*(ADDR_CODES_P-ADDR_CODES_V)+:32] = {
    14'd0, record_i[RECORD_INDEX+:2], 4'd0, record_i[RECORD_P+:CODE_BITS]
  };
  assign codes_o[32*(ADDR_CODES_L-ADDR_CODES_V)+:32] = {4'd0, dac_codes_i[23:12], 4'd0, dac_codes_i[11:0]};
  assign codes_o[32*(ADDR_CODES_R-ADDR_CODES_V)+:32] = {4'd0, dac_codes_i[47:36], 4'd0, dac_codes_i[35:24]};

  // --- LEDs: alive, locked, halted, blanked, parameter fault, ADC alive, serial traffic, running ----------------
  reg [24:0] blink_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) blink_q <= 25'd0;
    else         blink_q <= blink_q + 25'd1;
  end

  assign led_o = {
    run_i, !uart_tx_i || !uart_rx_i, live_o[BIT_LIVE_ADC_ALIVE], live_o[BIT_LIVE_PARAM_FAULT],
    live_o[BIT_LIVE_BLANKED], live_o[BIT_LIVE_HALTED], locked_i, blink_q[24]
  };

  wire unused = ^{motor_i[MOTOR_R+:32], motor_i[MOTOR_L+:32]};

endmodule

`default_nettype wire
