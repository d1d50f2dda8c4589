// Simulation top of the ideal link: rtds_core, and a sequencer that gives it strobes and keeps samples.
//
// Purpose   The host asks for a number of steps; this module runs them without waking the host in between. So the
//           simulator meets Python once for up to 32 samples, whatever the number of clocks.
// Handshake The bridge sets the inputs and toggles go_i; when steps_i steps are done and the samples stand in
//           samples_q, sync_o toggles. Everything the bridge reads is stable at least one clock before sync_o
//           toggles, so it may be read on that very event (Icarus calls back before other registers change).
//           Inputs may change only between a toggle of sync_o and the next toggle of go_i or fx_go_i.
// Period    step_clocks_i clocks from strobe to strobe (500 on the board), or as many as the core needs
//           (ready_o) where that is more; 0 = always as soon as ready. No result depends on it.
// Idle      While idle_o is 1 a request waits for the period alone. What the core's last clock set off (the low word, the
//           enables of its operators' stages) has come to rest three clocks after idle_o rose; from then on nothing moves but
//           period_q. The C++ main sets period_q on, to three clocks before the strobe, instead of evaluating each clock.
// Latency   go_i to first strobe: 1 clock (if the period has passed); last valid to sync_o: 1 clock.
// Numbers   binary32 words, SI at the motor shaft; a sample is {i_l, w_l, i_r, w_r}, i_l in the lowest word.
// Crossings none: one clock. With RTDS_CLOCK_INSIDE the clock is made here (Icarus is faster so); otherwise
//           the C++ main drives clk_i.
`timescale 1ns / 1ps
`default_nettype none

module rtds_sim_top #(
    parameter EFFECTS = 1,    // 0: a core without the effect unit, faster where no effect is on
    parameter GIVE_UP = 4096  // clocks waited for ready or valid of the core before a request is given up
) (
`ifndef RTDS_CLOCK_INSIDE
    input wire clk_i,
`endif
    input wire rst_ni,

    input wire         go_i,
    input wire [ 31:0] steps_i,
    input wire [ 31:0] sample_steps_i,
    input wire [ 15:0] step_clocks_i,

    // records of the core (rtds_core_records.vh); a toggle of fx_go_i writes word_i and is answered by sync_o
    input wire [127:0] inputs_i,
    input wire [191:0] motor_l_i,
    input wire [191:0] motor_r_i,
    input wire [ 62:0] settings_i,
    input wire         fx_go_i,
    input wire [ 45:0] word_i,

    output reg               sync_o,
    output reg  [       3:0] flags_o,       // {stuck, overrun, nonfinite, param_fault}, sticky but for the last
    output wire [      31:0] step_count_o,
    output wire              idle_o
);

  `include "rtds_core_records.vh"

`ifdef RTDS_CLOCK_INSIDE
  reg clk_i;
  initial begin
    clk_i = 1'b0;
    forever #10 clk_i = ~clk_i;
  end
`endif

  // Sample k in bits [128k +: 128]. Not a port, because a public port is copied at every clock.
  reg  [32*128-1:0] samples_q;

  wire        valid;
  wire        ready;
  wire        fx_ready;
  wire        overrun;
  wire        nonfinite;
  wire        param_fault;
  wire [127:0] state;

  reg         fx_write_q;  // a word for the effect unit stands in the next one
  reg  [45:0] word_q;
  reg         go_q;        // last go_i seen
  reg         running_q;   // a request is being worked on
  reg         pending_q;   // a step is under way: its valid has not come yet
  reg         done_q;      // the last sample stands, or a word is taken; toggle sync_o
  reg         fx_go_q;     // last fx_go_i seen
  reg  [31:0] left_q;      // strobes still to give
  reg  [31:0] sample_q;    // steps to the next sample
  reg  [ 4:0] index_q;     // samples kept (at most 32 a request, the bridge sees to it)
  reg  [15:0] period_q;    // clocks since the last strobe, saturating
  reg  [12:0] wait_q;      // clocks without progress

  // The inputs of the request. Held in registers so that a compiled simulation does not work through all that
  // hangs on an input of the top at each evaluation, whether it changed or not.
  reg [127:0] inputs_q;
  reg [191:0] motor_l_q;
  reg [191:0] motor_r_q;
  reg [ 62:0] settings_q;
  reg [ 15:0] step_clocks_q;

  wire        period_over = period_q >= step_clocks_q;
  wire        strobe = running_q & ready & period_over & ~pending_q & (left_q != 32'd0);
  wire        step_done = pending_q & valid;
  wire        last_step = left_q == 32'd0;
  wire        keep = step_done & (last_step | (sample_q == 32'd1));

  // Between two steps of a request: the strobe waits for the period alone.
  assign idle_o = running_q & ready & fx_ready & ~fx_write_q & ~pending_q & ~period_over & (go_i == go_q) & (fx_go_i == fx_go_q);

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      go_q      <= 1'b0;
      fx_go_q   <= 1'b0;
      fx_write_q <= 1'b0;
      running_q <= 1'b0;
      pending_q <= 1'b0;
      done_q    <= 1'b0;
      left_q    <= 32'd0;
      sample_q  <= 32'd0;
      index_q   <= 5'd0;
      period_q  <= 16'd0;
      wait_q    <= 13'd0;
      sync_o    <= 1'b0;
      flags_o   <= 4'd0;
    end else begin
      done_q <= 1'b0;
      if (done_q) sync_o <= ~sync_o;

      fx_write_q <= 1'b0;
      if (fx_go_i != fx_go_q && fx_ready && !fx_write_q) begin
        fx_go_q    <= fx_go_i;
        fx_write_q <= 1'b1;
        done_q     <= 1'b1;
      end

      if (overrun) flags_o[2] <= 1'b1;

      if (!strobe) begin
        if (period_q != 16'hFFFF) period_q <= period_q + 16'd1;
      end else begin
        period_q <= 16'd1;
      end

      if (strobe) begin
        pending_q <= 1'b1;
        left_q    <= left_q - 32'd1;
      end
      if (step_done) begin
        flags_o[0] <= param_fault;
        if (nonfinite) flags_o[1] <= 1'b1;
        pending_q <= 1'b0;
        sample_q  <= keep ? sample_steps_i : sample_q - 32'd1;
        if (keep) index_q <= index_q + 5'd1;
        if (last_step) begin
          running_q <= 1'b0;
          done_q    <= 1'b1;
        end
      end

      if (wait_q == GIVE_UP) begin
        flags_o[3] <= 1'b1;
        running_q  <= 1'b0;
        pending_q  <= 1'b0;
        done_q     <= 1'b1;
      end
      wait_q <= (strobe | step_done | ~running_q | ~(pending_q | period_over) | (wait_q == GIVE_UP)) ? 13'd0
                                                                                                     : wait_q + 13'd1;

      if (go_i != go_q) begin
        go_q      <= go_i;
        running_q <= 1'b1;
        left_q    <= steps_i;
        sample_q  <= sample_steps_i;
        index_q   <= 5'd0;
      end
    end
  end

  always @(posedge clk_i) begin
    if (go_i != go_q) begin
      inputs_q <= inputs_i;
      motor_l_q <= motor_l_i;
      motor_r_q <= motor_r_i;
      settings_q <= settings_i;
      step_clocks_q <= step_clocks_i;
    end
  end

  always @(posedge clk_i) begin
    if (fx_go_i != fx_go_q) word_q <= word_i;
  end

  // A blocking assignment on purpose: nothing in the design reads samples_q, and with a non-blocking one the
  // compiled simulation copies the whole vector at every clock.
  always @(posedge clk_i) begin
    if (keep) samples_q[{index_q, 7'd0}+:128] = {
      state[STATE_W_R+:32], state[STATE_I_R+:32], state[STATE_W_L+:32], state[STATE_I_L+:32]
    };
  end

  rtds_core #(
      .EFFECTS(EFFECTS)
  ) u_core (
      .clk_i        (clk_i),
      .rst_ni       (rst_ni),
      .strobe_i     (strobe),
      .clear_i      (1'b0),
      .inputs_i     (inputs_q),
      .motor_l_i    (motor_l_q),
      .motor_r_i    (motor_r_q),
      .settings_i   (settings_q),
      .word_valid_i (fx_write_q),
      .word_i       (word_q),
      .word_ready_o (fx_ready),
      .valid_o      (valid),
      .ready_o      (ready),
      .overrun_o    (overrun),
      .nonfinite_o  (nonfinite),
      .param_fault_o(param_fault),
      .step_count_o (step_count_o),
      .state_o      (state),
      .low_o        ()
  );

`ifdef RTDS_WAVES
  rtds_wave_view u_view (
      .strobe_i    (strobe),
      .valid_i     (valid),
      .ready_i     (ready),
      .step_count_i(step_count_o),
      .inputs_i    (inputs_q),
      .state_i     (state)
  );
`endif

endmodule

`default_nettype wire
