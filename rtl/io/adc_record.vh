// The record of one ADC sequence, five codes and what the fifth is: for each field the place of its lowest bit. And the numbers of
// the parameters that the fifth code may be. For `include inside a module; a module uses a part of it, hence the waiver.
// verilator lint_save
// verilator lint_off UNUSEDPARAM
localparam integer CODE_BITS = 12;
localparam integer RECORD_V_L = 0;
localparam integer RECORD_V_R = RECORD_V_L + CODE_BITS;
localparam integer RECORD_T_L = RECORD_V_R + CODE_BITS;
localparam integer RECORD_T_R = RECORD_T_L + CODE_BITS;
localparam integer RECORD_P = RECORD_T_R + CODE_BITS;
localparam integer RECORD_INDEX = RECORD_P + CODE_BITS;  // 2 bits: which parameter; all below are codes
localparam integer RECORD_BITS = RECORD_INDEX + 2;

localparam integer PARAM_B = 0;
localparam integer PARAM_J = 1;
localparam integer PARAM_KM = 2;
localparam integer PARAM_KB = 3;
// verilator lint_restore
