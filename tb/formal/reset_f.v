// Proof of the resets: asserted with the cause and without a clock, released with the domain's clock only, and core, ADC and
// DAC not before the lock has been good for LOCK_CLOCKS. A lost lock resets the core with the clock, four edges later at the
// latest, and no listener hears of it: open_o was 0 for a clock before. Both clocks, the button and the lock are free.
`default_nettype none

module reset_f (
    input wire clk_sys,
    input wire clk_adc,
    input wire ext_rst_n,
    input wire locked
);
  (* gclk *) wire gclk;

  wire rst_sys_n, rst_run_n, rst_pin_n, rst_adc_n, open, held, locked_o, lock_lost;

  reset_ctrl #(.LOCK_CLOCKS(3)) dut (
      .clk_sys_i(clk_sys), .clk_adc_i(clk_adc), .ext_rst_ni(ext_rst_n), .pll_locked_i(locked),
      .rst_sys_no(rst_sys_n), .rst_run_no(rst_run_n), .rst_adc_no(rst_adc_n), .rst_pin_no(rst_pin_n), .open_o(open), .held_o(held), .locked_o(locked_o),
      .lock_lost_o(lock_lost)
  );

  // Signals inside of dut, joined by Yosys when it flattens.
  (* hierconn *) wire \dut.u_lock.rst_meta_q ;
  (* hierconn *) wire \dut.u_lock.rst_sync_q ;
  (* hierconn *) wire \dut.u_lock.rst_out_q ;
  (* hierconn *) wire \dut.u_sys.rst_meta_q ;
  (* hierconn *) wire \dut.u_sys.rst_sync_q ;
  (* hierconn *) wire [7:0] \dut.lock_count_q ;
  (* hierconn *) wire \dut.lock_ok_q ;
  (* hierconn *) wire \dut.u_ok.cdc_meta_q ;
  (* hierconn *) wire \dut.u_ok.cdc_sync_q ;
  (* hierconn *) wire \dut.ok_prev_q ;
  (* hierconn *) wire \dut.u_pin.rst_meta_q ;
  (* hierconn *) wire \dut.u_pin.rst_sync_q ;
  (* hierconn *) wire \dut.u_run.rst_meta_q ;
  (* hierconn *) wire \dut.u_run.rst_sync_q ;

  reg started = 1'b0;
  reg clk_sys_q, clk_adc_q, sys_q = 1'b0, run_q = 1'b0, adc_q = 1'b0, pin_q = 1'b0;
  reg ext_q = 1'b0, open_q = 1'b0;
  reg [3:0] good = 4'd0;       // rising edges of clk_sys since the lock came, saturating
  reg [3:0] gone = 4'd0;       // rising edges of clk_sys since the accepted lock went, saturating
  reg [2:0] since_ext = 3'd0;  // rising edges of clk_sys since the button was released, saturating

  always @(posedge gclk) begin
    started   <= 1'b1;
    clk_sys_q <= clk_sys;
    clk_adc_q <= clk_adc;
    sys_q     <= rst_sys_n;
    run_q     <= rst_run_n;
    adc_q     <= rst_adc_n;
    pin_q     <= rst_pin_n;
    ext_q     <= ext_rst_n;
    open_q    <= open;
    if (!locked) good <= 4'd0;
    else if (started && clk_sys && !clk_sys_q && good != 4'd15) good <= good + 4'd1;
    if (dut.lock_ok_q) gone <= 4'd0;
    else if (started && clk_sys && !clk_sys_q && gone != 4'd15) gone <= gone + 4'd1;
    if (!ext_rst_n) since_ext <= 3'd0;
    else if (started && clk_sys && !clk_sys_q && since_ext != 3'd7) since_ext <= since_ext + 3'd1;
  end

  // The counts as of this instant: an edge that falls into it is one.
  wire edge_now = started && clk_sys && !clk_sys_q;
  wire [4:0] good_now = locked ? {1'b0, good} + {4'd0, edge_now} : 5'd0;
  wire [4:0] gone_now = dut.lock_ok_q ? 5'd0 : {1'b0, gone} + {4'd0, edge_now};
  wire [3:0] ext_now = ext_rst_n ? {1'b0, since_ext} + {3'd0, edge_now} : 4'd0;

  always @* if (!started) assume (!ext_rst_n && !locked && !clk_sys && !clk_adc);

  always @* if (started) begin
    if (!ext_rst_n) assert (!rst_sys_n && !rst_run_n && !rst_pin_n && !rst_adc_n);
    if (!locked) assert (!rst_pin_n && !rst_adc_n && !dut.lock_ok_q);
    if (gone_now >= 5'd4) assert (!rst_run_n);  // the first may fall together with the loss
    // A lost lock: with the clock, and open_o was 0 before.
    if (run_q && !rst_run_n && ext_rst_n && ext_q) assert (clk_sys && !clk_sys_q && !open_q && !open);
    if (open_q && !open && ext_rst_n && ext_q) assert (clk_sys && !clk_sys_q);
    if (held) assert (!rst_run_n);
    if (rst_sys_n && !sys_q) assert (clk_sys && !clk_sys_q);
    if (rst_run_n && !run_q) assert (clk_sys && !clk_sys_q);
    if (rst_pin_n && !pin_q) assert (clk_sys && !clk_sys_q);
    if (rst_adc_n && !adc_q) assert (clk_adc && !clk_adc_q);
    if (rst_sys_n && !sys_q) assert (ext_now >= 4'd3);
    if (rst_run_n && !run_q && dut.lock_ok_q) assert (good_now >= 5'd13);
    if (rst_pin_n) assert (good_now >= 5'd10);
    if (rst_adc_n) assert (good_now >= 5'd7);
  end

  // Ties for the induction: how far a release has come is how many edges there were.
  always @* if (started) begin
    if (dut.u_sys.rst_meta_q) assert (ext_now >= 4'd1);
    if (dut.u_sys.rst_sync_q) assert (ext_now >= 4'd2);
    if (rst_sys_n) assert (ext_now >= 4'd3);
    if (dut.u_lock.rst_meta_q) assert (good_now >= 5'd1);
    if (dut.u_lock.rst_sync_q) assert (good_now >= 5'd2);
    if (dut.u_lock.rst_out_q) assert (good_now >= 5'd3);
    if (rst_sys_n) assert (dut.u_sys.rst_sync_q);
    if (dut.u_sys.rst_sync_q) assert (dut.u_sys.rst_meta_q);
    if (dut.u_lock.rst_out_q) assert (dut.u_lock.rst_sync_q);
    if (dut.u_lock.rst_sync_q) assert (dut.u_lock.rst_meta_q);
    assert (dut.lock_count_q <= 8'd3);
    if (dut.lock_count_q != 8'd0) assert (dut.u_lock.rst_out_q && {3'd0, good_now} >= 8'd3 + dut.lock_count_q);
    if (dut.lock_ok_q) assert (dut.lock_count_q == 8'd3 && good_now >= 5'd7);
    if (rst_pin_n || rst_adc_n) assert (dut.lock_ok_q);
    if (dut.u_pin.rst_sync_q) assert (dut.u_pin.rst_meta_q);
    if (rst_pin_n) assert (dut.u_pin.rst_sync_q);
    if (dut.u_pin.rst_meta_q) assert (dut.lock_ok_q);
    if (!dut.lock_ok_q) assert (gone_now >= good_now);
    if (dut.lock_ok_q) begin
      if (dut.u_ok.cdc_meta_q) assert (good_now >= 5'd8);
      if (dut.u_ok.cdc_sync_q) assert (good_now >= 5'd9);
      if (dut.ok_prev_q) assert (good_now >= 5'd10);
      if (dut.u_run.rst_meta_q) assert (good_now >= 5'd11);
      if (dut.u_run.rst_sync_q) assert (good_now >= 5'd12);
      if (rst_run_n) assert (good_now >= 5'd13);
      if (dut.u_pin.rst_meta_q) assert (good_now >= 5'd8);
      if (dut.u_pin.rst_sync_q) assert (good_now >= 5'd9);
    end else begin
      if (gone_now >= 5'd2) assert (!dut.u_ok.cdc_meta_q);
      if (gone_now >= 5'd3) assert (!dut.u_ok.cdc_sync_q);
      if (gone_now >= 5'd4) assert (!dut.ok_prev_q);
    end
    if (dut.ok_prev_q && dut.lock_ok_q) assert (dut.u_ok.cdc_sync_q);
    if (dut.u_ok.cdc_sync_q && dut.lock_ok_q) assert (dut.u_ok.cdc_meta_q);
    if (dut.ok_prev_q && !dut.u_ok.cdc_sync_q) assert (!dut.u_ok.cdc_meta_q && !dut.lock_ok_q);
    if (dut.u_run.rst_meta_q) assert (dut.ok_prev_q && !held);
    if (dut.u_run.rst_sync_q) assert (dut.u_run.rst_meta_q);
    if (rst_run_n) assert (dut.u_run.rst_sync_q);
  end

  always @* if (started) begin
    cover (rst_run_n && rst_adc_n && rst_pin_n);
    cover (run_q && !rst_run_n && ext_rst_n && ext_q);
    cover (held && rst_sys_n && locked);
    cover (lock_lost && rst_sys_n);
    cover (rst_sys_n && !rst_run_n && good == 4'd5);
  end
endmodule
