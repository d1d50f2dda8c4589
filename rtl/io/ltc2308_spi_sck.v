// ltc2308_spi_sck: forwards the 40 MHz clock to the SCK pin, one pulse for each clock with en_i = 1.
//
// Latency    en_i taken at edge n gives a pulse that rises half a clock later and falls at edge n+1.
// Pin        No gate stands in the clock's way. In Quartus (which defines ALTERA_RESERVED_QIS) the output cell's
//            own double-data-rate register makes the pulse: 0 in the high half of clk_i, en_i in the low half.
//            Elsewhere two registers, one on each edge, of which exactly one changes at an edge; their
//            exclusive or therefore has one changing input at a time and cannot glitch.
// SDC        create_generated_clock -invert of clk_i on the port; see ltc2308_spi.
`default_nettype none

module ltc2308_spi_sck (
    input  wire clk_i,
    input  wire rst_ni,
    input  wire en_i,
    output wire sck_o
);

`ifdef ALTERA_RESERVED_QIS

  altddio_out #(
      .intended_device_family("Cyclone V"),
      .extend_oe_disable     ("OFF"),
      .invert_output         ("OFF"),
      .lpm_hint              ("UNUSED"),
      .lpm_type              ("altddio_out"),
      .oe_reg                ("UNREGISTERED"),
      .power_up_high         ("OFF"),
      .width                 (1)
  ) u_ddio (
      .aclr      (!rst_ni),
      .aset      (1'b0),
      .datain_h  (1'b0),
      .datain_l  (en_i),
      .dataout   (sck_o),
      .oe        (1'b1),
      .oe_out    (),
      .outclock  (clk_i),
      .outclocken(1'b1),
      .sclr      (1'b0),
      .sset      (1'b0)
  );

`else

  reg en_q;
  reg rise_q;
  reg fall_q;

  // Rising edge of clk_i: make the two equal (SCK low). Falling edge: make them differ if a pulse is wanted.
  always @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      en_q   <= 1'b0;
      fall_q <= 1'b0;
    end else begin
      en_q   <= en_i;
      fall_q <= rise_q;
    end
  end

  always @(negedge clk_i or negedge rst_ni) begin
    if (!rst_ni) rise_q <= 1'b0;
    else         rise_q <= fall_q ^ en_q;
  end

  assign sck_o = rise_q ^ fall_q;

`endif

endmodule

`default_nettype wire
