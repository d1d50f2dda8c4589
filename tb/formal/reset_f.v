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

  always @* if (!started) assume (!ext_rst_n && !locked && !clk_sys && !clk_adc);

  always @* if (started) begin
    if (!ext_rst_n) assert (!rst_sys_n && !rst_run_n && !rst_adc_n);
    if (!locked) assert (!rst_run_n && !rst_adc_n);
    if (rst_sys_n && !sys_q) assert (clk_sys && !clk_sys_q);
    if (rst_run_n && !run_q) assert (clk_sys && !clk_sys_q);
    if (rst_adc_n && !adc_q) assert (clk_adc && !clk_adc_q);
    if (rst_sys_n && !sys_q) assert (since_ext >= 3'd2);
    if (rst_run_n) assert (good >= 4'd6);
    if (rst_adc_n) assert (good >= 4'd6);
  end

  always @* if (started) begin
    cover (rst_run_n && rst_adc_n);
    cover (lock_lost && rst_sys_n);
    cover (rst_sys_n && !rst_run_n && good == 4'd5);
  end
endmodule
