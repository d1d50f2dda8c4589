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

  // The computing part is reset by a lost lock while the registers live on.
  wire [9:0] report = {
    dropped_event_i, core_param_fault_i, dac_sat_i & {4{codes_valid_i}}, silent_event_i, core_nonfinite_i,
    core_overrun_i, core_valid_i
  };
  wire [9:0] reported;
  wire       blanked = dac_safe_i || !dac_ready_i && dac_fault_i;
  wire [4:0] level = {blanked, halted_i, core_param_fault_i, core_ready_i, alive_i};
  wire [4:0] levels;
  wire       gated_idle;

  reset_gate #(
      .WIDTH(17)
  ) u_gate (
      .open_i(open_i),
      .d_i   ({idle_i, fx_ready_i, level, report}),
      .q_o   ({gated_idle, fx_ready_o, levels, reported})
  );

  // While it stands in reset no step is in hand: a configuration may be taken over.
  assign idle_o = gated_idle || held_i;

  assign step_o                             = reported[0];
  assign event_o[BIT_STATUS_OVERRUN]        = reported[1];
  assign event_o[BIT_STATUS_NONFINITE]      = reported[2];
  assign event_o[BIT_STATUS_ADC_SILENT]     = reported[3];
  assign event_o[BIT_STATUS_SAT_I_L]        = reported[4];
  assign event_o[BIT_STATUS_SAT_W_L]        = reported[5];
  assign event_o[BIT_STATUS_SAT_I_R]        = reported[6];
  assign event_o[BIT_STATUS_SAT_W_R]        = reported[7];
  assign event_o[BIT_STATUS_PARAM_FAULT]    = reported[8];
  assign event_o[BIT_STATUS_DROPPED]        = reported[9];
  assign event_o[BIT_STATUS_LOCK_LOST]      = lock_lost_i;
  assign event_o[BIT_STATUS_SERIAL_ERROR]   = 1'b0;  // of rtds_port

  assign live_o[BIT_LIVE_LOCKED]      = locked_i;
  assign live_o[BIT_LIVE_ADC_ALIVE]   = levels[0];
  assign live_o[BIT_LIVE_READY]       = levels[1];
  assign live_o[BIT_LIVE_PARAM_FAULT] = levels[2];
  assign live_o[BIT_LIVE_HALTED]      = levels[3];
  assign live_o[BIT_LIVE_BLANKED]     = levels[4];

  assign now_o = {
    motor_i[MOTOR_KB+:32], motor_i[MOTOR_KM+:32], motor_i[MOTOR_J+:32], motor_i[MOTOR_B+:32],
    inputs_i[INPUTS_T_R+:32], inputs_i[INPUTS_T_L+:32], inputs_i[INPUTS_V_R+:32], inputs_i[INPUTS_V_L+:32],
    state_i[STATE_W_R+:32], state_i[STATE_I_R+:32], state_i[STATE_W_L+:32], state_i[STATE_I_L+:32]
  };
  assign codes_o = {
    4'd0, dac_codes_i[47:36], 4'd0, dac_codes_i[35:24],
    4'd0, dac_codes_i[23:12], 4'd0, dac_codes_i[11:0],
    14'd0, record_i[61:60], 4'd0, record_i[59:48],
    4'd0, record_i[47:36], 4'd0, record_i[35:24],
    4'd0, record_i[23:12], 4'd0, record_i[11:0]
  };

  // --- LEDs: alive, locked, halted, blanked, parameter fault, ADC alive, serial traffic, running ----------------
  reg [24:0] blink_q;

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) blink_q <= 25'd0;
    else            blink_q <= blink_q + 25'd1;
  end

  assign led_o = {
    run_i, !uart_tx_i || !uart_rx_i, levels[0], levels[2], levels[4], levels[3], locked_i, blink_q[24]
  };

  wire unused = ^{motor_i[MOTOR_R+:32], motor_i[MOTOR_L+:32]};

endmodule

`default_nettype wire
