// pll_restart: resets the PLL when it has lost its lock, as its vendor asks for, and again while it does not come back.
//
// Purpose     After a loss of lock the phase between the outputs of an altera_pll is not sure until it has been reset, and
//             CONVST relies on it. Runs on the board's own clock, the PLL's reference.
// Handshake   rst_o: level, PULSE clocks long, at once after reset and at each loss of a lock; then the PLL has WAIT clocks
//             to lock before the next pulse.
// Latency     rst_o rises 3 to 4 clocks after locked_i has fallen for a clock or more. (What a shorter glitch does to the
//             chip is reset_ctrl's to say.)
// Crossing    locked_i is asynchronous and enters through cdc_sync. rst_o is a register.
`default_nettype none

module pll_restart #(
  parameter PULSE = 16,      // 320 ns
  parameter WAIT  = 131071   // 2.6 ms, less than 2**17; the PLL locks within 1 ms
) (
  input  wire clk_i,
  input  wire rst_ni,
  input  wire locked_i,
  output wire rst_o
);

  // A value that the widths here cannot hold ends the elaboration, with its name.
  generate
    if (WAIT < 2 || WAIT > 131071) begin : g_bad_wait
      WAIT_must_be_2_to_131071 u_error ();
    end
    if (PULSE < 1 || PULSE >= WAIT) begin : g_bad_pulse
      PULSE_must_be_1_to_less_than_WAIT u_error ();
    end
  endgenerate

  wire        locked;
  reg  [16:0] count_q;
  reg         rst_q;

  cdc_sync u_locked (
    .clk_i (clk_i),
    .rst_ni(rst_ni),
    .d_i   (locked_i),
    .q_o   (locked)
  );

  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      count_q <= 17'd0;
      rst_q   <= 1'b0;
    end else begin
      rst_q <= !locked && (count_q < PULSE);
      if (locked || count_q == WAIT) count_q <= 17'd0;
      else                           count_q <= count_q + 17'd1;
    end
  end

  assign rst_o = rst_q;

endmodule

`default_nettype wire
