// Codes of what enters adder and multiplier of a row, for `include inside rtds_sequencer, which says them, and rtds_row, which
// carries them out.
// verilator lint_save
// verilator lint_off UNUSEDPARAM

// The adder's first operand, and its second.
localparam [1:0] A_C  = 2'd0;     // c
localparam [1:0] A_Y  = 2'd1;     // the adder's result
localparam [1:0] A_P  = 2'd2;     // first product of two
localparam [1:0] A_LO = 2'd3;     // low word, or t
localparam [2:0] B_M     = 3'd0;  // the multiplier's result
localparam [2:0] B_P     = 3'd1;  // first product of two
localparam [2:0] B_HI    = 3'd2;  // high word
localparam [2:0] B_Y     = 3'd3;  // the adder's result
localparam [2:0] B_TAKEN = 3'd4;  // what friction takes: rho taken in the electrical row

// {minus in the mechanical row, in the electrical row, second operand, first operand}: sums by what they are for.
localparam [6:0] ADD_V  = {2'b00, B_M, A_C};
localparam [6:0] ADD_T  = {2'b10, B_P, A_Y};
localparam [6:0] ADD_HI = {2'b00, B_HI, A_Y};
localparam [6:0] ADD_Z  = {2'b11, B_HI, A_Y};
localparam [6:0] ADD_LO = {2'b11, B_Y, A_LO};
localparam [6:0] ADD_S  = {2'b10, B_M, A_P};
localparam [6:0] ADD_C1 = {2'b11, B_M, A_LO};
localparam [6:0] ADD_C2 = {2'b01, B_M, A_Y};
localparam [6:0] ADD_P  = {2'b10, B_TAKEN, A_LO};
localparam [6:0] ADD_UT = {2'b10, B_M, A_C};
localparam [6:0] ADD_UV = {2'b00, B_M, A_Y};
localparam [6:0] ADD_Z0 = {2'b00, B_P, A_C};  // both zero

// {friction, input, G rather than S, second rather than first}
localparam [3:0] MUL_V     = 4'b0110;
localparam [3:0] MUL_T     = 4'b0111;
localparam [3:0] MUL_I     = 4'b0000;
localparam [3:0] MUL_W     = 4'b0001;
localparam [3:0] MUL_S1    = 4'b0010;
localparam [3:0] MUL_S2    = 4'b0011;
localparam [3:0] MUL_FIRST = 4'b1000;
localparam [3:0] MUL_OTHER = 4'b1001;

// verilator lint_restore
