// Proof of the clock-forwarding cell: SCK is high exactly in the low half of a clock whose rising edge took en = 1.
`default_nettype none

module sck_f (
    input wire clk,
    input wire rst_n,
    input wire en
);
  (* gclk *) wire gclk;

  wire sck;

  ltc2308_spi_sck dut (.clk_i(clk), .rst_ni(rst_n), .en_i(en), .sck_o(sck));

  // Signals inside of dut, joined by Yosys when it flattens.
  (* hierconn *) wire \dut.u_ddio.rise_q ;
  (* hierconn *) wire \dut.u_ddio.fall_q ;
  (* hierconn *) wire \dut.u_ddio.low_q ;

  reg started = 1'b0;
  reg clk_q = 1'b0, en_q = 1'b0, rst_q = 1'b0;
  reg wanted = 1'b0;  // en at the last rising edge

  always @(posedge gclk) begin
    started <= 1'b1;
    clk_q   <= clk;
    en_q    <= en;
    rst_q   <= rst_n;
    if (!rst_n) wanted <= 1'b0;
    else if (started && clk && !clk_q) wanted <= en_q;
  end

  always @* begin
    if (!started) assume (!clk && !rst_n);
    if (started) assume (clk != clk_q);               // a clock at half the solver's rate
    if (started && rst_q) assume (rst_n);
    if (started && rst_n && !rst_q) assume (clk_q);    // released away from the edge that takes en
    if (started && !(clk && !clk_q)) assume (en == en_q);
  end

  always @* if (started) begin
    if (clk) assert (!sck);
    if (!clk && rst_q) assert (sck == wanted);
    assert (dut.u_ddio.rise_q == dut.u_ddio.fall_q || !clk);
    if (rst_q) assert (dut.u_ddio.low_q == (clk && !clk_q ? dut.u_ddio.low_q : wanted));
    cover (sck && rst_n);
    cover (!clk && !sck && !wanted && rst_n && started);
  end
endmodule
