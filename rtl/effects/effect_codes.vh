// Codes of the fields of effect_program, for `include inside effect_side, which carries them out. Made by
//   python -m rtds_host.motor.effect_program rtl/effects
// a test fails when the two differ.
// verilator lint_save
// verilator lint_off UNUSEDPARAM

localparam [1:0] MUL_A_REGISTER = 2'd0;
localparam [1:0] MUL_A_SLOPE = 2'd1;
localparam [1:0] MUL_A_SUM = 2'd2;

localparam [1:0] MUL_B_REGISTER = 2'd0;
localparam [1:0] MUL_B_DIRECT = 2'd1;
localparam [1:0] MUL_B_SUM = 2'd2;
localparam [1:0] MUL_B_PRODUCT = 2'd3;

localparam [1:0] ADD_A_REGISTER = 2'd0;
localparam [1:0] ADD_A_SUM = 2'd1;
localparam [1:0] ADD_A_LIMITED = 2'd2;

localparam [1:0] ADD_B_REGISTER = 2'd0;
localparam [1:0] ADD_B_PRODUCT = 2'd1;
localparam [1:0] ADD_B_INTERCEPT = 2'd2;
localparam [1:0] ADD_B_WRAP = 2'd3;

localparam [1:0] DIRECT_I = 2'd0;
localparam [1:0] DIRECT_W = 2'd1;
localparam [1:0] DIRECT_VC = 2'd2;

localparam [2:0] SOURCE_PRODUCT = 3'd0;
localparam [2:0] SOURCE_SUM = 3'd1;
localparam [2:0] SOURCE_T = 3'd2;
localparam [2:0] SOURCE_R = 3'd3;
localparam [2:0] SOURCE_KB = 3'd4;
localparam [2:0] SOURCE_VC = 3'd5;

localparam [1:0] WHICH_U_V = 2'd0;
localparam [1:0] WHICH_U_T = 2'd1;
localparam [1:0] WHICH_LEVEL_F = 2'd2;
localparam [1:0] WHICH_LEVEL_B = 2'd3;

localparam [2:0] TABLE_COMMAND = 3'd0;
localparam [2:0] TABLE_DROP = 3'd1;
localparam [2:0] TABLE_TORQUE = 3'd2;
localparam [2:0] TABLE_RIPPLE = 3'd3;
localparam [2:0] TABLE_FORWARD = 3'd4;
localparam [2:0] TABLE_BACKWARD = 3'd5;

// Tables below this one have arguments of both signs.
localparam [2:0] TABLE_UNSIGNED = 3'd3;

// What the addresses of the two load constants differ in.
localparam [6:0] OTHER_LOAD = 7'd3;

// verilator lint_restore
