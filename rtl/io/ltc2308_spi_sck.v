// ltc2308_spi_sck: forwards the 40 MHz clock to the SCK pin, one pulse for each clock with en_i = 1.
//
// Latency    en_i taken at edge n gives a pulse that rises half a clock later and falls at edge n+1.
// Pin        No gate stands in the clock's way: the output cell's own double-data-rate register makes the pulse, 0 in the
//            high half of clk_i, en_i in the low half. Quartus has the cell; rtl/vendor stands for it elsewhere.
// SDC        create_generated_clock -invert of clk_i on the port; see ltc2308_spi.
`default_nettype none

module ltc2308_spi_sck (
  input  wire clk_i,
  input  wire rst_ni,
  input  wire en_i,
  output wire sck_o
);

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

endmodule

`default_nettype wire
