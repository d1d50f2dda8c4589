// reset_gate: signals out of a part that is about to be reset, into one of the same clock that lives on.
//
// Purpose     An asynchronous clear moves a register between two edges of its clock. What hears of that register but is not
//             cleared with it could take half of the change. Such signals pass here, and open_i has been 0 for a whole
//             clock before the clear comes (reset_ctrl): the listener sees zeros of a gate, not the edge of a reset.
// Handshake   none; q_o is d_i while open_i, else 0.
// Latency     0 (combinational).
// Crossing    of resets, not of clocks: d_i, open_i and the listener share one. tb/quartus follows every path between two
//             resets in the elaborated netlist and fails when one does not end in this module or in a cdc_sync.
`default_nettype none

module reset_gate #(
  parameter WIDTH = 1
) (
  input  wire             open_i,
  input  wire [WIDTH-1:0] d_i,
  output wire [WIDTH-1:0] q_o
);

  assign q_o = d_i & {WIDTH{open_i}};

endmodule

`default_nettype wire
