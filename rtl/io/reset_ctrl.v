// reset_ctrl: the chip's four resets out of the button and the PLL's lock.
//
// Purpose     rst_sys_no  board clock, follows the button alone: registers and serial port stay alive while
//                         the PLL is out of lock, so that they can tell of it.
//             rst_run_no  board clock, held until the PLL has been locked for LOCK_CLOCKS: core, scaling, DAC.
//             rst_pin_no  board clock, the same condition: the register of the DAC's /RESET pin alone.
//             rst_adc_no  40 MHz clock, the same condition: SPI master and sequencer.
// Handshake   lock_lost_o pulses for one clk_sys_i cycle a loss of a lock that had been accepted.
//             locked_o is the accepted lock.
//             open_o: what comes from the part behind rst_run_no may be listened to (see reset_gate): it falls a clock
//             before a lost lock brings that reset. held_o: that part stands in reset, for a clock or more.
// Latency     assertion: the button without any clock, everywhere; a lost lock without any clock for rst_pin_no and
//             rst_adc_no, with the 3rd or 4th board clock for rst_run_no. Release: LOCK_CLOCKS + 1 board clocks after
//             lock, then 3 clocks of the domain (rst_run_no: 3 board clocks more). A lock glitch of any width restarts
//             the count, so the resets last at least that long.
// Crossing    pll_locked_i and ext_rst_ni are asynchronous; they enter clear inputs only (see reset_sync), and
//             the level of `lock_ok_q` leaves this domain only as the clear of the other domains' reset_sync and through
//             u_ok.
`default_nettype none

module reset_ctrl #(
  parameter LOCK_CLOCKS = 63  // 1 .. 255
) (
  input  wire clk_sys_i,
  input  wire clk_adc_i,
  input  wire ext_rst_ni,   // button, low = reset
  input  wire pll_locked_i, // asynchronous
  output wire rst_sys_no,
  output wire rst_run_no,
  output wire rst_pin_no,
  output wire rst_adc_no,
  output wire open_o,
  output wire held_o,
  output wire locked_o,
  output wire lock_lost_o
);

  // A value that the widths here cannot hold ends the elaboration, with its name.
  generate
    if (LOCK_CLOCKS < 1 || LOCK_CLOCKS > 255) begin : g_bad_lock_clocks
      LOCK_CLOCKS_must_be_1_to_255 u_error ();
    end
  endgenerate

  reset_sync u_sys (
    .clk_i       (clk_sys_i),
    .async_rst_ni(ext_rst_ni),
    .rst_no      (rst_sys_no)
  );

  // The lock's own synchroniser is cleared by the lock itself: no glitch is too short to be seen.
  wire lock_sync;

  reset_sync u_lock (
    .clk_i       (clk_sys_i),
    .async_rst_ni(pll_locked_i),
    .rst_no      (lock_sync)
  );

  reg [7:0] lock_count_q;
  reg       lock_ok_q;

  // lock_sync is a reset of this domain (falls at any time, rises with the clock), so it may clear flops.
  always @(posedge clk_sys_i or negedge lock_sync) begin
    if (!lock_sync) begin
      lock_count_q <= 8'd0;
      lock_ok_q    <= 1'b0;
    end else if (lock_count_q == LOCK_CLOCKS) begin
      lock_ok_q <= 1'b1;
    end else begin
      lock_count_q <= lock_count_q + 8'd1;
    end
  end

  wire lock_allowed = lock_ok_q && ext_rst_ni;

  reset_sync u_pin (
    .clk_i       (clk_sys_i),
    .async_rst_ni(lock_allowed),
    .rst_no      (rst_pin_no)
  );

  reset_sync u_adc (
    .clk_i       (clk_adc_i),
    .async_rst_ni(lock_allowed),
    .rst_no      (rst_adc_no)
  );

  // lock_ok_q falls at any time: synchronise it before an edge is taken from it. It stays low for
  // LOCK_CLOCKS, so the fall cannot be missed.
  wire ok_sync;
  reg  ok_prev_q;
  reg  held_q;

  cdc_sync u_ok (
    .clk_i (clk_sys_i),
    .rst_ni(rst_sys_no),
    .d_i   (lock_ok_q),
    .q_o   (ok_sync)
  );

  always @(posedge clk_sys_i or negedge rst_sys_no) begin
    if (!rst_sys_no) begin
      ok_prev_q <= 1'b0;
      held_q    <= 1'b0;
    end else begin
      ok_prev_q <= ok_sync;
      held_q    <= !ok_prev_q;
    end
  end

  // The registers listen to what this reset clears, and are not cleared with it: they are told first.
  wire run_allowed = ok_prev_q && ext_rst_ni;

  reset_sync u_run (
    .clk_i       (clk_sys_i),
    .async_rst_ni(run_allowed),
    .rst_no      (rst_run_no)
  );

  assign open_o      = ok_sync;
  assign held_o      = held_q;
  assign locked_o    = ok_sync;
  assign lock_lost_o = ok_prev_q && !ok_sync;

endmodule

`default_nettype wire
