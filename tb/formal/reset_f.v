// Proof of the resets: asserted with the cause and without a clock, released with the domain's clock only, and core and
// ADC not before the lock has been good for LOCK_CLOCKS. Both clocks, the button and the lock are free.
`default_nettype none

module reset_f (
    input wire clk_sys,
    input wire clk_adc,
    input wire ext_rst_n,
    input wire locked
);
  (* gclk *) wire gclk;

  wire rst_sys_n, rst_run_n, rst_adc_n, locked_o, lock_lost;

  reset_ctrl #(.LOCK_CLOCKS(3)) dut (
      .clk_sys_i(clk_sys), .clk_adc_i(clk_adc), .ext_rst_ni(ext_rst_n), .pll_locked_i(locked),
      .rst_sys_no(rst_sys_n), .rst_run_no(rst_run_n), .rst_adc_no(rst_adc_n), .locked_o(locked_o),
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

  reg started = 1'b0;
  reg clk_sys_q, clk_adc_q, sys_q = 1'b0, run_q = 1'b0, adc_q = 1'b0;
  reg [3:0] good = 4'd0;       // rising edges of clk_sys since the lock came, saturating
  reg [2:0] since_ext = 3'd0;  // rising edges of clk_sys since the button was released, saturating

  always @(posedge gclk) begin
    started   <= 1'b1;
    clk_sys_q <= clk_sys;
    clk_adc_q <= clk_adc;
    sys_q     <= rst_sys_n;
    run_q     <= rst_run_n;
    adc_q     <= rst_adc_n;
    if (!locked) good <= 4'd0;
    else if (started && clk_sys && !clk_sys_q && good != 4'd15) good <= good + 4'd1;
    if (!ext_rst_n) since_ext <= 3'd0;
    else if (started && clk_sys && !clk_sys_q && since_ext != 3'd7) since_ext <= since_ext + 3'd1;
  end

  // The counts as of this instant: an edge that falls into it is one.
  wire edge_now = started && clk_sys && !clk_sys_q;
  wire [4:0] good_now = locked ? {1'b0, good} + {4'd0, edge_now} : 5'd0;
  wire [3:0] ext_now = ext_rst_n ? {1'b0, since_ext} + {3'd0, edge_now} : 4'd0;

  always @* if (!started) assume (!ext_rst_n && !locked && !clk_sys && !clk_adc);

  always @* if (started) begin
    if (!ext_rst_n) assert (!rst_sys_n && !rst_run_n && !rst_adc_n);
    if (!locked) assert (!rst_run_n && !rst_adc_n);
    if (rst_sys_n && !sys_q) assert (clk_sys && !clk_sys_q);
    if (rst_run_n && !run_q) assert (clk_sys && !clk_sys_q);
    if (rst_adc_n && !adc_q) assert (clk_adc && !clk_adc_q);
    if (rst_sys_n && !sys_q) assert (ext_now >= 4'd3);
    if (rst_run_n) assert (good_now >= 5'd7);
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
    assert (dut.lock_count_q <= 8'd3);
    if (dut.lock_count_q != 8'd0) assert (dut.u_lock.rst_out_q && {3'd0, good_now} >= 8'd3 + dut.lock_count_q);
    if (dut.lock_ok_q) assert (dut.lock_count_q == 8'd3 && good_now >= 5'd7);
    if (rst_run_n || rst_adc_n) assert (dut.lock_ok_q);
  end

  always @* if (started) begin
    cover (rst_run_n && rst_adc_n);
    cover (lock_lost && rst_sys_n);
    cover (rst_sys_n && !rst_run_n && good == 4'd5);
  end
endmodule
