// What a waveform shows of both motor units as numbers: the words of the link as reals, so that every viewer draws them.
//
// Purpose    Only in a simulator that writes waveforms (RTDS_WAVES): nothing in the design reads it.
// Numbers    SI at the motor shaft. A word with exponent 0 is zero, as in the operators, which have no subnormal numbers.
// Latency    none: the reals follow the words at once.
`timescale 1ns / 1ps
`default_nettype none

module rtds_wave_view (
    input wire         strobe_i,      // a step begins
    input wire         valid_i,       // its result is there
    input wire         ready_i,       // the core takes the next step
    input wire [ 31:0] step_count_i,
    input wire [127:0] inputs_i,
    input wire [127:0] state_i
);

  `include "rtds_core_records.vh"

  wire        strobe = strobe_i;
  wire        valid = valid_i;
  wire        ready = ready_i;
  wire [31:0] step = step_count_i;

  real        voltage_left_v;
  real        voltage_right_v;
  real        load_left_nm;
  real        load_right_nm;
  real        current_left_a;
  real        current_right_a;
  real        speed_left_rad_s;
  real        speed_right_rad_s;

  // binary32 as a real, which holds it exactly
  function real value;
    input [31:0] word;
    real size;
    integer power;
    begin
      power = {24'd0, word[30:23]};
      power = power - 150;
      size = {8'd0, 1'b1, word[22:0]};
      size = (word[30:23] == 8'd0) ? 0.0 : size * (2.0 ** power);
      value = word[31] ? -size : size;
    end
  endfunction

  always @(inputs_i) begin
    voltage_left_v  = value(inputs_i[INPUTS_V_L+:32]);
    voltage_right_v = value(inputs_i[INPUTS_V_R+:32]);
    load_left_nm    = value(inputs_i[INPUTS_T_L+:32]);
    load_right_nm   = value(inputs_i[INPUTS_T_R+:32]);
  end

  always @(state_i) begin
    current_left_a    = value(state_i[STATE_I_L+:32]);
    current_right_a   = value(state_i[STATE_I_R+:32]);
    speed_left_rad_s  = value(state_i[STATE_W_L+:32]);
    speed_right_rad_s = value(state_i[STATE_W_R+:32]);
  end

endmodule

`default_nettype wire
