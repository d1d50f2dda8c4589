// Clocks from an operator's operands to its result, for `include inside a module that counts them. tb/fp measures them.
// verilator lint_save
// verilator lint_off UNUSEDPARAM
localparam [6:0] FP_ADD_CLOCKS = 7'd3;
localparam [6:0] FP_MUL_CLOCKS = 7'd3;
localparam [6:0] FP_DIV_CLOCKS = 7'd32;
localparam [6:0] FP_FROM_INT_CLOCKS = 7'd2;
localparam [6:0] FP_TO_INT_CLOCKS = 7'd2;
// verilator lint_restore
