// A product of two significands on an ECP5: four blocks of 18 by 18 bits, whose results are first added without carries, so that one
// carry chain follows them in place of two. The board's part has a block of 27 by 27 bits for it.
(* techmap_celltype = "$mul" *)
module product_of_significands (A, B, Y);
    parameter A_SIGNED = 0;
    parameter B_SIGNED = 0;
    parameter A_WIDTH = 24;
    parameter B_WIDTH = 24;
    parameter Y_WIDTH = 48;
    input [A_WIDTH-1:0] A;
    input [B_WIDTH-1:0] B;
    output [Y_WIDTH-1:0] Y;

    wire _TECHMAP_FAIL_ = A_SIGNED || B_SIGNED || A_WIDTH != 24 || B_WIDTH != 24 || Y_WIDTH != 48;

    wire [35:0] low = A[17:0] * B[17:0];
    wire [29:0] left = A[23:18] * B[17:0];
    wire [29:0] right = A[17:0] * B[23:18];
    wire [11:0] high = A[23:18] * B[23:18];

    wire [29:0] top = {high, low[35:18]};
    wire [29:0] sum = top ^ left ^ right;
    wire [29:0] carry = (top & left) | (top & right) | (left & right);

    assign Y = {sum + {carry[28:0], 1'b0}, low[17:0]};
endmodule
