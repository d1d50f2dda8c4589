// altddio_out: the vendor's double-data-rate output cell by its behaviour, for tools that do not have it: simulation, proof, and
// place and route on another family. Quartus takes its own.
//
// Purpose    dataout is datain_h in the high half of outclock and datain_l in the low half, both as they stood at the rising edge.
//            Two registers, one on each edge, of which only what has to change changes at an edge; their exclusive or
//            therefore has one changing input at a time and cannot glitch, as the cell's own multiplexer cannot.
// Ports      those that this design connects. Of the parameters only width 1 and an output enabled for ever are there.
// Crossing   none: aclr clears without a clock, as in the cell.
`default_nettype none

// verilator lint_off UNUSEDPARAM
// verilator lint_off UNUSEDSIGNAL
// verilog_lint: waive-start parameter-name-style
module altddio_out #(
    parameter intended_device_family = "",
    parameter extend_oe_disable = "OFF",
    parameter invert_output = "OFF",
    parameter lpm_hint = "UNUSED",
    parameter lpm_type = "altddio_out",
    parameter oe_reg = "UNREGISTERED",
    parameter power_up_high = "OFF",
    parameter width = 1
) (
    // verilog_lint: waive-stop parameter-name-style
    input  wire aclr,
    input  wire aset,
    input  wire datain_h,
    input  wire datain_l,
    output wire dataout,
    input  wire oe,
    output wire oe_out,
    input  wire outclock,
    input  wire outclocken,
    input  wire sclr,
    input  wire sset
);

  reg low_q;   // for the low half that follows
  reg rise_q;  // changes at rising edges
  reg fall_q;  // at falling ones

  always @(posedge outclock or posedge aclr) begin
    if (aclr) begin
      low_q  <= 1'b0;
      rise_q <= 1'b0;
    end else begin
      low_q  <= datain_l;
      rise_q <= fall_q ^ datain_h;
    end
  end

  always @(negedge outclock or posedge aclr) begin
    if (aclr) fall_q <= 1'b0;
    else      fall_q <= rise_q ^ low_q;
  end

  assign dataout = rise_q ^ fall_q;
  assign oe_out  = oe;

endmodule
// verilator lint_on UNUSEDSIGNAL
// verilator lint_on UNUSEDPARAM

`default_nettype wire
