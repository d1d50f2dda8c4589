// crc16: one byte into a CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF, no reflection), combinational.
//
// Latency     0 (combinational; about 4 levels of XOR).
`default_nettype none

module crc16 (
  input  wire [15:0] crc_i,
  input  wire [ 7:0] data_i,
  output wire [15:0] crc_o
);

  function [15:0] step_byte;
    input [15:0] crc;
    input [7:0] data;
    integer k;
    reg [15:0] c;
    begin
      c = crc ^ {data, 8'h00};
      for (k = 0; k < 8; k = k + 1) c = c[15] ? ({c[14:0], 1'b0} ^ 16'h1021) : {c[14:0], 1'b0};
      step_byte = c;
    end
  endfunction

  assign crc_o = step_byte(crc_i, data_i);

endmodule

`default_nettype wire
