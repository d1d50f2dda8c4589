// hps_run: gives rtds_core the strobes of a request, keeps samples of its states, and counts what real time it missed.
//
// Purpose    A request is a number of steps with the inputs held; each sample_steps-th state and the last one are kept, up to
//            32 a request. Between two requests the motors' time stands still.
// Handshake  go_i for one clock while busy_o is 0 starts it, with all other inputs held until busy_o falls. A step starts
//            step_clocks_i clocks after the one before (500 = real time at 10 us), or as soon as the core is ready where
//            that is later; 0 = always as soon as ready.
// Counts     late_o: clocks by which strobes came later than their period, waits for the next request included, from the first
//            request on; 0 in a run that kept real time. It wraps at 2^32 (86 s), the host adds up.
// Latency    go_i to the first strobe: 1 clock, if the period has passed; last state to busy_o = 0: 1 clock. Samples: 1 clock
//            from address to word.
// Crossing   none.
`default_nettype none

module hps_run #(
  parameter GIVE_UP = 4096  // clocks waited for the core before a request is given up
) (
  input  wire         clk_i,
  input  wire         rst_ni,
  input  wire         clear_i,
  input  wire         go_i,
  input  wire  [31:0] steps_i,
  input  wire  [31:0] sample_steps_i,
  input  wire  [15:0] step_clocks_i,
  output wire         busy_o,
  output wire         stuck_o,      // until the next go_i
  output wire   [5:0] count_o,      // samples kept
  output wire  [31:0] late_o,
  input  wire   [4:0] sample_i,     // sample to be read
  output wire [127:0] sample_o,
  // rtds_core
  output wire         strobe_o,
  input  wire         ready_i,
  input  wire         valid_i,
  input  wire [127:0] state_i
);
  reg         busy_q;
  reg         stuck_q;
  reg   [5:0] count_q;
  reg  [31:0] late_q;
  reg [127:0] sample_out_q;
  reg [127:0] store [0:31];
  reg         pending_q;
  reg         started_q;   // there was a strobe
  reg  [31:0] left_q;
  reg  [31:0] sample_q;
  reg  [15:0] period_q;
  reg  [12:0] wait_q;

  wire period_over = period_q >= step_clocks_i;
  wire step_done   = pending_q & valid_i;
  wire last_step   = left_q == 32'd0;
  wire keep        = step_done & (last_step | (sample_q == 32'd1));
  wire give_up     = wait_q == GIVE_UP;

  assign strobe_o = busy_q & ready_i & period_over & ~pending_q & ~last_step & ~clear_i;

  always @(posedge clk_i) begin
    if (keep) store[count_q[4:0]] <= state_i;
    sample_out_q <= store[sample_i];
  end

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      busy_q    <= 1'b0;
      stuck_q   <= 1'b0;
      count_q   <= 6'd0;
      late_q    <= 32'd0;
      pending_q <= 1'b0;
      started_q <= 1'b0;
      left_q    <= 32'd0;
      sample_q  <= 32'd0;
      period_q  <= 16'd0;
      wait_q    <= 13'd0;
    end else if (clear_i) begin
      busy_q    <= 1'b0;
      stuck_q   <= 1'b0;
      count_q   <= 6'd0;
      late_q    <= 32'd0;
      pending_q <= 1'b0;
      started_q <= 1'b0;
      wait_q    <= 13'd0;
    end else begin
      if (strobe_o) period_q <= 16'd1;
      else if (period_q != 16'hFFFF) period_q <= period_q + 16'd1;
      if (started_q & period_over & ~strobe_o & (step_clocks_i != 16'd0)) late_q <= late_q + 32'd1;

      if (strobe_o) begin
        pending_q <= 1'b1;
        started_q <= 1'b1;
        left_q    <= left_q - 32'd1;
      end
      if (step_done) begin
        pending_q <= 1'b0;
        sample_q  <= keep ? sample_steps_i : sample_q - 32'd1;
        if (keep & ~count_q[5]) count_q <= count_q + 6'd1;
        if (last_step) busy_q <= 1'b0;
      end
      wait_q <= (strobe_o | step_done | ~busy_q | ~(pending_q | period_over) | give_up) ? 13'd0 : wait_q + 13'd1;
      if (give_up) begin
        stuck_q   <= 1'b1;
        busy_q    <= 1'b0;
        pending_q <= 1'b0;
      end
      if (go_i & ~busy_q) begin
        busy_q   <= steps_i != 32'd0;
        stuck_q  <= 1'b0;
        left_q   <= steps_i;
        sample_q <= sample_steps_i;
        count_q  <= 6'd0;
      end
    end
  end

  assign busy_o   = busy_q;
  assign stuck_o  = stuck_q;
  assign count_o  = count_q;
  assign late_o   = late_q;
  assign sample_o = sample_out_q;
endmodule

`default_nettype wire
